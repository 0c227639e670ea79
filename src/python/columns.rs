//! Arrays of numpy as columns of one table: a row for each time.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::{numbers, refused};
use noctograph::plan::HEADLIGHTS;

/// The columns of a plan or a flight, as long as the times. Their values are checked by the product
/// that is made of them.
pub(super) struct Columns {
    pub(super) times_s: Vec<f64>,
}

impl Columns {
    pub(super) fn new(time_s: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self { times_s: numbers(time_s, "time_s", 1)? })
    }

    /// A column with rows of `columns` numbers, by default all `usual`.
    pub(super) fn column(
        &self,
        name: &str,
        array: Option<&Bound<'_, PyAny>>,
        columns: usize,
        usual: f64,
    ) -> PyResult<Vec<f64>> {
        // A missing column is the usual value in every row.
        let n = self.times_s.len();
        let Some(array) = array else { return Ok(vec![usual; columns * n]) };
        let values = numbers(array, name, columns)?;
        if values.len() == columns * n {
            return Ok(values);
        }
        let actual = format!("{} rows", values.len() / columns);
        let hint = "one row for each time";
        Err(refused(array.py(), name, actual, format!("{n} rows, as time_s"), hint))
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

    /// Levels of lamps by their channels. A single array is that of the headlights.
    pub(super) fn lights(
        &self,
        light: Option<&Bound<'_, PyAny>>,
        usual: f64,
    ) -> PyResult<BTreeMap<String, Vec<f64>>> {
        let Some(Ok(channels)) = light.map(|light| light.cast::<PyDict>()) else {
            return Ok([(HEADLIGHTS.to_owned(), self.column("light", light, 1, usual)?)].into());
        };
        let columns = channels.iter().map(|(name, levels)| {
            let name = name.extract::<String>()?;
            let levels = self.column(&format!("light[{name:?}]"), Some(&levels), 1, usual)?;
            Ok((name, levels))
        });
        columns.collect()
    }
}
