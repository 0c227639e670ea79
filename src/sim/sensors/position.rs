//! Position sensor with white jitter and a smooth distortion, without base stations.

use nalgebra::{Matrix3, Vector3};

use super::LighthouseOptions;
use super::lighthouse::{common_distortion, frame_turn};
use super::streams::Streams;
use noctograph_core::random::{Field, Normals};

/// Number of Lighthouse fixes per second, one per turn of a second-generation rotor (50.05 Hz,
/// firmware `pulse_processor_v2.c`). Only the distortion is computed at this rate.
const FIX_RATE_HZ: u32 = 50;

/// Lighthouse of the reference flight, modeled by the errors in its log.
#[derive(Debug)]
pub(super) struct PositionSensor {
    /// Rotation and scale from the room to the Lighthouse's frame.
    frame: Matrix3<f64>,
    jitter_m: f64,
    jitter: Normals,
    distortion: Field<3>,
    distortion_m: Vector3<f64>,
    ticks_per_fix: u32,
}

impl PositionSensor {
    /// Creates the sensor before its first reading. Positions are read `rate_hz` times per second.
    pub(super) fn new(options: &LighthouseOptions, rate_hz: u32, streams: &Streams) -> Self {
        Self {
            frame: frame_turn(options) * (1.0 + options.frame_scale_error),
            jitter_m: options.jitter_m,
            jitter: Normals::new(streams.drone_noise("lighthouse jitter")),
            distortion: common_distortion(options, streams),
            distortion_m: Vector3::zeros(),
            ticks_per_fix: (rate_hz / FIX_RATE_HZ).max(1),
        }
    }

    /// Returns the mean measured position of a drone at rest, which does not include the jitter.
    pub(super) fn settled_m(&self, position_m: Vector3<f64>) -> Vector3<f64> {
        self.frame * position_m + self.distortion.value_at(&position_m)
    }

    /// Returns the position in m as measured at a tick, with frame error, distortion and jitter.
    /// The distortion changes only at the ticks of a fix.
    pub(super) fn read(&mut self, position_m: Vector3<f64>, tick: u32) -> Vector3<f64> {
        if tick.is_multiple_of(self.ticks_per_fix) {
            self.distortion_m = self.distortion.value_at(&position_m);
        }
        self.frame * position_m + self.distortion_m + self.jitter.next_three() * self.jitter_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_that_was_laid_out_wrongly_turns_and_stretches_the_room() {
        let options = LighthouseOptions {
            jitter_m: 0.0,
            distortion_m: 0.0,
            frame_turn_rad: [0.0, 0.0, 0.01],
            frame_scale_error: 0.02,
            ..LighthouseOptions::default()
        };
        let mut sensor = PositionSensor::new(&options, 500, &Streams::alone(1));
        let place_m = Vector3::new(0.5, 0.0, 0.8);
        let want_m = Vector3::new(0.51 * libm::cos(0.01), 0.51 * libm::sin(0.01), 0.816);
        assert!((sensor.settled_m(place_m) - want_m).norm() < 1e-12);
        assert!((sensor.read(place_m, 0) - want_m).norm() < 1e-12);
    }
}
