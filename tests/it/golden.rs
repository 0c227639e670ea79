//! Golden images and accumulator hashes, under `golden/`.
//!
//! `NOCTOGRAPH_BLESS=1 cargo test --release golden` writes them anew, on lavapipe only; look at
//! what changed and say why in the commit. Tolerance is zero on every backend.

use std::path::PathBuf;

use noctograph::expose::{BackendChoice, ExposeOptions, Exposure, expose};
use noctograph::photo::{Photo, develop};
use noctograph::scene::Scene;
use noctograph::{letters, light, plan, sim};

use crate::compare::{compare, leave_page};

const BLESS: &str = "NOCTOGRAPH_BLESS";

fn golden(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("golden").join(path)
}

/// The preview of a word at 256x144 with the default scene.
fn preview(word: &str, backend: BackendChoice) -> (Exposure, Photo) {
    let mut scene = Scene { word: word.to_owned(), ..Scene::default() };
    (scene.camera.width_px, scene.camera.height_px) = (256, 144);
    let strokes = letters::write(word, &scene.letters).unwrap();
    let plan = plan::plan(&strokes, &scene.plan).unwrap();
    let flight = sim::fly(&plan, &scene.sim(), scene.seed, &mut |_| {}).unwrap();
    let camera = scene.camera.camera(strokes.bounds_m(), plan.duration_s()).unwrap();
    let trace = light::light(&flight, &scene.light).unwrap();
    let options = ExposeOptions { backend, ..scene.expose };
    let exposure = expose(&trace, &camera, &options).unwrap();
    let photo = develop(&exposure.film, &camera);
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

#[test]
fn golden_noor_is_the_photo_of_noor() {
    let path = golden("photo/noor.png");
    let (exposure, photo) = preview("NOOR", backend());
    if std::env::var_os(BLESS).is_some() {
        refuse_other_than_lavapipe(&exposure.adapter);
        let mut file = Vec::new();
        photo.write_png(&mut file, &[]).unwrap();
        assert!(file.len() <= 16 << 10, "a golden of {} bytes is too large", file.len());
        std::fs::write(&path, file).unwrap();
    }
    let wanted = Photo::read_png(&path).ok();
    let difference = wanted.as_ref().map(|wanted| compare(wanted, &photo));
    if difference != Some(None) {
        let note = format!("{difference:?} on {}", exposure.adapter);
        let page = leave_page("noor", wanted.as_ref(), &photo, &note);
        panic!("{note}: look at {}, bless with {BLESS}=1", page.display());
    }
}

#[test]
fn golden_accumulators_have_their_hashes() {
    let path = golden("expose/accumulators.txt");
    let mut found = String::new();
    for word in ["NOOR", "QUICK", "X"] {
        let (exposure, _) = preview(word, backend());
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
