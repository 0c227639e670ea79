//! A letter less one of its strokes: what a lamp that fails for a stroke leaves.
//!
//! Such a part is a rival of its own letter. Among whole letters alone an L without its foot is
//! still nearest to L, and would pass.

use super::trace::{CORNER_RAD, Segment, distance};
use crate::letters::{Glyph, Move};

/// Bent strokes longer than this, in cap heights, are cut into parts no longer than `PART_H`: an O
/// has no corner.
const LONG_H: f64 = 1.2;

/// See `LONG_H`.
const PART_H: f64 = 0.8;

/// Strokes shorter than this, in cap heights, are not missed: serifs, and the flag of a 1.
const LEAST_H: f64 = 0.3;

/// What lies within this of a stroke goes with it, in cap heights: the same line drawn twice, and
/// the first bit of what joins it.
const SAME_H: f64 = 0.02;

/// Moves are cut into bits of this length, in cap heights, to tell what goes.
const BIT_H: f64 = 0.02;

/// The lit moves that are left without one stroke, for each stroke whose loss leaves something.
pub(super) fn parts(glyph: &Glyph) -> Vec<Vec<Move>> {
    let high_m = glyph.cell.cap_height_m;
    let mut gone: Vec<Vec<Segment>> = Vec::new();
    let mut parts = Vec::new();
    for stroke in strokes(glyph) {
        let again = |other: &Vec<Segment>| {
            stroke.iter().all(|segment| distance(middle(*segment), other) <= SAME_H * high_m)
        };
        if length(&stroke) < LEAST_H * high_m || gone.iter().any(again) {
            continue;
        }
        let bits = lit(glyph).flat_map(|segment| cut(segment, BIT_H * high_m));
        let left = bits.filter(|bit| distance(middle(*bit), &stroke) > SAME_H * high_m);
        let left: Vec<Move> = left.map(|[from_m, to_m]| Move { from_m, to_m, lit: true }).collect();
        if !left.is_empty() {
            parts.push(left);
        }
        gone.push(stroke);
    }
    parts
}

/// The strokes of a letter: from corner to corner, or a part of a long bend.
fn strokes(glyph: &Glyph) -> Vec<Vec<Segment>> {
    let high_m = glyph.cell.cap_height_m;
    let mut strokes: Vec<Vec<Segment>> = Vec::new();
    for segment in lit(glyph) {
        let goes_on = strokes
            .last()
            .and_then(|stroke| stroke.last())
            .is_some_and(|last| last[1] == segment[0] && turn(*last, segment) < CORNER_RAD);
        match strokes.last_mut() {
            Some(stroke) if goes_on => stroke.push(segment),
            _ => strokes.push(vec![segment]),
        }
    }
    let in_parts = strokes.into_iter().flat_map(|stroke| {
        let long_m = length(&stroke);
        if stroke.len() == 1 || long_m <= LONG_H * high_m {
            return vec![stroke];
        }
        let n_parts = (long_m / (PART_H * high_m)).ceil();
        let (mut parts, mut so_far_m) = (vec![Vec::new()], 0.0);
        for bit in stroke.into_iter().flat_map(|segment| cut(segment, BIT_H * high_m)) {
            if so_far_m >= long_m / n_parts * parts.len() as f64 {
                parts.push(Vec::new());
            }
            so_far_m += length(&[bit]);
            parts.last_mut().expect("one at least").push(bit);
        }
        parts
    });
    in_parts.collect()
}

fn lit(glyph: &Glyph) -> impl Iterator<Item = Segment> {
    let lit = glyph.moves.iter().filter(|step| step.lit && step.from_m != step.to_m);
    lit.map(|step| [step.from_m, step.to_m])
}

/// A segment in equal bits no longer than a length.
fn cut([from, to]: Segment, bit_m: f64) -> impl Iterator<Item = Segment> {
    let n_bits = (length(&[[from, to]]) / bit_m).ceil().max(1.0);
    #[expect(clippy::cast_possible_truncation, reason = "a letter has some hundred bits")]
    #[expect(clippy::cast_sign_loss, reason = "one at least")]
    let n = n_bits as u32;
    let at = move |bit: u32| {
        let part = f64::from(bit) / n_bits;
        [0, 1].map(|axis| from[axis] + part * (to[axis] - from[axis]))
    };
    (0..n).map(move |bit| [at(bit), at(bit + 1)])
}

fn length(segments: &[Segment]) -> f64 {
    segments.iter().map(|[from, to]| libm::hypot(to[0] - from[0], to[1] - from[1])).sum()
}

fn middle([from, to]: Segment) -> [f64; 2] {
    [0, 1].map(|axis| 0.5 * (from[axis] + to[axis]))
}

/// By how much the pen turns from one segment to the next, 0 to π.
pub(super) fn turn(a: Segment, b: Segment) -> f64 {
    let [a, b] = [a, b].map(|[from, to]| [to[0] - from[0], to[1] - from[1]]);
    libm::atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{Cell, Font, Trace};

    fn parts_of(font: &str, character: char) -> Vec<f64> {
        let font = Font::open(font, Trace::CenterLine).unwrap();
        let cell = Cell { left_m: 0.0, baseline_m: 0.0, width_m: 0.6, cap_height_m: 1.0 };
        let glyph = font.glyph(character, cell).unwrap();
        let length_m = |moves: &Vec<Move>| {
            length(&moves.iter().map(|step| [step.from_m, step.to_m]).collect::<Vec<_>>())
        };
        let mut lengths: Vec<f64> = parts(&glyph).iter().map(length_m).collect();
        lengths.sort_by(f64::total_cmp);
        lengths
    }

    #[test]
    fn a_letter_has_a_part_for_each_stroke_that_it_can_lose() {
        let near = |found: &[f64], wanted: &[f64]| {
            let pairs = found.iter().zip(wanted);
            assert!(
                found.len() == wanted.len() && pairs.clone().all(|(a, b)| (a - b).abs() < 0.15),
                "{found:?} instead of {wanted:?}"
            );
        };
        near(&parts_of("ae483-fixed", 'L'), &[0.6, 1.0]);
        // The team draws the stem up and down again: it goes and comes with both.
        near(&parts_of("ae483", 'L'), &[0.6, 2.0]);
        near(&parts_of("ae483-fixed", 'O'), &[2.2, 2.2, 2.6, 2.6]);
        near(&parts_of("simplex", 'H'), &[1.65, 1.65, 2.0]);
        assert_eq!(parts_of("simplex", 'I'), [0.0; 0], "a single stroke leaves nothing");
        let round = parts_of("simplex", 'O');
        assert!(round.len() >= 3 && round[round.len() - 1] - round[0] < 0.2, "{round:?}");
    }
}
