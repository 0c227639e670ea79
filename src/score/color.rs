//! Separation of ink by color: only light in the color of the strokes is ink.
//!
//! A Crazyflie's status lights leave trails beside that of its headlights. People can tell these
//! blue and red trails from white strokes, but overexposed ones have the same luminance.

use std::cmp::Ordering;

use super::light::{Rgb, luminance};

/// Minimum strength of a channel relative to the ink's strongest channel for it to be compared.
const MIN_CHANNEL: f32 = 0.3;

/// Factor by which light of another color is multiplied before it is subtracted from ink. The light
/// of an overexposed blue lamp is three quarters white. A trail's white part varies by a tenth.
const FOREIGN: f32 = 3.0;

/// Returns the mean color of the `n_pixels` brightest pixels, in linear light.
pub(super) fn of_brightest(light: &[Rgb], n_pixels: usize) -> Rgb {
    // The half million pixels are sorted as integers, which take half the memory. Pixels of equal
    // luminance are sorted by color, so that the result does not depend on their order.
    let ranks = light.iter().map(|light| rank(luminance(*light)));
    let mut sorted: Vec<(i32, u32)> = ranks.zip(0..).collect();
    let n_pixels = n_pixels.clamp(1, sorted.len());
    sorted.select_nth_unstable_by(n_pixels - 1, |a, b| {
        let [one, other] = [a.1, b.1].map(|index| light[index as usize]);
        let mut channels = other.iter().zip(&one).map(|(b, a)| b.total_cmp(a));
        b.0.cmp(&a.0).then_with(|| channels.find(|order| order.is_ne()).unwrap_or(Ordering::Equal))
    });
    let mut sum = [0.0; 3];
    for (_, index) in &sorted[..n_pixels] {
        (0..3).for_each(|channel| sum[channel] += light[*index as usize][channel]);
    }
    sum.map(|sum| sum / n_pixels as f32)
}

/// Returns an integer that sorts like [`f32::total_cmp`], by the same bit operations. The sign bit
/// stays, and negative numbers are inverted.
fn rank(value: f32) -> i32 {
    let bits = value.to_bits().cast_signed();
    bits ^ ((bits >> 31).cast_unsigned() >> 1).cast_signed()
}

/// Returns a function that computes the luminance of the largest amount of `color` that a pixel's
/// light contains. The scarcest channel limits this amount.
fn luminance_of_color(color: Rgb) -> impl Fn(Rgb) -> f32 {
    let strongest = color.iter().copied().fold(0.0, f32::max);
    let scale = luminance(color);
    // A channel that the color barely uses sets no limit: its limit is 0 · light + ∞. This needs no
    // branch, so the compiler can vectorize a row of pixels.
    let terms = color.map(|c| {
        let is_limit = c >= MIN_CHANNEL * strongest && c > 0.0;
        if is_limit { (scale / c, 0.0) } else { (0.0, f32::INFINITY) }
    });
    move |light| {
        let limits = [0, 1, 2].map(|channel| light[channel] * terms[channel].0 + terms[channel].1);
        let scarcest = limits[0].min(limits[1]).min(limits[2]);
        if scarcest.is_finite() { scarcest.max(0.0) } else { 0.0 }
    }
}

/// Returns a function that computes a pixel's light of `color` minus light of other colors, so that
/// a status light overexposed nearly to white does not count as a stroke.
pub(super) fn pure(color: Rgb) -> impl Fn(Rgb) -> f32 {
    let luminance_of_color = luminance_of_color(color);
    move |light| {
        let ink = luminance_of_color(light);
        (ink - FOREIGN * (luminance(light) - ink).max(0.0)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_ink_is_not_in_blue_lines_nor_blue_ink_in_red_ones() {
        let [white, blue, red] = [[0.8, 0.8, 0.8], [0.1, 0.2, 1.0], [0.9, 0.05, 0.0]];
        let page = [white, white, blue, red, [0.0; 3]];
        let color = of_brightest(&page, 2);
        assert!(color.iter().all(|c| (c - 0.8).abs() < 1e-6), "{color:?}");
        let pure: Vec<f32> = page.iter().map(|light| pure(color)(*light)).collect();
        assert!((pure[0] - 0.8).abs() < 1e-6 && pure[2..] == [0.0; 3], "{pure:?}");
        let cyan_heart = super::pure(color)([0.7, 0.99, 0.99]);
        assert!(cyan_heart < 0.1, "{cyan_heart}");
    }
}
