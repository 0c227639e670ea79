//! Measures the time to compute the gains of the hovering drone's regulator (12 states, 4 inputs),
//! its observer (8 states, 3 outputs), and its regulator with integrals (15 states). The goal for
//! the first is 100 µs. In November 2026, the three gains took 200, 480 and 90 µs, respectively, on
//! a busy core. For comparison, a simulated flight takes 13 ms.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{DMatrix, DVector};
use noctograph::control::{lqr, observer_gain};

/// Returns the matrices of the reference flight's hover, as linearized by `noctograph::sim`.
fn hover() -> [DMatrix<f64>; 2] {
    let (mut a, mut b) = (DMatrix::zeros(12, 12), DMatrix::zeros(12, 4));
    for entry in [(0, 6), (1, 7), (2, 8), (3, 11), (4, 10), (5, 9)] {
        a[entry] = 1.0;
    }
    (a[(6, 4)], a[(7, 5)]) = (9.81, -9.81);
    (b[(9, 0)], b[(10, 1)]) = (1.0 / 1.24e-5, 1.0 / 1.27e-5);
    (b[(11, 2)], b[(8, 3)]) = (1.0 / 3.32e-5, 1.0 / 0.0351);
    [a, b]
}

fn riccati(criterion: &mut Criterion) {
    let [a, b] = hover();
    let weights = [120.0, 80.0, 75.0, 40.0, 0.01, 0.01, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
    let q = DMatrix::from_diagonal(&DVector::from_column_slice(&weights));
    let weights = [5_045_605.0, 5_045_605.0, 38_586_096.0, 566.0];
    let r = DMatrix::from_diagonal(&DVector::from_column_slice(&weights));
    criterion.bench_function("lqr 12x4", |bencher| {
        bencher.iter(|| lqr(black_box(&a), black_box(&b), &q, &r).expect("solvable"));
    });

    let mut wide = a.resize(15, 15, 0.0);
    wide.view_mut((12, 0), (3, 3)).fill_with_identity();
    let wide_b = b.resize_vertically(15, 0.0);
    let mut wide_q = q.resize(15, 15, 0.0);
    wide_q.view_mut((12, 12), (3, 3)).copy_from(&(DMatrix::identity(3, 3) * 20.0));
    criterion.bench_function("lqr 15x4, with integrals", |bencher| {
        bencher.iter(|| lqr(black_box(&wide), black_box(&wide_b), &wide_q, &r).expect("solvable"));
    });

    let (mut a, c) = (DMatrix::zeros(8, 8), DMatrix::identity(3, 8));
    for i in 0..3 {
        a[(i, 5 + i)] = 1.0;
    }
    (a[(5, 3)], a[(6, 4)]) = (9.81, -9.81);
    let trust = [1479.3, 1479.3, 918.3, 94.3, 24.3, 45.0, 75.6, 28.6];
    let model = DMatrix::from_diagonal(&DVector::from_column_slice(&trust).map(f64::recip));
    let trust = [111_111.0, 62_500.0, 250_000.0];
    let measured = DMatrix::from_diagonal(&DVector::from_column_slice(&trust).map(f64::recip));
    criterion.bench_function("observer 8x3", |bencher| {
        bencher.iter(|| observer_gain(black_box(&a), &c, &model, &measured).expect("solvable"));
    });
}

criterion_group!(benches, riccati);
criterion_main!(benches);
