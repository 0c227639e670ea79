//! The two curves of the splat as integers, shared by both backends.
//!
//! A spot is a gaussian; a lamp that moves evenly along a straight line smears it to
//! `g(v) [Φ(u) - Φ(u - L)]` (u along the line, v across, all in σ; Veres et al. 2012). Both curves
//! are tables with linear interpolation in between, in fixed point: coordinates are `i32` with
//! [`SIGMA_BITS`] fraction bits.
//!
//! Node spacing 1/512 σ: linear interpolation errs by at most 4.8e-7 of the peak, and the integral
//! over the curve is exact (the trapezoid rule on a gaussian).

use std::sync::LazyLock;

/// Fraction bits of a coordinate: 2^24 is one σ, so that ±128 σ fit.
pub(super) const SIGMA_BITS: u32 = 24;

/// Fraction bits between two nodes of a table.
pub(super) const NODE_BITS: u32 = 15;

/// Where both curves end: 5.5 σ. Outside lies 3.8e-8 of a gaussian.
pub(super) const REACH: i32 = 11 << (SIGMA_BITS - 1);

/// [`REACH`] as a number.
pub(super) const REACH_SIGMA: f64 = 5.5;

/// Φ goes from 0 to 2^27. Steps between nodes times 15 fraction bits stay below 2^32.
pub(super) const STEP_BITS: u32 = 27;

/// g goes from 2^26 at its middle to 0. Steps between nodes times 15 fraction bits stay below 2^32.
pub(super) const BELL_BITS: u32 = 26;

/// Where the nodes end: 8 σ. Powers of two make the check of an index a mask.
pub(super) const END: i32 = 8 << SIGMA_BITS;

/// Intervals of g from 0 to the end, and of Φ from minus to plus the end.
const N_BELL: usize = (END >> NODE_BITS) as usize;
const N_STEP: usize = 2 * N_BELL;

/// Φ and g.
#[derive(Debug)]
pub(super) struct Tables {
    /// Integral of the gaussian, stretched so that it is 0 and 1 at the reach.
    /// From -8 σ to 8 σ.
    pub(super) step: [u32; N_STEP + 1],
    /// `exp(-x²/2)` from the middle outward, 0 from the reach to 8 σ.
    pub(super) bell: [u32; N_BELL + 1],
}

/// The one pair of tables.
pub(super) static TABLES: LazyLock<Tables> = LazyLock::new(|| {
    let node = |k: usize| k as f64 / f64::from(1 << (SIGMA_BITS - NODE_BITS));
    let mut bell = [0; N_BELL + 1];
    for (k, value) in bell.iter_mut().enumerate() {
        let x = node(k);
        if x < REACH_SIGMA {
            *value = fixed(libm::exp(-0.5 * x * x), BELL_BITS);
        }
    }

    let below = |x: f64| 0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2);
    let outside = below(-REACH_SIGMA);
    let mut step = [0; N_STEP + 1];
    for (k, value) in step.iter_mut().enumerate() {
        let x = (node(k) - node(N_BELL)).clamp(-REACH_SIGMA, REACH_SIGMA);
        *value = fixed((below(x) - outside) / (1.0 - 2.0 * outside), STEP_BITS);
    }
    Tables { step, bell }
});

impl Tables {
    /// Φ, with [`STEP_BITS`] fraction bits; only from -8 σ to 8 σ.
    #[inline]
    pub(super) fn step(&self, x: i32) -> u32 {
        let (node, part) = split(x + END);
        let node = node & (N_STEP - 1);
        let (a, b) = (self.step[node], self.step[node + 1]);
        a + (((b - a) * part + HALF) >> NODE_BITS)
    }

    /// g, with [`BELL_BITS`] fraction bits; only from -8 σ to 8 σ.
    #[inline]
    pub(super) fn bell(&self, x: i32) -> u32 {
        let (node, part) = split(x.abs());
        let node = node & (N_BELL - 1);
        let (a, b) = (self.bell[node], self.bell[node + 1]);
        a - (((a - b) * part + HALF) >> NODE_BITS)
    }
}

/// Half a unit of the part between two nodes, to round.
const HALF: u32 = 1 << (NODE_BITS - 1);

/// Node at or before a coordinate that is not negative, and the part of the way to the next.
#[inline]
fn split(x: i32) -> (usize, u32) {
    let x = x.cast_unsigned();
    ((x >> NODE_BITS) as usize, x & ((1 << NODE_BITS) - 1))
}

/// Nearest fixed-point number to a value from 0 to 1.
#[expect(clippy::cast_possible_truncation, reason = "values of 0 to 1 times at most 2^27")]
fn fixed(value: f64, bits: u32) -> u32 {
    (value * f64::from(1_u32 << bits) + 0.5) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_within_5e_7_of_the_gaussian_between_nodes_too() {
        let mut worst = (0.0_f64, 0.0_f64);
        for i in -1_740_000..=1_740_000 {
            let x = i * 77;
            let sigma = f64::from(x) / f64::from(1 << SIGMA_BITS);
            let bell = libm::exp(-0.5 * sigma * sigma);
            let step = 0.5 * libm::erfc(-sigma * std::f64::consts::FRAC_1_SQRT_2);
            let found = f64::from(TABLES.bell(x)) / f64::from(1 << BELL_BITS);
            worst.0 = worst.0.max((found - bell).abs());
            let found = f64::from(TABLES.step(x)) / f64::from(1 << STEP_BITS);
            worst.1 = worst.1.max((found - step).abs());
        }
        assert!(worst.0 < 5e-7, "bell errs by {}", worst.0);
        assert!(worst.1 < 2.5e-7, "step errs by {}", worst.1);
    }

    #[test]
    fn curves_end_exactly_at_the_reach() {
        for x in [REACH, REACH + 1, END - 1] {
            assert_eq!(TABLES.bell(x), 0, "bell at {x}");
            assert_eq!(TABLES.bell(-x), 0, "bell at -{x}");
            assert_eq!(TABLES.step(x), 1 << STEP_BITS, "step at {x}");
            assert_eq!(TABLES.step(-x), 0, "step at -{x}");
        }
        assert_eq!(TABLES.bell(0), 1 << BELL_BITS, "bell in its middle");
    }

    #[test]
    fn no_product_of_the_interpolation_overflows() {
        let steepest = |table: &[u32]| table.windows(2).map(|w| w[0].abs_diff(w[1])).max();
        for table in [&TABLES.step[..], &TABLES.bell[..]] {
            let steepest = u64::from(steepest(table).expect("two nodes"));
            let largest = steepest * ((1 << NODE_BITS) - 1) + u64::from(HALF);
            assert!(largest <= u64::from(u32::MAX), "{largest}");
        }
    }
}
