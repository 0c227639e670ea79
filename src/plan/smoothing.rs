//! The two moving averages that round the corners of a stroke.
//!
//! The velocity of a pen at constant speed changes abruptly at every corner. Two consecutive moving
//! averages over time make its motion flyable. Over the longer one, `T1`, a change of velocity Δv
//! becomes an acceleration of Δv/T1. The shorter average, `T2`, limits the jerk to Δv/(T1 T2). A
//! corner is cut by at most `Δv (T1/8 + T2²/(24 T1))`.

use super::EvenStyle;

/// Lengths of the two moving averages, and the change of velocity that they permit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Smoothing {
    pub(super) long_s: f64,
    pub(super) short_s: f64,
    /// Maximum change of velocity in m/s within the longer average.
    pub(super) turn_m_s: f64,
}

impl Smoothing {
    /// Returns the longest averages that satisfy the limits of a style at a stroke speed. A corner
    /// is then cut by at most the style's error.
    pub(super) fn new(stroke_speed_m_s: f64, style: &EvenStyle) -> Self {
        let (a, j) = (style.acceleration_m_s2, style.jerk_m_s3);
        let error_m = style.corner_error_m;
        let short_s = a / j;
        // With T1 = T2 = T, only the jerk matters, and the corner is cut by j T³ / 6.
        let equal_s = libm::cbrt(6.0 * error_m / j);
        if equal_s <= short_s {
            let turn_m_s = j * equal_s * equal_s;
            return Self { long_s: equal_s, short_s: equal_s, turn_m_s };
        }
        // The corner's error for Δv = a T1 determines T1, and the jerk determines T2 = a / j.
        // For T1 > T2, the error is a (T1²/8 + T2²/24).
        let by_error_s = (8.0 * (error_m / a - short_s * short_s / 24.0)).sqrt();
        // A pen never changes its velocity by more than twice its speed, so an even longer average
        // would only cut corners more.
        let enough_s = (2.0 * stroke_speed_m_s / a).max(short_s);
        let long_s = by_error_s.min(enough_s);
        Self { long_s, short_s, turn_m_s: a * long_s }
    }

    /// Returns the acceleration in a corner in m/s², below the limit if the jerk requires it.
    pub(super) fn acceleration_m_s2(&self) -> f64 {
        self.turn_m_s / self.long_s
    }

    /// Returns the time in s over which the pen is averaged before and after an instant.
    pub(super) fn reach_s(&self) -> f64 {
        0.5 * (self.long_s + self.short_s)
    }
}
