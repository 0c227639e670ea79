//! Film: the exposure as integer counts, at the finest scale at which no pixel can overflow.
//!
//! The sum of the peaks of all records that touch a tile of 16 × 16 pixels is an upper bound for
//! each of its pixels. One count is the smallest power of two, in lx s, at which the brightest tile
//! stays below 2^31 counts. A quarter of a `u32` is reserved for the glow of the floor, and a
//! quarter for the rounding of up to 2^30 records.

use super::Tint;
use super::tile::ALL;
use noctograph_core::digest::Digest;
use noctograph_core::error::{Error, Result};
use noctograph_core::product::{Rules, Valid, check_picture};

const TILE_PX: u32 = 16;

/// Number of bits of the sum of peaks on a tile, in counts.
const TILE_BITS: i32 = 31;

/// Number of bits of the peak of a record in counts, the same as in its curves.
const PEAK_BITS: i32 = 30;

/// Number of bits of the glow of the floor, in counts.
const GLOW_BITS: i32 = 30;

/// Finest scale, sufficient for any light and far from underflow.
const MIN_SCALE_LOG2: i32 = -128;

/// Coarsest scale, at which the largest count is still far below the largest `f32`.
const MAX_SCALE_LOG2: i32 = 64;

/// Returns [`Error::Input`] for a scale out of range. A count is 2 to its power, in lx s.
pub(super) fn check_scale(scale_log2: i32) -> Result<()> {
    if (MIN_SCALE_LOG2..=MAX_SCALE_LOG2).contains(&scale_log2) {
        return Ok(());
    }
    let wanted = format!("{MIN_SCALE_LOG2} to {MAX_SCALE_LOG2}");
    Err(Error::input("scale_log2", scale_log2, wanted, "a count is 2^scale_log2 lx s"))
}

/// Luminous exposure of the sensor for each pixel and color channel, as integer counts.
pub type Film = Valid<FilmData>;

/// The data of a [`Film`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FilmData {
    /// Width in pixels.
    pub width_px: u32,
    /// Height in pixels.
    pub height_px: u32,
    /// Three planes in linear sRGB (red, green, blue), each row by row from the top left.
    pub counts: Vec<u32>,
    /// Binary logarithm of one count in lx s.
    pub scale_log2: i32,
}

impl Rules for FilmData {
    fn check(&self) -> Result<()> {
        check_picture([self.width_px, self.height_px], self.counts.len(), 3)?;
        check_scale(self.scale_log2)
    }
}

impl FilmData {
    /// Returns the luminous exposure of one channel (0 red, 1 green, 2 blue) in lx s at the pixel
    /// with index `y * width_px + x`. White light of H lx s has the value H in all three channels.
    ///
    /// # Panics
    ///
    /// Panics if the film has no such channel or pixel.
    pub fn exposure_lx_s(&self, channel: usize, index: usize) -> f64 {
        libm::ldexp(f64::from(self.plane(channel)[index]), self.scale_log2)
    }

    /// Returns the sum of one channel (0 red, 1 green, 2 blue) over the pixels, in lx s.
    ///
    /// # Panics
    ///
    /// Panics if the film has no such channel.
    pub fn light_lx_s_px2(&self, channel: usize) -> f64 {
        let sum: u64 = self.plane(channel).iter().map(|&count| u64::from(count)).sum();
        libm::ldexp(sum as f64, self.scale_log2)
    }

    /// Returns the counts of one channel (0 red, 1 green, 2 blue).
    pub fn plane(&self, channel: usize) -> &[u32] {
        let pixels = self.counts.len() / 3;
        &self.counts[channel * pixels..][..pixels]
    }

    /// Returns the SHA-256 of size, scale and counts (little endian) in hexadecimal. Equal films
    /// have the same hash on every backend and machine.
    pub fn sha256(&self) -> String {
        let mut digest = Digest::default();
        digest.add([self.width_px, self.height_px].map(u32::to_le_bytes).as_flattened());
        digest.add(self.scale_log2.to_le_bytes());
        for counts in self.counts.chunks(4096) {
            let bytes: Vec<u8> = counts.iter().flat_map(|count| count.to_le_bytes()).collect();
            digest.add(bytes);
        }
        digest.hex()
    }
}

/// Returns the smallest `scale_log2` at which no pixel can overflow, given a glow of up to
/// `glow_lx_s`.
pub(super) fn finest_scale_log2(tints: &[Tint], glow_lx_s: f64, size_px: [u32; 2]) -> i32 {
    let [width, height] = size_px;
    let columns = width.div_ceil(TILE_PX) as usize;
    let rows = height.div_ceil(TILE_PX) as usize;
    let mut tiles = vec![[0.0_f64; 3]; columns * rows];
    let mut brightest_record = 0.0_f64;
    for tint in tints {
        let fractions = tint.fractions.map(|fraction| f64::from(fraction) / f64::from(ALL));
        for record in &tint.records {
            let peak_lx_s = record.peak_lx_s();
            brightest_record = brightest_record.max(peak_lx_s);
            // The peak is added to every tile that the box touches.
            let [across, down] = record
                .inside(width, &(0..height))
                .map(|pixels| [pixels.start, pixels.end - 1].map(|px| (px / TILE_PX) as usize));
            for row in down[0]..=down[1] {
                for sum in &mut tiles[row * columns..][across[0]..=across[1]] {
                    for (sum, fraction) in sum.iter_mut().zip(fractions) {
                        *sum += fraction * peak_lx_s;
                    }
                }
            }
        }
    }
    let brightest_tile = tiles.iter().flatten().copied().fold(0.0, f64::max);
    let brightest =
        [(brightest_tile, TILE_BITS), (brightest_record, PEAK_BITS), (glow_lx_s, GLOW_BITS)];
    // `frexp` returns an exponent for which x < 2^exponent.
    let lit = brightest.into_iter().filter(|(x, _)| *x > 0.0);
    lit.map(|(x, bits)| libm::frexp(x).1 - bits).fold(MIN_SCALE_LOG2, i32::max)
}
