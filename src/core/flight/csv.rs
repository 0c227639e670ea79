//! Flights as CSV files, with one row per sample and SI units in the column names.
//!
//! Position, estimate and design are in the world frame. Velocity and rate are in the body frame.
//! If a real log lacks a quantity, all columns of that quantity are left out. Each light channel
//! has a column `light.<channel>`. A column `light` without a suffix contains the channel of the
//! headlights. `gap_before` is 1 in the first row after a gap, and appears only in files with gaps.
//! Columns with other names are kept as [`FlightData::extra`]. The simulator adds `saturated_s`
//! and, for a drone with a battery, `battery_v` and `energy_j`.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::Path;

use nalgebra::Vector3;

use super::table::{REWRITE_HINT, Table, write_table};
use super::{Flight, FlightData, FlightSample, Quantity, warning};
use crate::diagnostic::Diagnostic;
use crate::digest::Digest;
use crate::error::Result;
use crate::geometry::Attitude;
use crate::lamps::HEADLIGHTS;
use crate::product::MAX_QUANTITY;

/// Name of the column of times, which is the first column of a file.
const TIME: &str = "time_s";
/// Name of the column with the number of the current letter, from 1, or 0 outside letters.
const LETTER: &str = "letter";
/// Name of the column that is 1 in the first row after a gap.
const GAP: &str = "gap_before";
/// Name of the light level's column in simulators with one light.
const LIGHT: &str = "light";
/// Number of values in a sample, which are the time, those of [`Quantity::TABLE`] and the letter.
const N_NUMBERS: usize = 24;

impl Quantity {
    /// Returns the indices of the quantity's values in a sample.
    pub fn places(self) -> std::ops::Range<usize> {
        // The time precedes all quantities, and each but the last, the motors, has three values.
        let start = 1 + 3 * self as usize;
        start..start + Self::TABLE[self as usize].2.len()
    }
}

/// True if a column name has a predefined meaning, and is not available for further columns.
pub fn is_standard_column(name: &str) -> bool {
    [TIME, LETTER, GAP].contains(&name)
        || Quantity::TABLE.iter().any(|(.., columns)| columns.contains(&name))
        || name.starts_with("light.")
        || name == LIGHT
}

impl Flight {
    /// Writes the flight as CSV, with numbers rounded to multiples of 1e-6.
    ///
    /// # Errors
    ///
    /// Returns the errors of the writer.
    pub fn write_csv(&self, out: &mut impl Write) -> std::io::Result<()> {
        // The columns are the time, the quantities of the log, the letter, the lights, the gaps and
        // further columns. Their names are collected first, followed by the rows.
        let logged = || Quantity::TABLE.iter().filter(|(q, ..)| !self.unlogged.contains(q));
        let indices = logged().flat_map(|(quantity, ..)| quantity.places());
        let indices: Vec<usize> = [0].into_iter().chain(indices).chain([N_NUMBERS - 1]).collect();
        let after_gap = self.after_gap();
        let gap_column = (!self.gaps.is_empty()).then_some(&after_gap);
        let names = logged().flat_map(|(.., columns)| columns.iter());
        let standard = [&TIME].into_iter().chain(names).chain([&LETTER]);
        let mut header: Vec<String> = standard.map(|&name| name.to_owned()).collect();
        header.extend(self.lights.keys().map(|channel| format!("light.{channel}")));
        header.extend(gap_column.map(|_| GAP.to_owned()));
        header.extend(self.extra.keys().cloned());
        let rows = self.samples.iter().enumerate().map(|(row, sample)| {
            let all_numbers = sample.numbers();
            let numbers = indices.iter().map(move |&index| all_numbers[index]);
            let further = self.lights.values().chain(gap_column).chain(self.extra.values());
            numbers.chain(further.map(move |column| column[row]))
        });
        write_table(out, &header, rows)
    }

    /// Returns the SHA-256 of the contents of a flight file in hexadecimal.
    pub fn sha256(&self) -> String {
        // The digest covers the contents of the file in a fixed order.
        let mut digest = Digest::default();
        for quantity in &self.unlogged {
            digest.add(quantity.name());
        }
        for sample in &self.samples {
            digest.add_numbers(&sample.numbers());
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

    /// Returns the column of gaps for each sample, which is 1 in the first sample after a gap and 0
    /// in others.
    fn after_gap(&self) -> Vec<f64> {
        let mut gaps = self.gaps.iter().peekable();
        let flags = self.samples.iter().map(|sample| {
            let ends = gaps.next_if(|gap| gap[1] <= sample.time_s).is_some();
            f64::from(u8::from(ends))
        });
        flags.collect()
    }

    /// Reads a flight from a CSV file that [`Self::write_csv`] has written.
    ///
    /// If all columns of a quantity are missing, the flight receives a warning.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`](crate::error::Error::Io), or
    /// [`Error::Input`](crate::error::Error::Input) with line and column.
    pub fn read_csv(path: &Path) -> Result<Self> {
        Self::from_table(&Table::read(path)?)
    }

    /// Reads a flight from the text of its file. `file` is the file's name in messages.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`](crate::error::Error::Input), with the line and column, for a text
    /// that is not a flight.
    pub fn parse_csv(csv: &[u8], file: &str) -> Result<Self> {
        Self::from_table(&Table::parse(csv, file)?)
    }

    /// Converts the table of a flight file to a flight.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`](crate::error::Error::Input) with line and column.
    pub fn from_table(table: &Table) -> Result<Self> {
        let time_s = table.times_s(TIME)?;
        let title_notes = title_notes(table)?;
        let (samples, unlogged) = samples(table, time_s)?;
        check_whole(table, GAP, 1.0, "1 in the first row after a gap, else 0")?;
        // A file that has neither further columns nor any quantity is refused because its first
        // position column is missing.
        let lights = light_columns(table)?;
        let further = table.columns_after("").filter(|(name, _)| !is_standard_column(name));
        let extra: BTreeMap<_, _> =
            further.map(|(name, values)| (name.to_owned(), values.to_vec())).collect();
        if unlogged.len() == Quantity::TABLE.len() && extra.is_empty() {
            table.column(Quantity::TABLE[0].2[0])?;
        }
        let gaps = gaps(table.find(GAP).unwrap_or_default(), &samples);
        let notes = table.notes().iter().cloned().chain(title_notes);
        let notes = notes.map(|text| Diagnostic::warning("log", text));
        let warnings = warning::unlogged(&unlogged).into_iter().chain(notes).collect();
        Self::new(FlightData { samples, lights, extra, gaps, unlogged, warnings })
    }
}

/// Returns the samples of a flight file's table with the times `time_s`, and the quantities that
/// the file lacks. A quantity must have either all of its columns or none.
fn samples(table: &Table, time_s: &[f64]) -> Result<(Vec<FlightSample>, BTreeSet<Quantity>)> {
    // Each of a sample's values is looked up by its column's name, and is 0 without a column.
    let mut cells: [Option<&[f64]>; N_NUMBERS] = [None; N_NUMBERS];
    cells[0] = Some(time_s);
    let mut unlogged = BTreeSet::new();
    for (quantity, _, names) in Quantity::TABLE {
        if names.iter().any(|name| table.has(name)) {
            for (cell, name) in cells[quantity.places()].iter_mut().zip(names) {
                *cell = Some(table.quantity(name)?);
            }
        } else {
            unlogged.insert(quantity);
        }
    }
    cells[N_NUMBERS - 1] = table.has(LETTER).then(|| table.quantity(LETTER)).transpose()?;
    check_whole(table, LETTER, MAX_QUANTITY, "the number of a letter, or 0 outside letters")?;
    let samples = (0..time_s.len()).map(|row| {
        FlightSample::from_numbers(cells.map(|cell| cell.map_or(0.0, |column| column[row])))
    });
    Ok((samples.collect(), unlogged))
}

/// Returns the times of the samples before and after each gap, from the column that marks gaps.
fn gaps(flags: &[f64], samples: &[FlightSample]) -> Vec<[f64; 2]> {
    let pairs = samples.windows(2).zip(flags.iter().skip(1)).filter(|(_, flag)| **flag != 0.0);
    pairs.map(|(pair, _)| [pair[0].time_s, pair[1].time_s]).collect()
}

/// Returns notes on columns whose names resemble that of a standard column. The resemblance ignores
/// case and all characters except letters and digits. Returns an error if two columns have exactly
/// the same name.
fn title_notes(table: &Table) -> Result<Vec<String>> {
    fn bare(text: &str) -> String {
        text.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_lowercase()
    }

    let standard = Quantity::TABLE.iter().flat_map(|(.., names)| *names);
    let standard = standard.chain(&[LETTER, GAP, TIME]).map(|name| (*name, bare(name)));
    let standard: Vec<(&str, String)> = standard.collect();
    let (mut seen, mut notes) = (BTreeSet::new(), Vec::new());
    for (title, _) in table.columns_after("") {
        if !seen.insert(title) && !title.is_empty() {
            return Err(table.wrong(title, 1, "two columns with this name", "one", REWRITE_HINT));
        }
        let plain = bare(title);
        let is_light = title.to_lowercase().starts_with("light");
        let near = standard.iter().find(|(_, name)| *name == plain).map(|(name, _)| *name);
        let near = near.or(is_light.then_some("light.<channel>"));
        if let Some(near) = near.filter(|_| !is_standard_column(title)) {
            notes.push(format!(
                "column {title} is kept but not used, because its name is not exactly {near}"
            ));
        }
    }
    Ok(notes)
}

/// Checks that a column, if present, contains only whole numbers from 0 to `most`. `wanted`
/// describes such a number in the error.
fn check_whole(table: &Table, name: &str, most: f64, wanted: &str) -> Result<()> {
    let is_odd = |(_, value): &(_, &f64)| value.fract() != 0.0 || !(0.0..=most).contains(*value);
    match table.find(name).unwrap_or_default().iter().enumerate().find(is_odd) {
        None => Ok(()),
        Some((row, value)) => Err(table.wrong(name, table.line(row), value, wanted, REWRITE_HINT)),
    }
}

impl FlightSample {
    /// Returns the sample's values in the order of the file, which is time, quantities and letter.
    pub fn numbers(&self) -> [f64; N_NUMBERS] {
        let Attitude { yaw_rad, pitch_rad, roll_rad } = self.attitude;
        let vectors = [
            self.position_m,
            Vector3::new(yaw_rad, pitch_rad, roll_rad),
            self.velocity_body_m_s,
            self.rate_body_rad_s,
            self.estimate_m,
            self.design_m,
        ];
        let mut numbers = [0.0; N_NUMBERS];
        numbers[0] = self.time_s;
        for (cells, vector) in numbers[1..].chunks_exact_mut(3).zip(vectors) {
            cells.copy_from_slice(vector.as_slice());
        }
        numbers[Quantity::Motors.places()].copy_from_slice(&self.motors);
        numbers[N_NUMBERS - 1] = number_from_letter(self.letter);
        numbers
    }

    /// Creates a sample from its values in the order of the file, as [`Self::numbers`] returns
    /// them.
    pub fn from_numbers(n: [f64; N_NUMBERS]) -> Self {
        let vector = |place: usize| Vector3::from_column_slice(&n[place..place + 3]);
        Self {
            time_s: n[0],
            position_m: vector(1),
            attitude: Attitude { yaw_rad: n[4], pitch_rad: n[5], roll_rad: n[6] },
            velocity_body_m_s: vector(7),
            rate_body_rad_s: vector(10),
            estimate_m: vector(13),
            design_m: vector(16),
            motors: [n[19], n[20], n[21], n[22]],
            letter: letter_from_number(n[23]),
        }
    }
}

/// Returns the light columns of a table, `light.<channel>` or `light`, by channel, with levels
/// within 0..=1.
///
/// # Errors
///
/// Returns [`Error::Input`](crate::error::Error::Input) with the row of a level outside that range,
/// or if two columns are for the headlights.
pub fn light_columns(table: &Table) -> Result<BTreeMap<String, Vec<f64>>> {
    // The column `light` contains the headlights' channel, which must not appear under both names.
    let mut lights = BTreeMap::new();
    let bare = table.find(LIGHT).map(|levels| (HEADLIGHTS, levels));
    for (channel, levels) in table.columns_after("light.").chain(bare) {
        if let Some(row) = levels.iter().position(|level| !(0.0..=1.0).contains(level)) {
            let (name, wanted) = (format!("light.{channel}"), "a level from 0 (off) to 1");
            let hint = "1 is full brightness: divide bytes by 255";
            return Err(table.wrong(&name, table.line(row), levels[row], wanted, hint));
        }
        if lights.insert(channel.to_owned(), levels.to_vec()).is_some() {
            return Err(table.wrong(
                LIGHT,
                1,
                "two columns for the headlights",
                "one",
                REWRITE_HINT,
            ));
        }
    }
    Ok(lights)
}

/// Returns a letter's number in the file, from 1, for its index, or 0 outside letters.
pub fn number_from_letter(letter: Option<usize>) -> f64 {
    letter.map_or(0.0, |index| index as f64 + 1.0)
}

/// Returns a letter's index for its number in the file, or `None` for 0 (outside letters).
pub fn letter_from_number(number: f64) -> Option<usize> {
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    (number >= 1.0).then(|| number as usize - 1)
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
        Flight::made(FlightData { samples, lights, ..FlightData::default() })
    }

    #[test]
    fn the_digest_sees_the_last_digit_of_any_number() {
        let flight = flight();
        let digest = flight.sha256();
        assert_eq!(digest, flight.clone().sha256(), "the same flight");
        let mut moved = flight.clone();
        moved.edit(|data| data.samples[7].position_m.y += 1e-6);
        let mut darker = flight.clone();
        darker.edit(|data| data.lights.get_mut("headlights").unwrap()[3] = 0.5);
        let mut silent = flight.clone();
        silent.edit(|data| data.unlogged = [Quantity::Motors].into());
        for other in [moved, darker, silent] {
            assert_ne!(other.sha256(), digest);
        }
    }

    fn read_back(flight: &Flight) -> Flight {
        let mut file = Vec::new();
        flight.write_csv(&mut file).unwrap();
        Flight::from_table(&Table::parse(&file[..], "flight.csv").unwrap()).unwrap()
    }

    #[test]
    fn a_flight_reads_back_bit_by_bit() {
        let flight = flight();
        assert_eq!(read_back(&flight), flight);
        let mut flight = flight.into_data();
        let voltage = (0..50).map(|i| on_grid(f64::from(i) / 7.0)).collect();
        flight.extra.insert("pm.vbat".into(), voltage);
        let times = |i: usize| [flight.samples[i].time_s, flight.samples[i + 1].time_s];
        flight.gaps = vec![times(3), times(4), times(30)];
        flight.unlogged = [Quantity::Motors, Quantity::Design].into();
        for sample in &mut flight.samples {
            (sample.motors, sample.design_m) = ([0.0; 4], Vector3::zeros());
        }
        let mut back = read_back(&Flight::made(flight.clone())).into_data();
        let warnings = std::mem::take(&mut back.warnings);
        assert_eq!(warnings, [warning::unlogged(&flight.unlogged).unwrap()]);
        assert_eq!(back, flight, "gaps, extra columns, unlogged");
    }

    proptest::proptest! {
        #![proptest_config(proptest::prelude::ProptestConfig::with_cases(64))]

        /// An unreadable value that would change the flight causes an error that names it.
        #[test]
        fn what_a_flight_file_should_not_have_is_named(which in 0..26_usize, kind in 0..4_usize) {
            let mut file = Vec::new();
            flight().write_csv(&mut file).unwrap();
            let text = String::from_utf8(file).unwrap();
            let (head, rows) = text.split_once('\n').unwrap();
            let titles: Vec<&str> = head.split(',').collect();
            let title = titles[which % titles.len()];
            let with = |name: &str, cell: &str| {
                let rows = rows.lines().map(|row| format!("{row},{cell}\n")).collect::<String>();
                format!("{head},{name}\n{rows}")
            };
            let odd = match (kind, title) {
                (0, _) => with(title, "0"),
                (1, _) => with(&title.to_uppercase(), "0"),
                (2, "letter" | "light.headlights") => {
                    let place = titles.iter().position(|other| *other == title).unwrap();
                    let mut cells: Vec<&str> = rows.lines().next().unwrap().split(',').collect();
                    cells[place] = "7.5";
                    format!("{head}\n{}\n", cells.join(","))
                }
                (2, _) => text.replacen(title, &format!("{title}m"), 1),
                _ => with("gap_before", "0.5"),
            };
            let name = if kind == 3 { "gap_before" } else { title };
            match Flight::parse_csv(odd.as_bytes(), "f.csv") {
                Ok(flight) => {
                    let said: String = flight.warnings.iter().map(ToString::to_string).collect();
                    let named = said.to_lowercase().contains(&name.to_lowercase());
                    proptest::prop_assert!(named, "{name}: {said}");
                }
                Err(error) => proptest::prop_assert!(
                    error.to_string().contains(name) || error.to_string().contains("light."),
                    "{name}: {error}"
                ),
            }
        }
    }

    #[test]
    fn half_a_position_and_a_light_level_out_of_range_are_refused() {
        for (broken, place) in [
            ("time_s,x_m,z_m\n0,1,2\n", "y_m"),
            ("time_s\n0\n", "x_m"),
            (
                "time_s,x_m,y_m,z_m,light.headlights\n0,1,2,3,7\n",
                "2: column light.headlights: found 7",
            ),
            ("time_s,x_m,y_m,z_m,light\n0,1,2,3,7\n", "light.headlights"),
            ("time_s,x_m,y_m,z_m,light,light.headlights\n0,1,2,3,1,1\n", "two columns"),
        ] {
            let table = Table::parse(broken.as_bytes(), "f.csv").unwrap();
            let error = Flight::from_table(&table).unwrap_err().to_string();
            assert!(error.contains(place), "{broken}: {error}");
        }
    }
}
