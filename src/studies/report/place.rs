//! The shot plan: where tripod, drones, stations and word stand, from above and from the side, to
//! scale.

use super::canvas::{Anchor, Canvas, Pen, Rgb, Surface, Window};
use super::figure::{BLACK, BLUE};
use noctograph_core::geometry::bounds;
use noctograph_pipeline::preflight::{ShotPlan, stations};
use noctograph_pipeline::shoot::Shot;

/// Longer side of the drawn space, and the margin around it, pixels.
const SIDE_PX: f64 = 560.0;
const MARGIN_PX: f64 = 56.0;
const CAP_PX: f64 = 9.0;
/// Distance of the audience behind the camera where no room is known, an assumption: place for who
/// works it.
const AUDIENCE_M: f64 = 1.0;
const GRAY: Rgb = [150; 3];
const WORD: Rgb = [230, 159, 0];
const CAMERA: Rgb = BLUE;
const TRIPOD: Rgb = [86, 180, 233];
const DRONE: Rgb = [0, 158, 115];
const STATION: Rgb = [204, 121, 167];

/// The shot plan from above (x to the right, y away from the camera) and from the left (y to the
/// right, z up). SVG. Lengths in meters; the word's plane is y = 0.
pub(super) fn shot_plan(shot: &Shot, placement: Option<&ShotPlan>) -> [String; 2] {
    let things = things(shot, placement);
    [
        view(&things, "from above", [0, 1], ["x", "y"]),
        view(&things, "from the side", [1, 2], ["y", "z"]),
    ]
}

/// Something in the room: its name, its color, and its places. Two places are the corners of a box.
type Thing = (String, Rgb, Vec<[f64; 3]>);

/// Lists the room's contents for the site plan: flight, camera, stations, audience.
fn things(shot: &Shot, placement: Option<&ShotPlan>) -> Vec<Thing> {
    let mut things = Vec::new();
    if let Some([w, d, h]) = placement.map(|placement| placement.room_m) {
        let corners = vec![[-0.5 * w, -0.5 * d, 0.0], [0.5 * w, 0.5 * d, h]];
        things.push((format!("room, {w} x {d} x {h} m"), BLACK, corners));
    }
    if let Some(strokes) = &shot.shoot.strokes {
        let [left, bottom, right, top] = strokes.bounds_m();
        let name = format!("word, {:.2} x {:.2} m", right - left, top - bottom);
        things.push((name, WORD, vec![[left, 0.0, bottom], [right, 0.0, top]]));
    }
    let starts = shot.flights.iter().filter_map(|flight| flight.samples.first());
    for (index, start) in starts.enumerate() {
        let [x, y, _] = rounded(start.position_m.into());
        let number = if shot.flights.len() > 1 { format!(" {}", index + 1) } else { String::new() };
        let name = format!("take-off{number} ({x:.2}, {y:.2})");
        things.push((name, DRONE, vec![[x, y, 0.0]]));
    }
    let [x, y, z] = rounded(shot.camera.position_m.into());
    let name = format!("camera ({x:.2}, {y:.2}), lens {z:.2} m high");
    things.push((name, CAMERA, vec![[x, y, z]]));
    fn audience(name: &str, [left, from]: [f64; 2], [right, to]: [f64; 2]) -> Thing {
        (name.to_owned(), GRAY, vec![[left, from, 0.0], [right, to, 1.7]])
    }
    match placement {
        None => {
            let behind = y - AUDIENCE_M;
            things.push(audience("audience, behind the camera", [-1.0, behind], [1.0, behind]));
        }
        Some(ShotPlan { room_m: [w, d, _], audience_y_m, cameras, .. }) => {
            let wall = [-0.5 * w, -0.5 * d];
            things.extend(audience_y_m.map(|y_m| audience("audience", wall, [0.5 * w, y_m])));
            let mut tripods: Vec<([f64; 3], usize)> = Vec::new();
            for tripod in cameras[1..].iter().filter_map(|camera| camera.tripod_m.map(rounded)) {
                match tripods.iter_mut().find(|(place, _)| *place == tripod) {
                    Some((_, n)) => *n += 1,
                    None => tripods.push((tripod, 1)),
                }
            }
            for ([x, y, z], n) in tripods {
                let name = format!("tripod ({x:.2}, {y:.2}), {z:.2} m high: {n} of the cameras");
                things.push((name, TRIPOD, vec![[x, y, z]]));
            }
        }
    }
    let (what, places_m) = stations(&shot.shoot.scene);
    for (index, [x, y, z]) in places_m.into_iter().enumerate() {
        let name = format!("{what} {} ({x:.1}, {y:.1}, {z:.1})", index + 1);
        things.push((name, STATION, vec![[x, y, z]]));
    }
    things
}

/// To centimeters, without a negative zero.
fn rounded(place_m: [f64; 3]) -> [f64; 3] {
    place_m.map(|m| (100.0 * m).round() / 100.0 + 0.0)
}

/// Draws the site plan from one side.
fn view(things: &[Thing], from: &str, axes: [usize; 2], names: [&str; 2]) -> String {
    let flat = |place: &[f64; 3]| axes.map(|axis| place[axis]);
    let places = things.iter().flat_map(|(.., places_m)| places_m.iter().map(flat));
    let [left, bottom, right, top] = bounds(places.chain([[0.0; 2]]));
    // Half a meter of air on each side.
    let (low, high) = ([left - 0.5, bottom - 0.5], [right + 0.5, top + 0.5]);
    let sides_m = [high[0] - low[0], high[1] - low[1]];
    let longest_m = sides_m[0].max(sides_m[1]);
    let (corner_m, px_per_m) = ([low[0], high[1]], SIDE_PX / longest_m);
    let window = Window { corner_px: [MARGIN_PX; 2], corner_m, px_per_m };
    let mut grid_m = 1.0;
    while longest_m > 20.0 * grid_m {
        grid_m *= 10.0;
    }
    let size_px = sides_m.map(|side_m| 2.0 * MARGIN_PX + side_m * px_per_m);
    let legend_px = 18.0 * (things.len() as f64 + 1.0);
    let mut canvas = Canvas::white([size_px[0].max(420.0), size_px[1] + legend_px]);
    canvas.text(format!("Shot plan {from}"), [MARGIN_PX, 26.0], Anchor::Start, 11.0, BLACK);
    for axis in 0..2 {
        let mut line_m = (low[axis] / grid_m).ceil() * grid_m + 0.0; // never -0
        while line_m <= high[axis] {
            let mut ends = [low, high];
            ends.iter_mut().for_each(|end| end[axis] = line_m);
            let [[x, y], end] = ends.map(|end| window.px(end));
            canvas.line([[x, y], end], Pen { dashed: line_m != 0.0, ..Pen::new(GRAY, 0.5) });
            let (place, anchor) = match axis {
                0 => ([x, y + 16.0], Anchor::Middle),
                _ => ([x - 6.0, y + 4.0], Anchor::End),
            };
            canvas.text(line_m.to_string(), place, anchor, CAP_PX, BLACK);
            line_m += grid_m;
        }
    }
    let [x, y] = window.px([high[0], low[1]]);
    canvas.text(format!("{} (m)", names[0]), [x, y + 32.0], Anchor::End, CAP_PX, BLACK);
    let [x, y] = window.px([low[0], high[1]]);
    canvas.text(format!("{} (m)", names[1]), [x - 6.0, y - 8.0], Anchor::End, CAP_PX, BLACK);
    for (index, (name, color, places_m)) in things.iter().enumerate() {
        match &*places_m.iter().map(|place| window.px(flat(place))).collect::<Vec<_>>() {
            [a, b] => {
                let sides = [a[0].min(b[0]), a[1].min(b[1]), a[0].max(b[0]), a[1].max(b[1])];
                canvas.frame(sides, Pen::new(*color, 3.0));
            }
            dots => dots.iter().for_each(|dot| canvas.dot(*dot, 6.0, *color)),
        }
        let y = size_px[1] + 18.0 * index as f64;
        canvas.dot([MARGIN_PX + 5.0, y - 4.0], 5.0, *color);
        canvas.text(name, [MARGIN_PX + 18.0, y], Anchor::Start, CAP_PX, BLACK);
    }
    canvas.svg()
}
