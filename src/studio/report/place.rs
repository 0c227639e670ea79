//! The shot plan: where tripod, drones, stations and word stand, from above and from the side, to
//! scale.

use super::canvas::{Anchor, Canvas, Pen, Rgb};
use crate::preflight::ShotPlan;
use crate::shoot::Shot;
use noctograph_core::geometry::bounds;
use noctograph_flying::sensors::Positioning;

/// Longer side of the drawn space, and the margin around it, pixels.
const SIDE_PX: f64 = 560.0;
const MARGIN_PX: f64 = 56.0;
const CAP_PX: f64 = 9.0;
/// Distance of the audience behind the camera where no room is known, an assumption: place for who
/// works it.
const AUDIENCE_M: f64 = 1.0;
const BLACK: Rgb = [0; 3];
const GRAY: Rgb = [150; 3];
const WORD: Rgb = [230, 159, 0];
const CAMERA: Rgb = [0, 114, 178];
const TRIPOD: Rgb = [86, 180, 233];
const DRONE: Rgb = [0, 158, 115];
const STATION: Rgb = [204, 121, 167];

/// The shot plan from above (x to the right, y away from the camera) and from the left (y to the
/// right, z up). SVG. Lengths in meters; the word's plane is y = 0.
#[must_use]
pub(super) fn shot_plan(shot: &Shot, placement: Option<&ShotPlan>) -> [String; 2] {
    let things = things(shot, placement);
    [
        view(&things, "from above", [0, 1], ["x", "y"]),
        view(&things, "from the side", [1, 2], ["y", "z"]),
    ]
}

/// Something in the room: its name, its color, and its places. Two places are the corners of a box.
struct Thing {
    name: String,
    color: Rgb,
    places_m: Vec<[f64; 3]>,
}

fn things(shot: &Shot, placement: Option<&ShotPlan>) -> Vec<Thing> {
    let thing = |name: String, color, places_m| Thing { name, color, places_m };
    let mut things = Vec::new();
    if let Some([w, d, h]) = placement.map(|placement| placement.room_m) {
        let corners = vec![[-0.5 * w, -0.5 * d, 0.0], [0.5 * w, 0.5 * d, h]];
        things.push(thing(format!("room, {w} x {d} x {h} m"), BLACK, corners));
    }
    if let Some(strokes) = &shot.strokes {
        let [left, bottom, right, top] = strokes.bounds_m();
        let corners = vec![[left, 0.0, bottom], [right, 0.0, top]];
        things.push(thing(
            format!("word, {:.2} x {:.2} m", right - left, top - bottom),
            WORD,
            corners,
        ));
    }
    let starts = shot.flights.iter().filter_map(|flight| flight.samples.first());
    for (index, start) in starts.enumerate() {
        let [x, y, _] = rounded(start.position_m.into());
        let number = if shot.flights.len() > 1 { format!(" {}", index + 1) } else { String::new() };
        let name = format!("take-off{number} ({x:.2}, {y:.2})");
        things.push(thing(name, DRONE, vec![[x, y, 0.0]]));
    }
    let [x, y, z] = rounded(shot.camera.position_m.into());
    let name = format!("camera ({x:.2}, {y:.2}), lens {z:.2} m high");
    things.push(thing(name, CAMERA, vec![[x, y, z]]));
    let audience = |name: &str, from: [f64; 2], to: [f64; 2]| {
        let [low, high] = [[from[0], from[1], 0.0], [to[0], to[1], 1.7]];
        thing(name.to_owned(), GRAY, vec![low, high])
    };
    match placement {
        None => {
            let behind = y - AUDIENCE_M;
            things.push(audience("audience, behind the camera", [-1.0, behind], [1.0, behind]));
        }
        Some(ShotPlan { room_m: [w, d, _], audience_y_m, cameras, .. }) => {
            if let Some(audience_y_m) = audience_y_m {
                let wall = [-0.5 * w, -0.5 * d];
                things.push(audience("audience", wall, [0.5 * w, *audience_y_m]));
            }
            let mut tripods: Vec<([f64; 3], usize)> = Vec::new();
            for at in cameras[1..].iter().filter_map(|camera| camera.tripod_m.map(rounded)) {
                match tripods.iter_mut().find(|(place, _)| *place == at) {
                    Some((_, n)) => *n += 1,
                    None => tripods.push((at, 1)),
                }
            }
            for ([x, y, z], n) in tripods {
                let name = format!("tripod ({x:.2}, {y:.2}), {z:.2} m high: {n} of the cameras");
                things.push(thing(name, TRIPOD, vec![[x, y, z]]));
            }
        }
    }
    let sensors = &shot.scene.sensors;
    let (what, places_m): (_, Vec<[f64; 3]>) = match sensors.positioning {
        Positioning::Position | Positioning::CrossingBeams | Positioning::Sweeps => {
            let stations = &sensors.lighthouse.stations;
            ("station", stations.iter().map(|station| station.position_m).collect())
        }
        Positioning::UwbTwr | Positioning::UwbTdoa => ("anchor", sensors.uwb.anchors_m.clone()),
        Positioning::Gnss => ("", Vec::new()),
    };
    for (index, [x, y, z]) in places_m.into_iter().enumerate() {
        let name = format!("{what} {} ({x:.1}, {y:.1}, {z:.1})", index + 1);
        things.push(thing(name, STATION, vec![[x, y, z]]));
    }
    things
}

/// To centimeters, without a negative zero.
fn rounded(place_m: [f64; 3]) -> [f64; 3] {
    place_m.map(|m| (100.0 * m).round() / 100.0 + 0.0)
}

fn view(things: &[Thing], from: &str, axes: [usize; 2], names: [&str; 2]) -> String {
    let flat = |place: &[f64; 3]| axes.map(|axis| place[axis]);
    let places = things.iter().flat_map(|thing| thing.places_m.iter().map(flat));
    let [left, bottom, right, top] = bounds(places.chain([[0.0; 2]]));
    let (low, high) = ([left, bottom], [right, top]);
    let [width_m, height_m] = [high[0] - low[0] + 1.0, high[1] - low[1] + 1.0];
    let px_per_m = SIDE_PX / width_m.max(height_m);
    let px = |[a, b]: [f64; 2]| {
        let (right, up) = (a - low[0] + 0.5, b - low[1] + 0.5);
        [MARGIN_PX + right * px_per_m, MARGIN_PX + (height_m - up) * px_per_m]
    };
    let mut grid_m = 1.0;
    while width_m.max(height_m) > 20.0 * grid_m {
        grid_m *= 10.0;
    }
    let size_px = [width_m, height_m].map(|side_m| 2.0 * MARGIN_PX + side_m * px_per_m);
    let legend_px = 18.0 * (things.len() as f64 + 1.0);
    let mut canvas = Canvas::white([size_px[0].max(420.0), size_px[1] + legend_px]);
    canvas.text(format!("Shot plan {from}"), [MARGIN_PX, 26.0], Anchor::Start, 11.0, BLACK);
    for axis in 0..2 {
        let mut at = ((low[axis] - 0.5) / grid_m).ceil() * grid_m + 0.0; // never -0
        while at <= high[axis] + 0.5 {
            let ends = match axis {
                0 => [[at, low[1] - 0.5], [at, high[1] + 0.5]],
                _ => [[low[0] - 0.5, at], [high[0] + 0.5, at]],
            };
            let pen = Pen { color: GRAY, width_px: 0.5, dashed: at != 0.0 };
            let [[x, y], end] = ends.map(px);
            canvas.line([[x, y], end], pen);
            let (place, anchor) = match axis {
                0 => ([x, y + 16.0], Anchor::Middle),
                _ => ([x - 6.0, y + 4.0], Anchor::End),
            };
            canvas.text(format!("{at}"), place, anchor, CAP_PX, BLACK);
            at += grid_m;
        }
    }
    let [x, y] = px([high[0] + 0.5, low[1] - 0.5]);
    canvas.text(format!("{} (m)", names[0]), [x, y + 32.0], Anchor::End, CAP_PX, BLACK);
    let [x, y] = px([low[0] - 0.5, high[1] + 0.5]);
    canvas.text(format!("{} (m)", names[1]), [x - 6.0, y - 8.0], Anchor::End, CAP_PX, BLACK);
    for (index, Thing { name, color, places_m }) in things.iter().enumerate() {
        match &*places_m.iter().map(|place| px(flat(place))).collect::<Vec<_>>() {
            [a, b] => {
                let sides = [a[0].min(b[0]), a[1].min(b[1]), a[0].max(b[0]), a[1].max(b[1])];
                canvas.frame(sides, Pen::new(*color, 3.0));
            }
            dots => dots.iter().for_each(|at| canvas.dot(*at, 6.0, *color)),
        }
        let y = size_px[1] + 18.0 * index as f64;
        canvas.dot([MARGIN_PX + 5.0, y - 4.0], 5.0, *color);
        canvas.text(name.clone(), [MARGIN_PX + 18.0, y], Anchor::Start, CAP_PX, BLACK);
    }
    canvas.svg()
}
