//! `noctograph coverage`: where Lighthouse base stations see the drone, and how accurately.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::flags::{LetterFlags, SceneFlags, set_word};
use super::output::Output;
use super::report::Report;
use crate::error::Result;
use crate::report::coverage_map;
use crate::sim::{Coverage, coverage};

/// Margin around the word, and the region where there is no word.
const MARGIN_M: f64 = 0.5;
const ROOM_M: [f64; 4] = [-1.5, 0.0, 1.5, 2.0];

#[derive(Debug, Args)]
pub(super) struct CoverageArgs {
    /// Word at the center of the map [default: the scene's]
    #[arg(conflicts_with = "drawing")]
    word: Option<String>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    letters: LetterFlags,
    /// Left, bottom, right and top of the map, in meters [default: half a meter around the word]
    #[arg(long, value_name = "L,B,R,T", value_parser = bounds, allow_hyphen_values = true)]
    bounds: Option<[f64; 4]>,
    /// Depth of the plane of the map, in meters; the word is written at 0
    #[arg(long, value_name = "Y", default_value = "0", allow_hyphen_values = true)]
    depth: f64,
    /// Distance between two points of the map, in meters
    #[arg(long, value_name = "M", default_value = "0.05")]
    step: f64,
    /// Map to write (SVG)
    #[arg(short, long, value_name = "FILE", default_value = "coverage.svg")]
    output: PathBuf,
}

pub(super) fn run(args: &CoverageArgs) -> Result<Report> {
    let mut scene = args.scene.load(&args.letters.settings())?;
    if let Some(word) = &args.word {
        set_word(&mut scene, word);
    }
    let word = scene.has_strokes().then(|| scene.strokes()).transpose()?;
    let word_m = word.map(|strokes| strokes.bounds_m());
    let around = |[l, b, r, t]: [f64; 4]| {
        [l - MARGIN_M, (b - MARGIN_M).max(0.0), r + MARGIN_M, t + MARGIN_M]
    };
    let bounds_m = args.bounds.or(word_m.map(around)).unwrap_or(ROOM_M);
    let output = Output::create(&args.output)?;
    let grid = coverage(&scene.sensors, bounds_m, args.depth, args.step)?;
    let map = coverage_map(&grid, word_m);
    let path = output.keep(|out| out.write_all(map.as_bytes()))?;
    let n_stations = scene.sensors.lighthouse.stations.len();
    let (seen_frac, quantiles_m) = (grid.seen_frac(), quantiles_m(&grid));
    let json = json!({
        "n_stations": n_stations, "seen_frac": seen_frac,
        "error_median_m": quantiles_m.map(|q| q[0]), "error_p95_m": quantiles_m.map(|q| q[1]),
        "error_max_m": quantiles_m.map(|q| q[2]), "coverage": grid,
    });
    Ok(Report::new(table(&grid, n_stations, bounds_m), json).with_files(&[path]))
}

/// Median, 95th percentile and largest error.
fn quantiles_m(grid: &Coverage) -> Option<[f64; 3]> {
    let errors_m = grid.errors_m();
    let last = errors_m.len().checked_sub(1)?;
    Some([last / 2, last * 95 / 100, last].map(|i| errors_m[i]))
}

fn table(grid: &Coverage, n_stations: usize, [left, bottom, right, top]: [f64; 4]) -> String {
    let mut text = format!(
        "plane     x {left:.2} to {right:.2} m, z {bottom:.2} to {top:.2} m, at y {:.2} m\n\
         seen      by two or more of {n_stations} base stations: {:.1} % of {} points\n",
        grid.y_m,
        100.0 * grid.seen_frac(),
        grid.places.len(),
    );
    text += &match quantiles_m(grid).map(|q| q.map(|error_m| 1e3 * error_m)) {
        Some([median, most, worst]) => {
            format!(
                "error     median {median:.1} mm, 95 % below {most:.1} mm, worst {worst:.1} mm\n"
            )
        }
        None => "error     no point is seen by two\n".to_owned(),
    };
    text += "\nstations  points    share\n";
    for n in 0..=n_stations {
        let places = grid.places.iter().filter(|place| place.n_stations == n).count();
        if places > 0 {
            #[expect(clippy::cast_precision_loss, reason = "at most a million")]
            let share = 100.0 * places as f64 / grid.places.len() as f64;
            text += &format!("{n:<10}{places:<10}{share:.1} %\n");
        }
    }
    text + "\n"
}

fn bounds(text: &str) -> std::result::Result<[f64; 4], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| <[f64; 4]>::try_from(numbers).ok());
    numbers.ok_or_else(|| "wanted left,bottom,right,top in meters, such as -1,0,1,2".to_owned())
}
