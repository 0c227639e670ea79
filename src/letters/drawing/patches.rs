//! Patches of ink: their subpixel contours by marching squares, without specks and without the
//! paper's surroundings. This file also contains the warnings about a picture.

use std::collections::BTreeMap;

use super::ink::{EDGE, Field};
use super::levels::level;
use crate::outline::{Contour, Filled, area, mean_stroke_width};
use crate::vector::{between, segments};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::files::Budget;
use noctograph_core::geometry::{bounds, distance, polyline_length_m};
use noctograph_core::statistics::sort_by_number;

/// Minimum side of a patch, relative to the picture's longer side.
const LEAST: f64 = 2e-3;
/// Maximum side of a speck, relative to the picture's longer side and to the mean width of the
/// largest patch.
const SPECK: [f64; 2] = [1e-2, 0.65];
/// Maximum ink of all specks, relative to that of the other patches. With more ink, the drawing
/// consists of dots.
const SPECKLED: f64 = 0.5;
/// Minimum area of a patch or a hole in square pixels, at any size of the picture.
const LEAST_AREA_PX: f64 = 2.0;

/// Minimum length along the picture's edge of a patch that surrounds the paper, relative to the
/// longer side.
const SURROUNDINGS: f64 = 0.3;
/// Mean width, relative to the longer side, and fraction of the outline along the picture's edge,
/// above which a patch across the edge of a photograph is dropped.
const OVER_EDGE: f64 = 0.02;
const ALONG: f64 = 0.1;

/// Minimum number of lines across a picture's edge that suggest rulings on the paper.
const RULINGS: usize = 8;
/// Fraction of a picture in faint marks above which there is a warning.
pub(super) const FAINT: f64 = 0.02;
/// Minimum number of lines in a picture that is too detailed, such as a QR code.
const FINE: usize = 60;

/// The code of a warning and its message, in which `{n}` stands for a number.
type Warning = (&'static str, &'static str);
const PHOTO: Warning = (
    "picture-photo",
    "a photograph is drawn as the camera sees it. To rectify a sheet of paper seen at a \
     slant, set letters.corners_px, or use a phone's scanner app",
);
const SPECKS: Warning = (
    "picture-specks",
    "{n} speck(s), such as dust, are not drawn, because they are smaller than the width of \
     the lines",
);
const CUT: Warning = (
    "picture-edge",
    "{n} shape(s) at the picture's edge are not drawn, because they look like the surroundings \
     of the paper. Leave a margin around the drawing, or scan it with a phone's scanner app",
);
const FAINT_MARKS: Warning = (
    "picture-faint",
    "marks that are much fainter than the rest, such as ruled lines, are not drawn. Trace over \
     those that belong to the drawing",
);
const RULED: Warning = (
    "picture-rulings",
    "{n} lines across the picture's edge are drawn, although they may be ruled lines of the \
     paper. Draw on plain paper, or leave a margin around the drawing",
);
const NOT_RULED: Warning = (
    "picture-not-ruled",
    "{n} lines from edge to edge, which are paler than the rest, are regarded as ruled lines of \
     the paper and are not drawn",
);
const COLORS_TOUCH: Warning =
    ("picture-colors-touch", "touching areas of different colors are drawn as one: leave gaps");
const TOO_FINE: Warning = (
    "picture-fine",
    "light fills the gaps in so fine a picture ({n} lines), so a QR code, for example, \
     cannot be scanned",
);

/// Minimum chroma of a colored ink, relative to its contrast, and relative to the paper's
/// brightness.
const CHROMA: f64 = 0.2;
const GRAY: f64 = 0.04;

/// Numbers of dropped patches, specks and rulings, and of the drawn lines.
pub(super) struct Counts {
    /// Number of patches at the edge of the picture.
    pub(super) n_cut: usize,
    pub(super) n_specks: usize,
    pub(super) n_rulings: usize,
    /// Number of lines that are drawn.
    pub(super) n_lines: usize,
}

/// An edge of the pixel grid: its upper or left pixel, and whether the edge runs downward.
type GridEdge = (usize, bool);

impl Field {
    /// Returns patches of ink, each a contour with its holes, and the number of dropped patches.
    /// Dropped patches surround the paper, or cross the edge of a photograph, such as a hand. If no
    /// other patch remained, none is dropped.
    pub(super) fn patches(&self) -> (Vec<Vec<Contour>>, usize) {
        let side = self.width.max(self.height) as f64;
        let patches = nested(self.contours(), (LEAST * side * LEAST * side).max(LEAST_AREA_PX));
        let (dropped, patches): (Vec<_>, Vec<_>) = patches.into_iter().partition(|patch| {
            let along = self.length_along_edge(&patch[0]);
            let is_over = mean_stroke_width(patch) > OVER_EDGE * side
                || along > ALONG * polyline_length_m(&patch[0]);
            along > SURROUNDINGS * side || self.has_grain && along > 0.0 && is_over
        });
        if patches.is_empty() { (dropped, 0) } else { (patches, dropped.len()) }
    }

    /// Returns the closed contours of the ink (y up), counterclockwise around ink and clockwise
    /// around holes (marching squares: Lorensen and Cline, Computer Graphics 21, 1987, in two
    /// dimensions).
    fn contours(&self) -> Vec<Contour> {
        let values: Vec<f64> = self.ink.iter().map(|value| value - EDGE).collect();
        let mut next = self.next_edges(&values);
        let mut contours = Vec::new();
        while let Some((first, mut edge)) = next.pop_first() {
            let mut edges = vec![first];
            while edge != first {
                edges.push(edge);
                let Some(onward) = next.remove(&edge) else { break };
                edge = onward;
            }
            contours.push(edges.into_iter().map(|edge| self.crossing(&values, edge)).collect());
        }
        contours
    }

    /// Returns the grid edges between ink (above 0) and paper, each with the next one.
    fn next_edges(&self, values: &[f64]) -> BTreeMap<GridEdge, GridEdge> {
        let (width, height) = (self.width, self.height);
        let mut next = BTreeMap::new();
        let cells = (0..height - 1).flat_map(|y| (0..width - 1).map(move |x| y * width + x));
        for pixel in cells {
            let corners = [pixel, pixel + 1, pixel + width + 1, pixel + width].map(|p| values[p]);
            let case = corners.map(|value| value > 0.0);
            if case == [false; 4] || case == [true; 4] {
                continue;
            }
            let edges = [(pixel, false), (pixel + 1, true), (pixel + width, false), (pixel, true)];
            // Going clockwise around the cell, a contour enters before a corner with ink and leaves
            // after one, so that the ink is on its left. Two opposite corners with ink are
            // connected if the middle has ink.
            let joined = corners.iter().sum::<f64>() > 0.0;
            for enter in (0..4).filter(|k| !case[*k] && case[(k + 1) % 4]) {
                let mut turns =
                    (1..4).map(|step| (enter + if joined { 4 - step } else { step }) % 4);
                let leave = turns.find(|k| case[*k] && !case[(k + 1) % 4]);
                next.extend(leave.map(|leave| (edges[enter], edges[leave])));
            }
        }
        next
    }

    /// Returns the point in pixels, with y up, on an edge of the pixel grid where linearly
    /// interpolated values are 0.
    fn crossing(&self, values: &[f64], (pixel, down): GridEdge) -> [f64; 2] {
        let (x, y) = (pixel % self.width, pixel / self.width);
        let other = values[pixel + if down { self.width } else { 1 }];
        let fraction = values[pixel] / (values[pixel] - other);
        let (dx, dy) = if down { (0.0, fraction) } else { (fraction, 0.0) };
        [x as f64 + dx, -(y as f64 + dy)]
    }

    /// Returns the length of a contour along the edge of the picture, in pixels.
    fn length_along_edge(&self, contour: &Contour) -> f64 {
        let [right, bottom] = [self.width - 2, self.height - 2].map(|side| side as f64);
        let segments = segments(contour).filter(|ends| {
            ends.iter().all(|[x, y]| *x < 1.0 || *x > right || -y < 1.0 || -y > bottom)
        });
        segments.map(|[a, b]| distance(a, b)).sum()
    }

    /// Returns the number of ink marks across the picture's edge, which are runs of ink in its
    /// outermost pixels.
    fn marks_across_edge(&self) -> usize {
        let (right, bottom) = (self.width - 2, self.height - 2);
        let rows = [1, bottom].map(|y| (1..=right).map(|x| (x, y)).collect::<Vec<_>>());
        let columns = [1, right].map(|x| (1..=bottom).map(|y| (x, y)).collect::<Vec<_>>());
        let sides = rows.iter().chain(&columns).map(|side| {
            let is_ink = |(x, y): &(usize, usize)| self.ink[y * self.width + x] > EDGE;
            side.chunk_by(|a, b| is_ink(a) == is_ink(b)).filter(|run| is_ink(&run[0])).count()
        });
        sides.sum()
    }

    /// Returns the warnings that apply to a picture. A rectified photograph (`is_rectified`) does
    /// not need the warning that it is drawn as the camera sees it.
    pub(super) fn warnings(&self, counts: &Counts, is_rectified: bool) -> Vec<Diagnostic> {
        let Counts { n_cut, n_specks, n_rulings, n_lines } = *counts;
        let n_marks = self.marks_across_edge();
        // If the inner edges are longer than the picture, colored areas touch.
        let colors_touch = self.inner_edges() > self.width.max(self.height);
        let counted = [
            (PHOTO, usize::from(self.is_photo && !is_rectified)),
            (SPECKS, n_specks),
            (CUT, n_cut),
            (FAINT_MARKS, usize::from(n_rulings == 0 && self.faint > FAINT)),
            (NOT_RULED, n_rulings),
            (RULED, if n_marks >= RULINGS { n_marks } else { 0 }),
            (COLORS_TOUCH, usize::from(colors_touch)),
            (TOO_FINE, if n_lines >= FINE { n_lines } else { 0 }),
        ];
        let warnings = counted.into_iter().filter(|(_, n)| *n > 0).map(|((code, message), n)| {
            Diagnostic::warning(code, message.replace("{n}", &n.to_string()))
        });
        warnings.collect()
    }

    /// Returns the fully saturated hue of the ink along a line in pixels, or black for gray ink.
    pub(super) fn hue(&self, line: &[[f64; 2]]) -> [u8; 3] {
        // The colors of four points per segment are averaged. Points outside the ink are ignored.
        let mut sum = [0.0; 3];
        let [mut n_pixels, mut contrast] = [0.0; 2];
        for [from, to] in segments(line) {
            for pixel in [0.0, 0.25, 0.5, 0.75].map(|part| self.pixel(between(from, to, part))) {
                if self.ink[pixel] > EDGE {
                    (0..3).for_each(|i| sum[i] += self.color[pixel][i]);
                    contrast += self.contrast[pixel];
                    n_pixels += 1.0;
                }
            }
        }
        let n_pixels = f64::max(n_pixels, 1.0);
        saturated(sum.map(|value| value / n_pixels), (CHROMA * contrast / n_pixels).max(GRAY))
    }

    /// Returns the index of the pixel at a point, or the nearest pixel inside the margin of paper.
    #[expect(clippy::cast_possible_truncation, reason = "within the picture")]
    fn pixel(&self, [x, y]: [f64; 2]) -> usize {
        let [row, column] = [(-y, self.height), (x, self.width)]
            .map(|(place, side)| (place.round().max(1.0) as usize).min(side - 2));
        row * self.width + column
    }
}

/// Returns the fully saturated hue of a color, or black if its chroma is at most `most_gray`.
/// Channels of the color and the chroma are from 0 to 1.
fn saturated(color: [f64; 3], most_gray: f64) -> [u8; 3] {
    let least = color.into_iter().fold(f64::MAX, f64::min);
    let most = color.into_iter().fold(0.0, f64::max);
    if most - least <= most_gray {
        return [0; 3];
    }
    // Each channel is rounded to halves, so that all strokes of one pen have the same color.
    color.map(|value| [0, 128, 255][level(2.0 * (value - least) / (most - least) + 0.5).min(2)])
}

/// Returns the patches without specks, which are smaller than the pen of the largest patch, and the
/// number of specks. `side` is the picture's longer side.
pub(super) fn without_specks(patches: Vec<Vec<Contour>>, side: f64) -> (Vec<Vec<Contour>>, usize) {
    let ink = |patch: &Vec<Contour>| patch.iter().map(|contour| area(contour)).sum::<f64>();
    let largest = patches.iter().max_by(|a, b| ink(a).total_cmp(&ink(b)));
    let width = largest.map_or(0.0, |patch| mean_stroke_width(patch));
    let max_side = (SPECK[1] * width).min(SPECK[0] * side);
    let total: f64 = patches.iter().map(ink).sum();
    let (specks, drawn): (Vec<_>, Vec<_>) = patches.into_iter().partition(|patch| {
        let [left, bottom, right, top] = bounds(patch[0].iter().copied());
        (right - left).max(top - bottom) <= max_side
    });
    let n_specks = specks.len();
    // A drawing of dots has no specks.
    let speck_ink: f64 = specks.iter().map(ink).sum();
    if speck_ink > SPECKLED * (total - speck_ink) {
        return (drawn.into_iter().chain(specks).collect(), 0);
    }
    (drawn, n_specks)
}

/// Returns patches of ink, each a contour with its holes, from contours of a minimum area in square
/// pixels.
fn nested(contours: Vec<Contour>, least_area: f64) -> Vec<Vec<Contour>> {
    let (outer, holes): (Vec<Contour>, Vec<Contour>) = contours
        .into_iter()
        .filter(|contour| area(contour).abs() >= least_area)
        .partition(|contour| area(contour) > 0.0);
    let mut patches: Vec<Vec<Contour>> = outer.into_iter().map(|c| vec![c]).collect();
    // A hole belongs to the smallest patch that contains one of its points.
    sort_by_number(&mut patches, |patch| area(&patch[0]));
    // The picture's size bounds the work, so this budget is never spent.
    let budget = Budget::new("", "");
    let boxes: Vec<[f64; 4]> = patches.iter().map(|p| bounds(p[0].iter().copied())).collect();
    for hole in holes {
        let [x, y] = hole[0];
        let owner = (0..patches.len()).find(|k| {
            let [left, bottom, right, top] = boxes[*k];
            (left..=right).contains(&x)
                && (bottom..=top).contains(&y)
                && Filled::new(&patches[*k][..1], &budget).holds([x, y])
        });
        if let Some(owner) = owner {
            patches[owner].push(hole);
        }
    }
    patches
}
