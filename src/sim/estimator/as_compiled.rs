//! Tests of the firmware's filter against recordings of its own compiled C code
//! (tests/firmware/filter.c), with the motion and the noise below.

use nalgebra::{Matrix3, Vector3};

use super::Estimator;
use super::firmware::Firmware;
use crate::options::{FirmwareOptions, ObserverOptions};
use crate::sensors::{
    DECK_SENSORS_M, Generation, HeightSensor, Positioning, Range, Readings, SensorOptions, Station,
    StationPose, Sweep,
};
use crate::tests::Numbers;
use crate::vehicle::{RigidBody, attitude};
use noctograph_core::geometry::Attitude;
use noctograph_core::random::Noise;

const TICK_S: f64 = 0.002;

/// Returns `a sin³ wt` and its first two time derivatives. The harness computes the same
/// function.
fn bow(a: f64, w: f64, t: f64) -> [f64; 3] {
    let ((s, c), (s3, c3)) = (libm::sincos(w * t), libm::sincos(3.0 * w * t));
    [
        a * (3.0 * s - s3) / 4.0,
        a * w * (3.0 * c - 3.0 * c3) / 4.0,
        a * w * w * (9.0 * s3 - 3.0 * s) / 4.0,
    ]
}

/// Returns position, force per mass in the world frame, and attitude of a drone with drag whose
/// thrust is along its z axis, for a motion that is `hurry` times as fast.
fn motion(t: f64, hurry: f64) -> (Vector3<f64>, Vector3<f64>, Matrix3<f64>) {
    let axes = [bow(0.5, hurry * 0.7, t), bow(0.3, hurry * 0.9, t), bow(0.3, hurry * 0.5, t)];
    let [place_m, velocity_m_s, acceleration_m_s2] =
        [0, 1, 2].map(|order: usize| Vector3::from_fn(|axis, _| axes[axis][order]));
    let place_m = place_m + Vector3::z() * 0.8;
    let force_m_s2 = acceleration_m_s2 + Vector3::z() * 9.81;
    let up = (force_m_s2 + velocity_m_s * 0.45).normalize();
    let (sin, cos) = libm::sincos(bow(0.3, hurry * 0.4, t)[0]);
    let left = up.cross(&Vector3::new(cos, sin, 0.0)).normalize();
    (place_m, force_m_s2, Matrix3::from_columns(&[left.cross(&up), left, up]))
}

/// Differences between a filter and the harness's recording.
struct Apart {
    /// Root-mean-square differences of position in m, velocity in m/s, and angles in degrees.
    states: [f64; 3],
    /// Largest ratio of standard deviations, minus 1.
    worst_sigma: f64,
    /// Mean ratio of the position's standard deviations, minus 1. Single ratios may deviate more.
    mean_sigma: f64,
}

/// Runs the filter as the harness does, and compares it with the harness's recording.
fn compared(positioning: Positioning, hurry: f64, place_sigma_m: f64, recorded: &str) -> Apart {
    let sensors = SensorOptions { positioning, ..SensorOptions::default() };
    let firmware = FirmwareOptions { rotations_hz: 0.0, ..FirmwareOptions::default() };
    let mut observer = ObserverOptions { firmware, ..ObserverOptions::default() };
    observer.ekf.position_sigma_m = place_sigma_m;
    let start_m = Vector3::z() * 0.8;
    let mut filter = Firmware::new(&observer, &sensors, start_m, 0.0, Noise::new(0, 0, "none"));
    let places = [[-2.5, -2.2, 2.4], [2.8, 2.2, 2.4]];
    let stations = places
        .map(|place| StationPose::new(&Station::looking(Generation::V2, place, [0.15, 0.0, 0.75])));
    let anchors_m = sensors.uwb.anchors();
    let (hz, phase) = ([48e6 / 959_000.0, 48e6 / 957_000.0], [0.3, 0.75]);
    let (mut passed, mut heard, mut pairs) = ([0_u32; 2], [None; 2], 0_u32);
    let (mut numbers, mut ranged) = (Numbers(1), 0_usize);
    let mut rows = recorded.lines().filter(|line| !line.starts_with('#'));
    let (mut squares, mut worst, mut sum, mut n) = ([0.0; 3], 0.0_f64, 0.0, 0.0);

    let ticks = rows.clone().count() * 100;
    for k in 0..u32::try_from(ticks).unwrap() {
        let t = f64::from(k) * TICK_S;
        let h = 1e-4;
        let (place_m, force_m_s2, r) = motion(t, hurry);
        let spin = r.transpose() * (motion(t + h, hurry).2 - motion(t - h, hurry).2) / (2.0 * h);
        let rate = Vector3::new(spin[(2, 1)], spin[(0, 2)], spin[(1, 0)]);
        let rate = rate + Vector3::from_fn(|_, _| 0.004 * numbers.normal());
        let force = r.tr_mul(&force_m_s2);
        let force = force + Vector3::from_fn(|_, _| 0.03 * numbers.normal());

        let mut sweeps = Vec::new();
        for station in (0..2).filter(|_| positioning == Positioning::Sweeps) {
            loop {
                let (plane, turn) = (passed[station] % 2, passed[station] / 2);
                let turns = f64::from(turn) + phase[station] + f64::from(plane) / 3.0;
                if turns > t * hz[station] {
                    break;
                }
                passed[station] += 1;
                let plane = plane as usize;
                let shared = 2e-4 * numbers.normal();
                let angles_rad = DECK_SENSORS_M.map(|sensor| {
                    let at_m = place_m + r * Vector3::from(sensor);
                    let angle_rad = stations[station].crossing(plane, &at_m).angle_rad;
                    angle_rad + shared + 1e-4 * numbers.normal()
                });
                if numbers.uniform() < 0.13 {
                    continue;
                }
                if plane == 0 {
                    heard[station] = Some((turn, angles_rad));
                    continue;
                }
                // Every second pair is used. Both sweeps of a pair are passed on together.
                let Some((_, first)) = heard[station].filter(|(then, _)| *then == turn) else {
                    continue;
                };
                if pairs.is_multiple_of(2) {
                    sweeps.push(Sweep { station, plane: 0, angles_rad: first });
                    sweeps.push(Sweep { station, plane: 1, angles_rad });
                }
                pairs += 1;
            }
        }
        let position_m = (positioning == Positioning::Position && k % 10 == 0)
            .then(|| place_m + Vector3::from_fn(|_, _| 0.3 * place_sigma_m * numbers.normal()));
        let mut ranges = Vec::new();
        let differs = positioning == Positioning::UwbTdoa;
        if (differs || positioning == Positioning::UwbTwr) && k % 3 == 0 {
            let (anchor, next) = (ranged % 8, (ranged + 1) % 8);
            let distance_m = |anchor: usize| (place_m - anchors_m[anchor]).norm();
            let astray_m = if ranged % 10 == 9 { 1.0 } else { 0.0 };
            let minus = differs.then_some(next);
            let true_m = distance_m(anchor) - minus.map_or(0.0, distance_m);
            let distance_m = true_m + 0.06 * numbers.normal() + astray_m;
            ranges.push(Range { anchor, minus, distance_m });
            ranged += 1;
        }
        let distance_m = (positioning == Positioning::UwbTwr && k % 12 == 0)
            .then(|| place_m.z / r[(2, 2)] + 0.0025 * numbers.normal());
        let heights: Vec<_> =
            distance_m.map(|m| (HeightSensor::TimeOfFlight, m)).into_iter().collect();
        let truth = RigidBody::resting_at(place_m);
        let readings = Readings {
            throttle: 0.5,
            position_m,
            sweeps: &sweeps,
            ranges: &ranges,
            heights: &heights,
            ..Readings::inertial(&truth, rate, force)
        };
        filter.update(&readings, TICK_S);
        if k % 100 != 99 {
            continue;
        }
        let row: Vec<f64> =
            rows.next().unwrap().split(' ').map(|value| value.parse().unwrap()).collect();
        assert_eq!(row[0], f64::from(k));
        let state = filter.state();
        let Attitude { yaw_rad, pitch_rad, roll_rad } = attitude(&state);
        let estimated = [
            [state[0], state[1], state[2]],
            [state[6], state[7], state[8]],
            [yaw_rad, pitch_rad, roll_rad].map(f64::to_degrees),
        ];
        for (part, estimated) in estimated.iter().enumerate() {
            let errors = (0..3).map(|i| (estimated[i] - row[1 + 3 * part + i]).powi(2));
            squares[part] += errors.sum::<f64>() / 3.0;
        }
        for (state, want) in row[10..].iter().enumerate() {
            let ratio = (filter.normal.sigma(state) / want).ln();
            worst = worst.max(ratio.abs());
            sum += if state < 3 { ratio / 3.0 } else { 0.0 };
        }
        n += 1.0;
    }
    Apart {
        states: squares.map(|square| (square / n).sqrt()),
        worst_sigma: worst.exp() - 1.0,
        mean_sigma: (sum / n).exp() - 1.0,
    }
}

#[test]
fn states_and_standard_deviations_are_those_of_the_firmwares_own_code() {
    use Positioning::{Position, Sweeps, UwbTdoa, UwbTwr};
    for (name, positioning, hurry, place_sigma_m, recorded) in [
        ("sweeps", Sweeps, 1.0, 0.01, include_str!("recorded/sweeps.txt")),
        ("ranges", UwbTwr, 1.0, 0.01, include_str!("recorded/ranges.txt")),
        ("tilts", UwbTwr, 2.0, 0.01, include_str!("recorded/tilts.txt")),
        ("differences", UwbTdoa, 1.0, 0.01, include_str!("recorded/differences.txt")),
        ("positions", Position, 1.0, 0.01, include_str!("recorded/positions.txt")),
        ("precise", Position, 1.0, 2e-4, include_str!("recorded/precise.txt")),
    ] {
        let apart = compared(positioning, hurry, place_sigma_m, recorded);
        let [position_m, velocity_m_s, angle_deg] = apart.states;
        let [worst, mean] = [apart.worst_sigma, apart.mean_sigma].map(|ratio| 1e2 * ratio);
        println!(
            "{name}: {:.3} mm, {:.3} mm/s, {angle_deg:.4} deg, sigma {worst:.3} %, mean {mean:.4} %",
            position_m * 1e3,
            velocity_m_s * 1e3,
        );
        assert!(position_m < 1e-4, "{name}: {position_m} m");
        assert!(velocity_m_s < 5e-4, "{name}: {velocity_m_s} m/s");
        assert!(angle_deg < 5e-3, "{name}: {angle_deg} deg");
        assert!(worst < 1.0, "{name}: {worst} %");
        assert!(mean.abs() < 0.1, "{name}: {mean} %");
    }
}
