//! Ink: the pixels of a picture that differ from its paper in lightness or in color.
//!
//! If most of the picture's edge has one color, that is the paper, and everything darker or lighter
//! is ink. Otherwise the picture is a photograph with an adaptive threshold: a pixel is ink if it
//! is darker than its surroundings by a certain fraction (Bradley and Roth, Journal of Graphics
//! Tools 12, 2007), or lighter if the picture is mostly dark. The mean over a window would leave a
//! band along shadows and holes in filled shapes. Therefore the surroundings are a morphological
//! closing that is wider than a pen (black top-hat: Meyer, J. Histochem. Cytochem. 27, 1979). A
//! second closing, wider than any shape, distinguishes filled shapes from shadows by depth and hue.
//!
//! Contrast is that of the channel with the most, so that yellow counts as much as blue. Ink on a
//! background of several colors and the edge of a sheet are not modeled.

use std::ops::Range;

use image::RgbImage;
use image::imageops::grayscale;

use super::levels::{closed, extremes, quantile, softened};

/// Number of channels of a color.
const CHANNELS: usize = 3;

/// Maximum difference between a pixel and paper of one color, in levels out of 255.
const SAME_COLOR: f64 = 8.0;
/// Minimum fraction of the picture's edge, and of the whole picture, in the color of the paper.
const EVEN: [f64; 2] = [0.6, 0.2];

/// Number of blocks along the longer side, and minimum ratio of outliers of both kinds.
const BLOCKS: usize = 24;
const SKEWED: f64 = 1.4;
/// Minimum fraction of blocks that a bright area contains if it is paper.
const PAPER: f64 = 0.2;

/// Ratio of the picture's longer side to half the width of the widest pen and filled shape.
const PEN: u32 = 40;
const SHAPE: u32 = 3;
/// An area wider than a pen is shaded paper if it has at least this fraction of the light around
/// it, and if the fractions of its channels differ at most by this factor.
const SHADOW: f64 = 0.22;
const HUE: f64 = 1.3;

/// Minimum contrast of ink relative to the paper's brightness, for even paper and for photographs.
const LEAST: [f64; 2] = [0.07, 0.10];
/// Minimum contrast of ink relative to strong ink: on paper with grain, and if its edges are as
/// soft as those of a shadow or a glow. Rulings have less contrast.
const FAINT: [f64; 2] = [0.4, 0.55];
/// Minimum ratio of the smallest to the largest contrast around a soft edge.
const SOFT: f64 = 0.2;
/// Fraction of soft edges above which faint tones are not ink.
const SOFT_EDGES: f64 = 0.15;
/// Median change of contrast over two pixels above which paper has grain.
const GRAIN: f64 = 1e-3;
/// Quantile of the ink's contrast that is taken as the contrast of strong ink.
const STRONG: f64 = 0.97;

/// Soft tones between paper and strong ink, which change slowly.
struct Tones {
    /// Contrasts relative to that of strong ink.
    contrasts: Range<f64>,
    /// Changes of contrast from one side of a pixel to the other, relative to strong ink.
    changes: Range<f64>,
    /// Distance in pixels from a pixel to both sides.
    step: usize,
}
/// The soft tones of a photograph.
const PHOTO: Tones = Tones { contrasts: 0.2..0.8, changes: 0.0..0.12, step: 2 };
/// The soft tones of glare or a shadow on paper of one color, above the noise of a JPEG.
const GLARE: Tones = Tones { contrasts: 0.1..0.4, changes: 0.02..0.08, step: 6 };
/// Fraction of glare in a picture above which its paper does not count as one color.
const GLARING: f64 = 0.01;

/// Number of pixels on each side with which a pixel's ink is compared: more than a lens blurs.
const NEAR: usize = 3;

/// Minimum change of a color over four pixels at the edge between two inks.
const APART: f64 = 0.2;

/// Threshold at the edge of ink, relative to the ink (see [`Field::ink`]).
pub(super) const EDGE: f64 = 0.5;

/// Ink of each pixel, with a margin of one pixel of paper.
pub(super) struct Field {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Ink relative to the strongest ink around it, 0 to 1. Pale lines beside dark ones thus count.
    pub(super) ink: Vec<f64>,
    /// Fraction of the paper's brightness that the ink absorbs, 0 to 1.
    pub(super) contrast: Vec<f64>,
    /// Red, green and blue of the ink relative to the paper's, or those of light ink, 0 to 1.
    pub(super) color: Vec<[f64; CHANNELS]>,
    /// Fraction of the picture with marks that are too faint to be ink.
    pub(super) faint: f64,
    /// True for a photograph, whose paper does not have one color.
    pub(super) is_photo: bool,
    /// True for a photograph or a scan, false for a picture that was drawn on a screen.
    pub(super) has_grain: bool,
    /// Fraction of the picture with soft tones between paper and strong ink.
    pub(super) soft: f64,
}

impl Field {
    /// Returns the ink of a picture. Returns `None` if nothing differs from its paper.
    pub(super) fn new(picture: &RgbImage) -> Option<Self> {
        let Some(paper) = even_paper(picture) else { return Self::on_paper(picture, None) };
        let field = Self::on_paper(picture, Some(paper))?;
        // Soft tones on paper of one color reveal a photograph that is almost evenly lit.
        let has_glare = !field.has_grain && field.soft > GLARING;
        if has_glare { Self::on_paper(picture, None) } else { Some(field) }
    }

    /// Returns the ink on paper of one color, red, green and blue from 0 to 255, or in a photograph
    /// if `paper` is `None`. Returns `None` if there is no ink.
    fn on_paper(picture: &RgbImage, paper: Option<[f64; CHANNELS]>) -> Option<Self> {
        let (width, height) = (picture.width() as usize + 2, picture.height() as usize + 2);
        let (contrast, color) = match paper {
            Some(paper) => with_margin(&inks_on(picture, paper), width, height),
            None => with_margin(&inks(picture), width, height),
        };
        // The minimum contrast of ink depends on the strong ink and on the grain of the paper.
        let is_photo = paper.is_none();
        let least = LEAST[usize::from(is_photo)];
        let has_grain = is_photo || median_change(&contrast, width) > GRAIN;
        let inked = contrast.iter().filter(|contrast| **contrast > least);
        let strong = quantile(inked.map(|contrast| 255.0 * contrast), STRONG) / 255.0;
        // A pixel is compared with the strongest ink around it, or with the limit of faint ink if
        // that is higher.
        let levels = extremes(&contrast, width, NEAR, f64::max);
        let least_fraction = if has_grain {
            FAINT[0]
        } else if has_soft_edges(&contrast, &levels, width, least) {
            FAINT[1]
        } else {
            0.0
        };
        let faintest = least.max(least_fraction * strong);
        let ink = contrast.iter().zip(&levels);
        let ink = ink.map(|(contrast, level)| (contrast / level.max(faintest / EDGE)).min(1.0));
        let ink = ink.collect();
        let n_faint = levels.iter().filter(|level| (least..faintest).contains(*level)).count();
        let n_soft = n_soft(&contrast, width, strong, if has_grain { PHOTO } else { GLARE });
        let [faint, soft] = [n_faint, n_soft].map(|n| n as f64 / contrast.len() as f64);
        let field = Self { width, height, ink, contrast, color, faint, is_photo, has_grain, soft };
        (strong > 0.0).then_some(field)
    }

    /// Returns the number of pixels that lie on edges between two inks and have ink on all sides.
    pub(super) fn inner_edges(&self) -> usize {
        let within = extremes(&self.ink, self.width, NEAR, f64::min);
        let inner = (2 * self.width..within.len() - 2 * self.width).filter(|p| within[*p] > EDGE);
        let edges = inner.filter(|pixel| {
            [2, 2 * self.width].iter().any(|step| {
                let [after, before] = [pixel + step, pixel - step].map(|p| self.shade(p));
                (0..CHANNELS).any(|c| (after[c] - before[c]).abs() > APART)
            })
        });
        edges.count()
    }

    /// Returns the color of a pixel, 0 to 1 in each channel. In photographs, brightness is removed,
    /// as shadows change it.
    fn shade(&self, pixel: usize) -> [f64; CHANNELS] {
        let color = self.color[pixel];
        let light = if self.has_grain { color.iter().sum::<f64>().max(APART) } else { 1.0 };
        color.map(|value| value / light)
    }
}

/// The ink of a pixel: its contrast and its color.
type Inked = (f64, [f64; CHANNELS]);

/// Returns the contrasts and colors of inks inside a margin of one pixel of paper. The margin
/// gives every patch a closed contour. Width and height include the margin.
fn with_margin(inks: &[Inked], width: usize, height: usize) -> (Vec<f64>, Vec<[f64; CHANNELS]>) {
    let mut contrast = vec![0.0; width * height];
    let mut color = vec![[1.0; CHANNELS]; width * height];
    for (row, inks) in (1..).zip(inks.chunks(width - 2)) {
        for (pixel, ink) in (row * width + 1..).zip(inks) {
            (contrast[pixel], color[pixel]) = *ink;
        }
    }
    (contrast, color)
}

/// Returns the smoothed red, green and blue values of a picture, 0 to 255 or, if `is_negative` is
/// true, those of its negative.
fn channels(picture: &RgbImage, is_negative: bool) -> [Vec<f64>; CHANNELS] {
    [0, 1, 2].map(|c| {
        let values = picture.pixels().map(|pixel| f64::from(pixel.0[c]));
        let values = values.map(|value| if is_negative { 255.0 - value } else { value });
        softened(&values.collect::<Vec<_>>(), picture.width() as usize)
    })
}

/// Returns the color of the paper, 0 to 255, if most of the picture's edge and part of the picture
/// have it. Otherwise returns `None`.
fn even_paper(picture: &RgbImage) -> Option<[f64; CHANNELS]> {
    let edge: Vec<_> = edge_pixels(picture).map(|color| color.map(f64::from)).collect();
    let paper = [0, 1, 2].map(|c| quantile(edge.iter().map(|color| color[c]), 0.5));
    let is_paper =
        |color: &[f64; 3]| (0..CHANNELS).all(|c| (color[c] - paper[c]).abs() <= SAME_COLOR);
    let n_edge = edge.iter().filter(|color| is_paper(color)).count();
    let n_paper = picture.pixels().filter(|pixel| is_paper(&pixel.0.map(f64::from))).count();
    let is_even = n_edge as f64 > EVEN[0] * edge.len() as f64
        && n_paper as f64 > EVEN[1] * picture.pixels().len() as f64;
    is_even.then_some(paper)
}

/// Returns the ink of each pixel on paper of one color. The ink may be darker or lighter than the
/// paper.
fn inks_on(picture: &RgbImage, paper: [f64; CHANNELS]) -> Vec<Inked> {
    let channels = channels(picture, false);
    Vec::from_iter((0..channels[0].len()).map(|pixel| {
        let values = [0, 1, 2].map(|c| channels[c][pixel]);
        let contrasts =
            [0, 1, 2].map(|c| (values[c] - paper[c]).abs() / paper[c].max(255.0 - paper[c]));
        let most = contrasts.into_iter().fold(0.0, f64::max);
        (most.min(1.0), values.map(|value| value / 255.0))
    }))
}

/// Returns the ink of each pixel of a photograph relative to the paper around it. Either all ink is
/// darker than the paper, or all is lighter.
fn inks(picture: &RgbImage) -> Vec<Inked> {
    let is_light = has_light_ink(picture);
    let channels = channels(picture, is_light);
    let papers = paper_around(&channels, picture.dimensions()).into_iter().enumerate();
    Vec::from_iter(papers.map(|(pixel, paper)| {
        let values = [0, 1, 2].map(|c| channels[c][pixel]);
        // A dark channel of colored paper is noisy, so it is compared with the mean brightness.
        let mean = paper.iter().sum::<f64>() / CHANNELS as f64;
        let contrasts = [0, 1, 2].map(|c| (paper[c] - values[c]) / paper[c].max(mean));
        let most = contrasts.into_iter().fold(0.0, f64::max);
        let color = [0, 1, 2].map(|c| {
            if is_light { (255.0 - values[c]) / 255.0 } else { (values[c] / paper[c]).min(1.0) }
        });
        (most.min(1.0), color)
    }))
}

/// Returns the color of the paper around each pixel of a photograph, 0 to 255. `values` contains
/// the picture's channels row by row.
fn paper_around(
    values: &[Vec<f64>; CHANNELS],
    (width, height): (u32, u32),
) -> Vec<[f64; CHANNELS]> {
    // The paper is estimated both beside a pen's line and beside a filled shape.
    let (longer, width) = (width.max(height), width as usize);
    let [near, far] = [PEN, SHAPE].map(|part| {
        let paper = values.each_ref().map(|v| closed(v, width, longer.div_ceil(part) as usize));
        Vec::from_iter(
            (0..values[0].len()).map(|pixel| [0, 1, 2].map(|c| paper[c][pixel].max(1.0))),
        )
    });
    // An area wider than a pen is a filled shape, including its edge, unless it is a shadow.
    let filled = near.iter().zip(&far).map(|(near, far)| {
        let lights = [0, 1, 2].map(|c| near[c] / far[c]);
        let [least, most] =
            [f64::min, f64::max].map(|extreme| lights.into_iter().fold(lights[0], extreme));
        let is_dark = lights.iter().sum::<f64>() < SHADOW * CHANNELS as f64;
        f64::from(u8::from(is_dark || most > HUE * least))
    });
    let with_edge = extremes(&filled.collect::<Vec<f64>>(), width, NEAR, f64::max);
    let papers = near.into_iter().zip(far).zip(with_edge);
    papers.map(|((near, far), filled)| if filled > 0.0 { far } else { near }).collect()
}

/// True if ink is lighter than its paper. This is judged from the blocks within a large bright
/// area, which is paper on a desk. Without such an area it is judged from all blocks or, if these
/// are inconclusive, from the picture's edge.
fn has_light_ink(picture: &RgbImage) -> bool {
    let luma = grayscale(picture);
    let [width, height] = [luma.width() as usize, luma.height() as usize];
    let block = width.max(height).div_ceil(BLOCKS);
    // The tones of each block are measured separately, because the light changes from block to
    // block.
    let corners =
        (0..height).step_by(block).flat_map(|y| (0..width).step_by(block).map(move |x| (x, y)));
    let blocks: Vec<[f64; 3]> = corners
        .map(|(left, top)| {
            let rows = luma.chunks(width).skip(top).take(block);
            extreme_tones(rows.flat_map(|row| row[left..].iter().take(block)).copied())
        })
        .collect();
    let [dark, _, bright] = extreme_tones(luma.iter().copied());
    let middle = 0.5 * (dark + bright);
    // The blocks along the border of the bright area are excluded, because they are partly desk.
    let is_bright: Vec<f64> =
        blocks.iter().map(|block| f64::from(u8::from(block[1] > middle))).collect();
    let within = extremes(&is_bright, width.div_ceil(block), 1, f64::min);
    let on_paper = blocks
        .iter()
        .zip(&within)
        .filter(|(_, is_within)| **is_within > 0.0)
        .map(|(block, _)| block);
    let is_sheet = on_paper.clone().count() as f64 > PAPER * blocks.len() as f64;
    let edge = edge_pixels(picture).map(|[r, g, b]| f64::from(r) + f64::from(g) + f64::from(b));
    let edge_is_dark = || quantile(edge.map(|sum| sum / CHANNELS as f64), 0.5) < middle;
    let on_sheet = if is_sheet { is_skewed_to_bright(on_paper) } else { None };
    on_sheet.or_else(|| is_skewed_to_bright(blocks.iter())).unwrap_or_else(edge_is_dark)
}

/// True if the few outlying pixels of blocks are brighter than the rest, and false if they are
/// darker. Returns `None` if both kinds are about equal.
fn is_skewed_to_bright<'a>(blocks: impl Iterator<Item = &'a [f64; 3]>) -> Option<bool> {
    let (mut darker, mut brighter) = (0.0, 0.0);
    for [dark, usual, bright] in blocks {
        (darker, brighter) = (darker + usual - dark, brighter + bright - usual);
    }
    let is_clear = brighter.max(darker) > SKEWED * brighter.min(darker);
    is_clear.then_some(brighter > darker)
}

/// Returns the 2nd, 50th and 98th percentiles of tones, 0 to 255.
fn extreme_tones(tones: impl Iterator<Item = u8> + Clone) -> [f64; 3] {
    [0.02, 0.5, 0.98].map(|rank| quantile(tones.clone().map(f64::from), rank))
}

/// Returns the colors of the pixels at the edge of a picture.
fn edge_pixels(picture: &RgbImage) -> impl Iterator<Item = [u8; 3]> {
    let (width, height) = picture.dimensions();
    let edge = picture.enumerate_pixels().filter(move |(x, y, _)| {
        [(*x, width), (*y, height)].iter().any(|(place, side)| *place < 2 || place + 2 >= *side)
    });
    edge.map(|(.., pixel)| pixel.0)
}

/// Returns the number of pixels with slowly changing tones between paper and strong ink. `strong`
/// is the contrast of strong ink, 0 to 1. `width` is that of the picture in pixels.
fn n_soft(contrast: &[f64], width: usize, strong: f64, tones: Tones) -> usize {
    let Tones { contrasts, changes, step } = tones;
    let inner = step * width..contrast.len().saturating_sub(step * width);
    let soft = inner.filter(|pixel| {
        let change = |offset: usize| contrast[pixel + offset] - contrast[pixel - offset];
        contrasts.contains(&(contrast[*pixel] / strong))
            && changes.contains(&(libm::hypot(change(step), change(step * width)) / strong))
    });
    soft.count()
}

/// Returns the median difference between the contrasts of pixels that are two apart in a row, 0 to
/// 1.
fn median_change(contrast: &[f64], width: usize) -> f64 {
    let pairs = contrast.chunks(width).flat_map(|row| row.iter().zip(&row[2..]));
    /// Levels of quantiles per unit of contrast. Even the finest grain is at least one level.
    const LEVELS: f64 = 4000.0;
    quantile(pairs.map(|(a, b)| LEVELS * (a - b).abs()), 0.5) / LEVELS
}

/// True if many edges of the ink, which has a contrast above `least`, are soft: no pixel nearby has
/// much less contrast than the strongest one. `levels` are the maximum contrasts around each pixel.
fn has_soft_edges(contrast: &[f64], levels: &[f64], width: usize, least: f64) -> bool {
    let weakest = extremes(contrast, width, NEAR, f64::min);
    let edges = (width..contrast.len()).filter(|pixel| {
        let before = [contrast[pixel - 1], contrast[pixel - width]];
        before.iter().any(|before| (*before > least) != (contrast[*pixel] > least))
    });
    let n_soft = edges.clone().filter(|pixel| weakest[*pixel] > SOFT * levels[*pixel]).count();
    n_soft as f64 > SOFT_EDGES * edges.count() as f64
}
