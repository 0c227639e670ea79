//! Drawings: an SVG file, a bitmap, or handwriting as JSON becomes strokes.
//!
//! A drawing fills its canvas as far as its proportions allow. It is placed on the baseline and
//! aligned like a line of text. It has no word: it is one glyph, or one of each color, with the
//! character [`DRAWING`].

use std::path::Path;

use super::center_line::dot;
use super::options::{Align, LetterOptions, Pace};
use super::shape::{Run, pen_moves};
use super::smooth::smooth;
use super::vector::{coordinates, point};
use super::{Cell, Glyph, LeftOut, Move, StrokeOrder, Strokes};
use bitmap::Traced;
use detail::reduced;
use layers::Color;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Limit, ending};
use noctograph_core::geometry::{arc_lengths, bounds, distance, simplify};
use noctograph_core::input_error;
use noctograph_core::strokes::{Source, SourceStroke, StrokesData};
use selection::{Numbered, all, chosen};

mod areas;
mod bitmap;
mod detail;
mod handwriting;
mod ink;
mod layers;
mod levels;
mod notes;
mod once;
mod paper_photo;
mod selection;
mod size;
mod styles;
mod svg;
mod visibility;

/// Character of a drawing's glyphs: U+FFFC, the object replacement character.
pub const DRAWING: char = '\u{fffc}';

/// Largest file that is read.
pub const LIMIT: Limit = Limit {
    bytes: 8 << 20,
    what: "a drawing",
    hint: "simplify its paths, or make the picture smaller",
};

/// Most points of a drawing. At 0.2 m/s and a millimeter each, these are 16 minutes of flight.
const MAX_POINTS: usize = 200_000;

/// Most colors of a drawing in color.
const MAX_COLORS: usize = 64;

/// Default canvas of a drawing, in cap heights: width and height.
const CANVAS: [f64; 2] = [4.0, 1.0];

/// Spacing of points at which handwriting is smoothed, by its height.
const SPACING: f64 = 0.01;

/// Slowest pace of handwriting, as a share of the stroke speed.
const SLOWEST: f64 = 0.25;

/// A trace of the pen shorter than this, by the drawing's height, is a tap: a dot.
const TAP: f64 = 0.02;

/// Whether the colors of a drawing matter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// They do not: the drawing is one glyph.
    Alike,
    /// Each color of an SVG file is a glyph, in the order in which they first occur; of
    /// handwriting, which keeps its order, each run of strokes of one color.
    ByColor,
}

/// A stroke of handwriting: points, y up, in the writer's units, and when each was written.
#[derive(Clone, Debug, Default, PartialEq)]
struct Written {
    points: Vec<[f64; 2]>,
    /// As many as points, or none.
    times_s: Vec<f64>,
    color: Option<[u8; 3]>,
}

/// A line of a picture in its own units, y up, and its color.
type ColoredLine = (Vec<[f64; 2]>, Color);

/// Reads a drawing: `*.svg`, a picture `*.png`, `*.jpg`, `*.webp`, `*.gif` (its first frame) or
/// `*.bmp`, or handwriting `*.json`.
///
/// An SVG file is drawn as a browser shows it: strokes along their line, fills along their rim. A
/// filled rectangle behind everything is paper. In a picture, lines on paper are drawn along their
/// center and patches along their rim ([`LetterOptions::trace`]); a photograph of anything else is
/// refused. With less than full [`LetterOptions::detail`] strokes are fewer, longer and smoother. A
/// path has the color of its stroke, or else of its fill, and a gradient one of its own.
/// Unsupported features, such as filters, are named in the warnings; text is refused. Handwriting
/// keeps its order and direction, is smoothed by at most [`LetterOptions::smoothing_m`], and has
/// the pace of [`LetterOptions::pace`].
///
/// # Errors
///
/// [`Error::Io`] where the file cannot be read; [`Error::Input`] where it is broken, too large,
/// draws nothing, is of another kind, or has more than 64 colors by which it is to be written; or
/// for an option out of range.
pub fn draw(path: &Path, options: &LetterOptions, ink: Ink) -> Result<Strokes> {
    options.check()?;
    Strokes::new(drawn(path, options, ink)?)
}

fn drawn(path: &Path, options: &LetterOptions, ink: Ink) -> Result<StrokesData> {
    let file = path.display().to_string();
    match &*ending(path) {
        "svg" => {
            let drawing = svg::read(&LIMIT.read(path)?, &file)?;
            let mut placing = Placing::new(drawing.bounds(), options, &file)
                .map_err(|error| with_reasons(error, &drawing.warnings))?;
            let size = placing.size();
            let drawn = |scale: f64| {
                let lines = drawing.flatten(options.tolerance_m / scale, &file)?;
                detailed(lines, options.detail, size, |point| point, options, &file)
            };
            let (mut lines, mut left_out, strokes) = drawn(placing.scale)?;
            if !(options.ink.is_empty() && options.without.is_empty()) {
                // The chosen strokes fill the canvas, and are as smooth as at that size.
                placing = Placing::new(extent(&lines), options, &file)?;
                (lines, left_out, _) = drawn(placing.scale)?;
            }
            let source = Source { strokes, ..Source::default() };
            let warnings = drawing.warnings;
            let strokes = by_color(&lines, &placing, ink, &file)?;
            Ok(StrokesData { left_out, warnings, source, ..strokes })
        }
        "png" | "jpg" | "jpeg" | "webp" | "gif" | "bmp" => {
            let size =
                |extent| Ok(Placing::new(extent, options, &file)?.scale / options.cap_height_m);
            let Traced { lines, warnings, corners_px, in_file } =
                bitmap::read(&LIMIT.read(path)?, options, size, &file)?;
            let points = lines.iter().flat_map(|(line, _)| line.iter().copied());
            let larger = Placing::new(bounds(points), options, &file)?.size();
            // The field of the ink has a margin of a pixel, and counts from the first one's middle.
            let (lines, left_out, strokes) = detailed(
                lines,
                options.detail,
                larger,
                |point| in_file.apply(point.map(|x| x - 0.5)),
                options,
                &file,
            )?;
            let source = Source { strokes, corners_px, is_bitmap: true };
            let placing = Placing::new(extent(&lines), options, &file)?;
            let strokes = by_color(&lines, &placing, ink, &file)?;
            Ok(StrokesData { left_out, warnings, source, ..strokes })
        }
        "json" => {
            let (traces, canvas) = handwriting::read(&LIMIT.read_text(path)?, &file)?;
            let strokes = all(traces.iter().map(|it| (&it.points, it.color)), |point| point);
            let traces = chosen(traces, |trace| trace.color, options, &file)?;
            let source = Source { strokes, ..Source::default() };
            Ok(StrokesData { source, ..write(traces, canvas, options, ink, &file)? })
        }
        kind => Err(foreign(kind, &file)),
    }
}

/// The error of a file of an unsupported kind, with a way out.
fn foreign(kind: &str, file: &str) -> Error {
    let wanted = "a file *.svg, *.png, *.jpg, *.webp, *.gif, *.bmp or *.json (strokes)";
    let (content, hint) = match kind {
        "heic" | "heif" | "avif" => (
            "a photo of a kind that is not read",
            "save it as JPEG or PNG: on an iPhone, Settings > Camera > Formats > Most Compatible",
        ),
        "tif" | "tiff" | "jp2" | "pgm" | "ppm" | "pbm" | "tga" | "psd" | "psb" | "ico" | "xcf"
        | "kra" | "procreate" => (
            "a picture of a kind that is not read",
            "open it in the program that made it, and export it as PNG",
        ),
        "pdf" | "ai" | "eps" => {
            ("a document", "save the page as SVG, for example with Inkscape, or as PNG")
        }
        _ => ("a file of another kind", "save the drawing as SVG"),
    };
    Error::input(file, content, wanted, hint)
}

/// Lines of a drawing of some size in less detail: the chosen ones, the parts left out, and all
/// strokes as they lie in the file.
fn detailed(
    lines: Vec<ColoredLine>,
    detail: f64,
    size: f64,
    in_file: impl Fn([f64; 2]) -> [f64; 2],
    options: &LetterOptions,
    file: &str,
) -> Result<(Numbered<ColoredLine>, LeftOut, Vec<SourceStroke>)> {
    let (lines, left_out) = reduced(lines, detail, size, file)?;
    let strokes = all(lines.iter().map(|(line, color)| (line, Some(*color))), in_file);
    Ok((chosen(lines, |(_, color)| Some(*color), options, file)?, left_out, strokes))
}

/// Lines of a picture: one glyph, or one of each color.
fn by_color(
    lines: &Numbered<ColoredLine>,
    placing: &Placing,
    ink: Ink,
    file: &str,
) -> Result<StrokesData> {
    let numbers = lines.iter().map(|(number, (line, _))| placing.label(*number, line)).collect();
    if ink == Ink::Alike {
        let runs = lines.iter().map(|(_, (line, _))| placing.run(line)).collect();
        return Ok(StrokesData { numbers, ..placing.strokes(vec![runs], StrokeOrder::Free) });
    }
    let mut inks = Vec::new();
    for (_, (line, color)) in lines {
        add(&mut inks, placing.run(line), *color, file)?;
    }
    let (colors, glyphs) = inks.into_iter().unzip();
    Ok(StrokesData { colors, numbers, ..placing.strokes(glyphs, StrokeOrder::Free) })
}

/// The bounds of lines: left, bottom, right, top.
fn extent(lines: &Numbered<ColoredLine>) -> [f64; 4] {
    bounds(lines.iter().flat_map(|(_, (line, _))| line.iter().copied()))
}

/// Adds a run to those of its color.
fn add(inks: &mut Vec<([u8; 3], Vec<Run>)>, run: Run, color: [u8; 3], file: &str) -> Result<()> {
    match inks.iter().position(|(known, _)| *known == color) {
        Some(index) => inks[index].1.push(run),
        None if inks.len() < MAX_COLORS => inks.push((color, vec![run])),
        None => {
            return Err(input_error!(
                file,
                "a drawing of more colors",
                "at most {MAX_COLORS} colors",
                "draw with fewer colors, or write with another lamp than color-led",
            ));
        }
    }
    Ok(())
}

/// Handwriting placed, by the page that it is on or by its own bounds, and smoothed.
fn write(
    traces: Numbered<Written>,
    canvas: Option<[f64; 4]>,
    options: &LetterOptions,
    ink: Ink,
    file: &str,
) -> Result<StrokesData> {
    let n_points: usize = traces.iter().map(|(_, trace)| trace.points.len()).sum();
    if n_points > MAX_POINTS {
        return Err(too_many(file));
    }
    let points = traces.iter().flat_map(|(_, trace)| trace.points.iter().copied());
    let bounds = canvas.filter(|_| n_points > 0).unwrap_or_else(|| bounds(points));
    let placing = Placing::new(bounds, options, file)?;
    let (mut glyphs, mut colors, mut lasts_s) = (Vec::new(), Vec::new(), Vec::new());
    let mut numbers = Vec::new();
    for (number, trace) in &traces {
        numbers.push(placing.label(*number, &trace.points));
        let color = trace.color.filter(|_| ink == Ink::ByColor);
        if glyphs.is_empty() || color != colors.last().copied() {
            glyphs.push(Vec::new());
            colors.extend(color);
        }
        let line: Vec<_> = placing.run(&trace.points).points.into_iter().map(coordinates).collect();
        let (points, when) = smoothed(&line, &trace.times_s, options, placing.cell.cap_height_m);
        let moved = points.windows(2).map(|leg| leg[0] != leg[1]);
        let legs_s = when.windows(2).map(|t| t[1] - t[0]).zip(moved);
        lasts_s.extend(legs_s.filter_map(|(leg_s, moved)| moved.then_some(leg_s)));
        let points = points.into_iter().map(point).collect();
        glyphs.last_mut().expect("one was begun").push(Run { lit: true, points });
    }
    let mut strokes = StrokesData { colors, numbers, ..placing.strokes(glyphs, StrokeOrder::Kept) };
    if options.pace == Pace::Written {
        set_pace(&mut strokes, &lasts_s);
    }
    Ok(strokes)
}

/// Gives lit moves the pace of the writer's pen, as a share of its mean speed, from the duration of
/// each; nothing without durations.
fn set_pace(strokes: &mut StrokesData, lasts_s: &[f64]) {
    let lit = strokes.glyphs.iter_mut().flat_map(|glyph| &mut glyph.moves).filter(|step| step.lit);
    let timed: Vec<(&mut Move, f64)> = lit.zip(lasts_s.iter().copied()).collect();
    let whole_m: f64 = timed.iter().map(|(step, _)| distance(step.from_m, step.to_m)).sum();
    let mean_m_s = whole_m / lasts_s.iter().sum::<f64>();
    for (step, leg_s) in timed.into_iter().filter(|(_, leg_s)| *leg_s > 0.0) {
        let leg_m = distance(step.from_m, step.to_m);
        step.pace = (leg_m / leg_s / mean_m_s).clamp(SLOWEST, 1.0);
    }
}

/// A stroke smoothed and simplified, with the times of its points if it has any. A tap becomes a
/// dot.
fn smoothed(
    line: &[[f64; 2]],
    times_s: &[f64],
    options: &LetterOptions,
    height_m: f64,
) -> (Vec<[f64; 2]>, Vec<f64>) {
    let along = arc_lengths(line);
    let length_m = along[along.len() - 1];
    let is_tap = length_m < TAP * height_m;
    let points = if is_tap {
        dot(line[0], 1e-3 * TAP * height_m)
    } else if options.smoothing_m > 0.0 {
        smooth(line, SPACING * height_m, options.smoothing_m)
    } else {
        line.to_vec()
    };
    let kept = simplify(&points, options.tolerance_m);
    let times_s = kept.iter().filter(|_| !times_s.is_empty()).map(|index| {
        let share = match is_tap || options.smoothing_m > 0.0 {
            true => *index as f64 / (points.len() - 1) as f64,
            false => along[*index] / length_m,
        };
        if length_m == 0.0 {
            // A tap lasts as long as the pen was down.
            return times_s[0] + share * (times_s[times_s.len() - 1] - times_s[0]);
        }
        let way_m = share * length_m;
        let leg = along.partition_point(|s| *s < way_m).clamp(1, along.len() - 1);
        let (from, to) = (along[leg - 1], along[leg]);
        let part = if to > from { ((way_m - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 };
        times_s[leg - 1] + part * (times_s[leg] - times_s[leg - 1])
    });
    let times_s = times_s.collect();
    (kept.iter().map(|index| points[*index]).collect(), times_s)
}

/// Codes of errors: a drawing without strokes, and one of too many.
const EMPTY: &str = "drawing-empty";
const LARGE: &str = "drawing-large";

/// The error of an empty drawing, with the warnings: they may be the reason.
fn with_reasons(error: Error, warnings: &[String]) -> Error {
    let hint: Vec<&str> =
        std::iter::once(error.hint()).chain(warnings.iter().map(String::as_str)).collect();
    let hint = hint.join("; ");
    error.with_hint(hint)
}

/// From a drawing's own units, y up, to the plane of the word.
struct Placing {
    left: f64,
    bottom: f64,
    scale: f64,
    /// The drawing's box; a level line has a thousandth of its length as its height.
    cell: Cell,
}

impl Placing {
    fn new(bounds: [f64; 4], options: &LetterOptions, file: &str) -> Result<Self> {
        let [left, bottom, right, top] = bounds;
        let canvas_m = options.canvas_m.unwrap_or(CANVAS.map(|side| side * options.cap_height_m));
        let (width, height) = (right - left, top - bottom);
        let scale = (canvas_m[0] / width).min(canvas_m[1] / height);
        // Larger than the rounding of its coordinates, and not a single point.
        let size = left.abs().max(right.abs()).max(bottom.abs()).max(top.abs());
        if !(scale.is_finite() && scale > 0.0 && width.max(height) > 1e-9 * size) {
            let content = if width >= 0.0 { "a drawing without extent" } else { "nothing drawn" };
            let hint = "visible paths are drawn";
            return Err(Error::input(file, content, "at least one stroke", hint).coded(EMPTY));
        }
        let (width_m, height_m) = (width * scale, height * scale);
        let left_m = match options.align {
            Align::Left => 0.0,
            Align::Ae483 | Align::Center => -0.5 * width_m,
            Align::Right => -width_m,
        };
        let (cap_height_m, baseline_m) = (height_m.max(1e-3 * width_m), options.baseline_m);
        let width_m = width_m.max(1e-3 * cap_height_m);
        let cell = Cell { left_m, baseline_m, width_m, cap_height_m };
        Ok(Self { left, bottom, scale, cell })
    }

    /// The larger side in the drawing's own units.
    fn size(&self) -> f64 {
        self.cell.width_m.max(self.cell.cap_height_m) / self.scale
    }

    fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (x_m, y_m) = ((x - self.left) * self.scale, (y - self.bottom) * self.scale);
        [self.cell.left_m + x_m, self.cell.baseline_m + y_m]
    }

    /// A line's number, and the place for it in the picture of the plan: the middle of the segment
    /// halfway along the line, in meters.
    fn label(&self, number: usize, line: &[[f64; 2]]) -> (usize, [f64; 2]) {
        let along = arc_lengths(line);
        let half = 0.5 * along[along.len() - 1];
        let next = along.partition_point(|s| *s < half).max(1).min(line.len() - 1);
        let [a, b] = [line[next.saturating_sub(1)], line[next]];
        (number, self.place([0, 1].map(|i| 0.5 * (a[i] + b[i]))))
    }

    fn run(&self, line: &[[f64; 2]]) -> Run {
        let mut points: Vec<_> = line.iter().map(|place| point(self.place(*place))).collect();
        if points.len() == 1 {
            points.push(points[0]);
        }
        Run { lit: true, points }
    }

    /// Glyphs, all of them as large as the drawing.
    fn strokes(&self, glyphs: Vec<Vec<Run>>, order: StrokeOrder) -> StrokesData {
        let glyphs = glyphs.into_iter().map(|runs| {
            let mut moves = pen_moves(&runs, |point| point);
            moves.retain(|step| !step.lit || step.from_m != step.to_m);
            Glyph { character: DRAWING, cell: self.cell, moves }
        });
        StrokesData { glyphs: glyphs.collect(), order, ..StrokesData::default() }
    }
}

fn too_many(file: &str) -> Error {
    input_error!(
        file,
        "a drawing of more points",
        "at most {MAX_POINTS} points",
        "simplify the drawing, or raise letters.tolerance_m",
    )
    .coded(LARGE)
}

#[cfg(test)]
mod bitmap_tests;
#[cfg(test)]
mod handwritten_tests;
#[cfg(test)]
mod paper_photo_tests;
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
