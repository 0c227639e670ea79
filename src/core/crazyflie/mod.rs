//! The Crazyflie: facts of its firmware, decks and files that more than one room needs, each once,
//! with its source: a file of `crazyflie-firmware`, in brackets, as of [`FIRMWARE_REVISION`].

mod release;

use nalgebra::Matrix4;

pub use release::{Feature, Release};

/// Revision of `bitcraze/crazyflie-firmware` that is modeled, one day after release 2026.08. Its
/// files are the sources named here, and its C gave the numbers under `recorded/` (tests/firmware).
pub const FIRMWARE_REVISION: &str = "2a18fc29";

/// Rate of the clock on board, in true seconds a second, up to and with release 2026.08
/// (`usec_time.c`: a timer that counts to 85 instead of 84).
pub const SLOW_CLOCK: f64 = 84.0 / 85.0;

/// Gravitational acceleration, m/s², as the firmware and the AE483 team round it.
pub const GRAVITY_M_S2: f64 = 9.81;

/// Signs of each motor (columns m1…m4) in torque about body x, y, z and in thrust.
///
/// Crazyflie X layout, seen from above with x forward and y left: m1 front right, m2 back right, m3
/// back left, m4 front left (`power_distribution_quadrotor.c`). m1 and m3 turn counter-clockwise,
/// m2 and m4 clockwise. Each pushes the body the other way.
pub const MOTOR_SIGNS: Matrix4<f64> = Matrix4::new(
    -1.0, -1.0, 1.0, 1.0, //
    -1.0, 1.0, 1.0, -1.0, //
    -1.0, 1.0, -1.0, 1.0, //
    1.0, 1.0, 1.0, 1.0,
);

/// Period of the timer that shows the LED ring and the headlights, s (`ledring12.c`).
pub const RING_TICK_S: f64 = 0.05;

/// Period of the task of the color LED deck, s (`color_led_deck.c`).
pub const COLOR_LED_TICK_S: f64 = 0.01;

/// Unit of a duration in the ring's timing memory, s (`LEDRING_TIME_MEM_SEC`, `ledring12.c`).
pub const RING_TIMING_S: f64 = 0.04;

/// Longest duration of an entry of that memory, in its unit.
pub const MAX_RING_TIMING: u64 = u8::MAX as u64;

/// Entries of that memory beside the one that ends the list (`LEDRING_TIME_MEM_SIZE`).
pub const RING_TIMING_ENTRIES: usize = 9;

/// Bytes of the trajectory memory (`TRAJECTORY_MEMORY_SIZE`, `crtp_commander_high_level.h`).
pub const TRAJECTORY_MEMORY_BYTES: usize = 4096;

/// Silence of the host after which the firmware levels the drone out, and stops its motors for
/// good, s (`COMMANDER_WDT_TIMEOUT_STABILIZE`, `COMMANDER_WDT_TIMEOUT_SHUTDOWN`,
/// `supervisorOverrideSetpoint` in `supervisor.c`, release 2026.08).
pub const LEVEL_OUT_S: f64 = 0.5;
/// See [`LEVEL_OUT_S`].
pub const MOTORS_STOP_S: f64 = 2.0;
