//! Tables of sources: the known variables of each quantity, in order of preference, with the
//! factors that convert them to SI units and standard frames. Among these conversions are those of
//! degrees, millimeters and the firmware's inverted pitch.
//!
//! Signs and units are taken from these files:
//!
//! - crazyflie-firmware: `stabilizer_types.h` and `stabilizer.c` (degrees with inverted pitch,
//!   compressed state in mm, mm/s and mrad/s), `kalman_core.c` (velocity in the body frame,
//!   quaternion `w x y z`), `quatcompress.h`, `controller_lee.c` (radians, no inverted sign),
//!   `controller_mellinger.c` and `controller_pid.c` (inverted pitch rate)
//! - AE483 course: `controller_ae483.c` (meters, radians, body frame)
//! - INAV: `navigation.h` (cm, north, east, up), `flight/imu.c` (0.1°, heading clockwise)

use super::PositionSource;
use noctograph_core::files::DEGREE as DEG;

use PositionSource::{Best, Custom, Estimate, Firmware, Lighthouse, Mocap};

/// Variables for one quantity: the kind of source, a pattern of their names, and factors to SI
/// units and standard signs. An empty list of factors means 1.
pub(super) struct Source(
    pub(super) PositionSource,
    pub(super) &'static str,
    pub(super) &'static [f64],
);

/// World position, m. Lighthouse is last, because its raw fixes are held between sweeps and drop
/// out. The estimators filter these fixes (they differ by 5 mm rms on the reference flight).
pub(super) const POSITION: &[Source] = &[
    Source(Mocap, "mocap.{x y z}", &[]),
    Source(Mocap, "ae483log.p_{x y z}_mocap", &[]),
    Source(Mocap, "locSrv.{x y z}", &[]),
    Source(Mocap, "locSrvZ.{x y z}", &[1e-3; 3]),
    Source(Best, "{x y z}_m", &[]),
    Source(Custom, "ae483log.o_{x y z}", &[]),
    Source(Custom, "ae483log.p_{x y z}", &[]),
    Source(Firmware, "stateEstimate.{x y z}", &[]),
    Source(Firmware, "stateEstimateZ.{x y z}", &[1e-3; 3]),
    Source(Firmware, "kalman.state{X Y Z}", &[]),
    Source(Firmware, "{x y z}_estimate_m", &[]),
    Source(Lighthouse, "lighthouse.{x y z}", &[]),
    Source(Lighthouse, "ae483log.lh_{x y z}", &[]),
    Source(Lighthouse, "estPosition.{x y z}", &[]),
    Source(Firmware, "navPos[{0 1 2}]", &[1e-2, -1e-2, 1e-2]),
];

/// Setpoint in the world frame, m.
pub(super) const DESIGN: &[Source] = &[
    Source(Custom, "ae483log.o_{x y z}_des", &[]),
    Source(Custom, "ae483log.p_{x y z}_des", &[]),
    Source(Firmware, "ctrltarget.{x y z}", &[]),
    Source(Firmware, "ctrltargetZ.{x y z}", &[1e-3; 3]),
    Source(Firmware, "posCtl.target{X Y Z}", &[]),
    Source(Best, "{x y z}_design_m", &[]),
];

/// Yaw, pitch and roll, rad. The firmware's pitch has the opposite sign.
pub(super) const ATTITUDE: &[Source] = &[
    Source(Mocap, "mocap.{yaw pitch roll}", &[]),
    Source(Mocap, "ae483log.{psi theta phi}_mocap", &[]),
    Source(Best, "{yaw pitch roll}_rad", &[]),
    Source(Custom, "ae483log.{psi theta phi}", &[]),
    Source(Firmware, "stateEstimate.{yaw pitch roll}", &[DEG, -DEG, DEG]),
    Source(Firmware, "stabilizer.{yaw pitch roll}", &[DEG, -DEG, DEG]),
    Source(Firmware, "ctrlLee.rpy{z y x}", &[]),
    Source(Firmware, "attitude[{2 1 0}]", &[-0.1 * DEG, 0.1 * DEG, 0.1 * DEG]),
];

/// Quaternions of the attitude in the order w x y z, for logs without angles.
pub(super) const QUATERNIONS: &[Source] = &[
    Source(Best, "q{w x y z}", &[]),
    Source(Firmware, "stateEstimate.q{w x y z}", &[]),
    Source(Firmware, "kalman.q{0 1 2 3}", &[]),
    Source(Mocap, "locSrv.q{w x y z}", &[]),
];

/// Attitude compressed to 32 bits, for logs without any other attitude.
pub(super) const COMPRESSED_QUATERNION: &str = "stateEstimateZ.quat";

/// Velocity in the body frame, m/s.
pub(super) const VELOCITY_BODY: &[Source] = &[
    Source(Best, "v{x y z}_body_m_s", &[]),
    Source(Custom, "ae483log.v_{x y z}", &[]),
    Source(Firmware, "kalman.stateP{X Y Z}", &[]),
];

/// Velocity in the world frame, m/s.
pub(super) const VELOCITY_WORLD: &[Source] = &[
    Source(Best, "v{x y z}_world_m_s", &[]),
    Source(Firmware, "stateEstimate.v{x y z}", &[]),
    Source(Firmware, "stateEstimateZ.v{x y z}", &[1e-3; 3]),
    Source(Firmware, "navVel[{0 1 2}]", &[1e-2, -1e-2, 1e-2]),
];

/// Angular velocity in the body frame, rad/s.
pub(super) const RATE: &[Source] = &[
    Source(Best, "w{x y z}_body_rad_s", &[]),
    Source(Custom, "ae483log.w_{x y z}", &[]),
    Source(Firmware, "gyro.{x y z}", &[DEG; 3]),
    Source(Firmware, "stateEstimateZ.rate{Roll Pitch Yaw}", &[1e-3, -1e-3, 1e-3]),
    Source(Firmware, "ctrlLee.omega{x y z}", &[]),
    Source(Firmware, "ctrlMel.r_{roll pitch yaw}", &[1.0, -1.0, 1.0]),
    Source(Firmware, "controller.r_{roll pitch yaw}", &[1.0, -1.0, 1.0]),
];

/// Motor commands, 0…65535.
pub(super) const MOTORS: &[Source] = &[
    Source(Firmware, "motor.m{1 2 3 4}", &[]),
    Source(Custom, "ae483log.m_{1 2 3 4}", &[]),
    Source(Firmware, "pwm.m{1 2 3 4}_pwm", &[]),
    Source(Firmware, "motor.m{1 2 3 4}req", &[]),
    Source(Best, "m{1 2 3 4}", &[]),
];

impl PositionSource {
    /// Returns the kinds of sources that this choice accepts, in order of preference.
    pub(super) fn kinds(self) -> &'static [Self] {
        match self {
            Best => ANY,
            Firmware => &[Best, Firmware],
            Estimate => &[Custom, Firmware],
            Mocap => &[Mocap],
            Custom => &[Custom],
            Lighthouse => &[Lighthouse],
        }
    }
}

/// All kinds of sources, in order of preference.
pub(super) const ANY: &[PositionSource] = &[Best, Mocap, Custom, Firmware, Lighthouse];
