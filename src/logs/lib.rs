//! Logs: readers for logs of real flights.
//!
//! The inputs are logs of exported scripts, JSON of the AE483 course (three dialects), cfclient CSV
//! (a file, or a folder with one file per block), µSD binary (versions 1 and 2), plain tables (t,
//! x, y, z …), range CSV and flight files of this program. Folders of gym-pybullet-drones are also
//! read. Tables may come from Motive, Vicon, rosbag, `PlotJuggler`, `EuRoC`, TUM or PX4. The output
//! is a [`Flight`].
//!
//! The format is recognized from the contents (`format`), and the reader for that format creates a
//! recording, which consists of blocks of named columns, each with a time axis. The function
//! `flight` then converts the recording to a flight in several steps, whose order is explained
//! there. All conversions of variables are in `source_tables`.
//!
//! - **Truth** of position and attitude: motion capture, then the custom observer, then the
//!   firmware's estimator, then raw Lighthouse fixes, or a chosen [`PositionSource`]. For any
//!   quantity, a source that diverged, or is frozen while others change, is skipped with a warning.
//!   `estimate_m` comes from the custom observer, or else from the firmware.
//! - **Time axis**: [`ImportOptions::sample_rate_hz`] over the time for which position and attitude
//!   are known, with linear interpolation. Longer gaps have no samples and are listed in `gaps`.
//!   Other measured quantities are held over gaps in their log, with a warning. Setpoints, motor
//!   commands and unknown columns are always held.
//! - **Unknown columns** are kept in the flight's `extra`, in the log's units, with a warning.
//! - None of these logs contains letters or lights, except for columns `light.<channel>` of CSV.
//! - A flight file of this program is read unchanged, except with [`PositionSource::Estimate`].
//! - **Guesses** (unit of times and angles, axes, frame of a motion capture system) are reported as
//!   warnings with the reason, and can be overridden by [`ImportOptions`]. If two alternatives fit,
//!   there is an error.
//!
//! Not done: positions from ranges, more than one drone in a file, and Vicon rotations.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

pub mod identify;

use std::path::Path;

use noctograph_core::crazyflie::Release;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Budget, Limit};
use noctograph_core::flight::table::Table;
use noctograph_core::flight::{Flight, Quantity};
use noctograph_core::settings::{Described, settings};

mod arrays;
mod bullet_folder;
mod cells;
mod cfclient_csv;
mod clock;
mod firmware;
mod format;
mod frames;
mod gathered;
mod half_precision;
mod json_log;
mod json_text;
mod mapper;
mod mocap;
mod mocap_csv;
mod plain_csv;
mod recording;
mod rows;
mod script_lines;
mod source_tables;
mod sources;
mod speed;
mod subjects;
#[cfg(test)]
mod tests;
mod titles;
mod usd;

pub use arrays::doubts;
use format::Format;
pub use gathered::{GatheredLog, is_one_log, logs_in, scene_in, word_in};
use recording::Recording;
pub use script_lines::GrowingLog;

/// Maximum size of a log, enough for ten minutes of 200 columns at 100 Hz.
const LIMIT: Limit = Limit { bytes: 128 << 20, what: "a log", hint: HINT };

/// Advice for a log that is too large.
const HINT: &str = "cut the log to one flight, or log fewer variables";

/// Maximum number of variables in a log. The firmware logs 128 at a time.
const MAX_VARIABLES: usize = 1024;

settings! {
    /// Options of an import.
    pub struct ImportOptions {
        /// Sample rate of the flight. The Crazyflie's position loops run at 100 Hz. A lower rate
        /// smooths oscillations of the strokes.
        sample_rate_hz: f64 = 100.0, in 1.0..=1000.0;
        /// Maximum gap over which the position is interpolated (or two and a half periods of a
        /// slower log). For the attitude it is four times as long. The error is `a T² / 8`: 3 mm, a
        /// lamp's width, at 0.25 s and the 0.4 m/s² of the reference flight. A lower limit leaves
        /// many gaps in a radio log (a third of that flight at 0.1 s).
        max_gap_s: f64 = 0.25, in 0.001..=3600.0;
        /// Source of the true position, and of the attitude if that source provides one.
        position: PositionSource = PositionSource::Best;
        /// Firmware release if the log names none. The default is the scene's `vehicle.firmware`.
        firmware: Option<Release> = None;
        /// Seconds of the drone's clock per true second. The default is 1. For a µSD log it is the
        /// rate that the timestamps show, or else that of the release: 84/85 up to 2026.08.
        clock_ratio: Option<f64> = None, in 0.5..=2.0;
        /// Treatment of a µSD log whose CRC does not match.
        damaged: Damaged = Damaged::Refuse;
        /// Time between two rows of a table without times.
        period_s: Option<f64> = None, in 1e-5..=10.0;
        /// Unit of the timestamps in a table or in JSON.
        time_unit: TimeUnit = TimeUnit::Auto;
        /// Unit of the angles and angular velocities in a table whose titles give none.
        angle_unit: AngleUnit = AngleUnit::Auto;
        /// Axes of the world frame of a table.
        axes: Axes = Axes::Auto;
        /// Maximum speed. A faster position is assumed to be in a wrong unit, from another drone,
        /// or wrongly timestamped. A Crazyflie falls no faster than 10 m/s.
        max_speed_m_s: f64 = 15.0, in 0.1..=1000.0;
    }

    /// Unit of timestamps.
    pub enum TimeUnit {
        /// From the title, or else from the steps, because a drone is logged every 0.1 ms to 2.55
        /// s.
        "auto" => Auto,
        /// Seconds.
        "s" => Seconds,
        /// Milliseconds.
        "ms" => Milliseconds,
        /// Microseconds.
        "us" => Microseconds,
        /// Nanoseconds.
        "ns" => Nanoseconds,
        /// Minutes.
        "min" => Minutes,
        /// Hours.
        "h" => Hours,
        /// Days, as counted by spreadsheets.
        "d" => Days,
    }

    /// Unit of angles.
    pub enum AngleUnit {
        /// From the title, or else radians, or degrees if radians would be implausible for a drone.
        "auto" => Auto,
        /// Radians.
        "rad" => Radians,
        /// Degrees.
        "deg" => Degrees,
    }

    /// Axes of a world frame.
    pub enum Axes {
        /// Axes of the format, or else z up, or the only axis along which a take-off is possible.
        "auto" => Auto,
        /// z up.
        "z-up" => ZUp,
        /// x forward, y right, z down, as north, east and down.
        "z-down" => ZDown,
        /// y up, z toward the viewer, as is usual in motion capture.
        "y-up" => YUp,
    }

    /// Source of the true position.
    pub enum PositionSource {
        /// First of the following sources that is logged and does not stand still while others
        /// move.
        "best" => Best,
        /// Motion capture.
        ///
        /// From its own block, its echo in the drone's log, or `locSrv`. The position of a plain
        /// table is the next choice.
        "mocap" => Mocap,
        /// The observer of the AE483 course.
        ///
        /// From `ae483log.o_x` or `ae483log.p_x`.
        "custom" => Custom,
        /// The estimator of the firmware.
        ///
        /// From `stateEstimate`, `stateEstimateZ` or `kalman`.
        "firmware" => Firmware,
        /// Raw position fixes of the Lighthouse.
        ///
        /// From `lighthouse` or `ae483log.lh_x`.
        "lighthouse" => Lighthouse,
        /// Estimate that the drone used in flight: custom, or else firmware, or that of a flight
        /// file.
        "estimate" => Estimate,
    }

    /// Treatment of a log that is damaged, not merely truncated.
    pub enum Damaged {
        /// A damaged log is an error.
        "refuse" => Refuse,
        /// The part before the damage is read, with a warning.
        "recover" => Recover,
    }
}

/// Imports the log of a real flight: a file, a folder with the cfclient files of one connection, or
/// a folder of gym-pybullet-drones with one file per variable.
///
/// # Errors
///
/// Returns [`Error::Io`] if the log cannot be read. Returns [`Error::Input`] with the line or byte
/// of an error in the log, for unknown formats and columns, and for options out of range.
pub fn import(path: &Path, options: &ImportOptions) -> Result<Flight> {
    Ok(import_on_clock(path, options)?.flight)
}

/// A flight, and the zero of its log's clock.
#[derive(Clone, Debug, PartialEq)]
pub struct OnClock {
    /// Imported flight. Its times begin at zero, unless it was read from a flight file.
    pub flight: Flight,
    /// Log time that became zero, s, if other logs may use the same clock: a date, a time of day,
    /// or times in a plain CSV file. `None` for an imported log, and for times counted by the
    /// firmware since the drone was switched on.
    pub zero_stamp_s: Option<f64>,
    /// Name of the drone's firmware, if the log states it.
    pub firmware: Option<String>,
}

/// Imports a log as [`import`] does, and keeps the zero of its clock.
///
/// # Errors
///
/// Returns the errors of [`import`].
pub fn import_on_clock(path: &Path, options: &ImportOptions) -> Result<OnClock> {
    options.check("import", None)?;
    let file = path.display().to_string();
    if !path.is_dir() {
        return on_clock(&read(path)?, &file, options);
    }
    let budget = Budget::new(&file, HINT);
    let job = Job { file: &file, options, budget: &budget };
    // A folder is recognized by its file names.
    let recording = match bullet_folder::variables(path)? {
        Some(variables) => bullet_folder::read(&variables, job)?,
        None => cfclient_csv::read_folder(path, job)?,
    };
    flight(recording, job)
}

/// Reads the bytes of a log file. A file of more than 128 MiB is an error.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    LIMIT.read(path)
}

/// Imports a log from its bytes. `file` is the file name to show in messages.
pub fn import_bytes(bytes: &[u8], file: &str, options: &ImportOptions) -> Result<Flight> {
    options.check("import", None)?;
    Ok(on_clock(bytes, file, options)?.flight)
}

/// Recognizes the format of a log, and reads it with the corresponding reader. `file` names the log
/// in errors.
fn on_clock(bytes: &[u8], file: &str, options: &ImportOptions) -> Result<OnClock> {
    let budget = Budget::new(file, HINT);
    let job = Job { file, options, budget: &budget };
    let format = Format::recognized(bytes, file)?;
    budget.bytes(bytes.len())?;
    // A flight file skips all of the steps that recordings require.
    let recording = match format {
        Format::Card => usd::read(bytes, job)?,
        Format::Json(text) if script_lines::is_lines(&text.bytes) => {
            script_lines::read(&text.bytes, job)?
        }
        Format::Json(text) => json_log::read(&text, job)?,
        Format::Cfclient(text, head) => cfclient_csv::read(&text, head, job)?,
        Format::Table(text, head, captured) => plain_csv::read(&text, head, captured, job)?,
        Format::Flight(text, head) => {
            let mut flight = Flight::from_table(&Table::below(head, &text, file, |_| true)?)?;
            if options.position == PositionSource::Estimate {
                use_estimate(&mut flight);
            }
            return Ok(OnClock { flight, zero_stamp_s: Some(0.0), firmware: None });
        }
    };
    flight(recording, job)
}

/// Replaces the position in a flight with the drone's own estimate of it.
fn use_estimate(flight: &mut Flight) {
    flight.edit(|flight| {
        for sample in &mut flight.samples {
            sample.position_m = sample.estimate_m;
        }
        if flight.unlogged.contains(&Quantity::Estimate) {
            flight.unlogged.insert(Quantity::Position);
        } else {
            flight.unlogged.remove(&Quantity::Position);
        }
    });
}

/// Inputs of a reader besides the bytes: the file name to show in messages, options, work budget.
#[derive(Clone, Copy)]
struct Job<'a> {
    file: &'a str,
    options: &'a ImportOptions,
    budget: &'a Budget,
}

/// Converts a recording to a flight. Each step depends on the previous steps. Returns the errors of
/// [`import`].
fn flight(recording: Recording, Job { options, budget, .. }: Job<'_>) -> Result<OnClock> {
    recording.check(budget)?;
    // From here on, columns are looked up by name.
    let mut recording = recording.with_different_names();
    recording.warnings.extend(firmware::doubt(&recording, options.firmware));
    // The next steps compare neighboring samples, and require increasing times in true seconds.
    let recording = clock::repaired(recording, options)?;
    // To the subsequent steps, values that lost a carry would look like jumps.
    let recording = half_precision::restored(recording);
    // The motion capture is compared with the drone's path in a common frame with z up.
    let recording = frames::with_z_up(recording, options)?;
    let mut recording = mocap::aligned(recording);
    // Blocks that were removed do not cause a warning.
    recording.warn_of_empty_cells();
    // Variables become quantities, and all quantities become samples on one time axis.
    mapper::flight(recording, options, budget)
}

/// Returns the error for a file of unknown format, whose content is described in words.
fn unknown(file: &str, content: impl std::fmt::Display) -> Error {
    Error::input(
        file,
        content,
        "a log: AE483 JSON, cfclient CSV, a µSD log (first byte 0xBC), plain CSV (t, x, y, z …), \
         range CSV",
        "convert the log to CSV with a header t,x,y,z,yaw,pitch,roll",
    )
}

impl TimeUnit {
    /// Returns the unit in seconds, or `None` if it has to be inferred.
    fn seconds(self) -> Option<f64> {
        match self {
            Self::Auto => None,
            Self::Seconds => Some(1.0),
            Self::Milliseconds => Some(1e-3),
            Self::Microseconds => Some(1e-6),
            Self::Nanoseconds => Some(1e-9),
            Self::Minutes => Some(60.0),
            Self::Hours => Some(cells::HOUR_S),
            Self::Days => Some(cells::DAY_S),
        }
    }
}
