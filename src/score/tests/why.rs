//! Tests of fault diagnosis: faults are named and measured, and correcting them restores the lost
//! probability.

use super::studio::{Shot, word};
use super::*;
use noctograph_core::strokes::Move;
use noctograph_letters::{LetterOptions, write};

fn explained(shot: &Shot, strokes: &Strokes) -> Verdict {
    shot.explained(strokes, &Known { speed_m_s: Some(0.2), ..Known::default() })
}

#[test]
fn a_clean_word_has_nothing_to_explain() {
    let noor = word("NOOR");
    let verdict = explained(&Shot::new(&noor), &noor);
    assert!(verdict.causes.is_empty() && verdict.advice.is_empty(), "{verdict:#?}");
    for letter in &verdict.letters {
        assert!(letter.recall > Some(0.99) && letter.precision > Some(0.99), "{letter:?}");
        assert_eq!(letter.confusion[0].letter, letter.expected);
    }
}

#[test]
fn the_explained_verdict_is_the_quick_one() {
    let noor = word("NOOR");
    let shot = Shot::new(&noor).trailing(0.08).ending_early(0.1);
    let (quick, why) = (shot.verdict(&noor), explained(&shot, &noor));
    assert_eq!((quick.read, quick.readability), (why.read, why.readability));
}

#[test]
fn an_early_end_is_measured_and_its_mending_gains() {
    let noor = word("NOOR");
    let verdict = explained(&Shot::new(&noor).ending_early(0.25), &noor);
    let first_o = verdict
        .causes
        .iter()
        .find(|cause| cause.kind == CauseKind::MissingRun && cause.letter == Some(1));
    let first_o = first_o.expect("the bottom of the O ends early");
    // The pen's width and the tolerance of 5 cm hide part of the missing 25 cm.
    let run = first_o.missing.unwrap();
    assert!((150.0..=260.0).contains(&(run.to_mm - run.from_mm)), "{run:?}");
    assert!((run.to_mm - 1600.0).abs() < 60.0, "the end of the square's 1.6 m: {run:?}");
    // The O is read despite its fault, but the R is not read without its leg.
    let is_leg = |cause: &&Cause| cause.kind == CauseKind::MissingRun && cause.letter == Some(3);
    let leg = verdict.causes.iter().find(is_leg).expect("the leg of the R ends early");
    assert!(leg.gain > Some(0.5), "{leg:?}");
    for advice in &verdict.advice {
        assert!(advice.gain.is_none_or(|gain| gain > 0.0), "{:?}", verdict.advice);
    }
}

#[test]
fn light_between_strokes_is_a_transit_with_its_lamp_delay() {
    let strokes = word("NET");
    let mut shot = Shot::new(&strokes);
    let e = &strokes.glyphs[1].moves;
    shot.moves.iter_mut().filter(|step| e.contains(step)).for_each(|step| step.lit = true);
    let verdict = explained(&shot, &strokes);
    let transits: Vec<&Cause> = verdict
        .causes
        .iter()
        .filter(|cause| cause.kind == CauseKind::LitTransit && cause.letter == Some(1))
        .collect();
    assert!(!transits.is_empty(), "{:#?}", verdict.causes);
    let cause = transits[0];
    let delay_s = cause.length_mm.unwrap() / 1000.0 / 0.2;
    assert!((cause.lamp_delay_s.unwrap() - delay_s).abs() < 1e-9, "{cause:?}");
}

#[test]
fn a_shifted_letter_and_a_tail_are_named() {
    let noor = word("NOOR");
    let mut shot = Shot::new(&noor);
    let second_o = &noor.glyphs[2].moves;
    for step in shot.moves.iter_mut().filter(|step| second_o.contains(step)) {
        for point in [&mut step.from_m, &mut step.to_m] {
            point[1] += 0.1;
        }
    }
    shot.moves.insert(0, Move { from_m: [-0.6, 0.3], to_m: [-0.6, 0.5], lit: true, pace: 1.0 });
    let verdict = explained(&shot, &noor);
    let letter_of = |kind| verdict.causes.iter().find(|cause| cause.kind == kind).map(|c| c.letter);
    assert_eq!(letter_of(CauseKind::Shifted), Some(Some(2)), "{:#?}", verdict.causes);
    assert_eq!(letter_of(CauseKind::Streak), Some(Some(0)), "{:#?}", verdict.causes);
}

#[test]
fn a_letter_drawn_as_another_one_is_a_flaw_of_design() {
    let options = LetterOptions { font: "ae483-fixed".into(), ..Default::default() };
    for (character, flawed) in [('T', None), ('H', Some((Some(1), Some('T'))))] {
        let mut strokes = write("NTE", &options).unwrap();
        strokes.edit(|strokes| strokes.glyphs[1].character = character);
        let verdict = explained(&Shot::new(&strokes), &strokes);
        let design = verdict.causes.iter().find(|cause| cause.kind == CauseKind::Design);
        let actual = design.map(|cause| (cause.letter, cause.reads_as));
        assert_eq!(actual, flawed, "{character}: {:#?}", verdict.causes);
    }
}

#[test]
fn a_letter_read_as_one_that_its_drawing_resembles_is_a_flaw_of_design() {
    // The J of the reference team's font has only a small hook.
    for (font, flawed) in [("ae483", Some((Some(1), Some('T')))), ("simplex", None)] {
        let options = LetterOptions { font: font.into(), ..Default::default() };
        let [nje, shown] = ["NJE", "NTE"].map(|text| write(text, &options).unwrap());
        let verdict = explained(&Shot::new(&shown), &nje);
        assert_eq!(verdict.letters[1].best, Some('T'), "{font}");
        let design = verdict.causes.iter().find(|cause| cause.kind == CauseKind::Design);
        let actual = design.map(|cause| (cause.letter, cause.reads_as));
        assert_eq!(actual, flawed, "{font}: {:#?}", verdict.causes);
    }
}

/// The log has a gap while the drone flies the leg of the R, which ends early. Without a gap, or
/// with a gap elsewhere, the missing leg is blamed on the lamp.
#[test]
fn light_that_the_log_lost_is_not_blamed_on_the_lamp() {
    let noor = word("NOOR");
    let shot = Shot::new(&noor).ending_early(0.25);
    let explained = |gaps: Vec<LogGap>| {
        shot.explained(&noor, &Known { lag_s: Some(0.5), gaps, ..Known::default() })
    };
    let of_r = |verdict: &Verdict| {
        let causes = verdict.causes.iter().filter(|cause| cause.letter == Some(3));
        let missing = causes.filter(|cause| cause.missing.is_some()).cloned();
        missing.collect::<Vec<_>>()
    };
    let [leg] = &of_r(&explained(Vec::new()))[..] else { panic!("one part of the R is missing") };
    assert_eq!((leg.kind, leg.log_gap_s), (CauseKind::MissingRun, None));
    let [x_m, y_m] = leg.at_m.unwrap();
    let gap = |up_m: f64| LogGap {
        span_s: [37.61, 38.15],
        ends_m: [[x_m - 0.1, y_m + up_m], [x_m + 0.1, y_m + up_m]],
        way_m: 0.4,
    };
    let lost = explained(vec![gap(0.0)]);
    let [leg] = &of_r(&lost)[..] else { panic!("the same part is missing") };
    assert_eq!((leg.kind, leg.log_gap_s), (CauseKind::LogGap, Some([37.61, 38.15])));
    fn text(verdict: &Verdict, kind: CauseKind) -> Option<(String, Option<f64>)> {
        let advice = verdict.advice.iter().find(|advice| advice.kind == kind);
        advice.map(|advice| (advice.text.clone(), advice.gain))
    }
    let (said, gain) = text(&lost, CauseKind::LogGap).unwrap();
    assert!(said.contains("R (4)") && said.contains("37.61 to 38.15 s"), "{said}");
    assert!(gain > Some(0.0));
    let lamps = text(&lost, CauseKind::MissingRun).map(|(text, _)| text).unwrap_or_default();
    assert!(!lamps.contains("R (4)"), "{lamps}");
    let elsewhere = explained(vec![gap(0.5)]);
    assert_eq!(of_r(&elsewhere)[0].kind, CauseKind::MissingRun, "a gap half a meter away");
}

#[test]
fn gaps_of_a_log_are_read_back_and_foreign_text_is_refused() {
    let gaps =
        vec![LogGap { span_s: [0.1, 0.75], ends_m: [[0.1, -0.2], [0.3, 1.0 / 3.0]], way_m: 0.3 }];
    let json = serde_json::to_string(&gaps).unwrap();
    assert_eq!(LogGap::parse(&json, "photo.png").unwrap(), gaps);
    for foreign in ["", "{}", "[1]", "[{\"span_s\": [0, 1]}]", "[{\"span_s\": [0, 1e999]}]"] {
        let error = LogGap::parse(foreign, "photo.png (log gaps)").unwrap_err().to_string();
        assert!(error.starts_with("photo.png (log gaps): "), "{error}");
    }
}

/// A lagging drone cuts corners, which is not a fault. A corner lost in a log gap is a fault.
#[test]
fn a_corner_that_the_log_lost_is_not_one_that_was_cut() {
    let noor = word("NOOR");
    let mut shot = Shot::new(&noor);
    let o: Vec<Move> = noor.glyphs[1].moves.iter().copied().filter(|step| step.lit).collect();
    let (before, after) = (o[1], o[2]);
    let corner_m = before.to_m;
    assert_eq!(corner_m, after.from_m, "a corner of the square letter");
    fn short(from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
        let share = 1.0 - 0.07 / libm::hypot(to[0] - from[0], to[1] - from[1]);
        [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]))
    }
    for step in &mut shot.moves {
        if *step == before {
            step.to_m = short(before.from_m, before.to_m);
        } else if *step == after {
            step.from_m = short(after.to_m, after.from_m);
        }
    }
    let missing = |gaps: Vec<LogGap>| {
        let verdict = shot.explained(&noor, &Known { gaps, ..Known::default() });
        let missing = verdict.causes.iter().filter(|cause| cause.missing.is_some());
        missing.map(|cause| (cause.kind, cause.letter)).collect::<Vec<_>>()
    };
    assert_eq!(missing(Vec::new()), [], "a cut corner");
    let ends_m = [short(before.from_m, corner_m), short(after.to_m, corner_m)];
    let gap = LogGap { span_s: [21.36, 22.1], ends_m, way_m: 0.2 };
    assert_eq!(missing(vec![gap]), [(CauseKind::LogGap, Some(1))]);
}
