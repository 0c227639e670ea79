//! Flags for reading and photographing flights and logs.

use std::path::{Path, PathBuf};

use super::flags::{set_word, warn_of};
use super::names::named;
use super::outcome::shell_word;
use super::terminal::message;
use crate::diagnostic::Warned;
use crate::error::Result;
use crate::flight::Flight;
use crate::logs::{
    self, AngleUnit, Axes, Damaged, ImportOptions, OnClock, PositionSource, TimeUnit,
};
use crate::scene::Scene;
use crate::shoot::{Recording, Shoot};
use clap::Args;
use noctograph_core::files::Limit;

/// Limit on the total size of files that are read together, which is enough for six minutes of
/// flight by sixteen drones.
pub(super) const FLIGHTS: Limit = Limit {
    bytes: 384 << 20,
    what: "flights",
    hint: "reduce the sample rate, cut logs to the time of the picture, or read fewer logs",
};

/// Flags for reading this program's flights or logs of real flights.
#[derive(Clone, Debug, Args)]
pub(super) struct FlightFlags {
    /// Source of a log's position (and attitude) that is treated as the true one
    #[arg(long, value_name = "SOURCE", default_value = "best", value_parser = named::<PositionSource>())]
    pub(super) position: PositionSource,
    /// Longest gap in a log that is bridged by interpolation, in seconds
    #[arg(long, value_name = "S", default_value_t = ImportOptions::default().max_gap_s)]
    pub(super) max_gap: f64,
    /// Sample rate of the flight made from a log, in Hz
    #[arg(long, value_name = "HZ", default_value_t = ImportOptions::default().sample_rate_hz)]
    pub(super) rate: f64,
    /// Rate of the drone's clock, in clock seconds per true second, as a number or a fraction
    /// [default: 1, or for µSD logs the rate inferred from their timestamps, or else that of the
    /// firmware, 84/85 up to release 2026.08]
    #[arg(long, value_name = "RATIO", value_parser = ratio)]
    pub(super) clock_ratio: Option<f64>,
    /// Recover the undamaged part of a corrupt µSD log instead of refusing the log
    #[arg(long)]
    pub(super) recover: bool,
    /// Seconds between two rows of a table without times
    #[arg(long, value_name = "S")]
    pub(super) period: Option<f64>,
    /// Unit of a log's timestamps
    #[arg(long, value_name = "UNIT", default_value = "auto", value_parser = named::<TimeUnit>())]
    pub(super) time_unit: TimeUnit,
    /// Unit of the angles in a table whose column titles contain no unit
    #[arg(long, value_name = "UNIT", default_value = "auto", value_parser = named::<AngleUnit>())]
    pub(super) angles: AngleUnit,
    /// World axes of a table
    #[arg(long, value_name = "AXES", default_value = "auto", value_parser = named::<Axes>())]
    pub(super) axes: Axes,
    /// Speed, in m/s, above which a log is refused, because its unit may be wrong, or it may
    /// contain several drones
    #[arg(long, value_name = "M_S", default_value_t = ImportOptions::default().max_speed_m_s)]
    pub(super) max_speed: f64,
}

/// Parses a clock ratio, which is a number or a fraction such as `84/85`. Returns a message for
/// other texts.
fn ratio(text: &str) -> std::result::Result<f64, String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let ratio = match text.split_once('/') {
        Some((above, below)) => number(above).zip(number(below)).map(|(a, b)| a / b),
        None => number(text),
    };
    ratio.filter(|r| r.is_finite()).ok_or_else(|| "wanted a number such as 0.988, or 84/85".into())
}

impl FlightFlags {
    /// Returns the options of an import, with the scene's firmware for logs that name none.
    pub(super) fn options(&self, scene: Option<&Scene>) -> ImportOptions {
        ImportOptions {
            firmware: scene.map(|scene| scene.vehicle.firmware),
            position: self.position,
            max_gap_s: self.max_gap,
            sample_rate_hz: self.rate,
            clock_ratio: self.clock_ratio,
            damaged: if self.recover { Damaged::Recover } else { Damaged::Refuse },
            period_s: self.period,
            time_unit: self.time_unit,
            angle_unit: self.angles,
            axes: self.axes,
            max_speed_m_s: self.max_speed,
        }
    }

    /// Reads a flight or a log, and prints its warnings.
    pub(super) fn read(&self, path: &Path, scene: Option<&Scene>) -> Result<Flight> {
        Ok(self.read_log(path, scene)?.flight)
    }

    /// Reads a flight or a log like [`read`](Self::read), and prints its warnings. Returns it with
    /// its clock and firmware.
    pub(super) fn read_log(&self, path: &Path, scene: Option<&Scene>) -> Result<OnClock> {
        let log = logs::import_on_clock(path, &self.options(scene))?;
        warn_of(path, &log.flight.warnings);
        Ok(log)
    }

    /// Reads flights, logs or light traces, one for each drone, and prints their warnings. Returns
    /// their shoot. `lights` applies to logs that contain no lights. `word`, if any, replaces the
    /// word of the scene.
    pub(super) fn shoot(
        &self,
        mut scene: Scene,
        word: Option<&str>,
        paths: &[PathBuf],
        lights: LogLights,
    ) -> Result<Shoot> {
        if let Some(word) = word {
            set_word(&mut scene, word);
        }
        // The total number of samples is checked before each further file is read.
        FLIGHTS.check_all(paths)?;
        let mut recordings = Vec::new();
        for path in paths {
            let options = self.options(Some(&scene));
            let Warned { product: mut recording, warnings } = Recording::read(path, &options)?;
            warn_of(path, &warnings);
            if let Recording::Flight(flight) = &mut recording {
                light_if_dark(flight, &mut scene, path, lights)?.into_iter().for_each(note);
            }
            recordings.push(recording);
            Shoot::check_recordings(&recordings)?;
        }
        Shoot::with_recordings(scene, recordings)
    }
}

/// Lights that a log without lights is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LogLights {
    /// The lights of the scene's word, inferred from the log's setpoints.
    Inferred,
    /// All lamps lit from take-off to landing.
    AlwaysOn,
}

/// Prints a note.
pub(super) fn note(text: String) {
    message("note: ", &text);
}

/// Sets the lights of a log without lights as `lights` says. Returns the note of
/// [`infer_lights_if_dark`], if any.
pub(super) fn light_if_dark(
    flight: &mut Flight,
    scene: &mut Scene,
    path: &Path,
    lights: LogLights,
) -> Result<Option<String>> {
    if lights == LogLights::Inferred {
        return infer_lights_if_dark(flight, scene, path);
    }
    if flight.lights.is_empty() {
        crate::shoot::light_while_airborne(flight, scene);
    }
    Ok(None)
}

/// Infers the lights of a log without lights from the scene's word. If the setpoints match a
/// preset's letters instead of the scene's, changes the scene to these letters and returns a note.
pub(super) fn infer_lights_if_dark(
    flight: &mut Flight,
    scene: &mut Scene,
    path: &Path,
) -> Result<Option<String>> {
    let preset = crate::shoot::infer_lights_if_dark(flight, scene).map_err(|error| {
        let hint = format!(
            "name the scene whose letters were flown: `noctograph import {} --word {} --scene \
             SCENE.toml`; in the even style, the strokes have another order, which only a log with \
             light commands shows",
            shell_word(path),
            shell_word(scene.word.as_ref()),
        );
        error.with_hint(hint)
    })?;
    Ok(preset.map(|preset| {
        let (path, name) = (path.display(), preset.name());
        let note = "its setpoints follow the letters of";
        let more = format!("which are used; `--scene {name}` also selects the drone and its lamps");
        format!("{path}: {note} {name}, {more}")
    }))
}
