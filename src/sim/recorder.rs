//! Writes a flight down while it is flown.

use std::collections::BTreeMap;

use super::vehicle::{State, attitude, position, rate, velocity};
use crate::flight::table::on_grid;
use crate::flight::{BATTERY_V, ENERGY_J, Flight, FlightSample, SATURATED_S};
use crate::geometry::Attitude;
use crate::plan::{Plan, Setpoint};

/// Collects samples. Every figure is rounded to 1e-6 (µm, µrad, µs), so that a file with six
/// decimals gives back exactly the flight that was written.
#[derive(Debug)]
pub(super) struct Recorder<'a> {
    plan: &'a Plan,
    flight: Flight,
    further: BTreeMap<&'static str, Vec<f64>>,
}

/// What the drone knows and does at one tick.
#[derive(Debug)]
pub(super) struct Moment {
    pub(super) time_s: f64,
    pub(super) state: State,
    pub(super) estimate: State,
    pub(super) motors: [f64; 4],
    /// Index of the setpoint in force.
    pub(super) setpoint: usize,
    /// Time so far with a motor at its limit.
    pub(super) saturated_s: f64,
    /// Voltage (V) and energy so far (J), where there is a battery.
    pub(super) battery: Option<(f64, f64)>,
}

impl<'a> Recorder<'a> {
    /// A recorder for about `n` samples.
    pub(super) fn new(plan: &'a Plan, n: usize) -> Self {
        let lights: BTreeMap<_, _> =
            plan.lights.keys().map(|channel| (channel.clone(), Vec::with_capacity(n))).collect();
        Self {
            plan,
            flight: Flight { samples: Vec::with_capacity(n), lights, ..Flight::default() },
            further: BTreeMap::new(),
        }
    }

    pub(super) fn record(&mut self, moment: &Moment) {
        let setpoint = &self.plan.setpoints[moment.setpoint];
        self.flight.samples.push(sample(moment, setpoint));
        for (column, sent) in self.flight.lights.values_mut().zip(self.plan.lights.values()) {
            column.push(on_grid(sent[moment.setpoint]));
        }
        let battery = moment.battery.map(|(v, j)| [(BATTERY_V, v), (ENERGY_J, j)]);
        for (name, value) in
            std::iter::once((SATURATED_S, moment.saturated_s)).chain(battery.into_iter().flatten())
        {
            self.further.entry(name).or_default().push(on_grid(value));
        }
    }

    pub(super) fn finish(self, warnings: Vec<String>) -> Flight {
        let extra = self.further.into_iter().map(|(name, column)| (name.to_owned(), column));
        Flight { warnings, extra: extra.collect(), ..self.flight }
    }
}

fn sample(moment: &Moment, setpoint: &Setpoint) -> FlightSample {
    let Attitude { yaw_rad, pitch_rad, roll_rad } = attitude(&moment.state);
    FlightSample {
        time_s: on_grid(moment.time_s),
        position_m: position(&moment.state).map(on_grid),
        attitude: Attitude {
            yaw_rad: on_grid(yaw_rad),
            pitch_rad: on_grid(pitch_rad),
            roll_rad: on_grid(roll_rad),
        },
        velocity_body_m_s: velocity(&moment.state).map(on_grid),
        rate_body_rad_s: rate(&moment.state).map(on_grid),
        estimate_m: position(&moment.estimate).map(on_grid),
        design_m: setpoint.design_m(moment.time_s).map(on_grid),
        motors: moment.motors.map(on_grid),
        letter: setpoint.letter,
    }
}
