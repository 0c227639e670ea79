//! Plain tables: t, x, y, z and others, under their usual names; range logs of a drone with a Loco
//! deck.
//!
//! What is understood: the titles of `NAMES`, also as the ends of paths (`/cf1/pose/position/x` of
//! `PlotJuggler`, `field.pose.position.x` of rosbag), with the units of `UNITS` at their end or in
//! brackets (`x_mm`, `yaw [deg]`, `Time (Seconds)`); the tables of Motive and Vicon
//! ([`super::mocap_csv`]); files without a head, t, x, y, z, or with eight columns between blanks
//! t, x, y, z and the quaternion x, y, z, w (TUM). Other columns are kept and named; another unit
//! is refused, and so are the poses of two bodies.
//!
//! Without a unit, numbers are meters, seconds and radians, unless they are impossible in these
//! units. Each guess is a warning, and an option says otherwise.
//!
//! A row of a range log (`index,timestamp,ranging.distance0,ranging.distance2 …`, meters) brings
//! one new range, and its stamp is a date or a number: the flight keeps the rows with their own
//! times, and has no position.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::recording::{Block, Column, Recording, shortened};
use super::sheet::{self, Sheet};
use super::{AngleUnit, ImportOptions, TimeUnit, mocap_csv};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Budget, plain_text};
use noctograph_core::flight::csv::is_standard_column;
use noctograph_core::flight::stamps::unit_of;

/// Names of the columns where a file has no header.
const UNNAMED: [&str; 4] = ["t", "x", "y", "z"];

/// Names of the columns of a file without a header and with blanks between its eight cells.
const TUM: [&str; 8] = ["t", "tx", "ty", "tz", "qx", "qy", "qz", "qw"];

/// Our name of a column and its usual names, in lower case and without unit; `*` stands for each of
/// the letters before them.
const NAMES: [(&str, &str, &[&str]); 14] = [
    (
        " ",
        "t",
        &[
            "t",
            "time",
            "timestamp",
            "stamp",
            "date",
            "datetime",
            "seconds",
            "sec",
            "zeit",
            "elapsed",
            "elapsed_time",
            "header_stamp",
            "time_boot",
        ],
    ),
    (
        "xyz",
        "*_m",
        &[
            "*",
            "p*",
            "p_*",
            "pos_*",
            "pos*",
            "position_*",
            "*_pos",
            "*_position",
            "t*",
            "p_rs_r_*",
            "translation_*",
            "loc_*",
            "location_*",
        ],
    ),
    ("z", "*_m", &["height", "altitude", "alt"]),
    (
        "xyz",
        "*_estimate_m",
        &["*_estimate", "*_est", "*_estimated", "est_*", "estimate_*", "*_hat"],
    ),
    (" ", "yaw_rad", &["yaw", "psi"]),
    (" ", "pitch_rad", &["pitch", "theta"]),
    (" ", "roll_rad", &["roll", "phi"]),
    ("wxyz", "q*", &["q*", "q_*", "quat_*", "orientation_*", "rotation_*", "q_rs_*"]),
    ("xyz", "v*_world_m_s", &["v*", "v_*", "vel_*", "vel*", "velocity_*", "*_vel", "v_rs_r_*"]),
    ("xyz", "v*_body_m_s", &["v*_body"]),
    ("xyz", "w*_body_rad_s", &["w*", "w_*", "w*_body", "omega_*", "omega*", "gyro_*", "w_rs_s_*"]),
    (
        "xyz",
        "*_design_m",
        &[
            "*_design",
            "*_des",
            "*_d",
            "*d",
            "*_ref",
            "*_sp",
            "*_setpoint",
            "*_cmd",
            "*_target",
            "ref_*",
            "setpoint_*",
            "target_*",
            "des_*",
            "cmd_*",
        ],
    ),
    ("1234", "m*", &["m*", "m_*", "motor*", "motor_*", "pwm*", "pwm_*", "m*_pwm"]),
    (" ", "index", &["index", "row", ""]),
];

/// Ends of paths, and the names that they stand for.
const PATHS: [(&str, &str); 5] = [
    ("position", "pos"),
    ("translation", "pos"),
    ("orientation", "q"),
    ("rotation", "q"),
    ("header", "header"),
];

/// Units as endings of names, the longest first, and their size in SI units.
const UNITS: [(&str, f64); 33] = [
    ("_milliseconds", 1e-3),
    ("_microseconds", 1e-6),
    ("_nanoseconds", 1e-9),
    ("_millimeters", 1e-3),
    ("_centimeters", 1e-2),
    ("_seconds", 1.0),
    ("_degrees", DEGREE),
    ("_radians", 1.0),
    ("_meters", 1.0),
    ("_metres", 1.0),
    ("_rad_s", 1.0),
    ("_deg_s", DEGREE),
    ("_mrad_s", 1e-3),
    ("_mm_s", 1e-3),
    ("_cm_s", 1e-2),
    ("_m_s_2", 1.0),
    ("_m_s2", 1.0),
    ("_m_s", 1.0),
    ("_mrad", 1e-3),
    ("_rad", 1.0),
    ("_deg", DEGREE),
    ("_inch", 0.0254),
    ("_ft", 0.3048),
    ("_mm", 1e-3),
    ("_cm", 1e-2),
    ("_km", 1e3),
    ("_ms", 1e-3),
    ("_us", 1e-6),
    ("_ns", 1e-9),
    ("_sec", 1.0),
    ("_in", 0.0254),
    ("_m", 1.0),
    ("_s", 1.0),
];

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Beginning of the names of range columns.
const RANGE: &str = "ranging.distance";

/// Longest time over which rows of one stamp are spread: stamps may have whole seconds.
const ROW_S: f64 = 1.0;

/// What a title says.
#[derive(Debug, PartialEq)]
struct Title {
    /// Our name; an unknown title's is as it stands.
    name: String,
    is_known: bool,
    /// Size of the unit that it names.
    unit: Option<f64>,
    /// The path before the quantity.
    body: String,
    /// A unit in brackets that is none of ours.
    other_unit: Option<String>,
}

/// Reads a plain table.
pub(super) fn read(
    text: &[u8],
    file: &str,
    options: &ImportOptions,
    budget: &Budget,
) -> Result<Recording> {
    let captured = mocap_csv::table(text, file)?;
    let text =
        captured.as_ref().map_or(Cow::Borrowed(text), |table| Cow::Borrowed(&table.text[..]));
    let plain = plain_text(&text);
    budget.bytes(plain.text.len())?;
    let names = unnamed(&text, &plain.text);
    let needed = |title: &str| Title::of(title).is_known || title.starts_with("ranging.");
    let sheet = Sheet::read(&plain.text, file, names, &needed, budget)?;
    let mut log = Recording { file: file.to_owned(), ..Recording::default() };
    log.warnings.extend(plain.notes.into_iter().chain(sheet.warnings));
    if sheet::header(&plain.text).is_none() {
        log.warnings.push(format!("no head: the columns are taken as {}", names.join(", ")));
    }
    if let Some(table) = &captured {
        (log.axes, log.in_format) = (table.axes, Some(table.format));
        log.warnings.extend(table.notes.iter().cloned());
    } else if is_px4(&sheet.header) {
        (log.axes, log.in_format) = (super::Axes::ZDown, Some("the local position of PX4"));
    }
    let has_ranges = sheet.header.iter().any(|title| title.starts_with(RANGE));
    let header = sheet.header.join(",");
    let mut columns = Columns {
        file,
        options,
        log,
        time: None,
        named: Vec::new(),
        from: BTreeMap::new(),
        unknown: Vec::new(),
    };
    for (index, (title, values)) in sheet.header.iter().zip(sheet.columns).enumerate() {
        columns.add(index, title, values, sheet.dated[index])?;
    }
    let Columns { mut log, time, mut named, unknown, .. } = columns;
    let period_s = captured.as_ref().and_then(|table| table.period_s).or(options.period_s);
    log.is_stamped = time.is_some();
    let mut time_s = match (time, period_s) {
        (Some(_), Some(_)) if captured.is_none() => {
            let hint = "leave the period out";
            return Err(Error::input(
                file,
                "a column of times",
                "none, since a period is given",
                hint,
            ));
        }
        (Some((_, time_s)), _) => time_s,
        (None, Some(period_s)) => rows(&named, captured.is_some(), period_s),
        (None, None) => {
            let place = format!("{file}:1: times");
            let wanted = "a column of times (t, time, time_s, timestamp, t_ms …), or the seconds \
                          between two rows";
            let hint = "name the column of times t, or give the period of the rows";
            return Err(Error::input(place, header, wanted, hint));
        }
    };
    if has_ranges && spread_rows(&mut time_s) {
        log.warnings
            .push("several rows share a stamp: they are spread evenly up to the next".into());
    }
    if !unknown.is_empty() {
        let kept = "unknown columns are kept unchanged";
        log.warnings.push(format!("{kept}: {}", shortened(&unknown)));
    }
    angles(&mut named, &time_s, options.angle_unit, &mut log.warnings);
    let columns = named.into_iter().map(|(column, _)| column).collect();
    log.blocks = vec![Block { name: "csv".into(), time_s, columns, ..Block::default() }];
    Ok(log)
}

/// Names of the columns where the file has no header.
fn unnamed(text: &[u8], plain: &[u8]) -> &'static [&'static str] {
    fn first(text: &[u8]) -> &[u8] {
        let mut lines = text.split(|byte| *byte == b'\n');
        lines.find(|line| !line.trim_ascii().is_empty()).unwrap_or_default()
    }
    let blanks = !first(text).iter().any(|byte| matches!(byte, b',' | b';' | b'\t'));
    let cells = first(plain).split(|byte| *byte == b',').count();
    if blanks && cells == TUM.len() { &TUM } else { &UNNAMED }
}

/// Whether a header is that of PX4's `vehicle_local_position`, whose z points down.
fn is_px4(header: &[String]) -> bool {
    let has = |name: &str| header.iter().any(|title| title == name);
    has("z") && has("vz") && (has("ref_timestamp") || has("z_valid") || has("dist_bottom"))
}

/// Stamps of rows without times: by their numbers, or by those of the frames of a capture.
fn rows(named: &[(Column, bool)], by_frame: bool, period_s: f64) -> Vec<f64> {
    let n = named.first().map_or(0, |(column, _)| column.values.len());
    let frames = named.iter().find(|(column, _)| by_frame && column.name == "index");
    match frames {
        Some((frames, _)) => frames.values.iter().map(|frame| frame * period_s).collect(),
        None => (0..n).map(|row| row as f64 * period_s).collect(),
    }
}

/// The columns of a table as they become known.
struct Columns<'a> {
    file: &'a str,
    options: &'a ImportOptions,
    log: Recording,
    /// The title of the times, and the times.
    time: Option<(String, Vec<f64>)>,
    /// Columns, and whether they are angles without a unit.
    named: Vec<(Column, bool)>,
    /// The title and the body that each name is from.
    from: BTreeMap<String, (String, String)>,
    unknown: Vec<String>,
}

impl Columns<'_> {
    fn add(&mut self, index: usize, title: &str, values: Vec<f64>, dated: bool) -> Result<()> {
        let Title { mut name, is_known, unit, body, other_unit } = Title::of(title);
        let (file, options) = (self.file, self.options);
        if let Some(other) = other_unit {
            let place = format!("column {title}");
            let wanted = "m, cm, mm, in, ft, s, ms, us, ns, rad, deg, or these by s";
            let hint = "convert the column, or correct its title";
            return Err(
                Error::input(place, format!("the unit {other}"), wanted, hint).at(file, None)
            );
        }
        if name == "t" && !dated && values.iter().all(|value| value.is_nan()) {
            // A second column of times may be filled.
            name = title.to_owned();
        }
        if name == "t" {
            let (time_s, note) = times(title, values, dated, unit, options.time_unit);
            if let Some((first, _)) = &self.time {
                self.log
                    .warnings
                    .push(format!("the times are those of {first}; {title} has others"));
                self.named.push((Column { name: title.to_owned(), values: time_s }, false));
            } else {
                self.log.warnings.extend(note);
                self.time = Some((title.to_owned(), time_s));
            }
            return Ok(());
        }
        // PX4's heading is the yaw of its world.
        if name == "heading" && self.log.in_format.is_some() {
            name = "yaw_rad".to_owned();
        } else if !is_known && !is_expected(title) {
            self.unknown.push(format!("{title} (column {})", index + 1));
        }
        if is_known && let Some((first, of_body)) = self.from.get(&name) {
            if *of_body != body {
                let place = format!("columns {first} and {title}");
                let hint = "keep the columns of one body";
                return Err(
                    Error::input(place, "two bodies", "one, for a flight", hint).at(file, None)
                );
            }
            let column = index + 1;
            self.log.warnings.push(format!(
                "{title} (column {column}) is one quantity with {first}, which is taken"
            ));
            name = title.to_owned();
        }
        self.from.entry(name.clone()).or_insert_with(|| (title.to_owned(), body));
        let is_angle = ["yaw_rad", "pitch_rad", "roll_rad"].contains(&&*name)
            || name.starts_with('w') && name.ends_with("_body_rad_s");
        let factor = unit.unwrap_or(1.0);
        let values = values.into_iter().map(|value| value * factor).collect();
        self.named.push((Column { name, values }, is_angle && unit.is_none()));
        Ok(())
    }
}

/// Whether a title without a meaning of a pose is one of ours, or a variable of the firmware.
fn is_expected(title: &str) -> bool {
    // Columns of the simulator, and the numbers of rows.
    let own = [
        "saturated_s",
        "battery_v",
        "energy_j",
        "estimate_sigma_m",
        "estimate_nees",
        "frame",
        "seq",
    ];
    let of_group = |(group, name): (&str, &str)| {
        let plain =
            |text: &str| !text.is_empty() && text.chars().all(|c| c.is_alphanumeric() || c == '_');
        plain(group) && plain(name) && group != "field"
    };
    own.contains(&title) || is_standard_column(title) || title.split_once('.').is_some_and(of_group)
}

/// Times in s of a column of stamps, and what was guessed.
fn times(
    title: &str,
    mut values: Vec<f64>,
    dated: bool,
    unit: Option<f64>,
    wanted: TimeUnit,
) -> (Vec<f64>, Option<String>) {
    if dated {
        let wraps = midnights(&mut values);
        let text = format!("column {title}: its clock begins again {wraps} time(s); undone");
        return (values, (wraps > 0).then_some(text));
    }
    let shown = unit_of(&values);
    let unit_s = wanted.seconds().or(unit).unwrap_or(shown.unit_s);
    let is_guess = wanted.seconds().is_none() && unit.is_none();
    let note = if is_guess && unit_s != 1.0 {
        let (step, unit) = (shown.step, unit_s);
        Some(format!(
            "column {title}: taken as {unit} s a unit, since its rows are {step} apart, which is no \
             step of a log in seconds"
        ))
    } else if is_guess && shown.in_doubt {
        let step = shown.step;
        Some(format!(
            "column {title}: its rows are {step} apart, taken as seconds, not milliseconds"
        ))
    } else {
        None
    };
    (values.into_iter().map(|t| t * unit_s).collect(), note)
}

/// Adds a day, or half a day, wherever a time of day falls by about as much; returns how often.
fn midnights(times_s: &mut [f64]) -> u32 {
    const NEAR_S: f64 = 60.0;
    let (mut added_s, mut last_s, mut wraps) = (0.0, f64::NEG_INFINITY, 0);
    for time_s in times_s.iter_mut().filter(|t| t.is_finite() && **t < 90_000.0) {
        let fall_s = last_s - *time_s;
        last_s = *time_s;
        for day_s in [86_400.0, 43_200.0] {
            if (fall_s - day_s).abs() < NEAR_S {
                (added_s, wraps) = (added_s + day_s, wraps + 1);
            }
        }
        *time_s += added_s;
    }
    wraps
}

/// Our name of a title, and the size of its unit where it names one; an unknown title stays as it
/// is.
pub(super) fn meaning(title: &str) -> (String, Option<f64>) {
    let Title { name, unit, .. } = Title::of(title);
    (name, unit)
}

/// Our name of a usual one.
fn known(name: &str) -> Option<String> {
    NAMES.iter().find_map(|(letters, ours, names)| {
        let with = |text: &str, letter: char| text.replace('*', letter.encode_utf8(&mut [0; 4]));
        let is_usual = |letter: &char| names.iter().any(|usual| with(usual, *letter) == name);
        letters.chars().find(is_usual).map(|letter| with(ours, letter))
    })
}

impl Title {
    fn of(title: &str) -> Self {
        let (bare, bracket) = bracketed(title);
        let (body, bare) = path_end(&bare);
        let simple = simplified(&bare);
        let of =
            |name: String, unit, body| Self { name, is_known: true, unit, body, other_unit: None };
        if let Some(bracket) = bracket {
            let end = format!("_{}", simplified(&bracket));
            let unit = UNITS.iter().find(|(unit, _)| **unit == end).map(|(_, factor)| *factor);
            match (known(&simple), unit, end == "_") {
                (Some(name), unit, none) if unit.is_some() || none => return of(name, unit, body),
                // Such as `Time (s)` of a name with a unit of its own.
                (Some(name), _, _) => {
                    return Self { other_unit: Some(bracket), ..of(name, None, body) };
                }
                (None, ..) => {}
            }
        }
        let simple = simplified(&path_end(title).1);
        if let Some(name) = known(&simple) {
            return of(name, None, body);
        }
        let units =
            UNITS.iter().filter_map(|(end, factor)| Some((simple.strip_suffix(end)?, *factor)));
        let meant =
            units.filter_map(|(name, factor)| Some(of(known(name)?, Some(factor), body.clone())));
        let other = Self {
            name: title.to_owned(),
            is_known: false,
            unit: None,
            body: String::new(),
            other_unit: None,
        };
        meant.into_iter().next().unwrap_or(other)
    }
}

/// A title without the unit in brackets at its end, and that unit.
fn bracketed(title: &str) -> (String, Option<String>) {
    let trimmed = title.trim();
    for [open, close] in [['[', ']'], ['(', ')'], ['{', '}'], ['<', '>']] {
        let inside = trimmed.strip_suffix(close).and_then(|text| text.rsplit_once(open));
        if let Some((before, unit)) = inside {
            return (before.trim().to_owned(), Some(unit.trim().to_owned()));
        }
    }
    (trimmed.to_owned(), None)
}

/// A title in lower case, with underscores.
fn simplified(title: &str) -> String {
    let lower = title.to_lowercase();
    let lower =
        lower.replace("m/s²", "m_s2").replace("^-1", "").replace('°', "deg").replace('µ', "u");
    let lower =
        lower.replace(['[', '(', ' ', '/', '-', '^'], "_").replace([']', ')', '%', '#'], "");
    let mut lower = lower.replace('²', "2");
    while lower.contains("__") {
        lower = lower.replace("__", "_");
    }
    lower.trim_start_matches('_').to_owned()
}

/// The path before a quantity of a pose, and the quantity's own name; a title that is no such path
/// stays as it is.
fn path_end(title: &str) -> (String, String) {
    let parts: Vec<&str> = title.split(['/', '.']).collect();
    if let [before @ .., group, axis] = &parts[..] {
        let group = group.to_lowercase();
        if let Some((_, name)) = PATHS.iter().find(|(end, _)| *end == group) {
            // The stamp of a message belongs to all that is in it.
            let body = if *name == "header" { String::new() } else { before.join("/") };
            return (body, format!("{name}_{axis}"));
        }
    }
    (String::new(), title.to_owned())
}

/// Sets the unit of angles and angular velocities without one.
fn angles(
    columns: &mut [(Column, bool)],
    time_s: &[f64],
    wanted: AngleUnit,
    warnings: &mut Vec<String>,
) {
    let is_rate = |column: &Column| column.name.starts_with('w');
    let of = |columns: &[(Column, bool)], names: &[&str]| -> Vec<f64> {
        let open = columns.iter().filter(|(column, open)| *open && names.contains(&&*column.name));
        open.flat_map(|(column, _)| column.values.iter().copied().filter(|v| v.is_finite()))
            .collect()
    };
    let most = |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let rms = |values: &[f64]| {
        let n = values.len().max(1) as f64;
        (values.iter().map(|value| value * value).sum::<f64>() / n).sqrt()
    };
    let (lean, all) = (
        of(columns, &["pitch_rad", "roll_rad"]),
        of(columns, &["yaw_rad", "pitch_rad", "roll_rad"]),
    );
    let why = if most(&all) > std::f64::consts::TAU {
        Some("yaw, pitch and roll go beyond a full turn of 2π".to_owned())
    } else if most(&lean) > std::f64::consts::FRAC_PI_2 {
        Some(format!(
            "pitch and roll reach {:.2}, which would be upside down in radians",
            most(&lean)
        ))
    } else if rms(&lean) > 0.35 {
        Some(format!(
            "pitch and roll are {:.2} on average, which no flight holds in radians",
            rms(&lean)
        ))
    } else {
        None
    };
    let degrees = match wanted {
        AngleUnit::Auto => why.is_some(),
        unit => unit == AngleUnit::Degrees,
    };
    if let Some(why) = why.filter(|_| wanted == AngleUnit::Auto) {
        warnings.push(format!("{why}: taken as degrees"));
    } else if wanted == AngleUnit::Auto && most(&lean) > 0.7 {
        warnings.push(format!(
            "pitch and roll reach {:.2}: taken as radians, not degrees",
            most(&lean)
        ));
    } else if wanted == AngleUnit::Auto && lean.is_empty() && most(&all) > std::f64::consts::PI {
        warnings.push(format!("the yaw reaches {:.2}: taken as radians, not degrees", most(&all)));
    }
    let scale = |columns: &mut [(Column, bool)], rates: bool| {
        for (column, _) in
            columns.iter_mut().filter(|(column, open)| *open && is_rate(column) == rates)
        {
            column.values.iter_mut().for_each(|value| *value *= DEGREE);
        }
    };
    if degrees {
        scale(columns, false);
    }
    let rates = of(columns, &["wx_body_rad_s", "wy_body_rad_s"]);
    // Roll and pitch turn as fast as the rates say.
    let turn = |name: &str| -> Vec<f64> {
        let angle = columns.iter().find(|(column, _)| column.name == name);
        let pairs =
            angle.iter().flat_map(|(angle, _)| angle.values.windows(2).zip(time_s.windows(2)));
        let slopes = pairs.map(|(angle, time)| (angle[1] - angle[0]) / (time[1] - time[0]));
        slopes.filter(|slope| slope.is_finite()).collect()
    };
    let turns = [turn("pitch_rad"), turn("roll_rad")].concat();
    let ratio = rms(&rates) / rms(&turns);
    let too_fast = match rms(&turns) > 0.01 && !rates.is_empty() {
        true => ratio > 7.6,
        false => most(&rates) > 35.0,
    };
    if wanted == AngleUnit::Degrees || wanted == AngleUnit::Auto && too_fast {
        scale(columns, true);
        if wanted == AngleUnit::Auto {
            warnings.push(
                "angular velocities without a unit are too fast for rad/s: taken as degrees".into(),
            );
        }
    }
}

/// Converts rows of JSON, which have the names of plain tables, as [`read`] does.
pub(super) fn settle_angles(
    block: &mut Block,
    open: &[String],
    wanted: AngleUnit,
    warnings: &mut Vec<String>,
) {
    let mut columns: Vec<(Column, bool)> = std::mem::take(&mut block.columns)
        .into_iter()
        .map(|column| {
            let is_open = open.contains(&column.name);
            (column, is_open)
        })
        .collect();
    angles(&mut columns, &block.time_s, wanted, warnings);
    block.columns = columns.into_iter().map(|(column, _)| column).collect();
}

/// Spreads rows of one stamp evenly up to the next stamp, or over a second; returns whether there
/// are any.
fn spread_rows(time_s: &mut [f64]) -> bool {
    let (mut first, mut any) = (0, false);
    while first < time_s.len() {
        let stamp_s = time_s[first];
        let n = time_s[first..].iter().take_while(|t| **t == stamp_s).count().max(1);
        let next_s = time_s.get(first + n).map_or(ROW_S, |next| next - stamp_s);
        any |= n > 1;
        for (k, t) in time_s[first..first + n].iter_mut().enumerate() {
            *t += next_s.clamp(0.0, ROW_S) * k as f64 / n as f64;
        }
        first += n;
    }
    any
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8], file: &str) -> Result<Recording> {
        super::read(bytes, file, &ImportOptions::default(), &Budget::of(file, "none"))
    }

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
        assert_eq!(value("t,x,color\n0,1,7\n", "color"), 7.0);
    }

    #[test]
    fn stamps_in_ms_and_angles_in_degrees_are_detected() {
        let log = read(b"t,yaw\n0,10\n20,20\n40,30\n", "f.csv").unwrap();
        assert_eq!(log.blocks[0].time_s, [0.0, 0.02, 0.04]);
        assert_eq!(log.channel("yaw_rad").unwrap().values[0], 10_f64.to_radians());
        assert_eq!(log.warnings.len(), 2, "both with a warning: {:?}", log.warnings);
        // At 1 kHz, and in ns.
        for (text, end_s) in [("t,x\n0,1\n1,2\n2,3\n", 0.002), ("t,x\n0,1\n4000000,2\n", 0.004)] {
            let log = read(text.as_bytes(), "f.csv").unwrap();
            assert!((log.blocks[0].time_s.last().unwrap() - end_s).abs() < 1e-9, "{text}");
        }
    }

    #[test]
    fn range_rows_keep_their_times_and_rows_within_a_second_are_spread() {
        let text = b",timestamp,ranging.distance0,ranging.distance3\n\
            0,2023-05-04 12:00:00.100,2.3918,3.1052\n1,2023-05-04 12:00:00.200,2.2290,3.1052\n";
        let log = read(text, "r.csv").unwrap();
        let names: Vec<&str> = log.names().collect();
        assert_eq!(names, ["index", "ranging.distance0", "ranging.distance3"]);
        let step_s = log.blocks[0].time_s[1] - log.blocks[0].time_s[0];
        assert!((step_s - 0.1).abs() < 1e-6, "{step_s}");
        let text = b"timestamp,ranging.distance0\n12:00:00,1\n12:00:00,2\n12:00:01,3\n";
        let log = read(text, "r.csv").unwrap();
        assert_eq!(log.blocks[0].time_s, [43_200.0, 43_200.5, 43_201.0]);
        assert_eq!(log.warnings.len(), 1);
    }
}
