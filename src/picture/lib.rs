//! Picture: a [`noctograph_core::flight::Flight`] becomes a [`light::LightTrace`], an
//! [`expose::Film`] and a [`noctograph_core::photo::Photo`].

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

pub mod expose;
pub mod light;
pub mod photo;

/// A number of an image, whose positions and light need no more than f32: 6e-8 of the value.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "6e-8 of the value")]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// Whole pixels of a length in pixels, not below 0.
#[expect(clippy::cast_possible_truncation, reason = "pixels of a picture, rounded down")]
fn whole(px: f64) -> usize {
    px as usize
}
