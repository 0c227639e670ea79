//! Gaps in a log. Lamps are lit across a gap only if the motion in it is known well enough.
//!
//! In a gap of T seconds the position follows a cubic that matches positions and velocities at both
//! ends, and the attitude changes at a constant rate. With an acceleration of `a`, the deviation is
//! at most about `a T² / 8`. The flight's acceleration is below `a` for 95 % of its time.

use std::borrow::Cow;

use nalgebra::Vector3;

use noctograph_core::flight::{Flight, FlightSample, airborne};
use noctograph_core::geometry::Attitude;
use noctograph_core::statistics::weighted_quantile;

/// Maximum uncertainty of a bridge: about the width of an overexposed trail. A larger limit would
/// draw strokes that were not flown, and a smaller limit would leave dashes.
const BRIDGE_M: f64 = 0.02;

/// Minimum assumed acceleration of a flight, in m/s²: the value of the reference flight.
const LEAST_M_S2: f64 = 0.4;

/// Time over which velocities are measured: ten samples of the firmware's position loop.
const VELOCITY_S: f64 = 0.1;

/// Time between the samples of a bridge.
const STEP_S: f64 = 0.01;

/// Quantile of speed and acceleration that is taken as their maximum.
const LARGEST: f64 = 0.95;

/// Maximum distance of a lamp from the center of a Crazyflie: half its diagonal, which is 92 mm
/// between motors.
const LAMP_M: f64 = 0.05;

/// A gap in a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Times of the last sample before the gap and of the first one after it.
    pub span_s: [f64; 2],
    /// Uncertainty of the position in the middle of the gap.
    pub uncertainty_m: f64,
}

impl Gap {
    /// True if lamps shine across the gap.
    pub fn is_bridged(&self) -> bool {
        self.uncertainty_m <= BRIDGE_M
    }
}

/// Returns the gaps of a flight, each with the uncertainty of a bridge over it.
pub fn gaps(flight: &Flight) -> Vec<Gap> {
    if flight.gaps.is_empty() {
        return Vec::new();
    }
    let acceleration_m_s2 = acceleration_m_s2(flight).max(LEAST_M_S2);
    Vec::from_iter(flight.gaps.iter().map(|span_s| {
        // The maximum deviation from a path of constant velocity is a T² / 8.
        let duration_s = span_s[1] - span_s[0];
        let uncertainty_m = acceleration_m_s2 * duration_s * duration_s / 8.0;
        Gap { span_s: *span_s, uncertainty_m }
    }))
}

/// Returns the gaps that are not bridged, each with the longest path of a lamp in it, in m.
pub fn dark(flight: &Flight) -> Vec<(Gap, f64)> {
    if flight.gaps.is_empty() {
        return Vec::new();
    }
    let speed_m_s = speed_m_s(flight);
    // A rotation of the drone can add the width of the drone to its path.
    let open = gaps(flight).into_iter().filter(|gap| !gap.is_bridged());
    open.map(|gap| (gap, 2.0 * LAMP_M + speed_m_s * (gap.span_s[1] - gap.span_s[0]))).collect()
}

/// Returns the samples of a flight, split at gaps that are not bridged. Bridges are filled with
/// interpolated samples.
pub(super) fn stretches(flight: &Flight) -> Vec<Cow<'_, [FlightSample]>> {
    if flight.gaps.is_empty() {
        return vec![Cow::Borrowed(&flight.samples)];
    }
    let (mut stretches, mut stretch) = (Vec::new(), Vec::new());
    let mut rest = &flight.samples[..];
    // Copies the samples up to each gap, and bridges the gap or ends the stretch.
    for gap in gaps(flight) {
        let (before, after) = rest.split_at(rest.partition_point(|s| s.time_s < gap.span_s[1]));
        rest = after;
        stretch.extend_from_slice(before);
        if gap.is_bridged() {
            stretch.extend(bridge(&stretch, after))
        } else {
            stretches.push(Cow::Owned(std::mem::take(&mut stretch)))
        }
    }
    stretch.extend_from_slice(rest);
    stretches.push(Cow::Owned(stretch));
    stretches
}

/// Returns interpolated samples between the end of `before` and the start of `after`, or none if
/// either has no samples.
fn bridge(before: &[FlightSample], after: &[FlightSample]) -> Vec<FlightSample> {
    let (Some(a), Some(b)) = (before.last(), after.first()) else { return Vec::new() };
    // Measures the velocities at both ends, or with too few samples the mean over the gap.
    let span_s = b.time_s - a.time_s;
    let chord_m_s = (b.position_m - a.position_m) / span_s;
    let start = before.partition_point(|s| s.time_s < a.time_s - VELOCITY_S);
    let end = after.partition_point(|s| s.time_s <= b.time_s + VELOCITY_S);
    let v_a = velocity_m_s(&before[start..]).unwrap_or(chord_m_s);
    let v_b = velocity_m_s(&after[..end]).unwrap_or(chord_m_s);
    #[expect(clippy::cast_possible_truncation, reason = "under a minute")]
    let steps = ((span_s / STEP_S).ceil() as u32).max(1);
    Vec::from_iter((1..steps).map(|step| {
        // Interpolates by a cubic Hermite curve, with 3u² - 2u³ between the positions.
        let u = f64::from(step) / f64::from(steps);
        let position_m = a.position_m.lerp(&b.position_m, u * u * (3.0 - 2.0 * u))
            + (v_a * u * ((1.0 - u) * (1.0 - u)) - v_b * u * u * (1.0 - u)) * span_s;
        let attitude = Attitude {
            yaw_rad: between_angles(a.attitude.yaw_rad, b.attitude.yaw_rad, u),
            pitch_rad: between_angles(a.attitude.pitch_rad, b.attitude.pitch_rad, u),
            roll_rad: between_angles(a.attitude.roll_rad, b.attitude.roll_rad, u),
        };
        FlightSample { time_s: a.time_s + span_s * u, position_m, attitude, ..*a }
    }))
}

/// Returns the angle at the fraction `u` of the shorter arc between two angles.
fn between_angles(from_rad: f64, to_rad: f64, u: f64) -> f64 {
    let turns = ((to_rad - from_rad) / std::f64::consts::TAU).round();
    from_rad + (to_rad - from_rad - turns * std::f64::consts::TAU) * u
}

/// Returns the mean velocity over samples in m/s, or `None` if they have no duration.
fn velocity_m_s(samples: &[FlightSample]) -> Option<Vector3<f64>> {
    let (first, last) = (samples.first()?, samples.last()?);
    let duration_s = last.time_s - first.time_s;
    (duration_s > 0.0).then(|| (last.position_m - first.position_m) / duration_s)
}

/// Returns the 95 % quantile of a flight's acceleration over time in m/s², outside of its gaps.
fn acceleration_m_s2(flight: &Flight) -> f64 {
    let runs = spaced(flight, &flight.samples);
    let accelerations = runs.iter().flat_map(|run| run.windows(3)).map(|triple| {
        let [before_m_s, after_m_s] = [(triple[0], triple[1]), (triple[1], triple[2])]
            .map(|(a, b)| (b.position_m - a.position_m) / (b.time_s - a.time_s));
        let duration_s = 0.5 * (triple[2].time_s - triple[0].time_s);
        ((after_m_s - before_m_s).norm() / duration_s, duration_s)
    });
    weighted_quantile(&mut accelerations.collect::<Vec<_>>(), LARGEST).unwrap_or(0.0)
}

/// Returns the 95 % quantile of a flight's speed over its time in the air in m/s, outside of its
/// gaps.
fn speed_m_s(flight: &Flight) -> f64 {
    let air = airborne(flight).unwrap_or(0..flight.samples.len());
    let runs = spaced(flight, &flight.samples[air]);
    let speeds = runs.iter().flat_map(|run| run.windows(2)).map(|pair| {
        let duration_s = pair[1].time_s - pair[0].time_s;
        ((pair[1].position_m - pair[0].position_m).norm() / duration_s, duration_s)
    });
    weighted_quantile(&mut speeds.collect::<Vec<_>>(), LARGEST).unwrap_or(0.0)
}

/// Thins samples so that they are at least [`VELOCITY_S`] apart, and splits them at the gaps.
fn spaced<'a>(flight: &Flight, samples: &'a [FlightSample]) -> Vec<Vec<&'a FlightSample>> {
    let mut gaps = flight.gaps.iter().peekable();
    let (mut runs, mut run) = (Vec::new(), Vec::<&FlightSample>::new());
    for sample in samples {
        if gaps.next_if(|gap| gap[1] <= sample.time_s).is_some() {
            runs.push(std::mem::take(&mut run));
        }
        if run.last().is_none_or(|last| sample.time_s - last.time_s >= VELOCITY_S) {
            run.push(sample);
        }
    }
    runs.push(run);
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::flight::FlightData;

    /// Returns a circle of 0.5 m/s and 0.5 m/s², sampled at 100 Hz, without samples in the gaps.
    fn circle(gaps: &[[f64; 2]]) -> Flight {
        fn sample(i: i32) -> FlightSample {
            let time_s = f64::from(i) * 0.01;
            let (sin, cos) = libm::sincos(time_s);
            let position_m = Vector3::new(0.5 * cos, 0.0, 1.0 + 0.5 * sin);
            FlightSample { time_s, position_m, ..FlightSample::default() }
        }
        let open = |s: &FlightSample| {
            gaps.iter().all(|[from, to]| s.time_s < from + 1e-9 || s.time_s > to - 1e-9)
        };
        let samples = (0..=600).map(sample).filter(open).collect();
        Flight::made(FlightData { samples, gaps: gaps.to_vec(), ..FlightData::default() })
    }

    #[test]
    fn a_bridge_keeps_to_the_path_within_its_uncertainty() {
        let flight = circle(&[[1.0, 1.5], [3.0, 4.5]]);
        let [short, long] = gaps(&flight)[..] else { panic!() };
        assert!(short.is_bridged() && !long.is_bridged(), "{short:?}, {long:?}");
        assert!((short.uncertainty_m - 0.5 * 0.25 / 8.0).abs() < 1e-3, "{short:?}");
        let stretches = stretches(&flight);
        assert_eq!(stretches.len(), 2, "the long gap stays open");
        let bridged = stretches[0].iter().filter(|s| s.time_s > 1.0 && s.time_s < 1.5);
        let errors = Vec::from_iter(bridged.map(|s| {
            let (sin, cos) = libm::sincos(s.time_s);
            (s.position_m - Vector3::new(0.5 * cos, 0.0, 1.0 + 0.5 * sin)).norm()
        }));
        assert!(errors.len() >= 45, "{} samples", errors.len());
        let worst_m = errors.into_iter().fold(0.0, f64::max);
        assert!(worst_m < 0.2 * short.uncertainty_m, "{worst_m} m off the circle");
        let [(gap, path_m)] = dark(&flight)[..] else { panic!("the long gap stays dark") };
        assert_eq!(gap, long);
        assert!((path_m - (2.0 * LAMP_M + 0.5 * 1.5)).abs() < 1e-3, "at 0.5 m/s: {path_m} m");
        assert!(stretches[0].windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
    }
}
