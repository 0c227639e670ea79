//! `noctograph gains` prints controller and observer gains, poles and stability margins.

use nalgebra::{Complex, DMatrix};

use super::flags::SceneFlags;
use super::outcome::Report;
use super::terminal::warn;
use crate::control::Margins;
use crate::error::Result;
use crate::scene::Scene;
use crate::sim::gain_design::{Design, INPUTS, MOTOR_LAG_S, STATES, design};
use crate::sim::{EstimatorKind, Law, SimOptions};
use clap::Args;
use serde_json::{Value, json};

#[derive(Debug, Args)]
pub(super) struct GainsArgs {
    #[command(flatten)]
    scene: SceneFlags,
    /// Motor lag for which the margins are computed, in seconds [default: the vehicle's, or 0.072
    /// if it has none]
    #[arg(long, value_name = "S")]
    motor_lag: Option<f64>,
    /// Also print Bryson's weights for the range of the motors
    #[arg(long)]
    bryson: bool,
}

/// Runs the verb `gains`, which designs the regulator and the observer of a scene, and reports the
/// poles and margins of its loop without and with a motor lag.
pub(super) fn run(args: &GainsArgs) -> Result<Report> {
    let scene = args.scene.load(&[], &[])?;
    let vehicle_s = 0.5 * (scene.vehicle.motor_rise_s + scene.vehicle.motor_fall_s);
    let default_s = if vehicle_s > 0.0 { vehicle_s } else { MOTOR_LAG_S };
    // The regulator and the observer are designed, and the scene's control loop is linearized.
    let design = design(&scene.sim(), args.motor_lag.unwrap_or(default_s))?;
    warn(&design.warnings);
    let loops = loop_gains(&scene.sim());
    let mut product = with_names(&design);
    product["controller"] = scene.controller.kind.name().into();
    product["gains"] = loops
        .iter()
        .map(|(name, [p, i, d], unit)| (*name, json!({ "p": p, "i": i, "d": d, "unit": unit })))
        .collect();
    let mut words = words(&scene, &design);
    // A controller with another law has neither a gain matrix nor loops.
    let has_other_law = design.k.is_none() && loops.is_empty();
    words["own"] = json!(has_other_law.then(|| scene.controller.kind.keys()));
    words["loops"] = json!(loops);
    let [x, y, z, f] = design.bryson_r;
    words["bryson"] = json!(args.bryson.then_some(INPUTS));
    words["rule"] = json!(args.bryson.then_some(BRYSON_RULE));
    words["r"] = json!(args.bryson.then(|| format!("r = [{x:.6e}, {y:.6e}, {z:.6e}, {f:.6e}]")));
    Ok(Report::with_words(product, &words, LAYOUT))
}

/// Bryson's rule for a weight of the regulator.
const BRYSON_RULE: &str = "1 / (largest deviation from hover within the motors' range)^2";

/// Returns the values of a design that appear only in the text.
fn words(scene: &Scene, design: &Design) -> Value {
    // The Luenberger observer estimates the first nine states, without the rates, except for yaw,
    // which is not observable from the position.
    let is_luenberger = scene.observer.kind == EstimatorKind::Luenberger;
    let observed: Vec<&str> = STATES.into_iter().take(9).filter(|s| *s != "psi").collect();
    // The text calls K and L designed only if they were computed here instead of taken from the
    // scene.
    let is_k_designed = design.k.is_some() && scene.controller.lqr.k.is_none();
    let designs = match (is_k_designed, is_luenberger) {
        (true, true) => Some("K and L are"),
        (true, false) => Some("K is"),
        (false, true) => Some("L is"),
        (false, false) => None,
    };
    let ratios = [0, 1, 2, 3].map(|i| scene.controller.lqr.r[i] / design.bryson_r[i]);
    json!({
        "hidden": design.unobservable.join(", "),
        "k": design.k.as_ref().map(|k| matrix(&k.transpose(), &design.states)),
        "l": is_luenberger.then(|| matrix(&design.l, &observed)),
        "regulates": design.k.as_ref().map(|_| "u = u_hover - K (x - x_des), transposed"),
        "observes": is_luenberger.then_some("dx/dt = A x + B u - L (C x - y), without psi"),
        "poles": poles(design.regulator_poles.as_ref()),
        "lagging": poles(design.lagging_poles.as_ref()),
        "observer": is_luenberger.then(|| poles(design.observer_poles.as_ref())),
        "now": margins(design.margins.as_ref()), "late": margins(design.lagging_margins.as_ref()),
        "designs": designs, "units": ["N m", "N m", "N m", "N"],
        "ratios": ratios,
    })
}

const LAYOUT: &str = "\
model     at hover: 12 states, {controllability_rank} controllable by the motors
          9 observer states, {observability_rank} observable by the position (not: {hidden})
drag      in A, poles and margins; {designs} designed without it
loop      {controller}, {controller_states} states of its own, linearized at hover

K         {regulates}
|k|<12|tau_x>14|tau_y>14|tau_z>14|f_z>14
{name}|{cells.0}|{cells.1}|{cells.2}|{cells.3}
gains     its own: {own}

|loops|gains<20|p>12|i>12|d>12|   unit of p<0
{0}|{1.0}|{1.1}|{1.2}|   {2}

L         {observes}
|l|<12|y_x>14|y_y>14|y_z>14
{name}|{cells.0}|{cells.1}|{cells.2}

poles     1/s; below with {motor_lag_s:.3} s of motor lag
loop          {poles}
with lag      {lagging}
observer      {observer}

margins   gain (dB), phase and its crossover (rad/s), loop broken at each input
|inputs|<10|without motor lag<35|with {motor_lag_s} s of motor lag<0
{}|{now.#~unstable}|{late.#~unstable}
longest   motor lag with a stable loop: {longest_lag_s:.3~over 1} s

bryson    {rule}
|bryson|<10|deviation>14|<5|weight>12|controller.lqr.r>20
{}|{largest_inputs.#:.3e}| {units.#}|{bryson_r.#:.5e}|{ratios.#:.3} times
{r}
";

/// Gains of a controller's loops, each with its name, its proportional, integral and derivative
/// gain, and the unit of the proportional gain.
type LoopGains = Vec<(&'static str, [f64; 3], &'static str)>;

/// Returns the name, the gains P, I, D and the unit of each loop of the scene's cascade or
/// geometric controller, or an empty list for any other controller.
fn loop_gains(sim: &SimOptions) -> LoopGains {
    match sim.controller.kind.law() {
        Law::Cascade => {
            let names = [
                ["position x", "position y", "position z"],
                ["velocity x", "velocity y", "velocity z"],
                ["attitude roll", "attitude pitch", "attitude yaw"],
                ["rate roll", "rate pitch", "rate yaw"],
            ];
            let units = ["m/s per m", "deg per m/s", "deg/s per deg", "1/65535 per deg/s"];
            let loops = names.into_iter().flatten().zip(sim.controller.pid.gains().concat());
            loops
                .enumerate()
                .map(|(index, (name, gains))| {
                    // The climb rate loop outputs thrust in 1000/65535 of a motor's range.
                    let unit = if index == 5 { "1000/65535 per m/s" } else { units[index / 3] };
                    (name, gains, unit)
                })
                .collect()
        }
        Law::Geometric => {
            let k = &sim.controller.geometric;
            let position = [k.k_position, k.k_position_integral, k.k_velocity];
            let attitude = ["attitude x", "attitude y", "attitude z"].into_iter().enumerate();
            let attitude = attitude.map(|(axis, name)| {
                let gains = [k.k_attitude, k.k_attitude_integral, k.k_rate].map(|k| k[axis]);
                (name, gains, "rad/s2 per rad")
            });
            std::iter::once(("position x y z", position, "m/s2 per m")).chain(attitude).collect()
        }
        Law::StateFeedback { .. } | Law::Own => Vec::new(),
    }
}

/// Returns the rows of a matrix with their names (`rows`). Entries are shown with six decimals, or
/// three from 10, and as a dash if they are zero or a billionth of their column's largest entry.
fn matrix(m: &DMatrix<f64>, rows: &[&str]) -> Vec<Value> {
    // The solution of the Riccati equation has rounding errors of this size.
    let tiny = m.column_iter().map(|column| 1e-9 * column.amax()).collect::<Vec<_>>();
    let rows = rows.iter().zip(m.row_iter()).map(|(name, row)| {
        let cells = row.iter().zip(&tiny).map(|(entry, tiny)| match entry.abs() {
            size if size <= *tiny => "-".to_owned(),
            size if size < 10.0 => format!("{entry:.6}"),
            _ => format!("{entry:.3}"),
        });
        json!({ "name": name, "cells": cells.collect::<Vec<_>>() })
    });
    rows.collect()
}

/// Returns poles in 1/s as text, with one entry per conjugate pair. Without poles, the text says
/// that the iteration did not converge.
fn poles(poles: Option<&Vec<Complex<f64>>>) -> String {
    let Some(poles) = poles else { return "not found: the iteration did not converge".to_owned() };
    let upper = poles.iter().filter(|pole| pole.im >= 0.0);
    let words = upper.map(|pole| match pole.im {
        0.0 => format!("{:.2}", pole.re),
        // A pair whose imaginary part rounds to zero at two decimals is printed as two real poles.
        im if im < 0.005 => format!("{:.2}  {:.2}", pole.re, pole.re),
        im => format!("{:.2}±{im:.2}i", pole.re),
    });
    words.collect::<Vec<_>>().join("  ")
}

/// Returns the stability margins of each input as text, or `None` for an unstable loop.
fn margins(margins: Option<&[Margins; 4]>) -> Option<Vec<String>> {
    /// Returns the gain margins of one input in dB, and its phase margin in degrees with the
    /// crossover in rad/s, as text. Without a crossover, any phase is stable.
    fn in_words(margins: &Margins) -> String {
        let [down, up] = [margins.gain_down, margins.gain_up]
            .map(|gain| gain.map(|gain| format!("{:+.1}", decibels(gain))));
        let (down, up) = (down.unwrap_or("-inf".into()), up.unwrap_or("+inf".into()));
        let phase = margins
            .phase_rad
            .zip(margins.crossover_rad_s)
            .map(|(phase, at_rad_s)| format!("{:.0}° at {at_rad_s:.1}", phase.to_degrees()));
        format!("{:18}{}", format!("{down} to {up} dB"), phase.unwrap_or("any".into()))
    }
    margins.map(|margins| margins.iter().map(in_words).collect())
}

/// Returns a gain factor in dB.
fn decibels(factor: f64) -> f64 {
    20.0 * libm::log10(factor)
}

/// Returns a design as JSON, with named inputs and with gain margins in decibels.
fn with_names(design: &Design) -> Value {
    let mut json = json!(design);
    for margins in ["margins", "lagging_margins"] {
        let margins = json[margins].as_array_mut().into_iter().flatten();
        for (margins, input) in margins.zip(INPUTS) {
            margins["input"] = input.into();
            for (gain, db) in [("gain_up", "gain_up_db"), ("gain_down", "gain_down_db")] {
                margins[db] = margins[gain].as_f64().map(decibels).into();
            }
        }
    }
    json["inputs"] = json!(INPUTS);
    json
}
