//! Settings of the controller.

use crate::vehicle::N_STATES;
use noctograph_core::error::{Error, Result};
use noctograph_core::settings::settings;

settings! {
    /// Controller of the drone. Weights of unused controllers are kept for the design of gains and
    /// for later use.
    pub struct ControllerOptions {
        /// Kind of controller.
        kind: ControllerKind = ControllerKind::Lqr;
        /// Linear-quadratic regulators.
        lqr: LqrOptions = LqrOptions::default(),
            for "controller.kind" = "lqr" | "lqr-feedforward" | "lqr-integral" | "altitude";
        /// Geometric controller.
        geometric: GeometricOptions = GeometricOptions::default(),
            for "controller.kind" = "geometric";
        /// Altitude hold.
        altitude: AltitudeHoldOptions = AltitudeHoldOptions::default(),
            for "controller.kind" = "altitude";
        /// Firmware's cascade of PID loops.
        pid: PidOptions = PidOptions::default(), for "controller.kind" = "pid";
        /// Setpoints that the host sends while the drone writes (`--mode` of the exported script).
        setpoints: SetpointKind = SetpointKind::Position, for "controller.kind" = "pid";
    }

    /// A kind of setpoint that the firmware distinguishes.
    pub enum SetpointKind {
        /// Positions only. The firmware's own landing uses the same kind.
        "position" => Position,
        /// Positions, velocities and accelerations, of which the cascade uses only the positions.
        /// The landing uses another kind, so since release 2026.08 all loops are reset at the
        /// landing, and the drone drops by 12 to 18 cm.
        "full-state" => FullState,
    }

    /// A controller.
    pub enum ControllerKind {
        /// The reference team's linear-quadratic regulator, on held position setpoints.
        "lqr" => Lqr,
        /// The same gain around the moving design, with velocity and acceleration fed forward.
        "lqr-feedforward" => LqrFeedforward,
        /// A regulator around the moving design, with the integral of the position error.
        "lqr-integral" => LqrIntegral,
        /// The firmware's default cascade of PID loops, on held position setpoints.
        "pid" => Pid,
        /// Geometric tracking on SE(3) (Lee, Leok, `McClamroch` 2010) with full states, as in
        /// firmware.
        "geometric" => Geometric,
        /// Altitude control with the estimated thrust map, and lqr-feedforward for everything else.
        "altitude" => Altitude,
    }

    /// Linear-quadratic regulators that minimize `∫ sᵀQs + iᵀRi dt` around the setpoint (Q, R
    /// diagonal).
    ///
    /// The defaults are the team's weights, from Bryson's rule and manual tuning, and integrals
    /// that remove a constant error in about two seconds.
    pub struct LqrOptions {
        /// Gain K in `u = u_ref − K (x̂ − x_ref)`, for example from SciPy, in place of the one
        /// designed from the weights.
        ///
        /// The rows of K are torque x y z (N m) and thrust (N). The columns are the twelve states
        /// in the order of `q` and, for lqr-integral, the integrals of the position error x y z (m
        /// s). With lagging motors, four more columns may follow, for the torques and the thrust of
        /// the modeled rotors as `noctograph gains` prints them.
        k: Option<Vec<Vec<f64>>> = None, in -1e6..=1e6;
        /// Weights of position x y z (1/m²), yaw pitch roll (1/rad²), body velocity x y z (s²/m²)
        /// and body rate x y z (s²/rad²). Larger weights hold the state more tightly and move the
        /// motors more.
        q: [f64; 12] =
            [120.0, 80.0, 75.0, 40.0, 0.01, 0.01, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0], in 0.0..=1e12,
            unless "controller.lqr.k";
        /// Weights of torque x y z (1/(N m)²) and thrust (1/N²). Larger weights move the motors
        /// less.
        r: [f64; 4] = [5_045_605.0, 5_045_605.0, 38_586_096.0, 566.0], in 1e-6..=1e12,
            unless "controller.lqr.k";
        /// Weights of the integral of the position error x y z (1/(m s)²), for lqr-integral.
        ///
        /// Larger weights remove a constant error sooner, but cause more overshoot at corners.
        q_integral: [f64; 3] = [20.0; 3], in 0.0..=1e12, for "controller.kind" = "lqr-integral",
            unless "controller.lqr.k";
        /// Model of the motors in the design of the gain.
        motor_lag: MotorLag = MotorLag::Modeled, unless "controller.lqr.k";
    }

    /// Model of the motors in the design of a regulator's gain.
    pub enum MotorLag {
        /// The vehicle's lag. The gain is designed for this lag, and includes feedback of the
        /// modeled rotors.
        ///
        /// If the vehicle has no lag, this model equals [`Self::Ignored`].
        "modeled" => Modeled,
        /// Instantaneous motors, as in the reference team's design.
        "ignored" => Ignored,
    }

    /// Altitude hold by a regulator of a double integrator, with weights from Bryson's rule.
    pub struct AltitudeHoldOptions {
        /// Altitude error that costs as much as a vertical acceleration of `acceleration_m_s2`.
        error_m: f64 = 0.2, in 0.001..=100.0;
        /// Vertical acceleration that costs as much as an altitude error of `error_m`.
        acceleration_m_s2: f64 = 1.6, in 0.001..=100.0;
    }

    /// The firmware's cascade of PID loops. Gains are P, I, D in the firmware's units, named after
    /// its constants (`PID_POS_X_KP` …).
    ///
    /// The defaults are those of crazyflie-firmware `platform_defaults_cf2.h`, commit 0555cb1.
    pub struct PidOptions {
        /// Position gains along x in m/s per m (parameters `posCtlPid.xKp`, `xKi`, `xKd`).
        pos_x: [f64; 3] = [2.0, 0.0, 0.0], in 0.0..=1e5;
        /// Position gains along y.
        pos_y: [f64; 3] = [2.0, 0.0, 0.0], in 0.0..=1e5;
        /// Position gains along z.
        pos_z: [f64; 3] = [2.0, 0.5, 0.0], in 0.0..=1e5;
        /// Velocity gains along x in degrees of pitch per m/s (`velCtlPid.vxKp` …).
        vel_x: [f64; 3] = [25.0, 1.0, 0.0], in 0.0..=1e5;
        /// Velocity gains along y in degrees of roll per m/s.
        vel_y: [f64; 3] = [25.0, 1.0, 0.0], in 0.0..=1e5;
        /// Velocity gains along z in thousands of command units (65535 is full power) per
        /// m/s.
        vel_z: [f64; 3] = [25.0, 15.0, 0.0], in 0.0..=1e5;
        /// Roll gains in °/s per degree (`pid_attitude.roll_kp` …).
        roll: [f64; 3] = [6.0, 3.0, 0.0], in 0.0..=1e5;
        /// Pitch gains.
        pitch: [f64; 3] = [6.0, 3.0, 0.0], in 0.0..=1e5;
        /// Yaw gains.
        yaw: [f64; 3] = [6.0, 1.0, 0.35], in 0.0..=1e5;
        /// Roll rate gains in command units (65535 is full power) per °/s (`pid_rate.roll_kp` …).
        roll_rate: [f64; 3] = [250.0, 500.0, 2.5], in 0.0..=1e5;
        /// Pitch rate gains.
        pitch_rate: [f64; 3] = [250.0, 500.0, 2.5], in 0.0..=1e5;
        /// Yaw rate gains.
        yaw_rate: [f64; 3] = [120.0, 16.7, 0.0], in 0.0..=1e5;
        /// Assumed hover command, in units of which 65535 is full power (`PID_VEL_THRUST_BASE`).
        ///
        /// The loops' integrals compensate an error of this value slowly, so heavy drones take off
        /// late.
        thrust_base: f64 = 36_000.0, in 0.0..=65_535.0;
    }

    /// Geometric controller.
    ///
    /// The default gains equal those of the team's regulator for small angles (its gains divided by
    /// the inertia, and by the pitch inertia times gravity), with integrals that are slow in
    /// comparison. The firmware's gains tolerate more motor lag. In `controller_lee.c` (releases
    /// 2024.10 to 2026.08) they are 7, 4 and 0 for positions, and for attitudes 422, 69 and 1810
    /// after division by Förster's inertia.
    pub struct GeometricOptions {
        /// Acceleration per position error in 1/s².
        k_position: f64 = 9.8, in 0.0..=1e4;
        /// Acceleration per velocity error in 1/s.
        k_velocity: f64 = 4.5, in 0.0..=1e4;
        /// Acceleration per integral of the position error in 1/s³.
        k_position_integral: f64 = 2.0, in 0.0..=1e4;
        /// Angular acceleration per attitude error about body x y z in 1/s².
        k_attitude: [f64; 3] = [366.0, 384.0, 30.7], in 0.0..=1e6;
        /// Angular acceleration per error of the body rate x y z in 1/s.
        k_rate: [f64; 3] = [45.0, 44.7, 9.2], in 0.0..=1e6;
        /// Angular acceleration per integral of the attitude error in 1/s³.
        k_attitude_integral: [f64; 3] = [300.0, 300.0, 30.0], in 0.0..=1e6;
    }
}

impl ControllerOptions {
    /// Checks that a given gain `controller.lqr.k` has a row for each input and a column for each
    /// state. Columns for lagging rotors may follow if the rotors lag (`rotors_lag`).
    pub(super) fn check_gain(&self, rotors_lag: bool) -> Result<()> {
        let (Some(k), kind) = (&self.lqr.k, self.kind) else { return Ok(()) };
        // Integral action adds the integrals of the three positions to the drone's states.
        let n_states = if kind.integrates() { N_STATES + 3 } else { N_STATES };
        let lengths: Vec<usize> = k.iter().map(Vec::len).collect();
        if lengths == [n_states; 4] || rotors_lag && lengths == [n_states + 4; 4] {
            return Ok(());
        }
        let n_columns = lengths.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
        let given = format!("{} rows of {n_columns} numbers", k.len());
        let more = if rotors_lag { ", or 4 more numbers for the rotors" } else { "" };
        let wanted = format!("4 rows of {n_states} numbers for {}{more}", kind.name());
        let hint = "the rows are torque x y z and thrust, and the columns are the states in the \
                    order of controller.lqr.q";
        Err(Error::input("controller.lqr.k", given, wanted, hint))
    }

    /// Returns the kind of setpoint that the host sends while the drone writes, which is also the
    /// kind that is checked.
    pub fn sends(&self) -> SetpointKind {
        match self.kind {
            ControllerKind::Pid => self.setpoints,
            kind if kind.follows_reference() => SetpointKind::FullState,
            _ => SetpointKind::Position,
        }
    }
}

impl PidOptions {
    /// Returns the gains `[P, I, D]` of three axes for each of the position, velocity, attitude and
    /// rate loops.
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
    /// Gain matrix, which is designed from weights or given (`controller.lqr`).
    StateFeedback {
        /// True if the law integrates the position error.
        integrates: bool,
        /// True if the thrust follows from an estimated thrust map instead.
        by_thrust_map: bool,
    },
    /// Firmware's cascade of PID loops.
    Cascade,
    /// Firmware's geometric controller.
    Geometric,
    /// Other control law, which the firmware lacks.
    Own,
}

impl ControllerKind {
    /// Returns the control law of this kind. Laws differ in what the gain design and the exports
    /// can do with them.
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

    /// Returns the scene keys of the gains and weights, for messages.
    pub fn keys(self) -> &'static str {
        match self {
            Self::Lqr | Self::LqrFeedforward | Self::LqrIntegral => "controller.lqr",
            Self::Pid => "controller.pid",
            Self::Geometric => "controller.geometric",
            Self::Altitude => "controller.lqr and controller.altitude",
        }
    }

    /// True if the controller follows the reference's velocity and acceleration.
    pub fn follows_reference(self) -> bool {
        match self {
            Self::Lqr | Self::Pid => false,
            Self::LqrFeedforward | Self::LqrIntegral | Self::Geometric | Self::Altitude => true,
        }
    }
}
