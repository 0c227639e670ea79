//! Sensors, which measure the drone's motion. Each sensor is in a separate file.
//!
//! The input is the true state and the specific force at a tick. The output is readings. Every
//! sensor has separate noise streams and draws the same number of values for each measurement, so
//! that no sensor affects another's noise.

mod coverage;
mod crossing_beams;
#[cfg(test)]
mod density;
mod height;
mod imu;
mod lighthouse;
mod options;
mod peers;
mod position;
mod room;
mod station;
mod streams;
mod uwb;
// Web pages cannot read files.
#[cfg(not(target_family = "wasm"))]
mod yaml;

use nalgebra::Vector3;

use self::crossing_beams::CrossingBeams;
use self::height::{Barometer, Gnss, TimeOfFlight};
use self::imu::Imu;
use self::lighthouse::Lighthouse;
use self::position::PositionSensor;
use self::streams::Streams;
use self::uwb::Uwb;
use crate::vehicle::{FloorOptions, RigidBody};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::flight::warning;

pub use self::coverage::{Coverage, CoveredPoint, coverage};
pub(crate) use self::lighthouse::DECK_SENSORS_M;
pub use self::lighthouse::Sweep;
pub use self::options::{
    BarometerOptions, Generation, GnssOptions, HeightSensor, ImuOptions, LighthouseOptions,
    PeerOptions, Positioning, SensorOptions, Station, TimeOfFlightOptions, UwbOptions,
};
pub use self::peers::Target;
pub(crate) use self::peers::{Air, Fleet, Member, Message, Reckoning, Segment, Shared};
pub(crate) use self::station::StationPose;
pub(crate) use self::streams::Clock;
pub use self::uwb::Range;
pub(crate) use self::uwb::{PeerRange, Turn, turns};
#[cfg(not(target_family = "wasm"))]
pub use self::yaml::{read_anchors, read_lighthouse_config};

/// Readings of one tick. Inertial readings are available at each tick, other readings when due.
#[derive(Clone, Copy, Debug)]
pub struct Readings<'a> {
    /// True motion, used only by the estimator `truth`.
    pub truth: &'a RigidBody,
    /// Mean motor command since the last tick, as a fraction of the maximum.
    pub throttle: f64,
    /// Angular velocity from the gyroscope in the body frame in rad/s.
    pub rate_rad_s: Vector3<f64>,
    /// Specific force from the accelerometer in the body frame in m/s², which is the acceleration
    /// minus gravity, or `(0, 0, g)` at rest.
    pub specific_force_m_s2: Vector3<f64>,
    /// Position in the world frame in m, if the positioning system reports positions.
    pub position_m: Option<Vector3<f64>>,
    /// Lighthouse sweeps.
    pub sweeps: &'a [Sweep],
    /// Ultra-wideband ranges.
    pub ranges: &'a [Range],
    /// Ultra-wideband ranges to other drones.
    pub(crate) peer_ranges: &'a [PeerRange],
    /// Heights in m that are due, each with its sensor.
    pub heights: &'a [(HeightSensor, f64)],
}

impl<'a> Readings<'a> {
    /// Creates readings of the inertial sensors only. The specific force and the rate are in the
    /// body frame, and the throttle is 0.
    pub(crate) fn inertial(
        truth: &'a RigidBody,
        rate_rad_s: Vector3<f64>,
        specific_force_m_s2: Vector3<f64>,
    ) -> Self {
        Self {
            truth,
            throttle: 0.0,
            rate_rad_s,
            specific_force_m_s2,
            position_m: None,
            sweeps: &[],
            ranges: &[],
            peer_ranges: &[],
            heights: &[],
        }
    }

    /// True if a position, sweep, range or height is due.
    pub(crate) fn measures_position(&self) -> bool {
        !self.sweeps.is_empty()
            || !self.ranges.is_empty()
            || self.position_m.is_some()
            || !self.heights.is_empty()
    }
}

/// Sensors of one drone.
#[derive(Debug)]
pub struct Sensors {
    imu: Imu,
    locator: Locator,
    altimeters: Vec<Altimeter>,
    /// Heights of the last tick.
    heights: Vec<(HeightSensor, f64)>,
    tick_s: f64,
    ticks: u32,
}

/// Sensor that measures the position.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "one per drone")]
enum Locator {
    Position(PositionSensor),
    /// Sweeps, and optionally the positions at which their beams cross.
    Lighthouse(Lighthouse, Option<CrossingBeams>),
    Uwb(Uwb),
    Gnss(Gnss),
}

/// Sensor that measures the height.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "a few per drone")]
enum Altimeter {
    TimeOfFlight(TimeOfFlight),
    Barometer(Barometer),
}

impl Locator {
    /// Creates the positioning sensor that the options select, which is read `rate_hz` times per
    /// second.
    fn new(options: &SensorOptions, rate_hz: u32, fleet: &Fleet, streams: &Streams) -> Self {
        let room = &options.lighthouse;
        match options.positioning {
            Positioning::Position => Self::Position(PositionSensor::new(room, rate_hz, streams)),
            Positioning::CrossingBeams => {
                let beams = CrossingBeams::new(&room.stations);
                Self::Lighthouse(Lighthouse::new(room, streams), Some(beams))
            }
            Positioning::Sweeps => Self::Lighthouse(Lighthouse::new(room, streams), None),
            Positioning::UwbTwr | Positioning::UwbTdoa => {
                Self::Uwb(Uwb::new(options, fleet, streams))
            }
            Positioning::Gnss => Self::Gnss(Gnss::new(&options.gnss, streams)),
        }
    }
}

impl Altimeter {
    /// Returns the kind of the sensor and its reading in m, or `None` if no reading is due.
    fn read(&mut self, body: &RigidBody, time_s: f64) -> Option<(HeightSensor, f64)> {
        let position_m = body.position_m;
        Some(match self {
            Self::TimeOfFlight(sensor) => {
                let distance_m = sensor.read(&position_m, || body.matrix(), time_s)?;
                (HeightSensor::TimeOfFlight, distance_m)
            }
            Self::Barometer(sensor) => {
                (HeightSensor::Barometer, sensor.read(position_m.z, time_s)?)
            }
        })
    }
}

impl Sensors {
    /// Creates the sensors of a drone, which are read `rate_hz` times per second, with the seeds
    /// for the noise and for the room.
    pub(crate) fn new(
        options: &SensorOptions,
        floor: &FloorOptions,
        rate_hz: u32,
        [seed, room_seed]: [u64; 2],
        fleet: &Fleet,
    ) -> Self {
        let drone = fleet.members[fleet.place].index;
        let streams = &Streams { seed, room_seed, drone };
        // The sensors are in the order of their kinds, regardless of the order of the list.
        let carried = HeightSensor::ALL.iter().filter(|sensor| options.heights.contains(sensor));
        let altimeters = carried.map(|sensor| match sensor {
            HeightSensor::TimeOfFlight => {
                let ranger = TimeOfFlight::new(&options.time_of_flight, floor, streams);
                Altimeter::TimeOfFlight(ranger)
            }
            HeightSensor::Barometer => {
                Altimeter::Barometer(Barometer::new(&options.barometer, streams))
            }
        });
        Self {
            imu: Imu::new(&options.imu, rate_hz, streams),
            locator: Locator::new(options, rate_hz, fleet, streams),
            altimeters: altimeters.collect(),
            heights: Vec::new(),
            tick_s: 1.0 / f64::from(rate_hz),
            ticks: 0,
        }
    }

    /// Returns the position at which the estimate of a drone at rest starts, which is the true
    /// position or, with the positioning `position`, the distorted one.
    pub(crate) fn settled_m(&self, position_m: Vector3<f64>) -> Vector3<f64> {
        match &self.locator {
            Locator::Position(sensor) => sensor.settled_m(position_m),
            Locator::Lighthouse(..) | Locator::Uwb(_) | Locator::Gnss(_) => position_m,
        }
    }

    /// Returns the readings of every sensor that is due, once per tick. `fleet_m` contains the true
    /// positions of the fleet, for ranges between drones and views that they block. A single drone
    /// needs no fleet.
    pub(crate) fn read<'a>(
        &'a mut self,
        body: &'a RigidBody,
        specific_force_m_s2: Vector3<f64>,
        fleet_m: &[Vector3<f64>],
    ) -> Readings<'a> {
        let (tick, time_s) = (self.ticks, f64::from(self.ticks) * self.tick_s);
        self.ticks += 1;
        let position_m = body.position_m;
        // A closure computes the matrix, because most ticks do not need it.
        let world_from_body = || body.matrix();
        let mut readings = Readings::inertial(
            body,
            self.imu.rate_rad_s(body.rate_rad_s),
            self.imu.specific_force_m_s2(specific_force_m_s2),
        );
        match &mut self.locator {
            Locator::Position(sensor) => readings.position_m = Some(sensor.read(position_m, tick)),
            Locator::Lighthouse(lighthouse, beams) => {
                let sweeps = lighthouse.read(&position_m, world_from_body, time_s, fleet_m);
                match beams {
                    Some(beams) => readings.position_m = beams.fix_m(sweeps, time_s),
                    None => readings.sweeps = sweeps,
                }
            }
            Locator::Uwb(uwb) => {
                (readings.ranges, readings.peer_ranges) = uwb.read(&position_m, fleet_m, time_s);
            }
            Locator::Gnss(gnss) => readings.position_m = gnss.read(position_m, time_s),
        }
        self.heights.clear();
        let altimeters = self.altimeters.iter_mut();
        self.heights.extend(altimeters.filter_map(|altimeter| altimeter.read(body, time_s)));
        readings.heights = &self.heights;
        readings
    }

    /// Returns the present bias of the barometer in m, or 0 without one.
    pub fn barometer_bias_m(&self) -> f64 {
        let time_s = f64::from(self.ticks) * self.tick_s;
        let bias_m = self.altimeters.iter().find_map(|altimeter| match altimeter {
            Altimeter::Barometer(barometer) => Some(barometer.bias_m(time_s)),
            Altimeter::TimeOfFlight(_) => None,
        });
        bias_m.unwrap_or(0.0)
    }

    /// Returns a warning if there was a time at which fewer than two base stations were seen. The
    /// warning states the total time.
    pub fn warning(&self) -> Option<Diagnostic> {
        let Locator::Lighthouse(lighthouse, _) = &self.locator else { return None };
        let blind_s = f64::from(lighthouse.blind_ticks()) * self.tick_s;
        (blind_s > 0.0).then(|| warning::unseen(blind_s))
    }
}

#[cfg(test)]
mod tests {
    use super::density::white_density;
    use super::*;
    use crate::sensors::Generation;
    use noctograph_core::crazyflie::GRAVITY_M_S2;

    const PLACE_M: Vector3<f64> = Vector3::new(0.1, 0.2, 0.7);

    impl Streams {
        pub(super) fn alone(seed: u64) -> Self {
            Self { seed, room_seed: seed, drone: 0 }
        }
    }

    #[derive(Debug, PartialEq)]
    struct Written {
        inertial: [Vector3<f64>; 2],
        position_m: Option<Vector3<f64>>,
        sweeps: Vec<Sweep>,
        ranges: Vec<Range>,
        heights: Vec<(HeightSensor, f64)>,
    }

    fn sensors(options: &SensorOptions, seeds: [u64; 2], drone: u64) -> Sensors {
        Sensors::new(options, &FloorOptions::default(), 500, seeds, &Fleet::alone(drone))
    }

    fn readings(options: &SensorOptions, n: usize) -> Vec<Written> {
        let (body, force) = (RigidBody::resting_at(PLACE_M), Vector3::z() * GRAVITY_M_S2);
        let mut sensors = sensors(options, [1, 1], 0);
        let readings = (0..n).map(|_| {
            let r = sensors.read(&body, force, &[]);
            Written {
                inertial: [r.rate_rad_s, r.specific_force_m_s2],
                position_m: r.position_m,
                sweeps: r.sweeps.to_vec(),
                ranges: r.ranges.to_vec(),
                heights: r.heights.to_vec(),
            }
        });
        readings.collect()
    }

    #[test]
    fn drones_of_one_room_share_its_distortion_and_not_their_noise() {
        let body = RigidBody::resting_at(Vector3::new(0.4, -0.1, 0.9));
        let options = SensorOptions::default();
        let settled_m = [(1, 0), (1, 3), (2, 0)]
            .map(|(seed, drone)| sensors(&options, [seed; 2], drone).settled_m(body.position_m));
        assert_eq!(settled_m[0], settled_m[1], "one room");
        assert_ne!(settled_m[0], settled_m[2], "another room");
        let first_m = [0, 1].map(|drone| {
            sensors(&options, [1, 1], drone).read(&body, Vector3::z() * 9.81, &[]).position_m
        });
        assert_ne!(first_m[0], first_m[1], "each has jitter of its own");

        // The base stations' poses have errors, but no sensor has noise.
        let mut sweeps =
            SensorOptions { positioning: Positioning::CrossingBeams, ..SensorOptions::default() };
        sweeps.lighthouse.sweep_noise_rad = [0.0; 2];
        let drones = [([1, 1], 0), ([9, 1], 3), ([1, 2], 0)];
        let [one, other, elsewhere] = drones.map(|(seeds, drone)| {
            let mut sensors = sensors(&sweeps, seeds, drone);
            let force = Vector3::z() * 9.81;
            let fixes = (0..500).filter_map(|_| sensors.read(&body, force, &[]).position_m);
            fixes.last().unwrap()
        });
        assert!((one - other).norm() < 1e-6, "one room, two drones, two flights: {one} {other}");
        assert!((one - elsewhere).norm() > 1e-3, "another room");
    }

    #[test]
    fn ideal_sensors_read_the_truth() {
        for &positioning in Positioning::ALL {
            let heights = HeightSensor::ALL.to_vec();
            let options = SensorOptions { positioning, heights, ..SensorOptions::ideal() };
            let anchors_m = options.uwb.anchors();
            for reading in readings(&options, 200) {
                assert_eq!(reading.inertial, [Vector3::zeros(), Vector3::z() * GRAVITY_M_S2]);
                let off_m = reading.position_m.map_or(0.0, |found_m| (found_m - PLACE_M).norm());
                assert!(off_m < 1e-9, "{positioning:?}: {off_m}");
                for (sensor, height_m) in reading.heights {
                    assert!((height_m - PLACE_M.z).abs() < 1e-12, "{sensor:?}: {height_m}");
                }
                for range in reading.ranges {
                    let true_m = |anchor: usize| (anchors_m[anchor] - PLACE_M).norm();
                    let wanted_m = true_m(range.anchor) - range.minus.map_or(0.0, true_m);
                    assert!((range.distance_m - wanted_m).abs() < 1e-12, "{range:?}");
                }
            }
        }
    }

    #[test]
    fn a_further_sensor_leaves_the_others_as_they_are() {
        for &positioning in Positioning::ALL {
            let heights = HeightSensor::ALL.to_vec();
            let carried =
                [(positioning, vec![]), (positioning, heights), (Positioning::Position, vec![])];
            let [alone, beside, gyro] = carried.map(|(positioning, heights)| {
                readings(&SensorOptions { positioning, heights, ..Default::default() }, 200)
            });
            for ((a, b), c) in alone.iter().zip(&beside).zip(&gyro) {
                assert_eq!(a.inertial, c.inertial, "{positioning:?}");
                assert_eq!((&a.sweeps, &a.ranges), (&b.sweeps, &b.ranges), "{positioning:?}");
                assert_eq!(a.position_m, b.position_m, "{positioning:?}");
            }
        }
        let mut options = SensorOptions { positioning: Positioning::Sweeps, ..Default::default() };
        let two = readings(&options, 200);
        let lighthouse = &mut options.lighthouse;
        lighthouse.stations.push(lighthouse.stations[0].clone());
        lighthouse.sweep_loss_frac = 0.5;
        let [two, three] = [two, readings(&options, 200)].map(|written| {
            let sweeps = written.into_iter().flat_map(|w| w.sweeps);
            sweeps.filter(|sweep| sweep.station == 0).collect::<Vec<Sweep>>()
        });
        assert!(three.len() > 10 && three.iter().all(|sweep| two.contains(sweep)), "a subset");
    }

    #[test]
    fn a_sensor_without_noise_leaves_the_others_as_they_are() {
        let loud = readings(&SensorOptions::default(), 20);
        let mut options = SensorOptions::default();
        options.imu.gyro_noise_rad_s_sqrt_hz = 0.0;
        for (quiet, loud) in readings(&options, 20).iter().zip(&loud) {
            assert_eq!(quiet.position_m, loud.position_m);
            assert_eq!(quiet.inertial[1], loud.inertial[1]);
            assert_eq!(quiet.inertial[0], Vector3::zeros());
        }
    }

    #[test]
    fn no_two_sensors_share_their_noise() {
        let mut options = SensorOptions::default();
        options.lighthouse.distortion_m = 0.0;
        let reading = &readings(&options, 1)[0];
        let sampled = f64::sqrt(250.0);
        let [rate, force] = reading.inertial;
        let first = [
            (reading.position_m.unwrap().x - PLACE_M.x) / options.lighthouse.jitter_m,
            rate.x / (options.imu.gyro_noise_rad_s_sqrt_hz * sampled),
            force.x / (options.imu.accelerometer_noise_m_s2_sqrt_hz * sampled),
            (force.z - GRAVITY_M_S2) / (options.imu.accelerometer_noise_m_s2_sqrt_hz * sampled),
        ];
        for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            assert!((first[i] - first[j]).abs() > 1e-6, "{first:?}");
        }
    }

    #[test]
    fn positions_are_white_at_rest() {
        let readings = readings(&SensorOptions::default(), 1 << 16);
        let heights_m: Vec<f64> = readings.iter().map(|r| r.position_m.unwrap().z).collect();
        for density in white_density(&heights_m, 500.0) {
            let want = 0.001 / f64::sqrt(250.0);
            assert!((density / want - 1.0).abs() < 0.15, "{density:e} m/√Hz of {want:e}");
        }
    }

    #[test]
    fn distortion_is_constant_at_rest() {
        let mut options = SensorOptions::default();
        options.lighthouse.jitter_m = 0.0;
        let readings = readings(&options, 50);
        assert!(readings.iter().all(|r| r.position_m == readings[0].position_m));
        assert!((readings[0].position_m.unwrap() - PLACE_M).norm() > 1e-4, "is there");
    }

    #[test]
    fn sweeps_spread_as_stated_and_as_many_arrive() {
        for (generation, sigma, per_second) in
            [(Generation::V1, 60e-6, 30.0 * 0.87), (Generation::V2, 28e-6, 50.1 * 0.87)]
        {
            let mut options =
                SensorOptions { positioning: Positioning::Sweeps, ..Default::default() };
            options.lighthouse.stations.iter_mut().for_each(|s| s.generation = generation);
            let seconds = 240;
            let written = readings(&options, 500 * seconds);
            let angles: Vec<f64> = (written.iter().flat_map(|w| &w.sweeps))
                .filter(|sweep| (sweep.station, sweep.plane) == (1, 0))
                .map(|sweep| sweep.angles_rad[2])
                .collect();
            let (n, seconds) = (angles.len() as f64, seconds as f64);
            let rate = n / seconds;
            assert!((rate / per_second - 1.0).abs() < 0.04, "{generation:?}: {rate} a second");
            let mean = angles.iter().sum::<f64>() / n;
            let spread = (angles.iter().map(|a| (a - mean) * (a - mean)).sum::<f64>() / n).sqrt();
            assert!((spread / sigma - 1.0).abs() < 0.05, "{generation:?}: {spread:e} rad");
            for density in white_density(&angles, rate) {
                let want = sigma / (0.5 * rate).sqrt();
                assert!((density / want - 1.0).abs() < 0.3, "{generation:?}: {density:e} rad/√Hz");
            }
        }
    }
}
