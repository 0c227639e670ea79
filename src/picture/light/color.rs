//! Color: chromaticities of LEDs become linear sRGB with luminance 1, and back.

use nalgebra::{Matrix3, Vector3};

use noctograph_core::srgb::{RGB_FROM_XYZ, linear_from_encoded, luminance, rgb_from_xyz, xyz};

/// Linear sRGB with luminance 1 of a mixture given by its XYZ; what lies outside sRGB is clipped
/// at its faces.
///
/// Narrow-band LEDs lie outside. Clipping keeps their luminance and their hue roughly, and loses
/// saturation: a film holds no negative light.
pub(super) fn rgb(xyz: [f64; 3]) -> [f64; 3] {
    let rgb = rgb_from_xyz(xyz).map(|share| share.max(0.0));
    rgb.map(|share| share / luminance(rgb))
}

/// Luminance of each die of a row for a color of the screen (sRGB) whose strongest channel is full,
/// relative to that of white; what the dies cannot mix is clipped. Black is white.
pub(super) fn mixture(dies: [[f64; 2]; 3], srgb: [u8; 3]) -> Vector3<f64> {
    let rgb_from_xyz = Matrix3::from_fn(|row, column| RGB_FROM_XYZ[row][column]);
    let xyz_from_dies = Matrix3::from_columns(&dies.map(|die| Vector3::from(xyz(die))));
    let dies_from_rgb = (rgb_from_xyz * xyz_from_dies).try_inverse();
    let linear = Vector3::from(srgb.map(|level| linear_from_encoded(f64::from(level) / 255.0)));
    let full = match linear.max() {
        most if most > 0.0 => linear / most,
        _ => Vector3::repeat(1.0),
    };
    dies_from_rgb.map_or(full, |dies| dies * full).map(|luminance| luminance.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_have_luminance_one_and_no_negative_light() {
        for chromaticity in [[0.7, 0.29], [0.15, 0.75], [0.13, 0.05], [0.3127, 0.329], [0.4, 0.4]] {
            let [r, g, b] = rgb(xyz(chromaticity));
            assert!(r >= 0.0 && g >= 0.0 && b >= 0.0, "{chromaticity:?}: {r} {g} {b}");
            let luminance = luminance([r, g, b]);
            assert!((luminance - 1.0).abs() < 1e-12, "{chromaticity:?}: luminance {luminance}");
        }
    }

    #[test]
    fn a_mixture_of_dies_is_the_color_that_was_asked_for() {
        let dies = [[0.64, 0.33], [0.3, 0.6], [0.15, 0.06]];
        let found = mixture(dies, [255, 165, 0]);
        let wanted = Vector3::new(0.2126, 0.7152 * linear_from_encoded(165.0 / 255.0), 0.0);
        assert!((found - wanted).norm() < 1e-3, "the primaries of sRGB themselves: {found}");
        assert!((mixture(dies, [255; 3]).sum() - 1.0).abs() < 1e-3, "white");
    }

    #[test]
    fn daylight_is_white_and_a_blue_led_is_the_blue_primary() {
        for share in rgb(xyz([0.3127, 0.329])) {
            assert!((share - 1.0).abs() < 1e-3, "D65 is white: {share}");
        }
        let [r, g, b] = rgb(xyz([0.131, 0.05]));
        assert!(r == 0.0 && g < 0.02 && b > 13.7, "{r} {g} {b}");
    }
}
