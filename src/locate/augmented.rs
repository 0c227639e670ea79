//! Locates N drones by ranges, from any start. The state is augmented with squares and products.
//!
//! With `n_i` = |`p_i|²` and `z_ij` = `p_iᵀ` `p_j` as additional states and known displacements
//! `δ_i`, the motion and the squared ranges become linear:
//!
//! ```text
//! p_i ← p_i + δ_i     n_i ← n_i + 2 δ_iᵀ p_i + |δ_i|²
//! z_ij ← z_ij + δ_jᵀ p_i + δ_iᵀ p_j + δ_iᵀ δ_j
//! d_ik² = n_i − 2 a_kᵀ p_i + |a_k|²     q_ij² = n_i + n_j − 2 z_ij
//! ```
//!
//! A Kalman filter therefore converges from any start, unless motion and anchors lie in one plane.
//! [`Augmented::positions`] fits positions to this state by Gauss–Newton, weighted by its
//! covariance, and returns them as a [`Positions`] filter. [`locate_augmented`] starts at the
//! center of the anchors and switches to that filter after five seconds. Later ranges do not
//! improve earlier positions.
//!
//! Sources: P. Batista, C. Silvestre, P. Oliveira, Systems & Control Letters 60 (2011) 665. G.
//! Indiveri, G. Parlangeli, arXiv 1308.0517. The noise of a squared range has the variance 4d²σ² +
//! 2σ⁴ and the mean σ².

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::fit::descend;
use super::pass::{Innovations, time_steps};
use super::positions::{GATE_SIGMAS, Positions, extent_m};
use super::smoother::{checked, heard_s};
use super::track::moved_m;
use super::{Link, LocateOptions, Located, RangeSample, Room, Track};
use noctograph_core::error::{Error, Result};
use noctograph_sim::kalman::{Entry, Measurement, Normal, Part};

/// Offsets of the Gauss–Newton starts along the least certain direction, in standard deviations.
const STARTS: [f64; 5] = [0.0, -1.0, 1.0, -2.0, 2.0];
/// Time in s from the first range after which the extended Kalman filter takes over.
const HAND_OVER_S: f64 = 5.0;
/// Random walk of the error in the known motion, m/√s, for velocities estimated on board.
const MOTION_SIGMA_M_SQRT_S: f64 = 0.05;
/// Additional cost of positions outside the room, which exceeds the cost of any fit inside it.
const OUTSIDE_COST: f64 = 1e6;
/// Minimum decrease of the cost with which a later fit replaces an earlier one.
const LEAST_GAIN: f64 = 1e-6;
/// Length below which the least certain direction of a drone is undefined, in m.
const LEAST_NORMAL: f64 = 1e-12;
/// Minimum eigenvalue assumed for the scaled covariance, which may be singular.
const LEAST_EIGENVALUE: f64 = 1e-13;

/// Linear filter for positions, their squares and their products.
#[derive(Clone, Debug)]
pub struct Augmented {
    anchors_m: Vec<Vector3<f64>>,
    n: usize,
    /// Mean and covariance of the state, relative to `origin_m`.
    normal: Normal,
    origin_m: Vector3<f64>,
}

impl Augmented {
    /// Creates the filter at `starts_m` with a standard deviation of `sigma_m` on each axis.
    /// Coordinates are relative to the mean of the starts, so that squares stay small.
    pub fn new(anchors_m: &[Vector3<f64>], starts_m: &[Vector3<f64>], sigma_m: f64) -> Self {
        let n = starts_m.len();
        let origin_m = starts_m.iter().sum::<Vector3<f64>>() / n.max(1) as f64;
        let positions_m: Vec<Vector3<f64>> =
            starts_m.iter().map(|start| start - origin_m).collect();
        let positions_m = flattened(&positions_m);
        let variance = sigma_m * sigma_m;

        let (mut state, jacobian) = (augmented(&positions_m), augmented_jacobian(&positions_m));
        // The square of a position has the mean |p|² + 3σ² and the variance 4|p|²σ² + 6σ⁴. The
        // product of two positions has a variance whose second-order term is 3σ⁴.
        state.rows_mut(3 * n, n).add_scalar_mut(3.0 * variance);
        let mut covariance = &jacobian * jacobian.transpose() * variance;
        for row in 3 * n..state.len() {
            let second_order = if row < 4 * n { 6.0 } else { 3.0 };
            covariance[(row, row)] += second_order * variance * variance;
        }
        let anchors_m = anchors_m.iter().map(|anchor| anchor - origin_m).collect();
        Self { anchors_m, n, normal: Normal::new(state, covariance), origin_m }
    }

    /// Moves the drones by `moved_m`, with a variance of `variance_m2` on each axis.
    pub fn advance(&mut self, moved_m: &[Vector3<f64>], variance_m2: f64) {
        let (n, moved_m) = (self.n, flattened(moved_m));
        // x ← F(δ) x + m(δ): squares and products change by the Jacobian of m at the displacement.
        let motion = augmented_jacobian(&moved_m);
        let entries = (3 * n..motion.nrows()).flat_map(|i| (0..3 * n).map(move |j| (i, j)));
        let transition: Vec<Entry> = entries.map(|(i, j)| (i, j, motion[(i, j)])).collect();
        // The displacement's noise acts at the new positions, and its square is added to the mean.
        let noise = augmented_jacobian(&(self.normal.mean.rows(0, 3 * n) + &moved_m));
        self.normal.predict(&transition, &[]);
        self.normal.mean += augmented(&moved_m);
        self.normal.mean.rows_mut(3 * n, n).add_scalar_mut(3.0 * variance_m2);
        self.normal.covariance += &noise * noise.transpose() * variance_m2;
    }

    /// Corrects the state with a range in m whose standard deviation is `sigma_m`.
    pub fn correct(&mut self, link: Link, distance_m: f64, sigma_m: f64) {
        let n = self.n;
        let variance_m2 = sigma_m * sigma_m;
        // The squared range is linear in the state, and its noise has a mean of σ².
        let mut value = distance_m * distance_m - variance_m2;
        let jacobian = match link {
            Link::Anchor { drone, anchor } => {
                let a = self.anchors_m[anchor];
                value -= a.norm_squared();
                vec![Part::Three(3 * drone, a * -2.0), Part::One(3 * n + drone, 1.0)]
            }
            Link::Drones(i, j) => vec![
                Part::One(3 * n + i, 1.0),
                Part::One(3 * n + j, 1.0),
                Part::One(product(n, i, j), -2.0),
            ],
        };
        // The variance of a squared range is 4 d² σ² + 2 σ⁴.
        let variance =
            4.0 * distance_m * distance_m * variance_m2 + 2.0 * variance_m2 * variance_m2;
        self.normal.correct(&Measurement { jacobian: &jacobian, value, variance }, |_| true);
    }

    /// Returns a drone's position and its covariance.
    pub fn estimate(&self, drone: usize) -> (Vector3<f64>, Matrix3<f64>) {
        let position_m = self.normal.three(3 * drone) + self.origin_m;
        (position_m, self.normal.block(3 * drone, 3 * drone))
    }

    /// Returns a filter for the positions that best fit the state, by Gauss–Newton, with a gate of
    /// `gate_sigmas` standard deviations. If motion and anchors lie in parallel planes, the mirror
    /// image behind the anchors has the same ranges, and only `room` distinguishes the two.
    pub fn positions(&self, room: Option<&Room>, gate_sigmas: f64) -> Positions {
        let Normal { mean, covariance, .. } = &self.normal;
        let m = 3 * self.n;
        // In units of standard deviations, the residuals are W (x − m(p)).
        let whiten = whitening(covariance);
        // Fits start along the least certain direction of the positions, and at their mirror image.
        let position_covariance = covariance.view((0, 0), (m, m)).into_owned();
        let weakest = position_covariance.clone().symmetric_eigen();
        let k = weakest.eigenvalues.imax();
        let along = weakest.eigenvectors.column(k) * weakest.eigenvalues[k].max(0.0).sqrt();
        let starts = STARTS.map(|sigmas| mean.rows(0, m) + &along * sigmas).into_iter();
        let fits = starts.chain([self.mirrored(&along)]).map(|start| {
            let (mut cost, mut positions_m, jacobian) = descend(
                |p| (&whiten * augmented_jacobian(p), &whiten * (mean - augmented(p))),
                |diagonal| diagonal,
                start,
            );
            for i in 0..self.n {
                let mut position_m = positions_m.fixed_rows_mut::<3>(3 * i);
                position_m += self.origin_m;
            }
            if room.is_some_and(|room| !room.holds_all(&positions_m)) {
                cost += OUTSIDE_COST;
            }
            (cost, positions_m, jacobian)
        });
        // A later fit must be clearly better, so that rounding does not choose between equal fits.
        let best =
            fits.reduce(|best, other| if other.0 < best.0 - LEAST_GAIN { other } else { best });
        let (_, positions_m, jacobian) = best.expect("there are starts");
        let covariance_m2 =
            (jacobian.transpose() * jacobian).try_inverse().unwrap_or(position_covariance);
        let anchors_m = self.anchors_m.iter().map(|anchor| anchor + self.origin_m).collect();
        Positions::with(anchors_m, Normal::new(positions_m, covariance_m2), gate_sigmas)
    }

    /// Returns the positions in m mirrored at the anchors' plane. `along` is the least certain
    /// direction of all coordinates, of which each drone's part is normal to that plane.
    fn mirrored(&self, along: &DVector<f64>) -> DVector<f64> {
        let n_anchors = self.anchors_m.len().max(1) as f64;
        let middle_m = self.anchors_m.iter().sum::<Vector3<f64>>() / n_anchors;
        let mut positions_m = self.normal.mean.rows(0, 3 * self.n).into_owned();
        for drone in 0..self.n {
            // The least certain direction of a drone is normal to the anchors' plane.
            let normal = along.fixed_rows::<3>(3 * drone).into_owned();
            if let Some(normal) = normal.try_normalize(LEAST_NORMAL) {
                let mut position_m = positions_m.fixed_rows_mut::<3>(3 * drone);
                let distance_m = (position_m.clone_owned() - middle_m).dot(&normal);
                position_m -= normal * (2.0 * distance_m);
            }
        }
        positions_m
    }
}

/// Returns a `W` for which `WᵀW` is a covariance's inverse, from eigenvectors of the correlations.
fn whitening(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let scale = covariance.diagonal().map(|v| 1.0 / v.max(f64::MIN_POSITIVE).sqrt());
    let scaled =
        DMatrix::from_fn(scale.len(), scale.len(), |i, j| covariance[(i, j)] * scale[i] * scale[j]);
    let eigen = scaled.symmetric_eigen();
    let inverse_sigmas = eigen.eigenvalues.map(|e| 1.0 / e.max(LEAST_EIGENVALUE).sqrt());
    DMatrix::from_diagonal(&inverse_sigmas)
        * eigen.eigenvectors.transpose()
        * DMatrix::from_diagonal(&scale)
}

/// Returns the coordinates of all vectors as one column.
fn flattened(vectors_m: &[Vector3<f64>]) -> DVector<f64> {
    DVector::from_iterator(3 * vectors_m.len(), vectors_m.iter().flatten().copied())
}

/// Returns the augmented state m(p) of positions p in m, which consists of positions, squares (m²)
/// and products (m²).
fn augmented(p: &DVector<f64>) -> DVector<f64> {
    let n = p.len() / 3;
    let mut x = p.clone().resize_vertically(n_states(n), 0.0);
    for i in 0..n {
        let position_m = p.fixed_rows::<3>(3 * i);
        x[3 * n + i] = position_m.norm_squared();
        for j in i + 1..n {
            x[product(n, i, j)] = position_m.dot(&p.fixed_rows::<3>(3 * j));
        }
    }
    x
}

/// Returns the Jacobian of [`augmented`] at the positions `p` in m.
fn augmented_jacobian(p: &DVector<f64>) -> DMatrix<f64> {
    let n = p.len() / 3;
    let mut jacobian = DMatrix::identity(n_states(n), 3 * n);
    // The Jacobian is the identity for positions, 2pᵀ for |p|², and the other position for a
    // product.
    for i in 0..n {
        for axis in 0..3 {
            jacobian[(3 * n + i, 3 * i + axis)] = 2.0 * p[3 * i + axis];
            for j in i + 1..n {
                jacobian[(product(n, i, j), 3 * i + axis)] = p[3 * j + axis];
                jacobian[(product(n, i, j), 3 * j + axis)] = p[3 * i + axis];
            }
        }
    }
    jacobian
}

/// Returns the number of augmented states of `n` drones, which are three coordinates and a square
/// for each, and a product for each pair.
fn n_states(n: usize) -> usize {
    4 * n + n * (n - 1) / 2
}

/// Returns the index of `p_iᵀ p_j` in the augmented state of `n` drones. Products follow the
/// coordinates and squares, and are ordered by i, then by j > i.
fn product(n: usize, i: usize, j: usize) -> usize {
    let (i, j) = (i.min(j), i.max(j));
    4 * n + i * (2 * n - i - 1) / 2 + j - i - 1
}

/// Locates drones with the linear augmented filter for the first 5 s, and with an
/// extended Kalman filter from then on.
///
/// # Errors
///
/// Returns [`Error::Input`] for an invalid distance, and for an unlisted drone or anchor.
pub fn locate_augmented(
    anchors_m: &[Vector3<f64>],
    tracks: &[Track],
    samples: &[RangeSample],
    options: &LocateOptions,
) -> Result<Located> {
    let samples = checked(anchors_m, tracks.len(), samples)?;
    let [low_m, high_m] = extent_m(anchors_m);
    let Some(mut before_s) = samples.first().map(|first| first.time_s) else {
        return Err(Error::input("ranges", "none", "a range", "log the ranges during the flight"));
    };
    // All drones start at the anchors' center, with the anchors' extent as standard deviation.
    let hand_over_s = before_s + HAND_OVER_S;
    let starts_m = vec![(low_m + high_m) * 0.5; tracks.len()];
    let reach_m = (high_m - low_m).norm().max(1.0);
    let mut linear = Augmented::new(anchors_m, &starts_m, reach_m);
    let mut handed_over: Option<Positions> = None;
    let mut located = Located::empty(tracks.len());
    let mut innovations = Innovations::default();
    for step in time_steps(&samples) {
        let time_s = step[0].time_s;
        let moved_m = moved_m(tracks, before_s, time_s);
        let variance_m2 = MOTION_SIGMA_M_SQRT_S * MOTION_SIGMA_M_SQRT_S * (time_s - before_s);
        before_s = time_s;
        match &mut handed_over {
            None => linear.advance(&moved_m, variance_m2),
            Some(positions) => positions.advance(&moved_m, variance_m2),
        }
        // By now the linear filter has converged, and the extended Kalman filter continues from it.
        if handed_over.is_none() && time_s >= hand_over_s {
            handed_over = Some(linear.positions(None, GATE_SIGMAS));
        }
        for RangeSample { link, distance_m, .. } in step {
            match &mut handed_over {
                None => linear.correct(*link, *distance_m, options.range_sigma_m),
                Some(positions) => {
                    let nis = positions.correct(*link, *distance_m, options.range_sigma_m);
                    innovations.record(*link, nis);
                }
            }
        }
        located.push(time_s, |drone| match &handed_over {
            None => linear.estimate(drone),
            Some(positions) => positions.estimate(drone),
        });
    }
    located.heard_s = heard_s(tracks.len(), &samples);
    Ok(located.with_residuals(anchors_m, &samples, &innovations, options.range_sigma_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{FIVE_LINKS, GEOMETRIES, Random, flight, off_m, path};

    #[test]
    fn without_noise_the_linear_filter_finds_any_start_to_a_micrometer() {
        // Two drones fly figures in space. Their starts have an error of 3 m and are not trusted.
        let mut random = Random(5);
        let anchors_m = GEOMETRIES[0].1.map(Vector3::from);
        fn place(drone: usize, time_s: f64) -> Vector3<f64> {
            let phase = 1.7 * drone as f64;
            let wave = |rate: f64| libm::sin(rate * time_s + phase);
            Vector3::new(1.5 * wave(1.0), 1.2 * wave(1.3), 1.2 + 0.8 * wave(0.7))
        }
        let starts_m = [0, 1].map(|drone| place(drone, 0.0) + random.vector().normalize() * 3.0);
        let mut filter = Augmented::new(&anchors_m, &starts_m, 30.0);
        for k in 1..=4000_u32 {
            let (then_s, now_s) = (f64::from(k - 1) * 0.01, f64::from(k) * 0.01);
            let moved_m = [0, 1].map(|drone| place(drone, now_s) - place(drone, then_s));
            filter.advance(&moved_m, 0.0);
            let link = FIVE_LINKS[k as usize % 5];
            let distance_m = link.away_m(&anchors_m, |drone| place(drone, now_s)).norm();
            filter.correct(link, distance_m, 1e-4);
        }
        for drone in 0..2 {
            let off_m = (filter.estimate(drone).0 - place(drone, 40.0)).norm();
            assert!(off_m < 1e-6, "drone {drone}: {off_m} m");
        }
    }

    /// Returns how many of 60 starts, with an error of 5 m over both drones, are within 25 cm after
    /// 20 s of writing. If `linear` is true, the linear filter runs first, given a room. Otherwise
    /// the extended Kalman filter is used from the start.
    fn converged(anchors_m: [[f64; 3]; 3], linear: bool, room: Option<&Room>) -> usize {
        let anchors_m = anchors_m.map(Vector3::from);
        let place = path();
        let run = |run: u64| {
            let mut random = Random(run + 1);
            let shifts = [random.vector(), random.vector()];
            let length = (shifts[0].norm_squared() + shifts[1].norm_squared()).sqrt();
            let starts_m = [0, 1].map(|d| place(d, 0.0) + shifts[d] * (5.0 / length));
            let sigma_m = 5.0 / f64::sqrt(6.0);
            let mut first = Augmented::new(&anchors_m, &starts_m, sigma_m);
            let mut second = (!linear).then(|| {
                let mut normal = Normal::independent(&[sigma_m; 6]);
                let starts = starts_m.iter().flatten();
                normal.mean.iter_mut().zip(starts).for_each(|(x, start)| *x = *start);
                Positions::with(anchors_m.to_vec(), normal, 1e6)
            });
            let dt_s = 0.005;
            for k in 1..=4000_u32 {
                let now_s = f64::from(k) * dt_s;
                let moved_m = [0, 1].map(|d| {
                    let walked_m = random.vector() * (0.02 * dt_s.sqrt());
                    place(d, now_s) - place(d, now_s - dt_s) + walked_m
                });
                let link = FIVE_LINKS[k as usize % 5];
                let true_m = link.away_m(&anchors_m, |drone| place(drone, now_s)).norm();
                let distance_m = true_m + 0.06 * random.normal();
                let variance_m2 = 0.02 * 0.02 * dt_s;
                match &mut second {
                    Some(positions) => {
                        positions.advance(&moved_m, variance_m2);
                        positions.correct(link, distance_m, 0.06);
                    }
                    None => {
                        first.advance(&moved_m, variance_m2);
                        first.correct(link, distance_m, 0.06);
                        second = (k == 1000).then(|| first.positions(room, 1e6));
                    }
                }
            }
            let second = second.expect("handed over");
            let off_m2: f64 =
                (0..2).map(|d| (second.estimate(d).0 - place(d, 20.0)).norm_squared()).sum();
            off_m2.sqrt() < 0.25
        };
        (0..60).filter(|k| run(*k)).count()
    }

    #[test]
    fn starts_five_metres_off_are_found_in_every_geometry_and_not_by_an_ekf() {
        let room =
            Room { low_m: Vector3::new(-3.0, -2.6, -0.5), high_m: Vector3::new(3.0, 2.6, 3.0) };
        for (name, anchors_m) in GEOMETRIES {
            let [linear, ekf] =
                [true, false].map(|linear| converged(anchors_m, linear, Some(&room)));
            assert!(linear >= 59, "{name}: {linear} of 60");
            assert!(ekf < 55, "{name}: EKF {ekf} of 60");
        }
        // Without the room, the mirror image behind the wall fits equally well.
        let blind = converged(GEOMETRIES[1].1, true, None);
        assert!(blind < 59, "{blind}");
    }

    #[test]
    fn five_links_and_the_motion_place_two_drones_without_a_start() {
        let (anchors_m, tracks, samples) = flight(0.06);
        let options = LocateOptions { range_sigma_m: 0.06, ..Default::default() };
        let located = locate_augmented(&anchors_m, &tracks, &samples, &options).unwrap();
        let off_m = off_m(&located, path());
        assert!(off_m < 0.25, "{off_m} m");
        assert!(located.nis.is_some_and(|nis| (0.5..1.3).contains(&nis)), "NIS {:?}", located.nis);
        assert!(located.refused_frac < 0.01, "{}", located.refused_frac);
    }
}
