//! Tests that every key of a scene has an effect, is refused, or is reported to have none.

use std::cell::OnceCell;

use toml::{Table, Value};

use super::{Judging, Shoot, Shot};
use crate::scene::{Scene, reason};
use noctograph_core::flight::Flight;
use noctograph_core::settings::{Described, Setting, Shape, joined, names, of_kind};
use noctograph_sim::sensors::HeightSensor;

/// Keys that do not affect the products of these stages, and what they affect instead.
const ELSEWHERE: &[(&str, &str)] = &[
    ("preset", "the values of the keys that are left out"),
    ("letters.fallback", "words with letters that the font lacks"),
    ("sensors.lighthouse.stations", "`coverage` and `check`"),
    ("sensors.lighthouse.people_m", "`coverage`, `check`, and sweeps"),
    (
        "vehicle.firmware",
        "outages of the radio of more than 0.5 s, landings after full states, the clock of µSD logs \
         and of trajectories on board",
    ),
    ("air.downwash", "drones that are planned above each other"),
    ("sensors.lighthouse.mirrors_m", "`coverage`, and sweeps that the firmware's filter believes"),
    ("sensors.lighthouse.panes_m", "`coverage`, and sweeps where the pane reflects enough"),
    ("camera.metering.least_stops", "long flights, in which the room would fog the picture"),
    (
        "camera.metering.room_stops",
        "lamps so dim or flights so long that the room would fog the picture",
    ),
    ("camera.dots_per_inch", "the size of the print, in the photo's file"),
    ("camera.shutter_close_s", "nothing at the end of the flight"),
];

/// A scene and its products or errors, each of which is computed when first needed.
struct Case {
    scene: Scene,
    shoot: OnceCell<Result<Shoot, String>>,
    flights: OnceCell<Result<Vec<Flight>, String>>,
    shot: OnceCell<Result<Shot, String>>,
}

impl Case {
    /// Reads the scene `text` with settings that override its keys. Products are computed when they
    /// are needed.
    fn new(text: &str, settings: &[(&str, &str)]) -> Result<Self, String> {
        let scene = Scene::parse_with(text, "scene", settings).map_err(|e| e.to_string())?;
        let (shoot, flights, shot) = (OnceCell::new(), OnceCell::new(), OnceCell::new());
        Ok(Self { scene, shoot, flights, shot })
    }

    /// Returns the planned shoot, which is not judged and runs on one core, or the message of its
    /// error.
    fn shoot(&self) -> Result<Shoot, String> {
        let shoot = self.shoot.get_or_init(|| {
            let shoot = Shoot::new(self.scene.clone()).map_err(|e| e.to_string())?;
            Ok(Shoot { judging: Judging::Skipped, cores: std::num::NonZero::new(1), ..shoot })
        });
        shoot.clone()
    }

    fn flights(&self) -> &Result<Vec<Flight>, String> {
        self.flights.get_or_init(|| self.shoot()?.fly(&|_, _| {}).map_err(|e| e.to_string()))
    }

    fn shot(&self) -> &Result<Shot, String> {
        self.shot.get_or_init(|| self.shoot()?.take(&|_, _| {}).map_err(|e| e.to_string()))
    }

    /// Returns true if any product differs, or if only one of the two scenes fails. The products
    /// that are quickest to compute are compared first.
    fn differs(&self, other: &Self) -> bool {
        self.scene.score != other.scene.score
            || is_changed(&self.shoot(), &other.shoot(), |a, b| a.plans != b.plans)
            || is_changed(self.flights(), other.flights(), |a, b| a != b)
            || is_changed(self.shot(), other.shot(), |a, b| {
                a.photo.rgb8 != b.photo.rgb8 || a.camera != b.camera
            })
    }
}

/// Returns true if two products differ, or if only one of them can be computed.
fn is_changed<T>(
    a: &Result<T, String>,
    b: &Result<T, String>,
    differ: impl Fn(&T, &T) -> bool,
) -> bool {
    match (a, b) {
        (Ok(a), Ok(b)) => differ(a, b),
        (a, b) => a.is_err() != b.is_err(),
    }
}

/// Returns alternative values of a key, as TOML, with the one most likely to have an effect first.
fn others(key: &str, setting: &Setting, value: Option<&Value>) -> Vec<String> {
    let number = |v: f64| {
        let [min, max] = setting.range.unwrap_or([v - v.abs() - 1.0, v + v.abs() + 1.0]);
        let near = [1.3 * v + 0.1 * (max.min(1.0) - v.min(1.0)), 1.01 * v, min, max];
        let usable = move |x: &f64| *x != v && (min..=max).contains(x) && x.abs() < 1e7;
        near.into_iter().filter(usable).collect::<Vec<f64>>()
    };
    match (key, setting.shape, value) {
        ("word", ..) => vec!["\"L\"".into()],
        ("letters.font", ..) => {
            vec!["\"ae483-fixed\"".into(), "\"simplex\"".into(), "\"ae483\"".into()]
        }
        ("plan.lights", ..) => vec!["[\"ring\"]".into()],
        ("floor.steps", ..) => {
            vec!["[{ x_m = [-9.0, 9.0], y_m = [-9.0, 9.0], height_m = 0.05 }]".into()]
        }
        // With eight drones, commands are delayed by more than a tick.
        ("radio.drones", ..) => vec!["8".into()],
        ("sensors.lighthouse.silent", ..) => vec!["[[0.0, 0.0, 100.0]]".into()],
        ("sensors.heights", ..) => vec!["[\"barometer\"]".into()],
        ("camera.white_balance", ..) => vec!["3200.0".into()],
        ("light.letters_wrgb", ..) => vec!["[[0, 0, 255, 0]]".into()],
        ("light.led_bitmask", ..) => vec!["128".into(), "255".into()],
        (_, shape @ (Shape::Names(_) | Shape::Tagged(_)), value) => {
            let now = value.and_then(|v| v.as_str().or_else(|| v.get("kind")?.as_str()));
            names(shape)
                .filter(|name| Some(*name) != now)
                .map(|name| format!("\"{name}\""))
                .collect()
        }
        (_, _, None) => match setting.range {
            Some(_) if key.ends_with("_wxyz") || key.ends_with("canvas_m") => {
                let n = if key.ends_with("_wxyz") { "[0.7, 0.7, 0.0, 0.0]" } else { "[0.2, 0.2]" };
                vec![n.into()]
            }
            Some(_) => vec!["2.5".into()],
            None => vec!["[]".into()],
        },
        (_, _, Some(Value::Boolean(on))) => vec![(!on).to_string()],
        (_, _, Some(Value::String(_))) => vec!["\"no such file\"".into()],
        (_, _, Some(Value::Float(v))) => number(*v).iter().map(|v| format!("{v:?}")).collect(),
        (_, _, Some(Value::Integer(v))) => {
            let [min, max] = setting.range.unwrap_or([0.0, 1e3]);
            [v + 1, 2 * v, v / 2]
                .into_iter()
                .filter(|x| x != v && (min..=max).contains(&(*x as f64)))
                .map(|v| v.to_string())
                .collect()
        }
        (_, _, Some(Value::Array(items))) => {
            let changed = |item: &Value| match item {
                Value::Float(v) => Value::Float(number(*v).first().copied().unwrap_or(*v)),
                Value::Integer(v) => Value::Integer(if *v > 0 { v / 2 } else { 99 }),
                Value::Array(parts) => Value::Array(
                    parts.iter().map(|p| Value::Float(p.as_float().unwrap_or(0.0) + 0.3)).collect(),
                ),
                other => other.clone(),
            };
            vec![Value::Array(items.iter().map(changed).collect()).to_string(), "[]".into()]
        }
        (_, _, Some(_)) => Vec::new(),
    }
}

/// Calls `visit` for every key in the printed file of a scene.
fn walk(
    path: &str,
    settings: &[Setting],
    values: &Table,
    visit: &mut dyn FnMut(&str, &Setting, Option<&Value>),
) {
    for setting in settings {
        let path = joined(path, setting.key);
        let value = values.get(setting.key);
        match (setting.shape, value) {
            (Shape::Group(settings), Some(Value::Table(values))) => {
                walk(&path, settings, values, visit);
            }
            (Shape::Tagged(variants), Some(Value::Table(inner))) => {
                visit(&path, setting, value);
                walk(&path, of_kind(variants, inner), inner, visit);
            }
            _ => visit(&path, setting, value),
        }
    }
}

/// Returns a message for each key that has no effect but is neither refused nor explained, and for
/// each key that has an effect although a reason for having none is given.
fn faults(settings: &[(&str, &str)]) -> Vec<String> {
    // A straight stroke and a round one, in small letters: hundreds of them are flown.
    let (word, cap_height) = (("word", "IO"), ("letters.cap_height_m", "0.15"));
    let small = [("camera.width_px", "320"), ("camera.height_px", "180"), word, cap_height];
    let settings: Vec<(&str, &str)> = small.iter().chain(settings).copied().collect();
    let base = Case::new("", &settings).unwrap();
    base.shot().as_ref().unwrap();
    let text = base.scene.to_toml();
    let values = base.scene.to_table();
    let mut faults = Vec::new();
    walk("", Scene::SHAPE.settings(), &values, &mut |key, setting, value| {
        if ELSEWHERE.iter().any(|(elsewhere, _)| *elsewhere == key) {
            return;
        }
        let others = others(key, setting, value);
        // Scenes that are refused, or whose key has a reason, do not have to be flown.
        let (mut unused, mut refused, mut silent) = (0, 0, 0);
        for other in &others {
            match Case::new(&text, &[(key, other)]) {
                Err(_) => refused += 1,
                Ok(case) if reason(&case.scene, key).is_some() => {
                    unused += 1;
                    if unused == 1 && case.differs(&base) {
                        faults.push(format!("{key}: said to have no effect, but has one"));
                    }
                }
                Ok(case) if case.differs(&base) => return,
                Ok(_) => silent += 1,
            }
        }
        if unused + refused == 0 {
            faults.push(format!("{key}: no effect and no reason, {silent} values of {others:?}"));
        }
    });
    faults
}

#[test]
fn every_key_of_the_default_scene_has_an_effect_or_a_reason() {
    assert_eq!(faults(&[]), [""; 0]);
}

#[test]
fn every_key_of_a_scene_with_all_parts_on_has_an_effect_or_a_reason() {
    let heights: Vec<_> = HeightSensor::ALL.iter().map(|sensor| sensor.name()).collect();
    let heights = format!("{heights:?}");
    let on = [
        ("preset", "cf21"),
        ("plan.style", "even"),
        ("controller.kind", "pid"),
        ("observer.kind", "ekf"),
        ("sensors.positioning", "sweeps"),
        ("sensors.heights", &heights),
        ("air.gusts", "ornstein-uhlenbeck"),
        ("air.wind_m_s", "[0.2, 0.1, 0.0]"),
        ("light.deck", "color-led"),
        ("camera.framing", "fixed"),
    ];
    assert_eq!(faults(&on), [""; 0]);
}
