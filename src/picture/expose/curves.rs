//! Fixed-point profiles (curves) of a record's spots. CPU and GPU multiply the same integers.
//!
//! A spot is a Gaussian, `exp(-(u² + v²) / 2)` with u and v in σ, or a rectangle blurred by one.
//! Both kinds of spots are the product of one curve along each axis of the picture. A pixel's light
//! is `Σ along[i] × across[j]` over the spots of the record. The curve across includes the light
//! and the scale. Curves are divided by their sums, so that a spot keeps its light at any position
//! between pixels and after rounding.
//!
//! The curves are computed in f32 with `+ - ×` (for rectangles also in f64 with `÷`), then in
//! integers. Eight lanes are added in a fixed order, so the bits are the same on every machine.

use std::ops::Range;

use super::record::Record;
use crate::narrow;

/// Number of pixels that are computed at once: those of a 256-bit register.
pub(super) const LANES: usize = 8;

/// Peak of the curve along a row. Its steps, 1.5e-5 of the peak, cause an error of 7.6e-6.
const ALONG: f32 = 65_535.0;

/// Number of bits in the lower part of a curve across. The sum of four products of either part with
/// a curve along a row stays below 2^32.
pub(super) const LOW_BITS: u32 = 14;

/// Number of bits in the sum of a pixel, in counts times `2^shift`. The upper parts stay below
/// 2^31.
const SUM_BITS: i32 = 30;

/// Number of values in one step of the long loops: enough to fill the registers of any processor,
/// and too many to unroll.
const STEP: usize = 32;

/// Exponent of 2 for values that are zero in a curve. The power, 2e-38, vanishes in rounding.
const ZERO_EXPONENT: f32 = -125.0;

/// The curves of the spots of one record.
#[derive(Debug, Default)]
pub(super) struct Curves {
    /// Curves along a row of the box, spot after spot, with zeros up to whole lanes and one more.
    along: Vec<u32>,
    /// Curves down a column, spot after spot, padded with zeros to whole lanes: the bits above
    /// [`LOW_BITS`] and those below.
    high: Vec<u32>,
    low: Vec<u32>,
    /// Number of values per spot in `along`, and in `high` and `low`.
    strides: [usize; 2],
    /// Power of two by which the counts in sums are multiplied, from 1 to 30.
    pub(super) shift: u32,
    /// Gaussians of all spots: first along rows, and then down columns.
    bells: Vec<f32>,
}

impl Curves {
    /// Computes the curves of a record for a film with `counts_per_lx_s`: one along the rows and
    /// one across them for each spot.
    #[inline(always)]
    pub(super) fn draw(&mut self, record: &Record, counts_per_lx_s: f64) {
        let (width, height) = (record.width as usize, record.height as usize);
        let strides = [width.next_multiple_of(LANES) + LANES, height.next_multiple_of(LANES)];
        let spots = record.spots as usize;
        let [n_along, n_across] = strides.map(|stride| spots * stride);
        self.strides = strides;
        let n_steps = n_across.next_multiple_of(STEP);
        self.bells.resize((n_along + n_steps).next_multiple_of(STEP), ZERO_EXPONENT);
        self.along.resize(n_along.next_multiple_of(STEP), 0);
        self.high.resize(n_steps, 0);
        self.low.resize(n_steps, 0);
        // Computes the exponents of 2 of all Gaussians, and then their powers in one long loop.
        let (along, across) = self.bells.split_at_mut(n_along);
        for k in 0..spots {
            let along = &mut along[k * strides[0]..][..strides[0]];
            exponents(along, record.x_px[k], record.per_px, width);
            let across = &mut across[k * strides[1]..][..strides[1]];
            exponents(across, record.y_px[k], record.per_px, height);
        }
        self.bells[n_along + n_across..].fill(ZERO_EXPONENT);
        for bells in self.bells.as_chunks_mut::<STEP>().0 {
            bells.iter_mut().for_each(|bell| *bell = exp2(*bell));
        }
        if record.half_px != [0.0; 2] {
            self.draw_rectangles(record, n_along);
        }
        // Converts the curves along rows to integers, and then those across with the light.
        let bells = self.bells.as_chunks::<STEP>().0;
        for (along, bells) in self.along.as_chunks_mut::<STEP>().0.iter_mut().zip(bells) {
            for (along, bell) in along.iter_mut().zip(bells) {
                *along = rounded(bell * ALONG);
            }
        }
        self.draw_across(record, counts_per_lx_s, n_along);
    }

    /// Scales the curves across, which start at `n_along` in `bells`, to the light of the record,
    /// and converts them to integers.
    #[inline(always)]
    fn draw_across(&mut self, record: &Record, counts_per_lx_s: f64, n_along: usize) {
        let strides = self.strides;
        // Selects the finest scale at which the sum of a pixel fits into its bits.
        let exponent = exponent(record.peak_lx_s() * counts_per_lx_s);
        self.shift = (SUM_BITS - exponent).clamp(1, SUM_BITS).cast_unsigned();
        let in_sums = f64::from(1_u32 << self.shift) * f64::from(1_u32 << LOW_BITS);
        let light = record.light_lx_s * counts_per_lx_s * in_sums;
        // Divides the light of each spot by the sums of its two rounded curves.
        for k in 0..record.spots as usize {
            let across = k * strides[1]..(k + 1) * strides[1];
            let bells = self.bells[n_along..][across].as_chunks_mut::<LANES>().0;
            let along = sum(self.along[k * strides[0]..][..strides[0]].as_chunks().0, |&x| x);
            let across = sum(bells, |bell| rounded(bell * SUMMED));
            let fraction = f64::from(record.fraction[k]) * f64::from(SUMMED);
            let factor = narrow(light * fraction / (f64::from(along) * f64::from(across)));
            bells.as_flattened_mut().iter_mut().for_each(|bell| *bell *= factor);
        }
        // Splits each value into upper and lower bits, rounded by the addition of MAGIC.
        let values = self.bells[n_along..].as_chunks::<STEP>().0;
        let high = self.high.as_chunks_mut::<STEP>().0.iter_mut();
        let low = self.low.as_chunks_mut::<STEP>().0;
        for (values, (high, low)) in values.iter().zip(high.zip(low)) {
            for (value, (high, low)) in values.iter().zip(high.iter_mut().zip(low)) {
                let above = (value * PER_HIGH - 0.5) + MAGIC;
                *high = above.to_bits().wrapping_sub(MAGIC.to_bits());
                *low = rounded(value - (above - MAGIC) * HIGH);
            }
        }
    }

    /// Replaces a blurred rectangle's Gaussians with the rectangle's curves. The curves across
    /// start at `n_along`.
    #[inline(always)]
    fn draw_rectangles(&mut self, record: &Record, n_along: usize) {
        let axes = [(0, record.x_px, record.width), (n_along, record.y_px, record.height)];
        for (axis, (start, middles_px, pixels)) in axes.into_iter().enumerate() {
            for k in (0..record.spots as usize).filter(|_| record.half_px[axis] != 0.0) {
                let first = start + k * self.strides[axis];
                let curve = &mut self.bells[first..first + pixels as usize];
                blurred(curve, middles_px[k], record.per_px, record.half_px[axis]);
            }
        }
    }

    /// Returns the curve of a spot along the row in whole lanes, starting from a pixel of the box.
    #[inline(always)]
    pub(super) fn along(&self, spot: usize, from: usize) -> &[u32] {
        &self.along[spot * self.strides[0]..][from..self.strides[0]]
    }

    /// Returns the upper and the lower bits of a spot's curve across, for some rows of the box.
    #[inline(always)]
    pub(super) fn across(&self, spot: usize, rows: Range<usize>) -> [&[u32]; 2] {
        [&self.high, &self.low].map(|part| &part[spot * self.strides[1]..][rows.clone()])
    }
}

/// Writes the exponents of 2 of a Gaussian of σ = 1 / `per_px` to the first `pixels` values. The
/// middle is in pixels from the first value.
#[inline(always)]
fn exponents(out: &mut [f32], middle_px: f32, per_px: f32, pixels: usize) {
    // exp(-x² / 2) is 2 to the power of -x² / 2 · log2(e).
    for (c, exponents) in out.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        let first_px = (c * LANES) as f32 - middle_px;
        for lane in 0..LANES {
            let x = (LANE[lane] + first_px) * per_px;
            exponents[lane] = x * x * (-0.5 * std::f32::consts::LOG2_E);
        }
    }
    out[pixels..].fill(ZERO_EXPONENT);
}

/// Writes the curve of a line that extends `half_px` to either side and is blurred by a Gaussian of
/// σ = 1 / `per_px`. The curve is 1 in the middle, which is in pixels from the first value.
#[inline(always)]
fn blurred(out: &mut [f32], middle_px: f32, per_px: f32, half_px: f32) {
    let [middle_px, half_px] = [middle_px, half_px].map(f64::from);
    let per_px = f64::from(per_px) * std::f64::consts::FRAC_1_SQRT_2;
    let per_peak = 1.0 / between(0.0, per_px, half_px);
    for (c, values) in out.chunks_mut(LANES).enumerate() {
        let first_px = (c * LANES) as f64 - middle_px;
        let curve: [f32; LANES] = std::array::from_fn(|lane| {
            let value = between(f64::from(LANE[lane]) + first_px, per_px, half_px);
            narrow((value * per_peak).max(0.0))
        });
        values.copy_from_slice(&curve[..values.len()]);
    }
}

/// Returns twice the integral, within `half_px` of x, of a Gaussian with σ = 1 / (√2 `per_px`).
#[inline(always)]
fn between(x: f64, per_px: f64, half_px: f64) -> f64 {
    error_function((x + half_px) * per_px) - error_function((x - half_px) * per_px)
}

/// Numerator and denominator of the ratio of the error function to x: coefficients of powers of x²,
/// with the highest power first.
const ERROR_FUNCTION: [&[f64]; 2] = [
    &[
        -2.726_142_258_013_06e-10,
        2.770_681_424_959_02e-8,
        -2.101_024_020_825_08e-6,
        -5.692_506_394_623_46e-5,
        -7.349_906_303_268_55e-4,
        -2.954_599_808_540_25e-3,
        -1.609_603_332_624_15e-2,
    ],
    &[
        -1.456_607_184_649_96e-5,
        -2.133_740_552_789_05e-4,
        -1.682_826_974_382_03e-3,
        -7.373_329_167_204_68e-3,
        -1.426_473_905_141_89e-2,
    ],
];

/// Returns the error function with an error of at most 7e-8, by the rational function that Eigen
/// uses for f32 (`generic_fast_erf_float`). From 4 on, the error function is 1 in f32.
#[inline(always)]
pub(super) fn error_function(x: f64) -> f64 {
    let x = x.clamp(-4.0, 4.0);
    let square = x * x;
    let [above, below] =
        ERROR_FUNCTION.map(|terms| terms.iter().fold(0.0, |sum, term| sum * square + term));
    x * above / below
}

const LANE: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// Returns 2 to the power of a number from -125 to 0, with a relative error of 1e-7. The integer
/// part becomes the exponent of the float, and the rest is computed by a Taylor series.
#[inline(always)]
fn exp2(power: f32) -> f32 {
    let whole = power + MAGIC;
    let x = (power - (whole - MAGIC)) * std::f32::consts::LN_2;
    // The terms up to x⁷ / 7! form two independent chains, which run in parallel.
    let x2 = x * x;
    let low = (1.0 + x) + x2 * (1.0 / 2.0 + x * (1.0 / 6.0));
    let high = (1.0 / 24.0 + x * (1.0 / 120.0)) + x2 * (1.0 / 720.0 + x * (1.0 / 5040.0));
    // The exponent of a float starts at bit 23.
    let series = low + x2 * x2 * high;
    f32::from_bits(series.to_bits().wrapping_add(whole.to_bits() << 23))
}

/// Returns the sum of values after `to_integer` has converted each to an integer.
#[inline(always)]
fn sum<T>(rows: &[[T; LANES]], to_integer: impl Fn(&T) -> u32) -> u32 {
    let mut sums = [0; LANES];
    for values in rows {
        for lane in 0..LANES {
            sums[lane] += to_integer(&values[lane]);
        }
    }
    sums.iter().sum()
}

/// Unit of the sum of a curve across. It resolves 1e-7 of the sum, and keeps the sum of the widest
/// spot below 2^32.
const SUMMED: f32 = (1_u32 << 22) as f32;

/// Unit of the upper part, and its reciprocal.
const HIGH: f32 = (1_u32 << LOW_BITS) as f32;
const PER_HIGH: f32 = 1.0 / HIGH;

/// Number 1.5 · 2^23. Floats of this size have a step of 1, so adding MAGIC to a number below 2^22
/// rounds the number into the last bits of the sum.
const MAGIC: f32 = 12_582_912.0;

/// Rounds a number from -1/2 to 2^22 to an integer.
#[inline(always)]
fn rounded(x: f32) -> u32 {
    (x + MAGIC).to_bits().wrapping_sub(MAGIC.to_bits())
}

/// Returns the smallest exponent e for which 2^e is greater than a positive number, or -1022 for 0.
#[inline(always)]
fn exponent(x: f64) -> i32 {
    // A double stores its exponent above 52 bits, with a bias of 1023 for the power of 2 below it.
    (x.to_bits() >> 52) as i32 - 1022
}

#[cfg(test)]
mod tests {
    use super::super::record::SPOTS;
    use super::*;

    #[test]
    fn the_curve_is_within_3e_7_of_the_gaussian() {
        let mut worst = 0.0_f64;
        for i in 0..1000_u16 {
            let (middle, per_px) = (9.0 + f32::from(i) * 1e-3, 0.1 + f32::from(i) * 1e-3);
            let mut bells = [0.0; 24];
            exponents(&mut bells, middle, per_px, 19);
            let bells = bells.map(exp2);
            for (x, &bells) in (0..19_u16).zip(&bells) {
                let u = f64::from(f32::from(x) - middle) * f64::from(per_px);
                worst = worst.max((f64::from(bells) - libm::exp(-0.5 * u * u)).abs());
            }
            assert!(bells[19..].iter().all(|bell| rounded(bell * SUMMED) == 0), "nothing beyond");
        }
        assert!(worst < 3e-7, "it errs by {worst}");
    }

    /// Returns the curves of a spot at 100 counts per lx s.
    fn drawn(
        light_lx_s: f64,
        sigma_px: f64,
        half_px: [f64; 2],
        at_px: [f64; 2],
    ) -> (Curves, Record) {
        let ends_px = [at_px.into(); 2];
        let segment = super::super::merge::Segment {
            ends_px,
            sigma_px,
            half_px: half_px.into(),
            light_lx_s,
            ramp: 0.0,
            start_s: 0.0,
            duration_s: 1.0,
        };
        let mut records = Vec::new();
        super::super::record::records(
            &segment,
            [4000, 4000],
            &super::super::Detail::PICTURE,
            |record| records.push(record),
        );
        let mut curves = Curves::default();
        curves.draw(&records[0], 100.0);
        (curves, records[0])
    }

    #[test]
    fn a_spot_keeps_its_light_to_3e_7_at_any_position_and_width() {
        for (sigma_px, half_px, at_px) in [
            (0.9, [0.0; 2], [30.0, 30.5]),
            (0.9, [0.0; 2], [30.21, 31.83]),
            (1.7, [0.0; 2], [60.4, 50.1]),
            (250.0, [0.0; 2], [2e3, 2e3]),
            (0.5, [6.0, 0.5], [30.21, 31.83]),
            (0.9, [0.1, 20.0], [60.4, 50.1]),
            (256.0, [256.0; 2], [2e3, 2e3]),
        ] {
            for light_lx_s in [0.1, 10.0, 1e4].map(|peak| peak * sigma_px * sigma_px) {
                let (curves, record) = drawn(light_lx_s, sigma_px, half_px, at_px);
                let along: u64 = curves.along(0, 0).iter().map(|&a| u64::from(a)).sum();
                let [high, low] = curves.across(0, 0..record.height as usize);
                let part = |part: &[u32]| part.iter().map(|&a| u64::from(a)).sum::<u64>();
                let across = (part(high) << LOW_BITS) + part(low);
                let light = (along * across) as f64 / f64::from(1 << LOW_BITS);
                let light = light / f64::from(1 << curves.shift);
                let error = light / (100.0 * light_lx_s) - 1.0;
                assert!(error.abs() < 3e-7, "{light_lx_s} at {at_px:?}: off by {error:e}");
            }
        }
    }

    #[test]
    fn no_sum_overflows_at_the_brightest() {
        // The peak is just below 2^30 counts, the most that `scale` allows for a record.
        for half_px in [[0.0; 2], [0.1, 3.0], [6.0, 1.5]] {
            let (mut curves, record) = drawn(1.0, 0.9, half_px, [30.5, 30.5]);
            curves.draw(&record, 0.999 * f64::from(1 << 30) / record.peak_lx_s());
            assert_eq!(curves.shift, 1, "the coarsest");
            let most = |part: &[u32]| part.iter().copied().max().expect("pixels");
            let [high, low] = curves.across(0, 0..record.height as usize);
            let [along, high] = [most(curves.along(0, 0)), most(high)];
            assert!(u64::from(along) * u64::from(high) < 1 << 31, "{along} times {high}");
            assert!(SPOTS as u64 * u64::from(along) * (1 << LOW_BITS) < 1 << 32, "lower parts");
            assert!(most(low) <= 1 << LOW_BITS, "{low:?}");
        }
    }

    #[test]
    fn a_blurred_line_is_within_5e_7_of_the_error_function() {
        for (per_px, half_px) in [(2.0_f32, 6.0_f32), (1.0, 0.1), (0.1, 9.3)] {
            let mut curve = [0.0; 40];
            blurred(&mut curve, 17.3, per_px, half_px);
            for (x, &value) in (0_u16..).zip(&curve) {
                let [wanted, most] = [f32::from(x) - 17.3, 0.0].map(|x| {
                    let [from, to] = [x - half_px, x + half_px].map(|x| f64::from(x * per_px));
                    let root_half = std::f64::consts::FRAC_1_SQRT_2;
                    libm::erf(to * root_half) - libm::erf(from * root_half)
                });
                assert!((f64::from(value) * most - wanted).abs() < 5e-7, "{x}: {value}");
            }
        }
    }
}
