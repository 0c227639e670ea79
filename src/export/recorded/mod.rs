//! Answers of outside programs to our files: for tests.
//!
//! A recorded file has comment lines (`#`) with the program and its version, a line `bytes` in
//! hexadecimal, and rows of the time in s with position, velocity and acceleration in m and s.

use nalgebra::Vector3;

use super::pieces::{Polynomials, motion};

/// A time, and position, velocity and acceleration at it.
pub(super) type Row = (f64, [Vector3<f64>; 3]);

/// The bytes that the program was given, and its answers.
pub(super) fn read(text: &str) -> (Vec<u8>, Vec<Row>) {
    let mut bytes = Vec::new();
    let mut rows = Vec::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        if let Some(hex) = line.strip_prefix("bytes ") {
            let byte = |at: usize| u8::from_str_radix(&hex[at..at + 2], 16).unwrap();
            bytes.extend((0..hex.len()).step_by(2).map(byte));
        } else {
            let n: Vec<f64> = line.split_whitespace().map(|n| n.parse().unwrap()).collect();
            let vector = |at: usize| Vector3::new(n[at], n[at + 1], n[at + 2]);
            rows.push((n[0], [vector(1), vector(4), vector(7)]));
        }
    }
    assert!(rows.len() >= 20, "{} rows", rows.len());
    (bytes, rows)
}

/// Whether our evaluation gives the recorded answers, within the single precision of the programs:
/// of a time of 35 s it is 4 µs, in which a drone flies 1 µm.
pub(super) fn assert_same(rows: &[Row], pieces: &[Polynomials]) {
    for (time_s, want) in rows {
        let answer = motion(pieces, *time_s);
        for (k, tolerance) in [2e-6, 2e-5, 1e-3].into_iter().enumerate() {
            let off = (answer[k] - want[k]).norm();
            assert!(off <= tolerance, "derivative {k} at {time_s} s: {off}");
        }
    }
}
