//! Strokes and their light: each intended stroke is moved sideways onto its light, so that the
//! stroke of a drone off its path does not count as missing; what has no light then is a gap, and
//! lines of light without a stroke are stray.
//!
//! Strokes move across their own direction only: along it, light may be missing.

use super::PX_PER_H;
use super::raster::whole;
use super::trace::{CLOSE_PX, LightLines, around};
use noctograph_core::geometry::segment_distance;

/// Turns sharper than this end a stroke: 40 degrees. Polygons for round letters turn by less.
const CORNER_RAD: f64 = 40.0 * core::f64::consts::PI / 180.0;

/// Farthest that a stroke is moved: 0.25 H, as far as a letter may be shifted.
const REACH_PX: i32 = 8;

/// Light that is wider than this across a stroke is another stroke's, or a blot: 0.2 H.
const WIDEST_PX: i32 = 6;

/// Offsets are medians over so many points to either side: 0.2 H.
const AROUND: usize = 6;

/// How far from its stroke light may be: 0.10 H.
const TOLERANCE_PX: f64 = 0.1 * PX_PER_H as f64;

/// Least length of a gap, without `CLOSE_PX` at each end: 0.12 H. A cut corner leaves as much.
const LEAST_GAP_PX: f64 = 0.12 * PX_PER_H as f64;

/// Gaps that reach no farther than this from a corner are a cut corner: 0.2 H.
const CUT_PX: usize = 6;

/// Least length of a line of stray light: 0.1 H.
const LEAST_STRAY_PX: f64 = 3.2;

/// A straight stroke on a page, in pixels: from a point to a point.
pub(super) type Segment = [[f64; 2]; 2];

/// Strokes of a letter where their light is.
#[derive(Clone, Debug, Default)]
pub(super) struct Bent {
    /// Points of each run of the pen as intended, a pixel apart.
    pub(super) intended: Vec<Vec<[f64; 2]>>,
    /// The same where the light is.
    pub(super) on_light: Vec<Vec<[f64; 2]>>,
    /// Mean distance of the light from the intended strokes, where there is light.
    pub(super) off_px: f64,
    /// Where each run turns a corner: indices of its points.
    corners: Vec<Vec<usize>>,
}

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

impl Bent {
    /// The strokes on their light as segments.
    pub(super) fn segments(&self) -> Vec<Segment> {
        let pairs = self.on_light.iter().flat_map(|points| points.windows(2));
        pairs.map(|pair| [pair[0], pair[1]]).collect()
    }
}

impl LightLines {
    /// Moves runs of the pen onto their light.
    pub(super) fn bend(&self, runs: &[Vec<Segment>]) -> Bent {
        let mut bent = Bent::default();
        let (mut sum_px, mut n_lit) = (0.0, 0_u32);
        for run in runs {
            let (mut intended, mut on_light, mut corners) = (Vec::new(), Vec::new(), Vec::new());
            for stroke in run.chunk_by(|a, b| turn(*a, *b) < CORNER_RAD) {
                corners.push(on_light.len());
                let points: Vec<([f64; 2], [f64; 2])> =
                    stroke.iter().flat_map(|s| walk(*s).map(|point| (point, normal(*s)))).collect();
                let offsets = points.iter().map(|(point, across)| self.offset(*point, *across));
                let offsets: Vec<Option<f64>> = offsets.collect();
                sum_px += offsets.iter().flatten().map(|offset| offset.abs()).sum::<f64>();
                n_lit += offsets.iter().map(|offset| u32::from(offset.is_some())).sum::<u32>();
                for (index, (point, across)) in points.into_iter().enumerate() {
                    let offset = smooth(&offsets, index);
                    intended.push(point);
                    on_light.push([0, 1].map(|axis| point[axis] + offset * across[axis]));
                }
            }
            bent.intended.push(intended);
            bent.on_light.push(on_light);
            bent.corners.push(corners);
        }
        bent.off_px = sum_px / f64::from(n_lit.max(1));
        bent
    }

    /// Offset of the nearest light across a stroke; `None` where there is none.
    fn offset(&self, [x, y]: [f64; 2], across: [f64; 2]) -> Option<f64> {
        let mut nearest: Option<f64> = None;
        let mut from = None;
        for step in -REACH_PX..=REACH_PX + 1 {
            let offset = f64::from(step);
            let point = [x + offset * across[0], y + offset * across[1]];
            match (from, step <= REACH_PX && self.is_lit(point)) {
                (None, true) => from = Some(step),
                (Some(first), false) => {
                    from = None;
                    let middle = 0.5 * f64::from(first + step - 1);
                    let is_nearer = nearest.is_none_or(|best| middle.abs() < best.abs());
                    if step - first <= WIDEST_PX && is_nearer {
                        nearest = Some(middle);
                    }
                }
                _ => {}
            }
        }
        nearest
    }

    fn is_lit(&self, [x, y]: [f64; 2]) -> bool {
        let height = self.lit.len() / self.width;
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < height as f64;
        inside && self.lit[whole(y) * self.width + whole(x)]
    }

    /// Gaps in runs of the pen, and the share of the runs that has light. `is_lost` says of points
    /// whether their light is lost in a log.
    pub(super) fn gaps(
        &self,
        bent: &Bent,
        is_lost: impl Fn(&[[f64; 2]]) -> bool,
    ) -> (Vec<Gap>, f64) {
        let (mut gaps, mut n_points, mut n_lit) = (Vec::new(), 0, 0);
        for (stroke, points) in bent.on_light.iter().enumerate() {
            n_points += points.len();
            n_lit += points.iter().filter(|p| self.has_light_near(**p, TOLERANCE_PX)).count();
            let has_light: Vec<bool> = points.iter().map(|point| self.is_drawn(*point)).collect();
            let mut end = 0;
            for same in has_light.chunk_by(|a, b| a == b) {
                let (from, to) = (end, end + same.len());
                end = to;
                // A drone that trails cuts a corner: nothing is missing there.
                let near = from + 1..=from + CUT_PX;
                let mut corners =
                    bent.corners[stroke].iter().filter(|corner| near.contains(*corner));
                let is_cut =
                    from > 0 && to < points.len() && corners.any(|corner| to <= corner + CUT_PX);
                let is_small = is_cut || (same.len() as f64) < LEAST_GAP_PX;
                if same[0] || (is_small && !is_lost(&points[from..to])) {
                    continue;
                }
                // Light ends a bit before the first point that it is no longer near.
                let reach = whole(CLOSE_PX);
                let from = from.saturating_sub(reach);
                let to = (to + reach).min(points.len());
                // What is missing went on where the light before it ended, or after it begins.
                let beside = if from > 0 { from - 1 } else { to.min(points.len() - 1) };
                let intended = &bent.intended[stroke];
                let offset = [0, 1].map(|axis| points[beside][axis] - intended[beside][axis]);
                let moved = intended[from..to].iter().map(|[x, y]| [x + offset[0], y + offset[1]]);
                let along_px = [from as f64, to as f64];
                gaps.push(Gap { stroke, along_px, points: moved.collect() });
            }
        }
        (gaps, n_lit as f64 / n_points.max(1) as f64)
    }

    /// Lines away from the intended strokes, and the share of the letter's lines near them, without
    /// lines of its neighbors.
    pub(super) fn strays(&self, own: &[Segment], beside: &[Segment]) -> (Vec<Stray>, f64) {
        let mut far = vec![false; self.thin.len()];
        let (mut n_own, mut n_far) = (0_u32, 0_u32);
        for index in (0..far.len()).filter(|index| self.thin[*index]) {
            let point = self.middle(index);
            let is_far = distance(point, own) > TOLERANCE_PX;
            if is_far && distance(point, beside) <= 1.5 * TOLERANCE_PX {
                continue;
            }
            far[index] = is_far;
            n_far += u32::from(is_far);
            n_own += u32::from(!is_far);
        }
        let precision = f64::from(n_own) / f64::from((n_own + n_far).max(1));
        let mut strays = Vec::new();
        for start in 0..far.len() {
            let mut open = Vec::from_iter(std::mem::take(&mut far[start]).then_some(start));
            let mut points = Vec::new();
            while let Some(index) = open.pop() {
                points.push(self.middle(index));
                let beside = around(index, self.width, far.len());
                open.extend(beside.filter(|beside| std::mem::take(&mut far[*beside])));
            }
            if points.len() as f64 >= LEAST_STRAY_PX {
                let thick_px = self.lit_near(&points) as f64 / points.len() as f64;
                strays.push(Stray { points, thick_px });
            }
        }
        (strays, precision)
    }
}

/// Distance of a point from the nearest of some segments.
pub(super) fn distance(point: [f64; 2], segments: &[Segment]) -> f64 {
    let distances = segments.iter().map(|segment| segment_distance(point, *segment));
    distances.fold(f64::INFINITY, f64::min)
}

/// From the start of a segment to its end.
fn vector([from, to]: Segment) -> [f64; 2] {
    [to[0] - from[0], to[1] - from[1]]
}

/// Points of a segment, a pixel apart.
fn walk(segment: Segment) -> impl Iterator<Item = [f64; 2]> {
    let ([x, y], [dx, dy]) = (segment[0], vector(segment));
    let n_steps = whole(libm::hypot(dx, dy).ceil());
    let shares = (0..n_steps).map(move |step| (step as f64 + 0.5) / n_steps as f64);
    shares.map(move |share| [x + share * dx, y + share * dy])
}

/// Angle between two segments of a run of the pen, 0 to π.
fn turn(a: Segment, b: Segment) -> f64 {
    let [a, b] = [a, b].map(vector);
    libm::atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]).abs()
}

/// Unit vector across a segment, to its left on the page.
fn normal(segment: Segment) -> [f64; 2] {
    let [dx, dy] = vector(segment);
    let length = libm::hypot(dx, dy);
    [-dy / length, dx / length]
}

/// The median of the offsets around a point, over a wider range where there is no light.
fn smooth(offsets: &[Option<f64>], index: usize) -> f64 {
    let mut reach = AROUND;
    loop {
        let around = &offsets[index.saturating_sub(reach)..(index + reach + 1).min(offsets.len())];
        let mut lit: Vec<f64> = around.iter().flatten().copied().collect();
        if !lit.is_empty() {
            lit.sort_by(f64::total_cmp);
            return lit[lit.len() / 2];
        }
        if reach > offsets.len() {
            return 0.0;
        }
        reach += usize::from(PX_PER_H) / 8;
    }
}

#[cfg(test)]
mod tests {
    use super::super::raster::Raster;
    use super::*;

    #[test]
    fn a_stroke_is_found_where_it_was_drawn_and_its_gap_stays() {
        let mut page = Raster::dark(64, 32);
        for y in 12..15 {
            page.values[y * 64 + 10..y * 64 + 40].fill(1.0);
        }
        let trace = LightLines::new(&page);
        let bent = trace.bend(&[vec![[[10.0, 9.5], [60.0, 9.5]]]]);
        assert!(bent.on_light[0].iter().all(|[_, y]| (y - 13.5).abs() < 1.0), "{bent:?}");
        assert!((bent.off_px - 4.0).abs() < 1.0, "{}", bent.off_px);
        let (gaps, recall) = trace.gaps(&bent, |_| false);
        let [from, to] = gaps[0].along_px;
        assert!((from - 30.0).abs() <= 1.0 && to == 50.0, "{from} to {to}");
        assert!((recall - 0.66).abs() < 0.03, "{recall}");
    }
}
