//! Noise streams of the sensors, and the schedule of their readings.

use noctograph_core::random::Noise;

/// Noise streams of one drone's sensors, by name, so that no sensor affects another's stream.
#[derive(Clone, Copy, Debug)]
pub(super) struct Streams {
    /// Seed of the noise in this flight.
    pub(super) seed: u64,
    /// Seed of the room's errors.
    pub(super) room_seed: u64,
    /// Index of the drone.
    pub(super) drone: u64,
}

impl Streams {
    /// Returns the noise of a sensor of this drone. The noise differs between drones and flights.
    pub(super) fn drone_noise(&self, sensor: &str) -> Noise {
        self.noise_of(self.drone, sensor)
    }

    /// Returns the noise of a sensor on the drone with this index.
    pub(super) fn noise_of(&self, drone: u64, sensor: &str) -> Noise {
        Noise::new(self.seed, drone, sensor)
    }

    /// Returns the noise from which a room's errors are drawn, such as pose errors of stations and
    /// anchors. These errors are the same for all drones and flights in the room.
    pub(super) fn room_noise(&self, sensor: &str) -> Noise {
        Noise::new(self.room_seed, 0, sensor)
    }
}

/// Schedule of events at a constant rate.
#[derive(Debug)]
pub(crate) struct Clock {
    rate_hz: f64,
    n: u32,
}

impl Clock {
    /// Creates a schedule whose first event is due at time 0.
    pub(crate) fn new(rate_hz: f64) -> Self {
        Self { rate_hz, n: 0 }
    }

    /// Counts the next event if it is due by `time_s`, and returns its number from 0, or `None`.
    pub(crate) fn due(&mut self, time_s: f64) -> Option<usize> {
        (f64::from(self.n) <= time_s * self.rate_hz).then(|| {
            self.n += 1;
            self.n as usize - 1
        })
    }
}
