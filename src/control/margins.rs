//! Margins of gain and phase of a feedback, and models with input lag.

use std::f64::consts::PI;

use nalgebra::{Complex, Const, DimMin, SMatrix, SVector};

use super::linear::is_hurwitz;

/// Frequencies that are swept, rad/s: from far below a drone's slowest loop to far above its
/// fastest.
const SWEEP_RAD_S: [f64; 2] = [1e-3, 1e4];
/// Steps of the sweep. A step of 0.4 % finds every crossing but two within it.
const SWEEP_STEPS: u32 = 4000;
/// Halvings of the step in which a crossing lies: 0.4 % to 1e-12.
const HALVINGS: u32 = 30;

/// Margins of one loop, opened at its input, with the others closed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Margins {
    /// Largest factor above 1 on the input up to which the loop is stable; `None`: any.
    pub gain_up: Option<f64>,
    /// Smallest factor below 1 down to which it is stable; `None`: any.
    pub gain_down: Option<f64>,
    /// Phase that can be lost before it is unstable; `None`: any.
    pub phase_rad: Option<f64>,
    /// Frequency at which that phase is the smallest.
    pub crossover_rad_s: Option<f64>,
}

/// Margins of the feedback `u = −K x` on `ẋ = A x + B u`, for each input by itself.
///
/// From the loop's frequency response `L(iω) = k (iω − A)⁻¹ b` between 1e-3 and 1e4 rad/s: where
/// `|L|` crosses 1 and where `L` crosses the negative real axis. A regulator on the plant it was
/// designed for has at least 60°, any rise and a half (Anderson, Moore, 1990, chapter 5).
///
/// `None` where the closed loop is not stable to begin with.
#[must_use]
pub fn margins<const N: usize, const M: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, M>,
    k: &SMatrix<f64, M, N>,
) -> Option<[Margins; M]>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    let closed = a - b * k;
    is_hurwitz(&closed).then(|| {
        std::array::from_fn(|i| {
            let (b, k) = (b.column(i).into_owned(), k.row(i).transpose());
            let open = closed + b * k.transpose();
            let square = open * open;
            of_loop(|frequency| response(&open, &square, &b, &k, frequency))
        })
    })
}

/// `k (iω − A)⁻¹ b`, in real arithmetic: with `x = u + iv`, `(A² + ω²) v = −ω b` and `u = A v / ω`.
fn response<const N: usize>(
    a: &SMatrix<f64, N, N>,
    a_squared: &SMatrix<f64, N, N>,
    b: &SVector<f64, N>,
    k: &SVector<f64, N>,
    frequency_rad_s: f64,
) -> Option<Complex<f64>>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    let square = frequency_rad_s * frequency_rad_s;
    let system = a_squared + SMatrix::<f64, N, N>::identity() * square;
    let v = system.lu().solve(&(b * -frequency_rad_s))?;
    let u = a * v / frequency_rad_s;
    Some(Complex::new(k.dot(&u), k.dot(&v)))
}

/// Sweeps a loop's response and gathers its crossings.
fn of_loop(response: impl Fn(f64) -> Option<Complex<f64>>) -> Margins {
    let mut margins = Margins::default();
    let smaller = |found: f64, best: Option<f64>| best.is_none_or(|best| found < best);
    let [low, high] = SWEEP_RAD_S.map(libm::log);
    let step = (high - low) / f64::from(SWEEP_STEPS);
    let mut last = None;
    for i in 0..=SWEEP_STEPS {
        let frequency = libm::exp(low + step * f64::from(i));
        let Some(now) = response(frequency) else {
            last = None;
            continue;
        };
        if let Some((before, was)) = last {
            let within = [before, frequency];
            if (excess(was) > 0.0) != (excess(now) > 0.0)
                && let Some((at, value)) = crossing(&response, within, excess)
            {
                let phase = PI - libm::atan2(value.im, value.re).abs();
                if smaller(phase, margins.phase_rad) {
                    (margins.phase_rad, margins.crossover_rad_s) = (Some(phase), Some(at));
                }
            }
            if (was.im > 0.0) != (now.im > 0.0)
                && let Some((_, value)) = crossing(&response, within, |l: Complex<f64>| l.im)
                && value.re < 0.0
            {
                let factor = -1.0 / value.re;
                if factor > 1.0 && smaller(factor, margins.gain_up) {
                    margins.gain_up = Some(factor);
                } else if factor < 1.0 && margins.gain_down.is_none_or(|best| factor > best) {
                    margins.gain_down = Some(factor);
                }
            }
        }
        last = Some((frequency, now));
    }
    margins
}

fn excess(l: Complex<f64>) -> f64 {
    l.norm_sqr() - 1.0
}

/// Where a figure of the response changes its sign between two frequencies, and the response there.
fn crossing(
    response: impl Fn(f64) -> Option<Complex<f64>>,
    [mut low, mut high]: [f64; 2],
    figure: impl Fn(Complex<f64>) -> f64,
) -> Option<(f64, Complex<f64>)> {
    let below = figure(response(low)?) > 0.0;
    for _ in 0..HALVINGS {
        let middle = (low * high).sqrt();
        if (figure(response(middle)?) > 0.0) == below { low = middle } else { high = middle }
    }
    response(high).map(|value| (high, value))
}

/// The plant `ẋ = A x + B u` whose inputs follow their commands with a lag: `τ u̇ = u_command − u`.
/// Its states are `[x u]`, and the feedback on them is `[K 0]`.
///
/// # Panics
///
/// If `P` is not `N + M`.
#[must_use]
pub fn with_input_lag<const N: usize, const M: usize, const P: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, M>,
    k: &SMatrix<f64, M, N>,
    lag_s: f64,
) -> (SMatrix<f64, P, P>, SMatrix<f64, P, M>, SMatrix<f64, M, P>) {
    assert_eq!(P, N + M, "states and inputs");
    let mut lagging = a.fixed_resize::<P, P>(0.0);
    lagging.fixed_view_mut::<N, M>(0, N).copy_from(b);
    let one = SMatrix::<f64, M, M>::identity();
    lagging.fixed_view_mut::<M, M>(N, N).copy_from(&(one / -lag_s));
    let mut command = SMatrix::<f64, P, M>::zeros();
    command.fixed_view_mut::<M, M>(N, 0).copy_from(&(one / lag_s));
    (lagging, command, k.fixed_resize::<M, P>(0.0))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix1, Matrix1x2, Matrix2, Matrix3, RowVector3, Vector2, Vector3};

    use super::*;

    #[test]
    fn margins_of_a_double_integrator_are_its_textbook_figures() {
        // L = (1 + √2 s)/s²: the regulator of ẍ = u with Q = diag(1, 0), R = 1.
        let a = Matrix2::new(0.0, 1.0, 0.0, 0.0);
        let k = Matrix1x2::new(1.0, 2.0_f64.sqrt());
        let [found] = margins(&a, &Vector2::new(0.0, 1.0), &k).unwrap();
        // |L| = 1 at ω² = 1 + √2, phase atan(√2 ω).
        let crossover = (1.0 + 2.0_f64.sqrt()).sqrt();
        let phase = libm::atan(2.0_f64.sqrt() * crossover);
        assert!((found.crossover_rad_s.unwrap() - crossover).abs() < 1e-9, "{found:?}");
        assert!((found.phase_rad.unwrap() - phase).abs() < 1e-9, "{found:?}");
        assert_eq!((found.gain_up, found.gain_down), (None, None));
    }

    #[test]
    fn three_lags_in_a_row_stand_eight_times_the_gain() {
        // L = 1/(s + 1)³: −1/8 at ω = √3.
        let a = Matrix3::new(-1.0, 1.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0, -1.0);
        let (b, k) = (Vector3::new(0.0, 0.0, 1.0), RowVector3::new(1.0, 0.0, 0.0));
        let [found] = margins(&a, &b, &k).unwrap();
        assert!((found.gain_up.unwrap() - 8.0).abs() < 1e-9, "{found:?}");
        assert_eq!(margins(&a, &b, &(k * 8.1)), None, "unstable to begin with");
        let [near] = margins(&a, &b, &(k * 7.9)).unwrap();
        assert!((near.gain_up.unwrap() - 8.0 / 7.9).abs() < 1e-9, "{near:?}");
    }

    #[test]
    fn an_unstable_plant_needs_its_gain() {
        // ẋ = x + u, u = −2 x: L = 2/(s − 1) begins at −2.
        let (a, one) = (Matrix1::new(1.0), Matrix1::new(1.0));
        let (lagging, b, k) = with_input_lag::<1, 1, 2>(&a, &one, &Matrix1::new(2.0), 0.1);
        let [found] = margins(&lagging, &b, &k).unwrap();
        // 0.1 s² + 0.9 s + (2g − 1): stable above g = ½, which L reaches at ω = 0 only.
        assert_eq!(found.gain_up, None, "{found:?}");
        assert!(is_hurwitz(&(lagging - b * k)), "as it is");
        assert!(!is_hurwitz(&(lagging - b * k * 0.49)), "with half of it");
        let (late, b, k) = with_input_lag::<1, 1, 2>(&a, &one, &Matrix1::new(2.0), 1.1);
        assert_eq!(margins(&late, &b, &k), None, "a lag of 1.1 s is too long");
    }
}
