//! Tests of photographs on the command line, of several drones, with a camera from EXIF, of a
//! render over a photo, and with equal bytes from every backend.

use std::path::Path;

use noctograph::flight::table::Table;
use noctograph::photo::{self, Photo, PhotoData};

use crate::cli::{fails, json, noctograph, run_json};
use crate::gpu_required;

/// Returns a light trace that begins at `x_m`, with the given color.
fn streak(x_m: f64, rgb: [f64; 3]) -> String {
    let mut csv = "t,x,y,z,r,g,b\n".to_owned();
    for i in 0..=400 {
        let t = f64::from(i) / 100.0;
        let (x, z) = (x_m + 0.1 * t, 0.6 + 0.2 * libm::sin(2.0 * t));
        csv += &format!("{t},{x:.4},0,{z:.4},{},{},{}\n", rgb[0], rgb[1], rgb[2]);
    }
    csv
}

fn write_streaks(folder: &Path) {
    let drones = [(-0.4, [1.0, 0.2, 0.1]), (0.0, [0.2, 1.0, 0.3]), (0.4, [0.2, 0.3, 1.0])];
    for ((x_m, rgb), name) in drones.into_iter().zip(["a.csv", "b.csv", "c.csv"]) {
        std::fs::write(folder.join(name), streak(x_m, rgb)).unwrap();
    }
}

#[test]
fn several_flights_are_one_photo_and_the_meter_lists_each_drone() {
    let folder = tempfile::tempdir().unwrap();
    write_streaks(folder.path());
    // The exposure is fixed, because the light meter would open the aperture for the darker colors.
    let exposure = ["--set", "camera.f_number=8"];
    let flags = ["--word", "NO", "--backend", "cpu", "--size", "320x180", "-o"];
    let expose = |flights: &[&str], name: &str| {
        let arguments = [&["expose"], flights, &exposure, &flags, &[name]].concat();
        noctograph(folder.path()).args(arguments).assert().success();
        photo::read(&folder.path().join(name)).unwrap()
    };
    let all = expose(&["a.csv", "b.csv", "c.csv"], "all.png");
    let alone = ["a.csv", "b.csv", "c.csv"].map(|flight| expose(&[flight], "one.png"));
    for (index, one) in alone.iter().enumerate() {
        let bright = one.rgb8.iter().zip(&all.rgb8).filter(|(one, _)| **one > 200);
        let (n, kept) =
            bright.fold((0, 0), |(n, k), (_, all)| (n + 1, k + usize::from(*all > 150)));
        assert!(n > 200 && kept * 20 > n * 19, "drone {index}: {kept} of {n} bright levels");
    }
    let flights = ["--flight", "a.csv", "--flight", "b.csv", "--flight", "c.csv"];
    let mut meter = noctograph(folder.path());
    let output = meter.args(["meter", "NO", "--json"]).args(flights).output().unwrap();
    let found = json(&output.stdout);
    let names: Vec<&str> =
        found["lamps"].as_array().unwrap().iter().map(|l| l["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["1: trace", "2: trace", "3: trace"]);
    assert!(found["ambient_stops"].as_f64().unwrap() < 0.0, "{found}");
}

/// Writes the flights of three drones that write a word together.
fn fly_three(folder: &Path) {
    let run = |arguments: &[&str]| {
        noctograph(folder).args(arguments).assert().success();
    };
    run(&["plan", "LOG", "--style", "even", "--drones", "3", "-o", "plans"]);
    for drone in ["1", "2", "3"] {
        let plan = format!("plans/plan-{drone}.csv");
        run(&["fly", &plan, "--seed", drone, "-o", &format!("{drone}.csv")]);
    }
}

#[test]
fn three_drones_and_every_ring_effect_have_the_same_bytes_on_every_backend_and_thread_count() {
    let folder = tempfile::tempdir().unwrap();
    fly_three(folder.path());
    for effect in ["double-spin", "solid", "memory", "fade", "off"] {
        let color =
            if matches!(effect, "double-spin" | "off") { "" } else { "color = [40, 10, 90]\n" };
        let scene = format!("[light.ring]\nkind = \"{effect}\"\n{color}");
        std::fs::write(folder.path().join("s.toml"), scene).unwrap();
        let hash = |backend: &str, threads: &str| {
            let mut command = noctograph(folder.path());
            command.env("LP_NUM_THREADS", threads).args(["expose", "1.csv", "2.csv", "3.csv"]);
            command.args(["--word", "LOG", "--size", "480x270", "--scene", "s.toml", "--json"]);
            let output = command.args(["--backend", backend]).output().unwrap();
            output.status.success().then(|| json(&output.stdout)["photo_sha256"].clone())
        };
        let on_cpu = hash("cpu", "1").unwrap();
        for threads in ["1", "4"] {
            let on_gpu = hash("wgpu", threads);
            assert!(on_gpu.is_some() || !gpu_required(), "{effect}: no device");
            if let Some(on_gpu) = on_gpu {
                assert_eq!(on_gpu, on_cpu, "{effect} with {threads} threads");
            }
        }
    }
}

#[test]
fn an_svg_is_written_in_its_colors_and_its_photo_is_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let strokes = "<path d='M0 0 v50' stroke='red'/><path d='M50 0 v50' stroke='#00f'/>";
    let svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 50 50' fill='none'>{strokes}</svg>"
    );
    std::fs::write(folder.path().join("two.svg"), svg).unwrap();
    let again = |arguments: &[&str]| {
        let mut command = noctograph(folder.path());
        command.args(["preview", "--backend", "cpu", "--json"]).args(arguments);
        json(&command.output().unwrap().stdout)["photo_sha256"].clone()
    };
    let lamp = ["--set", "light.deck=color-led"];
    let drawing = ["--drawing", "two.svg", "--size", "160x90", "-o", "one"];
    let first = again(&[&lamp[..], &drawing].concat());
    let photo = photo::read(&folder.path().join("one/photo.png")).unwrap();
    // `halves` contains the difference between red and blue in each half of the picture.
    let mut halves = [0; 2];
    for (i, pixel) in photo.rgb8.chunks(3).enumerate() {
        halves[usize::from(i % 160 >= 80)] += i32::from(pixel[0]) - i32::from(pixel[2]);
    }
    assert!(halves[0] > 10_000 && halves[1] < -10_000, "{halves:?}");

    assert_eq!(again(&["--scene", "one/photo.png", "-o", "two"]), first, "the scene of a photo");
}

#[test]
fn letters_in_several_colors_are_as_faithful_as_in_one() {
    let folder = tempfile::tempdir().unwrap();
    let faithfulness = |colors: &str| {
        let small = ["--backend", "cpu", "--size", "640x360", "-o", "out"];
        let preview = [&["preview", "PIX", "--color", colors], &small[..]].concat();
        run_json(folder.path(), &preview)["faithfulness"].as_f64().unwrap()
    };
    let (one, several) = (faithfulness("red"), faithfulness("red,chartreuse,#0af"));
    assert!(one > 0.95 && several > 0.95, "{one}, {several}");
}

/// The drawing has orange strokes and a short white stroke.
#[test]
fn a_drawing_that_fills_its_canvas_is_safe_and_its_colors_are_metered() {
    let folder = tempfile::tempdir().unwrap();
    let metered = |white: &str| {
        let strokes = format!("<path d='M0 0 h40 v20 h-40 z' stroke='#f80'/>{white}");
        let svg = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 40 20' fill='none'>{strokes}</svg>"
        );
        std::fs::write(folder.path().join("a.svg"), svg).unwrap();
        let drawing = ["--drawing", "a.svg", "--set", "light.deck=color-led"];
        noctograph(folder.path()).arg("check").args(drawing).assert().success();
        let found = run_json(folder.path(), &[&["meter"], &drawing[..]].concat());
        found["recommended"].clone()
    };
    let colored = metered("");
    assert!(colored["f_number"].is_number(), "{colored}");
    // White from four dies is three stops brighter than orange.
    let both = metered("<path d='M10 10 h4' stroke='#fff'/>");
    let stops = |found: &serde_json::Value| 2.0 * found["f_number"].as_f64().unwrap().log2();
    let less = stops(&both) - stops(&colored);
    assert!(both["filter_stops"] == 0 && (0.0..1.0).contains(&less), "{both}, {colored}");
}

#[test]
fn a_camera_from_a_photo_is_that_of_its_exif() {
    let folder = tempfile::tempdir().unwrap();
    write_streaks(folder.path());
    let scene = "[camera]\nf_number = 11.0\niso = 400.0\nwidth_px = 160\nheight_px = 120\n";
    std::fs::write(folder.path().join("s.toml"), scene).unwrap();
    let run = |arguments: &[&str], taken: &str| {
        let common = ["expose", "a.csv", "--word", "NO", "--backend", "cpu", "-o", taken];
        noctograph(folder.path()).args(common).args(arguments).assert().success();
        photo::read_with_notes(&folder.path().join(taken))
            .unwrap()
            .0
            .into_data()
            .scene_toml
            .unwrap()
    };
    // The EXIF data of this program's photos lacks the sensor size, so the scene's size is kept.
    run(&["--scene", "s.toml"], "taken.png");
    let scene = run(&["--camera-from", "taken.png", "--size", "160x120"], "again.png");
    for key in ["f_number = 11.0", "iso = 400.0", "shutter_close_s = 4.0", "width_px = 160"] {
        assert!(scene.contains(key), "{key} in {scene}");
    }
    let no_exif =
        Photo::made(PhotoData { width_px: 2, height_px: 2, rgb8: vec![9; 12], scene_toml: None });
    let file = folder.path().join("bare.png");
    std::fs::write(file, photo::encode_png(&no_exif, None, &[])).unwrap();
    let bare = ["expose", "a.csv", "--word", "NO", "--camera-from", "bare.png"];
    let output = noctograph(folder.path()).args(bare).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("no EXIF") && stderr.contains("hint: "), "{stderr}");
}

#[test]
fn a_render_is_laid_over_a_photo_of_the_same_word() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| noctograph(folder.path()).args(arguments).output().unwrap();
    let preview = ["preview", "NO", "--backend", "cpu"];
    run(&[&preview[..], &["--size", "480x270", "-o", "render"]].concat());
    run(&[&preview[..], &["--size", "640x360", "-o", "photo"]].concat());
    let compared = ["compare-photo", "render/photo.png", "photo/photo.png", "-o", "out", "--json"];
    let found = json(&run(&compared).stdout);
    let scale = found["transform"]["scale"].as_f64().unwrap();
    assert!((scale - 4.0 / 3.0).abs() < 0.01, "{found}");
    assert!(found["transform"]["rotation_rad"].as_f64().unwrap().abs() < 0.003, "{found}");
    assert!(found["residual_px"].as_f64().unwrap() < 1.2, "{found}");
    assert!(found["mean_flip"].as_f64().unwrap() < 0.1, "{found}");
    for name in ["overlay.png", "difference.png", "placed.png"] {
        let picture = photo::read(&folder.path().join("out").join(name)).unwrap();
        assert_eq!((picture.width_px, picture.height_px), (640, 360), "{name}");
    }
    fails(&["compare-photo", "a.png", "b.jpg"], &[], &["a.png"]);
}

#[test]
fn an_exr_in_a_folder_that_is_not_there_is_refused_before_the_work() {
    let files = [("a.csv", &*streak(0.0, [1.0; 3]))];
    let arguments = ["expose", "a.csv", "--word", "NO", "-o", "nowhere/photo.exr"];
    fails(&arguments, &files, &["nowhere/photo.exr", "no folder nowhere"]);
}

#[test]
fn two_million_samples_are_refused_with_the_memory_of_the_limit() {
    let text = "t,x,y,z,r,g,b\n".to_owned() + &"1,0,0,1,1,1,1\n".repeat(2_250_000);
    let error = Table::parse(text.as_bytes(), "big.csv").unwrap_err().to_string();
    assert!(error.contains("at most 240 MiB of memory"), "{error}");
}

#[test]
fn a_plan_of_another_word_is_refused_and_one_of_the_same_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| noctograph(folder.path()).args(arguments).assert();
    let small = ["--size", "480x270", "--backend", "cpu"];
    run(&[&["preview", "NO", "-o", "no"], &small[..]].concat());
    run(&["plan", "WE", "-o", "we.csv"]).success();
    run(&["score", "no/photo.png", "NO", "--plan", "no/plan.csv"]).code(predicates::ord::le(1));
    let refused = run(&["score", "no/photo.png", "NO", "--plan", "we.csv"]).code(2);
    let stderr = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    for text in ["we.csv", "in letter ", "the strokes of NO", "hint: "] {
        assert!(stderr.contains(text), "no {text:?} in {stderr}");
    }
}
