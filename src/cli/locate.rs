//! `noctograph locate`: positions from range logs, beside a reference.

use std::io::Write;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use nalgebra::Vector3;

use super::clocks::{Clocks, Dated, align_logs, align_references, statement};
use super::locate_region::region;
use super::{
    Error, FlightFlags, Outcome, OutputFolder, Report, Result, SceneFlags, json, numbers, table,
    warn, warn_of,
};
use crate::crazyflie::read_anchors;
use crate::flight::table::on_grid;
use crate::flight::{Flight, FlightSample, Quantity, Warning};
use crate::locate::{
    Ambiguity, Bias, Link, LinkError, LinkResidual, LocateOptions, Located, PositionError,
    RangeSample, Reference, Room, Track, check_count, link_errors, locate, locate_enlarged,
    locate_shared, nis_interval, position_error,
};
use crate::logs;
use crate::report::{NamedFlight, front_view, top_view};
use crate::scene::Scene;
use noctograph_core::files::Limit;
use noctograph_core::input_error;
use noctograph_core::statistics::median;

/// Logs, or references, that are read together.
const LOGS: Limit = Limit {
    bytes: 128 << 20,
    what: "logs",
    hint: "cut the logs to one flight, log fewer variables, or locate fewer drones at a time",
};
/// Columns of a range log: to the anchor of an index, and to the drone of a number.
const TO_ANCHOR: &str = "ranging.distance";
const TO_DRONE: &str = "ranging.drone";
/// Keys of the scene that are used, which have no effect in a flight without ranges.
const USED: [&str; 2] = ["observer.ekf.two_way_sigma_m", "sensors.uwb.anchors_m"];
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
    /// Seconds to add to the clock of a reference, one for each [default: 0 where its stamps and
    /// those of the logs have time in common, otherwise those at which the positions fit best]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    offset: Vec<f64>,
    /// Clocks of the logs
    #[arg(long, value_enum, value_name = "NAME", default_value_t = Clocks::Common)]
    clocks: Clocks,
    /// Anchors (YAML of cfclient) that replace the scene's
    #[arg(long, value_name = "FILE")]
    anchors: Option<PathBuf>,
    /// What turns ranges into positions
    #[arg(long, value_enum, value_name = "NAME", default_value_t = Observer::Smooth)]
    observer: Observer,
    /// Density of the drones' acceleration, (m/s²)/√Hz: less is smoother, and lags in curves
    #[arg(long, value_name = "A", default_value_t = 1.0)]
    acceleration: f64,
    /// Box that holds all drones, in meters: of two mirror images that fit the ranges, the one
    /// inside
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = room, allow_hyphen_values = true)]
    within: Option<Room>,
    /// Map the local region of the shared-anchor observer for the scene's word, without a log
    #[arg(long, conflicts_with_all = ["reference", "offset", "clocks", "anchors", "observer",
          "acceleration", "within", "output"])]
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
    let mut scene = args.scene.load_using(&[], &USED)?;
    if let Some(path) = &args.anchors {
        scene.sensors.uwb.anchors_m = read_anchors(path)?;
        scene.sensors.uwb.heard.clear();
        scene.check()?;
    }
    if args.region {
        return region(scene);
    }
    one_for_each("reference", args.reference.len(), "log", args.ranges.len())?;
    one_for_each("offset", args.offset.len(), "reference", args.reference.len())?;
    crate::error::within("acceleration", args.acceleration, 1e-3, 1e3)?;
    let folder = OutputFolder::create(&args.output)?;
    let anchors_m = scene.sensors.uwb.anchors();
    let options = LocateOptions {
        range_sigma_m: scene.observer.ekf.two_way_sigma_m,
        acceleration_m_s2_sqrt_hz: args.acceleration,
        smooth: args.observer == Observer::Smooth,
        room: args.within,
        ..LocateOptions::default()
    };
    LOGS.check_all(&args.ranges)?;
    let (mut logs, mut samples) = (Vec::new(), Vec::new());
    for path in &args.ranges {
        let log = read(args, &scene, path)?;
        let measured = ranges(&log.flight, logs.len());
        samples.push(measured.map_err(|error| error.at(path.display(), None))?);
        logs.push(log);
        // Before the next one is read.
        check_count(samples.iter().map(Vec::len).sum())?;
    }
    let mut alignments = align_logs(&mut logs, &mut samples, args.clocks, &anchors_m, &options)?;
    let samples: Vec<RangeSample> = samples.into_iter().flatten().collect();
    let located = by_observer(args, &anchors_m, &logs, &samples, &options)?;
    warn(&located.warnings);
    let places_m = || located.position_m.iter().flatten();
    let is_outside = |room: &Room| places_m().filter(|place_m| !room.holds(place_m)).count();
    if args.within.is_some_and(|room| 2 * is_outside(&room) > places_m().count()) {
        warn(["the drones are located outside the box of --within: the ranges fit no place in it"]);
    }

    LOGS.check_all(&args.reference)?;
    let references = args.reference.iter().map(|path| read(args, &scene, path));
    let mut references = references.collect::<Result<Vec<_>>>()?;
    alignments.extend(align_references(&mut references, &logs, &located, &args.offset)?);
    let references: Vec<Reference<'_>> = references
        .iter()
        .map(|dated| Reference { flight: &dated.flight, offset_s: dated.offset_s })
        .collect();
    let errors = references.iter().enumerate();
    let errors = errors.map(|(drone, reference)| position_error(&located, drone, *reference));
    let errors = errors.collect::<Result<Vec<_>>>()?;
    let files = write(folder, &located, &references)?;
    let links = link_errors(&samples, &anchors_m, &references);

    let mut report = described(&located, args.observer);
    alignments.iter().for_each(|one| report.line("clocks", &statement(one)));
    report.value("clocks", &alignments);
    tell_ambiguities(&mut report, &located.ambiguities);
    tell_tables(&mut report, &located.links, &errors, &links);
    let is_certain = located.ambiguities.is_empty();
    let outcome = if is_certain { Outcome::Done } else { Outcome::Ambiguous };
    Ok(report.with_files(&files).with_outcome(outcome))
}

/// Refuses a flag that is repeated for some of the files only.
fn one_for_each(flag: &str, n: usize, file: &str, n_files: usize) -> Result<()> {
    if n == 0 || n == n_files {
        return Ok(());
    }
    Err(input_error!(
        flag,
        "{n} for {n_files} {file}s",
        "one for each {file}",
        "repeat it in order"
    ))
}

fn read<'a>(args: &LocateArgs, scene: &Scene, path: &'a PathBuf) -> Result<Dated<'a>> {
    let mut dated = logs::import_on_clock(path, &args.flights.options(Some(scene)))?;
    // Of a log the ranges count here, and of a reference the positions: nothing else is missed.
    dated.flight.warnings.retain(|warning| !matches!(warning, Warning::Unlogged(_)));
    warn_of(path, &dated.flight.warnings);
    Ok(Dated::new(path, dated))
}

fn write(
    folder: OutputFolder,
    located: &Located,
    references: &[Reference<'_>],
) -> Result<Vec<PathBuf>> {
    let (mut names, mut traces) = (Vec::new(), Vec::new());
    for drone in 0..located.position_m.len() {
        let flight = flight(located, drone);
        let name = format!("flight-{}.csv", drone + 1);
        folder.write(&name, |out| flight.write_csv(out))?;
        names.push(name);
        traces
            .push(NamedFlight { name: format!("located {}", drone + 1), samples: flight.samples });
        if let Some(reference) = references.get(drone) {
            let mut samples = reference.flight.samples.clone();
            samples.iter_mut().for_each(|s| s.time_s += reference.offset_s);
            traces.push(NamedFlight { name: format!("reference {}", drone + 1), samples });
        }
    }
    for (name, svg) in VIEWS.iter().zip([top_view(&traces), front_view(&traces)]) {
        folder.write(name, |out| out.write_all(svg.as_bytes()))?;
        names.push((*name).to_owned());
    }
    folder.keep(&names)
}

fn by_observer(
    args: &LocateArgs,
    anchors_m: &[Vector3<f64>],
    logs: &[Dated<'_>],
    samples: &[RangeSample],
    options: &LocateOptions,
) -> Result<Located> {
    let tracks = || {
        let track =
            |log: &Dated<'_>| track(log).map_err(|error| error.at(log.path.display(), None));
        logs.iter().map(track).collect::<Result<Vec<_>>>()
    };
    match args.observer {
        Observer::Smooth | Observer::Filter => locate(anchors_m, logs.len(), samples, options),
        Observer::Enlarged => locate_enlarged(anchors_m, &tracks()?, samples, options),
        Observer::Shared => {
            let Ok(tracks) = <[Track; 2]>::try_from(tracks()?) else {
                let hint = "give a log of each drone";
                return Err(Error::input("ranges", logs.len(), "the logs of two drones", hint));
            };
            let start = |k: usize| {
                let flight = &logs[k].flight;
                let first = flight.samples.first();
                let first = first.filter(|_| !flight.unlogged.contains(&Quantity::Position));
                first.map(|sample| sample.position_m)
            };
            let Some(starts_m) = start(0).zip(start(1)) else {
                let wanted = "positions, where the observer starts";
                let hint = "log stateEstimate.x, y and z too, or take --observer smooth";
                return Err(Error::input("columns", "no position", wanted, hint));
            };
            locate_shared(anchors_m, &tracks, starts_m.into(), samples)
        }
    }
}

/// The motion of a log.
fn track(log: &Dated<'_>) -> Result<Track> {
    if log.flight.unlogged.contains(&Quantity::Velocity) {
        let hint = "log stateEstimate.vx, vy and vz too, or take --observer smooth";
        return Err(Error::input("columns", "no velocity", "the motion of the drone", hint));
    }
    let world = |s: &FlightSample| s.attitude.world_from_body() * s.velocity_body_m_s;
    Ok(Track::new(log.flight.samples.iter().map(|s| (s.time_s + log.offset_s, world(s)))))
}

/// The ranges of a log: a value that changes is a measurement, one that stays is held.
fn ranges(log: &Flight, drone: usize) -> Result<Vec<RangeSample>> {
    let mut samples = Vec::new();
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
            samples.push(RangeSample { time_s: sample.time_s, link, distance_m });
        }
        check_count(samples.len())?;
    }
    if known {
        return Ok(samples);
    }
    let wanted = format!("{TO_ANCHOR}0 and so on, {TO_DRONE}1 and so on");
    Err(Error::input("columns", "no range", wanted, "log the ranges of the ranging group"))
}

/// The positions of a drone as a flight, from its first range to its last.
fn flight(located: &Located, drone: usize) -> Flight {
    let sample = |index: usize| {
        let position_m = located.position_m[drone][index].map(on_grid);
        let time_s = on_grid(located.time_s[index]);
        FlightSample { time_s, position_m, estimate_m: position_m, ..FlightSample::default() }
    };
    use Quantity::{Attitude, Design, Motors, Rate, Velocity};
    Flight {
        samples: located.heard(drone).map(sample).collect(),
        unlogged: [Attitude, Velocity, Rate, Design, Motors].into(),
        ..Flight::default()
    }
}

/// The figures of a whole log.
fn described(located: &Located, observer: Observer) -> Report {
    let ends = located.time_s.first().zip(located.time_s.last());
    let span_s = ends.map_or(0.0, |(first, last)| last - first);
    let interval @ [least, most] = nis_interval(located.ranges);
    let json = json!({
        "span_s": span_s, "nis_interval": interval, "refused_frac": located.refused_frac,
        "biases": located.biases, "left_out": located.left_out, "warnings": located.warnings,
    });
    let mut report = Report::of(json);
    let way = match observer {
        Observer::Smooth => "smoothed over the whole flight",
        Observer::Filter => "filtered as in flight",
        Observer::Enlarged => "by the enlarged filter and its hand-over",
        Observer::Shared => "by the shared-anchor observer",
    };
    let (drones, n) = (located.position_m.len(), located.ranges);
    report.line("located", &format!("{drones} of {drones} drones, {way}"));
    report.figure("ranges", n, "ranges", &format!("{n} in {span_s:.1} s"));
    if located.nis.is_some() {
        let percent = 100.0 * located.refused_frac;
        report.line("refused", &format!("{percent:.1} % of the ranges"));
    }
    report.optional("nis", located.nis, "NIS", |nis| {
        format!("{nis:.2} (from {least:.2} to {most:.2} where noise and motion are as assumed)")
    });
    let [median_m, worst_m] = sigmas_m(located).map_or([None; 2], |sigmas_m| sigmas_m.map(Some));
    report.value("sigma_max_m", worst_m);
    report.optional("sigma_median_m", median_m, "sigma", |median_m| {
        let [median_cm, worst_cm] = [*median_m, worst_m.unwrap_or_default()].map(|m| 100.0 * m);
        format!("{median_cm:.1} cm over three axes (median), {worst_cm:.1} cm at worst")
    });
    for Bias { of, bias_m, sigma_m, in_doubt, .. } in &located.biases {
        let [bias_cm, sigma_cm] = [bias_m, sigma_m].map(|m| 100.0 * m);
        let doubt = match in_doubt {
            true => "; the ranges do not tell which of these links is wrong, so each has a bias",
            false => "",
        };
        report.line(
            "bias",
            &format!("{of}: {bias_cm:+.1} cm ± {sigma_cm:.1}, estimated and taken off{doubt}"),
        );
    }
    if !located.left_out.is_empty() {
        report.line("left out", &located.left_out.join(", "));
    }
    report
}

/// Median and greatest standard deviation of the positions over three axes.
fn sigmas_m(located: &Located) -> Option<[f64; 2]> {
    let drones = located.covariance_m2.iter().enumerate();
    let heard = drones.flat_map(|(drone, covariances)| &covariances[located.heard(drone)]);
    let sigmas_m: Vec<f64> = heard.map(|covariance| covariance.trace().max(0.0).sqrt()).collect();
    let worst_m = sigmas_m.iter().copied().fold(0.0, f64::max);
    Some([median(sigmas_m)?, worst_m])
}

/// When the place of a drone is not certain.
fn tell_ambiguities(report: &mut Report, ambiguities: &[Ambiguity]) {
    for (k, Ambiguity { drone, from_s, to_s, apart_m }) in ambiguities.iter().enumerate() {
        let text = format!(
            "drone {drone} from {from_s:.1} to {to_s:.1} s: a place up to {apart_m:.1} m away has \
             the same ranges"
        );
        report.line(if k == 0 { "ambiguous" } else { "" }, &text);
    }
    report.value("ambiguities", ambiguities);
    if !ambiguities.is_empty() {
        let advice = "name the room with `--within`, if only one of the two places is inside it; \
                      otherwise add an anchor outside the plane of the others";
        report.line("advice", advice);
    }
}

/// What the located positions leave of the ranges, by link; against the references, the errors of
/// the positions, and of the ranges by link.
fn tell_tables(
    report: &mut Report,
    residuals: &[LinkResidual],
    errors: &[PositionError],
    links: &[LinkError],
) {
    let rows = residuals.iter().map(
        |LinkResidual { link, refused, ranges, median_m, scatter_m, .. }| {
            let [median_cm, scatter_cm] = [median_m, scatter_m].map(|m| 100.0 * m);
            format!("{link}\t{median_cm:+.1}\t{scatter_cm:.1}\t{refused}\t{ranges}")
        },
    );
    report.table(&table("residuals, cm<32|median>8|scatter>9|refused>9|ranges>8", rows));
    let rows = errors.iter().enumerate().map(|(drone, error)| {
        let [x, y, z] = error.rmse_m.map(|m| 100.0 * m);
        let nees = error.nees.map_or("-".to_owned(), |nees| format!("{nees:.2}"));
        let (whole, samples) = (100.0 * error.rmse_3d_m, error.samples);
        format!("drone {}\t{x:.1}\t{y:.1}\t{z:.1}\t{whole:.1}\t{nees}\t{samples}", drone + 1)
    });
    report.table(&table("RMSE, cm<10|x>5|y>8|z>8|3-D>8|NEES>8|samples>9", rows));
    let rows = links.iter().map(|LinkError { link, median_m, scatter_m, ranges, .. }| {
        let [median_cm, scatter_cm] = [median_m, scatter_m].map(|m| 100.0 * m);
        format!("{link}\t{median_cm:+.1}\t{scatter_cm:.1}\t{ranges}")
    });
    report.table(&table("ranges minus true distances, cm<32|median>8|scatter>9|ranges>8", rows));
    report.text.push('\n');
    report.value("residuals", residuals);
    report.value("reference", errors);
    report.value("links", links);
}

/// The least and the greatest coordinates of a box.
fn room(text: &str) -> std::result::Result<Room, String> {
    let room = numbers(text, &[',']).map(|[left, front, bottom, right, back, top]| Room {
        low_m: Vector3::new(left, front, bottom),
        high_m: Vector3::new(right, back, top),
    });
    let wanted = "wanted the least x, y, z and the greatest in meters, such as -2,-2,0,2,2,2.4";
    room.filter(|room| (room.high_m - room.low_m).min() > 0.0).ok_or_else(|| wanted.to_owned())
}
