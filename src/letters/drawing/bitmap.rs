//! Bitmaps: line art, handwriting on paper and logos, turned upright by their EXIF. A sheet of
//! paper on a table is cut out of it and seen square on ([`paper_photo`]).
//!
//! The ink is separated from the paper ([`super::ink`]); its contours lie between pixels, by
//! marching squares. Each patch of ink with its holes is traced like a typeface's characters
//! ([`crate::center_line`]), or along its outline if it is an area ([`areas`]). A line has the hue
//! of its ink unless that is gray. Photographs of anything else are refused.

use std::io::Cursor;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageReader, RgbImage, RgbaImage};

use super::areas::{self, Patch};
use super::ink::{Field, RIM, even_paper};
use super::levels::{contours, level};
use super::paper_photo::{self, Corners, Map};
use super::{ColoredLine, MAX_POINTS};
use crate::options::{LetterOptions, Trace};
use crate::outline::{Contour, Filled, area, mean_stroke_width};
use crate::vector::{between, legs};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Budget, JpegFrame};
use noctograph_core::geometry::{bounds, distance, polyline_length_m};

/// Pixels of the longer side to which a picture is made smaller.
const LONGER_SIDE: u32 = 1200;

/// Steps of decoding a byte, so that a picture of three channels may have 40 million pixels.
const STEPS: usize = 8;

/// Side of the smallest patch, and least length along the picture's rim of a patch that surrounds
/// the paper, by the picture's longer side.
const SPECK: f64 = 2e-3;
const SURROUNDINGS: f64 = 0.3;
/// Largest side of a speck of dust, by the picture's longer side and by the mean width of the
/// largest patch, and the largest share of specks in the ink.
const DUST: [f64; 2] = [1e-2, 0.65];
const DUSTY: f64 = 0.5;
/// Share of a picture in shades beyond which it is a photograph. Measured: 0.08 to 0.5 for a
/// portrait and seven color photographs of scikit-image (astronaut, cat, coffee, grass, gravel,
/// motorcycle, rocket), 0.01 to 0.04 for three gray ones, up to 0.03 for drawings, boards and pages
/// of print.
const SHADES: f64 = 0.04;
/// A patch over the rim of a photographed picture is dropped from this mean width on, by the longer
/// side, or if this share of its outline lies along the rim.
const OVER_RIM: f64 = 0.02;
const ALONG: f64 = 0.1;
/// Lines from which on a picture is told to be fine, as a QR code is.
const FINE: usize = 60;
/// Share of a picture in faint marks from which on there is a warning.
const FAINT: f64 = 0.02;
/// Backgrounds for a transparent picture: the first on which nearly all of its ink stands out. A
/// mostly opaque picture that is as white as paper gets white.
const GROUNDS: [u8; 3] = [255, 0, 128];
const APART: u8 = 40;
const LOST: f64 = 0.01;
const PAPER: f64 = 0.5;
/// Least chroma of a colored ink, by its contrast, and by the paper's brightness.
const CHROMA: f64 = 0.2;
const GRAY: f64 = 0.04;

/// Lines of a bitmap.
pub(super) struct Traced {
    /// In pixels, y up, with their colors; black where the ink is gray.
    pub(super) lines: Vec<ColoredLine>,
    /// Parts that are not drawn.
    pub(super) warnings: Vec<String>,
    /// Corners of the sheet that is drawn, in pixels of the file.
    pub(super) corners_px: Option<Corners>,
    /// From pixels of the lines, y down, to those of the file.
    pub(super) in_file: Map,
}

/// Traces a bitmap. `size` gives the size of a pixel in cap heights from the bounds of the ink.
pub(super) fn read(
    bytes: &[u8],
    options: &LetterOptions,
    size: impl Fn([f64; 4]) -> Result<f64>,
    file: &str,
) -> Result<Traced> {
    let budget = Budget::new(file, "make the picture smaller, or draw less");
    let (mut whole, shrunk) = upright(bytes, &budget, file)?;
    let is_checkered = without_checkerboard(&mut whole);
    let corners = corners(&whole, shrunk, options, file)?;
    let in_whole = corners.map(|corners| corners.map(|corner| corner.map(|x| x / shrunk)));
    let picture = in_whole.map_or_else(|| whole.clone(), |it| paper_photo::square_on(&whole, &it));
    let field = Field::new(&picture).ok_or_else(|| blank(file))?;
    if corners.is_none() && field.shades > SHADES {
        let hint = "draw its lines on paper or in a drawing program; where it shows a sheet of paper, \
                    name the corners of that (letters.corners_px)";
        let photograph = "a photograph, of tones without lines";
        return Err(Error::input(file, photograph, DRAWINGS, hint).coded("picture-none"));
    }
    let (patches, n_cut) = field.patches();
    let (patches, n_specks) = without_dust(patches, field.width.max(field.height) as f64);
    if patches.is_empty() {
        return Err(blank(file));
    }
    let extent = bounds(patches.iter().flatten().flatten().copied());
    let larger = (extent[2] - extent[0]).max(extent[3] - extent[1]);
    let cap_height_px = 1.0 / size(extent)?;
    let patch = |contours| Patch::new(contours, [larger, cap_height_px], &budget);
    let patches: Vec<Patch<'_>> = patches.into_iter().map(patch).collect();
    let lines: Vec<Vec<[f64; 2]>> = match options.trace {
        Trace::CenterLine => areas::lines(patches, larger),
        Trace::Outline => patches.iter().flat_map(Patch::rim).collect(),
    };
    budget.check()?;
    let lines = lines.into_iter().filter(|line| line.len() > 1);
    let lines = lines.map(|line| (field.hue(&line), line));
    let lines: Vec<ColoredLine> = lines.map(|(color, line)| (line, color)).collect();
    if lines.iter().map(|(line, _)| line.len()).sum::<usize>() > MAX_POINTS {
        return Err(super::too_many(file));
    }
    let mut warnings = Vec::new();
    if is_checkered {
        let text = "the checkerboard that stands for transparency is part of this picture: it is \
                    left out";
        warnings.push(text.to_owned());
    }
    if n_specks > 0 {
        warnings.push(format!(
            "{n_specks} speck(s), as of dust, are not drawn: they are smaller than the width of the \
             lines"
        ));
    }
    if n_cut > 0 {
        warnings.push(format!(
            "shapes at the picture's rim are not drawn ({n_cut}): they look like what lies around the \
             paper; leave a margin around the drawing"
        ));
    }
    if field.faint > FAINT {
        let text = "marks that are much fainter than the rest are not drawn, such as the paper's \
                    rulings: draw over those that are meant";
        warnings.push(text.to_owned());
    }
    if field.rulings > 0 {
        warnings.push(format!(
            "{} pale lines from rim to rim are not drawn, as the paper's rulings: draw over those that \
             are meant",
            field.rulings
        ));
    }
    if field.inner_edges() > field.width.max(field.height) {
        warnings.push("areas of several colors that touch are drawn as one: leave a gap".into());
    }
    if lines.len() >= FINE {
        warnings
            .push("light fills the gaps of so fine a picture: a QR code cannot be scanned".into());
    }
    if let Some(corners) = corners.filter(|_| options.corners_px.is_none()) {
        let corners = corners.map(|[x, y]| format!("{x:.0},{y:.0}")).join(" ");
        warnings.push(format!(
            "drawn is the sheet of paper with its corners at {corners} (letters.corners_px)"
        ));
    }
    let in_file = match &corners {
        Some(corners) => paper_photo::back(corners, picture.dimensions()),
        None => Map([[shrunk, 0.0, 0.0], [0.0, shrunk, 0.0], [0.0, 0.0, 1.0]]),
    };
    Ok(Traced { lines, warnings, corners_px: corners, in_file })
}

const DRAWINGS: &str = "a drawing, handwriting or a logo";

fn blank(file: &str) -> Error {
    let content = "a picture without lines that stand out from its paper";
    let hint = "photograph the drawing in even light, or draw with a darker pen";
    Error::input(file, content, DRAWINGS, hint).coded("picture-none")
}

/// Corners of the sheet of paper in a picture, in pixels of the file: a pixel of the picture is
/// `shrunk` of them. `None` where the whole picture is drawn.
fn corners(
    picture: &RgbImage,
    shrunk: f64,
    options: &LetterOptions,
    file: &str,
) -> Result<Option<Corners>> {
    let Some([a, b, c, d, e, f, g, h]) = options.corners_px else {
        let seen = paper_photo::corners(picture).filter(|_| even_paper(picture).is_none());
        return Ok(seen.map(|corners| corners.map(|corner| corner.map(|x| x * shrunk))));
    };
    let corners = [[a, b], [c, d], [e, f], [g, h]];
    if paper_photo::is_convex(&corners) {
        return Ok(Some(corners));
    }
    let wanted = "x and y of the upper left, upper right, lower right and lower left corner";
    let hint = "read the corners of the sheet off the picture, clockwise from upper left";
    Err(Error::input("corners", format!("{corners:?}"), wanted, hint).in_file(file, None))
}

fn unreadable(file: &str, cause: impl std::fmt::Display) -> Error {
    let wanted = "a picture as PNG, JPEG, WebP, GIF or BMP";
    Error::input(file, cause, wanted, "choose another file; or save it as PNG, or smaller")
}

/// The picture in upright position, opaque, and at most as large as needed; and the number of the
/// file's pixels along one of its pixels.
fn upright(bytes: &[u8], budget: &Budget, file: &str) -> Result<(RgbImage, f64)> {
    // Phones and programs give files the ending of another kind.
    if bytes.get(4..).is_some_and(|rest| rest.starts_with(b"ftyp")) {
        return Err(super::foreign("heic", file));
    }
    if bytes.starts_with(b"%PDF") {
        return Err(super::foreign("pdf", file));
    }
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let reader = reader.map_err(|e| unreadable(file, e))?;
    let mut decoder = reader.into_decoder().map_err(|e| unreadable(file, e))?;
    let (width, height) = decoder.dimensions();
    if width < 3 || height < 3 {
        return Err(unreadable(file, format!("{width} × {height} pixels")));
    }
    let n_bytes = usize::try_from(decoder.total_bytes()).unwrap_or(usize::MAX);
    budget.steps(STEPS.saturating_mul(n_bytes))?;
    if let Some(frame) = JpegFrame::parse(bytes) {
        let [n_bytes, n_steps] = [frame.decoded_bytes(), frame.later_scans_ns()]
            .map(|n| usize::try_from(n).unwrap_or(usize::MAX));
        budget.bytes(n_bytes)?;
        budget.steps(n_steps)?;
        if !frame.has_end {
            return Err(unreadable(file, "a JPEG that is cut off"));
        }
    }
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let mut picture = DynamicImage::from_decoder(decoder).map_err(|e| unreadable(file, e))?;
    if width.max(height) > LONGER_SIDE {
        picture = picture.thumbnail(LONGER_SIDE, LONGER_SIDE);
    }
    picture.apply_orientation(orientation);
    let shrunk = f64::from(width.max(height)) / f64::from(picture.width().max(picture.height()));
    let is_opaque = !picture.color().has_alpha();
    let picture = if is_opaque { picture.into_rgb8() } else { on_ground(&picture.into_rgba8()) };
    Ok((picture, shrunk))
}

/// A transparent picture on a ground from which its ink stands out.
fn on_ground(picture: &RgbaImage) -> RgbImage {
    let opaque = picture.pixels().filter(|pixel| pixel.0[3] > 127);
    let n_opaque = opaque.clone().count() as f64;
    let n_lost = GROUNDS.map(|ground| {
        let lost = opaque
            .clone()
            .filter(|pixel| pixel.0[..3].iter().all(|value| value.abs_diff(ground) < APART));
        lost.count() as f64
    });
    let all = f64::from(picture.width()) * f64::from(picture.height());
    let has_paper = n_opaque > PAPER * all && n_lost[0] > PAPER * n_opaque;
    let stands_out = (0..GROUNDS.len()).find(|k| n_lost[*k] <= LOST * n_opaque);
    let ground = if has_paper { GROUNDS[0] } else { GROUNDS[stands_out.unwrap_or(0)] };
    let mut opaque = RgbImage::new(picture.width(), picture.height());
    for (pixel, rgba) in opaque.pixels_mut().zip(picture.pixels()) {
        let [.., alpha] = rgba.0.map(u32::from);
        for (channel, value) in pixel.0.iter_mut().zip(rgba.0) {
            let sum = u32::from(value) * alpha + u32::from(ground) * (255 - alpha);
            *channel = u8::try_from((sum + 127) / 255).unwrap_or(255);
        }
    }
    opaque
}

impl Field {
    /// Patches of ink, each a contour with its holes, and the number of patches that are dropped:
    /// those around the paper, and those over the rim of a sheet, such as a hand or the table.
    fn patches(&self) -> (Vec<Vec<Contour>>, usize) {
        let side = self.width.max(self.height) as f64;
        let contours = contours(&self.ink, [self.width, self.height], RIM);
        let patches = nested(contours, (SPECK * side * SPECK * side).max(2.0));
        let (around, patches): (Vec<_>, Vec<_>) = patches.into_iter().partition(|patch| {
            let along = self.along_rim(&patch[0]);
            let is_over = mean_stroke_width(patch) > OVER_RIM * side
                || along > ALONG * polyline_length_m(&patch[0]);
            along > SURROUNDINGS * side || !self.is_clean && along > 0.0 && is_over
        });
        if patches.is_empty() { (around, 0) } else { (patches, around.len()) }
    }

    /// Length of a contour along the rim of the picture.
    fn along_rim(&self, contour: &Contour) -> f64 {
        let [right, bottom] = [self.width - 2, self.height - 2].map(|side| side as f64);
        let legs = legs(contour).filter(|leg| {
            leg.iter().all(|[x, y]| *x < 1.0 || *x > right || -y < 1.0 || -y > bottom)
        });
        legs.map(|[a, b]| distance(a, b)).sum()
    }

    /// The hue of the ink along a line at full saturation; black where it is gray.
    fn hue(&self, line: &[[f64; 2]]) -> [u8; 3] {
        let mut sum = [0.0; 3];
        let [mut n, mut contrast] = [0.0; 2];
        for [from, to] in legs(line) {
            for share in [0.0, 0.25, 0.5, 0.75] {
                let pixel = self.pixel(between(from, to, share));
                if self.ink[pixel] > RIM {
                    (0..3).for_each(|i| sum[i] += self.color[pixel][i]);
                    contrast += self.contrast[pixel];
                    n += 1.0;
                }
            }
        }
        let n = f64::max(n, 1.0);
        saturated(sum.map(|value| value / n), (CHROMA * contrast / n).max(GRAY))
    }

    /// The pixel at a place, outside the margin.
    #[expect(clippy::cast_possible_truncation, reason = "within the picture")]
    fn pixel(&self, [x, y]: [f64; 2]) -> usize {
        let [row, column] = [(-y, self.height), (x, self.width)]
            .map(|(place, side)| (place.round().max(1.0) as usize).min(side - 2));
        row * self.width + column
    }
}

/// The hue of a color at full saturation; black if its chroma is at most `gray`.
fn saturated(color: [f64; 3], gray: f64) -> [u8; 3] {
    let least = color.into_iter().fold(f64::MAX, f64::min);
    let most = color.into_iter().fold(0.0, f64::max);
    if most - least <= gray {
        return [0; 3];
    }
    // In halves, so that strokes of one pen have one color.
    color.map(|value| [0, 128, 255][level(2.0 * (value - least) / (most - least) + 0.5).min(2)])
}

/// Patches without specks that no pen of the drawing leaves, and the number of these.
fn without_dust(patches: Vec<Vec<Contour>>, side: f64) -> (Vec<Vec<Contour>>, usize) {
    let ink = |patch: &Vec<Contour>| patch.iter().map(|contour| area(contour)).sum::<f64>();
    let largest = patches.iter().max_by(|a, b| ink(a).total_cmp(&ink(b)));
    let most = largest.map_or(0.0, |it| (DUST[1] * mean_stroke_width(it)).min(DUST[0] * side));
    let is_speck = |patch: &Vec<Contour>| {
        let [left, bottom, right, top] = bounds(patch[0].iter().copied());
        (right - left).max(top - bottom) <= most
    };
    let (specks, drawn): (Vec<_>, Vec<_>) = patches.iter().partition(|patch| is_speck(patch));
    let sum = |patches: &[&Vec<Contour>]| patches.iter().map(|patch| ink(patch)).sum::<f64>();
    if specks.is_empty() || sum(&specks) > DUSTY * sum(&drawn) {
        return (patches, 0);
    }
    let n_specks = specks.len();
    (patches.into_iter().filter(|patch| !is_speck(patch)).collect(), n_specks)
}

/// Replaces the checkerboard that stands for transparency by one of its two grays; whether there is
/// one: most pixels have two grays, in squares of one size.
fn without_checkerboard(picture: &mut RgbImage) -> bool {
    const NEAR: u8 = 5;
    let gray = |pixel: &image::Rgb<u8>| {
        let [r, g, b] = pixel.0;
        (r.max(g).max(b) - r.min(g).min(b) <= 2 * NEAR).then_some(g)
    };
    let mut counts = [0_usize; 256];
    picture.pixels().filter_map(gray).for_each(|tone| counts[usize::from(tone)] += 1);
    let sum = |tone: u8| -> usize {
        counts[usize::from(tone.saturating_sub(NEAR))..=usize::from(tone.saturating_add(NEAR))]
            .iter()
            .sum()
    };
    let most = |apart: &dyn Fn(u8) -> bool| {
        (0..=255).filter(|tone| apart(*tone)).max_by_key(|tone| (sum(*tone), *tone))
    };
    let Some(first) = most(&|_| true) else { return false };
    let Some(second) = most(&|tone| (8..=90).contains(&tone.abs_diff(first))) else { return false };
    let n = picture.pixels().len();
    if 5 * sum(second) < n || 2 * (sum(first) + sum(second)) < n {
        return false;
    }
    let tone_of = |pixel: &image::Rgb<u8>| {
        let tone = gray(pixel)?;
        [first, second].into_iter().find(|known| tone.abs_diff(*known) <= NEAR)
    };
    // Lengths of the runs of one tone between two of the other, along rows.
    let mut lengths = std::collections::BTreeMap::<usize, usize>::new();
    for row in picture.rows() {
        let tones: Vec<Option<u8>> = row.map(tone_of).collect();
        let runs: Vec<&[Option<u8>]> = tones.chunk_by(|a, b| a == b).collect();
        for run in runs.windows(3) {
            if run.iter().all(|run| run[0].is_some()) {
                *lengths.entry(run[1].len()).or_default() += 1;
            }
        }
    }
    let n_runs: usize = lengths.values().sum();
    let usual = lengths.iter().max_by_key(|(_, n)| **n).map_or(0, |(length, _)| *length);
    let n_alike: usize = lengths.range(usual.saturating_sub(1)..=usual + 1).map(|(_, n)| n).sum();
    if usual < 3 || n_runs < picture.height() as usize || 3 * n_alike < 2 * n_runs {
        return false;
    }
    for pixel in picture.pixels_mut().filter(|pixel| tone_of(pixel).is_some()) {
        pixel.0 = [first; 3];
    }
    true
}

/// Patches of ink, each a contour with its holes, of at least an area.
fn nested(contours: Vec<Contour>, least: f64) -> Vec<Vec<Contour>> {
    let (outer, holes): (Vec<Contour>, Vec<Contour>) = contours
        .into_iter()
        .filter(|contour| area(contour).abs() >= least)
        .partition(|contour| area(contour) > 0.0);
    let mut patches: Vec<Vec<Contour>> = outer.into_iter().map(|c| vec![c]).collect();
    // The smallest patch that holds a point of a hole has the hole.
    patches.sort_by(|a, b| area(&a[0]).total_cmp(&area(&b[0])));
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
