//! Backdrop: the light of the room on its floor and walls, and the background picture.

use std::path::Path;
use std::sync::Arc;

use nalgebra::Vector3;

use super::Photo;
use super::options::PhotoOptions;
use crate::expose::{ExposeOptions, Reflectance, Room};
use crate::{narrow, whole};
use noctograph_core::camera::Camera;
use noctograph_core::error::{Error, Result};
use noctograph_core::srgb;

/// The light of the room and of the background, relative to white.
#[derive(Debug)]
pub(super) struct Backdrop {
    /// Light of the room in the middle of the picture.
    room: [f32; 3],
    /// Square of the focal length, in square pixels.
    focal_sq_px2: f32,
    center_px: [f32; 2],
    /// Fraction of the light that vignetting removes, per squared pixel distance from the middle.
    vignetting_px2: f32,
    picture: Option<Picture>,
    /// Floor and walls with their camera, if the room has walls.
    surfaces: Option<(Camera, Room)>,
    /// Position of a gap, as of a door, through which half of the room's light enters.
    gap_m: Option<Vector3<f64>>,
}

/// Distance in pixels between columns, between which a surface's light is interpolated.
const STEP_PX: usize = 8;

/// A background picture, scaled to the photo.
#[derive(Debug)]
struct Picture {
    background: Photo,
    /// Linear light of each level.
    light: [f32; 256],
    /// Number of the picture's pixels per pixel of the photo.
    scale: f64,
    /// The two columns to interpolate for each pixel, and the weight of the second one.
    columns: Vec<([usize; 2], f32)>,
}

impl Backdrop {
    /// Prepares the light of a room, and reads the background picture if there is one. `white_lx_s`
    /// is the exposure of white. Returns [`Error::Input`] for a background that cannot be read.
    pub(super) fn new(
        camera: &Camera,
        room: &ExposeOptions,
        options: &PhotoOptions,
        white_lx_s: f64,
    ) -> Result<Self> {
        let surfaces = room.room_m.map(|_| (camera.clone(), Room::new(room, camera.position_m)));
        let luminance = srgb::luminance(options.ambient_rgb);
        let light = camera.lx_s_of_luminance() * options.ambient_cd_m2 / luminance / white_lx_s;
        let focal_px = narrow(camera.focal_length_px());
        let picture = match &options.background[..] {
            "" => None,
            path => Some(Picture::read(path, camera, options)?),
        };
        let center_px = [camera.width_px, camera.height_px].map(|side| side as f32 / 2.0);
        let corner_sq_px2 = center_px[0] * center_px[0] + center_px[1] * center_px[1];
        Ok(Self {
            room: options.ambient_rgb.map(|fraction| narrow(light * fraction)),
            focal_sq_px2: focal_px * focal_px,
            center_px,
            vignetting_px2: narrow(camera.vignetting) / corner_sq_px2,
            picture,
            surfaces,
            gap_m: options.ambient_from_m.map(Vector3::from),
        })
    }

    /// Adds the room's light to row `y` before the sensor reads it, relative to white. A background
    /// replaces this light.
    pub(super) fn add_room(&self, y: usize, rows: &mut [Vec<f32>; 3]) {
        if self.picture.is_some() || self.room == [0.0; 3] {
            return;
        }
        let mut relative = self.surface_luminances(y, rows[0].len());
        let dy = y as f32 + 0.5 - self.center_px[1];
        noctograph_core::dispatch!(|| {
            // Natural vignetting, cos⁴ = (f² / (f² + r²))², times the vignetting of the lens.
            for (x, relative) in (0_u16..).zip(&mut relative) {
                let dx = f32::from(x) + 0.5 - self.center_px[0];
                let radius_sq = dy * dy + dx * dx;
                let cos_sq = self.focal_sq_px2 / (self.focal_sq_px2 + radius_sq);
                *relative *= cos_sq * cos_sq * (1.0 - self.vignetting_px2 * radius_sq).max(0.0);
            }
            for (row, room) in rows.iter_mut().zip(self.room) {
                row.iter_mut().zip(&relative).for_each(|(light, factor)| *light += room * factor);
            }
        });
    }

    /// Adds the background picture to a row after the sensor has read the row, because the
    /// background already went through a sensor.
    pub(super) fn add_picture(&self, y: usize, rows: &mut [Vec<f32>; 3]) {
        if let Some(picture) = &self.picture {
            picture.add(y, self.center_px[1], rows);
        }
    }

    /// Returns the luminance of floor and walls along a row, relative to the middle of a wall. The
    /// luminance is 1 if there are no walls.
    fn surface_luminances(&self, y: usize, width: usize) -> Vec<f32> {
        let Some((camera, room)) = &self.surfaces else { return vec![1.0; width] };
        // Computes the luminance at every eighth column, and interpolates between two columns that
        // show the same surface.
        let mut row = Vec::with_capacity(width + STEP_PX);
        let (mut left_surface, mut left) = self.luminance(camera, room, 0.0, y as f64);
        for i in 0..width.div_ceil(STEP_PX) {
            // Samples the row's upper and lower edge in turn, to detect a room edge along the row.
            let right_px = [((i + 1) * STEP_PX) as f64, (y + (i + 1) % 2) as f64];
            let (right_surface, right) = self.luminance(camera, room, right_px[0], right_px[1]);
            for j in 0..STEP_PX {
                row.push(if left_surface == right_surface {
                    left + (right - left) * ((j as f32 + 0.5) / STEP_PX as f32)
                } else {
                    // The light of a pixel near an edge of the room is the mean over four points.
                    let x = (i * STEP_PX + j) as f64;
                    let points = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]];
                    let luminances = points
                        .map(|[dx, dy]| self.luminance(camera, room, x + dx, y as f64 + dy).1);
                    luminances.iter().sum::<f32>() * 0.25
                });
            }
            (left_surface, left) = (right_surface, right);
        }
        row
    }

    /// Returns the surface at a point of the picture in pixels, if there is one, and its luminance
    /// relative to the middle of a wall.
    fn luminance(&self, camera: &Camera, room: &Room, x: f64, y: f64) -> (Option<usize>, f32) {
        let hit = camera.world_from_image(x, y).and_then(|ray| room.intersection(ray));
        let luminance = hit.map_or(0.0, |(on, point_m)| {
            narrow(room.ambient(on, point_m, self.gap_m) * room.relative_albedo(on, point_m))
        });
        (hit.map(|(on, _)| on), luminance)
    }
}

/// Returns the albedo of floor and walls relative to its median, or `None` if there is no
/// background. The albedo is taken from the background's brightness in each channel, as if the room
/// had been evenly lit, and is 4 at most.
///
/// # Errors
///
/// Returns the same errors as [`super::read`].
pub fn reflectance(camera: &Camera, options: &PhotoOptions) -> Result<Option<Reflectance>> {
    if options.background.is_empty() {
        return Ok(None);
    }
    let picture = Picture::read(&options.background, camera, options)?;
    let (width, height) = (camera.width_px as usize, camera.height_px as usize);
    let mut planes = [0; 3].map(|_| Vec::with_capacity(width * height));
    for y in 0..height {
        let mut rows = [0; 3].map(|_| vec![0.0; width]);
        picture.add(y, height as f32 / 2.0, &mut rows);
        planes.iter_mut().zip(rows).for_each(|(plane, row)| plane.extend(row));
    }
    // Levels lower than this would only add noise.
    let darkest = picture.light[DARKEST_LEVEL];
    for plane in &mut planes {
        let mut sorted = plane.clone();
        let (_, median, _) = sorted.select_nth_unstable_by(width * height / 2, f32::total_cmp);
        let median = median.max(darkest);
        plane.iter_mut().for_each(|light| *light = (light.max(darkest) / median).min(BRIGHTEST));
    }
    Ok(Some(Arc::new(planes)))
}

/// Minimum level of a background. Darker pixels are raised to this level.
const DARKEST_LEVEL: usize = 4;

/// Maximum light of a surface, relative to the median.
const BRIGHTEST: f32 = 4.0;

impl Picture {
    /// Reads a background picture and scales it so that it covers the photo. Returns the errors of
    /// [`super::read`].
    fn read(path: &str, camera: &Camera, options: &PhotoOptions) -> Result<Self> {
        // A web page has no access to files, and its module has no decoder for photos.
        if cfg!(target_family = "wasm") {
            let (wanted, hint) =
                ("no background on a web page", "use the program, which reads files");
            return Err(Error::input("photo.background", path, wanted, hint));
        }
        let background = super::read(Path::new(path))?;
        let size_px = [background.width_px, background.height_px].map(f64::from);
        let photo_px = [camera.width_px, camera.height_px].map(f64::from);
        let scale = (size_px[0] / photo_px[0]).min(size_px[1] / photo_px[1]);
        let factor = libm::exp2(options.background_stops);
        let light =
            std::array::from_fn(|level| narrow(factor * options.tone.decode(level as f64 / 255.0)));
        let columns = (0..camera.width_px)
            .map(|x| between(f64::from(x) + 0.5 - photo_px[0] / 2.0, scale, background.width_px))
            .collect();
        Ok(Self { background, light, scale, columns })
    }

    /// Adds the picture to row `y` by bilinear interpolation of linear light relative to white. The
    /// sum is at most 1.
    fn add(&self, y: usize, center_y_px: f32, rows: &mut [Vec<f32>; 3]) {
        let from_center_px = y as f64 + 0.5 - f64::from(center_y_px);
        let ([above, below], down) = between(from_center_px, self.scale, self.background.height_px);
        let width = self.background.width_px as usize;
        for (channel, row) in rows.iter_mut().enumerate() {
            let light = |x: usize, y: usize| {
                self.light[usize::from(self.background.rgb8[3 * (y * width + x) + channel])]
            };
            for (value, &([left, right], along)) in row.iter_mut().zip(&self.columns) {
                let [above, below] = [above, below]
                    .map(|y| light(left, y) + along * (light(right, y) - light(left, y)));
                *value = (*value + above + down * (below - above)).min(1.0);
            }
        }
    }
}

/// Returns the two of `n` pixels around a position, and the weight of the second one. The position
/// is given relative to the middle in pixels of the photo, each of which is `scale` pixels wide.
fn between(from_middle: f64, scale: f64, n: u32) -> ([usize; 2], f32) {
    let position = from_middle * scale + f64::from(n) / 2.0 - 0.5;
    let position = position.clamp(0.0, f64::from(n - 1));
    let first = whole(position);
    ([first, (first + 1).min(n as usize - 1)], narrow(position - first as f64))
}
