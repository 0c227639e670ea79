//! Starburst: spikes that the iris diffracts from points where a lamp dwells.
//!
//! A straight blade diffracts light into a spike at right angles to it. As for a round iris, the
//! fraction `2 λ N / (π² r)` of the light of a point lands farther than r from it. Straight blades
//! concentrate it in spikes, so that each of n spikes has `2 λ N / (π² n r²)` per length. Along a
//! trail spikes smear to nothing, so only lamps at rest have them. Their light is taken from the
//! point.
//!
//! The light of a spike on a pixel is rounded down to an integer. Not modeled: the fine structure
//! of spikes by color.

use glam::DVec2;

use super::glare::{CELL_PX, WHOLE, cells};
use super::kernel::Plane;
use crate::expose::Film;
use crate::whole;
use noctograph_core::camera::Camera;

/// Wavelength of red, green and blue LEDs.
const WAVELENGTH_M: [f64; 3] = [620e-9, 525e-9, 465e-9];

/// Light of a point with visible spikes, in saturated pixels.
const BRIGHT_PX: f64 = 1000.0;

/// Most points with spikes, the brightest first.
const MAX_POINTS: usize = 64;

/// Cells around a point's cell that have its light: 3 × 3 cells of 4 px.
const REACH_CELLS: usize = 1;

/// Start of the spikes, outside of those cells.
const INNER_PX: f64 = 6.0;

const OUTER_PX: f64 = 240.0;

const WIDTH_PX: f64 = 0.9;

/// Rotation of the iris, so that no spike runs along rows or columns like an artifact.
const TURN_RAD: f64 = 0.2;

/// Largest fraction of the light of a point in its spikes.
const MAX_FRACTION: f64 = 0.3;

/// Gain or loss of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Change {
    /// `y * width_px + x`.
    pub(super) index: usize,
    /// Counts by channel. Those of a film add up to 0.
    pub(super) counts: [i64; 3],
}

/// The spikes of a film, by pixel. An iris without blades makes none.
pub(super) fn starburst(film: &Film, camera: &Camera, blades: u32) -> Vec<Change> {
    if blades == 0 {
        return Vec::new();
    }
    let n_spikes = if blades.is_multiple_of(2) { blades } else { 2 * blades };
    let mut changes = Vec::new();
    for point in points(film, camera, &cells(film, WHOLE)) {
        let fractions_px = WAVELENGTH_M.map(|wavelength_m| {
            let blur_px = wavelength_m * camera.f_number / camera.pixel_pitch_m();
            let fraction_px = 2.0 * blur_px / (std::f64::consts::PI * std::f64::consts::PI);
            fraction_px.min(MAX_FRACTION * INNER_PX)
        });
        let light = std::array::from_fn(|c| fractions_px[c] * point.light[c] / f64::from(n_spikes));
        let before = changes.len();
        for spike in 0..n_spikes {
            let turn = f64::from(spike) / f64::from(n_spikes) * std::f64::consts::TAU + TURN_RAD;
            let (sin, cos) = libm::sincos(turn);
            draw(film, point.center_px, DVec2::new(cos, sin), light, &mut changes);
        }
        // Light is conserved: the spikes' counts are those that the point loses.
        take_from(film, &point, before, &mut changes);
    }
    changes.sort_by_key(|change| change.index);
    changes
}

struct Point {
    /// First cell of its block of cells.
    corner: [usize; 2],
    center_px: DVec2,
    /// Light in counts, without that of a trail through it.
    light: [f64; 3],
}

/// Points where lamps dwell: cells much brighter than all around.
fn points(film: &Film, camera: &Camera, cells: &[Plane; 3]) -> Vec<Point> {
    let (width, height) = (cells[0].width, cells[0].height);
    let saturation = camera.saturation_lx_s() * libm::exp2(-f64::from(film.scale_log2));
    let bright = BRIGHT_PX * saturation;
    let cell = |x: usize, y: usize| cells.iter().map(|p| p.values[y * width + x]).sum::<u64>();
    let margin = REACH_CELLS + 1;
    let mut points: Vec<(u64, Point)> = Vec::new();
    for y in margin..height.saturating_sub(margin) {
        for x in margin..width.saturating_sub(margin) {
            // The brightest cell has at least a ninth of the light of its block.
            let light = cell(x, y);
            if light as f64 * 9.0 < bright {
                continue;
            }
            let around = |reach: usize| {
                (y - reach..=y + reach)
                    .flat_map(move |y| (x - reach..=x + reach).map(move |x| [x, y]))
            };
            // The last of equal cells is the point.
            if !around(margin).all(|[i, j]| (cell(i, j), [j, i]) <= (light, [y, x])) {
                continue;
            }
            let dwelling: [f64; 3] = std::array::from_fn(|c: usize| {
                // A trail leaves three cells of light in the block and two in the ring around.
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

/// Pixels of a block of cells, as indices in a plane.
fn block(film: &Film, corner: [usize; 2]) -> impl Iterator<Item = (usize, usize)> {
    let size = CELL_PX * (2 * REACH_CELLS + 1);
    let ends = [film.width_px as usize, film.height_px as usize];
    let [x, y] = std::array::from_fn(|axis| {
        let first = corner[axis] * CELL_PX;
        first..(first + size).min(ends[axis])
    });
    y.flat_map(move |y| x.clone().map(move |x| (x, y)))
}

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

/// Draws a spike from a point along a unit vector. `light` is its light beyond 1 px.
fn draw(film: &Film, from: DVec2, along: DVec2, light: [f64; 3], out: &mut Vec<Change>) {
    let size = [film.width_px, film.height_px].map(|side| side as usize);
    // Steps along the axis that the spike is nearer to, and across it.
    let (main, side) = if along.x.abs() > along.y.abs() { (0, 1) } else { (1, 0) };
    for main_px in 0..size[main] {
        let u_main = main_px as f64 + 0.5 - from[main];
        let r = u_main / along[main];
        if !(INNER_PX - 1.0..=OUTER_PX).contains(&r) {
            continue;
        }
        let middle = from[side] + r * along[side];
        let first = (middle - 4.0 * WIDTH_PX).max(0.0);
        for side_px in (0..size[side]).skip(whole(first)).take(8) {
            let u_side = side_px as f64 + 0.5 - from[side];
            // In the frame of the spike: u along it, v across. Its light falls with 1/u².
            let u = u_main * along[main] + u_side * along[side];
            let v = u_main * along[side] - u_side * along[main];
            if !(INNER_PX..=OUTER_PX).contains(&u) {
                continue;
            }
            let across =
                libm::exp(-0.5 * (v / WIDTH_PX) * (v / WIDTH_PX)) / (WIDTH_PX * 2.506_628_3);
            #[expect(clippy::cast_possible_truncation, reason = "counts of a film, below 2^53")]
            let counts = light.map(|light| (light / (u * u) * across) as i64);
            let [x, y] = if main == 0 { [main_px, side_px] } else { [side_px, main_px] };
            if counts != [0; 3] {
                out.push(Change { index: y * size[0] + x, counts });
            }
        }
    }
}

/// Takes the light of the changes from `first` on from the pixels of the point, in proportion to
/// their light.
fn take_from(film: &Film, point: &Point, first: usize, changes: &mut Vec<Change>) {
    let (width, pixels) = (film.width_px as usize, film.counts.len() / 3);
    let drawn: [i128; 3] = std::array::from_fn(|c| {
        changes[first..].iter().map(|change| i128::from(change.counts[c])).sum()
    });
    let block = Vec::from_iter(block(film, point.corner).map(|(x, y)| {
        let index = y * width + x;
        (index, [0, 1, 2].map(|c| i128::from(film.counts[c * pixels + index])))
    }));
    // Rounded cumulative sums, so that the parts add up to what was drawn.
    let total = [0, 1, 2].map(|c| block.iter().map(|(_, light)| light[c]).sum::<i128>());
    let mut until = [0_i128; 3];
    for (index, light) in block {
        let counts = [0, 1, 2].map(|c| {
            let [before, after] =
                [until[c], until[c] + light[c]].map(|until| until * drawn[c] / total[c].max(1));
            until[c] += light[c];
            i64::try_from(before - after).expect("less than the pixel has")
        });
        changes.push(Change { index, counts });
    }
}
