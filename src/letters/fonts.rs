//! Fonts: the font of a text, and the substitutes for letters that it lacks.
//!
//! A line is split into parts of one font each, which are put in visual order (Unicode Standard
//! Annex 9). For example, a Hebrew name in a line of Latin letters runs from right to left.

use std::ops::Range;

use super::font::Font;
use super::options::LetterOptions;
use super::shaping::{is_mark, visual_runs};
use noctograph_core::error::Result;

/// Font of a text, followed by its substitutes.
pub(super) struct Fonts(Vec<Font>);

/// A part of a line in one font, as a range of bytes.
pub(super) type Part<'a> = (&'a Font, Range<usize>);

impl Fonts {
    /// Opens the font of the options and its substitutes.
    pub(super) fn open(options: &LetterOptions) -> Result<Self> {
        let names = std::iter::once(&options.font).chain(&options.fallback);
        Ok(Self(names.map(|name| Font::open(name, options.trace)).collect::<Result<_>>()?))
    }

    /// Returns the main font of the options.
    pub(super) fn main(&self) -> &Font {
        &self.0[0]
    }

    /// Checks that the characters so far were drawn within the budgets of the faces.
    pub(super) fn check_work(&self) -> Result<()> {
        self.0.iter().try_for_each(Font::check_work)
    }

    /// Returns the length, in cap heights, of a stroke lost in tracing a character, or `None` if
    /// none was lost.
    pub(super) fn lost_length(&self, character: char) -> Option<f64> {
        let shape = self.0.iter().find(|font| font.face.has(character))?.face.shape(character)?;
        Some(shape.lost_length).filter(|length| *length > 0.0)
    }

    /// Splits a line into parts of one font each, in reading order, as ranges of bytes. A character
    /// gets the first font that draws it, or the main font if none does.
    pub(super) fn parts(&self, line: &str) -> Vec<Part<'_>> {
        let mut parts: Vec<(usize, Range<usize>)> = Vec::new();
        for (start, character) in line.char_indices() {
            let end = start + character.len_utf8();
            let mut fonts = self.0.iter();
            let chosen =
                fonts.position(|font| character != ' ' && font.draws(character)).unwrap_or(0);
            match parts.last_mut() {
                // Spaces, marks and symbols are grouped with the letter before them.
                Some((font, part))
                    if character == ' '
                        || is_mark(character)
                        || !character.is_alphabetic() && self.0[*font].face.has(character)
                        || *font == chosen =>
                {
                    part.end = end;
                }
                // Spaces at the start are grouped with the first letter.
                Some((font, part)) if line[part.clone()].trim().is_empty() => {
                    (*font, part.end) = (chosen, end);
                }
                _ => parts.push((chosen, start..end)),
            }
        }
        parts.into_iter().map(|(font, part)| (&self.0[font], part)).collect()
    }

    /// Returns the parts of a line from left to right, each with true if it is read from right to
    /// left.
    pub(super) fn in_visual_order(&self, line: &str) -> Vec<(Part<'_>, bool)> {
        let parts = self.parts(line);
        let mut ordered = Vec::new();
        for (run, leftward) in visual_runs(line) {
            // The run's parts are in reading order, and are reversed if the run goes from right to
            // left.
            let parts_in_run = parts.iter().filter_map(|(font, part)| {
                let overlap = part.start.max(run.start)..part.end.min(run.end);
                (overlap.start < overlap.end).then_some(((*font, overlap), leftward))
            });
            let begin = ordered.len();
            ordered.extend(parts_in_run);
            if leftward {
                ordered[begin..].reverse();
            }
        }
        ordered
    }
}

#[cfg(test)]
mod tests {
    use super::super::face_tests::small_face;
    use super::super::layout::write;
    use super::*;
    use crate::Strokes;

    #[test]
    fn letters_that_a_font_lacks_are_those_of_the_next_one_in_their_direction() {
        let folder = tempfile::tempdir().unwrap();
        let hebrew = folder.path().join("small.ttf");
        std::fs::write(&hebrew, small_face()).unwrap();
        let fallback = vec!["simplex".to_owned(), hebrew.display().to_string()];
        let options = LetterOptions { fallback, ..LetterOptions::default() };
        let set = |word: &str| write(word, &options).unwrap();
        fn drawn(strokes: &Strokes) -> String {
            strokes.glyphs.iter().map(|glyph| glyph.character).collect::<String>()
        }
        let cases = [
            ("noor", "NOOR"),
            ("NO Я", "NOЯ"),
            // The name runs from right to left in its position, and a space separates it from Latin
            // letters.
            ("NO \u{5d0}\u{5e8} I", "NO\u{5e8}\u{5d0}I"),
            ("\u{5d0}\u{5e8} NO", "NO\u{5e8}\u{5d0}"),
            ("\u{5d0}\u{5e8}", "\u{5e8}\u{5d0}"),
        ];
        for (word, wanted) in cases {
            let strokes = set(word);
            assert_eq!(drawn(&strokes), wanted, "{word}");
            let cells = strokes.glyphs.windows(2).map(|pair| [pair[0].cell, pair[1].cell]);
            for [cell, next] in cells {
                assert!(cell.left_m + cell.width_m < next.left_m + 1e-9, "{word}: {cell:?}");
            }
        }
        let alone = write("NO", &LetterOptions::default()).unwrap();
        assert_eq!(set("NO"), alone, "a font that has all letters is alone");
        let glyph = |strokes: &Strokes| {
            let glyph = &strokes.glyphs[0];
            glyph.moves.iter().map(|step| step.from_m[0] - glyph.cell.left_m).collect::<Vec<_>>()
        };
        let moved = |[a, b]: [Vec<f64>; 2]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(moved([glyph(&set("NЯ")), glyph(&alone)]), "N is the team's");
        let told = write("NO\u{6f22}", &options).unwrap_err();
        assert!(told.to_string().contains("position 3"), "{told}");
        assert!(told.hint().contains("letters.fallback"), "{}", told.hint());
        let unknown = LetterOptions { fallback: vec!["comic".into()], ..options };
        assert!(write("NO", &unknown).unwrap_err().to_string().contains("letters.fallback"));
    }
}
