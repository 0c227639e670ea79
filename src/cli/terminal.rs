//! The terminal: results on stdout, messages on stderr. Warnings are also kept for the JSON object
//! of the running verb.

use std::cell::{Cell, RefCell};
use std::io::Write;

use super::printer::wrapped;
use crate::error::{Error, Result};

/// Prints a result on stdout. It is not an error if the reader went away, as `head` does.
pub(super) fn print_out(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    // Flushed here, as an error on exit would be lost.
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(source) if source.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::write("standard output".as_ref(), source))
        }
        _ => Ok(()),
    }
}

/// Escapes the control characters of a text.
pub(super) fn printable(text: &str) -> String {
    escaped(text, |code| format!("\\u{{{code:x}}}"))
}

/// Escapes control characters, and characters that change the direction of writing, by `escape`:
/// names from foreign files must not control a terminal. Line ends and tabs stay.
pub(super) fn escaped(text: &str, escape: impl Fn(u32) -> String) -> String {
    let steers = |c: char| {
        (c.is_control() && c != '\n' && c != '\t')
            || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    text.chars().map(|c| if steers(c) { escape(c.into()) } else { c.to_string() }).collect()
}

/// Prefix of a warning.
const WARNING: &str = "warning: ";

thread_local! {
    /// Warnings of the running verb.
    static WARNED: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
    /// True if messages are kept and not printed, for a caller that shows them.
    static IS_QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Returns the warnings so far, and forgets them.
pub(super) fn take_warnings() -> Vec<String> {
    WARNED.take()
}

/// Runs work whose messages are kept, not printed.
pub(super) fn quietly<T>(work: impl FnOnce() -> T) -> T {
    IS_QUIET.set(true);
    let product = work();
    IS_QUIET.set(false);
    product
}

/// Prints a message on stderr within 80 columns. A failure to do so cannot be reported anywhere.
pub(super) fn message(head: &str, text: &str) {
    if head == WARNING || IS_QUIET.get() {
        WARNED.with_borrow_mut(|warned| warned.push(text.to_owned()));
    }
    if IS_QUIET.get() {
        return;
    }
    let _ = std::io::stderr().write_all(wrapped(head, &printable(text)).as_bytes());
}

/// Prints warnings.
pub(super) fn warn(warnings: impl IntoIterator<Item: ToString>) {
    warnings.into_iter().for_each(|warning| message(WARNING, &warning.to_string()));
}
