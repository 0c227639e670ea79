//! Locates a word in a photo without a known camera.
//!
//! The letters found by [`read`](super::read) are matched with the word's cells: one by one if
//! there are equally many, and otherwise only the first and the last. The camera is assumed to face
//! the plane, with separate horizontal and vertical scales and a sloping line.

use super::reader::lit_bounds_m;
use super::reading::Reading;
use super::view::{Homography, View};
use noctograph_core::geometry::bounds;
use noctograph_core::photo::Photo;
use noctograph_core::statistics::median;
use noctograph_core::strokes::Strokes;

/// Maximum ratio between the horizontal and the vertical scale.
const MAX_STRETCH: f64 = 2.5;

/// Maximum slope of a line.
const MAX_SLOPE: f64 = 0.3;

/// Returns the view that maps a word onto the writing in a photo. Returns `None` if there is no
/// writing or if the two scales differ too much.
pub fn find_word(photo: &Photo, reading: &Reading, strokes: &Strokes) -> Option<View> {
    let boxes = strokes.glyphs.chunks(1).map(lit_bounds_m);
    let boxes: Vec<[f64; 4]> = boxes.filter(|[left, _, right, _]| left <= right).collect();
    let letters = &reading.letters;
    let [first_box, last_box] = [boxes.first()?, boxes.last()?];
    let [first, last] = [letters.first()?, letters.last()?];
    // Horizontally, letter edges in the photo are fitted by a linear function of the intended ones.
    let mut edges: Vec<[f64; 2]> = Vec::new();
    if letters.len() == boxes.len() {
        for (plane, letter) in boxes.iter().zip(letters) {
            edges.extend([[plane[0], letter.box_px[0]], [plane[2], letter.box_px[2]]]);
        }
    } else {
        edges.extend([[first_box[0], first.box_px[0]], [last_box[2], last.box_px[2]]]);
    }
    let (x_px_at_zero, px_per_m_across) = line_through(&edges)?;
    // Vertically, the median height of the letters is taken as the word's height.
    let corners = boxes.iter().flat_map(|plane| [[plane[0], plane[1]], [plane[2], plane[3]]]);
    let [_, bottom, _, top] = bounds(corners);
    let letter_height_px =
        median(letters.iter().map(|letter| letter.box_px[3] - letter.box_px[1])).expect("letters");
    let px_per_m_down = letter_height_px / (top - bottom);
    // Computes the slope of the line of writing, and its height in the photo at x = 0.
    let middles = letters.iter().map(|letter| {
        let [left, top, right, bottom] = letter.box_px;
        [0.5 * (left + right), 0.5 * (top + bottom)]
    });
    let middles: Vec<[f64; 2]> = middles.collect();
    // Two letters, of which one may have a tail, do not determine a slope.
    let fitted = if letters.len() < 3 { 0.0 } else { median_slope(&middles) };
    let slope = fitted.clamp(-MAX_SLOPE, MAX_SLOPE);
    let line_y_px = median(middles.iter().map(|[x, y]| y - slope * x)).expect("letters");

    let stretch = (px_per_m_across / px_per_m_down).max(px_per_m_down / px_per_m_across);
    if !(px_per_m_across > 0.0 && px_per_m_down > 0.0 && stretch <= MAX_STRETCH) {
        return None;
    }
    let [left, right] = [first_box[0], last_box[2]];
    let corners = [(left, 1.0), (right, 1.0), (right, -1.0), (left, -1.0)].map(|(x_m, above)| {
        let x_px = x_px_at_zero + px_per_m_across * x_m;
        [x_px, line_y_px + slope * x_px - 0.5 * above * letter_height_px]
    });
    let size_px = [photo.width_px, photo.height_px];
    // A single I has no area, so its corners determine no view.
    Homography::from_corners([left, bottom, right, top], corners, size_px).ok().map(View::Plane)
}

/// Returns the median slope, y over x, of all pairs of points (Theil 1950, Sen 1968), on which an
/// outlier such as the tail of a letter has little influence.
fn median_slope(points: &[[f64; 2]]) -> f64 {
    let pairs = (0..points.len()).flat_map(|a| (0..a).map(move |b| (points[a], points[b])));
    let apart = pairs.filter(|(a, b)| a[0] != b[0]);
    median(apart.map(|(a, b)| (a[1] - b[1]) / (a[0] - b[0]))).unwrap_or(0.0)
}

/// Fits a line by least squares, and returns its value at zero and its slope, or `None` if all
/// points have the same x.
fn line_through(points: &[[f64; 2]]) -> Option<(f64, f64)> {
    let n = points.len() as f64;
    let [x, y] = [0, 1].map(|axis| points.iter().map(|p| p[axis]).sum::<f64>() / n);
    let variance: f64 = points.iter().map(|p| (p[0] - x) * (p[0] - x)).sum();
    let slope = points.iter().map(|p| (p[0] - x) * (p[1] - y)).sum::<f64>() / variance;
    (variance > 0.0 && slope.is_finite()).then_some((y - slope * x, slope))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_letter_with_a_tail_does_not_turn_the_line() {
        let tail = [[0.0, 1.0], [1.0, 1.0], [2.0, 1.0], [3.0, 1.0], [4.0, 9.0]];
        let slanting = [[0.0, 0.0], [1.0, 0.5], [3.0, 1.5]];
        assert_eq!([median_slope(&tail), median_slope(&slanting)], [0.0, 0.5]);
        assert_eq!(median_slope(&[[1.0, 0.0], [1.0, 2.0]]), 0.0, "letters one above the other");
    }
}
