//! A flight at constant altitude: truth, estimates and readings.

use noctograph_flying::sim::{AltitudeFilter, AltitudeState, HeightReading};

/// Samples, and in the scalar model steps of the filter, per second: the lab sheet's.
pub(super) const SAMPLES_HZ: u32 = 10;
/// A change of the floor that is an event.
const EVENT_M: f64 = 0.1;
/// Altitude that is held.
pub(super) const SET_M: f64 = 1.5;

/// A flight at constant altitude.
#[derive(Clone, Debug)]
pub struct Hold {
    /// Altitude that is held.
    pub set_m: f64,
    /// Samples, ten a second.
    pub samples: Vec<HoldSample>,
    /// Steps of the floor that the filter found.
    pub steps: u32,
}

/// Truth, estimate and readings at one instant.
#[derive(Clone, Debug)]
pub struct HoldSample {
    /// Time since the start.
    pub time_s: f64,
    /// True states, in the order of [`AltitudeState`].
    pub truth: [f64; 6],
    /// Estimated states.
    pub estimate: [f64; 6],
    /// Standard deviations of the estimates.
    pub sigma: [f64; 6],
    /// Throttle that is commanded from now on.
    pub throttle: f64,
    /// Readings since the sample before.
    pub readings: Vec<HeightReading>,
}

/// All states, in order.
const STATES: [AltitudeState; 6] = [
    AltitudeState::Altitude,
    AltitudeState::Velocity,
    AltitudeState::Offset,
    AltitudeState::Gain,
    AltitudeState::Ranger,
    AltitudeState::Barometer,
];

/// Their names in tables.
pub const STATE_NAMES: [&str; 6] = ["z", "v", "α⁰", "α¹", "ranger", "barometer"];

impl HoldSample {
    pub(super) fn new(
        time_s: f64,
        truth: [f64; 6],
        filter: &AltitudeFilter,
        throttle: f64,
        readings: Vec<HeightReading>,
    ) -> Self {
        let estimate = STATES.map(|state| filter.estimate(state));
        let sigma = STATES.map(|state| filter.sigma(state));
        Self { time_s, truth, estimate, sigma, throttle, readings }
    }

    /// Throttle −α⁰/α¹ that carries the drone's weight: true and estimated.
    #[must_use]
    pub fn hover_throttle(&self) -> [f64; 2] {
        [self.truth, self.estimate].map(|states| -states[2] / states[3])
    }
}

impl Hold {
    /// Times at which the floor that the ranger sees stepped, for two samples at least.
    #[must_use]
    pub fn events_s(&self) -> Vec<f64> {
        let floor_m = |sample: &HoldSample| sample.truth[4];
        let (mut events_s, mut last_m) = (Vec::new(), self.samples.first().map_or(0.0, floor_m));
        for pair in self.samples.windows(2) {
            if pair.iter().all(|sample| (floor_m(sample) - last_m).abs() > EVENT_M) {
                events_s.push(pair[0].time_s);
                last_m = floor_m(&pair[0]);
            }
        }
        events_s
    }
}
