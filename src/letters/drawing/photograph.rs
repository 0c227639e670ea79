//! Photographs: their long edges.
//!
//! Edges are where the brightness, blurred, changes most: zeros of its Laplacian (Marr and
//! Hildreth, Proc. R. Soc. B 207, 1980), followed by marching squares, so that they are lines with
//! no thinning. They are kept where the gradient is strong, and along as far as it is not weak
//! (Canny, IEEE Trans. PAMI 8, 1986). Of a picture at night, points of light are taken away first,
//! or where they stand densely made areas, by morphological openings and closings, whichever leaves
//! the wider edge; and what is dark counts by its logarithm.

use image::{DynamicImage, RgbImage};

use super::levels::{contours, morphed, softened};
use noctograph_core::geometry::{bounds, polyline_length_m};

/// Pixels of the longer side on which edges are sought.
const SIDE: u32 = 480;

/// Times that the brightness is averaged with its neighbors: a Gaussian of √(8/2) = 2 pixels.
const PASSES: usize = 8;

/// Shares of the pixels whose gradient is weak, not strong and below the strongest. Chosen by eye
/// on five photographs of scikit-image (astronaut, camera, coffee, rocket, cat).
const SHARES: [f64; 3] = [0.80, 0.93, 0.995];

/// Least strong gradient by the strongest one, and least gradient of the same edge by that: in a
/// picture of few edges, soft shades are none.
const STRONG: f64 = 0.3;
const WEAK: f64 = 0.4;

/// Least length of an edge by the longer side.
const SHORTEST: f64 = 0.03;

/// Least length of an edge at night by the longest one; and how much wider than the roofs behind
/// lights the rim of the lights is where that is drawn.
const STRAY: f64 = 0.25;
const WIDER: f64 = 1.25;

/// Most tone of most of a picture at night, and least ratio of its lights to that.
const NIGHT: f64 = 60.0;
const LIGHTS: f64 = 3.0;
/// Pixels from its middle up to which a point of light, and what is dark between two, reaches, from
/// small to large; and brightness that is noise.
const POINTS: [usize; 2] = [6, 9];
const NOISE: f64 = 8.0;

/// The edges of a photograph in its pixels, y up.
pub(super) fn edges(picture: &RgbImage) -> Vec<Vec<[f64; 2]>> {
    let longer = picture.width().max(picture.height());
    let mut small = DynamicImage::from(picture.clone());
    if longer > SIDE {
        small = small.thumbnail(SIDE, SIDE);
    }
    let small = small.into_luma8();
    let width = small.width() as usize;
    let scale = f64::from(longer) / f64::from(small.width().max(small.height()));
    let values: Vec<f64> = small.pixels().map(|pixel| f64::from(pixel.0[0])).collect();
    let mut edges = if is_night(&values) {
        // Lights are taken away, or where they stand densely become areas.
        let dark = edges_of(without_lights(&values, width, [f64::min, f64::max]), width);
        let lit = edges_of(without_lights(&values, width, [f64::max, f64::min]), width);
        let mut edges = if widest(&lit) > WIDER * widest(&dark) { lit } else { dark };
        let longest = edges.iter().map(|edge| polyline_length_m(edge)).fold(0.0, f64::max);
        edges.retain(|edge| polyline_length_m(edge) > STRAY * longest);
        edges
    } else {
        edges_of(values, width)
    };
    edges.iter_mut().flatten().for_each(|point| *point = point.map(|x| x * scale));
    edges
}

/// Width of the widest of some edges.
fn widest(edges: &[Vec<[f64; 2]>]) -> f64 {
    let width = |edge: &Vec<[f64; 2]>| {
        let [left, _, right, _] = bounds(edge.iter().copied());
        right - left
    };
    edges.iter().map(width).fold(0.0, f64::max)
}

/// Values, by their logarithm, without what is small and brighter or darker than all around it:
/// by opening first, or by closing.
fn without_lights(
    values: &[f64],
    width: usize,
    [first, second]: [fn(f64, f64) -> f64; 2],
) -> Vec<f64> {
    let mut values = values.to_vec();
    for steps in POINTS {
        values = morphed(&values, width, steps, first, second);
        values = morphed(&values, width, steps, second, first);
    }
    values.iter().map(|value| 50.0 * libm::log(NOISE + value)).collect()
}

/// The long edges of values.
fn edges_of(mut values: Vec<f64>, width: usize) -> Vec<Vec<[f64; 2]>> {
    let height = values.len() / width;
    for _ in 0..PASSES {
        values = softened(&values, width);
    }
    let (mut laplacian, mut gradient) = (vec![0.0; values.len()], vec![0.0; values.len()]);
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let at = y * width + x;
            let [left, right, above, below] =
                [at - 1, at + 1, at - width, at + width].map(|at| values[at]);
            laplacian[at] = left + right + above + below - 4.0 * values[at];
            gradient[at] = libm::hypot(right - left, below - above);
        }
    }
    let mut sorted = gradient.clone();
    sorted.sort_by(f64::total_cmp);
    let [weak, strong, strongest] = SHARES.map(|share| {
        #[expect(clippy::cast_possible_truncation, reason = "an index")]
        let rank = (share * sorted.len() as f64) as usize;
        sorted[rank]
    });
    let strong = strong.max(STRONG * strongest);
    let weak = weak.max(WEAK * strong);
    #[expect(clippy::cast_possible_truncation, reason = "in the picture")]
    let strength = |[x, y]: &[f64; 2]| gradient[(-y).round() as usize * width + x.round() as usize];
    let least = SHORTEST * width.max(height) as f64;
    let mut edges = Vec::new();
    for mut contour in contours(&laplacian, [width, height], 0.0) {
        // A closed contour begins where it is weak, so that no edge is cut in two.
        if let Some(gap) = contour.iter().position(|point| strength(point) <= weak) {
            contour.rotate_left(gap);
        } else {
            contour.push(contour[0]);
        }
        for edge in contour.split(|point| strength(point) <= weak) {
            let strongest = edge.iter().map(strength).fold(0.0, f64::max);
            if strongest > strong && polyline_length_m(edge) > least {
                edges.push(edge.to_vec());
            }
        }
    }
    edges
}

fn is_night(values: &[f64]) -> bool {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let [most, lights] = [500, 997].map(|share| sorted[share * (sorted.len() - 1) / 1000]);
    most < NIGHT && lights > LIGHTS * most.max(NOISE)
}
