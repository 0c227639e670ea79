//! Pictures that people bring: icons, colors, paper.

use super::*;
use tiny_skia::{
    FillRule, LineCap, Mask, Paint as Brush, Path, PathBuilder, Pixmap, Stroke, Transform,
};

const WHITE: [u8; 3] = [255; 3];

/// A picture that is painted shape by shape.
pub(super) struct Canvas(Pixmap);

impl Canvas {
    pub(super) fn new([width, height]: [u32; 2], [r, g, b]: [u8; 3]) -> Self {
        let mut pixmap = Pixmap::new(width, height).unwrap();
        pixmap.fill(tiny_skia::Color::from_rgba8(r, g, b, 255));
        Self(pixmap)
    }

    pub(super) fn fill(&mut self, path: &Path, color: [u8; 3]) {
        self.0.fill_path(path, &brush(color), FillRule::EvenOdd, Transform::identity(), None);
    }

    pub(super) fn draw(&mut self, path: &Path, color: [u8; 3], width: f32) {
        let pen = Stroke { width, line_cap: LineCap::Round, ..Stroke::default() };
        self.0.stroke_path(path, &brush(color), &pen, Transform::identity(), None);
    }

    pub(super) fn transparent([width, height]: [u32; 2]) -> Self {
        Self(Pixmap::new(width, height).unwrap())
    }

    pub(super) fn rgba(&self) -> image::RgbaImage {
        let (width, height) = (self.0.width(), self.0.height());
        image::RgbaImage::from_raw(width, height, self.0.data().to_vec()).unwrap()
    }

    pub(super) fn picture(&self) -> image::RgbImage {
        image::DynamicImage::from(self.rgba()).into_rgb8()
    }

    fn traced(&self) -> Traced {
        traced(&self.picture(), image::ImageFormat::Png)
    }
}

fn brush([r, g, b]: [u8; 3]) -> Brush<'static> {
    let mut brush = Brush { anti_alias: true, ..Brush::default() };
    brush.set_color_rgba8(r, g, b, 255);
    brush
}

/// The lines of a picture in its pixels, y down.
pub(super) fn traced(picture: &image::RgbImage, format: image::ImageFormat) -> Traced {
    traced_with(&LetterOptions::default(), picture, format).unwrap()
}

pub(super) fn traced_with(
    options: &LetterOptions,
    picture: &image::RgbImage,
    format: image::ImageFormat,
) -> Result<Traced> {
    let mut file = Vec::new();
    picture.write_to(&mut std::io::Cursor::new(&mut file), format).unwrap();
    let mut traced =
        bitmap::read(&file, options, |_: [f64; 4]| Ok(1.0 / f64::from(picture.height())), "a")?;
    for point in traced.lines.iter_mut().flat_map(|(line, _)| line) {
        // A pixel's middle is at half of it, and the lines have a margin of a pixel.
        *point = [point[0] - 0.5, -point[1] - 0.5];
    }
    Ok(traced)
}

pub(super) fn polygon(corners: impl IntoIterator<Item = [f32; 2]>) -> Path {
    let mut path = PathBuilder::new();
    for (index, [x, y]) in corners.into_iter().enumerate() {
        if index == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
    }
    path.close();
    path.finish().unwrap()
}

fn circle(x: f32, y: f32, r: f32) -> Path {
    PathBuilder::from_circle(x, y, r).unwrap()
}

pub(super) fn line(points: &[[f32; 2]]) -> Path {
    let mut path = PathBuilder::new();
    path.move_to(points[0][0], points[0][1]);
    points[1..].iter().for_each(|[x, y]| path.line_to(*x, *y));
    path.finish().unwrap()
}

/// Icons in a square from −1 to 1; those that are drawn with a pen have its width.
const ICONS: usize = 17;

pub(super) fn icon(kind: usize, [x, y]: [f32; 2], r: f32) -> (Path, Option<f32>) {
    let on_canvas = |[dx, dy]: [f32; 2]| [x + r * dx, y + r * dy];
    let corners = |list: &str| {
        let number = |text: &str| text.parse::<f32>().unwrap();
        let places = list.split(' ').filter_map(|place| place.split_once(','));
        polygon(places.map(|(x, y)| on_canvas([number(x), number(y)])))
    };
    let round = |n: u8, radius: &dyn Fn(f32) -> f32| {
        polygon((0..n).map(|k| {
            let angle = f32::from(k) * std::f32::consts::TAU / f32::from(n);
            let (sin, cos) = libm::sincosf(angle);
            on_canvas([radius(angle) * sin, -radius(angle) * cos])
        }))
    };
    let path = match kind {
        0 => circle(x, y, r),
        1 => corners("-0.9,-0.9 0.9,-0.9 0.9,0.9 -0.9,0.9"),
        2 => corners("0,-0.9 1,0.8 -1,0.8"),
        3 => polygon((0_u8..10).map(|k| {
            let (sin, cos) = libm::sincosf(f32::from(k) * std::f32::consts::PI / 5.0);
            let r = if k.is_multiple_of(2) { 1.0 } else { 0.42 };
            on_canvas([r * sin, -r * cos])
        })),
        // A heart.
        4 => polygon((0_u8..120).map(|k| {
            let t = f32::from(k) * std::f32::consts::TAU / 120.0;
            let (sin, cos) = libm::sincosf(t);
            let y = 13.0 * cos
                - 5.0 * libm::cosf(2.0 * t)
                - 2.0 * libm::cosf(3.0 * t)
                - libm::cosf(4.0 * t);
            on_canvas([sin * sin * sin, -y / 17.0])
        })),
        // A moon.
        5 => polygon((0_u8..120).map(|k| {
            let t = f32::from(k % 60) * std::f32::consts::PI / 59.0;
            let (sin, cos) = libm::sincosf(t);
            if k < 60 { on_canvas([-sin, -cos]) } else { on_canvas([-0.45 * sin, cos]) }
        })),
        6 => corners("-1,-0.3 0.1,-0.3 0.1,-0.8 1,0 0.1,0.8 0.1,0.3 -1,0.3"),
        7 => corners("0,-1 1,0 0.7,0 0.7,0.9 -0.7,0.9 -0.7,0 -1,0"),
        8 => corners("0.2,-1 -0.7,0.2 -0.1,0.2 -0.3,1 0.7,-0.3 0.1,-0.3 0.5,-1"),
        9 => round(6, &|_| 1.0),
        10 => round(120, &|angle| 0.8 + 0.2 * libm::cosf(5.0 * angle)),
        // A drop.
        11 => polygon((0_u8..120).map(|k| {
            let t = f32::from(k) * std::f32::consts::TAU / 120.0;
            let (sin, cos) = libm::sincosf(t);
            on_canvas([0.7 * sin * libm::sinf(0.5 * t), -cos])
        })),
        // A ring.
        12 => {
            let mut ring = PathBuilder::new();
            ring.push_circle(x, y, r);
            ring.push_circle(x, y, 0.6 * r);
            ring.finish().unwrap()
        }
        // An ellipse.
        13 => round(120, &|angle| {
            let (sin, cos) = libm::sincosf(angle);
            0.5 / libm::hypotf(0.5 * sin, cos)
        }),
        14 => {
            return (line(&[[-0.9, 0.1], [-0.3, 0.8], [0.9, -0.8]].map(on_canvas)), Some(0.12 * r));
        }
        15 => return (circle(x, y, r), Some(0.1 * r)),
        _ => {
            let zigzag = [[-0.9, 0.6], [-0.3, -0.6], [0.3, 0.6], [0.9, -0.6]];
            return (line(&zigzag.map(on_canvas)), Some(0.12 * r));
        }
    };
    (path, None)
}

/// A row of numbers without end, 0 to 1.
pub(super) fn numbers(seed: u32) -> impl FnMut() -> f32 {
    let mut state = 2 * seed + 1;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from(u16::try_from(state >> 16).unwrap()) / 65536.0
    }
}

/// Intersection by union of what two masks cover.
fn overlap(a: &Mask, b: &Mask) -> f64 {
    let both = || a.data().iter().zip(b.data());
    let n = |channel: &dyn Fn(u8, u8) -> u8| {
        both().map(|(a, b)| f64::from(channel(*a, *b))).sum::<f64>()
    };
    n(&|a, b| a.min(b)) / n(&|a, b| a.max(b))
}

/// What lines cover: filled, or drawn with a pen.
fn covered(lines: &[&Vec<[f64; 2]>], pen: Option<f32>, [width, height]: [u32; 2]) -> Mask {
    let mut path = PathBuilder::new();
    for line in lines {
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let mut points = line.iter().map(|point| point.map(|x| x as f32));
        let [x, y] = points.next().unwrap();
        path.move_to(x, y);
        points.for_each(|[x, y]| path.line_to(x, y));
    }
    let mut mask = Mask::new(width, height).unwrap();
    let Some(path) = path.finish() else { return mask };
    match pen {
        None => mask.fill_path(&path, FillRule::EvenOdd, true, Transform::identity()),
        Some(width) => stroked(&mut mask, &path, width),
    }
    mask
}

pub(super) fn stroked(mask: &mut Mask, path: &Path, width: f32) {
    let pen = Stroke { width, line_cap: LineCap::Round, ..Stroke::default() };
    let outline = path.stroke(&pen, 1.0).unwrap();
    mask.fill_path(&outline, FillRule::Winding, true, Transform::identity());
}

#[test]
fn every_icon_of_forty_scenes_is_its_outline_and_thin_ones_are_lines() {
    const SIZE: [u32; 2] = [800, 540];
    // A line may be off by a pixel.
    const NEAR: f32 = 6.0;
    let inks = [[0, 0, 0], [200, 20, 30], [0, 60, 160], [250, 200, 0], [20, 140, 60]];
    let mut worst = (1.0, String::new());
    for scene in 0..40 {
        let mut next = numbers(scene);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small")]
        let mut pick = |n: usize| (next() * n as f32) as usize;
        let n_icons = 2 + pick(5);
        let mut placed: Vec<([f32; 2], f32, usize)> = Vec::new();
        let mut canvas = Canvas::new(SIZE, WHITE);
        for _ in 0..200 {
            if placed.len() == n_icons {
                break;
            }
            let r = 20.0 * libm::powf(7.0, pick(1000) as f32 / 1000.0);
            let place = [pick(800) as f32, pick(540) as f32];
            let is_free = |(center, other, _): &([f32; 2], f32, usize)| {
                libm::hypotf(center[0] - place[0], center[1] - place[1]) > 1.2 * (r + other) + 8.0
            };
            let inside =
                [800.0, 540.0].iter().zip(place).all(|(side, x)| x > r + 9.0 && x < side - r - 9.0);
            if inside && placed.iter().all(is_free) {
                let kind = pick(ICONS);
                let (path, pen) = icon(kind, place, r);
                let ink = inks[pick(inks.len())];
                match pen {
                    None => canvas.fill(&path, ink),
                    Some(width) => canvas.draw(&path, ink, width),
                }
                placed.push((place, r, kind));
            }
        }
        let lines = canvas.traced().lines;
        for (place, r, kind) in placed {
            let (path, pen) = icon(kind, place, r);
            let of_icon = |line: &&Vec<[f64; 2]>| {
                let [left, top, right, bottom] = bounds(line.iter().copied());
                let middle = [0.5 * (left + right), 0.5 * (top + bottom)];
                distance(middle, place.map(f64::from)) < 0.8 * f64::from(r)
            };
            let drawn: Vec<&Vec<[f64; 2]>> =
                lines.iter().map(|(line, _)| line).filter(of_icon).collect();
            let mut wanted = Mask::new(SIZE[0], SIZE[1]).unwrap();
            match pen {
                None => wanted.fill_path(&path, FillRule::EvenOdd, true, Transform::identity()),
                Some(width) => stroked(&mut wanted, &path, width + NEAR),
            }
            let overlap = overlap(&covered(&drawn, pen.map(|width| width + NEAR), SIZE), &wanted);
            if overlap < worst.0 {
                worst = (overlap, format!("scene {scene}, icon {kind} of {r}: {overlap:.3}"));
            }
        }
    }
    assert!(worst.0 >= 0.9, "{}", worst.1);
}

/// The strokes of each color.
fn hues(traced: &Traced) -> Vec<([u8; 3], usize)> {
    let mut hues: Vec<([u8; 3], usize)> = Vec::new();
    for (_, paint) in &traced.lines {
        let color = *paint;
        match hues.iter_mut().find(|(known, _)| *known == color) {
            Some((_, n)) => *n += 1,
            None => hues.push((color, 1)),
        }
    }
    hues.sort_unstable();
    hues
}

#[test]
fn light_ink_beside_dark_ink_is_drawn_in_its_color() {
    let pale =
        [[255, 216, 224], [255, 243, 176], [208, 240, 255], [224, 224, 224], [255, 208, 160]];
    let mut canvas = Canvas::new([1000, 600], WHITE);
    for (k, ink) in (0_u8..).zip(pale) {
        canvas.draw(&circle(100.0 + 190.0 * f32::from(k), 100.0, 60.0), ink, 12.0);
        canvas.fill(&circle(100.0 + 190.0 * f32::from(k), 260.0, 60.0), ink);
    }
    canvas.draw(&line(&[[100.0, 500.0], [900.0, 500.0]]), [0; 3], 12.0);
    canvas.draw(&line(&[[500.0, 500.0], [500.0, 360.0]]), [250, 220, 60], 12.0);
    let [red, yellow, blue, orange] = [[255, 0, 0], [255, 255, 0], [0, 128, 255], [255, 128, 0]];
    for format in [image::ImageFormat::Png, image::ImageFormat::Jpeg] {
        let trace = traced(&canvas.picture(), format);
        let wanted = [([0; 3], 3), (blue, 2), (red, 2), (orange, 2), (yellow, 3)];
        assert_eq!(hues(&trace), wanted);
        assert!(trace.warnings.is_empty());
    }
}

#[test]
fn light_and_dark_ink_on_paper_of_a_middle_tone_are_drawn_and_on_transparency() {
    let mut canvas = Canvas::new([600, 300], [176, 128, 80]);
    canvas.draw(&circle(100.0, 150.0, 70.0), WHITE, 10.0);
    canvas.draw(&circle(300.0, 150.0, 70.0), [0; 3], 10.0);
    canvas.draw(&circle(500.0, 150.0, 70.0), [250, 220, 40], 10.0);
    assert_eq!(canvas.traced().lines.len(), 3);
    let opaque = canvas.picture();
    let transparent = image::RgbaImage::from_fn(600, 300, |x, y| {
        let [r, g, b] = opaque.get_pixel(x, y).0;
        image::Rgba([r, g, b, if [r, g, b] == [176, 128, 80] { 0 } else { 255 }])
    });
    let mut file = Vec::new();
    let format = image::ImageFormat::Png;
    transparent.write_to(&mut std::io::Cursor::new(&mut file), format).unwrap();
    let trace = bitmap::read(&file, &LetterOptions::default(), |_| Ok(1.0 / 300.0), "a").unwrap();
    assert_eq!(trace.lines.len(), 3);
}

#[test]
fn rulings_of_the_paper_are_fainter_than_a_pen_and_named() {
    let mut canvas = Canvas::new([1000, 700], [252, 251, 246]);
    for k in 1..22 {
        let y = 32.0 * f32::from(u8::try_from(k).unwrap());
        canvas.draw(&line(&[[0.0, y], [1000.0, y + 4.0]]), [150, 190, 230], 2.0);
    }
    canvas.draw(&line(&[[120.0, 0.0], [121.0, 700.0]]), [240, 150, 160], 2.0);
    canvas.draw(
        &line(&[[250.0, 200.0], [250.0, 550.0], [600.0, 550.0], [600.0, 200.0]]),
        [30; 3],
        7.0,
    );
    canvas.draw(&circle(780.0, 250.0, 90.0), [240, 205, 40], 7.0);
    let trace = traced(&as_taken(&canvas, 0.75), image::ImageFormat::Jpeg);
    assert_eq!(hues(&trace), [([0; 3], 1), ([255, 255, 0], 1)]);
    assert!(
        trace.warnings.len() == 1 && trace.warnings[0].contains("faint"),
        "{:?}",
        trace.warnings
    );
}

#[test]
fn rulings_of_a_clean_scan_are_no_ink_and_three_lines_are() {
    fn ruled(n: u8) -> Traced {
        let mut canvas = Canvas::new([1000, 700], WHITE);
        for y in (1..=n).map(|k| 60.0 * f32::from(k)) {
            canvas.draw(&line(&[[-9.0, y], [1009.0, y]]), [150, 190, 230], 3.0);
        }
        let cup = line(&[[250.0, 200.0], [250.0, 555.0], [600.0, 555.0], [600.0, 200.0]]);
        canvas.draw(&cup, [20; 3], 8.0);
        canvas.traced()
    }
    let trace = ruled(10);
    assert_eq!(hues(&trace), [([0; 3], 1)]);
    assert!(trace.warnings.concat().contains("10 pale lines"), "{:?}", trace.warnings);
    let trace = ruled(3);
    assert!(trace.lines.len() > 3 && trace.warnings.is_empty(), "{:?}", trace.warnings);
}

#[test]
fn a_glow_and_a_soft_shadow_are_no_ink() {
    fn drawn(paper: [u8; 3], ink: [u8; 3], width: f32, shift: f32) -> image::RgbImage {
        let mut canvas = Canvas::new([600, 400], paper);
        let vee = [[150.0, 100.0], [300.0, 300.0], [450.0, 100.0]];
        canvas.draw(&line(&vee.map(|place| place.map(|x| x + shift))), ink, width);
        canvas.picture()
    }
    for (paper, ink, soft, width, shift, blur) in [
        ([0; 3], [255, 210, 130], [240, 120, 30], 30.0, 0.0, 14.0),
        (WHITE, [20; 3], [150; 3], 12.0, 9.0, 8.0),
        (WHITE, [20; 3], [135; 3], 30.0, 9.0, 8.0),
    ] {
        let mut picture = image::imageops::blur(&drawn(paper, soft, width, shift), blur);
        for (soft, sharp) in picture.pixels_mut().zip(drawn(paper, ink, 7.0, 0.0).pixels()) {
            let on_light = paper == WHITE;
            soft.0 = std::array::from_fn(|c| {
                if on_light { soft.0[c].min(sharp.0[c]) } else { soft.0[c].max(sharp.0[c]) }
            });
        }
        let trace = traced(&picture, image::ImageFormat::Png);
        assert_eq!(trace.lines.len(), 1, "{soft:?} {width}");
    }
}

/// A picture as a camera takes it: less light to one side, and grain.
fn as_taken(canvas: &Canvas, least_light: f64) -> image::RgbImage {
    let mut picture = canvas.picture();
    let width = f64::from(picture.width());
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        let (x, y) = (f64::from(x), f64::from(y));
        let hash = libm::sin(12.9898 * x + 78.233 * y) * 43_758.545_3;
        let light = 1.0 - (1.0 - least_light) * x / width;
        for value in &mut pixel.0 {
            let grain = 8.0 * (hash - hash.floor() - 0.5);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a byte")]
            let shaded = (light * f64::from(*value) + grain).clamp(0.0, 255.0) as u8;
            *value = shaded;
        }
    }
    picture
}

#[test]
fn a_shape_within_an_area_of_another_color_is_named_and_shades_are_not() {
    let [yellow, blue] = [[250, 210, 30], [20, 60, 200]];
    for (disc, inner) in [(blue, yellow), (yellow, blue), ([0; 3], yellow)] {
        let mut canvas = Canvas::new([600, 400], WHITE);
        canvas.fill(&circle(200.0, 200.0, 150.0), disc);
        canvas.fill(&icon(3, [200.0, 200.0], 60.0).0, inner);
        let trace = canvas.traced();
        let told = &trace.warnings;
        assert_eq!((trace.lines.len(), told.len()), (1, 1), "{told:?}");
        assert!(told[0].contains("several colors"), "{told:?}");
    }
    let mut canvas = Canvas::new([600, 400], WHITE);
    canvas.fill(&circle(300.0, 200.0, 150.0), [240, 80, 60]);
    let mut shaded = as_taken(&canvas, 0.5);
    for soft in [true, false] {
        let trace = traced(&shaded, image::ImageFormat::Jpeg);
        assert_eq!((trace.lines.len(), trace.warnings), (1, Vec::new()), "{soft}");
        let in_shadow = shaded.enumerate_pixels_mut().filter(|(x, ..)| *x < 300);
        in_shadow.for_each(|(.., pixel)| pixel.0 = pixel.0.map(|value| value / 2));
    }
}

#[test]
fn a_picture_of_many_fine_parts_has_a_warning() {
    for (n, is_fine) in [(7_u8, false), (8, true)] {
        let mut canvas = Canvas::new([800, 800], WHITE);
        for k in 0..n * n {
            let [x, y] = [k % n, k / n].map(|k| 40.0 + 90.0 * f32::from(k));
            canvas.draw(&line(&[[x, y], [x + 40.0, y + 20.0]]), [0; 3], 8.0);
        }
        let trace = canvas.traced();
        assert_eq!(trace.lines.len(), usize::from(n * n));
        assert_eq!(trace.warnings.concat().contains("QR code"), is_fine, "{:?}", trace.warnings);
    }
}

#[test]
fn what_is_left_out_at_the_rim_is_said_and_is_no_ruling() {
    let mut canvas = Canvas::new([800, 500], WHITE);
    canvas.fill(&polygon([[0.0, 60.0], [90.0, 60.0], [90.0, 440.0], [0.0, 440.0]]), [0; 3]);
    canvas.draw(&circle(400.0, 250.0, 120.0), [0; 3], 8.0);
    let trace = traced(&canvas.picture(), image::ImageFormat::Png);
    assert_eq!(trace.lines.len(), 1);
    assert!(trace.warnings.len() == 1 && trace.warnings[0].contains("rim"), "{:?}", trace.warnings);
    // A whiteboard and its tray.
    let mut board = Canvas::new([1000, 700], [196; 3]);
    board.fill(&polygon([[0.0, 660.0], [1000.0, 660.0], [1000.0, 700.0], [0.0, 700.0]]), [140; 3]);
    board.draw(&circle(400.0, 350.0, 120.0), [30, 60, 170], 8.0);
    board.draw(&line(&[[600.0, 200.0], [800.0, 500.0]]), [180, 30, 40], 8.0);
    let trace = traced(&as_taken(&board, 0.7), image::ImageFormat::Jpeg);
    assert_eq!(hues(&trace), [([0, 0, 255], 1), ([255, 0, 0], 1)]);
}

#[test]
fn light_and_dark_ink_on_a_photograph_of_kraft_paper_are_drawn() {
    let mut kraft = Canvas::new([900, 600], [176, 132, 88]);
    kraft.draw(&circle(200.0, 300.0, 110.0), [245; 3], 9.0);
    kraft.draw(&circle(460.0, 300.0, 110.0), [25; 3], 9.0);
    kraft.draw(&line(&[[620.0, 200.0], [700.0, 420.0], [800.0, 180.0]]), [245; 3], 9.0);
    let trace = traced(&as_taken(&kraft, 0.85), image::ImageFormat::Jpeg);
    let extents: Vec<_> =
        trace.lines.iter().map(|(line, _)| bounds(line.iter().copied())).collect();
    assert_eq!(trace.lines.len(), 3, "{extents:.0?}, {:?}", trace.warnings);
}
