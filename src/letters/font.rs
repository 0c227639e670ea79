//! Draws characters with a built-in font or with a font from a file.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use super::face::Face;
use super::shape::Fit;
use super::stroke_font::StrokeFont;
#[cfg(not(target_family = "wasm"))]
use super::typeface::Typeface;
use super::{Cell, Glyph, Trace};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Limit, ending};

/// The fonts that the program contains, by name.
const FONTS: [(&str, &str); 3] = [
    ("ae483", include_str!("../../fonts/ae483.strokes")),
    ("ae483-fixed", include_str!("../../fonts/ae483-fixed.strokes")),
    ("simplex", include_str!("../../fonts/simplex.strokes")),
];

/// Maximum size of a stroke font that is read from a file.
const STROKES: Limit = Limit { bytes: 4 << 20, what: "a stroke font", hint: SMALLER };

#[cfg(not(target_family = "wasm"))]
const TYPEFACE: Limit = Limit { bytes: 64 << 20, what: "a typeface", hint: SMALLER };

/// Hint for a file that is too large.
const SMALLER: &str = "name a smaller font file";

/// A font that is ready to draw. Clones of a font use the same cache of traced characters.
#[derive(Clone)]
pub struct Font {
    name: String,
    pub(super) face: Arc<dyn Face + Send + Sync>,
}

impl Font {
    /// Opens a font: `ae483`, `ae483-fixed`, `simplex`, a file `*.strokes`, or a typeface `*.ttf`,
    /// `*.otf`, `*.ttc`, for which `trace` selects the lines.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] for an unknown name or a file of another kind, and [`Error::Io`] if
    /// the file cannot be read.
    #[cfg_attr(target_family = "wasm", expect(unused_variables, reason = "no typeface, no trace"))]
    pub fn open(name: &str, trace: Trace) -> Result<Self> {
        let path = Path::new(name);
        let face: Arc<dyn Face + Send + Sync> = match check_name("letters.font", name)? {
            Kind::Shipped(text) => Arc::new(StrokeFont::shipped(text)),
            Kind::Strokes => Arc::new(StrokeFont::parse(&STROKES.read_text(path)?, name)?),
            // Shaping would make a web page's module larger by a third, and a page cannot use
            // typefaces.
            #[cfg(target_family = "wasm")]
            Kind::Outlines => {
                let (wanted, hint) = ("a built-in font", "use the program, which reads font files");
                return Err(Error::input("letters.font", name, wanted, hint));
            }
            #[cfg(not(target_family = "wasm"))]
            Kind::Outlines => Arc::new(Typeface::read(TYPEFACE.read(path)?, trace, name)?),
        };
        Ok(Self { name: name.to_owned(), face })
    }

    /// Returns the name by which the font was opened.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the font's characters, sorted by code.
    pub fn characters(&self) -> String {
        self.face.characters().collect()
    }

    /// Draws a character into a cell, if the font has it. Letters of a box font fill the cell.
    /// Other letters have its height, keep their proportions and are centered.
    pub fn glyph(&self, character: char, cell: Cell) -> Option<Glyph> {
        Some(self.face.shape(character)?.glyph(character, cell, self.face.fit()))
    }

    /// Returns the width of a character's cell in [`super::write()`], relative to its cap height.
    /// Returns `None` if the font lacks the character, or is a box font with cells of any width.
    pub fn aspect(&self, character: char) -> Option<f64> {
        match self.face.fit() {
            Fit::Box => None,
            Fit::Proportional => Some(self.face.shape(character)?.cell().1),
        }
    }

    /// Checks that the characters so far were drawn within the face's budget.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`], which names the limit.
    pub fn check_work(&self) -> Result<()> {
        self.face.check_work()
    }

    /// True if the font has a character or its capital.
    pub(super) fn draws(&self, character: char) -> bool {
        [Some(character), capital(character)].into_iter().flatten().any(|c| self.face.has(c))
    }
}

impl fmt::Debug for Font {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "Font({:?})", self.name)
    }
}

/// Returns the capital of a letter, or `None` if the capital is more than one character.
pub(super) fn capital(letter: char) -> Option<char> {
    let mut upper = letter.to_uppercase();
    upper.next().filter(|_| upper.len() == 0)
}

/// The source of a font: the program, or a kind of file.
pub(super) enum Kind {
    Shipped(&'static str),
    Strokes,
    Outlines,
}

/// True if the program contains a font.
pub(super) fn is_shipped(name: &str) -> bool {
    FONTS.iter().any(|(shipped, _)| *shipped == name)
}

/// Returns the source of a font by its name, without opening it. The error names the setting `key`.
pub(super) fn check_name(key: &str, name: &str) -> Result<Kind> {
    if let Some((_, text)) = FONTS.iter().find(|(shipped, _)| *shipped == name) {
        return Ok(Kind::Shipped(text));
    }
    match &*ending(name) {
        "strokes" => Ok(Kind::Strokes),
        "ttf" | "otf" | "ttc" | "otc" => Ok(Kind::Outlines),
        _ => {
            let names = FONTS.map(|(name, _)| name).join(", ");
            let wanted = format!("{names}, or a file *.strokes, *.ttf or *.otf");
            let hint = "choose a built-in font, or name a font file";
            Err(Error::input(key, format!("{name:?}"), wanted, hint))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_of_shipped_fonts_are_those_of_their_files() {
        for (name, text) in FONTS {
            let [whole, lazy] = [StrokeFont::parse(text, name).unwrap(), StrokeFont::shipped(text)];
            assert!(whole.characters().eq(lazy.characters()), "{name}");
            for character in whole.characters() {
                let [a, b] = [&whole, &lazy].map(|font| font.shape(character).unwrap());
                assert_eq!(a, b, "{name}: {character}");
            }
        }
    }

    #[test]
    fn every_font_under_fonts_is_readable() {
        let have = |name: &str| Font::open(name, Trace::CenterLine).unwrap().characters();
        assert_eq!(have("ae483"), "ABCDEFGHIJKLMNOPQRSTUVWXYZ", "the team's letters");
        let fixed = have("ae483-fixed");
        assert!(('A'..='Z').chain('0'..='9').all(|c| fixed.contains(c)), "{fixed}");
        let simplex = have("simplex");
        let latin = (' '..='~').chain('\u{a1}'..='\u{ac}').chain('\u{ae}'..='\u{17f}');
        let missing: String = latin.filter(|c| !simplex.contains(*c)).collect();
        assert_eq!(missing, "", "of ASCII, Latin-1 and Latin Extended-A");
        let greek = ('Α'..='Ρ').chain('Σ'..='Ϋ').chain('ά'..='ώ');
        let cyrillic = ('А'..='я').chain("ЁЂЃЄЅІЇЈЉЊЋЌЎЏёђѓєѕіїјљњћќўџҐґ".chars());
        let missing: String = greek.chain(cyrillic).filter(|c| !simplex.contains(*c)).collect();
        assert_eq!(missing, "", "of Greek and of Russian, Ukrainian, Belarusian, Serbian");
    }

    #[test]
    fn letters_of_repaired_fonts_are_reached_in_the_dark_and_never_jump() {
        let cell = Cell { left_m: 0.0, baseline_m: 0.0, width_m: 1.0, cap_height_m: 1.0 };
        for name in ["ae483-fixed", "simplex"] {
            let font = Font::open(name, Trace::CenterLine).unwrap();
            for character in font.characters().chars() {
                let moves = font.glyph(character, cell).unwrap().moves;
                assert!(moves.first().is_none_or(|first| !first.lit), "{name} {character}");
                let jumps = moves.windows(2).filter(|m| m[0].to_m != m[1].from_m).count();
                assert_eq!(jumps, 0, "{name} {character}");
            }
        }
    }

    #[test]
    fn a_font_is_read_from_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.strokes");
        std::fs::write(&path, "L + 0,1 0,0 1,0\n").unwrap();
        assert_eq!(
            Font::open(path.to_str().unwrap(), Trace::CenterLine).unwrap().characters(),
            "L"
        );
        std::fs::write(&path, b"L + 0,1 0,0 1,0\n\xff").unwrap();
        let error = Font::open(path.to_str().unwrap(), Trace::CenterLine).unwrap_err().to_string();
        assert!(error.contains("byte 17"), "{error}");
        assert!(
            Font::open("nowhere.strokes", Trace::Outline).is_err()
                && check_name("letters.font", "comic").is_err()
        );
    }
}
