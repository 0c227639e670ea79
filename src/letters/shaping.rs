//! Shaping: the glyphs of letters that join, change with their neighbors, bear marks or run from right
//! to left.
//!
//! A line is put in visual order (Unicode Standard Annex 9, unicode-bidi), and each word of it is shaped by
//! the typeface's own rules (GSUB and GPOS, harfrust) in the script of its first letter.

use harfrust::{Buffer, Direction, Font, ShapeOptions, ShaperFont, shape};
use unicode_bidi::BidiInfo;
use unicode_normalization::char::is_combining_mark;

/// Blocks of the scripts that are shaped, of characters without width, and of the marks of emoji.
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
const SKIN: std::ops::RangeInclusive<char> = '\u{1F3FB}'..='\u{1F3FF}';

/// Whether a composed text has characters that cannot be set side by side.
pub(super) fn is_shaped(text: &str) -> bool {
    let shaped = |c| is_combining_mark(c) || SKIN.contains(&c);
    text.chars().any(|c| shaped(c) || SHAPED.iter().any(|block| block.contains(&c)))
}

/// A glyph of a face, and its place in font units from the beginning of its line.
pub(super) struct Placed {
    pub(super) glyph: u16,
    pub(super) at: [i32; 2],
    /// The first character that it stands for, by its byte in the line.
    pub(super) byte: usize,
}

/// The glyphs of a line from left to right.
///
/// # Errors
///
/// The byte of a character that the face lacks.
pub(super) fn shaped(face: &Font, line: &str, space: i32) -> Result<Vec<Placed>, usize> {
    let face = ShaperFont::new(face);
    let info = BidiInfo::new(line, None);
    let (mut placed, mut pen) = (Vec::new(), 0_i32);
    for paragraph in &info.paragraphs {
        let (levels, runs) = info.visual_runs(paragraph, paragraph.range.clone());
        for run in runs {
            let leftward = levels[run.start].is_rtl();
            let mut at = run.start;
            let mut words: Vec<(usize, &str)> = Vec::new();
            for word in line[run].split(' ') {
                words.push((at, word));
                at += word.len() + 1;
            }
            if leftward {
                words.reverse();
            }
            for (index, (start, word)) in words.into_iter().enumerate() {
                if index > 0 {
                    pen = pen.saturating_add(space);
                }
                let direction =
                    if leftward { Direction::RightToLeft } else { Direction::LeftToRight };
                let mut buffer = Buffer::new();
                buffer.push_str(word);
                buffer.set_direction(direction);
                buffer.guess_segment_properties();
                shape(&face, &mut buffer, ShapeOptions::new()).map_err(|_| start)?;
                let steps = buffer.glyph_infos().iter().zip(buffer.glyph_positions());
                for (info, step) in steps {
                    let byte = start + info.cluster as usize;
                    let glyph = u16::try_from(info.glyph_id).ok().filter(|id| *id != 0);
                    let at = [pen.saturating_add(step.x_offset), step.y_offset];
                    placed.push(Placed { glyph: glyph.ok_or(byte)?, at, byte });
                    pen = pen.saturating_add(step.x_advance);
                }
            }
        }
    }
    Ok(placed)
}
