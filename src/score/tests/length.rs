//! Tests of words with one letter more or less than the photo shows.

use noctograph_core::strokes::StrokesData;

use super::*;

/// Words, each with variants that have one letter more or less at the start, in the middle or at
/// the end. Some of the variants are real words.
const PAIRS: [(&str, &[&str]); 10] = [
    ("PARIS", &["ARIS", "PAIS", "PARI", "SPARIS", "PARTIS", "PARISH"]),
    ("EAR", &["AR", "ER", "EA", "NEAR", "EVAR", "EARN"]),
    ("SEND", &["END", "SED", "SEN", "ASEND", "SEEND", "SENDS"]),
    ("BONE", &["ONE", "BOE", "BON", "EBONE", "BORNE", "BONES"]),
    ("PLAY", &["LAY", "PLY", "PLA", "SPLAY", "PLRAY", "PLAYS"]),
    ("lemon", &["emon", "leon", "lemo", "ilemon", "lemmon", "lemons"]),
    ("Emma", &["mma", "Ema", "Emm", "Gemma", "Emtma", "Emmas"]),
    ("HELLO", &["ELLO", "HELO", "HELL", "SHELLO", "HEELLO", "HELLOS"]),
    ("2027", &["027", "227", "202", "42027", "20627", "20273"]),
    ("NOOR", &["OOR", "NOR", "NOO", "ANOOR", "NOTOR", "NOORS"]),
];

#[test]
fn a_letter_too_many_or_too_few_is_seen_wherever_it_is() {
    let mut sure = 0;
    for (shown, others) in PAIRS {
        let shot = Shot::new(&simplex(shown));
        let own = shot.verdict(&simplex(shown));
        assert!(own.legible, "{own:?}");
        for other in others {
            let verdict = shot.verdict(&simplex(other));
            assert!(!verdict.legible, "{shown} as {other}: {verdict:?}");
            assert_eq!(verdict.reason, Some(Reason::OtherLength), "{shown} as {other}");
            sure += usize::from(verdict.readability <= 0.5);
        }
    }
    assert!(sure >= 57, "{sure} of 60 at 0.5 or less");
}

/// Regression test: the lit wall beside HELLO was once read as a J.
#[test]
fn a_lit_wall_is_no_letter() {
    for (word, wall) in [("HELLO", 0.2), ("HELLO", 0.4), ("Sofia", 0.2)] {
        let strokes = simplex(word);
        let shot = Shot { wall, ..Shot::new(&strokes) };
        let verdict = shot.verdict(&strokes);
        assert!(verdict.legible && verdict.read == word, "{wall}: {verdict:?}");
        let blind = read(&shot.photo()).text;
        assert!(blind.eq_ignore_ascii_case(word), "{wall}: {blind}");
    }
}

#[test]
fn a_whole_word_too_many_is_seen() {
    let both = Shot::new(&simplex("HELLO WORLD"));
    for other in ["HELLO", "WORLD"] {
        let verdict = both.verdict(&simplex(other));
        assert!(!verdict.legible && verdict.is_contradicted(), "{other}: {verdict:?}");
    }
}

#[test]
fn equal_shapes_in_another_case_are_no_rivals() {
    for word in ["Mia", "min", "ill", "Zoë"] {
        let strokes = simplex(word);
        let verdict = Shot::new(&strokes).verdict(&strokes);
        assert!(verdict.readability > 0.6 && verdict.read == word, "{word}: {verdict:?}");
        let rival = &verdict.rival.as_ref().unwrap().word;
        assert!(!rival.eq_ignore_ascii_case(word), "{word}: rival {rival}");
    }
}

#[test]
fn two_lines_agree_with_their_light_as_one_does() {
    let strokes = simplex("HELLO\nWORLD");
    let verdict = Shot::new(&strokes).explained(&strokes, &Known::default());
    assert!(verdict.faithfulness.unwrap() > 0.97, "{verdict:?}");
    assert_eq!(verdict.read, "HELLO\nWORLD");
}

#[test]
fn told_the_word_it_is_as_likely_as_read_blindly() {
    let noor = word("NOOR");
    let photo = Shot::new(&noor).photo();
    // The camera is pointed beside the word.
    let aside = Shot::new(&noor).shifted(0.5, 0.2);
    let reader = Reader::new(&noor, &ScoreOptions::default()).unwrap();
    let verdict = reader.score(&photo, &(&aside.camera).into()).unwrap();
    assert_eq!(read(&photo).text, "NOOR");
    assert!(verdict.legible, "{verdict:?}");
}

#[test]
fn gaps_between_words_are_spaces() {
    for text in ["GO ON", "WE CAN DO"] {
        assert_eq!(read(&Shot::new(&simplex(text)).photo()).text, text);
    }
}

/// A bar through two letters joins them into one glyph, whose second letter is not judged.
#[test]
fn letters_that_touch_are_never_called_legible() {
    let mut joined: StrokesData = (*simplex("ALSO")).clone();
    let second = joined.glyphs.remove(1);
    joined.glyphs[0].moves.extend(second.moves);
    let joined = Strokes::new(joined).unwrap();
    let verdict = Shot::new(&joined).verdict(&joined);
    assert_eq!((verdict.legible, verdict.reason), (false, Some(Reason::OtherLength)));
    assert_eq!((verdict.read.chars().count(), verdict.letters.len()), (3, 3), "{verdict:?}");
}
