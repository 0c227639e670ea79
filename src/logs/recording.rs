//! Recording: the columns of a log file before their quantities are identified.

use std::collections::BTreeSet;

use super::{Axes, HINT, MAX_VARIABLES};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Place, Result};
use noctograph_core::files::Budget;
use noctograph_core::statistics::median;

/// Maximum number of variables that become channels of a flight.
const MAX_CHANNELS: usize = 32;

/// Work budget in steps per value of a channel.
const STEPS: usize = 10;

/// Magnitude at and above which a number is not a measurement.
const TOO_LARGE: f64 = 1e18;

/// Maximum number of names that a message lists.
const MAX_LISTED: usize = 12;

/// The contents of a log file: blocks of columns, each with its own time axis, in the log's units.
#[derive(Debug, Default)]
pub(super) struct Recording {
    pub(super) file: String,
    pub(super) blocks: Vec<Block>,
    /// Period after which the drone's times restart at zero, if they restart.
    pub(super) wrap_s: Option<f64>,
    /// True for times from `usecTimestamp` (µSD logs), which counts 84 µs in 85 µs with firmware up
    /// to and including release 2026.08. Other times are true ticks of the operating system.
    pub(super) is_on_card: bool,
    /// Name of the drone's firmware, if the log states it.
    pub(super) firmware: Option<String>,
    /// True if other logs may use the same clock.
    pub(super) is_stamped: bool,
    /// Axes of the world frame of plain columns, if the format defines them.
    pub(super) axes: Axes,
    /// Name of the format that defines the axes.
    pub(super) in_format: Option<&'static str>,
    pub(super) warnings: Vec<Diagnostic>,
}

/// Columns that were logged together.
#[derive(Debug, Default)]
pub(super) struct Block {
    pub(super) name: String,
    pub(super) clock: Clock,
    /// Times as logged. They are increasing only after [`super::clock::repaired`].
    pub(super) time_s: Vec<f64>,
    pub(super) columns: Vec<Column>,
}

/// Clock that measured a block's times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Clock {
    /// The drone, or the only clock of a table.
    #[default]
    Drone,
    /// Computer of the motion capture system, whose clock has a different zero.
    Mocap,
}

/// One logged variable. Cells without a number are not finite, and are excluded from a [`Channel`].
#[derive(Debug, Default)]
pub(super) struct Column {
    pub(super) name: String,
    pub(super) values: Vec<f64>,
    /// True for an angle or angular velocity whose title states no unit.
    pub(super) is_open_angle: bool,
    /// Title and position of a table column whose title is unknown, or `None` for a known title.
    pub(super) unknown: Option<String>,
}

/// A variable over time: finite values at strictly increasing times.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Channel {
    pub(super) time_s: Vec<f64>,
    pub(super) values: Vec<f64>,
    /// Median time between two samples, or zero for a single sample.
    pub(super) period_s: f64,
}

impl Column {
    /// Returns a column whose unit, if it is an angle, is known.
    pub(super) fn new(name: String, values: Vec<f64>) -> Self {
        Self { name, values, ..Self::default() }
    }
}

impl Block {
    /// Returns the first column with this name.
    pub(super) fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// Returns the first column with this name.
    pub(super) fn column_mut(&mut self, name: &str) -> Option<&mut Column> {
        self.columns.iter_mut().find(|column| column.name == name)
    }
}

impl Recording {
    /// Returns an empty recording of a file.
    pub(super) fn new(file: &str) -> Self {
        Self { file: file.to_owned(), ..Self::default() }
    }

    /// Adds a warning.
    pub(super) fn warn(&mut self, code: &'static str, message: impl Into<String>) {
        self.warnings.push(Diagnostic::warning(code, message));
    }

    /// Adds a reader's notes as warnings.
    pub(super) fn warn_of_notes(&mut self, notes: &[String]) {
        self.warnings.extend(Diagnostic::warnings("read-as", notes));
    }

    /// Returns the first variable with this name, or `None` if it has no value.
    pub(super) fn channel(&self, name: &str) -> Option<Channel> {
        let mut blocks = self.blocks.iter();
        let (block, column) = blocks.find_map(|block| Some((block, block.column(name)?)))?;
        let pairs = block.time_s.iter().zip(&column.values);
        let (time_s, values): (Vec<f64>, Vec<f64>) =
            pairs.filter(|(_, value)| is_number(**value)).map(|(t, v)| (*t, *v)).unzip();
        (!values.is_empty()).then(|| Channel::new(time_s, values))
    }

    /// Returns the variables of a pattern such as `mocap.{x y z}`, or `None` if one is missing.
    pub(super) fn channels(&self, pattern: &str) -> Option<Vec<Channel>> {
        names(pattern).map(|name| self.channel(&name)).collect()
    }

    /// Returns [`Error::Input`] for a recording with more than [`MAX_VARIABLES`].
    pub(super) fn check_variables(&self) -> Result<()> {
        let n = self.names().count().max(self.blocks.len());
        if n <= MAX_VARIABLES {
            return Ok(());
        }
        let (actual, wanted) = (format!("{n} variables"), format!("at most {MAX_VARIABLES}"));
        Err(Error::input(Place::file(&self.file), actual, wanted, HINT))
    }

    /// Returns [`Error::Input`] for a recording whose channels, which are copies, would exceed the
    /// budget.
    pub(super) fn check(&self, budget: &Budget) -> Result<()> {
        self.check_variables()?;
        for Block { time_s, columns, .. } in &self.blocks {
            // Each channel stores twice as many numbers, namely times and values.
            budget.bytes(2 * size_of::<f64>() * time_s.len() * columns.len().min(MAX_CHANNELS))?;
            budget.steps(STEPS * time_s.len() * (columns.len() + 1))?;
        }
        Ok(())
    }

    /// Returns the names of all columns, in the order of the file.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.blocks.iter().flat_map(|block| block.columns.iter().map(|c| c.name.as_str()))
    }

    /// Removes empty blocks, and makes all column names distinct: a second `x` becomes `block:x`,
    /// and a third one `block:x:2`.
    pub(super) fn with_different_names(mut self) -> Self {
        // The empty block of an event that never occurred would hide variables with the same names.
        self.blocks.retain(|block| !block.time_s.is_empty());
        let mut taken = BTreeSet::new();
        for block in &mut self.blocks {
            for column in &mut block.columns {
                let mut name = column.name.clone();
                let mut count = 1;
                while !taken.insert(name.clone()) {
                    let number = if count > 1 { format!(":{count}") } else { String::new() };
                    name = format!("{}:{}{number}", block.name, column.name);
                    count += 1;
                }
                column.name = name;
            }
        }
        self
    }

    /// Adds a warning about columns that contain cells without a number.
    pub(super) fn warn_of_empty_cells(&mut self) {
        for block in &self.blocks {
            let empty = block.columns.iter().filter_map(|Column { name, values, .. }| {
                let n = values.iter().filter(|value| !is_number(**value)).count();
                (n > 0).then(|| format!("{name} ({n} of {})", values.len()))
            });
            let list = empty.collect::<Vec<_>>().join(", ");
            if !list.is_empty() {
                let text = format!("cells without a number are left out: {list}");
                self.warnings.push(Diagnostic::warning("cells-empty", text));
            }
        }
    }
}

/// Returns the names that match a pattern, one for each part in its braces: `v{x y}` yields `vx`
/// and `vy`.
pub(super) fn names(pattern: &str) -> impl Iterator<Item = String> {
    let (before, rest) = pattern.split_once('{').expect("a pattern has braces");
    let (parts, after) = rest.split_once('}').expect("braces are closed");
    parts.split(' ').map(move |part| format!("{before}{part}{after}"))
}

/// Returns true for a finite number whose magnitude is below [`TOO_LARGE`].
fn is_number(value: f64) -> bool {
    value.abs() < TOO_LARGE
}

/// Returns a list of names for a message: the first twelve, followed by the number of the others.
pub(super) fn shortened(names: &[impl AsRef<str>]) -> String {
    let first: Vec<&str> = names.iter().take(MAX_LISTED).map(AsRef::as_ref).collect();
    let more = names.len().saturating_sub(MAX_LISTED);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{rest}", first.join(", "))
}

impl Channel {
    /// Returns a channel of at least one sample at strictly increasing times.
    pub(super) fn new(time_s: Vec<f64>, values: Vec<f64>) -> Self {
        let steps_s = time_s.windows(2).map(|pair| pair[1] - pair[0]);
        Self { period_s: median(steps_s).unwrap_or(0.0), time_s, values }
    }

    /// Returns the time of the first sample.
    pub(super) fn start_s(&self) -> f64 {
        self.time_s[0]
    }

    /// Returns the time of the last sample.
    pub(super) fn end_s(&self) -> f64 {
        self.time_s[self.time_s.len() - 1]
    }

    /// Returns the index of the last sample at or before a time, if there is one.
    fn last_before(&self, time_s: f64) -> Option<usize> {
        self.time_s.partition_point(|t| *t <= time_s).checked_sub(1)
    }

    /// Interpolates linearly at a time, in the channel's unit. Returns `None` outside the channel,
    /// and in gaps longer than `max_gap_s`.
    pub(super) fn linear(&self, time_s: f64, max_gap_s: f64) -> Option<f64> {
        let last = self.last_before(time_s)?;
        let (t0, v0) = (self.time_s[last], self.values[last]);
        if t0 == time_s {
            return Some(v0);
        }
        let (t1, v1) = (*self.time_s.get(last + 1)?, self.values[last + 1]);
        (t1 - t0 <= max_gap_s).then(|| v0 + (v1 - v0) * ((time_s - t0) / (t1 - t0)))
    }

    /// Returns the last value at or before a time, or the first value before the first sample, in
    /// the channel's unit.
    pub(super) fn held(&self, time_s: f64) -> f64 {
        self.values[self.last_before(time_s).unwrap_or(0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_is_linear_within_and_silent_across_gaps() {
        let channel = Channel::new(vec![0.0, 1.0, 5.0], vec![0.0, 2.0, 4.0]);
        let linear = |t| channel.linear(t, 1.0);
        assert_eq!(
            [linear(0.25), linear(1.0), linear(3.0), linear(5.0)],
            [Some(0.5), Some(2.0), None, Some(4.0)]
        );
        assert_eq!([linear(-0.1), linear(5.1)], [None, None], "nothing outside");
        assert_eq!([channel.held(-1.0), channel.held(4.9), channel.held(9.0)], [0.0, 2.0, 4.0]);
    }

    #[test]
    fn columns_of_one_name_are_renamed() {
        let column = || Column::new("x".into(), vec![]);
        let block = || Block {
            name: "b".into(),
            time_s: vec![0.0],
            columns: vec![column()],
            ..Block::default()
        };
        let blocks = vec![block(), block(), block()];
        let recording = Recording { blocks, ..Recording::default() }.with_different_names();
        assert_eq!(recording.names().collect::<Vec<_>>(), ["x", "b:x", "b:x:2"]);
    }
}
