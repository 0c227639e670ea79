//! Generates photographs from random seeds, which select a word, a drone, a fault and a camera.
//!
//! A flight is planned with a scene that the planner knows, and flown with faults that the planner
//! does not know. Several cameras may photograph the same flight. This module does not score the
//! photographs.

use std::fmt::Write as _;
use std::num::NonZero;

use noctograph::camera::Metering;
use noctograph::error::Result;
use noctograph::light::Fixture;
use noctograph::photo::Photo;
use noctograph::plan::Plan;
use noctograph::scene::Scene;
use noctograph::score::{Reader, View};
use noctograph::shoot::{Judging, Recording, Shoot};

/// Faults that spoil a flight.
const FLIGHT_FAULTS: [&str; 8] =
    ["wander", "lag", "late lamps", "missing run", "drift", "spacing", "mixture", "slow drone"];
/// Faults that spoil a photograph of a flight.
const CAMERA_FAULTS: [&str; 6] = ["blur", "resolution", "exposure", "aside", "shutter", "room"];

/// Sizes of pictures in pixels, in increasing order.
pub(crate) const SIZES: [[u32; 2]; 11] = [
    [160, 90],
    [240, 135],
    [320, 180],
    [320, 240],
    [480, 270],
    [480, 320],
    [640, 360],
    [640, 480],
    [800, 450],
    [960, 540],
    [1280, 720],
];

/// Chromaticities of the lamps that write. Most are daylight white, and the others are tungsten
/// white and LED colors.
const COLORS: [[f64; 2]; 8] = [
    [0.3127, 0.329],
    [0.44, 0.40],
    [0.56, 0.43],
    [0.66, 0.32],
    [0.22, 0.68],
    [0.155, 0.08],
    [0.21, 0.33],
    [0.36, 0.18],
];

/// Generator of random numbers (`SplitMix64`, Steele and others 2014) that are the same on every
/// machine.
pub(crate) struct Rng(pub(crate) u64);

impl Rng {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Returns a random number in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub(crate) fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    pub(crate) fn pick<'a, T: ?Sized>(&mut self, of: &[&'a T]) -> &'a T {
        of[self.below(of.len())]
    }
}

/// Interpolates geometrically between two numbers.
fn geometric(low: f64, high: f64, share: f64) -> f64 {
    low * libm::pow(high / low, share)
}

/// Returns random letters and digits.
pub(crate) fn random_text(rng: &mut Rng) -> String {
    let of = match rng.unit() {
        p if p < 0.4 => "ABCDEFGHIJKLMNOPQRSTUVWXYZ",
        p if p < 0.6 => "abcdefghijklmnopqrstuvwxyz",
        p if p < 0.85 => "0123456789",
        _ => "ABCDEFGHJKLMNPQRSTUVWXYZ23456789",
    };
    (0..2 + rng.below(5)).map(|_| char::from(of.as_bytes()[rng.below(of.len())])).collect()
}

/// Scene settings in the form of `--set`.
#[derive(Clone, Default)]
struct Settings(Vec<(&'static str, String)>);

impl Settings {
    fn set(&mut self, key: &'static str, value: impl ToString) {
        self.0.push((key, value.to_string()));
    }

    fn scene(&self) -> Result<Scene> {
        let settings: Vec<(&str, &str)> =
            self.0.iter().map(|(key, value)| (*key, &value[..])).collect();
        Scene::parse_with("", "draw", &settings)
    }
}

/// A flight, with everything that its photographs have in common.
pub(crate) struct Flown {
    settings: Settings,
    /// Strokes of the word, with the flight or its light.
    shoot: Shoot,
    /// Times of the first and the last light command, in s.
    lit_s: [f64; 2],
    /// Fault of the flight, or an empty text if there is none.
    pub(crate) fault: &'static str,
    pub(crate) severity: f64,
}

/// A photograph with everything that is needed to read it.
pub(crate) struct Taken {
    pub(crate) scene: Scene,
    pub(crate) photo: Photo,
    pub(crate) view: View,
    pub(crate) fault: &'static str,
    pub(crate) severity: f64,
    pub(crate) cap_px: f64,
}

/// Draws at most one fault for a photograph, either of its flight or of its camera.
pub(crate) fn single_fault(rng: &mut Rng) -> [&'static str; 2] {
    if rng.chance(0.08) {
        return ["", ""];
    }
    let n = FLIGHT_FAULTS.len();
    match rng.below(n + CAMERA_FAULTS.len()) {
        at if at < n => [FLIGHT_FAULTS[at], ""],
        at => ["", CAMERA_FAULTS[at - n]],
    }
}

/// Draws a fault of the flight with probability `p`, and otherwise none.
pub(crate) fn fault_of_flight(rng: &mut Rng, p: f64) -> &'static str {
    if rng.chance(p) { rng.pick(&FLIGHT_FAULTS) } else { "" }
}

pub(crate) fn fault_of_camera(rng: &mut Rng, p: f64) -> &'static str {
    if rng.chance(p) { rng.pick(&CAMERA_FAULTS) } else { "" }
}

fn gusts(settings: &mut Settings, speed_m_s: f64) {
    settings.set("air.gusts.kind", "ornstein-uhlenbeck");
    settings.set("air.gusts.sigma_m_s", format!("{:?}", [speed_m_s; 3]));
}

/// Flies a word with random settings and a fault. A typeface is drawn from `faces`.
pub(crate) fn fly(
    rng: &mut Rng,
    word: &str,
    faces: &[String],
    fault: &'static str,
) -> Result<Flown> {
    let u = rng.unit();
    let mut s = Settings::default();
    // The presets' gusts of a room are turned off.
    s.set("air.gusts.kind", "none");
    let preset =
        rng.pick(&["ae483-2022", "ae483-2022", "cf21", "cf21", "cf21-thrust-kit", "cf-brushless"]);
    let preset = if fault == "slow drone" { "ae483-2022" } else { preset };
    s.set("preset", preset);
    s.set("word", word);
    s.set("seed", rng.below(1 << 30));
    let capitals = word.chars().all(|c| c.is_ascii_uppercase());
    let font = match rng.below(if capitals && fault != "spacing" { 11 } else { 6 }) {
        0..3 => "simplex",
        3..6 if faces.is_empty() => "simplex",
        3..6 => &faces[rng.below(faces.len())],
        6..9 => "ae483-fixed",
        _ => "ae483",
    };
    let cap_m = [0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6][rng.below(7)];
    s.set("letters.font", font);
    s.set("letters.cap_height_m", cap_m);
    s.set("letters.canvas_m", "[20.0, 4.0]");
    if font.contains('.') && rng.chance(0.25) {
        s.set("letters.trace", "outline");
    }
    let speed_m_s = cap_m * rng.between(0.25, 0.7);
    let is_team = rng.chance(0.33) || fault == "lag";
    if is_team {
        s.set("plan.style", "team");
        s.set("plan.style.step_m", 0.2 * cap_m);
    } else {
        s.set("plan.style", "even");
        // A hover of 0.5 s was the default when the readers were shown the photographs.
        s.set("plan.style.hover_s", 0.5);
    }
    // The planner knows the drone's lag in only some of the flights.
    if fault == "lag" || rng.chance(0.5) {
        s.set("plan.reference", "design");
        s.set("plan.light_clock", rng.pick(&["setpoint", "light"]));
    }
    let controller = match fault {
        "lag" => "lqr",
        "slow drone" => rng.pick(&["lqr", "lqr-feedforward"]),
        _ => rng.pick(&[
            "lqr",
            "lqr",
            "lqr-feedforward",
            "lqr-feedforward",
            "lqr-integral",
            "pid",
            "geometric",
        ]),
    };
    s.set("controller.kind", controller);
    s.set("sensors.positioning", "position");
    let scale = cap_m / 0.5;
    if rng.chance(0.4) && !["wander", "mixture"].contains(&fault) {
        gusts(&mut s, rng.between(0.03, 0.12));
    }
    let (mut late_s, mut missing) = (0.0, 0.0);
    let late = |times: f64| times * scale * 0.2 / speed_m_s;
    s.set(
        "plan.stroke_speed_m_s",
        if fault == "lag" { geometric(0.12, 1.0, u) * scale } else { speed_m_s },
    );
    match fault {
        "wander" => gusts(&mut s, geometric(0.1, 0.9, u) * scale),
        "late lamps" => late_s = late(geometric(0.1, 2.2, u)),
        "missing run" => missing = 0.08 + 0.67 * u,
        "drift" => {
            s.set("sensors.lighthouse.distortion_m", geometric(0.02, 0.3, u) * scale);
            s.set("sensors.lighthouse.distortion_length_m", cap_m * rng.between(0.7, 1.6));
        }
        "spacing" => s.set("letters.spacing_m", -(0.05 + 0.7 * u) * cap_m),
        "mixture" => {
            let times = geometric(0.7, 6.0, u);
            gusts(&mut s, 0.04 * times * scale);
            s.set("sensors.lighthouse.distortion_m", 0.012 * times * scale);
            (late_s, missing) = (late(0.12 * times), 0.04 * times);
        }
        _ => {}
    }
    s.set("light.ring", rng.pick(&["off", "off", "double-spin"]));
    s.set("light.led_bitmask", rng.pick(&["0", "128"]));
    let mut shoot = Shoot::new(s.scene()?)?;
    let plan = &mut shoot.plans[0].plan;
    if missing > 0.0 {
        lose_light(plan, missing, rng);
    }
    let commands = plan.commanded();
    let lit = || plan.setpoints.iter().zip(&commands).filter(|(_, level)| **level > 0.0);
    let [first, last] = [lit().next(), lit().next_back()];
    let lit_s = [first, last].map(|row| row.map_or(0.0, |(setpoint, _)| setpoint.time_s));
    if fault == "slow drone" {
        let heavier = 1.0 + 0.25 * u;
        s.set("vehicle.mass_kg", shoot.scene.vehicle.mass_kg * heavier);
        let actual = s.scene()?;
        shoot.actual = vec![noctograph::shoot::Actual { sim: actual.sim(), light: actual.light }];
    }
    let flight = shoot.fly_drone(0, &mut |_| {})?;
    s.set("light.radio_delay_s", 0.02 + late_s);
    (shoot.plans, shoot.actual) = (Vec::new(), Vec::new());
    shoot.recordings = vec![Recording::Flight(flight)];
    Ok(Flown { settings: s, shoot, lit_s, fault, severity: u })
}

impl Flown {
    /// Computes the light of the lamps once for all photographs, in one color.
    pub(crate) fn light(&mut self, rng: &mut Rng) -> Result<()> {
        self.shoot.scene = self.settings.scene()?;
        self.shoot.scene.light.fixtures = Some(lamps(rng, &self.shoot.scene));
        if let [Recording::Flight(flight)] = &self.shoot.recordings[..] {
            self.shoot.recordings = vec![Recording::Light(self.shoot.light_drone(0, flight)?)];
        }
        Ok(())
    }

    /// Returns a reader of the word.
    pub(crate) fn reader(&self) -> Result<Reader> {
        let strokes = self.shoot.strokes.as_ref().expect("a word was flown");
        Reader::new(strokes, &self.shoot.scene.score)
    }
}

/// Returns the scene's lamps, with a random color for those that write.
fn lamps(rng: &mut Rng, scene: &Scene) -> Vec<Fixture> {
    let mut lamps = scene.light.fixtures();
    let color = COLORS[rng.below(12).saturating_sub(4)];
    for lamp in lamps.iter_mut().filter(|lamp| lamp.name.starts_with("headlight")) {
        lamp.dies[0].chromaticity = color;
    }
    lamps
}

/// Removes consecutive light commands from each letter.
fn lose_light(plan: &mut Plan, share: f64, rng: &mut Rng) {
    let commands = plan.commanded();
    let letters = plan.setpoints.iter().filter_map(|setpoint| setpoint.letter).max();
    for letter in 0..=letters.unwrap_or(0) {
        let rows = plan.setpoints.iter().zip(&commands).enumerate();
        let lit =
            rows.filter(|(_, (setpoint, level))| setpoint.letter == Some(letter) && **level > 0.0);
        let lit: Vec<usize> = lit.map(|(row, _)| row).collect();
        let run = (share.min(1.0) * lit.len() as f64) as usize;
        let start = rng.below(lit.len() - run + 1);
        for row in &lit[start..start + run] {
            plan.edit(|plan| plan.lights.values_mut().for_each(|levels| levels[*row] = 0.0));
        }
    }
}

/// Photographs a flight with a random camera, and with the fault that was drawn for the photograph,
/// if any.
pub(crate) fn photograph(
    rng: &mut Rng,
    flown: &Flown,
    fault: &'static str,
    sizes: &[[u32; 2]],
) -> Result<Taken> {
    let u = rng.unit();
    let mut s = flown.settings.clone();
    let strokes = flown.shoot.strokes.as_ref().expect("a word was flown");
    let [left, bottom, right, top] = strokes.bounds_m();
    let cap_m = flown.shoot.scene.letters.cap_height_m;
    let [width, height] = sizes[rng.below(sizes.len())].map(f64::from);
    let fill = rng.between(0.35, 0.85);
    let px_per_m =
        (fill * width / (right - left).max(0.05)).min(fill * height / (top - bottom).max(0.05));
    let mixed = flown.fault == "mixture";
    let smaller =
        if fault == "resolution" { geometric(45.0, 3.0, u) / (px_per_m * cap_m) } else { 1.0 }
            .min(1.0);
    let [width, height] = [width, height].map(|side| (side * smaller).round().max(24.0));
    let px_per_m = px_per_m * smaller;
    s.set("camera.width_px", width);
    s.set("camera.height_px", height);
    let focal_m = rng.between(0.02, 0.06);
    s.set("camera.lens.focal_length_m", focal_m);
    if rng.chance(0.3) {
        s.set("camera.lens.distortion", format!("[{}, 0.0, 0.0, 0.0]", rng.between(-0.25, 0.1)));
    }
    let blurred = if fault == "blur" { geometric(0.01, 0.35, u) } else { 0.0 };
    let blurred = if mixed { 0.015 * geometric(0.7, 6.0, flown.severity) } else { blurred };
    if blurred > 0.0 {
        s.set("camera.blur_m", blurred * cap_m * px_per_m * 0.036 / width);
    }
    let mut angle_rad = if rng.chance(0.25) { rng.between(-0.5, 0.5) } else { 0.0 };
    if fault == "aside" {
        angle_rad = (0.3 + 1.05 * u).copysign(rng.between(-1.0, 1.0));
    }
    let [x, z] = [0.5 * (left + right), 0.5 * (bottom + top)];
    let away_m = focal_m * width / 0.036 / px_per_m;
    if angle_rad != 0.0 {
        let up = if fault == "aside" { rng.between(-0.5, 0.8) } else { 0.0 };
        let place =
            [x + away_m * libm::sin(angle_rad), -away_m * libm::cos(angle_rad), (z + up).max(0.1)];
        s.set("camera.framing", "fixed");
        s.set("camera.framing.position_m", format!("{place:?}"));
        s.set("camera.framing.target_m", format!("[{x:?}, 0.0, {z:?}]"));
    } else {
        s.set("camera.framing.fill_frac", fill);
    }
    if fault == "shutter" {
        s.set(
            "camera.shutter_close_s",
            flown.lit_s[1] - 0.6 * u * (flown.lit_s[1] - flown.lit_s[0]),
        );
    }
    // Trails range from two stops below white to five stops above, or are lost in the noise.
    let dim = if fault == "exposure" { 2.0 + 5.5 * u } else { rng.between(-3.0, 2.0) };
    s.set("camera.metering", "trail");
    s.set("camera.metering.trail_stops", 2.0 - dim);
    s.set("camera.metering.color_stops", -0.5 - dim);
    s.set("camera.metering.least_stops", -10.0);
    let room = if fault == "room" { -6.5 + 6.0 * u } else { -7.0 };
    s.set("camera.metering.room_stops", 0.0);
    s.set("camera.base_iso", 100.0);
    let mut scene = s.scene()?;
    // The room's light is chosen relative to white, so that the light meter sets aperture and ISO
    // first.
    scene.light.fixtures = Some(lamps(rng, &scene));
    let mut shoot = flown.shoot.clone();
    shoot.scene = scene;
    (shoot.judging, shoot.cores) = (Judging::Skipped, NonZero::new(1));
    if let Some(metered) = shoot.clone().lighting(&|_, _| {})?.metered {
        let camera = &mut shoot.scene.camera;
        camera.metering = Metering::Off;
        (camera.f_number, camera.iso) = (metered.f_number, metered.iso);
        let open_s = camera.shutter_close_s.unwrap_or(flown.lit_s[1] + 3.0);
        // White is 78 / ISO lx s, and a gray of luminance L gives π τ L t / 4 N² on the sensor.
        let white = 78.0 / camera.iso;
        let lx_s = std::f64::consts::FRAC_PI_4 * 0.9 * open_s / (camera.f_number * camera.f_number);
        shoot.scene.photo.ambient_cd_m2 = white * libm::exp2(room + rng.between(-1.0, 1.0)) / lx_s;
    }
    let shot = shoot.take(&|_, _| {})?;
    let view = View::from(&shot.camera);
    let (fault, severity) =
        if fault.is_empty() { (flown.fault, flown.severity) } else { (fault, u) };
    Ok(Taken {
        scene: shot.shoot.scene,
        photo: shot.photo,
        view,
        fault,
        severity,
        cap_px: cap_m * px_per_m,
    })
}

/// Returns a table row that describes a generated photograph, as JSON.
pub(crate) fn truth(taken: &Taken, shown: &str, seed: u64, half: &str) -> String {
    let font = std::path::Path::new(&taken.scene.letters.font).file_name();
    let font = font.map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let mut row = String::new();
    let _ = write!(
        row,
        r#"{{"shown": "{shown}", "expected": "{shown}", "kind": "photo", "fault": "{}", "severity": {:.3}, "cap_px": {:.2}, "font": "{font}", "index": {seed}, "half": "{half}"}}"#,
        if taken.fault.is_empty() { "none" } else { taken.fault },
        taken.severity,
        taken.cap_px,
    );
    row
}
