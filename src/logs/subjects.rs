//! Subjects in titles: identifies a position whose columns are named after a subject (`drone_x`,
//! `tracker_x`) or after compass directions (`PN`, `PE`, `PD`).
//!
//! A subject's columns are read if no other column is a position and if exactly one known subject
//! has all three of them. A table with several subjects, or with an unknown one, is refused,
//! because its position would be missing.

use std::collections::BTreeMap;

use super::Axes;
use super::recording::{Column, Recording};
use super::sources::is_position;
use super::titles::{Title, in_si_units};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{simplified, unit};

/// Known subjects: names of vehicles, tracked bodies, and position sources.
const SUBJECTS: &str = "drone uav quad quadrotor quadcopter copter multirotor crazyflie cf vehicle \
    aircraft robot agent body base base_link baselink rigid_body rigidbody rb object tracker marker \
    center com cog odom odometry local local_position world pose measured measurement meas vicon \
    optitrack mocap qualisys vive lighthouse uwb lps dwm kalman ekf ekf2 filtered fused slam vio \
    state current position pos global self ego actual";

/// Titles of positions in compass directions, with or without a unit, and their axes.
const COMPASS: [(&str, Axes); 8] = [
    ("pn pe pd", Axes::ZDown),
    ("pos_n pos_e pos_d", Axes::ZDown),
    ("x_ned y_ned z_ned", Axes::ZDown),
    ("north east down", Axes::ZDown),
    ("n e d", Axes::ZDown),
    ("east north up", Axes::ZUp),
    ("e n u", Axes::ZUp),
    ("x_enu y_enu z_enu", Axes::ZUp),
];

/// Units that may follow a compass direction. In contrast, `north_m_s` is a velocity.
const LENGTHS: &str = "m meter meters cm mm ft feet";

/// Parts of names which indicate that a column is not a position.
const OTHERS: &str = "acc accel acceleration gyro gyr mag magnetometer magnetic vel velocity speed \
    linear angular rate rates omega force torque thrust target goal ref reference cmd command des \
    desired sp setpoint set error err bias cov covariance var variance std sigma imu quat rot wind \
    dir axis jerk moment current_a gravity lin ang joy stick rc light led color integral pid";

/// Standard names of a position's columns.
const POSITION: [&str; 3] = ["x_m", "y_m", "z_m"];

/// Renames the columns of a position given by a subject or by compass directions, unless another
/// column is already a position. Returns [`Error::Input`] for several subjects.
pub(super) fn resolve(log: &mut Recording, columns: &mut [Column]) -> Result<()> {
    if POSITION.iter().any(|name| has(columns, name))
        || columns.iter().any(|column| is_position(&column.name))
    {
        return Ok(());
    }
    // Compass directions are tried first, because they are less ambiguous than a subject.
    let renamed = match compass_position(columns) {
        Some((renamed, axes)) => {
            (log.axes, log.in_format) = (axes, Some("a table of north, east and down"));
            if axes == Axes::ZUp {
                log.in_format = Some("a table of east, north and up");
            }
            renamed
        }
        None => subject_position(columns).map_err(|error| error.in_file(&log.file, None))?,
    };
    let mut named = Vec::new();
    for (index, title) in renamed {
        if has(columns, &title.name) {
            continue;
        }
        let Column { name, values, .. } = &mut columns[index];
        named.push(format!("{name} as {}", title.name));
        columns[index] = in_si_units(title.name, title.unit, std::mem::take(values));
    }
    if !named.is_empty() {
        let text =
            format!("columns are named by the last part of their titles: {}", named.join(", "));
        log.warn("columns-by-part", text);
    }
    Ok(())
}

/// Indices of columns, with their new titles.
type Renamed = Vec<(usize, Title)>;

/// True if there is a column with this name.
fn has(columns: &[Column], name: &str) -> bool {
    columns.iter().any(|column| column.name == name)
}

/// Returns the columns of a position in compass directions, and its axes. Returns `None` if one of
/// them is missing.
fn compass_position(columns: &[Column]) -> Option<(Renamed, Axes)> {
    COMPASS.iter().find_map(|(names, axes)| {
        let parts = names.split(' ').zip(POSITION).map(|(direction, name)| {
            let (index, unit) = columns
                .iter()
                .enumerate()
                .find_map(|(index, column)| Some((index, unit_after(direction, &column.name)?)))?;
            let name = name.to_owned();
            Some((index, Title { name, is_known: true, unit, ..Title::default() }))
        });
        Some((parts.collect::<Option<_>>()?, *axes))
    })
}

/// Returns the unit in m of a title that is a name, or `Some(None)` if the name has no unit.
/// Returns `None` for other titles.
fn unit_after(name: &str, title: &str) -> Option<Option<f64>> {
    let title = simplified(title);
    let rest = title.strip_prefix(name)?;
    let length = rest.strip_prefix('_').filter(|rest| LENGTHS.split(' ').any(|unit| unit == *rest));
    if rest.is_empty() { Some(None) } else { Some(unit(length?, false)) }
}

/// Returns the columns of the only known subject with a position, or none if no subject has one.
/// Returns [`Error::Input`] for several known subjects, and for only unknown ones.
fn subject_position(columns: &[Column]) -> Result<Renamed> {
    let mut subjects: BTreeMap<String, Renamed> = BTreeMap::new();
    for (index, column) in columns.iter().enumerate() {
        if let Some((subject, title)) = split_subject(&column.name) {
            subjects.entry(subject).or_default().push((index, title));
        }
    }
    // Another known subject counts as a second body even if only part of its position is present.
    subjects.retain(|subject, parts| {
        let n = n_coordinates(parts);
        n == POSITION.len() || n > 0 && is_known(subject)
    });
    if !subjects.values().any(|parts| n_coordinates(parts) == POSITION.len()) {
        return Ok(Vec::new());
    }
    let mut known_subjects = subjects.iter().filter(|(subject, _)| is_known(subject));
    if let (Some((_, parts)), None) = (known_subjects.next(), known_subjects.next())
        && n_coordinates(parts) == POSITION.len()
    {
        return Ok(parts.clone());
    }
    let parts = subjects.values().flatten();
    let parts = parts.filter(|(_, title)| POSITION.contains(&&*title.name));
    let names: Vec<&str> = parts.map(|(index, _)| &*columns[*index].name).collect();
    let hint = "name the columns of the drone's position x, y and z";
    let wanted = "the position of one drone, in columns with known names";
    Err(Error::input("columns", format!("the columns {}", names.join(", ")), wanted, hint))
}

/// True for one of [`SUBJECTS`], with or without a number.
fn is_known(subject: &str) -> bool {
    let plain = simplified(subject);
    let plain = plain.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_');
    SUBJECTS.split(' ').any(|subject| subject == plain)
}

/// Returns the number of position coordinates among new titles.
fn n_coordinates(parts: &[(usize, Title)]) -> usize {
    POSITION.iter().filter(|name| parts.iter().any(|(_, title)| title.name == **name)).count()
}

/// Splits a title into its subject and the title of a quantity. Returns `None` for an unknown
/// quantity, and for one of [`OTHERS`].
fn split_subject(title: &str) -> Option<(String, Title)> {
    let signs = title.char_indices().skip(1);
    let mut breaks = signs.filter_map(|(place, sign)| {
        // A separator is dropped, but a capital letter is kept, as in droneX.
        let is_camel = sign.is_uppercase() && title[..place].ends_with(char::is_lowercase);
        let is_sign = "_./ :-".contains(sign);
        (is_camel || is_sign).then_some((place, place + usize::from(is_sign)))
    });
    breaks.find_map(|(end, start)| {
        let rest = Title::parse(&title[start..]);
        let subject = &title[..end];
        let plain = simplified(subject);
        let is_other = plain.split(['_', '.']).any(|part| {
            OTHERS
                .split(' ')
                .any(|other| other == part.trim_end_matches(|c: char| c.is_ascii_digit()))
        });
        (rest.is_known && rest.name != "t" && rest.name != "index" && !is_other)
            .then(|| (subject.to_owned(), rest))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_title_is_parted_before_what_is_known() {
        let parts =
            |title: &str| split_subject(title).map(|(subject, title)| (subject, title.name));
        let wanted = |subject: &str, name: &str| Some((subject.to_owned(), name.to_owned()));
        assert_eq!(parts("drone_x"), wanted("drone", "x_m"));
        assert_eq!(parts("droneX"), wanted("drone", "x_m"));
        assert_eq!(parts("Tracker.Z (mm)"), wanted("Tracker", "z_m"));
        assert_eq!(parts("cf1_yaw"), wanted("cf1", "yaw_rad"));
        for other in ["accel_x", "IMU.x", "distance_error", "battery", "x"] {
            assert_eq!(parts(other), None, "{other}");
        }
    }
}
