//! Gain and phase margins of a feedback loop, and models with input lag.

use std::f64::consts::PI;

use nalgebra::{Complex, DVector};

use super::Matrix;
use super::linear::{block_matrix, is_hurwitz};

/// Lowest and highest frequency of the sweep in rad/s, far beyond a drone's crossovers.
const SWEEP_RAD_S: [f64; 2] = [1e-3, 1e4];
/// Number of steps of the sweep. Only two crossings within a step of 0.4 % are missed.
const SWEEP_STEPS: u32 = 4000;
/// Number of bisections of the step around a crossing. They reduce its width from 0.4 % to 4e-12.
const HALVINGS: u32 = 30;

/// Margins of one loop, which is opened at its input while the other loops stay closed.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Margins {
    /// Largest factor above 1 on the input up to which the loop is stable, or `None` if unlimited.
    pub gain_up: Option<f64>,
    /// Smallest factor below 1 down to which the loop is stable, or `None` if there is no limit.
    pub gain_down: Option<f64>,
    /// Phase in rad that can be lost before the loop is unstable, or `None` if there is no limit.
    pub phase_rad: Option<f64>,
    /// Frequency in rad/s at which that phase is smallest.
    pub crossover_rad_s: Option<f64>,
}

/// Returns the margins of the feedback `u = −K x` on `ẋ = A x + B u`, for each input by itself.
///
/// The margins follow from the loop's frequency response `L(iω) = k (iω − A)⁻¹ b` between 1e-3 and
/// 1e4 rad/s. On its own plant, a linear-quadratic regulator has a phase margin of 60° and gain
/// margins of 1/2 to infinity (Anderson, Moore, 1990, chapter 5). Returns `None` if the closed loop
/// is unstable.
pub fn margins(a: &Matrix, b: &Matrix, k: &Matrix) -> Option<Vec<Margins>> {
    let closed = a - b * k;
    let margins = (0..b.ncols()).map(|i| {
        // The loop is opened only at this input, by removing its feedback from the closed loop.
        let (b, k) = (b.column(i).into_owned(), k.row(i).transpose());
        let open = &closed + &b * k.transpose();
        let square = &open * &open;
        swept_margins(|frequency| response(&open, &square, &b, &k, frequency))
    });
    is_hurwitz(&closed).then(|| margins.collect())
}

/// Returns the frequency response `k (iω − A)⁻¹ b`, or `None` at a pole. In real arithmetic, the
/// solution `x = u + iv` of `(iω − A) x = b` satisfies `(A² + ω²) v = −ω b` and `u = A v / ω`.
fn response(
    a: &Matrix,
    a_squared: &Matrix,
    b: &DVector<f64>,
    k: &DVector<f64>,
    frequency_rad_s: f64,
) -> Option<Complex<f64>> {
    let mut system = a_squared.clone();
    for i in 0..a.nrows() {
        system[(i, i)] += frequency_rad_s * frequency_rad_s;
    }
    let v = system.lu().solve(&(b * -frequency_rad_s))?;
    let u = a * &v / frequency_rad_s;
    Some(Complex::new(k.dot(&u), k.dot(&v)))
}

/// Returns the phase margin, its crossover and both gain margins of a loop, from the response over
/// a sweep of frequencies in rad/s. A margin without a crossover in the sweep is `None`.
fn swept_margins(response: impl Fn(f64) -> Option<Complex<f64>>) -> Margins {
    let mut margins = Margins::default();
    // The frequencies are equally spaced on a logarithmic scale. One at a pole of the open loop has
    // no response.
    let [first, last] = SWEEP_RAD_S.map(libm::log);
    let step = (last - first) / f64::from(SWEEP_STEPS);
    let samples = (0..=SWEEP_STEPS).map(|i| {
        let frequency = libm::exp(first + step * f64::from(i));
        Some((frequency, response(frequency)?))
    });
    let samples: Vec<Option<(f64, Complex<f64>)>> = samples.collect();
    for pair in samples.windows(2) {
        let [Some((low, at_low)), Some((high, at_high))] = *pair else { continue };
        let (range, values) = ([low, high], [at_low, at_high]);
        // At a gain crossover, |L| = 1, the phase margin is π − |arg L|. The smallest one is kept.
        let excess = |l: Complex<f64>| l.norm_sqr() - 1.0;
        if let Some((crossover, value)) = crossing(&response, range, values, excess) {
            let phase = PI - libm::atan2(value.im, value.re).abs();
            if margins.phase_rad.is_none_or(|best| phase < best) {
                (margins.phase_rad, margins.crossover_rad_s) = (Some(phase), Some(crossover));
            }
        }
        // At a phase crossover, L is real and negative, so a factor of −1/L on the input makes it
        // −1. The nearest factors above and below 1 are kept.
        if let Some((_, value)) = crossing(&response, range, values, |l| l.im)
            && value.re < 0.0
        {
            let factor = -1.0 / value.re;
            if factor > 1.0 {
                margins.gain_up = Some(margins.gain_up.map_or(factor, |best| best.min(factor)));
            } else if factor < 1.0 {
                margins.gain_down = Some(margins.gain_down.map_or(factor, |best| best.max(factor)));
            }
        }
    }
    margins
}

/// Returns the frequency in rad/s at which a function of the response changes its sign, by
/// bisection of the logarithm, and the response there. `values` contains the responses at the ends
/// of the range. Returns `None` if both have the same sign, or if the bisection meets a pole.
fn crossing(
    response: impl Fn(f64) -> Option<Complex<f64>>,
    [mut low, mut high]: [f64; 2],
    values: [Complex<f64>; 2],
    function: impl Fn(Complex<f64>) -> f64,
) -> Option<(f64, Complex<f64>)> {
    let is_positive = |value: Complex<f64>| function(value) > 0.0;
    let [at_low, at_high] = values.map(is_positive);
    if at_low == at_high {
        return None;
    }
    for _ in 0..HALVINGS {
        let middle = (low * high).sqrt();
        if is_positive(response(middle)?) == at_low { low = middle } else { high = middle }
    }
    response(high).map(|value| (high, value))
}

/// Returns the matrices `A`, `B` and `K` of the plant `ẋ = A x + B u` with states `[x u]`, whose
/// inputs follow their commands with a lag, `τ u̇ = u_command − u`. The feedback is `[K 0]`.
pub fn with_input_lag(a: &Matrix, b: &Matrix, k: &Matrix, lag_s: f64) -> [Matrix; 3] {
    let (n, m) = b.shape();
    let one = Matrix::identity(m, m);
    let lagging = block_matrix(a, b, &Matrix::zeros(m, n), &(&one / -lag_s));
    let mut command = Matrix::zeros(n + m, m);
    command.rows_mut(n, m).copy_from(&(one / lag_s));
    [lagging, command, k.clone().resize_horizontally(n + m, 0.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_of_a_double_integrator_are_its_textbook_figures() {
        // For the regulator of ẍ = u with Q = diag(1, 0), R = 1, the loop is L = (1 + √2 s)/s².
        let a = dmatrix![0.0, 1.0; 0.0, 0.0];
        let k = dmatrix![1.0, 2.0_f64.sqrt()];
        let actual = margins(&a, &dmatrix![0.0; 1.0], &k).unwrap()[0];
        // |L| = 1 at ω² = 1 + √2, phase atan(√2 ω).
        let crossover = (1.0 + 2.0_f64.sqrt()).sqrt();
        let phase = libm::atan(2.0_f64.sqrt() * crossover);
        assert!((actual.crossover_rad_s.unwrap() - crossover).abs() < 1e-9, "{actual:?}");
        assert!((actual.phase_rad.unwrap() - phase).abs() < 1e-9, "{actual:?}");
        assert_eq!((actual.gain_up, actual.gain_down), (None, None));
    }

    #[test]
    fn three_lags_in_a_row_stand_eight_times_the_gain() {
        // The loop L = 1/(s + 1)³ is −1/8 at ω = √3.
        let a = dmatrix![-1.0, 1.0, 0.0; 0.0, -1.0, 1.0; 0.0, 0.0, -1.0];
        let (b, k) = (dmatrix![0.0; 0.0; 1.0], dmatrix![1.0, 0.0, 0.0]);
        let actual = margins(&a, &b, &k).unwrap()[0];
        assert!((actual.gain_up.unwrap() - 8.0).abs() < 1e-9, "{actual:?}");
        assert_eq!(margins(&a, &b, &(&k * 8.1)), None, "unstable to begin with");
        let near = margins(&a, &b, &(k * 7.9)).unwrap()[0];
        assert!((near.gain_up.unwrap() - 8.0 / 7.9).abs() < 1e-9, "{near:?}");
    }

    #[test]
    fn an_unstable_plant_needs_its_gain() {
        // For ẋ = x + u with u = −2 x, the loop L = 2/(s − 1) begins at −2.
        let (a, one) = (dmatrix![1.0], dmatrix![1.0]);
        let [lagging, b, k] = with_input_lag(&a, &one, &dmatrix![2.0], 0.1);
        let actual = margins(&lagging, &b, &k).unwrap()[0];
        // The polynomial 0.1 s² + 0.9 s + (2g − 1) is stable above g = ½, and L is ½ only at ω = 0.
        assert_eq!(actual.gain_up, None, "{actual:?}");
        assert!(is_hurwitz(&(&lagging - &b * &k)), "as it is");
        assert!(!is_hurwitz(&(lagging - b * k * 0.49)), "with half of it");
        let [late, b, k] = with_input_lag(&a, &one, &dmatrix![2.0], 1.1);
        assert_eq!(margins(&late, &b, &k), None, "a lag of 1.1 s is too long");
    }
}
