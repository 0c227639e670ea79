//! Tests that a disc has a single outline in every paint and surroundings that show all of it.

use proptest::prelude::*;

use super::svg;
use noctograph_core::geometry::{distance, polyline_length_m};

/// Center of the page, which is 200 by 100.
const MIDDLE: [f64; 2] = [100.0, 50.0];

/// Paints, as definitions and attributes. Each paint covers the whole disc.
const PAINTS: [(&str, &str); 7] = [
    ("", "fill='teal'"),
    ("", "style='fill:currentColor' color='#08f'"),
    ("", "fill='url(#gone) navy'"),
    ("<linearGradient id='g'><stop stop-color='red'/></linearGradient>", "fill='url(#g)'"),
    (
        "<linearGradient id='g'><stop stop-color='red'/><stop offset='1' stop-color='#00f'/>\
         </linearGradient>",
        "fill='url(#g)'",
    ),
    (
        "<radialGradient id='g'><stop stop-color='teal' stop-opacity='0'/>\
         <stop offset='.2' stop-color='teal'/></radialGradient>",
        "fill='url(#g)'",
    ),
    (
        "<linearGradient id='h'><stop stop-color='#080'/><stop offset='1' \
         stop-color='rgba(0,99,0,.2)'/></linearGradient>\
         <linearGradient id='g' xlink:href='#h' x2='0' y2='1'/>",
        "style='fill:url(#g)'",
    ),
];

/// Ways to show a disc of radius R at the center in some PAINT.
const WAYS: [&str; 11] = [
    "<circle cx='100' cy='50' r='R' PAINT/>",
    "<path d='MX 50aR R 0 0 1 D 0' PAINT/><path d='MX 50aR R 0 0 0 D 0' PAINT/>",
    "<circle cx='100' cy='50' r='R' PAINT stroke='#fff' stroke-width='.01'/>",
    "<rect x='-300' y='-300' width='900' height='900' fill='#fed'/><circle cx='100' cy='50' r='R' PAINT \
     stroke='#fed' stroke-width='.01'/>",
    "<clipPath id='c'><circle cx='100' cy='50' r='R'/></clipPath>\
     <rect width='200' height='100' PAINT clip-path='url(#c)'/>",
    "<clipPath id='c'><circle cx='100' cy='50' r='R'/></clipPath>\
     <rect x='X' y='Y' width='D' height='D' PAINT clip-path='url(#c)'/>",
    "<clipPath id='c' clipPathUnits='objectBoundingBox'><circle cx='.5' cy='.5' r='.5'/></clipPath>\
     <rect x='X' y='Y' width='D' height='D' PAINT clip-path='url(#c)'/>",
    "<mask id='c' maskUnits='userSpaceOnUse' x='0' y='0' width='200' height='100'>\
     <circle cx='100' cy='50' r='R' fill='#fff'/></mask>\
     <rect width='200' height='100' PAINT mask='url(#c)'/>",
    "<symbol id='s' viewBox='0 0 D D'><circle cx='R' cy='R' r='R' PAINT/></symbol>\
     <use xlink:href='#s' transform='translate(X Y)' width='D' height='D'/>",
    "<symbol id='s' viewBox='0 0 200 100'><circle cx='100' cy='50' r='R' PAINT/></symbol>\
     <g transform='rotate(30 100 50)'><use xlink:href='#s' width='200' height='100'/></g>",
    "<svg x='0' y='0' width='200' height='100' viewBox='50 0 100 100'>\
     <circle cx='100' cy='50' r='R' PAINT/></svg>",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_disc_has_its_rim_in_every_paint_and_surrounding(
        way in 0..WAYS.len(), paint in 0..PAINTS.len(), radius in 12_u32..45, turn in 0..90_u32,
    ) {
        let (definitions, paint) = PAINTS[paint];
        let radius = f64::from(radius);
        let [left, top] = MIDDLE.map(|middle| middle - radius);
        let body = WAYS[way].replace("PAINT", paint).replace('R', &radius.to_string());
        let body = body.replace('D', &(2.0 * radius).to_string());
        let body = body.replace('X', &left.to_string()).replace('Y', &top.to_string());
        let text = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' xmlns:xlink='http://www.w3.org/1999/xlink' \
             viewBox='0 0 200 100'>{definitions}<g transform='rotate({turn} 100 50)'>{body}</g></svg>"
        );
        let drawing = svg::read(text.as_bytes(), "a.svg").unwrap().product;
        let lines = drawing.flatten(1e-3, "a.svg").unwrap();
        let rim: f64 = lines.iter().map(|(line, _)| polyline_length_m(line)).sum();
        let whole = std::f64::consts::TAU * radius;
        prop_assert!((rim / whole - 1.0).abs() < 0.01, "{rim} of {whole}: {text}");
        for [x, y] in lines.iter().flat_map(|(line, _)| line) {
            let error = distance([*x, -*y], MIDDLE) - radius;
            prop_assert!(error.abs() < 0.1, "{error}: {text}");
        }
    }
}
