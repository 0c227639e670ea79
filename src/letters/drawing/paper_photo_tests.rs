//! Sheets of paper on tables: found, or given by their corners.

use std::f64::consts::PI;

use super::picture_tests::{Canvas, line, traced, traced_with};
use super::*;

/// How a sheet of paper was photographed.
struct Taken {
    tilt_deg: f64,
    turn_deg: f64,
    desk: [f64; 3],
    /// Light on the left half, and how many pixels the edge of the shadow is soft.
    shadow: f64,
    soft_px: f64,
    ruled: bool,
    /// Another sheet below, and a hand over the edge.
    other: bool,
    hand: bool,
}

const DARK: [f64; 3] = [110.0, 70.0, 45.0];
const LIGHT: [f64; 3] = [214.0, 214.0, 210.0];

/// Lines of a boat on a sheet, in its width: x to the right, y down, to 1/√2.
fn boat() -> Vec<Vec<[f64; 2]>> {
    let arcs = (0..=40).map(|k: i32| {
        let t = f64::from(k) / 40.0;
        [0.2 + 0.6 * t, 0.6 - 0.03 * libm::sin(3.0 * PI * t).abs()]
    });
    vec![
        vec![[0.3, 0.45], [0.72, 0.45], [0.66, 0.53], [0.36, 0.53], [0.3, 0.45]],
        vec![[0.5, 0.42], [0.5, 0.12], [0.66, 0.39], [0.5, 0.39]],
        vec![[0.48, 0.16], [0.38, 0.38], [0.48, 0.38], [0.48, 0.16]],
        arcs.collect(),
        (0..=30)
            .map(|k| {
                let (sin, cos) = libm::sincos(f64::from(k) * PI / 15.0);
                [0.82 + 0.05 * cos, 0.15 + 0.05 * sin]
            })
            .collect(),
    ]
}

/// A photograph of the sheet, and its corners there.
fn photographed(taken: &Taken) -> (image::RgbImage, paper_photo::Corners) {
    const SIZE: [u32; 2] = [960, 720];
    let high = 1.0 / std::f64::consts::SQRT_2;
    let mut paper = Canvas::new([1414, 1000], [252, 250, 240]);
    for y in (1..if taken.ruled { 26_u8 } else { 1 }).map(|k| 39.0 * f32::from(k)) {
        paper.draw(&line(&[[0.0, y], [1414.0, y]]), [165, 195, 230], 3.0);
    }
    for drawn in boat() {
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let points: Vec<[f32; 2]> =
            drawn.iter().map(|point| point.map(|x| (1414.0 * x) as f32)).collect();
        paper.draw(&line(&points), [45, 45, 50], 6.0);
    }
    let paper = paper.picture();
    let (sin, cos) = libm::sincos(taken.turn_deg.to_radians());
    let (tilt_sin, tilt_cos) = libm::sincos(taken.tilt_deg.to_radians());
    let place = |[x, y]: [f64; 2]| {
        let (x, y) = (x - 0.5, y - 0.5 * high);
        let (x, y) = (cos * x - sin * y, sin * x + cos * y);
        let far = 1.55 - tilt_sin * y;
        [480.0 + 1000.0 * x / far, 360.0 + 1000.0 * tilt_cos * y / far]
    };
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, high], [0.0, high]].map(place);
    let map = paper_photo::Map::to(&corners);
    let below =
        paper_photo::Map::to(&[[0.55, 0.4], [1.6, 0.4], [1.6, 1.2], [0.55, 1.2]].map(place));
    fn inverse(map: &paper_photo::Map, [x, y]: [f64; 2]) -> [f64; 2] {
        let [a, b, c] = map.0;
        let (p, q) = ([0, 1].map(|k| a[k] - x * c[k]), [0, 1].map(|k| b[k] - y * c[k]));
        let (r, s) = (x * c[2] - a[2], y * c[2] - b[2]);
        let determinant = p[0] * q[1] - p[1] * q[0];
        [(r * q[1] - p[1] * s) / determinant, (p[0] * s - r * q[0]) / determinant]
    }
    let picture = image::RgbImage::from_fn(SIZE[0], SIZE[1], |px, py| {
        let (x, y) = (f64::from(px) + 0.5, f64::from(py) + 0.5);
        let inside = |[u, v]: [f64; 2]| (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v);
        let [u, v] = inverse(&map, [x, y]);
        let grain = 0.06 * libm::sin(0.05 * y + 2.0 * libm::sin(0.01 * x));
        let mut color = taken.desk.map(|value| value * (1.0 + grain));
        if taken.other && inside(inverse(&below, [x, y])) {
            color = [250.0, 250.0, 246.0];
        }
        if inside([u, v]) {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a pixel")]
            let pixel = [(1414.0 * u) as u32, (1000.0 * v) as u32];
            color = paper.get_pixel(pixel[0], pixel[1]).0.map(f64::from);
        }
        if taken.hand && libm::hypot((x - 120.0) / 1.6, y - 520.0) < 62.0 {
            color = [205.0, 150.0, 120.0].map(|value| value + 0.2 * (y - 520.0));
        }
        let edge = 1.0 / (1.0 + libm::exp((480.0 + 0.4 * (y - 360.0) - x) / taken.soft_px));
        let light = (1.0 - 0.15 * y / 720.0) * (1.0 - (1.0 - taken.shadow) * edge);
        let hash = libm::sin(12.9898 * x + 78.233 * y) * 43_758.545_3;
        let noise = 6.0 * (hash - hash.floor() - 0.5);
        image::Rgb(color.map(|value| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a byte")]
            let byte = (value * light + noise).clamp(0.0, 255.0) as u8;
            byte
        }))
    });
    (image::imageops::blur(&picture, 0.8), corners)
}

/// How far the lines of the boat are off, in widths of the sheet: those that are missing, those
/// that were added.
fn errors(trace: &Traced) -> [f64; 2] {
    let drawn: Vec<[f64; 2]> =
        boat().iter().flat_map(|line| crate::smooth::evenly(line, 0.005)).collect();
    let lines: Vec<[f64; 2]> =
        trace.lines.iter().flat_map(|(line, _)| crate::smooth::evenly(line, 3.0)).collect();
    let ([left, top, right, _], [l, t, r, _]) =
        (bounds(drawn.iter().copied()), bounds(lines.iter().copied()));
    let scale = (right - left) / (r - l);
    let lines: Vec<[f64; 2]> =
        lines.iter().map(|[x, y]| [left + scale * (x - l), top + scale * (y - t)]).collect();
    fn farthest(points: &[[f64; 2]], others: &[[f64; 2]]) -> f64 {
        let nearest = |p: &[f64; 2]| others.iter().map(|q| distance(*p, *q)).fold(9.0, f64::min);
        points.iter().map(nearest).fold(0.0, f64::max)
    }
    [farthest(&drawn, &lines), farthest(&lines, &drawn)]
}

const PLAIN: Taken = Taken {
    tilt_deg: 0.0,
    turn_deg: 0.0,
    desk: DARK,
    shadow: 1.0,
    soft_px: 8.0,
    ruled: false,
    other: false,
    hand: false,
};

#[test]
fn a_drawing_on_a_sheet_on_a_table_is_seen_square_on_without_rulings_and_shadows() {
    let hard = Taken { soft_px: 0.5, ruled: true, ..PLAIN };
    let takes = [
        Taken { ..PLAIN },
        Taken { tilt_deg: 25.0, ..PLAIN },
        Taken { tilt_deg: 40.0, turn_deg: 8.0, ..PLAIN },
        Taken { tilt_deg: 30.0, turn_deg: -12.0, shadow: 0.4, ..PLAIN },
        Taken { turn_deg: 15.0, desk: LIGHT, ..PLAIN },
        Taken { tilt_deg: 30.0, turn_deg: 5.0, desk: LIGHT, ..PLAIN },
        Taken { tilt_deg: 20.0, desk: LIGHT, shadow: 0.5, ..PLAIN },
        Taken { tilt_deg: 40.0, turn_deg: -5.0, desk: LIGHT, ..PLAIN },
        Taken { tilt_deg: 20.0, turn_deg: 4.0, other: true, ..PLAIN },
        Taken { tilt_deg: 10.0, turn_deg: -8.0, hand: true, ..PLAIN },
        Taken { tilt_deg: 35.0, desk: LIGHT, hand: true, ..PLAIN },
        Taken { tilt_deg: 15.0, turn_deg: 10.0, shadow: 0.35, hand: true, ..PLAIN },
        Taken { tilt_deg: 30.0, turn_deg: -6.0, shadow: 0.5, ..hard },
        Taken { tilt_deg: 20.0, desk: LIGHT, shadow: 0.4, ..hard },
        Taken { tilt_deg: 10.0, turn_deg: 5.0, shadow: 0.6, other: true, ..hard },
    ];
    for (index, taken) in takes.iter().enumerate() {
        let (picture, corners) = photographed(taken);
        let trace = traced(&picture, image::ImageFormat::Jpeg);
        let [missing, added] = errors(&trace);
        assert!(
            missing < 0.02 && added < 0.02,
            "{index}: {missing:.3} missing, {added:.3} added; {corners:.0?}, {:?}",
            trace.warnings
        );
        // Back in the photograph, the lines lie on those of the boat.
        let (map, high) = (paper_photo::Map::to(&corners), 1.0 / std::f64::consts::SQRT_2);
        let drawn: Vec<[f64; 2]> = boat()
            .iter()
            .flat_map(|line| crate::smooth::evenly(line, 0.002))
            .map(|[x, y]| map.apply([x, y / high]))
            .collect();
        for point in trace.lines.iter().flat_map(|(line, _)| line).step_by(16) {
            let place = trace.in_file.apply(*point);
            let error_px = drawn.iter().map(|p| distance(*p, place)).fold(99.0, f64::min);
            assert!(error_px < 10.0, "{index}: {error_px:.1} pixels off at {place:.0?}");
        }
    }
}

#[test]
fn a_frame_that_is_drawn_is_no_sheet() {
    // A house with thick walls on squared paper: the same paper lies on both sides of them.
    let mut paper = Canvas::new([900, 680], [250, 248, 240]);
    for k in 1..26_u8 {
        let offset = 36.0 * f32::from(k);
        paper.draw(&line(&[[0.0, offset], [900.0, offset]]), [165, 195, 230], 2.0);
        paper.draw(&line(&[[offset, 0.0], [offset, 680.0]]), [165, 195, 230], 2.0);
    }
    let walls = [[170.0, 310.0], [480.0, 310.0], [480.0, 590.0], [170.0, 590.0], [170.0, 310.0]];
    paper.draw(&line(&walls), [200, 30, 40], 22.0);
    paper.draw(&line(&[[140.0, 320.0], [325.0, 150.0], [510.0, 320.0]]), [25, 25, 35], 14.0);
    assert_eq!(paper_photo::corners(&paper.picture()), None);
}

#[test]
fn corners_given_by_hand_cut_out_a_sheet_that_is_not_seen() {
    let desk = [251.0, 250.0, 243.0];
    let taken = Taken { tilt_deg: 35.0, turn_deg: 8.0, desk, ..PLAIN };
    let (picture, corners) = photographed(&taken);
    let given = |corners: &[[f64; 2]]| {
        let corners_px = corners.as_flattened().try_into().ok();
        let options = LetterOptions { corners_px, ..LetterOptions::default() };
        traced_with(&options, &picture, image::ImageFormat::Png)
    };
    let seen = traced(&picture, image::ImageFormat::Png);
    let taken = errors(&seen);
    assert!(taken.iter().any(|error| *error > 0.03), "as it was taken: {taken:.3?}");
    let trace = given(&corners).unwrap();
    assert!(errors(&trace).iter().all(|error| *error < 0.02), "{:.3?}", errors(&trace));
    assert_eq!(trace.warnings, Vec::<String>::new());
    let [a, b, c, d] = corners;
    for turned in [[b, a, c, d], [a, d, c, b], [a, c, b, d]] {
        let told = given(&turned).err().unwrap().to_string();
        assert!(told.contains("corners") && told.contains("upper left"), "{told}");
    }
}
