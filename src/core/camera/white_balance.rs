//! White balance of the camera.

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::settings::Described;
use crate::srgb::{rgb_from_xyz, xyz};

/// White balance, such as gains of `[2.0, 1.0, 1.5]` or a temperature of `3200.0` in a scene file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum WhiteBalance {
    /// Gains for red, green and blue. Gains of 1 correspond to daylight (D65).
    Gains([f64; 3]),
    /// Color temperature in kelvin of the light that is rendered white.
    Kelvin(f64),
}

impl Default for WhiteBalance {
    fn default() -> Self {
        Self::Gains([1.0; 3])
    }
}

/// Range in kelvin in which the approximation of the Planckian locus is valid.
const KELVIN: [f64; 2] = [1700.0, 25_000.0];
/// Smallest and largest gain of a channel.
const GAINS: [f64; 2] = [0.01, 100.0];

impl Described for WhiteBalance {
    /// Checks that a color temperature is within `KELVIN`, and that gains are within `GAINS`.
    fn check(&self, place: &str, _: Option<[f64; 2]>) -> Result<()> {
        match self {
            Self::Kelvin(kelvin) => kelvin.check(place, Some(KELVIN)),
            Self::Gains(gains) => gains.check(place, Some(GAINS)),
        }
    }
}

impl WhiteBalance {
    /// Returns the gains for red, green and blue, relative to each other. For a color temperature
    /// in K, the gains are at least 1, so that saturated pixels stay white.
    pub fn gains(self) -> [f64; 3] {
        match self {
            Self::Gains(gains) => gains,
            Self::Kelvin(kelvin) => {
                let light = planckian_rgb(kelvin);
                let brightest = light.into_iter().fold(0.0, f64::max);
                // A channel without light counts as a hundredth of the brightest one.
                light.map(|channel| brightest / channel.max(GAINS[0] * brightest))
            }
        }
    }
}

/// Returns the linear sRGB color of a black body at a temperature in K by Kang et al. (2002),
/// within 0.0003 in x and y.
fn planckian_rgb(kelvin: f64) -> [f64; 3] {
    /// Evaluates a cubic polynomial with its coefficients in descending powers.
    fn cubic([a, b, c, d]: [f64; 4], t: f64) -> f64 {
        ((a * t + b) * t + c) * t + d
    }
    // The chromaticity x is a piecewise cubic in 1000 K / T, and y is a piecewise cubic in x.
    let t = 1000.0 / kelvin;
    let x = if kelvin <= 4000.0 {
        cubic([-0.266_123_9, -0.234_358_9, 0.877_695_6, 0.179_910], t)
    } else {
        cubic([-3.025_846_9, 2.107_037_9, 0.222_634_7, 0.240_390], t)
    };
    let y = match kelvin {
        ..=2222.0 => cubic([-1.106_381_4, -1.348_110_2, 2.185_558_32, -0.202_196_83], x),
        ..=4000.0 => cubic([-0.954_947_6, -1.374_185_93, 2.091_370_15, -0.167_488_67], x),
        _ => cubic([3.081_758_0, -5.873_386_7, 3.751_129_97, -0.370_014_83], x),
    };
    rgb_from_xyz(xyz([x, y]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn daylight_needs_no_gain_and_lamp_light_needs_blue() {
        fn near(actual: [f64; 3], wanted: [f64; 3]) {
            for (actual, wanted) in actual.into_iter().zip(wanted) {
                assert!((actual / wanted - 1.0).abs() < 0.02, "{actual} for {wanted}");
            }
        }
        // A black body at 6504 K is slightly more purple than D65.
        near(WhiteBalance::Kelvin(6504.0).gains(), [1.0, 1.055, 1.016]);
        // Illuminant A, a black body at 2856 K, has the chromaticity x 0.4476, y 0.4074. Its linear
        // sRGB, computed by hand, is 1.827, 0.810, 0.234.
        let a = WhiteBalance::Kelvin(2856.0).gains();
        assert_eq!(a[0], 1.0, "red is brightest");
        assert!((2.2..2.3).contains(&a[1]) && (7.0..8.5).contains(&a[2]), "{a:?}");
        assert_eq!(WhiteBalance::default().gains(), [1.0; 3]);
    }

    #[test]
    fn a_scene_has_gains_or_kelvin() {
        #[derive(Deserialize)]
        struct Scene {
            white_balance: WhiteBalance,
        }
        let parsed = |text: &str| toml::from_str::<Scene>(text).map(|scene| scene.white_balance);
        assert_eq!(parsed("white_balance = 3200.0"), Ok(WhiteBalance::Kelvin(3200.0)));
        assert_eq!(parsed("white_balance = 3200"), Ok(WhiteBalance::Kelvin(3200.0)));
        let gains = WhiteBalance::Gains([2.0, 1.0, 1.5]);
        assert_eq!(parsed("white_balance = [2, 1.0, 1.5]"), Ok(gains));
        assert!(WhiteBalance::Kelvin(100.0).check("white", None).is_err());
        assert!(WhiteBalance::Gains([1.0, f64::NAN, 1.0]).check("white", None).is_err());
    }
}
