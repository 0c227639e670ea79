//! Checks the picture that flights would produce: its problems, and the light along the strokes.

use super::warn_if;
use crate::scene::Scene;
use crate::shoot::problems::{FACES_AWAY, NO_PICTURE, UNLIT, is_exposed, no_picture};
use crate::shoot::{Lighting, Recording, Shoot, writing};
use noctograph_core::camera::Camera;
use noctograph_core::diagnostic::{Change, Diagnostic, Severity};
use noctograph_core::error::Result;
use noctograph_core::flight::{Flight, warning::UNSEEN};
use noctograph_core::statistics::sort_by_number;
use noctograph_picture::expose::meter::{LampReading, meter};
use noctograph_picture::light::{Lamp, LightTrace, LightTraceData};

/// Name of the picture's check.
pub const PICTURE: &str = "picture";

/// Minimum fraction of light facing away from the camera at which the word is invisible.
const MOST_AWAY_FRAC: f64 = 0.95;

/// Maximum time during which a drone may see fewer than two base stations without an effect on the
/// picture. The gyroscope and one station bridge this time.
const MAX_UNSEEN_S: f64 = 1.0;

/// Duration of the path segments over which light is summed, 1 cm at 0.2 m/s. Such a segment is as
/// long as a lamp's blur, so that the trembling of a drone causes no hot spot.
const PIECE_S: f64 = 0.05;

/// Picture of all drones' light.
pub(super) struct Picture {
    /// Lamps of all drones, and the camera. `None` if there is no picture.
    pub(super) lit: Option<(LightTrace, Camera)>,
    /// Exposures of the writing lamps.
    readings: Vec<LampReading>,
    problems: Vec<Diagnostic>,
    /// True if the light of the writing lamps is completely outside the picture.
    is_unseen: bool,
}

impl Picture {
    /// Returns the picture of flights with its meter readings and problems, or `None` if one of the
    /// flights failed.
    pub(super) fn new(shoot: &Shoot, flown: &[Result<Flight>]) -> Option<Self> {
        // The flights are passed as recordings, so that they are not simulated again.
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

    /// Returns the light of drone `drone`, counted from 0, or `None` if there is no picture.
    pub(super) fn drone_light(&self, drone: usize) -> Option<LightTrace> {
        let (trace, _) = self.lit.as_ref()?;
        let lamps = trace.lamps.iter();
        let lamps = lamps.filter(|lamp| lamp.drone.is_none_or(|index| index.0 == drone));
        Some(LightTrace::made(LightTraceData { lamps: lamps.cloned().collect() }))
    }

    /// Returns the reading of the brightest trail of the lamps of drone `drone`, or `None` if none
    /// is in the picture.
    pub(super) fn trail(&self, drone: usize) -> Option<&LampReading> {
        let readings = self.readings.iter();
        let readings = readings.filter(|r| r.drone.is_none_or(|index| index.0 == drone));
        readings.max_by(|a, b| a.median_stops.total_cmp(&b.median_stops))
    }
}

/// Description of a picture without problems.
const WANTED: &str = "the whole word in the picture, lit while the shutter is open";

/// Returns a finding for each problem that a preview would report, such as a word outside the
/// picture, a closed shutter or dark lamps.
pub(super) fn check_picture(shoot: &Shoot, picture: Option<&Picture>) -> Vec<Diagnostic> {
    fn unchecked(why: &str) -> Vec<Diagnostic> {
        let advice = "first resolve the problems that stop the flight, or plan a word";
        vec![Diagnostic::unchecked(PICTURE, why, "complete flights that write letters", advice)]
    }
    let Some(picture) = picture else { return unchecked("not every drone completes its flight") };
    let mut setpoints = shoot.plans.iter().flat_map(|planned| &planned.plan.setpoints);
    if shoot.strokes.is_none() && !setpoints.any(|setpoint| setpoint.letter.is_some()) {
        return unchecked("the plans write no letter");
    }
    // A camera that points elsewhere causes the other problems, which are not reported.
    if picture.is_unseen {
        let (actual, wanted) = ("the camera shows no light of the word", "the whole word");
        let advice = "point the camera at the word ({camera.framing=word})";
        return vec![Diagnostic::check(PICTURE, Severity::Stop, None).say(actual, wanted, advice)];
    }
    if picture.problems.is_empty() {
        let row = Diagnostic::check(PICTURE, Severity::Fine, None);
        return vec![row.say("shows the word while it is written", WANTED, "")];
    }
    picture.problems.iter().map(finding).collect()
}

/// Returns true if the writing lamps emit light during the exposure, but all of it is outside the
/// picture.
fn is_unseen(trace: &LightTrace, writing: &[String], camera: &Camera) -> bool {
    let lamps = trace.lamps.iter().filter(|lamp| writing.contains(&lamp.emitter.name));
    let samples = lamps.flat_map(|lamp| &lamp.samples);
    let mut lit = samples.filter(|sample| is_exposed(sample, camera)).peekable();
    lit.peek().is_some() && lit.all(|sample| camera.outside([sample.position_m]).is_some())
}

/// Returns a problem of the picture as a finding with the severity that applies to a flight.
fn finding(problem: &Diagnostic) -> Diagnostic {
    let severity = match problem.code {
        UNLIT | NO_PICTURE => Severity::Stop,
        FACES_AWAY if problem.number("away_frac") > Some(MOST_AWAY_FRAC) => Severity::Stop,
        // Other checks show how well the flight bridged shorter gaps.
        UNSEEN => warn_if(problem.number("lasts_s") > Some(MAX_UNSEEN_S)),
        _ => Severity::Warning,
    };
    Diagnostic::check(PICTURE, severity, None)
        .detailed(problem.sentence(Change::to_string))
        .say(problem.to_string(), WANTED, "")
        .helped(problem.help.clone())
}

/// A segment of the path of a lit lamp.
pub(super) struct Piece {
    /// Start time of the segment.
    pub(super) time_s: f64,
    pub(super) length_m: f64,
    /// Amount of light, in seconds at the lamp's maximum level.
    pub(super) light_s: f64,
}

/// Returns the lit path of the first writing lamp in pieces of at least [`PIECE_S`], in order of
/// time.
pub(super) fn lit_pieces(flight: &Flight, trace: &LightTrace, scene: &Scene) -> Vec<Piece> {
    let writing = writing(std::slice::from_ref(flight), trace, &scene.light);
    let name = writing.first().map(|lamp| &lamp.emitter.name);
    // A lamp that changes color consists of several emitters.
    let emitters = writing.iter().filter(|lamp| Some(&lamp.emitter.name) == name);
    let mut pieces: Vec<Piece> = emitters.flat_map(|lamp| emitter_pieces(lamp)).collect();
    sort_by_number(&mut pieces, |piece| piece.time_s);
    pieces
}

/// Returns the lit path of one emitter in pieces. The emitter's highest level counts as full light,
/// because levels are also used to balance the dies of a color LED.
fn emitter_pieces(lamp: &Lamp) -> Vec<Piece> {
    let full = lamp.samples.iter().map(|sample| sample.level).fold(0.0, f64::max);
    let (mut pieces, mut begun) = (Vec::new(), None);
    for (from, to) in lamp.samples.iter().zip(lamp.samples.iter().skip(1)) {
        let mean_level = 0.5 * (from.level + to.level) / full.max(f64::MIN_POSITIVE);
        // A segment that is interrupted by darkness is dropped.
        if mean_level <= 0.0 {
            begun = None;
            continue;
        }
        let (start, light_s) = begun.get_or_insert((from, 0.0));
        *light_s += mean_level * (to.time_s - from.time_s);
        if to.time_s - start.time_s >= PIECE_S {
            let length_m = (to.position_m - start.position_m).xz().norm();
            pieces.push(Piece { time_s: start.time_s, length_m, light_s: *light_s });
            begun = None;
        }
    }
    pieces
}
