//! Measures which letters are legible, and how small NOOR may be. Each character of three fonts is
//! planned, flown, photographed and read in the styles `team` and `even`. The same is done with
//! NOOR at decreasing sizes for each controller.
//!
//! ```sh
//! cargo run --release --example legible -- characters   # a table of all characters
//! cargo run --release --example legible -- heights      # a table and legible.png, a contact sheet
//! ```
//!
//! NOOR is written in the font ae483, with the proportions of the font's letters.

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use image::{RgbImage, imageops};
use noctograph::expose::BackendChoice;
use noctograph::light::RingEffect;
use noctograph::photo::Photo;
use noctograph::plan::{EvenStyle, LightLevel, PlanOptions, Style};
use noctograph::scene::{Preset, Scene};
use noctograph::score::Verdict;
use noctograph::shoot::{Judging, Shoot};
use noctograph::sim::ControllerKind;

type Outcome<T> = Result<T, Box<dyn Error>>;

const FONTS: [&str; 3] = ["ae483-fixed", "simplex", "fonts/Roboto-Thin.ttf"];
const CHARACTERS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789";
/// Cap heights of NOOR in m, with which each letter's whole box is scaled.
const HEIGHTS_M: [f64; 10] = [0.5, 0.4, 0.3, 0.25, 0.2, 0.15, 0.12, 0.1, 0.08, 0.06];
/// Seeds with which the word is flown at each height.
const SEEDS: [u64; 3] = [1, 2, 3];

fn main() -> Outcome<()> {
    match std::env::args().nth(1).as_deref() {
        Some("characters") => characters(),
        Some("heights") => heights(),
        _ => Err("wanted: characters or heights".into()),
    }
}

/// Returns the combinations of style and controller, with their names.
fn ways() -> [(&'static str, PlanOptions, ControllerKind); 6] {
    let team = PlanOptions::default;
    let style = EvenStyle { exposure: LightLevel::Dimmed, ..EvenStyle::default() };
    let even = || PlanOptions::even_with(style.clone());
    [
        ("team, `lqr`", team(), ControllerKind::Lqr),
        ("even, `lqr` with inverted setpoints", even(), ControllerKind::Lqr),
        ("even, `lqr-feedforward`", even(), ControllerKind::LqrFeedforward),
        ("even, `lqr-integral`", even(), ControllerKind::LqrIntegral),
        ("even, `geometric`", even(), ControllerKind::Geometric),
        ("even, `pid` with inverted setpoints", even(), ControllerKind::Pid),
    ]
}

fn scene(plan: &PlanOptions, kind: ControllerKind, size_px: [u32; 2]) -> Scene {
    let mut scene = Scene { plan: plan.clone(), ..Scene::preset(Preset::Ae4832022) };
    scene.controller.kind = kind;
    [scene.camera.width_px, scene.camera.height_px] = size_px;
    // The board's own LEDs are off, because they are not part of the letters.
    scene.light.led_bitmask = 128;
    scene.light.ring = RingEffect::Off;
    scene
}

fn shoot(scene: &Scene, word: &str) -> Outcome<(Verdict, Photo)> {
    let scene = Scene { word: word.to_owned(), ..scene.clone() };
    let shoot =
        Shoot { judging: Judging::Scored, backend: BackendChoice::Cpu, ..Shoot::new(scene)? };
    let shot = shoot.take(&|_, _| {})?;
    Ok((shot.verdict.ok_or("a word is read")?, shot.photo))
}

fn characters() -> Outcome<()> {
    let mut text = String::from(
        "| font | style and controller | reads | does not (as) |\n|---|---|---|---|\n",
    );
    for font in FONTS {
        for (name, plan, kind) in ways().into_iter().take(3) {
            let mut scene = scene(&plan, kind, [240, 160]);
            scene.seed = 1;
            scene.letters.font = font.to_owned();
            let (mut read, mut all, mut wrong) = (0, 0, String::new());
            for character in CHARACTERS.chars() {
                let verdict = match shoot(&scene, &character.to_string()) {
                    Ok((verdict, _)) => verdict,
                    Err(error) => {
                        all += 1;
                        write!(wrong, "{character} ({error}) ")?;
                        continue;
                    }
                };
                // A font without lowercase letters draws capitals, which have already been tested.
                if verdict.word != character.to_string() {
                    continue;
                }
                all += 1;
                if verdict.legible {
                    read += 1;
                } else if verdict.read == verdict.word {
                    write!(wrong, "{character} (unsure) ")?;
                } else {
                    write!(wrong, "{character} ({}) ", verdict.read)?;
                }
            }
            writeln!(text, "| {font} | {name} | {read} of {all} | {} |", wrong.trim_end())?;
        }
    }
    print_out(&text);
    Ok(())
}

fn heights() -> Outcome<()> {
    let mut text = String::from("| style and controller |");
    for height_m in HEIGHTS_M {
        write!(text, " {:.0} cm |", 100.0 * height_m)?;
    }
    text += "\n|---|";
    text += &"---|".repeat(HEIGHTS_M.len());
    text += "\n";
    let size_px = [240, 120];
    let rows = ways();
    let columns = u32::try_from(HEIGHTS_M.len())?;
    let mut sheet = RgbImage::new(size_px[0] * columns, size_px[1] * u32::try_from(rows.len())?);
    for (row, (name, plan, kind)) in (0_u32..).zip(rows) {
        write!(text, "| {name} |")?;
        for (column, height_m) in (0_u32..).zip(HEIGHTS_M) {
            let mut scene = scene(&plan, kind, size_px);
            scene.letters.cap_height_m = height_m;
            scene.letters.baseline_m = 0.75 - 0.5 * height_m;
            // The corners of the style `even` and the steps of the style `team` are scaled with the
            // letters, so that small letters keep their shape.
            match &mut scene.plan.style {
                Style::Team(style) => style.step_m = 0.2 * height_m,
                Style::Even(style) => {
                    style.corner_error_m = (0.02 * height_m).min(style.corner_error_m);
                }
            }
            let mut reads = 0;
            for seed in SEEDS {
                scene.seed = seed;
                let (verdict, photo) = shoot(&scene, "NOOR")?;
                reads += usize::from(verdict.legible);
                if seed == SEEDS[0] {
                    let picture =
                        RgbImage::from_raw(photo.width_px, photo.height_px, photo.into_data().rgb8);
                    let picture = picture.ok_or("three bytes a pixel")?;
                    let place = [column * size_px[0], row * size_px[1]].map(i64::from);
                    imageops::replace(&mut sheet, &picture, place[0], place[1]);
                }
            }
            write!(text, " {reads} |")?;
        }
        text += "\n";
    }
    sheet.save(Path::new("legible.png"))?;
    print_out(&text);
    Ok(())
}

#[expect(clippy::print_stdout, reason = "an example's result")]
fn print_out(text: &str) {
    println!("{text}");
}
