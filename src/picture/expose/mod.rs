//! Expose: lamps and a camera become a [`Film`].
//!
//! Product in: [`LightTrace`] and [`Camera`]. Product out: [`Film`], in lx s.
//!
//! 1. The path of each lamp between two samples is projected, in f64: position, light and width of
//!    its spot (lens blur ⊕ diffraction ⊕ disc of the lamp ⊕ pixel, as one Gaussian). Intervals
//!    that run straight and evenly are merged into segments.
//! 2. Each segment becomes records: `∫ (1 + r s) g(u - s) g(v) ds`, the image of a Gaussian spot
//!    that moves evenly along a line while it fades, as a sum of up to four spots at rest
//!    (quadrature, to 6e-6 of the peak), each a curve along x times a curve along y. Pixels add
//!    them up in integers, on the CPU or on a graphics device, with the same bits.
//! 3. Lamps of one color are added up in one plane, which is then counted into the three planes of
//!    the film. The glow of the floor is added last.
//!
//! Vectors are nalgebra's and f64 up to the segments. Records are scalars in f32, and everything
//! after them is integers. The width changes in `record`.
//!
//! Accuracy: the light of a spot to 1e-6, pixels to 2e-5 of the brightest unmerged, and to 1e-3
//! merged at 0.005 px. No pixel can overflow: a bound on the brightest sets the scale of the
//! counts.
//!
//! A lamp of I cd that moves at v m/s, d m away, leaves `I τ π f / (4 N² d v)` lx s m across its
//! trail on the sensor. At rest for t s it leaves `I τ π (f/2N)² t / d²` lm s in its spot. Source
//! of the smeared Gaussian: Vereš et al. 2012 (trails of asteroids).
//!
//! Not modeled: occlusion by drone or hands, rolling shutter, lamps nearer than 0.1 m. Ambient
//! light, glare and noise belong to `photo`.

mod cpu;
mod curves;
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
use std::thread::JoinHandle;

use crate::light::LightTrace;
use floor::Glow;
use gpu::Gpu;
use noctograph_core::camera::{Camera, check_size};
use noctograph_core::error::{Error, Result, within};
use noctograph_core::settings::{Described, settings};
use record::Record;
use tile::ALL;

pub use film::{Film, FilmData};
pub use floor::Reflectance;
pub use growing::GrowingFilm;
pub(crate) use room::Room;

/// Most samples of a trace, and most segments of a picture.
pub const MAX_SAMPLES: usize = 50_000_000;

/// A film and the backend that exposed it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exposure {
    /// The film.
    pub film: Film,
    /// The backend that exposed it.
    pub backend: Backend,
    /// Name and driver of the graphics device, or `CPU`.
    pub adapter: String,
}

impl Exposure {
    /// Returns the exposure of a film on the processor.
    #[must_use]
    pub fn by_processor(film: Film) -> Self {
        Self { film, backend: Backend::Cpu, adapter: "CPU".to_owned() }
    }
}

/// A latent image: records of the segments in the picture, before they are added up.
#[derive(Clone, Debug, PartialEq)]
pub struct Latent {
    size_px: [u32; 2],
    scale_log2: i32,
    tints: Vec<Tint>,
    glow: Option<Glow>,
}

/// Records of all lamps of one color.
#[derive(Clone, Debug, PartialEq)]
struct Tint {
    /// Red, green and blue relative to the brightest of them, which is [`ALL`].
    fractions: [u32; 3],
    records: Vec<Record>,
    /// End of the records of each lamp.
    lamp_ends: Vec<usize>,
}

settings! {
    /// Where a film is exposed. Both backends leave the same bits.
    pub enum Backend {
        /// A graphics device.
        "wgpu" => Wgpu,
        /// The processor.
        "cpu" => Cpu,
    }

    /// Choice of the backend.
    pub enum BackendChoice {
        /// A graphics device if one works, else the processor.
        "auto" => Auto,
        /// A graphics device, or an error.
        "wgpu" => Wgpu,
        /// The processor.
        "cpu" => Cpu,
    }

    /// Resolution of the exposure, and the floor and the walls that the lamps light.
    pub struct ExposeOptions {
        /// Fraction of light that the floor reflects, evenly to all sides (its albedo): a dark
        /// carpet 0.1, gray concrete 0.3, a black floor 0.
        floor_albedo: f64 = 0.2, in 0.0..=1.0;
        /// Sheen of the floor: mean slope of its facets (α of GGX), 0.15 for polished stone, 0.3
        /// for linoleum, 0.6 for worn boards (assumptions). Matte if left out.
        floor_roughness: Option<f64> = None, in 0.1..=1.0, for "expose.floor_albedo";
        /// Width, depth and height of the room, its middle at x = y = 0: its walls are lit, and
        /// flights are checked against them. No walls if left out.
        room_m: Option<[f64; 3]> = None, in 0.1..=1e3;
        /// Unevenness of floor and walls, from worn spots to stains: standard deviation of their
        /// albedo, relative.
        ///
        /// Measured on lit floors and walls of eight public long exposures: 2 to 3 % on smooth
        /// surfaces, 5 to 13 % on a hall's floor and a scratched table.
        unevenness: f64 = 0.05, in 0.0..=1.0;
        fixed {
            /// How far a sample may lie from the segment that replaces it. 0 merges nothing and
            /// errs least, 0.005 errs by up to 1e-3 of the peak, more is faster and coarser.
            merge_tolerance_px: f64 = 0.005;
            /// Height of the floor below the position of a standing drone.
            ///
            /// That of a Crazyflie is the position of its board, 2 cm above the floor (an
            /// assumption: feet below the motor mounts).
            floor_z_m: f64 = -0.02;
            /// Fraction of light that the walls and the ceiling reflect, evenly to all sides: white
            /// paint 0.8, gray 0.4, black cloth 0.05.
            wall_albedo: f64 = 0.4;
        }
    }
}

/// Exposes a film to moving lamps while the shutter of a camera is open.
///
/// Lamps behind the camera and lamps nearer than 0.1 m along the optical axis leave no light. Spots
/// with a σ above 256 px are drawn with a σ of 256 px and all their light.
///
/// # Errors
///
/// [`Error::Input`] for numbers of a lamp that are not finite or out of range and for time that
/// falls (with lamp and time), for numbers of the camera or the options out of range, and above the
/// largest picture or [`MAX_SAMPLES`]. [`Error::Gpu`] if [`BackendChoice::Wgpu`] finds no device or
/// the device fails.
pub fn expose(
    trace: &LightTrace,
    camera: &Camera,
    options: &ExposeOptions,
    backend: BackendChoice,
) -> Result<Exposure> {
    let developer = Developer::start(backend);
    developer.develop(&project(trace, camera, options)?)
}

/// Computes the latent image: the first half of [`expose`], in floating point.
///
/// # Errors
///
/// Like [`expose`], except for the device.
pub fn project(trace: &LightTrace, camera: &Camera, options: &ExposeOptions) -> Result<Latent> {
    check(trace, camera, options)?;
    let size_px = [camera.width_px, camera.height_px];
    let tints = tints(trace, camera, options.merge_tolerance_px)?;

    let glow = Glow::new(trace, camera, options);
    let glow_lx_s = glow.as_ref().map_or(0.0, |glow| glow.peak_lx_s);
    let scale_log2 = film::finest_scale_log2(&tints, glow_lx_s, size_px);
    Ok(Latent { size_px, scale_log2, tints, glow })
}

impl Latent {
    /// Returns the image with counts of `2^scale_log2` lx s, for films that are to be added up.
    ///
    /// # Errors
    ///
    /// [`Error::Infeasible`] if counts so fine would overflow. [`Error::Input`] for a scale that no
    /// film may have.
    pub fn at_scale(self, scale_log2: i32) -> Result<Self> {
        film::check_scale(scale_log2)?;
        if scale_log2 < self.scale_log2 {
            return Err(Error::infeasible(
                format!("counts of 2^{scale_log2} lx s would overflow on this light"),
                format!("choose a scale of 2^{} lx s or more", self.scale_log2),
            ));
        }
        Ok(Self { scale_log2, ..self })
    }

    /// Multiplies the light of floor and walls by the reflectance of a photographed room
    /// ([`crate::photo::reflectance`]), which is 4 at most.
    #[must_use]
    pub fn reflected_by(mut self, room: Option<Reflectance>) -> Self {
        if let (Some(glow), Some(room)) = (&mut self.glow, room) {
            // Two bits for light that is up to four times as bright.
            self.scale_log2 += 2;
            glow.reflectance = Some(room);
        }
        self
    }

    /// Adds up the light on the processor, in at most one band of rows for each core. Returns the
    /// film.
    #[must_use]
    pub fn develop_on(&self, cores: NonZero<usize>) -> Film {
        self.film(cpu::splat(cores.get() as u64, self))
    }

    /// Adds up the light on all cores of the processor. Returns the film.
    #[must_use]
    pub fn develop_on_all(&self) -> Film {
        self.develop_on(NonZero::new(rayon::current_num_threads()).unwrap_or(NonZero::<usize>::MIN))
    }

    /// Returns the scale: one count of the film is `2^scale_log2` lx s.
    #[must_use]
    pub fn scale_log2(&self) -> i32 {
        self.scale_log2
    }

    /// Returns the number of records in the picture.
    #[must_use]
    pub fn n_segments(&self) -> usize {
        self.tints.iter().map(|tint| tint.records.len()).sum()
    }

    /// Adds up the light on the processor.
    fn on_cpu(&self) -> Exposure {
        Exposure::by_processor(self.develop_on_all())
    }

    /// Adds up the light on a graphics device.
    fn on_gpu(&self, gpu: Gpu) -> Result<Exposure> {
        Ok(Exposure {
            film: self.film(gpu.splat(self)?),
            backend: Backend::Wgpu,
            adapter: gpu.adapter,
        })
    }

    fn counts_per_lx_s(&self) -> f64 {
        libm::ldexp(1.0, -self.scale_log2)
    }

    /// True if the counts of another image can be added to those of this one.
    fn counts_as(&self, other: &Self) -> bool {
        (self.size_px, self.scale_log2) == (other.size_px, other.scale_log2)
    }

    /// Returns a film with the lamps' counts and the glow.
    fn film(&self, counts: Vec<u32>) -> Film {
        let [width_px, height_px] = self.size_px;
        let mut film = FilmData { width_px, height_px, counts, scale_log2: self.scale_log2 };
        if let Some(glow) = &self.glow {
            glow.add_to(&mut film);
        }
        Film::made(film)
    }
}

/// A backend that starts in the background, since opening a graphics device and compiling its
/// shader take longer than exposing a film.
#[derive(Debug)]
pub struct Developer {
    choice: BackendChoice,
    /// The device that is being opened. `None` if the processor was chosen, or no thread could be
    /// started.
    device: Option<JoinHandle<Result<Gpu>>>,
}

impl Developer {
    /// Starts the backend in a separate thread. The processor needs none.
    #[must_use]
    pub fn start(choice: BackendChoice) -> Self {
        let device = match choice {
            BackendChoice::Cpu => None,
            _ => std::thread::Builder::new().spawn(Gpu::ready).ok(),
        };
        Self { choice, device }
    }

    /// Adds up the light of an image once the backend is ready. With [`BackendChoice::Auto`] the
    /// processor replaces a device that fails.
    ///
    /// # Errors
    ///
    /// [`Error::Gpu`] if [`BackendChoice::Wgpu`] finds no device or the device fails.
    pub fn develop(mut self, latent: &Latent) -> Result<Exposure> {
        let gpu = match self.device.take() {
            None if self.choice != BackendChoice::Wgpu => return Ok(latent.on_cpu()),
            // No thread could be started.
            None => Gpu::ready(),
            Some(device) => device.join().unwrap_or_else(|_| Err(gpu::driver_panicked())),
        };
        match gpu.and_then(|gpu| latent.on_gpu(gpu)) {
            Err(_) if self.choice == BackendChoice::Auto => Ok(latent.on_cpu()),
            exposure => exposure,
        }
    }
}

/// Opens the graphics device, and runs the shader once. Returns its name and driver.
///
/// # Errors
///
/// [`Error::Gpu`] if there is none, or it fails.
pub fn try_device() -> Result<String> {
    Gpu::ready().map(|gpu| gpu.adapter)
}

impl Drop for Developer {
    /// Waits for the device, since a driver that is still compiling may crash an exiting program.
    fn drop(&mut self) {
        if let Some(device) = self.device.take() {
            drop(device.join());
        }
    }
}

/// Refuses numbers of camera and options out of range, and traces with too many samples.
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
    // All numbers of the camera's distortion and pose, which may be negative.
    let distortion = camera.distortion.map(|k| ("camera: distortion", k, [-1e3, 1e3]));
    let pose = camera.position_m.iter().chain(camera.camera_from_world.iter());
    let pose = pose.map(|value| ("camera: position and attitude", *value, [-1e9, 1e9]));
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

/// Returns the records of all lamps, grouped by color. Refuses more than [`MAX_SAMPLES`].
fn tints(trace: &LightTrace, camera: &Camera, merge_tolerance_px: f64) -> Result<Vec<Tint>> {
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
        // Lamp by lamp: its path, merged to segments, becomes records.
        segments.clear();
        let intervals = project::intervals(lamp, camera);
        merge::merge(intervals, brightest, merge_tolerance_px, &mut segments);
        for segment in &segments {
            record::records(segment, [camera.width_px, camera.height_px], |record| {
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

/// Returns the error of too many samples or segments.
fn too_many(place: &str, what: &str, n: usize) -> Error {
    let hint = "take a shorter flight, coarser samples or a larger merge tolerance";
    Error::input(place, format!("{n} {what}"), format!("at most {MAX_SAMPLES}"), hint)
}
