//! Shoot: the one place where the stages are chained, from a scene to its photograph and verdict.
//!
//! Product in: a [`Scene`]. Product out: a [`Shot`] with every product on the way.
//!
//! 1. [`Shoot::new`] writes the word and plans a flight for each drone. [`Shoot::with_plans`] and
//!    [`Shoot::with_recordings`] begin later, with plans, flights or light from a file.
//! 2. [`Shoot::take`] flies every plan, exposes the light of all drones on one film, develops it
//!    and reads the word.
//!
//! [`Shoot::fly`] and [`Shoot::lighting`] stop earlier. A study varies the public fields.
//!
//! Independent work runs in parallel: the graphics device starts and the reader is prepared during
//! the flight, and the photo is encoded while it is read.
//!
//! Drones that hear each other (estimator `cooperative`) or fly into each other's downwash are one
//! simulation. Others are simulated one by one. Not modeled: collisions.

use std::num::NonZero;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use rayon::prelude::*;

use crate::scene::Scene;
use noctograph_core::diagnostic::Warned;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::Flight;
use noctograph_core::flight::table::on_grid;
use noctograph_letters::Strokes;
use noctograph_logs::{self as logs, ImportOptions};
use noctograph_picture::expose::{BackendChoice, Developer};
use noctograph_picture::light::csv::{is_light_trace, read as read_light};
use noctograph_picture::light::{LightOptions, LightTrace};
use noctograph_plan::{Approach, Plan, wake};
use noctograph_score::{Reader, is_judged};
use noctograph_sim::vehicle::Downwash;
use noctograph_sim::{Avionics, Drone, EstimatorKind, Session, SimOptions, fly, fly_fleet};

mod exported;
mod file;
mod infer_lights;
#[cfg(test)]
mod keys;
mod lighting;
mod metering;
mod moments;
mod planned;
pub mod problems;
mod response;
mod shot;
mod written;

pub use file::Format;
pub use infer_lights::{infer_lights_if_dark, light_while_airborne};
pub use lighting::Lighting;
pub use metering::{Metered, recommended};
use planned::plan;
pub use planned::{DesignCheck, Planned, aim, ends, rehearse};
pub use problems::{CHECK_LIGHT, is_dark, writing};
pub use response::step_responses;
pub use shot::{Shot, WriteFile, flight_sha256, known};

/// Longest time of all plans together: a fleet of sixteen for 22 minutes. All pairs of plans are
/// compared, and an hour of flight takes seconds.
const MAX_TOGETHER_S: f64 = 21_600.0;
/// Most samples of recordings together, 250 bytes each: over two hours at 100 Hz.
const MAX_SAMPLES: usize = 800_000;

/// A scene that was checked, made ready to be flown and photographed.
#[derive(Clone, Debug, Default)]
pub struct Shoot {
    /// Word, lamps, camera, seed, and the drone that planner and controllers believe.
    pub scene: Scene,
    /// Strokes of the word or drawing. `None` for recordings without one.
    pub strokes: Option<Strokes>,
    /// Plans that are sent, one for each drone.
    pub plans: Vec<Planned>,
    /// True if they were planned from the scene, so that a change of it plans anew.
    pub is_planned: bool,
    /// Designs of plans that are flights of exported trajectories ([`Self::as_exported`]). Empty if
    /// the plans are the designs.
    pub designs: Vec<Plan>,
    /// Replace the flights of the plans, one for each drone. Empty if the plans are flown.
    pub recordings: Vec<Recording>,
    /// True drones, if they differ from the scene's, in the order of the plans.
    pub actual: Vec<Actual>,
    /// Seed of the room's errors (survey, stations), by default the scene's.
    pub room_seed: Option<u64>,
    /// How the photo is read.
    pub judging: Judging,
    /// Format of the encoded photo. `None` if it is not encoded.
    pub format: Option<Format>,
    /// True if the shot has its film. Otherwise its memory is freed before the photo is read.
    pub keeps_film: bool,
    /// Reader of the strokes, by default one that is prepared during the flight.
    pub reader: Option<Arc<Reader>>,
    /// Backend that exposes the film.
    pub backend: BackendChoice,
    /// Number of processor cores that expose the film, by default the backend's.
    pub cores: Option<NonZero<usize>>,
    /// Ends [`Self::take`] between two stages.
    pub stop: Stop,
}

/// A switch by which another thread stops work. It is common to all clones.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Stops the work.
    pub fn now(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Checks that the work goes on.
    ///
    /// # Errors
    ///
    /// [`Error::Stopped`] after [`Self::now`].
    pub fn check(&self) -> Result<()> {
        if self.0.load(Ordering::Relaxed) { Err(Error::Stopped) } else { Ok(()) }
    }
}

/// The drone that flies, if it differs from the one that the scene describes.
#[derive(Clone, Debug, PartialEq)]
pub struct Actual {
    /// Its body, battery, air and sensors. Controller and estimator are the scene's.
    pub sim: SimOptions,
    /// Its lamps.
    pub light: LightOptions,
}

/// The flight of one drone from a file, or only its light.
#[derive(Clone, Debug, PartialEq)]
pub enum Recording {
    /// A flight, simulated or real, with the scene's lamps.
    Flight(Flight),
    /// Lamps moving through the world.
    Light(LightTrace),
}

impl Recording {
    /// Reads a flight, a log or a light trace, with its warnings.
    ///
    /// # Errors
    ///
    /// As [`logs::import`] and [`read_light`].
    pub fn read(path: &Path, options: &ImportOptions) -> Result<Warned<Self>> {
        let flight = if path.is_dir() {
            logs::import(path, options)?
        } else {
            let (bytes, file) = (logs::read(path)?, path.display().to_string());
            if is_light_trace(&bytes) {
                return Ok(read_light(&bytes, &file)?.map(Self::Light));
            }
            logs::import_bytes(&bytes, &file, options)?
        };
        Ok(Warned { warnings: flight.warnings.clone(), product: Self::Flight(flight) })
    }
}

/// Moves flights in time, all by the same, so that the first one begins at 0. A light trace has the
/// clock of the exposure, so flights beside it are not moved.
fn start_at_zero(recordings: &mut [Recording]) {
    let flights = recordings.iter_mut().map(|recording| match recording {
        Recording::Flight(flight) => Some(flight),
        Recording::Light(_) => None,
    });
    let Some(mut flights) = flights.collect::<Option<Vec<&mut Flight>>>() else { return };
    let firsts = flights.iter().filter_map(|flight| flight.samples.first());
    let first_s = firsts.map(|sample| sample.time_s).reduce(f64::min).unwrap_or(0.0);
    for flight in flights.iter_mut().filter(|_| first_s != 0.0) {
        // Gaps are spans of the same clock. The grid keeps differences of times exact.
        flight.edit(|flight| {
            let times_s = flight.samples.iter_mut().map(|sample| &mut sample.time_s);
            let ends_s = flight.gaps.as_flattened_mut().iter_mut();
            times_s.chain(ends_s).for_each(|time_s| *time_s = on_grid(*time_s - first_s));
        });
    }
}

/// How a photo is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Judging {
    /// Verdict with causes and advice.
    #[default]
    Explained,
    /// Only the verdict.
    Scored,
    /// Not at all.
    Skipped,
}

/// A stage that takes long enough to report progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The drones fly.
    Flying,
    /// The film is exposed and developed.
    Exposing,
}

/// Receives a stage and the fraction of it that is done, 0 to 1, from any thread.
pub type Watch<'a> = dyn Fn(Stage, f64) + Sync + 'a;

impl Shoot {
    /// Writes and plans the word or drawing of a scene.
    ///
    /// # Errors
    ///
    /// As [`Scene::strokes`] and [`Self::of_strokes`].
    pub fn new(scene: Scene) -> Result<Self> {
        let strokes = scene.strokes()?;
        Self::of_strokes(scene, strokes, &|_| Ok(()))
    }

    /// Plans the scene's strokes, which were drawn already, if the designs pass a check.
    ///
    /// # Errors
    ///
    /// As [`Scene::check`], [`fly`] and [`step_responses`], and those of the check.
    pub fn of_strokes(scene: Scene, strokes: Strokes, check: &DesignCheck<'_>) -> Result<Self> {
        scene.check()?;
        let plans = plan(&scene, &strokes, check)?;
        let strokes = Some(strokes);
        Ok(Self { scene, strokes, plans, is_planned: true, keeps_film: true, ..Self::default() })
    }

    /// Flies plans, one for each drone. Without a word in the scene the photo is not read.
    ///
    /// # Errors
    ///
    /// As [`Scene::check`] and [`Scene::strokes`], and [`Error::Input`] for plans that last too
    /// long together.
    pub fn with_plans(scene: Scene, plans: Vec<Plan>) -> Result<Self> {
        scene.check()?;
        let together_s = plans.iter().map(|plan| plan.duration_s()).sum::<f64>();
        if together_s > MAX_TOGETHER_S {
            let actual = format!("{} that last {together_s:.0} s together", plans.len());
            let wanted = format!("at most {MAX_TOGETHER_S} s");
            return Err(Error::input("plans", actual, wanted, "name fewer plans at a time"));
        }
        let strokes = scene.has_strokes().then(|| scene.strokes()).transpose()?;
        let (scene, strokes) = written::fit_to_plans(scene, strokes, &plans)?;
        let plans = plans.into_iter().map(|plan| Planned { plan, ends: Vec::new() }).collect();
        Ok(Self { scene, strokes, plans, keeps_film: true, ..Self::default() })
    }

    /// Photographs recorded flights or light, one for each drone, on one clock. The exposure begins
    /// with the first of them. Without a word in the scene the photo is not read.
    pub fn with_recordings(scene: Scene, mut recordings: Vec<Recording>) -> Result<Self> {
        Self::check_recordings(&recordings)?;
        start_at_zero(&mut recordings);
        Ok(Self { recordings, ..Self::with_plans(scene, Vec::new())? })
    }

    /// Checks that recordings have no more samples than one picture may be made of.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with their number.
    pub fn check_recordings(recordings: &[Recording]) -> Result<()> {
        let counts = recordings.iter().map(|recording| match recording {
            Recording::Flight(flight) => flight.samples.len(),
            // A fourth of a flight's sample in memory.
            Recording::Light(trace) => {
                trace.lamps.iter().map(|lamp| lamp.samples.len()).sum::<usize>() / 4
            }
        });
        let n: usize = counts.sum();
        if n <= MAX_SAMPLES {
            return Ok(());
        }
        let hint = "thin the flights out, or cut them to the time of the picture";
        Err(Error::input("flights", format!("{n} samples"), format!("at most {MAX_SAMPLES}"), hint))
    }

    /// Flies every plan.
    ///
    /// # Errors
    ///
    /// As [`noctograph_sim::fly`], of the first drone that fails.
    pub fn fly(&self, watch: &Watch<'_>) -> Result<Vec<Flight>> {
        let n = self.plans.len();
        if self.is_one_simulation() {
            let believed = self.scene.sim();
            let plans = self.plans.iter().enumerate();
            let fleet = plans.map(|(drone, planned)| (&planned.plan, self.drone(drone, &believed)));
            return fly_fleet(&fleet.collect::<Vec<_>>(), &mut |done| watch(Stage::Flying, done));
        }
        let done = Mutex::new(vec![0.0; n]);
        let flights = (0..n).into_par_iter().map(|drone| {
            self.fly_drone(drone, &mut |fraction| {
                let Ok(mut done) = done.lock() else { return };
                done[drone] = fraction;
                let mean = done.iter().sum::<f64>() / n as f64;
                drop(done);
                watch(Stage::Flying, mean);
            })
        });
        // Results are collected in order, so that the same drone's error is reported every time.
        let flights: Vec<Result<Flight>> = flights.collect();
        flights.into_iter().collect()
    }

    /// True if the drones hear each other, or fly through each other's downwash.
    pub(crate) fn is_one_simulation(&self) -> bool {
        self.plans.len() > 1
            && (self.scene.observer.kind == EstimatorKind::Cooperative
                || !self.downwash_pairs().is_empty())
    }

    /// Pairs of drones, counted from 0, of which the second one is planned into the downwash of the
    /// first, and their closest approach.
    pub(crate) fn downwash_pairs(&self) -> Vec<([usize; 2], Approach)> {
        if self.scene.air.downwash == Downwash::None {
            return Vec::new();
        }
        let n = self.plans.len();
        let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| [a, b]));
        let pairs = pairs.filter_map(|[a, b]| {
            let nearest = wake(&self.plans[a].plan, &self.plans[b].plan)?;
            Some((if nearest.vertical_m < 0.0 { [b, a] } else { [a, b] }, nearest))
        });
        pairs.collect()
    }

    /// A drone of the fleet, with the one that its controller believes to fly.
    fn drone<'a>(&'a self, drone: usize, believed: &'a SimOptions) -> Drone<'a> {
        let actual = self.actual.get(drone).map_or(believed, |actual| &actual.sim);
        let seed = self.scene.seed;
        let room_seed = self.room_seed.unwrap_or(seed);
        Drone { believed, actual, seed, room_seed, index: drone as u64 }
    }

    /// Flies the plan of one drone, counted from 0, without the other drones.
    ///
    /// # Panics
    ///
    /// If there is no such plan.
    pub fn fly_drone(&self, drone: usize, progress: &mut dyn FnMut(f64)) -> Result<Flight> {
        let believed = self.scene.sim();
        fly(&self.plans[drone].plan, &self.drone(drone, &believed), progress)
    }

    /// The flight of the first plan with a user's controller or estimator.
    ///
    /// # Panics
    ///
    /// If there is no plan.
    pub fn session(&self, begin: impl FnOnce(&mut Avionics)) -> Result<Session> {
        let believed = self.scene.sim();
        Session::new(self.plans[0].plan.clone(), &self.drone(0, &believed), begin)
    }

    /// Flies, exposes, develops and reads.
    ///
    /// # Errors
    ///
    /// Those of the stages, and [`Error::Stopped`]. [`Error::Input`] for a camera behind the word,
    /// which reads mirrored from there, and for one among the lamps.
    pub fn take(mut self, watch: &Watch<'_>) -> Result<Shot> {
        // The slow preparations first, beside the flight: the graphics device and the reader.
        let developer = Developer::start(match self.cores {
            Some(_) => BackendChoice::Cpu,
            None => self.backend,
        });
        let recordings = std::mem::take(&mut self.recordings);
        let (recordings, reader) = rayon::join(
            || match recordings.is_empty() {
                true => self.record(watch),
                false => Ok(recordings),
            },
            || self.reader(),
        );
        let (recordings, reader) = (recordings?, reader?);
        self.stop.check()?;
        let lighting = self.light(recordings)?;
        watch(Stage::Exposing, 0.0);
        let shot = self.expose(lighting, developer, reader.as_deref())?;
        watch(Stage::Exposing, 1.0);
        Ok(shot)
    }

    fn record(&self, watch: &Watch<'_>) -> Result<Vec<Recording>> {
        Ok(self.fly(watch)?.into_iter().map(Recording::Flight).collect())
    }

    /// A reader of the strokes, if the photo is read and shows a word that can be judged.
    fn reader(&self) -> Result<Option<Arc<Reader>>> {
        let word = self.strokes.as_ref().filter(|strokes| is_judged(strokes));
        let word = word.filter(|_| self.judging != Judging::Skipped);
        match (&self.reader, word) {
            (_, None) => Ok(None),
            (Some(reader), _) => Ok(Some(reader.clone())),
            (None, Some(strokes)) => Ok(Some(Arc::new(Reader::new(strokes, &self.scene.score)?))),
        }
    }
}
