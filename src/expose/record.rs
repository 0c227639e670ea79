//! Segments become records: what both backends draw, and all that they draw.
//!
//! A segment is the integral of a gaussian spot along its way; Gauss-Legendre quadrature makes that
//! a sum of up to [`SPOTS`] spots, each the product of one curve along x and one along y, which is
//! all that the backends have to add up. A ramp of the brightness along the way is in the spots'
//! shares, so a fade costs nothing.

use std::ops::Range;

use glam::DVec2;

use super::merge::Segment;

/// Spots in a record, at most.
pub(super) const SPOTS: usize = 4;

/// Where a spot ends: 5 σ. Beyond lies 3.7e-6 of its light, which is given to the rest, and no pixel
/// gets more than 3.7e-6 of its peak.
const REACH_SIGMA: f64 = 5.0;

/// How much brighter than the gaussian's own a spot's peak may be, once its sum is put right.
const PEAK_MARGIN: f64 = 1.0 + 1.0 / 1024.0;

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

/// One segment for the splat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Record {
    /// Places of the spots from the middle of the box's first pixel; the first `spots` of them count.
    pub(super) x_px: [f32; SPOTS],
    pub(super) y_px: [f32; SPOTS],
    /// Parts of the light, 1 together.
    pub(super) share: [f32; SPOTS],
    /// Luminous exposure in the brightest channel, summed over the pixels.
    pub(super) light_lx_s: f64,
    /// Pixels in a σ, inverse.
    pub(super) per_px: f32,
    /// First pixel of the box, which may lie outside the picture.
    pub(super) x: i32,
    pub(super) y: i32,
    /// Pixels in the box.
    pub(super) width: u32,
    pub(super) height: u32,
    /// From 1 to [`SPOTS`].
    pub(super) spots: u32,
    /// Where the rounding of the counts starts: see [`DITHER`].
    pub(super) dither: u32,
}

impl Record {
    /// Luminous exposure that no pixel of it exceeds, in lx s.
    #[inline(always)]
    pub(super) fn peak_lx_s(&self) -> f64 {
        let per_px = f64::from(self.per_px);
        self.light_lx_s * per_px * per_px * (PEAK_MARGIN / std::f64::consts::TAU)
    }

    /// Columns and rows of the picture's part with these rows, where the box lies there.
    #[inline(always)]
    pub(super) fn inside(&self, width: u32, rows: &Range<u32>) -> [Range<u32>; 2] {
        let end = |first: i32, pixels: u32| (first + pixels.cast_signed()).max(0).cast_unsigned();
        let first = |first: i32| first.max(0).cast_unsigned();
        [
            first(self.x)..end(self.x, self.width).min(width),
            first(self.y).max(rows.start)..end(self.y, self.height).min(rows.end),
        ]
    }

    /// Where the rounding starts at a pixel of the picture inside the box.
    #[inline(always)]
    pub(super) fn dither_at(&self, x: u32, y: u32) -> u32 {
        let [i, j] =
            [x.wrapping_sub(self.x.cast_unsigned()), y.wrapping_sub(self.y.cast_unsigned())];
        let [along, across] = [DITHER[0].wrapping_mul(i), DITHER[1].wrapping_mul(j)];
        self.dither.wrapping_add(along).wrapping_add(across)
    }
}

/// Cuts a segment to what reaches a picture, splits it if it is long, and hands on its records.
pub(super) fn records(segment: &Segment, size_px: [u32; 2], mut each: impl FnMut(Record)) {
    let Some([from, to]) = visible(segment, size_px) else { return };
    let [start, end] = segment.ends_px;
    let length_sigma = start.distance(end) / segment.sigma_px;
    let n = ((to - from) * length_sigma / LONGEST_SIGMA[SPOTS - 1]).ceil().max(1.0);
    let mut dither = dither(segment.start_s);
    let mut k = 0.0;
    while k < n {
        let part = |k: f64| from + (to - from) * k / n;
        let piece = if n == 1.0 && to - from == 1.0 {
            *segment
        } else {
            segment.part([part(k), part(k + 1.0)])
        };
        if let Some(record) = record(&piece, dither, size_px) {
            each(record);
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

/// The record of a short segment; `None` where its box misses the picture.
fn record(segment: &Segment, dither: u32, size_px: [u32; 2]) -> Option<Record> {
    let [start, end] = segment.ends_px;
    let sigma = segment.sigma_px;
    let reach = DVec2::splat(REACH_SIGMA * sigma);
    // Pixel centres are at +0.5.
    let first = (start.min(end) - reach - 0.5).ceil();
    let last = (start.max(end) + reach - 0.5).floor();
    let size = DVec2::from(size_px.map(f64::from));
    if last.cmplt(DVec2::ZERO).any() || first.cmpge(size).any() {
        return None;
    }

    let length_sigma = start.distance(end) / sigma;
    let enough = |longest: &f64| length_sigma <= *longest;
    let rule = RULES[LONGEST_SIGMA.iter().position(enough).unwrap_or(SPOTS - 1)];
    let mut record = Record {
        x_px: [0.0; SPOTS],
        y_px: [0.0; SPOTS],
        share: [0.0; SPOTS],
        light_lx_s: segment.light_lx_s,
        per_px: narrow(1.0 / sigma),
        x: pixel(first.x),
        y: pixel(first.y),
        width: pixel(last.x - first.x).cast_unsigned() + 1,
        height: pixel(last.y - first.y).cast_unsigned() + 1,
        spots: u32::try_from(rule.len()).expect("four at most"),
        dither,
    };
    for (k, (place, weight)) in rule.iter().enumerate() {
        let spot = start.midpoint(end) + (end - start) * (0.5 * place) - first - 0.5;
        (record.x_px[k], record.y_px[k]) = (narrow(spot.x), narrow(spot.y));
        record.share[k] = narrow(weight * (1.0 + segment.ramp * place));
    }
    Some(record)
}

/// First threshold of a segment: its time, well mixed (Steele et al. 2014, splitmix64). Nothing but
/// the segment itself sets it, so that films add up whatever else is on them.
fn dither(start_s: f64) -> u32 {
    let mut z = start_s.to_bits();
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 32) as u32
}

/// A place in a box, a share, or a width.
#[expect(clippy::cast_possible_truncation, reason = "an f32 tells 4e-8 of a pixel at the spot")]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// A whole number of pixels as an integer.
#[expect(clippy::cast_possible_truncation, reason = "no farther than a box from the picture")]
fn pixel(whole: f64) -> i32 {
    whole as i32
}
