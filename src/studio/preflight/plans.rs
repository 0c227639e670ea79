//! Checks of plans by themselves.

use nalgebra::Vector3;

use super::finding::largest;
use super::{Finding, Peak, Profile};
use noctograph_flying::plan::{Approach, Plan, Setpoint, closest};

/// Distance of a setpoint from the end of the design before it from which it is a jump.
const JUMP_M: f64 = 0.03;

/// Checks the motion and the commands of a plan.
pub(super) fn check_plan(plan: &Plan, profile: &Profile) -> [Finding; 6] {
    [
        volume(plan, profile),
        speed(plan, profile),
        acceleration(plan, profile),
        jumps(plan),
        duration(plan, profile),
        headlights(plan),
    ]
}

fn volume(plan: &Plan, profile: &Profile) -> Finding {
    let [low, high] = profile.volume_m.map(Vector3::from);
    let outside = |setpoint: &Setpoint| {
        let (below, above) = (low - setpoint.position_m, setpoint.position_m - high);
        // Down to the floor there is no margin to keep.
        let sides_m = below.xy().max().max(above.max());
        if below.z > 0.0 { sides_m.max(below.z) } else { sides_m }
    };
    let most = plan.setpoints.iter().map(|s| (outside(s), s.time_s));
    let (outside_m, time_s) = largest(most);
    let position_m = plan.setpoint_at(time_s).map(|setpoint| setpoint.position_m.into());
    Finding::Volume { outside_m, time_s, position_m, volume: profile.volume() }
}

fn speed(plan: &Plan, profile: &Profile) -> Finding {
    let speeds = plan.setpoints.iter().map(|s| (s.velocity_m_s.norm(), s.time_s));
    Finding::Speed(Peak::of(speeds, profile.speed_m_s))
}

fn acceleration(plan: &Plan, profile: &Profile) -> Finding {
    // Without accelerations in the plan, the changes of velocity between setpoints count.
    let planned = plan.setpoints.iter().any(|s| s.acceleration_m_s2.norm() > 0.0);
    let pairs = plan.setpoints.windows(2).map(|pair| {
        let lasts_s = pair[1].time_s - pair[0].time_s;
        let change = (pair[1].velocity_m_s - pair[0].velocity_m_s).norm() / lasts_s.max(1e-3);
        (if planned { pair[0].acceleration_m_s2.norm() } else { change }, pair[1].time_s)
    });
    let peak = Peak::of(pairs, profile.acceleration_m_s2);
    if planned { Finding::Acceleration(peak) } else { Finding::VelocityStep(peak) }
}

fn jumps(plan: &Plan) -> Finding {
    let in_air = plan.setpoints.windows(2).filter(|p| !p[0].on_floor() && !p[1].on_floor());
    let all = in_air.map(|p| ((p[1].position_m - p[0].design_m(p[1].time_s)).norm(), p[1].time_s));
    let jumps: Vec<(f64, f64)> = all.filter(|(jump_m, _)| *jump_m > JUMP_M).collect();
    Finding::Jump(jumps.len(), Peak::of(jumps, JUMP_M))
}

fn duration(plan: &Plan, profile: &Profile) -> Finding {
    let in_air = plan.setpoints.windows(2).filter(|pair| !pair[0].on_floor());
    let air_s = in_air.map(|pair| pair[1].time_s - pair[0].time_s).sum();
    Finding::FlightTime(Peak { value: air_s, most: profile.flight_time_s, time_s: None })
}

/// The deck switches its headlights by one pin (`ring.headlightEnable` in `ledring12.c`).
fn headlights(plan: &Plan) -> Finding {
    let Some(levels) = plan.lights.get("headlights") else {
        return Finding::Headlights { dimmed: None, first_s: None };
    };
    let rows = plan.setpoints.iter().zip(levels);
    let mut dimmed = rows.filter(|(_, level)| **level > 0.0 && **level < 1.0);
    let first_s = dimmed.next().map(|(setpoint, _)| setpoint.time_s);
    Finding::Headlights { dimmed: Some(usize::from(first_s.is_some()) + dimmed.count()), first_s }
}

/// Distance of the drones from each other; `None` for a single one.
pub(super) fn check_separation(plans: &[Plan]) -> Option<Finding> {
    if plans.len() < 2 {
        return None;
    }
    let pairs = plans.iter().enumerate();
    let pairs = pairs.flat_map(|(i, a)| plans[i + 1..].iter().map(move |b| (a, b)));
    let nearest = |a: &Approach, b: &Approach| a.horizontal_m.total_cmp(&b.horizontal_m);
    Some(Finding::Separation(pairs.filter_map(|(a, b)| closest(a, b)).min_by(nearest)))
}

#[cfg(test)]
mod tests {
    use super::super::Severity;
    use super::*;
    use noctograph_flying::plan::{
        EvenStyle, LightLevel, MIN_HORIZONTAL_M, PlanOptions, fleet, plan,
    };
    use noctograph_letters::{LetterOptions, Strokes, write};

    fn strokes(word: &str) -> Strokes {
        write(word, &LetterOptions::default()).unwrap()
    }

    fn even(word: &str, style: EvenStyle) -> Plan {
        plan(&strokes(word), &PlanOptions::even_with(style)).unwrap()
    }

    fn outside_m(plan: &Plan, profile: &Profile) -> (f64, [f64; 3]) {
        let Finding::Volume { outside_m, position_m, .. } = volume(plan, profile) else {
            panic!("a volume is found")
        };
        (outside_m, position_m.unwrap())
    }

    #[test]
    fn the_reference_flight_jumps_and_may_fly() {
        let team = plan(&strokes("NOOR"), &PlanOptions::default()).unwrap();
        let found = check_plan(&team, &Profile::indoor());
        assert!(found.iter().all(|f| f.severity() != Severity::Stop), "it flew: {found:?}");
        let Finding::Jump(n, Peak { value, .. }) = jumps(&team) else { panic!("it is a jump") };
        assert!(n == 5 && (value - 0.2).abs() < 0.005, "{n} jumps, {value} m");
        assert_eq!(speed(&team, &Profile::indoor()).severity(), Severity::Fine);
    }

    #[test]
    fn a_value_beyond_its_limit_stops_the_flight_with_time_and_place() {
        let limits =
            EvenStyle { dark_speed_m_s: 2.0, acceleration_m_s2: 4.0, ..EvenStyle::default() };
        let fast = even("NOOR", limits);
        assert_eq!(acceleration(&fast, &Profile::indoor()).severity(), Severity::Stop);
        let wide = LetterOptions { width_m: Some(2.0), ..LetterOptions::default() };
        let wide = plan(&write("NOOR", &wide).unwrap(), &PlanOptions::even()).unwrap();
        assert_eq!(volume(&wide, &Profile::indoor()).severity(), Severity::Stop);
        let (outside_m, [x, ..]) = outside_m(&wide, &Profile::indoor());
        assert!((x.abs() - 2.5 - outside_m).abs() < 1e-9, "{outside_m} m at {x} m");
    }

    #[test]
    fn a_room_bounds_the_volume() {
        let plan = even("NOOR", EvenStyle::default());
        let (inside_m, _) = outside_m(&plan, &Profile::indoor());
        assert!((inside_m + 1.5).abs() < 0.05, "1 m of 2.5 m high: {inside_m}");
        let (small_m, [x, _, z]) = outside_m(&plan, &Profile::indoor().in_room([1.5, 1.5, 1.0]));
        let by_m = (x.abs() - 0.55).max(z - 0.8);
        assert!(by_m > 0.0 && (by_m - small_m).abs() < 1e-9, "0.2 m from the walls: {small_m}");
        let (hall_m, _) = outside_m(&plan, &Profile::indoor().in_room([50.0, 50.0, 50.0]));
        assert_eq!(hall_m, inside_m, "the profile's limits hold in a hall, too");
    }

    #[test]
    fn dimmed_headlights_are_found() {
        let severity = |exposure| {
            headlights(&even("O", EvenStyle { exposure, ..EvenStyle::default() })).severity()
        };
        assert_eq!(severity(LightLevel::Dimmed), Severity::Warning);
        assert_eq!(severity(LightLevel::Switched), Severity::Fine);
    }

    #[test]
    fn drones_in_conflict_do_not_fly() {
        let alone = plan(&strokes("NO"), &PlanOptions::even()).unwrap();
        let found = check_separation(&[alone.clone(), alone]).unwrap();
        assert_eq!(found.severity(), Severity::Stop);
        let options = PlanOptions { drones: 2, ..PlanOptions::even() };
        let pair = fleet(&strokes("NO"), &options).unwrap();
        let found = check_separation(&pair).unwrap();
        assert_eq!(found.severity(), Severity::Fine);
        let Finding::Separation(Some(apart)) = found else { panic!("{found:?}") };
        assert!((MIN_HORIZONTAL_M..3.0).contains(&apart.horizontal_m), "{apart:?}");
    }
}
