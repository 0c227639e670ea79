//! Faults of letters: light that is never off, jumps, doubled strokes, lit tails.

use nalgebra::Vector2;

use super::{Finding, Severity};
use crate::letters::{Glyph, Move, Strokes};
use crate::plan::Style;

/// Two lit moves nearer to each other than this, and as parallel, paint one line.
const SAME_LINE_M: f64 = 0.002;
/// Less that is drawn twice, or jumped over, is nobody's fault.
const SHORT_M: f64 = 0.02;

/// Looks at the letters of a drawing. How the light begins and ends matters only where the plan
/// follows the letters' own moves, as the reference team's does.
#[must_use]
pub fn check_letters(strokes: &Strokes, style: &Style) -> Vec<Finding> {
    let glyphs = || strokes.glyphs.iter();
    let doubled = glyphs().filter_map(|glyph| {
        let doubled_m = doubled_m(&glyph.moves);
        (doubled_m > SHORT_M).then(|| format!("{} ({doubled_m:.2} m)", glyph.character))
    });
    let fix = "write with font ae483-fixed or simplex";
    let mut findings = vec![finding("doubled stroke", doubled, "every line drawn once", fix)];
    if matches!(style, Style::Team(_)) {
        let named = |fault: fn(&Glyph) -> bool| {
            glyphs().filter(move |glyph| fault(glyph)).map(|glyph| glyph.character.to_string())
        };
        let even = "write with font ae483-fixed, or plan with --style even";
        findings.push(finding("tail", named(has_tail), "letters reached in the dark", even));
        findings.push(finding("light never off", named(never_off), "a dark move at an end", even));
        findings.push(finding("pen jump", named(jumps), "moves that join", even));
    }
    findings
}

fn finding(
    check: &'static str,
    faulty: impl Iterator<Item = String>,
    wanted: &str,
    change: &str,
) -> Finding {
    let mut faulty: Vec<String> = faulty.collect();
    faulty.sort();
    faulty.dedup();
    let found = if faulty.is_empty() { "none".to_owned() } else { faulty.join(", ") };
    let good = faulty.is_empty();
    Finding::new(check, good, Severity::Warning, found, wanted.into()).or(change)
}

/// The light is on before the drone has come to the letter's beginning.
fn has_tail(glyph: &Glyph) -> bool {
    glyph.moves.first().is_some_and(|first| first.lit)
}

/// Nothing in the letter switches the light off, neither before it nor after it.
fn never_off(glyph: &Glyph) -> bool {
    has_tail(glyph) && glyph.moves.last().is_some_and(|last| last.lit)
}

fn jumps(glyph: &Glyph) -> bool {
    glyph
        .moves
        .windows(2)
        .any(|pair| (Vector2::from(pair[1].from_m) - Vector2::from(pair[0].to_m)).norm() > SHORT_M)
}

/// Length that is lit twice.
fn doubled_m(moves: &[Move]) -> f64 {
    let lit: Vec<[Vector2<f64>; 2]> = moves
        .iter()
        .filter(|leg| leg.lit && leg.from_m != leg.to_m)
        .map(|leg| [leg.from_m.into(), leg.to_m.into()])
        .collect();
    let pairs = lit.iter().enumerate().flat_map(|(i, a)| lit[i + 1..].iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| shared_m(a, b)).sum()
}

/// How far two straight moves run on one line.
fn shared_m(a: &[Vector2<f64>; 2], b: &[Vector2<f64>; 2]) -> f64 {
    let length_m = (a[1] - a[0]).norm();
    let along = (a[1] - a[0]) / length_m;
    let beside = |p: &Vector2<f64>| (p - a[0]).perp(&along).abs();
    if b.iter().any(|p| beside(p) > SAME_LINE_M) {
        return 0.0;
    }
    let [from, to] = [&b[0], &b[1]].map(|p| (p - a[0]).dot(&along).clamp(0.0, length_m));
    (to - from).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{LetterOptions, write};
    use crate::plan::PlanOptions;

    fn styles() -> (Style, Style) {
        (Style::default(), PlanOptions::even().style)
    }

    fn faults(word: &str, font: &str, style: &Style) -> Vec<(&'static str, String)> {
        let options = LetterOptions { font: font.into(), ..LetterOptions::default() };
        let findings = check_letters(&write(word, &options).unwrap(), style);
        let bad = findings.into_iter().filter(|f| f.severity != Severity::Fine);
        bad.map(|f| (f.check, f.found)).collect()
    }

    #[test]
    fn the_papers_w_and_x_are_found_and_the_repaired_ones_are_not() {
        let (team, _) = styles();
        assert_eq!(faults("W", "ae483", &team), [("doubled stroke", "W (0.51 m)".into())]);
        let x = faults("X", "ae483", &team);
        assert_eq!(x, [("tail", "X".into()), ("light never off", "X".into())]);
        for word in ["W", "X", "I", "ABCDEFGHIJKLMNOPQRSTUVWXYZ"] {
            assert_eq!(faults(word, "ae483-fixed", &team), [], "{word}");
        }
    }

    #[test]
    fn i_jumps_and_an_even_plan_mends_what_is_no_fault_of_the_drawing() {
        assert!(faults("I", "ae483", &styles().0).contains(&("pen jump", "I".into())));
        assert_eq!(faults("XNO", "ae483", &styles().1), [], "lights and ways are planned anew");
        assert_eq!(faults("W", "ae483", &styles().1).len(), 1, "what is drawn twice is");
    }
}
