//! Tests of `noctograph coverage` and of flights with other sensors on the command line.

use predicates::str::contains;

use crate::cli::{fails, noctograph, run_json};

const CONFIG: &str = "\
type: lighthouse_system_configuration
version: '1'
systemType: 2
geos:
  0:
    origin: [-2.0, -2.0, 2.2]
    rotation: [[0.65, -0.7071, 0.2785], [0.65, 0.7071, 0.2785], [-0.3939, 0.0, 0.9191]]
  1:
    origin: [2.0, 2.0, 2.2]
    rotation: [[-0.65, 0.7071, -0.2785], [-0.65, -0.7071, -0.2785], [-0.3939, 0.0, 0.9191]]
";

#[test]
fn coverage_is_computed_for_the_stations_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("lh.yaml"), CONFIG).unwrap();
    let arguments = ["coverage", "NOOR", "--lighthouse", "lh.yaml", "--step", "0.1"];
    let run = noctograph(folder.path()).args(arguments).assert().success().stderr("");
    run.stdout(contains("two or more of 2 base stations: 100.0 %"));
    let map = std::fs::read_to_string(folder.path().join("coverage.svg")).unwrap();
    assert!(map.starts_with("<svg") && map.trim_end().ends_with("</svg>"), "a whole map");
    let json = run_json(folder.path(), &arguments);
    assert_eq!(json["seen_frac"], 1.0);
    let median_m = json["error_median_m"].as_f64().unwrap();
    assert!((0.005..0.03).contains(&median_m), "{median_m}");

    let broken = CONFIG.replace("[2.0, 2.0", "[2.0");
    fails(&["coverage", "--lighthouse", "bad.yaml"], &[("bad.yaml", &broken)], &["bad.yaml:9"]);
}

#[test]
fn an_observer_that_needs_positions_is_refused_on_angles() {
    let scene = "preset = \"ae483-2022\"\nword = \"I\"\n[sensors]\npositioning = \"sweeps\"\n";
    let arguments = ["coverage", "--scene", "scene.toml"];
    fails(&arguments, &[("scene.toml", scene)], &["observer.kind", "ekf"]);
}
