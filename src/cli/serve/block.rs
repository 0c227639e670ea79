//! Words that are not flown: a list of the host, one a line, which is found inside of what is
//! written whatever its case, accents and look-alikes are.

use std::path::Path;

use unicode_normalization::UnicodeNormalization;
use unicode_normalization::char::is_combining_mark;

use super::Result;
use noctograph_core::files::Limit;

const LIST: Limit = Limit { bytes: 1 << 20, what: "a list of words", hint: "shorten the list" };

/// Latin letters, each with what stands for it: digits, signs, Cyrillic and Greek of the same
/// shape.
const ALIKE: &str = "a4@αа b8βв cс¢( e3€εе g9 hηн i1!|ιіl kκк mμм nνп o0οо pρр s5$ѕ t7+τт vυu xχх \
                     yγу z2ζ";

#[derive(Debug, Default)]
pub(super) struct BlockList(Vec<String>);

impl BlockList {
    /// Reads a list; lines that begin with `#` are remarks.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let text = LIST.read_text(path)?;
        let lines = text.lines().map(str::trim).filter(|line| !line.starts_with('#'));
        Ok(Self(lines.map(folded).filter(|word| !word.is_empty()).collect()))
    }

    /// Whether a text holds a word of the list.
    pub(super) fn holds(&self, text: &str) -> bool {
        let text = folded(text);
        self.0.iter().any(|word| text.contains(word))
    }
}

/// Letters alone, without case, accents and look-alikes; one that is repeated counts once.
fn folded(text: &str) -> String {
    let alike = |letter: char| {
        let known = ALIKE.split(' ').find(|alike| alike.contains(letter));
        known.and_then(|alike| alike.chars().next()).unwrap_or(letter)
    };
    let plain = text.nfkd().filter(|c| !is_combining_mark(*c)).flat_map(char::to_lowercase);
    let mut letters: Vec<char> = plain.map(alike).filter(|c| c.is_alphanumeric()).collect();
    letters.dedup();
    letters.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_is_found_in_other_clothes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("list");
        std::fs::write(&path, "# not here\nDamn\n\nпривет\n").unwrap();
        let list = BlockList::read(&path).unwrap();
        for text in ["damn", "D A M N", "d@mñ", "DÄMN it", "dаmn", "daamn", "ＤＡＭＮ", "Привет!"]
        {
            assert!(list.holds(text), "{text}");
        }
        for text in ["NOOR", "dam", "#", "not here"] {
            assert!(!list.holds(text), "{text}");
        }
        assert!(!BlockList::default().holds("damn"));
    }
}
