//! Texts and logo of a host, read from a folder with `brand.toml` and optionally `logo.svg`.
//!
//! ```toml
//! title = "Night of the Open Hall"
//! [sentence]
//! en = "A small drone carries one lamp."
//! [consent]
//! en = "What you send may be shown on the wall tonight."
//! ```

use std::path::Path;

use noctograph_core::error::{Error, Result};
use noctograph_core::files::Limit;
use noctograph_photo_service::about::Brand as Words;

const TABLE: Limit = Limit { bytes: 64 << 10, what: "a brand", hint: "shorten its sentences" };
const LOGO: Limit = Limit { bytes: 256 << 10, what: "a logo", hint: "simplify its paths" };

/// Maximum number of characters in a title.
const MAX_TITLE: usize = 60;
/// Maximum number of characters in a sentence, in each language.
const MAX_SENTENCE: usize = 240;

/// Texts and logo of a host.
#[derive(Debug, Default)]
pub(crate) struct Brand {
    /// Texts, which pages receive as JSON.
    pub(crate) words: Words,
    /// Logo (SVG).
    pub(crate) svg: Option<String>,
}

impl Brand {
    /// Reads the host's texts and logo from a folder. Returns [`Error::Input`] for an unknown key,
    /// a text that is too long for the page, or a logo that is not SVG. Returns [`Error::Io`] for a
    /// folder without `brand.toml`.
    pub(crate) fn read(folder: &Path) -> Result<Self> {
        let path = folder.join("brand.toml");
        let mut words: Words = toml::from_str(&TABLE.read_text(&path)?)
            .map_err(|e| refused(&path, "table", e.message(), "title, [sentence], [consent]"))?;
        // The page has room for a limited number of characters, not bytes.
        let titles = words.title.iter().map(|title| ("title", title, MAX_TITLE));
        let sentences = words.sentence.values().chain(words.consent.values());
        let sentences = sentences.map(|sentence| ("sentence", sentence, MAX_SENTENCE));
        for (key, text, most) in titles.chain(sentences) {
            let n = text.chars().count();
            if n > most {
                let (actual, wanted) = (format!("{n} characters"), format!("at most {most}"));
                return Err(refused(&path, key, &actual, &wanted));
            }
        }
        let path = folder.join("logo.svg");
        let svg = path.is_file().then(|| LOGO.read_text(&path)).transpose()?;
        words.logo = svg.is_some();
        if svg.as_ref().is_some_and(|svg| !svg.contains("<svg")) {
            let hint = "save the logo as SVG";
            return Err(Error::input(path.display(), "another file", "a drawing (SVG)", hint));
        }
        Ok(Self { words, svg })
    }
}

/// Returns the error for an invalid value of a key in `brand.toml`.
fn refused(path: &Path, key: &str, actual: &str, wanted: &str) -> Error {
    Error::input(key, actual, wanted, "see docs/page.md").in_file(path.display(), None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_brand_is_checked_before_it_is_shown() {
        let folder = tempfile::tempdir().unwrap();
        let read = |table: &str, logo: &str| {
            std::fs::write(folder.path().join("brand.toml"), table).unwrap();
            std::fs::write(folder.path().join("logo.svg"), logo).unwrap();
            Brand::read(folder.path()).map_err(|error| error.to_string())
        };
        let svg = "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 9 9'/>";
        let json = json!(read("title = \"Hall\"\n[consent]\nde = \"Ja.\"\n", svg).unwrap().words);
        let wanted = json!({
            "title": "Hall", "sentence": {}, "consent": { "de": "Ja." }, "logo": true,
        });
        assert_eq!(json, wanted);
        for (table, logo, why) in [
            ("name = \"x\"", svg, "name"),
            ("logo = true", svg, "logo"),
            (&format!("title = \"{}\"", "x".repeat(61)), svg, "61 characters"),
            ("", "PNG", "a drawing (SVG)"),
        ] {
            let refused = read(table, logo).unwrap_err();
            assert!(refused.contains(why), "{table}: {refused}");
        }
    }
}
