//! Path of the design over time, in straight segments of constant speed.

use std::ops::Range;

use nalgebra::{Vector2, Vector3};

use noctograph_core::flight::Flight;
use noctograph_core::geometry::Chords;

/// Largest distance in m per axis of an omitted sample from its segment. Twice the file's rounding
/// unit makes a straight stroke one segment.
const TOLERANCE_M: f64 = 2e-6;

/// Position of the design over time. The position is constant before the first and after the last
/// sample.
#[derive(Clone, Debug)]
pub struct DesignPath {
    corners: Vec<Corner>,
    /// Segments, one per corner, from the previous segment's end to that of the corner's segment.
    segments: Segments,
}

/// Segments as the five numbers of [`plane_segment`], with one column for each number.
#[derive(Clone, Debug, Default)]
struct Segments([Vec<f64>; 5]);

/// Number of segments whose distances are computed at once.
const LANES: usize = 8;

impl Segments {
    fn push(&mut self, segment: [f64; 5]) {
        self.0.iter_mut().zip(segment).for_each(|(column, value)| column.push(value));
    }

    /// Returns the squared distance of a point from the nearest of several segments in m².
    #[inline(always)]
    fn squared_distance_m2(&self, point_m: Vector2<f64>, range: Range<usize>) -> f64 {
        let columns = self.0.each_ref().map(|column| column[range.clone()].as_chunks::<LANES>());
        let mut least = [f64::INFINITY; LANES];
        for row in 0..columns[0].0.len() {
            let columns = columns.map(|column| &column.0[row]);
            for lane in 0..LANES {
                let square = squared_distance_m2(point_m, columns.map(|column| column[lane]));
                least[lane] = if square < least[lane] { square } else { least[lane] };
            }
        }
        let rest = 0..columns[0].1.len();
        let rest =
            rest.map(|row| squared_distance_m2(point_m, columns.map(|column| column.1[row])));
        rest.chain(least).fold(f64::INFINITY, f64::min)
    }
}

/// Returns a segment in the x-z plane as five numbers: first point, vector and squared length.
fn plane_segment(from_m: Vector3<f64>, to_m: Vector3<f64>) -> [f64; 5] {
    let step_m = (to_m - from_m).xz();
    [from_m.x, from_m.z, step_m.x, step_m.y, step_m.norm_squared()]
}

/// Returns the squared distance of a point from a segment.
#[inline(always)]
fn squared_distance_m2(
    point_m: Vector2<f64>,
    [from_x, from_z, step_x, step_z, square]: [f64; 5],
) -> f64 {
    let (x, z) = (point_m.x - from_x, point_m.y - from_z);
    let along = (x * step_x + z * step_z) / square;
    let along = if square > 0.0 { along.clamp(0.0, 1.0) } else { 0.0 };
    let (x, z) = (x - step_x * along, z - step_z * along);
    x * x + z * z
}

#[derive(Clone, Copy, Debug)]
struct Corner {
    time_s: f64,
    at_m: Vector3<f64>,
}

impl DesignPath {
    /// Makes the path of a flight's design. Returns `None` without samples, and for a design that
    /// is zero throughout, as in a log without setpoints.
    pub fn new(flight: &Flight) -> Option<Self> {
        let designed = flight.samples.iter().any(|sample| sample.design_m != Vector3::zeros());
        let corners = flight.samples.iter().map(|sample| (sample.time_s, sample.design_m));
        designed.then(|| Self::through(corners))
    }

    /// Makes the path through at least one point, given in chronological order.
    pub fn through(points: impl Iterator<Item = (f64, Vector3<f64>)>) -> Self {
        let corners = points.map(|(time_s, at_m)| Corner { time_s, at_m });
        let corners = without_even_corners(corners);
        let mut path = Self { corners, segments: Segments::default() };
        let mut from_m = path.corners[0].at_m;
        for index in 0..path.corners.len() {
            let to_m = path.end_m(index);
            path.segments.push(plane_segment(from_m, to_m));
            from_m = to_m;
        }
        path
    }

    /// Returns the first and last time of the design in s.
    pub fn span_s(&self) -> [f64; 2] {
        [self.corners[0].time_s, self.corners[self.corners.len() - 1].time_s]
    }

    /// Returns the time in s at which the design first moves, or begins if it never moves.
    pub fn first_move_s(&self) -> f64 {
        let away = |pair: &[Corner]| pair[1].at_m != self.corners[0].at_m;
        let last = self.corners.windows(2).position(away).unwrap_or(0);
        self.corners[last].time_s
    }

    /// Returns a reader of positions that starts at the beginning of the path.
    pub fn walk(&self) -> Walk<'_> {
        Walk { path: self, segment: 0 }
    }
}

/// Reader of a path at times that do not decrease, which needs no search.
#[derive(Debug)]
pub struct Walk<'a> {
    path: &'a DesignPath,
    segment: usize,
}

impl Walk<'_> {
    /// Returns the position of the design at `time_s`.
    pub fn at_m(&mut self, time_s: f64) -> Vector3<f64> {
        let corners = &self.path.corners;
        while corners.get(self.segment + 1).is_some_and(|next| next.time_s <= time_s) {
            self.segment += 1;
        }
        self.path.on_segment(self.segment, time_s)
    }

    /// Returns the distance in m from a point to the design's path between two times, in the x-z
    /// plane.
    pub fn distance_m(&mut self, point_m: Vector3<f64>, [from_s, to_s]: [f64; 2]) -> f64 {
        let from_m = self.at_m(from_s);
        let (path, first, point_m) = (self.path, self.segment, point_m.xz());
        let later = &path.corners[first + 1..];
        let last = first + later.partition_point(|corner| corner.time_s < to_s);
        let to_m = path.on_segment(last, to_s);
        let near = |from_m, to_m| squared_distance_m2(point_m, plane_segment(from_m, to_m));
        if first == last {
            return near(from_m, to_m).sqrt();
        }
        // The path consists of parts of the first and last segment, and all segments between them.
        let ends_m2 = near(from_m, path.end_m(first)).min(near(path.end_m(last - 1), to_m));
        let segments = &path.segments;
        let inner_m2 =
            noctograph_core::dispatch!(|| segments.squared_distance_m2(point_m, first + 1..last));
        ends_m2.min(inner_m2).sqrt()
    }
}

impl DesignPath {
    /// Returns the end of the segment that begins at a corner.
    fn end_m(&self, index: usize) -> Vector3<f64> {
        let end_s = self.corners.get(index + 1).map_or(f64::INFINITY, |end| end.time_s);
        self.on_segment(index, end_s)
    }

    /// Returns the position at a time on the segment after a corner, or the nearer end outside it.
    fn on_segment(&self, index: usize, time_s: f64) -> Vector3<f64> {
        let start = self.corners[index];
        let Some(end) = self.corners.get(index + 1) else { return start.at_m };
        let lasts_s = end.time_s - start.time_s;
        let fraction = if lasts_s > 0.0 { (time_s - start.time_s) / lasts_s } else { 1.0 };
        start.at_m + (end.at_m - start.at_m) * fraction.clamp(0.0, 1.0)
    }
}

/// Removes the corners that are within [`TOLERANCE_M`] of a straight segment of constant speed
/// between others, by swinging-door compression (Bristol 1990).
fn without_even_corners(corners: impl Iterator<Item = Corner>) -> Vec<Corner> {
    let mut kept: Vec<Corner> = Vec::new();
    let mut last: Option<Corner> = None;
    let mut chords = Chords::ALL;
    for corner in corners {
        let Some(before) = last.replace(corner) else {
            kept.push(corner);
            continue;
        };
        // If no velocity passes all samples, the segment ends at the previous sample and another
        // begins.
        let since = |start: &Corner| (corner.at_m - start.at_m, corner.time_s - start.time_s);
        let (step_m, lasts_s) = since(&kept[kept.len() - 1]);
        if corner.time_s <= before.time_s || !chords.contain(step_m.into(), lasts_s) {
            kept.push(before);
            chords = Chords::ALL;
        }
        // Only velocities that pass this sample within the tolerance remain.
        let (step_m, lasts_s) = since(&kept[kept.len() - 1]);
        if lasts_s > 0.0 {
            let slack_m = Vector3::repeat(TOLERANCE_M);
            chords.keep_between((step_m - slack_m).into(), (step_m + slack_m).into(), lasts_s);
        }
    }
    kept.extend(last);
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracking::constructed::{flight, still};

    #[test]
    fn a_straight_stroke_is_one_segment_and_a_step_is_another() {
        // The design moves right for a second, steps up, and then waits.
        fn design(t: f64) -> Vector3<f64> {
            match t {
                t if t <= 1.0 => Vector3::new(0.2 * t, 0.0, 0.5),
                _ => Vector3::new(0.2, 0.0, 0.6),
            }
        }
        let path = DesignPath::new(&flight(0.01, 2.0, design, design)).unwrap();
        let times_s: Vec<f64> = path.corners.iter().map(|corner| corner.time_s).collect();
        assert_eq!(times_s, [0.0, 1.0, 1.01, 2.0]);
        let mut walk = path.walk();
        for k in 0..=400 {
            let t = f64::from(k) * 0.005;
            let expected = if t <= 1.0 { design(t) } else { walk.at_m(t) };
            assert!((walk.at_m(t) - expected).norm() < 1e-12, "at {t} s");
        }
        assert_eq!(walk.at_m(9.0), Vector3::new(0.2, 0.0, 0.6), "held after its end");
    }

    #[test]
    fn distance_is_only_to_the_named_stretch() {
        // The design moves right at z = 0.5 for a second, and up for another.
        let design = |t: f64| Vector3::new(t.min(1.0), 0.0, 0.5 + (t - 1.0).max(0.0));
        let path = DesignPath::new(&flight(0.01, 2.0, design, design)).unwrap();
        let point = Vector3::new(0.9, 7.0, 1.0);
        let near = |span| path.walk().distance_m(point, span);
        assert!((near([0.0, 2.0]) - 0.1).abs() < 1e-9, "to the upright: {}", near([0.0, 2.0]));
        assert!((near([0.0, 1.0]) - 0.5).abs() < 1e-9, "to the base: {}", near([0.0, 1.0]));
        assert!((near([0.2, 0.2]) - libm::hypot(0.7, 0.5)).abs() < 1e-9, "to a point");
    }

    #[test]
    fn a_design_of_zeros_is_none() {
        assert!(DesignPath::new(&flight(0.01, 1.0, |_| Vector3::x(), still)).is_none());
        assert!(DesignPath::new(&Flight::default()).is_none());
    }
}
