//! `noctograph plan` writes the setpoints and light commands of a word, or draws them.

use std::path::PathBuf;

use super::flags::{DesignFlags, frame, set_word, typed_word, warn_of_fewer_drones};
use super::flight_flags::FlightFlags;
use super::outcome::Report;
use super::output::{Output, Outputs, is_svg};
use super::show;
use super::terminal::warn;
use crate::error::Result;
use crate::flight::Flight;
use crate::plan::Plan;
use crate::preflight::longer_than_battery;
use crate::report::plan_view;
use crate::scene::Scene;
use crate::shoot::{Planned, Shoot};
use crate::tracking::{Part, track};
use clap::Args;
use noctograph_core::files::file_name;
use serde_json::{Value, json};

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    /// Word to write [default: the scene's]
    #[arg(conflicts_with = "drawing")]
    word: Option<String>,
    /// Word to write, even if a file has this name
    #[arg(long = "word", value_name = "WORD", conflicts_with_all = ["word", "drawing"])]
    as_word: Option<String>,
    #[command(flatten)]
    design: DesignFlags,
    /// Flight or log of the same drone, whose mean error is subtracted from every setpoint
    #[arg(long, value_name = "FILE")]
    after: Option<PathBuf>,
    #[command(flatten)]
    flight: FlightFlags,
    /// Plan to write with its scene beside it, or a drawing of the plan (*.svg), or a folder for
    /// several drones [default: plan.csv, or plans]
    #[arg(short, long, value_name = "FILE|DIR")]
    output: Option<PathBuf>,
}

/// Runs the verb `plan`, which plans the flights of a word and writes them as tables, or as a
/// drawing if the output is an SVG file. Warns if the word is written by fewer drones than
/// requested, and if the flight is longer than the battery lasts.
pub(super) fn run(args: &PlanArgs) -> Result<Report> {
    let scene = scene(args)?;
    // The output is opened before the long computation, to refuse a wrong path early.
    let strokes = scene.strokes()?;
    let svg = args.output.as_deref().filter(|path| is_svg(path));
    let outputs = match svg {
        Some(path) => Outputs::One(Output::create(path)?, None),
        None => {
            let n = scene.plan.drones as usize;
            Outputs::create(args.output.as_deref(), "plan", n)?
        }
    };
    let shoot = Shoot::of_strokes(scene.clone(), strokes.clone(), &|_| Ok(()))?;
    warn_of_fewer_drones(&shoot);
    warn(longer_than_battery(&shoot));
    let plans: Vec<Plan> = shoot.plans.iter().map(|planned| planned.plan.clone()).collect();
    let drawing = file_name(&scene.letters.drawing);
    let title = if strokes.font.is_some() { &strokes.word } else { &drawing };
    // A drawing shows all plans, and is written once in place of the tables.
    let files = outputs.keep(&plans, Some(&shoot.scene), |plan, mut out| match svg {
        Some(_) => out.write_all(plan_view(&plans, title, &strokes.numbers).as_bytes()),
        None => plan.write_csv(&mut out),
    })?;
    let mut report = described(title, &shoot.plans);
    report.add(show::drawing(Some(&strokes)));
    warn(&strokes.warnings);
    Ok(report.with_files(&files))
}

/// Returns the scene with the word that was typed, and with the mean error of an earlier flight
/// (`--after`), which the plan subtracts.
fn scene(args: &PlanArgs) -> Result<Scene> {
    let mut scene = args.design.load(args.after.as_slice(), &[])?;
    if let Some(path) = &args.after {
        let flight = with_lit_letter(args.flight.read(path, Some(&scene))?);
        let earlier = track(&flight, Part::from_flight(&flight))?;
        scene.plan.mean_error_m = earlier.mean_error_m.into();
    }
    scene.check()?;
    if let Some(word) = typed_word(args.word.as_ref(), args.as_word.as_ref())? {
        set_word(&mut scene, word);
    }
    frame(&mut scene)?;
    Ok(scene)
}

/// Marks the lit samples of a log as a single letter, because a log does not record letters. Leaves
/// a flight that already has letters unchanged.
fn with_lit_letter(mut flight: Flight) -> Flight {
    if flight.samples.iter().all(|sample| sample.letter.is_none()) {
        flight.edit(|flight| {
            for (index, sample) in flight.samples.iter_mut().enumerate() {
                let is_lit = flight.lights.values().any(|levels| levels[index] > 0.0);
                sample.letter = is_lit.then_some(0);
            }
        });
    }
    flight
}

/// Returns the time in s for which the design of a plan is lit. A setpoint's light lasts until the
/// next setpoint.
fn light_s(plan: &Plan) -> f64 {
    let lit = plan.lit();
    let rows = plan.setpoints.windows(2).zip(&lit).filter(|(_, lit)| **lit > 0.0);
    rows.map(|(pair, _)| pair[1].time_s - pair[0].time_s).sum()
}

/// Returns the report on the plan of each drone and on all drones together. `word` is the word, or
/// the name of the drawing.
fn described(word: &str, planned: &[Planned]) -> Report {
    /// Returns the duration, the lit time and the light errors at the ends of strokes of one plan
    /// as JSON. A streak is light beyond the end of a stroke.
    fn drone(Planned { plan, ends }: &Planned) -> Value {
        let ends = ends.iter().map(|end| {
            json!({
                "time_s": end.time_s, "x_m": end.at_m.x, "z_m": end.at_m.z, "on": end.on,
                "streak_mm": 1e3 * end.streak_m,
            })
        });
        let ends: Vec<Value> = ends.collect();
        let streaks_mm = ends.iter().filter_map(|end| Some(end["streak_mm"].as_f64()?.abs()));
        json!({
            "duration_s": plan.duration_s(), "lit_s": light_s(plan),
            "setpoints": plan.setpoints.len(),
            "worst_streak_mm": streaks_mm.max_by(f64::total_cmp), "stroke_ends": ends,
        })
    }
    // Because the drones fly simultaneously, the longest plan determines the duration of the word.
    let durations_s = planned.iter().map(|planned| planned.plan.duration_s());
    let product = json!({
        "word": word, "duration_s": durations_s.fold(0.0, f64::max),
        "setpoints": planned.iter().map(|it| it.plan.setpoints.len()).sum::<usize>(),
        "drones": planned.iter().map(drone).collect::<Vec<_>>(),
    });
    let names = match planned.len() {
        1 => vec![word.to_owned()],
        n => (1..=n).map(|n| format!("drone {n}")).collect(),
    };
    Report::with_words(product, &json!({ "names": names }), LAYOUT)
}

const LAYOUT: &str = "\
*drones {names.#}\t{duration_s:.1} s, {lit_s:.1} s of them lit, {setpoints} setpoints[, light up to {worst_streak_mm:.1} mm off the strokes' ends]
";
