//! A scalar drone that holds its altitude on the filter's estimates.
//!
//! Truth: `z̈ = α⁰ + α¹ τ + gust`, with a lag of the motors, at 100 Hz. Sensors, filter and
//! controller run at 10 Hz, as the lab sheet asks: the throttle is
//! `τ = (a − α⁰)/α¹` with `a = −k_z (z − z_ref) − k_v v`, all from the estimate.

use nalgebra::{Matrix1, Matrix2, Vector2};

use super::filter::{AltitudeFilter, AltitudeOptions, Sensor, State};
use crate::control::{Innovation, lqr};
use crate::error::Result;
use crate::settings::settings;
use crate::sim::noise::Noise;

/// Steps of the truth per second.
const TRUTH_HZ: f64 = 100.0;
/// Steps of the truth per step of the filter.
const TICKS_PER_UPDATE: u32 = 10;
/// Time constant of the motors, s (preset `bzzz`).
const MOTOR_LAG_S: f64 = 0.05;
/// Gusts: standard deviation, m/s², and correlation time, s.
const GUST: [f64; 2] = [0.15, 2.0];
/// Spread of the true α¹ (share) and α⁰ (m/s²) about what the filter believes before the flight.
const THRUST_SPREAD: [f64; 2] = [0.05, 0.1];
/// Spread of the barometer's bias at the start, m, and its random walk, m/√s.
const BAROMETER: [f64; 2] = [0.3, 0.012];

settings! {
    /// Events of a flight at constant altitude.
    pub enum Scenario {
        /// Nothing happens.
        "calm" => Calm,
        /// A table of 0.5 m is below the drone from 20 s to 40 s.
        "step" => Step,
        /// The satellites are silent from 20 s to 30 s.
        "silent" => Silent,
        /// The battery loses a quarter of its lift in 60 s.
        "drain" => Drain,
        /// Air pressure drifts by 2 cm/s.
        "drift" => Drift,
        /// Step and silence together: the barometer alone must find the step.
        "step-silent" => StepSilent,
    }
}

impl Scenario {
    /// Whether a table is below the flight.
    #[must_use]
    pub fn has_step(self) -> bool {
        matches!(self, Self::Step | Self::StepSilent)
    }

    /// Height of the floor at a time, m.
    #[must_use]
    pub fn floor_m(self, time_s: f64) -> f64 {
        if self.has_step() && (20.0..40.0).contains(&time_s) { 0.5 } else { 0.0 }
    }

    /// Whether the floor steps within a span of a time.
    #[must_use]
    pub fn is_event(self, time_s: f64, span_s: f64) -> bool {
        self.has_step() && [20.0, 40.0].iter().any(|step_s| (time_s - step_s).abs() <= span_s)
    }

    /// Whether the satellites are heard at a time.
    #[must_use]
    pub fn hears_gnss(self, time_s: f64) -> bool {
        let silent = matches!(self, Self::Silent | Self::StepSilent);
        !(silent && (20.0..30.0).contains(&time_s))
    }

    /// Share of the full lift that the battery gives at a time.
    #[must_use]
    pub fn lift_frac(self, time_s: f64) -> f64 {
        if self == Self::Drain { 1.0 - 0.25 * time_s / 60.0 } else { 1.0 }
    }

    /// Drift of the barometer at a time, m.
    #[must_use]
    pub fn drift_m(self, time_s: f64) -> f64 {
        if self == Self::Drift { 0.02 * time_s } else { 0.0 }
    }
}

/// A flight at constant altitude.
#[derive(Clone, Debug)]
pub struct Hold {
    /// One sample for each step of the filter.
    pub samples: Vec<HoldSample>,
    /// Steps of the floor that the filter found.
    pub steps: u32,
}

/// Truth, estimate and readings at one step of the filter.
#[derive(Clone, Debug)]
pub struct HoldSample {
    /// Time since the start.
    pub time_s: f64,
    /// True states, in the order of [`State`].
    pub truth: [f64; 6],
    /// Estimated states.
    pub estimate: [f64; 6],
    /// Standard deviations of the estimates.
    pub sigma: [f64; 6],
    /// Throttle that is commanded from now on.
    pub throttle: f64,
    /// True hover throttle.
    pub hover_throttle: f64,
    /// Readings of the step.
    pub readings: Vec<Measurement>,
}

/// A reading against its prediction.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// What measured it.
    pub sensor: Sensor,
    /// Its innovation.
    pub innovation: Innovation,
    /// Whether the filter took it in.
    pub taken: bool,
}

/// All states, in order.
const STATES: [State; 6] =
    [State::Altitude, State::Velocity, State::Offset, State::Gain, State::Ranger, State::Barometer];

/// Gains of altitude (1/s²) and velocity (1/s): the linear-quadratic regulator of a double integrator
/// that weighs 0.2 m, 1 m/s and 1.6 m/s² alike.
///
/// # Errors
///
/// None that the fixed weights can meet.
fn gains() -> Result<[f64; 2]> {
    let a = Matrix2::new(0.0, 1.0, 0.0, 0.0);
    let b = Vector2::new(0.0, 1.0);
    let weigh = |scale: f64| 1.0 / (scale * scale);
    let q = Matrix2::from_diagonal(&Vector2::new(weigh(0.2), weigh(1.0)));
    let k = lqr(&a, &b, &q, &Matrix1::new(weigh(1.6)))?;
    Ok([k[0], k[1]])
}

/// Holds an altitude for a time through a scenario, with the noise of a seed.
///
/// # Errors
///
/// [`crate::error::Error::Input`] for options out of range.
pub fn hold(
    options: &AltitudeOptions,
    scenario: Scenario,
    duration_s: f64,
    seed: u64,
) -> Result<Hold> {
    use crate::settings::Described;
    Described::check(options, "altitude", None)?;
    let [k_z, k_v] = gains()?;
    let noise = |name: &str| Noise::new(seed, 0, name);
    let mut truth = Truth::new(options, scenario, noise);
    let mut sensors = [Sensor::Gnss, Sensor::TimeOfFlight, Sensor::Barometer]
        .map(|sensor| (sensor, noise(&format!("hold {sensor:?}"))));
    let mut filter = AltitudeFilter::new(options, 0.0);
    let (mut throttle, mut samples) = (options.hover_throttle, Vec::new());
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked below")]
    let n_ticks = (duration_s.clamp(0.0, 3600.0) * TRUTH_HZ).round() as u32;
    for tick in 0..=n_ticks {
        let time_s = f64::from(tick) / TRUTH_HZ;
        if tick.is_multiple_of(TICKS_PER_UPDATE) {
            if tick > 0 {
                filter.predict(throttle, f64::from(TICKS_PER_UPDATE) / TRUTH_HZ);
            }
            let mut readings = Vec::new();
            for (sensor, noise) in &mut sensors {
                let error = noise.normal();
                if *sensor == Sensor::Gnss && !scenario.hears_gnss(time_s) {
                    continue;
                }
                let measured_m = truth.measured_m(*sensor, time_s, error, options);
                let (innovation, taken) = filter.update(*sensor, measured_m);
                readings.push(Measurement { sensor: *sensor, innovation, taken });
            }
            let [z, v] = [State::Altitude, State::Velocity].map(|state| filter.estimate(state));
            throttle = filter.throttle(-k_z * z - k_v * v);
            samples.push(HoldSample {
                time_s,
                truth: truth.states(time_s),
                estimate: STATES.map(|state| filter.estimate(state)),
                sigma: STATES.map(|state| filter.sigma(state)),
                throttle,
                hover_throttle: -truth.offset / truth.gain(time_s),
                readings,
            });
        }
        truth.step(throttle, time_s);
    }
    Ok(Hold { samples, steps: filter.steps() })
}

/// The drone as it is.
#[derive(Debug)]
struct Truth {
    scenario: Scenario,
    altitude_m: f64,
    velocity_m_s: f64,
    throttle: f64,
    gust_m_s2: f64,
    offset: f64,
    full_gain: f64,
    barometer_m: f64,
    gusts: Noise,
    pressure: Noise,
}

impl Truth {
    fn new(options: &AltitudeOptions, scenario: Scenario, noise: impl Fn(&str) -> Noise) -> Self {
        let mut drawn = noise("hold drone");
        let [gain_spread, offset_spread] = THRUST_SPREAD;
        let gain = 9.81 / options.hover_throttle * (1.0 + gain_spread * drawn.normal());
        Self {
            scenario,
            altitude_m: 0.0,
            velocity_m_s: 0.0,
            throttle: options.hover_throttle,
            gust_m_s2: 0.0,
            offset: -9.81 + offset_spread * drawn.normal(),
            full_gain: gain,
            barometer_m: BAROMETER[0] * drawn.normal(),
            gusts: noise("hold gusts"),
            pressure: noise("hold pressure"),
        }
    }

    fn gain(&self, time_s: f64) -> f64 {
        self.full_gain * self.scenario.lift_frac(time_s)
    }

    fn states(&self, time_s: f64) -> [f64; 6] {
        let floor_m = self.scenario.floor_m(time_s);
        let barometer_m = self.barometer_m + self.scenario.drift_m(time_s);
        let (z, v) = (self.altitude_m, self.velocity_m_s);
        [z, v, self.offset, self.gain(time_s), -floor_m, barometer_m]
    }

    fn measured_m(
        &self,
        sensor: Sensor,
        time_s: f64,
        error: f64,
        options: &AltitudeOptions,
    ) -> f64 {
        let [z, _, _, _, ranger_m, barometer_m] = self.states(time_s);
        z + match sensor {
            Sensor::Gnss => error * options.gnss_sigma_m,
            Sensor::TimeOfFlight => ranger_m + error * options.time_of_flight_sigma_m,
            Sensor::Barometer => barometer_m + error * options.barometer_sigma_m,
        }
    }

    fn step(&mut self, throttle: f64, time_s: f64) {
        let dt = 1.0 / TRUTH_HZ;
        self.throttle += (throttle - self.throttle) * dt / MOTOR_LAG_S;
        let [sigma, correlation_s] = GUST;
        self.gust_m_s2 += -self.gust_m_s2 * dt / correlation_s
            + sigma * (2.0 * dt / correlation_s).sqrt() * self.gusts.normal();
        self.barometer_m += BAROMETER[1] * dt.sqrt() * self.pressure.normal();
        let a = self.gain(time_s) * self.throttle + self.offset + self.gust_m_s2;
        self.altitude_m += self.velocity_m_s * dt + 0.5 * a * dt * dt;
        self.velocity_m_s += a * dt;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean figures over runs, from 5 s on.
    #[derive(Debug, Default)]
    struct Figures {
        estimate_m: f64,
        hold_m: f64,
        inside: f64,
        hover: f64,
        nis: [f64; 3],
        steps: f64,
    }

    fn figures(scenario: Scenario, runs: u32) -> Figures {
        let mut sum = Figures::default();
        let (mut n, mut counted) = (0.0, [0.0; 3]);
        for seed in 0..u64::from(runs) {
            let flight = hold(&AltitudeOptions::default(), scenario, 60.0, seed).unwrap();
            sum.steps += f64::from(flight.steps) / f64::from(runs);
            for s in flight.samples.iter().filter(|s| s.time_s >= 5.0) {
                let error_m = s.estimate[0] - s.truth[0];
                n += 1.0;
                sum.estimate_m += error_m * error_m;
                sum.hold_m += s.truth[0] * s.truth[0];
                sum.inside += f64::from(u8::from(error_m.abs() < 1.96 * s.sigma[0]));
                let hover = -s.estimate[2] / s.estimate[3] - s.hover_throttle;
                sum.hover += hover * hover;
                for reading in s.readings.iter().filter(|r| r.taken) {
                    sum.nis[reading.sensor as usize] += reading.innovation.nis();
                    counted[reading.sensor as usize] += 1.0;
                }
            }
        }
        let root = |x: f64| (x / n).sqrt();
        Figures {
            estimate_m: root(sum.estimate_m),
            hold_m: root(sum.hold_m),
            inside: sum.inside / n,
            hover: root(sum.hover),
            nis: std::array::from_fn(|i| sum.nis[i] / counted[i]),
            steps: sum.steps,
        }
    }

    #[test]
    fn every_scenario_is_estimated_and_held_as_well_as_stated() {
        // Bounds of estimate and hold, m, and of the hover throttle.
        let cases = [
            (Scenario::Calm, 0.027, 0.055, 0.006, 0.0),
            (Scenario::Step, 0.028, 0.056, 0.006, 2.0),
            (Scenario::Silent, 0.038, 0.070, 0.006, 0.0),
            (Scenario::Drain, 0.027, 0.068, 0.007, 0.0),
            (Scenario::Drift, 0.027, 0.056, 0.006, 0.0),
        ];
        for (scenario, estimate_m, hold_m, hover, steps) in cases {
            let found = figures(scenario, 80);
            eprintln!("{}: {found:?}", scenario.name());
            assert!(found.estimate_m <= estimate_m && found.hold_m <= hold_m, "{found:?}");
            assert!((0.94..=0.98).contains(&found.inside), "{scenario:?}: {found:?}");
            assert!(found.nis.iter().all(|nis| (0.8..=1.15).contains(nis)), "{found:?}");
            assert!((found.steps - steps).abs() <= 0.1, "{scenario:?}: {found:?}");
            assert!(found.hover <= hover, "{scenario:?}: {found:?}");
        }
    }

    #[test]
    fn without_the_step_test_a_table_moves_the_drone() {
        let blind = AltitudeOptions { step_gate_sigmas: 100.0, ..AltitudeOptions::default() };
        let rms_m = |options: &AltitudeOptions| {
            let flight = hold(options, Scenario::Step, 60.0, 1).unwrap();
            let square = |s: &HoldSample| s.truth[0] * s.truth[0];
            (flight.samples.iter().map(square).sum::<f64>() / flight.samples.len() as f64).sqrt()
        };
        assert!(rms_m(&blind) > 2.0 * rms_m(&AltitudeOptions::default()));
    }

    #[test]
    fn uncertainty_grows_while_the_satellites_are_silent_and_is_back_within_a_second() {
        let flight = hold(&AltitudeOptions::default(), Scenario::Silent, 60.0, 3).unwrap();
        let sigma_m = |time_s: f64| {
            flight.samples.iter().find(|s| s.time_s >= time_s - 1e-9).map_or(0.0, |s| s.sigma[0])
        };
        // The ranger over a known floor bounds it.
        let silent_m = [20.0, 20.4, 21.0, 29.9].map(sigma_m);
        assert!(silent_m.is_sorted() && silent_m[3] > 1.4 * sigma_m(19.9), "{silent_m:?} m");
        assert!(sigma_m(31.0) < 1.05 * sigma_m(19.9), "{} m", sigma_m(31.0));
    }
}
