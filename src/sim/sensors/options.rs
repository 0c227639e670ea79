//! What the drone measures with, and how badly: the section `sensors` of a scene.

use serde::{Deserialize, Serialize};

use super::station::{Generation, Station};
use crate::error::{Error, Result, within};

/// Most base stations: the channels of the second generation.
const MAX_STATIONS: usize = 16;
/// Most ultra-wideband anchors.
const MAX_ANCHORS: usize = 64;

/// What tells the drone where it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Positioning {
    /// A position at every tick, with white jitter and a smooth distortion: the reference flight's
    /// Lighthouse as its log shows it, without stations.
    #[default]
    Position,
    /// Lighthouse, positions from the crossing of two stations' beams (`lighthouse.method` 0).
    CrossingBeams,
    /// Lighthouse, raw sweep angles (`lighthouse.method` 1).
    Sweeps,
    /// Ultra-wideband, distance to one anchor after the other by two-way ranging.
    UwbTwr,
    /// Ultra-wideband, difference of the distances to two anchors.
    UwbTdoa,
    /// Satellites with a base station.
    Gnss,
}

impl Positioning {
    /// Whether it gives positions, rather than angles or distances.
    pub(in crate::sim) fn gives_positions(self) -> bool {
        matches!(self, Self::Position | Self::CrossingBeams | Self::Gnss)
    }
}

/// What tells the drone how high it is, besides the positioning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HeightSensor {
    /// Infrared time of flight to the floor.
    TimeOfFlight,
    /// Air pressure.
    Barometer,
}

/// Noise of the positioning and of the inertial sensors; 0 switches a term off.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorOptions {
    /// What tells the drone where it is.
    pub positioning: Positioning,
    /// What tells it how high it is, besides.
    pub heights: Vec<HeightSensor>,
    /// `position`: white noise of the measured position per axis and tick, σ.
    pub lighthouse_jitter_m: f64,
    /// Lighthouse, in any form: smooth error that depends on where the drone is, per axis, σ. It is
    /// what the joint solution for the stations' places leaves: they agree on a bent room.
    pub lighthouse_distortion_m: f64,
    /// Lighthouse, in any form: distance over which that error changes: the correlation falls as
    /// `exp(−d²/2l²)`.
    pub lighthouse_distortion_length_m: f64,
    /// Noise density of the gyroscope per axis, (rad/s)/√Hz.
    pub gyro_noise_rad_s_sqrt_hz: f64,
    /// Noise density of the accelerometer per axis, (m/s²)/√Hz.
    pub accelerometer_noise_m_s2_sqrt_hz: f64,
    /// Random walk of the gyroscope's bias per axis: density of its derivative, (rad/s²)/√Hz. The
    /// firmware removes the bias at rest before take-off, so that the walk begins at zero.
    pub gyro_bias_walk_rad_s2_sqrt_hz: f64,
    /// Random walk of the accelerometer's bias per axis: density of its derivative, (m/s³)/√Hz.
    pub accelerometer_bias_walk_m_s3_sqrt_hz: f64,
    /// Lighthouse base stations, as the drone believes them to stand.
    pub stations: Vec<Station>,
    /// White noise of a sweep angle per deck sensor, σ, of a first- and a second-generation
    /// station.
    pub sweep_noise_rad: [f64; 2],
    /// Share of that noise's variance which a sweep has at all four sensors alike.
    pub sweep_noise_shared_frac: f64,
    /// Share of sweeps that are lost on the way.
    pub sweep_loss_frac: f64,
    /// How far a station really stands from where the drone believes it, per axis, σ, beside the
    /// distortion that all share: how much stations disagree.
    pub station_position_error_m: f64,
    /// How far a station is really turned from how the drone believes it, per axis, σ.
    pub station_rotation_error_rad: f64,
    /// Smooth error of a sweep angle that the station's calibration leaves, σ.
    pub sweep_distortion_rad: f64,
    /// Change of direction over which that error changes.
    pub sweep_distortion_length_rad: f64,
    /// Ultra-wideband anchors.
    pub anchors_m: Vec<[f64; 3]>,
    /// Ranges per second, over all anchors.
    pub uwb_rate_hz: f64,
    /// White noise of a range, σ.
    pub uwb_noise_m: f64,
    /// Error of a link (an anchor, or a pair of them) that changes with the drone's place, σ.
    pub uwb_bias_m: f64,
    /// Share of ranges that went astray.
    pub uwb_outlier_frac: f64,
    /// Mean size of a stray range's error: a detour for two-way ranging, either way for differences.
    pub uwb_outlier_m: f64,
    /// White noise of the barometric height, σ at 50 Hz.
    pub barometer_noise_m: f64,
    /// Random walk of the barometric height, m/√s: σ after one second.
    pub barometer_drift_m_sqrt_s: f64,
    /// White noise of a satellite fix per axis, σ at 10 Hz.
    pub gnss_noise_m: f64,
}

impl Default for SensorOptions {
    /// Lighthouse: `positioning_dataset` of Bitcraze (Taffanel et al., arXiv 2104.11523): crossing
    /// beams at rest jitter by 0.3 mm at 50 fixes a second, which is 1 mm at 500; slow error in
    /// flight 13 mm rms over three axes, with a correlation of 0.6 to 3.4 s at 0.5 m/s. Sweeps
    /// spread by 60 µrad (first generation) and 28 µrad (second), and 45 of 52 a second arrive.
    /// That the rotor makes most of that noise, for all sensors alike, follows from the crossing
    /// beams' jitter: noise of each sensor for itself would average out to a third of it.
    /// Most of the error in flight, 13.5 mm mean, is distortion that the stations share: were it all
    /// each station's own, the filter would tremble at rest by more than the measured 0.59 mm as they
    /// pull it to and fro. What they disagree by is chosen so that both come out as measured.
    /// Two stations in opposite corners, some 4 m from the word; anchors in the corners of a room.
    /// IMU: data sheet of the BMI088, 0.014 °/s/√Hz and 190 µg/√Hz along z.
    /// Ultra-wideband: firmware fixture `log05` at rest (180 differences a second, 6 cm white, bias
    /// of a pair 20 cm, 14 % beyond 0.45 m). Barometer: 9 cm at 50 Hz in the same log; its drift is
    /// an assumption (30 cm in ten minutes). Satellites: 5 cm with a base station (lab on altitude
    /// hold).
    fn default() -> Self {
        Self {
            positioning: Positioning::Position,
            heights: Vec::new(),
            lighthouse_jitter_m: 0.001,
            lighthouse_distortion_m: 0.0075,
            lighthouse_distortion_length_m: 0.7,
            gyro_noise_rad_s_sqrt_hz: 2.44e-4,
            accelerometer_noise_m_s2_sqrt_hz: 1.86e-3,
            gyro_bias_walk_rad_s2_sqrt_hz: 0.0,
            accelerometer_bias_walk_m_s3_sqrt_hz: 0.0,
            stations: [[-2.5, -2.2, 2.4], [2.8, 2.2, 2.4]]
                .map(|place| Station::looking(Generation::V2, place, [0.15, 0.0, 0.75]))
                .into(),
            sweep_noise_rad: [60e-6, 28e-6],
            sweep_noise_shared_frac: 0.8,
            sweep_loss_frac: 0.13,
            station_position_error_m: 0.0015,
            station_rotation_error_rad: 0.0007,
            sweep_distortion_rad: 0.001,
            sweep_distortion_length_rad: 0.13,
            anchors_m: [[-2.5, -2.5], [-2.5, 2.5], [2.5, -2.5], [2.5, 2.5]]
                .into_iter()
                .flat_map(|[x, y]| [[x, y, 0.2], [x, y, 2.4]])
                .collect(),
            uwb_rate_hz: 180.0,
            uwb_noise_m: 0.06,
            uwb_bias_m: 0.2,
            uwb_outlier_frac: 0.1,
            uwb_outlier_m: 1.0,
            barometer_noise_m: 0.09,
            barometer_drift_m_sqrt_s: 0.012,
            gnss_noise_m: 0.05,
        }
    }
}

impl SensorOptions {
    /// Sensors without any error.
    #[must_use]
    pub fn ideal() -> Self {
        Self {
            lighthouse_jitter_m: 0.0,
            lighthouse_distortion_m: 0.0,
            lighthouse_distortion_length_m: 1.0,
            gyro_noise_rad_s_sqrt_hz: 0.0,
            accelerometer_noise_m_s2_sqrt_hz: 0.0,
            gyro_bias_walk_rad_s2_sqrt_hz: 0.0,
            accelerometer_bias_walk_m_s3_sqrt_hz: 0.0,
            sweep_noise_rad: [0.0; 2],
            sweep_loss_frac: 0.0,
            station_position_error_m: 0.0,
            station_rotation_error_rad: 0.0,
            sweep_distortion_rad: 0.0,
            uwb_noise_m: 0.0,
            uwb_bias_m: 0.0,
            uwb_outlier_frac: 0.0,
            barometer_noise_m: 0.0,
            barometer_drift_m_sqrt_s: 0.0,
            gnss_noise_m: 0.0,
            ..Self::default()
        }
    }

    /// Checks every range, and that what the positioning needs is there.
    pub(in crate::sim) fn check(&self) -> Result<()> {
        let length_m = self.lighthouse_distortion_length_m;
        let bias_walk = self.accelerometer_bias_walk_m_s3_sqrt_hz;
        for (key, value, min, max) in [
            ("lighthouse_jitter_m", self.lighthouse_jitter_m, 0.0, 1.0),
            ("lighthouse_distortion_m", self.lighthouse_distortion_m, 0.0, 1.0),
            ("lighthouse_distortion_length_m", length_m, 0.01, 1000.0),
            ("gyro_noise_rad_s_sqrt_hz", self.gyro_noise_rad_s_sqrt_hz, 0.0, 1.0),
            ("accelerometer_noise_m_s2_sqrt_hz", self.accelerometer_noise_m_s2_sqrt_hz, 0.0, 10.0),
            ("gyro_bias_walk_rad_s2_sqrt_hz", self.gyro_bias_walk_rad_s2_sqrt_hz, 0.0, 1.0),
            ("accelerometer_bias_walk_m_s3_sqrt_hz", bias_walk, 0.0, 10.0),
            ("sweep_noise_rad[0]", self.sweep_noise_rad[0], 0.0, 0.1),
            ("sweep_noise_rad[1]", self.sweep_noise_rad[1], 0.0, 0.1),
            ("sweep_noise_shared_frac", self.sweep_noise_shared_frac, 0.0, 1.0),
            ("sweep_loss_frac", self.sweep_loss_frac, 0.0, 1.0),
            ("station_position_error_m", self.station_position_error_m, 0.0, 1.0),
            ("station_rotation_error_rad", self.station_rotation_error_rad, 0.0, 0.2),
            ("sweep_distortion_rad", self.sweep_distortion_rad, 0.0, 0.1),
            ("sweep_distortion_length_rad", self.sweep_distortion_length_rad, 0.001, 100.0),
            ("uwb_rate_hz", self.uwb_rate_hz, 1.0, 2000.0),
            ("uwb_noise_m", self.uwb_noise_m, 0.0, 10.0),
            ("uwb_bias_m", self.uwb_bias_m, 0.0, 10.0),
            ("uwb_outlier_frac", self.uwb_outlier_frac, 0.0, 1.0),
            ("uwb_outlier_m", self.uwb_outlier_m, 0.0, 1000.0),
            ("barometer_noise_m", self.barometer_noise_m, 0.0, 100.0),
            ("barometer_drift_m_sqrt_s", self.barometer_drift_m_sqrt_s, 0.0, 100.0),
            ("gnss_noise_m", self.gnss_noise_m, 0.0, 100.0),
        ] {
            within(&format!("sensors.{key}"), value, min, max)?;
        }
        for (i, station) in self.stations.iter().enumerate() {
            station.check(&format!("sensors.stations[{i}]"))?;
        }
        for (i, anchor) in self.anchors_m.iter().enumerate() {
            for value in anchor {
                within(&format!("sensors.anchors_m[{i}]"), *value, -1e4, 1e4)?;
            }
        }
        self.check_numbers()
    }

    fn check_numbers(&self) -> Result<()> {
        let (stations, anchors) = match self.positioning {
            Positioning::Position | Positioning::Gnss => (0, 0),
            Positioning::CrossingBeams => (2, 0),
            Positioning::Sweeps => (1, 0),
            Positioning::UwbTwr => (0, 1),
            Positioning::UwbTdoa => (0, 2),
        };
        let counted = |key: &str, n: usize, least: usize, most: usize, hint: &str| {
            if (least..=most).contains(&n) {
                return Ok(());
            }
            Err(Error::input(key, format!("{n} of them"), format!("{least} to {most}"), hint))
        };
        let hint = "list base stations in the scene file, or read a Lighthouse configuration with \
                    --lighthouse";
        counted("sensors.stations", self.stations.len(), stations, MAX_STATIONS, hint)?;
        let hint = "list the anchors' places in the scene file";
        counted("sensors.anchors_m", self.anchors_m.len(), anchors, MAX_ANCHORS, hint)?;
        let n_v1 = self.stations.iter().filter(|s| s.generation == Generation::V1).count();
        let hint = "the first generation takes turns: one or two stations; use v2 for more";
        counted("sensors.stations, generation v1", n_v1, 0, 2, hint)
    }
}
