//! The photo as a file, with camera, seed, version, flights and scene, without a time stamp.

use std::io::Cursor;
use std::path::Path;

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::expose::Film;
use crate::photo::exr::Precision;
use crate::photo::{Photo, read_out};
use crate::scene::Scene;
use crate::settings::settings;

settings! {
    /// Format of a picture file.
    pub enum Format {
        /// PNG, 8 bits a channel, after the tone curve.
        "png" => Png,
        /// PNG, 16 bits a channel, after the tone curve.
        "png16" => Png16,
        /// OpenEXR, linear light as the sensor read it, 32 bits a channel.
        "exr" => Exr,
        /// The same, 16 bits a channel.
        "exr-half" => ExrHalf,
    }
}

impl Format {
    /// The format that a file's name asks for: OpenEXR for `*.exr`, PNG for `*.png` and names
    /// without an ending.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for another ending, whose format is not written.
    pub fn from_path(path: &Path) -> Result<Self> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
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
}

/// Encodes a photo; OpenEXR and 16 bits are read out from the film anew.
pub(super) fn encode(
    format: Format,
    scene: &Scene,
    photo: &Photo,
    film: &Film,
    camera: &Camera,
    flight_sha256: Option<String>,
) -> Result<Vec<u8>> {
    let mut notes = notes(scene.seed, camera, flight_sha256);
    let mut out = Cursor::new(Vec::new());
    let readout = || read_out(film, camera, &scene.photo, scene.seed);
    let written = match format {
        Format::Png => photo.write_png(&mut out, Some(camera), &notes),
        Format::Png16 => {
            let toml = scene.to_toml();
            readout()?.write_png16(&mut out, scene.photo.tone, camera, &notes, Some(&toml))
        }
        Format::Exr | Format::ExrHalf => {
            let half = format == Format::ExrHalf;
            let precision = if half { Precision::Half } else { Precision::Float };
            notes.push(("noctograph.scene", scene.to_toml()));
            readout()?.write_exr(&mut out, camera, precision, &notes)
        }
    };
    written.expect("a checked picture fits into memory");
    Ok(out.into_inner())
}

fn notes(seed: u64, camera: &Camera, flight_sha256: Option<String>) -> Vec<(&'static str, String)> {
    let Camera { focal_length_m, f_number, iso, shutter_open_s, shutter_close_s, .. } = camera;
    let camera = format!(
        "{} mm, f/{f_number}, ISO {iso}, shutter open from {shutter_open_s} s to \
         {shutter_close_s} s of the flight",
        focal_length_m * 1000.0
    );
    let mut notes = vec![
        ("Software", format!("noctograph {}", env!("CARGO_PKG_VERSION"))),
        ("noctograph.camera", camera),
        ("noctograph.seed", seed.to_string()),
    ];
    notes.extend(flight_sha256.map(|digest| ("noctograph.flight_sha256", digest)));
    notes
}
