//! Measures the time to prepare the reader for a word, which is needed once, and the time to read
//! each photo of this word.
//!
//! At 1920×1080 pixels, in processor time on one core, NOOR takes 0.3 ms to prepare and 11 ms per
//! photo, and PAINTING 0.5 ms and 20 ms, respectively.
#![expect(clippy::unwrap_used, reason = "a bench fails by panicking")]
#![allow(missing_docs, reason = "criterion's macro makes an undocumented function")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use noctograph::expose::BackendChoice;
use noctograph::letters::Strokes;
use noctograph::photo::Photo;
use noctograph::scene::{Preset, Scene};
use noctograph::score::{Reader, View};
use noctograph::shoot::{Judging, Shoot};

/// Returns the strokes, the photo and the view of a word in the default scene.
fn preview(word: &str, size_px: [u32; 2]) -> (Strokes, Photo, View) {
    let mut scene = Scene { word: word.to_owned(), ..Scene::preset(Preset::Ae4832022) };
    [scene.camera.width_px, scene.camera.height_px] = size_px;
    let shoot = Shoot {
        judging: Judging::Skipped,
        backend: BackendChoice::Cpu,
        ..Shoot::new(scene).unwrap()
    };
    let shot = shoot.take(&|_, _| {}).unwrap();
    (shot.shoot.strokes.unwrap(), shot.photo, (&shot.camera).into())
}

fn read(c: &mut Criterion) {
    for (word, size_px) in
        [("NOOR", [1920, 1080]), ("PAINTING", [1920, 1080]), ("NOOR", [192, 108])]
    {
        let (strokes, photo, view) = preview(word, size_px);
        let options = Scene::preset(Preset::Ae4832022).score;
        let name = format!("{word} at {}x{}", size_px[0], size_px[1]);
        c.bench_function(&format!("prepare for {name}"), |b| {
            b.iter(|| Reader::new(black_box(&strokes), &options).unwrap());
        });
        let reader = Reader::new(&strokes, &options).unwrap();
        c.bench_function(&format!("read {name}"), |b| {
            b.iter(|| reader.score(black_box(&photo), &view).unwrap());
        });
    }
}

criterion_group!(benches, read);
criterion_main!(benches);
