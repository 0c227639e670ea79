//! The estimator that cheats: it knows the true state. For telling the controller's error from the
//! estimator's.

use nalgebra::Vector3;

use super::Estimator;
use crate::sensors::Readings;
use crate::vehicle::{RigidBody, State};

/// The true motion at the last tick.
#[derive(Debug)]
pub(super) struct Truth {
    body: RigidBody,
}

impl Truth {
    pub(super) fn new(position_m: Vector3<f64>) -> Self {
        Self { body: RigidBody::at(position_m) }
    }
}

impl Estimator for Truth {
    fn update(&mut self, readings: &Readings<'_>, _tick_s: f64) {
        self.body = *readings.truth;
    }

    fn face(&mut self, yaw_rad: f64) {
        self.body = self.body.facing(yaw_rad);
    }

    fn state(&self) -> State {
        self.body.state()
    }
}
