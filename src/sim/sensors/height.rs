//! Slow sensors: time of flight to the floor, air pressure, and satellites.

use nalgebra::Vector3;

use crate::sim::noise::Noise;
use crate::sim::options::{BarometerOptions, GnssOptions};

/// Readings per second: Crazyswarm's and the firmware's ranger (`zranger2.c`), the firmware's
/// barometer (`sensors_bmi088_bmp3xx.c`), and the lab's satellite receiver.
pub(in crate::sim) const TIME_OF_FLIGHT_HZ: f64 = 40.0;
pub(in crate::sim) const BAROMETER_HZ: f64 = 50.0;
const GNSS_HZ: f64 = 10.0;
/// Beyond this the ranger sees no floor (`zranger2.c`: readings above 5 m are thrown away).
const TIME_OF_FLIGHT_RANGE_M: f64 = 5.0;

/// Standard deviation of the ranger at a distance: 2.5 mm up to 2.5 m, rising to 0.2 m at 4 m:
/// `0.0025 (1 + exp(c (d − 2.5)))` with `c = ln(80)/1.5` (`zranger2.c`).
pub(in crate::sim) fn time_of_flight_sigma_m(distance_m: f64) -> f64 {
    0.0025 * (1.0 + libm::exp(2.921_351_089_782_587_4 * (distance_m - 2.5)))
}

/// When a sensor of a steady rate is due.
#[derive(Debug)]
struct Clock {
    rate_hz: f64,
    measured: u32,
}

impl Clock {
    fn new(rate_hz: f64) -> Self {
        Self { rate_hz, measured: 0 }
    }

    fn due(&mut self, time_s: f64) -> bool {
        let due = f64::from(self.measured) <= time_s * self.rate_hz;
        self.measured += u32::from(due);
        due
    }
}

/// Infrared ranger that looks down along the body's z axis onto a flat floor.
#[derive(Debug)]
pub(super) struct TimeOfFlight {
    clock: Clock,
    noise: Noise,
}

impl TimeOfFlight {
    pub(super) fn new(noise: impl Fn(&str) -> Noise) -> Self {
        Self { clock: Clock::new(TIME_OF_FLIGHT_HZ), noise: noise("time of flight") }
    }

    /// Distance to the floor, for a drone at a height with the cosine of its tilt; none where it is
    /// too far.
    pub(super) fn read(
        &mut self,
        height_m: f64,
        cos_tilt: impl Fn() -> f64,
        time_s: f64,
    ) -> Option<f64> {
        if !self.clock.due(time_s) {
            return None;
        }
        let (error, cos_tilt) = (self.noise.normal(), cos_tilt());
        let distance_m = height_m / cos_tilt;
        (cos_tilt > 0.0 && distance_m <= TIME_OF_FLIGHT_RANGE_M)
            .then(|| (distance_m + error * time_of_flight_sigma_m(distance_m)).max(0.0))
    }
}

/// Barometric height over the starting place: white noise and a slow random walk.
#[derive(Debug)]
pub(super) struct Barometer {
    clock: Clock,
    noise: Noise,
    noise_m: f64,
    walk: Noise,
    step_m: f64,
    drift_m: f64,
}

impl Barometer {
    pub(super) fn new(options: &BarometerOptions, noise: impl Fn(&str) -> Noise) -> Self {
        Self {
            clock: Clock::new(BAROMETER_HZ),
            noise: noise("barometer"),
            noise_m: options.noise_m,
            walk: noise("barometer drift"),
            step_m: options.drift_m_sqrt_s / BAROMETER_HZ.sqrt(),
            drift_m: 0.0,
        }
    }

    pub(super) fn read(&mut self, height_m: f64, time_s: f64) -> Option<f64> {
        self.clock.due(time_s).then(|| {
            self.drift_m += self.walk.normal() * self.step_m;
            height_m + self.drift_m + self.noise.normal() * self.noise_m
        })
    }
}

/// Satellite fixes with a base station: white noise on every axis.
#[derive(Debug)]
pub(super) struct Gnss {
    clock: Clock,
    noise: Noise,
    noise_m: f64,
}

impl Gnss {
    pub(super) fn new(options: &GnssOptions, noise: impl Fn(&str) -> Noise) -> Self {
        Self { clock: Clock::new(GNSS_HZ), noise: noise("gnss"), noise_m: options.noise_m }
    }

    pub(super) fn read(&mut self, position_m: Vector3<f64>, time_s: f64) -> Option<Vector3<f64>> {
        self.clock.due(time_s).then(|| position_m + self.noise.normals() * self.noise_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::sensors::density::{Series, random_walk_density, white_density};

    fn noise(sensor: &str) -> Noise {
        Noise::new(9, 0, sensor)
    }

    /// Readings of a sensor in `n` ticks of 500 Hz.
    fn series(rate_hz: f64, n: u32, mut read: impl FnMut(f64) -> Option<f64>) -> Series {
        let mut series = Series::new(rate_hz);
        for value in (0..n).filter_map(|tick| read(f64::from(tick) / 500.0)) {
            series.push(value);
        }
        series
    }

    #[test]
    fn ranger_spreads_as_the_firmware_says() {
        assert!((time_of_flight_sigma_m(4.0) / 0.2025 - 1.0).abs() < 1e-12, "0.2 m at 4 m");
        for distance_m in [0.5, 2.5, 3.5] {
            let mut ranger = TimeOfFlight::new(noise);
            let found = series(40.0, 1 << 18, |t| ranger.read(distance_m, || 1.0, t));
            let want = time_of_flight_sigma_m(distance_m) / f64::sqrt(20.0);
            for (band, density) in white_density(&found).into_iter().enumerate() {
                assert!((density / want - 1.0).abs() < 0.2, "{distance_m} m, band {band}");
            }
        }
        let mut ranger = TimeOfFlight::new(noise);
        assert_eq!(ranger.read(5.1, || 1.0, 0.0), None, "no floor");
        let tilted = ranger.read(1.0, || 0.9, 1.0).unwrap();
        assert!((tilted - 1.0 / 0.9).abs() < 0.02, "along the body: {tilted}");
    }

    #[test]
    fn barometer_is_white_and_drifts() {
        let options = BarometerOptions { drift_m_sqrt_s: 0.0, ..Default::default() };
        let mut barometer = Barometer::new(&options, noise);
        for density in white_density(&series(50.0, 1 << 19, |t| barometer.read(0.7, t))) {
            assert!((density / (0.09 / 5.0) - 1.0).abs() < 0.15, "σ 0.09 m at 50 Hz: {density}");
        }
        let options = BarometerOptions { noise_m: 0.0, ..Default::default() };
        let mut barometer = Barometer::new(&options, noise);
        for walk in random_walk_density(&series(50.0, 1 << 19, |t| barometer.read(0.7, t))) {
            assert!((walk / f64::sqrt(2.0) / 0.012 - 1.0).abs() < 0.15, "after a second: {walk}");
        }
    }

    #[test]
    fn satellites_are_white_ten_times_a_second() {
        let mut gnss = Gnss::new(&GnssOptions::default(), noise);
        let found = series(10.0, 1 << 20, |t| gnss.read(Vector3::zeros(), t).map(|fix| fix.y));
        for density in white_density(&found) {
            assert!((density / (0.05 / f64::sqrt(5.0)) - 1.0).abs() < 0.2, "{density}");
        }
    }
}
