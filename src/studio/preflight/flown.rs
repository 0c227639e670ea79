//! Checks of a simulated flight: its path, its demands on the drone, and its light.

use super::Profile;
use super::Severity;
use super::row::{Peak, Row, at, stop_if, warn_if};
use crate::shoot::CHECK_LIGHT;
use noctograph_core::flight::tracking::{Part, least_cap_height_m};
use noctograph_core::flight::{Flight, FlightSample, SATURATED_S, Warning, saturated_s};
use noctograph_core::statistics::weighted_quantile;
use noctograph_export::safety::{Battery, LOW_BATTERY_S};
use noctograph_flying::plan::{LightClock, PlanOptions, StrokeEnd, Style};
use noctograph_flying::vehicle::BatteryOptions;

/// A simulated flight of a plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flown<'a> {
    /// The flight.
    pub(super) flight: &'a Flight,
    /// How its plan was made.
    pub(super) plan: &'a PlanOptions,
    /// Light errors at its strokes' ends.
    pub(super) ends: &'a [StrokeEnd],
    /// Pieces of its light in order of time: `(time in s, length in m, seconds of full light)`;
    /// none where no lamp follows it.
    pub(super) painted: &'a [(f64, f64, f64)],
    /// Range of the exposure along its brightest trail in the picture, stops; `None` where it
    /// leaves none.
    pub(super) evenness_stops: Option<f64>,
    /// Heading at which it would vary least, rad, and by how much, stops; `None` where that is no
    /// better.
    pub(super) evener: Option<[f64; 2]>,
    /// Cap height of its letters; `None` of a drawing, and where no word is named.
    pub(super) cap_height_m: Option<f64>,
    /// Whether it draws a file.
    pub(super) is_drawing: bool,
    /// Largest motor command.
    pub(super) motor_max: f64,
    /// The simulated drone's battery; no capacity: one that does not sag.
    pub(super) battery: &'a BatteryOptions,
    /// Voltage under load that its firmware calls low, V.
    pub(super) low_battery_v: f64,
}

/// Ratio to the median dose from which light dwells on a spot: two stops.
const DWELL: f64 = 4.0;
/// Longest lit dwell.
const MAX_DWELL_S: f64 = 0.1;
/// Largest streak at a stroke's end, as a share of the cap height: it is seen as a hook, and the
/// letter is still read. The drone's own wobble leaves up to 46 mm in the default scene.
const MAX_STREAK_FRAC: f64 = 0.1;
/// Cap height that stands for a drawing's, m.
const DRAWN_CAP_HEIGHT_M: f64 = 0.5;
/// Largest range of the exposure along a trail, stops: a Gaussian spot's trail from one to four
/// stops over saturation is white over a width of `2σ √(2 ln 2)` to twice that, and looks of two
/// pens.
const MAX_UNEVEN_STOPS: f64 = 3.0;
/// Time at a motor's limit that no flight shows: the motors of a Crazyflie follow in 0.07 s or
/// more.
const BRIEF_SATURATED_S: f64 = 0.07;
/// Time at a motor's limit from which the flight is stopped.
pub(crate) const MAX_SATURATED_S: f64 = 0.5;

/// Checks a simulated flight.
pub(super) fn check_flown(flown: &Flown<'_>, profile: &Profile) -> Vec<Row> {
    vec![
        corridor(flown, profile),
        altitude_hold(flown),
        tilt(flown, profile),
        motors(flown),
        battery(flown),
        streaks(flown),
        dwell(flown),
        evenness(flown),
    ]
}

/// Whether the letters are high enough for the error of the height.
fn altitude_hold(flown: &Flown<'_>) -> Row {
    let unchecked = |why, advice| {
        let wanted = "letters of a known height, not a drawing";
        Row::unchecked("altitude hold", why, wanted, advice)
    };
    let of_plans = "name the word of the plans: {word}";
    let Some(cap_height_m) = flown.cap_height_m else {
        return match flown.is_drawing {
            true => unchecked("a drawing has no letters", "look at its preview"),
            false => unchecked("there are no letters whose height is known", of_plans),
        };
    };
    match least_cap_height_m(flown.flight, Part::Letters) {
        Ok(least_m) => {
            let row = Row::of("altitude hold", warn_if(least_m > cap_height_m), least_m);
            Row { limit: cap_height_m, ..row }.say(
                format!("precise enough for letters of {least_m:.2} m or more"),
                format!(
                    "error of the height up to {:.0} mm, a twentieth of the letters",
                    50.0 * cap_height_m
                ),
                "write larger letters, or fewer where a canvas shrinks them \
                 ({letters.cap_height_m}, {letters.canvas_m}), or fly a better height sensor",
            )
        }
        Err(_) => unchecked("the flight writes no letter", of_plans),
    }
}

fn corridor(flown: &Flown<'_>, profile: &Profile) -> Row {
    let samples = flown.flight.samples.iter();
    let places = samples.map(|s| (s.position_m.y, s.time_s));
    let farthest = places.max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
    let (value, time_s) = farthest.unwrap_or_default();
    let most = profile.corridor_m;
    let peak = Peak { value, most, time_s: Some(time_s) };
    peak.row("corridor", stop_if(value.abs() > most)).say(
        format!("strays to y = {value:+.2} m{}", at(time_s)),
        format!("within ±{most} m"),
        "take the mean error off ({plan.mean_error_m}), or fly lqr-integral",
    )
}

fn tilt(flown: &Flown<'_>, profile: &Profile) -> Row {
    let tilt_rad = |s: &FlightSample| {
        libm::acos((libm::cos(s.attitude.pitch_rad) * libm::cos(s.attitude.roll_rad)).min(1.0))
    };
    let samples = flown.flight.samples.iter();
    let tilts = samples.map(|s| (tilt_rad(s), s.time_s));
    let peak @ Peak { value, most, time_s } = Peak::of(tilts, profile.tilt_rad);
    peak.row("tilt", stop_if(value > most)).say(
        format!("{:.1}°{}", value.to_degrees(), at(time_s)),
        format!("up to {:.0}°", most.to_degrees()),
        "lower {plan.style.acceleration_m_s2} or {plan.style.jerk_m_s3}; check that the plan has \
         no jump",
    )
}

fn motors(flown: &Flown<'_>) -> Row {
    let samples = &flown.flight.samples;
    let first = samples.iter().find(|s| s.is_saturated(flown.motor_max));
    let time_s = first.map(|s| s.time_s);
    // A flight of ours counts the controller's own ticks.
    let counted_s = flown.flight.at_end(SATURATED_S);
    let value = counted_s.unwrap_or_else(|| saturated_s(samples, flown.motor_max));
    let severity = match value {
        s if s > MAX_SATURATED_S => Severity::Stop,
        s => warn_if(s > BRIEF_SATURATED_S),
    };
    Peak { value, most: BRIEF_SATURATED_S, time_s }.row("motors", severity).say(
        match value {
            0.0 => "never at their limit".to_owned(),
            s => format!("{:.0} ms at their limit, first{}", 1e3 * s, at(time_s)),
        },
        format!("up to {:.0} ms at their limit", 1e3 * BRIEF_SATURATED_S),
        "lower {plan.style.acceleration_m_s2}, or fly a drone with more thrust for its weight",
    )
}

/// What the flight takes of the battery: the one rule of the check and of exported scripts.
fn battery(flown: &Flown<'_>) -> Row {
    if flown.battery.capacity_ah <= 0.0 {
        let why = "the scene's drone has no battery model";
        let advice = "name a preset with one, such as `{preset=cf21}`";
        return Row::unchecked("battery", why, "a drone with a battery", advice);
    }
    let mut warnings = flown.flight.warnings.iter();
    let is_battery = |it: &&Warning| matches!(it, Warning::BatteryWeak(_) | Warning::BatteryEmpty);
    let (warning, low_v) = (warnings.find(is_battery), flown.low_battery_v);
    let taken = Battery::of(flown.battery, flown.flight, low_v);
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

const NO_LAMP: &str = "no lamp follows the plan's light";

/// A check of the light that there is none for.
fn without_light(check: &'static str, why: &str) -> Row {
    Row::unchecked(check, why, "light along the strokes", CHECK_LIGHT)
}

fn streaks(flown: &Flown<'_>) -> Row {
    let worst = flown.ends.iter().max_by(|a, b| a.streak_m.abs().total_cmp(&b.streak_m.abs()));
    match worst {
        None => without_light("lit transit", "the flight has no lit stroke"),
        Some(_) if flown.painted.is_empty() => without_light("lit transit", NO_LAMP),
        Some(worst) => {
            let cap_height_m = flown.cap_height_m.unwrap_or(DRAWN_CAP_HEIGHT_M);
            lit_transit(worst, MAX_STREAK_FRAC * cap_height_m, flown.plan.light_clock)
        }
    }
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

/// Median dose of light per length, weighted by length.
fn median_dose(painted: &[(f64, f64, f64)]) -> f64 {
    let pieces = painted.iter().filter(|(_, length_m, _)| *length_m > 0.0);
    let mut doses: Vec<(f64, f64)> =
        pieces.map(|(_, length_m, light_s)| (light_s / length_m, *length_m)).collect();
    weighted_quantile(&mut doses, 0.5).unwrap_or(0.0)
}

fn dwell(flown: &Flown<'_>) -> Row {
    if flown.painted.is_empty() {
        return without_light("lit dwell", NO_LAMP);
    }
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
    let (value, time_s) = longest;
    let peak = Peak { value, most: MAX_DWELL_S, time_s: Some(time_s) };
    peak.row("lit dwell", warn_if(value > MAX_DWELL_S)).say(
        match value {
            0.0 => "none".to_owned(),
            s => format!("{:.0} ms of light two stops over the rest{}", 1e3 * s, at(time_s)),
        },
        format!("less than {:.0} ms of it", 1e3 * MAX_DWELL_S),
        match (&flown.plan.style, flown.plan.light_clock) {
            (Style::Even(_), _) => {
                "lower {plan.stroke_speed_m_s}, so that the drone need not brake, or dim the light \
                 with the speed ({plan.style.exposure=dimmed}, for a ring or a color LED)"
            }
            (_, LightClock::Setpoint) => {
                "plan with {plan.style=even}, or set {plan.light_clock=light}"
            }
            (_, LightClock::Light) => "plan with {plan.style=even}",
        },
    )
}

fn evenness(flown: &Flown<'_>) -> Row {
    let Some(value) = flown.evenness_stops else {
        return without_light("evenness", "no light of the plan is in the picture");
    };
    let evener = flown.evener.map_or_else(String::new, |[yaw_rad, stops]| {
        format!(
            "; by {stops:.1} with the nose at {yaw_rad:.2} rad (plan.yaw_rad), where headlights \
             draw two lines beside each other"
        )
    });
    let row = Row::of("evenness", warn_if(value > MAX_UNEVEN_STOPS), value);
    Row { limit: MAX_UNEVEN_STOPS, ..row }.say(
        format!("exposure varies by {value:.1} stops along the trail{evener}"),
        format!(
            "within {MAX_UNEVEN_STOPS:.0} stops, from the 5th to the 95th percentile, as `meter` reads"
        ),
        "turn the nose ({plan.yaw_rad}) or the writing lamp ({light.fixtures}) to the camera, or \
         write slower ({plan.stroke_speed_m_s})",
    )
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use nalgebra::Vector3;

    use super::*;
    use crate::scene::{Preset, Scene};

    #[test]
    fn a_spot_with_too_much_light_is_found() {
        let flight = Flight::default();
        // A meter at 5 s of light a meter, and 0.3 s on a millimeter.
        let mut painted: Vec<(f64, f64, f64)> =
            (0..100).map(|k| (f64::from(k) * 0.05, 0.01, 0.05)).collect();
        let dwell = |painted: &[(f64, f64, f64)]| dwell(&Flown { painted, ..flown(&flight) });
        assert_eq!(dwell(&painted).severity, Severity::Fine);
        painted.insert(50, (2.5, 0.001, 0.3));
        let found = dwell(&painted);
        assert_eq!((found.value, found.limit, found.time_s), (Some(0.3), 0.1, Some(2.5)));
        assert_eq!(found.severity, Severity::Warning);
        assert_eq!(dwell(&[]).severity, Severity::Unknown);
    }

    fn flown(flight: &Flight) -> Flown<'_> {
        static CF21: LazyLock<BatteryOptions> =
            LazyLock::new(|| Scene::preset(Preset::Cf21).battery);
        static PLAN: LazyLock<PlanOptions> = LazyLock::new(PlanOptions::default);
        Flown {
            flight,
            plan: &PLAN,
            ends: &[],
            painted: &[],
            evenness_stops: None,
            evener: None,
            cap_height_m: Some(0.5),
            is_drawing: false,
            motor_max: 1.0,
            battery: &CF21,
            low_battery_v: 3.2,
        }
    }

    #[test]
    fn letters_are_as_high_as_the_error_of_the_height_asks() {
        let at = |k: u32, error_m: f64| {
            let design_m = Vector3::new(0.01 * f64::from(k), 0.0, 1.0);
            let position_m =
                design_m + Vector3::z() * if k.is_multiple_of(2) { error_m } else { -error_m };
            let (time_s, letter) = (0.1 * f64::from(k), Some(0));
            FlightSample { time_s, position_m, design_m, letter, ..FlightSample::default() }
        };
        let finding = |error_m: f64| {
            let samples = (0..100).map(|k| at(k, error_m)).collect();
            altitude_hold(&flown(&Flight { samples, ..Flight::default() }))
        };
        let (good, bad) = (finding(0.02), finding(0.03));
        assert!((good.value.unwrap() - 0.4).abs() < 0.01, "2 cm for 40 cm: {good:?}");
        assert_eq!((good.severity, bad.severity), (Severity::Fine, Severity::Warning));
        assert_eq!(altitude_hold(&flown(&Flight::default())).severity, Severity::Unknown);
    }

    #[test]
    fn a_check_without_an_input_is_none() {
        let nothing = Flight::default();
        let none = BatteryOptions::default();
        let nothing = Flown { cap_height_m: None, battery: &none, ..flown(&nothing) };
        let rows = check_flown(&nothing, &Profile::indoor());
        for check in ["altitude hold", "battery", "lit transit", "lit dwell", "evenness"] {
            let row = rows.iter().find(|row| row.check == check).unwrap();
            assert_eq!((row.severity, row.value), (Severity::Unknown, None), "{row:?}");
            assert!(!row.detail.is_empty() && !row.advice.0.is_empty(), "it says why: {row:?}");
        }
        let end = StrokeEnd { time_s: 1.0, at_m: Vector3::zeros(), on: true, streak_m: 0.01 };
        let unlit = streaks(&Flown { ends: &[end], ..flown(&Flight::default()) });
        assert_eq!(unlit.severity, Severity::Unknown, "its lamp shines all the way");
    }

    #[test]
    fn a_flight_of_ours_says_itself_how_long_a_motor_was_at_its_limit() {
        let extra = [(SATURATED_S.to_owned(), vec![0.0, 0.084])].into();
        let found = motors(&flown(&Flight { extra, ..Flight::default() }));
        assert_eq!(found.value, Some(0.084));
    }

    #[test]
    fn motors_at_their_limit_for_an_instant_are_fine() {
        let severity = |lasts: u32| {
            let sample = |k: u32| FlightSample {
                time_s: 0.01 * f64::from(k),
                motors: if k < lasts { [1.0; 4] } else { [0.5; 4] },
                ..FlightSample::default()
            };
            let samples = (0..100).map(sample).collect();
            motors(&flown(&Flight { samples, ..Flight::default() })).severity
        };
        let found = [0, 4, 20, 60].map(severity);
        let wanted = [Severity::Fine, Severity::Fine, Severity::Warning, Severity::Stop];
        assert_eq!(found, wanted);
    }
}
