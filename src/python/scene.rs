//! Scenes, which contain everything that a photo depends on.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyTuple};

use super::{Reduced, array, raised, reduced, refused, run, save, to_python};
use noctograph::scene::Scene;
use noctograph::shoot::Stop;
use noctograph::sim::gain_design::{MOTOR_LAG_S, design};
use noctograph::vehicle::Mixer;

/// Everything that a photo depends on: word, letters, plan, drone, controller, lights, camera,
/// seed.
///
/// Parameters
/// ----------
/// scene : str or Scene
///     A scene to change, or its name: a preset (``cf21``, ``cf21-thrust-kit``, ``cf-brushless``, ``ae483-2022``,
///     ...), a shipped scene or a file ``*.toml`` or ``*.png`` of a photo.
/// word : str, optional
///     Word to write. The scene's by default.
/// seed : int, optional
///     Seed of all noise. The scene's by default.
/// set : dict, optional
///     Further keys of the scene, dotted or nested: ``{"vehicle.mass_kg": 0.038}`` is
///     ``{"vehicle": {"mass_kg": 0.038}}``. ``noctograph scene`` prints every key with its meaning.
#[pyclass(frozen, name = "Scene", module = "noctograph")]
#[derive(Debug)]
pub(super) struct PyScene(pub(super) Scene);

#[pymethods]
impl PyScene {
    /// Creates a scene from another scene, or from the name of a scene or file, by default `cf21`.
    /// The keys of `set` and the seed replace its settings. The word is set last, because its
    /// letters depend on the font.
    #[new]
    #[pyo3(signature = (scene = None, *, word = None, seed = None, set = None))]
    fn new(
        py: Python<'_>,
        scene: Option<&Bound<'_, PyAny>>,
        word: Option<&str>,
        seed: Option<&Bound<'_, PyAny>>,
        set: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut settings = Vec::new();
        if let Some(set) = set {
            flatten(set, "", &mut settings)?;
        }
        if let Some(seed) = seed {
            settings.push(("seed".to_owned(), setting(seed)?));
        }
        let borrowed: Vec<(&str, &str)> =
            settings.iter().map(|(key, value)| (&**key, &**value)).collect();
        let loaded = match scene.and_then(|scene| scene.cast::<Self>().ok()) {
            Some(scene) => Scene::parse_with(&scene.get().0.to_toml(), "scene", &borrowed),
            None => {
                let name = scene.map_or(Ok("cf21".to_owned()), |name| name.str()?.extract())?;
                Scene::find(&name, &borrowed).map(|named| named.scene)
            }
        };
        let mut loaded = loaded.map_err(|error| raised(py, &error))?;
        if let Some(word) = word {
            loaded.set_word(word);
        }
        Ok(Self(loaded))
    }

    /// str: The word, or an empty text for a drawing.
    #[getter]
    fn word(&self) -> &str {
        &self.0.word
    }

    /// int: Seed of the noise.
    #[getter]
    fn seed(&self) -> u64 {
        self.0.seed
    }

    /// float: Mass of the drone in kg.
    #[getter]
    fn mass_kg(&self) -> f64 {
        self.0.vehicle.mass_kg
    }

    /// numpy.ndarray: Motor commands m1 to m4 for torques about x, y and z (N m) and thrust (N),
    /// shape (4, 4).
    #[getter]
    fn motors_from_wrench<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, Mixer::new(&self.0.vehicle).motors_from_wrench().transpose().as_slice(), 4)
    }

    /// Returns the gain matrix K of the scene's linear-quadratic regulator, ``u = u_hover - K (x -
    /// x_ref)``, from the weights ``controller.lqr.q`` and ``.r``. The rows of K are torques about
    /// x, y and z (N m) and thrust (N). The columns are the twelve states of a controller, then
    /// integrals and rotors. None if the scene's controller has another law.
    fn gain<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let sim = self.0.sim();
        let design = run(py, &Stop::default(), move || design(&sim, MOTOR_LAG_S))?;
        design.k.map(|k| array(py, k.transpose().as_slice(), k.ncols())).transpose()
    }

    /// Returns the value of a key, dotted as in ``set``: a number, a string, a list or a dict.
    ///
    /// Parameters
    /// ----------
    /// key : str
    ///     For example ``"vehicle.mass_kg"``. A table's name returns a dict of its keys.
    fn get<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyAny>> {
        let scene = serde_json::to_value(&self.0).expect("a scene is a table");
        // Each part of the key selects a table's member or a list's item.
        let value = key.split('.').try_fold(&scene, |value, part| {
            value.get(part).or_else(|| value.get(part.parse::<usize>().ok()?))
        });
        let hint = "`noctograph scene` prints every key; None is a key that is not set";
        match value {
            Some(value) => to_python(py, value),
            None => Err(refused(py, key, "no such key", "a key of the scene", hint)),
        }
    }

    /// Returns the scene as TOML, with the meaning of each key.
    fn to_toml(&self) -> String {
        self.0.to_toml()
    }

    /// Reads a scene from the text that ``to_toml`` returns.
    #[staticmethod]
    fn from_toml(py: Python<'_>, toml: &str) -> PyResult<Self> {
        Scene::parse(toml, "scene").map(Self).map_err(|error| raised(py, &error))
    }

    /// Writes ``to_toml`` to a file, which appears when it is complete. ``Scene(FILE)`` reads it.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let scene = self.0.beside(&path).map_err(|error| raised(py, &error))?;
        // Files that the scene refers to are copied beside it first, so that the scene never refers
        // to a missing file.
        for (name, bytes) in &scene.copies {
            save(py, &path.with_file_name(name), bytes)?;
        }
        save(py, &path, scene.toml.as_bytes())
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Reduced<(String,)>> {
        reduced(slf.as_any(), "from_toml", slf.get().to_toml())
    }

    /// Returns the keys that differ from the default scene with their values, in angle brackets.
    fn __repr__(&self) -> String {
        let changes = self.0.changes();
        let changes = changes.iter().map(|[key, value, _]| format!("{key} = {value}"));
        format!("<Scene: {}>", changes.collect::<Vec<_>>().join(", "))
    }
}

/// Appends the dotted keys of a dict to `settings`, with their values in the command line's syntax.
/// `path` is the dotted key of the dict with a dot at its end, or an empty text.
fn flatten(
    table: &Bound<'_, PyDict>,
    path: &str,
    settings: &mut Vec<(String, String)>,
) -> PyResult<()> {
    for (key, value) in table.iter() {
        let key = format!("{path}{}", key.extract::<String>()?);
        if let Ok(table) = value.cast::<PyDict>() {
            flatten(table, &format!("{key}."), settings)?;
        } else {
            settings.push((key, setting(&value)?));
        }
    }
    Ok(())
}

/// Converts a value to the command line's syntax, TOML except for texts, which are unchanged.
#[pyfunction]
pub(super) fn setting(value: &Bound<'_, PyAny>) -> PyResult<String> {
    value.extract::<String>().or_else(|_not_text| toml(value))
}

/// Converts a Python value or numpy array to the text of a TOML value. Raises `InputError` for
/// other types, such as None.
fn toml(value: &Bound<'_, PyAny>) -> PyResult<String> {
    // Booleans are tested before integers, because a Python bool is also an int.
    if let Ok(flag) = value.cast::<PyBool>() {
        return Ok(flag.is_true().to_string());
    }
    if let Ok(table) = value.cast::<PyDict>() {
        let pairs = table.iter().map(|(key, value)| {
            Ok(format!("{} = {}", serde_json::json!(key.extract::<String>()?), toml(&value)?))
        });
        let pairs = pairs.collect::<PyResult<Vec<_>>>()?;
        return Ok(format!("{{ {} }}", pairs.join(", ")));
    }
    if let Ok(text) = value.extract::<String>() {
        return Ok(serde_json::json!(text).to_string());
    }
    // numpy arrays and scalars become Python lists and numbers.
    if value.hasattr("tolist")? {
        return toml(&value.call_method0("tolist")?);
    }
    if value.cast::<PyInt>().is_ok() {
        return value.str()?.extract();
    }
    if let Ok(number) = value.cast::<PyFloat>() {
        // TOML writes inf and -inf like Rust, but nan in lower case.
        return Ok(format!("{:?}", number.value()).to_lowercase());
    }
    if value.cast::<PyList>().is_ok() || value.cast::<PyTuple>().is_ok() {
        let items = value.try_iter()?.map(|item| toml(&item?)).collect::<PyResult<Vec<_>>>()?;
        return Ok(format!("[{}]", items.join(", ")));
    }
    let (actual, wanted) = (value.get_type().name()?.to_string(), "a number, text, list or dict");
    Err(refused(value.py(), "set", actual, wanted, "convert the value to one of these types"))
}
