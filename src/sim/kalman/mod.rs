//! Estimation of states from measurements. The estimation depends on no plant and no file.
//!
//! The only filter is a [`Normal`] distribution over the small errors of any number of drones and
//! over further states (the floor's height, biases). Inertial sensors ([`Inertial`]) or a linear
//! motion propagate the distribution. Scalar measurements correct the distribution one after the
//! other, each through a gate ([`Gate`], [`StepTest`]). The simulated drones run this filter, the
//! Cramér–Rao bound is the same filter at the true state, and the crate `locate` runs it over a log
//! of ranges, with a smoother over its steps.

mod attitude;
mod gate;
mod inertial;
mod normal;

pub(crate) use attitude::rotation;
pub use attitude::{Turned, angles};
pub use gate::{Floor, Gate, StepTest};
pub use inertial::{Density, ERRORS, GRAVITY_M_S2, Inertial, Span, TURN, VELOCITY, variance_rate};
pub use normal::{Entry, Innovation, Measurement, Normal, Part, Step, product, toward};
