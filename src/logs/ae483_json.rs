//! JSON logs of the AE483 course, in its three dialects.
//!
//! - 2021: `{"var": {"time": [ms], "data": []}, "start_time": …}`
//! - 2022: `{"var": {"time": [ms], "data": []}}`
//! - 2024–25: `{"drone": {"var": {"time": [s], "data": []}}, "mocap": {"time": [s], "x": [], …}}`
//!
//! All are read by one rule: an object with `time` and `data` is a variable, one with `time` and
//! other lists is a block of variables, other objects are folders whose name goes before the names
//! in them (`drone` excepted). A list of objects with a time is a block by rows, as scripts of
//! cflib and pandas' `to_json(orient="records")` write it, under the usual names of plain CSV too.
//! Other numbers, texts and lists are skipped. Python writes `NaN` and
//! `Infinity`, which are not JSON; they are read as missing values.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Map, Value};

use super::plain_csv;
use super::recording::{Block, Clock, Column, Recording};
use crate::error::{Error, Result};
use crate::statistics::median;

/// Radio logs stamp with 24 bits of milliseconds (three bytes in the log packet).
const WRAP_S: f64 = 16_777.216;

/// Largest JSON text, in bytes: the reference flight takes 2 MB a minute.
const MAX_BYTES: usize = 128 << 20;

/// Most memory of the values while they are read: 16 Mi numbers in lists, an hour of the reference
/// log being 12 Mi; or 235,000 rows of ten numbers.
const MAX_MEMORY: usize = 512 << 20;

/// Most variables; the firmware logs 128 at a time.
const MAX_VARIABLES: usize = 1024;

/// Reads a JSON log.
pub(super) fn read(bytes: &[u8], file: &str) -> Result<Recording> {
    if bytes.len() > MAX_BYTES {
        let (found, most) = (bytes.len() >> 20, MAX_BYTES >> 20);
        let wanted = format!("at most {most} MiB");
        return Err(Error::input(file, format!("{found} MiB of JSON"), wanted, HINT));
    }
    let memory = bytes.iter().map(|byte| memory(*byte)).sum::<usize>();
    if memory > MAX_MEMORY {
        let found = format!("values that take {} MiB of memory", memory.div_ceil(1 << 20));
        let wanted = format!("at most {} MiB", MAX_MEMORY >> 20);
        return Err(Error::input(file, found, wanted, "cut the log to one flight"));
    }
    let mut text = bytes.to_vec();
    replace_nan(&mut text);
    let mut warnings = Vec::new();
    let value: Value = match serde_json::from_slice(&text) {
        Ok(value) => value,
        Err(source) if source.is_eof() => {
            let place = format!("{}:{}", source.line(), source.column());
            warnings.push(format!("the file ends too early, at {place}; the part before is read"));
            close(&mut text);
            serde_json::from_slice(&text).map_err(|source| broken(file, &source))?
        }
        Err(source) => return Err(broken(file, &source)),
    };
    let mut reader = Reader { file, blocks: Vec::new(), warnings };
    let in_seconds = match &value {
        Value::Object(top) => {
            reader.folder(top, "")?;
            top.contains_key("drone") || top.contains_key("mocap")
        }
        Value::Array(rows) if reader.rows("", rows)? => false,
        _ => {
            let wanted = "an object of variables, each with time and data, or a list of rows, each \
                          an object with a time";
            return Err(Error::input(file, "JSON of another shape", wanted, HINT));
        }
    };
    let Reader { mut blocks, warnings, .. } = reader;
    for block in &mut blocks {
        if stamps_are_ms(&block.time_s, in_seconds) {
            for time_s in &mut block.time_s {
                *time_s /= 1000.0;
            }
        }
    }
    let file = file.to_owned();
    Ok(Recording { file, blocks, warnings, wrap_s: Some(WRAP_S), ..Recording::default() })
}

/// Memory of what a byte begins or separates, measured on files of nothing else (64-bit Linux): the
/// file is refused before a value takes any.
fn memory(byte: u8) -> usize {
    match byte {
        b',' => 32,
        b'"' => 48,
        b'[' => 160,
        b'{' => 1000,
        _ => 0,
    }
}

const HINT: &str = "give a log as the AE483 client writes it: {\"stateEstimate.x\": {\"time\": \
                    [...], \"data\": [...]}, ...}";

fn broken(file: &str, source: &serde_json::Error) -> Error {
    let place = format!("{file}:{}:{}", source.line(), source.column());
    Error::input(place, source, "JSON", HINT)
}

/// Whether stamps are in milliseconds. Log periods are 10 ms to 2.55 s, so that steps above 5 are ms
/// and steps below 0.5 are s; in between, the dialect decides.
fn stamps_are_ms(stamps: &[f64], in_seconds: bool) -> bool {
    let steps = stamps.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
    match median(steps) {
        Some(step) if step > 5.0 => true,
        Some(step) if step < 0.5 => false,
        _ => !in_seconds,
    }
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

/// The numbers of an object and of those in it, by their names with dots; the names in an object
/// `data` stand alone.
fn flatten(members: &Map<String, Value>, prefix: &str, cells: &mut BTreeMap<String, f64>) {
    for (key, value) in members {
        let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        match value {
            Value::Object(inner) if key == "data" => flatten(inner, prefix, cells),
            Value::Object(inner) => flatten(inner, &name, cells),
            Value::Number(number) => {
                cells.insert(name, number.as_f64().unwrap_or(f64::NAN));
            }
            Value::Bool(on) => {
                cells.insert(name, f64::from(u8::from(*on)));
            }
            _ => {}
        }
    }
}

struct Reader<'a> {
    file: &'a str,
    blocks: Vec<Block>,
    warnings: Vec<String>,
}

impl Reader<'_> {
    fn folder(&mut self, members: &Map<String, Value>, prefix: &str) -> Result<()> {
        for (key, value) in members {
            if self.blocks.iter().map(|block| block.columns.len()).sum::<usize>() > MAX_VARIABLES
                || self.blocks.len() > MAX_VARIABLES
            {
                let wanted = format!("at most {MAX_VARIABLES}");
                return Err(Error::input(self.file, "too many variables", wanted, HINT));
            }
            let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
            if let Value::Array(rows) = value {
                self.rows(&name, rows)?;
            }
            let Value::Object(inner) = value else { continue };
            match (inner.get("time"), inner.get("data")) {
                (Some(time), Some(data)) => self.variable(&name, time, data)?,
                (Some(time), None) if time.is_array() => self.block(&name, time, inner)?,
                _ if key == "drone" && prefix.is_empty() => self.folder(inner, "")?,
                _ => self.folder(inner, &name)?,
            }
        }
        Ok(())
    }

    /// Adds a variable to the block before it where their stamps are equal, else to a new block.
    fn variable(&mut self, name: &str, time: &Value, data: &Value) -> Result<()> {
        let mut time_s = self.numbers(&format!("{name}.time"), time)?;
        let mut values = self.numbers(&format!("{name}.data"), data)?;
        self.cut_to_shorter(name, &mut time_s, &mut values);
        let column = Column { name: name.to_owned(), values };
        match self.blocks.last_mut() {
            Some(block) if block.time_s == time_s && block.clock == Clock::Drone => {
                block.columns.push(column);
            }
            _ => self.blocks.push(Block {
                name: name.to_owned(),
                time_s,
                columns: vec![column],
                ..Block::default()
            }),
        }
        Ok(())
    }

    fn block(&mut self, name: &str, time: &Value, members: &Map<String, Value>) -> Result<()> {
        let mut time_s = self.numbers(&format!("{name}.time"), time)?;
        let mut columns = Vec::new();
        for (key, value) in members.iter().filter(|(key, value)| *key != "time" && value.is_array())
        {
            let name = format!("{name}.{key}");
            columns.push(Column { values: self.numbers(&name, value)?, name });
        }
        for column in &mut columns {
            self.cut_to_shorter(&column.name, &mut time_s, &mut column.values);
        }
        for column in &mut columns {
            column.values.truncate(time_s.len());
        }
        let mocap = name == "mocap" || name.starts_with("mocap.");
        let clock = if mocap { Clock::Mocap } else { Clock::Drone };
        self.blocks.push(Block { name: name.to_owned(), clock, time_s, columns });
        Ok(())
    }

    /// Adds the columns of a list of objects, each with a time; returns whether it is one. Rows
    /// without a time are left out, and cells that a row lacks are missing values.
    fn rows(&mut self, name: &str, rows: &[Value]) -> Result<bool> {
        let is_time = |key: &str| plain_csv::meaning(key).0 == "t";
        let cells = |row: &Value| {
            let mut cells = BTreeMap::new();
            row.as_object().into_iter().for_each(|row| flatten(row, "", &mut cells));
            cells
        };
        let rows: Vec<BTreeMap<String, f64>> = rows.iter().map(cells).collect();
        let names: BTreeSet<&String> = rows.iter().flat_map(BTreeMap::keys).collect();
        let Some(time) = names.iter().find(|name| is_time(name)).copied() else {
            return Ok(false);
        };
        if names.len() > MAX_VARIABLES {
            let wanted = format!("at most {MAX_VARIABLES}");
            return Err(Error::input(self.file, "too many variables", wanted, HINT));
        }
        let unit_s = plain_csv::meaning(time).1.unwrap_or(1.0);
        let rows: Vec<_> = rows.iter().filter(|row| row.contains_key(time)).collect();
        let column = |key: &&String| {
            let (ours, unit) = match name {
                "" => plain_csv::meaning(key),
                folder => (format!("{folder}.{key}"), None),
            };
            let cell = |row: &&BTreeMap<String, f64>| row.get(*key).copied().unwrap_or(f64::NAN);
            let values = rows.iter().map(|row| cell(row) * unit.unwrap_or(1.0)).collect();
            Column { name: ours, values }
        };
        let columns = names.iter().filter(|key| **key != time).map(column).collect();
        let mocap = name == "mocap" || name.starts_with("mocap.");
        let clock = if mocap { Clock::Mocap } else { Clock::Drone };
        let time_s = rows.iter().map(|row| row[time] * unit_s).collect();
        self.blocks.push(Block { name: name.to_owned(), clock, time_s, columns });
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

    fn numbers(&self, name: &str, value: &Value) -> Result<Vec<f64>> {
        let refuse = |place: String, value: &Value| {
            let found: String = value.to_string().chars().take(40).collect();
            Error::input(place, found, "a list of numbers", HINT)
        };
        let Value::Array(items) = value else {
            return Err(refuse(format!("{}: {name}", self.file), value));
        };
        let number = |(i, item): (usize, &Value)| match item {
            Value::Number(number) => Ok(number.as_f64().unwrap_or(f64::NAN)),
            Value::Bool(on) => Ok(f64::from(u8::from(*on))),
            Value::Null => Ok(f64::NAN),
            Value::String(text) if text.is_empty() => Ok(f64::NAN),
            _ => Err(refuse(format!("{}: {name}[{i}]", self.file), item)),
        };
        items.iter().enumerate().map(number).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        for (value, n) in [("{\"t\":1},", 500_000), ("[0],", 3_000_000), ("0,", 17_000_000)] {
            let text = format!("[{}0]", value.repeat(n));
            let error = read(text.as_bytes(), "log.json").unwrap_err().to_string();
            assert!(error.contains("MiB of memory, wanted at most 512 MiB"), "{value}: {error}");
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
