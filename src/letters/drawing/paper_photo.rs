//! A sheet of paper on a table: its corners, and the picture of it seen square on.
//!
//! Long straight edges are detected by a Hough transform of the gradient (Duda and Hart, Comm. ACM
//! 15, 1972, with each pixel's own direction). The sheet is the quadrangle of four edges that is
//! brighter inside than outside along most of its sides; logarithms make this work in shadow, too.
//! Its aspect ratio follows from the perspective of square pixels (Zhang and He, Digital Signal
//! Processing 17, 2007), and is that of a usual format if it is near it.

use std::f64::consts::PI;

use image::imageops::{interpolate_bilinear, thumbnail};
use image::{ImageBuffer, Luma, Rgb, RgbImage};

use super::levels::{closed, softened};
use crate::outline::area;
use crate::vector::{ahead, between, cross, direction, dot, minus};
use noctograph_core::geometry::distance;

/// Four corners in a picture's pixels, clockwise from the upper left.
pub(super) type Corners = [[f64; 2]; 4];

/// Pixels of the longer side on which edges are sought.
const SIDE: u32 = 320;
/// Half the width of lines that are removed before the edges are detected.
const PEN: usize = 3;
/// Share of the pixels whose gradient is too weak for an edge.
const WEAK: f64 = 0.80;
/// Directions of lines; difference of direction and of offset between two lines; most lines.
const ANGLES: usize = 180;
const APART: [usize; 2] = [6, 5];
const LINES: usize = 22;
/// Least area of a sheet by the picture's, least cosine between its sides, least distance of two
/// opposite sides by the picture's longer side, and how far outside of the picture a corner may be.
const LEAST_AREA: f64 = 0.12;
const SLANT: f64 = 0.75;
const LEAST_APART: f64 = 0.2;
const OUTSIDE: f64 = 0.03;
/// Least ratio of brightness across an edge, as a logarithm, measured so many pixels to both sides;
/// and the ratio from which an edge has full weight in the choice between quadrangles.
const EDGE: f64 = 0.02;
const ACROSS: [f64; 3] = [2.0, 5.0, 12.0];
const CLEAR: f64 = 0.1;
/// Share of each side and of all that has to be such an edge.
const SEEN: [f64; 2] = [0.45, 0.7];
/// Points along a side, and half pixels by which its ends are moved.
const POINTS: u32 = 48;
const SHIFTS: u32 = 16;
/// Least, usual and greatest focal length by the picture's longer side, of cameras and phones; and
/// least convergence of sides, across the sheet, for an estimate of it.
const FOCAL: [f64; 3] = [0.5, 0.85, 3.0];
const FLAT: f64 = 0.04;
/// Aspect ratios of paper that is sold, and the tolerance if the focal length is known, and if not.
const FORMATS: [f64; 4] = [std::f64::consts::SQRT_2, 11.0 / 8.5, 4.0 / 3.0, 1.0];
const NEAR_FORMAT: [f64; 2] = [0.05, 0.1];
/// Rim of the sheet that is cut off, by its longer side.
const RIM: f64 = 0.008;

/// The logarithm of a picture's brightness, made small.
struct Edges {
    /// Pixels of the picture by those of these edges.
    scale: [f64; 2],
    log: ImageBuffer<Luma<f32>, Vec<f32>>,
}

/// A straight line: the points whose product with its normal is its offset.
#[derive(Clone, Copy)]
struct Line {
    normal: [f64; 2],
    offset: f64,
}

/// The corners of a sheet that is completely in the picture; `None` if there is none.
pub(super) fn corners(picture: &RgbImage) -> Option<Corners> {
    let edges = Edges::new(picture);
    let lines = edges.lines();
    let [width, height] = edges.size();
    let mut pairs = Vec::new();
    for (k, a) in lines.iter().enumerate() {
        for b in &lines[k + 1..] {
            let along = dot(a.normal, b.normal);
            let apart = (a.offset - along.signum() * b.offset).abs();
            if along.abs() > SLANT && apart > LEAST_APART * width.max(height) {
                pairs.push([*a, *b]);
            }
        }
    }
    let mut best: Option<(f64, Corners)> = None;
    for (k, [a, c]) in pairs.iter().enumerate() {
        for [b, d] in &pairs[k + 1..] {
            if let Some(corners) = edges.quadrangle([*a, *b, *c, *d])
                && let Some(seen) = edges.seen(&corners)
                && best.is_none_or(|(most, _)| seen > most)
            {
                best = Some((seen, corners));
            }
        }
    }
    let corners = edges.refined(best?.1);
    Some(corners.map(|[x, y]| [x * edges.scale[0], y * edges.scale[1]]))
}

impl Edges {
    #[expect(clippy::cast_possible_truncation, reason = "a logarithm")]
    fn new(picture: &RgbImage) -> Self {
        let longer = picture.width().max(picture.height());
        let [width, height] =
            [picture.width(), picture.height()].map(|side| (side * SIDE / longer.max(SIDE)).max(3));
        let small = thumbnail(picture, width, height);
        let log = small.pixels().map(|pixel| {
            let [r, g, b] = pixel.0.map(f64::from);
            libm::log(8.0 + 0.299 * r + 0.587 * g + 0.114 * b)
        });
        // Without thin dark lines: rulings and drawn frames are not sides of a sheet.
        let log = closed(&log.collect::<Vec<f64>>(), width as usize, PEN);
        let log = softened(&log, width as usize);
        let log = ImageBuffer::from_fn(width, height, |x, y| {
            Luma([log[(y * width + x) as usize] as f32])
        });
        let scale = [(picture.width(), width), (picture.height(), height)]
            .map(|(n, small)| f64::from(n) / f64::from(small));
        Self { scale, log }
    }

    fn size(&self) -> [f64; 2] {
        [self.log.width(), self.log.height()].map(f64::from)
    }

    /// How much brighter it is inward of a place than outward, some pixels away.
    fn rise(&self, place: [f64; 2], inward: [f64; 2], away: f64) -> f64 {
        let [within, without] = [away, -away].map(|away| {
            let pixel = between_pixels(&self.log, ahead(place, inward, away));
            pixel.map_or(0.0, |Luma([log])| f64::from(log))
        });
        within - without
    }

    /// The lines with the strongest gradient across them.
    fn lines(&self) -> Vec<Line> {
        let (width, height) = (self.log.width(), self.log.height());
        let mut gradients = Vec::new();
        for (y, x) in (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (y, x))) {
            let [right, left, below, above] = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
                .map(|(x, y)| f64::from(self.log.get_pixel(x, y).0[0]));
            let gradient = [right - left, below - above];
            let strength = libm::hypot(gradient[0], gradient[1]);
            gradients.push(([x, y].map(|x| f64::from(x) + 0.5), gradient, strength));
        }
        let mut sorted: Vec<f64> = gradients.iter().map(|(.., strength)| *strength).collect();
        sorted.sort_by(f64::total_cmp);
        #[expect(clippy::cast_possible_truncation, reason = "an index")]
        let weak = sorted[(WEAK * (sorted.len() - 1) as f64) as usize].max(0.5 * EDGE);
        let middle = (width + height) as usize;
        let n_offsets = 2 * middle;
        let mut votes = vec![0.0; ANGLES * n_offsets];
        #[expect(clippy::cast_possible_truncation, reason = "within the votes")]
        for ([x, y], [gx, gy], strength) in gradients.iter().filter(|it| it.2 > weak) {
            let angle = libm::atan2(*gy, *gx);
            for step in -2..=2_i32 {
                let turned = angle + f64::from(step) * PI / ANGLES as f64;
                let k = libm::floor(turned / PI * ANGLES as f64).rem_euclid(ANGLES as f64) as usize;
                let [nx, ny] = normal(k);
                let offset = (nx * x + ny * y).round() + middle as f64;
                votes[k.min(ANGLES - 1) * n_offsets + offset as usize] += strength.min(8.0 * weak);
            }
        }
        let mut lines = Vec::new();
        for _ in 0..LINES {
            let most = (0..votes.len()).max_by(|a, b| votes[*a].total_cmp(&votes[*b])).unwrap_or(0);
            if votes[most] <= 0.0 {
                break;
            }
            let (k, offset) = (most / n_offsets, most % n_offsets);
            let line = Line { normal: normal(k), offset: offset as f64 - middle as f64 };
            for beside in 0..=2 * APART[0] {
                let wrapped = k + ANGLES + beside - APART[0];
                let other = wrapped % ANGLES;
                // Half a turn further, a line's offset has the other sign.
                let flips = !(ANGLES..2 * ANGLES).contains(&wrapped);
                let offset = if flips { n_offsets - offset } else { offset };
                let end = (offset + APART[1] + 1).min(n_offsets);
                let offsets = offset.saturating_sub(APART[1])..end;
                offsets.for_each(|offset| votes[other * n_offsets + offset] = 0.0);
            }
            lines.push(line);
        }
        lines
    }

    /// The corners of four lines in turn, clockwise from the upper left; `None` unless they can be
    /// a sheet.
    fn quadrangle(&self, lines: [Line; 4]) -> Option<Corners> {
        let corners = [0, 1, 2, 3].map(|k| crossing(lines[(k + 3) % 4], lines[k]));
        let [Some(a), Some(b), Some(c), Some(d)] = corners else { return None };
        let mut corners = [a, b, c, d];
        let [right, bottom] = self.size();
        let slack = OUTSIDE * right.max(bottom);
        let [across, down] = [right, bottom].map(|side| -slack..side + slack);
        if !corners.iter().all(|[x, y]| across.contains(x) && down.contains(y)) {
            return None;
        }
        let area = area(&corners);
        if area < 0.0 {
            corners.reverse();
        }
        let sides = [0, 1, 2, 3].map(|k| direction(corners[k], corners[(k + 1) % 4]));
        let turns = (0..4).all(|k| {
            let (a, b) = (sides[k], sides[(k + 1) % 4]);
            cross(a, b) > 0.0 && dot(a, b).abs() < SLANT
        });
        if !turns || area.abs() < LEAST_AREA * right * bottom {
            return None;
        }
        // The upper side is the one that looks upward most.
        let first = (0..4).max_by(|a, b| sides[*a][0].total_cmp(&sides[*b][0]))?;
        corners.rotate_left(first);
        Some(corners)
    }

    /// Score of a quadrangle: the length of its sides that is brighter inside than outside, with
    /// more weight for clear edges, less the rest; `None` below the threshold.
    fn seen(&self, corners: &Corners) -> Option<f64> {
        let [mut seen, mut whole, mut balance] = [0.0; 3];
        for k in 0..4 {
            let (from, to) = (corners[k], corners[(k + 1) % 4]);
            let [dx, dy] = direction(from, to);
            let inward = [-dy, dx];
            let rises = (0..POINTS).map(|j| {
                let place = on_side(from, to, f64::from(j));
                let rises = ACROSS.map(|across| self.rise(place, inward, across));
                rises.into_iter().fold(f64::MAX, f64::min)
            });
            let edges: Vec<f64> = rises.filter(|rise| *rise > EDGE).collect();
            let n = edges.len() as f64 / f64::from(POINTS);
            if n < SEEN[0] {
                return None;
            }
            let clear = edges.iter().map(|rise| (rise / CLEAR).min(1.0)).sum::<f64>();
            let length = distance(from, to);
            seen += n * length;
            whole += length;
            balance += (clear / f64::from(POINTS) + n - 1.0) * length;
        }
        (seen > SEEN[1] * whole).then_some(balance)
    }

    /// The corners of the sides moved to where the brightness changes most across them.
    fn refined(&self, corners: Corners) -> Corners {
        let sides = [0, 1, 2, 3].map(|k| {
            let [a, b] = [corners[k], corners[(k + 1) % 4]];
            let [dx, dy] = direction(a, b);
            let inward = [-dy, dx];
            let mut best = (0.0, [a, b]);
            for (i, j) in (0..=SHIFTS).flat_map(|i| (0..=SHIFTS).map(move |j| (i, j))) {
                let [from, to] = [(a, i), (b, j)].map(|(end, n)| {
                    ahead(end, inward, 0.5 * f64::from(n) - 0.25 * f64::from(SHIFTS))
                });
                let rises = (2..POINTS - 2).map(|piece| {
                    self.rise(on_side(from, to, f64::from(piece)), inward, 1.0).max(0.0)
                });
                let rise: f64 = rises.sum();
                if rise > best.0 {
                    best = (rise, [from, to]);
                }
            }
            let [from, to] = best.1;
            let [ux, uy] = direction(from, to);
            Line { normal: [-uy, ux], offset: -uy * from[0] + ux * from[1] }
        });
        [0, 1, 2, 3].map(|k| crossing(sides[(k + 3) % 4], sides[k]).unwrap_or(corners[k]))
    }
}

/// Whether four corners follow each other clockwise around something.
pub(super) fn is_convex(corners: &Corners) -> bool {
    (0..4).all(|k| {
        let [a, b, c] = [0, 1, 2].map(|step| corners[(k + step) % 4]);
        cross(minus(b, a), minus(c, b)) > 1.0
    })
}

/// The picture of a sheet seen square on, without its rim.
pub(super) fn square_on(picture: &RgbImage, corners: &Corners) -> RgbImage {
    let (width, height) = (f64::from(picture.width()), f64::from(picture.height()));
    let map = Map::to(corners);
    let ratio = map.ratio([0.5 * width, 0.5 * height]);
    let [top, bottom, left, right] =
        [[0, 1], [3, 2], [0, 3], [1, 2]].map(|[a, b]| distance(corners[a], corners[b]));
    let (across, down) = (top.max(bottom), left.max(right));
    // As many pixels as the sheet has in the picture.
    let high = libm::sqrt(across * down / ratio).max(8.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a picture's side")]
    let [wide, high] = [high * ratio, high].map(|side| side.round().clamp(8.0, 4096.0) as u32);
    let map = back(corners, (wide, high));
    RgbImage::from_fn(wide, high, |x, y| {
        let place = map.apply([x, y].map(|x| f64::from(x) + 0.5));
        between_pixels(picture, place).unwrap_or(Rgb([0; 3]))
    })
}

/// The map from the pixels of the square sheet to those of the photograph.
pub(super) fn back(corners: &Corners, (wide, high): (u32, u32)) -> Map {
    let [across, down] = [wide, high].map(|side| (1.0 - 2.0 * RIM) / f64::from(side));
    Map(Map::to(corners).0.map(|[x, y, one]| [across * x, down * y, one + RIM * (x + y)]))
}

/// The value at a place between the middles of pixels; beyond the picture, that of its rim.
#[expect(clippy::cast_possible_truncation, reason = "a picture's side")]
fn between_pixels<P: image::Pixel>(
    picture: &impl image::GenericImageView<Pixel = P>,
    [x, y]: [f64; 2],
) -> Option<P> {
    let [x, y] = [(x, picture.width()), (y, picture.height())]
        .map(|(x, side)| (x - 0.5).clamp(0.0, f64::from(side - 1)) as f32);
    interpolate_bilinear(picture, x, y)
}

/// From the unit square to a quadrangle (Heckbert, Fundamentals of Texture Mapping, 1989).
pub(super) struct Map(pub(super) [[f64; 3]; 3]);

impl Map {
    pub(super) fn to(corners: &Corners) -> Self {
        let [[x0, y0], [x1, y1], [x2, y2], [x3, y3]] = *corners;
        let (dx1, dx2, sx) = (x1 - x2, x3 - x2, x0 - x1 + x2 - x3);
        let (dy1, dy2, sy) = (y1 - y2, y3 - y2, y0 - y1 + y2 - y3);
        let determinant = dx1 * dy2 - dx2 * dy1;
        let (g, h) = ((sx * dy2 - dx2 * sy) / determinant, (dx1 * sy - sx * dy1) / determinant);
        Self([
            [x1 - x0 + g * x1, x3 - x0 + h * x3, x0],
            [y1 - y0 + g * y1, y3 - y0 + h * y3, y0],
            [g, h, 1.0],
        ])
    }

    pub(super) fn apply(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [x, y, w] = self.0.map(|row| row[0] * u + row[1] * v + row[2]);
        [x / w, y / w]
    }

    /// Aspect ratio of the rectangle, from its picture with this middle.
    fn ratio(&self, [cx, cy]: [f64; 2]) -> f64 {
        let [[ax, ay, aw], [bx, by, bw]] = [0, 1].map(|k| {
            let [x, y, w] = [0, 1, 2].map(|row| self.0[row][k]);
            [x - cx * w, y - cy * w, w]
        });
        // The focal length at which the sides are at a right angle; unknown if two of them are
        // parallel in the picture.
        let longer = 2.0 * cx.max(cy);
        let square = -(ax * bx + ay * by) / (aw * bw);
        let known = aw.abs().min(bw.abs()) > FLAT
            && (FOCAL[0]..FOCAL[2]).contains(&(libm::sqrt(square.max(0.0)) / longer));
        let square = if known { square } else { FOCAL[1] * longer * FOCAL[1] * longer };
        let ratio = libm::sqrt(
            (ax * ax + ay * ay + square * aw * aw) / (bx * bx + by * by + square * bw * bw),
        );
        let formats = FORMATS.into_iter().flat_map(|format| [format, 1.0 / format]);
        let formats = formats.map(|format| (libm::log(format / ratio).abs(), format));
        let nearest = formats.min_by(|a, b| a.0.total_cmp(&b.0));
        let near = NEAR_FORMAT[usize::from(!known)];
        nearest.filter(|(error, _)| *error < near).map_or(ratio, |(_, format)| format)
    }
}

fn normal(k: usize) -> [f64; 2] {
    let (sin, cos) = libm::sincos((k as f64 + 0.5) * PI / ANGLES as f64);
    [cos, sin]
}

/// Intersection of two lines; `None` for parallel ones.
fn crossing(a: Line, b: Line) -> Option<[f64; 2]> {
    let determinant = cross(a.normal, b.normal);
    (determinant.abs() > 0.2).then(|| {
        [
            (a.offset * b.normal[1] - b.offset * a.normal[1]) / determinant,
            (a.normal[0] * b.offset - b.normal[0] * a.offset) / determinant,
        ]
    })
}

/// The middle of one of the pieces of a side.
fn on_side(from: [f64; 2], to: [f64; 2], piece: f64) -> [f64; 2] {
    between(from, to, (piece + 0.5) / f64::from(POINTS))
}
