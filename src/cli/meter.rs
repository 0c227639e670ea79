//! `noctograph meter`: the exposure of each lamp, and the settings that mend it.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::advice::mentioned;
use super::flags::{FlightFlags, SubjectFlags};
use super::outcome::{Report, wrapped};
use super::picture::PictureFlags;
use super::progress::watch;
use super::table::table;
use super::warn;
use crate::camera::Camera;
use crate::error::Result;
use crate::expose::meter::{ExposureAdvice, HotSpot, LampReading, floor_stops, meter};
use crate::shoot::{Metered, in_stops};

#[derive(Debug, Args)]
pub(super) struct MeterArgs {
    #[command(flatten)]
    subject: SubjectFlags,
    /// Flights, logs or light traces (t,x,y,z,r,g,b) to measure instead of a simulation, one for
    /// each drone
    #[arg(long, value_name = "FILE", num_args = 1..)]
    flight: Vec<PathBuf>,
    #[command(flatten)]
    flights: FlightFlags,
    #[command(flatten)]
    picture: PictureFlags,
    /// Exposure wanted in the middle of the trail, in stops over saturation [default: that of the
    /// exposure that `preview` sets]
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true)]
    target_stops: Option<f64>,
}

pub(super) fn run(args: &MeterArgs) -> Result<Report> {
    if let Some(stops) = args.target_stops {
        crate::error::within("target_stops", stops, -30.0, 30.0)?;
    }
    let shoot = match args.flight.as_slice() {
        [] => args.subject.shoot(|scene| args.picture.apply(scene))?,
        paths => {
            let mut scene = args.subject.scene()?;
            args.picture.apply(&mut scene)?;
            args.flights.shoot(scene, args.subject.typed_word(), paths, false)?
        }
    };
    let scene = shoot.scene.clone();
    let lighting = shoot.lighting(&watch())?;
    let warnings = lighting.problems.iter().filter(|problem| !problem.is_obstacle());
    warn(warnings.map(|problem| problem.sentence(mentioned)));
    let readings = meter(&lighting.trace, &lighting.camera)?;
    let recommended = lighting.recommended(&scene);
    let metered = Found {
        ambient_stops: scene.photo.ambient_stops(&lighting.camera),
        floor_stops: floor_stops(&lighting.trace, &lighting.camera, &scene.expose),
        target_stops: args.target_stops.or(recommended.map(|it| it.trail_stops)).unwrap_or(0.0),
        recommended: recommended.filter(|_| args.target_stops.is_none()),
        camera: lighting.camera,
        fixed_aperture: scene.camera.body.fixed_lens().is_some(),
        readings,
    };
    Ok(Report::new(text_of(&metered), json(&metered)))
}

/// Exposures of the lamps, of the room and of the floor.
struct Found {
    camera: Camera,
    readings: Vec<LampReading>,
    /// Whether the aperture cannot be set.
    fixed_aperture: bool,
    /// What the light meter recommends; `None` where another exposure is wanted.
    recommended: Option<Metered>,
    /// Exposure that is wanted in the middle of a trail, stops over saturation.
    target_stops: f64,
    /// Stops over saturation of the room in the middle of the picture; `None`: dark.
    ambient_stops: Option<f64>,
    /// Stops over saturation of the floor where it is brightest; `None`: dark.
    floor_stops: Option<f64>,
}

fn text_of(metered: &Found) -> String {
    let Found { camera, target_stops, ambient_stops, floor_stops, .. } = metered;
    let readings = &grouped(&metered.readings);
    let Camera { focal_length_m, f_number, iso, .. } = camera;
    let mut text = wrapped("", &in_one_sentence(metered));
    text += &format!(
        "\n{} mm, f/{f_number}, ISO {iso}: saturation at {:.3} lx s\n\n\
         stops over saturation, along the trail\n",
        focal_length_m * 1000.0,
        camera.saturation_lx_s()
    );
    let row = |reading: &LampReading| {
        let LampReading { lit_s, median_stops: middle, p5_stops, p95_stops, streak_s, .. } =
            reading;
        let (name, uneven) = (cut(&reading.name), reading.evenness_stops());
        format!(
            "{name}\t{lit_s:.1}\t{middle:+.1}\t{p5_stops:+.1}\t{p95_stops:+.1}\t{uneven:.1}\t\
             {streak_s:.1}"
        )
    };
    let surfaces =
        [("ambient", ambient_stops, "in the picture's middle"), ("floor", floor_stops, "at most")];
    let surfaces = surfaces.map(|(name, stops, place)| {
        let stops = stops.map_or("dark".to_owned(), |stops| format!("{stops:+.1} {place}"));
        format!("{name}\t\t {stops:>9}")
    });
    let head = "lamp<18|lit s>8|median>10|5 %>9|95 %>9|uneven>9|streaks s>11";
    text += &table(head, readings.iter().map(row).chain(surfaces));
    text += &format!("\nto put the middle of a lamp's trail at {target_stops:+.1} stops, one of\n");
    let row = |reading: &LampReading| {
        let ExposureAdvice { f_number, iso, level } = reading.advice(camera, *target_stops);
        let iso = iso.map_or("-".to_owned(), |iso| format!("{iso:.0}"));
        let level = level.map_or("-".to_owned(), |level| format!("{level:.3}"));
        let aperture = match metered.fixed_aperture {
            true => "-".to_owned(),
            false => format!("f/{f_number:.1}"),
        };
        format!("{}\t{aperture}\t{iso}\t{level}", cut(&reading.name))
    };
    text += &table("lamp<18|aperture>10|ISO>10|level times>14", readings.iter().map(row));
    let spots = readings.iter().flat_map(|r| r.hot_spots.iter().map(move |spot| (r, spot)));
    // What stays under saturation leaves no blob, however long the lamp lingers.
    let mut spots: Vec<_> = spots.filter(|(_, spot)| spot.stops > 0.0).collect();
    spots.sort_by(|(_, a), (_, b)| b.stops.total_cmp(&a.stops));
    if !spots.is_empty() {
        text += "\nhot spots (two stops over the middle, saturated): the lamp lingers there, or\nfaces the camera\n";
    }
    let rows = spots.iter().take(MOST_SPOTS).map(|(reading, spot)| {
        let (name, HotSpot { time_s, duration_s, at_px: [x, y], stops }) =
            (cut(&reading.name), spot);
        format!("{name}\t{time_s:.2}\t{duration_s:.2}\t{x:.0},{y:.0}\t{stops:+.1}")
    });
    text += &table("lamp<18|from s>10|for s>8|at pixel>11|stops>10", rows);
    if spots.len() > MOST_SPOTS {
        text += &format!("and {} more (--json has them all)\n", spots.len() - MOST_SPOTS);
    }
    text
}

/// As much of a lamp's name as its column holds.
fn cut(name: &str) -> String {
    name.chars().take(18).collect()
}

/// What to set for the brightest trail.
fn in_one_sentence(figures: &Found) -> String {
    let brightest = |a: &&LampReading, b: &&LampReading| a.median_stops.total_cmp(&b.median_stops);
    let Some(lamp) = figures.readings.iter().max_by(brightest) else {
        return "No lamp is lit in the picture.".into();
    };
    let (name, camera) = (&lamp.name, &figures.camera);
    let now = in_stops(lamp.median_stops);
    if let Some(metered) = figures.recommended {
        let Metered { f_number, iso, trail_stops, room_stops, gave_way, .. } = metered;
        let room = room_stops.map_or_else(|| "dark".to_owned(), in_stops);
        let gave_way =
            if gave_way { ": darker than wanted, so that the room stays dark" } else { "" };
        let trail = in_stops(trail_stops);
        let help = metered.help().map_or_else(String::new, |help| format!(" Besides, {help}."));
        if (f_number, iso) == (camera.f_number, camera.iso) {
            let right = if metered.filter_stops > 0 { "the nearest it has" } else { "right" };
            return format!(
                "f/{f_number} and ISO {iso} are {right}: the ambient light is {room}, the \
                 brightest trail ({name}) {trail}{gave_way}.{help}"
            );
        }
        return format!(
            "The brightest trail ({name}) is {now}: set f/{f_number} and ISO {iso}. The ambient \
             light is then {room}, the trail {trail}{gave_way}.{help}"
        );
    }
    let wanted = in_stops(figures.target_stops);
    let advice = lamp.advice(camera, figures.target_stops);
    let iso = advice.iso.map(|iso| format!("ISO {iso:.0}"));
    let aperture = (!figures.fixed_aperture).then(|| format!("f/{:.1}", advice.f_number));
    let ways: Vec<String> = aperture.into_iter().chain(iso).collect();
    match ways.is_empty() {
        true => format!("The brightest trail ({name}) is {now}: it takes a neutral filter."),
        false => format!(
            "The brightest trail ({name}) is {now}: set {} for {wanted}.",
            ways.join(" or ")
        ),
    }
}

/// The readings with the LEDs of a ring as one row, that of the brightest.
fn grouped(readings: &[LampReading]) -> Vec<LampReading> {
    let group = |reading: &LampReading| {
        let (group, led) = reading.name.rsplit_once(' ')?;
        led.parse::<u8>().ok()?;
        group.ends_with("ring").then(|| format!("{group}, brightest"))
    };
    let mut rows: Vec<LampReading> = Vec::new();
    for reading in readings {
        let Some(name) = group(reading) else {
            rows.push(reading.clone());
            continue;
        };
        match rows.iter_mut().find(|row| row.name == name) {
            Some(row) if row.median_stops >= reading.median_stops => {}
            Some(row) => *row = LampReading { name, ..reading.clone() },
            None => rows.push(LampReading { name, ..reading.clone() }),
        }
    }
    rows
}

/// Hot spots that a table lists.
const MOST_SPOTS: usize = 20;

fn json(metered: &Found) -> Value {
    let Found {
        camera,
        recommended,
        target_stops,
        ambient_stops,
        floor_stops,
        readings,
        fixed_aperture,
    } = metered;
    let lamp = |reading: &LampReading| {
        let mut lamp = json!(reading);
        lamp["evenness_stops"] = reading.evenness_stops().into();
        lamp["advice"] = json!(reading.advice(camera, *target_stops));
        if *fixed_aperture {
            lamp["advice"]["f_number"] = Value::Null;
        }
        lamp
    };
    json!({
        "saturation_lx_s": camera.saturation_lx_s(), "target_stops": target_stops,
        "lamps": readings.iter().map(lamp).collect::<Vec<_>>(), "f_number": camera.f_number,
        "iso": camera.iso, "recommended": recommended, "ambient_stops": ambient_stops,
        "floor_stops": floor_stops,
    })
}
