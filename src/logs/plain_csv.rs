//! Plain CSV: t, x, y, z and whatever else, under the names people give them.
//!
//! Also the record of crazyswarm2's simulation (`timestamp,x,y,z,qw,qx,qy,qz`), and files without a
//! header (t, x, y, z). Names may carry their unit (`x_mm`, `yaw_deg`, `t_ms`, `x [m]`); without
//! one, metres, seconds and radians are meant, unless the numbers cannot be that.

use super::recording::{Block, Column, Recording};
use super::sheet::Sheet;
use crate::error::{Error, Result};
use crate::statistics::median;

/// Names of the columns where a file has no header.
const UNNAMED: [&str; 4] = ["t", "x", "y", "z"];

/// Our name of a column, and the names (lower case, without unit) that mean it.
const NAMES: [(&str, &[&str]); 28] = [
    ("t", &["t", "time", "timestamp", "stamp", "seconds", "sec"]),
    ("x_m", &["x", "px", "p_x", "pos_x", "position_x", "x_pos"]),
    ("y_m", &["y", "py", "p_y", "pos_y", "position_y", "y_pos"]),
    ("z_m", &["z", "pz", "p_z", "pos_z", "position_z", "z_pos", "height"]),
    ("yaw_rad", &["yaw", "psi"]),
    ("pitch_rad", &["pitch", "theta"]),
    ("roll_rad", &["roll", "phi"]),
    ("qw", &["qw", "q_w"]),
    ("qx", &["qx", "q_x"]),
    ("qy", &["qy", "q_y"]),
    ("qz", &["qz", "q_z"]),
    ("vx_world_m_s", &["vx", "v_x", "vel_x"]),
    ("vy_world_m_s", &["vy", "v_y", "vel_y"]),
    ("vz_world_m_s", &["vz", "v_z", "vel_z"]),
    ("vx_body_m_s", &["vx_body"]),
    ("vy_body_m_s", &["vy_body"]),
    ("vz_body_m_s", &["vz_body"]),
    ("wx_body_rad_s", &["wx", "w_x", "wx_body"]),
    ("wy_body_rad_s", &["wy", "w_y", "wy_body"]),
    ("wz_body_rad_s", &["wz", "w_z", "wz_body"]),
    ("x_design_m", &["x_design", "x_des", "x_d", "xd", "x_ref", "x_sp", "x_setpoint"]),
    ("y_design_m", &["y_design", "y_des", "y_d", "yd", "y_ref", "y_sp", "y_setpoint"]),
    ("z_design_m", &["z_design", "z_des", "z_d", "zd", "z_ref", "z_sp", "z_setpoint"]),
    ("m1", &["m1", "m_1", "motor1"]),
    ("m2", &["m2", "m_2", "motor2"]),
    ("m3", &["m3", "m_3", "motor3"]),
    ("m4", &["m4", "m_4", "motor4"]),
    ("row", &["index", "row", ""]),
];

/// Endings that are units, the longest first, and their size in SI units.
const UNITS: [(&str, f64); 14] = [
    ("_rad_s", 1.0),
    ("_deg_s", std::f64::consts::PI / 180.0),
    ("_mm_s", 1e-3),
    ("_m_s", 1.0),
    ("_rad", 1.0),
    ("_deg", std::f64::consts::PI / 180.0),
    ("_mm", 1e-3),
    ("_cm", 1e-2),
    ("_ms", 1e-3),
    ("_us", 1e-6),
    ("_ns", 1e-9),
    ("_sec", 1.0),
    ("_m", 1.0),
    ("_s", 1.0),
];

/// Reads a plain CSV file.
///
/// # Errors
///
/// [`Error::Input`] with line and column of a cell that is no number, or where there is no column
/// of times.
pub(super) fn read(text: &[u8], file: &str) -> Result<Recording> {
    let Sheet { header, columns, mut warnings } = Sheet::read(text, file, &UNNAMED)?;
    let (mut time_s, mut named) = (None, Vec::new());
    for (title, mut values) in header.iter().zip(columns) {
        let (name, factor) = meaning(title);
        if name == "t" && time_s.is_none() {
            let unit_s = factor.unwrap_or_else(|| seconds_per_unit(title, &values));
            if factor.is_none() && unit_s != 1.0 {
                warnings.push(format!("column {title}: taken as {unit_s} s a unit"));
            }
            time_s = Some(values.into_iter().map(|t| t * unit_s).collect::<Vec<f64>>());
            continue;
        }
        for value in &mut values {
            *value *= factor.unwrap_or(1.0);
        }
        let angle = ["yaw_rad", "pitch_rad", "roll_rad"].contains(&name);
        named.push((Column { name: name.to_owned(), values }, angle && factor.is_none()));
    }
    let Some(time_s) = time_s else {
        let place = format!("{file}:1");
        let wanted = "a column of times (t, time, time_s, timestamp, t_ms …)";
        return Err(Error::input(place, header.join(","), wanted, "name the column of times t"));
    };
    degrees(&mut named, &mut warnings);
    let columns = named.into_iter().map(|(column, _)| column).collect();
    let block = Block { name: "csv".into(), time_s, columns, ..Block::default() };
    Ok(Recording { file: file.to_owned(), blocks: vec![block], warnings, ..Recording::default() })
}

/// Our name of a title, and the size of its unit where it names one; a title that means nothing
/// to us stays as it is.
fn meaning(title: &str) -> (&str, Option<f64>) {
    let lower = title.to_lowercase().replace(['[', '(', ' '], "_").replace([']', ')'], "");
    let mut lower = lower.replace('/', "_");
    while lower.contains("__") {
        lower = lower.replace("__", "_");
    }
    let known =
        |name: &str| NAMES.iter().find(|(_, names)| names.contains(&name)).map(|(ours, _)| *ours);
    if let Some(ours) = known(&lower) {
        return (ours, None);
    }
    let units = UNITS.iter().filter_map(|(end, factor)| Some((lower.strip_suffix(end)?, *factor)));
    let mut meant = units.filter_map(|(name, factor)| Some((known(name)?, Some(factor))));
    meant.next().unwrap_or((title, None))
}

/// Angles without a unit that go beyond a full turn are degrees.
fn degrees(columns: &mut [(Column, bool)], warnings: &mut Vec<String>) {
    let beyond = |value: &f64| value.abs() > std::f64::consts::TAU;
    if !columns.iter().any(|(column, open)| *open && column.values.iter().any(beyond)) {
        return;
    }
    warnings.push("yaw, pitch and roll go beyond a full turn of 2π: taken as degrees".into());
    for (column, _) in columns.iter_mut().filter(|(_, open)| *open) {
        for value in &mut column.values {
            *value = value.to_radians();
        }
    }
}

/// Size of the unit of a column of times whose name does not tell: whole numbers in steps of one
/// or more are ms (no log is that slow), in steps of a thousand or more µs.
pub(super) fn seconds_per_unit(title: &str, stamps: &[f64]) -> f64 {
    let lower = title.to_lowercase();
    if let Some((_, factor)) = UNITS.iter().find(|(end, _)| lower.ends_with(end)) {
        return *factor;
    }
    let steps = stamps.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
    let whole = stamps.iter().filter(|t| t.is_finite()).all(|t| t.fract() == 0.0);
    match median(steps) {
        Some(step) if whole && step >= 1000.0 => 1e-6,
        Some(step) if whole && step > 1.0 => 1e-3,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str, name: &str) -> f64 {
        read(text.as_bytes(), "f.csv").unwrap().channel(name).unwrap().values[0]
    }

    #[test]
    fn names_and_units_are_understood() {
        assert_eq!(value("t,x,y,z\n0,1,2,3\n", "y_m"), 2.0);
        assert_eq!(value("time [s],X [mm],yaw_deg\n0,500,180\n", "x_m"), 0.5);
        assert_eq!(value("t_ms,yaw_deg\n0,180\n", "yaw_rad"), std::f64::consts::PI);
        assert_eq!(value("0,1,2,3\n1,2,3,4\n", "z_m"), 3.0);
        assert_eq!(value("timestamp,x,y,z,qw,qx,qy,qz\n0,1,2,3,1,0,0,0\n", "qw"), 1.0);
        assert_eq!(value("t,x,colour\n0,1,7\n", "colour"), 7.0);
    }

    #[test]
    fn stamps_in_ms_and_angles_in_degrees_are_found_out() {
        let log = read(b"t,yaw\n0,10\n20,20\n40,30\n", "f.csv").unwrap();
        assert_eq!(log.blocks[0].time_s, [0.0, 0.02, 0.04]);
        assert_eq!(log.channel("yaw_rad").unwrap().values[0], 10_f64.to_radians());
        assert_eq!(log.warnings.len(), 2, "both are said: {:?}", log.warnings);
    }
}
