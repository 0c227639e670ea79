//! Texture: how unevenly floor and walls reflect light, from worn spots to stains.
//!
//! The texture is fractal noise (Perlin, "An image synthesizer", 1985), with equal variance in all
//! octaves from 4 cm to 1.28 m. A single tile repeats. Boards, tiles and seams are not modeled.

use std::sync::LazyLock;

use crate::narrow;
use noctograph_core::random::split_mix;

/// Number of points along a side of the tile, and the distance between them.
const SIDE: usize = 256;
const STEP_M: f64 = 0.02;
/// Distance between the nodes of each octave, in points.
const OCTAVES: [usize; 6] = [2, 4, 8, 16, 32, 64];

/// Deviations from the mean albedo, scaled to a variance of 1.
static TILE: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let mut tile = vec![0.0; SIDE * SIDE];
    for cell in OCTAVES {
        let across = SIDE / cell;
        // Each node has a random value from -1 to 1, from 24 bits of a hash of its index.
        let nodes: Vec<f32> = (0..across * across)
            .map(|i| (split_mix((cell * SIDE * SIDE + i) as u64) >> 40) as f32 / 8_388_608.0 - 1.0)
            .collect();
        for (i, value) in tile.iter_mut().enumerate() {
            let point = [i % SIDE, i / SIDE].map(|point| point as f32 / cell as f32);
            *value += bilinear(|x, y| nodes[y % across * across + x % across], point);
        }
    }
    let variance = tile.iter().map(|value| value * value).sum::<f32>() / tile.len() as f32;
    tile.iter_mut().for_each(|value| *value /= variance.sqrt());
    tile
});

/// Converts a point of a surface in m to a point on the tile, in nodes. The tile repeats.
pub(super) fn on_tile(point_m: [f64; 2]) -> [f32; 2] {
    // Moves the point by whole tiles, so that no coordinate in a room is negative.
    let offset = f64::from(1 << 17);
    point_m.map(|point_m| narrow((point_m / STEP_M).clamp(-offset, offset) + offset))
}

/// Returns the deviation of the albedo at a point of the tile, in units of its standard deviation,
/// with bilinear interpolation. The point is in samples of the tile, which repeats.
#[inline(always)]
pub(super) fn deviation(point: [f32; 2]) -> f32 {
    let tile = &*TILE;
    bilinear(|x, y| tile[(y % SIDE) * SIDE + x % SIDE], point)
}

/// Interpolates bilinearly between the four nodes around a point. `node` returns the value at whole
/// coordinates, and the result is in its unit.
#[inline(always)]
fn bilinear(node: impl Fn(usize, usize) -> f32, [x, y]: [f32; 2]) -> f32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 2^24")]
    let (column, row) = (x as usize, y as usize);
    let (across, down) = (x - column as f32, y - row as f32);
    let [above, below] = [row, row + 1].map(|row| {
        let left = node(column, row);
        left + (node(column + 1, row) - left) * across
    });
    above + (below - above) * down
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tile_has_variance_1_in_all_sizes_and_repeats_without_a_seam() {
        fn value(x_m: f64, y_m: f64) -> f32 {
            deviation(on_tile([x_m, y_m]))
        }
        let period_m = SIDE as f64 * STEP_M;
        for [x, y] in [[0.013, 0.4], [-2.1, 1.7], [2.56, -0.3]] {
            assert!((value(x, y) - value(x + period_m, y - period_m)).abs() < 0.02, "{x} {y}");
            assert!((value(x, y) - value(x + 1e-3, y)).abs() < 0.2, "{x} {y}");
        }
        fn roughness(x: f64) -> f32 {
            let rises = (0..256).map(|k| f64::from(k) * STEP_M);
            let rises = rises.map(|y| value(x + 0.5 * STEP_M, y) - value(x - 0.5 * STEP_M, y));
            rises.map(|rise| rise * rise).sum()
        }
        let ratio = roughness(0.0) / roughness(0.5 * period_m);
        assert!((0.7..1.4).contains(&ratio), "at the seam by the middle: {ratio}");
        // Means over squares of 0.32 m retain only two of the six octaves.
        let mean = |i: usize, j: usize| {
            let points = (0..256)
                .map(|k| value((i * 16 + k % 16) as f64 * 0.02, (j * 16 + k / 16) as f64 * 0.02));
            points.sum::<f32>() / 256.0
        };
        let means = (0..256).map(|k| mean(k % 16, k / 16));
        let variance = means.map(|mean| mean * mean).sum::<f32>() / 256.0;
        assert!((0.25..0.6).contains(&variance), "{variance}");
        let whole = TILE.iter().map(|value| value * value).sum::<f32>() / TILE.len() as f32;
        assert!((whole - 1.0).abs() < 1e-3, "{whole}");
    }
}
