//! Flights in step, for reinforcement learning.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use super::estimator::PyEstimator;
use super::flight::for_any_controller;
use super::scene::PyScene;
use super::study::columns;
use super::{array, array_of, numbers, raised, refused, run, to_python};
use noctograph::diagnostic::Diagnostic;
use noctograph::error::{Error, Result};
use noctograph::scene::NamedScene;
use noctograph::shoot::Stop;
use noctograph::sim::{Avionics, Session};
use noctograph::studies::{Conditions, Outcome, Prepared};

/// Commands below which another thread takes longer to start than they take to fly, 5 µs each.
const FEW_COMMANDS: u32 = 16;

/// One of the flights, and how it was lost.
#[derive(Debug, Default)]
struct Flying {
    seed: u64,
    session: Option<Session>,
    lost: Option<String>,
}

impl Flying {
    /// Holds motor commands, or those of the scene's controller, for `n` commands.
    fn hold(&mut self, motors: Option<[f64; 4]>, n: u32) {
        if let Some(session) = self.session.as_mut().filter(|_| self.lost.is_none()) {
            let held = (0..n).try_for_each(|_| match motors {
                None => session.control(),
                Some(motors) => session.command(motors),
            });
            self.lost = held.err().map(|error| error.to_string());
        }
    }

    /// The outcome of its photo, and its warning if the drone stood on the floor.
    fn judged(self, prepared: &Prepared) -> Result<(Outcome, Option<Diagnostic>)> {
        match (self.lost, self.session) {
            (None, Some(session)) => {
                let flight = session.finish();
                let mut warnings = flight.warnings.iter();
                let grounded = warnings.find(|warning| warning.code == "grounded").cloned();
                Ok((prepared.judge(Ok(vec![flight]), self.seed)?, grounded))
            }
            (lost, _) => {
                let how = lost.unwrap_or_else(|| "it was never flown".into());
                Ok((Outcome::lost(prepared.word(), how), None))
            }
        }
    }
}

/// N flights of a scene that wait for motor commands: see `VectorEnv` of `noctograph/learning.py`.
#[pyclass(frozen, name = "Sessions", module = "noctograph._noctograph")]
#[derive(Debug)]
pub(super) struct PySessions {
    prepared: Arc<Prepared>,
    estimator: Option<PyEstimator>,
    flying: Mutex<Vec<Flying>>,
}

impl PySessions {
    fn all(&self) -> MutexGuard<'_, Vec<Flying>> {
        self.flying.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Least flights of a thread's task. Flights with an estimator of Python follow each other, so
    /// that an estimator that draws random numbers draws the same ones each time.
    fn at_once(&self) -> usize {
        if self.estimator.is_some() { usize::MAX } else { 1 }
    }

    /// The exception of an estimator of Python.
    fn thrown(&self) -> PyResult<()> {
        self.estimator.as_ref().and_then(PyEstimator::thrown).map_or(Ok(()), Err)
    }
}

#[pymethods]
impl PySessions {
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
        // Another controller gets a plan that is not made for the scene's.
        let scene = if by_itself { scene } else { for_any_controller(scene) };
        let conditions = conditions.to_owned();
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
        let flying = std::iter::repeat_with(Flying::default).take(n).collect();
        let (prepared, estimator) = (Arc::new(prepared), estimator.map(PyEstimator::new));
        Ok(Self { prepared, estimator, flying: Mutex::new(flying) })
    }

    /// Motor commands a second.
    #[getter]
    fn command_hz(&self) -> u32 {
        self.prepared.scene().sim().rates.attitude_hz()
    }

    /// Duration of the plan, s.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.prepared.plans().first().map_or(0.0, |plan| plan.duration_s())
    }

    /// Begins flights again: those whose seed is not None.
    fn reset(&self, py: Python<'_>, seeds: Vec<Option<u64>>) -> PyResult<()> {
        let begun: Result<()> = py.detach(|| {
            let mut flights = self.all();
            let seeded = flights.par_iter_mut().zip(seeds).with_min_len(self.at_once());
            seeded.filter_map(|(flying, seed)| Some((flying, seed?))).try_for_each(
                |(flying, seed)| {
                    let session = self.prepared.shoot(seed).session(|avionics: &mut Avionics| {
                        self.estimator.iter().for_each(|estimator| estimator.begin(avionics));
                    });
                    *flying = Flying { seed, session: Some(session?), lost: None };
                    Ok(())
                },
            )
        });
        self.thrown()?;
        begun.map_err(|error| raised(py, &error))
    }

    /// Holds motor commands (N, 4), or those of the scene's controller, for `n_commands` (N) commands.
    /// Drones that have landed or are lost do not move.
    fn step(
        &self,
        py: Python<'_>,
        motors: Option<&Bound<'_, PyAny>>,
        n_commands: Vec<u32>,
    ) -> PyResult<()> {
        // Checked before anything moves, so that a refused call changes nothing.
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
            let hint = "a motor command is a number: look for 0 / 0 and for logarithms";
            return Err(refused(py, "motors", actual, "numbers", hint));
        }
        py.detach(|| {
            let (mut flights, n_all) = (self.all(), n_commands.iter().sum::<u32>());
            // On this thread if others are not worth it, or if an estimator's order counts.
            if n_all < FEW_COMMANDS || self.estimator.is_some() {
                let commanded = flights.iter_mut().zip(motors).zip(n_commands);
                commanded.for_each(|((flying, motors), n)| flying.hold(motors, n));
            } else {
                let commanded = flights.par_iter_mut().zip(motors).zip(n_commands);
                commanded.for_each(|((flying, motors), n)| flying.hold(motors, n));
            }
        });
        self.thrown()
    }

    /// Estimates (N, 12), references (N, 9), positions of truth and design (N, 3), times (N,) in s,
    /// and flags of flights that have landed and that are lost (N,). Estimates and references of
    /// flights that have landed are 0.
    fn look<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (flights, columns) = (self.all(), PyDict::new(py));
        let sessions: Vec<_> = flights.iter().map(|flying| flying.session.as_ref()).collect();
        let waits: Vec<_> = sessions.iter().map(|s| s.and_then(Session::waits)).collect();
        let numbers: [(&str, usize, Vec<f64>); 5] = [
            ("state", 12, waits.iter().flat_map(|w| w.map_or([0.0; 12], |(x, _)| x)).collect()),
            ("reference", 9, waits.iter().flat_map(|w| w.map_or([0.0; 9], |(_, r)| r)).collect()),
            ("position_m", 3, vectors(&sessions, Session::position_m)),
            ("design_m", 3, vectors(&sessions, Session::design_m)),
            ("time_s", 1, sessions.iter().map(|s| s.map_or(0.0, Session::time_s)).collect()),
        ];
        for (name, n, values) in numbers {
            columns.set_item(name, array(py, &values, n)?)?;
        }
        let landed = waits.iter().map(|waits| waits.is_none().into()).collect();
        let lost = flights.iter().map(|flying| flying.lost.is_some().into()).collect();
        for (name, flags) in [("landed", landed), ("lost", lost)] {
            let flags: Vec<u8> = flags;
            columns.set_item(name, array_of(py, &flags, "?", &[flags.len()])?)?;
        }
        Ok(columns)
    }

    /// Ends all flights: the outcomes of their photos, as columns of one row and as JSON, and
    /// warnings. Lost drones have no photo.
    fn outcomes<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyDict>, Vec<String>, Vec<String>)> {
        let ended: Vec<Flying> = self.all().iter_mut().map(std::mem::take).collect();
        let (prepared, stop) = (Arc::clone(&self.prepared), Stop::default());
        let until = stop.clone();
        let judged = run(py, &stop, move || {
            let judged = ended.into_par_iter().map(|flying| {
                until.check()?;
                flying.judged(&prepared)
            });
            judged.collect::<Result<Vec<_>>>()
        })?;
        let (outcomes, grounded): (Vec<Outcome>, Vec<_>) = judged.into_iter().unzip();
        // One warning for all drones that stood on the floor: that of the first.
        let (n, grounded) = (outcomes.len(), grounded.into_iter().flatten().collect::<Vec<_>>());
        let first = grounded.iter().take(1);
        let warnings = first.map(|warning| format!("{} of {n} flights: {warning}", grounded.len()));
        let json = outcomes.iter().map(|outcome| serde_json::json!(outcome).to_string()).collect();
        Ok((columns(py, &outcomes, [1, n])?, json, warnings.collect()))
    }

    /// Ends a flight: the outcome of its photo.
    fn outcome<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyAny>> {
        let ended = self.all().get_mut(index).and_then(|flying| {
            let (seed, lost) = (flying.seed, flying.lost.clone());
            Some(Flying { seed, lost, session: Some(flying.session.take()?) })
        });
        let Some(flying) = ended else { return Ok(py.None().into_bound(py)) };
        let prepared = Arc::clone(&self.prepared);
        let stage = move || Ok(flying.judged(&prepared)?.0);
        to_python(py, &run(py, &Stop::default(), stage)?)
    }
}

/// A vector of each session, zeros of those that have ended.
fn vectors(sessions: &[Option<&Session>], vector: fn(&Session) -> [f64; 3]) -> Vec<f64> {
    sessions.iter().flat_map(|session| session.map_or([0.0; 3], vector)).collect()
}
