//! Height of the floor below the drone, as a tenth state of the extended Kalman filter.
//!
//! A ranger measures the height above whatever is below. With this state and the step test, the edge
//! of a table moves the floor and not the drone.

use nalgebra::{Matrix3, Vector3};

use super::covariance::{Covariance, Errors, Slope};
use super::step_test::{Floor, StepTest};
use crate::control::Innovation;

/// Standard deviation of the floor's height on the ground, m, and its random walk, m/√s.
const START_M: f64 = 0.005;
const WALK_M_SQRT_S: f64 = 0.003;
/// Gate of the step test, smallest step, and the standard deviation that a step adds.
const GATE_SIGMAS: f64 = 4.0;
const LEAST_STEP_M: f64 = 0.05;
const STEP_M: f64 = 0.5;

/// The floor, and its covariance with the nine errors.
#[derive(Clone, Debug)]
pub(super) struct FloorBelow {
    pub(super) height_m: f64,
    /// Correction by the measurements of this tick.
    error_m: f64,
    variance: f64,
    /// Covariance with position, velocity and turn.
    with: [Vector3<f64>; 3],
    test: StepTest,
}

impl FloorBelow {
    /// A level floor at a height.
    pub(super) fn new() -> Self {
        Self {
            height_m: 0.0,
            error_m: 0.0,
            variance: START_M * START_M,
            with: [Vector3::zeros(); 3],
            test: StepTest::new(GATE_SIGMAS, LEAST_STEP_M),
        }
    }

    /// Carries the covariance over a span, as [`Covariance::carry`].
    pub(super) fn carry(&mut self, span_s: f64, lever: &Matrix3<f64>, turn_rad: &Vector3<f64>) {
        let (b, cross) = (lever * span_s, turn_rad.cross_matrix());
        let [p, v, t] = self.with;
        self.with = [
            p + v * span_s + b * t * (0.5 * span_s),
            v + b * t,
            t - cross * t + cross * cross * t * 0.5,
        ];
        self.variance += WALK_M_SQRT_S * WALK_M_SQRT_S * span_s;
    }

    /// Corrects all ten states by a measurement that changes with the floor by `per_m`, as
    /// [`Covariance::correct`].
    pub(super) fn correct(
        &mut self,
        covariance: &mut Covariance,
        errors: &mut Errors,
        measured: &Measured,
        gate_sq: f64,
    ) {
        let (a, of_floor, Innovation { value, variance }) =
            self.against(covariance, errors, measured);
        if value * value > gate_sq * variance {
            return;
        }
        let scale = 1.0 / variance.sqrt();
        let (a, f) = (a.map(|part| part * scale), of_floor * scale);
        covariance.take(errors, &a, value * scale);
        self.error_m += f * value * scale;
        for (with, part) in self.with.iter_mut().zip(&a) {
            *with -= part * f;
        }
        self.variance -= f * f;
    }

    /// Corrects by a range to the floor, unless the floor steps.
    pub(super) fn correct_range(
        &mut self,
        covariance: &mut Covariance,
        errors: &mut Errors,
        measured: &Measured,
        gate_sq: f64,
    ) {
        let innovation = self.against(covariance, errors, measured).2;
        match self.test.look(&innovation) {
            Floor::Still => self.correct(covariance, errors, measured, gate_sq),
            Floor::Open => {}
            Floor::Stepped(farther_m) => {
                self.error_m += farther_m / measured.per_floor_m;
                self.variance += STEP_M * STEP_M;
            }
        }
    }

    /// `P h` of the nine errors and of the floor, and what is left of the innovation.
    fn against(
        &self,
        covariance: &Covariance,
        errors: &Errors,
        measured: &Measured,
    ) -> ([Vector3<f64>; 3], f64, Innovation) {
        let Measured { slope, per_floor_m, innovation, variance } = measured;
        let Slope { position, turn } = slope;
        let mut a = covariance.against(slope);
        for (part, with) in a.iter_mut().zip(&self.with) {
            *part += with * *per_floor_m;
        }
        let of_floor =
            self.with[0].dot(position) + self.with[2].dot(turn) + self.variance * per_floor_m;
        let expected = position.dot(&errors.position_m)
            + turn.dot(&errors.turn_rad)
            + per_floor_m * self.error_m;
        let spread = position.dot(&a[0]) + turn.dot(&a[2]) + per_floor_m * of_floor + variance;
        (a, of_floor, Innovation { value: innovation - expected, variance: spread })
    }

    /// Applies the corrections of this tick's measurements.
    pub(super) fn settle(&mut self) {
        self.height_m += std::mem::take(&mut self.error_m);
    }
}

/// A scalar measurement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    /// How it changes with the errors.
    pub(super) slope: Slope,
    /// How it changes with the floor's height.
    pub(super) per_floor_m: f64,
    /// Measured less predicted.
    pub(super) innovation: f64,
    /// Of its noise.
    pub(super) variance: f64,
}

#[cfg(test)]
mod tests {
    use nalgebra::{SMatrix, SVector};

    use super::super::covariance::dense;
    use super::*;

    #[test]
    fn ten_states_are_corrected_as_one_matrix_is() {
        let mut p = Covariance::new(0.3, 0.2, 0.1);
        let lever = -Vector3::new(0.4, -0.3, 9.7).cross_matrix();
        let turn_rad = Vector3::new(0.03, -0.02, 0.05);
        let mut floor = FloorBelow::new();
        let whole = |p: &Covariance, floor: &FloorBelow| {
            let mut all = dense::matrix(p).fixed_resize::<10, 10>(0.0);
            for (part, with) in floor.with.iter().enumerate() {
                all.fixed_view_mut::<3, 1>(3 * part, 9).copy_from(with);
                all.fixed_view_mut::<1, 3>(9, 3 * part).copy_from(&with.transpose());
            }
            all[(9, 9)] = floor.variance;
            all
        };
        let mut errors = Errors::default();
        for _ in 0..5 {
            p.carry(0.05, &lever, &turn_rad, [0.1; 3], 0.02);
            floor.carry(0.05, &lever, &turn_rad);
            let slope = Slope { position: Vector3::z() * 1.1, turn: Vector3::new(0.1, -0.2, 0.0) };
            let before = whole(&p, &floor);
            let mut h = SVector::<f64, 10>::zeros();
            h.fixed_rows_mut::<3>(0).copy_from(&slope.position);
            h.fixed_rows_mut::<3>(6).copy_from(&slope.turn);
            h[9] = -1.1;
            let s = h.dot(&(before * h)) + 0.01;
            let gain = before * h / s;
            let joseph = SMatrix::<f64, 10, 10>::identity() - gain * h.transpose();
            let want = joseph * before * joseph.transpose() + gain * gain.transpose() * 0.01;
            let measured = Measured { slope, per_floor_m: -1.1, innovation: 0.02, variance: 0.01 };
            floor.correct(&mut p, &mut errors, &measured, 25.0);
            assert!((whole(&p, &floor) - want).norm() < 1e-13 * want.norm());
        }
        assert!(floor.with[0].z > 0.0, "a drone that is higher has its floor higher");
    }
}
