//! Prints results on stdout and messages on stderr. Warnings are also kept for the JSON object of
//! the running verb.

use std::cell::{Cell, RefCell};
use std::io::Write;

use super::printer::wrapped;
use crate::error::{Error, Result};

/// Prints a result on standard output, and flushes it. A closed pipe is not an error, because
/// programs like `head` stop reading early.
pub(super) fn print_out(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    // Stdout is flushed here, because a write error during exit would be lost.
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(source) if source.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::write("standard output".as_ref(), source))
        }
        _ => Ok(()),
    }
}

/// Escapes the control characters in a text as in Rust source code. See [`escaped`].
pub(super) fn printable(text: &str) -> String {
    escaped(text, |code| format!("\\u{{{code:x}}}"))
}

/// Replaces control characters, and characters that change the direction of text, by the result of
/// `escape`, because names from foreign files must not control a terminal. Keeps line ends and
/// tabs.
pub(super) fn escaped(text: &str, escape: impl Fn(u32) -> String) -> String {
    // The ranges contain the embeddings, overrides and isolates of the bidirectional algorithm.
    let is_control = |c: char| {
        (c.is_control() && c != '\n' && c != '\t')
            || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    text.chars().map(|c| if is_control(c) { escape(c.into()) } else { c.to_string() }).collect()
}

/// Prefix of a warning on stderr.
const WARNING: &str = "warning: ";

thread_local! {
    /// Warnings that the running verb has printed so far.
    static WARNED: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
    /// True if messages are kept instead of printed, for a caller that displays them.
    static IS_QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Returns the warnings printed so far, and clears them.
pub(super) fn take_warnings() -> Vec<String> {
    WARNED.take()
}

/// Runs `work` and keeps its messages instead of printing them. Returns the result of `work`.
pub(super) fn quietly<T>(work: impl FnOnce() -> T) -> T {
    IS_QUIET.set(true);
    let product = work();
    IS_QUIET.set(false);
    product
}

/// Prints a message on stderr, wrapped at 80 columns, after the prefix `head`. A warning is also
/// kept for the JSON object. While [`quietly`] runs, every message is kept instead of printed. A
/// failure to print is ignored, because it cannot be reported anywhere.
pub(super) fn message(head: &str, text: &str) {
    if head == WARNING || IS_QUIET.get() {
        WARNED.with_borrow_mut(|warned| warned.push(text.to_owned()));
    }
    if IS_QUIET.get() {
        return;
    }
    let _ = std::io::stderr().write_all(wrapped(head, &printable(text)).as_bytes());
}

/// Prints warnings on stderr, and keeps them for the JSON object.
pub(super) fn warn(warnings: impl IntoIterator<Item: ToString>) {
    warnings.into_iter().for_each(|warning| message(WARNING, &warning.to_string()));
}
