//! Flags for reading flights and logs, and for photographing them.

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

/// Limit for files that are read together, enough for sixteen drones and six minutes.
pub(super) const FLIGHTS: Limit = Limit {
    bytes: 384 << 20,
    what: "flights",
    hint: "thin them out, cut them to the time of the picture, or read fewer at a time",
};

/// Flags for reading flights of this program or logs of real flights.
#[derive(Clone, Debug, Args)]
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
    /// Rate of the drone's clock, in its seconds per true second: a number or a fraction [default:
    /// 1, or of µSD logs the rate that their timestamps show, or else the firmware's, 84/85 up to
    /// release 2026.08]
    #[arg(long, value_name = "RATIO", value_parser = ratio)]
    pub(super) clock_ratio: Option<f64>,
    /// Recover the undamaged part of a broken µSD log, instead of refusing it
    #[arg(long)]
    pub(super) recover: bool,
    /// Seconds between two rows of a table without times
    #[arg(long, value_name = "S")]
    pub(super) period: Option<f64>,
    /// Unit of a log's timestamps
    #[arg(long, value_name = "UNIT", default_value = "auto", value_parser = named::<TimeUnit>())]
    pub(super) time_unit: TimeUnit,
    /// Unit of a table's angles whose titles name none
    #[arg(long, value_name = "UNIT", default_value = "auto", value_parser = named::<AngleUnit>())]
    pub(super) angles: AngleUnit,
    /// Axes of a table's world
    #[arg(long, value_name = "AXES", default_value = "auto", value_parser = named::<Axes>())]
    pub(super) axes: Axes,
    /// Speed above which a log is asked about, in m/s: its unit, or its drones
    #[arg(long, value_name = "M_S", default_value_t = ImportOptions::default().max_speed_m_s)]
    pub(super) max_speed: f64,
}

/// Parses a number, or a fraction such as `84/85`.
fn ratio(text: &str) -> std::result::Result<f64, String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let ratio = match text.split_once('/') {
        Some((above, below)) => number(above).zip(number(below)).map(|(a, b)| a / b),
        None => number(text),
    };
    ratio.filter(|r| r.is_finite()).ok_or_else(|| "wanted a number such as 0.988, or 84/85".into())
}

impl FlightFlags {
    /// Options of an import. The scene gives the firmware if the log does not.
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

    /// The same with the log's other warnings.
    pub(super) fn read_log(&self, path: &Path, scene: Option<&Scene>) -> Result<OnClock> {
        let log = logs::import_on_clock(path, &self.options(scene))?;
        warn_of(path, &log.flight.warnings);
        Ok(log)
    }

    /// Flights, logs or light traces that are photographed, one for each drone. A log without
    /// lights gets the lights of the scene's word, or is `lit` throughout.
    pub(super) fn shoot(
        &self,
        mut scene: Scene,
        word: Option<&str>,
        paths: &[PathBuf],
        lit: bool,
    ) -> Result<Shoot> {
        if let Some(word) = word {
            set_word(&mut scene, word);
        }
        // The recordings are checked after each file, before the next one needs memory.
        FLIGHTS.check_all(paths)?;
        let mut recordings = Vec::new();
        for path in paths {
            let options = self.options(Some(&scene));
            let Warned { product: mut recording, warnings } = Recording::read(path, &options)?;
            warn_of(path, &warnings);
            if let Recording::Flight(flight) = &mut recording {
                light_if_dark(flight, &mut scene, path, lit)?.into_iter().for_each(note);
            }
            recordings.push(recording);
            Shoot::check_recordings(&recordings)?;
        }
        Shoot::with_recordings(scene, recordings)
    }
}

/// Prints a note.
pub(super) fn note(text: String) {
    message("note: ", &text);
}

/// Gives a log without lights those of the scene's word, or lights it all along if it is to be
/// `lit`. Returns a note as [`infer_lights_if_dark`] does.
pub(super) fn light_if_dark(
    flight: &mut Flight,
    scene: &mut Scene,
    path: &Path,
    lit: bool,
) -> Result<Option<String>> {
    if lit && flight.lights.is_empty() {
        crate::shoot::light_while_airborne(flight, scene);
        return Ok(None);
    }
    infer_lights_if_dark(flight, scene, path)
}

/// Infers the lights of a log without any from the scene's word. Returns a note if a preset's
/// letters fit the setpoints and the scene's do not.
pub(super) fn infer_lights_if_dark(
    flight: &mut Flight,
    scene: &mut Scene,
    path: &Path,
) -> Result<Option<String>> {
    let preset = crate::shoot::infer_lights_if_dark(flight, scene).map_err(|error| {
        let hint = format!(
            "name the scene whose letters were flown: `noctograph import {} --word {} --scene \
             SCENE.toml`; style even flies strokes in another order, which only a log with \
             lights shows",
            shell_word(path),
            shell_word(scene.word.as_ref()),
        );
        error.with_hint(hint)
    })?;
    Ok(preset.map(|preset| {
        let (path, name) = (path.display(), preset.name());
        let note = "its setpoints are on the letters of";
        let more = format!("which are used; `--scene {name}` has that drone and its lamps, too");
        format!("{path}: {note} {name}, {more}")
    }))
}
