//! Normal distribution of states, and its correction by a measurement.
//!
//! The prediction is `x ← Φ x`, `P ← Φ P Φᵀ + Q`. A scalar measurement `y = hᵀ x + noise` with
//! noise variance `r` has the innovation `ν = y − hᵀ x`, whose variance is `s = hᵀ P h + r`. With
//! the gain `k = P h / √s`, the correction is `x ← x + k ν / √s` and `P ← P − k kᵀ`. A scalar
//! correction subtracts a rank-one square from the matrix, which remains exactly symmetric. At the
//! ratios of variances that occur here (1e-6 or more), this correction is as robust as Joseph's
//! form with half the work. Using independent measurements one after the other is equivalent to
//! using them together.
//!
//! Jacobians are sparse, because a measurement depends on few states. All loops run over plain
//! columns, so that no product uses different code on different processors.
//!
//! Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and
//! Navigation*, Wiley 2001, sections 5.2 and 5.4 (normalized innovation squared).

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Numbers of states of a filter for one drone and for two drones, for which the inner loops are
/// compiled separately.
const ONE_DRONE: usize = 9;
const TWO_DRONES: usize = 18;

/// Mean and covariance of states, or of small errors of states.
#[derive(Clone, Debug, PartialEq)]
pub struct Normal {
    /// Mean of the states.
    pub mean: DVector<f64>,
    /// Covariance of the states, with both triangles.
    pub covariance: DMatrix<f64>,
    /// Buffer for the gain of one measurement.
    gain: Vec<f64>,
}

/// Part of a measurement's Jacobian, the derivative with respect to one or three of the states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part {
    /// Derivative with respect to the state with this index.
    One(usize, f64),
    /// Derivatives with respect to three consecutive states that begin at this index.
    Three(usize, Vector3<f64>),
}

/// Scalar measurement `y = hᵀ x + noise`, linearized if necessary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement<'a> {
    /// Jacobian h, in which each state occurs in at most one part.
    pub jacobian: &'a [Part],
    /// Value y, which is the measured value minus the value expected if all states are zero.
    pub value: f64,
    /// Variance of the noise.
    pub variance: f64,
}

/// Entry of a sparse matrix, as row, column and value.
pub type Entry = (usize, usize, f64);

/// Difference between a measurement and its prediction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Measured minus predicted value.
    pub value: f64,
    /// Variance of the difference according to the filter.
    pub variance: f64,
}

impl Innovation {
    /// Returns the distance from the prediction in standard deviations.
    pub fn sigmas(&self) -> f64 {
        self.value.abs() / self.variance.sqrt()
    }

    /// Returns the normalized innovation squared (NIS), 1 on average if the filter is consistent.
    pub fn nis(&self) -> f64 {
        self.value * self.value / self.variance
    }

    /// True if the NIS is above `gate_sq` (χ²).
    pub fn is_beyond(&self, gate_sq: f64) -> bool {
        self.value * self.value > gate_sq * self.variance
    }
}

impl Normal {
    /// Creates a distribution from a mean and a covariance.
    pub fn new(mean: DVector<f64>, covariance: DMatrix<f64>) -> Self {
        let gain = vec![0.0; mean.len()];
        Self { mean, covariance, gain }
    }

    /// Creates independent states with zero mean and these standard deviations.
    pub fn independent(sigmas: &[f64]) -> Self {
        let variances = DVector::from_iterator(sigmas.len(), sigmas.iter().map(|s| s * s));
        Self::new(DVector::zeros(sigmas.len()), DMatrix::from_diagonal(&variances))
    }

    /// Returns the means of three states that begin at index `first`.
    #[inline]
    pub fn three(&self, first: usize) -> Vector3<f64> {
        self.mean.fixed_rows::<3>(first).into_owned()
    }

    /// Returns the 3×3 block of the covariance whose first entry is at `row` and `column`.
    #[inline(always)]
    pub fn block(&self, row: usize, column: usize) -> Matrix3<f64> {
        self.covariance.fixed_view::<3, 3>(row, column).into_owned()
    }

    /// Returns the standard deviation of a state.
    pub fn sigma(&self, state: usize) -> f64 {
        self.covariance[(state, state)].max(0.0).sqrt()
    }

    /// Propagates the states by a transition `Φ` and a noise covariance `Q`. `Φ` is given as the
    /// entries of `Φ − 1`, which are applied in order. An entry that reads a state must precede one
    /// that changes it. `Q` is given as its upper triangle.
    pub fn predict(&mut self, transition: &[Entry], noise: &[Entry]) {
        for &(row, column, value) in transition {
            self.mean[row] += value * self.mean[column];
        }
        // Φ P is computed for each column of P, and then (Φ P) Φᵀ for each entry of Φ.
        let n = self.mean.len();
        let p = self.covariance.as_mut_slice();
        for states in p.chunks_exact_mut(n) {
            for &(row, column, value) in transition {
                states[row] += value * states[column];
            }
        }
        for &(row, column, value) in transition {
            (0..n).for_each(|i| p[row * n + i] += value * p[column * n + i]);
        }
        // Rounding makes the two triangles differ, so both are replaced with their mean.
        for i in 0..n {
            for j in 0..i {
                p[i * n + j] = 0.5 * (p[i * n + j] + p[j * n + i]);
                p[j * n + i] = p[i * n + j];
            }
        }
        for &(row, column, value) in noise {
            self.covariance[(row, column)] += value;
            if row != column {
                self.covariance[(column, row)] += value;
            }
        }
    }

    /// Returns the innovation of a measurement and its variance. Stores `P h` in the gain, from
    /// which [`Self::correct`] continues.
    #[inline(always)]
    pub fn innovation(&mut self, measurement: &Measurement<'_>) -> Innovation {
        let Measurement { jacobian, value, variance } = *measurement;
        // The same loop is compiled for the known lengths of one and of two drones.
        let p = self.covariance.as_slice();
        match self.gain.len() {
            ONE_DRONE => multiply(p, jacobian, &mut self.gain, ONE_DRONE),
            TWO_DRONES => multiply(p, jacobian, &mut self.gain, TWO_DRONES),
            n => multiply(p, jacobian, &mut self.gain, n),
        }
        Innovation {
            value: value - product(jacobian, self.mean.as_slice()),
            // Rounding can make the sum negative if the reading is far less accurate than the
            // states.
            variance: product(jacobian, &self.gain).max(0.0) + variance,
        }
    }

    /// Corrects the states with a measurement, unless the gate rejects its innovation. Returns true
    /// if the measurement was used.
    #[inline(always)]
    pub fn correct(
        &mut self,
        measurement: &Measurement<'_>,
        gate: impl FnOnce(&Innovation) -> bool,
    ) -> bool {
        let innovation = self.innovation(measurement);
        if !gate(&innovation) {
            return false;
        }
        // `innovation` has stored P h in the gain. Scaled by 1/√s, it corrects mean and covariance.
        let scale = 1.0 / innovation.variance.sqrt();
        self.gain.iter_mut().for_each(|gain| *gain *= scale);
        let states = self.mean.as_mut_slice().iter_mut();
        states.zip(&self.gain).for_each(|(x, gain)| *x += gain * (innovation.value * scale));
        // The loop is compiled for known lengths, as in `innovation`.
        let p = self.covariance.as_mut_slice();
        match self.gain.len() {
            ONE_DRONE => subtract_square(p, &self.gain, ONE_DRONE),
            TWO_DRONES => subtract_square(p, &self.gain, TWO_DRONES),
            n => subtract_square(p, &self.gain, n),
        }
        true
    }
}

/// Computes `a ← P h` for a symmetric `n` by `n` matrix P, whose columns equal its rows.
#[inline(always)]
fn multiply(p: &[f64], jacobian: &[Part], a: &mut [f64], n: usize) {
    let a = &mut a[..n];
    a.fill(0.0);
    for part in jacobian {
        match *part {
            Part::One(state, h) => {
                let x = &p[state * n..][..n];
                (0..n).for_each(|i| a[i] += x[i] * h);
            }
            Part::Three(first, h) => {
                let [x, y, z] = [first, first + 1, first + 2].map(|state| &p[state * n..][..n]);
                (0..n).for_each(|i| a[i] += x[i] * h.x + y[i] * h.y + z[i] * h.z);
            }
        }
    }
}

/// Computes `P ← P − k kᵀ` for an `n` by `n` matrix P.
#[inline(always)]
fn subtract_square(p: &mut [f64], k: &[f64], n: usize) {
    let k = &k[..n];
    for (column, factor) in p.chunks_exact_mut(n).zip(k) {
        let column = &mut column[..n];
        (0..n).for_each(|i| column[i] -= k[i] * factor);
    }
}

/// Returns the product `hᵀ x` of a Jacobian and states, in the unit of the measurement.
#[inline(always)]
pub fn product(jacobian: &[Part], states: &[f64]) -> f64 {
    let products = jacobian.iter().map(|part| match *part {
        Part::One(state, h) => h * states[state],
        Part::Three(i, h) => h.x * states[i] + h.y * states[i + 1] + h.z * states[i + 2],
    });
    products.sum()
}

/// Recorded step of a filter.
#[derive(Clone, Debug)]
pub struct Step {
    /// Time of the step in s.
    pub time_s: f64,
    /// Transition from the previous step, in the form that [`Normal::predict`] takes.
    pub transition: Vec<Entry>,
    /// Distribution before the measurements of this step.
    pub predicted: Normal,
    /// Distribution after the measurements of this step.
    pub updated: Normal,
}

impl Step {
    /// Returns the smoothed states of this step, given the next step and its smoothed states
    /// (Rauch, Tung, Striebel, AIAA Journal 3(8), 1965). Returns `None` if the covariance predicted
    /// for the next step is not positive definite.
    pub fn smoothed(&self, after: &Self, smoothed_after: &Normal) -> Option<Normal> {
        // The gain is G = P Φᵀ P'⁻¹, in which P' is the covariance predicted for the next step.
        let (updated, predicted) = (&self.updated, &after.predicted);
        let inverse = predicted.covariance.clone().cholesky()?;
        let mut phi_p = updated.covariance.clone();
        for &(row, column, value) in &after.transition {
            (0..phi_p.ncols()).for_each(|i| phi_p[(row, i)] += value * phi_p[(column, i)]);
        }
        let gain = inverse.solve(&phi_p).transpose();
        let mean = &updated.mean + &gain * (&smoothed_after.mean - &predicted.mean);
        let difference = &smoothed_after.covariance - &predicted.covariance;
        let change = &gain * difference * gain.transpose();
        Some(Normal::new(mean, &updated.covariance + change))
    }
}

/// Returns a vector's direction, which is the gradient of its length, and its length. A zero vector
/// has a zero direction.
#[inline]
pub fn toward(vector_m: &Vector3<f64>) -> (Vector3<f64>, f64) {
    let length_m = vector_m.norm();
    (vector_m / length_m.max(f64::MIN_POSITIVE), length_m)
}

#[cfg(test)]
mod tests {
    use nalgebra::Cholesky;

    use super::*;

    /// Returns a Jacobian as a column.
    fn column(jacobian: &[Part], n: usize) -> DVector<f64> {
        let mut h = DVector::zeros(n);
        for part in jacobian {
            match *part {
                Part::One(state, derivative) => h[state] = derivative,
                Part::Three(first, gradient) => h.fixed_rows_mut::<3>(first).copy_from(&gradient),
            }
        }
        h
    }

    /// Computes the correction of the whole matrix in Joseph's form.
    fn joseph(before: &Normal, measurement: &Measurement<'_>) -> (DVector<f64>, DMatrix<f64>) {
        let Measurement { jacobian, value, variance } = *measurement;
        let n = before.mean.len();
        let (h, p) = (column(jacobian, n), &before.covariance);
        let gain = p * &h / (h.dot(&(p * &h)) + variance);
        let left = DMatrix::identity(n, n) - &gain * h.transpose();
        let covariance = &left * p * left.transpose() + &gain * gain.transpose() * variance;
        (&before.mean + gain * (value - h.dot(&before.mean)), covariance)
    }

    fn measured(jacobian: &[Part], value: f64, variance: f64) -> Measurement<'_> {
        Measurement { jacobian, value, variance }
    }

    fn some() -> Normal {
        let mut normal = Normal::independent(&[0.3, 0.2, 0.1, 0.4, 0.5]);
        for i in 0..4 {
            let part = Part::Three(i % 3, Vector3::new(0.3, -0.8, 0.5));
            normal.correct(&measured(&[part], 0.1, 0.02), |_| true);
        }
        normal
    }

    #[test]
    fn a_correction_is_that_of_joseph() {
        let mut normal = some();
        let jacobian = [Part::Three(0, Vector3::new(1.0, 0.5, -0.2)), Part::One(4, -0.7)];
        let measurement = measured(&jacobian, 0.02, 0.01);
        let (mean, covariance) = joseph(&normal, &measurement);
        assert!(normal.correct(&measurement, |_| true));
        assert!((&normal.covariance - &covariance).norm() < 1e-14 * covariance.norm());
        assert!((&normal.mean - &mean).norm() < 1e-14, "{}", normal.mean);
        assert_eq!(normal.covariance, normal.covariance.transpose(), "exactly symmetric");
    }

    #[test]
    fn a_prediction_is_that_of_the_whole_matrices() {
        let mut normal = some();
        let transition = [(0, 1, 0.1), (0, 2, 0.02), (1, 2, 0.3), (4, 4, -0.5)];
        let noise = [(0, 0, 0.01), (0, 1, 0.002), (1, 1, 0.03)];
        let mut phi = DMatrix::<f64>::identity(5, 5);
        transition.iter().for_each(|&(i, j, value)| phi[(i, j)] += value);
        let mut want = &phi * &normal.covariance * phi.transpose();
        for (i, j, value) in noise {
            want[(i, j)] += value;
            want[(j, i)] = want[(i, j)];
        }
        let mean = phi * &normal.mean;
        normal.predict(&transition, &noise);
        assert!(
            (&normal.covariance - &want).norm() < 1e-15 && (&normal.mean - mean).norm() < 1e-15
        );
    }

    #[test]
    fn a_constant_is_estimated_as_the_weighted_mean_of_its_measurements() {
        let mut filter = Normal::independent(&[1e4]);
        for (value, variance) in [(2.0, 1.0), (5.0, 0.5), (3.0, 0.25)] {
            filter.correct(&measured(&[Part::One(0, 1.0)], value, variance), |_| true);
        }
        let mean = (2.0 / 1.0 + 5.0 / 0.5 + 3.0 / 0.25) / 7.0;
        assert!((filter.mean[0] - mean).abs() < 1e-7, "{}", filter.mean[0]);
        assert!((filter.sigma(0) - (1.0_f64 / 7.0).sqrt()).abs() < 1e-7);
    }

    #[test]
    fn a_steady_filter_has_the_covariance_of_the_riccati_equation() {
        // The states are the measured position, and the velocity, which has acceleration noise.
        let (t, q, r) = (0.1, 0.04, 0.0025);
        let (transition, h) = ([(0, 1, t)], [Part::One(0, 1.0)]);
        let noise = [(0, 0, q * t * t * t / 3.0), (0, 1, q * t * t / 2.0), (1, 1, q * t)];
        let mut filter = Normal::independent(&[1.0, 1.0]);
        for _ in 0..2000 {
            filter.predict(&transition, &noise);
            filter.correct(&measured(&h, 0.0, r), |_| true);
        }
        let mut next = filter.clone();
        next.predict(&transition, &noise);
        let (_, steady) = joseph(&next, &measured(&h, 0.0, r));
        let residual = steady - &filter.covariance;
        assert!(residual.norm() < 1e-12 && filter.covariance[(0, 0)] < r, "{residual}");
    }

    #[test]
    fn a_million_sharp_measurements_leave_it_positive() {
        let mut normal = Normal::independent(&[100.0, 100.0, 100.0, 1.0, 1.0, 1.0]);
        for i in 0..1_000_000_u32 {
            if i % 4 == 0 {
                normal.predict(&[(0, 3, 0.01), (1, 4, 0.01)], &[(3, 3, 5e-9), (4, 4, 5e-9)]);
            }
            let angle = f64::from(i);
            let place = Vector3::new(libm::sin(angle), libm::cos(angle), libm::sin(0.7 * angle));
            let turn = place.cross(&Vector3::x()) * 0.015;
            let jacobian = [Part::Three(0, place), Part::Three(3, turn)];
            normal.correct(&measured(&jacobian, 0.0, 1e-8), |_| true);
        }
        let scale = normal.covariance.diagonal().map(|d| 1.0 / d.sqrt());
        let correlation =
            DMatrix::from_fn(6, 6, |i, j| normal.covariance[(i, j)] * scale[i] * scale[j]);
        assert!(Cholesky::new(correlation.clone()).is_some(), "{correlation}");
    }

    #[test]
    fn what_lies_beyond_the_gate_is_left_alone() {
        let (mut normal, before) = (some(), some());
        let jacobian = [Part::One(0, 1.0)];
        let sigma = (before.covariance[(0, 0)] + 0.01).sqrt();
        for (sigmas, within) in [(3.01, false), (2.99, true)] {
            assert_eq!((&normal.mean, &normal.covariance), (&before.mean, &before.covariance));
            let measurement = measured(&jacobian, before.mean[0] + sigmas * sigma, 0.01);
            assert_eq!(normal.correct(&measurement, |i| !i.is_beyond(9.0)), within, "{sigmas}");
        }
    }

    #[test]
    fn an_innovation_knows_its_own_spread() {
        let mut normal = Normal::independent(&[3.0_f64.sqrt()]);
        let innovation = normal.innovation(&measured(&[Part::One(0, 2.0)], 4.0, 4.0));
        assert!((innovation.variance - 16.0).abs() < 1e-14);
        assert_eq!(Innovation { value: 4.0, variance: 16.0 }.sigmas(), 1.0);
        assert_eq!(Innovation { value: 4.0, variance: 16.0 }.nis(), 1.0);
    }
}
