//! `noctograph coverage`, and flights on other sensors, through the front door.

use std::path::Path;

use assert_cmd::Command;

fn noctograph(folder: &Path, arguments: &[&str]) -> (bool, String, String) {
    let mut command = Command::cargo_bin("noctograph").unwrap();
    let output = command.current_dir(folder).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.success(), text(output.stdout), text(output.stderr))
}

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
fn coverage_tells_what_the_stations_of_a_file_see() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("lh.yaml"), CONFIG).unwrap();
    let arguments = ["coverage", "NOOR", "--lighthouse", "lh.yaml", "--step", "0.1"];
    let (done, table, errors) = noctograph(folder.path(), &arguments);
    assert!(done && errors.is_empty(), "{errors}");
    assert!(table.contains("two or more of 2 base stations: 100.0 %"), "{table}");
    let map = std::fs::read_to_string(folder.path().join("coverage.svg")).unwrap();
    assert!(map.starts_with("<svg") && map.trim_end().ends_with("</svg>"), "a whole map");
    let (done, json, _) = noctograph(folder.path(), &[&arguments[..], &["--json"]].concat());
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert!(done && json["seen_frac"] == 1.0, "{json}");
    let median_m = json["error_median_m"].as_f64().unwrap();
    assert!((0.005..0.03).contains(&median_m), "{median_m}");

    std::fs::write(folder.path().join("bad.yaml"), CONFIG.replace("[2.0, 2.0", "[2.0")).unwrap();
    let (done, _, errors) = noctograph(folder.path(), &["coverage", "--lighthouse", "bad.yaml"]);
    assert!(!done && errors.contains("bad.yaml:9") && errors.contains("hint:"), "{errors}");
}

#[test]
fn an_observer_that_needs_positions_is_refused_on_angles() {
    let folder = tempfile::tempdir().unwrap();
    let scene = "word = \"I\"\n[sensors]\npositioning = \"sweeps\"\n";
    std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
    let (done, _, errors) = noctograph(folder.path(), &["coverage", "--scene", "scene.toml"]);
    assert!(!done && errors.contains("observer.kind") && errors.contains("ekf"), "{errors}");
}
