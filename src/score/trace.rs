//! Lines of light against intended strokes: what is missing and what is too much.
//!
//! Light is thinned to lines a pixel wide (Zhang and Suen 1984). An intended stroke is missing where
//! no light is within a tenth of a cap height, and a line is stray where no intended stroke is.

use super::PX_PER_H;
use super::raster::{Raster, whole};
use crate::geometry::segment_distance;

/// Light that counts as a line, of full light.
const LIT: f32 = 0.4;

/// How far from its stroke light may be: 0.10 H (study).
pub(super) const TOLERANCE_PX: f64 = 0.1 * PX_PER_H as f64;

/// How far from its stroke, moved onto its light, light may be and fill a gap: 0.05 H.
const CLOSE_PX: f64 = 0.05 * PX_PER_H as f64;

/// Shorter gaps, less `CLOSE_PX` at each end, are none: 0.12 H. A corner that is cut leaves as much.
const LEAST_GAP_PX: f64 = 0.12 * PX_PER_H as f64;

/// Gaps that reach no farther than this from a corner are a cut corner: 0.2 H.
const CUT_PX: usize = 6;

/// Shorter lines are none: 0.1 H.
const LEAST_PX: f64 = 3.2;

/// Turns sharper than this end a stroke: 40 degrees. Polygons for round letters turn by less.
pub(super) const CORNER_RAD: f64 = 40.0 * core::f64::consts::PI / 180.0;

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
    pub(super) width: usize,
    pub(super) lit: Vec<bool>,
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
    pub(super) fn gaps(&self, bent: &Bent) -> (Vec<Gap>, f64) {
        let (mut gaps, mut n_points, mut n_lit) = (Vec::new(), 0, 0);
        for (stroke, points) in bent.found.iter().enumerate() {
            let near = |reach_px: f64| -> Vec<bool> {
                points.iter().map(|point| self.has_light_near(*point, reach_px)).collect()
            };
            n_points += points.len();
            n_lit += near(TOLERANCE_PX).iter().filter(|lit| **lit).count();
            let has_light = near(CLOSE_PX);
            let mut at = 0;
            for same in has_light.chunk_by(|a, b| a == b) {
                let [from, to] = [at, at + same.len()];
                at = to;
                // A drone that trails cuts a corner: nothing is missing there.
                let cut = |corner: &usize| {
                    *corner > from
                        && corner - from <= CUT_PX
                        && to.saturating_sub(*corner) <= CUT_PX
                };
                let is_cut = from > 0 && to < points.len() && bent.corners[stroke].iter().any(cut);
                if same[0] || is_cut || (same.len() as f64) < LEAST_GAP_PX {
                    continue;
                }
                // Light ends a bit before the first point that it is no longer near.
                let reach = whole(CLOSE_PX);
                let from = if from == 0 { 0 } else { from.saturating_sub(reach) };
                let to = if to == points.len() { to } else { (to + reach).min(points.len()) };
                // What is missing went on where the light before it ended, or after it begins.
                let beside = if from > 0 { from - 1 } else { to.min(points.len() - 1) };
                let intended = &bent.intended[stroke];
                let off = [0, 1].map(|axis| points[beside][axis] - intended[beside][axis]);
                let points = intended[from..to].iter();
                let points = points.map(|at| [at[0] + off[0], at[1] + off[1]]).collect();
                gaps.push(Gap { stroke, along_px: [from as f64, to as f64], points });
            }
        }
        (gaps, n_lit as f64 / n_points.max(1) as f64)
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

    /// Width of the lines, in pixels.
    pub(super) fn thickness(&self) -> f64 {
        let count = |mask: &[bool]| mask.iter().filter(|lit| **lit).count() as f64;
        count(&self.lit) / count(&self.thin).max(1.0)
    }

    /// Whether light is within reach.
    fn has_light_near(&self, [x, y]: [f64; 2], reach_px: f64) -> bool {
        let height = self.lit.len() / self.width;
        let reach = reach_px.ceil();
        let range =
            |at: f64, end: usize| whole((at - reach).max(0.0))..end.min(whole(at + reach + 1.0));
        range(y, height).any(|row| {
            range(x, self.width).any(|column| {
                let at = self.middle(row * self.width + column);
                self.lit[row * self.width + column] && libm::hypot(at[0] - x, at[1] - y) <= reach_px
            })
        })
    }

    /// Whether light is close to a point.
    pub(super) fn is_drawn(&self, point: [f64; 2]) -> bool {
        self.has_light_near(point, CLOSE_PX)
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
pub(super) fn distance(point: [f64; 2], segments: &[Segment]) -> f64 {
    segments.iter().map(|leg| segment_distance(point, *leg)).fold(f64::INFINITY, f64::min)
}

/// Points of a segment, a pixel apart.
pub(super) fn walk([from, to]: Segment) -> impl Iterator<Item = [f64; 2]> {
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

/// Strokes of a letter where their light is.
#[derive(Clone, Debug)]
pub(super) struct Bent {
    /// Points of each run of the pen as intended, a pixel apart.
    pub(super) intended: Vec<Vec<[f64; 2]>>,
    /// The same where the light is.
    pub(super) found: Vec<Vec<[f64; 2]>>,
    /// Mean distance of the light from the intended strokes, where there is light.
    pub(super) off_px: f64,
    /// Where each run turns a corner: indices of its points.
    pub(super) corners: Vec<Vec<usize>>,
}

impl Bent {
    /// The found strokes as segments.
    pub(super) fn segments(&self) -> Vec<Segment> {
        let pairs = self.found.iter().flat_map(|points| points.windows(2));
        pairs.map(|pair| [pair[0], pair[1]]).collect()
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
        let (gaps, recall) = trace.gaps(&trace.bend(std::slice::from_ref(&run)));
        assert_eq!(gaps.len(), 1);
        let [from, to] = gaps[0].along_px;
        assert!((from - 40.0).abs() <= 1.0 && (to - 50.0).abs() <= 1.0, "{from} to {to}");
        assert!((recall - 0.85).abs() < 0.03, "{recall}");
        let (strays, precision) = trace.strays(&run, &[]);
        assert_eq!(strays.len(), 1);
        assert!((8..=11).contains(&strays[0].points.len()), "{strays:?}");
        assert!((precision - 0.8).abs() < 0.05, "{precision}");
        assert!(trace.strays(&run, &[[[18.0, 23.5], [32.0, 23.5]]]).0.is_empty(), "a neighbour's");
    }
}
