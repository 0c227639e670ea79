//! Gradients: lines that are painted with one are cut into pieces of one color each.
//!
//! A gradient gives each point an offset from 0 to 1, and its stops give each offset a color (SVG
//! 2, section 14.2). The colors are quantized into levels, and a line is cut where the level
//! changes. Not modeled: the focal point of a radial gradient, which is taken for its center.

use kurbo::{Affine, Point};
use usvg::{BaseGradient, Paint as Server, SpreadMethod, Transform};

use super::super::vector::{counts, legs};
use super::{MAX_COLORS, MAX_POINTS, too_many};
use noctograph_core::error::Result;
use noctograph_core::files::Budget;
use noctograph_core::geometry::distance;

/// What colors a line of a drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Paint {
    Plain([u8; 3]),
    /// By its index.
    Gradient(usize),
}

impl Paint {
    /// The color of a paint that has one.
    pub(super) fn color(self) -> Option<[u8; 3]> {
        match self {
            Self::Plain(color) => Some(color),
            Self::Gradient(_) => None,
        }
    }
}

/// An offset, 0 to 1, and its color (sRGB).
type Stop = (f64, [u8; 3]);

/// A level of color: the offset at which it ends, and its color.
type Level = (f64, [u8; 3]);

/// A part of a line in one color.
type Piece = (Vec<[f64; 2]>, [u8; 3]);

/// Least difference of two levels in a channel, of 255. More makes the steps visible along a
/// stroke; less fills the memory of the lamps.
const STEP: f64 = 16.0;

/// Samples of a ramp in which levels are sought.
const SAMPLES: u32 = 512;

/// Shortest piece of a line, by the drawing's larger side: 5 mm of 2 m.
const SHORTEST: f64 = 1.0 / 400.0;

/// Steps of a sample of a line.
const STEPS: usize = 50;

/// A gradient where it paints.
#[derive(Debug)]
pub(super) struct Gradient {
    stops: Vec<Stop>,
    /// From the drawing's own units, y up: the offset of a linear gradient is x, that of a radial
    /// one the distance from the origin.
    offset_from_place: Affine,
    is_radial: bool,
    spread: SpreadMethod,
}

impl Gradient {
    /// The gradient of a paint server, seen through a transform; `None` where it is none.
    pub(super) fn new(server: &Server, place_from_user: Affine) -> Option<Self> {
        let number = f64::from;
        let (base, offset_from_gradient): (&BaseGradient, _) = match server {
            Server::LinearGradient(g) => {
                let [x1, y1, x2, y2] = [g.x1(), g.y1(), g.x2(), g.y2()].map(number);
                let (dx, dy) = (x2 - x1, y2 - y1);
                let square = dx * dx + dy * dy;
                let begin = (x1 * dx + y1 * dy) / square;
                (g, Affine::new([dx / square, 0.0, dy / square, 0.0, -begin, 0.0]))
            }
            Server::RadialGradient(g) => {
                let [cx, cy, r] = [g.cx(), g.cy(), g.r().get()].map(number);
                (g, Affine::scale(1.0 / r) * Affine::translate((-cx, -cy)))
            }
            Server::Color(_) | Server::Pattern(_) => return None,
        };
        let stop = |stop: &usvg::Stop| {
            let color = stop.color();
            (number(stop.offset().get()), [color.red, color.green, color.blue])
        };
        let place_from_gradient = place_from_user * affine(base.transform());
        Some(Self {
            stops: base.stops().iter().map(stop).collect(),
            offset_from_place: offset_from_gradient * place_from_gradient.inverse(),
            is_radial: matches!(server, Server::RadialGradient(_)),
            spread: base.spread_method(),
        })
    }

    /// The offset at a place; 1 for a gradient without extent.
    fn offset(&self, [x, y]: [f64; 2]) -> f64 {
        let at = self.offset_from_place * Point::new(x, y);
        let offset = if self.is_radial { libm::hypot(at.x, at.y) } else { at.x };
        match self.spread {
            _ if !offset.is_finite() => 1.0,
            SpreadMethod::Pad => offset.clamp(0.0, 1.0),
            SpreadMethod::Repeat => offset.rem_euclid(1.0),
            SpreadMethod::Reflect => 1.0 - (offset.rem_euclid(2.0) - 1.0).abs(),
        }
    }

    /// The color at a place, each channel 0 to 255.
    pub(super) fn color_at(&self, place: [f64; 2]) -> [f64; 3] {
        color(&self.stops, self.offset(place))
    }

    fn color(&self, ramp: &[Level], place: [f64; 2]) -> [u8; 3] {
        let offset = self.offset(place);
        ramp[ramp.partition_point(|(end, _)| *end <= offset).min(ramp.len() - 1)].1
    }

    /// The pieces of a line, each in the color of a level of the ramp. `size` is the drawing's
    /// larger side.
    fn pieces(&self, line: &[[f64; 2]], ramp: &[Level], size: f64) -> Vec<Piece> {
        let mut pieces = Vec::new();
        let (mut piece, mut length) = (vec![line[0]], 0.0);
        let mut color = self.color(ramp, line[0]);
        for [from, to] in legs(line) {
            let n = n_samples([from, to], size);
            let at = |k: f64| [0, 1].map(|i| from[i] + (to[i] - from[i]) * k / n);
            for k in counts(n) {
                let here = self.color(ramp, at(k + 0.5));
                if here != color && length >= SHORTEST * size {
                    if piece[piece.len() - 1] != at(k) {
                        piece.push(at(k));
                    }
                    pieces.push((std::mem::replace(&mut piece, vec![at(k)]), color));
                    length = 0.0;
                }
                if length == 0.0 {
                    color = here;
                }
                length += distance(from, to) / n;
            }
            piece.push(to);
        }
        pieces.push((piece, color));
        pieces
    }
}

/// A transform in full precision.
pub(super) fn affine(t: Transform) -> Affine {
    Affine::new([t.sx, t.ky, t.kx, t.sy, t.tx, t.ty].map(f64::from))
}

/// Samples of a leg.
fn n_samples([from, to]: [[f64; 2]; 2], size: f64) -> f64 {
    (distance(from, to) / (SHORTEST * size)).ceil().max(1.0)
}

/// The pieces of lines in gradients, each line's together, in levels as fine as the colors that are
/// left allow. `size` is the drawing's larger side.
///
/// # Errors
///
/// [`noctograph_core::error::Error::Input`] for too many points.
pub(super) fn pieces(
    lines: &[(&[[f64; 2]], usize)],
    gradients: &[Gradient],
    left: usize,
    size: f64,
    file: &str,
) -> Result<Vec<Vec<Piece>>> {
    let budget = Budget::of(file, "draw less, or without gradients");
    let mut ramps: Vec<&[Stop]> = Vec::new();
    for (line, index) in lines {
        let samples = legs(line).map(|leg| n_samples(leg, size));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
        let n_samples = samples.sum::<f64>() as usize;
        budget.steps(STEPS.saturating_mul(n_samples))?;
        let stops = &gradients[*index].stops[..];
        // More ramps than colors are refused for their colors.
        if ramps.len() <= MAX_COLORS && !ramps.contains(&stops) {
            ramps.push(stops);
        }
    }
    let mut step = STEP;
    let ramps_cut = loop {
        let cut: Vec<Vec<Level>> = ramps.iter().map(|stops| levels(stops, step)).collect();
        if cut.iter().map(Vec::len).sum::<usize>() <= left || step > 255.0 {
            break cut;
        }
        step *= 1.25;
    };
    let pieces = lines.iter().map(|(line, index)| {
        let gradient = &gradients[*index];
        let ramp = ramps.iter().position(|stops| *stops == gradient.stops).unwrap_or(0);
        gradient.pieces(line, &ramps_cut[ramp], size)
    });
    let pieces: Vec<Vec<_>> = pieces.collect();
    let n_points: usize = pieces.iter().flatten().map(|(piece, _)| piece.len()).sum();
    if n_points > MAX_POINTS { Err(too_many(file)) } else { Ok(pieces) }
}

/// Levels of color whose channels differ by a step.
fn levels(stops: &[Stop], step: f64) -> Vec<Level> {
    let mut levels = Vec::new();
    let (mut from, mut first) = (0.0, color(stops, 0.0));
    let middle = |from: f64, to: f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
        color(stops, 0.5 * (from + to)).map(|channel| channel.round() as u8)
    };
    for k in 1..=SAMPLES {
        let offset = f64::from(k) / f64::from(SAMPLES);
        let here = color(stops, offset);
        if (0..3).any(|i| (here[i] - first[i]).abs() > step) {
            levels.push((offset, middle(from, offset)));
            (from, first) = (offset, here);
        }
    }
    levels.push((1.0, middle(from, 1.0)));
    levels
}

/// The color at an offset, each channel 0 to 255.
fn color(stops: &[Stop], offset: f64) -> [f64; 3] {
    let next = stops.partition_point(|(at, _)| *at <= offset);
    let (before, after) = (stops[next.max(1) - 1], stops[next.min(stops.len() - 1)]);
    let span = after.0 - before.0;
    let part = if span > 0.0 { ((offset - before.0) / span).clamp(0.0, 1.0) } else { 0.0 };
    std::array::from_fn(|i| {
        let [from, to] = [before.1[i], after.1[i]].map(f64::from);
        from + (to - from) * part
    })
}
