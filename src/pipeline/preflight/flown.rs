//! Checks of a simulated flight: its path, its demands on the drone, and its light.

use super::picture::{Picture, Piece, lit_pieces};
use super::plans::hovers_s;
use super::{
    CAP_HEIGHT_M, GRAVITY_M_S2, Profile, at_time, cap_height_m, largest, platform, stop_if, warn_if,
};
use crate::scene::Scene;
use crate::shoot::{CHECK_LIGHT, Shoot, stroke_end_errors};
use noctograph_core::crazyflie::N_MOTORS;
use noctograph_core::diagnostic::{Diagnostic, Severity};
use noctograph_core::error::Result;
use noctograph_core::flight::{BATTERY_V, Flight, FlightSample, SATURATED_S, saturated_s, warning};
use noctograph_core::statistics::weighted_quantile;
use noctograph_core::units::{MM_PER_M, MS_PER_S};
use noctograph_export::safety::{Battery, LOW_BATTERY_S};
use noctograph_letters::Strokes;
use noctograph_picture::expose::meter::LampReading;
use noctograph_plan::tracking::{Part, least_cap_height_m};
use noctograph_plan::{LightClock, PlanOptions, StrokeEnd, Style};
use noctograph_sim::sensors::Positioning;

/// Minimum ratio of a dose to the median at which a lamp counts as dwelling on a spot: two stops.
const DWELL: f64 = 4.0;
/// Maximum dwell time of a lit lamp that causes no warning.
const MAX_DWELL_S: f64 = 0.1;
/// Maximum streak at the end of a stroke, as a fraction of the cap height. A letter with such a
/// streak has a hook but is readable. The drone's wobble causes up to 46 mm in the default scene.
const MAX_STREAK_FRAC: f64 = 0.1;
/// Maximum exposure range along a trail, in stops. The trail of a Gaussian spot is white over a
/// width of `2σ √(2 ln 2)` at one stop above saturation, twice that at four stops and 2.2 times
/// that at five, which looks like two pens. The headlights in NOOR, which is readable, have 4.2
/// stops.
const MAX_UNEVEN_STOPS: f64 = 4.5;
/// Maximum saturation time of a motor that does not affect the flight. The time constant of a
/// Crazyflie's motors is at least 0.07 s.
const BRIEF_SATURATED_S: f64 = 0.07;
/// Minimum saturation time of a motor that stops the flight.
pub const MAX_SATURATED_S: f64 = 0.5;

/// Checks the simulated flight of drone `drone`, counted from 0: its path, its demands on motors
/// and battery, and its light in the picture. Returns a finding for each check.
pub(super) fn check_flight(
    shoot: &Shoot,
    drone: usize,
    flight: &Flight,
    picture: Option<&Picture>,
    profile: &Profile,
) -> Result<Vec<Diagnostic>> {
    let (scene, strokes) = (&shoot.scene, shoot.strokes.as_ref());
    // A picture already contains the light of this flight.
    let trace = match picture.and_then(|picture| picture.drone_light(drone)) {
        Some(trace) => trace,
        None => shoot.light_drone(drone, flight)?,
    };
    let (pieces, ends) = noctograph_core::parallel::join(
        || lit_pieces(flight, &trace, scene),
        || stroke_end_errors(scene, &shoot.plans[drone].plan, flight).unwrap_or_default(),
    );
    let trail = picture.and_then(|picture| picture.trail(drone));
    Ok(vec![
        corridor(flight, scene, profile),
        altitude_hold(flight, strokes),
        tilt(flight, profile),
        motors(flight, scene.vehicle.motor_max),
        thrust(flight, scene),
        battery(flight, scene),
        lit_transit(&ends, &pieces, strokes, scene.plan.light_clock),
        dwell(&pieces, &scene.plan),
        evenness(trail.map(LampReading::evenness_stops)),
    ])
}

/// Checks that the letters are tall enough for the altitude error. The value is the cap height in m
/// that the error permits.
fn altitude_hold(flight: &Flight, strokes: Option<&Strokes>) -> Diagnostic {
    fn unchecked(why: &str, advice: &'static str) -> Diagnostic {
        let wanted = "letters of a known height, not a drawing";
        Diagnostic::unchecked("altitude hold", why, wanted, advice)
    }
    let name_word = "name the word of the plans: {word}";
    // The limit of the error is a fraction of the cap height, which is undefined for a drawing.
    let Some(cap_height_m) = strokes.and_then(cap_height_m) else {
        return if strokes.is_some_and(|strokes| strokes.font.is_none()) {
            unchecked("a drawing has no letters", "look at the drawing's preview")
        } else {
            unchecked("the plan has no letters of known height", name_word)
        };
    };
    let Ok(least_m) = least_cap_height_m(flight, Part::Letters) else {
        return unchecked("the flight writes no letter", name_word);
    };
    Diagnostic::check("altitude hold", warn_if(least_m > cap_height_m), least_m)
        .within(cap_height_m)
        .say(
            format!("precise enough for letters at least {least_m:.2} m tall"),
            format!(
                "an altitude error of up to {:.0} mm, a twentieth of the letters' height",
                MM_PER_M / 20.0 * cap_height_m
            ),
            "write larger letters ({letters.cap_height_m}), or fewer if the canvas shrinks them \
             ({letters.canvas_m}), or fly a better height sensor",
        )
}

/// Checks that the depth error in m stays within the profile's corridor. The help names the most
/// probable cause.
fn corridor(flight: &Flight, scene: &Scene, profile: &Profile) -> Diagnostic {
    let errors = flight.samples.iter().map(|s| (s.position_m.y - s.design_m.y, s.time_s));
    let worst = errors.clone().max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
    let ((error_m, time_s), most_m) = (worst.unwrap_or_default(), profile.corridor_m);
    let n_samples = flight.samples.len().max(1);
    let mean_m = errors.map(|(error_m, _)| error_m).sum::<f64>() / n_samples as f64;
    let (lighthouse, positioning) = (&scene.sensors.lighthouse, &scene.sensors.positioning);
    let is_optical = matches!(positioning, Positioning::CrossingBeams | Positioning::Sweeps);
    let reflects = !(lighthouse.mirrors_m.is_empty() && lighthouse.panes_m.is_empty());
    Diagnostic::check("corridor", stop_if(error_m.abs() > most_m), error_m)
        .within(most_m)
        .timed(time_s)
        .say(
            format!("deviates by {error_m:+.2} m in depth{}", at_time(time_s)),
            format!("within ±{most_m} m of the design"),
            // The most probable cause is tested first: a disturbance of the stations' light.
            match positioning {
                _ if is_optical && !lighthouse.people_m.is_empty() => {
                    "move people out of the light ({sensors.lighthouse.people_m})"
                }
                _ if is_optical && reflects => "cover the mirrors ({sensors.lighthouse.mirrors_m})",
                _ if is_optical && !lighthouse.silent.is_empty() => {
                    "make sure that every station transmits ({sensors.lighthouse.silent})"
                }
                Positioning::UwbTwr | Positioning::UwbTdoa => {
                    "mount the anchors around the flight, in front of it and behind it \
                     ({sensors.uwb.anchors_m})"
                }
                Positioning::Gnss => "fly in calmer air, or use a better receiver",
                // A plan can compensate for a mean error, but not for a varying one.
                _ if mean_m.abs() > 0.5 * error_m.abs() => {
                    "subtract the mean error ({plan.mean_error_m})"
                }
                Positioning::Position | Positioning::CrossingBeams | Positioning::Sweeps => {
                    "find the cause of the disturbance: the wind ({air.wind_m_s}), or the \
                     positions of the stations"
                }
            },
        )
}

/// Checks the maximum tilt from the vertical in rad during the flight.
fn tilt(flight: &Flight, profile: &Profile) -> Diagnostic {
    fn tilt_rad(s: &FlightSample) -> f64 {
        libm::acos((libm::cos(s.attitude.pitch_rad) * libm::cos(s.attitude.roll_rad)).min(1.0))
    }
    let (value_rad, time_s) = largest(flight.samples.iter().map(|s| (tilt_rad(s), s.time_s)));
    let most_rad = profile.tilt_rad;
    Diagnostic::check("tilt", stop_if(value_rad > most_rad), value_rad).within(most_rad).timed(time_s).say(
        format!("{:.1}°{}", value_rad.to_degrees(), at_time(time_s)),
        format!("up to {:.0}°", most_rad.to_degrees()),
        "lower {plan.style.acceleration_m_s2} or {plan.style.jerk_m_s3}, and check that the plan has \
         no jump",
    )
}

/// Checks the time in s for which a motor is saturated. `motor_max` is the maximum command.
fn motors(flight: &Flight, motor_max: f64) -> Diagnostic {
    let first = flight.samples.iter().find(|sample| sample.is_saturated(motor_max));
    let time_s = first.map(|sample| sample.time_s);
    // A simulated flight counts saturated controller ticks, which are shorter than its samples.
    let counted_s = flight.at_end(SATURATED_S);
    let duration_s = counted_s.unwrap_or_else(|| saturated_s(&flight.samples, motor_max));
    let severity = if duration_s > MAX_SATURATED_S {
        Severity::Stop
    } else {
        warn_if(duration_s > BRIEF_SATURATED_S)
    };
    Diagnostic::check("motors", severity, duration_s).within(BRIEF_SATURATED_S).timed(time_s).say(
        match duration_s {
            0.0 => "never at their limit".to_owned(),
            s => format!("{:.0} ms at their limit, first{}", MS_PER_S * s, at_time(time_s)),
        },
        format!("up to {:.0} ms at their limit", MS_PER_S * BRIEF_SATURATED_S),
        "lower {plan.style.acceleration_m_s2}, or fly a drone with more thrust for its weight",
    )
}

/// Maximum fraction of the thrust that hovering may require (an assumption). The remainder is for
/// attitude control and climbing. A Crazyflie 2.1 with two decks requires two thirds.
const MAX_HOVER_FRAC: f64 = 0.85;

/// Checks the fraction of the maximum thrust that hovering requires at the final voltage.
fn thrust(flight: &Flight, scene: &Scene) -> Diagnostic {
    let weight_n = scene.vehicle.mass_kg * GRAVITY_M_S2;
    let full_n = weight_n / scene.vehicle.hover_throttle();
    let has_battery = scene.battery.capacity_ah > 0.0;
    // The voltage is taken at the last sample in the air, because a battery recovers at rest.
    let battery_v = flight.extra.get(BATTERY_V).filter(|_| has_battery);
    let last = flight.samples.iter().rposition(|sample| sample.position_m.z > AIRBORNE_M);
    let end_v = battery_v.and_then(|battery_v| battery_v.get(last?)).copied();
    // The thrust of each of the four rotors is a polynomial in the voltage.
    let [t0, t1, t2, t3] = scene.battery.thrust_from_v_n;
    let at_end_n = end_v.map_or(full_n, |v| N_MOTORS * (t0 + v * (t1 + v * (t2 + v * t3))));
    let frac = weight_n / at_end_n.min(full_n);
    Diagnostic::check("thrust", warn_if(frac > MAX_HOVER_FRAC), frac).within(MAX_HOVER_FRAC).say(
        format!("hovering takes {:.0} % of the maximum thrust", 100.0 * frac),
        format!(
            "up to {:.0} %, so that thrust remains for steering and climbing",
            100.0 * MAX_HOVER_FRAC
        ),
        "reduce the weight ({vehicle.mass_kg}), or fly a drone with more thrust",
    )
}

/// Minimum height at which a drone counts as airborne and its battery as loaded.
const AIRBORNE_M: f64 = 0.2;

/// Checks that the battery lasts for the flight, by the same rule as exported scripts.
fn battery(flight: &Flight, scene: &Scene) -> Diagnostic {
    if scene.battery.capacity_ah <= 0.0 {
        let why = "the scene's drone has no battery model";
        let advice = "name a preset with one, such as `{preset=cf21}`";
        return Diagnostic::unchecked("battery", why, "a drone with a battery", advice);
    }
    let low_v =
        platform(scene).map_or(scene.battery.cut_off_v, |platform| platform.low_battery_v());
    let warning = flight.warnings.iter().rfind(|w| warning::BATTERY.contains(&w.code));
    let load = Battery::new(&scene.battery, flight, low_v);
    let lasts = load.as_ref().is_none_or(Battery::lasts);
    let never =
        format!("less than {LOW_BATTERY_S} s below {low_v} V, which the firmware considers low");
    // The limit is a resting voltage before take-off, which a script can measure.
    let (voltages, wanted) = match &load {
        None => ("lasts".to_owned(), never),
        Some(Battery { rest_v, sag_v, least_rest_v, .. }) => {
            // The time of hovering explains an empty battery better than voltages do.
            let verdict = match hovers_s(scene) {
                Some(hovers_s) if !lasts => {
                    format!("does not last: only {hovers_s:.0} s of hovering")
                }
                _ => if lasts { "lasts" } else { "does not last" }.to_owned(),
            };
            let lowest_v = rest_v - sag_v;
            let wanted = match least_rest_v {
                Some(least_v) => format!("{least_v:.2} V at rest or more: {never}"),
                None => format!("{never}, which no full battery achieves"),
            };
            let voltages =
                format!("{verdict}: {rest_v:.2} V at rest, {lowest_v:.2} V at the highest load");
            (voltages, wanted)
        }
    };
    // A warning from the simulation, such as a cut-off, precedes the voltages.
    let detail = warning.map(ToString::to_string).unwrap_or_default();
    let actual = if detail.is_empty() { voltages } else { format!("{detail} ({voltages})") };
    let rest_v = load.as_ref().map(|load| load.rest_v);
    let limit_v = load.and_then(|load| load.least_rest_v).unwrap_or(0.0);
    let severity = stop_if(warning.is_some() || !lasts);
    Diagnostic::check("battery", severity, rest_v).within(limit_v).detailed(detail).say(
        actual,
        wanted,
        "charge the battery ({battery.charge_frac}), write fewer letters, hover less \
         ({plan.style.hover_s}), or divide the letters between drones ({plan.drones=2})",
    )
}

const NO_LAMP: &str = "no lamp follows the plan's light commands";

/// Returns the result "unknown" of a light check, for a flight without light.
fn without_light(check: &'static str, why: &str) -> Diagnostic {
    Diagnostic::unchecked(check, why, "light along the strokes", CHECK_LIGHT)
}

/// Checks the light at the ends of strokes by the largest distance in m between an end and the
/// place at which the light switches.
fn lit_transit(
    ends: &[StrokeEnd],
    pieces: &[Piece],
    strokes: Option<&Strokes>,
    clock: LightClock,
) -> Diagnostic {
    let worst = ends.iter().max_by(|a, b| a.streak_m.abs().total_cmp(&b.streak_m.abs()));
    let Some(StrokeEnd { time_s, at_m, on, streak_m }) = worst.copied() else {
        return without_light("lit transit", "the flight contains no lit stroke");
    };
    if pieces.is_empty() {
        return without_light("lit transit", NO_LAMP);
    }
    let cap_height_m = strokes.and_then(cap_height_m).unwrap_or(CAP_HEIGHT_M);
    let most_m = MAX_STREAK_FRAC * cap_height_m;
    // A positive streak means too much light, and a negative one too little.
    let what = match (streak_m > 0.0, on) {
        (true, true) => "light before a stroke begins",
        (true, false) => "light after a stroke ends",
        (false, true) => "a stroke's beginning without light",
        (false, false) => "a stroke's end without light",
    };
    let row = Diagnostic::check("lit transit", warn_if(streak_m.abs() > most_m), streak_m);
    let row = row.within(most_m).timed(time_s).detailed(if on { "beginning" } else { "end" });
    let (streak_mm, when, x, z) = (MM_PER_M * streak_m.abs(), at_time(time_s), at_m.x, at_m.z);
    row.positioned(<[f64; 3]>::from(at_m)).say(
        format!("up to {streak_mm:.0} mm of {what}{when} ({x:.2}, {z:.2})"),
        format!(
            "within {:.0} mm of strokes' ends, a tenth of the letters' height",
            MM_PER_M * most_m
        ),
        match clock {
            LightClock::Light => "slow down ({plan.stroke_speed_m_s})",
            LightClock::Setpoint => {
                "set {plan.light_clock=light}, or slow down ({plan.stroke_speed_m_s})"
            }
        },
    )
}

/// Checks the maximum time in s for which a lamp dwells on a spot, which would be overexposed.
fn dwell(pieces: &[Piece], plan: &PlanOptions) -> Diagnostic {
    if pieces.is_empty() {
        return without_light("lit dwell", NO_LAMP);
    }
    let (dwell_s, time_s) = longest_dwell(pieces);
    let row = Diagnostic::check("lit dwell", warn_if(dwell_s > MAX_DWELL_S), dwell_s);
    row.within(MAX_DWELL_S).timed(time_s).say(
        match dwell_s {
            0.0 => "none".to_owned(),
            s => {
                let dwell_ms = MS_PER_S * s;
                format!("{dwell_ms:.0} ms of light two stops above the rest{}", at_time(time_s))
            }
        },
        format!("less than {:.0} ms of such light", MS_PER_S * MAX_DWELL_S),
        // The remedy depends on what decides the speed of the light.
        match (&plan.style, plan.light_clock) {
            (Style::Even(_), _) => {
                "lower {plan.stroke_speed_m_s}, so that the drone does not have to brake, or dim \
                 the light with the speed ({plan.style.exposure=dimmed}, for a ring or a color \
                 LED)"
            }
            (_, LightClock::Setpoint) => {
                "plan with {plan.style=even}, or set {plan.light_clock=light}"
            }
            (_, LightClock::Light) => "plan with {plan.style=even}",
        },
    )
}

/// Returns the duration of light in s in the longest run of pieces with at least [`DWELL`] times
/// the median dose, and the start time in s of the run. Returns zeros if there is no such run.
fn longest_dwell(pieces: &[Piece]) -> (f64, f64) {
    // The dose is light per unit length. Its median is weighted by length.
    let moving = pieces.iter().filter(|piece| piece.length_m > 0.0);
    let mut doses: Vec<(f64, f64)> =
        moving.map(|piece| (piece.light_s / piece.length_m, piece.length_m)).collect();
    let median = weighted_quantile(&mut doses, 0.5).unwrap_or(0.0);
    let (mut longest_s, mut longest_from_s) = (0.0, 0.0);
    let (mut run_s, mut run_from_s) = (0.0, 0.0);
    for Piece { time_s, length_m, light_s } in pieces {
        if *light_s > DWELL * median * length_m && *light_s > 0.0 {
            if run_s == 0.0 {
                run_from_s = *time_s;
            }
            run_s += light_s;
            if run_s > longest_s {
                (longest_s, longest_from_s) = (run_s, run_from_s);
            }
        } else {
            run_s = 0.0;
        }
    }
    (longest_s, longest_from_s)
}

/// Checks the exposure range, in stops, along the brightest trail in the picture. `stops` is `None`
/// for a picture without a trail.
fn evenness(stops: Option<f64>) -> Diagnostic {
    let Some(stops) = stops else {
        return without_light("evenness", "no light of the plan is in the picture");
    };
    Diagnostic::check("evenness", warn_if(stops > MAX_UNEVEN_STOPS), stops)
        .within(MAX_UNEVEN_STOPS)
        .say(
            format!("exposure varies by {stops:.1} stops along the trail"),
            format!(
                "within {MAX_UNEVEN_STOPS} stops, from the 5th to the 95th percentile, as `meter` \
             measures"
            ),
            "turn the nose ({plan.yaw_rad}) or the writing lamp ({light.fixtures}) toward the \
         camera, or write more slowly ({plan.stroke_speed_m_s})",
        )
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use noctograph_core::flight::FlightData;
    use noctograph_letters::{LetterOptions, write};

    #[test]
    fn a_spot_with_too_much_light_is_found() {
        // The trail is one meter long with 5 s of light, followed by a millimeter with 0.3 s.
        let piece = |time_s, length_m, light_s| Piece { time_s, length_m, light_s };
        let mut pieces: Vec<Piece> =
            (0..100).map(|k| piece(f64::from(k) * 0.05, 0.01, 0.05)).collect();
        let dwell = |pieces: &[Piece]| dwell(pieces, &PlanOptions::default());
        assert_eq!(dwell(&pieces).severity, Severity::Fine);
        pieces.insert(50, piece(2.5, 0.001, 0.3));
        let actual = dwell(&pieces);
        let figures = ["value", "limit", "time_s"].map(|name| actual.number(name));
        assert_eq!(figures, [0.3, 0.1, 2.5].map(Some));
        assert_eq!(actual.severity, Severity::Warning);
    }

    #[test]
    fn letters_are_as_high_as_the_error_of_the_height_asks() {
        let strokes = write("I", &LetterOptions::default()).unwrap();
        fn sample_at(k: u32, error_m: f64) -> FlightSample {
            let design_m = Vector3::new(0.01 * f64::from(k), 0.0, 1.0);
            let position_m =
                design_m + Vector3::z() * if k.is_multiple_of(2) { error_m } else { -error_m };
            let (time_s, letter) = (0.1 * f64::from(k), Some(0));
            FlightSample { time_s, position_m, design_m, letter, ..FlightSample::default() }
        }
        let finding = |error_m: f64| {
            let samples = (0..100).map(|k| sample_at(k, error_m)).collect();
            let flight = Flight::made(FlightData { samples, ..FlightData::default() });
            altitude_hold(&flight, Some(&strokes))
        };
        let (good, bad) = (finding(0.02), finding(0.03));
        assert!((good.number("value").unwrap() - 0.4).abs() < 0.01, "2 cm for 40 cm: {good:?}");
        assert_eq!((good.severity, bad.severity), (Severity::Fine, Severity::Warning));
        let unwritten = altitude_hold(&Flight::default(), Some(&strokes));
        assert_eq!(unwritten.severity, Severity::Unknown);
    }

    #[test]
    fn a_check_without_an_input_is_none() {
        let nothing = Flight::default();
        let (at_m, on, streak_m) = (Vector3::zeros(), true, 0.01);
        let end = StrokeEnd { time_s: 1.0, at_m, on, streak_m };
        for row in [
            altitude_hold(&nothing, None),
            battery(&nothing, &Scene { battery: Default::default(), ..Scene::default() }),
            lit_transit(
                &[],
                &[Piece { time_s: 0.0, length_m: 0.1, light_s: 0.1 }],
                None,
                LightClock::Light,
            ),
            // The lamp is on continuously.
            lit_transit(&[end], &[], None, LightClock::Light),
            dwell(&[], &PlanOptions::default()),
            evenness(None),
        ] {
            assert_eq!((row.severity, row.number("value")), (Severity::Unknown, None), "{row:?}");
            assert!(!row.detail().is_empty() && !row.help.is_empty(), "it says why: {row:?}");
        }
    }

    #[test]
    fn a_flight_of_ours_says_itself_how_long_a_motor_was_at_its_limit() {
        let extra = [(SATURATED_S.to_owned(), vec![0.0, 0.084])].into();
        let samples = vec![FlightSample::default(); 2];
        let flight = Flight::made(FlightData { samples, extra, ..FlightData::default() });
        assert_eq!(motors(&flight, 1.0).number("value"), Some(0.084));
    }

    #[test]
    fn motors_at_their_limit_for_an_instant_are_fine() {
        let actual = [0, 4, 20, 60].map(|lasts| {
            let samples = (0..100).map(|k| FlightSample {
                time_s: 0.01 * f64::from(k),
                motors: if k < lasts { [1.0; 4] } else { [0.5; 4] },
                ..FlightSample::default()
            });
            let samples = samples.collect();
            let flight = Flight::made(FlightData { samples, ..FlightData::default() });
            motors(&flight, 1.0).severity
        });
        let wanted = [Severity::Fine, Severity::Fine, Severity::Warning, Severity::Stop];
        assert_eq!(actual, wanted);
    }
}
