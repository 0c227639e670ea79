//! Stored strokes: faces for plotters and engravers whose contours are strokes instead of outlines.
//!
//! TrueType contours are always closed. A single stroke is stored either as an open line, which the
//! format closes with a straight edge, or as a line there and back. Such strokes are drawn once.

use kurbo::{BezPath, PathEl, Point, Shape as _};

use super::curves::{polylines, subpaths};
use super::vector::{Lines, length, unit};

/// Characters with straight strokes. In an outline face, none of them has a contour without area.
/// The second set serves script faces, whose letters may be curves.
pub(super) const SIGNS: [&str; 2] = ["HTIXLEFKANMVYZl|-/+=_", "|-/_"];

/// Maximum mean width of a contour without area, relative to the larger side of its box.
const THIN: f64 = 1e-3;

/// Maximum difference between the forward and the return length, relative to the forward length.
const LENGTHS_APART: f64 = 0.01;

/// Cosine of the minimum turn at which a line reverses its direction.
const BACK: f64 = -0.999;

/// True if more than half of the outlines have a contour without area.
pub(super) fn are_strokes(outlines: &[BezPath]) -> bool {
    let has_thin = |outline: &&BezPath| contours(outline).any(|contour| is_thin(&contour));
    2 * outlines.iter().filter(has_thin).count() > outlines.len()
}

/// True if a closed contour has almost no mean width (twice its area divided by its length)
/// compared with its larger side.
fn is_thin(contour: &BezPath) -> bool {
    /// Accuracy of the length, in font units or cap heights.
    const ACCURACY: f64 = 1e-3;
    let mut closed = contour.clone();
    closed.close_path();
    let (area, length, bounds) =
        (closed.area().abs(), closed.perimeter(ACCURACY), closed.bounding_box());
    length > 0.0 && 2.0 * area <= THIN * length * bounds.width().max(bounds.height())
}

/// Returns the strokes of a path, one for each contour, or `None` if they have more than
/// `max_points`. They are within a tolerance of the curves, in the path's unit.
pub(super) fn strokes(path: &BezPath, tolerance: f64, max_points: usize) -> Option<Lines> {
    let mut strokes = Lines::new();
    let mut n_points_left = max_points;
    for contour in contours(path) {
        for mut line in polylines(&contour, tolerance, n_points_left)? {
            n_points_left = n_points_left.saturating_sub(line.len());
            line.dedup();
            if line.len() > 1 {
                strokes.push(if is_thin(&contour) { without_return(line) } else { line });
            }
        }
    }
    Some(strokes)
}

/// Returns the contours of a path as open paths, without their closing edges.
fn contours(path: &BezPath) -> impl Iterator<Item = BezPath> {
    let contours = subpaths(path).into_iter().map(|(first, mut elements)| {
        elements.retain(|element| *element != PathEl::ClosePath);
        BezPath::from_vec([&[PathEl::MoveTo(first)][..], &elements].concat())
    });
    contours.filter(|contour| contour.elements().len() > 1)
}

/// Returns half of a line that goes back along itself: the part between its two turns. Any other
/// line is returned unchanged.
fn without_return(line: Vec<Point>) -> Vec<Point> {
    // The cycle contains each point once.
    let mut cycle = line.clone();
    if cycle[0] == cycle[cycle.len() - 1] {
        cycle.pop();
    }
    let n = cycle.len();
    let turns = Vec::from_iter((0..n).filter(|index| {
        let [before, here, after] = [n - 1, 0, 1].map(|step| cycle[(index + step) % n]);
        unit(here - before).dot(unit(after - here)) < BACK
    }));
    let [from, to] = turns[..] else { return line };
    let (there, back) = (&cycle[from..=to], [&cycle[to..], &cycle[..=from]].concat());
    let [there_length, back_length] = [there, &back].map(line_length);
    // An open line may go back along only a part of itself.
    if (there_length - back_length).abs() <= LENGTHS_APART * there_length {
        there.to_vec()
    } else {
        line
    }
}

/// Returns the length of a polyline.
fn line_length(line: &[Point]) -> f64 {
    line.windows(2).map(|pair| length(pair[1] - pair[0])).sum()
}

#[cfg(test)]
mod tests {
    use super::super::vector::pairs;
    use super::*;

    fn stored(svg: &str) -> Vec<Vec<[f64; 2]>> {
        pairs(strokes(&BezPath::from_svg(svg).unwrap(), 0.01, 1000).unwrap())
    }

    #[test]
    fn a_contour_is_a_stroke_with_the_ends_that_it_has() {
        assert_eq!(stored("M0 7L0 0L4 0Z"), [[[0.0, 7.0], [0.0, 0.0], [4.0, 0.0]]], "open");
        assert_eq!(stored("M0 7L4 7Z M2 7L2 0Z").len(), 2);
        let round = stored("M0 0L4 0L4 4L0 4L0 0Z");
        assert_eq!(round[0][0], round[0][4], "closed as it is stored");
        let back = [[0.0, 7.0], [2.0, 0.0], [4.0, 7.0]];
        assert_eq!(stored("M0 7L2 0L4 7L2 0Z"), [back], "there and back");
        assert_eq!(stored("M2 0L4 7L2 0L0 7Z").len(), 1, "from its middle");
        assert_eq!(stored("M2 0L4 7L2 0L0 7Z")[0].len(), 3);
        let curve = stored("M0 0C1 2 3 2 4 0C3 2 1 2 0 0Z");
        assert_eq!((curve.len(), curve[0][0]), (1, [0.0, 0.0]));
        assert_eq!(curve[0][curve[0].len() - 1], [4.0, 0.0], "a curve, once");
    }

    #[test]
    fn faces_of_strokes_are_told_from_faces_of_outlines() {
        fn is_stroked(glyphs: &[&str]) -> bool {
            let paths: Vec<BezPath> =
                glyphs.iter().map(|svg| BezPath::from_svg(svg).unwrap()).collect();
            are_strokes(&paths)
        }
        let (h, l) = ("M0 7L0 0Z M0 3L4 3Z M4 7L4 0Z", "M0 7L0 0L4 0Z");
        assert!(is_stroked(&[h, "M0 7L4 7Z M2 7L2 0Z", l]));
        let (bar, solid) = ("M0 0H1V7H0Z", "M0 0H4V1H1V7H0Z");
        assert!(!is_stroked(&[bar, solid, h]), "one odd glyph makes no such face");
        assert!(!is_stroked(&[]));
    }
}
