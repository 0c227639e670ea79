//! Computes the plans of a scene for its drone, its controller and its lamps.
//!
//! [`noctograph_plan`] does not depend on the simulator or the lamps. This module supplies the step
//! responses of the loop, the simulated flight of a plan, and the delays of the lamps.

use nalgebra::Vector3;
use noctograph_core::parallel;
use noctograph_core::parallel::prelude::*;

use super::lighting::in_drawing_colors;
use super::step_responses;
use crate::scene::Scene;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{Flight, warning::UNSEEN};
use noctograph_letters::Strokes;
use noctograph_picture::light::{COLOR_LED, LightOptions, RING};
use noctograph_plan::feedforward::{corrected, feedforward, inverse};
use noctograph_plan::response::StepResponse;
use noctograph_plan::{
    Between, LampTiming, LightClock, Plan, PlanOptions, ReferenceKind, StrokeEnd, fleet,
    stroke_ends, time_lights,
};
use noctograph_sim::{Drone, fly, holds_positions, relit};

/// Function that accepts or rejects designs before their flights are simulated.
pub type DesignCheck<'a> = dyn Fn(&[Plan]) -> Result<()> + 'a;

/// The plan of one drone.
#[derive(Clone, Debug, PartialEq)]
pub struct Planned {
    /// Plan that is sent to the drone.
    pub plan: Plan,
    /// Errors of the light at the ends of strokes. Empty if lights follow the setpoints.
    pub ends: Vec<StrokeEnd>,
}

/// Plans the flights for a drawing, one per drone, by the scene's table `plan`. The designs must
/// pass `check`. If `flies` is true, the flight of a single drone is simulated during the
/// rehearsal, unless the light commands could affect it. Returns the plans in the order of the
/// drones, or the first drone's error.
pub(super) fn plan(
    scene: &Scene,
    strokes: &Strokes,
    check: &DesignCheck<'_>,
    flies: bool,
) -> Result<(Vec<Planned>, Vec<Flight>)> {
    let lamps = in_drawing_colors(&scene.light, scene, Some(strokes));
    // 1. The designs and, in parallel, the step responses of the closed loop are computed.
    let trajectory_clock = Some(scene.trajectory_clock());
    let options = PlanOptions { trajectory_clock, ..scene.plan.clone() };
    let is_inverse = scene.plan.reference == ReferenceKind::Inverse;
    let (designs, responses) = parallel::join(
        || fleet(strokes, &options),
        || is_inverse.then(|| step_responses(&scene.sim())).transpose(),
    );
    let designs = designs?;
    check(&designs)?;
    let responses = responses?;
    let sim = scene.sim();
    let drone = Drone::new(&sim, scene.seed);
    let flies = flies && designs.len() == 1 && holds_positions(&drone);
    let planned = designs.into_par_iter().map(|design| {
        // 2. The reference that is sent to the drone is derived.
        let plan = match &responses {
            None => design,
            Some(responses) => leading_reference(scene, design, responses)?,
        };
        // 3. The light commands are timed by a flight of that reference.
        match scene.plan.light_clock {
            LightClock::Setpoint => {
                Ok((Planned { plan: with_color_channels(plan, &lamps), ends: Vec::new() }, None))
            }
            LightClock::Light => {
                let (rehearsed, flight) = parallel::join(
                    || rehearse(scene, &plan),
                    || flies.then(|| fly(&plan, &drone, &mut |_| {}).ok()).flatten(),
                );
                let planned = aim(scene, &lamps, &plan, &rehearsed?)?;
                let relit = flight.and_then(|flight| relit(flight, &plan, &planned.plan, &drone));
                Ok((planned, relit))
            }
        }
    });
    // All plans are collected first, so that the error reported is always that of the first drone.
    let planned: Vec<Result<(Planned, Option<Flight>)>> = planned.collect();
    let planned = planned.into_iter().collect::<Result<Vec<_>>>()?;
    let (planned, flights): (_, Vec<_>) = planned.into_iter().unzip();
    Ok((planned, flights.into_iter().flatten().collect()))
}

/// Returns the reference with which the drone follows a design: the design filtered by the inverse
/// of the closed loop. Because take-off, integrators and saturation are nonlinear, the reference is
/// corrected by the tracking error that remains in a simulated flight.
fn leading_reference(scene: &Scene, design: Plan, responses: &[StepResponse; 3]) -> Result<Plan> {
    check_cost(&design, responses)?;
    let inverse = inverse(&design, responses);
    let reference = if scene.controller.kind.follows_reference() {
        design
    } else {
        feedforward(&design, &inverse)
    };
    let mut flight = rehearse(scene, &reference)?;
    // The mean error of real flights, which the simulation does not contain, is also corrected.
    let mean_error_m = Vector3::from(scene.plan.mean_error_m);
    if mean_error_m != Vector3::zeros() {
        flight.edit(|flight| flight.samples.iter_mut().for_each(|s| s.position_m += mean_error_m));
    }
    Ok(corrected(&reference, &flight, &inverse))
}

/// Returns a plan with the color channels of lamps that write letters in different colors. Without
/// such colors, the plan is unchanged.
pub(super) fn with_color_channels(mut plan: Plan, light: &LightOptions) -> Plan {
    if light.letters_wrgb.is_empty() {
        return plan;
    }
    // Commands precede the light, so a row is given the color of the letter that it lights.
    let letters = noctograph_plan::light_letters(&plan);
    let lit: Vec<bool> = plan.commanded().iter().map(|level| *level > 0.0).collect();
    for (lamp, channels) in [(RING.name, RING.colors), (COLOR_LED.name, COLOR_LED.colors)] {
        if !plan.lights.contains_key(lamp) {
            continue;
        }
        for (color, channel) in channels.iter().enumerate() {
            let levels = letters.iter().zip(&lit).map(|(letter, is_lit)| {
                if !is_lit {
                    return 0.0;
                }
                let byte = if lamp == RING.name {
                    light.ring_rgb_of(*letter)[color]
                } else {
                    light.wrgb_of(*letter)[color]
                };
                f64::from(byte) / f64::from(u8::MAX)
            });
            let levels = levels.collect();
            plan.edit(|plan| plan.lights.insert((*channel).to_owned(), levels));
        }
    }
    plan
}

/// Maximum number of multiplications for inverting a loop. They take a few seconds.
const MAX_INVERSE: f64 = 4e9;

/// Checks that inverting the loop for a plan's setpoints takes at most [`MAX_INVERSE`]
/// multiplications. Returns [`Error::Infeasible`] otherwise.
fn check_cost(plan: &Plan, responses: &[StepResponse; 3]) -> Result<()> {
    let n = plan.setpoints.len();
    let interval_s = plan.duration_s() / n.max(1) as f64;
    let cost: f64 = responses.iter().map(|response| response.inverse_cost(n, interval_s)).sum();
    if cost <= MAX_INVERSE {
        return Ok(());
    }
    Err(Error::infeasible(
        format!(
            "the inverse of the loop over {n} setpoints {interval_s:.4} s apart takes {cost:.1e} \
             multiplications, more than {MAX_INVERSE:.0e}"
        ),
        "raise plan.setpoint_interval_s, split the word, or set plan.reference = \
               \"design\"",
    ))
}

/// Simulates an undisturbed flight of a plan. The controller uses the drone's own filter if the
/// stations see the whole flight. Otherwise it uses the true state, because the estimate would be
/// unpredictable.
pub fn rehearse(scene: &Scene, plan: &Plan) -> Result<Flight> {
    // The seed, which selects the sweeps that the Lighthouse deck drops, is fixed.
    let seed = 0;
    if let Some(options) = scene.sim().rehearsal_by_filter()
        && let Ok(flight) = fly(plan, &Drone::new(&options, seed), &mut |_| {})
        && !flight.warnings.iter().any(|warning| warning.code == UNSEEN)
    {
        return Ok(flight);
    }
    fly(plan, &Drone::new(&scene.sim().rehearsal(), seed), &mut |_| {})
}

/// Moves a plan's light commands so that the light begins and ends with the strokes in a simulated
/// or real flight of the plan. Returns the plan with the errors that remain at the strokes' ends.
pub fn aim(scene: &Scene, lamps: &LightOptions, plan: &Plan, flight: &Flight) -> Result<Planned> {
    let between =
        if scene.controller.kind.follows_reference() { Between::Design } else { Between::Held };
    let (plan, ends) = time_lights(plan, flight, &lamp_timing(lamps), between)?;
    Ok(Planned { plan: with_color_channels(plan, lamps), ends })
}

/// Returns the errors of the light at the ends of strokes in a flight of a plan.
pub fn stroke_end_errors(scene: &Scene, plan: &Plan, flight: &Flight) -> Result<Vec<StrokeEnd>> {
    stroke_ends(plan, flight, &lamp_timing(&scene.light))
}

/// Returns the mean delay between a command and its arrival, and the period of the lamp's timer, in
/// s.
fn lamp_timing(options: &LightOptions) -> LampTiming {
    LampTiming {
        delay_s: options.radio_delay_s + 0.5 * options.radio_jitter_s,
        tick_s: options.tick_s,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Preset;
    use crate::shoot::{Recording, Shoot};
    use noctograph_core::crazyflie::Release;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::tracking::{Part, track};
    use noctograph_sim::sensors::SensorOptions;
    use noctograph_sim::vehicle::Gusts;
    use noctograph_sim::{ControllerKind, EstimatorKind, Setpoints, SimOptions};

    fn plan(scene: &Scene, strokes: &Strokes) -> Result<Vec<Planned>> {
        super::plan(scene, strokes, &|_| Ok(()), false).map(|(planned, _)| planned)
    }

    fn noor() -> Strokes {
        write("NOOR", &LetterOptions::default()).unwrap()
    }

    fn scene(options: PlanOptions, kind: ControllerKind) -> Scene {
        let mut scene = Scene { plan: options, ..Scene::preset(Preset::Ae4832022) };
        scene.controller.kind = kind;
        scene
    }

    /// Returns the root mean square distance from the path in an undisturbed flight, and the
    /// largest streak.
    fn flown(scene: &Scene) -> (f64, f64) {
        let planned = plan(scene, &noor()).unwrap().swap_remove(0);
        let flight = rehearse(scene, &planned.plan).unwrap();
        let tracking = track(&flight, Part::Letters).unwrap();
        let contour_m = tracking.contour.rms_m;
        let streak_m = planned.ends.iter().map(|end| end.streak_m.abs()).fold(0.0, f64::max);
        (contour_m, streak_m)
    }

    #[test]
    fn a_ring_writes_each_letter_in_its_color() {
        let mut scene = scene(PlanOptions::even(), ControllerKind::LqrFeedforward);
        scene.plan.lights = vec!["ring".to_owned()];
        let plain = plan(&scene, &noor()).unwrap().swap_remove(0).plan;
        scene.light.letters_wrgb = vec![[0, 255, 0, 0], [0, 0, 51, 255], [255, 0, 0, 0]];
        let colored = plan(&scene, &noor()).unwrap().swap_remove(0).plan;
        assert_eq!((colored.lit(), &colored.setpoints), (plain.lit(), &plain.setpoints));
        let white = scene.light.ring_rgb_of(None).map(|byte| f64::from(byte) / 255.0);
        let colors = [[1.0, 0.0, 0.0], [0.0, 0.2, 1.0], white, [1.0, 0.0, 0.0]];
        for (row, level) in plain.lights["ring"].iter().enumerate() {
            let letter = noctograph_plan::light_letters(&colored)[row];
            let wanted = letter.filter(|_| *level > 0.0).map_or([0.0; 3], |l| colors[l]);
            assert!(RING.colors.iter().map(|it| colored.lights[*it][row]).eq(wanted));
        }
    }

    /// Checks that a run of lit commands, which encloses its stroke, has one color.
    #[test]
    fn no_stroke_ends_in_the_color_of_the_next() {
        for (lamp, channels) in [(RING.name, RING.colors), (COLOR_LED.name, COLOR_LED.colors)] {
            let mut scene = scene(PlanOptions::even(), ControllerKind::Pid);
            scene.plan.lights = vec![lamp.to_owned()];
            // The drone lags behind the setpoints by about 0.3 s, and so does its light.
            scene.plan.reference = ReferenceKind::Design;
            scene.light.letters_wrgb = vec![[0, 255, 0, 0], [0, 0, 255, 0], [0, 0, 0, 255]];
            let plan = plan(&scene, &noor()).unwrap().swap_remove(0).plan;
            let colors = |row: usize| -> Vec<f64> {
                channels.iter().map(|channel| plan.lights[*channel][row]).collect()
            };
            let lit = &plan.lights[lamp];
            let (mut strokes, mut turns) = (0, 0);
            for row in 1..lit.len() {
                strokes += usize::from(lit[row] > 0.0 && lit[row - 1] == 0.0);
                turns += usize::from(
                    lit[row] > 0.0 && lit[row - 1] > 0.0 && colors(row) != colors(row - 1),
                );
            }
            assert_eq!((strokes, turns), (strokes, 0), "{lamp}");
            assert!(strokes >= 4, "{lamp}: {strokes}");
        }
    }

    /// Checks that the flight that is simulated during the rehearsal is that of the plan.
    #[test]
    fn a_flight_beside_the_rehearsal_has_the_bits_of_the_plans_flight() {
        for preset in Preset::ALL {
            let scene = Scene { word: "NO".into(), seed: 3, ..Scene::preset(*preset) };
            let strokes = scene.strokes().unwrap();
            let shoot = Shoot::flown(scene, strokes, &|_| Ok(())).unwrap();
            let flown = shoot.fly(&|_, _| {}).unwrap();
            let beside = shoot.recordings.iter().map(|recording| match recording {
                Recording::Flight(flight) => flight,
                Recording::Light(_) => unreachable!("all are flights"),
            });
            assert!(beside.clone().all(|flight| *flight == flown[0]), "{preset:?}");
            let is_default = *preset == Preset::default();
            assert!(beside.len() == 1 || !is_default, "{preset:?}");
        }
    }

    #[test]
    fn a_trajectory_on_board_is_paced_by_the_clock_of_the_drones_firmware() {
        let lasts_s = |setpoints, firmware, trajectory_clock| {
            let mut scene = scene(PlanOptions::even(), ControllerKind::Pid);
            (scene.radio.drones, scene.radio.setpoints) = (1, setpoints);
            (scene.vehicle.firmware, scene.plan.trajectory_clock) = (firmware, trajectory_clock);
            plan(&scene, &noor()).unwrap().swap_remove(0).plan.duration_s()
        };
        let sent_s = lasts_s(Setpoints::Streamed, Release::R2026_08, None);
        for (firmware, told, rate) in [
            (Release::R2026_04, None, 84.0 / 85.0),
            (Release::R2026_08, None, 84.0 / 85.0),
            (Release::After2026_08, None, 1.0),
            (Release::R2026_08, Some(1.0), 1.0),
            (Release::R2026_08, Some(0.95), 0.95),
        ] {
            let on_board_s = lasts_s(Setpoints::OnBoard, firmware, told);
            assert!((on_board_s * rate - sent_s).abs() < 1e-3, "{firmware:?}: {on_board_s} s");
        }
    }

    /// Checks that the filter's error due to drag, the same in every flight, is compensated.
    #[test]
    fn a_rehearsal_by_the_drones_own_filter_leads_its_bias_away() {
        let [by_truth_m, by_filter_m] =
            [EstimatorKind::EkfImproved, EstimatorKind::Ekf].map(|rehearsed| {
                let mut scene = Scene::preset(Preset::default());
                "NO".clone_into(&mut scene.word);
                scene.observer.kind = rehearsed;
                let strokes = scene.strokes().unwrap();
                let plan = plan(&scene, &strokes).unwrap().swap_remove(0).plan;
                scene.observer.kind = EstimatorKind::Ekf;
                let sim = scene.sim().rehearsal_by_filter().unwrap();
                let flight = fly(&plan, &Drone::new(&sim, 7), &mut |_| {}).unwrap();
                track(&flight, Part::Letters).unwrap().rmse_m.x
            });
        println!("x: {by_truth_m} m rehearsed at the truth, {by_filter_m} m by the filter");
        assert!(by_filter_m < 0.6 * by_truth_m, "{by_truth_m} m, {by_filter_m} m");
    }

    /// In still air, the remaining error comes from settling and from varying sensor errors.
    #[test]
    fn curves_close_within_a_centimeter() {
        for word in ["pool", "Quartz", "2027"] {
            let mut scene = Scene::preset(Preset::default());
            word.clone_into(&mut scene.word);
            scene.air.gusts = Gusts::None;
            let shoot = Shoot::new(scene).unwrap();
            let flight = shoot.fly(&|_, _| {}).unwrap().swap_remove(0);
            let at_m = |time_s: f64| {
                let row = flight.samples.partition_point(|sample| sample.time_s < time_s);
                flight.samples[row].position_m
            };
            let ends = stroke_end_errors(&shoot.scene, &shoot.plans[0].plan, &flight).unwrap();
            fn is_loop(pair: &&[StrokeEnd]) -> bool {
                let lasts_s = pair[1].time_s - pair[0].time_s;
                lasts_s > 2.0 && (pair[0].at_m - pair[1].at_m).norm() < 0.03
            }
            let gaps_m = ends.chunks(2).filter(is_loop).map(|pair| {
                // The end of the loop is drawn over its beginning.
                let late = (0..200).map(|k| at_m(pair[1].time_s - 0.005 * f64::from(k)));
                let begun_m = at_m(pair[0].time_s);
                late.map(|late_m| (late_m - begun_m).xz().norm()).fold(1.0, f64::min)
            });
            let gaps_m: Vec<f64> = gaps_m.collect();
            assert!(
                !gaps_m.is_empty() && gaps_m.iter().all(|gap_m| *gap_m < 0.01),
                "{word}: {gaps_m:?}"
            );
        }
    }

    #[test]
    fn the_default_scene_is_planned_as_the_team_planned() {
        let scene = Scene::preset(Preset::Ae4832022);
        let planned = plan(&scene, &noor()).unwrap();
        assert_eq!(planned.len(), 1);
        assert_eq!(planned[0].plan, noctograph_plan::plan(&noor(), &scene.plan).unwrap());
    }

    #[test]
    fn with_its_loop_inverted_the_teams_controller_flies_the_letters() {
        let (team_m, _) = flown(&scene(PlanOptions::default(), ControllerKind::Lqr));
        let (even_m, streak_m) = flown(&scene(PlanOptions::even(), ControllerKind::Lqr));
        assert!(even_m <= 0.02 && even_m < team_m, "{even_m} m against {team_m} m");
        assert!(streak_m <= 0.01, "{streak_m} m");
    }

    #[test]
    fn with_feed_forward_the_letters_are_flown_within_fifteen_millimeters() {
        for &kind in ControllerKind::ALL {
            let (contour_m, streak_m) = flown(&scene(PlanOptions::even(), kind));
            assert!(contour_m <= 0.015, "{kind:?}: {contour_m} m");
            assert!(streak_m <= 0.01, "{kind:?}: {streak_m} m");
        }
    }

    #[test]
    fn the_teams_own_lights_leave_streaks_of_a_decimeter() {
        let team = scene(PlanOptions::default(), ControllerKind::Lqr);
        let plan = plan(&team, &noor()).unwrap().swap_remove(0).plan;
        let ends = stroke_end_errors(&team, &plan, &rehearse(&team, &plan).unwrap()).unwrap();
        assert_eq!(ends.len(), 8, "four letters of one stroke each");
        let first_m = ends[0].streak_m;
        assert!((0.2..0.25).contains(&first_m), "the lit tail of the first letter: {first_m} m");
        let others = ends[1..].iter().map(|end| end.streak_m.abs());
        let worst_m = others.fold(0.0, f64::max);
        assert!((0.07..0.12).contains(&worst_m), "0.2 m/s for half a second: {worst_m} m");
    }

    #[test]
    fn a_known_mean_error_is_taken_off() {
        for kind in [ControllerKind::Lqr, ControllerKind::LqrFeedforward] {
            let mut tipped = scene(PlanOptions::even(), kind);
            fn fly_tipped(scene: &Scene) -> Flight {
                let plan = plan(scene, &noor()).unwrap().swap_remove(0).plan;
                let sim = SimOptions { sensors: SensorOptions::ideal(), ..scene.sim() };
                fly(&plan, &Drone::new(&sim, 0), &mut |_| {}).unwrap()
            }
            let before = fly_tipped(&tipped);
            let mean_m = track(&before, Part::Letters).unwrap().mean_error_m;
            assert!(mean_m.x < -0.05, "the center of mass is off: {mean_m}");
            tipped.plan.mean_error_m = mean_m.into();
            let after = fly_tipped(&tipped);
            let tracking = track(&after, Part::Letters).unwrap();
            assert!(tracking.mean_error_m.norm() < 0.01, "{}", tracking.mean_error_m);
            assert!(tracking.contour.rms_m <= 0.02, "{}", tracking.contour.rms_m);
        }
    }
}
