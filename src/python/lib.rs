//! The Python package `noctograph` (crate `noctograph-python`): stages as functions, products as
//! objects with numpy arrays. `examples/python` builds and documents it.
//!
//! The interpreter is released while a stage runs, and asked for Ctrl-C meanwhile.
#![expect(clippy::doc_markdown, reason = "docstrings of Python are in numpydoc's format")]

mod columns;
mod estimator;
mod flight;
mod plan;
mod scene;
mod sessions;
mod shot;
mod study;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::Write;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyTuple};

use noctograph::error::{Error, Result, Segment};
use noctograph::scene::CarriedScene;
use noctograph::shoot::Stop;
use noctograph_core::files::Output;

use self::scene::PyScene;

/// Time between two looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// What `__reduce__` returns: a function and its arguments, for pickle.
type Reduced<T> = (Py<PyAny>, T);

#[pymodule]
mod _noctograph {
    #[pymodule_export]
    use super::{
        command,
        flight::{PyFlight, fly, import_log},
        main,
        plan::{PyPlan, plan},
        scene::{PyScene, setting},
        sessions::PySessions,
        shot::{PyShot, flip, photograph, read, score},
        study::{ladder, least_flights, outcomes, ranking, submission, trials, tuning},
    };

    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "Python names it")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}

/// The Python exception of an error: a class of `noctograph.errors`, or `OSError`.
fn raised(py: Python<'_>, error: &Error) -> PyErr {
    let (class, arguments) = match error {
        Error::Input { place, found, wanted, hint, .. } => {
            // A line of a scene's text that nobody wrote means nothing.
            let mut place = (**place).clone();
            if place.0.first() == Some(&Segment::File("scene".into())) {
                place.0.retain(|part| matches!(part, Segment::Key(_) | Segment::Index(_)));
            }
            ("InputError", vec![place.to_string(), found.clone(), wanted.clone(), hint.clone()])
        }
        Error::Letter { position, letter, wanted, hint } => {
            let (place, actual) = (format!("word, position {position}"), format!("{letter:?}"));
            ("InputError", vec![place, actual, wanted.clone(), hint.clone()])
        }
        Error::Io { path, source, .. } => {
            let text = format!("{}: {source}", path.display());
            return match source.raw_os_error() {
                Some(_) => PyErr::from(std::io::Error::new(source.kind(), text)),
                None => pyo3::exceptions::PyOSError::new_err(text),
            };
        }
        Error::Infeasible { what, hint, .. } => {
            ("InfeasibleError", vec![what.clone(), hint.clone()])
        }
        other => ("InfeasibleError", vec![other.to_string(), other.hint().to_owned()]),
    };
    // If the class itself fails, its exception is raised.
    let made = py.import("noctograph.errors").and_then(|errors| {
        let arguments = PyTuple::new(py, arguments)?;
        errors.getattr(class)?.call1(arguments)
    });
    made.map_or_else(|broken| broken, PyErr::from_value)
}

/// The exception of an input that cannot be used.
fn refused(
    py: Python<'_>,
    place: &str,
    found: impl std::fmt::Display,
    wanted: impl Into<String>,
    hint: &str,
) -> PyErr {
    raised(py, &Error::input(place, found, wanted, hint))
}

/// Warns of each text in the name of the caller's line: see `noctograph/errors.py`.
fn warn(py: Python<'_>, texts: impl IntoIterator<Item = String>) -> PyResult<()> {
    let warn = py.import("noctograph.errors")?.getattr("warn")?;
    texts.into_iter().try_for_each(|text| warn.call1((text,)).map(drop))
}

/// Runs a command of the program: its table, and what it prints with `--json`.
#[pyfunction]
fn command(py: Python<'_>, words: Vec<String>) -> PyResult<(String, Bound<'_, PyAny>)> {
    let report = run(py, &Stop::default(), move || noctograph::cli::report_of(&words))?;
    Ok((report.text, to_python(py, &report.json)?))
}

/// The program: runs the command that was typed, and returns its exit code. `program` starts it
/// again, in a process of its own.
#[pyfunction]
fn main(py: Python<'_>, program: Vec<OsString>, words: Vec<OsString>) -> u8 {
    noctograph::cli::starts_as(program);
    noctograph::cli::typed_as(words);
    py.detach(noctograph::cli::main)
}

/// The text that a writer of CSV makes.
fn text_of(write: impl FnOnce(&mut Vec<u8>) -> std::io::Result<()>) -> String {
    let mut csv = Vec::new();
    write(&mut csv).expect("memory can be written");
    String::from_utf8(csv).expect("CSV is text")
}

/// A CSV text as a table of pandas.
fn data_frame(py: Python<'_>, csv: String) -> PyResult<Bound<'_, PyAny>> {
    let text = py.import("io")?.call_method1("StringIO", (csv,))?;
    py.import("pandas")?.call_method1("read_csv", (text,))
}

/// An object for pickle: the static method that reads it again, and its text.
fn reduced(object: &Bound<'_, PyAny>, read: &str, text: String) -> PyResult<Reduced<(String,)>> {
    Ok((object.get_type().getattr(read)?.unbind(), (text,)))
}

/// Writes a file, which appears when it is whole.
fn save(py: Python<'_>, path: &Path, bytes: &[u8]) -> PyResult<()> {
    let written = Output::create(path).and_then(|file| file.keep(bytes));
    written.map(|_path| ()).map_err(|error| raised(py, &error))
}

/// Writes a plan or a flight, with its scene beside it if one is given.
fn save_with(py: Python<'_>, path: &Path, bytes: &[u8], scene: Option<&PyScene>) -> PyResult<()> {
    let Some(PyScene(scene)) = scene else { return save(py, path, bytes) };
    let written = Output::create(path).and_then(|file| {
        let beside = Output::create(&CarriedScene::path_beside(path))?;
        CarriedScene::keep_with(file.write_with(|out| out.write_all(bytes))?, beside, scene)
    });
    written.map(|_paths| ()).map_err(|error| raised(py, &error))
}

/// Plain data as objects of Python.
fn to_python<'py>(py: Python<'py>, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    let json = serde_json::to_string(value).expect("plain data");
    py.import("json")?.call_method1("loads", (json,))
}

/// Runs a stage without the interpreter. Ctrl-C stops it, and its result is dropped.
fn run<T: Send + 'static>(
    py: Python<'_>,
    stop: &Stop,
    stage: impl FnOnce() -> Result<T> + Send + 'static,
) -> PyResult<T> {
    run_showing(py, stop, |_| Ok(()), Ends::ByItself, stage)
}

/// The end of a stage that was stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ends {
    /// It calls no Python: it ends when it looks for the stop.
    ByItself,
    /// It calls functions of Python, and must not do so when the interpreter ends, which waits.
    Joined,
}

/// As [`run`], with a call of `show` now and then and at the end. Its exception stops the stage.
fn run_showing<T: Send + 'static>(
    py: Python<'_>,
    stop: &Stop,
    mut show: impl FnMut(Python<'_>) -> PyResult<()> + Send,
    ends: Ends,
    stage: impl FnOnce() -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let done = py.detach(|| {
        let (sender, receiver) = channel();
        let worker = std::thread::spawn(move || {
            // Nobody listens after Ctrl-C.
            let _ = sender.send(stage());
        });
        loop {
            match receiver.recv_timeout(LOOK) {
                Ok(done) => return Ok(done),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    let text = "the program failed: please report what it printed";
                    return Err(pyo3::exceptions::PyRuntimeError::new_err(text));
                }
            }
            // The interpreter only now and then: the stage runs without it.
            if let Err(error) = Python::attach(|py| py.check_signals().and_then(|()| show(py))) {
                stop.now();
                while ends == Ends::Joined && !worker.is_finished() {
                    std::thread::sleep(Duration::from_millis(1));
                }
                return Err(error);
            }
        }
    });
    let done = done?.map_err(|error| raised(py, &error))?;
    show(py)?;
    Ok(done)
}

/// Bytes as an array of numpy, a copy in Python's memory that its owner may write to.
fn array_of<'py>(
    py: Python<'py>,
    bytes: &[u8],
    dtype: &str,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    let flat =
        py.import("numpy")?.call_method1("frombuffer", (PyByteArray::new(py, bytes), dtype))?;
    flat.call_method1("reshape", (PyTuple::new(py, shape)?,))
}

/// Rows of numbers as an array of `(rows, columns)`, or of `(rows,)` for a single column.
fn array<'py>(py: Python<'py>, values: &[f64], columns: usize) -> PyResult<Bound<'py, PyAny>> {
    let rows = values.len() / columns;
    let shape: &[usize] = if columns == 1 { &[rows] } else { &[rows, columns] };
    array_of(py, bytemuck::cast_slice(values), "f8", shape)
}

/// Columns by their names, each an array of `(rows,)`.
fn arrays<'py>(
    py: Python<'py>,
    columns: &BTreeMap<String, Vec<f64>>,
) -> PyResult<BTreeMap<String, Bound<'py, PyAny>>> {
    columns.iter().map(|(name, values)| Ok((name.clone(), array(py, values, 1)?))).collect()
}

/// The numbers of an array of `(rows, columns)`, or of `(rows,)` for a single column. Other shapes
/// are refused.
fn numbers(array: &Bound<'_, PyAny>, name: &str, columns: usize) -> PyResult<Vec<f64>> {
    let py = array.py();
    let array = py.import("numpy")?.call_method1("asarray", (array,))?;
    // A letter of numpy: `f` is floats, `c` complex numbers, `U` texts, `O` objects.
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if !"biufO".contains(&*kind) {
        let actual = if kind == "c" { "complex numbers" } else { "no numbers" };
        return Err(refused(py, name, actual, "numbers", "look at what is handed over"));
    }
    let array = py.import("numpy")?.call_method1("ascontiguousarray", (array, "f8"))?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let fits =
        if columns == 1 { shape.len() == 1 } else { shape.len() == 2 && shape[1] == columns };
    if !fits {
        let wanted = if columns == 1 { "(N,)".to_owned() } else { format!("(N, {columns})") };
        // The usual mistakes: quaternions, a column of one number a row, a transposed array.
        let hint = match name {
            "attitude_rad" if shape.last() == Some(&4) => {
                "yaw, pitch, roll: nc.attitude_rad makes them of quaternions"
            }
            _ if columns == 1 && shape.iter().filter(|n| **n != 1).count() == 1 => {
                &*format!("hand over {name}.ravel()")
            }
            _ if shape.len() == 2 && shape[0] == columns => &*format!("hand over {name}.T"),
            _ => {
                "one row for each time: the axes of a batch or of several drones are taken one by one"
            }
        };
        return Err(refused(py, name, format!("shape {shape:?}"), wanted, hint));
    }
    let bytes = array.call_method0("tobytes")?;
    Ok(bytemuck::pod_collect_to_vec(bytes.cast::<PyBytes>()?.as_bytes()))
}
