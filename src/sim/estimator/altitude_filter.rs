//! The Kalman filter of altitude, velocity, thrust map, biases and gusts, and its test for steps of the
//! floor.
//!
//! Gusts push for seconds. They are a state of their own, so that the innovations stay white: a
//! controller that answers a correlated innovation would make the throttle correlated with it, and
//! the filter would read a thrust map from that which is not there.

use nalgebra::{SMatrix, SVector};

use super::step_test::{Floor, StepTest};
use crate::control::{Innovation, Kalman};
use crate::sim::controller::ThrustMap;
use crate::sim::options::AltitudeOptions;
use crate::sim::vehicle::GRAVITY_M_S2;

/// Number of states.
const N: usize = 7;
/// Index of the vertical acceleration by gusts, which no table reports.
const GUST: usize = 6;

/// Index of each state that is reported.
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
    kalman: Kalman<N>,
    /// Readings since the last prediction.
    readings: Vec<Measurement>,
    test: StepTest,
    steps: u32,
}

impl AltitudeFilter {
    /// The filter of a drone at rest at a known altitude.
    ///
    /// α⁰ begins at gravity, and α¹ at what then gives the believed hover throttle.
    #[must_use]
    pub fn new(options: &AltitudeOptions, hover: f64, altitude_m: f64) -> Self {
        let gain = GRAVITY_M_S2 / hover;
        let mut covariance = SMatrix::<f64, N, N>::zeros();
        let [altitude, velocity, floor] = START_SIGMA.map(|sigma| sigma * sigma);
        let squared = |sigma: f64| sigma * sigma;
        covariance[(0, 0)] = altitude;
        covariance[(1, 1)] = velocity;
        covariance[(2, 2)] = squared(options.offset_sigma_m_s2);
        covariance[(3, 3)] = squared(options.gain_sigma_m_s2);
        covariance[(4, 4)] = floor;
        covariance[(5, 5)] = squared(options.barometer_bias_sigma_m);
        covariance[(GUST, GUST)] = squared(options.gust_sigma_m_s2);
        let state = SVector::from([altitude_m, 0.0, -GRAVITY_M_S2, gain, 0.0, 0.0, 0.0]);
        let kalman = Kalman { state, covariance };
        let test = StepTest::new(options.step_gate_sigmas, 0.0);
        Self { options: options.clone(), kalman, readings: Vec::new(), test, steps: 0 }
    }

    /// Propagates the estimate over a span in which a throttle, 0 to 1, was held.
    pub fn predict(&mut self, throttle: f64, span_s: f64) {
        let (t, o) = (span_s, &self.options);
        let kept = libm::exp(-t / o.gust_time_s);
        let mut transition = SMatrix::<f64, N, N>::identity();
        transition[(0, 1)] = t;
        for (state, slope) in [(2, 1.0), (3, throttle), (GUST, 1.0)] {
            transition[(0, state)] = 0.5 * t * t * slope;
            transition[(1, state)] = t * slope;
        }
        transition[(GUST, GUST)] = kept;
        let density = o.acceleration_noise_m_s2_sqrt_hz * o.acceleration_noise_m_s2_sqrt_hz;
        let walk = |per_sqrt_s: f64| per_sqrt_s * per_sqrt_s * t;
        let mut noise = SMatrix::<f64, N, N>::from_diagonal(&SVector::from([
            density * t * t * t / 3.0,
            density * t,
            walk(o.offset_walk_m_s2_sqrt_s),
            walk(o.gain_walk_m_s2_sqrt_s),
            walk(o.ranger_walk_m_sqrt_s),
            walk(o.barometer_walk_m_sqrt_s),
            (1.0 - kept * kept) * o.gust_sigma_m_s2 * o.gust_sigma_m_s2,
        ]));
        noise[(0, 1)] = density * t * t / 2.0;
        noise[(1, 0)] = noise[(0, 1)];
        self.kalman.predict(&transition, &noise);
        self.readings.clear();
    }

    /// Propagates the estimate over a span in which the drone stood with its motors off.
    pub fn rest(&mut self, span_s: f64) {
        let Kalman { state, covariance } = &mut self.kalman;
        let gust = self.options.gust_sigma_m_s2;
        for (still, sigma) in [(State::Velocity as usize, START_SIGMA[1]), (GUST, gust)] {
            state[still] = 0.0;
            covariance.row_mut(still).fill(0.0);
            covariance.column_mut(still).fill(0.0);
            covariance[(still, still)] = sigma * sigma;
        }
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

    /// The estimated thrust map, in the present gust.
    pub(in crate::sim) fn thrust_map(&self) -> ThrustMap {
        let [offset_m_s2, gain_m_s2] = [State::Offset, State::Gain].map(|s| self.estimate(s));
        ThrustMap { offset_m_s2: offset_m_s2 + self.kalman.state[GUST], gain_m_s2 }
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
fn row(bias: Option<State>) -> SVector<f64, N> {
    let mut row = SVector::zeros();
    row[State::Altitude as usize] = 1.0;
    if let Some(bias) = bias {
        row[bias as usize] = 1.0;
    }
    row
}
