//! Tests of the reader on photos drawn here: clean words, words with faults, and other shapes.

use super::*;
use noctograph_core::camera::Camera;
use noctograph_core::strokes::{Glyph, Move, StrokesData};
use noctograph_letters::{LetterOptions, write};
use studio::{Dice, Shot, camera, score, word};

mod length;
mod reading;
mod studio;
mod why;

/// Returns a word in the team's repaired font, which includes digits.
fn fixed(text: &str) -> Strokes {
    write(text, &LetterOptions { font: "ae483-fixed".into(), ..Default::default() }).unwrap()
}

fn box_of_light(strokes: &Strokes) -> Vec<Move> {
    let [left, bottom, right, top] = strokes.bounds_m();
    let rows = (0..=100).map(|row| bottom + (top - bottom) * f64::from(row) / 100.0);
    rows.map(|y| Move { from_m: [left, y], to_m: [right, y], lit: true, pace: 1.0 }).collect()
}

fn scribble(strokes: &Strokes, seed: u64, n_lines: usize) -> Vec<Move> {
    let [left, bottom, right, top] = strokes.bounds_m();
    let mut dice = Dice(seed);
    let mut point = || [left + (right - left) * dice.roll(), bottom + (top - bottom) * dice.roll()];
    let points: Vec<_> = (0..=n_lines).map(|_| point()).collect();
    points.windows(2).map(|p| Move { from_m: p[0], to_m: p[1], lit: true, pace: 1.0 }).collect()
}

fn simplex(text: &str) -> Strokes {
    write(text, &LetterOptions { font: "simplex".into(), ..Default::default() }).unwrap()
}

/// True if every letter is read as expected and no other word is likelier.
fn is_read(verdict: &Verdict) -> bool {
    verdict.letters.iter().all(|letter| letter.best == Some(letter.expected))
        && verdict.rival.as_ref().is_none_or(|rival| rival.p < 0.5)
}

#[test]
fn clean_words_are_legible() {
    let words = ["HELLO", "quiz", "JUMP"].map(simplex);
    for strokes in words.into_iter().chain([word("NOOR")]) {
        let verdict = Shot::new(&strokes).verdict(&strokes);
        assert!(verdict.legible && verdict.read == strokes.word, "{verdict:?}");
    }
}

#[test]
fn every_letter_of_a_clean_word_is_right() {
    for strokes in [simplex("FLOCK"), simplex("Wavy"), word("GHOST"), fixed("BOX")] {
        let verdict = Shot::new(&strokes).verdict(&strokes);
        assert!(is_read(&verdict), "{verdict:?}");
    }
}

#[test]
fn accents_count_as_their_letters_and_punctuation_is_not_judged() {
    let strokes = simplex("Zoë!");
    let verdict = Shot::new(&strokes).verdict(&strokes);
    assert!(is_read(&verdict) && verdict.read == "Zoë!", "{verdict:?}");
    assert_eq!((verdict.letters[3].p, verdict.letters[3].best), (None, Some('!')));
    assert!(verdict.letters[2].p > Some(0.5), "{verdict:?}");
}

/// Letters that the net was not trained on count as whatever the net reads in a faultless drawing
/// of them. A ligature counts as its two letters.
#[test]
fn latin_letters_of_other_languages_are_read() {
    for name in ["Łucja", "Søren", "Þór", "Kjær", "Cœur", "Ægir"] {
        let strokes = simplex(name);
        let verdict = Shot::new(&strokes).verdict(&strokes);
        assert!(is_read(&verdict) && verdict.read == name, "{name}: {verdict:?}");
        assert_eq!(verdict.letters.len(), name.chars().count(), "{name}");
    }
    // A ligature whose drawing does not look like two letters is read as one letter.
    let strokes = simplex("Kjær");
    let verdict = Shot::new(&simplex("Kjar")).verdict(&strokes);
    assert!(!verdict.legible && !is_read(&verdict), "{verdict:?}");
}

#[test]
fn the_teams_faults_leave_every_letter_right() {
    let noor = word("NOOR");
    let shot = Shot::new(&noor);
    let faults = [
        ("7 cm to the left", shot.clone().shifted(-0.07, 0.0)),
        ("trailing by 6 cm", shot.clone().trailing(0.06)),
        ("trailing by 10 cm", shot.clone().trailing(0.10)),
        ("last 10 cm missing", shot.clone().ending_early(0.10)),
        ("all of these", shot.clone().trailing(0.06).ending_early(0.10).shifted(-0.07, 0.03)),
        ("wandering by 2 cm", shot.clone().wandering(0.02)),
        ("a hundredth of the light", Shot { light: 0.012, sky: 0.0, ..shot.clone() }),
        ("blue light", Shot { tint: [0.0, 0.02, 1.0], ..shot.clone() }),
        ("the floor aglow", Shot { floor_glow: 0.7, ..shot.clone() }),
        ("seen from 30 degrees aside", Shot { camera: camera(&noor, 480, 0.52), ..shot.clone() }),
        ("noise", Shot { noise: 12.0, ..shot.clone() }),
    ];
    for (fault, shot) in faults {
        let verdict = shot.verdict(&noor);
        assert!(is_read(&verdict), "{fault}: {verdict:?}");
    }
}

#[test]
fn great_faults_do_not_pass() {
    let noor = word("NOOR");
    let shot = Shot::new(&noor);
    let faults = [
        ("wandering by 8 cm", shot.clone().wandering(0.08)),
        ("trailing by 40 cm", shot.clone().trailing(0.40)),
        ("last 60 cm missing", shot.clone().ending_early(0.60)),
        ("mirrored", shot.clone().mapped(|[x, y]| [0.3 - x, y])),
        ("upside down", shot.clone().mapped(|[x, y]| [0.3 - x, 1.5 - y])),
    ];
    for (fault, shot) in faults {
        let verdict = shot.verdict(&noor);
        assert!(!verdict.legible && verdict.readability < 0.7, "{fault}: {verdict:?}");
        let of_letters = [Reason::Misread, Reason::OtherLength, Reason::Unsure].map(Some);
        assert!(of_letters.contains(&verdict.reason), "{fault}: {verdict:?}");
    }
}

#[test]
fn what_is_no_word_is_not_legible() {
    let noor = word("NOOR");
    let shot = Shot::new(&noor);
    let blank = shot.showing(Vec::new()).verdict(&noor);
    assert_eq!((blank.legible, blank.reason), (false, Some(Reason::NoLight)), "{blank:?}");
    assert_eq!((&blank.read[..], blank.letters[0].best), ("????", None), "nothing is read");
    for text in ["TREE", "MOON", "NEAR", "NOON", "ROON"] {
        let other = shot.showing(Shot::new(&word(text)).moves).verdict(&noor);
        assert!(!other.legible && other.readability < 0.5, "{text}: {other:?}");
    }
    for text in ["NOOR", "O", "A", "M"] {
        let strokes = word(text);
        let filled = Shot::new(&strokes).showing(box_of_light(&strokes)).verdict(&strokes);
        assert!(!filled.legible && filled.readability <= 0.3, "{filled:?}");
    }
}

#[test]
fn scribbles_are_not_legible() {
    for text in ["NOOR", "HI", "O", "A", "M"] {
        let strokes = word(text);
        let shot = Shot::new(&strokes);
        for n_lines in [8, 60] {
            for seed in 1..=2 {
                let verdict = shot.showing(scribble(&strokes, seed, n_lines)).verdict(&strokes);
                let p = verdict.readability;
                assert!(!verdict.legible && p < 0.35, "{n_lines}, {seed}: {verdict:?}");
            }
        }
    }
}

/// Draws each letter between an N and an E, and scores it as each other letter of its group.
#[test]
fn one_wrong_letter_is_not_legible() {
    for group in ["OCGQD", "EFPRB", "ITLJ", "MNHW", "UVY", "KXA", "SZ"] {
        let words: Vec<Strokes> =
            group.chars().map(|letter| fixed(&format!("N{letter}E"))).collect();
        for shown in &words {
            let shot = Shot { camera: camera(shown, 240, 0.0), ..Shot::new(shown) };
            let (photo, view) = (shot.photo(), (&shot.camera).into());
            for meant in words.iter().filter(|meant| meant.word != shown.word) {
                let reader = Reader::new(meant, &ScoreOptions::default()).unwrap();
                let verdict = reader.score(&photo, &view).unwrap();
                assert!(!verdict.legible, "{} as {}: {verdict:?}", shown.word, meant.word);
            }
        }
    }
}

#[test]
fn a_wrong_letter_is_named() {
    for (meant, shown) in [("FED", "EED"), ("COO", "COQ"), ("VET", "YET"), ("IN", "TN")] {
        let verdict = Shot::new(&word(shown)).verdict(&word(meant));
        assert_eq!(verdict.read, shown, "{verdict:?}");
    }
}

#[test]
fn a_stem_alone_is_no_l() {
    let stem = [Move { from_m: [-0.15, 1.0], to_m: [-0.15, 0.5], lit: true, pace: 1.0 }];
    let l = fixed("L");
    let verdict = Shot::new(&l).showing(stem.to_vec()).verdict(&l);
    assert!(!verdict.legible && verdict.letters[0].best != Some('L'), "{verdict:?}");
}

#[test]
fn a_reason_agrees_with_its_number() {
    let noor = word("NOOR");
    let shot = Shot::new(&noor);
    let strict = ScoreOptions { legible_probability: 1.0 };
    let verdict = score(&shot.photo(), &noor, &shot.camera, &strict).unwrap();
    assert_eq!((verdict.legible, verdict.reason), (false, Some(Reason::Unsure)), "{verdict:?}");
    let verdict = shot.verdict(&word("NOORS"));
    assert!(!verdict.legible, "{verdict:?}");
    assert_eq!(verdict.reason, Some(Reason::OtherLength), "{verdict:?}");
    assert!(verdict.is_contradicted(), "{verdict:?}");
}

#[test]
fn a_missing_letter_is_a_gap() {
    let near = word("NEAR");
    let mut moves = Shot::new(&near).moves;
    let a = &near.glyphs[2].moves;
    moves.retain(|step| !a.contains(step));
    let verdict = Shot::new(&near).showing(moves).verdict(&near);
    // The third position is dark, so the spelling leaves its letter open.
    assert_eq!((&verdict.read[..], verdict.letters[2].best), ("NE?R", None), "{verdict:?}");
    assert!(!verdict.legible && verdict.readability < 0.7, "{verdict:?}");
    assert_eq!(verdict.rival.unwrap().word, "NER");
}

#[test]
fn digits_of_another_font_are_read() {
    let cells = word("AAAA");
    let round = [0.0, 0.3, 0.7, 1.0];
    let corners = [(1, 0), (0, 1), (0, 2), (1, 3), (2, 3), (3, 2), (3, 1), (2, 0), (1, 0)];
    let zero = corners.map(|(x, y): (usize, usize)| [round[x], round[y]]);
    let drawn: [(char, &[[f64; 2]]); 4] = [
        ('7', &[[0.0, 1.0], [1.0, 1.0], [0.3, 0.0]]),
        ('4', &[[0.8, 0.0], [0.8, 1.0], [0.0, 0.3], [1.0, 0.3]]),
        ('2', &[[0.0, 0.8], [0.2, 1.0], [0.8, 1.0], [1.0, 0.7], [0.0, 0.0], [1.0, 0.0]]),
        ('0', &zero),
    ];
    let glyphs = cells.glyphs.iter().zip(drawn).map(|(glyph, (character, points))| {
        let place = |p: [f64; 2]| [glyph.cell.left_m + 0.3 * p[0], 0.5 + 0.5 * p[1]];
        let moves = points.windows(2);
        let moves =
            moves.map(|p| Move { from_m: place(p[0]), to_m: place(p[1]), lit: true, pace: 1.0 });
        Glyph { character, cell: glyph.cell, moves: moves.collect() }
    });
    let strokes = Strokes::made(StrokesData {
        word: "7420".into(),
        glyphs: glyphs.collect(),
        ..cells.clone().into_data()
    });
    let verdict = Shot::new(&strokes).verdict(&strokes);
    assert!(verdict.legible && verdict.read == "7420", "{verdict:?}");
}

#[test]
fn the_place_is_found_and_its_limits_hold() {
    let noor = word("NOOR");
    let shot = Shot::new(&noor);
    let placed = |shot: Shot| shot.verdict(&noor);
    let verdict = placed(shot.clone().shifted(-0.22, 0.11));
    let placement = verdict.placement.unwrap();
    let [right, up] = placement.shift_m;
    assert!((right + 0.22).abs() < 0.01 && (up - 0.11).abs() < 0.01, "{placement:?}");
    assert!(verdict.legible, "a word may hang anywhere within reach: {verdict:?}");

    let about =
        |scale: f64| move |[x, y]: [f64; 2]| [0.15 + scale * (x - 0.15), 0.75 + scale * (y - 0.75)];
    let verdict = placed(shot.clone().mapped(about(0.9)));
    assert!((verdict.placement.unwrap().scale - 0.9).abs() < 0.02, "{verdict:?}");
    assert!(verdict.legible, "{verdict:?}");

    fn turned(angle: f64) -> impl Fn([f64; 2]) -> [f64; 2] {
        let (sin, cos) = libm::sincos(angle);
        move |[x, y]: [f64; 2]| {
            let (x, y) = (x - 0.15, y - 0.75);
            [0.15 + cos * x - sin * y, 0.75 + sin * x + cos * y]
        }
    }
    for angle in [-0.1, 0.12] {
        let verdict = placed(shot.clone().mapped(turned(angle)));
        assert!((verdict.placement.unwrap().rotation_rad - angle).abs() < 0.02, "{verdict:?}");
        assert!(verdict.legible, "{verdict:?}");
    }

    for far in [shot.clone().shifted(0.0, 0.34), shot.mapped(about(1.22))] {
        let verdict = placed(far);
        assert!(verdict.legible || verdict.reason == Some(Reason::OutOfRange), "{verdict:?}");
    }
}

#[test]
fn degenerate_photos_have_a_verdict() {
    let noor = word("NOOR");
    let shot = Shot::new(&noor);
    let with_width = |width_px| Shot { camera: camera(&noor, width_px, 0.0), ..shot.clone() };
    let few = with_width(96).verdict(&noor);
    assert!(few.legible && few.cap_height_px.unwrap() < 20.0, "sharp, at 19 pixels: {few:?}");
    let small = with_width(24).verdict(&noor);
    assert_eq!(small.reason, Some(Reason::TooSmall), "{small:?}");

    let mut camera = shot.camera.clone();
    let mut photo = shot.photo();
    photo.edit(|photo| photo.rgb8.fill(255));
    let white = score(&photo, &noor, &camera, &ScoreOptions::default()).unwrap();
    assert_eq!(white.reason, Some(Reason::NoLight), "all is equally bright");

    (camera.width_px, camera.height_px) = (1, 1);
    for byte in [0, 255] {
        let dot = Photo::made(PhotoData {
            width_px: 1,
            height_px: 1,
            rgb8: vec![byte; 3],
            scene_toml: None,
        });
        let verdict = score(&dot, &noor, &camera, &ScoreOptions::default()).unwrap();
        assert!(!verdict.legible && verdict.reason.is_some(), "{verdict:?}");
    }

    let mut away = shot.clone();
    away.camera.camera_from_world.fill_diagonal(-1.0);
    let photo = Shot::new(&noor).photo();
    let verdict = score(&photo, &noor, &away.camera, &ScoreOptions::default()).unwrap();
    assert_eq!(verdict.reason, Some(Reason::NotInPhoto), "{verdict:?}");
}

#[test]
fn unusable_input_is_refused_by_name() {
    let noor = word("NOOR");
    let shot = Shot::new(&noor);
    let refuse = |strokes: &Strokes, camera: &Camera, options: &ScoreOptions| {
        score(&shot.photo(), strokes, camera, options).unwrap_err().to_string()
    };
    let options = ScoreOptions::default();
    let empty = Strokes::made(StrokesData { glyphs: Vec::new(), ..noor.clone().into_data() });
    assert!(refuse(&empty, &shot.camera, &options).contains("empty word"));
    let mut foreign = noor.clone();
    foreign.edit(|foreign| foreign.glyphs[2].character = 'Ж');
    let text = refuse(&foreign, &shot.camera, &options);
    assert!(text.contains("letter 3") && text.contains("'Ж'"), "{text}");
    assert!(
        text.contains("the reader knows") && !is_judged(&foreign) && is_judged(&noor),
        "{text}"
    );
    let mut dark = noor.clone();
    dark.edit(|dark| dark.glyphs[1].moves.clear());
    assert!(refuse(&dark, &shot.camera, &options).contains("lit stroke"));
    let mut wide = noor.clone();
    wide.edit(|wide| wide.glyphs[0].cell.width_m = 1e3);
    assert!(refuse(&wide, &shot.camera, &options).contains("width of a letter"));
    let text = refuse(&noor, &camera(&noor, 320, 0.0), &options);
    assert!(text.contains("480 x 270") && text.contains("320 x 180"), "{text}");
    let never = ScoreOptions { legible_probability: 1.5 };
    assert!(refuse(&noor, &shot.camera, &never).contains("score.legible_probability"));
}

/// Returns the keys in each table of `docs/reference/verdict.md`.
fn documented() -> Vec<Vec<&'static str>> {
    let tables = include_str!("../../../docs/reference/verdict.md").split("\n\n");
    let key = |row: &'static str| row.strip_prefix("| `")?.split('`').next();
    let mut tables: Vec<Vec<&str>> = tables.map(|t| t.lines().filter_map(key).collect()).collect();
    tables.retain(|keys| !keys.is_empty());
    tables.iter_mut().for_each(|keys| keys.sort_unstable());
    tables
}

#[test]
fn the_verdict_is_written_as_it_is_documented() {
    let noor = word("NOOR");
    let shot = Shot::new(&noor).ending_early(0.25);
    let verdict = serde_json::to_value(shot.explained(&noor, &Known::default())).unwrap();
    fn keys(value: &serde_json::Value) -> Vec<String> {
        value.as_object().unwrap().keys().cloned().collect()
    }
    let [top, calibration, rival, placement, letter, cause, kinds] =
        documented().try_into().expect("seven tables");
    assert_eq!(keys(&verdict), top, "sorted by serde_json");
    assert_eq!(keys(&verdict["calibration"]), calibration);
    assert_eq!(keys(&verdict["rival"]), rival);
    assert_eq!(keys(&verdict["placement"]), placement);
    assert_eq!(keys(&verdict["letters"][0]), letter);
    assert_eq!(keys(&verdict["letters"][0]["rivals"][0]), ["letter", "p"]);
    assert_eq!(keys(&verdict["letters"][0]["confusion"][0]), ["letter", "p"]);
    assert_eq!(keys(&verdict["causes"][0]), cause);
    assert_eq!(keys(&verdict["causes"][0]["missing"]), ["from_mm", "stroke", "to_mm"]);
    use CauseKind::*;
    let advice = Advice { kind: Dim, text: String::new(), gain: None };
    let advice = serde_json::to_value(advice).unwrap();
    assert_eq!(keys(&advice), ["gain", "kind", "text"]);
    let all = [
        MissingRun, LogGap, LitTransit, Streak, DwellBlob, Overlap, OtherStray, Shifted, Glow,
        FewPixels, Dim, Design, OffPath,
    ];
    let mut all = all.map(|kind| serde_json::to_value(kind).unwrap().as_str().unwrap().to_owned());
    all.sort_unstable();
    assert_eq!(all.to_vec(), kinds);
    assert_eq!(serde_json::to_value(Reason::NoLight).unwrap(), "no_light");
}

#[test]
fn the_same_photo_has_the_same_verdict_on_any_number_of_threads() {
    let noor = word("NOOR");
    let shot = Shot::new(&noor).wandering(0.03);
    let (photo, view) = (shot.photo(), View::from(&shot.camera));
    let reader = Reader::new(&noor, &ScoreOptions::default()).unwrap();
    let explain = || {
        let (verdict, marks) = reader.explain(&photo, &view, &Known::default()).unwrap();
        // Rust prints floats with the fewest digits that identify them, so equal texts mean equal
        // bits.
        format!("{verdict:?} {marks:?}")
    };
    let alone = explain();
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(explain)).collect();
        for thread in threads {
            assert_eq!(thread.join().unwrap(), alone);
        }
    });
}
