use super::*;
use crate::{Move, Pace};
use noctograph_core::geometry::distance;

/// Writes a drawing to a file and draws it.
pub(super) fn drawn_in(
    name: &str,
    content: impl AsRef<[u8]>,
    options: &LetterOptions,
    ink: Ink,
) -> Result<Strokes> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    draw(&path, options, ink)
}

fn drawn(name: &str, content: &str, options: &LetterOptions) -> Result<Strokes> {
    drawn_in(name, content, options, Ink::Alike)
}

pub(super) fn on_canvas(width_m: f64, height_m: f64) -> LetterOptions {
    LetterOptions { canvas_m: Some([width_m, height_m]), align: Align::Left, ..Default::default() }
}

fn svg(body: &str) -> String {
    format!(
        "<svg xmlns='http://www.w3.org/2000/svg' xmlns:xlink='http://www.w3.org/1999/xlink' viewBox='0 0 200 100'>{body}</svg>"
    )
}

/// Returns the lit strokes: start, end and length of each.
pub(super) fn lit(strokes: &Strokes) -> Vec<([f64; 2], [f64; 2], f64)> {
    let moves = &strokes.glyphs[0].moves;
    let runs = moves.chunk_by(|a, b| a.lit == b.lit).filter(|run| run[0].lit);
    let length = |m: &Move| distance(m.from_m, m.to_m);
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
        (strokes.order, &strokes.font, strokes.glyphs[0].character),
        (StrokeOrder::Free, &None, DRAWING)
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
    // The strokes are 3 m long and take 2.5 s, and a tap has no length. The first segment takes 0.5
    // s, and the others take 1 s per meter.
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
    fn wobble(amount: f64) -> String {
        let points = (0..400).map(|k| {
            let sign = if k % 2 == 0 { amount } else { -amount };
            format!("[{k}, {}, {}]", 100.0 + sign, f64::from(k) * 0.01)
        });
        format!("{{\"strokes\": [[[0, 0, -1]], [{}]]}}", points.collect::<Vec<_>>().join(","))
    }
    fn roughness(strokes: &Strokes) -> f64 {
        let moves: Vec<_> = strokes.glyphs[0].moves.iter().filter(|m| m.lit).collect();
        moves.iter().skip(4).map(|m| (m.to_m[1] - m.from_m[1]).abs()).sum::<f64>()
    }
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
        ("a.dwg", "x", "unsupported format"),
        ("svg", "x", "unsupported format"),
        ("a.HEIC", "x", "save a JPEG"),
        ("a.avif", "x", "save a JPEG"),
        ("a.jpg", "\0\0\0\x18ftypheic", "save a JPEG"),
        ("a.pdf", "x", "as SVG"),
        ("a.png", "%PDF-1.7", "as SVG"),
    ];
    for (name, text, part) in cases {
        let error = drawn(name, text, &LetterOptions::default()).unwrap_err();
        let told = format!("{error}; {}", error.hint());
        assert!(told.contains(part) && !error.hint().is_empty(), "{name}, {text}: {told}");
    }
    let long = format!("<path d='M0 0 {}' stroke='red'/>", "l1 0 l0 1 ".repeat(MAX_POINTS / 2 + 1));
    let error = drawn("a.svg", &svg(&long), &LetterOptions::default()).unwrap_err().to_string();
    assert!(error.contains("too many points"), "{error}");
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
    fn in_both(name: &str, content: &str) -> [Strokes; 2] {
        let ways = [Ink::Alike, Ink::ByColor];
        ways.map(|ink| drawn_in(name, content, &on_canvas(2.0, 1.0), ink).unwrap())
    }
    let body = "<path d='M0 0 h50' stroke='red'/><path d='M0 20 h50' stroke='#0000ff'/>
        <path d='M0 40 h50' style='stroke:#f00'/><circle cx='100' cy='50' r='20'/>";
    let [alike, by_color] = in_both("a.svg", &svg(body));
    assert_eq!((alike.glyphs.len(), &alike.colors), (1, &Vec::new()));
    assert_eq!(by_color.colors, [[255, 0, 0], [0, 0, 255], [0, 0, 0]]);
    fn begins(glyph: &Glyph) -> Vec<[f64; 2]> {
        let moves = &glyph.moves;
        let runs = moves.chunk_by(|a, b| a.lit == b.lit).filter(|run| run[0].lit);
        runs.map(|run| run[0].from_m.map(|x| (x * 1e3).round() / 1e3)).collect()
    }
    assert_eq!(begins(&by_color.glyphs[0]), [[0.0, 1.5], [0.0, 0.929]], "both red strokes");
    assert_eq!((by_color.glyphs.len(), by_color.bounds_m()), (3, alike.bounds_m()));

    let colors = "\"colors\": [[255, 0, 0], [255, 0, 0], [0, 0, 255]]";
    let [alike, by_color] = in_both("a.json", &PAGE.replace("\"app\": \"tablet\"", colors));
    assert_eq!((alike.glyphs.len(), &alike.colors), (1, &Vec::new()));
    assert_eq!(by_color.colors, [[255, 0, 0], [0, 0, 255]], "in the writer's order");
    assert_eq!(by_color.glyphs.iter().map(|glyph| begins(glyph).len()).collect::<Vec<_>>(), [2, 1]);

    fn line(n: u32) -> String {
        format!("<path d='M0 {n} h9' stroke='#{n:06x}'/>")
    }
    let lines = svg(&(0..65).map(line).collect::<String>());
    let refused = drawn_in("a.svg", lines, &LetterOptions::default(), Ink::ByColor).unwrap_err();
    assert!(refused.to_string().contains("at most 64 colors"), "{refused}");
}

#[test]
fn a_gradient_is_the_color_of_its_middle_stop_where_any_of_it_shows() {
    let drawn = |stops: &str, line: &str| {
        let gradient = format!("<linearGradient id='g'>{stops}</linearGradient>{line}");
        drawn_in("a.svg", svg(&gradient), &on_canvas(2.0, 2.0), Ink::ByColor).unwrap()
    };
    fn stop(color: &str, more: &str) -> String {
        format!("<stop stop-color='{color}' {more}/>")
    }
    let three = [("red", "0"), ("lime", "50%"), ("blue", "1")]
        .map(|(color, offset)| stop(color, &format!("offset='{offset}'")))
        .concat();
    let stroke = "<path d='M0 5h90v9' fill='none' stroke='url(#g)'/>";
    let strokes = drawn(&three, stroke);
    assert_eq!((strokes.colors.clone(), strokes.n_strokes()), (vec![[0, 255, 0]], 1));
    let noted = "stroke by a gradient: in the color of its middle stop";
    assert!(strokes.warnings[0].message.contains(noted), "{:?}", strokes.warnings);
    let ground = "<rect width='200' height='100' fill='url(#g)'/>\
                  <path d='M5 5h90' stroke='#00f' fill='none'/>";
    let until_blue = stop("red", "") + &stop("blue", "offset='1'");
    assert_eq!(drawn(&until_blue, ground).n_strokes(), 1, "on paper in a gradient");
    let fading = stop("red", "") + &stop("blue", "offset='1' stop-opacity='0'");
    for line in [stroke, "<rect width='90' height='50' fill='url(#g)'/>"] {
        let strokes = drawn(&fading, line);
        assert_eq!((strokes.colors.clone(), strokes.n_strokes()), (vec![[255, 0, 0]], 1));
        assert!(strokes.warnings.iter().any(|it| it.message.contains("stop-opacity")));
    }
}

#[test]
fn an_svg_with_less_detail_has_fewer_strokes() {
    let body = "<path d='M0 50 h98' stroke='red'/><path d='M200 50 h-101' stroke='red'/>
        <path d='M0 20 h4' stroke='red'/>";
    let with_detail = |detail| LetterOptions { detail, ..on_canvas(2.0, 1.0) };
    let [all, some] =
        [1.0, 0.5].map(|detail| drawn("a.svg", &svg(body), &with_detail(detail)).unwrap());
    assert_eq!((all.n_strokes(), all.left_out.strokes), (3, 0));
    assert_eq!((some.n_strokes(), some.left_out.strokes), (1, 1));
    assert!((some.left_out.length_fraction - 4.0 / 203.0).abs() < 1e-3, "{:?}", some.left_out);
}

#[test]
fn handwriting_on_a_canvas_keeps_its_place() {
    fn page(strokes: &str) -> Result<Strokes> {
        let text = format!("{{\"strokes\": {strokes}, \"canvas\": [0, 0, 200, 100]}}");
        drawn("a.json", &text, &LetterOptions { smoothing_m: 0.0, ..on_canvas(2.0, 1.0) })
    }
    let line = page("[[[50, 25], [150, 25]]]").unwrap();
    assert_eq!(line.bounds_m(), [0.0, 0.5, 2.0, 1.5], "as large as the canvas");
    let step = line.glyphs[0].moves.iter().find(|step| step.lit).unwrap();
    assert!((step.from_m[0] - 0.5).abs() < 1e-9, "{step:?}");
    let tap = page("[[[100, 50]]]").unwrap();
    assert!(tap.length_m() < 0.01 && tap.n_strokes() == 1, "a dot: {} m", tap.length_m());
    assert!(page("[[[201, 50]]]").unwrap_err().to_string().contains("on the canvas"));
    assert!(page("[]").unwrap_err().to_string().contains("nothing drawn"));
}
