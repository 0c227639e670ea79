//! Orientation of a photo whose writing is on its side, upside down, or mirrored.

use super::reading::{Reading, read};
use noctograph_core::photo::{Photo, PhotoData};

/// Minimum mean probability of upright letters. NOOR upside down is read as HOON with 0.87.
const UPRIGHT: f64 = 0.92;

/// Minimum gain in mean probability if the photo is upside down. An unclear MOON has 0.9, but
/// upside down is read as NOOW with 0.98.
const LEAD: f64 = 0.1;

/// Minimum gain in mean probability at which writing that is clear both ways may be mirrored. A
/// mirrored GLOW reads WOJO with 0.93, flipped it has 0.99. An upright MAXI gains 0.01.
const DOUBT: f64 = 0.03;

/// Minimum level of white paper in daylight, and minimum ratio of bright to dark pixels at an edge.
const BRIGHT: u8 = 190;
const BRIGHT_PER_DARK: usize = 9;

/// Minimum number of letters that determine the orientation. A turned heart may be read as two.
const LEAST_LETTERS: usize = 3;

/// Reads a photo, and turns it by quarters if only a turned photo reads clearly. Returns the
/// reading, whose boxes refer to the turned photo, and the number of clockwise quarter turns.
///
/// A turned photo must be clearer than the original. Unless the original is unclear, it must also
/// read as `word`. An empty `word` stands for any text.
pub fn read_any_way_up(photo: &Photo, word: &str) -> (Reading, usize) {
    let original = read(photo);
    if is_right(&original, word) {
        return (original, 0);
    }
    let turned = (1..4).map(|quarters| (read(&quarter_turned(photo, quarters)), quarters));
    let clearer = turned.filter(|(reading, quarters)| {
        // Upside down, many letters look like other letters, so a half turn needs a lead.
        let lead = if *quarters == 2 { LEAD } else { 0.0 };
        is_clearer(reading, &original, word, lead)
    });
    let best = clearer.reduce(|a, b| if b.0.mean_p() > a.0.mean_p() { b } else { a });
    best.unwrap_or((original, 0))
}

/// Reads the mirrored photo, also upside down, and returns its reading and the number of clockwise
/// quarter turns after mirroring. Returns `None` unless this reading is clearer than `upright`, the
/// reading of the original. If both readings are clear ([`Reading::is_clear`]), it is uncertain
/// whether the photo is mirrored.
pub fn read_mirrored(photo: &Photo, upright: &Reading, word: &str) -> Option<(Reading, usize)> {
    let is_beyond_doubt = !word.is_empty() || upright.mean_p() > 1.0 - DOUBT;
    if is_right(upright, word) && is_beyond_doubt {
        return None;
    }
    // Writing is seen from behind, or reflected in water and thus also upside down.
    let [left, down] =
        [0, 2].map(|quarters| (read(&quarter_turned(&mirrored(photo), quarters)), quarters));
    let is_down = down.0.mean_p() > left.0.mean_p() + LEAD;
    Some(if is_down { down } else { left }).filter(|(reading, _)| {
        if is_right(upright, word) {
            reading.is_clear() && reading.mean_p() >= upright.mean_p() + DOUBT
        } else {
            is_clearer(reading, upright, word, LEAD)
        }
    })
}

impl Reading {
    /// True if the reading has enough letters to show the orientation, and their mean probability
    /// is high.
    pub fn is_clear(&self) -> bool {
        self.letters.len() >= LEAST_LETTERS && self.mean_p() >= UPRIGHT
    }
}

/// True if a reading equals the word, or if it is clear and `word` is empty.
fn is_right(upright: &Reading, word: &str) -> bool {
    upright.text.eq_ignore_ascii_case(word) || upright.is_clear() && word.is_empty()
}

/// True if the reading of a turned photo is clear, and its letters' mean probability is higher than
/// that of the original by at least `lead`. A reading of `word` needs no lead. Any other reading is
/// refused if the original is also clear.
fn is_clearer(reading: &Reading, upright: &Reading, word: &str, lead: f64) -> bool {
    let is_word = reading.text.eq_ignore_ascii_case(word);
    let needed = if is_word { 0.0 } else { lead };
    reading.is_clear()
        && reading.mean_p() >= upright.mean_p() + needed
        && (is_word || !upright.is_clear())
}

/// Flips a photo from left to right.
pub fn mirrored(photo: &Photo) -> Photo {
    let mut photo = PhotoData::clone(photo);
    let width = photo.width_px as usize;
    let rows = photo.rgb8.chunks_exact(3 * width);
    photo.rgb8 = rows.flat_map(|row| row.chunks_exact(3).rev().flatten().copied()).collect();
    Photo::made(photo)
}

/// True if a photo is bright along its edge, because of a white border or dark writing on paper.
pub fn has_bright_edge(photo: &Photo) -> bool {
    let [width, height] = [photo.width_px, photo.height_px].map(|px| px as usize);
    let [mut n_bright, mut n_dark] = [0, 0];
    for (i, pixel) in photo.rgb8.chunks_exact(3).enumerate() {
        if [0, width - 1].contains(&(i % width)) || [0, height - 1].contains(&(i / width)) {
            let is_bright = pixel.iter().all(|value| *value > BRIGHT);
            *(if is_bright { &mut n_bright } else { &mut n_dark }) += 1;
        }
    }
    n_bright > BRIGHT_PER_DARK * n_dark
}

/// Turns a photo clockwise by a number of quarter turns.
pub fn quarter_turned(photo: &Photo, quarters: usize) -> Photo {
    let mut photo = PhotoData::clone(photo);
    for _ in 0..quarters % 4 {
        let [width, height] = [photo.width_px, photo.height_px].map(|px| px as usize);
        let pixels = (0..width).flat_map(|x| (0..height).rev().map(move |y| y * width + x));
        photo.rgb8 = pixels.flat_map(|i| photo.rgb8[3 * i..3 * i + 3].to_vec()).collect();
        (photo.width_px, photo.height_px) = (photo.height_px, photo.width_px);
    }
    Photo::made(photo)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_white_border_is_bright_and_the_night_is_not() {
        let photo = |side: u8, within: u8| {
            let rgb8 = (0..25).flat_map(|i| {
                [if (6..19).contains(&i) && ![0, 4].contains(&(i % 5)) { within } else { side }; 3]
            });
            Photo::made(PhotoData {
                width_px: 5,
                height_px: 5,
                rgb8: rgb8.collect(),
                scene_toml: None,
            })
        };
        assert!(has_bright_edge(&photo(255, 0)) && has_bright_edge(&photo(200, 190)));
        assert!(!has_bright_edge(&photo(120, 255)) && !has_bright_edge(&photo(0, 0)));
        let mut lit = photo(255, 0);
        lit.edit(|lit| lit.rgb8[..6].fill(0));
        assert!(!has_bright_edge(&lit), "a sky at three sides");
    }

    #[test]
    fn four_quarters_are_the_photo_and_one_takes_the_upper_left_pixel_to_the_right() {
        let rgb8 = (0..18).collect();
        let photo = Photo::made(PhotoData { width_px: 3, height_px: 2, rgb8, scene_toml: None });
        let once = quarter_turned(&photo, 1);
        assert_eq!([once.width_px, once.height_px], [2, 3]);
        assert_eq!(once.rgb8[3..6], [0, 1, 2]);
        assert_eq!(mirrored(&photo).rgb8[..9], [6, 7, 8, 3, 4, 5, 0, 1, 2]);
        assert_eq!(quarter_turned(&once, 3), photo);
        assert_eq!(quarter_turned(&photo, 4), photo);
    }
}
