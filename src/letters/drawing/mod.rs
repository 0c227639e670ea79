//! Drawings: an SVG file, a bitmap, or handwriting as JSON becomes strokes.
//!
//! A drawing fills its canvas as far as its proportions allow. The drawing is placed on the
//! baseline and aligned like a line of text. A drawing has no letters, so it becomes a single
//! glyph, or one glyph for each color, with the character [`DRAWING`].

use std::path::Path;

use super::options::{Align, LetterOptions};
use super::shape::{Run, pen_moves};
use super::vector::point;
use super::{Cell, Glyph, LeftOut, StrokeOrder, Strokes};
use bitmap::Traced;
use detail::reduced;
use layers::Color;
use noctograph_core::diagnostic::{Diagnostic, Warned};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Limit, ending};
use noctograph_core::geometry::{arc_lengths, bounds};
use noctograph_core::input_error;
use noctograph_core::strokes::{Source, SourceStroke, StrokesData};
use selection::{Numbered, chosen, in_source};

mod areas;
mod bitmap;
mod detail;
mod handwriting;
mod ink;
mod layers;
mod levels;
mod notes;
mod once;
mod patches;
mod rulings;
mod selection;
mod sheet;
mod size;
mod styles;
mod svg;
mod visibility;

/// Character of a drawing's glyphs: U+FFFC, the object replacement character.
pub const DRAWING: char = '\u{fffc}';

/// Maximum size of a drawing's file.
pub const LIMIT: Limit = Limit {
    bytes: 8 << 20,
    what: "a drawing",
    hint: "simplify the drawing's paths, or make the picture smaller",
};

/// Maximum number of points of a drawing. At 0.2 m/s and a millimeter per point, they take 16
/// minutes of flight.
const MAX_POINTS: usize = 200_000;

/// Maximum number of colors of a drawing in color.
const MAX_COLORS: usize = 64;

/// Default width and height of a drawing's canvas, in cap heights.
const CANVAS: [f64; 2] = [4.0, 1.0];

/// Minimum extent of a drawing relative to its largest coordinate, larger than rounding errors.
const ROUNDING: f64 = 1e-9;

/// Height of a horizontal line's cell, or width of a vertical line's cell, relative to its length.
const FLAT: f64 = 1e-3;

/// Error codes for a drawing without strokes and for a drawing with too many.
const EMPTY: &str = "drawing-empty";
const LARGE: &str = "drawing-large";

/// How the colors of a drawing are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// Colors are ignored: the drawing is a single glyph.
    Alike,
    /// Each color of an SVG file or a picture is a glyph, in the order of first occurrence.
    /// Handwriting keeps its order, so each run of strokes of one color is a glyph.
    ByColor,
}

/// A line of a picture in the picture's units (y up), and its color.
type ColoredLine = (Vec<[f64; 2]>, Color);

/// Reads a drawing: `*.svg`, a picture `*.png`, `*.jpg`, `*.webp`, `*.gif` (its first frame) or
/// `*.bmp`, or handwriting `*.json`.
///
/// An SVG file is drawn as a browser shows it, with strokes along their line and fills along their
/// outline. In a picture, lines on paper are drawn along their center, and patches along their
/// outline. Handwriting keeps its order and direction. Warnings name unsupported features, and
/// files that contain text are rejected.
///
/// # Errors
///
/// Returns [`Error::Io`] if the file cannot be read. Returns [`Error::Input`] if the file is
/// broken, too large, of another kind, draws nothing, or has more than 64 colors when it is written
/// by color, and for an option out of range.
pub fn draw(path: &Path, options: &LetterOptions, ink: Ink) -> Result<Strokes> {
    options.check()?;
    let file = path.display().to_string();
    Strokes::new(match &*ending(path) {
        "svg" => of_svg(&LIMIT.read(path)?, options, ink, &file)?,
        "png" | "jpg" | "jpeg" | "webp" | "gif" | "bmp" => {
            of_bitmap(&LIMIT.read(path)?, options, ink, &file)?
        }
        "json" => handwriting::draw(&LIMIT.read_text(path)?, options, ink, &file)?,
        kind => return Err(foreign(kind, &file)),
    })
}

/// Returns the strokes of an SVG file, on the canvas of the options. `file` names it in errors.
fn of_svg(bytes: &[u8], options: &LetterOptions, ink: Ink, file: &str) -> Result<StrokesData> {
    let Warned { product: drawing, warnings } = svg::read(bytes, file)?;
    let mut placing = Placing::new(drawing.bounds(), options, file)
        .map_err(|error| with_reasons(error, &warnings))?;
    let size = placing.size();
    let lines = drawing.flatten(options.tolerance_m / placing.scale, file)?;
    let mut detailed = Detailed::new(lines, size, |point| point, options, file)?;
    if !(options.ink.is_empty() && options.without.is_empty()) {
        // The chosen strokes fill the canvas, and are flattened again for that size. The source
        // remains that of the whole drawing, so that it does not depend on the choice.
        placing = Placing::new(extent(&detailed.lines), options, file)?;
        let lines = drawing.flatten(options.tolerance_m / placing.scale, file)?;
        let source = detailed.source;
        detailed = Detailed::new(lines, size, |point| point, options, file)?;
        detailed.source = source;
    }
    let source = Source { strokes: detailed.source, ..Source::default() };
    let left_out = detailed.left_out;
    let strokes = by_color(&detailed.lines, &placing, ink, file)?;
    Ok(StrokesData { left_out, warnings, source, ..strokes })
}

/// Returns the strokes of a bitmap, on the canvas of the options. `file` names it in errors.
fn of_bitmap(bytes: &[u8], options: &LetterOptions, ink: Ink, file: &str) -> Result<StrokesData> {
    let size = |extent| Ok(Placing::new(extent, options, file)?.scale / options.cap_height_m);
    let Warned { product: Traced { lines, corners_px, in_file }, warnings } =
        bitmap::read(bytes, options, size, file)?;
    let points = lines.iter().flat_map(|(line, _)| line.iter().copied());
    let larger_side = Placing::new(bounds(points), options, file)?.size();
    // Traced points are relative to the center of a margin pixel, half a pixel before the picture.
    let in_file = |point: [f64; 2]| in_file.apply(point.map(|x| x - 0.5));
    let Detailed { lines, left_out, source } =
        Detailed::new(lines, larger_side, in_file, options, file)?;
    let source = Source { strokes: source, corners_px, is_bitmap: true };
    let placing = Placing::new(extent(&lines), options, file)?;
    let strokes = by_color(&lines, &placing, ink, file)?;
    Ok(StrokesData { left_out, warnings, source, ..strokes })
}

/// Returns the error for a file of an unsupported kind, with a hint about how to convert it.
fn foreign(kind: &str, file: &str) -> Error {
    let wanted = "a file *.svg, *.png, *.jpg, *.webp, *.gif, *.bmp or *.json (strokes)";
    let (content, hint) = match kind {
        "heic" | "heif" | "avif" => (
            "a photo in an unsupported format",
            "save a JPEG or PNG: on an iPhone, Settings > Camera > Formats > Most \
             Compatible",
        ),
        "tif" | "tiff" | "jp2" | "jxl" | "pgm" | "ppm" | "pbm" | "tga" | "psd" | "psb" | "ico"
        | "xcf" | "kra" | "procreate" => (
            "a picture in an unsupported format",
            "open the picture in the program that made it, and export it as PNG",
        ),
        "pdf" | "ai" | "eps" => {
            ("a document", "save the page as SVG, for example with Inkscape, or as PNG")
        }
        _ => ("a file in an unsupported format", "save the drawing as SVG"),
    };
    Error::input(file, content, wanted, hint)
}

/// A drawing at the requested level of detail.
struct Detailed {
    /// The selected lines.
    lines: Numbered<ColoredLine>,
    left_out: LeftOut,
    /// All strokes, in the coordinates of the file.
    source: Vec<SourceStroke>,
}

impl Detailed {
    /// Reduces the lines of a drawing whose larger side is `size`, and selects those that the
    /// options name. `in_file` maps points with y down to the file.
    fn new(
        lines: Vec<ColoredLine>,
        size: f64,
        in_file: impl Fn([f64; 2]) -> [f64; 2],
        options: &LetterOptions,
        file: &str,
    ) -> Result<Self> {
        let (lines, left_out) = reduced(lines, options.detail, size, file)?;
        let source = in_source(lines.iter().map(|(line, color)| (line, Some(*color))), in_file);
        let lines = chosen(lines, |(_, color)| Some(*color), options, file)?;
        Ok(Self { lines, left_out, source })
    }
}

/// Returns the strokes of lines as one glyph, or as one glyph for each color in the order of first
/// occurrence. Fails for more than [`MAX_COLORS`] colors.
fn by_color(
    lines: &Numbered<ColoredLine>,
    placing: &Placing,
    ink: Ink,
    file: &str,
) -> Result<StrokesData> {
    // Runs are grouped by color, in the order of the colors' first lines.
    let mut inks: Vec<(Color, Vec<Run>)> = Vec::new();
    for (_, (line, color)) in lines {
        match inks.iter_mut().find(|(other, _)| ink == Ink::Alike || other == color) {
            Some((_, runs)) => runs.push(placing.run(line)),
            None => inks.push((*color, vec![placing.run(line)])),
        }
    }
    if inks.len() > MAX_COLORS {
        return Err(input_error!(
            file,
            "a drawing with too many colors",
            "at most {MAX_COLORS} colors",
            "draw with fewer colors, or with a lamp other than color-led",
        ));
    }
    let numbers = lines.iter().map(|(number, (line, _))| placing.label(*number, line)).collect();
    let (mut colors, glyphs): (Vec<Color>, Vec<_>) = inks.into_iter().unzip();
    if ink == Ink::Alike {
        colors.clear();
    }
    Ok(StrokesData { colors, numbers, ..placing.strokes(glyphs, StrokeOrder::Free) })
}

/// Returns the bounds of lines: left, bottom, right and top.
fn extent(lines: &Numbered<ColoredLine>) -> [f64; 4] {
    bounds(lines.iter().flat_map(|(_, (line, _))| line.iter().copied()))
}

/// Adds warnings to the hint of an empty drawing's error, because they may name the reason.
fn with_reasons(error: Error, warnings: &[Diagnostic]) -> Error {
    let mut hint = error.hint().to_owned();
    for warning in warnings {
        hint += &format!("; {warning}");
    }
    error.with_hint(hint)
}

/// The transform from a drawing's units (y up) to the plane of the word.
struct Placing {
    /// Left and lower edge of the drawing in its units.
    left: f64,
    bottom: f64,
    /// Length in m of a unit of the drawing.
    scale: f64,
    /// The drawing's box in the plane of the word.
    cell: Cell,
}

impl Placing {
    /// Places a drawing with these bounds, left, bottom, right and top, on the canvas. Returns
    /// [`Error::Input`] if the drawing has no extent.
    fn new(bounds: [f64; 4], options: &LetterOptions, file: &str) -> Result<Self> {
        let [left, bottom, right, top] = bounds;
        let canvas_m = options.canvas_m.unwrap_or(CANVAS.map(|side| side * options.cap_height_m));
        let (width, height) = (right - left, top - bottom);
        let scale = (canvas_m[0] / width).min(canvas_m[1] / height);
        let size = left.abs().max(right.abs()).max(bottom.abs()).max(top.abs());
        if !(scale.is_finite() && scale > 0.0 && width.max(height) > ROUNDING * size) {
            let content = if width >= 0.0 { "a drawing without extent" } else { "nothing drawn" };
            let hint = "add a visible path, because only visible paths are drawn";
            return Err(Error::input(file, content, "at least one stroke", hint).coded(EMPTY));
        }
        let (width_m, height_m) = (width * scale, height * scale);
        // A drawing has no gaps, so the alignment of the reference flight centers it.
        let left_m = match options.align {
            Align::Left => 0.0,
            Align::Ae483 | Align::Center => -0.5 * width_m,
            Align::Right => -width_m,
        };
        let (cap_height_m, baseline_m) = (height_m.max(FLAT * width_m), options.baseline_m);
        let width_m = width_m.max(FLAT * cap_height_m);
        let cell = Cell { left_m, baseline_m, width_m, cap_height_m };
        Ok(Self { left, bottom, scale, cell })
    }

    /// Returns the larger side of the drawing in the drawing's units.
    fn size(&self) -> f64 {
        self.cell.width_m.max(self.cell.cap_height_m) / self.scale
    }

    /// Maps a point of the drawing to the plane of the word.
    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (x_m, y_m) = ((x - self.left) * self.scale, (y - self.bottom) * self.scale);
        [self.cell.left_m + x_m, self.cell.baseline_m + y_m]
    }

    /// Returns a line's number, and the position in m of its label in the plan's picture: its
    /// midpoint.
    fn label(&self, number: usize, line: &[[f64; 2]]) -> (usize, [f64; 2]) {
        let along = arc_lengths(line);
        let half = 0.5 * along[along.len() - 1];
        let next = along.partition_point(|s| *s < half).max(1).min(line.len() - 1);
        let [a, b] = [line[next.saturating_sub(1)], line[next]];
        (number, self.place([0, 1].map(|i| 0.5 * (a[i] + b[i]))))
    }

    /// Returns the lit run along a line. A single point becomes a run of two equal points.
    fn run(&self, line: &[[f64; 2]]) -> Run {
        let mut points: Vec<_> = line.iter().map(|place| point(self.place(*place))).collect();
        if points.len() == 1 {
            points.push(points[0]);
        }
        Run { lit: true, points }
    }

    /// Returns the strokes of runs, with one glyph for each list. The cell of each glyph is the
    /// whole drawing.
    fn strokes(&self, glyphs: Vec<Vec<Run>>, order: StrokeOrder) -> StrokesData {
        let glyphs = glyphs.into_iter().map(|runs| {
            let mut moves = pen_moves(&runs, |point| point);
            moves.retain(|step| !step.lit || step.from_m != step.to_m);
            Glyph { character: DRAWING, cell: self.cell, moves }
        });
        StrokesData { glyphs: glyphs.collect(), order, ..StrokesData::default() }
    }
}

/// Returns the error for a drawing of more than [`MAX_POINTS`].
fn too_many(file: &str) -> Error {
    input_error!(
        file,
        "a drawing with too many points",
        "at most {MAX_POINTS} points",
        "simplify the drawing, or raise letters.tolerance_m",
    )
    .coded(LARGE)
}

#[cfg(test)]
mod picture_tests;
#[cfg(test)]
mod suite_tests;
#[cfg(test)]
mod surroundings_tests;
#[cfg(test)]
mod svg_tests;
#[cfg(test)]
mod tests;
