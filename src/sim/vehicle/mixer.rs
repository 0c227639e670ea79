//! Motor mixing, which converts a wrench to four commands and back.

use nalgebra::{Matrix4, Vector4};

use super::VehicleOptions;
use super::model::Wrench;
use noctograph_core::crazyflie::{MOTOR_SIGNS, N_MOTORS};

/// Linear motors between 0 and a maximum command.
#[derive(Clone, Debug)]
pub struct Mixer {
    wrench_from_motors: Matrix4<f64>,
    motors_from_wrench: Matrix4<f64>,
    motor_max: f64,
}

impl Mixer {
    /// Creates the mixer of a drone from its lever and from the force and torque per command.
    pub fn new(options: &VehicleOptions) -> Self {
        let (force, lever) = (options.k_f_n, options.k_f_n * options.arm_m);
        let scale = Vector4::new(lever, lever, options.k_m_n_m, force);
        // MOTOR_SIGNS has four orthogonal rows of length 2, so its inverse is its transpose / 4.
        Self {
            wrench_from_motors: Matrix4::from_diagonal(&scale) * MOTOR_SIGNS,
            motors_from_wrench: MOTOR_SIGNS.transpose()
                * Matrix4::from_diagonal(&scale.map(|s| 1.0 / (N_MOTORS * s))),
            motor_max: options.motor_max,
        }
    }

    /// Returns the matrix that converts a wrench to commands m1…m4.
    pub fn motors_from_wrench(&self) -> Matrix4<f64> {
        self.motors_from_wrench
    }

    /// Returns the commands m1…m4 for a wrench, clamped to the motors' range, and true if any of
    /// them was clamped.
    pub fn motors(&self, wrench: &Wrench) -> (Vector4<f64>, bool) {
        let wanted = self.unbounded_motors(wrench);
        let motors = wanted.map(|m| m.clamp(0.0, self.motor_max));
        (motors, motors != wanted)
    }

    /// Returns the commands m1…m4 for a wrench without the motors' limits.
    pub(crate) fn unbounded_motors(&self, wrench: &Wrench) -> Vector4<f64> {
        self.motors_from_wrench * wrench
    }

    /// Returns the firmware's commands m1…m4 for a wrench, and true if any of them was limited, as
    /// [`capped`] does (`powerDistributionForceTorque`, `power_distribution_quadrotor.c`). `most`
    /// is the maximum command.
    pub(crate) fn distributed(&self, wrench: &Wrench, most: f64) -> (Vector4<f64>, bool) {
        capped(&self.unbounded_motors(wrench), most)
    }

    /// Returns the firmware's commands m1…m4 for roll, pitch, yaw and thrust in the same unit, and
    /// true if any of them was limited, as [`capped`] does (`powerDistributionLegacy`). `most` is
    /// the maximum command.
    pub(crate) fn motors_from_commands(commands: &Vector4<f64>, most: f64) -> (Vector4<f64>, bool) {
        capped(&(MOTOR_SIGNS.transpose() * commands), most)
    }

    /// Returns the wrench of four commands, for instantaneous motors and a centered mass.
    pub(crate) fn wrench(&self, motors: &Vector4<f64>) -> Wrench {
        self.wrench_from_motors * motors
    }
}

/// Returns the wanted commands limited to zero and `most`, and true if any was changed.
///
/// If a motor would exceed `most`, all four are lowered by the excess, which gives attitude
/// priority over thrust (`powerDistributionCap`). With battery compensation, which limits the
/// thrust later, `most` is infinite (`stabilizer.c`, `controlMotors`).
fn capped(wanted: &Vector4<f64>, most: f64) -> (Vector4<f64>, bool) {
    let excess = (wanted.max() - most).max(0.0);
    let motors = wanted.map(|m| (m - excess).max(0.0));
    (motors, motors != *wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mixing_there_and_back_changes_nothing() {
        let mixer = Mixer::new(&VehicleOptions::default());
        let wrench = Wrench::new(1e-4, -2e-4, 3e-5, 0.34);
        let (motors, cut) = mixer.motors(&wrench);
        assert!(!cut, "within range");
        let error = (mixer.wrench(&motors) - wrench).component_div(&wrench);
        assert!(error.norm() < 1e-12, "relative error {error}");
    }

    #[test]
    fn mean_commands_of_the_real_flight_pay_for_its_disturbance() {
        let mean = Vector4::new(43490.0, 42753.0, 46860.0, 41332.0);
        let wrench = Mixer::new(&VehicleOptions::default()).wrench(&mean);
        assert!((wrench[0] - 1.3e-4).abs() < 5e-6, "τ_x {}", wrench[0]);
        assert!((wrench[1] - 3.3e-4).abs() < 5e-6, "τ_y {}", wrench[1]);
        assert!((wrench[3] - 0.340).abs() < 5e-4, "f_z {}", wrench[3]);
    }

    #[test]
    fn the_front_right_motor_rolls_left_pitches_up_and_yaws_clockwise() {
        let wrench = Mixer::new(&VehicleOptions::default()).wrench(&Vector4::x());
        assert!(wrench[0] < 0.0 && wrench[1] < 0.0 && wrench[2] < 0.0, "{wrench}");
        assert_eq!(wrench[3], 1.95e-6);
    }

    #[test]
    fn attitude_has_priority_and_before_the_battery_commands_are_only_cut_below() {
        let commands = Vector4::new(1000.0, 0.0, 0.0, 65_000.0);
        let lowered = Vector4::new(63_535.0, 63_535.0, 65_535.0, 65_535.0);
        assert_eq!(Mixer::motors_from_commands(&commands, 65_535.0), (lowered, true));
        let uncut = Vector4::new(64_000.0, 64_000.0, 66_000.0, 66_000.0);
        assert_eq!(Mixer::motors_from_commands(&commands, f64::INFINITY), (uncut, false));
        for most in [65_535.0, f64::INFINITY] {
            let weak = Mixer::motors_from_commands(&Vector4::new(0.0, 900.0, 0.0, 800.0), most);
            assert_eq!(weak, (Vector4::new(0.0, 1700.0, 1700.0, 0.0), true));
        }
    }

    #[test]
    fn a_wrench_beyond_the_motors_keeps_its_torque() {
        let options = VehicleOptions::default();
        let mixer = Mixer::new(&options);
        let wrench = Wrench::new(2e-4, -3e-4, 1e-4, 0.6);
        let (motors, cut) = mixer.distributed(&wrench, options.motor_max);
        let given = mixer.wrench(&motors);
        assert!(cut && (motors.max() - options.motor_max).abs() < 1e-9, "{motors}");
        assert!((given - wrench).xyz().norm() < 1e-15 && given[3] < 0.52, "{given}");
    }

    #[test]
    fn commands_are_cut_at_both_ends_and_reported() {
        let mixer = Mixer::new(&VehicleOptions::default());
        let (motors, cut) = mixer.motors(&Wrench::new(0.0, 0.0, 0.0, 1.0));
        assert_eq!((motors, cut), (Vector4::repeat(65_535.0), true));
        let (motors, cut) = mixer.motors(&Wrench::new(0.0, 0.0, 0.0, -1.0));
        assert_eq!((motors, cut), (Vector4::zeros(), true));
    }
}
