//! Tools and data types that are common to all stages of Noctograph.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

pub mod camera;
pub mod crazyflie;
pub mod diagnostic;
pub mod digest;
pub mod error;
pub mod files;
pub mod flight;
pub mod geometry;
pub mod lamps;
pub mod parallel;
pub mod photo;
pub mod place;
pub mod plan;
pub mod product;
pub mod random;
pub mod settings;
pub mod srgb;
pub mod statistics;
pub mod strokes;
pub mod units;

/// Runs work in a version that is compiled for this processor's widest vector registers.
/// WebAssembly has only one register width.
#[inline(always)]
pub fn dispatch<Work: pulp::NullaryFnOnce>(work: Work) -> Work::Output {
    #[cfg(target_family = "wasm")]
    return work.call();
    #[cfg(not(target_family = "wasm"))]
    pulp::Arch::new().dispatch(work)
}

/// Runs a closure with [`dispatch()`], for the macro of the same name.
#[inline(always)]
pub fn once<Output>(work: impl FnOnce() -> Output) -> Output {
    dispatch(work)
}

/// Runs a closure with [`dispatch()`], inlined so that it is compiled for this processor.
#[macro_export]
#[rustfmt::skip]
macro_rules! dispatch {
    (|| $work:expr) => { $crate::once(#[inline(always)] || $work) };
}
