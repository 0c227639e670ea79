//! Findings of a check in words.

use super::report::wrapped;
use crate::export::poly4d::MAX_PIECES;
use crate::plan::check::{Check, Finding, Severity};

/// The table of findings, and what to change.
pub(super) fn table(findings: &[Finding]) -> String {
    let mut text = String::new();
    for finding in findings {
        let mark = match finding.severity {
            Severity::Fine => "ok",
            Severity::Unknown => "?",
            Severity::Warning => "warn",
            Severity::Stop => "STOP",
        };
        text += &wrapped(&format!("{mark:5} {:16} ", name(finding.check)), &found(finding));
        if finding.severity != Severity::Fine {
            let (wanted, change) = wanted(finding);
            text += &wrapped(&format!("{:23}wanted: ", ""), &wanted);
            text += &wrapped(&format!("{:23}change: ", ""), change);
        }
    }
    text
}

/// A finding as JSON: its numbers, and its text in `found`, `wanted` and `change`.
pub(super) fn json(finding: &Finding) -> serde_json::Value {
    let mut json = serde_json::json!(finding);
    let (wanted, change) = wanted(finding);
    let change = if finding.severity == Severity::Fine { "" } else { change };
    (json["found"], json["wanted"], json["change"]) =
        (found(finding).into(), wanted.into(), change.into());
    json
}

/// The stops in one line; `None` where there are none.
pub(super) fn stops(findings: &[Finding]) -> Option<String> {
    let stops = findings.iter().filter(|finding| finding.severity == Severity::Stop);
    let stops: Vec<String> =
        stops.map(|stop| format!("{} ({})", name(stop.check), found(stop))).collect();
    (!stops.is_empty()).then(|| stops.join("; "))
}

fn name(check: Check) -> String {
    let name = serde_json::json!(check);
    name.as_str().unwrap_or_default().to_owned()
}

fn found(finding: &Finding) -> String {
    let value = finding.value.unwrap_or(0.0);
    let at = finding.time_s.map_or(String::new(), |time_s| format!(" at {time_s:.1} s"));
    let [x, y, z] = finding.position_m.unwrap_or_default();
    let detail = &finding.detail;
    let is_fine = finding.severity == Severity::Fine;
    match finding.check {
        Check::DoubledStroke
        | Check::LostStroke
        | Check::Tail
        | Check::LightNeverOff
        | Check::PenJump
            if is_fine =>
        {
            "none".into()
        }
        Check::DoubledStroke | Check::LostStroke if detail.contains(',') => {
            format!("{detail} (up to {value:.2} m)")
        }
        Check::DoubledStroke | Check::LostStroke => format!("{detail} ({value:.2} m)"),
        Check::Tail | Check::LightNeverOff | Check::PenJump => detail.clone(),
        Check::Volume if value > 0.0 => {
            format!("{value:.2} m outside{at} ({x:.2}, {y:.2}, {z:.2})")
        }
        Check::Volume => format!("inside by {:.2} m", -value + 0.0),
        Check::Speed => format!("{value:.2} m/s{at}"),
        Check::Acceleration => format!("{value:.2} m/s²{at}"),
        Check::VelocityStep => format!("velocity steps like {value:.1} m/s²{at}"),
        Check::Jump if is_fine => "none".into(),
        Check::Jump => {
            format!("{} of them, up to {value:.2} m{at}", finding.count.unwrap_or_default())
        }
        Check::FlightTime => format!("{value:.0} s in the air"),
        Check::Memory if finding.value.is_none() => detail.clone(),
        Check::Memory => memory(finding),
        Check::LedMemory if value <= 1.0 => "not used".into(),
        Check::LedMemory => format!("{value} entries"),
        Check::Headlights if is_fine => "on or off".into(),
        Check::Headlights => format!("dimmed by {value} commands, first{at}"),
        Check::Separation if is_fine => "apart all the time".into(),
        Check::Separation => format!("{value:.2} m beside each other{at}"),
        Check::Flight => detail.clone(),
        Check::Corridor => format!("y = {value:+.2} m{at}"),
        Check::AltitudeHold => format!("good for letters from {value:.2} m"),
        Check::Tilt => format!("{:.1}°{at}", value.to_degrees()),
        Check::Motors if is_fine => "never".into(),
        Check::Motors => format!("{value:.2} s at the limit, first{at}"),
        Check::Battery if is_fine => "lasts".into(),
        Check::Battery if detail.is_empty() => "this drone's is not modeled".into(),
        Check::Battery => detail.clone(),
        Check::LitTransit if finding.value.is_none() => "no stroke".into(),
        Check::LitTransit => {
            let side = if value > 0.0 { "beyond" } else { "short of" };
            format!("{:.0} mm {side} the {detail}{at} ({x:.2}, {z:.2})", 1e3 * value.abs())
        }
        Check::LitDwell if value > 0.0 => format!("{value:.2} s{at}"),
        Check::LitDwell => "none".into(),
        Check::Evenness => format!("{:.1} % within half a stop", 100.0 * value),
        Check::Coverage if finding.value.is_none() => "the scene has no base stations".into(),
        Check::Coverage => format!("{:.1} % of the flight's box is seen", 100.0 * value),
        Check::Picture if is_fine => "shows the word while it is written".into(),
        Check::Picture => detail.clone(),
    }
}

/// Bytes and pieces, each of as many as the drone's memory holds.
fn memory(finding: &Finding) -> String {
    let (bytes, pieces) = (finding.value.unwrap_or(0.0), finding.count.unwrap_or_default());
    let beyond = |is: bool| if is { ", too many" } else { "" };
    let formats = match finding.detail.as_str() {
        "" => "no form of export takes it".to_owned(),
        formats => format!("it can be exported as {formats}"),
    };
    format!(
        "{bytes} of {} bytes compressed{}; {pieces} of {MAX_PIECES} pieces as poly4d{}; {formats}",
        finding.limit,
        beyond(bytes > finding.limit),
        beyond(pieces > MAX_PIECES)
    )
}

/// Limit, and what to change beyond it.
fn wanted(finding: &Finding) -> (String, &'static str) {
    let limit = finding.limit;
    let (wanted, change) = match finding.check {
        Check::DoubledStroke => {
            ("every line drawn once".into(), "write with --font ae483-fixed or simplex")
        }
        Check::LostStroke => (
            "every stroke of the typeface drawn".into(),
            "write with --font simplex or a plainer typeface",
        ),
        Check::Tail => (
            "letters reached in the dark".into(),
            "write with --font ae483-fixed, or plan with --style even",
        ),
        Check::LightNeverOff => (
            "a dark move at an end".into(),
            "write with --font ae483-fixed, or plan with --style even",
        ),
        Check::PenJump => {
            ("moves that join".into(), "write with --font ae483-fixed, or plan with --style even")
        }
        Check::Volume => (
            "inside the profile's volume".into(),
            "write smaller letters or fewer (letters.canvas_m, cap_height_m, baseline_m)",
        ),
        Check::Speed => (
            format!("up to {limit} m/s"),
            "lower plan.style.dark_speed_m_s or plan.stroke_speed_m_s",
        ),
        Check::Acceleration => {
            (format!("up to {limit} m/s²"), "lower plan.style.acceleration_m_s2")
        }
        Check::VelocityStep => (format!("up to {limit} m/s²"), "plan with --style even"),
        Check::Jump => (
            format!("setpoints within {limit} m of the design"),
            "plan with --style even, whose design is continuous",
        ),
        Check::FlightTime => (
            format!("up to {limit:.0} s in the air"),
            "write fewer letters, faster (--style even), or with --drones 2",
        ),
        Check::Memory => (
            format!("{limit} bytes or {MAX_PIECES} pieces on board"),
            "share the word among --drones, or send positions: `export --to cflib`",
        ),
        Check::LedMemory => (
            format!("{limit} in the LED timing memory"),
            "send light commands over the radio, or build firmware with a larger \
             LEDRING_TIME_MEM_SIZE",
        ),
        Check::Headlights => (
            "on or off: a pin".into(),
            "set plan.style.exposure = \"switched\", or write with lamps that can be dimmed",
        ),
        Check::Separation => (
            "0.3 m sideways, or 0.9 m above".into(),
            "let the later drone wait (plan.floor_wait_s), or plan with --drones",
        ),
        Check::Flight => ("a flight to its end".into(), "see the message; tune the controller"),
        Check::Corridor => (
            format!("within ±{limit} m"),
            "take the mean error off (plan --after FLIGHT), or fly lqr-integral",
        ),
        Check::AltitudeHold => (
            format!("letters of {limit} m, twenty times the error of the height"),
            "write larger letters (letters.cap_height_m), or fly a better sensor of the height",
        ),
        Check::Tilt => (
            format!("up to {:.0}°", limit.to_degrees()),
            "lower plan.style.acceleration_m_s2 or jerk_m_s3; check that the plan has no jump",
        ),
        Check::Motors => (
            "commands within their range".into(),
            "lower plan.style.acceleration_m_s2, or fly a lighter drone (the team's hovers at 67 %)",
        ),
        Check::Battery if finding.severity == Severity::Unknown => {
            ("thrust to the end".into(), "name a preset with a battery, such as cf21")
        }
        Check::Battery => {
            ("thrust to the end".into(), "write fewer letters, or share them (--drones 2)")
        }
        Check::LitTransit => (
            format!("within {:.0} mm of strokes' ends, a tenth of the letters", 1e3 * limit),
            "slow down (plan.stroke_speed_m_s); in style team also set plan.light_clock = \"light\"",
        ),
        Check::LitDwell => (
            format!("below {limit} s of light two stops over the rest"),
            "plan with --style even; in style team, set plan.light_clock = \"light\"",
        ),
        Check::Evenness => (
            format!("{:.0} % of the lit length", 100.0 * limit),
            "set plan.style.exposure = \"dimmed\", or a lower plan.stroke_speed_m_s",
        ),
        Check::Coverage if finding.value.is_none() => (
            "two Lighthouse stations see every place".into(),
            "name them with --lighthouse FILE, or under sensors.lighthouse.stations",
        ),
        Check::Coverage => (
            "two Lighthouse stations see every place".into(),
            "move the word or the stations (see `coverage`)",
        ),
        Check::Picture => (
            "the word in the picture, lit, the shutter open".into(),
            "as the finding says, or --camera auto",
        ),
    };
    (wanted, change)
}
