//! Tests of golden files under `golden/`, which are results that a person has inspected.
//!
//! Each stage has a golden file that is computed from a fixed input instead of another stage's
//! output, so that a change of one stage affects only its own golden file. The stages with golden
//! files are flights (`digests`), films (`twins`), plots (`compare_flights`) and the verdict
//! (`faults`). The picture `golden/photo/noor.png` covers the whole pipeline. The pictures in the
//! documentation are illustrations, which only need to resemble the results.
//!
//! `NOCTOGRAPH_BLESS=1 cargo test --release --test it` rewrites the golden files.

use std::path::{Path, PathBuf};

use noctograph::expose::BackendChoice;
use noctograph::photo::{self, Noise, Photo, flip};
use noctograph::report::{Label, labeled};
use noctograph::scene::{Preset, Scene};
use noctograph::shoot::{Judging, Shoot};

use crate::bless::is_blessed;
use crate::compare::{compare, leave_page};

/// Maximum size of a golden file, in bytes.
const MAX_BYTES: usize = 16 << 10;

/// Returns the path of a file in the repository.
fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Compares a text with a golden file byte by byte. If the text differs, it is written beside the
/// tests.
pub(crate) fn assert_golden(file: &str, found: &str) {
    let path = repository("golden").join(file);
    if is_blessed(file) {
        assert!(found.len() <= MAX_BYTES, "a golden of {} bytes is too large", found.len());
        std::fs::write(&path, found).unwrap();
    }
    if found != std::fs::read_to_string(&path).unwrap_or_default() {
        let left = Path::new(env!("CARGO_TARGET_TMPDIR")).join(file.replace('/', "-"));
        std::fs::write(&left, found).unwrap();
        panic!("{file} differs: compare it with {}, bless with NOCTOGRAPH_BLESS=1", left.display());
    }
}

/// Returns the photo of a scene, exposed on the CPU. No other backend is needed, because all of
/// them produce the same film.
fn photograph(scene: Scene) -> Photo {
    let mut shoot = Shoot {
        judging: Judging::Skipped,
        backend: BackendChoice::Cpu,
        ..Shoot::new(scene).unwrap()
    };
    // The shutter closes at the end of the plan, some milliseconds after the flight's last sample.
    let end_s = shoot.plans[0].plan.duration_s();
    shoot.scene.camera.shutter_close_s.get_or_insert(end_s);
    shoot.take(&|_, _| {}).unwrap().photo
}

/// Returns the photo of a word in a preset's scene at the given size.
fn shown(word: &str, preset: Preset, [width_px, height_px]: [u32; 2], noise: Noise) -> Photo {
    let mut scene = Scene { word: word.into(), ..Scene::preset(preset) };
    scene.photo.noise = noise;
    (scene.camera.width_px, scene.camera.height_px) = (width_px, height_px);
    photograph(scene)
}

#[test]
fn golden_photo_of_noor() {
    let (file, found) = ("photo/noor.png", shown("NOOR", Preset::Ae4832022, [160, 90], Noise::Off));
    let path = repository("golden").join(file);
    if is_blessed(file) {
        let png = photo::encode_png(&found, None, &[]);
        assert!(png.len() <= MAX_BYTES, "a golden of {} bytes is too large", png.len());
        std::fs::write(&path, png).unwrap();
    }
    let wanted = photo::read(&path).ok();
    let difference = wanted.as_ref().map(|wanted| compare(wanted, &found));
    if difference != Some(None) {
        let note = format!("{difference:?}: bless with NOCTOGRAPH_BLESS=1");
        let page = leave_page(file, wanted.as_ref(), &found, &note);
        panic!("{note}; look at {}", page.display());
    }
}

/// Maximum mean ꟻLIP difference of an illustration. A change that a reader would notice exceeds it,
/// but different noise does not.
const MAX_MEAN_FLIP: f64 = 0.05;

/// Compares a photo with a picture in the documentation by a perceptual metric.
fn assert_illustration(file: &str, found: &Photo) {
    let path = repository("docs").join(file);
    if is_blessed(file) {
        std::fs::write(&path, photo::encode_png(found, None, &[])).unwrap();
    }
    let wanted = photo::read(&path).unwrap();
    let size_px = |photo: &Photo| [photo.width_px, photo.height_px];
    assert_eq!(size_px(&wanted), size_px(found), "{file}");
    let mean = flip::difference(&wanted, found).mean(|_| true);
    assert!(mean <= MAX_MEAN_FLIP, "{file}: mean ꟻLIP {mean}; draw it with NOCTOGRAPH_BLESS=1");
}

#[test]
fn the_pictures_of_the_readme_look_like_the_photos_of_their_commands() {
    for (file, word, preset) in
        [("hello.png", "HELLO", Preset::Cf21), ("noor.png", "NOOR", Preset::Ae4832022)]
    {
        assert_illustration(file, &shown(word, preset, [800, 450], Noise::default()));
    }
}

#[test]
fn the_labeled_picture_looks_like_the_render_of_its_scene() {
    let toml = std::fs::read_to_string(repository("docs/photograph.toml")).unwrap();
    let scene = Scene { word: "NOOR".into(), ..Scene::parse(&toml, "photograph.toml").unwrap() };
    let label = |text: &str, text_px, named_px| Label { text: text.into(), text_px, named_px };
    let labels = [
        label("1 headlights, on strokes only", [330.0, 30.0], [445.0, 73.0]),
        label("2 power LEDs, blue", [20.0, 160.0], [262.0, 205.0]),
        label("3 status LED, red dots", [830.0, 150.0], [767.0, 127.0]),
        label("4 stroke ends early", [410.0, 280.0], [560.0, 226.0]),
        label("5 lit tail before the N", [20.0, 300.0], [293.0, 262.0]),
        label("6 take-off blob, glow of the ring on the floor", [560.0, 400.0], [487.0, 359.0]),
    ];
    assert_illustration("phenomena.png", &labeled(&photograph(scene), &labels));
}
