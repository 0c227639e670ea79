//! What a flight is simulated with. The default is the preset `ae483-2022`: the figures of the
//! student team whose flight is the reference.

use serde::{Deserialize, Serialize};

pub use super::controller::options::{ControllerKind, ControllerOptions, MotorLag};
use super::estimator::ObserverOptions;
use super::sensors::SensorOptions;
pub(super) use super::vehicle::{AirOptions, BatteryOptions, VehicleOptions};
use crate::error::{Error, Result, within};

/// Vehicle, controller, observer and sensors of a simulated flight.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimOptions {
    /// The clocks.
    pub rates: RateOptions,
    /// The drone itself.
    pub vehicle: VehicleOptions,
    /// What drives its motors.
    pub battery: BatteryOptions,
    /// The air it flies in.
    pub air: AirOptions,
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
    /// Ticks per second of the main loop: sensors and observer run at every one. The firmware's
    /// runs at 1000.
    pub control_hz: u32,
    /// Motor commands per second: regulators, and the attitude and rate loops of the cascade. It
    /// divides `control_hz`; more than that is as much. Motors hold their command in between.
    pub attitude_hz: u32,
    /// Runs per second of the cascade's position and velocity loops. It divides `attitude_hz`; more
    /// than that is as much.
    pub position_hz: u32,
    /// Samples per second of the flight that comes out; divides `control_hz`.
    pub log_hz: u32,
    /// Runge–Kutta steps per control tick. 1 (2 ms) is off by less than a micrometre.
    pub steps_per_tick: u32,
}

impl Default for RateOptions {
    /// The firmware's 500 Hz for the attitude and 100 Hz for the position (`stabilizer_types.h`,
    /// `ATTITUDE_RATE`, `POSITION_RATE`), the whole loop at 500 Hz as the team's observer ran, and
    /// a log at half of it.
    fn default() -> Self {
        Self { control_hz: 500, attitude_hz: 500, position_hz: 100, log_hz: 250, steps_per_tick: 1 }
    }
}

impl RateOptions {
    /// Motor commands per second: `attitude_hz`, and no more than one a tick.
    #[must_use]
    pub fn attitude_hz(&self) -> u32 {
        self.attitude_hz.min(self.control_hz)
    }

    /// Runs per second of the position loop: `position_hz`, and no more than motor commands.
    #[must_use]
    pub fn position_hz(&self) -> u32 {
        self.position_hz.min(self.attitude_hz())
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
        self.battery.check()?;
        self.air.check()?;
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
        within("rates.attitude_hz", self.attitude_hz.into(), 50.0, 2000.0)?;
        within("rates.position_hz", self.position_hz.into(), 10.0, 2000.0)?;
        divides("attitude_hz", self.attitude_hz(), "control_hz", self.control_hz)?;
        divides("position_hz", self.position_hz(), "attitude_hz", self.attitude_hz())?;
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

/// Checks that a slower loop runs at whole ticks of a faster one.
fn divides(slow: &str, slow_hz: u32, fast: &str, fast_hz: u32) -> Result<()> {
    if fast_hz.is_multiple_of(slow_hz) {
        return Ok(());
    }
    let wanted = format!("a divisor of rates.{fast} = {fast_hz}");
    let hint = "the firmware runs its loops at 1000, 500 and 100 Hz";
    Err(Error::input(format!("rates.{slow}"), slow_hz, wanted, hint))
}

/// [`within`] for each of several values.
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
        assert!(refused(|o| o.rates.attitude_hz = 300).starts_with("rates.attitude_hz"));
        assert!(refused(|o| o.rates.position_hz = 99).starts_with("rates.position_hz"));
        assert!(refused(|o| o.controller.k_rate[2] = -1.0).starts_with("controller.k_rate[2]"));
        assert!(refused(|o| o.rates.log_hz = 0).starts_with("rates.log_hz"));
        assert!(refused(|o| o.vehicle.mass_kg = 0.06).contains("weighs 0.589 N"));
    }

    #[test]
    fn no_loop_runs_faster_than_the_one_that_calls_it() {
        let rates = RateOptions { control_hz: 250, ..Default::default() };
        assert_eq!((rates.attitude_hz(), rates.position_hz()), (250, 100));
        let slow = SimOptions { rates, ..Default::default() };
        assert!(slow.check().unwrap_err().to_string().starts_with("rates.position_hz"));
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
