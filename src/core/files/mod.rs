//! Reads files up to a size limit, and writes files either completely or not at all.
//!
//! Every reader states a [`Limit`] and opens its file once, so that a pipe, a device or an endless
//! stream costs no more than a file of that size. Decoded data is charged to a [`Budget`]. Every
//! writer stages its file in the same folder, as [`Output`] and [`OutputFolder`] describe.

#[cfg(target_family = "wasm")]
mod brought;
mod budget;
mod csv_cell;
mod csv_reader;
#[expect(clippy::disallowed_methods, reason = "copies what this program wrote")]
mod folder;
#[expect(clippy::disallowed_methods, reason = "the one place that opens foreign files")]
mod input;
mod jpeg;
mod names;
mod output;
#[expect(clippy::disallowed_methods, reason = "locks")]
mod staging;
mod text;
mod titles;

#[cfg(target_family = "wasm")]
pub use brought::bring;
pub use budget::{Budget, push};
pub use csv_reader::{Head, RowRules, Separator, Sheet, SheetColumn};
pub use folder::OutputFolder;
pub use input::{Limit, entries_in, files_in};
pub use jpeg::JpegFrame;
pub use names::{as_spelled, ending, file_name, is_file_name, path_from, relative_name};
pub use output::{Buffer, Output, STANDARD_OUTPUT, WholeFile};
pub use staging::folder_in;
pub use text::Text;
pub use titles::{DEGREE, bracketed, simplified, unit};
