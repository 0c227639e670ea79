//! Titles of columns: determines the standard name and the unit of each usual title.

use super::recording::Column;
use noctograph_core::files::{bracketed, simplified, unit};

/// Letters, standard name and usual names of columns, without unit. `*` stands for a letter.
const NAMES: [(&str, &str, &str); 18] = [
    (
        " ",
        "t",
        "t time timestamp time_stamp host_time sim_time stamp date datetime datenum seconds sec zeit elapsed elapsed_time",
    ),
    (
        " ",
        "t",
        "header_stamp time_boot timeus secs stamp_sec stamp_secs header_stamp_sec header_stamp_secs",
    ),
    ("xyz", "*_m", "* p* p_* pos_* pos* position_* *_pos *_position t* p_rs_r_* translation_*"),
    ("xyz", "*_m", "loc_* location_* *_true true_* *_gt gt_* *_actual actual_* *true *gt"),
    ("z", "*_m", "height altitude alt höhe hoehe"),
    ("xyz", "*_estimate_m", "*_estimate *_est *_estimated est_* estimate_* *_hat *est *hat"),
    (" ", "yaw_rad", "yaw psi"),
    (" ", "pitch_rad", "pitch theta"),
    (" ", "roll_rad", "roll phi"),
    ("wxyz", "q*", "q* q_* quat_* or_* ori_* orientation_* rotation_* q_rs_*"),
    ("xyz", "v*_world_m_s", "v* v_* vel_* vel* velocity_* *_vel v_rs_r_* *dot *_dot"),
    ("xyz", "v*_body_m_s", "v*_body"),
    ("xyz", "w*_body_rad_s", "w* w_* w*_body omega_* omega* gyro_* w_rs_s_*"),
    ("xyz", "*_design_m", "*_design *_des *_d *d *_ref *_sp *_setpoint *_cmd *_target ref_*"),
    ("xyz", "*_design_m", "setpoint_* target_* des_* cmd_* *_desired desired_* *_reference"),
    ("xyz", "*_design_m", "*des *ref *sp *cmd *target *desired"),
    ("1234", "m*", "m* m_* motor* motor_* pwm* pwm_* m*_pwm"),
    // The last pattern matches the empty title.
    (" ", "index", "index row "),
];

/// Standard names of the angles.
pub(super) const ANGLES: [&str; 3] = ["yaw_rad", "pitch_rad", "roll_rad"];

/// A parsed title.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Title {
    /// Standard name, or the unchanged title if it is unknown.
    pub(super) name: String,
    pub(super) is_known: bool,
    /// Factor from the title's unit to SI units, if the title states a unit.
    pub(super) unit: Option<f64>,
    /// Path before the quantity's name.
    pub(super) body: String,
    /// Unknown unit in brackets, if any.
    pub(super) other_unit: Option<String>,
}

/// Returns a column under its title's standard name, in SI units if the title states a unit.
pub(super) fn column_of(title: &str, values: Vec<f64>) -> Column {
    let Title { name, unit, .. } = Title::parse(title);
    in_si_units(name, unit, values)
}

/// Returns a column in SI units. `unit` is the column's unit in SI units, if its title states one.
pub(super) fn in_si_units(name: String, unit: Option<f64>, mut values: Vec<f64>) -> Column {
    let is_rate = name.starts_with('w') && name.ends_with("_body_rad_s");
    let is_open_angle = unit.is_none() && (is_rate || ANGLES.contains(&&*name));
    values.iter_mut().for_each(|value| *value *= unit.unwrap_or(1.0));
    Column { name, values, is_open_angle, unknown: None }
}

/// Returns the standard name of a title, and the factor to SI units if the title states a unit. An
/// unknown title is not changed.
pub(super) fn meaning(title: &str) -> (String, Option<f64>) {
    let Title { name, unit, .. } = Title::parse(title);
    (name, unit)
}

/// Returns the standard name for a usual name without unit, or `None` for any other name.
fn standard_name(name: &str) -> Option<String> {
    NAMES.iter().find_map(|(letters, standard, names)| {
        letters.chars().map(String::from).find_map(|letter| {
            let mut names = names.split(' ');
            let is_usual = names.any(|usual| usual.replace('*', &letter) == name);
            is_usual.then(|| standard.replace('*', &letter))
        })
    })
}

impl Title {
    /// Returns the parsed form of a known title.
    fn known(name: String, unit: Option<f64>, body: String) -> Self {
        Self { name, is_known: true, unit, body, other_unit: None }
    }

    /// Parses a title with a unit in brackets, without a unit, or with a unit after `_`.
    pub(super) fn parse(title: &str) -> Self {
        let (bare, bracket) = bracketed(title);
        let (body, bare) = split_path(bare);
        if let Some(bracket) = bracket
            && let Some(name) = standard_name(&simplified(&bare))
        {
            let plain = simplified(bracket);
            let unit = unit(&plain, name == "t");
            let other_unit = Some(bracket.to_owned())
                .filter(|_| unit.is_none() && !["", "utc"].contains(&&*plain));
            return Self { other_unit, ..Self::known(name, unit, body) };
        }
        let simple = simplified(&split_path(title).1);
        if let Some(name) = standard_name(&simple) {
            return Self::known(name, None, body);
        }
        // Each underscore is tried as the start of a unit.
        match simple.match_indices('_').find_map(|(place, _)| {
            let name = standard_name(&simple[..place])?;
            let unit = unit(&simple[place + 1..], name == "t")?;
            Some((name, Some(unit)))
        }) {
            Some((name, unit)) => Self::known(name, unit, body),
            None => Self { name: title.to_owned(), ..Self::default() },
        }
    }
}

/// Splits a path to a quantity of a pose into the part before the quantity's name and the name. Any
/// other title is not changed, and the part before it is empty.
fn split_path(title: &str) -> (String, String) {
    let parts: Vec<&str> = title.split(['/', '.']).collect();
    if let [before @ .., group, axis] = &parts[..] {
        match &*group.to_lowercase() {
            "position" | "translation" => return (before.join("/"), format!("pos_{axis}")),
            "attitude" => return (before.join("/"), (*axis).to_owned()),
            // Angles keep their names, as in the yaw that PlotJuggler computes.
            "orientation" | "rotation"
                if matches!(&*axis.to_lowercase(), "yaw" | "pitch" | "roll") =>
            {
                return (before.join("/"), (*axis).to_owned());
            }
            "orientation" | "rotation" => return (before.join("/"), format!("q_{axis}")),
            // A message's time applies to all of its bodies.
            "header" => return (String::new(), format!("header_{axis}")),
            "stamp" => return (String::new(), format!("stamp_{axis}")),
            _ => {}
        }
    }
    (String::new(), title.to_owned())
}
