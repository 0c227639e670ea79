//! Text in single strokes, as pixels have it where no typeface is at hand.

use crate::letters::{Cell, Font, Trace};

/// The font that pictures are written with.
pub(super) fn pen() -> Font {
    Font::open("simplex", Trace::CenterLine).expect("a font of ours")
}

/// The lines of a text from its lower left corner on, and where it ends, in pixels (y down).
/// Characters that the pen lacks are left out.
pub(super) fn lines(
    pen: &Font,
    text: &str,
    [left, baseline]: [f64; 2],
    cap_px: f64,
) -> (Vec<Vec<[f64; 2]>>, f64) {
    let (mut lines, mut at) = (Vec::new(), left);
    for character in text.chars() {
        let Some(aspect) = pen.aspect(character) else { continue };
        // Metres are pixels here, with the baseline at y = 0.
        let (width_m, cap_height_m) = (aspect * cap_px, cap_px);
        let cell = Cell { left_m: at, baseline_m: 0.0, width_m, cap_height_m };
        let moves = pen.glyph(character, cell).map_or(Vec::new(), |glyph| glyph.moves);
        for run in moves.chunk_by(|a, b| a.lit == b.lit).filter(|run| run[0].lit) {
            let ends = std::iter::once(run[0].from_m).chain(run.iter().map(|step| step.to_m));
            lines.push(ends.map(|[x, y]| [x, baseline - y]).collect());
        }
        at += width_m + 0.25 * cap_px;
    }
    (lines, at - 0.25 * cap_px)
}
