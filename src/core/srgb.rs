//! The sRGB color space (IEC 61966-2-1), its transfer curve, primaries and luminance.

/// Luminance of the red, green and blue primaries.
pub const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Returns the luminance of linear light, in the same unit as its channels.
pub fn luminance([r, g, b]: [f64; 3]) -> f64 {
    LUMINANCE[0] * r + LUMINANCE[1] * g + LUMINANCE[2] * b
}

/// Returns the [`luminance`] of linear light in single precision, in the unit of the channels.
#[inline(always)]
pub fn luminance_f32([r, g, b]: [f32; 3]) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "weights up to 1")]
    const WEIGHTS: [f32; 3] = [LUMINANCE[0] as f32, LUMINANCE[1] as f32, LUMINANCE[2] as f32];
    WEIGHTS[0] * r + WEIGHTS[1] * g + WEIGHTS[2] * b
}

/// Matrix from XYZ to linear sRGB (IEC 61966-2-1).
pub const RGB_FROM_XYZ: [[f64; 3]; 3] = [
    [3.240_454_2, -1.537_138_5, -0.498_531_4],
    [-0.969_266_0, 1.876_010_8, 0.041_556_0],
    [0.055_643_4, -0.204_025_9, 1.057_225_2],
];

/// Returns the XYZ values (CIE 1931, 2°) of light with luminance 1 and chromaticity (x, y).
pub fn xyz([x, y]: [f64; 2]) -> [f64; 3] {
    [x / y, 1.0, (1.0 - x - y) / y]
}

/// Converts XYZ (CIE 1931, Y is luminance) to linear sRGB of the same luminance. Colors out of
/// gamut have negative components.
pub fn rgb_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    RGB_FROM_XYZ.map(|[x, y, z]| x * xyz[0] + y * xyz[1] + z * xyz[2])
}

/// Returns the linear light, 0 to 1, of an encoded value from 0 to 1 (IEC 61966-2-1).
pub fn linear_from_encoded(encoded: f64) -> f64 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) }
}

/// Returns the encoded value, 0 to 1, of linear light from 0 to 1 (IEC 61966-2-1).
pub fn encoded_from_linear(linear: f64) -> f64 {
    if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055
    }
}

/// Returns the linear light from 0 to 1 for each 8-bit level.
pub fn linear_from_level() -> [f32; 256] {
    #[expect(clippy::cast_possible_truncation, reason = "light of a photo is f32 from here on")]
    std::array::from_fn(|level| linear_from_encoded(level as f64 / 255.0) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_levels_have_their_light() {
        let light = linear_from_level();
        assert_eq!((light[0], light[255]), (0.0, 1.0));
        assert!((light[128] - 0.215_86).abs() < 1e-5, "mid level: {}", light[128]);
        assert!(light.windows(2).all(|pair| pair[0] < pair[1]), "it rises");
    }

    #[test]
    fn encoding_undoes_decoding() {
        for step in 0..=1000 {
            let encoded = f64::from(step) / 1000.0;
            let back = encoded_from_linear(linear_from_encoded(encoded));
            assert!((back - encoded).abs() < 1e-7, "{encoded} became {back}");
        }
    }
}
