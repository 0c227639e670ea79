//! The scene file as text: what each key means, and where in the file a mistake stands.

use toml::de::DeTable;

use super::Scene;
use crate::error::Error;

/// What to do about a broken scene file.
pub(super) const HINT: &str = "`noctograph scene` prints every key with its default and unit";

/// Every key of a scene in the order of the file: section, key, meaning with unit.
const KEYS: &[(&str, &str, &str)] = &[
    ("", "preset", "ae483-2022, cf21, cf21-thrust-kit, cf-brushless or bzzz: the keys left out"),
    ("", "word", "the word to write"),
    ("", "seed", "seed of all noise: the same seed makes the same photo"),
    (
        "letters",
        "font",
        "ae483 (the team's 26 letters), ae483-fixed, simplex, or a file: *.strokes, *.ttf, *.otf",
    ),
    ("letters", "trace", "what is followed of a typeface: centre-line or outline"),
    (
        "letters",
        "drawing",
        "file instead of a word: *.svg, *.json (handwriting) or *.inkml; empty: none",
    ),
    ("letters", "tolerance_m", "how far strokes may lie from a drawing's curves, m"),
    ("letters", "smoothing_m", "how far smoothing may move handwriting; 0: none, m"),
    ("letters", "cap_height_m", "height of a capital, m"),
    ("letters", "width_m", "width of a letter's box (ae483, ae483-fixed), m"),
    ("letters", "gap_m", "gap between two boxes (ae483, ae483-fixed), m"),
    ("letters", "spacing_m", "added between two letters of any other font, m"),
    (
        "letters",
        "baseline_m",
        "height of the letters' feet (of the lowest line) above the floor, m",
    ),
    ("letters", "line_gap_m", "gap between a line's feet and the capitals below it, m"),
    ("letters", "align", "left, centre or right of x = 0; ae483: as the team, n widths / 2 left"),
    (
        "letters",
        "canvas_m",
        "largest width and height; larger text is made smaller, a drawing fills it, m",
    ),
    ("plan", "style", "team, or even: evenly lit, fast; settles the defaults of this section"),
    ("plan", "extent", "whole: floor to floor; letters: from rest at the first letter"),
    ("plan", "lights", "what lit strokes switch on: headlights, ring, color-led"),
    ("plan", "stroke_speed_m_s", "speed along every leg; even: along lit strokes, m/s"),
    ("plan", "setpoint_interval_s", "time between setpoints, each held until the next, s"),
    ("plan", "step_m", "team: step to the right of a letter's box when it is done, m"),
    ("plan", "letter_wait_s", "team: wait in the dark after that step, s"),
    ("plan", "floor_wait_s", "wait on the floor before take-off and after landing, s"),
    ("plan", "lift_off_height_m", "team: height of the first setpoint in the air, m"),
    ("plan", "approach_height_m", "team: height at which the way to the first letter ends, m"),
    ("plan", "landing_height_m", "height to which it sinks after the last letter, m"),
    ("plan", "order", "even: shortest (least dark time) or drawn (keeps handwriting)"),
    ("plan", "dark_speed_m_s", "even: greatest speed in the dark, m/s"),
    ("plan", "acceleration_m_s2", "even: greatest acceleration, m/s2"),
    ("plan", "jerk_m_s3", "even: greatest jerk, m/s3"),
    ("plan", "corner_error_m", "even: how far a rounded corner may lie from the drawn one, m"),
    ("plan", "exposure", "even: dimmed (light falls with the speed) or switched (headlights)"),
    ("plan", "drones", "even: drones that share the strokes"),
    ("plan", "reference", "what controllers are sent: design, or inverse (leads a slow loop)"),
    ("plan", "mean_error_m", "mean of flown - design in an earlier flight, taken off, m"),
    ("plan", "light_clock", "lights follow the setpoint, or the light: on where strokes begin"),
    ("plan", "trajectory_clock", "rate of the setpoints' clock: 1; 84/85 on old firmware's board"),
    ("vehicle", "mass_kg", "mass with battery and decks, kg"),
    ("vehicle", "inertia_kg_m2", "moments of inertia about body x, y, z, kg m2"),
    ("vehicle", "k_f_n", "thrust of a motor per unit of its command (0 to motor_max), N"),
    ("vehicle", "k_m_n_m", "reaction torque of a motor per unit of its command, N m"),
    ("vehicle", "arm_m", "half the side of the square of motors, m"),
    ("vehicle", "motor_max", "largest motor command"),
    ("vehicle", "center_of_mass_m", "centre of mass off the motors' middle, body x and y, m"),
    ("vehicle", "rotor_thrust_n_s2", "thrust of a rotor per square of its speed, N/(rad/s)2"),
    ("vehicle", "motor_rise_s", "time constant of a rotor's speed while it rises; 0: none, s"),
    ("vehicle", "motor_fall_s", "time constant of a rotor's speed while it falls; 0: none, s"),
    ("vehicle", "body_drag_n_s_m", "drag per airspeed along body x, y, z, N/(m/s)"),
    ("vehicle", "rotor_drag_n_s2_m", "drag of a rotor per airspeed and speed, N/((m/s)(rad/s))"),
    ("vehicle", "airspeed_moment_n_s", "moment per airspeed, against the motion, N m/(m/s)"),
    ("vehicle", "rotor_inertia_kg_m2", "inertia of a rotor about its axis, kg m2"),
    ("vehicle", "ground_effect", "none, cheeseman-bennett or sanchez-cuevas (four rotors)"),
    ("vehicle", "rotor_radius_m", "radius of a propeller, m"),
    ("vehicle", "rotor_height_m", "height of the propellers when it stands on the floor, m"),
    ("battery", "capacity_ah", "charge of a full battery; 0: a voltage that never sags, A h"),
    ("battery", "charge_frac", "share of the charge that is there at the start"),
    ("battery", "open_circuit_v", "open-circuit voltage at 0, 10 ... 100 % of charge, V"),
    ("battery", "resistance_ohm", "resistance of battery, plug and wires, ohm"),
    ("battery", "idle_current_a", "current with the motors off, A"),
    ("battery", "current_a_per_n", "current of the motors per thrust, A/N"),
    (
        "battery",
        "thrust_from_v_n",
        "a motor's thrust from its voltage: t0 + t1 v + t2 v2 + t3 v3, N",
    ),
    ("battery", "compensation", "firmware: commands are thrusts; none: shares of the voltage's"),
    ("battery", "cut_off_v", "voltage under load below which the motors stop; 0: never, V"),
    ("air", "wind_m_s", "steady wind along world x, y, z, m/s"),
    ("air", "gusts", "none, ornstein-uhlenbeck (rooms) or dryden (open air, from the wind)"),
    ("air", "gust_sigma_m_s", "gusts along world x, y, z (ornstein-uhlenbeck), sigma, m/s"),
    ("air", "gust_time_s", "time over which they are correlated (ornstein-uhlenbeck), s"),
    ("air", "gust_torque_sigma_n_m", "torque about body x, y, z (ornstein-uhlenbeck), sigma, N m"),
    ("air", "gust_torque_time_s", "time over which it is correlated (ornstein-uhlenbeck), s"),
    ("rates", "control_hz", "ticks of the main loop: sensors and observer, Hz"),
    ("rates", "attitude_hz", "motor commands; divides control_hz, Hz"),
    ("rates", "position_hz", "position loop of pid; divides attitude_hz, Hz"),
    ("rates", "log_hz", "samples of the flight that comes out; divides control_hz, Hz"),
    ("rates", "steps_per_tick", "Runge-Kutta steps per tick"),
    ("controller", "kind", "lqr, lqr-feedforward, lqr-integral, pid or geometric"),
    ("controller", "q", "LQR weights of position, yaw pitch roll, velocity, body rate"),
    ("controller", "r", "LQR weights of torque x, y, z (1/(N m)2) and thrust (1/N2)"),
    ("controller", "q_integral", "lqr-integral: weights of the integral of position, 1/(m s)2"),
    ("controller", "motor_lag", "regulators: modelled, or ignored as the team's"),
    ("controller", "k_position", "geometric: acceleration per position error, 1/s2"),
    ("controller", "k_velocity", "geometric: acceleration per velocity error, 1/s"),
    ("controller", "k_position_integral", "geometric: per integral of position error, 1/s3"),
    ("controller", "k_attitude", "geometric: angular acceleration per attitude error, 1/s2"),
    ("controller", "k_rate", "geometric: angular acceleration per rate error, 1/s"),
    ("controller", "k_attitude_integral", "geometric: per integral of attitude error, 1/s3"),
    ("observer", "kind", "luenberger (on positions), ekf (on anything) or truth"),
    ("observer", "q", "1/variance of the measured position x, y, z, 1/m2"),
    ("observer", "r", "1/variance of the model of position, pitch, roll, velocity"),
    ("observer", "ekf_acceleration_noise_m_s2_sqrt_hz", "Kalman: of the model, (m/s2)/sqrt(Hz)"),
    ("observer", "ekf_rate_noise_rad_s_sqrt_hz", "Kalman: of the model, (rad/s)/sqrt(Hz)"),
    ("observer", "ekf_sweep_sigma_rad", "Kalman: trust in a sweep angle, sigma, rad"),
    ("observer", "ekf_position_sigma_m", "Kalman: trust in a measured position, sigma, m"),
    ("observer", "ekf_range_sigma_m", "Kalman: trust in a range, sigma, m"),
    ("observer", "ekf_barometer_sigma_m", "Kalman: trust in a barometric height, sigma, m"),
    ("observer", "ekf_gate_sigmas", "Kalman: what is further off is thrown away, sigmas"),
    ("sensors", "positioning", "position, crossing-beams, sweeps, uwb-twr, uwb-tdoa or gnss"),
    ("sensors", "heights", "any of time-of-flight, barometer"),
    ("sensors", "lighthouse_jitter_m", "white noise of the position per axis and tick, sigma, m"),
    ("sensors", "lighthouse_distortion_m", "smooth position error per axis, sigma, m"),
    ("sensors", "lighthouse_distortion_length_m", "distance over which that changes, m"),
    ("sensors", "gyro_noise_rad_s_sqrt_hz", "gyroscope, noise density, (rad/s)/sqrt(Hz)"),
    ("sensors", "accelerometer_noise_m_s2_sqrt_hz", "accelerometer, (m/s2)/sqrt(Hz)"),
    ("sensors", "gyro_bias_walk_rad_s2_sqrt_hz", "walk of its bias, (rad/s2)/sqrt(Hz)"),
    ("sensors", "accelerometer_bias_walk_m_s3_sqrt_hz", "walk of its bias, (m/s3)/sqrt(Hz)"),
    ("sensors", "stations", "Lighthouse: base stations, generation v1 or v2; m and rad"),
    ("sensors", "sweep_noise_rad", "white noise of a sweep angle, v1 and v2, sigma, rad"),
    (
        "sensors",
        "sweep_noise_shared_frac",
        "share of its variance that all deck sensors have alike",
    ),
    ("sensors", "sweep_loss_frac", "share of sweeps that are lost"),
    ("sensors", "station_position_error_m", "a station stands off per axis, sigma, m"),
    ("sensors", "station_rotation_error_rad", "a station is turned per axis, sigma, rad"),
    ("sensors", "sweep_distortion_rad", "smooth error of a sweep angle, sigma, rad"),
    ("sensors", "sweep_distortion_length_rad", "change of direction over which it changes, rad"),
    ("sensors", "anchors_m", "ultra-wideband: places of the anchors, m"),
    ("sensors", "uwb_rate_hz", "ranges over all anchors, Hz"),
    ("sensors", "uwb_noise_m", "white noise of a range, sigma, m"),
    ("sensors", "uwb_bias_m", "error of a link, smooth over the room, sigma, m"),
    ("sensors", "uwb_outlier_frac", "share of ranges that went astray"),
    ("sensors", "uwb_outlier_m", "mean size of their error, m"),
    ("sensors", "barometer_noise_m", "white noise of the height at 50 Hz, sigma, m"),
    ("sensors", "barometer_drift_m_sqrt_s", "random walk of the height, m after 1 s"),
    ("sensors", "gnss_noise_m", "white noise of a satellite fix per axis at 10 Hz, sigma, m"),
    ("light", "radio_delay_s", "from sending a light command to its arrival, s"),
    ("light", "radio_jitter_s", "what a command may take longer, s"),
    ("light", "radio_write_s", "between the writes of the ring's red, green and blue, s"),
    ("light", "tick_s", "period of the firmware's lamp timer; 0: none, s"),
    ("light", "tick_phase_s", "when that timer first ticks, s"),
    ("light", "rise_s", "time of a lamp from dark to full, s"),
    ("light", "decay_s", "time of a lamp from full to dark, s"),
    ("light", "pwm", "off: dimmed lamps as their mean; on: pulse by pulse (pwm_hz)"),
    ("light", "led_bitmask", "led.bitmask; 0: the firmware's, 128: the board's LEDs are off"),
    (
        "light",
        "ring_effect",
        "ring.effect: off, double-spin (6), solid (7), memory (13), fade (14)",
    ),
    ("light", "ring_color", "red, green, blue of the last three effects, 0 to 255"),
    ("light", "ring_fade_s", "time from color to color (ring_effect = fade), s"),
    ("light", "color_led_wrgb", "white, red, green, blue of the color LED deck, 0 to 255"),
    ("light", "color_led_levels", "corrected: as its firmware does by default; plain"),
    ("light", "deck", "led-ring, color-led or none: whose lamps fixtures are if left out"),
    ("light", "fixtures", "the lamps: intensity_cd * (spill + (1 - spill) cos^beam_exponent)"),
    ("camera", "framing", "word: square in front of the word; fixed: position_m and target_m"),
    ("camera", "fill_frac", "share of the picture that the word fills (framing = word)"),
    ("camera", "position_m", "entrance pupil (framing = fixed), m"),
    ("camera", "target_m", "point in the middle of the picture (framing = fixed), m"),
    ("camera", "orientation_wxyz", "attitude instead of target_m; unturned, it looks along -z"),
    ("camera", "body", "full-frame-24mp, a6400, one-inch or phone; settles sensor_width_m"),
    ("camera", "lens", "28mm, 35mm, 50mm or kit-16mm; settles focal_length_m and distortion"),
    ("camera", "focal_length_m", "focal length, m"),
    ("camera", "sensor_width_m", "width of the sensor, m"),
    ("camera", "focus_m", "distance in focus; left out: everything is sharp, m"),
    ("camera", "distortion", "k1, k2, p1, p2 of Brown and Conrady"),
    ("camera", "vignetting", "share of light that the barrel takes away at the corner"),
    ("camera", "white_balance", "gains of red, green and blue, or the light's temperature, K"),
    ("camera", "f_number", "aperture number"),
    ("camera", "transmission", "share of light that the lens lets through"),
    ("camera", "blur_m", "standard deviation of the lens's blur on the sensor, m"),
    ("camera", "iso", "sensitivity; a pixel saturates at 78 / ISO lx s"),
    ("camera", "shutter_open_s", "when the shutter opens, flight time, s"),
    ("camera", "shutter_close_s", "when it closes; left out: at the flight's end, s"),
    ("camera", "width_px", "width of the picture, pixels"),
    ("camera", "height_px", "height of the picture, pixels"),
    ("expose", "merge_tolerance_px", "motion below this is drawn as one line; 0: none, pixels"),
    ("expose", "floor_albedo", "share of light that the floor reflects; 0: a black floor"),
    ("expose", "floor_z_m", "height of the floor, below a standing drone's position, m"),
    ("photo", "tone", "camera: as a JPEG; neutral: Khronos PBR Neutral; linear: sRGB curve alone"),
    ("photo", "glare_frac", "share of light that the lens scatters; 0: none"),
    ("photo", "glare_radius_m", "core of that scatter on the sensor, m"),
    ("photo", "aperture_blades", "blades of the iris, for starbursts; 0: none"),
    ("photo", "ambient_cd_m2", "luminance of the room, cd/m2; 0: dark"),
    ("photo", "ambient_rgb", "colour of that light, linear sRGB"),
    ("photo", "background", "PNG picture behind the light; empty: none"),
    ("photo", "background_stops", "how much brighter it is; at 0 its white saturates, stops"),
    ("photo", "crosstalk_frac", "share of a colour's light that its neighbours see; 0: none"),
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
    ("letters", "The word's drawing; \\n in the word begins a new line"),
    ("plan", "How it is flown"),
    ("vehicle", "The drone"),
    ("battery", "What drives its motors"),
    ("air", "The air it flies in"),
    ("rates", "Clocks of the simulation"),
    ("controller", "What steers it: motor commands from the estimated state"),
    ("observer", "What the drone believes from what it measures"),
    ("sensors", "Noise of what the drone measures"),
    ("light", "The lamps and how they follow commands"),
    ("camera", "The camera"),
    ("expose", "How finely the exposure is computed, and the floor that the lamps light"),
    ("photo", "What lens and sensor make of the light, and the tone curve"),
    ("score", "When a word counts as read"),
];

/// The whole scene as a commented TOML file.
pub(super) fn document(scene: &Scene) -> String {
    let values = toml::Table::try_from(scene).expect("a checked scene is a TOML table");
    let mut text =
        "# A noctograph scene: everything that the photo depends on. SI units; angles in \
                    radians.\n# Keys that are left out keep the value of the preset.\n"
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
        scene.camera.orientation_wxyz = Some([1.0, 0.0, 0.0, 0.0]);
        scene.camera.body = Some(crate::camera::BodyName::Phone);
        scene.camera.lens = Some(crate::camera::LensName::Wide28);
        scene.camera.focus_m = Some(3.0);
        scene.letters.canvas_m = Some([1.0, 1.0]);
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
