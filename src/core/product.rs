//! Products that are always valid, because their data is checked once, when a stage creates it.

use std::ops::Deref;

use crate::error::{Error, Result};

/// Largest magnitude of a position in m, a speed in m/s, an angle in rad or a motor command, far
/// above any value that a drone reaches.
pub const MAX_QUANTITY: f64 = 1e6;

/// Data that is subject to rules, such as equal lengths, finite numbers and ordered times.
pub trait Rules {
    /// Checks the rules.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] if a rule is violated.
    fn check(&self) -> Result<()>;
}

/// Data that satisfies its rules. Fields can be read, but only [`Self::edit`] can change them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Valid<T>(T);

impl<T: Rules> Valid<T> {
    /// Checks the data, and returns it as valid.
    ///
    /// # Errors
    ///
    /// Returns the error of [`Rules::check`].
    pub fn new(data: T) -> Result<Self> {
        data.check()?;
        Ok(Self(data))
    }

    /// Creates a product from data that a stage guarantees to be valid.
    ///
    /// # Panics
    ///
    /// Panics if the data violates a rule, which is a defect of the stage.
    #[must_use]
    pub fn made(data: T) -> Self {
        Self::new(data).unwrap_or_else(|error| broken(&error))
    }

    /// Changes the data with `change`, and returns the result of `change`.
    ///
    /// # Panics
    ///
    /// Panics if the changed data violates a rule, as [`Self::made`] does.
    pub fn edit<R>(&mut self, change: impl FnOnce(&mut T) -> R) -> R {
        let changed = change(&mut self.0);
        self.0.check().unwrap_or_else(|error| broken(&error));
        changed
    }

    /// Returns the data without the guarantee that it satisfies its rules.
    pub fn into_data(self) -> T {
        self.0
    }
}

/// Panics with the rule that a stage's product violates.
fn broken(error: &Error) -> ! {
    panic!("a product breaks its rules: {error}")
}

impl<T> Deref for Valid<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.0
    }
}

const FINITE_HINT: &str = "give one row for each time, with finite numbers in SI units";

/// Checks that a column has as many rows as there are times.
pub(crate) fn check_length(name: &str, n_rows: usize, n_times: usize) -> Result<()> {
    if n_rows == n_times {
        return Ok(());
    }
    let wanted = format!("{n_times} rows, as many as in time_s");
    Err(Error::input(name, format_args!("{n_rows} rows"), wanted, FINITE_HINT))
}

/// True if a number is finite and within the range of a drone's quantities.
pub(crate) fn is_number(value: f64) -> bool {
    value.abs() <= MAX_QUANTITY
}

/// Creates the error for a number for which [`is_number`] is false.
pub(crate) fn odd_number(name: &str, row: usize, value: f64) -> Error {
    let wanted = format!("a number within ±{MAX_QUANTITY}");
    Error::input(name, format_args!("{value} in row {row}"), wanted, FINITE_HINT)
}

/// Checks that times are finite and never decrease.
pub(crate) fn check_times(times_s: impl IntoIterator<Item = f64>) -> Result<()> {
    let mut last_s = f64::NEG_INFINITY;
    for (row, time_s) in times_s.into_iter().enumerate() {
        // NaN fails the comparison.
        if !(time_s.is_finite() && time_s >= last_s) {
            let actual = format!("{time_s} after {last_s} in row {row}");
            return Err(Error::input("time_s", actual, "rising times", "sort the rows by time"));
        }
        last_s = time_s;
    }
    Ok(())
}

/// Checks that a column contains a light level from 0 to 1 for each time.
pub(crate) fn check_levels(name: &str, levels: &[f64], n_times: usize) -> Result<()> {
    check_length(name, levels.len(), n_times)?;
    match levels.iter().position(|level| !(0.0..=1.0).contains(level)) {
        None => Ok(()),
        Some(row) => {
            let actual = format!("{} in row {row}", levels[row]);
            let hint = "1 is full brightness: divide bytes by 255";
            Err(Error::input(name, actual, "levels from 0 to 1", hint))
        }
    }
}

/// Checks that a picture of a width and height has at least one pixel, and `n_channels` values for
/// each.
pub fn check_picture(size_px: [u32; 2], n_values: usize, n_channels: usize) -> Result<()> {
    let [width_px, height_px] = size_px;
    // The product of the three factors may overflow `usize`.
    let n_wanted = u128::from(width_px) * u128::from(height_px) * n_channels as u128;
    if n_wanted > 0 && n_values as u128 == n_wanted {
        return Ok(());
    }
    let actual = format!("{n_values} values for {width_px} x {height_px} pixels");
    let wanted = format!("at least one pixel, and {n_channels} values each: {n_wanted}");
    Err(Error::input(
        "picture",
        actual,
        wanted,
        "give the size of the picture to which the values belong",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::{Flight, FlightData, FlightSample};
    use crate::photo::{Photo, PhotoData};
    use crate::plan::{Plan, PlanData, Setpoint};
    use crate::strokes::{Cell, Glyph, Move, Strokes, StrokesData};

    fn refused<T>(made: Result<T>, said: &[&str]) {
        let error = made.err().expect("it breaks a rule").to_string();
        assert!(said.iter().all(|part| error.contains(part)), "{error}, not {said:?}");
    }

    fn flight(change: impl FnOnce(&mut FlightData)) -> Result<Flight> {
        let samples = (0..400)
            .map(|row| FlightSample { time_s: 0.01 * f64::from(row), ..FlightSample::default() });
        let mut flight = FlightData { samples: samples.collect(), ..FlightData::default() };
        change(&mut flight);
        Flight::new(flight)
    }

    fn plan(change: impl FnOnce(&mut PlanData)) -> Result<Plan> {
        let mut plan = PlanData { setpoints: vec![Setpoint::default(); 3], ..PlanData::default() };
        change(&mut plan);
        Plan::new(plan)
    }

    fn lights(levels: usize, level: f64) -> std::collections::BTreeMap<String, Vec<f64>> {
        [("headlights".to_owned(), vec![level; levels])].into()
    }

    #[test]
    fn a_flight_that_cannot_be_is_refused_with_place_found_and_wanted() {
        assert!(flight(|it| it.lights = lights(400, 1.0)).is_ok());
        refused(flight(|it| it.samples[7].position_m.y = f64::NAN), &["y_m", "NaN in row 7", "±"]);
        refused(flight(|it| it.samples[7].motors[2] = 1e9), &["m3", "row 7"]);
        refused(flight(|it| it.samples[9].time_s = 0.0), &["time_s", "0 after 0.08", "rising"]);
        refused(flight(|it| it.lights = lights(100, 1.0)), &["headlights", "100 rows", "400 rows"]);
        refused(flight(|it| it.lights = lights(0, 1.0)), &["headlights", "0 rows"]);
        refused(flight(|it| it.lights = lights(400, 255.0)), &["255 in row 0", "from 0 to 1"]);
        refused(flight(|it| _ = it.extra.insert("v".into(), vec![0.0])), &["v: found 1 rows"]);
        refused(flight(|it| it.gaps = vec![[2.0, 1.0]]), &["gaps", "2 before 1"]);
        refused(flight(|it| it.gaps = vec![[1.0, f64::NAN]]), &["gaps", "1 before NaN"]);
        refused(flight(|it| it.gaps = vec![[1.0, f64::INFINITY]]), &["gaps", "1 before inf"]);
    }

    #[test]
    fn a_plan_that_cannot_be_is_refused() {
        assert!(plan(|_| ()).is_ok());
        refused(plan(|it| it.setpoints[1].time_s = f64::INFINITY), &["time_s", "inf after 0"]);
        refused(plan(|it| it.setpoints[2].velocity_m_s.x = f64::NAN), &["vx_m_s", "NaN in row 2"]);
        refused(plan(|it| it.lights = lights(2, 1.0)), &["light.headlights", "2 rows", "3 rows"]);
        refused(plan(|it| it.lit = vec![-0.5; 3]), &["lit", "-0.5 in row 0"]);
        refused(plan(|it| it.sent_m = vec![nalgebra::Vector3::zeros()]), &["sent_m", "1 rows"]);
        refused(plan(|it| it.yaw_rad = f64::NAN), &["yaw_rad", "NaN"]);
    }

    #[test]
    fn a_photo_and_strokes_that_cannot_be_are_refused() {
        let photo = |width_px, bytes| PhotoData {
            width_px,
            height_px: 2,
            rgb8: vec![0; bytes],
            scene_toml: None,
        };
        assert!(Photo::new(photo(2, 12)).is_ok());
        refused(Photo::new(photo(2, 11)), &["11 values for 2 x 2 pixels", "12"]);
        refused(Photo::new(photo(0, 0)), &["0 x 2 pixels", "at least one pixel"]);
        let many = PhotoData { height_px: u32::MAX, ..photo(u32::MAX, 3) };
        refused(Photo::new(many), &["3 values for 4294967295 x 4294967295 pixels"]);
        let cell = Cell { left_m: 0.0, baseline_m: f64::NAN, width_m: 1.0, cap_height_m: 1.0 };
        let glyphs = vec![Glyph { character: 'I', cell, moves: Vec::new() }];
        let strokes = StrokesData { glyphs, ..StrokesData::default() };
        refused(Strokes::new(strokes), &["glyphs", "NaN in row 0"]);
        let cell = Cell { baseline_m: 0.0, ..cell };
        let still = Move { from_m: [0.0; 2], to_m: [1.0; 2], lit: true, pace: 0.0 };
        let glyphs = vec![Glyph { character: 'I', cell, moves: vec![still] }];
        let strokes = StrokesData { glyphs, ..StrokesData::default() };
        refused(Strokes::new(strokes), &["glyphs", "a pace of 0 in row 0", "above 0"]);
    }

    #[test]
    #[should_panic(expected = "a product breaks its rules: time_s")]
    fn a_change_that_breaks_a_rule_is_a_defect() {
        let mut flight = flight(|_| ()).unwrap();
        flight.edit(|flight| flight.samples.swap(0, 5));
    }
}
