//! The firmware's default controller, which is a cascade of PID loops on held position setpoints.
//!
//! Position and velocity loops (in world axes rotated by the yaw) set roll, pitch and thrust 100
//! times per second. Attitude and rate loops set the commands for the mixer 500 times per second.
//! Inside the cascade, angles are in degrees and commands in 1/65535 of a motor's range, as in the
//! firmware, so that the firmware's constants apply. Only the sign of the pitch is this program's.
//!
//! The source is bitcraze/crazyflie-firmware 2026.08, `platform_defaults_cf2.h` (`PID_*`),
//! `position_controller_pid.c`, `attitude_pid_controller.c`, `controller_pid.c` and `pid.c`. A test
//! compares the commands with those of its compiled C code. Derivatives are unfiltered, as on a
//! Crazyflie 2.x by default, because `ATTITUDE_RATE_LPF_ENABLE` is false for the body rate, and the
//! gains for position and velocity are 0.

use std::f64::consts::{PI, SQRT_2};

use nalgebra::{Vector3, Vector4};

use super::{Command, Controller, Reference};
use crate::options::SimOptions;
use crate::vehicle::{Mixer, State, attitude, position, rate, velocity};
use noctograph_core::crazyflie::Feature;

/// Maximum command of a motor in the firmware.
const FULL: f64 = 65_535.0;
/// Command per unit of the vertical velocity loop's output (`thrustScale`).
const THRUST_SCALE: f64 = 1000.0;
/// Minimum command in the air (`PID_VEL_THRUST_MIN`).
const THRUST_MIN: f64 = 20_000.0;
/// Maximum roll and pitch in degrees (`PID_VEL_ROLL_MAX`, `PID_VEL_PITCH_MAX`).
const TILT_MAX: f64 = 20.0;
/// Maximum desired speed for each axis in m/s (`PID_POS_VEL_X_MAX` …).
const SPEED_MAX: f64 = 1.0;
/// Maximum output of a loop relative to `TILT_MAX`, `SPEED_MAX` (`velMaxOverhead`,
/// `rpLimitOverhead`).
const OVERHEAD: f64 = 1.1;
/// Default bound of an integral (`DEFAULT_PID_INTEGRATION_LIMIT`).
const INTEGRAL_MAX: f64 = 5000.0;
/// Bounds of the integrals about roll, pitch and yaw (`PID_ROLL_INTEGRATION_LIMIT` and
/// `PID_ROLL_RATE_INTEGRATION_LIMIT` …).
const ATTITUDE_INTEGRAL_MAX: [f64; 3] = [20.0, 20.0, 360.0];
const RATE_INTEGRAL_MAX: [f64; 3] = [33.3, 33.3, 166.7];
/// Bound of a rate loop's output (`saturateSignedInt16`).
const COMMAND_MAX: f64 = 32_767.0;

/// Cutoff frequency in Hz of the filter for a rate's derivative
/// (`ATTITUDE_ROLL_RATE_LPF_CUTOFF_FREQ`). The firmware omits the filter on a Crazyflie 2.x, whose
/// motors lag. A drone with instantaneous motors needs the filter, because the derivative (1.6
/// times the change of the rate, every 2 ms) would flip it over.
const RATE_CUTOFF_HZ: f64 = 30.0;
/// Largest cutoff frequency relative to the sampling rate. At 0.5, the filter's coefficients would
/// be infinite.
const MAX_CUTOFF: f64 = 0.45;
/// Angle of a full turn in degrees.
const FULL_TURN: f64 = 360.0;

/// Second-order Butterworth low-pass filter, by the bilinear transform.
#[derive(Clone, Debug)]
struct LowPass {
    /// Gain of the newest and of the oldest input. The input between them has twice this gain.
    b: f64,
    /// Gains of the last two outputs, whose products are subtracted.
    a: [f64; 2],
    inputs: [f64; 2],
    outputs: [f64; 2],
}

impl LowPass {
    /// Creates a filter whose previous inputs and outputs are zero. The cutoff is limited to
    /// [`MAX_CUTOFF`] of the sampling rate.
    fn new(cutoff_hz: f64, rate_hz: u32) -> Self {
        let w = libm::tan(PI * (cutoff_hz / f64::from(rate_hz)).min(MAX_CUTOFF));
        let scale = 1.0 + SQRT_2 * w + w * w;
        let a = [2.0 * (w * w - 1.0) / scale, (1.0 - SQRT_2 * w + w * w) / scale];
        Self { b: w * w / scale, a, inputs: [0.0; 2], outputs: [0.0; 2] }
    }

    /// Returns the filtered value of an input, in the input's unit. Each call is one sampling
    /// period.
    fn update(&mut self, input: f64) -> f64 {
        let ([x1, x2], [y1, y2]) = (self.inputs, self.outputs);
        let output = self.b * (input + 2.0 * x1 + x2) - self.a[0] * y1 - self.a[1] * y2;
        (self.inputs, self.outputs) = ([input, x1], [output, y1]);
        output
    }
}

#[derive(Clone, Debug)]
struct Pid {
    /// Proportional, integral and derivative gains.
    gains: [f64; 3],
    integral_max: f64,
    output_max: f64,
    dt_s: f64,
    filter: Option<LowPass>,
    integral: f64,
    measured: f64,
}

impl Pid {
    /// Creates a loop at rest with the gains P, I and D. The output, in the unit of the desired
    /// value of the next inner loop, is bounded by `output_max`, and the integral of the error
    /// (unit · s) by `integral_max`.
    fn new(gains: [f64; 3], integral_max: f64, output_max: f64, rate_hz: u32) -> Self {
        let dt_s = 1.0 / f64::from(rate_hz);
        let (filter, integral, measured) = (None, 0.0, 0.0);
        Self { gains, integral_max, output_max, dt_s, filter, integral, measured }
    }

    /// Returns the output for an error and for the measurement from which the error was computed,
    /// both in the loop's unit. Each call is one period of the loop.
    fn update(&mut self, error: f64, measured: f64) -> f64 {
        // The derivative is that of the measurement, so a step of the setpoint causes no kick.
        let [kp, ki, kd] = self.gains;
        let rate = (measured - self.measured) / self.dt_s;
        let rate = self.filter.as_mut().map_or(rate, |filter| filter.update(rate));
        self.measured = measured;
        let integral = self.integral + error * self.dt_s;
        self.integral = integral.clamp(-self.integral_max, self.integral_max);
        let output = kp * error + ki * self.integral - kd * rate;
        output.clamp(-self.output_max, self.output_max)
    }

    /// Returns the integral, the last measurement and the filter, if the gains use them. These are
    /// the values by which a call affects the next ones.
    fn memory(&mut self) -> impl Iterator<Item = &mut f64> {
        let [_, ki, kd] = self.gains;
        let integral = (ki != 0.0).then_some(&mut self.integral);
        let measured = (kd != 0.0).then_some(&mut self.measured);
        let filter = self.filter.as_mut().filter(|_| kd != 0.0);
        let filtered = filter.map(|filter| filter.inputs.iter_mut().chain(&mut filter.outputs));
        integral.into_iter().chain(measured).chain(filtered.into_iter().flatten())
    }

    /// Resets the integral and the filter. The next derivative starts at `measured`.
    fn reset(&mut self, measured: f64) {
        (self.integral, self.measured) = (0.0, measured);
        if let Some(filter) = &mut self.filter {
            (filter.inputs, filter.outputs) = ([0.0; 2], [0.0; 2]);
        }
    }
}

/// Cascade with the state of its twelve loops, three each in the order x y z or roll pitch yaw.
#[derive(Clone, Debug)]
pub(super) struct PidCascade {
    position: [Pid; 3],
    velocity: [Pid; 3],
    attitude: [Pid; 3],
    rate: [Pid; 3],
    /// Maximum motor command, unless battery compensation imposes a lower limit.
    most: f64,
    /// Motor command per unit of the firmware's command.
    scale: f64,
    ticks_per_position: u32,
    ticks: u32,
    /// Desired roll and pitch in degrees.
    wanted: [f64; 2],
    thrust: f64,
    thrust_base: f64,
    /// True if the firmware resets all loops when the kind of setpoint changes.
    resets: bool,
}

impl PidCascade {
    /// Creates the cascade with the firmware's bounds, and with all loops at rest.
    pub(super) fn new(options: &SimOptions) -> Self {
        let (slow_hz, fast_hz) = (options.rates.position_hz(), options.rates.attitude_hz());
        let vehicle = &options.vehicle;
        let [position, velocity, attitude, rate] = options.controller.pid.gains();
        // The bounds of integrals and outputs are in the order x y z or roll pitch yaw.
        let (speed_max, tilt_max) = (SPEED_MAX * OVERHEAD, TILT_MAX * OVERHEAD);
        let velocity_max = [tilt_max, tilt_max, FULL / 2.0 / THRUST_SCALE];
        let mut rate = loops(rate, RATE_INTEGRAL_MAX, [COMMAND_MAX; 3], fast_hz);
        // With instantaneous motors, the derivatives of the roll and pitch rates require a filter.
        if vehicle.motor_rise_s == 0.0 || vehicle.motor_fall_s == 0.0 {
            let filter = LowPass::new(RATE_CUTOFF_HZ, fast_hz);
            rate[..2].iter_mut().for_each(|tilt| tilt.filter = Some(filter.clone()));
        }
        Self {
            position: loops(position, [INTEGRAL_MAX; 3], [speed_max; 3], slow_hz),
            velocity: loops(velocity, [INTEGRAL_MAX; 3], velocity_max, slow_hz),
            attitude: loops(attitude, ATTITUDE_INTEGRAL_MAX, [f64::INFINITY; 3], fast_hz),
            rate,
            most: options.most_command(),
            scale: vehicle.motor_max / FULL,
            ticks_per_position: fast_hz / slow_hz,
            ticks: 0,
            wanted: [0.0; 2],
            thrust: 0.0,
            thrust_base: options.controller.pid.thrust_base,
            resets: vehicle.firmware.has(&Feature::RESET),
        }
    }

    /// Resets integrals and derivatives, as `controllerPidReinitialize` does, and holds the
    /// estimated roll and pitch until the position loops run again.
    fn reset(&mut self, estimate: &State) {
        let (position_m, angles) = (position(estimate), angles(estimate));
        for i in 0..3 {
            self.position[i].reset(position_m[i]);
            self.velocity[i].reset(0.0);
            self.attitude[i].reset(angles[i]);
            self.rate[i].reset(0.0);
        }
        self.wanted = [angles[0], angles[1]];
    }

    /// Runs the position and velocity loops, which set the desired roll, pitch and thrust.
    /// `setpoint_m` is in the world frame.
    fn run_position_loops(&mut self, estimate: &State, setpoint_m: Vector3<f64>) {
        // Setpoint, position and velocity are rotated to axes along the nose, to the left, and up.
        let attitude = attitude(estimate);
        let (sin, cos) = libm::sincos(attitude.yaw_rad);
        let velocity_m_s = attitude.world_from_body() * velocity(estimate);
        let [setpoint_m, position_m, velocity_m_s] = [setpoint_m, position(estimate), velocity_m_s]
            .map(|v| [v.x * cos + v.y * sin, -v.x * sin + v.y * cos, v.z]);
        let mut out = [0.0; 3];
        for i in 0..3 {
            let wanted = self.position[i].update(setpoint_m[i] - position_m[i], position_m[i]);
            out[i] = self.velocity[i].update(wanted - velocity_m_s[i], velocity_m_s[i]);
        }
        // Forward motion requires positive pitch (nose down), and motion to the left negative roll.
        let [ahead, left, up] = out;
        self.wanted = [-left, ahead].map(|angle| angle.clamp(-TILT_MAX, TILT_MAX));
        self.thrust = (up * THRUST_SCALE + self.thrust_base).clamp(THRUST_MIN, FULL);
    }

    /// Runs the attitude and rate loops with a desired yaw of 0. Returns the commands of roll,
    /// pitch and yaw in 1/65535 of a motor's range.
    fn run_attitude_loops(&mut self, estimate: &State) -> [f64; 3] {
        let angles = angles(estimate);
        let rates = rate(estimate).map(f64::to_degrees);
        let wanted = [self.wanted[0], self.wanted[1], 0.0];
        std::array::from_fn(|i| {
            // The shorter rotation is used, which matters only for the yaw.
            let difference = wanted[i] - angles[i];
            let error = difference - FULL_TURN * (difference / FULL_TURN).round();
            let wanted_rate = self.attitude[i].update(error, angles[i]);
            self.rate[i].update(wanted_rate - rates[i], rates[i])
        })
    }
}

impl Controller for PidCascade {
    /// Runs the position loops when they are due, followed by the attitude loops and the mixer.
    fn command(&mut self, estimate: &State, reference: &Reference) -> Command {
        if self.ticks.is_multiple_of(self.ticks_per_position) {
            self.run_position_loops(estimate, reference.held_m);
        }
        self.ticks += 1;
        let [roll, pitch, yaw] = self.run_attitude_loops(estimate);
        // The firmware halves roll and pitch (`powerDistributionLegacy`).
        let commands = Vector4::new(roll / 2.0, pitch / 2.0, yaw, self.thrust) * self.scale;
        let (motors, saturated) = Mixer::motors_from_commands(&commands, self.most);
        Command { motors, saturated }
    }

    fn rest(&mut self, estimate: &State) {
        self.reset(estimate);
        self.ticks = 0;
    }

    /// Resets all loops if the firmware does so. Firmware without [`Feature::RESET`] keeps its
    /// integrals.
    fn change_mode(&mut self, estimate: &State) {
        if self.resets {
            self.reset(estimate);
        }
    }

    fn memory(&mut self) -> Vec<&mut f64> {
        let loops = [&mut self.position, &mut self.velocity, &mut self.attitude, &mut self.rate];
        loops.into_iter().flatten().flat_map(Pid::memory).collect()
    }
}

/// Creates the loops of three axes (x y z, or roll pitch yaw) that run at `rate_hz`, from the gains
/// P, I, D of each axis and from the bounds of their integrals and outputs.
fn loops(
    gains: [[f64; 3]; 3],
    integral_max: [f64; 3],
    output_max: [f64; 3],
    rate_hz: u32,
) -> [Pid; 3] {
    std::array::from_fn(|i| Pid::new(gains[i], integral_max[i], output_max[i], rate_hz))
}

/// Returns roll, pitch and yaw in degrees.
fn angles(state: &State) -> [f64; 3] {
    let attitude = attitude(state);
    [attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad].map(f64::to_degrees)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::at_rest;
    use noctograph_core::crazyflie::Release;

    fn asked(estimate: &State, held_m: Vector3<f64>) -> (PidCascade, Vector4<f64>) {
        let mut cascade = PidCascade::new(&SimOptions::default());
        cascade.rest(estimate);
        let motors = cascade.command(estimate, &Reference::holding(held_m)).motors;
        (cascade, motors)
    }

    #[test]
    fn a_drone_in_place_is_given_the_firmwares_base_thrust() {
        let place = Vector3::new(0.3, 0.1, 0.8);
        assert_eq!(asked(&at_rest(place, 0.0), place).1, Vector4::repeat(36_000.0));
        let brushless = PidCascade::new(&SimOptions::cf_brushless());
        assert_eq!(brushless.thrust_base, 30_000.0, "platform_defaults_cf21bl.h");
        assert_eq!(brushless.rate[1].gains, [200.0, 400.0, 2.5], "platform_defaults_cf21bl.h");
    }

    #[test]
    fn a_setpoint_ahead_tips_the_nose_down_and_one_to_the_left_rolls_left() {
        // The desired pitch is 0.1 m × 2 /s × (25 + 1 × 10 ms) °/(m/s).
        let (cascade, motors) = asked(&State::zeros(), Vector3::new(0.1, 0.0, 0.0));
        assert!((cascade.wanted[1] - 5.002).abs() < 1e-12, "pitch {}", cascade.wanted[1]);
        assert!(motors[1] > motors[0] && motors[2] > motors[3], "the rear lifts: {motors}");
        let (cascade, motors) = asked(&State::zeros(), Vector3::new(0.0, 0.1, 0.0));
        assert!((cascade.wanted[0] + 5.002).abs() < 1e-12, "roll {}", cascade.wanted[0]);
        assert!(motors[0] > motors[3] && motors[1] > motors[2], "the right lifts: {motors}");
        let turned = at_rest(Vector3::zeros(), std::f64::consts::FRAC_PI_2);
        let (cascade, _) = asked(&turned, Vector3::new(0.0, 0.1, 0.0));
        assert!((cascade.wanted[1] - 5.002).abs() < 1e-12, "ahead of a drone that looks along y");
    }

    #[test]
    fn commands_are_those_of_the_firmwares_own_code() {
        let recorded = include_str!("recorded/pid.txt");
        let mut rows = recorded.lines().filter(|line| !line.starts_with('#'));
        let mut cascade = PidCascade::new(&SimOptions::cf21());
        let mut worst = [0.0_f64; 4];
        for k in 0..2000_u32 {
            let (t, grows) = (0.002 * f64::from(k), if k < 1000 { 1.0 } else { 4.0 });
            let sin = |amplitude: f64, w: f64| amplitude * libm::sin(w * t);
            let held_m = Vector3::new(sin(0.3, 1.3), sin(0.2, 0.9), 0.8 + sin(0.1, 0.7));
            let off_m = Vector3::new(sin(0.03, 3.1), sin(-0.02, 2.3), sin(0.02, 1.9)) * grows;
            let moving = Vector3::new(sin(0.2, 2.9), sin(0.15, 3.7), sin(0.1, 2.2)) * grows;
            let attitude = noctograph_core::geometry::Attitude {
                yaw_rad: sin(0.3, 1.1),
                pitch_rad: sin(0.05, 5.3) * grows,
                roll_rad: sin(0.06, 4.7) * grows,
            };
            let mut state = at_rest(held_m + off_m, attitude.yaw_rad);
            (state[4], state[5]) = (attitude.pitch_rad, attitude.roll_rad);
            let in_body = attitude.world_from_body().tr_mul(&moving);
            state.fixed_rows_mut::<3>(6).copy_from(&in_body);
            let rate = Vector3::new(sin(0.5, 11.0), sin(0.4, 13.0), sin(0.2, 7.0)) * grows;
            state.fixed_rows_mut::<3>(9).copy_from(&rate);
            if k == 0 {
                cascade.rest(&state);
            }
            if k.is_multiple_of(5) {
                cascade.run_position_loops(&state, held_m);
            }
            let [roll, pitch, yaw] = cascade.run_attitude_loops(&state);
            if k % 5 == 4 {
                let row: Vec<f64> =
                    rows.next().unwrap().split(' ').map(|value| value.parse().unwrap()).collect();
                assert_eq!(row[0], f64::from(k));
                let command = [roll, pitch, yaw, cascade.thrust];
                for (i, worst) in worst.iter_mut().enumerate() {
                    *worst = worst.max((command[i] - row[i + 1]).abs());
                }
            }
        }
        println!("roll, pitch, yaw and thrust off by {worst:?}");
        assert!(worst[..3].iter().all(|worst| *worst < 1.2), "of 32,767: {worst:?}");
        assert!(worst[3] < 0.1, "thrust {} of 65,535", worst[3]);
    }

    #[test]
    fn another_kind_of_setpoint_empties_the_integrals_since_release_2026_08() {
        let place = Vector3::new(0.3, 0.1, 0.8);
        for (release, keeps) in [(Release::R2026_04, true), (Release::R2026_08, false)] {
            let mut options = SimOptions::cf21();
            options.vehicle.firmware = release;
            let mut cascade = PidCascade::new(&options);
            cascade.rest(&at_rest(place, 0.0));
            (0..50).for_each(|_| {
                cascade.run_position_loops(&at_rest(place, 0.0), place + Vector3::z() * 0.1)
            });
            cascade.change_mode(&at_rest(place, 0.0));
            assert_eq!(cascade.velocity[2].integral != 0.0, keeps, "{release:?}");
        }
    }

    #[test]
    fn the_filter_passes_what_is_slow_and_halves_the_power_at_its_cut_off() {
        let [slow, cut_off, fast] = [1.0, 30.0, 200.0].map(|frequency_hz| {
            let mut filter = LowPass::new(30.0, 500);
            let w = 2.0 * PI * frequency_hz / 500.0;
            let out = (0..1000).map(|i| filter.update(libm::sin(w * f64::from(i))));
            out.skip(500).fold(0.0_f64, f64::max)
        });
        assert!((slow - 1.0).abs() < 1e-3, "{slow}");
        assert!((cut_off - 0.5_f64.sqrt()).abs() < 1e-2, "{cut_off}");
        assert!(fast < 0.01, "{fast}");
    }

    #[test]
    fn speed_tilt_and_integrals_are_bounded() {
        let (cascade, _) = asked(&State::zeros(), Vector3::new(9.0, -9.0, 9.0));
        assert_eq!(cascade.wanted, [20.0, 20.0]);
        assert_eq!(cascade.thrust, 36_000.0 + 1000.0 * 1.1 * (25.0 + 0.15));
        let mut pid = Pid::new([0.0, 1.0, 0.0], 2.0, 1.5, 100);
        (0..1000).for_each(|_| assert!(pid.update(1.0, 0.0) <= 1.5, "bounded"));
        assert_eq!(pid.integral, 2.0);
    }
}
