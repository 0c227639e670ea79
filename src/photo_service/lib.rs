//! Photo service: the request of a page becomes a photograph with its verdict, as typed facts with
//! files as bytes beside them.
//!
//! A [`request`] is read and checked, and its subject is prepared as a scene, flown and
//! photographed ([`answer`]). If it is refused, a message says why ([`messages`]). The crate
//! `serve` answers the requests of its visitors with it. Compiled to WebAssembly (`wasm`,
//! `src/photo_service/build`), it answers them in the browser.

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
