//! `noctograph coverage`: where Lighthouse base stations see the drone, and how accurately; for
//! ultra-wideband ranges, how well the drones of a word can be placed at best.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::flags::{SceneFlags, set_word};
use super::letters::LetterFlags;
use super::names::numbers;
use super::outcome::{Report, line};
use super::output::Output;
use super::table::table;
use crate::error::Result;
use crate::plan::Plan;
use crate::report::{bound_map, coverage_map};
use crate::scene::Scene;
use crate::sensors::{Coverage, Positioning, coverage};
use crate::shoot::Shoot;
use crate::sim::{bounds, one_more_anchor, writing_sigma_m};

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
    #[arg(long, value_name = "L,B,R,T", value_parser = rectangle, allow_hyphen_values = true)]
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
        set_word(&mut scene, word)?;
    }
    if matches!(scene.sensors.positioning, Positioning::UwbTwr | Positioning::UwbTdoa) {
        return along_the_word(args, scene);
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
    Ok(Report::new(text_of(&grid, n_stations, bounds_m), json).with_files(&[path]))
}

/// The bound of the estimates along the flights that write a word, and the best place of one more
/// anchor.
fn along_the_word(args: &CoverageArgs, scene: Scene) -> Result<Report> {
    let output = Output::create(&args.output)?;
    let shoot = Shoot::new(scene)?;
    let plans: Vec<&Plan> = shoot.plans.iter().map(|planned| &planned.plan).collect();
    let options = shoot.scene.sim();
    let bound = bounds(&plans, &options)?;
    let (place_m, better_m) = one_more_anchor(&plans, &options)?;
    let picture = bound_map(&plans, &bound, &options.sensors.uwb, place_m);
    let path = output.keep(|out| out.write_all(picture.as_bytes()))?;

    let word_m = writing_sigma_m(&bound, None);
    let cm = |sigma_m: Option<f64>| sigma_m.map_or("-".to_owned(), |m| format!("{:.1}", 100.0 * m));
    let mut text = line(
        "bound",
        &format!(
            "{} cm over three axes, 1 \u{3c3}: the least error that the ranges allow along the strokes",
            cm(word_m)
        ),
    );
    text += &line(
        "wanted",
        "an error of at most 5 % of the letters' height on each axis; a slow error may be twice as \
         large",
    );
    text +=
        &line("excluded", "biased ranges, stray ranges and lost messages: with them it is more");
    let strokes = shoot.strokes.as_ref();
    // Spaces are no letters: the plan counts glyphs.
    let glyphs = strokes.map_or(&[][..], |strokes| &strokes.glyphs);
    let (mut letters, mut rows) = (Vec::new(), Vec::new());
    let is_word = strokes.is_some_and(|strokes| !strokes.word.is_empty());
    for (letter, glyph) in glyphs.iter().enumerate() {
        // A drawing has strokes of one color in place of letters.
        let name = if is_word { glyph.character.to_string() } else { (letter + 1).to_string() };
        for (drone, bound) in bound.iter().enumerate() {
            let sigma_m = writing_sigma_m(std::slice::from_ref(bound), Some(letter));
            if let Some(sigma_m) = sigma_m {
                rows.push(format!("{name}\t{}\t{}", drone + 1, cm(Some(sigma_m))));
                letters.push(json!({ "letter": name, "drone": drone + 1, "bound_m": sigma_m }));
            }
        }
    }
    text += &format!("\n{}", table("letter<8|drone<8|bound, cm>9", rows));
    let [x, y, z] = place_m;
    let more = format!(
        "one more anchor that all drones hear helps most at ({x:.2}, {y:.2}, {z:.2}) m: {} cm then",
        cm(Some(better_m))
    );
    text += &format!("\n{}\n", line("advice", &more));
    let json = json!({
        "bound_m": word_m, "letters": letters,
        "one_more_anchor": { "position_m": place_m, "bound_m": better_m },
    });
    Ok(Report::new(text, json).with_files(&[path]))
}

/// Median, 95th percentile and largest error.
fn quantiles_m(grid: &Coverage) -> Option<[f64; 3]> {
    let errors_m = grid.errors_m();
    let last = errors_m.len().checked_sub(1)?;
    Some([last / 2, last * 95 / 100, last].map(|i| errors_m[i]))
}

fn text_of(grid: &Coverage, n_stations: usize, [left, bottom, right, top]: [f64; 4]) -> String {
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
                "error     median {median:.1} mm, 95 % below {most:.1} mm, largest {worst:.1} mm\n"
            )
        }
        None => "error     unknown: no point is seen by two base stations\n".to_owned(),
    };
    let reflected = grid.places.iter().filter(|place| place.n_reflected > 0).count();
    if reflected > 0 {
        text += &format!("mirrors   show a station a second time at {reflected} points\n");
    }
    let rows = (0..=n_stations).filter_map(|n| {
        let places = grid.places.iter().filter(|place| place.n_stations == n).count();
        let share = 100.0 * places as f64 / grid.places.len() as f64;
        (places > 0).then(|| format!("{n}\t{places}\t{share:.1} %"))
    });
    text + "\n" + &table("stations<10|points<10|share<0", rows) + "\n"
}

fn rectangle(text: &str) -> std::result::Result<[f64; 4], String> {
    numbers(text, &[','])
        .ok_or_else(|| "wanted left,bottom,right,top in meters, such as -1,0,1,2".to_owned())
}
