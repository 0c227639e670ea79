//! Whether goldens are written anew: `NOCTOGRAPH_BLESS=1`, and no other value.

use std::fmt::Display;
use std::io::Write as _;

/// Whether a golden is written anew instead of compared. Says so on the error stream itself, which
/// the test harness does not capture: a golden never moves in silence.
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
