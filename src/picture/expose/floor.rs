//! Glow of the room: the light of the lamps that floor and walls reflect into the camera.
//!
//! A matte surface of albedo ρ that receives E lx s has a luminance, integrated over time, of `ρ E
//! / π` cd s/m² in every direction, and leaves `ρ τ E cos⁴ / (4 N²)` lx s on the sensor. E is the
//! sum of `I(θ) cos / d²` over all lamps and times (Lambert's law and the inverse square law).
//!
//! 1. The lamps become point sources (see `sources`). For the walls, the floor becomes a grid of
//!    point sources as well, which emit the light that it reflects.
//! 2. The picture is divided into a quadtree (Finkel and Bentley 1974). A square is quartered as
//!    long as its center differs from the mean of its corners, or a lamp is low above it.
//! 3. The light is interpolated bilinearly within each square, and counted with the film's dither.
//!
//! The model ignores light that walls reflect back, and the drone's shadow.

use std::sync::Arc;

use nalgebra::Vector3;
use noctograph_core::parallel::prelude::*;

use super::record::DITHER;
use super::sources::{Rgb, Tree, exposures_lx_s, reflected, trees};
use super::{Detail, ExposeOptions, FilmData, Room, texture};
use crate::light::LightTrace;
use crate::narrow;
use noctograph_core::camera::Camera;

/// Side of the squares before they are quartered, in pixels.
const SIDE_PX: u32 = 32;

/// The light of the room in a picture, divided into squares.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Glow {
    /// The squares in each band of [`SIDE_PX`] rows.
    bands: Vec<Vec<Square>>,
    /// Relative standard deviation of the floor's albedo.
    unevenness: f32,
    pub(super) peak_lx_s: f64,
    /// Reflectance of a photographed room, which replaces the unevenness.
    pub(super) reflectance: Option<Reflectance>,
}

/// Reflectance of floor and walls at each pixel in red, green and blue, relative to their albedo.
pub type Reflectance = Arc<[Vec<f32>; 3]>;

/// A square of the picture, and the exposure in lx s at each of its [`corners`].
#[derive(Clone, Debug, PartialEq)]
struct Square {
    corner_px: [u32; 2],
    side_px: u32,
    corners_lx_s: [Rgb; 4],
    /// Texture coordinates of the corners on the floor. `None` on walls, at edges and in the dark.
    on_texture: Option<[[f32; 2]; 4]>,
}

/// Returns the corners of a square: top left, top right, bottom left and bottom right.
fn corners([x, y]: [u32; 2], side_px: u32) -> [[u32; 2]; 4] {
    [[x, y], [x + side_px, y], [x, y + side_px], [x + side_px, y + side_px]]
}

/// The lit room in a camera's view.
struct Floor<'a> {
    camera: &'a Camera,
    room: Room,
    /// The trees of the lamps. If there are walls, the tree of the floor follows.
    trees: Vec<Tree<'a>>,
    n_lamp_trees: usize,
    /// Points on the floor straight below low sources: x, y and the source's height, in pixels.
    feet_px: Vec<[f64; 3]>,
    detail: Detail,
    /// Difference of exposure that is always negligible, computed from [`Detail::even`].
    even_lx_s: f64,
}

impl Glow {
    /// Returns the glow of a trace, or `None` if floor and walls are black or out of view.
    pub(super) fn new(
        trace: &LightTrace,
        camera: &Camera,
        options: &ExposeOptions,
    ) -> Option<Self> {
        let room = Room::new(options, camera.position_m);
        if room.surfaces.iter().all(|surface| surface.albedo == 0.0) {
            return None;
        }
        let floor = Floor::new(trace, camera, options, room);
        let [columns, rows] = [camera.width_px, camera.height_px].map(|px| px.div_ceil(SIDE_PX));
        // Computes the exposure at the corners of the coarse grid, at which up to four squares
        // meet.
        let corners = (0..=rows).into_par_iter().map(|j| {
            let points_px = (0..=columns).map(|i| [[i * SIDE_PX, j * SIDE_PX]]);
            points_px.flat_map(|point_px| floor.exposures_lx_s(point_px)).collect()
        });
        let corners: Vec<Vec<Rgb>> = corners.collect();
        // The bands of the picture are divided in parallel.
        let rows = (0..rows).into_par_iter().zip(corners.par_windows(2));
        let bands = rows.map(|(j, corners)| {
            let mut squares = Vec::new();
            // Squares of this band can only be close to the sources whose foot is near the band.
            let middle_px = f64::from(j * SIDE_PX + SIDE_PX / 2);
            let mut feet_px = floor.feet_px.clone();
            feet_px.retain(|[_, y, _]| (y - middle_px).abs() < f64::from(SIDE_PX));
            let pairs = corners[0].windows(2).zip(corners[1].windows(2));
            for (i, (above, below)) in (0..).zip(pairs) {
                let corners_lx_s = [above[0], above[1], below[0], below[1]];
                let corner_px = [i * SIDE_PX, j * SIDE_PX];
                let square = Square { corner_px, side_px: SIDE_PX, corners_lx_s, on_texture: None };
                let [middle_lx_s] = floor.exposures_lx_s([corner_px.map(|px| px + SIDE_PX / 2)]);
                floor.divide(square, middle_lx_s, &feet_px, &mut squares);
            }
            squares
        });
        let bands: Vec<Vec<Square>> = bands.collect();
        let peak_lx_s = bands.iter().flatten().map(Square::peak_lx_s).reduce(f64::max)?;
        let unevenness = narrow(options.unevenness);
        Some(Self { bands, unevenness, peak_lx_s, reflectance: None })
    }

    /// Returns the first row with glow, or 0 if there is none.
    pub(super) fn top_px(&self) -> usize {
        self.bands.iter().flatten().map(|square| square.corner_px[1] as usize).min().unwrap_or(0)
    }

    /// Adds the glow to a film, whose scale is at least that of
    /// [`finest_scale_log2`](super::film::finest_scale_log2). The bands are processed in parallel.
    pub(super) fn add_to(&self, film: &mut FilmData) {
        let per_lx_s = libm::ldexp(1.0, -film.scale_log2);
        let (width, pixels) = (film.width_px as usize, film.counts.len() / 3);
        let (red, others) = film.counts.split_at_mut(pixels);
        let (green, blue) = others.split_at_mut(pixels);
        let planes = [red, green, blue].map(|plane| plane.par_chunks_mut(SIDE_PX as usize * width));
        let [red, green, blue] = planes;
        let bands = red.zip(green).zip(blue).zip(&self.bands);
        bands.enumerate().for_each(|(band, (((red, green), blue), squares))| {
            // Selects the band's rows in the planes of the film and of the photographed room.
            let mut planes = [red, green, blue];
            let first = band * SIDE_PX as usize * width;
            let room = self.reflectance.as_ref();
            let reflected = [0, 1, 2].map(|channel| room.map(|room| &room[channel][first..]));
            noctograph_core::dispatch!(|| for square in squares {
                let light =
                    square.corners_lx_s.map(|rgb| rgb.map(|light| narrow(light * per_lx_s)));
                square.add_to(light, self.unevenness, reflected, &mut planes, width);
            });
        });
    }
}

impl Square {
    /// Returns the maximum exposure at the corners.
    fn peak_lx_s(&self) -> f64 {
        self.corners_lx_s.as_flattened().iter().copied().fold(0.0, f64::max)
    }

    /// Adds the light, given in counts at the corners, to the square's band in the film's planes.
    /// The light is multiplied by the relative albedo from `reflected`, which starts at the band's
    /// first pixel. Without it, the albedo is that of the floor's texture, whose standard deviation
    /// is `unevenness`. Rows and columns beyond the film are left out.
    #[inline(always)]
    fn add_to(
        &self,
        corners: [[f32; 3]; 4],
        unevenness: f32,
        reflected: [Option<&[f32]>; 3],
        planes: &mut [&mut [u32]; 3],
        width: usize,
    ) {
        let [x, y] = self.corner_px;
        let (left, top) = (x as usize, y % SIDE_PX);
        let step = 1.0 / self.side_px as f32;
        // The last squares of a row extend beyond the film.
        let across = (self.side_px as usize).min(width.saturating_sub(left));
        if across == 0 {
            return;
        }
        let rows = (planes[0].len() / width).saturating_sub(top as usize);
        let mut albedo = [1.0; SIDE_PX as usize];
        for row in (0..self.side_px).take(rows) {
            // Computes the row's relative albedo from the floor's texture or the photographed room.
            let down = (row as f32 + 0.5) * step;
            if let (Some(points), None) = (self.on_texture, reflected[0]) {
                let points = along(points, down, step);
                for (albedo, point) in albedo[..across].iter_mut().zip(points) {
                    *albedo = (1.0 + unevenness * texture::deviation(point)).max(0.0);
                }
            }
            let first = (top + row) as usize * width + left;
            let dither = DITHER[0].wrapping_mul(x).wrapping_add(DITHER[1].wrapping_mul(y + row));
            for (channel, plane) in planes.iter_mut().enumerate() {
                if let Some(reflected) = reflected[channel] {
                    albedo[..across].copy_from_slice(&reflected[first..][..across]);
                }
                // Ordered dither: each count is rounded at the threshold of its pixel.
                let lights = along(corners.map(|rgb| [rgb[channel]]), down, step);
                let counts = plane[first..][..across].iter_mut().zip(&albedo);
                for (i, ((count, albedo), [light])) in (0..).zip(counts.zip(lights)) {
                    let dither = dither.wrapping_add(DITHER[0].wrapping_mul(i));
                    // The upper 24 bits divided by 2^24 give a threshold from 0 to 1.
                    let threshold = (dither >> 8).cast_signed() as f32 * (1.0 / 16_777_216.0);
                    #[expect(clippy::cast_possible_truncation, reason = "below 2^31")]
                    let rounded = (light * albedo + threshold) as i32;
                    *count = count.wrapping_add(rounded.cast_unsigned());
                }
            }
        }
    }

    /// True if a source is above or beside the square, and lower than the square is wide. The
    /// source is given by the point below it and its height, all in pixels.
    fn is_under(&self, [x, y, height_px]: [f64; 3]) -> bool {
        let side = f64::from(self.side_px);
        let mut pairs = [x, y].into_iter().zip(self.corner_px);
        height_px < side
            && pairs.all(|(foot, corner)| (foot - f64::from(corner) - 0.5 * side).abs() < side)
    }
}

/// Interpolates bilinearly between a square's corners at the pixel centers of one row. `down` is
/// the fraction of the square above the row's center, and `step` that of one pixel.
#[inline(always)]
fn along<const N: usize>(
    [nw, ne, sw, se]: [[f32; N]; 4],
    down: f32,
    step: f32,
) -> impl Iterator<Item = [f32; N]> {
    let left: [f32; N] = std::array::from_fn(|n| nw[n] + (sw[n] - nw[n]) * down);
    let right: [f32; N] = std::array::from_fn(|n| ne[n] + (se[n] - ne[n]) * down);
    let slope: [f32; N] = std::array::from_fn(|n| (right[n] - left[n]) * step);
    (0_u8..).map(move |i| {
        let middle = f32::from(i) + 0.5;
        std::array::from_fn(|n| left[n] + slope[n] * middle)
    })
}

impl<'a> Floor<'a> {
    /// Prepares the sources of light of a trace, and those of the floor if there are walls.
    fn new(trace: &'a LightTrace, camera: &'a Camera, options: &ExposeOptions, room: Room) -> Self {
        let z_m = options.floor_z_m;
        let mut trees = trees(trace, camera, z_m, options.detail.opening);
        // Lists the points below sources so low that their light varies within a square.
        let feet_px = trees.iter().flat_map(|tree| &tree.branches).filter_map(|branch| {
            let source_m = branch.source.position_m;
            let image = camera.image_from_world(Vector3::new(source_m.x, source_m.y, z_m))?;
            let height_px = (source_m.z - z_m) * camera.focal_length_px() / image.depth_m;
            (height_px < f64::from(SIDE_PX)).then_some([image.x_px, image.y_px, height_px])
        });
        let feet_px = feet_px.collect();
        // The light that the floor reflects illuminates the walls.
        let n_lamp_trees = trees.len();
        if let Some([width_m, depth_m, _]) = options.room_m {
            let floor = reflected(&trees, [width_m, depth_m], z_m, options.floor_albedo);
            trees.push(floor);
        }
        let detail = options.detail;
        let even_lx_s = detail.even[1] * camera.saturation_lx_s();
        Self { camera, room, trees, n_lamp_trees, feet_px, detail, even_lx_s }
    }

    /// Returns the exposure of the sensor at corners of pixels that are close together. The
    /// exposure is 0 outside the surfaces of the room.
    fn exposures_lx_s<const N: usize>(&self, corners_px: [[u32; 2]; N]) -> [Rgb; N] {
        let camera = self.camera;
        // Computes for each corner the surface, the point on it, the direction to the camera, and
        // the ratio of light on the sensor to light on the surface.
        let hits = corners_px.map(|corner_px| {
            let [x_px, y_px] = corner_px.map(f64::from);
            let ray = camera.world_from_image(x_px, y_px)?;
            let (on, point_m) = self.room.intersection(ray)?;
            // The ratio of exposure on the sensor to exposure on the surface is ρ τ cos⁴ / (4 N²).
            let cos = (camera.camera_from_world * ray).z;
            let n = camera.f_number;
            let reflected = self.room.surfaces[on].albedo * camera.transmission / (4.0 * n * n);
            let factor = reflected * cos * cos * cos * cos * camera.unvignetted(x_px, y_px);
            Some((on, point_m, -ray, factor))
        });
        // Points on the same surface are computed together, and other points one by one.
        let first = hits[0].map(|(on, ..)| on);
        let is_same = hits.iter().all(|hit| hit.map(|(on, ..)| on) == first);
        let Some(on) = first.filter(|_| is_same) else {
            return match N {
                1 => [[0.0; 3]; N],
                _ => corners_px.map(|corner_px| self.exposures_lx_s([corner_px])[0]),
            };
        };
        let hits = hits.map(|hit| hit.expect("all are on the surface of the first"));
        let points_m = hits.map(|(_, point_m, ..)| point_m);
        let toward = hits.map(|(_, _, to_camera, _)| to_camera);
        let surface = &self.room.surfaces[on];
        // The floor does not light itself.
        let n_trees = if surface.is_floor() { self.n_lamp_trees } else { self.trees.len() };
        let trees = &self.trees[..n_trees];
        let exposures: [Rgb; N] =
            noctograph_core::dispatch!(|| exposures_lx_s(trees, points_m, surface, toward));
        std::array::from_fn(|n| exposures[n].map(|channel| channel * hits[n].3))
    }

    /// Returns a square's corners on the texture of the floor, in nodes of the texture. Returns
    /// `None` if a corner is not on the floor, or if the square is too dark to show the texture.
    fn on_texture(&self, square: &Square) -> Option<[[f32; 2]; 4]> {
        if square.peak_lx_s() * self.room.unevenness <= self.even_lx_s {
            return None;
        }
        let [nw, ne, sw, se] = corners(square.corner_px, square.side_px).map(|corner_px| {
            let [x_px, y_px] = corner_px.map(f64::from);
            let (on, point_m) =
                self.room.intersection(self.camera.world_from_image(x_px, y_px)?)?;
            self.room.surfaces[on].is_floor().then(|| self.room.on_texture(on, point_m))
        });
        Some([nw?, ne?, sw?, se?])
    }

    /// Appends an even square to `squares`, divides any other square, and drops dark squares.
    /// `middle` is the exposure at its center in lx s. `feet_px` contains the points below sources
    /// that may be under it, each with the source's height.
    fn divide(&self, square: Square, middle: Rgb, feet_px: &[[f64; 3]], squares: &mut Vec<Square>) {
        let Square { corner_px: [x, y], side_px, corners_lx_s: [nw, ne, sw, se], .. } = square;
        let (half, quarter) = (side_px / 2, side_px / 4);
        let uneven = (0..3).any(|c| {
            let mean = 0.25 * (nw[c] + ne[c] + sw[c] + se[c]);
            (middle[c] - mean).abs() > self.detail.even[0] * middle[c].max(mean) + self.even_lx_s
        });
        // Points under a quarter of the square are also under the square.
        let feet_px = feet_px.iter().copied().filter(|foot_px| square.is_under(*foot_px));
        let feet_px: Vec<[f64; 3]> = feet_px.collect();
        if half < self.detail.least_square_px || (!uneven && feet_px.is_empty()) {
            if square.corners_lx_s != [[0.0; 3]; 4] {
                let on_texture = self.on_texture(&square);
                squares.push(Square { on_texture, ..square });
            }
            return;
        }
        // The quarters need the exposure at the midpoints of the sides and at their own centers.
        let quarters_px = corners([x, y], half);
        let [m_nw, m_ne, m_sw, m_se] = quarters_px.map(|corner| corner.map(|px| px + quarter));
        let [north, south, west, east, m_nw, m_ne, m_sw, m_se] = self.exposures_lx_s([
            [x + half, y],
            [x + half, y + side_px],
            [x, y + half],
            [x + side_px, y + half],
            m_nw,
            m_ne,
            m_sw,
            m_se,
        ]);
        let quarters = [
            ([nw, north, west, middle], m_nw),
            ([north, ne, middle, east], m_ne),
            ([west, middle, sw, south], m_sw),
            ([middle, east, south, se], m_se),
        ];
        for (corner_px, (corners_lx_s, middle)) in quarters_px.into_iter().zip(quarters) {
            let quarter = Square { corner_px, side_px: half, corners_lx_s, on_texture: None };
            self.divide(quarter, middle, &feet_px, squares);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{hanging, looking_down};
    use super::*;

    const MATTE: ExposeOptions = ExposeOptions {
        merge_tolerance_px: 0.005,
        detail: Detail::PICTURE,
        floor_albedo: 0.5,
        floor_z_m: 0.0,
        floor_roughness: None,
        room_m: None,
        wall_albedo: 0.4,
        unevenness: 0.0,
    };

    /// Returns a film of the glow without the lamp itself.
    fn glow_alone(trace: &LightTrace, options: &ExposeOptions) -> FilmData {
        let counts = vec![0; 3 * 320 * 200];
        let mut film = FilmData { width_px: 320, height_px: 200, counts, scale_log2: -24 };
        Glow::new(trace, &looking_down(), options).unwrap().add_to(&mut film);
        film
    }

    #[test]
    fn a_lamp_over_a_matte_floor_leaves_the_textbook_exposure() {
        let (camera, height_m) = (looking_down(), 0.4);
        let film = glow_alone(&hanging([0.1, 2.2, height_m]), &MATTE);
        for [x, y] in [[0.1, 2.2], [0.0, 2.0], [-0.5, 1.6], [0.4, 2.9], [0.6, 2.0]] {
            let point_m = Vector3::new(x, y, 0.0);
            let image = camera.image_from_world(point_m).unwrap();
            // A Lambertian lamp causes E = I cos² / d², and the floor's luminance is L = ρ E / π.
            let d_sq = height_m * height_m + (x - 0.1) * (x - 0.1) + (y - 2.2) * (y - 2.2);
            let e_lx_s = 1.8 * height_m * height_m / d_sq / d_sq * 3.0;
            let cos = image.depth_m / (point_m - camera.position_m).norm();
            let wanted = 0.5 * 0.9 / (4.0 * 64.0) * e_lx_s * cos * cos * cos * cos;
            #[expect(clippy::cast_possible_truncation, reason = "a pixel")]
            let index = image.y_px as usize * 320 + image.x_px as usize;
            let actual = film.exposure_lx_s(1, index);
            assert!((actual / wanted - 1.0).abs() < 0.03, "{actual} at {x}, {y}, wanted {wanted}");
        }
    }

    /// Compares the uneven floor with the even one, pixel by pixel. The uneven floor must be as
    /// uneven as requested, and as bright as the even one.
    #[test]
    fn an_uneven_floor_reflects_as_much_as_an_even_one() {
        let lit = [0.1, 0.0].map(|unevenness| {
            let options = ExposeOptions { unevenness, ..MATTE };
            glow_alone(&hanging([0.1, 2.2, 0.4]), &options).counts
        });
        let ratios = lit[0].iter().zip(&lit[1]);
        let ratios = ratios.map(|(uneven, even)| f64::from(*uneven) / f64::from(*even) - 1.0);
        let ratios = Vec::from_iter(ratios);
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        let variance =
            ratios.iter().map(|r| (r - mean) * (r - mean)).sum::<f64>() / ratios.len() as f64;
        assert!(mean.abs() < 0.02, "{mean}");
        assert!((0.07..0.13).contains(&variance.sqrt()), "{}", variance.sqrt());
    }

    #[test]
    fn a_photographed_room_reflects_at_each_pixel_as_it_does() {
        let (trace, camera) = (hanging([0.1, 2.2, 0.4]), looking_down());
        let room = [1.0, 2.0, 0.5].map(|channel| {
            (0..320 * 200).map(|i| if i % 320 < 160 { channel } else { 0.0 }).collect()
        });
        let options = ExposeOptions { unevenness: 0.1, ..MATTE };
        let [even, lit] =
            [(MATTE, None), (options, Some(Arc::new(room)))].map(|(options, room)| {
                let latent = super::super::project(&trace, &camera, &options).unwrap();
                let mut latent = latent.reflected_by(room);
                latent.tints.clear();
                latent.on_cpu().film
            });
        for (channel, fraction) in [1.0, 2.0, 0.5].into_iter().enumerate() {
            let [left, right] = [100 * 320 + 120, 100 * 320 + 200];
            let ratio = lit.exposure_lx_s(channel, left) / even.exposure_lx_s(channel, left);
            assert!((ratio / fraction - 1.0).abs() < 1e-3, "{ratio} for {fraction}");
            assert_eq!(lit.exposure_lx_s(channel, right), 0.0, "black");
        }
    }

    #[test]
    fn no_glow_without_light_albedo_or_a_view_of_the_floor() {
        let (trace, camera) = (hanging([0.1, 2.2, 0.4]), looking_down());
        let mut up = trace.clone();
        up.edit(|up| up.lamps[0].samples.iter_mut().for_each(|sample| sample.axis = Vector3::z()));
        assert_eq!(Glow::new(&up, &camera, &MATTE), None, "a lamp that shines up");
        let black = ExposeOptions { floor_albedo: 0.0, ..MATTE };
        assert_eq!(Glow::new(&trace, &camera, &black), None, "a black floor");
        let camera_from_world =
            noctograph_core::geometry::camera_from_world(Vector3::new(0.0, 1.0, 2.0));
        for (case, camera) in [
            ("looks up", Camera { camera_from_world, ..camera.clone() }),
            ("on the floor", Camera { position_m: Vector3::z() * 0.05, ..camera.clone() }),
            ("later", Camera { shutter_open_s: 5.0, shutter_close_s: 9.0, ..camera }),
        ] {
            assert_eq!(Glow::new(&trace, &camera, &MATTE), None, "{case}");
        }
    }
}
