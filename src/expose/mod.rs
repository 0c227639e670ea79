//! Expose: lamps and a camera become a [`Film`].
//!
//! Product in: [`LightTrace`] and [`Camera`]. Product out: [`Film`], in lx s.
//!
//! 1. Every stretch of a lamp's way between two samples is projected, in f64: where its spot runs,
//!    how much light it leaves, how wide the spot is (lens blur ⊕ diffraction ⊕ lamp's disc ⊕
//!    pixel, as one gaussian). Stretches that run straight and even are merged.
//! 2. Each becomes a record: `∫ (1 + r s) g(u - s) g(v) ds`, the image of a gaussian spot that
//!    moves evenly along a line while it fades, as a sum of up to four spots at rest (quadrature,
//!    to 6e-6 of the peak), each a curve along x times a curve along y. What every pixel gets of
//!    them is added up in integers only, on the CPU or on a graphics device: both leave the same
//!    bits.
//! 3. Lamps of one colour are added up in one plane, which is then counted into the film's three.
//! 4. Light that falls on the floor and is seen there joins, when the counts are complete.
//!
//! Accuracy: light is kept to 1e-6 of itself, pixels to 2e-5 of the brightest unmerged and to 1e-3
//! merged at 0.005 px. No pixel can overflow: the scale of the
//! counts is chosen from a bound on the brightest.
//!
//! A lamp of I cd that moves at v m/s, d m away, leaves `I τ π f / (4 N² d v)` lx s m across its
//! trail on the sensor; at rest for t s it leaves `I τ π (f/2N)² t / d²` lm s in its spot. Source of
//! the smeared gaussian: Vereš et al. 2012 (trails of asteroids).
//!
//! Not modelled: occlusion by drone or hands, rolling shutter, light of lamps nearer than 0.1 m.
//! Between two samples the lamp's picture moves evenly and its brightness changes evenly. Ambient
//! light, glare and noise come after, in `photo`.

mod cpu;
mod curves;
mod floor;
mod gpu;
mod merge;
pub mod meter;
mod project;
mod record;
mod scale;
mod sheet;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod twins;

use std::num::NonZero;
use std::thread::JoinHandle;

use serde::{Deserialize, Serialize};

use crate::camera::{Camera, check_size};
use crate::digest::Digest;
use crate::error::{Error, Result, within};
use crate::light::LightTrace;
use crate::settings::settings;
use floor::Glow;
use gpu::Gpu;
use record::Record;
use sheet::ALL;

/// Most samples in a trace, and most segments in a picture.
pub const MAX_SAMPLES: usize = 50_000_000;

/// What the sensor received: luminous exposure per pixel and color channel, as integer counts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Film {
    /// Width.
    pub width_px: u32,
    /// Height.
    pub height_px: u32,
    /// Three planes (red, green, blue: linear sRGB), each row by row from the top left.
    pub counts: Vec<u32>,
    /// One count is `2^scale_log2` lx s.
    pub scale_log2: i32,
}

impl Film {
    /// Luminous exposure of one channel (0 red, 1 green, 2 blue) at a pixel, `y * width_px + x`,
    /// in lx s. White light of H lx s has H in all three.
    ///
    /// # Panics
    ///
    /// If the film has no such channel or pixel.
    #[must_use]
    pub fn exposure_lx_s(&self, channel: usize, index: usize) -> f64 {
        let pixels = self.width_px as usize * self.height_px as usize;
        assert!(channel < 3 && index < pixels, "no pixel {index} in channel {channel}");
        libm::ldexp(f64::from(self.counts[channel * pixels + index]), self.scale_log2)
    }

    /// All light of one channel (0 red, 1 green, 2 blue), in lx s summed over the pixels.
    ///
    /// # Panics
    ///
    /// If the film has no such channel.
    #[must_use]
    pub fn light_lx_s_px2(&self, channel: usize) -> f64 {
        assert!(channel < 3, "a film has channels 0, 1 and 2, not {channel}");
        let pixels = self.width_px as usize * self.height_px as usize;
        let plane = &self.counts[channel * pixels..][..pixels];
        let sum: u64 = plane.iter().map(|&count| u64::from(count)).sum();
        libm::ldexp(sum as f64, self.scale_log2)
    }

    /// SHA-256 of size, scale and counts (little endian), in hexadecimal: equal films, equal hash,
    /// on every backend and machine.
    #[must_use]
    pub fn sha256(&self) -> String {
        let mut digest = Digest::default();
        digest.add(self.width_px.to_le_bytes());
        digest.add(self.height_px.to_le_bytes());
        digest.add(self.scale_log2.to_le_bytes());
        for counts in self.counts.chunks(4096) {
            let bytes: Vec<u8> = counts.iter().flat_map(|count| count.to_le_bytes()).collect();
            digest.add(bytes);
        }
        digest.hex()
    }
}

/// A film and how it was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exposure {
    /// What the sensor received.
    pub film: Film,
    /// What added it up.
    pub backend: Backend,
    /// Name and driver of the graphics device; `CPU` without one.
    pub adapter: String,
}

/// Light on its way to the film: what is drawn where, before it is added up.
#[derive(Clone, Debug, PartialEq)]
pub struct Latent {
    size_px: [u32; 2],
    scale_log2: i32,
    tints: Vec<Tint>,
    glow: Option<Glow>,
}

/// All that lamps of one colour leave on the picture.
#[derive(Clone, Debug, PartialEq)]
struct Tint {
    /// Red, green and blue of the brightest of them, which is [`ALL`].
    shares: [u32; 3],
    records: Vec<Record>,
}

/// What adds up the light. Both leave the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backend {
    /// A graphics device.
    Wgpu,
    /// This processor.
    Cpu,
}

impl Backend {
    /// Its name in tables and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Wgpu => "wgpu",
            Self::Cpu => "cpu",
        }
    }
}

settings! {
    /// Which backend to take.
    pub enum BackendChoice {
        /// A graphics device where one is found and works, else the processor.
        "auto" => Auto,
        /// A graphics device, or an error.
        "wgpu" => Wgpu,
        /// The processor.
        "cpu" => Cpu,
    }
}

/// How to expose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExposeOptions {
    /// What adds up the light; no part of a scene, since it leaves the bits as they are.
    #[serde(skip)]
    pub backend: BackendChoice,
    /// How far a sample may lie from the segment that replaces it. 0 merges nothing and errs least;
    /// 0.005 (default) errs by up to 1e-3 of the peak; more is faster and coarser.
    pub merge_tolerance_px: f64,
    /// Share of light that the floor reflects, evenly to all sides (its albedo): a dark carpet 0.1,
    /// grey concrete 0.3. 0: a floor that nobody sees.
    pub floor_albedo: f64,
    /// Height of the floor. A standing Crazyflie's position is that of its board, 2 cm above it (an
    /// assumption: feet below the motor mounts).
    pub floor_z_m: f64,
    /// Scale of the film, one count being `2^scale_log2` lx s, for films that are to be added up;
    /// `None` (default) takes the finest that this light allows.
    #[serde(skip)]
    pub scale_log2: Option<i32>,
}

impl ExposeOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        within("expose.merge_tolerance_px", self.merge_tolerance_px, 0.0, 1.0)?;
        within("expose.floor_albedo", self.floor_albedo, 0.0, 1.0)?;
        within("expose.floor_z_m", self.floor_z_m, -1e3, 1e3)?;
        self.scale_log2.map_or(Ok(()), |scale_log2| {
            within("expose.scale_log2", f64::from(scale_log2), -128.0, 128.0)
        })
    }
}

impl Default for ExposeOptions {
    fn default() -> Self {
        Self {
            backend: BackendChoice::Auto,
            merge_tolerance_px: 0.005,
            floor_albedo: 0.2,
            floor_z_m: -0.02,
            scale_log2: None,
        }
    }
}

/// Opens the camera's shutter on the lamps.
///
/// Lamps nearer than 0.1 m along the optical axis, and lamps behind the camera, leave no light
/// while they are there. Spots wider than 256 px are drawn 256 px wide (one σ), with all their
/// light.
///
/// # Errors
///
/// [`Error::Input`] where a lamp's numbers are not finite or its time runs backward (named with
/// lamp and time), where the camera's or the option's numbers are out of range, and above
/// the largest picture or [`MAX_SAMPLES`]. [`Error::Infeasible`] where `scale_log2` is too fine for
/// the light. [`Error::Gpu`] where [`BackendChoice::Wgpu`] finds no device or the device fails.
pub fn expose(trace: &LightTrace, camera: &Camera, options: &ExposeOptions) -> Result<Exposure> {
    let developer = Developer::start(options.backend);
    developer.develop(&project(trace, camera, options)?)
}

/// The first half of [`expose`]: everything in f64, up to the integers that the backends add up.
///
/// # Errors
///
/// As [`expose`], but for the device.
pub fn project(trace: &LightTrace, camera: &Camera, options: &ExposeOptions) -> Result<Latent> {
    check(trace, camera, options)?;
    let size_px = [camera.width_px, camera.height_px];
    let tints = tints(trace, camera, options.merge_tolerance_px)?;

    let glow = Glow::new(trace, camera, options);
    let glow_lx_s = glow.as_ref().map_or(0.0, |glow| glow.peak_lx_s);
    let finest = scale::finest_scale_log2(&tints, glow_lx_s, size_px);
    let scale_log2 = options.scale_log2.unwrap_or(finest);
    if scale_log2 < finest {
        return Err(Error::Infeasible {
            what: format!("counts of 2^{scale_log2} lx s would overflow on this light"),
            hint: format!("set the film's scale_log2 to {finest} or more"),
        });
    }
    Ok(Latent { size_px, scale_log2, tints, glow })
}

impl Latent {
    /// Adds up the light on a backend.
    ///
    /// # Errors
    ///
    /// [`Error::Gpu`] where [`BackendChoice::Wgpu`] finds no device or the device fails.
    pub fn develop(&self, choice: BackendChoice) -> Result<Exposure> {
        Developer::start(choice).develop(self)
    }

    fn on_cpu(&self) -> Exposure {
        let cores = std::thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN);
        let film = self.develop_on(cores);
        Exposure { film, backend: Backend::Cpu, adapter: "CPU".to_owned() }
    }

    /// Adds up the light on so many cores of this processor, at most.
    #[must_use]
    pub fn develop_on(&self, cores: NonZero<usize>) -> Film {
        self.film(cpu::splat(cores.get() as u64, self))
    }

    /// Segments that will be drawn.
    #[must_use]
    pub fn n_segments(&self) -> usize {
        self.tints.iter().map(|tint| tint.records.len()).sum()
    }

    fn counts_per_lx_s(&self) -> f64 {
        libm::ldexp(1.0, -self.scale_log2)
    }

    fn film(&self, counts: Vec<u32>) -> Film {
        let [width_px, height_px] = self.size_px;
        let mut film = Film { width_px, height_px, counts, scale_log2: self.scale_log2 };
        if let Some(glow) = &self.glow {
            glow.add_to(&mut film);
        }
        film
    }
}

/// A backend that makes itself ready while other work goes on: to open a graphics device and to
/// compile its shader takes longer than to expose a film.
#[derive(Debug)]
pub struct Developer {
    choice: BackendChoice,
    /// The device on its way; none where nobody asked for one.
    device: Option<JoinHandle<Result<Gpu>>>,
}

impl Developer {
    /// Begins to make the backend ready.
    #[must_use]
    pub fn start(choice: BackendChoice) -> Self {
        let asked = choice != BackendChoice::Cpu;
        Self { choice, device: asked.then(|| std::thread::spawn(Gpu::ready)) }
    }

    /// Adds up light once the backend is ready.
    ///
    /// # Errors
    ///
    /// [`Error::Gpu`] where [`BackendChoice::Wgpu`] finds no device or the device fails.
    pub fn develop(mut self, latent: &Latent) -> Result<Exposure> {
        let Some(device) = self.device.take() else { return Ok(latent.on_cpu()) };
        let on_gpu = || -> Result<_> {
            let gpu = device.join().unwrap_or_else(|_| Err(gpu::gave_up()))?;
            let counts = gpu.splat(latent)?;
            Ok(Exposure { film: latent.film(counts), backend: Backend::Wgpu, adapter: gpu.adapter })
        };
        match self.choice {
            BackendChoice::Wgpu => on_gpu(),
            // The twins leave the same bits, so a device that fails costs nothing but time.
            _ => Ok(on_gpu().unwrap_or_else(|_| latent.on_cpu())),
        }
    }
}

impl Drop for Developer {
    /// Waits: a driver that still compiles while the program ends may bring it down.
    fn drop(&mut self) {
        if let Some(device) = self.device.take() {
            drop(device.join());
        }
    }
}

fn check(trace: &LightTrace, camera: &Camera, options: &ExposeOptions) -> Result<()> {
    check_size(camera.width_px, camera.height_px)?;
    within("camera: focal_length_m", camera.focal_length_m, 1e-4, 10.0)?;
    within("camera: sensor_width_m", camera.sensor_width_m, 1e-4, 10.0)?;
    within("camera: f_number", camera.f_number, 0.1, 1e3)?;
    within("camera: transmission", camera.transmission, 0.0, 1.0)?;
    within("camera: blur_m", camera.blur_m, 0.0, 1.0)?;
    within("camera: shutter_open_s", camera.shutter_open_s, -1e9, 1e9)?;
    within("camera: shutter_close_s", camera.shutter_close_s, camera.shutter_open_s, 1e9)?;
    within("camera: vignetting", camera.vignetting, 0.0, 1.0)?;
    within("camera: focus_m", camera.focus_m.unwrap_or(1.0), 1e-3, 1e9)?;
    for value in camera.distortion {
        within("camera: distortion", value, -1e3, 1e3)?;
    }
    for value in camera.position_m.iter().chain(camera.camera_from_world.iter()) {
        within("camera: position and attitude", *value, -1e9, 1e9)?;
    }
    options.check()?;

    let samples: usize = trace.lamps.iter().map(|lamp| lamp.samples.len()).sum();
    if samples > MAX_SAMPLES {
        return Err(too_many("light", "samples", samples));
    }
    trace.lamps.iter().try_for_each(project::check)
}

/// What the lamps leave on the picture.
fn tints(trace: &LightTrace, camera: &Camera, merge_tolerance_px: f64) -> Result<Vec<Tint>> {
    let mut tints: Vec<Tint> = Vec::new();
    let (mut segments, mut n) = (Vec::new(), 0);
    for lamp in &trace.lamps {
        let rgb = lamp.emitter.rgb;
        let most = rgb[0].max(rgb[1]).max(rgb[2]);
        if most == 0.0 {
            continue;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 2^31")]
        let shares = rgb.map(|channel| (channel / most * f64::from(ALL)).round() as u32);
        let known = tints.iter().position(|tint| tint.shares == shares).unwrap_or_else(|| {
            tints.push(Tint { shares, records: Vec::new() });
            tints.len() - 1
        });
        let records = &mut tints[known].records;
        let before = records.len();
        segments.clear();
        let intervals = project::intervals(lamp, camera);
        merge::merge(intervals, most, merge_tolerance_px, &mut segments);
        for segment in &segments {
            record::records(segment, [camera.width_px, camera.height_px], |r| records.push(r));
            if n + records.len() - before > MAX_SAMPLES {
                return Err(too_many("picture", "segments", n + records.len() - before));
            }
        }
        n += records.len() - before;
    }
    Ok(tints)
}

fn too_many(place: &str, what: &str, found: usize) -> Error {
    let hint = "take a shorter flight, coarser samples or a larger merge tolerance";
    Error::input(place, format!("{found} {what}"), format!("at most {MAX_SAMPLES}"), hint)
}
