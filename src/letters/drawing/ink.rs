//! Ink: what of a picture differs from its paper, in lightness and in color, at every level.
//!
//! In each of red, green and blue, ink is what is darker than the paper around it (lighter, where
//! most of the picture is dark), and the channel in which it is most counts: yellow is as strong
//! as blue. The paper is estimated block by block, so that shadows are none; where the picture's
//! rim is of one color, that is the paper, and what differs from it to either side is ink.
//!
//! A connected region of ink has a level, that of most of it, and its rim lies at half the level.
//! What is left of the region beyond that, away from the stronger ink, is searched again: a pale
//! line beside a dark one, or joined to it, is there. Pale ink has a sharp rim, which shadows have
//! not, and no ruling of the paper, which runs from side to side, is ink.

use std::f64::consts::PI;

use image::{RgbImage, imageops};

use super::levels::{around, level, quantile, softened};
use super::paper::Paper;

/// Channels of a color.
const CHANNELS: usize = 3;

/// Largest difference of paper from the color of most of the rim, in levels of 255; the share of
/// the rim that has to be so near, and of the picture.
const SAME: i16 = 8;
const PLAIN_RIM: f64 = 0.6;
const PLAIN: f64 = 0.2;

/// Blocks along the longer side by which light ink is told from dark ink, and how much more than
/// the other it differs from the middle of its block.
const BLOCKS: usize = 24;
const SKEWED: f64 = 1.4;

/// Least ink, as a share of the paper's brightness: of paper that is estimated, and of plain
/// paper.
const LEAST: f64 = 0.10;
const LEAST_PLAIN: f64 = 0.07;
/// Least ink by the paper's grain.
const GRAINS: f64 = 6.0;

/// Tones between paper and strong ink, by the contrast of that; and how much they may change over
/// four pixels.
const BETWEEN: [f64; 2] = [0.2, 0.8];
const SLOW: f64 = 0.12;

/// Share of a region's pixels that have less ink than its level; of one across the picture, which
/// may be a drawing on a ruling.
const LEVEL: f64 = 0.97;
const LEVEL_ACROSS: f64 = 0.995;
/// Pixels around stronger ink that may be its blur.
const BLUR: usize = 3;
/// Pixels around a line's core that have its level; and from there to either side of it, where a
/// line that is faded is told from a tone.
const CORE: usize = 2;
const THIN: usize = 5;
/// Least level of a faded line, by that of its region: a ruling that joins strokes is weaker.
const FADED: f64 = 0.35;
/// How many levels a region of ink may have.
const LEVELS: usize = 4;
/// Share of the ink that is weaker than strong ink.
const STRONG: f64 = 0.97;
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
/// A line is fine where there is paper so many pixels beside each of its own, but where lines
/// cross.
const FINE: usize = 3;
const CROSSINGS: f64 = 0.1;
/// Most pale regions of a drawing.
const MOST_PALE: usize = 80;

/// The level at which a rim of ink lies, by that of the ink: see [`Field::ink`].
pub(super) const RIM: f64 = 0.5;

/// Ink pixel by pixel, with a margin of a pixel of paper.
pub(super) struct Field {
    pub(super) width: usize,
    pub(super) height: usize,
    /// By the level of the region it belongs to, 0 to 1; 0 where no region is near.
    pub(super) ink: Vec<f64>,
    /// Share of the paper's brightness that the ink takes, 0 to 1.
    pub(super) contrast: Vec<f64>,
    /// What the ink leaves of red, green and blue of the paper's; of light ink, its own.
    pub(super) color: Vec<[f64; CHANNELS]>,
    /// The least contrast of ink.
    least: f64,
    /// Whether the paper is of one color.
    pub(super) is_plain: bool,
}

impl Field {
    /// The ink of a picture; all of `ink` is 0 until [`Self::find`].
    pub(super) fn of(picture: &RgbImage) -> Self {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let channel = |c: usize| picture.pixels().map(move |pixel| f64::from(pixel.0[c]));
        let (w, h) = (width + 2, height + 2);
        let mut contrast = vec![0.0; w * h];
        let mut color = vec![[1.0; CHANNELS]; w * h];
        let place = |at: usize| (at / width + 1) * w + at % width + 1;
        let plain = plain_paper(picture);
        if let Some(paper) = plain {
            for c in 0..CHANNELS {
                let range = paper[c].max(255.0 - paper[c]);
                for (at, value) in
                    softened(&channel(c).collect::<Vec<_>>(), width).iter().enumerate()
                {
                    let ink = &mut contrast[place(at)];
                    *ink = ((value - paper[c]).abs() / range).max(*ink);
                    color[place(at)][c] = value / 255.0;
                }
            }
        } else {
            let luma = imageops::grayscale(picture);
            let is_light = is_light(&luma);
            let bright = |value: f64| if is_light { 255.0 - value } else { value };
            let channels =
                [0, 1, 2].map(|c| softened(&channel(c).map(bright).collect::<Vec<_>>(), width));
            let paper = Paper::of(&channels, width, height);
            for at in 0..width * height {
                let papers = paper.at(at % width, at / width);
                let mean = papers.iter().sum::<f64>() / CHANNELS as f64;
                for c in 0..CHANNELS {
                    let value = channels[c][at];
                    let ink = (papers[c] - value) / papers[c].max(mean);
                    contrast[place(at)] = contrast[place(at)].max(ink).min(1.0);
                    color[place(at)][c] = if is_light {
                        (255.0 - value) / 255.0
                    } else {
                        (value / papers[c]).min(1.0)
                    };
                }
            }
        }
        let grain = grain(&contrast, w);
        let least = if plain.is_some() { LEAST_PLAIN } else { LEAST }.max(GRAINS * grain);
        Self {
            width: w,
            height: h,
            ink: Vec::new(),
            contrast,
            color,
            least,
            is_plain: plain.is_some(),
        }
    }

    /// Otsu's threshold of the contrast, the one with the largest variance between ink and paper,
    /// and the contrast of its strong ink (IEEE Trans. SMC 9, 1979). `None` where ink and paper are
    /// hardly different.
    pub(super) fn threshold(&self) -> Option<(f64, f64)> {
        let mut counts = [0_usize; 256];
        self.contrast.iter().for_each(|ink| counts[level(255.0 * ink)] += 1);
        let total = self.contrast.len() as f64;
        let whole: f64 = (0..).zip(&counts).map(|(i, n)| f64::from(i) * *n as f64).sum();
        let (mut below, mut sum) = (0.0, 0.0);
        let mut best = (0.0, 0.0, 0.0);
        for (i, n) in (0..255).zip(&counts) {
            below += *n as f64;
            sum += f64::from(i) * *n as f64;
            let above = total - below;
            if above == 0.0 {
                break;
            }
            let ink = (whole - sum) / above;
            let apart = ink - sum / below;
            let variance = below * above * apart * apart;
            if variance > best.0 {
                best = (variance, apart / 255.0, (f64::from(i) + 0.5) / 255.0);
            }
        }
        let (_, apart, threshold) = best;
        (0..counts.len()).filter(|i| (*i as f64) < 255.0 * threshold).for_each(|i| counts[i] = 0);
        let strong = quantile(&counts, STRONG) as f64 / 255.0;
        (apart > self.least).then_some((threshold, strong))
    }

    /// Standard deviation of what is paper by a threshold, by the contrast of ink.
    pub(super) fn texture(&self, threshold: f64) -> f64 {
        let (paper, ink): (Vec<f64>, Vec<f64>) =
            self.contrast.iter().partition(|ink| **ink <= threshold);
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
        let (paper_mean, ink_mean) = (mean(&paper), mean(&ink));
        let squares: Vec<f64> = paper.iter().map(|x| (x - paper_mean) * (x - paper_mean)).collect();
        libm::sqrt(mean(&squares)) / (ink_mean - paper_mean)
    }

    /// Share of the picture in tones between paper and strong ink that change slowly, as shades do;
    /// 0 on plain paper.
    pub(super) fn tones(&self, strong: f64) -> f64 {
        let (contrast, width) = (&self.contrast, self.width);
        if self.is_plain {
            return 0.0;
        }
        let is_tone = |at: &usize| {
            let share = contrast[*at] / strong;
            let slope = libm::hypot(
                contrast[at + 2] - contrast[at - 2],
                contrast[at + 2 * width] - contrast[at - 2 * width],
            );
            (BETWEEN[0]..BETWEEN[1]).contains(&share) && slope < SLOW * strong
        };
        let inner = 2 * width..contrast.len() - 2 * width;
        inner.clone().filter(is_tone).count() as f64 / inner.len() as f64
    }

    /// Finds the regions of ink of at least so many pixels; `strong` is the contrast of strong ink.
    /// Whether pale lines were left out that are rulings of the paper.
    pub(super) fn find(&mut self, strong: f64, least_area: usize) -> bool {
        let mut search = Search {
            field: self,
            pale: PALE * strong,
            least_area,
            seen: vec![0; self.contrast.len()],
            n_seen: 0,
            near: vec![0; self.contrast.len()],
            n_near: 0,
            regions: Vec::new(),
            is_ruled: false,
        };
        let all: Vec<usize> =
            (0..self.contrast.len()).filter(|at| self.contrast[*at] > self.least).collect();
        for part in search.parts(&all) {
            search.split(part, 0);
        }
        search.leave_out_rulings();
        let is_ruled = search.is_ruled;
        let mut levels = vec![f64::INFINITY; self.contrast.len()];
        for Region { pixels, level, .. } in &search.regions {
            for at in pixels {
                let level = level.min(search.own_level(*at, *level));
                for near in around(*at, self.width, self.height, CORE) {
                    levels[near] = levels[near].min(level);
                }
            }
        }
        let ink = self.contrast.iter().zip(&levels).map(|(ink, level)| (ink / level).min(1.0));
        self.ink = ink.collect();
        is_ruled
    }
}

/// A connected region of ink.
struct Region {
    pixels: Vec<usize>,
    level: f64,
    is_pale: bool,
}

/// A search for regions of ink and their levels.
struct Search<'a> {
    field: &'a Field,
    /// Contrast below which ink is pale.
    pale: f64,
    least_area: usize,
    /// The last set of pixels that a pixel was in, and the number of sets so far.
    seen: Vec<u32>,
    n_seen: u32,
    /// The same of the surroundings of strong ink.
    near: Vec<u32>,
    n_near: u32,
    regions: Vec<Region>,
    is_ruled: bool,
}

impl Search<'_> {
    /// Connected parts of a set of pixels, those that are large enough.
    fn parts(&mut self, pixels: &[usize]) -> Vec<Vec<usize>> {
        self.n_seen += 1;
        let (open, done) = (self.n_seen, 0);
        pixels.iter().for_each(|at| self.seen[*at] = open);
        let mut parts = Vec::new();
        for start in pixels {
            if self.seen[*start] != open {
                continue;
            }
            self.seen[*start] = done;
            let mut part = vec![*start];
            let mut next = 0;
            while next < part.len() {
                for at in around(part[next], self.field.width, self.field.height, 1) {
                    if self.seen[at] == open {
                        self.seen[at] = done;
                        part.push(at);
                    }
                }
                next += 1;
            }
            if part.len() >= self.least_area {
                parts.push(part);
            }
        }
        parts
    }

    /// Splits a connected part by its levels.
    fn split(&mut self, part: Vec<usize>, depth: usize) {
        let contrast = &self.field.contrast;
        let mut counts = [0_usize; 256];
        part.iter().for_each(|at| counts[level(255.0 * contrast[*at])] += 1);
        let extent = self.extent(&part);
        let is_across = extent > ACROSS;
        let share = if is_across { LEVEL_ACROSS } else { LEVEL };
        let most = (quantile(&counts, share) as f64 + 1.0) / 255.0;
        let half = (RIM * most).max(self.field.least);
        let is_pale = most < self.pale;
        if is_pale && (is_across || extent < PALE_EXTENT || self.is_blurred(&part, most)) {
            self.is_ruled |= is_across && !self.is_blurred(&part, most);
            return;
        }
        if is_across && most < RULING / PALE * self.pale && self.is_fine(&part, half) {
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
        self.is_ruled |= is_across && !self.field.is_plain && part.len() > 2 * strong.len();
        let rest = if depth + 1 < LEVELS && !is_across {
            self.n_near += 1;
            for at in &strong {
                for near in around(*at, self.field.width, self.field.height, BLUR) {
                    self.near[near] = self.n_near;
                }
            }
            part.into_iter().filter(|at| self.near[*at] != self.n_near).collect()
        } else {
            Vec::new()
        };
        self.regions.push(Region { pixels: strong, level: most, is_pale });
        for part in self.parts(&rest) {
            self.split(part, depth + 1);
        }
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
        let near = around(at, width, height, CORE).map(|near| contrast[near]);
        near.fold(0.0, f64::max)
    }

    /// Leaves out pale regions that are straight, of one direction, many and all over the picture:
    /// rulings in pieces. Where still more than a hand draws is pale, it is the paper's texture.
    fn leave_out_rulings(&mut self) {
        let directions: Vec<Option<f64>> = self
            .regions
            .iter()
            .map(|region| {
                let is_weak = region.level < RULING / PALE * self.pale
                    || self.is_ruled && self.extent(&region.pixels) < LEFT_OVER;
                self.direction(&region.pixels).filter(|_| is_weak)
            })
            .collect();
        let apart = |a: f64, b: f64| (a - b - PI * libm::round((a - b) / PI)).abs();
        let is_ruling = |of: f64| {
            let is_beside = |direction: &Option<f64>| {
                direction.is_some_and(|other| apart(of, other) < PARALLEL_RAD)
            };
            let lines = self.regions.iter().zip(&directions).filter(|(_, of)| is_beside(of));
            let n = lines.clone().count();
            let pixels = lines.flat_map(|(region, _)| region.pixels.iter().copied());
            n >= RULINGS && self.extent(&pixels.collect::<Vec<_>>()) > SPREAD
        };
        let mut known: Vec<(f64, bool)> = Vec::new();
        let mut kept = Vec::new();
        for direction in &directions {
            let is_left_out = direction.is_some_and(|of| {
                let near = known.iter().find(|(other, _)| apart(of, *other) < 0.2 * PARALLEL_RAD);
                let found = near.map_or_else(|| is_ruling(of), |(_, found)| *found);
                known.push((of, found));
                found
            });
            kept.push(!is_left_out);
        }
        let n_pale =
            self.regions.iter().zip(&kept).filter(|(it, kept)| it.is_pale && **kept).count();
        let keeps_pale = n_pale <= MOST_PALE;
        self.is_ruled |= kept.contains(&false) || !keeps_pale;
        // Where there are rulings, a short straight line that is as weak is what is left of one.
        for ((kept, region), direction) in kept.iter_mut().zip(&self.regions).zip(&directions) {
            let is_left_over = direction.is_some() && self.extent(&region.pixels) < LEFT_OVER;
            *kept &= !(self.is_ruled && is_left_over);
        }
        let mut kept = kept.into_iter();
        self.regions.retain(|region| kept.next() == Some(true) && (keeps_pale || !region.is_pale));
    }

    /// The direction of a straight line in the picture, from its middle's second moments; `None`
    /// for another shape.
    fn direction(&self, pixels: &[usize]) -> Option<f64> {
        let width = self.field.width;
        let places = || pixels.iter().map(|at| [(at % width) as f64, (at / width) as f64]);
        let n = pixels.len() as f64;
        let mean = [0, 1].map(|i| places().map(|place| place[i]).sum::<f64>() / n);
        let [mut xx, mut xy, mut yy] = [0.0; 3];
        for [x, y] in places() {
            let (dx, dy) = (x - mean[0], y - mean[1]);
            (xx, xy, yy) = (xx + dx * dx / n, xy + dx * dy / n, yy + dy * dy / n);
        }
        let spread = libm::hypot(0.5 * (xx - yy), xy);
        let [long, thin] = [1.0, -1.0].map(|sign| 0.5 * (xx + yy) + sign * spread);
        (long > STRAIGHT * thin.max(0.1)).then(|| 0.5 * libm::atan2(2.0 * xy, xx - yy))
    }

    /// The larger of a part's width and height as shares of the picture's.
    fn extent(&self, part: &[usize]) -> f64 {
        let (width, height) = (self.field.width, self.field.height);
        let [mut left, mut top, mut right, mut bottom] = [width, height, 0, 0];
        for at in part {
            let (x, y) = (at % width, at / width);
            (left, right) = (left.min(x), right.max(x));
            (top, bottom) = (top.min(y), bottom.max(y));
        }
        let share = |from: usize, to: usize, side: usize| (to - from) as f64 / side as f64;
        share(left, right, width).max(share(top, bottom, height))
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
        self.n_seen += 1;
        let own = self.n_seen;
        part.iter().for_each(|at| self.seen[*at] = own);
        let [mut rim, mut along] = [0_usize; 2];
        for at in part {
            for next in around(*at, self.field.width, self.field.height, 1) {
                if self.seen[next] != own {
                    rim += 1;
                    let near = around(next, self.field.width, self.field.height, 1);
                    along += usize::from(near.into_iter().any(|at| self.near[at] > 0));
                }
            }
        }
        along as f64 > WITHIN * rim as f64
    }
}

/// The color of most of the rim, where rim and picture are mostly of that color: paper that needs
/// no estimate.
pub(super) fn plain_paper(picture: &RgbImage) -> Option<[f64; CHANNELS]> {
    let (width, height) = picture.dimensions();
    let is_rim = |x: u32, y: u32| x < 2 || y < 2 || x + 2 >= width || y + 2 >= height;
    let mut counts = [[0_usize; 256]; CHANNELS];
    for (x, y, pixel) in picture.enumerate_pixels() {
        if is_rim(x, y) {
            pixel.0.iter().zip(&mut counts).for_each(|(v, counts)| counts[usize::from(*v)] += 1);
        }
    }
    let paper = counts.map(|counts| quantile(&counts, 0.5));
    let is_paper = |pixel: &image::Rgb<u8>| {
        let apart = |(v, paper): (&u8, &usize)| i16::from(*v).abs_diff(level_i16(*paper));
        pixel.0.iter().zip(&paper).map(apart).all(|apart| apart <= SAME.unsigned_abs())
    };
    let [mut rim, mut plain_rim, mut plain] = [0.0; 3];
    for (x, y, pixel) in picture.enumerate_pixels() {
        let is_plain = f64::from(u8::from(is_paper(pixel)));
        plain += is_plain;
        if is_rim(x, y) {
            rim += 1.0;
            plain_rim += is_plain;
        }
    }
    let is_plain = plain_rim > PLAIN_RIM * rim && plain > PLAIN * f64::from(width * height);
    is_plain.then(|| paper.map(|level| level as f64))
}

fn level_i16(level: usize) -> i16 {
    i16::try_from(level).unwrap_or(i16::MAX)
}

/// Whether ink is lighter than its paper: where few of a block's pixels are far brighter than most
/// of it rather than darker; where both are alike, by the tone of most of the picture.
fn is_light(luma: &image::GrayImage) -> bool {
    let [width, height] = [luma.width() as usize, luma.height() as usize];
    let block = width.max(height).div_ceil(BLOCKS);
    let columns = width.div_ceil(block);
    let mut blocks = vec![[0_usize; 256]; columns * height.div_ceil(block)];
    for (x, y, pixel) in luma.enumerate_pixels() {
        let block = y as usize / block * columns + x as usize / block;
        blocks[block][usize::from(pixel.0[0])] += 1;
    }
    let mut whole = [0_usize; 256];
    let [mut darker, mut brighter] = [0.0; 2];
    for counts in &blocks {
        let [dark, most, bright] = [0.02, 0.5, 0.98].map(|share| quantile(counts, share) as f64);
        darker += most - dark;
        brighter += bright - most;
        whole.iter_mut().zip(counts).for_each(|(whole, n)| *whole += n);
    }
    if brighter.max(darker) > SKEWED * brighter.min(darker) {
        return brighter > darker;
    }
    let level = |share: f64| quantile(&whole, share) as f64;
    2.0 * level(0.5) < level(0.01) + level(0.99)
}

/// Standard deviation of the paper's grain: by the median difference of pixels, two apart.
fn grain(contrast: &[f64], width: usize) -> f64 {
    let mut counts = [0_usize; 256];
    let rows = contrast.chunks(width).flat_map(|row| row.iter().zip(row.iter().skip(2)));
    // In 4000ths, so that the finest grain has a level.
    rows.for_each(|(a, b)| counts[level(4000.0 * (a - b).abs())] += 1);
    1.05 * quantile(&counts, 0.5) as f64 / 4000.0
}
