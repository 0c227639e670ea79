//! Noctograph shows the long-exposure photograph of a drone's light painting before the flight, and
//! judges whether the word is legible.
//!
//! # The road
//!
//! Data flows through stages in one direction. The products of stages are plain data with nouns as
//! names. The stages are named by verbs, and each is a crate or a module of a crate.
//!
//! ```text
//! word ─letters→ Strokes ─plan→ Plan ─sim→ Flight ─light→ LightTrace ─expose→ Film ─photo→ Photo ─score→ Verdict
//!                      a real flight's log ─logs↗                     a real photograph ─────────↗
//! ```
//!
//! ```
//! use noctograph::{scene::{Preset, Scene}, shoot::Shoot};
//! # fn main() -> noctograph::error::Result<()> {
//! let mut scene = Scene { word: "NO".to_owned(), ..Scene::preset(Preset::Cf21) };
//! (scene.camera.width_px, scene.camera.height_px) = (480, 270);
//! let shot = Shoot::new(scene)?.take(&|_stage, _done| {})?;
//! if let Some(verdict) = shot.verdict {
//!     println!("{} reads as {}", verdict.word, verdict.read);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! # The crates
//!
//! Each crate is a folder of `src` with its Cargo.toml, its `lib.rs` and its tests. Because Cargo
//! allows no circular dependencies, data can flow in only one direction. This package contains the
//! program and re-exports the modules of the crates.
//!
//! | crate | what is in it | of ours, it depends on |
//! |---|---|---|
//! | `core` | the products as plain data: [`strokes`], the plan, [`flight`], the photo; descriptions without pixels: [`camera`], [`lamps`]; [`error`] and [`diagnostic`], the one type that says what is wrong; settings, files, digests, random numbers, [`geometry`], facts of the [`crazyflie`] | `features` |
//! | `features` | no code: features of packages, so that the tests of one crate reuse the program's build | nothing |
//! | `letters` | word, drawing or picture → [`strokes::Strokes`] | `core` |
//! | `plan` | Strokes → [`plan::Plan`]; [`tracking`]: a flight against its plan | `core` |
//! | `sim` | Plan → [`flight::Flight`]: [`vehicle`], [`sensors`], [`kalman`], the loop ([`sim`]), and the mathematics of linear systems ([`control`]), which knows no drone | `core` |
//! | `picture` | Flight → [`light::LightTrace`] → [`expose::Film`] → [`photo::Photo`], on a graphics device (feature `gpu`) or the CPU | `core` |
//! | `score` | Photo → [`score::Verdict`] | `core` |
//! | `logs` | a real flight's log → Flight; [`identify`]: Flight → parameters of its drone | `core`, `sim` |
//! | `locate` | ranges → positions of two drones | `core`, `sim` |
//! | `export` | Plan → files for drones and other programs | `core`, `plan`, `sim` |
//! | `pipeline` | [`scene`], [`shoot`] (the one place where stages are chained), [`preflight`] | `core`, `export`, `letters`, `logs`, `picture`, `plan`, `score`, `sim` |
//! | `studies` | [`studies`] of many flights, [`comparison`] of two, [`report`] | `core`, `letters`, `logs`, `picture`, `pipeline`, `plan`, `score`, `sim` |
//! | `photo_service` | what a page asks for → its photograph with typed facts, on a server or as a WebAssembly module in the browser | `core`, `export`, `letters`, `logs`, `picture`, `pipeline`, `score`, `sim` |
//! | `serve` | the page for visitors with its queue and its wall, over HTTP | `core`, `export`, `logs`, `photo_service`, `pipeline`, `score` |
//! | `noctograph` | the program: [`cli`] with arguments, tables, exit codes | `core`, `export`, `letters`, `locate`, `logs`, `picture`, `pipeline`, `plan`, `score`, `serve`, `sim`, `studies` |
//! | `python` | the bindings of the Python package, whose functions are the commands of [`cli`] | `core`, `noctograph` |
//!
//! Without the crate `features`, the tests of a single crate would rebuild about thirty packages.
//! `core` depends on it because all other crates depend on `core`. `serve` depends on
//! `photo_service` because the server answers the same requests as the page without a server, and
//! the photographs must have the same bytes.
//!
//! The crates cannot be published on crates.io, because fonts, shaders and golden files are at the
//! top level, outside the crates. A program that uses the library depends on the repository, as
//! `examples/library` does.
//!
//! These rules apply in addition to the dependencies between crates:
//! - `score` uses no plan, no flight and no light trace, but only a photo, a word and a camera.
//! - `expose` knows nothing of drones, `light` nothing of pixels, and `letters` nothing of speed.
//! - Quantities of the world are in meters, in f64 and nalgebra types. Quantities of the picture
//!   are in pixels, in glam types up to the segments of `expose`, in f32 in its records, and in
//!   integers after that. A single function performs each change of the number format.
//! - Code below `cli` reads no clock and no environment, prints nothing, and shows no progress bar.
//!   Stages report progress through a callback. The same scene and seed yield the same bytes.
//! - Degrees, milliseconds and other axes occur only in `cli`, `logs` and `export`.
//!
//! # Conventions
//!
//! In the world frame, z points up, x to the viewer's right, and y into the scene, and the word
//! lies in the x-z plane. In the body frame, x points forward, y left, and z up. In the camera
//! frame, x points right, y down, and z forward. The image origin is at the top left, and pixel
//! centers are at +0.5. The name of a transform has the form `to_from`. The name of every public
//! scalar contains its unit.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

pub use nalgebra;
pub use noctograph_core::{camera, crazyflie, diagnostic, error, flight, geometry, lamps, strokes};
pub use noctograph_logs::identify;
pub use noctograph_picture::{expose, light, photo};
pub use noctograph_pipeline::{preflight, scene, shoot};
pub use noctograph_plan::{self as plan, tracking};
pub use noctograph_sim::{self as sim, control, kalman, sensors, vehicle};
pub use noctograph_studies::{self as studies, comparison, report};
pub use {
    noctograph_export as export, noctograph_letters as letters, noctograph_locate as locate,
    noctograph_logs as logs, noctograph_score as score,
};

pub mod cli;
