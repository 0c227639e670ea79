//! Tests through the front door: the command, the golden images, and claims about the whole road.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod camera;
mod cli;
mod compare;
mod compare_flights;
mod coverage;
mod dialects;
mod digests;
mod faults;
mod golden;
mod letters;
mod photos;
mod plan;
mod road;
mod study;
mod team_log;
mod twins;
