//! Replay, which converts a flight's setpoints to a plan that can be sent again.

use nalgebra::Vector3;

use super::{Plan, PlanData, Setpoint};
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::Flight;
use noctograph_core::flight::table::on_grid;
use noctograph_core::statistics::median;

/// Distance between setpoints, in median steps, above which setpoints were lost.
const LOST_STEPS: f64 = 1.5;
/// Range of the speed between two setpoints, relative to the median speed, within which setpoints
/// may have been lost. Outside this range, the drone jumped or waited.
const LOST_SPEED: std::ops::Range<f64> = 0.7..1.3;

/// Setpoints of a flight that can be flown again.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Replay {
    /// Plan with the setpoints.
    pub plan: Plan,
    /// Number of the plan's setpoints that were missing in the log and that [`replay`] restored.
    pub n_restored: usize,
}

/// Returns the plan that a flight followed. The plan contains a setpoint at rest at each change of
/// the design, letter or lights, and a last one at the end of the flight.
///
/// A log loses packets that the drone received. If two setpoints are more than one and a half
/// median steps apart and the drone moved at the median speed, the missing setpoints are restored
/// at equal intervals. In the reference flight, one setpoint in fifteen is restored.
///
/// # Errors
///
/// Returns [`Error::Input`] for a flight without samples, and for one without setpoints, whose
/// design consists of zeros.
pub fn replay(flight: &Flight) -> Result<Replay> {
    if flight.samples.iter().all(|sample| sample.design_m == Vector3::zeros()) {
        let hint = "name a flight or a log that contains setpoint columns";
        return Err(Error::input("flight", "no design position", "setpoints to fly", hint));
    }
    let sent = logged(flight);
    let median_step = median_step(&sent);
    let channels: Vec<String> = flight.lights.keys().cloned().collect();
    let (mut plan, mut n_restored) = (PlanData::with_channels(&channels), 0);
    for (index, (setpoint, row)) in sent.iter().enumerate() {
        // Lost setpoints are restored first, at equal intervals, with the previous letter and
        // lights.
        if let Some((before, row_before)) = index.checked_sub(1).map(|before| &sent[before]) {
            let n_lost = lost_between(before, setpoint, median_step);
            for k in 1..=n_lost {
                let fraction = f64::from(k) / f64::from(n_lost + 1);
                let path_m = setpoint.position_m - before.position_m;
                let restored = Setpoint {
                    time_s: on_grid(before.time_s + fraction * (setpoint.time_s - before.time_s)),
                    position_m: (before.position_m + path_m * fraction).map(on_grid),
                    ..*before
                };
                push(&mut plan, restored, flight, *row_before);
            }
            n_restored += n_lost as usize;
        }
        push(&mut plan, *setpoint, flight, *row);
    }
    Ok(Replay { plan: Plan::new(plan)?, n_restored })
}

/// Adds a setpoint to a plan with the light levels from a row of the flight.
fn push(plan: &mut PlanData, setpoint: Setpoint, flight: &Flight, row: usize) {
    plan.setpoints.push(setpoint);
    for (column, levels) in plan.lights.values_mut().zip(flight.lights.values()) {
        column.push(levels[row]);
    }
}

/// Returns the setpoints that a flight logged, at rest, each with its row. These are the first row,
/// the last row, and each row that differs from the previous one.
fn logged(flight: &Flight) -> Vec<(Setpoint, usize)> {
    let lights_at = |row: usize| flight.lights.values().map(move |levels| levels[row]);
    let last = flight.samples.len() - 1;
    // A row is a new setpoint if its design, its letter or a light differs from the row before.
    let sent = |row: &usize| {
        let Some(before) = row.checked_sub(1) else { return true };
        let (from, to) = (&flight.samples[before], &flight.samples[*row]);
        let changed = from.design_m != to.design_m || from.letter != to.letter;
        changed || *row == last || lights_at(before).ne(lights_at(*row))
    };
    let setpoint = |row: usize| {
        let sample = &flight.samples[row];
        Setpoint {
            time_s: on_grid(sample.time_s - flight.samples[0].time_s),
            position_m: sample.design_m,
            letter: sample.letter,
            ..Setpoint::default()
        }
    };
    (0..=last).filter(sent).map(|row| (setpoint(row), row)).collect()
}

/// Returns the medians of the distance in m and of the speed in m/s between setpoints that moved,
/// or zeros without any.
fn median_step(logged: &[(Setpoint, usize)]) -> [f64; 2] {
    let steps = logged.windows(2).map(|pair| step(&pair[0].0, &pair[1].0));
    let moves = steps.filter(|[length_m, lasts_s]| *length_m > 0.0 && *lasts_s > 0.0);
    let (lengths, speeds): (Vec<f64>, Vec<f64>) =
        moves.map(|[length, lasts]| (length, length / lasts)).unzip();
    [lengths, speeds].map(|values| median(values).unwrap_or(0.0))
}

/// Returns the number of setpoints that a log lost between two, by the median distance in m and the
/// median speed in m/s. If the log has no median, none was lost.
fn lost_between(from: &Setpoint, to: &Setpoint, [median_m, median_m_s]: [f64; 2]) -> u32 {
    let [length_m, lasts_s] = step(from, to);
    let steps = length_m / median_m;
    let at_speed = LOST_SPEED.contains(&(length_m / (lasts_s * median_m_s)));
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let n_lost = if steps >= LOST_STEPS && at_speed { steps.round() as u32 - 1 } else { 0 };
    n_lost
}

/// Returns the distance in m and time in s from one setpoint to the next.
fn step(from: &Setpoint, to: &Setpoint) -> [f64; 2] {
    [(to.position_m - from.position_m).norm(), to.time_s - from.time_s]
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::flight::FlightData;
    use noctograph_core::flight::FlightSample;

    /// Creates a 1 s log at 100 Hz of setpoints `(time, x, light)`, each held until the next.
    fn logged(sent: &[(f64, f64, f64)]) -> Flight {
        let held = |time_s: f64| sent.iter().rfind(|s| s.0 <= time_s + 1e-9).unwrap();
        let times_s = (0..=100).map(|k| f64::from(k) / 100.0);
        let sample = |time_s: f64| FlightSample {
            time_s: time_s + 40.0,
            velocity_body_m_s: Vector3::x(),
            design_m: Vector3::new(held(time_s).1, 0.0, 0.5),
            ..FlightSample::default()
        };
        let lights = times_s.clone().map(|time_s| held(time_s).2).collect();
        Flight::made(FlightData {
            samples: times_s.map(sample).collect(),
            lights: [("headlights".to_owned(), lights)].into(),
            ..FlightData::default()
        })
    }

    #[test]
    fn each_setpoint_is_replayed_once() {
        let sent = [(0.0, 0.0, 0.0), (0.11, 0.02, 0.0), (0.2, 0.04, 0.0), (0.5, 0.04, 1.0)];
        let Replay { plan, n_restored } = replay(&logged(&sent)).unwrap();
        assert_eq!(n_restored, 0);
        let actual = plan.setpoints.iter().zip(&plan.lights["headlights"]);
        let actual: Vec<_> = actual.map(|(s, l)| (s.time_s, s.position_m.x, *l)).collect();
        assert_eq!(actual, [&sent[..], &[(1.0, 0.04, 1.0)]].concat());
        assert!(plan.setpoints.iter().all(|s| s.velocity_m_s == Vector3::zeros()), "held");
    }

    #[test]
    fn lost_setpoints_are_restored_and_waits_and_jumps_are_not() {
        // Steps of 0.02 m every 0.1 s precede a wait and a jump. The setpoints at 0.3 and 0.4 s are
        // lost.
        let sent = [
            (0.0, 0.0, 0.0),
            (0.1, 0.02, 0.0),
            (0.2, 0.04, 0.0),
            (0.5, 0.1, 0.0),
            (0.6, 0.12, 0.0),
            (0.9, 0.14, 0.0),
            (0.95, 0.3, 0.0),
        ];
        let Replay { plan, n_restored } = replay(&logged(&sent)).unwrap();
        assert_eq!(n_restored, 2);
        let actual = |k: usize| (plan.setpoints[k].time_s, plan.setpoints[k].position_m.x);
        assert_eq!([2, 3, 4, 5].map(actual), [(0.2, 0.04), (0.3, 0.06), (0.4, 0.08), (0.5, 0.1)]);
        assert_eq!(plan.lights["headlights"].len(), plan.setpoints.len());
    }

    #[test]
    fn a_flight_without_setpoints_is_refused() {
        let mut flight = logged(&[(0.0, 0.0, 0.0)]);
        flight
            .edit(|flight| flight.samples.iter_mut().for_each(|sample| sample.design_m.fill(0.0)));
        for flight in [flight, Flight::default()] {
            assert!(replay(&flight).unwrap_err().to_string().contains("no design"), "refused");
        }
    }
}
