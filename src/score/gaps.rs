//! Gaps and stray light: parts of the intended strokes without light nearby, and lines of light
//! without an intended stroke nearby.

use super::PX_PER_H;
use super::bend::Bent;
use super::raster::whole;
use super::segment::{Segment, distance};
use super::trace::{CLOSE_PX, LightLines, around};

/// How far from its stroke light may be: 0.10 H.
pub(super) const TOLERANCE_PX: f64 = 0.1 * PX_PER_H as f64;

/// Shorter gaps, less `CLOSE_PX` at each end, are none: 0.12 H. A corner that is cut leaves as
/// much.
const LEAST_GAP_PX: f64 = 0.12 * PX_PER_H as f64;

/// Gaps that reach no farther than this from a corner are a cut corner: 0.2 H.
const CUT_PX: usize = 6;

/// Shorter lines are none: 0.1 H.
const LEAST_PX: f64 = 3.2;

/// A part of the intended strokes that has no light.
#[derive(Clone, Debug)]
pub(super) struct Gap {
    /// Which run of the pen, from 0.
    pub(super) stroke: usize,
    /// Its start and end along the run.
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

impl LightLines {
    /// Gaps in runs of the pen, and the share of the runs that has light. `is_lost` says of points
    /// whether their light is lost in a log.
    pub(super) fn gaps(
        &self,
        bent: &Bent,
        is_lost: impl Fn(&[[f64; 2]]) -> bool,
    ) -> (Vec<Gap>, f64) {
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
                let is_small = is_cut || (same.len() as f64) < LEAST_GAP_PX;
                if same[0] || (is_small && !is_lost(&points[from..to])) {
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
    /// Lines of the neighbors count for neither.
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
}
