//! Tests of two drones that write one word together with three anchors.

use std::fmt::Write;

use noctograph::flight::{ESTIMATE_NEES, Flight};
use noctograph::scene::Scene;
use noctograph::shoot::Shoot;
use noctograph::sim::{Drone, EstimatorKind, bounds, fly_fleet, writing_sigma_m};

use crate::cli::{fails, noctograph, run_json};

/// Returns the RMS position error, in m, and the mean NEES over the lit samples after 2 s.
fn errors(flights: &[Flight]) -> (f64, f64) {
    let (mut square, mut nees, mut n) = (0.0, 0.0, 0.0);
    for flight in flights {
        let light = flight.lights.values().next().unwrap();
        for (i, sample) in flight.samples.iter().enumerate() {
            if sample.time_s > 2.0 && light[i] > 0.0 {
                square += (sample.estimate_m - sample.position_m).norm_squared();
                nees += flight.extra[ESTIMATE_NEES][i];
                n += 1.0;
            }
        }
    }
    ((square / n).sqrt(), nees / n)
}

/// Returns the position error in m and the NEES over several seeds of a scene.
fn flown(scene: &str, settings: &[(&str, &str)], seeds: std::ops::Range<u64>) -> (f64, f64) {
    let mut scene = Scene::find(scene, settings).unwrap().scene;
    let (mut square, mut nees, mut all) = (0.0, 0.0, Vec::new());
    let n = seeds.clone().count() as f64;
    let shoot = Shoot::new(scene.clone()).unwrap();
    for seed in seeds {
        scene.seed = seed;
        let shoot = Shoot { scene: scene.clone(), ..shoot.clone() };
        let (error_m, one) = errors(&shoot.fly(&|_, _| {}).unwrap());
        square += error_m * error_m / n;
        nees += one / n;
        all.push(error_m);
    }
    all.sort_by(f64::total_cmp);
    (square.sqrt(), nees)
}

const FIVE_LINKS: &str = "two-drones-three-anchors";
const FLOOR: &str = "two-drones-three-anchors-and-floor";

#[test]
fn three_anchors_and_a_fifth_link_place_two_drones_as_the_table_says() {
    // The expected values are those of docs/cooperative.md over 16 seeds. The tolerance is needed,
    // because this test uses only six.
    let barometer = [
        ("sensors.heights", "[\"barometer\"]"),
        ("sensors.barometer.drift_m_sqrt_s", "0.0"),
        ("observer.ekf.barometer_sigma_m", "0.09"),
    ];
    let lossy = [("sensors.peers.loss_frac", "0.5")];
    let all = [("sensors.uwb.heard", "[]")];
    for (scene, settings, most_m) in [
        (FIVE_LINKS, [].as_slice(), 0.20),
        (FLOOR, &[], 0.034),
        (FLOOR, &barometer, 0.040),
        (FLOOR, &lossy, 0.039),
        (FIVE_LINKS, &all, 0.036),
    ] {
        let (error_m, nees) = flown(scene, settings, 0..6);
        assert!(error_m < most_m, "{scene} {settings:?}: {error_m} m");
        let consistent =
            if settings.is_empty() && scene == FIVE_LINKS { 0.5..4.0 } else { 0.8..1.25 };
        assert!(consistent.contains(&nees), "{scene} {settings:?}: NEES {nees}");
    }
}

#[test]
fn a_filter_is_as_consistent_on_the_floor_as_in_the_air() {
    let mut scene = Scene::find(FLOOR, &[]).unwrap().scene;
    let shoot = Shoot::new(scene.clone()).unwrap();
    let landed_s = shoot.plans.iter().map(|planned| planned.plan.duration_s() - 0.3);
    let landed_s: Vec<f64> = landed_s.collect();
    let (mut sum, mut n) = (0.0, 0.0);
    for seed in 0..8 {
        scene.seed = seed;
        let flights = Shoot { scene: scene.clone(), ..shoot.clone() }.fly(&|_, _| {}).unwrap();
        for (flight, landed_s) in flights.iter().zip(&landed_s) {
            let rows = flight.samples.iter().zip(&flight.extra[ESTIMATE_NEES]);
            for (_, nees) in rows.filter(|(sample, _)| sample.time_s > *landed_s) {
                (sum, n) = (sum + nees, n + 1.0);
            }
        }
    }
    assert!(n > 0.0 && (0.5..2.0).contains(&(sum / n)), "NEES {} of {n}", sum / n);
}

#[test]
fn one_to_six_drones_with_three_anchors_stand_on_their_bound() {
    for n in 1..=6_usize {
        let n_drones = n.to_string();
        // The word contains a letter for each drone, because every drone writes at least one.
        let settings =
            [("word", "NOORNO"), ("plan.drones", n_drones.as_str()), ("sensors.uwb.heard", "[]")];
        let scene = Scene::find(FIVE_LINKS, &settings).unwrap().scene;
        let options = scene.sim();
        let shoot = Shoot::new(scene).unwrap();
        let plans: Vec<_> = shoot.plans.iter().map(|planned| &planned.plan).collect();
        assert_eq!(plans.len(), n, "all fly");
        let bound_m = writing_sigma_m(&bounds(&plans, &options).unwrap(), None).unwrap();
        // The result must be within 12 % of that for 16 seeds in docs/cooperative.md.
        let (error_m, nees) = flown(FIVE_LINKS, &settings, 0..4);
        assert!(error_m < 1.3 * bound_m, "{n} drones: {error_m} m, bound {bound_m} m");
        assert!((0.75..1.3).contains(&nees), "{n} drones: NEES {nees}");
    }
}

#[test]
fn sharing_estimates_is_worse_than_sharing_measurements_and_believes_too_much() {
    let share = |share| flown(FLOOR, &[("observer.cooperative.share", share)], 0..4);
    let (measurements_m, nees) = share("measurements");
    let (estimates_m, nees_of_estimates) = share("estimates");
    let (nothing_m, _) = share("nothing");
    assert!(estimates_m > 1.4 * measurements_m, "{estimates_m} m against {measurements_m} m");
    assert!(nees_of_estimates > 2.0 * nees, "{nees_of_estimates} against {nees}");
    assert!(nothing_m > 1.2 * measurements_m, "{nothing_m} m against {measurements_m} m");
    let deaf = flown(FLOOR, &[("sensors.peers.loss_frac", "1.0")], 0..4);
    assert_eq!(deaf.0, nothing_m, "without a message nothing can be known of the others");
}

/// Returns flights of the word by drones with the noise and anchors of the given indices.
fn as_named(indices: [u64; 2]) -> Vec<Flight> {
    let scene = Scene::find(FLOOR, &[]).unwrap().scene;
    let options = scene.sim();
    let plans = Shoot::new(scene).unwrap().plans;
    let drone = |index| Drone { index, ..Drone::new(&options, 3) };
    // Each index selects the plan and the drone with that number.
    let fleet = indices.map(|index| (&plans[usize::try_from(index).unwrap()].plan, drone(index)));
    fly_fleet(&fleet, &mut |_| {}).unwrap()
}

#[test]
fn swapping_the_names_of_the_drones_swaps_their_flights() {
    let (there, back) = (as_named([0, 1]), as_named([1, 0]));
    for (one, other) in there.iter().zip(back.iter().rev()) {
        assert_eq!(one.samples.len(), other.samples.len());
        for (a, b) in one.samples.iter().zip(&other.samples) {
            assert!((a.estimate_m - b.estimate_m).norm() < 1e-5, "at {} s", a.time_s);
        }
    }
}

#[test]
fn a_drone_alone_flies_as_with_the_single_filter_bit_for_bit() {
    let alone = |kind| {
        let settings = [
            ("plan.drones", "1"),
            ("sensors.uwb.heard", "[]"),
            ("sensors.heights", "[\"time-of-flight\", \"barometer\"]"),
            ("observer.cooperative.start_tilt_rad", "0.02"),
            // The outlier gate is opened, because a single drone's filter may reject a link
            // forever. The fleet's filter accepts the link again.
            ("observer.ekf.gate_sigmas", "1e6"),
        ];
        let mut scene = Scene::find(FLOOR, &settings).unwrap().scene;
        scene.observer.kind = kind;
        Shoot::new(scene).unwrap().fly(&|_, _| {}).unwrap().remove(0)
    };
    let (fleet, single) = (alone(EstimatorKind::Cooperative), alone(EstimatorKind::EkfImproved));
    assert!(!fleet.samples.is_empty() && fleet.samples == single.samples, "they differ");
}

#[test]
fn fleets_that_cannot_be_are_refused_with_the_reason() {
    let refused = |settings: &[(&str, &str)]| {
        let found = Scene::find(FIVE_LINKS, settings).and_then(|named| {
            named.scene.check()?;
            Shoot::new(named.scene)?.fly(&|_, _| {})
        });
        let error = found.unwrap_err();
        format!("{error}; {}", error.hint())
    };
    for (key, value, reason) in [
        ("sensors.uwb.heard", "[[0, 3], [1, 2]]", "sensors.uwb.heard[0][1]: found 3"),
        ("sensors.uwb.heard", "[[0, 0], [1, 2]]", "sensors.uwb.heard[0][1]: found 0"),
        ("sensors.uwb.heard", "[[], [1, 2]]", "sensors.uwb.heard[0]: found 0 of them"),
        ("sensors.uwb.heard", "[[0, 2]]", "1 lists for at least 2 drones"),
        (
            "sensors.uwb.anchors_m",
            "[[1, 2, 3], [0, 0, 1], [1, 2, 3]]",
            "the position of another anchor",
        ),
        ("sensors.positioning", "gnss", "of uwb-twr"),
        ("sensors.peers.loss_frac", "1.5", "sensors.peers.loss_frac"),
        ("observer.cooperative.share", "telepathy", "telepathy"),
    ] {
        let found = refused(&[(key, value)]);
        assert!(found.contains(reason), "{key} = {value}: {found}");
    }
}

const ANCHORS: [[f64; 3]; 5] =
    [[-2.5, -2.5, 2.4], [2.5, -2.5, 0.2], [0.5, 2.5, 2.4], [-2.5, 2.5, 0.2], [2.5, 2.0, 2.4]];

/// Returns a noise-free log of ranges to each anchor in turn, the anchors, and the true flight.
pub(crate) fn recorded() -> [(&'static str, String); 3] {
    let (mut log, mut held) = ("row,timestamp".to_owned(), [0.0; 5]);
    (0..5).for_each(|anchor| write!(log, ",ranging.distance{anchor}").unwrap());
    let mut flight = "timestamp,x,y,z\n".to_owned();
    for row in 0..2000_u32 {
        let time_s = f64::from(row) * 0.01;
        let place =
            [0.8 * libm::sin(0.7 * time_s), 0.4 * libm::sin(1.1 * time_s), 1.0 + 0.02 * time_s];
        let (anchor, stamp) = (row as usize % 5, format!("2023-05-04 12:00:{time_s:09.6}"));
        let square: f64 = (0..3).map(|k| libm::pow(place[k] - ANCHORS[anchor][k], 2.0)).sum();
        held[anchor] = square.sqrt();
        write!(log, "\n{row},{stamp}").unwrap();
        held.iter().for_each(|distance| write!(log, ",{distance:.6}").unwrap());
        writeln!(flight, "{stamp},{},{},{}", place[0], place[1], place[2]).unwrap();
    }
    let mut anchors = String::new();
    for (index, [x, y, z]) in ANCHORS.iter().enumerate() {
        writeln!(anchors, "{index}:\n  x: {x:?}\n  y: {y:?}\n  z: {z:?}").unwrap();
    }
    [("ranges.csv", log), ("flight.csv", flight), ("anchors.yaml", anchors)]
}

#[test]
fn a_log_of_ranges_becomes_a_flight_beside_its_reference() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in recorded() {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let arguments = ["locate", "ranges.csv", "--anchors", "anchors.yaml"];
    let arguments = [&arguments[..], &["--reference", "flight.csv", "-o", "out"]].concat();
    let json = run_json(folder.path(), &arguments);
    let rmse_m = json["reference"][0]["rmse_3d_m"].as_f64().unwrap();
    assert!(rmse_m < 0.01, "{rmse_m} m: without noise");
    let links = json["links"].as_array().unwrap();
    assert_eq!(links.len(), 5);
    for link in links {
        let median_m = link["median_m"].as_f64().unwrap();
        assert!(median_m.abs() < 1e-3, "{link}");
    }
    for file in ["flight-1.csv", "flight-xy.svg", "flight-xz.svg"] {
        assert!(folder.path().join("out").join(file).exists(), "{file}");
    }
    let compared = ["compare", "out/flight-1.csv", "flight.csv", "--offset", "0", "--part", "all"];
    noctograph(folder.path()).args(compared).assert().success();
}

#[test]
fn every_observer_reads_a_log_that_holds_the_motion() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in recorded() {
        // The drone's velocity is added to the log of its ranges.
        let row = |(k, line): (usize, &str)| match k.checked_sub(1) {
            None => format!("{line},stateEstimate.vx,stateEstimate.vy,stateEstimate.vz\n"),
            Some(k) => {
                let time_s = k as f64 * 0.01;
                let vx = 0.56 * libm::cos(0.7 * time_s);
                let vy = 0.44 * libm::cos(1.1 * time_s);
                format!("{line},{vx:.6},{vy:.6},0.02\n")
            }
        };
        let with_motion = || text.lines().enumerate().map(row).collect::<String>();
        let text = if name == "ranges.csv" { with_motion() } else { text };
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    for observer in ["smooth", "filter", "enlarged"] {
        let arguments = ["locate", "ranges.csv", "--anchors", "anchors.yaml"];
        let chosen = ["--reference", "flight.csv", "--observer", observer];
        let json = run_json(folder.path(), &[&arguments[..], &chosen].concat());
        let rmse_m = json["reference"][0]["rmse_3d_m"].as_f64().unwrap();
        // The tolerance of the augmented filter is larger, because it starts in the middle of the
        // room.
        let most_m = if observer == "enlarged" { 0.4 } else { 0.1 };
        assert!(rmse_m < most_m, "{observer}: {rmse_m} m");
    }
}

#[test]
fn a_fleet_that_is_lost_says_which_drone() {
    let folder = tempfile::tempdir().unwrap();
    // A drone turns over if its ranges have errors of meters.
    let lost = ["preview", "--scene", FIVE_LINKS, "--set", "sensors.uwb.bias_m=2"];
    let lost = noctograph(folder.path()).args(lost).assert().code(2);
    lost.stderr(predicates::str::contains("drone 1: the drone turns over after"));
}

#[test]
fn logs_that_cannot_be_located_are_refused_with_the_reason() {
    let [(log, ranges), _, (yaml, anchors)] = recorded();
    let arguments = ["locate", "ranges.csv", "--anchors", "anchors.yaml"];
    let refused = |ranges: &str, anchors: &str, wanted: &[&str]| {
        fails(&arguments, &[(log, ranges), (yaml, anchors)], wanted);
    };
    refused(&ranges.replace("ranging.", "other."), &anchors, &["ranges.csv"]);
    refused(
        &ranges.replacen(",2.", ",-2.", 40),
        &anchors,
        &["range at", "a distance from 0 m", "8 of 1999"],
    );
    let (three, _) = anchors.split_once("3:").unwrap();
    refused(&ranges, three, &["drone 1 to anchor 4 (distance3)"]);
    refused(&ranges, &anchors.replace("1:\n", "7:\n"), &["anchors.yaml", "key 1"]);
    let broken = ["ranges.csv:4: column ranging.distance2", "inf898946"];
    refused(&ranges.replacen(",2.", ",inf", 1), &anchors, &broken);
    let stranger = ranges.replace("ranging.distance4", "ranging.drone3");
    refused(&stranger, &anchors, &["drones 1 and 3", "a log of every drone"]);
    let twice = anchors.replace("x: 2.5\n  y: -2.5\n  z: 0.2", "x: -2.5\n  y: -2.5\n  z: 2.4");
    refused(&ranges, &twice, &["anchors.yaml:6: anchor 1", "the position of anchor 0"]);
    let observed = |name: &str, wanted: &[&str]| {
        let arguments = [&arguments[..], &["--observer", name]].concat();
        fails(&arguments, &[(log, &ranges), (yaml, &anchors)], wanted);
    };
    observed("enlarged", &["no velocity", "stateEstimate.vx"]);
    observed("shared", &["no velocity"]);
    let few = ranges.replace("ranging.distance2", "x").replace("ranging.distance3", "y");
    refused(&few.replace("ranging.distance4", "z"), &anchors, &["2 links"]);
}

#[test]
fn the_bound_of_three_anchors_is_printed_for_each_letter() {
    let folder = tempfile::tempdir().unwrap();
    let bound = |scene| {
        let json = run_json(folder.path(), &["coverage", "--scene", scene]);
        let map = std::fs::read_to_string(folder.path().join("coverage.svg")).unwrap();
        assert!(map.contains("one more here"), "a picture");
        assert_eq!(json["letters"].as_array().unwrap().len(), 4, "{json}");
        let more_m = json["one_more_anchor"]["bound_m"].as_f64().unwrap();
        let bound_m = json["bound_m"].as_f64().unwrap();
        assert!(more_m < bound_m, "{more_m} m, {bound_m} m");
        bound_m
    };
    let (five_m, floor_m) = (bound(FIVE_LINKS), bound(FLOOR));
    assert!(
        (0.05..0.12).contains(&five_m) && (0.015..0.035).contains(&floor_m),
        "{five_m} {floor_m}"
    );
}

#[test]
fn the_bound_of_two_words_has_every_letter() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["coverage", "NO OR", "--scene", FLOOR];
    let json = run_json(folder.path(), &arguments);
    let letters = json["letters"].as_array().unwrap().iter();
    let letters: String = letters.map(|row| row["letter"].as_str().unwrap()).collect();
    assert_eq!(letters, "NOOR");
}
