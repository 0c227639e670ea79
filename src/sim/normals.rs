//! Normals of a stream that draws nothing else, made in blocks: several at once in the processor's
//! wide registers, bit for bit those that [`Noise::normal`] draws one by one.
//!
//! Box and Muller's formula with the logarithm, sine and cosine of `libm` (after FreeBSD's msun),
//! written out without branches for the arguments that occur here: `1 − u` and `2πu` with `u` in
//! `[0, 1)`. No product is fused with a sum, so that every machine rounds alike.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use rand::RngExt;
use rand::rngs::ChaCha8Rng;

use super::noise::Noise;

/// Pairs that are made together. More fill wider registers; fewer waste less of a short flight.
const PAIRS: usize = 32;

/// A stream of normals with mean 0 and variance 1.
#[derive(Debug)]
pub(super) struct Normals {
    rng: ChaCha8Rng,
    block: Block,
    drawn: usize,
}

impl Normals {
    /// The normals of a stream from which nothing was drawn yet.
    pub(super) fn of(noise: Noise) -> Self {
        let block = Block { cosines: [0.0; PAIRS], sines: [0.0; PAIRS] };
        Self { rng: noise.into_rng(), block, drawn: 2 * PAIRS }
    }

    #[inline]
    pub(super) fn next(&mut self) -> f64 {
        if self.drawn == 2 * PAIRS {
            self.fill();
        }
        let (pair, second) = (self.drawn / 2, self.drawn % 2 == 1);
        self.drawn += 1;
        if second { self.block.sines[pair] } else { self.block.cosines[pair] }
    }

    /// Three independent normals.
    #[inline]
    pub(super) fn next_three(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.next())
    }

    fn fill(&mut self) {
        let mut uniform = [[0.0; 2]; PAIRS];
        for pair in &mut uniform {
            *pair = [self.rng.random(), self.rng.random()];
        }
        pulp::Arch::new().dispatch(Fill { uniform: &uniform, block: &mut self.block });
        self.drawn = 0;
    }
}

/// Both normals of each pair.
#[derive(Debug)]
struct Block {
    cosines: [f64; PAIRS],
    sines: [f64; PAIRS],
}

/// Uniform numbers, and the normals to be made of them.
struct Fill<'a> {
    uniform: &'a [[f64; 2]; PAIRS],
    block: &'a mut Block,
}

impl pulp::NullaryFnOnce for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let mut radii = [0.0; PAIRS];
        let mut hard = [false; PAIRS];
        for i in 0..PAIRS {
            let [first, second] = self.uniform[i];
            radii[i] = (-2.0 * ln(1.0 - first)).sqrt();
            let angle = TAU * second;
            let (sin, cos) = sincos(angle);
            (self.block.cosines[i], self.block.sines[i]) = (radii[i] * cos, radii[i] * sin);
            hard[i] = is_hard(angle);
        }
        for i in (0..PAIRS).filter(|i| hard[*i]) {
            let (sin, cos) = libm::sincos(TAU * self.uniform[i][1]);
            (self.block.cosines[i], self.block.sines[i]) = (radii[i] * cos, radii[i] * sin);
        }
    }
}

/// High words at which msun changes its way, as numbers.
const fn high(word: u64) -> f64 {
    f64::from_bits(word << 32)
}

/// The natural logarithm of a normal number (msun `e_log.c`).
#[inline(always)]
fn ln(x: f64) -> f64 {
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
    // x = 2^k (1 + f) with 1 + f about 1; a whole number below 2^52 added to 2^52 is its last bits.
    let bits = x.to_bits();
    let word = (bits >> 32) + (0x3ff0_0000 - 0x3fe6_a09e);
    let k = f64::from_bits(0x4330_0000_0000_0000 | word >> 20) - 4_503_599_627_370_496.0 - 1023.0;
    let word = (word & 0x000f_ffff) + 0x3fe6_a09e;
    let f = f64::from_bits(word << 32 | bits & 0xffff_ffff) - 1.0;
    let half_sq = 0.5 * f * f;
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let even = w * (G[1] + w * (G[3] + w * G[5]));
    let odd = z * (G[0] + w * (G[2] + w * (G[4] + w * G[6])));
    s * (half_sq + (odd + even)) + k * LN2[1] - half_sq + f + k * LN2[0]
}

/// Angles so near to a multiple of a quarter turn that msun reduces them with more digits.
#[inline(always)]
fn is_hard(x: f64) -> bool {
    let near = |word: u64| (x >= high(word)) & (x < high(word + 1));
    near(0x3ff9_21fb) | near(0x4009_21fb) | near(0x4012_d97c) | near(0x4019_21fb)
}

/// Sine and cosine of an angle from 0 to 2π that is not hard (msun `s_sincos.c`, `e_rem_pio2.c`,
/// `k_sin.c`, `k_cos.c`).
#[inline(always)]
fn sincos(x: f64) -> (f64, f64) {
    const QUARTER: [f64; 2] = [1.570_796_326_734_125_6, 6.077_100_506_506_192e-11];
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
    let from = |word: u64| if x >= high(word + 1) { 1.0 } else { 0.0 };
    let quarters = from(0x3fe9_21fb) + from(0x4002_d97c) + from(0x400f_6a7a) + from(0x4015_fdbc);
    let z = x - quarters * QUARTER[0];
    let a = z - quarters * QUARTER[1];
    let b = (z - a) - quarters * QUARTER[1];

    let z = a * a;
    let w = z * z;
    let r = S[1] + z * (S[2] + z * S[3]) + z * w * (S[4] + z * S[5]);
    let v = z * a;
    let reduced = a - ((z * (0.5 * b - v * r) - b) - v * S[0]);
    let sin = if quarters == 0.0 { a + v * (S[0] + z * r) } else { reduced };

    let r = z * (C[0] + z * (C[1] + z * C[2])) + w * w * (C[3] + z * (C[4] + z * C[5]));
    let half = 0.5 * z;
    let w = 1.0 - half;
    let cos = w + (((1.0 - w) - half) + (z * r - a * b));

    let odd = (quarters == 1.0) | (quarters == 3.0);
    let (sine, cosine) = if odd { (cos, sin) } else { (sin, cos) };
    let sign = |minus: bool| if minus { -1.0 } else { 1.0 };
    let sine = sign((quarters == 2.0) | (quarters == 3.0)) * sine;
    let cosine = sign((quarters == 1.0) | (quarters == 2.0)) * cosine;
    (sine, cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_what_is_drawn_one_by_one_bit_for_bit() {
        for seed in 0..200 {
            let mut one_by_one = Noise::new(seed, 0, "gyro");
            let mut block = Normals::of(Noise::new(seed, 0, "gyro"));
            for i in 0..1000 {
                assert_eq!(block.next().to_bits(), one_by_one.normal().to_bits(), "{seed}, {i}");
            }
        }
    }

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
}
