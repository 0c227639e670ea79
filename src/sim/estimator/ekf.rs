//! Improved estimator, an error-state extended Kalman filter that uses sweep angles, positions,
//! ranges and heights. [`Firmware`](super::firmware::Firmware) models the drone's own estimator.
//!
//! Gyroscope and accelerometer advance the motion on all three axes at every tick ([`Inertial`]).
//! The covariance of the motion's errors is propagated at each measurement, and otherwise 100 times
//! per second. All measurements of a tick are compared with the state predicted for it, one scalar
//! after the other, with their Jacobians with respect to position and rotation. Sweeps pass through
//! the firmware's [`SweepFilter`], and all other measurements through a χ² gate.
//!
//! Source: J. Solà, "Quaternion kinematics for the error-state Kalman filter", arXiv 1711.02508.
//!
//! Biases of the inertial sensors, of ranges and of air pressure, and errors in the stations'
//! geometry, are not estimated.

use nalgebra::{Matrix3, Vector3};

use super::sweep_filter::SweepFilter;
use super::{Estimator, state_at};
use crate::kalman::{
    Density, Inertial, Measurement, Normal, Part, StepTest, TURN, toward, variance_rate,
};
use crate::options::EkfOptions;
use crate::sensors::{
    DECK_SENSORS_M, Generation, Range, Readings, SensorOptions, StationPose, Sweep, Target,
};
use crate::vehicle::State;

/// Initial σ of position (m), velocity (m/s) and attitude (rad), for a drone placed on its mark.
pub(super) const START: [f64; 3] = [0.02, 0.01, 0.02];
/// Cosine of the tilt below which a distance to the floor is not used.
const LEAST_COS_TILT: f64 = 0.3;

/// Index of the floor's height below the drone, after the nine errors. With this state and the step
/// test, the edge of a table changes the estimated floor, not the drone's height.
const FLOOR: usize = 9;
/// Standard deviation of the floor's height on the ground in m, and its random walk in m/√s.
const FLOOR_START_M: f64 = 0.005;
const FLOOR_WALK_M_SQRT_S: f64 = 0.003;
/// Gate of the step test in standard deviations, smallest step in m, and standard deviation that a
/// step adds in m.
const STEP_GATE_SIGMAS: f64 = 4.0;
const LEAST_STEP_M: f64 = 0.05;
const STEP_M: f64 = 0.5;

#[derive(Debug)]
pub(super) struct Ekf {
    pub(super) motion: Inertial,
    /// Nine errors and, if the floor may have steps, its height.
    pub(super) normal: Normal,
    pub(super) model: Model,
    step_test: Option<StepTest>,
    sweep_filter: SweepFilter,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Source {
    /// Sweep of a light plane that hits a sensor at a distance from the rotor's axis.
    Sweep {
        radius_m: f64,
    },
    Position,
    /// Range or height, with its target.
    To(Target),
}

/// Geometry and noise of the sensors that the filter assumes.
#[derive(Debug)]
pub(super) struct Model {
    pub(super) stations: Vec<StationPose>,
    pub(super) anchors_m: Vec<Vector3<f64>>,
    /// Height of the floor below the drone in m.
    floor_m: f64,
    /// True if the floor's height is a state.
    floor_steps: bool,
    pub(super) density: Density,
    /// Variance of a station's angle in rad², for the first and the second generation.
    sweep: [f64; 2],
    /// Variance of a measured coordinate in m².
    pub(super) position: f64,
    /// Variances of a difference of ranges, and of two-way ranging, in m².
    pub(super) range: [f64; 2],
    pub(super) gate_sigmas: f64,
    /// Options of the sensors, with the height sensors' noise as the filter assumes it.
    pub(super) sensors: SensorOptions,
}

impl Ekf {
    /// Creates a filter for a drone that starts level and at rest. `yaw_rad` is the heading from
    /// world x toward y.
    pub(super) fn new(
        options: &EkfOptions,
        sensors: &SensorOptions,
        position_m: Vector3<f64>,
        yaw_rad: f64,
    ) -> Self {
        // The floor's height is a state only if the floor may have steps.
        let floor: &[f64] = if options.floor_steps { &[FLOOR_START_M] } else { &[] };
        let step_test = StepTest::new(STEP_GATE_SIGMAS, LEAST_STEP_M, STEP_M);
        Self {
            motion: Inertial::level_at(position_m, yaw_rad),
            normal: Normal::of_drones(1, START, floor),
            model: Model::new(options, sensors),
            step_test: options.floor_steps.then_some(step_test),
            sweep_filter: SweepFilter::default(),
        }
    }

    /// Creates a filter for the errors of a fleet, beginning with this drone, above a level floor.
    pub(super) fn of_fleet(
        options: &EkfOptions,
        sensors: &SensorOptions,
        position_m: Vector3<f64>,
        yaw_rad: f64,
        normal: Normal,
    ) -> Self {
        let options = EkfOptions { floor_steps: false, ..options.clone() };
        Self { normal, ..Self::new(&options, sensors, position_m, yaw_rad) }
    }

    /// Advances the state by a tick, and calls `correct` with the source of each measurement and
    /// the measurement. Returns the acceleration in the world frame in m/s².
    #[inline(always)]
    pub(super) fn advance(
        &mut self,
        readings: &Readings<'_>,
        tick_s: f64,
        mut correct: impl FnMut(&mut Normal, Source, &Measurement<'_>),
    ) -> Vector3<f64> {
        let force_m_s2 = &readings.specific_force_m_s2;
        let acceleration = self.motion.predict(&readings.rate_rad_s, force_m_s2, tick_s);
        let measured = readings.measures_position();
        if self.motion.is_due(measured) {
            self.carry(force_m_s2);
        }
        // The mean errors accumulate all corrections of a tick before they are added to the state.
        if measured {
            let Self { motion, normal, model, .. } = self;
            model.measurements(motion, readings, |source, jacobian, value, variance| {
                correct(normal, source, &Measurement { jacobian, value, variance });
            });
            motion.settle(normal, 0);
            if model.floor_steps {
                model.floor_m += std::mem::take(&mut normal.mean[FLOOR]);
            }
        }
        acceleration
    }

    /// Propagates the covariance from the last propagation to the present. `force_m_s2` is the
    /// present specific force in the body frame.
    pub(super) fn carry(&mut self, force_m_s2: &Vector3<f64>) {
        let span = self.motion.span(force_m_s2);
        self.normal.carry(0, &span, &self.model.density);
        if self.model.floor_steps {
            let walk = FLOOR_WALK_M_SQRT_S * FLOOR_WALK_M_SQRT_S * span.span_s;
            self.normal.covariance[(FLOOR, FLOOR)] += walk;
        }
    }
}

impl Estimator for Ekf {
    /// Advances the state by a tick. Sweeps pass through the sweep filter, ranges to the floor
    /// through the step test, and all other measurements through the χ² gate.
    fn update(&mut self, readings: &Readings<'_>, tick_s: f64) {
        let gate_sq = self.model.gate_sigmas * self.model.gate_sigmas;
        let (mut step_test, mut sweeps) = (self.step_test.take(), self.sweep_filter);
        sweeps.wait(tick_s);
        self.advance(readings, tick_s, |normal, source, measurement| {
            match (source, &mut step_test) {
                (Source::Sweep { radius_m }, _) => {
                    normal.correct(measurement, |error| sweeps.accepts(radius_m * error.value));
                }
                (Source::To(Target::Height(sensor)), Some(test)) if sensor.looks_down() => {
                    test.correct(normal, measurement, gate_sq);
                }
                _ => {
                    normal.correct(measurement, |error| !error.is_beyond(gate_sq));
                }
            }
        });
        (self.step_test, self.sweep_filter) = (step_test, sweeps);
    }

    fn state(&self) -> State {
        state_at(&self.motion, &self.motion.velocity_m_s)
    }

    fn covariance_m2(&self) -> Option<Matrix3<f64>> {
        Some(self.normal.block(0, 0))
    }
}

impl Model {
    /// Creates the model of the sensors that the filter assumes. Standard deviations of the options
    /// become variances.
    pub(super) fn new(options: &EkfOptions, sensors: &SensorOptions) -> Self {
        let level = options.acceleration_noise_m_s2_sqrt_hz;
        let upright = options.acceleration_noise_z_m_s2_sqrt_hz;
        let mut believed = sensors.clone();
        // The filter assumes more noise than the sensor has, because the sensor drifts.
        believed.barometer.noise_m = options.barometer_sigma_m;
        Self {
            stations: sensors.lighthouse.stations.iter().map(StationPose::new).collect(),
            anchors_m: sensors.uwb.anchors(),
            floor_m: 0.0,
            floor_steps: options.floor_steps,
            density: Density {
                acceleration: [level, level, upright].map(variance_rate),
                rate: variance_rate(options.rate_noise_rad_s_sqrt_hz),
            },
            sweep: [options.sweep_v1_sigma_rad, options.sweep_sigma_rad].map(|rad| rad * rad),
            position: options.position_sigma_m * options.position_sigma_m,
            range: [options.range_sigma_m, options.two_way_sigma_m].map(|m| m * m),
            gate_sigmas: options.gate_sigmas,
            sensors: believed,
        }
    }

    /// Returns the variance of a sweep angle of a station.
    pub(super) fn sweep_variance(&self, station: usize) -> f64 {
        self.sweep[usize::from(self.stations[station].generation == Generation::V2)]
    }

    /// Returns the Jacobian of the angle at which a sweep hits a sensor of the deck, with respect
    /// to position and rotation, the error (measured minus expected) in rad, and the distance in m
    /// of the sensor from the rotor's axis. `lever` is the sensor's position in the body frame in
    /// m.
    #[inline(always)]
    pub(super) fn angle(
        &self,
        (station, plane): (usize, usize),
        (lever, angle_rad): (&Vector3<f64>, f64),
        position_m: &Vector3<f64>,
        world_from_body: &Matrix3<f64>,
    ) -> ([Part; 2], f64, f64) {
        let crossing =
            self.stations[station].crossing(plane, &(position_m + world_from_body * lever));
        // A rotation θ of the body moves the sensor by R (θ × lever). The gradient is lever × Rᵀ g.
        let position = crossing.gradient_rad_m;
        let turn = lever.cross(&world_from_body.tr_mul(&position));
        let jacobian = [Part::Three(0, position), Part::Three(TURN, turn)];
        (jacobian, angle_rad - crossing.angle_rad, crossing.radius_m)
    }

    /// Returns the Jacobian with respect to the position, the error (measured minus expected) in m,
    /// and the variance in m² of a range or difference of ranges, for a drone at `position_m`.
    pub(super) fn range(&self, range: &Range, position_m: &Vector3<f64>) -> (Part, f64, f64) {
        let from_anchor = |anchor: usize| toward(&(position_m - self.anchors_m[anchor]));
        let (mut direction, mut expected_m) = from_anchor(range.anchor);
        if let Some(other) = range.minus {
            let (unit, distance_m) = from_anchor(other);
            expected_m -= distance_m;
            direction -= unit;
        }
        let variance = self.range[usize::from(range.minus.is_none())];
        (Part::Three(0, direction), range.distance_m - expected_m, variance)
    }

    /// Calls `each` with source, Jacobian, error (measured minus expected) and variance of every
    /// measurement of a tick, for the first drone of a filter. Angles are in rad, and the rest is
    /// in m.
    #[inline(always)]
    fn measurements(
        &self,
        motion: &Inertial,
        readings: &Readings<'_>,
        mut each: impl FnMut(Source, &[Part], f64, f64),
    ) {
        let Inertial { position_m, world_from_body, .. } = motion;
        for Sweep { station, plane, angles_rad } in readings.sweeps {
            let variance = self.sweep_variance(*station);
            for sensor in DECK_SENSORS_M.map(Vector3::from).iter().zip(*angles_rad) {
                let (jacobian, value, radius_m) =
                    self.angle((*station, *plane), sensor, position_m, world_from_body);
                each(Source::Sweep { radius_m }, &jacobian, value, variance);
            }
        }
        for range in readings.ranges {
            let (jacobian, value, variance) = self.range(range, position_m);
            each(Source::To(Target::Anchor(range.anchor)), &[jacobian], value, variance);
        }
        if let Some(measured_m) = readings.position_m {
            let error_m = measured_m - position_m;
            for axis in 0..3 {
                each(Source::Position, &[Part::One(axis, 1.0)], error_m[axis], self.position);
            }
        }
        self.height_measurements(motion, readings, each);
    }

    /// Calls `each` with every height of a tick, as [`Self::measurements`] does. Ranges at a tilt
    /// beyond [`LEAST_COS_TILT`] are left out.
    #[inline(always)]
    fn height_measurements(
        &self,
        Inertial { position_m, world_from_body, .. }: &Inertial,
        readings: &Readings<'_>,
        mut each: impl FnMut(Source, &[Part], f64, f64),
    ) {
        let cos_tilt = world_from_body[(2, 2)];
        for &(sensor, measured_m) in readings.heights {
            let source = Source::To(Target::Height(sensor));
            let sigma_m = self.sensors.height_sigma_m(sensor, measured_m);
            let variance = sigma_m * sigma_m;
            if !sensor.looks_down() {
                each(source, &[Part::One(2, 1.0)], measured_m - position_m.z, variance);
            } else if cos_tilt >= LEAST_COS_TILT {
                // The expected distance is d = (z − floor) / cos tilt. A rotation changes the
                // cosine by the other two entries in its row. The part of the floor is last,
                // because it is left out if the floor has no steps.
                let expected_m = (position_m.z - self.floor_m) / cos_tilt;
                let [x, y] = [0, 1].map(|axis| world_from_body[(2, axis)]);
                let turn = Vector3::new(y, -x, 0.0) * (expected_m / cos_tilt);
                let per_m = 1.0 / cos_tilt;
                let jacobian =
                    [Part::One(2, per_m), Part::Three(TURN, turn), Part::One(FLOOR, -per_m)];
                let jacobian = &jacobian[..if self.floor_steps { 3 } else { 2 }];
                each(source, jacobian, measured_m - expected_m, variance);
            }
        }
    }
}
