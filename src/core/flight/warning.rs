//! Warnings about a flight.

use std::collections::BTreeSet;

use super::Quantity;
use crate::diagnostic::Diagnostic;

/// Code of the warning that a log lacks quantities.
pub const UNLOGGED: &str = "unlogged";
/// Code of the warning that fewer than two base stations saw the drone for `lasts_s` seconds.
pub const UNSEEN: &str = "unseen";
/// Codes of the warnings that the battery cannot provide the thrust, and that it is empty.
pub const BATTERY: [&str; 2] = ["battery-weak", "battery-empty"];

/// Creates the warning that a motor was at its limit while the drone wrote.
pub fn motor_at_limit(lasts_s: f64) -> Diagnostic {
    let message = format!(
        "a motor was at its limit for {lasts_s:.2} s while the drone was \
                           writing"
    );
    Diagnostic::warning("motor-at-limit", message).with("lasts_s", lasts_s)
}

/// Creates the warning that the battery could not provide the required thrust.
pub fn battery_weak(lasts_s: f64) -> Diagnostic {
    let message = format!("the battery could not provide the required thrust for {lasts_s:.2} s");
    Diagnostic::warning(BATTERY[0], message).with("lasts_s", lasts_s)
}

/// Creates the warning that the battery was empty and the motors stopped.
pub fn battery_empty() -> Diagnostic {
    Diagnostic::warning(BATTERY[1], "the battery was empty and the motors stopped")
}

/// Creates the warning that fewer than two base stations saw the drone for `lasts_s` in total.
pub fn unseen(lasts_s: f64) -> Diagnostic {
    let message = format!("fewer than two base stations saw the drone for {lasts_s:.2} s");
    Diagnostic::warning(UNSEEN, message)
        .with("lasts_s", lasts_s)
        .helped("move the base stations, or the word (see `coverage`)")
}

/// Creates the warning that the motors stopped because no setpoint arrived.
pub fn host_silent(stopped_s: f64) -> Diagnostic {
    let message = format!("no setpoint arrived for 2 s, so the motors stopped at {stopped_s:.1} s");
    Diagnostic::warning("host-silent", message).with("time_s", stopped_s)
}

/// Creates the warning that the drone stayed on the floor although its plan rises.
/// `largest_command` is that of all motors, in 1/65535 of the range.
pub fn grounded(largest_command: f64) -> Diagnostic {
    let message = format!(
        "the drone never left the floor: its motor commands reach {largest_command:.1} of 65535 (are they \
         rpm, N or 0 to 1; are lengths in m with z up, and angles in rad?)"
    );
    Diagnostic::warning("grounded", message).with("motors", largest_command)
}

/// Creates the warning that a log lacks quantities, or returns `None` if no quantity is missing.
pub fn unlogged(quantities: &BTreeSet<Quantity>) -> Option<Diagnostic> {
    let names: Vec<&str> = quantities.iter().map(|quantity| quantity.name()).collect();
    let message = format!("not in the log: {}", names.join(", "));
    (!names.is_empty()).then(|| Diagnostic::warning(UNLOGGED, message))
}
