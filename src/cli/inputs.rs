//! Flags that several verbs share, and the scene they make.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use clap::Args;

use super::progress::{Busy, Progress};
use super::tell;
use crate::camera::Framing;
use crate::error::{Error, Result};
use crate::expose::BackendChoice;
use crate::flight::Flight;
use crate::logs::{self, ImportOptions, PositionSource};
use crate::photo::Photo;
use crate::plan::PlanOptions;
use crate::scene::Scene;
use crate::score::{Homography, View};
use crate::shoot::{Recording, Shoot, Stage};
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
        scene.expose.backend = self.backend.into();
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

/// Puts a typed word into the scene, in place of its word or drawing. In a typed word `\n`, as a shell
/// hands it over, begins a new line.
pub(super) fn type_word(scene: &mut Scene, word: Option<&str>) {
    if let Some(word) = word {
        scene.set_word(&word.replace("\\n", "\n"));
    }
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

/// A shoot of recordings: flights, logs or light traces, one for each drone.
pub(super) fn recorded(scene: Scene, paths: &[PathBuf]) -> Result<Shoot> {
    let read = |path: &PathBuf| {
        let recording = Recording::read(path, &ImportOptions::default())?;
        if let Recording::Flight(flight) = &recording {
            tell_warnings(flight, path);
        }
        Ok(recording)
    };
    Shoot::with_recordings(scene, paths.iter().map(read).collect::<Result<_>>()?)
}

/// Shows the progress of a shoot.
pub(super) fn watch() -> impl Fn(Stage, f64) + Sync {
    let shown: Mutex<(Option<Progress>, Option<Busy>)> = Mutex::new((None, None));
    move |stage, done| {
        let Ok(mut shown) = shown.lock() else { return };
        match stage {
            Stage::Flying => shown.0.get_or_insert_with(|| Progress::new("flying")).update(done),
            Stage::Exposing if done < 1.0 => *shown = (None, Some(Busy::new("exposing"))),
            Stage::Exposing => *shown = (None, None),
        }
    }
}

/// Prints what a person should know about a shot.
pub(super) fn tell_all(warnings: &[String]) {
    for warning in warnings {
        tell(&format!("warning: {warning}"));
    }
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
    let fixed = scene.camera.framing == Framing::Fixed && !scene.has_strokes();
    let bounds_m = if fixed { [0.0; 4] } else { scene.strokes()?.bounds_m() };
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
