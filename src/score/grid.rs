//! Pixels in the plane of the word, and the placement of the word on them.

use tiny_skia::Transform;

use crate::letters::Strokes;

/// A grid of square pixels in the plane of the word.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Upper left corner: x and height, meters.
    pub(super) left_m: f64,
    pub(super) top_m: f64,
    /// Edge of a pixel.
    pub(super) pitch_m: f64,
    pub(super) width: usize,
    pub(super) height: usize,
}

/// Placement of a word: a point of the intended word is found at
/// `center + shift + scale · R(rotation) (point − center)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    pub(super) center_m: [f64; 2],
    pub(super) shift_m: [f64; 2],
    pub(super) scale: f64,
    /// Counterclockwise.
    pub(super) rotation_rad: f64,
}

impl Placed {
    /// The word in its intended place.
    pub(super) fn home(strokes: &Strokes) -> Self {
        let [left, bottom, right, top] = strokes.bounds_m();
        let center_m = [0.5 * (left + right), 0.5 * (bottom + top)];
        Self { center_m, shift_m: [0.0, 0.0], scale: 1.0, rotation_rad: 0.0 }
    }

    /// First column of `scale · R(rotation)`; the second is `[−y, x]`.
    fn column(&self) -> [f64; 2] {
        let (sin, cos) = libm::sincos(self.rotation_rad);
        [self.scale * cos, self.scale * sin]
    }

    /// Where a point of the intended word is found.
    pub(super) fn apply(&self, point_m: [f64; 2]) -> [f64; 2] {
        let [a, b] = self.column();
        let [x, y] = [0, 1].map(|axis| point_m[axis] - self.center_m[axis]);
        let turned = [a * x - b * y, b * x + a * y];
        [0, 1].map(|axis| self.center_m[axis] + self.shift_m[axis] + turned[axis])
    }
}

impl Grid {
    /// Brings the plane of the word (meters, y up) onto the grid's page (pixels, y down), with the
    /// word as placed.
    pub(super) fn page_from_plane(&self, placed: &Placed) -> Transform {
        let [a, b] = placed.column().map(|part| part / self.pitch_m);
        let [x, y] = placed.apply([0.0, 0.0]);
        #[expect(clippy::cast_possible_truncation, reason = "a raster needs no more")]
        let [a, b, x, y] =
            [a, b, (x - self.left_m) / self.pitch_m, (self.top_m - y) / self.pitch_m]
                .map(|value| value as f32);
        Transform::from_row(a, -b, -b, -a, x, y)
    }
}
