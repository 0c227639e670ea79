//! Budget for the work and the memory that an untrusted input may use. Work is counted instead of
//! timed, so that every machine accepts or refuses the same files.

use std::cell::Cell;

use crate::error::{Error, Result};
use crate::units::MIB;

/// Maximum amount of work for an input, in steps. A step takes about a nanosecond on one core of a
/// 2020 processor, as measured for each reader.
const MAX_STEPS: u64 = 1_000_000_000;

/// Maximum memory for an input in bytes, including temporary copies during reading.
const MAX_BYTES: u64 = 240 * MIB;

/// Work and memory that remain for an input, such as a file or a folder of files.
///
/// Decoders charge the budget before they do the work. Code that cannot return an error calls
/// [`Budget::spend_steps`], stops if that returns false, and leaves the error to [`Budget::check`].
#[derive(Debug)]
pub struct Budget {
    place: String,
    hint: &'static str,
    steps_left: Cell<u64>,
    bytes_left: Cell<u64>,
    /// Kind of the first charge that exceeded the budget.
    beyond: Cell<Option<Beyond>>,
}

#[derive(Clone, Copy, Debug)]
enum Beyond {
    Steps,
    Bytes,
}

impl Budget {
    /// Creates the budget for an input. `place` is the input's name in messages, and `hint` the
    /// advice given when the budget is exceeded.
    pub fn new(place: impl Into<String>, hint: &'static str) -> Self {
        let place = place.into();
        let (steps_left, bytes_left) = (Cell::new(MAX_STEPS), Cell::new(MAX_BYTES));
        Self { place, hint, steps_left, bytes_left, beyond: Cell::new(None) }
    }

    /// Charges steps of work. Returns true unless this or an earlier charge exceeds the budget.
    pub fn spend_steps(&self, steps: usize) -> bool {
        self.spend(&self.steps_left, steps, Beyond::Steps)
    }

    /// Charges steps of work. Returns an error if the budget is exceeded.
    pub fn steps(&self, steps: usize) -> Result<()> {
        self.spend_steps(steps);
        self.check()
    }

    /// Charges bytes that the input will occupy. Returns an error if the budget is exceeded.
    pub fn bytes(&self, bytes: usize) -> Result<()> {
        self.spend(&self.bytes_left, bytes, Beyond::Bytes);
        self.check()
    }

    /// Returns the number of bytes that remain.
    pub fn bytes_left(&self) -> u64 {
        self.bytes_left.get()
    }

    /// Credits bytes that the input no longer occupies to the budget.
    pub fn free(&self, bytes: u64) {
        self.bytes_left.set((self.bytes_left.get() + bytes).min(MAX_BYTES));
    }

    /// Checks that no charge has exceeded the budget so far.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] with the limit.
    pub fn check(&self) -> Result<()> {
        // The first charge that exceeded the budget is named as the reason.
        let (what, most, unit) = match self.beyond.get() {
            None => return Ok(()),
            Some(Beyond::Steps) => {
                ("more work than an input may cause", MAX_STEPS / 1_000_000, "million steps")
            }
            Some(Beyond::Bytes) => {
                ("more data than an input may contain", MAX_BYTES / MIB, "MiB of memory")
            }
        };
        let wanted = format!("at most {most} {unit}");
        Err(Error::input("", what, wanted, self.hint)
            .coded("input-large")
            .in_file(&self.place, None))
    }

    /// Charges an amount against what is left, and notes `beyond` as the reason if that is too
    /// little. Returns true if the budget is still not exceeded. Later charges do not change the
    /// reason.
    fn spend(&self, left: &Cell<u64>, amount: usize, beyond: Beyond) -> bool {
        if self.beyond.get().is_none() {
            match left.get().checked_sub(amount as u64) {
                Some(rest) => left.set(rest),
                None => self.beyond.set(Some(beyond)),
            }
        }
        self.beyond.get().is_none()
    }
}

/// Adds a value to a column of unknown length. The column's capacity grows by an eighth, because
/// doubling it could use twice the memory that was charged.
pub fn push<T>(column: &mut Vec<T>, value: T) {
    // The constant part keeps the first values of a column from being copied at every push.
    const FIRST_CAPACITY: usize = 64;
    if column.len() == column.capacity() {
        column.reserve_exact(column.len() / 8 + FIRST_CAPACITY);
    }
    column.push(value);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_spent_once_and_stays_spent() {
        let budget = Budget::new("a.svg", "simplify it");
        let most = usize::try_from(MAX_STEPS).unwrap();
        assert!(budget.spend_steps(most) && budget.check().is_ok(), "all of it");
        assert!(!budget.spend_steps(1) && !budget.spend_steps(0));
        let error = budget.bytes(0).unwrap_err();
        assert!(error.to_string().starts_with("a.svg: found more work"), "{error}");
        assert_eq!(error.hint(), "simplify it");
    }

    #[test]
    fn memory_may_be_given_back() {
        let budget = Budget::new("a.csv", "cut it");
        budget.bytes(7).unwrap();
        let left = budget.bytes_left();
        budget.bytes(usize::try_from(left).unwrap()).unwrap();
        budget.free(left);
        budget.bytes(usize::try_from(left).unwrap()).unwrap();
        let error = budget.bytes(1).unwrap_err().to_string();
        assert!(error.contains("more data than an input may contain, wanted at most 240 MiB"));
    }
}
