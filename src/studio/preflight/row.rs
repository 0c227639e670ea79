//! Findings as rows of a table: numbers, how bad they are, what is wanted, and what to change.

use serde::Serialize;

use super::finding::OutOfRoom;
use super::flown::MAX_SATURATED_S;
use super::letters::SHORT_M;
use super::{Finding, Peak, Severity};
use crate::scene::{Change, SceneAdvice};
use noctograph_core::crazyflie::TRAJECTORY_MEMORY_BYTES;
use noctograph_core::flight::{DroneIndex, Warning};
use noctograph_export::Memory;
use noctograph_export::poly4d::MAX_PIECES;
use noctograph_export::safety::{Battery, FRAME_M, LOW_BATTERY_S};
use noctograph_flying::plan::{
    LightClock, MIN_HORIZONTAL_M, MIN_VERTICAL_M, PlanOptions, StrokeEnd, Style,
};

/// A finding of one drone, or of all.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Checked {
    /// The drone, where there are several and it concerns one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drone: Option<DroneIndex>,
    /// What was found.
    #[serde(skip)]
    pub finding: Finding,
    /// Its numbers and sentences.
    #[serde(flatten)]
    pub row: Row,
}

impl Checked {
    /// What was found, behind the number of its drone where there are several.
    #[must_use]
    pub fn found(&self) -> String {
        let number = self.drone.map_or_else(String::new, |drone| format!("drone {drone}: "));
        number + &self.row.found
    }

    /// A mark of how bad it is, the check, and what was found; what is wanted and what to change,
    /// with each change as `typed` writes it, are empty where nothing has to.
    pub fn cells(&self, typed: impl Fn(&Change) -> String) -> [String; 5] {
        let row = &self.row;
        let (mark, wanted) = match row.severity {
            Severity::Fine => ("ok", ""),
            Severity::Unknown => ("?", &*row.wanted),
            Severity::Warning => ("warn", &*row.wanted),
            Severity::Stop => ("STOP", &*row.wanted),
        };
        [mark.into(), row.check.into(), self.found(), wanted.into(), row.change(typed)]
    }
}

/// A finding as a row of a table: its numbers and its sentences.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// Name of the check.
    pub check: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// Measured value in the unit of the check; `None` where there is none.
    pub value: Option<f64>,
    /// Limit of the value; 0 where there is none.
    pub limit: f64,
    /// Number of occurrences, where they are counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub count: Option<usize>,
    /// When the value occurs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// Where it occurs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f64; 3]>,
    /// What the value is of: letters, a volume, forms of export, an end of a stroke; or why.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub detail: String,
    /// What was found.
    pub found: String,
    /// The limit in words.
    pub wanted: String,
    /// What to change beyond the limit.
    #[serde(skip)]
    pub advice: SceneAdvice,
}

impl Row {
    /// What to change, with each change as `typed` writes it; empty where nothing has to.
    pub fn change(&self, typed: impl Fn(&Change) -> String) -> String {
        match self.severity {
            Severity::Fine => String::new(),
            _ => self.advice.sentence(typed),
        }
    }

    fn of(check: &'static str, severity: Severity, value: impl Into<Option<f64>>) -> Self {
        Self { check, severity, value: value.into(), ..Self::default() }
    }

    /// What was found and wanted, and what to change.
    fn say(
        self,
        found: impl Into<String>,
        wanted: impl Into<String>,
        advice: &'static str,
    ) -> Self {
        Self { found: found.into(), wanted: wanted.into(), advice: SceneAdvice(advice), ..self }
    }
}

impl Peak {
    fn row(&self, check: &'static str, severity: Severity) -> Row {
        Row { limit: self.most, time_s: self.time_s, ..Row::of(check, severity, self.value) }
    }
}

fn at(time_s: impl Into<Option<f64>>) -> String {
    time_s.into().map_or(String::new(), |time_s| format!(" at {time_s:.1} s"))
}

fn warn_if(bad: bool) -> Severity {
    if bad { Severity::Warning } else { Severity::Fine }
}

fn stop_if(bad: bool) -> Severity {
    if bad { Severity::Stop } else { Severity::Fine }
}

impl Finding {
    /// Numbers and sentences; what to change depends on how the plans were made.
    pub(super) fn row(&self, plan: &PlanOptions) -> Row {
        let is_even = matches!(plan.style, Style::Even(_));
        match self {
            Self::Unchecked { check, why, wanted, advice } => {
                let row = Row::of(check, Severity::Unknown, None);
                let row = Row { detail: why.clone(), ..row };
                row.say(format!("not checked: {why}"), *wanted, advice.0)
            }
            Self::DoubledStroke(letters) => lengths(
                "doubled stroke",
                letters,
                SHORT_M,
                "every line drawn once",
                "write with {letters.font=ae483-fixed} or simplex",
            ),
            Self::LostStroke(letters) => lengths(
                "lost stroke",
                letters,
                0.0,
                "every stroke of the typeface drawn",
                "write with {letters.font=simplex} or a plainer typeface",
            ),
            Self::Tail(letters) => faults("tail", letters, "letters reached in the dark"),
            Self::LightNeverOff(letters) => {
                faults("light never off", letters, "letters that begin or end in the dark")
            }
            Self::PenJump(letters) => {
                faults("pen jump", letters, "moves that begin where the last one ended")
            }
            Self::Volume { outside_m, time_s, position_m, volume } => {
                let ([x, y, z], at) = (position_m.unwrap_or_default(), at(*time_s));
                let (time_s, position_m, detail) = (Some(*time_s), *position_m, volume.clone());
                let row = Row::of("volume", stop_if(*outside_m > 1e-6), *outside_m);
                Row { time_s, position_m, detail, ..row }.say(
                    match *outside_m > 0.0 {
                        true => format!("{outside_m:.2} m outside{at} ({x:.2}, {y:.2}, {z:.2})"),
                        false => {
                            format!("{:.2} m or more from the sides of {volume}", -outside_m + 0.0)
                        }
                    },
                    format!("inside {volume}"),
                    "write smaller letters or fewer ({letters.canvas_m}, {letters.cap_height_m}, \
                     {letters.baseline_m})",
                )
            }
            Self::Speed(peak @ Peak { value, most, time_s }) => {
                peak.row("speed", stop_if(*value > 1.001 * most)).say(
                    format!("{value:.2} m/s{}", at(*time_s)),
                    format!("up to {most} m/s"),
                    "lower {plan.style.dark_speed_m_s} or {plan.stroke_speed_m_s}",
                )
            }
            Self::Acceleration(peak @ Peak { value, most, time_s }) => {
                peak.row("acceleration", stop_if(*value > 1.05 * most)).say(
                    format!("{value:.2} m/s²{}", at(*time_s)),
                    format!("up to {most} m/s²"),
                    "lower {plan.style.acceleration_m_s2}",
                )
            }
            Self::VelocityStep(peak @ Peak { value, most, time_s }) => {
                peak.row("acceleration", warn_if(*value > 1.05 * most)).say(
                    format!("setpoints change velocity by up to {value:.1} m/s²{}", at(*time_s)),
                    format!("up to {most} m/s²"),
                    "plan with {plan.style=even}",
                )
            }
            Self::Jump(n, peak @ Peak { value, most, time_s }) => {
                Row { count: Some(*n), ..peak.row("jump", warn_if(*n > 0)) }.say(
                    match n {
                        0 => "none".to_owned(),
                        n => format!("{n} jumps of up to {value:.2} m{}", at(*time_s)),
                    },
                    format!("setpoints within {most} m of the design"),
                    "plan with {plan.style=even}, whose design is continuous",
                )
            }
            Self::FlightTime(peak @ Peak { value, most, .. }) => {
                peak.row("flight time", stop_if(value > most)).say(
                    format!("{value:.0} s in the air"),
                    format!("up to {most:.0} s in the air"),
                    match is_even {
                        true => "write fewer letters, or with {plan.drones=2}",
                        false => {
                            "write fewer letters, faster ({plan.style=even}), or with \
                             {plan.drones=2}"
                        }
                    },
                )
            }
            Self::Memory(memory) => of_memory(memory),
            Self::LedMemory { entries, most } => {
                let severity = warn_if(entries.is_some_and(|n| n > *most));
                let row = Row::of("LED memory", severity, entries.map(|n| n as f64));
                Row { limit: *most as f64, ..row }.say(
                    entries.map_or("not used".into(), |n| format!("{n} of {most} entries")),
                    format!("up to {most} entries"),
                    "nothing where the radio sends the lights, as the script then does; else build \
                     firmware with a larger LEDRING_TIME_MEM_SIZE",
                )
            }
            Self::Headlights { dimmed, first_s } => {
                let severity = warn_if(dimmed.is_some_and(|n| n > 0));
                let row = Row::of("headlights", severity, dimmed.map(|n| n as f64));
                Row { time_s: *first_s, ..row }.say(
                    match dimmed {
                        None => "not used".to_owned(),
                        Some(0) => "switched on and off, not dimmed".to_owned(),
                        Some(n) => format!("dimmed by {n} commands, first{}", at(*first_s)),
                    },
                    "on or off: headlights cannot be dimmed",
                    "set {plan.style.exposure=switched}, or write with lamps that can be dimmed",
                )
            }
            Self::Separation(closest) => {
                let least_m = closest.map(|it| it.horizontal_m);
                let time_s = closest.map(|it| it.time_s);
                let severity = stop_if(least_m.is_some_and(|m| m < MIN_HORIZONTAL_M - 1e-9));
                let row = Row::of("separation", severity, least_m);
                Row { limit: MIN_HORIZONTAL_M, time_s, ..row }.say(
                    least_m.map_or("always above each other".into(), |m| {
                        format!("{m:.2} m or more apart sideways, least{}", at(time_s))
                    }),
                    format!(
                        "{MIN_HORIZONTAL_M} m sideways, or {MIN_VERTICAL_M} m above each other"
                    ),
                    "let the later drone wait ({plan.floor_wait_s}), or plan with {plan.drones}",
                )
            }
            Self::Wake(place, peak @ Peak { value, most, time_s }) => {
                peak.row("wake", warn_if(value > most)).say(
                    place.map_or(
                        "no drone is planned into another's wake".into(),
                        |(lower, it)| {
                            format!(
                                "drone {lower} comes {:.2} m below and {:.2} m beside another at \
                             {:.1} s; off by up to {value:.3} m{}",
                                it.vertical_m.abs(),
                                it.horizontal_m,
                                it.time_s,
                                at(*time_s)
                            )
                        },
                    ),
                    format!("off by up to {most} m, a twentieth of the letters"),
                    "plan the drones together with {plan.drones}, or fly the lower one before",
                )
            }
            Self::Flight(lost) => {
                let row = Row::of("flight", Severity::Stop, None);
                let advice = "see the message; tune the controller";
                Row { detail: lost.clone(), ..row }.say(lost, "a flight to its end", advice)
            }
            Self::Corridor(peak @ Peak { value, most, time_s }) => {
                peak.row("corridor", stop_if(value.abs() > *most)).say(
                    format!("strays to y = {value:+.2} m{}", at(*time_s)),
                    format!("within ±{most} m"),
                    "take the mean error off ({plan.mean_error_m}), or fly lqr-integral",
                )
            }
            Self::AltitudeHold(peak @ Peak { value, most, .. }) => {
                peak.row("altitude hold", warn_if(value > most)).say(
                    format!("precise enough for letters of {value:.2} m or more"),
                    format!(
                        "error of the height up to {:.0} mm, a twentieth of the letters",
                        50.0 * most
                    ),
                    "write larger letters, or fewer where a canvas shrinks them \
                     ({letters.cap_height_m}, {letters.canvas_m}), or fly a better height sensor",
                )
            }
            Self::Tilt(peak @ Peak { value, most, time_s }) => {
                peak.row("tilt", stop_if(value > most)).say(
                    format!("{:.1}°{}", value.to_degrees(), at(*time_s)),
                    format!("up to {:.0}°", most.to_degrees()),
                    "lower {plan.style.acceleration_m_s2} or {plan.style.jerk_m_s3}; check that \
                     the plan has no jump",
                )
            }
            Self::Motors(peak @ Peak { value, most, time_s }) => {
                let bad = if *value > MAX_SATURATED_S { Severity::Stop } else { Severity::Warning };
                peak.row("motors", if value > most { bad } else { Severity::Fine }).say(
                    match *value {
                        0.0 => "never at their limit".to_owned(),
                        s => format!("{:.0} ms at their limit, first{}", 1e3 * s, at(*time_s)),
                    },
                    format!("up to {:.0} ms at their limit", 1e3 * most),
                    "lower {plan.style.acceleration_m_s2}, or fly a drone with more thrust for its \
                     weight",
                )
            }
            Self::Battery { taken, warning, low_v } => of_battery(taken, warning, *low_v),
            Self::Frame { outside, n } => of_frame(outside, *n),
            Self::CameraPlace { least_m, most_m, other } => {
                let severity = match other {
                    _ if least_m <= most_m => Severity::Fine,
                    Some(_) => Severity::Warning,
                    None => Severity::Stop,
                };
                let row = Row::of("camera", severity, *least_m);
                let shows = match (severity, other) {
                    (Severity::Fine, _) => "has a place in the room".to_owned(),
                    (_, Some(other)) => format!("has no place in the room; {other} has"),
                    (_, None) => "has no place in the room, and no usual one has".to_owned(),
                };
                Row { limit: *most_m, ..row }.say(
                    format!(
                        "{shows}: the whole word takes {least_m:.1} m, and {most_m:.1} m are there"
                    ),
                    format!("a camera that shows the whole word from within {most_m:.1} m"),
                    "write smaller letters ({letters.cap_height_m}), take a wider lens \
                     ({camera.lens}), type the room's true depth ({expose.room_m}), or say where the \
                     camera stands ({camera.framing}): in a door, for instance",
                )
            }
            Self::LitTransit(end, most_m) => lit_transit(end, *most_m, plan.light_clock),
            Self::LitDwell(peak @ Peak { value, most, time_s }) => {
                peak.row("lit dwell", warn_if(value > most)).say(
                    match *value {
                        0.0 => "none".to_owned(),
                        s => {
                            let at = at(*time_s);
                            format!("{:.0} ms of light two stops over the rest{at}", 1e3 * s)
                        }
                    },
                    format!("less than {:.0} ms of it", 1e3 * most),
                    match (is_even, plan.light_clock) {
                        (true, _) => {
                            "lower {plan.stroke_speed_m_s}, so that the drone need not brake, or \
                             dim the light with the speed ({plan.style.exposure=dimmed}, for a \
                             ring or a color LED)"
                        }
                        (false, LightClock::Setpoint) => {
                            "plan with {plan.style=even}, or set {plan.light_clock=light}"
                        }
                        (false, LightClock::Light) => "plan with {plan.style=even}",
                    },
                )
            }
            Self::Evenness(peak @ Peak { value, most, .. }, evener) => {
                let evener = evener.map_or_else(String::new, |[yaw_rad, stops]| {
                    format!(
                        "; by {stops:.1} with the nose at {yaw_rad:.2} rad (plan.yaw_rad), where \
                         headlights draw two lines beside each other"
                    )
                });
                peak.row("evenness", warn_if(value > most)).say(
                    format!("exposure varies by {value:.1} stops along the trail{evener}"),
                    format!(
                        "within {most:.0} stops, from the 5th to the 95th percentile, as `meter` \
                         reads"
                    ),
                    "turn the nose ({plan.yaw_rad}) or the writing lamp ({light.fixtures}) to the \
                     camera, or write slower ({plan.stroke_speed_m_s})",
                )
            }
            Self::Coverage(seen_frac) => {
                let row = Row::of("coverage", stop_if(*seen_frac < 1.0), *seen_frac);
                let seen = 100.0 * seen_frac;
                Row { limit: 1.0, ..row }.say(
                    format!("{seen:.1} % of the flight's box is seen by two base stations"),
                    "two Lighthouse stations see every place",
                    "write smaller or lower ({letters.canvas_m}, {letters.baseline_m}), or move \
                     the stations (see `coverage`)",
                )
            }
            Self::Picture(problem) => {
                let row = Row::of("picture", warn_if(problem.is_some()), None);
                let wanted = "the whole word in the picture, lit while the shutter is open";
                match problem {
                    None => row.say("shows the word while it is written", wanted, ""),
                    Some(problem) => {
                        let detail = problem.sentence(Change::to_string);
                        let (found, advice) = problem.parts();
                        Row { detail, ..row }.say(found, wanted, advice.0)
                    }
                }
            }
        }
    }
}

/// What the flight takes of the battery: the one rule of the check and of exported scripts.
fn of_battery(taken: &Option<Battery>, warning: &Option<Warning>, low_v: f64) -> Row {
    let bad = warning.is_some() || taken.as_ref().is_some_and(|taken| !taken.lasts());
    let row = Row::of("battery", stop_if(bad), taken.as_ref().map(|taken| taken.rest_v));
    let least_v = taken.as_ref().and_then(|taken| taken.least_rest_v);
    let volts = taken.as_ref().map_or("lasts".to_owned(), |taken| {
        let Battery { rest_v, sag_v, .. } = taken;
        let lowest_v = rest_v - sag_v;
        let verdict = if taken.lasts() { "lasts" } else { "does not last" };
        format!("{verdict}: {rest_v:.2} V at rest, {lowest_v:.2} V at the hardest moment")
    });
    let detail = warning.as_ref().map(ToString::to_string).unwrap_or_default();
    let found = match detail.as_str() {
        "" => volts,
        warned => format!("{warned} ({volts})"),
    };
    let never = format!("never {LOW_BATTERY_S} s under {low_v} V, which the firmware calls low");
    let wanted = match (taken, least_v) {
        (Some(_), Some(least_v)) => format!("{least_v:.2} V at rest or more: {never}"),
        (Some(_), None) => format!("{never}; no full battery does that"),
        (None, _) => never,
    };
    Row { limit: least_v.unwrap_or(0.0), detail, ..row }.say(
        found,
        wanted,
        "charge it ({battery.charge_frac}), write fewer letters, or share them ({plan.drones=2})",
    )
}

/// What stands outside of the room.
fn of_frame(outside: &[OutOfRoom], n: usize) -> Row {
    let farthest = outside.iter().max_by(|a, b| a.by_m.total_cmp(&b.by_m));
    let severity = outside.iter().map(|it| it.severity).max().unwrap_or_default();
    let row = Row::of("frame", severity, farthest.map_or(0.0, |it| it.by_m));
    let place = |it: &OutOfRoom| {
        let [x, y, z] = it.place_m;
        format!("{} at ({x:.2}, {y:.2}, {z:.2}), {:.2} m outside", it.what, it.by_m)
    };
    let places: Vec<String> = outside.iter().map(place).collect();
    let detail = outside.iter().map(|it| it.what.as_str()).collect::<Vec<_>>().join(", ");
    let found = match places.as_slice() {
        [] => format!("all {n} places of stations, anchors, drones and camera are in the room"),
        places => places.join("; "),
    };
    Row { limit: FRAME_M, position_m: farthest.map(|it| it.place_m), detail, ..row }.say(
        found,
        "stations, anchors, take-off marks and camera in the room, whose middle is x = y = 0",
        "the origin or the room is wrong: set the origin of the geometry to the middle of the floor, \
         or type the room's true size ({expose.room_m}); the stations are \
         {sensors.lighthouse.stations}, the anchors {sensors.uwb.anchors_m}",
    )
}

/// Letters with lengths of something, and the longest that is no fault.
fn lengths(
    check: &'static str,
    letters: &[(char, f64)],
    limit: f64,
    wanted: &str,
    advice: &'static str,
) -> Row {
    let most_m = letters.iter().map(|(_, length_m)| *length_m).fold(0.0, f64::max);
    let detail = named(letters.iter().map(|(letter, _)| *letter));
    let found = match letters.len() {
        0 => "none".to_owned(),
        1 => format!("{detail} ({most_m:.2} m)"),
        _ => format!("{detail} (up to {most_m:.2} m)"),
    };
    let row = Row::of(check, warn_if(!letters.is_empty()), most_m);
    Row { limit, detail, ..row }.say(found, wanted, advice)
}

/// Letters with a fault of a font; style `even`, whose plan follows no dark move, mends it as well.
fn faults(check: &'static str, letters: &[char], wanted: &str) -> Row {
    let (bad, detail) = (!letters.is_empty(), named(letters.iter().copied()));
    let found = if bad { detail.clone() } else { "none".to_owned() };
    let row = Row::of(check, warn_if(bad), if bad { 1.0 } else { 0.0 });
    let advice = "write with {letters.font=ae483-fixed}, or plan with {plan.style=even}";
    Row { detail, ..row }.say(found, wanted, advice)
}

fn named(letters: impl Iterator<Item = char>) -> String {
    letters.map(String::from).collect::<Vec<_>>().join(", ")
}

/// Bytes and pieces, each of as many as the drone's memory holds.
fn of_memory(memory: &Memory) -> Row {
    let Memory { bytes, pieces, formats, fits_all } = memory;
    let detail = formats.join(", ");
    let beyond = |is: bool| if is { ", too many" } else { "" };
    let forms = match detail.as_str() {
        "" => "no form of export takes it".to_owned(),
        formats => format!("it can be exported as {formats}"),
    };
    let row = Row::of("memory", warn_if(!fits_all), *bytes as f64);
    Row { limit: TRAJECTORY_MEMORY_BYTES as f64, count: Some(*pieces), detail, ..row }.say(
        format!(
            "{bytes} of {TRAJECTORY_MEMORY_BYTES} bytes compressed{}; {pieces} of {MAX_PIECES} pieces as \
             poly4d{}; {forms}",
            beyond(*bytes > TRAJECTORY_MEMORY_BYTES),
            beyond(*pieces > MAX_PIECES)
        ),
        format!(
            "{TRAJECTORY_MEMORY_BYTES} bytes and {MAX_PIECES} pieces on board, 50 setpoints a second by radio"
        ),
        "export it in one of those forms, or share the word ({plan.drones=2})",
    )
}

/// How far the light is off at the end of a stroke where it is farthest.
fn lit_transit(end: &StrokeEnd, most_m: f64, clock: LightClock) -> Row {
    let StrokeEnd { time_s, at_m, on, streak_m } = *end;
    let what = match (streak_m > 0.0, on) {
        (true, true) => "light before a stroke begins",
        (true, false) => "light after a stroke ends",
        (false, true) => "a stroke's beginning without light",
        (false, false) => "a stroke's end without light",
    };
    let row = Row::of("lit transit", warn_if(streak_m.abs() > most_m), streak_m);
    let (position_m, detail) = (Some(at_m.into()), if on { "beginning" } else { "end" }.to_owned());
    let (off_mm, at, x, z) = (1e3 * streak_m.abs(), at(time_s), at_m.x, at_m.z);
    Row { limit: most_m, time_s: Some(time_s), position_m, detail, ..row }.say(
        format!("up to {off_mm:.0} mm of {what}{at} ({x:.2}, {z:.2})"),
        format!("within {:.0} mm of strokes' ends, a tenth of the letters", 1e3 * most_m),
        match clock {
            LightClock::Light => "slow down ({plan.stroke_speed_m_s})",
            LightClock::Setpoint => {
                "set {plan.light_clock=light}, or slow down ({plan.stroke_speed_m_s})"
            }
        },
    )
}

#[cfg(test)]
impl Finding {
    pub(super) fn severity(&self) -> Severity {
        self.row(&PlanOptions::default()).severity
    }
}
