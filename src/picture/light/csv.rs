//! Light traces as tables, for trails from other programs.
//!
//! Columns `t` (s), `x`, `y`, `z` (world, m) and `r`, `g`, `b` (linear sRGB, cd in every
//! direction); more columns are allowed. A table has no beams.
//!
//! The logs of lights of other programs are read, too ([`read`]): titles of `TITLES` in any case,
//! after `#`, in every form of [`noctograph_core::files::plain_text`]; stamps in ms, µs or ns by
//! their steps; levels of 0 to 255, of which 255 is 1 cd. What is guessed or left out is said.

use std::io::Read;
use std::ops::Range;
use std::path::Path;

use nalgebra::Vector3;

use super::{Emitter, Lamp, LightSample, LightTrace};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::plain_text;
use noctograph_core::flight::stamps::{FoundUnit, unit_of};
use noctograph_core::flight::table::{Table, on_grid, write_table};

/// Columns of the file.
const COLUMNS: [&str; 7] = ["t", "x", "y", "z", "r", "g", "b"];

/// Resolution of an intensity: rows whose colors differ by no more have one color.
const DIGIT_CD: f64 = 1e-5;

/// Usual titles of the columns, in lower case.
const TITLES: [(&str, &[&str]); 7] = [
    ("t", &["t", "time", "t_s", "time_s", "timestamp", "seconds", "t [s]", "time [s]", "time (s)"]),
    ("x", &["x", "x_m", "px", "pos_x", "x [m]", "x (m)"]),
    ("y", &["y", "y_m", "py", "pos_y", "y [m]", "y (m)"]),
    ("z", &["z", "z_m", "pz", "pos_z", "z [m]", "z (m)"]),
    ("r", &["r", "red"]),
    ("g", &["g", "green"]),
    ("b", &["b", "blue"]),
];

/// Largest level of a light log in bytes, and the intensity that it is shown as.
const FULL_LEVEL: f64 = 255.0;
const FULL_CD: f64 = 1.0;

/// Our name of a title.
fn column(title: &str) -> Option<&'static str> {
    let title = title.trim().trim_matches('"').trim_start_matches(['#', '%']).trim().to_lowercase();
    TITLES.iter().find(|(_, titles)| titles.contains(&&*title)).map(|(name, _)| *name)
}

/// The first line of a text that is not empty.
fn head(text: &[u8]) -> String {
    let mut lines = text.split(|byte| *byte == b'\n');
    let line = lines.find(|line| !line.trim_ascii().is_empty()).unwrap_or_default();
    String::from_utf8_lossy(&line[..line.len().min(1 << 12)]).trim().to_owned()
}

/// Whether a text's first line is the header of a light trace.
#[must_use]
pub fn is_light_trace(text: &[u8]) -> bool {
    let head = head(&plain_text(&text[..text.len().min(1 << 16)]).text);
    let found: Vec<Option<&str>> = head.split(',').map(column).collect();
    COLUMNS.iter().all(|column| found.contains(&Some(column)))
}

/// Reads the text of a light trace or of another program's light log; `file` is its name in
/// messages. Returns what was guessed and what was left out as well.
///
/// # Errors
///
/// [`Error::Input`], as [`LightTrace::read_csv`].
pub fn read(text: &[u8], file: &str) -> Result<(LightTrace, Vec<String>)> {
    let plain = plain_text(text);
    let mut warnings = plain.notes;
    let head = head(&plain.text);
    let titles: Vec<&str> = head.split(',').map(str::trim).collect();
    let own = COLUMNS.iter().all(|column| titles.contains(column));
    let (mut names, mut others) = (Vec::new(), Vec::new());
    for title in &titles {
        let name = if own && COLUMNS.contains(title) { Some(*title) } else { column(title) };
        match name.filter(|name| !names.contains(&(*name).to_owned())) {
            Some(name) => names.push(name.to_owned()),
            None => {
                others.push((*title).to_owned());
                names.push(format!("other {title}"));
            }
        }
    }
    if !others.is_empty() {
        warnings.push(format!("columns of a light trace that are not read: {}", others.join(", ")));
    }
    let at = plain.text.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap_or(0);
    let end = plain.text[at..]
        .iter()
        .position(|byte| *byte == b'\n')
        .map_or(plain.text.len(), |n| at + n);
    // Empty lines before the head have no row.
    let names = names.join(",");
    let renamed = plain.text[..at].chain(names.as_bytes()).chain(&plain.text[end..]);
    let lines_before = plain.text[..at].iter().filter(|byte| **byte == b'\n').count();
    let table = Table::parse(renamed, file)?;
    let mut scale = Scale::default();
    if !own {
        let found = unit_of(table.column("t")?);
        if found.unit_s != 1.0 {
            let FoundUnit { unit_s, step, .. } = found;
            warnings.push(format!("stamps {step} apart: taken as {unit_s} s a unit"));
            scale.unit_s = unit_s;
        }
    }
    let colors = ["r", "g", "b"].map(|name| table.column(name));
    let values = colors.iter().flatten().flat_map(|column| column.iter());
    let most = values.clone().copied().fold(0.0, f64::max);
    let are_levels = most > 1.0 && most <= FULL_LEVEL && values.clone().all(|v| v.fract() == 0.0);
    if are_levels && own {
        warnings
            .push("r, g and b are whole numbers up to 255: they are candela all the same".into());
    } else if are_levels {
        scale.cd = FULL_CD / FULL_LEVEL;
        warnings.push(format!(
            "its colors are levels of 0 to 255, of which 255 is shown as {FULL_CD} cd"
        ));
    }
    Ok((LightTrace::from_table(&table, file, lines_before, &scale)?, warnings))
}

/// Units of a table's columns.
struct Scale {
    unit_s: f64,
    cd: f64,
}

impl Default for Scale {
    fn default() -> Self {
        Self { unit_s: 1.0, cd: 1.0 }
    }
}

impl LightTrace {
    /// Reads a light trace.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] where the file cannot be read, [`Error::Input`] with line and column where a
    /// cell is not a number, time falls, or an intensity is negative.
    pub fn read_csv(path: &Path) -> Result<Self> {
        Self::from_table(&Table::read(path)?, &path.display().to_string(), 0, &Scale::default())
    }

    /// Reads the text of a light trace; `file` is its name in messages.
    ///
    /// # Errors
    ///
    /// [`Error::Input`], as [`Self::read_csv`].
    pub fn parse_csv(text: impl Read, file: &str) -> Result<Self> {
        Self::from_table(&Table::parse(text, file)?, file, 0, &Scale::default())
    }

    fn from_table(table: &Table, file: &str, lines_before: usize, scale: &Scale) -> Result<Self> {
        let mut columns: [&[f64]; 7] = [&[]; 7];
        for (column, name) in columns.iter_mut().zip(COLUMNS) {
            *column = match name {
                "t" => table.times_in("t", scale.unit_s)?,
                name => table.quantity(name)?,
            };
        }
        let [t, x, y, z, r, g, b] = columns;
        let refused = |row: usize, column: &str, found: f64, wanted: &str| {
            let place = format!("{file}:{}: column {column}", lines_before + row + 2);
            Err(Error::input(place, found, wanted, "correct the file, or write it again"))
        };
        for (name, column) in [("r", r), ("g", g), ("b", b)] {
            if let Some(row) = column.iter().position(|value| !(0.0..=1e6).contains(value)) {
                return refused(row, name, column[row], "a number from 0 to 1e6");
            }
        }
        let instants: Vec<Instant> = (0..t.len())
            .map(|i| Instant {
                time_s: on_grid(t[i] * scale.unit_s),
                position_m: Vector3::new(x[i], y[i], z[i]),
                rgb_cd: [r[i], g[i], b[i]].map(|value| value * scale.cd),
            })
            .collect();
        let lamps = lit_runs(&instants).into_iter().flat_map(lamps).collect();
        Ok(Self { lamps })
    }

    /// Writes the trace as a table: its lamps one after another in order of time. A lamp with a
    /// beam is written with its intensity on the axis.
    ///
    /// # Errors
    ///
    /// Those of the writer, and [`std::io::ErrorKind::InvalidInput`] where two lamps are lit at one
    /// time: a table has one lamp.
    pub fn write_csv(&self, mut out: impl std::io::Write) -> std::io::Result<()> {
        let times = |lamp: &Lamp| Some((lamp.samples.first()?.time_s, lamp.samples.last()?.time_s));
        let mut lamps: Vec<(f64, f64, &Lamp)> =
            self.lamps.iter().filter_map(|lamp| times(lamp).map(|(a, b)| (a, b, lamp))).collect();
        lamps.sort_by(|a, b| a.0.total_cmp(&b.0));
        if lamps.windows(2).any(|pair| pair[1].0 < pair[0].1) {
            let what = "lamps that are lit at one time do not fit into one table";
            return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, what));
        }
        let rows = lamps.iter().flat_map(|(_, _, lamp)| {
            lamp.samples.iter().map(|LightSample { time_s, position_m: p, level, .. }| {
                let [r, g, b] = lamp.emitter.rgb.map(|c| c * lamp.emitter.intensity_cd * level);
                [*time_s, p.x, p.y, p.z, r, g, b].map(on_grid)
            })
        });
        write_table(&mut out, &COLUMNS.map(str::to_owned), rows)
    }
}

/// A row of the table.
struct Instant {
    time_s: f64,
    position_m: Vector3<f64>,
    rgb_cd: [f64; 3],
}

impl Instant {
    fn strength_cd(&self) -> f64 {
        self.rgb_cd.into_iter().fold(0.0, f64::max)
    }
}

/// Stretches with light, each with the dark instants at its ends.
fn lit_runs(instants: &[Instant]) -> Vec<&[Instant]> {
    let lit = |i: usize| instants[i].rgb_cd != [0.0; 3];
    let mut runs = Vec::new();
    let mut start = None;
    for i in 0..instants.len() {
        match start {
            None if lit(i) => start = Some(i.saturating_sub(1)),
            Some(first) if !lit(i) => {
                runs.push(&instants[first..=i]);
                start = None;
            }
            _ => {}
        }
    }
    runs.extend(start.map(|first| &instants[first..]));
    runs
}

/// Lamps of a lit run: one for each stretch of one color, which fades into the next, or one for
/// each channel of a color that changes continuously.
fn lamps(run: &[Instant]) -> Vec<Lamp> {
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
    if stretches.len() > run.len() / 8 + 2 {
        let channel =
            |c: usize| lamp(run, std::array::from_fn(|k| f64::from(k == c)), |_, i| i.rgb_cd[c]);
        return (0..3).map(channel).collect();
    }
    let one = |(rows, brightest): (Range<usize>, &Instant)| {
        let rgb = brightest.rgb_cd.map(|c| c / brightest.strength_cd());
        let first = rows.start.saturating_sub(1);
        let level = |i, instant: &Instant| {
            if rows.contains(&(first + i)) { instant.strength_cd() } else { 0.0 }
        };
        lamp(&run[first..(rows.end + 1).min(run.len())], rgb, level)
    };
    stretches.into_iter().map(one).collect()
}

/// Whether two rows have one color, within the resolution of the file.
fn same_color(a: &Instant, b: &Instant) -> bool {
    let (of_a, of_b) = (a.strength_cd(), b.strength_cd());
    let off = |(x, y): (&f64, &f64)| (x * of_b - y * of_a).abs();
    a.rgb_cd.iter().zip(&b.rgb_cd).all(|pair| off(pair) <= DIGIT_CD * (of_a + of_b))
}

/// A lamp without a beam, with its largest intensity at level 1.
fn lamp(run: &[Instant], rgb: [f64; 3], cd: impl Fn(usize, &Instant) -> f64) -> Lamp {
    let all_cd: Vec<f64> = run.iter().enumerate().map(|(i, instant)| cd(i, instant)).collect();
    let intensity_cd = all_cd.iter().copied().fold(0.0, f64::max);
    let samples = run.iter().zip(&all_cd).map(|(instant, cd)| LightSample {
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
        spill: 1.0,
        visible_cos: -1.0,
        diameter_m: 0.0,
    };
    Lamp { drone: None, emitter, samples: samples.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "t,x,y,z,r,g,b,u\n0,0,0,1,0,0,0,9\n0.5,0.1,0,1,1,0.5,0,9\n\
                         1,0.2,0,1,0.5,0.25,0,9\n1.5,0.3,0,1,0,0,0,9\n2,0.4,0,1,0,0,0,9\n\
                         2.5,0.5,0,1,0,0,2,9\n3,0.6,0,1,0,1,0,9\n";

    #[test]
    fn a_color_is_a_lamp_and_fades_into_the_next() {
        let trace = LightTrace::parse_csv(TABLE.as_bytes(), "light.csv").unwrap();
        let found: Vec<_> = trace
            .lamps
            .iter()
            .map(|l| (l.emitter.rgb, l.samples.iter().map(|s| s.level).collect::<Vec<_>>()))
            .collect();
        let wanted = [
            ([1.0, 0.5, 0.0], vec![0.0, 1.0, 0.5, 0.0]),
            ([0.0, 0.0, 1.0], vec![0.0, 1.0, 0.0]),
            ([0.0, 1.0, 0.0], vec![0.0, 1.0]),
        ];
        assert_eq!(found, wanted);
        assert_eq!(trace.lamps[1].emitter.intensity_cd, 2.0, "2 cd of blue");
        assert_eq!(trace.lamps[0].emitter.intensity_cd(-0.7), 1.0, "to all sides");
    }

    #[test]
    fn a_continuously_changing_color_is_three_lamps() {
        let mut text = "t,x,y,z,r,g,b\n".to_owned();
        for i in 0..40 {
            text += &format!("{i},0,0,1,{},{},0.5\n", 0.9 - f64::from(i) * 0.02, i);
        }
        let trace = LightTrace::parse_csv(text.as_bytes(), "light.csv").unwrap();
        assert_eq!(trace.lamps.len(), 3, "red, green, blue");
    }

    #[test]
    fn a_trace_of_one_color_reads_back() {
        let text: String = TABLE.lines().take(5).map(|line| line.to_owned() + "\n").collect();
        let trace = LightTrace::parse_csv(text.as_bytes(), "light.csv").unwrap();
        let mut file = Vec::new();
        trace.write_csv(&mut file).unwrap();
        assert_eq!(LightTrace::parse_csv(&file[..], "again.csv").unwrap(), trace);
        let two = LightTrace { lamps: [trace.lamps.clone(), trace.lamps].concat() };
        assert!(two.write_csv(&mut Vec::new()).is_err(), "two lamps at one time");
    }

    #[test]
    fn light_logs_of_other_programs_are_traces_in_their_colors() {
        let body = |separator: &str, unit: f64| -> String {
            let row = |i: u32| {
                let t = f64::from(i) * 0.2 * unit;
                let cells = [format!("{t:.3}"), "0.5".into(), "0.1".into(), "1.2".into()];
                cells.join(separator) + separator + &["255", "128", "0"].join(separator) + "\n"
            };
            (0..5).map(row).collect()
        };
        let logs = [
            format!("# time,X,Y,Z,R,G,B\n{}", body(",", 1.0)),
            format!("Time (s);x;y;z;Red;Green;Blue\n{}", body(";", 1.0).replace('.', ",")),
            format!("timestamp\tx\ty\tz\tr\tg\tb\r{}", body("\t", 1e3).replace('\n', "\r")),
            format!("# light painting\n# t x y z R G B\n{}", body(" ", 1.0)),
        ];
        for log in &logs {
            assert!(is_light_trace(log.as_bytes()), "{log}");
            let (trace, said) = read(log.as_bytes(), "log").unwrap();
            let said = said.join(" ");
            assert!(said.contains("0 to 255"), "{said}");
            let lamp = &trace.lamps[0];
            assert_eq!(trace.lamps.len(), 1, "one color");
            assert_eq!(lamp.emitter.intensity_cd, 1.0);
            let green = lamp.emitter.rgb[1];
            assert!((green - 128.0 / 255.0).abs() < 1e-6 && lamp.emitter.rgb[2] == 0.0, "{lamp:?}");
            assert_eq!(lamp.samples.last().unwrap().time_s, 0.8, "{log}");
        }
        let own = "t,x,y,z,r,g,b\n0,0,0,1,255,0,0\n1,0,0,1,255,0,0\n";
        let (trace, said) = read(own.as_bytes(), "log").unwrap();
        assert_eq!(trace, LightTrace::parse_csv(own.as_bytes(), "log").unwrap(), "candela");
        assert!(said[0].contains("candela"), "{said:?}");
        assert!(!is_light_trace(b"t,x,y,z,yaw\n0,0,0,0,0\n"));
    }

    proptest::proptest! {
        #[test]
        fn a_column_that_is_not_read_is_named(title in "[a-z]{4,9}q") {
            let log = format!("time,x,y,z,R,G,B,{title}\n0,0,0,1,9,9,9,7\n1,0,0,1,9,9,9,7\n");
            let (_, said) = read(log.as_bytes(), "log").unwrap();
            proptest::prop_assert!(said.join(" ").contains(&title), "{said:?}");
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
            let error = LightTrace::parse_csv(text.as_bytes(), "light.csv").unwrap_err();
            assert!(error.to_string().contains(&format!("light.csv{place}")), "{error}");
        }
    }
}
