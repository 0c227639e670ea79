//! Check: should this fly? Every finding says where and what to change.
//!
//! Products in: letters, [`Plan`]s, and the flight that a simulator makes of each. Product out:
//! [`Finding`]s against the limits of a [`Profile`]. Not checked: what stands in the room.

use nalgebra::Vector3;
use serde::Serialize;

use super::{Plan, Setpoint, nearest_meeting};

mod flown;
mod letters;
mod profile;

pub use flown::{Flown, check_flown, even_frac};
pub use letters::check_letters;
pub use profile::Profile;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// Within its limit.
    Fine,
    /// Nobody can tell from what is known.
    Unknown,
    /// It flies, but the picture suffers, or a way of flying it is closed.
    Warning,
    /// It should not fly.
    Stop,
}

/// One thing that was looked at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was looked at.
    pub check: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// What was found, with its unit, and where.
    pub found: String,
    /// What is wanted.
    pub wanted: String,
    /// What to change; empty where nothing need be.
    pub change: String,
}

/// A setpoint that is further than this from where the design had come is a jump.
const JUMP_M: f64 = 0.03;
/// Memory for trajectories of the firmware (`crtp_commander_high_level.c`), a piece of polynomials
/// of degree 7, and what a straight piece takes compressed, with start and end of all.
const MEMORY_BYTES: usize = 4096;
const MAX_PIECES: usize = 31;
const COMPRESSED_BYTES: [usize; 2] = [7, 11];
/// Entries of the LED timing memory (`ledring12.c`).
const MAX_LED_ENTRIES: usize = 10;

impl Finding {
    fn new(check: &'static str, good: bool, bad: Severity, found: String, wanted: String) -> Self {
        let severity = if good { Severity::Fine } else { bad };
        Self { check, severity, found, wanted, change: String::new() }
    }

    fn or(mut self, change: impl Into<String>) -> Self {
        if self.severity != Severity::Fine {
            self.change = change.into();
        }
        self
    }
}

/// Looks at what plans ask for, by themselves.
#[must_use]
pub fn check_plans(plans: &[Plan], profile: &Profile) -> Vec<Finding> {
    let mut findings: Vec<Finding> = Vec::new();
    for plan in plans {
        findings.extend([
            volume(plan, profile),
            speed(plan, profile),
            acceleration(plan, profile),
            jumps(plan),
            duration(plan, profile),
            memory(plan),
            led_entries(plan),
            headlights(plan),
        ]);
    }
    let pairs = plans.iter().enumerate();
    let pairs = pairs.flat_map(|(i, a)| plans[i + 1..].iter().map(move |b| (a, b)));
    let close: Vec<_> = pairs.filter_map(|(a, b)| nearest_meeting(a, b)).collect();
    if plans.len() > 1 {
        let nearest = close.iter().min_by(|a, b| a.sideways_m.total_cmp(&b.sideways_m));
        let found = nearest.map_or("apart all the time".to_owned(), |m| {
            format!("{:.2} m beside, {:.2} m above at {:.1} s", m.sideways_m, m.upward_m, m.time_s)
        });
        let wanted = "0.3 m sideways, or 0.9 m above".to_owned();
        let change = "let the later drone wait (plan.floor_wait_s), or plan with --drones";
        let separation =
            Finding::new("separation", nearest.is_none(), Severity::Stop, found, wanted);
        findings.push(separation.or(change));
    }
    findings
}

/// The setpoint with the most of something.
fn most<'a>(
    setpoints: impl Iterator<Item = &'a Setpoint>,
    of: impl Fn(&Setpoint) -> f64,
) -> (f64, f64, Vector3<f64>) {
    let pairs = setpoints.map(|s| (of(s), s.time_s, s.position_m));
    pairs.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0.0, Vector3::zeros()))
}

fn volume(plan: &Plan, profile: &Profile) -> Finding {
    let [low, high] = profile.volume_m.map(Vector3::from);
    let outside = |s: &Setpoint| (low - s.position_m).max().max((s.position_m - high).max());
    let (by_m, time_s, at) = most(plan.setpoints.iter(), outside);
    let found = if by_m > 0.0 {
        format!("{by_m:.2} m outside at {time_s:.1} s ({:.2}, {:.2}, {:.2})", at.x, at.y, at.z)
    } else {
        format!("inside by {:.2} m", (-by_m).max(0.0) + 0.0)
    };
    let wanted = format!(
        "x {} to {}, y {} to {}, z {} to {} m",
        low.x, high.x, low.y, high.y, low.z, high.z
    );
    Finding::new("volume", by_m <= 1e-6, Severity::Stop, found, wanted)
        .or("write smaller letters or fewer (letters.canvas_m, cap_height_m, baseline_m)")
}

fn speed(plan: &Plan, profile: &Profile) -> Finding {
    let (m_s, time_s, _) = most(plan.setpoints.iter(), |s| s.velocity_m_s.norm());
    let found = format!("{m_s:.2} m/s at {time_s:.1} s");
    let wanted = format!("up to {} m/s", profile.speed_m_s);
    Finding::new("speed", m_s <= 1.001 * profile.speed_m_s, Severity::Stop, found, wanted)
        .or("lower plan.dark_speed_m_s or plan.stroke_speed_m_s")
}

fn acceleration(plan: &Plan, profile: &Profile) -> Finding {
    // Where the plan tells none, what its velocities do from setpoint to setpoint counts.
    let pairs = plan.setpoints.windows(2);
    let told = plan.setpoints.iter().any(|s| s.acceleration_m_s2.norm() > 0.0);
    let of = |pair: &[Setpoint]| {
        let lasts_s = pair[1].time_s - pair[0].time_s;
        let change = (pair[1].velocity_m_s - pair[0].velocity_m_s).norm() / lasts_s.max(1e-3);
        if told { pair[0].acceleration_m_s2.norm() } else { change }
    };
    let (m_s2, time_s) = pairs
        .map(|pair| (of(pair), pair[1].time_s))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap_or_default();
    let wanted = format!("up to {} m/s²", profile.acceleration_m_s2);
    let good = m_s2 <= 1.05 * profile.acceleration_m_s2;
    // A velocity that steps is not flown as it is asked for; a drone that is told to accelerate is.
    let (bad, found) = if told {
        (Severity::Stop, format!("{m_s2:.2} m/s² at {time_s:.1} s"))
    } else {
        (Severity::Warning, format!("velocity steps like {m_s2:.1} m/s² at {time_s:.1} s"))
    };
    let change = if told { "lower plan.acceleration_m_s2" } else { "plan with --style even" };
    Finding::new("acceleration", good, bad, found, wanted).or(change)
}

fn jumps(plan: &Plan) -> Finding {
    let pairs = plan.setpoints.windows(2);
    let of = |pair: &[Setpoint]| {
        let flying = !pair[0].on_floor() && !pair[1].on_floor();
        if flying { (pair[1].position_m - pair[0].design_m(pair[1].time_s)).norm() } else { 0.0 }
    };
    let jumps: Vec<(f64, f64)> = pairs
        .map(|pair| (of(pair), pair[1].time_s))
        .filter(|(jump_m, _)| *jump_m > JUMP_M)
        .collect();
    let found = jumps.iter().max_by(|a, b| a.0.total_cmp(&b.0)).map_or("none".into(), |worst| {
        format!("{} of them, up to {:.2} m at {:.1} s", jumps.len(), worst.0, worst.1)
    });
    let wanted = format!("setpoints within {JUMP_M} m of the design");
    Finding::new("jump", jumps.is_empty(), Severity::Warning, found, wanted)
        .or("plan with --style even, whose design goes on smoothly")
}

fn duration(plan: &Plan, profile: &Profile) -> Finding {
    let air_s: f64 = plan
        .setpoints
        .windows(2)
        .filter(|pair| !pair[0].on_floor())
        .map(|pair| pair[1].time_s - pair[0].time_s)
        .sum();
    let wanted = format!("up to {:.0} s in the air", profile.flight_time_s);
    let found = format!("{air_s:.0} s in the air");
    Finding::new("flight time", air_s <= profile.flight_time_s, Severity::Stop, found, wanted)
        .or("write fewer letters, faster (--style even), or with --drones 2")
}

/// Straight pieces at constant velocity, as they would be uploaded.
fn straight_pieces(plan: &Plan) -> usize {
    let mut pieces = 0;
    let mut open: Option<Setpoint> = None;
    for setpoint in &plan.setpoints {
        let goes_on = open.is_some_and(|from| {
            (setpoint.velocity_m_s - from.velocity_m_s).norm() < 1e-3
                && (setpoint.position_m - from.design_m(setpoint.time_s)).norm() < 0.002
        });
        if !goes_on {
            pieces += 1;
            open = Some(Setpoint { acceleration_m_s2: Vector3::zeros(), ..*setpoint });
        }
    }
    pieces
}

fn memory(plan: &Plan) -> Finding {
    let pieces = straight_pieces(plan);
    let bytes = COMPRESSED_BYTES[0] * pieces + COMPRESSED_BYTES[1];
    let good = pieces <= MAX_PIECES;
    let found = format!("{pieces} straight pieces: {bytes} bytes compressed");
    let wanted = format!("{MAX_PIECES} pieces, or {MEMORY_BYTES} bytes compressed");
    let change = if bytes <= MEMORY_BYTES {
        "upload it compressed, or send setpoints over the radio"
    } else {
        "send setpoints over the radio: it does not fit on board"
    };
    Finding::new("memory", good, Severity::Warning, found, wanted).or(change)
}

fn led_entries(plan: &Plan) -> Finding {
    let changes = plan.lights.values().map(|levels| {
        usize::from(levels.first().is_some_and(|l| *l != 0.0))
            + levels.windows(2).filter(|pair| pair[0] != pair[1]).count()
    });
    // Each change is an entry, and one ends the list.
    let entries = changes.max().unwrap_or(0) + 1;
    let found = format!("{entries} entries");
    let wanted = format!("{MAX_LED_ENTRIES} in the LED timing memory");
    Finding::new("LED memory", entries <= MAX_LED_ENTRIES, Severity::Warning, found, wanted).or(
        "send light commands over the radio, or build firmware with a larger LEDRING_TIME_MEM_SIZE",
    )
}

/// The deck switches its headlights by one pin (`ring.headlightEnable` in `ledring12.c`).
fn headlights(plan: &Plan) -> Finding {
    let levels = plan.lights.get("headlights").map_or(&[][..], Vec::as_slice);
    let between = |level: &f64| *level > 0.0 && *level < 1.0;
    let n = levels.iter().filter(|level| between(level)).count();
    let first = plan.setpoints.iter().zip(levels).find(|(_, level)| between(level));
    let found = first.map_or("on or off".to_owned(), |(setpoint, level)| {
        format!("dimmed by {n} commands, to {level:.2} at {:.1} s", setpoint.time_s)
    });
    Finding::new("headlights", n == 0, Severity::Warning, found, "on or off: a pin".into())
        .or("set plan.exposure = \"switched\", or write with lamps that can be dimmed")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{LetterOptions, write};
    use crate::plan::{EvenStyle, Exposure, PlanOptions, fleet, plan};

    fn of<'a>(findings: &'a [Finding], check: &str) -> &'a Finding {
        findings.iter().find(|finding| finding.check == check).unwrap()
    }

    #[test]
    fn the_teams_noor_is_found_to_jump_and_to_be_fit_to_fly() {
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        let team = plan(&strokes, &PlanOptions::default()).unwrap();
        let findings = check_plans(&[team], &Profile::indoor());
        assert!(findings.iter().all(|f| f.severity != Severity::Stop), "it flew: {findings:?}");
        let jump = of(&findings, "jump");
        assert_eq!(jump.severity, Severity::Warning);
        assert!(
            jump.found.contains("5 of them, up to 0.20 m") && !jump.change.is_empty(),
            "{jump:?}"
        );
        assert_eq!(of(&findings, "LED memory").severity, Severity::Fine, "nine entries");
        assert_eq!(of(&findings, "speed").severity, Severity::Fine);
    }

    #[test]
    fn what_goes_beyond_a_limit_stops_the_flight_and_says_where() {
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        let limits =
            EvenStyle { dark_speed_m_s: 2.0, acceleration_m_s2: 4.0, ..EvenStyle::default() };
        let fast = PlanOptions::even_with(limits);
        let findings = check_plans(&[plan(&strokes, &fast).unwrap()], &Profile::indoor());
        assert_eq!(of(&findings, "acceleration").severity, Severity::Stop, "{findings:?}");
        let wide = LetterOptions { width_m: 2.0, ..LetterOptions::default() };
        let wide = plan(&write("NOOR", &wide).unwrap(), &PlanOptions::even()).unwrap();
        let findings = check_plans(&[wide], &Profile::indoor());
        let volume = of(&findings, "volume");
        assert_eq!(volume.severity, Severity::Stop);
        assert!(volume.found.contains(" s (") && volume.change.contains("canvas"), "{volume:?}");
    }

    #[test]
    fn headlights_that_are_dimmed_are_found() {
        let strokes = write("O", &LetterOptions::default()).unwrap();
        let of_exposure = |exposure| {
            let options = PlanOptions::even_with(EvenStyle { exposure, ..EvenStyle::default() });
            let findings = check_plans(&[plan(&strokes, &options).unwrap()], &Profile::indoor());
            of(&findings, "headlights").clone()
        };
        let dimmed = of_exposure(Exposure::Dimmed);
        assert_eq!(dimmed.severity, Severity::Warning);
        assert!(
            dimmed.found.contains("dimmed") && dimmed.change.contains("switched"),
            "{dimmed:?}"
        );
        assert_eq!(of_exposure(Exposure::Switched).severity, Severity::Fine);
    }

    #[test]
    fn drones_in_each_others_way_do_not_fly() {
        let strokes = write("NO", &LetterOptions::default()).unwrap();
        let alone = plan(&strokes, &PlanOptions::even()).unwrap();
        let findings = check_plans(&[alone.clone(), alone], &Profile::indoor());
        assert_eq!(of(&findings, "separation").severity, Severity::Stop);
        let options = PlanOptions { drones: 2, ..PlanOptions::even() };
        let findings = check_plans(&fleet(&strokes, &options).unwrap(), &Profile::indoor());
        assert_eq!(of(&findings, "separation").severity, Severity::Fine);
    }
}
