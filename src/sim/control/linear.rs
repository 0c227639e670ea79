//! Linearization of models, and stability and observability of linear models.

use nalgebra::{SMatrix, SVector};

use super::Matrix;

/// Step of the central differences, relative to `max(1, |x|)`. The error is proportional to the
/// square of the step (for a sine, 1.7e-9 of the slope). At a hundredth of this step, rounding
/// would cause as large an error.
const STEP: f64 = 1e-4;
/// Smaller of the two steps for the extrapolation. The error is proportional to its fourth power.
const FINE_STEP: f64 = 1e-3;
/// Ratio of a pivot to the largest pivot below which a direction counts as unobservable.
const RANK_TOLERANCE: f64 = 1e-9;
/// Maximum number of squarings, after which a system whose powers do not vanish counts as unstable.
/// Only a pole within 1e-17 of the stability boundary, relative to the largest, needs this many.
const MAX_SQUARINGS: usize = 60;

/// Returns the linear model `(A, B)` of `ẋ = f(x, u)` at a point, `A = ∂f/∂x` and `B = ∂f/∂u`, by
/// central differences with a step of 1e-4 (relative above 1).
pub fn linearize<const N: usize, const M: usize>(
    f: impl Fn(&SVector<f64, N>, &SVector<f64, M>) -> SVector<f64, N>,
    x: &SVector<f64, N>,
    u: &SVector<f64, M>,
) -> (SMatrix<f64, N, N>, SMatrix<f64, N, M>) {
    (jacobian(|x| f(x, u), x, STEP), jacobian(|u| f(x, u), u, STEP))
}

/// Returns the linear model `(A, B)` as [`linearize`] does, but with Richardson's extrapolation
/// from two steps, which is exact to 1e-12. It is used for printed numbers and comparisons. A
/// flight does not need this accuracy.
pub fn linearize_finely<const N: usize, const M: usize>(
    f: impl Fn(&SVector<f64, N>, &SVector<f64, M>) -> SVector<f64, N>,
    x: &SVector<f64, N>,
    u: &SVector<f64, M>,
) -> (SMatrix<f64, N, N>, SMatrix<f64, N, M>) {
    // With the central difference D(h), (4 D(h) − D(2h)) / 3 cancels the error in h².
    let [h, h2] = [FINE_STEP, 2.0 * FINE_STEP];
    let a = jacobian(|x| f(x, u), x, h) * 4.0 - jacobian(|x| f(x, u), x, h2);
    let b = jacobian(|u| f(x, u), u, h) * 4.0 - jacobian(|u| f(x, u), u, h2);
    (a / 3.0, b / 3.0)
}

/// Returns the Jacobian of `f` by central differences. `step` is relative to the larger of 1 and
/// the argument's magnitude.
fn jacobian<const N: usize, const M: usize>(
    f: impl Fn(&SVector<f64, M>) -> SVector<f64, N>,
    point: &SVector<f64, M>,
    step: f64,
) -> SMatrix<f64, N, M> {
    let mut jacobian = SMatrix::<f64, N, M>::zeros();
    for i in 0..M {
        let (mut up, mut down) = (*point, *point);
        up[i] += step * point[i].abs().max(1.0);
        down[i] -= step * point[i].abs().max(1.0);
        // The divisor is the difference between the rounded arguments instead of twice the step.
        jacobian.set_column(i, &((f(&up) - f(&down)) / (up[i] - down[i])));
    }
    jacobian
}

/// Converts a matrix of static size to one of dynamic size.
pub fn dynamic<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> Matrix {
    Matrix::from_column_slice(R, C, m.as_slice())
}

/// Returns the block matrix `[A B; C D]` with square blocks `A` and `D`.
pub(crate) fn block_matrix(a: &Matrix, b: &Matrix, c: &Matrix, d: &Matrix) -> Matrix {
    let (n, m) = (a.nrows(), d.nrows());
    let mut joined = a.clone().resize(n + m, n + m, 0.0);
    joined.view_mut((0, n), (n, m)).copy_from(b);
    joined.view_mut((n, 0), (m, n)).copy_from(c);
    joined.view_mut((n, n), (m, m)).copy_from(d);
    joined
}

/// Returns the rank of `[C; CA; CA²; …]` (Kalman), the number of observable directions of `ẋ = A
/// x`, `y = C x`. If this rank equals the number of states, the system is observable.
pub fn observability_rank(a: &Matrix, c: &Matrix) -> usize {
    rank(observability_columns(a, c))
}

/// Returns the transposed observability matrix, `[Cᵀ AᵀCᵀ (A²)ᵀCᵀ …]`. The scale of its columns is
/// arbitrary, so it serves only to determine ranks.
fn observability_columns(a: &Matrix, c: &Matrix) -> Matrix {
    let (n, p) = (a.nrows(), c.nrows());
    // Time is scaled so that the powers of A neither grow nor shrink much. A zero matrix stays
    // zero.
    let scaled = a / a.norm().max(f64::MIN_POSITIVE);
    let mut columns = Matrix::zeros(n, n * p);
    let mut block = c.clone();
    for power in 0..n {
        columns.columns_mut(power * p, p).copy_from(&block.transpose());
        block *= &scaled;
    }
    columns
}

/// Returns the rank of a matrix with no more rows than columns, by LU with full pivoting.
fn rank(columns: Matrix) -> usize {
    let n = columns.nrows();
    let upper = columns.full_piv_lu().u();
    let pivots = upper.view((0, 0), (n, n)).diagonal().abs();
    pivots.iter().filter(|pivot| **pivot > RANK_TOLERANCE * pivots.max()).count()
}

/// True if every eigenvalue of `A` has a negative real part, so that `ẋ = A x` decays. A pole on
/// the stability boundary and a matrix that is not finite count as unstable.
pub fn is_hurwitz(a: &Matrix) -> bool {
    // The Cayley transform (1 + A)(1 − A)⁻¹ maps the left half-plane to the unit disc. Its powers
    // vanish exactly if all eigenvalues are inside, which repeated squaring reveals. Powers whose
    // norm is less than 1, with a margin for rounding, can only decrease further. A zero matrix,
    // scaled to NaN, is unstable.
    let scaled = a / a.norm();
    let one = Matrix::identity(a.nrows(), a.ncols());
    let Some(inverse) = (&one - &scaled).try_inverse() else {
        return false;
    };
    let mut power = (one + scaled) * inverse;
    for _ in 0..MAX_SQUARINGS {
        power = &power * &power;
        let size = power.norm();
        if size < 0.5 {
            return true;
        }
        if !size.is_finite() {
            return false;
        }
    }
    false
}

/// Returns the indices of the unobservable states of `ẋ = A x`, `y = C x`, which are not a
/// combination of the rows of `[C; CA; CA²; …]`.
pub fn unobservable_states(a: &Matrix, c: &Matrix) -> Vec<usize> {
    let columns = observability_columns(a, c);
    let observable = rank(columns.clone());
    let (last, size) = (columns.ncols(), columns.norm().max(f64::MIN_POSITIVE));
    // A state is unobservable if an additional measurement of it would increase the rank.
    let unobservable = (0..a.nrows()).filter(|&state| {
        let mut augmented = columns.clone().insert_column(last, 0.0);
        augmented[(state, last)] = size;
        rank(augmented) > observable
    });
    unobservable.collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector1, Vector2};

    use super::*;

    #[test]
    fn pendulum_linearizes_to_its_known_matrices() {
        fn pendulum(x: &Vector2<f64>, u: &Vector1<f64>) -> Vector2<f64> {
            Vector2::new(x[1], -9.81 * libm::sin(x[0]) + 3.0 * u[0])
        }
        let (a, b) = linearize(pendulum, &Vector2::new(0.3, 0.0), &Vector1::new(2.0));
        let want = Matrix2::new(0.0, 1.0, -9.81 * libm::cos(0.3), 0.0);
        assert!((a - want).norm() < 2e-8, "A = {a}");
        assert!((b - Vector2::new(0.0, 3.0)).norm() < 1e-10, "B = {b}");
        let (a, b) = linearize_finely(pendulum, &Vector2::new(0.3, 0.0), &Vector1::new(2.0));
        assert!((a - want).norm() < 1e-11, "A = {a}");
        assert!((b - Vector2::new(0.0, 3.0)).norm() < 1e-11, "B = {b}");
    }

    #[test]
    fn position_shows_velocity_but_velocity_hides_position() {
        let a = dmatrix![0.0, 1.0; 0.0, 0.0];
        assert_eq!(observability_rank(&a, &dmatrix![1.0, 0.0]), 2);
        assert_eq!(observability_rank(&a, &dmatrix![0.0, 1.0]), 1);
        assert_eq!(observability_rank(&Matrix::zeros(2, 2), &dmatrix![0.0, 1.0]), 1);
    }

    #[test]
    fn the_state_that_no_output_shows_is_named() {
        let a = dmatrix![0.0, 1.0; 0.0, 0.0];
        assert_eq!(unobservable_states(&a, &dmatrix![1.0, 0.0]), [] as [usize; 0]);
        assert_eq!(unobservable_states(&a, &dmatrix![0.0, 1.0]), [0]);
    }

    #[test]
    fn stability_is_the_sign_of_the_slowest_pole() {
        let with_pole = |pole: f64| dmatrix![-3.0, 100.0; 0.0, pole];
        assert!(is_hurwitz(&with_pole(-1e-6)), "slow but stable");
        assert!(!is_hurwitz(&with_pole(1e-6)), "slowly unstable");
        assert!(!is_hurwitz(&with_pole(0.0)), "on the border");
        assert!(!is_hurwitz(&with_pole(f64::NAN)), "not finite");
        assert!(is_hurwitz(&dmatrix![-0.01, 5.0; -5.0, -0.01]), "a damped oscillator");
        assert!(!is_hurwitz(&dmatrix![0.01, 5.0; -5.0, 0.01]), "a growing oscillator");
    }
}
