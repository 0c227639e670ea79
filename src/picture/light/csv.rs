//! Light traces as tables, for trails from other programs.
//!
//! The columns are `t` (s), `x`, `y`, `z` (world, m) and `r`, `g`, `b` (linear sRGB, as intensity
//! in every direction in cd). Further columns are allowed. A table cannot describe beams.
//!
//! [`read`] also accepts the light logs of other programs: titles from `TITLES` in any case or
//! after `#`, every table layout that [`Head`] supports, units in brackets, timestamps in ms, µs or
//! ns (told by their steps), and levels from 0 to 255 (1 cd). Guesses and omissions give warnings.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::{Emitter, Lamp, LightSample, LightTrace, LightTraceData};
use noctograph_core::diagnostic::{Diagnostic, Warned};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Head, Text, bracketed, simplified, unit};
use noctograph_core::flight::table::{Table, on_grid};
use noctograph_core::flight::timestamps::unit_of;

const COLUMNS: [&str; 7] = ["t", "x", "y", "z", "r", "g", "b"];

/// Resolution of an intensity in a table, in cd. Rows whose colors differ by at most this much have
/// the same color.
const DIGIT_CD: f64 = 1e-5;

/// Usual titles of each column, in lower case and without a unit.
const TITLES: [(&str, &str); 7] = [
    ("t", "t time timestamp seconds"),
    ("x", "x px pos_x"),
    ("y", "y py pos_y"),
    ("z", "z pz pos_z"),
    ("r", "r red led_r"),
    ("g", "g green led_g"),
    ("b", "b blue led_b"),
];

/// Speed above which a lamp moves faster than any drone.
const FASTEST_M_S: f64 = 15.0;
/// Minimum length of a step that counts as motion.
const STEP_M: f64 = 1e-3;
/// Minimum number of fast steps, and minimum fraction of steps, that make a lamp too fast.
const MIN_FAST_STEPS: usize = 3;
const MIN_FAST_FRACTION: f64 = 0.1;
/// Maximum intensity of a channel, in cd.
const MAX_CD: f64 = 1e6;
/// Number of bytes at the start of a file in which the header is searched.
const HEADER_SIZE: usize = 1 << 16;

/// Maximum level in a light log with one byte per level, and the intensity that it represents.
const FULL_LEVEL: f64 = 255.0;
const FULL_CD: f64 = 1.0;

/// Returns the name in [`COLUMNS`] of a title such as `Time [ms]` or `x_cm`, and, if the title
/// contains a unit, the size of that unit in s or m. Returns `None` for other titles and units.
fn column(title: &str) -> Option<(&'static str, Option<f64>)> {
    let (before_bracket, bracket) = bracketed(title);
    let bare = simplified(before_bracket);
    let (name, unit_name) = match (column_name(&bare), bare.rsplit_once('_')) {
        (Some(name), _) => (name, bracket.map(simplified)),
        (None, Some((start, suffix))) => (column_name(start)?, Some(suffix.to_owned())),
        (None, None) => return None,
    };
    match unit_name {
        None => Some((name, None)),
        Some(unit_name) => Some((name, Some(unit(&unit_name, name == "t")?))),
    }
}

/// Returns the name in [`COLUMNS`] of a title without its unit, or `None` for other titles.
fn column_name(bare_title: &str) -> Option<&'static str> {
    let mut columns = TITLES.iter();
    Some(columns.find(|(_, titles)| titles.split(' ').any(|title| title == bare_title))?.0)
}

/// True if a file's text starts with the header of a light trace.
pub fn is_light_trace(text: &[u8]) -> bool {
    let head = Head::find(&Text::decode(&text[..text.len().min(HEADER_SIZE)]).bytes);
    let names: Vec<_> = head.titles.iter().filter_map(|title| Some(column(title)?.0)).collect();
    COLUMNS.iter().all(|column| names.contains(column))
}

/// Reads the text of a light trace or of another program's light log. `file` is the name to show in
/// messages. Guesses and omissions give warnings.
///
/// # Errors
///
/// Returns [`Error::Input`] with line and column if a cell is not a number, time decreases, or an
/// intensity is negative.
pub fn read(text: &[u8], file: &str) -> Result<Warned<LightTrace>> {
    let text = Text::decode(text);
    let mut head = Head::find(&text.bytes);
    let is_trace = COLUMNS.iter().all(|column| head.has(column));
    let (units, others) = rename_titles(&mut head.titles);
    let table = Table::below(head, &text, file, |title| COLUMNS.contains(&title))?;
    let mut warnings = table.notes().to_vec();
    if !others.is_empty() {
        warnings.push(format!("columns of a light trace that are not read: {}", others.join(", ")));
    }
    // The unit of time is taken from the title or, without one, from the size of the steps.
    let [unit_t, unit_x, unit_y, unit_z] =
        ["t", "x", "y", "z"].map(|name| units.get(name).copied().flatten());
    let unit_s = match unit_t {
        Some(unit_s) => unit_s,
        None if is_trace => 1.0,
        None => unit_from_steps_s(&table, &mut warnings)?,
    };
    let unit_cd = unit_cd(&table, is_trace, &mut warnings);
    // Converts the rows of the table to s, m and cd.
    let t = table.times_in("t", unit_s)?;
    if let Some(first) = t.first().filter(|first| **first != 0.0) {
        let first_s = on_grid(first * unit_s);
        warnings.push(format!("the clock starts at {first_s} s, but the exposure at 0 s"));
    }
    let [x, y, z] = [table.quantity("x")?, table.quantity("y")?, table.quantity("z")?];
    let [r, g, b] = colors(&table, file)?;
    let [unit_x_m, unit_y_m, unit_z_m] = [unit_x, unit_y, unit_z].map(|unit| unit.unwrap_or(1.0));
    let instants = Vec::from_iter((0..t.len()).map(|row: usize| Instant {
        time_s: on_grid(t[row] * unit_s),
        position_m: Vector3::new(x[row] * unit_x_m, y[row] * unit_y_m, z[row] * unit_z_m),
        rgb_cd: [r[row], g[row], b[row]].map(|value| value * unit_cd),
    }));
    warnings.extend(too_fast(&instants));
    let lamps = lit_runs(&instants).flat_map(lamps).collect();
    let product = LightTrace::new(LightTraceData { lamps })?;
    Ok(Warned { product, warnings: Diagnostic::warnings("light-trace", warnings) })
}

/// Returns the columns of red, green and blue in the table's unit. Returns [`Error::Input`] with
/// line and column for a number that is negative or above [`MAX_CD`].
fn colors<'a>(table: &'a Table, file: &str) -> Result<[&'a [f64]; 3]> {
    let columns = [table.quantity("r")?, table.quantity("g")?, table.quantity("b")?];
    for (name, column) in ["r", "g", "b"].into_iter().zip(columns) {
        if let Some(row) = column.iter().position(|value| !(0.0..=MAX_CD).contains(value)) {
            let place = format!("{file}:{}: column {name}", table.line(row));
            let hint = "correct the file, or write it again";
            return Err(Error::input(place, column[row], "a number from 0 to 1e6", hint));
        }
    }
    Ok(columns)
}

/// Renames titles to those of [`COLUMNS`], and all others to `other TITLE`. If several titles mean
/// the same column, the first is used. Returns the units that the titles contain, in s or m, and
/// the titles of all other columns as they were.
fn rename_titles(titles: &mut [String]) -> (BTreeMap<&'static str, Option<f64>>, Vec<String>) {
    let (mut units, mut others) = (BTreeMap::new(), Vec::new());
    for title in titles {
        match column(title).filter(|(name, _)| !units.contains_key(name)) {
            Some((name, unit)) => {
                units.insert(name, unit);
                *title = name.to_owned();
            }
            None => {
                // With the prefix, a second title of the same column is not read as that column.
                others.push(title.clone());
                *title = format!("other {title}");
            }
        }
    }
    (units, others)
}

/// Determines the unit of the timestamps, in s, from the steps between them. Warns if the unit is
/// not 1 s.
fn unit_from_steps_s(table: &Table, warnings: &mut Vec<String>) -> Result<f64> {
    let timestamps = unit_of(table.column("t")?);
    let (unit_s, step) = (timestamps.unit_s, timestamps.step);
    if unit_s != 1.0 {
        warnings.push(format!("timestamps are {step} apart: the assumed unit is {unit_s} s"));
    }
    Ok(unit_s)
}

/// Returns the unit of the colors in cd, which is 1 cd unless the colors are levels. Colors count
/// as levels if all are whole numbers and the largest is from 2 to 255, except in a light trace
/// (`is_trace`). Such numbers give a warning in either case.
fn unit_cd(table: &Table, is_trace: bool, warnings: &mut Vec<String>) -> f64 {
    let colors = ["r", "g", "b"].into_iter().filter_map(|name| table.column(name).ok()).flatten();
    let largest = colors.clone().copied().fold(0.0, f64::max);
    let is_whole = colors.into_iter().all(|level| level.fract() == 0.0);
    if largest <= 1.0 || largest > FULL_LEVEL || !is_whole {
        return 1.0;
    }
    let (unit_cd, warning) = if is_trace {
        let warning = "r, g and b are whole numbers up to 255: read as candela, not as levels";
        (1.0, warning.to_owned())
    } else {
        let levels = "the colors are interpreted as levels from 0 to 255";
        (FULL_CD / FULL_LEVEL, format!("{levels}, where 255 is {FULL_CD} cd"))
    };
    warnings.push(warning);
    unit_cd
}

/// Returns a warning if a lamp is faster than any drone in a tenth of the steps in which it moves.
fn too_fast(instants: &[Instant]) -> Option<String> {
    let steps = instants.windows(2).map(|pair| {
        (pair[1].time_s - pair[0].time_s, (pair[1].position_m - pair[0].position_m).norm())
    });
    let moving: Vec<_> = steps.filter(|(_, step_m)| *step_m > STEP_M).collect();
    let fast = moving.iter().filter(|(step_s, step_m)| *step_m > FASTEST_M_S * step_s).count();
    let is_frequent = fast as f64 > MIN_FAST_FRACTION * moving.len() as f64;
    (fast >= MIN_FAST_STEPS && is_frequent).then(|| {
        format!(
            "{fast} of {} steps are faster than {FASTEST_M_S} m/s: check whether the columns are in another \
             unit (x_cm), and keep the rows of only one drone",
            moving.len()
        )
    })
}

/// A row of the table.
struct Instant {
    time_s: f64,
    position_m: Vector3<f64>,
    rgb_cd: [f64; 3],
}

impl Instant {
    /// Returns the intensity of the strongest channel in cd.
    fn strength_cd(&self) -> f64 {
        self.rgb_cd.into_iter().fold(0.0, f64::max)
    }
}

/// Splits instants into lit runs. Each run includes the dark instants before and after it.
fn lit_runs(instants: &[Instant]) -> impl Iterator<Item = &[Instant]> {
    let runs = instants.chunk_by(|a, b| (a.rgb_cd == [0.0; 3]) == (b.rgb_cd == [0.0; 3]));
    let mut end = 0;
    runs.filter_map(move |run| {
        let start = end;
        end += run.len();
        let run_and_ends = &instants[start.saturating_sub(1)..(end + 1).min(instants.len())];
        (run[0].rgb_cd != [0.0; 3]).then_some(run_and_ends)
    })
}

/// Number of rows of a run for each stretch of a single color that is allowed beyond the first
/// [`MIN_STRETCHES`].
const ROWS_PER_STRETCH: usize = 8;
const MIN_STRETCHES: usize = 2;

/// Returns the lamps of a lit run. Each stretch of a single color has its own lamp, and each
/// stretch fades into the next. If the color changes continuously, there is one lamp for each
/// channel instead.
fn lamps(run: &[Instant]) -> Vec<Lamp> {
    // Each stretch of a single color is compared with its brightest row so far.
    let mut stretches = Vec::new();
    let (mut start, mut brightest) = (0, &run[0]);
    for (i, instant) in run.iter().enumerate() {
        if !same_color(brightest, instant) {
            stretches.push((start..i, brightest));
            (start, brightest) = (i, instant);
        }
        if instant.strength_cd() > brightest.strength_cd() {
            brightest = instant;
        }
    }
    stretches.push((start..run.len(), brightest));
    // If there are too many stretches for one lamp each, the color changes continuously.
    if stretches.len() > run.len() / ROWS_PER_STRETCH + MIN_STRETCHES {
        let channels = (0..3).map(|c| {
            lamp(run, std::array::from_fn(|k| f64::from(k == c)), |_, instant| instant.rgb_cd[c])
        });
        return channels.collect();
    }
    Vec::from_iter(stretches.into_iter().map(|(rows, brightest)| {
        let rgb = brightest.rgb_cd.map(|c| c / brightest.strength_cd());
        let first = rows.start.saturating_sub(1);
        lamp(&run[first..(rows.end + 1).min(run.len())], rgb, |i, instant: &Instant| {
            if rows.contains(&(first + i)) { instant.strength_cd() } else { 0.0 }
        })
    }))
}

/// True if two rows have the same color within the resolution of the file.
fn same_color(a: &Instant, b: &Instant) -> bool {
    // Compares x / a with y / b in each channel, as products to avoid a division by zero.
    let (a_cd, b_cd) = (a.strength_cd(), b.strength_cd());
    let mut channels = a.rgb_cd.iter().zip(&b.rgb_cd);
    channels.all(|(x, y)| (x * b_cd - y * a_cd).abs() <= DIGIT_CD * (a_cd + b_cd))
}

/// Returns a lamp that shines in all directions. `instant_cd` takes the index and the values of an
/// instant, and returns the lamp's intensity. The maximum intensity becomes level 1.
fn lamp(run: &[Instant], rgb: [f64; 3], instant_cd: impl Fn(usize, &Instant) -> f64) -> Lamp {
    let intensities_cd: Vec<f64> =
        run.iter().enumerate().map(|(i, instant)| instant_cd(i, instant)).collect();
    let intensity_cd = intensities_cd.iter().copied().fold(0.0, f64::max);
    let samples = run.iter().zip(&intensities_cd).map(|(instant, cd)| LightSample {
        time_s: instant.time_s,
        position_m: instant.position_m,
        axis: -Vector3::y(),
        level: if intensity_cd > 0.0 { cd / intensity_cd } else { 0.0 },
    });
    let emitter = Emitter {
        name: "trace".into(),
        intensity_cd,
        rgb,
        beam_exponent: 1.0,
        isotropic_fraction: 1.0,
        visible_cos: -1.0,
        diameter_m: 0.0,
        depth_m: None,
    };
    Lamp { drone: None, emitter, samples: samples.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "t,x,y,z,r,g,b,u\n0,0,0,1,0,0,0,9\n0.5,0.1,0,1,1,0.5,0,9\n\
                         1,0.2,0,1,0.5,0.25,0,9\n1.5,0.3,0,1,0,0,0,9\n2,0.4,0,1,0,0,0,9\n\
                         2.5,0.5,0,1,0,0,2,9\n3,0.6,0,1,0,1,0,9\n";

    fn read_with_warnings(text: &str) -> (LightTrace, String) {
        let Warned { product, warnings } = read(text.as_bytes(), "log").unwrap();
        let texts: Vec<String> = warnings.iter().map(ToString::to_string).collect();
        (product, texts.join("; "))
    }

    #[test]
    fn a_color_is_a_lamp_and_fades_into_the_next() {
        let trace = read(TABLE.as_bytes(), "light.csv").unwrap().product;
        let actual: Vec<_> = trace
            .lamps
            .iter()
            .map(|l| (l.emitter.rgb, l.samples.iter().map(|s| s.level).collect::<Vec<_>>()))
            .collect();
        let wanted = [
            ([1.0, 0.5, 0.0], vec![0.0, 1.0, 0.5, 0.0]),
            ([0.0, 0.0, 1.0], vec![0.0, 1.0, 0.0]),
            ([0.0, 1.0, 0.0], vec![0.0, 1.0]),
        ];
        assert_eq!(actual, wanted);
        assert_eq!(trace.lamps[1].emitter.intensity_cd, 2.0, "2 cd of blue");
        assert_eq!(trace.lamps[0].emitter.intensity_cd(-0.7), 1.0, "to all sides");
    }

    #[test]
    fn a_continuously_changing_color_is_three_lamps() {
        let mut text = "t,x,y,z,r,g,b\n".to_owned();
        for i in 0..40 {
            text += &format!("{i},0,0,1,{},{},0.5\n", 0.9 - f64::from(i) * 0.02, i);
        }
        let trace = read(text.as_bytes(), "light.csv").unwrap().product;
        assert_eq!(trace.lamps.len(), 3, "red, green, blue");
    }

    #[test]
    fn light_logs_of_other_programs_are_traces_in_their_colors() {
        fn body(separator: &str, unit: f64) -> String {
            let rows = (0..5).map(|i: u32| {
                let t = f64::from(i) * 0.2 * unit;
                let cells = [format!("{t:.3}"), "0.5".into(), "0.1".into(), "1.2".into()];
                cells.join(separator) + separator + &["255", "128", "0"].join(separator) + "\n"
            });
            rows.collect()
        }
        let logs = [
            format!("# time,X,Y,Z,R,G,B\n{}", body(",", 1.0)),
            format!("Time (s);x;y;z;Red;Green;Blue\n{}", body(";", 1.0).replace('.', ",")),
            format!("timestamp\tx\ty\tz\tr\tg\tb\r{}", body("\t", 1e3).replace('\n', "\r")),
            format!("# light painting\n# t x y z R G B\n{}", body(" ", 1.0)),
            format!("Time [msec],x [m],y [m],z [m],Red,Green,Blue\n{}", body(",", 1e3)),
            format!("Time_msec,x_m,y_m,z_m,Red,Green,Blue\n{}", body(",", 1e3)),
            format!("time_ms,pos_x,pos_y,pos_z,led_r,led_g,led_b\n{}", body(",", 1e3)),
        ];
        for log in &logs {
            assert!(is_light_trace(log.as_bytes()), "{log}");
            let (trace, said) = read_with_warnings(log);
            assert!(said.contains("0 to 255"), "{said}");
            let lamp = &trace.lamps[0];
            assert_eq!(trace.lamps.len(), 1, "one color");
            assert_eq!(lamp.emitter.intensity_cd, 1.0);
            let green = lamp.emitter.rgb[1];
            assert!((green - 128.0 / 255.0).abs() < 1e-6 && lamp.emitter.rgb[2] == 0.0, "{lamp:?}");
            assert_eq!(lamp.samples.last().unwrap().time_s, 0.8, "{log}");
        }
        let named = "t,drone,x,y,z,r,g,b\n0,cf1,0,0,1,0,1,0\n1,cf1,0,0,1,0,1,0\n";
        let (trace, said) = read_with_warnings(named);
        assert_eq!((trace.lamps.len(), said.contains("drone")), (1, true), "{said}");
        let clock = named.replace("\n0,", "\n11:00:00,").replace("\n1,", "\n11:00:01,");
        let error = read(clock.as_bytes(), "log").unwrap_err();
        assert!(error.hint().contains("times in seconds"), "{error}");
        let own = "t,x,y,z,r,g,b\n0,0,0,1,255,0,0\n1,0,0,1,255,0,0\n";
        let (trace, said) = read_with_warnings(own);
        assert_eq!(trace.lamps[0].emitter.intensity_cd, 255.0);
        assert!(said.contains("candela"), "{said}");
        assert!(!is_light_trace(b"t,x,y,z,yaw\n0,0,0,0,0\n"));
    }

    #[test]
    fn a_lamp_that_is_too_fast_for_a_drone_is_warned_of() {
        fn said(unit: f64, apart: f64) -> String {
            let rows = (0..40_u32).map(|i| {
                let (t, x) = (0.1 * f64::from(i / 2), 0.05 * f64::from(i / 2));
                format!("{t},{},0,1,1,0,0\n", unit * (x + apart * f64::from(i % 2)))
            });
            let text = "t,x,y,z,r,g,b\n".to_owned() + &rows.collect::<String>();
            read_with_warnings(&text).1
        }
        assert_eq!(said(1.0, 0.0), "");
        assert!(said(100.0, 0.0).contains("another unit"), "{}", said(100.0, 0.0));
        assert!(said(1.0, 1.0).contains("20 of 39 steps"), "{}", said(1.0, 1.0));
    }

    proptest::proptest! {
        #[test]
        fn a_column_that_is_not_read_is_named(title in "[a-z]{4,9}q") {
            let log = format!("time,x,y,z,R,G,B,{title}\n0,0,0,1,9,9,9,7\n1,0,0,1,9,9,9,7\n");
            let (_, said) = read_with_warnings(&log);
            proptest::prop_assert!(said.contains(&title), "{said}");
        }
    }

    #[test]
    fn a_broken_cell_is_named_by_line_and_column() {
        let cases = [
            ("t,x,y,z,r,g,b\n0,0,0,1,1,1,1\n1,0,NaN,1,1,1,1\n", ":3: column y"),
            ("t,x,y,z,r,g,b\n0,0,0,1,1,1,1\n1,0,0,1,1,-1,1\n", ":3: column g"),
            ("t,x,y,z,r,g,b\n1,0,0,1,1,1,1\n0,0,0,1,1,1,1\n", ":3: column t"),
        ];
        for (text, place) in cases {
            let error = read(text.as_bytes(), "light.csv").unwrap_err();
            assert!(error.to_string().contains(&format!("light.csv{place}")), "{error}");
        }
    }
}
