//! Arrays of numpy as columns of one table: a row for each time.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::{numbers, raised};
use noctograph::error::Error;
use noctograph::plan::HEADLIGHTS;

/// Largest magnitude of a number.
const MOST: f64 = 1e6;

/// The columns of a plan or a flight: finite, as long as the times, which rise.
pub(super) struct Columns {
    pub(super) times_s: Vec<f64>,
}

impl Columns {
    pub(super) fn new(time_s: &Bound<'_, PyAny>) -> PyResult<Self> {
        let times_s = finite("time_s", time_s, 1)?;
        match times_s.windows(2).find(|pair| pair[0] >= pair[1]) {
            None => Ok(Self { times_s }),
            Some(pair) => {
                let actual = format!("{} after {}", pair[1], pair[0]);
                Err(refused(time_s.py(), "time_s", actual, "rising times"))
            }
        }
    }

    /// A column of rows of so many numbers, by default all `usual`.
    pub(super) fn column(
        &self,
        name: &str,
        array: Option<&Bound<'_, PyAny>>,
        columns: usize,
        usual: f64,
    ) -> PyResult<Vec<f64>> {
        let n = self.times_s.len();
        let Some(array) = array else { return Ok(vec![usual; columns * n]) };
        let values = finite(name, array, columns)?;
        if values.len() == columns * n {
            return Ok(values);
        }
        let actual = format!("{} rows", values.len() / columns);
        Err(refused(array.py(), name, actual, format!("{n} rows, as time_s")))
    }

    /// A column of points or directions, by default all zero.
    pub(super) fn points(
        &self,
        name: &str,
        array: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<Vector3<f64>>> {
        let values = self.column(name, array, 3, 0.0)?;
        Ok(values.chunks(3).map(Vector3::from_column_slice).collect())
    }

    /// Levels of lamps by their channels; a single array is of the headlights.
    pub(super) fn lights(
        &self,
        light: Option<&Bound<'_, PyAny>>,
        usual: f64,
    ) -> PyResult<BTreeMap<String, Vec<f64>>> {
        let Some(Ok(channels)) = light.map(|light| light.cast::<PyDict>()) else {
            return Ok([(HEADLIGHTS.to_owned(), self.levels("light", light, usual)?)].into());
        };
        let levels = |(name, levels): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            let name = name.extract::<String>()?;
            let levels = self.levels(&format!("light[{name:?}]"), Some(&levels), usual)?;
            Ok((name, levels))
        };
        channels.iter().map(levels).collect()
    }

    fn levels(
        &self,
        name: &str,
        array: Option<&Bound<'_, PyAny>>,
        usual: f64,
    ) -> PyResult<Vec<f64>> {
        let levels = self.column(name, array, 1, usual)?;
        let beyond = levels.iter().position(|level| !(0.0..=1.0).contains(level));
        let Some((row, array)) = beyond.zip(array) else { return Ok(levels) };
        let actual = format!("{} in row {row}", levels[row]);
        let hint = "1 is the lamp at full: divide bytes by 255";
        Err(raised(array.py(), &Error::input(name, actual, "levels from 0 to 1", hint)))
    }
}

fn finite(name: &str, array: &Bound<'_, PyAny>, columns: usize) -> PyResult<Vec<f64>> {
    let values = numbers(array, name, columns)?;
    match values.iter().position(|value| value.is_nan() || value.abs() > MOST) {
        None => Ok(values),
        Some(index) => {
            let actual = format!("{} in row {}", values[index], index / columns);
            Err(refused(array.py(), name, actual, "numbers up to 1e6"))
        }
    }
}

fn refused(py: Python<'_>, name: &str, actual: String, wanted: impl Into<String>) -> PyErr {
    let hint = "one row for each time, all of them finite";
    raised(py, &Error::input(name, actual, wanted.into(), hint))
}
