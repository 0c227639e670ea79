//! Spreads light over neighboring cells in integers, without losing a single count.
//!
//! A value V is divided into fractions `c_j / 2^s` whose sum is 1. Part j gets `⌊V c_0…j / 2^s⌋ -
//! ⌊V c_0…j-1 / 2^s⌋`, so that the rounded parts add up to V. Light that would leave the picture is
//! mirrored at its border, so that uniform light stays uniform.

/// The light of cells, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<u64>,
}

/// Kernel that spreads the light of a cell over finer positions along an axis. Values stay below
/// 2^58.
#[derive(Debug)]
pub(super) struct Kernel<const PARTS: usize> {
    /// Number of positions per cell.
    pub(super) step: usize,
    /// Position of the first part relative to that of the cell.
    first: isize,
    /// Cumulative sums of the fractions, each including its part, in units of `2^-shift`.
    cumulative: [u64; PARTS],
    shift: u32,
}

/// Kernel that blurs cells by 1-2-1.
pub(super) const BLUR: Kernel<3> = Kernel { step: 1, first: -1, cumulative: [1, 3, 4], shift: 2 };

/// Kernel that spreads cells to cells of half the width by 1-3-3-1.
pub(super) const DOUBLE: Kernel<4> =
    Kernel { step: 2, first: -1, cumulative: [1, 4, 7, 8], shift: 3 };

/// Kernel that spreads cells four pixels wide to pixels by 1-3-5-7-7-5-3-1.
pub(super) const QUADRUPLE: Kernel<8> =
    Kernel { step: 4, first: -2, cumulative: [1, 4, 9, 16, 23, 28, 31, 32], shift: 5 };

impl<const PARTS: usize> Kernel<PARTS> {
    /// Returns one part of a cell's light. The parts of a cell add up to its light.
    #[inline(always)]
    pub(super) fn part(&self, value: u64, part: usize) -> u64 {
        let cumulative = |part: usize| (value * self.cumulative[part]) >> self.shift;
        cumulative(part) - if part == 0 { 0 } else { cumulative(part - 1) }
    }

    /// Returns the position, out of `n`, that receives a part of a cell, mirrored at the border.
    pub(super) fn position(&self, cell: usize, part: usize, n: usize) -> usize {
        let (position, n) = ((self.step * cell + part).cast_signed() + self.first, n.cast_signed());
        let from_start = if position < 0 { -1 - position } else { position };
        let mirrored = if from_start >= n { 2 * n - 1 - from_start } else { from_start };
        mirrored.clamp(0, n - 1).cast_unsigned()
    }

    /// Returns for each of `n` positions the indices of the cells and of their parts that it
    /// receives.
    pub(super) fn sources(&self, cells: usize, n: usize) -> Vec<Vec<(usize, usize)>> {
        let mut sources = vec![Vec::new(); n];
        for cell in 0..cells {
            for part in 0..PARTS {
                sources[self.position(cell, part, n)].push((cell, part));
            }
        }
        sources
    }

    /// Returns all parts of a cell's light, which add up to it.
    #[inline(always)]
    fn parts(&self, value: u64) -> [u64; PARTS] {
        let sums = self.cumulative.map(|fraction| (value * fraction) >> self.shift);
        std::array::from_fn(|part| sums[part] - if part == 0 { 0 } else { sums[part - 1] })
    }

    /// Adds the light of a row of cells to a row of positions, by calling `add`.
    #[inline(always)]
    pub(super) fn along<T>(&self, cells: &[u64], out: &mut [T], add: impl Fn(&mut T, u64)) {
        let n = out.len();
        for (cell, &value) in cells.iter().enumerate() {
            let parts = self.parts(value);
            let start = (self.step * cell).wrapping_add_signed(self.first);
            if let Some(out) = out.get_mut(start..start.wrapping_add(PARTS)) {
                out.iter_mut().zip(parts).for_each(|(out, part)| add(out, part));
            } else {
                for (part, light) in parts.into_iter().enumerate() {
                    add(&mut out[self.position(cell, part, n)], light);
                }
            }
        }
    }
}

impl Kernel<8> {
    /// Returns the light in counts below which a cell fits the 32-bit arithmetic of
    /// [`Self::along_narrow`].
    pub(super) fn narrow_limit(&self) -> u64 {
        1 << (32 - self.shift)
    }

    /// Adds the light of a row of faint cells to pixels like [`Self::along`], but four pixels at a
    /// time in 32 bits. Sums saturate.
    #[inline(always)]
    pub(super) fn along_narrow(&self, cells: &[u64], out: &mut [u32]) {
        let n = out.len();
        #[expect(clippy::cast_possible_truncation, reason = "faint, and up to 32")]
        let parts = |value: u64| {
            let sums =
                self.cumulative.map(|fraction| (value as u32 * fraction as u32) >> self.shift);
            let part = |part: usize| sums[part] - if part == 0 { 0 } else { sums[part - 1] };
            [std::array::from_fn(part), std::array::from_fn::<u32, 4, _>(|k| part(k + 4))]
        };
        // A block of four pixels gets the upper half of one cell and the lower half of the next.
        let inside = out.get_mut(2..).map(|out| out.as_chunks_mut::<4>().0).unwrap_or_default();
        let mut previous = cells.first().map_or([0; 4], |first| parts(*first)[1]);
        for (pixels, &cell) in inside.iter_mut().zip(cells.get(1..).unwrap_or_default()) {
            let [lower, upper] = parts(cell);
            for (pixel, (lower, previous)) in pixels.iter_mut().zip(lower.iter().zip(previous)) {
                *pixel = pixel.saturating_add(lower + previous);
            }
            previous = upper;
        }
        // Then handles the border, at which parts that leave the picture are mirrored.
        let n_inside = inside.len();
        let last = cells.len().saturating_sub(2).max(1)..cells.len();
        for cell in (0..cells.len().min(1)).chain(last) {
            for (half, parts) in parts(cells[cell]).into_iter().enumerate() {
                let block = cell + half;
                if (1..=n_inside).contains(&block) && block < cells.len() {
                    continue;
                }
                for (part, light) in parts.into_iter().enumerate() {
                    let out = &mut out[self.position(cell, 4 * half + part, n)];
                    *out = out.saturating_add(light);
                }
            }
        }
    }
}

impl Plane {
    /// Returns a plane without light.
    pub(super) fn dark(width: usize, height: usize) -> Self {
        Self { width, height, values: vec![0; width * height] }
    }

    /// Spreads the light along both axes and adds it to `out`.
    #[inline(always)]
    pub(super) fn spread_into<const PARTS: usize>(&self, kernel: &Kernel<PARTS>, out: &mut Self) {
        let mut row = vec![0; self.width];
        for (y, sources) in kernel.sources(self.height, out.height).iter().enumerate() {
            row.fill(0);
            for &(cell, part) in sources {
                let cells = &self.values[cell * self.width..][..self.width];
                for (sum, &value) in row.iter_mut().zip(cells) {
                    *sum += kernel.part(value, part);
                }
            }
            let out_row = &mut out.values[y * out.width..][..out.width];
            kernel.along(&row, out_row, |sum, light| *sum += light);
        }
    }

    /// Returns the plane blurred by [`BLUR`] along both axes.
    pub(super) fn blurred(&self) -> Self {
        let mut out = Self::dark(self.width, self.height);
        self.spread_into(&BLUR, &mut out);
        out
    }

    /// Returns the sums over cells of twice the width and height.
    pub(super) fn halved(&self) -> Self {
        let mut out = Self::dark(self.width.div_ceil(2), self.height.div_ceil(2));
        for (y, row) in self.values.chunks_exact(self.width).enumerate() {
            let sums = &mut out.values[(y / 2) * out.width..][..out.width];
            for (sum, pair) in sums.iter_mut().zip(row.chunks(2)) {
                *sum += pair.iter().sum::<u64>();
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreading_keeps_every_count_at_every_size() {
        for (width, height) in [(1, 1), (2, 3), (3, 2), (7, 5), (16, 9)] {
            let mut seed = 1_u64;
            let mut plane = Plane::dark(width, height);
            for value in &mut plane.values {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                *value = seed >> 20;
            }
            let sum: u64 = plane.values.iter().sum();
            assert_eq!(plane.blurred().values.iter().sum::<u64>(), sum, "{width}x{height}");
            assert_eq!(plane.halved().values.iter().sum::<u64>(), sum, "{width}x{height}");
            for (w, h) in [(2 * width, 2 * height), (2 * width - 1, 2 * height - 1)] {
                let mut fine = Plane::dark(w, h);
                plane.spread_into(&DOUBLE, &mut fine);
                assert_eq!(fine.values.iter().sum::<u64>(), sum, "{w}x{h}");
            }
        }
    }

    #[test]
    fn faint_cells_leave_the_same_counts_four_places_at_once() {
        let mut state = 7_u32;
        let mut random = || {
            state = state.wrapping_mul(0x9e37_79b9) ^ state >> 15;
            state
        };
        for n in 1..40_usize {
            let cells: Vec<u64> = (0..n.div_ceil(4)).map(|_| u64::from(random() >> 5)).collect();
            let mut one: Vec<u32> = (0..n).map(|_| random().saturating_mul(3)).collect();
            let mut four = one.clone();
            QUADRUPLE.along(&cells, &mut one, |out, light| {
                *out = out.saturating_add(u32::try_from(light).unwrap());
            });
            QUADRUPLE.along_narrow(&cells, &mut four);
            assert_eq!(one, four, "{n} places");
        }
    }

    #[test]
    fn uniform_light_stays_uniform() {
        let plane = Plane { width: 6, height: 4, values: vec![64; 24] };
        assert_eq!(plane.blurred(), plane);
        let mut fine = Plane::dark(12, 8);
        plane.spread_into(&DOUBLE, &mut fine);
        assert!(fine.values.iter().all(|value| *value == 16), "{fine:?}");
        let mut pixels = vec![0; 24];
        QUADRUPLE.along(&[32; 6], &mut pixels, |pixel, light| *pixel += light);
        assert_eq!(pixels, [8; 24]);
    }
}
