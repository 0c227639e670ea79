//! Settings of the altitude filter: the section `observer.altitude` of a scene.

use crate::settings::settings;

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
        step_gate_sigmas: f64 = 4.0, in 1.0..=1e6;
        /// Standard deviation that a step adds to the ranger's bias.
        step_sigma_m: f64 = 0.5, in 0.01..=10.0;
        /// Hover throttle that is believed before the flight; left out, that of the vehicle.
        hover_throttle: Option<f64> = None, in 0.01..=0.99;
        /// Its standard deviation.
        hover_throttle_sigma: f64 = 0.03, in 0.0001..=0.5;
        /// Standard deviation of α¹ before the flight.
        gain_sigma_m_s2: f64 = 3.0, in 0.01..=100.0;
        /// Standard deviation of the barometer's bias before the flight.
        barometer_bias_sigma_m: f64 = 0.5, in 0.001..=100.0;
    }
}
