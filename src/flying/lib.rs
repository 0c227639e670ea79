//! Flying: [`noctograph_core::strokes::Strokes`] become a [`plan::Plan`] and a
//! [`noctograph_core::flight::Flight`].

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

pub mod estimate;
pub mod plan;
pub mod sensors;
pub mod sim;
pub mod vehicle;

#[cfg(test)]
mod tests;
