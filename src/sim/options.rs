//! What a flight is simulated with. The default is the preset `ae483-2022`: the figures of the
//! student team whose flight is the reference.

use serde::{Deserialize, Serialize};

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

impl ControllerOptions {
    fn check(&self) -> Result<()> {
        within_all("controller.q", &self.q, 0.0, 1e12)?;
        within_all("controller.r", &self.r, 1e-6, 1e12)
    }
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
