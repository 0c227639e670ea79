//! `noctograph check`: should this fly? A table of what was looked at, and exit code 1 if not.

use std::path::Path;

use clap::Args;
use nalgebra::Vector3;

use super::inputs::{LetterFlags, PlanFlags, SceneFlags, strokes};
use super::{Outcome, print};
use crate::error::{Error, Result};
use crate::flight::Flight;
use crate::letters::Strokes;
use crate::light::{Drive, LightTrace, light};
use crate::plan::Plan;
use crate::plan::check::{
    Finding, Flown, Profile, Severity, check_flown, check_letters, check_plans,
};
use crate::scene::Scene;
use crate::sim::{coverage, fly};

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    /// Word to plan and check, or plans as `noctograph plan` writes them (names ending in .csv)
    #[arg(required = true)]
    inputs: Vec<String>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    letters: LetterFlags,
    #[command(flatten)]
    plan: PlanFlags,
    /// Limits: indoor (a Crazyflie, 1 m/s), careful (0.5 m/s) or outdoor
    #[arg(long, value_name = "NAME", default_value = "indoor")]
    profile: String,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &CheckArgs) -> Result<Outcome> {
    let mut scene = args.scene.load()?;
    args.letters.apply(&mut scene)?;
    args.plan.apply(&mut scene);
    scene.check()?;
    let profile = profile(&args.profile)?;
    let (strokes, plans) = plans(args, &mut scene)?;
    let mut findings = Vec::new();
    if let Some(strokes) = &strokes {
        findings.extend(check_letters(strokes, &scene.plan.style));
    }
    findings.extend(check_plans(&plans, &profile));
    for plan in &plans {
        findings.extend(flown(plan, &scene, &profile)?);
        findings.extend(seen(plan, &scene)?);
    }
    let stops = findings.iter().any(|finding| finding.severity == Severity::Stop);
    if args.json {
        let json = serde_json::json!({
            "fly": !stops, "profile": profile, "drones": plans.len(), "findings": findings,
        });
        print(&format!("{json}\n"))?;
    } else {
        print(&table(&findings, stops, &profile))?;
    }
    Ok(if stops { Outcome::ShouldNotFly } else { Outcome::Done })
}

fn profile(name: &str) -> Result<Profile> {
    let all = Profile::all();
    let names = all.iter().map(|profile| profile.name).collect::<Vec<_>>().join(", ");
    all.into_iter().find(|profile| profile.name == name).ok_or_else(|| {
        Error::input("--profile", name, format!("one of {names}"), "choose a name of the list")
    })
}

/// The plans of files, or those of the word.
fn plans(args: &CheckArgs, scene: &mut Scene) -> Result<(Option<Strokes>, Vec<Plan>)> {
    let is_file = |input: &&String| Path::new(input).extension().is_some_and(|e| e == "csv");
    let files: Vec<&String> = args.inputs.iter().filter(is_file).collect();
    match args.inputs.as_slice() {
        all if files.len() == all.len() => {
            let plans = files.into_iter().map(|file| Plan::read_csv(file.as_ref()));
            Ok((None, plans.collect::<Result<_>>()?))
        }
        [word] => {
            let strokes = strokes(scene, Some(word))?;
            let plans = scene.plans(&strokes)?.into_iter().map(|planned| planned.plan).collect();
            Ok((Some(strokes), plans))
        }
        inputs => {
            let hint = "name one word, or plans that are flown together";
            Err(Error::input("inputs", inputs.join(" "), "one word, or files *.csv", hint))
        }
    }
}

/// What becomes of a plan in the scene's simulator.
fn flown(plan: &Plan, scene: &Scene, profile: &Profile) -> Result<Vec<Finding>> {
    let flight = match fly(plan, &scene.sim(), scene.seed, &mut |_| {}) {
        Ok(flight) => flight,
        Err(Error::Infeasible { what, hint }) => {
            let (check, wanted) = ("flight", "a flight to its end".to_owned());
            let severity = Severity::Stop;
            return Ok(vec![Finding { check, severity, found: what, wanted, change: hint }]);
        }
        Err(error) => return Err(error),
    };
    let ends = scene.stroke_ends(plan, &flight).unwrap_or_default();
    let trace = light(&flight, &scene.light, scene.seed, 0)?;
    let painted = painted(&flight, &trace, scene);
    let flown = Flown {
        flight: &flight,
        ends: &ends,
        painted: &painted,
        motor_max: scene.vehicle.motor_max,
        battery_modelled: scene.battery.capacity_ah > 0.0,
    };
    Ok(check_flown(&flown, profile))
}

/// The light of the first lamp that follows the plan, along the drone's way: time, length and
/// seconds of full light.
fn painted(flight: &Flight, trace: &LightTrace, scene: &Scene) -> Vec<(f64, f64, f64)> {
    let fixtures = scene.light.fixtures();
    let follows = |name: &str| {
        fixtures.iter().any(|fixture| {
            fixture.name == name
                && matches!(&fixture.drive, Drive::Command(c) if flight.lights.contains_key(c))
        })
    };
    let Some(lamp) = trace.lamps.iter().find(|lamp| follows(&lamp.emitter.name)) else {
        return Vec::new();
    };
    // A piece as long as the lamp's blur tells hot spots from trembling.
    let mut pieces: Vec<(f64, f64, f64)> = Vec::new();
    let mut from: Option<(f64, Vector3<f64>)> = None;
    let mut light_s = 0.0;
    for pair in lamp.samples.windows(2) {
        let lasts_s = pair[1].time_s - pair[0].time_s;
        let lit = 0.5 * (pair[0].level + pair[1].level);
        if lit <= 0.0 {
            from = None;
            light_s = 0.0;
            continue;
        }
        let (start_s, start_m) = *from.get_or_insert((pair[0].time_s, pair[0].position_m));
        light_s += lit * lasts_s;
        if pair[1].time_s - start_s >= PIECE_S {
            pieces.push((start_s, (pair[1].position_m - start_m).xz().norm(), light_s));
            from = None;
            light_s = 0.0;
        }
    }
    pieces
}

/// Length in time of the pieces by which light along the way is told: a centimetre at 0.2 m/s.
const PIECE_S: f64 = 0.05;

/// Whether the scene's base stations see the drone all along.
fn seen(plan: &Plan, scene: &Scene) -> Result<Vec<Finding>> {
    let check = "coverage";
    let wanted = "two Lighthouse stations see every place".to_owned();
    if scene.sensors.stations.is_empty() {
        let found = "no base stations are told".to_owned();
        let change = "name them with --lighthouse FILE".to_owned();
        return Ok(vec![Finding { check, severity: Severity::Unknown, found, wanted, change }]);
    }
    let aloft = plan.setpoints.iter().filter(|setpoint| !setpoint.on_floor());
    let places = aloft.map(|setpoint| setpoint.position_m);
    let bounds = places
        .fold([f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY], |b, p| {
            [b[0].min(p.x), b[1].min(p.z), b[2].max(p.x), b[3].max(p.z)]
        });
    if bounds[0] >= bounds[2] || bounds[1] >= bounds[3] {
        return Ok(Vec::new());
    }
    let grid = coverage(&scene.sensors, bounds, 0.0, 0.1)?;
    let frac = grid.seen_frac();
    let severity = if frac >= 1.0 { Severity::Fine } else { Severity::Stop };
    let found = format!("{:.1} % of the way's box is seen", 100.0 * frac);
    let change = if frac >= 1.0 { "" } else { "move the word or the stations (see `coverage`)" };
    Ok(vec![Finding { check, severity, found, wanted, change: change.into() }])
}

fn table(findings: &[Finding], stops: bool, profile: &Profile) -> String {
    let mut text = String::new();
    for finding in findings {
        let mark = match finding.severity {
            Severity::Fine => "ok",
            Severity::Unknown => "?",
            Severity::Warning => "warn",
            Severity::Stop => "STOP",
        };
        text += &format!("{mark:5} {:16} {}\n", finding.check, finding.found);
        if finding.severity != Severity::Fine {
            text += &format!("{:22} wanted: {}\n", "", finding.wanted);
            text += &format!("{:22} change: {}\n", "", finding.change);
        }
    }
    let verdict = if stops { "should not fly" } else { "may fly" };
    text + &format!("\n{verdict} (profile {})\n", profile.name)
}
