//! Soft light: a lit wall or a glow is wider than the strokes, and is none of them.
//!
//! An opening, the maximum over squares of the minimum in each, keeps what is wider than the square
//! and loses the strokes: it is taken off the light.

use super::raster::whole;

/// Light from which a pixel shows a stroke, where the width of strokes is measured.
const LIT: f32 = 0.4;

/// Which share of the lit pixels is narrower than a stroke: corners, blots and a wall are wider.
const STROKE_RANK: f64 = 0.2;

/// Half of the square, in widths of a stroke, and at least this many pixels.
const REACH: (f64, usize) = (1.5, 3);

/// How often what is wider than the strokes is taken off: the top of a soft light is less wide than
/// its foot, and the sky that was taken off has taken the foot.
const TAKEN: f32 = 3.0;

/// Takes soft light off the channels of a strip, whose first one is how bright the light looks.
pub(super) fn take_off_soft_light(width: usize, channels: [&mut Vec<f32>; 2]) {
    let reach = whole((REACH.0 * stroke_px(channels[0], width)).ceil()).max(REACH.1);
    for light in channels {
        let soft = pulp::Arch::new().dispatch(|| {
            let least = over_squares(light, width, reach, f32::min);
            over_squares(&least, width, reach, f32::max)
        });
        for (light, soft) in light.iter_mut().zip(soft) {
            *light = (*light - TAKEN * soft).max(0.0);
        }
    }
}

/// Width of most strokes: the shorter of the lit runs along the row and the column of a pixel.
fn stroke_px(light: &[f32], width: usize) -> f64 {
    let height = light.len() / width;
    let lit = |at: usize| light[at] >= LIT;
    let mut run = vec![usize::MAX; light.len()];
    let mut shorten = |line: &mut dyn Iterator<Item = usize>| {
        let mut current: Vec<usize> = Vec::new();
        for at in line.map(Some).chain([None]) {
            match at.filter(|at| lit(*at)) {
                Some(at) => current.push(at),
                None => {
                    let length = current.len();
                    current.drain(..).for_each(|at| run[at] = run[at].min(length));
                }
            }
        }
    };
    (0..height).for_each(|y| shorten(&mut (y * width..(y + 1) * width)));
    (0..width).for_each(|x| shorten(&mut (x..light.len()).step_by(width)));
    let mut runs: Vec<usize> = run.into_iter().filter(|length| *length < usize::MAX).collect();
    if runs.is_empty() {
        return 0.0;
    }
    let rank = whole(STROKE_RANK * runs.len() as f64);
    *runs.select_nth_unstable(rank).1 as f64
}

/// The least or the greatest of the pixels in the square around each.
#[inline(always)]
fn over_squares(
    light: &[f32],
    width: usize,
    reach: usize,
    of: impl Fn(f32, f32) -> f32,
) -> Vec<f32> {
    let take = |values: &mut [f32], near: &[f32]| {
        values.iter_mut().zip(near).for_each(|(value, near)| *value = of(*value, *near));
    };
    let mut rows = light.to_vec();
    for (row, light) in rows.chunks_exact_mut(width).zip(light.chunks_exact(width)) {
        for away in 1..(reach + 1).min(width) {
            take(&mut row[away..], light);
            take(row, &light[away..]);
        }
    }
    let mut squares = rows.clone();
    for away in (1..=reach).map(|rows| rows * width).take_while(|away| *away < light.len()) {
        take(&mut squares[away..], &rows);
        take(&mut squares, &rows[away..]);
    }
    squares
}
