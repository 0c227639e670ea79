//! Pipeline: scenes, the only place where stages are chained, and the checks before a flight.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

pub mod preflight;
pub mod scene;
pub mod shoot;
