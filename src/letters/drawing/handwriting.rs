//! Handwriting as JSON, as a page on a tablet writes it.
//!
//! ```json
//! {"strokes": [[[12, 40, 0.00], [13, 44, 0.02]], [[30, 41, 0.35], [36, 41, 0.40]]], "y": "down"}
//! ```
//!
//! A stroke is a list of points from pen down to pen up; a point is x, y and, if known, the time in
//! seconds. Units of length are arbitrary; `y` grows `down` (the default, as on screens) or `up`.
//! `"colors": [[255, 0, 0], [0, 0, 255]]`, if given, has red, green and blue of each stroke, for
//! lamps that write in colors; black is the lamp's own. `"canvas": [left, top, right, bottom]`, if
//! given, is the page that was written on: it is placed as a whole, so that a stroke keeps its
//! place on it, and a single tap is a dot. Other keys are ignored.

use serde::Deserialize;

use super::Written;
use noctograph_core::error::{Error, Result};
use noctograph_core::input_error;

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

/// Reads the strokes, and the page that they are on: left, bottom, right, top.
pub(super) fn read(text: &str, file: &str) -> Result<(Vec<Written>, Option<[f64; 4]>)> {
    let hint = "write {\"strokes\": [[[x, y, t], ...], ...]} with t in seconds, or [x, y]";
    let page: Page = serde_json::from_str(text).map_err(|broken| {
        let place = format!("{file}:{}:{}", broken.line(), broken.column());
        Error::input(place, broken.to_string(), "handwriting as JSON", hint)
    })?;
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
