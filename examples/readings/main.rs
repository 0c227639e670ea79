//! Verdicts on a photo set, for the calibration; and strips for the training of the net.
//!
//! `cargo run --release --example readings -- verdicts FOLDER` prints a line for each photo of
//! FOLDER/truth.json: name, expected word, readability, ln p of each letter, word by the best letters,
//! rival and its share, blind reading. `-- strips FOLDER OUT` writes the strips of the photos: of each
//! its labels, width and bytes.

#![expect(clippy::disallowed_methods, reason = "our own files")]
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "an example's result")]

use std::io::Write;
use std::path::Path;

use noctograph::error::Result;
use noctograph::letters::{self, Strokes};
use noctograph::photo::Photo;
use noctograph::scene::Scene;
use noctograph::score::{Reader, View};

/// What stands in the net's strips for each character; no letter is 63.
const CHARACTERS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789";

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let folder = Path::new(args.get(1).map_or(".", String::as_str));
    let text =
        std::fs::read_to_string(folder.join("truth.json")).expect("truth.json beside the photos");
    let truth: serde_json::Value = serde_json::from_str(&text).expect("truth.json is JSON");
    let photos = truth.as_object().expect("an object of photos");
    match args.first().map(String::as_str) {
        Some("verdicts") => {
            for (name, of) in photos {
                verdict(folder, name, of["expected"].as_str().unwrap_or(""))?;
            }
        }
        Some("strips") => {
            let mut out = std::io::BufWriter::new(
                std::fs::File::create(&args[2]).expect("a file that can be written"),
            );
            for (name, of) in photos {
                strips(folder, name, of["shown"].as_str().unwrap_or(""), &mut out)?;
            }
        }
        _ => eprintln!("verdicts FOLDER, or strips FOLDER OUT"),
    }
    Ok(())
}

/// A photo with the strokes of a word in the scene that was photographed, and the view of its camera.
fn open(folder: &Path, name: &str, word: &str) -> Result<(Strokes, Photo, View, Scene)> {
    let mut scene = Scene::read(&folder.join("scenes").join(format!("{name}.toml")))?;
    let flown = letters::write(&scene.word, &scene.letters)?;
    let view = View::from(&scene.camera.camera(flown.bounds_m(), 0.0)?);
    word.clone_into(&mut scene.word);
    let strokes = letters::write(&scene.word, &scene.letters)?;
    Ok((strokes, Photo::read(&folder.join("photos").join(format!("{name}.png")))?, view, scene))
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

fn strips(folder: &Path, name: &str, word: &str, out: &mut impl Write) -> Result<()> {
    let Ok((strokes, photo, view, scene)) = open(folder, name, word) else { return Ok(()) };
    let labels: Vec<u8> = word
        .chars()
        .filter_map(|c| CHARACTERS.chars().position(|known| known == c))
        .map(|at| u8::try_from(at + 1).expect("62 characters"))
        .collect();
    for (width, bytes) in Reader::new(&strokes, &scene.score)?.strips(&photo, &view)? {
        let head =
            [u16::try_from(labels.len()), u16::try_from(width)].map(|n| n.expect("short words"));
        let head = head.into_iter().flat_map(u16::to_le_bytes);
        let record: Vec<u8> = head.chain(labels.iter().copied()).chain(bytes).collect();
        out.write_all(&record).expect("room on the disk");
    }
    Ok(())
}
