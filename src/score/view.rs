//! Views of the word's plane: through a known camera, or from four corners in the photo.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use noctograph_core::camera::Camera;
use noctograph_core::error::{Error, Result};
use noctograph_core::geometry::distance;
use noctograph_core::photo::{Photo, PhotoData};

/// Projection of the word's plane (x and height in meters) onto the photo.
#[derive(Clone, Debug)]
pub enum View {
    /// Projection by a camera with known position and lens.
    Camera(Box<Camera>),
    /// Projection by a homography, without lens distortion.
    Plane(Homography),
}

/// Perspective projection of the word's plane onto a photo.
#[derive(Clone, Debug, PartialEq)]
pub struct Homography {
    image_from_plane: Matrix3<f64>,
    /// Width of the photo.
    pub width_px: u32,
    /// Height of the photo.
    pub height_px: u32,
}

impl From<&Camera> for View {
    fn from(camera: &Camera) -> Self {
        Self::Camera(Box::new(camera.clone()))
    }
}

impl View {
    /// Projects a point of the plane. Returns its position in pixels from the upper left corner, or
    /// `None` if it is not visible.
    pub fn image_from_plane(&self, [x_m, height_m]: [f64; 2]) -> Option<[f64; 2]> {
        let [x, y] = match self {
            Self::Camera(camera) => {
                let point = camera.image_from_world(Vector3::new(x_m, 0.0, height_m))?;
                [point.x_px, point.y_px]
            }
            Self::Plane(plane) => {
                let point = plane.image_from_plane * Vector3::new(x_m, height_m, 1.0);
                if point.z <= 0.0 {
                    return None;
                }
                [point.x / point.z, point.y / point.z]
            }
        };
        (x.is_finite() && y.is_finite()).then_some([x, y])
    }

    /// Renders a part of the plane (`[left, bottom, right, top]`) as seen square on, using the
    /// nearest pixels. Its sides have `px_per_m` pixels per m, up to a limit.
    pub fn square_on(&self, photo: &Photo, bounds_m: [f64; 4], px_per_m: f64) -> Photo {
        let [left, bottom, right, top] = bounds_m;
        #[expect(clippy::cast_possible_truncation, reason = "at most some thousand")]
        let [width_px, height_px] = [right - left, top - bottom]
            .map(|length_m| (length_m * px_per_m).clamp(1.0, MAX_SQUARE_ON_PX) as u32);
        let mut rgb8 = Vec::with_capacity(3 * width_px as usize * height_px as usize);
        for y in 0..height_px {
            for x in 0..width_px {
                let point = [
                    left + (right - left) * (f64::from(x) + 0.5) / f64::from(width_px),
                    top - (top - bottom) * (f64::from(y) + 0.5) / f64::from(height_px),
                ];
                rgb8.extend(
                    self.image_from_plane(point).map_or([0; 3], |point_px| pixel(photo, point_px)),
                );
            }
        }
        Photo::made(PhotoData { width_px, height_px, rgb8, scene_toml: None })
    }

    /// Renders a line of writing as seen square on, with a margin for letters that leave its box.
    /// `corners_px` are the box's corners in the photo, clockwise from the upper left.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`Homography::from_corners`].
    pub fn rectified_by_corners(photo: &Photo, corners_px: [[f64; 2]; 4]) -> Result<Photo> {
        let [top, right, bottom, left] =
            [0, 1, 2, 3].map(|n| distance(corners_px[n], corners_px[(n + 1) % 4]));
        let [width, height] = [top.max(bottom), left.max(right)];
        let size_px = [photo.width_px, photo.height_px];
        let plane = Homography::from_corners([0.0, 0.0, width, height], corners_px, size_px)?;
        let margin = CORNERS_MARGIN * height;
        let bounds = [-margin, -margin, width + margin, height + margin];
        Ok(Self::Plane(plane).square_on(photo, bounds, 1.0))
    }

    /// Renders the word's plane as seen square on, from a photo that `camera` took.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] unless the camera sees the plane in every part of its picture.
    pub fn rectified_by_camera(photo: &Photo, camera: &Camera) -> Result<Photo> {
        let bounds_m = camera.plane_bounds_m().ok_or_else(|| {
            let wanted = "a camera whose whole picture shows the plane of the word";
            let hint = "name the scene of the photo, or the corners of the word in the photo";
            Error::input("camera", "a camera that does not see the word", wanted, hint)
                .coded("word-unseen")
        })?;
        let px_per_m = f64::from(photo.width_px) / (bounds_m[2] - bounds_m[0]);
        Ok(Self::from(camera).square_on(photo, bounds_m, px_per_m))
    }

    /// Returns the width and the height of the photo.
    pub fn size_px(&self) -> [u32; 2] {
        match self {
            Self::Camera(camera) => [camera.width_px, camera.height_px],
            Self::Plane(plane) => [plane.width_px, plane.height_px],
        }
    }
}

/// Margin around a box given by its corners, in units of the box's height.
const CORNERS_MARGIN: f64 = 0.5;

/// Maximum side of a picture seen square on, in pixels.
const MAX_SQUARE_ON_PX: f64 = 4096.0;

/// Returns the color of a photo at a point in pixels, or black outside the photo.
fn pixel(photo: &Photo, [x, y]: [f64; 2]) -> [u8; 3] {
    let inside =
        x >= 0.0 && y >= 0.0 && x < f64::from(photo.width_px) && y < f64::from(photo.height_px);
    #[expect(clippy::cast_possible_truncation, reason = "a pixel of the photo")]
    let index = 3 * (y as usize * photo.width_px as usize + x as usize);
    if inside { [photo.rgb8[index], photo.rgb8[index + 1], photo.rgb8[index + 2]] } else { [0; 3] }
}

impl Homography {
    /// Returns the view that maps a box of the plane (`[left, bottom, right, top]`) onto four
    /// corners in the photo: upper left, upper right, lower right and lower left.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] unless the corners form a convex figure in clockwise order.
    pub fn from_corners(
        [left, bottom, right, top]: [f64; 4],
        corners_px: [[f64; 2]; 4],
        [width_px, height_px]: [u32; 2],
    ) -> Result<Self> {
        // A corner whose cross product is below 1 px² counts as straight.
        let is_convex = (0..4).all(|first| {
            let [a, b, c] = [0, 1, 2].map(|step| corners_px[(first + step) % 4]);
            (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) > 1.0
        });
        // Direct linear transform (Hartley and Zisserman 2004) with h₃₃ = 1. Each corner gives two
        // equations: u (h₃₁ x + h₃₂ y + 1) = h₁₁ x + h₁₂ y + h₁₃, and the same for v.
        let plane = [[left, top], [right, top], [right, bottom], [left, bottom]];
        let mut rows = SMatrix::<f64, 8, 8>::zeros();
        let mut values = SVector::<f64, 8>::zeros();
        for (corner, ([x, y], [u, v])) in plane.into_iter().zip(corners_px).enumerate() {
            rows.set_row(2 * corner, &[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y].into());
            rows.set_row(2 * corner + 1, &[0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y].into());
            (values[2 * corner], values[2 * corner + 1]) = (u, v);
        }
        let h = rows.lu().solve(&values).filter(|_| is_convex).ok_or_else(|| {
            Error::input(
                "corners",
                format!("{corners_px:?}"),
                "the word's upper left, upper right, lower right and lower left corner, in pixels \
                 from the photo's upper left, which form a convex figure in this order",
                "pass the corners of the word's box in the photo, clockwise from the upper left",
            )
        })?;
        let mut image_from_plane =
            Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0);
        // The sign is chosen so that the third coordinate is positive in front of the camera.
        let middle = Vector3::new(0.5 * (left + right), 0.5 * (bottom + top), 1.0);
        if (image_from_plane * middle).z < 0.0 {
            image_from_plane = -image_from_plane;
        }
        Ok(Self { image_from_plane, width_px, height_px })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::camera::{CameraOptions, FixedPose, Framing};

    #[test]
    fn four_corners_of_a_camera_s_picture_are_that_camera() {
        let bounds = [-0.6, 0.5, 0.9, 1.0];
        let options = CameraOptions {
            framing: Framing::Fixed(FixedPose {
                position_m: [-1.5, -3.0, 1.6],
                ..FixedPose::default()
            }),
            ..CameraOptions::default()
        };
        let camera = View::from(&options.camera(bounds, 0.0).unwrap());
        let [left, bottom, right, top] = bounds;
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom]]
            .map(|point| camera.image_from_plane(point).unwrap());
        let plane = View::Plane(Homography::from_corners(bounds, corners, [1920, 1080]).unwrap());
        for point in [[0.1, 0.7], [-0.9, 0.2], [1.2, 1.3]] {
            let [a, b] = [&camera, &plane].map(|view| view.image_from_plane(point).unwrap());
            assert!((a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-6, "{a:?} and {b:?}");
        }
        let [a, b, c, d] = corners;
        for crossed in [[a, c, b, d], [a, b, a, b], [b, a, d, c], [[f64::NAN; 2]; 4]] {
            assert!(Homography::from_corners(bounds, crossed, [1920, 1080]).is_err());
        }
    }
}
