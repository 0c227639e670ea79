//! Vehicle with rotors, body and battery, and the air and floor around it.
//!
//! The input is four motor commands and the time step. The output is the drone's motion. [`Plant`]
//! is the simulated drone. A private model with twelve states serves gain design and tests.
//!
//! Rotor speeds approach their commands along the exact exponential. Position, velocity, unit
//! quaternion and body rate are advanced by one classical fourth-order Runge–Kutta step. Slow
//! quantities (voltage, ground effect, gust) are constant during a step.
//!
//! The equations are those of the reference flight (AE483, 2022). Each option names its source.
//!
//! Blade flapping, lift and inflow of moving air, vortex ring state, ceiling and walls, recovery
//! and temperature of a battery, and sliding, bouncing and tipping on the floor are not modeled.

mod battery;
mod body;
mod downwash;
mod floor;
mod ground_effect;
mod gusts;
mod mixer;
mod model;
mod options;
mod plant;
mod rotors;

pub use self::body::RigidBody;
pub use self::downwash::Jet;
pub(crate) use self::floor::MAX_COORDINATE_M;
pub use self::floor::{FloorOptions, FloorStep};
pub use self::gusts::TORQUE_TIME_S;
pub use self::mixer::Mixer;
pub use self::model::{Motion, at_rest, attitude, position, rate, velocity};
pub(crate) use self::model::{
    N_INPUTS, N_STATES, RATE, State, VELOCITY, Wrench, YAW, motion_derivative, state,
};
pub use self::options::{
    AirOptions, BatteryOptions, Compensation, Downwash, GroundEffect, GustOptions, Gusts,
    VehicleOptions,
};
pub use self::plant::{Plant, PlantOptions};
