//! Shaping: the glyphs of letters that join, change with their neighbors, bear marks or run from
//! right to left.
//!
//! A line is put in visual order (Unicode Standard Annex 9, unicode-bidi), and each word of it is
//! shaped by the typeface's own rules (GSUB and GPOS, harfrust) in the script of its first letter.

use harfrust::{Buffer, Direction, Font, GlyphId, ShapeOptions, ShaperFont, shape};
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
    text.chars().any(|c| is_mark(c) || SHAPED.iter().any(|block| block.contains(&c)))
}

/// Whether a character belongs to the one before it.
pub(super) fn is_mark(character: char) -> bool {
    is_combining_mark(character) || SKIN.contains(&character)
}

/// A glyph of a face, and its place in font units from the beginning of its line.
pub(super) struct Placed {
    pub(super) glyph: GlyphId,
    pub(super) at: [i32; 2],
    /// The first character that it stands for, by its byte in the line.
    pub(super) byte: usize,
}

/// Why a line cannot be set, with the byte of the character where it fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unset {
    /// The face lacks the character.
    Missing(usize),
    /// The rules of the face make more of the word from there on than the shaper's limits allow.
    Unshaped(usize),
    /// So many glyphs from there on touch each other, and are too many points as one outline.
    TooLarge(usize, usize),
}

/// The glyphs of a line from left to right.
///
/// # Errors
///
/// [`Unset`], but for glyphs that touch.
pub(super) fn shaped(face: &Font, line: &str, space: i32) -> Result<Vec<Placed>, Unset> {
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
                let shaped = shape(&face, &mut buffer, ShapeOptions::new());
                if shaped.is_err() || !buffer.allocation_successful() {
                    return Err(Unset::Unshaped(start));
                }
                let steps = buffer.glyph_infos().iter().zip(buffer.glyph_positions());
                for (info, step) in steps {
                    let byte = start + info.cluster as usize;
                    let glyph =
                        Some(GlyphId::new(info.glyph_id)).filter(|id| *id != GlyphId::NOTDEF);
                    let at = [pen.saturating_add(step.x_offset), step.y_offset];
                    placed.push(Placed { glyph: glyph.ok_or(Unset::Missing(byte))?, at, byte });
                    pen = pen.saturating_add(step.x_advance);
                }
            }
        }
    }
    Ok(placed)
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::Trace;
    use super::super::glyph::face_of;
    use super::super::typeface::Typeface;
    use super::*;

    fn words(numbers: &[u16]) -> Vec<u8> {
        numbers.iter().flat_map(|n| n.to_be_bytes()).collect()
    }

    /// A glyph of one rectangle.
    fn rectangle([left, right, top]: [i16; 3]) -> Vec<u8> {
        let numbers = [1, left, 0, right, top, 3, 0, 0x0101, 0x0101];
        let steps = [left, right - left, 0, left - right, 0, 0, top, 0];
        numbers.into_iter().chain(steps).flat_map(i16::to_be_bytes).collect()
    }

    /// A face of H, two Hebrew letters, and two Arabic ones that reach for each other where they
    /// join.
    pub(in super::super) fn small_face() -> Vec<u8> {
        let outlines = [
            [0, 100, 700],   // 1: H
            [100, 300, 100], // 2: noon
            [0, 400, 100],   // 3: noon, initial
            [100, 300, 100], // 4: reh
            [100, 400, 100], // 5: reh, final
            [100, 200, 700], // 6: alef
            [100, 300, 100], // 7: resh
            [0, 400, 100],   // 8: shin, as wide as its advance
        ];
        let (mut glyf, mut loca) = (Vec::new(), vec![0_u32, 0]);
        for outline in outlines {
            glyf.extend(rectangle(outline));
            loca.push(u32::try_from(glyf.len()).unwrap());
        }
        let map = [
            ('H', 1),
            ('\u{5d0}', 6),
            ('\u{5e8}', 7),
            ('\u{5e9}', 8),
            ('\u{631}', 4),
            ('\u{646}', 2),
        ];
        let mut cmap = words(&[0, 1, 3, 10, 0, 12, 12, 0, 0, 16 + 12 * 6, 0, 0, 0, 6]);
        for (character, glyph) in map {
            let code = u32::from(character);
            cmap.extend([code, code, glyph].into_iter().flat_map(u32::to_be_bytes));
        }
        let lefts = [0, 0, 100, 0, 100, 100, 100, 100, 0];
        let metrics = lefts.iter().flat_map(|left| words(&[400, *left])).collect();
        let mut head = vec![0; 54];
        head[18..20].copy_from_slice(&1000_u16.to_be_bytes());
        head[51] = 1;
        let mut hhea = vec![0; 36];
        hhea[1] = 1;
        hhea[35] = 9;
        let single = |glyph| [1, 0, 1, 8, 1, 6, 1, 1, 1, glyph];
        let scripts = [&tag("arab")[..], &[8, 4, 0, 0, 0xffff, 2, 0, 1]].concat();
        let features =
            [&[2], &tag("fina")[..], &[14], &tag("init"), &[20, 0, 1, 0, 0, 1, 1]].concat();
        let lookups = [&[2, 6, 26][..], &single(4), &single(2)].concat();
        let at = [10, 10 + 2 + 2 * scripts.len(), 12 + 2 * (scripts.len() + features.len())];
        let at = at.map(|at| u16::try_from(at).unwrap());
        let gsub = [&[1, 0, at[0], at[1], at[2], 1][..], &scripts, &features, &lookups].concat();
        face_of(&[
            (b"GSUB", words(&gsub)),
            (b"cmap", cmap),
            (b"glyf", glyf),
            (b"head", head),
            (b"hhea", hhea),
            (b"hmtx", metrics),
            (b"loca", loca.into_iter().flat_map(u32::to_be_bytes).collect()),
            (b"maxp", vec![0, 0, 0x50, 0, 0, 9]),
        ])
    }

    fn tag(text: &str) -> [u16; 2] {
        let bytes = text.as_bytes();
        [0, 2].map(|at| u16::from_be_bytes([bytes[at], bytes[at + 1]]))
    }

    #[test]
    fn letters_that_join_are_one_stroke_and_run_from_right_to_left() {
        let face = Typeface::read(small_face(), Trace::CenterLine, "small.ttf").unwrap();
        let arabic = face.line("نر", 0.5).unwrap();
        assert_eq!((arabic.len(), arabic[0].0), (1, 0), "joined");
        assert_eq!(arabic[0].2.runs.len(), 1, "a stroke through both: {:?}", arabic[0].2);
        let apart = face.line("ر ن", 0.5).unwrap();
        assert_eq!(apart.iter().map(|letter| letter.0).collect::<Vec<_>>(), [3, 0], "no joins");
        let hebrew = face.line("אר H", 0.5).unwrap();
        let bytes: Vec<usize> = hebrew.iter().map(|letter| letter.0).collect();
        assert_eq!(bytes, [5, 2, 0], "the first letter stands on the right");
        assert!(hebrew.windows(2).all(|pair| pair[0].1 < pair[1].1), "from left to right");
        assert_eq!(face.line("אx", 0.5).unwrap_err(), Unset::Missing(2), "its byte");
    }

    #[test]
    fn letters_that_touch_and_are_too_many_points_are_not_missing() {
        let face = Typeface::read(small_face(), Trace::CenterLine, "small.ttf").unwrap();
        // A letter has four points.
        assert_eq!(face.line(&"ש".repeat(20), 0.5).unwrap().len(), 1, "one shape");
        let error = face.line(&"ש".repeat(2001), 0.5).unwrap_err();
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
