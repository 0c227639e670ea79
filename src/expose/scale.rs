//! The scale of a film: so fine as it can be while no pixel can overflow.
//!
//! Every tile of 16 × 16 pixels sums the peaks of the stamps whose box touches it; no pixel of the
//! tile can get more. One count is the smallest power of two, in lx s, at which the brightest tile
//! stays below 2^31 counts. A quarter of a `u32` is for the floor's glow, and a quarter for the
//! rounding of up to 2^30 stamps.

use super::record::Stamp;

/// Edge of a tile.
const TILE_PX: u32 = 16;

/// Sum of peaks on a tile stays below this power of two, in counts.
const TILE_BITS: i32 = 31;

/// Amplitude of a stamp stays below this power of two, in counts: its mantissa has 32 bits.
const AMPLITUDE_BITS: i32 = 30;

/// The floor's glow stays below this power of two, in counts.
const GLOW_BITS: i32 = 30;

/// Finest scale: enough for every light that leaves a trace, and far from underflow.
const MIN_SCALE_LOG2: i32 = -128;

/// Smallest `scale_log2` at which no pixel can overflow; the floor leaves up to `glow_lx_s`.
pub(super) fn finest_scale_log2(stamps: &[Stamp], glow_lx_s: f64, size_px: [u32; 2]) -> i32 {
    let columns = size_px[0].div_ceil(TILE_PX) as usize;
    let rows = size_px[1].div_ceil(TILE_PX) as usize;
    let mut tiles = vec![[0.0_f64; 3]; columns * rows];
    let mut brightest_stamp = 0.0_f64;
    for stamp in stamps {
        let peak = stamp.amplitude_lx_s();
        brightest_stamp = peak.into_iter().fold(brightest_stamp, f64::max);
        let [x, y, width, height] = stamp.area();
        let tile = |px: u32| (px / TILE_PX) as usize;
        for row in tile(y)..=tile(y + height - 1) {
            let first = row * columns;
            for sum in &mut tiles[first + tile(x)..=first + tile(x + width - 1)] {
                for (sum, peak) in sum.iter_mut().zip(peak) {
                    *sum += peak;
                }
            }
        }
    }
    let brightest_tile = tiles.iter().flatten().copied().fold(0.0, f64::max);
    // x < 2^exponent
    let exponent = |x: f64| if x > 0.0 { libm::frexp(x).1 } else { MIN_SCALE_LOG2 };
    (exponent(brightest_tile) - TILE_BITS)
        .max(exponent(brightest_stamp) - AMPLITUDE_BITS)
        .max(exponent(glow_lx_s) - GLOW_BITS)
        .max(MIN_SCALE_LOG2)
}
