//! The plane of the word: grids of square pixels on it, and what the photo shows there.

use super::grid::{Grid, Placed};
use super::light::{Frame, Light, Rgb};
use super::view::View;
use super::{PX_PER_H, align, cap_height_m};
use crate::letters::Strokes;

impl Grid {
    /// A grid with room for every place where the word is looked for, and for the windows there.
    pub(super) fn around(strokes: &Strokes, home: &Placed) -> Self {
        let [left, bottom, right, top] = strokes.bounds_m();
        let pitch_m = cap_height_m(strokes) / f64::from(PX_PER_H);
        // Shift, and half a cap height for the window and the blur.
        let margin_m = (align::SEARCH_H + 0.5) * cap_height_m(strokes);
        let side = |length_m: f64| {
            let pixels = (length_m * align::SEARCH_SCALE + 2.0 * margin_m) / pitch_m;
            #[expect(clippy::cast_possible_truncation, reason = "pixels of a grid")]
            #[expect(clippy::cast_sign_loss, reason = "lengths are positive")]
            let pixels = pixels.ceil() as usize;
            // Halved twice by the alignment.
            pixels.next_multiple_of(4)
        };
        let (width, height) = (side(right - left), side(top - bottom));
        let [left_m, top_m] = [
            home.center_m[0] - 0.5 * width as f64 * pitch_m,
            home.center_m[1] + 0.5 * height as f64 * pitch_m,
        ];
        Self { left_m, top_m, pitch_m, width, height }
    }

    /// What the photo shows at each pixel of the grid, the grid moved along with the word.
    pub(super) fn resample(&self, light: &Light, view: &View, placed: &Placed) -> Vec<Rgb> {
        self.resample_of(light, view, placed, |light| light)
    }

    /// The same of something that each of the photo's pixels has.
    pub(super) fn resample_of(
        &self,
        light: &Light,
        view: &View,
        placed: &Placed,
        of: impl Fn(Rgb) -> Rgb,
    ) -> Vec<Rgb> {
        let row = |y: usize| -> Vec<_> {
            (0..=self.width).map(|x| self.image_point(view, placed, [x, y])).collect()
        };
        let mut values = vec![[0.0; 3]; self.width * self.height];
        let mut upper = row(0);
        for (y, values) in values.chunks_exact_mut(self.width).enumerate() {
            let lower = row(y + 1);
            for (x, value) in values.iter_mut().enumerate() {
                let corners = (upper[x], upper[x + 1], lower[x], lower[x + 1]);
                // Behind the camera there is nothing to see.
                if let (Some(a), Some(b), Some(c), Some(d)) = corners {
                    *value = light.mean_of(&Frame::around([a, b, c, d]), &of);
                }
            }
            upper = lower;
        }
        values
    }

    /// The rectangle of the photo that shows the grid; `None` where a corner is behind the camera.
    pub(super) fn frame(&self, view: &View, placed: &Placed) -> Option<Frame> {
        let corner = |x: usize, y: usize| self.image_point(view, placed, [x, y]);
        let (right, bottom) = (self.width, self.height);
        Some(Frame::around([
            corner(0, 0)?,
            corner(right, 0)?,
            corner(0, bottom)?,
            corner(right, bottom)?,
        ]))
    }

    /// Edge of the middle pixel in the photo; `None` behind the camera.
    pub(super) fn pixel_px(&self, view: &View, placed: &Placed) -> Option<f64> {
        let middle = [self.width / 2, self.height / 2];
        let [x, y] = self.image_point(view, placed, middle)?;
        let [right, below] = self.image_point(view, placed, [middle[0] + 1, middle[1] + 1])?;
        Some(((right - x).abs() * (below - y).abs()).sqrt())
    }

    /// Where the photo shows the upper left corner of pixel `x, y`.
    fn image_point(&self, view: &View, placed: &Placed, [x, y]: [usize; 2]) -> Option<[f64; 2]> {
        let [x, y] = [self.left_m + x as f64 * self.pitch_m, self.top_m - y as f64 * self.pitch_m];
        view.image_from_plane(placed.apply([x, y]))
    }
}
