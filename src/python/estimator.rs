//! Estimators of Python in the loop.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::{array, numbers, refused};
use noctograph::sensors::Readings;
use noctograph::sim::Avionics;

/// A class or function of Python that makes the estimator of a flight, and the exception of one.
#[derive(Clone, Debug)]
pub(super) struct PyEstimator {
    make: Arc<Py<PyAny>>,
    thrown: Arc<Mutex<Option<PyErr>>>,
}

impl PyEstimator {
    pub(super) fn new(make: Py<PyAny>) -> Self {
        Self { make: Arc::new(make), thrown: Arc::default() }
    }

    /// Makes one for a drone. An exception loses the drone at once.
    pub(super) fn begin(&self, avionics: &mut Avionics) {
        avionics.estimate_by(|start| {
            let made = Python::attach(|py| self.make.call1(py, (array(py, &start, 1)?,)));
            // An estimate of NaN is a lost drone.
            let (this, made) = (self.clone(), made.map_err(|error| self.keep(error)).ok());
            Box::new(move |readings, tick_s| {
                let Some(update) = &made else { return [f64::NAN; 12] };
                let updated = Python::attach(|py| updated(py, update, readings, tick_s));
                updated.unwrap_or_else(|error| {
                    this.keep(error);
                    [f64::NAN; 12]
                })
            })
        });
    }

    /// The first exception of an estimator since the last look.
    pub(super) fn thrown(&self) -> Option<PyErr> {
        self.thrown.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn keep(&self, error: PyErr) {
        self.thrown.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }
}

/// The states by an estimator after the readings of a tick.
fn updated(
    py: Python<'_>,
    update: &Py<PyAny>,
    readings: &Readings<'_>,
    tick_s: f64,
) -> PyResult<[f64; 12]> {
    // Only readings that are due are keys.
    let measured = PyDict::new(py);
    let vectors = [
        ("rate_rad_s", Some(readings.rate_rad_s)),
        ("specific_force_m_s2", Some(readings.specific_force_m_s2)),
        ("position_m", readings.position_m),
    ];
    for (name, vector) in vectors {
        if let Some(vector) = vector {
            measured.set_item(name, array(py, vector.as_slice(), 1)?)?;
        }
    }
    measured.set_item("throttle", readings.throttle)?;
    for (height, height_m) in readings.heights {
        measured.set_item(height.name(), height_m)?;
    }
    let sweeps = readings.sweeps.iter().map(|it| (it.station, it.plane, it.angles_rad));
    if sweeps.len() > 0 {
        measured.set_item("sweeps", sweeps.collect::<Vec<_>>())?;
    }
    let ranges = readings.ranges.iter().map(|it| (it.anchor, it.minus, it.distance_m));
    if ranges.len() > 0 {
        measured.set_item("ranges", ranges.collect::<Vec<_>>())?;
    }
    let state = numbers(update.bind(py).call1((measured, tick_s))?.as_any(), "estimator", 1)?;
    let wrong = state.iter().enumerate().find(|(_, value)| !value.is_finite());
    let wrong = wrong.map(|(index, value)| format!("{value} for state {index}"));
    let actual = match (wrong, state.try_into()) {
        (None, Ok(state)) => return Ok(state),
        (Some(wrong), _) => wrong,
        (None, Err(state)) => format!("{} numbers", Vec::len(&state)),
    };
    let hint = "return position, yaw pitch roll, velocity and rate of the body";
    Err(refused(py, "estimator", actual, "twelve states", hint))
}
