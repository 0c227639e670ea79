//! Estimators written in Python, which replace the scene's estimator.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::{array, numbers, refused};
use noctograph::sensors::Readings;
use noctograph::sim::Avionics;

/// A Python class or function that creates the estimator of a flight, and the first exception that
/// was raised.
#[derive(Clone, Debug)]
pub(super) struct PyEstimator {
    factory: Arc<Py<PyAny>>,
    exception: Arc<Mutex<Option<PyErr>>>,
}

impl PyEstimator {
    pub(super) fn new(factory: Py<PyAny>) -> Self {
        Self { factory: Arc::new(factory), exception: Arc::default() }
    }

    /// Replaces a drone's estimator by the Python estimator. If the estimator raises an exception,
    /// the drone is lost immediately.
    pub(super) fn install(&self, avionics: &mut Avionics) {
        avionics.estimate_by(|start| {
            let created = Python::attach(|py| self.factory.call1(py, (array(py, &start, 1)?,)));
            let estimator = created.map_err(|error| self.keep(error)).ok();
            let this = self.clone();
            Box::new(move |readings, tick_s| {
                // The simulator treats a drone whose estimate is NaN as lost.
                let Some(update) = &estimator else { return [f64::NAN; 12] };
                let state = Python::attach(|py| call_update(py, update, readings, tick_s));
                state.unwrap_or_else(|error| {
                    this.keep(error);
                    [f64::NAN; 12]
                })
            })
        });
    }

    /// Removes and returns the first exception that an estimator has raised since the last call.
    pub(super) fn take_exception(&self) -> Option<PyErr> {
        self.exception.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Stores an exception for [`Self::take_exception`], unless one is already stored.
    fn keep(&self, error: PyErr) {
        self.exception.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }
}

/// Calls an estimator with the readings of a tick, whose keys `fly` documents. Returns the twelve
/// states: position in m, yaw, pitch and roll in rad, velocity in m/s and angular velocity in
/// rad/s. Returns an exception if the result is not twelve finite numbers.
fn call_update(
    py: Python<'_>,
    update: &Py<PyAny>,
    readings: &Readings<'_>,
    tick_s: f64,
) -> PyResult<[f64; 12]> {
    // The dict contains only the sensors that have a reading in this tick.
    let reading_by_name = PyDict::new(py);
    let vectors = [
        ("rate_rad_s", Some(readings.rate_rad_s)),
        ("specific_force_m_s2", Some(readings.specific_force_m_s2)),
        ("position_m", readings.position_m),
    ];
    for (name, vector) in vectors {
        if let Some(vector) = vector {
            reading_by_name.set_item(name, array(py, vector.as_slice(), 1)?)?;
        }
    }
    reading_by_name.set_item("throttle", readings.throttle)?;
    for (height, height_m) in readings.heights {
        reading_by_name.set_item(height.name(), height_m)?;
    }
    let sweeps = readings.sweeps.iter().map(|it| (it.station, it.plane, it.angles_rad));
    if sweeps.len() > 0 {
        reading_by_name.set_item("sweeps", sweeps.collect::<Vec<_>>())?;
    }
    let ranges = readings.ranges.iter().map(|it| (it.anchor, it.minus, it.distance_m));
    if ranges.len() > 0 {
        reading_by_name.set_item("ranges", ranges.collect::<Vec<_>>())?;
    }
    // The result must be twelve finite numbers.
    let state =
        numbers(update.bind(py).call1((reading_by_name, tick_s))?.as_any(), "estimator", 1)?;
    let not_finite = state.iter().enumerate().find(|(_, value)| !value.is_finite());
    let not_finite = not_finite.map(|(index, value)| format!("{value} as state {index}"));
    let actual = match (not_finite, state.try_into()) {
        (None, Ok(state)) => return Ok(state),
        (Some(not_finite), _) => not_finite,
        (None, Err(state)) => format!("{} numbers", Vec::len(&state)),
    };
    let hint = "return position, yaw, pitch, roll, velocity and body rate";
    Err(refused(py, "estimator", actual, "twelve states", hint))
}
