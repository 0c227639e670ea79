//! `noctograph expose`: a flight becomes its photograph.

use std::path::{Path, PathBuf};

use clap::Args;

use super::inputs::{PictureFlags, SceneFlags, strokes};
use super::outputs::Output;
use super::progress::Busy;
use super::{Outcome, print, show};
use crate::camera::Camera;
use crate::error::Result;
use crate::expose::{self, BackendChoice, ExposeOptions, Exposure};
use crate::flight::Flight;
use crate::letters::Strokes;
use crate::light::light;
use crate::photo::exr::Precision;
use crate::photo::{Photo, develop, read_out};
use crate::scene::Scene;

#[derive(Debug, Args)]
pub(super) struct ExposeArgs {
    /// Flight to expose, as `noctograph fly` writes it
    flight: PathBuf,
    /// Word that the camera frames; the scene's where it is left out
    #[arg(long, value_name = "WORD")]
    word: Option<String>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    picture: PictureFlags,
    /// Photo to write
    #[arg(short, long, value_name = "FILE", default_value = "photo.png")]
    output: PathBuf,
    /// Kind of file; where it is left out exr for a name that ends so, else png
    #[arg(long, value_name = "KIND")]
    format: Option<Format>,
    /// Print one JSON object instead of lines
    #[arg(long)]
    json: bool,
}

/// Kind of a picture's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Format {
    /// 8 bits a channel, after the tone curve
    Png,
    /// 16 bits a channel, after the tone curve
    Png16,
    /// What the sensor read in linear light, 32 bits a channel
    Exr,
    /// The same, 16 bits a channel
    ExrHalf,
}

impl Format {
    fn of(path: &Path) -> Self {
        let extension = path.extension().unwrap_or_default();
        if extension.eq_ignore_ascii_case("exr") { Self::Exr } else { Self::Png }
    }
}

pub(super) fn run(args: &ExposeArgs) -> Result<Outcome> {
    let mut scene = args.scene.load()?;
    args.picture.apply(&mut scene)?;
    let strokes = strokes(&mut scene, args.word.as_deref())?;
    let flight = Flight::read_csv(&args.flight)?;
    let output = Output::create(&args.output)?;
    let shot = shoot(&flight, &strokes, &scene, args.picture.backend.into())?;
    let format = args.format.unwrap_or_else(|| Format::of(&args.output));
    let bytes = shot.file(format, &scene)?;
    let sha256 = show::sha256(&bytes);
    let path = output.keep(|out| std::io::Write::write_all(out, &bytes))?;
    let (backend, adapter) = (shot.exposure.backend, &shot.exposure.adapter);
    if args.json {
        let json = serde_json::json!({
            "backend": backend.name(), "adapter": adapter, "photo_sha256": sha256, "files": [path],
        });
        print(&format!("{json}\n"))?;
    } else {
        let file = path.display();
        print(&format!("{}files     {file}\n", show::exposure_line(backend, adapter)))?;
    }
    Ok(Outcome::Done)
}

/// A photograph with the camera and the film that it came from.
#[derive(Debug)]
pub(super) struct Shot {
    pub(super) photo: Photo,
    pub(super) camera: Camera,
    pub(super) exposure: Exposure,
    seed: u64,
}

/// Photographs a flight with a scene's lamps and camera.
pub(super) fn shoot(
    flight: &Flight,
    strokes: &Strokes,
    scene: &Scene,
    backend: BackendChoice,
) -> Result<Shot> {
    let end_s = flight.samples.last().map_or(0.0, |last| last.time_s);
    let camera = scene.camera.camera(strokes.bounds_m(), end_s)?;
    let options = ExposeOptions { backend, ..scene.expose };
    let trace = light(flight, &scene.light)?;
    let _busy = Busy::new("exposing");
    let exposure = expose::expose(&trace, &camera, &options)?;
    let mut photo = develop(&exposure.film, &camera, &scene.photo, scene.seed)?;
    photo.scene_toml = Some(scene.to_toml());
    Ok(Shot { photo, camera, exposure, seed: scene.seed })
}

impl Shot {
    /// The photo as a PNG file: with camera, seed, version and scene, without a time stamp.
    pub(super) fn png(&self) -> Vec<u8> {
        let mut png = Vec::new();
        let written = self.photo.write_png(&mut png, Some(&self.camera), &self.notes());
        written.expect("a checked photo fits into a PNG in memory");
        png
    }

    /// The picture as a file of another kind, with the same notes.
    fn file(&self, format: Format, scene: &Scene) -> Result<Vec<u8>> {
        let precision = match format {
            Format::Png => return Ok(self.png()),
            Format::Png16 => None,
            Format::Exr => Some(Precision::Float),
            Format::ExrHalf => Some(Precision::Half),
        };
        let readout = read_out(&self.exposure.film, &self.camera, &scene.photo, self.seed)?;
        let (camera, mut notes, scene_toml) = (&self.camera, self.notes(), scene.to_toml());
        let mut out = std::io::Cursor::new(Vec::new());
        let written = match precision {
            None => {
                let tone = scene.photo.tone;
                readout.write_png16(&mut out, tone, camera, &notes, Some(&scene_toml))
            }
            Some(precision) => {
                notes.push(("noctograph.scene", scene_toml));
                readout.write_exr(&mut out, camera, precision, &notes)
            }
        };
        written.expect("a checked picture fits into memory");
        Ok(out.into_inner())
    }

    fn notes(&self) -> Vec<(&'static str, String)> {
        let Camera { focal_length_m, f_number, iso, shutter_open_s, shutter_close_s, .. } =
            self.camera;
        let camera = format!(
            "{} mm, f/{f_number}, ISO {iso}, shutter open from {shutter_open_s} s to \
             {shutter_close_s} s of the flight",
            focal_length_m * 1000.0
        );
        vec![
            ("Software", format!("noctograph {}", env!("CARGO_PKG_VERSION"))),
            ("noctograph.camera", camera),
            ("noctograph.seed", self.seed.to_string()),
        ]
    }
}
