//! Extended Kalman filter on whatever is measured: sweep angles, positions, ranges, heights.
//!
//! Position and velocity in the world and an attitude, driven by gyroscope and accelerometer at
//! every tick; the nine errors' covariance is carried when something is measured, and at 100 times
//! a second otherwise, as in the firmware (`estimator_kalman.c`). All measurements of a tick are
//! held against the state predicted for it, one scalar after the other, each through a χ² gate.
//!
//! Sources: Mueller, Hamer, D'Andrea, "Fusing ultra-wideband range measurements with accelerometers
//! and rate gyroscopes for quadrocopter state estimation", ICRA 2015 (the firmware's filter); Solà,
//! "Quaternion kinematics for the error-state Kalman filter", arXiv 1711.02508.
//!
//! Not estimated: biases of the inertial sensors, of ranges and of air pressure; errors of the
//! stations' geometry; steps of the floor, unless `floor_steps` says so.

use nalgebra::{Matrix3, Vector3};

use super::Estimator;
use super::attitude::{Turned, angles};
use super::covariance::{Covariance, Errors, Slope};
use super::floor::{FloorBelow, Measured};
use crate::sim::options::{EkfOptions, Generation, SensorOptions};
use crate::sim::sensors::{
    DECK_SENSORS_M, Range, Readings, StationPose, Sweep, time_of_flight_sigma_m,
};
use crate::sim::vehicle::{GRAVITY_M_S2, State};

/// Initial σ of position (m), velocity (m/s) and attitude (rad), for a drone put on its mark.
const START: [f64; 3] = [0.02, 0.01, 0.02];
/// The covariance is carried at least this often.
const LONGEST_SPAN_S: f64 = 0.01;
/// Cosine of the tilt beyond which the ranger's distance says nothing about the height.
const LEAST_COS_TILT: f64 = 0.3;

/// The filter.
#[derive(Debug)]
pub(super) struct Ekf {
    pub(super) position_m: Vector3<f64>,
    pub(super) velocity_m_s: Vector3<f64>,
    pub(super) attitude: Turned,
    /// The attitude as a matrix, since the covariance was carried last.
    world_from_body: Matrix3<f64>,
    rate_rad_s: Vector3<f64>,
    pub(super) covariance: Covariance,
    /// Since the covariance was carried last.
    span_s: f64,
    turn_rad: Vector3<f64>,
    /// Corrections by the measurements of this tick.
    errors: Errors,
    /// The floor below the drone, where it may have steps.
    floor: Option<FloorBelow>,
    stations: Vec<StationPose>,
    /// Whether each station is of the second generation.
    is_v2: Vec<bool>,
    anchors_m: Vec<Vector3<f64>>,
    trust: Trust,
}

/// Spectral densities (two-sided), variances and the gate.
#[derive(Clone, Copy, Debug)]
struct Trust {
    /// Along world x, y, z.
    acceleration: [f64; 3],
    rate: f64,
    /// Of a station of the first and of the second generation.
    sweep: [f64; 2],
    position: f64,
    /// Of a difference, and of two-way ranging.
    range: [f64; 2],
    barometer: f64,
    gate_sq: f64,
    /// Standard deviation of a near range to the floor.
    ranger_m: f64,
}

impl Ekf {
    /// A filter that believes in a level drone at rest at `position_m`.
    pub(super) fn new(
        options: &EkfOptions,
        sensors: &SensorOptions,
        position_m: Vector3<f64>,
    ) -> Self {
        let square = |sigma: f64| sigma * sigma;
        Self {
            position_m,
            velocity_m_s: Vector3::zeros(),
            attitude: Turned::level(),
            world_from_body: Matrix3::identity(),
            rate_rad_s: Vector3::zeros(),
            covariance: Covariance::new(START[0], START[1], START[2]),
            span_s: 0.0,
            turn_rad: Vector3::zeros(),
            errors: Errors::default(),
            floor: options.floor_steps.then(FloorBelow::new),
            stations: sensors.lighthouse.stations.iter().map(StationPose::new).collect(),
            is_v2: sensors
                .lighthouse
                .stations
                .iter()
                .map(|s| s.generation == Generation::V2)
                .collect(),
            anchors_m: sensors.uwb.anchors_m.iter().map(|a| Vector3::from(*a)).collect(),
            trust: Trust {
                acceleration: [
                    options.acceleration_noise_m_s2_sqrt_hz,
                    options.acceleration_noise_m_s2_sqrt_hz,
                    options.acceleration_noise_z_m_s2_sqrt_hz,
                ]
                .map(|density| 0.5 * square(density)),
                rate: 0.5 * square(options.rate_noise_rad_s_sqrt_hz),
                sweep: [options.sweep_v1_sigma_rad, options.sweep_sigma_rad].map(square),
                position: square(options.position_sigma_m),
                range: [options.range_sigma_m, options.two_way_sigma_m].map(square),
                barometer: square(options.barometer_sigma_m),
                gate_sq: square(options.gate_sigmas),
                ranger_m: sensors.time_of_flight.noise_m,
            },
        }
    }

    /// Moves the state over a span with the mean of the body rates at its ends and the specific
    /// force along it.
    fn predict(&mut self, rate_rad_s: &Vector3<f64>, force_m_s2: &Vector3<f64>, tick_s: f64) {
        let turn_rad = (self.rate_rad_s + rate_rad_s) * (0.5 * tick_s);
        let [midway, after] = self.attitude.halfway_and_by(&turn_rad);
        let acceleration = midway.matrix() * force_m_s2 - Vector3::z() * GRAVITY_M_S2;
        self.position_m += (self.velocity_m_s + acceleration * (0.5 * tick_s)) * tick_s;
        self.velocity_m_s += acceleration * tick_s;
        self.attitude = after;
        self.rate_rad_s = *rate_rad_s;
        self.span_s += tick_s;
        self.turn_rad += turn_rad;
    }

    fn carry_covariance(&mut self, force_m_s2: &Vector3<f64>) {
        let lever = -self.world_from_body * force_m_s2.cross_matrix();
        let Trust { acceleration, rate, .. } = self.trust;
        self.covariance.carry(self.span_s, &lever, &self.turn_rad, acceleration, rate);
        if let Some(floor) = &mut self.floor {
            floor.carry(self.span_s, &lever, &self.turn_rad);
        }
        self.span_s = 0.0;
        self.turn_rad = Vector3::zeros();
    }

    fn correct(&mut self, slope: Slope, innovation: f64, variance: f64) {
        let (gate_sq, errors) = (self.trust.gate_sq, &mut self.errors);
        if let Some(floor) = &mut self.floor {
            let measured = Measured { slope, per_floor_m: 0.0, innovation, variance };
            floor.correct(&mut self.covariance, errors, &measured, gate_sq);
        } else {
            self.covariance.correct(errors, &slope, innovation, variance, gate_sq);
        }
    }

    fn correct_sweep(&mut self, sweep: &Sweep) {
        let variance = self.trust.sweep[usize::from(self.is_v2[sweep.station])];
        for (lever, angle_rad) in DECK_SENSORS_M.map(Vector3::from).iter().zip(sweep.angles_rad) {
            let place_m = self.position_m + self.world_from_body * lever;
            let crossing = self.stations[sweep.station].crossing(sweep.plane, &place_m);
            let position = crossing.slope_rad_m;
            let turn = lever.cross(&self.world_from_body.tr_mul(&position));
            let innovation = angle_rad - crossing.angle_rad;
            self.correct(Slope { position, turn }, innovation, variance);
        }
    }

    fn correct_range(&mut self, range: &Range) {
        let away = |anchor: usize| self.position_m - self.anchors_m[anchor];
        let mut position = away(range.anchor);
        let mut expected_m = position.norm();
        position /= expected_m.max(f64::MIN_POSITIVE);
        if let Some(other) = range.minus {
            let (away, distance_m) = (away(other), away(other).norm());
            expected_m -= distance_m;
            position -= away / distance_m.max(f64::MIN_POSITIVE);
        }
        let turn = Vector3::zeros();
        let variance = self.trust.range[usize::from(range.minus.is_none())];
        self.correct(Slope { position, turn }, range.distance_m - expected_m, variance);
    }

    fn correct_position(&mut self, position_m: &Vector3<f64>) {
        for axis in 0..3 {
            let mut position = Vector3::zeros();
            position[axis] = 1.0;
            let innovation = position_m[axis] - self.position_m[axis];
            let turn = Vector3::zeros();
            self.correct(Slope { position, turn }, innovation, self.trust.position);
        }
    }

    fn correct_distance(&mut self, distance_m: f64) {
        let r = &self.world_from_body;
        let cos_tilt = r[(2, 2)];
        if cos_tilt < LEAST_COS_TILT {
            return;
        }
        let floor_m = self.floor.as_ref().map_or(0.0, |floor| floor.height_m);
        let expected_m = (self.position_m.z - floor_m) / cos_tilt;
        let position = Vector3::z() / cos_tilt;
        let turn = Vector3::new(r[(2, 1)], -r[(2, 0)], 0.0) * (expected_m / cos_tilt);
        let sigma_m = time_of_flight_sigma_m(self.trust.ranger_m, distance_m);
        let (slope, innovation) = (Slope { position, turn }, distance_m - expected_m);
        let variance = sigma_m * sigma_m;
        if let Some(floor) = &mut self.floor {
            let measured = Measured { slope, per_floor_m: -1.0 / cos_tilt, innovation, variance };
            let gate_sq = self.trust.gate_sq;
            floor.correct_range(&mut self.covariance, &mut self.errors, &measured, gate_sq);
        } else {
            self.correct(slope, innovation, variance);
        }
    }

    fn correct_height(&mut self, height_m: f64) {
        let slope = Slope { position: Vector3::z(), turn: Vector3::zeros() };
        self.correct(slope, height_m - self.position_m.z, self.trust.barometer);
    }

    /// All twelve states, at a velocity in the world.
    pub(super) fn state_at(&self, velocity_m_s: &Vector3<f64>) -> State {
        let (p, w) = (&self.position_m, &self.rate_rad_s);
        let world_from_body = self.attitude.matrix();
        let a = angles(&world_from_body);
        let v = world_from_body.tr_mul(velocity_m_s);
        let turn = [a.yaw_rad, a.pitch_rad, a.roll_rad];
        State::from([p.x, p.y, p.z, turn[0], turn[1], turn[2], v.x, v.y, v.z, w.x, w.y, w.z])
    }

    /// Applies the corrections of this tick's measurements to the state.
    fn settle(&mut self) {
        let errors = std::mem::take(&mut self.errors);
        self.position_m += errors.position_m;
        self.velocity_m_s += errors.velocity_m_s;
        self.attitude = self.attitude.by(&errors.turn_rad);
        if let Some(floor) = &mut self.floor {
            floor.settle();
        }
    }
}

impl Estimator for Ekf {
    fn update(&mut self, readings: &Readings<'_>, tick_s: f64) {
        let force_m_s2 = &readings.specific_force_m_s2;
        self.predict(&readings.rate_rad_s, force_m_s2, tick_s);
        let measured = !readings.sweeps.is_empty()
            || !readings.ranges.is_empty()
            || readings.position_m.is_some()
            || readings.time_of_flight_m.is_some()
            || readings.barometer_m.is_some();
        if !measured && self.span_s < LONGEST_SPAN_S {
            return;
        }
        self.world_from_body = self.attitude.matrix();
        self.carry_covariance(force_m_s2);
        if !measured {
            return;
        }
        readings.sweeps.iter().for_each(|sweep| self.correct_sweep(sweep));
        readings.ranges.iter().for_each(|range| self.correct_range(range));
        readings.position_m.iter().for_each(|position_m| self.correct_position(position_m));
        readings.time_of_flight_m.iter().for_each(|distance_m| self.correct_distance(*distance_m));
        readings.barometer_m.iter().for_each(|height_m| self.correct_height(*height_m));
        self.settle();
    }

    fn state(&self) -> State {
        self.state_at(&self.velocity_m_s)
    }
}
