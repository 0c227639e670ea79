//! `noctograph locate`: positions from range logs, beside a reference; or what the observer of two
//! drones with a shared anchor sees of a word.

use std::io::Write;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use nalgebra::Vector3;
use serde_json::{Value, json};

use super::flags::{FlightFlags, SceneFlags};
use super::output::OutputFolder;
use super::report::{Report, line};
use super::warn;
use crate::error::{Error, Result};
use crate::flight::table::on_grid;
use crate::flight::{Flight, FlightSample, Quantity};
use crate::report::{Trace, front_view, top_view};
use crate::scene::Scene;
use crate::shoot::Shoot;
use crate::sim::UwbOptions;
use crate::sim::localization::{
    Link, LinkError, LocateOptions, Located, Outputs, PositionError, RangeSample, Reference,
    SharedAnchorObserver, Track, link_errors, locate, locate_enlarged, locate_shared,
    observability, position_error, read_anchors, share_left, shared_anchor,
};

/// Columns of a range log: to the anchor of an index, and to the drone of a number.
const TO_ANCHOR: &str = "ranging.distance";
const TO_DRONE: &str = "ranging.drone";
/// Start errors, gains and times of the map.
const ERRORS_M: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];
const GAINS: [f64; 3] = [0.003, 0.03, 0.3];
const SPANS_S: [f64; 4] = [0.0, 1.0, 3.0, 20.0];
/// Time of the map, and its starts for each error.
const MAP_S: f64 = 64.0;
const STARTS: u32 = 40;
const VIEWS: [&str; 2] = ["flight-xy.svg", "flight-xz.svg"];

/// What turns ranges into positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Observer {
    /// Filter forward and smoother backward over the whole flight
    Smooth,
    /// Extended Kalman filter as in flight, without later ranges
    Filter,
    /// Enlarged linear filter, from any start, handed over to an extended Kalman filter; the logs
    /// must hold velocities
    Enlarged,
    /// Observer of two drones that share an anchor; the logs must hold positions and velocities
    Shared,
}

#[derive(Debug, Args)]
pub(super) struct LocateArgs {
    /// Range logs, one for each drone: columns ranging.distance0 ... to the anchors and
    /// ranging.drone1 ... to the other drones, in meters; a value that stays the same is held, not
    /// measured again
    #[arg(required_unless_present = "region", conflicts_with = "region", value_name = "RANGES")]
    ranges: Vec<PathBuf>,
    /// Flight or log with the true positions, one for each drone
    #[arg(long, value_name = "FILE")]
    reference: Vec<PathBuf>,
    /// Seconds to add to the references' clock
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_negative_numbers = true)]
    offset: f64,
    /// Anchors (YAML of cfclient) that replace the scene's
    #[arg(long, value_name = "FILE")]
    anchors: Option<PathBuf>,
    /// What turns ranges into positions
    #[arg(long, value_enum, value_name = "NAME", default_value_t = Observer::Smooth)]
    observer: Observer,
    /// Density of the drones' acceleration, (m/s²)/√Hz: less is smoother, and lags in curves
    #[arg(long, value_name = "A", default_value_t = 1.0)]
    acceleration: f64,
    /// Map the local region of the shared-anchor observer for the scene's word, without a log
    #[arg(long)]
    region: bool,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    flights: FlightFlags,
    /// Folder for flight-1.csv and so on, and two plots
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-located")]
    output: PathBuf,
}

pub(super) fn run(args: &LocateArgs) -> Result<Report> {
    let mut scene = args.scene.load(&[])?;
    if let Some(path) = &args.anchors {
        scene.sensors.uwb.anchors_m = read_anchors(path)?;
        scene.sensors.uwb.heard.clear();
        scene.check()?;
    }
    if args.region {
        return region(scene);
    }
    if !args.reference.is_empty() && args.reference.len() != args.ranges.len() {
        let found = format!("{} for {} logs", args.reference.len(), args.ranges.len());
        return Err(Error::input("reference", found, "one for each log", "repeat it in order"));
    }
    crate::error::within("acceleration", args.acceleration, 1e-3, 1e3)?;
    let folder = OutputFolder::create(&args.output)?;
    let logs =
        args.ranges.iter().map(|path| args.flights.read(path)).collect::<Result<Vec<_>>>()?;
    let mut samples = Vec::new();
    for (drone, (log, path)) in logs.iter().zip(&args.ranges).enumerate() {
        samples.extend(ranges(log, drone).map_err(|error| error.in_file(path))?);
    }
    let located = by_observer(args, &scene, &logs, &samples)?;
    warn(&located.warnings);

    let read = |path: &PathBuf| args.flights.read(path);
    let true_flights = args.reference.iter().map(read).collect::<Result<Vec<_>>>()?;
    let reference = |flight| Reference { flight, offset_s: args.offset };
    let references: Vec<Reference<'_>> = true_flights.iter().map(reference).collect();
    let (mut names, mut traces, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    for drone in 0..args.ranges.len() {
        let flight = flight(&located, drone);
        let name = format!("flight-{}.csv", drone + 1);
        folder.write(&name, |out| flight.write_csv(out))?;
        names.push(name);
        traces.push(Trace { name: format!("located {}", drone + 1), samples: flight.samples });
        if let Some(reference) = references.get(drone) {
            rows.push(position_error(&located, drone, *reference)?);
            let mut samples = reference.flight.samples.clone();
            samples.iter_mut().for_each(|s| s.time_s += args.offset);
            traces.push(Trace { name: format!("reference {}", drone + 1), samples });
        }
    }
    for (name, svg) in VIEWS.iter().zip([top_view(&traces), front_view(&traces)]) {
        folder.write(name, |out| out.write_all(svg.as_bytes()))?;
        names.push((*name).to_owned());
    }
    let files = folder.keep(&names)?;
    let links = link_errors(&samples, &scene.sensors.uwb.anchors(), &references);
    let (mut text, mut json) = described(&located, samples.len(), &rows, args.observer);
    text += &link_table(&links);
    text.push('\n');
    json["links"] = json!(links);
    Ok(Report::new(text, json).with_files(&files))
}

fn by_observer(
    args: &LocateArgs,
    scene: &Scene,
    logs: &[Flight],
    samples: &[RangeSample],
) -> Result<Located> {
    let anchors_m = scene.sensors.uwb.anchors();
    let options = LocateOptions {
        range_sigma_m: scene.observer.ekf.two_way_sigma_m,
        acceleration_m_s2_sqrt_hz: args.acceleration,
        smooth: args.observer == Observer::Smooth,
        ..LocateOptions::default()
    };
    let tracks = || {
        let track = |(log, path): (&Flight, &PathBuf)| track(log).map_err(|e| e.in_file(path));
        logs.iter().zip(&args.ranges).map(track).collect::<Result<Vec<_>>>()
    };
    match args.observer {
        Observer::Smooth | Observer::Filter => locate(&anchors_m, logs.len(), samples, &options),
        Observer::Enlarged => locate_enlarged(&anchors_m, &tracks()?, samples, &options),
        Observer::Shared => {
            let Ok(tracks) = <[Track; 2]>::try_from(tracks()?) else {
                let hint = "give a log of each drone";
                return Err(Error::input("ranges", logs.len(), "the logs of two drones", hint));
            };
            let start = |k: usize| {
                let first = logs[k]
                    .samples
                    .first()
                    .filter(|_| !logs[k].unlogged.contains(&Quantity::Position));
                first.map(|sample| sample.position_m)
            };
            let Some(starts_m) = start(0).zip(start(1)) else {
                let wanted = "positions, where the observer starts";
                let hint = "log stateEstimate.x, y and z too, or take --observer smooth";
                return Err(Error::input("columns", "no position", wanted, hint));
            };
            locate_shared(&anchors_m, &tracks, starts_m.into(), samples)
        }
    }
}

/// The motion of a log.
fn track(log: &Flight) -> Result<Track> {
    if log.unlogged.contains(&Quantity::Velocity) {
        let hint = "log stateEstimate.vx, vy and vz too, or take --observer smooth";
        return Err(Error::input("columns", "no velocity", "the motion of the drone", hint));
    }
    let world = |s: &FlightSample| s.attitude.world_from_body() * s.velocity_body_m_s;
    Ok(Track::new(log.samples.iter().map(|s| (s.time_s, world(s)))))
}

/// The ranges of a log: a value that changes is a measurement, one that stays is held.
fn ranges(log: &Flight, drone: usize) -> Result<Vec<RangeSample>> {
    let mut found = Vec::new();
    let mut known = false;
    for (name, column) in &log.extra {
        let number = |head: &str| name.strip_prefix(head).and_then(|n| n.parse::<usize>().ok());
        let link = match (number(TO_ANCHOR), number(TO_DRONE)) {
            (Some(anchor), _) => Link::Anchor { drone, anchor },
            (_, Some(other)) if other > 0 => Link::Drones(drone, other - 1),
            _ => continue,
        };
        known = true;
        let mut before = 0.0;
        for (sample, &distance_m) in log.samples.iter().zip(column) {
            // The firmware logs 0 until the first measurement.
            if distance_m.is_nan() || distance_m == before {
                continue;
            }
            before = distance_m;
            found.push(RangeSample { time_s: sample.time_s, link, distance_m });
        }
    }
    if known {
        return Ok(found);
    }
    let wanted = format!("{TO_ANCHOR}0 and so on, {TO_DRONE}1 and so on");
    Err(Error::input("columns", "no range", wanted, "log the ranges of the ranging group"))
}

/// The positions of a drone as a flight.
fn flight(located: &Located, drone: usize) -> Flight {
    let sample = |(time_s, position_m): (&f64, &Vector3<f64>)| {
        let position_m = position_m.map(on_grid);
        let time_s = on_grid(*time_s);
        FlightSample { time_s, position_m, estimate_m: position_m, ..FlightSample::default() }
    };
    let places = &located.position_m[drone];
    let unlogged = [
        Quantity::Attitude,
        Quantity::Velocity,
        Quantity::Rate,
        Quantity::Design,
        Quantity::Motors,
    ];
    Flight {
        samples: located.time_s.iter().zip(places).map(sample).collect(),
        unlogged: unlogged.into(),
        ..Flight::default()
    }
}

fn described(
    located: &Located,
    n_ranges: usize,
    rows: &[PositionError],
    observer: Observer,
) -> (String, Value) {
    let ends = located.time_s.first().zip(located.time_s.last());
    let span_s = ends.map_or(0.0, |(first, last)| last - first);
    let way = match observer {
        Observer::Smooth => "smoothed over the whole flight",
        Observer::Filter => "filtered as in flight",
        Observer::Enlarged => "by the enlarged filter and its hand-over",
        Observer::Shared => "by the shared-anchor observer",
    };
    let drones = located.position_m.len();
    let mut text = line("located", &format!("{drones} of {drones} drones, {way}"));
    text += &line("ranges", &format!("{n_ranges} in {span_s:.1} s"));
    if let Some(nis) = located.nis {
        text += &line("refused", &format!("{:.1} % by the gate", 100.0 * located.refused_frac));
        text += &line("NIS", &format!("{nis:.2} (1: noise and motion are as assumed)"));
    }
    if !rows.is_empty() {
        text += "\nRMSE, cm      x       y       z     3-D    NEES  samples\n";
        for (drone, row) in rows.iter().enumerate() {
            let [x, y, z] = row.rmse_m.map(|m| 100.0 * m);
            text += &format!(
                "drone {:<4}{x:>5.1}{y:>8.1}{z:>8.1}{:>8.1}{:>8}{:>9}\n",
                drone + 1,
                100.0 * row.rmse_3d_m,
                row.nees.map_or("-".to_owned(), |nees| format!("{nees:.2}")),
                row.samples
            );
        }
    }
    let json = json!({
        "ranges": n_ranges, "span_s": span_s, "nis": located.nis,
        "refused_frac": located.refused_frac, "reference": rows,
    });
    (text, json)
}

/// The errors of the ranges by link.
fn link_table(links: &[LinkError]) -> String {
    let head = "\nranges minus distances, cm  median  scatter  ranges\n";
    let row = |error: &LinkError| {
        let [median_cm, scatter_cm] = [error.median_m, error.scatter_m].map(|m| 100.0 * m);
        format!("{:<26}{median_cm:>+8.1}{scatter_cm:>9.1}{:>8}\n", error.link, error.ranges)
    };
    let rows: String = links.iter().map(row).collect();
    if rows.is_empty() { rows } else { head.to_owned() + &rows }
}

/// The local region of the observer along the scene's word.
fn region(scene: Scene) -> Result<Report> {
    let uwb = scene.sensors.uwb.clone();
    let Some(anchors) = shared_anchor(&uwb.heard) else {
        let hint = "take the scene two-drones-three-anchors";
        let wanted = "two drones that hear two anchors each, one of them the same";
        let found = format!("{:?}", uwb.heard);
        return Err(Error::input("sensors.uwb.heard", found, wanted, hint));
    };
    let [one, two, shared_m] = anchors.map(|anchor| Vector3::from(uwb.anchors_m[anchor]));
    let plans = Shoot::new(scene)?.plans;
    let [first, second] = plans.as_slice() else {
        let hint = "set plan.drones = 2 and plan.style = \"even\"";
        return Err(Error::input("plan.drones", plans.len(), "two drones", hint));
    };
    let path = |time_s: f64| {
        [first, second]
            .map(|planned| planned.plan.design_m(time_s % planned.plan.duration_s().max(1e-3)))
    };
    let observer = |gain| SharedAnchorObserver { own_m: [one, two], shared_m, gains: [gain; 2] };
    let (map, left) = map(observer, path);
    let (table, seen) = observability_table(&uwb, observer(1.0), path);
    Ok(Report::new(map + &table, json!({ "region": left, "observability": seen })))
}

/// Shares of the start error that are left, by error and gain.
fn map(
    observer: impl Fn(f64) -> SharedAnchorObserver,
    path: impl Fn(f64) -> [Vector3<f64>; 2] + Copy,
) -> (String, Vec<Value>) {
    let mut text = format!(
        "Share of the start error that the shared-anchor observer leaves after {MAP_S} s of\n\
         writing, without noise: median of {STARTS} starts (best to worst; fled)\n\n\
         error, m"
    );
    for gain in GAINS {
        text += &format!("{:>23}", format!("gain {gain}"));
    }
    text.push('\n');
    let mut left = Vec::new();
    for error_m in ERRORS_M {
        text += &format!("{error_m:<8}");
        for gain in GAINS {
            let found = share_left(&observer(gain), path, MAP_S, error_m, STARTS);
            let [best, worst] = found.range;
            let fled = 100.0 * found.fled_frac;
            let cell = format!("{:.2} ({best:.2}-{worst:.2}; {fled:.0} %)", found.median);
            text += &format!("{cell:>23}");
            left.push(json!({ "gain": gain, "share_left": found }));
        }
        text.push('\n');
    }
    (text, left)
}

/// Rank and worst direction of the start, from all ranges and from the observer's three outputs.
fn observability_table(
    uwb: &UwbOptions,
    observer: SharedAnchorObserver,
    path: impl Fn(f64) -> [Vector3<f64>; 2] + Copy,
) -> (String, Vec<Value>) {
    let mut text = "\nObservability of the positions at the start, with known motion\n\n\
                    time, s      five ranges: rank, worst    observer's three: rank, worst\n"
        .to_owned();
    let mut seen = Vec::new();
    for span_s in SPANS_S {
        let both = [Outputs::Ranges, Outputs::Three].map(|outputs| {
            observability(&observer, outputs, path, span_s, uwb.rate_hz, uwb.noise_m.max(1e-4))
        });
        let worst = |sigma_m: f64| match sigma_m.is_finite() {
            true => format!("{:.1} cm", 100.0 * sigma_m),
            false => "open".to_owned(),
        };
        text += &format!(
            "{span_s:<13}{:>14}{:>14}{:>18}{:>14}\n",
            both[0].rank,
            worst(both[0].sigmas_m[5]),
            both[1].rank,
            worst(both[1].sigmas_m[5])
        );
        seen.push(json!({ "time_s": span_s, "ranges": both[0], "three_outputs": both[1] }));
    }
    text.push('\n');
    (text, seen)
}
