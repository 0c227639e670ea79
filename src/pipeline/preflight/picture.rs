//! Checks of the picture that flights would leave: its problems, its light along the strokes.

use super::{stop_if, warn_if};
use crate::scene::Scene;
use crate::shoot::problems::{FACES_AWAY, NO_PICTURE, UNLIT, no_picture};
use crate::shoot::{Lighting, Recording, Shoot, writing};
use noctograph_core::camera::Camera;
use noctograph_core::diagnostic::{Change, Diagnostic, Severity};
use noctograph_core::error::Result;
use noctograph_core::flight::{Flight, warning::UNSEEN};
use noctograph_picture::expose::meter::{LampReading, meter};
use noctograph_picture::light::{Lamp, LightSample, LightTrace, LightTraceData};

/// The check of the picture.
pub const PICTURE: &str = "picture";

/// Share of light facing away from the camera above which the word is invisible.
const MOST_AWAY_FRAC: f64 = 0.95;

/// Shortest outage of two base stations that harms the picture: the gyroscope and one station
/// bridge shorter ones.
const MAX_UNSEEN_S: f64 = 1.0;

/// Duration of the pieces over which light along the path is summed: 1 cm at 0.2 m/s. A piece as
/// long as the lamp's blur tells hot spots from trembling.
const PIECE_S: f64 = 0.05;

/// The picture of the light of all drones.
pub(super) struct Picture {
    /// The lamps of all drones, and the camera that sees them; `None` where there is no picture.
    pub(super) lit: Option<(LightTrace, Camera)>,
    /// Of the lamps that write.
    readings: Vec<LampReading>,
    problems: Vec<Diagnostic>,
    /// Whether all that writes is outside the picture.
    is_unseen: bool,
}

impl Picture {
    /// The picture of flights; `None` where one of them fails.
    pub(super) fn new(shoot: &Shoot, flown: &[Result<Flight>]) -> Option<Self> {
        let flights = flown.iter().map(|flight| flight.as_ref().ok().cloned());
        let recordings = flights.map(|f| f.map(Recording::Flight)).collect::<Option<Vec<_>>>()?;
        let flown = Shoot { recordings, ..shoot.clone() };
        Some(match flown.lighting(&|_, _| {}) {
            Ok(Lighting { trace, camera, writing, problems, .. }) => {
                let mut readings = meter(&trace, &camera).unwrap_or_default();
                readings.retain(|reading| writing.contains(&reading.name));
                let is_unseen = is_unseen(&trace, &writing, &camera);
                Self { lit: Some((trace, camera)), readings, problems, is_unseen }
            }
            Err(error) => {
                let problems = vec![no_picture(&error)];
                Self { lit: None, readings: Vec::new(), problems, is_unseen: false }
            }
        })
    }

    /// The light of one drone.
    pub(super) fn light_of(&self, drone: usize) -> Option<LightTrace> {
        let (trace, _) = self.lit.as_ref()?;
        let own = trace.lamps.iter().filter(|lamp| lamp.drone.is_none_or(|index| index.0 == drone));
        Some(LightTrace::made(LightTraceData { lamps: own.cloned().collect() }))
    }

    /// The brightest trail of a drone's lamps.
    pub(super) fn trail(&self, drone: usize) -> Option<&LampReading> {
        let own = self.readings.iter().filter(|it| it.drone.is_none_or(|index| index.0 == drone));
        own.max_by(|a, b| a.median_stops.total_cmp(&b.median_stops))
    }
}

/// Problems otherwise seen only in a preview: the word outside the picture, a closed shutter, dark
/// lamps.
pub(super) fn check_picture(shoot: &Shoot, picture: Option<&Picture>) -> Vec<Diagnostic> {
    fn unchecked(why: &str) -> Vec<Diagnostic> {
        let advice = "mend what stops the flight; plan a word";
        vec![Diagnostic::unchecked(PICTURE, why, "flights that end, and letters", advice)]
    }
    let Some(picture) = picture else { return unchecked("not every drone ends its flight") };
    let mut setpoints = shoot.plans.iter().flat_map(|planned| &planned.plan.setpoints);
    if shoot.strokes.is_none() && !setpoints.any(|setpoint| setpoint.letter.is_some()) {
        return unchecked("the plans write no letter");
    }
    if picture.is_unseen {
        let (actual, wanted) = ("the camera shows none of the light that writes", "the whole word");
        let advice = "point the camera at the word ({camera.framing=word})";
        return vec![Diagnostic::check(PICTURE, Severity::Stop, None).say(actual, wanted, advice)];
    }
    match picture.problems.as_slice() {
        [] => vec![of_problem(None)],
        problems => problems.iter().map(|problem| of_problem(Some(problem))).collect(),
    }
}

/// Whether the writing lamps are invisible to a camera.
fn is_unseen(trace: &LightTrace, writing: &[String], camera: &Camera) -> bool {
    let open = camera.shutter_open_s..=camera.shutter_close_s;
    let lamps = trace.lamps.iter().filter(|lamp| writing.contains(&lamp.emitter.name));
    let is_lit = |sample: &&LightSample| sample.level > 0.0 && open.contains(&sample.time_s);
    let mut lit = lamps.flat_map(|lamp| &lamp.samples).filter(is_lit).peekable();
    lit.peek().is_some() && lit.all(|sample| camera.outside([sample.position_m]).is_some())
}

fn of_problem(problem: Option<&Diagnostic>) -> Diagnostic {
    let is_above = |name: &str, limit: f64| {
        problem.and_then(|problem| problem.number(name)).is_some_and(|value| value > limit)
    };
    let severity = match problem.map(|problem| problem.code) {
        Some(UNLIT | NO_PICTURE) => Severity::Stop,
        Some(FACES_AWAY) => stop_if(is_above("away_frac", MOST_AWAY_FRAC)).max(Severity::Warning),
        // Gaps bridged within corridor and height are no fault of the picture.
        Some(UNSEEN) => warn_if(is_above("lasts_s", MAX_UNSEEN_S)),
        code => warn_if(code.is_some()),
    };
    let row = Diagnostic::check(PICTURE, severity, None);
    let wanted = "the whole word in the picture, lit while the shutter is open";
    let Some(problem) = problem else {
        return row.say("shows the word while it is written", wanted, "");
    };
    let row =
        row.detailed(problem.sentence(Change::to_string)).say(problem.to_string(), wanted, "");
    row.helped(problem.help.clone())
}

/// Light along the path: start in s, length in m, seconds of full light.
pub(super) type Piece = (f64, f64, f64);

/// Light of the first lamp that follows the plan, in order of time.
pub(super) fn painted(flight: &Flight, trace: &LightTrace, scene: &Scene) -> Vec<Piece> {
    let writing = writing(std::slice::from_ref(flight), trace, &scene.light);
    let name = writing.first().map(|lamp| &lamp.emitter.name);
    // A lamp that changes its color is several emitters.
    let emitters = writing.iter().filter(|lamp| Some(&lamp.emitter.name) == name);
    let mut pieces: Vec<Piece> = emitters.flat_map(|lamp| pieces_of(lamp)).collect();
    pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
    pieces
}

/// The same of one emitter, whose highest level counts as full light: the dies of a color LED are
/// balanced by their levels.
fn pieces_of(lamp: &Lamp) -> Vec<Piece> {
    let full = lamp.samples.iter().map(|sample| sample.level).fold(0.0, f64::max);
    let (mut pieces, mut begun) = (Vec::new(), None);
    for (from, to) in lamp.samples.iter().zip(lamp.samples.iter().skip(1)) {
        let lit = 0.5 * (from.level + to.level) / full.max(f64::MIN_POSITIVE);
        if lit <= 0.0 {
            begun = None;
            continue;
        }
        let (start, light_s) = begun.get_or_insert((from, 0.0));
        *light_s += lit * (to.time_s - from.time_s);
        if to.time_s - start.time_s >= PIECE_S {
            let length_m = (to.position_m - start.position_m).xz().norm();
            pieces.push((start.time_s, length_m, *light_s));
            begun = None;
        }
    }
    pieces
}
