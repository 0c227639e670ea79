//! Shrinks, warps and overlays photos.

use std::ops::Range;

use kurbo::Vec2;

use noctograph_core::srgb;
use noctograph_picture::photo::{Photo, PhotoData};

/// Transform that maps a point `q` of one picture, in pixels from the upper left corner, to `scale
/// R(rotation) q + shift` in another picture.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Similarity {
    /// Pixels of the second picture per pixel of the first.
    pub scale: f64,
    /// Rotation angle from x to y, which is clockwise in the picture.
    pub rotation_rad: f64,
    /// Position of the first picture's upper left corner in the second.
    pub shift_px: [f64; 2],
}

impl Similarity {
    /// Returns the least-squares transform between pairs of points `[from, to]` in pixels (Umeyama,
    /// IEEE Transactions on Pattern Analysis 13, 1991).
    pub fn between(pairs: &[[[f64; 2]; 2]]) -> Self {
        let pairs = pairs.iter().map(|pair| pair.map(|[x, y]| Vec2::new(x, y)));
        let n = pairs.len().max(1) as f64;
        let [from, to] =
            [0, 1].map(|side| pairs.clone().fold(Vec2::ZERO, |sum, pair| sum + pair[side]) / n);
        // The sums of dot and cross products about the centroids are proportional to the cosine and
        // the sine of the rotation angle.
        let (mut dot, mut cross, mut square) = (0.0, 0.0, f64::MIN_POSITIVE);
        for [a, b] in pairs.map(|[a, b]| [a - from, b - to]) {
            dot += a.dot(b);
            cross += a.cross(b);
            square += a.hypot2();
        }
        let scale = libm::hypot(dot, cross) / square;
        let rotation_rad = libm::atan2(cross, dot);
        let [x, y] = Self { scale, rotation_rad, shift_px: [0.0; 2] }.apply([from.x, from.y]);
        Self { scale, rotation_rad, shift_px: [to.x - x, to.y - y] }
    }

    /// Returns the image of a point of the first photo, in pixels of the second.
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = libm::sincos(self.rotation_rad);
        let (a, b) = (self.scale * cos, self.scale * sin);
        [a * x - b * y + self.shift_px[0], b * x + a * y + self.shift_px[1]]
    }

    /// Returns the inverse transform.
    pub fn inverse(&self) -> Self {
        let back =
            Self { scale: 1.0 / self.scale, rotation_rad: -self.rotation_rad, shift_px: [0.0; 2] };
        Self { shift_px: back.apply(self.shift_px).map(|value| -value), ..back }
    }
}

/// Shrinks a photo so that its longer side has at most `longest_px` pixels. Each pixel is set to
/// the mean light of the pixels that it replaces. A small photo is returned unchanged.
pub fn shrink(photo: Photo, longest_px: u32) -> Photo {
    let longest = photo.width_px.max(photo.height_px);
    if longest <= longest_px {
        return photo;
    }
    let [width_px, height_px] = [photo.width_px, photo.height_px].map(|side| {
        let side = u64::from(side) * u64::from(longest_px) / u64::from(longest);
        u32::try_from(side).unwrap_or(longest_px).max(1)
    });
    // A box filter is applied to linear light.
    let linear = srgb::linear_from_level();
    let mut rgb8 = Vec::with_capacity(3 * width_px as usize * height_px as usize);
    for y in 0..height_px {
        let rows = replaced(y, height_px, photo.height_px);
        for x in 0..width_px {
            let columns = replaced(x, width_px, photo.width_px);
            let n = (rows.len() * columns.len()) as f32;
            let mut sum = [0.0_f32; 3];
            for row in rows.clone() {
                let first = row * photo.width_px as usize;
                let pixels = &photo.rgb8[3 * (first + columns.start)..3 * (first + columns.end)];
                for pixel in pixels.chunks_exact(3) {
                    for (sum, level) in sum.iter_mut().zip(pixel) {
                        *sum += linear[usize::from(*level)];
                    }
                }
            }
            rgb8.extend(sum.map(|sum| encoded(sum / n)));
        }
    }
    Photo::made(PhotoData { width_px, height_px, rgb8, ..photo.into_data() })
}

/// Returns the range of pixels, out of `n_before`, that are replaced by pixel `i` out of `n`.
fn replaced(i: u32, n: u32, n_before: u32) -> Range<usize> {
    let [begin, end] = [i, i + 1].map(|i| i as usize * n_before as usize / n as usize);
    begin..end.max(begin + 1)
}

/// Warps a render into a black picture of the given size. Returns the picture, and true for each
/// pixel that the render covers.
pub fn placed(
    render: &Photo,
    transform: &Similarity,
    [width_px, height_px]: [u32; 2],
) -> (Photo, Vec<bool>) {
    let back = transform.inverse();
    // A larger render is shrunk first, because otherwise its trails would have gaps.
    let longest_px = f64::from(render.width_px.max(render.height_px)) * transform.scale.min(1.0);
    #[expect(clippy::cast_possible_truncation, reason = "a side")]
    let small = shrink(render.clone(), (longest_px.round() as u32).max(1));
    // Both sides are rounded, so the two ratios differ slightly.
    let ratio = [
        f64::from(small.width_px) / f64::from(render.width_px),
        f64::from(small.height_px) / f64::from(render.height_px),
    ];
    let linear = srgb::linear_from_level();
    let [w, h] = [small.width_px, small.height_px].map(f64::from);
    let mut rgb8 = Vec::with_capacity(3 * width_px as usize * height_px as usize);
    let mut covered = Vec::with_capacity(width_px as usize * height_px as usize);
    for y in 0..height_px {
        for x in 0..width_px {
            let [render_x, render_y] = back.apply([f64::from(x) + 0.5, f64::from(y) + 0.5]);
            let (small_x, small_y) = (render_x * ratio[0], render_y * ratio[1]);
            let inside = (0.0..w).contains(&small_x) && (0.0..h).contains(&small_y);
            covered.push(inside);
            if !inside {
                rgb8.extend([0; 3]);
                continue;
            }
            // Linear light is interpolated bilinearly.
            let [(columns, u), (rows, v)] = [between(small_x, w), between(small_y, h)];
            rgb8.extend([0, 1, 2].map(|c| {
                let [above, below] = rows.map(|row| {
                    let [left, right] = columns.map(|column| {
                        let index = row * small.width_px as usize + column;
                        linear[usize::from(small.rgb8[3 * index + c])]
                    });
                    left + u * (right - left)
                });
                encoded(above + v * (below - above))
            }));
        }
    }
    (Photo::made(PhotoData { width_px, height_px, rgb8, scene_toml: None }), covered)
}

/// Returns the two pixels around a coordinate on a side of `n` pixels, and the second's weight from
/// 0 to 1. The first pixel is centered at 0.5.
fn between(coordinate: f64, n: f64) -> ([usize; 2], f32) {
    let position = (coordinate - 0.5).clamp(0.0, n - 1.0);
    let first = position.floor();
    #[expect(clippy::cast_possible_truncation, reason = "clamped")]
    let pixels = [first, (first + 1.0).min(n - 1.0)].map(|pixel| pixel as usize);
    #[expect(clippy::cast_possible_truncation, reason = "a fraction")]
    let weight = (position - first) as f32;
    (pixels, weight)
}

/// Overlays the luminance of two pictures of the same size. Where only the render is bright, the
/// overlay is orange. Where only the photo is bright, it is blue, and where both are, white. Panics
/// if the sizes differ.
pub fn overlay(render: &Photo, photo: &Photo) -> Photo {
    assert_eq!(render.rgb8.len(), photo.rgb8.len(), "pictures of one size");
    let linear = srgb::linear_from_level();
    let pairs = render.rgb8.chunks_exact(3).zip(photo.rgb8.chunks_exact(3));
    let rgb8 = pairs.flat_map(|(render, photo)| {
        let [render, photo] = [render, photo]
            .map(|p| srgb::luminance_f32([0, 1, 2].map(|c| linear[usize::from(p[c])])));
        [render, 0.4 * render + 0.6 * photo, photo].map(encoded)
    });
    Photo::made(PhotoData { rgb8: rgb8.collect(), scene_toml: None, ..**photo })
}

/// Returns the sRGB level from 0 to 255 closest to a linear light value. Light out of 0 to 1 is
/// limited to it.
#[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
fn encoded(light: f32) -> u8 {
    (255.0 * srgb::encoded_from_linear(f64::from(light.clamp(0.0, 1.0))) + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checks(width_px: u32, height_px: u32) -> Photo {
        let places = (0..height_px).flat_map(|y| (0..width_px).map(move |x| x + y));
        let rgb8 = places.flat_map(|sum| if sum.is_multiple_of(2) { [255; 3] } else { [0; 3] });
        let rgb8 = rgb8.collect();
        Photo::made(PhotoData { width_px, height_px, rgb8, scene_toml: None })
    }

    #[test]
    fn light_is_shrunk_in_linear_light() {
        let half = shrink(checks(8, 6), 4);
        assert_eq!((half.width_px, half.height_px), (4, 3));
        assert!(half.rgb8.iter().all(|level| *level == 188), "half the light is level 188");
        assert_eq!(shrink(checks(8, 6), 8), checks(8, 6));
    }

    #[test]
    fn a_similarity_is_found_from_pairs_of_points() {
        let known = Similarity { scale: 1.5, rotation_rad: 0.2, shift_px: [30.0, -7.0] };
        let points = [[0.0, 0.0], [100.0, 5.0], [40.0, 80.0]];
        let actual = Similarity::between(&points.map(|point| [point, known.apply(point)]));
        for (there, back) in points.map(|point| (point, known.inverse().apply(actual.apply(point))))
        {
            assert!((there[0] - back[0]).hypot(there[1] - back[1]) < 1e-9, "{actual:?}");
        }
    }

    #[test]
    fn a_render_is_laid_where_it_belongs() {
        let home = Similarity { scale: 1.0, rotation_rad: 0.0, shift_px: [2.0, 1.0] };
        let (laid, covered) = placed(&checks(4, 3), &home, [8, 6]);
        for y in 0..6 {
            for x in 0..8 {
                let inside = (2..6).contains(&x) && (1..4).contains(&y);
                assert_eq!(covered[y * 8 + x], inside, "{x},{y}");
                let white = inside && (x - 2 + y - 1).is_multiple_of(2);
                assert_eq!(laid.rgb8[3 * (y * 8 + x)], if white { 255 } else { 0 }, "{x},{y}");
            }
        }
    }

    #[test]
    fn an_overlay_is_white_where_both_are_and_colored_where_one_is() {
        let [black, white] = [0, 255].map(|level| {
            let rgb8 = vec![level; 3];
            Photo::made(PhotoData { width_px: 1, height_px: 1, rgb8, scene_toml: None })
        });
        assert_eq!(overlay(&white, &white).rgb8, [255; 3]);
        let render = overlay(&white, &black).into_data().rgb8;
        assert!(render[0] == 255 && render[2] == 0, "{render:?}");
        let photo = overlay(&black, &white).into_data().rgb8;
        assert!(photo[0] == 0 && photo[2] == 255, "{photo:?}");
    }
}
