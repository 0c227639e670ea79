//! Tests of trajectories with random plans, and with recorded responses of other programs.
//!
//! A recorded file contains comment lines (`#`) that state the program and its version, a line
//! `bytes` in hexadecimal, and rows of time, position, velocity and acceleration in m and s.

use nalgebra::Vector3;
use proptest::array::uniform3;
use proptest::prelude::ProptestConfig;
use proptest::strategy::Strategy;
use proptest::test_runner::RngSeed;

use serde_json::{Value, json};
use unicode_normalization::UnicodeNormalization;

use super::compressed::{Compressed, Piece};
use super::lights::preparation;
use super::pieces::{Polynomials, Stretch, motion};
use super::poly4d::{MAX_PIECES, Poly4d};
use super::safety::{Battery, Checks, Platform};
use super::timeline::Timeline;
use super::{File, Form, Format, Job, Length, Mode, deviation_m, end_heights_m, export, flown};
use noctograph_core::camera::CameraOptions;
use noctograph_core::crazyflie::Release;
use noctograph_core::lamps::{ColorLedLevels, LightOptions};
use noctograph_letters::{LetterOptions, write};
use noctograph_plan::{Plan, PlanData, PlanOptions, Setpoint, plan};
use noctograph_sim::sensors::Positioning;
use noctograph_sim::{ControllerKind, SimOptions};

/// Time, with the position, velocity and acceleration at that time.
pub(super) type Row = (f64, [Vector3<f64>; 3]);

/// Returns the bytes that were given to the program, and its responses.
pub(super) fn read(text: &str) -> (Vec<u8>, Vec<Row>) {
    let mut bytes = Vec::new();
    let mut rows = Vec::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        if let Some(hex) = line.strip_prefix("bytes ") {
            let byte = |offset: usize| u8::from_str_radix(&hex[offset..offset + 2], 16).unwrap();
            bytes.extend((0..hex.len()).step_by(2).map(byte));
        } else {
            let n: Vec<f64> = line.split_whitespace().map(|n| n.parse().unwrap()).collect();
            let vector = |offset: usize| Vector3::new(n[offset], n[offset + 1], n[offset + 2]);
            rows.push((n[0], [vector(1), vector(4), vector(7)]));
        }
    }
    assert!(rows.len() >= 20, "{} rows", rows.len());
    (bytes, rows)
}

/// Decodes a trajectory from its bytes.
pub(super) fn decoded(bytes: &[u8]) -> Compressed {
    let int16 = |offset: usize| i16::from_le_bytes([bytes[offset], bytes[offset + 1]]);
    let (mut start_mm, yaw, mut offset) = ([0, 2, 4].map(int16), int16(6), 8);
    let mut pieces = Vec::new();
    while bytes[offset + 1..offset + 3] != [0; 2] {
        let (header, duration_ms) = (bytes[offset], int16(offset + 1).cast_unsigned());
        offset += 3;
        let axes = [0, 2, 4].map(|shift| {
            let n = [0, 1, 3, 7][usize::from(header >> shift & 3)];
            let points_mm: Vec<i16> = (0..n).map(|k| int16(offset + 2 * k)).collect();
            offset += 2 * n;
            points_mm
        });
        pieces.push(Piece { start_mm, duration_ms, axes });
        start_mm = pieces[pieces.len() - 1].end_mm();
    }
    assert_eq!(bytes[offset..], [0; 3], "the end");
    Compressed { pieces, yaw }
}

/// Compares this program's evaluation with the recorded responses, to within the single precision
/// of the other programs. At a time of 35 s this precision is 4 µs, in which a drone flies 1 µm.
pub(super) fn assert_same(rows: &[Row], pieces: &[Polynomials]) {
    for (time_s, want) in rows {
        let answer = motion(pieces, *time_s);
        for (k, tolerance) in [2e-6, 2e-5, 1e-3].into_iter().enumerate() {
            let error = (answer[k] - want[k]).norm();
            assert!(error <= tolerance, "derivative {k} at {time_s} s: {error}");
        }
    }
}

/// Returns the maximum distance of a trajectory from the design at the times of comparison, m.
pub(super) fn checked_m(stretch: &Stretch, pieces: &[Polynomials]) -> f64 {
    let off_m = |t: f64| (motion(pieces, t)[0] - stretch.position_m(t)).norm();
    stretch.check_times_s(0, stretch.last()).map(off_m).fold(0.0, f64::max)
}

/// Returns the configuration of tests with random plans: the same 1,000 in every run.
pub(super) fn same_thousand() -> ProptestConfig {
    ProptestConfig { cases: 1000, rng_seed: RngSeed::Fixed(17), ..ProptestConfig::default() }
}

/// Returns random plans of sine waves about (1, 1, 1) m for tests.
pub(super) fn waves() -> impl Strategy<Value = Plan> {
    let shape =
        (uniform3(0.2..0.6_f64), uniform3(0.02..1.0_f64), uniform3(0.0..std::f64::consts::TAU));
    (shape, 20..120_u32, 0.02..0.05_f64).prop_map(|((size_m, speed_m_s, phase), n, step_s)| {
        let rate: [f64; 3] = std::array::from_fn(|axis| speed_m_s[axis] / size_m[axis]);
        let setpoint = |k: u32| {
            let time_s = step_s * f64::from(k);
            let wave = |i: usize| libm::sincos(rate[i] * time_s + phase[i]);
            let each = |value: &dyn Fn(usize) -> f64| Vector3::new(value(0), value(1), value(2));
            Setpoint {
                time_s,
                position_m: each(&|i| 1.0 + size_m[i] * wave(i).0),
                velocity_m_s: each(&|i| size_m[i] * rate[i] * wave(i).1),
                acceleration_m_s2: each(&|i| -size_m[i] * rate[i] * rate[i] * wave(i).0),
                letter: Some(0),
            }
        };
        Plan::made(PlanData { setpoints: (0..n).map(setpoint).collect(), ..PlanData::default() })
    })
}

#[test]
fn a_name_keeps_its_letters_in_the_name_of_a_file() {
    for (word, name) in [
        ("Łódź", "Lodz"),
        ("Bjørn", "Bjorn"),
        ("Strauß", "Strauss"),
        ("José 2", "Jose2"),
        ("Ægir", "AEgir"),
        ("ΑΘΗΝΑ", "drawing"),
        ("", "drawing"),
        ("aux", "aux_"),
        ("COM1", "COM1_"),
        ("COMA", "COMA"),
        ("Auxerre", "Auxerre"),
    ] {
        assert_eq!(crate::stem(word), name);
    }
}

#[test]
fn a_page_names_words_of_shipped_fonts_as_the_program_does() {
    let characters: Vec<char> = include_str!("../../fonts/simplex.strokes")
        .lines()
        .filter_map(|line| line.split(' ').next()?.chars().next())
        .collect();
    assert!(characters.len() > 500 && characters.contains(&'½'));
    let spelled = |letter: char| {
        let spelling = super::SPELLED.split(' ').find_map(|pair| pair.strip_prefix(letter));
        spelling.map_or_else(|| letter.to_string(), str::to_owned)
    };
    for character in characters {
        // What a module without compatibility decompositions makes of the letter.
        let letters = character.nfd().map(spelled).collect::<String>();
        let name: String = letters.chars().filter(char::is_ascii_alphanumeric).collect();
        let wanted = if name.is_empty() { "drawing" } else { &name };
        assert_eq!(crate::stem(&character.to_string()), wanted, "{character}");
    }
}

/// Calls `act` with a job for plans of the word I under Lee's controller.
fn with_job<T>(plans: &[Plan], flown: &[Plan], act: impl FnOnce(Job<'_>) -> T) -> T {
    let mut sim = SimOptions::default();
    sim.controller.kind = ControllerKind::Geometric;
    let battery = Battery { rest_v: 4.1, least_rest_v: Some(3.9), sag_v: 0.2 };
    let checks = Checks {
        platform: Some(Platform::Crazyflie2),
        positioning: Positioning::Sweeps,
        volume_m: [[-1.8, -2.5, 0.0], [1.8, 2.5, 2.3]],
        room_m: None,
        batteries: vec![None, Some(battery)],
        scene_sha256: String::new(),
        scene_toml: String::new(),
    };
    act(Job {
        plans,
        flown,
        unsafe_because: None,
        word: "I",
        light: &LightOptions::default(),
        sim: &sim,
        camera: &CameraOptions::default().camera([-1.0, 0.5, 1.0, 1.5], 1.0).unwrap(),
        tolerance_m: 0.002,
        mode: Mode::FullState,
        refused: &[],
        trajectory_clock: 1.0,
        checks: &checks,
    })
}

/// Returns the plan of a word. Each drone writes 1.5 m to the right of the previous one, 3 s later.
fn planned(word: &str, drone: u32) -> Plan {
    let strokes = write(word, &LetterOptions::default()).unwrap();
    let mut plan = plan(&strokes, &PlanOptions::even()).unwrap();
    plan.edit(|plan| {
        for setpoint in &mut plan.setpoints {
            setpoint.time_s += 3.0 * f64::from(drone);
            setpoint.position_m.x += 1.5 * f64::from(drone);
        }
    });
    plan
}

/// Returns a plan of setpoints with time, position, velocity and headlight level.
fn lit(rows: &[(f64, [f64; 3], [f64; 3], f64)]) -> Plan {
    let setpoint =
        |&(time_s, place_m, velocity_m_s, _): &(f64, [f64; 3], [f64; 3], f64)| Setpoint {
            time_s,
            position_m: place_m.into(),
            velocity_m_s: velocity_m_s.into(),
            acceleration_m_s2: Vector3::zeros(),
            letter: Some(0),
        };
    let levels = rows.iter().map(|row| row.3).collect();
    Plan::made(PlanData {
        setpoints: rows.iter().map(setpoint).collect(),
        lights: [("headlights".to_owned(), levels)].into(),
        ..PlanData::default()
    })
}

fn names(files: &[File]) -> Vec<&str> {
    files.iter().map(|file| &*file.name).collect()
}

fn text(file: &File) -> &str {
    std::str::from_utf8(&file.bytes).unwrap()
}

/// Returns the data in a script.
fn data(file: &File) -> Value {
    let line = text(file).lines().find_map(|line| line.strip_prefix("DATA = json.loads(")).unwrap();
    let literal: String = serde_json::from_str(line.strip_suffix(')').unwrap()).unwrap();
    serde_json::from_str(&literal).unwrap()
}

#[test]
fn a_vviz_show_steps_along_the_flight_and_shows_its_lights_at_the_nearest_frame() {
    let v = [0.1, 0.2, 0.3];
    let plan = lit(&[
        (0.0, [1.0, 2.0, 0.0], v, 0.0),
        (1.02, [1.102, 2.204, 0.306], v, 1.0),
        (2.0, [1.2, 2.4, 0.6], [0.0; 3], 0.0),
        (2.44, [1.2, 2.4, 0.6], [0.0; 3], 0.0),
    ]);
    let plans = [plan.clone(), plan.clone()];
    let file = with_job(&plans, &plans, |job| export(Format::Vviz, &job)).unwrap().remove(0);
    let show: Value = serde_json::from_str(text(&file)).unwrap();
    assert_eq!((&*file.name, show["performances"].as_array().unwrap().len()), ("I.vviz", 2));
    let drone = &show["performances"][1];
    assert_eq!(drone["id"], 1);
    let agent = &drone["agentDescription"];
    let home = ["homeX", "homeY", "homeZ"].map(|key| agent[key].as_f64().unwrap());
    assert_eq!(home, [1.0, 0.0, 2.0], "y is up");
    let steps = agent["agentTraversal"].as_array().unwrap();
    assert_eq!(steps.len(), 26, "0 to 2.5 s at 10 Hz");
    let step = |row: usize| ["dx", "dy", "dz"].map(|key| steps[row][key].as_f64().unwrap());
    assert_eq!([step(0), step(1), step(25)], [[0.0; 3], [0.01, 0.03, 0.02], [0.0; 3]]);
    let colors = drone["payloadDescription"][0]["payloadActions"].as_array().unwrap();
    let is_lit: Vec<usize> = (0..colors.len()).filter(|row| colors[*row]["r"] != 0).collect();
    assert_eq!((colors.len(), is_lit), (50, (20..40).collect()), "1.02 to 2 s at 20 Hz");
    let turned = [Plan::made(PlanData { yaw_rad: 0.1, ..plan.into_data() })];
    let error = with_job(&turned, &turned, |job| export(Format::Vviz, &job)).unwrap_err();
    assert!(error.to_string().contains("plan.yaw_rad"), "{error}");
}

#[test]
fn crazyswarm2_gets_a_trajectory_of_each_drone_its_configuration_and_one_script() {
    let plans = [planned("I", 1), planned("I", 0)];
    let flown = flown(Release::MODELED, &plans, Form::Poly4d, 0.005, Length::OnBoard).unwrap();
    let files = with_job(&plans, &flown, |job| {
        let job = Job { tolerance_m: 0.005, ..job };
        let refused = |job: &Job<'_>| export(Format::Crazyswarm2, job).unwrap_err().to_string();
        let regulator = SimOptions::default();
        assert!(refused(&Job { sim: &regulator, ..job }).contains("controller.kind"));
        let unknown = Checks { platform: None, ..job.checks.clone() };
        assert!(refused(&Job { checks: &unknown, ..job }).contains("preset"));
        assert!(refused(&Job { trajectory_clock: 0.99, ..job }).contains("plan.trajectory_clock"));
        let brushless = Checks { platform: Some(Platform::Brushless), ..job.checks.clone() };
        let files = export(Format::Crazyswarm2, &Job { checks: &brushless, ..job }).unwrap();
        let yaml = text(&files[2]);
        assert!(yaml.contains("type: cf21bl") && yaml.contains("voltage_warning: 3.35"), "{yaml}");
        export(Format::Crazyswarm2, &job).unwrap()
    });
    assert_eq!(names(&files), ["I-1.csv", "I-2.csv", "crazyflies.yaml", "fly_I.py"]);
    let (yaml, data) = (text(&files[2]), data(&files[3]));
    let start_m = plans[1].setpoints[0].position_m;
    for line in [
        "  cf1:\n    enabled: true\n    uri: radio://0/80/2M/E7E7E7E701\n".to_owned(),
        format!("initial_position: [{:?}, {:?}, 0.0]", start_m.x, start_m.y),
        "    uri: radio://0/80/2M/E7E7E7E702\n".to_owned(),
        "    type: cf21\n".to_owned(),
        "voltage_warning: 3.2\n".to_owned(),
        "      controller: 5\n".to_owned(),
    ] {
        assert!(yaml.contains(&line), "{line} in {yaml}");
    }
    assert_eq!(
        (&data["word"], &data["platform"]),
        (&json!("I"), &json!("Crazyflie 2.1 or Crazyflie 2.0"))
    );
    // The limit is ten times the settled variance.
    assert_eq!([&data["variance_m2"], &data["lost_m2"]], [0.001, 0.01]);
    let first_s = Stretch::new(&plans[1]).unwrap().start_s();
    for (index, (plan, file)) in plans.iter().zip(&files).enumerate() {
        let drone = &data["drones"][index];
        let stretch = Stretch::new(plan).unwrap();
        let number = |key: &str| drone[key].as_f64().unwrap();
        assert_eq!(drone["name"], format!("cf{}", index + 1));
        assert_eq!(drone["csv"], file.name);
        assert_eq!(number("start_s"), first_s - 7.0, "3.5 s up, and 3.5 s to the first letter");
        let [least_rest_v, top_m] = ["least_rest_v", "top_m"].map(number);
        assert_eq!(least_rest_v, [3.8, 3.9][index]);
        assert_eq!(top_m, plan.setpoints.iter().map(|s| s.position_m.z).fold(0.0, f64::max));
        let letters_s = stretch.start_s() + stretch.duration_s();
        assert!((number("end_s") - letters_s - 0.2).abs() < 0.1, "{drone}");
        assert_eq!(drone["parameters"][0], json!(["stabilizer.controller", 5]));
        assert_eq!(drone["parameters"][1][0], "ctrlLee.Kpos_Px");
        let lights = drone["lights"].as_array().unwrap();
        let lit_s = lights[0][0].as_f64().unwrap() - stretch.start_s();
        assert!((0.0..1.0).contains(&lit_s), "in the time of its plan: {lit_s} s");
        assert_eq!(drone["dark"], json!([["ring.headlightEnable", 0]]));
        // The drone lands by itself 3 s after the script's landing.
        let durations_s = text(file).lines().skip(1).map(|row| row.split_once(',').unwrap().0);
        let durations_s: Vec<f64> = durations_s.map(|text| text.parse().unwrap()).collect();
        let lasts_s: f64 = durations_s.iter().sum();
        let lands_s = number("end_s") - number("start_s") + 3.0;
        // The drone descends to 0.1 m below the floor at 0.3 m/s, and then has no goal for 1 s.
        let down_s = (stretch.setpoints[stretch.last()].position_m.z + 0.1) / 0.3 + 1.0;
        assert!((lasts_s - lands_s - down_s).abs() < 0.02, "{lasts_s} {lands_s} {down_s}");
    }
}

#[test]
fn a_skybrush_show_has_the_ways_the_limits_and_the_camera() {
    let plans = [planned("I", 0), planned("I", 1)];
    let plans = plans.map(|plan| Plan::made(PlanData { yaw_rad: 0.5, ..plan.into_data() }));
    let flown = flown(Release::MODELED, &plans, Form::Compressed, 0.002, Length::Any).unwrap();
    let (file, focal) = with_job(&plans, &flown, |job| {
        let focal = 36.0 * job.camera.focal_length_m / job.camera.sensor_width_m;
        (export(Format::Skyc, &job).unwrap().remove(0), focal)
    });
    assert_eq!(file.name, "I.skyc");
    // A stored entry consists of its header, its name and its contents.
    let size = u32::from_le_bytes(file.bytes[18..22].try_into().unwrap()) as usize;
    let show: Value = serde_json::from_slice(&file.bytes[39..39 + size]).unwrap();
    assert_eq!(show["environment"]["cameras"][0]["focalLength"], focal);
    let heights = plans[0].setpoints.iter().map(|s| s.position_m.z).fold(0.0, f64::max);
    let limits = &show["settings"]["validation"];
    assert_eq!(limits["maxAltitude"], (heights + 0.5).ceil());
    assert_eq!([&limits["maxVelocityXY"], &limits["maxVelocityZ"]], [1.0, 1.0], "at least");
    let later_s = [0.0, 3.0];
    for (index, plan) in plans.iter().enumerate() {
        let settings = &show["swarm"]["drones"][index]["settings"];
        assert_eq!(settings["name"], format!("Drone {}", index + 1));
        let turned = settings["yawControl"]["setpoints"][0][1].as_f64().unwrap();
        assert!((turned + 0.5_f64.to_degrees()).abs() < 1e-9, "clockwise: {turned}");
        let points = settings["trajectory"]["points"].as_array().unwrap();
        let times_s: Vec<f64> = points.iter().map(|point| point[0].as_f64().unwrap()).collect();
        assert!(times_s.windows(2).all(|pair| pair[0] < pair[1]), "{times_s:?}");
        let stretch = Stretch::new(plan).unwrap();
        let letters = times_s.iter().position(|s| (s - 7.0 - later_s[index]).abs() < 1e-6);
        let letters = letters.expect("the letters begin after 7 s, or in their turn");
        let end_s = 7.0 + later_s[index] + stretch.duration_s();
        assert!((times_s[times_s.len() - 3] - end_s).abs() < 0.01, "{times_s:?}");
        assert_eq!((letters, points[0][1][2].as_f64()), (2 + index, Some(0.0)), "up, there, wait");
        assert_eq!(points[points.len() - 1][1], settings["landAt"]);
        assert_eq!(points[letters][2].as_array().unwrap().len(), [2, 0][index], "or hovers");
    }
}

#[test]
fn several_drones_have_a_script_each_and_one_that_starts_them() {
    let plans = [planned("I", 0), planned("I", 1)];
    let flown = flown(Release::MODELED, &plans, Form::Compressed, 0.002, Length::OnBoard).unwrap();
    let files = with_job(&plans, &flown, |job| {
        let of_mode = |mode| {
            let job = Job { mode, ..job };
            deviation_m(Format::Cflib, &job).unwrap()
        };
        assert_eq!(of_mode(Mode::Position), None, "no trajectory");
        let off_m = of_mode(Mode::Trajectory).unwrap();
        assert!((0.0005..0.0025).contains(&off_m), "{off_m} m");
        let reasons = [("position", "not with Lee's".to_owned())];
        export(Format::Cflib, &Job { refused: &reasons, ..job }).unwrap()
    });
    assert_eq!(names(&files), ["I-1.py", "I-2.py", "fly_I.py"]);
    let alone = |job: Job<'_>| export(Format::Cflib, &job).unwrap();
    assert_eq!(names(&with_job(&plans[..1], &flown[..1], alone)), ["I.py"]);
    assert!(text(&files[2]).contains("SCRIPTS = [\"I-1.py\",\"I-2.py\"]"));
    for (file, plan) in files.iter().zip(&plans) {
        let data = data(file);
        assert_eq!(data["refused"], json!({ "position": "not with Lee's" }));
        let rows = |lights: &Value| -> Vec<(f64, Value)> {
            let rows = lights.as_array().unwrap().iter();
            rows.map(|row| (row[0].as_f64().unwrap(), row[2].clone())).collect()
        };
        let (sent, on_board) = (rows(&data["lights"]), rows(&data["trajectory"]["lights"]));
        assert_eq!(sent.len(), on_board.len());
        for (sent, on_board) in sent.iter().zip(&on_board) {
            assert!((sent.0 - on_board.0).abs() < 0.02 && sent.1 == on_board.1, "in plan's time");
        }
        let stretch = Stretch::new(plan).unwrap();
        let end_s = data["end_s"].as_f64().unwrap();
        assert!((end_s - stretch.start_s() - stretch.duration_s()).abs() < 0.3, "{end_s}");
    }
}

#[test]
fn a_light_that_changes_between_two_steps_changes_then() {
    let mut plan = planned("I", 0);
    let dark = |plan: &Plan| plan.lit().iter().rposition(|level| *level > 0.0).unwrap() + 1;
    let row = dark(&plan);
    plan.edit(|plan| plan.setpoints[row].time_s += 0.0043);
    let plans = [plan];
    let flown = flown(Release::MODELED, &plans, Form::Compressed, 0.002, Length::OnBoard).unwrap();
    let stretch = Stretch::new(&plans[0]).unwrap();
    let heights_m = [0.0, stretch.duration_s()].map(|time_s| stretch.position_m(time_s).z);
    assert_eq!(end_heights_m(&plans[0]).unwrap(), heights_m);
    let zero_s = stretch.start_s() - 7.0;
    let dark_s = plans[0].setpoints[row].time_s;
    let flown_s = flown[0].setpoints[dark(&flown[0])].time_s + zero_s;
    assert!((flown_s - dark_s).abs() < 1e-6, "{flown_s} s instead of {dark_s} s");
}

#[test]
fn decks_that_a_plan_does_not_light_are_dark_and_the_color_led_is_corrected_as_the_scene_says() {
    let headlights = lit(&[(0.0, [0.0; 3], [0.0; 3], 0.0)]);
    let before = preparation(&headlights, &LightOptions::default()).unwrap();
    let before: Vec<_> = before.iter().map(|(name, value)| (&**name, *value)).collect();
    assert_eq!(before, [("led.bitmask", 128), ("ring.headlightEnable", 0), ("ring.effect", 0)]);
    let lights = [("color-led".to_owned(), vec![0.0])].into();
    let color = Plan::made(PlanData { lights, ..headlights.into_data() });
    for (color_led_levels, value) in [(ColorLedLevels::Corrected, 1), (ColorLedLevels::Plain, 0)] {
        let options = LightOptions { color_led_levels, ..LightOptions::default() };
        let before = preparation(&color, &options).unwrap();
        assert!(before.contains(&("colorLedBot.brightCorr".to_owned(), value)), "{before:?}");
    }
}

#[test]
fn polynomials_fill_the_memory_to_the_last_piece() {
    let plan = planned("I", 0);
    let stretch = Stretch::new(&plan).unwrap();
    let mut trajectory = Poly4d::fit(Release::MODELED, &plan, 0.005).unwrap();
    let timeline = Timeline::new(&plan, &stretch, 0.0, trajectory.ends_m());
    let n = |it: &Poly4d| it.clone().flight(&timeline, 0.2).map(|it| it.pieces.len());
    let more = n(&trajectory).unwrap() - trajectory.pieces.len();
    trajectory.pieces = vec![trajectory.pieces[0]; MAX_PIECES - more];
    assert_eq!(n(&trajectory).unwrap(), MAX_PIECES);
    trajectory.pieces.push(trajectory.pieces[0]);
    assert!(n(&trajectory).unwrap_err().hint().contains("more drones"));
}

#[test]
fn log_configurations_have_a_block_each_and_the_card_has_all_variables() {
    let files = with_job(&[], &[], |job| export(Format::LogConfig, &job)).unwrap();
    let (card, radio) = files.split_last().unwrap();
    assert_eq!((radio.len(), &*card.name), (5, "config.txt"));
    let mut variables = Vec::new();
    for file in radio {
        let block =
            serde_json::from_slice::<Value>(&file.bytes).unwrap()["logconfig"]["logblock"].take();
        assert_eq!(file.name, format!("{}.json", block["name"].as_str().unwrap()));
        assert_eq!(block["period"], 20);
        for variable in block["variables"].as_array().unwrap() {
            let name = variable["name"].as_str().unwrap();
            let kind = if name.starts_with("motor.") { "uint16_t" } else { "float" };
            assert_eq!([&variable["stored_as"], &variable["fetch_as"]], [kind, kind], "{name}");
            variables.push(name.to_owned());
        }
    }
    let lines: Vec<&str> = text(card).lines().skip(7).collect();
    assert_eq!(lines, variables);
    let watched = super::log_config::python(&super::log_config::WATCH_BLOCKS);
    assert!(watched.contains("    \"where\": {\"stateEstimate.x\": \"float\", "), "{watched}");
    assert!(watched.ends_with("\"supervisor.info\": \"uint16_t\"},\n}"), "{watched}");
}
