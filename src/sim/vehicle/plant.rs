//! Plant, which combines rotors, battery, body, air and floor, and advances step by step.

use nalgebra::{Vector3, Vector4};

use super::battery::Battery;
use super::body::{Inertia, RigidBody, Row};
use super::downwash::Jet;
use super::ground_effect::Floor;
use super::gusts::Wind;
use super::rotors::{Load, Rotors};
use super::{AirOptions, BatteryOptions, FloorOptions, VehicleOptions};
use noctograph_core::crazyflie::{GRAVITY_M_S2, N_MOTORS};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::flight::warning;

/// Options of a plant, for the drone, its battery, and the air and floor around it.
#[derive(Clone, Copy, Debug)]
pub struct PlantOptions<'a> {
    /// Options of the drone.
    pub vehicle: &'a VehicleOptions,
    /// Options of the drone's battery.
    pub battery: &'a BatteryOptions,
    /// Options of the air around the drone.
    pub air: &'a AirOptions,
    /// Options of the floor below the drone.
    pub floor: &'a FloorOptions,
}

/// Drone in the air or on the floor, driven by motor commands in steps of fixed length.
///
/// ```
/// use nalgebra::Vector3;
/// use noctograph_sim::{SimOptions, vehicle::Plant};
///
/// let options = SimOptions::default();
/// let mut plant = Plant::new(options.plant(), 0.001, 1, 0, Vector3::new(0.0, 0.0, 0.5));
/// let hover = options.vehicle.mass_kg * 9.81 / (4.0 * options.vehicle.k_f_n);
/// for _ in 0..100 {
///     plant.advance(&[hover; 4]);
/// }
/// assert!((plant.body().position_m.z - 0.5).abs() < 0.01);
/// ```
#[derive(Debug)]
pub struct Plant {
    row: Row,
    rotors: Rotors,
    battery: Option<Battery>,
    inertia: Inertia,
    floor: Floor,
    steps: FloorOptions,
    wind: Wind,
    wind_m_s: Vector3<f64>,
    dt_s: f64,
    thrust_per_command_n: f64,
    /// Fraction of the nominal thrust that each motor provides, less than 1 for a damaged motor.
    thrust_frac: Vector4<f64>,
    full_thrust_n: f64,
    short_steps: u32,
    arm_m: f64,
    /// Loss of thrust and torque in the downwash of other drones, if there is any.
    lost: Option<Load>,
}

impl Plant {
    /// Creates a level drone at rest, with noise from `seed` and the index `drone`. In the air, the
    /// rotors turn at hover speed, and on the floor, they do not turn.
    ///
    /// `dt_s` is the duration of a step. A duration of up to 2 ms hardly affects the result.
    pub fn new(
        options: PlantOptions<'_>,
        dt_s: f64,
        seed: u64,
        drone: u64,
        position_m: Vector3<f64>,
    ) -> Self {
        let PlantOptions { vehicle, battery, air, floor } = options;
        let floor_m = floor.height_m(position_m.x, position_m.y);
        let rotor_m_s2 = if position_m.z > floor_m { GRAVITY_M_S2 / N_MOTORS } else { 0.0 };
        Self {
            row: RigidBody::resting_at(position_m).row(),
            rotors: Rotors::new(vehicle, rotor_m_s2 * vehicle.mass_kg, dt_s),
            battery: Battery::new(battery),
            inertia: Inertia::new(vehicle),
            floor: Floor::new(vehicle),
            steps: floor.clone(),
            wind: Wind::new(air, dt_s, seed, drone),
            wind_m_s: air.wind_m_s.into(),
            dt_s,
            thrust_per_command_n: vehicle.k_f_n,
            thrust_frac: Vector4::from(vehicle.motor_loss_frac).map(|lost| 1.0 - lost),
            full_thrust_n: vehicle.full_thrust_n(),
            short_steps: 0,
            arm_m: vehicle.arm_m,
            lost: None,
        }
    }

    /// Returns the drone level and at rest, with a heading from world x toward y.
    #[must_use]
    pub fn facing(self, yaw_rad: f64) -> Self {
        Self { row: self.body().facing(yaw_rad).row(), ..self }
    }

    /// Returns the stream of air below the drone.
    pub fn jet(&self) -> Jet {
        let size_m = std::f64::consts::SQRT_2 * self.arm_m;
        Jet::new(&self.body(), self.rotors.thrust_n(), size_m)
    }

    /// Sets the downwash of other drones, which reduces the rotors' thrust until the next call.
    /// Without jets, no thrust is lost.
    pub fn enter<'a>(&mut self, jets: impl Iterator<Item = &'a Jet>) {
        let (body, thrust_n) = (self.body(), self.rotors.thrust_n());
        let lost_n: Vector4<f64> = jets.map(|jet| jet.lost_n(&body, thrust_n, self.arm_m)).sum();
        // The losses in several jets add up, but no rotor loses more than the mean thrust.
        let bounded_n = lost_n.map(|lost_n| lost_n.min(thrust_n / N_MOTORS));
        self.lost = (bounded_n.max() > 0.0).then(|| self.rotors.lost_load(&bounded_n));
    }

    /// Advances the drone by one step under motor commands m1…m4, each from 0 to the maximum.
    #[inline(always)]
    pub fn advance(&mut self, commands: &[f64; 4]) {
        let thrusts_n = self.thrusts_n(commands);
        // The ground effect changes slowly, and is therefore that of mid-step throughout the step.
        let floor_m = self.floor_m(self.row[0], self.row[1]);
        let middle_m = self.row[2] + self.row[5] * (0.5 * self.dt_s);
        let ground = self.floor.thrust_ratio(middle_m - floor_m);
        let mut loads = self.rotors.advance(&thrusts_n, ground);
        // The gust, the downwash and the battery's voltage are also constant during the step.
        if !self.wind.is_steady() {
            let gust = self.wind.advance();
            self.wind_m_s = gust.wind_m_s;
            loads.iter_mut().for_each(|load| load.torque_n_m += gust.torque_n_m);
        }
        if let Some(lost) = &self.lost {
            loads.iter_mut().for_each(|load| *load = load.less(lost));
        }
        if let Some(battery) = &mut self.battery {
            battery.drain(self.rotors.thrust_n(), self.dt_s);
        }
        // Contact is computed only if the drone begins or ends the step on the floor.
        let next = self.inertia.step(&self.row, &loads, &self.wind_m_s, self.dt_s);
        if self.row[2] <= floor_m || next[2] < self.floor_m(next[0], next[1]) {
            self.touch(next, &loads[2]);
        } else {
            self.row = next;
        }
    }

    /// Returns the pose and motion of the drone.
    #[inline(always)]
    pub fn body(&self) -> RigidBody {
        RigidBody::from_row(&self.row)
    }

    /// Returns the battery's voltage under load in V, and the energy that it has delivered in J.
    /// Returns `None` for a drone whose battery never sags.
    pub fn battery(&self) -> Option<(f64, f64)> {
        self.battery.as_ref().map(|battery| (battery.voltage_v, battery.energy_j))
    }

    /// Returns the number of steps so far in which the battery limited the thrust of a motor.
    pub fn short_steps(&self) -> u32 {
        self.short_steps
    }

    /// Returns an ideal accelerometer's reading in the body frame (forces except gravity per unit
    /// mass).
    #[inline(always)]
    pub fn specific_force_m_s2(&self) -> Vector3<f64> {
        let height_m = self.row[2] - self.floor_m(self.row[0], self.row[1]);
        let mut load = self.rotors.load(self.floor.thrust_ratio(height_m));
        if let Some(lost) = &self.lost {
            load = load.less(lost);
        }
        if self.rests(&load) {
            return Vector3::z() * GRAVITY_M_S2;
        }
        self.inertia.specific_force_m_s2(&self.body(), &load, &self.wind_m_s)
    }

    /// Returns the vertical acceleration in m/s² by full throttle at the present voltage, far from
    /// a floor.
    pub fn gain_m_s2(&self) -> f64 {
        let battery_gain = self.battery.as_ref().map_or(1.0, |b| b.limit(self.full_thrust_n).gain);
        N_MOTORS * self.full_thrust_n * battery_gain * GRAVITY_M_S2 / self.inertia.weight_n
    }

    /// Returns warnings about a battery that limited the thrust or was empty.
    pub fn warnings(&self) -> Vec<Diagnostic> {
        let short_s = f64::from(self.short_steps) * self.dt_s;
        let weak = (short_s > 0.0).then(|| warning::battery_weak(short_s));
        let is_empty = self.battery.as_ref().is_some_and(Battery::is_cut_off);
        weak.into_iter().chain(is_empty.then(warning::battery_empty)).collect()
    }

    /// Returns the thrust in N that each motor approaches under a command, within the battery's
    /// limits. Counts the step if the battery limits it.
    #[inline(always)]
    pub(crate) fn thrusts_n(&mut self, commands: &[f64; 4]) -> Vector4<f64> {
        let thrusts_n = Vector4::from(*commands) * self.thrust_per_command_n;
        let Some(battery) = &self.battery else {
            let full_n = thrusts_n.map(|thrust_n| thrust_n.min(self.full_thrust_n));
            return full_n.component_mul(&self.thrust_frac);
        };
        // With the firmware's compensation, a command represents a thrust. A motor below the
        // minimum idles, and if the voltage is too low for one motor, all four are lowered.
        let limit = battery.limit(self.full_thrust_n);
        let mut wanted_n =
            (thrusts_n * limit.gain).map(|n| if n < limit.least_n { limit.idle_n } else { n });
        if wanted_n.max() > limit.max_n {
            self.short_steps += 1;
            wanted_n = battery.lowered(&wanted_n, limit.max_n);
        }
        wanted_n.component_mul(&self.thrust_frac)
    }

    /// Returns the height of the floor at a position.
    #[inline(always)]
    pub fn floor_m(&self, x_m: f64, y_m: f64) -> f64 {
        self.steps.height_m(x_m, y_m)
    }

    /// Sets the state after a step with contact. A drone that rests on the floor stays there, a
    /// rising drone moves to `next`, and a descending drone stops on the floor. `load` is that at
    /// the end of the step.
    #[inline(never)]
    fn touch(&mut self, next: Row, load: &Load) {
        let rests = self.rests(load);
        if !rests {
            self.row = next;
        }
        let floor_m = self.floor_m(self.row[0], self.row[1]);
        if rests || next[2] < floor_m {
            self.row = self.body().on_floor(floor_m).row();
        }
    }

    /// True if the drone is on the floor and its rotors do not lift it.
    fn rests(&self, load: &Load) -> bool {
        let on_floor = self.row[2] <= self.floor_m(self.row[0], self.row[1]);
        on_floor && load.thrust_n <= self.inertia.weight_n
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SimOptions;
    use crate::vehicle::{FloorStep, GustOptions, Gusts, VehicleOptions};

    fn plant(options: &SimOptions, height_m: f64) -> Plant {
        Plant::new(options.plant(), 0.002, 3, 0, Vector3::new(0.3, 0.0, height_m))
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
        let start = drone.body();
        advance(&mut drone, 0.9 * hover(&options), 100);
        assert_eq!(drone.body(), start, "stays put");
        assert_eq!(drone.specific_force_m_s2(), Vector3::z() * GRAVITY_M_S2, "carried");
        advance(&mut drone, 1.2 * hover(&options), 100);
        assert!(drone.body().position_m.z > 0.01, "takes off");
        let mut falling = plant(&options, 0.1);
        falling.row[3] = 1.0;
        advance(&mut falling, 0.0, 200);
        let place = falling.body().position_m;
        assert_eq!(falling.body(), RigidBody::resting_at(Vector3::new(place.x, 0.0, 0.0)), "stops");
        assert!(place.x > 0.4, "flew on while it fell");
        let mut sinking = plant(&options, 1e-3);
        sinking.row[5] = -1.0;
        sinking.advance(&[1.1 * hover(&options); 4]);
        assert_eq!(sinking.body().position_m.z, 0.0, "no thrust lets it through");
    }

    #[test]
    fn a_table_carries_the_drone_and_drops_it_at_its_edge() {
        let mut options = SimOptions::default();
        let table = FloorStep { x_m: [0.0, 1.0], y_m: [-1.0, 1.0], height_m: 0.5 };
        options.floor.steps.push(table);
        let mut drone = plant(&options, 0.5);
        let start = drone.body();
        advance(&mut drone, 0.9 * hover(&options), 100);
        assert_eq!(drone.body(), start, "rests on the table");
        let mut falling = plant(&options, 0.8);
        advance(&mut falling, 0.0, 500);
        assert_eq!(falling.body().position_m, Vector3::new(0.3, 0.0, 0.5), "falls onto it");
        let mut leaving = plant(&options, 0.8);
        leaving.row[3] = 3.5;
        advance(&mut leaving, 0.0, 500);
        let place_m = leaving.body().position_m;
        assert!(place_m.z == 0.0 && place_m.x > 1.0, "flies over its edge: {place_m}");
    }

    #[test]
    fn an_accelerometer_feels_thrust_and_drag() {
        let vehicle = VehicleOptions { body_drag_n_s_m: [0.0351, 0.0, 0.0], ..Default::default() };
        let mut drone = plant(&SimOptions { vehicle, ..Default::default() }, 1.0);
        drone.row[3] = 2.0;
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
        let warnings = drone.warnings();
        assert!(warnings.iter().map(|it| it.code).eq(warning::BATTERY), "{warnings:?}");
    }

    #[test]
    fn thrust_beyond_the_battery_is_counted() {
        let mut options = SimOptions::cf21();
        options.battery.charge_frac = 0.3;
        options.battery.resistance_ohm = 0.3;
        options.battery.cut_off_v = 0.0;
        let mut drone = plant(&options, 1.0);
        advance(&mut drone, options.vehicle.motor_max, 100);
        let warnings = drone.warnings();
        assert!(warnings.iter().map(|it| it.code).eq(["battery-weak"]), "{warnings:?}");
    }

    #[test]
    fn a_motor_below_the_least_thrust_stands_still() {
        let mut options = SimOptions::cf21();
        options.battery.least_thrust_n = 0.0128;
        let mut drone = plant(&options, 1.0);
        let thrusts_n = [0.0127, 0.0129, 0.1, 0.0].map(|n| n / options.vehicle.k_f_n);
        let thrusts_n = drone.thrusts_n(&thrusts_n);
        assert!((thrusts_n - Vector4::new(0.0, 0.0129, 0.1, 0.0)).norm() < 1e-12, "{thrusts_n}");
    }

    #[test]
    fn the_same_seed_gives_the_same_bits() {
        let mut options = SimOptions::cf21();
        // Without a controller, the torque from the air in a room would flip the drone over.
        let gusts = GustOptions { torque_sigma_n_m: [1e-7; 3], ..GustOptions::default() };
        options.air.gusts = Gusts::OrnsteinUhlenbeck(gusts);
        let end = |seed| {
            let mut drone = Plant::new(options.plant(), 0.002, seed, 0, Vector3::z());
            advance(&mut drone, hover(&options), 500);
            drone.body()
        };
        assert_eq!(end(1), end(1));
        assert_ne!(end(1), end(2));
        // The position's bits were recorded in an earlier run. They are the same in debug and
        // release builds, and on every machine.
        let bits = end(1).position_m.map(f64::to_bits);
        assert_eq!(
            [bits.x, bits.y, bits.z],
            [13_809_910_240_826_039_975, 13_805_344_770_072_206_819, 4_607_130_987_054_665_022,]
        );
    }
}
