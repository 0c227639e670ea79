//! Tests of the report page.

use predicates::prelude::PredicateBooleanExt as _;

use crate::cli::{names_in, noctograph};

const SMALL: [&str; 4] = ["--backend", "cpu", "--size", "480x270"];

#[test]
fn a_report_says_what_was_seen_flown_and_set_and_needs_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let run = ["preview", "AB", "--report", "--set", "air.gusts=dryden"];
    noctograph(folder.path()).args(run).args(SMALL).assert().code(predicates::ord::le(1));
    let out = folder.path().join("noctograph-out");
    let html = std::fs::read_to_string(out.join("report.html")).unwrap();
    for part in [
        "<h1>AB</h1>",
        "AB reads as",
        "<h2>As printed</h2>",
        "\nletter ",
        "<h2>Safety sheet</h2>",
        "<td>battery</td>",
        "<h2>Camera</h2>",
        "Load of motors and battery",
        "battery (V)",
        "Shot plan from above",
        "take-off",
        "station 2",
        "air.gusts",
        "noctograph preview AB --report",
        "SHA-256",
    ] {
        assert!(html.contains(part), "{part}");
    }
    for foreign in ["http://", "https://", "src=\"/", "@import", "url("] {
        let own = html.replace("http://www.w3.org/2000/svg", "");
        assert!(!own.contains(foreign), "{foreign}");
    }
    assert_eq!(html.matches("<figcaption>").count(), 12, "moments of the exposure");
    assert!(html.len() < 2_000_000, "{} bytes", html.len());
    // The same run produces the same page.
    noctograph(folder.path()).args(run).args(SMALL).assert().code(predicates::ord::le(1));
    assert!(html == std::fs::read_to_string(out.join("report.html")).unwrap());
}

#[test]
fn a_folder_of_a_ranking_becomes_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let rank = ["rank", "team", "pid", "--words", "I:2", "-o", "ranked"];
    noctograph(folder.path()).args(rank).assert().success();
    noctograph(folder.path()).args(["report", "ranked"]).assert().success();
    let html = std::fs::read_to_string(folder.path().join("noctograph-report.html")).unwrap();
    for part in ["<h1>ranked</h1>", "photos.png", "ranking.csv", "<td>pid</td>", "legibility"] {
        assert!(html.contains(part), "{part}");
    }
    assert!(!html.contains("flights.csv"), "a table for programs");
}

#[test]
fn a_report_of_what_is_no_folder_of_ours_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    std::fs::write(folder.path().join("broken.png"), "no picture").unwrap();
    for (of, says) in
        [("empty", "a folder with photos"), (".", "broken.png"), ("nowhere", "nowhere")]
    {
        let run = noctograph(folder.path()).args(["report", of]).assert().code(2);
        assert!(String::from_utf8_lossy(&run.get_output().stderr).contains(says), "{of}");
    }
    assert_eq!(names_in(folder.path()), ["broken.png", "empty"], "nothing half-written");
}

#[test]
fn an_evening_of_logs_becomes_a_page_and_conditions_that_a_preview_takes() {
    let folder = tempfile::tempdir().unwrap();
    let run = |command: &str| {
        noctograph(folder.path())
            .args(command.split_whitespace())
            .assert()
            .code(predicates::ord::le(1))
    };
    std::fs::create_dir(folder.path().join("logs")).unwrap();
    run("plan O -o plan.csv");
    for seed in 1..=3 {
        run(&format!(
            "fly plan.csv --seed {seed} --set air.gusts=ornstein-uhlenbeck -o logs/cf1-{seed}.csv"
        ));
    }
    std::fs::write(folder.path().join("logs/cf2-1.csv"), "no log").unwrap();
    run("import logs")
        .stdout(predicates::str::contains("4 logs, 3 valid"))
        .stdout(predicates::str::contains("vehicle.").not());
    let out = folder.path().join("noctograph-evening");
    let html = std::fs::read_to_string(out.join("evening.html")).unwrap();
    for part in [
        "4 logs of 2 drone(s), of which 3 are valid.",
        "\ncf2 ",
        "unreadable: ",
        "rotor lag (ms)",
        "gust_m_s",
    ] {
        assert!(html.contains(part), "{part}");
    }
    assert!(html.contains(">1</text>") && !html.contains(">1.5</text>"), "flights are whole");
    // The drone of these flights differs from the scene's drone, and the advice says so.
    std::fs::create_dir(folder.path().join("other")).unwrap();
    run(
        "fly plan.csv --set vehicle.center_of_mass_m=[0.003,0] --set vehicle.k_f_n=1.9e-6 -o other/cf1.csv",
    );
    run("import other")
        .stdout(predicates::str::contains("at (+3.1, +0.0) mm"))
        .stdout(predicates::str::contains("center_of_mass_m=[0.0031,0.0000]"))
        .stdout(predicates::str::contains("thrust differs from the scene's by +"));
    run(
        "preview O --spread 2 --conditions noctograph-evening/conditions.toml --backend cpu --size 320x180",
    );
    noctograph(folder.path()).args(["import", "logs", "--word", "O"]).assert().code(2);
    std::fs::create_dir(folder.path().join("none")).unwrap();
    noctograph(folder.path()).args(["import", "none"]).assert().code(2);
}
