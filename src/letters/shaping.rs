//! Shaping: chooses and places glyphs for letters that join, change with their neighbors, carry
//! marks or run from right to left.
//!
//! A line is put in visual order (Unicode Standard Annex 9). Each word of the line is shaped by the
//! rules of the typeface (GSUB and GPOS) for the script of its first letter.

use std::ops::Range;

#[cfg(not(target_family = "wasm"))]
use harfrust::{Buffer, Direction, Font, GlyphId, ShapeOptions, ShaperFont, shape};
use unicode_bidi::BidiInfo;
use unicode_normalization::char::is_combining_mark;

/// Maximum number of points of a character's outline. The time of tracing grows with its square.
pub(super) const MAX_POINTS: usize = 8_000;

/// Unicode blocks of scripts that are shaped, and of characters without width.
const SHAPED: [std::ops::RangeInclusive<char>; 8] = [
    '\u{0590}'..='\u{0DFF}',
    '\u{0E00}'..='\u{109F}',
    '\u{1780}'..='\u{18AF}',
    '\u{1A20}'..='\u{1C7F}',
    '\u{200B}'..='\u{202E}',
    '\u{A800}'..='\u{ABFF}',
    '\u{FB1D}'..='\u{FEFF}',
    '\u{10800}'..='\u{11FFF}',
];
/// Skin tones of emoji.
const SKIN: std::ops::RangeInclusive<char> = '\u{1F3FB}'..='\u{1F3FF}';

/// True if a composed text has characters that must be shaped, not just placed side by side.
pub(super) fn is_shaped(text: &str) -> bool {
    text.chars().any(|c| is_mark(c) || SHAPED.iter().any(|block| block.contains(&c)))
}

/// True for a combining mark or a skin tone, which belongs to the character before it.
pub(super) fn is_mark(character: char) -> bool {
    is_combining_mark(character) || SKIN.contains(&character)
}

/// A glyph of a face, and its position in font units relative to the start of its line.
#[cfg(not(target_family = "wasm"))]
pub(super) struct Placed {
    pub(super) glyph: GlyphId,
    pub(super) units: [i32; 2],
    /// Byte in the line at which the first character of the glyph starts.
    pub(super) byte: usize,
}

/// Reason why a line cannot be set, with the byte of the character at which it fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unset {
    /// The face lacks the character.
    Missing(usize),
    /// The rules of the face expand the rest of the word beyond the shaper's limits.
    Unshaped(usize),
    /// Touching glyphs from there on, whose number is the second value, have too many points as one
    /// outline.
    TooLarge(usize, usize),
}

/// Returns the placed glyphs of a line from left to right, in font units. `space` is the advance
/// between words. The error names the first byte of a part that cannot be shaped.
#[cfg(not(target_family = "wasm"))]
pub(super) fn shape_line(face: &Font, line: &str, space: i32) -> Result<Vec<Placed>, Unset> {
    let face = ShaperFont::new(face);
    let (mut placed, mut pen) = (Vec::new(), 0_i32);
    for (run, leftward) in visual_runs(line) {
        // The words are listed from left to right, each with the index of its first byte.
        let mut next_start = run.start;
        let mut words = Vec::from_iter(line[run].split(' ').map(|word| {
            let start = next_start;
            next_start += word.len() + 1;
            (start, word)
        }));
        if leftward {
            words.reverse();
        }
        for (index, (start, word)) in words.into_iter().enumerate() {
            if index > 0 {
                pen = pen.saturating_add(space);
            }
            let buffer = shape_word(&face, word, leftward).ok_or(Unset::Unshaped(start))?;
            // The shaper also returns the glyphs from left to right.
            for (info, position) in buffer.glyph_infos().iter().zip(buffer.glyph_positions()) {
                let (glyph, byte) = (GlyphId::new(info.glyph_id), start + info.cluster as usize);
                if glyph == GlyphId::NOTDEF {
                    return Err(Unset::Missing(byte));
                }
                let units = [pen.saturating_add(position.x_offset), position.y_offset];
                placed.push(Placed { glyph, units, byte });
                pen = pen.saturating_add(position.x_advance);
            }
        }
    }
    Ok(placed)
}

/// Returns the shaped glyphs of a word, which is read from right to left if `leftward`. Returns
/// `None` if the word exceeds the limits of the shaper.
#[cfg(not(target_family = "wasm"))]
fn shape_word(face: &ShaperFont<'_, '_>, word: &str, leftward: bool) -> Option<Buffer> {
    let mut buffer = Buffer::new();
    buffer.push_str(word);
    buffer.set_direction(if leftward { Direction::RightToLeft } else { Direction::LeftToRight });
    buffer.guess_segment_properties();
    let result = shape(face, &mut buffer, ShapeOptions::new());
    (result.is_ok() && buffer.allocation_successful()).then_some(buffer)
}

/// Returns the runs of a line from left to right, each with true if it is read from right to left.
pub(super) fn visual_runs(line: &str) -> Vec<(Range<usize>, bool)> {
    let info = BidiInfo::new(line, None);
    Vec::from_iter(info.paragraphs.iter().flat_map(|paragraph| {
        let (levels, runs) = info.visual_runs(paragraph, paragraph.range.clone());
        runs.into_iter().map(move |run| (run.clone(), levels[run.start].is_rtl()))
    }))
}

#[cfg(test)]
mod tests {
    use super::super::Trace;
    use super::super::face_tests::small_face;
    use super::super::typeface::Typeface;
    use super::*;

    #[test]
    fn letters_that_join_are_one_stroke_and_run_from_right_to_left() {
        let face = Typeface::read(small_face(), Trace::CenterLine, "small.ttf").unwrap();
        let arabic = face.shape_line("نر", 0.5).unwrap();
        assert_eq!((arabic.len(), arabic[0].byte), (1, 0), "joined");
        assert_eq!(arabic[0].shape.runs.len(), 1, "a stroke through both: {:?}", arabic[0].shape);
        let apart = face.shape_line("ر ن", 0.5).unwrap();
        assert_eq!(apart.iter().map(|letter| letter.byte).collect::<Vec<_>>(), [3, 0], "no joins");
        let hebrew = face.shape_line("אר H", 0.5).unwrap();
        let bytes: Vec<usize> = hebrew.iter().map(|letter| letter.byte).collect();
        assert_eq!(bytes, [5, 2, 0], "the first letter stands on the right");
        assert!(hebrew.windows(2).all(|pair| pair[0].pen < pair[1].pen), "from left to right");
        assert_eq!(face.shape_line("אx", 0.5).unwrap_err(), Unset::Missing(2), "its byte");
    }

    #[test]
    fn letters_that_touch_and_are_too_many_points_are_not_missing() {
        let face = Typeface::read(small_face(), Trace::CenterLine, "small.ttf").unwrap();
        // Each letter has four points.
        assert_eq!(face.shape_line(&"ש".repeat(20), 0.5).unwrap().len(), 1, "one shape");
        let error = face.shape_line(&"ש".repeat(2001), 0.5).unwrap_err();
        assert_eq!(error, Unset::TooLarge(0, 2001));
    }

    #[test]
    fn only_what_cannot_stand_side_by_side_is_shaped() {
        for text in ["نور", "नूर", "אור", "x\u{301}", "\u{1f44d}\u{1f3fd}", "ไทย"]
        {
            assert!(is_shaped(text), "{text}");
        }
        for text in ["Grüße", "Tiếng Việt", "ΝΟΟΡ", "漢字", "I ♥ NY!"] {
            assert!(!is_shaped(text), "{text}");
        }
    }
}
