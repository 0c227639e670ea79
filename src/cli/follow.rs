//! `expose --follow` photographs growing logs, and reads each letter when it is complete.
//!
//! 1. The samples that scripts have appended to their logs so far are read.
//! 2. The new light is added to the photo, at most twice a second and with at most a quarter of a
//!    processor core.
//! 3. With a plan, the photo is read whenever a letter is complete.
//! 4. The loop ends when all logs contain their end marks. The last photo shows the complete logs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::terminal::message;
use crate::error::{Error, Result};
use crate::flight::Flight;
use crate::logs::GrowingLog;
use crate::plan::Plan;
use crate::preflight::check_written;
use crate::scene::Scene;
use crate::score::{Reader, Verdict, View};
use crate::shoot::Shot;
use crate::tracking::on_plan_s;

/// Interval at which the logs are polled.
const LOOK: Duration = Duration::from_millis(50);
/// Shortest interval from one photo to the next.
const PERIOD: Duration = Duration::from_millis(500);
/// Shortest interval from one photo to the next, as a multiple of the time that a photo takes.
const PERIODS_OF_WORK: u32 = 4;
/// Time in s from the last setpoint of a letter until its light is complete. The light is late
/// because the radio delays the commands of the lamps.
const AFTER_LETTER_S: f64 = 0.3;

/// Waits until scripts have created their logs and written the headers, and returns the logs.
/// Prints a note about each log that is missing.
pub(super) fn begun(paths: &[PathBuf]) -> Result<Vec<GrowingLog>> {
    let mut logs = Vec::new();
    for path in paths {
        if !path.exists() {
            message("note: ", &format!("waiting for {}", path.display()));
        }
        // A script creates its log when its drone is ready to fly.
        while !path.exists() {
            std::thread::sleep(LOOK);
        }
        let mut log = GrowingLog::open(path)?;
        while !log.has_begun() {
            log.grow()?;
            std::thread::sleep(LOOK);
        }
        logs.push(log);
    }
    Ok(logs)
}

/// Reads logs while they grow, and passes them to `frame` at the intervals of [`PERIOD`] and
/// [`PERIODS_OF_WORK`] if they have grown. Errors of `frame` are printed as notes. Returns the
/// result of the last call, which receives the complete logs.
pub(super) fn follow<T>(
    mut logs: Vec<GrowingLog>,
    mut frame: impl FnMut(&[GrowingLog]) -> Result<T>,
) -> Result<T> {
    let (mut next, mut has_grown, mut why) = (Instant::now(), true, String::new());
    loop {
        for log in &mut logs {
            has_grown |= log.grow()?;
        }
        let has_ended = logs.iter().all(GrowingLog::has_ended);
        if has_ended || (has_grown && Instant::now() >= next) {
            let start = Instant::now();
            match frame(&logs) {
                product if has_ended => return product,
                // The logs may still be too short. A reason is printed only when it changes.
                Err(error) if error.to_string() != why => {
                    why = error.to_string();
                    message("note: ", &format!("no photo yet: {why}"));
                }
                _ => {}
            }
            next = start + PERIOD.max(PERIODS_OF_WORK * start.elapsed());
            has_grown = false;
        }
        std::thread::sleep(LOOK);
    }
}

/// Letters of a plan, each of which is read when it is complete.
pub(super) struct Letters {
    reader: Reader,
    plan: Plan,
    /// Index of each letter, and the time of its last setpoint in the plan in s, sorted by time.
    ends_s: Vec<(usize, f64)>,
    n_told: usize,
}

impl Letters {
    /// Reads a plan, which must write the scene's word, for the single log that is followed.
    /// Returns [`Error::Input`] for several logs or another word.
    pub(super) fn new(path: &Path, scene: &Scene, n_logs: usize) -> Result<Self> {
        if n_logs > 1 {
            let hint = "omit the plan, or follow the log of a single drone";
            return Err(Error::input("plan", format!("{n_logs} logs"), "one log", hint));
        }
        let (plan, strokes) = (Plan::read_csv(path)?, scene.strokes()?);
        check_written(&plan, &strokes).map_err(|error| error.in_file(path.display(), None))?;
        // Later setpoints of a letter overwrite the time of earlier ones.
        let mut ends_s = BTreeMap::new();
        for setpoint in &plan.setpoints {
            if let Some(letter) = setpoint.letter {
                ends_s.insert(letter, setpoint.time_s);
            }
        }
        let mut ends_s = Vec::from_iter(ends_s);
        ends_s.sort_by(|a, b| a.1.total_cmp(&b.1));
        let reader = Reader::new(&strokes, &scene.score)?;
        Ok(Self { reader, plan, ends_s, n_told: 0 })
    }

    /// Reads the photo if letters were completed since the last call, and prints a message for each
    /// of them.
    pub(super) fn tell(&mut self, shot: &Shot) -> Result<()> {
        let n_complete = self.n_complete(&shot.flights[0]);
        if n_complete <= self.n_told {
            return Ok(());
        }
        // Several letters may have been completed since the last photo.
        let verdict = self.read(shot)?;
        let so_far: String =
            verdict.letters.iter().take(n_complete).filter_map(|l| l.best).collect();
        for (letter, _) in &self.ends_s[self.n_told..n_complete] {
            let Some(letter) = verdict.letters.get(*letter) else { continue };
            let best = letter.best.map_or("nothing".to_owned(), String::from);
            let p = letter.p.unwrap_or(0.0);
            let text = format!("reads as {best}, probability {p:.2}; so far {so_far}");
            message(&format!("{}: ", letter.expected), &text);
        }
        self.n_told = n_complete;
        Ok(())
    }

    /// Returns the number of letters whose last setpoint is at least [`AFTER_LETTER_S`] ago at the
    /// last sample of a flight. Returns 0 if the flight does not show yet where it is in the plan.
    fn n_complete(&self, flight: &Flight) -> usize {
        let Some(on_plan_s) = on_plan_s(flight, &self.plan) else { return 0 };
        let last_s = flight.samples.last().map_or(0.0, |sample| sample.time_s);
        let plan_s = last_s + on_plan_s - AFTER_LETTER_S;
        self.ends_s.iter().take_while(|(_, end_s)| *end_s <= plan_s).count()
    }

    /// Returns the verdict on the photo, in the view of its camera.
    pub(super) fn read(&self, shot: &Shot) -> Result<Verdict> {
        self.reader.score(&shot.photo, &View::from(&shot.camera))
    }
}
