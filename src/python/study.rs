//! Studies, which consist of many flights and their outcomes.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use serde_json::json;

use super::scene::PyScene;
use super::{Ends, array_of, raised, run_showing, to_python};
use noctograph::cli::{ranking_report, tuning_report};
use noctograph::error::Result;
use noctograph::scene::{NamedScene, SceneTask};
use noctograph::shoot::Stop;
use noctograph::studies::{
    Candidate, Conditions, Flown, Knob, Outcome, Prepared, Record, Store, Study, Trial,
    TuneOptions, Unranked, acuity, evaluate, flights_csv, marks_csv, rank, ranking_csv, tune,
};

/// Runs a stage of `total` flights, and meanwhile calls the Python function `progress(done, total)`
/// every 50 ms. Returns the stage's result. The stage receives the signal to stop and the counter
/// of the flights that are done.
fn counted<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    total: usize,
    stage: impl FnOnce(&Stop, &AtomicUsize) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let (stop, done) = (Stop::default(), Arc::new(AtomicUsize::new(0)));
    let (inner_stop, counter) = (stop.clone(), Arc::clone(&done));
    let show = |py: Python<'_>| match &progress {
        Some(progress) => progress.call1(py, (done.load(Ordering::Relaxed), total)).map(drop),
        None => Ok(()),
    };
    run_showing(py, &stop, show, Ends::ByItself, move || stage(&inner_stop, &counter))
}

/// Flies every scene with every seed and returns the outcomes, see `fly_many` in
/// `noctograph/studies.py`.
#[pyfunction]
pub(super) fn outcomes<'py>(
    py: Python<'py>,
    scenes: Vec<PyRef<'_, PyScene>>,
    seeds: Vec<u64>,
    conditions: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let scenes: Vec<_> = scenes.iter().map(|scene| scene.0.clone()).collect();
    let (shape, conditions) = ([scenes.len(), seeds.len()], conditions.to_owned());
    let outcomes = counted(py, progress, shape[0] * shape[1], move |stop, counter| {
        let conditions = Conditions::find(&conditions)?;
        // The result contains a row for each scene, with an outcome for each seed.
        let rows = scenes.into_par_iter().map(|scene| {
            stop.check()?;
            let word = scene.word.clone();
            let prepared = Prepared::new(&NamedScene::new("scene", scene), &word, &conditions)?;
            let outcomes = seeds.par_iter().map(|seed| {
                stop.check()?;
                let outcome = prepared.outcome(*seed)?;
                counter.fetch_add(1, Ordering::Relaxed);
                Ok(outcome)
            });
            outcomes.collect::<Result<Vec<_>>>()
        });
        Ok(rows.collect::<Result<Vec<_>>>()?.concat())
    })?;
    columns(py, &outcomes, shape)
}

/// Returns the columns of outcomes as arrays of shape (scenes, seeds), under the names of `Outcomes`
/// in `noctograph/studies.py`.
pub(super) fn columns<'py>(
    py: Python<'py>,
    outcomes: &[Outcome],
    shape: [usize; 2],
) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    // The figures of a lost drone are NaN.
    let figures = Flown::<f64>::NAMES.into_iter().enumerate().map(|(index, name)| {
        let values = outcomes.iter().map(|outcome| outcome.flown.map(|it| it.values()[index]));
        (name, values.map(|value| value.unwrap_or(f64::NAN)).collect())
    });
    let numbers: [(&str, Vec<f64>); 2] = [
        ("probability", outcomes.iter().map(|outcome| outcome.probability).collect()),
        ("similarity", outcomes.iter().map(|outcome| outcome.similarity).collect()),
    ];
    for (name, values) in numbers.into_iter().chain(figures) {
        columns.set_item(name, array_of(py, bytemuck::cast_slice(&values), "f8", &shape)?)?;
    }
    // numpy stores a flag as a byte.
    let flags: [(&str, Vec<u8>); 2] = [
        ("legible", outcomes.iter().map(|outcome| outcome.legible.into()).collect()),
        ("lost", outcomes.iter().map(|outcome| outcome.lost.is_some().into()).collect()),
    ];
    for (name, values) in flags {
        columns.set_item(name, array_of(py, &values, "?", &shape)?)?;
    }
    let rows = outcomes.chunks(shape[1].max(1));
    let read = rows.map(|row| row.iter().map(|outcome| outcome.read.as_str()).collect());
    columns.set_item("read", read.collect::<Vec<Vec<&str>>>())?;
    Ok(columns)
}

/// Returns the study of named scenes, of words with their numbers of seeds, and of a seed, from
/// which the seeds of the flights follow, under the conditions `still`.
fn study(scenes: Vec<(String, PyRef<'_, PyScene>)>, words: Vec<(String, u32)>, seed: u64) -> Study {
    let contenders =
        scenes.into_iter().map(|(name, scene)| NamedScene::new(&name, scene.0.clone())).collect();
    Study { contenders, words, conditions: Conditions::still(), seed }
}

/// Trials of a study, each with the indices of its contender and word, and its seed.
type Trials = Vec<(usize, usize, u64)>;

/// Returns the trials of a ranking, in their order.
#[pyfunction]
pub(super) fn trials(
    py: Python<'_>,
    scenes: Vec<(String, PyRef<'_, PyScene>)>,
    words: Vec<(String, u32)>,
    seed: u64,
) -> PyResult<Trials> {
    let study = study(scenes, words, seed);
    study.check().map_err(|error| raised(py, &error))?;
    Ok(trials_of(&study))
}

/// Returns the trials of a study as plain numbers.
fn trials_of(study: &Study) -> Trials {
    study.trials().map(|trial| (trial.contender, trial.word, trial.seed)).collect()
}

/// Returns the rungs of a ladder with `n` seeds per word. Each rung has lower letters than the one
/// before. It contains the scenes with the rung's letter height, and the trials.
#[pyfunction]
pub(super) fn ladder(
    py: Python<'_>,
    scenes: Vec<(String, PyRef<'_, PyScene>)>,
    words: Vec<(String, u32)>,
    seed: u64,
    n: u32,
) -> PyResult<Vec<(Vec<PyScene>, Trials)>> {
    let ladder = study(scenes, words, seed).ladder(n).map_err(|error| raised(py, &error))?;
    let rungs = ladder.into_iter().map(|rung| {
        let trials = trials_of(&rung);
        (rung.contenders.into_iter().map(|named| PyScene(named.scene)).collect(), trials)
    });
    Ok(rungs.collect())
}

/// Flies the trials of a study that are not in `flown`, and returns the records of all trials in
/// their order. `flown` contains the outcomes of trials that Python flew, as JSON by the trial's
/// index. `done` receives the number of trials that were flown here.
fn records(
    study: &Study,
    flown: &BTreeMap<usize, String>,
    store: Option<&Store>,
    stop: &Stop,
    done: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Record>> {
    let trials: Vec<Trial> = study.trials().collect();
    let unflown = trials.iter().enumerate().filter(|(index, _)| !flown.contains_key(index));
    let unflown: Vec<Trial> = unflown.map(|(_, trial)| *trial).collect();
    let evaluated = evaluate(study, &study.prepare()?, &unflown, store, stop, done)?;
    // The outcomes of trials flown here and in Python are merged in the order of the trials.
    let mut evaluated = evaluated.into_iter();
    let records = trials.iter().enumerate().map(|(index, trial)| match flown.get(&index) {
        None => evaluated.next().expect("a record for each trial"),
        Some(outcome) => Record {
            scene: "a controller of Python".into(),
            contender: study.contenders[trial.contender].name.clone(),
            word: study.words[trial.word].0.clone(),
            seed: trial.seed,
            outcome: serde_json::from_str(outcome).expect("an outcome of `Sessions`"),
        },
    });
    Ok(records.collect())
}

/// Returns the [`records`] of several studies, which are flown one after another. `counter` counts
/// the flights of all studies that were flown here.
fn all_records<'a>(
    studies: impl Iterator<Item = (Study, &'a BTreeMap<usize, String>)>,
    store: Option<&Store>,
    stop: &Stop,
    counter: &AtomicUsize,
) -> Result<Vec<Vec<Record>>> {
    let mut n_done = 0;
    let records = studies.map(|(study, flown)| {
        let done = &|n| counter.store(n_done + n, Ordering::Relaxed);
        let records = records(&study, flown, store, stop, done)?;
        n_done += records.len() - flown.len();
        Ok(records)
    });
    records.collect()
}

/// Ranks scenes for `rank` in `noctograph/studies.py`. Returns the table, and the keys of
/// `ranking.json` with the flights. `flown` contains the outcomes of trials that Python flew, as
/// JSON by their index in [`trials`]. `smaller` contains the number of seeds on each rung of
/// [`ladder`], and such outcomes for each rung.
#[pyfunction]
#[pyo3(signature = (scenes, words, conditions, seed, folder, flown, unranked, progress, smaller = None))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(super) fn ranking<'py>(
    py: Python<'py>,
    scenes: Vec<(String, PyRef<'_, PyScene>)>,
    words: Vec<(String, u32)>,
    conditions: &str,
    seed: u64,
    folder: Option<PathBuf>,
    flown: BTreeMap<usize, String>,
    unranked: BTreeMap<String, String>,
    progress: Option<Py<PyAny>>,
    smaller: Option<(u32, Vec<BTreeMap<usize, String>>)>,
) -> PyResult<(String, Bound<'py, PyAny>)> {
    let mut study = study(scenes, words, seed);
    let conditions = conditions.to_owned();
    let ladder = smaller.as_ref().map(|(n, _)| study.ladder(*n)).transpose();
    let ladder = ladder.map_err(|error| raised(py, &error))?.unwrap_or_default();
    let flown_on_rungs = smaller.map_or_else(Vec::new, |(_, flown)| flown);
    let n_flights: usize = ladder.iter().chain([&study]).map(Study::n_trials).sum();
    let n_flown = flown_on_rungs.iter().chain([&flown]).map(BTreeMap::len).sum::<usize>();
    let (text, json) = counted(py, progress, n_flights - n_flown, move |stop, counter| {
        study.conditions = Conditions::find(&conditions)?;
        if unranked.is_empty() || !study.contenders.is_empty() {
            study.check()?;
        }
        let store = folder.map(|folder| Store::open(&folder)).transpose()?;
        let rungs = ladder.iter().zip(&flown_on_rungs).map(|(rung, flown)| {
            (Study { conditions: study.conditions.clone(), ..rung.clone() }, flown)
        });
        let studies = std::iter::once((study.clone(), &flown)).chain(rungs);
        let mut records_by_study = all_records(studies, store.as_ref(), stop, counter)?;
        let records = records_by_study.remove(0);
        let mut ranking = rank(&study, &records);
        ranking.acuity = (!ladder.is_empty()).then(|| acuity(&ladder, &records_by_study));
        let unranked = unranked.into_iter();
        ranking.unranked = unranked.map(|(contender, note)| Unranked { contender, note }).collect();
        // The result contains the keys that the command line prints, and all flights and tables.
        let report = ranking_report(&study, &ranking, records.len());
        let mut json = report.json;
        json["flights"] = json!(records);
        json["csv"] = json!({
            "marks": marks_csv(&ranking), "ranking": ranking_csv(&ranking),
            "flights": flights_csv(&records),
        });
        Ok((report.text, json))
    })?;
    Ok((text, to_python(py, &json)?))
}

/// Returns a task's scene with the settings of the submission at `path`. Refuses settings that are not
/// in `may`. See `noctograph/grade.py`.
#[pyfunction]
pub(super) fn submission(
    py: Python<'_>,
    task: &PyScene,
    may: Vec<String>,
    path: PathBuf,
) -> PyResult<PyScene> {
    let task = SceneTask::new(task.0.clone(), &may).map_err(|error| raised(py, &error))?;
    task.submission(&path).map(PyScene).map_err(|error| raised(py, &error))
}

/// Returns the smallest number of flights per contender with which any two can be distinguished.
#[pyfunction]
pub(super) fn least_flights(n_contenders: usize) -> u32 {
    noctograph::studies::least_flights(n_contenders)
}

/// Tunes a scene for `tune` in `noctograph/studies.py`. Returns the table, the keys of `noctograph
/// tune --json` with all candidates, and the tuned scene.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(super) fn tuning<'py>(
    py: Python<'py>,
    scene: &PyScene,
    words: Vec<(String, u32)>,
    knobs: Option<Vec<String>>,
    budget: usize,
    conditions: &str,
    seed: u64,
    folder: Option<PathBuf>,
    callback: Option<Py<PyAny>>,
) -> PyResult<(String, Bound<'py, PyAny>, PyScene)> {
    let (base, stop) = (scene.0.clone(), Stop::default());
    let (inner_stop, conditions) = (stop.clone(), conditions.to_owned());
    let exception = Arc::new(Mutex::new(None));
    let inner_exception = Arc::clone(&exception);
    let result = run_showing(
        py,
        &stop,
        |_| Ok(()),
        Ends::Joined,
        move || {
            let knobs = match knobs {
                None => Knob::usual(&base),
                Some(knobs) => knobs.iter().map(|knob| knob.parse()).collect::<Result<_>>()?,
            };
            let (conditions, test_seeds) = (Conditions::find(&conditions)?, TEST_SEEDS);
            let options =
                TuneOptions { knobs, words, budget, test_seeds, longest_s: None, conditions, seed };
            let store = folder.map(|folder| Store::open(&folder)).transpose()?;
            // An exception in the callback ends the search.
            let mut watch = |n_flights: usize, best: &Candidate| {
                let Some(callback) = &callback else { return true };
                call_back(callback, n_flights, best).unwrap_or_else(|error| {
                    *inner_exception.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                    inner_stop.now();
                    false
                })
            };
            let tuned = tune(&base, &options, store.as_ref(), &inner_stop, &mut watch)?;
            let mut report = tuning_report(&options, &tuned, None);
            report.json["candidates"] = json!(tuned.candidates);
            report.json["front"] = json!(tuned.front);
            Ok((report, tuned.scene))
        },
    );
    // The exception is raised, because the search itself reports only that it was stopped.
    let exception = exception.lock().unwrap_or_else(PoisonError::into_inner).take();
    let (report, scene) = exception.map_or(result, Err)?;
    Ok((report.text, to_python(py, &report.json)?, PyScene(scene)))
}

/// Number of seeds per word with which a tuned scene is tested.
const TEST_SEEDS: u32 = 40;

/// Calls a Python callback with the number of flights so far and the best candidate. Returns true,
/// so that the search continues, if the callback returns true or None.
fn call_back(callback: &Py<PyAny>, n_flights: usize, best: &Candidate) -> PyResult<bool> {
    Python::attach(|py| {
        let best = to_python(py, best)?;
        let answer = callback.bind(py).call1((n_flights, best))?;
        Ok(answer.is_none() || answer.is_truthy()?)
    })
}
