//! The Python package `noctograph` (crate `noctograph-python`), in which stages are functions, and
//! products are objects with numpy arrays. `examples/python` builds and documents it.
//!
//! While a stage runs, the interpreter lock is released, and Ctrl-C is polled.
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
use std::sync::OnceLock;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyTuple};

use noctograph::error::{Error, Result, Segment};
use noctograph::scene::CarriedScene;
use noctograph::shoot::Stop;
use noctograph_core::files::Output;

use self::scene::PyScene;

/// Time between two checks for Ctrl-C.
const CHECK_EVERY: Duration = Duration::from_millis(50);

/// Result of `__reduce__` for pickle, which is a function and its arguments.
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

/// Converts an error to a Python exception. Its class is `InputError` for input, `InfeasibleError`
/// for what cannot be flown, and `OSError` for files.
fn raised(py: Python<'_>, error: &Error) -> PyErr {
    let (class, arguments) = match error {
        Error::Input { place, found, wanted, hint, .. } => {
            // Without a file, the place of an error in the scene is only the key.
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
    // If the exception cannot be created, the reason is raised in its place.
    let exception = py.import("noctograph.errors").and_then(|errors| {
        let arguments = PyTuple::new(py, arguments)?;
        errors.getattr(class)?.call1(arguments)
    });
    exception.map_or_else(|reason| reason, PyErr::from_value)
}

/// Returns `InputError` for an input that cannot be used: its place, what was found there, what is
/// wanted in its stead, and a hint.
fn refused(
    py: Python<'_>,
    place: &str,
    found: impl std::fmt::Display,
    wanted: impl Into<String>,
    hint: &str,
) -> PyErr {
    raised(py, &Error::input(place, found, wanted, hint))
}

/// Issues each text as a warning at the line of the user's call (see `noctograph/errors.py`).
fn warn(py: Python<'_>, texts: impl IntoIterator<Item = String>) -> PyResult<()> {
    let warn = py.import("noctograph.errors")?.getattr("warn")?;
    texts.into_iter().try_for_each(|text| warn.call1((text,)).map(drop))
}

/// Runs a command of the program. Returns its table, and its `--json` output as Python objects.
#[pyfunction]
fn command(py: Python<'_>, words: Vec<String>) -> PyResult<(String, Bound<'_, PyAny>)> {
    let report = run(py, &Stop::default(), move || noctograph::cli::report_of(&words))?;
    Ok((report.text, to_python(py, &report.json)?))
}

/// Runs the command line `words` and returns its exit code. `program` is the command that starts
/// the program in another process.
#[pyfunction]
fn main(py: Python<'_>, program: Vec<OsString>, words: Vec<OsString>) -> u8 {
    noctograph::cli::starts_as(program);
    noctograph::cli::typed_as(words);
    py.detach(noctograph::cli::main)
}

/// Returns as text the CSV that `write` writes to a buffer.
fn text_of(write: impl FnOnce(&mut Vec<u8>) -> std::io::Result<()>) -> String {
    let mut csv = Vec::new();
    write(&mut csv).expect("memory can be written");
    String::from_utf8(csv).expect("CSV is text")
}

/// Converts a CSV text to a pandas.DataFrame.
fn data_frame(py: Python<'_>, csv: String) -> PyResult<Bound<'_, PyAny>> {
    let text = py.import("io")?.call_method1("StringIO", (csv,))?;
    py.import("pandas")?.call_method1("read_csv", (text,))
}

/// Returns what pickle stores for an object: its static method with the name `read`, and the text
/// that this method reads.
fn reduced(object: &Bound<'_, PyAny>, read: &str, text: String) -> PyResult<Reduced<(String,)>> {
    Ok((object.get_type().getattr(read)?.unbind(), (text,)))
}

/// Writes a file, which appears only when it is complete.
fn save(py: Python<'_>, path: &Path, bytes: &[u8]) -> PyResult<()> {
    let written = Output::create(path).and_then(|file| file.keep(bytes));
    written.map(|_path| ()).map_err(|error| raised(py, &error))
}

/// Writes the file of a plan or flight to `path`, and a scene beside it if one is given. A file
/// appears when it is complete.
fn save_with(py: Python<'_>, path: &Path, bytes: &[u8], scene: Option<&PyScene>) -> PyResult<()> {
    let Some(PyScene(scene)) = scene else { return save(py, path, bytes) };
    // Both temporary files are created before either is renamed.
    let written = Output::create(path).and_then(|file| {
        let beside = Output::create(&CarriedScene::path_beside(path))?;
        CarriedScene::keep_with(file.write_with(|out| out.write_all(bytes))?, beside, scene)
    });
    written.map(|_paths| ()).map_err(|error| raised(py, &error))
}

/// Converts plain data to Python dicts, lists, texts and numbers.
fn to_python<'py>(py: Python<'py>, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    let json = serde_json::to_string(value).expect("plain data");
    py.import("json")?.call_method1("loads", (json,))
}

/// Raises `RuntimeError` in a process that was forked from one that had started threads here. A
/// fork copies no threads, so a stage would wait forever for those of the parent.
fn check_not_forked() -> PyResult<()> {
    static STARTED_IN: OnceLock<u32> = OnceLock::new();
    if *STARTED_IN.get_or_init(std::process::id) == std::process::id() {
        return Ok(());
    }
    let text = "this process was forked from one that had used noctograph, and its threads do not \
                exist here: start workers by spawn, such as multiprocessing.get_context(\"spawn\")";
    Err(pyo3::exceptions::PyRuntimeError::new_err(text))
}

/// Runs a stage with the interpreter lock released, and returns its result. Ctrl-C sets `stop`,
/// which the stage checks, and raises `KeyboardInterrupt` at once.
fn run<T: Send + 'static>(
    py: Python<'_>,
    stop: &Stop,
    stage: impl FnOnce() -> Result<T> + Send + 'static,
) -> PyResult<T> {
    run_showing(py, stop, |_| Ok(()), Ends::ByItself, stage)
}

/// How a stage ends after it was stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ends {
    /// The stage calls no Python code, and ends by itself when it notices the stop.
    ByItself,
    /// The stage calls Python code, which is forbidden while the interpreter exits, so the caller
    /// waits for the stage to end.
    Joined,
}

/// Runs a stage like [`run`], and calls `show` every 50 ms and at the end. An exception of `show`
/// stops the stage. `ends` says whether this function then waits for the stage's thread.
fn run_showing<T: Send + 'static>(
    py: Python<'_>,
    stop: &Stop,
    mut show: impl FnMut(Python<'_>) -> PyResult<()> + Send,
    ends: Ends,
    stage: impl FnOnce() -> Result<T> + Send + 'static,
) -> PyResult<T> {
    check_not_forked()?;
    let result = py.detach(|| {
        let (sender, receiver) = channel();
        let worker = std::thread::spawn(move || {
            // After Ctrl-C, there is no receiver, and the result is dropped.
            let _ = sender.send(stage());
        });
        loop {
            match receiver.recv_timeout(CHECK_EVERY) {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    let text = "the program failed: please report what it printed";
                    return Err(pyo3::exceptions::PyRuntimeError::new_err(text));
                }
            }
            // The interpreter lock is held only for this check and for `show`.
            if let Err(error) = Python::attach(|py| py.check_signals().and_then(|()| show(py))) {
                stop.now();
                while ends == Ends::Joined && !worker.is_finished() {
                    std::thread::sleep(Duration::from_millis(1));
                }
                return Err(error);
            }
        }
    });
    let product = result?.map_err(|error| raised(py, &error))?;
    show(py)?;
    Ok(product)
}

/// Copies bytes into a writable numpy array of the given type (`f8`, `?` and so on) and shape.
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

/// Converts rows of numbers to an array of shape `(rows, columns)`, or `(rows,)` for one column.
fn array<'py>(py: Python<'py>, values: &[f64], columns: usize) -> PyResult<Bound<'py, PyAny>> {
    let rows = values.len() / columns;
    let shape: &[usize] = if columns == 1 { &[rows] } else { &[rows, columns] };
    array_of(py, bytemuck::cast_slice(values), "f8", shape)
}

/// Converts named columns to arrays of shape `(rows,)`.
fn arrays<'py>(
    py: Python<'py>,
    columns: &BTreeMap<String, Vec<f64>>,
) -> PyResult<BTreeMap<String, Bound<'py, PyAny>>> {
    columns.iter().map(|(name, values)| Ok((name.clone(), array(py, values, 1)?))).collect()
}

/// Returns the numbers of an array of shape `(rows, columns)`, or `(rows,)` for one column, row by
/// row. Raises `InputError` under the argument's `name` for other shapes, complex numbers and
/// texts.
fn numbers(array: &Bound<'_, PyAny>, name: &str, columns: usize) -> PyResult<Vec<f64>> {
    let py = array.py();
    let array = py.import("numpy")?.call_method1("asarray", (array,))?;
    // numpy's codes of types include `f` for floats, `c` for complex numbers and `U` for texts.
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if !"biufO".contains(&*kind) {
        let actual = if kind == "c" { "complex numbers" } else { "no numbers" };
        return Err(refused(py, name, actual, "numbers", "check the values that are passed"));
    }
    let array = py.import("numpy")?.call_method1("ascontiguousarray", (array, "f8"))?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let fits =
        if columns == 1 { shape.len() == 1 } else { shape.len() == 2 && shape[1] == columns };
    if !fits {
        let wanted = if columns == 1 { "(N,)".to_owned() } else { format!("(N, {columns})") };
        // The hint covers quaternions, column vectors, and transposed arrays.
        let hint = match name {
            "attitude_rad" if shape.last() == Some(&4) => {
                "pass yaw, pitch and roll, which nc.attitude_rad computes from quaternions"
            }
            _ if columns == 1 && shape.iter().filter(|n| **n != 1).count() == 1 => {
                &*format!("pass {name}.ravel()")
            }
            _ if shape.len() == 2 && shape[0] == columns => &*format!("hand over {name}.T"),
            _ => {
                "pass one row per time, and the flights of a batch or of several drones one by one"
            }
        };
        return Err(refused(py, name, format!("shape {shape:?}"), wanted, hint));
    }
    let bytes = array.call_method0("tobytes")?;
    Ok(bytemuck::pod_collect_to_vec(bytes.cast::<PyBytes>()?.as_bytes()))
}
