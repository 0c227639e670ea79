use noctograph_core::flight::FlightData;
use std::fmt::Write;

use super::*;
use crate::Conditions;
use noctograph_core::random::{Noise, Normals};
use noctograph_letters::{LetterOptions, write};
use noctograph_pipeline::scene::Preset;
use noctograph_plan::plan;
use noctograph_sim::vehicle::{Gusts, VehicleOptions};
use noctograph_sim::{Drone, fly};

#[test]
fn names_are_in_the_order_of_their_numbers() {
    let mut names = ["cf10", "b", "cf2", "10.csv", "2.csv", "cf02", "cf1/10", "cf1/9"];
    names.sort_by_cached_key(|name| natural(name));
    assert_eq!(names, ["2.csv", "10.csv", "b", "cf1/9", "cf1/10", "cf02", "cf2", "cf10"]);
}

/// Returns a flight as a 100 Hz log of the firmware, with its estimate, noisy gyroscope readings,
/// setpoints and motor commands.
fn log(flight: &Flight, seed: u64) -> String {
    let mut text = String::from(
        "t,x,y,z,yaw,pitch,roll,wx,wy,wz,vx_body,vy_body,vz_body,ctrltarget.x,ctrltarget.y,ctrltarget.z,m1,m2,m3,m4\n",
    );
    let mut noise = Normals::new(Noise::new(seed, 0, "gyroscope"));
    let mut due_s = 0.0;
    for sample in &flight.samples {
        if sample.time_s + 1e-9 < due_s {
            continue;
        }
        due_s = sample.time_s + 0.01;
        let attitude = <[f64; 3]>::from(sample.attitude);
        let rate_rad_s = sample.rate_body_rad_s.map(|w| w + 0.003 * noise.next());
        let vectors = [rate_rad_s, sample.velocity_body_m_s, sample.design_m];
        let numbers = std::iter::once(&sample.time_s)
            .chain(&sample.estimate_m)
            .chain(&attitude)
            .chain(vectors.iter().flatten())
            .chain(&sample.motors);
        let cells = numbers.map(|number| format!("{number:.5}"));
        writeln!(text, "{}", cells.collect::<Vec<_>>().join(",")).unwrap();
    }
    text
}

/// Imports logs of three drones that differ in mass, trim, lag and gusts, and compares the
/// identified values with the drawn ones.
#[test]
fn flights_of_drawn_drones_give_back_what_was_drawn() {
    let mut scene = Scene { word: "NO".into(), ..Scene::preset(Preset::Cf21) };
    scene.air.gusts = Gusts::None;
    let wide = Conditions {
        mass_frac: 0.03,
        center_of_mass_m: 0.5e-3,
        motor_lag_s: 0.06,
        gust_m_s: 0.1,
        ..Conditions::still()
    };
    let folder = tempfile::tempdir().unwrap();
    let font = scene.letters.font.clone();
    let strokes = write("NO", &LetterOptions { font, ..LetterOptions::default() }).unwrap();
    let believed = scene.sim();
    let plan = plan(&strokes, &scene.plan).unwrap();
    let mut drawn: Vec<VehicleOptions> = Vec::new();
    for seed in 0..9_u64 {
        let actual = wide.draw(&scene, seed, 0).sim;
        let drone = Drone { actual: &actual, ..Drone::new(&believed, seed) };
        let flight = fly(&plan, &drone, &mut |_| {}).unwrap();
        let path = folder.path().join(format!("cf{}/{seed}.csv", seed % 3));
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, log(&flight, seed)).unwrap();
        drawn.push(actual.vehicle);
    }
    std::fs::write(folder.path().join("cf0/broken.csv"), "no log").unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("../cf0/0.csv", folder.path().join("cf2/again.csv")).unwrap();
    let evening =
        Evening::import(folder.path(), &ImportOptions::default(), &scene, &|_| {}).unwrap();
    let n = 10 + usize::from(cfg!(unix));
    assert_eq!((evening.logs.len(), evening.sound().count(), evening.drones().len()), (n, 9, 3));
    let again = evening.logs.iter().find(|log| log.log.contains("again"));
    let is_named = |log: &EveningLog| log.flaws == [Flaw::Again("cf0/0.csv".into())];
    assert!(again.is_none_or(is_named), "a link to a log is no other flight: {again:?}");
    let broken = evening.logs.iter().find(|log| log.log.contains("broken")).unwrap();
    assert!(matches!(broken.flaws[..], [Flaw::Unreadable(_)]), "{broken:?}");
    let mut lag_errors_s = Vec::new();
    let scene_s = |vehicle: &VehicleOptions| 0.5 * (vehicle.motor_rise_s + vehicle.motor_fall_s);
    for (seed, true_) in drawn.iter().enumerate() {
        let name = format!("{seed}.csv");
        let row = evening.logs.iter().find(|log| log.log.ends_with(&name)).unwrap();
        let figures = row.figures.unwrap();
        let thrust = figures.thrust_frac * true_.mass_kg / scene.vehicle.mass_kg;
        assert!((thrust - 1.0).abs() < 0.007, "{seed}: {figures:?}");
        for axis in 0..2 {
            let off_m = (figures.trim_m[axis] - true_.center_of_mass_m[axis]).abs();
            assert!(
                off_m < 3.0 * figures.trim_sigma_m.unwrap()[axis],
                "{seed}: {off_m} of {figures:?}"
            );
        }
        // A short flight may not reveal the lag of slow rotors.
        if let Some((lag_s, sigma_s)) = figures.lag_s.zip(figures.lag_sigma_s) {
            lag_errors_s.push(lag_s - scene_s(true_));
            let error_s = (lag_s - scene_s(true_)).abs();
            assert!(error_s < 2.5 * sigma_s, "{seed}: {error_s} of {figures:?}");
        }
        assert!((figures.gust_m_s.unwrap() - 0.1).abs() < 0.035, "{seed}: {figures:?}");
    }
    assert!(lag_errors_s.len() >= 6, "{lag_errors_s:?}");
    assert!(lag_errors_s.iter().all(|s| (-0.05..0.05).contains(s)), "{lag_errors_s:?}");
    let error_s = mean(&lag_errors_s);
    assert!(error_s.abs() < 0.03, "{error_s}");

    let conditions = evening.conditions();
    let value = |key| conditions.iter().find(|condition| condition.key == key).unwrap().value;
    let spread_of = |value: &dyn Fn(&VehicleOptions) -> f64| {
        spread(&drawn.iter().map(|vehicle| (value(vehicle), 0.0)).collect::<Vec<_>>())
    };
    let mass = spread_of(&|v| scene.vehicle.mass_kg / v.mass_kg);
    assert!((value("mass_frac") / mass - 1.0).abs() < 0.05, "{conditions:?} of {mass}");
    let trims_m = [0, 1].map(|axis: usize| spread_of(&|v| v.center_of_mass_m[axis]));
    let trim_m = libm::hypot(trims_m[0], trims_m[1]) / std::f64::consts::SQRT_2;
    assert!((value("center_of_mass_m") - trim_m).abs() < 0.15e-3, "{conditions:?} of {trim_m}");
    let lag_s = 12_f64.sqrt() * spread_of(&scene_s);
    assert!((value("motor_lag_s") - lag_s).abs() < 0.035, "{conditions:?} of {lag_s}");
    assert!((value("gust_m_s") - 0.1).abs() < 0.015, "{conditions:?}");
    assert!(
        conditions.iter().all(|condition| condition.key != "radio_outage_s"),
        "no gap: {conditions:?}"
    );
    let read = Conditions::parse(&evening.conditions_toml(&conditions), "conditions.toml").unwrap();
    assert!((read.mass_frac / value("mass_frac") - 1.0).abs() < 1e-3);
    assert_eq!(read.led_delay_s, Conditions::default().led_delay_s, "a room's");
}

#[test]
fn flaws_of_a_log_are_named_with_their_number() {
    let scene = Scene::preset(Preset::Cf21);
    let sample = |i: u32| FlightSample {
        time_s: f64::from(i) * 0.01,
        position_m: nalgebra::Vector3::z(),
        motors: [43_000.0 + f64::from(i / 100 % 7), 43_000.0, 43_000.0, 43_000.0],
        ..FlightSample::default()
    };
    let hover = || {
        Flight::made(FlightData {
            samples: (0..3000).map(sample).collect(),
            ..FlightData::default()
        })
    };
    let log = GatheredLog { path: "a".into(), drone: "a".into(), name: "a".into() };
    let flaws = |flight: Result<Flight>| EveningLog::new(&log, flight, &scene).flaws;
    assert_eq!(flaws(Ok(hover())), []);
    let still = EveningLog::new(&log, Ok(hover()), &scene);
    assert!(still.warnings[0].message.contains("does not show the rotors' lag"));
    let json = serde_json::to_value(&still).unwrap();
    assert_eq!(json["warnings"], serde_json::json!([still.warnings[0].message]));
    let mut moving = hover();
    moving.edit(|moving| moving.samples[1500].design_m.x = 0.1);
    assert_eq!(EveningLog::new(&log, Ok(moving), &scene).warnings, []);
    let (mut short, mut holed, mut limited, mut silent) = (hover(), hover(), hover(), hover());
    short.edit(|short| short.samples.truncate(500));
    assert!(matches!(flaws(Ok(short))[..], [Flaw::Short(s)] if (s - 4.99).abs() < 1e-9));
    holed.edit(|holed| _ = holed.samples.drain(1000..1500));
    holed.edit(|holed| holed.gaps = vec![[9.99, 15.0]]);
    assert!(
        matches!(flaws(Ok(holed))[..], [Flaw::Gaps(frac)] if (frac - 5.01 / 29.99).abs() < 1e-9)
    );
    limited.edit(|limited| limited.samples[..100].iter_mut().for_each(|s| s.motors[1] = 65_535.0));
    assert!(matches!(flaws(Ok(limited))[..], [Flaw::Saturated(s)] if (s - 1.0).abs() < 1e-9));
    silent.edit(|silent| silent.unlogged = [Quantity::Motors].into());
    assert!(matches!(flaws(Ok(silent))[..], [Flaw::Silent(_)]));
    let mut frozen = hover();
    frozen
        .edit(|frozen| frozen.samples.iter_mut().for_each(|sample| sample.motors = [43_000.0; 4]));
    assert_eq!(flaws(Ok(frozen)), [Flaw::Frozen]);
    let missing = noctograph_core::error::Error::Stopped;
    assert!(matches!(flaws(Err(missing))[..], [Flaw::Unreadable(_)]));
}

#[test]
fn guesses_about_a_log_are_its_warnings() {
    let (scene, folder) = (Scene::preset(Preset::Cf21), tempfile::tempdir().unwrap());
    let rows = (0..200).map(|i| format!("{},0,0.1,0.5", 0.01 * f64::from(i)));
    let text = format!("# firmware: 2025.12\nt,x,y,z\n{}\n", rows.collect::<Vec<_>>().join("\n"));
    std::fs::write(folder.path().join("cf1-1.csv"), text).unwrap();
    let firmware = Some(scene.vehicle.firmware);
    let options = ImportOptions { firmware, ..ImportOptions::default() };
    let evening = Evening::import(folder.path(), &options, &scene, &|_| {}).unwrap();
    let warnings: Vec<String> = evening.logs[0].warnings.iter().map(ToString::to_string).collect();
    let text = warnings.join("\n");
    assert!(text.contains("firmware 2025.12") && text.contains("z is assumed"), "{text}");
    assert!(!text.contains("not in the log"), "{text}");
}
