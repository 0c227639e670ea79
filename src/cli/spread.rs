//! The ensemble of a preview, which consists of many flights under varied conditions, with their
//! photos and bands.

use super::outcome::Report;
use super::output::OutputFolder;
use super::studies::counter;
use super::terminal::warn;
use crate::error::Result;
use crate::photo::{self, Photo};
use crate::report::{spread_front, spread_over_time, spread_sheet};
use crate::shoot::Shoot;
use crate::studies::statistics::median;
use crate::studies::{BAND_FRAC, Band, Conditions, LEAST_FLIGHTS, Spread, SpreadFlight, spread};
use clap::Args;
use serde_json::{Value, json};

#[derive(Debug, Args)]
pub(super) struct SpreadFlags {
    /// Fly N more times under --conditions, and draw the band that contains 90 % of the flights
    /// (all flights if there are fewer than 19), and the photos with their verdicts (spread.svg,
    /// spread-xz.svg, spread.png)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(2..=1000))]
    spread: Option<u16>,
    /// Conditions under which the flights of --spread vary: room (the scene's drone in varied rooms
    /// and evenings), drone (also varied drones of the same model), evening (like room, with faults
    /// of radio, heading, propeller and battery), still (only noise), or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "room", requires = "spread")]
    conditions: String,
}

/// Results that a spread adds to a preview.
pub(super) struct Shown {
    pub(super) report: Report,
    /// Drawings (SVG) of the band from the front and over time.
    pub(super) drawings: Vec<String>,
}

impl SpreadFlags {
    /// Reads the conditions. Callers do this before the long computation, because it may fail.
    pub(super) fn conditions(&self) -> Result<Conditions> {
        Conditions::find(&self.conditions)
    }

    /// Simulates the spread of a shoot if `--spread` is given, and writes its pictures: the bands
    /// from the front and over time, and the photos of all flights. Returns the report and the
    /// drawings. Warns if there are too few flights for a band that contains 90 % of them.
    pub(super) fn run(
        &self,
        shoot: &Shoot,
        conditions: &Conditions,
        folder: &mut OutputFolder,
    ) -> Result<Option<Shown>> {
        let Some(n) = self.spread.map(usize::from) else { return Ok(None) };
        let band = spread(shoot, conditions, n, &counter("flying", 2 * n))?;
        if n < LEAST_FLIGHTS {
            warn([format!(
                "a band for 90 % of further flights requires at least {LEAST_FLIGHTS} flights: \
                 this band only contains the {n} simulated flights"
            )]);
        }
        let mut drawings = vec![spread_front(&band)];
        folder.write("spread-xz.svg", &drawings[0])?;
        let title = format!("{n} flights, conditions {}", self.conditions);
        let sheet = spread_sheet(&title, &titled_photos(&band));
        folder.write("spread.png", photo::encode_png(&sheet, None, &[]))?;
        for (drone, bands) in band.all.iter().zip(&band.within).enumerate() {
            let number = if band.all.len() > 1 { format!("-{}", drone + 1) } else { String::new() };
            let drawing = spread_over_time(bands.0, bands.1);
            folder.write(&format!("spread{number}.svg"), &drawing)?;
            drawings.push(drawing);
        }
        let mut report = described(&band, &title);
        report.value("conditions", &self.conditions);
        Ok(Some(Shown { report, drawings }))
    }
}

/// Returns the photo of each flight, with its seed and what is read in it as the title. A flight
/// without light has no photo.
fn titled_photos(spread: &Spread) -> Vec<(Photo, String)> {
    let photos = spread.flights.iter().filter_map(|SpreadFlight { seed, shot, .. }| {
        let shot = shot.as_ref().ok()?;
        let verdict = shot.verdict.as_ref().map(|v| format!(": {} {:.2}", v.read, v.readability));
        Some((shot.photo.clone(), format!("{seed}{}", verdict.unwrap_or_default())))
    });
    photos.collect()
}

/// Returns the report on the spread: the reading of each flight, and the bands around the path.
fn described(spread: &Spread, title: &str) -> Report {
    // A flight that lost its drone has no photo, and a drawing has no verdict.
    let flights = spread.flights.iter().map(|SpreadFlight { seed, shot, .. }| match shot {
        Err(lost) => json!({ "seed": seed, "lost": lost }),
        Ok(shot) => {
            let verdict = shot.verdict.as_ref();
            json!({
                "seed": seed, "read": verdict.map(|verdict| &verdict.read),
                "legible": verdict.map(|verdict| verdict.legible),
                "readability": verdict.map(|verdict| verdict.readability),
            })
        }
    });
    let flights: Vec<Value> = flights.collect();
    // Lost flights are counted separately and excluded from the quantiles.
    let mut readability: Vec<f64> =
        flights.iter().filter_map(|flight| flight["readability"].as_f64()).collect();
    readability.sort_by(f64::total_cmp);
    let lost = flights.iter().filter(|flight| flight.get("lost").is_some()).count();
    let words = json!({
        "title": title, "legible": flights.iter().filter(|it| it["legible"] == true).count(),
        "least": readability.first(), "most": readability.last(),
        "median": median(&mut readability), "lost": Some(lost).filter(|lost| *lost > 0),
        "holds": spread.all.iter().map(holds).collect::<Vec<_>>(),
    });
    let product = json!({
        "flights": flights, "bands": spread.all.iter().map(band_json).collect::<Vec<_>>(),
        "bands_within": spread.within.iter().map(band_json).collect::<Vec<_>>(),
    });
    Report::with_words(product, &words, LAYOUT)
}

const LAYOUT: &str = "\
spread    {title}[: {legible} legible; readability {least:.2} to {most:.2}, median {median:.2}][; {lost} lost the drone]
*bands           {holds.#} lie within x ±{half_width_m.0*1e3:.0}, y ±{half_width_m.1*1e3:.0}, z ±{half_width_m.2*1e3:.0} mm over the letters
*bands_within           one drone in one room: x ±{half_width_m.0*1e3:.0}, y ±{half_width_m.1*1e3:.0}, z ±{half_width_m.2*1e3:.0} mm over the letters
";

/// Returns a phrase for the fraction of further flights that a band contains. A band of too few
/// flights contains all of them.
fn holds(band: &Band) -> String {
    let percent = 100.0 * band.holds_frac();
    if band.holds_frac() < BAND_FRAC {
        return format!("all {} flights, and {percent:.0} % of further flights,", band.n_flights);
    }
    format!("{percent:.0} %")
}

/// Returns a band as JSON: its half width, and the lowest, the median and the highest position at
/// each time.
fn band_json(band: &Band) -> Value {
    let end = |end: usize| band.ends_m.iter().map(|ends| ends[end]).collect::<Vec<_>>();
    json!({ "holds_frac": band.holds_frac(), "half_width_m": band.half_width_m(),
            "time_s": band.time_s, "low_m": end(0), "median_m": end(1), "high_m": end(2) })
}
