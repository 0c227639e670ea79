//! Checks of plans that do not require a simulated flight.

use nalgebra::Vector3;

use super::{Profile, at_time, largest, stop_if, warn_if};
use crate::scene::Scene;
use crate::shoot::Shoot;
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::diagnostic::{Diagnostic, Severity};
use noctograph_core::error::Result;
use noctograph_core::geometry::segment_distance;
use noctograph_core::input_error;
use noctograph_core::lamps::LightOptions;
use noctograph_export::lights::{commands, switches};
use noctograph_letters::Strokes;
use noctograph_plan::{Approach, MIN_HORIZONTAL_M, MIN_VERTICAL_M, Plan, Setpoint, closest};

/// Minimum distance between the designed and the actual next setpoint that counts as a jump.
const JUMP_M: f64 = 0.03;
/// Shortest time in s between two setpoints for which an acceleration is computed.
const LEAST_STEP_S: f64 = 1e-3;
/// Factor on the limit of the acceleration for rounding errors of positions and velocities.
const ACCELERATION_SLACK: f64 = 1.05;
/// Distance in m between drones below which they are too close, which allows for rounding errors.
const LEAST_APART_M: f64 = MIN_HORIZONTAL_M - 1e-9;

/// Checks the motion and the commands of a plan. `is_even` is true for the style `even`.
pub(super) fn check_plan(
    plan: &Plan,
    light: &LightOptions,
    is_even: bool,
    profile: &Profile,
) -> Vec<Diagnostic> {
    vec![
        volume(plan, profile),
        speed(plan, profile),
        acceleration(plan, profile),
        jumps(plan),
        duration(plan, is_even, profile),
        landing(plan),
        headlights(plan, light),
        lamps(plan, light),
    ]
}

/// Returns the distance in m by which a point is outside a volume, negative inside. For a point
/// above the floor, the distance to the floor is ignored.
fn distance_outside_m(position_m: Vector3<f64>, volume_m: [[f64; 3]; 2]) -> f64 {
    let [low_m, high_m] = volume_m.map(Vector3::from);
    let (below, above) = (low_m - position_m, position_m - high_m);
    let sides_m = below.xy().max().max(above.max());
    if below.z > 0.0 { sides_m.max(below.z) } else { sides_m }
}

/// Maximum distance outside the volume that can result from rounding.
const ROUNDING_M: f64 = 1e-6;

/// Checks that the plan stays inside the profile's volume. The value is the distance in m outside,
/// negative inside.
fn volume(plan: &Plan, profile: &Profile) -> Diagnostic {
    let setpoints = plan.setpoints.iter();
    // The reported point is the one farthest outside or, if all are inside, closest to a side.
    let (outside_m, time_s) =
        largest(setpoints.map(|s| (distance_outside_m(s.position_m, profile.volume_m), s.time_s)));
    let position_m = plan.setpoint_at(time_s).map(|setpoint| setpoint.position_m.into());
    let ([x, y, z], volume) = (position_m.unwrap_or_default(), profile.volume());
    let actual = if outside_m > 0.0 {
        format!("{outside_m:.2} m outside{} ({x:.2}, {y:.2}, {z:.2})", at_time(time_s))
    } else {
        format!("{:.2} m or more from the sides of {volume}", -outside_m + 0.0)
    };
    let row = Diagnostic::check("volume", stop_if(outside_m > ROUNDING_M), outside_m);
    row.timed(time_s).positioned(position_m).detailed(&*volume).say(
        actual,
        format!("inside {volume}"),
        "write smaller or fewer letters ({letters.canvas_m}, {letters.cap_height_m}, \
         {letters.baseline_m})",
    )
}

/// Returns the pairs of consecutive setpoints.
fn pairs(plan: &Plan) -> impl Iterator<Item = (&Setpoint, &Setpoint)> {
    plan.setpoints.iter().zip(plan.setpoints.iter().skip(1))
}

/// Returns the displacement between the next setpoint that the design predicts and the actual one.
fn jump(from: &Setpoint, to: &Setpoint) -> Vector3<f64> {
    to.position_m - from.design_m(to.time_s)
}

/// A segment of the path in the air.
struct Segment {
    time_s: f64,
    duration_s: f64,
    /// Displacement computed from the positions at both ends.
    moved_m: Vector3<f64>,
    /// Displacement computed from the positions, minus that computed from the velocities.
    mismatch_m: Vector3<f64>,
    /// True if the next segment begins where this one ends.
    goes_on: bool,
}

/// Minimum duration over which a speed is computed. Positions in files are rounded.
const SEGMENT_S: f64 = 0.1;

/// Returns the airborne path as segments of at least [`SEGMENT_S`]. A single jump, for which there
/// is a separate check, interrupts the path. Several jumps in a row count as motion.
fn segments(plan: &Plan) -> Vec<Segment> {
    let pairs: Vec<(&Setpoint, &Setpoint)> = pairs(plan).collect();
    let jumps: Vec<bool> = pairs.iter().map(|(a, b)| jump(a, b).norm() > JUMP_M).collect();
    let mut segments: Vec<Segment> = Vec::new();
    for (row, (from, to)) in pairs.iter().enumerate() {
        let neighbors = &jumps[row.saturating_sub(1)..(row + 2).min(jumps.len())];
        let is_single_jump = jumps[row] && neighbors.iter().filter(|jumps| **jumps).count() == 1;
        let last = segments.last_mut().filter(|segment| segment.goes_on);
        if is_single_jump || from.on_floor() || to.on_floor() {
            last.into_iter().for_each(|segment| segment.goes_on = false);
            continue;
        }
        let (duration_s, moved_m) = (to.time_s - from.time_s, to.position_m - from.position_m);
        // Plans either hold a velocity until the next setpoint, or interpolate it. The smaller of
        // the two mismatches is used.
        let interpolated_m = moved_m - 0.5 * duration_s * (from.velocity_m_s + to.velocity_m_s);
        let held_m = jump(from, to);
        let mismatch_m =
            if interpolated_m.norm() < held_m.norm() { interpolated_m } else { held_m };
        match last.filter(|segment| segment.duration_s < SEGMENT_S) {
            Some(segment) => {
                segment.duration_s += duration_s;
                segment.moved_m += moved_m;
                segment.mismatch_m += mismatch_m;
            }
            None => {
                let time_s = from.time_s;
                segments.push(Segment { time_s, duration_s, moved_m, mismatch_m, goes_on: true });
            }
        }
    }
    segments
}

/// Maximum fraction of the path by which velocities may disagree with positions. The velocities in
/// a plan with few setpoints do not follow its corners.
const MAX_MISMATCH_FRAC: f64 = 0.25;

/// Returns the maximum speed of the positions on a path, and the time of the maximum.
fn fastest(segments: &[Segment]) -> (f64, f64) {
    let complete = segments.iter().filter(|segment| segment.duration_s >= SEGMENT_S);
    largest(complete.map(|segment| (segment.moved_m.norm() / segment.duration_s, segment.time_s)))
}

/// Returns the maximum speed of a plan's positions.
pub(super) fn greatest_speed_m_s(plan: &Plan) -> f64 {
    fastest(&segments(plan)).0
}

/// Returns the mismatch between velocities and positions as a fraction of the path's length.
fn mismatch_frac(segments: &[Segment]) -> f64 {
    let mismatch_m: f64 = segments.iter().map(|segment| segment.mismatch_m.norm()).sum();
    let lengths_m = segments.iter().map(|segment| {
        let by_velocity_m = segment.moved_m - segment.mismatch_m;
        segment.moved_m.norm().max(by_velocity_m.norm())
    });
    // The lower limit yields 0 for a path without motion, instead of 0 / 0.
    mismatch_m / lengths_m.sum::<f64>().max(1e-9)
}

/// Checks the plan's maximum speed in m/s, as given by its velocities and as computed from its
/// positions. Both must agree.
fn speed(plan: &Plan, profile: &Profile) -> Diagnostic {
    let by_velocity = largest(plan.setpoints.iter().map(|s| (s.velocity_m_s.norm(), s.time_s)));
    let segments = segments(plan);
    let (by_position, mismatch_frac) = (fastest(&segments), mismatch_frac(&segments));
    let (speed_m_s, time_s) = largest([by_velocity, by_position]);
    let (velocity_m_s, moved_m_s, most_m_s) = (by_velocity.0, by_position.0, profile.speed_m_s);
    // Velocities that belong to a different flight do not show this flight's speed. 10 % and 0.05
    // m/s allow for rounded positions.
    let is_faster = moved_m_s > 1.1 * velocity_m_s + 0.05;
    if velocity_m_s > 0.0 && (mismatch_frac > MAX_MISMATCH_FRAC || is_faster) {
        let row = Diagnostic::check("speed", Severity::Stop, speed_m_s).within(most_m_s);
        return row.timed(time_s).say(
            format!(
                "positions move at {moved_m_s:.2} m/s, but velocities are {velocity_m_s:.2} m/s, \
                 a difference of {:.0} % of the path",
                100.0 * mismatch_frac
            ),
            format!("velocities that agree with the positions, up to {most_m_s} m/s"),
            "plan the flight again, because its times, positions and velocities belong to \
             different flights",
        );
    }
    // Positions in a file are rounded, so their tolerance is larger.
    let is_fast = velocity_m_s > 1.001 * most_m_s || moved_m_s > 1.02 * most_m_s;
    Diagnostic::check("speed", stop_if(is_fast), speed_m_s).within(most_m_s).timed(time_s).say(
        format!("{speed_m_s:.2} m/s{}", at_time(time_s)),
        format!("up to {most_m_s} m/s"),
        "lower {plan.style.dark_speed_m_s} or {plan.stroke_speed_m_s}",
    )
}

/// Checks that the plan leaves the floor and returns to it. The value is the last height in m.
fn landing(plan: &Plan) -> Diagnostic {
    let end_m = plan.setpoints.last().map_or(0.0, |setpoint| setpoint.position_m.z);
    let flies = plan.setpoints.iter().any(|setpoint| !setpoint.on_floor());
    let lands = plan.setpoints.last().is_some_and(Setpoint::on_floor);
    // This check also stops a plan from another program in which z does not point up.
    let actual = match (flies, lands) {
        (false, _) => "never leaves the floor".to_owned(),
        (true, false) => format!("ends in the air, at {end_m:.2} m"),
        (true, true) => "ends on the floor".to_owned(),
    };
    Diagnostic::check("landing", stop_if(!flies || !lands), end_m).say(
        actual,
        "a flight that begins and ends on the floor",
        "plan the flight again, with z up and the end at z = 0 if another program makes the plan",
    )
}

/// Checks the plan's maximum acceleration in m/s², as given by its setpoints and as computed from
/// the changes of velocity.
fn acceleration(plan: &Plan, profile: &Profile) -> Diagnostic {
    // Accelerations missing from the plan are computed from the changes of velocity between
    // setpoints. The controller smooths such steps, so they only cause a warning. A planned
    // acceleration is actually flown.
    let is_planned = plan.setpoints.iter().any(|s| s.acceleration_m_s2.norm() > 0.0);
    let by_setpoints = pairs(plan).map(|(from, to)| {
        let duration_s = (to.time_s - from.time_s).max(LEAST_STEP_S);
        let change_m_s2 = (to.velocity_m_s - from.velocity_m_s).norm() / duration_s;
        (if is_planned { from.acceleration_m_s2.norm() } else { change_m_s2 }, to.time_s)
    });
    // Positions accelerate when the velocity changes between segments.
    let segments = segments(plan);
    let joined = segments.windows(2).filter(|pair| is_planned && pair[0].goes_on);
    let by_positions = joined.map(|pair| {
        let [from, to] = [&pair[0], &pair[1]].map(|segment| segment.moved_m / segment.duration_s);
        let duration_s = 0.5 * (pair[0].duration_s + pair[1].duration_s);
        ((to - from).norm() / duration_s, pair[1].time_s)
    });
    let (value, time_s) = largest(by_setpoints.chain(by_positions));
    let most = profile.acceleration_m_s2;
    let (is_beyond, when) = (value > ACCELERATION_SLACK * most, at_time(time_s));
    let severity = if is_planned { stop_if(is_beyond) } else { warn_if(is_beyond) };
    Diagnostic::check("acceleration", severity, value).within(most).timed(time_s).say(
        if is_planned {
            format!("{value:.2} m/s²{when}")
        } else {
            format!("the velocity of the setpoints changes by up to {value:.1} m/s²{when}")
        },
        format!("up to {most} m/s²"),
        if is_planned {
            "lower {plan.style.acceleration_m_s2}"
        } else {
            "plan with {plan.style=even}"
        },
    )
}

/// Checks the plan for jumps of the position between setpoints. The value is the longest jump in m.
fn jumps(plan: &Plan) -> Diagnostic {
    // Jumps on the floor are ignored, because a drone may be carried to a different mark.
    let in_air = pairs(plan).filter(|(a, b)| !a.on_floor() && !b.on_floor());
    let steps = in_air.map(|(a, b)| (jump(a, b).norm(), b.time_s));
    let jumps: Vec<(f64, f64)> = steps.filter(|(jump_m, _)| *jump_m > JUMP_M).collect();
    let n = jumps.len();
    let (most_m, time_s) = largest(jumps);
    let row = Diagnostic::check("jump", warn_if(n > 0), most_m).within(JUMP_M).timed(time_s);
    row.with("count", n).say(
        match n {
            0 => "none".to_owned(),
            n => format!("{n} jumps of up to {most_m:.2} m{}", at_time(time_s)),
        },
        format!("setpoints within {JUMP_M} m of the design"),
        "plan with {plan.style=even}, whose design is continuous",
    )
}

/// Returns the time in s that a plan spends in the air.
fn air_s(plan: &Plan) -> f64 {
    let in_air = pairs(plan).filter(|(from, _)| !from.on_floor());
    // The sum of an empty list is -0.0, which adding 0.0 turns into 0.0.
    in_air.map(|(from, to)| to.time_s - from.time_s).sum::<f64>() + 0.0
}

/// Returns a warning if a plan's time in the air exceeds the battery's hover time. Returns `None`
/// for a drone without a battery model.
pub fn longer_than_battery(shoot: &Shoot) -> Option<Diagnostic> {
    let hovers_s = hovers_s(&shoot.scene)?;
    let longest_s = shoot.plans.iter().map(|planned| air_s(&planned.plan)).fold(0.0, f64::max);
    let message = format!(
        "the plan is in the air for {longest_s:.0} s, but the battery can hover for only \
         {hovers_s:.0} s: write fewer letters, or set plan.drones=2 or a shorter \
         plan.style.hover_s"
    );
    (longest_s > hovers_s).then(|| Diagnostic::warning("battery-short", message))
}

/// Returns the battery's hover time in s, or `None` without a battery.
pub(super) fn hovers_s(scene: &Scene) -> Option<f64> {
    scene.battery.lasts_s(scene.vehicle.mass_kg * GRAVITY_M_S2)
}

/// Checks the time in s in the air. The help depends on the style, which `is_even` tells.
fn duration(plan: &Plan, is_even: bool, profile: &Profile) -> Diagnostic {
    let (air_s, most_s) = (air_s(plan), profile.flight_time_s);
    Diagnostic::check("flight time", stop_if(air_s > most_s), air_s).within(most_s).say(
        format!("{air_s:.0} s in the air"),
        format!("up to {most_s:.0} s in the air"),
        if is_even {
            "write fewer letters, or with {plan.drones=2}"
        } else {
            "write fewer letters, faster ({plan.style=even}), or with {plan.drones=2}"
        },
    )
}

/// Checks that the firmware has a parameter for each lamp, which an export needs to switch it on.
fn lamps(plan: &Plan, light: &LightOptions) -> Diagnostic {
    let wanted = "lamps with a firmware parameter";
    match commands(plan, light) {
        Ok(commands) => {
            let actual = format!("{} light commands", commands.len());
            Diagnostic::check("lamps", Severity::Fine, commands.len() as f64)
                .say(actual, wanted, "")
        }
        Err(error) => {
            Diagnostic::check("lamps", Severity::Warning, None).detailed(error.to_string()).say(
                "no export can control the lights, because a lamp has no firmware parameter",
                wanted,
                "light with {plan.lights=[\"headlights\"]}, or name the parameter of the lamp in \
             {light.fixtures}",
            )
        }
    }
}

/// Checks that the plan does not dim a lamp that a pin switches, such as the headlights of the LED
/// ring (`ring.headlightEnable` in `ledring12.c`).
fn headlights(plan: &Plan, light: &LightOptions) -> Diagnostic {
    let switches = switches(plan, light);
    let rows = switches.iter().flat_map(|lamp| plan.setpoints.iter().zip(&plan.lights[*lamp]));
    let dimmed = rows.filter(|(_, level)| **level > 0.0 && **level < 1.0);
    let times_s: Vec<f64> = dimmed.map(|(setpoint, _)| setpoint.time_s).collect();
    let time_s = times_s.iter().copied().min_by(f64::total_cmp);
    // `n` is `None` if the plan uses no headlight.
    let n = (!switches.is_empty()).then_some(times_s.len());
    Diagnostic::check("headlights", warn_if(time_s.is_some()), n.map(|n| n as f64))
        .timed(time_s)
        .say(
            match n {
                None => "not used".to_owned(),
                Some(0) => "switched on and off, not dimmed".to_owned(),
                Some(n) => format!("dimmed by {n} commands, first{}", at_time(time_s)),
            },
            "on or off, because a lamp that a pin switches cannot be dimmed",
            "set {plan.style.exposure=switched}, or write with lamps that can be dimmed",
        )
}

/// Checks the least horizontal distance in m between drones that are not above each other. Returns
/// `None` for a single drone.
pub(super) fn check_separation(plans: &[Plan]) -> Option<Diagnostic> {
    if plans.len() < 2 {
        return None;
    }
    // `closest` ignores drones above each other, because there is a separate check for downwash.
    let pairs =
        plans.iter().enumerate().flat_map(|(i, a)| plans[i + 1..].iter().map(move |b| (a, b)));
    let closest = pairs.filter_map(|(a, b)| closest(a, b)).min_by(Approach::compare);
    let (least_m, time_s) = closest.map(|pair| (pair.horizontal_m, pair.time_s)).unzip();
    let is_near = least_m.is_some_and(|least_m| least_m < LEAST_APART_M);
    let row = Diagnostic::check("separation", stop_if(is_near), least_m);
    Some(row.within(MIN_HORIZONTAL_M).timed(time_s).say(
        least_m.map_or("always above each other".into(), |least_m| {
            format!("{least_m:.2} m or more apart sideways, least{}", at_time(time_s))
        }),
        format!("{MIN_HORIZONTAL_M} m sideways, or {MIN_VERTICAL_M} m above each other"),
        "let the later drone wait ({plan.floor_wait_s}), or plan with {plan.drones}",
    ))
}

/// Maximum distance between a letter's strokes and the light of a plan, in cap heights.
const TOLERANCE_H: f64 = 0.1;

/// Checks that a plan is lit only on the strokes of its letters.
///
/// # Errors
///
/// Returns [`Error::Input`](noctograph_core::error::Error::Input) that states the time of the first
/// setpoint that is too far away.
pub fn check_written(plan: &Plan, strokes: &Strokes) -> Result<()> {
    let tolerance_m = TOLERANCE_H * strokes.glyphs[0].cell.cap_height_m;
    for (row, setpoint) in plan.setpoints.iter().enumerate() {
        let is_lit = plan.lights.values().any(|levels| levels[row] > 0.0);
        let Some(letter) = setpoint.letter.filter(|_| is_lit) else { continue };
        // The distance to the letter's nearest lit stroke is measured in the plane of the word.
        let [x, z] = [setpoint.position_m.x, setpoint.position_m.z];
        let moves = strokes.glyphs.get(letter).into_iter().flat_map(|glyph| &glyph.moves);
        let lit = moves.filter(|step| step.lit);
        let distances_m = lit.map(|step| segment_distance([x, z], [step.from_m, step.to_m]));
        if distances_m.fold(f64::INFINITY, f64::min) > tolerance_m {
            let (number, word) = (letter + 1, &strokes.word);
            return Err(input_error!(
                format!("plan, {:.1} s", setpoint.time_s),
                "light at {x:.2} m, {z:.2} m in letter {number}",
                "the strokes of {word}",
                "name the plan, the word and the scene of the same flight",
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::diagnostic::Figure;
    use noctograph_core::plan::PlanData;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::{EvenStyle, LightLevel, PlanOptions, fleet, plan};

    fn strokes(word: &str) -> Strokes {
        write(word, &LetterOptions::default()).unwrap()
    }

    fn even(word: &str, style: EvenStyle) -> Plan {
        plan(&strokes(word), &PlanOptions::even_with(style)).unwrap()
    }

    fn distance_outside_m(plan: &Plan, profile: &Profile) -> (f64, [f64; 3]) {
        let row = volume(plan, profile);
        let Figure::Position(position_m) = row.figures["position_m"] else { panic!("{row:?}") };
        (row.number("value").unwrap(), position_m)
    }

    #[test]
    fn the_reference_flight_jumps_and_may_fly() {
        let team = plan(&strokes("NOOR"), &PlanOptions::default()).unwrap();
        let actual = check_plan(&team, &LightOptions::default(), false, &Profile::indoor());
        assert!(actual.iter().all(|row| row.severity != Severity::Stop), "it flew: {actual:?}");
        let jumps = jumps(&team);
        assert_eq!(jumps.figures["count"], Figure::Count(5));
        assert!((jumps.number("value").unwrap() - 0.2).abs() < 0.005, "{jumps:?}");
        assert_eq!(speed(&team, &Profile::indoor()).severity, Severity::Fine);
    }

    #[test]
    fn a_value_beyond_its_limit_stops_the_flight_with_time_and_place() {
        let limits =
            EvenStyle { dark_speed_m_s: 2.0, acceleration_m_s2: 4.0, ..EvenStyle::default() };
        let fast = even("NOOR", limits);
        assert_eq!(acceleration(&fast, &Profile::indoor()).severity, Severity::Stop);
        let wide = LetterOptions { width_m: Some(2.0), ..LetterOptions::default() };
        let wide = plan(&write("NOOR", &wide).unwrap(), &PlanOptions::even()).unwrap();
        assert_eq!(volume(&wide, &Profile::indoor()).severity, Severity::Stop);
        let (outside_m, [x, ..]) = distance_outside_m(&wide, &Profile::indoor());
        assert!((x.abs() - 2.5 - outside_m).abs() < 1e-9, "{outside_m} m at {x} m");
    }

    /// Returns a drawing of one kind: a spiral, a zigzag, a scribble, a coastline, a rosette, or a
    /// sketch with many short strokes.
    fn drawing(kind: usize, size_m: f64) -> Strokes {
        let mut state = kind as f64;
        let mut next = || {
            state = 43_758.545_3 * libm::sin(12.9898 * state + 1.7).fract();
            state - state.floor()
        };
        let mut stroke = |n: u32, place: &mut dyn FnMut(f64, f64) -> [f64; 2]| -> Vec<[f64; 2]> {
            (0..=n).map(|k| place(f64::from(k) / f64::from(n), next())).collect()
        };
        fn turned(r: f64, turns: f64) -> [f64; 2] {
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * turns);
            [1.0 + r * cos, 1.0 + r * sin]
        }
        let strokes: Vec<Vec<[f64; 2]>> = match kind % 6 {
            0 => vec![stroke(300, &mut |t, _| turned(t, 6.0 * t))],
            1 => vec![stroke(40, &mut |t, r| [2.0 * t, if r < 0.5 { r } else { 1.5 * r }])],
            2 => vec![stroke(60, &mut |t, r| [0.5 + r, t])],
            3 => vec![stroke(200, &mut |t, r| turned(1.0 + 0.12 * r, t))],
            4 => vec![stroke(400, &mut |t, _| turned(libm::cos(31.4 * t), t))],
            _ => (0..25)
                .map(|_| {
                    let [x, y] = stroke(1, &mut |_, r| [2.0 * r, r])[0];
                    stroke(6, &mut |t, r| [x + 0.2 * t, y + 0.1 * r])
                })
                .collect(),
        };
        let file = tempfile::Builder::new().suffix(".json").tempfile().unwrap();
        std::fs::write(file.path(), serde_json::json!({ "strokes": strokes }).to_string()).unwrap();
        let options =
            LetterOptions { canvas_m: Some([size_m, size_m]), ..LetterOptions::default() };
        noctograph_letters::draw(file.path(), &options, noctograph_letters::Ink::Alike).unwrap()
    }

    #[test]
    fn a_plan_of_the_program_keeps_the_limits_by_which_it_is_judged() {
        let mut scenes: Vec<(String, Strokes)> = (0..24)
            .map(|kind| (format!("drawing {kind}"), drawing(kind, [0.5, 0.8, 1.2, 1.5][kind / 6])))
            .collect();
        for (font, word, cap_height_m) in [
            ("simplex", "Noctograph & 8", 0.25),
            ("simplex", "{§@Ωж}", 0.5),
            ("ae483", "QUICK", 0.2),
            ("ae483-fixed", "WAVE 2026", 0.6),
            (concat!(env!("CARGO_MANIFEST_DIR"), "/../../fonts/Roboto-Thin.ttf"), "Rag@8", 0.4),
        ] {
            let font = font.to_owned();
            let options = LetterOptions { font, cap_height_m, ..LetterOptions::default() };
            scenes.push((word.to_owned(), write(word, &options).unwrap()));
        }
        for (name, strokes) in scenes {
            let plan = plan(&strokes, &PlanOptions::even()).unwrap();
            for profile in [Profile::indoor(), Profile::outdoor()] {
                for row in [speed(&plan, &profile), acceleration(&plan, &profile)] {
                    assert_eq!(row.severity, Severity::Fine, "{name}: {row:?}");
                }
            }
        }
    }

    #[test]
    fn a_room_bounds_the_volume() {
        let plan = even("NOOR", EvenStyle::default());
        let (inside_m, _) = distance_outside_m(&plan, &Profile::indoor());
        assert!((inside_m + 1.5).abs() < 0.05, "1 m of 2.5 m high: {inside_m}");
        let (small_m, [x, _, z]) =
            distance_outside_m(&plan, &Profile::indoor().in_room([1.5, 1.5, 1.0]));
        let by_m = (x.abs() - 0.55).max(z - 0.8);
        assert!(by_m > 0.0 && (by_m - small_m).abs() < 1e-9, "0.2 m from the walls: {small_m}");
        let (hall_m, _) = distance_outside_m(&plan, &Profile::indoor().in_room([50.0, 50.0, 50.0]));
        assert_eq!(hall_m, inside_m, "the profile's limits hold in a hall, too");
    }

    /// Returns every nth setpoint of a plan, with times multiplied by a factor and nothing else
    /// changed.
    fn slowed(plan: &Plan, factor: f64, nth: usize) -> Plan {
        let every = |plan: &Plan| plan.setpoints.iter().copied().step_by(nth).collect();
        let mut slowed = Plan::made(PlanData { setpoints: every(plan), ..PlanData::default() });
        slowed.edit(|slowed| {
            slowed.setpoints.iter_mut().for_each(|setpoint| setpoint.time_s *= factor)
        });
        slowed
    }

    #[test]
    fn places_are_as_fast_as_the_columns_say() {
        let (plan, profile) = (even("NOOR", EvenStyle::default()), Profile::indoor());
        let severity = |plan: &Plan| {
            let (speed, acceleration) = (speed(plan, &profile), acceleration(plan, &profile));
            (speed.severity, acceleration.severity)
        };
        assert_eq!(severity(&plan), (Severity::Fine, Severity::Fine));
        for nth in [2, 3, 5] {
            assert_eq!(severity(&slowed(&plan, 1.0, nth)).0, Severity::Fine, "coarse: {nth}");
        }
        let fast = slowed(&plan, 0.5, 2);
        assert_eq!(severity(&fast), (Severity::Stop, Severity::Stop));
        assert!(
            (speed(&fast, &profile).number("value").unwrap() - 1.9).abs() < 0.1,
            "twice 0.95 m/s"
        );
        assert_eq!(severity(&slowed(&plan, 0.8, 1)).0, Severity::Stop);
        assert_eq!(severity(&slowed(&plan, 2.0, 1)).0, Severity::Stop, "slower than the columns");
    }

    #[test]
    fn a_flight_begins_and_ends_on_the_floor() {
        let mut plan = even("I", EvenStyle::default());
        assert_eq!(landing(&plan).severity, Severity::Fine);
        let mut flat = plan.clone();
        flat.edit(|flat| {
            flat.setpoints.iter_mut().for_each(|setpoint| setpoint.position_m.z = 0.0)
        });
        assert_eq!(landing(&flat).message, "never leaves the floor");
        let end = plan.setpoints.iter().rposition(|setpoint| setpoint.position_m.z > 0.3).unwrap();
        plan.edit(|plan| {
            plan.setpoints.truncate(end + 1);
            plan.lights.clear();
        });
        assert_eq!(landing(&plan).severity, Severity::Stop);
    }

    #[test]
    fn dimmed_headlights_are_found() {
        let light = LightOptions::default();
        let severity = |exposure| {
            headlights(&even("O", EvenStyle { exposure, ..EvenStyle::default() }), &light).severity
        };
        assert_eq!(severity(LightLevel::Dimmed), Severity::Warning);
        assert_eq!(severity(LightLevel::Switched), Severity::Fine);
    }

    #[test]
    fn drones_in_conflict_do_not_fly() {
        let single = plan(&strokes("NO"), &PlanOptions::even()).unwrap();
        let actual = check_separation(&[single.clone(), single]).unwrap();
        assert_eq!(actual.severity, Severity::Stop);
        let options = PlanOptions { drones: 2, ..PlanOptions::even() };
        let pair = fleet(&strokes("NO"), &options).unwrap();
        let actual = check_separation(&pair).unwrap();
        assert_eq!(actual.severity, Severity::Fine);
        assert!((MIN_HORIZONTAL_M..3.0).contains(&actual.number("value").unwrap()), "{actual:?}");
    }
}
