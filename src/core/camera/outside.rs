//! Distances by which points lie outside the picture.

use nalgebra::Vector3;

use super::Camera;

/// Distances by which points lie outside the picture, in meters at their depth; 0 inside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outside {
    /// Beyond the left edge.
    pub left_m: f64,
    /// Beyond the right edge.
    pub right_m: f64,
    /// Above the top edge.
    pub top_m: f64,
    /// Below the bottom edge.
    pub bottom_m: f64,
    /// Whether a point is behind the camera or beside it.
    pub behind: bool,
}

impl Outside {
    /// Description such as `12 cm on the left, 3 cm at the bottom`; `None` where all is inside.
    #[must_use]
    pub fn in_words(&self) -> Option<String> {
        let sides = [
            (self.left_m, "on the left"),
            (self.right_m, "on the right"),
            (self.top_m, "at the top"),
            (self.bottom_m, "at the bottom"),
        ];
        let mut parts: Vec<String> = sides
            .iter()
            .filter(|(m, _)| *m > 0.0)
            .map(|(m, side)| format!("{:.0} cm {side}", (m * 100.0).max(1.0)))
            .collect();
        if self.behind {
            parts.push("part of it behind the camera".to_owned());
        }
        (!parts.is_empty()).then(|| parts.join(", "))
    }
}

impl Camera {
    /// Distances by which points of the world lie outside the picture.
    #[must_use]
    pub fn outside(&self, points_m: impl IntoIterator<Item = Vector3<f64>>) -> Outside {
        let mut outside = Outside::default();
        let (width, height) = (f64::from(self.width_px), f64::from(self.height_px));
        for point_m in points_m {
            let Some(image) = self.image_from_world(point_m) else {
                outside.behind = true;
                continue;
            };
            let m_per_px = image.depth_m / self.focal_length_px();
            let most = |side: &mut f64, px: f64| *side = side.max(px * m_per_px);
            most(&mut outside.left_m, -image.x_px);
            most(&mut outside.right_m, image.x_px - width);
            most(&mut outside.top_m, -image.y_px);
            most(&mut outside.bottom_m, image.y_px - height);
        }
        outside
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
        let at = |x: f64, z: f64| Vector3::new(x, 0.0, z);
        assert_eq!(camera.outside([at(-0.59, 0.5), at(0.89, 1.0)]).in_words(), None);
        let words = camera.outside([at(-0.72, 0.75), at(0.0, 2.0)]).in_words().unwrap();
        assert_eq!(words, "12 cm on the left, 83 cm at the top");
        let words = camera.outside([Vector3::new(0.0, -90.0, 0.0)]).in_words().unwrap();
        assert!(words.contains("behind"), "{words}");
    }
}
