//! Integration tests of the command and of the library.
//!
//! Two environment variables control the tests. With `NOCTOGRAPH_REQUIRE_GPU`, a missing graphics
//! device is a failure. `NOCTOGRAPH_BLESS=1` rewrites the golden files.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::disallowed_methods, reason = "a test reads what it wrote")]

mod answer_types;
mod bless;
mod camera;
mod cli;
mod compare;
mod compare_flights;
mod cooperation;
mod course;
mod coverage;
mod dialects;
mod digests;
mod examples;
mod exports;
mod faults;
mod follow;
mod foreign;
mod golden;
mod hostile;
mod json;
mod letters;
mod limits;
mod locate;
mod log_gaps;
mod obstacles;
mod outputs;
mod pairs;
mod photos;
mod plan;
mod readme;
mod reference_flight;
mod report;
mod road;
mod safety;
mod second_flight;
mod serve;
mod setups;
mod study;
mod team_data;
mod twins;
mod words;

/// True if a missing graphics device is a failure. Otherwise the checks that need one are skipped.
fn gpu_required() -> bool {
    std::env::var_os("NOCTOGRAPH_REQUIRE_GPU").is_some()
}
