//! The six-state Kalman filter, and its test for steps of the floor.

use nalgebra::{Matrix6, SVector, Vector6};

use super::step_test::{Floor, StepTest};
use crate::control::{Innovation, Kalman};
use crate::sim::controller::ThrustMap;
use crate::sim::options::AltitudeOptions;
use crate::sim::vehicle::GRAVITY_M_S2;

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
    /// Infrared time of flight to the floor: altitude and bias of the ranger.
    TimeOfFlight,
    /// Air pressure: altitude and bias of the barometer.
    Barometer,
}

/// Standard deviation of altitude and velocity, and of the floor, on the ground: m, m/s and m.
const START_SIGMA: [f64; 3] = [0.05, 0.05, 0.02];

/// A reading against its prediction.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// What measured it.
    pub sensor: Sensor,
    /// What it measured.
    pub measured_m: f64,
    /// Its innovation.
    pub innovation: Innovation,
    /// Whether the filter took it in.
    pub taken: bool,
}

/// Estimates altitude, velocity, thrust map and biases.
#[derive(Clone, Debug)]
pub struct AltitudeFilter {
    options: AltitudeOptions,
    kalman: Kalman<6>,
    /// Readings since the last prediction.
    readings: Vec<Measurement>,
    test: StepTest,
    steps: u32,
}

impl AltitudeFilter {
    /// The filter of a drone at rest at a known altitude.
    ///
    /// α⁰ and α¹ begin tied together by the believed hover throttle.
    #[must_use]
    pub fn new(options: &AltitudeOptions, hover: f64, altitude_m: f64) -> Self {
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
        let test = StepTest::new(options.step_gate_sigmas, 0.0);
        Self { options: options.clone(), kalman, readings: Vec::new(), test, steps: 0 }
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
        self.readings.clear();
    }

    /// Propagates the estimate over a span in which the drone stood with its motors off.
    pub fn rest(&mut self, span_s: f64) {
        let velocity = State::Velocity as usize;
        let Kalman { state, covariance } = &mut self.kalman;
        state[velocity] = 0.0;
        covariance.row_mut(velocity).fill(0.0);
        covariance.column_mut(velocity).fill(0.0);
        covariance[(velocity, velocity)] = START_SIGMA[1] * START_SIGMA[1];
        for (bias, walk) in [
            (State::Ranger, self.options.ranger_walk_m_sqrt_s),
            (State::Barometer, self.options.barometer_walk_m_sqrt_s),
        ] {
            covariance[(bias as usize, bias as usize)] += walk * walk * span_s;
        }
        self.readings.clear();
    }

    /// Takes a reading in.
    ///
    /// A range beyond the gate is not taken in; the second in a row moves the ranger's bias by the
    /// mean of their innovations and widens it.
    pub fn update(&mut self, sensor: Sensor, measured_m: f64) {
        let (h, sigma_m) = match sensor {
            Sensor::Gnss => (row(None), self.options.gnss_sigma_m),
            Sensor::TimeOfFlight => (row(Some(State::Ranger)), self.options.time_of_flight_sigma_m),
            Sensor::Barometer => (row(Some(State::Barometer)), self.options.barometer_sigma_m),
        };
        let variance = sigma_m * sigma_m;
        let innovation = self.kalman.innovation(&h, measured_m, variance);
        let floor = match sensor {
            Sensor::TimeOfFlight => self.test.look(&innovation),
            Sensor::Gnss | Sensor::Barometer => Floor::Still,
        };
        match floor {
            Floor::Still => _ = self.kalman.update(&h, measured_m, variance),
            Floor::Open => {}
            Floor::Stepped(farther_m) => self.step(farther_m),
        }
        let taken = floor == Floor::Still;
        self.readings.push(Measurement { sensor, measured_m, innovation, taken });
    }

    /// Moves the ranger's bias and widens it.
    fn step(&mut self, farther_m: f64) {
        let bias = State::Ranger as usize;
        self.kalman.state[bias] += farther_m;
        self.kalman.covariance[(bias, bias)] +=
            self.options.step_sigma_m * self.options.step_sigma_m;
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

    /// The estimated thrust map.
    pub(in crate::sim) fn thrust_map(&self) -> ThrustMap {
        let [offset_m_s2, gain_m_s2] = [State::Offset, State::Gain].map(|s| self.estimate(s));
        ThrustMap { offset_m_s2, gain_m_s2 }
    }

    /// Readings since the last prediction, in the order in which they came.
    #[must_use]
    pub fn readings(&self) -> &[Measurement] {
        &self.readings
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
