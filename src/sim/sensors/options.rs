//! Settings of the sensors and of the Lighthouse's base stations.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::height::time_of_flight_sigma_m;
use crate::vehicle::MAX_COORDINATE_M;
use noctograph_core::error::{Error, Result};
use noctograph_core::input_error;
use noctograph_core::settings::{Described, Shape, joined, settings};

/// Maximum number of base stations, which is the number of second-generation channels.
const MAX_STATIONS: usize = 16;
/// Maximum number of ultra-wideband anchors.
const MAX_ANCHORS: usize = 64;

settings! {
    /// Sensors and their noise. Settings of unused sensors are kept.
    pub struct SensorOptions {
        /// Sensor that measures the position.
        positioning: Positioning = Positioning::Position;
        /// Additional measurements of the height, by time of flight and barometer.
        heights: Vec<HeightSensor> = Vec::new(),
            for "observer.kind" = "ekf" | "ekf-improved" | "altitude" | "cooperative";
        /// Gyroscope and accelerometer.
        imu: ImuOptions = ImuOptions::default();
        /// Lighthouse positioning.
        lighthouse: LighthouseOptions = LighthouseOptions::default(),
            for "sensors.positioning" = "position" | "crossing-beams" | "sweeps";
        /// Ultra-wideband ranging.
        uwb: UwbOptions = UwbOptions::default(), for "sensors.positioning" = "uwb-twr" | "uwb-tdoa";
        /// Time-of-flight ranger toward the floor.
        time_of_flight: TimeOfFlightOptions = TimeOfFlightOptions::default(),
            for "sensors.heights" = "time-of-flight",
            for "observer.kind" = "ekf" | "ekf-improved" | "altitude" | "cooperative";
        /// Ranges and messages between the drones of a fleet.
        peers: PeerOptions = PeerOptions::default(), for "observer.kind" = "cooperative";
        /// Barometer.
        barometer: BarometerOptions = BarometerOptions::default(),
            for "sensors.heights" = "barometer",
            for "observer.kind" = "ekf" | "ekf-improved" | "altitude" | "cooperative";
        /// Satellite navigation with a base station.
        gnss: GnssOptions = GnssOptions::default(), for "sensors.positioning" = "gnss";
    }

    /// Measurement of the position.
    pub enum Positioning {
        /// Lighthouse without stations: a position at every tick, with white jitter and a smooth
        /// distortion as in the log of the reference flight.
        "position" => Position,
        /// Lighthouse with positions from crossing beams of two stations (lighthouse.method 0).
        "crossing-beams" => CrossingBeams,
        /// Lighthouse with raw sweep angles (lighthouse.method 1).
        "sweeps" => Sweeps,
        /// Ultra-wideband two-way ranging to one anchor after the other.
        "uwb-twr" => UwbTwr,
        /// Ultra-wideband differences of the distances to two anchors.
        "uwb-tdoa" => UwbTdoa,
        /// Satellite navigation with a base station.
        "gnss" => Gnss,
    }

    /// Measurement of the height in addition to the positioning.
    #[derive(PartialOrd, Ord)]
    pub enum HeightSensor {
        /// Infrared time of flight to the floor.
        "time-of-flight" => TimeOfFlight,
        /// Air pressure.
        "barometer" => Barometer,
    }

    /// Gyroscope and accelerometer. A noise density of 0 switches that noise off.
    ///
    /// The defaults are from the BMI088's data sheet, 0.014 °/s/√Hz and 190 µg/√Hz along z.
    pub struct ImuOptions {
        /// Noise density of the gyroscope for each axis in (rad/s)/√Hz.
        gyro_noise_rad_s_sqrt_hz: f64 = 2.44e-4, in 0.0..=1.0;
        /// Noise density of the accelerometer for each axis in (m/s²)/√Hz.
        accelerometer_noise_m_s2_sqrt_hz: f64 = 1.86e-3, in 0.0..=10.0;
        fixed {
            /// Constant bias of the gyroscope about body x, y, z in rad/s, which remains after the
            /// firmware's calibration or arises as the sensor warms up.
            gyro_bias_rad_s: [f64; 3] = [0.0; 3];
        }
    }

    /// Lighthouse positioning. A value of 0 switches an error off.
    ///
    /// The defaults are from Bitcraze's `positioning_dataset` (Taffanel et al., arXiv 2104.11523).
    /// In that data set, positions from crossing beams at rest jitter by 0.3 mm at 50 fixes per
    /// second, which corresponds to 1 mm at 500. The slow error in flight is 13 mm RMS over three
    /// axes, with a correlation time of 0.6 to 3.4 s at 0.5 m/s. Sweep angles spread by 60 µrad
    /// (first generation) and 28 µrad (second), and 45 of 52 sweeps per second arrive. The rotor
    /// causes most of the sweeps' noise, which is common to all sensors. Independent noise would
    /// average out to a third of the crossing beams' jitter.
    ///
    /// Most of the error in flight, 13.5 mm on average, is distortion common to the stations. If
    /// the stations had only separate errors, the filter's estimate at rest would jitter by more
    /// than the measured 0.59 mm. The separate part is chosen so that both values match the
    /// measurements. By default, two stations are in opposite corners, about 4 m from the word.
    pub struct LighthouseOptions {
        /// Standard deviation for each axis of a smooth error that depends on the drone's position.
        ///
        /// The joint solution for the stations' poses does not remove this error, because the
        /// stations agree on a distorted room.
        distortion_m: f64 = 0.0075, in 0.0..=1.0;
        /// Correlation length l of this error, whose correlation decreases as `exp(−d²/2l²)`.
        distortion_length_m: f64 = 0.7, in 0.01..=1000.0;
        /// Base stations at their believed positions.
        stations: Vec<Station> = [[-2.5, -2.2, 2.4], [2.8, 2.2, 2.4]]
            .map(|place| Station::looking(Generation::V2, place, [0.15, 0.0, 0.75]))
            .into();
        /// Perfect mirrors, each given by a point and the normal. The deck also receives the sweeps
        /// of each station's mirror image.
        ///
        /// Mirrors, people and silent stations affect `sweeps` and `crossing-beams`. With any
        /// positioning, `check` keeps the flight away from mirrors.
        mirrors_m: Vec<[[f64; 3]; 2]> = Vec::new(), in -1e4..=1e4;
        /// Panes of glass, each given by a point and the normal. A pane reflects 8 % at normal
        /// incidence and more at grazing incidence. The deck receives a reflection up to a distance
        /// of 6 m times the square root of the reflectance.
        panes_m: Vec<[[f64; 3]; 2]> = Vec::new(), in -1e4..=1e4;
        /// People in the room, 1.8 m tall, each given by x, y and a radius. People block the light
        /// of `sweeps` and `crossing-beams`. With any positioning, `check` keeps the flight away
        /// from people.
        people_m: Vec<[f64; 3]> = Vec::new(), in -1e4..=1e4;
        /// Outages, each given by the number of the station, from 0, and the beginning and end of
        /// the outage in s.
        silent: Vec<[f64; 3]> = Vec::new(), in 0.0..=1e5,
            for "sensors.positioning" = "crossing-beams" | "sweeps";
        fixed {
            /// Standard deviation in m of the white noise of the measured position for each axis
            /// and tick, for `position`.
            jitter_m: f64 = 0.001;
            /// Rotation of the Lighthouse's frame relative to the room about x, y and z in rad.
            ///
            /// The frame is defined by positions at which the drone was placed by hand for the
            /// estimation of the stations' geometry. These are the origin, a point at 1 m on the
            /// x-axis, and a point on the floor (cflib,
            /// `examples/lighthouse/multi_bs_geometry_estimation.py`).
            frame_turn_rad: [f64; 3] = [0.0; 3];
            /// Relative scale error of the Lighthouse, due to the point at 1 m on the x-axis.
            frame_scale_error: f64 = 0.0;
            /// Standard deviation in rad of the white noise of a sweep angle for each deck sensor,
            /// for a first- and a second-generation station.
            sweep_noise_rad: [f64; 2] = [60e-6, 28e-6];
            /// Fraction of a sweep's noise variance that is common to all four sensors.
            sweep_noise_shared_frac: f64 = 0.8;
            /// Fraction of sweeps that are lost.
            sweep_loss_frac: f64 = 0.13;
            /// Standard deviation in m, for each axis, of the error of a station's believed
            /// position, in addition to the common distortion.
            station_position_error_m: f64 = 0.0015;
            /// Standard deviation in rad, per axis, of the error of a station's believed attitude.
            station_rotation_error_rad: f64 = 0.0007;
            /// Standard deviation in rad of the smooth error in a sweep angle that remains after
            /// calibration.
            sweep_distortion_rad: f64 = 0.001;
        }
    }

    /// Generation of a base station.
    pub enum Generation {
        /// One rotor with two planes, slanted by ±30°. The field of view is 150° × 110°.
        "v2" => V2,
        /// Two rotors, one with a vertical plane of light and one with a horizontal one. The field
        /// of view is 120° × 120°.
        "v1" => V1,
    }

    /// Ultra-wideband ranging.
    ///
    /// The defaults are those of the firmware's fixture `log05` at rest (180 differences per
    /// second, white noise of 6 cm, a bias of 20 cm per pair, and 14 % of errors above 0.45 m),
    /// with anchors in the corners of a room.
    pub struct UwbOptions {
        /// Positions of the anchors.
        anchors_m: Vec<[f64; 3]> = [[-2.5, -2.5], [-2.5, 2.5], [2.5, -2.5], [2.5, 2.5]]
            .into_iter()
            .flat_map(|[x, y]| [[x, y, 0.2], [x, y, 2.4]])
            .collect(), in -1e4..=1e4;
        /// Indices of the anchors from which each drone receives ranges, with one list per drone.
        ///
        /// If this list is empty, all drones receive all anchors.
        heard: Vec<Vec<usize>> = Vec::new(), in 0.0..=63.0;
        /// Number of ranges per second from all anchors together. With the estimator `cooperative`,
        /// this rate covers all anchors of all drones and all pairs of drones.
        rate_hz: f64 = 180.0, in 1.0..=2000.0;
        /// Standard deviation of the white noise of a range.
        noise_m: f64 = 0.06, in 0.0..=10.0;
        /// Standard deviation of the bias of a link (an anchor, or a pair of anchors), which varies
        /// with the drone's position.
        bias_m: f64 = 0.2, in 0.0..=10.0;
        /// Fraction of ranges that are outliers.
        outlier_frac: f64 = 0.1, in 0.0..=1.0;
        /// Standard deviation per axis of the error of a drone's estimated position at the start.
        start_error_m: f64 = 0.0, in 0.0..=10.0;
    }

    /// Ranges and messages between the drones of a fleet, for the estimator `cooperative`.
    ///
    /// A message contains the motion since the start according to the inertial sensors, and the
    /// ranges and heights measured since the last message. It takes 24 bytes, plus 3 bytes per
    /// range or height.
    pub struct PeerOptions {
        /// True if the drones measure the distances between them in the same way as those to
        /// anchors.
        ranging: bool = false;
        /// Number of messages that each drone sends per second.
        rate_hz: f64 = 20.0, in 0.1..=500.0;
        /// Fraction of messages that are lost, independently for each receiver.
        loss_frac: f64 = 0.0, in 0.0..=1.0;
        /// Latency of a message.
        delay_s: f64 = 0.02, in 0.0..=10.0;
    }

    /// Infrared ranger that looks down at the floor.
    ///
    /// The defaults are those of the firmware (`zranger2.c`).
    pub struct TimeOfFlightOptions {
        /// Standard deviation of the white noise of a distance near the floor. The sensor adds
        /// noise of 2.5 mm at 2.5 m and of 0.2 m at 4 m.
        noise_m: f64 = 0.0025, in 0.0..=10.0;
        /// Number of measurements per second.
        rate_hz: f64 = 40.0, in 0.1..=2000.0;
    }

    /// Barometer.
    ///
    /// The default noise of 9 cm at 50 Hz is that of the firmware's fixture `log05`. The drift is
    /// an assumption (30 cm in ten minutes).
    pub struct BarometerOptions {
        /// Standard deviation of the white noise of a height.
        noise_m: f64 = 0.09, in 0.0..=100.0;
        /// Random walk of the height in m/√s, which is the standard deviation after one second.
        drift_m_sqrt_s: f64 = 0.012, in 0.0..=100.0;
        /// Number of measurements per second.
        rate_hz: f64 = 50.0, in 0.1..=2000.0;
        fixed {
            /// Constant drift of the height in m/s, such as that from a weather front.
            drift_m_s: f64 = 0.0;
        }
    }

    /// Satellite navigation with a base station.
    pub struct GnssOptions {
        /// Standard deviation of the white noise of a fix for each axis.
        noise_m: f64 = 0.05, in 0.0..=100.0;
        /// Number of fixes per second.
        rate_hz: f64 = 10.0, in 0.1..=2000.0;
        fixed {
            /// Periods without a fix, in chronological order. `[[20, 30]]` means no fix from 20 s
            /// to 30 s.
            silent_s: Vec<[f64; 2]> = Vec::new();
        }
    }
}

/// Lighthouse base station at its believed pose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Station {
    /// Generation of the station.
    pub generation: Generation,
    /// Position in the world frame in m.
    pub position_m: [f64; 3],
    /// Rotation about world z in rad. At 0, the station faces along world x.
    pub yaw_rad: f64,
    /// Rotation about the yawed y axis in rad, positive downward.
    pub pitch_rad: f64,
    /// Rotation about the forward axis in rad.
    pub roll_rad: f64,
}

impl Station {
    /// Creates a station at `position_m` that faces `target_m` with a level horizon.
    ///
    /// If the station faces straight up or down, its yaw is zero.
    pub fn looking(generation: Generation, position_m: [f64; 3], target_m: [f64; 3]) -> Self {
        let forward = Vector3::from(target_m) - Vector3::from(position_m);
        Self::facing(generation, position_m, &forward, 0.0)
    }

    /// Creates a station at `position_m` whose axis is along `forward` (world frame, any length),
    /// and which is rolled about that axis.
    pub(crate) fn facing(
        generation: Generation,
        position_m: [f64; 3],
        forward: &Vector3<f64>,
        roll_rad: f64,
    ) -> Self {
        Self {
            generation,
            position_m,
            yaw_rad: libm::atan2(forward.y, forward.x),
            pitch_rad: -libm::atan2(forward.z, libm::hypot(forward.x, forward.y)),
            roll_rad,
        }
    }
}

impl Described for Station {
    const SHAPE: Shape = Shape::Plain;

    /// Checks that the position and the angles are within their ranges.
    fn check(&self, place: &str, _: Option<[f64; 2]>) -> Result<()> {
        let range_m = Some([-MAX_COORDINATE_M, MAX_COORDINATE_M]);
        self.position_m.check(&joined(place, "position_m"), range_m)?;
        for (key, angle_rad, max) in [
            ("yaw_rad", self.yaw_rad, 2.0 * PI),
            ("pitch_rad", self.pitch_rad, FRAC_PI_2),
            ("roll_rad", self.roll_rad, 2.0 * PI),
        ] {
            angle_rad.check(&joined(place, key), Some([-max, max]))?;
        }
        Ok(())
    }
}

impl Positioning {
    /// Returns the minimum number of base stations and the minimum number of anchors.
    fn least_counts(self) -> [usize; 2] {
        match self {
            Self::Position | Self::Gnss => [0, 0],
            Self::CrossingBeams => [2, 0],
            Self::Sweeps => [1, 0],
            Self::UwbTwr => [0, 1],
            Self::UwbTdoa => [0, 2],
        }
    }

    /// True if the positioning uses ultra-wideband ranges.
    pub fn is_by_ranges(self) -> bool {
        let [_, n_anchors] = self.least_counts();
        n_anchors > 0
    }

    /// True if the positioning uses the angles of Lighthouse beams.
    pub(crate) fn is_by_light(self) -> bool {
        let [n_stations, _] = self.least_counts();
        n_stations > 0
    }

    /// True if the positioning measures positions instead of angles or distances.
    pub(crate) fn gives_positions(self) -> bool {
        match self {
            Self::Position | Self::CrossingBeams | Self::Gnss => true,
            Self::Sweeps | Self::UwbTwr | Self::UwbTdoa => false,
        }
    }
}

impl HeightSensor {
    /// True if the sensor measures the distance to the floor instead of the height above the start.
    pub(crate) fn looks_down(self) -> bool {
        match self {
            Self::TimeOfFlight => true,
            Self::Barometer => false,
        }
    }
}

impl UwbOptions {
    /// Returns the positions of the anchors in m in the world frame.
    pub fn anchors(&self) -> Vec<Vector3<f64>> {
        self.anchors_m.iter().map(|anchor| Vector3::from(*anchor)).collect()
    }

    /// Returns the indices of the anchors that a drone receives, which are all anchors if there are
    /// no lists. Returns [`Error::Input`] for a drone without a list.
    pub(crate) fn heard_by(&self, drone: u64) -> Result<Vec<usize>> {
        match usize::try_from(drone).ok().and_then(|drone| self.heard.get(drone)) {
            Some(heard) => Ok(heard.clone()),
            None if self.heard.is_empty() => Ok((0..self.anchors_m.len()).collect()),
            None => {
                let (n, drone) = (self.heard.len(), drone + 1);
                Err(input_error!(
                    "sensors.uwb.heard",
                    "{n} lists for at least {drone} drones",
                    "one list per drone, or no lists",
                    "list the anchors from which each drone receives ranges"
                ))
            }
        }
    }

    /// Checks that no two anchors have the same position, and that each drone receives at least
    /// `least` different anchors.
    fn check_anchors(&self, least: usize) -> Result<()> {
        for (i, anchor) in self.anchors_m.iter().enumerate() {
            if self.anchors_m[..i].contains(anchor) {
                return Err(input_error!(
                    "",
                    "{anchor:?}, which is also the position of another anchor",
                    "a different position for each anchor",
                    "list each anchor once"
                )
                .of_item("sensors.uwb.anchors_m", i));
            }
        }
        // The lengths of the lists of received anchors are checked before their indices.
        let n = self.anchors_m.len();
        for (drone, heard) in self.heard.iter().enumerate() {
            let list = "sensors.uwb.heard";
            let hint = "list the anchors from which the drone receives ranges";
            check_count("", heard.len(), [least, n], hint).map_err(|e| e.of_item(list, drone))?;
            let invalid =
                (0..heard.len()).find(|i| heard[*i] >= n || heard[..*i].contains(&heard[*i]));
            if let Some(i) = invalid {
                let (anchor, most) = (heard[i], n - 1);
                return Err(input_error!(
                    "",
                    "{anchor}",
                    "each index once, from 0 to {most}",
                    "an index is a position in the list sensors.uwb.anchors_m, counted from 0"
                )
                .of_item("", i)
                .of_item(list, drone));
            }
        }
        Ok(())
    }
}

/// Returns the number of first-generation stations.
pub(super) fn count_v1(stations: &[Station]) -> usize {
    stations.iter().filter(|station| station.generation == Generation::V1).count()
}

/// Checks that the number of items under a key is between `least` and `most`.
fn check_count(key: &str, n: usize, [least, most]: [usize; 2], hint: &str) -> Result<()> {
    if (least..=most).contains(&n) {
        return Ok(());
    }
    Err(Error::input(key, format!("{n} of them"), format!("{least} to {most}"), hint))
}

impl SensorOptions {
    /// Returns sensors that measure without noise, bias, distortion and outliers.
    pub fn ideal() -> Self {
        // All other errors are zero by default.
        let mut ideal = Self::default();
        let Self { imu, lighthouse, uwb, time_of_flight, barometer, gnss, .. } = &mut ideal;
        lighthouse.sweep_noise_rad = [0.0; 2];
        let errors = [
            &mut imu.gyro_noise_rad_s_sqrt_hz,
            &mut imu.accelerometer_noise_m_s2_sqrt_hz,
            &mut lighthouse.jitter_m,
            &mut lighthouse.distortion_m,
            &mut lighthouse.sweep_loss_frac,
            &mut lighthouse.station_position_error_m,
            &mut lighthouse.station_rotation_error_rad,
            &mut lighthouse.sweep_distortion_rad,
            &mut uwb.noise_m,
            &mut uwb.bias_m,
            &mut uwb.outlier_frac,
            &mut time_of_flight.noise_m,
            &mut barometer.noise_m,
            &mut barometer.drift_m_sqrt_s,
            &mut gnss.noise_m,
        ];
        errors.into_iter().for_each(|error| *error = 0.0);
        ideal
    }

    /// Returns the number of readings per second of a height sensor.
    pub(crate) fn height_rate_hz(&self, sensor: HeightSensor) -> f64 {
        match sensor {
            HeightSensor::TimeOfFlight => self.time_of_flight.rate_hz,
            HeightSensor::Barometer => self.barometer.rate_hz,
        }
    }

    /// Returns the standard deviation in m of a height sensor's white noise at a measured height.
    pub(crate) fn height_sigma_m(&self, sensor: HeightSensor, measured_m: f64) -> f64 {
        match sensor {
            HeightSensor::TimeOfFlight => {
                time_of_flight_sigma_m(self.time_of_flight.noise_m, measured_m)
            }
            HeightSensor::Barometer => self.barometer.noise_m,
        }
    }

    /// Checks that the periods without satellites are in chronological order and do not overlap.
    pub(crate) fn check_silences(&self) -> Result<()> {
        let mut heard_from_s = 0.0;
        for (i, [from_s, to_s]) in self.gnss.silent_s.iter().enumerate() {
            let wanted = if from_s >= to_s {
                "an end after the beginning".to_owned()
            } else if *from_s < heard_from_s {
                format!("a beginning not before {heard_from_s} s, the end of the previous period")
            } else {
                heard_from_s = *to_s;
                continue;
            };
            let hint = "write each period as [from, to], in chronological order, and join \
                        overlapping periods";
            let error = Error::input("", format!("{from_s} to {to_s} s"), wanted, hint);
            return Err(error.of_item("sensors.gnss.silent_s", i));
        }
        Ok(())
    }

    /// Checks the numbers of base stations and anchors that the positioning requires, and the
    /// anchors that each drone receives.
    pub(crate) fn check_counts(&self) -> Result<()> {
        let [least_stations, least_anchors] = self.positioning.least_counts();
        let (stations, anchors_m) = (&self.lighthouse.stations, &self.uwb.anchors_m);
        let key = "sensors.lighthouse.stations";
        let hint = "list the room's base stations";
        check_count(key, stations.len(), [least_stations, MAX_STATIONS], hint)?;
        let v1_hint = "at most two v1 stations take turns, so use v2 for more stations";
        check_count(&format!("{key}, generation v1"), count_v1(stations), [0, 2], v1_hint)?;
        let anchor_hint = "list the positions of the anchors";
        let anchor_bounds = [least_anchors, MAX_ANCHORS];
        check_count("sensors.uwb.anchors_m", anchors_m.len(), anchor_bounds, anchor_hint)?;
        if least_anchors == 0 { Ok(()) } else { self.uwb.check_anchors(least_anchors) }
    }
}
