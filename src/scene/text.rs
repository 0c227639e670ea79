//! The scene file as text: what each key means, and where in the file a mistake stands.

use toml::de::DeTable;

use super::Scene;
use crate::error::Error;

/// What to do about a broken scene file.
pub(super) const HINT: &str = "`noctograph scene` prints every key with its default and unit";

/// Every key of a scene in the order of the file: section, key, meaning with unit.
const KEYS: &[(&str, &str, &str)] = &[
    ("", "preset", "where the defaults come from"),
    ("", "word", "the word to write"),
    ("", "seed", "seed of all noise: the same seed makes the same photo"),
    ("letters", "font", "stroke font: ae483, the reference team's 26 letters"),
    ("letters", "cap_height_m", "height of a capital, m"),
    ("letters", "width_m", "width of a letter's box, m"),
    ("letters", "gap_m", "gap between two boxes, m"),
    ("letters", "baseline_m", "height of the letters' feet above the floor, m"),
    ("plan", "extent", "whole: floor to floor; letters: from rest at the first letter"),
    ("plan", "stroke_speed_m_s", "speed along every leg, m/s"),
    ("plan", "setpoint_interval_s", "time between setpoints, each held until the next, s"),
    ("plan", "step_m", "step to the right of a letter's box when it is done, m"),
    ("plan", "letter_wait_s", "wait in the dark after that step, s"),
    ("plan", "floor_wait_s", "wait on the floor before take-off and after landing, s"),
    ("plan", "lift_off_height_m", "height of the first setpoint in the air, m"),
    ("plan", "approach_height_m", "height at which the way to the first letter ends, m"),
    ("plan", "landing_height_m", "height to which it sinks after the last letter, m"),
    ("vehicle", "mass_kg", "mass with battery and decks, kg"),
    ("vehicle", "inertia_kg_m2", "moments of inertia about body x, y, z, kg m2"),
    ("vehicle", "k_f_n", "thrust of a motor per unit of its command (0 to motor_max), N"),
    ("vehicle", "k_m_n_m", "reaction torque of a motor per unit of its command, N m"),
    ("vehicle", "arm_m", "half the side of the square of motors, m"),
    ("vehicle", "motor_max", "largest motor command"),
    ("vehicle", "center_of_mass_m", "centre of mass off the motors' middle, body x and y, m"),
    ("rates", "control_hz", "ticks of observer, controller and motors, Hz"),
    ("rates", "log_hz", "samples of the flight that comes out; divides control_hz, Hz"),
    ("rates", "steps_per_tick", "Runge-Kutta steps per tick"),
    ("controller", "q", "LQR weights of position, yaw pitch roll, velocity, body rate"),
    ("controller", "r", "LQR weights of torque x, y, z (1/(N m)2) and thrust (1/N2)"),
    ("observer", "q", "1/variance of the measured position x, y, z, 1/m2"),
    ("observer", "r", "1/variance of the model of position, pitch, roll, velocity"),
    ("sensors", "lighthouse_jitter_m", "white noise of the position per axis and tick, sigma, m"),
    ("sensors", "lighthouse_distortion_m", "smooth position error per axis, sigma, m"),
    ("sensors", "lighthouse_distortion_length_m", "distance over which that changes, m"),
    ("sensors", "gyro_noise_rad_s_sqrt_hz", "gyroscope, noise density, (rad/s)/sqrt(Hz)"),
    ("sensors", "accelerometer_noise_m_s2_sqrt_hz", "accelerometer, (m/s2)/sqrt(Hz)"),
    ("light", "radio_delay_s", "from sending a light command to its arrival, s"),
    ("light", "tick_s", "period of the firmware's lamp timer; 0: none, s"),
    ("light", "tick_phase_s", "when that timer first ticks, s"),
    ("light", "emitters", "the lamps; intensity = cd * (spill + (1 - spill) cos^exponent)"),
    ("camera", "framing", "word: square in front of the word; fixed: position_m and target_m"),
    ("camera", "fill_frac", "share of the picture that the word fills (framing = word)"),
    ("camera", "position_m", "entrance pupil (framing = fixed), m"),
    ("camera", "target_m", "point in the middle of the picture (framing = fixed), m"),
    ("camera", "focal_length_m", "focal length, m"),
    ("camera", "sensor_width_m", "width of the sensor, m"),
    ("camera", "f_number", "aperture number"),
    ("camera", "transmission", "share of light that the lens lets through"),
    ("camera", "blur_m", "standard deviation of the lens's blur on the sensor, m"),
    ("camera", "iso", "sensitivity; a pixel saturates at 78 / ISO lx s"),
    ("camera", "shutter_open_s", "when the shutter opens, flight time, s"),
    ("camera", "shutter_close_s", "when it closes; left out: at the flight's end, s"),
    ("camera", "width_px", "width of the picture, pixels"),
    ("camera", "height_px", "height of the picture, pixels"),
    ("expose", "merge_tolerance_px", "motion below this is drawn as one line; 0: none, pixels"),
    ("photo", "tone", "camera: as a JPEG; neutral: Khronos PBR Neutral; linear: sRGB curve alone"),
    ("photo", "glare_frac", "share of light that the lens scatters; 0: none"),
    ("photo", "glare_radius_m", "core of that scatter on the sensor, m"),
    ("photo", "aperture_blades", "blades of the iris, for starbursts; 0: none"),
    ("photo", "ambient_cd_m2", "luminance of the room, cd/m2; 0: dark"),
    ("photo", "ambient_rgb", "colour of that light, linear sRGB"),
    ("photo", "background", "PNG picture behind the light; empty: none"),
    ("photo", "background_stops", "how much brighter it is; at 0 its white saturates, stops"),
    ("photo", "crosstalk_frac", "share of a colour's light that the other two see; 0: none"),
    ("photo", "noise", "emva1288: a sensor's noise; off"),
    ("photo", "full_well_e", "electrons that fill a pixel"),
    ("photo", "base_iso", "sensitivity at which a full pixel is white"),
    ("photo", "response", "electrons of red, green, blue in white light, shares of the largest"),
    ("photo", "read_noise_e", "noise of reading a pixel, sigma, electrons"),
    ("photo", "dark_current_e_s", "dark current of a pixel, electrons/s"),
    ("photo", "prnu_frac", "spread of the pixels' gains, sigma"),
    ("photo", "hot_pixel_frac", "share of hot photosites; 0: none"),
    ("photo", "hot_pixel_e_s", "their mean dark current, electrons/s"),
    ("score", "references", "what letters are compared with: flown, typeface or both"),
    ("score", "legible_probability", "a word counts as legible from this probability on"),
];

/// What each section is about.
const SECTIONS: &[(&str, &str)] = &[
    ("letters", "The word's drawing: boxes from left to right"),
    ("plan", "How it is flown"),
    ("vehicle", "The drone"),
    ("rates", "Clocks of the simulation"),
    ("controller", "Linear-quadratic regulator on the estimated state"),
    ("observer", "Luenberger observer"),
    ("sensors", "Noise of what the drone measures"),
    ("light", "The lamps and how they follow commands"),
    ("camera", "The camera"),
    ("expose", "How finely the exposure is computed"),
    ("photo", "What lens and sensor make of the light, and the tone curve"),
    ("score", "When a word counts as read"),
];

/// The whole scene as a commented TOML file.
pub(super) fn document(scene: &Scene) -> String {
    let values = toml::Table::try_from(scene).expect("a checked scene is a TOML table");
    let mut text =
        "# A noctograph scene: everything that the photo depends on. SI units; angles in \
                    radians.\n# Keys that are left out keep their default.\n"
            .to_owned();
    let mut section = "";
    for (place, key, meaning) in KEYS {
        if *place != section {
            section = place;
            let about = SECTIONS.iter().find(|(name, _)| *name == section).map_or("", |(_, a)| a);
            text += &format!("\n# {about}\n[{section}]\n");
        }
        let table = match *place {
            "" => Some(&values),
            section => values.get(section).and_then(toml::Value::as_table),
        };
        match table.and_then(|table| table.get(*key)) {
            Some(value) => text += &entry(key, value, meaning),
            None => text += &format!("# {key} =   # {meaning}\n"),
        }
    }
    text
}

/// One key with its value and meaning; a list of tables takes a line a table.
fn entry(key: &str, value: &toml::Value, meaning: &str) -> String {
    match value.as_array() {
        Some(rows) if rows.iter().any(toml::Value::is_table) => {
            let rows: String = rows.iter().map(|row| format!("    {row},\n")).collect();
            format!("# {meaning}\n{key} = [\n{rows}]\n")
        }
        _ => format!("{key} = {value}  # {meaning}\n"),
    }
}

/// A file that is no TOML, has an unknown key or a value of the wrong type.
pub(super) fn syntax_error(error: &toml::de::Error, toml: &str, file: &str) -> Error {
    let line = error.span().map_or(1, |span| line_at(toml, span.start));
    let found = error.message().replace('\n', "; ");
    Error::input(format!("{file}:{line}"), found, "keys and values of a scene", HINT)
}

/// Puts file and line before an error's place, where the place begins with a key of the file.
pub(super) fn with_line(error: Error, toml: &str, file: &str) -> Error {
    match error {
        Error::Input { place, found, wanted, hint } => {
            let line = line_of(toml, &place).map_or(String::new(), |line| format!(":{line}"));
            Error::Input { place: format!("{file}{line}: {place}"), found, wanted, hint }
        }
        other => other,
    }
}

/// The line of the key that a place begins with, such as `camera.iso`; that of its section where
/// the key is not in the file.
fn line_of(toml: &str, place: &str) -> Option<usize> {
    let parsed = DeTable::parse(toml).ok()?;
    let mut words = place.split([' ', '.', '[']);
    let (name, value) = parsed.get_ref().get_key_value(words.next()?)?;
    let inner = value.get_ref().as_table().zip(words.next());
    let inner = inner.and_then(|(table, key)| table.get_key_value(key));
    let span = inner.map_or(name.span(), |(key, _)| key.span());
    Some(line_at(toml, span.start))
}

fn line_at(text: &str, byte: usize) -> usize {
    1 + text.bytes().take(byte).filter(|b| *b == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_is_explained_once() {
        let mut scene = Scene::default();
        scene.camera.shutter_close_s = Some(1.0);
        let values = toml::Table::try_from(&scene).unwrap();
        let mut keys: Vec<(String, String)> = Vec::new();
        for (name, value) in &values {
            match value.as_table() {
                Some(table) => keys.extend(table.keys().map(|key| (name.clone(), key.clone()))),
                None => keys.push((String::new(), name.clone())),
            }
        }
        let mut explained: Vec<(String, String)> =
            KEYS.iter().map(|(s, k, _)| ((*s).to_owned(), (*k).to_owned())).collect();
        keys.sort();
        explained.sort();
        assert_eq!(explained, keys);
        let sections: Vec<&str> = SECTIONS.iter().map(|(name, _)| *name).collect();
        let tables = values.iter().filter(|(_, value)| value.is_table());
        let mut tables: Vec<&str> = tables.map(|(name, _)| name.as_str()).collect();
        tables.sort_by_key(|name| sections.iter().position(|section| section == name));
        assert_eq!(sections, tables);
    }
}
