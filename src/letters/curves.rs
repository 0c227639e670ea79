//! Converts Bézier paths to polylines.

use std::collections::BTreeSet;

use kurbo::{BezPath, PathEl, Point};

use super::vector::{Lines, coordinates, pairs};

/// Returns a polyline along each subpath, within a tolerance of its curves in the path's unit. A
/// closed line repeats its first point. Returns `None` if there are over `max_points` points or one
/// is not finite.
pub(super) fn polylines(path: &BezPath, tolerance: f64, max_points: usize) -> Option<Lines> {
    if !path.is_finite() {
        return None;
    }
    let mut lines = Lines::new();
    let mut n_points = 0;
    kurbo::flatten(path, tolerance, |element| {
        n_points += 1;
        if n_points > max_points {
            return;
        }
        match element {
            PathEl::MoveTo(point) => lines.push(vec![point]),
            PathEl::LineTo(point) => lines.last_mut().expect("a path moves first").push(point),
            PathEl::ClosePath => {
                let line = lines.last_mut().expect("a path moves first");
                let first = line[0];
                if line[line.len() - 1] != first {
                    line.push(first);
                }
                // If no move follows, the next subpath starts where the closed one started.
                lines.push(vec![first]);
            }
            PathEl::QuadTo(..) | PathEl::CurveTo(..) => unreachable!("flattened"),
        }
    });
    lines.retain(|line| line.len() > 1);
    (n_points <= max_points).then_some(lines)
}

/// Rounds the points of a path's polylines to a grid, except the path's own points. kurbo splits
/// curves with the platform's `pow`, whose last bits differ, so strokes would differ in a browser.
/// The tolerance is that of [`polylines`].
pub(super) fn on_grid(mut lines: Lines, path: &BezPath, tolerance: f64) -> Vec<Vec<[f64; 2]>> {
    let end_points = path.elements().iter().filter_map(PathEl::end_point);
    let exact: BTreeSet<[u64; 2]> = end_points.map(bits).collect();
    /// Steps of the grid within the tolerance: invisible, but far above the last bits.
    const STEPS: f64 = 1024.0;
    let step = tolerance / STEPS;
    for point in lines.iter_mut().flatten().filter(|point| !exact.contains(&bits(**point))) {
        let [x, y] = coordinates(*point).map(|value| (value / step).round() * step);
        *point = Point::new(x, y);
    }
    pairs(lines)
}

/// Returns the bits of a point's coordinates, which can be sorted.
fn bits(point: Point) -> [u64; 2] {
    coordinates(point).map(f64::to_bits)
}

/// Splits a path into subpaths, each with its first point and its other elements. If no move
/// follows a closed subpath, the next subpath has the same first point.
pub(super) fn subpaths(path: &BezPath) -> Vec<(Point, Vec<PathEl>)> {
    let mut subpaths: Vec<(Point, Vec<PathEl>)> = Vec::new();
    for element in path.elements() {
        match (*element, subpaths.last_mut()) {
            (PathEl::MoveTo(point), _) => subpaths.push((point, Vec::new())),
            (element, Some((first, elements))) if elements.last() == Some(&PathEl::ClosePath) => {
                let first = *first;
                subpaths.push((first, vec![element]));
            }
            (element, Some((_, elements))) => elements.push(element),
            (_, None) => {}
        }
    }
    subpaths
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_is_off_by_less_than_the_tolerance_and_closed() {
        use kurbo::Shape as _;
        let circle = kurbo::Circle::new((1.0, 2.0), 3.0).to_path(1e-9);
        let lines = polylines(&circle, 1e-3, 1000).unwrap();
        assert_eq!((lines.len(), lines[0][0]), (1, lines[0][lines[0].len() - 1]));
        for leg in lines[0].windows(2) {
            let error = 3.0 - leg[0].midpoint(leg[1]).distance((1.0, 2.0).into());
            assert!(error.abs() <= 1.1e-3, "{error}");
        }
        assert!(polylines(&circle, 1e-3, 10).is_none(), "too many points");
    }

    #[test]
    fn points_of_curves_lie_on_a_grid_and_ends_stay() {
        let path = BezPath::from_svg("M0.1,0 L0.3,0.7 C1,2 3,4 5.5,0.9").unwrap();
        let lines = polylines(&path, 1e-3, 1000).unwrap();
        // Changes the last bit of a point on the curve, as another platform might.
        let mut other = lines.clone();
        other[0][5].x = other[0][5].x.next_up();
        assert_ne!(lines, other);
        let [here, there] = [lines.clone(), other].map(|lines| on_grid(lines, &path, 1e-3));
        assert_eq!(here, there);
        let moved = lines[0].iter().zip(&here[0]).map(|(a, b)| a.distance(Point::new(b[0], b[1])));
        assert!(moved.fold(0.0, f64::max) <= 1e-6, "a thousandth of the tolerance");
        assert_eq!([here[0][0], here[0][1]], [[0.1, 0.0], [0.3, 0.7]]);
        assert_eq!(here[0][here[0].len() - 1], [5.5, 0.9]);
    }

    #[test]
    fn a_path_goes_on_from_the_start_of_its_closed_part() {
        let path = BezPath::from_svg("M0,0 L1,0 L1,1 Z L0,5").unwrap();
        let lines = polylines(&path, 0.1, 100).unwrap();
        assert_eq!(
            pairs(lines),
            [vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]], vec![[0.0, 0.0], [0.0, 5.0]]]
        );
    }
}
