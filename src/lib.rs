//! Noctograph shows the long-exposure photograph of a drone's light painting before the flight,
//! and says whether it reads.
//!
//! # The road
//!
//! Data flows one way. Products are nouns, stages are verbs; a stage is one module whose `mod.rs`
//! holds its product and the one function that makes it.
//!
//! ```text
//! word ─letters→ Strokes ─plan→ Plan ─sim→ Flight ─light→ LightTrace ─expose→ Film ─photo→ Photo ─score→ Verdict
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
//! # The rooms
//!
//! A module imports from the rows above its own.
//!
//! | row | module | what is in it |
//! |---|---|---|
//! | 0 | [`error`] | error variants, grouped by how to fix them |
//! | 0 | `settings` | settings of a scene: documentation, type, default and range in one declaration |
//! | 0 | `digest` | SHA-256 of films, flights, files and studies |
//! | 0 | `files` | reading up to a limit and within a budget of work and memory, writing whole or not at all |
//! | 0 | `srgb` | its transfer curve, its primaries, luminance |
//! | 0 | `statistics` | median and quantiles |
//! | 0 | `random` | random numbers as functions of a key |
//! | 0 | [`geometry`] | poses, frames, polylines |
//! | 0 | [`control`] | mathematics of linear systems, with no drone in it |
//! | 1 | [`crazyflie`] | facts of the firmware and its files |
//! | 1 | [`letters`] | word or drawing → [`letters::Strokes`] |
//! | 1 | [`camera`] | a description without pixels: pose, lens, shutter, sensitivity |
//! | 1 | [`flight`] | [`flight::Flight`], its tracking errors, its file |
//! | 2 | [`estimate`] | measurements → states: one filter, its gates, its bound |
//! | 2 | [`plan`] | Strokes → [`plan::Plan`] |
//! | 2 | [`light`] | Flight → [`light::LightTrace`] |
//! | 2 | [`logs`] | a real flight's log → Flight |
//! | 2 | [`vehicle`] | motor commands → motion: rotors, body, battery, the air and the floor around them |
//! | 3 | [`sensors`] | motion → measurements: inertial, Lighthouse, ranges, heights; messages between drones |
//! | 3 | [`expose`] | [`light::LightTrace`] × Camera → [`expose::Film`], on a graphics device or the CPU |
//! | 4 | [`sim`] | Plan → Flight: estimator, controller and the loop that runs them |
//! | 4 | [`photo`] | Film → [`photo::Photo`], its file |
//! | 5 | [`identify`] | Flight → parameters of its drone |
//! | 5 | [`export`] | Plan → files for drones and other programs |
//! | 5 | [`score`] | Photo → [`score::Verdict`] |
//! | 6 | [`scene`] | the one TOML file that fixes a photo |
//! | 7 | [`shoot`] | the one place where stages are chained: Scene → [`shoot::Shot`] with all products |
//! | 8 | [`preflight`] | Shoot → findings: what speaks against a flight, with its numbers and advice |
//! | 9 | [`study`] | scenes → ranking, tuned scene, learned plan, what makes a word illegible; shards, a store |
//! | 10 | [`report`] | products → plots, sheets |
//! | 11 | [`cli`] | arguments, tables, exit codes |
//! | 12 | `python` | the Python package (feature `python`), above `cli`, whose commands are its functions |
//!
//! Row 0 holds the tools of all rooms: none imports anything of ours but `error`, so that no stage
//! owns them and none writes them again.
//!
//! Dependency rules, beside the order of the rows:
//! - `score` knows no plan, no flight and no light: it sees a photo, a word and a camera.
//! - `expose` knows no drone, `light` no pixels, `letters` no speed, `control` no Crazyflie.
//! - The world is in meters, f64 and nalgebra; the picture is in pixels: glam up to the segments of
//!   `expose`, f32 in its records, integers after them. Each width changes in one function.
//! - No clock, no environment, no printing and no progress bar above `cli` in this table: stages
//!   report progress through a callback. Same scene and seed, same bytes.
//! - Degrees, milliseconds and other axes stay in `cli` and in the readers of foreign files.
//!
//! # Conventions
//!
//! World: z up, x to the viewer's right in the written word, y into the scene; the word stands in
//! the x-z plane. Body: x forward, y left, z up. Camera: x right, y down, z forward; image origin
//! top left, pixel centers at +0.5. Transforms read `to_from`. Every public scalar has its unit in
//! its name.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

pub use noctograph_core::{
    camera, control, crazyflie, error, flight, geometry, lamps, strokes,
};
pub use noctograph_flying::{estimate, plan, sensors, sim, vehicle};
pub use noctograph_logs::identify;
pub use noctograph_picture::{expose, light, photo};
pub use noctograph_studio::{preflight, report, scene, shoot, study};
pub use {
    noctograph_export as export, noctograph_letters as letters, noctograph_locate as locate,
    noctograph_logs as logs, noctograph_score as score,
};

use noctograph_core::{digest, files, random, settings, srgb, statistics};

pub mod cli;
