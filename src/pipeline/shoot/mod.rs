//! Shoot: the only place where the stages are chained, from a scene to its photograph and verdict.
//!
//! Product in: a [`Scene`]. Product out: a [`Shot`] with all intermediate products.
//!
//! 1. [`Shoot::new`] writes the word and plans a flight for each drone. [`Shoot::with_plans`] and
//!    [`Shoot::with_recordings`] start later, with plans, flights or light from a file.
//! 2. [`Shoot::take`] flies every plan, exposes the light of all drones on one film, develops it
//!    and reads the word.
//!
//! [`Shoot::fly`] and [`Shoot::lighting`] end earlier. A study varies the public fields.
//!
//! Independent work runs in parallel: the graphics device and the reader are prepared during the
//! flight, and the photo is encoded while it is read.
//!
//! Drones that measure ranges to each other (estimator `cooperative`) or enter each other's
//! downwash are simulated together, and other drones one by one. Collisions are not modeled.

use std::num::NonZero;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use noctograph_core::parallel;
use noctograph_core::parallel::prelude::*;

use crate::scene::Scene;
use noctograph_core::diagnostic::Warned;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::Flight;
use noctograph_core::flight::table::on_grid;
use noctograph_letters::Strokes;
use noctograph_logs::{self as logs, ImportOptions};
use noctograph_picture::expose::{BackendChoice, Developer, Exposure, GrowingFilm, Latent};
use noctograph_picture::light::csv::{is_light_trace, read as read_light};
use noctograph_picture::light::{LightOptions, LightTrace};
use noctograph_plan::{Approach, Plan, downwash_approach};
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
pub use planned::{DesignCheck, Planned, aim, rehearse, stroke_end_errors};
pub use problems::{CHECK_LIGHT, is_dark, writing};
pub use response::step_responses;
pub use shot::{Shot, WriteFile, flight_sha256, known};

/// Maximum total duration of all plans, enough for sixteen drones for 22 minutes. All pairs of
/// plans are compared, and simulating an hour of flight takes seconds.
const MAX_TOTAL_S: f64 = 21_600.0;
/// Maximum total number of samples in recordings, 250 bytes each, or two hours at 100 Hz.
const MAX_SAMPLES: usize = 800_000;

/// A checked scene with its strokes and plans, ready to be flown and photographed.
#[derive(Clone, Debug, Default)]
pub struct Shoot {
    /// Word, lamps, camera and seed, and the drone that planner and controllers assume.
    pub scene: Scene,
    /// Strokes of the word or drawing. `None` for recordings without strokes.
    pub strokes: Option<Strokes>,
    /// Plans that are sent to the drones, one for each drone.
    pub plans: Vec<Planned>,
    /// True if the plans were computed from the scene, and are recomputed when the scene changes.
    pub is_planned: bool,
    /// Designs of exported trajectories ([`Self::as_exported`]). Empty if the plans are designs.
    pub designs: Vec<Plan>,
    /// Recordings that replace simulated flights, one for each drone. Empty if the plans are flown.
    pub recordings: Vec<Recording>,
    /// Actual drones, in the plans' order. Empty if they match the scene.
    pub actual: Vec<Actual>,
    /// Seed of the room's errors (survey, stations). The default is the scene's seed.
    pub room_seed: Option<u64>,
    /// Extent to which the photo is read.
    pub judging: Judging,
    /// Format of the encoded photo. `None` if it is not encoded.
    pub format: Option<Format>,
    /// True if the shot keeps its film. Otherwise the film is freed before the photo is read.
    pub keeps_film: bool,
    /// Reader of the strokes. By default it is prepared during the flight.
    pub reader: Option<Arc<Reader>>,
    /// Backend that exposes the film.
    pub backend: BackendChoice,
    /// Number of processor cores for exposing the film. By default the backend chooses it.
    pub cores: Option<NonZero<usize>>,
    /// Switch that stops [`Self::take`] between two stages.
    pub stop: Stop,
}

/// A switch by which another thread stops the work. All clones have the same state.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Requests that the work stop.
    pub fn now(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Checks that no stop was requested.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Stopped`] after [`Self::now`].
    pub fn check(&self) -> Result<()> {
        if self.0.load(Ordering::Relaxed) { Err(Error::Stopped) } else { Ok(()) }
    }
}

/// An actual drone that differs from the one in the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Actual {
    /// Body, battery, air and sensors of the drone. Controller and estimator are the scene's.
    pub sim: SimOptions,
    /// Lamps of the drone.
    pub light: LightOptions,
}

/// The flight or the light of one drone, read from a file.
#[derive(Clone, Debug, PartialEq)]
pub enum Recording {
    /// A simulated or real flight, lit by the scene's lamps.
    Flight(Flight),
    /// Lamps that move in world coordinates.
    Light(LightTrace),
}

impl Recording {
    /// Reads a flight, a log or a light trace. Returns it with the reader's warnings.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`logs::import`] and [`read_light`].
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

/// Shifts the times of all flights by the same amount, so that the first one begins at 0. Nothing
/// is shifted if one of the recordings is a light trace, whose clock is that of the exposure.
fn start_at_zero(recordings: &mut [Recording]) {
    let flights = recordings.iter_mut().map(|recording| match recording {
        Recording::Flight(flight) => Some(flight),
        Recording::Light(_) => None,
    });
    let Some(mut flights) = flights.collect::<Option<Vec<&mut Flight>>>() else { return };
    let firsts = flights.iter().filter_map(|flight| flight.samples.first());
    let first_s = firsts.map(|sample| sample.time_s).reduce(f64::min).unwrap_or(0.0);
    for flight in flights.iter_mut().filter(|_| first_s != 0.0) {
        // Gaps use the same clock. Differences between times on the grid are exact.
        flight.edit(|flight| {
            let times_s = flight.samples.iter_mut().map(|sample| &mut sample.time_s);
            let ends_s = flight.gaps.as_flattened_mut().iter_mut();
            times_s.chain(ends_s).for_each(|time_s| *time_s = on_grid(*time_s - first_s));
        });
    }
}

/// Extent to which a photo is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Judging {
    /// The photo is read, and the verdict includes causes and advice.
    #[default]
    Explained,
    /// The photo is read, and the verdict includes neither causes nor advice.
    Scored,
    /// The photo is not read.
    Skipped,
}

/// A stage that takes long enough for its progress to be reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The drones fly.
    Flying,
    /// The film is exposed and developed.
    Exposing,
}

/// Callback that receives a stage and its completed fraction, 0 to 1, from any thread.
pub type Watch<'a> = dyn Fn(Stage, f64) + Sync + 'a;

impl Shoot {
    /// Draws the word or drawing of a scene as strokes, and plans them.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Scene::strokes`] and [`Self::of_strokes`].
    pub fn new(scene: Scene) -> Result<Self> {
        let strokes = scene.strokes()?;
        Self::of_strokes(scene, strokes, &|_| Ok(()))
    }

    /// Plans the strokes `strokes` for the scene. The designs must pass `check`.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Scene::check`], [`fly`], [`step_responses`] and `check`.
    pub fn of_strokes(scene: Scene, strokes: Strokes, check: &DesignCheck<'_>) -> Result<Self> {
        Self::planned(scene, strokes, check, false)
    }

    /// Plans strokes like [`Self::of_strokes`], and simulates the flight of a single drone beside
    /// the rehearsal of its plan. The flight is in [`Self::recordings`], unless the light commands
    /// could affect it.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Self::of_strokes`].
    pub fn flown(scene: Scene, strokes: Strokes, check: &DesignCheck<'_>) -> Result<Self> {
        Self::planned(scene, strokes, check, true)
    }

    /// Plans strokes for a scene. If `flies` is true, the flight of a single drone is simulated
    /// beside its rehearsal, as described at [`Self::flown`].
    fn planned(
        scene: Scene,
        strokes: Strokes,
        check: &DesignCheck<'_>,
        flies: bool,
    ) -> Result<Self> {
        scene.check()?;
        let (plans, flights) = plan(&scene, &strokes, check, flies)?;
        let recordings = flights.into_iter().map(Recording::Flight).collect();
        let (strokes, is_planned) = (Some(strokes), true);
        let shoot = Self { scene, strokes, plans, is_planned, recordings, ..Self::default() };
        Ok(Self { keeps_film: true, ..shoot })
    }

    /// Prepares the flights of plans, one for each drone. Without a word, the photo is not read.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Scene::check`] and [`Scene::strokes`]. Returns [`Error::Input`] for
    /// plans whose total duration is too long.
    pub fn with_plans(scene: Scene, plans: Vec<Plan>) -> Result<Self> {
        scene.check()?;
        let total_s = plans.iter().map(|plan| plan.duration_s()).sum::<f64>();
        if total_s > MAX_TOTAL_S {
            let actual = format!("{} that last {total_s:.0} s together", plans.len());
            let wanted = format!("at most {MAX_TOTAL_S} s");
            return Err(Error::input("plans", actual, wanted, "name fewer plans at a time"));
        }
        let strokes = scene.has_strokes().then(|| scene.strokes()).transpose()?;
        let (scene, strokes) = written::fit_to_plans(scene, strokes, &plans)?;
        let plans = plans.into_iter().map(|plan| Planned { plan, ends: Vec::new() }).collect();
        Ok(Self { scene, strokes, plans, keeps_film: true, ..Self::default() })
    }

    /// Prepares the photograph of recorded flights or light, one for each drone, all on the same
    /// clock. The exposure begins with the first recording. Without a word, the photo is not read.
    /// Returns the errors of [`Self::check_recordings`] and [`Self::with_plans`].
    pub fn with_recordings(scene: Scene, mut recordings: Vec<Recording>) -> Result<Self> {
        Self::check_recordings(&recordings)?;
        start_at_zero(&mut recordings);
        Ok(Self { recordings, ..Self::with_plans(scene, Vec::new())? })
    }

    /// Checks that recordings do not contain too many samples for a picture.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] that states the number of samples.
    pub fn check_recordings(recordings: &[Recording]) -> Result<()> {
        let counts = recordings.iter().map(|recording| match recording {
            Recording::Flight(flight) => flight.samples.len(),
            // A sample of light takes a quarter of the memory of a flight's sample.
            Recording::Light(trace) => {
                const PER_FLIGHT_SAMPLE: usize = 4;
                let n_samples: usize = trace.lamps.iter().map(|lamp| lamp.samples.len()).sum();
                n_samples / PER_FLIGHT_SAMPLE
            }
        });
        let n: usize = counts.sum();
        if n <= MAX_SAMPLES {
            return Ok(());
        }
        let hint = "reduce the sample rate of the flights, or cut the flights to the time of the \
                    picture";
        Err(Error::input("flights", format!("{n} samples"), format!("at most {MAX_SAMPLES}"), hint))
    }

    /// Simulates the flights of all plans.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`noctograph_sim::fly`], for the first drone whose flight fails.
    pub fn fly(&self, watch: &Watch<'_>) -> Result<Vec<Flight>> {
        let n = self.plans.len();
        if self.is_one_simulation() {
            let believed = self.scene.sim();
            let plans = self.plans.iter().enumerate();
            let fleet = plans.map(|(drone, planned)| (&planned.plan, self.drone(drone, &believed)));
            return fly_fleet(&fleet.collect::<Vec<_>>(), &mut |done| watch(Stage::Flying, done));
        }
        let done_fracs = Mutex::new(vec![0.0; n]);
        let flights = (0..n).into_par_iter().map(|drone| {
            self.fly_drone(drone, &mut |done_frac| {
                let Ok(mut done_fracs) = done_fracs.lock() else { return };
                done_fracs[drone] = done_frac;
                let mean_frac = done_fracs.iter().sum::<f64>() / n as f64;
                drop(done_fracs);
                watch(Stage::Flying, mean_frac);
            })
        });
        // All flights are collected first, so that the first drone's error is always reported.
        let flights: Vec<Result<Flight>> = flights.collect();
        flights.into_iter().collect()
    }

    /// Returns true if all drones are simulated together, because they measure ranges to each other
    /// or enter each other's downwash.
    pub(crate) fn is_one_simulation(&self) -> bool {
        self.plans.len() > 1
            && (self.scene.observer.kind == EstimatorKind::Cooperative
                || !self.downwash_pairs().is_empty())
    }

    /// Returns the pairs of drones whose second drone enters the downwash of the first according to
    /// their plans. Drones are counted from 0. Each pair has its closest approach, at which the
    /// first drone is `vertical_m` above the second. The list is empty without a downwash model.
    pub(crate) fn downwash_pairs(&self) -> Vec<([usize; 2], Approach)> {
        if self.scene.air.downwash == Downwash::None {
            return Vec::new();
        }
        let n = self.plans.len();
        let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| [a, b]));
        let pairs = pairs.filter_map(|[a, b]| {
            let nearest = downwash_approach(&self.plans[a].plan, &self.plans[b].plan)?;
            let pair = if nearest.vertical_m < 0.0 { [b, a] } else { [a, b] };
            Some((pair, Approach { vertical_m: nearest.vertical_m.abs(), ..nearest }))
        });
        pairs.collect()
    }

    /// Returns the simulated drone with this index. `believed` is the drone that its controller
    /// assumes, which differs from the actual one in studies.
    fn drone<'a>(&'a self, drone: usize, believed: &'a SimOptions) -> Drone<'a> {
        let actual = self.actual.get(drone).map_or(believed, |actual| &actual.sim);
        let seed = self.scene.seed;
        let room_seed = self.room_seed.unwrap_or(seed);
        Drone { believed, actual, seed, room_seed, index: drone as u64 }
    }

    /// Simulates the flight of one drone, given its index, without the other drones.
    ///
    /// # Panics
    ///
    /// Panics if there is no plan with this index.
    pub fn fly_drone(&self, drone: usize, progress: &mut dyn FnMut(f64)) -> Result<Flight> {
        let believed = self.scene.sim();
        fly(&self.plans[drone].plan, &self.drone(drone, &believed), progress)
    }

    /// Begins a flight of the first plan that calls a user's controller or estimator at each step.
    ///
    /// # Panics
    ///
    /// Panics if there is no plan.
    pub fn session(&self, begin: impl FnOnce(&mut Avionics)) -> Result<Session> {
        let believed = self.scene.sim();
        Session::new(self.plans[0].plan.clone(), &self.drone(0, &believed), begin)
    }

    /// Simulates the flights, exposes and develops the film, and reads the photo.
    ///
    /// # Errors
    ///
    /// Returns the errors of the stages, and [`Error::Stopped`]. Returns [`Error::Input`] for a
    /// camera behind the word, from where it appears mirrored. Returns [`Error::Infeasible`] for a
    /// camera too close to a lamp.
    pub fn take(self, watch: &Watch<'_>) -> Result<Shot> {
        // The graphics device is prepared during the flight, because this takes time.
        let developer = Developer::start(match self.cores {
            Some(_) => BackendChoice::Cpu,
            None => self.backend,
        });
        self.take_by(developer, watch)
    }

    /// Works as [`Self::take`], on a backend that was started earlier, for example while files are
    /// read.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Self::take`].
    pub fn take_by(mut self, developer: Developer, watch: &Watch<'_>) -> Result<Shot> {
        // The reader is prepared during the flight, because this takes time.
        let recordings = std::mem::take(&mut self.recordings);
        let (recordings, reader) = parallel::join(
            || if recordings.is_empty() { self.record(watch) } else { Ok(recordings) },
            || self.reader(),
        );
        let (recordings, reader) = (recordings?, reader?);
        self.stop.check()?;
        let lighting = self.light(recordings)?;
        watch(Stage::Exposing, 0.0);
        let cores = self.cores;
        let add_up = |latent: Latent| match cores {
            None => developer.develop(&latent),
            Some(cores) => Ok(Exposure::by_processor(latent.develop_on(cores))),
        };
        let shot = self.expose(lighting, add_up, reader.as_deref())?;
        watch(Stage::Exposing, 1.0);
        Ok(shot)
    }

    /// Exposes recordings that may have grown since the last photograph on the same film. Only
    /// their new light is drawn, on the processor. The photo equals that of [`Self::take`], but is
    /// not read.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Self::take`].
    pub fn take_on(mut self, film: &mut GrowingFilm) -> Result<Shot> {
        let recordings = std::mem::take(&mut self.recordings);
        let lighting = self.light(recordings)?;
        self.expose(lighting, |latent| Ok(Exposure::by_processor(film.develop(latent))), None)
    }

    /// Simulates the flights and returns them as recordings.
    fn record(&self, watch: &Watch<'_>) -> Result<Vec<Recording>> {
        Ok(self.fly(watch)?.into_iter().map(Recording::Flight).collect())
    }

    /// Returns a reader for the strokes, or `None` if the photo is not read or cannot be judged. A
    /// reader that is already prepared is shared.
    fn reader(&self) -> Result<Option<Arc<Reader>>> {
        let judged = self.strokes.as_ref().filter(|strokes| is_judged(strokes));
        let strokes = judged.filter(|_| self.judging != Judging::Skipped);
        match (&self.reader, strokes) {
            (_, None) => Ok(None),
            (Some(reader), _) => Ok(Some(reader.clone())),
            (None, Some(strokes)) => Ok(Some(Arc::new(Reader::new(strokes, &self.scene.score)?))),
        }
    }
}
