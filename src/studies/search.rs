//! Search: proposes points in a unit cube and learns from their costs.
//!
//! The method is tree-structured Parzen estimation (Bergstra et al., "Algorithms for
//! Hyper-Parameter Optimization", NIPS 2011) in the implementation of the crate `tpe`, with one
//! estimator per coordinate.

use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use tpe::{TpeOptimizer, TpeOptimizerBuilder, parzen_estimator, range};

/// A search in `[0, 1)ⁿ` for the point with the minimum cost.
#[derive(Debug)]
pub(super) struct Search {
    rng: ChaCha8Rng,
    coordinates: Vec<TpeOptimizer>,
    n_points: usize,
}

/// Fraction of the points that count as good, called γ by Bergstra et al.
const GOOD_FRAC: f64 = 0.15;

impl Search {
    /// Creates a search over `n_coordinates` coordinates. Panics if there are none.
    pub(super) fn new(n_coordinates: usize, seed: u64) -> Self {
        assert!(n_coordinates > 0, "a search along at least one coordinate");
        let unit = range(0.0, 1.0).expect("a range");
        let coordinates = (0..n_coordinates).map(|_| {
            let mut builder = TpeOptimizerBuilder::new();
            builder.gamma(GOOD_FRAC).build(parzen_estimator(), unit).expect("within 0 to 1")
        });
        let coordinates = coordinates.collect();
        Self { rng: ChaCha8Rng::seed_from_u64(seed), coordinates, n_points: 0 }
    }

    /// Returns the next point to try, in the unit cube. The first points are uniform, and later
    /// ones are drawn where earlier costs were low.
    pub(super) fn ask(&mut self) -> Vec<f64> {
        let rng = &mut self.rng;
        // Points are drawn uniformly until there are enough of them to estimate a density.
        if self.n_points < 2 * self.coordinates.len() {
            return self.coordinates.iter().map(|_| rng.random()).collect();
        }
        let values = self.coordinates.iter_mut().map(|coordinate| {
            // The coordinate is kept below 1, because the cube excludes its upper faces.
            coordinate.ask(rng).expect("points are known").clamp(0.0, 1.0 - 1e-12)
        });
        values.collect()
    }

    /// Adds a tried point with its cost, of which less is better. Panics if the cost is NaN or the
    /// point lies outside the cube.
    pub(super) fn tell(&mut self, point: &[f64], cost: f64) {
        self.n_points += 1;
        // Each coordinate is estimated independently, as by Bergstra et al.
        for (coordinate, value) in self.coordinates.iter_mut().zip(point) {
            coordinate.tell(*value, cost).expect("a number, within the cube");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 5;

    /// Returns a cost with a narrow valley that does not depend on one of the coordinates.
    fn cost(point: &[f64]) -> f64 {
        let bottom = [0.2, 0.7, 0.4, 0.9];
        point.iter().zip(bottom).map(|(x, b)| (x - b) * (x - b)).sum()
    }

    /// Returns the minimum cost that a search finds.
    fn least(n_points: usize, seed: u64) -> f64 {
        let mut search = Search::new(N, seed);
        let mut least = f64::INFINITY;
        for _ in 0..n_points {
            let point = search.ask();
            let within = point.iter().all(|x| (0.0..1.0).contains(x));
            assert!(point.len() == N && within, "{point:?}");
            let cost = cost(&point);
            search.tell(&point, cost);
            least = least.min(cost);
        }
        least
    }

    /// Returns the minimum cost among uniformly drawn points.
    fn least_by_chance(n_points: usize, seed: u64) -> f64 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let points = (0..n_points).map(|_| -> [f64; N] { std::array::from_fn(|_| rng.random()) });
        points.map(|point| cost(&point)).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn estimation_beats_chance() {
        let costs: Vec<f64> = (0..5).map(|seed| least(200, seed)).collect();
        let by_chance: f64 = (0..5).map(|seed| least_by_chance(200, seed)).sum();
        assert!(costs.iter().all(|cost| *cost < 0.03), "{costs:?}");
        assert!(costs.iter().sum::<f64>() < 0.6 * by_chance, "{costs:?}, {by_chance} by chance");
    }

    #[test]
    fn the_same_seed_asks_the_same() {
        assert_eq!(least(60, 3).to_bits(), least(60, 3).to_bits());
        assert_ne!(least(60, 3).to_bits(), least(60, 4).to_bits());
    }
}
