//! Ink: what of a picture differs from its paper, in lightness and in color, at every level.
//!
//! In each of red, green and blue, ink is what is darker than the paper around it (lighter, where
//! most of the picture is dark), and the channel in which it is most counts: yellow is as strong
//! as blue. The paper is estimated block by block, so that shadows are none; where the picture's
//! rim is of one color, that is the paper, and what differs from it to either side is ink.
//!
//! Its regions and their levels are found by [`super::regions`].

use image::{RgbImage, imageops};

use super::levels::{around, histogram, quantile, softened};
use super::paper::{Edges, Paper};

/// Channels of a color.
const CHANNELS: usize = 3;

/// Largest difference of paper from the color of most of the rim, in levels of 255; the share of
/// the rim that has to be so near, and of the picture.
const SAME: f64 = 8.0;
const PLAIN_RIM: f64 = 0.6;
const PLAIN: f64 = 0.2;

/// Blocks along the longer side by which light ink is told from dark ink, and how much more than
/// the other it differs from the middle of its block.
const BLOCKS: usize = 24;
const SKEWED: f64 = 1.4;

/// Least contrast of light ink on paper of a middle tone, and the share of the picture that has it.
const LIGHT: f64 = 0.5;
const LIGHTS: f64 = 1e-3;

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

/// Share of the ink that is weaker than strong ink.
const STRONG: f64 = 0.97;

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
    pub(super) least: f64,
    /// Whether the paper is of one color.
    pub(super) is_plain: bool,
    /// Whether its ink is lighter than the paper.
    pub(super) is_light: bool,
    /// Whether sharp edges of shadows may cross the paper, which [`Edges::Sharp`] follows.
    pub(super) is_shaded: bool,
}

impl Field {
    /// The ink of a picture, by what edges shadows have on it; none is in `ink` until
    /// [`Self::find`].
    pub(super) fn of(picture: &RgbImage, edges: Edges) -> Self {
        let (width, height) = (picture.width() as usize + 2, picture.height() as usize + 2);
        let plain = plain_paper(picture);
        let is_light = plain.map_or_else(
            || has_light_ink(&imageops::grayscale(picture)),
            |paper| paper.iter().sum::<f64>() < 0.5 * 255.0 * CHANNELS as f64,
        );
        let (inks, is_shaded) = match plain {
            Some(paper) => (inks_on_plain(picture, paper), false),
            None => inks_of_both_kinds(picture)
                .map_or_else(|| inks(picture, is_light, edges), |inks| (inks, false)),
        };
        let mut contrast = vec![0.0; width * height];
        let mut color = vec![[1.0; CHANNELS]; width * height];
        for (row, inks) in (1..).zip(inks.chunks(width - 2)) {
            let first = row * width + 1;
            for (at, (ink, left)) in (first..).zip(inks) {
                (contrast[at], color[at]) = (*ink, *left);
            }
        }
        let least = if plain.is_some() { LEAST_PLAIN } else { LEAST };
        let least = least.max(GRAINS * grain(&contrast, width));
        let (ink, is_plain) = (Vec::new(), plain.is_some());
        Self { width, height, ink, contrast, color, least, is_plain, is_light, is_shaded }
    }

    /// A pixel and those within so many steps of it.
    pub(super) fn around(&self, at: usize, steps: usize) -> impl Iterator<Item = usize> {
        around(at, self.width, self.height, steps)
    }

    /// Otsu's threshold of the contrast, the one with the largest variance between ink and paper,
    /// and the contrast of its strong ink (IEEE Trans. SMC 9, 1979). `None` where ink and paper are
    /// hardly different.
    pub(super) fn threshold(&self) -> Option<(f64, f64)> {
        let mut counts = histogram(self.contrast.iter().map(|ink| 255.0 * ink));
        let total = self.contrast.len() as f64;
        let whole: f64 = (0..).zip(&counts).map(|(i, n)| f64::from(i) * *n as f64).sum();
        let (mut below, mut sum) = (0.0, 0.0);
        let mut best = (0.0, 0.0, 0.0);
        for (i, n) in (0..255).map(f64::from).zip(&counts) {
            below += *n as f64;
            sum += i * *n as f64;
            let above = total - below;
            if above == 0.0 {
                break;
            }
            let apart = (whole - sum) / above - sum / below;
            let variance = below * above * apart * apart;
            if variance > best.0 {
                best = (variance, apart / 255.0, (i + 0.5) / 255.0);
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
}

/// The ink of a pixel: its contrast, and what it leaves of red, green and blue.
type Inked = (f64, [f64; CHANNELS]);

/// The channels of a picture, softened.
fn channels(picture: &RgbImage, of: impl Fn(u8) -> f64) -> [Vec<f64>; CHANNELS] {
    [0, 1, 2].map(|c| {
        let values: Vec<f64> = picture.pixels().map(|pixel| of(pixel.0[c])).collect();
        softened(&values, picture.width() as usize)
    })
}

/// The ink of each pixel on plain paper, of which it differs to either side.
fn inks_on_plain(picture: &RgbImage, paper: [f64; CHANNELS]) -> Vec<Inked> {
    let channels = channels(picture, f64::from);
    let range = paper.map(|level| level.max(255.0 - level));
    let ink = |at: usize| {
        let values = [0, 1, 2].map(|c| channels[c][at]);
        let off = (0..CHANNELS).map(|c| (values[c] - paper[c]).abs() / range[c]);
        (off.fold(0.0, f64::max), values.map(|value| value / 255.0))
    };
    (0..channels[0].len()).map(ink).collect()
}

/// The ink of each pixel by the paper that is estimated around it, dark or light ink alone; and
/// whether edges of shadows cross it.
fn inks(picture: &RgbImage, is_light: bool, edges: Edges) -> (Vec<Inked>, bool) {
    let width = picture.width() as usize;
    let bright = |value: u8| if is_light { 255.0 - f64::from(value) } else { f64::from(value) };
    let channels = channels(picture, bright);
    let paper = Paper::of(&channels, width, edges);
    let ink = |at: usize| {
        let papers = paper.at(at % width, at / width);
        let mean = papers.iter().sum::<f64>() / CHANNELS as f64;
        let (mut most, mut left) = (0.0_f64, [0.0; CHANNELS]);
        for c in 0..CHANNELS {
            let value = channels[c][at];
            most = most.max((papers[c] - value) / papers[c].max(mean)).min(1.0);
            left[c] = if is_light { (255.0 - value) / 255.0 } else { (value / papers[c]).min(1.0) };
        }
        (most, left)
    };
    ((0..channels[0].len()).map(ink).collect(), paper.is_shaded())
}

/// The same of light and dark ink on paper of a middle tone, such as kraft paper; `None` where
/// there is no such paper, or no light ink.
fn inks_of_both_kinds(picture: &RgbImage) -> Option<Vec<Inked>> {
    let width = picture.width() as usize;
    let channels = channels(picture, f64::from);
    let paper = Paper::of_middle_tone(&channels, width)?;
    let mut n_light = 0.0;
    let ink = |at: usize| {
        let papers = paper.at(at % width, at / width);
        let (mut most, mut least_light) = (0.0_f64, 1.0_f64);
        for c in 0..CHANNELS {
            let off = channels[c][at] - papers[c];
            most = most.max(off.abs() / papers[c].max(255.0 - papers[c]));
            least_light = least_light.min(off / (255.0 - papers[c]).max(1.0));
        }
        n_light += f64::from(u8::from(least_light > LIGHT));
        (most.min(1.0), [0, 1, 2].map(|c| channels[c][at] / 255.0))
    };
    let inks: Vec<_> = (0..channels[0].len()).map(ink).collect();
    (n_light > LIGHTS * inks.len() as f64).then_some(inks)
}

/// The color of most of the rim, where rim and picture are mostly of that color: paper that needs
/// no estimate.
pub(super) fn plain_paper(picture: &RgbImage) -> Option<[f64; CHANNELS]> {
    let (width, height) = picture.dimensions();
    let is_rim = |x: u32, y: u32| x < 2 || y < 2 || x + 2 >= width || y + 2 >= height;
    let at_rim = || picture.enumerate_pixels().filter(|(x, y, _)| is_rim(*x, *y));
    let paper = [0, 1, 2].map(|c| {
        quantile(&histogram(at_rim().map(|(.., pixel)| f64::from(pixel.0[c]))), 0.5) as f64
    });
    let is_paper = |pixel: &image::Rgb<u8>| {
        pixel.0.iter().zip(paper).all(|(value, paper)| (f64::from(*value) - paper).abs() <= SAME)
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
    is_plain.then_some(paper)
}

/// Whether ink is lighter than its paper: where few of a block's pixels are far brighter than most
/// of it rather than darker; where both are alike, by the tone of most of the picture.
fn has_light_ink(luma: &image::GrayImage) -> bool {
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
    let rows = contrast.chunks(width).flat_map(|row| row.iter().zip(row.iter().skip(2)));
    // In 4000ths, so that the finest grain has a level.
    let counts = histogram(rows.map(|(a, b)| 4000.0 * (a - b).abs()));
    1.05 * quantile(&counts, 0.5) as f64 / 4000.0
}
