//! Handwriting as JSON, as a page on a tablet writes it.
//!
//! ```json
//! {"strokes": [[[12, 40, 0.00], [13, 44, 0.02]], [[30, 41, 0.35], [36, 41, 0.40]]], "y": "down"}
//! ```
//!
//! A stroke is a list of points from pen down to pen up. A point is x, y and, if known, the time in
//! seconds. Units of length are arbitrary. `y` grows `down` (the default, as on screens) or `up`.
//! `"colors": [[255, 0, 0], [0, 0, 255]]` has red, green and blue of each stroke. Black leaves the
//! lamp its color. `"canvas": [left, top, right, bottom]` is the page that was written on: it is
//! placed as a whole, and a single tap is a dot. Other keys are ignored.

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

/// Spacing of points at which handwriting is smoothed, by its height.
const SPACING: f64 = 0.01;

/// Slowest pace of handwriting, as a fraction of the stroke speed.
const SLOWEST: f64 = 0.25;

/// A trace of the pen shorter than this, by the drawing's height, is a tap: a dot.
const TAP: f64 = 0.02;

/// A stroke of handwriting.
#[derive(Clone, Debug, Default, PartialEq)]
struct Written {
    /// Points, y up, in the writer's units.
    points: Vec<[f64; 2]>,
    /// When each point was written. Empty if the file does not say it.
    times_s: Vec<f64>,
    color: Option<[u8; 3]>,
}

/// Draws handwriting.
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

/// Reads the strokes, and the page with their canvas: left, bottom, right, top.
fn read(text: &str, file: &str) -> Result<(Vec<Written>, Option<[f64; 4]>)> {
    let hint = "write {\"strokes\": [[[x, y, t], ...], ...]} with t in seconds, or [x, y]";
    let page: Page = serde_json::from_str(text).map_err(|broken| {
        let place = format!("{file}:{}:{}", broken.line(), broken.column());
        Error::input(place, broken.to_string(), "handwriting as JSON", hint)
    })?;
    // Everything with y up from here on.
    let sign = match page.y {
        Upward::Down => -1.0,
        Upward::Up => 1.0,
    };
    let (n_strokes, n_colors) = (page.strokes.len(), page.colors.len());
    if n_colors > 0 && n_colors != n_strokes {
        let hint = "leave `colors` out, or add what is missing";
        return Err(input_error!(
            file,
            "{n_colors} colors",
            "{n_strokes}, one per stroke",
            "{hint}"
        ));
    }
    let canvas = page.canvas.map(|[left, top, right, bottom]| {
        let [bottom, top] = [sign * bottom, sign * top];
        [left, bottom.min(top), right, bottom.max(top)]
    });
    if let Some(sides @ [left, bottom, right, top]) = canvas
        && !(left < right && bottom < top && sides.iter().all(|side| side.abs() <= 1e9))
    {
        let canvas = format!("the canvas {:?}", page.canvas);
        let wanted = "left, top, right, bottom with an extent";
        return Err(Error::input(file, canvas, wanted, "leave `canvas` out"));
    }
    // All points have as many values as the first, and their times never fall.
    let mut traces = Vec::new();
    let mut n_values = None;
    let mut latest_s = f64::NEG_INFINITY;
    for (stroke, points) in page.strokes.iter().enumerate() {
        let mut trace = Written { color: page.colors.get(stroke).copied(), ..Written::default() };
        for (point, values) in points.iter().enumerate() {
            let n = *n_values.get_or_insert(values.len());
            let wanted = if values.len() != n || !(2..=3).contains(&n) {
                "[x, y] everywhere, or [x, y, t] everywhere"
            } else if values.iter().any(|value| value.abs() > 1e9) {
                "values up to 1e9"
            } else if canvas.is_some_and(|[left, bottom, right, top]| {
                let [x, y] = [values[0], sign * values[1]];
                !(left..=right).contains(&x) || !(bottom..=top).contains(&y)
            }) {
                "a point on the canvas"
            } else if values.get(2).is_some_and(|time_s| *time_s < latest_s) {
                "a time not before that of the point before it"
            } else {
                trace.points.push([values[0], sign * values[1]]);
                trace.times_s.extend(values.get(2));
                latest_s = values.get(2).copied().unwrap_or(latest_s);
                continue;
            };
            let place = format!("stroke {}, point {}", stroke + 1, point + 1);
            return Err(
                Error::input(place, format!("{values:?}"), wanted, hint).in_file(file, None)
            );
        }
        if !trace.points.is_empty() {
            traces.push(trace);
        }
    }
    Ok((traces, canvas))
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
        return Err(super::too_many(file));
    }
    let points = traces.iter().flat_map(|(_, trace)| trace.points.iter().copied());
    let bounds = canvas.filter(|_| n_points > 0).unwrap_or_else(|| bounds(points));
    let placing = Placing::new(bounds, options, file)?;
    let (mut glyphs, mut colors, mut lasts_s) = (Vec::new(), Vec::new(), Vec::new());
    let mut numbers = Vec::new();
    for (number, trace) in &traces {
        numbers.push(placing.label(*number, &trace.points));
        // A glyph for each run of strokes of one color, in the writer's order.
        let color = trace.color.filter(|_| ink == Ink::ByColor);
        if glyphs.is_empty() || color != colors.last().copied() {
            glyphs.push(Vec::new());
            colors.extend(color);
        }
        let line: Vec<_> = placing.run(&trace.points).points.into_iter().map(coordinates).collect();
        let (points, when) = smoothed(&line, &trace.times_s, options, placing.cell.cap_height_m);
        // Segments without length are no moves, and have no duration.
        let moved = points.windows(2).map(|ends| ends[0] != ends[1]);
        let segments_s = when.windows(2).map(|t| t[1] - t[0]).zip(moved);
        lasts_s.extend(segments_s.filter_map(|(segment_s, moved)| moved.then_some(segment_s)));
        let points = points.into_iter().map(point).collect();
        glyphs.last_mut().expect("one was begun").push(Run { lit: true, points });
    }
    let mut strokes = StrokesData { colors, numbers, ..placing.strokes(glyphs, StrokeOrder::Kept) };
    if options.pace == Pace::Written {
        set_pace(&mut strokes, &lasts_s);
    }
    Ok(strokes)
}

/// Gives lit moves the pace of the writer's pen, as a fraction of its mean speed, from the duration
/// of each. Without durations it does nothing.
fn set_pace(strokes: &mut StrokesData, lasts_s: &[f64]) {
    let lit = strokes.glyphs.iter_mut().flat_map(|glyph| &mut glyph.moves).filter(|step| step.lit);
    let timed: Vec<(&mut Move, f64)> = lit.zip(lasts_s.iter().copied()).collect();
    let whole_m: f64 = timed.iter().map(|(step, _)| distance(step.from_m, step.to_m)).sum();
    let mean_m_s = whole_m / lasts_s.iter().sum::<f64>();
    for (step, segment_s) in timed.into_iter().filter(|(_, segment_s)| *segment_s > 0.0) {
        let segment_m = distance(step.from_m, step.to_m);
        step.pace = (segment_m / segment_s / mean_m_s).clamp(SLOWEST, 1.0);
    }
}

/// A stroke smoothed and simplified, with the times of its points. A tap becomes a dot.
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
    // The time of a point is that of the raw line at the same fraction of its length.
    let kept = simplify(&points, options.tolerance_m);
    let times_s = kept.iter().filter(|_| !times_s.is_empty()).map(|index| {
        let fraction = match is_tap || options.smoothing_m > 0.0 {
            true => *index as f64 / (points.len() - 1) as f64,
            false => along[*index] / length_m,
        };
        if length_m == 0.0 {
            // A tap lasts as long as the pen was down.
            return times_s[0] + fraction * (times_s[times_s.len() - 1] - times_s[0]);
        }
        let along_m = fraction * length_m;
        let next = along.partition_point(|s| *s < along_m).clamp(1, along.len() - 1);
        let (from, to) = (along[next - 1], along[next]);
        let part = if to > from { ((along_m - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 };
        times_s[next - 1] + part * (times_s[next] - times_s[next - 1])
    });
    let times_s = times_s.collect();
    (kept.iter().map(|index| points[*index]).collect(), times_s)
}
