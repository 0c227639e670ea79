//! Height of the floor below the drone, as a tenth state of the extended Kalman filter.
//!
//! A ranger measures the height above whatever is below. With this state and the step test, the edge
//! of a table moves the floor and not the drone.

use nalgebra::{Matrix3, Vector3};

use super::covariance::{Covariance, Errors, Residual};
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
    height_m: f64,
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

    /// Corrects all ten states by a measurement, as [`Covariance::correct`]; by a range to the floor
    /// unless the floor steps.
    pub(super) fn correct(
        &mut self,
        covariance: &mut Covariance,
        errors: &mut Errors,
        measured: &Residual,
        to_floor: bool,
        gate_sq: f64,
    ) {
        let Residual { slope, innovation, variance } = measured;
        // A range shrinks by as much with the floor as it grows with the height.
        let per_floor_m = if to_floor { -slope.position.z } else { 0.0 };
        let [p, v, t] = &self.with;
        let of_floor = p.dot(&slope.position) + t.dot(&slope.turn) + self.variance * per_floor_m;
        let mut a = covariance.spread(slope);
        a.add(&Errors { position_m: *p, velocity_m_s: *v, turn_rad: *t }, per_floor_m);
        let left = Innovation {
            value: innovation - slope.along(errors) - per_floor_m * self.error_m,
            variance: slope.along(&a) + per_floor_m * of_floor + variance,
        };
        match if to_floor { self.test.look(&left) } else { Floor::Still } {
            Floor::Still => {}
            Floor::Open => return,
            Floor::Stepped(farther_m) => {
                self.error_m += farther_m / per_floor_m;
                self.variance += STEP_M * STEP_M;
                return;
            }
        }
        if left.value * left.value > gate_sq * left.variance {
            return;
        }
        let scale = 1.0 / left.variance.sqrt();
        let (gain, f) = (a.times(scale), of_floor * scale);
        errors.add(&gain, left.value * scale);
        covariance.reduce(&gain);
        self.error_m += f * left.value * scale;
        for (with, part) in
            self.with.iter_mut().zip([gain.position_m, gain.velocity_m_s, gain.turn_rad])
        {
            *with -= part * f;
        }
        self.variance -= f * f;
    }

    /// Height of the floor after the corrections of this tick.
    pub(super) fn settled_m(&mut self) -> f64 {
        self.height_m += std::mem::take(&mut self.error_m);
        self.height_m
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{SMatrix, SVector};

    use super::super::covariance::{Slope, dense};
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
            let measured = Residual { slope, innovation: 0.02, variance: 0.01 };
            floor.correct(&mut p, &mut errors, &measured, true, 25.0);
            assert!((whole(&p, &floor) - want).norm() < 1e-13 * want.norm());
        }
        assert!(floor.with[0].z > 0.0, "a drone that is higher has its floor higher");
    }
}
