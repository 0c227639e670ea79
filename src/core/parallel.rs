//! Parallel iterators: those of rayon or, in a page, which has one thread, those of the standard
//! library under the same names.
//!
//! Even without threads, rayon would take up a fiftieth of the page's module.

#[cfg(target_family = "wasm")]
pub use one_thread::*;
#[cfg(not(target_family = "wasm"))]
pub use rayon::{current_num_threads, join, prelude};

/// The functions of rayon that Noctograph calls, for one thread.
#[cfg(any(test, target_family = "wasm"))]
pub mod one_thread {
    /// Returns the number of threads.
    pub fn current_num_threads() -> usize {
        1
    }

    /// Calls two functions, and returns their results.
    pub fn join<A, B>(a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
        (a(), b())
    }

    /// Iterators of the standard library with the methods of rayon that Noctograph calls.
    pub mod prelude {
        use std::slice::{Chunks, ChunksExactMut, ChunksMut, Iter, Windows};

        /// Iterates over values.
        pub trait IntoParallelIterator: IntoIterator + Sized {
            /// Returns an iterator over the values.
            fn into_par_iter(self) -> Self::IntoIter {
                self.into_iter()
            }
        }

        impl<I: IntoIterator> IntoParallelIterator for I {}

        /// Iterates over parts of a slice.
        pub trait ParallelSlice<T> {
            /// Returns an iterator over the values.
            fn par_iter(&self) -> Iter<'_, T>;
            /// Returns an iterator over all runs of `n` values.
            fn par_windows(&self, n: usize) -> Windows<'_, T>;
            /// Returns an iterator over chunks of `n` values, of which the last may be shorter.
            fn par_chunks(&self, n: usize) -> Chunks<'_, T>;
            /// Returns an iterator over chunks that can be changed.
            fn par_chunks_mut(&mut self, n: usize) -> ChunksMut<'_, T>;
            /// Returns an iterator over whole chunks that can be changed.
            fn par_chunks_exact_mut(&mut self, n: usize) -> ChunksExactMut<'_, T>;
        }

        impl<T> ParallelSlice<T> for [T] {
            fn par_iter(&self) -> Iter<'_, T> {
                self.iter()
            }
            fn par_windows(&self, n: usize) -> Windows<'_, T> {
                self.windows(n)
            }
            fn par_chunks(&self, n: usize) -> Chunks<'_, T> {
                self.chunks(n)
            }
            fn par_chunks_mut(&mut self, n: usize) -> ChunksMut<'_, T> {
                self.chunks_mut(n)
            }
            fn par_chunks_exact_mut(&mut self, n: usize) -> ChunksExactMut<'_, T> {
                self.chunks_exact_mut(n)
            }
        }

        /// Methods that iterators of the standard library lack.
        pub trait ParallelIterator: Iterator + Sized {
            /// Returns the iterator, because the work is not divided.
            fn with_min_len(self, _least: usize) -> Self {
                self
            }

            /// Maps each value, with scratch memory that is created only once.
            fn map_init<S, R>(
                self,
                scratch: impl Fn() -> S,
                mut map: impl FnMut(&mut S, Self::Item) -> R,
            ) -> impl Iterator<Item = R> {
                let mut scratch = scratch();
                self.map(move |value| map(&mut scratch, value))
            }

            /// Calls a function for each value, with scratch memory that is created only once.
            fn for_each_init<S>(
                self,
                scratch: impl Fn() -> S,
                mut act: impl FnMut(&mut S, Self::Item),
            ) {
                let mut scratch = scratch();
                self.for_each(|value| act(&mut scratch, value));
            }
        }

        impl<I: Iterator> ParallelIterator for I {}
    }

    #[cfg(test)]
    mod tests {
        #[test]
        fn one_thread_computes_what_several_do() {
            macro_rules! computed {
                ($($threads:tt)*) => {{
                    use $($threads)* as threads;
                    use threads::prelude::*;
                    let values = (0..97_u64).into_par_iter();
                    let values: Vec<u64> = values.map_init(|| 31, |modulus, n| n * n % *modulus).collect();
                    let mut sums = vec![0; 13];
                    let rows = sums.par_chunks_exact_mut(2).zip(values.par_chunks(7)).with_min_len(2);
                    rows.enumerate().for_each_init(|| 1_usize, |one, (n, (sums, row))| {
                        sums[*one] = row.iter().sum::<u64>() + n as u64;
                    });
                    sums.par_chunks_mut(5).for_each(|sums| sums[0] += 1);
                    let steps = values.par_windows(2).filter_map(|pair| pair[1].checked_sub(pair[0]));
                    let steps: Vec<u64> = steps.chain(values.par_iter().copied()).collect();
                    threads::join(|| sums.clone(), || steps)
                }};
            }
            assert_eq!(computed!(crate::parallel::one_thread), computed!(rayon));
        }
    }
}
