//! Speed of a logged position. A position that is too fast for a drone is in another unit, of two
//! drones, or on wrong stamps; a few such steps are sensor glitches.

use super::ImportOptions;
use super::recording::Channel;
use noctograph_core::error::{Error, Result};

/// Smaller steps do not count as movement, m.
const STEP_M: f64 = 1e-3;

/// Least size of a glitch, m: two stamps may be nearer to each other than their samples.
const GLITCH_M: f64 = 0.2;

/// Least number of fast steps that are more than glitches, and their share of all moving steps.
const FEWEST: usize = 3;
const SHARE: f64 = 0.1;

/// Refuses a position that moves too fast throughout; a warning of one that does in places.
pub(super) fn check(
    position: &[Channel],
    options: &ImportOptions,
    file: &str,
) -> Result<Option<String>> {
    let (mut n_moving, mut fast) = (0, Vec::new());
    for channel in position {
        let pairs = channel.time_s.windows(2).zip(channel.values.windows(2));
        for (time_s, place_m) in pairs {
            let step_m = (place_m[1] - place_m[0]).abs();
            let speed_m_s = step_m / (time_s[1] - time_s[0]);
            n_moving += usize::from(step_m > STEP_M);
            if step_m > STEP_M && speed_m_s > options.max_speed_m_s {
                fast.push((speed_m_s, time_s[0] - channel.start_s(), step_m));
            }
        }
    }
    let Some((fastest_m_s, time_s, _)) = fast.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0))
    else {
        return Ok(None);
    };
    let (n, most_m_s) = (fast.len(), options.max_speed_m_s);
    let seen = format!(
        "{n} of {n_moving} steps faster than {most_m_s} m/s (at {time_s:.2} s {fastest_m_s:.0} m/s)"
    );
    if n < FEWEST || (n as f64) < SHARE * n_moving as f64 {
        let is_far = fast.iter().any(|(.., step_m)| *step_m > GLITCH_M);
        return Ok(is_far.then(|| format!("the position has {seen}: glitches of its sensor?")));
    }
    let hint = "name the unit of the columns (x_cm, x_mm) or of the stamps (t_ms, t_min); keep the \
                rows of one drone alone; a drone that is as fast: raise the limit";
    Err(Error::input("max_speed_m_s", seen, "the position of one drone, in m and s", hint)
        .in_file(file, None))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(step_s: f64, places_m: impl Iterator<Item = f64>) -> Result<Option<String>> {
        let places_m: Vec<f64> = places_m.collect();
        let time_s = (0_u32..).map(|i| step_s * f64::from(i)).take(places_m.len()).collect();
        check(&[Channel::new(time_s, places_m)], &ImportOptions::default(), "log")
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
    }
}
