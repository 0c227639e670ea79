//! Aligns the clocks of two flights by comparing their designs.

use noctograph_core::error::{Error, Result};
use noctograph_core::flight::Flight;
use noctograph_plan::tracking::{DesignPath, minimize, spread_m2};

/// Time step of the comparison: the shortest interval at which setpoints usually arrive by radio.
const STEP_S: f64 = 0.02;
/// Maximum time between the designs' first moves after alignment, due to lost packets and waiting.
const MAX_APART_S: f64 = 3.0;
/// Mean square difference (m² per axis) below which the designs' clocks count as equal. Files are
/// rounded to 1e-6 m.
const EQUAL_M2: f64 = 1e-11;

/// Returns the time to add to B's timestamps at which its design best matches A's, except for a
/// constant offset in position. Returns 0 if the clocks already agree.
pub(super) fn offset_s(a: &Flight, b: &Flight) -> Result<f64> {
    let [a, b] = [design(a, "flight A")?, design(b, "flight B")?];
    if difference_m2(&a, &b, 0.0) < EQUAL_M2 {
        return Ok(0.0);
    }
    // The minimum of the mean square difference is near the offset at which the first moves
    // coincide. The coarse search uses the same cost as the fine one, because [`STEP_S`] already
    // limits the number of samples.
    let about_s = a.first_move_s() - b.first_move_s();
    let range_s = [about_s - MAX_APART_S, about_s + MAX_APART_S];
    Ok(minimize(range_s, |s| difference_m2(&a, &b, s)))
}

/// Returns the designed path of a flight. Returns an error coded `clocks-apart` if its log has no
/// design. `name` is the flight's name in the error.
fn design(flight: &Flight, name: &str) -> Result<DesignPath> {
    DesignPath::new(flight).ok_or_else(|| {
        let hint = "state the offset of B's clock, or 0 to leave the clock unchanged";
        Error::input(name, "no design position", "a design by which clocks can be aligned", hint)
            .coded("clocks-apart")
    })
}

/// Returns the variance of the difference between two designs over the time covered by either, with
/// `offset_s` added to B's clock. A design rests before its start and after its end.
fn difference_m2(a: &DesignPath, b: &DesignPath, offset_s: f64) -> f64 {
    let ([a0, a1], [b0, b1]) = (a.span_s(), b.span_s().map(|t| t + offset_s));
    let (from_s, to_s) = (a0.min(b0), a1.max(b1));
    #[expect(clippy::cast_possible_truncation, reason = "a log is short")]
    let n = ((to_s - from_s) / STEP_S) as u32;
    // Both designs are traversed only once, in order of time.
    let (mut walk_a, mut walk_b) = (a.walk(), b.walk());
    let times_s = (0..=n).map(|k| from_s + f64::from(k) * STEP_S);
    spread_m2(times_s.map(|t| walk_a.at_m(t) - walk_b.at_m(t - offset_s)))
}
