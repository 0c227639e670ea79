//! What `noctograph locate` knows that it does not know: clocks, biased links, mirror images.
//!
//! Logs are made of true ranges with noise of a fixed seed.

use std::fmt::Write;
use std::path::Path;

use predicates::prelude::PredicateBooleanExt as _;
use predicates::str::contains;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};
use serde_json::Value;

use crate::cli::{fails, noctograph, run_json};

/// Corners of a room: four above, four below.
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
/// Ranges of a drone each second.
const RATE_HZ: f64 = 100.0;

fn place(drone: usize, time_s: f64) -> [f64; 3] {
    let phase = 1.9 * drone as f64;
    let wave = |rate: f64| libm::sin(rate * time_s + phase);
    [0.8 * wave(0.7), 0.4 * wave(1.1), 1.0 + 0.4 * wave(0.9)]
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| libm::pow(a[k] - b[k], 2.0)).sum::<f64>().sqrt()
}

/// A drone's log: its anchors in turn and, after each round, the other drone.
struct Log<'a> {
    drone: usize,
    anchors: &'a [usize],
    peer: bool,
    /// Of the true time.
    from_s: f64,
    to_s: f64,
    /// Added to an anchor's ranges.
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
    /// As CSV; `stamp` writes the true time.
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

/// A folder with the anchors, the true flights and these logs as log-1.csv and so on.
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

/// The arguments for one log or two, with the references.
fn arguments<'a>(n: usize, more: &[&'a str]) -> Vec<&'a str> {
    let logs: &[&str] = if n == 1 { &["log-1.csv"] } else { &["log-1.csv", "log-2.csv"] };
    let references: &[&str] = if n == 1 {
        &["--reference", "true-1.csv"]
    } else {
        &["--reference", "true-1.csv", "--reference", "true-2.csv"]
    };
    // The references fly in the air, where nothing tells which axis is up.
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

fn nees(json: &Value) -> f64 {
    json["reference"][0]["nees"].as_f64().unwrap()
}

/// Two drones with anchors and each other, the second log beginning `late_s` later.
fn two(late_s: f64, stamps: [fn(f64) -> String; 2]) -> [String; 2] {
    let one = Log { peer: true, anchors: &[0, 1, 2, 4, 6], ..Log::default() };
    let two = Log { drone: 1, from_s: late_s, seed: 4, ..one };
    let [stamp_1, stamp_2] = stamps;
    [one.csv(stamp_1), two.csv(stamp_2)]
}

#[test]
fn two_logs_on_one_clock_keep_it() {
    let aligned = two(0.0, [clock, clock]);
    let late = two(0.78, [clock, clock]);
    let much = two(4.5, [clock, clock]);
    let [aligned, late, much] = [aligned, late, much].map(|logs| folder(&logs));
    let [aligned, late, much] = [&aligned, &late, &much].map(|f| located(f.path(), 2, &[]));
    for json in [&aligned, &late, &much] {
        println!("{:?} NEES {} NIS {}", rmse_m(json), nees(json), json["nis"]);
    }
    assert!(rmse_m(&aligned)[1] < 0.05);
    for (json, late_s) in [(&late, 0.78), (&much, 4.5)] {
        for (rmse_m, aligned_m) in rmse_m(json).iter().zip(rmse_m(&aligned)) {
            assert!(*rmse_m < 1.2 * aligned_m, "{rmse_m} m, aligned {aligned_m} m");
        }
        let clock = &json["clocks"][0];
        assert_eq!(clock["how"], "common");
        assert!((clock["offset_s"].as_f64().unwrap() - late_s).abs() < 1e-6, "{clock}");
        assert_eq!(json["warnings"].as_array().unwrap().len(), 0, "{}", json["warnings"]);
    }
    // The second log begins first: offsets are those to its begin.
    let one = Log { peer: true, anchors: &[0, 1, 2, 4, 6], from_s: 0.78, ..Log::default() };
    let two = Log { drone: 1, from_s: 0.0, seed: 4, ..one };
    let json = located(folder(&[one.csv(clock), two.csv(clock)]).path(), 2, &[]);
    for (n, (file, offset_s)) in [("log-1.csv", 0.78), ("log-2.csv", 0.0)].into_iter().enumerate() {
        let clock = &json["clocks"][n];
        assert_eq!(clock["file"], file);
        assert!((clock["offset_s"].as_f64().unwrap() - offset_s).abs() < 1e-6, "{clock}");
    }
}

#[test]
fn logs_on_clocks_of_their_own_are_aligned_by_the_range_between_the_drones() {
    // A date and a number; or told that one clock is none.
    let apart = folder(&two(0.78, [clock, |time_s| numbers(time_s + 500.0)]));
    let told = folder(&two(0.78, [|time_s| numbers(time_s), |time_s| numbers(time_s - 0.78)]));
    // The references are on the first clock.
    let told_so = ["--clocks", "separate", "--offset", "0", "--offset=-0.78"];
    for (folder, more) in [(&apart, &[][..]), (&told, &told_so)] {
        let json = located(folder.path(), 2, more);
        let clock = &json["clocks"][0];
        assert_eq!(clock["how"], "estimated");
        let offset_s = clock["offset_s"].as_f64().unwrap();
        println!("{offset_s} s, {:?}", rmse_m(&json));
        assert!((offset_s - 0.78).abs() < 0.03, "{offset_s}");
        assert!(rmse_m(&json).iter().all(|rmse_m| *rmse_m < 0.05), "{:?}", rmse_m(&json));
    }
    let run = noctograph(apart.path()).args(arguments(2, &[])).assert().success();
    run.stdout(contains("log-2.csv: a clock of its own, offset estimated: +0.7"));
    // Taken for one clock, they contradict each other.
    let run = noctograph(told.path()).args(arguments(2, &[])).assert().success();
    run.stderr(contains("drones 1 and 2: left out").and(contains("clocks that do")));
    let still = folder(&[
        Log { peer: true, anchors: &[0, 1], ..Log::default() }.csv(clock),
        Log { peer: true, anchors: &[0, 1], drone: 1, ..Log::default() }.csv(numbers),
    ]);
    let refused = noctograph(still.path()).args(arguments(2, &[])).assert().code(2);
    refused.stderr(contains("no clock in common"));
}

#[test]
fn each_reference_has_a_clock_and_an_offset_of_its_own() {
    let logs = two(0.78, [|t| numbers(t + 100.0), |t| numbers(t + 100.0)]);
    let folder = folder(&logs);
    let estimated = located(folder.path(), 2, &[]);
    for (k, row) in estimated["clocks"].as_array().unwrap().iter().skip(1).enumerate() {
        assert_eq!(row["how"], "estimated", "{k}");
        assert!(row["offset_s"].as_f64().unwrap().abs() < 0.02, "{row}");
    }
    let told = located(folder.path(), 2, &["--offset", "0", "--offset=-0.78"]);
    assert!(rmse_m(&told).iter().all(|rmse_m| *rmse_m < 0.05), "{:?}", rmse_m(&told));
    // On the clock of the logs.
    let text = std::fs::read_to_string(folder.path().join("true-2.csv")).unwrap();
    let dated = |line: &str| match line.split_once(',') {
        Some(("t", _)) | None => format!("{line}\n"),
        Some((time, rest)) => format!("{},{rest}\n", 100.0 + time.parse::<f64>().unwrap()),
    };
    std::fs::write(folder.path().join("true-2.csv"), text.lines().map(dated).collect::<String>())
        .unwrap();
    let mixed = located(folder.path(), 2, &[]);
    assert_eq!(mixed["clocks"][2]["how"], "common");
    assert!(rmse_m(&mixed).iter().all(|rmse_m| *rmse_m < 0.05), "{:?}", rmse_m(&mixed));
    let wrong = arguments(2, &["--offset", "0", "--offset=0.5"]);
    let run = noctograph(folder.path()).args(wrong).assert().success();
    run.stderr(contains("its clock is not that of the log"));
    let once = arguments(2, &["--offset", "0"]);
    noctograph(folder.path()).args(once).assert().code(2).stderr(contains("1 for 2 references"));
}

/// The biases that were taken off, by their names.
fn biases(json: &Value) -> Vec<(String, f64)> {
    let rows = json["biases"].as_array().unwrap().iter();
    rows.map(|row| (row["of"].as_str().unwrap().to_owned(), row["bias_m"].as_f64().unwrap()))
        .collect()
}

#[test]
fn a_biased_link_is_named_and_taken_off() {
    let one = |anchor, _| if anchor == 2 { 0.6 } else { 0.0 };
    let two = |anchor, _| [0.0, 0.0, 0.6, 0.0, 0.0, -0.4, 0.0, 0.0][anchor];
    let same_side = |anchor, _| [0.0, 0.0, 0.6, 0.5, 0.0, 0.0, 0.0, 0.0][anchor];
    let all = |_, _| 0.5;
    type Case<'a> = (fn(usize, f64) -> f64, &'a [(&'a str, f64)]);
    let cases: [Case<'_>; 5] = [
        (|_, _| 0.0, &[]),
        (one, &[("drone 1 to anchor 3 (distance2)", 0.6)]),
        (
            two,
            &[("drone 1 to anchor 3 (distance2)", 0.6), ("drone 1 to anchor 6 (distance5)", -0.4)],
        ),
        (
            same_side,
            &[("drone 1 to anchor 3 (distance2)", 0.6), ("drone 1 to anchor 4 (distance3)", 0.5)],
        ),
        (all, &[("all anchors of drone 1", 0.5)]),
    ];
    for (bias_m, wanted) in cases {
        for seed in [3, 4, 5] {
            let folder = folder(&[Log { bias_m, seed, ..Log::default() }.csv(clock)]);
            for observer in ["smooth", "filter"] {
                let json = located(folder.path(), 1, &["--observer", observer]);
                let (found, nees) = (biases(&json), nees(&json));
                println!("{wanted:?} {observer}: {:?} NEES {nees} {found:?}", rmse_m(&json));
                assert_eq!(found.len(), wanted.len(), "{found:?}, wanted {wanted:?}");
                for ((name, bias_m), (wanted, wanted_m)) in found.iter().zip(wanted) {
                    assert_eq!(name, wanted);
                    assert!((bias_m - wanted_m).abs() < 0.04, "{name}: {bias_m} m");
                }
                let most_m = if observer == "smooth" { 0.045 } else { 0.08 };
                assert!(rmse_m(&json)[0] < most_m, "{:?}", rmse_m(&json));
                assert!((0.2..2.0).contains(&nees), "NEES {nees}");
                assert_eq!(json["warnings"].as_array().unwrap().len(), 0, "{json}");
            }
        }
    }
}

#[test]
fn a_biased_link_of_four_is_named_or_the_covariance_holds_the_doubt() {
    for biased in 0..4_usize {
        let bias_m: [fn(usize, f64) -> f64; 4] = [
            |anchor, _| if anchor == 0 { 0.6 } else { 0.0 },
            |anchor, _| if anchor == 5 { 0.6 } else { 0.0 },
            |anchor, _| if anchor == 2 { 0.6 } else { 0.0 },
            |anchor, _| if anchor == 7 { 0.6 } else { 0.0 },
        ];
        let anchors = &[0, 5, 2, 7];
        let log = Log { anchors, bias_m: bias_m[biased], ..Log::default() };
        let folder = folder(&[log.csv(clock)]);
        let json = located(folder.path(), 1, &[]);
        let (found, nees) = (biases(&json), nees(&json));
        println!("{biased}: {:?} NEES {nees} {found:?}", rmse_m(&json));
        println!("{:?}", json["sigma_median_m"]);
        let name = format!("drone 1 to anchor {} (", anchors[biased] + 1);
        assert!(found.iter().any(|(found, _)| found.starts_with(&name)), "{found:?}");
        assert!(nees < 3.0, "NEES {nees}");
    }
}

#[test]
fn every_link_shows_its_residuals_and_what_no_bias_explains_is_left_out() {
    // An obstacle for a third of the flight.
    let bias_m = |anchor, time_s| if anchor == 2 && time_s > 13.0 { 0.8 } else { 0.0 };
    let folder = folder(&[Log { bias_m, ..Log::default() }.csv(clock)]);
    let json = located(folder.path(), 1, &[]);
    println!("{:?} NEES {} {}", rmse_m(&json), nees(&json), json["biases"]);
    let links = json["residuals"].as_array().unwrap();
    assert_eq!(links.len(), 8);
    println!("{links:?}");
    assert!(links.iter().any(|link| {
        link["link"] == "drone 1 to anchor 3 (distance2)" && link["suspect"] == true
    }));
    let run = noctograph(folder.path()).args(arguments(1, &[])).assert().success();
    run.stderr(contains("drone 1 to anchor 3 (distance2): left out")).stdout(
        contains("residuals, cm").and(contains("left out  drone 1 to anchor 3 (distance2)")),
    );
    assert!(rmse_m(&json)[0] < 0.045 && nees(&json) < 2.0, "{json}");
    // Noise that is not as assumed.
    let folder = self::folder(&[Log::default().csv(clock)]);
    let quiet = ["--set", "observer.ekf.two_way_sigma_m=0.25"];
    let run = noctograph(folder.path()).args(arguments(1, &quiet)).assert().success();
    run.stderr(contains("is below 0.").and(contains("the ranges scatter by about")));
    let loud = ["--set", "observer.ekf.two_way_sigma_m=0.03"];
    let run = noctograph(folder.path()).args(arguments(1, &loud)).assert().success();
    run.stderr(contains("is above 1."));
}

/// Start and end of the ambiguities of a drone.
fn ambiguous(folder: &Path, n: usize, more: &[&str]) -> Vec<(u64, f64, f64)> {
    let arguments = arguments(n, more);
    let run = noctograph(folder).args([&arguments[..], &["--json"]].concat()).assert();
    let output = run.get_output();
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let rows = json["ambiguities"].as_array().unwrap();
    assert_eq!(output.status.code(), Some(i32::from(!rows.is_empty())), "{json}");
    let row = |row: &Value| {
        let number = |key: &str| row[key].as_f64().unwrap();
        (row["drone"].as_u64().unwrap(), number("from_s"), number("to_s"))
    };
    rows.iter().map(row).collect()
}

#[test]
fn mirror_images_are_looked_for_among_the_anchors_that_are_heard() {
    let one = |anchors| folder(&[Log { anchors, ..Log::default() }.csv(clock)]);
    // Eight anchors stand in the file, of which these are heard.
    assert_eq!(ambiguous(one(&[0, 1, 2, 3, 4, 5, 6, 7]).path(), 1, &[]), []);
    assert_eq!(ambiguous(one(&[0, 5, 2, 7]).path(), 1, &[]), []);
    for anchors in [&[0, 1, 2, 3][..], &[0, 1, 2]] {
        let flat = one(anchors);
        let [(1, from_s, to_s)] = ambiguous(flat.path(), 1, &[])[..] else { panic!("one") };
        assert!(from_s < 1e-6 && to_s > 19.9, "{from_s} to {to_s}");
        let below = ["--within=-3,-3,0,3,3,2.3"];
        assert_eq!(ambiguous(flat.path(), 1, &below), [], "the room decides");
        let json = located(flat.path(), 1, &below);
        assert!(rmse_m(&json)[0] < 0.08, "{:?}", rmse_m(&json));
    }
    // Eight, then four in a plane, then eight.
    let all = Log::default().csv(clock);
    let silent = |(k, line): (usize, &str)| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if (800..1400).contains(&k) {
            cells[5..].fill("");
        }
        cells.join(",") + "\n"
    };
    let part = folder(&[all.lines().enumerate().map(silent).collect()]);
    let [(1, from_s, to_s)] = ambiguous(part.path(), 1, &[])[..] else { panic!("one") };
    assert!((from_s - 8.0).abs() < 1.1 && (to_s - 14.0).abs() < 1.1, "{from_s} to {to_s}");
}

#[test]
fn two_anchors_and_a_peer_leave_a_mirror_image_and_three_off_its_plane_do_not() {
    let first = Log { peer: true, ..Log::default() };
    for (anchors, is_ambiguous) in [(&[0, 5][..], true), (&[0, 5, 2], false)] {
        let second = Log { drone: 1, anchors, seed: 4, ..first };
        let folder = folder(&[first.csv(clock), second.csv(clock)]);
        let found = ambiguous(folder.path(), 2, &[]);
        println!("{found:?}");
        assert_eq!(found.iter().any(|(drone, ..)| *drone == 2), is_ambiguous, "{found:?}");
        assert!(found.iter().all(|(drone, ..)| *drone == 2), "{found:?}");
    }
}

#[test]
fn sigma_of_ranges_is_said_to_have_an_effect_and_has_it() {
    let folder = folder(&[Log::default().csv(clock)]);
    let run = noctograph(folder.path()).args(arguments(1, &[])).assert().success();
    run.stderr(contains("has no effect").not());
}

#[test]
fn the_range_of_a_pair_that_both_logs_hold_counts_once() {
    let [one, two] = two(0.0, [clock, clock]);
    // The second log has the first's ranges between the drones.
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
    let log = Log::default().csv(clock);
    let yaml = "0:\n  x: 0.0\n  y: 0.0\n  z: 0.0\n";
    let arguments = ["locate", "log.csv", "--anchors", "a.yaml"];
    let files = [("log.csv", log.as_str()), ("a.yaml", yaml)];
    fails(&arguments, &files, &["drone 1 to anchor 2 (distance1)", "1 anchors"]);
}
