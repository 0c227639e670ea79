//! Moves each intended stroke sideways onto its light, so that it does not count as missing when
//! the drone flew beside its path. Parts of the moved strokes without light are then gaps, and
//! lines of light without a stroke are extra. Strokes move only sideways, because part of their
//! length may be dark.

use std::ops::Range;

use kurbo::{Line, Point, Vec2};

use super::PX_PER_H;
use super::plane::xy;
use super::raster::whole;
use super::trace::{CLOSE_PX, LightLines, around};
use noctograph_core::geometry::segment_distance;
use noctograph_core::statistics::median;

/// Minimum turn that ends a stroke: 40 degrees. The polygons of round letters turn by less.
const CORNER_RAD: f64 = 40.0 * core::f64::consts::PI / 180.0;

/// Maximum sideways move of a stroke: 0.25 cap heights, like the maximum shift of a letter.
const REACH_PX: i32 = 8;

/// Maximum width of a stroke's light: 0.2 cap heights. Wider light is a spot or another stroke.
const WIDEST_PX: i32 = 6;

/// Half-width of the window of the running median over the offsets, in points: 0.2 cap heights.
const AROUND: usize = 6;

/// Maximum distance between a stroke and its light: 0.1 cap heights.
const TOLERANCE_PX: f64 = 0.1 * PX_PER_H as f64;

/// Maximum distance between a neighboring letter's stroke, which is not moved, and its light.
const BESIDE_PX: f64 = 1.5 * TOLERANCE_PX;

/// Minimum length of a gap without `CLOSE_PX` at each end: 0.12 cap heights. A cut corner leaves a
/// shorter gap.
const LEAST_GAP_PX: f64 = 0.12 * PX_PER_H as f64;

/// Maximum extent of a cut corner's gap from the corner: 0.2 cap heights.
const CUT_PX: usize = 6;

/// Minimum length of a line of extra light: 0.1 cap heights.
const LEAST_EXTRA_PX: f64 = 3.2;

/// The strokes of a letter, moved onto their light.
#[derive(Clone, Debug, Default)]
pub(super) struct Bent {
    /// The runs of the pen in the letter.
    pub(super) runs: Vec<Run>,
    /// Mean distance between the intended strokes and their light, over the points that have light.
    pub(super) mean_offset_px: f64,
}

/// A run of the pen, that is, strokes drawn without a dark move.
#[derive(Clone, Debug, Default)]
pub(super) struct Run {
    /// Intended points, a pixel apart.
    pub(super) intended: Vec<Point>,
    /// The intended points after they were moved onto the light.
    pub(super) on_light: Vec<Point>,
    /// Indices of the points that are corners.
    corners: Vec<usize>,
}

/// A part of the intended strokes that has no light.
#[derive(Clone, Debug)]
pub(super) struct Gap {
    /// Index of the run of the pen in which the gap is.
    pub(super) stroke: usize,
    /// Positions of the gap's start and end along the run.
    pub(super) along_px: [f64; 2],
    /// The points in the gap, a pixel apart.
    pub(super) points: Vec<Point>,
}

/// A line of light without an intended stroke.
#[derive(Clone, Debug)]
pub(super) struct ExtraLine {
    /// Centers of the line's pixels.
    pub(super) points: Vec<Point>,
    /// Number of lit pixels near the line, divided by the line's length.
    pub(super) thick_px: f64,
}

impl Bent {
    /// Returns the moved strokes as segments.
    pub(super) fn segments(&self) -> Vec<Line> {
        let pairs = self.runs.iter().flat_map(|run| run.on_light.windows(2));
        pairs.map(|pair| Line::new(pair[0], pair[1])).collect()
    }
}

impl Run {
    /// True if a dark stretch is a corner that a lagging drone cut, so that nothing is missing.
    fn is_cut_corner(&self, dark: &Range<usize>) -> bool {
        let mut corners = self.corners.iter();
        dark.start > 0
            && dark.end < self.on_light.len()
            && corners.any(|corner| {
                (dark.start + 1..=dark.start + CUT_PX).contains(corner)
                    && dark.end <= corner + CUT_PX
            })
    }

    /// Returns the gap at a dark stretch, extended at each end by the tolerance.
    fn gap(&self, stroke: usize, dark: Range<usize>) -> Gap {
        // Points up to `CLOSE_PX` from light count as lit, so the gap exceeds the dark stretch.
        let reach = whole(CLOSE_PX);
        let from = dark.start.saturating_sub(reach);
        let to = (dark.end + reach).min(self.on_light.len());
        // The gap is drawn with the offset of the light before it or, if there is none, after it.
        let neighbor = if from > 0 { from - 1 } else { to.min(self.on_light.len() - 1) };
        let offset = self.on_light[neighbor] - self.intended[neighbor];
        let points = self.intended[from..to].iter().map(|point| *point + offset).collect();
        Gap { stroke, along_px: [from as f64, to as f64], points }
    }
}

impl LightLines {
    /// Moves each run of the pen sideways onto its light.
    pub(super) fn bend(&self, runs: &[Vec<Line>]) -> Bent {
        let mut bent = Bent::default();
        let (mut sum_px, mut n_lit) = (0.0, 0);
        for segments in runs {
            let mut run = Run::default();
            // Offsets are only smoothed between corners, because a corner changes their direction.
            for stroke in segments.chunk_by(|a, b| turn(*a, *b) < CORNER_RAD) {
                run.corners.push(run.on_light.len());
                let points: Vec<(Point, Vec2)> = stroke
                    .iter()
                    .flat_map(|s| pixel_steps(*s).map(|point| (point, normal(*s))))
                    .collect();
                let offsets: Vec<Option<f64>> =
                    points.iter().map(|(point, across)| self.offset(*point, *across)).collect();
                sum_px += offsets.iter().flatten().map(|offset| offset.abs()).sum::<f64>();
                n_lit += offsets.iter().flatten().count();
                for (index, (point, across)) in points.into_iter().enumerate() {
                    run.intended.push(point);
                    run.on_light.push(point + smooth(&offsets, index) * across);
                }
            }
            bent.runs.push(run);
        }
        bent.mean_offset_px = sum_px / n_lit.max(1) as f64;
        bent
    }

    /// Returns the offset in pixels from a stroke to the nearest narrow light across it, along the
    /// unit vector `across`. Returns `None` without such light.
    fn offset(&self, point: Point, across: Vec2) -> Option<f64> {
        let mut nearest: Option<f64> = None;
        let mut first_lit = None;
        // The step beyond the maximum offset counts as dark, so that it ends a lit stretch.
        for step in -REACH_PX..=REACH_PX + 1 {
            let is_lit = step <= REACH_PX && self.is_lit(point + f64::from(step) * across);
            match (first_lit, is_lit) {
                (None, true) => first_lit = Some(step),
                (Some(first), false) => {
                    first_lit = None;
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

    /// True if a point is lit. Points outside the page are dark.
    fn is_lit(&self, Point { x, y }: Point) -> bool {
        let height = self.lit.len() / self.width;
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < height as f64;
        inside && self.lit[whole(y) * self.width + whole(x)]
    }

    /// Returns the gaps in runs of the pen, and the fraction of the points that have light. A small
    /// gap is only returned if `is_lost` is true for its points.
    pub(super) fn gaps(&self, bent: &Bent, is_lost: impl Fn(&[Point]) -> bool) -> (Vec<Gap>, f64) {
        let (mut gaps, mut n_points, mut n_lit) = (Vec::new(), 0, 0);
        for (stroke, run) in bent.runs.iter().enumerate() {
            let points = &run.on_light;
            n_points += points.len();
            n_lit += points.iter().filter(|p| self.has_light_near(**p, TOLERANCE_PX)).count();
            // Consecutive points that all have light, or all lack it, form a stretch.
            let has_light: Vec<bool> = points.iter().map(|point| self.is_drawn(*point)).collect();
            let mut end = 0;
            for same in has_light.chunk_by(|a, b| a == b) {
                let stretch = end..end + same.len();
                end = stretch.end;
                let is_small = run.is_cut_corner(&stretch) || (same.len() as f64) < LEAST_GAP_PX;
                // A small gap is a fault only if a gap in the log explains it.
                if !same[0] && (!is_small || is_lost(&points[stretch.clone()])) {
                    gaps.push(run.gap(stroke, stretch));
                }
            }
        }
        (gaps, n_lit as f64 / n_points.max(1) as f64)
    }

    /// Returns the lines of light that are away from the strokes of the letter (`own`) and of its
    /// neighbors (`beside`), and the fraction of the letter's light that is near `own`.
    pub(super) fn extra_lines(&self, own: &[Line], beside: &[Line]) -> (Vec<ExtraLine>, f64) {
        let mut far = vec![false; self.thin.len()];
        let (mut n_own, mut n_far) = (0_u32, 0_u32);
        for index in (0..far.len()).filter(|index| self.thin[*index]) {
            let point = self.middle(index);
            if distance(point, own) <= TOLERANCE_PX {
                n_own += 1;
            } else if distance(point, beside) > BESIDE_PX {
                n_far += 1;
                far[index] = true;
            }
        }
        let precision = f64::from(n_own) / f64::from((n_own + n_far).max(1));
        // A flood fill collects connected pixels into one line.
        let mut lines = Vec::new();
        for start in 0..far.len() {
            let mut open = Vec::from_iter(std::mem::take(&mut far[start]).then_some(start));
            let mut points = Vec::new();
            while let Some(index) = open.pop() {
                points.push(self.middle(index));
                let neighbors = around(index, self.width, far.len());
                open.extend(neighbors.filter(|neighbor| std::mem::take(&mut far[*neighbor])));
            }
            if points.len() as f64 >= LEAST_EXTRA_PX {
                let thick_px = self.lit_near(&points) as f64 / points.len() as f64;
                lines.push(ExtraLine { points, thick_px });
            }
        }
        (lines, precision)
    }
}

/// Returns the distance in pixels from a point to the nearest segment.
pub(super) fn distance(point: Point, segments: &[Line]) -> f64 {
    let ends = segments.iter().map(|segment| [xy(segment.p0), xy(segment.p1)]);
    ends.map(|ends| segment_distance(xy(point), ends)).fold(f64::INFINITY, f64::min)
}

/// Cuts a segment into equal parts of at most one pixel, and returns the center of each in pixels.
fn pixel_steps(segment: Line) -> impl Iterator<Item = Point> {
    let Vec2 { x, y } = segment.p1 - segment.p0;
    let n_steps = whole(libm::hypot(x, y).ceil());
    (0..n_steps).map(move |step| segment.p0.lerp(segment.p1, (step as f64 + 0.5) / n_steps as f64))
}

/// Returns the angle in rad between two segments, 0 to π.
fn turn(a: Line, b: Line) -> f64 {
    let [a, b] = [a, b].map(|line| line.p1 - line.p0);
    libm::atan2(a.cross(b), a.dot(b)).abs()
}

/// Returns the unit vector perpendicular to a segment.
fn normal(segment: Line) -> Vec2 {
    let Vec2 { x, y } = segment.p1 - segment.p0;
    let length = libm::hypot(x, y);
    Vec2::new(-y / length, x / length)
}

/// Returns the median of the offsets around the point `index`, in pixels. The window widens until
/// it contains light. Without any light, the offset is 0.
fn smooth(offsets: &[Option<f64>], index: usize) -> f64 {
    let mut reach = AROUND;
    loop {
        let around = &offsets[index.saturating_sub(reach)..(index + reach + 1).min(offsets.len())];
        if let Some(offset) = median(around.iter().flatten().copied()) {
            return offset;
        }
        if reach > offsets.len() {
            return 0.0;
        }
        // The step is an eighth of a cap height.
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
        let bent = trace.bend(&[vec![Line::new((10.0, 9.5), (60.0, 9.5))]]);
        let on_light = &bent.runs[0].on_light;
        assert!(on_light.iter().all(|point| (point.y - 13.5).abs() < 1.0), "{bent:?}");
        assert!((bent.mean_offset_px - 4.0).abs() < 1.0, "{}", bent.mean_offset_px);
        let (gaps, recall) = trace.gaps(&bent, |_| false);
        let [from, to] = gaps[0].along_px;
        assert!((from - 30.0).abs() <= 1.0 && to == 50.0, "{from} to {to}");
        assert!((recall - 0.66).abs() < 0.03, "{recall}");
    }
}
