//! Studio: scenes, and the one place where stages are chained; checks, studies and reports.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

pub mod preflight;
pub mod report;
pub mod scene;
pub mod shoot;
pub mod study;
