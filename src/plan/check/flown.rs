//! What became of a plan in a simulated flight: where it went, what it asked of the drone, and how
//! its light fell.

use super::{Finding, Profile, Severity};
use crate::flight::{Flight, FlightSample};
use crate::plan::lamp::StrokeEnd;
use crate::statistics::weighted_quantile;

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
    weighted_quantile(&mut doses, 0.5).unwrap_or(0.0)
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

    fn of<'a>(findings: &'a [Finding], check: &str) -> &'a Finding {
        findings.iter().find(|finding| finding.check == check).unwrap()
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
