//! Handwriting as `InkML` (W3C Recommendation of 20 September 2011): traces and their format.
//!
//! Read: `trace` in document order, with `continuation`, `timeOffset` and `type="penUp"`; channels
//! X, Y and T of the first `traceFormat` (X, Y where there is none), values explicit (`!`), as first
//! (`'`) or second (`"`) differences. Y grows downward, as every tablet writes it, unless its
//! channel has `orientation="-ve"`. T is in milliseconds, or in `units`.
//! Not read: brushes, canvases and their transforms, references to other files.

use usvg::roxmltree::{Document, Node, ParsingOptions};

use super::{Written, xml};
use crate::error::{Error, Result};
use crate::files::Budget;

/// Most elements of a file.
const MAX_NODES: u32 = 200_000;

/// Meaning of a point's values.
struct Format {
    n_channels: usize,
    x: usize,
    y: usize,
    t: Option<usize>,
    upward: f64,
    seconds: f64,
}

/// Encoding of a channel's values.
#[derive(Clone, Copy, PartialEq)]
enum Coding {
    Explicit,
    Velocity,
    Acceleration,
}

/// Reads the traces.
pub(super) fn read(text: &str, file: &str) -> Result<Vec<Written>> {
    let hint = "export the ink as plain InkML: a traceFormat and traces, without references";
    xml::check_tags(text, &Budget::of(file, hint))?;
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options)
        .map_err(|broken| Error::input(file, broken.to_string(), "InkML", hint))?;
    let at =
        |node: Node<'_, '_>| format!("{file}:{}", document.text_pos_at(node.range().start).row);
    let root = document.root_element();
    if root.tag_name().name() != "ink" {
        let found = format!("<{}>", root.tag_name().name());
        return Err(Error::input(at(root), found, "<ink>", hint));
    }
    let format = root.descendants().find(|node| node.tag_name().name() == "traceFormat");
    let format = format.map_or_else(|| Some(Format::plain()), Format::read).ok_or_else(|| {
        let place = format.map_or_else(|| file.to_owned(), at);
        Error::input(place, "other channels", "channels X and Y", hint)
    })?;
    let mut traces: Vec<Written> = Vec::new();
    let mut latest_s = f64::NEG_INFINITY;
    for node in root.descendants().filter(|node| node.tag_name().name() == "trace") {
        if node.attribute("type") == Some("penUp") {
            continue;
        }
        let offset = node.attribute("timeOffset").map_or(Some(0.0), number);
        let read = offset.and_then(|ms| format.trace(node.text().unwrap_or(""), ms / 1000.0));
        let Some(trace) = read else {
            let found: String = node.text().unwrap_or("").trim().chars().take(40).collect();
            let wanted = format!("points of {} numbers, parted by commas", format.n_channels);
            return Err(Error::input(at(node), format!("`{found}`"), wanted, hint));
        };
        for time_s in &trace.times_s {
            if *time_s < latest_s {
                let found = "a time before the one before it";
                return Err(Error::input(at(node), found, "rising times", hint));
            }
            latest_s = *time_s;
        }
        let goes_on = matches!(node.attribute("continuation"), Some("middle" | "end"));
        match traces.last_mut().filter(|_| goes_on) {
            Some(last) => {
                last.points.extend(trace.points);
                last.times_s.extend(trace.times_s);
            }
            None if trace.points.is_empty() => {}
            None => traces.push(trace),
        }
    }
    Ok(traces)
}

impl Format {
    /// The format of a file that states none: X and Y.
    fn plain() -> Self {
        Self { n_channels: 2, x: 0, y: 1, t: None, upward: -1.0, seconds: 1e-3 }
    }

    /// `None` where X or Y is missing.
    fn read(node: Node<'_, '_>) -> Option<Self> {
        let channels: Vec<Node<'_, '_>> = node
            .descendants()
            .filter(|child| child.tag_name().name() == "channel")
            // Intermittent channels may be left out of a point; they come last.
            .filter(|c| !c.ancestors().any(|a| a.tag_name().name() == "intermittentChannels"))
            .collect();
        let find = |name: &str| channels.iter().position(|c| c.attribute("name") == Some(name));
        let (x, y, t) = (find("X")?, find("Y")?, find("T"));
        let upward = if channels[y].attribute("orientation") == Some("-ve") { 1.0 } else { -1.0 };
        let seconds = match t.and_then(|t| channels[t].attribute("units")) {
            Some("s") => 1.0,
            Some("us") => 1e-6,
            Some("ns") => 1e-9,
            _ => 1e-3,
        };
        Some(Self { n_channels: channels.len(), x, y, t, upward, seconds })
    }

    /// The points of a trace; `None` where one is invalid.
    fn trace(&self, text: &str, offset_s: f64) -> Option<Written> {
        let mut trace = Written::default();
        let mut coding = vec![Coding::Explicit; self.n_channels];
        let (mut value, mut step) = (vec![0.0; self.n_channels], vec![0.0; self.n_channels]);
        for point in text.split(',').map(str::trim).filter(|point| !point.is_empty()) {
            let words = tokens(point);
            if words.len() < self.n_channels {
                return None;
            }
            for (channel, word) in words.into_iter().take(self.n_channels).enumerate() {
                let (prefix, digits) =
                    word.split_at(usize::from(word.starts_with(['!', '\'', '"'])));
                coding[channel] = match prefix {
                    "!" => Coding::Explicit,
                    "'" => Coding::Velocity,
                    "\"" => Coding::Acceleration,
                    _ => coding[channel],
                };
                let drawn = [Some(self.x), Some(self.y), self.t].contains(&Some(channel));
                let given = if drawn { number(digits)? } else { number(digits).unwrap_or(0.0) };
                let before = value[channel];
                match coding[channel] {
                    Coding::Explicit => value[channel] = given,
                    Coding::Velocity => value[channel] += given,
                    Coding::Acceleration => value[channel] += step[channel] + given,
                }
                step[channel] = value[channel] - before;
                if value[channel].abs() > 1e15 {
                    return None;
                }
            }
            trace.points.push([value[self.x], self.upward * value[self.y]]);
            if let Some(t) = self.t {
                trace.times_s.push(offset_s + self.seconds * value[t]);
            }
        }
        Some(trace)
    }
}

/// Words of a point: blanks may be missing before a sign or a prefix (`10'5"-3`).
fn tokens(point: &str) -> Vec<&str> {
    let mut words = Vec::new();
    let mut begin = None;
    let mut last = ' ';
    for (at, c) in point.char_indices() {
        let breaks = c.is_whitespace()
            || "!'\"".contains(c)
            || "+-".contains(c) && (last.is_ascii_digit() || last == '.');
        if breaks && let Some(from) = begin.take() {
            words.push(&point[from..at]);
        }
        if !c.is_whitespace() && begin.is_none() {
            begin = Some(at);
        }
        last = c;
    }
    words.extend(begin.map(|from| &point[from..]));
    words
}

fn number(word: &str) -> Option<f64> {
    word.trim().parse().ok().filter(|value: &f64| value.abs() <= 1e15)
}
