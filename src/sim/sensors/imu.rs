//! Gyroscope and accelerometer, with white noise and a constant gyroscope bias.

use nalgebra::Vector3;

use super::ImuOptions;
use super::streams::Streams;
use noctograph_core::random::Normals;

/// Both inertial sensors, read at every tick. The firmware's filters (80 Hz and 30 Hz) are not
/// modeled, so the noise is white up to half the sampling rate.
#[derive(Debug)]
pub(super) struct Imu {
    /// Standard deviations of one reading.
    gyro_sigma_rad_s: f64,
    accelerometer_sigma_m_s2: f64,
    gyro_bias_rad_s: Vector3<f64>,
    gyro: Normals,
    accelerometer_xy: Normals,
    accelerometer_z: Normals,
}

impl Imu {
    /// Creates the inertial sensors of a drone, which are read `rate_hz` times per second.
    pub(super) fn new(options: &ImuOptions, rate_hz: u32, streams: &Streams) -> Self {
        // White noise with the one-sided density n, sampled at rate f, has σ = n √(f/2).
        let sqrt_half_rate = (0.5 * f64::from(rate_hz)).sqrt();
        Self {
            gyro_sigma_rad_s: options.gyro_noise_rad_s_sqrt_hz * sqrt_half_rate,
            accelerometer_sigma_m_s2: options.accelerometer_noise_m_s2_sqrt_hz * sqrt_half_rate,
            gyro_bias_rad_s: options.gyro_bias_rad_s.into(),
            gyro: Normals::new(streams.drone_noise("gyro")),
            accelerometer_xy: Normals::new(streams.drone_noise("accelerometer xy")),
            accelerometer_z: Normals::new(streams.drone_noise("accelerometer")),
        }
    }

    /// Returns the body rate as the gyroscope measures it, in the body frame.
    pub(super) fn rate_rad_s(&mut self, rate_rad_s: Vector3<f64>) -> Vector3<f64> {
        rate_rad_s + self.gyro.next_three() * self.gyro_sigma_rad_s + self.gyro_bias_rad_s
    }

    /// Returns the specific force as the accelerometer measures it, in the body frame.
    pub(super) fn specific_force_m_s2(&mut self, force_m_s2: Vector3<f64>) -> Vector3<f64> {
        let (xy, z) = (&mut self.accelerometer_xy, &mut self.accelerometer_z);
        force_m_s2 + Vector3::new(xy.next(), xy.next(), z.next()) * self.accelerometer_sigma_m_s2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kalman::variance_rate;
    use crate::sensors::density::{gathered, white_density};

    const RATE_HZ: f64 = 500.0;

    fn series(options: &ImuOptions, n: usize) -> [Vec<f64>; 6] {
        let mut imu = Imu::new(options, 500, &Streams::alone(3));
        let mut series: [Vec<f64>; 6] = Default::default();
        for _ in 0..n {
            let rate = imu.rate_rad_s(Vector3::zeros());
            let force = imu.specific_force_m_s2(Vector3::zeros());
            for (series, value) in series.iter_mut().zip(rate.iter().chain(&force)) {
                series.push(*value);
            }
        }
        series
    }

    #[test]
    fn noise_has_its_density_at_every_frequency() {
        let want = [2.44e-4, 2.44e-4, 2.44e-4, 1.86e-3, 1.86e-3, 1.86e-3];
        let series = series(&ImuOptions::default(), 1 << 17);
        for (axis, (series, want)) in series.iter().zip(want).enumerate() {
            for (band, measured) in white_density(series, RATE_HZ).into_iter().enumerate() {
                // The slowest scale has 1024 blocks, for a standard deviation of 2.2 %.
                assert!(
                    (measured / want - 1.0).abs() < 0.08,
                    "axis {axis}, band {band}: {measured:e}"
                );
            }
        }
    }

    #[test]
    fn noise_gathers_the_variance_that_filters_assume() {
        let measured = series(&ImuOptions::default(), 1 << 17);
        for (series, density) in [(&measured[0], 2.44e-4), (&measured[5], 1.86e-3)] {
            let rate = gathered(series, RATE_HZ) / variance_rate(density);
            // There are 131,072 values, for a standard deviation of 0.4 %.
            assert!((rate - 1.0).abs() < 0.015, "{rate} of what a filter adds in a second");
        }
    }
}
