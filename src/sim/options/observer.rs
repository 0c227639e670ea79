//! Settings of the estimator, in the section `observer` of a scene.

use crate::sensors::{Positioning, SensorOptions};
use noctograph_core::error::{Error, Result};
use noctograph_core::settings::settings;

settings! {
    /// Estimator of the drone's motion. Weights of unused estimators are kept for the design of
    /// gains.
    pub struct ObserverOptions {
        /// Kind of estimator.
        kind: EstimatorKind = EstimatorKind::Luenberger;
        /// Luenberger observer.
        luenberger: LuenbergerOptions = LuenbergerOptions::default(),
            for "observer.kind" = "luenberger";
        /// Extended Kalman filter.
        ekf: EkfOptions = EkfOptions::default(),
            for "observer.kind" = "ekf" | "ekf-improved" | "altitude" | "cooperative";
        /// Differences between the firmware's Kalman filter and a textbook filter.
        firmware: FirmwareOptions = FirmwareOptions::default(), for "observer.kind" = "ekf";
        /// Altitude filter.
        altitude: AltitudeOptions = AltitudeOptions::default(), for "observer.kind" = "altitude";
        /// Filter of a fleet. The filter uses the weights of `ekf`.
        cooperative: CooperativeOptions = CooperativeOptions::default(),
            for "observer.kind" = "cooperative";
    }

    /// An estimator of the drone's motion.
    pub enum EstimatorKind {
        /// The reference flight's Luenberger observer, which uses positions.
        "luenberger" => Luenberger,
        /// Extended Kalman filter of the Crazyflie's firmware, which uses any measurement.
        "ekf" => Ekf,
        /// An improved estimator, which is an extended Kalman filter that uses all three axes of
        /// the accelerometer, every sweep at its time, and the full Jacobian.
        "ekf-improved" => EkfImproved,
        /// A separate filter for altitude, thrust map and biases of ranger and barometer, and the
        /// improved extended Kalman filter for everything else.
        "altitude" => Altitude,
        /// Extended Kalman filter on each drone over all drones of the fleet, which uses
        /// ultra-wideband ranges and messages.
        "cooperative" => Cooperative,
        /// The true state.
        "truth" => Truth,
    }

    /// Filter of a fleet.
    pub struct CooperativeOptions {
        /// Data that the drones exchange.
        share: Share = Share::Measurements;
        /// Standard deviation of a drone's position at the start for each axis.
        start_sigma_m: f64 = 0.02, in 1e-4..=10.0;
        /// Standard deviation of the tilt at the start for each axis.
        start_tilt_rad: f64 = 0.02, in 1e-5..=1.0;
    }

    /// Content of the messages between the drones of a fleet.
    pub enum Share {
        /// Motion, ranges and heights, from which every drone estimates all drones.
        "measurements" => Measurements,
        /// Estimates of the drones, for comparison only. Information common to two drones is
        /// counted twice, which makes the estimates less accurate.
        "estimates" => Estimates,
        /// Nothing, so that every drone uses only its anchors.
        "nothing" => Nothing,
    }

    /// Luenberger observer, whose gain is that of the dual regulator.
    ///
    /// The defaults are 1/σ², in which σ is the spread in the team's flight logs.
    pub struct LuenbergerOptions {
        /// Confidence in the measured position x y z, as 1/σ² (1/m²).
        ///
        /// With larger values, the estimate follows the measurement faster, but is noisier.
        q: [f64; 3] = [111_111.0, 62_500.0, 250_000.0], in 1e-6..=1e12;
        /// Confidence in the model of position x y z, pitch, roll and body velocity x y z, as 1/σ²
        /// of each derivative. Larger values follow the gyroscope and the accelerometer more
        /// closely.
        r: [f64; 8] = [1479.3, 1479.3, 918.3, 94.3, 24.3, 45.0, 75.6, 28.6], in 1e-6..=1e12;
    }

    /// Extended Kalman filter, with the assumed errors of its sensors.
    ///
    /// The defaults are those of the firmware, release 2026.08 (`kalman_core_params_defaults.h`,
    /// `lighthouse_position_est.c`, `tdoaEngine.h`, `lpsTwrTag.c`). The firmware's 0.5 m/s² (1.0
    /// along z) and 0.1 rad/s per tick of 1 ms correspond to densities of 0.02236 (0.04472) and
    /// 0.004472. The firmware assumes 1 mrad for sweeps (0.4 mrad in the first generation), 1 cm
    /// for positions, 15 cm for differences of ranges, 25 cm for ranges, and 2 m for air pressure.
    /// Sweeps pass through the firmware's outlier filter (`outlierFilterLighthouse.c`).
    pub struct EkfOptions {
        /// Noise density of the measured acceleration in (m/s²)/√Hz.
        ///
        /// With a larger value, the estimate follows the positioning system faster.
        acceleration_noise_m_s2_sqrt_hz: f64 = 0.02236, in 1e-6..=100.0;
        /// Noise density along world z, along which the propellers cause vibration.
        acceleration_noise_z_m_s2_sqrt_hz: f64 = 0.04472, in 1e-6..=100.0;
        /// Noise density of the measured body rate in (rad/s)/√Hz.
        rate_noise_rad_s_sqrt_hz: f64 = 0.004472, in 1e-7..=10.0;
        /// Standard deviation of a measured position for each axis.
        position_sigma_m: f64 = 0.01, in 1e-5..=100.0,
            for "sensors.positioning" = "position" | "crossing-beams" | "gnss";
        /// Standard deviation of an ultra-wideband range by two-way ranging.
        two_way_sigma_m: f64 = 0.25, in 1e-4..=100.0, for "sensors.positioning" = "uwb-twr";
        /// Standard deviation of a barometric height.
        ///
        /// The ranger's standard deviation depends on the distance, as in the firmware.
        barometer_sigma_m: f64 = 2.0, in 1e-3..=100.0,
            for "sensors.heights" = "barometer", unless "observer.kind" = "altitude";
        /// Outlier gate, which rejects a position, range or height if its innovation exceeds this
        /// number of standard deviations. The firmware has no such gate.
        ///
        /// The square of the gate is a χ² threshold with one degree of freedom. Too low a gate
        /// rejects measurements that differ by several times the σ above, as in real rooms.
        gate_sigmas: f64 = 10.0, in 1.0..=1e6,
            for "observer.kind" = "ekf-improved" | "altitude" | "cooperative";
        /// True to allow steps of the floor below the ranger, such as the edge of a table.
        ///
        /// Two consecutive range errors above 4 standard deviations and 5 cm then count as a step
        /// of the floor instead of a motion of the drone.
        floor_steps: bool = false,
            for "sensors.heights" = "time-of-flight", for "observer.kind" = "ekf-improved";
        fixed {
            /// Standard deviation in rad of a sweep angle of a second-generation station.
            sweep_sigma_rad: f64 = 0.001;
            /// Standard deviation in rad of a sweep angle of a first-generation station.
            sweep_v1_sigma_rad: f64 = 0.0004;
            /// Standard deviation in m of a difference of ultra-wideband ranges.
            range_sigma_m: f64 = 0.15;
        }
    }

    /// Assumed noise of the altitude filter. Random walks are per square root of a second.
    pub struct AltitudeOptions {
        /// Standard deviation of a barometric altitude.
        barometer_sigma_m: f64 = 0.25, in 0.001..=10.0;
        /// Noise density of the vertical acceleration in (m/s²)/√Hz, in addition to that of the
        /// gusts, due to changes of a gust within a step and to the lag of the motors.
        acceleration_noise_m_s2_sqrt_hz: f64 = 0.04243, in 0.0001..=100.0;
        /// Assumed hover throttle at the start, which is the vehicle's by default.
        hover_throttle: Option<f64> = None, in 0.01..=0.99;
        fixed {
            /// Random walk of α¹ in (m/s²)/√s.
            ///
            /// A battery that loses 25 % of its lift in a minute decreases α¹ by 0.16 m/s² per
            /// second. With a walk of 0.1, the drone then sinks by 6 cm. With too large a walk
            /// (0.8), α¹ follows sensor noise, and if α⁰ is also free (1.4 m/s²), both drift apart
            /// by more than their σ.
            gain_walk_m_s2_sqrt_s: f64 = 0.3;
            /// Innovation of the ranger, in standard deviations, beyond which a range is rejected.
            /// Two consecutive rejected ranges count as a step of the floor.
            step_gate_sigmas: f64 = 4.0;
            /// Standard deviation of α⁰ in m/s² before the flight, from the lift at zero throttle
            /// and a steady draft.
            offset_sigma_m_s2: f64 = 0.1;
            /// Standard deviation of α¹ in m/s² before the flight, which is 5 % of α¹ in `bzzz`.
            gain_sigma_m_s2: f64 = 1.9;
        }
    }

    /// Differences between the firmware's Kalman filter and a textbook filter, each of which can be
    /// disabled to see its effect.
    ///
    /// The defaults are those of release 2026.08 (`kalman_core.c`, `estimator_kalman.c`,
    /// `mm_sweep_angles.c`, `mm_tof.c`, `lighthouse_core.c`, `lighthouse_throttle.c`,
    /// `outlierFilterTdoa.c`).
    pub struct FirmwareOptions {
        /// Specific force across the body's z axis in flight.
        horizontal_force: HorizontalForce = HorizontalForce::Zero;
        /// Number of predictions per second, each from the mean of the newest inertial readings.
        prediction_hz: f64 = 100.0, in 1.0..=2000.0;
        /// Attitude information that is taken from sweep angles.
        sweep_attitude: SweepAttitude = SweepAttitude::YawError,
            for "sensors.positioning" = "sweeps";
        /// True to use both sweeps of a rotation together when the second one arrives, and to drop
        /// both if one is missing. False uses each sweep when it arrives.
        paired_sweeps: bool = true, for "sensors.positioning" = "sweeps";
        /// Maximum number of rotations used per second, over all second-generation stations. With
        /// 0, all rotations are used.
        rotations_hz: f64 = 50.0, in 0.0..=1e4, for "sensors.positioning" = "sweeps";
        /// Minimum variance of each state, for position (m²), velocity (m²/s²) and attitude (rad²).
        least_variance: f64 = 1e-6, in 0.0..=1.0;
    }

    /// Specific force across the body's z axis in flight, in the firmware's filter.
    pub enum HorizontalForce {
        /// No force, as on a drone without drag. With drag, the estimated tilt and velocity are
        /// wrong.
        "zero" => Zero,
        /// Readings of the accelerometer.
        "measured" => Measured,
    }

    /// Attitude information that is taken from sweep angles.
    pub enum SweepAttitude {
        /// The yaw, from the diagonals of the deck's sensors as one station sees them.
        "yaw-error" => YawError,
        /// The rotation about all axes, from the Jacobian of each sensor's angle.
        "slope" => Slope,
    }
}

impl ObserverOptions {
    /// Checks that the estimator can use the measurements of the sensors.
    pub(super) fn check_inputs(&self, sensors: &SensorOptions) -> Result<()> {
        let gives_positions = sensors.positioning.gives_positions();
        let measures_altitude =
            sensors.positioning == Positioning::Gnss || !sensors.heights.is_empty();
        // The Kalman filters can use any measurement, but other estimators require certain ones.
        let (kind, wanted) = match self.kind {
            EstimatorKind::Altitude if !measures_altitude => {
                ("altitude without an altitude sensor", "satellites, a ranger or a barometer")
            }
            EstimatorKind::Luenberger if !gives_positions => {
                ("luenberger with a positioning system that reports no positions", "ekf")
            }
            EstimatorKind::Cooperative if sensors.positioning != Positioning::UwbTwr => {
                ("cooperative without the ranges to anchors and drones of uwb-twr", "ekf")
            }
            EstimatorKind::Altitude
            | EstimatorKind::Luenberger
            | EstimatorKind::Cooperative
            | EstimatorKind::Ekf
            | EstimatorKind::EkfImproved
            | EstimatorKind::Truth => return Ok(()),
        };
        Err(Error::input(
            "observer.kind",
            kind,
            wanted,
            "set observer.kind = \"ekf\", or set sensors.positioning to uwb-twr for cooperative, \
             or to position, crossing-beams or gnss for luenberger",
        ))
    }
}
