//! `noctograph gains`: gains of controller and observer, poles and stability margins.

use clap::Args;
use nalgebra::{Complex, DMatrix};
use serde_json::{Value, json};

use super::flags::SceneFlags;
use super::message;
use super::report::{Report, wrapped};
use crate::control::Margins;
use crate::error::Result;
use crate::sim::design::{Design, INPUTS, MOTOR_LAG_S, STATES, design};

#[derive(Debug, Args)]
pub(super) struct GainsArgs {
    #[command(flatten)]
    scene: SceneFlags,
    /// Motor lag that the margins are computed for, in seconds [default: the vehicle's, or 0.072
    /// where it has none]
    #[arg(long, value_name = "S")]
    motor_lag: Option<f64>,
    /// Print Bryson's weights for the range of the motors as well
    #[arg(long)]
    bryson: bool,
}

pub(super) fn run(args: &GainsArgs) -> Result<Report> {
    let scene = args.scene.load(&[])?;
    let own_s = 0.5 * (scene.vehicle.motor_rise_s + scene.vehicle.motor_fall_s);
    let default_s = if own_s > 0.0 { own_s } else { MOTOR_LAG_S };
    let design = design(&scene.sim(), args.motor_lag.unwrap_or(default_s))?;
    for warning in &design.warnings {
        message("warning: ", warning);
    }
    let bryson = if args.bryson { bryson(&design, &scene.controller.lqr.r) } else { String::new() };
    Ok(Report::new(tables(&design) + &bryson, to_json(&design)))
}

/// Everything for people.
fn tables(design: &Design) -> String {
    let Design { controllability_rank, observability_rank, .. } = design;
    let observed: Vec<&str> = STATES.into_iter().take(9).filter(|s| *s != "psi").collect();
    let hidden = design.unobservable.join(", ");
    let mut text = format!(
        "model     at hover: 12 states, {controllability_rank} controllable by the motors\n          \
         9 observer states, {observability_rank} observable by the position (not: {hidden})\n",
    );
    text += "\nK         u = u_hover - K (x - x_des), transposed\n";
    text += &matrix(&design.k.transpose(), &design.states, &INPUTS);
    text += "\nL         dx/dt = A x + B u - L (C x - y), without psi\n";
    text += &matrix(&design.l, &observed, &["y_x", "y_y", "y_z"]);
    let lag_s = design.motor_lag_s;
    text +=
        &format!("\npoles     1/s\n{}", pole_lines("regulator", design.regulator_poles.as_ref()));
    text += &pole_lines(&format!("  {lag_s} s lag"), design.lagging_poles.as_ref());
    text += &pole_lines("observer", design.observer_poles.as_ref());
    text += "\nmargins   gain, phase and crossover (rad/s), loop broken at each input\n";
    text += &format!("{:10}{:33}with {lag_s} s of motor lag\n", "", "without motor lag");
    for (i, input) in INPUTS.iter().enumerate() {
        let shown =
            |margins: &Option<[Margins; 4]>| margins.map_or("unstable".into(), |m| margin(&m[i]));
        let (now, late) = (shown(&design.margins), shown(&design.lagging_margins));
        text += &format!("{input:10}{now:33}{late}\n");
    }
    let longest = design.longest_lag_s.map_or("over a second".into(), |s| format!("{s:.3} s"));
    text + &format!("longest   motor lag with a stable loop: {longest}\n")
}

/// A row for each state, a column for each output or input; zeros as a dash.
fn matrix(m: &DMatrix<f64>, rows: &[&str], columns: &[&str]) -> String {
    let mut text = format!("{:12}", "");
    columns.iter().for_each(|name| text += &format!("{name:>14}"));
    text.push('\n');
    let tiny = m.column_iter().map(|column| 1e-9 * column.amax()).collect::<Vec<_>>();
    for (i, name) in rows.iter().enumerate() {
        text += &format!("{name:12}");
        for (j, tiny) in tiny.iter().enumerate() {
            let entry = m[(i, j)];
            let shown = if entry.abs() <= *tiny { "-".to_owned() } else { figure(entry) };
            text += &format!("{shown:>14}");
        }
        text.push('\n');
    }
    text
}

/// Six decimals, three for large numbers.
fn figure(value: f64) -> String {
    if value.abs() < 10.0 { format!("{value:.6}") } else { format!("{value:.3}") }
}

/// Poles, wrapped; a conjugate pair as one.
fn pole_lines(name: &str, poles: Option<&Vec<Complex<f64>>>) -> String {
    let Some(poles) = poles else {
        return format!("{name:14}not found: the iteration did not converge\n");
    };
    let upper = poles.iter().filter(|pole| pole.im >= 0.0);
    let words = upper.map(|pole| match pole.im {
        0.0 => format!("{:.2}", pole.re),
        im => format!("{:.2}±{im:.2}i", pole.re),
    });
    wrapped(&format!("{name:14}"), &words.collect::<Vec<_>>().join("  "))
}

fn margin(margins: &Margins) -> String {
    let down = margins.gain_down.map_or("0".into(), |g| format!("{g:.2}"));
    let up = margins.gain_up.map_or("any".into(), |g| format!("{g:.2}"));
    let phase = margins.phase_rad.zip(margins.crossover_rad_s);
    let phase =
        phase.map_or("any".into(), |(phase, at)| format!("{:.0}° at {at:.1}", phase.to_degrees()));
    format!("{:14}{phase}", format!("{down} to {up}"))
}

/// Bryson's weights beside those of the scene.
fn bryson(design: &Design, r: &[f64; 4]) -> String {
    let mut text =
        "\nbryson    1 / (largest deviation from hover within the motors' range)^2\n".to_owned();
    text += &format!("{:10}{:>14}{:>16}{:>20}\n", "", "deviation", "weight", "controller.lqr.r");
    for (i, input) in INPUTS.iter().enumerate() {
        let (deviation, weight) = (design.largest_inputs[i], design.bryson_r[i]);
        let unit = if i == 3 { "N" } else { "N m" };
        let ratio = r[i] / weight;
        text +=
            &format!("{input:10}{deviation:>14.3e} {unit:3}{weight:>12.5e}{ratio:>12.3} times\n");
    }
    let [x, y, z, f] = design.bryson_r;
    text + &format!("r = [{x:.6e}, {y:.6e}, {z:.6e}, {f:.6e}]\n")
}

/// Everything for programs; matrices are arrays of rows.
fn to_json(design: &Design) -> Value {
    let rows = |m: &DMatrix<f64>| -> Vec<Vec<f64>> {
        m.row_iter().map(|row| row.iter().copied().collect()).collect()
    };
    let poles = |poles: &Option<Vec<Complex<f64>>>| {
        poles.as_ref().map(|poles| poles.iter().map(|p| [p.re, p.im]).collect::<Vec<_>>())
    };
    let margins = |margins: &Option<[Margins; 4]>| {
        margins.map(|margins| {
            let one = |(input, m): (&str, Margins)| {
                json!({
                    "input": input,
                    "gain_up": m.gain_up,
                    "gain_down": m.gain_down,
                    "phase_rad": m.phase_rad,
                    "crossover_rad_s": m.crossover_rad_s,
                })
            };
            INPUTS.into_iter().zip(margins).map(one).collect::<Vec<_>>()
        })
    };
    json!({
        "K": rows(&design.k),
        "L": rows(&design.l),
        "states": design.states,
        "inputs": INPUTS,
        "controllability_rank": design.controllability_rank,
        "observability_rank": design.observability_rank,
        "unobservable": design.unobservable,
        "regulator_poles": poles(&design.regulator_poles),
        "observer_poles": poles(&design.observer_poles),
        "margins": margins(&design.margins),
        "motor_lag_s": design.motor_lag_s,
        "lagging_poles": poles(&design.lagging_poles),
        "lagging_margins": margins(&design.lagging_margins),
        "longest_lag_s": design.longest_lag_s,
        "largest_inputs": design.largest_inputs,
        "bryson_r": design.bryson_r,
        "warnings": design.warnings,
    })
}
