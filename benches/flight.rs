//! Measures the time to simulate the whole flight of NOOR, 46 s from rest at the first letter, with
//! each controller, and at the firmware's rate of 1 kHz. The goal is 20 ms for 40 s of flight. In
//! November 2026, the median processor times on a busy core with AVX-512 were 8.0 to 10.4 ms for
//! the 46 s, and 11.9 to 16.0 ms at 1 kHz.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use noctograph::letters::{LetterOptions, write};
use noctograph::plan::{Extent, PlanOptions, plan};
use noctograph::sim::{ControllerKind, Drone, SimOptions, fly};

fn flight(criterion: &mut Criterion) {
    let strokes = write("NOOR", &LetterOptions::default()).expect("it flies");
    let letters = PlanOptions { extent: Extent::Letters, ..Default::default() };
    let plan = plan(&strokes, &letters).expect("it flies");
    let mut group = criterion.benchmark_group("flight of 46 s");
    group.sample_size(20);
    let mut case = |name: &str, options: SimOptions| {
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                fly(black_box(&plan), &Drone::new(&options, 1), &mut |_| {}).expect("it flies")
            });
        });
    };
    for (name, kind) in [
        ("lqr", ControllerKind::Lqr),
        ("lqr-integral", ControllerKind::LqrIntegral),
        ("pid", ControllerKind::Pid),
        ("geometric", ControllerKind::Geometric),
    ] {
        let mut options = SimOptions::default();
        options.controller.kind = kind;
        case(name, options.clone());
        options.rates.control_hz = 1000;
        case(&format!("{name}, 1 kHz"), options);
    }
}

criterion_group!(benches, flight);
criterion_main!(benches);
