//! Tests that SVG files are drawn as in a browser, and that unsupported features are named.

use super::tests::drawn_in;
use super::*;
use noctograph_core::geometry::polyline_length_m;

/// The lines of a document in its own units (y down), sorted from the left, and the warnings.
type Drawn = (Vec<Vec<[f64; 2]>>, Vec<String>);

fn read(document: &[u8]) -> Result<Drawn> {
    let Warned { product: drawing, warnings } = svg::read(document, "a.svg")?;
    let lines = drawing.flatten(1e-3, "a.svg")?;
    let mut lines = Vec::from_iter(lines.into_iter().map(|(line, _)| {
        let mut line: Vec<[f64; 2]> = line.iter().map(|[x, y]| [*x, -y]).collect();
        if line[0] > line[line.len() - 1] {
            line.reverse();
        }
        line
    }));
    lines.sort_by(|a, b| (a[0][1], a[0][0]).partial_cmp(&(b[0][1], b[0][0])).unwrap());
    Ok((lines, warnings.iter().map(ToString::to_string).collect()))
}

fn page(body: &str) -> String {
    format!(
        "<svg xmlns='http://www.w3.org/2000/svg' xmlns:xlink='http://www.w3.org/1999/xlink' \
         viewBox='0 0 200 100'>{body}</svg>"
    )
}

/// Returns the rounded ends of each line: `x0 y0 x1 y1`.
fn ends(body: &str) -> Vec<[i64; 4]> {
    let (lines, warnings) = read(page(body).as_bytes()).unwrap();
    assert_eq!(warnings, Vec::<String>::new(), "{body}");
    rounded(&lines)
}

#[expect(clippy::cast_possible_truncation, reason = "small numbers")]
fn rounded(lines: &[Vec<[f64; 2]>]) -> Vec<[i64; 4]> {
    let round = |x: f64| x.round() as i64;
    let ends = lines.iter().map(|line| {
        let [from, to] = [line[0], line[line.len() - 1]];
        [round(from[0]), round(from[1]), round(to[0]), round(to[1])]
    });
    ends.collect()
}

#[test]
fn a_line_ends_at_the_edge_of_its_clip() {
    let line = "<path d='M0 20H200' stroke='#000' clip-path='url(#c)'/>";
    let rect = "<clipPath id='c'><rect x='50' y='0' width='100' height='100'/></clipPath>";
    assert_eq!(ends(&format!("{rect}{line}")), [[50, 20, 150, 20]]);
    let two = "<clipPath id='c'><circle cx='30' cy='20' r='10'/><rect x='100' width='20' \
               height='99'/></clipPath>";
    assert_eq!(ends(&format!("{two}{line}")), [[20, 20, 40, 20], [100, 20, 120, 20]], "a union");
    let ring = "<clipPath id='c'><path clip-rule='evenodd' d='M20 0H180V90H20ZM80 0H120V90H80Z'/>\
                </clipPath>";
    assert_eq!(ends(&format!("{ring}{line}")), [[20, 20, 80, 20], [120, 20, 180, 20]], "a hole");
    let both = "<clipPath id='d'><rect x='60' width='200' height='99'/></clipPath>\
                <clipPath id='c' clip-path='url(#d)'><rect width='90' height='99'/></clipPath>";
    assert_eq!(ends(&format!("{both}{line}")), [[60, 20, 90, 20]], "a clip that is clipped");
    let nested = format!("{both}<g clip-path='url(#d)' transform='translate(10 0)'>{line}</g>");
    assert_eq!(ends(&nested), [[70, 20, 100, 20]], "transformed together");
    let boxed = "<clipPath id='c' clipPathUnits='objectBoundingBox'><rect width='.5' height='1'/>\
                 </clipPath><path d='M0 20L200 30' stroke='#000' clip-path='url(#c)'/>";
    assert_eq!(ends(boxed), [[0, 20, 100, 25]]);
    assert_eq!(
        ends(&format!("{rect}{}", line.replace("M0 20H200", "M60 20H90"))),
        [[60, 20, 90, 20]]
    );
    let dashed = line.replace("stroke=", "fill='none' stroke-dasharray='40 10' stroke=");
    assert_eq!(ends(&format!("{rect}{dashed}")), [[50, 20, 90, 20], [100, 20, 140, 20]]);
}

#[test]
fn the_rim_of_a_clipped_fill_goes_along_the_clip() {
    let body = "<clipPath id='c'><rect x='100' width='100' height='100'/></clipPath>\
                <circle cx='100' cy='50' r='40' clip-path='url(#c)'/>";
    let (lines, _) = read(page(body).as_bytes()).unwrap();
    let length: f64 = lines.iter().map(|line| polyline_length_m(line)).sum();
    let wanted = std::f64::consts::PI * 40.0 + 80.0;
    assert!((length - wanted).abs() < 0.5, "half a circle and its diameter: {length}, {wanted}");
    let holed = "<mask id='m'><rect width='100%' height='100%' fill='#fff'/><circle cx='100' \
                 cy='50' r='20'/></mask><rect x='20' y='20' width='160' height='60' \
                 mask='url(#m)'/>";
    assert_eq!(ends(holed), [[20, 20, 20, 20], [120, 50, 120, 50]], "the hole of a mask");
}

#[test]
fn a_mask_shows_what_is_light_in_it() {
    let lines = "<path d='M0 20H200M0 80H200' stroke='#000' fill='none' mask='url(#m)'/>";
    let mask = |content: &str| {
        let mask = "<mask id='m' maskUnits='userSpaceOnUse' width='200' height='100'>";
        ends(&format!("{mask}{content}</mask>{lines}"))
    };
    let white = "<rect width='100' height='100' fill='white'/>";
    assert_eq!(mask(white), [[0, 20, 100, 20], [0, 80, 100, 80]]);
    let hole = format!("{white}<rect x='40' width='20' height='50'/>");
    assert_eq!(mask(&hole), [[0, 20, 40, 20], [60, 20, 100, 20], [0, 80, 100, 80]], "black hides");
    let drawn = "<path d='M0 20H90' stroke='white' stroke-width='8'/>";
    assert_eq!(mask(drawn), [[0, 20, 90, 20]], "a white line");
    let faint = "<rect width='100' height='100' fill='white' fill-opacity='.2'/>";
    assert!(
        read(page(&format!("<mask id='m'>{faint}</mask>{lines}")).as_bytes()).unwrap().0.is_empty()
    );
    // A gradient in a mask counts as its lightest stop, and gives a warning.
    let fading = "<linearGradient id='g'><stop stop-color='white'/><stop offset='1'/>\
                  </linearGradient><mask id='m'><rect width='200' height='100' fill='url(#g)'/></mask>";
    let (drawn, warnings) = read(page(&format!("{fading}{lines}")).as_bytes()).unwrap();
    assert!(drawn.len() == 2 && warnings[0].contains("fill by a gradient"), "{warnings:?}");
}

#[test]
fn the_pages_edge_and_those_of_viewports_within_end_lines() {
    let beyond = "<path d='M10 20H90M150 80H250' stroke='#000' fill='none'/>\
               <path d='M300 20H400V80' stroke='#000' fill='none'/>";
    assert_eq!(ends(beyond), [[10, 20, 90, 20], [150, 80, 200, 80]]);
    let open = page(beyond).replace("viewBox", "overflow='visible' viewBox");
    assert_eq!(read(open.as_bytes()).unwrap().0.len(), 3);
    let endless = page(beyond).replace("viewBox='0 0 200 100'", "");
    assert_eq!(read(endless.as_bytes()).unwrap().0.len(), 3, "a page without an edge");
    let nested = |overflow: &str| {
        ends(&format!(
            "<svg x='20' y='10' width='40' height='40' viewBox='0 0 100 100' {overflow}>\
             <path d='M0 50H400' stroke='#000'/></svg>"
        ))
    };
    assert_eq!(nested(""), [[20, 30, 60, 30]]);
    assert_eq!(nested("overflow='visible'"), [[20, 30, 180, 30]]);
    let symbol = "<symbol id='s' viewBox='0 0 10 10'><path d='M0 5H90' stroke='#000'/></symbol>\
                  <use href='#s' x='50' y='10' width='20' height='20'/>";
    assert_eq!(ends(symbol), [[50, 20, 70, 20]]);
    let page = "<svg xmlns='http://www.w3.org/2000/svg' width='100' height='100'>\
                <path d='M-50 50H500' stroke='#000'/></svg>";
    assert_eq!(rounded(&read(page.as_bytes()).unwrap().0), [[0, 50, 100, 50]], "without a viewBox");
}

#[test]
fn what_a_later_shape_covers_is_not_drawn() {
    let lines = "<path d='M0 20H200M0 50H200' stroke='#000' fill='none'/>";
    let parts = [[0, 20, 60, 20], [140, 20, 200, 20], [0, 50, 60, 50], [140, 50, 200, 50]];
    for paper in ["#fff", "white", "rgb(255,255,255)", "#fffefe"] {
        let white = format!("<rect x='60' y='10' width='80' height='80' fill='{paper}'/>");
        assert_eq!(ends(&format!("{lines}{white}")), parts, "{paper}: and no outline of it");
    }
    let white = "<rect x='60' y='10' width='80' height='80' fill='#fff'/>";
    assert_eq!(ends(&format!("{white}{lines}")).len(), 2, "beneath, it covers nothing");
    let clear = white.replace("/>", " fill-opacity='.3'/>");
    assert_eq!(ends(&format!("{lines}{clear}")).len(), 2, "a pale one hides nothing");
    let red = white.replace("#fff", "red");
    let drawn = ends(&format!("{lines}{red}"));
    assert_eq!((drawn.len(), &drawn[0]), (5, &[60, 10, 60, 10]), "and its own rim");
    let pen = "<path d='M100 0V100' stroke='#fff' stroke-width='20'/>";
    assert_eq!(
        rounded(&read(page(&format!("{lines}{pen}")).as_bytes()).unwrap().0),
        [[0, 20, 90, 20], [110, 20, 200, 20], [0, 50, 90, 50], [110, 50, 200, 50]],
        "a line in the color of the paper"
    );
    let crossing = "<path d='M100 0V100' stroke='red' stroke-width='20'/>";
    assert_eq!(ends(&format!("{lines}{crossing}")).len(), 3, "other lines cross");
    let ground = "<rect width='200' height='100' fill='#222'/>";
    let light = lines.replace("#000", "#fff");
    assert_eq!(ends(&format!("{ground}{light}")).len(), 2, "white on dark");
    let dark = white.replace("#fff", "#222");
    assert_eq!(ends(&format!("{ground}{light}{dark}")), parts, "the paper may be dark");
    assert_eq!(ends(&light).len(), 2, "white ink alone");
    let colors = format!("{light}<path d='M0 80H200' stroke='red'/>");
    let night = page(&colors).replace("viewBox", "style='background:#000' viewBox");
    assert_eq!(read(night.as_bytes()).unwrap().0.len(), 3, "a ground of CSS");
    let (lines, warnings) = read(page(&colors).as_bytes()).unwrap();
    assert!(
        lines.len() == 1 && warnings[0].contains("the color of what is beneath"),
        "{warnings:?}"
    );
}

#[test]
fn a_rim_is_where_two_colors_meet() {
    let circles = "<circle cx='60' cy='50' r='30'/><circle cx='90' cy='50' r='30'/>";
    let (lines, _) = read(page(circles).as_bytes()).unwrap();
    let length: f64 = lines.iter().map(|line| polyline_length_m(line)).sum();
    // An arc of 2 acos(1/2) of each circle lies inside the other circle.
    let wanted = 2.0 * 30.0 * (std::f64::consts::TAU - 2.0 * libm::acos(0.5));
    assert!((length - wanted).abs() < 1.0, "a union: {length}, {wanted}");
    let ring = "<circle cx='60' cy='50' r='30'/><circle cx='60' cy='50' r='20' fill='#fff'/>";
    assert_eq!(ends(ring).len(), 2, "a hole in the color of the paper");
    let strokes = drawn_in("a.svg", page(ring), &LetterOptions::default(), Ink::ByColor).unwrap();
    assert_eq!(strokes.colors, [[0, 0, 0]], "in the color of the ring");
    let same = "<path d='M10 50H190' stroke='red'/><rect x='9' y='20' width='99' height='60' \
                fill='red'/>";
    assert_eq!(ends(same).len(), 2);
    let on_own = "<rect x='9' y='20' width='99' height='60' fill='red'/>\
                  <path d='M20 50H50' stroke='red'/><path d='M20 60H50' stroke='blue'/>";
    let (lines, warnings) = read(page(on_own).as_bytes()).unwrap();
    assert_eq!(lines.len(), 2, "red on red shows nothing");
    assert!(warnings[0].contains("1 line has the color of what is beneath"), "{warnings:?}");
}

#[test]
fn styles_and_transforms_of_css_are_followed() {
    let moved = [[100, 90, 150, 90]];
    for style in [
        "style='transform:translate(100px,80px)'",
        "transform='translate(100 80)'",
        "transform='translate(110,80)translate(-10 0)'",
        "class='t'",
        "id='t'",
    ] {
        let sheet = "<style>/* a } */ .t, #t { transform: translate(100px, 80px) }</style>";
        assert_eq!(ends(&format!("{sheet}<path {style} d='M0 10H50' stroke='#000'/>")), moved);
    }
    let tight =
        "<path transform='translate(-10-20)translate(.5.5)' d='M19.5 39.5H50' stroke='#000'/>";
    assert_eq!(ends(tight), [[10, 20, 41, 20]], "as minifiers write numbers");
    let about = "<path style='transform:rotate(90deg);transform-origin:50px 50px' \
                 d='M50 50H90' stroke='#000'/>";
    assert_eq!(ends(about), [[50, 50, 50, 90]]);
    let inkscape = "<g xmlns:i='http://www.inkscape.org/' i:label='L' style='display:inline;\
                    fill:none;stroke:#000;stroke-width:.2;-inkscape-stroke:none;opacity:1;\
                    font-variation-settings:normal;vector-effect:none;paint-order:normal;\
                    mix-blend-mode:normal;filter:none'><path d='M0 10H50'/></g>";
    assert_eq!(ends(inkscape), [[0, 10, 50, 10]], "as editors write it");
    let order = "<style>.a{stroke:none} path{stroke:#000!important}:root{fill:none}</style>\
                 <path class='a' style='stroke:none' d='M0 10H50V20'/>";
    assert_eq!(ends(order), [[0, 10, 50, 20]], "what is important goes first");
    let important = "<style>path{filter:url(#f)!important}</style>\
                     <path style='filter:none' d='M0 10H50' stroke='#000'/>";
    let (_, warnings) = read(page(important).as_bytes()).unwrap();
    assert!(warnings.concat().contains("filter"), "what is in force is named: {warnings:?}");
    let switch = "<switch><foreignObject requiredExtensions='http://a/' width='1' height='1'/>\
                  <g><path d='M5 50H95' stroke='#000'/></g><path d='M0 0H9' stroke='#000'/></switch>";
    assert_eq!(ends(switch), [[5, 50, 95, 50]], "the first part that asks for nothing");
    let foreign = "<i:a xmlns:i='a'><path id='p' d='M0 0H9'/></i:a><use href='#p' stroke='#000'/>";
    assert_eq!(ends(foreign), [[0, 0, 9, 0]]);
}

#[test]
fn fills_are_closed_by_the_rule_of_painting() {
    for open in [
        "<path d='M10 10H90V90H10'/>",
        "<polyline points='10,10 90,10 90,90 10,90'/>",
        "<path d='M10 10H90V90H10' stroke='none' fill='red'/>",
    ] {
        assert_eq!(ends(open), [[10, 10, 10, 10]], "{open}");
    }
    let stroked = "<path d='M10 10H90V90H10' fill='red' stroke='#000'/>";
    assert_eq!(ends(stroked), [[10, 10, 10, 90], [10, 10, 10, 90]], "by the fill's own side");
    assert_eq!(ends(&stroked.replace("red", "none")), [[10, 10, 10, 90]]);
    let again = "<path d='M10 10H40V40ZV50H20'/>";
    assert_eq!(ends(again), [[10, 10, 10, 10], [10, 10, 10, 10]], "after it was closed");
    // Traced flags contain hundreds of fills that go back along the same line (iso-flags: aw.svg).
    let flat = "<path d='m48.333 12 1.3 1-1.3-1m70 9 1 1zM10 10H40V40ZM60 60C70 70 80 80 90 90Z'/>";
    assert_eq!(ends(flat), [[10, 10, 10, 10]], "what encloses nothing is not painted");
}

#[test]
fn what_surrounds_a_shape_belongs_to_it() {
    let disc = "<circle cx='100' cy='50' r='30' SHADE/>";
    let page = "<path fill='#c00' d='M0 0H200V100H0Z' TO/>";
    let clipped = format!("<clipPath id='c'>{disc}</clipPath>{page}").replace("SHADE", "");
    assert_eq!(ends(&clipped.replace("TO", "clip-path='url(#c)'")).len(), 1, "a clipped page");
    let mask = format!("<mask id='c'>{disc}</mask>{page}").replace("SHADE", "fill='#fff'");
    assert_eq!(ends(&mask.replace("TO", "mask='url(#c)'")).len(), 1, "a masked page");
    let line = "<path d='M9 9H50' stroke='#000'/>";
    let whole = "<clipPath id='c'><rect width='200' height='100'/></clipPath>\
                 <g clip-path='url(#c)'><rect width='200' height='100' fill='#fff'/></g>";
    assert_eq!(ends(&format!("{whole}{line}")), [[9, 9, 50, 9]], "paper in a clip of its size");
    let symbol = "<symbol id='s' viewBox='0 0 10 10'><rect width='10' height='10'/></symbol>\
                  <use href='#s' transform='translate(50 10)' width='40' height='40'/>";
    assert_eq!(ends(symbol), [[50, 10, 50, 10]], "a symbol that is moved");
    let framed = "<clipPath id='c'><rect width='100' height='100'/></clipPath><rect x='50' y='20' \
                  width='90' height='40' fill='red' stroke='#00f' clip-path='url(#c)'/>";
    assert_eq!(ends(framed).len(), 2, "a stroke, and the fill's side at the clip");
    let pie = "<g stroke='#fff' stroke-width='2'><path d='M50 50V10A40 40 0 0 1 90 50Z' fill='red'/>\
               <path d='M50 50H90A40 40 0 0 1 50 90Z' fill='#00f'/></g>";
    let length = |body: &str| {
        let (lines, warnings) = read(self::page(body).as_bytes()).unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
        lines.iter().map(|line| polyline_length_m(line)).sum::<f64>()
    };
    // The outline consists of two quarters of a circle and three radii.
    let wanted = 40.0 * (std::f64::consts::PI + 3.0);
    assert!((length(pie) - wanted).abs() < 3.0, "{} for {wanted}", length(pie));
}

#[test]
fn lines_without_length_are_points_of_light_where_their_caps_show() {
    let dots = "<path d='M20 20h0'/><path d='M50 20z'/><line x1='80' y1='20' x2='80' y2='20'/>\
                <path d='M110 20l0 0'/><polyline points='140,20 140,20'/>";
    let body = |cap: &str| {
        format!(
            "<g stroke='#000' stroke-width='4' fill='none' stroke-linecap='{cap}'>\
                 <path d='M10 80H90'/>{dots}</g>"
        )
    };
    for cap in ["round", "square"] {
        let points = [20, 50, 80, 110, 140].map(|x| [x, 20, x, 20]);
        assert_eq!(ends(&body(cap))[..], [&points[..], &[[10, 80, 90, 80]]].concat()[..], "{cap}");
    }
    assert_eq!(ends(&body("butt")), [[10, 80, 90, 80]], "as in browsers");
    let dotted = "<path d='M10 20H105' stroke='#000' fill='none' stroke-linecap='round' \
                  stroke-dasharray='0 30'/>";
    assert_eq!(ends(dotted), [10, 40, 70, 100].map(|x| [x, 20, x, 20]));
    let alone = "<path d='M10 20h0' stroke='#000' stroke-linecap='round'/>";
    let error = read(page(alone).as_bytes()).err().unwrap().to_string();
    assert!(error.contains("without extent"), "{error}");
    let drawn_later = "<path d='M10 20h80' stroke='#000' stroke-dasharray='80' stroke-dashoffset='80'>\
                       <animate attributeName='stroke-dashoffset' to='0'/></path>";
    let error = read(page(drawn_later).as_bytes()).err().unwrap();
    assert!(error.hint().contains("an animation"), "{error}; {}", error.hint());
}

#[test]
fn every_encoding_that_xml_allows_is_read() {
    let body = "<!-- é --><path id='é' d='M0 20H50' stroke='#000'/>";
    let text =
        |encoding: &str| format!("<?xml version='1.0' encoding='{encoding}'?>{}", page(body));
    let wide = |to: fn(u16) -> [u8; 2], mark: bool| -> Vec<u8> {
        let mark = mark.then_some(0xfeff);
        mark.into_iter().chain(text("UTF-16").encode_utf16()).flat_map(to).collect()
    };
    let latin = |encoding: &str| -> Vec<u8> {
        text(encoding).chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect()
    };
    let files = [
        text("UTF-8").into_bytes(),
        format!("\u{feff}{}", text("utf-8")).into_bytes(),
        wide(u16::to_le_bytes, true),
        wide(u16::to_be_bytes, true),
        wide(u16::to_le_bytes, false),
        wide(u16::to_be_bytes, false),
        latin("ISO-8859-1"),
        latin("windows-1252"),
    ];
    for (index, file) in files.iter().enumerate() {
        assert_eq!(rounded(&read(file).unwrap().0), [[0, 20, 50, 20]], "file {index}");
    }
    let error = |file: &[u8]| read(file).err().unwrap().to_string();
    assert!(error(text("x-mac-klingon").as_bytes()).contains("x-mac-klingon"));
    assert!(error(&latin("UTF-8")).contains("utf-8"), "{}", error(&latin("UTF-8")));
    assert!(error(&[0x1f, 0x8b, 8]).contains("svgz"));
}

#[test]
fn text_that_would_show_is_refused_with_its_place_and_the_way_out() {
    let line = "<path d='M0 90H200' stroke='#000'/>";
    for text in [
        "<text x='10' y='60' font-size='40'>H</text>",
        "<g style='font:bold 40px Arial'><text><tspan x='9'>H</tspan></text></g>",
        "<defs><text id='t'>H</text></defs><use href='#t'/>",
        "<clipPath id='c'><text>H</text></clipPath><path clip-path='url(#c)' d='M0 0H9' stroke='red'/>",
        "<text><tref href='#t'/></text>",
        "<text><textPath href='#p'>H</textPath></text>",
    ] {
        let error = read(page(&format!("{line}\n{text}")).as_bytes()).err().unwrap();
        assert!(error.to_string().starts_with("a.svg:2: found text"), "{error}");
        assert!(error.hint().contains("Object to Path"), "{}", error.hint());
    }
    for text in [
        "<text> </text>",
        "<text display='none'>H</text>",
        "<g opacity='0'><text>H</text></g>",
        "<defs><text>H</text></defs>",
        "<text visibility='hidden'>H</text>",
    ] {
        assert_eq!(ends(&format!("{line}{text}")), [[0, 90, 200, 90]], "{text}");
    }
}

/// Checks that any unsupported feature in an otherwise supported drawing gives a warning.
#[test]
fn what_is_not_followed_is_named_with_its_number_and_place() {
    let odd = [
        ("filter", "<g filter='url(#f)'><path d='M0 5H9' stroke='red'/></g>"),
        ("filter", "<path style='filter:blur(2px)' d='M0 5H9' stroke='red'/>"),
        ("pattern", "<pattern id='p'/><path d='M0 0H9V9Z' fill='url(#p)'/>"),
        ("<image>", "<image href='a.png' width='9' height='9'/>"),
        ("<image>", "<defs><image id='i' width='9' height='9'/></defs><use href='#i'/>"),
        ("<foreignObject>", "<foreignObject width='9' height='9'><p>a</p></foreignObject>"),
        ("pathLength", "<path pathLength='4' stroke-dasharray='1' d='M0 5H9' stroke='red'/>"),
        ("r `30px`: left out", "<circle r='3' style='r:30px'/>"),
        ("stroke `var(", "<path stroke='var(--a, red)' d='M0 5H9'/>"),
        ("fill `var(", "<path style='fill:var(--a)' d='M0 5H9V9'/>"),
        (
            "transform `rotate(.2turn)`: left out",
            "<g style='transform:rotate(.2turn)'><path d='M0 5H9V9'/></g>",
        ),
        ("translate `9px", "<path style='translate:9px 0' d='M0 5H9V9'/>"),
        ("stop-opacity", "<linearGradient id='g'><stop stop-opacity='0'/></linearGradient>"),
        ("transparent stop", "<linearGradient id='g'><stop stop-color='#f000'/></linearGradient>"),
        ("systemLanguage", "<g systemLanguage='de'/>"),
        ("incomplete", "<path style='fill:none;?;stroke:red' d='M0 5H9'/>"),
        ("style sheet with", "<style>.a\\31{fill:red}</style>"),
        ("@media", "<style>@media screen{path{fill:red}}</style>"),
        ("animation", "<path d='M0 5H9' stroke='red'><animate attributeName='d'/></path>"),
        ("animation", "<path d='M0 5H9' stroke='red'><animateTransform/></path>"),
        ("animation", "<set/>"),
        ("script", "<script>draw()</script>"),
        ("@media", "<style>@media (min-width:9px){path{fill:red}}</style>"),
        ("@import", "<style>@import url(a.css);</style>"),
        ("selector", "<style>path:nth-child(2){fill:red}</style>"),
        ("selector", "<style>g ~ path{fill:red}</style>"),
        ("clip-path", "<path style='clip-path:circle(9px)' d='M0 5H9' stroke='red'/>"),
        ("mask-image", "<path style='mask-image:url(a.png)' d='M0 5H9' stroke='red'/>"),
        ("mix-blend-mode", "<path style='mix-blend-mode:multiply' d='M0 5H9' stroke='red'/>"),
        ("stroke", "<path style='stroke:color-mix(in srgb,red,blue)' d='M0 5H9V9'/>"),
        ("fill", "<path fill='oklch(40% 0.2 90)' d='M0 5H9V9'/>"),
        ("transform", "<path style='transform:rotateX(40deg)' d='M0 5H9' stroke='red'/>"),
        ("transform", "<path style='transform:translate(10%)' d='M0 5H9' stroke='red'/>"),
        ("offset-path", "<path style='offset-path:path(\"M0 0\")' d='M0 5H9' stroke='red'/>"),
        ("zoom", "<g style='zoom:2'/>"),
        ("new-property `3`", "<g style='new-property:3'/>"),
        ("path data", "<path d='M0 5H9 Lx' stroke='red'/>"),
        ("r `calc(", "<circle style='r:calc(1px + 2px)' stroke='red'/>"),
        ("another file", "<use href='b.svg#x'/>"),
        ("marker within", "<marker id='m'><path marker-end='url(#m)' d='M0 0h1'/></marker>"),
        ("fill `initial`", "<path style='fill:initial' d='M0 5H9V9'/>"),
        ("vector-effect", "<g vector-effect='non-scaling-stroke' stroke-dasharray='3'/>"),
    ];
    let line = "<path d='M0 90H200' stroke='#000'/>";
    assert_eq!(ends(line), [[0, 90, 200, 90]]);
    for (name, body) in odd {
        let result = read(page(&format!("{line}\n{body}")).as_bytes());
        let (lines, warnings) = result.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(rounded(&lines).contains(&[0, 90, 200, 90]), "{name}");
        let named = warnings.iter().any(|warning| warning.contains(name));
        assert!(named && warnings[0].starts_with("a.svg:2: "), "{name}: {warnings:?}");
    }
    let many = "\n<g filter='url(#f)'/>".repeat(12);
    let (_, warnings) = read(page(&format!("{line}{many}")).as_bytes()).unwrap();
    assert_eq!(warnings, ["a.svg:2: 12 elements use filter: not followed"]);
    let linked = format!("<?xml-stylesheet href='a.css'?>{}", page(line));
    assert!(read(linked.as_bytes()).unwrap().1[0].contains("xml-stylesheet"));
}

#[test]
fn an_empty_drawing_names_what_was_not_followed() {
    let body = page("<path stroke='oklch(40% 0.2 90)' d='M0 5H9'/>");
    let error = drawn_in("a.svg", body, &LetterOptions::default(), Ink::Alike).unwrap_err();
    assert!(error.hint().contains("stroke `oklch(40% 0.2 90)`"), "{}", error.hint());
}

/// Returns the total length of a document's lines in its own units. There must be no warnings.
fn length(body: &str) -> f64 {
    let (lines, warnings) = read(page(body).as_bytes()).unwrap();
    assert_eq!(warnings, Vec::<String>::new(), "{body}");
    lines.iter().map(|line| polyline_length_m(line)).sum()
}

#[test]
fn an_edge_that_is_seen_once_is_drawn_once() {
    let rect =
        |x: f64, fill: &str| format!("<rect x='{x}' y='20' width='40' height='60' fill='{fill}'/>");
    let near = |body: &str, wanted: f64| {
        let length = length(body);
        assert!((length - wanted).abs() < 0.01 * wanted, "{body}: {length}, wanted {wanted}");
    };
    let flag = [rect(20.0, "blue"), rect(60.0, "red"), rect(100.0, "green")];
    near(&flag.concat(), 480.0);
    near(&[rect(20.0, "blue"), rect(60.0, "#fff"), rect(100.0, "red")].concat(), 400.0);
    let outline = "<rect x='20' y='20' width='40' height='60' fill='none' stroke='#000' \
                   stroke-width='4'/>";
    near(&(rect(20.0, "yellow") + outline), 200.0);
    let inset = "<rect x='21' y='21' width='38' height='58' fill='yellow'/>";
    near(&(inset.to_owned() + outline), 200.0);
    let thin = outline.replace("'4'", "'1'");
    near(&(inset.to_owned() + &thin), 200.0 + 192.0);
    near(&(outline.to_owned() + outline), 200.0);
    let casing = "<path d='M10 50H190' stroke='#000' stroke-width='9'/><path d='M10 50H190' \
                  stroke='red' stroke-width='5'/>";
    near(casing, 180.0);
    let crossing = "<path d='M10 50H190' stroke='#000'/><path d='M100 10V90M100 10L40 90' \
                    stroke='red' stroke-width='6' fill='none'/>";
    near(crossing, 180.0 + 80.0 + 100.0);
    let chain: String = (0..400)
        .map(|k| 0.03 * f64::from(k))
        .map(|x| format!("<path d='M{x} 50h.03' stroke='#000' stroke-width='2'/>"))
        .collect();
    near(&chain, 12.0);
    let pale = outline.replace("/>", " stroke-opacity='.4'/>");
    near(&(inset.to_owned() + &pale), 200.0 + 192.0);
}

#[test]
fn of_two_elements_with_one_id_the_first_counts() {
    let lines = "<path d='M0 20H200M0 50H200M0 80H200' stroke='#000' fill='none'";
    let [upper, lower] = ["width='200' height='60'", "y='60' width='200' height='40'"];
    for (tag, property, fill) in [("clipPath", "clip-path", ""), ("mask", "mask", "fill='#fff'")] {
        let units = if tag == "mask" {
            "maskUnits='userSpaceOnUse' x='0' y='0' width='200' height='100'"
        } else {
            ""
        };
        let body = format!(
            "<{tag} id='c' {units}><rect {upper} {fill}/></{tag}>\
             <{tag} id='c' {units}><rect {lower} {fill}/></{tag}>{lines} {property}='url(#c)'/>"
        );
        let (drawn, warnings) = read(page(&body).as_bytes()).unwrap();
        assert_eq!(rounded(&drawn), [[0, 20, 200, 20], [0, 50, 200, 50]], "{tag}");
        assert!(warnings[0].contains("the id \"c\" again: references use the first"), "{tag}");
    }
    let used = "<defs><path id='p' d='M0 20H90' stroke='red'/></defs><g display='none'>\
                <path id='p' d='M0 90H10' stroke='red'/></g><use href='#p'/>";
    assert_eq!(ends(used), [[0, 20, 90, 20]]);
    let styled = format!(
        "<style>#c{{fill:red}}</style><clipPath id='c'><rect {upper}/></clipPath><clipPath id='c'>\
         <rect {lower}/></clipPath>{lines} clip-path='url(#c)'/>"
    );
    let (_, warnings) = read(page(&styled).as_bytes()).unwrap();
    assert!(warnings[0].contains("the id \"c\" a second time"), "{warnings:?}");
}

#[test]
fn a_namespace_taken_for_a_link_is_read_and_a_page_is_named() {
    let https = page("<path d='M0 20H90' stroke='red'/>").replace("http://", "https://");
    assert_eq!(read(https.as_bytes()).unwrap().0.len(), 1);
    let html = read(b"<html><body><svg/></body></html>").unwrap_err().to_string();
    assert!(html.contains("a document of <html>"), "{html}");
    let other = read(b"<svg xmlns='http://example.com/svg'/>").unwrap_err().to_string();
    assert!(other.contains("http://example.com/svg"), "{other}");
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(48))]

    /// Tests that layered clip art and shuffled tiles give lines as long as their visible edges.
    #[test]
    fn colors_below_their_outline_and_tiles_are_as_long_as_their_lines(
        n in 2..5_u32,
        width in 8.0..18.0_f64,
        stroke in 1.0..5.0_f64,
        inset in -0.3..0.3_f64,
        has_lines: bool,
        round in 0.0..6.0_f64,
        turned in proptest::bool::ANY,
    ) {
        let tile = |k: u32, inset: f64, more: &str| {
            let (x, w, h) = (10.0 + width * f64::from(k) + inset, width - 2.0 * inset, 50.0 - 2.0 * inset);
            let y = 20.0 + inset;
            let rx = if has_lines { round } else { 0.0 };
            if turned && rx == 0.0 {
                format!("<path d='M{x} {y}v{h}h{w}v-{h}z' {more}/>")
            } else {
                format!("<rect x='{x}' y='{y}' width='{w}' height='{h}' rx='{rx}' {more}/>")
            }
        };
        let fill = |k: u32| format!("fill='#{}{}f'", 3 * k % 10, 9 - k);
        let inset = inset * stroke;
        let (body, wanted) = if has_lines {
            // The shapes do not touch, and each one has an outline.
            let outline = format!("fill='none' stroke='#000' stroke-width='{stroke}'");
            let colors: String = (0..n).map(|k| tile(2 * k, inset, &fill(k))).collect();
            let lines: String = (0..n).map(|k| tile(2 * k, 0.0, &outline)).collect();
            (colors + &lines, length(&lines))
        } else {
            let tiles: String = (0..n).map(|k| tile(k, 0.0, &fill(k))).collect();
            let n = f64::from(n);
            (tiles, 2.0 * n * width + 50.0 * (n + 1.0))
        };
        let seen = length(&body);
        proptest::prop_assert!((seen - wanted).abs() < 0.02 * wanted, "{seen}, {wanted}: {body}");
    }
}
