//! Four rotors: how their speeds follow the commands, and what they do to the body.

use super::options::VehicleOptions;
use crate::sim::mixer::SIGNS;
use crate::sim::wide::{Each, Real};

/// What the rotors do to the body at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Load<T> {
    /// Along body z.
    pub(super) thrust_n: T,
    /// About the centre of mass, without the gyroscopic part.
    pub(super) torque_n_m: [T; 3],
    /// Rotor drag per airspeed across the rotors' axes.
    pub(super) drag_n_s_m: T,
    /// Angular momentum of the rotors' spin along body z.
    pub(super) spin_n_m_s: T,
}

/// Rotor speeds and what is needed to move them on by one step.
#[derive(Clone, Debug)]
pub(super) struct Rotors<T> {
    speed_rad_s: [T; 4],
    rise: Lag<T>,
    fall: Lag<T>,
    thrust_n_s2: T,
    per_thrust: T,
    torque_per_thrust_m: T,
    lever_m: T,
    center_of_mass_m: [T; 2],
    drag_n_s2_m: T,
    inertia_kg_m2: T,
}

/// A first-order lag: what is left of a step after nothing, half a time step and a whole one.
#[derive(Clone, Copy, Debug)]
struct Lag<T> {
    left: [T; 3],
    per_s: T,
}

impl<T: Real> Lag<T> {
    fn new(
        each: &Each<'_, VehicleOptions, T>,
        time_constant_s: fn(&VehicleOptions) -> f64,
        dt_s: f64,
    ) -> Self {
        let left = |lag_s: f64| [0.0, 0.5, 1.0].map(|part| libm::exp(-part * dt_s / lag_s));
        let lags = |lag_s: f64| lag_s > 0.0;
        Self {
            left: each.figures(|options| {
                let lag_s = time_constant_s(options);
                if lags(lag_s) { left(lag_s) } else { [0.0; 3] }
            }),
            per_s: each.figure(|options| {
                let lag_s = time_constant_s(options);
                if lags(lag_s) { 1.0 / lag_s } else { 0.0 }
            }),
        }
    }
}

impl<T: Real> Rotors<T> {
    /// Rotors that each bear a thrust, N.
    pub(super) fn new(
        each: &Each<'_, VehicleOptions, T>,
        thrust_n: impl Fn(&VehicleOptions) -> f64,
        dt_s: f64,
    ) -> Self {
        Self {
            speed_rad_s: [each.figure(|o| (thrust_n(o) / o.rotor_thrust_n_s2).sqrt()); 4],
            rise: Lag::new(each, |o| o.motor_rise_s, dt_s),
            fall: Lag::new(each, |o| o.motor_fall_s, dt_s),
            thrust_n_s2: each.figure(|o| o.rotor_thrust_n_s2),
            per_thrust: each.figure(|o| 1.0 / o.rotor_thrust_n_s2),
            torque_per_thrust_m: each.figure(|o| o.k_m_n_m / o.k_f_n),
            lever_m: each.figure(|o| o.arm_m),
            center_of_mass_m: each.figures(|o| o.center_of_mass_m),
            drag_n_s2_m: each.figure(|o| o.rotor_drag_n_s2_m),
            inertia_kg_m2: each.figure(|o| o.rotor_inertia_kg_m2),
        }
    }

    /// Thrust of all four, out of ground effect.
    #[inline(always)]
    pub(super) fn thrust_n(&self) -> T {
        let [a, b, c, d] = self.speed_rad_s;
        self.thrust_n_s2 * (a * a + b * b + c * c + d * d)
    }

    /// What they do now; `ground` is the thrust ratio of the ground effect.
    #[inline(always)]
    pub(super) fn load(&self, ground: T) -> Load<T> {
        self.load_at(&self.speed_rad_s, &[ground.all(0.0); 4], ground)
    }

    /// Follows the thrusts asked for through one step: the loads at its start, middle and end.
    #[inline(always)]
    pub(super) fn advance(&mut self, wanted_n: &[T; 4], ground: T) -> [Load<T>; 3] {
        let start = self.speed_rad_s;
        let mut target = *wanted_n;
        for target in &mut target {
            *target = (*target * self.per_thrust).root();
        }
        let mut loads = [self.load(ground); 3];
        for (part, load) in loads.iter_mut().enumerate() {
            let (mut speed, mut change) = (start, start);
            for i in 0..4 {
                let left = start[i].pick(target[i], self.rise.left[part], self.fall.left[part]);
                let per_s = start[i].pick(target[i], self.rise.per_s, self.fall.per_s);
                let off = (start[i] - target[i]) * left;
                speed[i] = target[i] + off;
                change[i] = -off * per_s;
            }
            *load = self.load_at(&speed, &change, ground);
            self.speed_rad_s = speed;
        }
        loads
    }

    /// The load at some speeds (rad/s) that change at some rates (rad/s²).
    #[inline(always)]
    fn load_at(&self, speed: &[T; 4], change: &[T; 4], ground: T) -> Load<T> {
        let scale = self.thrust_n_s2 * ground;
        let zero = ground.all(0.0);
        let (mut thrust, mut roll, mut pitch, mut yaw) = (zero, zero, zero, zero);
        let (mut sum, mut spin, mut spin_up) = (zero, zero, zero);
        for i in 0..4 {
            let force = scale * speed[i] * speed[i];
            thrust = thrust + force;
            roll = roll + force * SIGNS[(0, i)];
            pitch = pitch + force * SIGNS[(1, i)];
            yaw = yaw + force * SIGNS[(2, i)];
            sum = sum + speed[i];
            // A rotor pushes the body against its own turning.
            spin = spin - speed[i] * SIGNS[(2, i)];
            spin_up = spin_up - change[i] * SIGNS[(2, i)];
        }
        let [x, y] = self.center_of_mass_m;
        Load {
            thrust_n: thrust,
            torque_n_m: [
                self.lever_m * roll - y * thrust,
                self.lever_m * pitch + x * thrust,
                self.torque_per_thrust_m * yaw - self.inertia_kg_m2 * spin_up,
            ],
            drag_n_s_m: self.drag_n_s2_m * sum,
            spin_n_m_s: self.inertia_kg_m2 * spin,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::mixer::Mixer;
    use crate::sim::vehicle::model::{Vehicle, Wrench};

    fn bearing(options: &VehicleOptions, thrust_n: f64, dt_s: f64) -> Rotors<f64> {
        Rotors::new(&Each::one(options), |_| thrust_n, dt_s)
    }

    fn lagging() -> VehicleOptions {
        VehicleOptions { motor_rise_s: 0.136, motor_fall_s: 0.106, ..Default::default() }
    }

    #[test]
    fn without_lag_the_load_is_the_mixers_wrench_about_the_centre_of_mass() {
        let options = VehicleOptions::default();
        let commands = [43490.0, 42753.0, 46860.0, 41332.0];
        let mut rotors = bearing(&options, 0.0, 0.002);
        let loads = rotors.advance(&commands.map(|c| c * options.k_f_n), 1.0);
        let motors = Mixer::new(&options).wrench(&commands.into());
        let want = Vehicle::new(&options).about_center_of_mass(&motors);
        for load in loads {
            let [x, y, z] = load.torque_n_m;
            let found = Wrench::new(x, y, z, load.thrust_n);
            assert!((found - want).norm() < 1e-15, "{found} against {want}");
        }
    }

    #[test]
    fn a_rotor_rises_and_falls_with_its_own_time_constants() {
        let (options, n) = (lagging(), 68);
        let (low, high) = (0.05, 0.1);
        let speed = |thrust: f64| (thrust / options.rotor_thrust_n_s2).sqrt();
        let mut rotors = bearing(&options, low, 0.002);
        for _ in 0..n {
            rotors.advance(&[high; 4], 1.0);
        }
        let risen = (rotors.speed_rad_s[0] - speed(low)) / (speed(high) - speed(low));
        assert!((risen - (1.0 - libm::exp(-1.0))).abs() < 1e-12, "63.2 % after 0.136 s: {risen}");
        let mut rotors = bearing(&options, high, 0.002);
        for _ in 0..53 {
            rotors.advance(&[low; 4], 1.0);
        }
        let fallen = (speed(high) - rotors.speed_rad_s[0]) / (speed(high) - speed(low));
        assert!((fallen - (1.0 - libm::exp(-1.0))).abs() < 1e-12, "63.2 % after 0.106 s: {fallen}");
    }

    #[test]
    fn loads_stand_at_the_start_the_middle_and_the_end_of_a_step() {
        let mut whole = bearing(&lagging(), 0.05, 0.02);
        let mut halves = bearing(&lagging(), 0.05, 0.01);
        let start = whole.load(1.0);
        let loads = whole.advance(&[0.1; 4], 1.0);
        halves.advance(&[0.1; 4], 1.0);
        assert!((loads[0].thrust_n - start.thrust_n).abs() < 1e-15, "start");
        assert!((loads[1].thrust_n - halves.load(1.0).thrust_n).abs() < 1e-15, "middle");
        halves.advance(&[0.1; 4], 1.0);
        assert!((loads[2].thrust_n - halves.load(1.0).thrust_n).abs() < 1e-15, "end");
    }

    #[test]
    fn a_rotor_that_speeds_up_turns_the_body_the_other_way() {
        let options = VehicleOptions { rotor_inertia_kg_m2: 2.7e-8, ..lagging() };
        let mut rotors = bearing(&options, 0.08, 0.002);
        // m1 turns counter-clockwise: the body is pushed clockwise, also by its speeding up.
        let load = rotors.advance(&[0.1, 0.08, 0.08, 0.08], 1.0)[0];
        let rise = ((0.1_f64 / options.rotor_thrust_n_s2).sqrt()
            - (0.08_f64 / options.rotor_thrust_n_s2).sqrt())
            / 0.136;
        assert!((load.torque_n_m[2] + 2.7e-8 * rise).abs() < 1e-15, "{}", load.torque_n_m[2]);
        assert!(load.spin_n_m_s.abs() < 1e-15, "four equal rotors cancel");
    }
}
