//! Steps of the flight physics a second, one drone on one core.
//!
//! `cargo bench --bench physics` prints the time of 10 000 steps of 1 ms each; divide.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Vector3;
use noctograph::sim::{GroundEffect, Gusts, Plant, SimOptions};

const STEPS: u64 = 10_000;

/// Body and lagging, spinning, dragging rotors: what other simulators' physics are.
fn motion() -> SimOptions {
    let mut options = SimOptions::cf21();
    options.battery.capacity_ah = 0.0;
    options.vehicle.ground_effect = GroundEffect::None;
    options
}

/// All of it: battery, ground effect and gusts as well.
fn everything() -> SimOptions {
    let mut options = SimOptions::cf21();
    options.air.gusts = Gusts::OrnsteinUhlenbeck;
    options
}

fn physics(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("physics RK4 f64 1 ms");
    group.throughput(Throughput::Elements(STEPS));
    let cases = [
        ("rotors and drag", motion()),
        ("cf21", SimOptions::cf21()),
        ("cf21, gusts", everything()),
    ];
    for (name, options) in cases {
        let vehicle = &options.vehicle;
        let hover = vehicle.mass_kg * 9.81 / (4.0 * vehicle.k_f_n);
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let mut plant = Plant::new(&options, 0.001, 1, 0, Vector3::z());
                for _ in 0..STEPS {
                    plant.advance(black_box(&[hover; 4]));
                }
                *plant.body()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, physics);
criterion_main!(benches);
