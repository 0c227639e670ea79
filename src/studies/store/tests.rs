use super::*;
use crate::Flown;

fn record(seed: u64) -> Record {
    let third = 1.0 / 3.0;
    let flown = Flown {
        contour_m: third,
        lag_s: 0.1 + 0.2,
        rmse_x_m: 1e-300,
        rmse_y_m: 0.0,
        rmse_z_m: 5e-324,
        drift_y_m: third,
        tilt_rad: third,
        saturated_frac: 0.0,
        duration_s: 57.3,
        energy_j: 1e9,
    };
    let outcome = Outcome {
        read: "N?\"OR".into(),
        all_read: false,
        legible: false,
        probability: third,
        log_odds: -10.0,
        similarity: 0.7,
        flown: (seed != 1).then_some(flown),
        lost: (seed == 1).then(|| "the drone turns over".into()),
    };
    let (scene, contender, word) = ("0123".into(), "team".into(), "NOOR".into());
    Record { scene, contender, word, seed, outcome }
}

#[test]
fn what_was_put_comes_back_bit_by_bit() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).unwrap();
    (0..3).for_each(|seed| store.put(&record(seed)).unwrap());
    drop(store);
    let store = Store::open(folder.path()).unwrap();
    assert_eq!(store.n_known(), 3);
    (0..3).for_each(|seed| assert_eq!(store.get("0123", seed), Some(record(seed).outcome)));
    assert_eq!(store.get("0123", 3), None);
    let all = Store::read(&folder.path().join(Store::FLIGHTS)).unwrap();
    assert_eq!(all, (0..3).map(record).collect::<Vec<_>>());
}

#[test]
fn half_a_line_at_the_end_is_taken_off() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(Store::FLIGHTS);
    Store::open(folder.path()).unwrap().put(&record(0)).unwrap();
    let whole = std::fs::read(&path).unwrap();
    for cut in [1, 20, whole.len() - 1] {
        std::fs::write(&path, [&whole[..], &whole[..cut]].concat()).unwrap();
        let store = Store::open(folder.path()).unwrap();
        assert_eq!(store.n_known(), 1);
        store.put(&record(2)).unwrap();
        drop(store);
        let read = Store::read(&path).unwrap();
        assert_eq!(read, [record(0), record(2)], "cut after {cut}");
    }
}

#[test]
fn a_broken_line_in_the_middle_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(Store::FLIGHTS);
    Store::open(folder.path()).unwrap().put(&record(0)).unwrap();
    let mut text = std::fs::read_to_string(&path).unwrap();
    text += "{\"scene\": 3}\n";
    std::fs::write(&path, text).unwrap();
    let error = Store::open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("flights.jsonl:2"), "{error}");
}

#[test]
fn figures_beyond_their_range_and_two_outcomes_of_a_flight_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(Store::FLIGHTS);
    let with = |change: fn(&mut Record)| {
        let mut other = record(0);
        change(&mut other);
        std::fs::write(&path, [line_of(&record(0)), line_of(&other)].concat()).unwrap();
        Store::open(folder.path()).map(|_| ()).map_err(|error| error.to_string())
    };
    assert!(with(|_| {}).is_ok(), "the same twice");
    let error = with(|other| other.outcome.probability = 1e308).unwrap_err();
    assert!(error.contains("flights.jsonl:2: probability"), "{error}");
    let error = with(|other| other.outcome.flown.as_mut().unwrap().lag_s = 1e300).unwrap_err();
    assert!(error.contains("flights.jsonl:2: lag_s"), "{error}");
    let error = with(|other| other.outcome.legible = true).unwrap_err();
    assert!(error.contains("two outcomes of NOOR with seed 0"), "{error}");
    assert!(with(|other| other.seed = 1).is_ok(), "another flight");
}

#[test]
fn a_file_that_is_not_ours_is_never_erased() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(Store::FLIGHTS);
    for foreign in ["my only notes", "{\"scene\": 1", "{\"a\": 1}"] {
        std::fs::write(&path, foreign).unwrap();
        assert!(Store::open(folder.path()).is_err(), "{foreign}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), foreign);
    }
}

#[test]
fn an_empty_header_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    Store::open(folder.path()).unwrap().put(&record(0)).unwrap();
    std::fs::write(folder.path().join("study.json"), "").unwrap();
    let error = Store::open(folder.path()).unwrap_err();
    assert!(error.to_string().contains("an empty file"), "{error}");
    assert!(error.hint().contains("remove the file"), "{}", error.hint());
    std::fs::remove_file(folder.path().join("study.json")).unwrap();
    assert_eq!(Store::open(folder.path()).unwrap().n_known(), 1, "the flights stay");
}

#[test]
fn flights_of_another_version_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    drop(Store::open(folder.path()).unwrap());
    let header = folder.path().join("study.json");
    for (text, quoted) in [
        ("{\"noctograph\": \"9.9.9\", \"format\": 1}", "9.9.9"),
        ("{\"noctograph\": \"0.1.0\", \"format\": 7}", "format 7"),
        ("half of", "half of"),
    ] {
        std::fs::write(&header, text).unwrap();
        let error = Store::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains(quoted), "{error}");
    }
}

#[test]
fn more_flights_than_the_largest_study_has_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(Store::FLIGHTS);
    let mut file = std::io::BufWriter::new(File::create(&path).unwrap());
    // Half a million lines are written in a fraction of the time in which they would be serialized.
    let lost = String::from_utf8(line_of(&record(1))).unwrap();
    let (before, after) = lost.split_once("\"seed\":1,").unwrap();
    let line = |seed: usize| format!("{before}\"seed\":{seed},{after}").into_bytes();
    (0..MAX_TRIALS).for_each(|seed| file.write_all(&line(seed)).unwrap());
    file.flush().unwrap();
    let store = Store::open(folder.path()).unwrap();
    assert_eq!(store.n_known(), MAX_TRIALS);
    let error = store.put(&record(0)).unwrap_err().to_string();
    assert!(error.contains("more than 500000 flights"), "{error}");
    drop(store);
    file.write_all(&line(MAX_TRIALS)).unwrap();
    file.flush().unwrap();
    let error = Store::open(folder.path()).unwrap_err().to_string();
    assert!(error.contains("flights.jsonl:500001: found more than 500000"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_pipe_in_the_place_of_a_file_is_refused() {
    for name in [Store::FLIGHTS, LOCK, HEADER_FILE] {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join(name);
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let error = Store::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("found no regular file"), "{name}: {error}");
    }
}
