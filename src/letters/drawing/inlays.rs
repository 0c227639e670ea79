//! Inlays: areas of another color within an area of ink, such as a star in a disc.

use super::ink::{Field, RIM};
use super::levels::{connected, contours, histogram, quantile};
use super::regions::BLUR;
use crate::outline::Contour;

/// Least area of ink that is looked into and of an inlay, as squares of the picture's longer side.
const LEAST: [f64; 2] = [0.04, 0.012];
/// Least difference of an inlay's color from its area's.
const APART: f64 = 0.2;
/// Share of an inlay's rim along which its area lies: what is beside it is no inlay.
const WITHIN: f64 = 0.6;
/// Most pixels between an inlay and its area, by its rim: shades have no sharp one.
const SHARP: f64 = 3.0;
/// Most inlays of a drawing: more are its texture.
const MOST: usize = 24;

/// An inlay: its contours, and what its ink leaves of red, green and blue.
pub(super) type Inlay = (Vec<Contour>, [f64; 3]);

/// The inlays of all areas of ink, and whether they are so many that none is drawn.
pub(super) fn inlays(field: &Field) -> (Vec<Inlay>, bool) {
    let side = field.width.max(field.height) as f64;
    let least = LEAST.map(|share| share * side * share * side);
    let inked = |at: usize| field.ink[at] > RIM;
    let mut open: Vec<bool> = (0..field.ink.len()).map(inked).collect();
    let mut is_inner = vec![false; field.ink.len()];
    let mut found = Vec::new();
    for start in 0..open.len() {
        let area = connected(start, &mut open, field.width);
        if (area.len() as f64) < least[0] {
            continue;
        }
        let within = |at: &usize| field.around(*at, BLUR).all(inked);
        let inner: Vec<usize> = area.into_iter().filter(within).collect();
        if (inner.len() as f64) < least[0] {
            continue;
        }
        let own = median(&inner, field);
        let off = |at: usize| apart(field.color[at], own);
        inner.iter().for_each(|at| is_inner[*at] = true);
        let others: Vec<usize> = inner.iter().copied().filter(|at| off(*at) > APART).collect();
        // All ink up to here is of areas that are done, so that its marks are free.
        others.iter().for_each(|at| open[*at] = true);
        for start in others {
            let part = connected(start, &mut open, field.width);
            if (part.len() as f64) < least[1] || found.len() > MOST {
                continue;
            }
            let color = median(&part, field);
            let most = apart(color, own);
            let mut values = vec![0.0; field.ink.len()];
            for at in part.iter().flat_map(|at| field.around(*at, BLUR)) {
                values[at] = if is_inner[at] { (off(at) / most).min(1.0) } else { 0.0 };
            }
            let is_other = |at: usize| is_inner[at] && off(at) > APART;
            let beside = part.iter().flat_map(|at| field.around(*at, 1));
            let rim: Vec<usize> = beside.filter(|at| !is_other(*at)).collect();
            let n_within = rim.iter().filter(|at| is_inner[**at]).count();
            let n_between = values.iter().filter(|value| (0.25..0.75).contains(*value)).count();
            let at_rim = |at: &&usize| field.around(**at, 1).any(|at| !is_other(at));
            let length = part.iter().filter(at_rim).count();
            if n_within as f64 >= WITHIN * rim.len() as f64
                && (n_between as f64) < SHARP * length as f64
            {
                found.push((contours(&values, [field.width, field.height], RIM), color));
            }
        }
        inner.iter().for_each(|at| is_inner[*at] = false);
    }
    let too_many = found.len() > MOST;
    (if too_many { Vec::new() } else { found }, too_many)
}

/// The largest difference of two colors in a channel.
fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f64::max)
}

/// The color of most of some pixels.
fn median(pixels: &[usize], field: &Field) -> [f64; 3] {
    [0, 1, 2].map(|c| {
        let counts = histogram(pixels.iter().map(|at| 255.0 * field.color[*at][c]));
        quantile(&counts, 0.5) as f64 / 255.0
    })
}
