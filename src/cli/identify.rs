//! `noctograph identify`: parameters of a drone and weights of its observer, from a flight log.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::flags::{FlightFlags, SceneFlags};
use super::outcome::{Report, wrapped};
use super::table::table;
use super::warn;
use crate::error::{Error, Result};
use crate::identify::yaw::ReactionTorque;
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
    let scene = args.scene.load(&[])?;
    let vehicle = scene.vehicle.clone();
    let of_the_scene = Assumed::of(&vehicle);
    let swing = args.pendulum_pivot.zip(args.pendulum_period);
    let inertia = swing.map(|(pivot_m, s)| pendulum_inertia_kg_m2(vehicle.mass_kg, pivot_m, s));
    let inertia_kg_m2 = inertia.transpose()?;
    let flight = args.log.as_deref().map(|log| args.flight.read(log, Some(&scene)));
    let flight = flight.transpose()?;
    let identified =
        flight.map(|flight| identify(&flight, &of_the_scene)).transpose().map_err(named(args))?;
    warn(identified.iter().flat_map(|identified| &identified.left_out));
    let inertia = inertia_kg_m2.map(|j| format!("inertia       {j:.4e} kg m2\n"));
    let assumed = assumed(&vehicle);
    let text =
        [Some(assumed), identified.as_ref().map(text_of), inertia].into_iter().flatten().collect();
    Ok(Report::new(text, to_json(&vehicle, identified.as_ref(), inertia_kg_m2)))
}

/// Puts the log's name in the place of "flight".
fn named(args: &IdentifyArgs) -> impl Fn(Error) -> Error + '_ {
    move |error| match (error, &args.log) {
        (Error::Input { found, wanted, hint, .. }, Some(log)) => {
            Error::input(log.display(), found, wanted, hint)
        }
        (other, _) => other,
    }
}

/// What the scene says of the drone, which the log does not tell: thrust scales with the mass,
/// torque with the arm.
fn assumed(vehicle: &VehicleOptions) -> String {
    let VehicleOptions { mass_kg, arm_m, .. } = vehicle;
    let text = format!(
        "mass {:.2} g, arm {:.2} mm, of the scene; weigh yours: --set vehicle.mass_kg=...",
        1e3 * mass_kg,
        1e3 * arm_m
    );
    wrapped(&format!("{:14}", "assumed"), &text)
}

fn text_of(identified: &Identified) -> String {
    let [m1, m2, m3, m4] = identified.mean_motors;
    let [tau_x, tau_y] = identified.motor_torque_n_m;
    let [com_x, com_y] = identified.center_of_mass_m.map(|m| m * 1e3);
    let mut text = format!(
        "samples       {} in the air, mean commands {m1:.0} {m2:.0} {m3:.0} {m4:.0}\n\
         k_F           {:.4e} N per unit of a motor's command\n\
         torque        x {tau_x:+.2e}  y {tau_y:+.2e} N m, mean of the motors\n\
         mass center   x {com_x:+.2} mm, y {com_y:+.2} mm from the middle of the motors\n",
        identified.n_samples, identified.k_f_n
    );
    if let Some(lag) = identified.lag {
        let (ms, doubt_ms) = (1e3 * lag.lag_s, 1e3 * lag.half_width_s);
        let note = if lag.is_identifiable() { "" } else { ": not identifiable from this log" };
        text += &format!("rotor lag     {ms:.0} ± {doubt_ms:.0} ms (95 %){note}\n");
    }
    if let Some(air) = identified.air {
        let [x, y] = air.torque_sigma_n_m;
        text += &format!("uneven air    turns with sigma x {x:.1e}  y {y:.1e} N m\n");
    }
    if let Some(reaction) = identified.reaction {
        let ReactionTorque { k_m_n_m, half_width_n_m, correlation } = reaction;
        let per_unit = "N m per unit of a motor's command (95 %)";
        text += &format!("k_M           {k_m_n_m:.2e} ± {half_width_n_m:.1e} {per_unit}\n");
        if !reaction.is_identifiable() {
            let why = "not identifiable from this log: yaw was not excited, or the log is slower than \
                       the motors' commands";
            let why = format!("{why} (correlation {correlation:.2})");
            text += &wrapped(&format!("{:14}", ""), &why);
        }
    }
    if let (Some(sigma), Some(q)) = (identified.measurement_sigma_m, identified.observer_q()) {
        let rows = ["x", "y", "z"].iter().zip(sigma).zip(q);
        let rows = rows.map(|((name, sigma), q)| format!("{name}\t{sigma:.4}\t{q:.0}"));
        text += "\n";
        text += &table("measured<14|sigma, m<16|observer.luenberger.q<0", rows);
    }
    if let (Some(sigma), Some(r)) = (identified.model_sigma, identified.observer_r()) {
        let mut weights = r.iter();
        let rows = MODEL_STATES.iter().zip(sigma).map(|(name, sigma)| {
            let weight = if *name == "psi" { None } else { weights.next() };
            let weight = weight.map_or("not observable".to_owned(), |r| format!("{r:.1}"));
            format!("{name}\t{sigma:.4}\t{weight}")
        });
        text += "\n";
        text += &table("model<14|sigma, per s<16|observer.luenberger.r<0", rows);
    }
    text
}

fn to_json(
    vehicle: &VehicleOptions,
    identified: Option<&Identified>,
    inertia_kg_m2: Option<f64>,
) -> serde_json::Value {
    let reaction = identified.and_then(|it| it.reaction);
    json!({
        "assumed": { "mass_kg": vehicle.mass_kg, "arm_m": vehicle.arm_m },
        "samples": identified.map(|it| it.n_samples),
        "mean_motors": identified.map(|it| it.mean_motors),
        "k_f_n": identified.map(|it| it.k_f_n),
        "motor_torque_n_m": identified.map(|it| it.motor_torque_n_m),
        "center_of_mass_m": identified.map(|it| it.center_of_mass_m),
        "rotor_lag_s": identified.and_then(|it| it.lag).map(|lag| lag.lag_s),
        "rotor_lag_half_width_s": identified.and_then(|it| it.lag).map(|lag| lag.half_width_s),
        "air_torque_n_m": identified.and_then(|it| it.air).map(|air| air.torque_sigma_n_m),
        "k_m_n_m": reaction.map(|reaction| reaction.k_m_n_m),
        "k_m_half_width_n_m": reaction.map(|reaction| reaction.half_width_n_m),
        "k_m_identifiable": reaction.map(|reaction| reaction.is_identifiable()),
        "yaw_correlation": reaction.map(|reaction| reaction.correlation),
        "measurement_sigma_m": identified.and_then(|it| it.measurement_sigma_m),
        "model_sigma": identified.and_then(|it| it.model_sigma),
        "observer_q": identified.and_then(Identified::observer_q),
        "observer_r": identified.and_then(Identified::observer_r),
        "left_out": identified.map(|it| &it.left_out),
        "inertia_kg_m2": inertia_kg_m2,
    })
}
