//! What a flight is simulated with. The default is the preset `ae483-2022`: the figures of the
//! student team whose flight is the reference.

use serde::{Deserialize, Serialize};

pub use super::controller::options::{ControllerKind, ControllerOptions};
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

/// Luenberger observer with the gain of the dual regulator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObserverOptions {
    /// Trust in the measured position x y z: 1/σ² (1/m²). More follows the measurement faster and
    /// lets more of its noise through.
    pub q: [f64; 3],
    /// Trust in the model of position x y z, pitch, roll and body velocity x y z: 1/σ² of each
    /// derivative. More follows the gyroscope and the accelerometer.
    pub r: [f64; 8],
}

impl Default for ObserverOptions {
    /// 1/σ² of the spread the team found in their flight logs.
    fn default() -> Self {
        Self {
            q: [111_111.0, 62_500.0, 250_000.0],
            r: [1479.3, 1479.3, 918.3, 94.3, 24.3, 45.0, 75.6, 28.6],
        }
    }
}

/// Noise of the positioning and of the inertial sensors; 0 switches a term off.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorOptions {
    /// White noise of the measured position per axis and tick, σ.
    pub lighthouse_jitter_m: f64,
    /// Smooth error of the measured position that depends on where the drone is, per axis, σ.
    pub lighthouse_distortion_m: f64,
    /// Distance over which that error changes: the correlation falls as `exp(−d²/2l²)`.
    pub lighthouse_distortion_length_m: f64,
    /// Noise density of the gyroscope per axis, (rad/s)/√Hz.
    pub gyro_noise_rad_s_sqrt_hz: f64,
    /// Noise density of the accelerometer along body z, (m/s²)/√Hz.
    pub accelerometer_noise_m_s2_sqrt_hz: f64,
}

impl Default for SensorOptions {
    /// Lighthouse: `positioning_dataset` of Bitcraze (Taffanel et al., arXiv 2104.11523): crossing
    /// beams at rest jitter by 0.3 mm at 50 fixes a second, which is 1 mm at 500; slow error in
    /// flight 13 mm rms over three axes, with a correlation of 0.6 to 3.4 s at 0.5 m/s.
    /// IMU: data sheet of the BMI088, 0.014 °/s/√Hz and 190 µg/√Hz along z.
    fn default() -> Self {
        Self {
            lighthouse_jitter_m: 0.001,
            lighthouse_distortion_m: 0.0075,
            lighthouse_distortion_length_m: 0.7,
            gyro_noise_rad_s_sqrt_hz: 2.44e-4,
            accelerometer_noise_m_s2_sqrt_hz: 1.86e-3,
        }
    }
}

impl SensorOptions {
    /// Sensors without any error.
    #[must_use]
    pub fn ideal() -> Self {
        Self {
            lighthouse_jitter_m: 0.0,
            lighthouse_distortion_m: 0.0,
            lighthouse_distortion_length_m: 1.0,
            gyro_noise_rad_s_sqrt_hz: 0.0,
            accelerometer_noise_m_s2_sqrt_hz: 0.0,
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
        self.battery.check()?;
        self.air.check()?;
        self.controller.check()?;
        within_all("observer.q", &self.observer.q, 1e-6, 1e12)?;
        within_all("observer.r", &self.observer.r, 1e-6, 1e12)?;
        self.sensors.check()?;
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

impl SensorOptions {
    fn check(&self) -> Result<()> {
        within("sensors.lighthouse_jitter_m", self.lighthouse_jitter_m, 0.0, 1.0)?;
        within("sensors.lighthouse_distortion_m", self.lighthouse_distortion_m, 0.0, 1.0)?;
        let length_m = self.lighthouse_distortion_length_m;
        within("sensors.lighthouse_distortion_length_m", length_m, 0.01, 1000.0)?;
        within("sensors.gyro_noise_rad_s_sqrt_hz", self.gyro_noise_rad_s_sqrt_hz, 0.0, 1.0)?;
        let density = self.accelerometer_noise_m_s2_sqrt_hz;
        within("sensors.accelerometer_noise_m_s2_sqrt_hz", density, 0.0, 10.0)
    }
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
