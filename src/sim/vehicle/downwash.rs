//! Downwash, the stream of air below a drone, and the thrust that another drone loses in it.
//!
//! The streams of four rotors merge into a round jet that spreads with the distance and slows down.
//! A rotor in the jet provides less lift, depending on the speeds of the stream and of the rotor.
//! Unequal losses tilt the drone. Each speed is proportional to the square root of a thrust, so the
//! loss is `√(T T')` times a function of the position relative to the drone's size.
//!
//! Two models of a Crazyflie's loss on the axis are published:
//!
//! | distance, m | 0.2 | 0.3 | 0.4 | 0.5 | 0.6 | 1.0 |
//! |---|---|---|---|---|---|---|
//! | gym-pybullet-drones, mN | 1896 | 843 | 474 | 303 | 211 | 76 |
//! | Neural-Swarm, mN | 98 | 78 | 59 | 39 | 20 | 0 |
//! | here, mN | 98 | 75 | 53 | 41 | 34 | 20 |
//!
//! The first is `_downwash()` of `BaseAviary.py` with the coefficients 2267.18, 0.16 and −0.11 of
//! `cf2x.urdf`. At 0.3 m, this model predicts a loss of three times the weight, although Crazyflies
//! have hovered above each other at that distance (Neural-Swarm). The model's width 0.16 z − 0.11
//! vanishes at 0.69 m. The second is figure 3 of Shi, Hönig, Yue, Chung: "Neural-Swarm" (arXiv
//! 2003.02992), measured in flight with drones of 34 g.
//! `gym_art/quadrotor_multi/aerodynamics/downwash.py` approximates that figure by 10, 8, 6 and 4 g
//! up to 0.5 m and a straight line to 0 beyond. This program uses the second model up to 0.5 m, and
//! beyond that the decay of a round jet, `1/(z − z₀)` (Pope, "Turbulent Flows", 2000, section 5.1).
//! According to USC-ACTLab/crazyswarm issue 97, drones with a good controller still hover at 0.6 m,
//! whereas some with the stock controller could not hover at 1 m.
//!
//! Turbulence and delay of the stream, its deflection by the floor and by other streams (losses add
//! up), and drag of a body in the stream are not modeled.

use nalgebra::{Vector3, Vector4};

use super::body::RigidBody;
use noctograph_core::crazyflie::{MOTOR_SIGNS, N_MOTORS};

/// Largest fraction of the thrust that is lost, 10 g of 34 g in the nearest measurement (0.2 m).
const MOST_LOST: f64 = 10.0 / 34.0;
/// Product of the lost fraction and the distance from [`ORIGIN`] in arm lengths, from a product of
/// 1.9 g m for a drone of 34 g with an arm of 46 mm. The loss is within 10 % of the measurements
/// from 0.3 to 0.5 m.
const LOSS_SIZES: f64 = 1.9 / 34.0 / CRAZYFLIE_M;
/// Distance of the jet's virtual origin below the drone in arm lengths, which corresponds to 50 mm.
const ORIGIN: f64 = 0.05 / CRAZYFLIE_M;
/// Distance in m from the center to a rotor of the measured drones (`ARM_LENGTH`).
const CRAZYFLIE_M: f64 = 0.046;
/// Increase of the jet's standard deviation per unit distance. The radius at half the axial speed
/// is 0.094 z (Hussein, Capp, George 1994, from a quotation of Pope's table 5.1), or 1.177 σ.
const SPREAD: f64 = 0.094 / 1.177;
/// Reach of the jet from its axis in standard deviations, beyond which 0.03 % of the speed remains.
const REACH: f64 = 4.0;

/// Stream of air below a drone.
#[derive(Clone, Copy, Debug)]
pub struct Jet {
    from_m: Vector3<f64>,
    /// Unit vector along which the air flows, opposite to the drone's body z axis.
    along: Vector3<f64>,
    thrust_n: f64,
    /// Distance from the drone's middle to its rotors in m.
    size_m: f64,
}

impl Jet {
    /// Creates the stream below a drone with a total thrust and rotors at `size_m` from its center.
    pub(super) fn new(body: &RigidBody, thrust_n: f64, size_m: f64) -> Self {
        let along = body.world_from_body * -Vector3::z();
        Self { from_m: body.position_m, along, thrust_n, size_m }
    }

    /// Returns the thrust in N that each rotor of a drone loses in the stream. `thrust_n` is the
    /// drone's total thrust, and `arm_m` is the lever of its rotors.
    pub(crate) fn lost_n(&self, body: &RigidBody, thrust_n: f64, arm_m: f64) -> Vector4<f64> {
        let apart_m = body.position_m - self.from_m;
        let below_m = apart_m.dot(&self.along);
        let sigma_m = libm::hypot(self.size_m, SPREAD * below_m);
        let reach_m = REACH * sigma_m;
        if below_m <= 0.0 || self.squared_offset_m2(&apart_m) > reach_m * reach_m {
            return Vector4::zeros();
        }
        // On the axis, the speed decreases as 1/z from the virtual origin, up to the largest loss.
        let from_origin = below_m / self.size_m - ORIGIN;
        let lost_frac =
            if from_origin > 0.0 { (LOSS_SIZES / from_origin).min(MOST_LOST) } else { MOST_LOST };
        let each_n = lost_frac * (self.thrust_n * thrust_n).max(0.0).sqrt() / N_MOTORS;
        // Across the axis, the speed has a Gaussian profile. The fraction is for a drone on the
        // axis, with each rotor an arm's diagonal away from it.
        Vector4::from_fn(|motor, _| {
            let [left, back] = [MOTOR_SIGNS[(0, motor)], MOTOR_SIGNS[(1, motor)]];
            let rotor_m = body.world_from_body * Vector3::new(-back * arm_m, left * arm_m, 0.0);
            let excess_m2 = self.squared_offset_m2(&(apart_m + rotor_m)) - 2.0 * arm_m * arm_m;
            each_n * libm::exp(-0.5 * excess_m2 / (sigma_m * sigma_m))
        })
    }

    /// Returns the squared distance of a point from the jet's axis, given `apart_m` from the drone.
    fn squared_offset_m2(&self, apart_m: &Vector3<f64>) -> f64 {
        (apart_m - self.along * apart_m.dot(&self.along)).norm_squared()
    }
}
