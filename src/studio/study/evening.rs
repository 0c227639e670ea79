//! Evening: what the logs of an evening's flights say of drones and air, and the conditions
//! ([`super::Conditions`]) that these make.
//!
//! In: a folder of logs, and the scene's drone, of which a log does not tell the mass. Out: a row
//! for each log, with its figures and what speaks against it, and the widths of conditions as they
//! were found. Each log is identified by itself ([`identify`]); of its figures the thrust per
//! command is that over the weight, so that a heavy drone and a weak one are the same.
//!
//! Not found: distortion of the Lighthouse and turn of its frame, which take a second source of
//! position; inertia; delay of the lamps; charge and age of the battery.

use std::collections::HashMap;
use std::fmt;
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use super::conditions::ROOM_GUST_M_S;
use crate::preflight::MAX_SATURATED_S;
use crate::scene::Scene;
use noctograph_core::error::Result;
use noctograph_core::files::Limit;
use noctograph_core::flight::{Flight, Quantity, Warning, airborne, saturated_s};
use noctograph_core::settings::Described;
use noctograph_flying::vehicle::GustOptions;
use noctograph_logs::identify::{Assumed, RotorLag, T_95, identify, is_frozen};
use noctograph_logs::{GatheredLog, ImportOptions, import, logs_in};

/// Least sample rate of a log as a flight: a command that is shown 5 ms late looks like a lag that
/// is 20 ms shorter.
const LEAST_RATE_HZ: f64 = 500.0;
/// Shortest flight that is used: the trim's error falls with its root.
const LEAST_AIR_S: f64 = 10.0;
/// Largest share of a flight of which the log knows nothing.
const MOST_UNKNOWN: f64 = 0.1;
/// Least gusts of a log: the quietest sensor's noise is more.
const LEAST_GUST_M_S: f64 = 1e-6;
/// Flights from which a spread is taken.
const LEAST_FLIGHTS: usize = 3;
/// Logs of an evening: thirty flights of ten minutes with fifty variables at 100 Hz.
const LOGS: Limit = Limit {
    bytes: 512 << 20,
    what: "the logs of an evening",
    hint: "import a part of the folder at a time, or log fewer variables",
};
/// Logs that are read at once: each may take 240 MiB of its
/// [`Budget`](noctograph_core::files::Budget).
const AT_ONCE: usize = 3;
/// Time from one outage of the radio to the next, as conditions have it.
const OUTAGE_EVERY_S: f64 = super::conditions::OUTAGE_EVERY_S;

/// The logs of a folder.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evening {
    /// One for each flight, in the order of the drones' names and of their own: 2 before 10.
    pub logs: Vec<EveningLog>,
}

/// A log, and what it says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EveningLog {
    /// Its drone's name.
    pub drone: String,
    /// Its path within the folder.
    pub log: String,
    /// What speaks against it; a sound one has none.
    pub flaws: Vec<Flaw>,
    /// What it says of its drone; `None` where it says nothing.
    pub figures: Option<LogFigures>,
    /// What was guessed, mended or left out as it was read.
    pub warnings: Vec<String>,
}

/// What speaks against a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Flaw {
    /// It is the file of this other log: a link to it, or a name of the same.
    Again(String),
    /// It cannot be read, for this reason.
    Unreadable(String),
    /// It has no motor commands, or is of the floor: for this reason nothing is identified.
    Silent(String),
    /// It is in the air for so many seconds only.
    Short(f64),
    /// It knows nothing of this share of the flight.
    Gaps(f64),
    /// A motor was at its limit for so many seconds.
    Saturated(f64),
    /// Nothing turns the drone: its rows are one repeated.
    Frozen,
}

impl fmt::Display for Flaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Again(log) => write!(f, "the same file as {log}"),
            Self::Unreadable(why) => write!(f, "unreadable: {why}"),
            Self::Silent(why) => write!(f, "no figures: {why}"),
            Self::Short(air_s) => write!(f, "only {air_s:.1} s in the air"),
            Self::Gaps(share) => write!(f, "gaps: {:.0} % of the flight unknown", 100.0 * share),
            Self::Frozen => write!(f, "frozen: its rows repeat one"),
            Self::Saturated(s) => write!(f, "a motor at its limit for {s:.1} s"),
        }
    }
}

/// What a log says of its drone and its air.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LogFigures {
    /// Time in the air.
    pub air_s: f64,
    /// Longest time of which nothing is known.
    pub longest_gap_s: f64,
    /// Thrust per command and weight, as a share of the scene's.
    pub thrust_frac: f64,
    /// Center of mass in body x and y.
    pub trim_m: [f64; 2],
    /// Its standard deviation by uneven air; `None` for a flight too short.
    pub trim_sigma_m: Option<[f64; 2]>,
    /// Lag of the rotors; `None` where the log does not show it.
    pub lag_s: Option<f64>,
    /// Its standard deviation.
    pub lag_sigma_s: Option<f64>,
    /// Gusts that turn a drone as its air did, σ; `None` for a flight too short.
    pub gust_m_s: Option<f64>,
}

/// A width of the conditions that was found, with what it was found from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundCondition {
    /// Key of [`super::Conditions`].
    pub key: &'static str,
    /// Its value.
    pub value: f64,
    /// From what.
    pub from: String,
}

/// Mean of the sound flights' figures, which a scene of these drones has.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanDrone {
    /// Thrust of a motor per unit of its command, with the scene's mass.
    pub k_f_n: f64,
    /// Center of mass in body x and y.
    pub center_of_mass_m: [f64; 2],
    /// Lag of the rotors; `None` where no log shows it.
    pub lag_s: Option<f64>,
}

impl Evening {
    /// Reads and identifies the logs of a folder ([`logs_in`]). `done` is told how many are.
    ///
    /// # Errors
    ///
    /// Those of [`logs_in`] and of options out of range. A log that cannot be read is a row.
    pub fn import(
        folder: &Path,
        options: &ImportOptions,
        scene: &Scene,
        done: &(dyn Fn(usize) + Sync),
    ) -> Result<Self> {
        options.check("import", None)?;
        let sample_rate_hz = options.sample_rate_hz.max(LEAST_RATE_HZ);
        let options = &ImportOptions { sample_rate_hz, ..options.clone() };
        let counted = std::sync::atomic::AtomicUsize::new(0);
        let logs = logs_in(folder)?;
        LOGS.check_all(logs.iter().map(|log| &log.path))?;
        // A file that links lead to again is no other flight, and is read once.
        let mut firsts = HashMap::new();
        for log in logs.iter().rev() {
            firsts.extend(log.path.canonicalize().map(|file| (file, log.name.as_str())));
        }
        let first = |log: &GatheredLog| firsts.get(&log.path.canonicalize().ok()?).copied();
        let row = |log: &GatheredLog| {
            let row = match first(log).filter(|first| *first != log.name) {
                Some(first) => EveningLog::flawed(log, Flaw::Again(first.to_owned())),
                None => EveningLog::new(log, import(&log.path, options), scene),
            };
            done(1 + counted.fetch_add(1, std::sync::atomic::Ordering::Relaxed));
            row
        };
        let at_once = logs.chunks(AT_ONCE);
        let rows = at_once.flat_map(|logs| logs.par_iter().map(row).collect::<Vec<_>>());
        let mut logs: Vec<EveningLog> = rows.collect();
        logs.sort_by_cached_key(|log| [natural(&log.drone), natural(&log.log)]);
        Ok(Self { logs })
    }

    /// The drones with their logs.
    #[must_use]
    pub fn drones(&self) -> Vec<(&str, &[EveningLog])> {
        let drones = self.logs.chunk_by(|a, b| a.drone == b.drone);
        drones.map(|logs| (&logs[0].drone[..], logs)).collect()
    }

    /// Figures of the sound flights.
    pub fn sound(&self) -> impl Iterator<Item = &LogFigures> {
        self.logs.iter().filter(|log| log.flaws.is_empty()).filter_map(|log| log.figures.as_ref())
    }

    /// The mean of the sound flights; `None` where there are none.
    #[must_use]
    pub fn mean_drone(&self, scene: &Scene) -> Option<MeanDrone> {
        let mean = |of: &dyn Fn(&LogFigures) -> Option<f64>| mean(self.sound().filter_map(of));
        Some(MeanDrone {
            k_f_n: scene.vehicle.k_f_n * mean(&|f| Some(f.thrust_frac))?,
            center_of_mass_m: [mean(&|f| Some(f.trim_m[0]))?, mean(&|f| Some(f.trim_m[1]))?],
            lag_s: mean(&|f| f.lag_s),
        })
    }

    /// The widths of conditions that the sound flights show, about their own mean; what they do not
    /// show is a room's. In the order of a conditions file.
    #[must_use]
    pub fn conditions(&self) -> Vec<FoundCondition> {
        let figures: Vec<&LogFigures> = self.sound().collect();
        let mut conditions = Vec::new();
        let mut add = |key, value: Option<f64>, from: String| {
            conditions.extend(value.map(|value| FoundCondition { key, value, from }));
        };
        let n = figures.len();
        let enough = n >= LEAST_FLIGHTS;
        let thrust = || spread(figures.iter().map(|f| (f.thrust_frac, 0.0)));
        add("mass_frac", enough.then(thrust), format!("thrust over weight, {n} flights"));
        let trim = || {
            let axis =
                |axis: usize| {
                    spread(figures.iter().map(|f| {
                        (f.trim_m[axis], f.trim_sigma_m.map_or(0.0, |sigma_m| sigma_m[axis]))
                    }))
                };
            libm::hypot(axis(0), axis(1)) / std::f64::consts::SQRT_2
        };
        let from = format!("trim beyond what gusts explain, {n} flights");
        add("center_of_mass_m", enough.then(trim), from);
        let lags_s: Vec<(f64, f64)> =
            figures.iter().filter_map(|f| Some((f.lag_s?, f.lag_sigma_s?))).collect();
        // The spread of a uniform number is its largest over the root of twelve. The mean is no
        // use: it has the errors that all logs of an evening share.
        let lag_s = || 12_f64.sqrt() * spread(lags_s.iter().copied());
        let from = format!("spread of the rotors' lag, {} flights", lags_s.len());
        add("motor_lag_s", (lags_s.len() >= LEAST_FLIGHTS).then(lag_s), from);
        let gusts: Vec<f64> = figures.iter().filter_map(|f| f.gust_m_s).collect();
        let gust = mean(gusts.iter().map(|gust| gust * gust)).map(f64::sqrt);
        add("gust_m_s", gust, format!("torque of uneven air, {} flights", gusts.len()));
        let outages_s = figures.iter().filter(|f| f.longest_gap_s > 0.0).map(|f| {
            // The longest of n exponential times is 1 + 1/2 + … + 1/n times their mean.
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "at least 1"
            )]
            let n = (f.air_s / OUTAGE_EVERY_S).round().max(1.0) as u32;
            f.longest_gap_s / (1..=n).map(|k| 1.0 / f64::from(k)).sum::<f64>()
        });
        let outage_s = mean(outages_s);
        add("radio_outage_s", outage_s, "longest gaps, of one in 10 s".into());
        conditions
    }

    /// A conditions file (TOML) with what was found.
    #[must_use]
    pub fn conditions_toml(&self, found: &[FoundCondition]) -> String {
        let (n, drones) = (self.sound().count(), self.drones().len());
        let mut toml = format!(
            "# Conditions of {n} sound flights of {} by {drones} drone(s). Keys that are left out are a\n\
             # room's: rank, robustness and preview --spread take this file as --conditions.\n",
            self.logs.len()
        );
        for FoundCondition { key, value, from } in found {
            toml += &format!("{key} = {value:.3e}  # {from}\n");
        }
        toml
    }
}

impl EveningLog {
    fn flawed(log: &GatheredLog, flaw: Flaw) -> Self {
        let (drone, log) = (log.drone.clone(), log.name.clone());
        Self { drone, log, flaws: vec![flaw], figures: None, warnings: Vec::new() }
    }

    fn new(log: &GatheredLog, flight: Result<Flight>, scene: &Scene) -> Self {
        let read = flight.as_ref().map_or(&[][..], |flight| &flight.warnings);
        // Figures need the motors and the body's rates: what else is not logged is not missed.
        let read = read.iter().filter(|warning| !matches!(warning, Warning::Unlogged(_)));
        let warnings: Vec<String> = read.map(ToString::to_string).collect();
        let row = |flaws, figures| Self {
            drone: log.drone.clone(),
            log: log.name.clone(),
            flaws,
            figures,
            warnings: warnings.clone(),
        };
        let flight = match flight {
            Ok(flight) => flight,
            Err(error) => return Self::flawed(log, Flaw::Unreadable(error.to_string())),
        };
        let air = airborne(&flight).unwrap_or_default();
        let has_motors = !flight.unlogged.contains(&Quantity::Motors);
        if has_motors && !air.is_empty() && is_frozen(&flight.samples[air.clone()]) {
            return row(vec![Flaw::Frozen], None);
        }
        let mut figures = match figures(&flight, scene) {
            Ok(figures) => figures,
            Err(error) => return row(vec![Flaw::Silent(error.to_string())], None),
        };
        let samples = &flight.samples[air];
        let [from_s, to_s] = [samples[0].time_s, samples[samples.len() - 1].time_s];
        let within = flight.gaps.iter().filter(|gap| from_s <= gap[0] && gap[1] <= to_s);
        let lengths_s: Vec<f64> = within.map(|gap| gap[1] - gap[0]).collect();
        figures.longest_gap_s = lengths_s.iter().copied().fold(0.0, f64::max);
        let unknown = lengths_s.iter().sum::<f64>() / figures.air_s;
        let saturated_s = saturated_s(samples, scene.vehicle.motor_max);
        let flaws = [
            (figures.air_s < LEAST_AIR_S).then_some(Flaw::Short(figures.air_s)),
            (unknown > MOST_UNKNOWN).then_some(Flaw::Gaps(unknown)),
            (saturated_s > MAX_SATURATED_S).then_some(Flaw::Saturated(saturated_s)),
            figures.gust_m_s.is_some_and(|gust| gust < LEAST_GUST_M_S).then_some(Flaw::Frozen),
        ];
        let mut row = row(flaws.into_iter().flatten().collect(), Some(figures));
        if !samples.windows(2).any(|pair| pair[0].design_m.xy() != pair[1].design_m.xy()) {
            row.warnings.push(
                "its setpoints stay at one place, or are not logged: it does not show the rotors' \
                 lag"
                .into(),
            );
        }
        row
    }
}

fn figures(flight: &Flight, scene: &Scene) -> Result<LogFigures> {
    let vehicle = &scene.vehicle;
    let identified = identify(flight, &Assumed::of(vehicle))?;
    let air = airborne(flight).unwrap_or_default();
    let lag = identified.lag.filter(RotorLag::is_identifiable);
    let weight_n = identified.k_f_n * identified.mean_motors.iter().sum::<f64>();
    let room = GustOptions::default().torque_sigma_n_m;
    let gust = identified.air.map(|air| {
        let share = |axis: usize| air.torque_sigma_n_m[axis] / room[axis];
        ROOM_GUST_M_S * 0.5 * (share(0) + share(1))
    });
    Ok(LogFigures {
        air_s: flight.samples[air.end - 1].time_s - flight.samples[air.start].time_s,
        longest_gap_s: 0.0,
        thrust_frac: identified.k_f_n / vehicle.k_f_n,
        trim_m: identified.center_of_mass_m,
        // A torque about y is a center of mass off in x, and the other way around.
        trim_sigma_m: identified
            .air
            .map(|air| [1, 0].map(|axis: usize| air.mean_sigma_n_m[axis] / weight_n)),
        lag_s: lag.map(|lag| lag.lag_s),
        lag_sigma_s: lag.map(|lag| lag.half_width_s / T_95),
        gust_m_s: gust,
    })
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0));
    (n > 0.0).then(|| sum / n)
}

/// Standard deviation of values beyond that which each one has by itself.
fn spread(values: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let Some(middle) = mean(values.clone().map(|(value, _)| value)) else { return 0.0 };
    let squares = values.map(|(value, own)| {
        let off = value - middle;
        [1.0, off * off, own * own]
    });
    let [n, square, own] = squares.fold([0.0; 3], |sum, part| [0, 1, 2].map(|k| sum[k] + part[k]));
    (square / (n - 1.0) - own / n).max(0.0).sqrt()
}

/// What puts names in the order of the numbers in them: numbers, then other characters; the name
/// itself last.
fn natural(name: &str) -> (Vec<(bool, u64)>, String) {
    let mut parts: Vec<(bool, u64)> = Vec::new();
    for c in name.chars() {
        match (c.to_digit(10).map(u64::from), parts.last_mut()) {
            (Some(digit), Some((false, number))) => {
                *number = number.saturating_mul(10).saturating_add(digit);
            }
            (Some(digit), _) => parts.push((false, digit)),
            (None, _) => parts.push((true, c.into())),
        }
    }
    (parts, name.to_owned())
}

#[cfg(test)]
mod tests;
