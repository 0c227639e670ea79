//! Flags of several verbs, and the scenes and plans that these flags select.

use std::path::{Path, PathBuf};

use super::letters::{LetterFlags, LetterSize};
use super::names::{Setting, names};
use super::outcome::shell_word;
use super::output::{drone_number, is_csv};
use super::terminal::{message, warn};
use crate::error::{Error, Result};
use crate::letters::Strokes;
use crate::plan::{Plan, Style};
use crate::preflight::{Profile, fit_within, frame_within, hang_stations, longer_than_battery};
use crate::scene::{CarriedScene, NamedScene, Scene};
use crate::sensors::read_lighthouse_config;
use crate::shoot::{DesignCheck, Shoot};
use clap::Args;
use noctograph_core::files::{Limit, file_name, files_in, is_file_name};

/// Limit on the total size of plans that fly together. The plan of an hour of flight is about 6 MB
/// large.
const PLANS: Limit = Limit {
    bytes: 64 << 20,
    what: "plans",
    hint: "increase plan.setpoint_interval_s, or name fewer plans",
};

/// Parses a setting `KEY=VALUE`. Returns the key and the value, or a message for other texts.
fn setting(text: &str) -> std::result::Result<Setting, String> {
    let (key, value) = text.split_once('=').ok_or("wanted KEY=VALUE, such as camera.iso=200")?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

/// Scene keys that are set on the command line.
#[derive(Debug, Args)]
pub(super) struct SetFlag {
    /// Set a key of the scene, such as camera.iso=200 (may be repeated)
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = setting)]
    pub(super) set: Vec<Setting>,
}

/// Flags that select the scene.
#[derive(Debug, Args)]
pub(super) struct SceneFlags {
    /// Scene: a file (TOML), a photo by this program (PNG), a script's log, a plan or flight with
    /// its scene beside it, a preset, team, pid, geometric, tuned, or a folder with scene.toml
    /// [default: that of the plans, flights or logs that are named]
    #[arg(long, value_name = "SCENE")]
    scene: Option<String>,
    #[command(flatten)]
    set: SetFlag,
    /// Lighthouse configuration (YAML of cfclient) whose base stations replace the scene's
    #[arg(long, value_name = "FILE")]
    lighthouse: Option<PathBuf>,
}

impl SceneFlags {
    /// Returns the scene with the settings of these and of other flags. Without `--scene`, it is
    /// the scene that belongs to the files, which are plans, flights or logs.
    pub(super) fn load(&self, files: &[PathBuf], more: &[Setting]) -> Result<Scene> {
        self.load_from(self.carried(files)?.as_ref(), more, &[])
    }

    /// Loads a scene like [`load`](Self::load). `carried` is the scene of the files, `more`
    /// contains settings from other flags, and `used` names keys that the verb uses although a
    /// flight does not.
    pub(super) fn load_from(
        &self,
        carried: Option<&CarriedScene>,
        more: &[Setting],
        used: &[&str],
    ) -> Result<Scene> {
        let settings = [more, &self.set.set].concat();
        // A scene named by `--scene` takes precedence over the scene of the files, which takes
        // precedence over the default.
        let mut scene = match (&self.scene, carried) {
            (Some(named), _) => find_scene(named, &settings)?.scene,
            (None, Some(carried)) => {
                message("note: ", &format!("the scene is {}", carried.file));
                warn_of_unbound(carried);
                carried.distrusted_scene(&borrowed(&settings))?
            }
            (None, None) => Scene::parse_with("", "scene", &borrowed(&settings))?,
        };
        self.finish(&mut scene, used)?;
        Ok(scene)
    }

    /// Returns the single scene that belongs to the files. If `--scene` names a scene and the files
    /// belong to different ones, prints a warning and returns `None`.
    pub(super) fn carried(&self, files: &[PathBuf]) -> Result<Option<CarriedScene>> {
        match CarriedScene::of_all(files) {
            Err(_) if self.scene.is_some() => {
                warn(files.iter().filter_map(|file| CarriedScene::read(file).err()));
                Ok(None)
            }
            carried => carried,
        }
    }

    /// Returns true if `--scene` names a scene.
    pub(super) fn is_given(&self) -> bool {
        self.scene.is_some()
    }

    /// Returns true if `--set` sets a key.
    pub(super) fn sets(&self, key: &str) -> bool {
        self.set.set.iter().any(|(typed, _)| typed == key)
    }

    /// Returns the scene that `--scene` names, or else the scene in the text `toml` of a file in a
    /// folder. `check` may refuse the text's scene before any file that it names is opened.
    pub(super) fn load_or(
        &self,
        toml: &str,
        file: &str,
        folder: &Path,
        check: impl FnOnce(&mut Scene) -> Result<()>,
    ) -> Result<Scene> {
        if self.scene.is_some() {
            return self.load(&[], &[]);
        }
        let mut scene = Scene::parse_in(toml, file, folder, &borrowed(&self.set.set))?;
        check(&mut scene)?;
        self.finish(&mut scene, &[])?;
        Ok(scene)
    }

    /// Sets the base stations from `--lighthouse`, checks the scene, resolves its file names, and
    /// warns of keys without effect, except for those in `used`.
    fn finish(&self, scene: &mut Scene, used: &[&str]) -> Result<()> {
        if let Some(path) = &self.lighthouse {
            let config = read_lighthouse_config(path)?;
            warn_of(path, &config.warnings);
            scene.sensors.lighthouse.stations = config.product;
        }
        scene.check()?;
        scene.settle_files()?;
        warn_of_unused_keys(scene, used);
        Ok(())
    }
}

/// Finds a scene by its name, and applies settings to it.
pub(super) fn find_scene(named: &str, settings: &[Setting]) -> Result<NamedScene> {
    Scene::find(named, &borrowed(settings))
}

/// Returns pairs of a key and its value in the form that [`Scene`] accepts.
fn borrowed(settings: &[Setting]) -> Vec<(&str, &str)> {
    settings.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect()
}

/// Flag of the noise seed, for verbs that simulate noise.
#[derive(Debug, Args)]
pub(super) struct SeedFlag {
    /// Seed of the noise [default: the scene's]
    #[arg(long, value_name = "N")]
    pub(super) seed: Option<u64>,
}

impl SeedFlag {
    /// Returns the seed as a setting of the scene, if the user typed one.
    pub(super) fn settings(&self) -> Vec<Setting> {
        self.seed.iter().map(|seed| ("seed".to_owned(), seed.to_string())).collect()
    }
}

/// Flags of the scene, its letters and its flight style.
#[derive(Debug, Args)]
pub(super) struct DesignFlags {
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    letters: LetterFlags,
    /// Flight style
    #[arg(long, value_name = "NAME", value_parser = names::<Style>())]
    style: Option<String>,
    /// Number of drones that write the word together
    #[arg(long, value_name = "N")]
    drones: Option<u32>,
}

impl DesignFlags {
    /// Returns the scene of files, or the named one, with the settings of these and of other flags
    /// (`more`), and with the word fitted to the room.
    pub(super) fn load(&self, files: &[PathBuf], more: &[Setting]) -> Result<Scene> {
        let carried = self.scene.carried(files)?;
        let mut scene = self.unfitted(carried.as_ref(), Design::Unplanned, more)?;
        self.fit(&mut scene)?;
        Ok(scene)
    }

    /// Fits the word to the view of a camera inside the room that was typed, unless its size was
    /// typed, too.
    fn fit(&self, scene: &mut Scene) -> Result<()> {
        let is_typed = ["letters.cap_height_m", "letters.canvas_m"].map(|key| self.scene.sets(key));
        match self.letters.room.filter(|_| is_typed == [false; 2]) {
            Some(room_m) => fit_within(scene, room_m),
            None => Ok(()),
        }
    }

    /// Returns the scene with the settings of these and of other flags (`more`), before its letters
    /// are fitted to the room. If the scene has a room, stations hang in its corners unless the
    /// scene places them.
    fn unfitted(
        &self,
        carried: Option<&CarriedScene>,
        design: Design,
        more: &[Setting],
    ) -> Result<Scene> {
        let is_planned = design == Design::Planned;
        let size = if is_planned {
            LetterSize::Kept
        } else if self.scene.sets("letters.cap_height_m") {
            LetterSize::Typed
        } else {
            LetterSize::Fitted
        };
        // Settings from --set are applied last, so that they override the other flags.
        let mut settings = self.letters.settings(size);
        settings.extend(self.style.iter().map(|style| ("plan.style".to_owned(), style.clone())));
        settings.extend(self.drones.iter().map(|n| ("plan.drones".to_owned(), n.to_string())));
        settings.extend_from_slice(more);
        let mut scene = self.scene.load_from(carried, &settings, &[])?;
        // If the named scene has no room, a plan keeps the room for which it was made.
        if let Some(carried) = carried.filter(|_| is_planned && scene.expose.room_m.is_none()) {
            warn_of_unbound(carried);
            scene.expose.room_m = carried.scene(&[])?.expose.room_m;
        }
        let room_m = scene.expose.room_m.filter(|_| is_planned).or(self.letters.room);
        if let Some(room_m) = room_m {
            hang_stations(&mut scene, room_m);
        }
        Ok(scene)
    }
}

/// State of a scene's design.
#[derive(Clone, Copy, PartialEq)]
enum Design {
    /// A word or a drawing that is still to be planned, or that was flown in a log.
    Unplanned,
    /// Finished plans, which determine the letters.
    Planned,
}

/// Flags that select the subject, which is a word or finished plans, and its scene.
#[derive(Debug, Args)]
pub(super) struct SubjectFlags {
    /// Word to write, or plans that fly together (*.csv, or their folder) [default: the scene's
    /// word]
    #[arg(value_name = "WORD|PLAN", conflicts_with = "drawing")]
    inputs: Vec<String>,
    /// Word that the plans write, or a word to write that is also the name of a file or folder
    /// [default: the scene's]
    #[arg(long, value_name = "WORD", conflicts_with = "drawing")]
    word: Option<String>,
    #[command(flatten)]
    design: DesignFlags,
    #[command(flatten)]
    seed: SeedFlag,
}

impl SubjectFlags {
    /// Returns the scene of flights and logs, or of a word, with the word fitted to the room.
    pub(super) fn scene_of(&self, flights: &[PathBuf]) -> Result<Scene> {
        let carried = self.design.scene.carried(flights)?;
        let mut scene = self.unfitted(carried.as_ref(), Design::Unplanned)?;
        self.design.fit(&mut scene)?;
        Ok(scene)
    }

    /// Returns the scene as [`DesignFlags::unfitted`] does, with the seed and the word of the
    /// flags.
    fn unfitted(&self, carried: Option<&CarriedScene>, design: Design) -> Result<Scene> {
        let mut scene = self.design.unfitted(carried, design, &[])?;
        scene.seed = self.seed.seed.unwrap_or(scene.seed);
        if let Some(word) = &self.word {
            set_word(&mut scene, word);
        }
        Ok(scene)
    }

    /// Returns the word that was typed, either as an argument or with `--word`.
    pub(super) fn typed_word(&self) -> Result<Option<&str>> {
        typed_word(self.inputs.first(), self.word.as_ref())
    }

    /// Returns the scene of a word or drawing, ready to be planned. `change` edits the scene last.
    pub(super) fn ready(&self, change: impl FnOnce(&mut Scene) -> Result<()>) -> Result<Scene> {
        // The word is set before the letters are fitted to the room, because the length of the word
        // determines the size of the letters.
        let mut scene = self.unfitted(None, Design::Unplanned)?;
        change(&mut scene)?;
        match self.inputs.as_slice() {
            [] => {}
            [word] => {
                if let Some(other) = self.word.as_ref().filter(|other| *other != word) {
                    let hint = "name a word or plans; --word names the word that the plans write";
                    return Err(Error::input("--word", other, format!("{word}, or none"), hint));
                }
                typed_word(Some(word), self.word.as_ref())?;
                check_folder(word)?;
                set_word(&mut scene, word);
            }
            inputs => {
                let hint = "name one word, or plans that are flown together";
                let actual = inputs.join(" ");
                return Err(Error::input("inputs", actual, "one word, or files *.csv", hint));
            }
        }
        self.design.fit(&mut scene)?;
        frame(&mut scene)?;
        Ok(scene)
    }

    /// Returns the paths of the plans that were named, or `None` if a word was typed.
    pub(super) fn plans(&self) -> Result<Option<Vec<PathBuf>>> {
        let plans = self.inputs.iter().map(|input| plans_in(input)).collect::<Result<Vec<_>>>()?;
        let plans = plans.concat();
        let are_plans = plans.iter().all(|path| is_csv(path));
        Ok(Some(plans).filter(|plans| are_plans && !plans.is_empty()))
    }

    /// Returns the shoot of the word or the plans, ready to fly. `change` edits the scene last. The
    /// designs of a word must pass `check` before a flight is rehearsed.
    pub(super) fn shoot(
        &self,
        change: impl FnOnce(&mut Scene) -> Result<()>,
        check: &DesignCheck<'_>,
    ) -> Result<Shoot> {
        self.planned(change, |scene, strokes| Shoot::of_strokes(scene, strokes, check))
    }

    /// Returns the shoot as [`shoot`](Self::shoot) does, with the flight of a word that is written
    /// by a single drone, if it can be simulated while the word is planned.
    pub(super) fn flown(&self, change: impl FnOnce(&mut Scene) -> Result<()>) -> Result<Shoot> {
        self.planned(change, |scene, strokes| Shoot::flown(scene, strokes, &|_| Ok(())))
    }

    /// Returns the shoot of the word or the plans. `change` edits the scene last, and `plan` plans
    /// a word. Warns if the flight is longer than the battery lasts, and if a word is written by
    /// fewer drones or in smaller letters than requested.
    fn planned(
        &self,
        change: impl FnOnce(&mut Scene) -> Result<()>,
        plan: impl FnOnce(Scene, Strokes) -> Result<Shoot>,
    ) -> Result<Shoot> {
        // Plans are flown in the scene that belongs to them, and in the room of that scene.
        if let Some(plans) = self.plans()? {
            let carried = self.design.scene.carried(&plans)?;
            if let Some(carried) = &carried {
                let mut folders = self.inputs.iter().map(Path::new).filter(|path| path.is_dir());
                folders.try_for_each(|folder| carried.check_folder(folder))?;
            }
            // Without a scene beside them, plans are flown in a scene that is set up as for a word.
            let design = if carried.is_some() { Design::Planned } else { Design::Unplanned };
            let mut scene = self.unfitted(carried.as_ref(), design)?;
            if carried.is_none() {
                self.design.fit(&mut scene)?;
            }
            change(&mut scene)?;
            frame(&mut scene)?;
            let shoot = Shoot::with_plans(scene, read_plans(&plans, carried.as_ref())?)?;
            warn(longer_than_battery(&shoot));
            return Ok(shoot);
        }
        let scene = self.ready(change)?;
        let strokes = scene.strokes()?;
        let shoot = plan(scene, strokes)?;
        warn_of_fewer_drones(&shoot);
        warn(longer_than_battery(&shoot));
        if self.design.scene.sets("letters.cap_height_m") {
            warn_of_smaller_letters(&shoot);
        }
        Ok(shoot)
    }
}

/// Places the camera inside the scene's room, if the scene has one, so that it frames the word.
pub(super) fn frame(scene: &mut Scene) -> Result<()> {
    match scene.expose.room_m.filter(|_| scene.has_strokes()) {
        Some(room_m) => frame_within(scene, room_m),
        None => Ok(()),
    }
}

/// Reads plans whose scene has been read, and checks that they still belong together.
pub(super) fn read_plans(paths: &[PathBuf], carried: Option<&CarriedScene>) -> Result<Vec<Plan>> {
    PLANS.check_all(paths)?;
    let plans = paths.iter().map(|path| Plan::read_csv(path)).collect::<Result<_>>()?;
    carried.map_or(Ok(()), |carried| carried.check_still(paths))?;
    Ok(plans)
}

/// Warns if the scene contains no digest that proves that it belongs to the file beside it.
fn warn_of_unbound(carried: &CarriedScene) {
    if !carried.is_bound {
        warn([format!(
            "{}: the scene contains no digest of the file beside it (table sha256), so it may \
             belong to another plan or flight with another room: write both files again, or \
             confirm the scene with --scene",
            carried.file
        )]);
    }
}

/// Flag that selects a flight's safety limits.
#[derive(Debug, Args)]
pub(super) struct ProfileFlags {
    /// Safety limits: indoor (a Crazyflie, 1 m/s), careful (0.5 m/s, at which the word is also
    /// planned) or outdoor
    #[arg(long, value_name = "NAME", default_value = "indoor",
          value_parser = Profile::all().map(|profile| profile.name))]
    profile: String,
}

impl ProfileFlags {
    /// Limits the planned speed to that of the profile, unless the user typed a speed.
    pub(super) fn slow(&self, subject: &SubjectFlags, scene: &mut Scene) {
        if let Some(profile) = self.limits(subject) {
            profile.slow(scene);
        }
    }

    /// Returns the profile if it limits the planned speed, which it does unless the user typed a
    /// speed.
    pub(super) fn limits(&self, subject: &SubjectFlags) -> Option<Profile> {
        let keys = ["plan.style.dark_speed_m_s", "plan.style.acceleration_m_s2"];
        (!keys.iter().any(|key| subject.design.scene.sets(key))).then(|| self.named())
    }

    fn named(&self) -> Profile {
        let profile = Profile::all().into_iter().find(|profile| profile.name == self.profile);
        profile.expect("the parser knows the names")
    }

    /// Returns the profile that the flag names, with its volume limited to the scene's room.
    pub(super) fn profile(&self, scene: &Scene) -> Profile {
        let profile = self.named();
        match scene.expose.room_m {
            Some(room_m) => profile.in_room(room_m),
            None => profile,
        }
    }
}

/// Returns the files `plan-N.csv` of a folder in the order of their numbers, or any other input
/// unchanged.
///
/// # Errors
///
/// [`Error::Input`] if a number is missing or repeated, because the remaining plans would form a
/// different flight.
fn plans_in(input: &str) -> Result<Vec<PathBuf>> {
    let folder = Path::new(input);
    let files = if folder.is_dir() { files_in(folder)? } else { Vec::new() };
    let mut plans: Vec<_> =
        files.into_iter().filter_map(|path| Some((drone_number(&path, "plan")?, path))).collect();
    plans.sort();
    // The sorted numbers must be 1, 2, 3 and so on.
    if let Some((missing, (_, other))) = (1..).zip(&plans).find(|(n, (number, _))| n != number) {
        let (actual, wanted) = (file_name(other), format!("plan-{missing}.csv first"));
        return Err(Error::input(input, actual, wanted, "name all plans that fly together"));
    }
    if plans.is_empty() {
        return Ok(vec![input.into()]);
    }
    Ok(plans.into_iter().map(|(_, path)| path).collect())
}

/// Warns if a drawing has no strokes for some of the drones.
pub(super) fn warn_of_fewer_drones(shoot: &Shoot) {
    let (wanted, planned) = (shoot.scene.plan.drones as usize, shoot.plans.len());
    if planned < wanted {
        warn([format!("only {planned} of {wanted} drones fly, because there are too few strokes")]);
    }
}

/// Warns if the letters are smaller than requested because the canvas is too small.
fn warn_of_smaller_letters(shoot: &Shoot) {
    let Some(strokes) = shoot.strokes.as_ref().filter(|strokes| strokes.font.is_some()) else {
        return;
    };
    let (asked_m, canvas_m) = (shoot.scene.letters.cap_height_m, shoot.scene.letters.canvas_m);
    let written_m = strokes.glyphs.first().map_or(asked_m, |glyph| glyph.cell.cap_height_m);
    // Fraction of the requested height above which the difference is due to rounding.
    const CLEARLY: f64 = 0.999;
    if let Some([width_m, height_m]) = canvas_m.filter(|_| written_m < CLEARLY * asked_m) {
        warn([format!(
            "letters of {asked_m} m do not fit into letters.canvas_m of {width_m} x {height_m} \
             m, so they are written {written_m:.2} m high"
        )]);
    }
}

/// Warns of keys that were set but have no effect, except for those in `used`.
pub(super) fn warn_of_unused_keys(scene: &Scene, used: &[&str]) {
    let unused = scene.unused_keys().into_iter().filter(|(key, _)| !used.contains(&key.as_str()));
    warn(unused.map(|(key, why)| format!("{key} has no effect: {why}")));
}

/// Prints warnings about a file, each preceded by the file's name.
pub(super) fn warn_of(path: &Path, warnings: &[impl std::fmt::Display]) {
    warn(warnings.iter().map(|warning| format!("{}: {warning}", path.display())));
}

/// Sets the word that was typed, in which the characters `\n` stand for a line break.
pub(super) fn set_word(scene: &mut Scene, word: &str) {
    scene.set_word(&word.replace("\\n", "\n"));
}

/// Returns the word from the argument or from `--word`. Only a word from `--word` may look like a
/// file name.
///
/// # Errors
///
/// [`Error::Input`] for an argument that is or looks like a file name, because the user may have
/// meant the file's content.
pub(super) fn typed_word<'a>(
    argument: Option<&'a String>,
    flag: Option<&'a String>,
) -> Result<Option<&'a str>> {
    if let (Some(word), None) = (argument, flag) {
        let is_there = Path::new(word).exists() && !Path::new(word).is_dir();
        if is_there || is_file_name(word) {
            let what = if is_there { "the file" } else { "the name of a missing file," };
            return Err(no_word(word, format!("{what} {word}")));
        }
    }
    Ok(flag.or(argument).map(String::as_str))
}

/// Refuses a word that is the name of a folder with the files of a verb, because the user may have
/// meant these.
fn check_folder(word: &str) -> Result<()> {
    let files = if Path::new(word).is_dir() { files_in(word.as_ref())? } else { Vec::new() };
    let ours =
        ["plan", "flight", "scene"].map(|stem| [format!("{stem}.csv"), format!("{stem}.toml")]);
    let mut names = files.iter().map(file_name);
    match names.find(|name| ours.as_flattened().contains(&name.to_lowercase())) {
        Some(name) => Err(no_word(word, format!("the folder {word} with {name}"))),
        None => Ok(()),
    }
}

/// Returns the error for a file or folder name that was typed as a word. `actual` describes it.
fn no_word(word: &str, actual: String) -> Error {
    let hint = format!("`--word {}` writes this word", shell_word(word.as_ref()));
    let wanted = "a word, or a file *.csv if a plan may be named";
    Error::input("word or file", actual, wanted, hint).coded("word-or-file")
}
