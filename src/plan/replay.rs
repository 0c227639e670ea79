//! A flight's setpoints as a plan: what was sent once is sent again.

use nalgebra::Vector3;

use super::{Plan, Setpoint};
use crate::error::{Error, Result};
use crate::flight::Flight;
use crate::flight::table::on_grid;

/// The plan that a flight followed: a setpoint wherever its design, its letter or its lights
/// change, at rest and held until the next, and a last one where the flight ends.
///
/// The first setpoint is the flight's first sample, at time 0; a design at or below the floor asks
/// for motors off, as in any plan. A log tells positions alone, so that the velocity is zero. A
/// simulated flight's design moves on between setpoints and changes with every sample; the plan's
/// own file is closer to what was sent there.
///
/// # Errors
///
/// [`Error::Input`] for a flight without samples, or one whose design is zero throughout, which is
/// how a log without setpoints reads.
pub fn replay(flight: &Flight) -> Result<Plan> {
    if flight.samples.iter().all(|sample| sample.design_m == Vector3::zeros()) {
        let hint = "name a flight or a log with the columns of its setpoints";
        return Err(Error::input("flight", "no design position", "setpoints to fly", hint));
    }
    let lights_at = |row: usize| flight.lights.values().map(move |levels| levels[row]);
    let last = flight.samples.len() - 1;
    let sent = |row: &usize| {
        let Some(before) = row.checked_sub(1) else { return true };
        let (from, to) = (&flight.samples[before], &flight.samples[*row]);
        let changed = from.design_m != to.design_m || from.letter != to.letter;
        changed || *row == last || lights_at(before).ne(lights_at(*row))
    };
    let rows: Vec<usize> = (0..=last).filter(sent).collect();
    let start_s = flight.samples[0].time_s;
    let setpoint = |row: &usize| {
        let sample = &flight.samples[*row];
        Setpoint {
            time_s: on_grid(sample.time_s - start_s),
            position_m: sample.design_m,
            velocity_m_s: Vector3::zeros(),
            acceleration_m_s2: Vector3::zeros(),
            letter: sample.letter,
        }
    };
    let column = |levels: &Vec<f64>| rows.iter().map(|row| levels[*row]).collect();
    let lights = flight.lights.iter().map(|(channel, levels)| (channel.clone(), column(levels)));
    Ok(Plan { setpoints: rows.iter().map(setpoint).collect(), lights: lights.collect() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::FlightSample;
    use crate::geometry::Attitude;

    /// A log at 100 Hz of setpoints `(time, x, light)`, each held until the next, to 1 s.
    fn logged(sent: &[(f64, f64, f64)]) -> Flight {
        let held = |time_s: f64| sent.iter().rfind(|s| s.0 <= time_s + 1e-9).unwrap();
        let times_s = (0..=100).map(|k| f64::from(k) / 100.0);
        let sample = |time_s: f64| FlightSample {
            time_s: time_s + 40.0,
            position_m: Vector3::zeros(),
            attitude: Attitude::default(),
            velocity_body_m_s: Vector3::x(),
            rate_body_rad_s: Vector3::zeros(),
            estimate_m: Vector3::zeros(),
            design_m: Vector3::new(held(time_s).1, 0.0, 0.5),
            motors: [0.0; 4],
            letter: None,
        };
        let lights = times_s.clone().map(|time_s| held(time_s).2).collect();
        Flight {
            samples: times_s.map(sample).collect(),
            lights: [("headlights".to_owned(), lights)].into(),
            ..Flight::default()
        }
    }

    #[test]
    fn what_was_sent_is_sent_again_once() {
        let sent = [(0.0, 0.0, 0.0), (0.11, 0.02, 0.0), (0.2, 0.04, 0.0), (0.5, 0.04, 1.0)];
        let plan = replay(&logged(&sent)).unwrap();
        let found = plan.setpoints.iter().zip(&plan.lights["headlights"]);
        let found: Vec<_> = found.map(|(s, l)| (s.time_s, s.position_m.x, *l)).collect();
        assert_eq!(found, [&sent[..], &[(1.0, 0.04, 1.0)]].concat());
        assert!(plan.setpoints.iter().all(|s| s.velocity_m_s == Vector3::zeros()), "held");
    }

    #[test]
    fn a_flight_without_setpoints_is_refused() {
        let mut flight = logged(&[(0.0, 0.0, 0.0)]);
        flight.samples.iter_mut().for_each(|sample| sample.design_m.fill(0.0));
        for flight in [flight, Flight::default()] {
            assert!(replay(&flight).unwrap_err().to_string().contains("no design"), "refused");
        }
    }
}
