//! Flags that several verbs share, and the scene and the flights that they lead to.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::PossibleValuesParser;

use super::letters::LetterFlags;
use super::message;
use super::names::{named, names};
use super::relit::relit_where_dark;
use super::set::{SetFlag, Setting, borrowed};
use crate::camera::{FixedPose, Framing};
use crate::error::{Error, Result};
use crate::expose::BackendChoice;
use crate::flight::Flight;
use crate::logs::{self, Damaged, ImportOptions, OnClock, PositionSource};
use crate::photo::Noise;
use crate::plan::{Plan, Style};
use crate::preflight::{Profile, frame_within};
use crate::scene::{NamedScene, Preset, Scene};
use crate::sensors::read_lighthouse_config;
use crate::shoot::{Recording, Shoot};

/// The scene.
#[derive(Debug, Args)]
pub(super) struct SceneFlags {
    /// Scene: a file (TOML), a photo of this program (PNG), a preset, team, pid, geometric, tuned,
    /// or a learned folder
    #[arg(long, value_name = "SCENE")]
    scene: Option<String>,
    #[command(flatten)]
    set: SetFlag,
    /// Lighthouse configuration (YAML of cfclient) whose base stations replace the scene's
    #[arg(long, value_name = "FILE")]
    lighthouse: Option<PathBuf>,
}

impl SceneFlags {
    /// The scene with the settings of these and of other flags.
    pub(super) fn load(&self, more: &[Setting]) -> Result<Scene> {
        Ok(self.named(more)?.scene)
    }

    /// The same, with the learned plans if the scene is a folder.
    pub(super) fn named(&self, more: &[Setting]) -> Result<NamedScene> {
        self.named_using(more, &[])
    }

    fn named_using(&self, more: &[Setting], used: &[&str]) -> Result<NamedScene> {
        let settings = [more, &self.set.set].concat();
        let mut found = match &self.scene {
            Some(named) => find_scene(named, &settings)?,
            None => NamedScene::new("", parse_scene("", "scene", &settings)?),
        };
        self.finish(&mut found.scene, used)?;
        Ok(found)
    }

    /// The scene for a verb that uses keys which are without effect in a flight.
    pub(super) fn load_using(&self, keys: &[&str]) -> Result<Scene> {
        Ok(self.named_using(&[], keys)?.scene)
    }

    /// Whether a scene was named.
    pub(super) fn is_given(&self) -> bool {
        self.scene.is_some()
    }

    /// Whether a key of the scene was typed.
    pub(super) fn sets(&self, key: &str) -> bool {
        self.set.set.iter().any(|(typed, _)| typed == key)
    }

    /// The scene that was named, or else that of a text, which is checked before any file that it
    /// names is looked at.
    pub(super) fn load_or(
        &self,
        toml: &str,
        file: &str,
        check: impl FnOnce(&mut Scene) -> Result<()>,
    ) -> Result<Scene> {
        if self.scene.is_some() {
            return self.load(&[]);
        }
        let mut scene = parse_scene(toml, file, &self.set.set)?;
        check(&mut scene)?;
        self.finish(&mut scene, &[])?;
        Ok(scene)
    }

    fn finish(&self, scene: &mut Scene, used: &[&str]) -> Result<()> {
        if let Some(path) = &self.lighthouse {
            let config = read_lighthouse_config(path)?;
            warn_of(path, &config.warnings);
            scene.sensors.lighthouse.stations = config.stations;
        }
        scene.check()?;
        scene.settle_files()?;
        warn_of_idle_keys_but(scene, used);
        Ok(())
    }
}

/// A scene by its name with settings laid over it, and its learned plans.
pub(super) fn find_scene(named: &str, settings: &[Setting]) -> Result<NamedScene> {
    Scene::find(named, &borrowed(settings))
}

/// The text of a scene with settings laid over it.
fn parse_scene(toml: &str, file: &str, settings: &[Setting]) -> Result<Scene> {
    Scene::parse_with(toml, file, &borrowed(settings))
}

/// The seed, of verbs that draw noise.
#[derive(Debug, Args)]
pub(super) struct SeedFlag {
    /// Seed of all noise [default: the scene's]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

impl SeedFlag {
    /// The key of the scene that was typed.
    pub(super) fn settings(&self) -> Vec<Setting> {
        self.seed.iter().map(|seed| ("seed".to_owned(), seed.to_string())).collect()
    }

    /// The seed that was typed, else the scene's.
    pub(super) fn or(&self, scenes: u64) -> u64 {
        self.seed.unwrap_or(scenes)
    }
}

/// Way of flying and number of drones.
#[derive(Debug, Args)]
pub(super) struct PlanFlags {
    /// Way of flying
    #[arg(long, value_name = "NAME", value_parser = names::<Style>())]
    style: Option<String>,
    /// Drones that share the word
    #[arg(long, value_name = "N")]
    drones: Option<u32>,
}

impl PlanFlags {
    /// The keys of the scene that were typed.
    pub(super) fn settings(&self) -> Vec<Setting> {
        let style = self.style.iter().map(|style| ("plan.style", style.clone()));
        let drones = self.drones.iter().map(|n| ("plan.drones", n.to_string()));
        style.chain(drones).map(|(key, value)| (key.to_owned(), value)).collect()
    }
}

/// The scene with its letters and its way of flying.
#[derive(Debug, Args)]
pub(super) struct DesignFlags {
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    letters: LetterFlags,
    #[command(flatten)]
    plan: PlanFlags,
}

impl DesignFlags {
    /// The scene with the settings of these and of other flags.
    pub(super) fn load(&self, more: &[Setting]) -> Result<Scene> {
        Ok(self.named(more)?.scene)
    }

    fn named(&self, more: &[Setting]) -> Result<NamedScene> {
        let settings = [self.letters.settings(), self.plan.settings(), more.to_vec()];
        let mut settings = settings.concat();
        // A height that was typed is meant.
        let meant = self.scene.sets("letters.cap_height_m");
        settings.retain(|(key, _)| !meant || key != "letters.fit");
        let mut found = self.scene.named(&settings)?;
        if let Some(room_m) = self.letters.room_m() {
            let usual = Scene::preset(found.scene.preset).sensors.lighthouse.stations;
            let stations = &mut found.scene.sensors.lighthouse.stations;
            if *stations == usual {
                *stations = Profile::indoor().in_room(room_m).stations().into();
            }
        }
        Ok(found)
    }
}

/// A word, or ready plans, with the scene.
#[derive(Debug, Args)]
pub(super) struct SubjectFlags {
    /// Word to write, or plans that fly together (*.csv, or their folder) [default: the scene's
    /// word]
    #[arg(value_name = "WORD|PLAN", conflicts_with = "drawing")]
    inputs: Vec<String>,
    /// Word that the plans or flights write [default: the scene's]
    #[arg(long, value_name = "WORD")]
    word: Option<String>,
    #[command(flatten)]
    design: DesignFlags,
    #[command(flatten)]
    seed: SeedFlag,
}

impl SubjectFlags {
    /// The scene.
    pub(super) fn scene(&self) -> Result<Scene> {
        Ok(self.named()?.scene)
    }

    fn named(&self) -> Result<NamedScene> {
        let mut found = self.design.named(&self.seed.settings())?;
        if let Some(word) = &self.word {
            set_word(&mut found.scene, word)?;
        }
        Ok(found)
    }

    /// The room that was typed.
    fn room_m(&self) -> Option<[f64; 3]> {
        self.design.letters.room_m()
    }

    /// The word that was typed, in either way.
    pub(super) fn typed_word(&self) -> Option<&str> {
        self.word.as_ref().or(self.inputs.first()).map(String::as_str)
    }

    /// The word or the plans, ready to fly; `change` has the last word on the scene.
    pub(super) fn shoot(&self, change: impl FnOnce(&mut Scene) -> Result<()>) -> Result<Shoot> {
        let mut named = self.named()?;
        change(&mut named.scene)?;
        let inputs: Vec<String> = self.inputs.iter().flat_map(|input| plans_in(input)).collect();
        let is_plan = |input: &&String| Path::new(input).extension().is_some_and(|e| e == "csv");
        let plans: Vec<&String> = inputs.iter().filter(is_plan).collect();
        match inputs.as_slice() {
            [] => {}
            [word] if plans.is_empty() => set_word(&mut named.scene, word)?,
            all if all.len() == plans.len() => {
                let plans = plans.iter().map(|file| Plan::read_csv(file.as_ref()));
                return Shoot::with_plans(named.scene, plans.collect::<Result<_>>()?);
            }
            inputs => {
                let hint = "name one word, or plans that are flown together";
                let found = inputs.join(" ");
                return Err(Error::input("inputs", found, "one word, or files *.csv", hint));
            }
        }
        if let Some(room_m) = self.room_m() {
            frame_within(&mut named.scene, room_m)?;
        }
        Shoot::named(named)
    }
}

/// Limits that a flight is checked against.
#[derive(Debug, Args)]
pub(super) struct ProfileFlags {
    /// Limits: indoor (a Crazyflie, 1 m/s), careful (0.5 m/s) or outdoor
    #[arg(long, value_name = "NAME", default_value = "indoor", value_parser = profiles())]
    profile: String,
}

fn profiles() -> PossibleValuesParser {
    Profile::all().map(|profile| profile.name).into()
}

impl ProfileFlags {
    /// The profile, within the room that was typed.
    pub(super) fn profile(&self, subject: &SubjectFlags) -> Profile {
        let profile = Profile::all().into_iter().find(|profile| profile.name == self.profile);
        let profile = profile.expect("the parser knows the names");
        match subject.room_m() {
            Some(room_m) => profile.in_room(room_m),
            None => profile,
        }
    }
}

/// The files `plan-N.csv` in a folder in order of their numbers; anything else as it is.
fn plans_in(input: &str) -> Vec<String> {
    let numbered = (1..).map(|n| Path::new(input).join(format!("plan-{n}.csv")));
    let found = numbered.take_while(|path| path.is_file());
    let found: Vec<String> = found.map(|path| path.display().to_string()).collect();
    if found.is_empty() { vec![input.to_owned()] } else { found }
}

/// The camera.
#[derive(Debug, Args)]
pub(super) struct CameraFlags {
    /// Camera: that of another scene, or auto (square in front of the word, framing it)
    #[arg(long, value_name = "SCENE|auto")]
    camera: Option<String>,
    /// Photograph whose EXIF sets sensor, lens, aperture, shutter time, ISO and aspect
    #[arg(long, value_name = "PHOTO")]
    camera_from: Option<PathBuf>,
}

impl CameraFlags {
    /// Whether a camera was named.
    pub(super) fn is_given(&self) -> bool {
        self.camera.is_some() || self.camera_from.is_some()
    }

    /// The scene that the camera is from, with its word.
    pub(super) fn scene(&self) -> Result<Scene> {
        let named = self.camera.as_deref().filter(|named| *named != "auto");
        let mut scene = named
            .map_or(Ok(Scene::preset(Preset::default())), |n| Ok(find_scene(n, &[])?.scene))?;
        self.apply(&mut scene)?;
        Ok(scene)
    }

    /// Puts the camera that was typed into the scene.
    pub(super) fn apply(&self, scene: &mut Scene) -> Result<()> {
        match self.camera.as_deref() {
            None => {}
            Some("auto") => scene.camera.framing = Framing::default(),
            Some(named) => scene.camera = find_scene(named, &[])?.scene.camera,
        }
        if let Some(path) = &self.camera_from {
            scene.camera = std::mem::take(&mut scene.camera).taken_as(path)?;
            scene.camera.check()?;
        }
        Ok(())
    }
}

/// The place of the camera.
#[derive(Debug, Args)]
pub(super) struct StandFlag {
    /// Where the camera stands, in m from the take-off mark: to the right, back (minus: in front)
    /// and up, such as 1.2,-3.5,1.4; it looks at the word
    #[arg(long, value_name = "X,Y,Z", value_parser = place, allow_hyphen_values = true)]
    camera_at: Option<[f64; 3]>,
}

impl StandFlag {
    /// Puts the camera of a scene there.
    pub(super) fn apply(&self, scene: &mut Scene) -> Result<()> {
        if let Some(position_m) = self.camera_at {
            let pose = FixedPose { position_m, ..FixedPose::default() };
            scene.camera.framing = Framing::Fixed(pose);
            scene.camera.check()?;
        }
        Ok(())
    }
}

fn place(text: &str) -> std::result::Result<[f64; 3], String> {
    let parts = text.split(',').map(|part| part.trim().parse().ok());
    let numbers: Option<Vec<f64>> = parts.collect();
    let place = numbers.and_then(|numbers| numbers.try_into().ok());
    place.ok_or_else(|| "wanted X,Y,Z in meters, such as 1.2,-3.5,1.4".to_owned())
}

/// The picture: camera, size and the device that computes it.
#[derive(Debug, Args)]
pub(super) struct PictureFlags {
    #[command(flatten)]
    camera: CameraFlags,
    #[command(flatten)]
    stand: StandFlag,
    /// Size of the picture: in pixels, such as 1920x1080, or of a print, such as A2@150 or
    /// 600x400mm@150: its paper, across, and its dots per inch. A print has the noise of the
    /// camera's sensor, resampled to its dots
    #[arg(long, value_name = "WxH|PAPER@DPI", value_parser = size)]
    size: Option<Size>,
    /// Device that computes the exposure; the result is the same, bit for bit
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = named::<BackendChoice>())]
    pub(super) backend: BackendChoice,
}

impl PictureFlags {
    /// Puts camera and size that were typed into the scene.
    pub(super) fn apply(&self, scene: &mut Scene) -> Result<()> {
        self.camera.apply(scene)?;
        self.stand.apply(scene)?;
        if let Some(Size { px: [width_px, height_px], dots_per_inch }) = self.size {
            let Scene { camera, photo, .. } = scene;
            if let Noise::Emva1288(noise) = &mut photo.noise
                && dots_per_inch.is_some()
            {
                // The noise of a print's scene is that of its dots already.
                let before_px = match camera.dots_per_inch {
                    Some(_) => f64::from(camera.width_px),
                    None => camera.body.width_px(),
                };
                let across = before_px / f64::from(width_px);
                *noise = noise.resampled(across * across);
            }
            (camera.width_px, camera.height_px) = (width_px, height_px);
            camera.dots_per_inch = dots_per_inch;
            scene.camera.check()?;
        }
        Ok(())
    }
}

/// Size of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Size {
    px: [u32; 2],
    /// Of a print.
    dots_per_inch: Option<f64>,
}

/// Longer side of paper A0 to A5 (ISO 216); each one's shorter side is the next one's longer.
const PAPER_MM: [f64; 7] = [1189.0, 841.0, 594.0, 420.0, 297.0, 210.0, 148.0];

fn size(text: &str) -> std::result::Result<Size, String> {
    let wanted = "wanted WIDTHxHEIGHT in pixels, such as 1920x1080, or a print: A0 to A5, or \
                  WIDTHxHEIGHTmm, with @ and its dots per inch (10 to 2400), such as A2@150";
    let sides = |text: &str| -> Option<[f64; 2]> {
        let (w, h) = text.split_once(['x', 'X', '×'])?;
        Some([w.parse().ok()?, h.parse().ok()?])
    };
    let print = |paper: &str, dots: &str| -> Option<Size> {
        let dots: f64 = dots.parse().ok().filter(|dots| (10.0..=2400.0).contains(dots))?;
        let number = paper.strip_prefix(['A', 'a']).and_then(|n| n.parse().ok());
        let mm = match number.filter(|n: &usize| *n < 6) {
            Some(n) => [PAPER_MM[n], PAPER_MM[n + 1]],
            None => sides(paper.strip_suffix("mm")?)?,
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let px = mm.map(|mm: f64| (mm / 25.4 * dots).round() as u32);
        Some(Size { px, dots_per_inch: Some(dots) })
    };
    let found = match text.split_once('@') {
        Some((paper, dots)) => print(paper, dots),
        None => {
            let sides = text.split_once(['x', 'X', '×']);
            let px = sides.and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
            px.map(|px| Size { px, dots_per_inch: None })
        }
    };
    found.ok_or_else(|| wanted.to_owned())
}

/// Flights from files: flights of ours, or logs of real ones.
#[derive(Debug, Args)]
pub(super) struct FlightFlags {
    /// Position (and attitude) of a log that counts as the true one
    #[arg(long, value_name = "SOURCE", default_value = "best", value_parser = named::<PositionSource>())]
    pub(super) position: PositionSource,
    /// Longest gap of a log that is interpolated, in seconds
    #[arg(long, value_name = "S", default_value_t = ImportOptions::default().max_gap_s)]
    pub(super) max_gap: f64,
    /// Sample rate of a log as a flight, in Hz
    #[arg(long, value_name = "HZ", default_value_t = ImportOptions::default().sample_rate_hz)]
    pub(super) rate: f64,
    /// Seconds that the drone's clock counts in a true second: a number or a fraction (84/85 for
    /// µSD logs of firmware before August 2026)
    #[arg(long, value_name = "RATIO", default_value = "1", value_parser = ratio)]
    pub(super) clock_ratio: f64,
    /// Recover the undamaged part of a broken µSD log, instead of refusing it
    #[arg(long)]
    pub(super) recover: bool,
}

/// A number, or a fraction of two.
fn ratio(text: &str) -> std::result::Result<f64, String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let ratio = match text.split_once('/') {
        Some((above, below)) => number(above).zip(number(below)).map(|(a, b)| a / b),
        None => number(text),
    };
    ratio.filter(|r| r.is_finite()).ok_or_else(|| "wanted a number such as 0.988, or 84/85".into())
}

impl FlightFlags {
    pub(super) fn options(&self) -> ImportOptions {
        ImportOptions {
            position: self.position,
            max_gap_s: self.max_gap,
            sample_rate_hz: self.rate,
            clock_ratio: self.clock_ratio,
            damaged: if self.recover { Damaged::Recover } else { Damaged::Refuse },
        }
    }

    /// Reads a flight or a log, and prints its warnings.
    pub(super) fn read(&self, path: &Path) -> Result<Flight> {
        let flight = logs::import(path, &self.options())?;
        warn_of(path, &flight.warnings);
        Ok(flight)
    }

    /// The same, with the clock of the log.
    pub(super) fn read_on_clock(&self, path: &Path) -> Result<OnClock> {
        let found = logs::import_on_clock(path, &self.options())?;
        warn_of(path, &found.flight.warnings);
        Ok(found)
    }

    /// Flights, logs or light traces that are photographed, one for each drone. A log without lights
    /// has those of the scene's word.
    pub(super) fn shoot(
        &self,
        mut scene: Scene,
        word: Option<&str>,
        paths: &[PathBuf],
    ) -> Result<Shoot> {
        if let Some(word) = word {
            set_word(&mut scene, word)?;
        }
        let mut recordings = Vec::new();
        for path in paths {
            let mut recording = Recording::read(path, &self.options())?;
            if let Recording::Flight(flight) = &mut recording {
                warn_of(path, &flight.warnings);
                relit_where_dark(flight, &mut scene, path)?;
            }
            recordings.push(recording);
        }
        Shoot::with_recordings(scene, recordings)
    }
}

/// Warns of keys that were set and have no effect.
pub(super) fn warn_of_idle_keys(scene: &Scene) {
    warn_of_idle_keys_but(scene, &[]);
}

/// The same, but for keys that the verb uses.
fn warn_of_idle_keys_but(scene: &Scene, used: &[&str]) {
    let idle = scene.idle_keys().into_iter();
    for (key, why) in idle.filter(|(key, _)| !used.contains(&key.as_str())) {
        message("warning: ", &format!("{key} has no effect: {why}"));
    }
}

/// Prints the warnings of a file.
fn warn_of(path: &Path, warnings: &[impl std::fmt::Display]) {
    for warning in warnings {
        message("warning: ", &format!("{}: {warning}", path.display()));
    }
}

/// Gives a scene a word that was typed, in which the two characters `\n` begin a new line.
///
/// # Errors
///
/// [`Error::Input`] for the name of a picture, which is hardly a word.
pub(super) fn set_word(scene: &mut Scene, word: &str) -> Result<()> {
    let ends = [".svg", ".png", ".jpg", ".jpeg", ".inkml"];
    if ends.iter().any(|end| word.to_lowercase().ends_with(end)) && Path::new(word).is_file() {
        let hint = format!("draw it with --drawing {word}");
        return Err(Error::input("input", format!("the file {word}"), "a word", hint));
    }
    scene.set_word(&word.replace("\\n", "\n"));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_is_pixels_or_a_print() {
        let print = |px, dots| Ok(Size { px, dots_per_inch: Some(dots) });
        assert_eq!(size("1920x1080"), Ok(Size { px: [1920, 1080], dots_per_inch: None }));
        // 594 mm by 420 mm (ISO 216), 25.4 mm an inch.
        assert_eq!(size("A2@150"), print([3508, 2480], 150.0));
        assert_eq!(size("a5@300"), print([2480, 1748], 300.0));
        assert_eq!(size("254x127mm@100"), print([1000, 500], 100.0));
        assert_eq!(size("1e99x10mm@100"), print([u32::MAX, 39], 100.0), "refused by its pixels");
        for wrong in ["A6@150", "A2", "A2@0", "A2@nan", "-1x5mm", "594x420@150", "x", "A2@150dpi"] {
            assert!(size(wrong).is_err_and(|wanted| wanted.contains("A2@150")), "{wrong}");
        }
    }

    #[test]
    fn a_print_has_its_sensors_noise_however_often_it_is_resized() {
        let on = |sizes: &[&str]| {
            let mut scene = Scene::preset(Preset::default());
            for text in sizes {
                PictureFlags {
                    camera: CameraFlags { camera: None, camera_from: None },
                    stand: StandFlag { camera_at: None },
                    size: Some(size(text).unwrap()),
                    backend: BackendChoice::Auto,
                }
                .apply(&mut scene)
                .unwrap();
            }
            scene
        };
        let Noise::Emva1288(poster) = on(&["A2@150"]).photo.noise else { panic!("a sensor") };
        // 6000 photosites across 3508 dots.
        let n = (6000.0_f64 / 3508.0).powi(2);
        assert!((poster.full_well_e / 50_000.0 / n - 1.0).abs() < 1e-12, "{poster:?}");
        let Noise::Emva1288(twice) = on(&["A4@150", "A2@150"]).photo.noise else { panic!() };
        assert!((twice.full_well_e / poster.full_well_e - 1.0).abs() < 1e-12, "{twice:?}");
        assert_eq!(on(&["640x360"]).photo, Scene::preset(Preset::default()).photo);
        let mut large = Scene::preset(Preset::default());
        (large.camera.width_px, large.camera.height_px) = (14_043, 9933);
        let error = large.check().unwrap_err();
        assert!(error.hint().contains("dots per inch"), "A0@300: {error}");
    }
}
