//! Bitmaps: line art, handwriting on paper and logos, as PNG or JPEG, turned upright by their EXIF.
//!
//! Ink is what is darker than the paper around it (lighter, where most of the picture is dark): the
//! paper's brightness is estimated block by block, so that shadows are none. The threshold is
//! Otsu's (IEEE Trans. SMC 9, 1979); contours lie between pixels, by marching squares. Each patch
//! of ink with its holes is traced as a typeface's characters are ([`center_lines`]), or along its
//! outline where it is an area by itself: too thick for its length. A line has the hue of its ink
//! where that is not gray. A photograph, whose paper would have texture, is drawn by its edges
//! ([`super::photograph`]).

use std::io::Cursor;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageReader, RgbImage, imageops};

use super::gradient::Paint;
use super::levels::{contours, softened};
use super::photograph::edges;
use super::{ColoredLine, MAX_POINTS};
use crate::Picture;
use crate::center_line::{CenterLines, center_lines, outlines};
use crate::options::{LetterOptions, Trace};
use crate::outline::{Contour, Filled, mean_stroke_width};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Budget, JpegFrame};
use noctograph_core::geometry::{bounds, distance, polyline_length_m};
use noctograph_core::statistics::median;

/// Pixels of the longer side to which a picture is made smaller.
const LONGER_SIDE: u32 = 1200;

/// Steps of decoding a byte, so that a picture of three channels may have 40 million pixels.
const STEPS: usize = 8;

/// Blocks of paper along the longer side.
const BLOCKS: usize = 24;
/// Share of a block's pixels that are darker than its paper.
const PAPER: f64 = 0.75;
/// Paper is brighter than this share of paper beside it, from the brightest block on, so that a
/// shadow with a soft edge may be as dark as it likes; what is darker is a patch of ink.
const SHADOW: f64 = 0.45;
/// Least difference of ink and paper, as a share of the paper's brightness.
const FAINT: f64 = 0.12;
/// Least area of a patch, and least length along the picture's rim of what stands around the paper,
/// by the picture's longer side.
const SPECK: f64 = 2e-3;
const SURROUNDINGS: f64 = 0.3;
/// Share of the picture's rim from which a patch without holes is all of the picture.
const ALL_INK: f64 = 0.9;
/// Standard deviation of the paper, by the contrast of ink, beyond which a picture is a photograph.
/// It was 0.03 to 0.16 of drawings, pages of print and logos, and 0.20 to 0.27 of six photographs
/// of scikit-image (astronaut, coffee, cat, motorcycle, grass, tissue).
const TEXTURE: f64 = 0.175;
/// Detail of a photograph where none is given.
const PHOTOGRAPH: f64 = 0.5;
/// Mean width of a patch that is outlined, by the drawing's larger side.
const THICK: f64 = 0.1;
/// A patch is an area, whatever lies beside it, where its center line is shorter than so many of
/// its thicknesses, and it is so many times as thick as the drawing's lines, or as this share of
/// the drawing where it has none: a dash of the pen is short, but no thicker than the pen.
const LONG: f64 = 6.0;
const PENS: f64 = 2.0;
const POINT: f64 = 0.03;
/// Brightness of light ink, and the share of a transparent picture's ink that is as light.
const LIGHT: u32 = 150;
const ALL_LIGHT: f64 = 0.98;
/// Least chroma of a colored ink, by its brightness.
const CHROMA: f64 = 0.35;

/// The lines of a bitmap in pixels, y up, and their colors; black where the ink is gray. `size`
/// gives the size of a pixel in cap heights from the bounds of the ink. The detail in which they
/// are drawn, and what the picture is taken for.
pub(super) fn read(
    bytes: &[u8],
    options: &LetterOptions,
    size: impl Fn([f64; 4]) -> Result<f64>,
    file: &str,
) -> Result<(Vec<ColoredLine>, f64, Picture)> {
    let hint = "photograph the drawing in even light, or draw with a darker pen";
    let budget = Budget::of(file, "make the picture smaller, or draw less");
    let picture = upright(bytes, &budget, file)?;
    let field = Field::of(&picture);
    let thresholds = field.thresholds();
    let is_photograph = match options.picture {
        Picture::Auto => {
            thresholds.is_some_and(|(threshold, _)| field.texture(threshold) > TEXTURE)
        }
        Picture::Drawing => false,
        Picture::Photograph => true,
    };
    if is_photograph {
        let edges = edges(&picture).into_iter().map(|line| (line, Paint::Plain([0; 3])));
        let detail = options.detail.unwrap_or(PHOTOGRAPH);
        return Ok((edges.collect(), detail, Picture::Photograph));
    }
    let Some((threshold, strong)) = thresholds else {
        let found = "a picture without lines that stand out from its paper";
        return Err(Error::input(file, found, "a drawing, handwriting or a logo", hint));
    };
    let patches = field.patches(threshold, strong);
    if let [patch] = &patches[..]
        && patch.len() == 1
        && field.along_rim(&patch[0]) > ALL_INK * 2.0 * (field.width + field.height - 4) as f64
    {
        let found = "a picture that is one color from rim to rim";
        return Err(Error::input(file, found, "a drawing, handwriting or a logo", hint));
    }
    let extent = bounds(patches.iter().flatten().flatten().copied());
    let larger = (extent[2] - extent[0]).max(extent[3] - extent[1]);
    let scale = size(extent)?;
    let mut lines = Vec::new();
    let mut traced: Vec<(Vec<Contour>, Option<CenterLines>)> = Vec::new();
    for patch in patches {
        let patch: Vec<Contour> =
            patch.iter().map(|c| c.iter().map(|p| p.map(|x| x * scale)).collect()).collect();
        let is_thick = mean_stroke_width(&patch) > THICK * larger * scale;
        let is_traced = options.trace == Trace::CenterLine && !is_thick;
        let found = is_traced.then(|| center_lines(&patch, &budget));
        budget.check()?;
        traced.push((patch, found));
    }
    let length =
        |found: &CenterLines| found.lines.iter().map(|line| polyline_length_m(line)).sum::<f64>();
    let is_short = |found: &CenterLines| length(found) < 2.0 * LONG * found.thickest;
    let pens = traced.iter().filter_map(|(_, found)| found.as_ref()).filter(|it| !is_short(it));
    let pen = median(pens.map(|found| found.half_width)).map_or(0.0, |half| PENS * half);
    let least = pen.max(0.5 * POINT * larger * scale);
    for (patch, found) in traced {
        let drawn = match found.filter(|found| !(is_short(found) && found.thickest > least)) {
            Some(found) => found.lines,
            None => outlines(&patch, &budget),
        };
        budget.check()?;
        let drawn = drawn.into_iter().map(|line| line.into_iter().map(|p| p.map(|x| x / scale)));
        lines.extend(drawn.map(Iterator::collect::<Vec<_>>).filter(|line| line.len() > 1));
    }
    if lines.iter().map(Vec::len).sum::<usize>() > MAX_POINTS {
        return Err(super::too_many(file));
    }
    let colored = lines.into_iter().map(|line| {
        let color = field.color(&picture, &line, threshold);
        (line, Paint::Plain(color))
    });
    Ok((colored.collect(), options.detail.unwrap_or(1.0), Picture::Drawing))
}

/// The picture in upright position, and at most as large as needed. Where it is transparent it lies
/// on white, or on black if its ink is light.
fn upright(bytes: &[u8], budget: &Budget, file: &str) -> Result<RgbImage> {
    let refuse = |found: &dyn std::fmt::Display| {
        let wanted = "a PNG image or a JPEG photo";
        Error::input(file, found, wanted, "choose another file, or make it smaller")
    };
    let reader =
        ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| refuse(&e))?;
    let mut decoder = reader.into_decoder().map_err(|e| refuse(&e))?;
    let (width, height) = decoder.dimensions();
    if width < 3 || height < 3 {
        return Err(refuse(&format!("{width} × {height} pixels")));
    }
    let n_bytes = usize::try_from(decoder.total_bytes()).unwrap_or(usize::MAX);
    budget.steps(STEPS.saturating_mul(n_bytes))?;
    if let Some(frame) = JpegFrame::of(bytes) {
        let whole = |n: u64| usize::try_from(n).unwrap_or(usize::MAX);
        budget.bytes(whole(frame.decoded_bytes()))?;
        budget.steps(whole(frame.later_scans_ns()))?;
    }
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let mut picture = DynamicImage::from_decoder(decoder).map_err(|e| refuse(&e))?;
    if width.max(height) > LONGER_SIDE {
        picture = picture.thumbnail(LONGER_SIDE, LONGER_SIDE);
    }
    picture.apply_orientation(orientation);
    let mut on_white = RgbImage::new(picture.width(), picture.height());
    let picture = picture.into_rgba8();
    let [mut n_ink, mut n_light] = [0_u32; 2];
    for [r, g, b, alpha] in picture.pixels().map(|pixel| pixel.0.map(u32::from)) {
        let is_ink = alpha > 127;
        n_ink += u32::from(is_ink);
        n_light += u32::from(is_ink && 299 * r + 587 * g + 114 * b > 1000 * LIGHT);
    }
    let is_transparent = n_ink < picture.width() * picture.height();
    let is_light = f64::from(n_light) >= ALL_LIGHT * f64::from(n_ink);
    let ground = if is_transparent && is_light { 0 } else { 255 };
    for (pixel, rgba) in on_white.pixels_mut().zip(picture.pixels()) {
        let [.., alpha] = rgba.0.map(u32::from);
        for (channel, value) in pixel.0.iter_mut().zip(rgba.0) {
            let sum = u32::from(value) * alpha + ground * (255 - alpha);
            *channel = u8::try_from((sum + 127) / 255).unwrap_or(255);
        }
    }
    Ok(on_white)
}

/// Share of the paper's brightness that the ink takes, pixel by pixel, 0 to 1, with a margin of
/// paper.
struct Field {
    width: usize,
    height: usize,
    ink: Vec<f64>,
}

impl Field {
    fn of(picture: &RgbImage) -> Self {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let luma = imageops::grayscale(picture);
        let mut counts = [0_usize; 256];
        luma.pixels().for_each(|pixel| counts[usize::from(pixel.0[0])] += 1);
        // Most of a picture is paper.
        let level = |share: f64| quantile(&counts, share) as f64;
        let light = 2.0 * level(0.5) < level(0.01) + level(0.99);
        let bright = |value: u8| if light { 255.0 - f64::from(value) } else { f64::from(value) };
        let values: Vec<f64> = luma.pixels().map(|pixel| bright(pixel.0[0])).collect();
        let values = softened(&values, width);
        let paper = Paper::of(&values, width, height);
        let (w, h) = (width + 2, height + 2);
        let mut ink = vec![0.0; w * h];
        for (at, value) in values.iter().enumerate() {
            let (x, y) = (at % width, at / width);
            ink[(y + 1) * w + x + 1] = (1.0 - value / paper.at(x, y)).clamp(0.0, 1.0);
        }
        Self { width: w, height: h, ink }
    }

    /// Otsu's threshold, the one with the largest variance between ink and paper, and the middle
    /// between it and the mean ink. `None` where ink and paper are hardly different.
    fn thresholds(&self) -> Option<(f64, f64)> {
        let mut counts = [0_usize; 256];
        self.ink.iter().for_each(|ink| counts[level(255.0 * ink)] += 1);
        let total = self.ink.len() as f64;
        let whole: f64 = (0..).zip(&counts).map(|(i, n)| f64::from(i) * *n as f64).sum();
        let (mut below, mut sum) = (0.0, 0.0);
        let mut best = (0.0, 0.0, (0.0, 0.0));
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
                let threshold = f64::from(i) + 0.5;
                best =
                    (variance, apart / 255.0, (threshold / 255.0, 0.5 * (threshold + ink) / 255.0));
            }
        }
        let (_, apart, thresholds) = best;
        (apart > FAINT).then_some(thresholds)
    }

    /// Standard deviation of what is paper by a threshold, by the contrast of ink.
    fn texture(&self, threshold: f64) -> f64 {
        let (paper, ink): (Vec<f64>, Vec<f64>) =
            self.ink.iter().partition(|ink| **ink <= threshold);
        let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len().max(1) as f64;
        let (paper_mean, ink_mean) = (mean(&paper), mean(&ink));
        let squares: Vec<f64> = paper.iter().map(|x| (x - paper_mean) * (x - paper_mean)).collect();
        libm::sqrt(mean(&squares)) / (ink_mean - paper_mean)
    }

    /// Patches of ink, each a contour with its holes; without specks, what is nowhere strong, and
    /// what stands around the paper.
    fn patches(&self, threshold: f64, strong: f64) -> Vec<Vec<Contour>> {
        let side = self.width.max(self.height) as f64;
        let contours = contours(&self.ink, [self.width, self.height], threshold);
        let least = (SPECK * side * SPECK * side).max(2.0);
        // Half a pixel within a contour there is a pixel of its ink.
        let is_strong = |contour: &Contour| {
            let ink = |[x, y]: &[f64; 2]| {
                let (x, y) = (pixel(*x, self.width), pixel(-y, self.height));
                near(y * self.width + x, self.width, self.height)
                    .map(|at| self.ink[at])
                    .fold(0.0, f64::max)
            };
            contour.iter().map(ink).fold(0.0, f64::max) > strong
        };
        let (outer, holes): (Vec<Contour>, Vec<Contour>) = contours
            .into_iter()
            .filter(|contour| area(contour).abs() >= least)
            .partition(|contour| area(contour) > 0.0);
        let outer = outer.into_iter().filter(is_strong);
        let mut patches: Vec<Vec<Contour>> = outer.map(|c| vec![c]).collect();
        // The smallest patch that holds a point of a hole has the hole.
        patches.sort_by(|a, b| area(&a[0]).total_cmp(&area(&b[0])));
        let budget = Budget::of("", "");
        let boxes: Vec<[f64; 4]> = patches.iter().map(|p| bounds(p[0].iter().copied())).collect();
        for hole in holes {
            let [x, y] = hole[0];
            let within = |[left, bottom, right, top]: &[f64; 4]| {
                (*left..=*right).contains(&x) && (*bottom..=*top).contains(&y)
            };
            let owner = (0..patches.len()).find(|k| {
                within(&boxes[*k]) && Filled::new(&patches[*k][..1], &budget).holds([x, y])
            });
            if let Some(owner) = owner {
                patches[owner].push(hole);
            }
        }
        let around = |patch: &Vec<Contour>| self.along_rim(&patch[0]) > SURROUNDINGS * side;
        if !patches.iter().all(around) {
            patches.retain(|patch| !around(patch));
        }
        patches
    }

    /// Length of a contour along the rim of the picture.
    fn along_rim(&self, contour: &Contour) -> f64 {
        let [right, bottom] = [self.width - 2, self.height - 2].map(|side| side as f64);
        let at_rim = |[x, y]: [f64; 2]| x < 1.0 || x > right || -y < 1.0 || -y > bottom;
        let legs = contour.iter().zip(contour.iter().skip(1));
        legs.filter(|(a, b)| at_rim(**a) && at_rim(**b)).map(|(a, b)| distance(*a, *b)).sum()
    }

    /// The hue of the ink along a line at full saturation; black where it is gray.
    fn color(&self, picture: &RgbImage, line: &[[f64; 2]], threshold: f64) -> [u8; 3] {
        let mut sum = [0.0; 3];
        for leg in line.windows(2) {
            for share in [0.0, 0.25, 0.5, 0.75] {
                let [x, y] = [0, 1].map(|i| leg[0][i] + share * (leg[1][i] - leg[0][i]));
                let (x, y) = (pixel(x, self.width), pixel(-y, self.height));
                if self.ink[y * self.width + x] > threshold {
                    let at = 3 * ((y - 1) * (self.width - 2) + x - 1);
                    (0..3).for_each(|i| sum[i] += f64::from(picture.as_raw()[at + i]));
                }
            }
        }
        let least = sum.into_iter().fold(f64::MAX, f64::min);
        let most = sum.into_iter().fold(0.0, f64::max);
        if most - least <= CHROMA * most {
            return [0; 3];
        }
        // In halves, so that strokes of one pen have one color.
        sum.map(|value| [0, 128, 255][level(2.0 * (value - least) / (most - least) + 0.5).min(2)])
    }
}

/// Brightness of the paper in blocks.
struct Paper {
    block: usize,
    columns: usize,
    rows: usize,
    levels: Vec<f64>,
}

impl Paper {
    fn of(values: &[f64], width: usize, height: usize) -> Self {
        let block = width.max(height).div_ceil(BLOCKS);
        let (columns, rows) = (width.div_ceil(block), height.div_ceil(block));
        let mut counts = vec![[0_usize; 256]; columns * rows];
        for (at, value) in values.iter().enumerate() {
            counts[at / width / block * columns + at % width / block][level(*value)] += 1;
        }
        let mut levels: Vec<f64> =
            counts.iter().map(|counts| (quantile(counts, PAPER) as f64).max(1.0)).collect();
        let brightest = levels.iter().copied().fold(0.0, f64::max);
        let mut known: Vec<bool> = levels.iter().map(|paper| *paper > SHADOW * brightest).collect();
        let mut grown: Vec<usize> = (0..levels.len()).filter(|at| known[*at]).collect();
        while let Some(from) = grown.pop() {
            for at in near(from, columns, rows) {
                if !known[at] && levels[at] > SHADOW * levels[from] {
                    known[at] = true;
                    grown.push(at);
                }
            }
        }
        // Blocks in the middle of a patch have the paper of their neighbors.
        while known.contains(&false) {
            let before = known.clone();
            for at in (0..levels.len()).filter(|at| !before[*at]) {
                let near = near(at, columns, rows).filter(|k| before[*k]);
                let papers: Vec<f64> = near.map(|k| levels[k]).collect();
                if !papers.is_empty() {
                    levels[at] = papers.iter().sum::<f64>() / papers.len() as f64;
                    known[at] = true;
                }
            }
        }
        // Brightest, then darkest of the neighbors (a morphological closing): a patch as large as a
        // few blocks is filled, and the edge of a shadow stays where it is.
        let each = |levels: &[f64], of: &dyn Fn(&[f64]) -> f64| -> Vec<f64> {
            let near = |at| near(at, columns, rows).map(|k| levels[k]).collect::<Vec<_>>();
            (0..levels.len()).map(|at| of(&near(at))).collect()
        };
        levels = each(&levels, &|near| near.iter().copied().fold(0.0, f64::max));
        levels = each(&levels, &|near| near.iter().copied().fold(f64::MAX, f64::min));
        levels = each(&levels, &|near| near.iter().sum::<f64>() / near.len() as f64);
        Self { block, columns, rows, levels }
    }

    /// At a pixel, between the middles of blocks.
    fn at(&self, x: usize, y: usize) -> f64 {
        let along = |at: usize, n: usize| {
            let place = ((at as f64 + 0.5) / self.block as f64 - 0.5).clamp(0.0, (n - 1) as f64);
            let first = level(place).min(n - 1);
            (first, (first + 1).min(n - 1), place - first as f64)
        };
        let (left, right, across) = along(x, self.columns);
        let (top, bottom, down) = along(y, self.rows);
        let row = |row: usize| {
            let [a, b] = [left, right].map(|column| self.levels[row * self.columns + column]);
            a + across * (b - a)
        };
        row(top) + down * (row(bottom) - row(top))
    }
}

/// A cell and those around it.
fn near(at: usize, columns: usize, rows: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (at % columns, at / columns);
    let around = |at: usize, n: usize| at.saturating_sub(1)..(at + 2).min(n);
    around(y, rows).flat_map(move |y| around(x, columns).map(move |x| y * columns + x))
}

/// The area within a closed contour, negative where it runs clockwise.
fn area(contour: &Contour) -> f64 {
    let legs = contour.iter().zip(contour.iter().cycle().skip(1));
    legs.map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum()
}

/// The value below which a share of counted values lies.
fn quantile(counts: &[usize; 256], share: f64) -> usize {
    let total: usize = counts.iter().sum();
    let mut passed = 0;
    let wanted = share * total as f64;
    counts
        .iter()
        .position(|n| {
            passed += n;
            passed as f64 >= wanted
        })
        .unwrap_or(255)
}

#[expect(clippy::cast_possible_truncation, reason = "0 to 255")]
fn level(value: f64) -> usize {
    (value as usize).min(255)
}

/// The pixel of the field at a place, which is not in its margin.
#[expect(clippy::cast_possible_truncation, reason = "within the picture")]
fn pixel(place: f64, side: usize) -> usize {
    (place.round().max(1.0) as usize).min(side - 2)
}
