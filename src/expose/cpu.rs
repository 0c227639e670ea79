//! The splat on the CPU: the twin of `splat.wgsl`, in the same integers.

use super::record::{DITHER, Record};
use super::tables::{BELL_BITS, REACH, STEP_BITS, TABLES, Tables};

/// Adds up the records' light: three planes of counts.
pub(super) fn splat(records: &[Record], size_px: [u32; 2]) -> Vec<u32> {
    let width = size_px[0] as usize;
    let plane = width * size_px[1] as usize;
    let mut counts = vec![0_u32; 3 * plane];
    let mut weights = vec![0_u32; width];
    let tables = &*TABLES;
    for record in records {
        for j in 0..record.height {
            let [from, to] = lit(record, j.cast_signed());
            let weights = &mut weights[..to.saturating_sub(from) as usize];
            if record.length == 0 {
                dot_weights(tables, record, from.cast_signed(), j.cast_signed(), weights);
            } else {
                line_weights(tables, record, from.cast_signed(), j.cast_signed(), weights);
            }
            let dither = DITHER[0].wrapping_mul(from).wrapping_add(DITHER[1].wrapping_mul(j));
            let dither = dither.wrapping_add(record.dither);
            let first = (record.y + j) as usize * width + (record.x + from) as usize;
            for (amplitude, counts) in record.amplitude.iter().zip(counts.chunks_exact_mut(plane)) {
                if *amplitude != 0 {
                    let counts = &mut counts[first..first + weights.len()];
                    add(weights, *amplitude, record.shift, dither, counts);
                }
            }
        }
    }
    counts
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
#[expect(clippy::cast_possible_truncation, reason = "the upper half of 64 bits")]
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
