//! Positions of N drones from ranges, the motion being known: an extended Kalman filter.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::Link;
use crate::control::LockOut;

/// Positions of N drones with their covariance: an extended Kalman filter on ranges.
#[derive(Clone, Debug)]
pub struct Positions {
    anchors_m: Vec<Vector3<f64>>,
    /// Three for each drone.
    pub state_m: DVector<f64>,
    /// Its covariance.
    pub covariance_m2: DMatrix<f64>,
    gates: BTreeMap<Link, LockOut>,
}

impl Positions {
    /// Independent drones near these places, each axis with a standard deviation.
    #[must_use]
    pub fn new(anchors_m: &[Vector3<f64>], starts_m: &[Vector3<f64>], sigma_m: f64) -> Self {
        let m = 3 * starts_m.len();
        let state_m = DVector::from_iterator(m, starts_m.iter().flatten().copied());
        let covariance_m2 = DMatrix::from_diagonal_element(m, m, sigma_m * sigma_m);
        Self::with_covariance(anchors_m.to_vec(), state_m, covariance_m2)
    }

    pub(super) fn with_covariance(
        anchors_m: Vec<Vector3<f64>>,
        state_m: DVector<f64>,
        covariance_m2: DMatrix<f64>,
    ) -> Self {
        Self { anchors_m, state_m, covariance_m2, gates: BTreeMap::new() }
    }

    /// Covariance of the place of a drone.
    pub(super) fn covariance_m2(&self, drone: usize) -> Matrix3<f64> {
        self.covariance_m2.fixed_view::<3, 3>(3 * drone, 3 * drone).into_owned()
    }

    /// Place of a drone.
    #[must_use]
    pub fn at(&self, drone: usize) -> Vector3<f64> {
        self.state_m.fixed_rows::<3>(3 * drone).into_owned()
    }

    /// Moves the drones by known displacements, each axis with a variance.
    pub fn advance(&mut self, moved_m: &[Vector3<f64>], variance_m2: f64) {
        for (i, moved_m) in moved_m.iter().enumerate() {
            let mut at = self.state_m.fixed_rows_mut::<3>(3 * i);
            at += moved_m;
        }
        for i in 0..self.state_m.len() {
            self.covariance_m2[(i, i)] += variance_m2;
        }
    }

    /// Takes a range in unless it is farther from its prediction than `gate_sigmas`: its normalized
    /// innovation squared. A link that is refused five times in a row is believed again.
    pub fn correct(
        &mut self,
        link: Link,
        distance_m: f64,
        sigma_m: f64,
        gate_sigmas: f64,
    ) -> Option<f64> {
        let (h, expected_m) = slope(link, &self.anchors_m, &self.state_m);
        let innovation = distance_m - expected_m;
        let gate = self.gates.entry(link).or_default();
        let variance = gate.variance(sigma_m * sigma_m, innovation);
        let nis = innovation * innovation / (h.dot(&(&self.covariance_m2 * &h)) + variance);
        let taken = nis <= gate_sigmas * gate_sigmas;
        gate.note(taken);
        if taken {
            let measured = innovation + h.dot(&self.state_m);
            kalman(&mut self.state_m, &mut self.covariance_m2, &h, measured, variance);
        }
        taken.then_some(nis)
    }
}

/// Slope of a range over the positions, and the range itself.
pub(super) fn slope(
    link: Link,
    anchors_m: &[Vector3<f64>],
    state_m: &DVector<f64>,
) -> (DVector<f64>, f64) {
    let at = |i: usize| state_m.fixed_rows::<3>(3 * i).into_owned();
    let mut h = DVector::zeros(state_m.len());
    let (drone, away) = match link {
        Link::Anchor { drone, anchor } => (drone, at(drone) - anchors_m[anchor]),
        Link::Drones(i, j) => (i, at(i) - at(j)),
    };
    let length_m = away.norm();
    let direction = away / length_m.max(f64::MIN_POSITIVE);
    h.fixed_rows_mut::<3>(3 * drone).copy_from(&direction);
    if let Link::Drones(_, other) = link {
        h.fixed_rows_mut::<3>(3 * other).copy_from(&-direction);
    }
    (h, length_m)
}

/// A scalar measurement `hᵀx`.
pub(super) fn kalman(
    state: &mut DVector<f64>,
    covariance: &mut DMatrix<f64>,
    h: &DVector<f64>,
    measured: f64,
    variance: f64,
) {
    let a = &*covariance * h;
    let s = h.dot(&a) + variance;
    let innovation = measured - h.dot(state);
    state.axpy(innovation / s, &a, 1.0);
    covariance.ger(-1.0 / s, &a, &a, 1.0);
}
