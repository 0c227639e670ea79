use super::super::Picture;
use super::*;

/// Writes a file and draws it.
fn drawn(name: &str, content: &str, options: &LetterOptions) -> Result<Strokes> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    draw(&path, options, Ink::Alike)
}

fn on_canvas(width_m: f64, height_m: f64) -> LetterOptions {
    LetterOptions { canvas_m: Some([width_m, height_m]), align: Align::Left, ..Default::default() }
}

fn svg(body: &str) -> String {
    format!(
        "<svg xmlns='http://www.w3.org/2000/svg' xmlns:xlink='http://www.w3.org/1999/xlink' viewBox='0 0 200 100'>{body}</svg>"
    )
}

/// Lit strokes: where they begin and end, and how long they are.
fn lit(strokes: &Strokes) -> Vec<([f64; 2], [f64; 2], f64)> {
    let moves = &strokes.glyphs[0].moves;
    let runs = moves.chunk_by(|a, b| a.lit == b.lit).filter(|run| run[0].lit);
    let length = |m: &Move| libm::hypot(m.to_m[0] - m.from_m[0], m.to_m[1] - m.from_m[1]);
    let round = |p: [f64; 2]| p.map(|x| (x * 1e6).round() / 1e6);
    runs.map(|run| {
        (round(run[0].from_m), round(run[run.len() - 1].to_m), run.iter().map(length).sum())
    })
    .collect()
}

#[test]
fn strokes_and_fills_stand_where_transforms_put_them() {
    let body = "<rect width='200' height='100' fill='white'/>
        <g transform='translate(100 0) scale(2)'><path d='M0 0 L50 50' stroke='black'/></g>
        <path id='a' d='M0 100 h10' stroke='red' fill='none'/>
        <use xlink:href='#a' x='20'/>
        <circle cx='50' cy='50' r='20'/>
        <path d='M0 0 h100' stroke='red' visibility='hidden'/>
        <path d='M0 0 h100' stroke='red' stroke-opacity='0' fill='none'/>
        <path d='M0 0 h100' stroke='transparent' fill='none'/>
        <g opacity='0'><path d='M0 0 h100' stroke='red'/></g>
        <path d='M0 50 h5' stroke='none' fill='none'/>";
    let strokes = drawn("a.svg", &svg(body), &on_canvas(2.0, 1.0)).unwrap();
    let lit = lit(&strokes);
    assert_eq!(lit.len(), 4, "paper and what is hidden are not drawn: {lit:?}");
    assert_eq!((lit[0].0, lit[0].1), ([1.0, 1.5], [2.0, 0.5]), "y is turned up");
    assert_eq!((lit[1].0, lit[1].1), ([0.0, 0.5], [0.1, 0.5]));
    assert_eq!((lit[2].0, lit[2].1), ([0.2, 0.5], [0.3, 0.5]), "the use");
    let (begin, end, length) = lit[3];
    assert_eq!(begin, end, "the rim of a fill is closed");
    let around = std::f64::consts::TAU * 0.2;
    assert!((length - around).abs() < 0.01 * around, "{length} for {around}");
    assert_eq!(strokes.bounds_m(), [0.0, 0.5, 2.0, 1.5], "on the baseline, as large as the canvas");
    assert_eq!(
        (strokes.order, strokes.font, strokes.glyphs[0].character),
        (StrokeOrder::Free, None, DRAWING)
    );
}

#[test]
fn curves_are_off_by_less_than_the_tolerance() {
    let body = "<circle cx='50' cy='50' r='50' stroke='red' fill='none'/>";
    for tolerance_m in [0.01, 1e-3, 1e-4] {
        let options = LetterOptions { tolerance_m, ..on_canvas(1.0, 1.0) };
        let strokes = drawn("a.svg", &svg(body), &options).unwrap();
        let mut worst_m = 0.0_f64;
        for step in strokes.glyphs[0].moves.iter().filter(|step| step.lit) {
            let middle = [0, 1].map(|i| 0.5 * (step.from_m[i] + step.to_m[i]));
            worst_m = worst_m.max((0.5 - libm::hypot(middle[0] - 0.5, middle[1] - 1.0)).abs());
        }
        assert!(worst_m <= tolerance_m && worst_m > 0.02 * tolerance_m, "{worst_m}");
    }
}

#[test]
fn a_drawing_is_as_high_as_a_capital_where_no_canvas_is_named() {
    let strokes = drawn("a.svg", &svg("<rect width='10' height='10'/>"), &LetterOptions::default());
    assert_eq!(strokes.unwrap().bounds_m(), [-0.25, 0.5, 0.25, 1.0]);
    let wide =
        drawn("a.svg", &svg("<path d='M0 5 h100' stroke='red'/>"), &LetterOptions::default());
    let [left, bottom, right, top] = wide.unwrap().bounds_m();
    assert_eq!([left, bottom, right], [-1.0, 0.5, 1.0], "four cap heights at most");
    assert!(top - bottom < 0.01, "a level line has no height: {top}");
}

const PAGE: &str = r#"{"app": "tablet", "strokes": [
    [[0, 0, 10.0], [0, 10, 10.5], [10, 10, 11.5]], [[5, 0, 12.0], [5, 10, 13.0]], [[10, 0, 14.0]]]}"#;

#[test]
fn handwriting_keeps_its_order_and_where_wanted_its_pace() {
    let even = LetterOptions { smoothing_m: 0.0, ..on_canvas(1.0, 1.0) };
    let options = LetterOptions { pace: Pace::Written, ..even.clone() };
    let strokes = drawn("a.json", PAGE, &options).unwrap();
    assert_eq!(strokes.order, StrokeOrder::Kept);
    let lit = lit(&strokes);
    assert_eq!((lit[0].0, lit[0].1), ([0.0, 1.5], [1.0, 0.5]), "y grows downward on a screen");
    assert_eq!((lit[1].0, lit[1].1), ([0.5, 1.5], [0.5, 0.5]), "the second stays the second");
    assert_eq!(lit.len(), 3, "a tap is a dot");
    let moves = &strokes.glyphs[0].moves;
    let pace = |from_m: [f64; 2]| moves.iter().find(|m| m.lit && m.from_m == from_m).unwrap().pace;
    // 3 m in 2.5 s and a tap of no length in time: the first leg takes 0.5 s, the others 1 s a
    // meter.
    let mean_m_s =
        moves.iter().filter(|m| m.lit).map(|m| distance(m.from_m, m.to_m)).sum::<f64>() / 2.5;
    assert_eq!(pace([0.0, 1.5]), 1.0, "at most the stroke speed");
    assert!((pace([0.5, 1.5]) - 1.0 / mean_m_s).abs() < 1e-12, "{}", pace([0.5, 1.5]));
    assert!(moves.iter().all(|m| m.lit || m.pace == 1.0), "the dark has none");
    let evenly = drawn("a.json", PAGE, &even).unwrap();
    assert!(evenly.glyphs[0].moves.iter().all(|m| m.pace == 1.0), "unless it is wanted");
    assert_ne!(evenly.sha256(), strokes.sha256(), "another drawing");
}

#[test]
fn smoothing_takes_the_wobble_and_keeps_within_its_limit() {
    let wobble = |amount: f64| -> String {
        let points = (0..400).map(|k| {
            let sign = if k % 2 == 0 { amount } else { -amount };
            format!("[{k}, {}, {}]", 100.0 + sign, f64::from(k) * 0.01)
        });
        format!("{{\"strokes\": [[[0, 0, -1]], [{}]]}}", points.collect::<Vec<_>>().join(","))
    };
    let roughness = |strokes: &Strokes| {
        let moves: Vec<_> = strokes.glyphs[0].moves.iter().filter(|m| m.lit).collect();
        moves
            .iter()
            .rev()
            .take(moves.len() - 4)
            .map(|m| (m.to_m[1] - m.from_m[1]).abs())
            .sum::<f64>()
    };
    let options = on_canvas(4.0, 4.0);
    let rough = LetterOptions { smoothing_m: 0.0, ..options.clone() };
    let (raw, smooth) =
        [&rough, &options].map(|o| drawn("a.json", &wobble(0.2), o).unwrap()).into();
    assert!(roughness(&raw) > 100.0 * roughness(&smooth), "2 mm of wobble on a straight line");
    let far = drawn("a.json", &wobble(30.0), &options).unwrap();
    assert!(roughness(&far) > 10.0, "what is larger than the limit was meant");
}

#[test]
fn broken_handwriting_is_refused_with_its_place() {
    let cases = [
        ("{\"strokes\": [[[0, 0], [1]]]}", "stroke 1, point 2"),
        ("{\"strokes\": [[[0, 0, 1], [1, 1]]]}", "stroke 1, point 2"),
        ("{\"strokes\": [[[0, 0, 1], [1, 1, 0.5]]]}", "stroke 1, point 2"),
        ("{\"strokes\": [[[0, 1e300], [1, 1]]]}", "stroke 1, point 1"),
        ("{\"strokes\": 7}", "a.json:1:13"),
        ("{\"strokes\": [[[0, 0], [1, 1]]], \"colors\": [[0, 0, 0], [9, 9, 9]]}", "one per stroke"),
        ("{\"strokes\": []}", "nothing drawn"),
        ("{\"strokes\": [[[5, 5]]]}", "without extent"),
        ("", "a.json:1:0"),
    ];
    for (text, place) in cases {
        let error = drawn("a.json", text, &LetterOptions::default()).unwrap_err().to_string();
        assert!(error.contains(place), "{text}: {error}");
    }
}

#[test]
fn what_is_no_drawing_is_refused() {
    let cases = [
        ("a.svg", "<svg", "a.svg"),
        ("a.svg", "<svg xmlns='http://www.w3.org/2000/svg'/>", "nothing drawn"),
        ("a.svg", "not xml", "a.svg"),
        ("a.dwg", "x", "another kind"),
        ("svg", "x", "another kind"),
    ];
    for (name, text, found) in cases {
        let error = drawn(name, text, &LetterOptions::default()).unwrap_err();
        assert!(error.to_string().contains(found), "{text}: {error}");
        assert!(!error.hint().is_empty());
    }
    let long = format!("<path d='M0 0 {}' stroke='red'/>", "l1 0 l0 1 ".repeat(MAX_POINTS / 2 + 1));
    let error = drawn("a.svg", &svg(&long), &LetterOptions::default()).unwrap_err().to_string();
    assert!(error.contains("more points"), "{error}");
}

#[test]
fn dashes_are_dark_between_and_as_long_as_their_transform_makes_them() {
    let body = "<g transform='scale(2)'><path d='M0 25 h100' stroke='red' \
                stroke-dasharray='20 5' stroke-dashoffset='10'/></g>";
    let strokes = drawn("a.svg", &svg(body), &on_canvas(2.0, 1.0)).unwrap();
    let mut ends: Vec<[f64; 2]> = lit(&strokes).iter().map(|run| [run.0[0], run.1[0]]).collect();
    ends.sort_by(|a, b| a[0].total_cmp(&b[0]));
    assert_eq!(ends, [[0.0, 0.2], [0.3, 0.7], [0.8, 1.2], [1.3, 1.7], [1.8, 2.0]]);
    let endless = "<path d='M0 0 h1e6' stroke='red' stroke-dasharray='1e-6'/>";
    let error = drawn("a.svg", &svg(endless), &LetterOptions::default()).unwrap_err();
    assert!(error.to_string().contains("a.svg"), "{error}");
}

#[test]
fn each_color_of_a_drawing_is_a_glyph_where_colors_matter() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.svg");
    let body = "<path d='M0 0 h50' stroke='red'/><path d='M0 20 h50' stroke='#0000ff'/>
        <path d='M0 40 h50' style='stroke:#f00'/><circle cx='100' cy='50' r='20'/>";
    std::fs::write(&path, svg(body)).unwrap();
    let [alike, by_color] =
        [Ink::Alike, Ink::ByColor].map(|ink| draw(&path, &on_canvas(2.0, 1.0), ink).unwrap());
    assert_eq!((alike.glyphs.len(), &alike.colors), (1, &Vec::new()));
    assert_eq!(by_color.colors, [[255, 0, 0], [0, 0, 255], [0, 0, 0]]);
    let begins = |glyph: &Glyph| -> Vec<[f64; 2]> {
        let moves = &glyph.moves;
        let runs = moves.chunk_by(|a, b| a.lit == b.lit).filter(|run| run[0].lit);
        runs.map(|run| run[0].from_m.map(|x| (x * 1e3).round() / 1e3)).collect()
    };
    assert_eq!(begins(&by_color.glyphs[0]), [[0.0, 1.5], [0.0, 0.929]], "both red strokes");
    assert_eq!((by_color.glyphs.len(), by_color.bounds_m()), (3, alike.bounds_m()));

    let path = folder.path().join("a.json");
    let colors = "[[255, 0, 0], [255, 0, 0], [0, 0, 255]]";
    std::fs::write(&path, PAGE.replace("\"app\": \"tablet\"", &format!("\"colors\": {colors}")))
        .unwrap();
    let [alike, by_color] =
        [Ink::Alike, Ink::ByColor].map(|ink| draw(&path, &on_canvas(2.0, 1.0), ink).unwrap());
    assert_eq!((alike.glyphs.len(), &alike.colors), (1, &Vec::new()));
    assert_eq!(by_color.colors, [[255, 0, 0], [0, 0, 255]], "in the writer's order");
    let n_strokes = |glyph: &Glyph| begins(glyph).len();
    assert_eq!(by_color.glyphs.iter().map(n_strokes).collect::<Vec<_>>(), [2, 1]);

    let path = folder.path().join("a.svg");
    let line = |n: u32| format!("<path d='M0 {n} h9' stroke='#{n:06x}'/>");
    std::fs::write(&path, svg(&(0..65).map(line).collect::<String>())).unwrap();
    let refused = draw(&path, &LetterOptions::default(), Ink::ByColor).unwrap_err();
    assert!(refused.to_string().contains("at most 64 colors"), "{refused}");
}

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

/// The drawing in black on white.
fn sheet(lines: &[&[[f32; 2]]], pen_px: f32) -> image::RgbImage {
    let [width, height] = SIZE;
    let mut pixmap = tiny_skia::Pixmap::new(width, height).unwrap();
    pixmap.fill(tiny_skia::Color::WHITE);
    let stroke = tiny_skia::Stroke {
        width: pen_px,
        line_cap: tiny_skia::LineCap::Round,
        line_join: tiny_skia::LineJoin::Round,
        ..tiny_skia::Stroke::default()
    };
    let mut paint = tiny_skia::Paint::default();
    paint.set_color_rgba8(20, 20, 25, 255);
    for line in lines {
        let mut path = tiny_skia::PathBuilder::new();
        for (index, [x, y]) in line.iter().enumerate() {
            let (x, y) = (x * width as f32, y * height as f32);
            if index == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
        }
        let path = path.finish().unwrap();
        pixmap.stroke_path(&path, &paint, &stroke, tiny_skia::Transform::identity(), None);
    }
    let rgb = pixmap.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue()]).collect();
    image::RgbImage::from_raw(width, height, rgb).unwrap()
}

#[expect(clippy::cast_possible_truncation, reason = "levels")]
fn change(picture: &mut image::RgbImage, of: impl Fn(f64, f64, f64) -> f64) {
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        pixel.0 = pixel.0.map(|value| of(f64::from(x), f64::from(y), f64::from(value)) as u8);
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

fn chalk(picture: &mut image::RgbImage) {
    change(picture, |_, _, value| 40.0 + 0.7 * (255.0 - value));
    noise(picture);
}

fn faint(picture: &mut image::RgbImage) {
    change(picture, |_, _, value| 150.0 + 0.4 * value);
    noise(picture);
}

/// Share of places that lie within a distance of others.
fn near(of: &[[f64; 2]], others: &[[f64; 2]], within: f64) -> f64 {
    let is_near = |p: &&[f64; 2]| others.iter().any(|other| distance(**p, *other) <= within);
    of.iter().filter(is_near).count() as f64 / of.len() as f64
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
        Drawn { lines: NOOR, pen_px: 3.0, taken: dark_shadow },
    ];
    for (index, Drawn { lines, pen_px, taken }) in sheets.into_iter().enumerate() {
        let clean = sheet(lines, pen_px);
        let mut picture = clean.clone();
        taken(&mut picture);
        let mut file = Vec::new();
        let format = [image::ImageFormat::Png, image::ImageFormat::Jpeg][index % 2];
        picture.write_to(&mut std::io::Cursor::new(&mut file), format).unwrap();
        let size = |_: [f64; 4]| Ok(1.0 / f64::from(SIZE[1]));
        let found = bitmap::read(&file, &LetterOptions::default(), size, "a").unwrap().lines;
        let mut flown = Vec::new();
        for leg in found.iter().flat_map(|(line, _)| line.windows(2)) {
            let n = distance(leg[0], leg[1]).ceil().max(1.0);
            flown.extend((0..1000).map(f64::from).take_while(|k| *k < n).map(|k| {
                // The lines have a margin of a pixel, and y up.
                let share = k / n;
                let at = [0, 1].map(|i| leg[0][i] + share * (leg[1][i] - leg[0][i]));
                [at[0] - 1.0, -at[1] - 1.0]
            }));
        }
        let dark = clean.enumerate_pixels().filter(|(.., pixel)| pixel.0[0] < 128);
        let dark: Vec<_> = dark.map(|(x, y, _)| [f64::from(x), f64::from(y)]).collect();
        let within = 1.5 * f64::from(pen_px);
        let [drawn, meant] = [near(&dark, &flown, within), near(&flown, &dark, within)];
        assert!(drawn >= 0.97 && meant >= 0.97, "{index}: {drawn:.3} drawn, {meant:.3} meant");
        assert!(found.len() <= 8, "{index}: {} strokes", found.len());
        assert!(
            found.iter().all(|(_, color)| *color == Paint::Plain([0; 3])),
            "{index}: black ink"
        );
    }
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
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    picture.save(&path).unwrap();
    let strokes = draw(&path, &on_canvas(2.0, 1.0), Ink::ByColor).unwrap();
    let length_m = |glyph: &Glyph| {
        let lit = glyph.moves.iter().filter(|step| step.lit);
        lit.map(|step| distance(step.from_m, step.to_m)).sum::<f64>()
    };
    let found: Vec<_> =
        strokes.colors.iter().zip(&strokes.glyphs).map(|(c, g)| (*c, length_m(g))).collect();
    let [(blue, bar_m), (red, rim_m)] = found[..] else { panic!("two colors: {found:?}") };
    assert_eq!((red, blue), ([255, 0, 0], [0, 0, 255]), "hues at full level");
    // The bar is the tallest: its 140 pixels are the canvas, less a pen at its ends.
    assert!((rim_m / bar_m - 400.0 / 134.0).abs() < 0.1, "{rim_m} m around, {bar_m} m along");

    let blank =
        image::RgbImage::from_fn(300, 200, |x, _| image::Rgb([if x < 99 { 200 } else { 190 }; 3]));
    blank.save(&path).unwrap();
    let refused = draw(&path, &LetterOptions::default(), Ink::Alike).unwrap_err().to_string();
    assert!(refused.contains("stand out"), "{refused}");
}

/// Smooth tones behind a bright disc, a dark tower and a star, with the grain of a camera.
fn photograph() -> image::RgbImage {
    let mut picture = image::RgbImage::new(480, 320);
    change(&mut picture, |x, y, _| {
        let hills = 60.0 + 40.0 * libm::sin(0.03 * x) * libm::cos(0.05 * y) + 0.2 * x;
        let disc = libm::hypot(x - 150.0, y - 150.0) < 80.0;
        let tower = (330.0..390.0).contains(&x) && y > 60.0;
        let star = libm::hypot(x - 250.0, y - 40.0) < 5.0;
        let light = [(disc, 90.0), (tower, -60.0), (star, 120.0)];
        let light = light.into_iter().filter(|(is, _)| *is).map(|(_, light)| light).sum::<f64>();
        (hills + light).clamp(0.0, 255.0)
    });
    noise(&mut picture);
    picture
}

#[test]
fn a_photograph_is_drawn_by_its_long_edges() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    photograph().save(&path).unwrap();
    let options = |detail, picture| LetterOptions { detail, picture, ..on_canvas(4.8, 3.2) };
    let drawn = |options: &LetterOptions| draw(&path, options, Ink::Alike).unwrap();
    let auto = drawn(&options(None, Picture::Auto));
    assert_eq!(auto, drawn(&options(Some(0.5), Picture::Photograph)), "recognized");
    // The disc, and three sides of the tower, which is 260 pixels high.
    let [_, bottom, _, top] = auto.bounds_m();
    let edges_m = (top - bottom) / 260.0 * (std::f64::consts::TAU * 80.0 + 60.0 + 2.0 * 260.0);
    let length = auto.length_m() / edges_m;
    assert!((0.93..1.07).contains(&length) && auto.n_strokes() == 2, "{length}");
    assert!(auto.left_out.strokes == 1 && auto.left_out.share < 0.05, "{:?}", auto.left_out);
    let all = drawn(&options(Some(1.0), Picture::Photograph));
    assert_eq!((all.n_strokes(), all.left_out.strokes), (3, 0), "the star");
    assert_eq!(auto.picture, Picture::Photograph);
    let ink = drawn(&options(None, Picture::Drawing));
    assert_eq!(ink.picture, Picture::Drawing);
    assert_ne!(ink, auto, "the kind can be given");
}

/// The lit moves of each color with where they begin, in the drawing's units from its left edge.
fn shades(body: &str) -> (Strokes, Vec<(f64, [u8; 3])>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.svg");
    std::fs::write(&path, svg(body)).unwrap();
    let strokes = draw(&path, &on_canvas(2.0, 2.0), Ink::ByColor).unwrap();
    let lit = strokes.glyphs.iter().zip(&strokes.colors).flat_map(|(glyph, color)| {
        let lit = glyph.moves.iter().filter(|step| step.lit);
        lit.map(|step| (50.0 * step.from_m[0], *color))
    });
    let lit = lit.collect();
    (strokes, lit)
}

/// The blue of the move at a place.
fn blue_at(shades: &[(f64, [u8; 3])], x: f64) -> u8 {
    let before = shades.iter().filter(|(from, _)| *from <= x);
    before.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap().1[2]
}

#[test]
fn the_color_of_a_stroke_changes_along_its_gradient() {
    let stops = "<linearGradient id='s'><stop stop-color='red'/><stop offset='1' \
                 style='stop-color:#0000ff;stop-opacity:0'/></linearGradient>";
    let at = |x1: i32, x2: i32| {
        let ends = format!("gradientUnits='userSpaceOnUse' x1='{x1}' x2='{x2}'");
        format!("{stops}<linearGradient id='a' xlink:href='#s' {ends}")
    };
    let line = "<path d='M0 5 h100 v1' stroke='url(#a)'/>";
    let (strokes, shades) = shades(&format!("{}/>{line}", at(0, 100)));
    assert_eq!((strokes.n_strokes(), strokes.colors.len()), (1, 16), "{:?}", strokes.colors);
    assert_eq!(strokes.joints_m.len(), 15);
    for (x, [red, green, blue]) in shades.into_iter().filter(|(x, _)| *x < 95.0) {
        // A level is 6.3 long; its color is that of its middle.
        let wanted = 255.0 * (x + 3.2) / 100.0;
        let off = (f64::from(blue) - wanted).abs();
        assert!(off < 9.0 && green == 0 && u16::from(red) + u16::from(blue) >= 254, "{x}: {blue}");
    }
    let (_, shades) = self::shades(&format!("{} spreadMethod='reflect'/>{line}", at(0, 50)));
    let ends = [1.0, 98.0].map(|x| blue_at(&shades, x));
    assert!(shades.len() > 30 && ends.iter().all(|blue| *blue < 20), "there and back: {ends:?}");
    let (_, shades) = self::shades(&format!("{}/>{line}", at(40, 40)));
    assert!(shades.iter().all(|(_, color)| color[2] > 240), "no extent: its last stop");
    let turned = at(0, 100) + " gradientTransform='rotate(90)'/>";
    let (strokes, _) = self::shades(&format!("{turned}<path d='M3 0 v100' stroke='url(#a)'/>"));
    assert_eq!(strokes.joints_m.len(), 15, "the same downward");
}

#[test]
fn a_radial_gradient_goes_by_the_distance_from_its_center() {
    let body = "<radialGradient id='a' gradientUnits='userSpaceOnUse' cx='50' cy='0' r='50'>\
                <stop stop-color='lime'/><stop offset='1' stop-color='blue'/></radialGradient>\
                <path d='M0 0 h100 v1' stroke='url(#a)'/>";
    let (strokes, shades) = shades(body);
    assert_eq!((strokes.n_strokes(), strokes.colors.len()), (1, 16));
    assert!([3.0, 97.0].iter().all(|x| blue_at(&shades, *x) > 230));
    assert!(blue_at(&shades, 50.0) < 20);
}

#[test]
fn gradients_share_what_colors_are_left() {
    let gradient = |n: usize| {
        let color = format!("#{:02x}ff{:02x}", 17 * (n % 16), 255 - 17 * (n % 16));
        format!(
            "<linearGradient id='g{n}'><stop stop-color='{color}'/><stop offset='1' \
             stop-color='red'/></linearGradient><path d='M0 {n} h90 v0.1' stroke='url(#g{n})'/>"
        )
    };
    let (strokes, _) = shades(&(0..10).map(gradient).collect::<String>());
    assert!((40..=64).contains(&strokes.colors.len()), "{} colors", strokes.colors.len());
    assert_eq!(strokes.n_strokes(), 10);
}

#[test]
fn an_svg_with_less_detail_has_fewer_strokes() {
    let body = "<path d='M0 50 h98' stroke='red'/><path d='M200 50 h-101' stroke='red'/>
        <path d='M0 20 h4' stroke='red'/>";
    let of = |detail| LetterOptions { detail: Some(detail), ..on_canvas(2.0, 1.0) };
    let [all, some] = [1.0, 0.5].map(|detail| drawn("a.svg", &svg(body), &of(detail)).unwrap());
    assert_eq!((all.n_strokes(), all.left_out.strokes), (3, 0));
    assert_eq!((some.n_strokes(), some.left_out.strokes), (1, 1));
    assert!((some.left_out.share - 4.0 / 203.0).abs() < 1e-3, "{:?}", some.left_out);
}

/// A picture of areas in one ink, each by its corners in shares of the picture.
fn areas(shapes: &[&[[f32; 2]]]) -> image::RgbaImage {
    let [width, height] = SIZE;
    let mut pixmap = tiny_skia::Pixmap::new(width, height).unwrap();
    let mut paint = tiny_skia::Paint::default();
    paint.set_color_rgba8(0, 0, 0, 255);
    paint.anti_alias = true;
    for shape in shapes {
        let mut path = tiny_skia::PathBuilder::new();
        for (index, [x, y]) in shape.iter().enumerate() {
            let (x, y) = (x * width as f32, y * height as f32);
            if index == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
        }
        path.close();
        let (path, rule) = (path.finish().unwrap(), tiny_skia::FillRule::Winding);
        pixmap.fill_path(&path, &paint, rule, tiny_skia::Transform::identity(), None);
    }
    image::RgbaImage::from_raw(width, height, pixmap.take()).unwrap()
}

fn star(x: f32, y: f32, r: f32) -> Vec<[f32; 2]> {
    let corner = |k: u8| {
        let r = if k.is_multiple_of(2) { r } else { 0.4 * r };
        let (sin, cos) = libm::sincosf(f32::from(k) * std::f32::consts::PI / 5.0);
        [x + r * sin, y - 1.5 * r * cos]
    };
    (0..10).map(corner).collect()
}

#[test]
fn a_solid_shape_is_its_outline_whatever_lies_beside_it() {
    let triangle: &[[f32; 2]] = &[[0.7, 0.1], [0.8, 0.3], [0.6, 0.3]];
    let square: &[[f32; 2]] = &[[0.05, 0.1], [0.5, 0.1], [0.5, 0.9], [0.05, 0.9]];
    let bar: &[[f32; 2]] = &[[0.55, 0.8], [0.95, 0.8], [0.95, 0.83], [0.55, 0.83]];
    let star = star(0.75, 0.55, 0.1);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    areas(&[triangle, square, bar, &star]).save(&path).unwrap();
    let strokes = draw(&path, &on_canvas(4.8, 3.2), Ink::Alike).unwrap();
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
    let bar: &[[f32; 2]] = &[[0.1, 0.5], [0.9, 0.5], [0.9, 0.53], [0.1, 0.53]];
    let black = areas(&[bar]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let drawn = |ink: [u8; 3]| {
        let mut picture = black.clone();
        picture.pixels_mut().for_each(|pixel| pixel.0[..3].copy_from_slice(&ink));
        picture.save(&path).unwrap();
        let strokes = draw(&path, &on_canvas(1.0, 1.0), Ink::Alike).unwrap();
        (strokes.n_strokes(), (10.0 * strokes.length_m()).round())
    };
    for ink in [[255; 3], [255, 240, 0], [0; 3], [200, 30, 30], [180, 255, 180]] {
        assert_eq!(drawn(ink), (1, 10.0), "{ink:?}");
    }
}

#[test]
fn handwriting_on_a_canvas_keeps_its_place() {
    let page = |strokes: &str| {
        let text = format!("{{\"strokes\": {strokes}, \"canvas\": [0, 0, 200, 100]}}");
        drawn("a.json", &text, &LetterOptions { smoothing_m: 0.0, ..on_canvas(2.0, 1.0) })
    };
    let line = page("[[[50, 25], [150, 25]]]").unwrap();
    assert_eq!(line.bounds_m(), [0.0, 0.5, 2.0, 1.5], "as large as the canvas");
    let step = line.glyphs[0].moves.iter().find(|step| step.lit).unwrap();
    assert!((step.from_m[0] - 0.5).abs() < 1e-9, "{step:?}");
    let tap = page("[[[100, 50]]]").unwrap();
    assert!(tap.length_m() < 0.01 && tap.n_strokes() == 1, "a dot: {} m", tap.length_m());
    assert!(page("[[[201, 50]]]").unwrap_err().to_string().contains("on the canvas"));
    assert!(page("[]").unwrap_err().to_string().contains("nothing drawn"));
}

#[test]
fn a_picture_of_one_color_is_no_drawing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    for gray in [0, 3, 128, 255] {
        let picture = image::RgbImage::from_pixel(320, 200, image::Rgb([gray; 3]));
        picture.save(&path).unwrap();
        let error = draw(&path, &on_canvas(1.0, 1.0), Ink::Alike).unwrap_err().to_string();
        assert!(error.contains("a.png: found a picture"), "{gray}: {error}");
    }
}
