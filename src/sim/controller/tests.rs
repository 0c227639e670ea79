//! Every controller in flight: what it trails by, what it leaves standing, what it survives.

use std::f64::consts::TAU;

use nalgebra::{Vector2, Vector3};

use crate::error::Result;
use crate::flight::{Flight, FlightSample, mean_error_m, rmse_m};
use crate::letters::{LetterOptions, write};
use crate::plan::{Extent, Plan, PlanOptions, Setpoint, plan};
use crate::sim::{ControllerKind, SensorOptions, SimOptions, fly};

const KINDS: [ControllerKind; 5] = [
    ControllerKind::Lqr,
    ControllerKind::LqrFeedforward,
    ControllerKind::LqrIntegral,
    ControllerKind::Pid,
    ControllerKind::Geometric,
];

fn word(text: &str, extent: Extent) -> Plan {
    let strokes = write(text, &LetterOptions::default()).unwrap();
    plan(&strokes, &PlanOptions { extent, ..Default::default() }).unwrap()
}

/// The team's drone with a controller, its centre of mass where the flight showed it.
fn with(kind: ControllerKind) -> SimOptions {
    let mut options = SimOptions::default();
    options.controller.kind = kind;
    options
}

/// Ideal sensors, the centre of mass in the middle of the motors.
fn undisturbed(kind: ControllerKind) -> SimOptions {
    let mut options = with(kind);
    options.vehicle.center_of_mass_m = [0.0, 0.0];
    options.sensors = SensorOptions::ideal();
    options
}

fn flown(plan: &Plan, options: &SimOptions, seed: u64) -> Result<Flight> {
    fly(plan, options, seed, &mut |_| {})
}

/// The drone hangs at one place from the start.
fn hover(duration_s: f64) -> Plan {
    let at = |time_s| Setpoint {
        time_s,
        position_m: Vector3::new(0.2, -0.1, 0.8),
        velocity_m_s: Vector3::zeros(),
        acceleration_m_s2: Vector3::zeros(),
        letter: Some(0),
    };
    Plan { setpoints: vec![at(0.0), at(duration_s)], ..Default::default() }
}

/// A lying eight of 1 m by 0.5 m in the plane of the word, once round in 8 s (0.79 m/s at most),
/// with setpoints that carry velocity and acceleration, 50 a second.
fn figure_eight() -> Plan {
    let at = |i: u32| {
        let time_s = f64::from(i) * 0.02;
        let w = TAU / 8.0;
        let (sin, cos) = libm::sincos(w * time_s);
        let (sin2, cos2) = libm::sincos(2.0 * w * time_s);
        Setpoint {
            time_s,
            position_m: Vector3::new(0.5 * sin, 0.0, 1.0 + 0.25 * sin2),
            velocity_m_s: Vector3::new(0.5 * w * cos, 0.0, 0.5 * w * cos2),
            acceleration_m_s2: Vector3::new(-0.5 * w * w * sin, 0.0, -w * w * sin2),
            // The first lap begins at rest and does not count.
            letter: (time_s >= 8.0).then_some(0),
        }
    };
    Plan { setpoints: (0..=1200).map(at).collect(), ..Default::default() }
}

/// Samples that write a letter, in the plane of the word: (design, position).
fn in_plane(flight: &Flight) -> Vec<(Vector2<f64>, Vector2<f64>)> {
    let plane = |v: &Vector3<f64>| Vector2::new(v.x, v.z);
    let writing = flight.samples.iter().filter(|s: &&FlightSample| s.letter.is_some());
    writing.map(|s| (plane(&s.design_m), plane(&s.position_m))).collect()
}

fn root_mean_square(errors: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = errors.fold((0.0, 0.0), |(sum, n), e| (sum + e * e, n + 1.0));
    f64::sqrt(sum / n)
}

/// RMSE in the plane if the flight were `lag` samples earlier.
fn rmse_after(samples: &[(Vector2<f64>, Vector2<f64>)], lag: usize) -> f64 {
    let pairs = samples.iter().zip(&samples[lag..]);
    root_mean_square(pairs.map(|((design, _), (_, position))| (position - design).norm()))
}

/// Lag (s) that leaves the smallest RMSE in the plane, the RMSE before and after.
fn lag(flight: &Flight) -> (f64, f64, f64) {
    let samples = in_plane(flight);
    let after = |lag: &usize| rmse_after(&samples, *lag);
    let best = (0..300).min_by(|a, b| after(a).total_cmp(&after(b))).unwrap();
    (best as f64 / 250.0, after(&0), after(&best))
}

/// Root mean square of the distance in the plane from the path that was designed.
fn contour_error_m(flight: &Flight) -> f64 {
    let samples = in_plane(flight);
    let path: Vec<Vector2<f64>> = samples.iter().map(|(design, _)| *design).collect();
    root_mean_square(samples.iter().enumerate().map(|(i, (_, position))| {
        let near = path[i.saturating_sub(500)..(i + 500).min(path.len())].iter();
        near.map(|p| (p - position).norm()).fold(f64::INFINITY, f64::min)
    }))
}

#[test]
fn tmp_figures() {
    let noor = word("NOOR", Extent::Letters);
    for kind in KINDS {
        let f = flown(&noor, &undisturbed(kind), 0).unwrap();
        let g = flown(&noor, &with(kind), 0);
        let (l, r0, r1) = lag(&f);
        println!(
            "{kind:?}: undisturbed lag {l:.3} rmse {r0:.4} -> {r1:.4} contour {:.4} rmse {:?}",
            contour_error_m(&f),
            rmse_m(&f).unwrap().as_slice()
        );
        if let Ok(g) = g {
            let (l, r0, r1) = lag(&g);
            println!(
                "   disturbed lag {l:.3} rmse {r0:.4} -> {r1:.4} contour {:.4} {:?}",
                contour_error_m(&g),
                g.warnings
            );
        } else {
            println!("   {:?}", g.err());
        }
        let mut quiet = with(kind);
        quiet.sensors = SensorOptions::ideal();
        match flown(&hover(20.0), &quiet, 0) {
            Ok(mut f) => {
                f.samples.retain(|s| s.time_s > 10.0);
                println!("   hover mean {:?}", mean_error_m(&f).unwrap().as_slice())
            }
            Err(e) => println!("   hover {e}"),
        }
        match flown(&figure_eight(), &with(kind), 0) {
            Ok(f) => println!(
                "   eight rmse {:?} contour {:.4}",
                rmse_m(&f).unwrap().as_slice(),
                contour_error_m(&f)
            ),
            Err(e) => println!("   eight {e}"),
        }
        let whole = word("NOOR", Extent::Whole);
        for seed in 0..5 {
            match flown(&whole, &with(kind), seed) {
                Ok(f) => println!(
                    "   whole {seed} {:?} {:?}",
                    rmse_m(&f).unwrap().as_slice(),
                    f.warnings
                ),
                Err(e) => println!("   whole {seed} {e}"),
            }
        }
    }
}
