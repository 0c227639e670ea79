//! A room that is named by its size: how large a word may be in it, and where its stations hang.

use super::{Profile, canvas_within};
use crate::scene::Scene;
use noctograph_core::error::Result;

/// Least distance of the word from the sides of the volume that a drone may fly in, and from its
/// top: a base station 0.1 m higher then sees the word's top from as far as it reaches, 6 m.
const FROM_SIDES_M: f64 = 0.3;
const FROM_TOP_M: f64 = 0.5;

/// Width that two base stations serve (Bitcraze, "Getting started with the Lighthouse system":
/// about 4 m by 4 m).
const SERVED_M: f64 = 4.0;

/// Least and greatest room, m: a flight with its margins; a sports hall (three playing fields are
/// 27 m by 45 m, DIN 18032), with room to spare.
const LEAST_ROOM_M: [f64; 3] = [1.5, 1.5, 1.0];
const GREATEST_ROOM_M: [f64; 3] = [60.0, 60.0, 20.0];

/// Units that sizes of rooms are typed in by mistake, per meter.
const OTHER_UNITS: [(&str, f64); 3] =
    [("centimeters", 100.0), ("millimeters", 1000.0), ("inches", 39.37)];

/// Reads the size of a room: `4x3x2.5`.
///
/// # Errors
///
/// What is wanted, and the unit that was probably meant.
pub fn parse_room(text: &str) -> std::result::Result<[f64; 3], String> {
    let in_words = |room_m: [f64; 3]| room_m.map(|m| format!("{m}")).join("x");
    let wanted = format!(
        "wanted WIDTHxDEPTHxHEIGHT in meters, from {} to {}, such as 4x3x2.5",
        in_words(LEAST_ROOM_M),
        in_words(GREATEST_ROOM_M)
    );
    let sides = text.split(['x', 'X', '×']).map(|side| side.trim().parse().ok());
    let sides: Option<Vec<f64>> = sides.collect();
    let Some(Ok(sides)) = sides.map(<[f64; 3]>::try_from) else { return Err(wanted) };
    fn fits(sides: [f64; 3]) -> bool {
        (0..3).all(|side| (LEAST_ROOM_M[side]..=GREATEST_ROOM_M[side]).contains(&sides[side]))
    }
    if fits(sides) {
        return Ok(sides);
    }
    let meant = OTHER_UNITS.into_iter().map(|(unit, per_m)| (unit, sides.map(|m| m / per_m)));
    Err(match meant.into_iter().find(|(_, room_m)| fits(*room_m)) {
        Some((unit, room_m)) => {
            let room_m = in_words(room_m.map(|m| (100.0 * m).round() / 100.0));
            format!("is this in {unit}, a room of {room_m} m? {wanted}")
        }
        None => wanted,
    })
}

/// Keys of a scene whose letters fill a room, under those that are typed: a height that was typed
/// is meant, no room shrinks it, and the check stops what is too large.
#[expect(clippy::fn_params_excessive_bools, reason = "independent of each other")]
pub fn letters_within(
    room_m: [f64; 3],
    is_drawing: bool,
    is_height_typed: bool,
) -> Vec<(String, String)> {
    let [low, high] = Profile::indoor().in_room(room_m).volume_m;
    let wide_m = (high[0] - low[0] - 2.0 * FROM_SIDES_M).min(SERVED_M);
    // A low room has the word nearer to its floor.
    let baseline_m = (0.25 * room_m[2]).min(0.5);
    let high_m = high[2] - FROM_TOP_M - baseline_m;
    let canvas_m = if is_height_typed { [1000.0; 2] } else { [wide_m, high_m] };
    let mut keys = vec![
        ("letters.canvas_m", format!("{canvas_m:?}")),
        ("letters.baseline_m", baseline_m.to_string()),
        ("letters.align", "center".to_owned()),
    ];
    // A drawing fills its canvas as it is.
    if !is_drawing && !is_height_typed {
        keys.push(("letters.fit", "fill".to_owned()));
    }
    keys.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

/// Hangs the stations of a scene that places none in the corners of a room.
pub fn hang_stations(scene: &mut Scene, room_m: [f64; 3]) {
    let usual = Scene::preset(scene.preset).sensors.lighthouse.stations;
    let stations = &mut scene.sensors.lighthouse.stations;
    if *stations == usual {
        *stations = Profile::indoor().in_room(room_m).stations().into();
    }
}

/// Fits a word to the view of a camera inside a room.
///
/// # Errors
///
/// As [`canvas_within`].
pub fn fit_within(scene: &mut Scene, room_m: [f64; 3]) -> Result<()> {
    if let Some(canvas_m) = canvas_within(scene, room_m)? {
        scene.letters.canvas_m = Some(canvas_m);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_room_in_another_unit_is_asked_about_and_halls_are_bounded() {
        assert_eq!(parse_room("4x3x2.5"), Ok([4.0, 3.0, 2.5]));
        assert_eq!(parse_room("20 X 20 × 8"), Ok([20.0, 20.0, 8.0]));
        for (typed, question) in [
            ("400x300x250", "is this in centimeters, a room of 4x3x2.5 m?"),
            ("4000x3000x2500", "is this in millimeters, a room of 4x3x2.5 m?"),
            ("100x30x8", "wanted WIDTHxDEPTHxHEIGHT in meters, from 1.5x1.5x1 to 60x60x20"),
            ("1x3x2.5", "wanted"),
            ("4x3", "wanted"),
            ("nanx3x2", "wanted"),
        ] {
            let error = parse_room(typed).unwrap_err();
            assert!(error.starts_with(question), "{typed}: {error}");
        }
    }
}
