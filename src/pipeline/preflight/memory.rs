//! Checks that trajectory and lights fit in the drone's memories.

use super::warn_if;
use crate::shoot::Shoot;
use noctograph_core::crazyflie::{RING_TIMING_ENTRIES, TRAJECTORY_MEMORY_BYTES};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Result};
use noctograph_core::lamps::RING;
use noctograph_export::lights::timing_entries;
use noctograph_export::poly4d::MAX_PIECES;
use noctograph_export::{Form, Length, Memory, memory};

/// Name of the check for the LED timing memory.
pub const LED_MEMORY: &str = "LED memory";

/// Returns the result "unknown" of a check, for a plan that cannot be exported.
fn not_exported(check: &'static str, error: &Error) -> Diagnostic {
    let wanted = "a plan that can be exported";
    Diagnostic::unchecked(check, error, wanted, "change what the export refuses")
}

/// Checks that the plan fits in the drone's trajectory memory, by its size in bytes if compressed,
/// and by its number of pieces as poly4d.
pub(super) fn check_memory(shoot: &Shoot, drone: usize) -> Diagnostic {
    let release = shoot.scene.vehicle.firmware;
    let memory = match memory(release, &shoot.designs()[drone]) {
        Ok(memory) => memory,
        Err(error) => return not_exported("memory", &error),
    };
    let Memory { bytes, flies_heading, pieces, formats, fits_all } = memory;
    // Each number above its limit is marked, and so is a heading that the firmware misreads.
    let [bytes_beyond, pieces_beyond] = [bytes > TRAJECTORY_MEMORY_BYTES, pieces > MAX_PIECES]
        .map(|is_beyond| if is_beyond { ", too many" } else { "" });
    let detail = formats.join(", ");
    let forms = match detail.as_str() {
        "" => "no export format accepts the plan".to_owned(),
        formats => format!("the plan can be exported as {formats}"),
    };
    let heading = if flies_heading {
        String::new()
    } else {
        format!(", a heading that firmware {} misreads", release.name())
    };
    let row = Diagnostic::check("memory", warn_if(!fits_all), bytes as f64).detailed(detail);
    row.within(TRAJECTORY_MEMORY_BYTES as f64).with("count", pieces).say(
        format!(
            "{bytes} of {TRAJECTORY_MEMORY_BYTES} bytes compressed{bytes_beyond}{heading}; {pieces} of \
             {MAX_PIECES} pieces as poly4d{pieces_beyond}; {forms}"
        ),
        format!(
            "{TRAJECTORY_MEMORY_BYTES} bytes and {MAX_PIECES} pieces on board, 50 setpoints per \
             second by radio"
        ),
        "export the plan in one of those formats, or divide the word between drones \
         ({plan.drones=2})",
    )
}

/// Checks that the LED timing memory can hold the lights of drone `drone`, counted from 0, if its
/// plan writes only with the ring.
pub(super) fn check_led_memory(shoot: &Shoot, drone: usize) -> Diagnostic {
    const MOST: usize = RING_TIMING_ENTRIES;
    let entries = match timing_entries_of(shoot, drone) {
        Ok(entries) => entries,
        Err(error) => return not_exported(LED_MEMORY, &error),
    };
    let severity = warn_if(entries.is_some_and(|n| n > MOST));
    Diagnostic::check(LED_MEMORY, severity, entries.map(|n| n as f64)).within(MOST as f64).say(
        entries.map_or("not used".into(), |n| format!("{n} of {MOST} entries")),
        format!("up to {MOST} entries"),
        "no change is needed if the script sends the light commands by radio, as it does in this \
         case; otherwise build firmware with a larger LEDRING_TIME_MEM_SIZE",
    )
}

/// Returns the number of LED timing entries for the lights of drone `drone`, timed by the exported
/// trajectory. Returns `None` if the drone writes with lamps other than the ring.
fn timing_entries_of(shoot: &Shoot, drone: usize) -> Result<Option<usize>> {
    if !shoot.plans[drone].plan.lamps().map(|(lamp, _)| lamp).eq([RING.name]) {
        return Ok(None);
    }
    let form = Form::Compressed;
    let exported = if shoot.designs.is_empty() {
        &shoot.as_exported(form, form.tolerance_m(), Length::Any)?
    } else {
        shoot
    };
    timing_entries(&exported.plans[drone].plan, &shoot.lamps())
}
