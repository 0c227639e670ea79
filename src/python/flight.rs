//! Flights, which are simulated, imported from logs, or created from arrays.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use pyo3::prelude::*;

use super::columns::Columns;
use super::estimator::PyEstimator;
use super::plan::PyPlan;
use super::scene::PyScene;
use super::{
    Ends, Reduced, array, arrays, data_frame, numbers, raised, reduced, refused, run, run_showing,
    save_with, text_of, warn,
};
use noctograph::diagnostic::Diagnostic;
use noctograph::error::{Error, Result};
use noctograph::flight::table::{MAX_DURATION_S, on_grid};
use noctograph::flight::{Flight, FlightData, FlightSample, Quantity};
use noctograph::geometry::Attitude;
use noctograph::logs::{ImportOptions, doubts, import};
use noctograph::plan::{LightClock, Plan, ReferenceKind};
use noctograph::report::{NamedFlight, front_view};
use noctograph::scene::Scene;
use noctograph::shoot::{Shoot, Stop, infer_lights_if_dark};
use noctograph::sim::Session;

/// The flight of one drone, sampled over time.
///
/// Parameters
/// ----------
/// time_s : numpy.ndarray
///     Rising times in s, shape (N,).
/// position_m : numpy.ndarray
///     Position of the body in m, x right, y into the scene, z up, shape (N, 3).
/// light : numpy.ndarray or dict of str to numpy.ndarray, optional
///     Level of the headlights, 0 to 1, shape (N,). 1 by default. For other lamps a dict by channel, those of
///     ``plan.lights``: ``{"headlights": on, "color-led": on}``, and of the ring ``"ring.red"``, ``"ring.green"`` and
///     ``"ring.blue"``. Colors and lamps are the scene's (``light.color_led_wrgb``, ``light.deck``). A lamp of a
///     Crazyflie changes on the firmware's tick, up to 50 ms later. ``set={"light.tick_s": 0}`` in the scene removes
///     this delay.
/// attitude_rad : numpy.ndarray, optional
///     Yaw, pitch and roll in rad, in this order, shape (N, 3). 0 by default. Yaw is about the world's z, then pitch
///     about y, then roll about x: the angles that ROS and PyBullet call roll, pitch, yaw and give in the opposite
///     order (``rpy[:, ::-1]``). `attitude_rad` computes them from quaternions.
/// design_m : numpy.ndarray, optional
///     Planned position in m, shape (N, 3). Without a design there is no tracking error. If the scene contains no
///     word, the camera frames the lit part of the design, or else the flown path.
///
/// Notes
/// -----
/// The times may begin at any value, because the exposure of a photograph begins with the flight.
/// The arrays of a flight are copies. A quantity that the flight lacks is NaN. ``warnings`` and
/// `NoctographWarning` report numbers that look as if they had other units or axes.
#[pyclass(frozen, name = "Flight", module = "noctograph")]
#[derive(Debug)]
pub(super) struct PyFlight {
    pub(super) flight: Flight,
}

impl PyFlight {
    pub(super) fn new(flight: Flight) -> Self {
        Self { flight }
    }

    /// Returns a quantity, in SI units, with a row for each sample. All numbers are NaN if the
    /// flight lacks the quantity.
    fn array<'py>(&self, py: Python<'py>, quantity: Quantity) -> PyResult<Bound<'py, PyAny>> {
        let (samples, columns) = (&self.flight.samples, quantity.places());
        let values: Vec<f64> = if self.flight.has(quantity) {
            samples.iter().flat_map(|s| s.numbers()[columns.clone()].to_vec()).collect()
        } else {
            vec![f64::NAN; columns.len() * samples.len()]
        };
        array(py, &values, columns.len())
    }
}

#[pymethods]
impl PyFlight {
    /// Creates a flight from columns, as the class documents. Raises `InputError` for fewer than
    /// two times, and for times that are not in seconds. Issues warnings about numbers that look as
    /// if they had other units or axes.
    #[new]
    #[pyo3(signature = (time_s, position_m, *, light = None, attitude_rad = None, design_m = None))]
    fn from_arrays<'py>(
        py: Python<'py>,
        time_s: &Bound<'py, PyAny>,
        position_m: &Bound<'py, PyAny>,
        light: Option<&Bound<'py, PyAny>>,
        attitude_rad: Option<&Bound<'py, PyAny>>,
        design_m: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let columns = Columns::new(time_s)?;
        let times_s = &columns.times_s;
        check_times(py, times_s)?;
        let positions_m = columns.points("position_m", Some(position_m))?;
        let angles_rad = columns.points("attitude_rad", attitude_rad)?;
        let designs_m = columns.points("design_m", design_m)?;
        let lights = columns.lights(light, 1.0)?;
        let samples = (0..times_s.len()).map(|row| {
            let [yaw_rad, pitch_rad, roll_rad] = angles_rad[row].into();
            FlightSample {
                // Times are rounded as in a file, so that the clock's start has no effect.
                time_s: on_grid(times_s[row]),
                position_m: positions_m[row],
                attitude: Attitude { yaw_rad, pitch_rad, roll_rad },
                design_m: designs_m[row],
                // A sample with light must belong to a letter, but the number of the letter has no
                // effect.
                letter: lights.values().any(|levels| levels[row] > 0.0).then_some(0),
                ..FlightSample::default()
            }
        });
        let samples = samples.collect();
        // Quantities that the arrays lack become NaN without a warning.
        let mut unlogged: BTreeSet<Quantity> =
            [Quantity::Velocity, Quantity::Rate, Quantity::Estimate, Quantity::Motors].into();
        unlogged.extend(design_m.is_none().then_some(Quantity::Design));
        let flight = Flight::new(FlightData { samples, lights, unlogged, ..FlightData::default() });
        let mut flight = flight.map_err(|error| raised(py, &error))?;
        let doubts = doubts(&flight);
        flight.edit(|flight| flight.warnings.extend(doubts.iter().cloned()));
        warn(py, doubts.iter().map(ToString::to_string))?;
        Ok(Self::new(flight))
    }

    /// Reads a flight from a file written by ``save`` or ``noctograph fly``.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Flight::read_csv(&path).map(Self::new).map_err(|error| raised(py, &error))
    }

    /// Reads a flight from the text that ``to_csv`` returns.
    #[staticmethod]
    fn from_csv(py: Python<'_>, csv: &str) -> PyResult<Self> {
        let flight = Flight::parse_csv(csv.as_bytes(), "flight");
        flight.map(Self::new).map_err(|error| raised(py, &error))
    }

    /// list of str: Sentences about everything that was guessed or ignored in a log.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.flight.warnings.iter().map(ToString::to_string).collect()
    }

    /// Returns a copy of the flight that has a plan as its design.
    ///
    /// Parameters
    /// ----------
    /// plan : Plan
    ///     The plan that was flown.
    /// begins_s : float, optional
    ///     Time of the flight at which the plan begins, s. By default its first time.
    ///
    /// Returns
    /// -------
    /// Flight
    #[pyo3(signature = (plan, begins_s = None))]
    fn with_design(&self, py: Python<'_>, plan: &PyPlan, begins_s: Option<f64>) -> PyResult<Self> {
        let mut flight = self.flight.clone().into_data();
        let begins_s = begins_s.unwrap_or(flight.samples.first().map_or(0.0, |s| s.time_s));
        if !begins_s.is_finite() {
            return Err(refused(py, "begins_s", begins_s, "a time in s", "or leave it out"));
        }
        for sample in &mut flight.samples {
            sample.design_m = plan.0.design_m(on_grid(sample.time_s - begins_s)).map(on_grid);
        }
        flight.unlogged.remove(&Quantity::Design);
        Flight::new(flight).map(Self::new).map_err(|error| raised(py, &error))
    }

    /// numpy.ndarray: Time of each sample in s, shape (N,).
    #[getter]
    fn time_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.flight.samples.iter().map(|it| it.time_s).collect::<Vec<_>>(), 1)
    }

    /// numpy.ndarray: Position of the body in m, x right, y into the scene, z up, shape (N, 3).
    #[getter]
    fn position_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, Quantity::Position)
    }

    /// numpy.ndarray: Planned position in m, shape (N, 3).
    #[getter]
    fn design_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, Quantity::Design)
    }

    /// numpy.ndarray: Position according to the drone's estimator, in m, shape (N, 3).
    #[getter]
    fn estimate_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, Quantity::Estimate)
    }

    /// numpy.ndarray: Velocity in the body frame (x forward, y left, z up) in m/s, shape (N, 3).
    #[getter]
    fn velocity_body_m_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, Quantity::Velocity)
    }

    /// numpy.ndarray: Angular velocity in the body frame in rad/s, shape (N, 3).
    #[getter]
    fn rate_body_rad_s<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, Quantity::Rate)
    }

    /// numpy.ndarray: Yaw, pitch and roll in rad, shape (N, 3).
    #[getter]
    fn attitude_rad<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, Quantity::Attitude)
    }

    /// numpy.ndarray: Motor commands m1 to m4, 0 to 65535, shape (N, 4).
    #[getter]
    fn motors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, Quantity::Motors)
    }

    /// dict of str to numpy.ndarray: Light commands in force by channel, 0 to 1, shape (N,).
    #[getter]
    fn lights<'py>(&self, py: Python<'py>) -> PyResult<BTreeMap<String, Bound<'py, PyAny>>> {
        arrays(py, &self.flight.lights)
    }

    /// dict of str to numpy.ndarray: Further columns (``battery_v``, ``energy_j``, ...), shape (N,).
    #[getter]
    fn extra<'py>(&self, py: Python<'py>) -> PyResult<BTreeMap<String, Bound<'py, PyAny>>> {
        arrays(py, &self.flight.extra)
    }

    /// str: SHA-256 digest of the flight, as the command line prints it.
    #[getter]
    fn sha256(&self) -> String {
        self.flight.sha256()
    }

    /// Returns the flight as CSV, with a row for each sample.
    fn to_csv(&self) -> String {
        text_of(|csv| self.flight.write_csv(csv))
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

    /// Draws the path as seen from the front, over the design, for notebooks. None without samples.
    fn _repr_svg_(&self) -> Option<String> {
        let samples = self.flight.samples.clone();
        (!samples.is_empty()).then(|| front_view(&[NamedFlight { name: "flown".into(), samples }]))
    }

    fn __len__(&self) -> usize {
        self.flight.samples.len()
    }

    /// Returns the number of samples and the duration in s, in angle brackets.
    fn __repr__(&self) -> String {
        let samples = &self.flight.samples;
        let duration_s = samples.last().map_or(0.0, |last| last.time_s - samples[0].time_s);
        format!("<Flight: {} samples, {duration_s:.1} s>", samples.len())
    }
}

/// Maximum mean time between the samples of a flight, in s. Longer steps would miss strokes, which
/// take one or two seconds.
const LONGEST_STEP_S: f64 = 2.0;

/// Raises `InputError` for fewer than two times, and for times in another unit than seconds, which
/// are recognized by their size.
fn check_times(py: Python<'_>, times_s: &[f64]) -> PyResult<()> {
    let [first_s, .., last_s] = times_s else {
        let hint = "pass the samples of the flight, one row per time";
        let actual = format!("{} times", times_s.len());
        return Err(refused(py, "time_s", actual, "two or more", hint));
    };
    let duration_s = last_s - first_s;
    let step_s = duration_s / (times_s.len() - 1) as f64;
    if duration_s > MAX_DURATION_S || step_s > LONGEST_STEP_S {
        let actual = format!("{duration_s} s with a sample every {step_s:.1} s");
        let hint = "times are in seconds: divide milliseconds by 1000";
        let wanted = "at most an hour, and a sample every two seconds";
        return Err(refused(py, "time_s", actual, wanted, hint));
    }
    Ok(())
}

/// Returns the scene without setpoint lead and light timing, which suit only the scene's own
/// controller.
pub(super) fn for_any_controller(mut scene: Scene) -> Scene {
    scene.plan.reference = ReferenceKind::Design;
    scene.plan.light_clock = LightClock::Setpoint;
    scene
}

/// Flies a session with a Python controller, which also receives the time in s if `takes_time` is
/// true. `Ok(Err)` contains an exception that the controller raised.
fn fly_with_controller(
    function: &Py<PyAny>,
    takes_time: bool,
    mut session: Session,
    stop: &Stop,
) -> Result<PyResult<Flight>> {
    while let Some(observation) = session.command_inputs() {
        stop.check()?;
        match call_controller(function, observation, session.time_s(), takes_time) {
            Ok(motors) => session.command(motors)?,
            Err(error) => return Ok(Err(error)),
        }
    }
    Ok(Ok(session.finish()))
}

/// Calls a Python controller with the estimate of the state and the reference, and with `time_s` if
/// `takes_time` is true. Returns its four motor commands, 0 to 65535. Raises `InputError` for NaN
/// or another number of commands.
fn call_controller(
    function: &Py<PyAny>,
    (state, reference): ([f64; 12], [f64; 9]),
    time_s: f64,
    takes_time: bool,
) -> PyResult<[f64; 4]> {
    Python::attach(|py| {
        let (state, reference) = (array(py, &state, 1)?, array(py, &reference, 1)?);
        let motors = if takes_time {
            function.bind(py).call1((state, reference, time_s))?
        } else {
            function.bind(py).call1((state, reference))?
        };
        // The result must be four numbers, which the simulator limits to the range of motor
        // commands.
        let motors = numbers(&motors, "controller", 1)?;
        let actual = match (motors.iter().position(|motor| motor.is_nan()), motors.try_into()) {
            (None, Ok(motors)) => return Ok(motors),
            (Some(motor), _) => format!("NaN for m{} at {time_s:.3} s", motor + 1),
            (None, Err(motors)) => format!("{} numbers", Vec::len(&motors)),
        };
        let (wanted, hint) = ("four motor commands", "return m1 to m4, 0 to 65535");
        Err(refused(py, "controller", actual, wanted, hint))
    })
}

/// Flies the plans of a scene, or the given plans, one for each drone.
///
/// Parameters
/// ----------
/// scene : Scene
///     Its drone, controller, estimator, air and seed.
/// plans : list of Plan, optional
///     The scene's plans by default. With a controller, they are made with ``plan.reference = "design"`` and
///     ``plan.light_clock = "setpoint"``, and are not adapted to the scene's own controller.
/// controller : callable, optional
///     ``controller(state, reference)``, or ``controller(state, reference, time_s)``, returns the motor commands m1
///     to m4, 0 to 65535, in place of the scene's controller, for one drone. ``state`` is the estimate, shape (12,):
///     position (m, world), yaw, pitch and roll (rad), velocity (m/s) and angular velocity (rad/s) in the body frame
///     (x forward, y left, z up). ``reference`` is the design at this instant, shape (9,): position (m), velocity
///     (m/s) and acceleration (m/s²), in the world frame. ``time_s`` is the time of the flight in s, as in
///     ``Flight.time_s``. The controller is called ``rates.attitude_hz`` times a second (500 by default) while the
///     motors are on.
/// estimator : callable, optional
///     Replaces the scene's estimator, for one drone. ``estimator(state)``, a class or a function, receives the state
///     at rest, shape (12,), and returns a callable. It is called at each tick (``rates.control_hz``, 500 by default)
///     with ``(readings, tick_s)``, and returns the estimate, shape (12,), as a controller receives it. ``readings``
///     is a dict: at each tick ``"rate_rad_s"`` (gyroscope) and ``"specific_force_m_s2"`` (accelerometer: (0, 0, g)
///     at rest), both (3,) in the body frame, and ``"throttle"``, the mean motor command since the last tick, 0 to 1.
///     At the ticks of their measurements, it also contains what ``sensors.positioning`` and ``sensors.heights``
///     measure: ``"position_m"`` (3,), ``"sweeps"``, a list of (station, plane, angles of the four sensors in rad),
///     ``"ranges"``, a list of (anchor, anchor whose distance was subtracted or None, m), ``"time-of-flight"`` and
///     ``"barometer"`` in m.
/// covariance : bool
///     True to add the uncertainty of the drone's Kalman filter to ``Flight.extra``: ``estimate_sigma_m``, the
///     standard deviation of the position over three axes, and ``estimate_nees``, its squared error normalized by its
///     covariance and divided by three, whose mean in the air is 1 if the filter is consistent. For a fleet's
///     filter, both are always added.
///
/// Returns
/// -------
/// list of Flight
///     Problems are in their ``warnings``, and are issued as `NoctographWarning`.
#[pyfunction]
#[pyo3(signature = (scene, plans = None, *, controller = None, estimator = None, covariance = false))]
pub(super) fn fly(
    py: Python<'_>,
    scene: &PyScene,
    plans: Option<Vec<PyRef<'_, PyPlan>>>,
    controller: Option<Py<PyAny>>,
    estimator: Option<Py<PyAny>>,
    covariance: bool,
) -> PyResult<Vec<PyFlight>> {
    let plans = plans.map(|plans| plans.iter().map(|plan| plan.0.clone()).collect());
    let (scene, stop) = (scene.0.clone(), Stop::default());
    let takes_time = py.import("noctograph.studies")?.getattr("_takes_time")?;
    let takes_time: bool = takes_time.call1((&controller,))?.extract()?;
    let estimator = estimator.map(PyEstimator::new);
    let functions = PyFunctions { controller, takes_time, estimator: estimator.clone() };
    let inner_stop = stop.clone();
    let stage = move || fly_plans(scene, plans, &functions, covariance, &inner_stop);
    let flights = run_showing(py, &stop, |_| Ok(()), Ends::Joined, stage);
    // If an estimator raised an exception, it is reported instead of the loss of the drone that it
    // caused.
    if let Some(exception) = estimator.and_then(|estimator| estimator.take_exception()) {
        return Err(exception);
    }
    let flights = flights??;
    warn(py, flights.iter().flat_map(|flight| &flight.warnings).map(ToString::to_string))?;
    Ok(flights.into_iter().map(PyFlight::new).collect())
}

/// Python functions that control and estimate a flight.
struct PyFunctions {
    controller: Option<Py<PyAny>>,
    takes_time: bool,
    estimator: Option<PyEstimator>,
}

/// Flies the given plans or, if `plans` is `None`, those of the scene. If `covariance` is true, the
/// flights contain the uncertainty of the Kalman filter. `Ok(Err)` contains an exception that the
/// controller raised. Python functions and covariances are refused for several drones.
fn fly_plans(
    scene: Scene,
    plans: Option<Vec<Plan>>,
    PyFunctions { controller, takes_time, estimator }: &PyFunctions,
    covariance: bool,
    stop: &Stop,
) -> Result<PyResult<Vec<Flight>>> {
    let shoot = match plans {
        None if controller.is_some() => Shoot::new(for_any_controller(scene))?,
        None => Shoot::new(scene)?,
        Some(plans) => Shoot::with_plans(scene, plans)?,
    };
    let n = shoot.plans.len();
    // Without Python functions, the drones are simulated together.
    if controller.is_none() && estimator.is_none() && (n > 1 || !covariance) {
        return shoot.fly(&|_, _| {}).map(Ok);
    }
    if n != 1 {
        let (what, hint) = ("controller or estimator", "fly each plan separately");
        return Err(Error::input(what, format!("{n} plans"), "one plan", hint));
    }
    // With Python functions or covariances, a single drone is flown in a session.
    let mut session = shoot.session(|avionics| {
        estimator.iter().for_each(|estimator| estimator.install(avionics));
        if covariance {
            avionics.log_covariance();
        }
    })?;
    let Some(controller) = controller else {
        session.fly_by_itself()?;
        return Ok(Ok(vec![session.finish()]));
    };
    Ok(fly_with_controller(controller, *takes_time, session, stop)?.map(|flight| vec![flight]))
}

/// Reads the log of a real flight: JSON of the AE483 course, CSV of cfclient, µSD card, plain CSV.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///     The log, or a folder of files that belong together.
/// scene : Scene, optional
///     If the log has no lights, the letters and lights of the scene's word are inferred from the
///     setpoints, as by ``noctograph import --word``.
///
/// Returns
/// -------
/// Flight
#[pyfunction]
#[pyo3(signature = (path, scene = None))]
pub(super) fn import_log(
    py: Python<'_>,
    path: PathBuf,
    scene: Option<&PyScene>,
) -> PyResult<PyFlight> {
    let scene = scene.map(|scene| scene.0.clone());
    let flight = run(py, &Stop::default(), move || {
        // The scene's firmware is assumed for a log that does not name its firmware.
        let firmware = scene.as_ref().map(|scene| scene.vehicle.firmware);
        let options = ImportOptions { firmware, ..ImportOptions::default() };
        let mut flight = import(&path, &options)?;
        if let Some(mut scene) = scene
            && let Some(preset) = infer_lights_if_dark(&mut flight, &mut scene)?
        {
            let text = format!(
                "its setpoints follow the letters of {0}: photograph it with these letters, \
                 nc.Scene(\"{0}\", word=...)",
                preset.name()
            );
            flight.edit(|flight| flight.warnings.push(Diagnostic::warning("log", text)));
        }
        Ok(flight)
    })?;
    warn(py, flight.warnings.iter().map(ToString::to_string))?;
    Ok(PyFlight::new(flight))
}
