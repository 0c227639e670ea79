//! Comparison: differences between two flights that were sampled at different times.
//!
//! Products in: two [`Flight`]s, A and B. Product out: [`Comparison`].
//!
//! Method: B's clock is shifted by a given time, or by the time at which both designs or both paths
//! match best. B is then interpolated linearly at the times of A's samples. A sample of A is
//! ignored if it lies outside the compared part of either flight, or if B's neighboring samples are
//! farther apart than [`ComparisonOptions::max_gap_s`], for example after lost packets.
//!
//! A flight without setpoints, such as one from motion capture, may be in a different frame. If a
//! rotation about the vertical axis and a translation reduce the distance to centimeters, they are
//! applied ([`FrameAlignment`]). If they reduce it considerably but not to centimeters, the
//! comparison is refused.
//!
//! Not done: converting clocks that run at different rates, which `import` does.

use nalgebra::Vector3;
use serde::Serialize;

use noctograph_core::error::{Error, Result, within};
use noctograph_core::flight::{Flight, FlightData, FlightSample, Quantity};
use noctograph_core::geometry::Attitude;
use noctograph_core::input_error;
use noctograph_core::statistics::weighted_quantile;
use noctograph_plan::tracking::{Part, angles_rad, attitude, mean, rms};

mod align;
mod cause;
#[cfg(test)]
#[path = "../../plan/tracking/constructed.rs"]
mod constructed;
mod frame;
#[cfg(test)]
mod tests;

pub use cause::Discrepancy;
pub use frame::FrameAlignment;

/// Options of a comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct ComparisonOptions {
    /// Part of the flights to compare.
    pub part: Part,
    /// Alignment of B's clock with A's.
    pub alignment: Alignment,
    /// Maximum gap between two samples of B over which B is interpolated. A Crazyflie log contains
    /// a sample every 10 to 30 ms. A larger value hides oscillations of 1 to 4 Hz, and a much
    /// smaller one discards good samples.
    pub max_gap_s: f64,
}

impl Default for ComparisonOptions {
    fn default() -> Self {
        Self { part: Part::Airborne, alignment: Alignment::Design, max_gap_s: 0.2 }
    }
}

/// Alignment of the clock of flight B with that of flight A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Alignment {
    /// Alignment by the best match of the designs. If only one design is held between setpoints,
    /// the error is half the interval between two setpoints.
    Design,
    /// Alignment by the best match of the flown positions in the air, for a log whose setpoints
    /// lead its design, such as setpoints computed by inverting the position loop.
    Flown,
    /// Alignment by adding these seconds to B's timestamps.
    Offset(f64),
}

/// Differences between two flights, A minus B, in the world frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Part of the flights that the differences cover.
    pub part: Part,
    /// Time added to B's timestamps.
    pub offset_s: f64,
    /// Transform from B's frame to A's. `None` if the frames are the same.
    #[serde(rename = "frame")]
    pub placement: Option<FrameAlignment>,
    /// Number of compared samples of A.
    #[serde(rename = "samples")]
    pub n_samples: usize,
    /// Times of the first and the last compared sample on A's clock.
    pub span_s: [f64; 2],
    /// Root mean square difference in position on each axis.
    pub rmse_m: Vector3<f64>,
    /// Mean difference in position on each axis.
    pub mean_m: Vector3<f64>,
    /// Maximum distance between the positions.
    pub max_m: f64,
    /// Root mean square difference in attitude. `None` if a flight has no attitude data.
    #[serde(rename = "attitude_rmse_rad")]
    pub attitude_rmse: Option<Attitude>,
    /// Cause that explains most of the difference, and the fraction of the mean square that it
    /// explains. `None` if the flights do not differ.
    #[serde(skip)]
    pub first: Option<(Discrepancy, f64)>,
}

/// Returns the differences between two flights.
///
/// # Errors
///
/// Returns [`Error::Input`] for an option out of range, a flight without samples in the part, a
/// flight without a design if designs are aligned, and flights that do not overlap in time.
pub fn compare(a: &Flight, b: &Flight, options: &ComparisonOptions) -> Result<Comparison> {
    within("max_gap_s", options.max_gap_s, 0.0, 60.0)?;
    // The clock is aligned before the frame, which is aligned by pairs of samples at equal times.
    let first_offset_s = options.alignment.offset_s(a, b)?;
    match options.alignment {
        Alignment::Design => check_words(a, b)?,
        Alignment::Offset(offset_s) => within("offset_s", offset_s, -1e6, 1e6)?,
        Alignment::Flown => {}
    }
    let clock = &|b: &Flight| options.alignment.offset_s(a, b);
    let (offset_s, placement) = frame::place(a, b, options, first_offset_s, clock)?;
    let [samples_a, mut samples_b] = [options.part.samples(a)?, options.part.samples(b)?];
    for sample in &mut samples_b {
        sample.time_s += offset_s;
        placement.iter().for_each(|placement| placement.place(sample));
    }
    let pairs = pairs(&samples_a, &samples_b, options.max_gap_s);
    let (Some(first), Some(last)) = (pairs.first(), pairs.last()) else {
        let [span_a, span_b] = [samples_a, samples_b]
            .map(|s| format!("{:.2} … {:.2} s", s[0].time_s, s[s.len() - 1].time_s));
        let spans = format!("A at {span_a}, B at {span_b}");
        let hint = "shift B's clock, or compare two flights of the same plan";
        let error = Error::input("flights A and B", spans, "a time that both flights cover", hint);
        return Err(error.coded("clocks-apart"));
    };
    // Differences of angles are wrapped to the range from -π to π.
    let apart = pairs.iter().map(|[a, b]| a.position_m - b.position_m);
    let angles = pairs.iter().map(|[a, b]| {
        let difference = angles_rad(&a.attitude) - angles_rad(&b.attitude);
        difference.map(|angle| libm::remainder(angle, std::f64::consts::TAU))
    });
    let logged = [a, b].iter().all(|flight| flight.has(Quantity::Attitude));
    Ok(Comparison {
        part: options.part,
        offset_s,
        placement,
        n_samples: pairs.len(),
        span_s: [first[0].time_s, last[0].time_s],
        rmse_m: rms(apart.clone()),
        mean_m: mean(apart.clone()),
        max_m: apart.map(|d| d.norm()).fold(0.0, f64::max),
        attitude_rmse: logged.then(|| attitude(rms(angles))),
        first: cause::main_cause(&pairs),
    })
}

impl Alignment {
    /// Returns the seconds to add to B's timestamps. Returns an error if a flight lacks the path
    /// that is aligned.
    fn offset_s(self, a: &Flight, b: &Flight) -> Result<f64> {
        match self {
            Self::Design => align::offset_s(a, b),
            Self::Flown => align::offset_s(&flown(a)?, &flown(b)?),
            Self::Offset(offset_s) => Ok(offset_s),
        }
    }
}

/// Returns the airborne part of a flight, with the flown path in place of its design, so that flown
/// paths can be aligned as designs are. Returns an error if the flight was never airborne.
fn flown(flight: &Flight) -> Result<Flight> {
    let samples = Part::Airborne.samples(flight)?.into_iter();
    let samples = samples.map(|s| FlightSample { design_m: s.position_m, ..s }).collect();
    Ok(Flight::made(FlightData { samples, ..FlightData::default() }))
}

/// Maximum distance up to which two flights' letters count as the same: a fifth of the cap height.
const MAX_LETTERS_APART_M: f64 = 0.1;

/// Returns an error if the designs of two flights write different letters, or the same letters at
/// different places. Nothing is checked if a flight marks no letters.
fn check_words(a: &Flight, b: &Flight) -> Result<()> {
    let [a, b] = [a, b].map(|flight| {
        let written = flight.samples.iter().filter(|sample| sample.letter.is_some());
        let mut points: Vec<Vector3<f64>> = written.map(|sample| sample.design_m).collect();
        // Points are thinned to one every 2 cm, which limits the number of comparisons.
        points.dedup_by(|next_m, last_m| (*last_m - *next_m).norm() < 0.02);
        points
    });
    if a.is_empty() || b.is_empty() {
        return Ok(());
    }
    // Partial Hausdorff distance (Huttenlocher et al. 1993) of nine tenths of the points, because
    // one of the plans may lack the approach to a letter.
    let each_way_m = [(&a, &b), (&b, &a)].map(|(from, to)| {
        let nearest_m = from.iter().map(|p| {
            let to_each_m = to.iter().map(|q| (p - q).norm());
            (to_each_m.fold(f64::MAX, f64::min), 1.0)
        });
        weighted_quantile(&mut nearest_m.collect::<Vec<_>>(), 0.9).unwrap_or(0.0)
    });
    let apart_m = each_way_m[0].max(each_way_m[1]);
    if apart_m <= MAX_LETTERS_APART_M {
        return Ok(());
    }
    Err(input_error!(
        "flights A and B",
        "letters that lie {apart_m:.2} m apart",
        "two flights of the same word at the same position",
        "compare flights of the same word",
    ))
}

/// Pairs each sample of A with B's state interpolated at its time, as `[a, b]`. Omits times at
/// which B is unknown, because it has no sample there or a gap longer than `max_gap_s`.
fn pairs(a: &[FlightSample], b: &[FlightSample], max_gap_s: f64) -> Vec<[FlightSample; 2]> {
    let mut next = 0;
    let mut pairs = Vec::with_capacity(a.len());
    for sample in a {
        while b.get(next).is_some_and(|b| b.time_s < sample.time_s) {
            next += 1;
        }
        let Some(after) = b.get(next) else { break };
        let before = if next > 0 { &b[next - 1] } else { after };
        if let Some(there) = between(before, after, sample.time_s, max_gap_s) {
            pairs.push([*sample, there]);
        }
    }
    pairs
}

/// Interpolates between two consecutive samples. Returns `None` if `time_s` is not between them, or
/// if they are more than `max_gap_s` apart.
fn between(
    before: &FlightSample,
    after: &FlightSample,
    time_s: f64,
    max_gap_s: f64,
) -> Option<FlightSample> {
    if after.time_s == time_s {
        return Some(*after);
    }
    let gap_s = after.time_s - before.time_s;
    if time_s < before.time_s || gap_s > max_gap_s {
        return None;
    }
    let fraction = (time_s - before.time_s) / gap_s;
    let position_m = before.position_m + (after.position_m - before.position_m) * fraction;
    let [from, to] = [before, after].map(|sample| angles_rad(&sample.attitude));
    let turn = (to - from).map(|angle| libm::remainder(angle, std::f64::consts::TAU));
    Some(FlightSample { time_s, position_m, attitude: attitude(from + turn * fraction), ..*before })
}
