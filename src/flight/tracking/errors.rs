//! Errors of a flight against its design, `position − design` per world axis, over samples.

use nalgebra::Vector3;

use crate::flight::{Flight, FlightSample};

/// Root mean square over the samples that write letters.
///
/// `None` where no sample writes a letter.
#[must_use]
pub fn rmse_m(flight: &Flight) -> Option<Vector3<f64>> {
    rmse_over_m(writing(flight))
}

/// Mean over the samples that write letters.
///
/// `None` where no sample writes a letter.
#[must_use]
pub fn mean_error_m(flight: &Flight) -> Option<Vector3<f64>> {
    mean_error_over_m(writing(flight))
}

/// Root mean square over samples of one's choice: for a real log those of
/// [`crate::flight::airborne`].
///
/// `None` where there is no sample.
#[must_use]
pub fn rmse_over_m<'a>(
    samples: impl IntoIterator<Item = &'a FlightSample>,
) -> Option<Vector3<f64>> {
    let mut errors = errors(samples).peekable();
    errors.peek()?;
    Some(rms(errors))
}

/// Mean over samples of one's choice.
///
/// `None` where there is no sample.
#[must_use]
pub fn mean_error_over_m<'a>(
    samples: impl IntoIterator<Item = &'a FlightSample>,
) -> Option<Vector3<f64>> {
    let mut errors = errors(samples).peekable();
    errors.peek()?;
    Some(mean(errors))
}

fn writing(flight: &Flight) -> impl Iterator<Item = &FlightSample> {
    flight.samples.iter().filter(|sample| sample.letter.is_some())
}

/// Of each sample.
pub(super) fn errors<'a>(
    samples: impl IntoIterator<Item = &'a FlightSample>,
) -> impl Iterator<Item = Vector3<f64>> {
    samples.into_iter().map(|sample| sample.position_m - sample.design_m)
}

/// Root mean square of each component; zero of nothing.
pub(in crate::flight) fn rms(vectors: impl Iterator<Item = Vector3<f64>>) -> Vector3<f64> {
    mean(vectors.map(|v| v.component_mul(&v))).map(f64::sqrt)
}

/// Mean; zero of nothing.
pub(in crate::flight) fn mean(vectors: impl Iterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let (n, sum) = vectors.fold((0, Vector3::zeros()), |(n, sum), v| (n + 1, sum + v));
    sum / super::count(n.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Attitude;

    #[test]
    fn rmse_counts_only_the_letters() {
        let sample = |error: f64, letter| FlightSample {
            time_s: 0.0,
            position_m: Vector3::new(error, 0.0, 1.0),
            attitude: Attitude::default(),
            velocity_body_m_s: Vector3::zeros(),
            rate_body_rad_s: Vector3::zeros(),
            estimate_m: Vector3::zeros(),
            design_m: Vector3::new(0.0, 0.0, 1.0),
            motors: [0.0; 4],
            letter,
        };
        let samples = vec![sample(9.0, None), sample(3.0, Some(0)), sample(-4.0, Some(1))];
        let flight = Flight { samples, ..Flight::default() };
        assert_eq!(rmse_m(&flight), Some(Vector3::new(12.5_f64.sqrt(), 0.0, 0.0)));
        assert_eq!(mean_error_m(&flight), Some(Vector3::new(-0.5, 0.0, 0.0)));
        assert_eq!(rmse_m(&Flight::default()), None, "no letter, no figure");
    }
}
