//! Makes the tables and pictures of docs/cooperative.md, which show the errors of drones that use
//! three common anchors.
//!
//! ```sh
//! cargo run --release --example cooperation -- setups 64     # who measures what, 64 flights each
//! cargo run --release --example cooperation -- fleets 16     # two to six drones, 16 flights each
//! cargo run --release --example cooperation -- photos 3 OUT  # the photo of seed 3 of each setup
//! ```

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use image::RgbImage;
use noctograph::expose::BackendChoice;
use noctograph::flight::ESTIMATE_NEES;
use noctograph::scene::Scene;
use noctograph::shoot::{Judging, Recording, Shoot};
use noctograph::sim::{bounds, writing_sigma_m};
use rayon::prelude::*;

type Outcome<T> = Result<T, Box<dyn Error + Send + Sync>>;

/// Name of a setup, its scene, and the settings of the scene.
type Setup = (&'static str, &'static str, &'static [(&'static str, &'static str)]);

const LINKS: &str = "two-drones-three-anchors";
const FLOOR: &str = "two-drones-three-anchors-and-floor";
const SETUPS: [Setup; 8] = [
    ("five links", LINKS, &[]),
    ("a floor ranger on each drone", FLOOR, &[]),
    (
        "a barometer on each drone",
        LINKS,
        &[
            ("sensors.heights", "[\"barometer\"]"),
            ("sensors.barometer.drift_m_sqrt_s", "0.0"),
            ("observer.ekf.barometer_sigma_m", "0.09"),
        ],
    ),
    ("two drones that range to all anchors and each other", LINKS, &[("sensors.uwb.heard", "[]")]),
    ("rangers, half of the messages lost", FLOOR, &[("sensors.peers.loss_frac", "0.5")]),
    (
        "three drones that range to all anchors and each other",
        LINKS,
        &[("sensors.uwb.heard", "[]"), ("plan.drones", "3")],
    ),
    ("rangers, all messages lost", FLOOR, &[("observer.cooperative.share", "nothing")]),
    ("rangers, estimates shared", FLOOR, &[("observer.cooperative.share", "estimates")]),
];

/// Position error in m. A filter whose error ever exceeds it counts as astray.
const ASTRAY_M: f64 = 0.5;

/// Result of a fleet's flight.
#[derive(Default)]
struct Flown {
    /// True if a drone was lost, or a filter went astray.
    astray: bool,
    /// Mean square of the position error over lit samples after 2 s, in m².
    square_m2: f64,
    /// Mean normalized estimation error squared, divided by three.
    nees: f64,
    legible: bool,
}

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    match words[..] {
        ["setups", n] => {
            print_out(&heading("who measures what", n));
            SETUPS.iter().try_for_each(|(name, scene, set)| row(name, scene, set, n.parse()?))
        }
        ["fleets", n] => {
            print_out(&heading("drones", n));
            (2..=6).try_for_each(|drones| {
                let drones = drones.to_string();
                // Every drone writes at least one letter, so the word contains one for each.
                let set = [
                    ("word", "NOORNOOR"),
                    ("plan.drones", drones.as_str()),
                    ("sensors.uwb.heard", "[]"),
                ];
                row(&drones, LINKS, &set, n.parse()?)
            })
        }
        ["photos", seed, folder] => photos(seed.parse()?, Path::new(folder)),
        _ => Err("wanted: setups N, fleets N, or photos SEED FOLDER".into()),
    }
}

fn shoot(scene: &str, set: &[(&str, &str)]) -> Outcome<Shoot> {
    let scene = Scene::find(scene, set)?.scene;
    Ok(Shoot { judging: Judging::Scored, backend: BackendChoice::Cpu, ..Shoot::new(scene)? })
}

fn seeded(shoot: &Shoot, seed: u64) -> Shoot {
    Shoot { scene: Scene { seed, ..shoot.scene.clone() }, ..shoot.clone() }
}

/// Returns the header of a table in the form of docs/cooperative.md.
fn heading(what: &str, n_flights: &str) -> String {
    format!(
        "| {what} | error | bound | NEES/3 | astray, legible of {n_flights} |\n|---|---|---|---|---|"
    )
}

/// Prints the row of a table: the error, bound and consistency over the flights whose filters did
/// not go astray, the number of flights that did, and the number of legible photos.
fn row(name: &str, scene: &str, set: &[(&str, &str)], n_flights: u64) -> Outcome<()> {
    let shoot = shoot(scene, set)?;
    let plans: Vec<_> = shoot.plans.iter().map(|planned| &planned.plan).collect();
    let bound_m = writing_sigma_m(&bounds(&plans, &shoot.scene.sim())?, None).unwrap_or(f64::NAN);
    let flown: Outcome<Vec<Flown>> =
        (0..n_flights).into_par_iter().map(|seed| fly(&seeded(&shoot, seed))).collect();
    let flown = flown?;
    let (astray, sound): (Vec<&Flown>, Vec<&Flown>) = flown.iter().partition(|one| one.astray);
    let (astray, n) = (astray.len(), sound.len() as f64);
    let error_m = (sound.iter().map(|one| one.square_m2).sum::<f64>() / n).sqrt();
    let nees = sound.iter().map(|one| one.nees).sum::<f64>() / n;
    let legible = flown.iter().filter(|one| one.legible).count();
    let mut unread = String::new();
    for (seed, _) in flown.iter().enumerate().filter(|(_, one)| !one.legible) {
        write!(unread, " {seed}")?;
    }
    let (error_cm, bound_cm) = (100.0 * error_m, 100.0 * bound_m);
    print_out(&format!(
        "| {name} | {error_cm:.1} cm | {bound_cm:.1} | {nees:.2} | {astray}, {legible} |"
    ));
    if flown.len() <= 16 {
        print_out(&format!("seeds with illegible photos:{unread}"));
    }
    Ok(())
}

fn fly(shoot: &Shoot) -> Outcome<Flown> {
    let flights = match shoot.fly(&|_, _| {}) {
        Err(noctograph::error::Error::Infeasible { .. }) => {
            return Ok(Flown { astray: true, ..Flown::default() });
        }
        flown => flown?,
    };
    let (mut square_m2, mut nees, mut n, mut astray) = (0.0, 0.0, 0.0, false);
    for flight in &flights {
        let light = flight.lights.values().next().ok_or("a drone has a lamp")?;
        for (i, sample) in flight.samples.iter().enumerate() {
            let error_m = (sample.estimate_m - sample.position_m).norm();
            astray |= error_m > ASTRAY_M;
            if sample.time_s > 2.0 && light[i] > 0.0 {
                square_m2 += error_m * error_m;
                nees += flight.extra[ESTIMATE_NEES][i];
                n += 1.0;
            }
        }
    }
    let recordings = flights.into_iter().map(Recording::Flight).collect();
    let shot = Shoot { recordings, ..shoot.clone() }.take(&|_, _| {})?;
    let legible = shot.verdict.is_some_and(|verdict| verdict.legible);
    Ok(Flown { astray, square_m2: square_m2 / n, nees: nees / n, legible })
}

/// Writes a photo of each setup, named after the setup.
fn photos(seed: u64, folder: &Path) -> Outcome<()> {
    std::fs::create_dir_all(folder)?;
    for (number, (name, scene, set)) in SETUPS.iter().enumerate() {
        let photo = seeded(&shoot(scene, set)?, seed).take(&|_, _| {})?.photo;
        let picture = RgbImage::from_raw(photo.width_px, photo.height_px, photo.into_data().rgb8);
        let file = folder.join(format!("{} {name}.png", number + 1));
        picture.ok_or("three bytes a pixel")?.save(file)?;
    }
    Ok(())
}

#[expect(clippy::print_stdout, reason = "an example's result")]
fn print_out(text: &str) {
    println!("{text}");
}
