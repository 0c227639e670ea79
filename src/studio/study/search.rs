//! Search: proposes points of a unit cube and learns from their costs.
//!
//! Tree-structured Parzen estimation (Bergstra et al., "Algorithms for Hyper-Parameter
//! Optimization", NIPS 2011) by the crate `tpe`, one estimator a coordinate; beside it a grid and
//! random points as baselines.

use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use tpe::{TpeOptimizer, TpeOptimizerBuilder, parzen_estimator, range};

use crate::settings::settings;

settings! {
    /// Search method.
    pub enum SearchKind {
        /// Tree-structured Parzen estimation.
        "tpe" => Tpe,
        /// Points drawn evenly.
        "random" => Random,
        /// Points of a lattice, in a scattered order.
        "grid" => Grid,
    }
}

/// A search for the point of least cost in `[0, 1)ⁿ`.
#[derive(Debug)]
pub struct Search {
    rng: ChaCha8Rng,
    n_coordinates: usize,
    way: Way,
}

#[derive(Debug)]
enum Way {
    Tpe { coordinates: Vec<TpeOptimizer>, n_told: usize },
    Random,
    Grid { levels: u64, next: u64, stride: u64 },
}

/// Share of the points that count as good.
const GOOD: f64 = 0.15;

impl Search {
    /// A search over `n_coordinates` with about `n_points` to come.
    ///
    /// # Panics
    ///
    /// If there is no coordinate.
    #[must_use]
    pub fn new(kind: SearchKind, n_coordinates: usize, n_points: usize, seed: u64) -> Self {
        assert!(n_coordinates > 0, "a search along at least one coordinate");
        let rng = ChaCha8Rng::seed_from_u64(seed);
        let way = match kind {
            SearchKind::Random => Way::Random,
            SearchKind::Tpe => {
                let unit = range(0.0, 1.0).expect("a range");
                let one = || {
                    let mut builder = TpeOptimizerBuilder::new();
                    builder.gamma(GOOD).build(parzen_estimator(), unit).expect("within 0 to 1")
                };
                Way::Tpe { coordinates: (0..n_coordinates).map(|_| one()).collect(), n_told: 0 }
            }
            SearchKind::Grid => {
                #[expect(clippy::cast_possible_truncation, reason = "small")]
                let levels =
                    (libm::pow(n_points.max(1) as f64, 1.0 / n_coordinates as f64) + 1e-9) as u64;
                let levels = levels.max(2);
                // Steps of the golden section scatter; coprime to the lattice, they miss nothing.
                let size = u128::from(levels).saturating_pow(
                    u32::try_from(n_coordinates).expect("a handful of coordinates"),
                );
                let size = u64::try_from(size).unwrap_or(u64::MAX);
                let mut stride = (size / 8 * 5).max(1);
                while gcd(stride, size) != 1 {
                    stride += 1;
                }
                Way::Grid { levels, next: 0, stride }
            }
        };
        Self { rng, n_coordinates, way }
    }

    /// The next point to try.
    pub fn ask(&mut self) -> Vec<f64> {
        let (rng, n) = (&mut self.rng, self.n_coordinates);
        match &mut self.way {
            // Few points give no estimate.
            Way::Tpe { coordinates, n_told } if *n_told >= 2 * n => coordinates
                .iter_mut()
                .map(|one| one.ask(rng).expect("points are known").clamp(0.0, 1.0 - 1e-12))
                .collect(),
            Way::Tpe { .. } | Way::Random => (0..n).map(|_| rng.random()).collect(),
            Way::Grid { levels, next, stride } => {
                let mut at = *next;
                *next = next.wrapping_add(*stride);
                let coordinate = |_| {
                    let middle = ((at % *levels) as f64 + 0.5) / *levels as f64;
                    at /= *levels;
                    middle
                };
                (0..n).map(coordinate).collect()
            }
        }
    }

    /// Adds the cost of a point.
    ///
    /// # Panics
    ///
    /// If the cost is no number, or the point not one of the cube.
    pub fn tell(&mut self, point: &[f64], cost: f64) {
        if let Way::Tpe { coordinates, n_told } = &mut self.way {
            *n_told += 1;
            for (one, at) in coordinates.iter_mut().zip(point) {
                one.tell(*at, cost).expect("a number, within the cube");
            }
        }
    }
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Least cost that a search finds on a narrow valley with one coordinate that does not matter.
    fn found(kind: SearchKind, n: usize, seed: u64) -> f64 {
        let mut search = Search::new(kind, 5, n, seed);
        let mut best = f64::INFINITY;
        for _ in 0..n {
            let at = search.ask();
            assert!(at.len() == 5 && at.iter().all(|x| (0.0..1.0).contains(x)), "{at:?}");
            let want = [0.2, 0.7, 0.4, 0.9];
            let cost = at.iter().zip(want).map(|(x, w)| (x - w) * (x - w)).sum::<f64>();
            search.tell(&at, cost);
            best = best.min(cost);
        }
        best
    }

    #[test]
    fn estimation_beats_chance_and_chance_beats_the_grid() {
        let worst = |kind| (0..5).map(|seed| found(kind, 200, seed)).fold(0.0, f64::max);
        let mean = |kind| (0..5).map(|seed| found(kind, 200, seed)).sum::<f64>() / 5.0;
        assert!(worst(SearchKind::Tpe) < 0.03, "{}", worst(SearchKind::Tpe));
        assert!(mean(SearchKind::Tpe) < 0.6 * mean(SearchKind::Random));
        assert!(mean(SearchKind::Random) < mean(SearchKind::Grid));
    }

    #[test]
    fn the_same_seed_asks_the_same() {
        assert_eq!(
            found(SearchKind::Tpe, 60, 3).to_bits(),
            found(SearchKind::Tpe, 60, 3).to_bits()
        );
        assert_ne!(
            found(SearchKind::Tpe, 60, 3).to_bits(),
            found(SearchKind::Tpe, 60, 4).to_bits()
        );
    }

    #[test]
    fn a_grid_visits_every_point_once() {
        let mut search = Search::new(SearchKind::Grid, 3, 64, 0);
        let mut seen: Vec<Vec<u64>> =
            (0..64).map(|_| search.ask().iter().map(|x| x.to_bits()).collect()).collect();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 64, "4 levels along 3 coordinates");
    }
}
