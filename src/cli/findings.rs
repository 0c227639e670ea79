//! Findings of a check in words.

use super::report::wrapped;
use crate::export::poly4d::MAX_PIECES;
use crate::plan::check::{Check, Finding, Severity};
use crate::plan::{LightClock, MIN_HORIZONTAL_M, MIN_VERTICAL_M, PlanOptions, Style};

/// The table of findings, and what to change in plans that were made with some options.
pub(super) fn table(findings: &[Finding], options: &PlanOptions) -> String {
    let mut text = String::new();
    for finding in findings {
        let mark = match finding.severity {
            Severity::Fine => "ok",
            Severity::Unknown => "?",
            Severity::Warning => "warn",
            Severity::Stop => "STOP",
        };
        text += &wrapped(&format!("{mark:5} {:16} ", name(finding.check)), &numbered(finding));
        if finding.severity != Severity::Fine {
            let (wanted, change) = wanted(finding, options);
            text += &wrapped(&format!("{:23}wanted: ", ""), &wanted);
            text += &wrapped(&format!("{:23}change: ", ""), &change);
        }
    }
    text
}

/// A finding as JSON: its numbers, and its text in `found`, `wanted` and `change`.
pub(super) fn json(finding: &Finding, options: &PlanOptions) -> serde_json::Value {
    let mut json = serde_json::json!(finding);
    let (wanted, change) = wanted(finding, options);
    let change = if finding.severity == Severity::Fine { String::new() } else { change };
    (json["found"], json["wanted"], json["change"]) =
        (found(finding).into(), wanted.into(), change.into());
    json
}

/// What was found, behind the number of its drone where there are several.
fn numbered(finding: &Finding) -> String {
    let number = finding.drone.map_or_else(String::new, |drone| format!("drone {drone}: "));
    number + &found(finding)
}

/// The stops in one line; `None` where there are none.
pub(super) fn stops(findings: &[Finding]) -> Option<String> {
    let stops = findings.iter().filter(|finding| finding.severity == Severity::Stop);
    let stops: Vec<String> =
        stops.map(|stop| format!("{} ({})", name(stop.check), numbered(stop))).collect();
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
    if finding.severity == Severity::Unknown {
        return format!("not checked: {detail}");
    }
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
        Check::Volume => format!("{:.2} m or more from the sides of {detail}", -value + 0.0),
        Check::Speed => format!("{value:.2} m/s{at}"),
        Check::Acceleration => format!("{value:.2} m/s²{at}"),
        Check::VelocityStep => format!("setpoints change velocity by up to {value:.1} m/s²{at}"),
        Check::Jump if is_fine => "none".into(),
        Check::Jump => {
            format!("{} jumps of up to {value:.2} m{at}", finding.count.unwrap_or_default())
        }
        Check::FlightTime => format!("{value:.0} s in the air"),
        Check::Memory => memory(finding),
        Check::LedMemory if finding.value.is_none() => "not used".into(),
        Check::LedMemory => format!("{value} of {} entries", finding.limit),
        Check::Headlights if finding.value.is_none() => "not used".into(),
        Check::Headlights if is_fine => "switched on and off, not dimmed".into(),
        Check::Headlights => format!("dimmed by {value} commands, first{at}"),
        Check::Separation if finding.value.is_none() => "always above each other".into(),
        Check::Separation => format!("{value:.2} m or more apart sideways, least{at}"),
        Check::Flight => detail.clone(),
        Check::Corridor => format!("strays to y = {value:+.2} m{at}"),
        Check::AltitudeHold => format!("precise enough for letters of {value:.2} m or more"),
        Check::Tilt => format!("{:.1}°{at}", value.to_degrees()),
        Check::Motors if value == 0.0 => "never at their limit".into(),
        Check::Motors => format!("{:.0} ms at their limit, first{at}", 1e3 * value),
        Check::Battery if is_fine => "lasts".into(),
        Check::Battery => detail.clone(),
        Check::LitTransit => lit_transit(finding),
        Check::LitDwell if value > 0.0 => {
            format!("{:.0} ms of light two stops over the rest{at}", 1e3 * value)
        }
        Check::LitDwell => "none".into(),
        Check::Evenness => format!("exposure varies by {value:.1} stops along the trail"),
        Check::Coverage => {
            format!("{:.1} % of the flight's box is seen by two base stations", 100.0 * value)
        }
        Check::Picture if is_fine => "shows the word while it is written".into(),
        Check::Picture => of_picture(detail).0.to_owned(),
    }
}

/// What hides the word, and its remedy, which such a text names after its last colon.
fn of_picture(detail: &str) -> (&str, &str) {
    match detail.rsplit_once(": ") {
        Some(parts) => parts,
        None if detail.contains("base stations") => {
            (detail, "move the base stations, or the word (see `coverage`)")
        }
        None => (detail, "see `preview`; --camera auto frames the word"),
    }
}

/// How far the light is off at the end of a stroke where it is farthest.
fn lit_transit(finding: &Finding) -> String {
    let (off_m, end) = (finding.value.unwrap_or(0.0), &finding.detail);
    let at = finding.time_s.map_or(String::new(), |time_s| format!(" at {time_s:.1} s"));
    let [x, _, z] = finding.position_m.unwrap_or_default();
    let what = match (off_m > 0.0, end == "beginning") {
        (true, true) => "light before a stroke begins",
        (true, false) => "light after a stroke ends",
        (false, true) => "a stroke's beginning without light",
        (false, false) => "a stroke's end without light",
    };
    format!("up to {:.0} mm of {what}{at} ({x:.2}, {z:.2})", 1e3 * off_m.abs())
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

/// Limit, and what to change beyond it or, where it was not checked, to have it checked.
fn wanted(finding: &Finding, options: &PlanOptions) -> (String, String) {
    let limit = finding.limit;
    let is_even = matches!(options.style, Style::Even(_));
    let (wanted, change) = match finding.check {
        check if finding.severity == Severity::Unknown => to_check(check),
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
            "letters that begin or end in the dark".into(),
            "write with --font ae483-fixed, or plan with --style even",
        ),
        Check::PenJump => (
            "moves that begin where the last one ended".into(),
            "write with --font ae483-fixed, or plan with --style even",
        ),
        Check::Volume => (
            format!("inside {}", finding.detail),
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
            match is_even {
                true => "write fewer letters, or with --drones 2",
                false => "write fewer letters, faster (--style even), or with --drones 2",
            },
        ),
        Check::Memory => (
            format!(
                "{limit} bytes and {MAX_PIECES} pieces on board, 50 setpoints a second by radio"
            ),
            "export it in one of those forms, or share the word (--drones 2)",
        ),
        Check::LedMemory => (
            format!("up to {limit} entries"),
            "nothing where the radio sends the lights, as the script then does; else build firmware \
             with a larger LEDRING_TIME_MEM_SIZE",
        ),
        Check::Headlights => (
            "on or off: headlights cannot be dimmed".into(),
            "set plan.style.exposure = \"switched\", or write with lamps that can be dimmed",
        ),
        Check::Separation => (
            format!("{MIN_HORIZONTAL_M} m sideways, or {MIN_VERTICAL_M} m above each other"),
            "let the later drone wait (plan.floor_wait_s), or plan with --drones",
        ),
        Check::Flight => ("a flight to its end".into(), "see the message; tune the controller"),
        Check::Corridor => (
            format!("within ±{limit} m"),
            "take the mean error off (plan --after FLIGHT), or fly lqr-integral",
        ),
        Check::AltitudeHold => (
            format!("error of the height up to {:.0} mm, a twentieth of the letters", 50.0 * limit),
            "write larger letters (letters.cap_height_m), or fly a better height sensor",
        ),
        Check::Tilt => (
            format!("up to {:.0}°", limit.to_degrees()),
            "lower plan.style.acceleration_m_s2 or jerk_m_s3; check that the plan has no jump",
        ),
        Check::Motors => (
            format!("up to {:.0} ms at their limit", 1e3 * limit),
            "lower plan.style.acceleration_m_s2, or fly a drone with more thrust for its weight",
        ),
        Check::Battery => {
            ("a battery that lasts".into(), "write fewer letters, or share them (--drones 2)")
        }
        Check::LitTransit => (
            format!("within {:.0} mm of strokes' ends, a tenth of the letters", 1e3 * limit),
            match options.light_clock {
                LightClock::Light => "slow down (plan.stroke_speed_m_s)",
                LightClock::Setpoint => {
                    "set plan.light_clock = \"light\", or slow down (plan.stroke_speed_m_s)"
                }
            },
        ),
        Check::LitDwell => (
            format!("less than {:.0} ms of it", 1e3 * limit),
            match (is_even, options.light_clock) {
                (true, _) => {
                    "lower plan.stroke_speed_m_s, so that the drone need not brake, or dim the \
                     light with the speed (plan.style.exposure = \"dimmed\", for a ring or a color \
                     LED)"
                }
                (false, LightClock::Setpoint) => {
                    "plan with --style even, or set plan.light_clock = \"light\""
                }
                (false, LightClock::Light) => "plan with --style even",
            },
        ),
        Check::Evenness => (
            format!(
                "within {limit:.0} stops, from the 5th to the 95th percentile, as `meter` reads"
            ),
            "turn the writing lamp to the camera (light.fixtures), or write slower \
             (plan.stroke_speed_m_s)",
        ),
        Check::Coverage => (
            "two Lighthouse stations see every place".into(),
            "move the word or the stations (see `coverage`)",
        ),
        Check::Picture => (
            "the whole word in the picture, lit while the shutter is open".into(),
            of_picture(&finding.detail).1,
        ),
    };
    (wanted, change.to_owned())
}

/// What has to be known for a check, and how to say it.
fn to_check(check: Check) -> (String, &'static str) {
    let (wanted, change) = match check {
        Check::DoubledStroke => ("the word that the plans write", "name it: --word WORD"),
        Check::AltitudeHold => {
            ("letters of a known height, not a drawing", "name the word of the plans: --word WORD")
        }
        Check::Battery => {
            ("a drone with a battery", "name a preset with one, such as `--scene cf21`")
        }
        Check::LitTransit | Check::LitDwell | Check::Evenness => {
            ("light along the strokes", "check plan.lights, light.deck and light.ring")
        }
        Check::Coverage => (
            "base stations, and a flight for them to see",
            "name the stations with --lighthouse FILE, or under sensors.lighthouse.stations",
        ),
        Check::Picture => {
            ("flights that end, and letters", "mend what stops the flight; plan a word")
        }
        _ => ("a plan that can be exported", "change what the export refuses"),
    };
    (wanted.to_owned(), change)
}
