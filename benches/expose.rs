//! Measures the time of each part of an exposure of 40 s, sampled at 1 kHz, on 1920×1080 pixels
//! with spots of 1.6 px, and the time of the glow on the floor under NOOR in the default scene.
//!
//! The path is that of the light trace (`t,x,y,z,r,g,b`) in the file that `NOCTOGRAPH_BENCH_CSV`
//! names, such as one of NOOR, or else a figure of the same length and speed. The lower bound on
//! one core of this machine is 0.35 ms for the arithmetic without merging, and 1.4 ms to clear and
//! read the picture. The goals for the splat on one core are 2 ms with merging and 7 ms without.
//!
//! Two changes were tried: all lamps of one color use one plane, and curves are kept in registers.
//! Measured side by side on a busy machine, the two changes reduced the processor time of the splat
//! from 1.9 to 1.5 ms with merging and from 12.8 to 5.7 ms without, and the time of NOOR, with its
//! 42 lamps, from 13 to 10 ms. With merging, one millisecond of the splat is spent on clearing the
//! picture. In a process that has not used that memory before, page faults increase this time to 8
//! ms, both before and after the changes.
#![expect(clippy::unwrap_used, reason = "a bench fails by panicking")]
#![allow(missing_docs, reason = "criterion's macro makes an undocumented function")]

use std::hint::black_box;
use std::num::NonZero;

use criterion::{Criterion, criterion_group, criterion_main};
use noctograph::camera::{Camera, CameraOptions, CustomLens, FixedPose, Framing, LensModel};
use noctograph::expose::{BackendChoice, ExposeOptions, expose, project};
use noctograph::light::{LightTrace, csv::read};
use noctograph::scene::{Preset, Scene};
use noctograph::shoot::Shoot;

/// Returns a camera with a 28 mm lens at a distance of 4 m.
fn camera() -> Camera {
    let options = CameraOptions {
        framing: Framing::Fixed(FixedPose {
            position_m: [0.0, -4.0, 0.0],
            target_m: Some([0.0; 3]),
            ..FixedPose::default()
        }),
        lens: LensModel::Custom(CustomLens { focal_length_m: 0.028, ..CustomLens::default() }),
        blur_m: 29.3e-6,
        ..CameraOptions::default()
    };
    options.camera([0.0; 4], 40.0).unwrap()
}

fn trace() -> LightTrace {
    if let Some(path) = std::env::var_os("NOCTOGRAPH_BENCH_CSV") {
        #[expect(clippy::disallowed_methods, reason = "a file of one's own")]
        return read(&std::fs::read(path).unwrap(), "light trace").unwrap().product;
    }
    let mut csv = "t,x,y,z,r,g,b\n".to_owned();
    for i in 0..31_000 {
        let t = f64::from(i) / 1000.0;
        let (x, y) = (1.6 * libm::sin(0.23 * t), 0.01 * libm::sin(5.0 * t));
        csv += &format!("{t},{x:.6},{y:.6},{:.6},1,0.55,0.12\n", 0.5 * libm::cos(0.71 * t));
    }
    read(csv.as_bytes(), "figure").unwrap().product
}

fn bench(c: &mut Criterion) {
    let (camera, trace) = (camera(), trace());
    let merged = ExposeOptions::default();
    let unmerged = ExposeOptions { merge_tolerance_px: 0.0, ..merged.clone() };
    let mut group = c.benchmark_group("expose");
    group.sample_size(30);
    for (name, options) in [("merged", &merged), ("unmerged", &unmerged)] {
        let latent = project(&trace, &camera, options).unwrap();
        let n = latent.n_segments();
        group.bench_function(format!("project, {name}, to {n} segments"), |b| {
            b.iter(|| project(&trace, &camera, options).unwrap());
        });
        group.bench_function(format!("splat on one core, {name}"), |b| {
            b.iter(|| latent.develop_on(NonZero::<usize>::MIN));
        });
    }
    for (name, backend) in [("cpu", BackendChoice::Cpu), ("wgpu", BackendChoice::Wgpu)] {
        if expose(&trace, &camera, &merged, backend).is_ok() {
            group.bench_function(format!("whole, {name}"), |b| {
                b.iter(|| expose(black_box(&trace), &camera, &merged, backend).unwrap());
            });
        }
    }
    group.finish();
}

/// Returns the light trace and the camera of NOOR in the default scene.
fn noor() -> (LightTrace, Camera) {
    let scene = Scene { word: "NOOR".to_owned(), ..Scene::preset(Preset::Ae4832022) };
    let lighting = Shoot::new(scene).unwrap().lighting(&|_, _| {}).unwrap();
    (lighting.trace, lighting.camera)
}

fn floor(c: &mut Criterion) {
    let (trace, camera) = noor();
    let mut group = c.benchmark_group("floor");
    for (name, floor_albedo) in [("black", 0.0), ("gray", 0.2)] {
        let options = ExposeOptions { floor_albedo, ..ExposeOptions::default() };
        let latent = project(&trace, &camera, &options).unwrap();
        group.bench_function(format!("project over a {name} floor"), |b| {
            b.iter(|| project(&trace, &camera, &options).unwrap());
        });
        group.bench_function(format!("splat over a {name} floor"), |b| {
            b.iter(|| latent.develop_on(NonZero::<usize>::MIN));
        });
    }
    group.finish();
}

criterion_group!(benches, bench, floor);
criterion_main!(benches);
