//! Altitude hold with three imperfect sensors and an unknown thrust map.
//!
//! A quadcopter measures its altitude by satellites, by a ranger above an uneven floor, and by a
//! drifting barometer. The relation between throttle τ and lift is unknown and changes with the
//! battery: `z̈ = α⁰ + α¹ τ`. [`AltitudeFilter`](noctograph_sim::AltitudeFilter) estimates
//! altitude, vertical velocity, α⁰, α¹ and both biases. [`hold()`] uses these estimates to keep the
//! altitude in several [`HoldScenario`]s. There are two [`HoldModel`]s: a scalar one and the full
//! simulator.
//!
//! Limits of the filter: while the throttle is constant, α⁰ and α¹ are not separately observable
//! (rank 5 of 6, and 4 during a satellite outage). Only the hover throttle −α⁰/α¹ is observable.
//! The filter therefore reports the hover throttle, and α¹ with its standard deviation.

mod figures;
mod full;
mod scalar;
mod scenario;

pub use self::figures::{
    Bounds, CONSISTENT, Consistency, DURATION_S, HoldFigures, HoldVerdict, hold_figures,
};
pub use self::scenario::HoldScenario;
use std::io::Write;

use noctograph_core::error::{Error, Result, within};
use noctograph_core::settings::settings;
use noctograph_sim::{
    AltitudeFilter, AltitudeSensor, AltitudeState, EstimatorKind, HeightReading, SimOptions,
};

/// Maximum duration of a flight.
const MAX_DURATION_S: f64 = 3600.0;
/// Rate of samples, and of the scalar model's filter steps, as in the lab sheet.
const SAMPLES_HZ: u32 = 10;
/// Minimum change of the floor's height that counts as an event.
const EVENT_M: f64 = 0.1;
/// Commanded altitude.
const SET_M: f64 = 1.5;

settings! {
    /// Model of the simulated drone.
    pub enum HoldModel {
        /// Vertical motion only: a gain, an offset, a motor lag and gusts.
        "scalar" => Scalar,
        /// The full simulator: body, rotors, battery, sensors and controller.
        "full" => Full,
    }
}

/// Simulates altitude hold in a scenario for `duration_s`, with noise from a seed.
///
/// The drone, its sensors, the filter and the gains are taken from the options. The drone's true
/// lift differs from the options by a fraction drawn from the seed.
///
/// # Errors
///
/// Returns the errors of [`SimOptions::check`]. Returns [`Error::Input`] for options without an
/// altitude filter, and for a duration out of range. Returns [`Error::Infeasible`] if the drone
/// does not stay in the air.
pub fn hold(
    model: HoldModel,
    options: &SimOptions,
    scenario: HoldScenario,
    duration_s: f64,
    seed: u64,
) -> Result<Hold> {
    options.check()?;
    let kind = options.observer.kind;
    if kind != EstimatorKind::Altitude {
        let hint = "use the preset bzzz, or set the kind and sensors of the altitude filter";
        return Err(Error::input("observer.kind", kind.name(), "altitude", hint));
    }
    within("duration_s", duration_s, 1.0, MAX_DURATION_S)?;
    // Both models fly the same scenario with the same actual drone.
    match model {
        HoldModel::Scalar => scalar::hold(options, scenario, duration_s, seed),
        HoldModel::Full => full::hold(options, scenario, duration_s, seed),
    }
}

/// A flight at constant altitude.
#[derive(Clone, Debug)]
pub struct Hold {
    /// Commanded altitude.
    pub set_m: f64,
    /// Samples, ten per second.
    pub samples: Vec<HoldSample>,
    /// Number of floor steps that the filter detected.
    pub steps: u32,
}

/// True states, estimates and readings at one instant.
#[derive(Clone, Debug)]
pub struct HoldSample {
    /// Time since the start of the flight.
    pub time_s: f64,
    /// True states, in the order of [`AltitudeState`].
    pub truth: [f64; 6],
    /// Estimated states.
    pub estimate: [f64; 6],
    /// Standard deviations of the estimates.
    pub sigma: [f64; 6],
    /// Throttle command until the next sample.
    pub throttle: f64,
    /// Readings since the previous sample.
    pub readings: Vec<HeightReading>,
}

/// Altitude states in the order of their columns.
const STATES: [AltitudeState; 6] = [
    AltitudeState::Altitude,
    AltitudeState::Velocity,
    AltitudeState::Offset,
    AltitudeState::Gain,
    AltitudeState::Ranger,
    AltitudeState::Barometer,
];

/// Names of the states in tables.
pub const STATE_NAMES: [&str; 6] = ["z", "v", "α⁰", "α¹", "ranger", "barometer"];
/// Names of the states' columns in files.
const STATE_COLUMNS: [&str; 6] =
    ["z_m", "v_m_s", "offset_m_s2", "gain_m_s2", "ranger_bias_m", "barometer_bias_m"];

impl Hold {
    /// Writes the flight as CSV, with a row for each sample.
    pub fn write_csv(&self, out: impl Write) -> std::io::Result<()> {
        let mut out = csv::Writer::from_writer(out);
        let columns = ["true", "estimated", "sigma"]
            .iter()
            .flat_map(|kind| STATE_COLUMNS.iter().map(move |state| format!("{state}_{kind}")));
        let header = ["time_s", "throttle", "gnss_m", "time_of_flight_m", "barometer_m"];
        out.write_record(header.map(str::to_owned).into_iter().chain(columns))?;
        // A cell contains the sensor's last reading since the previous sample, or is empty.
        for s in &self.samples {
            let numbers = [s.time_s, s.throttle].map(Some);
            let readings = AltitudeSensor::ALL.map(|sensor| {
                let last = s.readings.iter().rfind(|reading| reading.sensor == sensor);
                last.map(|reading| reading.measured_m)
            });
            let states = [s.truth, s.estimate, s.sigma].into_iter().flatten().map(Some);
            let values = numbers.into_iter().chain(readings).chain(states);
            let cells = values.map(|number| number.map_or_else(String::new, |n| n.to_string()));
            out.write_record(cells)?;
        }
        out.flush()
    }

    /// Returns the times at which the floor below the ranger steps by more than 0.1 m, for at least
    /// two samples.
    pub fn events_s(&self) -> Vec<f64> {
        // State 4 is the ranger's bias, the negative of the floor's height.
        let (mut events_s, mut level_m) = (Vec::new(), None);
        for pair in self.samples.windows(2) {
            let last_m = level_m.get_or_insert(pair[0].truth[4]);
            if pair.iter().all(|sample| (sample.truth[4] - *last_m).abs() > EVENT_M) {
                events_s.push(pair[0].time_s);
                *last_m = pair[0].truth[4];
            }
        }
        events_s
    }
}

impl HoldSample {
    /// Creates a sample with the filter's estimates and standard deviations. `truth` contains the
    /// true states, and `throttle` is the commanded fraction of full thrust.
    fn new(
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

    /// Returns the true and the estimated throttle −α⁰/α¹ that balances the drone's weight.
    pub fn hover_throttle(&self) -> [f64; 2] {
        [self.truth, self.estimate].map(|states| -states[2] / states[3])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_pipeline::scene::{Preset, Scene};
    use noctograph_sim::sensors::Positioning;

    /// Returns the root mean square distance from the commanded altitude, from 5 s on.
    fn rms_m(model: HoldModel, options: &SimOptions, seed: u64) -> f64 {
        let flight = hold(model, options, HoldScenario::Step, 60.0, seed).unwrap();
        let settled = flight.samples.iter().filter(|s| s.time_s > 5.0);
        let squares: Vec<f64> = settled.map(|s| (s.truth[0] - 1.5) * (s.truth[0] - 1.5)).collect();
        (squares.iter().sum::<f64>() / f64::from(u32::try_from(squares.len()).unwrap())).sqrt()
    }

    #[test]
    fn without_the_step_test_a_table_moves_the_drone() {
        let sighted = Scene::preset(Preset::Bzzz).sim();
        let mut blind = sighted.clone();
        blind.observer.altitude.step_gate_sigmas = 1e3;
        for model in [HoldModel::Scalar, HoldModel::Full] {
            let (with_m, without_m) = (rms_m(model, &sighted, 1), rms_m(model, &blind, 1));
            assert!(without_m > 2.0 * with_m, "{model:?}: {without_m} m against {with_m} m");
        }
    }

    #[test]
    fn an_empty_battery_keeps_the_rest_of_its_lift_in_both_models() {
        let options = Scene::preset(Preset::Bzzz).sim();
        for model in [HoldModel::Scalar, HoldModel::Full] {
            let flight = hold(model, &options, HoldScenario::Drain, 300.0, 1).unwrap();
            let [from, to] = [61.0, 299.0]
                .map(|time_s| flight.samples.iter().find(|s| s.time_s >= time_s).unwrap().truth);
            assert!((to[3] / from[3] - 1.0).abs() < 0.05, "{model:?}: {from:?}, {to:?}");
            assert!((to[0] - SET_M).abs() < 0.2, "{model:?}: {} m", to[0]);
        }
    }

    #[test]
    fn uncertainty_grows_while_the_satellites_are_silent_and_is_back_within_a_second() {
        for model in [HoldModel::Scalar, HoldModel::Full] {
            let flight =
                hold(model, &Scene::preset(Preset::Bzzz).sim(), HoldScenario::Silent, 35.0, 3)
                    .unwrap();
            // The error grows at once to the ranger's bound over a known floor, and stays there.
            let [before_m, first_m, later_m @ .., after_m] =
                [19.9, 20.1, 20.5, 22.0, 25.0, 29.9, 31.1].map(|time_s| {
                    let mut samples = flight.samples.iter();
                    samples.find(|s| s.time_s >= time_s - 1e-9).unwrap().sigma[0]
                });
            assert!(first_m > 1.1 * before_m, "{model:?}: {first_m} m");
            assert!(later_m.iter().all(|m| *m > 1.3 * before_m), "{model:?}: {later_m:?} m");
            assert!(after_m < 1.05 * before_m, "{model:?}: {after_m} m");
        }
    }

    #[test]
    fn what_cannot_be_held_is_refused_with_the_key() {
        type Change = fn(&mut SimOptions);
        let cases: [(&str, Change); 9] = [
            ("sensors.gnss.noise_m: found -0.1", |o| o.sensors.gnss.noise_m = -0.1),
            ("sensors.time_of_flight.noise_m", |o| o.sensors.time_of_flight.noise_m = f64::NAN),
            ("sensors.gnss.silent_s[0]: found 30 to 20 s", |o| {
                o.sensors.gnss.silent_s = vec![[30.0, 20.0]];
            }),
            ("sensors.gnss.silent_s[1]: found 25 to 40 s, wanted a beginning not before", |o| {
                o.sensors.gnss.silent_s = vec![[20.0, 30.0], [25.0, 40.0]];
            }),
            ("observer.kind: found altitude without an altitude sensor", |o| {
                o.sensors.positioning = Positioning::Position;
                o.sensors.heights.clear();
            }),
            ("observer.altitude.barometer_sigma_m", |o| {
                o.observer.altitude.barometer_sigma_m = 0.0
            }),
            ("observer.kind: found ekf, wanted altitude", |o| {
                o.observer.kind = EstimatorKind::Ekf;
            }),
            ("plan, setpoint 1: found a height of 1.5 m, wanted more than the floor's 3 m", |o| {
                let (x_m, y_m) = ([0.1, 0.3], [-1.0, 1.0]);
                o.floor.steps =
                    vec![noctograph_sim::vehicle::FloorStep { x_m, y_m, height_m: 3.0 }];
            }),
            ("controller.altitude.error_m", |o| o.controller.altitude.error_m = 0.0),
        ];
        for (want, change) in cases {
            let mut options = Scene::preset(Preset::Bzzz).sim();
            change(&mut options);
            let refused = hold(HoldModel::Full, &options, HoldScenario::Calm, 2.0, 0).unwrap_err();
            assert!(refused.to_string().starts_with(want), "{refused}");
        }
    }
}
