//! Finds keys without effect, with the reason: another choice, or a part that is switched off.

use toml::{Table, Value};

use super::Scene;
use noctograph_core::files::ending;
use noctograph_core::settings::{Described, Need, Setting, Shape, joined, of_kind};
use noctograph_picture::expose::meter::is_colored;
use noctograph_picture::light::{COLOR_LED, Drive, Fixture, RING, RingEffect};
use noctograph_plan::{PlanOptions, Style};
use noctograph_sim::EstimatorKind;
use noctograph_sim::sensors::Positioning;
use noctograph_sim::vehicle::{Gusts, VehicleOptions};

/// Rule: keys or tables, a test that returns true if they have no effect in a scene, and the
/// reason. A condition on one other setting is declared with the setting ([`Need`]). Conditions of
/// all other kinds are in these rules.
type Rule = (&'static [&'static str], fn(&Scene) -> bool, &'static str);

const RULES: &[Rule] = &[
    (
        &["letters.trace"],
        |s| !is_typeface(s) && !is_bitmap(s),
        "letters.font is not a typeface, and letters.drawing is not a picture",
    ),
    (
        &["letters.font", "letters.width_m", "letters.gap_m"],
        |s| !s.letters.drawing.is_empty(),
        "letters.drawing replaces the word",
    ),
    (&["letters.pace"], |s| !is_handwriting(s), "letters.drawing is not handwriting"),
    (&["letters.line_gap_m"], |s| !s.word.contains('\n'), "the word has one line"),
    (
        &["vehicle.rotor_thrust_n_s2"],
        |s| !has_rotor_speeds(&s.vehicle),
        "the rotors have no lag, drag or inertia",
    ),
    (
        &["controller.lqr.motor_lag"],
        |s| s.vehicle.motor_rise_s + s.vehicle.motor_fall_s == 0.0,
        "the motors have no lag",
    ),
    (
        &["observer.ekf.gate_sigmas"],
        |s| {
            s.sensors.positioning == Positioning::Sweeps
                && (s.observer.kind == EstimatorKind::Altitude || s.sensors.heights.is_empty())
        },
        "sweeps pass the firmware's own filter, and nothing else is measured",
    ),
    (&["air.wind_m_s", "air.gusts.time_s"], |s| !feels_air(&s.vehicle), NO_DRAG),
    (
        &["air.gusts"],
        |s| {
            s.air.gusts == Gusts::Dryden
                && (!feels_air(&s.vehicle) || s.air.wind_m_s[..2] == [0.0; 2])
        },
        "these gusts are proportional to the wind and act by drag, but the wind or the drag is 0",
    ),
    (
        &["light.ring"],
        |s| !has_lamp(s, |f| matches!(f.drive, Drive::Ring(_))),
        "the scene has no lamp of the ring",
    ),
    (
        &["light.color_led_wrgb", "light.color_led_levels"],
        |s| !has_color_led(s),
        "the scene has no lamp of the color LED deck",
    ),
    (
        &["camera.metering.color_stops"],
        |s| !s.plan.lights.iter().any(|channel| writes_colors(s, channel)),
        "the plan writes in white",
    ),
    (
        &["light.letters_wrgb"],
        |s| !writes_in_color(s),
        "headlights are white: only the color LED deck and the ring write in colors",
    ),
    (
        &["light.led_bitmask"],
        |s| s.light.led_bitmask < 128 || !has_lamp(s, |f| f.bitmask_bit.is_some()),
        "bit 7, which lets the mask switch lamps, is not set, or no lamp has a bit in it",
    ),
    (
        &["camera.lens", "camera.f_number", "camera.base_iso"],
        |s| s.camera.body.fixed_lens().is_some(),
        "a phone has a fixed lens",
    ),
    (
        &["photo.ambient_cd_m2", "photo.ambient_from_m", "expose.unevenness"],
        |s| !s.photo.background.is_empty(),
        "photo.background provides the light and the texture of the room",
    ),
];

/// Keys of stations and obstacles, which `coverage` and `check` use with every positioning system.
const ALWAYS_USED: [&str; 4] = [
    "sensors.lighthouse.stations",
    "sensors.lighthouse.people_m",
    "sensors.lighthouse.mirrors_m",
    "sensors.lighthouse.panes_m",
];

const NO_DRAG: &str =
    "the drone has no drag (vehicle.body_drag_n_s_m, rotor_drag_n_s2_m, airspeed_moment_n_s)";

/// Returns true if the letters come from a typeface file, TrueType or OpenType.
fn is_typeface(scene: &Scene) -> bool {
    scene.letters.drawing.is_empty()
        && std::iter::once(&scene.letters.font)
            .chain(&scene.letters.fallback)
            .any(|name| ["ttf", "otf", "ttc", "otc"].contains(&&*ending(name)))
}

/// Returns true if the drawing is a JSON file, which contains handwriting.
fn is_handwriting(scene: &Scene) -> bool {
    ending(&scene.letters.drawing) == "json"
}

/// Returns true if the drawing is a picture of pixels.
fn is_bitmap(scene: &Scene) -> bool {
    let kinds = ["png", "jpg", "jpeg", "webp", "gif", "bmp"];
    kinds.contains(&&*ending(&scene.letters.drawing))
}

/// Returns true if the simulator uses the speeds of the rotors, for their lag, drag or inertia.
fn has_rotor_speeds(vehicle: &VehicleOptions) -> bool {
    vehicle.motor_rise_s + vehicle.motor_fall_s > 0.0
        || vehicle.rotor_drag_n_s2_m > 0.0
        || vehicle.rotor_inertia_kg_m2 > 0.0
}

/// Returns true if the air exerts a force or a moment on the drone.
fn feels_air(vehicle: &VehicleOptions) -> bool {
    vehicle.body_drag_n_s_m.iter().any(|drag| *drag > 0.0)
        || vehicle.rotor_drag_n_s2_m > 0.0
        || vehicle.airspeed_moment_n_s > 0.0
}

/// Returns true if a lamp of the scene passes a test.
fn has_lamp(scene: &Scene, test: fn(&Fixture) -> bool) -> bool {
    scene.light.fixtures().iter().any(test)
}

/// Returns true if a channel of the plan can emit colored light.
fn writes_colors(scene: &Scene, channel: &str) -> bool {
    let light = &scene.light;
    // The color LED is white by default. A fixture listed in the scene has the color of its dies.
    let has_color = light.color_led_wrgb[1..] != [0; 3]
        || !light.letters_wrgb.is_empty()
        || !scene.letters.drawing.is_empty();
    channel == COLOR_LED.name && has_color
        || channel.starts_with(RING.name)
        || light.fixtures().iter().any(|lamp| {
            let is_commanded = matches!(lamp.drive, Drive::Command(_));
            is_commanded && is_colored(lamp) && lamp.drive.channel() == Some(channel)
        })
}

fn has_color_led(scene: &Scene) -> bool {
    has_lamp(scene, |f| f.drive == Drive::ColorLed)
}

/// Returns true if the ring writes with a single-color effect.
fn ring_writes(scene: &Scene) -> bool {
    !matches!(scene.light.ring, RingEffect::Off | RingEffect::DoubleSpin)
        && scene.plan.lights.iter().any(|channel| channel == RING.name)
        && has_lamp(scene, |f| matches!(f.drive, Drive::Ring(_)))
}

/// Returns true if a colored lamp writes.
pub(super) fn writes_in_color(scene: &Scene) -> bool {
    has_color_led(scene) || ring_writes(scene)
}

/// Returns the reason why a key has no effect in a scene, or `None` if it has an effect.
pub fn reason(scene: &Scene, key: &str) -> Option<String> {
    if ALWAYS_USED.contains(&key) {
        return None;
    }
    let values = Value::Table(scene.to_table());
    let mut reasons = Vec::new();
    // The loop descends from the outermost table to the key, so the innermost reason is returned.
    let (mut settings, mut path) = (Scene::SHAPE.settings(), String::new());
    for part in key.split('.') {
        path = joined(&path, part);
        let mut rules = RULES.iter().filter(|(keys, ..)| keys.contains(&&*path));
        let rule = rules.find(|(_, is_unused, _)| is_unused(scene));
        reasons.extend(rule.map(|(_, _, why)| (*why).to_owned()));
        let Some(setting) = settings.iter().find(|setting| setting.key == part) else { break };
        let mut needs = setting.needs.iter().filter(|need| need.key != key);
        reasons.extend(needs.find_map(|need| unmet(need, &values)));
        settings = match setting.shape {
            Shape::Group(settings) => settings,
            Shape::Tagged(variants) => {
                let kinds = names_at(&values, &path);
                let variant = variants.iter().find(|v| kinds.iter().any(|kind| kind == v.name));
                variant.map_or(&[][..], |variant| variant.settings)
            }
            Shape::Plain | Shape::Names(_) => &[],
        };
    }
    reasons.pop()
}

/// Returns the reason why a setting's need is not met, or `None` if it is. `values` are those of
/// the scene.
fn unmet(need: &Need, values: &Value) -> Option<String> {
    let Need { key, names, holds } = need;
    let value = values_at(values, key).into_iter().next();
    let actual = names_at(values, key);
    let matching = names.iter().find(|name| actual.iter().any(|actual| actual == *name));
    // If the need lists no names, any value meets it except zero and empty text.
    let (matches, state) = match (names.split_last(), matching, value) {
        (None, _, Some(value)) if !is_off(value) => (true, "set".to_owned()),
        (None, _, Some(value)) if value.is_float() => (false, "0".to_owned()),
        (None, ..) => (false, "not set".to_owned()),
        (Some(_), Some(name), _) => (true, (*name).to_owned()),
        (Some((last, [])), None, _) => (false, format!("not {last}")),
        (Some((last, others)), None, _) => {
            (false, format!("neither {} nor {last}", others.join(", ")))
        }
    };
    (matches != *holds).then(|| format!("{key} is {state}"))
}

/// Returns true for zero and the empty text.
fn is_off(value: &Value) -> bool {
    value.as_float() == Some(0.0)
        || value.as_integer() == Some(0)
        || value.as_str().is_some_and(str::is_empty)
}

/// Returns the values at a dotted key. Each table in a list along the path contributes one value.
fn values_at<'a>(values: &'a Value, key: &str) -> Vec<&'a Value> {
    key.split('.').fold(vec![values], |values, part| {
        let rows = values.into_iter().flat_map(|value| match value {
            Value::Array(rows) => rows.iter().collect(),
            value => vec![value],
        });
        rows.filter_map(|row| row.get(part)).collect()
    })
}

/// Returns the names at a dotted key: texts, the `kind` of tables, integers, and items of lists.
fn names_at(values: &Value, key: &str) -> Vec<String> {
    let items = values_at(values, key).into_iter().flat_map(|value| match value {
        Value::Array(items) => items.iter().collect(),
        value => vec![value],
    });
    let names = items.filter_map(|value| match value {
        Value::Integer(number) => Some(number.to_string()),
        value => value.as_str().or_else(|| value.get("kind")?.as_str()).map(str::to_owned),
    });
    names.collect()
}

impl Scene {
    /// Returns the keys that differ from the preset and have no effect, each with the reason.
    pub fn unused_keys(&self) -> Vec<(String, String)> {
        let plan = match &self.plan.style {
            Style::Even(_) => PlanOptions::even(),
            Style::Team(_) => PlanOptions::default(),
        };
        let usual = Self { plan, ..Self::preset(self.preset) };
        let [values, usual] = [self, &usual].map(Self::to_table);
        let mut keys = Vec::new();
        differing("", Self::SHAPE.settings(), [&values, &usual], &mut keys);
        keys.into_iter().filter_map(|key| reason(self, &key).map(|why| (key, why))).collect()
    }
}

/// Appends to `keys` the keys that differ between two tables. If the kinds of a choice differ, only
/// the key of the choice is added.
fn differing(path: &str, settings: &[Setting], tables: [&Table; 2], keys: &mut Vec<String>) {
    for setting in settings {
        let path = joined(path, setting.key);
        // Tables of the same kind are compared key by key.
        let [a, b] = tables.map(|table| table.get(setting.key));
        match (setting.shape, a, b) {
            (_, a, b) if a == b => {}
            (Shape::Group(settings), Some(Value::Table(a)), Some(Value::Table(b))) => {
                differing(&path, settings, [a, b], keys);
            }
            (Shape::Tagged(variants), Some(Value::Table(a)), Some(Value::Table(b)))
                if a.get("kind") == b.get("kind") =>
            {
                differing(&path, of_kind(variants, a), [a, b], keys);
            }
            _ => keys.push(path),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::{Preset, Scene};

    fn unused(toml: &str) -> Vec<String> {
        let scene = Scene::parse(toml, "my.toml").unwrap();
        scene.unused_keys().into_iter().map(|(key, _)| key).collect()
    }

    #[test]
    fn a_key_of_a_choice_that_was_not_made_is_named() {
        let bare = "preset = \"ae483-2022\"\n";
        let unused = |toml: &str| unused(&format!("{bare}{toml}"));
        assert_eq!(unused("[air]\nwind_m_s = [1.0, 0.0, 0.0]"), ["air.wind_m_s"]);
        assert_eq!(
            unused("[controller]\nkind = \"pid\"\nlqr.q_integral = [1.0, 1.0, 1.0]"),
            ["controller.lqr.q_integral"]
        );
        assert_eq!(
            unused(
                "[air]\nwind_m_s = [1.0, 0.0, 0.0]\n[vehicle]\nbody_drag_n_s_m = [0.1, 0.1, 0.1]"
            ),
            [""; 0]
        );
        assert_eq!(unused("[light]\nled_bitmask = 5"), ["light.led_bitmask"]);
        assert_eq!(unused("[light]\nled_bitmask = 128"), [""; 0]);
        assert_eq!(unused("[light]\ndeck = \"none\"\nfixtures = []"), ["light.deck"]);
        let room = "[photo]\nbackground = \"room.png\"\nambient_cd_m2 = 0.1";
        assert_eq!(unused(room), ["photo.ambient_cd_m2"]);
        let in_color = |chromaticity: &str| {
            let toml = format!(
                "[plan]\nlights = [\"laser\"]\n[[light.fixtures]]\ndrive.command = \"laser\"\n\
                 parameter = \"laser.power\"\ndies = [{{ chromaticity = {chromaticity} }}]\n"
            );
            let scene = Scene::parse(&toml, "my.toml").unwrap();
            super::reason(&scene, "camera.metering.color_stops").is_none()
        };
        assert!(in_color("[0.694, 0.306]") && !in_color("[0.3127, 0.329]"), "red, white");
    }

    #[test]
    fn no_preset_and_no_shipped_scene_has_unused_keys() {
        for &preset in Preset::ALL {
            assert_eq!(Scene::preset(preset).unused_keys(), [], "{preset:?}");
        }
        for name in ["team", "pid", "geometric", "tuned"] {
            assert_eq!(Scene::find(name, &[]).unwrap().scene.unused_keys(), [], "{name}");
        }
    }
}
