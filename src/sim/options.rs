//! What a flight is simulated with. The default is the preset `ae483-2022`: the figures of the
//! student team whose flight is the reference.

use serde::{Deserialize, Serialize};

use super::estimator::ObserverOptions;
use super::sensors::SensorOptions;
use super::vehicle::GRAVITY_M_S2;
use crate::error::{Error, Result, within};

/// Vehicle, controller, observer and sensors of a simulated flight.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimOptions {
    /// The clocks.
    pub rates: RateOptions,
    /// The drone itself.
    pub vehicle: VehicleOptions,
    /// What steers it.
    pub controller: ControllerOptions,
    /// What tells the controller where the drone is.
    pub observer: ObserverOptions,
    /// What tells the observer.
    pub sensors: SensorOptions,
}

/// Clocks of a simulation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RateOptions {
    /// Ticks per second: observer, controller and motor commands all run at this rate.
    pub control_hz: u32,
    /// Samples per second of the flight that comes out; divides `control_hz`.
    pub log_hz: u32,
    /// Runge–Kutta steps per control tick. 1 (2 ms) is off by less than a micrometre.
    pub steps_per_tick: u32,
}

impl Default for RateOptions {
    /// The firmware's 500 Hz, and a log at half of it.
    fn default() -> Self {
        Self { control_hz: 500, log_hz: 250, steps_per_tick: 1 }
    }
}

/// A quadrotor with its four motors at the corners of a square.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VehicleOptions {
    /// Mass with battery and decks.
    pub mass_kg: f64,
    /// Principal moments of inertia about body x, y, z.
    pub inertia_kg_m2: [f64; 3],
    /// Thrust of one motor per unit of its command.
    pub k_f_n: f64,
    /// Reaction torque of one motor about body z per unit of its command.
    pub k_m_n_m: f64,
    /// Half the side of the square of motors: lever of the thrust about body x and y.
    pub arm_m: f64,
    /// Largest motor command; the smallest is 0.
    pub motor_max: f64,
    /// Centre of mass in body x and y, from the middle of the motors. The thrust turns the drone
    /// about it, and a controller without integral action pays with a constant position error.
    pub center_of_mass_m: [f64; 2],
}

impl Default for VehicleOptions {
    /// The team's pendulum tests and fits; the centre of mass explains the mean motor commands and
    /// the standing position error of their flight (at hover (−1.3e-4, −3.3e-4, 0) N m).
    fn default() -> Self {
        Self {
            mass_kg: 0.0351,
            inertia_kg_m2: [1.24e-5, 1.27e-5, 3.32e-5],
            k_f_n: 1.95e-6,
            k_m_n_m: 7.47e-9,
            arm_m: 0.035,
            motor_max: 65_535.0,
            center_of_mass_m: [-0.958e-3, 0.378e-3],
        }
    }
}

/// Linear-quadratic regulator: cost `∫ sᵀQs + iᵀRi dt` about the setpoint, Q and R diagonal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ControllerOptions {
    /// Weights of position x y z (1/m²), yaw pitch roll (1/rad²), body velocity x y z (s²/m²) and
    /// body rate x y z (s²/rad²). More holds tighter and moves the motors more.
    pub q: [f64; 12],
    /// Weights of torque x y z (1/(N m)²) and thrust (1/N²). More spares the motors.
    pub r: [f64; 4],
}

impl Default for ControllerOptions {
    /// The team's choice, from Bryson's rule and then by hand.
    fn default() -> Self {
        Self {
            q: [120.0, 80.0, 75.0, 40.0, 0.01, 0.01, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
            r: [5_045_605.0, 5_045_605.0, 38_586_096.0, 566.0],
        }
    }
}

impl SimOptions {
    /// Checks every setting by itself, that the log rate divides the control rate, and that the
    /// motors can lift the drone.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key as its place, [`Error::Infeasible`] for a drone too heavy for
    /// its motors.
    pub fn check(&self) -> Result<()> {
        self.vehicle.check()?;
        self.controller.check()?;
        self.sensors.check()?;
        self.observer.check(&self.sensors)?;
        self.rates.check()
    }
}

impl RateOptions {
    fn check(&self) -> Result<()> {
        within("rates.control_hz", self.control_hz.into(), 50.0, 2000.0)?;
        within("rates.steps_per_tick", self.steps_per_tick.into(), 1.0, 100.0)?;
        within("rates.log_hz", self.log_hz.into(), 1.0, self.control_hz.into())?;
        if self.control_hz.is_multiple_of(self.log_hz) {
            return Ok(());
        }
        Err(Error::input(
            "rates.log_hz",
            self.log_hz,
            format!("a divisor of rates.control_hz = {}", self.control_hz),
            "50, 100, 250 and 500 divide the default of 500",
        ))
    }
}

impl VehicleOptions {
    fn check(&self) -> Result<()> {
        within("vehicle.mass_kg", self.mass_kg, 1e-3, 100.0)?;
        within_all("vehicle.inertia_kg_m2", &self.inertia_kg_m2, 1e-8, 100.0)?;
        within("vehicle.k_f_n", self.k_f_n, 1e-9, 1.0)?;
        within("vehicle.k_m_n_m", self.k_m_n_m, 1e-12, 1.0)?;
        within("vehicle.arm_m", self.arm_m, 1e-3, 2.0)?;
        within("vehicle.motor_max", self.motor_max, 1.0, 65_535.0)?;
        within_all("vehicle.center_of_mass_m", &self.center_of_mass_m, -1.0, 1.0)?;
        let (lift_n, weight_n) = (4.0 * self.k_f_n * self.motor_max, self.mass_kg * GRAVITY_M_S2);
        if lift_n > weight_n {
            return Ok(());
        }
        Err(Error::Infeasible {
            what: format!("the motors lift {lift_n:.3} N, the drone weighs {weight_n:.3} N"),
            hint: "lower vehicle.mass_kg, or raise vehicle.k_f_n or vehicle.motor_max".into(),
        })
    }
}

impl ControllerOptions {
    fn check(&self) -> Result<()> {
        within_all("controller.q", &self.q, 0.0, 1e12)?;
        within_all("controller.r", &self.r, 1e-6, 1e12)
    }
}

pub(super) fn within_all(key: &str, values: &[f64], min: f64, max: f64) -> Result<()> {
    values.iter().enumerate().try_for_each(|(i, &v)| within(&format!("{key}[{i}]"), v, min, max))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_preset_passes_its_own_check() {
        SimOptions::default().check().unwrap();
    }

    #[test]
    fn a_refused_setting_is_named() {
        let refused = |change: fn(&mut SimOptions)| {
            let mut options = SimOptions::default();
            change(&mut options);
            options.check().unwrap_err().to_string()
        };
        assert!(refused(|o| o.vehicle.mass_kg = f64::NAN).starts_with("vehicle.mass_kg"));
        assert!(refused(|o| o.controller.q[3] = -1.0).starts_with("controller.q[3]"));
        assert!(refused(|o| o.observer.r[7] = 0.0).starts_with("observer.r[7]"));
        assert!(refused(|o| o.rates.log_hz = 300).starts_with("rates.log_hz"));
        assert!(refused(|o| o.rates.log_hz = 0).starts_with("rates.log_hz"));
        assert!(refused(|o| o.vehicle.mass_kg = 0.06).contains("weighs 0.589 N"));
    }

    #[test]
    fn options_survive_a_file_and_refuse_unknown_keys() {
        let rates = RateOptions { log_hz: 100, ..RateOptions::default() };
        let options = SimOptions { rates, ..Default::default() };
        let text = serde_json::to_string(&options).unwrap();
        assert_eq!(serde_json::from_str::<SimOptions>(&text).unwrap(), options);
        assert_eq!(serde_json::from_str::<SimOptions>("{}").unwrap(), SimOptions::default());
        assert!(serde_json::from_str::<SimOptions>(r#"{"vehicle": {"mass": 1}}"#).is_err());
    }
}
