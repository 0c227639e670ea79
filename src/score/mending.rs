//! Mending: a fault taken out of a letter's picture, so that the letter can be read without it.

use super::raster::Raster;
use super::segment::distance;
use super::sketch::Sketch;
use super::trace::LightLines;
use super::{PEN_H, PX_PER_H};

/// A cap height in pixels.
const H_PX: f64 = PX_PER_H as f64;

/// Light within this distance of stray light, or of a stroke, belongs to it: 0.12 H.
const REACH_PX: f64 = 0.12 * H_PX;

/// Stray light so close to a stroke stays: it is the stroke's own.
const OWN_PX: f64 = 0.06 * H_PX;

/// How a fault is taken out of a picture.
pub(super) enum Mending {
    /// The light at these points is taken away.
    Erase(Vec<[f64; 2]>),
    /// Light is added at these points.
    Draw(Vec<[f64; 2]>),
    /// The letter is moved back by so many pixels, right and down.
    Move([isize; 2]),
    /// The light of the strokes is drawn at these points instead.
    Straighten(Vec<[f64; 2]>),
    /// The lines are drawn thin, without glow.
    Redraw,
}

/// Takes a fault out of a picture.
pub(super) fn mend(picture: &mut Raster, mending: &Mending, sketch: &Sketch) {
    let width = picture.width;
    let near = |points: &[[f64; 2]], at: [f64; 2]| {
        points.iter().map(|p| libm::hypot(p[0] - at[0], p[1] - at[1])).fold(f64::INFINITY, f64::min)
    };
    let middle = |index: usize| [(index % width) as f64 + 0.5, (index / width) as f64 + 0.5];
    match mending {
        Mending::Straighten(points) => {
            for (index, value) in picture.values.iter_mut().enumerate() {
                if distance(middle(index), &sketch.own) < REACH_PX {
                    *value = 0.0;
                }
            }
            mend(picture, &Mending::Draw(points.clone()), sketch);
        }
        Mending::Erase(points) => {
            for (index, value) in picture.values.iter_mut().enumerate() {
                let at = middle(index);
                let is_stray = near(points, at) < REACH_PX;
                if is_stray && distance(at, &sketch.own) > OWN_PX {
                    *value = 0.0;
                }
            }
        }
        Mending::Draw(points) => {
            for (index, value) in picture.values.iter_mut().enumerate() {
                if near(points, middle(index)) <= 0.5 * PEN_H * H_PX + 0.2 {
                    *value = 1.0;
                }
            }
        }
        Mending::Move([right, down]) => {
            let mut moved = Raster::dark(picture.width, picture.height);
            for (index, value) in moved.values.iter_mut().enumerate() {
                let from = |at: usize, by: isize, end: usize| {
                    at.checked_add_signed(by).filter(|at| *at < end)
                };
                let x = from(index % width, *right, picture.width);
                let y = from(index / width, *down, picture.height);
                if let (Some(x), Some(y)) = (x, y) {
                    *value = picture.values[y * width + x];
                }
            }
            *picture = moved;
        }
        Mending::Redraw => *picture = LightLines::new(picture).redrawn(picture),
    }
}
