//! Measures the time to develop a film of 1920 × 1080 pixels without effects, with each effect
//! separately, and with all effects, and the time to encode the photo. Run it with `cargo bench
//! --bench photo`.
//!
//! The goal for noise in the dark is 40 ms of processor time. Measured side by side on a busy
//! machine, Walker's alias tables and wide registers reduced the sensor's processor time from 95 to
//! 25 ms in the dark, and from 26 to 9 ms in a lit room.
#![expect(clippy::unwrap_used, reason = "a bench fails by panicking")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use noctograph::camera::Camera;
use noctograph::expose::{BackendChoice, ExposeOptions, Film};
use noctograph::photo::{self, Metadata, Noise, PhotoOptions, Tone, develop, read_out};
use noctograph::scene::{Preset, Scene};
use noctograph::shoot::{Judging, Shoot};

/// Returns the film and the camera of NOOR in the default scene.
fn noor() -> (Film, Camera) {
    let scene = Scene { word: "NOOR".to_owned(), ..Scene::preset(Preset::Ae4832022) };
    let shoot = Shoot {
        judging: Judging::Skipped,
        backend: BackendChoice::Cpu,
        ..Shoot::new(scene).unwrap()
    };
    let shot = shoot.take(&|_, _| {}).unwrap();
    (shot.film.expect("kept"), shot.camera)
}

fn photo(c: &mut Criterion) {
    let (film, camera) = noor();
    let (plain, bare) = (PhotoOptions::plain, ExposeOptions::default());
    let all = PhotoOptions::default();
    let room = all.ambient_cd_m2;
    let cases = [
        ("everything off", plain()),
        ("glare", PhotoOptions { glare_frac: all.glare_frac, ..plain() }),
        ("starburst", PhotoOptions { aperture_blades: 7, ..plain() }),
        ("room", PhotoOptions { ambient_cd_m2: room, ..plain() }),
        (
            "noise in a lit room",
            PhotoOptions { noise: Noise::default(), ambient_cd_m2: room, ..plain() },
        ),
        ("noise in the dark", PhotoOptions { noise: Noise::default(), ..plain() }),
        ("camera tone", PhotoOptions { tone: Tone::Camera, ..plain() }),
        ("neutral tone", PhotoOptions { tone: Tone::Neutral, ..plain() }),
        ("everything", all.clone()),
    ];
    let mut develops = c.benchmark_group("develop");
    for (name, options) in &cases {
        develops.bench_function(*name, |b| {
            b.iter(|| develop(black_box(&film), &camera, &bare, options, 0).unwrap());
        });
    }
    develops.finish();

    let photo = develop(&film, &camera, &bare, &all, 0).unwrap();
    let readout = read_out(&film, &camera, &bare, &all, 0).unwrap();
    let mut encodes = c.benchmark_group("encode");
    encodes.bench_function("png 8", |b| {
        b.iter(|| {
            let metadata = Metadata::new(&camera, &photo.rgb8);
            photo::encode_png(&photo, Some(&metadata), &[])
        });
    });
    encodes.bench_function("png 16", |b| {
        b.iter(|| readout.encode_png16(all.tone, (&camera, None), &[], None));
    });
    encodes.bench_function("exr 32", |b| {
        b.iter(|| readout.encode_exr(&camera, &[]));
    });
    encodes.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(std::time::Duration::from_millis(300))
        .measurement_time(std::time::Duration::from_secs(1));
    targets = photo
}
criterion_main!(benches);
