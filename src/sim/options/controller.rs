//! Settings of the controller.

use noctograph_core::error::{Error, Result};
use noctograph_core::settings::settings;

settings! {
    /// The controller. The weights of one that does not fly are kept, for the design of gains and
    /// for a change of the kind.
    pub struct ControllerOptions {
        /// Kind of controller.
        kind: ControllerKind = ControllerKind::Lqr;
        /// Linear-quadratic regulators.
        lqr: LqrOptions = LqrOptions::default(),
            for "controller.kind" = "lqr" | "lqr-feedforward" | "lqr-integral" | "altitude";
        /// The geometric controller.
        geometric: GeometricOptions = GeometricOptions::default(),
            for "controller.kind" = "geometric";
        /// Altitude hold.
        altitude: AltitudeHoldOptions = AltitudeHoldOptions::default(),
            for "controller.kind" = "altitude";
        /// The firmware's cascade of PID loops.
        pid: PidOptions = PidOptions::default(), for "controller.kind" = "pid";
        /// Setpoints that the host sends while the drone writes (`--mode` of the exported script).
        setpoints: SetpointKind = SetpointKind::Position, for "controller.kind" = "pid";
    }

    /// A kind of setpoint, as the firmware tells them apart.
    pub enum SetpointKind {
        /// Positions. The firmware's own landing is of the same kind.
        "position" => Position,
        /// Positions, velocities and accelerations, of which the cascade only uses the positions.
        /// The landing is of another kind: since release 2026.08 all loops reset at it, and the
        /// drone drops by 12 to 18 cm.
        "full-state" => FullState,
    }

    /// A controller.
    pub enum ControllerKind {
        /// The reference team's linear-quadratic regulator, on held position setpoints.
        "lqr" => Lqr,
        /// The same gain about the moving design: velocity and acceleration fed forward.
        "lqr-feedforward" => LqrFeedforward,
        /// Regulator with the integral of the position error, about the moving design.
        "lqr-integral" => LqrIntegral,
        /// The firmware's default cascade of PID loops, on held position setpoints.
        "pid" => Pid,
        /// Geometric tracking on SE(3) (Lee, Leok, `McClamroch` 2010) on full states, as in the
        /// firmware.
        "geometric" => Geometric,
        /// Altitude by the estimated thrust map, all else as lqr-feedforward.
        "altitude" => Altitude,
    }

    /// Linear-quadratic regulators: cost `∫ sᵀQs + iᵀRi dt` about the setpoint, Q and R diagonal.
    ///
    /// Default: the team's weights, from Bryson's rule and then by hand, and integrals that remove
    /// a steady error in about two seconds.
    pub struct LqrOptions {
        /// Gain K in `u = u_ref − K (x̂ − x_ref)`, for example from SciPy, in place of the one
        /// designed from the weights.
        ///
        /// Rows: torque x y z (N m) and thrust (N). Columns: the twelve states in the order of `q`,
        /// and for lqr-integral the integrals of the position error x y z (m s). With lagging
        /// motors, four more may follow, as `noctograph gains` prints them: the torques and the
        /// thrust of the modeled rotors.
        k: Option<Vec<Vec<f64>>> = None, in -1e6..=1e6;
        /// Weights of position x y z (1/m²), yaw pitch roll (1/rad²), body velocity x y z (s²/m²)
        /// and body rate x y z (s²/rad²). Larger weights hold tighter and move the motors more.
        q: [f64; 12] =
            [120.0, 80.0, 75.0, 40.0, 0.01, 0.01, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0], in 0.0..=1e12,
            unless "controller.lqr.k";
        /// Weights of torque x y z (1/(N m)²) and thrust (1/N²). Larger weights spare the motors.
        r: [f64; 4] = [5_045_605.0, 5_045_605.0, 38_586_096.0, 566.0], in 1e-6..=1e12,
            unless "controller.lqr.k";
        /// Weights of the integral of the position error x y z (1/(m s)²), for lqr-integral.
        ///
        /// More removes a standing error sooner, and swings further past a corner.
        q_integral: [f64; 3] = [20.0; 3], in 0.0..=1e12, for "controller.kind" = "lqr-integral",
            unless "controller.lqr.k";
        /// Model of the motors in the design of the gain.
        motor_lag: MotorLag = MotorLag::Modeled, unless "controller.lqr.k";
    }

    /// Model of the motors in the design of a regulator's gain.
    pub enum MotorLag {
        /// The vehicle's lag: the gain is designed for it, and feeds back the modeled rotors.
        ///
        /// Without a lag in the vehicle, as [`Self::Ignored`].
        "modeled" => Modeled,
        /// Immediate motors, as the reference team's design.
        "ignored" => Ignored,
    }

    /// Altitude hold: the regulator of a double integrator, with weights by Bryson's rule.
    pub struct AltitudeHoldOptions {
        /// Error of the altitude that weighs as much as the other two.
        error_m: f64 = 0.2, in 0.001..=100.0;
        /// Vertical acceleration.
        acceleration_m_s2: f64 = 1.6, in 0.001..=100.0;
    }

    /// The firmware's cascade of PID loops: each gain P, I, D in the firmware's units, under the
    /// name of its constants (`PID_POS_X_KP` …).
    ///
    /// Default: crazyflie-firmware `platform_defaults_cf2.h`, commit 0555cb1.
    pub struct PidOptions {
        /// Position along x: m/s per m (parameters `posCtlPid.xKp`, `xKi`, `xKd`).
        pos_x: [f64; 3] = [2.0, 0.0, 0.0], in 0.0..=1e5;
        /// Position along y.
        pos_y: [f64; 3] = [2.0, 0.0, 0.0], in 0.0..=1e5;
        /// Position along z.
        pos_z: [f64; 3] = [2.0, 0.5, 0.0], in 0.0..=1e5;
        /// Velocity along x: degrees of pitch per m/s (`velCtlPid.vxKp` …).
        vel_x: [f64; 3] = [25.0, 1.0, 0.0], in 0.0..=1e5;
        /// Velocity along y: degrees of roll per m/s.
        vel_y: [f64; 3] = [25.0, 1.0, 0.0], in 0.0..=1e5;
        /// Velocity along z: thousands of a command of 65535 per m/s.
        vel_z: [f64; 3] = [25.0, 15.0, 0.0], in 0.0..=1e5;
        /// Roll: °/s per degree (`pid_attitude.roll_kp` …).
        roll: [f64; 3] = [6.0, 3.0, 0.0], in 0.0..=1e5;
        /// Pitch.
        pitch: [f64; 3] = [6.0, 3.0, 0.0], in 0.0..=1e5;
        /// Yaw.
        yaw: [f64; 3] = [6.0, 1.0, 0.35], in 0.0..=1e5;
        /// Roll rate: a command of 65535 per °/s (`pid_rate.roll_kp` …).
        roll_rate: [f64; 3] = [250.0, 500.0, 2.5], in 0.0..=1e5;
        /// Pitch rate.
        pitch_rate: [f64; 3] = [250.0, 500.0, 2.5], in 0.0..=1e5;
        /// Yaw rate.
        yaw_rate: [f64; 3] = [120.0, 16.7, 0.0], in 0.0..=1e5;
        /// Assumed hover command, of 65535 (`PID_VEL_THRUST_BASE`).
        ///
        /// The loops' integrals make up for the rest, which is why a heavy drone leaves the floor
        /// late.
        thrust_base: f64 = 36_000.0, in 0.0..=65_535.0;
    }

    /// Geometric controller.
    ///
    /// Default: gains that are those of the team's regulator for small angles (its gains over the
    /// inertia, and over that of the pitch times gravity), with integrals slow beside them. The
    /// firmware's own (`controller_lee.c`, releases 2024.10 to 2026.08: 7, 4, 0, over Förster's
    /// inertia 422, 69, 1810) tolerate more motor lag.
    pub struct GeometricOptions {
        /// Acceleration per position error, 1/s².
        k_position: f64 = 9.8, in 0.0..=1e4;
        /// Acceleration per velocity error, 1/s.
        k_velocity: f64 = 4.5, in 0.0..=1e4;
        /// Acceleration per integral of the position error, 1/s³.
        k_position_integral: f64 = 2.0, in 0.0..=1e4;
        /// Angular acceleration per attitude error about body x y z, 1/s².
        k_attitude: [f64; 3] = [366.0, 384.0, 30.7], in 0.0..=1e6;
        /// Angular acceleration per error of the body rate x y z, 1/s.
        k_rate: [f64; 3] = [45.0, 44.7, 9.2], in 0.0..=1e6;
        /// Angular acceleration per integral of the attitude error, 1/s³.
        k_attitude_integral: [f64; 3] = [300.0, 300.0, 30.0], in 0.0..=1e6;
    }
}

impl ControllerOptions {
    /// Checks that a given gain has a row for each input and a column for each state. Columns for
    /// lagging rotors may follow.
    pub(super) fn check_gain(&self, rotors_lag: bool) -> Result<()> {
        let (Some(k), kind) = (&self.lqr.k, self.kind) else { return Ok(()) };
        let n_states = if kind.integrates() { 15 } else { 12 };
        let lengths: Vec<usize> = k.iter().map(Vec::len).collect();
        if lengths == [n_states; 4] || rotors_lag && lengths == [n_states + 4; 4] {
            return Ok(());
        }
        let n_columns = lengths.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
        let given = format!("{} rows of {n_columns} numbers", k.len());
        let more = if rotors_lag { ", or 4 more for the rotors" } else { "" };
        let wanted = format!("4 rows of {n_states} numbers for {}{more}", kind.name());
        let hint = "rows are torque x y z and thrust, columns the states in the order of lqr.q";
        Err(Error::input("controller.lqr.k", given, wanted, hint))
    }

    /// The kind of setpoint that the host sends while the drone writes, and that checks fly with.
    pub fn sends(&self) -> SetpointKind {
        match self.kind {
            ControllerKind::Pid => self.setpoints,
            kind if kind.follows_reference() => SetpointKind::FullState,
            _ => SetpointKind::Position,
        }
    }
}

impl PidOptions {
    /// The gains P, I, D of all loops: position, velocity, attitude and rate, each of three axes.
    pub fn gains(&self) -> [[[f64; 3]; 3]; 4] {
        [
            [self.pos_x, self.pos_y, self.pos_z],
            [self.vel_x, self.vel_y, self.vel_z],
            [self.roll, self.pitch, self.yaw],
            [self.roll_rate, self.pitch_rate, self.yaw_rate],
        ]
    }
}

/// Control law of a controller, for analysis, tuning and exports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// A gain matrix, designed by weights or given (`controller.lqr`).
    StateFeedback {
        /// True if it integrates the position error.
        integrates: bool,
        /// True if its thrust follows an estimated map instead.
        by_thrust_map: bool,
    },
    /// The firmware's cascade of PID loops.
    Cascade,
    /// The firmware's geometric controller.
    Geometric,
    /// Another one, which the firmware lacks.
    Own,
}

impl ControllerKind {
    /// The control law of this kind.
    pub fn law(self) -> Law {
        let (integrates, by_thrust_map) = (self == Self::LqrIntegral, self == Self::Altitude);
        match self {
            Self::Lqr | Self::LqrFeedforward | Self::LqrIntegral | Self::Altitude => {
                Law::StateFeedback { integrates, by_thrust_map }
            }
            Self::Pid => Law::Cascade,
            Self::Geometric => Law::Geometric,
        }
    }

    /// True if a gain matrix feeds back the integral of the position error.
    pub(crate) fn integrates(self) -> bool {
        self.law() == Law::StateFeedback { integrates: true, by_thrust_map: false }
    }

    /// Scene keys of the gains and weights, for messages.
    pub fn keys(self) -> &'static str {
        match self {
            Self::Lqr | Self::LqrFeedforward | Self::LqrIntegral => "controller.lqr",
            Self::Pid => "controller.pid",
            Self::Geometric => "controller.geometric",
            Self::Altitude => "controller.lqr and controller.altitude",
        }
    }

    /// True if the controller follows velocity and acceleration of the reference.
    pub fn follows_reference(self) -> bool {
        match self {
            Self::Lqr | Self::Pid => false,
            Self::LqrFeedforward | Self::LqrIntegral | Self::Geometric | Self::Altitude => true,
        }
    }
}
