//! Makes a contact sheet of photographs with faults, or prints the bench's table at other levels.
//!
//! ```sh
//! cargo run --release --example faults -- sheet docs/faults.png       # ten faults, six levels
//! cargo run --release --example faults -- try wander 0.1 0.2 0.3 0.4 0.5 0.6 # other levels
//! ```

use std::error::Error;
use std::path::Path;

use image::imageops::{self, FilterType};
use image::{DynamicImage, GrayImage, RgbImage};

use bench::{FAULTS, Fault, LEVELS, Setting, WORDS};

mod bench;

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["try", fault, ref levels @ ..] => rehearse(fault, levels),
        ["sheet", path] => sheet(Path::new(path)),
        _ => Err("wanted: sheet PATH, or try FAULT LEVELS".into()),
    }
}

/// Prints the scores of a fault at the given levels.
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

/// Writes a sheet of the bench's photographs of one word, with the faults from top to bottom and
/// the levels from left to right.
fn sheet(path: &Path) -> Outcome<()> {
    const SIZE_PX: [u32; 2] = [180, 84];
    /// Fraction of the photo's width that is shown. The word fills half of the width.
    const SHOWN: f64 = 0.66;
    let word = WORDS[1];
    let rows = u32::try_from(FAULTS.len())?;
    let mut sheet = GrayImage::new(SIZE_PX[0] * u32::try_from(LEVELS)?, SIZE_PX[1] * rows);
    for (row, fault) in (0_u32..).zip(&FAULTS) {
        for (column, level) in (0_u32..).zip(fault.levels) {
            let mut setting = Setting::clean(word, 2);
            (fault.turn)(&mut setting, level)?;
            let photo = setting.shoot()?.photo;
            let picture =
                RgbImage::from_raw(photo.width_px, photo.height_px, photo.into_data().rgb8);
            let picture = DynamicImage::ImageRgb8(picture.ok_or("three bytes a pixel")?);
            let width = SHOWN * f64::from(picture.width());
            let height = width * f64::from(SIZE_PX[1]) / f64::from(SIZE_PX[0]);
            let from = [f64::from(picture.width()) - width, f64::from(picture.height()) - height];
            #[expect(clippy::cast_possible_truncation, reason = "pixels")]
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
