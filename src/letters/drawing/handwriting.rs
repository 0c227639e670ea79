//! Handwriting in JSON, as a drawing page on a tablet saves it.
//!
//! ```json
//! {"strokes": [[[12, 40, 0.00], [13, 44, 0.02]], [[30, 41, 0.35], [36, 41, 0.40]]], "y": "down"}
//! ```
//!
//! A stroke is a list of points from pen down to pen up. A point contains x, y and, if known, the
//! time in seconds. Units of length are arbitrary. `y` increases `down` (the default, as on
//! screens) or `up`. `"colors": [[255, 0, 0], [0, 0, 255]]` contains the red, green and blue values
//! of each stroke. A black stroke is drawn in the lamp's default color. `"canvas": [left, top,
//! right, bottom]` is the page that was written on. If it is given, the whole page is placed in the
//! plane, and a single tap becomes a dot. All other keys of the file are ignored.

use serde::Deserialize;

use super::selection::{Numbered, chosen, in_source};
use super::{Ink, MAX_POINTS, Placing};
use crate::center_line::dot;
use crate::options::{LetterOptions, Pace};
use crate::shape::Run;
use crate::smooth::smooth;
use crate::vector::{coordinates, point};
use crate::{Move, StrokeOrder};
use noctograph_core::error::{Error, Result};
use noctograph_core::geometry::{arc_lengths, bounds, distance, simplify};
use noctograph_core::input_error;
use noctograph_core::strokes::{Source, StrokesData};

/// Spacing of points for smoothing handwriting, relative to its height.
const SPACING: f64 = 0.01;

/// Minimum pace of handwriting, as a fraction of the stroke speed.
const SLOWEST: f64 = 0.25;

/// Length, relative to the drawing's height, below which a trace of the pen is a tap (a dot).
const TAP: f64 = 0.02;

/// Length, relative to the drawing's height, of the line that represents a dot.
const DOT: f64 = 1e-3 * TAP;

/// Maximum magnitude of a coordinate or time.
const LARGEST: f64 = 1e9;

/// Hint for a malformed file.
const HINT: &str = "write {\"strokes\": [[[x, y, t], ...], ...]} with t in seconds, or [x, y]";

/// A stroke of handwriting.
#[derive(Clone, Debug, Default, PartialEq)]
struct Written {
    /// Points (y up) in the writer's units.
    points: Vec<[f64; 2]>,
    /// Time at which each point was written. Empty if the file does not contain times.
    times_s: Vec<f64>,
    color: Option<[u8; 3]>,
}

/// Returns the handwritten strokes that the options select, placed and smoothed.
pub(super) fn draw(
    text: &str,
    options: &LetterOptions,
    ink: Ink,
    file: &str,
) -> Result<StrokesData> {
    let (traces, canvas) = read(text, file)?;
    let lines = traces.iter().map(|trace| (&trace.points, trace.color));
    let source = Source { strokes: in_source(lines, |point| point), ..Source::default() };
    let traces = chosen(traces, |trace| trace.color, options, file)?;
    Ok(StrokesData { source, ..write(traces, canvas, options, ink, file)? })
}

#[derive(Deserialize)]
struct Page {
    strokes: Vec<Vec<Vec<f64>>>,
    #[serde(default)]
    colors: Vec<[u8; 3]>,
    #[serde(default)]
    y: Upward,
    canvas: Option<[f64; 4]>,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Upward {
    #[default]
    Down,
    Up,
}

/// Parses the strokes of a file, and its canvas: left, bottom, right and top. Fails if the file is
/// malformed.
fn read(text: &str, file: &str) -> Result<(Vec<Written>, Option<[f64; 4]>)> {
    let page: Page = serde_json::from_str(text).map_err(|broken| {
        let place = format!("{file}:{}:{}", broken.line(), broken.column());
        Error::input(place, broken.to_string(), "handwriting as JSON", HINT)
    })?;
    let (n_strokes, n_colors) = (page.strokes.len(), page.colors.len());
    if n_colors > 0 && n_colors != n_strokes {
        let hint = "omit `colors`, or add the missing colors";
        return Err(input_error!(
            file,
            "{n_colors} colors",
            "{n_strokes}, one per stroke",
            "{hint}"
        ));
    }
    let canvas = page.canvas(file)?;
    // All points must have as many values as the first, and their times must not decrease.
    let mut traces = Vec::new();
    let mut n_values = None;
    let mut latest_s = f64::NEG_INFINITY;
    for (stroke, points) in page.strokes.iter().enumerate() {
        let mut trace = Written { color: page.colors.get(stroke).copied(), ..Written::default() };
        for (point, values) in points.iter().enumerate() {
            let n = *n_values.get_or_insert(values.len());
            if let Some(wanted) = page.problem(values, n, canvas, latest_s) {
                let place = format!("stroke {}, point {}", stroke + 1, point + 1);
                let error = Error::input(place, format!("{values:?}"), wanted, HINT);
                return Err(error.in_file(file, None));
            }
            trace.points.push([values[0], page.sign() * values[1]]);
            trace.times_s.extend(values.get(2));
            latest_s = values.get(2).copied().unwrap_or(latest_s);
        }
        if !trace.points.is_empty() {
            traces.push(trace);
        }
    }
    Ok((traces, canvas))
}

impl Page {
    /// Returns the factor by which y is multiplied to point upward.
    fn sign(&self) -> f64 {
        match self.y {
            Upward::Down => -1.0,
            Upward::Up => 1.0,
        }
    }

    /// Returns the left, bottom, right and top of the canvas, if any. Fails if the canvas has no
    /// extent or is too large.
    fn canvas(&self, file: &str) -> Result<Option<[f64; 4]>> {
        let canvas = self.canvas.map(|[left, top, right, bottom]| {
            let [bottom, top] = [self.sign() * bottom, self.sign() * top];
            [left, bottom.min(top), right, bottom.max(top)]
        });
        if let Some(sides @ [left, bottom, right, top]) = canvas
            && !(left < right && bottom < top && sides.iter().all(|side| side.abs() <= LARGEST))
        {
            let canvas = format!("the canvas {:?}", self.canvas);
            let wanted = "left, top, right and bottom of a box that is not empty";
            return Err(Error::input(file, canvas, wanted, "leave `canvas` out"));
        }
        Ok(canvas)
    }

    /// Returns a description of the expected values if any value of a point is wrong, or `None` for
    /// a valid point. All points must have `n_values` values, and none may be earlier than
    /// `latest_s`.
    fn problem(
        &self,
        values: &[f64],
        n_values: usize,
        canvas: Option<[f64; 4]>,
        latest_s: f64,
    ) -> Option<&'static str> {
        if values.len() != n_values || !(2..=3).contains(&n_values) {
            return Some("[x, y] everywhere, or [x, y, t] everywhere");
        }
        let [x, y] = [values[0], self.sign() * values[1]];
        let is_off_canvas = canvas.is_some_and(|[left, bottom, right, top]| {
            !(left..=right).contains(&x) || !(bottom..=top).contains(&y)
        });
        if values.iter().any(|value| value.abs() > LARGEST) {
            Some("values up to 1e9")
        } else if is_off_canvas {
            Some("a point on the canvas")
        } else if values.get(2).is_some_and(|time_s| *time_s < latest_s) {
            Some("a time not before that of the previous point")
        } else {
            None
        }
    }
}

/// Places the traces by their canvas or, without one, by their bounds, and smooths them. Fails if
/// there are too many points or no extent.
fn write(
    traces: Numbered<Written>,
    canvas: Option<[f64; 4]>,
    options: &LetterOptions,
    ink: Ink,
    file: &str,
) -> Result<StrokesData> {
    let n_points: usize = traces.iter().map(|(_, trace)| trace.points.len()).sum();
    if n_points > MAX_POINTS {
        return Err(super::too_many(file));
    }
    let points = traces.iter().flat_map(|(_, trace)| trace.points.iter().copied());
    let bounds = canvas.filter(|_| n_points > 0).unwrap_or_else(|| bounds(points));
    let placing = Placing::new(bounds, options, file)?;
    let (mut glyphs, mut colors, mut durations_s) = (Vec::new(), Vec::new(), Vec::new());
    let mut numbers = Vec::new();
    for (number, trace) in &traces {
        numbers.push(placing.label(*number, &trace.points));
        // Consecutive strokes of one color form a glyph, in the writer's order.
        let color = trace.color.filter(|_| ink == Ink::ByColor);
        if glyphs.is_empty() || color != colors.last().copied() {
            glyphs.push(Vec::new());
            colors.extend(color);
        }
        let line: Vec<_> = placing.run(&trace.points).points.into_iter().map(coordinates).collect();
        let (points, times_s) = smoothed(&line, &trace.times_s, options, placing.cell.cap_height_m);
        // Segments of zero length are not moves, so they have no duration.
        let moved = points.windows(2).map(|ends| ends[0] != ends[1]);
        let segments_s = times_s.windows(2).map(|t| t[1] - t[0]).zip(moved);
        durations_s.extend(segments_s.filter_map(|(segment_s, moved)| moved.then_some(segment_s)));
        let points = points.into_iter().map(point).collect();
        glyphs.last_mut().expect("one was begun").push(Run { lit: true, points });
    }
    let mut strokes = StrokesData { colors, numbers, ..placing.strokes(glyphs, StrokeOrder::Kept) };
    if options.pace == Pace::Written {
        set_pace(&mut strokes, &durations_s);
    }
    Ok(strokes)
}

/// Sets the pace of each lit move, as a fraction of the writer's mean speed, from its duration in
/// s. Does nothing if there are no durations.
fn set_pace(strokes: &mut StrokesData, durations_s: &[f64]) {
    let lit = strokes.glyphs.iter_mut().flat_map(|glyph| &mut glyph.moves).filter(|step| step.lit);
    let timed: Vec<(&mut Move, f64)> = lit.zip(durations_s.iter().copied()).collect();
    let length_m: f64 = timed.iter().map(|(step, _)| distance(step.from_m, step.to_m)).sum();
    let mean_m_s = length_m / durations_s.iter().sum::<f64>();
    for (step, segment_s) in timed.into_iter().filter(|(_, segment_s)| *segment_s > 0.0) {
        let segment_m = distance(step.from_m, step.to_m);
        step.pace = (segment_m / segment_s / mean_m_s).clamp(SLOWEST, 1.0);
    }
}

/// Smooths and simplifies the points of a stroke in m, and returns them with their times in s, if
/// any. A tap becomes a dot. `height_m` is the drawing's height.
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
        dot(line[0], DOT * height_m)
    } else if options.smoothing_m > 0.0 {
        smooth(line, SPACING * height_m, options.smoothing_m)
    } else {
        line.to_vec()
    };
    // A point's time is interpolated at the same fraction of the raw line's length.
    let kept = simplify(&points, options.tolerance_m);
    let times_s = kept.iter().filter(|_| !times_s.is_empty()).map(|index| {
        let fraction = if is_tap || options.smoothing_m > 0.0 {
            *index as f64 / (points.len() - 1) as f64
        } else {
            along[*index] / length_m
        };
        if length_m == 0.0 {
            // A tap lasts as long as the pen touched the page.
            return times_s[0] + fraction * (times_s[times_s.len() - 1] - times_s[0]);
        }
        time_along_s(fraction * length_m, &along, times_s)
    });
    let times_s = times_s.collect();
    (kept.iter().map(|index| points[*index]).collect(), times_s)
}

/// Returns the time in s at a distance along a line, interpolated between the times of its points.
fn time_along_s(length_m: f64, arc_lengths_m: &[f64], times_s: &[f64]) -> f64 {
    let next = arc_lengths_m.partition_point(|s| *s < length_m).clamp(1, arc_lengths_m.len() - 1);
    let (from, to) = (arc_lengths_m[next - 1], arc_lengths_m[next]);
    let fraction = if to > from { ((length_m - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 };
    times_s[next - 1] + fraction * (times_s[next] - times_s[next - 1])
}
