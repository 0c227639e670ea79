//! Specimen: a sheet of a font's characters with the order and direction of their strokes.
//!
//! Lit strokes are colored in their order and numbered where they begin, an arrow in their middle
//! tells the direction; what the pen does in the dark is dashed. As SVG text, or as pixels.

use super::canvas::{Anchor, Canvas, Pen, Rgb};
use crate::geometry::distance;
use crate::letters::{Cell, Font, Glyph};
use crate::photo::Photo;

/// Size of a character's field, and its capitals' height.
const FIELD_PX: [f64; 2] = [112.0, 140.0];
const CAP_PX: f64 = 60.0;

/// Fields in a row.
const PER_ROW: usize = 13;

/// Lower edge of the capitals below the upper edge of their field.
const BASELINE_PX: f64 = 104.0;

/// Colors of the strokes in their order, from the start again after the last.
const INKS: [Rgb; 6] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [160, 60, 150], [190, 140, 0], [20, 20, 20]];
const GUIDE: Rgb = [224, 224, 224];
const DARK: Rgb = [150, 150, 150];
const NAME: Rgb = [120, 120, 120];

/// A sheet of characters.
pub struct Specimen {
    canvas: Canvas<'static>,
    /// The characters that it shows.
    pub characters: String,
}

impl Specimen {
    /// Draws characters; those that the font lacks are left out.
    #[must_use]
    pub fn new(font: &Font, characters: &str) -> Self {
        let glyph = |character: char| {
            let width_m = font.aspect(character).unwrap_or(0.6) * CAP_PX;
            // Meters are pixels here, with the baseline at y = 0.
            let left_m = 0.5 * (FIELD_PX[0] - width_m);
            let cell = Cell { left_m, baseline_m: 0.0, width_m, cap_height_m: CAP_PX };
            font.glyph(character, cell)
        };
        let glyphs: Vec<Glyph> = characters.chars().filter_map(glyph).collect();
        let n_rows = glyphs.len().div_ceil(PER_ROW).max(1);
        let size_px = [PER_ROW as f64 * FIELD_PX[0], n_rows as f64 * FIELD_PX[1]];
        let mut canvas = Canvas::white(size_px);
        for (index, glyph) in glyphs.iter().enumerate() {
            let [x, y] = [index % PER_ROW, index / PER_ROW];
            draw(&mut canvas, glyph, [x as f64 * FIELD_PX[0], y as f64 * FIELD_PX[1]]);
        }
        Self { canvas, characters: glyphs.iter().map(|glyph| glyph.character).collect() }
    }

    /// The sheet as an SVG file's text.
    #[must_use]
    pub fn svg(&self) -> String {
        self.canvas.svg()
    }

    /// The sheet as pixels.
    #[must_use]
    pub fn pixels(&self) -> Photo {
        self.canvas.pixels()
    }
}

impl std::fmt::Debug for Specimen {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("Specimen").finish_non_exhaustive()
    }
}

/// Draws a character in the field with its upper left corner at a place.
fn draw(canvas: &mut Canvas<'_>, glyph: &Glyph, corner: [f64; 2]) {
    for up in [0.0, CAP_PX] {
        let y = corner[1] + BASELINE_PX - up;
        let ends = [[corner[0] + 8.0, y], [corner[0] + FIELD_PX[0] - 8.0, y]];
        canvas.line(ends, Pen::new(GUIDE, 1.0));
    }
    let name = [corner[0] + 6.0, corner[1] + 18.0];
    canvas.text(glyph.character, name, Anchor::Start, 11.0, NAME);
    let place = |[x, y]: [f64; 2]| [corner[0] + x, corner[1] + BASELINE_PX - y];
    let runs = glyph.moves.chunk_by(|a, b| a.lit == b.lit && a.to_m == b.from_m);
    let (mut order, mut taken) = (0, Vec::new());
    for run in runs {
        let mut points = vec![place(run[0].from_m)];
        points.extend(run.iter().map(|step| place(step.to_m)));
        let length: f64 = points.windows(2).map(|leg| distance(leg[0], leg[1])).sum();
        if !run[0].lit {
            canvas.line(points, Pen { color: DARK, width_px: 1.0, dashed: true });
            continue;
        }
        if length == 0.0 {
            continue;
        }
        let ink = INKS[order % INKS.len()];
        order += 1;
        let begin = points[0];
        // Strokes that begin together have their numbers side by side.
        let crowd = taken.iter().filter(|at| distance(**at, begin) < 6.0).count();
        taken.push(begin);
        if length > 12.0 {
            canvas.area(arrow(&points, 0.5 * length), ink);
        }
        canvas.line(points, Pen::new(ink, 2.5));
        canvas.dot(begin, 3.5, ink);
        let number = [begin[0] + 5.0 + 9.0 * crowd as f64, begin[1] - 4.0];
        canvas.text(order.to_string(), number, Anchor::Start, 8.0, ink);
    }
}

/// A triangle on a line, after a length, that points along it.
fn arrow(points: &[[f64; 2]], after: f64) -> [[f64; 2]; 3] {
    let mut gone = 0.0;
    let leg = points.windows(2).find(|leg| {
        gone += distance(leg[0], leg[1]);
        gone >= after
    });
    let leg = leg.unwrap_or(&points[..2]);
    let length = distance(leg[0], leg[1]).max(f64::MIN_POSITIVE);
    let share = 1.0 - (gone - after) / length;
    let [ux, uy] = [0, 1].map(|axis| (leg[1][axis] - leg[0][axis]) / length);
    let [x, y] = [0, 1].map(|axis| leg[0][axis] + share * (leg[1][axis] - leg[0][axis]));
    let corner =
        |along: f64, beside: f64| [x + along * ux - beside * uy, y + along * uy + beside * ux];
    [corner(5.0, 0.0), corner(-4.0, 4.5), corner(-4.0, -4.5)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::Trace;

    #[test]
    fn a_sheet_shows_strokes_in_order_and_the_dark_dashed() {
        let font = Font::open("ae483-fixed", Trace::CenterLine).unwrap();
        let svg = Specimen::new(&font, "HX漢").svg();
        let count = |what: &str| svg.matches(what).count();
        // H has three lit strokes and X two; each but the last is followed by a way in the dark, and
        // each letter is reached in the dark.
        assert_eq!(count("<circle"), 5, "a dot where each begins");
        assert_eq!(count("<polygon"), 5, "an arrow on each");
        assert_eq!(count("stroke-dasharray"), 5, "ways in the dark");
        assert_eq!(count("#e0e0e0"), 4, "two guides each, and none for what the font lacks");
        let sheet = Specimen::new(&font, "HX").pixels();
        assert_eq!((sheet.width_px, sheet.height_px), (1456, 140));
        let blue = sheet.rgb8.chunks(3).filter(|p| *p == INKS[0]).count();
        assert!(blue > 100, "the first strokes: {blue} pixels");
    }
}
