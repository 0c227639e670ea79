//! Compares the verdicts on ten faults at six levels with `golden/score/faults.txt`. The
//! photographs are simulated, with three words per cell of the table.
//!
//! `cargo run --release --example faults -- sheet` shows the photographs.

use bench::{FAULTS, LEVELS, WORDS, table};

use crate::golden::assert_golden;

#[path = "../../examples/faults/bench.rs"]
mod bench;

/// Returns the mean probability in a line of the table.
fn probability(line: &str) -> f64 {
    line.split('|').nth(1).unwrap().trim().parse().unwrap()
}

#[test]
fn every_fault_takes_probability_level_by_level() {
    let found = table(&FAULTS).unwrap();
    assert_golden("score/faults.txt", &found);
    let lines: Vec<&str> = found.lines().collect();
    assert_eq!(lines.len(), 2 + FAULTS.len() * LEVELS, "a head, the clean word, and every level");
    assert!(lines[1].starts_with("none") && WORDS.iter().all(|word| lines[1].contains(word)));
    let clean = probability(lines[1]);
    assert!(clean > 0.8, "clean: {clean}");
    for (fault, lines) in FAULTS.iter().zip(lines[2..].chunks(LEVELS)) {
        let falling: Vec<f64> = lines.iter().map(|line| probability(line)).collect();
        // The readability may rise slightly from one level to the next. Near the readability of
        // clean words, the cause is the photo's noise. In addition, a letter with one half missing
        // may be less conclusive than one with two thirds missing.
        let gain = falling.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::MIN, f64::max);
        assert!(gain <= 0.12, "{}: {falling:?}, a worse level gains {gain}", fault.name);
        assert!(falling[LEVELS - 1] < 0.7, "{} at its worst: {falling:?}", fault.name);
    }
}
