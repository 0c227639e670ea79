//! Reads one flight from generated tables and JSON, with columns in any order and naming, and with
//! various units, separators, encodings, timestamps, and drone ids.

use proptest::prelude::*;
use proptest::sample::select;

use super::foreign::{check, place};
use super::*;

/// A function that returns a cell of a column, given the time and the position.
type Cells = fn(f64, [f64; 3]) -> String;

/// Returns whole seconds and their fraction.
fn parts(t: f64) -> (f64, f64) {
    ((t + 1e-9).floor(), (t + 1e-9).fract().max(0.0))
}

/// Returns a time of day in hours, minutes and seconds.
fn clock(t: f64, from_s: f64) -> String {
    let all_s = t + from_s;
    let minutes = (all_s / 60.0 + 1e-9).floor();
    format!("{:02}:{:02}:{:06.3}", (minutes / 60.0).floor(), minutes % 60.0, all_s - 60.0 * minutes)
}

/// Titles and cells of timestamps that need no other column.
const STAMPS: [(&str, Cells); 22] = [
    ("t", |t, _| format!("{t:.3}")),
    ("Time [msec]", |t, _| format!("{:.0}", 1e3 * t)),
    ("timestamp_us", |t, _| format!("{:.0}", 1e6 * t)),
    ("timestamp", |t, _| format!("{:.0}", 1.7e18 + 1e9 * (10.0 * t).round() / 10.0)),
    ("time_min", |t, _| format!("{:.8}", t / 60.0)),
    ("Elapsed (h)", |t, _| format!("{:.9}", t / 3600.0)),
    ("Zeit", |t, _| format!("{:.10}", 46_023.4 + t / 86_400.0)),
    ("datenum", |t, _| format!("{:.10}", 739_000.4 + t / 86_400.0)),
    ("Time", |t, _| clock(t, 43_190.0)),
    ("Time", |t, _| clock(t, 3590.0)[3..].to_owned()),
    ("time", |t, _| format!("0 days {}", clock(t, 0.0))),
    ("timestamp", |t, _| format!("2026-05-04T{}+02:00", clock(t, 43_190.0))),
    ("sec,nanosec", |t, _| format!("{},{:.0}", 17.0 + parts(t).0, 1e9 * parts(t).1)),
    ("Date,Time", |t, _| format!("04.05.2026,{}", clock(t, 43_190.0))),
    ("Uhrzeit,Datum", |t, _| format!("{},01.01.2026", clock(t, 43_190.0))),
    ("header.stamp.sec,header.stamp.nanosec", |t, _| {
        format!("{},{:.0}", 1.7e9 + parts(t).0, 1e9 * parts(t).1)
    }),
    ("field.header.stamp.secs,field.header.stamp.nsecs", |t, _| {
        format!("{},{:.0}", 1.7e9 + parts(t).0, 1e9 * parts(t).1)
    }),
    ("stamp_nanosec,stamp_sec", |t, _| format!("{:.0},{}", 1e9 * parts(t).1, parts(t).0)),
    ("tv_sec,tv_usec", |t, _| format!("{},{:.0}", parts(t).0, 1e6 * parts(t).1)),
    ("time (days)", |t, _| format!("{:.10}", t / 86_400.0)),
    ("datetime(UTC)", |t, _| format!("2026-01-01 {}", clock(t, 43_190.0))),
    ("Time", |t, _| clock((t + 86_395.0) % 86_400.0, 0.0)),
];

/// Titles and units of coordinates. `*` in a title stands for x, y or z.
const PLACES: [(&str, f64); 8] = [
    ("*", 1.0),
    ("pos_*", 1.0),
    ("pose.position.*", 1.0),
    ("* [m]", 1.0),
    ("*_cm", 100.0),
    ("* (mm)", 1000.0),
    ("p* [ft]", 1.0 / 0.3048),
    ("/cf1/pose/position/*", 1.0),
];

/// Titles and cells of other columns, which have no effect.
const OTHERS: [(&str, Cells); 4] = [
    ("mode", |t, _| if t < 5.0 { "climb".into() } else { "cruise".into() }),
    ("drone_id", |_, _| "7".into()),
    ("uri", |_, _| "radio://0/80/2M/E7E7E7E7E7".into()),
    ("pm.vbat", |t, _| format!("{:.2}", 4.1 - 0.02 * t)),
];

#[derive(Clone, Copy, Debug)]
enum Encoding {
    Utf8,
    Utf8Marked,
    Utf16(bool),
    Windows1252,
}

fn encoded(text: &str, encoding: Encoding) -> Vec<u8> {
    let mark = |is_marked: bool| if is_marked { "\u{feff}" } else { "" };
    match encoding {
        Encoding::Utf8 => text.into(),
        Encoding::Utf8Marked => format!("{}{text}", mark(true)).into(),
        Encoding::Utf16(is_marked) => {
            format!("{}{text}", mark(is_marked)).encode_utf16().flat_map(u16::to_le_bytes).collect()
        }
        Encoding::Windows1252 => {
            text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect()
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn a_table_is_read_in_any_order_naming_and_unit(
        (stamp_titles, stamp) in select(STAMPS.to_vec()),
        (title, scale) in select(PLACES.to_vec()),
        (other_title, other) in select(OTHERS.to_vec()),
        order in Just((0..5_usize).collect::<Vec<_>>()).prop_shuffle(),
        separator in select(vec![",", ";", "\t", "decimal comma"]),
        end in select(vec!["\n", "\r\n"]),
        encoding in select(vec![
            Encoding::Utf8, Encoding::Utf8Marked, Encoding::Utf16(true), Encoding::Utf16(false),
            Encoding::Windows1252,
        ]),
    ) {
        let row = |stamp: String, places: [String; 3], other: String| {
            let [x, y, z] = places;
            let columns = [stamp, x, y, z, other];
            let cells = order.iter().map(|column| columns[*column].clone());
            let cells = cells.collect::<Vec<_>>().join(",");
            match separator {
                "decimal comma" => cells.replace(',', ";").replace('.', ","),
                separator => cells.replace(',', separator),
            }
        };
        // Dates with points are not numbers with decimal commas.
        prop_assume!(separator != "decimal comma" || !["Date,Time", "Uhrzeit,Datum"].contains(&stamp_titles));
        let titles = ["x", "y", "z"].map(|axis| title.replace('*', axis));
        let mut text = row(stamp_titles.into(), titles, other_title.into()).replace(
            |sign| separator == "decimal comma" && sign == ',', ".") + end;
        for i in 0..=120 {
            let t = 0.1 * f64::from(i);
            let cells = place(t).map(|value| format!("{:.4}", scale * value));
            text += &(row(stamp(t, place(t)), cells, other(t, place(t))) + end);
        }
        let head = format!("# H\u{f6}he \u{b0}{end}");
        let bytes = encoded(&(head + &text), encoding);
        let flight = parse(&bytes, "log", &ImportOptions::default());
        let flight = flight.map_err(|error| TestCaseError::fail(format!("{error}\n{text:.300}")))?;
        check(&format!("{text:.300}"), &flight);
    }

    #[test]
    fn rows_of_two_drones_are_refused_by_the_name_of_their_column(
        title in select(vec![
            "drone_id", "Drone", "uri", "URI", "cf", "id", "uav_id", "robot_name", "Vehicle ID",
            "child_frame_id", "swarm_id",
        ]),
        names in select(vec![["0", "1"], ["cf1", "cf2"], ["radio://0/80/2M/1", "radio://0/80/2M/2"]]),
        place_of_name in 0..5_usize,
        apart_m in 0.05..3.0_f64,
        later_s in select(vec![0.0, 0.03]),
        in_turn: bool,
        as_json: bool,
    ) {
        let row = |which: usize, t: f64| {
            let ([x, y, z], which_f) = (place(t), if which == 1 { 1.0 } else { 0.0 });
            let cells = [t + later_s * which_f, x + apart_m * which_f, y, z];
            if as_json {
                let [t, x, y, z] = cells;
                let name = names[which];
                return format!(r#"{{"t":{t},"{title}":"{name}","x":{x},"y":{y},"z":{z}}}"#);
            }
            let mut cells = cells.map(|cell| format!("{cell:.4}")).to_vec();
            cells.insert(place_of_name, names[which].to_owned());
            cells.join(",")
        };
        let times = (0..=60).map(|i| 0.2 * f64::from(i));
        let rows: Vec<String> = if in_turn {
            times.flat_map(|t| [row(0, t), row(1, t)]).collect()
        } else {
            let pairs = [0, 1].into_iter().flat_map(|k| times.clone().map(move |t| (k, t)));
            pairs.map(|(k, t)| row(k, t)).collect()
        };
        let mut head = vec!["t", "x", "y", "z"];
        head.insert(place_of_name, title);
        let text = if as_json {
            format!("[{}]", rows.join(","))
        } else {
            format!("{}\n{}\n", head.join(","), rows.join("\n"))
        };
        let error = parse(text.as_bytes(), "log", &ImportOptions::default()).unwrap_err();
        let said = format!("column {title}: found rows of several drones");
        prop_assert!(error.to_string().contains(&said), "{error}\n{text:.200}");
    }

    #[test]
    fn json_is_read_in_every_form_of_pandas_and_of_cflib(
        form in 0..7_usize,
        stamps in 0..5_usize,
        has_group: bool,
    ) {
        let prefix = if has_group { "stateEstimate." } else { "" };
        let stamp = |t: f64| match stamps {
            0 => format!("{:.0}", 1e3 * t),
            1 => format!("{t:.1}"),
            2 => format!("{:.0}", 1.7e12 + 1e3 * t),
            3 => format!("{:.10}", 46_023.4 + t / 86_400.0),
            _ => format!("\"2026-05-04T{}Z\"", clock(t, 43_190.0)),
        };
        let cells = |t: f64| {
            let named = ["x", "y", "z"].iter().zip(place(t));
            named.map(|(axis, value)| format!("\"{prefix}{axis}\":{value}")).collect::<Vec<_>>().join(",")
        };
        let times: Vec<f64> = (0..=120).map(|i| 0.1 * f64::from(i)).collect();
        let all = |item: &dyn Fn(usize, f64) -> String, between: &str| {
            let items = times.iter().enumerate().map(|(i, t)| item(i, *t));
            items.collect::<Vec<_>>().join(between)
        };
        let key = |t: f64| format!("\"{}\"", stamp(t).trim_matches('"'));
        let column = |axis: usize, item: &dyn Fn(usize, f64) -> String| {
            let name = ["x", "y", "z"][axis];
            let cells = all(&|i, t| format!("{}:{}", item(i, t), place(t)[axis]), ",");
            format!("\"{prefix}{name}\":{{{cells}}}")
        };
        let columns = |item: &dyn Fn(usize, f64) -> String| {
            [0, 1, 2].map(|axis| column(axis, item)).join(",")
        };
        let text = match form {
            0 => {
                let stamps = all(&|i, t| format!("\"{i}\":{}", stamp(t)), ",");
                format!("{{\"time\":{{{stamps}}},{}}}", columns(&|i, _| format!("\"{i}\"")))
            }
            1 => format!("{{{}}}", columns(&|_, t| key(t))),
            2 => format!("{{{}}}", all(&|_, t| format!("{}:{{{}}}", key(t), cells(t)), ",")),
            3 => format!("[{}]", all(&|_, t| format!("{{\"time\":{},{}}}", stamp(t), cells(t)), ",")),
            4 => all(&|_, t| format!("{{\"time\":{},{}}}", stamp(t), cells(t)), "\n") + "\n",
            5 => {
                let (sec, nanosec) = (|t: f64| 17.0 + parts(t).0, |t: f64| (1e9 * parts(t).1).round());
                let header = |t: f64| format!("{{\"stamp\":{{\"sec\":{},\"nanosec\":{}}}}}", sec(t), nanosec(t));
                format!("[{}]", all(&|_, t| format!("{{\"header\":{},{}}}", header(t), cells(t)), ","))
            }
            _ => {
                let row = |t: f64| {
                    format!("[{}][Position]: {{{}}}", stamp(t), cells(t).replace('"', "'"))
                };
                all(&|_, t| row(t), "\n") + "\n"
            }
        };
        let flight = parse(text.as_bytes(), "log", &ImportOptions::default());
        let flight = flight.map_err(|error| TestCaseError::fail(format!("{error}\n{text:.300}")))?;
        check(&format!("{text:.300}"), &flight);
    }

    #[test]
    fn thousands_are_parted_by_commas_points_or_nothing(
        sign in select(vec![",", ".", ""]),
        separator in select(vec![",", ";", "\t"]),
        decimals in 0..2_usize,
        from_m in 0.0..3.0_f64,
    ) {
        let grouped = |value: f64| {
            let text = format!("{:.0}", value.round());
            let n = text.len();
            if value < 1000.0 { return text; }
            format!("{}{sign}{}", &text[..n - 3], &text[n - 3..])
        };
        let digits = if sign == "," && decimals > 0 { ".0" } else { "" };
        let quoted = |cell: String| if separator == "," { format!("\"{cell}\"") } else { cell };
        // In a comma-separated table, points are decimal points.
        prop_assume!(sign != "." || separator != ",");
        let mut text = ["t_ms", "x_mm", "y_mm", "z_mm"].join(separator) + "\n";
        for i in 0..=120 {
            let t = 0.1 * f64::from(i);
            let [x, y, z] = place(t);
            let cells = [1e3 * t, 1e3 * (x + from_m).max(0.0), 1e3 * (y + 4.0), 1e3 * z];
            let cells = cells.map(|cell| quoted(grouped(cell.max(0.0)) + digits));
            text += &(cells.join(separator) + "\n");
        }
        let flight = parse(text.as_bytes(), "log", &ImportOptions::default());
        let flight = flight.map_err(|error| TestCaseError::fail(format!("{error}\n{text:.300}")))?;
        prop_assert!((flight.samples.last().unwrap().time_s - 12.0).abs() < 0.02, "{text:.300}");
        let high_m = flight.samples.iter().map(|s| s.position_m.z).fold(0.0, f64::max);
        let wanted_m = (0..=120).map(|i| place(0.1 * f64::from(i))[2]).fold(0.0, f64::max);
        prop_assert!((high_m - wanted_m).abs() < 2e-3, "{high_m}, {wanted_m}: {text:.300}");
    }

    #[test]
    fn a_position_is_read_under_the_name_of_what_it_is_of_or_refused_by_its_columns(
        subject in select(vec!["drone", "tracker", "uav", "Quadrotor", "cf3", "vicon", "zorro", "thing"]),
        sign in select(vec!["_", ".", "/", " "]),
        has_target: bool,
        has_rates: bool,
    ) {
        let [x, y, z] = ["x", "y", "z"].map(|axis| format!("{subject}{sign}{axis}"));
        let mut head = format!("t,{x},{y},{z}");
        if has_target { head += ",target_x,target_y,target_z"; }
        if has_rates { head += ",gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"; }
        let mut text = head + "\n";
        for i in 0..=120 {
            let t = 0.1 * f64::from(i);
            let cells = place(t).map(|value| format!("{value:.4}")).join(",");
            text += &format!("{t:.1},{cells}");
            if has_target { text += &format!(",{cells}"); }
            if has_rates { text += &format!(",0,0,{:.2},0,0,9.8", 0.1 * t.sin()); }
            text += "\n";
        }
        let read = parse(text.as_bytes(), "log", &ImportOptions::default());
        if ["zorro", "thing"].contains(&subject) {
            let error = read.unwrap_err().to_string();
            prop_assert!([x, y, z].iter().all(|name| error.contains(name)), "{error}");
            return Ok(());
        }
        let flight = read.map_err(|error| TestCaseError::fail(format!("{error}")))?;
        for sample in &flight.samples {
            let off_m = (sample.position_m - Vector3::from(place(sample.time_s))).norm();
            prop_assert!(off_m < 0.02, "{off_m} m at {} s", sample.time_s);
        }
    }

    #[test]
    fn a_heading_alone_is_kept_from_every_source(
        (title, per_rad) in select(vec![
            ("stateEstimate.yaw", 57.295_779_513), ("stabilizer.yaw", 57.295_779_513),
            ("ctrlLee.rpyz", 1.0), ("yaw", 1.0), ("yaw_deg", 57.295_779_513), ("mocap.yaw", 1.0),
            ("ae483log.psi", 1.0),
        ]),
        yaw_rad in 0.1..1.5_f64,
    ) {
        let is_of_drone = title.contains('.');
        let prefix = if is_of_drone { "stateEstimate." } else { "" };
        let axes = ["x", "y", "z"].map(|axis| format!("{prefix}{axis}"));
        let stamp = if is_of_drone { "Timestamp" } else { "t" };
        let mut text = format!("{stamp},{},{title}\n", axes.join(","));
        for i in 0..=120 {
            let t = 0.1 * f64::from(i);
            let cells = place(t).map(|value| format!("{value:.4}")).join(",");
            let stamp = if is_of_drone { 1e3 * t } else { t };
            text += &format!("{stamp:.1},{cells},{:.4}\n", per_rad * (yaw_rad + 0.01 * (t % 2.0)));
        }
        let flight = parse(text.as_bytes(), "log", &ImportOptions::default()).unwrap();
        let yaws = flight.samples.iter().map(|sample| sample.attitude.yaw_rad);
        let [least, most] = [f64::min, f64::max].map(|f| yaws.clone().reduce(f).unwrap());
        prop_assert!(least > yaw_rad - 1e-3 && most < yaw_rad + 0.021, "{title}: {least} to {most}");
        let said = flight.warnings.iter().map(ToString::to_string).collect::<String>();
        prop_assert!(said.contains("only the yaw is logged"), "{said}");
    }

    #[test]
    fn a_single_sample_that_leaves_and_returns_is_named(
        step_s in 0.01..0.1_f64,
        aside_m in select(vec![-0.4, -0.25, 0.25, 0.4]),
        later_s in 4.5..5.5_f64,
        axis in 0..3_usize,
    ) {
        let mut text = "t,x,y,z\n".to_owned();
        let n = (12.0 / step_s).floor();
        for i in (0..).take_while(|i| f64::from(*i) < n) {
            let t = step_s * f64::from(i);
            let mut place = place(t);
            if (t - later_s).abs() <= 0.5 * step_s { place[axis] += aside_m; }
            text += &format!("{t:.4},{:.4},{:.4},{:.4}\n", place[0], place[1], place[2]);
        }
        let flight = parse(text.as_bytes(), "log", &ImportOptions::default()).unwrap();
        let said = flight.warnings.iter().map(ToString::to_string).collect::<String>();
        prop_assert!(said.contains("glitches"), "{said}");
    }
}
