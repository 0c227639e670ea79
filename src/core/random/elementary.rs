//! Elementary functions without branches, so that the compiler can vectorize loops over them.
//!
//! The functions return the same bits as `libm`, a port of FreeBSD's msun, except for [`cos`]. No
//! product is fused with a sum, so that every machine rounds alike. Each function is valid for the
//! arguments that occur in this program. [`is_hard`] identifies arguments that need `libm` itself.

use std::f64::consts::FRAC_2_PI;

/// Returns the number whose upper 32 bits are `word` and whose lower bits are zero, as msun's
/// `SET_HIGH_WORD` does.
const fn high(word: u64) -> f64 {
    f64::from_bits(word << 32)
}

/// Returns the natural logarithm of a positive normal number (msun `e_log.c`).
#[inline(always)]
pub(super) fn ln(x: f64) -> f64 {
    const LN2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
    const G: [f64; 7] = [
        6.666_666_666_666_735e-1,
        3.999_999_999_940_942e-1,
        2.857_142_874_366_239e-1,
        2.222_219_843_214_978_4e-1,
        1.818_357_216_161_805e-1,
        1.531_383_769_920_937_3e-1,
        1.479_819_860_511_658_6e-1,
    ];
    // The argument is split as x = 2^k (1 + f), with 1 + f near 1. Adding a whole number below 2^52
    // to 2^52 places it in the last bits of the sum.
    let bits = x.to_bits();
    let word = (bits >> 32) + (0x3ff0_0000 - 0x3fe6_a09e);
    let k = f64::from_bits(0x4330_0000_0000_0000 | word >> 20) - 4_503_599_627_370_496.0 - 1023.0;
    let word = (word & 0x000f_ffff) + 0x3fe6_a09e;
    let f = f64::from_bits(word << 32 | bits & 0xffff_ffff) - 1.0;
    // ln(1 + f) = f − f²/2 + s (f²/2 + R(s²)) with s = f / (2 + f), and ln x = k ln 2 + ln(1 + f).
    let half_sq = 0.5 * f * f;
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let even = w * (G[1] + w * (G[3] + w * G[5]));
    let odd = z * (G[0] + w * (G[2] + w * (G[4] + w * G[6])));
    s * (half_sq + (odd + even)) + k * LN2[1] - half_sq + f + k * LN2[0]
}

/// True for an angle so near a multiple of a quarter turn that msun reduces it more precisely.
#[inline(always)]
pub(super) fn is_hard(x: f64) -> bool {
    let near = |word: u64| (x >= high(word)) & (x < high(word + 1));
    near(0x3ff9_21fb) | near(0x4009_21fb) | near(0x4012_d97c) | near(0x4019_21fb)
}

/// Coefficients of the polynomials in msun's `k_sin.c` and `k_cos.c`.
const S: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_007e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const C: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Returns the sine and the cosine of an angle in rad, from 0 to 2π, that is not hard
/// (`s_sincos.c`, `e_rem_pio2.c`).
#[inline(always)]
pub(super) fn sincos(x: f64) -> (f64, f64) {
    const QUARTER: [f64; 2] = [1.570_796_326_734_125_6, 6.077_100_506_506_192e-11];
    // Subtracting the nearest multiple of a quarter turn in two parts leaves a remainder a and a
    // rounding error b. The constants are the high words of π/4, 3π/4, 5π/4 and 7π/4, as msun
    // compares them.
    let from = |word: u64| if x >= high(word + 1) { 1.0 } else { 0.0 };
    let quarters = from(0x3fe9_21fb) + from(0x4002_d97c) + from(0x400f_6a7a) + from(0x4015_fdbc);
    let rest = x - quarters * QUARTER[0];
    let a = rest - quarters * QUARTER[1];
    let b = (rest - a) - quarters * QUARTER[1];

    // The polynomials give sine and cosine of a + b.
    let z = a * a;
    let w = z * z;
    let r = S[1] + z * (S[2] + z * S[3]) + z * w * (S[4] + z * S[5]);
    let v = z * a;
    let reduced = a - ((z * (0.5 * b - v * r) - b) - v * S[0]);
    let sin = if quarters == 0.0 { a + v * (S[0] + z * r) } else { reduced };

    let r_cos = z * (C[0] + z * (C[1] + z * C[2])) + w * w * (C[3] + z * (C[4] + z * C[5]));
    let half = 0.5 * z;
    let largest = 1.0 - half;
    // The second term is the rounding error of the first.
    let cos = largest + (((1.0 - largest) - half) + (z * r_cos - a * b));

    // An odd number of quarter turns swaps sine and cosine, and each half turn changes a sign.
    let odd = (quarters == 1.0) | (quarters == 3.0);
    let (sine, cosine) = if odd { (cos, sin) } else { (sin, cos) };
    let sign = |minus: bool| if minus { -1.0 } else { 1.0 };
    let sine = sign((quarters == 2.0) | (quarters == 3.0)) * sine;
    let cosine = sign((quarters == 1.0) | (quarters == 2.0)) * cosine;
    (sine, cosine)
}

/// Returns the cosine of an angle in rad within ±10⁶, which is reduced in three parts (Cody, Waite,
/// 1980). The error is at most 3·10⁻¹⁶ plus the rounding of the angle.
#[inline(always)]
pub(super) fn cos(x: f64) -> f64 {
    const QUARTER: [f64; 3] =
        [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];
    /// Constant 1.5 · 2⁵². Adding and then subtracting it rounds a number to a whole number.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    let quarters = (x * FRAC_2_PI + WHOLE) - WHOLE;
    let a = ((x - quarters * QUARTER[0]) - quarters * QUARTER[1]) - quarters * QUARTER[2];
    // The quadrant, from −2 to 2, is the number of quarter turns modulo 4.
    let fours = (quarters * 0.25 + WHOLE) - WHOLE;
    let quadrant = quarters - 4.0 * fours;
    let z = a * a;
    let w = z * z;
    let r = S[1] + z * (S[2] + z * S[3]) + z * w * (S[4] + z * S[5]);
    let sin = a + z * a * (S[0] + z * r);
    let r_cos = z * (C[0] + z * (C[1] + z * C[2])) + w * w * (C[3] + z * (C[4] + z * C[5]));
    let cos = 1.0 - (0.5 * z - z * r_cos);
    let unsigned = if quadrant.abs() == 1.0 { sin } else { cos };
    if (quadrant == 1.0) | (quadrant.abs() == 2.0) { -unsigned } else { unsigned }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_4, TAU};

    use super::*;
    use crate::random::Noise;

    #[test]
    fn logarithm_sine_and_cosine_are_libms_bit_for_bit() {
        let mut noise = Noise::new(5, 0, "arguments");
        let ends = [0.0, f64::EPSILON / 2.0, 1e-300, 1.0 - f64::EPSILON / 2.0];
        let eighths = (0..=8).flat_map(|k| {
            let near = f64::from(k) / 8.0;
            [near.next_down(), near, near.next_up(), near - 1e-7, near + 1e-7]
        });
        let drawn = (0..1_000_000).map(|_| noise.uniform());
        let mut n_hard = 0;
        for u in ends.into_iter().chain(eighths).chain(drawn).filter(|u| (0.0..1.0).contains(u)) {
            assert_eq!(ln(1.0 - u).to_bits(), libm::log(1.0 - u).to_bits(), "ln(1 − {u})");
            if is_hard(TAU * u) {
                n_hard += 1;
                continue;
            }
            let ((sin, cos), (sin_libm, cos_libm)) = (sincos(TAU * u), libm::sincos(TAU * u));
            assert_eq!(sin.to_bits(), sin_libm.to_bits(), "sin {u}");
            assert_eq!(cos.to_bits(), cos_libm.to_bits(), "cos {u}");
        }
        assert!((8..40).contains(&n_hard), "few are left to libm: {n_hard}");
    }

    #[test]
    fn cosines_of_many_turns_are_as_near_as_numbers_allow() {
        let mut noise = Noise::new(7, 0, "arguments");
        let drawn = (0..300_000).map(|_| noise.normal());
        let edges = (-40..=40).map(|k| f64::from(k) * FRAC_PI_4);
        for x in drawn.flat_map(|x| [x, 10.0 * x, 1000.0 * x]).chain(edges) {
            let (actual, want) = (cos(x), libm::cos(x));
            assert!((actual - want).abs() < 3e-16, "cos {x}: {actual} of {want}");
        }
    }
}
