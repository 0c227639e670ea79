//! Keys that are set and have no effect, with the reason: those of a choice that was not made, of a
//! part that is switched off.

use toml::{Table, Value};

use super::Scene;
use crate::camera::Metering;
use crate::light::{Drive, Fixture, RingEffect};
use crate::plan::{Extent, PlanOptions, Style};
use crate::settings::{Described, Setting, Shape};
use crate::sim::{
    ControllerKind, EstimatorKind, Generation, GroundEffect, Gusts, HeightSensor, Positioning,
    VehicleOptions,
};

/// A key, or the table of many; whether it is without effect in a scene; and why.
type Rule = (&'static str, fn(&Scene) -> bool, &'static str);

const RULES: &[Rule] = &[
    ("word", |s| !s.letters.drawing.is_empty(), "letters.drawing is drawn instead"),
    ("letters.drawing_sha256", |s| s.letters.drawing.is_empty(), "there is no letters.drawing"),
    ("letters.font", |s| !s.letters.drawing.is_empty(), "letters.drawing is drawn instead"),
    ("letters.trace", |s| !is_typeface(s), "letters.font is no typeface"),
    ("letters.smoothing_m", |s| !is_handwriting(s), "letters.drawing is no handwriting"),
    (
        "letters.tolerance_m",
        |s| s.letters.drawing.is_empty() && !is_typeface(s),
        "the letters are drawn of straight strokes",
    ),
    ("letters.spacing_m", has_boxes, "letters of this font stand in boxes, letters.gap_m apart"),
    ("letters.width_m", |s| !has_boxes(s), "letters of this font keep their proportions"),
    ("letters.gap_m", |s| !has_boxes(s), "letters of this font have gaps of their own"),
    ("letters.line_gap_m", |s| !s.word.contains('\n'), "the word has one line"),
    ("plan.floor_wait_s", |s| s.plan.extent == Extent::Letters, "plan.extent is letters"),
    ("plan.landing_height_m", |s| s.plan.extent == Extent::Letters, "plan.extent is letters"),
    (
        "vehicle.rotor_thrust_n_s2",
        |s| !has_rotor_speeds(&s.vehicle),
        "the rotors have no lag, drag or inertia",
    ),
    (
        "vehicle.rotor_radius_m",
        |s| s.vehicle.ground_effect == GroundEffect::None,
        "there is no ground effect",
    ),
    (
        "vehicle.rotor_height_m",
        |s| s.vehicle.ground_effect == GroundEffect::None,
        "there is no ground effect",
    ),
    ("battery.capacity_ah", |_| false, ""),
    ("battery", |s| s.battery.capacity_ah == 0.0, "battery.capacity_ah is 0: no battery"),
    ("air.wind_m_s", |s| !feels_air(&s.vehicle), NO_DRAG),
    ("air.gusts", |s| s.air.gusts == Gusts::Dryden && !feels_air(&s.vehicle), NO_DRAG),
    (
        "air.gusts",
        |s| s.air.gusts == Gusts::Dryden && s.air.wind_m_s[..2] == [0.0; 2],
        "air.wind_m_s is 0, and these gusts grow with the wind",
    ),
    ("air.gusts.sigma_m_s", |s| !feels_air(&s.vehicle), NO_DRAG),
    ("air.gusts.time_s", |s| !feels_air(&s.vehicle), NO_DRAG),
    (
        "rates.position_hz",
        |s| s.controller.kind != ControllerKind::Pid,
        "controller.kind is not pid",
    ),
    (
        "controller.lqr.q_integral",
        |s| s.controller.kind != ControllerKind::LqrIntegral,
        "controller.kind is not lqr-integral",
    ),
    (
        "controller.lqr.motor_lag",
        |s| s.vehicle.motor_rise_s + s.vehicle.motor_fall_s == 0.0,
        "the motors have no lag",
    ),
    (
        "controller.lqr",
        |s| matches!(s.controller.kind, ControllerKind::Pid | ControllerKind::Geometric),
        "controller.kind is no regulator",
    ),
    (
        "controller.geometric",
        |s| s.controller.kind != ControllerKind::Geometric,
        "controller.kind is not geometric",
    ),
    (
        "controller.altitude",
        |s| s.controller.kind != ControllerKind::Altitude,
        "controller.kind is not altitude",
    ),
    ("controller.pid", |s| s.controller.kind != ControllerKind::Pid, "controller.kind is not pid"),
    (
        "observer.ekf.two_way_sigma_m",
        |s| s.sensors.positioning != Positioning::UwbTwr,
        "sensors.positioning is not uwb-twr",
    ),
    (
        "observer.ekf.sweep_v1_sigma_rad",
        |s| !has_generation(s, Generation::V1),
        "no swept station is of the first generation",
    ),
    (
        "observer.ekf.sweep_sigma_rad",
        |s| !has_generation(s, Generation::V2),
        "no swept station is of the second generation",
    ),
    (
        "observer.luenberger",
        |s| s.observer.kind != EstimatorKind::Luenberger,
        "observer.kind is not luenberger",
    ),
    ("observer.ekf", |s| !is_filter(s), "observer.kind is neither ekf, altitude nor cooperative"),
    (
        "observer.ekf.floor_steps",
        |s| !has_ranger(s) || s.observer.kind != EstimatorKind::Ekf,
        "sensors.heights has no time-of-flight, or observer.kind is not ekf",
    ),
    ("observer.altitude", |s| !is_altitude(s), "observer.kind is not altitude"),
    ("observer.cooperative", |s| !is_cooperative(s), "observer.kind is not cooperative"),
    ("sensors.peers", |s| !is_cooperative(s), "observer.kind is not cooperative"),
    (
        "observer.ekf.position_sigma_m",
        |s| !s.sensors.positioning.gives_positions(),
        "sensors.positioning gives no positions",
    ),
    (
        "observer.ekf.range_sigma_m",
        |s| s.sensors.positioning != Positioning::UwbTdoa,
        "sensors.positioning is not uwb-tdoa",
    ),
    ("observer.ekf.barometer_sigma_m", |s| !has_barometer(s), "sensors.heights has no barometer"),
    ("observer.ekf.barometer_sigma_m", is_altitude, "observer.altitude.barometer_sigma_m is used"),
    (
        "sensors",
        |s| s.observer.kind == EstimatorKind::Truth,
        "observer.kind is truth: it needs no sensor",
    ),
    (
        "sensors.heights",
        |s| !is_filter(s),
        "observer.kind is neither ekf, altitude nor cooperative, which alone take heights",
    ),
    ("sensors.lighthouse.stations", |_| false, ""),
    (
        "sensors.lighthouse.jitter_m",
        |s| s.sensors.positioning != Positioning::Position,
        "sensors.positioning is not position",
    ),
    ("sensors.lighthouse.frame_turn_rad", |s| !is_lighthouse(s), NO_LIGHTHOUSE),
    ("sensors.lighthouse.frame_scale_error", |s| !is_lighthouse(s), NO_LIGHTHOUSE),
    ("sensors.lighthouse.distortion_m", |s| !is_lighthouse(s), NO_LIGHTHOUSE),
    ("sensors.lighthouse.distortion_length_m", |s| !is_lighthouse(s), NO_LIGHTHOUSE),
    (
        "sensors.lighthouse",
        |s| {
            !matches!(s.sensors.positioning, Positioning::Sweeps | Positioning::CrossingBeams)
                && !is_lighthouse(s)
        },
        NO_LIGHTHOUSE,
    ),
    ("sensors.uwb", |s| !is_uwb(s), "sensors.positioning is not ultra-wideband"),
    ("sensors.time_of_flight", |s| !has_ranger(s), "sensors.heights has no time-of-flight"),
    ("sensors.barometer", |s| !has_barometer(s), "sensors.heights has no barometer"),
    (
        "sensors.gnss",
        |s| s.sensors.positioning != Positioning::Gnss,
        "sensors.positioning is not gnss",
    ),
    ("light.deck", |s| s.light.fixtures.is_some(), "light.fixtures lists the lamps"),
    (
        "light.ring",
        |s| !has_lamp(s, |f| matches!(f.drive, Drive::Ring(_))),
        "no lamp is of the ring",
    ),
    (
        "light.radio_write_s",
        |s| {
            let channels = s.plan.lights.iter().any(|channel| channel.starts_with("ring."));
            !channels && (s.light.letters_wrgb.is_empty() || !ring_writes(s))
        },
        "the plan sends no color of the ring",
    ),
    ("light.color_led_wrgb", |s| !has_color_led(s), "no lamp is of the color LED deck"),
    (
        "light.letters_wrgb",
        |s| !writes_in_color(s),
        "headlights are white: only the color LED deck and the ring write in colors",
    ),
    ("light.color_led_levels", |s| !has_color_led(s), "no lamp is of the color LED deck"),
    ("light.led_bitmask", |s| !has_lamp(s, |f| f.bitmask_bit.is_some()), "no lamp has a bit in it"),
    (
        "light.led_bitmask",
        |s| s.light.led_bitmask < 128,
        "bit 7 is not set, so that it switches nothing",
    ),
    ("light.pwm", |s| !has_lamp(s, |f| f.pwm_hz > 0.0), "no lamp is dimmed by pulse width"),
    (
        "light.tick_phase_s",
        |s| s.light.tick_s == 0.0 && !has_lamp(s, |f| matches!(f.drive, Drive::Ring(_))),
        "light.tick_s is 0",
    ),
    ("camera.f_number", is_metered, "camera.metering sets it"),
    ("camera.iso", is_metered, "camera.metering sets it"),
    (
        "expose.floor_z_m",
        |s| s.expose.floor_albedo == 0.0,
        "expose.floor_albedo is 0: a black floor",
    ),
    ("photo.glare_radius_m", |s| s.photo.glare_frac == 0.0, "photo.glare_frac is 0"),
    (
        "photo.ambient_rgb",
        |s| s.photo.ambient_cd_m2 == 0.0,
        "photo.ambient_cd_m2 is 0: a dark room",
    ),
    (
        "photo.background_stops",
        |s| s.photo.background.is_empty(),
        "photo.background names no picture",
    ),
];

const NO_DRAG: &str =
    "the drone has no drag (vehicle.body_drag_n_s_m, rotor_drag_n_s2_m, airspeed_moment_n_s)";
const NO_LIGHTHOUSE: &str = "sensors.positioning is not Lighthouse";

fn is_metered(scene: &Scene) -> bool {
    matches!(scene.camera.metering, Metering::Trail(_))
}

fn is_typeface(scene: &Scene) -> bool {
    scene.letters.drawing.is_empty()
        && [".ttf", ".otf"].iter().any(|end| scene.letters.font.to_lowercase().ends_with(end))
}

fn is_handwriting(scene: &Scene) -> bool {
    [".json", ".inkml"].iter().any(|end| scene.letters.drawing.to_lowercase().ends_with(end))
}

fn has_boxes(scene: &Scene) -> bool {
    scene.letters.drawing.is_empty() && scene.letters.font.starts_with("ae483")
}

fn has_rotor_speeds(vehicle: &VehicleOptions) -> bool {
    vehicle.motor_rise_s + vehicle.motor_fall_s > 0.0
        || vehicle.rotor_drag_n_s2_m > 0.0
        || vehicle.rotor_inertia_kg_m2 > 0.0
}

fn feels_air(vehicle: &VehicleOptions) -> bool {
    vehicle.body_drag_n_s_m.iter().any(|drag| *drag > 0.0)
        || vehicle.rotor_drag_n_s2_m > 0.0
        || vehicle.airspeed_moment_n_s > 0.0
}

fn is_uwb(scene: &Scene) -> bool {
    matches!(scene.sensors.positioning, Positioning::UwbTwr | Positioning::UwbTdoa)
}

fn is_lighthouse(scene: &Scene) -> bool {
    matches!(
        scene.sensors.positioning,
        Positioning::Position | Positioning::CrossingBeams | Positioning::Sweeps
    )
}

fn has_generation(scene: &Scene, generation: Generation) -> bool {
    scene.sensors.positioning == Positioning::Sweeps
        && scene.sensors.lighthouse.stations.iter().any(|s| s.generation == generation)
}

fn has_barometer(scene: &Scene) -> bool {
    scene.sensors.heights.contains(&HeightSensor::Barometer) && is_filter(scene)
}

fn has_ranger(scene: &Scene) -> bool {
    scene.sensors.heights.contains(&HeightSensor::TimeOfFlight) && is_filter(scene)
}

fn is_altitude(scene: &Scene) -> bool {
    scene.observer.kind == EstimatorKind::Altitude
}

fn is_cooperative(scene: &Scene) -> bool {
    scene.observer.kind == EstimatorKind::Cooperative
}

/// Whether the estimator has the weights of `observer.ekf`.
fn is_filter(scene: &Scene) -> bool {
    scene.observer.kind == EstimatorKind::Ekf || is_altitude(scene) || is_cooperative(scene)
}

fn has_lamp(scene: &Scene, is: fn(&Fixture) -> bool) -> bool {
    scene.light.fixtures().iter().any(is)
}

fn has_color_led(scene: &Scene) -> bool {
    has_lamp(scene, |f| f.drive == Drive::ColorLed)
}

/// Whether the ring writes, with an effect of one color.
fn ring_writes(scene: &Scene) -> bool {
    !matches!(scene.light.ring, RingEffect::Off | RingEffect::DoubleSpin)
        && scene.plan.lights.iter().any(|channel| channel == "ring")
        && has_lamp(scene, |f| matches!(f.drive, Drive::Ring(_)))
}

/// Whether a lamp writes that has colors.
pub(super) fn writes_in_color(scene: &Scene) -> bool {
    has_color_led(scene) || ring_writes(scene)
}

/// Why a key has no effect in a scene; `None` where it has one. Of the rules for a key, the one with
/// the longest prefix comes first.
pub(crate) fn reason(scene: &Scene, key: &str) -> Option<&'static str> {
    let is_under = |prefix: &str| {
        key.strip_prefix(prefix).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
    };
    let rules = || RULES.iter().filter(|(prefix, ..)| is_under(prefix));
    let always = rules().any(|(prefix, _, why)| *prefix == key && why.is_empty());
    let mut idle = rules().filter(|(_, is_idle, _)| !always && is_idle(scene));
    idle.next().map(|(_, _, why)| *why)
}

impl Scene {
    /// Keys that differ from the preset's and have no effect, each with the reason.
    #[must_use]
    pub fn idle_keys(&self) -> Vec<(String, &'static str)> {
        let plan = match &self.plan.style {
            Style::Even(_) => PlanOptions::even(),
            Style::Team(_) => PlanOptions::default(),
        };
        let mut usual = Self { plan, ..Self::preset(self.preset) };
        if is_metered(self) {
            // A scene that a command wrote has what the meter set.
            (usual.camera.f_number, usual.camera.iso) = (self.camera.f_number, self.camera.iso);
        }
        let [own, usual] =
            [self, &usual].map(|scene| Table::try_from(scene).expect("a scene is a table"));
        let mut keys = Vec::new();
        differing("", Self::SHAPE.settings(), [&own, &usual], &mut keys);
        keys.into_iter()
            .filter_map(|key| Some((reason(self, &key)?, key)))
            .map(|(r, k)| (k, r))
            .collect()
    }
}

/// The keys of two tables that differ; of a choice that was made otherwise, the choice alone.
fn differing(path: &str, settings: &[Setting], [own, usual]: [&Table; 2], keys: &mut Vec<String>) {
    for setting in settings {
        let dot = if path.is_empty() { "" } else { "." };
        let path = format!("{path}{dot}{}", setting.key);
        let [a, b] = [own, usual].map(|table| table.get(setting.key));
        match (setting.shape, a, b) {
            (_, a, b) if a == b => {}
            (Shape::Group(settings), Some(Value::Table(a)), Some(Value::Table(b))) => {
                differing(&path, settings, [a, b], keys);
            }
            (Shape::Tagged(variants), Some(Value::Table(a)), Some(Value::Table(b)))
                if a.get("kind") == b.get("kind") =>
            {
                let kind = a.get("kind").and_then(Value::as_str);
                let variant = variants.iter().find(|variant| Some(variant.name) == kind);
                let settings = variant.map_or(&[][..], |variant| variant.settings);
                differing(&path, settings, [a, b], keys);
            }
            _ => keys.push(path),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::{Preset, Scene};

    fn idle(toml: &str) -> Vec<String> {
        let scene = Scene::parse(toml, "my.toml").unwrap();
        scene.idle_keys().into_iter().map(|(key, _)| key).collect()
    }

    #[test]
    fn a_key_of_a_choice_that_was_not_made_is_named() {
        let bare = "preset = \"ae483-2022\"\n";
        let idle = |toml: &str| idle(&format!("{bare}{toml}"));
        assert_eq!(idle("[air]\nwind_m_s = [1.0, 0.0, 0.0]"), ["air.wind_m_s"]);
        assert_eq!(
            idle("[controller]\nkind = \"pid\"\nlqr.q_integral = [1.0, 1.0, 1.0]"),
            ["controller.lqr.q_integral"]
        );
        assert_eq!(
            idle("[air]\nwind_m_s = [1.0, 0.0, 0.0]\n[vehicle]\nbody_drag_n_s_m = [0.1, 0.1, 0.1]"),
            [""; 0]
        );
        assert_eq!(idle("[light]\nled_bitmask = 5"), ["light.led_bitmask"]);
        assert_eq!(idle("[light]\nled_bitmask = 128"), [""; 0]);
        assert_eq!(idle("[light]\ndeck = \"none\"\nfixtures = []"), ["light.deck"]);
    }

    #[test]
    fn what_the_meter_set_is_no_idle_key() {
        let mut scene = Scene::default();
        (scene.camera.f_number, scene.camera.iso) = (4.5, 200.0);
        assert_eq!(scene.idle_keys(), []);
    }

    #[test]
    fn no_preset_and_no_shipped_scene_has_idle_keys() {
        for &preset in Preset::ALL {
            assert_eq!(Scene::preset(preset).idle_keys(), [], "{preset:?}");
        }
        for name in ["team", "pid", "geometric", "tuned"] {
            assert_eq!(Scene::find(name, &[]).unwrap().scene.idle_keys(), [], "{name}");
        }
    }
}
