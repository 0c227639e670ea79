//! Golden files are rewritten only if `NOCTOGRAPH_BLESS` is `1`.

use std::fmt::Display;
use std::io::Write as _;

/// True if a golden file is to be rewritten instead of compared. If it is, a message is written
/// directly to stderr, which the test harness does not capture, so that a golden file never changes
/// silently.
pub(crate) fn is_blessed(golden: impl Display) -> bool {
    let Some(value) = std::env::var_os("NOCTOGRAPH_BLESS") else { return false };
    let is_blessed = value == "1";
    let said = match is_blessed {
        true => format!("NOCTOGRAPH_BLESS=1: {golden} is written anew"),
        false => format!("NOCTOGRAPH_BLESS={}: only 1 blesses {golden}", value.display()),
    };
    writeln!(std::io::stderr(), "{said}").expect("the error stream is open");
    is_blessed
}
