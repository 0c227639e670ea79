//! Measures the throughput, on one core, of studies in which NOOR is planned, flown, exposed on a
//! small film and read, and the throughput of the flight alone. The goal is 25 flights per second
//! and core, which is 40 ms per flight.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use noctograph::scene::Scene;
use noctograph::studies::{Conditions, Prepared};

fn scored_flight(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("NOOR");
    group.sample_size(20);
    for name in ["team", "pid", "geometric"] {
        let contender = Scene::find(name, &[]).expect("known by name");
        let ready = Prepared::new(&contender, "NOOR", &Conditions::default()).expect("it flies");
        let mut seed = 0;
        let mut next = || {
            seed += 1;
            seed
        };
        group.bench_function(format!("{name}, flown and read"), |bencher| {
            bencher.iter(|| black_box(ready.outcome(next()).expect("it flies")));
        });
        group.bench_function(format!("{name}, flown"), |bencher| {
            bencher.iter(|| black_box(ready.fly(next()).expect("it flies")));
        });
    }
}

criterion_group!(benches, scored_flight);
criterion_main!(benches);
