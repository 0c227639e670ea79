//! Recording: the columns of a log file, before they are given a meaning.

use std::collections::BTreeSet;

use super::{Axes, HINT, MAX_VARIABLES};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Place, Result};
use noctograph_core::files::Budget;
use noctograph_core::statistics::median;

/// Most variables that become quantities of a flight, each as a channel.
const MAX_CHANNELS: usize = 32;

/// Steps of the work on a number until it is part of a channel.
const STEPS: usize = 10;

/// The contents of a log file: blocks of columns, each block with its own time axis, values in the
/// units of the log.
#[derive(Debug, Default)]
pub(super) struct Recording {
    pub(super) file: String,
    pub(super) blocks: Vec<Block>,
    /// Period after which the drone's times start again at zero, if they do.
    pub(super) wrap_s: Option<f64>,
    /// True for times of `usecTimestamp` (µSD logs), which counts 84 µs in 85 in firmware up to and
    /// with release 2026.08. Others are true ticks of the operating system.
    pub(super) is_on_card: bool,
    /// The drone's firmware, by its name in the log.
    pub(super) firmware: Option<String>,
    /// True if its times are on a clock that other logs may have, too.
    pub(super) is_stamped: bool,
    /// Axes of the world of its plain columns, as far as the format says.
    pub(super) axes: Axes,
    /// The format that says so.
    pub(super) in_format: Option<&'static str>,
    pub(super) warnings: Vec<Diagnostic>,
}

/// Columns that were logged together.
#[derive(Debug, Default)]
pub(super) struct Block {
    pub(super) name: String,
    pub(super) clock: Clock,
    /// Times, as logged until [`super::clock::repaired`]. Then they rise.
    pub(super) time_s: Vec<f64>,
    pub(super) columns: Vec<Column>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Clock {
    #[default]
    Drone,
    /// The computer of the motion capture, with another zero.
    Mocap,
}

/// One logged variable. Cells without a number are not finite. A [`Channel`] leaves them out.
#[derive(Debug, Default)]
pub(super) struct Column {
    pub(super) name: String,
    pub(super) values: Vec<f64>,
    /// True for an angle, or an angular velocity, whose title names no unit.
    pub(super) is_open_angle: bool,
    /// Its title and number in a table, if the title is not known.
    pub(super) unknown: Option<String>,
}

/// A variable over time: finite values at strictly rising times.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Channel {
    pub(super) time_s: Vec<f64>,
    pub(super) values: Vec<f64>,
    /// Median time between two samples, zero for a single one.
    pub(super) period_s: f64,
}

impl Column {
    pub(super) fn new(name: String, values: Vec<f64>) -> Self {
        Self { name, values, ..Self::default() }
    }
}

impl Block {
    pub(super) fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }

    pub(super) fn column_mut(&mut self, name: &str) -> Option<&mut Column> {
        self.columns.iter_mut().find(|column| column.name == name)
    }
}

impl Recording {
    pub(super) fn new(file: &str) -> Self {
        Self { file: file.to_owned(), ..Self::default() }
    }

    pub(super) fn warn(&mut self, code: &'static str, message: impl Into<String>) {
        self.warnings.push(Diagnostic::warning(code, message));
    }

    pub(super) fn warn_of_notes(&mut self, notes: &[String]) {
        self.warnings.extend(Diagnostic::warnings("read-as", notes));
    }

    /// The first variable of this name over time, if it was logged and ever had a value.
    pub(super) fn channel(&self, name: &str) -> Option<Channel> {
        let mut blocks = self.blocks.iter();
        let (block, column) = blocks.find_map(|block| Some((block, block.column(name)?)))?;
        let pairs = block.time_s.iter().zip(&column.values);
        let (time_s, values): (Vec<f64>, Vec<f64>) =
            pairs.filter(|(_, value)| is_number(**value)).map(|(t, v)| (*t, *v)).unzip();
        (!values.is_empty()).then(|| Channel::new(time_s, values))
    }

    /// Variables whose names differ in the parts in braces, such as `mocap.{x y z}`. `None` if one
    /// is missing.
    pub(super) fn channels(&self, pattern: &str) -> Option<Vec<Channel>> {
        names(pattern).map(|name| self.channel(&name)).collect()
    }

    /// Checks that there are no more variables than a log may have.
    pub(super) fn check_variables(&self) -> Result<()> {
        let n = self.names().count().max(self.blocks.len());
        if n <= MAX_VARIABLES {
            return Ok(());
        }
        let (actual, wanted) = (format!("{n} variables"), format!("at most {MAX_VARIABLES}"));
        Err(Error::input(Place::file(&self.file), actual, wanted, HINT))
    }

    /// Checks that the work on it is within a budget. Its channels are copies.
    pub(super) fn check(&self, budget: &Budget) -> Result<()> {
        self.check_variables()?;
        for Block { time_s, columns, .. } in &self.blocks {
            // Twice the numbers of the channels: times and values.
            budget.bytes(2 * size_of::<f64>() * time_s.len() * columns.len().min(MAX_CHANNELS))?;
            budget.steps(STEPS * time_s.len() * (columns.len() + 1))?;
        }
        Ok(())
    }

    /// The names of all columns, in the order of the file.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.blocks.iter().flat_map(|block| block.columns.iter().map(|c| c.name.as_str()))
    }

    /// The same without empty blocks, and with different names of all columns: a second `x` becomes
    /// `block:x`, a third `block:x:2`.
    pub(super) fn with_different_names(mut self) -> Self {
        // An event that never came would shadow logged variables of the same names.
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

/// The names of a pattern with their differing parts in braces.
pub(super) fn names(pattern: &str) -> impl Iterator<Item = String> {
    let (before, rest) = pattern.split_once('{').expect("a pattern has braces");
    let (parts, after) = rest.split_once('}').expect("braces are closed");
    parts.split(' ').map(move |part| format!("{before}{part}{after}"))
}

/// True for a finite number of a size that a drone may log.
fn is_number(value: f64) -> bool {
    value.abs() < 1e18
}

/// A list for a message: the first twelve names, then a count.
pub(super) fn shortened(names: &[impl AsRef<str>]) -> String {
    let first: Vec<&str> = names.iter().take(12).map(AsRef::as_ref).collect();
    let more = names.len().saturating_sub(12);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{rest}", first.join(", "))
}

impl Channel {
    /// A channel of at least one sample at strictly rising times.
    pub(super) fn new(time_s: Vec<f64>, values: Vec<f64>) -> Self {
        let steps_s = time_s.windows(2).map(|pair| pair[1] - pair[0]);
        Self { period_s: median(steps_s).unwrap_or(0.0), time_s, values }
    }

    pub(super) fn start_s(&self) -> f64 {
        self.time_s[0]
    }

    pub(super) fn end_s(&self) -> f64 {
        self.time_s[self.time_s.len() - 1]
    }

    /// Index of the last sample at or before a time, if there is one.
    fn last_at(&self, time_s: f64) -> Option<usize> {
        self.time_s.partition_point(|t| *t <= time_s).checked_sub(1)
    }

    /// Linear interpolation at a time. `None` outside the channel, and between samples further
    /// apart than `max_gap_s`.
    pub(super) fn linear(&self, time_s: f64, max_gap_s: f64) -> Option<f64> {
        let last = self.last_at(time_s)?;
        let (t0, v0) = (self.time_s[last], self.values[last]);
        if t0 == time_s {
            return Some(v0);
        }
        let (t1, v1) = (*self.time_s.get(last + 1)?, self.values[last + 1]);
        (t1 - t0 <= max_gap_s).then(|| v0 + (v1 - v0) * ((time_s - t0) / (t1 - t0)))
    }

    /// The value last logged at a time, before the first sample the first.
    pub(super) fn held(&self, time_s: f64) -> f64 {
        self.values[self.last_at(time_s).unwrap_or(0)]
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
