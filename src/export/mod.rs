//! Export: a plan becomes files that drones and other programs take.
//!
//! Product in: [`crate::plan::Plan`]. Product out: a file's bytes, one module a format. SI units and
//! radians up to the last line of each format.

pub mod cflib;
pub mod compressed;
pub mod lights;
mod pieces;
pub mod poly4d;
