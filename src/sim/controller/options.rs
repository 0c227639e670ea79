//! What a controller is described with.

use serde::{Deserialize, Serialize};

use crate::error::{Result, within};
use crate::sim::options::within_all;

/// Which controller flies the drone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ControllerKind {
    /// The reference team's: a linear-quadratic regulator on held position setpoints.
    #[default]
    Lqr,
    /// The same gain about the design as it moves: velocity and acceleration fed forward.
    LqrFeedforward,
    /// Regulator with the integral of the position error, about the design as it moves.
    LqrIntegral,
    /// The firmware's default cascade of PID loops, on held position setpoints.
    Pid,
    /// Geometric tracking on SE(3) (Lee, Leok, `McClamroch` 2010), about the design as it moves.
    Geometric,
}

/// What a regulator is told of the rotors' lag.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MotorLag {
    /// The vehicle's: the gain is designed for it, and feeds back what the rotors are believed to
    /// give. Without a lag in the vehicle, as [`Self::Ignored`].
    #[default]
    Modelled,
    /// Nothing, as the reference team's: the gain takes the motors for immediate.
    Ignored,
}

/// What steers the drone. Regulators: cost `∫ sᵀQs + iᵀRi dt` about the setpoint, Q and R diagonal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ControllerOptions {
    /// Which controller.
    pub kind: ControllerKind,
    /// Weights of position x y z (1/m²), yaw pitch roll (1/rad²), body velocity x y z (s²/m²) and
    /// body rate x y z (s²/rad²). More holds tighter and moves the motors more.
    pub q: [f64; 12],
    /// Weights of torque x y z (1/(N m)²) and thrust (1/N²). More spares the motors.
    pub r: [f64; 4],
    /// Weights of the integral of the position error x y z (1/(m s)²), for `lqr-integral`. More
    /// takes a standing error away sooner, and swings further past a corner.
    pub q_integral: [f64; 3],
    /// What the regulators are told of the rotors' lag.
    pub motor_lag: MotorLag,
    /// Geometric controller: acceleration per position error, 1/s².
    pub k_position: f64,
    /// Geometric controller: acceleration per velocity error, 1/s.
    pub k_velocity: f64,
    /// Geometric controller: acceleration per integral of the position error, 1/s³.
    pub k_position_integral: f64,
    /// Geometric controller: angular acceleration per attitude error about body x y z, 1/s².
    pub k_attitude: [f64; 3],
    /// Geometric controller: angular acceleration per error of the body rate x y z, 1/s.
    pub k_rate: [f64; 3],
    /// Geometric controller: angular acceleration per integral of the attitude error, 1/s³.
    pub k_attitude_integral: [f64; 3],
}

impl Default for ControllerOptions {
    /// Weights: the team's choice, from Bryson's rule and then by hand; integrals that take a
    /// standing error away in about two seconds. Geometric gains: those that are the team's
    /// regulator for small angles (its gains over the inertia, and over that of the pitch times
    /// gravity), with integrals slow beside them. The firmware's own (`controller_lee.c`, commit
    /// 0640f1c: 9, 7, 5, over Förster's inertia 332, 78, 724) bear more motor lag, and round the
    /// corners of letters two and a half times as much.
    fn default() -> Self {
        Self {
            kind: ControllerKind::Lqr,
            q_integral: [20.0, 20.0, 20.0],
            motor_lag: MotorLag::Modelled,
            k_position: 9.8,
            k_velocity: 4.5,
            k_position_integral: 2.0,
            k_attitude: [366.0, 384.0, 30.7],
            k_rate: [45.0, 44.7, 9.2],
            k_attitude_integral: [300.0, 300.0, 30.0],
            q: [120.0, 80.0, 75.0, 40.0, 0.01, 0.01, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
            r: [5_045_605.0, 5_045_605.0, 38_586_096.0, 566.0],
        }
    }
}

impl ControllerOptions {
    /// Checks every setting by itself.
    ///
    /// # Errors
    ///
    /// [`crate::error::Error::Input`] with the key as its place.
    pub(in crate::sim) fn check(&self) -> Result<()> {
        within_all("controller.q", &self.q, 0.0, 1e12)?;
        within_all("controller.r", &self.r, 1e-6, 1e12)?;
        within_all("controller.q_integral", &self.q_integral, 0.0, 1e12)?;
        within("controller.k_position", self.k_position, 0.0, 1e4)?;
        within("controller.k_velocity", self.k_velocity, 0.0, 1e4)?;
        within("controller.k_position_integral", self.k_position_integral, 0.0, 1e4)?;
        within_all("controller.k_attitude", &self.k_attitude, 0.0, 1e6)?;
        within_all("controller.k_rate", &self.k_rate, 0.0, 1e6)?;
        within_all("controller.k_attitude_integral", &self.k_attitude_integral, 0.0, 1e6)
    }
}
