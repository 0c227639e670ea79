//! Flags that several verbs share, and the scene they make.

use std::path::{Path, PathBuf};

use clap::Args;

use super::tell;
use crate::camera::Framing;
use crate::error::{Error, Result};
use crate::expose::BackendChoice;
use crate::flight::Flight;
use crate::letters::{self, Strokes};
use crate::light::{LightTrace, csv::is_light_trace, light};
use crate::logs::{self, ImportOptions, PositionSource};
use crate::photo::Photo;
use crate::plan::PlanOptions;
use crate::scene::Scene;
use crate::score::{Homography, View};
use crate::sim::read_lighthouse_config;

/// Where the scene comes from.
#[derive(Debug, Args)]
pub(super) struct SceneFlags {
    /// Scene file (TOML); keys it leaves out keep their default
    #[arg(long, value_name = "FILE")]
    pub(super) scene: Option<PathBuf>,
    /// Seed of all noise; the scene's own (0) where it is left out
    #[arg(long, value_name = "N")]
    pub(super) seed: Option<u64>,
    /// Lighthouse configuration (YAML, as cfclient saves it) whose base stations replace the
    /// scene's
    #[arg(long, value_name = "FILE")]
    pub(super) lighthouse: Option<PathBuf>,
}

impl SceneFlags {
    /// The scene file, or the default, with the seed and the base stations that were typed.
    pub(super) fn load(&self) -> Result<Scene> {
        let mut scene = self.scene.as_deref().map_or(Ok(Scene::default()), Scene::read)?;
        if let Some(seed) = self.seed {
            scene.seed = seed;
        }
        if let Some(path) = &self.lighthouse {
            let config = read_lighthouse_config(path)?;
            for warning in &config.warnings {
                tell(&format!("warning: {}: {warning}", path.display()));
            }
            scene.sensors.stations = config.stations;
        }
        scene.check()?;
        Ok(scene)
    }
}

/// How the word is drawn.
#[derive(Debug, Args)]
pub(super) struct LetterFlags {
    /// Font: ae483, ae483-fixed, simplex, or a file *.strokes, *.ttf or *.otf; the scene's where it
    /// is left out
    #[arg(long, value_name = "NAME|FILE")]
    font: Option<String>,
    /// Drawing instead of a word: *.svg, or handwriting as *.json or *.inkml
    #[arg(long, value_name = "FILE")]
    drawing: Option<String>,
}

impl LetterFlags {
    /// Puts what was typed into the scene.
    pub(super) fn apply(&self, scene: &mut Scene) -> Result<()> {
        if let Some(font) = &self.font {
            font.clone_into(&mut scene.letters.font);
        }
        if let Some(drawing) = &self.drawing {
            drawing.clone_into(&mut scene.letters.drawing);
            scene.word.clear();
        }
        scene.letters.check()
    }
}

/// What draws the picture, and how large.
#[derive(Debug, Args)]
pub(super) struct PictureFlags {
    /// Who exposes: both draw the same bits; auto takes wgpu where it finds an adapter
    #[arg(long, value_name = "NAME", default_value = "auto")]
    pub(super) backend: BackendName,
    /// Size of the picture in pixels, such as 1920x1080; the scene's where it is left out
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,
    /// Where the camera stands; auto: square in front of the word, which it frames with a margin
    #[arg(long, value_name = "NAME", default_value = "scene")]
    camera: CameraName,
    /// Photograph whose EXIF sets sensor, lens, aperture, shutter time, ISO and aspect
    #[arg(long, value_name = "PHOTO")]
    camera_from: Option<PathBuf>,
}

/// Who places the camera.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum CameraName {
    Scene,
    Auto,
}

impl PictureFlags {
    /// Puts the size and the camera's place that were typed into the scene.
    pub(super) fn apply(&self, scene: &mut Scene) -> Result<()> {
        if let Some(path) = &self.camera_from {
            scene.camera = std::mem::take(&mut scene.camera).taken_as(path)?;
            scene.camera.check()?;
        }
        if let CameraName::Auto = self.camera {
            scene.camera.framing = Framing::Word;
        }
        if let Some((width_px, height_px)) = self.size {
            scene.camera.width_px = width_px;
            scene.camera.height_px = height_px;
            scene.camera.check()?;
        }
        Ok(())
    }
}

/// Who exposes.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(super) enum BackendName {
    Auto,
    Wgpu,
    Cpu,
}

impl From<BackendName> for BackendChoice {
    fn from(name: BackendName) -> Self {
        match name {
            BackendName::Auto => Self::Auto,
            BackendName::Wgpu => Self::Wgpu,
            BackendName::Cpu => Self::Cpu,
        }
    }
}

/// Way of flying.
#[derive(Debug, Args)]
pub(super) struct StyleFlag {
    /// Way of flying, team or even; the scene's where it is left out, else its defaults replace the
    /// scene's section plan
    #[arg(long, value_name = "NAME", value_parser = ["team", "even"])]
    style: Option<String>,
}

impl StyleFlag {
    /// Puts the style that was typed into the scene; its light channels stay.
    pub(super) fn apply(&self, scene: &mut Scene) {
        let plan = match self.style.as_deref() {
            Some("even") => PlanOptions::even(),
            Some(_) => PlanOptions::default(),
            None => return,
        };
        let lights = std::mem::take(&mut scene.plan.lights);
        scene.plan = PlanOptions { lights, ..plan };
    }
}

/// Way of flying and number of drones, where several may share a word.
#[derive(Debug, Args)]
pub(super) struct PlanFlags {
    #[command(flatten)]
    style: StyleFlag,
    /// Drones that share the word; the scene's where it is left out
    #[arg(long, value_name = "N")]
    drones: Option<u32>,
}

impl PlanFlags {
    /// Puts what was typed into the scene.
    pub(super) fn apply(&self, scene: &mut Scene) {
        self.style.apply(scene);
        scene.plan.drones = self.drones.unwrap_or(scene.plan.drones);
    }
}

/// Refuses a scene of several drones where one is shown.
pub(super) fn one_drone(scene: &Scene) -> Result<()> {
    if scene.plan.drones == 1 {
        return Ok(());
    }
    let hint = "run `noctograph plan --drones N -o DIR`, `fly` each plan, and `expose` all flights";
    Err(Error::input("plan.drones", scene.plan.drones, "1", hint))
}

/// The strokes of a scene's drawing or word; a typed word goes before both. In a typed word `\n`, as a
/// shell hands it over, begins a new line.
pub(super) fn strokes(scene: &mut Scene, word: Option<&str>) -> Result<Strokes> {
    if let Some(word) = word {
        scene.word = word.replace("\\n", "\n");
        scene.letters.drawing.clear();
    } else if !scene.letters.drawing.is_empty() {
        return letters::draw(scene.letters.drawing.as_ref(), &scene.letters);
    } else if scene.word.is_empty() {
        let hint = "name the word on the command line, or as `word = \"NOOR\"` in the scene file";
        return Err(Error::input("word", "no word", "the word that is written", hint));
    }
    letters::write(&scene.word, &scene.letters)
}

/// A flight from a file, whoever flew it: a flight of ours, or a log.
pub(super) fn read_flight(path: &Path) -> Result<Flight> {
    import_flight(path, &ImportOptions::default())
}

/// A flight from a file, imported as told where it is a log.
pub(super) fn import_flight(path: &Path, options: &ImportOptions) -> Result<Flight> {
    let flight = logs::import(path, options)?;
    tell_warnings(&flight, path);
    Ok(flight)
}

/// Which logged position, and attitude, is taken for the truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum PositionName {
    /// The first of the following that is logged and alive
    Best,
    /// Motion capture
    Mocap,
    /// The observer of the AE483 course
    Custom,
    /// The firmware's estimator
    Firmware,
    /// Raw fixes of the Lighthouse
    Lighthouse,
    /// What was believed in flight: custom, else firmware; the estimate of a flight file
    Estimate,
}

impl From<PositionName> for PositionSource {
    fn from(name: PositionName) -> Self {
        match name {
            PositionName::Best => Self::Best,
            PositionName::Mocap => Self::Mocap,
            PositionName::Custom => Self::Custom,
            PositionName::Firmware => Self::Firmware,
            PositionName::Lighthouse => Self::Lighthouse,
            PositionName::Estimate => Self::Estimate,
        }
    }
}

/// Tells what whoever reads a flight should know.
pub(super) fn tell_warnings(flight: &Flight, path: &Path) {
    for warning in &flight.warnings {
        tell(&format!("warning: {}: {warning}", path.display()));
    }
}

/// What shines in front of the camera.
#[derive(Debug, Default)]
pub(super) struct Lamps {
    pub(super) trace: LightTrace,
    /// Time of the last sample.
    pub(super) end_s: f64,
    /// Digests of the flights that carried them, with a space between; `None` where they came from
    /// light traces.
    pub(super) flight_sha256: Option<String>,
}

impl Lamps {
    /// Those of a flight of the drone with index `drone`, with the scene's emitters.
    pub(super) fn of(flight: &Flight, scene: &Scene, drone: u64) -> Result<Self> {
        Ok(Self {
            trace: light(flight, &scene.light, scene.seed, drone)?,
            end_s: flight.samples.last().map_or(0.0, |last| last.time_s),
            flight_sha256: Some(flight.sha256()),
        })
    }

    /// Those of another drone as well.
    pub(super) fn append(&mut self, other: Self) {
        self.trace.append(other.trace);
        self.end_s = self.end_s.max(other.end_s);
        let digests = [self.flight_sha256.take(), other.flight_sha256];
        let digests: Vec<String> = digests.into_iter().flatten().collect();
        self.flight_sha256 = (!digests.is_empty()).then(|| digests.join(" "));
    }
}

/// The lamps of files, one for each drone: flights with the scene's emitters, or light traces as
/// they are. Lamps of several drones have the drone's number, from 1, before their name.
pub(super) fn lamps(paths: &[PathBuf], scene: &Scene) -> Result<Lamps> {
    let mut all = Lamps::default();
    for (drone, path) in (0..).zip(paths) {
        let mut lamps = lamps_of(path, scene, drone)?;
        if paths.len() > 1 {
            for lamp in &mut lamps.trace.lamps {
                lamp.emitter.name = format!("{}: {}", drone + 1, lamp.emitter.name);
            }
        }
        all.append(lamps);
    }
    Ok(all)
}

fn lamps_of(path: &Path, scene: &Scene, drone: u64) -> Result<Lamps> {
    if is_light_trace(path) {
        let trace = LightTrace::read_csv(path)?;
        let ends = trace.lamps.iter().filter_map(|lamp| lamp.samples.last());
        let end_s = ends.map(|last| last.time_s).fold(0.0, f64::max);
        return Ok(Lamps { trace, end_s, flight_sha256: None });
    }
    Lamps::of(&read_flight(path)?, scene, drone)
}

/// The box of the scene's word, which the camera may frame. A camera that is fixed needs no word.
pub(super) fn bounds_m(scene: &mut Scene, word: Option<&str>) -> Result<[f64; 4]> {
    let nothing = scene.word.is_empty() && scene.letters.drawing.is_empty();
    if word.is_none() && nothing && scene.camera.framing == Framing::Fixed {
        return Ok([0.0; 4]);
    }
    Ok(strokes(scene, word)?.bounds_m())
}

fn size(text: &str) -> std::result::Result<(u32, u32), String> {
    let sides = text.split_once(['x', 'X', '×']);
    let sides = sides.and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    sides.ok_or_else(|| "wanted WIDTHxHEIGHT in pixels, such as 1920x1080".to_owned())
}

/// Four corners in a photo, clockwise from the upper left.
#[derive(Clone, Debug)]
pub(super) struct Corners(pub(super) [[f64; 2]; 4]);

impl std::str::FromStr for Corners {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let corner = |pair: &str| {
            let (x, y) = pair.split_once(',')?;
            Some([x.trim().parse().ok()?, y.trim().parse().ok()?])
        };
        let corners: Option<Vec<[f64; 2]>> = text.split_whitespace().map(corner).collect();
        corners.and_then(|corners| corners.try_into().ok()).map(Self).ok_or_else(|| {
            "wanted four corners \"X,Y X,Y X,Y X,Y\" in pixels, clockwise from the upper left"
                .into()
        })
    }
}

/// Room around the corners, in the line's height: letters may hang out of them.
const AROUND_CORNERS: f64 = 0.5;

/// A photo whose line of writing is seen square on, where corners or a camera say how.
pub(super) fn flat(
    photo: Photo,
    corners: Option<&Corners>,
    camera: Option<&Path>,
) -> Result<Photo> {
    let size_px = [photo.width_px, photo.height_px];
    if let Some(Corners(corners)) = corners {
        let side = |a: usize, b: usize| {
            libm::hypot(corners[b][0] - corners[a][0], corners[b][1] - corners[a][1])
        };
        let [width, height] = [side(0, 1).max(side(3, 2)), side(0, 3).max(side(1, 2))];
        let view =
            View::Plane(Homography::from_corners([0.0, 0.0, width, height], *corners, size_px)?);
        let room = AROUND_CORNERS * height;
        return Ok(view.square_on(&photo, [-room, -room, width + room, height + room], 1.0));
    }
    let Some(path) = camera else { return Ok(photo) };
    let mut scene = Scene::read(path)?;
    (scene.camera.width_px, scene.camera.height_px) = (photo.width_px, photo.height_px);
    let bounds_m = bounds_m(&mut scene, None)?;
    let camera = scene.camera.camera(bounds_m, 0.0)?;
    // Where the rays of the photo's corners meet the plane of the word.
    let [right, bottom] = size_px.map(f64::from);
    let rays = [[0.0, 0.0], [right, 0.0], [right, bottom], [0.0, bottom]];
    let meets = rays.map(|[x, y]| {
        let ray = camera.world_from_image(x, y)?;
        let far = -camera.position_m.y / ray.y;
        (far > 0.0 && far < MAX_FAR_M).then(|| camera.position_m + ray * far)
    });
    let meets: Option<Vec<_>> = meets.into_iter().collect();
    let meets = meets.ok_or_else(|| {
        let wanted = "a camera all of whose picture shows the plane of the word";
        let hint = "name the scene that the photo was taken with, or the four --corners instead";
        Error::input(path.display().to_string(), "a camera that looks past the word", wanted, hint)
    })?;
    let of = |pick: fn(f64, f64) -> f64, start: f64, axis: usize| {
        meets.iter().map(|point| point[axis]).fold(start, pick)
    };
    let bounds_m = [
        of(f64::min, f64::INFINITY, 0),
        of(f64::min, f64::INFINITY, 2),
        of(f64::max, f64::NEG_INFINITY, 0),
        of(f64::max, f64::NEG_INFINITY, 2),
    ];
    let px_per_m = right / (bounds_m[2] - bounds_m[0]);
    Ok(View::from(&camera).square_on(&photo, bounds_m, px_per_m))
}

/// Farthest that the plane of the word may be along a ray of the camera.
const MAX_FAR_M: f64 = 1000.0;
