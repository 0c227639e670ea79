//! The characters and classes of the net, and which classes count as a character.
//!
//! The net has 62 characters: A–Z, a–z and 0–9. Characters that look alike count as one: the two
//! cases of a letter, O and 0, I, i, l and 1, a letter with and without its accent, and Cyrillic
//! and Greek letters that look like Latin ones. For a Latin letter that the net was not trained on
//! (Ł, ø, æ, þ), the letter that the net reads in a faultless drawing of it counts as well
//! ([`super::judge::Expected::learn`]).

use unicode_normalization::UnicodeNormalization;

use super::net::N_CLASSES;

/// The net's characters. The first character is class 1.
const CHARACTERS: &[u8; 62] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789";

/// Letters and digits that the net distinguishes, regardless of case.
pub(super) const NAMES: &[u8; 36] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789";

/// A set of classes, with one bit for each class.
pub(super) type Classes = u64;

/// The class of the blank between two letters.
pub(super) const BLANK: Classes = 1;

/// The class of light that no letter explains.
pub(super) const NO_LETTER: Classes = 1 << (N_CLASSES - 1);

/// Latin capitals, each followed by the accented, Cyrillic and Greek capitals that look like it.
const SHAPES: &str = "AÀÁÂÃÄÅĀĂĄǍАΑ BВΒƁ CÇĆĈĊČСϹ DĎĐÐƊ EÈÉÊËĒĔĖĘĚЕЁΕ GĜĞĠĢ HĤĦНΗ IÌÍÎÏĨĪĬĮİІЇΙ \
                      JĴЈ KĶКΚƘ LĹĻĽĿŁ MМΜ NÑŃŅŇΝ OÒÓÔÕÖØŌŎŐОΟ PРΡ RŔŖŘ SŚŜŞŠȘЅ TŢŤŦȚТΤ \
                      UÙÚÛÜŨŪŬŮŰŲ VѴ WŴ XХΧ YÝŶŸУΥƳ ZŹŻŽΖ";

/// Latin letters with marks: Latin-1 Supplement to Extended-B, and Extended Additional in Unicode.
const LATIN_WITH_MARKS: [core::ops::RangeInclusive<char>; 3] =
    ['\u{c0}'..='\u{259}', '\u{1e00}'..='\u{1e99}', '\u{1ea0}'..='\u{1ef9}'];

/// True for Latin letters with marks, such as accents, and for other letters in the same blocks.
fn has_mark(character: char) -> bool {
    LATIN_WITH_MARKS.iter().any(|block| block.contains(&character))
}

/// Further Latin letters, each with the letters that look like it, the most similar first.
const OTHER_LETTERS: &str = "ßẞ:B ÆæǼǽ:AE Œœ:OE Ĳĳ:IJ Þþ:P Ŋŋ:N Əə:E Ŧŧ:T ĸ:K";

/// The sharp s as a small letter and as a capital.
const SHARP_S: [char; 2] = ['ß', 'ẞ'];

/// Returns the Latin letter or digit that a character looks like, in the case of that character.
/// Returns `None` for characters that look like none.
pub(super) fn latin(character: char) -> Option<char> {
    if character.is_ascii_alphanumeric() {
        return Some(character);
    }
    // A small Greek nu looks like v, although its capital looks like N.
    if character == 'ν' {
        return Some('v');
    }
    if let Some(near) = near_shapes(character) {
        let nearest = near.chars().next()?;
        let is_sharp_s = SHARP_S.contains(&character);
        return Some(if is_sharp_s { nearest } else { with_case_of(nearest, character) });
    }
    // Letters of other scripts are looked up by capital. Marks are removed by decomposition.
    let capital = character.to_uppercase().next()?;
    let Some(shape) = SHAPES.split(' ').find(|shape| shape.contains(capital)) else {
        let base = has_mark(character).then(|| character.nfd().next())??;
        return base.is_ascii_alphabetic().then_some(base);
    };
    Some(with_case_of(shape.chars().next()?, character))
}

/// Returns the letters that a letter of [`OTHER_LETTERS`] looks like, or `None` for any other.
fn near_shapes(character: char) -> Option<&'static str> {
    let mut rows = OTHER_LETTERS.split(' ').filter_map(|row| row.split_once(':'));
    rows.find_map(|(letters, near)| letters.contains(character).then_some(near))
}

/// Returns the two letters of a ligature in the ligature's case, or `None` for other characters.
pub(super) fn ligature(character: char) -> Option<[char; 2]> {
    let mut letters = near_shapes(character)?.chars().map(|near| with_case_of(near, character));
    Some([letters.next()?, letters.next()?])
}

/// True for a Latin letter that the net was not trained on.
pub(super) fn is_untrained(character: char) -> bool {
    has_mark(character) || near_shapes(character).is_some()
}

/// Returns the class of a character, or `None` if the net lacks it.
pub(super) fn class_of(character: char) -> Option<usize> {
    CHARACTERS.iter().position(|listed| char::from(*listed) == character).map(|index| index + 1)
}

/// Returns the classes that count as a character, or `None` if the net has none for it.
pub(super) fn classes_of(character: char) -> Option<Classes> {
    let mark = if is_untrained(character) { NO_LETTER } else { 0 };
    let classes = match latin(character)? {
        // Readers who do not know the sharp s take it for a B, b, 3 or 8.
        _ if SHARP_S.contains(&character) => set_of("Bb38"),
        _ if let Some(near) = near_shapes(character) => {
            set_of(near) | set_of(&near.to_ascii_lowercase())
        }
        'O' | 'o' | '0' => set_of("Oo0"),
        'I' | 'i' | '1' => set_of("Iil1"),
        'l' => set_of("Iil1L"),
        letter => bit(letter.to_ascii_uppercase()) | bit(letter.to_ascii_lowercase()),
    };
    Some(classes | mark)
}

/// True for a letter or digit without classes. Modifier letters, as in Uzbek, are punctuation.
pub(super) fn is_foreign(character: char) -> bool {
    let is_modifier = ('\u{2b0}'..='\u{2ff}').contains(&character);
    character.is_alphanumeric() && !is_modifier && classes_of(character).is_none()
}

/// Returns the classes of all characters with the same shape as `character`, regardless of size.
pub(super) fn alike(character: char) -> Classes {
    match character {
        'O' | 'o' | '0' => set_of("Oo0"),
        'I' | 'l' | '1' => set_of("Il1"),
        _ if "CcKkPpSsUuVvWwXxZz".contains(character) => {
            bit(character.to_ascii_uppercase()) | bit(character.to_ascii_lowercase())
        }
        _ => bit(character),
    }
}

/// Returns `letter`, a capital or a digit, in the case of `other`.
pub(super) fn with_case_of(letter: char, other: char) -> char {
    if other.is_lowercase() { letter.to_ascii_lowercase() } else { letter }
}

/// Returns the letters and digits with their classes, the digits first if `digits_first` is true. A
/// class that is in `taken` or belongs to an earlier name is omitted, as is a name without
/// remaining classes.
pub(super) fn names(mut taken: Classes, digits_first: bool) -> Vec<(char, Classes)> {
    let (letters, digits) = NAMES.split_at(26);
    let order = if digits_first { [digits, letters] } else { [letters, digits] };
    let mut names = Vec::new();
    for name in order.into_iter().flatten().map(|name| char::from(*name)) {
        let free = classes_of(name).expect("names are characters of the net") & !taken;
        taken |= free;
        if free != 0 {
            names.push((name, free));
        }
    }
    names
}

/// True if a reading spells a word. Characters of the same shape are equal, and a small l equals
/// both I and L. Case, marks, punctuation and spaces are ignored.
pub(super) fn spells(reading: &str, word: &str) -> bool {
    let read = reading.chars().filter(|c| !c.is_whitespace()).map(shape);
    let wanted = word.chars().filter(|c| classes_of(*c).is_some()).map(shape);
    read.clone().count() == wanted.clone().count()
        && read.zip(wanted).all(|(read, wanted)| read & wanted != 0)
}

/// Returns the capitals and digits that a character looks like, as a set of classes.
fn shape(character: char) -> Classes {
    let mark = if has_mark(character) { NO_LETTER } else { 0 };
    mark | match latin(character) {
        Some(_) if SHARP_S.contains(&character) => set_of("B38"),
        Some('O' | 'o' | '0') => set_of("O"),
        Some('I' | 'i' | '1') => set_of("I"),
        Some('l') => set_of("IL"),
        Some(letter) => bit(letter.to_ascii_uppercase()),
        None => NO_LETTER,
    }
}

/// Returns the classes of a character in a reading, in which `?` is light that no letter explains.
pub(super) fn seen_as(character: char) -> Classes {
    classes_of(character).unwrap_or(NO_LETTER)
}

/// Returns the class of a character as a set, which is empty if the net lacks the character.
fn bit(character: char) -> Classes {
    class_of(character).map_or(0, |class| 1 << class)
}

/// Returns the classes of several characters.
fn set_of(characters: &str) -> Classes {
    characters.chars().fold(0, |set, character| set | bit(character))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_shapes_are_one_class_and_foreign_letters_have_none() {
        for same in ["Oo0ОοØ", "Ii1", "SsЅŠ", "AaАàΑ", "eëЕ", "Hн", "Xχх"] {
            let mut classes = same.chars().map(|character| classes_of(character).unwrap());
            let first = classes.next().unwrap();
            assert!(first != 0 && classes.all(|other| other & !NO_LETTER == first), "{same}");
        }
        for foreign in "ЖΩ漢!-.⇧".chars() {
            assert_eq!(classes_of(foreign), None, "{foreign}");
        }
        assert_eq!((latin('é'), latin('ν'), latin('Ø')), (Some('e'), Some('v'), Some('O')));
        assert_eq!((latin('ế'), latin('Ợ'), latin('ư')), (Some('e'), Some('O'), Some('u')));
        assert_eq!((latin('ן'), latin('ə'), latin('Œ')), (None, Some('e'), Some('O')));
        assert_eq!((ligature('œ'), ligature('ß')), (Some(['o', 'e']), None));
    }

    #[test]
    fn modifier_letters_are_no_letters_that_are_read() {
        for (character, is) in [('ʻ', false), ('ʼ', false), ('ɓ', false), ('Ж', true), ('ə', false)]
        {
            assert_eq!(is_foreign(character), is, "{character}");
        }
    }

    #[test]
    fn a_text_spells_a_word_whatever_its_case_accents_and_punctuation() {
        for same in ["Zoe10", "ZOElO", "zoeio", "Z0EI0", "Zo? 10"] {
            assert!(spells(same, "Zoë-10!"), "{same}");
        }
        for other in ["Zoe", "Zoe1", "Zue10", "AZoe10", ""] {
            assert!(!spells(other, "Zoë-10!"), "{other}");
        }
        for (read, word) in [("hello", "HELLO"), ("HEIIO", "Hello"), ("MLA", "Mla"), ("MIN", "min")]
        {
            assert!(spells(read, word), "{read}");
        }
        for (read, word) in [("HEIIO", "HELLO"), ("MLA", "Mia"), ("TABIE", "TABLE")] {
            assert!(!spells(read, word), "{read}");
        }
        assert!(spells("Stra3e", "Straße") && !spells("Stra3e", "Strase"));
    }

    #[test]
    fn no_class_has_two_names() {
        for digits_first in [false, true] {
            let taken = classes_of('T').unwrap();
            let names = names(taken, digits_first);
            let all = names.iter().fold(0, |all, (name, own)| {
                assert_eq!((all | taken) & own, 0, "{name}");
                all | own
            });
            assert_eq!(all | taken, !(BLANK | NO_LETTER), "each class has a name");
            assert_eq!(names.iter().any(|(name, _)| *name == '0'), digits_first);
        }
    }
}
