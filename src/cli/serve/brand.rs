//! The look of a host: a folder with `brand.toml` and, if there is one, `logo.svg`.
//!
//! ```toml
//! title = "Night of the Open Hall"
//! accent = "#ffcd82"
//! [sentence]
//! en = "A small drone carries one lamp."
//! [consent]
//! en = "What you send may be shown on the wall tonight."
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::{Error, Result, Value, json, warn};
use crate::letters::{Ink, LetterOptions, draw};
use noctograph_core::files::Limit;

const TABLE: Limit = Limit { bytes: 64 << 10, what: "a brand", hint: "shorten its sentences" };
const LOGO: Limit = Limit { bytes: 256 << 10, what: "a logo", hint: "simplify its paths" };

/// Most characters of a title, and of a sentence in a language.
const MAX_TITLE: usize = 60;
const MAX_SENTENCE: usize = 240;

/// The page's dark ground, and the least contrast of an accent on it (WCAG 2, level AA).
const NIGHT: [u8; 3] = [0x0f, 0x0d, 0x0a];
const LEAST_CONTRAST: f64 = 4.5;

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Table {
    title: Option<String>,
    accent: Option<String>,
    sentence: BTreeMap<String, String>,
    consent: BTreeMap<String, String>,
}

#[derive(Debug, Default)]
pub(super) struct Brand {
    table: Table,
    /// SVG.
    pub(super) logo: Option<Vec<u8>>,
}

impl Brand {
    /// Reads and checks a folder.
    pub(super) fn read(folder: &Path) -> Result<Self> {
        let path = folder.join("brand.toml");
        let refused = |key: &str, found: String, wanted: String| {
            Error::input(key, found, wanted, "see docs/page.md").at(path.display(), None)
        };
        let table: Table = toml::from_str(&TABLE.read_text(&path)?).map_err(|error| {
            let wanted = "title, accent, [sentence], [consent]".into();
            refused("table", error.message().to_owned(), wanted)
        })?;
        let titles = table.title.iter().map(|title| ("title", title, MAX_TITLE));
        let sentences = table.sentence.values().chain(table.consent.values());
        let sentences = sentences.map(|sentence| ("sentence", sentence, MAX_SENTENCE));
        for (key, text, most) in titles.chain(sentences) {
            let n = text.chars().count();
            if n > most {
                return Err(refused(key, format!("{n} characters"), format!("at most {most}")));
            }
        }
        if let Some(accent) = &table.accent {
            let rgb = rgb(accent)
                .ok_or_else(|| refused("accent", accent.clone(), "a color: #ffcd82".into()))?;
            let contrast = contrast(rgb, NIGHT);
            if contrast < LEAST_CONTRAST {
                let found = format!("{accent}, {contrast:.1} : 1 on the dark page");
                return Err(refused("accent", found, format!("{LEAST_CONTRAST} : 1 at least")));
            }
        }
        let path = folder.join("logo.svg");
        let logo = path.is_file().then(|| LOGO.read(&path)).transpose()?;
        if logo.is_some() {
            // A logo is refused where a drawing is, as for text in a typeface that tablets lack.
            let drawn = draw(&path, &LetterOptions::default(), Ink::Alike)?;
            warn(&drawn.warnings);
        }
        Ok(Self { table, logo })
    }

    /// What the page knows of it.
    pub(super) fn json(&self) -> Value {
        let Table { title, accent, sentence, consent } = &self.table;
        json!({
            "title": title, "accent": accent, "sentence": sentence, "consent": consent,
            "logo": self.logo.is_some(),
        })
    }
}

/// A color of the web: `#ffcd82`.
fn rgb(text: &str) -> Option<[u8; 3]> {
    let digits = text.strip_prefix('#').filter(|it| it.len() == 6 && it.is_ascii())?;
    let byte = |k: usize| u8::from_str_radix(&digits[2 * k..2 * k + 2], 16).ok();
    Some([byte(0)?, byte(1)?, byte(2)?])
}

/// The ratio of two colors' luminances, as WCAG 2 defines it.
fn contrast(a: [u8; 3], b: [u8; 3]) -> f64 {
    let linear = |byte: u8| match f64::from(byte) / 255.0 {
        low if low <= 0.04045 => low / 12.92,
        value => libm::pow((value + 0.055) / 1.055, 2.4),
    };
    let luminance =
        |[r, g, b]: [u8; 3]| 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
    let [a, b] = [luminance(a), luminance(b)];
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_brand_is_checked_before_it_is_shown() {
        let folder = tempfile::tempdir().unwrap();
        let read = |table: &str, logo: Option<&str>| {
            std::fs::write(folder.path().join("brand.toml"), table).unwrap();
            let path = folder.path().join("logo.svg");
            let _ = std::fs::remove_file(&path);
            logo.into_iter().for_each(|logo| std::fs::write(&path, logo).unwrap());
            Brand::read(folder.path()).map(|brand| brand.json()).map_err(|e| e.to_string())
        };
        let whole = "title = \"Hall\"\naccent = \"#ffcd82\"\n[consent]\nde = \"Ja.\"\n";
        let svg = |inside: &str| {
            let head = "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 9 9'>";
            format!("{head}{inside}</svg>")
        };
        let json = read(whole, Some(&svg("<circle cx='4' cy='4' r='3'/>"))).unwrap();
        assert_eq!((&json["title"], &json["logo"]), (&json!("Hall"), &json!(true)));
        assert_eq!(json["consent"]["de"], "Ja.");
        for (table, why) in [
            ("accent = \"red\"", "a color"),
            ("accent = \"#402010\"", "4.5 : 1"),
            ("name = \"x\"", "name"),
            (&format!("title = \"{}\"", "x".repeat(61)), "61 characters"),
        ] {
            assert!(read(table, None).unwrap_err().contains(why), "{table}");
        }
        for (inside, why) in [
            ("", "nothing drawn"),
            ("<text>Hall</text>", "found text"),
            ("<image href='http://elsewhere/x.png' width='9' height='9'/>", "nothing drawn"),
            (&"<g>".repeat(200), "logo.svg"),
        ] {
            let found = read("", Some(&svg(inside))).unwrap_err();
            assert!(found.contains(why), "{inside}: {found}");
        }
        assert_eq!(contrast([255; 3], [0; 3]).round(), 21.0);
    }
}
