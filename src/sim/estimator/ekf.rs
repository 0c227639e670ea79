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
//! stations' geometry.

use nalgebra::{Matrix3, Vector3};

use super::Estimator;
use super::attitude::{Turned, angles};
use super::covariance::{Covariance, Errors, Residual, Slope};
use super::floor::FloorBelow;
use crate::sim::options::{EkfOptions, Generation, SensorOptions};
use crate::sim::peers::Target;
use crate::sim::sensors::{
    DECK_SENSORS_M, Range, Readings, StationPose, Sweep, time_of_flight_sigma_m,
};
use crate::sim::vehicle::{GRAVITY_M_S2, State};

/// Initial σ of position (m), velocity (m/s) and attitude (rad), for a drone put on its mark.
pub(super) const START: [f64; 3] = [0.02, 0.01, 0.02];
/// The covariance is carried at least this often.
const LONGEST_SPAN_S: f64 = 0.01;
/// Cosine of the tilt beyond which the ranger's distance says nothing about the height.
const LEAST_COS_TILT: f64 = 0.3;

/// The filter.
#[derive(Debug)]
pub(super) struct Ekf {
    pub(super) motion: Motion,
    pub(super) covariance: Covariance,
    /// Corrections by the measurements of this tick.
    errors: Errors,
    /// The floor below the drone, where it may have steps.
    floor: Option<FloorBelow>,
}

/// The mean of the estimate, and what is known of the sensors: all but the covariance.
#[derive(Debug)]
pub(super) struct Motion {
    pub(super) position_m: Vector3<f64>,
    pub(super) velocity_m_s: Vector3<f64>,
    pub(super) attitude: Turned,
    /// The attitude as a matrix, since the covariance was carried last.
    pub(super) world_from_body: Matrix3<f64>,
    rate_rad_s: Vector3<f64>,
    /// Since the covariance was carried last.
    span_s: f64,
    turn_rad: Vector3<f64>,
    stations: Vec<StationPose>,
    /// Whether each station is of the second generation.
    is_v2: Vec<bool>,
    pub(super) anchors_m: Vec<Vector3<f64>>,
    /// Height of the floor below the drone.
    floor_m: f64,
    pub(super) trust: Trust,
}

/// Spectral densities (two-sided), variances and the gate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trust {
    /// Along world x, y, z.
    pub(super) acceleration: [f64; 3],
    pub(super) rate: f64,
    /// Of a station of the first and of the second generation.
    sweep: [f64; 2],
    position: f64,
    /// Of a difference, and of two-way ranging.
    pub(super) range: [f64; 2],
    pub(super) barometer: f64,
    pub(super) gate_sq: f64,
    /// Standard deviation of a near range to the floor.
    pub(super) ranger_m: f64,
}

/// A span over which the covariance is carried.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub(super) span_s: f64,
    /// `−R [f]×`.
    pub(super) lever: Matrix3<f64>,
    pub(super) turn_rad: Vector3<f64>,
}

impl Ekf {
    /// A filter that believes in a level drone at rest at `position_m`.
    pub(super) fn new(
        options: &EkfOptions,
        sensors: &SensorOptions,
        position_m: Vector3<f64>,
    ) -> Self {
        Self {
            motion: Motion::new(options, sensors, position_m),
            covariance: Covariance::new(START[0], START[1], START[2]),
            errors: Errors::default(),
            floor: options.floor_steps.then(FloorBelow::new),
        }
    }
}

impl Motion {
    /// A level drone at rest at `position_m`.
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
            span_s: 0.0,
            turn_rad: Vector3::zeros(),
            stations: sensors.lighthouse.stations.iter().map(StationPose::new).collect(),
            is_v2: sensors
                .lighthouse
                .stations
                .iter()
                .map(|s| s.generation == Generation::V2)
                .collect(),
            anchors_m: sensors.uwb.anchors(),
            floor_m: 0.0,
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
    /// force along it; returns the acceleration.
    pub(super) fn predict(
        &mut self,
        rate_rad_s: &Vector3<f64>,
        force_m_s2: &Vector3<f64>,
        tick_s: f64,
    ) -> Vector3<f64> {
        let turn_rad = (self.rate_rad_s + rate_rad_s) * (0.5 * tick_s);
        let [midway, after] = self.attitude.halfway_and_by(&turn_rad);
        let acceleration = midway.matrix() * force_m_s2 - Vector3::z() * GRAVITY_M_S2;
        self.position_m += (self.velocity_m_s + acceleration * (0.5 * tick_s)) * tick_s;
        self.velocity_m_s += acceleration * tick_s;
        self.attitude = after;
        self.rate_rad_s = *rate_rad_s;
        self.span_s += tick_s;
        self.turn_rad += turn_rad;
        acceleration
    }

    /// Whether the covariance is to be carried now: for a measurement, or after a while without.
    pub(super) fn is_due(&self, measured: bool) -> bool {
        measured || self.span_s >= LONGEST_SPAN_S
    }

    /// The span since the covariance was carried last; the next one begins.
    pub(super) fn span(&mut self, force_m_s2: &Vector3<f64>) -> Span {
        self.world_from_body = self.attitude.matrix();
        Span {
            span_s: std::mem::take(&mut self.span_s),
            lever: -self.world_from_body * force_m_s2.cross_matrix(),
            turn_rad: std::mem::take(&mut self.turn_rad),
        }
    }

    /// Passes every measurement on, with what it was measured to where that is one thing.
    #[inline(always)]
    pub(super) fn residuals(
        &self,
        readings: &Readings<'_>,
        mut each: impl FnMut(Residual, Option<Target>),
    ) {
        let mut other = |residual| each(residual, None);
        readings.sweeps.iter().for_each(|sweep| self.sweep(sweep, &mut other));
        for range in readings.ranges {
            each(self.range(range), Some(Target::Anchor(range.anchor)));
        }
        let mut other = |residual| each(residual, None);
        readings.position_m.iter().for_each(|position_m| self.position(position_m, &mut other));
        let floor = readings.time_of_flight_m.and_then(|distance_m| self.distance(distance_m));
        floor.into_iter().for_each(|residual| each(residual, Some(Target::Floor)));
        let air = readings.barometer_m.map(|height_m| self.height(height_m));
        air.into_iter().for_each(|residual| each(residual, Some(Target::Air)));
    }

    fn sweep(&self, sweep: &Sweep, each: &mut impl FnMut(Residual)) {
        let variance = self.trust.sweep[usize::from(self.is_v2[sweep.station])];
        for (lever, angle_rad) in DECK_SENSORS_M.map(Vector3::from).iter().zip(sweep.angles_rad) {
            let place_m = self.position_m + self.world_from_body * lever;
            let crossing = self.stations[sweep.station].crossing(sweep.plane, &place_m);
            let position = crossing.slope_rad_m;
            let turn = lever.cross(&self.world_from_body.tr_mul(&position));
            let innovation = angle_rad - crossing.angle_rad;
            each(Residual { slope: Slope { position, turn }, innovation, variance });
        }
    }

    pub(super) fn range(&self, range: &Range) -> Residual {
        let away = |anchor: usize| self.position_m - self.anchors_m[anchor];
        let mut position = away(range.anchor);
        let mut expected_m = position.norm();
        position /= expected_m.max(f64::MIN_POSITIVE);
        if let Some(other) = range.minus {
            let (away, distance_m) = (away(other), away(other).norm());
            expected_m -= distance_m;
            position -= away / distance_m.max(f64::MIN_POSITIVE);
        }
        let slope = Slope { position, turn: Vector3::zeros() };
        let variance = self.trust.range[usize::from(range.minus.is_none())];
        Residual { slope, innovation: range.distance_m - expected_m, variance }
    }

    fn position(&self, position_m: &Vector3<f64>, each: &mut impl FnMut(Residual)) {
        for axis in 0..3 {
            let mut position = Vector3::zeros();
            position[axis] = 1.0;
            let innovation = position_m[axis] - self.position_m[axis];
            let slope = Slope { position, turn: Vector3::zeros() };
            each(Residual { slope, innovation, variance: self.trust.position });
        }
    }

    fn distance(&self, distance_m: f64) -> Option<Residual> {
        let r = &self.world_from_body;
        let cos_tilt = r[(2, 2)];
        if cos_tilt < LEAST_COS_TILT {
            return None;
        }
        let expected_m = (self.position_m.z - self.floor_m) / cos_tilt;
        let position = Vector3::z() / cos_tilt;
        let turn = Vector3::new(r[(2, 1)], -r[(2, 0)], 0.0) * (expected_m / cos_tilt);
        let sigma_m = time_of_flight_sigma_m(self.trust.ranger_m, distance_m);
        Some(Residual {
            slope: Slope { position, turn },
            innovation: distance_m - expected_m,
            variance: sigma_m * sigma_m,
        })
    }

    fn height(&self, height_m: f64) -> Residual {
        let slope = Slope { position: Vector3::z(), turn: Vector3::zeros() };
        Residual { slope, innovation: height_m - self.position_m.z, variance: self.trust.barometer }
    }

    /// Corrects the state.
    pub(super) fn settle(&mut self, errors: &Errors) {
        self.position_m += errors.position_m;
        self.velocity_m_s += errors.velocity_m_s;
        self.attitude = self.attitude.by(&errors.turn_rad);
    }

    /// All twelve states.
    pub(super) fn state(&self) -> State {
        self.state_at(&self.velocity_m_s)
    }

    /// All twelve states, at another velocity in the world.
    pub(super) fn state_at(&self, velocity_m_s: &Vector3<f64>) -> State {
        let (p, w) = (&self.position_m, &self.rate_rad_s);
        let world_from_body = self.attitude.matrix();
        let a = angles(&world_from_body);
        let v = world_from_body.tr_mul(velocity_m_s);
        let turn = [a.yaw_rad, a.pitch_rad, a.roll_rad];
        State::from([p.x, p.y, p.z, turn[0], turn[1], turn[2], v.x, v.y, v.z, w.x, w.y, w.z])
    }
}

impl Estimator for Ekf {
    fn update(&mut self, readings: &Readings<'_>, tick_s: f64) {
        let Self { motion, covariance, errors, floor } = self;
        let force_m_s2 = &readings.specific_force_m_s2;
        motion.predict(&readings.rate_rad_s, force_m_s2, tick_s);
        let measured = readings.measures_place();
        if !motion.is_due(measured) {
            return;
        }
        let Span { span_s, lever, turn_rad } = motion.span(force_m_s2);
        let Trust { acceleration, rate, gate_sq, .. } = motion.trust;
        covariance.carry(span_s, &lever, &turn_rad, acceleration, rate);
        if let Some(floor) = floor {
            floor.carry(span_s, &lever, &turn_rad);
        }
        if !measured {
            return;
        }
        if let Some(floor) = floor {
            motion.residuals(readings, |residual, to| {
                let to_floor = to == Some(Target::Floor);
                floor.correct(covariance, errors, &residual, to_floor, gate_sq);
            });
            motion.floor_m = floor.settled_m();
        } else {
            motion.residuals(readings, |Residual { slope, innovation, variance }, _| {
                covariance.correct(errors, &slope, innovation, variance, gate_sq);
            });
        }
        motion.settle(&std::mem::take(errors));
    }

    fn state(&self) -> State {
        self.motion.state()
    }
}
