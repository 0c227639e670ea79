//! The light of a letter, thinned to lines one pixel wide (Zhang and Suen 1984).

use kurbo::Point;

use super::PX_PER_H;
use super::plane::xy;
use super::raster::{Raster, whole};
use noctograph_core::geometry;

/// Minimum light of a line, as a fraction of full light.
const LIT: f32 = 0.4;

/// Maximum distance from a moved stroke to light that fills a gap in it: 0.05 H.
pub(super) const CLOSE_PX: f64 = 0.05 * PX_PER_H as f64;

/// Maximum distance, in pixels, between a line and light that contributes to its thickness.
const NEAR_PX: f64 = 6.0;

/// The light of one letter as lines.
pub(super) struct LightLines {
    pub(super) width: usize,
    pub(super) lit: Vec<bool>,
    pub(super) thin: Vec<bool>,
}

impl LightLines {
    /// Thins the lit pixels of a picture to form lines.
    pub(super) fn new(picture: &Raster) -> Self {
        let lit: Vec<bool> = picture.values.iter().map(|value| *value > LIT).collect();
        let thin = thinned(lit.clone(), picture.width);
        Self { width: picture.width, lit, thin }
    }

    /// Returns the mean width of the lines, in pixels.
    pub(super) fn thickness(&self) -> f64 {
        let [lit, thin] =
            [&self.lit, &self.thin].map(|mask| mask.iter().filter(|lit| **lit).count());
        lit as f64 / thin.max(1) as f64
    }

    /// True if a lit pixel is within `reach_px` of a point.
    pub(super) fn has_light_near(&self, point: Point, reach_px: f64) -> bool {
        let height = self.lit.len() / self.width;
        let reach = reach_px.ceil();
        let [mut rows, columns] =
            [(point.y, height), (point.x, self.width)].map(|(middle, end)| {
                whole((middle - reach).max(0.0))..end.min(whole(middle + reach + 1.0))
            });
        rows.any(|row| {
            columns.clone().any(|column| {
                let index = row * self.width + column;
                self.lit[index] && distance(self.middle(index), point) <= reach_px
            })
        })
    }

    /// True if a lit pixel is within [`CLOSE_PX`] of a point.
    pub(super) fn is_drawn(&self, point: Point) -> bool {
        self.has_light_near(point, CLOSE_PX)
    }

    /// Returns the number of lit pixels near any of the points.
    pub(super) fn lit_near(&self, points: &[Point]) -> usize {
        let lit = (0..self.lit.len()).filter(|n| self.lit[*n]).map(|n| self.middle(n));
        lit.filter(|lit| points.iter().any(|point| distance(*point, *lit) < NEAR_PX)).count()
    }

    /// Returns the center of the pixel `index`, in pixels from the upper left corner.
    pub(super) fn middle(&self, index: usize) -> Point {
        Point::new((index % self.width) as f64 + 0.5, (index / self.width) as f64 + 0.5)
    }

    /// Draws only the lines, three pixels wide, without their glow and noise.
    pub(super) fn redrawn(&self, picture: &Raster) -> Raster {
        let mut clean = Raster::dark(picture.width, picture.height);
        for (index, _) in self.thin.iter().enumerate().filter(|(_, line)| **line) {
            clean.values[index] = 1.0;
            // Pixels beside a line get less light, and diagonal neighbors the least.
            for beside in around(index, self.width, self.thin.len()) {
                let is_above_or_below = beside % self.width == index % self.width;
                let is_left_or_right = beside / self.width == index / self.width;
                let light: f32 = if is_above_or_below || is_left_or_right { 0.6 } else { 0.3 };
                clean.values[beside] = clean.values[beside].max(light);
            }
        }
        clean
    }
}

/// Returns the distance between two points in their unit.
pub(super) fn distance(a: Point, b: Point) -> f64 {
    geometry::distance(xy(a), xy(b))
}

/// Returns the indices of the up to eight neighbors of a pixel.
pub(super) fn around(index: usize, width: usize, n_pixels: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (index % width, index / width);
    let rows = y.saturating_sub(1)..(y + 2).min(n_pixels / width);
    rows.flat_map(move |row| {
        (x.saturating_sub(1)..(x + 2).min(width)).map(move |column| row * width + column)
    })
    .filter(move |beside| *beside != index)
}

/// Thins lit areas to lines one pixel wide (Zhang and Suen 1984).
fn thinned(mut ink: Vec<bool>, width: usize) -> Vec<bool> {
    let height = ink.len() / width;
    loop {
        let mut changed = false;
        // The first pass of an iteration removes edge pixels at the lower right, the second at the
        // upper left. Each pass judges all pixels before it removes any, so lines stay centered.
        for pass in 0..2 {
            let inner = (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| y * width + x));
            let gone: Vec<usize> = inner
                .filter(|pixel| ink[*pixel] && is_removable(&ink, width, *pixel, pass))
                .collect();
            changed |= !gone.is_empty();
            gone.into_iter().for_each(|pixel| ink[pixel] = false);
        }
        if !changed {
            return ink;
        }
    }
}

/// True if a pixel is on an edge that the pass removes, and the lines stay connected without it.
/// Pass 0 removes at the lower right, and pass 1 at the upper left.
fn is_removable(ink: &[bool], width: usize, pixel: usize, pass: usize) -> bool {
    // The ring consists of the eight neighbors, clockwise from the one above the pixel.
    let (up, down) = (pixel - width, pixel + width);
    let neighbors = [up, up + 1, pixel + 1, down + 1, down, down - 1, pixel - 1, up - 1];
    let ring = neighbors.map(|neighbor| ink[neighbor]);
    let n_ink = ring.iter().filter(|ink| **ink).count();
    // Removal keeps lines connected if the ring has a single step from dark to ink.
    let n_starts = (0..8).filter(|i| !ring[*i] && ring[(i + 1) % 8]).count();
    let [up, _, right, _, down, _, left, _] = ring;
    let is_at_edge = match pass {
        0 => !(right && down && (up || left)),
        _ => !(up && left && (right || down)),
    };
    (2..=6).contains(&n_ink) && n_starts == 1 && is_at_edge
}

#[cfg(test)]
mod tests {
    use super::*;
    use kurbo::Line;

    /// Returns a bar 5 pixels high between columns 10 and 50, with a dot beside it.
    fn bar() -> Raster {
        let mut page = Raster::dark(64, 32);
        for y in 8..13 {
            page.values[y * 64 + 10..y * 64 + 50].fill(1.0);
        }
        for y in 22..25 {
            page.values[y * 64 + 20..y * 64 + 31].fill(1.0);
        }
        page
    }

    #[test]
    fn a_bar_is_thinned_to_its_middle_line() {
        let trace = LightLines::new(&bar());
        let line: Vec<usize> = (0..64 * 20).filter(|pixel| trace.thin[*pixel]).collect();
        assert!(line.iter().all(|pixel| pixel / 64 == 10), "{line:?}");
        assert!((34..=40).contains(&line.len()), "{} of 40 columns", line.len());
    }

    #[test]
    fn what_is_missing_and_what_is_too_much_have_their_lengths() {
        let trace = LightLines::new(&bar());
        let run = vec![Line::new((10.5, 10.5), (60.5, 10.5))];
        let (gaps, recall) = trace.gaps(&trace.bend(std::slice::from_ref(&run)), |_| false);
        assert_eq!(gaps.len(), 1);
        let [from, to] = gaps[0].along_px;
        assert!((from - 40.0).abs() <= 1.0 && (to - 50.0).abs() <= 1.0, "{from} to {to}");
        assert!((recall - 0.85).abs() < 0.03, "{recall}");
        let (extra, precision) = trace.extra_lines(&run, &[]);
        assert_eq!(extra.len(), 1);
        assert!((8..=11).contains(&extra[0].points.len()), "{extra:?}");
        assert!((precision - 0.8).abs() < 0.05, "{precision}");
        let neighbor = Line::new((18.0, 23.5), (32.0, 23.5));
        assert!(trace.extra_lines(&run, &[neighbor]).0.is_empty(), "a neighbor's");
    }
}
