//! The photo service answers a page's request with a photograph and its verdict, as typed facts
//! with files as bytes beside them.
//!
//! A [`request`] is parsed and checked, and its subject is prepared as a scene, simulated and
//! photographed ([`answer`]). If the request is refused, a message gives the reason ([`messages`]).
//! The crate `serve` uses this crate to answer its visitors. Compiled to WebAssembly (`wasm`,
//! `src/photo_service/build`), this crate answers requests in the browser.

#![deny(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

use noctograph_pipeline::preflight::Profile;
use noctograph_pipeline::scene::Scene;

pub mod about;
pub mod answer;
pub mod messages;
pub mod replay;
pub mod request;
mod subject;
#[cfg(target_family = "wasm")]
mod wasm;

#[cfg(test)]
#[path = "../../tests/it/bless.rs"]
mod bless;

/// A scene that is ready to be planned, and the limits for its flight.
#[derive(Clone, Debug)]
pub struct PreparedScene {
    /// The scene, with its word or drawing.
    pub scene: Scene,
    /// Limits of the flight.
    pub profile: Profile,
}
