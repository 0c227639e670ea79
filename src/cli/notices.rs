//! `noctograph notices` prints the licenses of the built-in packages.

use clap::Args;

use super::outcome::Report;
use crate::error::Result;
use serde_json::json;

/// License texts, which `tests/notices --write` generates from Cargo.lock.
const NOTICES: &str = include_str!("notices.txt");

#[derive(Debug, Args)]
pub(super) struct NoticesArgs {}

#[expect(clippy::unnecessary_wraps, reason = "a verb")]
pub(super) fn run(_: &NoticesArgs) -> Result<Report> {
    Ok(Report::new(NOTICES.to_owned(), json!({ "notices": NOTICES })))
}
