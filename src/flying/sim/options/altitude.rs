//! Settings of the altitude filter: the section `observer.altitude` of a scene.

use noctograph_core::settings::settings;

settings! {
    /// Covariances of the altitude filter. Random walks are per root of a second.
    pub struct AltitudeOptions {
        /// Standard deviation of a satellite altitude.
        gnss_sigma_m: f64 = 0.05, in 0.001..=10.0;
        /// Standard deviation of a range to the floor.
        time_of_flight_sigma_m: f64 = 0.06, in 0.001..=10.0;
        /// Standard deviation of a barometric altitude.
        barometer_sigma_m: f64 = 0.25, in 0.001..=10.0;
        /// Vertical acceleration by gusts, σ: a first-order Gauss-Markov process (Singer 1970),
        /// held from one prediction to the next.
        ///
        /// Taken for white noise instead, gusts make the innovations correlated with the throttle
        /// that answers them, and α⁰ and α¹ are then told apart by that correlation, wrongly.
        gust_sigma_m_s2: f64 = 0.15, in 0.0..=100.0;
        /// Correlation time of the gusts.
        gust_time_s: f64 = 2.0, in 0.01..=1000.0;
        /// Noise density of the vertical acceleration beside the gusts, (m/s²)/√Hz: gusts within a
        /// step, lag of the motors.
        acceleration_noise_m_s2_sqrt_hz: f64 = 0.04243, in 0.0001..=100.0;
        /// Random walk of α⁰: mass and lift at no throttle hardly change.
        offset_walk_m_s2_sqrt_s: f64 = 0.005, in 0.0..=100.0;
        /// Random walk of α¹.
        ///
        /// A battery that loses 25 % of its lift in a minute takes 0.16 m/s² a second from α¹: with
        /// a walk of 0.1 the drone sinks by 6 cm meanwhile. A walk that no flight has (0.8) follows
        /// the noise of the sensors: α¹ is known less well than it could be, and where α⁰ is free
        /// as well (1.4 m/s²), both drift apart by more than their σ.
        gain_walk_m_s2_sqrt_s: f64 = 0.3, in 0.0..=100.0;
        /// Random walk of the floor: flat between steps, which the step test finds.
        ranger_walk_m_sqrt_s: f64 = 0.003, in 0.0..=10.0;
        /// Random walk of the barometer's bias: a draft or a weather front, 2 cm/s at most.
        barometer_walk_m_sqrt_s: f64 = 0.05, in 0.0..=10.0;
        /// Innovation of the ranger beyond which a range is not taken in, in standard deviations;
        /// two in a row are a step of the floor.
        step_gate_sigmas: f64 = 4.0, in 1.0..=1e6;
        /// Standard deviation that a step adds to the ranger's bias.
        step_sigma_m: f64 = 0.5, in 0.01..=10.0;
        /// Hover throttle that is believed before the flight; left out, that of the vehicle.
        hover_throttle: Option<f64> = None, in 0.01..=0.99;
        /// Standard deviation of α⁰ before the flight. Gravity is known: what is not is the lift at
        /// no throttle, and a steady draft.
        offset_sigma_m_s2: f64 = 0.1, in 0.0001..=100.0;
        /// Standard deviation of α¹ before the flight: 5 % of that of `bzzz`.
        gain_sigma_m_s2: f64 = 1.9, in 0.01..=100.0;
        /// Standard deviation of the barometer's bias before the flight.
        barometer_bias_sigma_m: f64 = 0.5, in 0.001..=100.0;
    }
}
