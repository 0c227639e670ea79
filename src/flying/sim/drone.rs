//! A simulated drone: its model, its truth and its noise.

use super::options::SimOptions;

/// A simulated drone.
#[derive(Clone, Copy, Debug)]
pub struct Drone<'a> {
    /// The model that controller and estimator are designed for.
    pub believed: &'a SimOptions,
    /// The true body, motors, battery, air and sensors.
    pub actual: &'a SimOptions,
    /// Seed of all noise but the room's.
    pub seed: u64,
    /// Seed of what is wrong with the room and stays so: places of its stations and anchors, and
    /// distortion. All drones in one room share it.
    pub room_seed: u64,
    /// Index among the drones that fly together. Each index has its own noise, in sensors and air.
    pub index: u64,
}

impl<'a> Drone<'a> {
    /// The drone of index 0, exactly as its controller believes it to be.
    #[must_use]
    pub fn new(options: &'a SimOptions, seed: u64) -> Self {
        Self { believed: options, actual: options, seed, room_seed: seed, index: 0 }
    }
}
