//! Tests of blind recognition, and of locating a word by its ink.

use super::studio::{Shot, camera, word};
use super::*;

const WORDS: [&str; 4] = ["NOOR", "JAZZ", "FLOCK", "GREEN"];

#[test]
fn words_are_recognized_blindly() {
    for text in WORDS {
        let strokes = word(text);
        let reading = read(&Shot::new(&strokes).photo());
        assert_eq!(reading.text, text, "{reading:?}");
        let boxes = reading.letters.windows(2);
        assert!(boxes.clone().all(|pair| pair[0].box_px[2] < pair[1].box_px[0]), "{reading:?}");
    }
}

#[test]
fn the_teams_faults_leave_the_word_recognizable() {
    let shot = Shot::new(&word("NOOR"));
    let faults = [
        ("trailing by 6 cm", shot.clone().trailing(0.06)),
        ("last 8 cm missing", shot.clone().ending_early(0.08)),
        ("blue light", Shot { tint: [0.0, 0.02, 1.0], ..shot.clone() }),
        ("the floor aglow", Shot { floor_glow: 0.7, ..shot.clone() }),
        ("noise", Shot { noise: 12.0, ..shot }),
    ];
    for (fault, shot) in faults {
        assert_eq!(read(&shot.photo()).text, "NOOR", "{fault}");
    }
}

#[test]
fn a_word_is_read_whichever_way_up_the_photo_is() {
    for text in ["GREEN", "WAVE", "FLOCK"] {
        let photo = Shot::new(&word(text)).photo();
        for quarters in 0..4 {
            let (reading, turns) = read_any_way_up(&quarter_turned(&photo, quarters), "");
            assert_eq!((&*reading.text, turns), (text, (4 - quarters) % 4), "{quarters}");
        }
    }
    let turned = |text| quarter_turned(&Shot::new(&word(text)).photo(), 2);
    assert_eq!(read_any_way_up(&turned("NOOR"), "NOOR").1, 2);
    assert_eq!(read_any_way_up(&turned("MOON"), "MOON").1, 2);
    let moon = word("MOON");
    let poor = Shot { noise: 5.0, light: 0.045, ..Shot::new(&moon) };
    let poor = Shot { camera: camera(&moon, 420, 0.0), ..poor }.trailing(0.013).photo();
    let (reading, turns) = read_any_way_up(&poor, "");
    assert_eq!((&*reading.text, turns), ("MOON", 0), "upside down, NOOW has a larger share");
}

#[test]
fn mirrored_writing_is_read_from_behind() {
    for text in ["GREEN", "FLOCK"] {
        let photo = Shot::new(&word(text)).photo();
        let behind = mirrored(&photo);
        let (upright, _) = read_any_way_up(&behind, "");
        let (reading, turns) = read_mirrored(&behind, &upright, text).unwrap();
        assert_eq!((&*reading.text, turns), (text, 0));
        assert_eq!(read_mirrored(&photo, &read(&photo), ""), None, "{text}");
        assert_eq!(read_mirrored(&photo, &read(&photo), text), None, "{text}");
    }
    // A mirrored DOOM is also clear as it is, but less clear than flipped.
    let photo = Shot::new(&word("DOOM")).photo();
    let upright = read(&mirrored(&photo));
    assert!(upright.is_clear() && upright.text != "DOOM", "{}", upright.text);
    let (reading, _) = read_mirrored(&mirrored(&photo), &upright, "").unwrap();
    assert_eq!(reading.text, "DOOM");
    assert_eq!(read_mirrored(&photo, &read(&photo), ""), None);
}

#[test]
fn a_character_alone_is_read() {
    // In a photo this small, C and L of the team's font only have a probability of 0.8.
    let letters = "ABDEFGHJKMNOPQRSTUVWXYZ";
    type Font = fn(&str) -> Strokes;
    let fonts: [(Font, &str); 3] = [(word, letters), (simplex, letters), (simplex, "23456789CL")];
    for (font, characters) in fonts {
        let is_unread = |c: &char| {
            let reading = read(&Shot::new(&font(&c.to_string())).photo()).of_writing();
            reading.text != c.to_string()
        };
        assert_eq!(characters.chars().filter(is_unread).collect::<String>(), "");
    }
}

#[test]
fn a_credit_below_the_writing_is_passed_over() {
    let word = Shot::new(&word("GREEN")).photo();
    let credit = Shot::new(&simplex("Studio Miller 2024")).photo();
    // The larger one is read by itself, and the rows of the smaller one are too low for a line.
    for shrink in [5, 10] {
        let mut both = PhotoData::clone(&word);
        let width = word.width_px as usize;
        let n_rows = credit.height_px as usize / shrink;
        both.rgb8.resize(3 * width * (word.height_px as usize + n_rows + 10), 0);
        both.height_px += u32::try_from(n_rows).unwrap() + 10;
        let n_columns = credit.width_px as usize / shrink;
        for (y, x) in (0..n_rows).flat_map(|y| (0..n_columns).map(move |x| (y, x))) {
            let within = (0..shrink * shrink).map(|k| {
                let (row, column) = (shrink * y + k / shrink, shrink * x + k % shrink);
                3 * (row * credit.width_px as usize + column)
            });
            let most = within.map(|pixel| credit.rgb8[pixel]).max().unwrap_or(0);
            let pixel = 3 * ((word.height_px as usize + y) * width + x);
            both.rgb8[pixel..pixel + 3].fill(most);
        }
        let reading = read(&Photo::made(both));
        assert_eq!(reading.text, "GREEN", "{shrink}: {reading:?}");
    }
}

#[test]
fn nothing_is_read_where_nothing_is_written() {
    let shot = Shot::new(&word("NOOR"));
    assert_eq!(read(&shot.showing(Vec::new()).photo()).text, "");
    for [width_px, height_px] in [[1, 1], [1, 500], [7, 3]] {
        for level in [0, 255] {
            let rgb8 = vec![level; 3 * width_px as usize * height_px as usize];
            let photo = Photo::made(PhotoData { width_px, height_px, rgb8, scene_toml: None });
            assert_eq!(read(&photo).text, "", "{width_px}x{height_px}");
        }
    }
}

#[test]
fn a_word_is_found_by_its_ink_where_no_camera_is_known() {
    for text in ["NOOR", "JAZZ", "BOX"] {
        let strokes = word(text);
        let photo = Shot::new(&strokes).photo();
        let view = find_word(&photo, &read(&photo), &strokes).unwrap();
        let verdict = Reader::new(&strokes, &ScoreOptions::default()).unwrap();
        let verdict = verdict.score(&photo, &view).unwrap();
        assert!(verdict.readability > 0.5 && verdict.read == text, "{verdict:?}");
    }
}

#[test]
fn a_photo_taken_at_an_angle_is_turned_square_on() {
    let strokes = word("NOOR");
    let shot = Shot { camera: camera(&strokes, 640, 0.7), ..Shot::new(&strokes) };
    let view = View::from(&shot.camera);
    let flat = view.square_on(&shot.photo(), [-0.9, 0.2, 1.2, 1.3], 300.0);
    assert_eq!([flat.width_px, flat.height_px], [630, 330]);
    assert_eq!(read(&flat).text, "NOOR");
}

#[test]
fn two_lines_small_letters_and_accents_are_read_blindly() {
    for (shown, text) in [("HELLO\nWORLD", "HELLO\nWORLD"), ("lemon", "lemon"), ("René", "Rene")] {
        assert_eq!(read(&Shot::new(&simplex(shown)).photo()).text, text);
    }
}

/// Tests several kinds of stars. The net takes a triangle or a ring for a letter, because it knows
/// no other shapes.
#[test]
fn shapes_are_no_writing() {
    let noor = simplex("NOOR");
    let [left, bottom, right, top] = noor.bounds_m();
    let middle = [0.5 * (left + right), 0.5 * (bottom + top)];
    let radius_m = 0.5 * (top - bottom);
    let ring = |n: u32, turns: f64, radius: &dyn Fn(f64) -> [f64; 2]| -> Vec<Move> {
        let sample = |k: u32| {
            let part = f64::from(k) / f64::from(n);
            let [across, up] = radius(part);
            let angle_rad = turns * core::f64::consts::TAU * part;
            let (sin, cos) = (libm::sin(angle_rad), libm::cos(angle_rad));
            [middle[0] + radius_m * across * sin, middle[1] + radius_m * up * cos]
        };
        let moves = (0..n).map(|k| (sample(k), sample(k + 1)));
        moves.map(|(from_m, to_m)| Move { from_m, to_m, lit: true, pace: 1.0 }).collect()
    };
    fn star(part: f64) -> [f64; 2] {
        if ((10.0 * part).round() as u32).is_multiple_of(2) { [1.0; 2] } else { [0.4; 2] }
    }
    let shapes = [
        ring(10, 1.0, &star),
        ring(7, 3.0, &|_| [1.0; 2]),
        ring(9, 4.0, &|_| [1.0; 2]),
        ring(5, 2.0, &|_| [1.0; 2]),
        ring(12, 5.0, &|_| [1.0; 2]),
    ];
    let is_writing = |moves: Vec<Move>| {
        let mut strokes = noor.clone();
        strokes.edit(|strokes| strokes.glyphs.truncate(1));
        strokes.edit(|strokes| strokes.glyphs[0].moves = moves);
        let shot = Shot { camera: camera(&noor, 480, 0.0), ..Shot::new(&strokes) };
        let reading = read(&shot.photo()).of_writing();
        !reading.text.is_empty()
    };
    let n = shapes.into_iter().map(is_writing).filter(|is| *is).count();
    assert_eq!(n, 0, "of 5 stars");
    assert!(!read(&Shot::new(&noor).photo()).of_writing().text.is_empty());
}
