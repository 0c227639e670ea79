//! Expose computes a [`Film`] from lamps and a camera.
//!
//! Input: [`LightTrace`] and [`Camera`]. Output: [`Film`], in lx s.
//!
//! 1. The path of each lamp between two samples is projected in f64: position, light and width of
//!    its spot. The width combines lens blur, diffraction, the lamp's disc and the pixel into one
//!    Gaussian. Intervals that run straight and evenly are merged into segments.
//! 2. Each segment becomes records. A record is `∫ (1 + r s) g(u - s) g(v) ds`, the image of a
//!    Gaussian spot that moves evenly along a line while it fades. Quadrature turns it into a sum
//!    of up to four spots at rest (to within 6e-6 of the peak), each a curve along x times a curve
//!    along y. The spots are added to the pixels in integers, with the same bits on the CPU and on
//!    a graphics device.
//! 3. Lamps of one color are added up in one plane, which is then distributed to the three planes
//!    of the film. The glow of the floor is added last.
//!
//! Up to the segments, vectors are nalgebra's in f64. Records are scalars in f32, and everything
//! after them is integers. The conversion from f64 to f32 is in `record`.
//!
//! Errors: 1e-6 of the light of a spot, and in a pixel 2e-5 of the brightest pixel without merging,
//! or 1e-3 with merging at 0.005 px. No pixel can overflow, because a bound on the brightest pixel
//! determines the scale of the counts.
//!
//! A lamp of I cd that moves at v m/s at a distance of d m leaves `I τ π f / (4 N² d v)` lx s m
//! across its trail on the sensor. At rest for t s it leaves `I τ π (f/2N)² t / d²` lm s in its
//! spot. The smeared Gaussian is described by Vereš et al. 2012 (trails of asteroids).
//!
//! Occlusion by drone or hands, rolling shutter, and lamps nearer than 0.1 m are not modeled.
//! Ambient light, glare and noise are added in `photo`.

mod cpu;
mod curves;
mod detail;
mod film;
mod floor;
#[cfg_attr(not(feature = "gpu"), path = "no_gpu.rs")]
mod gpu;
#[cfg(feature = "gpu")]
mod gpu_tiles;
mod growing;
mod merge;
pub mod meter;
mod project;
mod record;
mod room;
mod sources;
#[cfg(test)]
mod tests;
mod texture;
mod tile;

use std::num::NonZero;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use crate::light::LightTrace;
use floor::Glow;
use gpu::{Gpu, Prepared};
use noctograph_core::camera::{Camera, check_size};
use noctograph_core::error::{Error, Result, within};
use noctograph_core::parallel;
use noctograph_core::settings::{Described, settings};
use record::Record;
use tile::ALL;

pub use detail::Detail;
pub use film::{Film, FilmData};
pub use floor::Reflectance;
pub use growing::GrowingFilm;
pub(crate) use room::Room;

/// Maximum number of samples of a trace, and of segments of a picture.
pub const MAX_SAMPLES: usize = 50_000_000;

/// A film and the backend that exposed it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exposure {
    /// The film.
    pub film: Film,
    /// The backend that exposed the film.
    pub backend: Backend,
    /// Name and driver of the graphics device, or `CPU`.
    pub adapter: String,
}

impl Exposure {
    /// Returns the exposure of a film that the processor exposed.
    pub fn by_processor(film: Film) -> Self {
        Self { film, backend: Backend::Cpu, adapter: "CPU".to_owned() }
    }
}

/// A latent image: the records of the segments in the picture before they are added up.
#[derive(Clone, Debug, PartialEq)]
pub struct Latent {
    size_px: [u32; 2],
    scale_log2: i32,
    tints: Vec<Tint>,
    glow: Option<Glow>,
}

/// The records of all lamps of one color.
#[derive(Clone, Debug, PartialEq)]
struct Tint {
    /// Red, green and blue relative to the brightest channel, for which the value is [`ALL`].
    fractions: [u32; 3],
    records: Vec<Record>,
    /// Index after the last record of each lamp.
    lamp_ends: Vec<usize>,
}

settings! {
    /// Device on which a film is exposed. Both backends produce the same bits.
    pub enum Backend {
        /// A graphics device.
        "wgpu" => Wgpu,
        /// The CPU.
        "cpu" => Cpu,
    }

    /// Choice of the backend.
    pub enum BackendChoice {
        /// A graphics device if one works, otherwise the CPU.
        "auto" => Auto,
        /// A graphics device, or an error if none works.
        "wgpu" => Wgpu,
        /// The CPU.
        "cpu" => Cpu,
    }

    /// Resolution of the exposure, and the floor and the walls that the lamps light.
    pub struct ExposeOptions {
        /// Fraction of the light that the floor reflects evenly in all directions (its albedo): 0.1
        /// for dark carpet, 0.3 for gray concrete, 0 for a black floor.
        floor_albedo: f64 = 0.2, in 0.0..=1.0;
        /// Sheen of the floor: the mean slope of its facets (α of GGX), assumed to be 0.15 for
        /// polished stone, 0.3 for linoleum, 0.6 for worn boards. The floor is matte if left out.
        floor_roughness: Option<f64> = None, in 0.1..=1.0, for "expose.floor_albedo";
        /// Width, depth and height of the room, which is centered at x = y = 0. The walls reflect
        /// light, and flights are checked against them. There are no walls if left out.
        room_m: Option<[f64; 3]> = None, in 0.1..=1e3;
        /// Unevenness of floor and walls, from worn spots to stains: the relative standard
        /// deviation of their albedo.
        ///
        /// Measured on lit floors and walls in eight public long exposures: 2 to 3 % on smooth
        /// surfaces, 5 to 13 % on a hall's floor and a scratched table.
        unevenness: f64 = 0.05, in 0.0..=1.0;
        fixed {
            /// Maximum distance between a sample and the segment that replaces it. 0 merges nothing
            /// and has the smallest error, 0.005 has an error of up to 1e-3 of the peak, and larger
            /// values are faster and coarser.
            merge_tolerance_px: f64 = 0.005;
            /// Accuracy of moving spots, and of the glow of floor and walls.
            detail: Detail = Detail::PICTURE;
            /// Height of the floor relative to the position of a standing drone.
            ///
            /// A Crazyflie's position is that of its board, 2 cm above the floor (assumed from feet
            /// below the motor mounts).
            floor_z_m: f64 = -0.02;
            /// Fraction of the light that walls and ceiling reflect evenly in all directions: 0.8
            /// for white paint, 0.4 for gray, 0.05 for black cloth.
            wall_albedo: f64 = 0.4;
        }
    }
}

/// Exposes a film to moving lamps while the shutter of a camera is open.
///
/// Lamps behind the camera or nearer than 0.1 m along the optical axis leave no light. Spots with a
/// σ above 256 px are drawn with a σ of 256 px and all of their light.
///
/// # Errors
///
/// Returns [`Error::Input`] for numbers of a lamp, the camera or the options that are not finite or
/// out of range, for decreasing times (naming lamp and time), for a picture that is too large, and
/// for more than [`MAX_SAMPLES`] samples or segments. Returns [`Error::Gpu`] if
/// [`BackendChoice::Wgpu`] finds no device or the device fails.
pub fn expose(
    trace: &LightTrace,
    camera: &Camera,
    options: &ExposeOptions,
    backend: BackendChoice,
) -> Result<Exposure> {
    let developer = Developer::start(backend);
    developer.develop(&project(trace, camera, options)?)
}

/// Computes the latent image, which is the first half of [`expose`], in floating point.
///
/// # Errors
///
/// Returns the same errors as [`expose`], except those of the device.
pub fn project(trace: &LightTrace, camera: &Camera, options: &ExposeOptions) -> Result<Latent> {
    check(trace, camera, options)?;
    let size_px = [camera.width_px, camera.height_px];
    let tints = tints(trace, camera, options)?;

    let glow = Glow::new(trace, camera, options);
    let glow_lx_s = glow.as_ref().map_or(0.0, |glow| glow.peak_lx_s);
    let scale_log2 = film::finest_scale_log2(&tints, glow_lx_s, size_px);
    Ok(Latent { size_px, scale_log2, tints, glow })
}

impl Latent {
    /// Returns the image with counts of `2^scale_log2` lx s, so that several films can be added.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Infeasible`] if such fine counts would overflow, and [`Error::Input`] for a
    /// scale out of range.
    pub fn at_scale(self, scale_log2: i32) -> Result<Self> {
        film::check_scale(scale_log2)?;
        if scale_log2 < self.scale_log2 {
            return Err(Error::infeasible(
                format!("counts of 2^{scale_log2} lx s would overflow with this light"),
                format!("choose a scale of 2^{} lx s or more", self.scale_log2),
            ));
        }
        Ok(Self { scale_log2, ..self })
    }

    /// Multiplies the light on floor and walls by the reflectance of a photographed room
    /// ([`crate::photo::reflectance`]), which is 4 at most.
    #[must_use]
    pub fn reflected_by(mut self, room: Option<Reflectance>) -> Self {
        if let (Some(glow), Some(room)) = (&mut self.glow, room) {
            // The light may become four times as bright, so two more bits are reserved.
            self.scale_log2 += 2;
            glow.reflectance = Some(room);
        }
        self
    }

    /// Adds up the light on the processor, in at most one band of rows per core. Returns the film.
    pub fn develop_on(&self, cores: NonZero<usize>) -> Film {
        self.film(cpu::splat(cores.get() as u64, self))
    }

    /// Adds up the light on all cores of the processor, and returns the film.
    pub fn develop_on_all(&self) -> Film {
        self.develop_on(
            NonZero::new(parallel::current_num_threads()).unwrap_or(NonZero::<usize>::MIN),
        )
    }

    /// Returns the scale of the film, where one count is `2^scale_log2` lx s.
    pub fn scale_log2(&self) -> i32 {
        self.scale_log2
    }

    /// Returns the number of records in the picture.
    pub fn n_segments(&self) -> usize {
        self.tints.iter().map(|tint| tint.records.len()).sum()
    }

    /// Adds up the light on the processor.
    fn on_cpu(&self) -> Exposure {
        Exposure::by_processor(self.develop_on_all())
    }

    /// Adds up the light on a graphics device. Returns [`Error::Gpu`] if the device fails.
    fn on_gpu(&self, gpu: &Gpu, prepared: Option<Prepared>) -> Result<Exposure> {
        let prepared = prepared.unwrap_or_else(|| Prepared::new(self));
        Ok(Exposure {
            film: Film::made(gpu.splat(self, prepared)?),
            backend: Backend::Wgpu,
            adapter: gpu.adapter.clone(),
        })
    }

    fn counts_per_lx_s(&self) -> f64 {
        libm::ldexp(1.0, -self.scale_log2)
    }

    /// True if the counts of both images have the same meaning and can be added.
    fn counts_as(&self, other: &Self) -> bool {
        (self.size_px, self.scale_log2) == (other.size_px, other.scale_log2)
    }

    /// Returns a film with the counts of the lamps, red, green and blue one after another, and the
    /// glow of the room.
    fn film(&self, counts: Vec<u32>) -> Film {
        Film::made(self.with_glow(counts))
    }

    /// Returns the data of [`Self::film`].
    fn with_glow(&self, counts: Vec<u32>) -> FilmData {
        let [width_px, height_px] = self.size_px;
        let mut film = FilmData { width_px, height_px, counts, scale_log2: self.scale_log2 };
        if let Some(glow) = &self.glow {
            glow.add_to(&mut film);
        }
        film
    }
}

/// A backend that starts in the background, because opening a graphics device and compiling its
/// shader take longer than exposing a film. All clones have the same device. When the last of them
/// is dropped, the device is kept for the next backend of this process.
#[derive(Clone, Debug)]
pub struct Developer {
    choice: BackendChoice,
    device: Arc<Mutex<Device>>,
}

/// The graphics device of a [`Developer`].
#[derive(Debug, Default)]
struct Device {
    /// The thread that opens the device, until it is needed. `None` for the processor, or if no
    /// thread started.
    opening: Option<JoinHandle<Result<Gpu>>>,
    gpu: Option<Gpu>,
}

impl Developer {
    /// Starts the backend in a separate thread. The processor needs no preparation.
    #[must_use]
    pub fn start(choice: BackendChoice) -> Self {
        let gpu = if choice == BackendChoice::Cpu { None } else { kept().take() };
        let opens = choice != BackendChoice::Cpu && gpu.is_none();
        let opening = opens.then(|| std::thread::Builder::new().spawn(Gpu::ready).ok()).flatten();
        Self { choice, device: Arc::new(Mutex::new(Device { opening, gpu })) }
    }

    /// Adds up the light of an image as soon as the backend is ready. With [`BackendChoice::Auto`]
    /// the processor replaces a device that fails.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Gpu`] if [`BackendChoice::Wgpu`] finds no device or the device fails.
    pub fn develop(self, latent: &Latent) -> Result<Exposure> {
        let mut device = self.device.lock().unwrap_or_else(PoisonError::into_inner);
        let opening = device.opening.as_ref().filter(|opening| !opening.is_finished());
        let prepared = opening.map(|_| Prepared::new(latent));
        let gpu = match (device.gpu.take(), device.opening.take()) {
            (Some(gpu), _) => Ok(gpu),
            (None, Some(opening)) => opening.join().unwrap_or_else(|_| Err(gpu::driver_panicked())),
            // The thread could not be started, so the device is opened here.
            (None, None) if self.choice == BackendChoice::Wgpu => Gpu::ready(),
            (None, None) => return Ok(latent.on_cpu()),
        };
        match gpu.and_then(|gpu| Ok((latent.on_gpu(&gpu, prepared)?, gpu))) {
            Ok((exposure, gpu)) => {
                device.gpu = Some(gpu);
                Ok(exposure)
            }
            Err(_) if self.choice == BackendChoice::Auto => Ok(latent.on_cpu()),
            Err(error) => Err(error),
        }
    }
}

/// Opens the graphics device, runs the shader once, and returns the device's name and driver.
///
/// # Errors
///
/// Returns [`Error::Gpu`] if there is no device or it fails.
pub fn try_device() -> Result<String> {
    let gpu = Gpu::ready()?;
    gpu.wait()?;
    Ok(gpu.adapter)
}

impl Drop for Device {
    /// Waits for the device, because a driver that is still compiling may crash an exiting program.
    /// A device that works is kept, because closing one takes milliseconds.
    fn drop(&mut self) {
        let opened = self.opening.take().and_then(|opening| opening.join().ok()?.ok());
        if let Some(gpu) = self.gpu.take().or(opened).filter(|gpu| gpu.wait().is_ok()) {
            *kept() = Some(gpu);
        }
    }
}

/// Returns the device that is kept for the next backend, if any.
fn kept() -> MutexGuard<'static, Option<Gpu>> {
    static KEPT: Mutex<Option<Gpu>> = Mutex::new(None);
    KEPT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns [`Error::Input`] if the camera or an option is out of range, or if a trace is too long.
fn check(trace: &LightTrace, camera: &Camera, options: &ExposeOptions) -> Result<()> {
    check_size(camera.width_px, camera.height_px)?;
    let ranges = [
        ("camera: focal_length_m", camera.focal_length_m, [1e-4, 10.0]),
        ("camera: sensor_width_m", camera.sensor_width_m, [1e-4, 10.0]),
        ("camera: f_number", camera.f_number, [0.1, 1e3]),
        ("camera: transmission", camera.transmission, [0.0, 1.0]),
        ("camera: blur_m", camera.blur_m, [0.0, 1.0]),
        ("camera: shutter_open_s", camera.shutter_open_s, [-1e9, 1e9]),
        ("camera: shutter_close_s", camera.shutter_close_s, [camera.shutter_open_s, 1e9]),
        ("camera: vignetting", camera.vignetting, [0.0, 1.0]),
        ("camera: focus_m", camera.focus_m.unwrap_or(1.0), [1e-3, 1e9]),
    ];
    // Numbers in the camera's distortion and pose may be negative.
    let distortion = camera.distortion.map(|k| ("camera: distortion", k, [-1e3, 1e3]));
    let numbers = camera.position_m.iter().chain(camera.camera_from_world.iter());
    let pose = numbers.map(|value| ("camera: position and attitude", *value, [-1e9, 1e9]));
    for (key, value, [min, max]) in ranges.into_iter().chain(distortion).chain(pose) {
        within(key, value, min, max)?;
    }
    options.check("expose", None)?;

    let samples: usize = trace.lamps.iter().map(|lamp| lamp.samples.len()).sum();
    if samples > MAX_SAMPLES {
        return Err(too_many("light", "samples", samples));
    }
    Ok(())
}

/// Returns the records of all lamps, grouped by color. Returns [`Error::Input`] above
/// [`MAX_SAMPLES`] segments.
fn tints(trace: &LightTrace, camera: &Camera, options: &ExposeOptions) -> Result<Vec<Tint>> {
    let mut tints: Vec<Tint> = Vec::new();
    let (mut segments, mut n) = (Vec::new(), 0);
    for lamp in &trace.lamps {
        let rgb = lamp.emitter.rgb;
        let brightest = rgb[0].max(rgb[1]).max(rgb[2]);
        if brightest == 0.0 {
            continue;
        }
        // Lamps of one color are in one plane, in counts of its brightest channel.
        #[expect(clippy::cast_possible_truncation, reason = "0 to 2^31")]
        let fractions = rgb.map(|channel| (channel / brightest * f64::from(ALL)).round() as u32);
        let index =
            tints.iter().position(|tint| tint.fractions == fractions).unwrap_or_else(|| {
                tints.push(Tint { fractions, records: Vec::new(), lamp_ends: Vec::new() });
                tints.len() - 1
            });
        // Merges each lamp's path into segments, and converts these to records.
        segments.clear();
        let intervals = project::intervals(lamp, camera);
        merge::merge(intervals, brightest, options.merge_tolerance_px, &mut segments);
        let size_px = [camera.width_px, camera.height_px];
        for segment in &segments {
            record::records(segment, size_px, &options.detail, |record| {
                tints[index].records.push(record);
                n += 1;
            });
            if n > MAX_SAMPLES {
                return Err(too_many("picture", "segments", n));
            }
        }
        let end = tints[index].records.len();
        tints[index].lamp_ends.push(end);
    }
    Ok(tints)
}

/// Returns the error for too many samples or segments.
fn too_many(place: &str, what: &str, n: usize) -> Error {
    let hint = "use a shorter flight, coarser samples or a larger merge tolerance";
    Error::input(place, format!("{n} {what}"), format!("at most {MAX_SAMPLES}"), hint)
}
