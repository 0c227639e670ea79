//! Planning, which converts strokes to timed setpoints and a light schedule.
//!
//! The input is [`Strokes`], and the output a [`Plan`], which contains everything that is sent to
//! one drone. The plane of the word is the world's x-z plane at y = 0.
//!
//! The strokes are divided among the drones ([`fleet`]), and each part becomes a design path
//! ([`plan()`]). For a known drone, the inverse of its position loop then filters the setpoints
//! ([`feedforward`]), and a rehearsed flight determines the times of light commands
//! ([`time_lights`]).
//!
//! There are two styles of flying. Style `team` writes letter by letter with waits, as in the
//! reference flight of 2022. Style `even` writes strokes in the order with the least dark time,
//! rounds their corners within a stated error, and flies at constant speed if the limits permit,
//! with time-optimal transits in the dark.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

use nalgebra::Vector3;

use noctograph_core::error::Result;
use noctograph_core::strokes::Strokes;

mod even;
pub mod feedforward;
mod fleet;
mod infer_lights;
mod lamp;
mod light_letters;
mod light_timing;
mod motion;
mod options;
mod order;
mod pen;
mod replay;
pub mod response;
mod smoothing;
mod speed;
mod stroke_ends;
mod team;
pub mod tracking;
mod transit;

pub use fleet::{
    Approach, MIN_HORIZONTAL_M, MIN_VERTICAL_M, closest, conflict, downwash_approach, fleet,
};
pub use infer_lights::infer_lights;
pub use lamp::LampTiming;
pub use light_letters::light_letters;
pub use light_timing::{Between, time_lights};
pub use noctograph_core::lamps::HEADLIGHTS;
pub use noctograph_core::plan::{Plan, PlanData, Setpoint, csv};
pub use options::{
    EvenStyle, Extent, LightClock, LightLevel, Order, PlanOptions, ReferenceKind, Style, TeamStyle,
};
pub use replay::{Replay, replay};
pub use stroke_ends::{StrokeEnd, stroke_ends};

/// Plans the flight of one drone that writes all strokes, in the style of the options.
///
/// # Errors
///
/// Returns [`Input`](noctograph_core::error::Error::Input) for an option out of range or a drawing
/// without light. Returns [`Infeasible`](noctograph_core::error::Error::Infeasible) for a flight
/// longer than an hour or a drawing of more than 10 000 strokes.
pub fn plan(strokes: &Strokes, options: &PlanOptions) -> Result<Plan> {
    options.check()?;
    let plan = match &options.style {
        Style::Team(style) => team::plan(strokes, options, style)?,
        Style::Even(style) => {
            let strokes = order::in_order(strokes, options.stroke_speed_m_s, style)?;
            even::plan(&strokes, options, style, None)?
        }
    };
    Ok(adjusted(plan, options))
}

/// Returns a plan with the options' heading, slowed to the trajectory's clock, and moved by the
/// mean error.
fn adjusted(mut plan: Plan, options: &PlanOptions) -> Plan {
    if plan.yaw_rad != options.yaw_rad {
        plan.edit(|plan| plan.yaw_rad = options.yaw_rad);
    }
    let plan = match options.trajectory_clock {
        None | Some(1.0) => plan,
        Some(rate) => light_timing::on_trajectory_clock(plan, rate),
    };
    match Vector3::from(options.mean_error_m) {
        zero if zero == Vector3::zeros() => plan,
        mean_error_m => feedforward::offset(&plan, mean_error_m),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::error::Error;
    use noctograph_letters::{LetterOptions, write};

    /// Returns the plan of a word in the reference team's letters.
    pub(crate) fn written(word: &str, options: &PlanOptions) -> Plan {
        plan(&write(word, &LetterOptions::default()).unwrap(), options).unwrap()
    }

    fn noor(extent: Extent) -> Plan {
        written("NOOR", &PlanOptions { extent, ..PlanOptions::default() })
    }

    #[test]
    fn the_letters_of_noor_take_as_long_as_in_the_reference_flight() {
        let duration_s = noor(Extent::Letters).duration_s();
        assert!((duration_s - 46.118_038).abs() < 1e-5, "{duration_s} s instead of 46.118 s");
    }

    #[test]
    fn the_whole_flight_starts_and_ends_on_the_floor_in_the_dark() {
        let plan = noor(Extent::Whole);
        let (first, last) = (plan.setpoints[0], plan.setpoints[plan.setpoints.len() - 1]);
        assert_eq!((first.position_m, last.position_m), (Vector3::zeros(), Vector3::zeros()));
        let lit = &plan.lights["headlights"];
        assert_eq!((lit[0], lit[lit.len() - 1]), (0.0, 0.0), "dark at both ends");
        assert!(plan.setpoints.windows(2).all(|p| p[0].time_s < p[1].time_s), "time rises");
    }

    #[test]
    fn the_design_is_continuous_within_a_segment_and_steps_between_letters() {
        let plan = noor(Extent::Letters);
        let jumps: Vec<f64> = plan
            .setpoints
            .windows(2)
            .map(|p| (p[1].position_m - p[0].design_m(p[1].time_s)).norm())
            .filter(|jump| *jump > 1e-5)
            .collect();
        assert_eq!(jumps.len(), 4, "one step after each letter: {jumps:?}");
        assert!(jumps.iter().all(|jump| (jump - 0.1).abs() < 1e-5), "of 0.1 m: {jumps:?}");
    }

    #[test]
    fn headlights_are_lit_along_lit_strokes_only() {
        let plan = noor(Extent::Letters);
        let lit_s = plan.full_light_s();
        // The lit lengths are N 1.583 m, O 1.6 m twice, and R 0.5 + 0.3 + 0.25 + 0.3 + 0.391 m,
        // flown at 0.2 m/s.
        let wanted_s = (1.583_095 + 2.0 * 1.6 + 1.740_512) / 0.2;
        assert!((lit_s - wanted_s).abs() < 1e-3, "{lit_s} s lit instead of {wanted_s} s");
    }

    #[test]
    fn an_endless_flight_is_refused() {
        let options = LetterOptions { cap_height_m: 100.0, ..LetterOptions::default() };
        let strokes = write("NOOR", &options).unwrap();
        let error = plan(&strokes, &PlanOptions { stroke_speed_m_s: 0.01, ..Default::default() });
        assert!(matches!(error, Err(Error::Infeasible { .. })), "{error:?}");
    }
}
