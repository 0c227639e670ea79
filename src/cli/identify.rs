//! `noctograph identify` estimates drone parameters and observer weights from a flight log.

use std::path::{Path, PathBuf};

use super::flags::SceneFlags;
use super::flight_flags::FlightFlags;
use super::outcome::Report;
use super::terminal::warn;
use crate::error::{Error, Result};
use crate::identify::{Identified, MODEL_STATES, identify, pendulum_inertia_kg_m2};
use crate::vehicle::VehicleOptions;
use clap::Args;
use serde_json::json;

#[derive(Debug, Args)]
pub(super) struct IdentifyArgs {
    /// Log of a flight, or a simulated flight
    #[arg(required_unless_present = "pendulum_period")]
    log: Option<PathBuf>,
    #[command(flatten)]
    flight: FlightFlags,
    #[command(flatten)]
    scene: SceneFlags,
    /// Period of one swing of a pendulum test, in seconds, from which the moment of inertia is
    /// computed
    #[arg(long, value_name = "S", requires = "pendulum_pivot")]
    pendulum_period: Option<f64>,
    /// Distance from the pendulum's pivot to the center of mass, in meters
    #[arg(long, value_name = "M", requires = "pendulum_period")]
    pendulum_pivot: Option<f64>,
}

/// Runs the verb `identify`, which estimates a drone's parameters and the weights of its observer
/// from a log, and its moment of inertia from a pendulum test. Either may be given without the
/// other.
pub(super) fn run(args: &IdentifyArgs) -> Result<Report> {
    let scene = args.scene.load(args.log.as_slice(), &[])?;
    let vehicle = &scene.vehicle;
    let swing = args.pendulum_pivot.zip(args.pendulum_period);
    let inertia_kg_m2 = swing
        .map(|(pivot_m, period_s)| pendulum_inertia_kg_m2(vehicle.mass_kg, pivot_m, period_s))
        .transpose()?;
    let flight = args.log.as_deref().map(|log| args.flight.read(log, Some(&scene))).transpose()?;
    let identified = flight
        .map(|flight| identify(&flight, vehicle))
        .transpose()
        .map_err(|error| named(error, args.log.as_deref()))?;
    warn(identified.iter().flat_map(|identified| &identified.left_out));
    Ok(report(vehicle, identified.as_ref(), inertia_kg_m2))
}

/// Returns the report on what was identified from a log, and on a moment of inertia. The figures of
/// a missing log or test are null.
fn report(
    vehicle: &VehicleOptions,
    identified: Option<&Identified>,
    inertia_kg_m2: Option<f64>,
) -> Report {
    // Neither the mass nor the arm can be determined from a log, because the inferred thrust is
    // proportional to the mass, and the torque to the arm.
    let VehicleOptions { mass_kg, arm_m, .. } = vehicle;
    let lag = identified.and_then(|it| it.lag);
    let r = identified.and_then(Identified::observer_r);
    let left_out = identified.map(|it| it.left_out.iter().map(ToString::to_string));
    let product = json!({
        "assumed": { "mass_kg": mass_kg, "arm_m": arm_m },
        "samples": identified.map(|it| it.n_samples),
        "mean_motors": identified.map(|it| it.mean_motors),
        "k_f_n": identified.map(|it| it.k_f_n),
        "motor_torque_n_m": identified.map(|it| it.motor_torque_n_m),
        "center_of_mass_m": identified.map(|it| it.center_of_mass_m),
        "center_of_mass_half_width_m": identified.and_then(|it| it.center_of_mass_half_width_m),
        "rotor_lag_s": lag.map(|lag| lag.lag_s),
        "rotor_lag_half_width_s": lag.map(|lag| lag.half_width_s),
        "measurement_sigma_m": identified.and_then(|it| it.measurement_sigma_m),
        "observer_q": identified.and_then(Identified::observer_q),
        "model_sigma": identified.and_then(|it| it.model_sigma),
        "observer_r": r,
        "left_out": left_out.map(|left_out| left_out.collect::<Vec<_>>()),
        "inertia_kg_m2": inertia_kg_m2,
    });
    // There is no weight for the fourth state, yaw.
    let weights = r.map(|[x, y, z, rest @ ..]| {
        [x, y, z].map(Some).into_iter().chain([None]).chain(rest.map(Some)).collect::<Vec<_>>()
    });
    let unsure = lag.filter(|lag| !lag.is_identifiable());
    let words = json!({
        "axes": ["x", "y", "z"], "states": MODEL_STATES, "weights": weights,
        "unsure": unsure.map(|_| "not identifiable from this log"),
    });
    Report::with_words(product, &words, LAYOUT)
}

const LAYOUT: &str = "\
assumed       mass {assumed.mass_kg*1e3:.2} g, arm {assumed.arm_m*1e3:.2} mm, from the scene; weigh your drone: --set vehicle.mass_kg=...
samples       {samples} in the air, mean commands {mean_motors.0:.0} {mean_motors.1:.0} {mean_motors.2:.0} {mean_motors.3:.0}
k_F           {k_f_n:.4e} N per unit of a motor's command
torque        x {motor_torque_n_m.0:+.2e}  y {motor_torque_n_m.1:+.2e} N m, mean of the motors
mass center   x {center_of_mass_m.0*1e3:+.2}[ ± {center_of_mass_half_width_m.0*1e3:.2}] mm, y {center_of_mass_m.1*1e3:+.2}[ ± {center_of_mass_half_width_m.1*1e3:.2}] mm (95 %) from the middle of the motors
rotor lag     {rotor_lag_s*1e3:.0} ± {rotor_lag_half_width_s*1e3:.0} ms (95 %)[: {unsure}]
inertia       {inertia_kg_m2:.4e} kg m2

|measurement_sigma_m|measured<14|sigma, m<16|observer.luenberger.q<0
{axes.#}|{:.4}|{observer_q.#:.0}

|model_sigma|model<14|sigma, per s<16|observer.luenberger.r<0
{states.#}|{:.4}|{weights.#:.1~not observable}
";

/// Returns an input error with the name of the log file as its place. Other errors are unchanged.
fn named(error: Error, log: Option<&Path>) -> Error {
    match (error, log) {
        (Error::Input { found, wanted, hint, .. }, Some(log)) => {
            Error::input(log.display(), found, wanted, hint)
        }
        (other, _) => other,
    }
}
