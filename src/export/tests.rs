//! What the tests of trajectories share: random plans, and recorded answers of outside programs to
//! our files.
//!
//! A recorded file has comment lines (`#`) with the program and its version, a line `bytes` in
//! hexadecimal, and rows of the time in s with position, velocity and acceleration in m and s.

use nalgebra::Vector3;
use proptest::array::uniform3;
use proptest::strategy::Strategy;

use super::compressed::{Axis, Compressed, Piece};
use super::pieces::{Polynomials, Stretch, motion};
use noctograph_plan::{Plan, PlanData, Setpoint};

/// A time, and position, velocity and acceleration at it.
pub(super) type Row = (f64, [Vector3<f64>; 3]);

/// The bytes that the program was given, and its answers.
pub(super) fn read(text: &str) -> (Vec<u8>, Vec<Row>) {
    let mut bytes = Vec::new();
    let mut rows = Vec::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        if let Some(hex) = line.strip_prefix("bytes ") {
            let byte = |offset: usize| u8::from_str_radix(&hex[offset..offset + 2], 16).unwrap();
            bytes.extend((0..hex.len()).step_by(2).map(byte));
        } else {
            let n: Vec<f64> = line.split_whitespace().map(|n| n.parse().unwrap()).collect();
            let vector = |offset: usize| Vector3::new(n[offset], n[offset + 1], n[offset + 2]);
            rows.push((n[0], [vector(1), vector(4), vector(7)]));
        }
    }
    assert!(rows.len() >= 20, "{} rows", rows.len());
    (bytes, rows)
}

/// A trajectory from its bytes.
pub(super) fn decoded(bytes: &[u8]) -> Compressed {
    let int16 = |offset: usize| i16::from_le_bytes([bytes[offset], bytes[offset + 1]]);
    let (mut start_mm, yaw, mut offset) = ([0, 2, 4].map(int16), int16(6), 8);
    let mut pieces = Vec::new();
    while bytes[offset + 1..offset + 3] != [0; 2] {
        let (header, duration_ms) = (bytes[offset], int16(offset + 1).cast_unsigned());
        offset += 3;
        let axes = [0, 2, 4].map(|shift| {
            let n = [0, 1, 3, 7][usize::from(header >> shift & 3)];
            let points_mm: Vec<i16> = (0..n).map(|k| int16(offset + 2 * k)).collect();
            offset += 2 * n;
            match points_mm[..] {
                [] => Axis::Constant,
                [end_mm] => Axis::Linear(end_mm),
                _ => Axis::Cubic(points_mm.try_into().expect("no axis of degree 7")),
            }
        });
        pieces.push(Piece { start_mm, duration_ms, axes });
        start_mm = pieces[pieces.len() - 1].end_mm();
    }
    assert_eq!(bytes[offset..], [0; 3], "the end");
    Compressed { pieces, yaw }
}

/// Whether our evaluation gives the recorded answers, within the single precision of the programs:
/// of a time of 35 s it is 4 µs, in which a drone flies 1 µm.
pub(super) fn assert_same(rows: &[Row], pieces: &[Polynomials]) {
    for (time_s, want) in rows {
        let answer = motion(pieces, *time_s);
        for (k, tolerance) in [2e-6, 2e-5, 1e-3].into_iter().enumerate() {
            let error = (answer[k] - want[k]).norm();
            assert!(error <= tolerance, "derivative {k} at {time_s} s: {error}");
        }
    }
}

/// Largest distance of a trajectory from the design where pieces are held against it as they are
/// made, m.
pub(super) fn checked_m(stretch: &Stretch, pieces: &[Polynomials]) -> f64 {
    let off_m = |t: f64| (motion(pieces, t)[0] - stretch.position_m(t)).norm();
    stretch.check_times_s(0, stretch.last()).map(off_m).fold(0.0, f64::max)
}

/// Random plans of sine waves about (1, 1, 1) m, for tests.
pub(super) fn waves() -> impl Strategy<Value = Plan> {
    let shape =
        (uniform3(0.2..0.6_f64), uniform3(0.02..1.0_f64), uniform3(0.0..std::f64::consts::TAU));
    (shape, 20..120_u32, 0.02..0.05_f64).prop_map(|((size_m, speed_m_s, phase), n, step_s)| {
        let rate: [f64; 3] = std::array::from_fn(|axis| speed_m_s[axis] / size_m[axis]);
        let setpoint = |k: u32| {
            let time_s = step_s * f64::from(k);
            let wave = |i: usize| libm::sincos(rate[i] * time_s + phase[i]);
            let each = |value: &dyn Fn(usize) -> f64| Vector3::new(value(0), value(1), value(2));
            Setpoint {
                time_s,
                position_m: each(&|i| 1.0 + size_m[i] * wave(i).0),
                velocity_m_s: each(&|i| size_m[i] * rate[i] * wave(i).1),
                acceleration_m_s2: each(&|i| -size_m[i] * rate[i] * rate[i] * wave(i).0),
                letter: Some(0),
            }
        };
        Plan::made(PlanData { setpoints: (0..n).map(setpoint).collect(), ..PlanData::default() })
    })
}

#[test]
fn a_name_keeps_its_letters_in_the_name_of_a_file() {
    for (word, name) in [
        ("Łódź", "Lodz"),
        ("Bjørn", "Bjorn"),
        ("Strauß", "Strauss"),
        ("José 2", "Jose2"),
        ("Ægir", "AEgir"),
        ("ΑΘΗΝΑ", "drawing"),
        ("", "drawing"),
    ] {
        assert_eq!(crate::stem(word), name);
    }
}
