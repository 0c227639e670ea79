//! `noctograph meter`: the exposure of each lamp, and the settings that mend it.

use std::path::PathBuf;

use super::advice::mentioned;
use super::{
    Args, FlightFlags, PictureFlags, Report, Result, SubjectFlags, Value, json, table, warn, watch,
    wrapped,
};
use crate::camera::Camera;
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
            let mut scene = args.subject.scene_of(paths)?;
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
    let lamps = metered.readings.iter().map(|reading| {
        let mut lamp = json!(reading);
        lamp["evenness_stops"] = reading.evenness_stops().into();
        lamp["advice"] = json!(reading.advice(&metered.camera, metered.target_stops));
        if metered.fixed_aperture {
            lamp["advice"]["f_number"] = Value::Null;
        }
        lamp
    });
    let json = json!({
        "saturation_lx_s": metered.camera.saturation_lx_s(), "f_number": metered.camera.f_number,
        "iso": metered.camera.iso, "target_stops": metered.target_stops,
        "recommended": metered.recommended, "ambient_stops": metered.ambient_stops,
        "floor_stops": metered.floor_stops, "lamps": lamps.collect::<Vec<_>>(),
    });
    Ok(Report::new(text_of(&metered), json))
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

/// Hot spots that a table lists.
const MOST_SPOTS: usize = 20;

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
    // Names are cut where they fill their column.
    let row = |reading: &LampReading| {
        let LampReading { name, lit_s, median_stops, p5_stops, p95_stops, streak_s, .. } = reading;
        let uneven = reading.evenness_stops();
        format!(
            "{name:.18}\t{lit_s:.1}\t{median_stops:+.1}\t{p5_stops:+.1}\t{p95_stops:+.1}\t\
             {uneven:.1}\t{streak_s:.1}"
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
        let f_number = Some(f_number).filter(|_| !metered.fixed_aperture);
        let cells = [
            f_number.map(|f_number| format!("f/{f_number:.1}")),
            iso.map(|iso| format!("{iso:.0}")),
            level.map(|level| format!("{level:.3}")),
        ];
        let [aperture, iso, level] = cells.map(|cell| cell.unwrap_or_else(|| "-".to_owned()));
        format!("{:.18}\t{aperture}\t{iso}\t{level}", reading.name)
    };
    text += &table("lamp<18|aperture>10|ISO>10|level times>14", readings.iter().map(row));
    let spots = readings.iter().flat_map(|r| r.hot_spots.iter().map(move |spot| (&r.name, spot)));
    // What stays under saturation leaves no blob, however long the lamp lingers.
    let mut spots: Vec<_> = spots.filter(|(_, spot)| spot.stops > 0.0).collect();
    spots.sort_by(|(_, a), (_, b)| b.stops.total_cmp(&a.stops));
    if !spots.is_empty() {
        text += "\nhot spots (two stops over the middle, saturated): the lamp lingers there, or\nfaces the camera\n";
    }
    let rows = spots.iter().take(MOST_SPOTS).map(|(name, spot)| {
        let HotSpot { time_s, duration_s, at_px: [x, y], stops } = spot;
        format!("{name:.18}\t{time_s:.2}\t{duration_s:.2}\t{x:.0},{y:.0}\t{stops:+.1}")
    });
    text += &table("lamp<18|from s>10|for s>8|at pixel>11|stops>10", rows);
    if spots.len() > MOST_SPOTS {
        text += &format!("and {} more (--json has them all)\n", spots.len() - MOST_SPOTS);
    }
    text
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
    let advice = match ways.is_empty() {
        true => "it takes a neutral filter".to_owned(),
        false => format!("set {} for {wanted}", ways.join(" or ")),
    };
    format!("The brightest trail ({name}) is {now}: {advice}.")
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
        let ring = group(reading);
        let row = LampReading {
            name: ring.clone().unwrap_or_else(|| reading.name.clone()),
            ..reading.clone()
        };
        match rows.iter_mut().find(|row| ring.as_ref() == Some(&row.name)) {
            Some(brightest) if brightest.median_stops >= row.median_stops => {}
            Some(brightest) => *brightest = row,
            None => rows.push(row),
        }
    }
    rows
}
