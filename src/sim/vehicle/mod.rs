//! The drone itself: rotors, body, battery, and the air and floor about them.
//!
//! In: four motor commands and the time step. Out: how the drone has moved. [`Plant`] flies, and
//! several at once in wide registers; the private model of twelve states is what controllers and observers are designed on, and what the
//! plant is held against in tests.
//!
//! Method: rotor speeds follow their commands by their exact exponential; position, velocity, unit
//! quaternion and body rate take one classical Runge–Kutta step of order 4. What changes slowly
//! (voltage, ground effect, gust) is held through a step.
//!
//! Sources: equations of the reference flight (AE483, 2022); the rest stands at each option.
//!
//! Not modelled: blade flapping, lift and inflow of moving air, vortex ring state, ceiling and
//! walls, downwash between drones, recovery of a resting battery, its temperature; sliding,
//! bouncing and tipping on the floor.

mod battery;
mod body;
mod craft;
mod floor;
mod gusts;
mod model;
mod options;
mod plant;
mod plants;
mod rotors;

pub use self::body::Body;
pub(super) use self::craft::Craft;
pub(super) use self::model::{
    GRAVITY_M_S2, Motion, State, Vehicle, Wrench, at, attitude, motion_derivative, position, rate,
    velocity,
};
pub use self::options::{
    AirOptions, BatteryOptions, Compensation, GroundEffect, Gusts, VehicleOptions,
};
pub use self::plant::Plant;
pub(super) use self::plants::{Plants, Reality};
