//! The splat on the CPU: the twin of `splat.wgsl`, in the same integers.
//!
//! Every core takes a band of rows; sums of integers are the same in any order. The inner loop
//! works on [`LANES`] pixels at once, in the widest registers that this processor has (pulp picks
//! them when the program runs); integers are the same in all of them.
#![expect(
    clippy::cast_possible_truncation,
    reason = "sides of a picture fit u32, and products of 64 bits are shifted to fit"
)]

use std::ops::Range;
use std::sync::LazyLock;

use super::record::{DITHER, Record, SHARE_BITS, SPOTS};
use super::tables::{BELL, BELL_BITS, SIGMA_BITS, bell};

/// Pixels in the records' boxes that are worth a thread of their own: a quarter of a millisecond or
/// so.
const THREAD_PIXELS: u64 = 1 << 18;

/// Bits of a pixel's weight, 2^22 for 1; what rounds to 0 is more than 5.64 σ away.
pub(super) const WEIGHT_BITS: u32 = 22;

/// Bits of a curve across times its share.
const ACROSS_BITS: u32 = BELL_BITS_RAISED + SHARE_BITS - 32;

/// Bits of the curve across before it is multiplied: more than it has, less than overflow.
const BELL_BITS_RAISED: u32 = 31;

/// From curve times curve to weight.
const SUM_SHIFT: u32 = BELL_BITS + ACROSS_BITS - WEIGHT_BITS;

/// No pixel farther than this from every spot has weight: a gaussian is below three quarters of
/// half a unit there.
const FARTHEST_SIGMA: f64 = 5.7;

/// Pixels that are added at once: two registers of 256 bits for four products of 64.
const LANES: usize = 8;

/// Adds up the records' light on at most so many cores: three planes of counts.
pub(super) fn splat(cores: u64, records: &[Record], size_px: [u32; 2]) -> Vec<u32> {
    let width = size_px[0] as usize;
    let plane = width * size_px[1] as usize;
    let mut counts = vec![0_u32; 3 * plane];
    let bands = bands(records, size_px[1], cores);
    std::thread::scope(|scope| {
        let mut rest: Vec<&mut [u32]> = counts.chunks_exact_mut(plane).collect();
        let last = bands.len().saturating_sub(1);
        for (i, rows) in bands.into_iter().enumerate() {
            let pixels = rows.len() * width;
            let planes = rest.iter_mut().filter_map(|plane| plane.split_off_mut(..pixels));
            let band = Band { records, width, rows, planes: planes.collect() };
            if i == last {
                pulp::Arch::new().dispatch(band);
            } else {
                scope.spawn(move || pulp::Arch::new().dispatch(band));
            }
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

/// Some rows of the picture, and all records.
struct Band<'a> {
    records: &'a [Record],
    width: usize,
    rows: Range<u32>,
    /// Those rows.
    planes: Vec<&'a mut [u32]>,
}

impl pulp::NullaryFnOnce for Band<'_> {
    type Output = ();

    #[inline(always)]
    fn call(mut self) {
        let nodes = &**BELL;
        let mut curves: [Vec<u32>; SPOTS] = Default::default();
        for record in self.records {
            let rows = record.y.max(self.rows.start)..(record.y + record.height).min(self.rows.end);
            if rows.is_empty() {
                continue;
            }
            for (curve, u) in curves.iter_mut().zip(record.u).take(record.spots as usize) {
                curve.clear();
                let along =
                    (0..record.width.cast_signed()).map(|i| bell(nodes, u + i * record.step));
                curve.extend(along);
                // Beyond the box there is no light, whatever the lanes do there.
                curve.resize(record.width as usize + LANES, 0);
            }
            match record.spots {
                1 => self.add::<1>(record, rows, &curves),
                2 => self.add::<2>(record, rows, &curves),
                3 => self.add::<3>(record, rows, &curves),
                _ => self.add::<4>(record, rows, &curves),
            }
        }
    }
}

impl Band<'_> {
    /// Adds the light of a record of `N` spots to some rows.
    #[inline(always)]
    fn add<const N: usize>(
        &mut self,
        record: &Record,
        rows: Range<u32>,
        curves: &[Vec<u32>; SPOTS],
    ) {
        let nodes = &**BELL;
        let curves: [&[u32]; N] = std::array::from_fn(|k| &curves[k][..]);
        let chords = Chords::new::<N>(record);
        let white = record.amplitude[1..] == [record.amplitude[0]; 2];
        for row in rows {
            let j = (row - record.y).cast_signed();
            let v: [i32; N] = std::array::from_fn(|k| record.v[k] + j * record.step);
            let across = std::array::from_fn(|k| {
                let bell = bell(nodes, v[k]) << (BELL_BITS_RAISED - BELL_BITS);
                u64::from(mul_hi(bell, record.share[k]))
            });
            let [from, to] = chords.on_row(v);
            if from >= to {
                continue;
            }
            let chunks = (to - from).div_ceil(LANES);
            let along = curves.map(|curve| &curve[from..from + chunks * LANES]);
            let dither = DITHER[0].wrapping_mul(from as u32);
            let dither = dither.wrapping_add(DITHER[1].wrapping_mul(j.cast_unsigned()));
            let light = Row { along, across, dither: dither.wrapping_add(record.dither), record };
            let first = (row - self.rows.start) as usize * self.width + record.x as usize;
            let place = first + from..first + from + chunks * LANES;
            let end = place.end;
            if let [red, green, blue] = &mut self.planes[..] {
                if end <= red.len() {
                    let [red, green, blue] =
                        [red, green, blue].map(|plane| &mut plane[place.clone()]);
                    light.add(white, [red, green, blue]);
                } else {
                    // The last lanes stand behind the last row.
                    let planes = [red, green, blue].map(|plane| &mut plane[place.start..]);
                    light.add_at_the_end(white, planes, chunks * LANES);
                }
            }
        }
    }
}

/// A record's light on a row, ready to be added.
struct Row<'a, const N: usize> {
    /// Curves of the spots along the row, whole lanes of them.
    along: [&'a [u32]; N],
    /// Curves across, times the spots' shares.
    across: [u64; N],
    dither: u32,
    record: &'a Record,
}

impl<const N: usize> Row<'_, N> {
    #[inline(always)]
    fn add(&self, white: bool, planes: [&mut [u32]; 3]) {
        let Record { amplitude, shift, .. } = *self.record;
        let along = self.along.map(|curve| curve.as_chunks::<LANES>().0);
        let [red, green, blue] = planes.map(|plane| plane.as_chunks_mut::<LANES>().0);
        let chunks = red.iter_mut().zip(green).zip(blue).enumerate();
        let mut dither = self.dither;
        for (c, ((red, green), blue)) in chunks {
            let weights = weights(along.map(|curve| &curve[c]), self.across, dither, shift);
            dither = dither.wrapping_add(DITHER[0].wrapping_mul(LANES as u32));
            if white {
                let counts = counts(&weights, amplitude[0], shift);
                [red, green, blue].into_iter().for_each(|pixels| add(pixels, &counts));
            } else {
                for (pixels, amplitude) in [red, green, blue].into_iter().zip(amplitude) {
                    if amplitude != 0 {
                        add(pixels, &counts(&weights, amplitude, shift));
                    }
                }
            }
        }
    }

    /// The same where the planes end before the lanes do.
    #[cold]
    fn add_at_the_end(&self, white: bool, planes: [&mut [u32]; 3], lanes: usize) {
        let mut longer = [const { Vec::new() }; 3];
        for (longer, plane) in longer.iter_mut().zip(&planes) {
            longer.extend_from_slice(plane);
            longer.resize(lanes, 0);
        }
        self.add(white, longer.each_mut().map(|longer| &mut longer[..]));
        for (plane, longer) in planes.into_iter().zip(&longer) {
            plane.copy_from_slice(&longer[..plane.len()]);
        }
    }
}

/// Which pixels of a row can have weight.
struct Chords {
    /// Nearest and farthest spot along the row, and a pixel, in units of a coordinate.
    spots: [f32; 2],
    px: f32,
    width: usize,
}

/// Half the chord of the circle of [`FARTHEST_SIGMA`], at every sixteenth of σ from its middle.
static HALF_CHORDS: LazyLock<[f32; 128]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        let v = k as f64 / 16.0;
        let half = (FARTHEST_SIGMA * FARTHEST_SIGMA - v * v).max(0.0).sqrt();
        (half * f64::from(1 << SIGMA_BITS)) as f32
    })
});

impl Chords {
    #[inline(always)]
    fn new<const N: usize>(record: &Record) -> Self {
        let spots = record.u.iter().take(N).map(|&u| -u as f32);
        Self {
            spots: [spots.clone().fold(f32::MAX, f32::min), spots.fold(f32::MIN, f32::max)],
            px: 1.0 / record.step as f32,
            width: record.width as usize,
        }
    }

    /// From and to, on a row with the spots that far above or below; a little too much at worst.
    #[inline(always)]
    fn on_row<const N: usize>(&self, v: [i32; N]) -> [usize; 2] {
        let nearest = v.iter().map(|v| v.unsigned_abs()).fold(u32::MAX, u32::min);
        let half = HALF_CHORDS[(nearest >> (SIGMA_BITS - 4)) as usize & 127];
        if half == 0.0 {
            return [0, 0];
        }
        // Casts of negative numbers give 0.
        let from = ((self.spots[0] - half) * self.px - 0.01).ceil() as usize;
        let to = ((self.spots[1] + half) * self.px + 1.01) as usize;
        [from, to.min(self.width)]
    }
}

/// Product over 2^32, rounded to nearest.
#[inline(always)]
fn mul_hi(a: u32, b: u32) -> u32 {
    ((u64::from(a) * u64::from(b) + (1 << 31)) >> 32) as u32
}

/// Weights of some pixels and where the rounding of their counts begins.
struct Weights {
    weight: [u64; LANES],
    up: [u64; LANES],
}

/// Steps of the dither from lane to lane.
const LANE_DITHER: [u32; LANES] = {
    let mut steps = [0; LANES];
    let mut lane = 1;
    while lane < LANES {
        steps[lane] = DITHER[0].wrapping_mul(lane as u32);
        lane += 1;
    }
    steps
};

#[inline(always)]
fn weights<const N: usize>(
    along: [&[u32; LANES]; N],
    across: [u64; N],
    dither: u32,
    shift: u32,
) -> Weights {
    let mut weights = Weights { weight: [0; LANES], up: [0; LANES] };
    for lane in 0..LANES {
        let mut sum = 1_u64 << (SUM_SHIFT - 1);
        for k in 0..N {
            sum += u64::from(along[k][lane]) * across[k];
        }
        weights.weight[lane] = u64::from((sum >> SUM_SHIFT) as u32);
        let dither = dither.wrapping_add(LANE_DITHER[lane]);
        weights.up[lane] = u64::from(dither >> (32 - WEIGHT_BITS)) << shift;
    }
    weights
}

/// Amplitude times weight, rounded by the dither.
#[inline(always)]
fn counts(weights: &Weights, amplitude: u32, shift: u32) -> [u32; LANES] {
    std::array::from_fn(|lane| {
        let counted = weights.weight[lane] * u64::from(amplitude) + weights.up[lane];
        (counted >> (WEIGHT_BITS + shift)) as u32
    })
}

#[inline(always)]
fn add(pixels: &mut [u32; LANES], counts: &[u32; LANES]) {
    for lane in 0..LANES {
        pixels[lane] += counts[lane];
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
            let many: Vec<Record> = records.iter().cycle().take(12_000).copied().collect();
            let on_one = splat(1, &many, size_px);
            for cores in [2, 3, 16] {
                let bands = bands(&many, size_px[1], cores);
                let several = bands.len() > 1 || many.is_empty();
                assert!(several && bands.len() as u64 <= cores + 1, "{name}: {bands:?}");
                assert!(splat(cores, &many, size_px) == on_one, "{name} on {cores} cores");
            }
        }
    }
}
