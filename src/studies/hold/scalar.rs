//! Altitude hold in a scalar model.
//!
//! The true motion is `z̈ = α⁰ + α¹ τ + gust`, delayed by the motor lag, and is simulated at 100
//! Hz. Sensors, filter and controller run at 10 Hz, as in the lab sheet.

use super::scenario::{DRONE, GAIN_SPREAD, GUST, HoldScenario, OFFSET_SPREAD_M_S2};
use super::{Hold, HoldSample, SAMPLES_HZ, SET_M};
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::error::Result;
use noctograph_core::random::Noise;
use noctograph_sim::sensors::{Positioning, SensorOptions};
use noctograph_sim::{AltitudeFilter, AltitudeSensor, AltitudeState, SimOptions, altitude_gains};

/// Rate of the simulation steps.
const TRUTH_HZ: u32 = 100;
/// Standard deviation of the barometer's initial bias, m.
const BAROMETER_BIAS_M: f64 = 0.3;

/// Flies a scenario in the scalar model of vertical motion, as described at [`super::hold()`].
/// Returns an error if the options give no altitude controller.
pub(super) fn hold(
    options: &SimOptions,
    scenario: HoldScenario,
    duration_s: f64,
    seed: u64,
) -> Result<Hold> {
    let hover = options.believed_hover_throttle();
    let [k_z, k_v] = altitude_gains(&options.controller.altitude)?;
    let mut truth = Truth::new(options, scenario, seed);
    let mut sensors = AltitudeSensor::ALL.map(|s| (s, Noise::new(seed, 0, &format!("hold {s:?}"))));
    let gnss = &options.sensors.gnss;
    let mut filter = AltitudeFilter::new(&options.observer.altitude, hover, SET_M);
    let (mut throttle, mut samples) = (hover, Vec::new());
    #[expect(clippy::cast_possible_truncation, reason = "at most an hour")]
    let n_ticks = (duration_s * f64::from(TRUTH_HZ)).round() as u32;
    for tick in 0..=n_ticks {
        let time_s = f64::from(tick) / f64::from(TRUTH_HZ);
        if tick.is_multiple_of(TRUTH_HZ / SAMPLES_HZ) {
            // The time update is followed by a measurement update for each available sensor.
            if tick > 0 {
                filter.predict(throttle, 1.0 / f64::from(SAMPLES_HZ));
            }
            let has_gnss = scenario.hears_gnss(time_s) && !gnss.is_silent(time_s);
            for (sensor, noise) in &mut sensors {
                let error = noise.normal();
                let is_available = *sensor != AltitudeSensor::Gnss || has_gnss;
                if is_available && carries(&options.sensors, *sensor) {
                    filter.update(*sensor, truth.measured_m(*sensor, time_s, error));
                }
            }
            // The throttle is computed by feedback of the estimated state.
            let [z, v] = [AltitudeState::Altitude, AltitudeState::Velocity]
                .map(|state| filter.estimate(state));
            throttle = filter.thrust_map().throttle(-k_z * (z - SET_M) - k_v * v);
            let (states, readings) = (truth.states(time_s), filter.readings().to_vec());
            samples.push(HoldSample::new(time_s, states, &filter, throttle, readings));
        }
        truth.step(throttle, time_s);
    }
    Ok(Hold { set_m: SET_M, samples, steps: filter.steps() })
}

/// Returns true if the drone carries the sensor.
fn carries(sensors: &SensorOptions, sensor: AltitudeSensor) -> bool {
    match sensor {
        AltitudeSensor::Gnss => sensors.positioning == Positioning::Gnss,
        AltitudeSensor::TimeOfFlight | AltitudeSensor::Barometer => {
            sensors.heights.iter().any(|height| AltitudeSensor::from_height(*height) == sensor)
        }
    }
}

/// The true state of the drone and the biases of its sensors.
#[derive(Debug)]
struct Truth<'a> {
    options: &'a SimOptions,
    scenario: HoldScenario,
    altitude_m: f64,
    velocity_m_s: f64,
    throttle: f64,
    gust_m_s2: f64,
    /// True α⁰.
    offset_m_s2: f64,
    /// True α¹ of the full battery.
    full_gain_m_s2: f64,
    barometer_m: f64,
    gusts: Noise,
    pressure: Noise,
}

impl<'a> Truth<'a> {
    /// Creates the drone at rest at the set altitude. Its gain, offset and barometer bias are drawn
    /// from the seed.
    fn new(options: &'a SimOptions, scenario: HoldScenario, seed: u64) -> Self {
        // The full simulator uses the same random stream, so that both models fly the same drone.
        let mut drawn = Noise::new(seed, 0, DRONE);
        let hover = options.vehicle.hover_throttle();
        Self {
            options,
            scenario,
            altitude_m: SET_M,
            velocity_m_s: 0.0,
            throttle: hover,
            gust_m_s2: 0.0,
            full_gain_m_s2: GRAVITY_M_S2 / hover * (1.0 + GAIN_SPREAD * drawn.normal()),
            offset_m_s2: -GRAVITY_M_S2 + OFFSET_SPREAD_M_S2 * drawn.normal(),
            barometer_m: BAROMETER_BIAS_M * drawn.normal(),
            gusts: Noise::new(seed, 0, "hold gusts"),
            pressure: Noise::new(seed, 0, "hold pressure"),
        }
    }

    /// Returns α¹ at `time_s`, which falls as the battery discharges.
    fn gain(&self, time_s: f64) -> f64 {
        self.full_gain_m_s2 * self.scenario.lift_frac(time_s)
    }

    /// Returns the true values of the altitude filter's states, in the order and the units of
    /// [`AltitudeState`].
    fn states(&self, time_s: f64) -> [f64; 6] {
        let drift_m_s = self.options.sensors.barometer.drift_m_s + self.scenario.drift_m_s();
        let barometer_m = self.barometer_m + drift_m_s * time_s;
        let (gain, floor_m) = (self.gain(time_s), self.scenario.floor_m(time_s));
        [self.altitude_m, self.velocity_m_s, self.offset_m_s2, gain, -floor_m, barometer_m]
    }

    /// Returns a sensor's reading in m, relative to the sensor's own reference. `error` is its
    /// random error in standard deviations.
    fn measured_m(&self, sensor: AltitudeSensor, time_s: f64, error: f64) -> f64 {
        let [z, _, _, _, ranger_m, barometer_m] = self.states(time_s);
        let sensors = &self.options.sensors;
        z + match sensor {
            AltitudeSensor::Gnss => error * sensors.gnss.noise_m,
            AltitudeSensor::TimeOfFlight => ranger_m + error * sensors.time_of_flight.noise_m,
            AltitudeSensor::Barometer => barometer_m + error * sensors.barometer.noise_m,
        }
    }

    /// Advances the vertical motion by one time step of the truth, at `time_s` of the flight.
    /// `throttle` is the commanded fraction of full thrust.
    fn step(&mut self, throttle: f64, time_s: f64) {
        let (dt, vehicle) = (1.0 / f64::from(TRUTH_HZ), &self.options.vehicle);
        // Without a motor lag, the quotient is infinite, and the throttle is that of the command.
        let lag_s = 0.5 * (vehicle.motor_rise_s + vehicle.motor_fall_s);
        self.throttle += (throttle - self.throttle) * (dt / lag_s).min(1.0);
        // The gusts are an Ornstein–Uhlenbeck process, and the barometer's bias is a random walk.
        let [sigma, correlation_s] = GUST;
        self.gust_m_s2 += -self.gust_m_s2 * dt / correlation_s
            + sigma * (2.0 * dt / correlation_s).sqrt() * self.gusts.normal();
        let walk_m_sqrt_s = self.options.sensors.barometer.drift_m_sqrt_s;
        self.barometer_m += walk_m_sqrt_s * dt.sqrt() * self.pressure.normal();
        let a = self.gain(time_s) * self.throttle + self.offset_m_s2 + self.gust_m_s2;
        self.altitude_m += self.velocity_m_s * dt + 0.5 * a * dt * dt;
        self.velocity_m_s += a * dt;
    }
}
