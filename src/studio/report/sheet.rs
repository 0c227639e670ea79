//! A sheet of photos: rows with a name, photos with a caption.

use ab_glyph::{Font, FontRef, ScaleFont, point};

use crate::study::{Measures, Prepared, Ranking, Record, Study};
use noctograph_core::error::Result;
use noctograph_picture::photo::Photo;

/// Roboto Thin (Apache 2.0, see fonts/README.md); its capitals keep to a pixel at this size.
const TTF: &[u8] = include_bytes!("../../../fonts/Roboto-Thin.ttf");
/// Size of the text.
const TEXT_PX: f32 = 22.0;
/// Height of a line of text with its air.
const LINE_PX: usize = 32;
/// Room around the photos.
const GAP_PX: usize = 12;
/// The sheet, where nothing is.
const GROUND: u8 = 24;
/// Its text.
const INK: u8 = 235;

/// Photos of a spread beside each other.
const ROW_PHOTOS: usize = 4;
/// Height of a capital in the photos of a study.
const CAP_HEIGHT_PX: f64 = 110.0;

/// The median and the worst photo of each scene of a study, which was prepared
/// ([`Study::prepare`]).
///
/// # Errors
///
/// As [`Prepared::photo`].
pub fn study_sheet(
    study: &Study,
    ready: &[Prepared],
    ranking: &Ranking,
    records: &[Record],
) -> Result<Photo> {
    Ok(contact_sheet(&study_rows(study, ready, ranking, records)?))
}

/// Photos with their captions, in rows of a few.
#[must_use]
pub fn spread_sheet(title: &str, photos: Vec<(Photo, String)>) -> Photo {
    let mut photos = photos.into_iter().peekable();
    let mut rows = Vec::new();
    while photos.peek().is_some() {
        let title = if rows.is_empty() { title.to_owned() } else { String::new() };
        rows.push(SheetRow { title, photos: photos.by_ref().take(ROW_PHOTOS).collect() });
    }
    contact_sheet(&rows)
}

/// A row for each scene: its median and its worst photo.
fn study_rows(
    study: &Study,
    ready: &[Prepared],
    ranking: &Ranking,
    records: &[Record],
) -> Result<Vec<SheetRow>> {
    let trials: Vec<_> = study.trials().collect();
    let row = |measures: &Measures| {
        let p = measures.legibility.value;
        let mut row = SheetRow {
            title: format!("{}: read with probability {p:.3}", measures.contender),
            photos: Vec::new(),
        };
        for (name, at) in ["median", "worst"].into_iter().zip(measures.median_and_worst) {
            let (trial, record) = (trials[at], &records[at]);
            if record.outcome.flown.is_none() {
                continue;
            }
            let ready = &ready[trial.contender * study.words.len() + trial.word];
            let photo = ready.photo(trial.seed, CAP_HEIGHT_PX)?;
            let read = &record.outcome.read;
            let p = record.outcome.probability;
            row.photos.push((photo, format!("{name}: {} as {read}, {p:.2}", record.word)));
        }
        Ok(row)
    };
    ranking.measures.iter().map(row).collect()
}

/// A row of a sheet.
#[derive(Clone, Debug)]
struct SheetRow {
    /// Text above the photos.
    title: String,
    /// Photos, each with its caption.
    photos: Vec<(Photo, String)>,
}

/// Lays out photos in rows, each at its own size, from the left.
fn contact_sheet(rows: &[SheetRow]) -> Photo {
    let side = |px: u32| px as usize;
    let widths = rows.iter().map(|row| {
        row.photos.iter().map(|(photo, _)| side(photo.width_px) + GAP_PX).sum::<usize>()
    });
    let heights = rows
        .iter()
        .map(|row| row.photos.iter().map(|(photo, _)| side(photo.height_px)).max().unwrap_or(0));
    let width = GAP_PX + widths.max().unwrap_or(0).max(400);
    let heights: Vec<usize> = heights.collect();
    let height = GAP_PX + heights.iter().map(|row| row + 2 * LINE_PX + GAP_PX).sum::<usize>();
    let mut sheet = Sheet { width, rgb8: vec![GROUND; 3 * width * height] };
    let mut top = GAP_PX;
    for (row, height) in rows.iter().zip(heights) {
        sheet.write(&row.title, [GAP_PX, top]);
        let mut left = GAP_PX;
        for (photo, caption) in &row.photos {
            sheet.paste(photo, [left, top + LINE_PX]);
            sheet.write(caption, [left, top + LINE_PX + height]);
            left += side(photo.width_px) + GAP_PX;
        }
        top += height + 2 * LINE_PX + GAP_PX;
    }
    let px = |side: usize| u32::try_from(side).expect("a sheet of photos");
    Photo { width_px: px(width), height_px: px(height), rgb8: sheet.rgb8, scene_toml: None }
}

struct Sheet {
    width: usize,
    rgb8: Vec<u8>,
}

impl Sheet {
    fn paste(&mut self, photo: &Photo, [left, top]: [usize; 2]) {
        let row_bytes = 3 * photo.width_px as usize;
        for (y, row) in photo.rgb8.chunks_exact(row_bytes).enumerate() {
            let start = 3 * ((top + y) * self.width + left);
            self.rgb8[start..start + row_bytes].copy_from_slice(row);
        }
    }

    /// One line of text with its upper left corner at a pixel; what does not fit is cut off.
    fn write(&mut self, text: &str, [left, top]: [usize; 2]) {
        let font = FontRef::try_from_slice(TTF).expect("the font under fonts/ is read by a test");
        let scaled = font.as_scaled(TEXT_PX);
        let mut pen = point(left as f32, top as f32 + scaled.ascent() + 2.0);
        for character in text.chars() {
            let id = font.glyph_id(character);
            let glyph = id.with_scale_and_position(TEXT_PX, pen);
            pen.x += scaled.h_advance(id);
            let Some(outline) = font.outline_glyph(glyph) else { continue };
            let corner = outline.px_bounds().min;
            outline.draw(|x, y, cover| {
                #[expect(clippy::cast_possible_truncation, reason = "pixels of a sheet")]
                let (x, y) = (corner.x as usize + x as usize, corner.y as usize + y as usize);
                let at = 3 * (y * self.width + x);
                if x < self.width && at + 3 <= self.rgb8.len() {
                    #[expect(clippy::cast_possible_truncation, reason = "between two levels")]
                    // Thin strokes cover half a pixel: they are drawn twice as strong.
                    let level = (f32::from(GROUND)
                        + (2.0 * cover).min(1.0) * f32::from(INK - GROUND))
                        as u8;
                    self.rgb8[at..at + 3].fill(level);
                }
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_stand_in_rows_with_their_text() {
        let photo = |width_px: u32, level: u8| Photo {
            width_px,
            height_px: 20,
            rgb8: vec![level; 60 * width_px as usize],
            scene_toml: None,
        };
        let row = |title: &str, level| SheetRow {
            title: title.into(),
            photos: vec![(photo(300, level), "median".into()), (photo(200, level), "worst".into())],
        };
        let sheet = contact_sheet(&[row("team", 100), row("tuned", 200)]);
        assert_eq!((sheet.width_px, sheet.height_px), (12 + 312 + 212, 12 + 2 * (20 + 64 + 12)));
        let at = |x: usize, y: usize| sheet.rgb8[3 * (y * 536 + x)];
        assert_eq!([at(12, 44), at(311, 63), at(312, 50), at(324, 44)], [100, 100, GROUND, 100]);
        assert_eq!(at(12, 44 + 96), 200, "the second row");
        let title = (12..30).flat_map(|y| (12..100).map(move |x| at(x, y)));
        assert!(title.filter(|level| *level > 200).count() > 20, "something is written");
    }
}
