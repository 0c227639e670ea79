//! Flights in step, for reinforcement learning.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use super::estimator::PyEstimator;
use super::flight::for_any_controller;
use super::scene::PyScene;
use super::study::columns;
use super::{array, array_of, numbers, raised, run, to_python};
use noctograph::error::{Error, Result};
use noctograph::scene::NamedScene;
use noctograph::shoot::Stop;
use noctograph::sim::{Avionics, Session};
use noctograph::studies::{Conditions, Outcome, Prepared};

/// Commands below which another thread takes longer to wake than they take to fly, 5 µs each.
const FEW_COMMANDS: u32 = 16;

/// One of the flights, and what became of it.
#[derive(Debug, Default)]
struct Flying {
    seed: u64,
    session: Option<Session>,
    lost: Option<String>,
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

    /// Least flights of a task: those with an estimator of Python follow each other, so that one that
    /// draws random numbers finds the same ones each time.
    fn at_once(&self) -> usize {
        if self.estimator.is_some() { usize::MAX } else { 1 }
    }

    /// What an estimator of Python raised.
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
        let begin = |(flying, seed): (&mut Flying, Option<u64>)| {
            let Some(seed) = seed else { return Ok(()) };
            let estimates = |avionics: &mut Avionics| {
                self.estimator.iter().for_each(|estimator| estimator.begin(avionics));
            };
            let session = Some(self.prepared.shoot(seed).session(estimates)?);
            *flying = Flying { seed, session, lost: None };
            Ok(())
        };
        let begun: Result<()> = py.detach(|| {
            let mut flying = self.all();
            let begun = flying.par_iter_mut().zip(seeds).with_min_len(self.at_once());
            begun.map(begin).collect()
        });
        self.thrown()?;
        begun.map_err(|error| raised(py, &error))
    }

    /// Holds motor commands (N, 4), or those of the scene's controller, for `n_commands` (N) turns;
    /// those who have landed or are lost do not move.
    fn step(
        &self,
        py: Python<'_>,
        motors: Option<&Bound<'_, PyAny>>,
        n_commands: Vec<u32>,
    ) -> PyResult<()> {
        let (n, by_itself) = (self.all().len(), motors.is_none());
        let motors = motors.map_or_else(|| Ok(vec![0.0; 4 * n]), |it| numbers(it, "motors", 4))?;
        if motors.len() != 4 * n {
            let (actual, wanted) = (motors.len() / 4, format!("{n} rows"));
            return Err(raised(py, &Error::input("motors", actual, wanted, "one row a flight")));
        }
        if let Some(row) = motors.chunks(4).position(|row| row.iter().any(|m| m.is_nan())) {
            let actual = format!("NaN in row {row}");
            let hint = "a motor command is a number: look for 0 / 0 and for logarithms";
            return Err(raised(py, &Error::input("motors", actual, "numbers", hint)));
        }
        let turn = |((flying, motors), n): ((&mut Flying, &[f64]), u32)| {
            let Some(session) = flying.session.as_mut().filter(|_| flying.lost.is_none()) else {
                return;
            };
            let motors = [motors[0], motors[1], motors[2], motors[3]];
            let turns = (0..n).try_for_each(|_| match by_itself {
                true => session.control(),
                false => session.command(motors),
            });
            flying.lost = turns.err().map(|error| error.to_string());
        };
        py.detach(|| {
            let (mut flying, commands) = (self.all(), n_commands.iter().sum::<u32>());
            let commanded = flying.iter_mut().zip(motors.chunks_exact(4)).zip(n_commands);
            if commands < FEW_COMMANDS || self.estimator.is_some() {
                commanded.for_each(turn);
            } else {
                commanded.collect::<Vec<_>>().into_par_iter().for_each(turn);
            }
        });
        self.thrown()
    }

    /// Estimates (N, 12), references (N, 9), positions of truth and design (N, 3), times (N,) in s,
    /// and whether each has landed and is lost (N,); estimate and reference are 0 of those who have
    /// landed.
    fn look<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let flying = self.all();
        let (mut state, mut reference, mut time) = (vec![], vec![], vec![]);
        let (mut position, mut design) = (vec![], vec![]);
        let (mut landed, mut lost) = (vec![], vec![]);
        for flying in flying.iter() {
            let session = flying.session.as_ref();
            let waits = session.and_then(Session::waits);
            let (of_state, of_design) = waits.unwrap_or(([0.0; 12], [0.0; 9]));
            state.extend(of_state);
            reference.extend(of_design);
            position.extend(session.map_or([0.0; 3], Session::position_m));
            design.extend(session.map_or([0.0; 3], Session::design_m));
            time.push(session.map_or(0.0, Session::time_s));
            landed.push(u8::from(waits.is_none()));
            lost.push(u8::from(flying.lost.is_some()));
        }
        let columns = PyDict::new(py);
        columns.set_item("state", array(py, &state, 12)?)?;
        columns.set_item("reference", array(py, &reference, 9)?)?;
        columns.set_item("position_m", array(py, &position, 3)?)?;
        columns.set_item("design_m", array(py, &design, 3)?)?;
        columns.set_item("time_s", array(py, &time, 1)?)?;
        columns.set_item("landed", array_of(py, &landed, "?", &[landed.len()])?)?;
        columns.set_item("lost", array_of(py, &lost, "?", &[lost.len()])?)?;
        Ok(columns)
    }

    /// Ends all flights: the outcomes of their photos, as columns of one row and as JSON. Those who
    /// were lost have none.
    fn outcomes<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyDict>, Vec<String>)> {
        let ended: Vec<Flying> = self.all().iter_mut().map(std::mem::take).collect();
        let prepared = Arc::clone(&self.prepared);
        let stop = Stop::default();
        let until = stop.clone();
        let judge = move |flying: Flying| {
            until.check()?;
            match (flying.lost, flying.session) {
                (None, Some(session)) => prepared.judge(Ok(vec![session.finish()]), flying.seed),
                (lost, _) => {
                    let how = lost.unwrap_or_else(|| "it was never flown".into());
                    Ok(Outcome::lost(prepared.word(), how))
                }
            }
        };
        let judged =
            run(py, &stop, move || ended.into_par_iter().map(judge).collect::<Result<Vec<_>>>())?;
        let json = judged.iter().map(|it| serde_json::json!(it).to_string()).collect();
        Ok((columns(py, &judged, [1, judged.len()])?, json))
    }

    /// Ends a flight: the outcome of its photo.
    fn outcome<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyAny>> {
        let ended = self.all().get_mut(index).and_then(|it| Some((it.session.take()?, it.seed)));
        let Some((session, seed)) = ended else { return Ok(py.None().into_bound(py)) };
        let prepared = Arc::clone(&self.prepared);
        let stage = move || prepared.judge(Ok(vec![session.finish()]), seed);
        to_python(py, &run(py, &Stop::default(), stage)?)
    }
}
