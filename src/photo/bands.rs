//! Bands of rows, one for each core: what a row becomes depends on no other row, so the picture is
//! the same on any number of threads.

use std::ops::Range;

/// Pixels that are worth a thread of their own.
pub(super) const THREAD_PIXELS: usize = 1 << 16;

/// Hands `out`, rows of `row_len` values, to `work` in bands: which rows, and their values.
/// `pixels` is how much work that is.
pub(super) fn rows<T: Send>(
    pixels: usize,
    row_len: usize,
    out: &mut [T],
    work: impl Fn(Range<usize>, &mut [T]) + Sync,
) {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    rows_on(cores.min(pixels / THREAD_PIXELS), row_len, out, work);
}

/// The same on so many threads, at most one a row.
fn rows_on<T: Send>(
    threads: usize,
    row_len: usize,
    out: &mut [T],
    work: impl Fn(Range<usize>, &mut [T]) + Sync,
) {
    let height = out.len() / row_len.max(1);
    let band = height.div_ceil(threads.max(1)).max(1);
    if band >= height {
        return work(0..height, out);
    }
    std::thread::scope(|scope| {
        for (index, rows) in out.chunks_mut(band * row_len).enumerate() {
            let start = index * band;
            let work = &work;
            scope.spawn(move || work(start..start + rows.len() / row_len, rows));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_is_worked_on_once_on_any_number_of_threads() {
        for threads in [0, 1, 2, 3, 7, 50] {
            let mut out = vec![0; 3 * 11];
            rows_on(threads, 3, &mut out, |rows, band| {
                assert_eq!(band.len(), 3 * rows.len());
                for (y, row) in rows.zip(band.chunks_exact_mut(3)) {
                    row.iter_mut().for_each(|value| *value += y + 1);
                }
            });
            let wanted: Vec<usize> = (0..33).map(|i| i / 3 + 1).collect();
            assert_eq!(out, wanted, "{threads} threads");
        }
    }
}
