//! Ink: what of a picture differs from its paper, in lightness and in color.
//!
//! Where the picture's rim is of one even color, that is the paper, and what differs from it to
//! either side is ink. Else ink is what is darker than the paper around it (lighter, where most of
//! the picture is dark): the paper is the picture without what is narrower than a pen, so that the
//! edges of shadows stay in it. In each of red, green and blue; the channel in which ink is most
//! counts: yellow is as strong as blue.

use image::RgbImage;
use image::imageops::{grayscale, thumbnail};

use super::levels::{closed, extremes, quantile, softened};

/// Channels of a color.
const CHANNELS: usize = 3;

/// Largest difference of even paper from the color that its sides have, in levels of 255; the share
/// of the rim that has to be so near, and of the picture.
const SAME: f64 = 8.0;
const EVEN_RIM: f64 = 0.6;
const EVEN: f64 = 0.2;
/// Tones of paper that changes evenly on which light ink shows as dark ink does.
const MIDDLE: [f64; 2] = [70.0, 155.0];

/// Blocks along the longer side by which light ink is told from dark ink, and by how much more than
/// the other it differs from most of its block.
const BLOCKS: usize = 24;
const SKEWED: f64 = 1.4;

/// How many times half of the widest pen, and of the widest patch that is ink, are in the picture's
/// longer side; pixels across one of the picture in which patches are sought.
const PEN: u32 = 40;
const PATCH: u32 = 3;
const COARSE: u32 = 4;
/// What is wider than a pen is paper in shadow where it has this share of the light around it, in
/// channels whose shares differ by no more than this ratio.
const SHADOW: f64 = 0.22;
const HUE: f64 = 1.3;

/// Least ink, as a share of the paper's brightness, of a picture that was drawn on a screen, whose
/// paper is even and has no more than a grain; of one that was photographed or scanned; of that by
/// its paper's grain; and by its strong ink, as which rulings are weaker.
const LEAST: [f64; 2] = [0.07, 0.10];
const CLEAN: f64 = 0.001;
const GRAINS: f64 = 6.0;
const FAINT: f64 = 0.4;
/// Tones between paper and strong ink, by the contrast of that; and how much they may change over
/// four pixels.
const BETWEEN: [f64; 2] = [0.2, 0.8];
const SLOW: f64 = 0.12;

/// Share of the ink that is weaker than strong ink.
const STRONG: f64 = 0.97;

/// Pixels around one whose strongest ink is its level: more than the blur of a lens.
const NEAR: usize = 3;

/// Least change of a color over four pixels that is the edge of another ink.
const APART: f64 = 0.2;

/// The level at which a rim of ink lies, by that of the ink: see [`Field::ink`].
pub(super) const RIM: f64 = 0.5;

/// Ink pixel by pixel, with a margin of a pixel of paper.
pub(super) struct Field {
    pub(super) width: usize,
    pub(super) height: usize,
    /// By the strongest ink around it, 0 to 1, so that pale lines beside dark ones are there.
    pub(super) ink: Vec<f64>,
    /// Share of the paper's brightness that the ink takes, 0 to 1.
    pub(super) contrast: Vec<f64>,
    /// What the ink leaves of red, green and blue of the paper's; of light ink, its own.
    pub(super) color: Vec<[f64; CHANNELS]>,
    /// Share of the picture in marks that are too faint for ink.
    pub(super) faint: f64,
    /// Whether the picture was drawn on a screen, not photographed or scanned.
    pub(super) is_clean: bool,
    /// Share of the picture in tones between paper and strong ink that change slowly, as those of
    /// a photograph do; 0 of what was drawn on a screen.
    pub(super) shades: f64,
}

impl Field {
    /// The ink of a picture; `None` where nothing stands out from its paper.
    pub(super) fn of(picture: &RgbImage) -> Option<Self> {
        let (width, height) = (picture.width() as usize + 2, picture.height() as usize + 2);
        let even = even_paper(picture);
        let inks = match &even {
            Some(paper) => inks_on(picture, paper),
            None => inks(picture),
        };
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
        let inked = || contrast.iter().filter(|ink| **ink > least);
        let strong = quantile(inked().map(|ink| 255.0 * ink), STRONG) / 255.0;
        let faint = if is_clean { least } else { least.max(FAINT * strong) };
        let levels = extremes(&contrast, width, NEAR, f64::max);
        let by_level = |(ink, level): (&f64, &f64)| (ink / level.max(faint / RIM)).min(1.0);
        let ink: Vec<f64> = contrast.iter().zip(&levels).map(by_level).collect();
        let n_faint = levels.iter().filter(|level: &&f64| (least..faint).contains(*level)).count();
        let shades = if is_clean { 0.0 } else { shades(&contrast, width, strong) };
        (inked().count() > 0).then_some(Self {
            width,
            height,
            ink,
            contrast,
            color,
            faint: n_faint as f64 / (width * height) as f64,
            is_clean,
            shades,
        })
    }

    /// Pixels along edges between two inks, with ink all around.
    pub(super) fn inner_edges(&self) -> usize {
        let within = extremes(&self.ink, self.width, NEAR, f64::min);
        // Shadows cross what was photographed: they leave its hue.
        let color = |pixel: usize| {
            let color = self.color[pixel];
            let light = if self.is_clean { 1.0 } else { color.iter().sum::<f64>().max(APART) };
            color.map(|value| value / light)
        };
        let changes = |pixel: usize, step: usize| {
            let (after, before) = (color(pixel + 2 * step), color(pixel - 2 * step));
            (0..CHANNELS).any(|c| (after[c] - before[c]).abs() > APART)
        };
        let is_edge = |pixel: &usize| {
            within[*pixel] > RIM && (changes(*pixel, 1) || changes(*pixel, self.width))
        };
        (2 * self.width..within.len() - 2 * self.width).filter(is_edge).count()
    }
}

/// The ink of a pixel: its contrast, and what it leaves of red, green and blue.
type Inked = (f64, [f64; CHANNELS]);

/// The channels of a picture, softened.
fn channels(picture: &RgbImage, tone: impl Fn(u8) -> f64) -> [Vec<f64>; CHANNELS] {
    [0, 1, 2].map(|c| {
        let values: Vec<f64> = picture.pixels().map(|pixel| tone(pixel.0[c])).collect();
        softened(&values, picture.width() as usize)
    })
}

/// Paper whose color changes evenly: that of its middle, and by how much it changes from left to
/// right and from top to bottom.
pub(super) struct Even([[f64; 3]; CHANNELS]);

impl Even {
    /// At a place in shares of the picture.
    fn at(&self, [x, y]: [f64; 2]) -> [f64; CHANNELS] {
        self.0.map(|[middle, across, down]| middle + across * (x - 0.5) + down * (y - 0.5))
    }
}

/// Paper of the color that the picture's sides have, where most of them and some of the picture
/// are of it.
pub(super) fn even_paper(picture: &RgbImage) -> Option<Even> {
    let (width, height) = picture.dimensions();
    let sides = |x: u32, y: u32| [x < 2, x + 2 >= width, y < 2, y + 2 >= height];
    let paper = Even([0, 1, 2].map(|c| {
        let [left, right, top, bottom] = [0, 1, 2, 3].map(|side| {
            let pixels = picture.enumerate_pixels().filter(|(x, y, _)| sides(*x, *y)[side]);
            quantile(pixels.map(|(.., pixel)| f64::from(pixel.0[c])), 0.5)
        });
        [0.25 * (left + right + top + bottom), right - left, bottom - top]
    }));
    let [mut n_rim, mut even_rim, mut n_even] = [0.0; 3];
    for (x, y, pixel) in picture.enumerate_pixels() {
        let place = [f64::from(x) / f64::from(width), f64::from(y) / f64::from(height)];
        let differs = |(value, paper): (&u8, f64)| (f64::from(*value) - paper).abs() > SAME;
        let is_even = !pixel.0.iter().zip(paper.at(place)).any(differs);
        n_even += f64::from(u8::from(is_even));
        if sides(x, y).contains(&true) {
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

/// The ink of each pixel on even paper, of which it differs to either side.
fn inks_on(picture: &RgbImage, paper: &Even) -> Vec<Inked> {
    let channels = channels(picture, f64::from);
    let [width, height] = [picture.width() as usize, picture.height() as usize];
    let inks = (0..channels[0].len()).map(|pixel: usize| {
        let place = [(pixel % width) as f64 / width as f64, (pixel / width) as f64 / height as f64];
        let (paper, values) = (paper.at(place), [0, 1, 2].map(|c| channels[c][pixel]));
        let contrast = |c: usize| (values[c] - paper[c]).abs() / paper[c].max(255.0 - paper[c]);
        let most = (0..CHANNELS).map(contrast).fold(0.0, f64::max);
        (most.min(1.0), values.map(|value| value / 255.0))
    });
    inks.collect()
}

/// The ink of each pixel, dark or light ink alone, by the paper around it.
fn inks(picture: &RgbImage) -> Vec<Inked> {
    let width = picture.width() as usize;
    let is_light = has_light_ink(picture);
    let bright = |value: u8| if is_light { 255.0 - f64::from(value) } else { f64::from(value) };
    let channels = channels(picture, bright);
    let side = picture.width().max(picture.height());
    let [wide, high] = [picture.width(), picture.height()].map(|side| side.div_ceil(COARSE));
    let coarse = self::channels(&thumbnail(picture, wide, high), bright);
    let near = [0, 1, 2].map(|c| closed(&channels[c], width, side.div_ceil(PEN) as usize));
    let far = [0, 1, 2]
        .map(|c| closed(&coarse[c], wide as usize, high.max(wide).div_ceil(PATCH) as usize));
    let papers = |pixel: usize| {
        let [x, y] = [pixel % width, pixel / width].map(|place| place / COARSE as usize);
        let far = [0, 1, 2].map(|c| far[c][y * wide as usize + x].max(1.0));
        ([0, 1, 2].map(|c| near[c][pixel].max(1.0)), far)
    };
    // What is wider than a pen and no shadow is a patch of ink, as is its rim.
    let is_patches = (0..channels[0].len()).map(|pixel: usize| {
        let (near, far) = papers(pixel);
        let shares = [0, 1, 2].map(|c| near[c] / far[c]);
        let [least, most] =
            [f64::min, f64::max].map(|extreme| shares.into_iter().fold(shares[0], extreme));
        let is_dark = shares.iter().sum::<f64>() < SHADOW * CHANNELS as f64;
        f64::from(u8::from(is_dark || most > HUE * least))
    });
    let patches: Vec<f64> = is_patches.collect();
    let patches = extremes(&patches, width, NEAR, f64::max);
    let inks = (0..channels[0].len()).map(|pixel: usize| {
        let (near, far) = papers(pixel);
        let paper = if patches[pixel] > 0.0 { far } else { near };
        let mean = paper.iter().sum::<f64>() / CHANNELS as f64;
        let (mut most, mut left) = (0.0_f64, [0.0; CHANNELS]);
        for c in 0..CHANNELS {
            let value = channels[c][pixel];
            most = most.max((paper[c] - value) / paper[c].max(mean)).min(1.0);
            left[c] = if is_light { (255.0 - value) / 255.0 } else { (value / paper[c]).min(1.0) };
        }
        (most, left)
    });
    inks.collect()
}

/// Whether ink is lighter than its paper: where few of a block's pixels are far brighter than most
/// of it rather than darker; where both are alike, where the picture's rim is dark.
fn has_light_ink(picture: &RgbImage) -> bool {
    let luma = grayscale(picture);
    let [width, height] = [luma.width() as usize, luma.height() as usize];
    let block = width.max(height).div_ceil(BLOCKS);
    let quantiles = |[left, top]: [usize; 2]| {
        let rows = luma.chunks(width).skip(top).take(block);
        let block =
            rows.flat_map(|row| row[left..].iter().take(block).map(|tone| f64::from(*tone)));
        [0.02, 0.5, 0.98].map(|share| quantile(block.clone(), share))
    };
    let tops = (0..height).step_by(block);
    let blocks = tops.flat_map(|top| (0..width).step_by(block).map(move |left| [left, top]));
    let (mut darker, mut brighter) = (0.0, 0.0);
    for [dark, most, bright] in blocks.map(quantiles) {
        (darker, brighter) = (darker + most - dark, brighter + bright - most);
    }
    if brighter.max(darker) > SKEWED * brighter.min(darker) {
        return brighter > darker;
    }
    let is_rim =
        |x: u32, y: u32| x == 0 || y == 0 || x + 1 == luma.width() || y + 1 == luma.height();
    let tones = |rim_alone: bool, share: f64| {
        let kept = luma.enumerate_pixels().filter(|(x, y, _)| !rim_alone || is_rim(*x, *y));
        quantile(kept.map(|(.., tone)| f64::from(tone.0[0])), share)
    };
    2.0 * tones(true, 0.5) < tones(false, 0.02) + tones(false, 0.98)
}

/// Standard deviation of the paper's grain: by the median difference of pixels, two apart.
fn grain(contrast: &[f64], width: usize) -> f64 {
    let rows = contrast.chunks(width).flat_map(|row| row.iter().zip(row.iter().skip(2)));
    // In 4000ths, so that the finest grain has a level.
    1.05 * quantile(rows.map(|(a, b)| 4000.0 * (a - b).abs()), 0.5) / 4000.0
}

/// Share of pixels in tones between paper and strong ink that change slowly.
fn shades(contrast: &[f64], width: usize, strong: f64) -> f64 {
    let is_shade = |pixel: &usize| {
        let change = |step: usize| contrast[pixel + 2 * step] - contrast[pixel - 2 * step];
        (BETWEEN[0]..BETWEEN[1]).contains(&(contrast[*pixel] / strong))
            && libm::hypot(change(1), change(width)) < SLOW * strong
    };
    let inner = 2 * width..contrast.len() - 2 * width;
    inner.filter(is_shade).count() as f64 / contrast.len() as f64
}
