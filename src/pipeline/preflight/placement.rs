//! The shot plan: where tripod, take-off mark, base stations and audience go in a room, and which
//! cameras show the whole word from within it.
//!
//! In: a [`Shoot`], the light of its flights, and the [`Profile`] of a room. Out: a [`ShotPlan`],
//! in meters of the world: the room's middle is at x = y = 0 and the word stands at y = 0. A camera
//! stands square in front of the word, where the word fills half of the picture, or nearer as the
//! room asks. Not known: doors.

use serde::Serialize;

use super::obstacles::{Ways, stations};
use super::{Profile, cap_height_m};
use crate::scene::Scene;
use crate::shoot::{Metered, Shoot, recommended};
use noctograph_core::camera::{
    BodyModel, CameraOptions, CustomLens, Framing, LensModel, Metering, TrailMetering, WordFraming,
};
use noctograph_core::diagnostic::{Diagnostic, Severity};
use noctograph_core::error::Result;
use noctograph_export::safety::FRAME_M;
use noctograph_picture::light::LightTrace;

/// Least distance of a tripod from the wall behind it, an assumption: its legs, and a hand at the
/// release. Less would show more of the word from a small room.
const TRIPOD_FROM_WALL_M: f64 = 0.3;

/// Least distance of a camera from the word, where the room has it: small letters in a small room
/// would else be taken from within the flight's way.
const TRIPOD_FROM_WORD_M: f64 = 0.5;

/// Most of the picture's width or height that the word may fill: the rest is for its glow, and for
/// a tripod that stands a little aside.
const MOST_FILLED: f64 = 0.9;

/// The check of the camera's place in a room, which a preview does without.
pub const CAMERA_PLACE: &str = "camera";

/// Where things stand in a room, and which cameras show the word from within it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShotPlan {
    /// Width, depth and height of the room.
    pub room_m: [f64; 3],
    /// Left, bottom, right and top of the word, in the plane y = 0.
    pub word_m: [f64; 4],
    /// Take-off marks of the drones, x and y.
    pub take_off_m: Vec<[f64; 2]>,
    /// Base stations or anchors.
    pub stations_m: Vec<[f64; 3]>,
    /// Distance that people keep from the flight, in tenths of a meter: a drone that hears no more
    /// commands flies on until its motors stop, and falls. Its speed is the greatest of the plans'
    /// places, or that at which it is flown sideways.
    pub audience_from_m: f64,
    /// Greatest y of the audience, in front of the flight; `None`: no place in the room is far
    /// enough.
    pub audience_y_m: Option<f64>,
    /// The scene's camera, then others that people own.
    pub cameras: Vec<CameraPlace>,
}

/// A camera in a room.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraPlace {
    /// Body and lens.
    pub name: String,
    /// Focal length on full frame with the same angle of view across the picture.
    pub equivalent_m: f64,
    /// Least camera distance with the whole word in the picture.
    pub least_m: f64,
    /// Place of the lens; `None`: the room is not deep enough.
    pub tripod_m: Option<[f64; 3]>,
    /// Longest equivalent focal length that shows the word from within the room.
    pub longest_equivalent_m: f64,
    /// Height of capitals that it would show from there; `None` of a drawing.
    pub largest_cap_height_m: Option<f64>,
    /// Duration of the exposure.
    pub shutter_s: f64,
    /// Aperture and sensitivity; `None` where it has no place, and in darkness.
    #[serde(rename = "recommended")]
    pub metered: Option<Metered>,
}

/// Bodies and lenses that people own: the widest usual one of each.
fn owned() -> [(&'static str, BodyModel, LensModel); 7] {
    let zoom =
        |focal_length_m| LensModel::Custom(CustomLens { focal_length_m, ..CustomLens::default() });
    let own = LensModel::default;
    [
        ("full frame, 28 mm", BodyModel::FullFrame24Mp, LensModel::Wide28),
        ("Sony α6400, 16 mm", BodyModel::A6400, LensModel::Kit16),
        ("Canon EOS 2000D, 18 mm", BodyModel::CanonEos2000D, zoom(0.018)),
        // The short end of the Sony DSC-RX100M7: 9 mm.
        ("compact, 1 inch, 9 mm", BodyModel::OneInch, zoom(0.009)),
        ("iPhone 15 Pro", BodyModel::IPhone15Pro, own()),
        ("Pixel 8 Pro", BodyModel::Pixel8Pro, own()),
        ("Galaxy S24", BodyModel::GalaxyS24, own()),
    ]
}

/// Places everything in the room of a profile; `None` without a room or without strokes. The light
/// is that of all drones, until `end_s`.
///
/// # Errors
///
/// As [`CameraOptions::camera`].
pub(super) fn place(
    shoot: &Shoot,
    trace: &LightTrace,
    end_s: f64,
    profile: &Profile,
    ways: &Ways,
) -> Result<Option<ShotPlan>> {
    let (Some(room_m), Some(strokes)) = (profile.room_m, &shoot.strokes) else { return Ok(None) };
    let scene = &shoot.scene;
    let word_m = strokes.bounds_m();
    let audience_from_m = ways.audience_from_m;
    let audience_y_m = Some(ways.front_m() - audience_from_m).filter(|y_m| *y_m > -0.5 * room_m[1]);

    let place = |name: String, options: CameraOptions| -> Result<CameraPlace> {
        let is_fixed = matches!(options.framing, Framing::Fixed(_));
        let (square, least_m) = framed(options.clone(), word_m, room_m)?;
        let options = if is_fixed { options } else { square };
        let camera = options.camera(word_m, end_s)?;
        let most_m = most_m(room_m);
        let equivalent_m = camera.focal_length_m * 0.036 / camera.sensor_width_m;
        let fits = is_fixed || least_m <= most_m;
        let metered = fits.then(|| recommended(trace, &camera, &options, &scene.photo));
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
    };
    let own = format!("the scene's, {:.0} mm", 1e3 * scene.camera.focal_length_m());
    let mut cameras = vec![place(own, scene.camera.clone())?];
    for (name, body, lens) in owned() {
        cameras.push(place(name.to_owned(), usual(scene, body, lens))?);
    }
    Ok(Some(ShotPlan {
        room_m,
        word_m,
        take_off_m: take_off_m(shoot).collect(),
        stations_m: stations(scene).1,
        audience_from_m,
        audience_y_m,
        cameras,
    }))
}

/// Where each drone takes off.
fn take_off_m(shoot: &Shoot) -> impl Iterator<Item = [f64; 2]> {
    let starts = shoot.plans.iter().filter_map(|planned| planned.plan.setpoints.first());
    starts.map(|start| [start.position_m.x, start.position_m.y])
}

/// Things outside the room: either the origin or the room is wrong, and then so is the place of the
/// flight.
pub(super) fn outside_of(shoot: &Shoot, room_m: [f64; 3]) -> Diagnostic {
    let [width_m, depth_m, height_m] = room_m;
    let (name, stations_m) = stations(&shoot.scene);
    let station = |(index, place_m)| (format!("{name} {}", index + 1), place_m, Severity::Stop);
    let mut places: Vec<(String, [f64; 3], Severity)> =
        stations_m.into_iter().enumerate().map(station).collect();
    let marks = take_off_m(shoot).map(|[x, y]| [x, y, 0.0]);
    places.extend(marks.map(|place_m| ("take-off mark".to_owned(), place_m, Severity::Stop)));
    if let Framing::Fixed(pose) = &shoot.scene.camera.framing {
        // It may look in through a door.
        places.push(("camera".to_owned(), pose.position_m, Severity::Warning));
    }
    let by_m = |[x, y, z]: [f64; 3]| {
        let sides = [x.abs() - 0.5 * width_m, y.abs() - 0.5 * depth_m, z - height_m, -z];
        sides.into_iter().fold(0.0, f64::max)
    };
    let n = places.len();
    places.retain(|(_, place_m, _)| by_m(*place_m) > FRAME_M);
    let farthest_m = places.iter().map(|(_, place_m, _)| *place_m);
    let farthest_m = farthest_m.max_by(|a, b| by_m(*a).total_cmp(&by_m(*b)));
    let severity = places.iter().map(|(.., severity)| *severity).max().unwrap_or_default();
    let named: Vec<&str> = places.iter().map(|(what, ..)| what.as_str()).collect();
    let sentence = |(what, place_m, _): &(String, [f64; 3], Severity)| {
        let ([x, y, z], by_m) = (*place_m, by_m(*place_m));
        format!("{what} at ({x:.2}, {y:.2}, {z:.2}), {by_m:.2} m outside")
    };
    let actual = match places.is_empty() {
        true => format!("all {n} places of stations, anchors, drones and camera are in the room"),
        false => places.iter().map(sentence).collect::<Vec<_>>().join("; "),
    };
    let row = Diagnostic::check("frame", severity, farthest_m.map_or(0.0, by_m)).within(FRAME_M);
    row.positioned(farthest_m).detailed(named.join(", ")).say(
        actual,
        "stations, anchors, take-off marks and camera in the room, whose middle is x = y = 0",
        "the origin or the room is wrong: set the origin of the geometry to the middle of the floor, \
         or type the room's true size ({expose.room_m}); the stations are \
         {sensors.lighthouse.stations}, the anchors {sensors.uwb.anchors_m}",
    )
}

/// Whether the room has a place centered in front of the word for the scene's camera, or else for a
/// usual camera. `None` for a camera with a given pose, and without a word.
pub(super) fn camera_place(shoot: &Shoot, room_m: [f64; 3]) -> Result<Option<Diagnostic>> {
    let scene = &shoot.scene;
    let (Some(strokes), Framing::Word(_)) = (&shoot.strokes, &scene.camera.framing) else {
        return Ok(None);
    };
    let (word_m, most_m) = (strokes.bounds_m(), most_m(room_m));
    let least_m = framed(scene.camera.clone(), word_m, room_m)?.1;
    let mut other = None;
    for (name, body, lens) in owned() {
        if other.is_none() && framed(usual(scene, body, lens), word_m, room_m)?.1 <= most_m {
            other = Some(name);
        }
    }
    let (severity, shows) = match other {
        _ if least_m <= most_m => (Severity::Fine, "fits in the room".to_owned()),
        Some(other) => (Severity::Warning, format!("does not fit in the room; {other} does")),
        None => (Severity::Stop, "does not fit in the room, and no usual one does".to_owned()),
    };
    Ok(Some(Diagnostic::check(CAMERA_PLACE, severity, least_m).within(most_m).say(
        format!("{shows}: the whole word takes {least_m:.1} m, and {most_m:.1} m are there"),
        format!("a camera that shows the whole word from within {most_m:.1} m"),
        "write smaller letters ({letters.cap_height_m}), take a wider lens ({camera.lens}), type \
         the room's true depth ({expose.room_m}), or say where the camera stands \
         ({camera.framing}): in a door, for instance",
    )))
}

/// Greatest distance of a camera in a room from the word.
fn most_m([_, depth_m, _]: [f64; 3]) -> f64 {
    0.5 * depth_m - TRIPOD_FROM_WALL_M
}

/// A camera that people own in the place of the scene's.
fn usual(scene: &Scene, body: BodyModel, lens: LensModel) -> CameraOptions {
    let metering = Metering::Trail(TrailMetering::default());
    let (framing, f_number) = (Framing::Word(WordFraming::default()), 8.0);
    CameraOptions { body, lens, metering, framing, f_number, ..scene.camera.clone() }
}

/// A camera square in front of the word, moved nearer where it would stand behind the wall of the
/// room and the whole word stays in the picture, and farther off where it would stand in the
/// flight's way; and its least distance from the word.
fn framed(
    options: CameraOptions,
    word_m: [f64; 4],
    room_m: [f64; 3],
) -> Result<(CameraOptions, f64)> {
    let word = match &options.framing {
        Framing::Word(framing) => framing.clone(),
        Framing::Fixed(_) => WordFraming::default(),
    };
    let filled = |fill_frac| {
        let framing = Framing::Word(WordFraming { fill_frac, ..word.clone() });
        CameraOptions { framing, ..options.clone() }
    };
    let (least_m, most_m) =
        (-filled(MOST_FILLED).camera(word_m, 0.0)?.position_m.y, most_m(room_m));
    if least_m > most_m {
        return Ok((filled(word.fill_frac), least_m));
    }
    let fill_from = |distance_m: f64| MOST_FILLED * least_m / distance_m;
    let [most_frac, least_frac] = [TRIPOD_FROM_WORD_M.min(most_m), most_m].map(fill_from);
    Ok((filled(word.fill_frac.min(most_frac).max(least_frac)), least_m))
}

/// Frames the scene's word from within a room, where the scene's camera stands square in front of
/// it and can.
///
/// # Errors
///
/// As [`Scene::strokes`] and [`CameraOptions::camera`].
pub fn frame_within(scene: &mut Scene, room_m: [f64; 3]) -> Result<()> {
    if let Framing::Word(_) = scene.camera.framing {
        let word_m = scene.strokes()?.bounds_m();
        scene.camera = framed(scene.camera.clone(), word_m, room_m)?.0;
    }
    Ok(())
}

/// The part of a scene's canvas that its camera shows whole from within a room, where it stands
/// square in front of the word; `None` where there is no canvas or another camera.
///
/// # Errors
///
/// As [`CameraOptions::camera`].
pub fn canvas_within(scene: &Scene, room_m: [f64; 3]) -> Result<Option<[f64; 2]>> {
    let (Framing::Word(_), Some(canvas_m)) = (&scene.camera.framing, scene.letters.canvas_m) else {
        return Ok(None);
    };
    let low_m = scene.letters.baseline_m;
    let most_m = most_m(room_m);
    let shown = |size_m: [f64; 2], side_m: f64| -> Result<f64> {
        let word_m = [-0.5 * size_m[0], low_m, 0.5 * size_m[0], low_m + size_m[1]];
        let least_m = framed(scene.camera.clone(), word_m, room_m)?.1;
        // A hair less, so that rounding leaves the camera its place.
        Ok(side_m * (most_m / least_m * (1.0 - 1e-6)).min(1.0))
    };
    let [width_m, height_m] = canvas_m;
    let (thin_m, flat_m) = ([0.01 * height_m, height_m], [width_m, 0.01 * width_m]);
    Ok(Some([shown(flat_m, width_m)?, shown(thin_m, height_m)?]))
}

impl ShotPlan {
    /// The answer as rows of a table: what, and where.
    pub fn rows(&self) -> Vec<[String; 2]> {
        let Self { room_m: [w, d, h], word_m: [left, bottom, right, top], .. } = self;
        let flat = |[x, y]: [f64; 2]| format!("({}, {})", meters(x), meters(y));
        let solid = |place: [f64; 3]| format!("({})", place.map(meters).join(", "));
        let list = |places: Vec<String>| match places.is_empty() {
            true => "none".to_owned(),
            false => places.join(", "),
        };
        let from_m = self.audience_from_m;
        let tripod_m = self.cameras.first().and_then(|camera| camera.tripod_m);
        let audience = match self.audience_y_m {
            Some(y_m) => {
                let beside = match tripod_m {
                    Some([_, tripod_y_m, _]) if tripod_y_m > y_m => {
                        "; nobody beside the tripod, which is nearer"
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
        };
        let room = format!("{w} x {d} x {h} m, its middle at x = y = 0, y away from the camera");
        let rows = [
            ("room", room),
            ("word", format!("{:.2} x {:.2} m, at y = 0", right - left, top - bottom)),
            ("take-off", list(self.take_off_m.iter().copied().map(flat).collect())),
            ("stations", list(self.stations_m.iter().copied().map(solid).collect())),
            ("audience", audience),
        ];
        let rows = rows.into_iter().map(|(what, place)| [what.to_owned(), place]);
        let cameras = self.cameras.iter().map(|camera| [camera.name.clone(), camera.sentence()]);
        rows.chain(cameras).collect()
    }
}

impl CameraPlace {
    /// Where it stands and how it is set, or what would.
    pub fn sentence(&self) -> String {
        let Some(place) = self.tripod_m else {
            let letters = self.largest_cap_height_m.map_or_else(String::new, |cap_m| {
                format!(", or letters of {:.2} m", (100.0 * cap_m).floor() / 100.0)
            });
            let (least_m, own_mm) = (self.least_m, 1e3 * self.equivalent_m);
            let longest_mm = (1e3 * self.longest_equivalent_m).floor();
            return format!(
                "nowhere: the room is not deep enough for {least_m:.1} m with {own_mm:.0} mm \
                 (full-frame equivalent); {longest_mm:.0} mm would do{letters}"
            );
        };
        let place = place.map(meters).join(", ");
        let Some(metered) = self.metered else { return format!("tripod at ({place})") };
        let help = metered.help().map_or_else(String::new, |help| format!("; {help}"));
        let (f_number, iso, shutter_s) = (metered.f_number, metered.iso, self.shutter_s.ceil());
        format!("tripod at ({place}), f/{f_number}, ISO {iso}, shutter {shutter_s:.0} s{help}")
    }
}

/// To centimeters, without a negative zero.
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
        let ways = Ways::new(&shoot, &lighting.flights);
        let placement = place(&shoot, &lighting.trace, end_s, &profile, &ways).unwrap().unwrap();
        (shoot, lighting, placement)
    }

    #[test]
    fn a_camera_that_has_a_place_in_the_room_shows_the_whole_word_from_it() {
        let (mut n_fit, mut n_none) = (0, 0);
        for room_m in [[4.0, 3.0, 2.5], [5.0, 6.0, 2.5], [9.0, 12.0, 3.0]] {
            let (shoot, _, placement) = placed("NO", 1.2, room_m);
            let [left, bottom, right, top] = placement.word_m;
            let all = [(BodyModel::default(), LensModel::default())];
            let all = all.into_iter().chain(owned().map(|(_, body, lens)| (body, lens)));
            for (actual, (body, lens)) in placement.cameras.iter().zip(all) {
                // Whatever the formula says: the corners of the word, seen by that camera.
                let y_m = actual.tripod_m.map_or(0.3 - 0.5 * room_m[1], |place| place[1]);
                let options = CameraOptions { body, lens, ..shoot.scene.camera.clone() };
                let mut camera = options.camera(placement.word_m, 1.0).unwrap();
                camera.position_m.y = y_m;
                let corners = [[left, bottom], [right, bottom], [left, top], [right, top]];
                let corners = corners.map(|[x, z]| nalgebra::Vector3::new(x, 0.0, z));
                let middle_m = 0.5 * (left + right);
                let edge = |share: f64| {
                    corners.map(|c| {
                        let x = middle_m + (c.x - middle_m) / share;
                        let z = camera.position_m.z + (c.z - camera.position_m.z) / share;
                        nalgebra::Vector3::new(x, 0.0, z)
                    })
                };
                let shown = |share| camera.outside(edge(share)).is_none();
                if actual.tripod_m.is_some() {
                    n_fit += 1;
                    assert!(shown(1.0), "{actual:?}");
                    assert!(y_m >= 0.3 - 0.5 * room_m[1] - 1e-9, "{actual:?}");
                } else {
                    n_none += 1;
                    // Barrel distortion shows a little more than the formula.
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
        let own = &placement.cameras[0];
        assert_eq!(own.tripod_m.unwrap(), <[f64; 3]>::from(lighting.camera.position_m));
        assert_eq!(own.metered, lighting.metered);
        assert_eq!(own.metered, lighting.recommended(&shoot.scene));
    }

    #[test]
    fn the_audience_is_beyond_what_a_drone_flies_and_falls() {
        let (mut shoot, lighting, hall) = placed("I", 0.5, [9.0, 12.0, 3.0]);
        assert!((1.0..4.0).contains(&hall.audience_from_m), "{}", hall.audience_from_m);
        assert!(hall.audience_y_m.unwrap() <= -hall.audience_from_m);
        // Its columns may say what they will, and at a crawl people keep a meter.
        let plan = &mut shoot.plans[0].plan;
        plan.edit(|plan| plan.setpoints.iter_mut().for_each(|s| s.velocity_m_s *= 0.1));
        let told = Ways::new(&shoot, &lighting.flights).audience_from_m;
        assert_eq!(told, hall.audience_from_m);
        let plan = &mut shoot.plans[0].plan;
        plan.edit(|plan| plan.setpoints.iter_mut().for_each(|s| s.time_s *= 20.0));
        assert_eq!(Ways::new(&shoot, &[]).audience_from_m, 1.0);
        let (_, _, closet) = placed("I", 0.5, [2.0, 2.0, 2.5]);
        assert_eq!(closet.audience_y_m, None);
        assert!(closet.rows().iter().any(|[_, place]| place.starts_with("outside")));
    }
}
