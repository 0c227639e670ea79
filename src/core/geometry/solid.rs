//! Solids, and the distances of positions and paths from them.

use nalgebra::Vector3;

/// Convex solid. The distance from a solid has a single minimum along a straight path.
#[derive(Clone, Debug)]
pub enum Solid {
    /// All positions within a radius of a box, whose ends may be equal or infinite.
    Block {
        /// Ends of the box along x, y and z in m.
        ends_m: [[f64; 2]; 3],
        /// Radius around the box in m.
        radius_m: f64,
    },
    /// Plane, given by a point and its unit normal.
    Plane(Vector3<f64>, Vector3<f64>),
}

/// Number of steps of the ternary search along a path, which narrow it to 5e-7 of the path.
const SEARCH_STEPS: u32 = 36;

impl Solid {
    /// Creates an upright pillar of infinite height.
    pub fn pillar([x_m, y_m]: [f64; 2], radius_m: f64) -> Self {
        let ends_m = [[x_m; 2], [y_m; 2], [f64::NEG_INFINITY, f64::INFINITY]];
        Self::Block { ends_m, radius_m }
    }

    /// Returns the distance of a position from the solid in m, or 0 inside it.
    pub fn distance_m(&self, position_m: &Vector3<f64>) -> f64 {
        // `beyond_m` returns a coordinate's distance from the block's interval on one axis.
        let beyond_m = |[low, high]: [f64; 2], m: f64| (low - m).max(m - high).max(0.0);
        let distance_m = match self {
            Self::Block { ends_m: [x, y, z], radius_m } => {
                let [x, y] = [beyond_m(*x, position_m.x), beyond_m(*y, position_m.y)];
                libm::hypot(libm::hypot(x, y), beyond_m(*z, position_m.z)) - radius_m
            }
            Self::Plane(point_m, normal) => (position_m - point_m).dot(normal).abs(),
        };
        distance_m.max(0.0)
    }

    /// Returns the minimum distance along a straight path, by ternary search, or `None` if that is
    /// at least `most_m`.
    pub fn nearer_m(&self, [from_m, to_m]: [Vector3<f64>; 2], most_m: f64) -> Option<f64> {
        let distance_at = |fraction: f64| self.distance_m(&from_m.lerp(&to_m, fraction));
        // Along a path, the distance changes by no more than the path's length.
        if distance_at(0.0) - (to_m - from_m).norm() >= most_m {
            return None;
        }
        // The distance from a convex solid is a convex function along the path, so it has a single
        // minimum. Each step drops a third of the interval.
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..SEARCH_STEPS {
            let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
            if distance_at(a) < distance_at(b) { high = b } else { low = a }
        }
        let least_m = distance_at(low).min(distance_at(0.0)).min(distance_at(1.0));
        (least_m < most_m).then_some(least_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_comes_as_near_as_it_does() {
        let ways = |y: f64, z: f64| [Vector3::new(-3.0, y, z), Vector3::new(7.0, y, z)];
        let nearest_m = |solid: &Solid, y: f64, z: f64| solid.nearer_m(ways(y, z), 9.0).unwrap();
        let pillar = Solid::pillar([1.0, 2.0], 0.25);
        assert!((nearest_m(&pillar, 0.5, 40.0) - 1.25).abs() < 1e-9, "at any height");
        let table = Solid::Block { ends_m: [[0.0, 1.0], [-1.0, 1.0], [0.0, 0.7]], radius_m: 0.0 };
        assert!((nearest_m(&table, 0.0, 1.0) - 0.3).abs() < 1e-9, "above it");
        assert!((nearest_m(&table, 1.3, 1.1) - 0.5).abs() < 1e-9, "across its edge");
        assert_eq!(nearest_m(&table, 0.9, 0.6), 0.0, "through it");
        let mirror = Solid::Plane(Vector3::new(2.0, 0.0, 0.0), Vector3::x());
        assert!(nearest_m(&mirror, 0.0, 1.0) < 1e-5, "through it");
        assert_eq!(pillar.nearer_m(ways(0.0, 0.0), 1.7), None);
    }
}
