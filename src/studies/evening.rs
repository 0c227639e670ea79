//! Evening: identifies drones and air from an evening's logs, and derives [`super::Conditions`].
//!
//! Product in: a folder of logs, and the drone of a scene, because logs do not contain the mass.
//! Product out: a row for each log, with its figures and flaws, and the widths of conditions. Each
//! log is identified separately ([`identify`]). The thrust per command is identified relative to
//! the weight, so a heavy drone cannot be told from a weak one.
//!
//! Not identified: moments of inertia, the delay of the lamps, the charge and age of the battery,
//! and the distortion and rotation of the Lighthouse frame, which require another source of
//! positions.

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

/// Minimum sample rate of an import. A command 5 ms late makes the lag look 20 ms shorter.
const LEAST_RATE_HZ: f64 = 500.0;
/// Minimum time in the air for a usable flight. The error of the trim decreases with the square
/// root of this time.
const LEAST_AIR_S: f64 = 10.0;
/// Maximum fraction of a flight that may be missing from its log.
const MAX_MISSING_FRAC: f64 = 0.1;
/// Minimum strength of the gusts in a log. Even sensor noise appears as stronger gusts.
const LEAST_GUST_M_S: f64 = 1e-6;
/// Minimum number of flights from which a spread is computed.
const LEAST_FLIGHTS: usize = 3;
/// Standard deviation of the common error in the thrust-to-weight ratios of an evening's flights.
/// In nine simulated flights with known thrust the error was below three standard deviations.
const THRUST_SIGMA_FRAC: f64 = 0.0023;
/// Maximum size of an evening's logs: thirty ten-minute flights with fifty variables at 100 Hz.
const LOGS_LIMIT: Limit = Limit {
    bytes: 512 << 20,
    what: "the logs of an evening",
    hint: "import a part of the folder at a time, or log fewer variables",
};
/// Number of logs that are read at the same time. An import may use up to 240 MiB
/// ([`Budget`](noctograph_core::files::Budget)).
const AT_ONCE: usize = 3;

/// The logs in a folder.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evening {
    /// Rows of the logs, one per flight, sorted by drone, then by log, with numbers sorted by
    /// value.
    pub logs: Vec<EveningLog>,
}

/// A log, its flaws, and the figures of its flight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EveningLog {
    /// Name of the drone that wrote the log.
    pub drone: String,
    /// Path of the log within the folder.
    pub log: String,
    /// Reasons to reject the log, empty for a valid log.
    pub flaws: Vec<Flaw>,
    /// Figures of the drone. `None` if nothing can be identified.
    pub figures: Option<LogFigures>,
    /// Warnings about guesses, repairs and omissions, which the JSON contains as full sentences.
    #[serde(serialize_with = "sentences")]
    pub warnings: Vec<Diagnostic>,
}

/// Serializes warnings as a list of sentences.
fn sentences<S: Serializer>(
    warnings: &[Diagnostic],
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_seq(warnings.iter().map(ToString::to_string))
}

/// Reason to reject a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Flaw {
    /// The log is the same file as this other log, under a link or a second name.
    Again(String),
    /// The log cannot be read, for this reason.
    Unreadable(String),
    /// Nothing can be identified, for this reason, such as a drone that stays on the floor.
    Silent(String),
    /// The airborne time, in seconds, is too short.
    Short(f64),
    /// Too large a fraction of the flight is missing.
    Gaps(f64),
    /// A motor is saturated for too long, in seconds.
    Saturated(f64),
    /// The drone never rotates, because all rows repeat the same values.
    Frozen,
}

impl fmt::Display for Flaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Again(log) => write!(f, "the same file as {log}"),
            Self::Unreadable(why) => write!(f, "unreadable: {why}"),
            Self::Silent(why) => write!(f, "no figures: {why}"),
            Self::Short(air_s) => write!(f, "only {air_s:.1} s in the air"),
            Self::Gaps(frac) => {
                write!(f, "gaps in {:.0} % of the flight", 100.0 * frac)
            }
            Self::Frozen => write!(f, "frozen: all rows repeat the same values"),
            Self::Saturated(s) => write!(f, "a motor at its limit for {s:.1} s"),
        }
    }
}

/// Figures of a drone and of the air, from one log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LogFigures {
    /// Time in the air.
    pub air_s: f64,
    /// Duration of the longest gap in the log.
    pub longest_gap_s: f64,
    /// Thrust per command and per unit weight, as a fraction of the scene's value.
    pub thrust_frac: f64,
    /// Center of mass along body x and y.
    pub trim_m: [f64; 2],
    /// Standard deviation of the trim due to uneven air. `None` if the flight is too short.
    pub trim_sigma_m: Option<[f64; 2]>,
    /// Lag of the rotors. `None` if it cannot be identified from the log.
    pub lag_s: Option<f64>,
    /// Standard deviation of the lag.
    pub lag_sigma_s: Option<f64>,
    /// Standard deviation of gusts that would rotate the drone as much as the air actually did.
    /// `None` if the flight is too short.
    pub gust_m_s: Option<f64>,
}

/// Width of a condition, and the figures from which it was derived.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundCondition {
    /// Key in [`super::Conditions`].
    pub key: &'static str,
    /// Value of the key.
    pub value: f64,
    /// Description of the figures from which the value was derived.
    pub from: String,
}

/// Mean figures of the valid flights, to be entered in a scene. A mean within three standard
/// deviations of the scene's value is replaced by the scene's value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanDrone {
    /// Thrust of a motor per unit of its command, for the scene's mass.
    pub k_f_n: f64,
    /// Center of mass along body x and y.
    pub center_of_mass_m: [f64; 2],
    /// Lag of the rotors. `None` if it cannot be identified from any log.
    pub lag_s: Option<f64>,
}

impl Evening {
    /// Identifies the logs in a folder ([`logs_in`]). Calls `done` with the number of finished
    /// logs.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`logs_in`], and errors for options out of range. A log that cannot be
    /// read is not an error but a flaw in its row.
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
        LOGS_LIMIT.check_all(logs.iter().map(|log| &log.path))?;
        // If several links lead to the same file, it is read once, under its first name.
        let mut first_names = HashMap::new();
        for log in logs.iter().rev() {
            first_names.extend(log.path.canonicalize().map(|file| (file, log.name.as_str())));
        }
        let mut rows: Vec<EveningLog> = Vec::new();
        // Only a few logs are read at a time, which limits memory use.
        for at_once in logs.chunks(AT_ONCE) {
            rows.par_extend(at_once.par_iter().map(|log| {
                let first = log.path.canonicalize().ok().and_then(|file| first_names.get(&file));
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

    /// Returns the names of the drones, each with its logs.
    pub fn drones(&self) -> Vec<(&str, &[EveningLog])> {
        let drones = self.logs.chunk_by(|a, b| a.drone == b.drone);
        drones.map(|logs| (&logs[0].drone[..], logs)).collect()
    }

    /// Returns the figures of the flights without flaws.
    pub fn sound(&self) -> impl Iterator<Item = &LogFigures> {
        self.logs.iter().filter(|log| log.flaws.is_empty()).filter_map(|log| log.figures.as_ref())
    }

    /// Returns the mean drone of the valid flights, or `None` if there is no valid flight.
    pub fn mean_drone(&self, scene: &Scene) -> Option<MeanDrone> {
        self.sound().next()?;
        let lags_s: Vec<f64> = self.sound().filter_map(|f| f.lag_s).collect();
        let thrust_frac = mean(self.sound().map(|f| f.thrust_frac));
        let center_of_mass_m = [0, 1].map(|axis: usize| {
            let trim_m = mean(self.sound().map(|f| f.trim_m[axis]));
            // Standard error of the mean, with the average variance for a flight without a sigma.
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

    /// Returns the widths of conditions from the spread of the valid flights, in the order of a
    /// conditions file. Widths that the flights do not determine are omitted and stay those of
    /// `room`.
    pub fn conditions(&self) -> Vec<FoundCondition> {
        let figures: Vec<&LogFigures> = self.sound().collect();
        let n = figures.len();
        let thrusts: Vec<_> = figures.iter().map(|f| (f.thrust_frac, 0.0)).collect();
        // Uneven air shifts a short flight's mean command. The variance of this shift is
        // subtracted.
        let trims_m = [0, 1].map(|axis: usize| {
            let sigmas_m = figures.iter().map(|f| f.trim_sigma_m.map_or(0.0, |m| m[axis]));
            spread(&figures.iter().map(|f| f.trim_m[axis]).zip(sigmas_m).collect::<Vec<_>>())
        });
        let trim_m = libm::hypot(trims_m[0], trims_m[1]) / std::f64::consts::SQRT_2;
        // The width of a uniform distribution is √12 times its standard deviation. The mean lag is
        // not used, because some of its errors are common to all logs of a session.
        let lags_s: Vec<(f64, f64)> =
            figures.iter().filter_map(|f| Some((f.lag_s?, f.lag_sigma_s?))).collect();
        let lag_s = 12_f64.sqrt() * spread(&lags_s);
        let gusts: Vec<f64> = figures.iter().filter_map(|f| f.gust_m_s).collect();
        let gust_m_s = mean(gusts.iter().map(|gust| gust * gust)).sqrt();
        let outages_s: Vec<f64> =
            figures.iter().filter(|f| f.longest_gap_s > 0.0).map(|f| f.mean_outage_s()).collect();
        let (n_lags, n_gusts, n_gaps) = (lags_s.len(), gusts.len(), outages_s.len());
        // Each width has a key, its number of flights, the minimum number, a value and its source.
        let widths = [
            ("mass_frac", n, LEAST_FLIGHTS, spread(&thrusts), "thrust over weight"),
            ("center_of_mass_m", n, LEAST_FLIGHTS, trim_m, "trim that gusts do not explain"),
            ("motor_lag_s", n_lags, LEAST_FLIGHTS, lag_s, "spread of the rotors' lag"),
            ("gust_m_s", n_gusts, 1, gust_m_s, "torque caused by uneven air"),
            ("radio_outage_s", n_gaps, 1, mean(&outages_s), "longest gaps, if one occurs in 10 s"),
        ];
        // A width is omitted if too few flights contribute to it.
        let enough = widths.into_iter().filter(|(_, count, least, ..)| count >= least);
        let conditions = enough.map(|(key, count, _, value, from)| {
            let flights = if key == "radio_outage_s" { "" } else { &format!(", {count} flights") };
            FoundCondition { key, value, from: format!("{from}{flights}") }
        });
        conditions.collect()
    }

    /// Returns a conditions file (TOML) with the given widths and the figures behind them.
    pub fn conditions_toml(&self, conditions: &[FoundCondition]) -> String {
        let (n, drones) = (self.sound().count(), self.drones().len());
        let mut toml = format!(
            "# Conditions from {n} valid flights out of {} by {drones} drone(s). Omitted keys have the values\n\
             # of a room. rank and preview --spread read this file with --conditions.\n",
            self.logs.len()
        );
        for FoundCondition { key, value, from } in conditions {
            toml += &format!("{key} = {value:.3e}  # {from}\n");
        }
        toml
    }
}

impl LogFigures {
    /// Returns the mean outage, estimated from the longest one. The longest of n exponentially
    /// distributed times is on average 1 + 1/2 + … + 1/n times their mean.
    fn mean_outage_s(&self) -> f64 {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1")]
        let n = (self.air_s / OUTAGE_EVERY_S).round().max(1.0) as u32;
        self.longest_gap_s / (1..=n).map(|k| 1.0 / f64::from(k)).sum::<f64>()
    }
}

impl EveningLog {
    /// Returns a row without figures for a log with a flaw.
    fn flawed(log: &GatheredLog, flaw: Flaw) -> Self {
        let (drone, log) = (log.drone.clone(), log.name.clone());
        Self { drone, log, flaws: vec![flaw], figures: None, warnings: Vec::new() }
    }

    /// Returns the row of a log, with the figures of its flight, its flaws and its warnings.
    fn new(log: &GatheredLog, flight: Result<Flight>, scene: &Scene) -> Self {
        let flight = match flight {
            Ok(flight) => flight,
            Err(error) => return Self::flawed(log, Flaw::Unreadable(error.to_string())),
        };
        // Warnings about missing columns are dropped, except for motor commands and body rates.
        let mut warnings = flight.warnings.clone();
        warnings.retain(|warning| warning.code != UNLOGGED);
        let samples = &flight.samples[airborne(&flight).unwrap_or_default()];
        let figures = match figures(&flight, samples, scene) {
            Ok(figures) => figures,
            Err(flaw) => return Self { warnings, ..Self::flawed(log, flaw) },
        };
        let LogFigures { air_s, gust_m_s, .. } = figures;
        let missing_frac = gaps_s(&flight, samples).iter().sum::<f64>() / air_s;
        let saturated_s = saturated_s(samples, scene.vehicle.motor_max);
        let flaws = [
            (air_s < LEAST_AIR_S).then_some(Flaw::Short(air_s)),
            (missing_frac > MAX_MISSING_FRAC).then_some(Flaw::Gaps(missing_frac)),
            (saturated_s > MAX_SATURATED_S).then_some(Flaw::Saturated(saturated_s)),
            gust_m_s.is_some_and(|gust| gust < LEAST_GUST_M_S).then_some(Flaw::Frozen),
        ];
        // The lag only affects commands that rotate the drone along a path, so a path is required.
        if samples.windows(2).all(|pair| pair[0].design_m.xy() == pair[1].design_m.xy()) {
            let message = "its setpoints are constant or not logged, so it does not show the \
                           rotors' lag";
            warnings.push(Diagnostic::warning("lag-unseen", message));
        }
        let (drone, log) = (log.drone.clone(), log.name.clone());
        let flaws = flaws.into_iter().flatten().collect();
        Self { drone, log, flaws, figures: Some(figures), warnings }
    }
}

/// Returns the durations in s of the log's gaps that lie entirely within `air`, the airborne
/// samples.
fn gaps_s(flight: &Flight, air: &[FlightSample]) -> Vec<f64> {
    let (from_s, to_s) = (air[0].time_s, air[air.len() - 1].time_s);
    let within = flight.gaps.iter().filter(|[start_s, end_s]| from_s <= *start_s && *end_s <= to_s);
    within.map(|[start_s, end_s]| end_s - start_s).collect()
}

/// Returns a flight's figures from `air`, its airborne samples, or the flaw that prevents this.
fn figures(
    flight: &Flight,
    air: &[FlightSample],
    scene: &Scene,
) -> std::result::Result<LogFigures, Flaw> {
    if flight.has(Quantity::Motors) && !air.is_empty() && is_frozen(air) {
        return Err(Flaw::Frozen);
    }
    // The scene's mass converts thrust per weight to newtons.
    let vehicle = &scene.vehicle;
    let identified = identify(flight, vehicle).map_err(|error| Flaw::Silent(error.to_string()))?;
    let lag = identified.lag.filter(RotorLag::is_identifiable);
    let weight_n = identified.k_f_n * identified.mean_motors.iter().sum::<f64>();
    let room_sigma_n_m = GustOptions::default().torque_sigma_n_m;
    Ok(LogFigures {
        air_s: air[air.len() - 1].time_s - air[0].time_s,
        longest_gap_s: gaps_s(flight, air).into_iter().fold(0.0, f64::max),
        thrust_frac: identified.k_f_n / vehicle.k_f_n,
        trim_m: identified.center_of_mass_m,
        // A torque about y has the effect of a shift of the center of mass along x, and a torque
        // about x that of a shift along y.
        trim_sigma_m: identified
            .air
            .map(|air| [1, 0].map(|axis: usize| air.mean_sigma_n_m[axis] / weight_n)),
        lag_s: lag.map(|lag| lag.lag_s),
        lag_sigma_s: lag.map(|lag| lag.half_width_s / T_95),
        gust_m_s: identified.air.map(|air| {
            let [x, y] =
                [0, 1].map(|axis: usize| air.torque_sigma_n_m[axis] / room_sigma_n_m[axis]);
            ROOM_GUST_M_S * 0.5 * (x + y)
        }),
    })
}

/// Returns `figure` if it differs from the scene's value by more than three standard deviations
/// `sigma` of its error, otherwise the scene's value. All three have the same unit.
fn significant(figure: f64, sigma: f64, scene: f64) -> f64 {
    if (figure - scene).abs() > 3.0 * sigma { figure } else { scene }
}

/// Returns the standard deviation of values between drones, in the unit of the values. Each value
/// is given with the σ of its error, and the variance of the errors is subtracted. Returns 0 for
/// fewer than two values.
fn spread(values: &[(f64, f64)]) -> f64 {
    let n = values.len() as f64;
    let middle = mean(values.iter().map(|(value, _)| value));
    let squares: f64 = values.iter().map(|(value, _)| (value - middle) * (value - middle)).sum();
    let error_squares: f64 = values.iter().map(|(_, sigma)| sigma * sigma).sum();
    // For fewer than two values the difference is NaN, which `max` replaces with 0.
    (squares / (n - 1.0) - error_squares / n).max(0.0).sqrt()
}

/// Part of a name. Numbers are sorted before other characters.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum NamePart {
    Number(u64),
    Character(char),
}

/// Returns a sort key that compares numbers within names by value. The name itself breaks ties.
fn natural(name: &str) -> (Vec<NamePart>, String) {
    let mut parts: Vec<NamePart> = Vec::new();
    for c in name.chars() {
        match (c.to_digit(10).map(u64::from), parts.last_mut()) {
            (Some(digit), Some(NamePart::Number(number))) => {
                *number = number.saturating_mul(10).saturating_add(digit);
            }
            (Some(digit), _) => parts.push(NamePart::Number(digit)),
            (None, _) => parts.push(NamePart::Character(c)),
        }
    }
    (parts, name.to_owned())
}

#[cfg(test)]
mod tests;
