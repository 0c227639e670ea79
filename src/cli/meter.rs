//! `noctograph meter`: how the lamps of a flight are exposed, and what to set.

use std::path::PathBuf;

use clap::Args;

use super::inputs::{PictureFlags, SceneFlags, recorded, tell_all, type_word, watch};
use super::{Outcome, print};
use crate::camera::Camera;
use crate::error::Result;
use crate::expose::meter::{Reading, floor_stops, meter};
use crate::scene::Scene;
use crate::shoot::{Lighting, Shoot};

#[derive(Debug, Args)]
pub(super) struct MeterArgs {
    /// Word to plan, fly and measure; the scene's where it is left out
    word: Option<String>,
    /// Flight or light trace (t,x,y,z,r,g,b) to measure instead of flying the word; one for each
    /// drone
    #[arg(long, value_name = "FILE")]
    flight: Vec<PathBuf>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    picture: PictureFlags,
    /// Where the middle of the trail should be, in stops over saturation
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true)]
    target_stops: f64,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &MeterArgs) -> Result<Outcome> {
    crate::error::within("--target-stops", args.target_stops, -30.0, 30.0)?;
    let mut scene = args.scene.load()?;
    args.picture.apply(&mut scene)?;
    let found = read(args, &mut scene)?;
    if args.json {
        print(&format!("{}\n", json(&found, args.target_stops)))?;
    } else {
        print(&table(&found, args.target_stops))?;
    }
    Ok(Outcome::Done)
}

/// What the meter found.
struct Found {
    camera: Camera,
    readings: Vec<Reading>,
    /// Room in the picture's middle, and the floor where it is brightest, in stops over saturation.
    ambient_stops: Option<f64>,
    floor_stops: Option<f64>,
}

fn read(args: &MeterArgs, scene: &mut Scene) -> Result<Found> {
    type_word(scene, args.word.as_deref());
    let shoot = match args.flight.as_slice() {
        [] => Shoot::new(scene.clone())?,
        paths => recorded(scene.clone(), paths)?,
    };
    let Lighting { trace, camera, warnings, .. } = shoot.lighting(&watch())?;
    tell_all(&warnings);
    let readings = meter(&trace, &camera)?;
    let ambient_stops = scene.photo.ambient_stops(&camera);
    let floor_stops = floor_stops(&trace, &camera, &scene.expose);
    Ok(Found { camera, readings, ambient_stops, floor_stops })
}

fn table(found: &Found, target_stops: f64) -> String {
    let Found { camera, readings, ambient_stops, floor_stops } = found;
    let Camera { focal_length_m, f_number, iso, .. } = camera;
    let mut text = format!(
        "{} mm, f/{f_number}, ISO {iso}: saturation at {:.3} lx s\n\n\
         stops over saturation, along the trail\n\
         lamp                 lit s    median      5 %     95 %   uneven  streaks s\n",
        focal_length_m * 1000.0,
        camera.saturation_lx_s()
    );
    for reading in readings {
        let Reading { name, lit_s, median_stops, p5_stops, p95_stops, streak_s, .. } = reading;
        let name: String = name.chars().take(18).collect();
        text += &format!(
            "{name:18} {lit_s:7.1} {median_stops:+9.1} {p5_stops:+8.1} {p95_stops:+8.1} {:8.1} \
             {streak_s:10.1}\n",
            reading.evenness_stops()
        );
    }
    let surfaces =
        [("room", ambient_stops, "in the picture's middle"), ("floor", floor_stops, "at most")];
    for (name, stops, place) in surfaces {
        let stops = stops.map_or("dark".to_owned(), |stops| format!("{stops:+.1} {place}"));
        text += &format!("{name:18}         {stops:>9}\n");
    }
    text += &format!("\nto put the middle of the trail at {target_stops:+.1} stops, one of\n");
    text += "lamp                aperture       ISO   level now x\n";
    for reading in readings {
        let advice = reading.advice(camera, target_stops);
        let name: String = reading.name.chars().take(18).collect();
        let aperture = format!("f/{:.1}", advice.f_number);
        text += &format!("{name:18} {aperture:>9} {:9.0} {:13.3}\n", advice.iso, advice.level);
    }
    let spots = readings.iter().flat_map(|r| r.hot_spots.iter().map(move |spot| (r, spot)));
    // What stays under saturation leaves no blob, however long the lamp lingers.
    let mut spots: Vec<_> = spots.filter(|(_, spot)| spot.stops > 0.0).collect();
    spots.sort_by(|(_, a), (_, b)| b.stops.total_cmp(&a.stops));
    if !spots.is_empty() {
        text += "\nhot spots (saturated, two stops over the middle): the lamp is lit and lingers\n";
        text += "lamp                  from s   for s   at pixel     stops\n";
    }
    for (reading, spot) in spots.iter().take(MOST_SPOTS) {
        let name: String = reading.name.chars().take(18).collect();
        let [x, y] = spot.at_px;
        let place = format!("{x:.0},{y:.0}");
        text += &format!(
            "{name:18} {:9.2} {:7.2} {place:>10} {:+9.1}\n",
            spot.time_s, spot.duration_s, spot.stops
        );
    }
    if spots.len() > MOST_SPOTS {
        text += &format!("and {} more (--json has them all)\n", spots.len() - MOST_SPOTS);
    }
    text
}

/// Hot spots that a table lists.
const MOST_SPOTS: usize = 20;

fn json(found: &Found, target_stops: f64) -> serde_json::Value {
    let Found { camera, readings, ambient_stops, floor_stops } = found;
    let lamps: Vec<_> = readings
        .iter()
        .map(|reading| {
            let advice = reading.advice(camera, target_stops);
            let spots: Vec<_> = reading
                .hot_spots
                .iter()
                .map(|spot| {
                    serde_json::json!({
                        "time_s": spot.time_s, "duration_s": spot.duration_s,
                        "at_px": spot.at_px, "stops": spot.stops,
                    })
                })
                .collect();
            serde_json::json!({
                "name": reading.name,
                "lit_s": reading.lit_s,
                "median_stops": reading.median_stops,
                "p5_stops": reading.p5_stops,
                "p95_stops": reading.p95_stops,
                "evenness_stops": reading.evenness_stops(),
                "streak_s": reading.streak_s,
                "hot_spots": spots,
                "advice": {
                    "f_number": advice.f_number, "iso": advice.iso, "level_factor": advice.level,
                },
            })
        })
        .collect();
    serde_json::json!({
        "saturation_lx_s": camera.saturation_lx_s(), "target_stops": target_stops, "lamps": lamps,
        "ambient_stops": ambient_stops, "floor_stops": floor_stops,
    })
}
