//! Replaces the graphics device in a build without the feature `gpu`, where every call fails.

use super::{FilmData, Latent};
use noctograph_core::error::{Error, Result};

/// A graphics device that can never be opened.
#[derive(Debug)]
pub(super) struct Gpu {
    pub(super) adapter: String,
}

/// The work before a device is open, which is none.
#[derive(Debug)]
pub(super) struct Prepared;

impl Prepared {
    /// Prepares nothing.
    pub(super) fn new(_: &Latent) -> Self {
        Self
    }
}

impl Gpu {
    /// Returns the error for a missing device.
    pub(super) fn ready() -> Result<Self> {
        Err(driver_panicked())
    }

    /// Returns the error for a missing device.
    pub(super) fn wait(&self) -> Result<()> {
        Err(driver_panicked())
    }

    /// Returns the error for a missing device.
    pub(super) fn splat(&self, _: &Latent, _: Prepared) -> Result<FilmData> {
        Err(driver_panicked())
    }
}

/// Returns the error for a missing device in place of a driver's error.
pub(super) fn driver_panicked() -> Error {
    let what = "the program was built without the feature gpu".to_owned();
    Error::Gpu { what, hint: "choose the CPU as the backend".into() }
}
