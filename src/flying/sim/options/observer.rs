//! Settings of the estimator: the section `observer` of a scene.

use super::altitude::AltitudeOptions;
use crate::error::{Error, Result};
use crate::sensors::{Positioning, SensorOptions};
use crate::settings::settings;

settings! {
    /// The estimator. The weights of one that does not fly are kept, for the design of gains.
    pub struct ObserverOptions {
        /// The estimator that flies.
        kind: EstimatorKind = EstimatorKind::Luenberger;
        /// Luenberger observer.
        luenberger: LuenbergerOptions = LuenbergerOptions::default(),
            for "observer.kind" = "luenberger";
        /// Extended Kalman filter.
        ekf: EkfOptions = EkfOptions::default(),
            for "observer.kind" = "ekf" | "altitude" | "cooperative";
        /// Altitude filter.
        altitude: AltitudeOptions = AltitudeOptions::default(), for "observer.kind" = "altitude";
        /// The filter of a fleet, with the weights of `ekf`.
        cooperative: CooperativeOptions = CooperativeOptions::default(),
            for "observer.kind" = "cooperative";
    }

    /// An estimator of the drone's motion.
    pub enum EstimatorKind {
        /// The reference flight's Luenberger observer, on positions.
        "luenberger" => Luenberger,
        /// Extended Kalman filter, on any measurement.
        "ekf" => Ekf,
        /// Altitude, thrust map and biases of ranger and barometer by a filter of their own; all else
        /// by the extended Kalman filter.
        "altitude" => Altitude,
        /// Extended Kalman filter on each drone over all drones of the fleet, on ultra-wideband
        /// ranges and messages.
        "cooperative" => Cooperative,
        /// The true state.
        "truth" => Truth,
    }

    /// The filter of a fleet.
    pub struct CooperativeOptions {
        /// What the drones tell each other.
        share: Share = Share::Measurements;
        /// Standard deviation of the place where a drone starts, per axis.
        start_sigma_m: f64 = 0.02, in 1e-4..=10.0;
        /// Standard deviation of the tilt at the start, per axis.
        start_tilt_rad: f64 = 0.02, in 1e-5..=1.0;
    }

    /// What the drones of a fleet tell each other.
    pub enum Share {
        /// Their motion, ranges and heights: every drone estimates all drones from them.
        "measurements" => Measurements,
        /// Their estimates. What two drones have in common is then counted twice: worse, for
        /// comparison.
        "estimates" => Estimates,
        /// Nothing: every drone has its own anchors alone.
        "nothing" => Nothing,
    }

    /// Luenberger observer, its gain by the dual regulator.
    ///
    /// Default: 1/σ² of the spread in the team's flight logs.
    pub struct LuenbergerOptions {
        /// Trust in the measured position x y z: 1/σ² (1/m²).
        ///
        /// More follows the measurement faster and passes more of its noise.
        q: [f64; 3] = [111_111.0, 62_500.0, 250_000.0], in 1e-6..=1e12;
        /// Trust in the model of position x y z, pitch, roll and body velocity x y z: 1/σ² of each
        /// derivative. More follows the gyroscope and the accelerometer.
        r: [f64; 8] = [1479.3, 1479.3, 918.3, 94.3, 24.3, 45.0, 75.6, 28.6], in 1e-6..=1e12;
    }

    /// Extended Kalman filter: assumed errors of its sensors.
    ///
    /// Default: the firmware (`kalman_core_params_defaults.h`, `lighthouse_position_est.c`,
    /// `tdoaEngine.h`, `lpsTwrTag.c`): 0.5 m/s² (1.0 along z) and 0.1 rad/s a tick of 1 ms, which
    /// are densities of 0.022 (0.045) and 0.0045; sweeps 1 mrad (0.4 mrad of the first
    /// generation), positions 1 cm, differences of ranges 15 cm, ranges 25 cm, air pressure 2 m.
    /// Commits 170923a, 71bf0d5 and 0cf8300. Sweeps pass the firmware's own outlier filter
    /// (`outlierFilterLighthouse.c`, commit 8c973af); the gate of all else is ours.
    pub struct EkfOptions {
        /// Noise density of the measured acceleration, (m/s²)/√Hz.
        ///
        /// More follows the positioning faster.
        acceleration_noise_m_s2_sqrt_hz: f64 = 0.022, in 1e-6..=100.0;
        /// The same along world z, where the propellers shake.
        acceleration_noise_z_m_s2_sqrt_hz: f64 = 0.045, in 1e-6..=100.0;
        /// Noise density of the measured body rate, (rad/s)/√Hz.
        rate_noise_rad_s_sqrt_hz: f64 = 0.0045, in 1e-7..=10.0;
        /// Standard deviation of a sweep angle of a second-generation station.
        sweep_sigma_rad: f64 = 0.001, in 1e-6..=1.0,
            for "sensors.positioning" = "sweeps",
            for "sensors.lighthouse.stations.generation" = "v2";
        /// Standard deviation of a sweep angle of a first-generation station.
        sweep_v1_sigma_rad: f64 = 0.0004, in 1e-6..=1.0,
            for "sensors.positioning" = "sweeps",
            for "sensors.lighthouse.stations.generation" = "v1";
        /// Standard deviation of a measured position per axis.
        position_sigma_m: f64 = 0.01, in 1e-5..=100.0,
            for "sensors.positioning" = "position" | "crossing-beams" | "gnss";
        /// Standard deviation of a difference of ultra-wideband ranges.
        range_sigma_m: f64 = 0.15, in 1e-4..=100.0, for "sensors.positioning" = "uwb-tdoa";
        /// Standard deviation of an ultra-wideband range by two-way ranging.
        two_way_sigma_m: f64 = 0.25, in 1e-4..=100.0, for "sensors.positioning" = "uwb-twr";
        /// Standard deviation of a barometric height.
        ///
        /// That of the time-of-flight ranger follows its distance, as in the firmware.
        barometer_sigma_m: f64 = 2.0, in 1e-3..=100.0,
            for "sensors.heights" = "barometer", unless "observer.kind" = "altitude";
        /// Gate: standard deviations of its innovation beyond which a position, a range or a height
        /// is rejected.
        ///
        /// χ² with one degree of freedom. If it is too low, measurements that disagree by several
        /// times the σ above, as those of real rooms do, are ignored.
        gate_sigmas: f64 = 10.0, in 1.0..=1e6;
        /// Whether the floor below the ranger may have steps, such as the edge of a table.
        ///
        /// Two ranges in a row beyond 4 standard deviations and 5 cm are then a step of the floor, and
        /// not motion of the drone.
        floor_steps: bool = false,
            for "sensors.heights" = "time-of-flight", for "observer.kind" = "ekf";
    }
}

impl ObserverOptions {
    /// Checks that the estimator can use the measurements of the sensors.
    pub(super) fn check_inputs(&self, sensors: &SensorOptions) -> Result<()> {
        let gives_positions = sensors.positioning.gives_positions();
        let measures_altitude =
            sensors.positioning == Positioning::Gnss || !sensors.heights.is_empty();
        let (found, wanted) = match self.kind {
            EstimatorKind::Altitude if !measures_altitude => {
                ("altitude, with no sensor of the altitude", "satellites, a ranger or a barometer")
            }
            EstimatorKind::Luenberger if !gives_positions => {
                ("luenberger, which takes positions, with a positioning that gives none", "ekf")
            }
            EstimatorKind::Cooperative if sensors.positioning != Positioning::UwbTwr => {
                ("cooperative, which takes ranges to anchors and drones, without uwb-twr", "ekf")
            }
            _ => return Ok(()),
        };
        Err(Error::input(
            "observer.kind",
            found,
            wanted,
            "set observer.kind = \"ekf\", or sensors.positioning to position, crossing-beams or \
             gnss for luenberger, to uwb-twr for cooperative",
        ))
    }
}
