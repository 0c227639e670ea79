//! Chords: which samples of a path a straight line may skip.

/// Slopes of the chords from a first sample that pass close to every skipped sample, for each of N
/// coordinates. Narrowing them costs the same for every sample, so that a greedy simplification is
/// linear in time.
#[derive(Clone, Copy, Debug)]
pub struct Chords<const N: usize> {
    least: [f64; N],
    greatest: [f64; N],
}

impl<const N: usize> Chords<N> {
    /// Every slope.
    pub const ALL: Self = Self { least: [f64::NEG_INFINITY; N], greatest: [f64::INFINITY; N] };

    /// Keeps the chords that pass between two offsets from the first sample after `elapsed_s`.
    pub fn keep_between(&mut self, low: [f64; N], high: [f64; N], elapsed_s: f64) {
        for i in 0..N {
            self.least[i] = self.least[i].max(low[i] / elapsed_s);
            self.greatest[i] = self.greatest[i].min(high[i] / elapsed_s);
        }
    }

    /// Whether the chord to a sample at `offset` after `elapsed_s` is one of them.
    pub fn contain(&self, offset: [f64; N], elapsed_s: f64) -> bool {
        (0..N).all(|i| (self.least[i]..=self.greatest[i]).contains(&(offset[i] / elapsed_s)))
    }
}
