//! Tests through the front door: the command, the golden images, and claims about the whole road.

mod cli;
mod compare;
mod coverage;
mod golden;
mod road;
