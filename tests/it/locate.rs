//! Tests of `noctograph locate` with logs of different clocks, biased links and mirror images.
//!
//! The logs contain true ranges with noise from a fixed seed.

use std::fmt::Write;
use std::path::Path;

use predicates::prelude::PredicateBooleanExt as _;
use predicates::str::contains;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};
use serde_json::Value;

use crate::cli::{fails, noctograph, run_json};

/// Anchors in the corners of a room, four at the top and four at the bottom.
const ANCHORS: [[f64; 3]; 8] = [
    [-2.5, -2.5, 2.4],
    [2.5, -2.5, 2.4],
    [2.5, 2.5, 2.4],
    [-2.5, 2.5, 2.4],
    [-2.5, -2.5, 0.2],
    [2.5, -2.5, 0.2],
    [2.5, 2.5, 0.2],
    [-2.5, 2.5, 0.2],
];
const SIGMA_M: f64 = 0.06;
const SIGMA: [&str; 2] = ["--set", "observer.ekf.two_way_sigma_m=0.06"];
/// Number of ranges per second that a drone measures.
const RATE_HZ: f64 = 100.0;

fn place(drone: usize, time_s: f64) -> [f64; 3] {
    let phase = 1.9 * drone as f64;
    let wave = |rate: f64| libm::sin(rate * time_s + phase);
    [0.8 * wave(0.7), 0.4 * wave(1.1), 1.0 + 0.4 * wave(0.9)]
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| libm::pow(a[k] - b[k], 2.0)).sum::<f64>().sqrt()
}

/// A drone's log of ranges to each anchor in turn and, after each round, to the other drone.
struct Log<'a> {
    drone: usize,
    anchors: &'a [usize],
    peer: bool,
    /// True time at which the log begins, in s.
    from_s: f64,
    to_s: f64,
    /// Bias that is added to an anchor's ranges, in m.
    bias_m: fn(usize, f64) -> f64,
    seed: u64,
}

impl Default for Log<'_> {
    fn default() -> Self {
        let anchors = &[0, 1, 2, 3, 4, 5, 6, 7];
        let bias_m = |_, _| 0.0;
        Self { drone: 0, anchors, peer: false, from_s: 0.0, to_s: 20.0, bias_m, seed: 3 }
    }
}

impl Log<'_> {
    /// Returns the log as CSV, with timestamps that `stamp` formats from the true time.
    fn csv(&self, stamp: impl Fn(f64) -> String) -> String {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut normal = || -> f64 { (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0 };
        let mut text = "timestamp".to_owned();
        self.anchors.iter().for_each(|k| write!(text, ",ranging.distance{k}").unwrap());
        let other = 1 - self.drone;
        if self.peer {
            write!(text, ",ranging.drone{}", other + 1).unwrap();
        }
        text.push('\n');
        let n = self.anchors.len() + usize::from(self.peer);
        let mut held = vec![0.0; n];
        #[expect(clippy::cast_possible_truncation, reason = "a minute")]
        let rows = ((self.to_s - self.from_s) * RATE_HZ) as usize;
        for row in 0..rows {
            let time_s = self.from_s + row as f64 / RATE_HZ;
            let here = place(self.drone, time_s);
            held[row % n] = SIGMA_M * normal()
                + match self.anchors.get(row % n) {
                    Some(k) => distance_m(here, ANCHORS[*k]) + (self.bias_m)(*k, time_s),
                    None => distance_m(here, place(other, time_s)),
                };
            let cells: Vec<String> = held.iter().map(|range| format!("{range:.4}")).collect();
            writeln!(text, "{},{}", stamp(time_s), cells.join(",")).unwrap();
        }
        text
    }
}

fn clock(time_s: f64) -> String {
    format!("2023-05-04 12:00:{time_s:09.6}")
}

fn numbers(time_s: f64) -> String {
    format!("{time_s:.3}")
}

/// Returns a folder with the anchors, the true flights, and the given logs as log-1.csv and so on.
fn folder(logs: &[String]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    for (k, log) in logs.iter().enumerate() {
        write(&format!("log-{}.csv", k + 1), log);
    }
    for drone in 0..2 {
        let mut flight = "t,x,y,z\n".to_owned();
        for row in 0..2500 {
            let time_s = f64::from(row) / 100.0;
            let [x, y, z] = place(drone, time_s);
            writeln!(flight, "{time_s:.3},{x},{y},{z}").unwrap();
        }
        write(&format!("true-{}.csv", drone + 1), &flight);
    }
    let mut anchors = String::new();
    for (index, [x, y, z]) in ANCHORS.iter().enumerate() {
        writeln!(anchors, "{index}:\n  x: {x:?}\n  y: {y:?}\n  z: {z:?}").unwrap();
    }
    write("anchors.yaml", &anchors);
    folder
}

/// Returns the arguments for one or two logs with their references.
fn arguments<'a>(n: usize, more: &[&'a str]) -> Vec<&'a str> {
    let logs: &[&str] = if n == 1 { &["log-1.csv"] } else { &["log-1.csv", "log-2.csv"] };
    let references: &[&str] = if n == 1 {
        &["--reference", "true-1.csv"]
    } else {
        &["--reference", "true-1.csv", "--reference", "true-2.csv"]
    };
    // The axes are given, because the references never leave or reach the floor, from which the
    // vertical axis could be inferred.
    let told = &["--anchors", "anchors.yaml", "--axes", "z-up"];
    let all = [&["locate"], logs, references, told, &SIGMA, more];
    all.concat()
}

fn located(folder: &Path, n: usize, more: &[&str]) -> Value {
    run_json(folder, &arguments(n, more))
}

fn rmse_m(json: &Value) -> Vec<f64> {
    let rows = json["reference"].as_array().unwrap().iter();
    rows.map(|row| row["rmse_3d_m"].as_f64().unwrap()).collect()
}

/// Returns two drones' logs of ranges to anchors and to each other. The second begins `late_s`
/// later.
fn two(late_s: f64, stamp: impl Fn(f64) -> String + Copy) -> [String; 2] {
    let one = Log { peer: true, anchors: &[0, 1, 2, 4, 6], ..Log::default() };
    let two = Log { drone: 1, from_s: late_s, seed: 4, ..one };
    [one.csv(stamp), two.csv(stamp)]
}

#[test]
fn two_logs_on_one_clock_keep_it() {
    let [aligned, late, much] = [0.0, 0.78, 4.5].map(|late_s| {
        let folder = folder(&two(late_s, numbers));
        located(folder.path(), 2, &[])
    });
    assert!(rmse_m(&aligned)[1] < 0.05);
    for (json, late_s) in [(&late, 0.78), (&much, 4.5)] {
        for (rmse_m, aligned_m) in rmse_m(json).iter().zip(rmse_m(&aligned)) {
            assert!(*rmse_m < 1.2 * aligned_m, "{rmse_m} m, aligned {aligned_m} m");
        }
        let clock = &json["clocks"][1];
        assert!((clock["offset_s"].as_f64().unwrap() - late_s).abs() < 1e-6, "{clock}");
        assert_eq!(json["warnings"].as_array().unwrap().len(), 0, "{}", json["warnings"]);
    }
    // The second log begins earlier, so that offsets are relative to its start.
    let one = Log { peer: true, anchors: &[0, 1, 2, 4, 6], from_s: 0.78, ..Log::default() };
    let two = Log { drone: 1, from_s: 0.0, seed: 4, ..one };
    let json = located(folder(&[one.csv(numbers), two.csv(numbers)]).path(), 2, &[]);
    for (n, (file, offset_s)) in [("log-1.csv", 0.78), ("log-2.csv", 0.0)].into_iter().enumerate() {
        let clock = &json["clocks"][n];
        assert_eq!(clock["file"], file);
        assert!((clock["offset_s"].as_f64().unwrap() - offset_s).abs() < 1e-6, "{clock}");
    }
}

#[test]
fn logs_without_a_common_clock_are_refused_and_a_reference_asks_for_its_offset() {
    let [one, _] = two(0.0, clock);
    let [_, two_later] = two(0.78, |time_s| numbers(time_s + 500.0));
    let run = noctograph(folder(&[one, two_later]).path()).args(arguments(2, &[])).assert();
    run.code(2).stderr(contains("log-2.csv").and(contains("another clock")));

    let folder = folder(&two(0.78, |time_s| numbers(time_s + 100.0)));
    let run = noctograph(folder.path()).args(arguments(2, &[])).assert().code(2);
    run.stderr(contains("true-1.csv").and(contains("--offset")));
    let told = located(folder.path(), 2, &["--offset", "0", "--offset=-0.78"]);
    assert!(rmse_m(&told).iter().all(|rmse_m| *rmse_m < 0.05), "{:?}", rmse_m(&told));
    let once = arguments(2, &["--offset", "0"]);
    noctograph(folder.path()).args(once).assert().code(2).stderr(contains("1 for 2 references"));
}

#[test]
fn every_link_shows_its_residuals_and_a_biased_one_is_named() {
    let bias_m = |anchor, _| if anchor == 2 { 0.6 } else { 0.0 };
    let folder = folder(&[Log { bias_m, ..Log::default() }.csv(numbers)]);
    let json = located(folder.path(), 1, &[]);
    let links = json["residuals"].as_array().unwrap();
    assert_eq!(links.len(), 8);
    assert!(links.iter().any(|link| {
        link["link"] == "drone 1 to anchor 3 (distance2)" && link["suspect"] == true
    }));
    let run = noctograph(folder.path()).args(arguments(1, &[])).assert().success();
    run.stderr(contains("drone 1 to anchor 3 (distance2):").and(contains("biased")))
        .stdout(contains("residuals, cm"));
    // The noise in this log differs from the assumed noise.
    let folder = self::folder(&[Log::default().csv(numbers)]);
    let quiet = ["--set", "observer.ekf.two_way_sigma_m=0.25"];
    let run = noctograph(folder.path()).args(arguments(1, &quiet)).assert().success();
    run.stderr(contains("is below 0.").and(contains("the ranges scatter by about")));
    let loud = ["--set", "observer.ekf.two_way_sigma_m=0.03"];
    let run = noctograph(folder.path()).args(arguments(1, &loud)).assert().success();
    run.stderr(contains("is above 1."));
}

#[test]
fn of_two_mirror_images_the_one_within_the_room_is_taken() {
    for anchors in [&[0, 1, 2, 3][..], &[0, 1, 2]] {
        let folder = folder(&[Log { anchors, ..Log::default() }.csv(numbers)]);
        let json = located(folder.path(), 1, &["--within=-3,-3,0,3,3,2.3"]);
        assert!(rmse_m(&json)[0] < 0.08, "{:?}", rmse_m(&json));
        let above = located(folder.path(), 1, &["--within=-3,-3,2.5,3,3,9"]);
        assert!(rmse_m(&above)[0] > 1.0, "the mirror image: {:?}", rmse_m(&above));
    }
}

#[test]
fn sigma_of_ranges_is_said_to_have_an_effect_and_has_it() {
    let folder = folder(&[Log::default().csv(numbers)]);
    let run = noctograph(folder.path()).args(arguments(1, &[])).assert().success();
    run.stderr(contains("has no effect").not());
}

#[test]
fn the_range_of_a_pair_that_both_logs_hold_counts_once() {
    let [one, two] = two(0.0, numbers);
    // The second log repeats the first log's ranges between the drones.
    let column = |text: &str| {
        let cell = |line: &str| line.rsplit_once(',').unwrap().1.to_owned();
        text.lines().map(cell).collect::<Vec<_>>()
    };
    let shared = column(&one);
    let with = |(line, range): (&str, &String)| {
        let (rest, own) = line.rsplit_once(',').unwrap();
        let range = if own.starts_with("ranging") { own } else { range };
        format!("{rest},{range}\n")
    };
    let copied: String = two.lines().zip(&shared).map(with).collect();
    let without: String =
        two.lines().map(|line| format!("{}\n", line.rsplit_once(',').unwrap().0)).collect();
    let [both, alone] = [copied, without].map(|second| folder(&[one.clone(), second]));
    let [both, alone] = [&both, &alone].map(|f| located(f.path(), 2, &[]));
    assert_eq!(both["ranges"], alone["ranges"]);
    assert_eq!(both["reference"], alone["reference"]);
    let pairs = both["residuals"].as_array().unwrap().iter();
    let pairs = pairs.filter(|row| row["link"] == "drones 1 and 2").count();
    assert_eq!(pairs, 1);
}

#[test]
fn drones_and_anchors_count_from_one() {
    let log = Log::default().csv(numbers);
    let yaml = "0:\n  x: 0.0\n  y: 0.0\n  z: 0.0\n";
    let arguments = ["locate", "log.csv", "--anchors", "a.yaml"];
    let files = [("log.csv", log.as_str()), ("a.yaml", yaml)];
    fails(&arguments, &files, &["drone 1 to anchor 2 (distance1)", "1 anchors"]);
}
