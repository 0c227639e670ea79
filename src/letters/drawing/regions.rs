//! Regions of ink and their levels, without rulings of the paper and shadows.
//!
//! A connected region of ink has a level, that of most of it, and its rim lies at half the level.
//! What is left of the region beyond that, away from the stronger ink, is searched again: a pale
//! line beside a dark one, or joined to it, is there. Pale ink has a sharp rim, which shadows have
//! not, and no ruling of the paper, which runs from side to side, is ink.

use std::f64::consts::PI;

use super::ink::{Field, RIM};
use super::levels::{connected, histogram, quantile};
use noctograph_core::geometry::bounds;

/// Share of a region's pixels that have less ink than its level; of one across the picture, which
/// may be a drawing on a ruling.
const LEVEL: f64 = 0.97;
const LEVEL_ACROSS: f64 = 0.995;
/// Pixels around stronger ink that may be its blur.
pub(super) const BLUR: usize = 3;
/// Pixels around a line's core that have its level; and from there to either side of it, where a
/// line that is faded is told from a tone.
const CORE: usize = 2;
const THIN: usize = 5;
/// Least level of a faded line, by that of its region: a ruling that joins strokes is weaker.
const FADED: f64 = 0.35;
/// How many levels a region of ink may have.
const LEVELS: usize = 4;
/// Share of strong ink below which a level is pale.
const PALE: f64 = 0.5;
/// Least slope of pale ink at its rim, a pixel by its level: at three quarters of the rim. A lens
/// and a thumbnail leave 0.2 and more, the edge of a shadow less than 0.05.
const SHARP: f64 = 0.09;
/// A region as wide or as tall as this share of the picture may be a ruling of the paper.
const ACROSS: f64 = 0.9;
/// Least width or height of a pale region, as a share of the picture's.
const PALE_EXTENT: f64 = 0.015;
/// Share of a pale region's rim along stronger ink beyond which it is the fill of an outline.
const WITHIN: f64 = 0.6;

/// Straight lines are rulings from this number on, weaker than this share of strong ink, within
/// this angle of each other and over this share of the picture; a line is straight by its second
/// moments along and across.
const RULINGS: usize = 8;
const RULING: f64 = 0.65;
const PARALLEL_RAD: f64 = 0.06;
const SPREAD: f64 = 0.6;
const STRAIGHT: f64 = 20.0;
/// Length of what may be left of a ruling, as a share of the picture's width or height.
const LEFT_OVER: f64 = 0.12;
/// Extent of a piece of a ruling and of a speck at the edge of a shadow; and pixels from the
/// picture's rim at which a line ends there.
const PIECE: f64 = 0.25;
const SPECK: f64 = 0.05;
const AT_RIM: usize = 4;
/// A line is fine where there is paper so many pixels beside each of its own, but where lines
/// cross.
const FINE: usize = 3;
const CROSSINGS: f64 = 0.1;
/// Most pale regions of a drawing.
const MOST_PALE: usize = 80;

impl Field {
    /// Finds the regions of ink of at least so many pixels; `strong` is the contrast of strong ink.
    /// Whether pale lines were left out that are rulings of the paper, and how many pale areas
    /// across the picture.
    pub(super) fn find(&mut self, strong: f64, least_area: usize) -> (bool, usize) {
        let mut search = Search {
            field: self,
            pale: PALE * strong,
            least_area,
            open: vec![false; self.contrast.len()],
            near: vec![0; self.contrast.len()],
            regions: Vec::new(),
            is_ruled: false,
            n_across: 0,
        };
        let all: Vec<usize> =
            (0..self.contrast.len()).filter(|at| self.contrast[*at] > self.least).collect();
        for part in search.parts(&all) {
            search.split(part, 0);
        }
        search.leave_out_rulings();
        let left_out = (search.is_ruled, search.n_across);
        let mut levels = vec![f64::INFINITY; self.contrast.len()];
        for Region { pixels, level, .. } in &search.regions {
            for at in pixels {
                let level = level.min(search.own_level(*at, *level));
                for near in self.around(*at, CORE) {
                    levels[near] = levels[near].min(level);
                }
            }
        }
        let ink = self.contrast.iter().zip(&levels).map(|(ink, level)| (ink / level).min(1.0));
        self.ink = ink.collect();
        left_out
    }
}

/// A connected region of ink.
struct Region {
    pixels: Vec<usize>,
    level: f64,
    is_pale: bool,
    /// Of a straight line that may be a ruling.
    direction: Option<f64>,
}

/// A search for regions of ink and their levels.
struct Search<'a> {
    field: &'a Field,
    /// Contrast below which ink is pale.
    pale: f64,
    least_area: usize,
    /// The set of pixels that is looked at; empty between two looks.
    open: Vec<bool>,
    /// The last region, from 1, in whose surroundings a pixel is; 0: none.
    near: Vec<usize>,
    regions: Vec<Region>,
    is_ruled: bool,
    n_across: usize,
}

impl Search<'_> {
    /// Connected parts of a set of pixels, those that are large enough.
    fn parts(&mut self, pixels: &[usize]) -> Vec<Vec<usize>> {
        pixels.iter().for_each(|at| self.open[*at] = true);
        let (open, width) = (&mut self.open, self.field.width);
        let parts = pixels.iter().map(|start| connected(*start, open, width));
        parts.filter(|part| part.len() >= self.least_area).collect()
    }

    /// Splits a connected part by its levels.
    fn split(&mut self, part: Vec<usize>, depth: usize) {
        let contrast = &self.field.contrast;
        let counts = histogram(part.iter().map(|at| 255.0 * contrast[*at]));
        let extent = self.extent(&part);
        let is_across = extent > ACROSS;
        let share = if is_across { LEVEL_ACROSS } else { LEVEL };
        let most = (quantile(&counts, share) as f64 + 1.0) / 255.0;
        let half = (RIM * most).max(self.field.least);
        let is_pale = most < self.pale;
        if is_pale && (is_across || extent < PALE_EXTENT || self.is_blurred(&part, most)) {
            if is_across && !self.is_blurred(&part, most) {
                let is_fine = self.is_fine(&part, half);
                self.is_ruled |= is_fine;
                self.n_across += usize::from(!is_fine);
            }
            return;
        }
        if is_across && self.is_weak(most) && self.is_fine(&part, half) {
            self.is_ruled = true;
            return;
        }
        // Rulings would be taken for faded lines.
        let faded = if is_across { half } else { (FADED * most).max(self.field.least) };
        let is_strong = |at: &usize| {
            let ink = contrast[*at];
            ink >= half || ink >= faded && ink >= RIM * self.own_level(*at, most)
        };
        let strong: Vec<usize> = part.iter().copied().filter(is_strong).collect();
        if depth > 0 && self.is_fill(&strong) {
            return;
        }
        // What is weak of a region across the picture is not looked into.
        self.is_ruled |= is_across
            && !self.field.is_plain
            && part.len() > 2 * strong.len()
            && self.is_fine(&part, self.field.least);
        let rest = if depth + 1 < LEVELS && !is_across {
            let region = self.regions.len() + 1;
            for near in strong.iter().flat_map(|at| self.field.around(*at, BLUR)) {
                self.near[near] = region;
            }
            part.into_iter().filter(|at| self.near[*at] != region).collect()
        } else {
            Vec::new()
        };
        self.regions.push(Region { pixels: strong, level: most, is_pale, direction: None });
        for part in self.parts(&rest) {
            self.split(part, depth + 1);
        }
    }

    /// Whether a level is that of a ruling.
    fn is_weak(&self, level: f64) -> bool {
        level < RULING / PALE * self.pale
    }

    /// Whether a part is nowhere thicker than a fine line.
    fn is_fine(&self, part: &[usize], least: f64) -> bool {
        let (contrast, width) = (&self.field.contrast, self.field.width);
        let last = contrast.len() - 1;
        let is_inner = |at: &&usize| {
            let (before, after) = (at.saturating_sub(FINE * width), (*at + FINE * width).min(last));
            let beside = [at.saturating_sub(FINE), (*at + FINE).min(last), before, after];
            beside.iter().all(|at| contrast[*at] >= least)
        };
        part.iter().filter(is_inner).count() as f64 <= CROSSINGS * part.len() as f64
    }

    /// The level of a pixel of a region: on a line where it is weak, that of the line there.
    fn own_level(&self, at: usize, level: f64) -> f64 {
        let (contrast, width, height) = (&self.field.contrast, self.field.width, self.field.height);
        let (x, y) = (at % width, at / width);
        let inside = (THIN..width - THIN).contains(&x) && (THIN..height - THIN).contains(&y);
        let is_ridge = |step: usize| {
            let beside = contrast[at - THIN * step].max(contrast[at + THIN * step]);
            contrast[at] > beside / RIM
        };
        if contrast[at] >= RIM * level
            || !inside
            || ![1, width, width - 1, width + 1].map(is_ridge).contains(&true)
        {
            return level;
        }
        self.field.around(at, CORE).map(|near| contrast[near]).fold(0.0, f64::max)
    }

    /// Leaves out pale regions that are straight, of one direction, many and all over the picture:
    /// rulings in pieces. Where still more than a hand draws is pale, it is the paper's texture.
    fn leave_out_rulings(&mut self) {
        let mut regions = std::mem::take(&mut self.regions);
        for region in &mut regions {
            let is_left_over = self.is_ruled && self.extent(&region.pixels) < LEFT_OVER;
            let is_weak = self.is_weak(region.level) || is_left_over;
            region.direction = self.direction(&region.pixels).filter(|_| is_weak);
        }
        let apart = |a: f64, b: f64| (a - b - PI * libm::round((a - b) / PI)).abs();
        let is_ruling = |of: f64| {
            let is_beside = |other: f64| apart(of, other) < PARALLEL_RAD;
            let lines = regions.iter().filter(|it| it.direction.is_some_and(is_beside));
            // One that ends at the picture's rim counts twice.
            let n: usize = lines.clone().map(|it| 1 + usize::from(self.is_at_rim(it))).sum();
            let pixels = lines.flat_map(|region| region.pixels.iter().copied());
            n >= RULINGS && self.extent(&pixels.collect::<Vec<_>>()) > SPREAD
        };
        let mut known: Vec<(f64, bool)> = Vec::new();
        let mut stays = |of: f64| {
            let near = known.iter().find(|(other, _)| apart(of, *other) < 0.2 * PARALLEL_RAD);
            let is_ruling = near.map_or_else(|| is_ruling(of), |(_, is_ruling)| *is_ruling);
            known.push((of, is_ruling));
            !is_ruling
        };
        let kept: Vec<bool> =
            regions.iter().map(|region| region.direction.is_none_or(&mut stays)).collect();
        let n_pale = regions.iter().zip(&kept).filter(|(it, kept)| it.is_pale && **kept).count();
        let keeps_pale = n_pale <= MOST_PALE;
        self.is_ruled |= kept.contains(&false) || !keeps_pale;
        let mut kept = kept.into_iter();
        regions.retain(|region| {
            let extent = || self.extent(&region.pixels);
            let is_straight = region.direction.is_some();
            // The sharp edge of a shadow leaves pieces of rulings, and specks at their crossings.
            let least = if is_straight { PIECE } else { SPECK };
            let is_piece = self.field.is_shaded && self.is_weak(region.level) && extent() <= least;
            // Where there are rulings, a short straight line that is as weak is left of one.
            let is_left_over = self.is_ruled && is_straight && extent() < LEFT_OVER;
            let stays = kept.next() == Some(true) && (keeps_pale || !region.is_pale);
            stays && !is_piece && !is_left_over
        });
        self.regions = regions;
    }

    /// The direction of a straight line in the picture, from its middle's second moments; `None`
    /// for another shape.
    fn direction(&self, pixels: &[usize]) -> Option<f64> {
        let n = pixels.len() as f64;
        let mean = [0, 1].map(|i| self.places(pixels).map(|place| place[i]).sum::<f64>() / n);
        let [mut xx, mut xy, mut yy] = [0.0; 3];
        for [x, y] in self.places(pixels) {
            let (dx, dy) = (x - mean[0], y - mean[1]);
            (xx, xy, yy) = (xx + dx * dx / n, xy + dx * dy / n, yy + dy * dy / n);
        }
        let spread = libm::hypot(0.5 * (xx - yy), xy);
        let [long, thin] = [1.0, -1.0].map(|sign| 0.5 * (xx + yy) + sign * spread);
        (long > STRAIGHT * thin.max(0.1)).then(|| 0.5 * libm::atan2(2.0 * xy, xx - yy))
    }

    /// Columns and rows of pixels.
    fn places(&self, pixels: &[usize]) -> impl Iterator<Item = [f64; 2]> {
        let width = self.field.width;
        pixels.iter().map(move |at| [(at % width) as f64, (at / width) as f64])
    }

    fn is_at_rim(&self, region: &Region) -> bool {
        let (width, height) = (self.field.width, self.field.height);
        let inner = |at: usize, n: usize| (AT_RIM..n - AT_RIM).contains(&at);
        !region.pixels.iter().all(|at| inner(at % width, width) && inner(at / width, height))
    }

    /// The larger of a part's width and height as shares of the picture's.
    fn extent(&self, part: &[usize]) -> f64 {
        let [left, top, right, bottom] = bounds(self.places(part));
        let [width, height] = [self.field.width, self.field.height].map(|side| side as f64);
        ((right - left) / width).max((bottom - top) / height)
    }

    /// Whether a region of a level has no sharp rim.
    fn is_blurred(&self, part: &[usize], most: f64) -> bool {
        let (contrast, width) = (&self.field.contrast, self.field.width);
        let height = self.field.height;
        // Beyond the picture there is no rim.
        let inside = |at: &&usize| {
            (2..width - 2).contains(&(*at % width)) && (2..height - 2).contains(&(*at / width))
        };
        let mut slopes = Vec::new();
        for at in part.iter().filter(inside) {
            let neighbors = [at - 1, at + 1, at - width, at + width].map(|at| contrast[at]);
            let half = RIM * most;
            if contrast[*at] >= half && neighbors.iter().any(|ink| *ink < half) {
                let [left, right, above, below] = neighbors;
                slopes.push(0.5 * libm::hypot(right - left, below - above) / most);
            }
        }
        slopes.sort_by(f64::total_cmp);
        slopes.get(slopes.len() / 4).is_none_or(|slope| *slope < SHARP)
    }

    /// Whether a region lies within stronger ink, which was found before it.
    fn is_fill(&mut self, part: &[usize]) -> bool {
        part.iter().for_each(|at| self.open[*at] = true);
        let beside = part.iter().flat_map(|at| self.field.around(*at, 1));
        let [mut rim, mut along] = [0_usize; 2];
        for next in beside.filter(|at| !self.open[*at]) {
            rim += 1;
            along += usize::from(self.field.around(next, 1).any(|at| self.near[at] > 0));
        }
        part.iter().for_each(|at| self.open[*at] = false);
        along as f64 > WITHIN * rim as f64
    }
}
