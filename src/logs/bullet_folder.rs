//! Reads folders of gym-pybullet-drones, which contain one file per variable. Each file has two
//! columns without a header: the time in s and the value.
//!
//! Source: `Logger.save_as_csv` in `gym_pybullet_drones/utils/Logger.py` (2.1.0), which writes
//! `x0.csv`, `y0.csv` … for drone 0. Linear and angular velocities are in the world frame of
//! `PyBullet`. Angular velocities, derivatives of the angles and rotor speeds are kept as extra
//! columns. There are no setpoints or lights.

use std::path::{Path, PathBuf};

use super::recording::{Block, Column, Recording, shortened};
use super::{Job, cells};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Head, Text, entries_in, file_name};

/// Files of such a folder, without extension, and this program's names for their variables. The
/// first three files identify such a folder.
const NAMES: [(&str, &str); 12] = [
    ("x", "x_m"),
    ("y", "y_m"),
    ("z", "z_m"),
    ("r", "roll_rad"),
    ("p", "pitch_rad"),
    ("ya", "yaw_rad"),
    ("vx", "vx_world_m_s"),
    ("vy", "vy_world_m_s"),
    ("vz", "vz_world_m_s"),
    ("wx", "wx_world_rad_s"),
    ("wy", "wy_world_rad_s"),
    ("wz", "wz_world_rad_s"),
];

/// File of one variable.
pub(super) struct Variable {
    path: PathBuf,
    name: String,
    /// Number of the drone.
    drone: usize,
}

/// Returns the variables in a folder, or `None` if the folder has a different origin.
///
/// # Errors
///
/// Returns [`Error::Io`] if the folder cannot be read.
pub(super) fn variables(folder: &Path) -> Result<Option<Vec<Variable>>> {
    let variables = entries_in(folder)?.into_iter().filter_map(|path| {
        let (name, drone) = variable(path.file_name()?.to_str()?.strip_suffix(".csv")?)?;
        Some(Variable { path, name, drone })
    });
    let variables: Vec<Variable> = variables.collect();
    let has = |name: &str| variables.iter().any(|variable| variable.name == name);
    Ok(NAMES[..3].iter().all(|(name, _)| has(name)).then_some(variables))
}

/// Splits a name such as `vx0` or `rpm3-0` into the variable and the drone's number. Returns `None`
/// for names without a number.
fn variable(stem: &str) -> Option<(String, usize)> {
    let name = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    let number = stem[name.len()..].parse().ok()?;
    let name = name.strip_suffix('-').unwrap_or(name);
    (!name.is_empty()).then(|| (name.to_owned(), number))
}

/// Reads the files of a folder as one recording, with warnings that name the origin and other files
/// in the folder.
///
/// # Errors
///
/// Returns [`Error::Input`] for files of several drones, for a file that is not a variable, and for
/// files with different times.
pub(super) fn read(variables: &[Variable], job: Job<'_>) -> Result<Recording> {
    let drone = variables[0].drone;
    if let Some(other) = variables.iter().find(|variable| variable.drone != drone) {
        let actual = format!("files of drone {drone} and {}", other.path.display());
        let hint = "copy the files of each drone to a separate folder, and import each folder";
        return Err(Error::input(job.file, actual, "one drone", hint));
    }
    // All files must contain the same times as the first one.
    let mut block = Block { name: "bullet".into(), ..Block::default() };
    for Variable { path, name, .. } in variables {
        let [time_s, values] = columns(path, job)?;
        if block.columns.is_empty() {
            block.time_s = time_s;
        } else if block.time_s != time_s {
            let hint = "export the folder again, so that its files belong to one flight";
            let actual = "times that differ from those in the files before it";
            return Err(Error::input(path.display(), actual, "the same times", hint));
        }
        let listed = NAMES.iter().find(|(listed, _)| listed == name);
        let title = listed.map_or(name.as_str(), |(_, title)| *title);
        block.columns.push(Column::new(title.to_owned(), values));
    }
    let mut log = Recording { blocks: vec![block], ..Recording::new(job.file) };
    log.warn("read-as", "read as a folder of gym-pybullet-drones, with one file for each variable");
    let is_read = |path: &PathBuf| variables.iter().any(|variable| variable.path == *path);
    let others = entries_in(Path::new(job.file))?.into_iter().filter(|path| !is_read(path));
    let others: Vec<String> = others.map(|path| file_name(&path)).collect();
    if !others.is_empty() {
        let others = shortened(&others);
        log.warn("not-read", format!("not read, because they are not variables: {others}"));
    }
    Ok(log)
}

/// Reads the times in s and the values from a variable's file. Returns [`Error::Input`] for a file
/// with titles or with other than two columns.
fn columns(path: &Path, job: Job<'_>) -> Result<[Vec<f64>; 2]> {
    let file = path.display().to_string();
    let bytes = super::read(path)?;
    job.budget.bytes(bytes.len())?;
    job.budget.steps(bytes.len())?;
    let text = Text::decode(&bytes);
    let mut head = Head::find(&text.bytes);
    // Any other file would have titles or additional columns.
    if head.n_columns != 2 || !head.titles.is_empty() {
        let actual = format!("{} columns, titles {:?}", head.n_columns, head.titles);
        let hint = "remove the files that are not variables of the simulator from the folder";
        return Err(Error::input(file, actual, "rows of time and value, without a header", hint));
    }
    head.titles = ["t", "value"].map(str::to_owned).into();
    let (sheet, _) = cells::read_rows(&text, head, Job { file: &file, ..job }, |_| true)?;
    job.budget.free(bytes.len() as u64);
    let mut columns = sheet.columns.into_iter().map(|column| column.values);
    Ok([(); 2].map(|()| columns.next().unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use crate::{ImportOptions, import, is_one_log};
    use noctograph_core::flight::Quantity;

    #[test]
    fn a_file_for_each_variable_is_one_flight_and_two_drones_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, value: &dyn Fn(f64) -> f64| {
            let rows = (0..300).map(|row| f64::from(row) / 48.0);
            let text: String = rows.map(|t| format!("{t:.18e},{:.18e}\n", value(t))).collect();
            std::fs::write(folder.path().join(name), text).unwrap();
        };
        write("x0.csv", &|t| 0.1 * t);
        write("y0.csv", &|_| 0.0);
        write("z0.csv", &|t| (0.5 * t).min(1.0));
        for (name, slope) in [("r0", 0.01), ("p0", -0.02), ("ya0", 0.0), ("vx0", 0.0)] {
            write(&format!("{name}.csv"), &|t| slope * t);
        }
        write("rpm1-0.csv", &|t| 14_000.0 + t);
        assert!(is_one_log(folder.path()).unwrap());
        let flight = import(folder.path(), &ImportOptions::default()).unwrap();
        let sample = flight.samples[200];
        assert!((sample.position_m.x - 0.1 * sample.time_s).abs() < 1e-5, "{sample:?}");
        assert!((sample.attitude.pitch_rad + 0.02 * sample.time_s).abs() < 1e-5, "{sample:?}");
        assert!(flight.has(Quantity::Attitude) && !flight.has(Quantity::Design));
        assert!(flight.extra.contains_key("rpm1"), "{:?}", flight.extra.keys());
        write("x1.csv", &|t| t);
        let error = import(folder.path(), &ImportOptions::default()).unwrap_err().to_string();
        assert!(error.contains("x1.csv") && error.contains("one drone"), "{error}");
    }
}
