//! `noctograph meter` measures the exposure of each lamp, and suggests settings that correct it.

use std::path::PathBuf;

use super::advice::mentioned;
use super::flags::SubjectFlags;
use super::flight_flags::{FlightFlags, LogLights};
use super::outcome::Report;
use super::picture::PictureFlags;
use super::progress::watch;
use super::terminal::warn;
use crate::camera::Camera;
use crate::error::Result;
use crate::expose::meter::{LampReading, floor_stops, meter};
use crate::shoot::{Metered, Shoot};
use clap::Args;
use serde_json::{Value, json};

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
    /// Desired exposure at the median of the trail, in stops over saturation [default: that of the
    /// exposure that `preview` sets]
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true)]
    target_stops: Option<f64>,
}

/// Runs the verb `meter`, which reports the exposure of each lamp's trail in stops relative to
/// saturation, and recommends camera settings.
pub(super) fn run(args: &MeterArgs) -> Result<Report> {
    if let Some(stops) = args.target_stops {
        crate::error::within("target_stops", stops, -MOST_STOPS, MOST_STOPS)?;
    }
    let shoot = shoot(args)?;
    let scene = shoot.scene.clone();
    let lighting = shoot.lighting(&watch())?;
    let warnings = lighting.problems.iter().filter(|problem| !problem.is_stop());
    warn(warnings.map(|problem| problem.sentence(mentioned)));
    let readings = meter(&lighting.trace, &lighting.camera)?;
    let recommended = lighting.recommended(&scene);
    let trail_stops = recommended.map(|settings| settings.trail_stops);
    // A target that was typed replaces the recommendation of the light meter.
    let advisor = Advisor {
        camera: &lighting.camera,
        has_fixed_aperture: scene.camera.body.fixed_lens().is_some(),
        target_stops: args.target_stops.or(trail_stops).unwrap_or(0.0),
        recommended: recommended.filter(|_| args.target_stops.is_none()),
    };
    let Camera { f_number, iso, .. } = lighting.camera;
    let product = json!({
        "saturation_lx_s": lighting.camera.saturation_lx_s(), "f_number": f_number, "iso": iso,
        "target_stops": advisor.target_stops, "recommended": advisor.recommended,
        "ambient_stops": scene.photo.ambient_stops(&lighting.camera),
        "floor_stops": floor_stops(&lighting.trace, &lighting.camera, &scene.expose),
        "lamps": advisor.described(&readings),
    });
    let words = advisor.words(&product, &grouped(&readings));
    Ok(Report::with_words(product, &words, LAYOUT))
}

/// Returns the shoot of the flights that are named, or else of the word or the plans.
fn shoot(args: &MeterArgs) -> Result<Shoot> {
    if args.flight.is_empty() {
        return args.subject.shoot(|scene| args.picture.apply(scene), &|_| Ok(()));
    }
    let mut scene = args.subject.scene_of(&args.flight)?;
    args.picture.apply(&mut scene)?;
    args.flights.shoot(scene, args.subject.typed_word()?, &args.flight, LogLights::Inferred)
}

/// Advice on the exposure of lamps.
struct Advisor<'a> {
    camera: &'a Camera,
    /// True for a lens without an adjustable aperture, for which no f-number is suggested.
    has_fixed_aperture: bool,
    /// Desired exposure of the middle of a trail, in stops over saturation.
    target_stops: f64,
    /// Settings of the light meter, which replace advice on single lamps. `None` if the user typed
    /// a target, or if there is no light.
    recommended: Option<Metered>,
}

impl Advisor<'_> {
    /// Returns each lamp's reading as JSON, with its unevenness and the advice for it.
    fn described(&self, readings: &[LampReading]) -> Vec<Value> {
        let lamps = readings.iter().map(|reading| {
            let mut lamp = json!(reading);
            lamp["evenness_stops"] = reading.evenness_stops().into();
            lamp["advice"] = json!(reading.advice(self.camera, self.target_stops));
            if self.has_fixed_aperture {
                lamp["advice"]["f_number"] = Value::Null;
            }
            lamp
        });
        lamps.collect()
    }

    /// Returns the settings for the brightest lamp as text, or `None` if the light meter recommends
    /// settings for all lamps. If no setting is dark enough, a neutral-density filter is suggested.
    fn settings(&self, brightest: Option<&LampReading>) -> Option<String> {
        let brightest = brightest.filter(|_| self.recommended.is_none())?;
        let advice = brightest.advice(self.camera, self.target_stops);
        let aperture = (!self.has_fixed_aperture).then(|| format!("f/{:.1}", advice.f_number));
        let iso = advice.iso.map(|iso| format!("ISO {iso:.0}"));
        let settings: Vec<String> = aperture.into_iter().chain(iso).collect();
        Some(if settings.is_empty() {
            "a neutral-density filter".to_owned()
        } else {
            settings.join(" or ")
        })
    }

    /// Returns the values that appear only in the text. `readings` has a single reading for all
    /// LEDs of a ring.
    fn words(&self, product: &Value, readings: &[LampReading]) -> Value {
        let brightest = readings.iter().max_by(|a, b| a.median_stops.total_cmp(&b.median_stops));
        let spots = hot_spots(readings);
        let rows = self.described(readings);
        // The table also contains rows for the ambient light and the floor, which have only a
        // median.
        let surfaces =
            [("ambient", "ambient_stops"), ("floor", "floor_stops")].map(|(name, key)| {
                json!({
                    "name": name, "median_stops": product[key], "lit_s": null, "p5_stops": null,
                    "p95_stops": null, "evenness_stops": null, "streak_s": null,
                })
            });
        let trails: Vec<&Value> = rows.iter().chain(&surfaces).collect();
        let camera_settings = [self.camera.f_number, self.camera.iso];
        let recommended = self.recommended;
        json!({
            "brightest": brightest, "settings": self.settings(brightest),
            "focal_length_m": self.camera.focal_length_m,
            "is_set": recommended.is_some_and(|it| [it.f_number, it.iso] == camera_settings),
            "help": recommended.and_then(|it| it.help()),
            "why": recommended.filter(|it| it.keeps_room_dark).map(|_| "so that the room stays dark"),
            "rows": rows, "trails": trails,
            "any_spots": spots.first().map(|_| "hot spots"),
            "spots": spots.get(..MOST_SPOTS).unwrap_or(&spots),
            "more": Some(spots.len().saturating_sub(MOST_SPOTS)).filter(|n| *n > 0),
        })
    }
}

/// Maximum number of hot spots in the table.
const MOST_SPOTS: usize = 20;
/// Largest distance of a target from saturation, in stops. At 30 stops, a factor of 10⁹, no camera
/// records anything.
const MOST_STOPS: f64 = 30.0;

const LAYOUT: &str = "\
brightest\t{brightest.name}: {brightest.median_stops:+.1} stops over saturation
set       f/{recommended.f_number} and ISO {recommended.iso}{is_set?, as they are:}: trail {recommended.trail_stops:+.1}, ambient light {recommended.room_stops:+.1~dark} stops[: darker than wanted, {why}][; {help}]
set       {settings} for {target_stops:+.1} stops

{focal_length_m*1000} mm, f/{f_number}, ISO {iso}: saturation at {saturation_lx_s:.3} lx s

stops over saturation, along the trail
|trails|lamp<18|lit s>8|median>10|5 %>9|95 %>9|uneven>9|streaks s>11
{name:.18}|{lit_s:.1}|{median_stops:+.1~dark}|{p5_stops:+.1}|{p95_stops:+.1}|{evenness_stops:.1}|{streak_s:.1}

to put the median of a lamp's trail at {target_stops:+.1} stops, use one of
|rows|lamp<18|aperture>10|ISO>10|level times>14
{name:.18}|f/{advice.f_number:.1}|{advice.iso:.0}|{advice.level_factor:.3}

{any_spots} (two stops above the median, saturated): the lamp lingers there, or faces the camera
|spots|lamp<18|from s>10|for s>8|at pixel>11|stops>10
{name:.18}|{time_s:.2}|{duration_s:.2}|{at_px.0:.0},{at_px.1:.0}|{stops:+.1}
and {more} more (--json lists all)
";

/// Returns the hot spots above saturation as JSON with the names of their lamps, brightest first. A
/// spot below saturation is left out, because it shows no blob.
fn hot_spots(readings: &[LampReading]) -> Vec<Value> {
    let spots = readings.iter().flat_map(|r| r.hot_spots.iter().map(move |spot| (&r.name, spot)));
    let mut spots: Vec<_> = spots.filter(|(_, spot)| spot.stops > 0.0).collect();
    spots.sort_by(|(_, a), (_, b)| b.stops.total_cmp(&a.stops));
    let spot = |(name, spot)| {
        let mut json = json!(spot);
        json["name"] = json!(name);
        json
    };
    spots.into_iter().map(spot).collect()
}

/// Returns the readings in their order, with those of a ring's LEDs replaced by that of the LED
/// with the largest median exposure.
fn grouped(readings: &[LampReading]) -> Vec<LampReading> {
    /// Returns the name of the row for an LED of a ring, such as `ring, brightest`, or `None` for
    /// other lamps.
    fn group(reading: &LampReading) -> Option<String> {
        let (group, led) = reading.name.rsplit_once(' ')?;
        led.parse::<u8>().ok()?;
        group.ends_with("ring").then(|| format!("{group}, brightest"))
    }
    // LEDs of one ring are recognized by their names, which differ only in the number.
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
