//! `noctograph plan`: a word becomes setpoints and light commands, or a drawing of them.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use super::flags::{DesignFlags, FlightFlags, set_word, warn_of_fewer_drones};
use super::outcome::{Report, line};
use super::output::{Output, Outputs, is_svg};
use super::{show, warn};
use crate::error::Result;
use crate::flight::tracking::{Part, track};
use crate::plan::Plan;
use crate::report::plan_view;
use crate::scene::Scene;
use crate::shoot::{Planned, Shoot};

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    /// Word to write [default: the scene's]
    #[arg(conflicts_with = "drawing")]
    word: Option<String>,
    #[command(flatten)]
    design: DesignFlags,
    /// Flight or log of the same drone whose mean error is subtracted from every setpoint
    #[arg(long, value_name = "FILE")]
    after: Option<PathBuf>,
    #[command(flatten)]
    flight: FlightFlags,
    /// Plan to write, a drawing of it (*.svg), or a folder for several drones [default: plan.csv,
    /// or plans]
    #[arg(short, long, value_name = "FILE|DIR")]
    output: Option<PathBuf>,
}

pub(super) fn run(args: &PlanArgs) -> Result<Report> {
    let mut scene = args.design.load(&[])?;
    if let Some(path) = &args.after {
        scene.plan.mean_error_m = mean_error(path, &args.flight, &scene)?;
    }
    scene.check()?;
    if let Some(word) = &args.word {
        set_word(&mut scene, word)?;
    }
    let strokes = scene.strokes()?;
    let output = match &args.output {
        Some(path) if is_svg(path) => Sink::Drawing(Output::create(path)?),
        path => {
            let n = scene.plan.drones as usize;
            Sink::Plans(Outputs::create(path.as_deref(), "plan", n)?)
        }
    };
    // With the colors of a drawing.
    let shoot = Shoot::new(scene.clone())?;
    warn_of_fewer_drones(&shoot);
    let planned = shoot.plans;
    let plans: Vec<Plan> = planned.iter().map(|planned| planned.plan.clone()).collect();
    let title = if strokes.font.is_some() { &strokes.word } else { &scene.letters.drawing };
    let files = match output {
        Sink::Plans(outputs) => outputs.keep(&plans, |plan, mut out| plan.write_csv(&mut out))?,
        Sink::Drawing(file) => {
            vec![
                file.keep(|out| {
                    out.write_all(plan_view(&plans, title, &strokes.numbers).as_bytes())
                })?,
            ]
        }
    };
    let (mut text, mut json) = (table(title, &planned), json(title, &planned));
    show::add_drawing(&strokes, &mut text, &mut json);
    warn(&strokes.warnings);
    Ok(Report::new(text, json).with_files(&files))
}

enum Sink {
    Plans(Outputs),
    Drawing(Output),
}

/// The mean error of an earlier flight while it wrote.
fn mean_error(path: &Path, flags: &FlightFlags, scene: &Scene) -> Result<[f64; 3]> {
    Ok(track(&flags.read(path, Some(scene))?, Part::Letters)?.mean_error_m.into())
}

/// Seconds of light.
fn light_s(plan: &Plan) -> f64 {
    let lit = plan.lit();
    let rows = plan.setpoints.windows(2).zip(&lit).filter(|(_, lit)| **lit > 0.0);
    rows.map(|(pair, _)| pair[1].time_s - pair[0].time_s).sum()
}

/// Largest streak at the end of a stroke.
fn worst_streak_m(planned: &Planned) -> Option<f64> {
    planned.ends.iter().map(|end| end.streak_m.abs()).max_by(f64::total_cmp)
}

fn json(word: &str, planned: &[Planned]) -> serde_json::Value {
    let drones = planned.iter().map(|planned| {
        let plan = &planned.plan;
        let ends = planned.ends.iter().map(|end| {
            serde_json::json!({
                "time_s": end.time_s, "x_m": end.at_m.x, "z_m": end.at_m.z, "on": end.on,
                "streak_mm": 1e3 * end.streak_m,
            })
        });
        serde_json::json!({
            "duration_s": plan.duration_s(), "lit_s": light_s(plan),
            "setpoints": plan.setpoints.len(), "stroke_ends": ends.collect::<Vec<_>>(),
            "worst_streak_mm": worst_streak_m(planned).map(|m| 1e3 * m),
        })
    });
    let longest_s = planned.iter().map(|p| p.plan.duration_s()).fold(0.0, f64::max);
    let n: usize = planned.iter().map(|planned| planned.plan.setpoints.len()).sum();
    serde_json::json!({
        "word": word, "duration_s": longest_s, "setpoints": n,
        "drones": drones.collect::<Vec<_>>(),
    })
}

fn table(word: &str, planned: &[Planned]) -> String {
    let mut text = String::new();
    for (index, drone) in planned.iter().enumerate() {
        let plan = &drone.plan;
        let name = match planned.len() {
            1 => word.to_owned(),
            _ => format!("drone {}", index + 1),
        };
        let (duration_s, lit_s, n) = (plan.duration_s(), light_s(plan), plan.setpoints.len());
        let mut figures = format!("{duration_s:.1} s, {lit_s:.1} s of them lit, {n} setpoints");
        if let Some(streak_m) = worst_streak_m(drone) {
            figures += &format!(", light up to {:.1} mm off the strokes' ends", 1e3 * streak_m);
        }
        text += &line(&name, &figures);
    }
    text
}
