//! Measures a Monte Carlo study of 1,000 flights of 40 s with the full model on two cores. The goal
//! is 6 s, which is 12 ms of processor time per flight.
//!
//! Run it with `cargo bench --bench thousand`. A number after `--` sets the number of flights. The
//! full model is that of the preset `cf21`, with Runge–Kutta integration at 1 kHz, rotor lag, drag,
//! battery and ground effect, Lighthouse sweeps, inertial sensors at 1 kHz, a regulator at 500 Hz,
//! and a log at 250 Hz.
//!
//! In November 2026 a flight took 19 ms (sweeps, EKF) or 14 ms (beams, observer) on two busy cores
//! with AVX-512 (load 12). In an experiment, simulating several drones together in the widest
//! registers took 0.67 to 0.85 of that time. This saved only 3 % of a study's time and did not
//! justify the code.

#![expect(clippy::disallowed_methods, reason = "our own files")]
#![expect(clippy::print_stdout, reason = "a table for people")]

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use noctograph::letters::{LetterOptions, write};
use noctograph::plan::{Extent, Plan, PlanOptions, plan};
use noctograph::scene::{Preset, Scene};
use noctograph::sensors::Positioning;
use noctograph::sim::{ControllerKind, Drone, EstimatorKind, SimOptions, fly};
use noctograph::vehicle::Gusts;

const CORES: usize = 2;
const SECONDS: f64 = 40.0;

/// Returns the first 40 s of the plan of NOOR.
fn word() -> Plan {
    let strokes = write("NOOR", &LetterOptions::default()).expect("it is written");
    let letters = PlanOptions { extent: Extent::Letters, ..Default::default() };
    let mut plan = plan(&strokes, &letters).expect("it is planned");
    plan.edit(|plan| plan.setpoints.retain(|setpoint| setpoint.time_s <= SECONDS));
    let n = plan.setpoints.len();
    plan.edit(|plan| plan.lights.values_mut().for_each(|column| column.truncate(n)));
    plan
}

fn full(positioning: Positioning, estimator: EstimatorKind) -> SimOptions {
    let mut options = Scene::preset(Preset::Cf21).sim();
    options.controller.kind = ControllerKind::Lqr;
    options.rates.control_hz = 1000;
    options.sensors.positioning = positioning;
    options.observer.kind = estimator;
    options
}

/// Returns the processor time of this thread, or the wall time if the system does not report it.
fn processor_time(since: Instant) -> Duration {
    let line = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let ns = line.and_then(|line| line.split(' ').next()?.parse().ok());
    ns.map_or(since.elapsed(), Duration::from_nanos)
}

/// Flies seeds 0 to `n` on all cores. Returns the total processor time and the wall time.
fn thousand(plan: &Plan, options: &SimOptions, n: u64) -> (Duration, Duration) {
    let (start, next) = (Instant::now(), AtomicU64::new(0));
    let core = || {
        let from = processor_time(start);
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= n {
                return processor_time(start) - from;
            }
            let flight = fly(plan, &Drone::new(options, seed), &mut |_| {});
            std::hint::black_box(flight.expect("it flies"));
        }
    };
    let used = std::thread::scope(|scope| {
        let cores: Vec<_> = (0..CORES).map(|_| scope.spawn(core)).collect();
        cores.into_iter().map(|core| core.join().expect("it ends")).sum()
    });
    (used, start.elapsed())
}

fn main() {
    let n = std::env::args().find_map(|word| word.parse().ok()).unwrap_or(1000);
    let plan = word();
    let mut gusts = full(Positioning::Sweeps, EstimatorKind::Ekf);
    gusts.air.gusts = Gusts::room();
    let cases = [
        ("sweeps, EKF", full(Positioning::Sweeps, EstimatorKind::Ekf)),
        ("crossing beams, observer", full(Positioning::CrossingBeams, EstimatorKind::Luenberger)),
        ("sweeps, EKF, gusts", gusts),
    ];
    println!(
        "{n} flights of {:.1} s        CPU, ms each      wall, s   CPU / 2, s",
        plan.duration_s()
    );
    for (name, options) in cases {
        let (used, wall) = thousand(&plan, &options, n);
        let each_ms = used.as_secs_f64() * 1e3 / n as f64;
        let (wall_s, half_s) = (wall.as_secs_f64(), used.as_secs_f64() / 2.0);
        println!("{name:26}{each_ms:16.2}{wall_s:13.2}{half_s:13.2}");
    }
}
