//! Studio: scenes, and the one place where stages are chained; checks, studies and reports.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

use noctograph_core::{
    camera, control, crazyflie, digest, error, files, flight, geometry, random, settings, srgb,
    statistics,
};
use noctograph_flying::{plan, sensors, sim, vehicle};
use noctograph_logs::identify;
use noctograph_picture::{expose, light, photo};
use {
    noctograph_export as export, noctograph_letters as letters, noctograph_logs as logs,
    noctograph_score as score,
};

pub mod preflight;
pub mod report;
pub mod scene;
pub mod shoot;
pub mod study;
