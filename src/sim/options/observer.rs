//! Settings of the estimator: the section `observer` of a scene.

use crate::sensors::{Positioning, SensorOptions};
use noctograph_core::error::{Error, Result};
use noctograph_core::settings::settings;

settings! {
    /// The estimator. The weights of one that does not fly are kept, for the design of gains.
    pub struct ObserverOptions {
        /// Kind of estimator.
        kind: EstimatorKind = EstimatorKind::Luenberger;
        /// Luenberger observer.
        luenberger: LuenbergerOptions = LuenbergerOptions::default(),
            for "observer.kind" = "luenberger";
        /// Extended Kalman filter.
        ekf: EkfOptions = EkfOptions::default(),
            for "observer.kind" = "ekf" | "ekf-improved" | "altitude" | "cooperative";
        /// Differences between the firmware's Kalman filter and a textbook's.
        firmware: FirmwareOptions = FirmwareOptions::default(), for "observer.kind" = "ekf";
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
        /// Extended Kalman filter of the Crazyflie's firmware, on any measurement.
        "ekf" => Ekf,
        /// Extended Kalman filter that uses all three axes of the accelerometer, every sweep at its
        /// time and its whole Jacobian: an improved estimator.
        "ekf-improved" => EkfImproved,
        /// Altitude, thrust map and biases of ranger and barometer by a separate filter, and all
        /// else by the improved extended Kalman filter.
        "altitude" => Altitude,
        /// Extended Kalman filter on each drone over all drones of the fleet, on ultra-wideband
        /// ranges and messages.
        "cooperative" => Cooperative,
        /// The true state.
        "truth" => Truth,
    }

    /// The filter of a fleet.
    pub struct CooperativeOptions {
        /// Data that the drones exchange.
        share: Share = Share::Measurements;
        /// Standard deviation of a drone's position at the start, per axis.
        start_sigma_m: f64 = 0.02, in 1e-4..=10.0;
        /// Standard deviation of the tilt at the start, per axis.
        start_tilt_rad: f64 = 0.02, in 1e-5..=1.0;
    }

    /// Content of the messages between the drones of a fleet.
    pub enum Share {
        /// Their motion, ranges and heights: every drone estimates all drones from them.
        "measurements" => Measurements,
        /// Their estimates. Information common to two drones is counted twice: worse, for
        /// comparison.
        "estimates" => Estimates,
        /// Nothing: every drone uses only its anchors.
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
        /// derivative. Larger values follow the gyroscope and the accelerometer.
        r: [f64; 8] = [1479.3, 1479.3, 918.3, 94.3, 24.3, 45.0, 75.6, 28.6], in 1e-6..=1e12;
    }

    /// Extended Kalman filter: assumed errors of its sensors.
    ///
    /// Default: the firmware (`kalman_core_params_defaults.h`, `lighthouse_position_est.c`,
    /// `tdoaEngine.h`, `lpsTwrTag.c`) of release 2026.08: 0.5 m/s² (1.0 along z) and 0.1 rad/s a
    /// tick of 1 ms, which are densities of 0.02236 (0.04472) and 0.004472. Sweeps 1 mrad (0.4 mrad
    /// of the first generation), positions 1 cm, differences of ranges 15 cm, ranges 25 cm, air
    /// pressure 2 m. Sweeps pass the firmware's outlier filter (`outlierFilterLighthouse.c`).
    pub struct EkfOptions {
        /// Noise density of the measured acceleration, (m/s²)/√Hz.
        ///
        /// More follows the positioning faster.
        acceleration_noise_m_s2_sqrt_hz: f64 = 0.02236, in 1e-6..=100.0;
        /// The same density along world z, in which the propellers shake.
        acceleration_noise_z_m_s2_sqrt_hz: f64 = 0.04472, in 1e-6..=100.0;
        /// Noise density of the measured body rate, (rad/s)/√Hz.
        rate_noise_rad_s_sqrt_hz: f64 = 0.004472, in 1e-7..=10.0;
        /// Standard deviation of a measured position per axis.
        position_sigma_m: f64 = 0.01, in 1e-5..=100.0,
            for "sensors.positioning" = "position" | "crossing-beams" | "gnss";
        /// Standard deviation of an ultra-wideband range by two-way ranging.
        two_way_sigma_m: f64 = 0.25, in 1e-4..=100.0, for "sensors.positioning" = "uwb-twr";
        /// Standard deviation of a barometric height.
        ///
        /// That of the time-of-flight ranger follows its distance, as in the firmware.
        barometer_sigma_m: f64 = 2.0, in 1e-3..=100.0,
            for "sensors.heights" = "barometer", unless "observer.kind" = "altitude";
        /// Outlier gate: a position, range or height is rejected if its innovation exceeds this
        /// number of standard deviations. The firmware has no gate.
        ///
        /// χ² with one degree of freedom. If it is too low, measurements that disagree by several
        /// times the σ above, as those of real rooms do, are ignored.
        gate_sigmas: f64 = 10.0, in 1.0..=1e6,
            for "observer.kind" = "ekf-improved" | "altitude" | "cooperative";
        /// Allow steps of the floor below the ranger, such as the edge of a table.
        ///
        /// Two ranges in a row beyond 4 standard deviations and 5 cm are then a step of the floor,
        /// and not motion of the drone.
        floor_steps: bool = false,
            for "sensors.heights" = "time-of-flight", for "observer.kind" = "ekf-improved";
        fixed {
            /// Standard deviation of a sweep angle of a second-generation station.
            sweep_sigma_rad: f64 = 0.001;
            /// Standard deviation of a sweep angle of a first-generation station.
            sweep_v1_sigma_rad: f64 = 0.0004;
            /// Standard deviation of a difference of ultra-wideband ranges.
            range_sigma_m: f64 = 0.15;
        }
    }

    /// Covariances of the altitude filter. Random walks are per root of a second.
    pub struct AltitudeOptions {
        /// Standard deviation of a barometric altitude.
        barometer_sigma_m: f64 = 0.25, in 0.001..=10.0;
        /// Noise density of the vertical acceleration beside the gusts, (m/s²)/√Hz: gusts within a
        /// step, lag of the motors.
        acceleration_noise_m_s2_sqrt_hz: f64 = 0.04243, in 0.0001..=100.0;
        /// Assumed hover throttle at the start, by default the vehicle's.
        hover_throttle: Option<f64> = None, in 0.01..=0.99;
        fixed {
            /// Random walk of α¹.
            ///
            /// A battery that loses 25 % of its lift in a minute takes 0.16 m/s² a second from α¹:
            /// with a walk of 0.1 the drone sinks by 6 cm meanwhile. Too large a walk (0.8) follows
            /// the noise of the sensors, and with a free α⁰ (1.4 m/s²) both drift apart by more
            /// than their σ.
            gain_walk_m_s2_sqrt_s: f64 = 0.3;
            /// Innovation of the ranger beyond which a range is not used, in standard deviations.
            /// Two in a row are a step of the floor.
            step_gate_sigmas: f64 = 4.0;
            /// Standard deviation of α⁰ before the flight, from the lift at zero throttle and a
            /// steady draft.
            offset_sigma_m_s2: f64 = 0.1;
            /// Standard deviation of α¹ before the flight: 5 % of α¹ in `bzzz`.
            gain_sigma_m_s2: f64 = 1.9;
        }
    }

    /// Differences between the firmware's Kalman filter and a textbook's: each can be changed, to
    /// see its cost.
    ///
    /// Default: release 2026.08 (`kalman_core.c`, `estimator_kalman.c`, `mm_sweep_angles.c`,
    /// `mm_tof.c`, `lighthouse_core.c`, `lighthouse_throttle.c`, `outlierFilterTdoa.c`).
    pub struct FirmwareOptions {
        /// Specific force across the body's z axis in flight.
        horizontal_force: HorizontalForce = HorizontalForce::Zero;
        /// Predictions per second, each on the mean of the inertial readings since the last.
        prediction_hz: f64 = 100.0, in 1.0..=2000.0;
        /// Attitude information taken from sweep angles.
        sweep_attitude: SweepAttitude = SweepAttitude::YawError,
            for "sensors.positioning" = "sweeps";
        /// Use a rotation's two sweeps together at the second one, and drop them if one is missing.
        /// Otherwise each is used when it arrives.
        paired_sweeps: bool = true, for "sensors.positioning" = "sweeps";
        /// Greatest number of rotations used per second, over all second-generation stations. 0:
        /// all.
        rotations_hz: f64 = 50.0, in 0.0..=1e4, for "sensors.positioning" = "sweeps";
        /// Least variance of each state: of position (m²), velocity (m²/s²) and attitude (rad²).
        least_variance: f64 = 1e-6, in 0.0..=1.0;
    }

    /// Specific force across the body's z axis in flight, in the firmware's filter.
    pub enum HorizontalForce {
        /// None, as on a drone without drag. With drag, the estimates of tilt and velocity are
        /// wrong.
        "zero" => Zero,
        /// Readings of the accelerometer.
        "measured" => Measured,
    }

    /// Attitude information taken from sweep angles.
    pub enum SweepAttitude {
        /// The yaw, by the diagonals of the deck's sensors as one station sees them.
        "yaw-error" => YawError,
        /// The turn about all axes, by the Jacobian of each sensor's angle.
        "slope" => Slope,
    }
}

impl ObserverOptions {
    /// Checks that the estimator can use the measurements of the sensors.
    pub(super) fn check_inputs(&self, sensors: &SensorOptions) -> Result<()> {
        let gives_positions = sensors.positioning.gives_positions();
        let measures_altitude =
            sensors.positioning == Positioning::Gnss || !sensors.heights.is_empty();
        // The Kalman filters use any measurement, and the others need a certain kind.
        let (kind, wanted) = match self.kind {
            EstimatorKind::Altitude if !measures_altitude => {
                ("altitude, with no sensor of the altitude", "satellites, a ranger or a barometer")
            }
            EstimatorKind::Luenberger if !gives_positions => {
                ("luenberger, which needs positions, with a positioning that gives none", "ekf")
            }
            EstimatorKind::Cooperative if sensors.positioning != Positioning::UwbTwr => {
                ("cooperative, which needs ranges to anchors and drones, without uwb-twr", "ekf")
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
            "set observer.kind = \"ekf\", or sensors.positioning to position, crossing-beams or \
             gnss for luenberger, to uwb-twr for cooperative",
        ))
    }
}
