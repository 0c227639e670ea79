//! Checks letters for doubled strokes, lit tails, permanent light, and jumps.

use nalgebra::Vector2;

use super::warn_if;
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::geometry::distance;
use noctograph_letters::{DRAWING, Glyph, Move, Strokes};
use noctograph_plan::Style;

/// Maximum distance between two lit moves that count as one line drawn twice.
const SAME_LINE_M: f64 = 0.002;
/// Maximum length of a doubled stroke or of a pen jump that causes no warning.
const SHORT_M: f64 = 0.02;

/// Checks the letters for strokes that are drawn twice or lost. Light at the beginning and end of a
/// letter only matters in the `team` style, whose plan follows the dark moves.
pub(super) fn check_letters(strokes: &Strokes, style: &Style) -> Vec<Diagnostic> {
    // The glyphs are sorted, so that equal letters are adjacent and each is reported only once.
    let mut glyphs: Vec<&Glyph> = strokes.glyphs.iter().collect();
    glyphs.sort_by_key(|glyph| glyph.character);
    let mut findings = vec![check_lengths(
        "doubled stroke",
        glyphs.iter().map(|glyph| (glyph.character, doubled_m(&glyph.moves))),
        SHORT_M,
        "every line is drawn once",
        match strokes.font {
            Some(_) => "write with {letters.font=ae483-fixed} or simplex",
            None => "leave out one of the overlapping lines of the drawing",
        },
    )];
    if strokes.font.is_some() {
        findings.push(check_lengths(
            "lost stroke",
            glyphs.iter().map(|glyph| {
                let lost_h = strokes.lost.get(&glyph.character).copied().unwrap_or(0.0);
                (glyph.character, lost_h * glyph.cell.cap_height_m)
            }),
            0.0,
            "every stroke of the typeface is drawn",
            "write with {letters.font=simplex} or a plainer typeface",
        ));
    }
    if matches!(style, Style::Team(_)) {
        for (check, is_faulty, wanted) in FAULTS {
            let faulty = glyphs.iter().filter(|glyph| is_faulty(glyph));
            let mut faulty: Vec<char> = faulty.map(|glyph| glyph.character).collect();
            faulty.dedup();
            let (is_bad, detail) = (!faulty.is_empty(), named(faulty));
            let actual = if is_bad { detail.clone() } else { "none".to_owned() };
            // Style `even` also helps, because its plan does not follow the dark moves.
            let advice = "write with {letters.font=ae483-fixed}, or plan with {plan.style=even}";
            let row = Diagnostic::check(check, warn_if(is_bad), f64::from(is_bad));
            findings.push(row.detailed(detail).say(actual, wanted, advice));
        }
    }
    findings
}

/// Fault of a font: the name of its check, a test for a letter, and the desired state.
type Fault = (&'static str, fn(&Glyph) -> bool, &'static str);

const FAULTS: [Fault; 3] = [
    ("tail", has_tail, "letters reached in the dark"),
    ("light never off", never_off, "letters that begin or end in the dark"),
    ("pen jump", jumps, "moves that begin where the last one ended"),
];

/// Returns true if the light is on before the drone has reached the letter.
fn has_tail(glyph: &Glyph) -> bool {
    glyph.moves.first().is_some_and(|first| first.lit)
}

/// Returns true if the light is on at both ends of the letter.
fn never_off(glyph: &Glyph) -> bool {
    has_tail(glyph) && glyph.moves.last().is_some_and(|last| last.lit)
}

/// Returns true if a move does not begin at the end of the previous one.
fn jumps(glyph: &Glyph) -> bool {
    glyph.moves.windows(2).any(|pair| distance(pair[0].to_m, pair[1].from_m) > SHORT_M)
}

/// Returns the total length in m of the parts of strokes that are lit twice.
fn doubled_m(moves: &[Move]) -> f64 {
    let lit: Vec<[Vector2<f64>; 2]> = moves
        .iter()
        .filter(|step| step.lit && step.from_m != step.to_m)
        .map(|step| [step.from_m.into(), step.to_m.into()])
        .collect();
    let pairs = lit.iter().enumerate().flat_map(|(i, a)| lit[i + 1..].iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| shared_m(a, b)).sum()
}

/// Returns the length in m of the overlap of two straight moves, each given by its two ends, or 0
/// if they are not on one line.
fn shared_m(a: &[Vector2<f64>; 2], b: &[Vector2<f64>; 2]) -> f64 {
    let length_m = (a[1] - a[0]).norm();
    let direction = (a[1] - a[0]) / length_m;
    if b.iter().any(|point| (point - a[0]).perp(&direction).abs() > SAME_LINE_M) {
        return 0.0;
    }
    // The second move is projected onto the first and clipped at its ends.
    let [from, to] =
        [&b[0], &b[1]].map(|point| (point - a[0]).dot(&direction).clamp(0.0, length_m));
    (to - from).abs()
}

/// Checks that a length in m measured in each letter is at most `limit_m`. The finding names the
/// letters beyond it.
fn check_lengths(
    check: &'static str,
    lengths_m: impl Iterator<Item = (char, f64)>,
    limit_m: f64,
    wanted: &str,
    advice: &'static str,
) -> Diagnostic {
    let mut longer: Vec<_> = lengths_m.filter(|(_, length_m)| *length_m > limit_m).collect();
    longer.dedup_by_key(|(character, _)| *character);
    let most_m = longer.iter().map(|(_, length_m)| *length_m).fold(0.0, f64::max);
    let detail = named(longer.iter().map(|(letter, _)| *letter));
    let actual = match longer.len() {
        0 => "none".to_owned(),
        1 => format!("{detail} ({most_m:.2} m)"),
        _ => format!("{detail} (up to {most_m:.2} m)"),
    };
    let row = Diagnostic::check(check, warn_if(!longer.is_empty()), most_m).within(limit_m);
    row.detailed(detail).say(actual, wanted, advice)
}

/// Returns a list of letters separated by commas, in which a drawing is called so.
fn named(letters: impl IntoIterator<Item = char>) -> String {
    let names = letters.into_iter().map(|letter| match letter {
        DRAWING => "the drawing".to_owned(),
        letter => letter.to_string(),
    });
    names.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::super::Severity;
    use super::*;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::PlanOptions;

    fn faults(word: &str, font: &str, plan: PlanOptions) -> Vec<(&'static str, String)> {
        let options = LetterOptions { font: font.into(), ..LetterOptions::default() };
        let findings = check_letters(&write(word, &options).unwrap(), &plan.style);
        let bad = findings.into_iter().filter(|row| row.severity != Severity::Fine);
        bad.map(|row| (row.code, row.detail().to_owned())).collect()
    }

    #[test]
    fn faults_of_the_teams_letters_are_found_and_the_repaired_ones_have_none() {
        let team = |word, font| faults(word, font, PlanOptions::default());
        assert_eq!(team("W", "ae483"), [("doubled stroke", "W".into())]);
        assert_eq!(team("X", "ae483"), [("tail", "X".into()), ("light never off", "X".into())]);
        assert!(team("I", "ae483").contains(&("pen jump", "I".into())));
        assert_eq!(team("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789", "ae483-fixed"), []);
    }

    #[test]
    fn in_style_even_only_doubled_strokes_are_faults() {
        assert_eq!(faults("XNO", "ae483", PlanOptions::even()), []);
        assert_eq!(faults("W", "ae483", PlanOptions::even()).len(), 1);
    }
}
