//! Tests whether a picture is read in the same way when it is scaled, brightened, compressed,
//! cropped or rotated, both given the word and without it.
//!
//! ```sh
//! cargo run --release --example variants -- NOOR-0.png HELLO-1.png
//! ```
//!
//! A picture's name consists of its word and a number, which is 0 for the reference team's letters.
//! The printed line contains the readings of the picture given the word and without it. Five
//! numbers of variants follow: those that are read like the picture given the word, read correctly
//! given the word, legible, read like the picture without the word, and read correctly without it.
//! The line ends with the variants that are read differently.

use std::error::Error;
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::imageops::{self, FilterType};
use image::{ImageFormat, Rgb, RgbImage};
use noctograph::letters::{LetterOptions, write};
use noctograph::photo::{Photo, PhotoData};
use noctograph::score::{Reader, ScoreOptions, find_word, read};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Changes to a picture, which are the scale, the factor and exponent applied to its pixel values,
/// the JPEG quality, the fraction cropped from the sides, and the rotation in degrees.
#[derive(Clone, Copy)]
struct Variant {
    scale: f64,
    brightness: f64,
    gamma: f64,
    quality: Option<u8>,
    crop: f64,
    turn_deg: f64,
}

const SAME: Variant =
    Variant { scale: 1.0, brightness: 1.0, gamma: 1.0, quality: None, crop: 0.0, turn_deg: 0.0 };

fn variants() -> Vec<Variant> {
    let mut all: Vec<Variant> = Vec::new();
    all.extend([0.125, 0.25, 0.5, 0.707, 1.414, 2.0].map(|scale| Variant { scale, ..SAME }));
    all.extend([0.7, 0.85, 1.15, 1.3].map(|brightness| Variant { brightness, ..SAME }));
    all.extend([0.8, 1.25].map(|gamma| Variant { gamma, ..SAME }));
    all.extend([50, 75, 95].map(|quality| Variant { quality: Some(quality), ..SAME }));
    all.push(Variant { crop: 0.06, ..SAME });
    all.extend([-5.0, 5.0].map(|turn_deg| Variant { turn_deg, ..SAME }));
    let mixed = |scale, brightness, quality, crop, turn_deg| Variant {
        scale,
        brightness,
        quality: Some(quality),
        crop,
        turn_deg,
        ..SAME
    };
    all.extend([mixed(0.37, 0.8, 60, 0.03, 2.5), mixed(1.3, 1.2, 85, 0.05, -2.5)]);
    all
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels and codes")]
fn varied(picture: &RgbImage, variant: &Variant) -> Outcome<RgbImage> {
    let [width, height] = [picture.width(), picture.height()];
    let cut = |side: u32| (variant.crop * f64::from(side)) as u32;
    let (x, y) = (cut(width), cut(height));
    let picture = imageops::crop_imm(picture, x, y, width - 2 * x, height - 2 * y).to_image();
    let mut picture = turned(&picture, variant.turn_deg);
    if variant.scale != 1.0 {
        let side = |side: u32| (variant.scale * f64::from(side)).round() as u32;
        let [width, height] = [side(picture.width()), side(picture.height())];
        picture = imageops::resize(&picture, width, height, FilterType::Triangle);
    }
    let code = |code: u8| {
        let level = libm::pow(f64::from(code) / 255.0 * variant.brightness, variant.gamma);
        (255.0 * level).round().clamp(0.0, 255.0) as u8
    };
    picture.pixels_mut().for_each(|pixel| pixel.0 = pixel.0.map(code));
    if let Some(quality) = variant.quality {
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, quality).encode_image(&picture)?;
        picture = image::load_from_memory_with_format(&bytes, ImageFormat::Jpeg)?.to_rgb8();
    }
    Ok(picture)
}

/// Returns the picture rotated about its center, with interpolation between pixel centers.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels and codes")]
fn turned(picture: &RgbImage, turn_deg: f64) -> RgbImage {
    if turn_deg == 0.0 {
        return picture.clone();
    }
    let (sin, cos) = libm::sincos(turn_deg.to_radians());
    let [width, height] = [picture.width(), picture.height()];
    let middle = [width, height].map(|side| 0.5 * f64::from(side) - 0.5);
    let last = [width, height].map(|side| f64::from(side - 1));
    RgbImage::from_fn(width, height, |x, y| {
        let (x, y) = (f64::from(x) - middle[0], f64::from(y) - middle[1]);
        let at = [cos * x - sin * y + middle[0], sin * x + cos * y + middle[1]];
        let at = [at[0].clamp(0.0, last[0]), at[1].clamp(0.0, last[1])];
        let pixel = |right: f64, down: f64| {
            let (x, y) = (at[0].floor() + right, at[1].floor() + down);
            picture.get_pixel(x.min(last[0]) as u32, y.min(last[1]) as u32).0
        };
        let (right, down) = (at[0].fract(), at[1].fract());
        let corners = [pixel(0.0, 0.0), pixel(1.0, 0.0), pixel(0.0, 1.0), pixel(1.0, 1.0)];
        let shares = [
            (1.0 - right) * (1.0 - down),
            right * (1.0 - down),
            (1.0 - right) * down,
            right * down,
        ];
        Rgb(std::array::from_fn(|channel| {
            let sum = corners.iter().zip(shares).map(|(c, share)| share * f64::from(c[channel]));
            sum.sum::<f64>().round() as u8
        }))
    })
}

fn word_of(name: &str) -> &str {
    name.split('-').next().unwrap_or(name)
}

/// Returns the reading given the word, the legibility, and the reading without the word.
fn readings(picture: RgbImage, name: &str) -> Outcome<(String, bool, String)> {
    let photo = Photo::made(PhotoData {
        width_px: picture.width(),
        height_px: picture.height(),
        rgb8: picture.into_raw(),
        scene_toml: None,
    });
    let word = word_of(name);
    let font = if name.ends_with("-0") { "ae483" } else { "simplex" };
    let options = LetterOptions { font: font.into(), ..Default::default() };
    let strokes = write(word, &options)?;
    let reading = read(&photo);
    let told = match find_word(&photo, &reading, &strokes) {
        None => ("-".to_owned(), false),
        Some(view) => {
            let verdict = Reader::new(&strokes, &ScoreOptions::default())?.score(&photo, &view)?;
            (verdict.read, verdict.legible)
        }
    };
    Ok((told.0, told.1, reading.of_writing().text))
}

#[expect(clippy::print_stdout, reason = "an example's result")]
fn main() -> Outcome<()> {
    // The sums over all pictures count the variants that are read the same given the word,
    // correctly given the word, legible, the same without the word, and correctly without it, and
    // all variants.
    let mut sums = [0_usize; 6];
    for path in std::env::args().skip(1) {
        let name = Path::new(&path).file_stem().and_then(|name| name.to_str()).ok_or("a name")?;
        let word = word_of(name);
        let picture = image::open(&path)?.to_rgb8();
        let base = readings(picture.clone(), name)?;
        let (mut counts, mut others) = ([0; 6], Vec::new());
        for (at, variant) in variants().iter().enumerate() {
            let (told, legible, blind) = readings(varied(&picture, variant)?, name)?;
            let is_right = [told == word, blind.eq_ignore_ascii_case(word)];
            let seen = [told == base.0, is_right[0], legible, blind == base.2, is_right[1], true];
            counts.iter_mut().zip(seen).for_each(|(count, seen)| *count += usize::from(seen));
            if !(seen[0] && seen[3] && is_right[0] && is_right[1]) {
                others.push(format!("{at}:{told}/{blind}"));
            }
        }
        sums.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        println!("{name}\t{}/{}\t{counts:?}\t{}", base.0, base.2, others.join(" "));
    }
    println!("with the word: same, right, legible; blind: same, right; total\t{sums:?}");
    Ok(())
}
