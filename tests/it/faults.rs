//! The verdict on ten faults at six levels each, `golden/score/faults.txt`: photographs that the
//! simulator, its lamps and its camera make, of three words a cell.
//!
//! `cargo run --release --example faults -- sheet` shows the photographs.

use bench::{FAULTS, LEVELS, WORDS, table};

use crate::golden::assert_golden;

#[path = "../../examples/faults/bench.rs"]
mod bench;

/// The mean probability in a line of the table.
fn probability(line: &str) -> f64 {
    line.split('|').nth(1).unwrap().trim().parse().unwrap()
}

/// Spearman's rank correlation of six values with their order.
fn rank_correlation(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let rank = |value: f64| {
        let below = values.iter().filter(|other| **other < value).count() as f64;
        let same = values.iter().filter(|other| **other == value).count() as f64;
        below + 0.5 * (same - 1.0)
    };
    let middle = 0.5 * (n - 1.0);
    let ranks: Vec<f64> = values.iter().map(|value| rank(*value) - middle).collect();
    let order: Vec<f64> = (0..values.len()).map(|index| index as f64 - middle).collect();
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    product(&ranks, &order) / (product(&ranks, &ranks) * product(&order, &order)).sqrt()
}

#[test]
fn every_fault_takes_probability_level_by_level() {
    let found = table(&FAULTS).unwrap();
    let lines: Vec<&str> = found.lines().collect();
    assert_eq!(lines.len(), 2 + FAULTS.len() * LEVELS, "a head, the clean word, and every level");
    assert!(lines[1].starts_with("none") && WORDS.iter().all(|word| lines[1].contains(word)));
    let clean = probability(lines[1]);
    assert!(clean > 0.8, "clean: {clean}");
    for (fault, lines) in FAULTS.iter().zip(lines[2..].chunks(LEVELS)) {
        let falling: Vec<f64> = lines.iter().map(|line| probability(line)).collect();
        let rho = rank_correlation(&falling);
        assert!(rho <= -0.9, "{}: {falling:?}, rank correlation {rho}", fault.name);
        assert!(falling[LEVELS - 1] < 0.5, "{} at its worst: {falling:?}", fault.name);
    }
    assert_golden("score/faults.txt", &found);
}
