//! `noctograph gains`: gains of controller and observer, poles and stability margins.

use nalgebra::{Complex, DMatrix};

use super::{Args, Report, Result, SceneFlags, Value, json, line, table, warn, wrapped};
use crate::control::Margins;
use crate::scene::Scene;
use crate::sim::design::{Design, INPUTS, MOTOR_LAG_S, STATES, design};
use crate::sim::{EstimatorKind, Law, SimOptions};

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
    warn(&design.warnings);
    let gains = gains(&scene.sim());
    let mut report = Report::of(to_json(&design, &gains));
    report.value("controller", scene.controller.kind.name());
    tell(&mut report, &design, &scene, &gains);
    if args.bryson {
        report.text += &bryson(&design, &scene.controller.lqr.r);
    }
    Ok(report)
}

/// Gains of the loops of a cascade or geometric controller: name, proportional, integral and
/// derivative gain, and the unit of the first.
type LoopGains = Vec<(&'static str, [f64; 3], &'static str)>;

/// The gains of the scene's cascade or geometric controller; nothing of another.
fn gains(sim: &SimOptions) -> LoopGains {
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
            let named = loops.enumerate().map(|(index, (name, gains))| {
                // The height's velocity loop gives thrust, in 1000/65535 of a motor's range.
                (name, gains, if index == 5 { "1000/65535 per m/s" } else { units[index / 3] })
            });
            named.collect()
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

/// Adds everything for people.
fn tell(report: &mut Report, design: &Design, scene: &Scene, gains: &LoopGains) {
    let Design { controllability_rank, observability_rank, n_controller_states, .. } = design;
    let hidden = design.unobservable.join(", ");
    report.line(
        "model",
        &format!(
            "at hover: 12 states, {controllability_rank} controllable by the motors\n9 observer \
             states, {observability_rank} observable by the position (not: {hidden})"
        ),
    );
    let kind = scene.controller.kind.name();
    let n_own = match n_controller_states {
        0 => "no".to_owned(),
        n => n.to_string(),
    };
    report.line("loop", &format!("{kind}, {n_own} states of its own, linearized at hover"));
    let text = &mut report.text;
    if let Some(k) = &design.k {
        *text += "\nK         u = u_hover - K (x - x_des), transposed\n";
        *text += &matrix(&k.transpose(), &design.states, &INPUTS);
    } else if gains.is_empty() {
        *text += &line("gains", &format!("its own: {}", scene.controller.kind.keys()));
    } else {
        let row = |(name, [p, i, d], unit): &(&str, [f64; 3], &str)| {
            format!("{name}\t{p}\t{i}\t{d}\t   {unit}")
        };
        *text += "\n";
        *text += &table("gains<20|p>12|i>12|d>12|   unit of p<0", gains.iter().map(row));
    }
    let is_luenberger = scene.observer.kind == EstimatorKind::Luenberger;
    if is_luenberger {
        let observed: Vec<&str> = STATES.into_iter().take(9).filter(|s| *s != "psi").collect();
        *text += "\nL         dx/dt = A x + B u - L (C x - y), without psi\n";
        *text += &matrix(&design.l, &observed, &["y_x", "y_y", "y_z"]);
    }
    let lag_s = design.motor_lag_s;
    *text += "\npoles     1/s\n";
    *text += &pole_lines("loop", design.regulator_poles.as_ref());
    *text += &pole_lines(&format!("  {lag_s:.3} s lag"), design.lagging_poles.as_ref());
    if is_luenberger {
        *text += &pole_lines("observer", design.observer_poles.as_ref());
    }
    *text += "\nmargins   gain (dB), phase and its crossover (rad/s), loop broken at each input\n";
    let rows = INPUTS.iter().enumerate().map(|(i, input)| {
        let shown =
            |margins: &Option<[Margins; 4]>| margins.map_or("unstable".into(), |m| margin(&m[i]));
        format!("{input}\t{}\t{}", shown(&design.margins), shown(&design.lagging_margins))
    });
    *text += &table(&format!("<10|without motor lag<35|with {lag_s} s of motor lag<0"), rows);
    let longest = design.longest_lag_s.map_or("over a second".into(), |s| format!("{s:.3} s"));
    report.line("longest", &format!("motor lag with a stable loop: {longest}"));
}

/// A row for each state, a column for each output or input; six decimals, three of large numbers,
/// and zeros as a dash.
fn matrix(m: &DMatrix<f64>, rows: &[&str], columns: &[&str]) -> String {
    let shown = |entry: f64, tiny: f64| match entry.abs() {
        size if size <= tiny => "\t-".to_owned(),
        size if size < 10.0 => format!("\t{entry:.6}"),
        _ => format!("\t{entry:.3}"),
    };
    let tiny = m.column_iter().map(|column| 1e-9 * column.amax()).collect::<Vec<_>>();
    let rows = rows.iter().zip(m.row_iter()).map(|(name, row)| {
        let entries = row.iter().zip(&tiny).map(|(entry, tiny)| shown(*entry, *tiny));
        (*name).to_owned() + &entries.collect::<String>()
    });
    let columns: String = columns.iter().map(|name| format!("|{name}>14")).collect();
    table(&format!("<12{columns}"), rows)
}

/// Poles, wrapped; a conjugate pair as one.
fn pole_lines(name: &str, poles: Option<&Vec<Complex<f64>>>) -> String {
    let Some(poles) = poles else {
        return format!("{name:14}not found: the iteration did not converge\n");
    };
    let upper = poles.iter().filter(|pole| pole.im >= 0.0);
    let words = upper.map(|pole| match pole.im {
        0.0 => format!("{:.2}", pole.re),
        // A pair that is real in two decimals.
        im if im < 0.005 => format!("{:.2}  {:.2}", pole.re, pole.re),
        im => format!("{:.2}±{im:.2}i", pole.re),
    });
    wrapped(&format!("{name:13} "), &words.collect::<Vec<_>>().join("  "))
}

fn margin(margins: &Margins) -> String {
    let down = margins.gain_down.map_or("-inf".into(), |gain| format!("{:+.1}", decibels(gain)));
    let up = margins.gain_up.map_or("+inf".into(), |gain| format!("{:+.1}", decibels(gain)));
    let phase = margins.phase_rad.zip(margins.crossover_rad_s);
    let phase =
        phase.map_or("any".into(), |(phase, at)| format!("{:.0}° at {at:.1}", phase.to_degrees()));
    format!("{:18}{phase}", format!("{down} to {up} dB"))
}

fn decibels(factor: f64) -> f64 {
    20.0 * libm::log10(factor)
}

/// Bryson's weights beside those of the scene.
fn bryson(design: &Design, r: &[f64; 4]) -> String {
    let mut text =
        "\nbryson    1 / (largest deviation from hover within the motors' range)^2\n".to_owned();
    let rows = INPUTS.iter().enumerate().map(|(i, input)| {
        let (deviation, weight) = (design.largest_inputs[i], design.bryson_r[i]);
        let (unit, ratio) = (if i == 3 { "N" } else { "N m" }, r[i] / weight);
        format!("{input}\t{deviation:.3e}\t {unit:3}{weight:>12.5e}\t{ratio:>12.3} times")
    });
    text += &table("<10|deviation>14|weight>16|    controller.lqr.r<0", rows);
    let [x, y, z, f] = design.bryson_r;
    text + &format!("r = [{x:.6e}, {y:.6e}, {z:.6e}, {f:.6e}]\n")
}

/// The design with names and decibels, and the gains of a cascade or geometric controller.
fn to_json(design: &Design, gains: &LoopGains) -> Value {
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
    let named = gains
        .iter()
        .map(|(name, [p, i, d], unit)| (*name, json!({ "p": p, "i": i, "d": d, "unit": unit })));
    json["gains"] = named.collect();
    json
}
