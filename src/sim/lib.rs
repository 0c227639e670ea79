//! Simulation of a flight.
//!
//! The input is a [`Plan`](noctograph_core::plan::Plan). The output is a
//! [`Flight`](noctograph_core::flight::Flight), which can also be read from a real flight's log.
//!
//! At every tick (500 Hz), the sensors are read, the estimator is updated, and a controller
//! converts the estimate to four motor commands, which are held for one or more ticks. The commands
//! drive the drone ([`Plant`](crate::vehicle::Plant)), which consists of rotors, rigid body,
//! battery, air and floor. The drone starts at rest at the first setpoint, and a setpoint at or
//! below the floor switches the motors off. [`ControllerKind`] lists the controllers.
//! [`gain_design`] computes gains without a flight.
//!
//! Equations, weights and default values are those of the reference flight (AE483, 2022, preset
//! `ae483-2022`, the default of [`SimOptions`]). Lighthouse errors are from Bitcraze's
//! `positioning_dataset` (arXiv 2104.11523), and IMU noise is from the BMI088's data sheet. The
//! other sensors and the Kalman filter follow the Crazyflie's firmware.
//!
//! Whole-number motor commands, filters of the inertial sensors, and sliding, bouncing and tipping
//! on the floor are not modeled.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

mod avionics;
pub mod control;
mod controller;
mod estimator;
mod fly;
pub mod gain_design;
pub mod kalman;
mod options;
mod radio;
mod recorder;
mod relit;
pub mod sensors;
mod session;
pub mod vehicle;

#[cfg(test)]
mod tests;

pub use avionics::Avionics;
pub use controller::{ThrustMap, altitude_gains};
pub use estimator::{
    AltitudeFilter, AltitudeSensor, AltitudeState, Bound, HeightReading, Update, bounds,
    one_more_anchor, writing_sigma_m,
};
pub use fly::{fly, fly_fleet, fly_watched};
pub use options::{
    AltitudeHoldOptions, AltitudeOptions, ControllerKind, ControllerOptions, CooperativeOptions,
    Drone, EkfOptions, EstimatorKind, FirmwareOptions, GeometricOptions, HorizontalForce, Law,
    LqrOptions, LuenbergerOptions, MotorLag, ObserverOptions, PidOptions, RadioOptions,
    RateOptions, SetpointKind, Setpoints, Share, SimOptions, SweepAttitude,
};
pub use relit::{holds_positions, relit};
pub use session::Session;
