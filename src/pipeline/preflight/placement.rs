//! The shot plan: positions of tripod, take-off marks, base stations and audience in a room, and
//! the cameras that can show the whole word from inside it.
//!
//! Products in: a [`Shoot`], the light of its flights, and the [`Profile`] of a room. Product out:
//! a [`ShotPlan`] in world coordinates in meters, with the center of the room at x = y = 0 and the
//! word in the plane y = 0. Each camera is centered in front of the word, which fills half of the
//! picture, or more in a small room. Doors are not considered.

use serde::Serialize;

use super::obstacles::{Paths, stations};
use super::{Profile, cap_height_m};
use crate::scene::Scene;
use crate::shoot::{Metered, Shoot, recommended};
use noctograph_core::camera::{
    BodyModel, CameraOptions, CustomLens, Framing, LensModel, Metering, TrailMetering, WordFraming,
};
use noctograph_core::diagnostic::{Diagnostic, Severity};
use noctograph_core::error::Result;
use noctograph_export::safety::FRAME_M;
use noctograph_letters::Strokes;
use noctograph_picture::light::LightTrace;
use noctograph_picture::photo::PhotoOptions;

/// Minimum distance from a lens to the wall behind it, assumed to be half a tripod plus a hand at
/// the release. A smaller distance would allow larger words in a small room.
const TRIPOD_FROM_WALL_M: f64 = 0.3;

/// Minimum distance from a camera to the word in a deep room, so as not to obstruct the flight.
const TRIPOD_FROM_WORD_M: f64 = 0.5;

/// Maximum fraction of the picture's width or height that the word may fill. The rest allows for
/// the word's glow, and for a tripod that is slightly off-center.
const MOST_FILLED: f64 = 0.9;

const FULL_FRAME_WIDTH_M: f64 = 0.036;

/// Name of the check for the camera's position in a room. A preview does not include this check.
pub const CAMERA_PLACE: &str = "camera";

/// Positions of objects in a room, and the cameras that show the word from inside it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShotPlan {
    /// Width, depth and height of the room.
    pub room_m: [f64; 3],
    /// Left, bottom, right and top of the word in the plane y = 0.
    pub word_m: [f64; 4],
    /// Take-off marks of the drones (x and y).
    pub take_off_m: Vec<[f64; 2]>,
    /// Positions of base stations or anchors.
    pub stations_m: Vec<[f64; 3]>,
    /// Minimum distance between people and the flight, in whole tenths of a meter. Without
    /// commands, a drone flies on at its maximum speed until its motors stop, and then falls.
    pub audience_from_m: f64,
    /// Maximum y of the audience, in front of the flight. `None` if the room is too shallow.
    pub audience_y_m: Option<f64>,
    /// The scene's camera, followed by common cameras.
    pub cameras: Vec<CameraPlace>,
}

/// A camera in a room.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraPlace {
    /// Name of the body and lens.
    pub name: String,
    /// Full-frame focal length with the same horizontal angle of view.
    pub equivalent_m: f64,
    /// Minimum distance at which the whole word is in the picture.
    pub least_m: f64,
    /// Position of the lens. `None` if the room is not deep enough.
    pub tripod_m: Option<[f64; 3]>,
    /// Maximum equivalent focal length that shows the whole word from inside the room.
    pub longest_equivalent_m: f64,
    /// Maximum cap height that the camera could show from there. `None` for a drawing.
    pub largest_cap_height_m: Option<f64>,
    /// Duration of the exposure.
    pub shutter_s: f64,
    /// Recommended aperture and sensitivity. `None` without a position or without light.
    #[serde(rename = "recommended")]
    pub metered: Option<Metered>,
}

/// Returns common cameras, each with its name and its widest usual lens. Their other options are
/// copied from the scene's camera.
fn usual_cameras(scene: &Scene) -> [(&'static str, CameraOptions); 7] {
    let [zoom_18, zoom_9] = [0.018, 0.009].map(|focal_length_m| {
        LensModel::Custom(CustomLens { focal_length_m, ..CustomLens::default() })
    });
    let cameras = [
        ("full frame, 28 mm", BodyModel::FullFrame24Mp, LensModel::Wide28),
        ("Sony α6400, 16 mm", BodyModel::A6400, LensModel::Kit16),
        ("Canon EOS 2000D, 18 mm", BodyModel::CanonEos2000D, zoom_18),
        // The shortest focal length of the Sony DSC-RX100M7 is 9 mm.
        ("compact, 1 inch, 9 mm", BodyModel::OneInch, zoom_9),
        ("iPhone 15 Pro", BodyModel::IPhone15Pro, LensModel::default()),
        ("Pixel 8 Pro", BodyModel::Pixel8Pro, LensModel::default()),
        ("Galaxy S24", BodyModel::GalaxyS24, LensModel::default()),
    ];
    cameras.map(|(name, body, lens)| {
        let metering = Metering::Trail(TrailMetering::default());
        let framing = Framing::Word(WordFraming::default());
        let usual = scene.camera.clone();
        // The metering replaces this aperture, which every one of the lenses has.
        (name, CameraOptions { body, lens, metering, framing, f_number: 8.0, ..usual })
    })
}

/// Returns a plan of the positions of all objects in the room of a profile. Returns `None` without
/// a room or strokes. `trace` is the light of all drones until `end_s`.
pub(super) fn plan_shot(
    shoot: &Shoot,
    trace: &LightTrace,
    end_s: f64,
    profile: &Profile,
    paths: &Paths,
) -> Result<Option<ShotPlan>> {
    let (Some(room_m), Some(strokes)) = (profile.room_m, &shoot.strokes) else { return Ok(None) };
    let scene = &shoot.scene;
    let word_m = strokes.bounds_m();
    let audience_from_m = paths.audience_from_m;
    // The audience stands in front of the paths, if the room is deep enough.
    let audience_y_m =
        Some(paths.front_m() - audience_from_m).filter(|y_m| *y_m > -0.5 * room_m[1]);
    let own_name = format!("the scene's, {:.0} mm", 1e3 * scene.camera.focal_length_m());
    let usual = usual_cameras(scene).map(|(name, options)| (name.to_owned(), options));
    let mut cameras = Vec::new();
    for (name, options) in [(own_name, scene.camera.clone())].into_iter().chain(usual) {
        cameras.push(place_camera(name, options, strokes, room_m, (trace, end_s), &scene.photo)?);
    }
    Ok(Some(ShotPlan {
        room_m,
        word_m,
        take_off_m: take_off_m(shoot).collect(),
        stations_m: stations(scene).into_iter().map(|(_, position_m)| position_m).collect(),
        audience_from_m,
        audience_y_m,
        cameras,
    }))
}

/// Returns the place of a camera in front of the word, with the light metered for it. `trace` is
/// the light until `end_s`.
fn place_camera(
    name: String,
    options: CameraOptions,
    strokes: &Strokes,
    room_m: [f64; 3],
    (trace, end_s): (&LightTrace, f64),
    photo: &PhotoOptions,
) -> Result<CameraPlace> {
    let (word_m, most_m) = (strokes.bounds_m(), max_camera_distance_m(room_m));
    // A camera with a given pose is not moved, even if it is outside the room.
    let is_fixed = matches!(options.framing, Framing::Fixed(_));
    let (centered, least_m) = center_in_front(options.clone(), word_m, room_m)?;
    let options = if is_fixed { options } else { centered };
    let camera = options.camera(word_m, end_s)?;
    let equivalent_m = camera.focal_length_m * FULL_FRAME_WIDTH_M / camera.sensor_width_m;
    let fits = is_fixed || least_m <= most_m;
    let metered = fits.then(|| recommended(trace, &camera, &options, photo));
    // The maximum focal length and letter height are proportional to the distance.
    Ok(CameraPlace {
        name,
        equivalent_m,
        least_m,
        tripod_m: fits.then(|| camera.position_m.into()),
        longest_equivalent_m: equivalent_m * most_m / least_m,
        largest_cap_height_m: cap_height_m(strokes).map(|cap_m| cap_m * most_m / least_m),
        shutter_s: camera.shutter_close_s - camera.shutter_open_s,
        metered: metered.flatten(),
    })
}

/// Returns x and y of each drone's take-off mark.
fn take_off_m(shoot: &Shoot) -> impl Iterator<Item = [f64; 2]> {
    let starts = shoot.plans.iter().filter_map(|planned| planned.plan.setpoints.first());
    starts.map(|start| [start.position_m.x, start.position_m.y])
}

/// Returns the distance by which a point is outside a room, or 0 if it is inside.
fn distance_outside_m([x, y, z]: [f64; 3], [width_m, depth_m, height_m]: [f64; 3]) -> f64 {
    let sides = [x.abs() - 0.5 * width_m, y.abs() - 0.5 * depth_m, z - height_m, -z];
    sides.into_iter().fold(0.0, f64::max)
}

/// An object that must be inside the room.
struct RoomThing {
    name: String,
    position_m: [f64; 3],
    /// Severity of the finding if the position is outside the room.
    severity: Severity,
}

/// Checks that stations, take-off marks and a fixed camera are inside the room. Otherwise the
/// origin or the room is wrong, and therefore also the position of the flight.
pub(super) fn check_frame(shoot: &Shoot, room_m: [f64; 3]) -> Diagnostic {
    // An object counts as inside if it is within the tolerance of measured positions.
    let mut things = things_in_room(shoot);
    let n = things.len();
    things.retain(|thing| distance_outside_m(thing.position_m, room_m) > FRAME_M);
    let severity = things.iter().map(|thing| thing.severity).max().unwrap_or_default();
    let (mut farthest_m, mut most_m, mut names, mut sentences) =
        (None, 0.0, Vec::new(), Vec::new());
    for RoomThing { name, position_m, .. } in things {
        let ([x, y, z], outside_m) = (position_m, distance_outside_m(position_m, room_m));
        if outside_m >= most_m {
            (farthest_m, most_m) = (Some(position_m), outside_m);
        }
        sentences.push(format!("{name} at ({x:.2}, {y:.2}, {z:.2}), {outside_m:.2} m outside"));
        names.push(name);
    }
    let actual = if names.is_empty() {
        format!("all {n} positions of stations, anchors, drones and camera are in the room")
    } else {
        sentences.join("; ")
    };
    let row = Diagnostic::check("frame", severity, most_m).within(FRAME_M);
    row.positioned(farthest_m).detailed(names.join(", ")).say(
        actual,
        "stations, anchors, take-off marks and camera in the room, whose middle is x = y = 0",
        "the origin or the room is wrong: set the origin of the geometry to the middle of the \
         floor, or give the room's true size ({expose.room_m}); the stations are \
         {sensors.lighthouse.stations}, the anchors {sensors.uwb.anchors_m}",
    )
}

/// Returns the stations, the take-off marks, and the camera if its pose is fixed. The severity is
/// that of the finding if the thing is outside.
fn things_in_room(shoot: &Shoot) -> Vec<RoomThing> {
    let marks = take_off_m(shoot).map(|[x, y]| ("take-off mark".to_owned(), [x, y, 0.0]));
    let things = stations(&shoot.scene).into_iter().chain(marks);
    let severity = Severity::Stop;
    let mut things: Vec<RoomThing> =
        things.map(|(name, position_m)| RoomThing { name, position_m, severity }).collect();
    if let Framing::Fixed(pose) = &shoot.scene.camera.framing {
        // A camera outside the room causes only a warning, because it may look in through a door.
        let (name, severity) = ("camera".to_owned(), Severity::Warning);
        things.push(RoomThing { name, position_m: pose.position_m, severity });
    }
    things
}

/// Checks that the scene's camera, or failing that a common camera, can be centered in front of the
/// word in the room. Returns `None` for a camera with a given pose, and without a word.
pub(super) fn check_camera_place(shoot: &Shoot, room_m: [f64; 3]) -> Result<Option<Diagnostic>> {
    let scene = &shoot.scene;
    let (Some(strokes), Framing::Word(_)) = (&shoot.strokes, &scene.camera.framing) else {
        return Ok(None);
    };
    let (word_m, most_m) = (strokes.bounds_m(), max_camera_distance_m(room_m));
    let least_m = center_in_front(scene.camera.clone(), word_m, room_m)?.1;
    // The message names the first common camera that fits.
    let mut other = None;
    for (name, options) in usual_cameras(scene) {
        if other.is_none() && center_in_front(options, word_m, room_m)?.1 <= most_m {
            other = Some(name);
        }
    }
    let (severity, verdict) = match other {
        _ if least_m <= most_m => (Severity::Fine, "fits in the room".to_owned()),
        Some(other) => (Severity::Warning, format!("does not fit in the room, but {other} does")),
        None => (Severity::Stop, "does not fit in the room, and no common lens does".to_owned()),
    };
    Ok(Some(Diagnostic::check(CAMERA_PLACE, severity, least_m).within(most_m).say(
        format!("{verdict}: the whole word needs {least_m:.1} m, and the room has {most_m:.1} m"),
        format!("a camera that shows the whole word from within {most_m:.1} m"),
        "write smaller letters ({letters.cap_height_m}), use a wider lens ({camera.lens}), give \
         the room's true depth ({expose.room_m}), or give the position of the camera \
         ({camera.framing}), for example in a door",
    )))
}

/// Returns the maximum distance from the word to a camera in a room.
fn max_camera_distance_m([_, depth_m, _]: [f64; 3]) -> f64 {
    0.5 * depth_m - TRIPOD_FROM_WALL_M
}

/// Returns the options of a camera centered in front of the word (left, bottom, right, top in m),
/// and the minimum distance in m at which it shows the whole word. The camera is moved closer if it
/// would be behind the wall, and farther away if it would obstruct the flight. If the room is not
/// deep enough, it is not moved.
fn center_in_front(
    options: CameraOptions,
    word_m: [f64; 4],
    room_m: [f64; 3],
) -> Result<(CameraOptions, f64)> {
    let word = match &options.framing {
        Framing::Word(framing) => framing.clone(),
        Framing::Fixed(_) => WordFraming::default(),
    };
    let framing = Framing::Word(WordFraming { fill_frac: MOST_FILLED, ..word.clone() });
    let nearest = CameraOptions { framing, ..options.clone() }.camera(word_m, 0.0)?;
    let (least_m, most_m) = (-nearest.position_m.y, max_camera_distance_m(room_m));
    let mut fill_frac = word.fill_frac;
    if least_m <= most_m {
        // The fraction filled by the word is inversely proportional to the distance.
        let [most_frac, least_frac] = [TRIPOD_FROM_WORD_M.min(most_m), most_m]
            .map(|distance_m| MOST_FILLED * least_m / distance_m);
        fill_frac = fill_frac.min(most_frac).max(least_frac);
    }
    let framing = Framing::Word(WordFraming { fill_frac, ..word });
    Ok((CameraOptions { framing, ..options }, least_m))
}

/// Moves the scene's camera into a room if the camera frames the word and the room is deep enough.
///
/// # Errors
///
/// Returns the errors of [`Scene::strokes`] and [`CameraOptions::camera`].
pub fn frame_within(scene: &mut Scene, room_m: [f64; 3]) -> Result<()> {
    if let Framing::Word(_) = scene.camera.framing {
        let word_m = scene.strokes()?.bounds_m();
        scene.camera = center_in_front(scene.camera.clone(), word_m, room_m)?.0;
    }
    Ok(())
}

/// Shrinks a scene's canvas to the area that its camera shows from inside a room, if the camera
/// frames the word.
pub fn fit_within(scene: &mut Scene, room_m: [f64; 3]) -> Result<()> {
    let (Framing::Word(_), Some([width_m, height_m])) =
        (&scene.camera.framing, scene.letters.canvas_m)
    else {
        return Ok(());
    };
    // Each side of the canvas is limited only by the same side of the picture. The other side is
    // therefore made too short to matter.
    const SHORT: f64 = 0.01;
    let width_frac = shown_frac(scene, [width_m, SHORT * width_m], room_m)?;
    let height_frac = shown_frac(scene, [SHORT * height_m, height_m], room_m)?;
    scene.letters.canvas_m = Some([width_m * width_frac, height_m * height_frac]);
    Ok(())
}

/// Returns the fraction, at most 1, to which a word of a width and height must be scaled so that
/// the camera shows it from inside a room.
fn shown_frac(scene: &Scene, [width_m, height_m]: [f64; 2], room_m: [f64; 3]) -> Result<f64> {
    let low_m = scene.letters.baseline_m;
    let word_m = [-0.5 * width_m, low_m, 0.5 * width_m, low_m + height_m];
    let least_m = center_in_front(scene.camera.clone(), word_m, room_m)?.1;
    // The factor prevents rounding errors from moving the camera into the wall.
    Ok((max_camera_distance_m(room_m) / least_m * (1.0 - 1e-6)).min(1.0))
}

impl ShotPlan {
    /// Returns the plan as table rows, each with an object and its position.
    pub fn rows(&self) -> Vec<[String; 2]> {
        let Self { room_m: [w, d, h], word_m: [left, bottom, right, top], .. } = self;
        let room = format!("{w} x {d} x {h} m, centered at x = y = 0, with y away from the camera");
        let rows = [
            ("room", room),
            ("word", format!("{:.2} x {:.2} m, at y = 0", right - left, top - bottom)),
            ("take-off", positions(&self.take_off_m)),
            ("stations", positions(&self.stations_m)),
            ("audience", self.audience()),
        ];
        let things = rows.into_iter().map(|(thing, position)| [thing.to_owned(), position]);
        let cameras = self.cameras.iter().map(|camera| [camera.name.clone(), camera.sentence()]);
        things.chain(cameras).collect()
    }

    /// Returns a description of where the audience may stand.
    fn audience(&self) -> String {
        let from_m = self.audience_from_m;
        let tripod_m = self.cameras.first().and_then(|camera| camera.tripod_m);
        match self.audience_y_m {
            // Nobody may stand beside a tripod that is closer to the flight than people may be.
            Some(y_m) => {
                let beside = match tripod_m {
                    Some([_, tripod_y_m, _]) if tripod_y_m > y_m => {
                        ", with nobody beside the tripod, which is closer"
                    }
                    Some(_) => ", beside or behind the tripod",
                    None => "",
                };
                let y = meters((100.0 * y_m).floor() / 100.0);
                format!("at y below {y}, {from_m:.1} m from the flight{beside}")
            }
            None => format!(
                "outside the room, which is not deep enough: {from_m:.1} m from the flight, as far as \
                 a drone without commands may come"
            ),
        }
    }
}

impl CameraPlace {
    /// Returns the tripod's position and the camera's settings, or the focal length and cap height
    /// that would fit if the room is not deep enough.
    pub fn sentence(&self) -> String {
        let Some(position_m) = self.tripod_m else {
            let letters = self.largest_cap_height_m.map_or_else(String::new, |cap_m| {
                format!(", or letters of {:.2} m", (100.0 * cap_m).floor() / 100.0)
            });
            let (least_m, equivalent_mm) = (self.least_m, 1e3 * self.equivalent_m);
            // The focal length is rounded down, so that a lens of that length fits.
            let longest_mm = (1e3 * self.longest_equivalent_m).floor();
            return format!(
                "nowhere: the room is not deep enough for {least_m:.1} m with {equivalent_mm:.0} \
                 mm (full-frame equivalent); {longest_mm:.0} mm would fit{letters}"
            );
        };
        let position = position_m.map(meters).join(", ");
        let Some(metered) = self.metered else { return format!("tripod at ({position})") };
        let help = metered.help().map_or_else(String::new, |help| format!("; {help}"));
        let (f_number, iso, shutter_s) = (metered.f_number, metered.iso, self.shutter_s.ceil());
        format!("tripod at ({position}), f/{f_number}, ISO {iso}, shutter {shutter_s:.0} s{help}")
    }
}

/// Returns positions separated by commas, or `none` if there are none.
fn positions<const N: usize>(positions_m: &[[f64; N]]) -> String {
    let texts = positions_m.iter().map(|m| format!("({})", m.map(meters).join(", ")));
    if positions_m.is_empty() { "none".to_owned() } else { texts.collect::<Vec<_>>().join(", ") }
}

/// Returns a length in m as text with two decimals, and without a negative zero.
fn meters(value_m: f64) -> String {
    format!("{:.2}", (100.0 * value_m).round() / 100.0 + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Preset;
    use crate::shoot::Lighting;

    fn placed(word: &str, cap_m: f64, room_m: [f64; 3]) -> (Shoot, Lighting, ShotPlan) {
        let profile = Profile::indoor().in_room(room_m);
        let mut scene = Scene { word: word.into(), ..Scene::preset(Preset::default()) };
        scene.letters.cap_height_m = cap_m;
        scene.sensors.lighthouse.stations = profile.stations().into();
        let shoot = Shoot::new(scene).unwrap();
        let lighting = shoot.clone().lighting(&|_, _| {}).unwrap();
        let end_s = lighting.camera.shutter_close_s;
        let paths = Paths::new(&shoot, &lighting.flights);
        let placement =
            plan_shot(&shoot, &lighting.trace, end_s, &profile, &paths).unwrap().unwrap();
        (shoot, lighting, placement)
    }

    #[test]
    fn a_camera_that_has_a_place_in_the_room_shows_the_whole_word_from_it() {
        let (mut n_fit, mut n_none) = (0, 0);
        for room_m in [[4.0, 3.0, 2.5], [5.0, 6.0, 2.5], [9.0, 12.0, 3.0]] {
            let (shoot, _, placement) = placed("NO", 1.2, room_m);
            let [left, bottom, right, top] = placement.word_m;
            let usual = usual_cameras(&shoot.scene).map(|(_, options)| options);
            let options = [shoot.scene.camera.clone()].into_iter().chain(usual);
            for (actual, options) in placement.cameras.iter().zip(options) {
                // The formula is verified by projecting the corners of the word with that camera.
                let y_m = actual.tripod_m.map_or(0.3 - 0.5 * room_m[1], |place| place[1]);

                let mut camera = options.camera(placement.word_m, 1.0).unwrap();
                camera.position_m.y = y_m;
                let corners = [[left, bottom], [right, bottom], [left, top], [right, top]];
                let corners = corners.map(|[x, z]| nalgebra::Vector3::new(x, 0.0, z));
                let middle_m = 0.5 * (left + right);
                let shown = |scale: f64| {
                    let corners = corners.map(|c| {
                        let x = middle_m + (c.x - middle_m) / scale;
                        let z = camera.position_m.z + (c.z - camera.position_m.z) / scale;
                        nalgebra::Vector3::new(x, 0.0, z)
                    });
                    camera.outside(corners).is_none()
                };
                if actual.tripod_m.is_some() {
                    n_fit += 1;
                    assert!(shown(1.0), "{actual:?}");
                    assert!(y_m >= 0.3 - 0.5 * room_m[1] - 1e-9, "{actual:?}");
                } else {
                    n_none += 1;
                    // Barrel distortion shows slightly more than the formula predicts.
                    assert!(!shown(0.85), "it would have: {actual:?}");
                    assert!(actual.longest_equivalent_m < actual.equivalent_m, "{actual:?}");
                }
            }
        }
        assert!(n_fit > 6 && n_none > 3, "{n_fit} and {n_none}");
    }

    #[test]
    fn the_scenes_camera_is_metered_as_preview_meters_it() {
        let (shoot, lighting, placement) = placed("I", 0.5, [9.0, 12.0, 3.0]);
        let camera = &placement.cameras[0];
        assert_eq!(camera.tripod_m.unwrap(), <[f64; 3]>::from(lighting.camera.position_m));
        assert_eq!(camera.metered, lighting.metered);
        assert_eq!(camera.metered, lighting.recommended(&shoot.scene));
    }

    #[test]
    fn the_audience_is_beyond_what_a_drone_flies_and_falls() {
        let (mut shoot, lighting, hall) = placed("I", 0.5, [9.0, 12.0, 3.0]);
        assert!((1.0..4.0).contains(&hall.audience_from_m), "{}", hall.audience_from_m);
        assert!(hall.audience_y_m.unwrap() <= -hall.audience_from_m);
        // The velocity columns of the plan are ignored. Even at low speed people keep a meter away.
        let plan = &mut shoot.plans[0].plan;
        plan.edit(|plan| plan.setpoints.iter_mut().for_each(|s| s.velocity_m_s *= 0.1));
        let paths = Paths::new(&shoot, &lighting.flights);
        assert_eq!(paths.audience_from_m, hall.audience_from_m);
        let plan = &mut shoot.plans[0].plan;
        plan.edit(|plan| plan.setpoints.iter_mut().for_each(|s| s.time_s *= 20.0));
        assert_eq!(Paths::new(&shoot, &[]).audience_from_m, 1.0);
        let (_, _, closet) = placed("I", 0.5, [2.0, 2.0, 2.5]);
        assert_eq!(closet.audience_y_m, None);
        assert!(closet.rows().iter().any(|[_, place]| place.starts_with("outside")));
    }
}
