//! Poles of a linear system.

use nalgebra::{Complex, Schur};

use super::Matrix;

/// Maximum number of QR iterations. A closed loop of 20 states takes about 60 iterations. The
/// iteration in `nalgebra` has no exceptional shifts and may not end on symmetric spectra (#611,
/// #764).
const MAX_ITERATIONS: usize = 10_000;
/// Units in the last place up to which an entry below the diagonal counts as zero. A fourfold pole,
/// such as that of four equal rotors, converges to within one to sixteen units.
const TOLERANCES: [f64; 3] = [1.0, 16.0, 256.0];

/// Returns the eigenvalues of `A` (1/s) by descending real part, then by descending imaginary part.
///
/// Returns `None` if the QR iteration does not converge or the matrix is not finite. Well-separated
/// poles are accurate to 1e-9 of the largest. An n-fold pole spreads by the n-th root of the
/// rounding error.
pub fn poles(a: &Matrix) -> Option<Vec<Complex<f64>>> {
    if !a.iter().all(|entry| entry.is_finite()) {
        return None;
    }
    // The strictest tolerance at which the iteration converges is used.
    let schur = TOLERANCES
        .into_iter()
        .find_map(|ulps| Schur::try_new(a.clone(), ulps * f64::EPSILON, MAX_ITERATIONS))?;
    let mut poles: Vec<_> = schur.complex_eigenvalues().iter().copied().collect();
    poles.sort_by(|p, q| q.re.total_cmp(&p.re).then(q.im.total_cmp(&p.im)));
    Some(poles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poles_of_an_oscillator_and_of_a_triangle_are_known() {
        // The poles of ẍ + 2 ẋ + 5 x = 0 are −1 ± 2i.
        let actual = poles(&dmatrix![0.0, 1.0; -5.0, -2.0]).unwrap();
        assert!((actual[0] - Complex::new(-1.0, 2.0)).norm_sqr() < 1e-28, "{actual:?}");
        assert!((actual[1] - Complex::new(-1.0, -2.0)).norm_sqr() < 1e-28, "{actual:?}");
        let triangle = dmatrix![-3.0, 7.0, 1.0; 0.0, 0.5, 9.0; 0.0, 0.0, -0.1];
        let real: Vec<f64> = poles(&triangle).unwrap().iter().map(|p| p.re).collect();
        assert_eq!(real, [0.5, -0.1, -3.0]);
    }

    #[test]
    fn what_is_not_finite_has_no_poles() {
        assert_eq!(poles(&dmatrix![0.0, f64::NAN; 1.0, 0.0]), None);
    }
}
