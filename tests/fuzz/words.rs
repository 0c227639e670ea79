//! Words of growing length. A case consists of two lines: the word in a photo, and the word for
//! which the photo is scored.

use std::path::Path;

use noctograph::camera::CameraOptions;
use noctograph::letters::{LetterOptions, Strokes, write};
use noctograph::photo::{self, Metadata, Photo, PhotoData};
use noctograph::scene::{Preset, Scene};
use noctograph::score::{Reader, ScoreOptions, View, read as read_blind};

/// Numbers of letters in a word, up to the longest word that can be written.
const LENGTHS: [usize; 3] = [1, 61, 256];

/// Returns cases with words of equal, alternating and many letters, each scored for the word
/// itself, for half of it and for other words.
pub(crate) fn all() -> impl Iterator<Item = String> {
    const LETTERS: [&str; 3] = ["O", "IL", "ABCDEFGHIJKLMNOPQRSTUVWXYZ"];
    let word = |letters: &str, n: usize| letters.chars().cycle().take(n).collect::<String>();
    LENGTHS.into_iter().flat_map(move |n| {
        LETTERS.into_iter().enumerate().flat_map(move |(k, letters)| {
            let told = [
                word(letters, n),
                word(letters, n.div_ceil(2)),
                word(LETTERS[(k + 1) % LETTERS.len()], n),
            ];
            told.map(|told| format!("{}\n{told}", word(letters, n)))
        })
    })
}

/// Reads the photo of a case blind, for a word, and with the scene that the photo contains.
pub(crate) fn read(path: &Path, case: &[u8]) -> bool {
    let (drawn, told) = std::str::from_utf8(case).unwrap().split_once('\n').unwrap();
    let strokes = |word: &str| write(word, &LetterOptions::default());
    let (Ok(drawn), Ok(told)) = (strokes(drawn), strokes(told)) else { return false };
    let camera = CameraOptions { width_px: 4096, height_px: 120, ..CameraOptions::default() };
    let camera = camera.camera(drawn.bounds_m(), 10.0).unwrap();
    let scene_toml =
        Some(Scene { word: told.word.clone(), ..Scene::preset(Preset::default()) }.to_toml());
    let photo = Photo::made(PhotoData {
        scene_toml,
        ..photograph(&drawn, &View::from(&camera)).into_data()
    });
    let metadata = Metadata::new(&camera, &photo.rgb8);
    std::fs::write(path, photo::encode_png(&photo, Some(&metadata), &[])).unwrap();
    let Ok((photo, _)) = photo::read_with_notes(path) else { return false };
    let _ = read_blind(&photo);
    let reader = Reader::new(&told, &ScoreOptions::default());
    reader.and_then(|reader| reader.score(&photo, &View::from(&camera))).is_ok()
}

/// Returns a photo of white strokes, three pixels wide, on black.
fn photograph(strokes: &Strokes, view: &View) -> Photo {
    let (width_px, height_px) = (4096_u32, 120_u32);
    let mut rgb8 = vec![0; 3 * (width_px * height_px) as usize];
    let lit = strokes.glyphs.iter().flat_map(|glyph| &glyph.moves).filter(|step| step.lit);
    for step in lit {
        for k in 0..=200 {
            let share = f64::from(k) / 200.0;
            let at = [0, 1].map(|i| step.from_m[i] + share * (step.to_m[i] - step.from_m[i]));
            let Some(pixel) = view.image_from_plane(at) else { continue };
            for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
                let (x, y) = (pixel[0] + f64::from(dx), pixel[1] + f64::from(dy));
                if x < 0.0 || y < 0.0 || x >= f64::from(width_px) || y >= f64::from(height_px) {
                    continue;
                }
                #[expect(clippy::cast_possible_truncation, reason = "within the picture")]
                let place = 3 * (y as usize * width_px as usize + x as usize);
                rgb8[place..place + 3].fill(250);
            }
        }
    }
    Photo::made(PhotoData { width_px, height_px, rgb8, scene_toml: None })
}
