//! Picture: a [`noctograph_core::flight::Flight`] becomes a [`light::LightTrace`], an
//! [`expose::Film`] and a [`noctograph_core::photo::Photo`].

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

pub mod expose;
pub mod light;
pub mod photo;
