//! The curve of the splat as integers, shared by both backends.
//!
//! A spot is a gaussian, `exp(-(u² + v²) / 2)` with u and v in σ: the product of one curve along
//! each axis of the picture. The curve is a table with linear interpolation in between, in fixed
//! point: coordinates are `i32` with [`SIGMA_BITS`] fraction bits.
//!
//! Node spacing 1/512 σ: linear interpolation errs by at most 4.8e-7 of the peak, and the integral
//! over the curve is exact (the trapezoid rule on a gaussian).

use std::sync::LazyLock;

/// Fraction bits of a coordinate: 2^24 is one σ.
pub(super) const SIGMA_BITS: u32 = 24;

/// Fraction bits between two nodes of the table.
pub(super) const NODE_BITS: u32 = 15;

/// Where the curve ends: 5.5 σ. Outside lies 3.8e-8 of a gaussian.
pub(super) const REACH_SIGMA: f64 = 5.5;

/// The curve goes from 2^26 at its middle to 0. Steps between nodes times 15 fraction bits stay
/// below 2^32.
pub(super) const BELL_BITS: u32 = 26;

/// Where the nodes end: 8 σ. A power of two makes the check of an index a mask.
pub(super) const END: i32 = 8 << SIGMA_BITS;

/// Intervals from 0 to the end.
const N_BELL: usize = (END >> NODE_BITS) as usize;

/// `exp(-x²/2)` from the middle outward, 0 from the reach to 8 σ.
pub(super) static BELL: LazyLock<Box<[u32; N_BELL + 1]>> = LazyLock::new(|| {
    let mut nodes = Box::new([0; N_BELL + 1]);
    for (k, value) in nodes.iter_mut().enumerate() {
        let x = k as f64 / f64::from(1 << (SIGMA_BITS - NODE_BITS));
        if x < REACH_SIGMA {
            *value = fixed(libm::exp(-0.5 * x * x), BELL_BITS);
        }
    }
    nodes
});

/// The curve at `x`, with [`BELL_BITS`] fraction bits; only from -8 σ to 8 σ.
#[inline(always)]
pub(super) fn bell(nodes: &[u32; N_BELL + 1], x: i32) -> u32 {
    let x = x.unsigned_abs();
    let node = (x >> NODE_BITS) as usize & (N_BELL - 1);
    let part = x & ((1 << NODE_BITS) - 1);
    let (a, b) = (nodes[node], nodes[node + 1]);
    a - (((a - b) * part + HALF) >> NODE_BITS)
}

/// Half a unit of the part between two nodes, to round.
const HALF: u32 = 1 << (NODE_BITS - 1);

/// Nearest fixed-point number to a value from 0 to 1.
#[expect(clippy::cast_possible_truncation, reason = "values of 0 to 1 times at most 2^31")]
pub(super) fn fixed(value: f64, bits: u32) -> u32 {
    (value * f64::from(1_u32 << bits) + 0.5) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_is_within_5e_7_of_the_gaussian_between_nodes_too() {
        let mut worst = 0.0_f64;
        for i in -1_740_000..=1_740_000 {
            let x = i * 77;
            let sigma = f64::from(x) / f64::from(1 << SIGMA_BITS);
            let found = f64::from(bell(&BELL, x)) / f64::from(1 << BELL_BITS);
            worst = worst.max((found - libm::exp(-0.5 * sigma * sigma)).abs());
        }
        assert!(worst < 5e-7, "it errs by {worst}");
    }

    #[test]
    fn the_curve_ends_exactly_at_the_reach() {
        let reach = 11 << (SIGMA_BITS - 1);
        for x in [reach, reach + 1, END - 1] {
            assert_eq!((bell(&BELL, x), bell(&BELL, -x)), (0, 0), "at ±{x}");
        }
        assert_eq!(bell(&BELL, 0), 1 << BELL_BITS, "in its middle");
    }

    #[test]
    fn no_product_of_the_interpolation_overflows() {
        let steepest = BELL.windows(2).map(|w| w[0].abs_diff(w[1])).max().expect("two nodes");
        let largest = u64::from(steepest) * ((1 << NODE_BITS) - 1) + u64::from(HALF);
        assert!(u32::try_from(largest).is_ok(), "{largest}");
    }
}
