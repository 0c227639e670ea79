//! The splat on the CPU: the twin of `splat.wgsl`, in the same integers.
//!
//! Every core takes a band of rows; sums of integers are the same in any order.

use std::ops::Range;

use super::record::{DITHER, Record};
use super::tables::{BELL_BITS, REACH, STEP_BITS, TABLES, Tables};

/// Pixels in the records' boxes that are worth a thread of their own: a millisecond or so.
const THREAD_PIXELS: u64 = 1 << 18;

/// Adds up the records' light: three planes of counts.
pub(super) fn splat(records: &[Record], size_px: [u32; 2]) -> Vec<u32> {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    splat_on(cores as u64, records, size_px)
}

/// The same on so many cores, at most.
fn splat_on(cores: u64, records: &[Record], size_px: [u32; 2]) -> Vec<u32> {
    let width = size_px[0] as usize;
    let plane = width * size_px[1] as usize;
    let mut counts = vec![0_u32; 3 * plane];
    let bands = bands(records, size_px[1], cores);
    if let [band] = &bands[..] {
        let planes: Vec<&mut [u32]> = counts.chunks_exact_mut(plane).collect();
        splat_band(records, width, band.clone(), planes);
        return counts;
    }
    std::thread::scope(|scope| {
        let mut rest: Vec<&mut [u32]> = counts.chunks_exact_mut(plane).collect();
        for band in bands {
            let pixels = band.len() * width;
            let planes = rest.iter_mut().filter_map(|plane| plane.split_off_mut(..pixels));
            let planes: Vec<&mut [u32]> = planes.collect();
            scope.spawn(move || splat_band(records, width, band, planes));
        }
    });
    counts
}

/// Rows of the picture in bands of equal work, one for each thread that is worth it.
fn bands(records: &[Record], height: u32, cores: u64) -> Vec<Range<u32>> {
    // Differences from row to row, then summed: pixels of boxes on each row.
    let mut pixels = vec![0_i64; height as usize + 1];
    for record in records {
        pixels[record.y as usize] += i64::from(record.width);
        pixels[(record.y + record.height) as usize] -= i64::from(record.width);
    }
    let mut on_row = 0;
    let mut until = 0;
    for row in &mut pixels {
        on_row += *row;
        until += on_row;
        *row = until;
    }
    let threads = (until.cast_unsigned() / THREAD_PIXELS).clamp(1, cores);
    let share = until.cast_unsigned().div_ceil(threads).max(1).cast_signed();

    let mut bands = Vec::new();
    let mut start = 0;
    for (row, until) in (0..height).zip(&pixels) {
        let last = row + 1 == height;
        if last || *until >= share * (bands.len() as i64 + 1) {
            bands.push(start..row + 1);
            start = row + 1;
        }
    }
    bands
}

/// Adds the records' light to the rows of a band; `planes` are those rows.
fn splat_band(records: &[Record], width: usize, band: Range<u32>, mut planes: Vec<&mut [u32]>) {
    let tables = &*TABLES;
    let mut weights = vec![0_u32; width];
    for record in records {
        let rows = record.y.max(band.start)..(record.y + record.height).min(band.end);
        for row in rows {
            let j = row - record.y;
            let [from, to] = lit(record, j.cast_signed());
            let weights = &mut weights[..(to - from) as usize];
            if record.length == 0 {
                dot_weights(tables, record, from.cast_signed(), j.cast_signed(), weights);
            } else {
                line_weights(tables, record, from.cast_signed(), j.cast_signed(), weights);
            }
            let dither = DITHER[0].wrapping_mul(from).wrapping_add(DITHER[1].wrapping_mul(j));
            let dither = dither.wrapping_add(record.dither);
            let first = (row - band.start) as usize * width + (record.x + from) as usize;
            for (amplitude, plane) in record.amplitude.iter().zip(&mut planes) {
                if *amplitude != 0 {
                    let counts = &mut plane[first..first + weights.len()];
                    add(weights, *amplitude, record.shift, dither, counts);
                }
            }
        }
    }
}

/// Weights of pixels `first..` of row `j` where the lamp rests: `g(u) g(v)`, 2^31 for 1.
fn dot_weights(tables: &Tables, record: &Record, first: i32, j: i32, weights: &mut [u32]) {
    let mut u = record.u0 + first * record.ux + j * record.uy;
    let mut v = record.v0 + first * record.vx + j * record.vy;
    for weight in weights {
        let along = tables.bell(u) << (31 - BELL_BITS);
        let across = tables.bell(v) << (31 - BELL_BITS);
        *weight = mul_hi(along, across) << 1;
        u += record.ux;
        v += record.vx;
    }
}

/// Weights of pixels `first..` of row `j` where it moves: `g(v) [Φ(u) - Φ(u - L)]`, 2^31 for 1.
fn line_weights(tables: &Tables, record: &Record, first: i32, j: i32, weights: &mut [u32]) {
    let mut u = record.u0 + first * record.ux + j * record.uy;
    let mut v = record.v0 + first * record.vx + j * record.vy;
    for weight in weights {
        // `lit` keeps u from falling far below the first reach or rising far above the second.
        let past_end = (u - record.length).max(-REACH);
        let along = (tables.step(u.min(REACH)) - tables.step(past_end)) << (31 - STEP_BITS);
        let across = tables.bell(v) << (31 - BELL_BITS);
        *weight = mul_hi(along, across) << 1;
        u += record.ux;
        v += record.vx;
    }
}

/// Adds amplitude times weight to the counts, rounded by the dither.
fn add(weights: &[u32], amplitude: u32, shift: u32, mut dither: u32, counts: &mut [u32]) {
    for (weight, count) in weights.iter().zip(counts) {
        *count += (mul_hi(*weight, amplitude) + (dither >> (32 - shift))) >> shift;
        dither = dither.wrapping_add(DITHER[0]);
    }
}

/// Product over 2^32, rounded to nearest.
#[inline]
fn mul_hi(a: u32, b: u32) -> u32 {
    ((u64::from(a) * u64::from(b) + (1 << 31)) >> 32) as u32
}

/// Pixels of row `j` of the box that can have weight, from and to; empty where to ≤ from.
fn lit(record: &Record, j: i32) -> [u32; 2] {
    let u = record.u0 + j * record.uy;
    let v = record.v0 + j * record.vy;
    let reach = i64::from(REACH);
    let along = inside(u, record.ux, [-reach, reach + i64::from(record.length)]);
    let across = inside(v, record.vx, [-reach, reach]);
    let width = i64::from(record.width);
    let clip = |i: i64| u32::try_from(i.clamp(0, width)).unwrap_or(record.width);
    let to = clip(along[1].min(across[1]));
    [clip(along[0].max(across[0])).min(to), to]
}

/// The `i` from and to with `start + i step` within the limits, at most one too many on each side.
fn inside(start: i32, step: i32, limits: [i64; 2]) -> [i64; 2] {
    let [low, high] = limits.map(|limit| limit - i64::from(start));
    let step = i64::from(step);
    match step {
        0 if low < 0 && high > 0 => [0, i64::MAX],
        0 => [0, 0],
        1.. => [low / step, high / step + 1],
        _ => [high / step, low / step + 1],
    }
}

#[cfg(test)]
mod tests {
    use super::super::twins::scenes;
    use super::*;

    #[test]
    fn any_number_of_cores_leaves_the_same_bits() {
        for (name, size_px, records) in scenes() {
            // Enough of them for several threads.
            let many: Vec<Record> = records.iter().cycle().take(4000).copied().collect();
            let on_one = splat_on(1, &many, size_px);
            for cores in [2, 3, 16] {
                let bands = bands(&many, size_px[1], cores);
                let several = bands.len() > 1 || many.is_empty();
                assert!(several && bands.len() as u64 <= cores + 1, "{name}: {bands:?}");
                assert!(splat_on(cores, &many, size_px) == on_one, "{name} on {cores} cores");
            }
        }
    }
}
