//! Flights as CSV files: one row a sample, one column a number, SI units in the names.

use std::io::Write;
use std::path::Path;

use nalgebra::Vector3;

use super::table::{Table, write_table};
use super::{Flight, FlightSample};
use crate::error::{Error, Result};
use crate::geometry::Attitude;

/// Columns of a flight file, before one `light.<channel>` for each light channel.
///
/// Position, estimate and design in the world frame; velocity and rate in the body frame; `letter`
/// is 1 for the first letter of the word and 0 outside letters.
pub const COLUMNS: [&str; 24] = [
    "time_s",
    "x_m",
    "y_m",
    "z_m",
    "yaw_rad",
    "pitch_rad",
    "roll_rad",
    "vx_body_m_s",
    "vy_body_m_s",
    "vz_body_m_s",
    "wx_body_rad_s",
    "wy_body_rad_s",
    "wz_body_rad_s",
    "x_estimate_m",
    "y_estimate_m",
    "z_estimate_m",
    "x_design_m",
    "y_design_m",
    "z_design_m",
    "m1",
    "m2",
    "m3",
    "m4",
    "letter",
];

impl Flight {
    /// Writes the flight as CSV, on the grid of 1e-6.
    ///
    /// # Errors
    ///
    /// What the writer says.
    pub fn write_csv(&self, out: &mut impl Write) -> std::io::Result<()> {
        let lights = self.lights.keys().map(|channel| format!("light.{channel}"));
        let header: Vec<String> = COLUMNS.map(str::to_owned).into_iter().chain(lights).collect();
        let rows = self.samples.iter().enumerate().map(|(row, sample)| {
            let lights = self.lights.values().map(move |levels| levels[row]);
            numbers(sample).into_iter().chain(lights)
        });
        write_table(out, &header, rows)
    }

    /// Reads a flight from a CSV file as [`Self::write_csv`] makes it.
    ///
    /// # Errors
    ///
    /// [`Error::Io`], or [`Error::Input`] with line and column.
    pub fn read_csv(path: &Path) -> Result<Self> {
        Self::from_table(&Table::read(path)?)
    }

    fn from_table(table: &Table) -> Result<Self> {
        table.time_s()?;
        let columns = COLUMNS.map(|name| table.column(name));
        let columns = columns.into_iter().collect::<Result<Vec<_>>>()?;
        let samples = (0..table.n_rows()).map(|row| {
            let mut cells = columns.iter().map(|column| column[row]);
            let mut next = || cells.next().expect("COLUMNS is as long as a sample");
            let vector = |n: &mut dyn FnMut() -> f64| Vector3::new(n(), n(), n());
            FlightSample {
                time_s: next(),
                position_m: vector(&mut next),
                attitude: Attitude { yaw_rad: next(), pitch_rad: next(), roll_rad: next() },
                velocity_body_m_s: vector(&mut next),
                rate_body_rad_s: vector(&mut next),
                estimate_m: vector(&mut next),
                design_m: vector(&mut next),
                motors: [next(), next(), next(), next()],
                letter: letter_from_number(next()),
            }
        });
        let samples = samples.collect();
        let lights = table.columns_after("light.");
        let lights =
            lights.map(|(channel, levels)| (channel.to_owned(), levels.to_vec())).collect();
        let flight = Self { samples, lights, warnings: Vec::new() };
        check_levels(&flight.lights)?;
        Ok(flight)
    }
}

/// Checks that light levels lie within 0..=1.
///
/// # Errors
///
/// [`Error::Input`] naming the channel.
pub(crate) fn check_levels(lights: &std::collections::BTreeMap<String, Vec<f64>>) -> Result<()> {
    for (channel, levels) in lights {
        if let Some(level) = levels.iter().find(|level| !(0.0..=1.0).contains(*level)) {
            let place = format!("column light.{channel}");
            return Err(Error::input(place, level, "a level from 0 (off) to 1", "mend the file"));
        }
    }
    Ok(())
}

/// The file's letter number (0 outside letters) for an index.
pub(crate) fn number_from_letter(letter: Option<usize>) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "words are short")]
    letter.map_or(0.0, |index| index as f64 + 1.0)
}

/// The index of a letter for the file's number.
pub(crate) fn letter_from_number(number: f64) -> Option<usize> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    (number >= 1.0).then(|| number as usize - 1)
}

fn numbers(sample: &FlightSample) -> [f64; 24] {
    let FlightSample { time_s, position_m: p, attitude: a, velocity_body_m_s: v, .. } = sample;
    let (w, e, d) = (&sample.rate_body_rad_s, &sample.estimate_m, &sample.design_m);
    let [m1, m2, m3, m4] = sample.motors;
    let letter = number_from_letter(sample.letter);
    [
        *time_s,
        p.x,
        p.y,
        p.z,
        a.yaw_rad,
        a.pitch_rad,
        a.roll_rad,
        v.x,
        v.y,
        v.z,
        w.x,
        w.y,
        w.z,
        e.x,
        e.y,
        e.z,
        d.x,
        d.y,
        d.z,
        m1,
        m2,
        m3,
        m4,
        letter,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::table::on_grid;

    fn flight() -> Flight {
        let n = |i: usize, k: f64| on_grid(libm::sin(i as f64 * k) * 3.0);
        let v = |i: usize, k: f64| Vector3::new(n(i, k), n(i, k + 0.1), n(i, k + 0.2));
        let samples = (0..50).map(|i| FlightSample {
            time_s: on_grid(i as f64 * 0.004),
            position_m: v(i, 0.7),
            attitude: Attitude { yaw_rad: n(i, 0.01), pitch_rad: n(i, 0.02), roll_rad: n(i, 0.03) },
            velocity_body_m_s: v(i, 0.4),
            rate_body_rad_s: v(i, 0.5),
            estimate_m: v(i, 0.6),
            design_m: v(i, 0.8),
            motors: [n(i, 1.0), n(i, 1.1), n(i, 1.2), n(i, 1.3)],
            letter: (i > 10).then_some(i / 20),
        });
        let samples: Vec<FlightSample> = samples.collect();
        let levels = (0..50).map(|i| f64::from(i % 2)).collect();
        Flight { samples, lights: [("headlights".to_owned(), levels)].into(), warnings: vec![] }
    }

    #[test]
    fn a_flight_reads_back_bit_by_bit() {
        let (flight, mut file) = (flight(), Vec::new());
        flight.write_csv(&mut file).unwrap();
        let back = Flight::from_table(&Table::parse(&file[..], "flight.csv").unwrap()).unwrap();
        assert_eq!(back, flight);
    }

    #[test]
    fn a_light_level_out_of_range_is_refused() {
        let (flight, mut file) = (flight(), Vec::new());
        flight.write_csv(&mut file).unwrap();
        let broken = String::from_utf8(file).unwrap().replace(",1\n", ",7\n");
        let error = Flight::from_table(&Table::parse(broken.as_bytes(), "f.csv").unwrap());
        assert!(error.unwrap_err().to_string().contains("light.headlights"));
    }
}
