//! Checks of letters: doubled strokes, lit tails, light that is never off, jumps.

use nalgebra::Vector2;

use super::{Check, Finding, Severity};
use crate::geometry::distance;
use crate::letters::{Glyph, Move, Strokes};
use crate::plan::Style;

/// Two lit moves nearer to each other than this, and as parallel, draw one line.
const SAME_LINE_M: f64 = 0.002;
/// Longest doubled stroke and jump that are no fault.
const SHORT_M: f64 = 0.02;

/// Checks the letters of a drawing. The beginning and end of the light matter only where the plan
/// follows the letters' own moves, as in style `team`.
#[must_use]
pub fn check_letters(strokes: &Strokes, style: &Style) -> Vec<Finding> {
    let yes = |fault: fn(&Glyph) -> bool| move |glyph: &Glyph| if fault(glyph) { 1.0 } else { 0.0 };
    let mut findings =
        vec![finding(Check::DoubledStroke, strokes, SHORT_M, |glyph| doubled_m(&glyph.moves))];
    if let Some(font) = &strokes.font {
        let lost_m = |glyph: &Glyph| font.lost(glyph.character) * glyph.cell.cap_height_m;
        findings.push(finding(Check::LostStroke, strokes, 0.0, lost_m));
    }
    if matches!(style, Style::Team(_)) {
        findings.push(finding(Check::Tail, strokes, 0.0, yes(has_tail)));
        findings.push(finding(Check::LightNeverOff, strokes, 0.0, yes(never_off)));
        findings.push(finding(Check::PenJump, strokes, 0.0, yes(jumps)));
    }
    findings
}

/// The letters whose value is above a limit.
fn finding(check: Check, strokes: &Strokes, limit: f64, value: impl Fn(&Glyph) -> f64) -> Finding {
    let values = strokes.glyphs.iter().map(|glyph| (glyph.character, value(glyph)));
    let mut faulty: Vec<(char, f64)> = values.filter(|(_, value)| *value > limit).collect();
    faulty.sort_by_key(|(character, _)| *character);
    faulty.dedup_by_key(|(character, _)| *character);
    let letters: Vec<String> = faulty.iter().map(|(character, _)| character.to_string()).collect();
    let largest = faulty.iter().map(|(_, value)| *value).fold(0.0, f64::max);
    let finding = Finding::new(check, faulty.is_empty(), Severity::Warning, largest, limit);
    Finding { detail: letters.join(", "), ..finding }
}

/// The light is on before the drone has reached the letter.
fn has_tail(glyph: &Glyph) -> bool {
    glyph.moves.first().is_some_and(|first| first.lit)
}

/// The light is on at both ends of the letter.
fn never_off(glyph: &Glyph) -> bool {
    has_tail(glyph) && glyph.moves.last().is_some_and(|last| last.lit)
}

fn jumps(glyph: &Glyph) -> bool {
    glyph.moves.windows(2).any(|pair| distance(pair[0].to_m, pair[1].from_m) > SHORT_M)
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

/// Length that two straight moves have in common.
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

    fn faults(word: &str, font: &str, plan: PlanOptions) -> Vec<(Check, String)> {
        let options = LetterOptions { font: font.into(), ..LetterOptions::default() };
        let findings = check_letters(&write(word, &options).unwrap(), &plan.style);
        let bad = findings.into_iter().filter(|f| f.severity != Severity::Fine);
        bad.map(|f| (f.check, f.detail)).collect()
    }

    #[test]
    fn faults_of_the_teams_letters_are_found_and_the_repaired_ones_have_none() {
        let team = |word, font| faults(word, font, PlanOptions::default());
        assert_eq!(team("W", "ae483"), [(Check::DoubledStroke, "W".into())]);
        let x = [(Check::Tail, "X".into()), (Check::LightNeverOff, "X".into())];
        assert_eq!(team("X", "ae483"), x);
        assert!(team("I", "ae483").contains(&(Check::PenJump, "I".into())));
        let all = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789";
        assert_eq!(team(all, "ae483-fixed"), []);
    }

    #[test]
    fn in_style_even_only_doubled_strokes_are_faults() {
        assert_eq!(faults("XNO", "ae483", PlanOptions::even()), []);
        assert_eq!(faults("W", "ae483", PlanOptions::even()).len(), 1);
    }
}
