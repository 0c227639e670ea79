//! Tests of exports, and of the room, the battery and the camera against which they are checked.
//! Every export flies exactly what `check` judges, or is refused.

use std::path::Path;

use base64::prelude::{BASE64_STANDARD, Engine};
use noctograph::export::safety::{
    CORNER_M, CRITICAL_BATTERY_V, FENCE_M, FRAME_M, LEAST_PEOPLE_M, LEVEL_RAD, LOW_BATTERY_S,
    MAX_POSITION_ERROR_M, NOSE_RAD, OLDEST_CFLIB, Platform, START_RADIUS_M, WRONG_S, variance_m2,
};
use noctograph::sensors::Positioning;
use noctograph_core::crazyflie::{Feature, LEVEL_OUT_S, MOTORS_STOP_S, Release};
use serde_json::{Value, json};

use crate::cli::{json as parsed, names_in, noctograph};

/// Returns the exit code, the JSON output and the messages of a command.
fn run(folder: &Path, arguments: &[&str]) -> (i32, Value, String) {
    let output = noctograph(folder).args(arguments).arg("--json").output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    let code = output.status.code().unwrap();
    let report = if output.stdout.is_empty() { Value::Null } else { parsed(&output.stdout) };
    (code, report, said)
}

fn finding<'a>(report: &'a Value, check: &str) -> &'a Value {
    let findings = report["findings"].as_array().unwrap();
    findings.iter().find(|finding| finding["check"] == check).unwrap_or(&Value::Null)
}

/// Returns the data in an exported script.
fn data(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix("DATA = json.loads(")).unwrap();
    let data: String = serde_json::from_str(line.strip_suffix(')').unwrap()).unwrap();
    serde_json::from_str(&data).unwrap()
}

/// Returns a base station as the setting of a scene.
fn station([x, y, z]: [f64; 3]) -> String {
    format!("{{generation=\"v2\",position_m=[{x},{y},{z}],yaw_rad=0.8,pitch_rad=0.5,roll_rad=0.0}}")
}

#[test]
fn stations_and_anchors_outside_the_room_stop_the_flight() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let room = ["check", "I", "--room", "4x6x2.5", "--set"];
    let stations = |places: [[f64; 3]; 2]| {
        format!("sensors.lighthouse.stations=[{}]", places.map(station).join(", "))
    };
    for (places, outside) in [
        ([[-1.9, -2.9, 2.4], [1.9, 2.9, 2.4]], 0),
        ([[-2.1, -2.9, 2.4], [1.9, 2.9, 2.6]], 0),
        ([[-2.7, -2.4, 3.1], [1.9, 2.2, 2.4]], 1),
        ([[0.0, 0.0, 2.4], [4.0, 5.9, 2.4]], 1),
        ([[-2.7, -2.4, 3.1], [2.9, 2.2, 3.1]], 2),
        ([[-1.9, -2.9, -0.4], [1.9, 2.9, 2.4]], 1),
    ] {
        let (code, report, _) = run(at, &[&room[..], &[&stations(places)]].concat());
        let frame = finding(&report, "frame");
        let named = frame["detail"].as_str().map_or(0, |names| names.split(", ").count());
        assert_eq!(named, outside, "{places:?}: {frame}");
        let severity = if outside > 0 { "stop" } else { "fine" };
        assert_eq!(frame["severity"], severity, "{places:?}: {frame}");
        assert!(outside == 0 || code == 1);
    }
    // A geometry file of cfclient is used by both the check and the export.
    let yaml = "geos:\n  0:\n    origin: [-2.7, -2.4, 3.1]\n    rotation: [[0.6265, -0.6644, 0.4076], \
                [0.5569, 0.7474, 0.3623], [-0.5453, 0.0, 0.8382]]\n  1:\n    origin: [2.9, 2.2, 3.1]\n    \
                rotation: [[-0.6693, 0.6044, -0.4321], [-0.5078, -0.7967, -0.3278], [-0.5424, 0.0, \
                0.8401]]\nsystemType: 2\ntype: lighthouse_system_configuration\nversion: '1'\n";
    std::fs::write(at.join("stations.yaml"), yaml).unwrap();
    let of_file = ["NOOR", "--room", "4x6x2.5", "--lighthouse", "stations.yaml"];
    let (code, report, _) = run(at, &[&["export"], &of_file[..], &["--to", "cflib"]].concat());
    assert_eq!((code, report["files"].clone()), (1, json!([])));
    assert!(report["stops"].as_str().unwrap().contains("station 1"), "{report}");

    let uwb = ["check", "I", "--room", "4x6x2.5", "--set", "sensors.positioning=uwb-twr"];
    let (code, report, _) = run(at, &uwb);
    let frame = finding(&report, "frame");
    assert_eq!((code, frame["detail"].as_str().unwrap().split(", ").count()), (1, 8), "{frame}");
}

#[test]
fn a_take_off_mark_and_a_camera_share_the_rooms_frame() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (_, report, _) = run(at, &["check", "I", "--room", "4x6x2.5", "--camera-at", "0,-4,1"]);
    let frame = finding(&report, "frame");
    assert_eq!((&frame["severity"], &frame["detail"]), (&json!("warning"), &json!("camera")));
    assert!((frame["value"].as_f64().unwrap() - 1.0).abs() < 1e-9, "{frame}");
    noctograph(at)
        .args(["plan", "I", "--set", "letters.align=left", "-o", "plan.csv"])
        .assert()
        .success();
    let plan = std::fs::read_to_string(at.join("plan.csv")).unwrap();
    let mut lines = plan.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = head.iter().position(|name| *name == "x_m").unwrap();
    let moved = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[column] = (cells[column].parse::<f64>().unwrap() + 3.0).to_string();
        cells.join(",")
    };
    let moved: Vec<String> = std::iter::once(head.join(",")).chain(lines.map(moved)).collect();
    std::fs::write(at.join("moved.csv"), moved.join("\n") + "\n").unwrap();
    let (code, report, _) = run(at, &["check", "moved.csv", "--room", "4x6x2.5"]);
    assert_eq!((code, &finding(&report, "frame")["detail"]), (1, &json!("take-off mark")));
    let (_, report, _) = run(at, &["check", "I"]);
    assert_eq!(finding(&report, "frame")["severity"], "unknown", "no room is named");
}

#[test]
fn a_word_too_large_for_every_camera_in_a_room_is_stopped_and_no_picture_is_promised() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (room, canvas_m, severity) in [
        ("4x3x2.5", Some("[3, 1.3]"), "stop"),
        // The word is also in the picture with lenses other than the scene's 35 mm lens.
        ("4x6x2.5", Some("[3, 1.3]"), "warning"),
        // A word that is fitted to the room is as large as a camera inside the room can show.
        ("2x2x2", None, "fine"),
        ("4x3x2.5", None, "fine"),
        ("4x6x2.5", None, "fine"),
        ("6x12x3", None, "fine"),
    ] {
        let canvas = canvas_m.map(|canvas_m| format!("letters.canvas_m={canvas_m}"));
        let mut typed = vec!["check", "NOOR", "--room", room];
        typed.extend(canvas.iter().flat_map(|canvas| ["--set", canvas]));
        let (code, report, _) = run(at, &typed);
        let camera = finding(&report, "camera");
        assert_eq!(camera["severity"], severity, "{room}: {camera}");
        assert_eq!(code, i32::from(severity == "stop"), "{room}: {report}");
        assert_eq!(finding(&report, "picture").is_null(), severity != "fine", "{room}");
        let cameras = report["placement"]["cameras"].as_array().unwrap();
        let n = cameras.iter().filter(|camera| !camera["tripod_m"].is_null()).count();
        assert_eq!(n == 0, severity == "stop", "{room}: {n} cameras have a place");
    }
    // A camera position that was typed is accepted without a warning.
    let door = ["check", "NOOR", "--room", "4x3x2.5", "--camera-at", "0,-3,1"];
    let (code, report, _) = run(at, &door);
    assert_eq!((code, finding(&report, "camera")), (0, &Value::Null), "{report}");
}

#[test]
fn a_typed_height_is_kept_or_it_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let high = ["check", "HI", "--set", "letters.cap_height_m=1.5"];
    let (code, report, _) = run(at, &[&high[..], &["--room", "3x3x2.2"]].concat());
    let word_m = report["placement"]["word_m"].as_array().unwrap();
    let height_m = word_m[3].as_f64().unwrap() - word_m[1].as_f64().unwrap();
    assert!(height_m > 1.45, "as high as typed: {height_m}");
    assert_eq!((code, &finding(&report, "volume")["severity"]), (1, &json!("stop")));
    let (_, _, said) = run(at, &high);
    assert!(said.contains("do not fit into letters.canvas_m") && said.contains("1.30 m"), "{said}");
    let (_, _, said) = run(at, &["check", "HI", "--set", "letters.cap_height_m=0.4"]);
    assert!(!said.contains("do not fit"), "{said}");
}

#[test]
fn one_rule_says_whether_the_battery_lasts() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let charged = |frac: &str| {
        let charge = format!("battery.charge_frac={frac}");
        let (code, report, _) = run(at, &["check", "NOOR", "--set", &charge]);
        (code, finding(&report, "battery").clone())
    };
    let (full_code, full) = charged("1");
    let (low_code, low) = charged("0.2");
    assert_eq!((full_code, low_code), (0, 1), "{full}, {low}");
    let least_v = low["limit"].as_f64().unwrap();
    assert!((full["limit"].as_f64().unwrap() - least_v).abs() < 0.01, "{full}, {low}");
    assert!(low["value"].as_f64().unwrap() < least_v && least_v < full["value"].as_f64().unwrap());
    assert!(low["found"].as_str().unwrap().contains("3.02 V at the highest load"), "{low}");
    // The exported script requires the voltage that its own flight, that of the trajectory, needs.
    let to = ["export", "NOOR", "--to", "crazyswarm2", "-o", "swarm"];
    let (code, ..) = run(at, &to);
    assert_eq!(code, 0);
    let wanted_v = data(&at.join("swarm/fly_NOOR.py"))["drones"][0]["least_rest_v"].clone();
    let wanted_v = wanted_v.as_f64().unwrap();
    assert!(
        (wanted_v - least_v).abs() < 0.05,
        "{wanted_v} V in the script, {least_v} V in the check"
    );
    let (code, report, _) = run(at, &[&to[..], &["--set", "battery.charge_frac=0.2"]].concat());
    assert_eq!(code, 1);
    assert!(report["stops"].as_str().unwrap().contains("battery"), "{report}");
}

#[test]
fn crazyswarm2_flies_the_scenes_controller_or_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let lee = ["controller.kind=geometric", "plan.style.acceleration_m_s2=0.5"];
    let lee = ["--set", lee[0], "--set", lee[1]];
    let mut lights_s = Vec::new();
    for (more, number, gain) in [(&[][..], 1, "posCtlPid.zKp"), (&lee[..], 5, "ctrlLee.mass")] {
        let to = ["export", "NOOR", "--to", "crazyswarm2", "-o", "swarm"];
        let (code, ..) = run(at, &[&to[..], more].concat());
        assert_eq!(code, 0);
        let yaml = std::fs::read_to_string(at.join("swarm/crazyflies.yaml")).unwrap();
        assert!(yaml.contains(&format!("      controller: {number}\n")), "{yaml}");
        let drone = &data(&at.join("swarm/fly_NOOR.py"))["drones"][0];
        let parameters = drone["parameters"].as_array().unwrap();
        assert_eq!(parameters[0], json!(["stabilizer.controller", number]));
        assert!(parameters.iter().any(|parameter| parameter[0] == gain), "{parameters:?}");
        let lit = &drone["lights"][0];
        lights_s.push(lit[0].as_f64().unwrap() - drone["start_s"].as_f64().unwrap());
        std::fs::remove_dir_all(at.join("swarm")).unwrap();
    }
    // The lights are delayed, because the PID controller lags behind.
    assert!((0.15..0.9).contains(&(lights_s[0] - lights_s[1])), "{lights_s:?}");
    let to = ["export", "NOOR", "--to", "crazyswarm2", "--unchecked", "--tolerance", "30"];
    let (code, _, said) = run(at, &[&to[..], &["--set", "controller.kind=lqr"]].concat());
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("pid or geometric"), "{said}");
    assert!(names_in(at).is_empty(), "nothing is written");
}

#[test]
fn every_name_that_crazyswarm2_is_told_is_the_firmwares() {
    let names = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/firmware-names.txt");
    let names = std::fs::read_to_string(names).unwrap();
    let knows = |kind: &str, name: &str| names.lines().any(|line| line == format!("{kind} {name}"));
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let lee = ["--set", "controller.kind=geometric", "--set", "plan.style.acceleration_m_s2=0.5"];
    let ring = ["--set", "plan.lights=[\"ring\"]", "--set", "light.ring=solid"];
    let mut n = 0;
    for (index, more) in [&[][..], &lee, &ring, &["--color", "red"]].into_iter().enumerate() {
        let out = format!("swarm{index}");
        let to = ["export", "I", "--to", "crazyswarm2", "-o", &out];
        assert_eq!(run(at, &[&to[..], more].concat()).0, 0, "{more:?}");
        let drone = &data(&at.join(&out).join("fly_I.py"))["drones"][0];
        let named = |part: &str, column: usize| -> Vec<String> {
            let rows = drone[part].as_array().unwrap().iter();
            rows.map(|row| row[column].as_str().unwrap().to_owned()).collect()
        };
        let all =
            [named("before", 0), named("parameters", 0), named("lights", 1), named("dark", 0)];
        for name in all.concat().iter().map(String::as_str).chain(["led.bitmask"]) {
            assert!(knows("param", name), "{name}");
            n += 1;
        }
        let yaml = std::fs::read_to_string(at.join(&out).join("crazyflies.yaml")).unwrap();
        let logged = yaml.split("vars: [").nth(1).unwrap().split(']').next().unwrap();
        for name in logged.split(", ").map(|name| name.trim_matches('"')) {
            assert!(knows("log", name), "{name}");
        }
    }
    assert!(
        n > 100 && knows("param", "stabilizer.controller") && !knows("param", "no.name"),
        "{n}"
    );
}

/// A drone show as a viewer plays it.
struct Show {
    points: Vec<(f64, [f64; 3], Vec<[f64; 3]>)>,
    /// Times in s, each with the color from that time on.
    lights: Vec<(f64, [u8; 3])>,
    yaw_deg: f64,
}

impl Show {
    fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap();
        // The zip entry is stored uncompressed, so that its text follows the first file name.
        let begin = bytes.windows(9).position(|window| window == b"show.json").unwrap() + 9;
        let mut texts = serde_json::Deserializer::from_slice(&bytes[begin..]).into_iter::<Value>();
        let show = texts.next().unwrap().unwrap();
        let drone = &show["swarm"]["drones"][0]["settings"];
        let place = |value: &Value| [0, 1, 2].map(|axis| value[axis].as_f64().unwrap());
        let point = |point: &Value| {
            let control = point[2].as_array().unwrap().iter().map(place).collect();
            (point[0].as_f64().unwrap(), place(&point[1]), control)
        };
        let points = drone["trajectory"]["points"].as_array().unwrap().iter().map(point).collect();
        let program = BASE64_STANDARD.decode(drone["lights"]["data"].as_str().unwrap()).unwrap();
        let yaw_deg = drone["yawControl"]["setpoints"][0][1].as_f64().unwrap();
        Self { points, lights: Self::play(&program), yaw_deg }
    }

    /// Interprets a Skybrush light program. Its commands are 4 (color), 6 (black) and 7 (white),
    /// each with a duration in steps of 20 ms, and 0 (end).
    fn play(program: &[u8]) -> Vec<(f64, [u8; 3])> {
        let (mut at, mut steps, mut lights) = (0, 0_u64, Vec::new());
        while program[at] != 0 {
            let (color, bytes) = match program[at] {
                4 => ([program[at + 1], program[at + 2], program[at + 3]], 3),
                6 => ([0; 3], 0),
                7 => ([255; 3], 0),
                other => panic!("command {other}"),
            };
            lights.push((steps as f64 / 50.0, color));
            at += 1 + bytes;
            let mut shift = 0;
            loop {
                steps += u64::from(program[at] & 127) << shift;
                (shift, at) = (shift + 7, at + 1);
                if program[at - 1] < 128 {
                    break;
                }
            }
        }
        lights
    }

    fn place(&self, time_s: f64) -> [f64; 3] {
        let next = self.points.iter().position(|point| point.0 >= time_s).unwrap().max(1);
        let ((from_s, from, _), (to_s, to, control)) = (&self.points[next - 1], &self.points[next]);
        let share = (time_s - from_s) / (to_s - from_s);
        let mut left: Vec<[f64; 3]> =
            [*from].into_iter().chain(control.iter().copied()).chain([*to]).collect();
        while left.len() > 1 {
            let between = |pair: &[[f64; 3]]| {
                [0, 1, 2].map(|k| pair[0][k] + share * (pair[1][k] - pair[0][k]))
            };
            left = left.windows(2).map(between).collect();
        }
        left[0]
    }

    /// Returns the positions (x, z) at which the light is switched.
    fn changes(&self) -> Vec<[f64; 2]> {
        let dark = |color: [u8; 3]| color == [0; 3];
        let edges = self.lights.windows(2).filter(|pair| dark(pair[0].1) != dark(pair[1].1));
        edges.map(|pair| self.place(pair[1].0)).map(|[x, _, z]| [x, z]).collect()
    }
}

#[test]
fn a_skybrush_show_is_lit_on_the_strokes_of_the_same_file_in_a_color_that_shows() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (code, report, _) =
        run(at, &["export", "HI", "--color", "red", "--to", "skyc", "-o", "hi.skyc"]);
    assert_eq!(code, 0, "{report}");
    assert!(report["note"].as_str().unwrap().contains("viewers"), "what it is not for: {report}");
    let show = Show::read(&at.join("hi.skyc"));
    let lit: Vec<[u8; 3]> =
        show.lights.iter().map(|(_, color)| *color).filter(|color| *color != [0; 3]).collect();
    assert!(
        lit.len() >= 4 && lit.iter().all(|[r, g, b]| *r == 255 && *g < 60 && *b < 60),
        "{lit:?}"
    );
    // The two stems and the bar of the H, and the I, must begin and end at the plan's positions.
    noctograph(at).args(["plan", "HI", "-o", "plan.csv"]).assert().success();
    let plan = std::fs::read_to_string(at.join("plan.csv")).unwrap();
    let head: Vec<&str> = plan.lines().next().unwrap().split(',').collect();
    let column = |name: &str| head.iter().position(|column| *column == name).unwrap();
    let (x, z, lit) = (column("x_m"), column("z_m"), column("lit"));
    let rows: Vec<[f64; 3]> = plan
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect::<Vec<_>>())
        .map(|cells| [x, z, lit].map(|column| cells[column].parse().unwrap()))
        .collect();
    let wanted: Vec<[f64; 2]> = rows
        .windows(2)
        .filter(|pair| (pair[0][2] > 0.0) != (pair[1][2] > 0.0))
        .map(|pair| [pair[1][0], pair[1][1]])
        .collect();
    let found = show.changes();
    assert_eq!(found.len(), wanted.len(), "{found:?}, {wanted:?}");
    for (found, wanted) in found.iter().zip(&wanted) {
        // The tolerance covers 10 ms at 0.2 m/s, and the distance of the trajectory from the
        // design.
        let off_m = (found[0] - wanted[0]).hypot(found[1] - wanted[1]);
        assert!(off_m < 0.005, "{found:?} instead of {wanted:?}");
    }
    assert_eq!(show.yaw_deg, 0.0);
    let turned = ["export", "HI", "--set", "plan.yaw_rad=-1.5", "--to"];
    let (code, ..) = run(at, &[&turned[..], &["skyc", "-o", "turned.skyc"]].concat());
    let yaw_deg = Show::read(&at.join("turned.skyc")).yaw_deg;
    assert_eq!((code, yaw_deg), (0, 1.5_f64.to_degrees()), "clockwise from above");
    let (code, _, said) = run(at, &[&turned[..], &["vviz", "-o", "turned.vviz"]].concat());
    assert_eq!(code, 2);
    assert!(said.contains("plan.yaw_rad"), "a heading that VVIZ would lose is refused: {said}");
}

#[test]
fn every_format_takes_the_smallest_word() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for format in ["cflib", "compressed", "poly4d", "crazyswarm2", "skyc", "vviz"] {
        // `--unchecked` is needed, because `check` stops a dot, which is too small for the camera.
        let arguments = ["export", ".", "--unchecked", "--to", format, "-o", format];
        let (code, report, said) = run(at, &arguments);
        assert_eq!(code, 0, "{format}: {report} {said}");
    }
    let csv = std::fs::read_to_string(at.join("crazyswarm2/drawing.csv")).unwrap();
    assert!(csv.lines().count() > 2, "numpy.loadtxt makes no table of one row: {csv}");
}

/// Returns the table of all checks for `docs/fly.md`, in the order in which they are performed. Its
/// columns are the check, the program that performs it, its limit, and the source.
fn table_of_checks() -> String {
    let [cf2, brushless] = [Platform::Crazyflie2, Platform::Brushless].map(Platform::low_battery_v);
    let [lighthouse, uwb] = [Positioning::Sweeps, Positioning::UwbTwr]
        .map(|positioning| 100.0 * libm::sqrt(variance_m2(positioning)));
    let [nose, level] = [NOSE_RAD, LEVEL_RAD].map(|rad| rad.to_degrees().round());
    let corner = 100.0 * CORNER_M;
    let releases = [Release::OLDEST, Feature::CLOCK.last_without(), Feature::HEADING.since];
    let [oldest, slow, heading] = releases.map(Release::name);
    // The numbers are taken from the code, so that the page cannot differ.
    format!(
        "\
| what is checked | by | limit | from |
|---|---|---|---|
| the plan's volume, speed, acceleration, tilt, motors, lights | `check` | those of the profile, within the room | `src/pipeline/preflight/profile.rs` |
| one frame: stations or anchors, take-off marks, a camera whose position is given | `check` | in the room (`--room`) to {FRAME_M} m. A camera outside the room causes a warning | x = y = 0 is the middle of the floor |
| a plan from the floor to the floor, with velocities that match its positions | `check` | to within a quarter of the distance | `src/pipeline/preflight/plans.rs` |
| people (`sensors.lighthouse.people_m`) beside take-off, flight and landing | `check` | the audience's distance: {MOTORS_STOP_S:.0} s at the maximum speed of the plan's positions, or at the maximum horizontal speed of the flight, plus the fall. At least {LEAST_PEOPLE_M:.0} m | `COMMANDER_WDT_TIMEOUT_SHUTDOWN` |
| objects beside take-off, flight and landing: camera, `floor.steps`, stations or anchors, mirrors and panes. The height above objects on the floor is ignored, because a drone lands straight down | `check` | 0.2 m as from walls, plus the drone's radius: 0.28 m for a Crazyflie | `src/pipeline/preflight/obstacles.rs` |
| the room's unit | `--room`, `check` | `check` asks about a ceiling of 7.5 m or more, and warns of one of 6.5 m or more | rooms in feet: 13x20x8 |
| weight, wind, estimator, base stations close together, sunlight on Lighthouse | `check` | indoors 150 g and 1.5 m/s, or 4 m/s below 100 g; stations 1 m apart | `src/pipeline/preflight/surroundings.rs` |
| thrust to hover | `check` | 85 % of the maximum thrust at the end of the flight | the simulated flight |
| the camera's position | `check` | a common camera inside the room shows the whole word | `src/pipeline/preflight/placement.rs` |
| cflib | cflib | {OLDEST_CFLIB} or newer | arming, protocol 8 |
| drone and positioning, lamp and card decks | cflib | those of the scene | version port, `deck.*` |
| firmware | cflib | {oldest} or newer; clock of trajectories 84/85 up to {slow} | `supervisor.c`, `usec_time.c` |
| heading of a trajectory on board, unless it is 0 | `export`, cflib | firmware {heading} or newer | `pptraj_compressed.c` |
| firmware's clock, from the release given by `--firmware` | Crazyswarm2 | 84/85 up to {slow}, for which the trajectory is sped up | its server reads no parameters |
| names of parameters and logs | cflib, Crazyswarm2 | all on the drone | tables of contents of the drone |
| state: can fly, and is not locked, tumbled, crashed or with a deck fault | cflib, Crazyswarm2, firmware | `supervisor.info` before take-off. In the air the firmware itself stops the motors | `supervisor.c` |
| position settled | cflib, Crazyswarm2 | σ of x, y, z: {lighthouse:.0} cm with Lighthouse, {uwb:.0} cm with ultra-wideband | `kalman.varP*` |
| place (start position) | cflib, Crazyswarm2 | {START_RADIUS_M} m from the plan's start | only the path from this start to the first letter was checked |
| nose, roll and pitch | cflib, Crazyswarm2 | {nose:.0}°, {level:.0}° | `stateEstimate.*` |
| battery at rest | `check`, cflib, Crazyswarm2 | minus the voltage sag in this flight, above the low-battery voltage | the simulated flight |
| battery in the air | `check`, cflib, Crazyswarm2, firmware | {cf2} V (brushless {brushless} V) for {LOW_BATTERY_S:.0} s, in scripts {CRITICAL_BATTERY_V:.1} V for {WRONG_S} s | `platform_defaults_*.h` |
| fence | cflib, Crazyswarm2 | {FENCE_M} m outside the plan's volume, for {WRONG_S} s | half the distance of the volume from walls |
| distance from the target | cflib | {MAX_POSITION_ERROR_M} m for {WRONG_S} s | PID trails by 0.45 m at 0.8 m/s |
| values that are not numbers: position, variances, angles, battery | cflib, Crazyswarm2 | before take-off and, for {WRONG_S} s, in the air | such a value (NaN) exceeds no limit |
| radio silence | cflib, Crazyswarm2, firmware | the firmware, with setpoints, levels the drone after {LEVEL_OUT_S} s, and stops the motors after {MOTORS_STOP_S:.0} s. cflib lands the drone after 1 s without one of the log blocks, over a new link if it receives nothing at all. Crazyswarm2 lands all drones after {MOTORS_STOP_S:.0} s without one of its topics | `supervisor.c` |
| Lighthouse geometry (`--check-geometry`) | cflib | {corner:.0} cm at the corners of the canvas | accuracy of a hand and a ruler |
"
    )
}

#[test]
fn the_page_on_flying_has_the_tables_of_the_code() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/fly.md");
    let text = std::fs::read_to_string(&page).unwrap();
    let tables = [table_of_checks(), Feature::table()];
    let wanted = tables.iter().fold(text.clone(), |text, table| {
        let (head, _) = table.split_once('\n').unwrap();
        let (before, rest) = text.split_once(head).expect("the page has the table");
        let (_, after) = rest.split_once("\n\n").expect("a table ends in an empty line");
        format!("{before}{table}\n{after}")
    });
    if crate::bless::is_blessed(page.display()) {
        std::fs::write(&page, wanted).unwrap();
        return;
    }
    assert!(text == wanted, "docs/fly.md has other tables than safety.rs and release.rs; bless it");
}

/// Returns the exit code, the messages in one line, and the names of the files that were written.
fn exported(more: &[&str]) -> (i32, String, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let output = ["export", "I", "-o", "out"];
    let (code, report, said) = run(folder.path(), &[&output[..], more].concat());
    let said = format!("{said} {report}").split_whitespace().collect::<Vec<_>>().join(" ");
    (code, said, names_in(folder.path()))
}

#[test]
fn a_heading_is_exported_for_the_releases_that_fly_it_and_refused_for_others() {
    let forms = [
        (&["--to", "compressed"][..], true),
        (&["--to", "cflib", "--mode", "trajectory"], true),
        (&["--to", "cflib"], false),
        (&["--to", "poly4d"], false),
        (&["--to", "crazyswarm2"], false),
        (&["--to", "skyc"], false),
    ];
    for (form, is_compressed) in forms {
        for (release, misreads) in
            [("2023.11", true), ("2025.12.1", true), ("2026.04", true), ("2026.08.1", false)]
        {
            for yaw in ["-1.5708", "0.0001"] {
                let is_turned = yaw != "0.0001";
                let keys =
                    [format!("vehicle.firmware=\"{release}\""), format!("plan.yaw_rad={yaw}")];
                let set = ["--unchecked", "--set", &keys[0], "--set", &keys[1]];
                let (code, said, names) = exported(&[form, &set].concat());
                let is_refused = is_compressed && misreads && is_turned;
                let case = format!("{form:?} {release} {yaw}: {said}");
                assert_eq!(
                    (code, names.is_empty()),
                    (2 * i32::from(is_refused), is_refused),
                    "{case}"
                );
                assert_eq!(said.contains("heading of"), is_refused, "{case}");
                assert!(!is_refused || said.contains("poly4d") && said.contains("--mode position"));
            }
        }
    }
    let old = ["--set", "vehicle.firmware=2025.09", "--set", "plan.yaw_rad=0.3"];
    let folder = tempfile::tempdir().unwrap();
    let arguments = [&["preview", "I", "--as-exported", "compressed"][..], &old].concat();
    let (code, _, said) = run(folder.path(), &arguments);
    assert!(code == 2 && said.contains("heading of 17.2°"), "{said}");
    let (_, report, _) = run(folder.path(), &[&["check", "I"][..], &old].concat());
    let memory = finding(&report, "memory");
    assert_eq!(
        (&memory["severity"], &memory["detail"]),
        (&json!("warning"), &json!("poly4d, cflib"))
    );
}

#[test]
fn a_script_sends_the_setpoints_that_check_flies_and_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let lee = ["--set", "controller.kind=geometric", "--set", "plan.style.acceleration_m_s2=0.5"];
    let pid = ["--set", "controller.kind=pid"];
    let states = [&pid[..], &["--set", "controller.setpoints=full-state"]].concat();
    let lqr = ["--set", "controller.kind=lqr"];
    let ahead = ["--set", "controller.kind=lqr-feedforward"];
    let scenes: [(&[&str], _, _); 5] = [
        (&lee, "full-state", "position"),
        (&pid, "position", ""),
        (&states, "full-state", ""),
        (&lqr, "position", "full-state"),
        (&ahead, "full-state", "position"),
    ];
    for (scene, sends, refuses) in scenes {
        let to = ["export", "I", "--to", "cflib", "--unchecked", "-o", "I.py"];
        let to = [&to[..], scene].concat();
        let (code, _, said) = run(folder.path(), &to);
        assert_eq!(code, 0, "{scene:?}: {said}");
        let data = data(&folder.path().join("I.py"));
        assert_eq!(data["mode"], sends, "{scene:?}");
        for mode in ["position", "full-state"] {
            let is_refused = data["refused"].get(mode).is_some();
            assert_eq!(is_refused, mode == refuses, "{scene:?}: {}", data["refused"]);
            let (code, _, said) = run(folder.path(), &[&to[..], &["--mode", mode]].concat());
            assert_eq!(code, 2 * i32::from(is_refused), "{scene:?} {mode}: {said}");
            assert!(!is_refused || said.contains(sends), "{said}");
        }
    }
}

#[test]
fn a_script_of_setpoints_refuses_its_trajectory_by_the_scenes_release() {
    let folder = tempfile::tempdir().unwrap();
    for (release, yaw, is_refused, turns) in [
        ("2026.04", "0.5", true, true),
        ("2026.08", "0.5", false, true),
        ("2026.04", "0", false, false),
    ] {
        let keys = [format!("vehicle.firmware={release}"), format!("plan.yaw_rad={yaw}")];
        let to = ["export", "I", "--to", "cflib", "--unchecked", "-o", "I.py"];
        let set = ["--set", &keys[0], "--set", &keys[1]];
        assert_eq!(run(folder.path(), &[&to[..], &set].concat()).0, 0);
        let data = data(&folder.path().join("I.py"));
        let trajectory = &data["trajectory"];
        let said = data["refused"]["trajectory"].to_string();
        assert_eq!(said.contains("a heading of 28.6°"), is_refused, "{release} {yaw}: {said}");
        assert_eq!(trajectory["hex"] == "", is_refused, "{release} {yaw}");
        assert!(is_refused || trajectory["turns"] == turns, "{release} {yaw}: {trajectory}");
        assert_eq!(data["limits"]["heading_release"], "2026.08");
        assert_eq!(data["limits"]["slow_release"], "2026.08");
        assert_eq!(data["limits"]["oldest_firmware"], "2023.11");
    }
}

#[test]
fn a_script_that_needs_what_the_release_lacks_is_refused() {
    let lee = ["--set", "controller.kind=geometric", "--set", "plan.style.acceleration_m_s2=0.5"];
    let color_led = ["--set", "light.deck=color-led"];
    let brushless = ["--scene", "cf-brushless"];
    for (needs, before, since) in [
        (&lee[..], "2023.11", "2024.10"),
        (&color_led[..], "2025.09", "2025.12"),
        (&brushless[..], "2023.11", "2024.10"),
    ] {
        for to in ["cflib", "crazyswarm2", "poly4d"] {
            for release in [before, since] {
                let key = format!("vehicle.firmware={release}");
                let set = ["--unchecked", "--to", to, "--set", &key];
                let (code, said, _) = exported(&[needs, &set].concat());
                let is_refused = release == before && to != "poly4d";
                assert_eq!(code, 2 * i32::from(is_refused), "{to} {release}: {said}");
                assert_eq!(said.contains(&format!("{since} or newer for")), is_refused, "{said}");
            }
        }
    }
}
