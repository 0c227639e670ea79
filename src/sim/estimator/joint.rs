//! Covariance of the errors of several drones, nine each: a block for each drone, and one for each
//! pair. A drone alone has the arithmetic of [`Covariance`], bit for bit.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::covariance::{Covariance, Errors, Slope};
use super::ekf::Span;

/// Covariance of a pair: rows of the first drone, columns of the second.
type Cross = SMatrix<f64, 9, 9>;

/// The covariance, and the corrections that are not yet applied to the means.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    pub(super) own: Vec<Covariance>,
    /// Of the drones 0 and 1, 0 and 2, …, 1 and 2, ….
    cross: Vec<Cross>,
    pub(super) errors: Vec<Errors>,
    /// Room for the gains of one measurement.
    gains: Vec<Errors>,
}

/// How a measurement changes with the errors of one drone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) drone: usize,
    pub(super) slope: Slope,
    /// Slope over the velocity: of measurements of a moment that has passed.
    pub(super) velocity: Vector3<f64>,
}

impl Part {
    /// Of a measurement of the present moment.
    pub(super) fn now(drone: usize, slope: Slope) -> Self {
        Self { drone, slope, velocity: Vector3::zeros() }
    }

    fn along(&self, errors: &Errors) -> f64 {
        let present = self.slope.along(errors);
        if self.is_past() { present + self.velocity.dot(&errors.velocity_m_s) } else { present }
    }

    fn is_past(&self) -> bool {
        self.velocity != Vector3::zeros()
    }
}

impl Joint {
    /// Independent drones.
    pub(super) fn new(own: Vec<Covariance>) -> Self {
        let n = own.len();
        Self {
            own,
            cross: vec![Cross::zeros(); n * (n - 1) / 2],
            errors: vec![Errors::default(); n],
            gains: vec![Errors::default(); n],
        }
    }

    /// Index of the block of two drones, the first below the second.
    fn pair(&self, first: usize, second: usize) -> usize {
        let n = self.own.len();
        first * (2 * n - first - 1) / 2 + second - first - 1
    }

    /// Carries the errors of one drone over a span, see [`Covariance::carry`].
    pub(super) fn carry(&mut self, drone: usize, span: &Span, acceleration: [f64; 3], rate: f64) {
        let Span { span_s, lever, turn_rad } = span;
        self.own[drone].carry(*span_s, lever, turn_rad, acceleration, rate);
        if self.own.len() == 1 {
            return;
        }
        let b = lever * *span_s;
        let c = b * (0.5 * span_s);
        let cross = turn_rad.cross_matrix();
        let t = Matrix3::identity() - cross + cross * cross * 0.5;
        for other in 0..self.own.len() {
            if other > drone {
                let pair = self.pair(drone, other);
                carry_rows(&mut self.cross[pair], *span_s, &b, &c, &t);
            } else if other < drone {
                let pair = self.pair(other, drone);
                let mut rows = self.cross[pair].transpose();
                carry_rows(&mut rows, *span_s, &b, &c, &t);
                self.cross[pair] = rows.transpose();
            }
        }
    }

    /// Corrects by one scalar measurement, as [`Covariance::correct`], with a slope for each drone
    /// that takes part.
    pub(super) fn correct(
        &mut self,
        parts: &[Part],
        innovation: f64,
        variance: f64,
        gate_sq: f64,
    ) -> bool {
        let s = self.spread(parts) + variance;
        let expected: f64 = parts.iter().map(|p| p.along(&self.errors[p.drone])).sum();
        let left = innovation - expected;
        if left * left > gate_sq * s {
            return false;
        }
        let scale = 1.0 / s.sqrt();
        self.gains.iter_mut().for_each(|gain| *gain = gain.times(scale));
        for drone in 0..self.own.len() {
            let gain = self.gains[drone];
            self.errors[drone].add(&gain, left * scale);
            self.own[drone].reduce(&gain);
            for other in drone + 1..self.own.len() {
                let pair = self.pair(drone, other);
                let columns = stacked(&self.gains[other]);
                self.cross[pair].ger(-1.0, &stacked(&gain), &columns, 1.0);
            }
        }
        true
    }

    /// Fills `gains` with `P h` and returns `hᵀ P h`.
    fn spread(&mut self, parts: &[Part]) -> f64 {
        for drone in 0..self.own.len() {
            let mut sum = Errors::default();
            for part in parts {
                if part.drone == drone {
                    let own = &self.own[drone];
                    sum.add(&own.spread(&part.slope), 1.0);
                    if part.is_past() {
                        sum.position_m += own.pv * part.velocity;
                        sum.velocity_m_s += own.vv * part.velocity;
                        sum.turn_rad += own.vt.tr_mul(&part.velocity);
                    }
                    continue;
                }
                let slopes = [part.slope.position, part.velocity, part.slope.turn];
                let [mut p, mut v, mut t] = [Vector3::zeros(); 3];
                for (k, slope) in slopes.iter().enumerate() {
                    if drone < part.drone {
                        let block = &self.cross[self.pair(drone, part.drone)];
                        p += block.fixed_view::<3, 3>(0, 3 * k) * slope;
                        v += block.fixed_view::<3, 3>(3, 3 * k) * slope;
                        t += block.fixed_view::<3, 3>(6, 3 * k) * slope;
                    } else {
                        let block = &self.cross[self.pair(part.drone, drone)];
                        p += block.fixed_view::<3, 3>(3 * k, 0).tr_mul(slope);
                        v += block.fixed_view::<3, 3>(3 * k, 3).tr_mul(slope);
                        t += block.fixed_view::<3, 3>(3 * k, 6).tr_mul(slope);
                    }
                }
                sum.add(&Errors { position_m: p, velocity_m_s: v, turn_rad: t }, 1.0);
            }
            self.gains[drone] = sum;
        }
        parts.iter().map(|part| part.along(&self.gains[part.drone])).sum()
    }

    /// The corrections of a drone, which begin anew.
    pub(super) fn take(&mut self, drone: usize) -> Errors {
        std::mem::take(&mut self.errors[drone])
    }
}

/// `X ← Φ X`, see [`Covariance::carry`].
fn carry_rows(x: &mut Cross, span_s: f64, b: &Matrix3<f64>, c: &Matrix3<f64>, t: &Matrix3<f64>) {
    let [p, v, turn] = [0, 3, 6].map(|row| x.fixed_rows::<3>(row).into_owned());
    x.fixed_rows_mut::<3>(0).copy_from(&(p + v * span_s + c * turn));
    x.fixed_rows_mut::<3>(3).copy_from(&(v + b * turn));
    x.fixed_rows_mut::<3>(6).copy_from(&(t * turn));
}

/// Nine errors in one column.
fn stacked(errors: &Errors) -> nalgebra::SVector<f64, 9> {
    let Errors { position_m: p, velocity_m_s: v, turn_rad: t } = errors;
    nalgebra::SVector::<f64, 9>::from([p.x, p.y, p.z, v.x, v.y, v.z, t.x, t.y, t.z])
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::super::covariance::dense;
    use super::*;

    fn whole(joint: &Joint) -> DMatrix<f64> {
        let n = joint.own.len();
        let mut p = DMatrix::zeros(9 * n, 9 * n);
        for i in 0..n {
            p.fixed_view_mut::<9, 9>(9 * i, 9 * i).copy_from(&dense::matrix(&joint.own[i]));
            for j in i + 1..n {
                let block = joint.cross[joint.pair(i, j)];
                p.fixed_view_mut::<9, 9>(9 * i, 9 * j).copy_from(&block);
                p.fixed_view_mut::<9, 9>(9 * j, 9 * i).copy_from(&block.transpose());
            }
        }
        p
    }

    #[test]
    fn blocks_of_three_drones_are_the_dense_matrix() {
        let mut joint = Joint::new(vec![Covariance::new(0.3, 0.2, 0.1); 3]);
        let mut p = whole(&joint);
        let mut state = 1_u64;
        let mut random = || {
            state = crate::random::split_mix(state);
            #[expect(clippy::cast_precision_loss, reason = "a random number")]
            let number = (state >> 11) as f64 / 9_007_199_254_740_992.0;
            2.0 * number - 1.0
        };
        let mut vector = || Vector3::from_fn(|_, _| random());
        let mut mean = DVector::zeros(27);
        for step in 0..60 {
            let drone = step % 3;
            let lever = -(vector() + Vector3::z() * 9.8).cross_matrix();
            let span = Span { span_s: 0.05, lever, turn_rad: vector() * 0.02 };
            joint.carry(drone, &span, [0.3; 3], 0.04);
            let mut phi = DMatrix::identity(27, 27);
            let at = 9 * drone;
            let i3 = Matrix3::identity();
            let cross = span.turn_rad.cross_matrix();
            phi.fixed_view_mut::<3, 3>(at, at + 3).copy_from(&(i3 * 0.05));
            phi.fixed_view_mut::<3, 3>(at, at + 6).copy_from(&(lever * (0.5 * 0.05 * 0.05)));
            phi.fixed_view_mut::<3, 3>(at + 3, at + 6).copy_from(&(lever * 0.05));
            phi.fixed_view_mut::<3, 3>(at + 6, at + 6)
                .copy_from(&(i3 - cross + cross * cross * 0.5));
            p = &phi * p * phi.transpose();
            for k in 0..3 {
                p[(at + k, at + k)] += 0.3 * 0.05 * 0.05 * 0.05 / 3.0;
                p[(at + k, at + k + 3)] += 0.3 * 0.05 * 0.05 / 2.0;
                p[(at + k + 3, at + k)] += 0.3 * 0.05 * 0.05 / 2.0;
                p[(at + k + 3, at + k + 3)] += 0.3 * 0.05;
                p[(at + k + 6, at + k + 6)] += 0.04 * 0.05;
            }

            let mut h = DVector::zeros(27);
            let mut part = |drone: usize| {
                let slope = Slope { position: vector(), turn: vector() };
                let part = Part { drone, slope, velocity: vector() * 0.1 };
                h.fixed_rows_mut::<3>(9 * drone).copy_from(&slope.position);
                h.fixed_rows_mut::<3>(9 * drone + 3).copy_from(&part.velocity);
                h.fixed_rows_mut::<3>(9 * drone + 6).copy_from(&slope.turn);
                part
            };
            let parts = [part(step % 3), part((step + 1) % 3)];
            assert!(joint.correct(&parts, 0.1, 0.01, 1e6));
            let s = (h.transpose() * &p * &h)[0] + 0.01;
            let gain = &p * &h / s;
            mean += &gain * (0.1 - h.dot(&mean));
            p -= &gain * gain.transpose() * s;
        }
        let off = (whole(&joint) - &p).norm() / p.norm();
        assert!(off < 1e-13, "{off}");
        for drone in 0..3 {
            let off = stacked(&joint.errors[drone]) - mean.fixed_rows::<9>(9 * drone);
            assert!(off.norm() < 1e-12 * mean.norm(), "{drone}: {off}");
        }
    }
}
