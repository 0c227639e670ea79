//! Specimen: a sheet of a font's characters with the order and direction of their strokes.
//!
//! Lit strokes are colored in their order and numbered where they begin, an arrow in their middle
//! tells the direction; what the pen does in the dark is dashed. As SVG text, or as pixels.

use std::fmt::Write;

use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, StrokeDash,
    Transform,
};

use super::text;
use crate::letters::{Cell, Font, Glyph};

/// Size of a character's field, and its capitals' height.
const FIELD_PX: [f64; 2] = [112.0, 140.0];
const CAP_PX: f64 = 60.0;

/// Fields in a row.
const PER_ROW: usize = 13;

/// Lower edge of the capitals below the upper edge of their field.
const BASELINE_PX: f64 = 104.0;

/// Colors of the strokes in their order, from the start again after the last.
const INKS: [Ink; 6] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [160, 60, 150], [190, 140, 0], [20, 20, 20]];
const GUIDE: Ink = [224, 224, 224];
const DARK: Ink = [150, 150, 150];
const NAME: Ink = [120, 120, 120];

type Ink = [u8; 3];

/// Something drawn, in pixels with y down.
enum Mark {
    Line { points: Vec<[f64; 2]>, ink: Ink, width_px: f64, dashed: bool },
    Dot { at: [f64; 2], ink: Ink },
    Arrow { corners: [[f64; 2]; 3], ink: Ink },
}

/// A sheet of characters.
pub struct Specimen {
    marks: Vec<Mark>,
    width_px: f64,
    height_px: f64,
}

impl Specimen {
    /// Draws characters; those that the font lacks are left out.
    ///
    /// # Panics
    ///
    /// Never: the names are written in a font of ours.
    #[must_use]
    pub fn new(font: &Font, characters: &str) -> Self {
        let pen = text::pen();
        let mut sheet = Self { marks: Vec::new(), width_px: 0.0, height_px: 0.0 };
        let mut index = 0;
        for character in characters.chars() {
            let [x, y] = [index % PER_ROW, index / PER_ROW];
            let corner = [x as f64 * FIELD_PX[0], y as f64 * FIELD_PX[1]];
            let width_m = font.aspect(character).unwrap_or(0.6) * CAP_PX;
            // Metres are pixels here, with the baseline at y = 0.
            let left_m = 0.5 * (FIELD_PX[0] - width_m);
            let cell = Cell { left_m, baseline_m: 0.0, width_m, cap_height_m: CAP_PX };
            if let Some(glyph) = font.glyph(character, cell) {
                sheet.guides(corner);
                sheet.write(
                    &pen,
                    &character.to_string(),
                    [corner[0] + 6.0, corner[1] + 18.0],
                    11.0,
                    NAME,
                );
                sheet.glyph(&pen, &glyph, corner);
                index += 1;
            }
        }
        let n_rows = index.div_ceil(PER_ROW).max(1);
        (sheet.width_px, sheet.height_px) =
            (PER_ROW as f64 * FIELD_PX[0], n_rows as f64 * FIELD_PX[1]);
        sheet
    }

    fn guides(&mut self, corner: [f64; 2]) {
        for up in [0.0, CAP_PX] {
            let y = corner[1] + BASELINE_PX - up;
            let points = vec![[corner[0] + 8.0, y], [corner[0] + FIELD_PX[0] - 8.0, y]];
            self.marks.push(Mark::Line { points, ink: GUIDE, width_px: 1.0, dashed: false });
        }
    }

    fn glyph(&mut self, pen: &Font, glyph: &Glyph, corner: [f64; 2]) {
        let place = |[x, y]: [f64; 2]| [corner[0] + x, corner[1] + BASELINE_PX - y];
        let runs = glyph.moves.chunk_by(|a, b| a.lit == b.lit && a.to_m == b.from_m);
        let (mut order, mut taken) = (0, Vec::new());
        for run in runs {
            let mut points = vec![place(run[0].from_m)];
            points.extend(run.iter().map(|step| place(step.to_m)));
            let length: f64 = points.windows(2).map(|leg| distance(leg[0], leg[1])).sum();
            if !run[0].lit {
                self.marks.push(Mark::Line { points, ink: DARK, width_px: 1.0, dashed: true });
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
                self.marks.push(Mark::Arrow { corners: arrow(&points, 0.5 * length), ink });
            }
            self.marks.push(Mark::Line { points, ink, width_px: 2.5, dashed: false });
            self.marks.push(Mark::Dot { at: begin, ink });
            let number = [begin[0] + 5.0 + 9.0 * crowd as f64, begin[1] - 4.0];
            self.write(pen, &order.to_string(), number, 8.0, ink);
        }
    }

    /// Writes a name or a number with single strokes, from its lower left corner on.
    fn write(&mut self, pen: &Font, text: &str, from: [f64; 2], cap_px: f64, ink: Ink) {
        let (lines, _) = text::lines(pen, text, from, cap_px);
        let line = |points| Mark::Line { points, ink, width_px: 1.0, dashed: false };
        self.marks.extend(lines.into_iter().map(line));
    }

    /// The sheet as an SVG file's text.
    #[must_use]
    pub fn svg(&self) -> String {
        let (width, height) = (self.width_px, self.height_px);
        let mut text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 \
             {width} {height}\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n<g fill=\"none\" \
             stroke-linecap=\"round\" stroke-linejoin=\"round\">\n"
        );
        let list = |points: &[[f64; 2]]| {
            let words: Vec<String> = points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
            words.join(" ")
        };
        for mark in &self.marks {
            let written = match mark {
                Mark::Line { points, ink, width_px, dashed } => {
                    let dash = if *dashed { " stroke-dasharray=\"3 3\"" } else { "" };
                    let points = list(points);
                    writeln!(
                        text,
                        "<polyline points=\"{points}\" stroke=\"{}\" stroke-width=\"{width_px}\"{dash}/>",
                        hex(*ink)
                    )
                }
                Mark::Dot { at: [x, y], ink } => {
                    writeln!(
                        text,
                        "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"3.5\" fill=\"{}\"/>",
                        hex(*ink)
                    )
                }
                Mark::Arrow { corners, ink } => {
                    writeln!(text, "<polygon points=\"{}\" fill=\"{}\"/>", list(corners), hex(*ink))
                }
            };
            written.expect("a string takes all");
        }
        text + "</g>\n</svg>\n"
    }

    /// The sheet as pixels: width, height, and three bytes a pixel.
    ///
    /// # Panics
    ///
    /// Never: a sheet has pixels.
    #[must_use]
    pub fn pixels(&self) -> (u32, u32, Vec<u8>) {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few thousand"
        )]
        let [width, height] = [self.width_px as u32, self.height_px as u32];
        let mut page = Pixmap::new(width, height).expect("a sheet has pixels");
        page.fill(Color::WHITE);
        for mark in &self.marks {
            let (Mark::Line { ink, .. } | Mark::Dot { ink, .. } | Mark::Arrow { ink, .. }) = mark;
            let mut paint = Paint { anti_alias: true, ..Paint::default() };
            paint.set_color_rgba8(ink[0], ink[1], ink[2], 255);
            let at = Transform::identity();
            match mark {
                Mark::Line { points, width_px, dashed, .. } => {
                    let dash = dashed.then(|| StrokeDash::new(vec![3.0, 3.0], 0.0)).flatten();
                    let (line_cap, line_join) = (LineCap::Round, LineJoin::Round);
                    let line_cap = if *dashed { LineCap::Butt } else { line_cap };
                    let width = narrow(*width_px);
                    let stroke = Stroke { width, dash, line_cap, line_join, ..Stroke::default() };
                    if let Some(path) = path(points, false) {
                        page.stroke_path(&path, &paint, &stroke, at, None);
                    }
                }
                Mark::Dot { at: [x, y], .. } => {
                    if let Some(dot) = PathBuilder::from_circle(narrow(*x), narrow(*y), 3.5) {
                        page.fill_path(&dot, &paint, FillRule::Winding, at, None);
                    }
                }
                Mark::Arrow { corners, .. } => {
                    if let Some(path) = path(corners, true) {
                        page.fill_path(&path, &paint, FillRule::Winding, at, None);
                    }
                }
            }
        }
        let rgb = page.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue()]).collect();
        (width, height, rgb)
    }
}

impl std::fmt::Debug for Specimen {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "Specimen({} x {} px)", self.width_px, self.height_px)
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

fn path(points: &[[f64; 2]], closed: bool) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (index, [x, y]) in points.iter().enumerate() {
        match index {
            0 => builder.move_to(narrow(*x), narrow(*y)),
            _ => builder.line_to(narrow(*x), narrow(*y)),
        }
    }
    if closed {
        builder.close();
    }
    builder.finish()
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(b[0] - a[0], b[1] - a[1])
}

fn hex([red, green, blue]: Ink) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

#[expect(clippy::cast_possible_truncation, reason = "a picture needs no more")]
fn narrow(value: f64) -> f32 {
    value as f32
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
        assert_eq!(count("stroke-dasharray"), 5);
        assert_eq!(count(&hex(GUIDE)), 4, "two guides each, and none for what the font lacks");
        let (width, height, rgb) = Specimen::new(&font, "HX").pixels();
        assert_eq!((width, height), (1456, 140));
        assert_eq!(rgb.len(), 3 * 1456 * 140);
        let blue = rgb.chunks(3).filter(|p| *p == INKS[0]).count();
        assert!(blue > 100, "the first strokes: {blue} pixels");
    }
}
