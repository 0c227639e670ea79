//! A sheet of paper in a photograph, rectified by its four corners.

use image::imageops::interpolate_bilinear;
use image::{Rgb, RgbImage};

use crate::vector::{cross, minus};
use noctograph_core::geometry::distance;

/// Four corners in pixels of a picture, clockwise from the upper left.
pub(super) type Corners = [[f64; 2]; 4];

/// Width of the sheet's border that gets the color next to it, relative to the longer side. Corners
/// that are set by hand may include a sliver of the desk.
const SLIVER: f64 = 0.008;

/// True if four corners follow each other clockwise around a convex quadrilateral, and each turn
/// spans an area of more than one square pixel.
pub(super) fn is_convex(corners: &Corners) -> bool {
    (0..4).all(|k| {
        let [a, b, c] = [0, 1, 2].map(|step| corners[(k + step) % 4]);
        cross(minus(b, a), minus(c, b)) > 1.0
    })
}

/// Returns the rectified picture of a sheet. Each side is as long as the longer of the two opposite
/// sides in the picture, so the aspect ratio is approximate.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a picture's side")]
pub(super) fn square_on(picture: &RgbImage, corners: &Corners) -> RgbImage {
    /// Smallest and largest side of the rectified picture.
    const SIDES_PX: [f64; 2] = [8.0, 4096.0];
    let sides = [0, 1, 2, 3].map(|k| distance(corners[k], corners[(k + 1) % 4]));
    let [width, height] = [sides[0].max(sides[2]), sides[1].max(sides[3])]
        .map(|side| side.round().clamp(SIDES_PX[0], SIDES_PX[1]) as u32);
    let in_picture = Map::of_sheet(corners, (width, height));
    let [right, bottom] = [picture.width() - 1, picture.height() - 1].map(f64::from);
    let sliver = SLIVER * f64::from(width.max(height));
    RgbImage::from_fn(width, height, |x, y| {
        let inner = |n: u32, side: u32| {
            (f64::from(n) + 0.5).clamp(sliver, (f64::from(side) - sliver).max(sliver))
        };
        let [x, y] = in_picture.apply([inner(x, width), inner(y, height)]);
        // Parts of the sheet outside the picture get the color of the picture's edge.
        let (x, y) = ((x - 0.5).clamp(0.0, right) as f32, (y - 0.5).clamp(0.0, bottom) as f32);
        interpolate_bilinear(picture, x, y).unwrap_or(Rgb([0; 3]))
    })
}

/// A projective map between two pictures, as a matrix for homogeneous coordinates.
pub(super) struct Map(pub(super) [[f64; 3]; 3]);

impl Map {
    /// Returns the map from the pixels of a rectified sheet to its corners in a picture. This is
    /// the map from the unit square to a quadrilateral (Heckbert, Fundamentals of Texture Mapping
    /// and Image Warping, 1989, section 2.2.3), scaled to the sheet.
    pub(super) fn of_sheet(corners: &Corners, (width, height): (u32, u32)) -> Self {
        let [[x0, y0], [x1, y1], [x2, y2], [x3, y3]] = *corners;
        let (dx1, dx2, sx) = (x1 - x2, x3 - x2, x0 - x1 + x2 - x3);
        let (dy1, dy2, sy) = (y1 - y2, y3 - y2, y0 - y1 + y2 - y3);
        let determinant = dx1 * dy2 - dx2 * dy1;
        let (g, h) = ((sx * dy2 - dx2 * sy) / determinant, (dx1 * sy - sx * dy1) / determinant);
        let of_unit = [
            [x1 - x0 + g * x1, x3 - x0 + h * x3, x0],
            [y1 - y0 + g * y1, y3 - y0 + h * y3, y0],
            [g, h, 1.0],
        ];
        Self(of_unit.map(|[u, v, w]| [u / f64::from(width), v / f64::from(height), w]))
    }

    /// Returns the image in the picture of a point of the rectified sheet, both in pixels.
    pub(super) fn apply(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [x, y, w] = self.0.map(|row| row[0] * u + row[1] * v + row[2]);
        [x / w, y / w]
    }
}
