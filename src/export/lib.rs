//! Export: converts plans to files for drones and other programs.
//!
//! The input is [`Plan`]s with the lamps, the controller and the camera of their scene, and the
//! output is [`File`]s. Each format's module uses SI units and radians until it writes the numbers.
//!
//! An onboard trajectory runs from a run-up before the first letter to a run-out after the last
//! one. Scripts upload it together with take-off, the path to the run-up, and a landing. Other
//! files contain only the letters. [`flown`] is such a flight's plan, decoded from the exported
//! data.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

use serde_json::Value;

use noctograph_core::camera::Camera;
use noctograph_core::crazyflie::{Release, TRAJECTORY_MEMORY_BYTES};
use noctograph_core::error::{Error, Result, is_device};
use noctograph_core::lamps::LightOptions;
use noctograph_core::parallel;
use noctograph_core::settings::settings;
use noctograph_plan::Plan;
use noctograph_sim::SimOptions;
use unicode_normalization::UnicodeNormalization;

mod cflib;
pub mod compressed;
mod crazyswarm;
mod gains;
pub mod lights;
mod log_config;
mod on_board;
mod pieces;
pub mod poly4d;
pub mod safety;
mod skybrush;
#[cfg(test)]
mod tests;
mod timeline;
mod vviz;
pub mod zip;

pub use cflib::Mode;
pub use on_board::{Form, Length, check_memory, flown};
use safety::Checks;
use timeline::{earliest_s, zero_s};

settings! {
    /// Format of exported files.
    pub enum Format {
        /// Python script for cflib, which flies, switches the lights and records the log.
        "cflib" => Cflib,
        /// Compressed trajectory of the Crazyflie (bytes).
        "compressed" => Compressed,
        /// Polynomial trajectory of the Crazyflie (bytes).
        "poly4d" => Poly4d,
        /// Trajectories, crazyflies.yaml and a script for Crazyswarm2.
        "crazyswarm2" => Crazyswarm2,
        /// Skybrush show, including the photographer's camera.
        "skyc" => Skyc,
        /// Show for viewers of drone shows.
        "vviz" => Vviz,
        /// Gains of the controller, as firmware parameters (JSON) or as a table in C.
        "gains" => Gains,
        /// Log configurations for cfclient and the µSD card.
        "log-config" => LogConfig,
    }
}

/// Plans to export, and the scene's options that affect the files.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// Plans, one for each drone.
    pub plans: &'a [Plan],
    /// Flights of the exported trajectories ([`flown`]), with lights timed for them. Empty if the
    /// format has no trajectory ([`Format::trajectory`]) or if the trajectories do not fit.
    pub flown: &'a [Plan],
    /// Reason not to fly the exported plans, to be quoted in scripts.
    pub unsafe_because: Option<&'a str>,
    /// The word, for names and titles.
    pub word: &'a str,
    /// Lamps of the drones.
    pub light: &'a LightOptions,
    /// Options of the drone and its controller.
    pub sim: &'a SimOptions,
    /// Camera of the photographer.
    pub camera: &'a Camera,
    /// Maximum distance of a trajectory from the design, m.
    pub tolerance_m: f64,
    /// Mode of the cflib script if the operator chooses none.
    pub mode: Mode,
    /// Names of other modes that the script must refuse, with reasons.
    pub refused: &'a [(&'static str, String)],
    /// Rate of the clock that paces the plans (`plan.trajectory_clock`).
    pub trajectory_clock: f64,
    /// Facts on which the checks of the flights are based.
    pub checks: &'a Checks,
}

impl Format {
    /// Returns the form and the allowed length of the trajectory in this format's files. Returns
    /// `None` if the files send setpoints or do not fly a drone.
    pub fn trajectory(self, mode: Mode) -> Option<(Form, Length)> {
        match self {
            Self::Cflib if mode != Mode::Trajectory => None,
            Self::Cflib | Self::Compressed => Some((Form::Compressed, Length::OnBoard)),
            Self::Poly4d | Self::Crazyswarm2 => Some((Form::Poly4d, Length::OnBoard)),
            Self::Skyc | Self::Vviz => Some((Form::Compressed, Length::Any)),
            Self::Gains | Self::LogConfig => None,
        }
    }

    /// Returns a note on what the files cannot be used for, or `None` if that is obvious.
    pub fn note(self) -> Option<&'static str> {
        match self {
            Self::Skyc => Some(
                "for viewers only: lights and positions use one clock in true seconds, and colors \
                 are screen colors. The show cannot drive the lamps of a Crazyflie: Skybrush's \
                 light program supports neither headlights nor the color LED deck, and a \
                 trajectory on board is 1.2 % slow up to firmware 2026.08. Fly the script for \
                 cflib.",
            ),
            Self::Vviz => Some(
                "for viewers only: the show flies no drone and drives no lamp. Lights and \
                 positions use one clock, and colors are screen colors.",
            ),
            _ => None,
        }
    }

    /// True if the files of this format fly a drone.
    pub fn flies(self) -> bool {
        !matches!(self, Self::Gains | Self::LogConfig)
    }

    /// True if files contain only the letters, beginning and ending in the air.
    pub fn stays_in_the_air(self) -> bool {
        matches!(self, Self::Compressed | Self::Poly4d)
    }
}

impl Job<'_> {
    /// Returns a drone's number in file names, counted from 1, or an empty text for a single drone.
    fn number_suffix(&self, drone: usize) -> String {
        if self.plans.len() > 1 { format!("-{}", drone + 1) } else { String::new() }
    }

    /// Returns the light commands of a drone that flies a trajectory, timed in s by its plan's
    /// clock.
    fn trajectory_lights(&self, drone: usize) -> Result<Vec<lights::Command>> {
        let Some(flown) = self.flown.get(drone) else {
            return lights::commands(&self.plans[drone], self.light);
        };
        let mut commands = lights::commands(flown, self.light)?;
        let zero_s = zero_s(earliest_s(self.plans)?);
        commands.iter_mut().for_each(|command| command.time_s += zero_s);
        Ok(commands)
    }
}

/// Returns JSON text with all non-ASCII characters escaped. The operator reads the script, and a
/// user's word may contain characters that are invisible or reverse the line (U+202E).
fn ascii(json: &Value) -> String {
    // JSON escapes UTF-16 code units, of which each character has one or two.
    let mut units = [0; 2];
    let mut text = String::new();
    for c in json.to_string().chars() {
        if c.is_ascii() && c != '\x7f' {
            text.push(c)
        } else {
            text.extend(c.encode_utf16(&mut units).iter().map(|u| format!("\\u{u:04x}")))
        }
    }
    text
}

/// Inserts the reason not to fly a script as a comment below its first line. Returns a script that
/// is safe to fly unchanged.
fn with_caution(job: &Job<'_>, script: String) -> String {
    let Some(reason) = job.unsafe_because else { return script };
    let (first, rest) = script.split_once('\n').expect("a script has lines");
    format!("{first}\n# EXPORTED UNCHECKED, NOT SAFE TO FLY: {}\n{rest}", visible(reason))
}

/// Returns a string with control characters replaced by blanks, and invisible ones escaped.
fn visible(text: &str) -> String {
    let mut output = String::new();
    for c in text.chars() {
        match c {
            _ if c.is_control() => output.push(' '),
            _ if c.is_ascii() || c.is_alphanumeric() => output.push(c),
            // Rust escapes characters that are not printable.
            _ if c.escape_debug().len() == 1 => output.push(c),
            _ => output.extend(c.escape_unicode()),
        }
    }
    output
}

/// An exported file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File {
    /// Name of the file without a folder.
    pub name: String,
    /// Contents of the file.
    pub bytes: Vec<u8>,
}

impl File {
    /// Creates a text file.
    fn new(name: impl Into<String>, text: String) -> Self {
        Self { name: name.into(), bytes: text.into_bytes() }
    }
}

/// Returns the files of a format: one per drone, or one for all drones.
///
/// # Errors
///
/// Returns [`noctograph_core::error::Error::Input`] for plans without letters, and for lamps that
/// the format does not support. Returns [`noctograph_core::error::Error::Infeasible`] for plans
/// that do not fit the format.
pub fn export(format: Format, job: &Job<'_>) -> Result<Vec<File>> {
    let shows = matches!(format, Format::Skyc | Format::Vviz);
    assert!(!shows || job.flown.len() == job.plans.len(), "shows are of flown trajectories");
    let release = job.sim.vehicle.firmware;
    match format {
        Format::Cflib => scripts(job),
        // The page exports scripts only, and its module is smaller without the other formats.
        _ if cfg!(target_family = "wasm") => {
            let hint = "export it with the command line";
            Err(Error::input("the format", format.name(), "cflib", hint))
        }
        Format::Compressed => per_drone(job, "traj", |_, plan| {
            Ok(compressed::Compressed::encode(release, plan, job.tolerance_m)?.to_bytes())
        }),
        Format::Poly4d => per_drone(job, "poly4d", |_, plan| {
            Ok(poly4d::Poly4d::fit(release, plan, job.tolerance_m)?.to_bytes())
        }),
        Format::Crazyswarm2 => crazyswarm::files(job),
        Format::Skyc => Ok(vec![skybrush::show(job)?]),
        Format::Vviz => Ok(vec![vviz::show(job)?]),
        Format::Gains => gains::files(job.sim),
        Format::LogConfig => Ok(log_config::files()),
    }
}

/// Returns the heights above the floor at which a plan's letter trajectory begins and ends, m.
///
/// # Errors
///
/// Returns the errors of [`export`].
pub fn end_heights_m(plan: &Plan) -> Result<[f64; 2]> {
    let stretch = pieces::Stretch::new(plan)?;
    Ok([0, stretch.last()].map(|index| stretch.setpoints[index].position_m.z))
}

/// Onboard trajectory memory that a plan requires, and the formats that can fly the plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Memory {
    /// Number of bytes as a compressed trajectory, out of [`TRAJECTORY_MEMORY_BYTES`].
    pub bytes: usize,
    /// True if the release can fly the heading of a compressed trajectory.
    pub flies_heading: bool,
    /// Number of pieces as polynomials, out of [`poly4d::MAX_PIECES`].
    pub pieces: usize,
    /// Names of the formats into which the plan fits. A trajectory must fit in the onboard memory,
    /// and a script's setpoints must not be too frequent for the radio.
    pub formats: Vec<&'static str>,
    /// True if the plan fits into all formats.
    pub fits_all: bool,
}

/// Returns the trajectory memory that a plan requires, in bytes and pieces, and the formats in
/// which a release flies it.
///
/// # Errors
///
/// Returns the errors of [`compressed::Compressed::encode`], except those about length and heading.
pub fn memory(release: Release, plan: &Plan) -> Result<Memory> {
    let flies_heading = compressed::flies_heading(release, plan.yaw_rad);
    let (stretch, tolerance_m) = (pieces::Stretch::new(plan)?, Form::Compressed.tolerance_m());
    let (compressed, polynomials) = parallel::join(
        || compressed::Compressed::of_any_length(&stretch, tolerance_m),
        || poly4d::Poly4d::fit_any_length(plan, Form::Poly4d.tolerance_m()),
    );
    let (bytes, pieces) = (compressed?.to_bytes().len(), polynomials?.pieces.len());
    let fits_by_format = [
        (Format::Compressed, flies_heading && bytes <= TRAJECTORY_MEMORY_BYTES),
        (Format::Poly4d, pieces <= poly4d::MAX_PIECES),
        (Format::Cflib, cflib::fits_the_radio(plan)),
    ];
    let fitting = fits_by_format.into_iter().filter(|(_, fits)| *fits);
    let formats: Vec<_> = fitting.map(|(format, _)| format.name()).collect();
    let fits_all = formats.len() == fits_by_format.len();
    Ok(Memory { bytes, flies_heading, pieces, formats, fits_all })
}

/// Returns a cflib script for each drone, and a launcher if there are several.
fn scripts(job: &Job<'_>) -> Result<Vec<File>> {
    let first_start_s = earliest_s(job.plans)?;
    let script = |drone, _: &Plan| Ok(cflib::script(job, drone, first_start_s)?.into_bytes());
    let mut files = per_drone(job, "py", script)?;
    if files.len() > 1 {
        let names: Vec<String> = files.iter().map(|file| file.name.clone()).collect();
        let launcher = cflib::launcher(job, &names);
        files.push(File::new(format!("fly_{}.py", stem(job.word)), launcher));
    }
    Ok(files)
}

/// Letters without a canonical decomposition, each followed by its ASCII spelling. These are all of
/// the shipped fonts.
const SPELLED: &str = "ŁL łl ØO øo ĐD đd ıi ßss ẞSS ÆAE æae ŒOE œoe ÞTh ªa ºo ſs ŉn ĲIJ ĳij ĿL ŀl \
    ¼14 ½12 ¾34 ⁰0 ¹1 ²2 ³3 ⁴4 ⁵5 ⁶6 ⁷7 ⁸8 ⁹9";
/// Maximum number of characters in a file name before its extension.
const MAX_STEM: usize = 32;

/// Returns the file name for a word, without an extension. The name consists of the word's letters
/// and digits in ASCII, without accents. A word that contains none yields `drawing`.
pub fn stem(word: &str) -> String {
    let mut stem = String::new();
    for letter in decomposed(word) {
        match SPELLED.split(' ').find_map(|pair| pair.strip_prefix(letter)) {
            Some(spelling) => stem += spelling,
            None if letter.is_ascii_alphanumeric() => stem.push(letter),
            None => {}
        }
    }
    stem.truncate(MAX_STEM);
    match &*stem {
        "" => "drawing".to_owned(),
        device if is_device(device) => stem + "_",
        _ => stem,
    }
}

/// Returns the characters of a word with accents separated from their letters (NFKD).
#[cfg(not(target_family = "wasm"))]
fn decomposed(word: &str) -> impl Iterator<Item = char> {
    word.nfkd()
}

/// Returns the characters of a word with accents separated from their letters (NFD). In a page,
/// words have only the letters of shipped fonts, for which [`SPELLED`] replaces NFKD's tables.
#[cfg(target_family = "wasm")]
fn decomposed(word: &str) -> impl Iterator<Item = char> {
    word.nfd()
}

/// Returns one file per drone. `encode` returns its bytes for the drone's index and plan. The name
/// contains the drone's number if there are several drones.
fn per_drone(
    job: &Job<'_>,
    extension: &str,
    encode: impl Fn(usize, &Plan) -> Result<Vec<u8>>,
) -> Result<Vec<File>> {
    let files = job.plans.iter().enumerate().map(|(drone, plan)| {
        let name = format!("{}{}.{extension}", stem(job.word), job.number_suffix(drone));
        Ok(File { name, bytes: encode(drone, plan)? })
    });
    files.collect()
}

/// Returns the maximum distance between a format's trajectories and the planned paths, m, or `None`
/// if the format has no trajectories.
///
/// # Errors
///
/// Returns the errors of [`export`].
pub fn deviation_m(format: Format, job: &Job<'_>) -> Result<Option<f64>> {
    let Some((form, _)) = format.trajectory(job.mode) else { return Ok(None) };
    let release = job.sim.vehicle.firmware;
    let deviations_m = job.plans.iter().map(|plan| -> Result<f64> {
        let pieces = on_board::pieces(release, plan, form, job.tolerance_m, Length::Any)?;
        Ok(pieces::Stretch::new(plan)?.worst_m(&pieces))
    });
    let deviations_m = deviations_m.collect::<Result<Vec<f64>>>()?;
    Ok(Some(deviations_m.into_iter().fold(0.0, f64::max)))
}

#[cfg(test)]
mod format_tests {
    use super::*;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::{PlanOptions, plan};

    #[test]
    fn the_memory_names_the_forms_that_hold_a_word() {
        fn memory_of(word: &str) -> Memory {
            let strokes = write(word, &LetterOptions::default()).unwrap();
            let plan = plan(&strokes, &PlanOptions::even()).unwrap();
            memory(Release::MODELED, &plan).unwrap()
        }
        let short = memory_of("NO");
        assert_eq!(
            (&short.formats[..], short.fits_all),
            (&["compressed", "poly4d", "cflib"][..], true)
        );
        let long = memory_of(&"NOCTOGRAPH".repeat(2));
        assert_eq!((&long.formats[..], long.fits_all), (&["compressed", "cflib"][..], false));
        assert!(long.pieces > poly4d::MAX_PIECES && long.bytes <= TRAJECTORY_MEMORY_BYTES);
    }

    #[test]
    fn every_format_flies_a_trajectory_or_says_that_it_does_not() {
        use Format::{Cflib, Compressed, Crazyswarm2, Gains, LogConfig, Poly4d, Skyc, Vviz};
        let all = [Cflib, Compressed, Poly4d, Crazyswarm2, Skyc, Vviz, Gains, LogConfig];
        assert_eq!(Format::ALL, all, "a new one is said here");
        fn formats(is: fn(Format) -> bool) -> Vec<Format> {
            Format::ALL.iter().copied().filter(|format| is(*format)).collect()
        }
        let within_mm: Vec<f64> = Form::ALL.iter().map(|form| 1e3 * form.tolerance_m()).collect();
        assert_eq!(within_mm, [2.0, 5.0]);
        assert_eq!(formats(|format| !format.flies()), [Gains, LogConfig]);
        assert_eq!(formats(Format::stays_in_the_air), [Compressed, Poly4d]);
        assert_eq!(formats(|format| format.note().is_some()), [Skyc, Vviz]);
        assert_eq!(
            formats(|format| format.trajectory(Mode::Position).is_none()),
            [Cflib, Gains, LogConfig]
        );
        assert_eq!(
            formats(|format| format.trajectory(Mode::Trajectory).is_none()),
            [Gains, LogConfig]
        );
    }

    #[test]
    fn a_comment_shows_what_is_in_it() {
        assert_eq!(visible("0.2 m/s², 10°, Ünï"), "0.2 m/s², 10°, Ünï");
        assert_eq!(visible("A\u{202e}B\u{2028}C\u{ad}"), "A\\u{202e}B\\u{2028}C\\u{ad}");
    }
}
