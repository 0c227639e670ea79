//! Gyroscope and accelerometer: white noise, and a bias that walks.

use nalgebra::Vector3;

use super::ImuOptions;
use super::streams::Streams;
use noctograph_core::random::Normals;

/// Both inertial sensors, read at every tick. The firmware's filters (80 Hz and 30 Hz) are not
/// modeled: noise is white up to half the rate at which it is read.
#[derive(Debug)]
pub(super) struct Imu {
    gyro: Axes,
    accelerometer: Axes,
    accelerometer_xy: Normals,
}

/// One sensor of three axes.
#[derive(Debug)]
struct Axes {
    /// Standard deviation of one reading.
    sigma: f64,
    noise: Normals,
    /// Standard deviation of the bias's step from tick to tick.
    step: f64,
    steps: Normals,
    bias: Vector3<f64>,
}

impl Axes {
    /// White noise of density `n`, sampled at rate f, has σ = n √(f/2); a bias whose derivative has
    /// density `b` steps by b √(1/2f).
    fn new(density: f64, walk: f64, rate_hz: u32, streams: &Streams, name: &str) -> Self {
        let half_rate = (0.5 * f64::from(rate_hz)).sqrt();
        Self {
            sigma: density * half_rate,
            noise: Normals::new(streams.own(name)),
            step: walk * (0.5 / f64::from(rate_hz)).sqrt(),
            steps: Normals::new(streams.own(&format!("{name} bias"))),
            bias: Vector3::zeros(),
        }
    }

    fn bias(&mut self) -> Vector3<f64> {
        if self.step > 0.0 {
            self.bias += self.steps.next_three() * self.step;
        }
        self.bias
    }
}

impl Imu {
    pub(super) fn new(options: &ImuOptions, rate_hz: u32, streams: &Streams) -> Self {
        Self {
            gyro: Axes {
                bias: options.gyro_bias_rad_s.into(),
                ..Axes::new(
                    options.gyro_noise_rad_s_sqrt_hz,
                    options.gyro_bias_walk_rad_s2_sqrt_hz,
                    rate_hz,
                    streams,
                    "gyro",
                )
            },
            accelerometer: Axes::new(
                options.accelerometer_noise_m_s2_sqrt_hz,
                options.accelerometer_bias_walk_m_s3_sqrt_hz,
                rate_hz,
                streams,
                "accelerometer",
            ),
            accelerometer_xy: Normals::new(streams.own("accelerometer xy")),
        }
    }

    /// Turning as the gyroscope reads it, body frame.
    pub(super) fn rate_rad_s(&mut self, rate_rad_s: Vector3<f64>) -> Vector3<f64> {
        rate_rad_s + self.gyro.noise.next_three() * self.gyro.sigma + self.gyro.bias()
    }

    /// Specific force as the accelerometer reads it, body frame.
    pub(super) fn specific_force_m_s2(&mut self, force_m_s2: Vector3<f64>) -> Vector3<f64> {
        let sensor = &mut self.accelerometer;
        let z = sensor.noise.next();
        let xy = &mut self.accelerometer_xy;
        force_m_s2 + Vector3::new(xy.next(), xy.next(), z) * sensor.sigma + sensor.bias()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kalman::variance_rate;
    use crate::sensors::density::{gathered, random_walk_density, white_density};

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
                // 1024 blocks at the slowest: 2.2 % one sigma.
                assert!(
                    (measured / want - 1.0).abs() < 0.08,
                    "axis {axis}, band {band}: {measured:e}"
                );
            }
        }
    }

    #[test]
    fn noise_gathers_the_variance_that_filters_take_it_for() {
        let measured = series(&ImuOptions::default(), 1 << 17);
        for (series, density) in [(&measured[0], 2.44e-4), (&measured[5], 1.86e-3)] {
            let rate = gathered(series, RATE_HZ) / variance_rate(density);
            // 131,072 values: 0.4 % one sigma.
            assert!((rate - 1.0).abs() < 0.015, "{rate} of what a filter adds in a second");
        }
    }

    #[test]
    fn bias_walks_with_its_density() {
        let options = ImuOptions {
            gyro_bias_rad_s: [0.0; 3],
            gyro_bias_walk_rad_s2_sqrt_hz: 1e-4,
            accelerometer_bias_walk_m_s3_sqrt_hz: 2e-3,
            gyro_noise_rad_s_sqrt_hz: 0.0,
            accelerometer_noise_m_s2_sqrt_hz: 0.0,
        };
        let series = series(&options, 1 << 17);
        for (axis, (series, want)) in
            series.iter().zip([1e-4, 1e-4, 1e-4, 2e-3, 2e-3, 2e-3]).enumerate()
        {
            for (band, measured) in random_walk_density(series, RATE_HZ).into_iter().enumerate() {
                assert!(
                    (measured / want - 1.0).abs() < 0.08,
                    "axis {axis}, band {band}: {measured:e}"
                );
            }
        }
    }
}
