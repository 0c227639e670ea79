//! Tiles: the light of one color on some rows of the picture, before it is distributed to the film.
//!
//! All records of a color are added up in one plane. The plane's lit tiles are then counted into
//! the three planes of the film, so the light is multiplied by the color once per pixel, not per
//! segment.

use std::ops::Range;

/// Width and height of a tile.
const TILE_PX: [usize; 2] = [64, 16];

/// Value of a fraction that means all of the light.
pub(super) const ALL: u32 = 1 << ALL_BITS;
const ALL_BITS: u32 = 31;

/// The light of one color, in counts of its brightest channel.
#[derive(Debug)]
pub(super) struct Tiles {
    pub(super) rows: Range<u32>,
    /// Distance between rows in pixels, which is at least the width of the picture.
    pub(super) stride: usize,
    /// Counts, row by row. Counts beyond the width have no meaning.
    pub(super) counts: Vec<u32>,
    width: usize,
    /// True for each tile with light, row by row.
    lit: Vec<bool>,
    /// True for each tile whose light was counted into the film before.
    counted: Vec<bool>,
}

impl Tiles {
    /// Returns dark tiles for some rows of a picture with a given width. Rows are `stride` counts
    /// apart in memory.
    pub(super) fn new(rows: Range<u32>, width: usize, stride: usize) -> Self {
        let tiles = width.div_ceil(TILE_PX[0]) * rows.len().div_ceil(TILE_PX[1]);
        let counts = vec![0; stride * rows.len()];
        let [lit, counted] = [vec![false; tiles], vec![false; tiles]];
        Self { rows, stride, counts, width, lit, counted }
    }

    /// Marks all tiles as lit that the given columns and rows touch.
    #[inline(always)]
    pub(super) fn light(&mut self, columns: &Range<u32>, rows: &Range<u32>) {
        let [first_column, last_column] =
            [columns.start, columns.end - 1].map(|px| px as usize / TILE_PX[0]);
        let [first_row, last_row] =
            [rows.start, rows.end - 1].map(|px| (px - self.rows.start) as usize / TILE_PX[1]);
        for row in first_row..=last_row {
            let first = row * self.width.div_ceil(TILE_PX[0]);
            for column in first_column..=last_column {
                if !std::mem::replace(&mut self.lit[first + column], true) {
                    let [x, y] = [column * TILE_PX[0], row * TILE_PX[1]];
                    let size =
                        [TILE_PX[0].min(self.width - x), TILE_PX[1].min(self.rows.len() - y)];
                    touch(&mut self.counts, [self.stride, y * self.stride + x], size);
                }
            }
        }
    }

    /// Adds the light to the film's planes, which start at these rows, and then clears it. Each
    /// channel receives a fraction of the light, relative to [`ALL`].
    #[inline(always)]
    pub(super) fn count(&mut self, fractions: [u32; 3], planes: &mut [&mut [u32]]) {
        let tiles_across = self.width.div_ceil(TILE_PX[0]);
        for (tile, lit) in self.lit.iter_mut().enumerate() {
            if !std::mem::take(lit) {
                continue;
            }
            let [x, y] = [tile % tiles_across * TILE_PX[0], tile / tiles_across * TILE_PX[1]];
            let size = [TILE_PX[0].min(self.width - x), TILE_PX[1].min(self.rows.len() - y)];
            // The tile's place is given as stride and start, in the counts and in the planes.
            let light = &mut self.counts[y * self.stride..][..size[1] * self.stride];
            let to = [self.width, y * self.width + x];
            if !std::mem::replace(&mut self.counted[tile], true) {
                touch_lit(planes, fractions, to, size);
            }
            count(light, [self.stride, x], fractions, planes, to, size);
            light.chunks_exact_mut(self.stride).for_each(|row| row[x..x + size[0]].fill(0));
        }
    }
}

/// Writes zeros to the ends of dark rows `stride` apart. A page of memory that is read before it is
/// written would be mapped twice.
fn touch(counts: &mut [u32], [stride, first]: [usize; 2], [columns, rows]: [usize; 2]) {
    for row in 0..rows {
        let start = first + row * stride;
        (counts[start], counts[start + columns - 1]) = (0, 0);
    }
}

/// Prepares the dark rows of the planes to which light is added for the first time.
fn touch_lit(planes: &mut [&mut [u32]], fractions: [u32; 3], from: [usize; 2], size: [usize; 2]) {
    let lit = planes.iter_mut().zip(fractions).filter(|(_, fraction)| *fraction > 0);
    lit.for_each(|(plane, _)| touch(plane, from, size));
}

/// Adds columns and rows of light to planes, with a fraction for each plane. The light starts at
/// column `x` of rows `light_stride` apart, and the planes at pixel `first` of rows `stride` apart.
#[inline(always)]
pub(super) fn count(
    light: &[u32],
    [light_stride, x]: [usize; 2],
    fractions: [u32; 3],
    planes: &mut [&mut [u32]],
    [stride, first]: [usize; 2],
    [columns, rows]: [usize; 2],
) {
    for (row, light) in light.chunks_exact(light_stride).take(rows).enumerate() {
        for (plane, fraction) in planes.iter_mut().zip(fractions) {
            add(&mut plane[first + row * stride..][..columns], &light[x..x + columns], fraction);
        }
    }
}

/// Adds a fraction of light, relative to [`ALL`] and rounded, to counts pixel by pixel.
#[inline(always)]
fn add(counts: &mut [u32], light: &[u32], fraction: u32) {
    match fraction {
        0 => {}
        ALL => counts.iter_mut().zip(light).for_each(|(count, light)| *count += light),
        _ => {
            for (count, &light) in counts.iter_mut().zip(light) {
                let scaled = u64::from(light) * u64::from(fraction) + u64::from(ALL / 2);
                #[expect(clippy::cast_possible_truncation, reason = "no more than the light")]
                let part = (scaled >> ALL_BITS) as u32;
                *count += part;
            }
        }
    }
}
