//! Facts about the Crazyflie's firmware, decks and files that several crates need. The file in
//! parentheses after each fact is its source in `crazyflie-firmware` at [`FIRMWARE_REVISION`].

mod release;

use nalgebra::Matrix4;

pub use release::{Feature, Release};

/// Modeled revision of `bitcraze/crazyflie-firmware`, one day newer than release 2026.08. Its C
/// code generated the numbers under `recorded/` (tests/firmware).
pub const FIRMWARE_REVISION: &str = "2a18fc29";

/// Rate of the onboard clock up to release 2026.08, in clock seconds per true second. Its timer
/// counts to 85 instead of 84 (`usec_time.c`).
pub const SLOW_CLOCK: f64 = 84.0 / 85.0;

/// Gravitational acceleration in m/s², rounded as in the firmware and by the AE483 team.
pub const GRAVITY_M_S2: f64 = 9.81;

/// Number of motors, each of which drives one rotor.
pub const N_MOTORS: f64 = 4.0;

/// Signs with which the motors (columns m1…m4) contribute to the torques about body x, y and z and
/// to the thrust (rows).
///
/// In the Crazyflie's X layout, seen from above with x forward and y left, m1 is front right, m2
/// back right, m3 back left and m4 front left (`power_distribution_quadrotor.c`). Rotors m1 and m3
/// turn counter-clockwise, m2 and m4 clockwise. The reaction torque of each rotor turns the body
/// the opposite way.
pub const MOTOR_SIGNS: Matrix4<f64> = Matrix4::new(
    -1.0, -1.0, 1.0, 1.0, //
    -1.0, 1.0, 1.0, -1.0, //
    -1.0, 1.0, -1.0, 1.0, //
    1.0, 1.0, 1.0, 1.0,
);

/// Period in s of the timer that updates the LED ring and the headlights (`ledring12.c`).
pub const RING_TICK_S: f64 = 0.05;

/// Period in s of the color LED deck's task (`color_led_deck.c`).
pub const COLOR_LED_TICK_S: f64 = 0.01;

/// Unit in s of a duration in the ring's timing memory (`LEDRING_TIME_MEM_SEC`, `ledring12.c`).
pub const RING_TIMING_S: f64 = 0.04;

/// Maximum duration of an entry in the ring's timing memory, in units of [`RING_TIMING_S`].
pub const MAX_RING_TIMING: u64 = u8::MAX as u64;

/// Number of entries in the ring's timing memory, not counting the one that ends the list
/// (`LEDRING_TIME_MEM_SIZE`).
pub const RING_TIMING_ENTRIES: usize = 9;

/// Size in bytes of the trajectory memory (`TRAJECTORY_MEMORY_SIZE`,
/// `crtp_commander_high_level.h`).
pub const TRAJECTORY_MEMORY_BYTES: usize = 4096;

/// Time in s without a setpoint from the host after which the firmware levels the drone
/// (`COMMANDER_WDT_TIMEOUT_STABILIZE`, `supervisorOverrideSetpoint` in `supervisor.c`, 2026.08).
pub const LEVEL_OUT_S: f64 = 0.5;
/// Time in s without a setpoint from the host after which the firmware stops the motors permanently
/// (`COMMANDER_WDT_TIMEOUT_SHUTDOWN`, as for [`LEVEL_OUT_S`]).
pub const MOTORS_STOP_S: f64 = 2.0;
