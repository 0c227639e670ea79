//! Checks the speed of a logged position. A position that is too fast for a drone has the wrong
//! unit or times, or belongs to two drones. A few such steps are sensor glitches.

use super::ImportOptions;
use super::recording::Channel;
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Result};

/// Code of the warnings about glitches.
const GLITCHES: &str = "position-glitches";

/// Minimum step that counts as movement, m.
const STEP_M: f64 = 1e-3;

/// Minimum size of a glitch, m. Smaller steps may seem fast because their times are inaccurate.
const GLITCH_M: f64 = 0.2;

/// Minimum acceleration of a spike, m/s², which no drone reaches. A spike is a single sample that
/// leaves the path, which then continues.
const SPIKE_M_S2: f64 = 40.0;

/// Minimum distance of a spike from the midpoint of its neighbors, m, and maximum distance between
/// the neighbors as a fraction of it.
const SPIKE_M: f64 = 0.1;
const RETURN_FRACTION: f64 = 0.5;

/// Minimum number of fast steps that are not just glitches, and their minimum fraction among all
/// moving steps.
const MIN_FAST_STEPS: usize = 3;
const MIN_FAST_FRACTION: f64 = 0.1;

/// A step of a position along one axis that is too fast.
#[derive(Clone, Copy)]
struct FastStep {
    speed_m_s: f64,
    /// Time from the first sample to the start of the step.
    time_s: f64,
    step_m: f64,
}

/// Returns [`Error::Input`] if many steps of a position are faster than `max_speed_m_s`. Returns a
/// warning if a few steps are, or about spikes, and otherwise `None`. `position` has a channel for
/// each axis, in m.
pub(super) fn check(
    position: &[Channel],
    options: &ImportOptions,
    file: &str,
) -> Result<Option<Diagnostic>> {
    let (mut n_moving, mut fast) = (0, Vec::<FastStep>::new());
    for channel in position {
        let pairs = channel.time_s.windows(2).zip(channel.values.windows(2));
        for (time_s, position_m) in pairs {
            let step_m = (position_m[1] - position_m[0]).abs();
            let speed_m_s = step_m / (time_s[1] - time_s[0]);
            n_moving += usize::from(step_m > STEP_M);
            if step_m > STEP_M && speed_m_s > options.max_speed_m_s {
                let time_s = time_s[0] - channel.start_s();
                fast.push(FastStep { speed_m_s, time_s, step_m });
            }
        }
    }
    let fastest = fast.iter().copied().max_by(|a, b| a.speed_m_s.total_cmp(&b.speed_m_s));
    let Some(FastStep { speed_m_s: fastest_m_s, time_s, .. }) = fastest else {
        return Ok(spikes(position));
    };
    // A few fast steps are glitches, and small ones result from errors in the times.
    let (n, most_m_s) = (fast.len(), options.max_speed_m_s);
    let seen = format!(
        "{n} of {n_moving} steps faster than {most_m_s} m/s (at {time_s:.2} s {fastest_m_s:.0} m/s)"
    );
    if n < MIN_FAST_STEPS || (n as f64) < MIN_FAST_FRACTION * n_moving as f64 {
        let is_far = fast.iter().any(|step| step.step_m > GLITCH_M);
        let text = format!("the position has {seen}: glitches of its sensor?");
        return Ok(is_far.then(|| Diagnostic::warning(GLITCHES, text)));
    }
    let hint = "name the unit of the columns (x_cm, x_mm) or of the times (t_ms, t_min); keep only \
                the rows of one drone; or raise the limit, if the drone is this fast";
    Err(Error::input("max_speed_m_s", seen, "the position of one drone, in m and s", hint)
        .in_file(file, None))
}

/// Returns a warning if single samples leave the path and return, faster than a drone can.
fn spikes(position: &[Channel]) -> Option<Diagnostic> {
    let (mut n, mut first_s, mut farthest_m) = (0, f64::INFINITY, 0.0_f64);
    for channel in position {
        let pairs = channel.time_s.windows(3).zip(channel.values.windows(3));
        for (time_s, position_m) in pairs {
            let distance_m = (position_m[1] - f64::midpoint(position_m[0], position_m[2])).abs();
            let step_s = 0.5 * (time_s[2] - time_s[0]);
            // The sample leaves and returns with a = 2 x / t², which no drone can reach.
            if distance_m > SPIKE_M
                && (position_m[2] - position_m[0]).abs() < RETURN_FRACTION * distance_m
                && 2.0 * distance_m > SPIKE_M_S2 * step_s * step_s
            {
                n += 1;
                first_s = first_s.min(time_s[1] - channel.start_s());
                farthest_m = farthest_m.max(distance_m);
            }
        }
    }
    let text = format!(
        "{n} single sample(s) of the position jump aside by up to {farthest_m:.2} m and return \
         (first at {first_s:.2} s), faster than a drone can: glitches of the sensor or the log?"
    );
    (n > 0).then(|| Diagnostic::warning(GLITCHES, text))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(step_s: f64, places_m: impl Iterator<Item = f64>) -> Result<Option<String>> {
        let places_m: Vec<f64> = places_m.collect();
        let time_s = (0_u32..).map(|i| step_s * f64::from(i)).take(places_m.len()).collect();
        let position = [Channel::new(time_s, places_m)];
        let warning = check(&position, &ImportOptions::default(), "log")?;
        Ok(warning.map(|warning| warning.message))
    }

    #[test]
    fn two_drones_centimeters_and_wrong_stamps_are_too_fast_and_a_glitch_is_none() {
        let climb = |scale: f64| (0..100).map(move |i| scale * (0.02 * f64::from(i)).min(1.0));
        assert_eq!(checked(0.02, climb(1.0)).unwrap(), None);
        assert!(checked(0.02, climb(100.0)).is_err(), "centimeters");
        assert!(checked(0.02 / 60.0, climb(1.0)).is_err(), "minutes");
        let two = climb(1.0).enumerate().map(|(i, z)| if i % 2 == 0 { z } else { z + 1.5 });
        assert!(checked(0.02, two).is_err(), "two drones");
        let glitch = climb(1.0).enumerate().map(|(i, z)| if i == 20 { z + 3.0 } else { z });
        let said = checked(0.02, glitch).unwrap().unwrap();
        assert!(said.contains("2 of 5"), "{said}");
        let spike = climb(1.0).enumerate().map(|(i, z)| if i == 60 { z - 0.25 } else { z });
        let said = checked(0.1, spike).unwrap().unwrap();
        assert!(said.contains("1 single sample") && said.contains("at 6.00 s"), "{said}");
        let turns = (0..100).map(|i| if i / 5 % 2 == 0 { 0.0 } else { 0.3 });
        assert_eq!(checked(0.2, turns).unwrap(), None, "a place that is kept");
    }
}
