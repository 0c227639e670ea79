//! Segments become integer records: what both backends read, and all that they read.
//!
//! Widths change here and nowhere else: f64 before, integers after. A record's coordinates run in
//! σ of its own spot, so that one pair of tables fits every segment. What the rounding of the
//! directions does to the spot's area is put right in the amplitude (the determinant is taken from
//! the rounded integers), so that light is kept to the lattice error of a sampled gaussian.

use bytemuck::{Pod, Zeroable};
use glam::DVec2;

use super::merge::Segment;
use super::tables::{REACH_SIGMA, SIGMA_BITS};

/// Longest segment, in px and in σ whichever is more: longer ones are split, so that coordinates
/// stay below 128 σ and the boxes of slanted segments hold not too many dark pixels.
const MAX_LENGTH_PX: f64 = 64.0;
const MAX_LENGTH_SIGMA: f64 = 16.0;

/// Below this length a segment is a gaussian widened by L²/12 along its direction; its peak then
/// errs by less than 4e-6 (fourth cumulant of the smear), while the difference of two table values
/// would lose accuracy.
const DOT_LENGTH_SIGMA: f64 = 0.25;

/// Counts are rounded up or down by a threshold that differs from pixel to pixel, by these steps
/// along x and y, and from segment to segment. Rounding to nearest would lose the whole faint rim
/// of every spot where thousands of segments share the counts (2e-6 of the light of a hover at
/// 250 Hz); with the threshold the rim is right in the mean.
///
/// The steps are 2^32 over the plastic number and its square: evenly spread in the plane (Roberts
/// 2018, the R2 sequence).
pub(super) const DITHER: [u32; 2] = [0xC13F_A9A9, 0x91E1_0DA5];

/// One segment for the splat: 64 bytes, the layout of `Record` in `splat.wgsl`.
///
/// A pixel `(i, j)` of the box has `u = u0 + i ux + j uy` and `v = v0 + i vx + j vy`, in σ with
/// [`SIGMA_BITS`] fraction bits.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct Record {
    /// First pixel of the box.
    pub(super) x: u32,
    pub(super) y: u32,
    /// Pixels in the box.
    pub(super) width: u32,
    pub(super) height: u32,
    /// Along the segment from its start (from its middle where it is a dot).
    pub(super) u0: i32,
    pub(super) ux: i32,
    pub(super) uy: i32,
    /// Across.
    pub(super) v0: i32,
    pub(super) vx: i32,
    pub(super) vy: i32,
    /// Length of the segment; 0 makes it a dot.
    pub(super) length: i32,
    /// Counts at weight 1, times `2^(shift + 1)`: red, green, blue.
    pub(super) amplitude: [u32; 3],
    /// From 1 to 31.
    pub(super) shift: u32,
    /// Where the rounding of the counts starts: see [`DITHER`].
    pub(super) dither: u32,
}

/// A record before the film's scale is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stamp {
    record: Record,
    /// At weight 1, in lx s.
    amplitude_lx_s: [f64; 3],
}

impl Stamp {
    /// The box in the picture: first pixel and pixels along x and y.
    pub(super) fn area(&self) -> [u32; 4] {
        let Record { x, y, width, height, .. } = self.record;
        [x, y, width, height]
    }

    /// Luminous exposure at weight 1.
    pub(super) fn amplitude_lx_s(&self) -> [f64; 3] {
        self.amplitude_lx_s
    }

    /// Share of the amplitude that the brightest pixel can get: slope of Φ times the length.
    pub(super) fn peak(&self) -> f64 {
        match self.record.length {
            0 => 1.0,
            length => (0.4 * sigmas(length)).min(1.0),
        }
    }

    /// The record for a film whose count is `2^scale_log2` lx s.
    pub(super) fn record(&self, scale_log2: i32) -> Record {
        let counts = self.amplitude_lx_s.map(|lx_s| libm::ldexp(lx_s, -scale_log2));
        let (_, exponent) = libm::frexp(counts[0].max(counts[1]).max(counts[2]));
        let shift = (31 - exponent).clamp(1, 31);
        Record {
            amplitude: counts.map(|c| mantissa(libm::ldexp(c, shift + 1))),
            shift: shift.cast_unsigned(),
            ..self.record
        }
    }
}

/// Cuts a segment to what reaches a picture, splits it if it is long, and hands on its stamps.
pub(super) fn stamps(segment: &Segment, size_px: [u32; 2], mut each: impl FnMut(Stamp)) {
    let Some(segment) = clip(segment, size_px) else { return };
    let [start, end] = segment.ends_px;
    let longest = MAX_LENGTH_PX.max(MAX_LENGTH_SIGMA * segment.sigma_px);
    let n = (start.distance(end) / longest).ceil().max(1.0);
    let light = segment.light.map(|e| e / n);
    let mut dither = dither(segment.start_s);
    let mut k = 0.0;
    while k < n {
        let ends_px = [start.lerp(end, k / n), start.lerp(end, (k + 1.0) / n)];
        if let Some(stamp) = stamp(&Segment { ends_px, light, ..segment }, dither, size_px) {
            each(stamp);
        }
        dither = dither.wrapping_add(DITHER[0]);
        k += 1.0;
    }
}

/// The part of a segment whose light reaches the picture.
fn clip(segment: &Segment, size_px: [u32; 2]) -> Option<Segment> {
    let reach = DVec2::splat(REACH_SIGMA * segment.sigma_px + 1.0);
    let (low, high) = (-reach, DVec2::from(size_px.map(f64::from)) + reach);
    let [start, end] = segment.ends_px;
    let inside = |p: DVec2| p.cmpge(low).all() && p.cmple(high).all();
    if inside(start) && inside(end) {
        return Some(*segment);
    }

    // Liang and Barsky 1984: the part of the way that lies between each pair of borders.
    let way = end - start;
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        if way[axis] == 0.0 {
            if start[axis] < low[axis] || start[axis] > high[axis] {
                return None;
            }
            continue;
        }
        let a = (low[axis] - start[axis]) / way[axis];
        let b = (high[axis] - start[axis]) / way[axis];
        from = from.max(a.min(b));
        to = to.min(a.max(b));
    }
    (from < to).then(|| Segment {
        ends_px: [start + way * from, start + way * to],
        light: segment.light.map(|e| e * (to - from)),
        ..*segment
    })
}

/// The stamp of a short segment; `None` where its box misses the picture.
fn stamp(segment: &Segment, dither: u32, size_px: [u32; 2]) -> Option<Stamp> {
    let [start, end] = segment.ends_px;
    let sigma = segment.sigma_px;
    let reach = DVec2::splat(REACH_SIGMA * sigma);
    // Pixel centres are at +0.5.
    let first = (start.min(end) - reach - 0.5).ceil().max(DVec2::ZERO);
    let last =
        (start.max(end) + reach - 0.5).floor().min(DVec2::from(size_px.map(f64::from)) - 1.0);
    if first.cmpgt(last).any() {
        return None;
    }
    let length_px = start.distance(end);
    let along = if length_px > 0.0 { (end - start) / length_px } else { DVec2::X };
    let (origin, sigma_along, length) = if length_px < DOT_LENGTH_SIGMA * sigma {
        (start.midpoint(end), (sigma * sigma + length_px * length_px / 12.0).sqrt(), 0)
    } else {
        (start, sigma, fixed(length_px / sigma))
    };

    let (ux, uy) = (fixed(along.x / sigma_along), fixed(along.y / sigma_along));
    let (vx, vy) = (fixed(-along.y / sigma), fixed(along.x / sigma));
    let to_first = first + 0.5 - origin;
    // σ² of the spot in pixels, as the integers have it: the sum of a curve over the lattice is
    // its integral over the determinant. The integral of g is √(2π), that of Φ(u) - Φ(u - L) is L.
    let per_px = sigmas(ux) * sigmas(vy) - sigmas(uy) * sigmas(vx);
    let root_tau = std::f64::consts::TAU.sqrt();
    let integral = if length == 0 { root_tau * root_tau } else { sigmas(length) * root_tau };
    Some(Stamp {
        record: Record {
            x: pixel(first.x),
            y: pixel(first.y),
            width: pixel(last.x - first.x) + 1,
            height: pixel(last.y - first.y) + 1,
            u0: fixed(to_first.dot(along) / sigma_along),
            ux,
            uy,
            v0: fixed(along.perp_dot(to_first) / sigma),
            vx,
            vy,
            length,
            amplitude: [0; 3],
            shift: 1,
            dither,
        },
        amplitude_lx_s: segment.light.map(|e| e * per_px / integral),
    })
}

/// First threshold of a segment: its time, well mixed (Steele et al. 2014, splitmix64). Nothing but
/// the segment itself sets it, so that films add up whatever else is on them.
fn dither(start_s: f64) -> u32 {
    let mut z = start_s.to_bits();
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 32) as u32
}

/// A coordinate in σ as an integer.
#[expect(clippy::cast_possible_truncation, reason = "below 128 σ by the longest length")]
fn fixed(sigmas: f64) -> i32 {
    (sigmas * f64::from(1 << SIGMA_BITS)).round() as i32
}

/// An integer coordinate in σ.
fn sigmas(fixed: i32) -> f64 {
    f64::from(fixed) / f64::from(1 << SIGMA_BITS)
}

/// A whole number of pixels as an integer.
#[expect(clippy::cast_possible_truncation, reason = "between 0 and the picture's side")]
fn pixel(whole: f64) -> u32 {
    whole as u32
}

/// An amplitude of less than 2^32 as an integer.
#[expect(clippy::cast_possible_truncation, reason = "rounding up to 2^32 saturates")]
fn mantissa(value: f64) -> u32 {
    value.round() as u32
}
