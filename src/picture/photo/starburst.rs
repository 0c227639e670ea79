//! Starburst: the spikes that the iris diffracts from points where a lamp dwells.
//!
//! A straight blade diffracts light into a spike perpendicular to it. As for a round iris, the
//! fraction `2 λ N / (π² r)` of a point's light lands farther than r from it. Straight blades
//! concentrate that light in spikes, so each of n spikes has `2 λ N / (π² n r²)` per unit length.
//! The spikes of a moving lamp are too faint to be visible, so only lamps at rest get spikes. The
//! light of the spikes is subtracted from the point.
//!
//! The light of a spike in a pixel is rounded down to an integer. The color-dependent fine
//! structure of spikes is not modeled.

use glam::DVec2;

use super::glare::{CELL_PX, WHOLE, cells};
use super::kernel::Plane;
use crate::expose::Film;
use crate::whole;
use noctograph_core::camera::Camera;

/// Wavelengths of red, green and blue LEDs.
const WAVELENGTH_M: [f64; 3] = [620e-9, 525e-9, 465e-9];

/// Minimum light of a point with visible spikes, in units of a saturated pixel.
const BRIGHT_PX: f64 = 1000.0;

/// Maximum number of points with spikes. The brightest points are chosen.
const MAX_POINTS: usize = 64;

/// Number of cells on each side of a point's cell that contain its light: 3 × 3 cells of 4 px.
const REACH_CELLS: usize = 1;

/// Distances from the point at which spikes start (outside these cells) and end.
const INNER_PX: f64 = 6.0;
const OUTER_PX: f64 = 240.0;

/// Width of a spike: σ of the Gaussian across it.
const WIDTH_PX: f64 = 0.9;
/// √(2π), the area of a Gaussian with a height of 1 and a σ of 1.
const ROOT_TAU: f64 = 2.506_628_3;

/// Rotation of the iris, so that no spike runs along rows or columns and looks like an artifact.
const TURN_RAD: f64 = 0.2;

/// Maximum fraction of a point's light in its spikes.
const MAX_FRACTION: f64 = 0.3;

/// A change in the counts of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Change {
    /// Index `y * width_px + x` of the pixel.
    pub(super) index: usize,
    /// Change of each channel's counts. All changes of a film add up to 0.
    pub(super) counts: [i64; 3],
}

/// Returns the changes that spikes make to a film, sorted by pixel. Without blades there are no
/// changes.
pub(super) fn starburst(film: &Film, camera: &Camera, blades: u32) -> Vec<Change> {
    if blades == 0 {
        return Vec::new();
    }
    // Each blade diffracts light to both sides. With an even number of blades, the spikes of two
    // opposite blades coincide.
    let n_spikes = if blades.is_multiple_of(2) { blades } else { 2 * blades };
    let mut changes = Vec::new();
    for point in points(film, camera, &cells(film, WHOLE)) {
        let fractions_px = WAVELENGTH_M.map(|wavelength_m| {
            let blur_px = wavelength_m * camera.f_number / camera.pixel_pitch_m();
            let fraction_px = 2.0 * blur_px / (std::f64::consts::PI * std::f64::consts::PI);
            fraction_px.min(MAX_FRACTION * INNER_PX)
        });
        let light = std::array::from_fn(|c| fractions_px[c] * point.light[c] / f64::from(n_spikes));
        let first = changes.len();
        for spike in 0..n_spikes {
            let angle = f64::from(spike) / f64::from(n_spikes) * std::f64::consts::TAU + TURN_RAD;
            let (sin, cos) = libm::sincos(angle);
            draw(film, point.center_px, DVec2::new(cos, sin), light, &mut changes);
        }
        // The counts in the spikes are subtracted from the point, so that light is conserved.
        subtract_spikes(film, &point, first, &mut changes);
    }
    changes.sort_by_key(|change| change.index);
    changes
}

/// A point of the picture at which a lamp dwells.
struct Point {
    /// First cell of the block of cells around the point.
    corner: [usize; 2],
    center_px: DVec2,
    /// Light of the point in counts, without that of a trail through the point.
    light: [f64; 3],
}

/// Returns the brightest points at which lamps dwell: cells much brighter than those around.
fn points(film: &Film, camera: &Camera, cells: &[Plane; 3]) -> Vec<Point> {
    let (width, height) = (cells[0].width, cells[0].height);
    let saturation = camera.saturation_lx_s() * libm::exp2(-f64::from(film.scale_log2));
    let bright = BRIGHT_PX * saturation;
    let cell = |x: usize, y: usize| cells.iter().map(|p| p.values[y * width + x]).sum::<u64>();
    let margin = REACH_CELLS + 1;
    let mut points: Vec<(u64, Point)> = Vec::new();
    for y in margin..height.saturating_sub(margin) {
        for x in margin..width.saturating_sub(margin) {
            // The brightest cell has at least a ninth of the light in its block.
            let light = cell(x, y);
            if light as f64 * 9.0 < bright {
                continue;
            }
            let around = |reach: usize| {
                (y - reach..=y + reach)
                    .flat_map(move |y| (x - reach..=x + reach).map(move |x| [x, y]))
            };
            // If several cells are equally bright, the last one counts as the point.
            if !around(margin).all(|[i, j]| (cell(i, j), [j, i]) <= (light, [y, x])) {
                continue;
            }
            let dwelling: [f64; 3] = std::array::from_fn(|c: usize| {
                // A trail leaves three cells of light in the block and two in the ring around it.
                let [block, both] = [REACH_CELLS, margin].map(|reach| -> u64 {
                    around(reach).map(|[x, y]| cells[c].values[y * width + x]).sum()
                });
                (block as f64 - 1.5 * (both - block) as f64).max(0.0)
            });
            if dwelling.iter().any(|light| *light >= bright) {
                let corner = [x - REACH_CELLS, y - REACH_CELLS];
                let center_px = center_px(film, corner);
                points.push((light, Point { corner, center_px, light: dwelling }));
            }
        }
    }
    points.sort_by_key(|(light, _)| std::cmp::Reverse(*light));
    points.truncate(MAX_POINTS);
    points.into_iter().map(|(_, point)| point).collect()
}

/// Returns the columns and rows of the pixels in a block of cells.
fn block(film: &Film, corner: [usize; 2]) -> impl Iterator<Item = (usize, usize)> {
    let size = CELL_PX * (2 * REACH_CELLS + 1);
    let ends = [film.width_px as usize, film.height_px as usize];
    let [x, y] = std::array::from_fn(|axis| {
        let first = corner[axis] * CELL_PX;
        first..(first + size).min(ends[axis])
    });
    y.flat_map(move |y| x.clone().map(move |x| (x, y)))
}

/// Returns the centroid in pixels of the light in a block of cells, whose first cell is at
/// `corner`.
fn center_px(film: &Film, corner: [usize; 2]) -> DVec2 {
    let (width, pixels) = (film.width_px as usize, film.counts.len() / 3);
    let (mut sum, mut weight) = (DVec2::ZERO, 0.0);
    for (x, y) in block(film, corner) {
        let light: u64 = (0..3).map(|c| u64::from(film.counts[c * pixels + y * width + x])).sum();
        weight += light as f64;
        sum += light as f64 * DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
    }
    sum / weight
}

/// Appends the changes that a spike makes from a point along a unit vector. `light` is the spike's
/// light beyond 1 px from the point.
fn draw(film: &Film, from: DVec2, along: DVec2, light: [f64; 3], out: &mut Vec<Change>) {
    let size = [film.width_px, film.height_px].map(|side| side as usize);
    // Proceeds along the axis closest to the spike's direction, and across that axis.
    let (main, side) = if along.x.abs() > along.y.abs() { (0, 1) } else { (1, 0) };
    for main_px in 0..size[main] {
        let u_main = main_px as f64 + 0.5 - from[main];
        let r = u_main / along[main];
        if !(INNER_PX - 1.0..=OUTER_PX).contains(&r) {
            continue;
        }
        let middle = from[side] + r * along[side];
        // Covers 4 σ on either side.
        let first = (middle - 4.0 * WIDTH_PX).max(0.0);
        for side_px in (0..size[side]).skip(whole(first)).take(8) {
            let u_side = side_px as f64 + 0.5 - from[side];
            // u is along the spike and v across it. The light of a spike decreases with 1/u².
            let u = u_main * along[main] + u_side * along[side];
            let v = u_main * along[side] - u_side * along[main];
            if !(INNER_PX..=OUTER_PX).contains(&u) {
                continue;
            }
            let across = libm::exp(-0.5 * (v / WIDTH_PX) * (v / WIDTH_PX)) / (WIDTH_PX * ROOT_TAU);
            #[expect(clippy::cast_possible_truncation, reason = "counts of a film, below 2^53")]
            let counts = light.map(|light| (light / (u * u) * across) as i64);
            let [x, y] = if main == 0 { [main_px, side_px] } else { [side_px, main_px] };
            if counts != [0; 3] {
                out.push(Change { index: y * size[0] + x, counts });
            }
        }
    }
}

/// Subtracts the light of the changes starting at `first` from the pixels of the point, in
/// proportion to each pixel's light.
fn subtract_spikes(film: &Film, point: &Point, first: usize, changes: &mut Vec<Change>) {
    let (width, pixels) = (film.width_px as usize, film.counts.len() / 3);
    let spikes: [i128; 3] = std::array::from_fn(|c| {
        changes[first..].iter().map(|change| i128::from(change.counts[c])).sum()
    });
    let block = Vec::from_iter(block(film, point.corner).map(|(x, y)| {
        let index = y * width + x;
        (index, [0, 1, 2].map(|c| i128::from(film.counts[c * pixels + index])))
    }));
    // The parts are differences of rounded cumulative sums, so that they add up to the spikes.
    let total = [0, 1, 2].map(|c| block.iter().map(|(_, light)| light[c]).sum::<i128>());
    let mut cumulative = [0_i128; 3];
    for (index, light) in block {
        let counts = [0, 1, 2].map(|c| {
            let [before, after] = [cumulative[c], cumulative[c] + light[c]]
                .map(|sum| sum * spikes[c] / total[c].max(1));
            cumulative[c] += light[c];
            i64::try_from(before - after).expect("less than the pixel has")
        });
        changes.push(Change { index, counts });
    }
}
