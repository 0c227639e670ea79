//! `noctograph locate` computes positions from range logs, and compares them with a reference.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use nalgebra::Vector3;

use super::flags::{SceneFlags, warn_of};
use super::flight_flags::FlightFlags;
use super::locate_region::region;
use super::names::numbers;
use super::outcome::Report;
use super::output::OutputFolder;
use super::terminal::warn;
use crate::error::{Error, Result};
use crate::flight::table::on_grid;
use crate::flight::{Flight, FlightData, FlightSample, Quantity, warning::UNLOGGED};
use crate::locate::{
    Link, LinkError, LocateOptions, Located, PositionError, RangeSample, Reference, Room, Track,
    check_count, link_errors, locate, locate_augmented, locate_shared, nis_interval,
    position_error,
};
use crate::logs::{self, OnClock};
use crate::report::{NamedFlight, front_view, top_view};
use crate::scene::Scene;
use crate::sensors::read_anchors;
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::files::Limit;
use noctograph_core::input_error;
use noctograph_core::statistics::median;
use serde_json::json;

/// Size limit for all logs, and separately for all references, together.
const LOGS: Limit = Limit {
    bytes: 128 << 20,
    what: "logs",
    hint: "cut the logs to one flight, log fewer variables, or locate fewer drones at a time",
};
/// Prefix of a range log's columns with ranges to anchors, which are numbered from 0, and then to
/// drones, which are numbered from 1.
const TO_ANCHOR: &str = "ranging.distance";
const TO_DRONE: &str = "ranging.drone";
/// Scene keys that this verb uses even if they have no effect in a flight without ranging.
const USED: [&str; 2] = ["observer.ekf.two_way_sigma_m", "sensors.uwb.anchors_m"];
/// Smallest and largest noise density of the acceleration, in m/s²/√Hz. Drones that write have
/// about 1.
const ACCELERATIONS: [f64; 2] = [1e-3, 1e3];
const VIEWS: [&str; 2] = ["flight-xy.svg", "flight-xz.svg"];

/// Method that computes positions from ranges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Observer {
    /// Filter forward and smoother backward over the whole flight
    Smooth,
    /// Extended Kalman filter that, as in flight, uses no later ranges
    Filter,
    /// Augmented linear filter from any start, followed by an extended Kalman filter (the logs must
    /// contain velocities)
    Enlarged,
    /// Observer for two drones with a common anchor (the logs must contain positions and
    /// velocities)
    Shared,
}

#[derive(Debug, Args)]
pub(super) struct LocateArgs {
    /// Range logs, one for each drone: columns ranging.distance0 ... to the anchors and
    /// ranging.drone1 ... to the other drones, in meters. A repeated value is not a new measurement
    #[arg(required_unless_present = "region", conflicts_with = "region", value_name = "RANGES")]
    ranges: Vec<PathBuf>,
    /// Flight or log with the true positions, one for each drone
    #[arg(long, value_name = "FILE")]
    reference: Vec<PathBuf>,
    /// Seconds to add to the clock of each reference, if it differs from that of the logs
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    offset: Vec<f64>,
    /// Anchors (YAML of cfclient) that replace the scene's
    #[arg(long, value_name = "FILE")]
    anchors: Option<PathBuf>,
    /// Method that computes positions from ranges
    #[arg(long, value_enum, value_name = "NAME", default_value_t = Observer::Smooth)]
    observer: Observer,
    /// Noise density of the drones' acceleration, in (m/s²)/√Hz. Smaller values give smoother paths
    /// that lag in curves
    #[arg(long, value_name = "A", default_value_t = 1.0)]
    acceleration: f64,
    /// Box that contains all drones, in meters. If two mirror images fit the ranges, the one inside
    /// the box is selected
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = room, allow_hyphen_values = true)]
    within: Option<Room>,
    /// Map the region of convergence of the shared-anchor observer for the scene's word, without a
    /// log
    #[arg(long, conflicts_with_all = ["reference", "offset", "anchors", "observer",
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

/// Runs the verb `locate`, which computes the positions of drones from their ranges, compares them
/// with references, and writes them as flights and plots. With `--region`, nothing is written.
pub(super) fn run(args: &LocateArgs) -> Result<Report> {
    let scene = scene(args)?;
    if args.region {
        return region(scene);
    }
    one_for_each("reference", args.reference.len(), "log", args.ranges.len())?;
    one_for_each("offset", args.offset.len(), "reference", args.reference.len())?;
    let [least, most] = ACCELERATIONS;
    crate::error::within("acceleration", args.acceleration, least, most)?;
    let folder = OutputFolder::create(&args.output)?;
    // The positions are computed jointly from the ranges in all logs.
    let anchors_m = scene.sensors.uwb.anchors();
    let options = LocateOptions {
        range_sigma_m: scene.observer.ekf.two_way_sigma_m,
        acceleration_m_s2_sqrt_hz: args.acceleration,
        smooth: args.observer == Observer::Smooth,
        room: args.within,
    };
    let (logs, samples) = aligned_logs(args, &scene)?;
    let located = by_observer(args, &anchors_m, &logs, &samples, &options)?;
    warn(&located.warnings);
    warn_if_outside(&located, args.within);

    // The references yield the errors of the positions and of each link's ranges.
    let dated = aligned_references(args, &scene, &logs)?;
    let references: Vec<Reference<'_>> = dated
        .iter()
        .map(|dated| Reference { flight: &dated.flight, offset_s: dated.offset_s })
        .collect();
    let errors = references.iter().enumerate();
    let errors = errors.map(|(drone, reference)| position_error(&located, drone, *reference));
    let errors = errors.collect::<Result<Vec<_>>>()?;
    let links = link_errors(&samples, &anchors_m, &references);
    let files = write(folder, &located, &references)?;
    let files_on_clock: Vec<&Dated<'_>> = logs.iter().chain(&dated).collect();
    Ok(report(args.observer, &located, &files_on_clock, &errors, &links).with_files(&files))
}

/// Returns the scene with the anchors of `--anchors`, if given, each of which all drones receive.
fn scene(args: &LocateArgs) -> Result<Scene> {
    let mut scene = args.scene.load_from(None, &[], &USED)?;
    if let Some(path) = &args.anchors {
        scene.sensors.uwb.anchors_m = read_anchors(path)?;
        scene.sensors.uwb.heard.clear();
        scene.check()?;
    }
    Ok(scene)
}

/// Warns if more than half of the positions are outside the box of `--within`.
fn warn_if_outside(located: &Located, within: Option<Room>) {
    let Some(room) = within else { return };
    let positions_m = || located.position_m.iter().flatten();
    let n_outside = positions_m().filter(|position_m| !room.holds(position_m)).count();
    if 2 * n_outside > positions_m().count() {
        warn(["the drones are located outside the box of --within, because the ranges fit no \
             position inside it"]);
    }
}

/// Returns the report on the positions of all drones. `files` contains the logs and the references,
/// whose clocks are listed if there are several files.
fn report(
    observer: Observer,
    located: &Located,
    files: &[&Dated<'_>],
    errors: &[PositionError],
    links: &[LinkError],
) -> Report {
    let clocks = files
        .iter()
        .filter(|_| files.len() > 1)
        .map(|file| json!({ "file": file.path.display().to_string(), "offset_s": file.offset_s }));
    let ends = located.time_s.first().zip(located.time_s.last());
    let [median_m, worst_m] = sigmas_m(located).map_or([None; 2], |sigmas_m| sigmas_m.map(Some));
    let product = json!({
        "ranges": located.ranges, "span_s": ends.map_or(0.0, |(first, last)| last - first),
        "refused_frac": located.refused_frac, "nis": located.nis,
        "nis_interval": nis_interval(located.ranges), "sigma_median_m": median_m,
        "sigma_max_m": worst_m, "clocks": clocks.collect::<Vec<_>>(),
        "residuals": located.links, "reference": errors, "links": links,
        "warnings": located.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
    });
    let drones: Vec<usize> = (1..=located.position_m.len()).collect();
    let words = json!({
        "observer": format!("{observer:?}").to_lowercase(), "n_drones": drones.len(),
        "drone": drones,
        // An observer without a covariance refuses no range.
        "refused_frac": located.nis.map(|_| located.refused_frac),
    });
    Report::with_words(product, &words, LAYOUT)
}

const LAYOUT: &str = "\
located   {n_drones} of {n_drones} drones, --observer {observer}
ranges    {ranges} in {span_s:.1} s
refused   {refused_frac*100:.1} % of the ranges
NIS       {nis:.2} (from {nis_interval.0:.2} to {nis_interval.1:.2} if noise and motion are as assumed)
sigma     {sigma_median_m*100:.1} cm over three axes (median), {sigma_max_m*100:.1} cm at worst
*clocks clock     {file}: offset {offset_s:+.3} s

|residuals|residuals, cm<32|median>8|scatter>9|refused>9|ranges>8
{link}|{median_m*100:+.1}|{scatter_m*100:.1}|{refused}|{ranges}

|reference|RMSE, cm<10|x>5|y>8|z>8|3-D>8|NEES>8|samples>9
drone {drone.#}|{rmse_m.0*100:.1}|{rmse_m.1*100:.1}|{rmse_m.2*100:.1}|{rmse_3d_m*100:.1}|{nees:.2}|{samples}

|links|ranges minus true distances, cm<32|median>8|scatter>9|ranges>8
{link}|{median_m*100:+.1}|{scatter_m*100:.1}|{ranges}

";

/// A log or a reference, with the offset of its clock from the common time.
struct Dated<'a> {
    path: &'a PathBuf,
    flight: Flight,
    /// Timestamp of the file's time zero, in s, on a clock that other files may also use.
    zero_stamp_s: Option<f64>,
    /// Offset to add to the file's times, in s.
    offset_s: f64,
}

impl Dated<'_> {
    /// Returns the log's first and last timestamp in s on the drone's clock, or `None` if it has
    /// none.
    fn timestamps_s(&self) -> Option<[f64; 2]> {
        let zero_s = self.zero_stamp_s?;
        let (first, last) = self.flight.samples.first().zip(self.flight.samples.last())?;
        Some([zero_s + first.time_s, zero_s + last.time_s])
    }

    /// Returns the time in s from another file's time zero to that of this file. Returns `None` if
    /// their timestamps do not overlap, because the two files then use different clocks.
    fn after_s(&self, other: &Self) -> Option<f64> {
        let ([from_s, to_s], [other_from_s, other_to_s]) =
            (self.timestamps_s()?, other.timestamps_s()?);
        let overlap = from_s.max(other_from_s) < to_s.min(other_to_s);
        Some(self.zero_stamp_s? - other.zero_stamp_s?).filter(|_| overlap)
    }
}

/// Reads the logs, and returns them with all of their ranges on one clock. Returns [`Error::Input`]
/// for logs with different clocks or too many ranges.
fn aligned_logs<'a>(
    args: &'a LocateArgs,
    scene: &Scene,
) -> Result<(Vec<Dated<'a>>, Vec<RangeSample>)> {
    LOGS.check_all(&args.ranges)?;
    let (mut logs, mut samples) = (Vec::new(), Vec::new());
    for path in &args.ranges {
        let log = read(args, scene, path)?;
        let measured = ranges(&log.flight, logs.len());
        samples.push(measured.map_err(|error| error.in_file(path.display(), None))?);
        logs.push(log);
        // The number of ranges is checked before the next log is read, to limit memory.
        check_count(samples.iter().map(Vec::len).sum())?;
    }
    align_logs(&mut logs, &mut samples)?;
    Ok((logs, samples.into_iter().flatten().collect()))
}

/// Aligns the logs and their ranges to the clock of the first log. Time zero is that of the first
/// log, or the earliest sample if that is earlier. Returns [`Error::Input`] for a log whose
/// timestamps do not overlap those of the first one.
fn align_logs(logs: &mut [Dated<'_>], samples: &mut [Vec<RangeSample>]) -> Result<()> {
    // Every log must use the same clock as the first one.
    let Some((first, others)) = logs.split_first_mut() else { return Ok(()) };
    for log in others {
        let wanted = format!("timestamps that overlap with those of {}", first.path.display());
        let hint = "record all logs with one clock, or locate drones without ranges between them \
                    one by one";
        log.offset_s = log
            .after_s(first)
            .ok_or_else(|| Error::input(log.path.display(), "another clock", wanted, hint))?;
    }
    // No sample has a negative time.
    let begin_s = |log: &Dated<'_>| log.flight.samples.first().map_or(0.0, |s| s.time_s);
    let earliest_s = logs.iter().map(|log| begin_s(log) + log.offset_s).fold(0.0, f64::min);
    for (log, samples) in logs.iter_mut().zip(samples) {
        log.offset_s -= earliest_s;
        samples.iter_mut().for_each(|sample| sample.time_s += log.offset_s);
    }
    Ok(())
}

/// Reads the references, one for each log, and aligns them to the clock of the logs. An offset that
/// was typed is added to that of the timestamps. Returns [`Error::Input`] for a reference that has
/// neither an offset nor timestamps in common with its log.
fn aligned_references<'a>(
    args: &'a LocateArgs,
    scene: &Scene,
    logs: &[Dated<'_>],
) -> Result<Vec<Dated<'a>>> {
    LOGS.check_all(&args.reference)?;
    let references = args.reference.iter().map(|path| read(args, scene, path));
    let mut references = references.collect::<Result<Vec<_>>>()?;
    for (drone, (reference, log)) in references.iter_mut().zip(logs).enumerate() {
        let (after_s, typed_s) = (reference.after_s(log), args.offset.get(drone));
        if after_s.is_none() && typed_s.is_none() {
            let hint = "give the seconds between the two clocks with --offset";
            let wanted = "timestamps that overlap with those of the log";
            return Err(Error::input(reference.path.display(), "another clock", wanted, hint));
        }
        reference.offset_s = log.offset_s + after_s.unwrap_or(0.0) + typed_s.unwrap_or(&0.0);
    }
    Ok(references)
}

/// Refuses a flag that is given `n` times for `n_files` files, unless it is missing.
fn one_for_each(flag: &str, n: usize, file: &str, n_files: usize) -> Result<()> {
    if n == 0 || n == n_files {
        return Ok(());
    }
    Err(input_error!(
        flag,
        "{n} for {n_files} {file}s",
        "one for each {file}",
        "repeat the flag in the order of the files"
    ))
}

/// Returns a log or a reference with its clock, and prints its warnings, except those about missing
/// columns.
fn read<'a>(args: &LocateArgs, scene: &Scene, path: &'a PathBuf) -> Result<Dated<'a>> {
    let mut dated = logs::import_on_clock(path, &args.flights.options(Some(scene)))?;
    // A log needs only ranges here, and a reference only positions.
    let is_wanted = |warning: &Diagnostic| warning.code != UNLOGGED;
    dated.flight.edit(|flight| flight.warnings.retain(is_wanted));
    warn_of(path, &dated.flight.warnings);
    let OnClock { flight, zero_stamp_s, .. } = dated;
    Ok(Dated { path, flight, zero_stamp_s, offset_s: 0.0 })
}

/// Writes a flight file for each drone, and plots from above and from the front, in which each
/// flight is drawn with its reference. Returns the paths.
fn write(
    mut folder: OutputFolder,
    located: &Located,
    references: &[Reference<'_>],
) -> Result<Vec<PathBuf>> {
    let mut traces = Vec::new();
    for drone in 0..located.position_m.len() {
        let flight = flight(located, drone)?;
        folder.write_with(&format!("flight-{}.csv", drone + 1), |out| flight.write_csv(out))?;
        let samples = flight.into_data().samples;
        traces.push(NamedFlight { name: format!("located {}", drone + 1), samples });
        if let Some(reference) = references.get(drone) {
            let mut samples = reference.flight.samples.clone();
            samples.iter_mut().for_each(|s| s.time_s += reference.offset_s);
            traces.push(NamedFlight { name: format!("reference {}", drone + 1), samples });
        }
    }
    for (name, svg) in VIEWS.iter().zip([top_view(&traces), front_view(&traces)]) {
        folder.write(name, svg)?;
    }
    folder.keep()
}

/// Returns the drones' positions, computed with the selected observer. Returns [`Error::Input`] for
/// logs without the quantities that it needs.
fn by_observer(
    args: &LocateArgs,
    anchors_m: &[Vector3<f64>],
    logs: &[Dated<'_>],
    samples: &[RangeSample],
    options: &LocateOptions,
) -> Result<Located> {
    let tracks = || {
        let track =
            |log: &Dated<'_>| track(log).map_err(|error| error.in_file(log.path.display(), None));
        logs.iter().map(track).collect::<Result<Vec<_>>>()
    };
    // The first two observers require only ranges. The others integrate measured velocities.
    match args.observer {
        Observer::Smooth | Observer::Filter => locate(anchors_m, logs.len(), samples, options),
        Observer::Enlarged => locate_augmented(anchors_m, &tracks()?, samples, options),
        Observer::Shared => {
            let Ok(tracks) = <[Track; 2]>::try_from(tracks()?) else {
                let hint = "pass one log for each drone";
                return Err(Error::input("ranges", logs.len(), "the logs of two drones", hint));
            };
            let starts_m = [start_m(&logs[0].flight)?, start_m(&logs[1].flight)?];
            locate_shared(anchors_m, &tracks, starts_m, samples)
        }
    }
}

/// Returns the first position in m in a log, at which the observer starts.
fn start_m(flight: &Flight) -> Result<Vector3<f64>> {
    let first = flight.samples.first().filter(|_| flight.has(Quantity::Position));
    first.map(|sample| sample.position_m).ok_or_else(|| {
        let wanted = "positions, from which the observer starts";
        let hint = "also log stateEstimate.x, y and z, or use --observer smooth";
        Error::input("columns", "no position", wanted, hint)
    })
}

/// Returns the motion in a log, from its velocities in the world frame, on the common clock.
fn track(log: &Dated<'_>) -> Result<Track> {
    if !log.flight.has(Quantity::Velocity) {
        let hint = "also log stateEstimate.vx, vy and vz, or use --observer smooth";
        return Err(Error::input("columns", "no velocity", "the motion of the drone", hint));
    }
    let world = |s: &FlightSample| s.attitude.world_from_body() * s.velocity_body_m_s;
    Ok(Track::new(log.flight.samples.iter().map(|s| (s.time_s + log.offset_s, world(s)))))
}

/// Returns the ranges in the log of drone `drone`, counted from 0. A repeated value does not count
/// as a new measurement. Returns [`Error::Input`] for a log without ranges, and for too many
/// ranges.
fn ranges(log: &Flight, drone: usize) -> Result<Vec<RangeSample>> {
    let mut samples = Vec::new();
    let mut has_ranges = false;
    for (name, column) in &log.extra {
        let [anchor, other] = [TO_ANCHOR, TO_DRONE]
            .map(|head| name.strip_prefix(head).and_then(|n| n.parse::<usize>().ok()));
        let link = match (anchor, other) {
            (Some(anchor), _) => Link::Anchor { drone, anchor },
            (_, Some(other)) if other > 0 => Link::Drones(drone, other - 1),
            _ => continue,
        };
        has_ranges = true;
        // The firmware logs 0 until the first measurement, and then each range repeatedly until
        // it measures a new one. A cell without a value is NaN.
        let mut before_m = 0.0;
        for (sample, &distance_m) in log.samples.iter().zip(column) {
            if distance_m.is_nan() || distance_m == before_m {
                continue;
            }
            before_m = distance_m;
            samples.push(RangeSample { time_s: sample.time_s, link, distance_m });
        }
        check_count(samples.len())?;
    }
    if has_ranges {
        return Ok(samples);
    }
    let wanted = format!("{TO_ANCHOR}0 and so on, {TO_DRONE}1 and so on");
    Err(Error::input("columns", "no range", wanted, "log the ranges of the ranging group"))
}

/// Returns a flight with the positions of drone `drone`, counted from 0, from its first range to
/// its last, rounded as in a flight file.
fn flight(located: &Located, drone: usize) -> Result<Flight> {
    let sample = |index: usize| {
        let position_m = located.position_m[drone][index].map(on_grid);
        let time_s = on_grid(located.time_s[index]);
        FlightSample { time_s, position_m, estimate_m: position_m, ..FlightSample::default() }
    };
    use Quantity::{Attitude, Design, Motors, Rate, Velocity};
    Flight::new(FlightData {
        samples: located.heard(drone).map(sample).collect(),
        unlogged: [Attitude, Velocity, Rate, Design, Motors].into(),
        ..FlightData::default()
    })
}

/// Returns the median and the maximum standard deviation in m of all drones' positions, each
/// between the drone's first and last range. A standard deviation covers three axes: it is the root
/// of the covariance's trace. Returns `None` for an observer without a covariance.
fn sigmas_m(located: &Located) -> Option<[f64; 2]> {
    let drones = located.covariance_m2.iter().enumerate();
    let heard = drones.flat_map(|(drone, covariances)| &covariances[located.heard(drone)]);
    let sigmas_m: Vec<f64> = heard.map(|covariance| covariance.trace().max(0.0).sqrt()).collect();
    let worst_m = sigmas_m.iter().copied().fold(0.0, f64::max);
    Some([median(sigmas_m)?, worst_m])
}

/// Parses a box from its lowest and highest x, y and z in m. Returns a message for other texts,
/// and for a box without volume.
fn room(text: &str) -> std::result::Result<Room, String> {
    let room = numbers(text, &[',']).map(|[left, front, bottom, right, back, top]| Room {
        low_m: Vector3::new(left, front, bottom),
        high_m: Vector3::new(right, back, top),
    });
    let wanted = "wanted the minimum and the maximum x, y, z in meters, such as -2,-2,0,2,2,2.4";
    room.filter(|room| (room.high_m - room.low_m).min() > 0.0).ok_or_else(|| wanted.to_owned())
}
