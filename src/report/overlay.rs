//! A verdict on its photo: intended strokes, what is missing, what is too much, and each letter's
//! share in the choice, as PNG or SVG.

use std::fmt::Write as _;

use base64::prelude::{BASE64_STANDARD, Engine};
use tiny_skia::{LineCap, Paint, Path, PathBuilder, PixmapMut, Stroke, Transform};

use crate::letters::{Cell, Font, Trace};
use crate::photo::Photo;
use crate::score::{LetterVerdict, Marks, Verdict};

/// Colors that no lamp of a Crazyflie has: these are white, blue and red.
const INTENDED: [u8; 3] = [0, 200, 120];
const MISSING: [u8; 3] = [255, 80, 200];
const STRAY: [u8; 3] = [240, 228, 66];
const CELL: [u8; 3] = [150, 150, 150];

/// Height of a label by the width of its cell: seven characters fill it.
const LABEL_SHARE: f64 = 0.16;

/// Lines of one kind.
struct Layer<'a> {
    name: &'static str,
    lines: &'a [Vec<[f64; 2]>],
    color: [u8; 3],
    width_px: f64,
    look: Look,
}

/// How points become a line.
#[derive(Clone, Copy, PartialEq)]
enum Look {
    Open,
    Closed,
    Dots,
}

/// The overlay as an SVG file's text, with the photo inside.
#[must_use]
pub fn overlay_svg(photo: &Photo, marks: &Marks, verdict: &Verdict) -> String {
    let mut png = Vec::new();
    photo.write_png(&mut png, None, &[]).expect("a photo fits into a PNG in memory");
    let (width, height) = (photo.width_px, photo.height_px);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\">\n<image width=\"{width}\" height=\"{height}\" \
         href=\"data:image/png;base64,{}\"/>\n",
        BASE64_STANDARD.encode(&png)
    );
    for layer in layers(marks, photo) {
        let [r, g, b] = layer.color;
        let path: String = layer.lines.iter().map(|line| outline(line, layer.look)).collect();
        let _ = writeln!(
            svg,
            "<path id=\"{}\" fill=\"none\" stroke=\"rgb({r},{g},{b})\" stroke-width=\"{:.2}\" \
             stroke-linecap=\"round\" d=\"{path}\"/>",
            layer.name, layer.width_px
        );
    }
    for (text, [x, y], size_px) in labels(marks, verdict) {
        let _ = writeln!(
            svg,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size_px:.1}\" \
             font-family=\"sans-serif\" fill=\"white\">{text}</text>"
        );
    }
    svg + "</svg>\n"
}

/// The overlay as a photo.
#[must_use]
pub fn overlay_photo(photo: &Photo, marks: &Marks, verdict: &Verdict) -> Photo {
    let pixels = photo.rgb8.as_chunks::<3>().0.iter();
    let mut rgba: Vec<u8> = pixels.flat_map(|&[r, g, b]| [r, g, b, 255]).collect();
    let mut canvas = PixmapMut::from_bytes(&mut rgba, photo.width_px, photo.height_px)
        .expect("a photo has pixels");
    for layer in layers(marks, photo) {
        for path in layer.lines.iter().filter_map(|line| path_of(line, layer.look)) {
            draw(&mut canvas, &path, layer.color, layer.width_px);
        }
    }
    let font = Font::open("simplex", Trace::CenterLine).expect("a font of ours");
    for (text, [x, y], size_px) in labels(marks, verdict) {
        let mut left = x;
        for character in text.chars() {
            let wide = font.aspect(character).unwrap_or(0.6) * size_px;
            let cell = Cell { left_m: left, baseline_m: -y, width_m: wide, cap_height_m: size_px };
            let moves = font.glyph(character, cell).map_or(Vec::new(), |glyph| glyph.moves);
            for step in moves.iter().filter(|step| step.lit) {
                let line = [step.from_m, step.to_m].map(|[x, up]| [x, -up]);
                if let Some(path) = path_of(&line, Look::Open) {
                    draw(&mut canvas, &path, [255; 3], (0.12 * size_px).max(1.0));
                }
            }
            left += wide + 0.25 * size_px;
        }
    }
    let rgb8 = rgba.as_chunks::<4>().0.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
    Photo { rgb8, scene_toml: None, ..*photo }
}

fn layers<'a>(marks: &'a Marks, photo: &Photo) -> [Layer<'a>; 4] {
    let pen_px = (f64::from(photo.width_px.max(photo.height_px)) / 800.0).max(0.8);
    let layer = |name, lines, color, width_px, look| Layer { name, lines, color, width_px, look };
    [
        layer("cells", &marks.cells[..], CELL, 0.7 * pen_px, Look::Closed),
        layer("intended", &marks.intended[..], INTENDED, pen_px, Look::Open),
        layer("stray", &marks.stray[..], STRAY, 2.0 * pen_px, Look::Dots),
        layer("missing", &marks.missing[..], MISSING, 3.0 * pen_px, Look::Open),
    ]
}

/// What stands above each cell, where, and how large: the letter and its share, over its first rival
/// and its; as narrow as the cell.
fn labels(marks: &Marks, verdict: &Verdict) -> Vec<(String, [f64; 2], f64)> {
    let seen = verdict.letters.iter().filter(|letter| letter.recall.is_some());
    let label = |(corners, letter): (&Vec<[f64; 2]>, &LetterVerdict)| {
        let ([left, top], [right, _]) = (*corners.first()?, *corners.get(1)?);
        let size_px = LABEL_SHARE * (right - left);
        let row = |above: f64| [left, top - above * size_px];
        let own = (format!("{} {:.2}", letter.expected, letter.p?), row(2.0), size_px);
        let rival = letter.rivals.first();
        let rival = rival
            .map(|rival| (format!("{}? {:.2}", rival.letter, rival.p), row(0.4), 0.85 * size_px));
        Some([Some(own), rival])
    };
    marks.cells.iter().zip(seen).filter_map(label).flatten().flatten().collect()
}

fn outline(line: &[[f64; 2]], look: Look) -> String {
    let mut path = String::new();
    for (index, [x, y]) in line.iter().enumerate() {
        let step = if index == 0 || look == Look::Dots { 'M' } else { 'L' };
        let _ = write!(path, "{step}{x:.1},{y:.1}");
        if look == Look::Dots {
            path += "h.1";
        }
    }
    if look == Look::Closed { path + "Z" } else { path }
}

fn path_of(line: &[[f64; 2]], look: Look) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (index, point) in line.iter().enumerate() {
        #[expect(clippy::cast_possible_truncation, reason = "pixels of a photo")]
        let [x, y] = point.map(|px| px as f32);
        if index == 0 || look == Look::Dots {
            builder.move_to(x, y);
        } else {
            builder.line_to(x, y);
        }
        if look == Look::Dots {
            builder.line_to(x + 0.1, y);
        }
    }
    if look == Look::Closed {
        builder.close();
    }
    builder.finish()
}

fn draw(canvas: &mut PixmapMut<'_>, path: &Path, [r, g, b]: [u8; 3], width_px: f64) {
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, 255);
    #[expect(clippy::cast_possible_truncation, reason = "pixels of a photo")]
    let stroke = Stroke { width: width_px as f32, line_cap: LineCap::Round, ..Stroke::default() };
    canvas.stroke_path(path, &paint, &stroke, Transform::identity(), None);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{LetterOptions, write};
    use crate::score::{Homography, Known, Reader, ScoreOptions, View};

    #[test]
    fn what_is_missing_is_drawn_where_it_should_be() {
        let strokes = write("L", &LetterOptions::default()).unwrap();
        let (width_px, height_px) = (200, 200);
        let mut rgb8 = vec![2; 3 * 200 * 200];
        for y in 50..150 {
            rgb8[3 * (200 * y + 68)..3 * (200 * y + 74)].fill(255);
        }
        let photo = Photo { width_px, height_px, rgb8, scene_toml: None };
        let corners = [[70.0, 50.0], [130.0, 50.0], [130.0, 150.0], [70.0, 150.0]];
        let plane = Homography::from_corners(strokes.bounds_m(), corners, [200, 200]).unwrap();
        let reader = Reader::new(&strokes, &ScoreOptions::default()).unwrap();
        let (verdict, marks) =
            reader.explain(&photo, &View::Plane(plane), &Known::default()).unwrap();
        let missing_mm = verdict.letters[0].missing_mm.unwrap();
        assert!((200.0..300.0).contains(&missing_mm), "the foot: {verdict:?}");
        let drawn = overlay_photo(&photo, &marks, &verdict);
        let is_missing = |index: &usize| drawn.rgb8[3 * index..][..3] == MISSING;
        let missing: Vec<usize> = (0..200 * 200).filter(is_missing).collect();
        // The stem is lit from column 68 to 73; the line has round ends.
        assert!(!missing.is_empty() && missing.iter().all(|at| at % 200 > 72), "right of the stem");
        let svg = overlay_svg(&photo, &marks, &verdict);
        assert!(svg.contains("id=\"missing\"") && svg.contains(">L "), "{}", svg.len());
    }
}
