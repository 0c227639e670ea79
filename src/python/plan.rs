//! Plans, which contain the setpoints and light commands for a drone.

use std::collections::BTreeMap;
use std::path::PathBuf;

use nalgebra::Vector3;
use pyo3::prelude::*;

use super::columns::Columns;
use super::scene::PyScene;
use super::{
    Reduced, array, arrays, data_frame, numbers, raised, reduced, refused, run, save_with, text_of,
};
use noctograph::flight::table::on_grid;
use noctograph::plan::{Plan, PlanData, Setpoint};
use noctograph::report::plan_view;
use noctograph::shoot::{Shoot, Stop};

/// The plan of one drone: setpoints and light commands in the order of time.
///
/// Parameters
/// ----------
/// time_s : numpy.ndarray
///     Rising times from 0 on in s, shape (N,). Between them the design follows velocity and acceleration.
/// position_m : numpy.ndarray
///     Position of the design in m, x right, y into the scene, z up, shape (N, 3). A z of 0 or less switches the motors off.
/// light : numpy.ndarray or dict of str to numpy.ndarray, optional
///     Level of the headlights from each setpoint on, 0 to 1, shape (N,), or a dict of levels by channel. 0 by
///     default.
/// velocity_m_s, acceleration_m_s2 : numpy.ndarray, optional
///     In the axes of the position, shape (N, 3). 0 by default.
/// sent_m : numpy.ndarray, optional
///     Positions to send in place of those of the design, in m, shape (N, 3).
/// yaw_rad : float
///     Heading during the whole flight.
#[pyclass(frozen, name = "Plan", module = "noctograph")]
#[derive(Debug)]
pub(super) struct PyPlan(pub(super) Plan);

impl PyPlan {
    /// Returns the position in m, velocity in m/s, acceleration in m/s² and jerk in m/s³ at
    /// `time_s`, which follows the setpoint `row`. The jerk is that of a trajectory on board, or
    /// the slope of the acceleration up to the next setpoint.
    fn design(&self, time_s: f64, row: usize) -> [Vector3<f64>; 4] {
        let (from, next) = (&self.0.setpoints[row], self.0.setpoints.get(row + 1));
        let Some(next) = next.filter(|_| time_s >= from.time_s) else {
            // Before the start and after the end of the plan, the design is at rest. At the time of
            // the last setpoint, it has that setpoint's motion.
            let motion = if time_s == from.time_s { 1.0 } else { 0.0 };
            let [v, a] = [from.velocity_m_s * motion, from.acceleration_m_s2 * motion];
            return [from.position_m, v, a, self.0.jerk_m_s3(row) * motion];
        };
        let step_s = next.time_s - from.time_s;
        let jerk_m_s3 = if self.0.jerk_m_s3.is_empty() {
            (next.acceleration_m_s2 - from.acceleration_m_s2) / step_s
        } else {
            self.0.jerk_m_s3(row)
        };
        let velocity_m_s = from.velocity_m_s + from.acceleration_m_s2 * (time_s - from.time_s);
        [from.design_m(time_s), velocity_m_s, from.acceleration_m_s2, jerk_m_s3]
    }

    /// Returns an array of shape (setpoints, `N`), whose rows are the results of `row` for each
    /// setpoint's index.
    fn array<'py, const N: usize>(
        &self,
        py: Python<'py>,
        row: impl Fn(usize) -> [f64; N],
    ) -> PyResult<Bound<'py, PyAny>> {
        array(py, &(0..self.0.setpoints.len()).flat_map(row).collect::<Vec<_>>(), N)
    }
}

#[pymethods]
impl PyPlan {
    /// Creates a plan from columns, as the class documents. Its numbers have as many digits as in a
    /// file.
    #[new]
    #[pyo3(signature = (time_s, position_m, *, light = None, velocity_m_s = None, acceleration_m_s2 = None, sent_m = None, yaw_rad = 0.0))]
    #[expect(clippy::too_many_arguments, reason = "Python names them")]
    fn new<'py>(
        py: Python<'py>,
        time_s: &Bound<'py, PyAny>,
        position_m: &Bound<'py, PyAny>,
        light: Option<&Bound<'py, PyAny>>,
        velocity_m_s: Option<&Bound<'py, PyAny>>,
        acceleration_m_s2: Option<&Bound<'py, PyAny>>,
        sent_m: Option<&Bound<'py, PyAny>>,
        yaw_rad: f64,
    ) -> PyResult<Self> {
        let columns = Columns::new(time_s)?;
        let positions_m = columns.points("position_m", Some(position_m))?;
        let velocities_m_s = columns.points("velocity_m_s", velocity_m_s)?;
        let accelerations_m_s2 = columns.points("acceleration_m_s2", acceleration_m_s2)?;
        let sent_m = sent_m.map(|sent_m| columns.points("sent_m", Some(sent_m))).transpose()?;
        let sent_m = sent_m.unwrap_or_default();
        let lights = columns.lights(light, 0.0)?;
        // A setpoint with light must belong to a letter.
        let setpoints = (0..columns.times_s.len()).map(|row| Setpoint {
            time_s: columns.times_s[row],
            position_m: positions_m[row],
            velocity_m_s: velocities_m_s[row],
            acceleration_m_s2: accelerations_m_s2[row],
            letter: lights.values().any(|levels| levels[row] > 0.0).then_some(0),
        });
        let setpoints = setpoints.collect();
        let plan =
            Plan::new(PlanData { setpoints, lights, sent_m, yaw_rad, ..PlanData::default() });
        // The plan is converted to text and back, so that it equals a plan from a file to the last
        // digit.
        Self::from_csv(py, &Self(plan.map_err(|error| raised(py, &error))?).to_csv())
    }

    /// Reads a plan from a file written by ``save`` or ``noctograph plan``.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Plan::read_csv(&path).map(Self).map_err(|error| raised(py, &error))
    }

    /// Reads a plan from the text that ``to_csv`` returns.
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
        self.array(py, |row| [self.0.setpoints[row].time_s])
    }

    /// numpy.ndarray: Position of each setpoint in m (x right, y into the scene, z up), shape (N, 3).
    #[getter]
    fn position_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, |row| self.0.setpoints[row].position_m.data.0[0])
    }

    /// numpy.ndarray: Velocity of each setpoint in m/s, in the axes of the position, shape (N, 3).
    #[getter]
    fn velocity_m_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, |row| self.0.setpoints[row].velocity_m_s.data.0[0])
    }

    /// numpy.ndarray: Acceleration of each setpoint in m/s², axes as for the position, shape (N, 3).
    #[getter]
    fn acceleration_m_s2<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, |row| self.0.setpoints[row].acceleration_m_s2.data.0[0])
    }

    /// numpy.ndarray: Position that is sent with each setpoint in m, shape (N, 3): the design's, or
    /// one ahead of it.
    #[getter]
    fn sent_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, |row| self.0.sent_m(row).data.0[0])
    }

    /// dict of str to numpy.ndarray: Light commands of each setpoint by channel, 0 to 1, shape (N,).
    #[getter]
    fn lights<'py>(&self, py: Python<'py>) -> PyResult<BTreeMap<String, Bound<'py, PyAny>>> {
        arrays(py, &self.0.lights)
    }

    /// numpy.ndarray: Level of the brightest lamp from each setpoint on, 0 to 1, shape (N,).
    #[getter]
    fn light<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.lit(), 1)
    }

    /// Returns the design at the given times, as `fly` passes it to a controller as the reference.
    ///
    /// Parameters
    /// ----------
    /// time_s : float or numpy.ndarray
    ///     Times since the first setpoint in s, shape (N,) or one number. Before the plan the design rests at its
    ///     first position, after it at its last.
    ///
    /// Returns
    /// -------
    /// noctograph.design.Design
    ///     ``position_m``, ``velocity_m_s``, ``acceleration_m_s2`` and ``jerk_m_s3``, shape (N, 3), in the axes of the
    ///     position, ``yaw_rad`` and ``light``, shape (N,), and ``lights`` by channel, as `Flight` takes them. For one
    ///     number the shapes are (3,) and ().
    #[pyo3(name = "at")]
    fn design_at<'py>(
        &self,
        py: Python<'py>,
        time_s: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        // A single time yields arrays without the time axis.
        let numpy = py.import("numpy")?;
        let is_one = numpy.call_method1("ndim", (time_s,))?.extract::<usize>()? == 0;
        let times = numpy.call_method1("atleast_1d", (time_s,))?;
        // Times are rounded like those of setpoints, so that a rounding error does not select the
        // previous setpoint.
        let times_s = numbers(&times, "time_s", 1)?;
        let times_s: Vec<f64> = times_s.into_iter().map(on_grid).collect();
        if let Some(row) = times_s.iter().position(|time_s| !time_s.is_finite()) {
            let actual = format!("{} in row {row}", times_s[row]);
            return Err(refused(py, "time_s", actual, "finite times", "times in seconds"));
        }
        if self.0.setpoints.is_empty() {
            return Err(refused(py, "plan", "no setpoint", "one or more", "plan a word"));
        }
        let rows: Vec<usize> = times_s.iter().map(|time_s| self.0.row_at(*time_s)).collect();
        // Each quantity of the design is an array with one row per time.
        let mut arguments = Vec::new();
        let times = times_s.iter().zip(&rows);
        let designs: Vec<_> = times.map(|(time_s, row)| self.design(*time_s, *row)).collect();
        for order in 0..4 {
            let numbers = designs.iter().flat_map(|design| design[order].data.0[0]);
            arguments.push(array(py, &numbers.collect::<Vec<_>>(), 3)?);
        }
        let yaws = vec![self.0.yaw_rad; self.0.setpoints.len()];
        for levels in [&yaws, &self.0.lit()] {
            arguments.push(rows_of(py, levels, &rows)?);
        }
        let lights = self.0.lights.iter();
        let lights = lights.map(|(name, levels)| Ok((name, rows_of(py, levels, &rows)?)));
        let lights = lights.collect::<PyResult<BTreeMap<_, _>>>()?;
        py.import("noctograph.design")?.call_method1("_design", (is_one, arguments, lights))
    }

    /// Returns the plan as CSV, with a row for each setpoint.
    fn to_csv(&self) -> String {
        text_of(|csv| self.0.write_csv(csv))
    }

    /// Writes ``to_csv`` to a file, which appears when it is complete. Like the command line, also
    /// writes the scene, if one is given, as ``NAME.scene.toml`` with the file's digest.
    #[pyo3(signature = (path, scene=None))]
    fn save(&self, py: Python<'_>, path: PathBuf, scene: Option<&PyScene>) -> PyResult<()> {
        save_with(py, &path, self.to_csv().as_bytes(), scene)
    }

    /// Returns the columns of ``to_csv`` as a pandas.DataFrame. Needs pandas.
    fn to_pandas<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        data_frame(py, self.to_csv())
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Reduced<(String,)>> {
        reduced(slf.as_any(), "from_csv", slf.get().to_csv())
    }

    /// Draws lit strokes colored by speed and dark paths dashed, for notebooks. None if empty.
    fn _repr_svg_(&self) -> Option<String> {
        let plans = [self.0.clone()];
        (!plans[0].setpoints.is_empty()).then(|| plan_view(&plans, "", &[]))
    }

    fn __repr__(&self) -> String {
        let (n, duration_s) = (self.0.setpoints.len(), self.0.duration_s());
        format!("<Plan: {n} setpoints, {duration_s:.1} s, {:.1} s of light>", self.0.full_light_s())
    }
}

/// Returns the values of a column in the given rows, as an array.
fn rows_of<'py>(py: Python<'py>, values: &[f64], rows: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    array(py, &rows.iter().map(|row| values[*row]).collect::<Vec<_>>(), 1)
}

/// Plans the word or drawing of a scene.
///
/// Parameters
/// ----------
/// scene : Scene
///     Scene with the word or drawing, the letters, the drone and the controller.
///
/// Returns
/// -------
/// list of Plan
///     One for each drone (``plan.drones``).
#[pyfunction]
pub(super) fn plan(py: Python<'_>, scene: &PyScene) -> PyResult<Vec<PyPlan>> {
    let scene = scene.0.clone();
    let shoot = run(py, &Stop::default(), move || Shoot::new(scene))?;
    Ok(shoot.plans.into_iter().map(|planned| PyPlan(planned.plan)).collect())
}
