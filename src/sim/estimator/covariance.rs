//! Covariance of nine errors: position and velocity in the world, and a small turn in the body
//! frame. Kept as six blocks, which saves the products with zeros.

use nalgebra::{Matrix3, Vector3};

/// `P`, its lower triangle left out.
#[derive(Clone, Debug)]
pub(super) struct Covariance {
    pub(super) pp: Matrix3<f64>,
    pub(super) pv: Matrix3<f64>,
    pub(super) pt: Matrix3<f64>,
    pub(super) vv: Matrix3<f64>,
    pub(super) vt: Matrix3<f64>,
    pub(super) tt: Matrix3<f64>,
}

/// Nine small errors.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Errors {
    pub(super) position_m: Vector3<f64>,
    pub(super) velocity_m_s: Vector3<f64>,
    pub(super) turn_rad: Vector3<f64>,
}

/// How a scalar measurement changes with the errors: no sensor here measures velocity.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slope {
    pub(super) position: Vector3<f64>,
    pub(super) turn: Vector3<f64>,
}

/// A scalar measurement against its prediction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Residual {
    pub(super) slope: Slope,
    pub(super) innovation: f64,
    pub(super) variance: f64,
}

impl Covariance {
    /// Independent errors with these standard deviations.
    pub(super) fn new(position_m: f64, velocity_m_s: f64, turn_rad: f64) -> Self {
        let diagonal = |sigma: f64| Matrix3::from_diagonal_element(sigma * sigma);
        let zero = Matrix3::zeros();
        Self {
            pp: diagonal(position_m),
            pv: zero,
            pt: zero,
            vv: diagonal(velocity_m_s),
            vt: zero,
            tt: diagonal(turn_rad),
        }
    }

    /// Carries the covariance over a span: `P ← Φ P Φᵀ + Q` with
    /// `ṗ = v`, `v̇ = −R [f]× θ`, `θ̇ = −[ω]× θ`.
    ///
    /// `lever` is `−R [f]×`; the spectral densities (two-sided) are those of the noise on the
    /// acceleration and on the body rate.
    #[inline(always)]
    pub(super) fn carry(
        &mut self,
        span_s: f64,
        lever: &Matrix3<f64>,
        turn_rad: &Vector3<f64>,
        acceleration_density: [f64; 3],
        rate_density: f64,
    ) {
        let b = lever * span_s;
        let c = b * (0.5 * span_s);
        let cross = turn_rad.cross_matrix();
        let t_transposed = Matrix3::identity() + cross + cross * cross * 0.5;

        let (b_tt, pt) = (b * self.tt, self.pt);
        let pt_next = pt + self.vt * span_s + b_tt * (0.5 * span_s);
        let vt_next = self.vt + b_tt;
        let pv_old = self.pv + self.vv * span_s + c * self.vt.transpose();
        let pp_old = self.pp + self.pv.transpose() * span_s + c * pt.transpose();
        self.pp = pp_old + pv_old * span_s + pt_next * c.transpose();
        self.pv = pv_old + pt_next * b.transpose();
        self.vv += b * self.vt.transpose() + vt_next * b.transpose();
        self.pt = pt_next * t_transposed;
        self.vt = vt_next * t_transposed;
        self.tt = t_transposed.transpose() * self.tt * t_transposed;

        for (i, density) in acceleration_density.into_iter().enumerate() {
            let velocity = density * span_s;
            self.pp[(i, i)] += velocity * span_s * span_s / 3.0;
            self.pv[(i, i)] += velocity * span_s / 2.0;
            self.vv[(i, i)] += velocity;
            self.tt[(i, i)] += rate_density * span_s;
        }
        for block in [&mut self.pp, &mut self.vv, &mut self.tt] {
            *block = (*block + block.transpose()) * 0.5;
        }
    }

    /// Corrects by one scalar measurement that differs by `innovation` from the prediction of
    /// `errors`, with variance `variance`; adds to `errors`. Beyond `gate_sq` variances of the
    /// innovation (χ²) it is left alone, and the answer is `false`.
    ///
    /// `P ← P − a aᵀ / s`: a scalar update subtracts one square from a matrix that stays exactly
    /// symmetric, which at the ratios of variance that occur here (1e-6 and more) is as safe as
    /// Joseph's form and half the work.
    #[inline(always)]
    pub(super) fn correct(
        &mut self,
        errors: &mut Errors,
        slope: &Slope,
        innovation: f64,
        variance: f64,
        gate_sq: f64,
    ) -> bool {
        let a = self.spread(slope);
        let s = slope.along(&a) + variance;
        let left = innovation - slope.along(errors);
        if left * left > gate_sq * s {
            return false;
        }
        let scale = 1.0 / s.sqrt();
        let gain = a.times(scale);
        errors.add(&gain, left * scale);
        self.reduce(&gain);
        true
    }

    /// `P h`: how the errors go along with a measurement.
    #[inline(always)]
    pub(super) fn spread(&self, slope: &Slope) -> Errors {
        Errors {
            position_m: self.pp * slope.position + self.pt * slope.turn,
            velocity_m_s: self.pv.tr_mul(&slope.position) + self.vt * slope.turn,
            turn_rad: self.pt.tr_mul(&slope.position) + self.tt * slope.turn,
        }
    }

    /// `P ← P − a aᵀ`.
    #[inline(always)]
    pub(super) fn reduce(&mut self, a: &Errors) {
        let (p, v, t) = (a.position_m, a.velocity_m_s, a.turn_rad);
        self.pp -= p * p.transpose();
        self.pv -= p * v.transpose();
        self.pt -= p * t.transpose();
        self.vv -= v * v.transpose();
        self.vt -= v * t.transpose();
        self.tt -= t * t.transpose();
    }
}

impl Slope {
    /// The change of the measurement with errors.
    #[inline(always)]
    pub(super) fn along(&self, errors: &Errors) -> f64 {
        self.position.dot(&errors.position_m) + self.turn.dot(&errors.turn_rad)
    }
}

impl Errors {
    #[inline(always)]
    pub(super) fn times(&self, factor: f64) -> Self {
        Self {
            position_m: self.position_m * factor,
            velocity_m_s: self.velocity_m_s * factor,
            turn_rad: self.turn_rad * factor,
        }
    }

    #[inline(always)]
    pub(super) fn add(&mut self, other: &Self, factor: f64) {
        self.position_m += other.position_m * factor;
        self.velocity_m_s += other.velocity_m_s * factor;
        self.turn_rad += other.turn_rad * factor;
    }
}

#[cfg(test)]
pub(super) mod dense {
    use nalgebra::SMatrix;

    use super::*;

    /// The whole matrix.
    pub(in crate::sim::estimator) fn matrix(p: &Covariance) -> SMatrix<f64, 9, 9> {
        let mut whole = SMatrix::<f64, 9, 9>::zeros();
        let blocks =
            [(0, 0, p.pp), (0, 3, p.pv), (0, 6, p.pt), (3, 3, p.vv), (3, 6, p.vt), (6, 6, p.tt)];
        for (row, column, block) in blocks {
            whole.fixed_view_mut::<3, 3>(column, row).copy_from(&block.transpose());
            whole.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
        }
        whole
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Cholesky, SMatrix, SVector};

    use super::*;

    fn some() -> Covariance {
        let mut p = Covariance::new(0.3, 0.2, 0.1);
        let force = Vector3::new(0.4, -0.3, 9.7);
        for _ in 0..5 {
            p.carry(0.05, &-force.cross_matrix(), &Vector3::new(0.03, -0.02, 0.05), [0.1; 3], 0.02);
        }
        p
    }

    #[test]
    fn blocks_carry_and_correct_as_the_whole_matrix_does() {
        let (mut p, before) = (some(), dense::matrix(&some()));
        let (span, turn) = (0.02, Vector3::new(0.01, 0.02, -0.03));
        let lever = -Vector3::new(1.0, -2.0, 9.0).cross_matrix();
        p.carry(span, &lever, &turn, [0.3; 3], 0.04);
        let cross = turn.cross_matrix();
        let mut phi = SMatrix::<f64, 9, 9>::identity();
        phi.fixed_view_mut::<3, 3>(0, 3).copy_from(&(Matrix3::identity() * span));
        phi.fixed_view_mut::<3, 3>(0, 6).copy_from(&(lever * (0.5 * span * span)));
        phi.fixed_view_mut::<3, 3>(3, 6).copy_from(&(lever * span));
        let t = Matrix3::identity() - cross + cross * cross * 0.5;
        phi.fixed_view_mut::<3, 3>(6, 6).copy_from(&t);
        let mut want = phi * before * phi.transpose();
        for i in 0..3 {
            want[(i, i)] += 0.3 * span * span * span / 3.0;
            want[(i, i + 3)] += 0.3 * span * span / 2.0;
            want[(i + 3, i)] += 0.3 * span * span / 2.0;
            want[(i + 3, i + 3)] += 0.3 * span;
            want[(i + 6, i + 6)] += 0.04 * span;
        }
        assert!((dense::matrix(&p) - want).norm() < 1e-14 * want.norm(), "carried");

        let slope =
            Slope { position: Vector3::new(1.0, 0.5, -0.2), turn: Vector3::new(0.1, 0.0, 0.3) };
        let mut h = SVector::<f64, 9>::zeros();
        h.fixed_rows_mut::<3>(0).copy_from(&slope.position);
        h.fixed_rows_mut::<3>(6).copy_from(&slope.turn);
        let s = h.dot(&(want * h)) + 0.01;
        let gain = want * h / s;
        let joseph = SMatrix::<f64, 9, 9>::identity() - gain * h.transpose();
        let want = joseph * want * joseph.transpose() + gain * gain.transpose() * 0.01;
        let mut errors = Errors::default();
        assert!(p.correct(&mut errors, &slope, 0.02, 0.01, 25.0), "within the gate");
        assert!((dense::matrix(&p) - want).norm() < 1e-13 * want.norm(), "corrected");
        assert!((errors.turn_rad - gain.fixed_rows::<3>(6) * 0.02).norm() < 1e-15, "gain");
    }

    #[test]
    fn a_million_sharp_measurements_leave_it_positive() {
        let mut p = Covariance::new(100.0, 10.0, 1.0);
        let lever = -(Vector3::z() * 9.81).cross_matrix();
        for i in 0..1_000_000_u32 {
            if i % 4 == 0 {
                p.carry(0.005, &lever, &Vector3::zeros(), [1e-6; 3], 1e-8);
            }
            let angle = f64::from(i);
            let position = Vector3::new(libm::sin(angle), libm::cos(angle), libm::sin(0.7 * angle));
            let slope = Slope { position, turn: position.cross(&Vector3::x()) * 0.015 };
            p.correct(&mut Errors::default(), &slope, 0.0, 1e-8, 25.0);
        }
        let whole = dense::matrix(&p);
        let scale = whole.diagonal().map(|d| 1.0 / d.sqrt());
        let correlation = SMatrix::<f64, 9, 9>::from_fn(|i, j| whole[(i, j)] * scale[i] * scale[j]);
        assert!(Cholesky::new(correlation).is_some(), "{correlation}");
    }

    #[test]
    fn what_lies_beyond_the_gate_is_left_alone() {
        let mut p = some();
        let before = dense::matrix(&p);
        let slope = Slope { position: Vector3::x(), turn: Vector3::zeros() };
        let sigma = (before[(0, 0)] + 0.01).sqrt();
        let mut errors = Errors::default();
        assert!(!p.correct(&mut errors, &slope, 3.01 * sigma, 0.01, 9.0), "beyond");
        assert_eq!((dense::matrix(&p), errors.position_m), (before, Vector3::zeros()));
        assert!(p.correct(&mut errors, &slope, 2.99 * sigma, 0.01, 9.0), "within");
    }
}
