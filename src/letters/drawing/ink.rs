//! Ink: the pixels of a picture that differ from its paper, in lightness and in color.
//!
//! If the picture's rim has one even color, that is the paper, and everything darker or lighter is
//! ink. Otherwise the ink is darker than the paper around it (lighter, if most of the picture is
//! dark). The paper is then a morphological closing of the picture, wider than a pen, which keeps
//! the edges of shadows. This is done for red, green and blue, and the strongest channel counts:
//! yellow is as strong as blue.
//!
//! Much fainter marks than the rest are no ink on paper that has grain, or where rims are soft, as
//! those of a shadow or a glow. Pale lines from rim to rim of a picture from a screen are rulings.

use std::ops::Range;

use image::RgbImage;
use image::imageops::{grayscale, thumbnail};

use super::levels::{closed, extremes, quantile, softened};

/// Channels of a color.
const CHANNELS: usize = 3;

/// Largest difference of even paper from the color of its sides, in levels of 255; the share of the
/// rim that has to be so near, and of the picture.
const SAME: f64 = 8.0;
const EVEN_RIM: f64 = 0.6;
const EVEN: f64 = 0.2;
/// Tones of unevenly lit paper on which light ink shows as well as dark ink.
const MIDDLE: [f64; 2] = [70.0, 155.0];

/// Blocks along the longer side for the decision between light and dark ink, and the least ratio of
/// their contrasts.
const BLOCKS: usize = 24;
const SKEWED: f64 = 1.4;

/// The picture's longer side in half widths of the widest pen, and of the widest patch of ink;
/// pixels across one of the smaller picture for patches.
const PEN: u32 = 40;
const PATCH: u32 = 3;
const COARSE: u32 = 4;
/// An area wider than a pen is paper in shadow if it has at least this share of the light around
/// it, and its channels' shares differ by no more than this ratio.
const SHADOW: f64 = 0.22;
const HUE: f64 = 1.3;

/// Least contrast of ink, as a share of the paper's brightness: of a picture from a screen, of one
/// that was photographed or scanned; the largest grain of a picture from a screen; and the least
/// contrast by the grain of the paper and by the strong ink, of a photograph and of a picture from
/// a screen with soft rims. Rulings are weaker.
const LEAST: [f64; 2] = [0.07, 0.10];
const CLEAN: f64 = 0.001;
const GRAINS: f64 = 6.0;
const FAINT: [f64; 2] = [0.4, 0.55];
type Tones = (Range<f64>, Range<f64>, usize);
/// Tones between paper and strong ink, by the contrast of that, and how much they change over so
/// many pixels to both sides: those of a photograph, and those of a glare or a soft shadow
/// on even paper, which are more than the noise of a JPEG; and the share of a picture in the latter
/// from which its paper is no longer even.
const PHOTO: Tones = (0.2..0.8, 0.0..0.12, 2);
const GLARE: Tones = (0.1..0.4, 0.02..0.08, 6);
const SOFT: f64 = 0.01;

/// A rim is soft, as that of a shadow or a glow, where the least contrast around it is at least
/// this share of the most; the share of such rims from which on a picture's faint tones are no ink.
const SOFT_RIM: f64 = 0.2;
const SOFT_RIMS: f64 = 0.15;

/// Fewest rulings of a paper, the share of a row or column that one covers, its largest contrast by
/// that of strong ink, and by its own the contrast from which on ink crosses it.
const RULINGS: usize = 4;
const ACROSS: f64 = 0.85;
const PALE: f64 = 0.6;
const CROSSED: f64 = 1.2;

/// Share of the ink that is weaker than strong ink.
const STRONG: f64 = 0.97;

/// Radius in pixels of the neighborhood whose strongest ink is a pixel's level: more than the blur
/// of a lens.
const NEAR: usize = 3;

/// Least change of a color over four pixels that is the edge of another ink.
const APART: f64 = 0.2;

/// Threshold of the rim of ink, relative to the ink: see [`Field::ink`].
pub(super) const RIM: f64 = 0.5;

/// Ink pixel by pixel, with a margin of a pixel of paper.
pub(super) struct Field {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Relative to the strongest ink around it, 0 to 1, so that pale lines beside dark ones count.
    pub(super) ink: Vec<f64>,
    /// Share of the paper's brightness that the ink takes, 0 to 1.
    pub(super) contrast: Vec<f64>,
    /// The ink's red, green and blue relative to the paper's; light ink's own.
    pub(super) color: Vec<[f64; CHANNELS]>,
    /// Share of the picture in marks that are too faint for ink.
    pub(super) faint: f64,
    /// Number of pale lines from rim to rim of a picture from a screen, which are not ink.
    pub(super) rulings: usize,
    /// Whether the picture was drawn on a screen, not photographed or scanned.
    pub(super) is_clean: bool,
    /// Share of the picture in tones between paper and strong ink that change slowly, as in a
    /// photograph; 0 for a picture from a screen.
    pub(super) shades: f64,
}

impl Field {
    /// The ink of a picture; `None` where nothing stands out from its paper.
    pub(super) fn new(picture: &RgbImage) -> Option<Self> {
        Self::on(picture, even_paper(picture).as_ref())
    }

    fn on(picture: &RgbImage, even: Option<&Even>) -> Option<Self> {
        let (width, height) = (picture.width() as usize + 2, picture.height() as usize + 2);
        let inks = even.map_or_else(|| inks(picture), |paper| inks_on(picture, paper));
        let mut contrast = vec![0.0; width * height];
        let mut color = vec![[1.0; CHANNELS]; width * height];
        for (row, inks) in (1..).zip(inks.chunks(width - 2)) {
            let first = row * width + 1;
            for (pixel, (ink, left)) in (first..).zip(inks) {
                (contrast[pixel], color[pixel]) = (*ink, *left);
            }
        }
        let grain = grain(&contrast, width);
        let is_clean = even.is_some() && grain < CLEAN;
        let least = LEAST[usize::from(!is_clean)].max(GRAINS * grain);
        let inked: Vec<f64> = contrast.iter().copied().filter(|ink| *ink > least).collect();
        let strong = quantile(inked.iter().map(|ink| 255.0 * ink), STRONG) / 255.0;
        if is_clean && tones(&contrast, width, strong, GLARE) > SOFT {
            return Self::on(picture, None);
        }
        let rulings = if is_clean {
            without_rulings(&mut contrast, width, &(least..PALE * strong))
        } else {
            0
        };
        let levels = extremes(&contrast, width, NEAR, f64::max);
        let is_sharp = is_clean && soft_rims(&contrast, &levels, width, least) < SOFT_RIMS;
        let faint = if is_sharp { least } else { least.max(FAINT[usize::from(is_clean)] * strong) };
        let ink = contrast.iter().zip(&levels);
        let ink = ink.map(|(ink, level)| (ink / level.max(faint / RIM)).min(1.0)).collect();
        let n_faint = levels.iter().filter(|level: &&f64| (least..faint).contains(*level)).count();
        let shades = if is_clean { 0.0 } else { tones(&contrast, width, strong, PHOTO) };
        (!inked.is_empty()).then_some(Self {
            width,
            height,
            ink,
            contrast,
            color,
            faint: n_faint as f64 / (width * height) as f64,
            rulings,
            is_clean,
            shades,
        })
    }

    /// Pixels along edges between two inks, with ink all around.
    pub(super) fn inner_edges(&self) -> usize {
        let within = extremes(&self.ink, self.width, NEAR, f64::min);
        // Shadows cross a photographed drawing and do not change its hue.
        let colors = Vec::from_iter(self.color.iter().map(|color| {
            let light = if self.is_clean { 1.0 } else { color.iter().sum::<f64>().max(APART) };
            color.map(|value| value / light)
        }));
        let inner = (2 * self.width..within.len() - 2 * self.width).filter(|p| within[*p] > RIM);
        let edges = inner.filter(|pixel| {
            [2, 2 * self.width].iter().any(|step| {
                let (after, before) = (colors[pixel + step], colors[pixel - step]);
                (0..CHANNELS).any(|c| (after[c] - before[c]).abs() > APART)
            })
        });
        edges.count()
    }
}

/// The ink of a pixel: its contrast and its color.
type Inked = (f64, [f64; CHANNELS]);

/// The channels of a picture or its negative, softened.
fn channels(picture: &RgbImage, is_negative: bool) -> [Vec<f64>; CHANNELS] {
    [0, 1, 2].map(|c| {
        let values = picture.pixels().map(|pixel| f64::from(pixel.0[c]));
        let values = values.map(|value| if is_negative { 255.0 - value } else { value });
        softened(&values.collect::<Vec<_>>(), picture.width() as usize)
    })
}

/// Paper whose color changes evenly: the color of its middle, and the change from left to right and
/// from top to bottom.
pub(super) struct Even([[f64; 3]; CHANNELS]);

impl Even {
    /// The color at a place in shares of the picture.
    fn color(&self, [x, y]: [f64; 2]) -> [f64; CHANNELS] {
        self.0.map(|[middle, across, down]| middle + across * (x - 0.5) + down * (y - 0.5))
    }
}

/// Whether a pixel is at the left, right, upper or lower side of a picture.
fn sides((width, height): (u32, u32), x: u32, y: u32) -> [bool; 4] {
    [x < 2, x + 2 >= width, y < 2, y + 2 >= height]
}

/// Paper in the color of the picture's sides, if most of the sides and some of the picture have it.
pub(super) fn even_paper(picture: &RgbImage) -> Option<Even> {
    let (width, height) = picture.dimensions();
    let paper = Even([0, 1, 2].map(|c| {
        let [left, right, top, bottom] = [0, 1, 2, 3].map(|side| {
            let pixels = picture.enumerate_pixels();
            let pixels = pixels.filter(|(x, y, _)| sides((width, height), *x, *y)[side]);
            quantile(pixels.map(|(.., pixel)| f64::from(pixel.0[c])), 0.5)
        });
        [0.25 * (left + right + top + bottom), right - left, bottom - top]
    }));
    let [mut n_rim, mut even_rim, mut n_even] = [0.0; 3];
    for (x, y, pixel) in picture.enumerate_pixels() {
        let place = [f64::from(x) / f64::from(width), f64::from(y) / f64::from(height)];
        let mut values = pixel.0.iter().zip(paper.color(place));
        let is_even = values.all(|(value, paper)| (f64::from(*value) - paper).abs() <= SAME);
        n_even += f64::from(u8::from(is_even));
        if sides((width, height), x, y).contains(&true) {
            n_rim += 1.0;
            even_rim += f64::from(u8::from(is_even));
        }
    }
    let tone = paper.0.iter().map(|[middle, ..]| middle).sum::<f64>() / CHANNELS as f64;
    let is_flat = paper.0.iter().flat_map(|p| &p[1..]).all(|slope| slope.abs() <= SAME);
    let is_known = is_flat || (MIDDLE[0]..MIDDLE[1]).contains(&tone);
    let share = if is_flat { EVEN } else { EVEN_RIM };
    let is_even =
        even_rim > EVEN_RIM * n_rim && n_even > share * f64::from(width) * f64::from(height);
    (is_known && is_even).then_some(paper)
}

/// The ink of each pixel on even paper, darker or lighter.
fn inks_on(picture: &RgbImage, paper: &Even) -> Vec<Inked> {
    let channels = channels(picture, false);
    let [width, height] = [picture.width() as usize, picture.height() as usize];
    Vec::from_iter((0..channels[0].len()).map(|pixel| {
        let place = [(pixel % width) as f64 / width as f64, (pixel / width) as f64 / height as f64];
        let (paper, values) = (paper.color(place), [0, 1, 2].map(|c| channels[c][pixel]));
        let contrasts =
            [0, 1, 2].map(|c| (values[c] - paper[c]).abs() / paper[c].max(255.0 - paper[c]));
        let most = contrasts.into_iter().fold(0.0, f64::max);
        (most.min(1.0), values.map(|value| value / 255.0))
    }))
}

/// The ink of each pixel relative to the paper around it, either dark or light.
fn inks(picture: &RgbImage) -> Vec<Inked> {
    let width = picture.width() as usize;
    let is_light = has_light_ink(picture);
    let channels = channels(picture, is_light);
    let side = picture.width().max(picture.height());
    let [wide, high] = [picture.width(), picture.height()].map(|side| side.div_ceil(COARSE));
    let coarse = self::channels(&thumbnail(picture, wide, high), is_light);
    let near = [0, 1, 2].map(|c| closed(&channels[c], width, side.div_ceil(PEN) as usize));
    let far = [0, 1, 2]
        .map(|c| closed(&coarse[c], wide as usize, high.max(wide).div_ceil(PATCH) as usize));
    let papers = (0..channels[0].len()).map(|pixel| {
        let [x, y] = [pixel % width, pixel / width].map(|place| place / COARSE as usize);
        let far = [0, 1, 2].map(|c| far[c][y * wide as usize + x].max(1.0));
        ([0, 1, 2].map(|c| near[c][pixel].max(1.0)), far)
    });
    // An area wider than a pen is a patch of ink unless it is a shadow, and so is its rim.
    let patches = papers.clone().map(|(near, far)| {
        let shares = [0, 1, 2].map(|c| near[c] / far[c]);
        let [least, most] =
            [f64::min, f64::max].map(|extreme| shares.into_iter().fold(shares[0], extreme));
        let is_dark = shares.iter().sum::<f64>() < SHADOW * CHANNELS as f64;
        f64::from(u8::from(is_dark || most > HUE * least))
    });
    let patches = extremes(&patches.collect::<Vec<f64>>(), width, NEAR, f64::max);
    Vec::from_iter(papers.enumerate().map(|(pixel, (near, far))| {
        let paper = if patches[pixel] > 0.0 { far } else { near };
        let mean = paper.iter().sum::<f64>() / CHANNELS as f64;
        let (mut most, mut left) = (0.0_f64, [0.0; CHANNELS]);
        for c in 0..CHANNELS {
            let value = channels[c][pixel];
            most = most.max((paper[c] - value) / paper[c].max(mean)).min(1.0);
            left[c] = if is_light { (255.0 - value) / 255.0 } else { (value / paper[c]).min(1.0) };
        }
        (most, left)
    }))
}

/// Whether ink is lighter than its paper: if the few outlying pixels of each block are brighter
/// than the rest, not darker; if both occur alike, whether the picture's rim is dark.
fn has_light_ink(picture: &RgbImage) -> bool {
    let luma = grayscale(picture);
    let [width, height] = [luma.width() as usize, luma.height() as usize];
    let block = width.max(height).div_ceil(BLOCKS);
    let tops = (0..height).step_by(block);
    let blocks = tops.flat_map(|top| (0..width).step_by(block).map(move |left| [left, top]));
    let (mut darker, mut brighter) = (0.0, 0.0);
    for [left, top] in blocks {
        let rows = luma.chunks(width).skip(top).take(block);
        let tones =
            rows.flat_map(|row| row[left..].iter().take(block).map(|tone| f64::from(*tone)));
        let [dark, most, bright] = [0.02, 0.5, 0.98].map(|share| quantile(tones.clone(), share));
        (darker, brighter) = (darker + most - dark, brighter + bright - most);
    }
    if brighter.max(darker) > SKEWED * brighter.min(darker) {
        return brighter > darker;
    }
    let rim = luma
        .enumerate_pixels()
        .filter(|(x, y, _)| *x == 0 || *y == 0 || x + 1 == luma.width() || y + 1 == luma.height());
    let rim = quantile(rim.map(|(.., tone)| f64::from(tone.0[0])), 0.5);
    let [dark, bright] =
        [0.02, 0.98].map(|share| quantile(luma.iter().map(|tone| f64::from(*tone)), share));
    2.0 * rim < dark + bright
}

/// Standard deviation of the paper's grain: by the median difference of pixels, two apart.
fn grain(contrast: &[f64], width: usize) -> f64 {
    let rows = contrast.chunks(width).flat_map(|row| row.iter().zip(row.iter().skip(2)));
    // In 4000ths, so that the finest grain has a level.
    1.05 * quantile(rows.map(|(a, b)| 4000.0 * (a - b).abs()), 0.5) / 4000.0
}

/// Share of the rims at a contrast that are soft.
fn soft_rims(contrast: &[f64], levels: &[f64], width: usize, least: f64) -> f64 {
    let weakest = extremes(contrast, width, NEAR, f64::min);
    let rims = (width..contrast.len()).filter(|pixel| {
        let before = [contrast[pixel - 1], contrast[pixel - width]];
        before.iter().any(|before| (*before > least) != (contrast[*pixel] > least))
    });
    let (soft, sharp): (Vec<_>, Vec<_>) =
        rims.partition(|pixel| weakest[*pixel] > SOFT_RIM * levels[*pixel]);
    soft.len() as f64 / (soft.len() + sharp.len()).max(1) as f64
}

/// Takes the rulings of the paper out of a picture: pale lines from rim to rim, if there are as
/// many as on lined paper. Returns their number.
fn without_rulings(contrast: &mut [f64], width: usize, pale: &Range<f64>) -> usize {
    let height = contrast.len() / width;
    let (mut n, mut ruled) = (0, Vec::new());
    // Rows, then columns: the steps to the next one and along it.
    for (n_lines, to_next, n_along, step) in [(height, width, width, 1), (width, 1, height, width)]
    {
        let lines = (0..n_lines).map(|line| (0..n_along).map(move |k| line * to_next + k * step));
        let levels = lines.clone().map(|pixels| {
            let inked = pixels.map(|pixel| contrast[pixel]).filter(|ink| *ink > pale.start);
            let is_across = inked.clone().count() as f64 > ACROSS * n_along as f64;
            let rank = |rank| quantile(inked.clone().map(|ink| 255.0 * ink), rank) / 255.0;
            // A pen's line may lie along most of a ruling.
            let level = || Some(rank(0.5)).filter(|it| *it < pale.end).unwrap_or_else(|| rank(0.1));
            if is_across { level() } else { 0.0 }
        });
        let levels: Vec<f64> = levels.collect();
        let most = extremes(&levels, n_lines, NEAR, f64::max);
        for (line, pixels) in lines.enumerate() {
            if levels[line] > 0.0 && most[line] < pale.end {
                n += usize::from(levels[line - 1] == 0.0);
                ruled.extend(pixels.filter(|pixel| contrast[*pixel] < CROSSED * most[line]));
            }
        }
    }
    if n < RULINGS {
        return 0;
    }
    ruled.into_iter().for_each(|pixel| contrast[pixel] = 0.0);
    n
}

/// Share of pixels in tones between paper and strong ink that change slowly.
fn tones(contrast: &[f64], width: usize, strong: f64, (between, slow, step): Tones) -> f64 {
    let shades = (step * width..contrast.len().saturating_sub(step * width)).filter(|pixel| {
        let slope = |step: usize| contrast[pixel + step] - contrast[pixel - step];
        between.contains(&(contrast[*pixel] / strong))
            && slow.contains(&(libm::hypot(slope(step), slope(step * width)) / strong))
    });
    shades.count() as f64 / contrast.len() as f64
}
