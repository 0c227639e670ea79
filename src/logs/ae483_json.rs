//! JSON logs of the AE483 course, in its three dialects.
//!
//! - 2021: `{"var": {"time": [ms], "data": []}, "start_time": …}`
//! - 2022: `{"var": {"time": [ms], "data": []}}`
//! - 2024–25: `{"drone": {"var": {"time": [s], "data": []}}, "mocap": {"time": [s], "x": [], …}}`
//!
//! All are read by one rule: an object with `time` and `data` is a variable, one with `time` and
//! other lists is a block of variables, other objects are folders whose name goes before the names
//! in them (`drone` excepted). A list of objects with a time is a block by rows, as scripts of
//! cflib and pandas' `to_json(orient="records")` write it, and lists beside one of times are its
//! columns, both under the usual names of plain CSV too.
//! Other numbers, texts and lists are skipped. Python writes `NaN` and
//! `Infinity`, which are not JSON; they are read as missing values.

use std::collections::BTreeMap;

use super::json_tree::{self, List, Node, joined};
use super::recording::{Block, Clock, Column, Recording, shortened};
use super::{ImportOptions, MAX_VARIABLES, TimeUnit, plain_csv};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::Budget;
use noctograph_core::flight::stamps::SLOWEST_PERIOD_S;
use noctograph_core::statistics::median;

/// Radio logs stamp with 24 bits of milliseconds (three bytes in the log packet).
const WRAP_S: f64 = 16_777.216;

/// Steps of reading a byte of text.
const STEPS: usize = 3;

/// Reads a JSON log.
pub(super) fn read(
    bytes: &[u8],
    file: &str,
    options: &ImportOptions,
    budget: &Budget,
) -> Result<Recording> {
    budget.steps(STEPS * bytes.len())?;
    budget.bytes(bytes.len())?;
    let mut text = bytes.to_vec();
    replace_nan(&mut text);
    let mut warnings = Vec::new();
    let left = budget.bytes_left();
    let broken = |source: serde_json::Error| match budget.check() {
        Ok(()) => broken(file, &source),
        Err(error) => error,
    };
    let value = match json_tree::read(&text, budget) {
        Ok(value) => value,
        Err(source) if source.is_eof() => {
            let place = format!("{}:{}", source.line(), source.column());
            warnings.push(format!("the file ends too early, at {place}; the part before is read"));
            close(&mut text);
            budget.free(left - budget.bytes_left());
            json_tree::read(&text, budget).map_err(broken)?
        }
        Err(source) => return Err(broken(source)),
    };
    drop(text);
    let mut reader = Reader {
        file,
        budget,
        blocks: Vec::new(),
        warnings,
        skipped: Vec::new(),
        open: Vec::new(),
        firmware: None,
    };
    let in_seconds = match value {
        Node::Object(mut top) => {
            let in_seconds = top.contains_key("drone") || top.contains_key("mocap");
            reader.columns(&mut top)?;
            reader.folder(top, "")?;
            in_seconds
        }
        Node::List(list) if reader.rows("", &list)? => false,
        _ => {
            let wanted = "an object of variables, each with time and data, or a list of rows, each \
                          an object with a time";
            return Err(Error::input(file, "JSON of another shape", wanted, HINT));
        }
    };
    let Reader { mut blocks, mut warnings, skipped, open, firmware, .. } = reader;
    if !skipped.is_empty() {
        warnings.push(format!("not read: {}", shortened(&skipped)));
    }
    settle_units(&mut blocks, in_seconds, options.time_unit, &mut warnings);
    for block in &mut blocks {
        plain_csv::settle_angles(block, &open, options.angle_unit, &mut warnings);
    }
    let (file, wrap_s) = (file.to_owned(), Some(WRAP_S));
    Ok(Recording { file, blocks, warnings, wrap_s, firmware, ..Recording::default() })
}

/// Puts all stamps in seconds. One clock has one unit, which its fastest block shows: blocks of
/// events have steps of any length.
fn settle_units(
    blocks: &mut [Block],
    in_seconds: bool,
    wanted: TimeUnit,
    warnings: &mut Vec<String>,
) {
    for clock in [Clock::Drone, Clock::Mocap] {
        let of_clock = |block: &&mut Block| block.clock == clock;
        let steps = blocks.iter_mut().filter(of_clock).filter_map(|block| {
            let steps = block.time_s.windows(2).map(|pair| pair[1] - pair[0]);
            median(steps.filter(|step| *step > 0.0))
        });
        let step = steps.fold(f64::INFINITY, f64::min);
        let unit_s = wanted.seconds().unwrap_or_else(|| unit_s(step, in_seconds));
        if wanted.seconds().is_none() && in_seconds && unit_s != 1.0 && step.is_finite() {
            warnings.push(format!(
                "stamps {step} apart are taken as {unit_s} s a unit: no Crazyflie logs so slowly in \
                 seconds"
            ));
        }
        // By the number that a unit is of a second, so that 10 ms are 0.01 s to the last bit.
        let per_s = (1.0 / unit_s).round();
        for time_s in blocks.iter_mut().filter(of_clock).flat_map(|block| &mut block.time_s) {
            *time_s /= per_s;
        }
    }
}

/// Seconds of a unit of stamps by their steps. Log periods are 10 ms to 2.55 s, so that longer
/// steps are ms, and those below 0.5 are s; in between, the dialect decides.
fn unit_s(step: f64, in_seconds: bool) -> f64 {
    match step {
        step if step.is_infinite() && in_seconds => 1.0,
        step if step.is_infinite() => 1e-3,
        step if step > 1e3 * SLOWEST_PERIOD_S * 1e3 => 1e-9,
        step if step > 1e3 * SLOWEST_PERIOD_S => 1e-6,
        step if step > SLOWEST_PERIOD_S => 1e-3,
        step if step < 0.5 => 1.0,
        _ if in_seconds => 1.0,
        _ => 1e-3,
    }
}

const HINT: &str = "give a log as the AE483 client writes it: {\"stateEstimate.x\": {\"time\": \
                    [...], \"data\": [...]}, ...}";

fn broken(file: &str, source: &serde_json::Error) -> Error {
    let place = format!("{file}:{}:{}", source.line(), source.column());
    Error::input(place, source, "JSON", HINT)
}

/// Replaces Python's NaN and infinities by `""` and spaces of the same length.
fn replace_nan(text: &mut [u8]) {
    let (mut i, mut in_string) = (0, false);
    while i < text.len() {
        match text[i] {
            b'\\' if in_string => i += 1,
            b'"' => in_string = !in_string,
            b'N' | b'I' | b'-' if !in_string => {
                let odd = [&b"NaN"[..], b"Infinity", b"-Infinity", b"-NaN"];
                if let Some(odd) = odd.into_iter().find(|odd| text[i..].starts_with(odd)) {
                    text[i..i + odd.len()].fill(b' ');
                    text[i..i + 2].fill(b'"');
                    i += odd.len() - 1;
                }
            }
            _ => {}
        }
        i += 1;
    }
}

/// Cuts a text that ends too early after its last whole member, and closes the open brackets.
fn close(text: &mut Vec<u8>) {
    let (mut open, mut cut) = (Vec::new(), (0, Vec::new()));
    let (mut in_string, mut escaped) = (false, false);
    for (i, &byte) in text.iter().enumerate() {
        if in_string {
            in_string = escaped || byte != b'"';
            escaped = byte == b'\\' && !escaped;
            continue;
        }
        match byte {
            b'"' => in_string = true,
            b'{' => open.push(b'}'),
            b'[' => open.push(b']'),
            b'}' | b']' => {
                open.pop();
                cut = (i + 1, open.clone());
            }
            b',' => cut = (i, open.clone()),
            _ => {}
        }
    }
    let (end, closing) = cut;
    text.truncate(end);
    text.extend(closing.iter().rev());
}

struct Reader<'a> {
    file: &'a str,
    budget: &'a Budget,
    blocks: Vec<Block>,
    warnings: Vec<String>,
    /// Members that are no part of a log.
    skipped: Vec<String>,
    /// Angles of rows without a unit.
    open: Vec<String>,
    /// The drone's firmware, as the log names it.
    firmware: Option<String>,
}

impl Reader<'_> {
    fn folder(&mut self, members: BTreeMap<String, Node>, prefix: &str) -> Result<()> {
        for (key, value) in members {
            let name = joined(prefix, &key, self.budget)?;
            let mut inner = match value {
                Node::List(list) => {
                    if !self.rows(&name, &list)? {
                        self.skipped.push(format!("{name} (a list without times)"));
                    }
                    continue;
                }
                Node::Object(inner) if is_metadata(&name) && !inner.contains_key("time") => {
                    inner.iter().for_each(|(key, value)| self.firmware(key, value));
                    continue;
                }
                Node::Object(inner) => inner,
                Node::Missing => continue,
                value @ (Node::Text(_) | Node::Number(_)) if is_metadata(&name) => {
                    self.firmware(&key, &value);
                    continue;
                }
                value => {
                    self.skipped.push(format!("{name} ({})", value.text()));
                    continue;
                }
            };
            let timed_list = matches!(inner.get("time"), Some(Node::List(_)));
            if inner.contains_key("data") && inner.contains_key("time") {
                self.variable(&name, inner.remove("time"), inner.remove("data"))?;
            } else if timed_list {
                self.block(&name, inner)?;
            } else if key == "drone" && prefix.is_empty() {
                self.folder(inner, "")?;
            } else {
                self.folder(inner, &name)?;
            }
        }
        Ok(())
    }

    /// Keeps the drone's firmware, where a member names it.
    fn firmware(&mut self, key: &str, value: &Node) {
        if let (Node::Text(name), "firmware" | "firmware_version") = (value, key) {
            self.firmware.get_or_insert_with(|| name.clone());
        }
    }

    /// Adds a block of columns.
    fn add(&mut self, block: Block) -> Result<()> {
        self.blocks.push(block);
        let n = self.blocks.iter().map(|block| block.columns.len().max(1)).sum::<usize>();
        if n > MAX_VARIABLES {
            let wanted = format!("at most {MAX_VARIABLES}");
            return Err(Error::input(self.file, "too many variables", wanted, HINT));
        }
        Ok(())
    }

    /// Adds a variable to the block before it where their stamps are equal, else to a new block.
    fn variable(&mut self, name: &str, time: Option<Node>, data: Option<Node>) -> Result<()> {
        let mut time_s = self.numbers(&format!("{name}.time"), time)?;
        let mut values = self.numbers(&format!("{name}.data"), data)?;
        self.cut_to_shorter(name, &mut time_s, &mut values);
        let column = Column { name: name.to_owned(), values };
        let same = |block: &Block| block.clock == Clock::Drone && block.time_s == time_s;
        if self.blocks.last().is_some_and(same) {
            let mut block = self.blocks.pop().expect("it is the same");
            block.columns.push(column);
            return self.add(block);
        }
        let name = name.to_owned();
        self.add(Block { name, time_s, columns: vec![column], ..Block::default() })
    }

    fn block(&mut self, name: &str, mut members: BTreeMap<String, Node>) -> Result<()> {
        let mut time_s = self.numbers(&format!("{name}.time"), members.remove("time"))?;
        let mut columns = Vec::new();
        for (key, value) in members {
            if matches!(value, Node::List(_)) {
                let name = joined(name, &key, self.budget)?;
                columns.push(Column { values: self.numbers(&name, Some(value))?, name });
            }
        }
        for column in &mut columns {
            self.cut_to_shorter(&column.name, &mut time_s, &mut column.values);
        }
        for column in &mut columns {
            column.values.truncate(time_s.len());
        }
        self.add(Block { name: name.to_owned(), clock: clock_of(name), time_s, columns })
    }

    /// Takes the lists of an object, one of them of times, as columns under the usual names of
    /// plain CSV; leaves the rest.
    fn columns(&mut self, members: &mut BTreeMap<String, Node>) -> Result<()> {
        let is_list = |key: &String| matches!(members[key], Node::List(_));
        let titles: Vec<String> = members.keys().filter(|key| is_list(key)).cloned().collect();
        self.budget.steps(10_000 * titles.len())?;
        let Some(time) = titles.iter().find(|title| plain_csv::meaning(title).0 == "t") else {
            return Ok(());
        };
        let mut block = Block { name: "columns".to_owned(), ..Block::default() };
        block.time_s = self.scaled(members, time)?;
        for title in titles.iter().filter(|title| *title != time) {
            let (name, unit) = plain_csv::meaning(title);
            if unit.is_none() {
                self.open.push(name.clone());
            }
            let mut values = self.scaled(members, title)?;
            self.cut_to_shorter(title, &mut block.time_s, &mut values);
            block.columns.push(Column { name, values });
        }
        let n = block.time_s.len();
        block.columns.iter_mut().for_each(|column| column.values.truncate(n));
        self.add(block)
    }

    /// Takes a list of numbers, in the unit of its title.
    fn scaled(&self, members: &mut BTreeMap<String, Node>, title: &str) -> Result<Vec<f64>> {
        let unit = plain_csv::meaning(title).1.unwrap_or(1.0);
        let values = self.numbers(title, members.remove(title))?;
        Ok(values.into_iter().map(|value| value * unit).collect())
    }

    /// Adds the columns of a list of objects, each with a time; returns whether it is one. Rows
    /// without a time are left out, and cells that a row lacks are missing values.
    fn rows(&mut self, name: &str, list: &List) -> Result<bool> {
        let is_time = |key: &&String| plain_csv::meaning(key).0 == "t";
        // What a name means costs more than to compare it.
        self.budget.steps(10_000 * list.cells.len())?;
        let Some(time) = list.cells.keys().find(is_time) else { return Ok(false) };
        let unit_s = plain_csv::meaning(time).1.unwrap_or(1.0);
        let rows = &list.cells[time];
        self.budget.bytes(size_of::<f64>() * rows.len() * list.cells.len())?;
        let mut columns = Vec::new();
        for (key, cells) in list.cells.iter().filter(|(key, _)| *key != time) {
            let (name, unit) = match name {
                "" => {
                    let (name, unit) = plain_csv::meaning(key);
                    if unit.is_none() {
                        self.open.push(name.clone());
                    }
                    (name, unit)
                }
                folder => (joined(folder, key, self.budget)?, None),
            };
            let mut values = vec![f64::NAN; rows.len()];
            let mut at = 0;
            for (row, value) in cells {
                at += rows[at..].iter().take_while(|(timed, _)| timed < row).count();
                if rows.get(at).is_some_and(|(timed, _)| timed == row) {
                    values[at] = value * unit.unwrap_or(1.0);
                }
            }
            columns.push(Column { name, values });
        }
        let time_s = rows.iter().map(|(_, stamp)| stamp * unit_s).collect();
        self.add(Block { name: name.to_owned(), clock: clock_of(name), time_s, columns })?;
        Ok(true)
    }

    fn cut_to_shorter(&mut self, name: &str, time_s: &mut Vec<f64>, values: &mut Vec<f64>) {
        let (n_time, n_data) = (time_s.len(), values.len());
        if n_time != n_data {
            let text =
                format!("{name}: {n_time} stamps for {n_data} values; the longer list is cut");
            self.warnings.push(text);
        }
        time_s.truncate(n_data);
        values.truncate(n_time);
    }

    fn numbers(&self, name: &str, value: Option<Node>) -> Result<Vec<f64>> {
        let refuse = |place: String, found: String| {
            Err(Error::input(place, found, "a list of numbers", HINT))
        };
        match value {
            Some(Node::List(List { odd: Some((index, found)), .. })) => {
                refuse(format!("{}: {name}[{index}]", self.file), found)
            }
            Some(Node::List(list)) => Ok(list.numbers),
            other => {
                let found = other.map_or_else(String::new, |node| node.text());
                refuse(format!("{}: {name}", self.file), found)
            }
        }
    }
}

/// Whether a member says of a log whose it is and when it was made, which changes nothing: those of
/// the course's client, and those that an exported script writes.
fn is_metadata(name: &str) -> bool {
    const NAMES: [&str; 14] = [
        "noctograph",
        "firmware",
        "start_time",
        "end_time",
        "uri",
        "address",
        "drone_id",
        "word",
        "scene",
        "plan",
        "date",
        "program",
        "version",
        "metadata",
    ];
    let ends = ["_sha256", "_digest", "_version"];
    NAMES.contains(&name)
        || ends.iter().any(|end| name.ends_with(end))
        || name.starts_with("metadata.")
}

/// The clock of a block by its name.
fn clock_of(name: &str) -> Clock {
    if name == "mocap" || name.starts_with("mocap.") { Clock::Mocap } else { Clock::Drone }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8], file: &str) -> Result<Recording> {
        super::read(bytes, file, &ImportOptions::default(), &Budget::of(file, HINT))
    }

    #[test]
    fn the_three_dialects_give_seconds_and_names() {
        let dialects = [
            r#"{"start_time": 3.5, "a.b": {"time": [10, 20], "data": [1, 2]}, "end_time": 9}"#,
            r#"{"a.b": {"time": [10, 20], "data": [1, 2]}}"#,
            r#"{"drone": {"a.b": {"time": [0.010, 0.020], "data": [1, 2]}}, "mocap": {}}"#,
        ];
        for dialect in dialects {
            let log = read(dialect.as_bytes(), "log.json").unwrap();
            assert_eq!(log.names().collect::<Vec<_>>(), ["a.b"], "{dialect}");
            assert_eq!(log.blocks[0].time_s, [0.01, 0.02], "{dialect}");
        }
    }

    #[test]
    fn a_list_of_rows_is_a_block() {
        let rows = r#"[{"timestamp": 10, "stateEstimate.x": 1, "note": "a"},
            {"timestamp": 20, "data": {"stateEstimate.x": 2, "stateEstimate.y": 5}}]"#;
        let log = read(rows.as_bytes(), "log.json").unwrap();
        assert_eq!(log.blocks[0].time_s, [0.01, 0.02], "milliseconds");
        assert_eq!(log.channel("stateEstimate.x").unwrap().values, [1.0, 2.0]);
        assert_eq!(log.channel("stateEstimate.y").unwrap().values, [5.0]);
        let log = read(br#"[{"t": 0.1, "x_mm": 100, "y": 2}, {"t": 0.2}]"#, "log.json").unwrap();
        assert_eq!(log.channel("x_m").unwrap().values, [0.1]);
        let mocap = r#"{"drone": {}, "mocap": [{"time": 1.0, "x": 3}, {"time": 1.01, "x": 4}]}"#;
        let log = read(mocap.as_bytes(), "log.json").unwrap();
        assert_eq!(log.channel("mocap.x").unwrap().values, [3.0, 4.0]);
        assert_eq!(log.blocks[0].clock, Clock::Mocap);
        assert!(read(b"[{\"x\": 1}]", "log.json").unwrap_err().to_string().contains("a time"));
        assert!(read(b"[1, 2]", "log.json").is_err());
    }

    #[test]
    fn lists_beside_one_of_times_are_columns() {
        let text =
            br#"{"note": "a", "t_ms": [10, 20], "x_mm": [100, 200], "stateEstimate.y": [1, 2, 3],
            "stateEstimate.z": {"time": [10, 20], "data": [5, 6]}}"#;
        let log = read(text, "log.json").unwrap();
        assert_eq!(log.blocks[0].time_s, [0.01, 0.02]);
        assert_eq!(log.channel("x_m").unwrap().values, [0.1, 0.2]);
        assert_eq!(log.channel("stateEstimate.y").unwrap().values, [1.0, 2.0]);
        assert_eq!(log.channel("stateEstimate.z").unwrap().values, [5.0, 6.0]);
        let warnings = log.warnings.join("\n");
        assert!(
            warnings.contains("2 stamps for 3 values") && warnings.contains("note"),
            "{warnings}"
        );
    }

    #[test]
    fn python_nan_is_a_missing_value() {
        let text = r#"{"drone": {}, "mocap": {"time": [1.0, 1.1, 1.2, 1.3, 1.4], "x": [1, NaN, -Infinity, null, 5]}}"#;
        let log = read(text.as_bytes(), "log.json").unwrap();
        assert_eq!(log.blocks[0].clock, Clock::Mocap);
        assert_eq!(log.channel("mocap.x").unwrap().values, [1.0, 5.0]);
    }

    #[test]
    fn a_log_that_ends_too_early_is_read_up_to_there() {
        let text = r#"{"a": {"time": [10, 20, 30], "data": [1, 2, 3]}, "b": {"time": [10, 20, 30], "data": [4, 5.5"#;
        let log = read(text.as_bytes(), "log.json").unwrap();
        assert_eq!(log.channel("a").unwrap().values, [1.0, 2.0, 3.0]);
        assert_eq!(log.channel("b").unwrap().values, [4.0], "the last number may be cut");
        assert_eq!(log.warnings.len(), 2, "end, and lengths: {:?}", log.warnings);
    }

    #[test]
    fn values_that_would_take_too_much_memory_are_refused_before_they_do() {
        for (value, n) in [("{\"t\":1},", 8_000_000), ("[0],", 17_000_000), ("0,", 25_000_000)] {
            let text = format!("[{}0]", value.repeat(n));
            let error = read(text.as_bytes(), "log.json").unwrap_err().to_string();
            assert!(error.contains("than an input may"), "{value}: {error}");
        }
    }

    /// A number at the end of objects within each other, each under a long name.
    fn nested(depth: usize, name: &str, number: &str) -> String {
        format!("{{\"{name}\":").repeat(depth) + number + &"}".repeat(depth)
    }

    #[test]
    fn long_names_within_each_other_are_refused_before_they_are_joined() {
        let leaves: String = (0..5000).map(|n| format!("\"{n}\":1,")).collect();
        let leaves = format!("{{{leaves}\"x\":1}}");
        let rows = format!("[{{\"t\":0,\"a\":{}}}]", nested(100, &"k".repeat(20_000), &leaves));
        let folders = nested(100, &"k".repeat(20_000), &leaves);
        for text in [rows, folders] {
            let error = read(text.as_bytes(), "log.json").map(|log| log.blocks.len()).unwrap_err();
            assert!(error.to_string().contains("log.json: found"), "{error}");
        }
    }

    #[test]
    fn broken_json_is_named_by_line_and_column_and_a_wrong_value_by_its_key() {
        let error = read(b"{\"a\": {\"time\": [1],\n \"data\": [x]}}", "log.json").unwrap_err();
        assert!(error.to_string().contains("log.json:2:11"), "{error}");
        let error = read(br#"{"a": {"time": [1, "q"], "data": [1, 2]}}"#, "log.json").unwrap_err();
        assert!(error.to_string().contains("a.time[1]"), "{error}");
    }
}
