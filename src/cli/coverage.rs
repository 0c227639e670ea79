//! `noctograph coverage` maps the accuracy of Lighthouse base stations, or computes the smallest
//! error that ultra-wideband ranges allow along a word.

use std::path::PathBuf;

use super::flags::{SceneFlags, set_word, typed_word};
use super::letters::{LetterFlags, LetterSize};
use super::names::numbers;
use super::outcome::Report;
use super::output::Output;
use crate::error::Result;
use crate::plan::Plan;
use crate::report::{bound_map, coverage_map};
use crate::scene::Scene;
use crate::sensors::{Coverage, coverage};
use crate::shoot::Shoot;
use crate::sim::{bounds, one_more_anchor, writing_sigma_m};
use clap::Args;
use serde_json::json;

/// Margin around the word in the map, in m.
const MARGIN_M: f64 = 0.5;
/// Bounds of the map for a scene without a word, in the order left, bottom, right, top, in m.
const ROOM_M: [f64; 4] = [-1.5, 0.0, 1.5, 2.0];

#[derive(Debug, Args)]
pub(super) struct CoverageArgs {
    /// Word at the center of the map [default: the scene's]
    #[arg(conflicts_with = "drawing")]
    word: Option<String>,
    /// Word at the center of the map, even if a file has this name
    #[arg(long = "word", value_name = "WORD", conflicts_with_all = ["word", "drawing"])]
    as_word: Option<String>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    letters: LetterFlags,
    /// Left, bottom, right and top of the map, in meters [default: half a meter around the word]
    #[arg(long, value_name = "L,B,R,T", value_parser = rectangle, allow_hyphen_values = true)]
    bounds: Option<[f64; 4]>,
    /// Depth (y) of the map's plane, in meters. The word is written at 0
    #[arg(long, value_name = "Y", default_value = "0", allow_hyphen_values = true)]
    depth: f64,
    /// Distance between neighboring points of the map, in meters
    #[arg(long, value_name = "M", default_value = "0.05")]
    step: f64,
    /// Map to write (SVG)
    #[arg(short, long, value_name = "FILE", default_value = "coverage.svg")]
    output: PathBuf,
}

/// Runs the verb `coverage`, which maps where base stations see a drone or, for ranging, reports
/// the error bound along the word. The map is written as SVG.
pub(super) fn run(args: &CoverageArgs) -> Result<Report> {
    let mut scene = args.scene.load(&[], &args.letters.settings(LetterSize::Fitted))?;
    if let Some(word) = typed_word(args.word.as_ref(), args.as_word.as_ref())? {
        set_word(&mut scene, word);
    }
    // Ranging yields an error bound along the word, and Lighthouse yields a map of the word's
    // plane.
    if scene.sensors.positioning.is_by_ranges() {
        return along_the_word(args, scene);
    }
    let word = scene.has_strokes().then(|| scene.strokes()).transpose()?;
    let word_m = word.map(|strokes| strokes.bounds_m());
    /// Returns the word's bounds (left, bottom, right, top) in m, extended by a margin, but not
    /// below the floor.
    fn around([l, b, r, t]: [f64; 4]) -> [f64; 4] {
        [l - MARGIN_M, (b - MARGIN_M).max(0.0), r + MARGIN_M, t + MARGIN_M]
    }
    let bounds_m = args.bounds.or(word_m.map(around)).unwrap_or(ROOM_M);
    let output = Output::create(&args.output)?;
    let grid = coverage(&scene.sensors, bounds_m, args.depth, args.step)?;
    let map = coverage_map(&grid, word_m);
    let path = output.keep(map)?;
    Ok(coverage_report(&grid, scene.sensors.lighthouse.stations.len(), bounds_m)
        .with_files(&[path]))
}

/// Returns the report on the Cramér–Rao bound of the position error along the flights that write a
/// word, and on the best position for an additional anchor. Writes the map as SVG.
fn along_the_word(args: &CoverageArgs, scene: Scene) -> Result<Report> {
    let output = Output::create(&args.output)?;
    let shoot = Shoot::new(scene)?;
    let plans: Vec<&Plan> = shoot.plans.iter().map(|planned| &planned.plan).collect();
    let options = shoot.scene.sim();
    let bounds = bounds(&plans, &options)?;
    let (anchor_m, better_m) = one_more_anchor(&plans, &options)?;
    let picture = bound_map(&plans, &bounds, &options.sensors.uwb, anchor_m);
    let path = output.keep(picture)?;

    // Letters are numbered as in the plan, which counts glyphs but not spaces.
    let mut letters = Vec::new();
    let strokes = shoot.strokes.iter();
    for (letter, glyph) in strokes.clone().flat_map(|strokes| &strokes.glyphs).enumerate() {
        // In a drawing, the strokes of each color are treated as a letter.
        let name = if strokes.clone().any(|strokes| !strokes.word.is_empty()) {
            glyph.character.to_string()
        } else {
            (letter + 1).to_string()
        };
        for (drone, bound) in (1..).zip(&bounds) {
            if let Some(sigma_m) = writing_sigma_m(std::slice::from_ref(bound), Some(letter)) {
                letters.push(json!({ "letter": name, "drone": drone, "bound_m": sigma_m }));
            }
        }
    }
    let product = json!({
        "bound_m": writing_sigma_m(&bounds, None), "letters": letters,
        "one_more_anchor": { "position_m": anchor_m, "bound_m": better_m },
    });
    Ok(Report::with_layout(product, BOUNDS).with_files(&[path]))
}

/// Layout of the text report for ultra-wideband ranges.
const BOUNDS: &str = "\
bound     {bound_m*100:.1~-} cm over three axes, 1 σ: the smallest error that the ranges allow along the strokes
wanted    an error of at most 5 % of the letters' height on each axis; a slow error may be twice as large
excluded  biased ranges, outliers and lost messages: they increase the error

|letters|letter<8|drone<8|bound, cm>9
{letter}|{drone}|{bound_m*100:.1}

advice    an additional anchor that all drones receive helps most at ({one_more_anchor.position_m.0:.2}, {one_more_anchor.position_m.1:.2}, {one_more_anchor.position_m.2:.2}) m: {one_more_anchor.bound_m*100:.1} cm then

";

/// Returns the report on a coverage map of base stations within `bounds_m` (left, bottom, right,
/// top): the fraction of points that two stations see, quantiles of the error there, and the number
/// of points for each number of stations.
fn coverage_report(grid: &Coverage, n_stations: usize, bounds_m: [f64; 4]) -> Report {
    // The errors are sorted, and there are none if no point is seen by two stations.
    let errors_m = grid.errors_m();
    let quantile_m =
        |percent: usize| Some(errors_m[errors_m.len().checked_sub(1)? * percent / 100]);
    let [median_m, p95_m, max_m] = [50, 95, 100].map(quantile_m);
    let product = json!({
        "n_stations": n_stations, "seen_frac": grid.seen_frac(), "error_median_m": median_m,
        "error_p95_m": p95_m, "error_max_m": max_m, "coverage": grid,
    });
    let reflected = grid.places.iter().filter(|place| place.n_reflected > 0).count();
    let n_points = grid.places.len();
    let seen = (0..=n_stations).filter_map(|n| {
        let places = grid.places.iter().filter(|place| place.n_stations == n).count();
        let fraction = places as f64 / n_points as f64;
        (places > 0).then(|| json!({ "stations": n, "points": places, "share": fraction }))
    });
    let words = json!({
        "map": bounds_m, "points": n_points, "seen": seen.collect::<Vec<_>>(),
        "reflected": Some(reflected).filter(|n| *n > 0),
        "unknown": median_m.is_none().then_some("no point is seen by two base stations"),
    });
    Report::with_words(product, &words, STATIONS)
}

const STATIONS: &str = "\
plane     x {map.0:.2} to {map.2:.2} m, z {map.1:.2} to {map.3:.2} m, at y {coverage.y_m:.2} m
seen      by two or more of {n_stations} base stations: {seen_frac*100:.1} % of {points} points
error     median {error_median_m*1e3:.1} mm, 95 % below {error_p95_m*1e3:.1} mm, largest {error_max_m*1e3:.1} mm
error     unknown: {unknown}
mirrors   show a station a second time at {reflected} points

|seen|stations<10|points<10|fraction<0
{stations}|{points}|{share*100:.1} %

";

/// Parses the left, bottom, right and top of a rectangle in m. Returns a message for other texts.
fn rectangle(text: &str) -> std::result::Result<[f64; 4], String> {
    numbers(text, &[','])
        .ok_or_else(|| "wanted left,bottom,right,top in meters, such as -1,0,1,2".to_owned())
}
