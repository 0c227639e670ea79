//! Compares digests of several flights with `golden/flight/digests.txt`, because the simulation
//! must be identical bit by bit in every build, on every machine, with any number of threads. The
//! plan is given by a formula, so that only changes of the simulator affect the digests.

use std::fmt::Write;

use nalgebra::Vector3;
use noctograph::plan::{Plan, PlanData, Setpoint};
use noctograph::scene::{Preset, Scene};
use noctograph::sensors::{HeightSensor, Positioning, SensorOptions};
use noctograph::sim::{ControllerKind, Drone, EstimatorKind, ObserverOptions, SimOptions, fly};
use noctograph::vehicle::{AirOptions, Gusts};

use crate::golden::assert_golden;

/// Returns the drone of a preset in still air, with the reference team's regulator, observer and
/// sensors.
fn drone(preset: Preset) -> SimOptions {
    let mut sim = Scene::preset(preset).sim();
    sim.controller.kind = ControllerKind::default();
    sim.observer.kind = EstimatorKind::default();
    sim.sensors.positioning = Positioning::default();
    sim.air = AirOptions::default();
    sim
}

/// Returns cases that cover each preset, controller, estimator and sensor at least once.
fn cases() -> Vec<(&'static str, SimOptions)> {
    let with = |mut options: SimOptions, change: fn(&mut SimOptions)| {
        change(&mut options);
        options
    };
    let team = SimOptions::default;
    vec![
        ("ae483-2022", team()),
        ("cf21, 1 kHz, sweeps, Kalman filter", {
            with(drone(Preset::Cf21), |o| {
                o.rates.control_hz = 1000;
                o.sensors.positioning = Positioning::Sweeps;
                o.observer.kind = EstimatorKind::Ekf;
            })
        }),
        ("cf21, 1 kHz, gusts, crossing beams, cascade", {
            with(drone(Preset::Cf21), |o| {
                o.rates.control_hz = 1000;
                o.air.gusts = Gusts::room();
                o.sensors.positioning = Positioning::CrossingBeams;
                o.controller.kind = ControllerKind::Pid;
            })
        }),
        ("cf21-thrust-kit, wind, integrals", {
            with(drone(Preset::Cf21ThrustKit), |o| {
                (o.air.wind_m_s, o.air.gusts) = ([0.5, 0.2, 0.0], Gusts::Dryden);
                o.controller.kind = ControllerKind::LqrIntegral;
            })
        }),
        ("cf-brushless, ranges, geometric", {
            with(drone(Preset::CfBrushless), |o| {
                o.sensors.positioning = Positioning::UwbTdoa;
                o.sensors.heights = vec![HeightSensor::TimeOfFlight, HeightSensor::Barometer];
                o.observer.kind = EstimatorKind::Ekf;
                o.controller.kind = ControllerKind::Geometric;
            })
        }),
        ("bzzz, satellites", {
            with(drone(Preset::Bzzz), |o| {
                o.sensors =
                    SensorOptions { positioning: Positioning::Gnss, ..SensorOptions::default() };
                o.observer =
                    ObserverOptions { kind: EstimatorKind::Ekf, ..ObserverOptions::default() };
                o.controller.kind = ControllerKind::Lqr;
            })
        }),
        ("ae483-2022, truth, fed forward", {
            with(team(), |o| {
                o.observer.kind = EstimatorKind::Truth;
                o.controller.kind = ControllerKind::LqrFeedforward;
            })
        }),
    ]
}

/// Returns a plan that goes up, to the right at 0.2 m/s, up again, and down to the floor.
fn fixed_plan() -> Plan {
    let corners = [
        (0.0, [0.0, 0.0, 0.0]),
        (0.5, [0.0, 0.0, 0.4]),
        (2.5, [0.0, 0.0, 0.5]),
        (4.0, [0.3, 0.0, 0.5]),
        (6.5, [0.3, 0.0, 1.0]),
        (8.0, [0.3, 0.1, 0.6]),
        (10.0, [0.3, 0.1, 0.0]),
        (10.5, [0.3, 0.1, 0.0]),
    ];
    let at = |tenths: u32| {
        let time_s = f64::from(tenths) * 0.1;
        let next = corners.iter().position(|(corner_s, _)| *corner_s > time_s);
        let next = next.unwrap_or(corners.len() - 1);
        let ((from_s, from), (to_s, to)) = (corners[next - 1], corners[next]);
        let (from, to) = (Vector3::from(from), Vector3::from(to));
        let velocity_m_s = (to - from) / (to_s - from_s);
        Setpoint {
            time_s,
            position_m: from + velocity_m_s * (time_s - from_s),
            velocity_m_s,
            acceleration_m_s2: Vector3::zeros(),
            letter: (25..80).contains(&tenths).then_some(0),
        }
    };
    let setpoints: Vec<Setpoint> = (0..=105).map(at).collect();
    let levels = setpoints.iter().map(|setpoint| f64::from(u8::from(setpoint.letter.is_some())));
    let lights = [("headlights".to_owned(), levels.collect())].into();
    Plan::made(PlanData { setpoints, lights, ..PlanData::default() })
}

/// Returns a digest, and figures that show what changed if the digest differs.
fn digest(plan: &Plan, options: &SimOptions) -> String {
    let flight = fly(plan, &Drone::new(options, 7), &mut |_| {}).unwrap();
    let samples = &flight.samples;
    let squares = samples.iter().map(|s| (s.position_m - s.design_m).norm_squared());
    let rms_mm = 1e3 * (squares.sum::<f64>() / samples.len() as f64).sqrt();
    let motors = samples.iter().flat_map(|s| s.motors).sum::<f64>();
    let end_s = samples.last().unwrap().time_s;
    format!("{}  {end_s:.3} s, error {rms_mm:.3} mm rms, motors {motors:.4e}", flight.sha256())
}

#[test]
fn every_build_flies_the_same_bits() {
    let (plan, cases) = (fixed_plan(), cases());
    // All cases run in parallel, each on its own thread, and then again on a single thread.
    let found: Vec<String> = std::thread::scope(|scope| {
        let threads = cases.iter().map(|(_, options)| scope.spawn(|| digest(&plan, options)));
        let threads: Vec<_> = threads.collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    let mut text = String::new();
    for ((name, options), found) in cases.iter().zip(found) {
        assert_eq!(digest(&plan, options), found, "{name}: alone as beside others");
        writeln!(text, "{found}, {name}").unwrap();
    }
    assert_golden("flight/digests.txt", &text);
}
