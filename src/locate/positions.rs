//! Extended Kalman filter for the positions of N drones from ranges and known motion.

use nalgebra::{Matrix3, Vector3};

use super::Link;
use noctograph_sim::kalman::{Gate, Measurement, Normal, Part, product, toward};

/// Maximum innovation of an accepted range, in standard deviations.
pub(super) const GATE_SIGMAS: f64 = 4.0;

/// Extended Kalman filter for the positions of N drones and their covariance.
#[derive(Clone, Debug)]
pub struct Positions {
    anchors_m: Vec<Vector3<f64>>,
    normal: Normal,
    gate: Gate<Link>,
}

impl Positions {
    /// Creates the filter from its prior, `normal`, with three coordinates per drone. Ranges whose
    /// innovation exceeds `gate_sigmas` standard deviations are rejected.
    pub(super) fn with(anchors_m: Vec<Vector3<f64>>, normal: Normal, gate_sigmas: f64) -> Self {
        Self { anchors_m, normal, gate: Gate::new(gate_sigmas) }
    }

    /// Returns a drone's position and its covariance.
    pub fn estimate(&self, drone: usize) -> (Vector3<f64>, Matrix3<f64>) {
        (self.normal.three(3 * drone), self.normal.block(3 * drone, 3 * drone))
    }

    /// Moves the drones by `moved_m`, and adds the motion's variance of `variance_m2` on each axis.
    pub fn advance(&mut self, moved_m: &[Vector3<f64>], variance_m2: f64) {
        let Normal { mean, covariance, .. } = &mut self.normal;
        for (i, moved_m) in moved_m.iter().flatten().enumerate() {
            mean[i] += moved_m;
            covariance[(i, i)] += variance_m2;
        }
    }

    /// Corrects the positions with a range in m. Returns its normalized innovation squared, or
    /// `None` if the gate rejects the range. After five rejections in a row, a link is accepted
    /// again.
    pub fn correct(&mut self, link: Link, distance_m: f64, sigma_m: f64) -> Option<f64> {
        let states = self.normal.mean.as_slice();
        let (jacobian, expected_m) = range_jacobian(link, &self.anchors_m, states, 3);
        let value = distance_m - expected_m + product(&jacobian, states);
        let measurement = Measurement { jacobian: &jacobian, value, variance: sigma_m * sigma_m };
        let innovation = self.gate.correct(&mut self.normal, link, &measurement);
        innovation.map(|innovation| innovation.nis())
    }
}

/// Returns the Jacobian of a range with respect to the states, and the range in m that the states
/// give. The first three of every `stride` states are a drone's position.
pub(super) fn range_jacobian(
    link: Link,
    anchors_m: &[Vector3<f64>],
    states: &[f64],
    stride: usize,
) -> (Vec<Part>, f64) {
    let away_m =
        link.away_m(anchors_m, |drone| Vector3::from_column_slice(&states[stride * drone..][..3]));
    let (direction, length_m) = toward(&away_m);
    let ends = link.drones().zip([direction, -direction]);
    (ends.map(|(drone, along)| Part::Three(stride * drone, along)).collect(), length_m)
}

/// Returns the minimum and maximum coordinates of the anchors.
pub(super) fn extent_m(anchors_m: &[Vector3<f64>]) -> [Vector3<f64>; 2] {
    let [low_m, high_m] = [f64::INFINITY, f64::NEG_INFINITY].map(Vector3::repeat);
    [anchors_m.iter().fold(low_m, |a, b| a.inf(b)), anchors_m.iter().fold(high_m, |a, b| a.sup(b))]
}
