//! `noctograph compare` measures the distance between two flights, and between each flight and its
//! design.

use std::path::{Path, PathBuf};

use super::flight_flags::FlightFlags;
use super::names::named;
use super::outcome::Report;
use super::output::OutputFolder;
use super::show;
use super::terminal::message;
use crate::comparison::{Alignment, Comparison, ComparisonOptions, Discrepancy, compare};
use crate::error::{Error, Result};
use crate::flight::{Flight, Quantity};
use crate::logs::{PositionSource, import};
use crate::report::{NamedFlight, error_over_time, front_view, top_view};
use crate::tracking::{Part, track};
use clap::Args;
use serde_json::{Value, json};

#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    /// Flight or log A, such as a simulated flight
    a: PathBuf,
    /// Flight or log B to compare with A, such as a real flight
    b: PathBuf,
    /// Part of both flights to compare
    #[arg(long, value_name = "PART", default_value = "airborne", value_parser = named::<Part>())]
    part: Part,
    /// Curve by which B's clock is aligned: the setpoints (design), or the flown path if the log's
    /// plan sends setpoints ahead of time (plan.reference = "inverse")
    #[arg(long, value_name = "BY", default_value = "design", value_parser = ["design", "flown"])]
    align: String,
    /// Seconds to add to B's clock, in place of --align
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    offset: Option<f64>,
    #[command(flatten)]
    flights: FlightFlags,
    /// Position source of B, if it differs from --position
    #[arg(long, value_name = "SOURCE", hide_possible_values = true,
          value_parser = named::<PositionSource>())]
    position_b: Option<PositionSource>,
    /// Folder for plots: flight-xy.svg, flight-xz.svg and error.svg
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

/// RMS distance, in m, below which two flights count as equal, and no cause of the difference is
/// printed. It is a third of a lamp's width.
const ALIKE_M: f64 = 0.001;

const FILES: [&str; 3] = ["flight-xy.svg", "flight-xz.svg", "error.svg"];

/// Runs the verb `compare`, which aligns two flights and reports how far they are apart, and the
/// most probable cause. Plots are written if an output folder is given.
pub(super) fn run(args: &CompareArgs) -> Result<Report> {
    let folder = args.output.as_deref().map(OutputFolder::create).transpose()?;
    let alignment = match args.offset {
        Some(offset_s) => Alignment::Offset(offset_s),
        None if args.align == "flown" => Alignment::Flown,
        None => Alignment::Design,
    };
    let options = ComparisonOptions { part: args.part, alignment, max_gap_s: args.flights.max_gap };
    let [a, b] = read(args, &options)?;
    let comparison = compare(&a, &b, &options)?;
    let files = match folder {
        Some(folder) => plots(folder, args, [&a, &b], &comparison)?,
        None => Vec::new(),
    };
    let first = comparison.first.map(|(cause, fraction)| {
        let (cause, change) = in_words(cause);
        json!({ "cause": cause, "change": change, "share": fraction })
    });
    // The JSON object contains the comparison and each flight's tracking error.
    let mut product = json!(comparison);
    product["a"] = side(&args.a, &a, options.part);
    product["b"] = side(&args.b, &b, options.part);
    let tracked = [("A", &product["a"]["tracking"]), ("B", &product["b"]["tracking"])];
    let tracked = tracked.into_iter().filter(|(_, tracking)| !tracking.is_null());
    let sides: Vec<_> =
        tracked.map(|(name, tracking)| json!({ "name": name, "tracking": tracking })).collect();
    let is_ahead = |side: &&Value| {
        side["tracking"]["lag_s"].as_f64().is_some_and(|lag_s| lag_s < show::LEAD_S)
    };
    let is_alike = comparison.rmse_m.norm() < ALIKE_M;
    let words = json!({
        "errors": error_rows(&product["rmse_m"], &sides), "sides": sides,
        "leads": sides.iter().filter(is_ahead).collect::<Vec<_>>(),
        "turned": Vec::from_iter(comparison.attitude_rmse),
        "cause": first.as_ref().filter(|_| !is_alike),
    });
    product["first"] = first.into();
    let layout = if files.is_empty() { LAYOUT.trim_end() } else { LAYOUT };
    Ok(Report::with_words(product, &words, layout).with_files(&files))
}

/// Returns a flight's file, digest and tracking error as JSON. The error is null for a flight
/// without a design, which can still be compared with another flight.
fn side(path: &Path, flight: &Flight, part: Part) -> Value {
    let tracking = track(flight, part).ok().as_ref().map(show::tracking_json);
    let (file, sha256) = (path.display().to_string(), flight.sha256());
    json!({ "file": file, "sha256": sha256, "tracking": tracking })
}

/// Returns the rows of the table of errors: the difference of the two flights, and three errors of
/// each flight that has a design. Each row contains the error on each axis and in the word's plane,
/// in m.
fn error_rows(rmse_m: &Value, sides: &[Value]) -> Vec<Value> {
    let mut rows = vec![json!({ "name": "A against B", "m": rmse_m })];
    for (key, what) in [
        ("rmse_m", "against its design"),
        ("rmse_after_lag_m", "without its lag"),
        ("observer_rmse_m", "observer"),
    ] {
        for side in sides.iter().filter(|side| !side["tracking"][key].is_null()) {
            let name = format!("{} {what}", side["name"].as_str().unwrap_or_default());
            rows.push(json!({ "name": name, "m": side["tracking"][key] }));
        }
    }
    // The error in the word's plane combines x and z.
    for row in &mut rows {
        let [x_m, z_m] = [0, 2].map(|axis| row["m"][axis].as_f64().unwrap_or_default());
        row["in_plane_m"] = libm::hypot(x_m, z_m).into();
    }
    rows
}

const LAYOUT: &str = "\
A         {a.file}
B         {b.file}
compared  {part}, {span_s.0:.2} to {span_s.1:.2} s, {samples} samples; B's clock {offset_s:+.3} s
frame     B is in another frame: rotated by {frame.turn_rad*57.29577951308232:+.1}° and shifted by {frame.shift_m.0:+.3}, {frame.shift_m.1:+.3}, {frame.shift_m.2:+.3} m onto A, which leaves {frame.left_m*100:.1} cm

|errors|RMSE, m<24|x>8|y>8|z>8|in plane>10
{name}|{m.0:.4}|{m.1:.4}|{m.2:.4}|{in_plane_m:.4}

|turned|RMSE, rad<24|yaw>8|pitch>8|roll>8
A against B|{0:.4}|{1:.4}|{2:.4}

|sides|contour error, m<24|mean>8|rms>8|p95>8|max>9|lag, s>9
{name}|{tracking.contour.mean_m:.3}|{tracking.contour.rms_m:.3}|{tracking.contour.p95_m:.3}|{tracking.contour.max_m:.3}|{tracking.lag_s:.3}
*leads lead      {name} is ahead of its design by {tracking.lag_s*-1:.3} s

|sides|drift in y, m<24|from>8|to>8|within ±0.2 m/%>17
{name}|{tracking.drift.min_y_m:+.3}|{tracking.drift.max_y_m:+.3}|{tracking.drift.in_corridor_frac*100:.1}

cause     {cause.cause}: {cause.share*100:.0} % of the difference
change    {cause.change}

";

/// Reads both flights. `--clock-ratio` corrects the clock of a drone, and therefore applies to only
/// one of the files, which a note names. Returns [`Error::Input`] if this file cannot be
/// determined.
fn read(args: &CompareArgs, options: &ComparisonOptions) -> Result<[Flight; 2]> {
    let position = args.position_b.unwrap_or(args.flights.position);
    let flags = [args.flights.clone(), FlightFlags { position, ..args.flights.clone() }];
    let [a, b] = [flags[0].read(&args.a, None)?, flags[1].read(&args.b, None)?];
    if args.flights.clock_ratio.is_none_or(|ratio| ratio == 1.0) {
        return Ok([a, b]);
    }
    fn as_stamped(flags: &FlightFlags, path: &Path) -> Result<Flight> {
        import(path, &FlightFlags { clock_ratio: Some(1.0), ..flags.clone() }.options(None))
    }
    // Each file is read with and without the ratio. If the results are equal, the file is a flight
    // instead of a log, and its times do not come from a drone's clock.
    let stamped = [as_stamped(&flags[0], &args.a)?, as_stamped(&flags[1], &args.b)?];
    let drones = [is_of_drone(&a), is_of_drone(&b)];
    if a == stamped[0] || b == stamped[1] || drones == [true; 2] {
        return Ok([a, b]);
    }
    let is_a = match drones {
        [false, false] => fits_better_as_a([&a, &b], &stamped, options)?,
        [is_a, _] => is_a,
    };
    let [a_stamped, b_stamped] = stamped;
    let (name, flights) = if is_a { ("A", [a, b_stamped]) } else { ("B", [a_stamped, b]) };
    let note = format!("{name} is the drone's log, so the clock ratio applies only to this log");
    message("note: ", &note);
    Ok(flights)
}

/// Returns true if a flight contains motor commands, rates, estimates or setpoints, which only a
/// drone logs. A motion capture system logs only poses.
fn is_of_drone(flight: &Flight) -> bool {
    let inside = [Quantity::Motors, Quantity::Rate, Quantity::Estimate, Quantity::Design];
    inside.iter().any(|quantity| flight.has(*quantity))
}

/// Returns true if two logs agree better with the clock ratio applied to A than to B. `corrected`
/// contains both logs with the ratio, and `stamped` both without. Returns [`Error::Input`] if the
/// two fits are too similar to decide.
fn fits_better_as_a(
    corrected: [&Flight; 2],
    stamped: &[Flight; 2],
    options: &ComparisonOptions,
) -> Result<bool> {
    // Logs that cannot be compared do not fit at all.
    let apart_m = |a: &Flight, b: &Flight| {
        compare(a, b, options).map_or(f64::INFINITY, |comparison| comparison.rmse_m.norm())
    };
    let as_a_m = apart_m(corrected[0], &stamped[1]);
    let as_b_m = apart_m(&stamped[0], corrected[1]);
    if as_a_m.min(as_b_m) * CLEARLY > as_a_m.max(as_b_m) || as_a_m == as_b_m {
        let actual = "two logs without motors, rates, estimates or setpoints";
        let hint = "import the drone's log separately with this ratio, and compare the flight";
        return Err(Error::input("clock_ratio", actual, "one log by the drone", hint));
    }
    Ok(as_a_m < as_b_m)
}

/// Smallest ratio of the larger to the smaller RMS distance at which the better fit determines the
/// log to which the clock ratio applies.
const CLEARLY: f64 = 1.5;

/// Writes the plots of both flights, with B on A's clock and in A's frame, and returns their paths.
fn plots(
    mut folder: OutputFolder,
    args: &CompareArgs,
    flights: [&Flight; 2],
    comparison: &Comparison,
) -> Result<Vec<PathBuf>> {
    // The offset of A's clock is zero by definition.
    let clocks = [(&args.a, 'A', 0.0), (&args.b, 'B', comparison.offset_s)];
    let mut traces = Vec::new();
    // Plots label a flight with its letter and its file name.
    for (flight, (path, letter, offset_s)) in flights.into_iter().zip(clocks) {
        let mut samples = comparison.part.samples(flight)?;
        samples.iter_mut().for_each(|sample| sample.time_s += offset_s);
        if let Some(placement) = comparison.placement.filter(|_| letter == 'B') {
            samples.iter_mut().for_each(|sample| placement.place(sample));
        }
        let file = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        traces.push(NamedFlight { name: format!("{letter} {file}"), samples });
    }
    let drawn = [top_view(&traces), front_view(&traces), error_over_time(&traces)];
    for (name, svg) in FILES.iter().zip(drawn) {
        folder.write(name, svg)?;
    }
    folder.keep()
}

/// Returns a sentence that describes a cause of the difference, and a suggested change.
fn in_words(cause: Discrepancy) -> (String, &'static str) {
    // Each sentence describes flight B relative to flight A.
    match cause {
        Discrepancy::Lag(s) if s > 0.0 => (
            format!("B is {s:.2} s behind A"),
            "plan with plan.reference=inverse; if only B's clock is late, use --align flown",
        ),
        Discrepancy::Lag(s) => (
            format!("B is {:.2} s ahead of A", -s),
            "compare with --align flown, which aligns B's clock with A's by the flown paths",
        ),
        Discrepancy::Offset(m) => (
            format!("B is displaced from A by {:+.3}, {:+.3}, {:+.3} m (x, y, z)", m.x, m.y, m.z),
            "plan with --after B, or check the origin of the positioning system",
        ),
        Discrepancy::Scale(s) => {
            let side = if s < 0.0 { "smaller" } else { "larger" };
            (
                format!("B is {:.1} % {side} than A", 100.0 * s.abs()),
                "check the geometry of the positioning system",
            )
        }
        Discrepancy::Path(m) => (
            format!("B's path is {:.0} mm away from A's path (RMS)", 1e3 * m),
            "measure B's drone and adjust the scene: noctograph identify B",
        ),
        Discrepancy::Noise(m) => (
            format!("B oscillates about its path by {:.0} mm (RMS)", 1e3 * m),
            "reduce the gains, or check the propellers and the measured positions",
        ),
    }
}
