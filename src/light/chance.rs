//! Random numbers of the lamps: named streams of one seed, each number by its index.

/// One stream. Its numbers depend on the seed, the drone, the name and their index alone, so that
/// a lamp more or a drone more changes nobody else's light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chance {
    key: u64,
}

impl Chance {
    pub(super) fn new(seed: u64, drone: u64, name: &str) -> Self {
        let name = name.bytes().fold(0, |hash, byte| mix(hash ^ u64::from(byte)));
        Self { key: mix(mix(mix(seed) ^ drone) ^ name) }
    }

    /// Uniform in `[0, 1)`.
    pub(super) fn uniform(&self, index: u64) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "53 bits are exact")]
        let bits = (mix(self.key.wrapping_add(index.wrapping_mul(STEP))) >> 11) as f64;
        bits / 9_007_199_254_740_992.0
    }

    /// Poisson-distributed, by inversion; for means up to some hundred.
    pub(super) fn poisson(&self, index: u64, mean: f64) -> u32 {
        let uniform = self.uniform(index);
        let mut share = libm::exp(-mean);
        let (mut n, mut sum) = (0, share);
        while sum <= uniform && n < MAX_COUNT {
            n += 1;
            share *= mean / f64::from(n);
            sum += share;
        }
        n
    }
}

/// Largest count: where rounding keeps the sum of the shares below 1, counting stops here.
const MAX_COUNT: u32 = 2000;

/// The odd number nearest to 2⁶⁴ over the golden ratio.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// Splitmix64 (Steele, Lea, Flood 2014): one step and its mixing.
fn mix(state: u64) -> u64 {
    let z = state.wrapping_add(STEP);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
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
