//! Path of the design over time, in straight segments of constant speed.

use std::ops::Range;

use nalgebra::{Vector2, Vector3};

use noctograph_core::flight::Flight;
use noctograph_core::geometry::Chords;

/// Maximum distance per axis, in m, of an omitted sample from its segment. With twice the file's
/// rounding unit, a straight stroke becomes a single segment.
const TOLERANCE_M: f64 = 2e-6;

/// Position of the design over time, which is constant before the first and after the last sample.
#[derive(Clone, Debug)]
pub struct DesignPath {
    corners: Vec<Corner>,
    /// Segments, one per corner, each from the end of the previous segment to its own end.
    segments: Segments,
}

/// Segments in one column for each number of [`plane_segment`], and the bounding box of each block
/// of [`LANES`] segments: left, bottom, right and top.
#[derive(Clone, Debug, Default)]
struct Segments {
    columns: [Vec<f64>; 5],
    boxes_m: Vec<[f64; 4]>,
}

/// Number of segments whose distances are computed together.
const LANES: usize = 8;

/// Minimum distance in m by which skipped segments are farther than the nearest one.
/// Distances are rounded.
const ROUNDING_M: f64 = 1e-9;

impl Segments {
    /// Adds a segment of the plane (start x and z, step x and z, and squared length) at the end of
    /// the path.
    fn push(&mut self, segment: [f64; 5]) {
        let [x, z, step_x, step_z, _] = segment;
        if self.columns[0].len().is_multiple_of(LANES) {
            self.boxes_m.push([x, z, x, z]);
        }
        if let Some([left, bottom, right, top]) = self.boxes_m.last_mut() {
            for (x, z) in [(x, z), (x + step_x, z + step_z)] {
                (*left, *right) = (left.min(x), right.max(x));
                (*bottom, *top) = (bottom.min(z), top.max(z));
            }
        }
        self.columns.iter_mut().zip(segment).for_each(|(column, value)| column.push(value));
    }

    /// Returns the squared distance in m² from a point to the nearest of several consecutive
    /// segments.
    ///
    /// The search goes from the middle to both ends. It skips the blocks of segments whose bounding
    /// box is farther away than the nearest segment so far.
    #[inline(always)]
    fn squared_distance_m2(&self, point_m: Vector2<f64>, range: Range<usize>) -> f64 {
        let blocks = range.start / LANES..range.end.div_ceil(LANES);
        let middle = (range.start + range.len() / 2) / LANES;
        let (mut least_m2, mut limit_m2) = (f64::INFINITY, f64::INFINITY);
        for block in (middle..blocks.end).chain((blocks.start..middle).rev()) {
            let [left, bottom, right, top] = self.boxes_m[block];
            let x = (left - point_m.x).max(point_m.x - right).max(0.0);
            let z = (bottom - point_m.y).max(point_m.y - top).max(0.0);
            if x * x + z * z > limit_m2 {
                continue;
            }
            let first = (block * LANES).max(range.start);
            let end = ((block + 1) * LANES).min(range.end);
            let block_m2 = self.nearest_m2(point_m, first..end);
            if block_m2 < least_m2 {
                let limit_m = block_m2.sqrt() + ROUNDING_M;
                (least_m2, limit_m2) = (block_m2, limit_m * limit_m);
            }
        }
        least_m2
    }

    /// Returns the squared distance in m² of a point from the nearest of at most [`LANES`]
    /// segments.
    #[inline(always)]
    fn nearest_m2(&self, point_m: Vector2<f64>, range: Range<usize>) -> f64 {
        let columns = self.columns.each_ref().map(|column| &column[range.clone()]);
        if let [Some(a), Some(b), Some(c), Some(d), Some(e)] =
            columns.map(|column| column.first_chunk::<LANES>())
        {
            let squares_m2: [f64; LANES] = std::array::from_fn(|lane| {
                squared_distance_m2(point_m, [a[lane], b[lane], c[lane], d[lane], e[lane]])
            });
            return squares_m2.into_iter().fold(f64::INFINITY, f64::min);
        }
        let squares_m2 = (0..range.len())
            .map(|row| squared_distance_m2(point_m, columns.map(|column| column[row])));
        squares_m2.fold(f64::INFINITY, f64::min)
    }
}

/// Returns a segment in the x-z plane as five numbers, its first point, vector and squared length.
fn plane_segment(from_m: Vector3<f64>, to_m: Vector3<f64>) -> [f64; 5] {
    let step_m = (to_m - from_m).xz();
    [from_m.x, from_m.z, step_m.x, step_m.y, step_m.norm_squared()]
}

/// Returns the squared distance in m² of a point from a segment, given by its start, step and
/// squared length.
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

/// Position of the design at one time.
#[derive(Clone, Copy, Debug)]
struct Corner {
    time_s: f64,
    at_m: Vector3<f64>,
}

impl DesignPath {
    /// Creates the path of a flight's design. Returns `None` for a flight without one.
    pub fn new(flight: &Flight) -> Option<Self> {
        let corners = flight.samples.iter().map(|sample| (sample.time_s, sample.design_m));
        Self::exists(flight).map(|()| Self::through(corners))
    }

    /// Returns `None` for a flight without samples, or with a design that is zero throughout, as in
    /// a log without setpoints.
    pub(crate) fn exists(flight: &Flight) -> Option<()> {
        let mut samples = flight.samples.iter();
        samples.any(|sample| sample.design_m != Vector3::zeros()).then_some(())
    }

    /// Creates the path through at least one point, given in chronological order.
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

    /// Returns a cursor for positions at the beginning of the path.
    pub fn walk(&self) -> Walk<'_> {
        Walk { path: self, segment: 0 }
    }
}

/// Cursor along a path for times that do not decrease, which avoids a search.
#[derive(Debug)]
pub struct Walk<'a> {
    path: &'a DesignPath,
    segment: usize,
}

impl Walk<'_> {
    /// Returns the position of the design at `time_s`.
    pub fn at_m(&mut self, time_s: f64) -> Vector3<f64> {
        let segment = self.segment_at(time_s);
        self.path.on_segment(segment, time_s)
    }

    /// Returns the position in m of the design at `time_s` in the x-z plane. Times must not
    /// decrease between calls.
    pub fn at_in_plane_m(&mut self, time_s: f64) -> Vector2<f64> {
        let segment = self.segment_at(time_s);
        let (start, end) = self.path.ends(segment);
        let Some(end) = end else { return start.at_m.xz() };
        let (from_m, to_m) = (start.at_m.xz(), end.at_m.xz());
        from_m + (to_m - from_m) * fraction(start, end, time_s)
    }

    /// Returns the index of the segment at `time_s`, which must not decrease between calls.
    #[inline(always)]
    fn segment_at(&mut self, time_s: f64) -> usize {
        let corners = &self.path.corners;
        while corners.get(self.segment + 1).is_some_and(|next| next.time_s <= time_s) {
            self.segment += 1;
        }
        self.segment
    }

    /// Returns the distance in m in the x-z plane from a point to the design's path between two
    /// times. The first time must not decrease between calls.
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
        // The path consists of parts of the first and last segments, and all segments between them.
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

    /// Returns the position in m at a time on the segment after a corner, or the nearer end outside
    /// it.
    fn on_segment(&self, index: usize, time_s: f64) -> Vector3<f64> {
        let (start, end) = self.ends(index);
        let Some(end) = end else { return start.at_m };
        start.at_m + (end.at_m - start.at_m) * fraction(start, end, time_s)
    }

    /// Returns the corner at the start of a segment and the corner at its end. The last segment has
    /// no end.
    #[inline(always)]
    fn ends(&self, index: usize) -> (&Corner, Option<&Corner>) {
        (&self.corners[index], self.corners.get(index + 1))
    }
}

/// Returns the fraction, 0 to 1, of the way between two corners at a time.
#[inline(always)]
fn fraction(start: &Corner, end: &Corner, time_s: f64) -> f64 {
    let lasts_s = end.time_s - start.time_s;
    let fraction = if lasts_s > 0.0 { (time_s - start.time_s) / lasts_s } else { 1.0 };
    fraction.clamp(0.0, 1.0)
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
        // If no velocity passes close to all samples, the segment ends at the previous sample.
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
    fn skipped_segments_are_never_the_nearest() {
        // The path bends, stops, steps and crosses itself. The points are near and far.
        let bend = |t: f64| Vector3::new(libm::sin(3.0 * t), 0.0, libm::cos(2.0 * t * t.min(2.0)));
        let design = |t: f64| bend(if t < 1.0 { t } else { t.max(1.5) } + (10.0 * t).floor());
        let path = DesignPath::new(&flight(0.002, 4.0, design, design)).unwrap();
        assert!(path.corners.len() > 1000, "{} corners", path.corners.len());
        for k in 0..500 {
            let (k, spread) = (f64::from(k), 0.02 + f64::from(k % 7) * 0.3);
            let point = Vector2::new(libm::sin(k) * spread, libm::cos(1.7 * k) * spread);
            let first = whole(3.1 * k) % 900;
            let range = first..(first + 1 + whole(7.0 * k) % 600).min(path.corners.len());
            let every = range.clone().map(|n| path.segments.nearest_m2(point, n..n + 1));
            let wanted_m2 = every.fold(f64::INFINITY, f64::min);
            let actual_m2 = path.segments.squared_distance_m2(point, range.clone());
            assert_eq!(actual_m2.to_bits(), wanted_m2.to_bits(), "{point} to {range:?}");
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "a few thousand")]
    fn whole(number: f64) -> usize {
        number as usize
    }

    #[test]
    fn a_design_of_zeros_is_none() {
        assert!(DesignPath::new(&flight(0.01, 1.0, |_| Vector3::x(), still)).is_none());
        assert!(DesignPath::new(&Flight::default()).is_none());
    }
}
