//! Gains of the linear-quadratic regulator and, by duality, of the observer.

use super::Matrix;
use super::riccati::care;
use noctograph_core::error::{Error, Result};

/// Returns the gain `K` of `u = −K x` that minimizes `∫ xᵀQx + uᵀRu dt` for `ẋ = A x + B u`.
///
/// `K = R⁻¹ Bᵀ X` with the solution `X` of the continuous algebraic Riccati equation. Only the
/// ratio of `Q` to `R` affects the gain.
///
/// # Errors
///
/// Returns [`Error::Infeasible`] if `R` is not positive definite, or if no feedback stabilizes the
/// system at these weights.
pub fn lqr(a: &Matrix, b: &Matrix, q: &Matrix, r: &Matrix) -> Result<Matrix> {
    let r_inverse = r.clone().cholesky().map(|r| r.inverse()).ok_or_else(|| {
        Error::infeasible(
            "the weight of the inputs is not positive definite",
            "give every input a weight above zero",
        )
    })?;
    let x = care(a, &(b * &r_inverse * b.transpose()), q)?;
    Ok(r_inverse * b.transpose() * x)
}

/// Returns the gain `L` of the observer `x̂̇ = A x̂ + B u − L (C x̂ − y)`, which is the transposed
/// gain of the regulator for the dual system `(Aᵀ, Cᵀ)`.
///
/// If `model` and `measurement` are the noise densities of the state and of the output,
/// respectively, the observer is the stationary Kalman–Bucy filter.
///
/// # Errors
///
/// Returns the errors of [`lqr`], which here concern unobservable instead of uncontrollable states.
pub fn observer_gain(
    a: &Matrix,
    c: &Matrix,
    model: &Matrix,
    measurement: &Matrix,
) -> Result<Matrix> {
    Ok(lqr(&a.transpose(), &c.transpose(), model, measurement)?.transpose())
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::control::is_hurwitz;

    /// Returns the error relative to `k₁ = √(q₁/r)`, `k₂ = √(q₂/r + 2 k₁/b)` for `ẍ = b u`.
    fn double_integrator_error(b: f64, q1: f64, q2: f64, r: f64) -> f64 {
        let k = lqr(
            &dmatrix![0.0, 1.0; 0.0, 0.0],
            &dmatrix![0.0; b],
            &DMatrix::from_diagonal(&DVector::from_row_slice(&[q1, q2])),
            &dmatrix![r],
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

    /// Returns the matrices of the reference flight's hover, and its weights, as numbers.
    fn hover() -> [DMatrix<f64>; 4] {
        let (mut a, mut b) = (DMatrix::zeros(12, 12), DMatrix::zeros(12, 4));
        let ones = [(0, 6), (1, 7), (2, 8), (3, 11), (4, 10), (5, 9)];
        ones.iter().for_each(|&entry| a[entry] = 1.0);
        (a[(6, 4)], a[(7, 5)]) = (9.81, -9.81);
        (b[(9, 0)], b[(10, 1)]) = (1.0 / 1.24e-5, 1.0 / 1.27e-5);
        (b[(11, 2)], b[(8, 3)]) = (1.0 / 3.32e-5, 1.0 / 0.0351);
        let q = [120.0, 80.0, 75.0, 40.0, 0.01, 0.01, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
        let r = DVector::from_row_slice(&[5_045_605.0, 5_045_605.0, 38_586_096.0, 566.0]);
        [a, b, DMatrix::from_diagonal(&q.to_vec().into()), DMatrix::from_diagonal(&r)]
    }

    /// Returns the largest error of a gain in any row, relative to the row.
    fn row_error(k: &DMatrix<f64>, want: &DMatrix<f64>) -> f64 {
        let rows = (0..k.nrows()).map(|i| (k.row(i) - want.row(i)).norm() / want.row(i).norm());
        rows.fold(0.0, f64::max)
    }

    /// The reference is a Newton–Kleinman iteration with 60 digits (Lyapunov equation by Kronecker
    /// product and LU) in mpmath 1.4.1, Python 3.11. It starts from the result of SciPy 1.17.1 and
    /// ends at a step below 1e-50 of X: `K = R**-1 * B.T * X`, `mp.nstr(K[i, j], 20)`.
    #[test]
    fn gain_of_the_hovering_drone_is_that_of_sixty_digits() {
        let [a, b, q, r] = hover();
        let mut want = DMatrix::zeros(4, 12);
        for (row, column, value) in [
            (0, 1, -0.003_981_881_847_969_638),
            (0, 5, 0.004_536_141_188_156_048_4),
            (0, 7, -0.001_969_932_572_065_766),
            (0, 9, 0.000_557_394_464_994_178_2),
            (1, 0, 0.004_876_789_371_788_077),
            (1, 4, 0.004_879_601_079_133_153),
            (1, 6, 0.002_247_160_167_516_467),
            (1, 10, 0.000_567_568_635_100_512_1),
            (2, 3, 0.001_018_156_587_328_857_4),
            (2, 11, 0.000_305_813_126_445_979_7),
            (3, 2, 0.364_017_628_587_217_6),
            (3, 8, 0.165_290_114_583_781_13),
        ] {
            want[(row, column)] = value;
        }
        let error = row_error(&lqr(&a, &b, &q, &r).unwrap(), &want);
        assert!(error < 1e-14, "worst row {error:e}; SciPy's own solver is off by 1.5e-12");
    }

    /// The system is dense and consists of whole numbers. Its reference is computed as for the
    /// hovering drone, and the other gain is from SciPy 1.17.1: `solve_continuous_are(A, B, Q, R)`.
    #[test]
    fn gain_of_a_dense_system_is_that_of_sixty_digits_and_of_scipy() {
        let a =
            DMatrix::from_fn(6, 6, |i, j| (((7 * i + 5 * j + 3 * i * j) % 11) as f64 - 5.0) / 4.0);
        let b =
            DMatrix::from_fn(6, 2, |i, j| (((3 * i + 4 * j + 2 * i * j) % 7) as f64 - 3.0) / 2.0);
        let q = DMatrix::from_diagonal(&DVector::from_fn(6, |i, _| (i + 1) as f64));
        let k = lqr(&a, &b, &q, &DMatrix::from_diagonal(&DVector::from_row_slice(&[2.0, 0.5])))
            .unwrap();
        fn gain(rows: &str) -> DMatrix<f64> {
            let entries = rows.split_whitespace().map(|entry| entry.parse().unwrap());
            DMatrix::from_row_iterator(2, 6, entries)
        }
        let sixty_digits = gain(
            "0.15917714099551426 0.21342394716495166 -0.34282669647457517 -2.1686462520131775 \
             4.900163300871512 -0.7728411341269389 1.4159312179084196 2.68216444921646 \
             -1.697787632719335 2.3326027836599747 -0.8708393345844223 -3.0729650973196634",
        );
        let scipy = gain(
            "0.15917714099551034 0.2134239471649415 -0.3428266964745623 -2.1686462520131577 \
             4.90016330087146 -0.7728411341269364 1.4159312179084211 2.682164449216458 \
             -1.6977876327193275 2.3326027836599805 -0.8708393345844239 -3.072965097319664",
        );
        let (exact, other) = (row_error(&k, &sixty_digits), row_error(&k, &scipy));
        assert!(exact < 1e-12, "worst row {exact:e}");
        assert!(other < 1e-10, "worst row {other:e} against SciPy");
    }

    /// Returns the residual of the Riccati equation relative to its terms.
    fn residual(x: &DMatrix<f64>, [a, g, q]: [&DMatrix<f64>; 3]) -> f64 {
        let (linear, quadratic) = (a.transpose() * x, x * g * x);
        let left = &linear + linear.transpose() - &quadratic + q;
        left.norm() / (q.norm() + 2.0 * linear.norm() + quadratic.norm())
    }

    #[test]
    fn a_thousand_hovering_drones_with_weights_six_decades_apart_are_solved() {
        let [a, b, q, r] = hover();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for case in 0..1000 {
            let mut by = || libm::pow(10.0, rng.random_range(-3.0..3.0));
            let q = DMatrix::from_diagonal(&q.diagonal().map(|q| q * by()));
            let r_inverse = DMatrix::from_diagonal(&r.diagonal().map(|r| by() / r));
            let g = &b * r_inverse * b.transpose();
            let x = care(&a, &g, &q).unwrap_or_else(|e| panic!("case {case}: {e}"));
            let residual = residual(&x, [&a, &g, &q]);
            assert!(residual < 1e-10, "case {case}: residual {residual:e}");
        }
    }

    #[test]
    fn a_thousand_random_systems_are_solved() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for case in 0..1000 {
            let mut entry = || rng.random_range(-1.0..1.0);
            let spread = libm::pow(10.0, entry());
            let a = DMatrix::from_fn(12, 12, |_, _| spread * entry());
            let b = DMatrix::from_fn(12, 4, |_, _| entry());
            let q = DMatrix::from_fn(12, 12, |_, _| entry());
            let q = &q * q.transpose() + DMatrix::identity(12, 12) * 0.1;
            let r = DVector::from_fn(4, |_, _| libm::pow(10.0, entry()));
            let g = &b * DMatrix::from_diagonal(&r.map(|r| 1.0 / r)) * b.transpose();
            let x = care(&a, &g, &q).unwrap_or_else(|e| panic!("case {case}: {e}"));
            let residual = residual(&x, [&a, &g, &q]);
            assert!(residual < 1e-10, "case {case}: residual {residual:e}");
        }
    }

    #[test]
    fn the_gain_follows_from_the_closed_loop_alone() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for case in 0..300 {
            let spread = libm::pow(10.0, rng.random_range(-1.0..1.0));
            let mut entry = || rng.random_range(-1.0..1.0);
            let a = DMatrix::from_fn(6, 6, |_, _| spread * entry());
            let b = DMatrix::from_fn(6, 2, |_, _| entry());
            let weight = |e: f64| libm::pow(10.0, e);
            let q = DMatrix::from_diagonal(&DVector::from_fn(6, |_, _| weight(entry())));
            let r = DMatrix::from_diagonal(&DVector::from_fn(2, |_, _| weight(entry())));

            let k = lqr(&a, &b, &q, &r).unwrap_or_else(|e| panic!("case {case}: {e}"));
            let closed = &a - &b * &k;
            assert!(is_hurwitz(&closed), "case {case} is unstable");
            // The X of the closed loop's Lyapunov equation depends only on K, not on the solver.
            let x = lyapunov(&closed, &(q + k.transpose() * &r * &k));
            let again = r.try_inverse().unwrap() * b.transpose() * x;
            assert!((again - &k).norm() < 1e-7 * k.norm(), "case {case}: K is no fixed point");
        }
    }

    /// Returns `X` of `AᵀX + XA + Q = 0` by solving a linear system with N² unknowns.
    fn lyapunov(a: &DMatrix<f64>, q: &DMatrix<f64>) -> DMatrix<f64> {
        let one = DMatrix::<f64>::identity(6, 6);
        let system = one.kronecker(&a.transpose()) + a.transpose().kronecker(&one);
        let right = -DVector::from_column_slice(q.as_slice());
        DMatrix::from_column_slice(6, 6, system.lu().solve(&right).unwrap().as_slice())
    }

    #[test]
    fn only_the_ratio_of_the_weights_matters() {
        let (a, b) = (dmatrix![0.0, 1.0; 2.0, -0.3], dmatrix![0.0; 1.0]);
        let q = dmatrix![3.0, 0.5; 0.5, 1.0];
        let k = lqr(&a, &b, &q, &dmatrix![2.0]).unwrap();
        let scaled = lqr(&a, &b, &(q * 1e3), &dmatrix![2e3]).unwrap();
        assert!((&k - &scaled).norm() < 1e-13 * k.norm(), "{k} against {scaled}");
    }

    #[test]
    fn an_input_that_costs_nothing_is_refused() {
        let q = DMatrix::identity(2, 2);
        let refused = lqr(&q, &dmatrix![0.0; 1.0], &q, &dmatrix![0.0]);
        assert!(refused.is_err(), "R = 0");
    }

    #[test]
    fn observer_of_a_random_walk_is_the_stationary_kalman_gain() {
        // For ẋ = w with density 4 and y = x + v with density 9, the gain is L = √(4/9).
        let l = observer_gain(&dmatrix![0.0], &dmatrix![1.0], &dmatrix![4.0], &dmatrix![9.0]);
        assert!((l.unwrap()[0] - 2.0 / 3.0).abs() < 1e-15, "√(4/9)");
    }
}
