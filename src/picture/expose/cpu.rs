//! Draws records on the CPU, in the same integers as `splat.wgsl`.
//!
//! Each thread processes a band of rows. Integer sums are the same for any number of bands. The
//! inner loop works on [`LANES`] pixels at a time, in the widest registers of this processor
//! (selected by pulp at run time). It goes down the columns of a box, while the curves along x stay
//! in registers.

#![expect(clippy::cast_possible_truncation, reason = "sides of a picture fit u32")]

use std::hint::black_box;
use std::ops::Range;

use noctograph_core::parallel::prelude::*;

use super::curves::{Curves, LANES, LOW_BITS};
use super::floor::Glow;
use super::record::{DITHER, Record};
use super::tile::Tiles;
use super::{Latent, Tint};

/// Minimum number of pixels in a band, summed over the boxes of its records. They take about a
/// quarter of a millisecond.
const BAND_PIXELS: u64 = 1 << 19;

/// Number of counts in a page of memory.
const PAGE: usize = 1024;

/// Minimum number of pages in a parallel task.
const TASK_PAGES: usize = 128;

/// Adds up the light of a latent image in at most `n_bands` bands of rows, which are processed in
/// parallel. Returns the counts of red, green and blue, one plane after another.
pub(super) fn splat(n_bands: u64, latent: &Latent) -> Vec<u32> {
    let [width, height] = latent.size_px.map(|px| px as usize);
    let mut counts = dark_counts(latent, height);
    // Gives each band its rows of the three planes.
    let ends = ends_of_bands(&latent.tints, latent.size_px, n_bands);
    let mut remaining: Vec<&mut [u32]> = counts.chunks_exact_mut(width * height).collect();
    let starts = [0].into_iter().chain(ends.iter().copied());
    let bands = starts.zip(&ends).map(|(start, &end)| {
        let pixels = (end - start) as usize * width;
        let planes = remaining.iter_mut().filter_map(|plane| plane.split_off_mut(..pixels));
        (Tiles::new(start..end, width, width + LANES), planes.collect())
    });
    let bands: Vec<(Tiles, Vec<&mut [u32]>)> = bands.collect();
    bands.into_par_iter().for_each(|(mut tiles, mut planes)| {
        noctograph_core::dispatch!(|| splat_band(latent, &mut tiles, &mut planes));
    });
    counts
}

/// Returns the counts of red, green and blue without light, one plane after another. From row
/// `first_row` or the first row of the glow on, their memory is mapped.
pub(super) fn dark_counts(latent: &Latent, first_row: usize) -> Vec<u32> {
    let [width, height] = latent.size_px.map(|px| px as usize);
    let mut counts = vec![0_u32; 3 * width * height];
    // Writes to each page once, because a page that is read before it is written is mapped twice.
    let glow_row = latent.glow.as_ref().map_or(height, Glow::top_px);
    let first = glow_row.min(first_row) * width;
    for plane in counts.chunks_exact_mut(width * height) {
        let pages = plane[first..].par_chunks_mut(PAGE).with_min_len(TASK_PAGES);
        pages.for_each(|page| page[0] = black_box(0));
    }
    counts
}

/// Returns the end row (exclusive) of each band. All bands have about the same amount of work.
fn ends_of_bands(tints: &[Tint], size_px: [u32; 2], n_bands: u64) -> Vec<u32> {
    let [width, height] = size_px;
    // `sums` contains first the change in the number of box pixels from row to row, and then the
    // cumulative number up to each row.
    let mut sums = vec![0_i64; height as usize + 1];
    for record in tints.iter().flat_map(|tint| &tint.records) {
        let [columns, rows] = record.inside(width, &(0..height));
        sums[rows.start as usize] += columns.len() as i64;
        sums[rows.end as usize] -= columns.len() as i64;
    }
    let (mut on_row, mut total) = (0, 0);
    for row in &mut sums {
        on_row += *row;
        total += on_row;
        *row = total;
    }
    // A band ends at the row where its fraction of the total is reached.
    let n_bands = (total.cast_unsigned() / BAND_PIXELS).clamp(1, n_bands).cast_signed();
    let ends = (1..n_bands)
        .map(|band| sums.partition_point(|&sum| sum * n_bands < total * band) as u32 + 1);
    let mut ends: Vec<u32> = ends.chain([height]).collect();
    ends.dedup();
    ends
}

/// Adds up the light of all records in a band. Each color is summed in `tiles`, which are then
/// counted into the band's rows of the three planes.
#[inline(always)]
fn splat_band(latent: &Latent, tiles: &mut Tiles, planes: &mut [&mut [u32]]) {
    let counts_per_lx_s = latent.counts_per_lx_s();
    let mut curves = Curves::default();
    for tint in &latent.tints {
        for record in &tint.records {
            let [columns, rows] = record.inside(latent.size_px[0], &tiles.rows);
            if rows.is_empty() {
                continue;
            }
            // The number of spots is a constant in each loop, so that the compiler can unroll it.
            tiles.light(&columns, &rows);
            curves.draw(record, counts_per_lx_s);
            let part = [columns, rows];
            match record.spots {
                1 => add::<1>(record, &curves, part, tiles),
                2 => add::<2>(record, &curves, part, tiles),
                3 => add::<3>(record, &curves, part, tiles),
                _ => add::<4>(record, &curves, part, tiles),
            }
        }
        tiles.count(tint.fractions, planes);
    }
}

/// Adds the light of a record of `N` spots to the tiles, in some columns and rows of its box. Both
/// are pixels of the picture.
#[inline(always)]
fn add<const N: usize>(
    record: &Record,
    curves: &Curves,
    [columns, rows]: [Range<u32>; 2],
    tiles: &mut Tiles,
) {
    // Computes where these columns and rows start within the box.
    let [i, j] = [(&columns, record.x), (&rows, record.y)]
        .map(|(part, first)| (part.start.cast_signed() - first) as usize);
    let across: [[&[u32]; 2]; N] = std::array::from_fn(|k| curves.across(k, j..j + rows.len()));
    let first_dither = record.dither_at(columns.start, rows.start);
    let shift = curves.shift;
    let top = (rows.start - tiles.rows.start) as usize * tiles.stride;
    let pixels = &mut tiles.counts[top..top + rows.len() * tiles.stride];
    for c in (0..columns.len()).step_by(LANES) {
        let along: [&[u32; LANES]; N] = std::array::from_fn(|k| {
            curves.along(k, i + c).first_chunk().expect("curves are as long as whole lanes")
        });
        let x = columns.start as usize + c;
        let mut dither: [u32; LANES] = std::array::from_fn(|lane| {
            first_dither.wrapping_add(DITHER[0].wrapping_mul((c + lane) as u32))
        });
        // Goes down the rows, and rounds the products of the curves, with the dither as threshold.
        for (j, row) in pixels.chunks_exact_mut(tiles.stride).enumerate() {
            let counts: &mut [u32; LANES] =
                row[x..].first_chunk_mut().expect("rows are as long as whole lanes");
            let across: [[u32; 2]; N] = std::array::from_fn(|k| across[k].map(|part| part[j]));
            // Upper and lower bits of the products are summed separately, so that they fit into 32
            // bits.
            let mut sums = [0_u32; LANES];
            for lane in 0..LANES {
                let (mut high, mut low) = (0_u32, 0_u32);
                for k in 0..N {
                    high = high.wrapping_add(along[k][lane].wrapping_mul(across[k][0]));
                    low = low.wrapping_add(along[k][lane].wrapping_mul(across[k][1]));
                }
                let threshold = dither[lane] >> (32 - shift);
                sums[lane] = high.wrapping_add(low >> LOW_BITS).wrapping_add(threshold) >> shift;
            }
            for lane in 0..LANES {
                counts[lane] = counts[lane].wrapping_add(sums[lane]);
                dither[lane] = dither[lane].wrapping_add(DITHER[1]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::scenes;
    use super::*;

    #[test]
    fn any_number_of_bands_leaves_the_same_bits() {
        for (name, mut latent) in scenes() {
            // Repeats records until there are enough for several bands.
            for tint in &mut latent.tints {
                tint.records = tint.records.iter().cycle().take(40_000).copied().collect();
            }
            let one = splat(1, &latent);
            for n in [2, 3, 16] {
                let ends = ends_of_bands(&latent.tints, latent.size_px, n);
                let several = ends.len() > 1 || latent.tints.is_empty();
                assert!(several && ends.len() as u64 <= n, "{name}: {ends:?}");
                assert!(splat(n, &latent) == one, "{name} in {n} bands");
            }
        }
    }
}
