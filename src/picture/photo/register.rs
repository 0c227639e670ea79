//! Registration: the similarity transform from a render to a photograph of the same flight.
//!
//! 1. Both pictures are reduced to the light above that of its surroundings: trails without rooms
//!    and floors.
//! 2. Pictures of `COARSE_PX` are compared at every scale, rotation and shift within bounds.
//! 3. The best few are refined on finer pictures by the enhanced correlation coefficient
//!    (Evangelidis and Psarakis 2008), and the one with the highest correlation is the result.
//!
//! Not modeled: perspective and distortion, which stay in the residual.

mod light_map;

use nalgebra::{Matrix4, Vector4};

use super::Photo;
use crate::whole;
use light_map::{Levels, LightMap};
use noctograph_core::error::{Error, Result};
use noctograph_core::statistics::weighted_quantile;

/// Range of the scale, relative to equal longer sides, and its step.
const SCALES: [f64; 2] = [0.4, 2.5];
const SCALE_STEP: f64 = 1.1;

/// Range of the rotation, and its step.
const TURN_RAD: f64 = 0.35;
const TURN_STEP_RAD: f64 = 0.07;

/// Candidates that are refined.
const FOLLOWED: usize = 6;

/// Least correlation of a match.
const LEAST_CORRELATION: f64 = 0.2;

/// Transform of a point `q` of the render, in pixels from its top left corner, to
/// `scale R(rotation) q + shift` in the photograph.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Similarity {
    /// Pixels of the photograph per pixel of the render.
    pub scale: f64,
    /// From x to y: clockwise in the picture.
    pub rotation_rad: f64,
    /// Image of the corner of the render.
    pub shift_px: [f64; 2],
}

impl Similarity {
    /// Image of a point of the render.
    #[must_use]
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (a, b) = self.linear();
        [a * x - b * y + self.shift_px[0], b * x + a * y + self.shift_px[1]]
    }

    /// The inverse transform.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let back =
            Self { scale: 1.0 / self.scale, rotation_rad: -self.rotation_rad, shift_px: [0.0; 2] };
        Self { shift_px: back.apply(self.shift_px).map(|value| -value), ..back }
    }

    fn linear(&self) -> (f64, f64) {
        let (sin, cos) = libm::sincos(self.rotation_rad);
        (self.scale * cos, self.scale * sin)
    }

    fn from_parameters(p: Vector4<f64>) -> Self {
        let scale = libm::hypot(p[0], p[1]);
        Self { scale, rotation_rad: libm::atan2(p[1], p[0]), shift_px: [p[2], p[3]] }
    }

    /// The same between pictures that are smaller by these factors.
    fn between(&self, render: f64, photo: f64) -> Self {
        let shift_px = self.shift_px.map(|value| value / photo);
        Self { scale: self.scale * render / photo, shift_px, ..*self }
    }
}

/// Transform from a render to a photograph, and its quality.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Registration {
    /// The transform.
    pub transform: Similarity,
    /// Correlation of the trails, up to 1.
    pub correlation: f64,
    /// Distance from the trails of the render to the nearest of the photograph, in its pixels:
    /// median and 95th percentile.
    pub residual_px: [f64; 2],
}

/// Finds a render in a photograph.
///
/// # Errors
///
/// [`Error::Infeasible`] where nothing in the photograph resembles the render.
pub fn register(render: &Photo, photo: &Photo) -> Result<Registration> {
    let [render, photo] = [render, photo].map(Levels::new);
    let [by_render, by_photo] = [&render, &photo].map(|levels| 1.0 / levels.factor(0));
    let coarse = coarse(&render.levels[0], &photo.levels[0]).into_iter();
    // With their correlations.
    let mut followed: Vec<(f64, Similarity)> =
        coarse.map(|s| (0.0, s.between(by_render, by_photo))).collect();
    for level in 0..render.levels.len() {
        let [from, to] = [&render, &photo].map(|levels| &levels.levels[level]);
        let [by_from, by_to] = [&render, &photo].map(|levels| levels.factor(level));
        let climbed = followed.iter().filter_map(|(_, start)| {
            let (correlation, found) = climb(from, to, start.between(by_from, by_to))?;
            Some((correlation, found.between(1.0 / by_from, 1.0 / by_to)))
        });
        followed = climbed.collect();
        followed.sort_by(|a, b| b.0.total_cmp(&a.0));
        // Half of the candidates remain at each level.
        followed.truncate((FOLLOWED >> level).max(1));
    }
    let Some(&(correlation, transform)) = followed.first() else {
        return Err(nothing_alike(0.0));
    };
    if correlation < LEAST_CORRELATION {
        return Err(nothing_alike(correlation));
    }
    let residual_px = residual_px(&render, &photo, &transform);
    Ok(Registration { transform, correlation, residual_px })
}

fn nothing_alike(correlation: f64) -> Error {
    // Rounded down: never as much as is wanted.
    let correlation = (100.0 * correlation).floor() / 100.0;
    Error::Infeasible {
        what: format!(
            "the render's trails are not in the photograph (correlation {correlation:.2} at best, \
             wanted {LEAST_CORRELATION})"
        ),
        hint:
            "compare photographs of the same word; cut the photograph to it, turn it upright, and \
               render it from about the same side"
                .to_owned(),
    }
}

/// The best candidates of all scales, rotations and shifts of the coarsest pictures, one for each
/// scale and rotation.
fn coarse(render: &LightMap, photo: &LightMap) -> Vec<Similarity> {
    // The brightest twelfth of the render.
    let mut points: Vec<([f64; 2], f32)> =
        (0..render.values.len()).map(|i| (render.middle(i), render.values[i])).collect();
    points.sort_by(|a, b| b.1.total_cmp(&a.1));
    points.truncate((render.values.len() / 12).max(16));
    let norm = |values: Vec<f32>| values.iter().map(|v| f64::from(v * v)).sum::<f64>().sqrt();
    let norms = norm(points.iter().map(|point| point.1).collect()) * norm(photo.values.clone());
    let equal = photo.width.max(photo.height) as f64 / render.width.max(render.height) as f64;
    let middle = [render.width as f64 / 2.0, render.height as f64 / 2.0];
    let (w, h) = (photo.width.cast_signed(), photo.height.cast_signed());
    let mut found: Vec<(f64, Similarity)> = Vec::new();
    let mut scale = SCALES[0];
    while scale <= SCALES[1] {
        let turns = whole(TURN_RAD / TURN_STEP_RAD).cast_signed();
        for turn in -turns..=turns {
            let about = Similarity {
                scale: scale * equal,
                rotation_rad: turn as f64 * TURN_STEP_RAD,
                shift_px: [0.0; 2],
            };
            let center = about.apply(middle);
            // Points relative to the middle of the render, to be shifted over the photo.
            let placed = points.iter().map(|(place, value)| {
                let [x, y] = about.apply(*place);
                (rounded(x - center[0]), rounded(y - center[1]), *value)
            });
            let placed: Vec<(isize, isize, f32)> = placed.collect();
            let mut best = (0.0_f32, [0, 0]);
            for dy in 0..h {
                for dx in 0..w {
                    let lights = placed.iter().map(|(x, y, value)| {
                        let (x, y) = (x + dx, y + dy);
                        let inside = (0..w).contains(&x) && (0..h).contains(&y);
                        let index = (y * w + x).max(0).cast_unsigned();
                        if inside { value * photo.values[index] } else { 0.0 }
                    });
                    let sum: f32 = lights.sum();
                    if sum > best.0 {
                        best = (sum, [dx, dy]);
                    }
                }
            }
            let [dx, dy] = best.1.map(|shift| shift as f64 + 0.5);
            let shift_px = [dx - center[0], dy - center[1]];
            // An enlarged render has the same number of points but more light.
            let score = f64::from(best.0) * about.scale / norms.max(f64::MIN_POSITIVE);
            found.push((score, Similarity { shift_px, ..about }));
        }
        scale *= SCALE_STEP;
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(2 * FOLLOWED);
    found.into_iter().map(|(_, s)| s).collect()
}

/// Refines a transform; also returns its correlation.
fn climb(render: &LightMap, photo: &LightMap, start: Similarity) -> Option<(f64, Similarity)> {
    let (a, b) = start.linear();
    let mut p = Vector4::new(a, b, start.shift_px[0], start.shift_px[1]);
    let mut best: Option<(f64, Vector4<f64>)> = None;
    for _ in 0..40 {
        let Some((correlation, step)) = step(render, photo, p) else { break };
        if best.is_none_or(|(known, _)| correlation > known) {
            best = Some((correlation, p));
        }
        p += step;
        let moved = (step[0].abs() + step[1].abs()) * render.width as f64;
        if moved + step[2].abs() + step[3].abs() < 0.01 {
            break;
        }
    }
    best.map(|(correlation, p)| (correlation, Similarity::from_parameters(p)))
}

/// Correlation of a transform, and the step to a better one.
fn step(render: &LightMap, photo: &LightMap, p: Vector4<f64>) -> Option<(f64, Vector4<f64>)> {
    // Sums of the gradient G, the photo w and the render t over the pixels in both.
    let (mut n, mut sum_w, mut sum_t, mut ww, mut tt, mut wt) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let (mut gg, mut g) = (Matrix4::zeros(), Vector4::zeros());
    let (mut gw, mut gt) = (Vector4::zeros(), Vector4::zeros());
    let mut all_t = 0.0;
    for (i, &t) in render.values.iter().enumerate() {
        let t = f64::from(t);
        all_t += t * t;
        let [x, y] = render.middle(i);
        let place = [p[0] * x - p[1] * y + p[2], p[1] * x + p[0] * y + p[3]];
        let Some([w, slope_x, slope_y]) = photo.at(place) else { continue };
        let row =
            Vector4::new(slope_x * x + slope_y * y, slope_y * x - slope_x * y, slope_x, slope_y);
        n += 1.0;
        (sum_w, sum_t) = (sum_w + w, sum_t + t);
        (ww, tt, wt) = (ww + w * w, tt + t * t, wt + w * t);
        gg += row * row.transpose();
        g += row;
        gw += row * w;
        gt += row * t;
    }
    // At least half of the light of the render must lie in the photo.
    if n < 16.0 || tt < 0.5 * all_t {
        return None;
    }
    let (ww, tt, wt) = (ww - sum_w * sum_w / n, tt - sum_t * sum_t / n, wt - sum_w * sum_t / n);
    let (gw, gt) = (gw - g * (sum_w / n), gt - g * (sum_t / n));
    let hessian = (gg - g * g.transpose() / n).try_inverse()?;
    let correlation = wt / (ww * tt).sqrt();
    let across = wt - gt.dot(&(hessian * gw));
    if !correlation.is_finite() || across <= 0.0 {
        return Some((if correlation.is_finite() { correlation } else { 0.0 }, Vector4::zeros()));
    }
    let lambda = (ww - gw.dot(&(hessian * gw))) / across;
    Some((correlation, hessian * (gt * lambda - gw)))
}

/// Most points of a trail of which the residual is taken.
const RESIDUAL_POINTS: usize = 2000;

/// Distances from the trails of the render to the nearest of the photo, in pixels of the photo.
fn residual_px(render: &Levels, photo: &Levels, transform: &Similarity) -> [f64; 2] {
    let [from, to] = [render, photo].map(|levels| trails(&levels.levels[levels.levels.len() - 1]));
    let near = transform.between(render.finest, photo.finest);
    let mut off: Vec<(f64, f64)> = from
        .iter()
        .step_by(from.len().div_ceil(RESIDUAL_POINTS).max(1))
        .map(|point| {
            let [x, y] = near.apply(*point);
            let square = |to: &[f64; 2]| (to[0] - x) * (to[0] - x) + (to[1] - y) * (to[1] - y);
            let nearest = to.iter().map(square).fold(f64::INFINITY, f64::min);
            (nearest.sqrt() * photo.finest, 1.0)
        })
        .filter(|(off, _)| off.is_finite())
        .collect();
    [0.5, 0.95].map(|share| weighted_quantile(&mut off, share).unwrap_or(0.0))
}

/// Pixels of a trail: at least a fifth as bright as a bright one.
fn trails(ink: &LightMap) -> Vec<[f64; 2]> {
    let mut sorted = ink.values.clone();
    sorted.sort_by(f32::total_cmp);
    let least = (0.2 * sorted[(sorted.len() - 1) * 995 / 1000]).max(f32::MIN_POSITIVE);
    let is_lit = |i: &usize| ink.values[*i] >= least;
    (0..ink.values.len()).filter(is_lit).map(|i| ink.middle(i)).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "pixels")]
fn rounded(px: f64) -> isize {
    px.round() as isize
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::geometry::{distance, segment_distance};

    /// A word of strokes in a dark room with a lit floor, drawn through a transform.
    fn word([width_px, height_px]: [u32; 2], place: Similarity, floor: f64) -> Photo {
        let strokes = [
            ([200.0, 300.0], [200.0, 120.0]),
            ([200.0, 120.0], [290.0, 300.0]),
            ([290.0, 300.0], [290.0, 120.0]),
            ([360.0, 300.0], [360.0, 130.0]),
            ([360.0, 130.0], [460.0, 150.0]),
            ([460.0, 150.0], [380.0, 220.0]),
            ([380.0, 220.0], [470.0, 310.0]),
        ];
        let strokes = strokes.map(|(a, b)| [place.apply(a), place.apply(b)]);
        let pixel = |x: u32, y: u32| {
            let p = [f64::from(x) + 0.5, f64::from(y) + 0.5];
            let near = strokes.iter().map(|ends| segment_distance(p, *ends));
            let off = near.fold(f64::INFINITY, f64::min) / (3.0 * place.scale);
            let room = floor * f64::from(y) / f64::from(height_px);
            let light = libm::exp(-0.5 * off * off) + room;
            #[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
            let level = (255.0 * noctograph_core::srgb::encoded_from_linear(light.min(1.0))) as u8;
            [level; 3]
        };
        let places = (0..height_px).flat_map(|y| (0..width_px).map(move |x| (x, y)));
        let rgb8 = places.flat_map(|(x, y)| pixel(x, y)).collect();
        Photo { width_px, height_px, rgb8, scene_toml: None }
    }

    const HOME: Similarity = Similarity { scale: 1.0, rotation_rad: 0.0, shift_px: [0.0; 2] };

    #[test]
    fn a_similarity_is_found_to_a_third_of_a_pixel() {
        let render = word([640, 400], HOME, 0.0);
        let places = [
            ([640, 400], HOME),
            ([900, 300], Similarity { scale: 0.9, rotation_rad: 0.1, shift_px: [170.0, -80.0] }),
            ([500, 600], Similarity { scale: 0.7, rotation_rad: -0.2, shift_px: [-60.0, 230.0] }),
            ([1200, 800], Similarity { scale: 2.3, rotation_rad: 0.03, shift_px: [-200., -120.] }),
        ];
        for (size_px, place) in places {
            let photo = word(size_px, place, 0.3);
            let found = register(&render, &photo).unwrap();
            for corner in [[200.0, 300.0], [290.0, 120.0], [470.0, 310.0]] {
                let (at, wanted) = (found.transform.apply(corner), place.apply(corner));
                let off = distance(at, wanted);
                assert!(off < 0.35 * place.scale.max(1.0), "{off} px off: {found:?} for {place:?}");
            }
            assert!(found.correlation > 0.9, "{found:?}");
            assert!(found.residual_px[1] < 2.0 * place.scale, "{found:?}");
            let back = found.transform.inverse().apply(found.transform.apply([3.0, 4.0]));
            assert!((back[0] - 3.0).abs() + (back[1] - 4.0).abs() < 1e-9, "{back:?}");
        }
    }

    #[test]
    fn a_photo_without_the_trails_is_infeasible() {
        let render = word([640, 400], HOME, 0.0);
        let dark =
            Photo { rgb8: vec![7; 300 * 200 * 3], width_px: 300, height_px: 200, ..render.clone() };
        assert!(matches!(register(&render, &dark), Err(Error::Infeasible { .. })));
        assert!(matches!(register(&dark, &render), Err(Error::Infeasible { .. })));
        let speck = Photo { rgb8: vec![200; 3], width_px: 1, height_px: 1, ..render.clone() };
        assert!(matches!(register(&render, &speck), Err(Error::Infeasible { .. })));
    }
}
