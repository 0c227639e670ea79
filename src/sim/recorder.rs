//! Writes a flight down while it is flown.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::vehicle::{State, attitude, position, rate, velocity};
use crate::flight::{Flight, FlightSample};
use crate::geometry::Attitude;
use crate::plan::{Plan, Setpoint};

/// Collects samples. Every figure is rounded to 1e-6 (µm, µrad, µs), so that a file with six
/// decimals gives back exactly the flight that was written.
#[derive(Debug)]
pub(super) struct Recorder<'a> {
    plan: &'a Plan,
    flight: Flight,
}

/// What the drone knows and does at one tick.
#[derive(Debug)]
pub(super) struct Moment<'a> {
    pub(super) time_s: f64,
    pub(super) state: &'a State,
    pub(super) estimate: &'a State,
    pub(super) motors: [f64; 4],
    /// Index of the setpoint in force.
    pub(super) setpoint: usize,
}

impl<'a> Recorder<'a> {
    /// A recorder for about `n` samples.
    pub(super) fn new(plan: &'a Plan, n: usize) -> Self {
        let lights: BTreeMap<_, _> =
            plan.lights.keys().map(|channel| (channel.clone(), Vec::with_capacity(n))).collect();
        Self {
            plan,
            flight: Flight { samples: Vec::with_capacity(n), lights, ..Flight::default() },
        }
    }

    pub(super) fn record(&mut self, moment: &Moment<'_>) {
        let setpoint = &self.plan.setpoints[moment.setpoint];
        self.flight.samples.push(sample(moment, setpoint));
        for (column, sent) in self.flight.lights.values_mut().zip(self.plan.lights.values()) {
            column.push(micro(sent[moment.setpoint]));
        }
    }

    pub(super) fn finish(self, warnings: Vec<String>) -> Flight {
        Flight { warnings, ..self.flight }
    }
}

fn sample(moment: &Moment<'_>, setpoint: &Setpoint) -> FlightSample {
    let Attitude { yaw_rad, pitch_rad, roll_rad } = attitude(moment.state);
    FlightSample {
        time_s: micro(moment.time_s),
        position_m: micros(position(moment.state)),
        attitude: Attitude {
            yaw_rad: micro(yaw_rad),
            pitch_rad: micro(pitch_rad),
            roll_rad: micro(roll_rad),
        },
        velocity_body_m_s: micros(velocity(moment.state)),
        rate_body_rad_s: micros(rate(moment.state)),
        estimate_m: micros(position(moment.estimate)),
        design_m: micros(setpoint.design_m(moment.time_s)),
        motors: moment.motors.map(micro),
        letter: setpoint.letter,
    }
}

fn micros(values: Vector3<f64>) -> Vector3<f64> {
    values.map(micro)
}

/// The nearest number with six decimals, zero without a sign.
fn micro(value: f64) -> f64 {
    (value * 1e6).round() / 1e6 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_decimals_give_the_same_number_back() {
        for i in 0..10_000 {
            let value = micro(libm::sin(f64::from(i)) * libm::exp(f64::from(i % 12)));
            assert_eq!(format!("{value:.6}").parse::<f64>().unwrap(), value);
        }
        assert_eq!(format!("{:.6}", micro(-1e-9)), "0.000000");
    }
}
