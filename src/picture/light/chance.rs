//! Random numbers of the lamps: named streams of one seed, each number by its index.

use noctograph_core::random::{GOLDEN, poisson, split_mix};

/// A stream. Its numbers depend on the seed, the drone, the name and their index alone, so that an
/// additional lamp or drone does not change the light of the others.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chance {
    key: u64,
}

impl Chance {
    pub(super) fn new(seed: u64, drone: u64, name: &str) -> Self {
        let name = name.bytes().fold(0, |hash, byte| split_mix(hash ^ u64::from(byte)));
        Self { key: split_mix(split_mix(split_mix(seed) ^ drone) ^ name) }
    }

    /// Uniform in `[0, 1)`.
    pub(super) fn uniform(&self, index: u64) -> f64 {
        let bits = (split_mix(self.key.wrapping_add(index.wrapping_mul(GOLDEN))) >> 11) as f64;
        bits / 9_007_199_254_740_992.0
    }

    /// Poisson number.
    pub(super) fn poisson(&self, index: u64, mean: f64) -> u32 {
        poisson(mean, self.uniform(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_by_seed_drone_and_name() {
        let first = |seed, drone, name| Chance::new(seed, drone, name).uniform(0);
        let all = [first(0, 0, "a"), first(1, 0, "a"), first(0, 1, "a"), first(0, 0, "b")];
        for (i, a) in all.iter().enumerate() {
            assert!(all[i + 1..].iter().all(|b| a != b), "{all:?}");
        }
    }

    #[test]
    fn uniform_and_poisson_have_their_means_and_variances() {
        let chance = Chance::new(3, 0, "test");
        let n = 20_000;
        let mean = (0..n).map(|i| chance.uniform(i)).sum::<f64>() / 20_000.0;
        // Standard deviation of the mean: 0.2887 / √20000 = 0.002.
        assert!((mean - 0.5).abs() < 0.008, "uniform mean {mean}");
        for wanted in [0.5, 20.0] {
            let counts: Vec<f64> = (0..n).map(|i| chance.poisson(i, wanted).into()).collect();
            let mean = counts.iter().sum::<f64>() / 20_000.0;
            let variance = counts.iter().map(|c| (c - mean) * (c - mean)).sum::<f64>() / 20_000.0;
            let sigma = libm::sqrt(wanted / 20_000.0);
            assert!((mean - wanted).abs() < 4.0 * sigma, "Poisson mean {mean} for {wanted}");
            assert!((variance / wanted - 1.0).abs() < 0.06, "variance {variance} for {wanted}");
        }
    }
}
