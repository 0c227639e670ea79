//! Photographs with faults: a contact sheet of the bench, sets of photographs to be read by other
//! readers, and what the score says of them.
//!
//! ```sh
//! cargo run --release --example faults -- sheet docs/faults.png       # ten faults, six levels
//! cargo run --release --example faults -- try wander 0.1 0.2 0.3 0.4 0.5 0.6 # other levels
//! cargo run --release --example faults -- shoot main 400 photos/main  # as different as people's
//! cargo run --release --example faults -- score photos/main           # scores.csv beside them
//! ```
//!
//! What other readers make of such a folder, `examples/outside_readers.py` tells.

use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use image::imageops::{self, FilterType};
use image::{DynamicImage, GrayImage, Rgb, RgbImage};
use nalgebra::Vector3;
use noctograph::camera::Camera;
use noctograph::letters::{self, Strokes};
use noctograph::photo::Photo;
use noctograph::scene::Scene;
use noctograph::score;

use bench::{FAULTS, Fault, LEVELS, Setting, WORDS};
use variety::{Draw, Set, draw};

mod bench;
mod variety;

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["try", fault, ref levels @ ..] => rehearse(fault, levels),
        ["sheet", path] => sheet(Path::new(path)),
        ["shoot", set, n, folder] => {
            let set = match set {
                "main" => Set::Main,
                "blind" => Set::Blind,
                _ => return Err("name a set: main or blind".into()),
            };
            shoot(set, n.parse()?, Path::new(folder))
        }
        ["score", folder] => rate(Path::new(folder)),
        _ => {
            Err("name what to make: sheet PATH, shoot main|blind N FOLDER, or score FOLDER".into())
        }
    }
}

/// What the score says of a fault at other levels than the bench's.
fn rehearse(name: &str, levels: &[&str]) -> Outcome<()> {
    let fault = FAULTS.into_iter().find(|fault| fault.name == name).ok_or("name a fault")?;
    let numbers: Vec<f64> = levels.iter().map(|level| level.parse()).collect::<Result<_, _>>()?;
    let Ok(levels) = numbers.try_into() else { return Err("name six levels".into()) };
    print_out(&bench::table(&[Fault { levels, ..fault }])?);
    Ok(())
}

#[expect(clippy::print_stdout, reason = "an example's result")]
fn print_out(text: &str) {
    print!("{text}");
}

/// The bench's photographs of one word: faults from top to bottom, levels from left to right.
fn sheet(path: &Path) -> Outcome<()> {
    const SIZE_PX: [u32; 2] = [180, 84];
    /// Share of the photo's width that is shown: the word fills half of it.
    const SHOWN: f64 = 0.66;
    let word = WORDS[1];
    let rows = u32::try_from(FAULTS.len())?;
    let mut sheet = GrayImage::new(SIZE_PX[0] * u32::try_from(LEVELS)?, SIZE_PX[1] * rows);
    for (row, fault) in (0_u32..).zip(&FAULTS) {
        for (column, level) in (0_u32..).zip(fault.levels) {
            let mut setting = Setting::clean(word, 2);
            (fault.turn)(&mut setting, level)?;
            let photo = setting.shoot()?.photo;
            let picture = RgbImage::from_raw(photo.width_px, photo.height_px, photo.rgb8);
            let picture = DynamicImage::ImageRgb8(picture.ok_or("three bytes a pixel")?);
            let width = SHOWN * f64::from(picture.width());
            let height = width * f64::from(SIZE_PX[1]) / f64::from(SIZE_PX[0]);
            let from = [f64::from(picture.width()) - width, f64::from(picture.height()) - height];
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels")]
            let [x, y, width, height] =
                [0.5 * from[0], 0.5 * from[1], width, height].map(|px| px.round().max(0.0) as u32);
            let cut = picture.crop_imm(x, y, width, height).to_luma8();
            let cell = imageops::resize(&cut, SIZE_PX[0], SIZE_PX[1], FilterType::CatmullRom);
            let place = [column * SIZE_PX[0], row * SIZE_PX[1]].map(i64::from);
            imageops::replace(&mut sheet, &cell, place[0], place[1]);
        }
    }
    sheet.save(path)?;
    Ok(())
}

/// Photographs of a set with their list: file, word, fault, level, font, and the corners of the
/// word's box in pixels, from the upper left clockwise.
fn shoot(set: Set, n: usize, folder: &Path) -> Outcome<()> {
    fs::create_dir_all(folder)?;
    let background = folder.join("room.png");
    room().save(&background)?;
    let background = background.to_str().ok_or("a folder whose name is UTF-8")?;
    let mut list =
        String::from("file,word,fault,level,font,x0,y0,x1,y1,x2,y2,x3,y3,cap_height_px\n");
    for index in 0..n {
        let Draw { setting, fault } = draw(set, index, background)?;
        let shot = match setting.shoot() {
            Ok(shot) => shot,
            // A drone that is lost leaves no photograph.
            Err(error) => {
                print_out(&format!("{index}: {error}\n"));
                continue;
            }
        };
        let file = format!("{index:04}.png");
        let mut photo = shot.photo;
        // What the scorer is told: the word as it was to be written, the camera as it stood.
        let scene = Scene { camera: setting.actual.camera.clone(), ..setting.known.clone() };
        photo.scene_toml = Some(scene.to_toml());
        photo.write_png(fs::File::create(folder.join(&file))?, None, &[])?;
        let (name, level) = fault.map_or(("clean", 0), |(at, level)| (FAULTS[at].name, level + 1));
        let letters = &setting.known.letters;
        let strokes = shot.strokes.as_ref().ok_or("a word was written")?;
        write!(list, "{file},{},{name},{level},{}", strokes.word, letters.font)?;
        let corners = corners_px(strokes, &shot.camera);
        for [x, y] in corners {
            write!(list, ",{x:.1},{y:.1}")?;
        }
        let [left, _, _, foot] = corners;
        writeln!(list, ",{:.1}", foot[1] - left[1])?;
    }
    fs::write(folder.join("photos.csv"), list)?;
    Ok(())
}

fn corners_px(strokes: &Strokes, camera: &Camera) -> [[f64; 2]; 4] {
    let [left, bottom, right, top] = strokes.bounds_m();
    let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
    corners.map(|[x, z]| {
        let seen = camera.image_from_world(Vector3::new(x, 0.0, z));
        seen.map_or([f64::NAN; 2], |seen| [seen.x_px, seen.y_px])
    })
}

/// A dim room: a wall, a window, a door and a table.
fn room() -> RgbImage {
    RgbImage::from_fn(480, 320, |x, y| {
        #[expect(clippy::cast_possible_truncation, reason = "140 at most")]
        let wall = (60 + x / 8 + y / 16) as u8;
        match (x, y) {
            (300..=420, 40..=150) if (x - 300) % 60 > 4 && (y - 40) % 55 > 4 => {
                Rgb([150, 165, 190])
            }
            (60..=130, 90..=280) => Rgb([wall / 2 + 20, wall / 3 + 15, wall / 4 + 10]),
            (170..=290, 220..=231) | (180..=188 | 272..=280, 232..=285) => Rgb([90, 70, 50]),
            (_, 286..) => Rgb([wall / 2, wall / 2, wall / 2 - 5]),
            _ => Rgb([wall, wall - 6, wall - 14]),
        }
    })
}

/// Scores the photographs of a folder: what `scores.csv` says of each.
fn rate(folder: &Path) -> Outcome<()> {
    let list = fs::read_to_string(folder.join("photos.csv"))?;
    let mut table = String::from("file,p,loss,read,reason,letters\n");
    for line in list.lines().skip(1) {
        let file = line.split(',').next().ok_or("a file in every line")?;
        let photo = Photo::read_png(&folder.join(file))?;
        let scene = Scene::parse(photo.scene_toml.as_deref().ok_or("a scene inside")?, file)?;
        let strokes = letters::write(&scene.word, &scene.letters)?;
        let camera = scene.camera.camera(strokes.bounds_m(), 1.0)?;
        let verdict = score::score(&photo, &strokes, &camera, &scene.score)?;
        let p = verdict.readability;
        let calibration = verdict.calibration;
        let loss = (calibration.offset - libm::log(p / (1.0 - p))) / calibration.slope;
        let reason = verdict.reason.map_or(String::new(), |reason| format!("{reason:?}"));
        let each = verdict.letters.iter().map(|letter| format!("{:.4}", letter.p));
        let each = each.collect::<Vec<_>>().join(" ");
        writeln!(table, "{file},{p:.5},{loss:.4},{},{reason},{each}", verdict.read)?;
    }
    fs::write(folder.join("scores.csv"), table)?;
    Ok(())
}
