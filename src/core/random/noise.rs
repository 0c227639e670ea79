//! Random numbers of a flight, as named streams from one seed, and a smooth random field.
//!
//! Every sensor draws a fixed number of random numbers for each measurement. Each number therefore
//! depends only on the seed, the drone, the sensor and the index of its measurement.

use std::f64::consts::TAU;

use nalgebra::{SVector, Vector3};
use pulp::NullaryFnOnce;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use super::elementary::cos;
use crate::digest::{fnv_1a, hmac_sha256};

/// Number of plane waves per component of a [`Field`]. With this number, the field prefers no
/// direction. A larger number would take more time.
const WAVES: usize = 8;

/// Smallest secret seed. A smaller seed, which can be found by trial, has one key for all streams.
pub const PUBLIC_SEEDS: u64 = 1 << 32;

/// Returns the named random stream for a seed. Each stream of a secret seed has a separate key of
/// 256 bits, so that a stream reveals nothing about another stream or about the seed.
pub fn stream(seed: u64, name: impl IntoIterator<Item = u8>) -> ChaCha8Rng {
    if seed >= PUBLIC_SEEDS {
        return ChaCha8Rng::from_seed(hmac_sha256(&seed.to_le_bytes(), name));
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(fnv_1a(name));
    rng
}

/// Noise of one sensor on one drone. The numbers depend only on the seed, the drone and the name.
/// Adding another sensor or drone therefore does not change them.
#[derive(Debug)]
pub struct Noise {
    pub(super) rng: ChaCha8Rng,
    spare: Option<f64>,
}

impl Noise {
    /// Creates the noise of a sensor, given by name, on a drone.
    pub fn new(seed: u64, drone: u64, sensor: &str) -> Self {
        let rng = stream(seed, drone.to_le_bytes().into_iter().chain(sensor.bytes()));
        Self { rng, spare: None }
    }

    /// Draws a normally distributed number with mean 0 and variance 1, by the method of Box and
    /// Muller (1958). Because it uses `libm`, its bits are the same on every machine, unlike those
    /// in the tails of the ziggurat method.
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        // Two uniform numbers give two normally distributed ones, of which the second is kept.
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        let (sin, cos) = libm::sincos(TAU * self.uniform());
        self.spare = Some(radius * sin);
        radius * cos
    }

    /// Draws three independent numbers of the standard normal distribution.
    pub fn normals(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.normal())
    }

    /// Draws a uniformly distributed number in `[0, 1)`.
    pub fn uniform(&mut self) -> f64 {
        self.rng.random()
    }
}

/// Smooth random field with `N` components. Each is a sum of random plane waves that approximates a
/// Gaussian field with correlation `exp(−d²/2l²)` (random Fourier features, Rahimi and Recht 2007).
#[derive(Debug)]
pub struct Field<const N: usize> {
    waves: [[Wave; WAVES]; N],
    amplitude: f64,
}

#[derive(Clone, Copy, Debug)]
struct Wave {
    wavevector_rad_m: Vector3<f64>,
    phase_rad: f64,
}

impl<const N: usize> Field<N> {
    /// Creates a field with the standard deviation `sigma`, in the unit of its values, and the
    /// correlation length `length_m`.
    pub fn new(noise: &mut Noise, sigma: f64, length_m: f64) -> Self {
        let waves = [(); N].map(|()| {
            [(); WAVES].map(|()| Wave {
                wavevector_rad_m: noise.normals() / length_m,
                phase_rad: TAU * noise.uniform(),
            })
        });
        // The variance of a cosine is ½.
        let amplitude = sigma * (2.0 / WAVES as f64).sqrt();
        Self { waves, amplitude }
    }

    /// Returns the components of the field at a position.
    pub fn value_at(&self, position_m: &Vector3<f64>) -> SVector<f64, N> {
        SVector::from_fn(|component, _| self.component(component, position_m))
    }

    /// Returns one component of the field at a position, in the unit of the field's values.
    pub fn component(&self, component: usize, position_m: &Vector3<f64>) -> f64 {
        let heights = crate::dispatch(Heights(&self.waves[component], position_m));
        self.amplitude * heights.iter().sum::<f64>()
    }
}

/// Values of the plane waves at a position.
struct Heights<'a>(&'a [Wave; WAVES], &'a Vector3<f64>);

impl NullaryFnOnce for Heights<'_> {
    type Output = [f64; WAVES];

    /// Returns the height of each wave at the position, from −1 to 1.
    #[inline(always)]
    fn call(self) -> [f64; WAVES] {
        let Self(waves, position_m) = self;
        let mut heights = [0.0; WAVES];
        for (height, wave) in heights.iter_mut().zip(waves) {
            let k = &wave.wavevector_rad_m;
            let phase_rad = k.x * position_m.x + k.y * position_m.y + k.z * position_m.z;
            *height = cos(phase_rad + wave.phase_rad);
        }
        heights
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(seed: u64, drone: u64, sensor: &str) -> [f64; 4] {
        let mut noise = Noise::new(seed, drone, sensor);
        std::array::from_fn(|_| noise.normal())
    }

    #[test]
    fn streams_are_their_own_by_seed_drone_and_name() {
        let gyro = first(1, 0, "gyro");
        assert_eq!(gyro, first(1, 0, "gyro"), "repeats");
        assert_ne!(gyro, first(2, 0, "gyro"), "seed");
        assert_ne!(gyro, first(1, 1, "gyro"), "drone");
        assert_ne!(gyro, first(1, 0, "accelerometer"), "name");
    }

    #[test]
    fn streams_of_a_secret_seed_have_keys_of_their_own() {
        let secret = PUBLIC_SEEDS + 42;
        let [gyro, other] = ["gyro", "accelerometer"].map(|name| stream(secret, name.bytes()));
        assert_ne!(gyro.get_seed(), other.get_seed());
        assert_ne!(gyro.get_seed(), stream(secret + 1, "gyro".bytes()).get_seed());
        assert_ne!(gyro.get_seed(), ChaCha8Rng::seed_from_u64(secret).get_seed());
        let [gyro, other] = ["gyro", "accelerometer"].map(|name| stream(42, name.bytes()));
        assert_eq!(gyro.get_seed(), other.get_seed(), "public");
    }

    #[test]
    fn numbers_stay_what_they_are_in_every_release() {
        // The numbers are recorded from an earlier run. They change only if the crate rand changes
        // ChaCha8 or how it draws uniform numbers.
        let recorded =
            [-0.05580547212376694, 0.04353956031888157, 0.3569199963005024, -1.4828057980230476];
        assert_eq!(first(42, 0, "gyro"), recorded);
    }

    #[test]
    fn a_number_depends_on_its_count_alone() {
        let mut noise = Noise::new(42, 0, "gyro");
        let drawn: Vec<f64> = (0..20).map(|_| noise.normal()).collect();
        for pair in [7_u32, 2, 9] {
            // Each normally distributed number consumes one uniform number of 64 bits, that is, two
            // words of the stream.
            noise.rng.set_word_pos(u128::from(4 * pair));
            noise.spare = None;
            let first = 2 * pair as usize;
            assert_eq!([noise.normal(), noise.normal()], [drawn[first], drawn[first + 1]]);
        }
    }

    #[test]
    fn normals_have_the_moments_of_a_normal() {
        let mut noise = Noise::new(7, 0, "test");
        let n = 200_000;
        let mut moments = [0.0; 4];
        for _ in 0..n {
            let x = noise.normal();
            let square = x * x;
            for (moment, term) in moments.iter_mut().zip([x, square, x * square, square * square]) {
                *moment += term / f64::from(n);
            }
        }
        for (moment, want) in moments.into_iter().zip([0.0, 1.0, 0.0, 3.0]) {
            assert!((moment - want).abs() < 0.05, "{moments:?}");
        }
    }

    #[test]
    fn field_has_its_spread_and_its_length() {
        let mut noise = Noise::new(3, 0, "test");
        let (mut square, mut product, n) = (0.0, 0.0, 4000);
        for _ in 0..n {
            let field = Field::<3>::new(&mut noise, 2.0, 0.5);
            let (here, there) =
                (field.value_at(&Vector3::zeros()), field.value_at(&(Vector3::x() * 0.5)));
            square += here.norm_squared() / f64::from(3 * n);
            product += here.dot(&there) / f64::from(3 * n);
        }
        assert!((square / 4.0 - 1.0).abs() < 0.05, "variance {square} of 4");
        let correlation = product / square;
        assert!((correlation - libm::exp(-0.5)).abs() < 0.05, "correlation {correlation}");
    }
}
