//! Measures whether advice helps. For each of 60 scenes with faults, the first remedy is applied,
//! and the word is flown and read again with seeds that were not used for the advice.
//!
//! ```sh
//! cargo run --release --example advice      # the table of docs/advice.md (docs/figures advice)
//! ```

use noctograph::diagnostic::Change;
use noctograph::error::Error;
use noctograph::scene::Scene;
use noctograph::shoot::{Judging, Shoot};
use noctograph::studies::remedies;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Name of a fault, and the scene settings that cause it.
type Fault = (&'static str, &'static [(&'static str, &'static str)]);

const FAULTS: [Fault; 15] = [
    ("the team's style, fast", &[("plan.style", "team"), ("plan.stroke_speed_m_s", "0.6")]),
    (
        "setpoint-timed lights, 1.2 s late",
        &[("plan.light_clock", "setpoint"), ("light.radio_delay_s", "1.2")],
    ),
    (
        "held setpoints without a lead",
        &[
            ("plan.style", "team"),
            ("plan.stroke_speed_m_s", "0.5"),
            ("controller.kind", "lqr"),
            ("plan.reference", "design"),
        ],
    ),
    ("overlapping letters", &[("letters.spacing_m", "-0.3")]),
    ("small letters", &[("letters.cap_height_m", "0.1")]),
    ("strokes at 2 m/s", &[("plan.stroke_speed_m_s", "2.0")]),
    (
        "f/1.4, front focus",
        &[("camera.f_number", "1.4"), ("camera.iso", "25"), ("camera.focus_m", "0.3")],
    ),
    ("ISO 100000", &[("camera.iso", "100000")]),
    ("underexposure", &[("camera.f_number", "256"), ("camera.iso", "10")]),
    ("exposure ends early", &[("camera.shutter_close_s", "9")]),
    ("exposure begins late", &[("camera.shutter_open_s", "12")]),
    (
        "misaimed camera",
        &[("camera.framing.kind", "fixed"), ("camera.framing.target_m", "[1.5, 0.0, 1.0]")],
    ),
    ("spinning ring", &[("light.ring", "double-spin"), ("plan.lights", "[\"ring\"]")]),
    ("low resolution", &[("camera.width_px", "24"), ("camera.height_px", "16")]),
    ("a bright room", &[("photo.ambient_cd_m2", "4"), ("camera.f_number", "8")]),
];

const WORDS: [&str; 4] = ["NOOR", "Jazz", "2027", "Sofia"];

/// Seeds with which the advice is tested. They differ from those with which it was computed.
const SEEDS: [u64; 3] = [101, 102, 103];

fn main() -> Outcome<()> {
    let mut rows = Vec::new();
    let (mut rose, mut fell, mut silent) = (0, 0, 0);
    let only: Option<usize> = std::env::args().nth(1).map(|n| n.parse()).transpose()?;
    for (number, (fault, settings)) in FAULTS.iter().enumerate() {
        for (place, word) in WORDS.iter().enumerate().take(only.unwrap_or(WORDS.len())) {
            let mut set =
                vec![("word", *word), ("camera.width_px", "480"), ("camera.height_px", "270")];
            set.extend(*settings);
            let mut scene = Scene::parse_with("", "scene", &set)?;
            scene.seed = (10 * number + place) as u64;
            let found = match Shoot::new(scene.clone()).and_then(|shoot| remedies(&shoot)) {
                // If there is no photograph, the error gives the only advice.
                Err(Error::Infeasible { what, .. }) => {
                    silent += 1;
                    rows.push(format!("| {fault} | {word} | 0.00 | none: {what} | | |"));
                    continue;
                }
                found => found?,
            };
            let Some(first) = found.first() else {
                let before = mean(&scene)?;
                // A legible word needs no advice.
                silent += usize::from(before < 0.5);
                rows.push(format!("| {fault} | {word} | {before:.2} | none | | |"));
                continue;
            };
            let [before, after] =
                [mean(&scene)?, mean(&followed(&set, &first.changes, scene.seed)?)?];
            rose += usize::from(after > before);
            fell += usize::from(after < before);
            rows.push(format!(
                "| {fault} | {word} | {before:.2} | `{}` | {:+.2} | {after:.2} |",
                in_words(&first.changes),
                first.gain
            ));
        }
    }
    print_out(&rows, [rose, fell, silent]);
    Ok(())
}

#[expect(clippy::print_stdout, reason = "an example's result")]
fn print_out(rows: &[String], [rose, fell, silent]: [usize; 3]) {
    println!("| fault | word | readability | first advice | gain it names | readability after |");
    println!("|---|---|---|---|---|---|");
    rows.iter().for_each(|row| println!("{row}"));
    println!(
        "\n{} scenes: the readability rose in {rose} and fell in {fell}. {silent} illegible \
         scenes received no advice.",
        rows.len()
    );
}

/// Formats changes in the syntax of scene files.
fn in_words(changes: &[Change]) -> String {
    changes.iter().map(Change::to_string).collect::<Vec<_>>().join(", ")
}

/// Returns the scene with the advised changes applied, as if a user had typed them.
fn followed(set: &[(&str, &str)], changes: &[Change], seed: u64) -> Outcome<Scene> {
    let mut settings = set.to_vec();
    for change in changes {
        let old =
            |(key, _): &(&str, &str)| key.starts_with("plan.style") && change.key == "plan.style";
        settings.retain(|setting| !old(setting));
        settings.push((&*change.key, change.value.as_deref().ok_or("a value")?));
    }
    let scene = Scene::parse_with("", "scene", &settings)?;
    Ok(Scene { seed, ..scene })
}

/// Returns the mean readability over the test seeds, with 0 for a lost drone.
fn mean(scene: &Scene) -> Outcome<f64> {
    let mut sum = 0.0;
    for seed in SEEDS {
        let mut shoot = Shoot::new(Scene { seed, ..scene.clone() })?;
        shoot.judging = Judging::Scored;
        shoot.backend = noctograph::expose::BackendChoice::Cpu;
        sum += match shoot.take(&|_, _| {}) {
            Ok(shot) => shot.verdict.map_or(0.0, |verdict| verdict.readability),
            Err(Error::Infeasible { .. }) => 0.0,
            Err(error) => return Err(error.into()),
        };
    }
    Ok(sum / SEEDS.len() as f64)
}
