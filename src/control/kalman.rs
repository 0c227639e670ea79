//! Kalman filter of a linear system with scalar measurements.
//!
//! The prediction is `x ← A x`, `P ← A P Aᵀ + Q`. A measurement `y = hᵀx + noise` of variance `r`
//! has the innovation `ν = y − hᵀx` of variance `s = hᵀPh + r`; the gain is `k = Ph/s`, and
//! `P ← P − k kᵀ s`, in the symmetric form that leaves no rounding on one side of the diagonal.
//! Independent measurements are taken in one after the other, which is the same as at once.
//!
//! Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and
//! Navigation*, Wiley 2001, sections 5.2 and 5.4 (consistency by the normalized innovation squared).

use nalgebra::{SMatrix, SVector};

/// Estimate of a state with its covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct Kalman<const N: usize> {
    /// The estimate.
    pub state: SVector<f64, N>,
    /// Its covariance.
    pub covariance: SMatrix<f64, N, N>,
}

/// A measurement against its prediction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Measured less predicted.
    pub value: f64,
    /// Variance that the filter expects of it.
    pub variance: f64,
}

impl Innovation {
    /// Distance from the prediction in standard deviations.
    #[must_use]
    pub fn sigmas(&self) -> f64 {
        self.value.abs() / self.variance.sqrt()
    }

    /// Normalized innovation squared (NIS): 1 on average where the filter is consistent.
    #[must_use]
    pub fn nis(&self) -> f64 {
        self.value * self.value / self.variance
    }
}

impl<const N: usize> Kalman<N> {
    /// Propagates the estimate by a transition matrix and adds the covariance of the process noise.
    pub fn predict(&mut self, transition: &SMatrix<f64, N, N>, noise: &SMatrix<f64, N, N>) {
        self.state = transition * self.state;
        self.covariance = transition * self.covariance * transition.transpose() + noise;
        self.symmetrize();
    }

    /// The innovation of a measurement `hᵀx` of a variance, without taking it in.
    #[must_use]
    pub fn innovation(&self, h: &SVector<f64, N>, measured: f64, variance: f64) -> Innovation {
        Innovation {
            value: measured - h.dot(&self.state),
            variance: h.dot(&(self.covariance * h)) + variance,
        }
    }

    /// Takes a measurement `hᵀx` in; returns its innovation.
    pub fn update(&mut self, h: &SVector<f64, N>, measured: f64, variance: f64) -> Innovation {
        let innovation = self.innovation(h, measured, variance);
        let gain = self.covariance * h / innovation.variance;
        self.state += gain * innovation.value;
        self.covariance -= gain * gain.transpose() * innovation.variance;
        self.symmetrize();
        innovation
    }

    /// Standard deviation of a state.
    #[must_use]
    pub fn sigma(&self, state: usize) -> f64 {
        self.covariance[(state, state)].max(0.0).sqrt()
    }

    fn symmetrize(&mut self) {
        self.covariance = 0.5 * (self.covariance + self.covariance.transpose());
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    #[test]
    fn a_constant_is_estimated_as_the_weighted_mean_of_its_measurements() {
        let mut filter =
            Kalman { state: SVector::from([0.0]), covariance: SMatrix::from([[1e12]]) };
        let h = SVector::from([1.0]);
        for (measured, variance) in [(2.0, 1.0), (5.0, 0.5), (3.0, 0.25)] {
            filter.update(&h, measured, variance);
        }
        let mean = (2.0 / 1.0 + 5.0 / 0.5 + 3.0 / 0.25) / 7.0;
        assert!((filter.state[0] - mean).abs() < 1e-9, "{}", filter.state[0]);
        assert!((filter.sigma(0) - (1.0_f64 / 7.0).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn a_steady_filter_has_the_covariance_of_the_riccati_equation() {
        // Position and velocity with acceleration noise, position measured.
        let (t, q, r) = (0.1, 0.04, 0.0025);
        let transition = Matrix2::new(1.0, t, 0.0, 1.0);
        let noise = Matrix2::new(t * t * t / 3.0, t * t / 2.0, t * t / 2.0, t) * q;
        let mut filter = Kalman { state: Vector2::zeros(), covariance: Matrix2::identity() };
        let h = Vector2::new(1.0, 0.0);
        for _ in 0..2000 {
            filter.predict(&transition, &noise);
            filter.update(&h, 0.0, r);
        }
        let p = filter.covariance;
        let predicted = transition * p * transition.transpose() + noise;
        let gain = predicted * h / (predicted[(0, 0)] + r);
        let residual = predicted - gain * h.transpose() * predicted - p;
        assert!(residual.norm() < 1e-12 && p[(0, 0)] < r, "{residual}");
    }

    #[test]
    fn an_innovation_knows_its_own_spread() {
        let filter = Kalman { state: SVector::from([1.0]), covariance: SMatrix::from([[3.0]]) };
        let innovation = filter.innovation(&SVector::from([2.0]), 6.0, 4.0);
        assert_eq!(innovation, Innovation { value: 4.0, variance: 16.0 });
        assert_eq!((innovation.sigmas(), innovation.nis()), (1.0, 1.0));
    }
}
