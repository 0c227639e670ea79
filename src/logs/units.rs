//! Units of stamps by name.

use super::TimeUnit;

impl TimeUnit {
    /// Its seconds; `None` where it is to be found.
    pub(super) fn seconds(self) -> Option<f64> {
        match self {
            Self::Auto => None,
            Self::Seconds => Some(1.0),
            Self::Milliseconds => Some(1e-3),
            Self::Microseconds => Some(1e-6),
            Self::Nanoseconds => Some(1e-9),
        }
    }
}
