//! Whether a plan writes a word.

use noctograph_core::error::{Error, Result};
use noctograph_core::geometry::segment_distance;
use noctograph_flying::plan::Plan;
use noctograph_letters::Strokes;

/// Largest distance of a plan's light from the strokes of its letter, in cap heights.
const TOLERANCE_H: f64 = 0.1;

/// Refuses a plan whose light is away from the strokes.
///
/// # Errors
///
/// [`Error::Input`] with the time of the first setpoint that is too far away.
pub fn check_written(plan: &Plan, strokes: &Strokes) -> Result<()> {
    let lit = |row: usize| plan.lights.values().any(|levels| levels[row] > 0.0);
    let rows = (0..plan.setpoints.len()).filter(|row| lit(*row));
    let far_m = TOLERANCE_H * strokes.glyphs[0].cell.cap_height_m;
    for row in rows {
        let setpoint = &plan.setpoints[row];
        let point = [setpoint.position_m.x, setpoint.position_m.z];
        let glyph = setpoint.letter.map(|letter| strokes.glyphs.get(letter));
        let Some(glyph) = glyph else { continue };
        let moves = glyph.into_iter().flat_map(|glyph| &glyph.moves).filter(|step| step.lit);
        let off_m = moves.map(|step| segment_distance(point, [step.from_m, step.to_m]));
        if off_m.fold(f64::INFINITY, f64::min) > far_m {
            let letter = setpoint.letter.map_or(0, |letter| letter + 1);
            return Err(Error::input(
                format!("plan, {:.1} s", setpoint.time_s),
                format!("light at {:.2} m, {:.2} m in letter {letter}", point[0], point[1]),
                format!("the strokes of {}", strokes.word),
                "name the plan, the word and the scene of the same flight",
            ));
        }
    }
    Ok(())
}
