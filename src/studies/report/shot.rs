//! Builds the report of a shot: photo, verdict, flight, safety, camera and room on one page.

use std::path::Path;

use super::flights::{NamedFlight, error_over_time, front_view, load_over_time, top_view};
use super::overlay::marks_svg;
use super::page::Page;
use super::place::shot_plan;
use super::plans::plan_view;
use noctograph_core::camera::INFINITY_M;
use noctograph_core::diagnostic::{Change, Diagnostic};
use noctograph_core::error::Result;
use noctograph_core::flight::Quantity;
use noctograph_picture::light::Lamp;
use noctograph_picture::photo;
use noctograph_pipeline::preflight::ShotPlan;
use noctograph_pipeline::shoot::{Shot, writing};
use noctograph_score::LetterVerdict;

/// Number of pictures that show the exposure as it accumulates, and their width.
const N_MOMENTS: u32 = 12;
const MOMENT_PX: u32 = 560;
/// Maximum total number of points in the paths of all drones.
const MAX_PATH_POINTS: usize = 2000;
/// JPEG quality of the photo, and of the small pictures of the exposure.
const JPEG_QUALITY: [u8; 2] = [85, 80];
/// Minimum probability that is shown.
pub const LEAST_PROBABILITY: f64 = 0.01;

/// Texts and drawings that accompany a shot in its report.
#[derive(Debug)]
pub struct ShotNotes<'a> {
    /// Verdict as a sentence, empty without a verdict.
    pub lead: &'a str,
    /// Table as printed in the terminal.
    pub printed: &'a str,
    /// Findings of the checks before takeoff.
    pub findings: &'a [Diagnostic],
    /// Positions of cameras and audience, if the room is known.
    pub placement: Option<&'a ShotPlan>,
    /// Function that formats a change for the program that creates the page.
    pub typed: fn(&Change) -> String,
    /// Command that repeats the shot.
    pub command: &'a str,
    /// Additional drawings of the flight (SVG), such as its band over many flights.
    pub drawings: &'a [String],
    /// The actual flight, if there was one.
    pub flown: Option<&'a FlownNotes>,
}

/// Comparison of an actual flight with the predicted one.
#[derive(Debug)]
pub struct FlownNotes {
    /// Shot of the actual flight.
    pub shot: Shot,
    /// Rows, one for each letter, with the predicted value and the actual one in each cell.
    pub rows: Vec<[String; 7]>,
}

/// Returns the report of a shot. `notes` are the texts that only the caller knows. Returns the
/// errors of [`Shot::moments`].
pub fn shot_page(shot: &Shot, notes: &ShotNotes<'_>) -> Result<Page> {
    let scene = &shot.shoot.scene;
    let drawing = Path::new(&scene.letters.drawing).file_stem().unwrap_or_default();
    let subject = match scene.word.as_str() {
        "" => drawing.to_string_lossy().into_owned(),
        word => word.replace('\n', " "),
    };
    let judged = shot.marks.as_ref().zip(shot.verdict.as_ref());
    let overlay = judged.map(|(marks, verdict)| marks_svg(&shot.photo, marks, verdict));
    let jpeg = photo::jpeg(&shot.photo, JPEG_QUALITY[0]);
    let alt = format!("simulated long-exposure photograph of {subject}");
    // The photo and its verdict come first, because most readers look no further.
    let mut page = Page::new(&subject, notes.lead).photo(&jpeg, &alt, overlay.as_deref());
    if let Some(flown) = notes.flown {
        page = flown_section(page, &jpeg, shot, flown);
    }
    page = page.section("As printed").printed(notes.printed);
    let mut moments = Vec::new();
    shot.moments(shot.camera.width_px.min(MOMENT_PX), N_MOMENTS, &mut |time_s, photo| {
        moments.push((photo::jpeg(&photo, JPEG_QUALITY[1]), format!("{time_s:.1} s")));
        Ok(())
    })?;
    page = page.section("The exposure as it accumulates").film(&moments);
    page = flight_section(page, shot, notes);
    if !notes.findings.is_empty() {
        let rows = notes.findings.iter().map(|check| {
            let [mark, check, mut finding, wanted, change] = check.cells(notes.typed);
            if !wanted.is_empty() {
                finding += &format!("; wanted: {wanted}; change: {change}");
            }
            [mark, check, finding]
        });
        page = page.section("Safety sheet").table(["", "check", "found"], rows);
    }
    page = page.section("Camera").table(["setting", "value"], camera(shot));
    page = page.section("Shot plan");
    if let Some(placement) = notes.placement {
        page = page.table(["what", "where"], placement.rows());
    }
    page = page.drawings(&shot_plan(shot, notes.placement));
    // This section contains everything needed to repeat the shot elsewhere.
    page = page.section("To repeat this shot").printed(notes.command);
    let changes = scene.portable().changes();
    let end = if changes.is_empty() { ": none." } else { ":" };
    let text = format!("Settings that differ from the preset {}{end}", scene.preset.name());
    page = page.text(&text).table(["key", "value", "in the preset"], changes);
    let digests =
        [("film", shot.film.as_ref().map(|film| film.sha256())), ("flight", shot.flight_sha256())];
    let digests = digests.into_iter().filter_map(|(name, sha256)| Some([name.to_owned(), sha256?]));
    Ok(page.table(["digest", "SHA-256"], digests))
}

/// Appends the predicted and the actual photo side by side, and a table of their differences.
fn flown_section(page: Page, promised: &[u8], shot: &Shot, flown: &FlownNotes) -> Page {
    let caption = |name: &str, shot: &Shot| match &shot.verdict {
        Some(verdict) => format!("{name} {:.2}", verdict.readability),
        None => name.to_owned(),
    };
    let jpeg = photo::jpeg(&flown.shot.photo, JPEG_QUALITY[0]);
    let head = ["letter", "reads as", "P", "lag, s", "off path, mm", "off plane, mm", "lit, s"];
    page.section("Promised and flown")
        .pair([(promised, caption("promised", shot)), (&*jpeg, caption("flown", &flown.shot))])
        .text("For each letter, from the previewed value to the flown one:")
        .table(head, flown.rows.iter().cloned())
}

/// Returns a text that lists the probable letters other than the expected one, with probabilities.
pub fn rivals(letter: &LetterVerdict) -> String {
    let rivals = letter.rivals.iter().filter(|rival| rival.p >= LEAST_PROBABILITY);
    rivals.map(|r| format!("{} {:.2}", r.letter, r.p)).collect::<Vec<_>>().join(", ")
}

/// Appends the drawings of plans and flights to the page.
fn flight_section(mut page: Page, shot: &Shot, notes: &ShotNotes<'_>) -> Page {
    let plans: Vec<_> = shot.shoot.plans.iter().map(|planned| planned.plan.clone()).collect();
    if plans.iter().any(|plan| !plan.setpoints.is_empty()) {
        let numbers = shot.shoot.strokes.as_ref().map_or(&[][..], |strokes| &strokes.numbers);
        page = page.section("Plan").drawings(&[plan_view(&plans, &shot.shoot.scene.word, numbers)]);
    }
    // Flights without samples, such as those from light traces, have no plots.
    let traces = shot.flights.iter().enumerate().map(|(index, flight)| NamedFlight {
        name: format!("drone {}", index + 1),
        samples: flight.samples.clone(),
    });
    let traces: Vec<NamedFlight> = traces.collect();
    if traces.is_empty() || traces.iter().any(|trace| trace.samples.is_empty()) {
        return page;
    }
    let mut drawings = vec![front_view(&traces), top_view(&traces), error_over_time(&traces)];
    if shot.flights.iter().all(|flight| flight.has(Quantity::Motors)) {
        drawings.push(load_over_time(&shot.flights));
    }
    drawings.extend_from_slice(notes.drawings);
    page.section("Flight").paths(&paths(shot)).drawings(&drawings)
}

/// Returns all drones' paths, each a list of points in integer millimeters of the world frame, with
/// true if a writing lamp of the drone is lit at the point. Long paths are thinned.
fn paths(shot: &Shot) -> Vec<Vec<([i32; 3], bool)>> {
    let n_samples: usize = shot.flights.iter().map(|flight| flight.samples.len()).sum();
    // Samples are skipped to keep the page small.
    let step = n_samples.div_ceil(MAX_PATH_POINTS).max(1);
    let lamps = writing(&shot.flights, &shot.trace, &shot.shoot.scene.light);
    let paths = shot.flights.iter().enumerate().map(|(drone, flight)| {
        let points = flight.samples.iter().step_by(step).map(|sample| {
            #[expect(clippy::cast_possible_truncation, reason = "a room in millimeters")]
            let point_mm = <[f64; 3]>::from(sample.position_m).map(|m| (1000.0 * m).round() as i32);
            let mut lamps =
                lamps.iter().filter(|lamp| lamp.drone.is_none_or(|index| index.0 == drone));
            (point_mm, lamps.any(|lamp| is_lit(lamp, sample.time_s)))
        });
        points.collect()
    });
    paths.collect()
}

/// Returns true if a lamp is lit at `time_s`.
fn is_lit(lamp: &Lamp, time_s: f64) -> bool {
    let next = lamp.samples.partition_point(|sample| sample.time_s <= time_s);
    next > 0 && lamp.samples[next - 1].level > 0.0
}

/// Returns table rows with the camera settings that a photographer enters by hand, as pairs of a
/// name and a value with its unit.
fn camera(shot: &Shot) -> Vec<[String; 2]> {
    let camera = &shot.camera;
    // Without a given focus distance, the lens is focused on the word's plane.
    let focus_m = camera.focus_m.unwrap_or(camera.position_m.y.abs());
    let focus = if focus_m < INFINITY_M {
        format!("{focus_m:.2} m, by hand")
    } else {
        "infinity, by hand".to_owned()
    };
    let [focal_mm, sensor_mm] = [camera.focal_length_m, camera.sensor_width_m].map(|m| 1e3 * m);
    let opens_s = camera.shutter_open_s;
    let exposure_s = camera.shutter_close_s - opens_s;
    // A camera with a limited exposure combines several exposures.
    let adds_up = shot.metered.is_some_and(|metered| metered.longest_s.is_some());
    let mode = if adds_up { "night or light-trail mode" } else { "bulb" };
    let rows = [
        ("lens", format!("{focal_mm:.0} mm on a sensor {sensor_mm:.1} mm wide")),
        ("aperture", format!("f/{}", camera.f_number)),
        ("sensitivity", format!("ISO {}", camera.iso)),
        ("shutter", format!("{mode}, {exposure_s:.0} s, from {opens_s:.1} s into the flight")),
        ("focus", focus),
        ("picture", format!("{} x {}", camera.width_px, camera.height_px)),
    ];
    let trail = shot
        .metered
        .map(|metered| ("trail", format!("{:+.1} stops over saturation", metered.trail_stops)));
    rows.into_iter().chain(trail).map(|(name, value)| [name.to_owned(), value]).collect()
}
