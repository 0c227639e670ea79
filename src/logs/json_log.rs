//! JSON logs: the three dialects of the AE483 course, and tables from scripts and pandas.
//!
//! - 2021: `{"var": {"time": [ms], "data": []}, "start_time": …}`
//! - 2022: `{"var": {"time": [ms], "data": []}}`
//! - 2024–25: `{"drone": {"var": {"time": [s], "data": []}}, "mocap": {"time": [s], "x": [], …}}`
//!
//! An object with `time` and `data` is a variable. Other objects are folders, whose name (except
//! `drone`) prefixes the names inside them. Lists next to a list of times are columns. A list of
//! objects with a time is a block of rows, as written by cflib scripts and by pandas' `to_json`.
//! Columns and rows may use the usual names of plain CSV. A warning lists members that are ignored.
//!
//! The text is checked once, then split recursively into slices ([`RawValue`]). Only the numbers of
//! columns are kept in memory.

use std::collections::BTreeMap;
use std::fmt;

use serde::de::IgnoredAny;
use serde_json::value::RawValue;

use super::cells::seconds_from_date;
use super::cfclient_csv::WRAP_S;
use super::json_text::{close, is_cut, listed, refuse_cut_script, replace_nan};
use super::recording::{Block, Clock, Column, Recording};
use super::{Job, TimeUnit, plain_csv, rows, titles};
use noctograph_core::error::{Error, Place, Result};
use noctograph_core::files::{Budget, Text, simplified};
use noctograph_core::flight::timestamps::{SLOWEST_PERIOD_S, unit_of};
use noctograph_core::statistics::{median, sort_by_number};

/// Work budget in steps: per byte of text, per value, per name besides its bytes, and per title.
const BYTE_STEPS: usize = 3;
const VALUE_STEPS: usize = 60;
const NAME_STEPS: usize = 200;
const TITLE_STEPS: usize = 10_000;

/// Memory in bytes: per name besides its text, and per item of a list that grows by doubling.
const NAME_BYTES: usize = 160;
const ITEM_BYTES: usize = 24;

/// Maximum depth of nested lists and objects.
const MAX_DEPTH: usize = 128;

/// Number of different texts that are kept per column, and number of characters in each.
const TEXTS: usize = 4;
const TEXT_CHARS: usize = 40;

/// Advice for JSON that is not a log.
const HINT: &str = "give a log as the AE483 client writes it: {\"stateEstimate.x\": {\"time\": \
                    [...], \"data\": [...]}, ...}";

/// Reads a JSON log. Returns [`Error::Input`] for other JSON, and for data that exceed the budget.
pub(super) fn read(text: &Text<'_>, job: Job<'_>) -> Result<Recording> {
    let Job { file, options, budget } = job;
    budget.steps(BYTE_STEPS * text.bytes.len())?;
    budget.bytes(text.bytes.len())?;
    let mut log = Recording { wrap_s: Some(WRAP_S), ..Recording::new(file) };
    log.warn_of_notes(&text.notes);

    // JSON lines, NaN, and a truncated log are first converted to valid JSON.
    let mut text = listed(&text.bytes).unwrap_or_else(|| text.bytes.to_vec());
    let depth = replace_nan(&mut text);
    if depth > MAX_DEPTH {
        let actual = format!("lists and objects with {depth} levels of nesting");
        return Err(Error::input(file, actual, format!("at most {MAX_DEPTH} levels"), HINT));
    }
    let broken = serde_json::from_slice::<IgnoredAny>(&text).err();
    if let Some(source) = broken.filter(|source| is_cut(source, &text)) {
        let place = format!("{}:{}", source.line(), source.column());
        refuse_cut_script(&text, file, &place)?;
        let note = format!("the file ends too early, at {place}, and only the part before is read");
        log.warn("log-cut", note);
        close(&mut text);
    }
    let top = serde_json::from_slice(&text).map_err(|source| {
        let place = format!("column {}", source.column());
        Error::input(place, &source, "JSON", HINT).in_file(file, source.line() as u64)
    })?;

    // A clock's unit is determined by its fastest block, so all blocks are read first.
    let text = std::str::from_utf8(&text).expect("JSON was read from it");
    let mut reader = Reader { text, budget, log, skipped: Vec::new(), in_seconds: false };
    reader.top(top)?;
    let Reader { mut log, skipped, in_seconds, .. } = reader;
    if !skipped.is_empty() {
        log.warn("not-read", format!("not read: {}", skipped.join(", ")));
    }
    resolve_units(&mut log, in_seconds, options.time_unit);
    plain_csv::resolve_angles(&mut log, options.angle_unit);
    Ok(log)
}

/// Returns [`Error::Input`] for two output formats of pandas' `to_json` that are not supported.
fn refuse_pandas(top: &Members<'_>, file: &str) -> Result<()> {
    let is_split = top.contains_key("columns") && top.contains_key("index");
    if !top.contains_key("data") || !(is_split || top.contains_key("schema")) {
        return Ok(());
    }
    let form = "DataFrame.to_json with orient split or table";
    let hint = "write the log with to_json(\"log.json\", orient=\"records\")";
    Err(Error::input(file, form, "records or columns", hint))
}

/// Converts all times to seconds. `wanted` is their unit, if it is known. Otherwise a clock's unit
/// is determined by its fastest block, because blocks of events have arbitrary steps. `in_seconds`
/// is true for dialects whose times are usually in seconds.
pub(super) fn resolve_units(log: &mut Recording, in_seconds: bool, wanted: TimeUnit) {
    for clock in [Clock::Drone, Clock::Mocap] {
        let mut blocks = Vec::from_iter(log.blocks.iter_mut().filter(|block| block.clock == clock));
        let steps = blocks.iter().filter_map(|block| {
            let steps = block.time_s.windows(2).map(|pair| pair[1] - pair[0]);
            median(steps.filter(|step| *step > 0.0))
        });
        let step = steps.fold(f64::INFINITY, f64::min);
        let unit_s = wanted.seconds().unwrap_or_else(|| unit_s(step, in_seconds));
        // Dividing by the units per second converts 10 ms to 0.01 s exactly, to the last bit.
        let per_s = if unit_s < 1.0 { (1.0 / unit_s).round() } else { 1.0 / unit_s };
        blocks.iter_mut().flat_map(|block| &mut block.time_s).for_each(|time_s| *time_s /= per_s);
        if wanted.seconds().is_none() && in_seconds && unit_s != 1.0 && step.is_finite() {
            let text = format!(
                "timestamps {step} apart are read in units of {unit_s} s: no Crazyflie logs so slowly in \
                 seconds"
            );
            log.warn("unit-guessed", text);
        }
    }
}

/// Returns the unit of time in seconds that fits a step. Log periods are 10 ms to 2.55 s, so a step
/// above 2.55 is in milliseconds, above 2550 in microseconds, and above 2.55 million in
/// nanoseconds. A step below 0.5 is judged like that of a table. Other steps, and an infinite one,
/// which stands for a log without steps, are in seconds if `in_seconds` is true and in milliseconds
/// otherwise.
fn unit_s(step: f64, in_seconds: bool) -> f64 {
    match step {
        step if step.is_infinite() && in_seconds => 1.0,
        step if step.is_infinite() => 1e-3,
        step if step > 1e6 * SLOWEST_PERIOD_S => 1e-9,
        step if step > 1e3 * SLOWEST_PERIOD_S => 1e-6,
        step if step > SLOWEST_PERIOD_S => 1e-3,
        step if step < 0.5 => unit_of(&[0.0, step]).unit_s,
        _ if in_seconds => 1.0,
        _ => 1e-3,
    }
}

/// Members of an object by name, as slices of the text.
type Members<'a> = BTreeMap<String, &'a RawValue>;

/// Items of a list, or of an object whose names are indices, as pandas writes columns and tables.
struct List<'a> {
    items: Vec<&'a RawValue>,
    /// Indices in increasing order. Empty if they count from zero.
    indices: Vec<f64>,
}

/// Numbers in rows, by column name, with NaN for missing ones, and the different texts.
#[derive(Default)]
struct Rows {
    columns: BTreeMap<String, Vec<f64>>,
    texts: BTreeMap<String, Vec<String>>,
}

/// A value in a table. A missing value is NaN, and only the beginning of a string is kept.
enum Cell {
    Number(f64),
    Text(String),
    List,
    Object,
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) if number.is_nan() => f.write_str("no value"),
            Self::Number(number) => number.fmt(f),
            Self::Text(text) => write!(f, "{text:?}"),
            Self::List => f.write_str("a list"),
            Self::Object => f.write_str("an object"),
        }
    }
}

/// A recording that is being read.
struct Reader<'a> {
    text: &'a str,
    budget: &'a Budget,
    log: Recording,
    skipped: Vec<String>,
    /// True if times are in seconds unless their steps indicate a different unit.
    in_seconds: bool,
}

impl<'a> Reader<'a> {
    /// Reads the outermost value, which is rows, or an object with variables, blocks and folders.
    /// Returns [`Error::Input`] for other values.
    fn top(&mut self, value: &'a RawValue) -> Result<()> {
        let file = Place::file(&self.log.file);
        if let Some(list) = self.list(value)? {
            if self.rows("", list)? {
                return Ok(());
            }
        } else if is_object(value) {
            return self.object("", value);
        }
        // Since the value is neither, the error names the most similar format.
        if value.get()[1..].trim_start().starts_with('[') {
            let hint = "write the log as CSV, with a header such as t,x,y,z";
            return Err(Error::input(file, "lists without names", "objects with names", hint));
        }
        let wanted = "an object of variables, each with time and data, or a list of rows, each an \
                      object with a time";
        Err(Error::input(file, "JSON with another structure", wanted, HINT))
    }

    /// Reads an object: a variable, metadata, or a folder with columns and other members. `name` is
    /// its path in the log, with dots, and is empty for the outermost object.
    fn object(&mut self, name: &str, value: &'a RawValue) -> Result<()> {
        let mut members = self.members(value)?;
        if name.is_empty() {
            self.in_seconds = members.contains_key("drone") || members.contains_key("mocap");
            refuse_pandas(&members, &self.log.file)?;
        } else if let (Some(time), Some(data)) = (members.get("time"), members.get("data")) {
            return self.variable(name, time, data);
        }
        // Metadata have a known name and no times. Other objects may contain columns.
        let is_about = is_metadata(name) && !members.contains_key("time");
        let folder = if name == "drone" { "" } else { name };
        if !is_about {
            self.columns(folder, &mut members)?;
        }
        for (key, value) in members {
            let name = self.joined(folder, &key)?;
            match self.cell(value)? {
                Cell::Text(text) if matches!(&*key, "firmware" | "firmware_version") => {
                    self.log.firmware.get_or_insert(text);
                }
                _ if is_about => {}
                Cell::Number(number) if number.is_nan() => {}
                Cell::Object => self.object(&name, value)?,
                Cell::List => {
                    let items = self.items(value)?;
                    if !self.rows(&name, List { items, indices: Vec::new() })? {
                        self.skipped.push(format!("{name} (a list without times)"));
                    }
                }
                cell if !is_metadata(&name) => self.skipped.push(format!("{name} ({cell})")),
                _ => {}
            }
        }
        Ok(())
    }

    /// Adds a variable, given the JSON lists of its times and values.
    fn variable(&mut self, name: &str, time: &'a RawValue, data: &'a RawValue) -> Result<()> {
        let mut time_s = self.numbers(&format!("{name}.time"), time)?;
        let mut values = self.numbers(&format!("{name}.data"), data)?;
        self.cut_to_shorter(name, &mut time_s, &mut values);
        add_variable(&mut self.log.blocks, name, time_s, values);
        Ok(())
    }

    /// Converts a folder's lists to columns of one block if one of them contains times, and removes
    /// them from `members`. Other members remain.
    fn columns(&mut self, folder: &str, members: &mut Members<'a>) -> Result<()> {
        let (mut titles, mut stamps) = (Vec::new(), Vec::new());
        for (title, value) in &*members {
            let left = self.budget.bytes_left();
            if let Some(list) = self.list(value)? {
                titles.push(title.clone());
                stamps = if list.indices.is_empty() { stamps } else { list.indices };
            }
            self.budget.free(left - self.budget.bytes_left());
        }
        self.budget.steps(TITLE_STEPS * titles.len())?;
        // Without a list of times, pandas' indices serve as times, unless they count from zero.
        let (time, mut time_s) = match time_of(titles.iter()) {
            Some(time) => (time.clone(), self.numbers(&self.joined(folder, time)?, members[time])?),
            None if stamps.is_empty() || members.keys().any(|key| is_time(key)) => return Ok(()),
            None => ("timestamp".to_owned(), stamps),
        };
        members.remove(&time);
        let mut columns = Vec::new();
        for title in titles.iter().filter(|title| **title != time) {
            let value = members.remove(title).expect("a list");
            self.check_owners(title, value)?;
            let name = self.joined(folder, title)?;
            let mut values = self.numbers(&name, value)?;
            self.cut_to_shorter(&name, &mut time_s, &mut values);
            columns.push((title.as_str(), values));
        }
        self.table(folder, (&time, time_s), columns)
    }

    /// Returns [`Error::Input`] for a list that contains the names of several drones.
    fn check_owners(&self, title: &str, value: &'a RawValue) -> Result<()> {
        let items = self.list(value)?.map_or(Vec::new(), |list| list.items);
        let mut texts = Vec::new();
        for item in items.into_iter().take_while(|item| item.get().starts_with('"')) {
            note_text(&mut texts, &self.cell(item)?);
        }
        rows::check_owners(title, &texts, &self.log.file)
    }

    /// Adds the columns of a list of objects with times. Rows without a time are dropped, and
    /// missing cells become NaN. Returns false for a list without times, and an error for a table
    /// in long form or of several drones.
    fn rows(&mut self, name: &str, List { items, indices }: List<'a>) -> Result<bool> {
        let (n_rows, others) = (items.len(), items.iter().filter(|item| !is_object(item)).count());
        let mut rows = Rows::default();
        for (row, item) in items.into_iter().enumerate().filter(|(_, item)| is_object(item)) {
            self.row(item, "", row, &mut rows)?;
        }
        let Rows { mut columns, texts } = rows;
        self.budget.steps(TITLE_STEPS * columns.len())?;
        self.budget.bytes(size_of::<f64>() * n_rows * columns.len())?;
        if !columns.is_empty() && !indices.is_empty() && !columns.keys().any(|key| is_time(key)) {
            columns.insert("timestamp".to_owned(), indices);
        }
        let Some(time) = time_of(columns.keys()).cloned() else { return Ok(false) };
        let times = columns.remove(&time).expect("its times");
        for values in columns.values_mut() {
            values.resize(times.len(), f64::NAN);
            let mut timed = times.iter().map(|time| !time.is_nan());
            values.retain(|_| timed.next().expect("a time for each"));
        }
        // Different texts are the names in a long-form table, or those of several drones.
        let mut different = texts.iter().filter(|(_, texts)| texts.len() > 1).peekable();
        if let (1, Some(value), Some((names, _))) =
            (columns.len(), columns.keys().next(), different.peek())
        {
            return Err(rows::long_form_error([&time, names, value]).in_file(&self.log.file, None));
        }
        for (title, texts) in different {
            rows::check_owners(title, texts, &self.log.file)?;
        }
        self.skipped.extend(texts.iter().map(|(title, texts)| format!("{title} ({:?})", texts[0])));
        if others > 0 {
            self.skipped.push(format!("{others} items of {name} that are not objects"));
        }
        let time_s = times.into_iter().filter(|time| !time.is_nan()).collect();
        let columns = columns.iter_mut().map(|(title, values)| (&**title, std::mem::take(values)));
        self.table(name, (&time, time_s), columns.collect())?;
        Ok(true)
    }

    /// Adds the numbers of an object and its nested objects to row `row`, under names joined by
    /// dots. The name of an object `data` is omitted.
    fn row(&self, value: &'a RawValue, prefix: &str, row: usize, rows: &mut Rows) -> Result<()> {
        let left = self.budget.bytes_left();
        let members = self.members(value)?;
        let slice_bytes = left - self.budget.bytes_left();
        for (key, value) in members {
            let name = self.joined(prefix, &key)?;
            if !rows.columns.contains_key(&name) && !rows.texts.contains_key(&name) {
                self.budget.bytes(NAME_BYTES + name.len())?;
            }
            match self.cell(value)? {
                Cell::Object if key == "data" => self.row(value, prefix, row, rows)?,
                Cell::Object => self.row(value, &name, row, rows)?,
                Cell::Number(number) if number.is_nan() => {}
                Cell::Number(number) => {
                    let column = rows.columns.entry(name).or_default();
                    // A growing list may occupy twice the memory of its numbers.
                    self.budget.bytes(2 * size_of::<f64>() * (row + 1).abs_diff(column.len()))?;
                    column.resize(row, f64::NAN);
                    column.push(number);
                }
                other => note_text(rows.texts.entry(name).or_default(), &other),
            }
        }
        self.budget.free(slice_bytes);
        Ok(())
    }

    /// Adds columns of equal length as a block. `time` is the title of the times, which are in the
    /// unit of the title or in the log's unit. Outside a folder, names may be those of plain CSV.
    fn table(
        &mut self,
        folder: &str,
        (time, mut time_s): (&str, Vec<f64>),
        mut titled: Vec<(&str, Vec<f64>)>,
    ) -> Result<()> {
        let unit_s = titles::meaning(time).1.unwrap_or(1.0);
        time_s.iter_mut().for_each(|stamp| *stamp *= unit_s);
        // A separate column may contain the fraction of the whole seconds.
        let part = titled.iter().enumerate().find_map(|(place, (title, values))| {
            let (_, size_s) =
                rows::whole_seconds_title(title).filter(|(whole, _)| *whole == simplified(time))?;
            rows::is_fraction(&time_s, values, size_s).then_some((place, size_s))
        });
        if let Some((place, size_s)) = part {
            let (_, parts) = titled.remove(place);
            time_s.iter_mut().zip(parts).for_each(|(stamp, part)| *stamp += size_s * part);
            self.in_seconds = true;
        }
        let mut columns = Vec::new();
        for (title, values) in titled {
            rows::check_owners(title, &rows::repeated_ids(&values), &self.log.file)?;
            columns.push(match folder {
                "" => titles::column_of(title, values),
                folder => Column::new(self.joined(folder, title)?, values),
            });
        }
        let name = if folder.is_empty() { "columns" } else { folder }.to_owned();
        self.add(Block { name, clock: clock_of(folder), time_s, columns });
        Ok(())
    }

    /// Adds a block whose columns are not longer than its times.
    fn add(&mut self, mut block: Block) {
        for column in &mut block.columns {
            column.values.truncate(block.time_s.len());
        }
        self.log.blocks.push(block);
    }

    /// Truncates times and values to the shorter of their lengths, with a warning.
    fn cut_to_shorter(&mut self, name: &str, time_s: &mut Vec<f64>, values: &mut Vec<f64>) {
        let (n_time, n_data) = (time_s.len(), values.len());
        if n_time != n_data {
            let text =
                format!("{name}: {n_time} times for {n_data} values: the longer list is cut");
            self.log.warn("lists-unequal", text);
        }
        time_s.truncate(n_data);
        values.truncate(n_time);
    }

    /// Returns the numbers of a list, with NaN for missing ones. Returns [`Error::Input`] for any
    /// other value.
    fn numbers(&self, name: &str, value: &'a RawValue) -> Result<Vec<f64>> {
        const WANTED: &str = "a list of numbers";
        // Only the numbers remain in memory, so the budget for the slices is released.
        let left = self.budget.bytes_left();
        let Some(List { items, .. }) = self.list(value)? else {
            let error = Error::input(name, self.cell(value)?, WANTED, HINT);
            return Err(error.in_file(&self.log.file, None));
        };
        let slice_bytes = left - self.budget.bytes_left();
        self.budget.bytes(size_of::<f64>() * items.len())?;
        let mut numbers = Vec::with_capacity(items.len());
        for (index, item) in items.into_iter().enumerate() {
            match self.cell(item)? {
                Cell::Number(number) => numbers.push(number),
                odd => {
                    let error = Error::input("", odd, WANTED, HINT).of_item(name, index);
                    return Err(error.in_file(&self.log.file, None));
                }
            }
        }
        self.budget.free(slice_bytes);
        Ok(numbers)
    }

    /// Joins a prefix and a name with a dot.
    fn joined(&self, prefix: &str, key: &str) -> Result<String> {
        self.budget.steps(NAME_STEPS + prefix.len() + key.len())?;
        Ok(if prefix.is_empty() { key.to_owned() } else { format!("{prefix}.{key}") })
    }

    /// Returns a list given by brackets or by indices, or `None` for any other value. Indices that
    /// count from zero are left out.
    fn list(&self, value: &'a RawValue) -> Result<Option<List<'a>>> {
        if value.get().starts_with('[') {
            return Ok(Some(List { items: self.items(value)?, indices: Vec::new() }));
        }
        // An index begins with a digit or a sign. In an object with indices, all names are indices.
        let name = value.get()[1..].trim_start().strip_prefix('"').unwrap_or_default();
        if !is_object(value) || !name.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c))
        {
            return Ok(None);
        }
        let members = self.members(value)?.into_iter();
        let items = members.map(|(key, item)| Some((index(&key)?, item)));
        let items = items.collect::<Option<Vec<_>>>().filter(|items| !items.is_empty());
        Ok(items.map(|mut items| {
            sort_by_number(&mut items, |(index, _)| *index);
            let (mut indices, items): (Vec<f64>, Vec<&RawValue>) = items.into_iter().unzip();
            if (0_u32..).zip(&indices).all(|(n, index)| f64::from(n) == *index) {
                indices.clear();
            }
            List { items, indices }
        }))
    }

    /// Returns the members of an object.
    fn members(&self, value: &'a RawValue) -> Result<Members<'a>> {
        self.split(value, NAME_BYTES)
    }

    /// Returns the items of a list in brackets.
    fn items(&self, value: &'a RawValue) -> Result<Vec<&'a RawValue>> {
        self.split(value, ITEM_BYTES)
    }

    /// Splits an object or a list into `T`. Each part is charged `bytes` of the budget.
    fn split<T: serde::Deserialize<'a>>(&self, value: &'a RawValue, bytes: usize) -> Result<T> {
        // The budget is checked first, because a text that is full of commas would exhaust the
        // memory.
        let text = value.get();
        self.budget.steps(2 * text.len())?;
        self.budget.bytes(bytes * n_parts(text))?;
        serde_json::from_str(text).ok().ok_or_else(|| self.broken(value))
    }

    /// Parses a number, a truth value as 1 or 0, or a string. A time of day becomes its seconds.
    /// Only the kind of a list or object is returned.
    fn cell(&self, value: &RawValue) -> Result<Cell> {
        self.budget.steps(VALUE_STEPS)?;
        let text = value.get();
        Ok(match text.as_bytes()[0] {
            b'{' => Cell::Object,
            b'[' => Cell::List,
            b'n' => Cell::Number(f64::NAN),
            b't' => Cell::Number(1.0),
            b'f' => Cell::Number(0.0),
            b'"' => {
                let text: String =
                    serde_json::from_str(text).ok().ok_or_else(|| self.broken(value))?;
                // Unlike a number in quotes, a time of day without a date contains a colon.
                match seconds_from_date(&text).filter(|_| text.contains(':')) {
                    _ if text.is_empty() => Cell::Number(f64::NAN),
                    Some(stamp_s) => Cell::Number(stamp_s),
                    None => Cell::Text(text.chars().take(TEXT_CHARS).collect()),
                }
            }
            _ => Cell::Number(serde_json::from_str(text).ok().ok_or_else(|| self.broken(value))?),
        })
    }

    /// Returns the error for a number out of range, or for a string with an invalid escape.
    fn broken(&self, value: &RawValue) -> Error {
        let start = value.get().as_ptr() as usize - self.text.as_ptr() as usize;
        let line = self.text[..start].matches('\n').count() + 1;
        let wanted = "a number below 1.8e308, or a string with valid escapes";
        Error::input("", value, wanted, HINT).in_file(&self.log.file, line as u64)
    }
}

/// Adds a variable to the last block if their times are equal, so that the variables of a radio
/// block form one block again. Otherwise creates a new block.
pub(super) fn add_variable(
    blocks: &mut Vec<Block>,
    name: &str,
    time_s: Vec<f64>,
    values: Vec<f64>,
) {
    let same = blocks.pop_if(|block| block.clock == Clock::Drone && block.time_s == time_s);
    let mut block =
        same.unwrap_or_else(|| Block { name: name.to_owned(), time_s, ..Block::default() });
    block.columns.push(Column::new(name.to_owned(), values));
    blocks.push(block);
}

/// Keeps a string if it is one of the first [`TEXTS`] different strings. Numbers are ignored.
fn note_text(texts: &mut Vec<String>, cell: &Cell) {
    let text = match cell {
        Cell::Text(text) => text,
        Cell::List => "a list",
        Cell::Number(_) | Cell::Object => return,
    };
    if texts.len() < TEXTS && !texts.iter().any(|known| known == text) {
        texts.push(text.to_owned());
    }
}

/// Returns an upper bound for the number of parts of an object or list, from its outermost commas.
fn n_parts(text: &str) -> usize {
    let (mut depth, mut n, mut bytes) = (0, 1, text.bytes());
    while let Some(byte) = bytes.next() {
        match byte {
            b'{' | b'[' => depth += 1,
            b'}' | b']' => depth -= 1,
            b',' if depth == 1 => n += 1,
            // A string ends at a quotation mark that is not preceded by a backslash.
            b'"' => {
                while let Some(byte) = bytes.next().filter(|byte| *byte != b'"') {
                    if byte == b'\\' {
                        bytes.next();
                    }
                }
            }
            _ => {}
        }
    }
    n
}

/// True if the value is an object.
fn is_object(value: &RawValue) -> bool {
    value.get().starts_with('{')
}

/// Parses a name as an index: a number or a date.
fn index(name: &str) -> Option<f64> {
    name.parse().ok().filter(|index: &f64| index.is_finite()).or_else(|| seconds_from_date(name))
}

/// Returns true for the title of a column of times.
fn is_time(title: &str) -> bool {
    titles::meaning(title).0 == "t"
}

/// Returns the title of the column of times, if any. Whole seconds precede fractions.
fn time_of<'t>(titles: impl Iterator<Item = &'t String>) -> Option<&'t String> {
    titles
        .filter(|title| is_time(title))
        .min_by_key(|title| rows::whole_seconds_title(title).is_some())
}

/// Returns true for metadata of the course's client or of an exported script, which are not read.
fn is_metadata(name: &str) -> bool {
    const NAMES: &str = "noctograph firmware start_time end_time uri address drone_id word scene \
                         plan date program version metadata";
    NAMES.split(' ').any(|known| known == name)
        || ["_sha256", "_digest", "_version"].iter().any(|end| name.ends_with(end))
        || name.starts_with("metadata.")
}

/// Returns the clock of a folder's blocks.
fn clock_of(name: &str) -> Clock {
    if name == "mocap" || name.starts_with("mocap.") { Clock::Mocap } else { Clock::Drone }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ImportOptions;
    use crate::tests::said;

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
        let warnings = said(&log);
        assert!(
            warnings.contains("2 times for 3 values") && warnings.contains("note"),
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

    /// Returns a number inside nested objects, each with a long name.
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
