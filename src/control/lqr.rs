//! Linear-quadratic regulator, and the observer gain as its dual.

use nalgebra::{Cholesky, Const, DimMin, SMatrix};

use super::riccati::care;
use crate::error::{Error, Result};

/// Gain `K` of the feedback `u = −K x` that minimises `∫ xᵀQx + uᵀRu dt` for `ẋ = A x + B u`.
///
/// `K = R⁻¹ Bᵀ X` with `X` from [`care`]. Only the ratio of `Q` to `R` matters.
///
/// # Errors
///
/// [`Error::Infeasible`] where `R` is not positive definite, or where no feedback stabilises the
/// system at these weights.
pub fn lqr<const N: usize, const M: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, M>,
    q: &SMatrix<f64, N, N>,
    r: &SMatrix<f64, M, M>,
) -> Result<SMatrix<f64, M, N>>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    let r_inverse = Cholesky::new(*r).map(|r| r.inverse()).ok_or_else(|| Error::Infeasible {
        what: "the weight of the inputs is not positive definite".into(),
        hint: "give every input a weight above zero".into(),
    })?;
    let x = care(a, &(b * r_inverse * b.transpose()), q)?;
    Ok(r_inverse * b.transpose() * x)
}

/// Gain `L` of the observer `x̂̇ = A x̂ + B u − L (C x̂ − y)`: the regulator of the dual system
/// `(Aᵀ, Cᵀ)`, transposed.
///
/// With `model` and `measurement` as the densities of the noise that drives the state and of the
/// noise on the output, it is the stationary Kalman–Bucy filter.
///
/// # Errors
///
/// As [`lqr`], with "seen by an output" for "reached by an input".
pub fn observer_gain<const N: usize, const P: usize>(
    a: &SMatrix<f64, N, N>,
    c: &SMatrix<f64, P, N>,
    model: &SMatrix<f64, N, N>,
    measurement: &SMatrix<f64, P, P>,
) -> Result<SMatrix<f64, N, P>>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    Ok(lqr(&a.transpose(), &c.transpose(), model, measurement)?.transpose())
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix1, Matrix2, SVector, Vector2};
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::control::is_hurwitz;

    /// Closed form for `ẍ = b u`: `k₁ = √(q₁/r)`, `k₂ = √(q₂/r + 2 k₁/b)`.
    fn double_integrator_error(b: f64, q1: f64, q2: f64, r: f64) -> f64 {
        let k = lqr(
            &Matrix2::new(0.0, 1.0, 0.0, 0.0),
            &Vector2::new(0.0, b),
            &Matrix2::from_diagonal(&Vector2::new(q1, q2)),
            &Matrix1::new(r),
        )
        .unwrap();
        let k1 = f64::sqrt(q1 / r);
        let k2 = f64::sqrt(q2 / r + 2.0 * k1 / b);
        (k[0] / k1 - 1.0).abs().max((k[1] / k2 - 1.0).abs())
    }

    #[test]
    fn height_and_yaw_gains_have_their_closed_form() {
        assert!(double_integrator_error(1.0 / 0.0351, 75.0, 1.0, 566.0) < 1e-12, "height");
        assert!(double_integrator_error(1.0 / 3.32e-5, 40.0, 1.0, 38_586_096.0) < 1e-12, "yaw");
    }

    #[test]
    fn random_systems_are_stabilised_with_a_small_residual() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for case in 0..300 {
            let spread = libm::pow(10.0, rng.random_range(-1.0..1.0));
            let mut entry = || rng.random_range(-1.0..1.0);
            let a = SMatrix::<f64, 6, 6>::from_fn(|_, _| spread * entry());
            let b = SMatrix::<f64, 6, 2>::from_fn(|_, _| entry());
            let weight = |e: f64| libm::pow(10.0, e);
            let q = SMatrix::from_diagonal(&SVector::<f64, 6>::from_fn(|_, _| weight(entry())));
            let r = SMatrix::from_diagonal(&Vector2::from_fn(|_, _| weight(entry())));

            let k = lqr(&a, &b, &q, &r).unwrap_or_else(|e| panic!("case {case}: {e}"));
            let closed = a - b * k;
            assert!(is_hurwitz(&closed), "case {case} is unstable");
            // X of the closed loop's Lyapunov equation, from K alone: independent of the solver.
            let x = lyapunov(&closed, &(q + k.transpose() * r * k));
            let again = r.try_inverse().unwrap() * b.transpose() * x;
            assert!((again - k).norm() < 1e-7 * k.norm(), "case {case}: K is no fixed point");
        }
    }

    /// `X` of `AᵀX + XA + Q = 0` by its linear system of N² unknowns.
    fn lyapunov(a: &SMatrix<f64, 6, 6>, q: &SMatrix<f64, 6, 6>) -> SMatrix<f64, 6, 6> {
        let one = SMatrix::<f64, 6, 6>::identity();
        let system = one.kronecker(&a.transpose()) + a.transpose().kronecker(&one);
        let right = -SVector::<f64, 36>::from_column_slice(q.as_slice());
        SMatrix::from_column_slice(system.lu().solve(&right).unwrap().as_slice())
    }

    #[test]
    fn only_the_ratio_of_the_weights_matters() {
        let (a, b) = (Matrix2::new(0.0, 1.0, 2.0, -0.3), Vector2::new(0.0, 1.0));
        let q = Matrix2::new(3.0, 0.5, 0.5, 1.0);
        let k = lqr(&a, &b, &q, &Matrix1::new(2.0)).unwrap();
        let scaled = lqr(&a, &b, &(q * 1e3), &Matrix1::new(2e3)).unwrap();
        assert!((k - scaled).norm() < 1e-13 * k.norm(), "{k} against {scaled}");
    }

    #[test]
    fn an_input_that_costs_nothing_is_refused() {
        let q = Matrix2::identity();
        let refused = lqr(&q, &Vector2::new(0.0, 1.0), &q, &Matrix1::new(0.0));
        assert!(refused.is_err(), "R = 0");
    }

    #[test]
    fn observer_of_a_random_walk_is_the_stationary_kalman_gain() {
        // ẋ = w with density 4, y = x + v with density 9: L = √(4/9).
        let l = observer_gain(
            &Matrix1::new(0.0),
            &Matrix1::new(1.0),
            &Matrix1::new(4.0),
            &Matrix1::new(9.0),
        );
        assert!((l.unwrap()[0] - 2.0 / 3.0).abs() < 1e-15, "√(4/9)");
    }
}
