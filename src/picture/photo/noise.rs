//! Random numbers of the sensor. The numbers are functions of seed, row, channel, source and
//! column, so that a pixel's noise depends neither on other pixels nor on the order of computation.

use std::sync::LazyLock;

use crate::narrow;
use noctograph_core::random::split_mix;

/// Number of cells in the table of normal numbers.
const CELLS: usize = 2048;

/// Number of electrons below which the Poisson distribution is exact. At higher numbers a normal
/// distribution replaces it (as in `ISETCam`).
pub(super) const POISSON_BELOW: f32 = 25.0;

/// The purpose of a random number.
#[derive(Clone, Copy, Debug)]
pub(super) enum Source {
    /// All noise of a bright pixel, or only the photons of a dark pixel.
    Shot,
    /// All other noise of a dark pixel: read noise and PRNU.
    Read,
    /// Hot photosites of a row, and their electrons.
    Hot,
}

/// The random numbers of one row, by column.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stream {
    keys: [u32; 2],
}

impl Stream {
    /// Returns the random numbers for one row of a channel and one use. Equal arguments give equal
    /// numbers.
    pub(super) fn new(seed: u64, y: usize, channel: usize, source: Source) -> Self {
        // The use and the channel take 4 bits each, so that every index differs.
        let index = (y as u64) << 8 | (channel as u64) << 4 | source as u64;
        let key = split_mix(split_mix(seed) ^ index);
        #[expect(clippy::cast_possible_truncation, reason = "both halves are used")]
        let keys = [key as u32, (key >> 32) as u32];
        Self { keys }
    }

    /// Returns the 32 random bits of a column (a multiply-xorshift hash, after Wellons'
    /// `lowbias32`).
    #[inline(always)]
    pub(super) fn bits(self, x: u32) -> u32 {
        let mut h = x.wrapping_mul(0x9e37_79b9) ^ self.keys[0];
        h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
        h = (h ^ (h >> 15)).wrapping_add(self.keys[1]).wrapping_mul(0x846c_a68b);
        h ^ (h >> 16)
    }

    /// Writes the random bits of all columns in a row, 32 for each.
    #[inline(always)]
    pub(super) fn fill(self, out: &mut [u32]) {
        for (x, bits) in (0_u32..).zip(out) {
            *bits = self.bits(x);
        }
    }
}

/// Normally distributed numbers, from a piecewise linear inverse of the distribution function.
/// Their variance is 1 to within f32's precision, and they reach 3.8 σ.
#[derive(Debug)]
pub(super) struct Normal {
    /// Start of each cell, and its slope per unit of the lower bits.
    cells: [[f32; 2]; CELLS],
}

pub(super) static NORMAL: LazyLock<Normal> = LazyLock::new(Normal::new);

impl Normal {
    /// Computes the table, whose cells have equal probabilities.
    fn new() -> Self {
        let p = 1.0 / CELLS as f64;
        let mut nodes = [0.0; CELLS + 1];
        for (index, node) in nodes.iter_mut().enumerate().take(CELLS).skip(1) {
            *node = quantile(index as f64 * p);
        }
        // The value of the last cell is the mean of the tail, φ(z) / p.
        let z = nodes[CELLS - 1];
        let tail = libm::exp(-0.5 * z * z) / (std::f64::consts::TAU.sqrt() * p);
        nodes[CELLS] = 2.0 * tail - z;
        nodes[0] = -nodes[CELLS];
        // Scales the distribution to a variance of 1. A cell from a to b contributes (a² + ab + b²)
        // / 3.
        let squares = nodes.windows(2).map(|n| (n[0] * n[0] + n[0] * n[1] + n[1] * n[1]) / 3.0);
        let scale = 1.0 / (squares.sum::<f64>() * p).sqrt();
        let lower = f64::from(1_u32 << LOWER_BITS);
        let cells = std::array::from_fn(|i| {
            let (from, to) = (scale * nodes[i], scale * nodes[i + 1]);
            [narrow(from + (to - from) * 0.5 / lower), narrow((to - from) / lower)]
        });
        Self { cells }
    }

    /// Returns one normally distributed number for each set of 32 uniform bits.
    #[inline(always)]
    pub(super) fn numbers<const N: usize>(&self, bits: [u32; N]) -> [f32; N] {
        let cells = bits.map(|bits| self.cells[(bits >> LOWER_BITS) as usize]);
        std::array::from_fn(|n| {
            let ([from, slope], lower) = (cells[n], bits[n] & ((1 << LOWER_BITS) - 1));
            from + slope * lower.cast_signed() as f32
        })
    }
}

/// Number of bits that select the position within a cell.
const LOWER_BITS: u32 = 32 - CELLS.ilog2();

/// Returns the quantile of the normal distribution for 0 < p < 1, with a relative error of 1.2e-9
/// (rational approximation by P. J. Acklam).
fn quantile(p: f64) -> f64 {
    const A: [f64; 6] = [
        -3.969_683_028_665_376e1,
        2.209_460_984_245_205e2,
        -2.759_285_104_469_687e2,
        1.383_577_518_672_69e2,
        -3.066_479_806_614_716e1,
        2.506_628_277_459_239,
    ];
    const B: [f64; 6] = [
        -5.447_609_879_822_406e1,
        1.615_858_368_580_409e2,
        -1.556_989_798_598_866e2,
        6.680_131_188_771_972e1,
        -1.328_068_155_288_572e1,
        1.0,
    ];
    const C: [f64; 6] = [
        -7.784_894_002_430_293e-3,
        -3.223_964_580_411_365e-1,
        -2.400_758_277_161_838,
        -2.549_732_539_343_734,
        4.374_664_141_464_968,
        2.938_163_982_698_783,
    ];
    const D: [f64; 5] = [
        7.784_695_709_041_462e-3,
        3.224_671_290_700_398e-1,
        2.445_134_137_142_996,
        3.754_408_661_907_416,
        1.0,
    ];
    const TAIL: f64 = 0.024_25;
    // Uses ratios of polynomials, in p - 1/2 in the middle and in √(-2 ln p) in the tails.
    let series = |terms: &[f64], x: f64| terms.iter().fold(0.0, |sum, term| sum * x + term);
    if p > 0.5 {
        -quantile(1.0 - p)
    } else if p < TAIL {
        let q = (-2.0 * libm::log(p)).sqrt();
        series(&C, q) / series(&D, q)
    } else {
        let q = p - 0.5;
        q * series(&A, q * q) / series(&B, q * q)
    }
}

/// Fast Poisson-distributed numbers with means below [`POISSON_BELOW`], from tables for the means
/// `(k / 32)²`. For a mean between two tables, one of them is chosen at random, so that the mean is
/// exact and the variance is accurate to 0.1 %.
#[derive(Debug)]
pub(super) struct Poisson {
    /// Tables in order of increasing means, up to [`POISSON_BELOW`].
    levels: Box<[[u32; NUMBERS]; LEVELS]>,
}

const LEVELS: usize = 256;
const LAST_LEVEL: u32 = 255;

/// Size of a table. At a mean of 25, numbers beyond it have a probability below 2^-32.
const NUMBERS: usize = 64;
const LAST_NUMBER: u32 = 63;

/// Number of bits that select a table's column, and number of bits that decide within it.
const COLUMN_BITS: u32 = NUMBERS.ilog2();
const WITHIN_BITS: u32 = 32 - COLUMN_BITS;

/// Number of lowest bits that select the level. These bits are negligible within a column.
const LEVEL_BITS: u32 = 12;

/// Divisor of k² in the mean of level k.
const PER_SQUARE: f32 = 1024.0;

pub(super) static POISSON: LazyLock<Poisson> = LazyLock::new(Poisson::new);

impl Poisson {
    /// Computes the tables of all means, up to [`POISSON_BELOW`].
    fn new() -> Self {
        let last = (f64::from(POISSON_BELOW * PER_SQUARE)).sqrt().ceil();
        let mut levels = Box::new([[0; NUMBERS]; LEVELS]);
        for (k, level) in levels.iter_mut().enumerate() {
            let root = last.min(k as f64);
            *level = table(root * root / f64::from(PER_SQUARE));
        }
        Self { levels }
    }

    /// Returns a Poisson-distributed number for each mean and its uniform bits.
    ///
    /// The code has no branches, because random bits would defeat branch prediction. Lookups are
    /// separate from the computations before and after them, which use wide registers.
    #[inline(always)]
    pub(super) fn numbers<const N: usize>(&self, means: [f32; N], bits: [u32; N]) -> [f32; N] {
        let level: [u32; N] = std::array::from_fn(|n| Self::level(means[n], bits[n]));
        let column = bits.map(|bits| bits >> WITHIN_BITS);
        let cells: [u32; N] = std::array::from_fn(|n| {
            self.levels[level[n] as usize % LEVELS][column[n] as usize % NUMBERS]
        });
        std::array::from_fn(|n| {
            // The mask is all ones if the bits within select the column, and zero otherwise.
            let within = bits[n] & ((1 << WITHIN_BITS) - 1);
            let mask = (within.cast_signed() - (cells[n] >> COLUMN_BITS).cast_signed()) >> 31;
            let alias = cells[n] & LAST_NUMBER;
            (alias ^ (alias ^ column[n]) & mask.cast_unsigned()).cast_signed() as f32
        })
    }

    /// Returns the table's index for a mean. The lowest bits choose between the two nearest.
    #[inline(always)]
    fn level(mean: f32, bits: u32) -> u32 {
        let square = mean * PER_SQUARE;
        // After the addition of 1.5 · 2^23, the last bits are the integer part of the number.
        let k = (square.sqrt() - 0.5 + 12_582_912.0).to_bits() & LAST_LEVEL;
        // The next level above k² is 2 k + 1 away.
        let low = (bits & ((1 << LEVEL_BITS) - 1)).cast_signed() as f32 + 0.5;
        let beyond = (square - (k * k).cast_signed() as f32) * (1_i32 << LEVEL_BITS) as f32;
        k + u32::from(low * (2 * k + 1).cast_signed() as f32 <= beyond)
    }
}

/// Returns the alias table of a Poisson distribution (Walker 1977, Vose 1991). The number is the
/// column if the bits within are less than the cell's upper bits, and otherwise the alias in its
/// lower bits.
fn table(mean: f64) -> [u32; NUMBERS] {
    // Computes the probabilities, multiplied by the number of columns.
    let mut probability = NUMBERS as f64 * libm::exp(-mean);
    let mut scaled: [f64; NUMBERS] = std::array::from_fn(|number| {
        let scaled = probability;
        probability *= mean / (number + 1) as f64;
        scaled
    });
    let (mut rare, mut frequent): (Vec<usize>, Vec<usize>) =
        (0..NUMBERS).partition(|&number| scaled[number] < 1.0);
    let mut cells = [((1 << WITHIN_BITS) - 1) << COLUMN_BITS; NUMBERS];
    // If a number is too rare to fill its column, a frequent number, its alias, fills the rest.
    while let (Some(&alias), Some(column)) = (frequent.last(), rare.pop()) {
        #[expect(clippy::cast_possible_truncation, reason = "below 1")]
        let within = (scaled[column] * f64::from(1 << WITHIN_BITS)) as u32;
        cells[column] = within << COLUMN_BITS | u32::try_from(alias).expect("a column");
        scaled[alias] -= 1.0 - scaled[column];
        if scaled[alias] < 1.0 {
            rare.extend(frequent.pop());
        }
    }
    // Each remaining number fills one column, apart from rounding.
    for number in rare.into_iter().chain(frequent) {
        cells[number] |= u32::try_from(number).expect("a column");
    }
    cells
}
