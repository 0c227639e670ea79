//! Draws the shot plan to scale from above and from the side.

use kurbo::{Point, Rect, Vec2};

use super::canvas::{Anchor, Canvas, Pen, Rgb, Surface, Window};
use super::figure::{BLACK, BLUE};
use noctograph_core::geometry::bounds;
use noctograph_pipeline::preflight::{ShotPlan, stations};
use noctograph_pipeline::shoot::Shot;

/// Length of the longer side of the drawn space, and width of the margin around it.
const SIDE_PX: f64 = 560.0;
const MARGIN_PX: f64 = 56.0;
const CAP_PX: f64 = 9.0;
/// Distance between camera and audience that is assumed if the room is unknown. It leaves space for
/// the photographer.
const AUDIENCE_M: f64 = 1.0;
const GRAY: Rgb = [150; 3];
const WORD: Rgb = [230, 159, 0];
const CAMERA: Rgb = BLUE;
const TRIPOD: Rgb = [86, 180, 233];
const DRONE: Rgb = [0, 158, 115];
const STATION: Rgb = [204, 121, 167];

/// Returns SVGs of the shot plan as seen from above (x to the right, y away from the camera) and
/// from the left (y to the right, z up). Lengths are in meters. The word lies in the plane y = 0.
pub(super) fn shot_plan(shot: &Shot, placement: Option<&ShotPlan>) -> [String; 2] {
    let things = things(shot, placement);
    [
        view(&things, "from above", [0, 1], ["x", "y"]),
        view(&things, "from the side", [1, 2], ["y", "z"]),
    ]
}

/// Object in the room: its name, its color, and either its position or two opposite corners.
type Thing = (String, Rgb, Vec<[f64; 3]>);

/// Returns all objects in the room: word, take-off points, camera, audience, tripods and stations.
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
        things.push((format!("take-off{number} ({x:.2}, {y:.2})"), DRONE, vec![[x, y, 0.0]]));
    }
    let [x, y, z] = rounded(shot.camera.position_m.into());
    let name = format!("camera ({x:.2}, {y:.2}), lens {z:.2} m high");
    things.push((name, CAMERA, vec![[x, y, z]]));
    // The audience stands in front of the room's wall, or behind the camera if the room is unknown.
    // People are assumed to be 1.7 m tall.
    if let Some(placement) = placement {
        let [w, d, _] = placement.room_m;
        let audience =
            placement.audience_y_m.map(|y_m| [[-0.5 * w, -0.5 * d, 0.0], [0.5 * w, y_m, 1.7]]);
        things.extend(audience.map(|corners| ("audience".to_owned(), GRAY, corners.into())));
        things.extend(tripods(placement));
    } else {
        let behind = y - AUDIENCE_M;
        let corners = vec![[-1.0, behind, 0.0], [1.0, behind, 1.7]];
        things.push(("audience, behind the camera".to_owned(), GRAY, corners));
    }
    for (name, [x, y, z]) in stations(&shot.shoot.scene) {
        let name = format!("{name} ({x:.1}, {y:.1}, {z:.1})");
        things.push((name, STATION, vec![[x, y, z]]));
    }
    things
}

/// Returns the tripods of all cameras except the scene's own, each with its number of cameras.
fn tripods(placement: &ShotPlan) -> Vec<Thing> {
    let tripods = placement.cameras[1..].iter().filter_map(|camera| camera.tripod_m.map(rounded));
    let tripods: Vec<[f64; 3]> = tripods.collect();
    let firsts =
        tripods.iter().enumerate().filter(|(index, place)| !tripods[..*index].contains(place));
    let things = firsts.map(|(_, place)| {
        let ([x, y, z], n) = (place, tripods.iter().filter(|other| *other == place).count());
        let name = format!("tripod ({x:.2}, {y:.2}), {z:.2} m high: {n} of the cameras");
        (name, TRIPOD, vec![*place])
    });
    things.collect()
}

/// Rounds a position in m to centimeters. Adding 0 turns negative zero into positive zero.
fn rounded(place_m: [f64; 3]) -> [f64; 3] {
    place_m.map(|m| (100.0 * m).round() / 100.0 + 0.0)
}

/// Returns an SVG of the plan from one side. `from` names the side in the image's text. `axes` are
/// the coordinates that point right and up (0 to 2 for x to z), and `names` are their labels.
fn view(things: &[Thing], from: &str, axes: [usize; 2], names: [&str; 2]) -> String {
    let positions_m = things.iter().flat_map(|(.., positions_m)| positions_m);
    let seen_m = positions_m.map(|position_m| axes.map(|axis| position_m[axis]));
    // The view includes the origin.
    let [left, bottom, right, top] = bounds(seen_m.chain([[0.0; 2]]));
    // The `inset` method of kurbo enlarges the rectangle, here by half a meter on each side.
    let extent_m = Rect::new(left, bottom, right, top).inset(0.5);
    let px_per_m = SIDE_PX / extent_m.width().max(extent_m.height());
    let corner_m = Point::new(extent_m.x0, extent_m.y1);
    let corner_px = Point::new(MARGIN_PX, MARGIN_PX);
    let window = Window { corner_px, corner_m, px_per_m };
    let frame = window.rect_px(extent_m);
    let legend_px = 18.0 * (things.len() as f64 + 1.0);
    let [width_px, height_px] = [frame.x1, frame.y1].map(|side_px| side_px + MARGIN_PX);
    let mut canvas = Canvas::white([width_px.max(420.0), height_px + legend_px]);
    let title = Point::new(MARGIN_PX, 26.0);
    canvas.text(format!("Shot plan {from}"), title, Anchor::Start, 11.0, BLACK);
    draw_grid(&mut canvas, &window, extent_m);
    let below = Point::new(frame.x1, frame.y1 + 32.0);
    canvas.text(format!("{} (m)", names[0]), below, Anchor::End, CAP_PX, BLACK);
    let beside = frame.origin() - Vec2::new(6.0, 8.0);
    canvas.text(format!("{} (m)", names[1]), beside, Anchor::End, CAP_PX, BLACK);
    // Objects are drawn over the grid, each with a line in the legend.
    for (index, (name, color, positions_m)) in things.iter().enumerate() {
        let seen_m = positions_m.iter().map(|position_m| axes.map(|axis| position_m[axis]));
        match &*seen_m.map(|[right, up]| window.px(Point::new(right, up))).collect::<Vec<_>>() {
            [a, b] => canvas.frame(Rect::from_points(*a, *b), Pen::new(*color, 3.0)),
            dots => dots.iter().for_each(|dot| canvas.dot(*dot, 6.0, *color)),
        }
        let entry = Point::new(MARGIN_PX, height_px + 18.0 * index as f64);
        canvas.dot(entry + Vec2::new(5.0, -4.0), 5.0, *color);
        canvas.text(name, entry + Vec2::new(18.0, 0.0), Anchor::Start, CAP_PX, BLACK);
    }
    canvas.svg()
}

/// Draws numbered grid lines every meter, or every 10 or 100 m for a large room. Lines at 0 are
/// solid.
fn draw_grid(canvas: &mut Canvas, window: &Window, extent_m: Rect) {
    let mut grid_m = 1.0;
    while extent_m.width().max(extent_m.height()) > 20.0 * grid_m {
        grid_m *= 10.0;
    }
    // Vertical lines are numbered below, and horizontal lines at the left.
    let Rect { x0, y0, x1, y1 } = extent_m;
    for (is_vertical, [low_m, high_m]) in [(true, [x0, x1]), (false, [y0, y1])] {
        let mut line_m = (low_m / grid_m).ceil() * grid_m + 0.0; // never -0
        while line_m <= high_m {
            let ends_m = if is_vertical {
                [(line_m, y0), (line_m, y1)]
            } else {
                [(x0, line_m), (x1, line_m)]
            };
            let ends = ends_m.map(|end_m| window.px(end_m.into()));
            canvas.line(ends, Pen { dashed: line_m != 0.0, ..Pen::new(GRAY, 0.5) });
            let (label, anchor) = if is_vertical {
                (Vec2::new(0.0, 16.0), Anchor::Middle)
            } else {
                (Vec2::new(-6.0, 4.0), Anchor::End)
            };
            canvas.text(line_m.to_string(), ends[0] + label, anchor, CAP_PX, BLACK);
            line_m += grid_m;
        }
    }
}
