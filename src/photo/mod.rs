//! Photo: film becomes a picture of 8 bits a channel, with all that is needed to make it again.
//!
//! Product in: [`Film`]. Product out: [`Photo`]. The sensor saturates at `78 / ISO` lx s per
//! channel (ISO 12232, saturation based) and the sRGB curve (IEC 61966-2-1) encodes what is below.
//! Not modelled yet: glare, noise, crosstalk, white balance and a film-like shoulder.

use crate::camera::Camera;
use crate::expose::Film;

pub mod png;
pub mod srgb;

/// A photograph. A rendered one and a real one meet here; the judge can't tell them apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Photo {
    /// Width.
    pub width_px: u32,
    /// Height.
    pub height_px: u32,
    /// Red, green, blue by pixel, row by row from the top left, sRGB-encoded.
    pub rgb8: Vec<u8>,
    /// The scene file that made it, where the picture carries one.
    pub scene_toml: Option<String>,
}

/// Develops a film.
#[must_use]
pub fn develop(film: &Film, camera: &Camera) -> Photo {
    let thresholds = thresholds(film, camera);
    let n = film.width_px as usize * film.height_px as usize;
    let mut rgb8 = vec![0; 3 * n];
    for (channel, plane) in film.counts.chunks_exact(n.max(1)).enumerate() {
        for (pixel, &count) in rgb8.chunks_exact_mut(3).zip(plane) {
            if count >= thresholds[0] {
                let reached = thresholds.partition_point(|&threshold| threshold <= count);
                pixel[channel] = u8::try_from(reached).expect("there are 255 thresholds");
            }
        }
    }
    Photo { width_px: film.width_px, height_px: film.height_px, rgb8, scene_toml: None }
}

/// The least count that gives each level 1…255: integers, so that developing compares and never
/// rounds.
fn thresholds(film: &Film, camera: &Camera) -> [u32; 255] {
    let counts_per_lx_s = libm::exp2(-f64::from(film.scale_log2));
    std::array::from_fn(|index| {
        #[expect(clippy::cast_precision_loss, reason = "levels are below 256")]
        let encoded = (index as f64 + 0.5) / 255.0;
        let exposure_lx_s = srgb::linear_from_encoded(encoded) * camera.saturation_lx_s();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let count = (exposure_lx_s * counts_per_lx_s).ceil() as u32;
        count.max(1)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::CameraOptions;

    fn film(counts: Vec<u32>, scale_log2: i32) -> Film {
        Film { width_px: 2, height_px: 1, counts, scale_log2 }
    }

    #[test]
    fn saturation_is_white_and_the_curve_is_srgb() {
        let camera = CameraOptions::default().camera([0.0, 0.5, 1.0, 1.0], 1.0).unwrap();
        // ISO 100 saturates at 0.78 lx s; 18 % of that is sRGB 118, half is 188.
        let scale_log2 = -20;
        #[expect(clippy::cast_possible_truncation, reason = "far below u32::MAX")]
        let count = |share: f64| (share * 0.78 * libm::exp2(20.0)) as u32;
        let counts = vec![count(1.0), 0, count(0.5), u32::MAX, count(0.18), count(0.000_15)];
        let photo = develop(&film(counts, scale_log2), &camera);
        assert_eq!(photo.rgb8, [255, 188, 118, 0, 255, 0], "r g b, r g b");
    }

    #[test]
    fn one_stop_of_iso_is_one_stop_of_light() {
        let camera = |iso| CameraOptions { iso, ..CameraOptions::default() };
        let camera = |iso| camera(iso).camera([0.0, 0.5, 1.0, 1.0], 1.0).unwrap();
        let counts: Vec<u32> = vec![1 << 18, 1 << 10, 1 << 15, 0, 1 << 19, 1 << 12];
        let doubled = counts.iter().map(|count| count * 2).collect();
        let at_100 = develop(&film(doubled, -20), &camera(100.0));
        let at_200 = develop(&film(counts, -20), &camera(200.0));
        assert_eq!(at_100, at_200);
    }
}
