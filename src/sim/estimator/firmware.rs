//! Kalman filter of the Crazyflie's firmware, in double precision.
//!
//! The states are the position in the world, the velocity in the body frame, and an attitude with
//! its small error. These states are predicted 100 times per second from the mean of the inertial
//! readings since the last prediction. In flight, the filter assumes force only along the body's z
//! axis. Each scalar measurement corrects the state immediately, and is linearized at the state
//! that the previous one corrected. Corrections of the attitude are applied at the end of the tick.
//! [`FirmwareOptions`] enables or disables these differences from a textbook filter.
//!
//! Sources: M. W. Mueller, M. Hamer, R. D'Andrea, "Fusing ultra-wideband range measurements with
//! accelerometers and rate gyroscopes for quadrocopter state estimation", ICRA 2015. M. W. Mueller,
//! M. Hehn, R. D'Andrea, "Covariance correction step for Kalman filtering with an attitude",
//! Journal of Guidance, Control, and Dynamics 40(9), 2017. bitcraze/crazyflie-firmware 2026.08:
//! `kalman_core.c`, `mm_*.c`, `estimator_kalman.c`, `lighthouse_position_est.c`. Tests compare the
//! filter with its compiled C code (tests/firmware).
//!
//! Not modeled are single precision, the leveling of the attitude on the floor without a Lighthouse
//! deck, the reset of a state beyond 100 m or 10 m/s, and the initial σ of 100 m, which decreases
//! while a drone waits on the floor.

use nalgebra::{Matrix3, Vector3};

use super::Estimator;
use super::deck::{Deck, Rotation};
use super::ekf::{Model, START};
use super::sweep_filter::SweepFilter;
use super::tdoa_filter::TdoaFilter;
use crate::kalman::{Measurement, Normal, Part, TURN, Turned, VELOCITY, angles};
use crate::options::{FirmwareOptions, HorizontalForce, ObserverOptions, SweepAttitude};
use crate::sensors::{DECK_SENSORS_M, Range, Readings, SensorOptions};
use crate::vehicle::{State, state};
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::random::Noise;

/// Tolerance in s for comparisons of times.
const TIME_TOLERANCE_S: f64 = 1e-9;
/// Time in s after the motors were last driven during which the drone counts as flying
/// (`supervisor.c`).
const FLYING_S: f64 = 2.0;
/// Maximum variance of a state (`MAX_COVARIANCE`, `kalman_core.c`).
const LARGEST_VARIANCE: f64 = 100.0;
/// Attitude error in rad below which, if it is so small on every axis, it is dropped after a tick.
const LEAST_TURN_RAD: f64 = 0.1e-3;
/// Standard deviation of a yaw error in rad (`lighthouse_position_est.c`).
const YAW_SIGMA_RAD: f64 = 0.01;
/// Minimum apparent length in m of a deck diagonal for which the yaw is computed.
const LEAST_DIAGONAL_M: f64 = 1e-4;
/// Minimum cosine of the tilt at which a range to the floor is used (`mm_tof.c`).
const LEAST_COS_TILT: f64 = 0.1;
/// Full angle in rad of the ranger's cone, in which it measures the nearest point (`mm_tof.c`).
const RANGER_CONE_RAD: f64 = 0.261_799_387_8;

#[derive(Debug)]
pub(super) struct Firmware {
    options: FirmwareOptions,
    model: Model,
    position_m: Vector3<f64>,
    /// Velocity in the body frame in m/s.
    velocity_m_s: Vector3<f64>,
    attitude: Turned,
    /// Attitude at the end of the last tick, which is used throughout the present tick.
    world_from_body: Matrix3<f64>,
    /// Attitude error in rad since the end of the last tick.
    turn_rad: Vector3<f64>,
    /// Errors of position, velocity and attitude, whose mean is added to the state immediately.
    pub(super) normal: Normal,
    rate_rad_s: Vector3<f64>,
    /// Sums of the rates and forces since the last prediction, their number, and their last means.
    sums: [Vector3<f64>; 2],
    n_summed: f64,
    means: [Vector3<f64>; 2],
    deck: Deck,
    sweep_filter: SweepFilter,
    tdoa_filter: TdoaFilter,
    time_s: f64,
    predicted_s: f64,
    /// Time in s at which the motors were last driven.
    driven_s: f64,
    begun: bool,
}

impl Firmware {
    /// Creates a filter for a drone that starts level and at rest. `noise` determines which
    /// rotations are dropped.
    pub(super) fn new(
        observer: &ObserverOptions,
        sensors: &SensorOptions,
        position_m: Vector3<f64>,
        yaw_rad: f64,
        noise: Noise,
    ) -> Self {
        let (options, attitude) = (observer.firmware.clone(), Turned::facing(yaw_rad));
        Self {
            deck: Deck::new(&options, sensors, noise),
            options,
            model: Model::new(&observer.ekf, sensors),
            position_m,
            velocity_m_s: Vector3::zeros(),
            attitude,
            world_from_body: attitude.matrix(),
            turn_rad: Vector3::zeros(),
            normal: Normal::of_drones(1, START, &[]),
            rate_rad_s: Vector3::zeros(),
            sums: Default::default(),
            n_summed: 0.0,
            means: Default::default(),
            sweep_filter: SweepFilter::default(),
            tdoa_filter: TdoaFilter::default(),
            time_s: 0.0,
            predicted_s: 0.0,
            driven_s: f64::NEG_INFINITY,
            begun: false,
        }
    }

    /// Advances the state and its covariance over a span, with the span's mean inertial readings.
    fn predict(&mut self, span_s: f64) {
        let (sums, n) = (std::mem::take(&mut self.sums), std::mem::take(&mut self.n_summed));
        if n > 0.0 {
            self.means = sums.map(|sum| sum / n);
        }
        let [rate, mut force] = self.means;
        let is_flying = self.time_s - self.driven_s < FLYING_S;
        if is_flying && self.options.horizontal_force == HorizontalForce::Zero {
            (force.x, force.y) = (0.0, 0.0);
        }
        let (r, v) = (self.world_from_body, self.velocity_m_s);
        let up = r.row(2).transpose();

        // The covariance is advanced first, with the old state. With ṗ = R v and v̇ = f − ω × v − g
        // Rᵀ e_z, a rotation θ of the attitude changes R v by −R [v]× θ and the acceleration by −g
        // [up]× θ.
        let drift = Drift {
            position: [r * span_s, -r * v.cross_matrix() * span_s],
            velocity: [
                Matrix3::identity() - rate.cross_matrix() * span_s,
                up.cross_matrix() * (-GRAVITY_M_S2 * span_s),
            ],
        };
        self.transform(Some(&drift), &turned_back(&(rate * span_s)));

        // The state is advanced next, with constant force and rate over the span.
        let fall_m = Vector3::z() * (0.5 * GRAVITY_M_S2 * span_s * span_s);
        self.position_m += r * (v * span_s + force * (0.5 * span_s * span_s)) - fall_m;
        self.velocity_m_s += (force - rate.cross(&v) - up * GRAVITY_M_S2) * span_s;
        self.attitude = self.attitude.by(&(rate * span_s));
        self.predicted_s = self.time_s;
    }

    /// Adds the process noise of a tick to the variances of velocity and rotation.
    fn add_noise(&mut self, tick_s: f64) {
        let density = &self.model.density;
        for axis in 0..3 {
            let p = &mut self.normal.covariance;
            p[(VELOCITY + axis, VELOCITY + axis)] += density.acceleration[axis] * tick_s;
            p[(TURN + axis, TURN + axis)] += density.rate * tick_s;
        }
        self.bound();
    }

    /// Corrects the state with the angles of a rotation at each of the deck's sensors.
    fn correct_by_sweeps(&mut self, rotation: &Rotation) {
        // If the attitude is not corrected, the Jacobian with respect to the rotation is left out.
        let n_parts = if self.options.sweep_attitude == SweepAttitude::Slope { 2 } else { 1 };
        let variance = self.model.sweep_variance(rotation.station);
        for (k, lever) in DECK_SENSORS_M.map(Vector3::from).iter().enumerate() {
            for &(plane, angles_rad) in &rotation.planes {
                let (jacobian, error_rad, radius_m) = self.model.angle(
                    (rotation.station, plane),
                    (lever, angles_rad[k]),
                    &self.position_m,
                    &self.world_from_body,
                );
                if self.sweep_filter.accepts(radius_m * error_rad) {
                    self.correct(&jacobian[..n_parts], error_rad, variance);
                }
            }
        }
    }

    /// Returns the filter's yaw minus the deck's yaw as seen by one station, or `None` if sweeps
    /// correct the attitude, or if the station does not see all sensors.
    fn yaw_error_rad(&self, rotation: &Rotation) -> Option<f64> {
        if self.options.sweep_attitude == SweepAttitude::Slope {
            return None;
        }
        // The station's rays to the four sensors intersect the estimated plane of the deck.
        let station = &self.model.stations[rotation.station];
        let normal = self.world_from_body.column(2).into_owned();
        let above_m = normal.dot(&(station.position_m - self.position_m));
        let both_rad = rotation.both_rad?;
        let seen_m = [0, 1, 2, 3].map(|k: usize| {
            let ray = station.ray(both_rad.map(|angles_rad| angles_rad[k]));
            let toward = -normal.dot(&ray);
            (toward != 0.0).then(|| station.position_m + ray * (above_m / toward))
        });
        // The error is the mean rotation of both diagonals between the sensors relative to the
        // estimated diagonals.
        let diagonals_rad = [(0, 3), (1, 2)].map(|(from, to)| {
            let [a, b] = [from, to].map(|k| Vector3::from(DECK_SENSORS_M[k]));
            let estimated = self.world_from_body * (b - a);
            let seen = seen_m[to]? - seen_m[from]?;
            let length = estimated.norm() * seen.norm();
            let angle_rad = libm::acos((estimated.dot(&seen) / length).clamp(-1.0, 1.0));
            let is_left = normal.dot(&estimated.cross(&seen)) > 0.0;
            let error_rad = if is_left { -angle_rad } else { angle_rad };
            (seen.norm() >= LEAST_DIAGONAL_M).then_some(error_rad)
        });
        Some(0.5 * (diagonals_rad[0]? + diagonals_rad[1]?))
    }

    /// Corrects the state with the yaw error at the tick's beginning, minus the rotation since
    /// then.
    fn correct_yaw(&mut self, yaw_error_rad: f64) {
        let error_rad = self.turn_rad.z - yaw_error_rad;
        self.correct(&[Part::One(TURN + 2, 1.0)], error_rad, YAW_SIGMA_RAD * YAW_SIGMA_RAD);
    }

    /// Corrects the state with a range. A range difference is ignored if it is impossible or an
    /// outlier.
    fn correct_by_range(&mut self, range: &Range) {
        let (jacobian, error_m, variance) = self.model.range(range, &self.position_m);
        if let Some(other) = range.minus {
            // A difference cannot exceed the distance between the anchors.
            let anchors_m = &self.model.anchors_m;
            let apart_m = (anchors_m[range.anchor] - anchors_m[other]).norm();
            let is_possible = range.distance_m.abs() < apart_m;
            if !is_possible || !self.tdoa_filter.accepts(error_m, variance.sqrt()) {
                return;
            }
        }
        self.correct(&[jacobian], error_m, variance);
    }

    /// Corrects the state with the measured position and heights, if there are any.
    fn correct_by_position(&mut self, readings: &Readings<'_>) {
        if let Some(position_m) = readings.position_m {
            for axis in 0..3 {
                let error_m = position_m[axis] - self.position_m[axis];
                self.correct(&[Part::One(axis, 1.0)], error_m, self.model.position);
            }
        }
        let cos_tilt = self.world_from_body[(2, 2)];
        for &(sensor, measured_m) in readings.heights {
            // Distance / height is 1 / cos of the tilt in excess of half the ranger's cone.
            let mut per_m = 1.0;
            if sensor.looks_down() {
                if cos_tilt <= LEAST_COS_TILT {
                    continue;
                }
                let tilt_rad = libm::acos(cos_tilt.min(1.0)) - 0.5 * RANGER_CONE_RAD;
                per_m /= libm::cos(tilt_rad.max(0.0));
            }
            let sigma_m = self.model.sensors.height_sigma_m(sensor, measured_m);
            let error_m = measured_m - self.position_m.z * per_m;
            self.correct(&[Part::One(2, per_m)], error_m, sigma_m * sigma_m);
        }
    }

    /// Corrects the state with a scalar measurement. `value` is the measured minus the expected
    /// value, in m or rad, and `variance` is its variance in the square of that unit.
    fn correct(&mut self, jacobian: &[Part], value: f64, variance: f64) {
        let measurement = Measurement { jacobian, value, variance };
        noctograph_core::dispatch!(|| self.normal.correct(&measurement, |_| true));
        let [position_m, velocity_m_s, turn_rad] = self.normal.take_errors(0);
        self.position_m += position_m;
        self.velocity_m_s += velocity_m_s;
        self.turn_rad += turn_rad;
        self.bound();
    }

    /// Ends a tick that changed the state, and rotates the attitude if its error is large enough.
    fn settle(&mut self) {
        let turn_rad = std::mem::take(&mut self.turn_rad);
        if turn_rad.amax() > LEAST_TURN_RAD {
            self.attitude = self.attitude.by(&turn_rad);
            self.transform(None, &turned_back(&turn_rad));
        }
        self.world_from_body = self.attitude.matrix();
        self.bound();
    }

    /// Computes `P ← Φ P Φᵀ`, and makes P symmetric. Without a drift, Φ rotates only attitude
    /// errors. `turn` is the rotation of the body's axes, which Φ applies to the attitude errors.
    fn transform(&mut self, drift: Option<&Drift>, turn: &Matrix3<f64>) {
        let columns = self.normal.covariance.as_mut_slice().as_chunks_mut().0;
        let p: &mut [[f64; 9]; 9] = columns.first_chunk_mut().expect("nine states");
        noctograph_core::dispatch!(|| {
            // The columns of a symmetric matrix equal its rows, so Φ (Φ P)ᵀ = Φ P Φᵀ.
            let next = multiplied(&multiplied(p, drift, turn), drift, turn);
            for (p, (row, column)) in p.iter_mut().zip(next.iter().zip(&transposed(&next))) {
                let pairs = p.iter_mut().zip(row.iter().zip(column));
                pairs.for_each(|(p, (a, b))| *p = (a + b) * 0.5);
            }
        });
    }

    /// Limits every variance to the range from the option `least_variance` to [`LARGEST_VARIANCE`].
    fn bound(&mut self) {
        for state in 0..TURN + 3 {
            let variance = &mut self.normal.covariance[(state, state)];
            *variance = variance.max(self.options.least_variance).min(LARGEST_VARIANCE);
        }
    }
}

impl Estimator for Firmware {
    /// Runs the filter for a tick, in the order of the firmware.
    fn update(&mut self, readings: &Readings<'_>, tick_s: f64) {
        // The first tick is at time zero.
        let tick_s = if std::mem::replace(&mut self.begun, true) { tick_s } else { 0.0 };
        self.time_s += tick_s;
        self.sweep_filter.wait(tick_s);
        self.tdoa_filter.wait(tick_s);
        if readings.throttle > 0.0 {
            self.driven_s = self.time_s;
        }
        // The deck's driver computes yaw errors from the state of the last tick.
        let rotations = self.deck.receive(readings.sweeps, self.time_s);
        let yaw_errors_rad: Vec<Option<f64>> =
            rotations.iter().map(|rotation| self.yaw_error_rad(rotation)).collect();

        // The prediction has a separate rate. Process noise is added at every tick, followed by the
        // corrections with sweeps, ranges, positions and heights.
        let span_s = self.time_s - self.predicted_s;
        let predicts = span_s + TIME_TOLERANCE_S >= 1.0 / self.options.prediction_hz;
        if predicts {
            self.predict(span_s);
        }
        self.add_noise(tick_s);
        for (rotation, yaw_error_rad) in rotations.iter().zip(yaw_errors_rad) {
            self.correct_by_sweeps(rotation);
            yaw_error_rad.into_iter().for_each(|error_rad| self.correct_yaw(error_rad));
        }
        readings.ranges.iter().for_each(|range| self.correct_by_range(range));
        self.correct_by_position(readings);
        // The inertial readings of this tick are used in the next prediction.
        self.sums[0] += readings.rate_rad_s;
        self.sums[1] += readings.specific_force_m_s2;
        self.n_summed += 1.0;
        self.rate_rad_s = readings.rate_rad_s;
        if predicts || !rotations.is_empty() || readings.measures_position() {
            self.settle();
        }
    }

    fn state(&self) -> State {
        let attitude = angles(&self.world_from_body);
        state(&self.position_m, attitude, &self.velocity_m_s, &self.rate_rad_s)
    }

    fn covariance_m2(&self) -> Option<Matrix3<f64>> {
        Some(self.normal.block(0, 0))
    }
}

/// Blocks of `Φ − 1` by which errors of velocity and attitude change position and velocity.
struct Drift {
    position: [Matrix3<f64>; 2],
    velocity: [Matrix3<f64>; 2],
}

/// Returns the columns of `Φ P` from the rows of P, without products with the zeros and ones of Φ.
/// A `drift` of `None` means that position and velocity are constant.
#[inline(always)]
fn multiplied(p: &[[f64; 9]; 9], drift: Option<&Drift>, turn: &Matrix3<f64>) -> [[f64; 9]; 9] {
    // Rows that Φ preserves start unchanged, and rows that it replaces start at zero.
    let mut product = *p;
    product[TURN..].fill([0.0; 9]);
    if drift.is_some() {
        product[VELOCITY..TURN].fill([0.0; 9]);
    }
    let mut add = |to: usize, block: &Matrix3<f64>, from: usize| {
        for (i, k) in (0..9).map(|n| (n / 3, n % 3)) {
            let factor = block[(i, k)];
            let sums = product[to + i].iter_mut().zip(&p[from + k]);
            sums.for_each(|(sum, value)| *sum += factor * value);
        }
    };
    if let Some(Drift { position, velocity }) = drift {
        add(0, &position[0], VELOCITY);
        add(0, &position[1], TURN);
        add(VELOCITY, &velocity[0], VELOCITY);
        add(VELOCITY, &velocity[1], TURN);
    }
    add(TURN, turn, TURN);
    transposed(&product)
}

/// Returns the transpose of a matrix.
#[inline(always)]
fn transposed(rows: &[[f64; 9]; 9]) -> [[f64; 9]; 9] {
    let mut columns = [[0.0; 9]; 9];
    for (i, row) in rows.iter().enumerate() {
        for (column, value) in columns.iter_mut().zip(row) {
            column[i] = *value;
        }
    }
    columns
}

/// Returns the matrix that rotates an attitude error together with its frame, `1 − [d]× + [d]×²/2`
/// with half the rotation `d` (Mueller, Hehn, D'Andrea 2017).
fn turned_back(turn_rad: &Vector3<f64>) -> Matrix3<f64> {
    let cross = (turn_rad * 0.5).cross_matrix();
    Matrix3::identity() - cross + cross * cross * 0.5
}
