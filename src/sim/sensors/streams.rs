//! Noise streams of the sensors, and the schedule of their readings.

use noctograph_core::random::Noise;

/// The streams of one drone's sensors. A sensor draws from streams by name, so that none shifts
/// another's.
#[derive(Clone, Copy, Debug)]
pub(super) struct Streams {
    /// Of the noise of this flight.
    pub(super) seed: u64,
    /// Of what is wrong with the room.
    pub(super) room_seed: u64,
    /// Index of the drone.
    pub(super) drone: u64,
}

impl Streams {
    /// What differs between drones and flights.
    pub(super) fn own(&self, sensor: &str) -> Noise {
        self.of_drone(self.drone, sensor)
    }

    /// The same of another drone, or of the first of two.
    pub(super) fn of_drone(&self, drone: u64, sensor: &str) -> Noise {
        Noise::new(self.seed, drone, sensor)
    }

    /// What is wrong with a room, the same for all drones and flights in it: the places of stations
    /// and anchors, and what the solution for them bends.
    pub(super) fn shared_by_room(&self, sensor: &str) -> Noise {
        Noise::new(self.room_seed, 0, sensor)
    }
}

/// When something at a steady rate is due.
#[derive(Debug)]
pub(crate) struct Clock {
    rate_hz: f64,
    n: u32,
}

impl Clock {
    pub(crate) fn new(rate_hz: f64) -> Self {
        Self { rate_hz, n: 0 }
    }

    /// The number of the next one, from 0, where it is due by `time_s`; it counts as done.
    pub(crate) fn due(&mut self, time_s: f64) -> Option<usize> {
        (f64::from(self.n) <= time_s * self.rate_hz).then(|| {
            self.n += 1;
            self.n as usize - 1
        })
    }
}
