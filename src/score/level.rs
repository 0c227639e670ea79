//! The level of light that counts as fully lit, found without knowing the exposure.

use super::light::{code_step, median_size};
use super::raster::Raster;

/// How far above the sky light must be, in standard deviations of the sky.
const LIGHT_SIGMAS: f32 = 5.0;

/// Share of the intended ink's area that is brighter than the level that counts as fully lit. The
/// 99.5th percentile of a word's frame is about this, but shifts with the frame.
/// Too small a share lets one glaring spot darken the word.
const GLARE_SHARE: f64 = 0.1;

/// Share of the intended ink's area that must stand out from the sky for a word to be there. Hot
/// pixels are fewer.
const MIN_INK_SHARE: f64 = 0.05;

/// The level that counts as fully lit, for a word whose ink should cover `ink_px`, and that level
/// by the least that stands out; `None` where next to nothing stands out from the sky.
pub(super) fn full_light(seen: &Raster, sky: f32, ink_px: f64) -> Option<(f32, f32)> {
    // A Gaussian's standard deviation is 1.4826 median deviations; an 8-bit code is off by its step
    // over the root of 12.
    let noise = 1.4826 * median_size(&seen.values);
    let sigma = noise.max(code_step(sky) / 12.0_f32.sqrt());
    let lit = LIGHT_SIGMAS * sigma;

    let mut values = seen.values.clone();
    let mut level_at = |share: f64| {
        #[expect(clippy::cast_possible_truncation, reason = "pixels of a grid")]
        let rank = ((share * ink_px) as usize).min(values.len() - 1);
        *values.select_nth_unstable_by(rank, |a, b| b.total_cmp(a)).1
    };
    (level_at(MIN_INK_SHARE) > lit).then(|| {
        let full = level_at(GLARE_SHARE).max(lit);
        (full, full / lit)
    })
}
