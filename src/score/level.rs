//! The level of light that counts as fully lit, found without knowing the exposure.

use super::light::{code_step, median};
use super::raster::Raster;
use super::{PEN_PX, PX_PER_H, cap_height_m};
use crate::letters::Strokes;

/// How far above the sky light must be, in standard deviations of the sky (legibility.md 6.2).
const LIGHT_SIGMAS: f32 = 5.0;

/// Share of the intended ink's area that is brighter than the level that counts as fully lit. The
/// 99.5th percentile of a word's frame (legibility.md 6.1) is about this, but shifts with the frame.
/// Too small a share lets one glaring spot darken the word.
const GLARE_SHARE: f64 = 0.1;

/// The level that counts as fully lit; `None` where nothing stands out from the sky.
pub(super) fn full_light(seen: &Raster, sky: f32, strokes: &Strokes) -> Option<f32> {
    let mut deviations: Vec<f32> = seen.values.iter().map(|value| value.abs()).collect();
    // A Gaussian's standard deviation is 1.4826 median deviations; an 8-bit code is off by its step
    // over the root of 12.
    let noise = 1.4826 * median(&mut deviations);
    let sigma = noise.max(code_step(sky) / 12.0_f32.sqrt());
    let lit = LIGHT_SIGMAS * sigma;

    let lit_moves = strokes.glyphs.iter().flat_map(|glyph| &glyph.moves).filter(|step| step.lit);
    let length_m: f64 = lit_moves
        .map(|step| libm::hypot(step.to_m[0] - step.from_m[0], step.to_m[1] - step.from_m[1]))
        .sum();
    let ink_px = length_m / cap_height_m(strokes) * f64::from(PX_PER_H) * f64::from(PEN_PX);
    #[expect(clippy::cast_possible_truncation, reason = "pixels of a grid")]
    #[expect(clippy::cast_sign_loss, reason = "areas are positive")]
    let rank = ((GLARE_SHARE * ink_px) as usize).min(seen.values.len() - 1);
    let mut values = seen.values.clone();
    let level = *values.select_nth_unstable_by(rank, |a, b| b.total_cmp(a)).1;
    let brightest = seen.values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    (brightest > lit).then_some(level.max(lit))
}
