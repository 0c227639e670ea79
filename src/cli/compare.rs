//! `noctograph compare`: how far apart two flights are, and each from its design.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::Vector3;

use super::inputs::{PositionName, import_flight};
use super::outputs::OutputFolder;
use super::{Outcome, print, show};
use crate::error::Result;
use crate::flight::Flight;
use crate::flight::comparison::{Alignment, Comparison, ComparisonOptions, compare};
use crate::flight::tracking::{Part, Tracking, track};
use crate::geometry::Attitude;
use crate::logs::ImportOptions;
use crate::report::{Trace, error_over_time, front_view, top_view};

#[derive(Debug, Args)]
pub(super) struct CompareArgs {
    /// Flight or log to judge, such as a simulated flight
    a: PathBuf,
    /// Flight or log to hold it against, such as a real flight's
    b: PathBuf,
    /// Part of both flights that is compared
    #[arg(long, value_name = "PART", default_value = "airborne")]
    part: PartName,
    /// Add this many seconds to B's clock, instead of setting it by the designs
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    offset: Option<f64>,
    /// Position of a log that is compared; of a flight file, estimate takes what was believed
    #[arg(long, value_name = "SOURCE", default_value = "best")]
    position: PositionName,
    /// Another position of B
    #[arg(long, value_name = "SOURCE")]
    position_b: Option<PositionName>,
    /// Join samples of a log, and those of B, over no longer a gap than this, in seconds
    #[arg(long, value_name = "S")]
    max_gap: Option<f64>,
    /// Folder for plots: flight-xy.svg, flight-xz.svg and error.svg
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// Part of a flight.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum PartName {
    /// While letters are written
    Letters,
    /// Between take-off and landing
    Airborne,
    /// From the first sample to the last
    All,
}

impl From<PartName> for Part {
    fn from(name: PartName) -> Self {
        match name {
            PartName::Letters => Self::Letters,
            PartName::Airborne => Self::Airborne,
            PartName::All => Self::All,
        }
    }
}

/// What `-o` leaves.
const FILES: [&str; 3] = ["flight-xy.svg", "flight-xz.svg", "error.svg"];

pub(super) fn run(args: &CompareArgs) -> Result<Outcome> {
    let folder = args.output.as_deref().map(OutputFolder::create).transpose()?;
    let mut options = ComparisonOptions {
        part: args.part.into(),
        alignment: args.offset.map_or(Alignment::Design, Alignment::Offset),
        ..ComparisonOptions::default()
    };
    let mut import = ImportOptions { position: args.position.into(), ..Default::default() };
    if let Some(max_gap_s) = args.max_gap {
        (options.max_gap_s, import.max_gap_s) = (max_gap_s, max_gap_s);
    }
    let a = import_flight(&args.a, &import)?;
    import.position = args.position_b.unwrap_or(args.position).into();
    let b = import_flight(&args.b, &import)?;
    let comparison = compare(&a, &b, &options)?;
    // A flight without a design can still be compared with another one.
    let tracking = [&a, &b].map(|flight| track(flight, options.part).ok());
    let files = match folder {
        Some(folder) => plots(folder, args, [&a, &b], &comparison)?,
        None => Vec::new(),
    };
    if args.json {
        let digests = [a.sha256(), b.sha256()];
        let json = to_json(args, &comparison, &tracking, &digests, &files);
        print(&format!("{json}\n"))?;
    } else {
        print(&table(args, &comparison, &tracking, &files))?;
    }
    Ok(Outcome::Done)
}

fn plots(
    folder: OutputFolder,
    args: &CompareArgs,
    flights: [&Flight; 2],
    comparison: &Comparison,
) -> Result<Vec<PathBuf>> {
    let clocks = [(&args.a, 'A', 0.0), (&args.b, 'B', comparison.offset_s)];
    let mut traces = Vec::new();
    for (flight, (path, letter, offset_s)) in flights.into_iter().zip(clocks) {
        let mut samples = comparison.part.samples(flight)?;
        samples.iter_mut().for_each(|sample| sample.time_s += offset_s);
        let file = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        traces.push(Trace { name: format!("{letter} {file}"), samples });
    }
    let drawn = [top_view(&traces), front_view(&traces), error_over_time(&traces)];
    for (name, svg) in FILES.iter().zip(drawn) {
        folder.write(name, |out| out.write_all(svg.as_bytes()))?;
    }
    folder.keep(&FILES)
}

fn to_json(
    args: &CompareArgs,
    comparison: &Comparison,
    [a, b]: &[Option<Tracking>; 2],
    [digest_a, digest_b]: &[String; 2],
    files: &[PathBuf],
) -> serde_json::Value {
    let side = |path: &Path, digest: &str, tracking: &Option<Tracking>| {
        let tracking = tracking.as_ref().map(show::tracking_json);
        serde_json::json!({ "file": path, "sha256": digest, "tracking": tracking })
    };
    let (rmse, mean) = (comparison.rmse_m, comparison.mean_m);
    let turned = comparison.attitude_rmse.map(|a| [a.yaw_rad, a.pitch_rad, a.roll_rad]);
    serde_json::json!({
        "part": comparison.part.name(),
        "offset_s": comparison.offset_s,
        "samples": comparison.n_samples,
        "span_s": comparison.span_s,
        "rmse_m": [rmse.x, rmse.y, rmse.z],
        "mean_m": [mean.x, mean.y, mean.z],
        "max_m": comparison.max_m,
        "attitude_rmse_rad": turned,
        "a": side(&args.a, digest_a, a),
        "b": side(&args.b, digest_b, b),
        "files": files,
    })
}

/// The team's Tables 1 (flown against design) and 2 (observer), for both flights and between them.
fn table(
    args: &CompareArgs,
    comparison: &Comparison,
    tracking: &[Option<Tracking>; 2],
    files: &[PathBuf],
) -> String {
    let part = show::in_part(comparison.part);
    // Whole milliseconds, and no minus before nothing.
    let offset_s = (comparison.offset_s * 1e3).round() / 1e3 + 0.0;
    let [from_s, to_s] = comparison.span_s;
    let mut text = format!("A         {}\nB         {}\n", args.a.display(), args.b.display());
    text += &format!(
        "compared  {part}, {from_s:.2} to {to_s:.2} s, {} samples; B's clock {offset_s:+.3} s\n",
        comparison.n_samples
    );

    text += "\nRMSE, m                        x       y       z  in plane\n";
    text += &row("A against B", comparison.rmse_m);
    text += &rows(tracking, "against its design", |t| Some(row("", t.rmse_m)));
    text += &rows(tracking, "after its lag", |t| Some(row("", t.rmse_after_lag_m)));
    text += &rows(tracking, "observer", |t| Some(row("", t.observer_rmse_m?)));
    if let Some(turned) = comparison.attitude_rmse {
        let Attitude { yaw_rad, pitch_rad, roll_rad } = turned;
        text += "\nRMSE, rad                    yaw   pitch    roll\n";
        text += &format!("{:24}{yaw_rad:8.4}{pitch_rad:8.4}{roll_rad:8.4}\n", "A against B");
    }

    text += "\noff the path, m             mean     rms     p95      max   lag, s\n";
    text += &rows(tracking, "", |t| {
        let c = t.contour;
        let (mean, rms, p95, max) = (c.mean_m, c.rms_m, c.p95_m, c.max_m);
        Some(format!("{:24}{mean:8.3}{rms:8.3}{p95:8.3}{max:9.3}{:9.3}\n", "", t.lag_s))
    });
    text += "\ndrift in y, m               from      to    within ±0.2 m\n";
    text += &rows(tracking, "", |t| {
        let d = t.drift;
        let share = 100.0 * d.in_corridor_frac;
        Some(format!("{:24}{:+8.3}{:+8.3}{share:15.1} %\n", "", d.min_y_m, d.max_y_m))
    });
    if !files.is_empty() {
        text.push('\n');
    }
    for (index, file) in files.iter().enumerate() {
        let title = if index == 0 { "files" } else { "" };
        text += &format!("{title:10}{}\n", file.display());
    }
    text
}

/// A row of a vector: its name, x, y, z and the length in the x-z plane.
fn row(name: &str, v: Vector3<f64>) -> String {
    format!("{name:24}{:8.4}{:8.4}{:8.4}{:10.4}\n", v.x, v.y, v.z, v.xz().norm())
}

/// A row for each flight that can tell.
fn rows(
    tracking: &[Option<Tracking>; 2],
    name: &str,
    row: impl Fn(&Tracking) -> Option<String>,
) -> String {
    let row = |(letter, tracking): (&str, &Option<Tracking>)| {
        let row = row(tracking.as_ref()?)?;
        let name = format!("{letter} {name}");
        Some(format!("{name:24}{}", &row[24..]))
    };
    ["A", "B"].into_iter().zip(tracking).filter_map(row).collect()
}
