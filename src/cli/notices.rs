//! `noctograph notices`: licenses of the packages that are built in.

use clap::Args;

use super::outcome::Report;
use crate::error::Result;
use serde_json::json;

/// Made from the lock by `tests/notices --write`.
const NOTICES: &str = include_str!("notices.txt");

#[derive(Debug, Args)]
pub(super) struct NoticesArgs {}

#[expect(clippy::unnecessary_wraps, reason = "a verb")]
pub(super) fn run(_: &NoticesArgs) -> Result<Report> {
    Ok(Report::new(NOTICES.to_owned(), json!({ "notices": NOTICES })))
}
