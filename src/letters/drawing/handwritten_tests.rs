//! Handwriting in pictures: the strokes of each letter and how they hang together.

use super::picture_tests::{Canvas, line, numbers, stroked, traced};
use super::*;
use crate::vector::direction;
use crate::{Font, Trace};
use noctograph_core::geometry::{polyline_length_m, segment_distance};
use tiny_skia::{Mask, PathBuilder};

const LETTERS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789";

type Lines = Vec<Vec<[f64; 2]>>;

/// How a hand writes, in heights of a capital: the pen's width, the slant, how far the hand
/// trembles, and how far its strokes are off their places and run on.
struct Hand {
    pen: f64,
    slant: f64,
    tremble: f64,
    shift: f64,
    on: f64,
}

const HANDS: [Hand; 3] = [
    Hand { pen: 0.07, slant: 0.0, tremble: 0.012, shift: 0.0, on: 0.0 },
    Hand { pen: 0.11, slant: 0.25, tremble: 0.015, shift: 0.01, on: 0.05 },
    Hand { pen: 0.09, slant: -0.1, tremble: 0.03, shift: 0.025, on: -0.01 },
];

/// The strokes of a letter as a hand writes it, y down.
fn written(font: &Font, letter: char, hand: &Hand, next: &mut impl FnMut() -> f64) -> Lines {
    let cell = Cell { left_m: 0.0, baseline_m: 0.0, width_m: 1.0, cap_height_m: 1.0 };
    let glyph = font.glyph(letter, cell).unwrap();
    let mut lines: Lines = Vec::new();
    for step in glyph.moves.iter().filter(|step| step.lit) {
        match lines.last_mut().filter(|line| line.last() == Some(&step.from_m)) {
            Some(line) => line.push(step.to_m),
            None => lines.push(vec![step.from_m, step.to_m]),
        }
    }
    for line in &mut lines {
        let shift = [0, 1].map(|_| hand.shift * (2.0 * next() - 1.0));
        let waves = [0, 1].map(|_| [3.0 + 4.0 * next(), 6.3 * next()]);
        let is_dot = polyline_length_m(line) < 0.01;
        let closed = line[0] == line[line.len() - 1];
        if !is_dot && !closed {
            for _ in 0..2 {
                let ahead = direction(line[1], line[0]);
                let on = hand.on.min(0.3 * distance(line[1], line[0]));
                line[0] = [0, 1].map(|i| line[0][i] + on * next() * ahead[i]);
                line.reverse();
            }
        }
        *line = crate::smooth::evenly(line, if is_dot { 1.0 } else { 0.02 });
        for point in line {
            let [x, y] = *point;
            let shake = |[pace, phase]: [f64; 2]| hand.tremble * libm::sin(pace * (x + y) + phase);
            *point =
                [x + shift[0] + hand.slant * y + shake(waves[0]), -y + shift[1] + shake(waves[1])];
        }
    }
    lines
}

/// How lines hang together: parts, loops and free ends. What lies within `reach` of each other
/// hangs together.
fn topology(lines: &Lines, reach: f64) -> [usize; 3] {
    // Pixels of the reach.
    const SCALE: f64 = 6.0;
    let [left, top, right, bottom] = bounds(lines.iter().flatten().copied());
    let scale = SCALE / reach;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels")]
    let side = |from: f64, to: f64| ((to - from) * scale) as u32 + 21;
    let mut mask = Mask::new(side(left, right), side(top, bottom)).unwrap();
    for line in lines {
        let mut path = PathBuilder::new();
        for (index, [x, y]) in line.iter().enumerate() {
            #[expect(clippy::cast_possible_truncation, reason = "pixels")]
            let [x, y] = [x - left, y - top].map(|x| (10.0 + x * scale) as f32);
            if index == 0 { path.move_to(x, y) } else { path.line_to(x, y + 1e-3) }
        }
        stroked(&mut mask, &path.finish().unwrap(), 6.0);
    }
    let n_loops = parts(&mask, false, 9) - 1;
    let mut n_ends = 0;
    for (index, line) in lines.iter().enumerate() {
        if polyline_length_m(line) < 1.5 * reach {
            continue;
        }
        for backward in [false, true] {
            let mut own = line.clone();
            if backward {
                own.reverse();
            }
            let mut gone = 0.0;
            let onward = own.windows(2).skip_while(|leg| {
                gone += distance(leg[0], leg[1]);
                gone < 3.0 * reach
            });
            let others = lines.iter().enumerate().filter(|(other, _)| *other != index);
            let mut legs = others.flat_map(|(_, line)| line.windows(2)).chain(onward);
            n_ends +=
                usize::from(!legs.any(|leg| segment_distance(own[0], [leg[0], leg[1]]) <= reach));
        }
    }
    [parts(&mask, true, 1), n_loops, n_ends]
}

/// A pixel and its neighbors.
fn around(place: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let range = |place: usize, n: usize| place.saturating_sub(1)..(place + 2).min(n);
    range(place / width, height)
        .flat_map(move |y| range(place % width, width).map(move |x| y * width + x))
}

/// Connected parts of what a mask covers or not, of at least so many pixels.
fn parts(mask: &Mask, is_covered: bool, least: usize) -> usize {
    let (width, height) = (mask.width() as usize, mask.height() as usize);
    let mut open: Vec<bool> = mask.data().iter().map(|v| (*v > 127) == is_covered).collect();
    let mut n_parts = 0;
    for start in 0..open.len() {
        let mut part = if std::mem::take(&mut open[start]) { vec![start] } else { Vec::new() };
        let mut next = 0;
        while next < part.len() {
            let place = part[next];
            for near in around(place, width, height) {
                let beside = near.abs_diff(place) == 1 || near.abs_diff(place) == width;
                if (is_covered || beside) && std::mem::take(&mut open[near]) {
                    part.push(near);
                }
            }
            next += 1;
        }
        n_parts += usize::from(part.len() >= least);
    }
    n_parts
}

#[test]
fn handwritten_letters_of_any_size_keep_how_their_strokes_hang_together() {
    let font = Font::open("simplex", Trace::CenterLine).unwrap();
    let mut next = numbers(51);
    let (mut n, mut wrong) = (0, Vec::new());
    for (style, hand) in HANDS.iter().enumerate() {
        for (cap_px, columns) in [(24.0, 24), (40.0, 18), (70.0, 11), (120.0, 7)] {
            let pen_px = f64::max(hand.pen * cap_px, 2.0);
            let cell_px = [1.4 * cap_px, 1.9 * cap_px];
            let letters: Vec<char> = LETTERS.chars().collect();
            for page in letters.chunks(columns * 5) {
                let mut written_px: Vec<Lines> = Vec::new();
                let rows = page.len().div_ceil(columns);
                let size = [columns, rows].map(|n| n as f64);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "px")]
                let size = [0, 1].map(|i| (size[i] * cell_px[i]) as u32);
                let mut canvas = Canvas::new(size, [255; 3]);
                for (index, letter) in page.iter().enumerate() {
                    let mut lines = written(&font, *letter, hand, &mut || f64::from(next()));
                    let [left, _, right, _] = bounds(lines.iter().flatten().copied());
                    let center = [(index % columns) as f64 + 0.5, (index / columns) as f64 + 0.68];
                    for [x, y] in lines.iter_mut().flatten() {
                        *x = center[0] * cell_px[0] + cap_px * (*x - 0.5 * (left + right));
                        *y = center[1] * cell_px[1] + cap_px * *y;
                    }
                    for points in &lines {
                        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
                        let points: Vec<[f32; 2]> =
                            points.iter().map(|point| point.map(|x| x as f32)).collect();
                        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
                        canvas.draw(&line(&points), [20, 20, 40], pen_px as f32);
                    }
                    written_px.push(lines);
                }
                let mut drawn: Vec<Lines> = vec![Vec::new(); columns * rows];
                for (line, _) in traced(&canvas.picture(), image::ImageFormat::Png).lines {
                    let [left, top, right, bottom] = bounds(line.iter().copied());
                    let middle = [0.5 * (left + right), 0.5 * (top + bottom)];
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "cells"
                    )]
                    let [x, y] = [0, 1].map(|i| (middle[i] / cell_px[i]) as usize);
                    drawn[y * columns + x].push(crate::smooth::evenly(&line, 0.3 * pen_px));
                }
                for ((letter, wanted), drawn) in page.iter().zip(&written_px).zip(&drawn) {
                    n += 1;
                    // What is nearly joined may be either.
                    let may_be = [0.7, 1.0, 1.4].map(|reach| topology(wanted, reach * pen_px));
                    let got = if drawn.is_empty() { [0; 3] } else { topology(drawn, pen_px) };
                    if !(0..3).all(|k: usize| may_be.iter().any(|wanted| wanted[k] == got[k])) {
                        wrong.push(format!(
                            "{style} {cap_px} {letter}: {got:?}, not {:?}",
                            may_be[1]
                        ));
                    }
                }
            }
        }
    }
    let kept = 1.0 - wrong.len() as f64 / n as f64;
    assert!(kept >= 0.95, "{kept:.3} of {n}\n{}", wrong.join("\n"));
}
