//! Lays out contact sheets, with titled rows of photos and captions.

use ab_glyph::{Font, FontRef, ScaleFont, point};

use crate::statistics::Estimate;
use crate::{Acuity, Prepared, Ranking, Record, Study};
use noctograph_core::error::Result;
use noctograph_picture::photo::{Photo, PhotoData};

/// Roboto Thin (Apache 2.0, see fonts/README.md), whose capitals align with pixels at this size.
const TTF: &[u8] = include_bytes!("../../../fonts/Roboto-Thin.ttf");
/// Font size of the text.
const TEXT_PX: f32 = 22.0;
/// Height of a line of text including its leading.
const LINE_PX: usize = 32;
/// Space between photos.
const GAP_PX: usize = 12;
/// Gray levels of the sheet's background and text.
const GROUND: u8 = 24;
const INK: u8 = 235;

/// Number of photos in a row of a spread's sheet.
const ROW_PHOTOS: usize = 4;
/// Cap height in the photos of a study.
const CAP_HEIGHT_PX: f64 = 110.0;

/// Cap height in the photos of a ladder, with seven photos per row.
const SMALL_CAP_HEIGHT_PX: f64 = 70.0;

/// Row of a sheet: its title, and its photos with captions.
type Row = (String, Vec<(Photo, String)>);

/// Returns a sheet with the median and the worst photo of each contender. `prepared` contains the
/// results of [`Study::prepare`].
pub fn study_sheet(
    study: &Study,
    prepared: &[Prepared],
    ranking: &Ranking,
    records: &[Record],
) -> Result<Photo> {
    let trials: Vec<_> = study.trials().collect();
    let rows = ranking.measures.iter().map(|measures| {
        let p = measures.legibility.value;
        let title = format!("{}: read with probability {p:.3}", measures.contender);
        let mut photos = Vec::new();
        // The photos are taken again at a larger size than those that were read.
        for (name, index) in ["median", "worst"].into_iter().zip(measures.median_and_worst) {
            let (trial, Record { word, outcome, .. }) = (trials[index], &records[index]);
            if outcome.flown.is_some() {
                let scene = &prepared[trial.contender * study.words.len() + trial.word];
                let (read, p) = (&outcome.read, outcome.probability);
                let photo = scene.photo(trial.seed, CAP_HEIGHT_PX)?;
                photos.push((photo, format!("{name}: {word} as {read}, {p:.2}")));
            }
        }
        Ok((title, photos))
    });
    Ok(contact_sheet(&rows.collect::<Result<Vec<Row>>>()?))
}

/// Returns a sheet with a row per contender: the first word at each rung of a [`Study::ladder`],
/// with the mean probability of its letters.
pub fn acuity_sheet(
    ladder: &[Study],
    prepared: &[Vec<Prepared>],
    acuity: &Acuity,
    records: &[Vec<Record>],
) -> Result<Photo> {
    let rows = acuity.limits.iter().map(|limit| {
        let Estimate { value, low, high } = limit.cap_height_m;
        let [value_mm, low_mm, high_mm] = [value, low, high].map(|height_m| 1e3 * height_m);
        let range = format!("{value_mm:.1} mm ({low_mm:.1} to {high_mm:.1})");
        let title = format!("{}: legible down to {range}", limit.contender);
        let mut photos = Vec::new();
        // The photo shows the contender's first flight at each rung. A lost drone has no photo.
        let rungs = ladder.iter().zip(prepared).zip(limit.rungs.iter().zip(records));
        for ((study, prepared), (rung, records)) in rungs {
            let mut flown = records.iter().zip(study.trials());
            let first = flown.find(|(record, _)| record.contender == limit.contender);
            let Some((Record { outcome, .. }, trial)) = first else { continue };
            if outcome.flown.is_some() {
                let scene = &prepared[trial.contender * study.words.len() + trial.word];
                let photo = scene.photo(trial.seed, SMALL_CAP_HEIGHT_PX)?;
                let (height_mm, read) = (1e3 * rung.cap_height_m, outcome.similarity);
                photos.push((photo, format!("{height_mm:.0} mm: {read:.2}")));
            }
        }
        Ok((title, photos))
    });
    Ok(contact_sheet(&rows.collect::<Result<Vec<Row>>>()?))
}

/// Returns a sheet of photos with captions, four in a row, below a title.
pub fn spread_sheet(title: &str, photos: &[(Photo, String)]) -> Photo {
    let titles = std::iter::once(title).chain(std::iter::repeat(""));
    let titled = titles.zip(photos.chunks(ROW_PHOTOS));
    let rows = titled.map(|(title, photos)| (title.to_owned(), photos.to_vec()));
    contact_sheet(&rows.collect::<Vec<Row>>())
}

/// Returns an image of rows of photos, with a title above each row and a caption below each photo.
fn contact_sheet(rows: &[Row]) -> Photo {
    // The width is that of the widest row, and at least 400 pixels, so that titles fit. Each row is
    // a photo and two lines of text high.
    let widths = rows.iter().map(|(_, photos)| {
        photos.iter().map(|(photo, _)| photo.width_px as usize + GAP_PX).sum::<usize>()
    });
    let width = GAP_PX + widths.max().unwrap_or(0).max(400);
    let heights = rows.iter().map(|(_, photos)| {
        photos.iter().map(|(photo, _)| photo.height_px as usize).max().unwrap_or(0)
    });
    let heights: Vec<usize> = heights.collect();
    let height = GAP_PX + heights.iter().map(|height| height + 2 * LINE_PX + GAP_PX).sum::<usize>();
    let rgb8 = vec![GROUND; 3 * width * height];
    let [width_px, height_px] =
        [width, height].map(|side| u32::try_from(side).expect("a sheet of photos"));
    let mut sheet = PhotoData { width_px, height_px, rgb8, scene_toml: None };
    // Each row consists of a title, photos and captions.
    let mut top = GAP_PX;
    for ((title, photos), height) in rows.iter().zip(heights) {
        write(&mut sheet, title, [GAP_PX, top]);
        let mut left = GAP_PX;
        for (photo, caption) in photos {
            paste(&mut sheet, photo, [left, top + LINE_PX]);
            write(&mut sheet, caption, [left, top + LINE_PX + height]);
            left += photo.width_px as usize + GAP_PX;
        }
        top += height + 2 * LINE_PX + GAP_PX;
    }
    Photo::made(sheet)
}

/// Copies a photo to a position in the sheet. The photo must fit.
fn paste(sheet: &mut PhotoData, photo: &Photo, [left, top]: [usize; 2]) {
    let [width, row_bytes] = [sheet.width_px as usize, 3 * photo.width_px as usize];
    for (y, row) in photo.rgb8.chunks_exact(row_bytes).enumerate() {
        let start = 3 * ((top + y) * width + left);
        sheet.rgb8[start..start + row_bytes].copy_from_slice(row);
    }
}

/// Writes a line of text below and to the right of a position, cut off at the sheet's edges.
fn write(sheet: &mut PhotoData, text: &str, [left, top]: [usize; 2]) {
    let font = FontRef::try_from_slice(TTF).expect("the font under fonts/ is read by a test");
    let scaled = font.as_scaled(TEXT_PX);
    let width = sheet.width_px as usize;
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
            let index = 3 * (y * width + x);
            if x < width && index + 3 <= sheet.rgb8.len() {
                // Thin strokes, which cover half a pixel, are drawn at twice their contrast.
                let ink = (2.0 * cover).min(1.0) * f32::from(INK - GROUND);
                #[expect(clippy::cast_possible_truncation, reason = "between two levels")]
                sheet.rgb8[index..index + 3].fill((f32::from(GROUND) + ink) as u8);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_stand_in_rows_with_their_text() {
        let rows = [("team", 100), ("tuned", 200)].map(|(title, level)| {
            let photos = [(300, "median"), (200, "worst")].map(|(width_px, caption)| {
                let rgb8 = vec![level; 60 * width_px as usize];
                let photo = PhotoData { width_px, height_px: 20, rgb8, scene_toml: None };
                (Photo::made(photo), caption.to_owned())
            });
            (title.to_owned(), photos.into())
        });
        let sheet = contact_sheet(&rows);
        assert_eq!((sheet.width_px, sheet.height_px), (12 + 312 + 212, 12 + 2 * (20 + 64 + 12)));
        let level = |x: usize, y: usize| sheet.rgb8[3 * (y * 536 + x)];
        assert_eq!(
            [level(12, 44), level(311, 63), level(312, 50), level(324, 44)],
            [100, 100, GROUND, 100]
        );
        assert_eq!(level(12, 44 + 96), 200, "the second row");
        let title = (12..30).flat_map(|y| (12..100).map(move |x| level(x, y)));
        assert!(title.filter(|level| *level > 200).count() > 20, "something is written");
    }
}
