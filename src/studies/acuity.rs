//! Acuity: the highest speed at which a contender's words are still legible. An eye chart likewise
//! asks for the smallest letters.
//!
//! In: a study. Every contender flies its words on a ladder of stroke speeds, from four times the
//! slowest of the scenes up. Each rung has separate seeds, the same for all contenders. Out:
//! [`Acuity`].
//!
//! If words are legible below a speed and not above it, the mean of P(read) over the ladder is the
//! fraction of rungs below that speed (method of Spearman 1908 and Kärber 1931). So the mean and
//! its interval give a speed and its interval, without a model of how P(read) falls. The ladder is
//! a study whose words are its rungs, and [`rank`] compares two contenders flight by flight.
//!
//! Smaller letters would be limited by the lamp: at 8 cm, flights on the true state and on an
//! estimate differ by 0.12 in P(read), at 2.5 m/s by 0.37. Not done: limits beyond the ladder.

use serde::Serialize;

use super::statistics::{Estimate, mean};
use super::{Pair, Prepared, Record, Store, Study, evaluate, rank};
use noctograph_core::error::Result;
use noctograph_pipeline::shoot::Stop;
use noctograph_plan::Style;

/// Number of rungs of the ladder.
pub const RUNGS: u32 = 8;
/// Speed of the first rung, as a multiple of the scene's speed.
const FIRST_TIMES: f64 = 4.0;
/// Octaves between two rungs: a scene with strokes of 0.2 m/s is flown at 0.8 to 2.7 m/s.
const OCTAVES_PER_RUNG: f64 = 0.25;
/// Greatest acceleration of a plan.
const MOST_M_S2: f64 = 100.0;

/// How fast the contenders of a study write, the fastest first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Acuity {
    /// One for each contender.
    pub limits: Vec<SpeedLimit>,
    /// All pairs of contenders, compared by their mean P(read) over the ladder.
    pub pairs: Vec<Pair>,
}

/// The limit of a contender.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpeedLimit {
    /// Its name.
    pub contender: String,
    /// Its place, 1 for the fastest, as in a ranking.
    pub place: Option<usize>,
    /// Flights on the whole ladder.
    pub n_flights: usize,
    /// Stroke speed at which half of its words are legible.
    pub stroke_speed_m_s: Estimate,
    /// Mean P(read) on each rung.
    pub rungs: Vec<Rung>,
}

/// A rung of the ladder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rung {
    /// Speed of the strokes.
    pub stroke_speed_m_s: f64,
    /// Mean P(read).
    pub legibility: f64,
}

impl Study {
    /// Returns the study on each rung of the ladder, the slowest first. The acceleration of the
    /// strokes rises in proportion to their speed.
    pub fn ladder(&self) -> Vec<Self> {
        let speeds_m_s = self.contenders.iter().map(|named| named.scene.plan.stroke_speed_m_s);
        let slowest_m_s = speeds_m_s.fold(f64::INFINITY, f64::min);
        let rungs = (0..RUNGS).map(|rung| {
            // Each rung has other seeds, so that rungs are independent.
            let mut study = Self { seed: self.seed ^ u64::from(rung + 1) << 40, ..self.clone() };
            let speed_m_s =
                slowest_m_s * FIRST_TIMES * libm::exp2(OCTAVES_PER_RUNG * f64::from(rung));
            for plan in study.contenders.iter_mut().map(|named| &mut named.scene.plan) {
                if let Style::Even(even) = &mut plan.style {
                    let scaled = even.acceleration_m_s2 * speed_m_s / plan.stroke_speed_m_s;
                    even.acceleration_m_s2 = scaled.min(MOST_M_S2);
                    even.dark_speed_m_s = even.dark_speed_m_s.max(speed_m_s);
                }
                plan.stroke_speed_m_s = speed_m_s;
            }
            study
        });
        rungs.collect()
    }
}

/// Flies the rungs of a [`Study::ladder`] as [`evaluate`] does, and returns the records of each.
/// `prepared` has the result of [`Study::prepare`] for each rung.
pub fn fly_ladder(
    ladder: &[Study],
    prepared: &[Vec<Prepared>],
    store: Option<&Store>,
    done: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Vec<Record>>> {
    // One rung after the other, with one count of flights.
    let (mut n_done, stop) = (0, Stop::default());
    let rungs = ladder.iter().zip(prepared).map(|(study, prepared)| {
        let trials: Vec<_> = study.trials().collect();
        let records = evaluate(study, prepared, &trials, store, &stop, &|n| done(n_done + n))?;
        n_done += records.len();
        Ok(records)
    });
    rungs.collect()
}

/// Returns the speed limits of contenders, from the records of each rung of a [`Study::ladder`].
pub fn acuity(ladder: &[Study], records: &[Vec<Record>]) -> Acuity {
    // One study with the words of all rungs. Its records come contender by contender.
    let contenders = &ladder[0].contenders;
    let mut by_contender = records.concat();
    by_contender.sort_by_key(|record| contenders.iter().position(|c| c.name == record.contender));
    let words = ladder.iter().flat_map(|study| study.words.clone()).collect();
    let ranking = rank(&Study { words, ..ladder[0].clone() }, &by_contender);
    let limits = ranking.measures.iter().map(|measures| {
        let rungs = ladder.iter().zip(records).map(|(study, records)| {
            let own = records.iter().filter(|record| record.contender == measures.contender);
            Rung {
                stroke_speed_m_s: study.contenders[0].scene.plan.stroke_speed_m_s,
                legibility: mean(own.map(|record| record.outcome.probability)),
            }
        });
        let rungs: Vec<Rung> = rungs.collect();
        SpeedLimit {
            contender: measures.contender.clone(),
            place: measures.place,
            n_flights: measures.n_flights,
            stroke_speed_m_s: limit_m_s(rungs[0].stroke_speed_m_s, measures.legibility),
            rungs,
        }
    });
    Acuity { limits: limits.collect(), pairs: ranking.pairs }
}

/// Returns the speed limit by Spearman and Kärber: the first `n · mean P(read)` of n rungs read,
/// and the limit is half a rung above the last of these.
fn limit_m_s(first_rung_m_s: f64, legibility: Estimate) -> Estimate {
    let Estimate { value, low, high } = legibility;
    let [value, low, high] = [value, low, high].map(|mean| {
        first_rung_m_s * libm::exp2(OCTAVES_PER_RUNG * (mean * f64::from(RUNGS) - 0.5))
    });
    Estimate { value, low, high }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Conditions, Outcome};
    use noctograph_pipeline::scene::{NamedScene, Preset, Scene};

    fn study(n: u32) -> Study {
        let contenders = ["a", "b"].map(|name| NamedScene::new(name, Scene::preset(Preset::Cf21)));
        let words = vec![("NO".to_owned(), n), ("I".to_owned(), n)];
        Study { contenders: contenders.into(), words, conditions: Conditions::still(), seed: 1 }
    }

    /// Records of contenders that are legible up to a speed, each with a soft edge.
    fn records(study: &Study, limits_m_s: [f64; 2]) -> Vec<Record> {
        let records = study.trials().map(|trial| {
            let speed_m_s = study.contenders[trial.contender].scene.plan.stroke_speed_m_s;
            let octaves = libm::log2(limits_m_s[trial.contender] / speed_m_s);
            let shift = 0.2 * ((trial.seed % 8) as f64 / 7.0 - 0.5);
            let p = 1.0 / (1.0 + libm::exp(-12.0 * (octaves + shift)));
            Record {
                scene: String::new(),
                contender: study.contenders[trial.contender].name.clone(),
                word: study.words[trial.word].0.clone(),
                seed: trial.seed,
                outcome: Outcome::example(p),
            }
        });
        records.collect()
    }

    #[test]
    fn limits_are_those_of_the_contenders_and_are_told_apart() {
        let ladder = study(4).ladder();
        let records: Vec<_> = ladder.iter().map(|rung| records(rung, [1.3, 1.45])).collect();
        let acuity = acuity(&ladder, &records);
        let names: Vec<&str> = acuity.limits.iter().map(|limit| &*limit.contender).collect();
        assert_eq!(names, ["b", "a"], "the fastest first");
        for (limit, wanted_m_s) in acuity.limits.iter().zip([1.45, 1.3]) {
            let Estimate { value, low, high } = limit.stroke_speed_m_s;
            assert!((value / wanted_m_s - 1.0).abs() < 0.03 && high < 1.1 * low, "{limit:?}");
            assert!(limit.rungs[0].legibility > 0.95 && limit.rungs[7].legibility < 0.01);
        }
        assert!(acuity.pairs[0].distinguishable, "{acuity:?}");
    }

    #[test]
    fn intervals_of_limits_hold_them() {
        let held = (1..=50_u64).map(|seed| {
            let ladder = Study { seed, ..study(4) }.ladder();
            let records: Vec<_> = ladder.iter().map(|rung| records(rung, [1.3, 1.45])).collect();
            let limits = acuity(&ladder, &records).limits.into_iter();
            let held = limits.filter(|limit| {
                let wanted_m_s = if limit.contender == "a" { 1.3 } else { 1.45 };
                let Estimate { low, high, .. } = limit.stroke_speed_m_s;
                (low..=high).contains(&wanted_m_s)
            });
            held.count()
        });
        let held: usize = held.sum();
        assert!((88..=100).contains(&held), "{held} of 100");
    }

    #[test]
    fn rungs_share_nothing_but_their_contenders() {
        let ladder = study(2).ladder();
        let plans = ladder.iter().map(|study| &study.contenders[1].scene.plan);
        let wanted_m_s = [0.8, 0.951, 1.131, 1.345, 1.6, 1.903, 2.263, 2.691];
        for (plan, wanted_m_s) in plans.zip(wanted_m_s) {
            assert!((plan.stroke_speed_m_s - wanted_m_s).abs() < 1e-3, "{plan:?}");
            let Style::Even(even) = &plan.style else { panic!("{plan:?}") };
            assert!((even.acceleration_m_s2 / plan.stroke_speed_m_s - 10.0).abs() < 1e-9);
        }
        let mut seeds: Vec<u64> =
            ladder.iter().flat_map(|study| study.trials().map(|trial| trial.seed)).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 8 * 2 * 2, "seeds of rungs and words differ; contenders share");
    }
}
