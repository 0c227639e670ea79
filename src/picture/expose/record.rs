//! Records: parts of segments in the form that both backends draw.
//!
//! A segment is the integral of a Gaussian spot along a line. Gauss-Legendre quadrature turns it
//! into a sum of up to [`SPOTS`] spots, each the product of a curve along x and a curve along y.
//! The backends add up these products. A blurred rectangle is handled in the same way. A brightness
//! ramp changes only the weights of the spots, so a fade takes no extra time. Values are converted
//! from f64 to f32 here.

use std::ops::Range;

use super::Detail;
use super::merge::Segment;
use super::project::Px;
use crate::narrow;
use noctograph_core::random::{GOLDEN, split_mix};

pub(super) const SPOTS: usize = 4;

/// Radius at which a spot is cut off. Its brightness there is 3.7e-6 of its peak. The light beyond,
/// also 3.7e-6, is added to the rest.
const REACH_SIGMA: f64 = 5.0;

/// Upper bound on the peak of a spot relative to its Gaussian, after its sum was corrected: for
/// spots narrower than 0.85 px, and for wider spots.
const PEAK_MARGINS: [f64; 2] = [1.0 + 1.0 / 32.0, 1.0 + 1.0 / 1024.0];
const NARROW_SIGMA_PX: f64 = 0.85;

/// Multiple of [`Detail::longest_sigma`] for a rectangle wider and higher than 2 σ. In a picture,
/// it is drawn to within 4e-5 of its peak, by the error term with the derivative of order 2n - 1 at
/// its edge.
const LONGER_FLAT: f64 = 1.6;

/// Nodes from -1 to 1 and weights for 1, 2, 3 and 4 spots (Gauss and Legendre: Abramowitz and
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

/// Steps along x and y of the dither. The dither is the threshold above which counts are rounded
/// up. With thousands of overlapping segments, rounding to nearest would lose the faint edge of
/// every spot (2e-6 of the light of a hover at 250 Hz).
///
/// The steps are 2^32 divided by the plastic number and by its square, which distributes thresholds
/// evenly over the plane (Roberts 2018, the R2 sequence).
pub(super) const DITHER: [u32; 2] = [0xC13F_A9A9, 0x91E1_0DA5];

/// √(π/2). A Gaussian has the same peak as a rectangle that extends this many σ to either side.
const ROOT_HALF_PI: f64 = 1.253_314_137_315_500_3;

/// Minimum half width, in σ, of a rectangle that is not drawn as a Gaussian.
const LEAST_HALF_SIGMA: f64 = 0.1;

/// A short segment as the sum of its spots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Record {
    /// Centers of the first `spots` spots, relative to the center of the first pixel of the box.
    pub(super) x_px: [f32; SPOTS],
    pub(super) y_px: [f32; SPOTS],
    /// Fractions of the light in the spots, which add up to 1.
    pub(super) fraction: [f32; SPOTS],
    /// Luminous exposure of the brightest channel, summed over the pixels.
    pub(super) light_lx_s: f64,
    /// 1 / σ.
    pub(super) per_px: f32,
    /// Half the width and half the height of the blurred rectangle, or 0 for a Gaussian.
    pub(super) half_px: [f32; 2],
    /// First pixel of the box, which may be outside the picture.
    pub(super) x: i32,
    pub(super) y: i32,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) spots: u32,
    /// Dither threshold at the first pixel (see [`DITHER`]).
    pub(super) dither: u32,
}

impl Record {
    /// Returns an upper bound on the exposure that the record adds to any pixel.
    #[inline(always)]
    pub(super) fn peak_lx_s(&self) -> f64 {
        let per_px = f64::from(self.per_px);
        let margin = PEAK_MARGINS[usize::from(per_px < 1.0 / NARROW_SIGMA_PX)];
        // Computes the peak of a two-dimensional Gaussian, reduced by the rectangle on each axis.
        let gaussian = per_px * per_px * (margin / std::f64::consts::TAU);
        let flat = self.half_px.map(|half| {
            let half_sigma = f64::from(half) * per_px;
            (ROOT_HALF_PI / half_sigma.max(f64::MIN_POSITIVE)).min(1.0)
        });
        self.light_lx_s * gaussian * flat[0] * flat[1]
    }

    /// Returns the columns and rows of the box that are inside the picture and among `rows`.
    #[inline(always)]
    pub(super) fn inside(&self, width: u32, rows: &Range<u32>) -> [Range<u32>; 2] {
        let end = |first: i32, pixels: u32| (first + pixels.cast_signed()).max(0).cast_unsigned();
        let first = |first: i32| first.max(0).cast_unsigned();
        [
            first(self.x)..end(self.x, self.width).min(width),
            first(self.y).max(rows.start)..end(self.y, self.height).min(rows.end),
        ]
    }

    /// Returns the threshold for rounding at a pixel of the picture inside the box, in units of
    /// 2⁻³².
    #[inline(always)]
    pub(super) fn dither_at(&self, x: u32, y: u32) -> u32 {
        let [i, j] =
            [x.wrapping_sub(self.x.cast_unsigned()), y.wrapping_sub(self.y.cast_unsigned())];
        let [along, across] = [DITHER[0].wrapping_mul(i), DITHER[1].wrapping_mul(j)];
        self.dither.wrapping_add(along).wrapping_add(across)
    }
}

/// Calls `each` with the records of the part of a segment that reaches the picture. A long part is
/// split into several records.
pub(super) fn records(
    segment: &Segment,
    size_px: [u32; 2],
    detail: &Detail,
    mut each: impl FnMut(Record),
) {
    let Some([from, to]) = visible(segment, size_px) else { return };
    // The pieces have equal lengths, each short enough for the quadrature with the most nodes.
    let length_sigma = length_sigma(segment);
    let n = ((to - from) * length_sigma / detail.longest_sigma[SPOTS - 1]).ceil().max(1.0);
    let mut dither = dither(segment.start_s);
    let mut k = 0.0;
    while k < n {
        let piece = if n == 1.0 && to - from == 1.0 {
            *segment
        } else {
            segment.part([k, k + 1.0].map(|k| from + (to - from) * k / n))
        };
        if let Some(record) = record(&piece, dither, size_px, detail) {
            each(record);
        }
        dither = dither.wrapping_add(DITHER[0]);
        k += 1.0;
    }
}

/// Returns the length of a segment in σ, for comparison with [`Detail::longest_sigma`].
fn length_sigma(segment: &Segment) -> f64 {
    let is_flat = segment.half_px.min_element() > segment.sigma_px;
    segment.length_px() / segment.sigma_px / if is_flat { LONGER_FLAT } else { 1.0 }
}

/// Returns the two fractions of the length, 0 to 1, between which a segment's light reaches the
/// picture (line clipping by Liang and Barsky 1984), or `None` if it does not.
fn visible(segment: &Segment, size_px: [u32; 2]) -> Option<[f64; 2]> {
    let reach = reach_px(segment) + Px::ONE;
    let [start, end] = segment.ends_px;
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        // The borders of the picture are extended by the reach of a spot.
        let borders = [-reach[axis], f64::from(size_px[axis]) + reach[axis]];
        if [start, end].iter().all(|px| (borders[0]..=borders[1]).contains(&px[axis])) {
            continue;
        }
        let length = end[axis] - start[axis];
        if length == 0.0 {
            return None;
        }
        let [a, b] = borders.map(|border| (border - start[axis]) / length);
        from = from.max(a.min(b));
        to = to.min(a.max(b));
    }
    (from < to).then_some([from, to])
}

/// Returns the distance from a spot's center along each axis beyond which it leaves no light.
fn reach_px(segment: &Segment) -> Px {
    segment.half_px + REACH_SIGMA * segment.sigma_px
}

/// Returns the record of a short segment, or `None` if its box is outside the picture.
fn record(segment: &Segment, dither: u32, size_px: [u32; 2], detail: &Detail) -> Option<Record> {
    // The box contains the pixels whose centers (at +0.5) are reached by light.
    let [start, end] = segment.ends_px;
    let sigma = segment.sigma_px;
    let reach = reach_px(segment);
    let half = Px::splat(0.5);
    let first = (start.min(end) - reach - half).ceil();
    let last = (start.max(end) + reach - half).floor();
    if (0..2).any(|axis| last[axis] < 0.0 || first[axis] >= f64::from(size_px[axis])) {
        return None;
    }
    // Selects the quadrature with the fewest nodes that is accurate for this length.
    let length_sigma = length_sigma(segment);
    let enough = detail.longest_sigma.iter().position(|longest| length_sigma <= *longest);
    let rule = RULES[enough.unwrap_or(SPOTS - 1)];
    let mut record = Record {
        x_px: [0.0; SPOTS],
        y_px: [0.0; SPOTS],
        fraction: [0.0; SPOTS],
        light_lx_s: segment.light_lx_s,
        per_px: narrow(1.0 / sigma),
        half_px: segment
            .half_px
            .to_array()
            .map(|half| if half < LEAST_HALF_SIGMA * sigma { 0.0 } else { narrow(half) }),
        x: pixel(first.x),
        y: pixel(first.y),
        width: pixel(last.x - first.x).cast_unsigned() + 1,
        height: pixel(last.y - first.y).cast_unsigned() + 1,
        spots: u32::try_from(rule.len()).expect("four at most"),
        dither,
    };
    for (k, (node, weight)) in rule.iter().enumerate() {
        let spot = segment.middle_px() + (end - start) * (0.5 * node) - first - half;
        (record.x_px[k], record.y_px[k]) = (narrow(spot.x), narrow(spot.y));
        record.fraction[k] = narrow(weight * (1.0 + segment.ramp * node));
    }
    Some(record)
}

/// Returns the first dither of a segment, which is a hash of its start time. It depends on nothing
/// else, so that films can be added.
fn dither(start_s: f64) -> u32 {
    (split_mix(start_s.to_bits().wrapping_sub(GOLDEN)) >> 32) as u32
}

/// Converts a whole number of pixels to an integer.
#[expect(clippy::cast_possible_truncation, reason = "a box reaches the picture")]
fn pixel(whole: f64) -> i32 {
    whole as i32
}
