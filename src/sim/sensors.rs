//! What the drone measures: its position (Lighthouse), its turning and its specific force (IMU).

use nalgebra::Vector3;

use super::noise::{Field, Noise};
use super::options::SensorOptions;
use super::vehicle::{State, position, rate};

/// Fixes per second of a Lighthouse: one turn of a second-generation rotor (50.05 Hz, firmware
/// `pulse_processor_v2.c`). Only the distortion keeps to it; it hardly changes in between.
const FIX_RATE_HZ: u32 = 50;

/// One tick's measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reading {
    pub(super) position_m: Vector3<f64>,
    pub(super) rate_rad_s: Vector3<f64>,
    pub(super) specific_force_z_m_s2: f64,
}

/// Sensors of one drone, each with its own stream of noise.
#[derive(Debug)]
pub(super) struct Sensors {
    jitter_m: f64,
    rate_sigma_rad_s: f64,
    force_sigma_m_s2: f64,
    lighthouse: Noise,
    gyro: Noise,
    accelerometer: Noise,
    distortion: Field,
    distortion_m: Vector3<f64>,
    ticks_per_fix: u32,
    ticks: u32,
}

impl Sensors {
    /// Sensors of the drone with index `drone`, read `rate_hz` times a second.
    pub(super) fn new(options: &SensorOptions, rate_hz: u32, seed: u64, drone: u64) -> Self {
        // White noise of density n, sampled at rate f, has σ = n √(f/2).
        let sampled = (0.5 * f64::from(rate_hz)).sqrt();
        let noise = |sensor| Noise::new(seed, drone, sensor);
        Self {
            jitter_m: options.lighthouse_jitter_m,
            rate_sigma_rad_s: options.gyro_noise_rad_s_sqrt_hz * sampled,
            force_sigma_m_s2: options.accelerometer_noise_m_s2_sqrt_hz * sampled,
            lighthouse: noise("lighthouse jitter"),
            gyro: noise("gyro"),
            accelerometer: noise("accelerometer"),
            distortion: Field::new(
                &mut noise("lighthouse distortion"),
                options.lighthouse_distortion_m,
                options.lighthouse_distortion_length_m,
            ),
            distortion_m: Vector3::zeros(),
            ticks_per_fix: (rate_hz / FIX_RATE_HZ).max(1),
            ticks: 0,
        }
    }

    /// Position that a drone at rest is believed to be at, once the jitter has averaged out.
    pub(super) fn settled_m(&self, position_m: Vector3<f64>) -> Vector3<f64> {
        position_m + self.distortion.at(&position_m)
    }

    /// Reads every sensor once.
    pub(super) fn read(&mut self, state: &State, specific_force_z_m_s2: f64) -> Reading {
        let position_m = position(state);
        if self.ticks.is_multiple_of(self.ticks_per_fix) {
            self.distortion_m = self.distortion.at(&position_m);
        }
        self.ticks += 1;
        Reading {
            position_m: position_m + self.distortion_m + self.lighthouse.normals() * self.jitter_m,
            rate_rad_s: rate(state) + self.gyro.normals() * self.rate_sigma_rad_s,
            specific_force_z_m_s2: specific_force_z_m_s2
                + self.accelerometer.normal() * self.force_sigma_m_s2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::vehicle::at;

    fn readings(options: &SensorOptions, n: usize) -> Vec<Reading> {
        let state = at(Vector3::new(0.1, 0.2, 0.7), 0.0);
        let mut sensors = Sensors::new(options, 500, 1, 0);
        (0..n).map(|_| sensors.read(&state, 9.81)).collect()
    }

    #[test]
    fn ideal_sensors_tell_the_truth() {
        let truth = Reading {
            position_m: Vector3::new(0.1, 0.2, 0.7),
            rate_rad_s: Vector3::zeros(),
            specific_force_z_m_s2: 9.81,
        };
        assert!(readings(&SensorOptions::ideal(), 20).iter().all(|r| *r == truth));
    }

    #[test]
    fn silencing_one_sensor_leaves_the_others_alone() {
        let loud = readings(&SensorOptions::default(), 20);
        let options = SensorOptions { gyro_noise_rad_s_sqrt_hz: 0.0, ..Default::default() };
        for (quiet, loud) in readings(&options, 20).iter().zip(&loud) {
            assert_eq!(quiet.position_m, loud.position_m);
            assert_eq!(quiet.specific_force_z_m_s2, loud.specific_force_z_m_s2);
            assert_eq!(quiet.rate_rad_s, Vector3::zeros());
        }
    }

    #[test]
    fn no_two_sensors_share_their_noise() {
        let options = SensorOptions { lighthouse_distortion_m: 0.0, ..Default::default() };
        let reading = readings(&options, 1)[0];
        let sampled = f64::sqrt(250.0);
        let first = [
            (reading.position_m.x - 0.1) / options.lighthouse_jitter_m,
            reading.rate_rad_s.x / (options.gyro_noise_rad_s_sqrt_hz * sampled),
            (reading.specific_force_z_m_s2 - 9.81)
                / (options.accelerometer_noise_m_s2_sqrt_hz * sampled),
        ];
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            assert!((first[i] - first[j]).abs() > 1e-6, "{first:?}");
        }
    }

    #[test]
    fn gyro_noise_has_its_density() {
        let n = 20_000;
        let readings = readings(&SensorOptions::default(), n);
        let sum: f64 = readings.iter().map(|r| r.rate_rad_s.norm_squared()).sum();
        #[expect(clippy::cast_precision_loss, reason = "small")]
        let sigma = (sum / (3 * n) as f64).sqrt();
        assert!((sigma / (2.44e-4 * f64::sqrt(250.0)) - 1.0).abs() < 0.02, "σ {sigma}");
    }

    #[test]
    fn distortion_stands_still_where_the_drone_does() {
        let options = SensorOptions { lighthouse_jitter_m: 0.0, ..Default::default() };
        let readings = readings(&options, 50);
        assert!(readings.iter().all(|r| r.position_m == readings[0].position_m));
        assert!((readings[0].position_m - Vector3::new(0.1, 0.2, 0.7)).norm() > 1e-4, "is there");
    }
}
