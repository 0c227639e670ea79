//! Lines of light against intended strokes: what is missing and what is too much.
//!
//! Light is thinned to lines a pixel wide (Zhang and Suen 1984). An intended stroke is missing where
//! no light is within a tenth of a cap height, and a line is stray where no intended stroke is.

use super::PX_PER_H;
use super::raster::{Raster, whole};

/// Light that counts as a line, of full light.
const LIT: f32 = 0.4;

/// How far from its stroke light may be: 0.10 H (legibility.md 6.3).
pub(super) const TOLERANCE_PX: f64 = 0.1 * PX_PER_H as f64;

/// Shorter gaps and lines, in pixels, are none: 0.1 H.
const LEAST_PX: f64 = 3.2;

/// A straight stroke on the page, in pixels.
pub(super) type Segment = [[f64; 2]; 2];

/// A part of the intended strokes that has no light.
#[derive(Clone, Debug)]
pub(super) struct Gap {
    /// Which run of the pen, from 0.
    pub(super) stroke: usize,
    /// From where to where along the run.
    pub(super) along_px: [f64; 2],
    /// The points of the gap, a pixel apart.
    pub(super) points: Vec<[f64; 2]>,
}

/// A line of light where none was intended.
#[derive(Clone, Debug)]
pub(super) struct Stray {
    /// Its pixels' middles.
    pub(super) points: Vec<[f64; 2]>,
    /// Lit pixels within reach of the line, by its length: how thick it is.
    pub(super) thick_px: f64,
}

/// Light of one letter as lines.
pub(super) struct Trace {
    width: usize,
    lit: Vec<bool>,
    thin: Vec<bool>,
}

impl Trace {
    /// The lines of a picture.
    pub(super) fn of(picture: &Raster) -> Self {
        let lit: Vec<bool> = picture.values.iter().map(|value| *value > LIT).collect();
        let thin = thinned(lit.clone(), picture.width);
        Self { width: picture.width, lit, thin }
    }

    /// Gaps in runs of the pen, and the share of the runs that has light.
    pub(super) fn gaps(&self, runs: &[Vec<Segment>]) -> (Vec<Gap>, f64) {
        let (mut gaps, mut n_points, mut n_lit) = (Vec::new(), 0_u32, 0_u32);
        for (stroke, run) in runs.iter().enumerate() {
            let mut open: Option<Gap> = None;
            let mut along_px = 0.0;
            for point in run.iter().flat_map(|segment| walk(*segment)) {
                let has_light = self.has_light_near(point);
                n_points += 1;
                n_lit += u32::from(has_light);
                if has_light {
                    gaps.extend(open.take());
                } else {
                    let gap = open.get_or_insert(Gap {
                        stroke,
                        along_px: [along_px; 2],
                        points: Vec::new(),
                    });
                    gap.along_px[1] = along_px + 1.0;
                    gap.points.push(point);
                }
                along_px += 1.0;
            }
            gaps.extend(open);
        }
        gaps.retain(|gap| gap.along_px[1] - gap.along_px[0] >= LEAST_PX);
        (gaps, f64::from(n_lit) / f64::from(n_points.max(1)))
    }

    /// Lines away from the intended strokes, and the share of the letter's lines that is not.
    /// What belongs to the neighbours counts for neither.
    pub(super) fn strays(&self, own: &[Segment], beside: &[Segment]) -> (Vec<Stray>, f64) {
        let mut far = vec![false; self.thin.len()];
        let (mut n_own, mut n_far) = (0_u32, 0_u32);
        for (index, _) in self.thin.iter().enumerate().filter(|(_, line)| **line) {
            let point = self.middle(index);
            let off = distance(point, own);
            if off > TOLERANCE_PX && distance(point, beside) <= 1.5 * TOLERANCE_PX {
                continue;
            }
            far[index] = off > TOLERANCE_PX;
            n_far += u32::from(far[index]);
            n_own += u32::from(!far[index]);
        }
        let precision = f64::from(n_own) / f64::from((n_own + n_far).max(1));
        let mut strays = Vec::new();
        for start in 0..far.len() {
            if !far[start] {
                continue;
            }
            let mut points = Vec::new();
            let mut open = vec![start];
            far[start] = false;
            while let Some(at) = open.pop() {
                points.push(self.middle(at));
                for beside in around(at, self.width, far.len()) {
                    if std::mem::take(&mut far[beside]) {
                        open.push(beside);
                    }
                }
            }
            if points.len() as f64 >= LEAST_PX {
                let thick_px = self.lit_near(&points) as f64 / points.len() as f64;
                strays.push(Stray { points, thick_px });
            }
        }
        (strays, precision)
    }

    fn has_light_near(&self, [x, y]: [f64; 2]) -> bool {
        let height = self.lit.len() / self.width;
        let reach = TOLERANCE_PX.ceil();
        let range =
            |at: f64, end: usize| whole((at - reach).max(0.0))..end.min(whole(at + reach + 1.0));
        range(y, height).any(|row| {
            range(x, self.width).any(|column| {
                let at = self.middle(row * self.width + column);
                self.lit[row * self.width + column]
                    && libm::hypot(at[0] - x, at[1] - y) <= TOLERANCE_PX
            })
        })
    }

    fn lit_near(&self, points: &[[f64; 2]]) -> usize {
        let near =
            |at: [f64; 2]| points.iter().any(|p| libm::hypot(p[0] - at[0], p[1] - at[1]) < 6.0);
        (0..self.lit.len()).filter(|index| self.lit[*index] && near(self.middle(*index))).count()
    }

    fn middle(&self, index: usize) -> [f64; 2] {
        [(index % self.width) as f64 + 0.5, (index / self.width) as f64 + 0.5]
    }

    /// The lines alone, three pixels wide: the picture without glow and noise.
    pub(super) fn redrawn(&self, picture: &Raster) -> Raster {
        let mut clean = Raster::dark(picture.width, picture.height);
        for (index, _) in self.thin.iter().enumerate().filter(|(_, line)| **line) {
            clean.values[index] = 1.0;
            for beside in around(index, self.width, self.thin.len()) {
                let share: f32 = if beside % self.width == index % self.width
                    || beside / self.width == index / self.width
                {
                    0.6
                } else {
                    0.3
                };
                clean.values[beside] = clean.values[beside].max(share);
            }
        }
        clean
    }
}

/// Distance of a point from the nearest of some segments.
pub(super) fn distance([x, y]: [f64; 2], segments: &[Segment]) -> f64 {
    let from_one = |[from, to]: &Segment| {
        let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
        let squares = dx * dx + dy * dy;
        let dot = (x - from[0]) * dx + (y - from[1]) * dy;
        let part = if squares > 0.0 { (dot / squares).clamp(0.0, 1.0) } else { 0.0 };
        libm::hypot(x - from[0] - part * dx, y - from[1] - part * dy)
    };
    segments.iter().map(from_one).fold(f64::INFINITY, f64::min)
}

/// Points of a segment, a pixel apart.
fn walk([from, to]: Segment) -> impl Iterator<Item = [f64; 2]> {
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let n_steps = whole(libm::hypot(dx, dy).ceil());
    (0..n_steps).map(move |step| {
        let part = (step as f64 + 0.5) / n_steps as f64;
        [from[0] + part * dx, from[1] + part * dy]
    })
}

/// Neighbours of a pixel on a page.
fn around(index: usize, width: usize, n_pixels: usize) -> impl Iterator<Item = usize> {
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
                    let at = y * width + x;
                    if !ink[at] {
                        continue;
                    }
                    // Clockwise from above.
                    let ring = [
                        at - width,
                        at - width + 1,
                        at + 1,
                        at + width + 1,
                        at + width,
                        at + width - 1,
                        at - 1,
                        at - width - 1,
                    ]
                    .map(|beside| ink[beside]);
                    let n_ink = ring.iter().filter(|ink| **ink).count();
                    let n_starts = (0..8).filter(|i| !ring[*i] && ring[(i + 1) % 8]).count();
                    let [up, right, down, left] = [ring[0], ring[2], ring[4], ring[6]];
                    let open = match pass {
                        0 => !(right && down && (up || left)),
                        _ => !(up && left && (right || down)),
                    };
                    if (2..=6).contains(&n_ink) && n_starts == 1 && open {
                        gone.push(at);
                    }
                }
            }
            changed |= !gone.is_empty();
            gone.into_iter().for_each(|at| ink[at] = false);
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
        let trace = Trace::of(&bar());
        let line: Vec<usize> = (0..64 * 20).filter(|at| trace.thin[*at]).collect();
        assert!(line.iter().all(|at| at / 64 == 10), "{line:?}");
        assert!((34..=40).contains(&line.len()), "{} of 40 columns", line.len());
    }

    #[test]
    fn what_is_missing_and_what_is_too_much_have_their_lengths() {
        let trace = Trace::of(&bar());
        let run = vec![[[10.5, 10.5], [60.5, 10.5]]];
        let (gaps, recall) = trace.gaps(std::slice::from_ref(&run));
        assert_eq!(gaps.len(), 1);
        let [from, to] = gaps[0].along_px;
        assert!((from - 42.0).abs() <= 1.0 && (to - 50.0).abs() <= 1.0, "{from} to {to}");
        assert!((recall - 0.85).abs() < 0.03, "{recall}");
        let (strays, precision) = trace.strays(&run, &[]);
        assert_eq!(strays.len(), 1);
        assert!((8..=11).contains(&strays[0].points.len()), "{strays:?}");
        assert!((precision - 0.8).abs() < 0.05, "{precision}");
        assert!(trace.strays(&run, &[[[18.0, 23.5], [32.0, 23.5]]]).0.is_empty(), "a neighbour's");
    }
}
