//! Study: which controller paints the most legible word, with confidence intervals.
//!
//! Products in: scenes, words, seeds and [`Conditions`]. Products out: a ranking, a tuned scene, a
//! learned plan, a table of the factors that break the word.
//!
//! 1. A scene made ready for a word ([`Prepared`]) flies seed after seed. Each flight is exposed at
//!    the reader's own resolution on a small film and read: one [`Outcome`].
//! 2. The seed alone decides gusts, noise and how the drone departs from its scene, so controllers
//!    are compared flight by flight under common random numbers.
//! 3. Every outcome goes into a [`Store`] at once; trials in there are never flown again. An
//!    interrupted study continues with the numbers of an uninterrupted one, on any number of threads
//!    and machines.
//!
//! Measured, in CPU time on a machine under load: 43 ms for a flight of NOOR, flown and read; 62 ms over
//! 20 words and NOOR. The team's scene writes NOOR legibly at a cap height of 0.5 m and not at 0.4 m
//! (read with probability 0.37), the tuned one at 0.2 m (0.85) and not at 0.15 m (0.49; learned 0.66),
//! all with the template reader of version 0.1.
//!
//! Sources: common random numbers and paired comparison, Law, "Simulation Modeling and Analysis"
//! (2015), chapter 11; bootstrap intervals, Efron, Tibshirani (1993).
//!
//! Not modeled: readers who differ, learning pilots, photographers who choose another exposure for
//! each controller.

mod conditions;
mod correct;
mod design;
mod hold;
mod knobs;
mod learn;
mod outcome;
mod rank;
mod remedy;
mod robustness;
mod search;
mod spread;
pub mod statistics;
mod store;
mod sweep;
mod tables;
mod trial;
mod tune;

pub use conditions::{Conditions, Factor};
pub use correct::{LearnOptions, align, correct};
pub use design::{Study, Trial, evaluate};
pub use hold::{
    Bounds, CONSISTENT, Consistency, DURATION_S, HoldFigures, HoldVerdict, Interval, hold_figures,
};
pub use knobs::{Knob, Turn, settings, turned};
pub use learn::{Learned, Round, learn};
pub use outcome::{Flown, Outcome};
pub use rank::{Measures, Pair, Ranking, rank};
pub use remedy::{Remedy, SEEDS, remedies};
pub use robustness::{Endurance, Level, RobustnessOptions, robustness};
pub use search::{Search, SearchKind};
pub use spread::{BAND_FRAC, Band, Held, LEAST_FLIGHTS, Spread, SpreadFlight, SpreadShot, spread};
pub use store::{Record, Store};
pub use sweep::{Shard, Sweep};
pub use tables::{candidates_csv, flights_csv, ranking_csv, robustness_csv};
pub use trial::Prepared;
pub use tune::{Candidate, Limits, TuneOptions, Tuned, tune};
