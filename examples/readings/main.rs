//! Generates photographs and strips of light for the reader from random seeds, in a single process.
//!
//! - `strips OUT WORDS FACES... [--first 0 --count 1000]` appends strips of photographs, two per
//!   flight, for training the network. A strip consists of its labels, its width and its bytes.
//! - `photos OUT WORDS FACES... [--first 0 --count 320]` writes photographs for readers, their
//!   scenes, and truth.json. Each word is used once.
//! - `clean OUT WORDS` photographs each word in the default scene in two sizes for calibration.
//! - `verdicts OUT` prints a line for each photograph of OUT/truth.json, for the calibration. The
//!   line contains the name, the expected word, the readability, ln p of each letter, the word of
//!   the best letters, the rival and its probability, and the blind reading.
//!
//! Run it with `cargo run --release --example readings -- strips OUT WORDS FACES...`, in which
//! WORDS is a file with one word or name per line, and FACES are typefaces.

#![expect(clippy::disallowed_methods, reason = "our own files")]
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "an example's result")]
#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers")]
#![expect(clippy::cast_precision_loss, reason = "small numbers")]

mod draw;

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

use draw::{Rng, SIZES, Taken};
use noctograph::error::Result;
use noctograph::letters::{self, Strokes};
use noctograph::photo::{self, Photo};
use noctograph::scene::{Preset, Scene};
use noctograph::score::{Reader, View};
use noctograph::shoot::{Judging, Shoot};
use unicode_normalization::UnicodeNormalization;

/// Characters in the order of their labels in the network's strips. The label of *no letter* is 63.
const CHARACTERS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789";

/// Number of photographs of each flight for training.
const PHOTOS_OF_FLIGHT: usize = 2;

/// Number of picture sizes for training. Strips are only 40 pixels high, so small pictures suffice.
const N_SMALL: usize = 7;

/// Words, typefaces, and the range of seeds.
struct Args {
    words: Vec<String>,
    faces: Vec<String>,
    first: u64,
    count: u64,
}

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [verb, out, rest @ ..] = &args[..] else {
        eprintln!("strips|photos|clean OUT WORDS FACES..., or verdicts OUT");
        return Ok(());
    };
    let out = Path::new(out);
    match &verb[..] {
        "verdicts" => verdicts(out),
        "strips" => strips(out, &parse(rest)),
        "clean" => clean(out, &parse(rest)),
        _ => photos(out, &parse(rest)),
    }
}

fn parse(args: &[String]) -> Args {
    let number = |name: &str| {
        let at = args.iter().position(|arg| arg == name)?;
        Some(args[at + 1].parse().expect("a number"))
    };
    let paths = args.iter().take_while(|arg| !arg.starts_with("--"));
    let paths: Vec<String> = paths.cloned().collect();
    let text = fs::read_to_string(&paths[0]).expect("a file of words");
    Args {
        words: text.lines().map(str::to_owned).collect(),
        faces: paths[1..].to_vec(),
        first: number("--first").unwrap_or(0),
        count: number("--count").unwrap_or(1000),
    }
}

/// Returns a word, usually in capitals, and otherwise capitalized or in lowercase.
fn in_some_case(rng: &mut Rng, word: &str) -> String {
    match rng.unit() {
        p if p < 0.5 => word.to_uppercase(),
        p if p < 0.75 => word.to_lowercase(),
        _ => word[..1].to_uppercase() + &word[1..].to_lowercase(),
    }
}

/// Writes strips of flights with all kinds of faults. Half of the flights show words, and half
/// random characters.
fn strips(out: &Path, args: &Args) -> Result<()> {
    let file = File::options().create(true).append(true).open(out);
    let mut out = std::io::BufWriter::new(file.expect("a file that can be written"));
    for seed in args.first..args.first + args.count {
        let rng = &mut Rng(seed);
        let text = match rng.unit() {
            p if p < 0.5 => {
                let word = &args.words[rng.below(args.words.len())];
                in_some_case(rng, word)
            }
            p if p < 0.6 => CHARACTERS[rng.below(62)..][..1].to_owned(),
            _ => draw::random_text(rng),
        };
        let text = if rng.chance(0.06) { accented(rng, &text) } else { text };
        let fault = draw::fault_of_flight(rng, 0.75);
        // A flight is skipped if its drone is lost or the camera does not see its word.
        let Ok(mut flown) = draw::fly(rng, &text, &args.faces, fault) else { continue };
        flown.light(rng)?;
        let reader = flown.reader()?;
        for _ in 0..PHOTOS_OF_FLIGHT {
            let fault = draw::fault_of_camera(rng, 0.5);
            let Ok(taken) = draw::photograph(rng, &flown, fault, &SIZES[..N_SMALL]) else {
                continue;
            };
            for record in records(&reader, &taken, &text)? {
                out.write_all(&record).expect("room on the disk");
            }
        }
    }
    Ok(())
}

/// Returns a text with diacritical marks on some of its letters, which the reader reads as the
/// unmarked letters.
fn accented(rng: &mut Rng, text: &str) -> String {
    let marks =
        ['\u{300}', '\u{301}', '\u{302}', '\u{303}', '\u{308}', '\u{30a}', '\u{30c}', '\u{327}'];
    let one = |c: char| {
        let mark = marks[rng.below(marks.len())];
        let composed: String = [c, mark].into_iter().nfc().collect();
        let is_one = composed.chars().count() == 1;
        if is_one && rng.chance(0.4) { composed } else { c.to_string() }
    };
    text.chars().map(one).collect()
}

/// Returns the strips of a photograph, each preceded by its labels and its width.
fn records(reader: &Reader, taken: &Taken, text: &str) -> Result<Vec<Vec<u8>>> {
    let place = |c| CHARACTERS.chars().position(|known| known == c);
    let labels: Vec<u8> = text.nfd().filter_map(place).map(|at| at as u8 + 1).collect();
    let strips = reader.strips(&taken.photo, &taken.view)?;
    let record = |(width, bytes): (usize, Vec<u8>)| {
        let head = [labels.len() as u16, width as u16].map(u16::to_le_bytes).concat();
        [head, labels.clone(), bytes].concat()
    };
    Ok(strips.into_iter().map(record).collect())
}

/// Writes photographs with at most one fault each. Two in seven show random characters.
fn photos(out: &Path, args: &Args) -> Result<()> {
    let mut words = args.words.iter();
    let (mut rows, mut names): (Vec<String>, Vec<u64>) = (Vec::new(), (1..=args.count).collect());
    let order = &mut Rng(args.first);
    for at in (1..names.len()).rev() {
        names.swap(at, order.below(at + 1));
    }
    let mut seed = args.first;
    while let Some(number) = names.get(rows.len()) {
        let rng = &mut Rng(seed);
        let text = match rng.chance(2.0 / 7.0) {
            true => draw::random_text(rng),
            false => in_some_case(rng, words.next().expect("a word for each photograph")),
        };
        let [of_flight, of_camera] = draw::single_fault(rng);
        let taken = draw::fly(rng, &text, &args.faces, of_flight)
            .and_then(|flown| draw::photograph(rng, &flown, of_camera, &SIZES));
        seed += 1;
        match taken {
            Err(error) => eprintln!("{text}: {error}"),
            Ok(taken) => {
                let name = format!("q{number:04}");
                write(out, &name, &taken.scene, &taken.photo)?;
                let half = if rng.chance(0.5) { "choose" } else { "test" };
                rows.push(format!("\"{name}\": {}", draw::truth(&taken, &text, seed - 1, half)));
            }
        }
    }
    write_truth(out, &rows);
    Ok(())
}

/// Writes photographs of the default scene, without faults.
fn clean(out: &Path, args: &Args) -> Result<()> {
    let mut rows = Vec::new();
    for (number, word) in (1..).zip(&args.words) {
        for [width_px, height_px] in [[640, 360], [1920, 1080]] {
            let mut scene =
                Scene { word: word.clone(), seed: number, ..Scene::preset(Preset::Cf21) };
            (scene.camera.width_px, scene.camera.height_px) = (width_px, height_px);
            let mut shoot = Shoot::new(scene)?;
            shoot.judging = Judging::Skipped;
            let shot = shoot.take(&|_, _| {})?;
            let name = format!("{number:02}-{width_px}x{height_px}");
            write(out, &name, &shot.shoot.scene, &shot.photo)?;
            rows.push(format!(r#""{name}": {{"shown": "{word}", "expected": "{word}"}}"#));
        }
    }
    write_truth(out, &rows);
    Ok(())
}

/// Writes a photograph that does not contain its scene, and writes the scene beside it.
fn write(out: &Path, name: &str, scene: &Scene, photo: &Photo) -> Result<()> {
    for folder in ["photos", "scenes"] {
        fs::create_dir_all(out.join(folder)).expect("a folder that can be made");
    }
    let file = out.join("photos").join(format!("{name}.png"));
    fs::write(file, photo::encode_png(photo, None, &[])).expect("room on the disk");
    let path = out.join("scenes").join(format!("{name}.toml"));
    fs::write(path, scene.to_toml()).expect("room on the disk");
    Ok(())
}

fn write_truth(out: &Path, rows: &[String]) {
    let text = format!("{{\n{}\n}}\n", rows.join(",\n"));
    fs::write(out.join("truth.json"), text).expect("room on the disk");
}

fn verdicts(folder: &Path) -> Result<()> {
    let text = fs::read_to_string(folder.join("truth.json")).expect("truth.json beside the photos");
    let truth: serde_json::Value = serde_json::from_str(&text).expect("truth.json is JSON");
    for (name, of) in truth.as_object().expect("an object of photos") {
        verdict(folder, name, of["expected"].as_str().unwrap_or(""))?;
    }
    Ok(())
}

/// Opens a photo. Returns the strokes of a word in the photographed scene, the photo, the view of
/// its camera, and the scene.
fn open(folder: &Path, name: &str, word: &str) -> Result<(Strokes, Photo, View, Scene)> {
    let mut scene = Scene::read(&folder.join("scenes").join(format!("{name}.toml")))?;
    let flown = letters::write(&scene.word, &scene.letters)?;
    let view = View::from(&scene.camera.camera(flown.bounds_m(), 0.0)?);
    word.clone_into(&mut scene.word);
    let strokes = letters::write(&scene.word, &scene.letters)?;
    Ok((strokes, photo::read(&folder.join("photos").join(format!("{name}.png")))?, view, scene))
}

fn verdict(folder: &Path, name: &str, word: &str) -> Result<()> {
    let (strokes, photo, view, scene) = match open(folder, name, word) {
        Ok(found) => found,
        Err(error) => {
            eprintln!("{name} {word}: {error}");
            return Ok(());
        }
    };
    let verdict = Reader::new(&strokes, &scene.score)?.score(&photo, &view)?;
    let ln_p: Vec<String> = verdict
        .letters
        .iter()
        .filter_map(|letter| letter.p)
        .map(|p| format!("{:.5}", libm::log(p.max(1e-9))))
        .collect();
    let (rival, p) = verdict.rival.map_or(("-".to_owned(), 0.0), |rival| (rival.word, rival.p));
    println!(
        "{name}\t{word}\t{:.4}\t{}\t{}\t{rival}\t{p:.9}\t{}",
        verdict.readability,
        ln_p.join(","),
        verdict.read,
        verdict.second_opinion.unwrap_or_default().replace('\n', "/"),
    );
    Ok(())
}
