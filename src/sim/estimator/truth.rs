//! The estimator that cheats: it knows the true state. For telling the controller's error from the
//! estimator's.

use nalgebra::Vector3;

use super::Estimator;
use crate::sim::sensors::Readings;
use crate::sim::vehicle::{State, at};

/// The true state of the last tick.
#[derive(Debug)]
pub(super) struct Truth {
    state: State,
}

impl Truth {
    pub(super) fn new(position_m: Vector3<f64>) -> Self {
        Self { state: at(position_m, 0.0) }
    }
}

impl Estimator for Truth {
    fn update(&mut self, readings: &Readings<'_>, _tick_s: f64) {
        self.state = *readings.truth;
    }

    fn state(&self) -> State {
        self.state
    }
}
