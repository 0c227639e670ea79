//! Distances from the edges of the picture to points outside it.

use nalgebra::Vector3;

use super::{Camera, ImagePoint};
use crate::units::CM_PER_M;

impl Camera {
    /// Describes how far points lie outside the picture, measured at the depth of each point, such
    /// as `12 cm on the left, 3 cm at the bottom`. Distances are rounded to whole centimeters, and
    /// to at least one. Returns `None` if all points are inside.
    pub fn outside(&self, points_m: impl IntoIterator<Item = Vector3<f64>>) -> Option<String> {
        let (width, height) = (f64::from(self.width_px), f64::from(self.height_px));
        // The maximum distances beyond the edges are in the order left, right, top, bottom.
        let (mut sides_m, mut is_behind) = ([0.0_f64; 4], false);
        for point_m in points_m {
            let Some(ImagePoint { x_px, y_px, depth_m }) = self.image_from_world(point_m) else {
                is_behind = true;
                continue;
            };
            let m_per_px = depth_m / self.focal_length_px();
            let beyond_px = [-x_px, x_px - width, -y_px, y_px - height];
            sides_m = [0, 1, 2, 3].map(|side| sides_m[side].max(beyond_px[side] * m_per_px));
        }
        let names = ["on the left", "on the right", "at the top", "at the bottom"];
        let beyond = sides_m.into_iter().zip(names).filter(|(m, _)| *m > 0.0);
        let mut parts: Vec<String> =
            beyond.map(|(m, side)| format!("{:.0} cm {side}", (m * CM_PER_M).max(1.0))).collect();
        if is_behind {
            parts.push("part of it behind the camera".to_owned());
        }
        (!parts.is_empty()).then(|| parts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{CameraOptions, Framing, WordFraming};

    #[test]
    fn sides_and_centimeters_are_named() {
        let framing = Framing::Word(WordFraming { fill_frac: 1.0, ..Default::default() });
        let camera = CameraOptions { framing, ..CameraOptions::default() };
        let camera = camera.camera([-0.6, 0.5, 0.9, 1.0], 1.0).unwrap();
        let point = |x: f64, z: f64| Vector3::new(x, 0.0, z);
        assert_eq!(camera.outside([point(-0.59, 0.5), point(0.89, 1.0)]), None);
        let words = camera.outside([point(-0.72, 0.75), point(0.0, 2.0)]).unwrap();
        assert_eq!(words, "12 cm on the left, 83 cm at the top");
        let words = camera.outside([Vector3::new(0.0, -90.0, 0.0)]).unwrap();
        assert!(words.contains("behind"), "{words}");
    }
}
