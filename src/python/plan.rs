//! Plans: what is sent to a drone.

use std::path::PathBuf;

use pyo3::prelude::*;

use super::scene::PyScene;
use super::{Reduced, array, data_frame, raised, reduced, run, save};
use noctograph::error::Error;
use noctograph::plan::Plan;
use noctograph::report::plan_view;
use noctograph::shoot::{Shoot, Stop};

/// The plan of one drone: setpoints and light commands in the order of time.
#[pyclass(frozen, name = "Plan", module = "noctograph")]
#[derive(Debug)]
pub(super) struct PyPlan(pub(super) Plan);

#[pymethods]
impl PyPlan {
    /// Reads the plan that ``save`` or ``noctograph plan`` wrote to a file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Plan::read_csv(&path).map(Self).map_err(|error| raised(py, &error))
    }

    /// Reads a plan from the text that ``to_csv`` makes.
    #[staticmethod]
    fn from_csv(py: Python<'_>, csv: &str) -> PyResult<Self> {
        Plan::parse_csv(csv.as_bytes(), "plan").map(Self).map_err(|error| raised(py, &error))
    }

    /// float: Duration in seconds.
    #[getter]
    fn duration_s(&self) -> f64 {
        self.0.duration_s()
    }

    /// numpy.ndarray: Time of each setpoint in s, shape (N,), float64.
    #[getter]
    fn time_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let values: Vec<f64> = self.0.setpoints.iter().map(|setpoint| setpoint.time_s).collect();
        array(py, &values, 1)
    }

    /// numpy.ndarray: Position of each setpoint in m, x right, y into the scene, z up; shape (N,
    /// 3).
    #[getter]
    fn position_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let points = self.0.setpoints.iter().flat_map(|setpoint| setpoint.position_m.data.0[0]);
        array(py, &points.collect::<Vec<_>>(), 3)
    }

    /// numpy.ndarray: Velocity of each setpoint in m/s, in the axes of the position; shape (N, 3).
    #[getter]
    fn velocity_m_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let points = self.0.setpoints.iter().flat_map(|setpoint| setpoint.velocity_m_s.data.0[0]);
        array(py, &points.collect::<Vec<_>>(), 3)
    }

    /// numpy.ndarray: Whether a lamp is to be lit from each setpoint on, 0 to 1; shape (N,).
    #[getter]
    fn light<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.lit(), 1)
    }

    /// The plan as CSV, one row a setpoint.
    fn to_csv(&self) -> String {
        let mut csv = Vec::new();
        self.0.write_csv(&mut csv).expect("memory can be written");
        String::from_utf8_lossy(&csv).into_owned()
    }

    /// Writes ``to_csv`` to a file, which appears when it is whole.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        save(py, &path, self.to_csv().as_bytes())
    }

    /// pandas.DataFrame: The columns of ``to_csv``; needs pandas.
    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        data_frame(py, self.to_csv())
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Reduced<(String,)>> {
        reduced(slf.as_any(), "from_csv", slf.get().to_csv())
    }

    /// Drawing for notebooks: lit strokes colored by speed, dark ways dashed.
    fn _repr_svg_(&self) -> Option<String> {
        let plans = [self.0.clone()];
        (!plans[0].setpoints.is_empty()).then(|| plan_view(&plans, ""))
    }

    fn __repr__(&self) -> String {
        let (n, duration_s) = (self.0.setpoints.len(), self.0.duration_s());
        format!("<Plan: {n} setpoints, {duration_s:.1} s, {:.1} s of light>", self.0.full_light_s())
    }
}

/// Plans the word or drawing of a scene.
///
/// Parameters
/// ----------
/// scene : Scene
///     Its word or drawing, letters, drone and controller.
///
/// Returns
/// -------
/// list of Plan
///     One for each drone (``plan.drones``).
#[pyfunction]
pub(super) fn plan(py: Python<'_>, scene: &PyScene) -> PyResult<Vec<PyPlan>> {
    let scene = scene.0.clone();
    let stage = move || Ok::<_, Error>(Shoot::new(scene)?.plans);
    let plans = run(py, &Stop::default(), stage)?;
    Ok(plans.into_iter().map(|planned| PyPlan(planned.plan)).collect())
}
