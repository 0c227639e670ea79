//! Studies: determine which controller writes the most legible words, with confidence intervals.
//!
//! Products in: scenes, words, seeds and [`Conditions`]. Products out: a ranking, a tuned scene.
//!
//! 1. A scene that is prepared for a word ([`Prepared`]) is flown with one seed after another. Each
//!    flight is exposed on a small film, at the reader's resolution, and read. The result is one
//!    [`Outcome`].
//! 2. Gusts, noise and the drone's differences from its scene depend only on the seed. Controllers
//!    are therefore compared flight by flight under common random numbers.
//! 3. Every outcome is added to a [`Store`] at once, and a stored trial is never flown again. An
//!    interrupted study can be continued on any number of threads and machines, with the same
//!    results as an uninterrupted one.
//!
//! Sources: Law, "Simulation Modeling and Analysis" (2015), chapter 11, for common random numbers
//! and paired comparison. Efron, Tibshirani (1993) for bootstrap intervals.
//!
//! Not modeled: differences between readers, pilots who learn, and photographers who choose a
//! different exposure for each controller.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

mod acuity;
pub mod comparison;
mod conditions;
mod evening;
mod experiment;
mod hold;
mod knobs;
mod outcome;
mod rank;
mod remedy;
pub mod report;
mod search;
mod shard;
mod spread;
pub mod statistics;
mod store;
mod submissions;
mod tables;
mod trial;
mod tune;

/// Digest of the source that determines an outcome, in 16 hexadecimal digits. It does not depend on
/// the system, is the same for a clone and an archive, and distinguishes builds of one version.
pub const SOURCE: &str = env!("NOCTOGRAPH_SOURCE");

pub use acuity::{Acuity, HeightLimit, RUNGS, Rung, acuity, fly_ladder};
pub use conditions::Conditions;
pub use evening::{Evening, EveningLog, Flaw, FoundCondition, LogFigures, MeanDrone};
pub use experiment::{Study, Trial, evaluate};
pub use hold::{
    Bounds, CONSISTENT, Consistency, DURATION_S, Hold, HoldFigures, HoldModel, HoldSample,
    HoldScenario, HoldVerdict, STATE_NAMES, hold, hold_figures,
};
pub use knobs::{Knob, Turn, settings, turned};
pub use outcome::{Flown, Outcome};
pub use rank::{Measures, Pair, Ranking, Unranked, least_flights, rank};
pub use remedy::{Remedy, SEEDS, remedies, remedies_for};
pub use shard::{Shard, shards};
pub use spread::{BAND_FRAC, Band, LEAST_FLIGHTS, Spread, SpreadFlight, SpreadShot, spread};
pub use store::{Record, Store};
pub use submissions::{Submissions, submissions};
pub use tables::{candidates_csv, flights_csv, marks_csv, ranking_csv};
pub use trial::Prepared;
pub use tune::{Candidate, TuneOptions, Tuned, tune};
