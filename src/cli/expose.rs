//! `noctograph expose`: a flight becomes its photograph.

use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::Vector3;

use super::inputs::{Lamps, PictureFlags, SceneFlags, bounds_m, lamps};
use super::outputs::Output;
use super::progress::Busy;
use super::{Outcome, print, show, tell};
use crate::camera::Camera;
use crate::digest::sha256;
use crate::error::{Error, Result};
use crate::expose::{Developer, Exposure, project};
use crate::light::{LightSample, LightTrace};
use crate::photo::exr::Precision;
use crate::photo::{Photo, develop, read_out};
use crate::scene::Scene;

#[derive(Debug, Args)]
pub(super) struct ExposeArgs {
    /// Flights to expose, one for each drone, as `noctograph fly` writes them, or light traces:
    /// t,x,y,z,r,g,b
    #[arg(required = true, value_name = "FLIGHT")]
    flights: Vec<PathBuf>,
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
    let bounds_m = bounds_m(&mut scene, args.word.as_deref())?;
    let output = Output::create(&args.output)?;
    let developer = Developer::start(args.picture.backend.into());
    let lamps = lamps(&args.flights, &scene)?;
    let shot = shoot(&lamps, bounds_m, &scene, developer)?;
    let format = args.format.unwrap_or_else(|| Format::of(&args.output));
    let bytes = shot.file(format, &scene)?;
    let sha256 = sha256(&bytes);
    let path = output.keep(|out| std::io::Write::write_all(out, &bytes))?;
    let (backend, adapter) = (shot.exposure.backend, &shot.exposure.adapter);
    if args.json {
        let json = serde_json::json!({
            "backend": backend.name(),
            "adapter": adapter,
            "flight_sha256": lamps.flight_sha256,
            "photo_sha256": sha256,
            "files": [path],
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
    flight_sha256: Option<String>,
}

/// Photographs lamps with a scene's camera, and tells what falls outside the picture.
pub(super) fn shoot(
    lamps: &Lamps,
    bounds_m: [f64; 4],
    scene: &Scene,
    developer: Developer,
) -> Result<Shot> {
    let Lamps { trace, end_s, flight_sha256 } = lamps;
    let camera = scene.camera.camera(bounds_m, *end_s)?;
    check_place(trace, bounds_m, &camera)?;
    warn_outside(trace, bounds_m, &camera);
    let _busy = Busy::new("exposing");
    let exposure = developer.develop(&project(trace, &camera, &scene.expose)?)?;
    let mut photo = develop(&exposure.film, &camera, &scene.photo, scene.seed)?;
    photo.scene_toml = Some(scene.to_toml());
    let flight_sha256 = flight_sha256.clone();
    Ok(Shot { photo, camera, exposure, seed: scene.seed, flight_sha256 })
}

/// Nearest that a lit lamp may come to the camera.
const NEAREST_M: f64 = 0.1;

/// Refuses a camera among the lamps, or behind the word, where it reads mirrored.
fn check_place(trace: &LightTrace, [left, _, right, _]: [f64; 4], camera: &Camera) -> Result<()> {
    let hint = "set camera.position_m metres in front of the word, or take --camera auto";
    let [x, y, z] = camera.position_m.into();
    if left < right && y > 0.0 {
        let found = format!("[{x}, {y}, {z}], behind the word, which would read mirrored");
        return Err(Error::input("camera.position_m", found, "y below 0, in front of it", hint));
    }
    let distance_m = |s: &LightSample| (s.position_m - camera.position_m).norm();
    for lamp in &trace.lamps {
        let near = |s: &&LightSample| s.level > 0.0 && distance_m(s) < NEAREST_M;
        if let Some(sample) = lamp.samples.iter().find(near) {
            let name = &lamp.emitter.name;
            let found = format!(
                "[{x}, {y}, {z}], {:.3} m from lamp `{name}` at {:.2} s",
                distance_m(sample),
                sample.time_s
            );
            let wanted = format!("at least {NEAREST_M} m from every lit lamp");
            return Err(Error::input("camera.position_m", found, wanted, hint));
        }
    }
    Ok(())
}

/// Tells how much of the word and of the light stands out of the picture.
fn warn_outside(trace: &LightTrace, [left, bottom, right, top]: [f64; 4], camera: &Camera) {
    let corners = [[left, 0.0, bottom], [right, 0.0, bottom], [left, 0.0, top], [right, 0.0, top]];
    let word = corners.map(Vector3::from).into_iter().filter(|_| left < right);
    let open = camera.shutter_open_s..=camera.shutter_close_s;
    let lit = |s: &&LightSample| s.level > 0.0 && open.contains(&s.time_s);
    let samples = trace.lamps.iter().flat_map(|lamp| &lamp.samples).filter(lit);
    let light = samples.map(|sample| sample.position_m);
    for (what, outside) in [("word", camera.outside(word)), ("light", camera.outside(light))] {
        if let Some(sides) = outside.in_words() {
            tell(&format!(
                "warning: part of the {what} is outside the picture: {sides} (--camera auto frames \
                 the word; camera.fill_frac sets the margin)"
            ));
        }
    }
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
        let mut notes = vec![
            ("Software", format!("noctograph {}", env!("CARGO_PKG_VERSION"))),
            ("noctograph.camera", camera),
            ("noctograph.seed", self.seed.to_string()),
        ];
        let flight = self.flight_sha256.clone();
        notes.extend(flight.map(|digest| ("noctograph.flight_sha256", digest)));
        notes
    }
}
