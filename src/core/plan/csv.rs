//! Plans as CSV files, with one row per setpoint and SI units in the column names.

use std::io::Write;
use std::path::Path;

use nalgebra::Vector3;

use super::{Plan, PlanData, Setpoint};
use crate::error::{Error, Result};
use crate::flight::csv::{letter_from_number, light_columns, number_from_letter};
use crate::flight::table::{Table, write_table};

/// Columns of a plan file, followed by one column `light.<channel>` for each light channel.
///
/// Positions and their derivatives are in the world frame. `letter` is 1 for the first letter of
/// the word and 0 outside letters. Feedforward adds `x_sent_m`, `y_sent_m` and `z_sent_m`. An
/// onboard trajectory adds `jx_m_s3` to `jz_m_s3`. Timed light commands add `lit` before the light
/// channels. A heading other than 0 adds `yaw_rad`, which is the same in all rows.
pub const COLUMNS: [&str; 11] = [
    "time_s", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "ax_m_s2", "ay_m_s2", "az_m_s2",
    "letter",
];

/// Columns of the positions that are sent, if these differ from the design.
const SENT_COLUMNS: [&str; 3] = ["x_sent_m", "y_sent_m", "z_sent_m"];
/// Columns of the jerk of an onboard trajectory.
const JERK_COLUMNS: [&str; 3] = ["jx_m_s3", "jy_m_s3", "jz_m_s3"];
/// Column of the design's light level, if light commands are sent ahead of it.
const LIT_COLUMN: &str = "lit";
/// Column of the heading.
const YAW_COLUMN: &str = "yaw_rad";

impl Plan {
    /// Writes the plan as CSV, with numbers rounded to multiples of 1e-6. Columns that the plan
    /// does not use are left out.
    ///
    /// # Errors
    ///
    /// Returns the errors of the writer.
    pub fn write_csv(&self, out: &mut impl Write) -> std::io::Result<()> {
        // The names of the columns are collected first, followed by the rows in the same order.
        let lights = self.lights.keys().map(|channel| format!("light.{channel}"));
        let sent = SENT_COLUMNS.iter().filter(|_| !self.sent_m.is_empty());
        let jerk = JERK_COLUMNS.iter().filter(|_| !self.jerk_m_s3.is_empty());
        let lit = Some(&LIT_COLUMN).filter(|_| !self.lit.is_empty());
        let yaw = Some(&YAW_COLUMN).filter(|_| self.yaw_rad != 0.0);
        let names = COLUMNS.iter().chain(sent).chain(jerk).chain(lit).chain(yaw);
        let names = names.map(|name| (*name).to_owned());
        let header: Vec<String> = names.chain(lights).collect();
        let rows = self.setpoints.iter().enumerate().map(|(row, setpoint)| {
            let Setpoint { time_s, position_m: p, velocity_m_s: v, .. } = setpoint;
            let a = &setpoint.acceleration_m_s2;
            let letter = number_from_letter(setpoint.letter);
            let numbers = [*time_s, p.x, p.y, p.z, v.x, v.y, v.z, a.x, a.y, a.z, letter];
            let further = [&self.sent_m, &self.jerk_m_s3].map(|column| column.get(row));
            let further = further.into_iter().flatten().flat_map(|v| [v.x, v.y, v.z]);
            let lights = self.lights.values().map(move |levels| levels[row]);
            let lit = self.lit.get(row).copied();
            let yaw = Some(self.yaw_rad).filter(|yaw_rad| *yaw_rad != 0.0);
            numbers.into_iter().chain(further).chain(lit).chain(yaw).chain(lights)
        });
        write_table(out, &header, rows)
    }

    /// Reads a plan from a CSV file that [`Self::write_csv`] has written.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`], or [`Error::Input`] with line and column.
    pub fn read_csv(path: &Path) -> Result<Self> {
        Self::from_table(&Table::read(path)?)
    }

    /// Reads a plan from the text of its file. `file` is the file's name in messages.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] with line and column.
    pub fn parse_csv(csv: &[u8], file: &str) -> Result<Self> {
        Self::from_table(&Table::parse(csv, file)?)
    }

    /// Converts the table of a plan file to a plan. Returns an error for a missing or invalid
    /// column. A table with notes is refused, because the program never writes a plan that causes
    /// notes.
    fn from_table(table: &Table) -> Result<Self> {
        if let Some(note) = table.notes().first() {
            let (wanted, hint) =
                ("a plan in the program's format", "write the plan with the program");
            return Err(Error::input("text", note, wanted, hint));
        }
        // Times may be Unix timestamps, but other quantities must be within the range of a drone.
        table.times_s(COLUMNS[0])?;
        let columns = COLUMNS.map(|name| match name {
            "time_s" => table.column(name),
            name => table.quantity(name),
        });
        let columns = columns.into_iter().collect::<Result<Vec<_>>>()?;
        let setpoints = (0..table.n_rows()).map(|row| {
            let [time_s, x, y, z, vx, vy, vz, ax, ay, az, letter] =
                std::array::from_fn(|column| columns[column][row]);
            Setpoint {
                time_s,
                position_m: Vector3::new(x, y, z),
                velocity_m_s: Vector3::new(vx, vy, vz),
                acceleration_m_s2: Vector3::new(ax, ay, az),
                letter: letter_from_number(letter),
            }
        });
        let setpoints = setpoints.collect();
        // Optional columns are read last.
        let yaw_rad = heading_rad(table)?;
        Self::new(PlanData {
            setpoints,
            lights: light_columns(table)?,
            lit: optional_column(table, LIT_COLUMN)?,
            sent_m: optional_vectors(table, SENT_COLUMNS)?,
            jerk_m_s3: optional_vectors(table, JERK_COLUMNS)?,
            yaw_rad,
        })
    }
}

/// Returns the heading in rad, or 0 if its column is missing. Returns an error if it changes.
fn heading_rad(table: &Table) -> Result<f64> {
    let yaws_rad = optional_column(table, YAW_COLUMN)?;
    let yaw_rad = yaws_rad.first().copied().unwrap_or_default();
    match yaws_rad.iter().find(|other| **other != yaw_rad) {
        None => Ok(yaw_rad),
        Some(other) => {
            let wanted = format!("{yaw_rad} as in the first row, because a plan has one heading");
            Err(Error::input(
                YAW_COLUMN,
                other,
                wanted,
                "place the drone on the floor with the heading of the flight",
            ))
        }
    }
}

/// Returns the column of a quantity, or an empty list if the table lacks the column.
fn optional_column(table: &Table, name: &str) -> Result<Vec<f64>> {
    if table.has(name) { table.quantity(name).map(<[f64]>::to_vec) } else { Ok(Vec::new()) }
}

/// Returns three columns as a vector for each row, or an empty list if the table lacks the first.
/// Returns an error if one of the others is missing.
fn optional_vectors(table: &Table, names: [&str; 3]) -> Result<Vec<Vector3<f64>>> {
    if !table.has(names[0]) {
        return Ok(Vec::new());
    }
    let [x, y, z] = names.map(|name| table.quantity(name));
    let (x, y, z) = (x?, y?, z?);
    Ok((0..table.n_rows()).map(|row| Vector3::new(x[row], y[row], z[row])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_reads_back_bit_by_bit() {
        fn written(plan: &Plan) -> Vec<u8> {
            let mut file = Vec::new();
            plan.write_csv(&mut file).unwrap();
            file
        }
        let setpoints = (0..4).map(|step| Setpoint {
            time_s: 0.25 * f64::from(step),
            position_m: Vector3::new(0.125 * f64::from(step), -0.5, 1e-6),
            velocity_m_s: Vector3::new(0.4, 0.0, -0.125),
            acceleration_m_s2: Vector3::new(0.0, 1.5, 0.0),
            letter: usize::try_from(step - 1).ok(),
        });
        let setpoints: Vec<Setpoint> = setpoints.collect();
        let lights = [("headlights".to_owned(), vec![0.0, 1.0, 0.5, 0.0])].into();
        let plan = PlanData { setpoints, lights, ..PlanData::default() };
        let n = plan.setpoints.len();
        let led = PlanData {
            lit: vec![0.5; n],
            sent_m: vec![Vector3::x(); n],
            jerk_m_s3: vec![Vector3::new(0.5, -2.0, 0.25); n],
            yaw_rad: -1.5,
            ..plan.clone()
        };
        let [plan, led] = [plan, led].map(Plan::made);
        for plan in [plan, led.clone()] {
            assert_eq!(Plan::parse_csv(&written(&plan), "plan.csv").unwrap(), plan);
        }
        let turning = String::from_utf8(written(&led)).unwrap().replacen("-1.5", "-1.25", 1);
        let error = Plan::parse_csv(turning.as_bytes(), "plan.csv").unwrap_err().to_string();
        assert!(error.contains("one heading"), "{error}");
    }
}
