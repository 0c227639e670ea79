//! Polylines in a plane, in any unit of length.

/// Returns the bounding box of points, as left, bottom, right, top. Without points, the box is
/// infinite, with left beyond right and bottom beyond top.
pub fn bounds(points: impl IntoIterator<Item = [f64; 2]>) -> [f64; 4] {
    let empty = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    points.into_iter().fold(empty, |[left, bottom, right, top], [x, y]| {
        [left.min(x), bottom.min(y), right.max(x), top.max(y)]
    })
}

/// Returns the distance between two points, in their unit.
pub fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(b[0] - a[0], b[1] - a[1])
}

/// Returns the distance of a point from a segment between two points, in the unit of the points.
pub fn segment_distance([x, y]: [f64; 2], [[ax, ay], [bx, by]]: [[f64; 2]; 2]) -> f64 {
    let (dx, dy) = (bx - ax, by - ay);
    let square = dx * dx + dy * dy;
    // The nearest point is the foot of the perpendicular, at the fraction t, or the nearer end.
    let t = if square > 0.0 { ((x - ax) * dx + (y - ay) * dy) / square } else { 0.0 };
    let t = t.clamp(0.0, 1.0);
    libm::hypot(x - ax - t * dx, y - ay - t * dy)
}

/// Returns the arc length from the first point of a line to each of its points, in the unit of the
/// points.
pub fn arc_lengths(line: &[[f64; 2]]) -> Vec<f64> {
    let mut arc_length = 0.0;
    let later = line.windows(2).map(|ends| {
        arc_length += distance(ends[0], ends[1]);
        arc_length
    });
    line.first().map(|_| 0.0).into_iter().chain(later).collect()
}

/// Returns the length of a polyline.
pub fn polyline_length_m(points_m: &[[f64; 2]]) -> f64 {
    points_m.windows(2).map(|ends| distance(ends[0], ends[1])).sum()
}

/// Returns the indices of the points that remain when a line is simplified to within `error`
/// (algorithm of Ramer, Douglas and Peucker). The unit of `error` is that of the points.
pub fn simplify(line: &[[f64; 2]], error: f64) -> Vec<usize> {
    if line.len() < 3 {
        return (0..line.len()).collect();
    }
    // Both ends of the line are kept. In each span between remaining points, the farthest point
    // remains and splits the span in two if its distance exceeds the error.
    let mut keep = vec![false; line.len()];
    (keep[0], keep[line.len() - 1]) = (true, true);
    let mut spans = vec![(0, line.len() - 1)];
    while let Some((first, last)) = spans.pop() {
        let inner = first + 1..last;
        let inner = inner.map(|i| (i, segment_distance(line[i], [line[first], line[last]])));
        let Some((index, distance)) = inner.max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        if distance > error {
            keep[index] = true;
            spans.extend([(first, index), (index, last)]);
        }
    }
    (0..line.len()).filter(|index| keep[*index]).collect()
}

/// Slopes, in each of N coordinates, of the chords from a first sample that stay within tolerance
/// of every skipped sample, as in swinging-door compression (Bristol 1990).
#[derive(Clone, Copy, Debug)]
pub struct Chords<const N: usize> {
    least: [f64; N],
    greatest: [f64; N],
}

impl<const N: usize> Chords<N> {
    /// Chords of any slope.
    pub const ALL: Self = Self { least: [f64::NEG_INFINITY; N], greatest: [f64::INFINITY; N] };

    /// Keeps only the chords whose offset after `elapsed_s`, a positive time, is between `low` and
    /// `high` on each axis.
    pub fn keep_between(&mut self, low: [f64; N], high: [f64; N], elapsed_s: f64) {
        for i in 0..N {
            self.least[i] = self.least[i].max(low[i] / elapsed_s);
            self.greatest[i] = self.greatest[i].min(high[i] / elapsed_s);
        }
    }

    /// True if these chords include the one to a sample at `offset` after `elapsed_s`, a positive
    /// time.
    pub fn contain(&self, offset: [f64; N], elapsed_s: f64) -> bool {
        (0..N).all(|i| (self.least[i]..=self.greatest[i]).contains(&(offset[i] / elapsed_s)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_simplified_line_keeps_within_the_error_and_a_straight_one_its_ends() {
        let line: Vec<_> = (0..=100).map(|k| [f64::from(k), 0.0]).collect();
        assert_eq!(simplify(&line, 1e-6), [0, 100]);
        assert_eq!(arc_lengths(&line)[100], 100.0);
        let arc = (0..=100).map(|k| <[f64; 2]>::from(libm::sincos(f64::from(k) * 0.01)));
        let arc: Vec<[f64; 2]> = arc.collect();
        let kept = simplify(&arc, 1e-3);
        assert!(kept.len() < 20, "{kept:?}");
        let error_of = |p: [f64; 2]| {
            let legs = kept.windows(2).map(|leg| [arc[leg[0]], arc[leg[1]]]);
            legs.map(|leg| segment_distance(p, leg)).fold(1.0, f64::min)
        };
        assert!(arc.iter().all(|p| error_of(*p) <= 1e-3), "within the error");
    }
}
