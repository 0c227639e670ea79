//! Veiling glare and halo: the lens scatters a fraction of all light, computed in integers.
//!
//! The scatter `1 / (1 + (r/r0)²)^s` (Harvey 1976) becomes a sum of octaves, which are bell-shaped
//! blurs with σ = 4, 8, 16 … px. Each octave contains the light scattered into its ring of radii. A
//! pyramid computes an octave as sums over cells as wide as its σ, which are blurred and spread
//! back to pixels. Light scattered by less than 4 px stays in its pixel. No count of the light is
//! lost.
//!
//! Ghost images of bright lights are not modeled. Light that would cross the border of the picture
//! is mirrored.

use noctograph_core::parallel::prelude::*;

use super::TASK_ROWS;
use super::kernel::{DOUBLE, Plane, QUADRUPLE};
use super::options::PhotoOptions;
use crate::expose::Film;
use noctograph_core::camera::Camera;

/// Side of the finest cells, and σ of the finest octave, in pixels.
pub(super) const CELL_PX: usize = 4;

/// Number that represents all of the light in fractions.
pub(super) const WHOLE: u32 = 1 << 16;

/// The scattered light of a film.
#[derive(Debug)]
pub(super) struct Glare {
    /// Scattered fraction of each pixel's counts, in units of 1 / [`WHOLE`].
    fraction: u32,
    /// Scattered light of each channel, in the finest cells.
    halo: Vec<Plane>,
    /// Cells, and their parts, from which each row of pixels receives light.
    rows: Vec<Vec<(usize, usize)>>,
}

impl Glare {
    /// Scatters the light of a film. Returns `None` if the scatter is too weak for any pixel.
    pub(super) fn new(film: &Film, camera: &Camera, options: &PhotoOptions) -> Option<Self> {
        let size_px = [film.width_px, film.height_px].map(|side| side as usize);
        let octaves = octaves(size_px, options, camera.pixel_pitch_m());
        let fraction: u32 = octaves.iter().sum();
        if fraction == 0 {
            return None;
        }
        let cells = cells(film, fraction).into_par_iter();
        let halo: Vec<Plane> = cells.map(|cells| halo(cells, &octaves)).collect();
        let rows = QUADRUPLE.sources(halo[0].height, size_px[1]);
        Some(Self { fraction, halo, rows })
    }

    /// Writes the counts of row `y` of a channel after scattering to `out`. `pixels` are the counts
    /// before scattering, and `cells` is a buffer.
    pub(super) fn row(
        &self,
        channel: usize,
        y: usize,
        pixels: &[u32],
        cells: &mut Vec<u64>,
        out: &mut [u32],
    ) {
        let halo = &self.halo[channel];
        cells.clear();
        cells.resize(halo.width, 0);
        noctograph_core::dispatch!(|| {
            for &(cell, part) in &self.rows[y] {
                let values = &halo.values[cell * halo.width..][..halo.width];
                for (sum, &value) in cells.iter_mut().zip(values) {
                    *sum += QUADRUPLE.part(value, part);
                }
            }
            for (out, &count) in out.iter_mut().zip(pixels) {
                *out = count - scattered(count, self.fraction);
            }
            // If the cells are faint, as most are, light is spread along the row in 32 bits.
            let brightest = cells.iter().copied().fold(0, u64::max);
            if brightest < QUADRUPLE.narrow_limit() {
                QUADRUPLE.along_narrow(cells, out);
            } else {
                QUADRUPLE.along(cells, out, |out, light| {
                    *out = out.saturating_add(u32::try_from(light).unwrap_or(u32::MAX));
                });
            }
        });
    }
}

/// Returns the scattered part of a count, rounded down. `fraction` is in units of 1 / [`WHOLE`].
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "a part of a u32")]
fn scattered(count: u32, fraction: u32) -> u32 {
    ((u64::from(count) * u64::from(fraction)) >> 16) as u32
}

/// Returns the sums of a fraction of every count over cells of 4 × 4 pixels, for each channel.
pub(super) fn cells(film: &Film, fraction: u32) -> [Plane; 3] {
    let (width, height) = (film.width_px as usize, film.height_px as usize);
    let columns = width.div_ceil(CELL_PX);
    std::array::from_fn(|channel| {
        let mut out = Plane::dark(columns, height.div_ceil(CELL_PX));
        let sums = out.values.par_chunks_exact_mut(columns);
        let rows = sums.zip(film.plane(channel).par_chunks(CELL_PX * width));
        rows.with_min_len(TASK_ROWS).for_each(|(sums, rows)| {
            noctograph_core::dispatch!(|| {
                // A page that is read before it is written would be mapped twice.
                sums.fill(0);
                for row in rows.chunks_exact(width) {
                    let (cells, rest) = row.as_chunks::<CELL_PX>();
                    let light = |count: &u32| u64::from(scattered(*count, fraction));
                    for (sum, pixels) in sums.iter_mut().zip(cells) {
                        *sum += pixels.iter().map(light).sum::<u64>();
                    }
                    // The last cell of a row may be narrower.
                    if let Some(sum) = sums.get_mut(cells.len()) {
                        *sum += rest.iter().map(light).sum::<u64>();
                    }
                }
            });
        });
        out
    })
}

/// Returns the fractions of light that the octaves scatter, from σ = 4 px to half the picture, in
/// units of 1 / [`WHOLE`].
fn octaves([width, height]: [usize; 2], options: &PhotoOptions, pitch_m: f64) -> Vec<u32> {
    let PhotoOptions { glare_frac, glare_radius_m, glare_exponent, .. } = *options;
    // Returns the fraction of the scatter within a radius r: its integral over a disc.
    let within = |r_px: f64| {
        let ratio = r_px * pitch_m / glare_radius_m;
        1.0 - libm::pow(1.0 + ratio * ratio, 1.0 - glare_exponent)
    };
    let diagonal = within(((width * width + height * height) as f64).sqrt());
    let sigmas = std::iter::successors(Some(CELL_PX), |sigma| Some(2 * sigma));
    let sigmas: Vec<usize> = sigmas.take_while(|s| 2 * s <= width.min(height)).collect();
    // Half the light of a Gaussian is within 1.18 σ. The Gaussian's ring extends from 0.83 σ to
    // 1.67 σ.
    let edge = |sigma: usize| within(sigma as f64 * (1.18 / std::f64::consts::SQRT_2));
    Vec::from_iter((0..sigmas.len()).map(|index: usize| {
        let outer = sigmas.get(index + 1).map_or(diagonal, |next| edge(*next).min(diagonal));
        let inner = edge(sigmas[index]).min(outer);
        #[expect(clippy::cast_possible_truncation, reason = "0 to WHOLE")]
        let fraction = (glare_frac * (outer - inner) / diagonal * f64::from(WHOLE)).round() as u32;
        fraction
    }))
}

/// Spreads a channel's scattered light over its octaves, and returns the light in the finest cells.
/// The octaves' fractions are in units of 1 / [`WHOLE`].
fn halo(cells: Plane, octaves: &[u32]) -> Plane {
    if cells.values.iter().all(|light| *light == 0) {
        return cells;
    }
    // Goes to coarser octaves. Each one takes its part of the light that finer octaves left over.
    let mut remaining_fraction: u64 = octaves.iter().map(|octave| u64::from(*octave)).sum();
    let mut remaining = cells;
    let mut parts = Vec::with_capacity(octaves.len());
    for &octave in &octaves[..octaves.len() - 1] {
        let mut part = remaining.clone();
        let factor = (u64::from(octave) << 16) / remaining_fraction;
        for (part, remaining) in part.values.iter_mut().zip(&mut remaining.values) {
            // Multiplies by factor / 2^16 in two halves, neither of which can overflow.
            *part = (*part >> 16) * factor + (((*part & 0xffff) * factor) >> 16);
            *remaining -= *part;
        }
        remaining_fraction = (remaining_fraction - u64::from(octave)).max(1);
        remaining = remaining.halved();
        parts.push(part);
    }
    // Then goes back to finer octaves, blurring the light and spreading it to half-width cells.
    let mut halo = remaining.blurred();
    for mut part in parts.into_iter().rev() {
        halo.spread_into(&DOUBLE, &mut part);
        halo = part.blurred();
    }
    halo
}
