//! What estimates, and how much it trusts whom: the section `observer` of a scene.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, within};
use crate::sim::options::within_all;
use crate::sim::sensors::SensorOptions;

/// What estimates the drone's motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EstimatorKind {
    /// The reference flight's Luenberger observer, on positions.
    #[default]
    Luenberger,
    /// Extended Kalman filter, on anything that is measured.
    Ekf,
    /// The true state.
    Truth,
}

/// Estimator: which, the gain of the Luenberger observer by the dual regulator, and what the Kalman
/// filter believes about its sensors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObserverOptions {
    /// Which estimator.
    pub kind: EstimatorKind,
    /// Luenberger: trust in the measured position x y z: 1/σ² (1/m²). More follows the measurement
    /// faster and lets more of its noise through.
    pub q: [f64; 3],
    /// Luenberger: trust in the model of position x y z, pitch, roll and body velocity x y z: 1/σ²
    /// of each derivative. More follows the gyroscope and the accelerometer.
    pub r: [f64; 8],
    /// Kalman: noise density of the acceleration that the accelerometer gives, (m/s²)/√Hz. More
    /// follows the positioning faster.
    pub ekf_acceleration_noise_m_s2_sqrt_hz: f64,
    /// Kalman: noise density of the turning that the gyroscope gives, (rad/s)/√Hz.
    pub ekf_rate_noise_rad_s_sqrt_hz: f64,
    /// Kalman: σ of a sweep angle.
    pub ekf_sweep_sigma_rad: f64,
    /// Kalman: σ of a measured position per axis.
    pub ekf_position_sigma_m: f64,
    /// Kalman: σ of an ultra-wideband range.
    pub ekf_range_sigma_m: f64,
    /// Kalman: σ of a barometric height. The ranger's follows its distance, as in the firmware.
    pub ekf_barometer_sigma_m: f64,
    /// Kalman: a measurement further off than so many standard deviations of its innovation is
    /// thrown away (χ² with one degree of freedom). Too low, and where two stations disagree, as
    /// real ones do by several times the σ above, one of them is no longer listened to.
    pub ekf_gate_sigmas: f64,
}

impl Default for ObserverOptions {
    /// Luenberger: 1/σ² of the spread the team found in their flight logs. Kalman: the firmware
    /// (`kalman_core_params_defaults.h`, `lighthouse_position_est.c`, `tdoaEngine.h`): 0.5 m/s² and
    /// 0.1 rad/s a tick of 1 ms, which are densities of 0.022 and 0.0045; sweeps 1 mrad, positions
    /// 1 cm, ranges 15 cm, air pressure 2 m. The gate is ours: at 5 the error in flight is a fifth
    /// larger.
    fn default() -> Self {
        Self {
            kind: EstimatorKind::Luenberger,
            q: [111_111.0, 62_500.0, 250_000.0],
            r: [1479.3, 1479.3, 918.3, 94.3, 24.3, 45.0, 75.6, 28.6],
            ekf_acceleration_noise_m_s2_sqrt_hz: 0.022,
            ekf_rate_noise_rad_s_sqrt_hz: 0.0045,
            ekf_sweep_sigma_rad: 0.001,
            ekf_position_sigma_m: 0.01,
            ekf_range_sigma_m: 0.15,
            ekf_barometer_sigma_m: 2.0,
            ekf_gate_sigmas: 10.0,
        }
    }
}

impl ObserverOptions {
    /// Checks every range, and that the estimator can use what the sensors give.
    pub(in crate::sim) fn check(&self, sensors: &SensorOptions) -> Result<()> {
        within_all("observer.q", &self.q, 1e-6, 1e12)?;
        within_all("observer.r", &self.r, 1e-6, 1e12)?;
        for (key, value, min, max) in [
            (
                "acceleration_noise_m_s2_sqrt_hz",
                self.ekf_acceleration_noise_m_s2_sqrt_hz,
                1e-6,
                100.0,
            ),
            ("rate_noise_rad_s_sqrt_hz", self.ekf_rate_noise_rad_s_sqrt_hz, 1e-7, 10.0),
            ("sweep_sigma_rad", self.ekf_sweep_sigma_rad, 1e-6, 1.0),
            ("position_sigma_m", self.ekf_position_sigma_m, 1e-5, 100.0),
            ("range_sigma_m", self.ekf_range_sigma_m, 1e-4, 100.0),
            ("barometer_sigma_m", self.ekf_barometer_sigma_m, 1e-3, 100.0),
            ("gate_sigmas", self.ekf_gate_sigmas, 1.0, 1e6),
        ] {
            within(&format!("observer.ekf_{key}"), value, min, max)?;
        }
        if self.kind != EstimatorKind::Luenberger || sensors.positioning.gives_positions() {
            return Ok(());
        }
        Err(Error::input(
            "observer.kind",
            "luenberger, which takes in positions, on a positioning that gives none",
            "ekf",
            "set observer.kind = \"ekf\", or sensors.positioning to position, crossing-beams or gnss",
        ))
    }
}
