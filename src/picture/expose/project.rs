//! Projects lamps: position, brightness and width of their spots in the picture, in f64.
//!
//! A lamp of intensity `I` cd gives `I(θ) cosα / d²` lx at the entrance pupil (θ from the beam
//! axis, α from the optical axis). A pupil of diameter `f/N` passes `π (f/2N)² τ` times that in
//! lumens, all of which fall into the spot. "Light" here means lumens per pixel area, summed over
//! the pixels of the spot, in lx px².
//!
//! A small lamp is drawn as a disc that faces the camera and widens the lens's Gaussian. A
//! cylinder, such as a diffuser, becomes a blurred rectangle with its bounding box's size.

use glam::DVec2;
use nalgebra::Vector3;

use crate::light::{Emitter, Lamp, LightSample};
use noctograph_core::camera::Camera;

pub(super) type Px = DVec2;

/// Minimum depth of a lamp that leaves light. The model of focus and pupil size is not valid for
/// nearer points.
pub(super) const NEAREST_M: f64 = 0.1;

/// σ of the narrowest spot. Sampled at pixel centers, the sum of a Gaussian of this width varies by
/// 1.4 % with its position (`2 exp(-2 π² σ²)`), so curves are divided by their sums.
pub(super) const MIN_SIGMA_PX: f64 = 0.5;

/// σ of the widest spot. Wider spots are drawn with this σ and all of their light.
pub(super) const MAX_SIGMA_PX: f64 = 256.0;

/// Maximum distance of a spot from the corner of the picture, which keeps differences precise.
const FARTHEST_PX: f64 = 1e9;

/// Wavelength for the diffraction, at the peak of photopic vision.
const WAVELENGTH_M: f64 = 0.55e-6;

/// σ of the Gaussian closest to an Airy disc, in units of λN (0.21 λ / numerical aperture: Zhang,
/// Zerubia and Olivo-Marin 2007).
const AIRY_SIGMA: f64 = 0.42;

/// Variance of a square pixel along each axis, in px².
const PIXEL_VARIANCE: f64 = 1.0 / 12.0;

/// Motion of a spot between two neighboring samples while the shutter is open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Interval {
    pub(super) time_s: [f64; 2],
    pub(super) at_px: [Px; 2],
    /// Brightness of the spot at the start and the end, linear in between.
    pub(super) light_lx_px2: [f64; 2],
    /// Standard deviation of the spot, averaged over both ends.
    pub(super) sigma_px: f64,
    /// Half the size of the box around a cylinder, averaged over both ends, or 0 for a disc.
    pub(super) half_px: Px,
}

impl Interval {
    /// Returns the light over the interval in lx s px²: the mean brightness times the duration.
    pub(super) fn light(&self) -> f64 {
        0.5 * (self.light_lx_px2[0] + self.light_lx_px2[1]) * (self.time_s[1] - self.time_s[0])
    }
}

/// The image of a lamp at one instant.
#[derive(Clone, Copy)]
struct Spot {
    at_px: Px,
    light_lx_px2: f64,
    sigma_px: f64,
    half_px: Px,
}

/// Returns the intervals in which a lamp leaves light in the picture, in order of time.
pub(super) fn intervals<'a>(
    lamp: &'a Lamp,
    camera: &'a Camera,
) -> impl Iterator<Item = Interval> + 'a {
    let lens = Lens::new(camera, &lamp.emitter);
    let (open, close) = (camera.shutter_open_s, camera.shutter_close_s);
    let mut last: Option<(LightSample, Option<Spot>)> = None;
    lamp.samples.windows(2).filter_map(move |pair| {
        let (a, b) = (pair[0], pair[1]);
        let in_shutter = a.time_s < b.time_s && b.time_s > open && a.time_s < close;
        if !in_shutter || (a.level == 0.0 && b.level == 0.0) {
            return None;
        }
        let first = if a.time_s < open { a.toward(&b, open) } else { a };
        let second = if b.time_s > close { a.toward(&b, close) } else { b };
        // The start is usually the end of the previous interval, which was already projected.
        let from = match last {
            Some((sample, spot)) if sample == first => spot,
            _ => lens.spot(&first),
        };
        let to = lens.spot(&second);
        last = Some((second, to));
        let (from, to) = (from?, to?);
        let interval = Interval {
            time_s: [first.time_s, second.time_s],
            at_px: [from.at_px, to.at_px],
            light_lx_px2: [from.light_lx_px2, to.light_lx_px2],
            sigma_px: 0.5 * (from.sigma_px + to.sigma_px),
            half_px: 0.5 * (from.half_px + to.half_px),
        };
        (interval.light() > 0.0).then_some(interval)
    })
}

/// A camera and an emitter, with the quantities that are the same for all samples.
struct Lens<'a> {
    camera: &'a Camera,
    emitter: &'a Emitter,
    /// Light in lx px² of a lamp of 1 cd on the optical axis at a distance of 1 m.
    light_at_1m: f64,
    /// Variance of the spot without the lamp's disc.
    blur_px2: f64,
    /// Variance that the lamp's disc adds at a depth of 1 m: R²/4 along each axis.
    disc_at_1m_px2: f64,
}

impl<'a> Lens<'a> {
    /// Computes the quantities that are the same for all samples of a lamp.
    fn new(camera: &'a Camera, emitter: &'a Emitter) -> Self {
        let pitch_m = camera.pixel_pitch_m();
        let radius_m = camera.focal_length_m / (2.0 * camera.f_number);
        let pupil_m2 = std::f64::consts::PI * radius_m * radius_m * camera.transmission;
        let blur_px = camera.blur_m / pitch_m;
        let airy_px = AIRY_SIGMA * WAVELENGTH_M * camera.f_number / pitch_m;
        // A cylinder is drawn as a rectangle instead of a disc.
        let disc_m = if emitter.depth_m.is_some() { 0.0 } else { emitter.diameter_m };
        let disc_px = disc_m * camera.focal_length_px();
        Self {
            camera,
            emitter,
            light_at_1m: pupil_m2 / (pitch_m * pitch_m),
            blur_px2: blur_px * blur_px + airy_px * airy_px + PIXEL_VARIANCE,
            disc_at_1m_px2: disc_px * disc_px / 16.0,
        }
    }

    /// Returns the spot of a lamp in the picture. Returns `None` if the lamp is nearer than
    /// [`NEAREST_M`] or behind the camera, or if the spot is beyond [`FARTHEST_PX`].
    fn spot(&self, sample: &LightSample) -> Option<Spot> {
        let image = self.camera.image_from_world(sample.position_m)?;
        let at_px = Px::new(image.x_px, image.y_px);
        if image.depth_m < NEAREST_M || at_px.abs().max_element() > FARTHEST_PX {
            return None;
        }
        // The spot's light is I(θ) cosα / d² times the area of the pupil, reduced by vignetting.
        let to_camera_m = self.camera.position_m - sample.position_m;
        let distance_sq_m2 = to_camera_m.norm_squared();
        let distance_m = distance_sq_m2.sqrt();
        let cos_lens = image.depth_m / distance_m;
        let cos_beam = sample.axis.dot(&to_camera_m) / (sample.axis.norm() * distance_m);
        let intensity_cd = sample.level * self.emitter.intensity_cd(cos_beam);
        let light = self.light_at_1m * intensity_cd * cos_lens / distance_sq_m2
            * self.camera.unvignetted(image.x_px, image.y_px);
        // The variances of lens and pixel, of the lamp's disc, and of defocus add up. A disc of
        // diameter D has the variance D²/16 along each axis.
        let defocus_px = self.camera.defocus_m(image.depth_m) / self.camera.pixel_pitch_m();
        let variance = self.blur_px2
            + self.disc_at_1m_px2 / (image.depth_m * image.depth_m)
            + defocus_px * defocus_px / 16.0;
        // The light is NaN if the axis has no length.
        Some(Spot {
            at_px,
            light_lx_px2: if light.is_finite() { light } else { 0.0 },
            sigma_px: variance.sqrt().clamp(MIN_SIGMA_PX, MAX_SIGMA_PX),
            half_px: self.half_px(sample.axis, image.depth_m),
        })
    }

    /// Returns half the width and half the height of a cylinder's box in the picture, or 0 for a
    /// disc.
    fn half_px(&self, axis: Vector3<f64>, depth_m: f64) -> Px {
        let Some(length_m) = self.emitter.depth_m else { return Px::ZERO };
        let axis = self.camera.camera_from_world * axis / axis.norm();
        let px_per_m = self.camera.focal_length_px() / depth_m;
        let half = [axis.x, axis.y].map(|along: f64| {
            // Both the length and the round ends are foreshortened.
            let ends_m = self.emitter.diameter_m * (1.0 - along * along).max(0.0).sqrt();
            (0.5 * (length_m * along.abs() + ends_m) * px_per_m).min(MAX_SIGMA_PX)
        });
        half.into()
    }
}
