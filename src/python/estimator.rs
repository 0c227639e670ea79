//! Estimators of Python in the loop.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Vector3;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::{array, numbers, raised};
use noctograph::error::Error;
use noctograph::sensors::{Range, Readings, Sweep};
use noctograph::sim::Avionics;

/// A class or function of Python that makes the estimator of a flight, and what one raised.
#[derive(Clone, Debug)]
pub(super) struct PyEstimator {
    make: Arc<Py<PyAny>>,
    thrown: Arc<Mutex<Option<PyErr>>>,
}

impl PyEstimator {
    pub(super) fn new(make: Py<PyAny>) -> Self {
        Self { make: Arc::new(make), thrown: Arc::default() }
    }

    /// Makes one for a drone. Where it raises, the drone is lost at once.
    pub(super) fn begin(&self, avionics: &mut Avionics) {
        avionics.estimate_by(|start| {
            let made = Python::attach(|py| self.make.call1(py, (array(py, &start, 1)?,)));
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

    /// What an estimator raised since the last look.
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
    let measured = PyDict::new(py);
    let vector = |v: &Vector3<f64>| array(py, v.as_slice(), 1);
    measured.set_item("rate_rad_s", vector(&readings.rate_rad_s)?)?;
    measured.set_item("specific_force_m_s2", vector(&readings.specific_force_m_s2)?)?;
    measured.set_item("throttle", readings.throttle)?;
    if let Some(position_m) = &readings.position_m {
        measured.set_item("position_m", vector(position_m)?)?;
    }
    for (height, height_m) in readings.heights {
        measured.set_item(height.name(), height_m)?;
    }
    if !readings.sweeps.is_empty() {
        let sweep = |it: &Sweep| (it.station, it.plane, it.angles_rad);
        measured.set_item("sweeps", readings.sweeps.iter().map(sweep).collect::<Vec<_>>())?;
    }
    if !readings.ranges.is_empty() {
        let range = |it: &Range| (it.anchor, it.minus, it.distance_m);
        measured.set_item("ranges", readings.ranges.iter().map(range).collect::<Vec<_>>())?;
    }
    let state = numbers(update.bind(py).call1((measured, tick_s))?.as_any(), "estimator", 1)?;
    let refuse = |actual: String| {
        let hint = "return position, yaw pitch roll, velocity and rate of the body";
        raised(py, &Error::input("estimator", actual, "twelve states", hint))
    };
    if let Some(index) = state.iter().position(|value| !value.is_finite()) {
        return Err(refuse(format!("{} for state {index}", state[index])));
    }
    let n = state.len();
    state.try_into().map_err(|_state| refuse(format!("{n} numbers")))
}
