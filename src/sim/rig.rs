//! The rig: one drone with its sensors, observer and controller, from tick to tick.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;

use super::controller::Controller;
use super::estimator::{Estimator, estimator};
use super::mixer::Mixer;
use super::options::SimOptions;
use super::recorder::Moment;
use super::sensors::Sensors;
use super::vehicle::{self, State, Vehicle, Wrench};
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
    vehicle: Vehicle,
    mixer: Mixer,
    controller: Controller,
    estimator: Box<dyn Estimator>,
    sensors: Sensors,
    tick_s: f64,
    steps_per_tick: u32,
    state: State,
    estimate: State,
    motors: [f64; 4],
    /// On the body, about the centre of mass.
    wrench: Wrench,
    setpoint: usize,
    saturated_ticks: u32,
}

impl Rig {
    pub(super) fn new(plan: &Plan, options: &SimOptions, seed: u64) -> Result<Self> {
        let rate_hz = options.rates.control_hz;
        let vehicle = Vehicle::new(&options.vehicle);
        let sensors = Sensors::new(&options.sensors, rate_hz, seed, 0);
        let mut start_m = plan.setpoints[0].position_m;
        start_m.z = start_m.z.max(0.0);
        // In the air the drone hovers before it starts; on the floor its motors are off.
        let wrench = if start_m.z > 0.0 { vehicle.hover() } else { Wrench::zeros() };
        Ok(Self {
            controller: Controller::new(&options.controller, &vehicle)?,
            estimator: estimator(options, sensors.settled_m(start_m))?,
            mixer: Mixer::new(&options.vehicle),
            vehicle,
            sensors,
            tick_s: 1.0 / f64::from(rate_hz),
            steps_per_tick: options.rates.steps_per_tick,
            state: vehicle::at(start_m, 0.0),
            estimate: State::zeros(),
            motors: [0.0; 4],
            wrench,
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

        let force = self.vehicle.specific_force_z_m_s2(&self.state, &self.wrench);
        let readings = self.sensors.read(&self.state, Vector3::z() * force);
        self.estimator.update(&readings, self.tick_s);
        self.estimate = self.estimator.state();

        let wanted = self.controller.wrench(&self.estimate, setpoint.position_m);
        let off = setpoint.position_m.z <= 0.0;
        let (motors, saturated) = if off { Default::default() } else { self.mixer.motors(&wanted) };
        self.saturated_ticks += u32::from(saturated && setpoint.letter.is_some());
        self.motors = motors.into();
        self.wrench = self.vehicle.about_center_of_mass(&self.mixer.wrench(&motors));
    }

    /// Moves the drone to the next tick.
    pub(super) fn advance(&mut self) {
        let dt_s = self.tick_s / f64::from(self.steps_per_tick);
        for _ in 0..self.steps_per_tick {
            self.state = self.vehicle.step(&self.state, &self.wrench, dt_s);
        }
    }

    pub(super) fn moment(&self, time_s: f64) -> Moment<'_> {
        Moment {
            time_s,
            state: &self.state,
            estimate: &self.estimate,
            motors: self.motors,
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
        saturated.into_iter().chain(self.sensors.warnings()).collect()
    }
}

#[cfg(test)]
mod tests {
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
