//! Picture turns a [`noctograph_core::flight::Flight`] into a [`light::LightTrace`], an
//! [`expose::Film`] and a [`noctograph_core::photo::Photo`].

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

pub mod expose;
pub mod light;
pub mod photo;

/// Converts a number to f32, which is precise enough for positions and light in an image.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "6e-8 of the value")]
fn narrow(value: f64) -> f32 {
    value as f32
}

/// Rounds a length in pixels down to whole pixels. Negative lengths become zero.
#[expect(clippy::cast_possible_truncation, reason = "pixels of a picture, rounded down")]
fn whole(px: f64) -> usize {
    px as usize
}
