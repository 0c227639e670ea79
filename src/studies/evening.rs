//! Evening: drones and air by the logs of an evening's flights, and the [`super::Conditions`] that
//! these make.
//!
//! In: a folder of logs, and the scene's drone, since logs do not have the mass. Out: a row for
//! each log, with its figures and flaws, and the widths of conditions. Each log is identified by
//! itself ([`identify`]). Its thrust per command is relative to the weight, so that a heavy drone
//! and a weak one are the same.
//!
//! Not found: distortion of the Lighthouse and turn of its frame, which take a second source of
//! position, inertia, delay of the lamps, charge and age of the battery.

use std::collections::HashMap;
use std::fmt;
use std::path::Path;

use rayon::prelude::*;
use serde::{Serialize, Serializer};

use super::conditions::{OUTAGE_EVERY_S, ROOM_GUST_M_S};
use super::experiment::counter;
use super::statistics::mean;
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::Result;
use noctograph_core::files::Limit;
use noctograph_core::flight::warning::UNLOGGED;
use noctograph_core::flight::{Flight, FlightSample, Quantity, airborne, saturated_s};
use noctograph_core::settings::Described;
use noctograph_logs::identify::{RotorLag, T_95, identify, is_frozen};
use noctograph_logs::{GatheredLog, ImportOptions, import, logs_in};
use noctograph_pipeline::preflight::MAX_SATURATED_S;
use noctograph_pipeline::scene::Scene;
use noctograph_sim::vehicle::GustOptions;

/// Least sample rate of a log as a flight: a command that is shown 5 ms late looks like a lag that
/// is 20 ms shorter.
const LEAST_RATE_HZ: f64 = 500.0;
/// Shortest flight that is used: the trim's error falls with its root.
const LEAST_AIR_S: f64 = 10.0;
/// Largest fraction of a flight that may be missing from its log.
const MOST_UNKNOWN: f64 = 0.1;
/// Least gusts of a log: the quietest sensor's noise is more.
const LEAST_GUST_M_S: f64 = 1e-6;
/// Flights from which a spread is taken.
const LEAST_FLIGHTS: usize = 3;
/// Standard deviation of an evening's mean ratio of thrust to weight. Its error is common to all
/// flights. In nine simulated flights of known thrust it was below three standard deviations.
const THRUST_SIGMA_FRAC: f64 = 0.0023;
/// Logs of an evening: thirty flights of ten minutes with fifty variables at 100 Hz.
const LOGS: Limit = Limit {
    bytes: 512 << 20,
    what: "the logs of an evening",
    hint: "import a part of the folder at a time, or log fewer variables",
};
/// Logs that are read at once: each may take 240 MiB of its
/// [`Budget`](noctograph_core::files::Budget).
const AT_ONCE: usize = 3;

/// The logs of a folder.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evening {
    /// One for each flight, in the order of the drones' names and of their own: 2 before 10.
    pub logs: Vec<EveningLog>,
}

/// A log with its flaws and figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EveningLog {
    /// Its drone's name.
    pub drone: String,
    /// Its path within the folder.
    pub log: String,
    /// Reasons not to use it. A sound log has none.
    pub flaws: Vec<Flaw>,
    /// Figures of its drone. `None` if nothing is identified.
    pub figures: Option<LogFigures>,
    /// What was guessed, mended or left out as it was read. JSON has the sentences.
    #[serde(serialize_with = "sentences")]
    pub warnings: Vec<Diagnostic>,
}

fn sentences<S: Serializer>(
    warnings: &[Diagnostic],
    to: S,
) -> std::result::Result<S::Ok, S::Error> {
    to.collect_seq(warnings.iter().map(ToString::to_string))
}

/// A reason not to use a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Flaw {
    /// It is the file of this other log: a link to it, or a name of the same.
    Again(String),
    /// It cannot be read, for this reason.
    Unreadable(String),
    /// Nothing is identified, for this reason: no motor commands, or a drone on the floor.
    Silent(String),
    /// Seconds in the air: too few.
    Short(f64),
    /// Fraction of the flight that the log does not cover: too large.
    Gaps(f64),
    /// Seconds with a motor at its limit: too many.
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
            Self::Gaps(frac) => write!(f, "gaps: {:.0} % of the flight unknown", 100.0 * frac),
            Self::Frozen => write!(f, "frozen: its rows repeat one"),
            Self::Saturated(s) => write!(f, "a motor at its limit for {s:.1} s"),
        }
    }
}

/// Figures of a drone and its air by one log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LogFigures {
    /// Time in the air.
    pub air_s: f64,
    /// Longest gap in the log.
    pub longest_gap_s: f64,
    /// Thrust per command and weight, as a fraction of the scene's.
    pub thrust_frac: f64,
    /// Center of mass in body x and y.
    pub trim_m: [f64; 2],
    /// Its standard deviation by uneven air. `None` for a flight too short.
    pub trim_sigma_m: Option<[f64; 2]>,
    /// Lag of the rotors. `None` if the log does not show it.
    pub lag_s: Option<f64>,
    /// Its standard deviation.
    pub lag_sigma_s: Option<f64>,
    /// Gusts that turn a drone as its air did, σ. `None` for a flight too short.
    pub gust_m_s: Option<f64>,
}

/// A width of the conditions, with the figures that it was found from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundCondition {
    /// Key of [`super::Conditions`].
    pub key: &'static str,
    /// Its value.
    pub value: f64,
    /// The figures behind it.
    pub from: String,
}

/// Mean of the sound flights' figures, for a scene of these drones. A figure within three of its
/// standard deviations of the scene's is the scene's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanDrone {
    /// Thrust of a motor per unit of its command, with the scene's mass.
    pub k_f_n: f64,
    /// Center of mass in body x and y.
    pub center_of_mass_m: [f64; 2],
    /// Lag of the rotors. `None` if no log shows it.
    pub lag_s: Option<f64>,
}

impl Evening {
    /// Reads and identifies the logs of a folder ([`logs_in`]). `done` gets their number so far.
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
        let (logs, count) = (logs_in(folder)?.0, counter(done));
        LOGS.check_all(logs.iter().map(|log| &log.path))?;
        // Links may lead to one file several times: it is one flight, and is read once.
        let mut firsts = HashMap::new();
        for log in logs.iter().rev() {
            firsts.extend(log.path.canonicalize().map(|file| (file, log.name.as_str())));
        }
        let mut rows: Vec<EveningLog> = Vec::new();
        // A few at a time, which bounds the memory.
        for at_once in logs.chunks(AT_ONCE) {
            rows.par_extend(at_once.par_iter().map(|log| {
                let first = log.path.canonicalize().ok().and_then(|file| firsts.get(&file));
                let row = match first.filter(|first| **first != log.name) {
                    Some(&first) => EveningLog::flawed(log, Flaw::Again(first.to_owned())),
                    None => EveningLog::new(log, import(&log.path, options), scene),
                };
                count();
                row
            }));
        }
        rows.sort_by_cached_key(|log| [natural(&log.drone), natural(&log.log)]);
        Ok(Self { logs: rows })
    }

    /// The drones with their logs.
    pub fn drones(&self) -> Vec<(&str, &[EveningLog])> {
        let drones = self.logs.chunk_by(|a, b| a.drone == b.drone);
        drones.map(|logs| (&logs[0].drone[..], logs)).collect()
    }

    /// Figures of the sound flights.
    pub fn sound(&self) -> impl Iterator<Item = &LogFigures> {
        self.logs.iter().filter(|log| log.flaws.is_empty()).filter_map(|log| log.figures.as_ref())
    }

    /// The mean of the sound flights. `None` if there are none.
    pub fn mean_drone(&self, scene: &Scene) -> Option<MeanDrone> {
        self.sound().next()?;
        let lags_s: Vec<f64> = self.sound().filter_map(|f| f.lag_s).collect();
        let thrust_frac = mean(self.sound().map(|f| f.thrust_frac));
        let center_of_mass_m = [0, 1].map(|axis: usize| {
            let trim_m = mean(self.sound().map(|f| f.trim_m[axis]));
            // Standard error of the mean, from that of each flight.
            let sigmas_m = self.sound().filter_map(|f| Some(f.trim_sigma_m?[axis]));
            let variance_m2 = mean(sigmas_m.map(|sigma_m| sigma_m * sigma_m));
            let sigma_m = (variance_m2 / self.sound().count() as f64).sqrt();
            significant(trim_m, sigma_m, scene.vehicle.center_of_mass_m[axis])
        });
        Some(MeanDrone {
            k_f_n: scene.vehicle.k_f_n * significant(thrust_frac, THRUST_SIGMA_FRAC, 1.0),
            center_of_mass_m,
            lag_s: (!lags_s.is_empty()).then(|| mean(&lags_s)),
        })
    }

    /// The widths of conditions that the sound flights show, about their mean. What they do not
    /// show is a room's. In the order of a conditions file.
    pub fn conditions(&self) -> Vec<FoundCondition> {
        let figures: Vec<&LogFigures> = self.sound().collect();
        let n = figures.len();
        let thrusts: Vec<_> = figures.iter().map(|f| (f.thrust_frac, 0.0)).collect();
        // Uneven air moves the mean command of a short flight: its variance is taken off.
        let trims_m = [0, 1].map(|axis: usize| {
            let sigmas_m = figures.iter().map(|f| f.trim_sigma_m.map_or(0.0, |m| m[axis]));
            spread(&figures.iter().map(|f| f.trim_m[axis]).zip(sigmas_m).collect::<Vec<_>>())
        });
        let trim_m = libm::hypot(trims_m[0], trims_m[1]) / std::f64::consts::SQRT_2;
        // The width of a uniform law is √12 of its standard deviation. The mean is of no use: it
        // has the errors that all logs of an evening have in common.
        let lags_s: Vec<(f64, f64)> =
            figures.iter().filter_map(|f| Some((f.lag_s?, f.lag_sigma_s?))).collect();
        let lag_s = 12_f64.sqrt() * spread(&lags_s);
        let gusts: Vec<f64> = figures.iter().filter_map(|f| f.gust_m_s).collect();
        let gust_m_s = mean(gusts.iter().map(|gust| gust * gust)).sqrt();
        let outages_s: Vec<f64> =
            figures.iter().filter(|f| f.longest_gap_s > 0.0).map(|f| f.mean_outage_s()).collect();
        let (n_lags, n_gusts, n_gaps) = (lags_s.len(), gusts.len(), outages_s.len());
        let conditions = [
            ("mass_frac", n, LEAST_FLIGHTS, spread(&thrusts), "thrust over weight"),
            ("center_of_mass_m", n, LEAST_FLIGHTS, trim_m, "trim beyond what gusts explain"),
            ("motor_lag_s", n_lags, LEAST_FLIGHTS, lag_s, "spread of the rotors' lag"),
            ("gust_m_s", n_gusts, 1, gust_m_s, "torque of uneven air"),
            ("radio_outage_s", n_gaps, 1, mean(&outages_s), "longest gaps, of one in 10 s"),
        ];
        let shown = conditions.into_iter().filter(|(_, n, least, ..)| n >= least);
        let shown = shown.map(|(key, n, _, value, from)| {
            let flights = if key == "radio_outage_s" { "" } else { &format!(", {n} flights") };
            FoundCondition { key, value, from: format!("{from}{flights}") }
        });
        shown.collect()
    }

    /// A conditions file (TOML) with what was found.
    pub fn conditions_toml(&self, conditions: &[FoundCondition]) -> String {
        let (n, drones) = (self.sound().count(), self.drones().len());
        let mut toml = format!(
            "# Conditions of {n} sound flights of {} by {drones} drone(s). Keys that are left out are a\n\
             # room's: rank and preview --spread take this file as --conditions.\n",
            self.logs.len()
        );
        for FoundCondition { key, value, from } in conditions {
            toml += &format!("{key} = {value:.3e}  # {from}\n");
        }
        toml
    }
}

impl LogFigures {
    /// The mean of its outages from the longest. The longest of n exponential times is on average 1
    /// + 1/2 + … + 1/n times their mean.
    fn mean_outage_s(&self) -> f64 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1")]
        let n = (self.air_s / OUTAGE_EVERY_S).round().max(1.0) as u32;
        self.longest_gap_s / (1..=n).map(|k| 1.0 / f64::from(k)).sum::<f64>()
    }
}

impl EveningLog {
    /// A log without figures.
    fn flawed(log: &GatheredLog, flaw: Flaw) -> Self {
        let (drone, log) = (log.drone.clone(), log.name.clone());
        Self { drone, log, flaws: vec![flaw], figures: None, warnings: Vec::new() }
    }

    fn new(log: &GatheredLog, flight: Result<Flight>, scene: &Scene) -> Self {
        let flight = match flight {
            Ok(flight) => flight,
            Err(error) => return Self::flawed(log, Flaw::Unreadable(error.to_string())),
        };
        // Figures need the motors and the body's rates: what else is not logged is not missed.
        let mut warnings = flight.warnings.clone();
        warnings.retain(|warning| warning.code != UNLOGGED);
        let samples = &flight.samples[airborne(&flight).unwrap_or_default()];
        let figures = match figures(&flight, samples, scene) {
            Ok(figures) => figures,
            Err(flaw) => return Self { warnings, ..Self::flawed(log, flaw) },
        };
        let LogFigures { air_s, gust_m_s, .. } = figures;
        let unknown = gaps_s(&flight, samples).iter().sum::<f64>() / air_s;
        let saturated_s = saturated_s(samples, scene.vehicle.motor_max);
        let flaws = [
            (air_s < LEAST_AIR_S).then_some(Flaw::Short(air_s)),
            (unknown > MOST_UNKNOWN).then_some(Flaw::Gaps(unknown)),
            (saturated_s > MAX_SATURATED_S).then_some(Flaw::Saturated(saturated_s)),
            gust_m_s.is_some_and(|gust| gust < LEAST_GUST_M_S).then_some(Flaw::Frozen),
        ];
        // The lag shows as a command that turns the drone along its path.
        if samples.windows(2).all(|pair| pair[0].design_m.xy() == pair[1].design_m.xy()) {
            let message = "its setpoints stay at one place, or are not logged: it does not show \
                           the rotors' lag";
            warnings.push(Diagnostic::warning("lag-unseen", message));
        }
        let (drone, log) = (log.drone.clone(), log.name.clone());
        let flaws = flaws.into_iter().flatten().collect();
        Self { drone, log, flaws, figures: Some(figures), warnings }
    }
}

/// Gaps of a log while the drone is in the air.
fn gaps_s(flight: &Flight, air: &[FlightSample]) -> Vec<f64> {
    let (from_s, to_s) = (air[0].time_s, air[air.len() - 1].time_s);
    let within = flight.gaps.iter().filter(|[start_s, end_s]| from_s <= *start_s && *end_s <= to_s);
    within.map(|[start_s, end_s]| end_s - start_s).collect()
}

/// The figures of a flight by its samples in the air, or its flaw if it has none.
fn figures(
    flight: &Flight,
    air: &[FlightSample],
    scene: &Scene,
) -> std::result::Result<LogFigures, Flaw> {
    if flight.has(Quantity::Motors) && !air.is_empty() && is_frozen(air) {
        return Err(Flaw::Frozen);
    }
    // The scene's mass turns thrust per weight into newtons.
    let vehicle = &scene.vehicle;
    let identified = identify(flight, vehicle).map_err(|error| Flaw::Silent(error.to_string()))?;
    let lag = identified.lag.filter(RotorLag::is_identifiable);
    let weight_n = identified.k_f_n * identified.mean_motors.iter().sum::<f64>();
    let room = GustOptions::default().torque_sigma_n_m;
    Ok(LogFigures {
        air_s: air[air.len() - 1].time_s - air[0].time_s,
        longest_gap_s: gaps_s(flight, air).into_iter().fold(0.0, f64::max),
        thrust_frac: identified.k_f_n / vehicle.k_f_n,
        trim_m: identified.center_of_mass_m,
        // A torque about y shifts the center of mass in x, and the other way around.
        trim_sigma_m: identified
            .air
            .map(|air| [1, 0].map(|axis: usize| air.mean_sigma_n_m[axis] / weight_n)),
        lag_s: lag.map(|lag| lag.lag_s),
        lag_sigma_s: lag.map(|lag| lag.half_width_s / T_95),
        gust_m_s: identified.air.map(|air| {
            let [x, y] = [0, 1].map(|axis: usize| air.torque_sigma_n_m[axis] / room[axis]);
            ROOM_GUST_M_S * 0.5 * (x + y)
        }),
    })
}

/// A figure if it differs from the scene's by more than three standard deviations, else the
/// scene's.
fn significant(figure: f64, sigma: f64, scene: f64) -> f64 {
    if (figure - scene).abs() > 3.0 * sigma { figure } else { scene }
}

/// Standard deviation of values beyond that of their errors, whose σ are given beside them. 0 for
/// fewer than two.
fn spread(values: &[(f64, f64)]) -> f64 {
    let n = values.len() as f64;
    let middle = mean(values.iter().map(|(value, _)| value));
    let square: f64 = values.iter().map(|(value, _)| (value - middle) * (value - middle)).sum();
    let of_errors: f64 = values.iter().map(|(_, sigma)| sigma * sigma).sum();
    (square / (n - 1.0) - of_errors / n).max(0.0).sqrt()
}

/// Sort key of a name that orders its numbers by value: numbers before other characters, and the
/// name itself last.
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
