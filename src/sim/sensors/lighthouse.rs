//! Raw Lighthouse sweeps, which are planes of light that pass over the deck one after the other.
//!
//! A second-generation rotor turns freely at the rate of its channel, and its two planes pass a
//! third of a turn apart. First-generation stations take turns within a cycle of 120 Hz. A sweep is
//! available at the next tick, and all four sensors of the deck are read together, because the
//! firmware discards a sweep that a sensor misses (`pulse_processor_v2.c`).
//!
//! The drone's motion within a tick and walls are not modeled.

use nalgebra::{Matrix3, Vector3};

use super::options::count_v1;
use super::room::Room;
use super::station::StationPose;
use super::streams::Streams;
use super::{Generation, LighthouseOptions, Station};
use noctograph_core::geometry::Attitude;
use noctograph_core::random::{Field, Noise, Normals};

/// Positions of the photodiodes on the deck in the body frame in m, without the deck's height above
/// the body's origin (firmware `lighthouse_position_est.c`).
pub(crate) const DECK_SENSORS_M: [[f64; 3]; 4] =
    [[-0.015, 0.0075, 0.0], [-0.015, -0.0075, 0.0], [0.015, 0.0075, 0.0], [0.015, -0.0075, 0.0]];

/// Clock frequency of second-generation stations in Hz, and clock cycles per rotor turn for each
/// channel (`pulse_processor_v2.c`), which correspond to 50.05 to 54.1 turns per second.
const V2_CLOCK_HZ: f64 = 48e6;
const V2_PERIODS: [u32; 16] = [
    959_000, 957_000, 953_000, 949_000, 947_000, 943_000, 941_000, 939_000, 937_000, 929_000,
    919_000, 911_000, 907_000, 901_000, 893_000, 887_000,
];
/// Number of sweeps per second of all first-generation stations together.
const V1_SWEEPS_HZ: f64 = 120.0;

/// Interval in s at which the common distortion is computed. At 0.5 m/s, the distortion changes by
/// 0.1 mm in this time.
const BEND_S: f64 = 0.02;
/// Time in s after which an unseen station counts as hidden. Five losses in a row are rare.
const BLIND_S: f64 = 0.1;
/// Correlation length, as an angle in rad, of the error of a station's calibration.
const SWEEP_DISTORTION_LENGTH_RAD: f64 = 0.13;

/// Plane of light that passed over the deck.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// Index of the station in the list of stations.
    pub station: usize,
    /// Index of the plane, 0 or 1.
    pub plane: usize,
    /// Angles in rad at which the sweep hit each of the deck's four sensors.
    pub angles_rad: [f64; 4],
}

/// All stations at their true positions.
#[derive(Debug)]
pub(super) struct Lighthouse {
    rotors: Vec<Rotor>,
    /// Rotation from the room to the stations' frame, and scale of that frame.
    turn: Matrix3<f64>,
    scale: f64,
    /// Distortion common to all stations, because their joint solution distorts the room.
    bend: Field<3>,
    bend_m: Vector3<f64>,
    /// Time in s at which the distortion was computed.
    bent_s: f64,
    loss_frac: f64,
    room: Room,
    /// Sweeps of this tick.
    sweeps: Vec<Sweep>,
    blind_ticks: u32,
}

#[derive(Debug)]
struct Rotor {
    truth: StationPose,
    /// Standard deviations in rad of the noise common to the deck's sensors, and of each sensor.
    sigmas_rad: [f64; 2],
    /// Distortion of each plane as a function of the direction from the station.
    distortion: Field<2>,
    noise: Normals,
    /// Noise that determines which sweeps are lost.
    chance: Noise,
    /// Number of turns (cycles in the first generation) per second.
    turn_hz: f64,
    /// Phases in turns at which the planes pass.
    phases: [f64; 2],
    /// Number of sweeps of both planes so far.
    passed: u32,
    seen_s: f64,
}

impl Lighthouse {
    /// Creates the stations of a room, and the deck of a drone.
    pub(super) fn new(options: &LighthouseOptions, streams: &Streams) -> Self {
        let n = options.stations.len();
        Self {
            rotors: (0..n).map(|i| Rotor::new(options, i, streams)).collect(),
            turn: frame_turn(options),
            scale: 1.0 + options.frame_scale_error,
            bend: common_distortion(options, streams),
            bend_m: Vector3::zeros(),
            bent_s: f64::NEG_INFINITY,
            loss_frac: options.sweep_loss_frac,
            room: Room::new(options),
            sweeps: Vec::with_capacity(2 * n),
            blind_ticks: 0,
        }
    }

    /// Returns the sweeps that reach a deck at `position_m` by `time_s`, among drones at `fleet_m`.
    /// A sweep contains the angles in rad at the deck's four sensors. The positions are true
    /// positions in the world frame.
    pub(super) fn read(
        &mut self,
        position_m: &Vector3<f64>,
        world_from_body: impl Fn() -> Matrix3<f64>,
        time_s: f64,
        fleet_m: &[Vector3<f64>],
    ) -> &[Sweep] {
        self.sweeps.clear();
        // The position is converted to the stations' frame, including the common distortion.
        if time_s - self.bent_s >= BEND_S {
            (self.bend_m, self.bent_s) = (self.bend.value_at(position_m), time_s);
        }
        let turn = self.turn;
        let bent_m = turn * position_m * self.scale + self.bend_m;
        for (station, rotor) in self.rotors.iter_mut().enumerate() {
            while let Some(plane) = rotor.due(time_s) {
                // Noise is also drawn for unseen sweeps, so that no sweep affects another's noise.
                let is_lost = rotor.chance.uniform() < self.loss_frac;
                let errors = rotor.errors_rad();
                let room_from_body = world_from_body();
                let up = room_from_body.column(2).into_owned();
                if is_lost || self.room.is_silent(station, time_s) {
                    continue;
                }
                // The deck also receives sweeps that hit its image in a mirror.
                let attitude = turn * room_from_body;
                let mirrors = self.room.mirrors.iter();
                for mirror in mirrors.filter(|m| m.shows_to(&rotor.truth, position_m, &up)) {
                    let (image_m, reflected) =
                        (mirror.image_m(&bent_m), mirror.reflection() * attitude);
                    let angles_rad = rotor.angles_rad(plane, &image_m, &reflected, &errors);
                    self.sweeps.push(Sweep { station, plane, angles_rad });
                }
                // The direct sweep is received unless the view is blocked.
                let station_m = &rotor.truth.position_m;
                if !rotor.truth.sees(position_m, &up)
                    || self.room.hides(station_m, position_m, fleet_m)
                {
                    continue;
                }
                let angles_rad = rotor.angles_rad(plane, &bent_m, &attitude, &errors);
                rotor.seen_s = time_s;
                self.sweeps.push(Sweep { station, plane, angles_rad });
            }
        }
        let seen = self.rotors.iter().filter(|rotor| time_s - rotor.seen_s <= BLIND_S);
        self.blind_ticks += u32::from(seen.count() < 2);
        &self.sweeps
    }

    /// Returns the number of ticks with fewer than two stations seen in the last 0.1 s.
    pub(super) fn blind_ticks(&self) -> u32 {
        self.blind_ticks
    }
}

/// Returns the smooth distortion of the position that is common to all stations.
pub(super) fn common_distortion(options: &LighthouseOptions, streams: &Streams) -> Field<3> {
    let mut noise = streams.room_noise("lighthouse distortion");
    Field::new(&mut noise, options.distortion_m, options.distortion_length_m)
}

/// Returns the rotation from the room to the Lighthouse's frame.
pub(super) fn frame_turn(options: &LighthouseOptions) -> Matrix3<f64> {
    let [roll_rad, pitch_rad, yaw_rad] = options.frame_turn_rad;
    Attitude { yaw_rad, pitch_rad, roll_rad }.world_from_body()
}

impl Rotor {
    /// Creates station `i` at its true pose, with its errors and noise. `i` counts the stations
    /// from 0. `streams` gives the random numbers of the room and of the drone.
    fn new(options: &LighthouseOptions, i: usize, streams: &Streams) -> Self {
        // The true pose differs from the believed pose by a permanent error of the room.
        let station = &options.stations[i];
        let mut error = streams.room_noise(&format!("station {i} pose"));
        let mut truth = StationPose::new(station);
        truth.position_m += error.normals() * options.station_position_error_m;
        let turn_rad = error.normals() * options.station_rotation_error_rad;
        let turn = Attitude { yaw_rad: turn_rad.z, pitch_rad: turn_rad.y, roll_rad: turn_rad.x };
        truth.world_from_station *= turn.world_from_body();

        let mut chance = streams.drone_noise(&format!("station {i} sweeps"));
        let (turn_hz, phases) = schedule(&options.stations, i, &mut chance);
        let generation = usize::from(station.generation == Generation::V2);
        let (shared_frac, sigma_rad) =
            (options.sweep_noise_shared_frac, options.sweep_noise_rad[generation]);
        Self {
            truth,
            sigmas_rad: [shared_frac, 1.0 - shared_frac].map(|frac| frac.sqrt() * sigma_rad),
            distortion: Field::new(
                &mut streams.room_noise(&format!("station {i} distortion")),
                options.sweep_distortion_rad,
                SWEEP_DISTORTION_LENGTH_RAD,
            ),
            noise: Normals::new(streams.drone_noise(&format!("station {i} sweep angles"))),
            chance,
            turn_hz,
            phases,
            passed: 0,
            seen_s: 0.0,
        }
    }

    /// Returns the next plane (0 or 1) if it has passed by `time_s`, and counts it. Otherwise
    /// returns `None`.
    fn due(&mut self, time_s: f64) -> Option<usize> {
        let plane = (self.passed % 2) as usize;
        let turns = f64::from(self.passed / 2) + self.phases[plane];
        (turns <= time_s * self.turn_hz).then(|| {
            self.passed += 1;
            plane
        })
    }

    /// Draws the white noise of a sweep for each of the deck's four sensors. A part of it is common
    /// to all sensors.
    fn errors_rad(&mut self) -> [f64; 4] {
        let [common, separate] = self.sigmas_rad;
        let common_rad = common * self.noise.next();
        std::array::from_fn(|_| common_rad + separate * self.noise.next())
    }

    /// Returns the angles in rad at which the plane 0 or 1 hits a deck's four sensors, with
    /// distortion and the sensors' random errors `errors_rad`. `position_m` and the rotation are in
    /// the stations' frame.
    fn angles_rad(
        &self,
        plane: usize,
        position_m: &Vector3<f64>,
        world_from_body: &Matrix3<f64>,
        errors_rad: &[f64; 4],
    ) -> [f64; 4] {
        let direction = self.truth.station_from_world(position_m).normalize();
        let distortion_rad = self.distortion.component(plane, &direction);
        std::array::from_fn(|i| {
            let sensor_m = position_m + world_from_body * Vector3::from(DECK_SENSORS_M[i]);
            self.truth.crossing(plane, &sensor_m).angle_rad + distortion_rad + errors_rad[i]
        })
    }
}

/// Returns the number of turns per second of station `i`, and the phases, in turns, at which its
/// planes pass. `chance` draws the phase of a second-generation station.
fn schedule(stations: &[Station], i: usize, chance: &mut Noise) -> (f64, [f64; 2]) {
    match stations[i].generation {
        // First-generation stations take turns, each with both planes.
        Generation::V1 => {
            let slots = 2.0 * count_v1(stations) as f64;
            let first = 2.0 * count_v1(&stations[..i]) as f64 / slots;
            (V1_SWEEPS_HZ / slots, [first, first + 1.0 / slots])
        }
        Generation::V2 => {
            let phase = chance.uniform();
            let period = f64::from(V2_PERIODS[i % V2_PERIODS.len()]);
            (V2_CLOCK_HZ / period, [phase, phase + 1.0 / 3.0])
        }
    }
}
