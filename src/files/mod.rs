//! Files: read up to a limit and no further; written whole or not at all.
//!
//! Every reader of the crate states a [`Limit`] and opens its file once, so that a pipe, a device or
//! an endless stream costs no more than a file of that size. Every writer stages its file beside
//! its place, see [`Output`] and [`OutputFolder`].

mod folder;
mod input;
mod lines;
mod output;
mod staging;

pub(crate) use folder::OutputFolder;
pub(crate) use input::Limit;
pub(crate) use lines::Lines;
pub(crate) use output::{Output, STANDARD_OUTPUT};
