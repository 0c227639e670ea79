//! Estimation of states from measurements, independent of any plant or file.
//!
//! The only filter is a [`Normal`] distribution over the small errors of any number of drones and
//! over further states (the floor's height, biases). Inertial sensors ([`Inertial`]) or a linear
//! motion propagate the distribution. Scalar measurements correct the distribution one after the
//! other, each through a gate ([`Gate`], [`StepTest`]). The simulated drones run this filter, the
//! Cramér–Rao bound is computed by the same filter at the true state, and the crate `locate` runs
//! the filter over a log of ranges, followed by a smoother.

mod attitude;
mod gate;
mod inertial;
mod normal;

pub(crate) use attitude::rotation;
pub use attitude::{Turned, angles};
pub use gate::{Floor, Gate, StepTest};
pub use inertial::{Density, ERRORS, GRAVITY_M_S2, Inertial, Span, TURN, VELOCITY, variance_rate};
pub use normal::{Entry, Innovation, Measurement, Normal, Part, Step, product, toward};
