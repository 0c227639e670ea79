//! Golden images and accumulator hashes, under `golden/`.
//!
//! `NOCTOGRAPH_BLESS=1 cargo test --release golden` writes them anew, on lavapipe only; look at
//! what changed and say why in the commit. Tolerance is zero on every backend.

use std::path::PathBuf;

use noctograph::expose::{BackendChoice, ExposeOptions, Exposure, expose};
use noctograph::photo::{Noise, Photo, develop};
use noctograph::report::{Label, labelled};
use noctograph::scene::Scene;
use noctograph::{letters, light, plan, sim};

use crate::compare::{compare, leave_page};

const BLESS: &str = "NOCTOGRAPH_BLESS";

fn golden(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("golden").join(path)
}

const SMALL_PX: [u32; 2] = [256, 144];

/// The preview of a word with the default scene, with its noise or without: noise does not compress.
fn preview(word: &str, size_px: [u32; 2], noise: Noise) -> (Exposure, Photo) {
    let mut scene = Scene { word: word.to_owned(), ..Scene::default() };
    scene.photo.noise = noise;
    [scene.camera.width_px, scene.camera.height_px] = size_px;
    photograph(&scene)
}

fn photograph(scene: &Scene) -> (Exposure, Photo) {
    let strokes = letters::write(&scene.word, &scene.letters).unwrap();
    let plan = plan::plan(&strokes, &scene.plan).unwrap();
    let flight = sim::fly(&plan, &sim::Drone::new(&scene.sim(), scene.seed), &mut |_| {}).unwrap();
    let camera = scene.camera.camera(strokes.bounds_m(), plan.duration_s()).unwrap();
    let trace = light::light(&flight, &scene.light, scene.seed, 0).unwrap();
    let options = ExposeOptions { backend: backend(), ..scene.expose };
    let exposure = expose(&trace, &camera, &options).unwrap();
    let photo = develop(&exposure.film, &camera, &scene.photo, scene.seed).unwrap();
    (exposure, photo)
}

/// A graphics device where there is one: the one that must be there, where somebody insists on it.
fn backend() -> BackendChoice {
    let required = std::env::var_os("NOCTOGRAPH_REQUIRE_GPU").is_some();
    if required { BackendChoice::Wgpu } else { BackendChoice::Auto }
}

fn refuse_other_than_lavapipe(adapter: &str) {
    assert!(adapter.contains("llvmpipe"), "goldens are blessed on lavapipe, not on {adapter}");
}

/// Holds a photo to a golden image of at most `max_bytes`.
fn hold(file: &str, (exposure, photo): (Exposure, Photo), max_bytes: usize) {
    let path = golden(file);
    if std::env::var_os(BLESS).is_some() {
        refuse_other_than_lavapipe(&exposure.adapter);
        let mut png = Vec::new();
        photo.write_png(&mut png, None, &[]).unwrap();
        assert!(png.len() <= max_bytes, "a golden of {} bytes is too large", png.len());
        std::fs::write(&path, png).unwrap();
    }
    let wanted = Photo::read_png(&path).ok();
    let difference = wanted.as_ref().map(|wanted| compare(wanted, &photo));
    if difference != Some(None) {
        let note = format!("{difference:?} on {}", exposure.adapter);
        let page = leave_page(file, wanted.as_ref(), &photo, &note);
        panic!("{note}: look at {}, bless with {BLESS}=1", page.display());
    }
}

#[test]
fn golden_noor_is_the_photo_of_noor() {
    hold("photo/noor.png", preview("NOOR", [160, 90], Noise::Off), 16 << 10);
}

#[test]
fn golden_picture_of_the_readme_is_what_the_command_makes() {
    hold("readme/noor.png", preview("NOOR", [800, 450], Noise::Emva1288), 480 << 10);
}

#[test]
fn golden_phenomena_of_the_teams_photograph_are_in_our_render_of_it() {
    let toml = std::fs::read_to_string(golden("readme/team.toml")).unwrap();
    let scene = Scene { word: "NOOR".into(), ..Scene::parse(&toml, "team.toml").unwrap() };
    let (exposure, photo) = photograph(&scene);
    let label = |text: &str, text_px, named_px| Label { text: text.into(), text_px, named_px };
    let labels = [
        label("1 headlights, on strokes only", [330.0, 30.0], [445.0, 73.0]),
        label("2 power LEDs, blue", [20.0, 160.0], [262.0, 205.0]),
        label("3 status LED, red dots", [830.0, 150.0], [772.0, 122.0]),
        label("4 stroke ends early", [410.0, 280.0], [560.0, 226.0]),
        label("5 lit tail before the N", [20.0, 300.0], [293.0, 262.0]),
        label("6 take-off blob, glow of the ring on the floor", [560.0, 400.0], [487.0, 359.0]),
    ];
    hold("readme/phenomena.png", (exposure, labelled(&photo, &labels)), 384 << 10);
}

#[test]
fn golden_accumulators_have_their_hashes() {
    let path = golden("expose/accumulators.txt");
    let mut found = String::new();
    for word in ["NOOR", "QUICK", "X"] {
        let (exposure, _) = preview(word, SMALL_PX, Noise::Off);
        if std::env::var_os(BLESS).is_some() {
            refuse_other_than_lavapipe(&exposure.adapter);
        }
        found += &format!("{word} 256x144 {}\n", exposure.film.sha256());
    }
    if std::env::var_os(BLESS).is_some() {
        std::fs::write(&path, &found).unwrap();
    }
    let wanted = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(found, wanted, "bless with {BLESS}=1 on lavapipe");
}
