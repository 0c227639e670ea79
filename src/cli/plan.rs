//! `noctograph plan`: a word becomes setpoints and light commands, or a drawing of them.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use super::inputs::{LetterFlags, PlanFlags, SceneFlags, read_flight, type_word};
use super::outputs::{Output, OutputFolder};
use super::{Outcome, print};
use crate::error::{Error, Result};
use crate::flight::mean_error_m;
use crate::plan::Plan;
use crate::report::plan_view;
use crate::shoot::{self, Planned};

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    /// Word to write; the scene's where it is left out
    #[arg(conflicts_with = "drawing")]
    word: Option<String>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    letters: LetterFlags,
    #[command(flatten)]
    plan: PlanFlags,
    /// Flight of the same drone whose mean error is taken off every setpoint
    #[arg(long, value_name = "FLIGHT")]
    after: Option<PathBuf>,
    /// Plan to write, or a drawing of it (a name that ends in .svg); a folder for several drones
    #[arg(short, long, value_name = "FILE", default_value = "plan.csv")]
    output: PathBuf,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &PlanArgs) -> Result<Outcome> {
    let mut scene = args.scene.load()?;
    args.letters.apply(&mut scene)?;
    args.plan.apply(&mut scene);
    if let Some(path) = &args.after {
        scene.plan.mean_error_m = mean_error(path)?;
    }
    scene.check()?;
    type_word(&mut scene, args.word.as_deref());
    let strokes = scene.strokes()?;
    let drawing = args.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("svg"));
    let several = scene.plan.drones > 1 && !drawing;
    let sink = if several {
        Sink::Folder(OutputFolder::create(&args.output)?)
    } else {
        Sink::File(Output::create(&args.output)?)
    };
    let planned = shoot::plan(&scene, &strokes)?;
    let title = if strokes.font.is_some() { &strokes.word } else { &scene.letters.drawing };
    let plans: Vec<Plan> = planned.iter().map(|planned| planned.plan.clone()).collect();
    let files = match sink {
        Sink::Folder(folder) => write_folder(folder, &plans, &strokes.word)?,
        Sink::File(file) if drawing => {
            let svg = plan_view(&plans, title);
            vec![file.keep(|out| out.write_all(svg.as_bytes()))?]
        }
        Sink::File(file) => vec![file.keep(|out| plans[0].write_csv(out))?],
    };
    if args.json {
        print(&format!("{}\n", json(title, &planned, &files)))?;
    } else {
        print(&table(title, &planned, &files))?;
    }
    Ok(Outcome::Done)
}

enum Sink {
    File(Output),
    Folder(OutputFolder),
}

/// The mean error of an earlier flight while it wrote.
fn mean_error(path: &Path) -> Result<[f64; 3]> {
    let mean_m = mean_error_m(&read_flight(path)?).ok_or_else(|| {
        let hint = "name a flight of `noctograph fly`, or `import` a log with --word";
        Error::input(path.display().to_string(), "no letters", "a flight that writes", hint)
    })?;
    Ok(mean_m.into())
}

/// One plan a drone, and the drawing of all.
fn write_folder(folder: OutputFolder, plans: &[Plan], word: &str) -> Result<Vec<PathBuf>> {
    let mut names: Vec<String> = (1..=plans.len()).map(|n| format!("plan-{n}.csv")).collect();
    for (plan, name) in plans.iter().zip(&names) {
        folder.write(name, |out| plan.write_csv(out))?;
    }
    let svg = plan_view(plans, word);
    folder.write("plan.svg", |out| out.write_all(svg.as_bytes()))?;
    names.push("plan.svg".to_owned());
    folder.keep(&names.iter().map(String::as_str).collect::<Vec<_>>())
}

/// Seconds of light, and the largest streak at a stroke's end.
fn light_s(plan: &Plan) -> f64 {
    let lit = plan.lit();
    let rows = plan.setpoints.windows(2).zip(&lit).filter(|(_, lit)| **lit > 0.0);
    rows.map(|(pair, _)| pair[1].time_s - pair[0].time_s).sum()
}

fn worst_streak_m(planned: &Planned) -> Option<f64> {
    planned.ends.iter().map(|end| end.streak_m.abs()).max_by(f64::total_cmp)
}

fn json(word: &str, planned: &[Planned], files: &[PathBuf]) -> serde_json::Value {
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
        "drones": drones.collect::<Vec<_>>(), "files": files,
    })
}

fn table(word: &str, planned: &[Planned], files: &[PathBuf]) -> String {
    let mut text = String::new();
    for (index, planned) in planned.iter().enumerate() {
        let plan = &planned.plan;
        let whose = if index > 0 || planned.plan.setpoints.is_empty() {
            format!("drone {}", index + 1)
        } else {
            word.to_owned()
        };
        text += &format!(
            "{whose}: {:.1} s, {:.1} s of them lit, {} setpoints",
            plan.duration_s(),
            light_s(plan),
            plan.setpoints.len()
        );
        if let Some(streak_m) = worst_streak_m(planned) {
            text += &format!(", streaks up to {:.1} mm at strokes' ends", 1e3 * streak_m);
        }
        text += "\n";
    }
    let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    text + &format!("written to {}\n", names.join(", "))
}
