//! Solution of the continuous algebraic Riccati equation by structured doubling.

use nalgebra::Cholesky;

use super::Matrix;
use super::linear::{block_matrix, is_hurwitz};
use noctograph_core::error::{Error, Result};

/// Maximum number of doublings. Each doubling squares the error, so a solvable problem takes 7 to
/// 15 doublings. Only a closed loop with a pole within 1e-12 of the stability boundary takes more.
const MAX_DOUBLINGS: usize = 60;
/// Relative change of the solution at which the doubling has converged, which is a few units in the
/// last place. A smaller value would be lost in rounding noise.
const CONVERGED: f64 = 1e-15;
/// Maximum residual of an accepted solution, relative to the terms `‖Q‖ + 2‖A‖‖X‖ + ‖X‖‖GX‖`. The
/// rounding of `X` itself causes 1e-16, and well-posed problems leave 1e-12 or less.
const MAX_RESIDUAL: f64 = 1e-10;
/// Residual relative to the terms (`‖Q‖ + ‖XGX‖`) above which a solution is refined. The reference
/// flight's problem leaves 1e-15, and a problem whose weights differ by six decades leaves up to
/// 1e-5.
const REFINED_FROM: f64 = 1e-13;
/// Maximum number of refinement steps. Each step squares the error, so only rounding remains after
/// two.
const MAX_REFINEMENTS: usize = 2;
/// Maximum number of shifts of the Cayley transform that are tried, each [`SHIFT_GROWTH`] times the
/// previous one. A second shift is needed only if the first is an eigenvalue of `A`.
const MAX_SHIFTS: usize = 8;
const SHIFT_GROWTH: f64 = 1.3;
/// Shift of the Lyapunov equation's Cayley transform, relative to the norm of `A`. Any positive
/// shift is exact. A shift near the poles takes the fewest doublings.
const LYAPUNOV_SHIFT: f64 = 0.25;

/// Returns the stabilizing solution `X` of `AᵀX + XA − XGX + Q = 0`, where `G = B R⁻¹ Bᵀ`.
///
/// `G` and `Q` must be symmetric and positive semidefinite. The solution is accepted only if its
/// residual is below 1e-10 of the equation's terms, if it is positive definite, and if `A − GX` is
/// stable. There is no solution if an uncontrollable mode is unstable, or if a mode has no cost.
/// For the reference flight's problem, `X` agrees with a 50-digit solution to within 1e-15.
pub(super) fn care(a: &Matrix, g: &Matrix, q: &Matrix) -> Result<Matrix> {
    // For each shift, the equation is transformed, solved by doubling, refined and checked. A shift
    // that is an eigenvalue of A fails, and the next one is tried.
    let mut shift = mean_pole(a, g, q);
    for _ in 0..MAX_SHIFTS {
        let x = through_cayley(a, g, q, shift).map(|x| refined(x, a, g, q));
        if let Some(x) = x.filter(|x| solves_care(x, a, g, q)) {
            return Ok(x);
        }
        shift *= SHIFT_GROWTH;
    }
    Err(no_solution())
}

/// Returns the stabilizing solution `X` of the discrete equation `X = Q + AᵀX (I + GX)⁻¹ A`, by
/// structure-preserving doubling (Chu, Fan, Lin, Wang 2004). `h` is `Q` at the start. Returns
/// `None` without convergence.
fn doubling(mut a: Matrix, mut g: Matrix, mut h: Matrix) -> Option<Matrix> {
    for _ in 0..MAX_DOUBLINGS {
        // Each pass doubles the horizon with W = I + G H, H ← H + Aᵀ H W⁻¹ A, G ← G + A W⁻¹ G Aᵀ, A
        // ← A W⁻¹ A. H increases to X as A vanishes.
        let w = (one_like(&a) + &g * &h).lu();
        let (w_a, w_g) = (w.solve(&a)?, w.solve(&g)?);
        let next = symmetric(&h + a.transpose() * &h * &w_a);
        g = symmetric(&g + &a * w_g * a.transpose());
        a *= w_a;
        let change = (&next - &h).norm() / next.norm();
        h = next;
        if !change.is_finite() {
            return None;
        }
        if change < CONVERGED {
            return Some(h);
        }
    }
    None
}

/// Solves the continuous equation as a discrete equation, because `z = (s + shift) / (s − shift)`
/// maps the left half-plane to the unit disc and preserves the solution. Returns `None` if the
/// shift does not work.
fn through_cayley(a: &Matrix, g: &Matrix, q: &Matrix, shift: f64) -> Option<Matrix> {
    let shifted = a - one_like(a) * shift;
    let w = shifted.transpose();
    let a_inverse = shifted.try_inverse()?;
    let w_inverse = (w + q * &a_inverse * g).try_inverse()?;
    doubling(
        one_like(a) + w_inverse.transpose() * (2.0 * shift),
        symmetric(&a_inverse * g * &w_inverse * (2.0 * shift)),
        symmetric(&w_inverse * q * &a_inverse * (2.0 * shift)),
    )
}

/// Returns the geometric mean of the magnitudes in 1/s of the closed loop's poles, `|det
/// H|^(1/2n)`. The spectrum of the Hamiltonian matrix H is that of the closed loop and its mirror
/// image. As the shift of the Cayley transform, this mean gives the best-conditioned problem.
fn mean_pole(a: &Matrix, g: &Matrix, q: &Matrix) -> f64 {
    let hamiltonian = block_matrix(a, &-g, &-q, &-a.transpose());
    let pivots = hamiltonian.lu().u().diagonal();
    // Logarithms are summed, because the determinant of a large matrix overflows.
    let n = pivots.len() as f64;
    libm::exp(pivots.iter().map(|pivot| libm::log(pivot.abs())).sum::<f64>() / n)
}

/// Refines a solution by Newton's method (Kleinman 1968), which adds the `D` of `A_cᵀ D + D A_c +
/// residual = 0` with `A_c = A − GX` while the residual exceeds rounding errors.
fn refined(mut x: Matrix, a: &Matrix, g: &Matrix, q: &Matrix) -> Matrix {
    for _ in 0..MAX_REFINEMENTS {
        let quadratic = &x * g * &x;
        let residual = symmetric(a.transpose() * &x + &x * a - &quadratic + q);
        if residual.norm() <= REFINED_FROM * (q.norm() + quadratic.norm()) {
            break;
        }
        let Some(added) = lyapunov(&(a - g * &x), &residual) else { break };
        x += added;
    }
    x
}

/// Returns the solution `X` of the Lyapunov equation `AᵀX + XA + Q = 0`, or `None` if `A` is not
/// stable. The Cayley transform converts the equation to the sum `Σ Fᵀᵏ H Fᵏ`, whose number of
/// terms doubles with every squaring of `F` (Smith 1968).
fn lyapunov(a: &Matrix, q: &Matrix) -> Option<Matrix> {
    // The matrices are F = (A + σ)(A − σ)⁻¹ and H = 2σ (A − σ)⁻ᵀ Q (A − σ)⁻¹. If X_k contains the
    // first 2ᵏ terms of the sum, X_{k+1} = X_k + F_kᵀ X_k F_k, and F_{k+1} = F_k².
    let shift = one_like(a) * (a.norm() * LYAPUNOV_SHIFT);
    let inverse = (a - &shift).try_inverse()?;
    let mut f = (a + &shift) * &inverse;
    let mut x = symmetric(inverse.transpose() * q * &inverse * (2.0 * shift[0]));
    for _ in 0..MAX_DOUBLINGS {
        let added = f.transpose() * &x * &f;
        x = symmetric(&x + &added);
        let (change, size) = (added.norm(), x.norm());
        if !size.is_finite() {
            return None;
        }
        if change <= CONVERGED * size {
            return Some(x);
        }
        f = &f * &f;
    }
    None
}

/// True if `X` is the stabilizing solution of the continuous equation, as [`care`] requires.
fn solves_care(x: &Matrix, a: &Matrix, g: &Matrix, q: &Matrix) -> bool {
    let g_x = g * x;
    let residual = a.transpose() * x + x * a - x * &g_x + q;
    let size = q.norm() + x.norm() * (2.0 * a.norm() + g_x.norm());
    residual.norm() < MAX_RESIDUAL * size
        && Cholesky::new(x.clone()).is_some()
        && is_hurwitz(&(a - g_x))
}

/// Returns the symmetric part of a matrix.
fn symmetric(m: Matrix) -> Matrix {
    let transpose = m.transpose();
    (m + transpose) * 0.5
}

/// Returns the identity matrix of the same size.
fn one_like(m: &Matrix) -> Matrix {
    Matrix::identity(m.nrows(), m.ncols())
}

/// Creates the error for an equation without a solution that [`solves_care`] accepts.
fn no_solution() -> Error {
    Error::infeasible(
        "the Riccati equation has no stabilizing, positive definite solution",
        "give every state a weight above zero, and keep the weights within a few powers of \
               ten of one another",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scalar_continuous_equation_has_its_textbook_root() {
        // The root of 2 a x − g x² + q = 0 must make a − g x negative.
        let (a, g, q) = (0.7, 2.0, 3.0);
        let x = care(&dmatrix![a], &dmatrix![g], &dmatrix![q]).unwrap()[0];
        let root = (a + f64::sqrt(a * a + g * q)) / g;
        assert!((x - root).abs() < 1e-15 * root, "{x} against {root}");
    }

    #[test]
    fn an_unreachable_unstable_mode_is_refused() {
        let a = dmatrix![-1.0, 0.0; 0.0, 0.5];
        let g = dmatrix![1.0, 0.0; 0.0, 0.0];
        assert!(care(&a, &g, &Matrix::identity(2, 2)).is_err(), "pole at 0.5 stays");
    }

    #[test]
    fn a_state_without_cost_is_refused() {
        let a = Matrix::identity(2, 2) * -0.5;
        let (g, q) = (Matrix::identity(2, 2), dmatrix![1.0, 0.0; 0.0, 0.0]);
        assert!(care(&a, &g, &q).is_err(), "X = diag(x, 0)");
        assert!(care(&a, &g, &Matrix::zeros(2, 2)).is_err(), "X = 0");
    }

    #[test]
    fn of_two_positive_roots_only_the_stabilizing_one_is_accepted() {
        // The equation 2 x − x² − 1/2 = 0 has the roots 1 ± √½.
        let (one, q) = (dmatrix![1.0], dmatrix![-0.5]);
        let accepted = |x| solves_care(&dmatrix![x], &one, &one, &q);
        assert!(accepted(1.0 + f64::sqrt(0.5)), "closed loop −√½");
        assert!(!accepted(1.0 - f64::sqrt(0.5)), "closed loop +√½");
        assert!(!accepted(2.0), "no root");
    }

    #[test]
    fn a_shift_on_an_eigenvalue_is_moved() {
        // The closed loop has the poles −0.5 and −2, whose mean 1 is an eigenvalue of A.
        let a = dmatrix![0.0, 0.0; 0.0, 1.0];
        let (g, q) = (Matrix::identity(2, 2), dmatrix![0.25, 0.0; 0.0, 3.0]);
        assert!(through_cayley(&a, &g, &q, mean_pole(&a, &g, &q)).is_none(), "singular there");
        let x = care(&a, &g, &q).unwrap();
        assert!((&x - dmatrix![0.5, 0.0; 0.0, 3.0]).norm() < 1e-14, "a + √(a² + q): {x}");
    }
}
