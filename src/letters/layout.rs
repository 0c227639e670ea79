//! Layout of a text: characters side by side, and lines below each other.

use super::face::Joined;
use super::font::{Font, capital};
use super::fonts::Fonts;
use super::options::{Align, Fitting, LetterOptions, Trace};
use super::shape::{Fit, Shape};
use super::shaping::{MAX_POINTS, Unset, is_shaped};
use super::{Cell, Glyph, StrokeOrder, Strokes, StrokesData};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::file_name;
use noctograph_core::input_error;
use std::sync::Arc;
use unicode_normalization::UnicodeNormalization;
use unicode_normalization::char::is_combining_mark;

/// Maximum number of characters in a text: an hour of flight at 14 s per letter.
const MAX_LETTERS: usize = 256;

/// Maximum number of a font's characters that an error lists.
const MOST_LISTED: usize = 40;

/// The built-in font that supports the most scripts with single-line letters.
const SINGLE_LINE: &str = "simplex";

/// Advance of a space in cap heights for a font that has none, taken from Hershey's fonts.
const SPACE: f64 = 16.0 / 21.0;

/// Lays out a text: lines from top to bottom, separated by `\n`, and characters from left to right.
/// A space leaves a gap. If the font lacks a lowercase letter, its capital is drawn.
///
/// # Errors
///
/// Returns [`Error::Input`] for an empty or overlong text, an unknown or broken font, or a
/// character that the font lacks, whose position it states. Returns [`Error::Io`] for an unreadable
/// font.
pub fn write(word: &str, options: &LetterOptions) -> Result<Strokes> {
    options.check()?;
    let fonts = Fonts::open(options)?;
    let word = with_plain_spaces(word);
    if word.trim().is_empty() {
        let hint = "name the word to write";
        return Err(Error::input("word", "an empty word", "at least one letter", hint));
    }
    let n_characters = word.chars().count();
    if n_characters > MAX_LETTERS {
        return Err(input_error!(
            "word",
            "{n_characters} characters",
            "at most {MAX_LETTERS}",
            "split the text into several words",
        ));
    }
    // The text is composed (NFC), because fonts contain composed characters.
    let drawn = drawable(&word.nfc().collect::<String>(), &fonts);
    // If the budget is spent, characters seem to be missing. In that case, the error must name the
    // budget, not the character.
    fonts.check_work()?;
    let word = drawn?;
    Ok(match options.canvas_m {
        Some(canvas_m) => fitted(&word, &fonts, options, canvas_m),
        None => lay_out(&word, &fonts, options),
    })
}

/// Lays out a text scaled to its canvas. Line breaks are added if they allow larger letters.
fn fitted(word: &str, fonts: &Fonts, options: &LetterOptions, canvas_m: [f64; 2]) -> Strokes {
    let max_scale = match options.fit {
        Fitting::Shrink => 1.0,
        Fitting::Fill => f64::INFINITY,
    };
    let (mut best, mut best_scale) = (String::new(), 0.0);
    // The number of line breaks increases. Further breaks are kept only if they make the letters
    // larger.
    for n_breaks in 0..=word.matches(' ').count() {
        let text = with_line_breaks(word, n_breaks);
        let scale = canvas_scale(&lay_out(&text, fonts, options), canvas_m).min(max_scale);
        if scale > best_scale {
            (best, best_scale) = (text, scale);
        }
        if scale >= max_scale {
            break;
        }
    }
    lay_out(&best, fonts, &options.scaled(best_scale))
}

/// Replaces each white-space character other than a line end with a space.
fn with_plain_spaces(text: &str) -> String {
    text.chars().map(|c| if c.is_whitespace() && c != '\n' { ' ' } else { c }).collect()
}

/// Returns a pasted text as it looks: all white space other than line ends becomes spaces, and
/// format characters are dropped.
pub fn plain(text: &str) -> String {
    let mut previous = ' ';
    let mut plain = with_plain_spaces(text);
    plain.retain(|c| {
        if is_format(c) {
            return false;
        }
        // Joiners affect the letters of joining scripts, from Arabic to the scripts of India.
        let joins = matches!(previous, '\u{600}'..='\u{1cff}');
        previous = c;
        joins || !matches!(c, '\u{200c}' | '\u{200d}')
    });
    plain
}

/// True for the format characters of Unicode 16 that do not change the shape of any letter.
fn is_format(character: char) -> bool {
    matches!(character,
        '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}' | '\u{200e}' | '\u{200f}'
        | '\u{202a}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}'
        | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

/// Returns the factor by which strokes must be scaled to fill a canvas.
fn canvas_scale(strokes: &Strokes, [width_m, height_m]: [f64; 2]) -> f64 {
    let [left, bottom, right, top] = strokes.bounds_m();
    /// Slack for rounding, so that a text which fits exactly keeps its size.
    const SLACK: f64 = 1.0 + 1e-12;
    (width_m / (right - left)).min(height_m / (top - bottom)) * SLACK
}

/// Returns the text with up to `n_breaks` spaces replaced by line ends. Each break splits the
/// longest line at the space nearest to its middle.
fn with_line_breaks(text: &str, n_breaks: usize) -> String {
    let mut lines: Vec<String> = text.split('\n').map(str::to_owned).collect();
    for _ in 0..n_breaks {
        // The longest line that has a space is broken, or the first of several.
        let breakable = (0..lines.len()).filter(|index| lines[*index].trim().contains(' '));
        let longest =
            breakable.max_by_key(|index| (lines[*index].chars().count(), lines.len() - index));
        let Some(longest) = longest else { break };
        let line = lines[longest].trim().to_owned();
        let parts = line.match_indices(' ').map(|(space, _)| [&line[..space], &line[space + 1..]]);
        let halves = parts.min_by_key(|parts| {
            let [before, after] = parts.map(|part| part.chars().count());
            before.abs_diff(after)
        });
        let halves = halves.expect("the line has a space").map(|part| part.trim().to_owned());
        lines.splice(longest..=longest, halves);
    }
    lines.join("\n")
}

/// Returns the text with capitals in place of letters that no font has. Fails if a font lacks both.
fn drawable(word: &str, fonts: &Fonts) -> Result<String> {
    let mut drawn = String::new();
    for (index, line) in word.split('\n').enumerate() {
        drawn += if index > 0 { "\n" } else { "" };
        for (font, part) in fonts.parts(line) {
            let n_before = drawn.chars().count();
            drawn += &drawable_in(&line[part], font, n_before)?;
        }
    }
    Ok(drawn)
}

/// Returns a part of a line with capitals in place of letters that its font lacks. `n_before` is
/// the number of characters before it in the text, which error messages need for positions.
fn drawable_in(part: &str, font: &Font, n_before: usize) -> Result<String> {
    // A typeface shapes the part as a whole, so no character is replaced by its capital.
    if is_shaped(part)
        && let Some(line) = font.face.shaped_line(part, SPACE)
    {
        return match line {
            Ok(_) => Ok(part.to_owned()),
            Err(unset) => Err(refused(part, font, n_before, unset)),
        };
    }
    let drawn = part.chars().enumerate().map(|(index, typed)| {
        let mut forms = [Some(typed), capital(typed)].into_iter().flatten();
        let form = forms.find(|character| is_drawn(font, *character));
        form.ok_or_else(|| missing(part, font, n_before + index + 1, typed))
    });
    drawn.collect()
}

/// True if a character is a space or has strokes in a font.
fn is_drawn(font: &Font, character: char) -> bool {
    character == ' ' || font.face.shape(character).is_some_and(|shape| !shape.runs.is_empty())
}

/// Returns the error for a part that its typeface cannot shape.
fn refused(part: &str, font: &Font, n_before: usize, unset: Unset) -> Error {
    let (Unset::Missing(byte) | Unset::Unshaped(byte) | Unset::TooLarge(byte, _)) = unset;
    let position = n_before + part[..byte].chars().count() + 1;
    let (place, name) = (format!("word, position {position}"), font.name());
    match unset {
        Unset::Missing(_) => {
            missing(part, font, position, part[byte..].chars().next().unwrap_or(' '))
        }
        Unset::Unshaped(_) => input_error!(
            place,
            "a word that the substitution rules of {name} expand endlessly",
            "a word of finite length",
            "use another font, or a shorter sequence of its letters",
        ),
        // Letters that touch are traced as a single outline.
        Unset::TooLarge(_, n) => input_error!(
            place,
            "{n} consecutive letters that touch each other",
            "fewer letters: touching ones form one outline of at most {MAX_POINTS} points",
            "put a space or a line break between the letters",
        ),
    }
}

/// Returns the error for a letter that a font lacks. The error's hint says which fonts may have the
/// letter.
fn missing(part: &str, font: &Font, position: usize, letter: char) -> Error {
    let single_line = Font::open(SINGLE_LINE, Trace::CenterLine).ok();
    let hint = if is_shaped(part) {
        format!(
            "name a typeface for this script in letters.fallback, because {} has no letters of \
             the script",
            font.name()
        )
    } else if single_line.is_some_and(|font| font.face.shape(letter).is_some()) {
        format!(
            "choose {SINGLE_LINE}, which contains this letter, or add that font to \
                 letters.fallback"
        )
    } else {
        "add a typeface with this letter to letters.fallback, such as a Noto font".to_owned()
    };
    // The characters of a small font are listed, except those that draw nothing.
    let characters = font.characters();
    let wanted = match characters.chars().count() {
        ..=MOST_LISTED => format!("one of {}", characters.replace(|c| !is_drawn(font, c), "")),
        _ => format!("a letter of the font {}", font.name()),
    };
    Error::Letter { position, letter, wanted, hint }
}

/// Lays out the lines of a text below each other, with the last one on the baseline.
fn lay_out(word: &str, fonts: &Fonts, options: &LetterOptions) -> Strokes {
    let lines: Vec<&str> = word.split('\n').collect();
    let mut glyphs = Vec::new();
    let line_gap_m = options.line_gap_m.unwrap_or(0.5 * options.cap_height_m);
    for (line, n_lines_below) in lines.iter().zip((0..lines.len()).rev()) {
        let up_m = (options.cap_height_m + line_gap_m) * n_lines_below as f64;
        glyphs.extend(lay_line(line, fonts, options, options.baseline_m + up_m));
    }
    let word = word.to_owned();
    let characters = glyphs.iter().map(|glyph| glyph.character);
    let lost = characters.filter_map(|c| Some((c, fonts.lost_length(c)?))).collect();
    let (font, order) = (Some(file_name(fonts.main().name())), StrokeOrder::Free);
    Strokes::made(StrokesData { word, font, lost, glyphs, order, ..StrokesData::default() })
}

/// Returns the glyphs of a line on a baseline at the height `baseline_m`, aligned by the options.
fn lay_line(line: &str, fonts: &Fonts, options: &LetterOptions, baseline_m: f64) -> Vec<Glyph> {
    let is_box = fonts.main().face.fit() == Fit::Box;
    // Spaces at the ends of a line take no room, except in box fonts.
    let cells = cells(if is_box { line } else { line.trim_matches(' ') }, fonts, options);
    let begin_m = cells.first().map_or(0.0, |cell| cell.offset_m);
    let end_m = cells.last().map_or(0.0, |cell| cell.offset_m + cell.width_m);
    let left_m = match options.align {
        // The offset is a product, not a sum, to be rounded as in the reference flight.
        Align::Ae483 if is_box => -0.5 * options.box_width_m() * cells.len() as f64,
        Align::Ae483 => -0.5 * cells.iter().map(|cell| cell.width_m).sum::<f64>() - begin_m,
        Align::Left => -begin_m,
        Align::Center => -0.5 * (begin_m + end_m),
        Align::Right => -end_m,
    };
    let glyphs =
        cells.into_iter().filter_map(|Placed { character, shape, offset_m, width_m, fit }| {
            let cap_height_m = options.cap_height_m;
            let cell = Cell { left_m: left_m + offset_m, baseline_m, width_m, cap_height_m };
            Some(shape?.glyph(character, cell, fit))
        });
    glyphs.collect()
}

/// Returns the characters of a line from left to right, placed relative to the start of the line.
fn cells(line: &str, fonts: &Fonts, options: &LetterOptions) -> Vec<Placed> {
    let parts = fonts.parts(line);
    // If there is a single font, it sets the whole line, including spaces.
    if parts.len() < 2 {
        let font = parts.first().map_or(fonts.main(), |(font, _)| font);
        return cells_in(line, font, options).0;
    }
    let space_m = match fonts.main().face.fit() {
        Fit::Box => options.box_width_m() + options.box_gap_m(),
        Fit::Proportional => SPACE * options.cap_height_m + options.spacing_m,
    };
    let (mut cells, mut pen_m) = (Vec::new(), 0.0);
    for ((font, part), leftward) in fonts.in_visual_order(line) {
        let part = &line[part];
        // Spaces at both ends of a part only move the pen. The start of a right-to-left part is on
        // the right.
        let mut spaces_m = [part.trim_start_matches(' '), part.trim_end_matches(' ')]
            .map(|trimmed| space_m * (part.len() - trimmed.len()) as f64);
        if leftward {
            spaces_m.reverse();
        }
        pen_m += spaces_m[0];
        let (inner, end_m) = cells_in(part.trim_matches(' '), font, options);
        cells.extend(
            inner.into_iter().map(|cell| Placed { offset_m: cell.offset_m + pen_m, ..cell }),
        );
        pen_m += end_m + spaces_m[1];
    }
    cells
}

/// Returns the characters of a part of a line in one font, placed relative to its start, and the
/// position of its end in m.
fn cells_in(line: &str, font: &Font, options: &LetterOptions) -> (Vec<Placed>, f64) {
    if is_shaped(line)
        && let Some(letters) = font.face.shaped_line(line, SPACE)
    {
        // The line ends at its rightmost letter, because marks may come after that letter.
        let (letters, size_m) = (letters.expect("the text is drawable"), options.cap_height_m);
        let right_edges = letters.iter().map(|letter| letter.pen + letter.shape.ink_bounds()[2]);
        let end = right_edges.fold(0.0, f64::max);
        let cells = letters.into_iter().map(|Joined { byte, pen, shape }| {
            proportional(line[byte..].chars().next().unwrap_or(' '), pen, shape, size_m)
        });
        return (cells.collect(), end * size_m);
    }
    match font.face.fit() {
        Fit::Box => boxes(line, font, options),
        Fit::Proportional => advances(line, font, options),
    }
}

/// A character, the offset of its box from the start of the line, and the width of that box. A
/// space has no shape.
struct Placed {
    character: char,
    shape: Option<Arc<Shape>>,
    offset_m: f64,
    width_m: f64,
    fit: Fit,
}

/// Returns a proportional character of a cap height `size_m`, whose pen starts at a position given
/// in cap heights.
fn proportional(character: char, pen: f64, shape: Arc<Shape>, size_m: f64) -> Placed {
    let (left, width) = shape.cell();
    let (offset_m, width_m) = ((pen + left) * size_m, width * size_m);
    Placed { character, shape: Some(shape), offset_m, width_m, fit: Fit::Proportional }
}

/// Returns the characters of a part in boxes of equal width and spacing, and the part's end in m.
fn boxes(line: &str, font: &Font, options: &LetterOptions) -> (Vec<Placed>, f64) {
    let (width_m, step_m) = (options.box_width_m(), options.box_width_m() + options.box_gap_m());
    let cells = Vec::from_iter(line.chars().enumerate().map(|(index, character)| {
        let shape = font.face.shape(character).filter(|_| character != ' ');
        Placed { character, shape, offset_m: step_m * index as f64, width_m, fit: Fit::Box }
    }));
    let end_m = step_m * cells.len() as f64;
    (cells, end_m)
}

/// Returns the characters of a part, placed by their advances and kerning, and the part's end in m.
fn advances(line: &str, font: &Font, options: &LetterOptions) -> (Vec<Placed>, f64) {
    let size_m = options.cap_height_m;
    let (mut pen, mut base_pen, mut previous) = (0.0, 0.0, None);
    let mut cells: Vec<Placed> = Vec::new();
    for character in line.chars() {
        // A mark that Unicode cannot compose with the previous letter is placed on that letter.
        let last = cells.last_mut().filter(|_| is_combining_mark(character));
        if let Some(last) = last
            && let Some(base) = &last.shape
            && let Some(marked) = font.face.with_mark(base, character)
        {
            *last = proportional(last.character, base_pen, marked, size_m);
            continue;
        }
        pen += previous.map_or(0.0, |previous| font.face.kern([previous, character]));
        base_pen = pen;
        let shape = font.face.shape(character);
        let advance = shape.as_ref().map_or(SPACE, |shape| shape.advance);
        // A space only moves the pen, and leaves no strokes.
        let inked = shape.filter(|_| character != ' ');
        cells.extend(inked.map(|shape| proportional(character, pen, shape, size_m)));
        pen += advance + options.spacing_m / size_m;
        previous = Some(character);
    }
    (cells, pen * size_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn simplex() -> LetterOptions {
        LetterOptions { font: "simplex".into(), ..LetterOptions::default() }
    }

    #[test]
    fn any_white_space_is_a_space_and_what_directs_a_text_is_left_out() {
        for (text, want) in [
            ("A\u{a0}B\tC\u{2003}D\u{3000}E\u{202f}F", "A B C D E F"),
            ("A\nB", "A\nB"),
            ("\u{202e}A\u{200b}B\u{feff}\u{2066}C\u{ad}", "ABC"),
            // Joiners are kept only in scripts such as Persian and Hindi.
            ("می\u{200c}خواهم", "می\u{200c}خواهم"),
            ("A\u{200d}B", "AB"),
        ] {
            assert_eq!(plain(text), want);
        }
        let [pasted, typed] = ["A\u{a0}B", "A B"].map(|text| write(text, &simplex()).unwrap());
        assert_eq!(pasted.glyphs, typed.glyphs);
    }

    #[test]
    fn a_mark_that_no_letter_has_is_put_on_the_letter_before_it() {
        let [plain, marked] = ["ọa", "ọ\u{300}a"].map(|text| write(text, &simplex()).unwrap());
        assert_eq!((plain.glyphs.len(), marked.glyphs.len()), (2, 2));
        assert_eq!(
            plain.glyphs[1].cell, marked.glyphs[1].cell,
            "the next letter stays in its place"
        );
        assert!(marked.glyphs[0].moves.len() > plain.glyphs[0].moves.len(), "a grave more");
    }

    #[test]
    fn boxes_are_placed_as_in_the_reference_flight() {
        let strokes = write("noor", &LetterOptions::default()).unwrap();
        assert_eq!(strokes.word, "NOOR", "lower case becomes upper case");
        let left: Vec<f64> = strokes.glyphs.iter().map(|glyph| glyph.cell.left_m).collect();
        for (left, wanted) in left.iter().zip([-0.6, -0.2, 0.2, 0.6]) {
            assert!((left - wanted).abs() < 1e-12, "{left} for {wanted}");
        }
        let n = &strokes.glyphs[0].moves;
        assert_eq!((n[0].from_m, n[0].to_m, n[0].lit), ([-0.6, 0.5], [-0.6, 1.0], true));
        assert!(!n[3].lit, "N comes back to the lower right corner in the dark");
        let [left, bottom, right, top] = strokes.bounds_m();
        assert!((left + 0.6).abs() + (right - 0.9).abs() < 1e-12 && (bottom, top) == (0.5, 1.0));
    }

    #[test]
    fn the_teams_i_jumps() {
        let strokes = write("I", &LetterOptions::default()).unwrap();
        let moves = &strokes.glyphs[0].moves;
        assert_eq!(moves[0].from_m, moves[0].to_m, "the empty first move");
        assert_ne!(moves[0].to_m, moves[1].from_m, "the jump to the other corner");
    }

    #[test]
    fn an_unknown_character_is_named_with_its_position() {
        let text = write("NOÖR", &LetterOptions::default()).unwrap_err().to_string();
        assert!(text.contains("position 3") && text.contains('Ö'), "{text}");
        for empty in ["", "  ", " \n"] {
            assert!(write(empty, &LetterOptions::default()).is_err(), "an empty word");
        }
        let long = "A".repeat(MAX_LETTERS + 1);
        assert!(write(&long, &LetterOptions::default()).is_err(), "too long");
        assert_eq!(write("grüße", &simplex()).unwrap().word, "grüße");
        for word in ["Привет", "Щоґо Її", "Ђорђе Љиљана", "Καλημέρα Ώρα ΐ", "Ёж Эхо Юля"]
        {
            assert_eq!(write(word, &simplex()).unwrap().word, word);
        }
        let told = write("Привет", &LetterOptions::default()).unwrap_err();
        assert!(told.hint().contains("simplex"), "{told}");
        let told = write("漢", &simplex()).unwrap_err().to_string();
        assert!(told.len() < 160 && !told.contains("ABC"), "{told}");
        assert_eq!(
            write("漢", &simplex()).unwrap_err().to_string().find("word, position 1"),
            Some(0)
        );
    }

    #[test]
    fn hershey_letters_are_an_advance_apart() {
        // In Roman Simplex, N is 22 units wide with its stem at 4, O is 22 wide and starts at 3,
        // and capitals are 21 units high.
        let options = LetterOptions { align: Align::Left, ..simplex() };
        let strokes = write("NO", &options).unwrap();
        let unit_m = 0.5 / 21.0;
        let [n, o] = [&strokes.glyphs[0].cell, &strokes.glyphs[1].cell];
        assert!((n.left_m).abs() < 1e-12 && (n.width_m - 14.0 * unit_m).abs() < 1e-12, "{n:?}");
        let wanted_m = (22.0 - 4.0 + 3.0) * unit_m;
        // The O bulges slightly between its points.
        assert!((o.left_m - wanted_m).abs() < 0.3 * unit_m, "{o:?}, {wanted_m}");
        assert!((0.0..0.6 * unit_m).contains(&(o.width_m - 16.0 * unit_m)), "{o:?}");
        let wide = write("NO", &LetterOptions { spacing_m: 0.1, ..options }).unwrap();
        assert!((wide.glyphs[1].cell.left_m - o.left_m - 0.1).abs() < 1e-12, "0.1 m more");
    }

    #[test]
    fn lines_align_left_right_and_in_the_middle() {
        for font in ["ae483", "simplex"] {
            let sides = |align| {
                let options = LetterOptions { font: font.into(), align, ..simplex() };
                let strokes = write("NOOR\nOR", &options).unwrap();
                let lines = strokes.lines();
                assert_eq!(lines, [0..4, 4..6], "two lines");
                let up = strokes.glyphs[0].cell.baseline_m - strokes.glyphs[4].cell.baseline_m;
                assert!((up - 0.75).abs() < 1e-12, "a capital and a gap: {up}");
                [0, 1].map(|line: usize| {
                    let glyphs = &strokes.glyphs[lines[line].clone()];
                    let last = glyphs[glyphs.len() - 1].cell;
                    [glyphs[0].cell.left_m, last.left_m + last.width_m]
                })
            };
            let [[l, _], [m, _]] = sides(Align::Left);
            assert!(l.abs() + m.abs() < 1e-12, "{font}: both begin at 0");
            let [[_, r], [_, s]] = sides(Align::Right);
            assert!(r.abs() + s.abs() < 1e-12, "{font}: both end at 0");
            for [left, right] in sides(Align::Center) {
                assert!((left + right).abs() < 1e-12, "{font}: in the middle");
            }
        }
    }

    #[test]
    fn a_text_fits_its_canvas_and_is_never_made_larger() {
        let canvas_m = Some([1.0, 2.0]);
        let fitted = write("gjÅ\nNOOR", &LetterOptions { canvas_m, ..simplex() }).unwrap();
        let [left, bottom, right, top] = fitted.bounds_m();
        assert!((right - left - 1.0).abs() < 1e-9 && top - bottom < 2.0, "as wide as the canvas");
        let low = Some([100.0, 0.3]);
        let fitted = write("gjÅ", &LetterOptions { canvas_m: low, ..simplex() }).unwrap();
        let [_, bottom, _, top] = fitted.bounds_m();
        assert!((top - bottom - 0.3).abs() < 1e-9, "accents and tails count: {bottom} to {top}");
        let large = LetterOptions { canvas_m: Some([100.0, 100.0]), ..simplex() };
        assert_eq!(write("NO", &large).unwrap(), write("NO", &simplex()).unwrap());
        let exact = LetterOptions { canvas_m: Some([1.5, 0.5]), ..LetterOptions::default() };
        let noor = write("NOOR", &exact).unwrap();
        assert_eq!(noor, write("NOOR", &LetterOptions::default()).unwrap(), "it fits already");
    }

    #[test]
    fn a_text_that_fills_its_canvas_is_as_large_as_fits() {
        for canvas_m in [[3.0, 9.0], [9.0, 1.5], [0.2, 0.2]] {
            let options =
                LetterOptions { canvas_m: Some(canvas_m), fit: Fitting::Fill, ..simplex() };
            for text in ["I", "NOOR", "HELLO WORLD"] {
                let [left, bottom, right, top] = write(text, &options).unwrap().bounds_m();
                let shares = [(right - left) / canvas_m[0], (top - bottom) / canvas_m[1]];
                assert!((shares[0].max(shares[1]) - 1.0).abs() < 1e-9, "{text}: {shares:?}");
            }
        }
        let wide = LetterOptions { canvas_m: Some([9.0, 1.5]), fit: Fitting::Fill, ..simplex() };
        let gap = LetterOptions { spacing_m: 0.5, ..wide.clone() };
        let cap_m = |options| write("NO", options).unwrap().glyphs[0].cell.cap_height_m;
        assert!((cap_m(&wide) - cap_m(&gap)).abs() < 1e-9, "as high as the canvas");
        let on_canvas = |canvas_m| LetterOptions { canvas_m: Some(canvas_m), ..wide.clone() };
        assert_eq!(write("HELLO WORLD", &on_canvas([3.0, 1.6])).unwrap().word, "HELLO\nWORLD");
        assert_eq!(write("HELLO WORLD", &on_canvas([9.0, 1.6])).unwrap().word, "HELLO WORLD");
    }

    #[test]
    fn boxes_gaps_and_lines_follow_the_cap_height() {
        let with_cap = |cap_height_m| LetterOptions { cap_height_m, ..LetterOptions::default() };
        let [large, small] = [0.5, 0.25].map(|cap_m| write("NO\nOR", &with_cap(cap_m)).unwrap());
        let bounds = large.bounds_m().map(|side| side - 0.5);
        let [left, bottom, right, top] = small.bounds_m().map(|side| side - 0.5);
        let half = [(left + 0.5) * 2.0 - 0.5, bottom * 2.0, (right + 0.5) * 2.0 - 0.5, top * 2.0];
        for (large, small) in bounds.iter().zip(half) {
            assert!((large - small).abs() < 1e-12, "{bounds:?} is not twice {half:?}");
        }
        let wide = write("NO", &LetterOptions { width_m: Some(0.4), ..with_cap(0.25) }).unwrap();
        assert_eq!(wide.glyphs[0].cell.width_m, 0.4);
    }

    #[test]
    fn a_long_text_is_broken_where_that_leaves_it_larger() {
        fn on(text: &str, canvas_m: [f64; 2]) -> Strokes {
            let options =
                LetterOptions { canvas_m: Some(canvas_m), align: Align::Center, ..simplex() };
            write(text, &options).unwrap()
        }
        assert_eq!(on("HELLO WORLD", [3.0, 1.6]).word, "HELLO\nWORLD");
        assert_eq!(on("HELLO WORLD", [9.0, 1.6]).word, "HELLO WORLD", "it fits");
        assert_eq!(on("HELLO WORLD", [2.0, 0.2]).word, "HELLO WORLD", "a line is larger");
        assert_eq!(on("THE QUICK BROWN FOX", [3.0, 3.0]).word, "THE\nQUICK\nBROWN\nFOX");
        assert_eq!(on("A\nLONG STORY", [1.5, 4.0]).word, "A\nLONG\nSTORY");
        let [left, bottom, right, top] = on("HELLO WORLD", [3.0, 1.6]).bounds_m();
        assert!(
            right - left <= 3.0 + 1e-9 && top - bottom <= 1.6 + 1e-9 && (left + right).abs() < 0.1
        );
    }

    #[test]
    fn a_script_that_the_font_lacks_is_refused_and_marks_are_composed() {
        for word in ["שלום", "سلام", "नमस्ते", "ab\u{202E}cd"] {
            let error = write(word, &simplex()).unwrap_err();
            assert!(error.to_string().contains("word, position"), "{error}");
            assert!(error.hint().contains("typeface"), "{}", error.hint());
        }
        assert_eq!(
            write("e\u{301}u\u{308}", &simplex()).unwrap(),
            write("éü", &simplex()).unwrap()
        );
    }

    #[test]
    fn a_space_leaves_a_gap() {
        let strokes = write("N O", &LetterOptions::default()).unwrap();
        assert_eq!((strokes.glyphs.len(), strokes.word.as_str()), (2, "N O"));
        let gap_m = strokes.glyphs[1].cell.left_m - strokes.glyphs[0].cell.left_m;
        assert!((gap_m - 0.8).abs() < 1e-12, "a box and two gaps: {gap_m}");
    }
}
