//! Checks of plans by themselves.

use nalgebra::Vector3;

use super::{Check, Finding, Profile, Severity, largest};
use crate::plan::{Approach, MIN_HORIZONTAL_M, Plan, Setpoint, closest};

/// Distance of a setpoint from the end of the design before it from which it is a jump.
const JUMP_M: f64 = 0.03;

/// Checks the motion and the commands of plans.
#[must_use]
pub fn check_plans(plans: &[Plan], profile: &Profile) -> Vec<Finding> {
    let mut findings: Vec<Finding> = Vec::new();
    for (drone, plan) in plans.iter().enumerate() {
        let of_plan = [
            volume(plan, profile),
            speed(plan, profile),
            acceleration(plan, profile),
            jumps(plan),
            duration(plan, profile),
            headlights(plan),
        ];
        let number = Some(drone + 1).filter(|_| plans.len() > 1);
        findings.extend(of_plan.map(|finding| Finding { drone: number, ..finding }));
    }
    findings.extend(check_separation(plans));
    findings
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
    let (by_m, time_s) = most.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
    let position_m = plan.setpoint_at(time_s).map(|setpoint| setpoint.position_m.into());
    let finding = Finding::new(Check::Volume, by_m <= 1e-6, Severity::Stop, by_m, 0.0);
    Finding { position_m, detail: profile.volume(), ..finding.at(time_s) }
}

fn speed(plan: &Plan, profile: &Profile) -> Finding {
    let speeds = plan.setpoints.iter().map(|s| (s.velocity_m_s.norm(), s.time_s));
    let ((m_s, time_s), limit) = (largest(speeds), profile.speed_m_s);
    Finding::new(Check::Speed, m_s <= 1.001 * limit, Severity::Stop, m_s, limit).at(time_s)
}

fn acceleration(plan: &Plan, profile: &Profile) -> Finding {
    // Without accelerations in the plan, the changes of velocity between setpoints count. These
    // steps are not flown as they stand; a planned acceleration is.
    let planned = plan.setpoints.iter().any(|s| s.acceleration_m_s2.norm() > 0.0);
    let pairs = plan.setpoints.windows(2).map(|pair| {
        let lasts_s = pair[1].time_s - pair[0].time_s;
        let change = (pair[1].velocity_m_s - pair[0].velocity_m_s).norm() / lasts_s.max(1e-3);
        (if planned { pair[0].acceleration_m_s2.norm() } else { change }, pair[1].time_s)
    });
    let ((m_s2, time_s), limit) = (largest(pairs), profile.acceleration_m_s2);
    let (check, bad) = match planned {
        true => (Check::Acceleration, Severity::Stop),
        false => (Check::VelocityStep, Severity::Warning),
    };
    Finding::new(check, m_s2 <= 1.05 * limit, bad, m_s2, limit).at(time_s)
}

fn jumps(plan: &Plan) -> Finding {
    let in_air = plan.setpoints.windows(2).filter(|p| !p[0].on_floor() && !p[1].on_floor());
    let all = in_air.map(|p| ((p[1].position_m - p[0].design_m(p[1].time_s)).norm(), p[1].time_s));
    let jumps: Vec<(f64, f64)> = all.filter(|(jump_m, _)| *jump_m > JUMP_M).collect();
    let (n, (jump_m, time_s)) = (jumps.len(), largest(jumps));
    let finding = Finding::new(Check::Jump, n == 0, Severity::Warning, jump_m, JUMP_M);
    Finding { count: Some(n), ..finding.at(time_s) }
}

fn duration(plan: &Plan, profile: &Profile) -> Finding {
    let in_air = plan.setpoints.windows(2).filter(|pair| !pair[0].on_floor());
    let air_s = in_air.map(|pair| pair[1].time_s - pair[0].time_s).sum();
    let limit = profile.flight_time_s;
    Finding::new(Check::FlightTime, air_s <= limit, Severity::Stop, air_s, limit)
}

/// The deck switches its headlights by one pin (`ring.headlightEnable` in `ledring12.c`).
fn headlights(plan: &Plan) -> Finding {
    let Some(levels) = plan.lights.get("headlights") else {
        return Finding::without_value(Check::Headlights, Severity::Fine, 0.0);
    };
    let rows = plan.setpoints.iter().zip(levels);
    let mut dimmed = rows.filter(|(_, level)| **level > 0.0 && **level < 1.0);
    let first = dimmed.next().map(|(setpoint, _)| setpoint.time_s);
    let n = usize::from(first.is_some()) + dimmed.count();
    #[expect(clippy::cast_precision_loss, reason = "rows of a plan")]
    let finding = Finding::new(Check::Headlights, n == 0, Severity::Warning, n as f64, 0.0);
    Finding { time_s: first, ..finding }
}

/// Distance of the drones from each other; `None` for a single one.
#[must_use]
pub fn check_separation(plans: &[Plan]) -> Option<Finding> {
    if plans.len() < 2 {
        return None;
    }
    let pairs = plans.iter().enumerate();
    let pairs = pairs.flat_map(|(i, a)| plans[i + 1..].iter().map(move |b| (a, b)));
    let nearest = |a: &Approach, b: &Approach| a.horizontal_m.total_cmp(&b.horizontal_m);
    let closest = pairs.filter_map(|(a, b)| closest(a, b)).min_by(nearest);
    let good = closest.is_none_or(|closest| closest.horizontal_m >= MIN_HORIZONTAL_M - 1e-9);
    let severity = if good { Severity::Fine } else { Severity::Stop };
    Some(Finding {
        value: closest.map(|closest| closest.horizontal_m),
        time_s: closest.map(|closest| closest.time_s),
        ..Finding::without_value(Check::Separation, severity, MIN_HORIZONTAL_M)
    })
}

#[cfg(test)]
mod tests {
    use super::super::severity_of;
    use super::*;
    use crate::letters::{LetterOptions, Strokes, write};
    use crate::plan::{EvenStyle, LightLevel, PlanOptions, fleet, plan};

    fn strokes(word: &str) -> Strokes {
        write(word, &LetterOptions::default()).unwrap()
    }

    fn even(word: &str, style: EvenStyle) -> Vec<Finding> {
        let plan = plan(&strokes(word), &PlanOptions::even_with(style)).unwrap();
        check_plans(&[plan], &Profile::indoor())
    }

    #[test]
    fn the_reference_flight_jumps_and_may_fly() {
        let team = plan(&strokes("NOOR"), &PlanOptions::default()).unwrap();
        let findings = check_plans(&[team], &Profile::indoor());
        assert!(findings.iter().all(|f| f.severity != Severity::Stop), "it flew: {findings:?}");
        let jump = findings.iter().find(|finding| finding.check == Check::Jump).unwrap();
        assert_eq!((jump.severity, jump.count), (Severity::Warning, Some(5)));
        assert!((jump.value.unwrap() - 0.2).abs() < 0.005, "{jump:?}");
        assert_eq!(severity_of(&findings, Check::Speed), Severity::Fine);
    }

    #[test]
    fn a_value_beyond_its_limit_stops_the_flight_with_time_and_place() {
        let limits =
            EvenStyle { dark_speed_m_s: 2.0, acceleration_m_s2: 4.0, ..EvenStyle::default() };
        assert_eq!(severity_of(&even("NOOR", limits), Check::Acceleration), Severity::Stop);
        let wide = LetterOptions { width_m: Some(2.0), ..LetterOptions::default() };
        let wide = plan(&write("NOOR", &wide).unwrap(), &PlanOptions::even()).unwrap();
        let volume = &check_plans(&[wide], &Profile::indoor())[0];
        assert_eq!((volume.check, volume.severity), (Check::Volume, Severity::Stop));
        let [x, ..] = volume.position_m.unwrap();
        assert!((x.abs() - 2.5 - volume.value.unwrap()).abs() < 1e-9, "{volume:?}");
    }

    #[test]
    fn a_room_bounds_the_volume() {
        let plan = plan(&strokes("NOOR"), &PlanOptions::even()).unwrap();
        let volume =
            |profile: Profile| check_plans(std::slice::from_ref(&plan), &profile).swap_remove(0);
        let inside = volume(Profile::indoor());
        assert!((inside.value.unwrap() + 1.5).abs() < 0.05, "1 m of 2.5 m high: {inside:?}");
        let small = volume(Profile::indoor().in_room([1.5, 1.5, 1.0]));
        assert_eq!(small.severity, Severity::Stop);
        let [x, _, z] = small.position_m.unwrap();
        let by_m = (x.abs() - 0.55).max(z - 0.8);
        assert!((by_m - small.value.unwrap()).abs() < 1e-9, "0.2 m from the walls: {small:?}");
        let hall = volume(Profile::indoor().in_room([50.0, 50.0, 50.0]));
        assert_eq!(hall.value, inside.value, "the profile's limits hold in a hall, too");
    }

    #[test]
    fn dimmed_headlights_are_found() {
        let severity = |exposure| {
            severity_of(
                &even("O", EvenStyle { exposure, ..EvenStyle::default() }),
                Check::Headlights,
            )
        };
        assert_eq!(severity(LightLevel::Dimmed), Severity::Warning);
        assert_eq!(severity(LightLevel::Switched), Severity::Fine);
    }

    #[test]
    fn drones_in_conflict_do_not_fly() {
        let alone = plan(&strokes("NO"), &PlanOptions::even()).unwrap();
        let findings = check_plans(&[alone.clone(), alone], &Profile::indoor());
        assert_eq!(severity_of(&findings, Check::Separation), Severity::Stop);
        let options = PlanOptions { drones: 2, ..PlanOptions::even() };
        let findings = check_plans(&fleet(&strokes("NO"), &options).unwrap(), &Profile::indoor());
        let apart = findings.iter().find(|f| f.check == Check::Separation).unwrap();
        assert_eq!(apart.severity, Severity::Fine);
        assert!((MIN_HORIZONTAL_M..3.0).contains(&apart.value.unwrap()), "{apart:?}");
        let numbers: Vec<_> = findings.iter().filter(|f| f.check == Check::Speed).collect();
        assert_eq!(numbers.iter().map(|f| f.drone).collect::<Vec<_>>(), [Some(1), Some(2)]);
    }
}
