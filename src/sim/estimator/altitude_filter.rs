//! Kalman filter of altitude, velocity, thrust map, biases and gusts.
//!
//! Gusts last for seconds. Because they are a state of the filter, the innovations are white.
//! Otherwise, the controller would respond to correlated innovations, and the filter would infer a
//! wrong thrust map from the correlation of the throttle with them.

use crate::controller::ThrustMap;
use crate::kalman::{Floor, Innovation, Measurement, Normal, Part, StepTest, variance_rate};
use crate::options::AltitudeOptions;
use crate::sensors::HeightSensor;
use noctograph_core::crazyflie::GRAVITY_M_S2;

/// Standard deviations in m of an altitude from satellites and of a range to the floor.
const GNSS_SIGMA_M: f64 = 0.05;
const TIME_OF_FLIGHT_SIGMA_M: f64 = 0.06;
/// Standard deviation in m/s² and correlation time in s of the vertical acceleration due to gusts,
/// which is a first-order Gauss-Markov process (Singer 1970), constant between predictions.
const GUST_SIGMA_M_S2: f64 = 0.15;
const GUST_TIME_S: f64 = 2.0;
/// Random walk of α⁰, which is small because mass and lift at zero throttle hardly change.
const OFFSET_WALK_M_S2_SQRT_S: f64 = 0.005;
/// Random walk of the floor's height, which is constant between steps.
const RANGER_WALK_M_SQRT_S: f64 = 0.003;
/// Random walk of the barometer's bias, which a draft or a weather front changes by at most 2 cm/s.
const BAROMETER_WALK_M_SQRT_S: f64 = 0.05;
/// Standard deviation in m that a step of the floor adds to the ranger's bias.
const STEP_SIGMA_M: f64 = 0.5;
/// Standard deviation of the barometer's bias before the flight in m.
const BAROMETER_BIAS_SIGMA_M: f64 = 0.5;

/// Index of the vertical acceleration due to gusts, which is not reported.
const GUST: usize = 6;

/// Index of each state that is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AltitudeState {
    /// Altitude z in m.
    Altitude,
    /// Vertical velocity v in m/s.
    Velocity,
    /// Vertical acceleration α⁰ in m/s² at zero throttle.
    Offset,
    /// Vertical acceleration α¹ in m/s² per unit throttle.
    Gain,
    /// Bias of the ranger in m, which is the negative height of the floor below the drone.
    Ranger,
    /// Bias of the barometer in m.
    Barometer,
}

/// Kinds of altitude sensors, distinguished by the biases that the filter estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AltitudeSensor {
    /// Satellite navigation, which measures z.
    Gnss,
    /// Vertical distance to the floor, which is the altitude plus the bias of the ranger.
    TimeOfFlight,
    /// Height above the start, which is the altitude plus the bias of the barometer.
    Barometer,
}

impl AltitudeSensor {
    /// All kinds of sensors.
    pub const ALL: [Self; 3] = [Self::Gnss, Self::TimeOfFlight, Self::Barometer];

    /// Returns the kind of a height sensor.
    pub fn from_height(sensor: HeightSensor) -> Self {
        if sensor.looks_down() { Self::TimeOfFlight } else { Self::Barometer }
    }
}

/// Initial standard deviations of altitude (m), velocity (m/s) and floor height (m).
const START_SIGMA: [f64; 3] = [0.05, 0.05, 0.02];

/// Reading with its prediction error.
#[derive(Clone, Copy, Debug)]
pub struct HeightReading {
    /// Sensor of the reading.
    pub sensor: AltitudeSensor,
    /// Measured value in m.
    pub measured_m: f64,
    /// Innovation of the reading.
    pub innovation: Innovation,
    /// True if the filter used the reading.
    pub taken: bool,
}

/// Filter that estimates altitude, velocity, thrust map and biases.
#[derive(Clone, Debug)]
pub struct AltitudeFilter {
    options: AltitudeOptions,
    normal: Normal,
    /// Readings since the last prediction.
    readings: Vec<HeightReading>,
    test: StepTest,
    steps: u32,
}

impl AltitudeFilter {
    /// Creates the filter for a drone at rest at a known altitude. `hover` is the throttle, 0 to 1,
    /// at which the drone hovers.
    ///
    /// α⁰ starts at −g, and α¹ at the value for which the drone hovers at the throttle `hover`.
    pub fn new(options: &AltitudeOptions, hover: f64, altitude_m: f64) -> Self {
        let [altitude, velocity, floor] = START_SIGMA;
        let mut normal = Normal::independent(&[
            altitude,
            velocity,
            options.offset_sigma_m_s2,
            options.gain_sigma_m_s2,
            floor,
            BAROMETER_BIAS_SIGMA_M,
            GUST_SIGMA_M_S2,
        ]);
        // The means of altitude, velocity, α⁰ and α¹ are set. Those of biases and gust are zero.
        let means = [altitude_m, 0.0, -GRAVITY_M_S2, GRAVITY_M_S2 / hover];
        normal.mean.rows_mut(0, means.len()).copy_from_slice(&means);
        let test = StepTest::new(options.step_gate_sigmas, 0.0, STEP_SIGMA_M);
        Self { options: options.clone(), normal, readings: Vec::new(), test, steps: 0 }
    }

    /// Propagates the estimate over a span in which the throttle, 0 to 1, was constant. Forgets the
    /// readings of the previous span.
    pub fn predict(&mut self, throttle: f64, span_s: f64) {
        // The entries (row, column, value) of Φ − 1, in the order of `AltitudeState`, follow from
        // z̈ = α⁰ + α¹ τ + gust, constant over the span. The gust decays toward zero.
        let t = span_s;
        let kept = libm::exp(-t / GUST_TIME_S);
        let half = 0.5 * t * t;
        let transition = [
            (0, 1, t),
            (0, 2, half),
            (0, 3, half * throttle),
            (0, GUST, half),
            (1, 2, t),
            (1, 3, t * throttle),
            (1, GUST, t),
            (GUST, GUST, kept - 1.0),
        ];
        // The noise consists of white acceleration noise, random walks of the thrust map and the
        // biases, and the noise that keeps the variance of the gust stationary.
        let density = variance_rate(self.options.acceleration_noise_m_s2_sqrt_hz);
        let walks = [
            OFFSET_WALK_M_S2_SQRT_S,
            self.options.gain_walk_m_s2_sqrt_s,
            RANGER_WALK_M_SQRT_S,
            BAROMETER_WALK_M_SQRT_S,
        ];
        let [offset, gain, ranger, barometer] = walks.map(|per_sqrt_s| per_sqrt_s * per_sqrt_s * t);
        let noise = [
            (0, 0, density * t * t * t / 3.0),
            (0, 1, density * t * t / 2.0),
            (1, 1, density * t),
            (2, 2, offset),
            (3, 3, gain),
            (4, 4, ranger),
            (5, 5, barometer),
            (GUST, GUST, (1.0 - kept * kept) * GUST_SIGMA_M_S2 * GUST_SIGMA_M_S2),
        ];
        self.normal.predict(&transition, &noise);
        self.readings.clear();
    }

    /// Propagates the estimate over a span on the floor with the motors off. Forgets the readings
    /// of the previous span.
    pub fn rest(&mut self, span_s: f64) {
        // Velocity and gust are reset, together with their correlations. Altitude and thrust map
        // are kept.
        let Normal { mean, covariance, .. } = &mut self.normal;
        let [_, velocity_sigma, _] = START_SIGMA;
        for (state, sigma) in
            [(AltitudeState::Velocity as usize, velocity_sigma), (GUST, GUST_SIGMA_M_S2)]
        {
            mean[state] = 0.0;
            covariance.row_mut(state).fill(0.0);
            covariance.column_mut(state).fill(0.0);
            covariance[(state, state)] = sigma * sigma;
        }
        for (bias, walk) in [
            (AltitudeState::Ranger, RANGER_WALK_M_SQRT_S),
            (AltitudeState::Barometer, BAROMETER_WALK_M_SQRT_S),
        ] {
            covariance[(bias as usize, bias as usize)] += walk * walk * span_s;
        }
        self.readings.clear();
    }

    /// Corrects the estimate with a reading of an altitude, or of a distance to the floor that has
    /// been corrected for the tilt. A range beyond the gate is rejected. After two rejected ranges
    /// in a row, the ranger's bias changes by the mean of their innovations, and its variance
    /// increases. The reading is listed with its innovation until the next span.
    pub fn update(&mut self, sensor: AltitudeSensor, measured_m: f64) {
        let [altitude, ranger, barometer] =
            [AltitudeState::Altitude, AltitudeState::Ranger, AltitudeState::Barometer]
                .map(|state| Part::One(state as usize, 1.0));
        // The bias of the ranger is last, as the step test requires.
        let (jacobian, sigma_m): (&[Part], f64) = match sensor {
            AltitudeSensor::Gnss => (&[altitude], GNSS_SIGMA_M),
            AltitudeSensor::TimeOfFlight => (&[altitude, ranger], TIME_OF_FLIGHT_SIGMA_M),
            AltitudeSensor::Barometer => (&[altitude, barometer], self.options.barometer_sigma_m),
        };
        let measurement = Measurement { jacobian, value: measured_m, variance: sigma_m * sigma_m };
        let innovation = self.normal.innovation(&measurement);
        let floor = if sensor == AltitudeSensor::TimeOfFlight {
            self.test.correct(&mut self.normal, &measurement, f64::INFINITY)
        } else {
            self.normal.correct(&measurement, |_| true);
            Floor::Still
        };
        self.steps += u32::from(matches!(floor, Floor::Stepped(_)));
        let taken = floor == Floor::Still;
        self.readings.push(HeightReading { sensor, measured_m, innovation, taken });
    }

    /// Returns the estimate of a state, in the unit that [`AltitudeState`] names.
    pub fn estimate(&self, state: AltitudeState) -> f64 {
        self.normal.mean[state as usize]
    }

    /// Returns the standard deviation of a state.
    pub fn sigma(&self, state: AltitudeState) -> f64 {
        self.normal.sigma(state as usize)
    }

    /// Returns the estimated map from throttle, 0 to 1, to vertical acceleration in m/s². Its
    /// offset includes the estimated gust.
    pub fn thrust_map(&self) -> ThrustMap {
        let [offset_m_s2, gain_m_s2] =
            [AltitudeState::Offset, AltitudeState::Gain].map(|s| self.estimate(s));
        ThrustMap { offset_m_s2: offset_m_s2 + self.normal.mean[GUST], gain_m_s2 }
    }

    /// Returns the readings since the last prediction, in the order of arrival.
    pub fn readings(&self) -> &[HeightReading] {
        &self.readings
    }

    /// Returns the number of steps of the floor so far.
    pub fn steps(&self) -> u32 {
        self.steps
    }
}
