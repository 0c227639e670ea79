//! Flights that advance together, step by step, for reinforcement learning and slow controllers.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use super::estimator::PyEstimator;
use super::flight::for_any_controller;
use super::scene::PyScene;
use super::study::columns;
use super::{array, array_of, check_not_forked, numbers, raised, refused, run, to_python};
use noctograph::diagnostic::Diagnostic;
use noctograph::error::{Error, Result};
use noctograph::scene::NamedScene;
use noctograph::shoot::Stop;
use noctograph::sim::{Avionics, Session};
use noctograph::studies::{Conditions, Outcome, Prepared};

/// Minimum number of commands that are flown on several threads. A command takes 5 µs, which is
/// less than starting a thread.
const LEAST_PARALLEL_COMMANDS: u32 = 16;

/// One of the flights that are stepped together.
#[derive(Debug, Default)]
struct SeededFlight {
    seed: u64,
    /// The session, or `None` before [`PySessions::reset`] and after the outcome.
    session: Option<Session>,
    /// Reason for which the drone was lost, if it was.
    lost: Option<String>,
}

impl SeededFlight {
    /// Applies the commands `motors`, 0 to 65535, for `n` command intervals, or flies with the
    /// scene's controller if `motors` is `None`. A lost drone does not move.
    fn hold(&mut self, motors: Option<[f64; 4]>, n: u32) {
        if let Some(session) = self.session.as_mut().filter(|_| self.lost.is_none()) {
            let result = (0..n).try_for_each(|_| match motors {
                None => session.control(),
                Some(motors) => session.command(motors),
            });
            self.lost = result.err().map(|error| error.to_string());
        }
    }

    /// Ends the flight. Returns the outcome of its photo, and a warning if it never took off.
    fn judge(self, prepared: &Prepared) -> Result<(Outcome, Option<Diagnostic>)> {
        match (self.lost, self.session) {
            (None, Some(session)) => {
                let flight = session.finish();
                let mut warnings = flight.warnings.iter();
                let grounded = warnings.find(|warning| warning.code == "grounded").cloned();
                Ok((prepared.judge(Ok(vec![flight]), self.seed)?, grounded))
            }
            (lost, _) => {
                let how = lost.unwrap_or_else(|| "the flight was not started".into());
                Ok((Outcome::lost(prepared.word(), how), None))
            }
        }
    }
}

/// N flights of a scene that wait for motor commands, see `VectorEnv` in `noctograph/learning.py`.
#[pyclass(frozen, name = "Sessions", module = "noctograph._noctograph")]
#[derive(Debug)]
pub(super) struct PySessions {
    prepared: Arc<Prepared>,
    estimator: Option<PyEstimator>,
    flights: Mutex<Vec<SeededFlight>>,
}

impl PySessions {
    /// Locks the flights.
    fn all(&self) -> MutexGuard<'_, Vec<SeededFlight>> {
        self.flights.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the minimum number of flights that one thread starts. With a Python estimator, one
    /// thread starts all flights, so that an estimator always draws its random numbers in the same
    /// order.
    fn least_flights_per_thread(&self) -> usize {
        if self.estimator.is_some() { usize::MAX } else { 1 }
    }

    /// Returns the exception that a Python estimator raised, if any, as an error.
    fn check_estimator(&self) -> PyResult<()> {
        self.estimator.as_ref().and_then(PyEstimator::take_exception).map_or(Ok(()), Err)
    }
}

#[pymethods]
impl PySessions {
    /// Prepares `n` flights of a scene under named conditions, and plans them once. If `by_itself`
    /// is true, the plan is adapted to the scene's own controller. Raises `InputError` for a scene
    /// of several drones.
    #[new]
    #[pyo3(signature = (scene, n, conditions, estimator = None, by_itself = false))]
    fn new(
        py: Python<'_>,
        scene: &PyScene,
        n: usize,
        conditions: &str,
        estimator: Option<Py<PyAny>>,
        by_itself: bool,
    ) -> PyResult<Self> {
        let scene = scene.0.clone();
        let scene = if by_itself { scene } else { for_any_controller(scene) };
        let conditions = conditions.to_owned();
        // The plan is computed once for all flights.
        let prepared = run(py, &Stop::default(), move || {
            let word = scene.word.clone();
            let named = NamedScene::new("scene", scene);
            let prepared = Prepared::new(&named, &word, &Conditions::find(&conditions)?)?;
            prepared.planned()?;
            match prepared.plans().len() {
                1 => Ok(prepared),
                n => Err(Error::input("scene", format!("{n} plans"), "one", "fly one drone")),
            }
        })?;
        let flights = Mutex::new(std::iter::repeat_with(SeededFlight::default).take(n).collect());
        let (prepared, estimator) = (Arc::new(prepared), estimator.map(PyEstimator::new));
        Ok(Self { prepared, estimator, flights })
    }

    /// Returns the number of motor commands per second.
    #[getter]
    fn command_hz(&self) -> u32 {
        self.prepared.scene().sim().rates.attitude_hz()
    }

    /// Returns the plan's duration in s.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.prepared.plans().first().map_or(0.0, |plan| plan.duration_s())
    }

    /// Restarts each flight whose entry in `seeds` is not None, with that seed. Raises the
    /// exception of a Python estimator.
    fn reset(&self, py: Python<'_>, seeds: Vec<Option<u64>>) -> PyResult<()> {
        check_not_forked()?;
        let result: Result<()> = py.detach(|| {
            let mut flights = self.all();
            let seeded =
                flights.par_iter_mut().zip(seeds).with_min_len(self.least_flights_per_thread());
            let seeded = seeded.filter_map(|(flight, seed)| Some((flight, seed?)));
            seeded.try_for_each(|(flight, seed)| {
                let session = self.prepared.shoot(seed).session(|avionics: &mut Avionics| {
                    self.estimator.iter().for_each(|estimator| estimator.install(avionics));
                });
                *flight = SeededFlight { seed, session: Some(session?), lost: None };
                Ok(())
            })
        });
        self.check_estimator()?;
        result.map_err(|error| raised(py, &error))
    }

    /// Applies motor commands (N, 4) for `n_commands` (N) command intervals, or flies with the
    /// scene's controller if `motors` is None. Drones that have landed or are lost do not move.
    fn step(
        &self,
        py: Python<'_>,
        motors: Option<&Bound<'_, PyAny>>,
        n_commands: Vec<u32>,
    ) -> PyResult<()> {
        // The arguments are checked before any drone moves, so that a refused call changes nothing.
        let n = self.all().len();
        let motors = match motors {
            None => vec![None; n],
            Some(motors) => {
                let numbers = numbers(motors, "motors", 4)?;
                numbers.as_chunks::<4>().0.iter().copied().map(Some).collect()
            }
        };
        if motors.len() != n {
            let (actual, wanted) = (motors.len(), format!("{n} rows"));
            return Err(refused(py, "motors", actual, wanted, "one row a flight"));
        }
        if let Some(row) = motors.iter().position(|row| row.iter().flatten().any(|m| m.is_nan())) {
            let actual = format!("NaN in row {row}");
            let hint = "a motor command must be a number: look for 0 / 0 and for logarithms";
            return Err(refused(py, "motors", actual, "numbers", hint));
        }
        // The flights run on this thread if there are few commands, or if their order matters.
        let n_total = n_commands.iter().sum::<u32>();
        let is_serial = n_total < LEAST_PARALLEL_COMMANDS || self.estimator.is_some();
        if !is_serial {
            check_not_forked()?;
        }
        py.detach(|| {
            let mut flights = self.all();
            if is_serial {
                let commanded = flights.iter_mut().zip(motors).zip(n_commands);
                commanded.for_each(|((flight, motors), n)| flight.hold(motors, n));
            } else {
                let commanded = flights.par_iter_mut().zip(motors).zip(n_commands);
                commanded.for_each(|((flight, motors), n)| flight.hold(motors, n));
            }
        });
        self.check_estimator()
    }

    /// Returns a dict of arrays: `state` (N, 12), the estimate, `reference` (N, 9), `position_m` and
    /// `design_m` (N, 3), `time_s` (N,), and the flags `landed` and `lost` (N,). State and reference
    /// are 0 for flights that have landed.
    fn observations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (flights, columns) = (self.all(), PyDict::new(py));
        let sessions: Vec<_> = flights.iter().map(|flight| flight.session.as_ref()).collect();
        // The state and the reference are known while a flight waits for a command, and are `None`
        // after the landing.
        let awaiting: Vec<_> =
            sessions.iter().map(|s| s.and_then(Session::command_inputs)).collect();
        let numbers: [(&str, usize, Vec<f64>); 5] = [
            ("state", 12, awaiting.iter().flat_map(|w| w.map_or([0.0; 12], |(x, _)| x)).collect()),
            (
                "reference",
                9,
                awaiting.iter().flat_map(|w| w.map_or([0.0; 9], |(_, r)| r)).collect(),
            ),
            ("position_m", 3, vectors(&sessions, Session::position_m)),
            ("design_m", 3, vectors(&sessions, Session::reference_m)),
            ("time_s", 1, sessions.iter().map(|s| s.map_or(0.0, Session::time_s)).collect()),
        ];
        for (name, n, values) in numbers {
            columns.set_item(name, array(py, &values, n)?)?;
        }
        let landed = awaiting.iter().map(|observation| observation.is_none().into()).collect();
        let lost = flights.iter().map(|flight| flight.lost.is_some().into()).collect();
        for (name, flags) in [("landed", landed), ("lost", lost)] {
            let flags: Vec<u8> = flags;
            columns.set_item(name, array_of(py, &flags, "?", &[flags.len()])?)?;
        }
        Ok(columns)
    }

    /// Ends all flights. Returns the outcomes of their photos as columns with one row and as JSON
    /// texts, and warnings. A lost drone has an outcome without a photo.
    fn outcomes<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyDict>, Vec<String>, Vec<String>)> {
        let ended: Vec<SeededFlight> = self.all().iter_mut().map(std::mem::take).collect();
        let (prepared, stop) = (Arc::clone(&self.prepared), Stop::default());
        let inner_stop = stop.clone();
        let results = run(py, &stop, move || {
            let results = ended.into_par_iter().map(|flight| {
                inner_stop.check()?;
                flight.judge(&prepared)
            });
            results.collect::<Result<Vec<_>>>()
        })?;
        let (outcomes, grounded): (Vec<Outcome>, Vec<_>) = results.into_iter().unzip();
        // A single warning represents all drones that never took off.
        let (n, grounded) = (outcomes.len(), grounded.into_iter().flatten().collect::<Vec<_>>());
        let first = grounded.iter().take(1);
        let warnings = first.map(|warning| format!("{} of {n} flights: {warning}", grounded.len()));
        let json = outcomes.iter().map(|outcome| serde_json::json!(outcome).to_string()).collect();
        Ok((columns(py, &outcomes, [1, n])?, json, warnings.collect()))
    }

    /// Ends a flight. Returns the outcome of the flight's photo, or None if the flight had already
    /// ended.
    fn outcome<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyAny>> {
        // The flag of a lost drone is kept for `observations`.
        let ended = self.all().get_mut(index).and_then(|flight| {
            let (seed, lost) = (flight.seed, flight.lost.clone());
            Some(SeededFlight { seed, lost, session: Some(flight.session.take()?) })
        });
        let Some(flight) = ended else { return Ok(py.None().into_bound(py)) };
        let prepared = Arc::clone(&self.prepared);
        let stage = move || Ok(flight.judge(&prepared)?.0);
        to_python(py, &run(py, &Stop::default(), stage)?)
    }
}

/// Returns the `vector` of each session one after another, with zeros for sessions that have ended.
fn vectors(sessions: &[Option<&Session>], vector: fn(&Session) -> [f64; 3]) -> Vec<f64> {
    sessions.iter().flat_map(|session| session.map_or([0.0; 3], vector)).collect()
}
