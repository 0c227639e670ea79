//! Check: should this fly? Every finding says where and what to change.
//!
//! Products in: letters, [`Plan`]s, and the flight that a simulator makes of each. Product out:
//! [`Finding`]s against the limits of a [`Profile`]. Not checked: what stands in the room.

use nalgebra::Vector3;
use serde::Serialize;

use super::lamp::StrokeEnd;
use super::{Plan, Setpoint, nearest_meeting};
use crate::flight::{Flight, FlightSample};

mod letters;
mod profile;

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

/// What became of a plan in a simulated flight.
#[derive(Clone, Copy, Debug)]
pub struct Flown<'a> {
    /// The flight.
    pub flight: &'a Flight,
    /// Its strokes' ends.
    pub ends: &'a [StrokeEnd],
    /// Pieces of its light in order of time: `(time in s, length in m, seconds of full light)`.
    pub painted: &'a [(f64, f64, f64)],
    /// Largest motor command.
    pub motor_max: f64,
    /// Whether the simulated drone has a battery that sags.
    pub battery_modelled: bool,
}

/// Half a stop to either side.
const EVEN: f64 = std::f64::consts::SQRT_2;
/// Light on one spot: this many times the median dose per length, two stops.
const DWELL: f64 = 4.0;
/// Longest lit dwell (a hot spot of a few stops), and largest streak at a stroke's end.
const MAX_DWELL_S: f64 = 0.1;
const MAX_STREAK_M: f64 = 0.01;
/// Share of the light that must lie within half a stop of its median.
const MIN_EVEN_FRAC: f64 = 0.95;
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

/// Looks at what became of a plan in a simulated flight.
#[must_use]
pub fn check_flown(flown: &Flown<'_>, profile: &Profile) -> Vec<Finding> {
    vec![
        corridor(flown, profile),
        tilt(flown, profile),
        motors(flown),
        battery(flown),
        streaks(flown),
        dwell(flown),
        evenness(flown),
    ]
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

fn corridor(flown: &Flown<'_>, profile: &Profile) -> Finding {
    let samples = flown.flight.samples.iter();
    let (y_m, time_s) = samples
        .map(|s| (s.position_m.y, s.time_s))
        .max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
        .unwrap_or_default();
    let found = format!("y = {y_m:+.2} m at {time_s:.1} s");
    let wanted = format!("within ±{} m", profile.corridor_m);
    Finding::new("corridor", y_m.abs() <= profile.corridor_m, Severity::Stop, found, wanted)
        .or("take the mean error off (plan --after FLIGHT), or fly lqr-integral")
}

fn tilt(flown: &Flown<'_>, profile: &Profile) -> Finding {
    let tilt_rad = |s: &FlightSample| {
        libm::acos((libm::cos(s.attitude.pitch_rad) * libm::cos(s.attitude.roll_rad)).min(1.0))
    };
    let samples = flown.flight.samples.iter().map(|s| (tilt_rad(s), s.time_s));
    let (rad, time_s) = samples.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
    let found = format!("{:.1}° at {time_s:.1} s", rad.to_degrees());
    let wanted = format!("up to {:.0}°", profile.tilt_rad.to_degrees());
    Finding::new("tilt", rad <= profile.tilt_rad, Severity::Stop, found, wanted)
        .or("lower plan.acceleration_m_s2 or plan.jerk_m_s3; check that the plan makes no jump")
}

fn motors(flown: &Flown<'_>) -> Finding {
    let samples = &flown.flight.samples;
    let cut = |motors: &[f64; 4]| {
        let flying = motors.iter().any(|m| *m > 0.0);
        flying && motors.iter().any(|m| *m <= 0.0 || *m >= flown.motor_max)
    };
    let pairs = samples.windows(2).filter(|pair| cut(&pair[0].motors));
    let (n, cut_s) = pairs.fold((0, 0.0), |(n, s), p| (n + 1, s + p[1].time_s - p[0].time_s));
    let first = samples.iter().find(|s| cut(&s.motors)).map(|s| s.time_s);
    let found =
        first.map_or("never".into(), |at| format!("{cut_s:.2} s at the end, first at {at:.1} s"));
    let bad = if cut_s > 0.5 { Severity::Stop } else { Severity::Warning };
    Finding::new("motors", n == 0, bad, found, "commands within their range".into())
        .or("lower plan.acceleration_m_s2, or fly a lighter drone (the team's hovers at 67 %)")
}

fn battery(flown: &Flown<'_>) -> Finding {
    if !flown.battery_modelled {
        return Finding {
            check: "battery",
            severity: Severity::Unknown,
            found: "this drone's is not modelled".into(),
            wanted: "thrust to the end".into(),
            change: "name a preset with a battery, such as cf21".into(),
        };
    }
    let told = flown.flight.warnings.iter().find(|warning| warning.contains("battery"));
    let found = told.map_or("lasts".to_owned(), Clone::clone);
    Finding::new("battery", told.is_none(), Severity::Stop, found, "thrust to the end".into())
        .or("write fewer letters, or share them (--drones 2)")
}

fn streaks(flown: &Flown<'_>) -> Finding {
    let worst = flown.ends.iter().max_by(|a, b| a.streak_m.abs().total_cmp(&b.streak_m.abs()));
    let found = worst.map_or("no stroke".into(), |end| {
        let side = if end.streak_m > 0.0 { "beyond" } else { "short of" };
        let which = if end.on { "beginning" } else { "end" };
        let (mm, x, z) = (1e3 * end.streak_m.abs(), end.at_m.x, end.at_m.z);
        format!("{mm:.0} mm {side} the {which} at {:.1} s ({x:.2}, {z:.2})", end.time_s)
    });
    let good = worst.is_none_or(|end| end.streak_m.abs() <= MAX_STREAK_M + 1e-4);
    let wanted = format!("within {:.0} mm of strokes' ends", 1e3 * MAX_STREAK_M);
    Finding::new("lit transit", good, Severity::Warning, found, wanted)
        .or("set plan.light_clock = \"light\" (--style even), or slow down")
}

/// Median dose of light per length, weighted by length.
fn median_dose(painted: &[(f64, f64, f64)]) -> f64 {
    let mut doses: Vec<(f64, f64)> = painted
        .iter()
        .filter(|(_, length_m, _)| *length_m > 0.0)
        .map(|(_, length_m, light_s)| (light_s / length_m, *length_m))
        .collect();
    doses.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half_m = 0.5 * doses.iter().map(|dose| dose.1).sum::<f64>();
    let mut so_far_m = 0.0;
    let middle = doses.iter().find(|dose| {
        so_far_m += dose.1;
        so_far_m >= half_m
    });
    middle.map_or(0.0, |dose| dose.0)
}

fn dwell(flown: &Flown<'_>) -> Finding {
    let median = median_dose(flown.painted);
    let (mut longest, mut run) = ((0.0, 0.0), (0.0, 0.0));
    for (time_s, length_m, light_s) in flown.painted {
        if *light_s > DWELL * median * length_m && *light_s > 0.0 {
            run = if run.0 > 0.0 { (run.0 + light_s, run.1) } else { (*light_s, *time_s) };
            longest = if run.0 > longest.0 { run } else { longest };
        } else {
            run = (0.0, 0.0);
        }
    }
    let found = if longest.0 > 0.0 {
        format!("{:.2} s at {:.1} s", longest.0, longest.1)
    } else {
        "none".into()
    };
    let wanted = format!("below {MAX_DWELL_S} s of light two stops over the rest");
    Finding::new("lit dwell", longest.0 <= MAX_DWELL_S, Severity::Warning, found, wanted)
        .or("set plan.light_clock = \"light\", or plan with --style even")
}

fn evenness(flown: &Flown<'_>) -> Finding {
    let frac = even_frac(flown.painted);
    let found = format!("{:.1} % within half a stop", 100.0 * frac);
    let wanted = format!("{:.0} % of the lit length", 100.0 * MIN_EVEN_FRAC);
    Finding::new("evenness", frac >= MIN_EVEN_FRAC, Severity::Warning, found, wanted)
        .or("set plan.exposure = \"dimmed\", or a lower plan.stroke_speed_m_s")
}

/// Share of the lit length whose light per length is within half a stop of its median.
#[must_use]
pub fn even_frac(painted: &[(f64, f64, f64)]) -> f64 {
    let median = median_dose(painted);
    let (mut even_m, mut all_m) = (0.0, 0.0);
    for (_, length_m, light_s) in painted.iter().filter(|piece| piece.1 > 0.0) {
        all_m += length_m;
        if (median / EVEN..=median * EVEN).contains(&(light_s / length_m)) {
            even_m += length_m;
        }
    }
    if all_m > 0.0 { even_m / all_m } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{LetterOptions, write};
    use crate::plan::{PlanOptions, fleet, plan};

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
        let fast =
            PlanOptions { dark_speed_m_s: 2.0, acceleration_m_s2: 4.0, ..PlanOptions::even() };
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
    fn drones_in_each_others_way_do_not_fly() {
        let strokes = write("NO", &LetterOptions::default()).unwrap();
        let alone = plan(&strokes, &PlanOptions::even()).unwrap();
        let findings = check_plans(&[alone.clone(), alone], &Profile::indoor());
        assert_eq!(of(&findings, "separation").severity, Severity::Stop);
        let options = PlanOptions { drones: 2, ..PlanOptions::even() };
        let findings = check_plans(&fleet(&strokes, &options).unwrap(), &Profile::indoor());
        assert_eq!(of(&findings, "separation").severity, Severity::Fine);
    }

    #[test]
    fn a_spot_that_is_lit_too_long_is_found() {
        let flight = Flight::default();
        // A metre at 5 s of light a metre, and 0.3 s on a millimetre.
        let mut painted: Vec<(f64, f64, f64)> =
            (0..100).map(|k| (f64::from(k) * 0.05, 0.01, 0.05)).collect();
        let check = |painted: &[(f64, f64, f64)]| {
            let flown = Flown {
                flight: &flight,
                ends: &[],
                painted,
                motor_max: 1.0,
                battery_modelled: true,
            };
            check_flown(&flown, &Profile::indoor())
        };
        assert_eq!(of(&check(&painted), "lit dwell").severity, Severity::Fine);
        painted.insert(50, (2.5, 0.001, 0.3));
        let findings = check(&painted);
        let dwell = of(&findings, "lit dwell");
        assert_eq!((dwell.severity, dwell.found.as_str()), (Severity::Warning, "0.30 s at 2.5 s"));
        assert!((even_frac(&painted) - 1.0 / 1.001).abs() < 1e-9);
    }
}
