//! The vehicle: rotors, body, battery, and the air and floor around them.
//!
//! In: four motor commands and the time step. Out: the drone's motion. [`Plant`] is simulated; the
//! private model of twelve states serves the design of controllers and observers, and as the
//! reference for the plant in tests.
//!
//! Method: rotor speeds follow their commands by their exact exponential; position, velocity, unit
//! quaternion and body rate take one classical Runge–Kutta step of order 4. Slow quantities
//! (voltage, ground effect, gust) are held through a step.
//!
//! Sources: equations of the reference flight (AE483, 2022); each option names the rest.
//!
//! Not modeled: blade flapping, lift and inflow of moving air, vortex ring state, ceiling and
//! walls, recovery of a resting battery, its temperature; sliding, bouncing and tipping on the
//! floor.

mod battery;
mod body;
mod floor;
mod ground_effect;
mod gusts;
mod mixer;
mod model;
mod options;
mod plant;
mod rotors;
mod wake;

pub use self::body::RigidBody;
pub use self::floor::{FloorOptions, FloorStep};
pub use self::gusts::TORQUE_TIME_S;
pub use self::mixer::Mixer;
pub use self::model::{Motion, at_rest, attitude, position, rate, velocity};
pub(crate) use self::model::{State, Vehicle, Wrench, motion_derivative, state};
pub use self::options::{
    AirOptions, BatteryOptions, Compensation, Downwash, GroundEffect, GustOptions, Gusts,
    VehicleOptions,
};
pub use self::plant::{Plant, PlantOptions};
pub use self::wake::Wake;
