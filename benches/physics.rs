//! Measures steps of the flight physics per second of processor time, for one drone on one core.
//!
//! Run it with `cargo bench --bench physics`. In its output, an element is a step of 1 ms. The goal
//! is 6 million steps/s for "rotors and drag", which covers the physics of other simulators (a
//! simulator written for this comparison reaches 6.9 million). In November 2026, the best and the
//! median of 60 runs on a busy core with AVX-512 were 13.0 and 8.4 million steps/s. The figures
//! were 9.7 and 6.7 million steps/s for "cf21", and 6.1 and 5.0 million with gusts.

#![expect(clippy::disallowed_methods, reason = "a file of the kernel")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use nalgebra::Vector3;
use noctograph::scene::{Preset, Scene};
use noctograph::sim::SimOptions;
use noctograph::vehicle::{GroundEffect, Gusts, Plant};

const STEPS: u64 = 100_000;

/// Returns options that simulate the body, and rotors with lag, angular momentum and drag.
fn motion() -> SimOptions {
    let mut options = Scene::preset(Preset::Cf21).sim();
    options.battery.capacity_ah = 0.0;
    options.vehicle.ground_effect = GroundEffect::None;
    options
}

/// Returns options that also simulate the battery, the ground effect and gusts.
fn everything() -> SimOptions {
    let mut options = Scene::preset(Preset::Cf21).sim();
    options.air.gusts = Gusts::room();
    options
}

/// Returns the processor time of this thread, if the system reports it.
fn processor_time() -> Option<Duration> {
    let line = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    line.split(' ').next()?.parse().ok().map(Duration::from_nanos)
}

fn physics(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("physics RK4 f64 1 ms");
    group.throughput(Throughput::Elements(STEPS)).sample_size(20).sampling_mode(SamplingMode::Flat);
    let cases = [
        ("rotors and drag", motion()),
        ("cf21", Scene::preset(Preset::Cf21).sim()),
        ("cf21, gusts", everything()),
    ];
    for (name, options) in cases {
        let vehicle = &options.vehicle;
        let hover = vehicle.mass_kg * 9.81 / (4.0 * vehicle.k_f_n);
        group.bench_function(name, |bencher| {
            bencher.iter_custom(|n| {
                let (clock, processor) = (Instant::now(), processor_time());
                for _ in 0..n {
                    let mut plant = Plant::new(options.plant(), 0.001, 1, 0, Vector3::z());
                    for _ in 0..STEPS {
                        plant.advance(black_box(&[hover; 4]));
                    }
                    black_box(plant.body());
                }
                let used = processor_time().zip(processor).map(|(end, start)| end - start);
                used.unwrap_or_else(|| clock.elapsed())
            });
        });
    }
    group.finish();
}

criterion_group!(benches, physics);
criterion_main!(benches);
