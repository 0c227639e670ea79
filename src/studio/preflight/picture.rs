//! Checks of the picture that flights would leave: its problems, its light along the strokes.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::row::{Row, warn_if};
use crate::scene::{Change, Scene};
use crate::shoot::{Lighting, Problem, Recording, Shoot, writing};
use noctograph_core::camera::Camera;
use noctograph_core::error::Result;
use noctograph_core::flight::Flight;
use noctograph_picture::expose::meter::{LampReading, meter};
use noctograph_picture::light::{Lamp, LightSample, LightTrace};

/// The check of the picture.
pub const PICTURE: &str = "picture";

/// Duration of the pieces over which light along the path is summed: 1 cm at 0.2 m/s. A piece as
/// long as the lamp's blur tells hot spots from trembling.
const PIECE_S: f64 = 0.05;

/// What the light of all drones leaves in the picture.
pub(super) struct Picture {
    /// The lamps of all drones, and the camera that sees them; `None` where there is no picture.
    pub(super) lit: Option<(LightTrace, Camera)>,
    /// Of the lamps that write.
    readings: Vec<LampReading>,
    problems: Vec<Problem>,
}

impl Picture {
    /// The picture of flights; `None` where one of them fails.
    pub(super) fn of(shoot: &Shoot, flown: &[Result<Flight>]) -> Option<Self> {
        let flights = flown.iter().map(|flight| flight.as_ref().ok().cloned());
        let recordings = flights.map(|f| f.map(Recording::Flight)).collect::<Option<Vec<_>>>()?;
        let flown = Shoot { recordings, ..shoot.clone() };
        Some(match flown.lighting(&|_, _| {}) {
            Ok(Lighting { trace, camera, writing, problems, .. }) => {
                let mut readings = meter(&trace, &camera).unwrap_or_default();
                readings.retain(|reading| writing.contains(&reading.name));
                Self { lit: Some((trace, camera)), readings, problems }
            }
            Err(error) => {
                let problems = vec![Problem::NoPicture(error.to_string())];
                Self { lit: None, readings: Vec::new(), problems }
            }
        })
    }

    /// The camera; `None` where there is no picture.
    pub(super) fn camera(&self) -> Option<&Camera> {
        self.lit.as_ref().map(|(_, camera)| camera)
    }

    /// The light of one drone.
    pub(super) fn light_of(&self, drone: usize) -> Option<LightTrace> {
        let (trace, _) = self.lit.as_ref()?;
        let own = trace.lamps.iter().filter(|lamp| lamp.drone.is_none_or(|of| of.0 == drone));
        Some(LightTrace { lamps: own.cloned().collect() })
    }

    /// The brightest trail of a drone's lamps.
    pub(super) fn trail(&self, drone: usize) -> Option<&LampReading> {
        let own =
            self.readings.iter().filter(|reading| reading.drone.is_none_or(|of| of.0 == drone));
        brightest(own)
    }
}

fn brightest<'a>(readings: impl Iterator<Item = &'a LampReading>) -> Option<&'a LampReading> {
    readings.max_by(|a, b| a.median_stops.total_cmp(&b.median_stops))
}

/// Headings that are tried, in a turn.
const HEADINGS: u32 = 24;
/// Headings that are read in full: those that look evenest by a quarter of the samples, whose
/// medians are off by less than these stops, and that may be worth a turn.
const FINALISTS: usize = 4;
const COARSE_STOPS: f64 = 0.1;
/// Stops by which another heading is worth a turn of the nose.
const WORTH_STOPS: f64 = 0.5;

/// The heading at which the exposure along a flight's brightest trail varies least, rad, and by how
/// much, stops, where that is worth a turn and the trail is as bright and as long as now: `trace`,
/// the light of the same flight, with the nose turned.
pub(super) fn evener(
    shoot: &Shoot,
    drone: usize,
    flight: &Flight,
    trace: &LightTrace,
    camera: &Camera,
    now: &LampReading,
) -> Option<[f64; 2]> {
    let least_stops = now.evenness_stops() - WORTH_STOPS;
    if least_stops <= 0.0 {
        return None;
    }
    let lamps = writing(std::slice::from_ref(flight), trace, &shoot.scene.light);
    let read = |lamps: &[Lamp], yaw_rad: f64, slack_stops: f64| {
        let turn_rad = yaw_rad - shoot.plans[drone].plan.yaw_rad;
        let lamps = lamps.iter().map(|lamp| turned(lamp, flight, turn_rad)).collect();
        let readings = meter(&LightTrace { lamps }, camera).unwrap_or_default();
        let brightest_lamp = brightest(readings.iter())?;
        let is_bright = brightest_lamp.median_stops >= now.median_stops - slack_stops;
        let whole = is_bright && brightest_lamp.lit_s >= 0.99 * now.lit_s;
        whole.then(|| [yaw_rad, brightest_lamp.evenness_stops()])
    };
    let evener = |a: &[f64; 2], b: &[f64; 2]| a[1].total_cmp(&b[1]);
    let coarse: Vec<Lamp> = lamps.iter().map(|lamp| thinned(lamp)).collect();
    let headings = (0..HEADINGS).map(|step| TAU * f64::from(step) / f64::from(HEADINGS) - PI);
    let mut headings: Vec<[f64; 2]> =
        headings.filter_map(|yaw_rad| read(&coarse, yaw_rad, COARSE_STOPS)).collect();
    headings.retain(|[_, stops]| *stops < least_stops + 2.0 * COARSE_STOPS);
    headings.sort_by(evener);
    let lamps: Vec<Lamp> = lamps.into_iter().cloned().collect();
    let best =
        headings.iter().take(FINALISTS).filter_map(|[yaw_rad, _]| read(&lamps, *yaw_rad, 0.0));
    best.min_by(evener).filter(|[_, stops]| *stops < least_stops)
}

/// A lamp with some of its samples: those beside a change of its level, and every fourth.
fn thinned(lamp: &Lamp) -> Lamp {
    let level = |at: usize| lamp.samples.get(at).map(|sample| sample.level);
    let kept = lamp.samples.iter().enumerate().filter(|(at, _)| {
        let beside = [level(at.wrapping_sub(1)), level(at + 1)];
        at.is_multiple_of(4) || beside != [level(*at); 2]
    });
    let samples = kept.map(|(_, sample)| *sample).collect();
    Lamp { drone: lamp.drone, emitter: lamp.emitter.clone(), samples }
}

/// A lamp of a flight whose nose is turned.
fn turned(lamp: &Lamp, flight: &Flight, turn_rad: f64) -> Lamp {
    let (sin, cos) = libm::sincos(turn_rad);
    let turn = |v: Vector3<f64>| Vector3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z);
    let mut moves = flight.samples.windows(2).peekable();
    let samples = lamp.samples.iter().map(|sample| {
        while moves.next_if(|ends| ends[1].time_s <= sample.time_s).is_some() {}
        let body_m = match (moves.peek(), flight.samples.last()) {
            (Some([a, b]), _) => {
                let part = (sample.time_s - a.time_s) / (b.time_s - a.time_s);
                a.position_m.lerp(&b.position_m, part.clamp(0.0, 1.0))
            }
            (_, last) => last.map_or(sample.position_m, |last| last.position_m),
        };
        let position_m = body_m + turn(sample.position_m - body_m);
        LightSample { position_m, axis: turn(sample.axis), ..*sample }
    });
    Lamp { drone: lamp.drone, emitter: lamp.emitter.clone(), samples: samples.collect() }
}

/// What only a preview would show: the word in the picture, while the shutter is open, lit.
pub(super) fn check_picture(shoot: &Shoot, picture: Option<&Picture>) -> Vec<Row> {
    let unchecked = |why| {
        let advice = "mend what stops the flight; plan a word";
        vec![Row::unchecked(PICTURE, why, "flights that end, and letters", advice)]
    };
    let Some(picture) = picture else { return unchecked("not every drone ends its flight") };
    let mut setpoints = shoot.plans.iter().flat_map(|planned| &planned.plan.setpoints);
    if shoot.strokes.is_none() && !setpoints.any(|setpoint| setpoint.letter.is_some()) {
        return unchecked("the plans write no letter");
    }
    match picture.problems.as_slice() {
        [] => vec![of_problem(None)],
        problems => problems.iter().map(|problem| of_problem(Some(problem))).collect(),
    }
}

fn of_problem(problem: Option<&Problem>) -> Row {
    let row = Row::of(PICTURE, warn_if(problem.is_some()), None);
    let wanted = "the whole word in the picture, lit while the shutter is open";
    let Some(problem) = problem else {
        return row.say("shows the word while it is written", wanted, "");
    };
    let (found, advice) = problem.parts();
    Row { detail: problem.sentence(Change::to_string), ..row }.say(found, wanted, advice.0)
}

/// Light of the first lamp that follows the plan, in pieces along its path: start time, length and
/// seconds of full light.
pub(super) fn painted(flight: &Flight, trace: &LightTrace, scene: &Scene) -> Vec<(f64, f64, f64)> {
    let writing = writing(std::slice::from_ref(flight), trace, &scene.light);
    let name = writing.first().map(|lamp| &lamp.emitter.name);
    // A lamp that changes its color is several emitters.
    let emitters = writing.iter().filter(|lamp| Some(&lamp.emitter.name) == name);
    let mut pieces: Vec<(f64, f64, f64)> = emitters.flat_map(|lamp| pieces_of(lamp)).collect();
    pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
    pieces
}

/// The same of one emitter, whose highest level counts as full light: the dies of a color LED are
/// balanced by their levels.
fn pieces_of(lamp: &Lamp) -> Vec<(f64, f64, f64)> {
    let full = lamp.samples.iter().map(|sample| sample.level).fold(0.0, f64::max);
    let mut pieces: Vec<(f64, f64, f64)> = Vec::new();
    let mut from: Option<(f64, Vector3<f64>)> = None;
    let mut light_s = 0.0;
    for pair in lamp.samples.windows(2) {
        let lasts_s = pair[1].time_s - pair[0].time_s;
        let lit = 0.5 * (pair[0].level + pair[1].level) / full.max(f64::MIN_POSITIVE);
        if lit <= 0.0 {
            (from, light_s) = (None, 0.0);
            continue;
        }
        let (start_s, start_m) = *from.get_or_insert((pair[0].time_s, pair[0].position_m));
        light_s += lit * lasts_s;
        if pair[1].time_s - start_s >= PIECE_S {
            pieces.push((start_s, (pair[1].position_m - start_m).xz().norm(), light_s));
            (from, light_s) = (None, 0.0);
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preflight::flown;
    use crate::scene::Preset;

    #[test]
    fn the_heading_at_which_a_wide_word_is_even_is_named_with_what_it_brings() {
        let mut scene = Scene { word: "IIIIIIII".to_owned(), ..Scene::preset(Preset::Cf21) };
        let evenness = |scene: &Scene| {
            let shoot = Shoot::new(scene.clone()).unwrap();
            let flights = flown(&shoot).unwrap();
            let picture = Picture::of(&shoot, &flights).unwrap();
            let now = picture.trail(0).unwrap();
            let (flight, (trace, camera)) =
                (flights[0].as_ref().unwrap(), picture.lit.as_ref().unwrap());
            (now.evenness_stops(), evener(&shoot, 0, flight, trace, camera, now))
        };
        let (now_stops, evener) = evenness(&scene);
        let [yaw_rad, stops] = evener.expect("headlights along the word");
        assert!(stops < now_stops - 1.0, "{now_stops}, {stops}");
        scene.plan.yaw_rad = yaw_rad;
        let (then_stops, evener) = evenness(&scene);
        assert!((then_stops - stops).abs() < 0.2 && evener.is_none(), "{then_stops}, {evener:?}");
    }
}
