//! Reads numpy arrays as the columns of a table with one row per time.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::{numbers, refused};
use noctograph::plan::HEADLIGHTS;

/// Reader of the columns of a plan or a flight, all of which have the length of `times_s`.
/// `Plan::new` and `Flight::new` check the values later.
pub(super) struct Columns {
    pub(super) times_s: Vec<f64>,
}

impl Columns {
    /// Reads the times of the rows. Raises `InputError` for an array of another shape than (N,).
    pub(super) fn new(time_s: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self { times_s: numbers(time_s, "time_s", 1)? })
    }

    /// Returns `width` numbers per time, row by row. If `array` is `None`, all numbers are
    /// `default`. Raises `InputError` under the argument's `name` if there is not one row per time.
    pub(super) fn column(
        &self,
        name: &str,
        array: Option<&Bound<'_, PyAny>>,
        width: usize,
        default: f64,
    ) -> PyResult<Vec<f64>> {
        let n = self.times_s.len();
        let Some(array) = array else { return Ok(vec![default; width * n]) };
        let values = numbers(array, name, width)?;
        if values.len() == width * n {
            return Ok(values);
        }
        let actual = format!("{} rows", values.len() / width);
        let hint = "one row for each time";
        Err(refused(array.py(), name, actual, format!("{n} rows, as time_s"), hint))
    }

    /// Returns a vector for each time, in the unit and axes of the array, which has the shape (N,
    /// 3). If `array` is `None`, all vectors are zero.
    pub(super) fn points(
        &self,
        name: &str,
        array: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<Vector3<f64>>> {
        let values = self.column(name, array, 3, 0.0)?;
        Ok(values.chunks(3).map(Vector3::from_column_slice).collect())
    }

    /// Returns the lamps' levels by channel, one for each time, 0 to 1. `light` is a dict of arrays
    /// of the shape (N,), or a single array with the levels of the headlights. If it is `None`, the
    /// headlights have the level `default` at all times.
    pub(super) fn lights(
        &self,
        light: Option<&Bound<'_, PyAny>>,
        default: f64,
    ) -> PyResult<BTreeMap<String, Vec<f64>>> {
        // A value that is not a dict is a single array, or missing.
        let Some(Ok(channels)) = light.map(|light| light.cast::<PyDict>()) else {
            return Ok([(HEADLIGHTS.to_owned(), self.column("light", light, 1, default)?)].into());
        };
        let columns = channels.iter().map(|(name, levels)| {
            let name = name.extract::<String>()?;
            let levels = self.column(&format!("light[{name:?}]"), Some(&levels), 1, default)?;
            Ok((name, levels))
        });
        columns.collect()
    }
}
