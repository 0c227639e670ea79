//! Conversion factors between units.

/// Number of centimeters in a meter.
pub const CM_PER_M: f64 = 100.0;
/// Number of millimeters in a meter.
pub const MM_PER_M: f64 = 1e3;
/// Number of milliseconds in a second.
pub const MS_PER_S: f64 = 1e3;
/// Length of a foot, m.
pub const FOOT_M: f64 = 0.3048;
/// Number of bytes in a kibibyte.
pub const KIB: u64 = 1 << 10;
/// Number of bytes in a mebibyte.
pub const MIB: u64 = 1 << 20;
