//! Acuity: the smallest letters of a contender that are still read, measured as on an eye chart.
//!
//! Product in: a study. Every contender flies the words with a narrow lamp at each cap height of a
//! ladder. Each rung has seeds of its own, the same for all contenders. Product out: [`Acuity`].
//!
//! A flight's score is the fraction of its letters that are read, as an eye chart is scored letter
//! by letter (Bailey, Bullimore, Raasch, Taylor, Investigative Ophthalmology & Visual Science 32,
//! 1991). If letters are read only above some height, the mean fraction over the ladder is the
//! fraction of rungs above that height (method of Spearman 1908 and Kärber 1931). The mean and its
//! interval therefore give a height and its interval, without a model of how legibility decreases.
//! The ladder is a study with one stratum per rung, and [`rank`] compares two contenders flight by
//! flight.
//!
//! A ladder of stroke speeds distinguishes contenders less well, because the distortion of an E at
//! 1.6 m/s depends on the speed itself and P(read) does not fall monotonically (docs/benchmark.md).
//! Not done: limits beyond the ladder.

use serde::Serialize;

use super::statistics::{Estimate, mean};
use super::{Outcome, Pair, Prepared, Record, Store, Study, evaluate, rank};
use noctograph_core::camera::{CameraOptions, Framing, Metering};
use noctograph_core::error::Result;
use noctograph_core::lamps::{Deck, Fixture};
use noctograph_pipeline::scene::Scene;
use noctograph_pipeline::shoot::Stop;
use noctograph_plan::Style;

/// Number of rungs on the ladder.
pub const RUNGS: u32 = 7;
/// Cap height of the last rung, as a multiple of the scene's cap height: 2 cm for 0.5 m.
const LAST_TIMES: f64 = 0.04;
/// Minimum cap height of the last rung, and minimum width of a letter's box in a scene.
const LEAST_M: f64 = 0.02;
const LEAST_BOX_M: f64 = 0.01;
/// Octaves between two rungs. If the last rung has 2 cm letters, the first has 16 cm letters.
const OCTAVES_PER_RUNG: f64 = 0.5;
/// Lamp diameter, as a multiple of the smallest cap height: a 3 mm LED for 2 cm letters.
const LAMP_TIMES: f64 = 0.15;
/// Maximum distance of a rounded corner from the sharp one, as a multiple of the cap height. The
/// value is the scene's ratio of 1 cm to 0.5 m.
const CORNER_TIMES: f64 = 0.02;
/// Factors for the scene's stroke speed, and for its acceleration and jerk. Slow strokes with sharp
/// corners reveal most about a controller. At the scene's own acceleration, a controller whose
/// motors have twice the lag writes equally small letters.
const SPEED_TIMES: f64 = 0.5;
const ACCELERATION_TIMES: f64 = 4.0;
/// Maximum acceleration and jerk of a plan.
const MOST_M_S2: f64 = 100.0;
const MOST_M_S3: f64 = 10_000.0;

/// Smallest letters of the contenders in a study that are still read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Acuity {
    /// Limits, one for each contender, the best contender first.
    pub limits: Vec<HeightLimit>,
    /// All pairs of contenders, compared by the mean fraction of their letters over the ladder.
    pub pairs: Vec<Pair>,
}

/// Smallest cap height of one contender.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeightLimit {
    /// Name of the contender.
    pub contender: String,
    /// Rank of the contender, 1 for the smallest letters. `None` if no letter was read.
    pub place: Option<usize>,
    /// Number of flights on the whole ladder.
    pub n_flights: usize,
    /// Cap height at which half of the letters are read.
    pub cap_height_m: Estimate,
    /// Fraction of letters that are read on each rung.
    pub rungs: Vec<Rung>,
}

/// One rung of the ladder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rung {
    /// Cap height of the rung.
    pub cap_height_m: f64,
    /// Mean probability with which a letter is read.
    pub letters_read: f64,
}

impl Study {
    /// Returns the study on each rung of the ladder, the largest letters first. All contenders
    /// write each word with `n_seeds` seeds, in letters of the same heights, with the same lamp.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Self::check`] for the first rung that has one.
    pub fn ladder(&self, n_seeds: u32) -> Result<Vec<Self>> {
        let least = |value: fn(&Scene) -> f64| {
            let values = self.contenders.iter().map(|named| value(&named.scene));
            values.fold(f64::INFINITY, f64::min)
        };
        let last_m = (LAST_TIMES * least(|scene| scene.letters.cap_height_m)).max(LEAST_M);
        let speed_m_s = SPEED_TIMES * least(|scene| scene.plan.stroke_speed_m_s);
        let words: Vec<_> = self.words.iter().map(|(word, _)| (word.clone(), n_seeds)).collect();
        let rungs = (0..RUNGS).map(|rung| {
            // Each rung has different seeds, so that rungs are independent.
            let (seed, words) = (self.seed ^ u64::from(rung + 1) << 40, words.clone());
            let mut study = Self { seed, words, ..self.clone() };
            let cap_height_m = last_m * libm::exp2(OCTAVES_PER_RUNG * f64::from(RUNGS - 1 - rung));
            for scene in study.contenders.iter_mut().map(|named| &mut named.scene) {
                shrink(scene, cap_height_m, speed_m_s);
                narrow_lamp(scene, LAMP_TIMES * last_m);
            }
            study.check().map(|()| study)
        });
        rungs.collect()
    }
}

/// Scales a scene's letters to a cap height, and sets the speed and the sharpness of their strokes.
fn shrink(scene: &mut Scene, cap_height_m: f64, speed_m_s: f64) {
    let letters = &mut scene.letters;
    let scale = cap_height_m / letters.cap_height_m;
    let gaps = [&mut letters.width_m, &mut letters.gap_m, &mut letters.line_gap_m];
    for length_m in gaps.into_iter().flatten().chain([&mut letters.spacing_m]) {
        *length_m *= scale;
    }
    letters.width_m = letters.width_m.map(|width_m| width_m.max(LEAST_BOX_M));
    (letters.cap_height_m, letters.canvas_m) = (cap_height_m, None);
    scene.plan.stroke_speed_m_s = speed_m_s;
    if let Style::Even(even) = &mut scene.plan.style {
        even.acceleration_m_s2 = (ACCELERATION_TIMES * even.acceleration_m_s2).min(MOST_M_S2);
        even.jerk_m_s3 = (ACCELERATION_TIMES * even.jerk_m_s3).min(MOST_M_S3);
        even.corner_error_m = even.corner_error_m.min(CORNER_TIMES * cap_height_m);
    }
}

/// Replaces a scene's lamps by one headlight without lateral offset, and resets the lights of the
/// plan and the letters, and the camera's framing, metering, focus and shutter.
fn narrow_lamp(scene: &mut Scene, diameter_m: f64) {
    let headlight = Deck::LedRing.fixtures().swap_remove(0);
    let [x, _, z] = headlight.position_body_m;
    let lamp = Fixture { position_body_m: [x, 0.0, z], diameter_m, ..headlight };
    scene.plan.lights = vec![Deck::LedRing.channel().to_owned()];
    (scene.light.fixtures, scene.light.letters_wrgb) = (Some(vec![lamp]), Vec::new());
    scene.camera = CameraOptions {
        framing: Framing::default(),
        metering: Metering::default(),
        focus_m: None,
        shutter_open_s: 0.0,
        shutter_close_s: None,
        ..scene.camera.clone()
    };
}

/// Flies each rung of a [`Study::ladder`] as [`evaluate`] does, and returns the records by rung.
/// `prepared` contains the results of [`Study::prepare`] by rung. Calls `done` with the number of
/// finished flights on all rungs. Returns the errors of [`evaluate`].
pub fn fly_ladder(
    ladder: &[Study],
    prepared: &[Vec<Prepared>],
    store: Option<&Store>,
    done: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Vec<Record>>> {
    // The rungs are flown in turn.
    let (mut n_done, stop) = (0, Stop::default());
    let rungs = ladder.iter().zip(prepared).map(|(study, prepared)| {
        let trials: Vec<_> = study.trials().collect();
        let records = evaluate(study, prepared, &trials, store, &stop, &|n| done(n_done + n))?;
        n_done += records.len();
        Ok(records)
    });
    rungs.collect()
}

/// Returns the limits of the contenders, given the records of each rung of a [`Study::ladder`].
pub fn acuity(ladder: &[Study], records: &[Vec<Record>]) -> Acuity {
    // The rungs become strata of a single study, whose records are sorted by contender.
    let contenders = &ladder[0].contenders;
    let mut by_contender = records.concat();
    by_contender.sort_by_key(|record| contenders.iter().position(|c| c.name == record.contender));
    for Outcome { probability, similarity, .. } in by_contender.iter_mut().map(|r| &mut r.outcome) {
        *probability = similarity.clamp(0.0, 1.0);
    }
    let n_each = |study: &Study| study.words.iter().map(|(_, n)| n).sum();
    let words = ladder.iter().map(|study| (String::new(), n_each(study))).collect();
    let ranking = rank(&Study { words, ..ladder[0].clone() }, &by_contender);
    let limits = ranking.measures.iter().map(|measures| {
        let rungs = ladder.iter().zip(records).map(|(study, records)| {
            let flown = records.iter().filter(|record| record.contender == measures.contender);
            Rung {
                cap_height_m: study.contenders[0].scene.letters.cap_height_m,
                letters_read: mean(flown.map(|record| record.outcome.similarity)),
            }
        });
        let rungs: Vec<Rung> = rungs.collect();
        HeightLimit {
            contender: measures.contender.clone(),
            place: measures.place,
            n_flights: measures.n_flights,
            cap_height_m: limit_m(rungs[0].cap_height_m, measures.legibility),
            rungs,
        }
    });
    Acuity { limits: limits.collect(), pairs: ranking.pairs }
}

/// Returns the limit by Spearman and Kärber. `read` is the fraction of letters read over n rungs,
/// so the first `n · read` rungs count as read. The limit is half a rung below the last of these.
fn limit_m(first_rung_m: f64, read: Estimate) -> Estimate {
    // The more is read, the smaller the letters, so the ends of the interval are exchanged.
    let [value, low, high] = [read.value, read.high, read.low].map(|fraction| {
        first_rung_m * libm::exp2(OCTAVES_PER_RUNG * (0.5 - fraction * f64::from(RUNGS)))
    });
    Estimate { value, low, high }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Conditions;
    use noctograph_pipeline::scene::{NamedScene, Preset};

    fn study(n: u32) -> Study {
        let contenders = ["a", "b"].map(|name| NamedScene::new(name, Scene::preset(Preset::Cf21)));
        let words = vec![("NO".to_owned(), n), ("I".to_owned(), n)];
        Study { contenders: contenders.into(), words, conditions: Conditions::still(), seed: 1 }
    }

    /// Returns records of contenders whose probability of being read falls smoothly around a limit.
    fn records(study: &Study, limits_m: [f64; 2]) -> Vec<Record> {
        let records = study.trials().map(|trial| {
            let cap_height_m = study.contenders[trial.contender].scene.letters.cap_height_m;
            let octaves = libm::log2(cap_height_m / limits_m[trial.contender]);
            let shift = 0.2 * ((trial.seed % 8) as f64 / 7.0 - 0.5);
            let similarity = 1.0 / (1.0 + libm::exp(-6.0 * (octaves + shift)));
            Record {
                scene: String::new(),
                contender: study.contenders[trial.contender].name.clone(),
                word: study.words[trial.word].0.clone(),
                seed: trial.seed,
                outcome: Outcome { similarity, ..Outcome::example(0.5) },
            }
        });
        records.collect()
    }

    #[test]
    fn limits_are_those_of_the_contenders_and_are_told_apart() {
        let ladder = study(4).ladder(4).unwrap();
        let records: Vec<_> = ladder.iter().map(|rung| records(rung, [0.05, 0.04])).collect();
        let acuity = acuity(&ladder, &records);
        let names: Vec<&str> = acuity.limits.iter().map(|limit| &*limit.contender).collect();
        assert_eq!(names, ["b", "a"], "the smallest letters first");
        for (limit, wanted_m) in acuity.limits.iter().zip([0.04, 0.05]) {
            let Estimate { value, low, high } = limit.cap_height_m;
            assert!((value / wanted_m - 1.0).abs() < 0.04, "{limit:?}");
            assert!(low < value && value < high && high < 1.1 * low, "{limit:?}");
            assert!(limit.rungs[0].letters_read > 0.95 && limit.rungs[6].letters_read < 0.05);
        }
        assert!(acuity.pairs[0].distinguishable, "{acuity:?}");
    }

    #[test]
    fn intervals_of_limits_hold_them() {
        let held = (1..=50_u64).map(|seed| {
            let ladder = Study { seed, ..study(4) }.ladder(4).unwrap();
            let records: Vec<_> = ladder.iter().map(|rung| records(rung, [0.05, 0.04])).collect();
            let limits = acuity(&ladder, &records).limits.into_iter();
            let held = limits.filter(|limit| {
                let wanted_m = if limit.contender == "a" { 0.05 } else { 0.04 };
                let Estimate { low, high, .. } = limit.cap_height_m;
                (low..=high).contains(&wanted_m)
            });
            held.count()
        });
        let held: usize = held.sum();
        assert!((88..=100).contains(&held), "{held} of 100");
    }

    #[test]
    fn rungs_share_nothing_but_their_contenders() {
        let ladder = study(2).ladder(2).unwrap();
        let wanted_m = [0.16, 0.1131, 0.08, 0.0566, 0.04, 0.0283, 0.02];
        for (study, wanted_m) in ladder.iter().zip(wanted_m) {
            let Scene { letters, plan, light, .. } = &study.contenders[1].scene;
            assert!((letters.cap_height_m - wanted_m).abs() < 1e-4, "{letters:?}");
            let Style::Even(even) = &plan.style else { panic!("{plan:?}") };
            assert_eq!(
                (plan.stroke_speed_m_s, even.acceleration_m_s2, even.jerk_m_s3),
                (0.1, 8.0, 120.0)
            );
            assert!((even.corner_error_m - 0.02 * letters.cap_height_m).abs() < 1e-9);
            let lamps = light.fixtures();
            assert!(lamps.len() == 1 && (lamps[0].diameter_m - 0.003).abs() < 1e-9, "{lamps:?}");
        }
        let mut seeds: Vec<u64> =
            ladder.iter().flat_map(|study| study.trials().map(|trial| trial.seed)).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 7 * 2 * 2, "seeds of rungs and words differ; contenders share");
    }

    #[test]
    fn letters_of_boxes_keep_their_proportions_and_none_is_smaller_than_scenes_allow() {
        let mut study = study(1);
        let letters = &mut study.contenders[0].scene.letters;
        (letters.cap_height_m, letters.width_m, letters.gap_m) = (0.2, Some(0.1), Some(0.04));
        let ladder = study.ladder(1).unwrap();
        let letters = &ladder[6].contenders[0].scene.letters;
        assert_eq!((letters.cap_height_m, letters.canvas_m), (0.02, None), "{letters:?}");
        assert_eq!((letters.width_m, letters.gap_m), (Some(0.01), Some(0.004)), "{letters:?}");
    }
}
