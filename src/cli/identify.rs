//! `noctograph identify`: parameters of a drone and weights of its observer, from a flight log.

use std::path::{Path, PathBuf};

use super::{Args, Error, FlightFlags, Report, Result, SceneFlags, json, table, warn};
use crate::identify::{Assumed, Identified, MODEL_STATES, identify, pendulum_inertia_kg_m2};
use crate::vehicle::VehicleOptions;

#[derive(Debug, Args)]
pub(super) struct IdentifyArgs {
    /// Log of a flight, or a simulated flight
    #[arg(required_unless_present = "pendulum_period")]
    log: Option<PathBuf>,
    #[command(flatten)]
    flight: FlightFlags,
    #[command(flatten)]
    scene: SceneFlags,
    /// Period of one swing of a pendulum test, in seconds: gives the moment of inertia
    #[arg(long, value_name = "S", requires = "pendulum_pivot")]
    pendulum_period: Option<f64>,
    /// Distance from the pendulum's pivot to the center of mass, in meters
    #[arg(long, value_name = "M", requires = "pendulum_period")]
    pendulum_pivot: Option<f64>,
}

pub(super) fn run(args: &IdentifyArgs) -> Result<Report> {
    let scene = args.scene.load_of(args.log.as_slice(), &[])?;
    let vehicle = &scene.vehicle;
    let swing = args.pendulum_pivot.zip(args.pendulum_period);
    let inertia_kg_m2 = swing
        .map(|(pivot_m, s)| pendulum_inertia_kg_m2(vehicle.mass_kg, pivot_m, s))
        .transpose()?;
    let flight = args.log.as_deref().map(|log| args.flight.read(log, Some(&scene))).transpose()?;
    let identified = flight
        .map(|flight| identify(&flight, &Assumed::from_vehicle(vehicle)))
        .transpose()
        .map_err(|error| named(error, args.log.as_deref()))?;
    warn(identified.iter().flat_map(|identified| &identified.left_out));

    let mut report = Report::with_names_of(14);
    // The log does not tell them: thrust scales with the mass, torque with the arm.
    let VehicleOptions { mass_kg, arm_m, .. } = vehicle;
    let assumed = format!(
        "mass {:.2} g, arm {:.2} mm, of the scene; weigh yours: --set vehicle.mass_kg=...",
        1e3 * mass_kg,
        1e3 * arm_m
    );
    report.figure("assumed", json!({ "mass_kg": mass_kg, "arm_m": arm_m }), "assumed", &assumed);
    tell(&mut report, identified.as_ref());
    report.optional("inertia_kg_m2", inertia_kg_m2, "inertia", |j| format!("{j:.4e} kg m2"));
    Ok(report)
}

/// An error of a flight with the log's name in the place of "flight".
fn named(error: Error, log: Option<&Path>) -> Error {
    match (error, log) {
        (Error::Input { found, wanted, hint, .. }, Some(log)) => {
            Error::input(log.display(), found, wanted, hint)
        }
        (other, _) => other,
    }
}

/// Adds what was identified; null where there was no log.
fn tell(report: &mut Report, identified: Option<&Identified>) {
    report.value("samples", identified.map(|it| it.n_samples));
    report.value("mean_motors", identified.map(|it| it.mean_motors));
    if let Some(Identified { n_samples, mean_motors: [m1, m2, m3, m4], .. }) = identified {
        let motors = format!("{m1:.0} {m2:.0} {m3:.0} {m4:.0}");
        report.line("samples", &format!("{n_samples} in the air, mean commands {motors}"));
    }
    report.optional("k_f_n", identified.map(|it| it.k_f_n), "k_F", |k_f_n| {
        format!("{k_f_n:.4e} N per unit of a motor's command")
    });
    let torque_n_m = identified.map(|it| it.motor_torque_n_m);
    report.optional("motor_torque_n_m", torque_n_m, "torque", |[x, y]| {
        format!("x {x:+.2e}  y {y:+.2e} N m, mean of the motors")
    });
    let center_m = identified.map(|it| it.center_of_mass_m);
    report.optional("center_of_mass_m", center_m, "mass center", |center_m| {
        let [x, y] = center_m.map(|m| m * 1e3);
        format!("x {x:+.2} mm, y {y:+.2} mm from the middle of the motors")
    });
    let lag = identified.and_then(|it| it.lag);
    report.value("rotor_lag_half_width_s", lag.map(|lag| lag.half_width_s));
    report.value("rotor_lag_s", lag.map(|lag| lag.lag_s));
    if let Some(lag) = lag {
        let (ms, doubt_ms) = (1e3 * lag.lag_s, 1e3 * lag.half_width_s);
        let note = if lag.is_identifiable() { "" } else { ": not identifiable from this log" };
        report.line("rotor lag", &format!("{ms:.0} ± {doubt_ms:.0} ms (95 %){note}"));
    }
    let sigma_m = identified.and_then(|it| it.measurement_sigma_m);
    let q = identified.and_then(Identified::observer_q);
    if let Some((sigma_m, q)) = sigma_m.zip(q) {
        let rows = ["x", "y", "z"].iter().zip(sigma_m).zip(q);
        let rows = rows.map(|((name, sigma), q)| format!("{name}\t{sigma:.4}\t{q:.0}"));
        report.table(&table("measured<14|sigma, m<16|observer.luenberger.q<0", rows));
    }
    let model_sigma = identified.and_then(|it| it.model_sigma);
    let r = identified.and_then(Identified::observer_r);
    if let Some((sigma, r)) = model_sigma.zip(r) {
        let mut weights = r.iter();
        let rows = MODEL_STATES.iter().zip(sigma).map(|(name, sigma)| {
            let weight = if *name == "psi" { None } else { weights.next() };
            let weight = weight.map_or("not observable".to_owned(), |r| format!("{r:.1}"));
            format!("{name}\t{sigma:.4}\t{weight}")
        });
        report.table(&table("model<14|sigma, per s<16|observer.luenberger.r<0", rows));
    }
    report.value("measurement_sigma_m", sigma_m);
    report.value("observer_q", q);
    report.value("model_sigma", model_sigma);
    report.value("observer_r", r);
    report.value("left_out", identified.map(|it| &it.left_out));
}
