//! Pseudorandom numbers by key, named streams of noise, and a smooth random field.

mod elementary;
mod noise;
mod normals;

pub use self::noise::{Field, Noise, PUBLIC_SEEDS, stream};
pub use self::normals::Normals;

/// Odd number nearest to 2⁶⁴ divided by the golden ratio.
pub const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// Returns the output of `SplitMix64` (Steele, Lea, Flood 2014) for a state. Its shifts and factors
/// are those of the authors.
pub fn split_mix(state: u64) -> u64 {
    let z = state.wrapping_add(GOLDEN);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Returns a Poisson-distributed number with a mean of up to 500, by inversion of a uniform random
/// number from 0 to 1.
pub fn poisson(mean: f64, uniform: f64) -> u32 {
    /// Largest result, which ends the loop if rounding keeps the sum of the probabilities below 1.
    const LARGEST: u32 = 1000;
    // The probabilities are P(0) = exp(−mean) and P(n) = P(n − 1) · mean / n.
    let mut p = libm::exp(-mean);
    let (mut number, mut sum) = (0, p);
    while sum <= uniform && number < LARGEST {
        number += 1;
        p *= mean / f64::from(number);
        sum += p;
    }
    number
}
