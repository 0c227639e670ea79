//! A position at every tick: white jitter and a smooth distortion, without base stations.

use nalgebra::Vector3;

use crate::sim::noise::{Field, Noise, Normals};
use crate::sim::options::LighthouseOptions;

/// Fixes per second of a Lighthouse: one turn of a second-generation rotor (50.05 Hz, firmware
/// `pulse_processor_v2.c`). Only the distortion keeps to it; it hardly changes in between.
const FIX_RATE_HZ: u32 = 50;

/// The reference flight's Lighthouse as its log shows it.
#[derive(Debug)]
pub(super) struct PositionSensor {
    jitter_m: f64,
    jitter: Normals,
    distortion: Field<3>,
    distortion_m: Vector3<f64>,
    ticks_per_fix: u32,
}

impl PositionSensor {
    pub(super) fn new(
        options: &LighthouseOptions,
        rate_hz: u32,
        noise: impl Fn(&str) -> Noise,
    ) -> Self {
        Self {
            jitter_m: options.jitter_m,
            jitter: Normals::new(noise("lighthouse jitter")),
            distortion: Field::new(
                &mut noise("lighthouse distortion"),
                options.distortion_m,
                options.distortion_length_m,
            ),
            distortion_m: Vector3::zeros(),
            ticks_per_fix: (rate_hz / FIX_RATE_HZ).max(1),
        }
    }

    /// Position that a drone at rest is believed to be at, once the jitter has averaged out.
    pub(super) fn settled_m(&self, position_m: Vector3<f64>) -> Vector3<f64> {
        position_m + self.distortion.at(&position_m)
    }

    /// The position as measured at a tick.
    pub(super) fn read(&mut self, position_m: Vector3<f64>, tick: u32) -> Vector3<f64> {
        if tick.is_multiple_of(self.ticks_per_fix) {
            self.distortion_m = self.distortion.at(&position_m);
        }
        position_m + self.distortion_m + self.jitter.next_three() * self.jitter_m
    }
}
