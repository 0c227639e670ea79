//! Light traces as tables, for trails from other programs.
//!
//! Columns `t` (s), `x`, `y`, `z` (world, m) and `r`, `g`, `b` (linear sRGB, cd in every
//! direction). More columns are allowed. A table has no beams.
//!
//! The logs of lights of other programs are read, too ([`read`]): titles of `TITLES` in any case,
//! after `#`, in every form of table that [`Head`] knows, units in brackets, timestamps in ms, µs
//! or ns by their steps, levels from 0 to 255 (1 cd). Guesses and omissions are warnings.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::{Emitter, Lamp, LightSample, LightTrace, LightTraceData};
use noctograph_core::diagnostic::{Diagnostic, Warned};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Head, Text, bracketed, simplified, unit};
use noctograph_core::flight::table::{Table, on_grid};
use noctograph_core::flight::timestamps::unit_of;

const COLUMNS: [&str; 7] = ["t", "x", "y", "z", "r", "g", "b"];

/// Resolution of an intensity: rows whose colors differ by no more have one color.
const DIGIT_CD: f64 = 1e-5;

/// Usual titles of the columns, in lower case and without their unit.
const TITLES: [(&str, &str); 7] = [
    ("t", "t time timestamp seconds"),
    ("x", "x px pos_x"),
    ("y", "y py pos_y"),
    ("z", "z pz pos_z"),
    ("r", "r red led_r"),
    ("g", "g green led_g"),
    ("b", "b blue led_b"),
];

/// Speed that no drone reaches, and smaller steps than those of motion.
const FASTEST_M_S: f64 = 15.0;
const STEP_M: f64 = 1e-3;

/// Largest level of a light log in bytes, and the intensity that it is shown as.
const FULL_LEVEL: f64 = 255.0;
const FULL_CD: f64 = 1.0;

/// Our name of a title, and the size of the unit that it names in brackets.
fn column(title: &str) -> Option<(&'static str, Option<f64>)> {
    let (bare, bracket) = bracketed(title);
    let bare = simplified(bare);
    fn known(bare: &str) -> Option<&'static str> {
        Some(TITLES.iter().find(|(_, titles)| titles.split(' ').any(|known| known == bare))?.0)
    }
    let (name, text) = match (known(&bare), bare.rsplit_once('_')) {
        (Some(name), _) => (name, bracket.map(simplified)),
        (None, Some((bare, unit))) => (known(bare)?, Some(unit.to_owned())),
        (None, None) => return None,
    };
    match text {
        None => Some((name, None)),
        Some(text) => Some((name, Some(unit(&text, name == "t")?))),
    }
}

/// True if a text begins with the header of a light trace.
#[must_use]
pub fn is_light_trace(text: &[u8]) -> bool {
    let head = Head::find(&Text::decode(&text[..text.len().min(1 << 16)]).bytes);
    let names: Vec<_> = head.titles.iter().filter_map(|title| Some(column(title)?.0)).collect();
    COLUMNS.iter().all(|column| names.contains(column))
}

/// Reads the text of a light trace or of another program's light log. `file` is its name in
/// messages. Guesses and omissions are warnings.
///
/// # Errors
///
/// [`Error::Input`] with line and column if a cell is not a number, time falls, or an intensity is
/// negative.
pub fn read(text: &[u8], file: &str) -> Result<Warned<LightTrace>> {
    let text = Text::decode(text);
    let mut head = Head::find(&text.bytes);
    let is_trace = COLUMNS.iter().all(|column| head.has(column));
    // Titles become our names, and the first of several columns for one name counts.
    let (mut units, mut others) = (BTreeMap::new(), Vec::new());
    for title in &mut head.titles {
        match column(title).filter(|(name, _)| !units.contains_key(name)) {
            Some((name, unit)) => {
                units.insert(name, unit);
                *title = name.to_owned();
            }
            None => {
                others.push(title.clone());
                *title = format!("other {title}");
            }
        }
    }
    let table = Table::below(head, &text, file, |title| COLUMNS.contains(&title))?;
    let mut warnings = table.notes().to_vec();
    if !others.is_empty() {
        warnings.push(format!("columns of a light trace that are not read: {}", others.join(", ")));
    }
    let size = |name| units.get(name).copied().flatten();
    // The unit of time is in the title, or follows from the steps.
    let mut unit_s = size("t").unwrap_or(1.0);
    if !is_trace && size("t").is_none() {
        let timestamps = unit_of(table.column("t")?);
        unit_s = timestamps.unit_s;
        if unit_s != 1.0 {
            let step = timestamps.step;
            warnings.push(format!("timestamps {step} apart: taken as {unit_s} s a unit"));
        }
    }
    let unit_cd = unit_cd(&table, is_trace, &mut warnings);
    // Rows of the table, in s, m and cd.
    let t = table.times_in("t", unit_s)?;
    if let Some(first) = t.first().filter(|first| **first != 0.0) {
        let first_s = on_grid(first * unit_s);
        warnings.push(format!("its clock begins at {first_s} s, and the exposure at 0 s"));
    }
    // Positions may have any sign, intensities may not be negative.
    let [x, y, z] = [table.quantity("x")?, table.quantity("y")?, table.quantity("z")?];
    let [r, g, b] = [table.quantity("r")?, table.quantity("g")?, table.quantity("b")?];
    for (name, column) in [("r", r), ("g", g), ("b", b)] {
        if let Some(row) = column.iter().position(|value| !(0.0..=1e6).contains(value)) {
            let place = format!("{file}:{}: column {name}", table.line(row));
            let hint = "correct the file, or write it again";
            return Err(Error::input(place, column[row], "a number from 0 to 1e6", hint));
        }
    }
    let [x_m, y_m, z_m] = ["x", "y", "z"].map(|name| size(name).unwrap_or(1.0));
    let instants = Vec::from_iter((0..t.len()).map(|row: usize| Instant {
        time_s: on_grid(t[row] * unit_s),
        position_m: Vector3::new(x[row] * x_m, y[row] * y_m, z[row] * z_m),
        rgb_cd: [r[row], g[row], b[row]].map(|value| value * unit_cd),
    }));
    warnings.extend(too_fast(&instants));
    let lamps = lit_runs(&instants).flat_map(lamps).collect();
    let product = LightTrace::new(LightTraceData { lamps })?;
    Ok(Warned { product, warnings: Diagnostic::warnings("light-trace", warnings) })
}

/// Unit of the colors: whole numbers up to 255 are levels, except in a light trace.
fn unit_cd(table: &Table, is_trace: bool, warnings: &mut Vec<String>) -> f64 {
    let colors = ["r", "g", "b"].into_iter().filter_map(|name| table.column(name).ok()).flatten();
    let most = colors.clone().copied().fold(0.0, f64::max);
    if most <= 1.0 || most > FULL_LEVEL || colors.into_iter().any(|level| level.fract() != 0.0) {
        return 1.0;
    }
    let (unit_cd, warning) = match is_trace {
        true => {
            (1.0, "r, g and b are whole numbers up to 255: they are candela all the same".into())
        }
        false => {
            let warning =
                format!("its colors are levels of 0 to 255, and 255 is shown as {FULL_CD} cd");
            (FULL_CD / FULL_LEVEL, warning)
        }
    };
    warnings.push(warning);
    unit_cd
}

/// A warning of a lamp that is faster in a tenth of its steps than any drone is.
fn too_fast(instants: &[Instant]) -> Option<String> {
    let steps = instants.windows(2).map(|pair| {
        (pair[1].time_s - pair[0].time_s, (pair[1].position_m - pair[0].position_m).norm())
    });
    let moving: Vec<_> = steps.filter(|(_, step_m)| *step_m > STEP_M).collect();
    let fast = moving.iter().filter(|(step_s, step_m)| *step_m > FASTEST_M_S * step_s).count();
    (fast >= 3 && 10 * fast > moving.len()).then(|| {
        format!(
            "{fast} of {} steps are faster than {FASTEST_M_S} m/s: are the columns in another unit \
             (x_cm), or the rows of several drones? Keep those of one",
            moving.len()
        )
    })
}

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

/// Lamps of a lit run: one for each stretch of one color, which fades into the next, or one for
/// each channel of a color that changes continuously.
fn lamps(run: &[Instant]) -> Vec<Lamp> {
    // Stretches of one color, which is that of the brightest row so far.
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
    // Too many for a lamp each: the color changes continuously.
    if stretches.len() > run.len() / 8 + 2 {
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

/// True if two rows have one color, within the resolution of the file.
fn same_color(a: &Instant, b: &Instant) -> bool {
    let (a_cd, b_cd) = (a.strength_cd(), b.strength_cd());
    let mut channels = a.rgb_cd.iter().zip(&b.rgb_cd);
    channels.all(|(x, y)| (x * b_cd - y * a_cd).abs() <= DIGIT_CD * (a_cd + b_cd))
}

/// A lamp without a beam, with its largest intensity at level 1.
fn lamp(run: &[Instant], rgb: [f64; 3], cd: impl Fn(usize, &Instant) -> f64) -> Lamp {
    let light_cd: Vec<f64> = run.iter().enumerate().map(|(i, instant)| cd(i, instant)).collect();
    let intensity_cd = light_cd.iter().copied().fold(0.0, f64::max);
    let samples = run.iter().zip(&light_cd).map(|(instant, cd)| LightSample {
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
