//! Scene: the TOML file that completely determines a photo.
//!
//! Omitted keys take the values of a preset, by default `cf21`, so a scene contains only what
//! differs. Unknown keys and values out of range are refused, with the line and the key.

use std::path::Path;

use toml::Table;

use noctograph_core::camera::CameraOptions;
use noctograph_core::digest::sha256;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Limit, ending};
use noctograph_core::settings::{Described, settings};
use noctograph_letters::{self as letters, Ink, LetterOptions, Strokes};
use noctograph_picture::expose::ExposeOptions;
use noctograph_picture::light::LightOptions;
use noctograph_picture::photo::{self, Noise, PhotoOptions};
use noctograph_plan::{Order, PlanOptions, Style};
use noctograph_score::ScoreOptions;
use noctograph_sim::sensors::SensorOptions;
use noctograph_sim::vehicle::{AirOptions, BatteryOptions, FloorOptions, VehicleOptions};
use noctograph_sim::{
    ControllerOptions, ObserverOptions, RadioOptions, RateOptions, Setpoints, SimOptions,
};

mod carried;
mod implied;
mod named;
mod preset;
mod task;
mod text;
mod travel;
mod unused_keys;

pub use carried::CarriedScene;
pub use named::NamedScene;
pub use preset::Preset;
pub use task::SceneTask;
pub use travel::{SceneFiles, folder_of};
pub use unused_keys::reason;

settings! {
    /// Everything that a photo depends on. The default is the preset `ae483-2022`. A file that
    /// names no preset starts from `cf21`.
    pub struct Scene {
        /// Preset that supplies the values of omitted keys.
        preset: Preset = Preset::Ae4832022;
        /// Word to write. `\n` begins a new line.
        word: String = String::new(), unless "letters.drawing";
        /// Seed of all noise. The same seed makes the same photo.
        seed: u64 = 0;
        /// How the word is drawn.
        letters: LetterOptions = LetterOptions::default();
        /// How the strokes are flown.
        plan: PlanOptions = PlanOptions::default();
        /// The drone.
        vehicle: VehicleOptions = VehicleOptions::default();
        /// The battery.
        battery: BatteryOptions = BatteryOptions::default(), for "battery.capacity_ah";
        /// The air.
        air: AirOptions = AirOptions::default();
        /// The floor below the flight.
        floor: FloorOptions = FloorOptions::default();
        /// Clocks of the simulation.
        rates: RateOptions = RateOptions::default();
        /// The radio from the host to the drones.
        radio: RadioOptions = RadioOptions::default();
        /// The controller, which computes motor commands from the estimated state.
        controller: ControllerOptions = ControllerOptions::default();
        /// The estimator, which computes the state from the measurements.
        observer: ObserverOptions = ObserverOptions::default();
        /// The sensors and their noise.
        sensors: SensorOptions = SensorOptions::default(), unless "observer.kind" = "truth";
        /// The lamps, and how they follow commands.
        light: LightOptions = LightOptions::default();
        /// The camera.
        camera: CameraOptions = CameraOptions::default();
        /// Resolution of the exposure, and the floor that the lamps illuminate.
        expose: ExposeOptions = ExposeOptions::default();
        /// Effects of lens and sensor, and the tone curve.
        photo: PhotoOptions = PhotoOptions::default();
        /// The reader and its verdict.
        score: ScoreOptions = ScoreOptions::default();
    }
}

/// Maximum size of a scene file.
pub(super) const LIMIT: Limit = Limit { bytes: 1 << 20, what: "a scene file", hint: text::HINT };

impl Scene {
    /// Reads a scene from a file.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] if the file cannot be read. Returns [`Error::Input`] with line and key
    /// for malformed TOML, an unknown key or a value out of range.
    pub fn read(path: &Path) -> Result<Self> {
        Self::read_with(path, &[])
    }

    /// Reads a scene file, or the scene of a photo (PNG), a log, a plan or a flight
    /// ([`CarriedScene`]). Individual settings override keys as in [`Self::parse_with`].
    fn read_with(path: &Path, settings: &[(&str, &str)]) -> Result<Self> {
        // The file's extension determines how the scene is read.
        let file = path.display().to_string();
        if ["csv", "json"].contains(&&*ending(path)) {
            let Some(carried) = CarriedScene::read(path)? else {
                let wanted = "the log of an exported script, or a plan or flight next to its scene";
                let hint = "name the scene's own file";
                return Err(Error::input(file, "a file without a scene", wanted, hint));
            };
            return carried.scene(settings);
        }
        if ending(path) != "png" {
            return Self::parse_in(&text::read_file(path)?, &file, &folder_of(path), settings);
        }
        let Some(toml) = photo::read_with_notes(path)?.0.into_data().scene_toml else {
            let (actual, wanted) = ("a photo without a scene", "a photo made by this program");
            return Err(Error::input(file, actual, wanted, "name the scene's own file"));
        };
        Self::parse_in(&toml, &format!("{file} (scene)"), &folder_of(path), settings)
    }

    /// Reads the text of a scene. `file` is the file name to show in messages.
    pub fn parse(toml: &str, file: &str) -> Result<Self> {
        Self::parse_with(toml, file, &[])
    }

    /// Reads the text of a scene. Settings are dotted keys with values that override keys in the
    /// text, such as `("vehicle.mass_kg", "0.04")` or `("plan.style", "even")`.
    ///
    /// Precedence, highest first: settings, keys in the file, implied values (listed in the text of
    /// [`Self::to_toml`]), preset.
    pub fn parse_with(toml: &str, file: &str, settings: &[(&str, &str)]) -> Result<Self> {
        Self::parse_in(toml, file, Path::new(""), settings)
    }

    /// Reads the text of a scene in a folder, as [`Self::parse_with`] does. File names in the text
    /// are relative to that folder, and those in settings to the current folder.
    pub fn parse_in(
        toml: &str,
        file: &str,
        folder: &Path,
        settings: &[(&str, &str)],
    ) -> Result<Self> {
        // The layers, lowest first, are: preset, implied values, file, individual settings.
        let mut set_keys = Table::new();
        for (key, value) in settings {
            let setting = text::single_setting(key, value)?;
            text::overlay(&mut set_keys, setting, Self::SHAPE.settings());
        }
        let mut file_keys = text::read(toml, file)?;
        travel::resolve_files(&mut file_keys, folder);
        let mut layers = vec![file_keys, set_keys];
        let preset = match implied::last_name(&layers, "preset") {
            Some(name) => name.parse()?,
            None => Preset::default(),
        };
        let mut scene = Self::preset(preset);
        implied::apply(&mut scene, &mut layers);
        let mut values = scene.to_table();
        let declared = Self::SHAPE.settings();
        layers.into_iter().for_each(|layer| text::overlay(&mut values, layer, declared));
        Self::checked(values).map_err(|error| text::with_line(error, toml, file))
    }

    /// Reads the scene from a table with all settings. Returns [`Error::Input`] for an unknown key
    /// or name, or a value out of range.
    fn checked(values: Table) -> Result<Self> {
        text::check_keys(&values)?;
        let scene = Self::from_table(values)?;
        scene.check()?;
        Ok(scene)
    }

    /// Returns the complete scene as TOML text, with the value and documentation of every key.
    pub fn to_toml(&self) -> String {
        text::document(self)
    }

    /// Returns all keys and values. Settings are written and read only here and in
    /// [`Self::from_table`], because such code becomes large when compiled.
    pub fn to_table(&self) -> Table {
        Table::try_from(self).expect("a scene is a TOML table")
    }

    /// Reads a scene from a table that contains all keys. Ranges are not checked.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] with the key whose value has the wrong type.
    pub fn from_table(values: Table) -> Result<Self> {
        text::to_scene(values)
    }

    /// Returns the settings that may contain a file name: fonts, drawing and background.
    pub fn files_mut(&mut self) -> impl Iterator<Item = &mut String> {
        let letters = &mut self.letters;
        let fonts = std::iter::once(&mut letters.font).chain(&mut letters.fallback);
        fonts.chain([&mut letters.drawing, &mut self.photo.background])
    }

    /// Returns the keys that differ from the preset, each with both values.
    pub fn changes(&self) -> Vec<[String; 3]> {
        text::changes(self, self.preset.scene())
    }

    /// Returns the scene of a preset.
    pub fn preset(preset: Preset) -> Self {
        preset.scene().clone()
    }

    /// Returns true if the scene has a word or a drawing.
    pub fn has_strokes(&self) -> bool {
        !self.word.is_empty() || !self.letters.drawing.is_empty()
    }

    /// Replaces the word or drawing with another word.
    pub fn set_word(&mut self, word: &str) {
        word.clone_into(&mut self.word);
        self.letters.drawing.clear();
        self.letters.drawing_sha256.clear();
    }

    /// Adapts the scene to an audience: a word is written in reading order, the camera has no hot
    /// pixels, and the floor is uniform.
    pub fn for_audience(&mut self) {
        // Hebrew and Arabic, including their presentation forms, are read from right to left.
        if let Style::Even(style) = &mut self.plan.style
            && style.order == Order::Shortest
            && self.letters.drawing.is_empty()
            && !self.word.contains(|c| matches!(c, '\u{590}'..='\u{8ff}' | '\u{fb1d}'..='\u{fefc}'))
        {
            style.order = Order::Reading;
        }
        if let Noise::Emva1288(noise) = &mut self.photo.noise {
            noise.hot_pixel_frac = 0.0;
        }
        self.expose.unevenness = 0.0;
    }

    /// Makes file paths absolute and sets the digest of the drawing, so that the scene is the same
    /// in every folder. [`Self::strokes`] reports a missing drawing.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] if the scene contains the digest of a different drawing.
    pub fn settle_files(&mut self) -> Result<()> {
        for path in self.files_mut().filter(|name| travel::is_file(name)) {
            if let Ok(absolute) = std::path::absolute(&*path)
                && let Some(absolute) = absolute.to_str().filter(|_| absolute.exists())
            {
                *path = absolute.to_owned();
            }
        }
        let drawing = Path::new(&self.letters.drawing);
        // A named pipe can be read only once, so it is not read until it is drawn.
        if drawing.is_file() {
            let bytes = letters::DRAWING_LIMIT.read(drawing)?;
            let actual = sha256(&bytes);
            let wanted = &mut self.letters.drawing_sha256;
            if !wanted.is_empty() && *wanted != actual {
                let hint =
                    "restore the drawing, or clear letters.drawing_sha256 to draw the new drawing";
                let place = "letters.drawing_sha256";
                let actual = format!("{} with digest {actual}", self.letters.drawing);
                return Err(Error::input(place, actual, format!("digest {wanted}"), hint));
            }
            *wanted = actual;
        }
        Ok(())
    }

    /// Returns the strokes of the drawing or, if there is none, of the word. The strokes of a
    /// drawing are grouped by color if a colored lamp writes.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`letters::draw`] and [`letters::write`].
    pub fn strokes(&self) -> Result<Strokes> {
        if !self.letters.drawing.is_empty() {
            let ink = if unused_keys::writes_in_color(self) { Ink::ByColor } else { Ink::Alike };
            return letters::draw(self.letters.drawing.as_ref(), &self.letters, ink);
        }
        letters::write(&self.word, &self.letters)
    }

    /// Returns the rate of the clock that paces the setpoints, in its seconds per true second. The
    /// default is the firmware's rate for an onboard trajectory, and 1 otherwise.
    pub fn trajectory_clock(&self) -> f64 {
        let is_on_board = self.radio.drones > 0 && self.radio.setpoints == Setpoints::OnBoard;
        let usual = if is_on_board { self.vehicle.firmware.clock() } else { 1.0 };
        self.plan.trajectory_clock.unwrap_or(usual)
    }

    /// Returns the part of the scene that the simulator uses.
    pub fn sim(&self) -> SimOptions {
        SimOptions {
            rates: self.rates.clone(),
            vehicle: self.vehicle.clone(),
            battery: self.battery.clone(),
            air: self.air.clone(),
            floor: self.floor.clone(),
            radio: self.radio.clone(),
            controller: self.controller.clone(),
            observer: self.observer.clone(),
            sensors: self.sensors.clone(),
        }
    }

    /// Checks that every value is in its range.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] that names the key out of range.
    pub fn check(&self) -> Result<()> {
        if i64::try_from(self.seed).is_err() {
            let wanted = format!("a whole number from 0 to {}", i64::MAX);
            return Err(Error::input("seed", self.seed, wanted, "choose a smaller seed"));
        }
        self.letters.check()?;
        self.plan.check()?;
        self.sim().check()?;
        self.light.check()?;
        self.camera.check()?;
        Described::check(&self.expose, "expose", None)?;
        self.photo.check("photo", None)?;
        self.score.check("score", None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::camera::Metering;
    use noctograph_picture::light::{RingColor, RingEffect};
    use noctograph_plan::EvenStyle;

    #[test]
    fn a_ring_that_is_chosen_writes_unless_its_effect_is_named() {
        fn ring(toml: &str, settings: &[(&str, &str)]) -> RingEffect {
            Scene::parse_with(toml, "scene.toml", settings).unwrap().light.ring
        }
        let solid = RingEffect::Solid(RingColor::default());
        let chosen = ("plan.lights", "[\"ring\"]");
        assert_eq!(ring("", &[chosen]), solid);
        assert_eq!(ring("[plan]\nlights = [\"ring\"]\n", &[]), solid);
        assert_eq!(ring("[light]\nring = \"off\"\n", &[chosen]), solid);
        let named = "[plan]\nlights = [\"ring\"]\n[light]\nring = \"off\"\n";
        assert_eq!(ring(named, &[]), RingEffect::Off);
        for settings in [[("light.ring", "off"), chosen], [chosen, ("light.ring", "off")]] {
            assert_eq!(ring("", &settings), RingEffect::Off);
        }
        assert_eq!(ring("", &[]), RingEffect::Off);
        // The color is set without the effect, and together with the effect in either order.
        let (color, effect) = (("light.ring.color", "[1, 2, 3]"), ("light.ring", "solid"));
        let colored = RingEffect::Solid(RingColor { color: [1, 2, 3] });
        for settings in [&[chosen, color][..], &[color, effect], &[effect, color]] {
            assert_eq!(ring("", settings), colored, "{settings:?}");
        }
        for (toml, settings) in [("", &[color][..]), ("[light.ring]\ncolor = [1, 2, 3]\n", &[])] {
            let refused = Scene::parse_with(toml, "scene.toml", settings).unwrap_err().to_string();
            assert!(refused.contains("light.ring.color: found color"), "{refused}");
        }
        let printed = Scene::parse_with("", "scene", &[chosen]).unwrap();
        assert_eq!(Scene::parse_with(&printed.to_toml(), "scene", &[]).unwrap(), printed);
    }

    #[test]
    fn a_scene_reads_back_bit_by_bit() {
        let mut scene =
            Scene { word: "Ä \"x\"\\".into(), seed: 7, ..Scene::preset(Preset::default()) };
        scene.camera.shutter_close_s = Some(0.1 + 0.2);
        scene.vehicle.mass_kg = 0.1 / 3.0;
        let mut fixtures = scene.light.fixtures();
        fixtures.pop();
        scene.light.fixtures = Some(fixtures);
        assert_eq!(Scene::parse(&scene.to_toml(), "scene.toml").unwrap(), scene);
    }

    #[test]
    fn a_scene_keeps_what_its_preset_says_and_changes_what_it_names() {
        let toml = "preset = \"cf21\"\n[vehicle]\nmass_kg = 0.0351\n[air]\ngusts = \"dryden\"\n";
        let mut want = Scene::preset(Preset::Cf21);
        want.vehicle.mass_kg = 0.0351;
        want.air.gusts = noctograph_sim::vehicle::Gusts::Dryden;
        assert_eq!(Scene::parse(toml, "my.toml").unwrap(), want);
        assert_ne!(want.controller, Scene::preset(Preset::Ae4832022).controller, "its own gains");
    }

    #[test]
    fn a_style_sets_defaults_and_leaves_what_the_file_says() {
        let scene = |toml, settings| Scene::parse_with(toml, "my.toml", settings).unwrap();
        let even = scene("[plan]\nstyle = \"even\"", &[]);
        assert_eq!(even.plan, PlanOptions::even());
        let mine = "[plan]\nfloor_wait_s = 5.0\nlights = [\"ring\"]\n";
        let typed = scene(mine, &[("plan.style", "even"), ("plan.style.jerk_m_s3", "20")]);
        let style = EvenStyle { jerk_m_s3: 20.0, ..EvenStyle::default() };
        let want = PlanOptions {
            floor_wait_s: 5.0,
            lights: vec!["ring".into()],
            ..PlanOptions::even_with(style)
        };
        assert_eq!(typed.plan, want);
        let switched = [("plan.style", "even"), ("plan.style.exposure", "switched")];
        let interval_s = scene("", &switched).plan.setpoint_interval_s;
        assert_eq!(interval_s, 0.05, "a key of the style does not hide its kind");
        assert_eq!(scene("word = \"A\"", &[("word", "7")]).word, "7", "a word may be digits");
        assert_eq!(scene("", &[("plan.floor_wait_s", "1")]).plan.floor_wait_s, 1.0, "one is 1.0");
    }

    #[test]
    fn another_kind_of_a_group_keeps_the_keys_beside_it() {
        let toml = "[observer]\nkind = \"ekf\"\nekf.gate_sigmas = 7.0\n[controller.pid]\n";
        let mut want = Scene::parse(toml, "my.toml").unwrap();
        want.observer.kind = noctograph_sim::EstimatorKind::Truth;
        want.controller.kind = noctograph_sim::ControllerKind::Geometric;
        for observer in ["observer.kind", "observer"] {
            let set = [(observer, "truth"), ("controller.kind", "geometric")];
            assert_eq!(Scene::parse_with(toml, "my.toml", &set).unwrap(), want, "{observer}");
        }
    }

    #[test]
    fn a_drawing_is_the_same_from_every_folder_or_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("star.svg");
        std::fs::write(&path, "<svg xmlns='http://www.w3.org/2000/svg'/>").unwrap();
        let mut scene = Scene::preset(Preset::default());
        scene.letters.drawing = path.display().to_string();
        scene.settle_files().unwrap();
        assert_eq!(scene.letters.drawing_sha256.len(), 64);
        assert!(Path::new(&scene.letters.drawing).is_absolute());
        let mut again = Scene::parse(&scene.to_toml(), "scene.toml").unwrap();
        again.settle_files().unwrap();
        assert_eq!(again, scene);
        std::fs::write(&path, "<svg xmlns='http://www.w3.org/2000/svg' width='2'/>").unwrap();
        let error = again.settle_files().unwrap_err().to_string();
        assert!(error.starts_with("letters.drawing_sha256"), "{error}");
        let relative = std::path::absolute("Cargo.toml").unwrap();
        scene.letters = LetterOptions { drawing: "Cargo.toml".into(), ..LetterOptions::default() };
        scene.settle_files().unwrap();
        assert_eq!(Path::new(&scene.letters.drawing), relative);
    }

    #[test]
    fn an_aperture_that_is_set_is_not_metered() {
        let metering = |settings| {
            Scene::parse_with("[camera]\nvignetting = 0.1", "my.toml", settings)
                .unwrap()
                .camera
                .metering
        };
        assert_eq!(metering(&[]), Scene::preset(Preset::default()).camera.metering);
        assert_eq!(metering(&[("camera.iso", "200")]), Metering::Off);
        let both = [("camera.f_number", "5.6"), ("camera.metering", "trail")];
        assert_eq!(metering(&both), Scene::preset(Preset::default()).camera.metering);
    }

    #[test]
    fn every_preset_reads_back_as_it_is_printed() {
        for &preset in Preset::ALL {
            let scene = Scene::preset(preset);
            scene.check().unwrap();
            assert_eq!(Scene::parse(&scene.to_toml(), "my.toml").unwrap(), scene, "{preset:?}");
            let name = format!("preset = \"{}\"\n", preset.name());
            assert_eq!(Scene::parse(&name, "my.toml").unwrap(), scene, "{preset:?} alone");
        }
        assert_eq!(Scene::preset(Preset::Ae4832022), Scene::default());
    }

    #[test]
    fn a_deck_brings_its_lamps() {
        fn names(toml: &str) -> Vec<String> {
            let fixtures = Scene::parse(toml, "my.toml").unwrap().light.fixtures();
            fixtures.into_iter().map(|fixture| fixture.name).collect()
        }
        assert!(names("").contains(&"ring 0".to_owned()));
        let led = "[light]\ndeck = \"color-led\"\n";
        assert_eq!(names(led)[0], "color LED");
        let lights = |toml: &str| Scene::parse(toml, "my.toml").unwrap().plan.lights;
        assert_eq!(lights(led), ["color-led"]);
        assert_eq!(lights(&format!("{led}[plan]\nlights = [\"ring\"]")), ["ring"]);
        assert_eq!(
            names("[light]\ndeck = \"none\"").len(),
            10,
            "those of the board, and what they light"
        );
        let printed = Scene::preset(Preset::default()).to_toml();
        let edited = printed.replace("deck = \"led-ring\"", "deck = \"color-led\"");
        assert_ne!(printed, edited);
        assert_eq!(names(&edited)[0], "color LED", "in a printed scene too");
    }

    #[test]
    fn what_is_wrong_is_named_with_line_and_key() {
        let cases = [
            ("seed = 1\n[vehicle]\nmass_kg = -0.03\n", ":3: vehicle.mass_kg", "-0.03"),
            ("[plan]\ndron = 2\n", ":2: plan.dron", "dron"),
            ("seed = 1\nlettres = 3\n", ":2", "lettres"),
            ("seed = -1\n", ":1", "-1"),
            ("seed = 1\npreset = \"cf22\"\n", ":2", "cf21-thrust-kit"),
            ("preset = \"bzzz\"\n[vehicle]\nmass_kg = -1\n", ":3: vehicle.mass_kg", "-1"),
            ("[camera]\niso = \"high\"\n", ":2", "the text \"high\", wanted a number"),
            ("[camera]\n\niso = nan\n", ":3: camera.iso", "NaN"),
            ("[camera]\nwidth_px = 0\n", ":2: camera.width_px", "0x1080"),
            ("[letters]\nfont = \"comic\"\n", ":2: letters.font", "comic"),
            ("word = \n", ":1", "string values must be quoted"),
        ];
        for (toml, place, actual) in cases {
            let error = Scene::parse(toml, "my.toml").unwrap_err();
            let message = error.to_string();
            assert!(message.contains(&format!("my.toml{place}")), "{toml:?}: {message}");
            assert!(message.contains(actual), "{toml:?}: {message}");
            assert!(!error.hint().is_empty(), "{toml:?} leaves the reader alone");
        }
    }
}
