//! Estimator with altitude and vertical velocity from the altitude filter, and everything else from
//! a Kalman filter.
//!
//! At every tick, the altitude filter predicts from the vertical component of the thrust, and
//! ranges are converted to heights with the estimated tilt. The Kalman filter receives neither
//! ranger nor barometer, whose biases it does not estimate.

use super::altitude_filter::{AltitudeFilter, AltitudeSensor, AltitudeState};
use super::ekf::Ekf;
use super::{Estimator, state_at};
use crate::sensors::Readings;
use crate::vehicle::State;

/// Row of the altitude in [`State`].
const ALTITUDE: usize = 2;

#[derive(Debug)]
pub(super) struct Altitude {
    pub(super) horizontal: Ekf,
    pub(super) vertical: AltitudeFilter,
    /// True if positions are satellite fixes.
    pub(super) has_satellites: bool,
}

impl Estimator for Altitude {
    /// Advances both filters by a tick. Horizontal motion and attitude follow from the Kalman
    /// filter, and the vertical motion from the altitude filter.
    fn update(&mut self, readings: &Readings<'_>, tick_s: f64) {
        // The Kalman filter is updated first, because its tilt corrects throttle and ranges.
        self.horizontal.update(&Readings { heights: &[], ..*readings }, tick_s);
        let cos_tilt = self.horizontal.motion.attitude.matrix()[(2, 2)];
        let filter = &mut self.vertical;
        if readings.throttle > 0.0 {
            filter.predict(readings.throttle * cos_tilt, tick_s);
        } else {
            filter.rest(tick_s);
        }
        if let Some(fix_m) = readings.position_m.filter(|_| self.has_satellites) {
            filter.update(AltitudeSensor::Gnss, fix_m.z);
        }
        for &(sensor, measured_m) in readings.heights {
            let height_per_m = if sensor.looks_down() { cos_tilt } else { 1.0 };
            filter.update(AltitudeSensor::from_height(sensor), measured_m * height_per_m);
        }
    }

    /// Returns the Kalman filter's state with the altitude filter's altitude and vertical velocity.
    fn state(&self) -> State {
        let mut velocity_m_s = self.horizontal.motion.velocity_m_s;
        velocity_m_s.z = self.vertical.estimate(AltitudeState::Velocity);
        let mut state = state_at(&self.horizontal.motion, &velocity_m_s);
        state[ALTITUDE] = self.vertical.estimate(AltitudeState::Altitude);
        state
    }

    fn altitude(&self) -> Option<&AltitudeFilter> {
        Some(&self.vertical)
    }
}
