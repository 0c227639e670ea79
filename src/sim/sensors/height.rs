//! Slow sensors, which are the time-of-flight ranger, the barometer and satellite navigation.

use nalgebra::{Matrix3, Vector3};

use super::streams::{Clock, Streams};
use super::{BarometerOptions, GnssOptions, TimeOfFlightOptions};
use crate::vehicle::FloorOptions;
use noctograph_core::random::Noise;

/// Maximum distance in m that the ranger measures (`zranger2.c` discards readings above 5 m).
const TIME_OF_FLIGHT_RANGE_M: f64 = 5.0;

/// Distance in m at which the ranger's noise has increased by [`FAR_NOISE_M`].
const FAR_M: f64 = 2.5;
/// Increase in m of the ranger's noise at the distance [`FAR_M`].
const FAR_NOISE_M: f64 = 0.0025;

/// Returns the standard deviation in m of a ranger at a distance, `noise_m + 0.0025 exp(c (d −
/// 2.5))` with `c = ln(80)/1.5`. With a noise of 2.5 mm, the result equals the firmware's
/// (`zranger2.c`), 5 mm at 2.5 m and 0.2 m at 4 m.
pub(super) fn time_of_flight_sigma_m(noise_m: f64, distance_m: f64) -> f64 {
    const C_PER_M: f64 = 2.921_351_089_782_587_4;
    let growth = libm::exp(C_PER_M * (distance_m - FAR_M));
    FAR_NOISE_M * (noise_m / FAR_NOISE_M + growth)
}

/// Infrared ranger that looks down at the floor along the body's z axis.
#[derive(Debug)]
pub(super) struct TimeOfFlight {
    clock: Clock,
    noise: Noise,
    noise_m: f64,
    floor: FloorOptions,
}

impl TimeOfFlight {
    /// Creates the ranger before its first reading. Each drone has a separate stream of noise.
    pub(super) fn new(
        options: &TimeOfFlightOptions,
        floor: &FloorOptions,
        streams: &Streams,
    ) -> Self {
        Self {
            clock: Clock::new(options.rate_hz),
            noise: streams.drone_noise("time of flight"),
            noise_m: options.noise_m,
            floor: floor.clone(),
        }
    }

    /// Returns the distance to the floor in m, at least 0, or `None` if none is due or no floor is
    /// within range.
    pub(super) fn read(
        &mut self,
        position_m: &Vector3<f64>,
        world_from_body: impl Fn() -> Matrix3<f64>,
        time_s: f64,
    ) -> Option<f64> {
        self.clock.due(time_s)?;
        // The noise is drawn at every reading, even without a floor. A `noise_m` of 0 means exact
        // readings at any distance.
        let normal = self.noise.normal();
        let deviation_sigmas = if self.noise_m > 0.0 { normal } else { 0.0 };
        let down = -world_from_body().column(2);
        if down.z >= 0.0 {
            return None;
        }
        let distance_m = self.floor.distance_m(position_m, &down);
        (distance_m <= TIME_OF_FLIGHT_RANGE_M).then(|| {
            let sigma_m = time_of_flight_sigma_m(self.noise_m, distance_m);
            (distance_m + deviation_sigmas * sigma_m).max(0.0)
        })
    }
}

/// Barometric height above the start, with white noise, a slow random walk and a constant drift.
#[derive(Debug)]
pub(super) struct Barometer {
    clock: Clock,
    noise: Noise,
    walk: Noise,
    walked_m: f64,
    options: BarometerOptions,
}

impl Barometer {
    /// Creates the barometer before its first reading, with separate streams for white noise and
    /// drift.
    pub(super) fn new(options: &BarometerOptions, streams: &Streams) -> Self {
        Self {
            clock: Clock::new(options.rate_hz),
            noise: streams.drone_noise("barometer"),
            walk: streams.drone_noise("barometer drift"),
            walked_m: 0.0,
            options: options.clone(),
        }
    }

    /// Returns the error of the height in m without its white noise.
    pub(super) fn bias_m(&self, time_s: f64) -> f64 {
        self.walked_m + self.options.drift_m_s * time_s
    }

    /// Returns the height with noise, walk and drift in m, or `None` if no reading is due.
    pub(super) fn read(&mut self, height_m: f64, time_s: f64) -> Option<f64> {
        self.clock.due(time_s)?;
        let BarometerOptions { noise_m, drift_m_sqrt_s, rate_hz, .. } = self.options;
        self.walked_m += self.walk.normal() * (drift_m_sqrt_s / rate_hz.sqrt());
        Some(height_m + self.bias_m(time_s) + self.noise.normal() * noise_m)
    }
}

/// Satellite fixes with a base station, with white noise and periods without a fix.
#[derive(Debug)]
pub(super) struct Gnss {
    clock: Clock,
    noise: Noise,
    options: GnssOptions,
}

impl GnssOptions {
    /// True if there is no fix at a time.
    pub fn is_silent(&self, time_s: f64) -> bool {
        self.silent_s.iter().any(|[from_s, to_s]| (*from_s..*to_s).contains(&time_s))
    }
}

impl Gnss {
    /// Creates the receiver before its first fix.
    pub(super) fn new(options: &GnssOptions, streams: &Streams) -> Self {
        Self {
            clock: Clock::new(options.rate_hz),
            noise: streams.drone_noise("gnss"),
            options: options.clone(),
        }
    }

    /// Returns a fix with noise, or `None` if none is due or there is no fix at that time. The
    /// noise of a missing fix is drawn too, so that it does not shift the stream.
    pub(super) fn read(&mut self, position_m: Vector3<f64>, time_s: f64) -> Option<Vector3<f64>> {
        self.clock.due(time_s)?;
        let fix_m = position_m + self.noise.normals() * self.options.noise_m;
        (!self.options.is_silent(time_s)).then_some(fix_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::density::{random_walk_density, white_density};
    use noctograph_core::geometry::Attitude;

    const FLAT: FloorOptions = FloorOptions { steps: Vec::new() };

    const STREAMS: Streams = Streams { seed: 9, room_seed: 9, drone: 0 };

    /// Returns the readings of a sensor over `n` ticks at 500 Hz.
    fn series(n: u32, mut read: impl FnMut(f64) -> Option<f64>) -> Vec<f64> {
        (0..n).filter_map(|tick| read(f64::from(tick) / 500.0)).collect()
    }

    #[test]
    fn ranger_has_the_firmwares_noise() {
        assert!((time_of_flight_sigma_m(0.0025, 4.0) / 0.2025 - 1.0).abs() < 1e-12, "0.2 m at 4 m");
        let options = TimeOfFlightOptions::default();
        for distance_m in [0.5, 2.5, 3.5] {
            let mut ranger = TimeOfFlight::new(&options, &FLAT, &STREAMS);
            let above_m = Vector3::z() * distance_m;
            let readings = series(1 << 18, |t| ranger.read(&above_m, Matrix3::identity, t));
            let want = time_of_flight_sigma_m(0.0025, distance_m) / f64::sqrt(20.0);
            for (band, density) in white_density(&readings, 40.0).into_iter().enumerate() {
                assert!((density / want - 1.0).abs() < 0.2, "{distance_m} m, band {band}");
            }
        }
        let mut ranger = TimeOfFlight::new(&options, &FLAT, &STREAMS);
        let far_m = Vector3::z() * 5.1;
        assert_eq!(ranger.read(&far_m, Matrix3::identity, 0.0), None, "no floor");
        let tilt = Attitude { roll_rad: libm::acos(0.9), ..Attitude::default() };
        let tilted = ranger.read(&Vector3::z(), || tilt.world_from_body(), 1.0).unwrap();
        assert!((tilted - 1.0 / 0.9).abs() < 0.02, "along the body: {tilted}");
    }

    #[test]
    fn barometer_is_white_and_drifts() {
        let options = BarometerOptions { drift_m_sqrt_s: 0.0, ..Default::default() };
        let mut barometer = Barometer::new(&options, &STREAMS);
        for density in white_density(&series(1 << 19, |t| barometer.read(0.7, t)), 50.0) {
            assert!((density / (0.09 / 5.0) - 1.0).abs() < 0.15, "σ 0.09 m at 50 Hz: {density}");
        }
        let options = BarometerOptions { noise_m: 0.0, ..Default::default() };
        let mut barometer = Barometer::new(&options, &STREAMS);
        for walk in random_walk_density(&series(1 << 19, |t| barometer.read(0.7, t)), 50.0) {
            assert!((walk / f64::sqrt(2.0) / 0.012 - 1.0).abs() < 0.15, "after a second: {walk}");
        }
    }

    #[test]
    fn satellites_are_white_ten_times_a_second() {
        let mut gnss = Gnss::new(&GnssOptions::default(), &STREAMS);
        let readings = series(1 << 20, |t| gnss.read(Vector3::zeros(), t).map(|fix| fix.y));
        for density in white_density(&readings, 10.0) {
            assert!((density / (0.05 / f64::sqrt(5.0)) - 1.0).abs() < 0.2, "{density}");
        }
    }

    #[test]
    fn a_barometer_drifts_steadily_and_satellites_have_silences() {
        let options = BarometerOptions { noise_m: 0.0, drift_m_sqrt_s: 0.0, ..Default::default() };
        let mut barometer =
            Barometer::new(&BarometerOptions { drift_m_s: 0.02, ..options }, &STREAMS);
        assert_eq!([0.0, 50.0].map(|t| barometer.read(0.7, t)), [Some(0.7), Some(1.7)]);

        let silent = GnssOptions { silent_s: vec![[1.0, 2.0], [3.0, 3.5]], ..Default::default() };
        let [steady, broken] = [GnssOptions::default(), silent].map(|options| {
            let mut gnss = Gnss::new(&options, &STREAMS);
            (0..50).map(|k| gnss.read(Vector3::zeros(), f64::from(k) * 0.1)).collect::<Vec<_>>()
        });
        assert!(steady.iter().all(Option::is_some));
        for (k, (steady, broken)) in steady.iter().zip(&broken).enumerate() {
            let heard = !(10..20).contains(&k) && !(30..35).contains(&k);
            assert_eq!(*broken, steady.filter(|_| heard), "fix {k}: the others are unchanged");
        }
    }
}
