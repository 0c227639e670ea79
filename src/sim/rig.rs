//! The rig: one drone with its sensors, observer and controller, from tick to tick.

use std::f64::consts::FRAC_PI_2;

use super::controller::{Command, Controller, Reference, controller};
use super::estimator::{Estimator, estimator};
use super::options::SimOptions;
use super::recorder::Moment;
use super::sensors::Sensors;
use super::vehicle::{self, Plant, State};
use crate::error::{Error, Result};
use crate::plan::Plan;

/// A setpoint counts as sent when it is due within this time: plans are written to the microsecond.
pub(super) const TIME_TOLERANCE_S: f64 = 0.5e-6;
/// Size of any state (m, rad, m/s, rad/s) beyond which the drone is lost. A flight keeps to a few
/// metres and a few rad/s.
pub(super) const LOST: f64 = 1e4;

/// One drone in flight: all that changes from tick to tick, and what changes it.
#[derive(Debug)]
pub(super) struct Rig {
    plant: Plant,
    controller: Box<dyn Controller>,
    estimator: Box<dyn Estimator>,
    sensors: Sensors,
    tick_s: f64,
    steps_per_tick: u32,
    state: State,
    estimate: State,
    /// Held between two runs of the controller.
    command: Command,
    ticks: u32,
    ticks_per_command: u32,
    setpoint: usize,
    saturated_ticks: u32,
}

impl Rig {
    pub(super) fn new(plan: &Plan, options: &SimOptions, seed: u64) -> Result<Self> {
        let rate_hz = options.rates.control_hz;
        let sensors = Sensors::new(&options.sensors, rate_hz, seed, 0);
        let mut start_m = plan.setpoints[0].position_m;
        start_m.z = start_m.z.max(0.0);
        let dt_s = 1.0 / f64::from(rate_hz * options.rates.steps_per_tick);
        let plant = Plant::new(options, dt_s, seed, 0, start_m);
        Ok(Self {
            controller: controller(options)?,
            estimator: estimator(options, sensors.settled_m(start_m))?,
            sensors,
            tick_s: 1.0 / f64::from(rate_hz),
            steps_per_tick: options.rates.steps_per_tick,
            state: plant.state(),
            plant,
            estimate: State::zeros(),
            command: Command::default(),
            ticks: 0,
            ticks_per_command: rate_hz / options.rates.attitude_hz(),
            setpoint: 0,
            saturated_ticks: 0,
        })
    }

    /// Measures, estimates and commands the motors.
    pub(super) fn decide(&mut self, plan: &Plan, time_s: f64) {
        let due = |next: usize| {
            plan.setpoints.get(next).is_some_and(|s| s.time_s <= time_s + TIME_TOLERANCE_S)
        };
        while due(self.setpoint + 1) {
            self.setpoint += 1;
        }
        let setpoint = &plan.setpoints[self.setpoint];

        let readings = self.sensors.read(&self.state, self.plant.specific_force_m_s2());
        self.estimator.update(&readings, self.tick_s);
        self.estimate = self.estimator.state();

        if setpoint.position_m.z <= 0.0 {
            self.controller.rest(&self.estimate);
            self.command = Command::default();
        } else if self.ticks.is_multiple_of(self.ticks_per_command) {
            let reference = Reference::at(setpoint, time_s);
            self.command = self.controller.command(&self.estimate, &reference);
        }
        self.ticks += 1;
        self.saturated_ticks += u32::from(self.command.saturated && setpoint.letter.is_some());
    }

    /// Moves the drone to the next tick.
    pub(super) fn advance(&mut self) {
        for _ in 0..self.steps_per_tick {
            self.plant.advance(&self.command.motors.into());
        }
        self.state = self.plant.state();
    }

    pub(super) fn moment(&self, time_s: f64) -> Moment<'_> {
        Moment {
            time_s,
            state: &self.state,
            estimate: &self.estimate,
            motors: self.command.motors.into(),
            setpoint: self.setpoint,
        }
    }

    /// Stops a flight that the controller has lost.
    pub(super) fn check(&self, time_s: f64) -> Result<()> {
        let attitude = vehicle::attitude(&self.state);
        let tilt_rad = attitude.pitch_rad.abs().max(attitude.roll_rad.abs());
        let found = if !self.state.iter().chain(&self.estimate).all(|x| x.abs() < LOST) {
            "flies away"
        } else if tilt_rad >= FRAC_PI_2 {
            "turns over"
        } else {
            return Ok(());
        };
        Err(Error::Infeasible {
            what: format!("the drone {found} after {time_s:.3} s"),
            hint: "check the weights controller.q and .r and observer.q and .r against the \
                   vehicle, and that the plan makes no large jump"
                .into(),
        })
    }

    pub(super) fn warnings(&self) -> Vec<String> {
        let saturated_s = f64::from(self.saturated_ticks) * self.tick_s;
        let text = format!("a motor was at its limit for {saturated_s:.2} s while writing");
        let saturated = (self.saturated_ticks > 0).then_some(text);
        let others = self.plant.warnings().into_iter().chain(self.sensors.warnings());
        saturated.into_iter().chain(others).collect()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::plan::Setpoint;

    #[test]
    fn a_lost_drone_and_a_lost_observer_are_both_found() {
        let hover = Setpoint {
            time_s: 0.0,
            position_m: Vector3::z(),
            velocity_m_s: Vector3::zeros(),
            acceleration_m_s2: Vector3::zeros(),
            letter: None,
        };
        let plan = Plan { setpoints: vec![hover], ..Default::default() };
        let rig = || Rig::new(&plan, &SimOptions::default(), 0).unwrap();
        assert!(rig().check(0.0).is_ok(), "at the start");
        let lost = |change: fn(&mut Rig)| {
            let mut rig = rig();
            change(&mut rig);
            rig.check(1.5).unwrap_err().to_string()
        };
        assert_eq!(lost(|rig| rig.state[0] = f64::NAN), "the drone flies away after 1.500 s");
        assert_eq!(lost(|rig| rig.estimate[6] = -1e5), "the drone flies away after 1.500 s");
        assert_eq!(lost(|rig| rig.state[5] = -2.0), "the drone turns over after 1.500 s");
    }
}
