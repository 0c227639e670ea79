//! Logs: readers of real flights.
//!
//! File in: JSON of the AE483 course (three dialects), CSV of cfclient (a file, or the folder with
//! one file a block), µSD binary (versions 1 and 2), plain tables (t, x, y, z …) also of Motive,
//! Vicon, rosbag, `PlotJuggler`, `EuRoC`, TUM and PX4, range CSV, or a flight file of ours; or the
//! folder of gym-pybullet-drones. Product out: [`Flight`]. The format is recognized from the
//! content, not from the file's name.
//!
//! Method: the reader of the format makes a recording (blocks of named columns, each with its own
//! time axis); time stamps are repaired and the motion capture's clock is aligned with the drone's;
//! variables become quantities in SI units, our frames and our signs (`sources` holds all
//! conversions); everything is resampled to one time axis.
//!
//! - **Truth** of position and attitude: motion capture, then the custom observer, then the
//!   firmware's estimator, then raw Lighthouse fixes; [`PositionSource`] selects another. A source
//!   that is frozen while others change, or diverged, is skipped, for any quantity. A quantity that
//!   is frozen while the drone moves counts as not logged. Both are warnings.
//!   `estimate_m` is the custom observer, else the firmware's.
//! - **Time axis**: [`ImportOptions::sample_rate_hz`] over the time in which position and attitude
//!   are known, interpolated linearly. Longer gaps have no samples: they are listed in the flight's
//!   `gaps`. Other measured quantities are held over gaps of their own (with a warning); setpoints,
//!   motor commands and unknown columns are always held.
//! - **In-flight part**: nothing is cut away; [`noctograph_core::flight::airborne`] finds it.
//! - **Unknown columns** stay in the flight's `extra`, in the units of the log.
//! - Letters are in none of these logs (`letter` is `None`), nor are lights: only a CSV file may
//!   have columns `light.<channel>`.
//! - A flight file of ours ([`Flight::read_csv`]) is read as it is; of the options,
//!   [`PositionSource::Estimate`] alone applies.
//!
//! - **Guesses** (unit of stamps and angles, axes, frame of a motion capture) are warnings with
//!   their reason, can be overridden by [`ImportOptions`], and are errors where two fit. Unknown
//!   columns are named.
//!
//! Not done: positions from ranges, more than one drone in a file, rotations of Vicon.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

pub mod identify;

use std::path::Path;

use noctograph_core::crazyflie::Release;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Budget, Head, Limit, Text, entries_in, file_name};
use noctograph_core::flight::table::Table;
use noctograph_core::flight::{Flight, Quantity};
use noctograph_core::settings::{Described, settings};

mod ae483_json;
mod arrays;
mod bullet_folder;
mod cells;
mod cfclient_csv;
mod clock;
mod firmware;
mod foreign;
mod frames;
mod gathered;
mod half_precision;
mod json_tree;
mod mapper;
mod mocap;
mod mocap_csv;
mod plain_csv;
mod recording;
mod rows;
mod sources;
mod speed;
mod subjects;
#[cfg(test)]
mod tests;
mod titles;
mod usd;

pub use arrays::doubts;
pub use gathered::{GatheredLog, is_one_log, logs_in, scene_in};
use recording::Recording;

/// Largest log that is read: ten minutes of 200 columns at 100 Hz.
const LIMIT: Limit = Limit { bytes: 128 << 20, what: "a log", hint: HINT };

/// Advice for a log that is too large.
const HINT: &str = "cut the log to one flight, or log fewer variables";

/// Most variables of a log; the firmware logs 128 at a time.
const MAX_VARIABLES: usize = 1024;

/// First columns of our own flight files.
const OWN: [&str; 5] = ["time_s", "x_m", "y_m", "z_m", "yaw_rad"];

settings! {
    /// Options of an import.
    pub struct ImportOptions {
        /// Sample rate of the flight. The Crazyflie's position loops run at 100 Hz; less smooths
        /// the oscillations of strokes.
        sample_rate_hz: f64 = 100.0, in 1.0..=1000.0;
        /// Longest gap over which the position is interpolated (or two and a half periods of a
        /// slower log); the attitude is over four times as much. The error is `a T² / 8`: 3 mm, a
        /// lamp's width, at 0.25 s and the 0.4 m/s² of the reference flight. A lower limit leaves
        /// many gaps in a radio log (a third of that flight at 0.1 s).
        max_gap_s: f64 = 0.25, in 0.001..=3600.0;
        /// Source of the true position, and of the attitude where that source has one.
        position: PositionSource = PositionSource::Best;
        /// Release of the drone's firmware where the log names none, as the scene has it
        /// (`vehicle.firmware`).
        firmware: Option<Release> = None;
        /// Seconds of the drone's clock per true second. By default 1; of a µSD log what its
        /// stamps show, else what the release has: 84/85 up to and with 2026.08.
        clock_ratio: Option<f64> = None, in 0.5..=2.0;
        /// Treatment of a µSD log whose CRC does not match.
        damaged: Damaged = Damaged::Refuse;
        /// Time between two rows of a table without times.
        period_s: Option<f64> = None, in 1e-5..=10.0;
        /// Unit of the stamps of a table or of JSON.
        time_unit: TimeUnit = TimeUnit::Auto;
        /// Unit of the angles and angular velocities of a table whose titles name none.
        angle_unit: AngleUnit = AngleUnit::Auto;
        /// Axes of a table's world.
        axes: Axes = Axes::Auto;
        /// Speed above which a position is taken for one in another unit, of another drone, or on
        /// wrong stamps. A Crazyflie falls no faster than 10 m/s.
        max_speed_m_s: f64 = 15.0, in 0.1..=1000.0;
    }

    /// Unit of stamps.
    pub enum TimeUnit {
        /// From the title; else from the steps, since a drone is logged every 0.1 ms to 2.55 s.
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
        /// Days, as spreadsheets count them.
        "d" => Days,
    }

    /// Unit of angles.
    pub enum AngleUnit {
        /// From the title; else radians, or degrees where radians would be implausible for a drone.
        "auto" => Auto,
        /// Radians.
        "rad" => Radians,
        /// Degrees.
        "deg" => Degrees,
    }

    /// Axes of a world.
    pub enum Axes {
        /// Those of the format; else z up, or the only axis along which the drone can have taken
        /// off.
        "auto" => Auto,
        /// z up.
        "z-up" => ZUp,
        /// x forward, y right, z down, as north, east and down.
        "z-down" => ZDown,
        /// y up, z toward the viewer, as motion captures have it.
        "y-up" => YUp,
    }

    /// Source of the true position.
    pub enum PositionSource {
        /// The first of the following that is logged and not frozen while others move.
        "best" => Best,
        /// Motion capture.
        ///
        /// Its own block, its echo in the drone's log, or `locSrv`. A plain table's position comes
        /// after it.
        "mocap" => Mocap,
        /// The observer of the AE483 course.
        ///
        /// `ae483log.o_x` or `ae483log.p_x`.
        "custom" => Custom,
        /// The estimator of the firmware.
        ///
        /// `stateEstimate`, `stateEstimateZ` or `kalman`.
        "firmware" => Firmware,
        /// Raw fixes of the Lighthouse.
        ///
        /// `lighthouse` or `ae483log.lh_x`.
        "lighthouse" => Lighthouse,
        /// The estimate in flight: custom, else firmware, or that of a flight file.
        "estimate" => Estimate,
    }

    /// Treatment of a log that is damaged, not merely cut off.
    pub enum Damaged {
        /// It is an error.
        "refuse" => Refuse,
        /// The part before the damage is read, with a warning.
        "recover" => Recover,
    }
}

/// Imports the log of a real flight: a file, or a folder with cfclient's files of one connection or
/// with a file for each variable of gym-pybullet-drones.
///
/// # Errors
///
/// [`Error::Io`] where it cannot be read; [`Error::Input`] with line or byte where it is broken,
/// for unknown formats and columns, and for options out of range.
pub fn import(path: &Path, options: &ImportOptions) -> Result<Flight> {
    Ok(import_on_clock(path, options)?.flight)
}

/// A flight, and the clock that its log was stamped with.
#[derive(Clone, Debug, PartialEq)]
pub struct OnClock {
    /// The flight; its times begin at zero, or are those of a flight file.
    pub flight: Flight,
    /// Stamp of its time zero, s, on a clock that other logs may share: a date, a time of day, or
    /// the numbers of a plain CSV file. `None` where the log has a clock of its own: the firmware's
    /// counter since the drone was switched on, or an imported log, whose zero is lost.
    pub zero_stamp_s: Option<f64>,
    /// The drone's firmware, where the log names it.
    pub firmware: Option<String>,
}

/// Imports a log as [`import`] does, and keeps the zero of its clock.
///
/// # Errors
///
/// As [`import`].
pub fn import_on_clock(path: &Path, options: &ImportOptions) -> Result<OnClock> {
    options.check("import", None)?;
    let name = path.display().to_string();
    if path.is_dir() {
        let budget = Budget::new(&name, HINT);
        let job = Job { file: &name, options, budget: &budget };
        let recording = match bullet_folder::variables(path)? {
            Some(variables) => bullet_folder::recording(&variables, job)?,
            None => folder(path, job)?,
        };
        return flight(recording, options, &budget);
    }
    on_clock(&read(path)?, &name, options)
}

/// Reads a log's file.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    LIMIT.read(path)
}

/// Imports a log from its bytes; `file` is its name in messages.
pub fn import_bytes(bytes: &[u8], file: &str, options: &ImportOptions) -> Result<Flight> {
    options.check("import", None)?;
    Ok(on_clock(bytes, file, options)?.flight)
}

fn on_clock(bytes: &[u8], file: &str, options: &ImportOptions) -> Result<OnClock> {
    foreign::refuse(bytes, file)?;
    let budget = Budget::new(file, HINT);
    let job = Job { file, options, budget: &budget };
    if bytes.first() == Some(&usd::MAGIC) {
        budget.bytes(bytes.len())?;
        return flight(usd::read(bytes, job)?, options, &budget);
    }
    let text = Text::decode(bytes);
    let first = text.bytes.trim_ascii_start().first();
    if matches!(first, Some(b'{' | b'[')) {
        budget.bytes(bytes.len())?;
        return flight(ae483_json::read(&text, job)?, options, &budget);
    }
    if let Some((head, captured)) = mocap_csv::capture(&text.bytes, file)? {
        budget.bytes(bytes.len())?;
        return flight(plain_csv::read(&text, head, Some(captured), job)?, options, &budget);
    }
    let head = Head::find(&text.bytes);
    let has_letters = head.has(OWN[0]) && head.has("letter");
    let has_ranges = head.titles.iter().any(|title| title.starts_with("ranging."));
    let is_first = head.titles.first().is_some_and(|title| title == OWN[0]);
    // A flight file begins with a pose, or with the time and has the column of letters.
    if head.titles.starts_with(&OWN.map(str::to_owned)) || is_first && has_letters && !has_ranges {
        let mut flight = Flight::from_table(&Table::below(head, &text, file, |_| true)?)?;
        if options.position == PositionSource::Estimate {
            use_estimate(&mut flight);
        }
        return Ok(OnClock { flight, zero_stamp_s: Some(0.0), firmware: None });
    }
    if first.is_none() {
        return Err(unknown(file, "an empty file"));
    }
    let mut titles = head.titles.iter();
    let is_binary = titles.any(|title| title.contains(|c: char| c.is_control() || c == '\u{fffd}'));
    if head.n_columns < 2 || is_binary {
        let content = text.bytes.trim_ascii_start();
        let start = String::from_utf8_lossy(&content[..content.len().min(24)]);
        return Err(unknown(file, format_args!("a file that begins with {start:?}")));
    }
    budget.bytes(bytes.len())?;
    let recording = match cfclient_csv::is_its_own(&head) {
        true => cfclient_csv::read(&text, head, job)?,
        false => plain_csv::read(&text, head, None, job)?,
    };
    let mut on_clock = flight(recording, options, &budget)?;
    // A flight file with ranges is an imported log, whose clock is lost.
    if has_letters && has_ranges {
        on_clock.zero_stamp_s = None;
    }
    Ok(on_clock)
}

/// Replaces the position of a flight by its estimate.
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

/// Inputs of a reader beside the bytes: the log's name in messages, options, and the work budget.
#[derive(Clone, Copy)]
struct Job<'a> {
    file: &'a str,
    options: &'a ImportOptions,
    budget: &'a Budget,
}

/// Makes a recording a flight.
fn flight(mut recording: Recording, options: &ImportOptions, budget: &Budget) -> Result<OnClock> {
    recording.check(budget)?;
    // An event without a record does not take the names of its variables.
    recording.blocks.retain(|block| !block.time_s.is_empty());
    recording.name_apart();
    recording.warnings.extend(firmware::doubt(&recording, options.firmware));
    clock::repair_stamps(&mut recording, options)?;
    half_precision::restore(&mut recording);
    frames::resolve_axes(&mut recording, options)?;
    mocap::align(&mut recording);
    recording.warn_of_empty_cells();
    let (is_stamped, firmware) = (recording.is_stamped, recording.firmware.take());
    let (flight, zero_s) = mapper::flight(recording, options, budget)?;
    Ok(OnClock { flight, zero_stamp_s: is_stamped.then_some(zero_s), firmware })
}

/// The error for a file of no known log format.
fn unknown(file: &str, content: impl std::fmt::Display) -> Error {
    Error::input(
        file,
        content,
        "a log: AE483 JSON, CSV of cfclient, a µSD log (first byte 0xBC), plain CSV (t, x, y, z …), \
         range CSV",
        "convert the log to CSV with a header t,x,y,z,yaw,pitch,roll",
    )
}

/// The CSV files of a folder that are cfclient's, in the order of their names, as one recording.
fn folder(path: &Path, job: Job<'_>) -> Result<Recording> {
    let Job { budget, .. } = job;
    let mut all = Recording::new(job.file);
    let (files, others) =
        entries_in(path)?.into_iter().partition::<Vec<_>, _>(|path| path.is_file());
    let mut others: Vec<String> = others.iter().map(file_name).collect();
    for path in &files {
        if !cfclient_csv::may_be_its_own(path) {
            others.push(file_name(path));
            continue;
        }
        let bytes = read(path)?;
        budget.steps(bytes.len())?;
        budget.bytes(bytes.len())?;
        let text = Text::decode(&bytes);
        let head = Head::find(&text.bytes);
        if cfclient_csv::is_its_own(&head) {
            let file = path.display().to_string();
            let one = cfclient_csv::read(&text, head, Job { file: &file, ..job })?;
            all.warnings.extend(one.warnings.iter().map(|warning| format!("{file}: {warning}")));
            all.blocks.extend(one.blocks);
            all.firmware = all.firmware.or(one.firmware);
            all.wrap_s = one.wrap_s;
            // The limit is for all files together.
            all.check_variables()?;
        } else {
            others.push(file_name(path));
        }
        budget.free(bytes.len() as u64);
    }
    if all.blocks.is_empty() {
        let content = "a folder without a CSV file of cfclient (Timestamp,group.name …)";
        return Err(unknown(job.file, content));
    }
    if !others.is_empty() {
        let others = others.join(", ");
        all.warnings.push(format!("not read, as they are no files of cfclient's: {others}"));
    }
    Ok(all)
}

impl TimeUnit {
    /// Its seconds; `None` where they are to be inferred.
    fn seconds(self) -> Option<f64> {
        match self {
            Self::Auto => None,
            Self::Seconds => Some(1.0),
            Self::Milliseconds => Some(1e-3),
            Self::Microseconds => Some(1e-6),
            Self::Nanoseconds => Some(1e-9),
            Self::Minutes => Some(60.0),
            Self::Hours => Some(3600.0),
            Self::Days => Some(cells::DAY_S),
        }
    }
}
