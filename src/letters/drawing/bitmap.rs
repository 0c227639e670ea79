//! Bitmaps: line art, handwriting on paper and logos, turned upright according to their EXIF data.
//!
//! The ink is separated from the paper ([`super::ink`]). Its patches ([`super::patches`]) are
//! traced along their center like the characters of a typeface, or along their outline if they are
//! areas ([`areas`]). A line has the hue of its ink, or is black if the ink is gray. Photographs of
//! anything else are rejected.

use std::io::Cursor;

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder, ImageReader, Rgb, RgbImage, RgbaImage};

use super::areas::{self, Patch};
use super::ink::Field;
use super::patches::{Counts, without_specks};
use super::sheet::{Corners, Map, is_convex, square_on};
use super::{ColoredLine, MAX_POINTS};
use crate::options::{LetterOptions, Trace};
use crate::outline::Contour;
use noctograph_core::diagnostic::{Diagnostic, Warned};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Budget, JpegFrame};
use noctograph_core::geometry::bounds;

/// Maximum length of a picture's longer side, in pixels. Larger pictures are downscaled to it.
const LONGER_SIDE: u32 = 1200;

/// Budget steps for decoding a byte. A picture of three channels may have 40 million pixels.
const STEPS_PER_BYTE: usize = 8;

/// Maximum fraction of pixels with soft tones in a photograph of lines.
const SOFT: f64 = 0.04;

/// Background levels for a transparent picture. The first one from which nearly all of the ink
/// stands out is used. Behind a mostly opaque picture with white paper, the background is white.
const GROUNDS: [u8; 3] = [255, 0, 128];
/// Number of levels by which ink must stand out from a background, and the maximum fraction of ink
/// that does not.
const APART: u8 = 40;
const LOST: f64 = 0.01;
/// Minimum fraction of opaque pixels, and of white pixels among them, in a picture with its paper.
const PAPER: f64 = 0.5;

/// Maximum difference between a pixel of a checkerboard and its nominal gray, and range of the
/// difference between the two grays.
const GRAY: u8 = 5;
const GRAYS_APART: std::ops::RangeInclusive<u8> = 8..=90;
/// Maximum number of blended pixels between two squares of a scaled checkerboard.
const BLENDED: usize = 2;

/// Lines traced in a bitmap.
pub(super) struct Traced {
    /// Lines in pixels (y up), with their colors. Gray ink is drawn in black.
    pub(super) lines: Vec<ColoredLine>,
    /// Corners of the cropped sheet, in pixels of the file.
    pub(super) corners_px: Option<Corners>,
    /// Map from pixel coordinates of the lines (y down) to those of the file.
    pub(super) in_file: Map,
}

/// Traces the lines of a bitmap, and returns them with warnings. `size` gives the size of a pixel
/// in cap heights, from the bounds of the ink. Fails if there is no ink, or for a photograph of
/// anything but lines.
pub(super) fn read(
    bytes: &[u8],
    options: &LetterOptions,
    size: impl Fn([f64; 4]) -> Result<f64>,
    file: &str,
) -> Result<Warned<Traced>> {
    let budget = Budget::new(file, "make the picture smaller, or draw less");
    // The picture is turned upright, placed on a plain background, and cropped if the sheet's
    // corners are known.
    let Upright { mut picture, file_scale, is_checkered } = upright(bytes, &budget, file)?;
    let mut in_file = Map([[file_scale, 0.0, 0.0], [0.0, file_scale, 0.0], [0.0, 0.0, 1.0]]);
    let corners = corners(options, file)?;
    if let Some(corners) = corners {
        picture = square_on(&picture, &corners.map(|corner| corner.map(|x| x / file_scale)));
        in_file = Map::of_sheet(&corners, picture.dimensions());
    }
    // The ink is separated, and photographs of anything but lines are rejected.
    let mut field = Field::new(&picture).ok_or_else(|| blank(file))?;
    if corners.is_none() && field.has_grain && field.soft > SOFT {
        return Err(photograph(file));
    }
    let n_rulings = field.drop_rulings();
    // Specks and surroundings are dropped before lines are traced, because they would distort the
    // measured pen width.
    let (patches, n_cut) = field.patches();
    let (patches, n_specks) = without_specks(patches, field.width.max(field.height) as f64);
    if patches.is_empty() {
        return Err(blank(file));
    }
    let traced = lines(patches, options.trace, size, &budget)?.into_iter();
    let colored = traced.filter(|line| line.len() > 1).map(|line| {
        let hue = field.hue(&line);
        (line, hue)
    });
    let lines: Vec<ColoredLine> = colored.collect();
    if lines.iter().map(|(line, _)| line.len()).sum::<usize>() > MAX_POINTS {
        return Err(super::too_many(file));
    }
    let counts = Counts { n_cut, n_specks, n_rulings, n_lines: lines.len() };
    let mut warnings = field.warnings(&counts, corners.is_some());
    if is_checkered {
        warnings.insert(0, Diagnostic::warning("picture-checkerboard", CHECKERBOARD));
    }
    Ok(Warned { product: Traced { lines, corners_px: corners, in_file }, warnings })
}

/// Returns the center lines or outlines of patches of ink, in pixels. `size` gives the size of a
/// pixel in cap heights, from the bounds of the ink. Returns the error of a spent budget.
fn lines(
    patches: Vec<Vec<Contour>>,
    trace: Trace,
    size: impl Fn([f64; 4]) -> Result<f64>,
    budget: &Budget,
) -> Result<Vec<Vec<[f64; 2]>>> {
    let extent = bounds(patches.iter().flatten().flatten().copied());
    let larger_px = (extent[2] - extent[0]).max(extent[3] - extent[1]);
    let cap_height_px = 1.0 / size(extent)?;
    // All patches are traced before any is drawn, because letters depend on their neighbors.
    let patches = patches.into_iter();
    let patches = patches.map(|contours| Patch::new(contours, [larger_px, cap_height_px], budget));
    let patches: Vec<Patch<'_>> = patches.collect();
    let lines = match trace {
        Trace::CenterLine => areas::lines(&patches, larger_px),
        Trace::Outline => patches.iter().flat_map(Patch::outline).collect(),
    };
    budget.check()?;
    Ok(lines)
}

/// Warning about a picture that contains a checkerboard.
const CHECKERBOARD: &str = "the checkerboard that stands for transparency in this picture is left \
                            out";

/// Files that an error message asks for instead of a picture without lines.
const DRAWINGS: &str = "a drawing, handwriting or a logo";

/// Returns the error for a photograph without lines.
fn photograph(file: &str) -> Error {
    let hint = "draw its lines on paper or in a drawing program, or scan the paper with a \
                phone's scanner app. To cut out a sheet of paper, set letters.corners_px";
    let photograph = "a photograph, which has tones but no lines";
    Error::input(file, photograph, DRAWINGS, hint).coded("picture-none")
}

/// Returns the error for a picture without ink.
fn blank(file: &str) -> Error {
    let content = "a picture without lines that stand out from its paper";
    let hint = "photograph the drawing in even light, or draw with a darker pen";
    Error::input(file, content, DRAWINGS, hint).coded("picture-none")
}

/// Returns the corners of the sheet that the options give, in pixels of the file, or `None` if they
/// give none. Fails if the corners are not convex in clockwise order.
fn corners(options: &LetterOptions, file: &str) -> Result<Option<Corners>> {
    let Some([a, b, c, d, e, f, g, h]) = options.corners_px else { return Ok(None) };
    let corners = [[a, b], [c, d], [e, f], [g, h]];
    if is_convex(&corners) {
        return Ok(Some(corners));
    }
    let wanted = "x and y of the upper left, upper right, lower right and lower left corner";
    let hint = "give the pixels of the sheet's corners, clockwise from the upper left";
    Err(Error::input("corners", format!("{corners:?}"), wanted, hint).in_file(file, None))
}

/// Returns the error for a picture that cannot be decoded.
fn unreadable(file: &str, cause: impl std::fmt::Display) -> Error {
    let wanted = "a picture as PNG, JPEG, WebP, GIF or BMP";
    Error::input(file, cause, wanted, "choose another file, or save the picture as a smaller PNG")
}

/// Picture that has been turned upright, placed on an opaque background, and downscaled.
struct Upright {
    picture: RgbImage,
    /// Size of the picture's pixels in pixels of the file.
    file_scale: f64,
    /// True if a checkerboard that represented transparency has been removed.
    is_checkered: bool,
}

/// Decodes a picture, removes a checkerboard, downscales the picture to [`LONGER_SIDE`] and turns
/// it upright. Returns [`Error::Input`] if the file is unsupported or broken.
fn upright(bytes: &[u8], budget: &Budget, file: &str) -> Result<Upright> {
    refuse_foreign(bytes, file)?;
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let reader = reader.map_err(|e| unreadable(file, e))?;
    let mut decoder = reader.into_decoder().map_err(|e| unreadable(file, e))?;
    let (width, height) = decoder.dimensions();
    if width < 3 || height < 3 {
        return Err(unreadable(file, format!("{width} × {height} pixels")));
    }
    spend_decoding(bytes, decoder.total_bytes(), budget, file)?;
    // The picture is downscaled before it is turned, because this is less work.
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let mut picture = DynamicImage::from_decoder(decoder).map_err(|e| unreadable(file, e))?;
    // The squares of a checkerboard have exact colors only at the file's original size.
    let mut is_checkered = false;
    if is_opaque(&picture) {
        let mut opaque = picture.into_rgb8();
        is_checkered = without_checkerboard(&mut opaque);
        picture = opaque.into();
    }
    if width.max(height) > LONGER_SIDE {
        picture = picture.thumbnail(LONGER_SIDE, LONGER_SIDE);
    }
    picture.apply_orientation(orientation);
    let file_scale =
        f64::from(width.max(height)) / f64::from(picture.width().max(picture.height()));
    let is_opaque = !picture.color().has_alpha();
    let picture = if is_opaque { picture.into_rgb8() } else { on_ground(&picture.into_rgba8()) };
    Ok(Upright { picture, file_scale, is_checkered })
}

/// True for a picture of 8 bits without transparent pixels.
fn is_opaque(picture: &DynamicImage) -> bool {
    match picture {
        DynamicImage::ImageRgb8(_) | DynamicImage::ImageLuma8(_) => true,
        DynamicImage::ImageRgba8(picture) => picture.pixels().all(|pixel| pixel.0[3] == 255),
        _ => false,
    }
}

/// Returns [`Error::Input`] for unsupported kinds of files, which it recognizes by their first
/// bytes, regardless of the file extension.
fn refuse_foreign(bytes: &[u8], file: &str) -> Result<()> {
    if bytes.get(4..).is_some_and(|rest| rest.starts_with(b"ftyp")) {
        return Err(super::foreign("heic", file));
    }
    if bytes.starts_with(b"%PDF") {
        return Err(super::foreign("pdf", file));
    }
    Ok(())
}

/// Charges the work and memory of decoding, both known from the header, to the budget. `n_decoded`
/// is the number of bytes of the decoded picture. Returns [`Error::Input`] for a truncated JPEG.
fn spend_decoding(bytes: &[u8], n_decoded: u64, budget: &Budget, file: &str) -> Result<()> {
    let n_decoded = usize::try_from(n_decoded).unwrap_or(usize::MAX);
    budget.steps(STEPS_PER_BYTE.saturating_mul(n_decoded))?;
    let Some(frame) = JpegFrame::parse(bytes) else { return Ok(()) };
    let [n_bytes, n_steps] = [frame.decoded_bytes(), frame.later_scans_ns()]
        .map(|n| usize::try_from(n).unwrap_or(usize::MAX));
    budget.bytes(n_bytes)?;
    budget.steps(n_steps)?;
    if frame.has_end { Ok(()) } else { Err(unreadable(file, "a truncated JPEG")) }
}

/// Returns a transparent picture on a background from which its ink stands out.
fn on_ground(picture: &RgbaImage) -> RgbImage {
    // Only pixels that are at least half opaque are counted. Those that resemble a background would
    // be lost on it.
    let opaque = picture.pixels().filter(|pixel| pixel.0[3] > 127);
    let n_opaque = opaque.clone().count() as f64;
    let n_lost = GROUNDS.map(|ground| {
        let lost = opaque
            .clone()
            .filter(|pixel| pixel.0[..3].iter().all(|value| value.abs_diff(ground) < APART));
        lost.count() as f64
    });
    let n_pixels = f64::from(picture.width()) * f64::from(picture.height());
    let has_paper = n_opaque > PAPER * n_pixels && n_lost[0] > PAPER * n_opaque;
    let contrasting = (0..GROUNDS.len()).find(|k| n_lost[*k] <= LOST * n_opaque);
    let ground = if has_paper { GROUNDS[0] } else { GROUNDS[contrasting.unwrap_or(0)] };
    // Alpha compositing: value · α + background · (1 - α), rounded.
    let mut composite = RgbImage::new(picture.width(), picture.height());
    for (pixel, rgba) in composite.pixels_mut().zip(picture.pixels()) {
        let [.., alpha] = rgba.0.map(u32::from);
        for (channel, value) in pixel.0.iter_mut().zip(rgba.0) {
            let sum = u32::from(value) * alpha + u32::from(ground) * (255 - alpha);
            *channel = u8::try_from((sum + 127) / 255).unwrap_or(255);
        }
    }
    composite
}

/// Replaces a checkerboard that represents transparency with one of its two grays. Returns true if
/// there is a checkerboard, that is, if two grays cover most pixels in squares of one size.
fn without_checkerboard(picture: &mut RgbImage) -> bool {
    let Some(grays) = two_grays(picture) else { return false };
    // The lengths of runs of one gray between two runs of the other are counted along rows. Pixels
    // between two squares may have an intermediate gray.
    let mut n_of_length = std::collections::BTreeMap::<usize, usize>::new();
    for row in picture.rows() {
        let tones: Vec<_> = row.map(|pixel| near_gray(pixel, grays)).collect();
        let runs = tones.chunk_by(|a, b| a == b);
        let runs: Vec<_> = runs.filter(|run| run[0].is_some() || run.len() > BLENDED).collect();
        let squares = runs.windows(3).filter(|runs| {
            runs.iter().all(|run| run[0].is_some()) && runs.windows(2).all(|p| p[0][0] != p[1][0])
        });
        for run in squares {
            *n_of_length.entry(run[1].len()).or_default() += 1;
        }
    }
    // Squares are at least 3 pixels wide. Two thirds of the runs must have the usual length, and
    // there must be at least one run per row on average.
    let n_runs: usize = n_of_length.values().sum();
    let usual = n_of_length.iter().max_by_key(|(_, n)| **n).map_or(0, |(length, _)| *length);
    let n_usual: usize =
        n_of_length.range(usual.saturating_sub(1)..=usual + 1).map(|(_, n)| n).sum();
    if usual < 3 || n_runs < picture.height() as usize || 3 * n_usual < 2 * n_runs {
        return false;
    }
    let between = grays[0].min(grays[1])..=grays[0].max(grays[1]);
    for pixel in picture.pixels_mut() {
        let is_between = is_gray(pixel) && between.contains(&pixel.0[1]);
        if is_between || near_gray(pixel, grays).is_some() {
            pixel.0 = [grays[0]; 3];
        }
    }
    true
}

/// Returns the most frequent gray of a picture, and the most frequent gray at a distance of
/// [`GRAYS_APART`] from it. Returns `None` unless both together cover half of the picture, and the
/// second a fifth.
fn two_grays(picture: &RgbImage) -> Option<[u8; 2]> {
    let mut counts = [0_usize; 256];
    for [r, g, b] in picture.pixels().map(|pixel| pixel.0) {
        counts[usize::from(g)] += usize::from(is_gray(&Rgb([r, g, b])));
    }
    let n_near = |tone: u8| -> usize {
        let range = tone.saturating_sub(GRAY)..=tone.saturating_add(GRAY);
        range.map(|tone| counts[usize::from(tone)]).sum()
    };
    let first = (0..=255).max_by_key(|tone| n_near(*tone))?;
    let others = (0..=255_u8).filter(|tone| GRAYS_APART.contains(&tone.abs_diff(first)));
    let second = others.max_by_key(|tone| (n_near(*tone), *tone))?;
    let n_pixels = picture.pixels().len();
    let is_half = 2 * (n_near(first) + n_near(second)) >= n_pixels;
    (is_half && 5 * n_near(second) >= n_pixels).then_some([first, second])
}

/// Returns the one of two grays to which a pixel is close, or `None` if it is close to neither.
fn near_gray(pixel: &Rgb<u8>, grays: [u8; 2]) -> Option<u8> {
    grays.into_iter().find(|gray| is_gray(pixel) && pixel.0[1].abs_diff(*gray) <= GRAY)
}

/// True if a pixel has almost no color.
fn is_gray(Rgb([r, g, b]): &Rgb<u8>) -> bool {
    r.max(g).max(b) - r.min(g).min(b) <= 2 * GRAY
}
