//! Flight with a controller outside the program.

use super::avionics::Avionics;
use super::controller::Reference;
use super::fly::{Rig, rigs};
use super::options::Drone;
use noctograph_core::error::Result;
use noctograph_core::flight::Flight;
use noctograph_core::plan::Plan;

/// Flight of one drone, which waits for motor commands `rates.attitude_hz` times per second while
/// its setpoint is above the floor. The functions of a session have the errors and panics of
/// [`fly`](crate::fly()).
#[derive(Debug)]
pub struct Session {
    plan: Plan,
    rig: Rig,
    tick: u32,
    has_landed: bool,
}

impl Session {
    /// Creates a drone that waits for its first command, after `set_up` has changed its avionics.
    /// Returns the errors of [`fly`](crate::fly()).
    pub fn new(plan: Plan, drone: &Drone<'_>, set_up: impl FnOnce(&mut Avionics)) -> Result<Self> {
        let mut rig = rigs(&[(&plan, *drone)])?.remove(0);
        set_up(&mut rig.avionics);
        let mut session = Self { plan, rig, tick: 0, has_landed: false };
        session.run()?;
        Ok(session)
    }

    /// Flies to the end of the plan with the drone's controller. Returns an error if the drone is
    /// lost.
    pub fn fly_by_itself(&mut self) -> Result<()> {
        while !self.has_landed {
            self.control()?;
        }
        Ok(())
    }

    /// Commands the motors with the drone's controller, and flies to the next command or landing.
    pub fn control(&mut self) -> Result<()> {
        if self.has_landed {
            return Ok(());
        }
        let time_s = self.time_s();
        self.rig.avionics.control(&self.plan, time_s);
        self.conclude()?;
        self.run()
    }

    /// Returns the inputs of the next command, which are the estimated state and the reference.
    /// Returns `None` after landing.
    ///
    /// The state consists of position (m, world frame), yaw, pitch and roll (rad), and velocity
    /// (m/s) and angular velocity (rad/s) in the body frame. The reference consists of position
    /// (m), velocity (m/s) and acceleration (m/s²) in the world frame.
    pub fn command_inputs(&self) -> Option<([f64; 12], [f64; 9])> {
        (!self.has_landed).then(|| {
            let Reference { position_m, velocity_m_s, acceleration_m_s2, .. } =
                self.rig.avionics.design(&self.plan, self.time_s());
            let vectors = [position_m, velocity_m_s, acceleration_m_s2];
            let reference = std::array::from_fn(|i| vectors[i / 3][i % 3]);
            ((*self.rig.avionics.estimate()).into(), reference)
        })
    }

    /// Returns the time since the first setpoint in s.
    pub fn time_s(&self) -> f64 {
        f64::from(self.tick) * self.rig.tick_s
    }

    /// Returns the drone's true position in m in the world frame.
    pub fn position_m(&self) -> [f64; 3] {
        self.rig.plant.body().position_m.into()
    }

    /// Returns the position in m that the plan has at this time, in the world frame.
    pub fn reference_m(&self) -> [f64; 3] {
        self.rig.avionics.design(&self.plan, self.time_s()).position_m.into()
    }

    /// Commands the motors m1…m4 (0 to `vehicle.motor_max`), and flies until the next command is
    /// due or the drone has landed. After the landing, nothing happens.
    pub fn command(&mut self, motors: [f64; 4]) -> Result<()> {
        if self.has_landed {
            return Ok(());
        }
        self.rig.avionics.command(motors);
        self.conclude().and_then(|()| self.run()).map_err(|error| match error.code() {
            "infeasible" => error.with_hint("check your controller's signs, units and gains"),
            _ => error,
        })
    }

    /// Returns the flight so far.
    pub fn finish(self) -> Flight {
        self.rig.finish()
    }

    /// Flies until a command is due, or to the last setpoint, after which the drone counts as
    /// landed.
    fn run(&mut self) -> Result<()> {
        while self.tick <= self.rig.n_ticks {
            let time_s = self.time_s();
            let Self { plan, rig, .. } = self;
            if rig.avionics.sense(plan, time_s, &rig.plant, &[]) {
                return Ok(());
            }
            self.conclude()?;
        }
        self.has_landed = true;
        Ok(())
    }

    /// Ends the present tick by moving the drone, and counts it. Returns an error if the drone is
    /// lost.
    fn conclude(&mut self) -> Result<()> {
        let time_s = self.time_s();
        let concluded = self.rig.conclude(&self.plan, self.tick, time_s, &mut |_, _, _| {});
        self.tick += 1;
        concluded
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SimOptions;
    use crate::fly::tests::flown;
    use crate::tests::hover;

    const PLACE_M: [f64; 3] = [0.1, 0.0, 0.5];

    #[test]
    fn the_commands_of_a_flight_lead_to_the_same_flight() {
        let mut options = SimOptions::default();
        options.rates.log_hz = options.rates.control_hz;
        let (plan, drone) = (hover(PLACE_M, 2.0), Drone::new(&options, 1));
        let flight = flown(&plan, &options, 1).unwrap();
        let mut session = Session::new(plan, &drone, |_| {}).unwrap();
        for sample in &flight.samples {
            let (state, design) = session.command_inputs().unwrap();
            assert_eq!(design, [0.1, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
            assert!((state[2] - sample.estimate_m.z).abs() < 1e-6);
            session.command(sample.motors).unwrap();
        }
        assert_eq!(session.command_inputs(), None, "landed");
        let again = session.finish();
        let pairs = flight.samples.iter().zip(&again.samples);
        let apart_m = pairs.map(|(a, b)| (a.position_m - b.position_m).norm()).fold(0.0, f64::max);
        assert!(apart_m < 1e-5, "{apart_m} m, of commands rounded to 1e-6");
        assert_eq!(again.samples.len(), flight.samples.len());
    }

    #[test]
    fn commands_are_held_within_the_range_of_the_motors() {
        let options = SimOptions::default();
        let mut session =
            Session::new(hover(PLACE_M, 0.1), &Drone::new(&options, 1), |_| {}).unwrap();
        session.command([f64::NAN, 1e9, -1.0, 5.0]).unwrap();
        let mut n = 1;
        while session.command_inputs().is_some() {
            session.command([4e4; 4]).unwrap();
            n += 1;
        }
        assert_eq!(n, 51, "500 a second, both ends");
        assert_eq!(session.finish().samples[0].motors, [0.0, 65_535.0, 0.0, 5.0]);
    }

    #[test]
    fn a_lost_drone_ends_with_advice_for_its_controller() {
        let options = SimOptions::default();
        let mut session =
            Session::new(hover(PLACE_M, 9.0), &Drone::new(&options, 1), |_| {}).unwrap();
        let lost = (0..4500).find_map(|_| session.command([6e4, 0.0, 0.0, 6e4]).err()).unwrap();
        assert!(lost.to_string().contains("turns over") && lost.hint().contains("signs"), "{lost}");
    }

    #[test]
    fn a_filters_covariance_is_logged_and_changes_nothing() {
        let mut options = SimOptions::default();
        options.observer.kind = crate::EstimatorKind::Ekf;
        let (plan, drone) = (hover(PLACE_M, 3.0), Drone::new(&options, 1));
        let plain = flown(&plan, &options, 1).unwrap();
        let mut session = Session::new(plan, &drone, Avionics::log_covariance).unwrap();
        session.fly_by_itself().unwrap();
        let mut logged = session.finish().into_data();
        let sigma_m = logged.extra.remove("estimate_sigma_m").unwrap();
        let nees = logged.extra.remove("estimate_nees").unwrap();
        assert_eq!(logged, *plain, "the same flight");
        assert_eq!((sigma_m.len(), nees.len()), (plain.samples.len(), plain.samples.len()));
        for (row, sample) in plain.samples.iter().enumerate().skip(plain.samples.len() / 2) {
            let error_m = (sample.estimate_m - sample.position_m).norm();
            assert!((1e-4..0.5).contains(&sigma_m[row]), "{}", sigma_m[row]);
            // The bound holds because a covariance's largest eigenvalue is at most its trace.
            assert!(3.0 * nees[row] >= 0.99 * (error_m / sigma_m[row]).powi(2) - 1e-4);
        }
    }
}
