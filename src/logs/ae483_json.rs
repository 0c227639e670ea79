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

use super::cfclient_csv::WRAP_S;
use super::json_tree::{self, List, Node, is_indexed, joined};
use super::recording::{Block, Clock, Column, Recording};
use super::{Job, MAX_VARIABLES, TimeUnit, plain_csv, rows, titles};
use noctograph_core::error::{Error, Place, Result};
use noctograph_core::files::{Budget, Text, simplified};
use noctograph_core::flight::stamps::{SLOWEST_PERIOD_S, unit_of};
use noctograph_core::statistics::median;

/// Steps of reading a byte of text.
const STEPS: usize = 3;

/// Reads a JSON log.
pub(super) fn read(text: &Text<'_>, job: Job<'_>) -> Result<Recording> {
    let Job { file, options, budget } = job;
    budget.steps(STEPS * text.bytes.len())?;
    budget.bytes(text.bytes.len())?;
    let warnings = text.notes.clone();
    let mut log = Recording { wrap_s: Some(WRAP_S), warnings, ..Recording::new(file) };
    let mut text = listed(&text.bytes).unwrap_or_else(|| text.bytes.to_vec());
    replace_nan(&mut text);
    let left = budget.bytes_left();
    let value = match json_tree::read(&text, budget) {
        Err(source) if source.is_eof() => {
            let place = format!("{}:{}", source.line(), source.column());
            refuse_cut_script(&text, file, &place)?;
            log.warnings
                .push(format!("the file ends too early, at {place}; the part before is read"));
            close(&mut text);
            budget.free(left - budget.bytes_left());
            json_tree::read(&text, budget)
        }
        value => value,
    };
    let value = value.map_err(|source| {
        budget.check().err().unwrap_or_else(|| {
            let place = format!("column {}", source.column());
            Error::input(place, &source, "JSON", HINT).in_file(file, source.line() as u64)
        })
    })?;
    drop(text);
    let mut reader = Reader { budget, log, skipped: Vec::new(), in_seconds: false };
    let value = match value {
        Node::Object(top) if is_indexed(&top) => Node::List(List::by_index(top, budget)?),
        value => value,
    };
    match value {
        Node::Object(mut top) => {
            reader.in_seconds = top.contains_key("drone") || top.contains_key("mocap");
            refuse_pandas(&top, file)?;
            lists_by_index(&mut top, budget)?;
            reader.columns(&mut top)?;
            reader.folder(top, "")?;
        }
        Node::List(list) if reader.rows("", &list)? => {}
        Node::List(List { odd: Some((_, odd)), .. }) if odd == "a list" => {
            let hint = "write it as CSV, with a header such as t,x,y,z";
            return Err(Error::input(file, "lists without names", "objects with names", hint));
        }
        _ => {
            let wanted = "an object of variables, each with time and data, or a list of rows, each \
                          an object with a time";
            return Err(Error::input(file, "JSON of another shape", wanted, HINT));
        }
    };
    let Reader { mut log, skipped, in_seconds, .. } = reader;
    if !skipped.is_empty() {
        log.warnings.push(format!("not read: {}", skipped.join(", ")));
    }
    resolve_units(&mut log, in_seconds, options.time_unit);
    for block in &mut log.blocks {
        plain_csv::resolve_angles(block, options.angle_unit, &mut log.warnings);
    }
    Ok(log)
}

/// Refuses the cut log of an exported script, whose variables stand one after another: a part of it
/// is no shorter flight but one without some of them.
fn refuse_cut_script(text: &[u8], file: &str, place: &str) -> Result<()> {
    let head = text.trim_ascii_start().strip_prefix(b"{").unwrap_or_default();
    if !head.trim_ascii_start().starts_with(b"\"noctograph\"") {
        return Ok(());
    }
    let hint = "take the file that the script named; it may be in the folder for temporary files";
    let cut = format!("a script's log that is cut off at {place}");
    Err(Error::input(file, cut, "the whole log", hint))
}

/// Refuses the forms of pandas' `to_json` that are not read.
fn refuse_pandas(top: &BTreeMap<String, Node>, file: &str) -> Result<()> {
    let is_split = top.contains_key("columns") && top.contains_key("index");
    if !top.contains_key("data") || !(is_split || top.contains_key("schema")) {
        return Ok(());
    }
    let form = "DataFrame.to_json with orient split or table";
    let hint = "write it with to_json(\"log.json\", orient=\"records\")";
    Err(Error::input(file, form, "records or columns", hint))
}

/// Makes lists of the columns of pandas' default `to_json`, objects by index. Indices that do not
/// count from zero are stamps, where there are no others.
fn lists_by_index(members: &mut BTreeMap<String, Node>, budget: &Budget) -> Result<()> {
    let mut stamps = None;
    for value in members.values_mut() {
        if let Node::Object(inner) = value
            && is_indexed(inner)
        {
            let list = List::by_index(std::mem::take(inner), budget)?;
            stamps = (!list.is_counted()).then(|| list.indices.clone());
            *value = Node::List(list);
        }
    }
    if let Some(numbers) = stamps
        && !members.keys().any(|key| titles::meaning(key).0 == "t")
    {
        members.insert("timestamp".to_owned(), Node::List(List { numbers, ..List::default() }));
    }
    Ok(())
}

/// Puts all stamps in seconds. One clock has one unit, which its fastest block shows: blocks of
/// events have steps of any length.
fn resolve_units(log: &mut Recording, in_seconds: bool, wanted: TimeUnit) {
    for clock in [Clock::Drone, Clock::Mocap] {
        let mut blocks = Vec::from_iter(log.blocks.iter_mut().filter(|block| block.clock == clock));
        let steps = blocks.iter().filter_map(|block| {
            let steps = block.time_s.windows(2).map(|pair| pair[1] - pair[0]);
            median(steps.filter(|step| *step > 0.0))
        });
        let step = steps.fold(f64::INFINITY, f64::min);
        let unit_s = wanted.seconds().unwrap_or_else(|| unit_s(step, in_seconds));
        if wanted.seconds().is_none() && in_seconds && unit_s != 1.0 && step.is_finite() {
            log.warnings.push(format!(
                "stamps {step} apart are taken as {unit_s} s a unit: no Crazyflie logs so slowly in \
                 seconds"
            ));
        }
        // Division by the units per second makes 10 ms 0.01 s to the last bit.
        let per_s = if unit_s < 1.0 { (1.0 / unit_s).round() } else { 1.0 / unit_s };
        blocks.iter_mut().flat_map(|block| &mut block.time_s).for_each(|time_s| *time_s /= per_s);
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
        step if step < 0.5 => unit_of(&[0.0, step]).unit_s,
        _ if in_seconds => 1.0,
        _ => 1e-3,
    }
}

const HINT: &str = "give a log as the AE483 client writes it: {\"stateEstimate.x\": {\"time\": \
                    [...], \"data\": [...]}, ...}";

/// Lines of rows as one list: JSON lines, and what cflib's examples print,
/// `[stamp][block]: {'variable': value}`. `None` of other text.
fn listed(text: &[u8]) -> Option<Vec<u8>> {
    let text = std::str::from_utf8(text).ok()?;
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty()).peekable();
    let is_printed = lines.peek()?.contains("]: {");
    let rows = lines.map(|line| match line.split_once("]: {") {
        Some((head, data)) if is_printed => {
            let stamp = head.trim_start_matches('[').split(']').next()?;
            let data = data.replace('\'', "\"");
            Some(format!("{{\"timestamp\": {stamp}, \"data\": {{{data}}}"))
        }
        // Printed dictionaries of Python have other quotation marks.
        _ if line.starts_with("{'") => Some(line.replace('\'', "\"")),
        _ => (line.starts_with(['{', '[']) && line.ends_with(['}', ']'])).then(|| line.to_owned()),
    });
    let rows = rows.collect::<Option<Vec<String>>>().filter(|rows| is_printed || rows.len() > 1)?;
    Some(format!("[{}]", rows.join(",")).into_bytes())
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
    budget: &'a Budget,
    log: Recording,
    /// Members beside those of a log.
    skipped: Vec<String>,
    /// Whether its stamps are seconds, where their steps leave it open.
    in_seconds: bool,
}

impl Reader<'_> {
    fn folder(&mut self, members: BTreeMap<String, Node>, prefix: &str) -> Result<()> {
        for (key, value) in members {
            let name = joined(prefix, &key, self.budget)?;
            match value {
                Node::Missing => {}
                Node::List(list) => {
                    if !self.rows(&name, &list)? {
                        self.skipped.push(format!("{name} (a list without times)"));
                    }
                }
                Node::Object(inner) if is_metadata(&name) && !inner.contains_key("time") => {
                    inner.iter().for_each(|(key, value)| self.firmware(key, value));
                }
                Node::Object(mut inner) => {
                    let time = inner.get("time");
                    if time.is_some() && inner.contains_key("data") {
                        self.variable(&name, inner.remove("time"), inner.remove("data"))?;
                    } else if matches!(time, Some(Node::List(_))) {
                        self.block(&name, inner)?;
                    } else if name == "drone" {
                        self.folder(inner, "")?;
                    } else {
                        self.folder(inner, &name)?;
                    }
                }
                value if is_metadata(&name) => self.firmware(&key, &value),
                value => self.skipped.push(format!("{name} ({})", value.text())),
            }
        }
        Ok(())
    }

    /// Keeps the drone's firmware, where a member names it.
    fn firmware(&mut self, key: &str, value: &Node) {
        if let (Node::Text(name), "firmware" | "firmware_version") = (value, key) {
            self.log.firmware.get_or_insert_with(|| name.clone());
        }
    }

    /// Adds a block of columns, as long as its times.
    fn add(&mut self, mut block: Block) -> Result<()> {
        for column in &mut block.columns {
            column.values.truncate(block.time_s.len());
        }
        self.log.blocks.push(block);
        let n = self.log.blocks.iter().map(|block| block.columns.len().max(1)).sum::<usize>();
        if n > MAX_VARIABLES {
            let wanted = format!("at most {MAX_VARIABLES}");
            return Err(Error::input(
                Place::file(&self.log.file),
                "too many variables",
                wanted,
                HINT,
            ));
        }
        Ok(())
    }

    /// Adds a variable to the block before it where their stamps are equal, else to a new block.
    fn variable(&mut self, name: &str, time: Option<Node>, data: Option<Node>) -> Result<()> {
        let mut time_s = self.numbers(&format!("{name}.time"), time)?;
        let mut values = self.numbers(&format!("{name}.data"), data)?;
        self.cut_to_shorter(name, &mut time_s, &mut values);
        let blocks = &mut self.log.blocks;
        let same = blocks.pop_if(|block| block.clock == Clock::Drone && block.time_s == time_s);
        let mut block =
            same.unwrap_or_else(|| Block { name: name.to_owned(), time_s, ..Block::default() });
        block.columns.push(Column::new(name.to_owned(), values));
        self.add(block)
    }

    fn block(&mut self, name: &str, mut members: BTreeMap<String, Node>) -> Result<()> {
        let mut time_s = self.numbers(&format!("{name}.time"), members.remove("time"))?;
        let mut columns = Vec::new();
        for (key, value) in members {
            if matches!(value, Node::List(_)) {
                let name = joined(name, &key, self.budget)?;
                let mut values = self.numbers(&name, Some(value))?;
                self.cut_to_shorter(&name, &mut time_s, &mut values);
                columns.push(Column::new(name, values));
            }
        }
        self.add(Block { name: name.to_owned(), clock: clock_of(name), time_s, columns })
    }

    /// Takes the lists of an object, one of them of times, as columns under the usual names of
    /// plain CSV; leaves the rest.
    fn columns(&mut self, members: &mut BTreeMap<String, Node>) -> Result<()> {
        let lists = members.iter().filter(|(_, value)| matches!(value, Node::List(_)));
        let titles: Vec<String> = lists.map(|(title, _)| title.clone()).collect();
        self.budget.steps(10_000 * titles.len())?;
        let Some(time) = time_of(titles.iter()) else { return Ok(()) };
        let mut time_s = self.numbers(time, members.remove(time))?;
        let mut columns = Vec::new();
        for title in titles.iter().filter(|title| *title != time) {
            if let Some(Node::List(list)) = members.get(title)
                && let Some(texts) = list.texts.get("")
            {
                rows::check_owners(title, texts, &self.log.file)?;
            }
            let mut values = self.numbers(title, members.remove(title))?;
            self.cut_to_shorter(title, &mut time_s, &mut values);
            columns.push((title.as_str(), values));
        }
        self.table("columns", "", (time, time_s), columns)
    }

    /// Adds the columns of a list of objects, each with a time; returns whether it is one. Rows
    /// without a time are left out, and cells that a row lacks are missing values.
    fn rows(&mut self, name: &str, list: &List) -> Result<bool> {
        // To look up a name costs more than to compare it.
        self.budget.steps(10_000 * list.cells.len())?;
        let Some(time) = time_of(list.cells.keys()) else { return Ok(false) };
        let rows = &list.cells[time];
        self.budget.bytes(size_of::<f64>() * rows.len() * list.cells.len())?;
        let mut columns = Vec::new();
        for (key, cells) in list.cells.iter().filter(|(key, _)| *key != time) {
            let mut values = vec![f64::NAN; rows.len()];
            let mut index = 0;
            for (row, value) in cells {
                index += rows[index..].iter().take_while(|(timed, _)| timed < row).count();
                if rows.get(index).is_some_and(|(timed, _)| timed == row) {
                    values[index] = *value;
                }
            }
            columns.push((key.as_str(), values));
        }
        let mut texts = list.texts.iter().filter(|(_, texts)| texts.len() > 1).peekable();
        if let ([(value, _)], Some((names, _))) = (&columns[..], texts.peek()) {
            return Err(rows::in_long_form([time, names, value]).in_file(&self.log.file, None));
        }
        for (title, texts) in texts {
            rows::check_owners(title, texts, &self.log.file)?;
        }
        for (title, texts) in &list.texts {
            self.skipped.push(format!("{title} ({:?})", texts[0]));
        }
        let time_s = rows.iter().map(|(_, stamp)| *stamp).collect();
        self.table(name, name, (time, time_s), columns)?;
        Ok(true)
    }

    /// Adds columns of equal length under their names in a folder; those in none have the usual
    /// names of plain CSV.
    fn table(
        &mut self,
        name: &str,
        folder: &str,
        (time, mut time_s): (&str, Vec<f64>),
        mut titled: Vec<(&str, Vec<f64>)>,
    ) -> Result<()> {
        let unit_s = titles::meaning(time).1.unwrap_or(1.0);
        time_s.iter_mut().for_each(|stamp| *stamp *= unit_s);
        let part = titled.iter().enumerate().find_map(|(place, (title, values))| {
            let (whole, size_s) =
                rows::whole_of(title).filter(|(whole, _)| *whole == simplified(time))?;
            rows::is_fraction(&time_s, values, size_s).then_some((place, whole, size_s))
        });
        if let Some((place, _, size_s)) = part {
            let (_, parts) = titled.remove(place);
            time_s.iter_mut().zip(parts).for_each(|(stamp, part)| *stamp += size_s * part);
            self.in_seconds = true;
        }
        let mut columns = Vec::new();
        for (title, values) in titled {
            rows::check_owners(title, &rows::whole(&values), &self.log.file)?;
            columns.push(match folder {
                "" => titles::column_of(title, values),
                folder => Column::new(joined(folder, title, self.budget)?, values),
            });
        }
        self.add(Block { name: name.to_owned(), clock: clock_of(name), time_s, columns })
    }

    /// Cuts times and values of different lengths to the shorter ones, with a warning.
    fn cut_to_shorter(&mut self, name: &str, time_s: &mut Vec<f64>, values: &mut Vec<f64>) {
        let (n_time, n_data) = (time_s.len(), values.len());
        if n_time != n_data {
            self.log.warnings.push(format!(
                "{name}: {n_time} stamps for {n_data} values; the longer list is cut"
            ));
        }
        time_s.truncate(n_data);
        values.truncate(n_time);
    }

    fn numbers(&self, name: &str, value: Option<Node>) -> Result<Vec<f64>> {
        let refused = |key, item| Error::input(key, item, "a list of numbers", HINT);
        let error = match value {
            Some(Node::List(List { odd: Some((index, item)), .. })) => {
                refused("", item).of_item(name, index)
            }
            Some(Node::List(list)) => return Ok(list.numbers),
            other => refused(name, other.map_or_else(String::new, |node| node.text())),
        };
        Err(error.in_file(&self.log.file, None))
    }
}

/// The title of times among others; whole seconds go before their fraction.
fn time_of<'a>(titles: impl Iterator<Item = &'a String>) -> Option<&'a String> {
    let mut times: Vec<&String> = titles.filter(|title| titles::meaning(title).0 == "t").collect();
    times.sort_by_key(|title| rows::whole_of(title).is_some());
    times.first().copied()
}

/// Whether a member is metadata that changes nothing: that of the course's client, and that of an
/// exported script.
fn is_metadata(name: &str) -> bool {
    const NAMES: &str = "noctograph firmware start_time end_time uri address drone_id word scene \
                         plan date program version metadata";
    NAMES.split(' ').any(|known| known == name)
        || ["_sha256", "_digest", "_version"].iter().any(|end| name.ends_with(end))
        || name.starts_with("metadata.")
}

/// The clock of a block by its name.
fn clock_of(name: &str) -> Clock {
    if name == "mocap" || name.starts_with("mocap.") { Clock::Mocap } else { Clock::Drone }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ImportOptions;

    fn read(bytes: &[u8], file: &str) -> Result<Recording> {
        let (options, budget) = (&ImportOptions::default(), &Budget::new(file, HINT));
        super::read(&Text::decode(bytes), Job { file, options, budget })
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
        assert!(error.to_string().contains("log.json:2: column 11"), "{error}");
        let error = read(br#"{"a": {"time": [1, "q"], "data": [1, 2]}}"#, "log.json").unwrap_err();
        assert!(error.to_string().contains("a.time[1]"), "{error}");
    }
}
