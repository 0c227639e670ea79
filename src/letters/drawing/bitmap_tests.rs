//! Pictures: ink on paper under any light, areas.

use super::picture_tests::{Canvas, icon, line, polygon, traced};
use super::tests::{drawn_in, lit, on_canvas};
use super::*;

/// A drawing by its lines in shares of a picture, how wide its pen is in pixels, and what a camera
/// makes of it.
struct Drawn {
    lines: &'static [&'static [[f32; 2]]],
    pen_px: f32,
    taken: fn(&mut image::RgbImage),
}

const SIZE: [u32; 2] = [480, 320];
const CROSS: &[&[[f32; 2]]] = &[&[[0.2, 0.2], [0.8, 0.8]], &[[0.2, 0.8], [0.8, 0.2]]];
const HOUSE: &[&[[f32; 2]]] = &[
    &[[0.2, 0.9], [0.2, 0.5], [0.5, 0.15], [0.8, 0.5], [0.8, 0.9], [0.2, 0.9]],
    &[[0.4, 0.9], [0.4, 0.65], [0.6, 0.65], [0.6, 0.9]],
];
const NOOR: &[&[[f32; 2]]] = &[
    &[[0.1, 0.7], [0.1, 0.3], [0.25, 0.7], [0.25, 0.3]],
    &[[0.35, 0.4], [0.4, 0.3], [0.48, 0.4], [0.48, 0.6], [0.4, 0.7], [0.35, 0.6], [0.35, 0.4]],
    &[[0.58, 0.4], [0.63, 0.3], [0.7, 0.4], [0.7, 0.6], [0.63, 0.7], [0.58, 0.6], [0.58, 0.4]],
    &[[0.8, 0.7], [0.8, 0.3], [0.92, 0.38], [0.8, 0.5], [0.92, 0.7]],
];

/// Points in pixels.
fn scaled(points: &[[f32; 2]]) -> Vec<[f32; 2]> {
    points.iter().map(|[x, y]| [x * SIZE[0] as f32, y * SIZE[1] as f32]).collect()
}

/// The drawing in black on white.
fn sheet(lines: &[&[[f32; 2]]], pen_px: f32) -> image::RgbImage {
    let mut canvas = Canvas::new(SIZE, [255; 3]);
    lines.iter().for_each(|points| canvas.draw(&line(&scaled(points)), [20, 20, 25], pen_px));
    canvas.picture()
}

/// Draws a picture from a file.
fn drawn(
    picture: impl Into<image::DynamicImage>,
    options: &LetterOptions,
    ink: Ink,
) -> Result<Strokes> {
    let mut file = std::io::Cursor::new(Vec::new());
    picture.into().write_to(&mut file, image::ImageFormat::Png).unwrap();
    drawn_in("a.png", file.into_inner(), options, ink)
}

#[expect(clippy::cast_possible_truncation, reason = "levels")]
fn change(picture: &mut image::RgbImage, level: impl Fn(f64, f64, f64) -> f64) {
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        pixel.0 = pixel.0.map(|value| level(f64::from(x), f64::from(y), f64::from(value)) as u8);
    }
}

fn shadow(picture: &mut image::RgbImage) {
    change(picture, |x, y, value| {
        let edge = 1.0 / (1.0 + libm::exp((x - 0.6 * y - 180.0) / 15.0));
        0.9 * value * (1.0 - 0.0004 * x) * (0.65 + 0.35 * edge)
    });
}

/// A quarter of the light.
fn dark_shadow(picture: &mut image::RgbImage) {
    change(picture, |x, y, value| {
        let edge = 1.0 / (1.0 + libm::exp((x - 0.6 * y - 180.0) / 15.0));
        value * (0.25 + 0.75 * edge)
    });
}

fn noise(picture: &mut image::RgbImage) {
    change(picture, |x, y, value| {
        let hash = libm::sin(12.9898 * x + 78.233 * y) * 43_758.545_3;
        0.94 * value + 14.0 * (hash - hash.floor())
    });
}

fn squares(picture: &mut image::RgbImage) {
    change(
        picture,
        |x, y, value| if x % 24.0 < 1.0 || y % 24.0 < 1.0 { 0.85 * value } else { value },
    );
}

/// Half of the light beyond an edge as sharp as a lens draws it, on squared paper.
fn squares_in_shadow(picture: &mut image::RgbImage) {
    squares(picture);
    change(picture, |x, y, value| {
        let edge = 1.0 / (1.0 + libm::exp((x + 0.4 * y - 310.0) / 0.5));
        value * (0.5 + 0.5 * edge)
    });
    noise(picture);
}

fn chalk(picture: &mut image::RgbImage) {
    change(picture, |_, _, value| 40.0 + 0.7 * (255.0 - value));
    noise(picture);
}

/// A lamp's reflection on an evenly lit board.
fn glare(picture: &mut image::RgbImage) {
    change(picture, |x, y, value| {
        let square = (x - 330.0) * (x - 330.0) + (y - 70.0) * (y - 70.0);
        0.8 * value + 55.0 * libm::exp(-square / 1800.0)
    });
}

fn faint(picture: &mut image::RgbImage) {
    change(picture, |_, _, value| 150.0 + 0.4 * value);
    noise(picture);
}

/// Share of places that lie within a distance of others.
fn near(points: &[[f64; 2]], others: &[[f64; 2]], within: f64) -> f64 {
    points.iter().filter(|p| others.iter().any(|other| distance(**p, *other) <= within)).count()
        as f64
        / points.len() as f64
}

#[test]
fn the_lines_of_a_picture_are_found_whatever_the_light_and_the_paper() {
    let plain: fn(&mut image::RgbImage) = |_| {};
    let sheets = [
        Drawn { lines: CROSS, pen_px: 3.0, taken: plain },
        Drawn { lines: CROSS, pen_px: 8.0, taken: shadow },
        Drawn { lines: CROSS, pen_px: 3.0, taken: faint },
        Drawn { lines: HOUSE, pen_px: 3.0, taken: shadow },
        Drawn { lines: HOUSE, pen_px: 5.0, taken: noise },
        Drawn { lines: HOUSE, pen_px: 6.0, taken: squares },
        Drawn { lines: HOUSE, pen_px: 5.0, taken: chalk },
        Drawn { lines: NOOR, pen_px: 3.0, taken: plain },
        Drawn { lines: NOOR, pen_px: 6.0, taken: shadow },
        Drawn { lines: NOOR, pen_px: 4.0, taken: chalk },
        Drawn { lines: NOOR, pen_px: 5.0, taken: squares },
        Drawn { lines: HOUSE, pen_px: 5.0, taken: dark_shadow },
        Drawn { lines: HOUSE, pen_px: 5.0, taken: squares_in_shadow },
        Drawn { lines: NOOR, pen_px: 3.0, taken: dark_shadow },
        Drawn { lines: HOUSE, pen_px: 4.0, taken: glare },
        Drawn { lines: CROSS, pen_px: 4.0, taken: glare },
    ];
    for (index, Drawn { lines, pen_px, taken }) in sheets.into_iter().enumerate() {
        let clean = sheet(lines, pen_px);
        let mut picture = clean.clone();
        taken(&mut picture);
        let format = [image::ImageFormat::Png, image::ImageFormat::Jpeg][index % 2];
        let trace = traced(&picture, format).lines;
        let flown: Vec<[f64; 2]> =
            trace.iter().flat_map(|(line, _)| crate::smooth::evenly(line, 1.0)).collect();
        let dark = clean.enumerate_pixels().filter(|(.., pixel)| pixel.0[0] < 128);
        let dark: Vec<_> = dark.map(|(x, y, _)| [x, y].map(|x| f64::from(x) + 0.5)).collect();
        let within = 1.5 * f64::from(pen_px);
        let [drawn, meant] = [near(&dark, &flown, within), near(&flown, &dark, within)];
        assert!(drawn >= 0.97 && meant >= 0.97, "{index}: {drawn:.3} drawn, {meant:.3} meant");
        assert!(trace.len() <= 8, "{index}: {} strokes", trace.len());
        assert!(trace.iter().all(|(_, color)| *color == [0; 3]), "{index}: black ink");
    }
}

#[test]
fn webp_bmp_and_the_first_frame_of_a_gif_are_read_as_png_is() {
    let folder = tempfile::tempdir().unwrap();
    let strokes =
        |name: &str| draw(&folder.path().join(name), &on_canvas(2.0, 1.0), Ink::ByColor).unwrap();
    let picture = image::DynamicImage::from(sheet(HOUSE, 6.0));
    for name in ["a.png", "a.webp", "a.bmp"] {
        picture.save(folder.path().join(name)).unwrap();
        assert_eq!(strokes(name), strokes("a.png"), "{name}");
    }
    let mut gif = std::fs::File::create(folder.path().join("a.gif")).unwrap();
    let mut frames = image::codecs::gif::GifEncoder::new(&mut gif);
    for lines in [HOUSE, NOOR] {
        let frame = image::DynamicImage::from(sheet(lines, 6.0)).into_rgba8();
        frames.encode_frame(image::Frame::new(frame)).unwrap();
    }
    drop(frames);
    let (first, wanted) = (strokes("a.gif"), strokes("a.png"));
    assert_eq!(first.n_strokes(), wanted.n_strokes());
    assert!((first.length_m() / wanted.length_m() - 1.0).abs() < 0.01);
}

#[test]
fn a_jpeg_that_is_cut_off_is_refused() {
    let mut file = std::io::Cursor::new(Vec::new());
    sheet(HOUSE, 6.0).write_to(&mut file, image::ImageFormat::Jpeg).unwrap();
    let whole = file.into_inner();
    let drawn = |bytes: &[u8]| drawn_in("a.jpg", bytes, &on_canvas(2.0, 1.0), Ink::Alike);
    drawn(&whole).unwrap();
    let refused = drawn(&whole[..whole.len() / 2]).unwrap_err().to_string();
    assert!(refused.contains("cut off"), "{refused}");
}

#[test]
fn thick_patches_are_outlined_colors_kept_and_a_blank_sheet_refused() {
    let mut picture = image::RgbImage::from_pixel(300, 200, image::Rgb([250, 250, 245]));
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        if (50..150).contains(&x) && (50..150).contains(&y) {
            pixel.0 = [200, 30, 30];
        } else if (200..206).contains(&x) && (30..170).contains(&y) {
            pixel.0 = [20, 30, 180];
        }
    }
    let strokes = drawn(picture, &on_canvas(2.0, 1.0), Ink::ByColor).unwrap();
    fn length_m(glyph: &Glyph) -> f64 {
        let lit = glyph.moves.iter().filter(|step| step.lit);
        lit.map(|step| distance(step.from_m, step.to_m)).sum::<f64>()
    }
    let trace: Vec<_> =
        strokes.colors.iter().zip(&strokes.glyphs).map(|(c, g)| (*c, length_m(g))).collect();
    let [(blue, bar_m), (red, rim_m)] = trace[..] else { panic!("two colors: {trace:?}") };
    assert_eq!((red, blue), ([255, 0, 0], [0, 0, 255]), "hues at full level");
    // The bar is the tallest: its 140 pixels are the canvas, less a pen at its ends.
    assert!((rim_m / bar_m - 400.0 / 134.0).abs() < 0.1, "{rim_m} m around, {bar_m} m along");

    let blank =
        image::RgbImage::from_fn(300, 200, |x, _| image::Rgb([if x < 99 { 200 } else { 190 }; 3]));
    let refused = drawn(blank, &LetterOptions::default(), Ink::Alike).unwrap_err().to_string();
    assert!(refused.contains("stand out"), "{refused}");
}

/// A face in soft light before a dark wall, with the grain of a camera.
fn photograph() -> image::RgbImage {
    let mut picture = image::RgbImage::from_fn(480, 320, |x, y| {
        let [x, y] = [f64::from(x), f64::from(y)];
        let far = libm::hypot((x - 240.0) / 110.0, (y - 160.0) / 150.0);
        let face = 1.0 / (1.0 + libm::exp(12.0 * (far - 1.0)));
        let light = 1.0 - 0.5 * far * face + 0.0006 * (x - 240.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a byte")]
        let tone = |wall: f64, skin: f64| (wall + (skin * light - wall) * face) as u8;
        image::Rgb([tone(40.0, 230.0), tone(50.0, 180.0), tone(70.0, 150.0)])
    });
    noise(&mut picture);
    picture
}

#[test]
fn a_photograph_is_refused_unless_the_corners_of_its_sheet_are_named() {
    let drawn = |corners_px| {
        let options = LetterOptions { corners_px, ..on_canvas(4.8, 3.2) };
        drawn(photograph(), &options, Ink::Alike)
    };
    let error = drawn(None).unwrap_err();
    let told = format!("{error}; {}", error.hint());
    assert!(told.contains("a photograph") && told.contains("letters.corners_px"), "{told}");
    drawn(Some([0.0, 0.0, 480.0, 0.0, 480.0, 320.0, 0.0, 320.0])).unwrap();
}

#[test]
fn a_solid_shape_is_its_outline_whatever_lies_beside_it() {
    let mut canvas = Canvas::transparent(SIZE);
    let shapes: [&[[f32; 2]]; 3] = [
        &[[0.7, 0.1], [0.8, 0.3], [0.6, 0.3]],
        &[[0.05, 0.1], [0.5, 0.1], [0.5, 0.9], [0.05, 0.9]],
        &[[0.55, 0.8], [0.95, 0.8], [0.95, 0.83], [0.55, 0.83]],
    ];
    shapes.iter().for_each(|shape| canvas.fill(&polygon(scaled(shape)), [0; 3]));
    canvas.fill(&icon(3, [360.0, 176.0], 48.0).0, [0; 3]);
    let strokes = drawn(canvas.rgba(), &on_canvas(4.8, 3.2), Ink::Alike).unwrap();
    let lines = lit(&strokes);
    let closed: Vec<f64> = lines
        .iter()
        .filter(|(from, to, _)| distance(*from, *to) < 0.05)
        .map(|line| line.2)
        .collect();
    assert_eq!((lines.len(), closed.len()), (4, 3), "three outlines and a line: {lines:?}");
    assert!(closed.iter().all(|length| *length > 0.9), "{closed:?}");
}

#[test]
fn light_ink_on_transparency_is_drawn_as_dark_ink_is() {
    let mut canvas = Canvas::transparent(SIZE);
    let bar = [[0.1, 0.5], [0.9, 0.5], [0.9, 0.53], [0.1, 0.53]];
    canvas.fill(&polygon(scaled(&bar)), [0; 3]);
    let in_ink = |ink: [u8; 3]| {
        let mut picture = canvas.rgba();
        picture.pixels_mut().for_each(|pixel| pixel.0[..3].copy_from_slice(&ink));
        let strokes = drawn(picture, &on_canvas(1.0, 1.0), Ink::Alike).unwrap();
        (strokes.n_strokes(), (10.0 * strokes.length_m()).round())
    };
    for ink in [[255; 3], [255, 240, 0], [0; 3], [200, 30, 30], [180, 255, 180]] {
        assert_eq!(in_ink(ink), (1, 10.0), "{ink:?}");
    }
}

#[test]
fn a_picture_of_one_color_is_no_drawing() {
    for gray in [0, 3, 128, 255] {
        let picture = image::RgbImage::from_pixel(320, 200, image::Rgb([gray; 3]));
        let error = drawn(picture, &on_canvas(1.0, 1.0), Ink::Alike).unwrap_err().to_string();
        assert!(error.contains("a.png: found a picture"), "{gray}: {error}");
    }
}

#[test]
fn a_narrow_strip_is_drawn_or_refused() {
    for (size, is_even) in
        [([3, 3], false), ([3, 4000], false), ([4000, 3], false), ([5, 9], false), ([40, 3], true)]
    {
        let strip = image::RgbImage::from_fn(size[0], size[1], |x, y| {
            let level = if is_even { 255 * u32::from(x != 20) } else { 40 * x + 7 * y };
            image::Rgb([level.to_le_bytes()[0]; 3])
        });
        let told = drawn(strip, &on_canvas(1.0, 1.0), Ink::Alike).map_err(|it| it.to_string());
        assert!(told.as_ref().is_ok_and(|it| it.n_strokes() > 0) || told.is_err(), "{told:?}");
    }
}

#[test]
fn dust_and_a_checkerboard_are_left_out_and_a_pen_on_a_ruling_is_kept() {
    let options = LetterOptions::default();
    let clean = sheet(CROSS, 10.0);
    let wanted = drawn(clean.clone(), &options, Ink::Alike).unwrap();
    let mut dusty = clean.clone();
    for (x, y, pixel) in dusty.enumerate_pixels_mut() {
        let hash =
            (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503)).wrapping_mul(2_246_822_519);
        if hash >> 8 & 511 == 0 {
            pixel.0 = [0; 3];
        }
    }
    let checkered = |side: u32, tones: [u8; 2]| {
        let mut picture = clean.clone();
        for (x, y, pixel) in picture.enumerate_pixels_mut() {
            let tone = u16::from(tones[usize::from((x / side + y / side).is_multiple_of(2))]);
            pixel.0 = pixel.0.map(|value| u8::try_from(u16::from(value) * tone / 255).unwrap());
        }
        picture
    };
    for (picture, said) in [
        (dusty, "speck(s), as of dust"),
        (checkered(8, [204, 255]), "checkerboard"),
        (checkered(16, [191, 254]), "checkerboard"),
        (checkered(10, [102, 153]), "checkerboard"),
    ] {
        let strokes = drawn(picture, &options, Ink::Alike).unwrap();
        assert_eq!(strokes.source.strokes.len(), wanted.source.strokes.len(), "{said}");
        assert!(strokes.warnings.iter().any(|text| text.contains(said)), "{:?}", strokes.warnings);
        let (found_m, wanted_m) = (strokes.bounds_m(), wanted.bounds_m());
        assert!((0..4).all(|k| (found_m[k] - wanted_m[k]).abs() < 0.02), "{said}: {found_m:?}");
    }
    let mut canvas = Canvas::new(SIZE, [255; 3]);
    for y in (32..320_u16).step_by(32).map(f32::from) {
        canvas.draw(&line(&[[0.0, y], [480.0, y]]), [170, 190, 230], 1.5);
    }
    canvas.draw(&line(&[[80.0, 64.0], [400.0, 64.0]]), [20, 20, 60], 4.0);
    canvas.draw(&line(&[[80.0, 240.0], [240.0, 240.0]]), [20, 20, 60], 4.0);
    let strokes = drawn(canvas.picture(), &options, Ink::Alike).unwrap();
    let lit = strokes.glyphs[0].moves.iter().filter(|step| step.lit);
    let length_m: f64 = lit.map(|step| distance(step.from_m, step.to_m)).sum();
    let [left, _, right, _] = strokes.bounds_m();
    assert!((length_m / (right - left) - 1.5).abs() < 0.05, "{length_m}, {left} to {right}");
}
