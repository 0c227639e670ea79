//! Four rotors, whose speeds follow the commands and determine forces and torques.

use nalgebra::{Vector3, Vector4};

use super::VehicleOptions;
use noctograph_core::crazyflie::MOTOR_SIGNS;

/// Forces and torques of the rotors on the body at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Load {
    /// Thrust along body z in N.
    pub(super) thrust_n: f64,
    /// Torque about the center of mass in the body frame in N m, without the gyroscopic part.
    pub(super) torque_n_m: Vector3<f64>,
    /// Rotor drag per unit airspeed across the rotors' axes in N/(m/s).
    pub(super) drag_n_s_m: f64,
    /// Angular momentum of the rotors' spin along body z in N m s.
    pub(super) spin_n_m_s: f64,
}

impl Load {
    /// Returns the load minus the thrust and torque of another load. Drag and spin are unchanged.
    #[inline(always)]
    pub(super) fn less(&self, lost: &Self) -> Self {
        Self {
            thrust_n: self.thrust_n - lost.thrust_n,
            torque_n_m: self.torque_n_m - lost.torque_n_m,
            ..*self
        }
    }
}

/// Rotor speeds, with the constants that advance them by one step.
#[derive(Clone, Debug)]
pub(super) struct Rotors {
    speed_rad_s: Vector4<f64>,
    rise: Lag,
    fall: Lag,
    thrust_n_s2: f64,
    per_thrust: f64,
    torque_per_thrust_m: f64,
    lever_m: f64,
    center_of_mass_m: [f64; 2],
    drag_n_s2_m: f64,
    inertia_kg_m2: f64,
}

/// First-order lag, sampled at the start, the middle and the end of a step.
#[derive(Clone, Copy, Debug)]
struct Lag {
    /// Fractions of the initial difference that remain.
    remaining: [f64; 3],
    /// Inverse of the time constant in 1/s.
    per_s: f64,
}

impl Lag {
    /// Creates a lag with steps of `dt_s`. A time constant of 0 means no lag.
    fn new(time_constant_s: f64, dt_s: f64) -> Self {
        if time_constant_s > 0.0 {
            let remaining = [0.0, 0.5, 1.0].map(|step| libm::exp(-step * dt_s / time_constant_s));
            Self { remaining, per_s: 1.0 / time_constant_s }
        } else {
            Self { remaining: [0.0; 3], per_s: 0.0 }
        }
    }
}

impl Rotors {
    /// Creates rotors that each provide `thrust_n`, and are advanced in steps of `dt_s`.
    pub(super) fn new(options: &VehicleOptions, thrust_n: f64, dt_s: f64) -> Self {
        Self {
            speed_rad_s: Vector4::repeat((thrust_n / options.rotor_thrust_n_s2).sqrt()),
            rise: Lag::new(options.motor_rise_s, dt_s),
            fall: Lag::new(options.motor_fall_s, dt_s),
            thrust_n_s2: options.rotor_thrust_n_s2,
            per_thrust: 1.0 / options.rotor_thrust_n_s2,
            torque_per_thrust_m: options.k_m_n_m / options.k_f_n,
            lever_m: options.arm_m,
            center_of_mass_m: options.center_of_mass_m,
            drag_n_s2_m: options.rotor_drag_n_s2_m,
            inertia_kg_m2: options.rotor_inertia_kg_m2,
        }
    }

    /// Returns the total thrust of all four rotors in N, without ground effect.
    #[inline(always)]
    pub(super) fn thrust_n(&self) -> f64 {
        let [a, b, c, d] = self.speed_rad_s.into();
        self.thrust_n_s2 * (a * a + b * b + c * c + d * d)
    }

    /// Returns the load at the present speeds. `ground` is the thrust ratio of the ground effect.
    #[inline(always)]
    pub(super) fn load(&self, ground: f64) -> Load {
        self.load_at(&self.speed_rad_s, &Vector4::zeros(), ground)
    }

    /// Advances the speeds toward the commanded thrusts by one step. Returns the loads at the
    /// step's start, middle and end. `ground` is the ratio of thrust to that far from the floor.
    #[inline(always)]
    pub(super) fn advance(&mut self, command_n: &Vector4<f64>, ground: f64) -> [Load; 3] {
        // Each speed approaches its target exponentially, with different time constants up and
        // down.
        let start = self.speed_rad_s;
        let target = command_n.map(|thrust_n| (thrust_n * self.per_thrust).sqrt());
        let mut loads = [Load::default(); 3];
        for (sample, load) in loads.iter_mut().enumerate() {
            let (mut speed, mut change) = (start, start);
            for i in 0..4 {
                let lag = if start[i] < target[i] { &self.rise } else { &self.fall };
                let difference = (start[i] - target[i]) * lag.remaining[sample];
                speed[i] = target[i] + difference;
                change[i] = -difference * lag.per_s;
            }
            *load = self.load_at(&speed, &change, ground);
            self.speed_rad_s = speed;
        }
        loads
    }

    /// Returns the load at given speeds (rad/s) that change at given rates (rad/s²). `ground` is
    /// the ratio of thrust to that far from the floor.
    #[inline(always)]
    fn load_at(&self, speed: &Vector4<f64>, change: &Vector4<f64>, ground: f64) -> Load {
        let scale = self.thrust_n_s2 * ground;
        let [roll, pitch, yaw, thrust_n] =
            (MOTOR_SIGNS * speed.map(|speed| scale * speed * speed)).into();
        // The yaw signs are those of the torque on the body, which is opposite to the rotors' spin.
        let (spin, spin_up) = (-(MOTOR_SIGNS * speed).z, -(MOTOR_SIGNS * change).z);
        let [about_x, about_y] = self.horizontal_torque_n_m(roll, pitch, thrust_n);
        let about_z = self.torque_per_thrust_m * yaw - self.inertia_kg_m2 * spin_up;
        Load {
            thrust_n,
            torque_n_m: Vector3::new(about_x, about_y, about_z),
            drag_n_s_m: self.drag_n_s2_m * speed.sum(),
            spin_n_m_s: self.inertia_kg_m2 * spin,
        }
    }

    /// Returns the load to subtract when the rotors lose thrust at unchanged speeds. The torque
    /// about z depends only on the speeds, and is therefore not included.
    pub(super) fn lost_load(&self, lost_n: &Vector4<f64>) -> Load {
        let [roll, pitch, _, thrust_n] = (MOTOR_SIGNS * lost_n).into();
        let [about_x, about_y] = self.horizontal_torque_n_m(roll, pitch, thrust_n);
        let torque_n_m = Vector3::new(about_x, about_y, 0.0);
        Load { thrust_n, torque_n_m, ..Load::default() }
    }

    /// Returns the torque of the rotors' thrusts about body x and y, relative to the center of
    /// mass. `roll` and `pitch` are the sums of the thrusts with the signs of [`MOTOR_SIGNS`].
    #[inline(always)]
    fn horizontal_torque_n_m(&self, roll: f64, pitch: f64, thrust_n: f64) -> [f64; 2] {
        let [x, y] = self.center_of_mass_m;
        [self.lever_m * roll - y * thrust_n, self.lever_m * pitch + x * thrust_n]
    }
}

#[cfg(test)]
mod tests {
    use super::super::mixer::Mixer;
    use super::*;

    fn lagging() -> VehicleOptions {
        VehicleOptions { motor_rise_s: 0.136, motor_fall_s: 0.106, ..Default::default() }
    }

    #[test]
    fn without_lag_the_load_is_the_mixers_wrench_about_the_center_of_mass() {
        let options = VehicleOptions::default();
        let commands = Vector4::new(43490.0, 42753.0, 46860.0, 41332.0);
        let mut rotors = Rotors::new(&options, 0.0, 0.002);
        let loads = rotors.advance(&(commands * options.k_f_n), 1.0);
        let motors = Mixer::new(&options).wrench(&commands);
        let want = options.about_center_of_mass(&motors);
        for load in loads {
            let wrench = load.torque_n_m.push(load.thrust_n);
            assert!((wrench - want).norm() < 1e-15, "{wrench} against {want}");
        }
    }

    #[test]
    fn a_rotor_rises_and_falls_with_its_own_time_constants() {
        let (options, n) = (lagging(), 68);
        let (low, high) = (0.05, 0.1);
        let [slow, fast] = [low, high].map(|n: f64| (n / options.rotor_thrust_n_s2).sqrt());
        let mut rotors = Rotors::new(&options, low, 0.002);
        for _ in 0..n {
            rotors.advance(&Vector4::repeat(high), 1.0);
        }
        let risen = (rotors.speed_rad_s[0] - slow) / (fast - slow);
        assert!((risen - (1.0 - libm::exp(-1.0))).abs() < 1e-12, "63.2 % after 0.136 s: {risen}");
        let mut rotors = Rotors::new(&options, high, 0.002);
        for _ in 0..53 {
            rotors.advance(&Vector4::repeat(low), 1.0);
        }
        let fallen = (fast - rotors.speed_rad_s[0]) / (fast - slow);
        assert!((fallen - (1.0 - libm::exp(-1.0))).abs() < 1e-12, "63.2 % after 0.106 s: {fallen}");
    }

    #[test]
    fn loads_are_at_the_start_the_middle_and_the_end_of_a_step() {
        let mut full = Rotors::new(&lagging(), 0.05, 0.02);
        let mut halves = Rotors::new(&lagging(), 0.05, 0.01);
        let start = full.load(1.0);
        let loads = full.advance(&Vector4::repeat(0.1), 1.0);
        halves.advance(&Vector4::repeat(0.1), 1.0);
        assert!((loads[0].thrust_n - start.thrust_n).abs() < 1e-15, "start");
        assert!((loads[1].thrust_n - halves.load(1.0).thrust_n).abs() < 1e-15, "middle");
        halves.advance(&Vector4::repeat(0.1), 1.0);
        assert!((loads[2].thrust_n - halves.load(1.0).thrust_n).abs() < 1e-15, "end");
    }

    #[test]
    fn a_rotor_that_speeds_up_turns_the_body_the_other_way() {
        let options = VehicleOptions { rotor_inertia_kg_m2: 2.7e-8, ..lagging() };
        let mut rotors = Rotors::new(&options, 0.08, 0.002);
        // Rotor m1 turns counter-clockwise and the body clockwise, more so while m1 speeds up.
        let load = rotors.advance(&Vector4::new(0.1, 0.08, 0.08, 0.08), 1.0)[0];
        let rise = ((0.1_f64 / options.rotor_thrust_n_s2).sqrt()
            - (0.08_f64 / options.rotor_thrust_n_s2).sqrt())
            / 0.136;
        assert!((load.torque_n_m[2] + 2.7e-8 * rise).abs() < 1e-15, "{}", load.torque_n_m[2]);
        assert!(load.spin_n_m_s.abs() < 1e-15, "four equal rotors cancel");
    }
}
