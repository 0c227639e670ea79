//! Parses the size of a room, and determines the largest word and the stations that fit in it.

use super::Profile;
use crate::scene::Scene;
use noctograph_core::units::FOOT_M;

/// Minimum distance from the word to the sides of the flight volume.
const FROM_SIDES_M: f64 = 0.3;
/// Minimum distance from the word to the top of the flight volume. A base station 0.1 m above the
/// volume then sees the top of the word at 6 m, its maximum range.
const FROM_TOP_M: f64 = 0.5;

/// Width covered by two base stations (Bitcraze, "Getting started with the Lighthouse system").
const SERVED_M: f64 = 4.0;

/// Width, depth and height of the smallest room, just enough for a flight and its margins, and of
/// the largest room, which exceeds a sports hall (three fields are 27 m by 45 m, DIN 18032).
const LEAST_ROOM_M: [f64; 3] = [1.5, 1.5, 1.0];
const GREATEST_ROOM_M: [f64; 3] = [60.0, 60.0, 20.0];

/// Units in which a user may mistakenly specify a room, and their number per meter.
const OTHER_UNITS: [(&str, f64); 4] =
    [("centimeters", 100.0), ("millimeters", 1000.0), ("inches", 39.37), ("feet", 1.0 / FOOT_M)];

/// Units that may follow the numbers, and their length in meters.
const UNITS: [(&str, f64); 4] = [("cm", 0.01), ("mm", 0.001), ("ft", FOOT_M), ("m", 1.0)];

/// Ceiling height from which numbers without a unit are refused. Rooms are often 8 feet high, but
/// few halls are 8 m high. A sports hall 7 m high is accepted with a warning (check `room`).
const FEET_FROM: f64 = 7.5;

/// Returns a room's size in m as text rounded to centimeters: `4x3x2.5`.
fn in_words(room_m: [f64; 3]) -> String {
    room_m.map(|m| ((100.0 * m).round() / 100.0).to_string()).join("x")
}

/// Returns a room's size as text in meters, given its width, depth and height in feet.
pub(super) fn from_feet(room_ft: [f64; 3]) -> String {
    in_words(room_ft.map(|feet| FOOT_M * feet))
}

/// Parses the size of a room in meters, such as `4x3x2.5`, or with a unit, such as `13x20x8ft`.
///
/// # Errors
///
/// Returns a message that states the accepted sizes and the unit that was probably meant.
pub fn parse_room(text: &str) -> Result<[f64; 3], String> {
    let wanted = format!(
        "wanted WIDTHxDEPTHxHEIGHT in meters, from {} to {}, such as 4x3x2.5, or with its unit, such \
         as 20x30x9m or 13x20x8ft",
        in_words(LEAST_ROOM_M),
        in_words(GREATEST_ROOM_M)
    );
    let with_unit =
        UNITS.into_iter().find_map(|(unit, m)| Some((text.trim_end().strip_suffix(unit)?, m)));
    let (numbers, unit_m) = with_unit.map_or((text, None), |(numbers, m)| (numbers, Some(m)));
    let sides = numbers.split(['x', 'X', '×']).map(|side| side.trim().parse().ok());
    let sides: Option<Vec<f64>> = sides.collect();
    let Some(Ok(sides)) = sides.map(<[f64; 3]>::try_from) else { return Err(wanted) };
    // A size with a unit is not questioned. Converted sizes are rounded to millimeters.
    if let Some(unit_m) = unit_m {
        let room_m = match unit_m {
            1.0 => sides,
            _ => sides.map(|side| (1e3 * unit_m * side).round() / 1e3),
        };
        return if fits(room_m) { Ok(room_m) } else { Err(wanted) };
    }
    if fits(sides) && sides[2] < FEET_FROM {
        return Ok(sides);
    }
    // The message suggests the first unit in which the size is plausible for a room.
    let mut rooms =
        OTHER_UNITS.into_iter().map(|(unit, per_m)| (unit, sides.map(|side| side / per_m)));
    Err(match rooms.find(|(_, room_m)| fits(*room_m)) {
        Some((unit, room_m)) => {
            format!("is this in {unit}, a room of {} m? {wanted}", in_words(room_m))
        }
        None => wanted,
    })
}

/// A canvas larger than any room, which therefore shrinks no word.
const UNLIMITED_CANVAS_M: [f64; 2] = [1000.0; 2];

/// Returns true if the size of a room is within the limits.
fn fits(room_m: [f64; 3]) -> bool {
    (0..3).all(|side| (LEAST_ROOM_M[side]..=GREATEST_ROOM_M[side]).contains(&room_m[side]))
}

/// Returns the keys and values that make a scene's letters fill a room. `is_drawing` is true for a
/// drawing instead of a word. If the height of the letters is given (`is_height_typed`), they are
/// not shrunk. If they are too large for the room, the check stops the flight.
#[expect(clippy::fn_params_excessive_bools, reason = "independent of each other")]
pub fn letters_within(
    room_m: [f64; 3],
    is_drawing: bool,
    is_height_typed: bool,
) -> Vec<(String, String)> {
    let [low, high] = Profile::indoor().in_room(room_m).volume_m;
    let wide_m = (high[0] - low[0] - 2.0 * FROM_SIDES_M).min(SERVED_M);
    // The baseline is 0.5 m above the floor, or a quarter of the height in a low room.
    let baseline_m = (0.25 * room_m[2]).min(0.5);
    let high_m = high[2] - FROM_TOP_M - baseline_m;
    let canvas_m = if is_height_typed { UNLIMITED_CANVAS_M } else { [wide_m, high_m] };
    let mut keys = vec![
        ("letters.canvas_m", format!("{canvas_m:?}")),
        ("letters.baseline_m", baseline_m.to_string()),
        ("letters.align", "center".to_owned()),
    ];
    // A drawing always fills its canvas.
    if !is_drawing && !is_height_typed {
        keys.push(("letters.fit", "fill".to_owned()));
    }
    keys.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

/// Moves the base stations to the corners of a room unless the scene specifies their positions.
pub fn hang_stations(scene: &mut Scene, room_m: [f64; 3]) {
    let usual = Scene::preset(scene.preset).sensors.lighthouse.stations;
    let stations = &mut scene.sensors.lighthouse.stations;
    if *stations == usual {
        *stations = Profile::indoor().in_room(room_m).stations().into();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_room_in_another_unit_is_asked_about_and_halls_are_bounded() {
        assert_eq!(parse_room("4x3x2.5"), Ok([4.0, 3.0, 2.5]));
        assert_eq!(parse_room("20 X 20 × 8 m"), Ok([20.0, 20.0, 8.0]));
        assert_eq!(parse_room("13x20x8ft"), Ok([3.962, 6.096, 2.438]));
        assert_eq!(parse_room("400x300x250cm"), parse_room("4x3x2.5"));
        for halls in ["12x20x6", "10x15x4", "15x28x7", "22x44x7"] {
            assert!(parse_room(halls).is_ok(), "{halls}");
        }
        for (typed, question) in [
            ("13x20x8", "is this in feet, a room of 3.96x6.1x2.44 m?"),
            ("30x40x9", "is this in feet, a room of 9.14x12.19x2.74 m?"),
            ("50x84x24", "is this in feet, a room of 15.24x25.6x7.32 m?"),
            ("13x20x8in", "wanted"),
            ("400x300x250", "is this in centimeters, a room of 4x3x2.5 m?"),
            ("4000x3000x2500", "is this in millimeters, a room of 4x3x2.5 m?"),
            ("300x30x8", "wanted WIDTHxDEPTHxHEIGHT in meters, from 1.5x1.5x1 to 60x60x20"),
            ("1x3x2.5", "wanted"),
            ("4x3", "wanted"),
            ("nanx3x2", "wanted"),
        ] {
            let error = parse_room(typed).unwrap_err();
            assert!(error.starts_with(question), "{typed}: {error}");
        }
    }
}
