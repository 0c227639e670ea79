//! The six-state Kalman filter, and its test for steps of the floor.

use nalgebra::{Matrix6, SVector, Vector6};

use crate::control::{Innovation, Kalman};
use crate::settings::settings;

/// Gravitational acceleration, m/s².
const GRAVITY_M_S2: f64 = 9.81;

/// Index of each state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Altitude z, m.
    Altitude,
    /// Vertical velocity v, m/s.
    Velocity,
    /// α⁰: vertical acceleration at no throttle, m/s².
    Offset,
    /// α¹: vertical acceleration per throttle, m/s².
    Gain,
    /// Bias of the ranger, m: the negative height of the floor below the drone.
    Ranger,
    /// Bias of the barometer, m.
    Barometer,
}

/// What measures the altitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensor {
    /// Satellites: z.
    Gnss,
    /// Infrared time of flight to the floor: z + d_tof.
    TimeOfFlight,
    /// Air pressure: z + d_bar.
    Barometer,
}

settings! {
    /// Covariances of the altitude filter. Random walks are per root of a second.
    pub struct AltitudeOptions {
        /// Standard deviation of a satellite altitude.
        gnss_sigma_m: f64 = 0.05, in 0.001..=10.0;
        /// Standard deviation of a range to the floor.
        time_of_flight_sigma_m: f64 = 0.06, in 0.001..=10.0;
        /// Standard deviation of a barometric altitude.
        barometer_sigma_m: f64 = 0.25, in 0.001..=10.0;
        /// Noise density of the vertical acceleration, (m/s²)/√Hz.
        ///
        /// Gusts of 0.15 m/s² correlated over 2 s have 0.3 at low frequency and less above; at 0.2
        /// the innovations of the satellites have 0.88 of their expected variance.
        acceleration_noise_m_s2_sqrt_hz: f64 = 0.2, in 0.0001..=100.0;
        /// Random walk of α⁰: mass and lift at no throttle hardly change.
        offset_walk_m_s2_sqrt_s: f64 = 0.005, in 0.0..=100.0;
        /// Random walk of α¹.
        ///
        /// A battery that loses 25 % of its lift in a minute takes 0.13 m/s² a second from α¹; a walk
        /// of 0.06 lets the drone sink by 21 cm meanwhile.
        gain_walk_m_s2_sqrt_s: f64 = 0.8, in 0.0..=100.0;
        /// Random walk of the floor: flat between steps, which the step test finds.
        ranger_walk_m_sqrt_s: f64 = 0.003, in 0.0..=10.0;
        /// Random walk of the barometer's bias: a draft or a weather front, 2 cm/s at most.
        barometer_walk_m_sqrt_s: f64 = 0.05, in 0.0..=10.0;
        /// Innovation of the ranger beyond which a range is not taken in, in standard deviations; two
        /// in a row are a step of the floor.
        step_gate_sigmas: f64 = 4.0, in 1.0..=100.0;
        /// Standard deviation that a step adds to the ranger's bias.
        step_sigma_m: f64 = 0.5, in 0.01..=10.0;
        /// Hover throttle that is believed before the flight.
        hover_throttle: f64 = 0.32, in 0.01..=0.99;
        /// Its standard deviation.
        hover_throttle_sigma: f64 = 0.03, in 0.0001..=0.5;
        /// Standard deviation of α¹ before the flight.
        gain_sigma_m_s2: f64 = 3.0, in 0.01..=100.0;
        /// Standard deviation of the barometer's bias before the flight.
        barometer_bias_sigma_m: f64 = 0.5, in 0.001..=100.0;
    }
}

/// Consecutive ranges beyond the gate that are a step of the floor.
const STEP_READINGS: usize = 2;
/// Standard deviation of altitude and velocity, and of the floor, on the ground: m, m/s and m.
const START_SIGMA: [f64; 3] = [0.05, 0.05, 0.02];

/// Estimates altitude, velocity, thrust map and biases.
#[derive(Clone, Debug)]
pub struct AltitudeFilter {
    options: AltitudeOptions,
    kalman: Kalman<6>,
    /// Innovations of the ranges beyond the gate, since the last one within.
    beyond_m: Vec<f64>,
    steps: u32,
}

impl AltitudeFilter {
    /// The filter of a drone at rest at a known altitude.
    ///
    /// α⁰ and α¹ begin tied together by the hover throttle.
    #[must_use]
    pub fn new(options: &AltitudeOptions, altitude_m: f64) -> Self {
        let hover = options.hover_throttle;
        let gain = GRAVITY_M_S2 / hover;
        let mut covariance = Matrix6::zeros();
        let [altitude, velocity, floor] = START_SIGMA.map(|sigma| sigma * sigma);
        let gain_variance = options.gain_sigma_m_s2 * options.gain_sigma_m_s2;
        let of_hover = options.hover_throttle_sigma * gain;
        covariance[(0, 0)] = altitude;
        covariance[(1, 1)] = velocity;
        covariance[(2, 2)] = hover * hover * gain_variance + of_hover * of_hover;
        covariance[(2, 3)] = -hover * gain_variance;
        covariance[(3, 2)] = covariance[(2, 3)];
        covariance[(3, 3)] = gain_variance;
        covariance[(4, 4)] = floor;
        covariance[(5, 5)] = options.barometer_bias_sigma_m * options.barometer_bias_sigma_m;
        let state = Vector6::new(altitude_m, 0.0, -GRAVITY_M_S2, gain, 0.0, 0.0);
        let kalman = Kalman { state, covariance };
        Self { options: options.clone(), kalman, beyond_m: Vec::new(), steps: 0 }
    }

    /// Propagates the estimate over a span in which a throttle, 0 to 1, was held.
    pub fn predict(&mut self, throttle: f64, span_s: f64) {
        let (t, o) = (span_s, &self.options);
        let mut transition = Matrix6::identity();
        transition[(0, 1)] = t;
        transition[(0, 2)] = 0.5 * t * t;
        transition[(0, 3)] = 0.5 * t * t * throttle;
        transition[(1, 2)] = t;
        transition[(1, 3)] = t * throttle;
        let density = o.acceleration_noise_m_s2_sqrt_hz * o.acceleration_noise_m_s2_sqrt_hz;
        let walk = |per_sqrt_s: f64| per_sqrt_s * per_sqrt_s * t;
        let mut noise = Matrix6::from_diagonal(&Vector6::new(
            density * t * t * t / 3.0,
            density * t,
            walk(o.offset_walk_m_s2_sqrt_s),
            walk(o.gain_walk_m_s2_sqrt_s),
            walk(o.ranger_walk_m_sqrt_s),
            walk(o.barometer_walk_m_sqrt_s),
        ));
        noise[(0, 1)] = density * t * t / 2.0;
        noise[(1, 0)] = noise[(0, 1)];
        self.kalman.predict(&transition, &noise);
    }

    /// Takes a reading in; returns its innovation, and whether it was taken in.
    ///
    /// A range beyond the gate is not taken in; the second in a row moves the ranger's bias by the
    /// mean of their innovations and widens it.
    pub fn update(&mut self, sensor: Sensor, measured_m: f64) -> (Innovation, bool) {
        let (h, sigma_m) = match sensor {
            Sensor::Gnss => (row(None), self.options.gnss_sigma_m),
            Sensor::TimeOfFlight => (row(Some(State::Ranger)), self.options.time_of_flight_sigma_m),
            Sensor::Barometer => (row(Some(State::Barometer)), self.options.barometer_sigma_m),
        };
        let variance = sigma_m * sigma_m;
        let innovation = self.kalman.innovation(&h, measured_m, variance);
        if sensor == Sensor::TimeOfFlight {
            if innovation.sigmas() > self.options.step_gate_sigmas {
                self.beyond_gate(innovation.value);
                return (innovation, false);
            }
            self.beyond_m.clear();
        }
        (self.kalman.update(&h, measured_m, variance), true)
    }

    fn beyond_gate(&mut self, innovation_m: f64) {
        self.beyond_m.push(innovation_m);
        if self.beyond_m.len() < STEP_READINGS {
            return;
        }
        #[expect(clippy::cast_precision_loss, reason = "two")]
        let mean_m = self.beyond_m.iter().sum::<f64>() / self.beyond_m.len() as f64;
        let bias = State::Ranger as usize;
        self.kalman.state[bias] += mean_m;
        self.kalman.covariance[(bias, bias)] +=
            self.options.step_sigma_m * self.options.step_sigma_m;
        self.beyond_m.clear();
        self.steps += 1;
    }

    /// Estimate of a state.
    #[must_use]
    pub fn estimate(&self, state: State) -> f64 {
        self.kalman.state[state as usize]
    }

    /// Standard deviation of a state.
    #[must_use]
    pub fn sigma(&self, state: State) -> f64 {
        self.kalman.sigma(state as usize)
    }

    /// Throttle −α⁰/α¹ that carries the drone's weight.
    #[must_use]
    pub fn hover_throttle(&self) -> f64 {
        -self.estimate(State::Offset) / self.estimate(State::Gain)
    }

    /// Throttle, 0 to 1, for a vertical acceleration.
    #[must_use]
    pub fn throttle(&self, acceleration_m_s2: f64) -> f64 {
        // A gain near zero or below would turn the loop around; no drone flies with it.
        let gain = self.estimate(State::Gain).max(1.0);
        ((acceleration_m_s2 - self.estimate(State::Offset)) / gain).clamp(0.0, 1.0)
    }

    /// Steps of the floor that were found so far.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.steps
    }
}

/// What a sensor sees of the state: the altitude, and a bias.
fn row(bias: Option<State>) -> SVector<f64, 6> {
    let mut row = Vector6::x();
    if let Some(bias) = bias {
        row[bias as usize] = 1.0;
    }
    row
}
