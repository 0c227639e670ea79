//! Tests of pictures that are typical of users. A table lists what is painted, how a camera
//! distorts it, and the expected strokes and warnings.

use std::collections::BTreeMap;
use std::io::Cursor;

use image::imageops::{FilterType, resize};
use image::{DynamicImage, ImageFormat, RgbImage, RgbaImage};
use tiny_skia::{FillRule, LineCap, Paint, Path, PathBuilder, Pixmap, Stroke, Transform};

use super::selection::name;
use super::sheet::Map;
use super::tests::{drawn_in, lit, on_canvas};
use super::*;
use crate::Font;
use crate::smooth::evenly;
use noctograph_core::geometry::distance;

type Line = Vec<[f64; 2]>;

const SIZE: [u32; 2] = [600, 400];

/// A picture that is painted shape by shape, and the lines that must be drawn.
struct Canvas {
    pixels: Pixmap,
    lines: Vec<Line>,
    widest_px: f64,
}

impl Canvas {
    fn new([width, height]: [u32; 2], paper: &str) -> Self {
        let mut pixels = Pixmap::new(width, height).unwrap();
        if !paper.is_empty() {
            pixels.fill(tiny_skia::Color::from_rgba8(
                rgb(paper)[0],
                rgb(paper)[1],
                rgb(paper)[2],
                255,
            ));
        }
        Self { pixels, lines: Vec::new(), widest_px: 0.0 }
    }

    /// Paints `pen WIDTH COLOR X,Y ...` along a line, `fill COLOR X,Y ...`, `ring WIDTH COLOR
    /// X,Y,R` and `disc COLOR X,Y,R`, separated by semicolons. A shape after an exclamation mark is
    /// painted but must not be drawn.
    fn paint(&mut self, shapes: &str) -> &mut Self {
        for shape in shapes.split(';').map(str::trim).filter(|shape| !shape.is_empty()) {
            let words: Vec<&str> = shape.trim_start_matches('!').split_whitespace().collect();
            let (is_pen, is_round) =
                (matches!(words[0], "pen" | "ring"), matches!(words[0], "ring" | "disc"));
            let (width, rest) =
                if is_pen { (words[1].parse().unwrap(), &words[2..]) } else { (0.0, &words[1..]) };
            let numbers = |text: &&str| Vec::from_iter(text.split(',').map(|n| n.parse().unwrap()));
            let points: Vec<Vec<f64>> = rest[1..].iter().map(numbers).collect();
            let mut line: Line = if is_round {
                circle([points[0][0], points[0][1]], |_| points[0][2])
            } else {
                points.iter().map(|point| [point[0], point[1]]).collect()
            };
            if words[0] == "fill" {
                line.push(line[0]);
            }
            self.add(&line, width, rgb(rest[0]), !shape.starts_with('!'));
        }
        self
    }

    /// Paints a line with a pen, or fills it if the width of the pen is 0.
    #[expect(clippy::cast_possible_truncation, reason = "pixels")]
    fn add(&mut self, line: &Line, width_px: f64, color: [u8; 3], is_drawn: bool) {
        let mut brush = Paint { anti_alias: true, ..Paint::default() };
        brush.set_color_rgba8(color[0], color[1], color[2], 255);
        let pen = Stroke { width: width_px as f32, line_cap: LineCap::Round, ..Stroke::default() };
        let (path, still) = (path(line), Transform::identity());
        if width_px > 0.0 {
            self.pixels.stroke_path(&path, &brush, &pen, still, None);
        } else {
            self.pixels.fill_path(&path, &brush, FillRule::EvenOdd, still, None);
        }
        if is_drawn {
            self.lines.push(line.clone());
            self.widest_px = self.widest_px.max(width_px);
        }
    }

    fn rgba(&self) -> RgbaImage {
        let pixels = self.pixels.pixels().iter().map(|pixel| pixel.demultiply());
        let bytes = pixels.flat_map(|p| [p.red(), p.green(), p.blue(), p.alpha()]).collect();
        RgbaImage::from_raw(self.pixels.width(), self.pixels.height(), bytes).unwrap()
    }

    fn picture(&self) -> RgbImage {
        DynamicImage::from(self.rgba()).into_rgb8()
    }
}

#[expect(clippy::cast_possible_truncation, reason = "pixels")]
fn path(line: &Line) -> Path {
    let mut path = PathBuilder::new();
    for (index, [x, y]) in line.iter().map(|point| point.map(|x| x as f32)).enumerate() {
        if index == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
    }
    path.finish().unwrap()
}

fn circle([x, y]: [f64; 2], radius: impl Fn(f64) -> f64) -> Line {
    let angles = (0..=120).map(|k| f64::from(k % 120) * std::f64::consts::TAU / 120.0);
    let points = angles.map(|angle| {
        let (sin, cos) = libm::sincos(angle);
        [x + radius(angle) * sin, y - radius(angle) * cos]
    });
    points.collect()
}

fn rgb(color: &str) -> [u8; 3] {
    let color: svgtypes::Color = color.parse().unwrap();
    [color.red, color.green, color.blue]
}

/// Returns the lines of a picture in its pixels (y down), and its warnings.
fn traced(
    picture: impl Into<DynamicImage>,
    format: ImageFormat,
    options: &LetterOptions,
) -> Result<Warned<Traced>> {
    let (picture, mut file) = (picture.into(), Cursor::new(Vec::new()));
    picture.write_to(&mut file, format).unwrap();
    let size = |_: [f64; 4]| Ok(1.0 / f64::from(picture.height()));
    let mut traced = bitmap::read(&file.into_inner(), options, size, "a")?;
    for point in traced.product.lines.iter_mut().flat_map(|(line, _)| line) {
        // A pixel's center is at 0.5, and the lines have a margin of one pixel.
        *point = [point[0] - 0.5, -point[1] - 0.5];
    }
    Ok(traced)
}

/// Returns the fraction of the points along some lines that are within a distance of other lines.
fn near(lines: &[Line], others: &[Line], within: f64) -> f64 {
    let [points, mut others] =
        [lines, others].map(|lines| Vec::from_iter(lines.iter().flat_map(|l| evenly(l, 1.0))));
    // Sorted by x, so that few of the thousands of points have to be compared.
    others.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let is_near = |point: &&[f64; 2]| {
        let first = others.partition_point(|other| other[0] < point[0] - within);
        let mut beside = others[first..].iter().take_while(|other| other[0] <= point[0] + within);
        beside.any(|other| distance(**point, *other) <= within)
    };
    points.iter().filter(is_near).count() as f64 / points.len().max(1) as f64
}

fn hues(lines: &[ColoredLine]) -> String {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    lines.iter().for_each(|(_, color)| *counts.entry(name(*color)).or_default() += 1);
    counts.iter().map(|(name, n)| format!("{name} {n}")).collect::<Vec<_>>().join(" ")
}

/// Effect of a camera, a lamp or a scanner on a picture: maps a pixel's position and level to its
/// new level.
type Taken = fn(f64, f64, f64) -> f64;

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a byte")]
fn change(picture: &mut RgbImage, level: Taken) {
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        let level = |value: u8| level(f64::from(x), f64::from(y), f64::from(value));
        pixel.0 = pixel.0.map(|value| level(value).clamp(0.0, 255.0) as u8);
    }
}

fn noise(x: f64, y: f64) -> f64 {
    let hash = libm::sin(12.9898 * x + 78.233 * y) * 43_758.545_3;
    hash - hash.floor() - 0.5
}

fn step(distance: f64, soft_px: f64) -> f64 {
    1.0 / (1.0 + libm::exp(distance / soft_px))
}

const CLEAN: Taken = |_, _, value| value;
const NOISE: Taken = |x, y, value| 0.94 * value + 7.0 + 14.0 * noise(x, y);
const SHADOW: Taken = |x, y, value| {
    0.9 * value * (1.0 - 0.0004 * x) * (0.65 + 0.35 * step(x - 0.6 * y - 220.0, 15.0))
};
const DARK_SHADOW: Taken = |x, y, value| value * (0.25 + 0.75 * step(x - 0.6 * y - 220.0, 15.0));
const HARD_SHADOW: Taken =
    |x, y, value| value * (0.5 + 0.5 * step(x + 0.4 * y - 380.0, 0.5)) + 14.0 * noise(x, y);
const UNEVEN: Taken = |x, y, value| value * (1.0 - 0.4 * x / 600.0) + 8.0 * noise(x, y);
const FADED: Taken = |x, y, value| 150.0 + 0.4 * value + 14.0 * noise(x, y);
const CHALK: Taken = |x, y, value| 45.0 + 0.7 * (255.0 - value) + 14.0 * noise(x, y);
const STRIPED_DESK: Taken = |_, y, value| {
    let is_stripe = value < 90.0 && y.rem_euclid(18.0) < 6.0;
    value + if is_stripe { 37.0 } else { 0.0 }
};
const GLARE: Taken = |x, y, value| {
    let square = (x - 410.0) * (x - 410.0) + (y - 90.0) * (y - 90.0);
    0.8 * value + 55.0 * libm::exp(-square / 1800.0)
};

const CROSS: &str = "pen 4 #141419 120,80 480,320; pen 4 #141419 120,320 480,80";
const HOUSE: &str = "pen 5 #141419 120,360 120,200 300,60 480,200 480,360 120,360;\
    pen 5 #141419 240,360 240,260 360,260 360,360";
const NOOR: &str = "pen 4 #141419 60,280 60,120 150,280 150,120;\
    pen 4 #141419 210,160 240,120 288,160 288,240 240,280 210,240 210,160;\
    pen 4 #141419 348,160 378,120 420,160 420,240 378,280 348,240 348,160;\
    pen 4 #141419 480,280 480,120 552,152 480,200 552,280";
const PALE: &str = "ring 8 #ffd8e0 60,70,40; ring 8 #fff3b0 180,70,40; ring 8 #d0f0ff 300,70,40;\
    ring 8 #ffd0a0 420,70,40; disc #ffd8e0 60,180,40; disc #fff3b0 180,180,40;\
    disc #d0f0ff 300,180,40; disc #ffd0a0 420,180,40; pen 8 #000 60,350 540,350;\
    pen 8 #fadc3c 300,325 300,260";
const TOUCHING: &str = "pen 8 #000 60,350 540,350; pen 8 #fadc3c 300,350 300,200";
const RINGS: &str = "ring 9 #fff 100,200,60; ring 9 #000 300,200,60; ring 9 #fadc28 500,200,60";
const ICONS: &str = "fill #c8141e 60,60 180,60 180,180 60,180; fill #003ca0 300,50 370,180 230,180;\
    disc #148c3c 480,120,70; fill #000 60,270 170,270 170,230 260,300 170,370 170,330 60,330;\
    fill #000 400,220 415,265 463,266 425,295 439,340 400,314 361,340 375,295 337,266 385,265;\
    pen 8 #000 480,300 510,350 580,230";

/// A row of the table: paper, shapes, camera, file type, number of lines of each color, and codes
/// of the warnings.
type Row = (&'static str, &'static str, Taken, ImageFormat, &'static str, &'static str);

const ROWS: [Row; 32] = [
    ("#fff", CROSS, CLEAN, ImageFormat::Png, "black 3", ""),
    ("#fff", NOOR, CLEAN, ImageFormat::Jpeg, "black 5", ""),
    ("#fff", HOUSE, NOISE, ImageFormat::Jpeg, "black 2", ""),
    ("#fff", CROSS, SHADOW, ImageFormat::Png, "black 3", "photo"),
    ("#fff", HOUSE, SHADOW, ImageFormat::Jpeg, "black 2", "photo"),
    ("#fff", NOOR, SHADOW, ImageFormat::Jpeg, "black 6", "photo"),
    ("#fff", HOUSE, DARK_SHADOW, ImageFormat::Jpeg, "black 2", "photo"),
    ("#fff", HOUSE, HARD_SHADOW, ImageFormat::Jpeg, "black 2", "photo edge"),
    ("#fff", NOOR, UNEVEN, ImageFormat::Jpeg, "black 5", "photo"),
    ("#fff", CROSS, FADED, ImageFormat::Png, "black 3", ""),
    ("#fff", HOUSE, CHALK, ImageFormat::Jpeg, "black 2", ""),
    ("#fff", HOUSE, GLARE, ImageFormat::Png, "black 2", "photo"),
    ("#fff", PALE, CLEAN, ImageFormat::Png, "black 1 blue 2 orange 2 red 2 yellow 3", ""),
    ("#fff", TOUCHING, CLEAN, ImageFormat::Png, "black 1 yellow 1", ""),
    ("#fff", PALE, CLEAN, ImageFormat::Jpeg, "black 1 blue 2 orange 2 red 2 yellow 3", ""),
    ("#b08050", RINGS, CLEAN, ImageFormat::Png, "black 2 yellow 1", ""),
    ("", RINGS, CLEAN, ImageFormat::Png, "black 2 yellow 1", ""),
    ("#fff", ICONS, CLEAN, ImageFormat::Png, "black 3 blue 1 green 1 red 1", ""),
    ("#fff", ICONS, CLEAN, ImageFormat::Jpeg, "black 3 blue 1 green 1 red 1", ""),
    ("#fff", ICONS, UNEVEN, ImageFormat::Jpeg, "black 3 blue 1 green 1 red 1", "photo"),
    ("", ICONS, CLEAN, ImageFormat::Png, "black 3 blue 1 green 1 red 1", ""),
    // A shape on top of another one gives a warning, because only the outer outline is drawn.
    (
        "#fff",
        "disc #143cc8 300,200,150; !disc #fad21e 300,200,60",
        CLEAN,
        ImageFormat::Png,
        "blue 1",
        "colors-touch",
    ),
    // Rulings are fainter than pen lines, which may lie on them. Just a few lines do not count as
    // rulings, and neither do pen lines.
    (
        "#fff",
        "!pen 2 #d0e0f8 0,60 600,62; !pen 2 #d0e0f8 0,120 600,122; !pen 2 #d0e0f8 0,180 600,182;\
        pen 6 #222 150,100 150,330 450,330; ring 6 #f0cd28 450,120,60",
        UNEVEN,
        ImageFormat::Jpeg,
        "black 1 yellow 1",
        "photo faint",
    ),
    (
        "#fff",
        "!pen 3 #96bee6 0,50 600,50; !pen 3 #96bee6 0,100 600,100; !pen 3 #96bee6 0,150 600,150;\
        !pen 3 #96bee6 0,200 600,200; pen 8 #141414 200,150 400,150 400,350; !pen 2 #f0aaaa 70,0 70,400",
        CLEAN,
        ImageFormat::Png,
        "black 1",
        "not-ruled",
    ),
    (
        "#fff",
        "pen 3 #141414 0,50 600,50; pen 3 #141414 0,100 600,100; pen 3 #141414 0,150 600,150;\
        pen 3 #141414 0,200 600,200; pen 8 #141414 200,250 400,250 400,350",
        CLEAN,
        ImageFormat::Png,
        "black 5",
        "rulings",
    ),
    (
        "#fff",
        "pen 3 #96bee6 0,50 600,50; pen 3 #96bee6 0,350 600,350; ring 8 #141414 300,200,80",
        CLEAN,
        ImageFormat::Png,
        "black 1 blue 2",
        "",
    ),
    // The surroundings of the paper, and the tray of a whiteboard.
    (
        "#fff",
        "!fill #000 0,40 70,40 70,360 0,360; ring 8 #000 320,200,110",
        CLEAN,
        ImageFormat::Png,
        "black 1",
        "edge",
    ),
    (
        "#c4c4c4",
        "!fill #8c8c8c 0,380 600,380 600,400 0,400; ring 7 #1e3caa 220,190,90;\
        pen 7 #b41e28 380,100 520,300",
        UNEVEN,
        ImageFormat::Jpeg,
        "blue 1 red 1",
        "photo",
    ),
    // A sheet of paper on a desk.
    (
        "#50372a",
        "!fill #faf8f2 90,40 520,70 570,370 40,340; pen 6 #222 180,130 350,170;\
        pen 6 #d12 190,280 390,230",
        UNEVEN,
        ImageFormat::Jpeg,
        "black 1 red 1",
        "photo edge",
    ),
    (
        "#50372a",
        "!fill #faf8f2 110,60 480,73 517,347 67,333; pen 5 #222 180,133 345,173;\
        pen 5 #d12 187,267 390,233",
        STRIPED_DESK,
        ImageFormat::Jpeg,
        "black 1 red 1",
        "photo edge",
    ),
    // The middle of a wide shape counts as ink. A letter in a row is a line, even if it is bold.
    ("#fff", "disc #f0503c 300,200,150", UNEVEN, ImageFormat::Jpeg, "red 1", "photo"),
    (
        "#fff",
        "pen 22 #000 60,280 60,120 150,280 150,120; pen 22 #000 230,120 230,280 310,280;\
        pen 22 #000 390,120 390,280; pen 22 #000 470,120 470,280 550,280",
        CLEAN,
        ImageFormat::Png,
        "black 4",
        "",
    ),
];

#[test]
fn the_lines_of_a_picture_are_those_that_were_painted_whatever_the_light_and_the_paper() {
    let mut wrong = Vec::new();
    for (index, (paper, shapes, taken, format, colors, codes)) in ROWS.into_iter().enumerate() {
        let mut canvas = Canvas::new(SIZE, paper);
        canvas.paint(shapes);
        let picture: DynamicImage = if paper.is_empty() {
            canvas.rgba().into()
        } else {
            let mut picture = canvas.picture();
            change(&mut picture, taken);
            picture.into()
        };
        let Warned { product: trace, warnings } =
            match traced(picture, format, &LetterOptions::default()) {
                Ok(trace) => trace,
                Err(error) => {
                    wrong.push(format!("{index}: {error}"));
                    continue;
                }
            };
        let lines: Vec<Line> = trace.lines.iter().map(|(line, _)| line.clone()).collect();
        let within = f64::max(3.0, canvas.widest_px);
        let [drawn, meant] =
            [near(&canvas.lines, &lines, within), near(&lines, &canvas.lines, within)];
        let told = warnings.iter().map(|it| it.code.trim_start_matches("picture-"));
        let told = told.collect::<Vec<_>>().join(" ");
        let hues = hues(&trace.lines);
        if drawn < 0.97 || meant < 0.97 || hues != colors || told != codes {
            wrong.push(format!("{index}: {drawn:.3} drawn, {meant:.3} meant, {hues}, {told}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Returns an endless sequence of numbers from 0 to 1.
fn numbers(seed: u32) -> impl FnMut() -> f64 {
    let mut state = 2 * seed + 1;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 16) / 65536.0
    }
}

/// Returns the strokes of a letter as a trembling hand writes it, slanted and slightly displaced.
fn written(font: &Font, letter: char, hand: [f64; 3], next: &mut impl FnMut() -> f64) -> Vec<Line> {
    let [slant, tremble, shift] = hand;
    let cell = Cell { left_m: 0.0, baseline_m: 0.0, width_m: 1.0, cap_height_m: 1.0 };
    let moves = font.glyph(letter, cell).unwrap().moves;
    let runs = moves.chunk_by(|a, b| b.lit && a.lit && a.to_m == b.from_m);
    Vec::from_iter(runs.filter(|run| run[0].lit).map(|run| {
        let line: Line = std::iter::once(run[0].from_m).chain(run.iter().map(|m| m.to_m)).collect();
        let [dx, dy] = [0, 1].map(|_| shift * (2.0 * next() - 1.0));
        let (pace, phase) = (3.0 + 4.0 * next(), 6.3 * next());
        Vec::from_iter(evenly(&line, 0.02).into_iter().map(|[x, y]| {
            let shake = tremble * libm::sin(pace * (x + y) + phase);
            [x + dx + slant * y + shake, -y + dy + shake]
        }))
    }))
}

#[test]
fn handwritten_letters_of_any_size_are_drawn_as_they_were_written() {
    const LETTERS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789";
    let font = Font::open("simplex", crate::Trace::CenterLine).unwrap();
    let mut next = numbers(51);
    let mut wrong = Vec::new();
    // The pen's width in cap heights, and the parameters of the hand.
    for (pen, hand) in
        [(0.07, [0.0, 0.012, 0.0]), (0.11, [0.25, 0.015, 0.01]), (0.09, [-0.1, 0.03, 0.025])]
    {
        for (cap_px, columns) in [(24.0, 16), (40.0, 13), (70.0, 11)] {
            let pen_px = f64::max(pen * cap_px, 2.0);
            let cell_px = [1.4 * cap_px, 1.9 * cap_px];
            let rows = LETTERS.len().div_ceil(columns);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "px")]
            let size = [columns as f64 * cell_px[0], rows as f64 * cell_px[1]].map(|n| n as u32);
            let mut canvas = Canvas::new(size, "#fff");
            for (index, letter) in LETTERS.chars().enumerate() {
                let place = [index % columns, index / columns].map(|n| n as f64);
                for mut line in written(&font, letter, hand, &mut next) {
                    for [x, y] in &mut line {
                        *x = (place[0] + 0.2) * cell_px[0] + cap_px * *x;
                        *y = (place[1] + 0.7) * cell_px[1] + cap_px * *y;
                    }
                    canvas.add(&line, pen_px, [20, 20, 40], true);
                }
            }
            let trace = traced(canvas.picture(), ImageFormat::Png, &LetterOptions::default());
            let lines = trace.unwrap().product.lines.into_iter().map(|(line, _)| line);
            let lines: Vec<Line> = lines.collect();
            let [drawn, meant] =
                [near(&canvas.lines, &lines, pen_px), near(&lines, &canvas.lines, pen_px)];
            if drawn < 0.97 || meant < 0.98 {
                wrong.push(format!("{pen}, {cap_px} px: {drawn:.3} drawn, {meant:.3} meant"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_sheet_is_cut_out_without_a_sliver_of_the_desk() {
    let mut photo = Canvas::new([800, 600], "#50372a");
    photo.paint("!fill #faf8f2 150,90 640,110 690,520 90,500; pen 7 #222 240,200 460,260");
    let mut picture = photo.picture();
    change(&mut picture, STRIPED_DESK);
    let corners_px = Some([150.0, 90.0, 640.0, 110.0, 560.0, 300.0, 200.0, 300.0]);
    let options = LetterOptions { corners_px, ..LetterOptions::default() };
    let trace = traced(picture, ImageFormat::Jpeg, &options).unwrap().product;
    assert_eq!(trace.lines.len(), 1);
}

#[test]
fn corners_by_hand_cut_a_sheet_out_and_square_it() {
    // A house on a sheet of paper that lies askew on a dark desk.
    let corners = [[90.0, 40.0], [520.0, 70.0], [570.0, 370.0], [40.0, 340.0]];
    let in_photo = Map::of_sheet(&corners, (600, 400));
    let mut sheet = Canvas::new(SIZE, "#fff");
    let mut photo = Canvas::new(SIZE, "#503728");
    photo.add(&corners.to_vec(), 0.0, [250, 249, 244], false);
    for line in sheet.paint(HOUSE).lines.clone() {
        let line = evenly(&line, 2.0).into_iter().map(|point| in_photo.apply(point)).collect();
        photo.add(&line, 5.0, [20; 3], true);
    }
    let given = |corners: [[f64; 2]; 4]| {
        let corners_px = corners.as_flattened().try_into().ok();
        let options = LetterOptions { corners_px, ..LetterOptions::default() };
        traced(photo.picture(), ImageFormat::Png, &options)
    };
    let Warned { product: trace, warnings } = given(corners).unwrap();
    assert!(warnings.iter().all(|it| it.code != "picture-photo"), "{warnings:?}");
    let lines: Vec<Line> = trace.lines.iter().map(|(line, _)| line.clone()).collect();
    let [left, top, right, bottom] = bounds(lines.iter().flatten().copied());
    let vertical = |[x, _]: &&[f64; 2]| (x - left).abs() < 4.0;
    let wall = lines.iter().flatten().filter(vertical).map(|[_, y]| *y);
    let wall_px = wall.clone().fold(0.0, f64::max) - wall.fold(f64::MAX, f64::min);
    assert!(
        (wall_px / (bottom - top) - 160.0 / 300.0).abs() < 0.02,
        "{wall_px}: a wall is upright"
    );
    assert!(right - left > 300.0 && trace.corners_px == Some(corners));
    // Mapped back to the photograph, the lines lie on those of the house.
    let back =
        lines.iter().map(|line| Vec::from_iter(line.iter().map(|p| trace.in_file.apply(*p))));
    assert!(near(&back.collect::<Vec<_>>(), &photo.lines, 4.0) > 0.98);
    let [a, b, c, d] = corners;
    for turned in [[b, a, c, d], [a, d, c, b], [a, c, b, d]] {
        let told = given(turned).err().unwrap().to_string();
        assert!(told.contains("corners") && told.contains("upper left"), "{told}");
    }
}

fn drawn(picture: impl Into<DynamicImage>, options: &LetterOptions) -> Result<Strokes> {
    let mut file = Cursor::new(Vec::new());
    picture.into().write_to(&mut file, ImageFormat::Png).unwrap();
    drawn_in("a.png", file.into_inner(), options, Ink::Alike)
}

#[test]
fn a_picture_without_lines_is_refused_and_a_photograph_unless_its_sheet_is_named() {
    let options = on_canvas(6.0, 4.0);
    // A face in soft light in front of a dark wall, with the grain of a camera.
    let mut face = RgbImage::from_fn(600, 400, |x, y| {
        let [x, y] = [f64::from(x), f64::from(y)];
        let far = libm::hypot((x - 300.0) / 137.0, (y - 200.0) / 187.0);
        let face = step(12.0 * (far - 1.0), 1.0);
        let light = 1.0 - 0.5 * far * face + 0.0006 * (x - 300.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a byte")]
        image::Rgb(
            [(40.0, 230.0), (50.0, 180.0), (70.0, 150.0)]
                .map(|(wall, skin)| (wall + (skin * light - wall) * face) as u8),
        )
    });
    change(&mut face, NOISE);
    let told = drawn(face.clone(), &options).expect_err("a face has no lines");
    assert!(told.to_string().contains("a photograph"), "{told}");
    assert!(told.hint().contains("scanner") && told.hint().contains("letters.corners_px"));
    let corners_px = Some([0.0, 0.0, 600.0, 0.0, 600.0, 400.0, 0.0, 400.0]);
    drawn(face, &LetterOptions { corners_px, ..options.clone() }).unwrap();
    for levels in [[0, 0], [3, 3], [128, 128], [255, 255], [200, 190]] {
        let blank =
            RgbImage::from_fn(300, 200, |x, _| image::Rgb([levels[usize::from(x < 99)]; 3]));
        let told = drawn(blank, &options).expect_err("no lines").to_string();
        assert!(told.contains("a.png: found a picture"), "{levels:?}: {told}");
    }
    for size in [[3, 3], [3, 4000], [4000, 3], [5, 9], [40, 3]] {
        let strip = RgbImage::from_fn(size[0], size[1], |x, y| {
            image::Rgb([(40 * x + 7 * y).to_le_bytes()[0]; 3])
        });
        assert!(drawn(strip, &options).map_or(true, |strokes| strokes.n_strokes() > 0));
    }
}

#[test]
fn dust_and_a_checkerboard_are_left_out_and_fine_pictures_named() {
    let options = LetterOptions::default();
    let mut canvas = Canvas::new(SIZE, "#fff");
    let clean = canvas.paint(&CROSS.replace("pen 4", "pen 10")).picture();
    let wanted = drawn(clean.clone(), &options).unwrap();
    let mut dusty = clean.clone();
    change(&mut dusty, |x, y, value| if noise(x, y) > 0.498 { 0.0 } else { value });
    fn checkered(mut picture: RgbImage, side: u32, tones: [u16; 2]) -> RgbImage {
        for (x, y, pixel) in picture.enumerate_pixels_mut() {
            let tone = tones[usize::from((x / side + y / side).is_multiple_of(2))];
            pixel.0 = pixel.0.map(|value| u8::try_from(u16::from(value) * tone / 255).unwrap());
        }
        picture
    }
    // A picture above the maximum size for tracing, and the same picture downscaled by a viewer.
    let [width, height] = SIZE.map(|side| 4 * side);
    let large = resize(&clean, width, height, FilterType::Nearest);
    let large = checkered(large, 16, [204, 255]);
    let small = resize(&large, width / 4 * 3, height / 4 * 3, FilterType::Triangle);
    let checkerboard = "picture-checkerboard";
    for (picture, code) in [
        (dusty, "picture-specks"),
        (checkered(clean.clone(), 8, [204, 255]), checkerboard),
        (checkered(clean.clone(), 16, [191, 254]), checkerboard),
        (checkered(clean.clone(), 10, [102, 153]), checkerboard),
        (large, checkerboard),
        (small, checkerboard),
    ] {
        let strokes = drawn(picture, &options).unwrap();
        assert_eq!(strokes.source.strokes.len(), wanted.source.strokes.len(), "{code}");
        assert!(strokes.warnings.iter().any(|it| it.code == code), "{:?}", strokes.warnings);
        let (found_m, wanted_m) = (strokes.bounds_m(), wanted.bounds_m());
        assert!((0..4).all(|k| (found_m[k] - wanted_m[k]).abs() < 0.02), "{code}: {found_m:?}");
    }
    for (n, is_fine) in [(7, false), (8, true)] {
        let mut canvas = Canvas::new([800, 800], "#fff");
        for [x, y] in (0..n * n).map(|k| [40 + 90 * (k % n), 40 + 90 * (k / n)]) {
            canvas.paint(&format!("pen 8 #000 {x},{y} {},{}", x + 40, y + 20));
        }
        let trace = traced(canvas.picture(), ImageFormat::Png, &options).unwrap();
        let told = trace.warnings.iter().any(|it| it.code == "picture-fine");
        assert_eq!((trace.product.lines.len(), told), (n * n, is_fine));
    }
}

#[test]
fn a_glow_and_a_soft_shadow_are_no_ink() {
    for (paper, ink, soft, width, shift, blur) in [
        ("#000", "#ffd282", "#f0781e", 30, 0, 14.0),
        ("#fff", "#141414", "#969696", 12, 9, 8.0),
        ("#fff", "#141414", "#878787", 30, 9, 8.0),
    ] {
        let [mut picture, sharp] =
            [(soft, width, shift), (ink, 7, 0)].map(|(ink, width, shift)| {
                let points =
                    [[150, 100], [300, 300], [450, 100]].map(|point| point.map(|x| x + shift));
                let points = points.map(|[x, y]| format!("{x},{y}")).join(" ");
                Canvas::new(SIZE, paper).paint(&format!("pen {width} {ink} {points}")).picture()
            });
        picture = image::imageops::blur(&picture, blur);
        for (soft, sharp) in picture.pixels_mut().zip(sharp.pixels()) {
            let stronger = if paper == "#fff" { u8::min } else { u8::max };
            soft.0 = std::array::from_fn(|c| stronger(soft.0[c], sharp.0[c]));
        }
        let trace = traced(picture, ImageFormat::Png, &LetterOptions::default()).unwrap();
        assert_eq!(trace.product.lines.len(), 1, "{soft} {width}");
    }
}

#[test]
fn light_ink_on_transparency_is_drawn_as_dark_ink_is() {
    let mut canvas = Canvas::new(SIZE, "");
    canvas.paint("fill #000 60,200 540,200 540,212 60,212");
    for ink in [[255; 3], [255, 240, 0], [0; 3], [200, 30, 30], [180, 255, 180]] {
        let mut picture = canvas.rgba();
        picture.pixels_mut().for_each(|pixel| pixel.0[..3].copy_from_slice(&ink));
        let strokes = drawn(picture, &on_canvas(1.0, 1.0)).unwrap();
        let [(_, _, length_m)] = lit(&strokes)[..] else { panic!("{ink:?}: not one line") };
        assert!((length_m - 1.0).abs() < 0.05, "{ink:?}: {length_m}");
    }
}

#[test]
fn webp_bmp_and_the_first_frame_of_a_gif_are_read_as_png_is_and_a_jpeg_in_full() {
    let folder = tempfile::tempdir().unwrap();
    let strokes =
        |name: &str| draw(&folder.path().join(name), &on_canvas(2.0, 1.0), Ink::ByColor).unwrap();
    let frames = [HOUSE, NOOR].map(|shapes| {
        let mut canvas = Canvas::new(SIZE, "#fff");
        DynamicImage::from(canvas.paint(shapes).picture())
    });
    for name in ["a.png", "a.webp", "a.bmp"] {
        frames[0].save(folder.path().join(name)).unwrap();
        assert_eq!(strokes(name), strokes("a.png"), "{name}");
    }
    let mut gif = std::fs::File::create(folder.path().join("a.gif")).unwrap();
    let mut encoder = image::codecs::gif::GifEncoder::new(&mut gif);
    for frame in &frames {
        encoder.encode_frame(image::Frame::new(frame.to_rgba8())).unwrap();
    }
    drop(encoder);
    let (first, wanted) = (strokes("a.gif"), strokes("a.png"));
    assert_eq!(first.n_strokes(), wanted.n_strokes());
    assert!((first.length_m() / wanted.length_m() - 1.0).abs() < 0.01);
    let mut file = Cursor::new(Vec::new());
    frames[0].write_to(&mut file, ImageFormat::Jpeg).unwrap();
    let whole = file.into_inner();
    let drawn = |bytes: &[u8]| drawn_in("a.jpg", bytes, &on_canvas(2.0, 1.0), Ink::Alike);
    drawn(&whole).unwrap();
    let refused = drawn(&whole[..whole.len() / 2]).unwrap_err().to_string();
    assert!(refused.contains("truncated"), "{refused}");
}
