//! Flights as CSV files: one row a sample, one column a number, SI units in the names.
//!
//! The columns of a quantity that a real log does not tell are left out together. `gap_before` is 1
//! in the first row after a hole, and stands only in files with holes. Columns of other names are
//! kept as [`Flight::extra`]; the simulator's are `saturated_s` and, for a drone with a battery,
//! `battery_v` and `energy_j`.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::Path;

use nalgebra::Vector3;

use super::table::{Table, write_table};
use super::{Flight, FlightSample, Quantity};
use crate::digest::Digest;
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

/// The column that is 1 in the first row after a hole.
const GAP: &str = "gap_before";

impl Quantity {
    /// Its places in [`COLUMNS`].
    fn columns(self) -> std::ops::Range<usize> {
        match self {
            Self::Position => 1..4,
            Self::Attitude => 4..7,
            Self::Velocity => 7..10,
            Self::Rate => 10..13,
            Self::Estimate => 13..16,
            Self::Design => 16..19,
            Self::Motors => 19..23,
        }
    }
}

/// Whether a column of a flight file has a meaning of its own, so that no extra column may take
/// its name.
#[must_use]
pub fn is_standard_column(name: &str) -> bool {
    COLUMNS.contains(&name) || name == GAP || name.starts_with("light.")
}

impl Flight {
    /// Writes the flight as CSV, on the grid of 1e-6.
    ///
    /// # Errors
    ///
    /// What the writer says.
    pub fn write_csv(&self, out: &mut impl Write) -> std::io::Result<()> {
        let skipped: BTreeSet<usize> =
            self.unlogged.iter().flat_map(|quantity| quantity.columns()).collect();
        let kept: Vec<usize> = (0..COLUMNS.len()).filter(|i| !skipped.contains(i)).collect();
        let after_gap = self.after_gap();
        let gap = (!self.gaps.is_empty()).then_some(&after_gap);
        let header: Vec<String> = kept
            .iter()
            .map(|&i| COLUMNS[i].to_owned())
            .chain(self.lights.keys().map(|channel| format!("light.{channel}")))
            .chain(gap.map(|_| GAP.to_owned()))
            .chain(self.extra.keys().cloned())
            .collect();
        let rows = self.samples.iter().enumerate().map(|(row, sample)| {
            let numbers = numbers(sample);
            let standard = kept.iter().map(move |&i| numbers[i]);
            let further = self.lights.values().chain(gap).chain(self.extra.values());
            standard.chain(further.map(move |column| column[row]))
        });
        write_table(out, &header, rows)
    }

    /// SHA-256 of all that a flight file tells, in hexadecimal: equal flights, equal digest, on
    /// every machine and in every build.
    #[must_use]
    pub fn sha256(&self) -> String {
        let mut digest = Digest::default();
        for quantity in &self.unlogged {
            digest.add(quantity.name());
        }
        for sample in &self.samples {
            digest.add_numbers(&numbers(sample));
        }
        for gap in &self.gaps {
            digest.add_numbers(gap);
        }
        for (name, column) in self.lights.iter().chain(&self.extra) {
            digest.add(name);
            digest.add_numbers(column);
        }
        digest.hex()
    }

    /// 1 for each sample that ends a hole, 0 for the others.
    fn after_gap(&self) -> Vec<f64> {
        let mut gaps = self.gaps.iter().peekable();
        let flag = |sample: &FlightSample| {
            let ends = gaps.next_if(|gap| gap[1] <= sample.time_s).is_some();
            f64::from(u8::from(ends))
        };
        self.samples.iter().map(flag).collect()
    }

    /// Reads a flight from a CSV file as [`Self::write_csv`] makes it.
    ///
    /// A quantity may be missing with all its columns: the flight then says so in `unlogged` and
    /// in a warning.
    ///
    /// # Errors
    ///
    /// [`Error::Io`], or [`Error::Input`] with line and column.
    pub fn read_csv(path: &Path) -> Result<Self> {
        Self::from_table(&Table::read(path)?)
    }

    fn from_table(table: &Table) -> Result<Self> {
        let time_s = table.time_s()?;
        let mut cells: [Option<&[f64]>; COLUMNS.len()] = [None; COLUMNS.len()];
        let mut unlogged = BTreeSet::new();
        for quantity in Quantity::ALL {
            let names = &COLUMNS[quantity.columns()];
            if names.iter().any(|name| table.has(name)) {
                for (cell, name) in cells[quantity.columns()].iter_mut().zip(names) {
                    *cell = Some(table.column(name)?);
                }
            } else {
                unlogged.insert(quantity);
            }
        }
        cells[0] = Some(time_s);
        cells[23] = table.has(COLUMNS[23]).then(|| table.column(COLUMNS[23])).transpose()?;
        let samples: Vec<FlightSample> = (0..table.n_rows())
            .map(|row| sample(cells.map(|c| c.map_or(0.0, |c| c[row]))))
            .collect();
        let lights = light_columns(table)?;
        let extra = table.columns_after("").filter(|(name, _)| !is_standard_column(name));
        let extra: BTreeMap<_, _> =
            extra.map(|(name, values)| (name.to_owned(), values.to_vec())).collect();
        if unlogged.len() == Quantity::ALL.len() && extra.is_empty() {
            table.column(COLUMNS[1])?;
        }
        let gaps = if table.has(GAP) {
            let flags = table.column(GAP)?.iter().skip(1);
            let pairs = samples.windows(2).zip(flags).filter(|(_, flag)| **flag != 0.0);
            pairs.map(|(pair, _)| [pair[0].time_s, pair[1].time_s]).collect()
        } else {
            Vec::new()
        };
        let warn =
            |quantity: &Quantity| format!("no {} in the file: zeros stand for it", quantity.name());
        let warnings = unlogged.iter().map(warn).collect();
        Ok(Self { samples, lights, extra, gaps, unlogged, warnings })
    }
}

/// A sample from its numbers in the order of [`COLUMNS`].
fn sample(n: [f64; COLUMNS.len()]) -> FlightSample {
    FlightSample {
        time_s: n[0],
        position_m: Vector3::new(n[1], n[2], n[3]),
        attitude: Attitude { yaw_rad: n[4], pitch_rad: n[5], roll_rad: n[6] },
        velocity_body_m_s: Vector3::new(n[7], n[8], n[9]),
        rate_body_rad_s: Vector3::new(n[10], n[11], n[12]),
        estimate_m: Vector3::new(n[13], n[14], n[15]),
        design_m: Vector3::new(n[16], n[17], n[18]),
        motors: [n[19], n[20], n[21], n[22]],
        letter: letter_from_number(n[23]),
    }
}

/// The light columns of a table, `light.<channel>`, with levels within 0..=1.
///
/// # Errors
///
/// [`Error::Input`] naming the channel whose level lies outside.
pub(crate) fn light_columns(table: &Table) -> Result<BTreeMap<String, Vec<f64>>> {
    let mut lights = BTreeMap::new();
    for (channel, levels) in table.columns_after("light.") {
        if let Some(level) = levels.iter().find(|level| !(0.0..=1.0).contains(*level)) {
            let place = format!("column light.{channel}");
            return Err(Error::input(place, level, "a level from 0 (off) to 1", "mend the file"));
        }
        lights.insert(channel.to_owned(), levels.to_vec());
    }
    Ok(lights)
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
        let lights = [("headlights".to_owned(), levels)].into();
        Flight { samples, lights, ..Flight::default() }
    }

    #[test]
    fn the_digest_sees_the_last_digit_of_any_number() {
        let flight = flight();
        let digest = flight.sha256();
        assert_eq!(digest, flight.clone().sha256(), "the same flight");
        let mut moved = flight.clone();
        moved.samples[7].position_m.y += 1e-6;
        let mut darker = flight.clone();
        darker.lights.get_mut("headlights").unwrap()[3] = 0.5;
        let silent = Flight { unlogged: [Quantity::Motors].into(), ..flight.clone() };
        for other in [moved, darker, silent] {
            assert_ne!(other.sha256(), digest);
        }
    }

    #[test]
    fn a_flight_reads_back_bit_by_bit() {
        let (flight, mut file) = (flight(), Vec::new());
        flight.write_csv(&mut file).unwrap();
        let back = Flight::from_table(&Table::parse(&file[..], "flight.csv").unwrap()).unwrap();
        assert_eq!(back, flight);
    }

    #[test]
    fn holes_and_further_columns_and_what_is_not_told_read_back() {
        let mut flight = flight();
        flight
            .extra
            .insert("pm.vbat".into(), (0..50).map(|i| on_grid(f64::from(i) / 7.0)).collect());
        let times = |i: usize| [flight.samples[i].time_s, flight.samples[i + 1].time_s];
        flight.gaps = vec![times(3), times(4), times(30)];
        flight.unlogged = [Quantity::Motors, Quantity::Design].into();
        for sample in &mut flight.samples {
            (sample.motors, sample.design_m) = ([0.0; 4], Vector3::zeros());
        }
        let mut file = Vec::new();
        flight.write_csv(&mut file).unwrap();
        let back = Flight::from_table(&Table::parse(&file[..], "flight.csv").unwrap()).unwrap();
        assert_eq!(back.warnings.len(), 2, "what is missing is said: {:?}", back.warnings);
        assert_eq!(Flight { warnings: vec![], ..back }, flight);
    }

    #[test]
    fn half_a_position_is_refused() {
        for broken in ["time_s,x_m,z_m\n0,1,2\n", "time_s\n0\n"] {
            let table = Table::parse(broken.as_bytes(), "f.csv").unwrap();
            assert!(Flight::from_table(&table).is_err(), "{broken}");
        }
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
