//! The neural network ("the net"), which computes the logits of all characters at every second
//! column of a strip of light.
//!
//! The net consists of integer convolutions (Jacob and others 2018): 8-bit light, activations and
//! weights, 32-bit sums, and one multiplier per channel. Integer sums are equal on every machine.
//! `examples/readings/net.py` and `train.py` document architecture, training and file format.

use std::ops::Range;
use std::sync::LazyLock;

use pulp::bytemuck::cast;
use pulp::{NullaryFnOnce, i16x16, i32x8};

use super::strip::{HEIGHT, Strip};

/// The trained weights, in the format that `layers` reads.
const WEIGHTS: &[u8] = include_bytes!("weights.bin");

/// Number of classes of the last layer: the blank, 62 characters, and light that is no letter.
pub(super) const N_CLASSES: usize = 64;

/// Number of strip columns for each column of logits.
pub(super) const COLUMN_PX: usize = 2;

/// Number of dark columns required on each side of a logit's columns to make it a blank.
const DARK_PX: usize = 2;

/// Logit that corresponds to one unit in the sums of the last layer.
const LOGIT: f64 = 1.0 / 256.0;

/// The layers of the net with the program's built-in weights.
static NET: LazyLock<Vec<Layer>> = LazyLock::new(|| layers(WEIGHTS));

/// A convolution layer. If it is dilated, its input is added to its output. The result is then
/// max-pooled over blocks of rows and columns.
struct Layer {
    /// Numbers of rows and columns of the kernel.
    kernel: [usize; 2],
    /// Numbers of input and output channels.
    channels: [usize; 2],
    /// Numbers of rows and columns of the blocks for max pooling.
    pool: [usize; 2],
    /// Dilation: distance in columns between neighboring kernel columns, or `None` if adjacent.
    dilation: Option<usize>,
    /// Weights, sorted by group of output channels, kernel row, kernel column, pair of input
    /// channels, and block of eight output channels. Each vector interleaves a pair's weights.
    weights: Vec<i16x16>,
    /// Number of blocks of eight output channels whose sums are computed together.
    eights: usize,
    /// Multiplier and bias of each output channel, padded to whole blocks of eight.
    multipliers: Vec<i32>,
    biases: Vec<i32>,
}

/// Number of channels in a vector register.
const LANES: usize = 8;

/// Maximum number of vectors of sums per column, and number of columns whose sums are computed
/// together. Their product is the number of vectors that fit into the registers.
const MOST_EIGHTS: usize = 2;
const COLUMNS: usize = 4;

/// Activations, stored row by row, with the channels of a pixel next to each other.
struct Map {
    height: usize,
    width: usize,
    channels: usize,
    values: Vec<i16>,
}

/// Reach of a logit's receptive field on each side, in columns of a strip.
static REACH_PX: LazyLock<usize> = LazyLock::new(|| {
    let reach = NET.iter().scan(1, |step, layer| {
        let reach = layer.kernel[1] / 2 * layer.dilation.unwrap_or(1) * *step;
        *step *= layer.pool[1];
        Some(reach + *step)
    });
    reach.sum::<usize>().next_multiple_of(COLUMN_PX)
});

/// Returns the logits of all classes at every second column in the part of a strip that is read.
pub(super) fn logits(strip: &Strip) -> Vec<[f64; N_CLASSES]> {
    logits_of(strip, strip.read.clone())
}

/// Returns the logits that depend on a part of a strip, given in pixels, and the index of the first
/// of them.
pub(super) fn logits_around(strip: &Strip, part: Range<usize>) -> (usize, Vec<[f64; N_CLASSES]>) {
    // Every logit whose receptive field touches the part changes. Computing such a logit requires
    // all columns of its receptive field.
    let [wanted, needed] = [*REACH_PX, 2 * *REACH_PX].map(|reach| {
        let [first, end] = [part.start.saturating_sub(reach), part.end + reach]
            .map(|column| column.clamp(strip.read.start, strip.read.end));
        first / COLUMN_PX..end.div_ceil(COLUMN_PX)
    });
    let logits = logits_of(strip, COLUMN_PX * needed.start..COLUMN_PX * needed.end);
    let wanted_logits = &logits[wanted.start - needed.start..wanted.end - needed.start];
    (wanted.start, wanted_logits.to_vec())
}

/// Returns the logits of all classes for a range of pixel columns of a strip, one row for each
/// [`COLUMN_PX`] of them.
fn logits_of(strip: &Strip, columns: Range<usize>) -> Vec<[f64; N_CLASSES]> {
    let values = strip.bytes(columns.clone()).into_iter().map(i16::from).collect();
    let mut map = Map { height: HEIGHT, width: columns.len(), channels: 2, values };
    let (last, layers) = NET.split_last().expect("the net has layers");
    for layer in layers {
        map = layer.activations(&map).pooled(layer.pool);
    }
    let sums = last.sums(&map);
    let logits = sums.as_chunks().0.iter().map(|sums| sums.map(|sum| f64::from(sum) * LOGIT));
    let mut logits: Vec<[f64; N_CLASSES]> = logits.collect();
    // Dark columns become blanks, because the net outputs "no letter" in gaps between words.
    for (column, logits) in columns.step_by(COLUMN_PX).zip(&mut logits) {
        if strip.is_dark(column.saturating_sub(DARK_PX)..column + COLUMN_PX + DARK_PX) {
            logits[N_CLASSES - 1] = f64::NEG_INFINITY;
        }
    }
    logits
}

/// Parses the layers from a weights file.
fn layers(mut bytes: &[u8]) -> Vec<Layer> {
    let mut layers = Vec::new();
    while let Some((head, rest)) = bytes.split_at_checked(6) {
        // Each layer has a header of six bytes, then its weights by output channel, and then its
        // 32-bit multipliers and biases.
        let [kh, kw, ci, co, pool, dilation] =
            [0, 1, 2, 3, 4, 5].map(|byte| usize::from(head[byte]));
        let (weights, rest) = rest.split_at(kh * kw * ci * co);
        let (multipliers, rest) = rest.split_at(4 * co);
        let (biases, rest) = rest.split_at(4 * co);
        let padded = co.next_multiple_of(LANES);
        let [multipliers, biases] = [multipliers, biases].map(|bytes| {
            let numbers = bytes.as_chunks().0.iter().map(|b| i32::from_le_bytes(*b));
            numbers.chain(std::iter::repeat_n(0, padded - co)).collect()
        });
        // All groups have the same number of channels, the most that the registers allow.
        let eights = (1..=MOST_EIGHTS).rev().find(|n| (padded / LANES).is_multiple_of(*n));
        let eights = eights.expect("1 divides every number");
        let weight = |channel: usize, place: usize| {
            let byte = weights.get(channel * kh * kw * ci + place).filter(|_| channel < co);
            byte.map_or(0, |byte| i16::from(byte.cast_signed()))
        };
        let groups = (0..padded).step_by(eights * LANES).flat_map(|first| {
            (0..kh * kw * ci).step_by(2).flat_map(move |pair| {
                (first..first + eights * LANES).step_by(LANES).map(move |eight| {
                    cast(std::array::from_fn::<i16, 16, _>(|n| weight(eight + n / 2, pair + n % 2)))
                })
            })
        });
        layers.push(Layer {
            kernel: [kh, kw],
            channels: [ci, co],
            pool: [pool / 16, pool % 16],
            dilation: (dilation > 0).then_some(dilation),
            weights: groups.collect(),
            eights,
            multipliers,
            biases,
        });
        bytes = rest;
    }
    layers
}

impl Layer {
    /// Returns the scaled sums, row by row. Columns outside the map count as zeros. A kernel as
    /// high as the map yields one row of sums. For other kernels, rows outside the map also count
    /// as zeros.
    fn sums(&self, map: &Map) -> Vec<i32> {
        let [kh, kw] = self.kernel;
        let [ci, co] = self.channels;
        assert_eq!(map.channels, ci, "each layer takes what the one before it makes");
        let above = if kh == map.height { 0 } else { kh / 2 };
        let height = map.height + 2 * above + 1 - kh;
        // Each row of the map is padded with columns of zeros.
        let padding = kw / 2 * self.dilation.unwrap_or(1) * ci / 2;
        let row_length = map.width * ci / 2;
        let mut rows = vec![vec![[0; 2]; row_length + 2 * padding]; map.height + 2 * above];
        let pairs = map.values.as_chunks().0;
        for (row, values) in rows[above..].iter_mut().zip(pairs.chunks_exact(row_length)) {
            row[padding..padding + row_length].copy_from_slice(values);
        }
        let mut sums = vec![0; height * map.width * co];
        let work = Sums { layer: self, width: map.width, rows, sums: &mut sums };
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            pulp::Simd::vectorize(simd, With(simd, work));
            return sums;
        }
        #[cfg(all(target_family = "wasm", target_feature = "simd128"))]
        With(Simd128, work).call();
        #[cfg(not(all(target_family = "wasm", target_feature = "simd128")))]
        With((), work).call();
        sums
    }

    /// Returns the sums clamped to 0 to 255, after a dilated layer's input was added.
    fn activations(&self, map: &Map) -> Map {
        let mut sums = self.sums(map);
        if self.dilation.is_some() {
            sums.iter_mut().zip(&map.values).for_each(|(sum, before)| *sum += i32::from(*before));
        }
        let values: Vec<i16> = sums.iter().map(|sum| (*sum).clamp(0, 255) as i16).collect();
        let channels = self.channels[1];
        Map { height: values.len() / channels / map.width, width: map.width, channels, values }
    }
}

/// Sums of a layer, with eight channels per register. All kinds of registers give the same sums.
struct Sums<'a> {
    layer: &'a Layer,
    width: usize,
    /// Padded rows of the map, as pairs of channels.
    rows: Vec<Vec<[i16; 2]>>,
    sums: &'a mut [i32],
}

/// Vector registers of one kind of processor.
trait Registers: Copy {
    /// Adds the products of two activations and their weights to the sums.
    fn add(self, sums: i32x8, pair: [i16; 2], weights: i16x16) -> i32x8;
}

/// Plain arrays, which work on every processor.
impl Registers for () {
    /// Adds the products of two values and eight pairs of weights to eight sums, without vector
    /// instructions.
    #[inline(always)]
    fn add(self, sums: i32x8, pair: [i16; 2], weights: i16x16) -> i32x8 {
        let (mut sums, weights): ([i32; LANES], [[i16; 2]; LANES]) = (cast(sums), cast(weights));
        for (sum, weights) in sums.iter_mut().zip(weights) {
            for (value, weight) in pair.into_iter().zip(weights) {
                *sum = sum.wrapping_add(i32::from(value) * i32::from(weight));
            }
        }
        cast(sums)
    }
}

#[cfg(target_arch = "x86_64")]
impl Registers for pulp::x86::V3 {
    #[inline(always)]
    fn add(self, sums: i32x8, pair: [i16; 2], weights: i16x16) -> i32x8 {
        let pair = cast(self.splat_i32x8(cast(pair)));
        self.wrapping_add_i32x8(sums, self.multiply_wrapping_add_adjacent_i16x16(pair, weights))
    }
}

/// 128-bit registers of WebAssembly.
#[cfg(all(target_family = "wasm", target_feature = "simd128"))]
#[derive(Clone, Copy)]
struct Simd128;

#[cfg(all(target_family = "wasm", target_feature = "simd128"))]
impl Registers for Simd128 {
    /// Adds the products of two values and eight pairs of weights to eight sums, four at a time.
    #[inline(always)]
    fn add(self, sums: i32x8, pair: [i16; 2], weights: i16x16) -> i32x8 {
        use core::arch::wasm32::{
            i32x4_add, i32x4_dot_i16x8, i32x4_splat, u64x2, u64x2_extract_lane,
        };
        let pair = i32x4_splat(cast(pair));
        let [sums, weights]: [[[u64; 2]; 2]; 2] = [cast(sums), cast(weights)];
        let halves = [0, 1].map(|half| {
            let [sums, weights] = [sums, weights].map(|x| u64x2(x[half][0], x[half][1]));
            let sum = i32x4_add(sums, i32x4_dot_i16x8(pair, weights));
            [u64x2_extract_lane::<0>(sum), u64x2_extract_lane::<1>(sum)]
        });
        cast(halves)
    }
}

/// A call that computes the sums of a layer with the given registers.
struct With<'a, R>(R, Sums<'a>);

impl<R: Registers> NullaryFnOnce for With<'_, R> {
    type Output = ();

    /// Computes all sums with the registers of this machine.
    #[inline(always)]
    fn call(self) {
        let Self(registers, mut sums) = self;
        // Each group size is compiled separately, so that the totals stay in registers.
        match sums.layer.eights {
            1 => sums.add_groups::<1>(registers),
            _ => sums.add_groups::<MOST_EIGHTS>(registers),
        }
    }
}

impl Sums<'_> {
    /// Computes all sums, in groups of `N` blocks of eight channels. The weights of a group stay in
    /// the innermost cache for all pixels.
    #[inline(always)]
    fn add_groups<const N: usize>(&mut self, registers: impl Registers) {
        let layer = self.layer;
        let Layer { kernel: [kh, kw], channels: [ci, co], .. } = *layer;
        for (group, weights) in layer.weights.chunks_exact(kh * kw * ci / 2 * N).enumerate() {
            let first = group * N * LANES;
            let biases: [i32x8; N] = std::array::from_fn(|n| {
                let eight = layer.biases[first + n * LANES..].first_chunk::<LANES>();
                cast(*eight.expect("biases of whole eights"))
            });
            for (y, sums) in self.sums.chunks_exact_mut(self.width * co).enumerate() {
                for (block, sums) in sums.chunks_mut(COLUMNS * co).enumerate() {
                    // At the end of a row, the last column stands in for those beyond it.
                    let columns =
                        std::array::from_fn(|n| (block * COLUMNS + n).min(self.width - 1));
                    let rows = &self.rows[y..y + kh];
                    let totals = layer.totals(biases, weights, rows, columns, registers);
                    for (sums, totals) in sums.chunks_exact_mut(co).zip(totals) {
                        layer.scale(first, totals, &mut sums[first..]);
                    }
                }
            }
        }
    }
}

impl Layer {
    /// Returns the totals of a group of channels in some columns. Each vector of weights is loaded
    /// once for all of them.
    #[inline(always)]
    fn totals<const N: usize>(
        &self,
        biases: [i32x8; N],
        weights: &[i16x16],
        rows: &[Vec<[i16; 2]>],
        columns: [usize; COLUMNS],
        registers: impl Registers,
    ) -> [[i32x8; N]; COLUMNS] {
        let Self { kernel: [_, kw], channels: [ci, _], dilation, .. } = *self;
        let run = kw * ci / 2;
        // Without dilation, a row of the kernel covers one contiguous piece of columns.
        let (piece, step) = dilation.map_or((run, run), |dilation| (ci / 2, dilation * ci / 2));
        // The totals are initialized with the biases, and stay in registers. In a nested array they
        // would be stored after each addition.
        let [mut p, mut q, mut r, mut s] = [biases; COLUMNS];
        let add = |totals: &mut [i32x8; N], pair: &[i16; 2], weights: &[i16x16; N]| {
            for (total, weights) in totals.iter_mut().zip(weights) {
                *total = registers.add(*total, *pair, *weights);
            }
        };
        let mut pieces = weights.chunks_exact(piece * N);
        for row in rows {
            for (n, weights) in (0..run / piece).zip(&mut pieces) {
                let [a, b, c, d] = columns.map(|x| row[x * ci / 2 + n * step..][..piece].iter());
                let weights = weights.as_chunks::<N>().0.iter();
                for ((((weights, a), b), c), d) in weights.zip(a).zip(b).zip(c).zip(d) {
                    add(&mut p, a, weights);
                    add(&mut q, b, weights);
                    add(&mut r, c, weights);
                    add(&mut s, d, weights);
                }
            }
        }
        [p, q, r, s]
    }

    /// Writes totals, multiplied by the factors of their channels in units of 2⁻²⁴, to `sums`.
    /// `first` is the first channel.
    #[inline(always)]
    fn scale<const N: usize>(&self, first: usize, totals: [i32x8; N], sums: &mut [i32]) {
        for (n, (sums, total)) in sums.chunks_mut(LANES).zip(totals).enumerate() {
            let totals: [i32; LANES] = cast(total);
            let factors = self.multipliers[first + n * LANES..].first_chunk::<LANES>();
            let factors = factors.expect("multipliers of whole eights");
            #[expect(clippy::cast_possible_truncation, reason = "logits are small")]
            let scaled: [i32; LANES] = std::array::from_fn(|lane| {
                ((i64::from(totals[lane]) * i64::from(factors[lane])) >> 24) as i32
            });
            match sums.as_chunks_mut().0.first_mut() {
                Some(sums) => *sums = scaled,
                None => sums.copy_from_slice(&scaled[..sums.len()]),
            }
        }
    }
}

impl Map {
    /// Returns the maxima over blocks of rows and columns, ignoring incomplete blocks at the edges.
    fn pooled(self, [rows, columns]: [usize; 2]) -> Self {
        if [rows, columns] == [1, 1] {
            return self;
        }
        let (height, width, channels) = (self.height / rows, self.width / columns, self.channels);
        let mut values = vec![0_i16; height * width * channels];
        for (index, pixel) in values.chunks_exact_mut(channels).enumerate() {
            let (y, x) = (index / width * rows, index % width * columns);
            for (row, column) in (0..rows).flat_map(|r| (0..columns).map(move |c| (y + r, x + c))) {
                let from = &self.values[(row * self.width + column) * channels..][..channels];
                pixel.iter_mut().zip(from).for_each(|(most, value)| *most = (*most).max(*value));
            }
        }
        Self { height, width, channels, values }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::digest::fnv_1a;

    /// FNV-1a hash of the logits that the built-in weights give for the pattern below.
    const LOGITS_FNV_1A: u64 = 7_987_465_851_812_230_209;

    fn pattern(width: usize) -> Strip {
        let [bright, pure] = [7, 13].map(|step| {
            (0..width * HEIGHT).map(|pixel| ((pixel * step) % 251) as f32 / 250.0).collect()
        });
        Strip { width, bright, pure, read: 0..width }
    }

    #[test]
    fn logits_around_a_part_are_those_of_the_whole_strip() {
        let width = 300;
        let strip = pattern(width);
        let whole = logits(&strip);
        for part in [0..10, 130..151, 280..300, 0..300] {
            let (first, around) = logits_around(&strip, part.clone());
            assert_eq!(around[..], whole[first..first + around.len()], "{part:?}");
            let mut dark = strip.clone();
            for row in dark.bright.chunks_exact_mut(width) {
                row[part.clone()].fill(0.0);
            }
            let changed = logits(&dark);
            let mut differing =
                (0..whole.len()).filter(|column| changed[*column] != whole[*column]);
            let reached = first..first + around.len();
            assert!(differing.all(|column| reached.contains(&column)), "{part:?}");
        }
    }

    #[test]
    fn logits_are_the_same_integers_on_every_machine() {
        let logits = logits(&pattern(60));
        assert_eq!(logits.len(), 60 / COLUMN_PX);
        let bytes: Vec<u8> =
            logits.iter().flatten().flat_map(|logit| logit.to_le_bytes()).collect();
        assert_eq!(fnv_1a(bytes), LOGITS_FNV_1A, "other weights, or other arithmetic");
    }
}
