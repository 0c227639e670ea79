//! Reads an exported script's log while it is being written, with one line of JSON per sample.
//!
//! The first line is the head of the log, `{"noctograph": {…}}`. Each further line is a sample,
//! `{"time": ms, "variable": number, …}`, and the last one is the end mark `{"end": true}`. Without
//! the end mark, the script or its computer was stopped, and the last line may be incomplete.
//!
//! The variables form the same blocks as in the complete log, which the script writes at the end,
//! so that both yield the same flight.

use std::collections::BTreeMap;
use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;
use serde_json::value::RawValue;

use super::cfclient_csv::WRAP_S;
use super::json_log::{add_variable, resolve_units};
use super::json_text::replace_nan;
use super::recording::Recording;
use super::{HINT, ImportOptions, Job, LIMIT, OnClock};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Budget, push};
use noctograph_core::settings::Described;

/// Work budget in steps per byte and per value, and memory per new variable in bytes.
const BYTE_STEPS: usize = 3;
const VALUE_STEPS: usize = 200;
const VARIABLE_BYTES: usize = 400;

/// Beginning of a log's head, and the head's maximum length. A scene takes a few kilobytes.
const HEAD: &[u8] = b"{\"noctograph\"";
const MAX_HEAD_BYTES: usize = 1 << 20;

/// Names in a line: that of the time, and that of the end mark.
const TIME: &str = "time";
const END: &str = "end";

/// Times and values of each variable, in the units of the log.
type Columns = BTreeMap<String, [Vec<f64>; 2]>;

/// Samples that have been read so far.
#[derive(Debug, Default)]
pub(super) struct Lines {
    file: String,
    /// Number of lines that have been read.
    n_lines: u64,
    /// Bytes of the incomplete last line.
    rest: Vec<u8>,
    firmware: Option<String>,
    columns: Columns,
    has_ended: bool,
}

/// The head of the log.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    noctograph: BTreeMap<String, Value>,
}

/// True for a script's line-by-line log, whose first line is a complete head.
pub(super) fn is_lines(text: &[u8]) -> bool {
    let text = text.trim_ascii_start();
    let end = text.iter().position(|byte| *byte == b'\n');
    end.is_some_and(|end| serde_json::from_slice::<Head>(&text[..end]).is_ok())
}

/// Reads a complete file. Returns [`Error::Input`] for a line that is not a sample.
pub(super) fn read(text: &[u8], Job { file, options, budget }: Job<'_>) -> Result<Recording> {
    let mut lines = Lines::new(file);
    lines.push(text, budget)?;
    let columns = std::mem::take(&mut lines.columns);
    Ok(lines.recording(columns, options))
}

impl Lines {
    /// Returns the empty log of a file.
    fn new(file: &str) -> Self {
        Self { file: file.to_owned(), ..Self::default() }
    }

    /// Reads the complete lines, and keeps the remaining bytes until more are added.
    fn push(&mut self, bytes: &[u8], budget: &Budget) -> Result<()> {
        budget.steps(BYTE_STEPS * bytes.len())?;
        let Some(last) = bytes.iter().rposition(|byte| *byte == b'\n') else {
            self.rest.extend_from_slice(bytes);
            return Ok(());
        };
        let mut whole = std::mem::take(&mut self.rest);
        whole.extend_from_slice(&bytes[..last]);
        self.rest.extend_from_slice(&bytes[last + 1..]);
        replace_nan(&mut whole);
        for line in whole.split(|byte| *byte == b'\n') {
            self.n_lines += 1;
            let line = line.trim_ascii();
            if !line.is_empty() {
                self.line(line, budget)?;
            }
        }
        Ok(())
    }

    /// Reads a line: the head, a sample or the end mark. Returns [`Error::Input`] for other lines.
    fn line(&mut self, line: &[u8], budget: &Budget) -> Result<()> {
        // The head comes first, followed by samples up to the end mark.
        if self.n_lines == 1 {
            let head: Head =
                serde_json::from_slice(line).map_err(|source| self.headless(source))?;
            let firmware = head.noctograph.get("firmware").and_then(Value::as_str);
            self.firmware = firmware.map(str::to_owned);
            return Ok(());
        }
        let sample: BTreeMap<&str, &RawValue> =
            serde_json::from_slice(line).map_err(|source| self.broken(source))?;
        if self.has_ended {
            return Err(self.broken("a line after the end mark"));
        }
        if sample.len() == 1 && sample.get(END).is_some_and(|end| end.get() == "true") {
            self.has_ended = true;
            return Ok(());
        }
        budget.steps(VALUE_STEPS * sample.len())?;
        let time = sample.get(TIME).and_then(|time| number(time)).filter(|time| time.is_finite());
        let time = time.ok_or_else(|| self.broken("a line without a time"))?;
        for (name, value) in sample.into_iter().filter(|(name, _)| *name != TIME) {
            let value = number(value)
                .ok_or_else(|| self.broken(format_args!("{name}: {}", value.get())))?;
            if !self.columns.contains_key(name) {
                budget.bytes(VARIABLE_BYTES + name.len())?;
                self.columns.insert(name.to_owned(), <[Vec<f64>; 2]>::default());
            }
            budget.bytes(2 * size_of::<f64>())?;
            let [times, values] = self.columns.get_mut(name).expect("it was inserted");
            push(times, time);
            push(values, value);
        }
        Ok(())
    }

    /// Returns the error for a file that does not begin with the head of a log.
    fn headless(&self, actual: impl fmt::Display) -> Error {
        let wanted = "the log that an exported script keeps during the flight, whose first line \
                      is its header, {\"noctograph\": ...}";
        let hint = "name the file NAME_flight.jsonl that the script writes";
        Error::input("", actual, wanted, hint).in_file(&self.file, 1_u64)
    }

    /// Returns the error for a line that is not a sample.
    fn broken(&self, actual: impl fmt::Display) -> Error {
        let wanted = "a sample, such as {\"time\": 20, \"stateEstimate.x\": 0.1}";
        let hint = "use the complete log (.json) that the script wrote after the flight, or \
                    remove the lines from this one on";
        Error::input("", actual, wanted, hint).in_file(&self.file, self.n_lines)
    }

    /// Returns the samples as a recording, with a warning if the end mark is missing.
    fn recording(&self, columns: Columns, options: &ImportOptions) -> Recording {
        let mut log = Recording { wrap_s: Some(WRAP_S), ..Recording::new(&self.file) };
        log.firmware.clone_from(&self.firmware);
        for (name, [times, values]) in columns {
            add_variable(&mut log.blocks, &name, times, values);
        }
        resolve_units(&mut log, false, options.time_unit);
        if !self.has_ended {
            let torn = match self.rest.len() {
                0 => String::new(),
                n => format!(", and {n} bytes of an incomplete line are not read"),
            };
            let note = format!(
                "the log ends early, after line {}: its script was interrupted{torn}",
                self.n_lines
            );
            log.warn("log-cut", note);
        }
        log
    }
}

/// True if the bytes are a log's head, or may become one when further bytes follow.
fn may_become_head(bytes: &[u8]) -> bool {
    bytes.starts_with(&HEAD[..bytes.len().min(HEAD.len())])
        && bytes.len() < MAX_HEAD_BYTES
        && (serde_json::from_slice::<IgnoredAny>(bytes).is_err()
            || serde_json::from_slice::<Head>(bytes).is_ok())
}

/// Returns a number. A missing number is NaN, and any other value is `None`.
fn number(value: &RawValue) -> Option<f64> {
    match value.get() {
        "null" | "\"\"" => Some(f64::NAN),
        text => text.parse().ok().filter(|number: &f64| number.is_finite()),
    }
}

/// An exported script's log while it is being written.
pub struct GrowingLog {
    file: Box<dyn Read + Send>,
    path: PathBuf,
    lines: Lines,
    budget: Budget,
}

impl fmt::Debug for GrowingLog {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GrowingLog").field("lines", &self.lines).finish_non_exhaustive()
    }
}

impl GrowingLog {
    /// Opens a log. Nothing is read yet.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] if the file cannot be opened.
    pub fn open(path: &Path) -> Result<Self> {
        Ok(Self::reading(Box::new(LIMIT.open(path)?), path))
    }

    /// Returns the log of an open file, of which nothing has been read. `path` names it in errors.
    fn reading(file: Box<dyn Read + Send>, path: &Path) -> Self {
        let name = path.display().to_string();
        let (lines, budget) = (Lines::new(&name), Budget::new(name, HINT));
        Self { file, path: path.to_owned(), lines, budget }
    }

    /// Reads what the script has added, possibly an incomplete line. Returns true if it added
    /// anything.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Io`] if the file cannot be read or is too large. Returns [`Error::Input`]
    /// for a line that is not a sample, and for a file that is not a script's line-by-line log.
    pub fn grow(&mut self) -> Result<bool> {
        let mut bytes = Vec::new();
        let read = self.file.read_to_end(&mut bytes);
        read.map_err(|source| Error::read(&self.path, source))?;
        // The limit is that of a complete file, so that any log being followed can also be
        // imported.
        self.budget.bytes(bytes.len())?;
        self.lines.push(&bytes, &self.budget)?;
        // A file that cannot become a log is rejected at once instead of waiting for more.
        if self.lines.n_lines == 0 && !may_become_head(&self.lines.rest) {
            return Err(self.lines.headless("no lines of a script's log"));
        }
        Ok(!bytes.is_empty())
    }

    /// True if the log's head has been read.
    pub fn has_begun(&self) -> bool {
        self.lines.n_lines > 0
    }

    /// True if the script has written the end mark.
    pub fn has_ended(&self) -> bool {
        self.lines.has_ended
    }

    /// Returns the flight so far, as [`super::import_on_clock`] would for a complete file.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`super::import`].
    pub fn flight(&self, options: &ImportOptions) -> Result<OnClock> {
        options.check("import", None)?;
        let (file, budget) = (&*self.lines.file, &Budget::new(&*self.lines.file, HINT));
        let recording = self.lines.recording(self.lines.columns.clone(), options);
        super::flight(recording, Job { file, options, budget })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::said;

    const HEAD: &str = "{\"noctograph\": {\"word\": \"NO\", \"firmware\": \"2026.08\"}}\n";

    fn read(text: &str) -> Result<Recording> {
        let (options, file) = (&ImportOptions::default(), "NO_flight.jsonl");
        let budget = &Budget::new(file, HINT);
        assert!(is_lines(text.as_bytes()), "{text}");
        super::read(text.as_bytes(), Job { file, options, budget })
    }

    #[test]
    fn lines_give_the_blocks_of_the_whole_log() {
        let lines = format!(
            "{HEAD}{}\n{}\n{}\n{}\n",
            r#"{"time": 20, "stateEstimate.x": 1.5, "stateEstimate.y": NaN}"#,
            r#"{"time": 25, "light.headlights": 1.0}"#,
            r#"{"time": 40, "stateEstimate.x": 2.5, "stateEstimate.y": 4}"#,
            r#"{"end": true}"#,
        );
        let log = read(&lines).unwrap();
        assert_eq!(log.channel("stateEstimate.x").unwrap().values, [1.5, 2.5]);
        assert_eq!(log.channel("stateEstimate.y").unwrap().values, [4.0]);
        assert_eq!(log.channel("light.headlights").unwrap().time_s, [0.025]);
        assert_eq!((log.blocks.len(), log.firmware.as_deref()), (2, Some("2026.08")));
        assert_eq!(said(&log), "");
    }

    #[test]
    fn a_log_that_ends_early_is_read_to_its_last_whole_line_and_says_so() {
        let two = format!("{HEAD}{{\"time\": 20, \"a.b\": 1}}\n{{\"time\": 40, \"a.b\": 2}}\n");
        for torn in ["", "{\"time\": 60, \"a.b\": 3", "{\"time\": 60, \"a.b\": 3}", "\0\0\0"] {
            let log = read(&format!("{two}{torn}")).unwrap();
            assert_eq!(log.channel("a.b").unwrap().values, [1.0, 2.0], "{torn:?}");
            let said = said(&log);
            assert!(said.contains("ends early, after line 3"), "{said}");
            assert_eq!(said.contains("incomplete line"), !torn.is_empty(), "{said}");
        }
    }

    #[test]
    fn a_line_that_is_no_sample_is_an_error_with_its_number() {
        for (line, actual) in [
            ("{\"time\": 20, \"a.b\": [1]}", "a.b: [1]"),
            ("{\"time\": 20, \"a.b\": 1e999}", "a.b: 1e999"),
            ("{\"a.b\": 1}", "without a time"),
            ("[20, 1]", "invalid type"),
            ("{\"time\": 20, \"a.b\"", "EOF"),
            (HEAD.trim_ascii_end(), "without a time"),
            ("{\"end\": true}\n{\"time\": 60}", "after the end mark"),
        ] {
            let error = read(&format!("{HEAD}{{\"time\": 1}}\n{line}\n")).unwrap_err().to_string();
            let at_line = if actual == "after the end mark" { 4 } else { 3 };
            assert!(error.contains(actual), "{line}: {error}");
            assert!(error.contains(&format!("NO_flight.jsonl:{at_line}")), "{line}: {error}");
        }
    }

    /// A file that grows by one byte whenever it is read to its end.
    struct Drip(Vec<u8>, bool);

    impl Read for Drip {
        fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
            self.1 = !self.1 && !self.0.is_empty();
            if self.1 {
                out[0] = self.0.remove(0);
            }
            Ok(self.1.into())
        }
    }

    fn dripping(text: &str) -> GrowingLog {
        GrowingLog::reading(Box::new(Drip(text.into(), false)), Path::new("log"))
    }

    #[test]
    fn a_log_that_grows_byte_by_byte_is_the_same_flight() {
        let rows = (0..200).map(|row| {
            let (stamp_ms, x) = (20 * row, f64::from(row % 7) * 0.01);
            let place = format!("\"stateEstimate.x\": {x}, \"stateEstimate.y\": 0.1");
            format!("{{\"time\": {stamp_ms}, {place}, \"stateEstimate.z\": 1}}\n")
        });
        let text = [HEAD.to_owned(), rows.collect(), "{\"end\": true}\n".to_owned()].concat();
        let mut log = dripping(&text);
        while log.grow().unwrap() {}
        assert!(log.has_ended());
        let options = ImportOptions::default();
        let whole = crate::import_bytes(text.as_bytes(), "log", &options).unwrap();
        assert_eq!(log.flight(&options).unwrap().flight, whole);
    }

    #[test]
    fn a_file_that_is_no_log_as_it_comes_is_not_waited_for() {
        for text in ["t,x,y,z\n", "{\"stateEstimate.x\"", "{\"noctograph\": {}, \"a\": {}}", "x"] {
            let mut log = dripping(text);
            let error = std::iter::repeat_with(|| log.grow()).take(99).find_map(Result::err);
            let error = error.expect(text).to_string();
            assert!(error.contains("is its head") && error.contains("log:1"), "{error}");
        }
    }
}
