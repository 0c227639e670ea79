//! Draws a verdict over its photo, as SVG or as a photo: intended, missing and surplus strokes, and
//! the probability of each letter.

use kurbo::{Point, Vec2};

use super::canvas::{Canvas, Pen, Pixels, Rgb, Surface};
use noctograph_picture::photo::Photo;
use noctograph_score::{LetterVerdict, Marks, Verdict};

/// Colors that differ from those of Crazyflie lamps, which are white, blue and red.
const INTENDED: Rgb = [0, 200, 120];
const MISSING: Rgb = [255, 80, 200];
const STRAY: Rgb = [240, 228, 66];
const CELL: Rgb = [150, 150, 150];

/// Height of a label relative to the width of its cell, chosen so that seven characters fit.
const LABEL_RATIO: f64 = 0.13;

/// Returns the overlay as an SVG file that contains the photo and a layer for each kind of mark.
pub fn overlay_svg(photo: &Photo, marks: &Marks, verdict: &Verdict) -> String {
    let mut canvas = Canvas::over(photo);
    draw(&mut canvas, photo, marks, verdict);
    canvas.svg()
}

/// Returns an SVG of the marks without the photo, to be shown on top of it.
pub(super) fn marks_svg(photo: &Photo, marks: &Marks, verdict: &Verdict) -> String {
    let mut canvas = Canvas::new([photo.width_px, photo.height_px], "");
    draw(&mut canvas, photo, marks, verdict);
    canvas.svg()
}

/// Returns the photo with the marks drawn on it.
pub fn overlay_photo(photo: &Photo, marks: &Marks, verdict: &Verdict) -> Photo {
    let mut pixels = Pixels::new(photo);
    draw(&mut pixels, photo, marks, verdict);
    pixels.photo()
}

/// Draws all marks and labels, the most important ones last.
fn draw(canvas: &mut impl Surface, photo: &Photo, marks: &Marks, verdict: &Verdict) {
    // Pens are wider on larger photos.
    let pen_px = (f64::from(photo.width_px.max(photo.height_px)) / 800.0).max(0.8);
    canvas.layer("cells");
    for corners in &marks.cells {
        let outline = corners.iter().chain(corners.first());
        canvas.line(outline.map(point), Pen::new(CELL, 0.7 * pen_px));
    }
    canvas.layer("intended");
    for line in &marks.intended {
        canvas.line(line.iter().map(point), Pen::new(INTENDED, pen_px));
    }
    canvas.layer("stray");
    for pixel in marks.stray.iter().flatten() {
        canvas.dot(point(pixel), pen_px, STRAY);
    }
    canvas.layer("missing");
    for line in &marks.missing {
        canvas.line(line.iter().map(point), Pen::new(MISSING, 3.0 * pen_px));
    }
    canvas.layer("labels");
    let seen = verdict.letters.iter().filter(|letter| letter.recall.is_some());
    for (corners, letter) in marks.cells.iter().zip(seen) {
        label(canvas, corners, letter);
    }
}

/// Converts an array of coordinates to a point.
fn point([x, y]: &[f64; 2]) -> Point {
    Point::new(*x, *y)
}

/// Writes a letter, its probability and its strongest rival above a cell, no wider than the cell.
fn label(canvas: &mut impl Surface, corners: &[[f64; 2]], letter: &LetterVerdict) {
    let ([first, second, ..], Some(p)) = (corners, letter.p) else { return };
    let (corner, cap_px) = (point(first), LABEL_RATIO * (second[0] - first[0]));
    let text = format!("{} {p:.2}", letter.expected);
    canvas.write(&text, corner - Vec2::new(0.0, 2.0 * cap_px), cap_px, [255; 3]);
    if let Some(rival) = letter.rivals.first() {
        let text = format!("{}? {:.2}", rival.letter, rival.p);
        canvas.write(&text, corner - Vec2::new(0.0, 0.4 * cap_px), 0.85 * cap_px, [255; 3]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::photo::PhotoData;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_score::{Homography, Known, Reader, ScoreOptions, View};

    #[test]
    fn what_is_missing_is_drawn_where_it_should_be() {
        let strokes = write("L", &LetterOptions::default()).unwrap();
        let (width_px, height_px) = (200, 200);
        let mut rgb8 = vec![2; 3 * 200 * 200];
        for y in 50..150 {
            rgb8[3 * (200 * y + 68)..3 * (200 * y + 74)].fill(255);
        }
        let photo = Photo::made(PhotoData { width_px, height_px, rgb8, scene_toml: None });
        let corners = [[70.0, 50.0], [130.0, 50.0], [130.0, 150.0], [70.0, 150.0]];
        let plane = Homography::from_corners(strokes.bounds_m(), corners, [200, 200]).unwrap();
        let reader = Reader::new(&strokes, &ScoreOptions::default()).unwrap();
        let (verdict, marks) =
            reader.explain(&photo, &View::Plane(plane), &Known::default()).unwrap();
        let missing_mm = verdict.letters[0].missing_mm.unwrap();
        assert!((200.0..300.0).contains(&missing_mm), "the foot: {verdict:?}");
        let drawn = overlay_photo(&photo, &marks, &verdict);
        let missing: Vec<usize> =
            (0..200 * 200).filter(|index| drawn.rgb8[3 * index..][..3] == MISSING).collect();
        // The stem is lit from column 68 to column 73. The line is drawn with round ends.
        assert!(
            !missing.is_empty() && missing.iter().all(|pixel| pixel % 200 > 72),
            "right of the stem"
        );
        let svg = overlay_svg(&photo, &marks, &verdict);
        assert!(svg.contains("id=\"missing\"") && svg.contains(">L "), "{}", svg.len());
    }
}
