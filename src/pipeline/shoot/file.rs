//! Writes the photo to a file, with its camera, seed, version, flights and scene.

use std::path::Path;

use crate::scene::Scene;
use noctograph_core::camera::Camera;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::ending;
use noctograph_core::settings::settings;
use noctograph_picture::expose::Film;
use noctograph_picture::photo::png::{FLIGHT_KEYWORD, LOG_GAPS_KEYWORD, STROKES_KEYWORD};
use noctograph_picture::photo::{self, Metadata, Photo, read_out};
use noctograph_score::LogGap;

settings! {
    /// Format of a picture file.
    pub enum Format {
        /// PNG, 8 bits per channel, after the tone curve.
        "png" => Png,
        /// PNG, 16 bits per channel, after the tone curve.
        "png16" => Png16,
        /// OpenEXR, linear light as read by the sensor, 32 bits per channel.
        "exr" => Exr,
    }
}

impl Format {
    /// Returns the format for a file name: OpenEXR for `*.exr`, PNG for `*.png` and no extension.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] for any other extension.
    pub fn from_path(path: &Path) -> Result<Self> {
        let extension = ending(path);
        match &*extension {
            "exr" => Ok(Self::Exr),
            "png" | "" => Ok(Self::Png),
            _ => {
                let place = path.display().to_string();
                let hint = "name the photo *.png and convert it, or name its format";
                Err(Error::input(place, format!("a name *.{extension}"), "*.png or *.exr", hint))
            }
        }
    }

    /// Checks that a picture of this width and height in pixels can be encoded in memory. Returns
    /// [`Error::Infeasible`] otherwise.
    pub(super) fn check(self, [width, height]: [u32; 2]) -> Result<()> {
        let pixels = u64::from(width) * u64::from(height);
        if self == Self::Png || pixels <= MAX_READ_OUT {
            return Ok(());
        }
        // Film, readout and file each take 12 bytes per pixel.
        const BYTES_PER_PIXEL: f64 = 3.0 * 12.0;
        let [gb, most_gb] =
            [pixels, MAX_READ_OUT].map(|pixels| BYTES_PER_PIXEL * pixels as f64 * 1e-9);
        Err(Error::infeasible(
            format!(
                "{} of {width}x{height} px takes {gb:.1} GB of memory, more than {most_gb:.1} GB",
                self.name()
            ),
            "choose a smaller picture, or PNG with 8 bits",
        ))
    }
}

/// Maximum number of pixels in a picture that is read out from the film and encoded in memory. A
/// picture of this size takes 0.9 GB.
const MAX_READ_OUT: u64 = 24_000_000;

/// Returns the contents of a photo's file. An 8-bit PNG contains the photo's pixels. Other formats
/// are read out from the film, which must be given.
pub(super) fn encode(
    format: Format,
    scene: &Scene,
    photo: &Photo,
    film: Option<&Film>,
    camera: &Camera,
    shown: Shown,
) -> Result<Vec<u8>> {
    let notes = notes(scene.seed, camera, shown);
    let dots_per_inch = scene.camera.dots_per_inch;
    if format == Format::Png {
        let metadata = Metadata { dots_per_inch, ..Metadata::new(camera, &photo.rgb8) };
        return Ok(photo::encode_png(photo, Some(&metadata), &notes));
    }
    // Formats with more than 8 bits require the linear light of the film.
    let film = film.expect("kept for the formats that are read out");
    let readout = read_out(film, camera, &scene.expose, &scene.photo, scene.seed)?;
    let toml = scene.portable().to_toml();
    #[cfg(target_family = "wasm")]
    assert!(format != Format::Exr, "a page asks for PNG");
    #[cfg(not(target_family = "wasm"))]
    if format == Format::Exr {
        let notes = [&*notes, &[("noctograph.scene", toml)]].concat();
        return Ok(readout.encode_exr(camera, &notes));
    }
    Ok(readout.encode_png16(scene.photo.tone, (camera, dots_per_inch), &notes, Some(&toml)))
}

/// Metadata about a photo's contents, in addition to its scene.
pub(super) struct Shown {
    pub(super) flight_sha256: Option<String>,
    /// Digest of the strokes from a user's file.
    pub(super) strokes_sha256: Option<String>,
    /// Log gaps during which the photo is dark.
    pub(super) log_gaps: Vec<LogGap>,
}

/// Returns the text entries of a photo's file, each with its keyword, which state how the photo was
/// made.
fn notes(seed: u64, camera: &Camera, shown: Shown) -> Vec<(&'static str, String)> {
    let Camera { focal_length_m, f_number, iso, shutter_open_s, shutter_close_s, .. } = camera;
    let camera = format!(
        "{} mm, f/{f_number}, ISO {iso}, shutter open from {shutter_open_s} s to \
         {shutter_close_s} s of the flight",
        focal_length_m * 1000.0
    );
    // The entries contain neither time nor machine, so that the same scene produces the same file.
    let mut notes = vec![
        ("Software", format!("noctograph {}", env!("CARGO_PKG_VERSION"))),
        ("noctograph.camera", camera),
        ("noctograph.seed", seed.to_string()),
    ];
    let Shown { flight_sha256, strokes_sha256, log_gaps } = shown;
    notes.extend(flight_sha256.map(|digest| (FLIGHT_KEYWORD, digest)));
    notes.extend(strokes_sha256.map(|digest| (STROKES_KEYWORD, digest)));
    if !log_gaps.is_empty() {
        let gaps = serde_json::to_string(&log_gaps).expect("gaps are plain data");
        notes.push((LOG_GAPS_KEYWORD, gaps));
    }
    notes
}
