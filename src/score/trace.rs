//! Lines of light: a letter's light thinned to lines a pixel wide (Zhang and Suen 1984).

use super::PX_PER_H;
use super::raster::{Raster, whole};
use noctograph_core::geometry::distance;

/// Light that counts as a line, of full light.
const LIT: f32 = 0.4;

/// How far from its stroke, moved onto its light, light may be and fill a gap: 0.05 H.
pub(super) const CLOSE_PX: f64 = 0.05 * PX_PER_H as f64;

/// Light of one letter as lines.
pub(super) struct LightLines {
    pub(super) width: usize,
    pub(super) lit: Vec<bool>,
    pub(super) thin: Vec<bool>,
}

impl LightLines {
    /// The lines of a picture.
    pub(super) fn new(picture: &Raster) -> Self {
        let lit: Vec<bool> = picture.values.iter().map(|value| *value > LIT).collect();
        let thin = thinned(lit.clone(), picture.width);
        Self { width: picture.width, lit, thin }
    }

    /// Width of the lines, in pixels.
    pub(super) fn thickness(&self) -> f64 {
        let [lit, thin] =
            [&self.lit, &self.thin].map(|mask| mask.iter().filter(|lit| **lit).count());
        lit as f64 / thin.max(1) as f64
    }

    /// Whether light is within reach.
    pub(super) fn has_light_near(&self, [x, y]: [f64; 2], reach_px: f64) -> bool {
        let height = self.lit.len() / self.width;
        let reach = reach_px.ceil();
        let [mut rows, columns] = [(y, height), (x, self.width)].map(|(middle, end)| {
            whole((middle - reach).max(0.0))..end.min(whole(middle + reach + 1.0))
        });
        rows.any(|row| {
            columns.clone().any(|column| {
                let index = row * self.width + column;
                self.lit[index] && distance(self.middle(index), [x, y]) <= reach_px
            })
        })
    }

    /// Whether light is close to a point.
    pub(super) fn is_drawn(&self, point: [f64; 2]) -> bool {
        self.has_light_near(point, CLOSE_PX)
    }

    /// Number of lit pixels near some points.
    pub(super) fn lit_near(&self, points: &[[f64; 2]]) -> usize {
        let lit = (0..self.lit.len()).filter(|n| self.lit[*n]).map(|n| self.middle(n));
        lit.filter(|lit| points.iter().any(|point| distance(*point, *lit) < 6.0)).count()
    }

    /// The middle of a pixel.
    pub(super) fn middle(&self, index: usize) -> [f64; 2] {
        [(index % self.width) as f64 + 0.5, (index / self.width) as f64 + 0.5]
    }

    /// The lines alone, three pixels wide: the picture without glow and noise.
    pub(super) fn redrawn(&self, picture: &Raster) -> Raster {
        let mut clean = Raster::dark(picture.width, picture.height);
        for (index, _) in self.thin.iter().enumerate().filter(|(_, line)| **line) {
            clean.values[index] = 1.0;
            for beside in around(index, self.width, self.thin.len()) {
                let across = beside % self.width == index % self.width;
                let down = beside / self.width == index / self.width;
                let share: f32 = if across || down { 0.6 } else { 0.3 };
                clean.values[beside] = clean.values[beside].max(share);
            }
        }
        clean
    }
}

/// Neighbors of a pixel on a page.
pub(super) fn around(index: usize, width: usize, n_pixels: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (index % width, index / width);
    let rows = y.saturating_sub(1)..(y + 2).min(n_pixels / width);
    rows.flat_map(move |row| {
        (x.saturating_sub(1)..(x + 2).min(width)).map(move |column| row * width + column)
    })
    .filter(move |beside| *beside != index)
}

/// Thins areas to lines a pixel wide: Zhang and Suen, "A fast parallel algorithm for thinning
/// digital patterns" (1984).
fn thinned(mut ink: Vec<bool>, width: usize) -> Vec<bool> {
    let height = ink.len() / width;
    loop {
        let mut changed = false;
        for pass in 0..2 {
            let mut gone = Vec::new();
            for y in 1..height - 1 {
                for x in 1..width - 1 {
                    let pixel = y * width + x;
                    if !ink[pixel] {
                        continue;
                    }
                    // Clockwise from above.
                    let (up, down) = (pixel - width, pixel + width);
                    let ring = [up, up + 1, pixel + 1, down + 1, down, down - 1, pixel - 1, up - 1];
                    let ring = ring.map(|beside| ink[beside]);
                    let n_ink = ring.iter().filter(|ink| **ink).count();
                    let n_starts = (0..8).filter(|i| !ring[*i] && ring[(i + 1) % 8]).count();
                    let [up, _, right, _, down, _, left, _] = ring;
                    let open = match pass {
                        0 => !(right && down && (up || left)),
                        _ => !(up && left && (right || down)),
                    };
                    if (2..=6).contains(&n_ink) && n_starts == 1 && open {
                        gone.push(pixel);
                    }
                }
            }
            changed |= !gone.is_empty();
            gone.into_iter().for_each(|pixel| ink[pixel] = false);
        }
        if !changed {
            return ink;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bar 5 pixels high from column 10 to 50, and a dot of stray light.
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
        let run = vec![[[10.5, 10.5], [60.5, 10.5]]];
        let (gaps, recall) = trace.gaps(&trace.bend(std::slice::from_ref(&run)), |_| false);
        assert_eq!(gaps.len(), 1);
        let [from, to] = gaps[0].along_px;
        assert!((from - 40.0).abs() <= 1.0 && (to - 50.0).abs() <= 1.0, "{from} to {to}");
        assert!((recall - 0.85).abs() < 0.03, "{recall}");
        let (strays, precision) = trace.strays(&run, &[]);
        assert_eq!(strays.len(), 1);
        assert!((8..=11).contains(&strays[0].points.len()), "{strays:?}");
        assert!((precision - 0.8).abs() < 0.05, "{precision}");
        assert!(trace.strays(&run, &[[[18.0, 23.5], [32.0, 23.5]]]).0.is_empty(), "a neighbor's");
    }
}
