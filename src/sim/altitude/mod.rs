//! Altitude from three imperfect sensors, with an unknown thrust map.
//!
//! A quadcopter measures its altitude by satellites, by a ranger that looks down onto a floor that
//! is not flat, and by air pressure that drifts. How its throttle τ becomes lift is unknown and
//! changes with the battery: `z̈ = α⁰ + α¹ τ`. [`AltitudeFilter`] estimates altitude, vertical
//! velocity, α⁰, α¹ and both biases; [`hold()`] flies a scalar drone on its estimates through
//! [`Scenario`]s.
//!
//! What the filter cannot know: while the throttle is held, α⁰ and α¹ are not observable apart (rank
//! 5 of 6; 4 while the satellites are silent), only the hover throttle −α⁰/α¹ is. It reports that
//! one, and α¹ with its standard deviation.
//!
//! Not modelled here: attitude and horizontal motion; the full simulator has them.

mod filter;
mod scalar;

pub use filter::{AltitudeFilter, AltitudeOptions, Sensor, State};
pub use scalar::{Hold, HoldSample, Measurement, Scenario, hold};
