//! Segments become integer records: what both backends read, and all that they read.
//!
//! Widths change here and nowhere else: f64 before, integers after. A segment is the integral of
//! a gaussian spot along its way; Gauss-Legendre quadrature makes that a sum of up to
//! [`SPOTS`] spots, each the product of one curve along x and one along y, which is all that the
//! backends have to add up. A ramp of the brightness along the way is in the spots' shares, so a
//! fade costs nothing. Coordinates run in σ of the record's own spot, so that one table fits all.
//! What rounding does to the spot's area is put right in the amplitude, so that light is kept to
//! the lattice error of a sampled gaussian.

use bytemuck::{Pod, Zeroable};
use glam::DVec2;

use super::merge::Segment;
use super::tables::{REACH_SIGMA, SIGMA_BITS, fixed};

/// Spots in a record, at most.
pub(super) const SPOTS: usize = 4;

/// Share 1 of a spot in its record.
pub(super) const SHARE_BITS: u32 = 31;

/// Longest way, in σ, that 1, 2, 3 and 4 spots draw to within 6e-6 of its peak (error term of the
/// quadrature, with the gaussian's derivative of order 2n at its middle). Longer ways are split.
const LONGEST_SIGMA: [f64; SPOTS] = [0.011, 0.3, 0.95, 1.8];

/// Places from -1 to 1 and shares of 1, 2, 3 and 4 spots (Gauss and Legendre: Abramowitz and
/// Stegun 1964, table 25.4).
const RULES: [&[(f64, f64)]; SPOTS] = [
    &[(0.0, 1.0)],
    &[(-0.577_350_269_189_625_8, 0.5), (0.577_350_269_189_625_8, 0.5)],
    &[
        (-0.774_596_669_241_483_4, 5.0 / 18.0),
        (0.0, 8.0 / 18.0),
        (0.774_596_669_241_483_4, 5.0 / 18.0),
    ],
    &[
        (-0.861_136_311_594_052_6, 0.173_927_422_568_727),
        (-0.339_981_043_584_856_3, 0.326_072_577_431_273),
        (0.339_981_043_584_856_3, 0.326_072_577_431_273),
        (0.861_136_311_594_052_6, 0.173_927_422_568_727),
    ],
];

/// Counts are rounded up or down by a threshold that differs from pixel to pixel, by these steps
/// along x and y, and from segment to segment. Rounding to nearest would lose the whole faint rim
/// of every spot where thousands of segments share the counts (2e-6 of the light of a hover at
/// 250 Hz); with the threshold the rim is right in the mean.
///
/// The steps are 2^32 over the plastic number and its square: evenly spread in the plane (Roberts
/// 2018, the R2 sequence).
pub(super) const DITHER: [u32; 2] = [0xC13F_A9A9, 0x91E1_0DA5];

/// One segment for the splat: 96 bytes, the layout of `Record` in `splat.wgsl`.
///
/// Spot k lies `(u[k] + i step, v[k] + j step)` from pixel `(i, j)` of the box, in σ with
/// [`SIGMA_BITS`] fraction bits.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct Record {
    /// Along x and y, with the sign of pixel minus spot.
    pub(super) u: [i32; SPOTS],
    pub(super) v: [i32; SPOTS],
    /// Parts of the amplitude, of [`SHARE_BITS`] bits; the first `spots` of them count.
    pub(super) share: [u32; SPOTS],
    /// First pixel of the box.
    pub(super) x: u32,
    pub(super) y: u32,
    /// Pixels in the box.
    pub(super) width: u32,
    pub(super) height: u32,
    /// Edge of a pixel in σ.
    pub(super) step: i32,
    /// From 1 to [`SPOTS`].
    pub(super) spots: u32,
    /// Counts at weight 1, times `2^shift`: red, green, blue.
    pub(super) amplitude: [u32; 3],
    /// From 1 to 31.
    pub(super) shift: u32,
    /// Where the rounding of the counts starts: see [`DITHER`].
    pub(super) dither: u32,
    /// Fills the record to a whole number of `vec4`.
    pub(super) unused: u32,
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

    /// Luminous exposure at weight 1: no pixel gets more.
    pub(super) fn amplitude_lx_s(&self) -> [f64; 3] {
        self.amplitude_lx_s
    }

    /// The record for a film whose count is `2^scale_log2` lx s.
    pub(super) fn record(&self, scale_log2: i32) -> Record {
        let counts = self.amplitude_lx_s.map(|lx_s| libm::ldexp(lx_s, -scale_log2));
        let (_, exponent) = libm::frexp(counts[0].max(counts[1]).max(counts[2]));
        let shift = (32 - exponent).clamp(1, 31);
        Record {
            amplitude: counts.map(|c| mantissa(libm::ldexp(c, shift))),
            shift: shift.cast_unsigned(),
            ..self.record
        }
    }
}

/// Cuts a segment to what reaches a picture, splits it if it is long, and hands on its stamps.
pub(super) fn stamps(segment: &Segment, size_px: [u32; 2], mut each: impl FnMut(Stamp)) {
    let Some([from, to]) = visible(segment, size_px) else { return };
    let [start, end] = segment.ends_px;
    let length_sigma = start.distance(end) / segment.sigma_px;
    let n = ((to - from) * length_sigma / LONGEST_SIGMA[SPOTS - 1]).ceil().max(1.0);
    let mut dither = dither(segment.start_s);
    let mut k = 0.0;
    while k < n {
        let part = |k: f64| from + (to - from) * k / n;
        let piece = segment.part([part(k), part(k + 1.0)]);
        if let Some(stamp) = stamp(&piece, dither, size_px) {
            each(stamp);
        }
        dither = dither.wrapping_add(DITHER[0]);
        k += 1.0;
    }
}

/// From where to where along a segment, 0 to 1, its light reaches the picture.
fn visible(segment: &Segment, size_px: [u32; 2]) -> Option<[f64; 2]> {
    let reach = DVec2::splat(REACH_SIGMA * segment.sigma_px + 1.0);
    let (low, high) = (-reach, DVec2::from(size_px.map(f64::from)) + reach);
    let [start, end] = segment.ends_px;
    let inside = |p: DVec2| p.cmpge(low).all() && p.cmple(high).all();
    if inside(start) && inside(end) {
        return Some([0.0, 1.0]);
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
    (from < to).then_some([from, to])
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

    let length_sigma = start.distance(end) / sigma;
    let enough = |longest: &f64| length_sigma <= *longest;
    let rule = RULES[LONGEST_SIGMA.iter().position(enough).unwrap_or(SPOTS - 1)];
    let (mut u, mut v, mut share) = ([0; SPOTS], [0; SPOTS], [0; SPOTS]);
    // The last spot has what the others leave, so that the shares are 1 together.
    let mut left = 1_u32 << SHARE_BITS;
    for (k, (place, weight)) in rule.iter().enumerate() {
        let spot = start.midpoint(end) + (end - start) * (0.5 * place);
        let to_first = (first + 0.5 - spot) / sigma;
        (u[k], v[k]) = (coordinate(to_first.x), coordinate(to_first.y));
        let all = k + 1 == rule.len();
        share[k] =
            if all { left } else { fixed(weight * (1.0 + segment.ramp * place), SHARE_BITS) };
        left -= share[k];
    }

    let step = coordinate(1.0 / sigma);
    // The sum of a gaussian over the lattice is its integral, 2π, over the square of the step.
    let step_sigma = f64::from(step) / f64::from(1 << SIGMA_BITS);
    let weight_per_px = step_sigma * step_sigma / std::f64::consts::TAU;
    Some(Stamp {
        record: Record {
            u,
            v,
            share,
            x: pixel(first.x),
            y: pixel(first.y),
            width: pixel(last.x - first.x) + 1,
            height: pixel(last.y - first.y) + 1,
            step,
            spots: u32::try_from(rule.len()).expect("four at most"),
            amplitude: [0; 3],
            shift: 1,
            dither,
            unused: 0,
        },
        amplitude_lx_s: segment.light.map(|e| e * weight_per_px),
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
#[expect(clippy::cast_possible_truncation, reason = "below 8 σ by the box's reach")]
fn coordinate(sigmas: f64) -> i32 {
    (sigmas * f64::from(1 << SIGMA_BITS)).round() as i32
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
