//! One drone, moved step by step.

use nalgebra::Vector3;

use super::body::Body;
use super::craft::Craft;
use crate::sim::options::SimOptions;
use crate::sim::wide::Each;

/// One drone in the air or on the floor (z = 0), moved by motor commands in steps of fixed length.
///
/// ```
/// use nalgebra::Vector3;
/// use noctograph::sim::{Plant, SimOptions};
///
/// let options = SimOptions::cf21();
/// let mut plant = Plant::new(&options, 0.001, 1, 0, Vector3::new(0.0, 0.0, 0.5));
/// let hover = options.vehicle.mass_kg * 9.81 / (4.0 * options.vehicle.k_f_n);
/// for _ in 0..100 {
///     plant.advance(&[hover; 4]);
/// }
/// assert!((plant.body().position_m.z - 0.5).abs() < 0.01);
/// ```
#[derive(Debug)]
pub struct Plant {
    craft: Craft<f64>,
    body: Body,
}

impl Plant {
    /// A level drone at rest, that of index `drone` in a flight with the noise of `seed`. In the air
    /// its rotors carry it already; on the floor they stand still.
    ///
    /// `dt_s` is the length of a step. It hardly matters up to 2 ms; the rotors' lag is exact at any.
    #[must_use]
    pub fn new(
        options: &SimOptions,
        dt_s: f64,
        seed: u64,
        drone: u64,
        position_m: Vector3<f64>,
    ) -> Self {
        let craft = Craft::new(&Each::one(options), dt_s, &[seed], drone, position_m.z);
        Self { craft, body: Body::at(position_m) }
    }

    /// One step under motor commands m1…m4, each from 0 to the largest.
    #[inline(always)]
    pub fn advance(&mut self, commands: &[f64; 4]) {
        self.body = Body::from_row(&self.craft.advance(&self.body.row(), commands));
    }

    /// Where the drone is and how it moves.
    #[must_use]
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Voltage of the battery under load; `None` for a drone whose battery never sags.
    #[must_use]
    pub fn battery_v(&self) -> Option<f64> {
        self.craft.battery_v(0)
    }

    /// Energy that has left the battery, J; `None` as for [`Self::battery_v`].
    #[must_use]
    pub fn energy_j(&self) -> Option<f64> {
        self.craft.energy_j(0)
    }

    /// Steps so far in which the battery could not give a motor the thrust asked for.
    #[must_use]
    pub fn short_steps(&self) -> u32 {
        self.craft.short_steps(0)
    }

    /// What an accelerometer at the body origin reads, body frame: all forces but gravity, per mass.
    #[must_use]
    #[inline(always)]
    pub fn specific_force_m_s2(&self) -> Vector3<f64> {
        self.craft.specific_force_m_s2(&self.body.row()).into()
    }

    /// What whoever reads the flight should know of the battery.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        self.craft.warnings(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::vehicle::{GRAVITY_M_S2, VehicleOptions};

    fn plant(options: &SimOptions, height_m: f64) -> Plant {
        Plant::new(options, 0.002, 3, 0, Vector3::new(0.3, 0.0, height_m))
    }

    fn hover(options: &SimOptions) -> f64 {
        options.vehicle.mass_kg * GRAVITY_M_S2 / (4.0 * options.vehicle.k_f_n)
    }

    fn advance(plant: &mut Plant, command: f64, n: usize) {
        for _ in 0..n {
            plant.advance(&[command; 4]);
        }
    }

    #[test]
    fn the_floor_holds_carries_and_lets_go() {
        let options = SimOptions::default();
        let mut drone = plant(&options, 0.0);
        let start = *drone.body();
        advance(&mut drone, 0.9 * hover(&options), 100);
        assert_eq!(*drone.body(), start, "stays put");
        assert_eq!(drone.specific_force_m_s2(), Vector3::z() * GRAVITY_M_S2, "carried");
        advance(&mut drone, 1.2 * hover(&options), 100);
        assert!(drone.body().position_m.z > 0.01, "takes off");
        let mut falling = plant(&options, 0.1);
        falling.body.velocity_m_s.x = 1.0;
        advance(&mut falling, 0.0, 200);
        let place = falling.body().position_m;
        assert_eq!(*falling.body(), Body::at(Vector3::new(place.x, 0.0, 0.0)), "stops");
        assert!(place.x > 0.4, "flew on while it fell");
        let mut sinking = plant(&options, 1e-3);
        sinking.body.velocity_m_s.z = -1.0;
        sinking.advance(&[1.1 * hover(&options); 4]);
        assert_eq!(sinking.body().position_m.z, 0.0, "no thrust lets it through");
    }

    #[test]
    fn an_accelerometer_feels_thrust_and_drag() {
        let vehicle = VehicleOptions { body_drag_n_s_m: [0.0351, 0.0, 0.0], ..Default::default() };
        let mut drone = plant(&SimOptions { vehicle, ..Default::default() }, 1.0);
        drone.body.velocity_m_s = Vector3::new(2.0, 0.0, 0.0);
        let want = Vector3::new(-2.0, 0.0, GRAVITY_M_S2);
        assert!((drone.specific_force_m_s2() - want).norm() < 1e-12);
    }

    #[test]
    fn near_the_floor_hover_thrust_lifts() {
        let mut options = SimOptions::cf21();
        options.vehicle.center_of_mass_m = [0.0, 0.0];
        let mut drone = plant(&options, 0.02);
        advance(&mut drone, hover(&options), 250);
        assert!(drone.body().position_m.z > 0.025, "{}", drone.body().position_m.z);
    }

    #[test]
    fn an_exhausted_battery_lets_the_drone_fall_and_says_so() {
        let mut options = SimOptions::cf21();
        options.battery.charge_frac = 0.02;
        let mut drone = plant(&options, 1.0);
        advance(&mut drone, hover(&options), 5000);
        assert_eq!(drone.body().position_m.z, 0.0);
        assert_eq!(drone.warnings(), ["the battery was empty and the motors stopped"]);
    }

    #[test]
    fn thrust_beyond_the_battery_is_counted() {
        let mut options = SimOptions::cf21();
        options.battery.charge_frac = 0.3;
        options.battery.resistance_ohm = 0.3;
        options.battery.cut_off_v = 0.0;
        let mut drone = plant(&options, 1.0);
        advance(&mut drone, options.vehicle.motor_max, 100);
        assert!(drone.warnings()[0].starts_with("the battery could not"), "{:?}", drone.warnings());
    }

    #[test]
    fn the_same_seed_gives_the_same_bits() {
        let mut options = SimOptions::cf21();
        options.air.gusts = crate::sim::Gusts::OrnsteinUhlenbeck;
        // Nobody steers: the torque of a room would turn it over.
        options.air.gust_torque_sigma_n_m = [1e-7; 3];
        let end = |seed| {
            let mut drone = Plant::new(&options, 0.002, seed, 0, Vector3::z());
            advance(&mut drone, hover(&options), 500);
            *drone.body()
        };
        assert_eq!(end(1), end(1));
        assert_ne!(end(1), end(2));
        // Recorded; the same in debug and release, on every machine.
        let bits = end(1).position_m.map(f64::to_bits);
        assert_eq!(
            [bits.x, bits.y, bits.z],
            [13_809_910_240_826_039_975, 13_805_344_770_072_206_819, 4_607_130_987_054_665_022,]
        );
    }
}
