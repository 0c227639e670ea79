//! Knobs: the parameters of a search. A knob sets one or more keys of a scene.

use std::collections::BTreeMap;
use std::str::FromStr;

use noctograph_core::error::{Error, Result};
use noctograph_pipeline::scene::{Scene, reason};
use noctograph_sim::ControllerKind;

/// A setting that a search varies, or several settings that it varies jointly.
#[derive(Clone, Debug, PartialEq)]
pub struct Knob {
    /// Keys that the knob sets in a scene, such as `controller.lqr.q[0]`.
    pub keys: Vec<String>,
    /// Range or choices of the knob's values.
    pub turn: Turn,
}

/// The possible values of a knob.
#[derive(Clone, Debug, PartialEq)]
pub enum Turn {
    /// The scene's original value times a factor from this range, on a logarithmic scale.
    Times([f64; 2]),
    /// A value from this range, on a logarithmic scale.
    To([f64; 2]),
    /// One of these words.
    Choice(Vec<String>),
}

/// The usual knobs of LQR controllers, followed by those of other controllers.
const LQR: &str = "
    controller.kind=lqr|lqr-feedforward|lqr-integral
    controller.lqr.q[0]+controller.lqr.q[1]*=0.1..10
    controller.lqr.q[2]*=0.1..10
    controller.lqr.q[4]+controller.lqr.q[5]=0.001..10
    controller.lqr.q[6]+controller.lqr.q[7]*=0.03..30
    controller.lqr.q[8]*=0.1..10
    controller.lqr.q[9]+controller.lqr.q[10]*=0.001..3
    controller.lqr.q_integral[0]+controller.lqr.q_integral[1]+controller.lqr.q_integral[2]=1..300
    controller.lqr.r[0]+controller.lqr.r[1]*=0.1..30
    controller.lqr.r[3]*=0.1..10";
const ALTITUDE: &str = "
    controller.altitude.error_m*=0.3..3
    controller.altitude.acceleration_m_s2*=0.3..3
    controller.lqr.q[0]+controller.lqr.q[1]*=0.1..10
    controller.lqr.r[0]+controller.lqr.r[1]*=0.1..30";
const GEOMETRIC: &str = "
    controller.geometric.k_position*=0.3..3
    controller.geometric.k_velocity*=0.3..3
    controller.geometric.k_position_integral=0.1..20
    controller.geometric.k_attitude[0]+controller.geometric.k_attitude[1]*=0.3..3
    controller.geometric.k_rate[0]+controller.geometric.k_rate[1]*=0.3..3";
const PID: &str = "
    controller.pid.pos_x[0]+controller.pid.pos_y[0]*=0.3..3
    controller.pid.pos_z[0]*=0.3..3
    controller.pid.vel_x[0]+controller.pid.vel_y[0]*=0.3..3
    controller.pid.vel_z[0]*=0.3..3
    controller.pid.vel_z[1]*=0.1..10
    controller.pid.roll[0]+controller.pid.pitch[0]*=0.5..2";
/// The usual knobs for the observer and the plan.
const OBSERVER_AND_SPEED: &str = "
    observer.luenberger.q[0]+observer.luenberger.q[1]+observer.luenberger.q[2]*=0.05..5
    plan.stroke_speed_m_s=0.12..0.4";

impl Knob {
    /// Returns the usual knobs that have an effect in a scene: weights or gains of its controller,
    /// the observer's weights for the measured position, and the stroke speed.
    pub fn usual(scene: &Scene) -> Vec<Self> {
        let controller = match scene.controller.kind {
            // A fixed gain does not depend on weights.
            _ if scene.controller.lqr.k.is_some() => "",
            ControllerKind::Lqr | ControllerKind::LqrFeedforward | ControllerKind::LqrIntegral => {
                LQR
            }
            ControllerKind::Altitude => ALTITUDE,
            ControllerKind::Geometric => GEOMETRIC,
            ControllerKind::Pid => PID,
        };
        let texts = [controller, OBSERVER_AND_SPEED].map(str::split_whitespace);
        let knobs = texts.into_iter().flatten().map(|text| text.parse().expect("a valid knob"));
        let mut knobs: Vec<Self> = knobs.collect();
        // Knobs without effect would only waste flights.
        let unused = without_effect(scene, &knobs);
        knobs.retain(|knob| !unused.iter().any(|(key, _why)| knob.keys.contains(key)));
        knobs
    }

    /// Sets the knob's keys in a scene to the value at `fraction` of its range, 0 to 1. Returns an
    /// error if the scene lacks a key, or if a key's value is of a different type.
    fn set(&self, scene: &mut toml::Table, fraction: f64) -> Result<()> {
        for key in &self.keys {
            let value = find(scene, key)?;
            *value = match (&self.turn, value.as_float()) {
                (Turn::Times(range), Some(original)) => {
                    toml::Value::Float(original * log_between(*range, fraction))
                }
                (Turn::To(range), Some(_)) => toml::Value::Float(log_between(*range, fraction)),
                (Turn::Choice(words), None) if value.is_str() => {
                    #[expect(clippy::cast_possible_truncation, reason = "a few words")]
                    // The words divide the range into equal parts. A fraction of 1 selects the last
                    // one.
                    let index = (fraction * words.len() as f64) as usize;
                    toml::Value::String(words[index.min(words.len() - 1)].clone())
                }
                _ => {
                    let wanted = "a number for a range, or a word for a choice";
                    return Err(Error::input(key.as_str(), value.to_string(), wanted, HINT));
                }
            };
        }
        Ok(())
    }
}

/// Returns the value at a fraction of a range on a logarithmic scale.
fn log_between([least, most]: [f64; 2], fraction: f64) -> f64 {
    libm::exp(libm::log(least) + fraction * libm::log(most / least))
}

const HINT: &str = "for example plan.stroke_speed_m_s=0.1..0.4, controller.lqr.q[2]*=0.1..10 or \
                    controller.kind=lqr|lqr-feedforward";

/// Returns a scene whose knobs are set to a point of the unit cube. The point has a coordinate from
/// 0 to 1 for each knob.
///
/// # Errors
///
/// Returns [`Error::Input`] if the scene lacks a key, or if a key's value is of a different type.
/// Returns the errors of [`Scene::check`].
pub fn turned(scene: &Scene, knobs: &[Knob], point: &[f64]) -> Result<Scene> {
    let mut values = scene.to_table();
    for (knob, fraction) in knobs.iter().zip(point) {
        knob.set(&mut values, *fraction)?;
    }
    let scene = Scene::from_table(values)?;
    scene.check()?;
    Ok(scene)
}

/// Returns the keys of knobs without effect under any combination of choices, as pairs of a key and
/// the reason.
pub(super) fn without_effect(scene: &Scene, knobs: &[Knob]) -> Vec<(String, String)> {
    // The scene is set to every combination of the choices.
    let mut scenes = vec![scene.clone()];
    for knob in knobs {
        let Turn::Choice(words) = &knob.turn else { continue };
        let before = scenes.clone();
        // A word is chosen by the middle of its part in the range.
        for fraction in (0..words.len()).map(|index| (index as f64 + 0.5) / words.len() as f64) {
            let knob = std::slice::from_ref(knob);
            scenes.extend(before.iter().flat_map(|scene| turned(scene, knob, &[fraction])));
        }
    }
    let keys = knobs.iter().flat_map(|knob| &knob.keys);
    keys.filter_map(|key| {
        // The reasons are listed by key without an index.
        let named = key.split('[').next().unwrap_or(key);
        let mut reasons = scenes.iter().map(|scene| reason(scene, named));
        let first = reasons.next()??;
        reasons.all(|reason| reason.is_some()).then(|| (key.clone(), first))
    })
    .collect()
}

/// Returns the scene's values of the keys that the knobs set, by key.
///
/// # Errors
///
/// Returns [`Error::Input`] if the scene lacks a key.
pub fn settings(scene: &Scene, knobs: &[Knob]) -> Result<BTreeMap<String, toml::Value>> {
    let mut values = scene.to_table();
    let keys = knobs.iter().flat_map(|knob| &knob.keys);
    keys.map(|key| Ok((key.clone(), find(&mut values, key)?.clone()))).collect()
}

/// Returns the value of a key such as `controller.lqr.q[0]`, or an error if it is missing.
fn find<'a>(scene: &'a mut toml::Table, key: &str) -> Result<&'a mut toml::Value> {
    // For example, `a.b[2]` has the parts a, b and 2.
    let mut parts = key.split(['.', '[']).map(|part| part.trim_end_matches(']'));
    let first = parts.next().and_then(|part| scene.get_mut(part));
    let value = parts.try_fold(first, |value, part| match value? {
        toml::Value::Table(table) => Some(table.get_mut(part)),
        toml::Value::Array(array) => Some(array.get_mut(part.parse::<usize>().ok()?)),
        _ => None,
    });
    value.flatten().ok_or_else(|| Error::input("knob", key, "a key of the scene", HINT))
}

impl FromStr for Knob {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let invalid = || Error::input("knob", text, "KEYS=LOW..HIGH, KEYS*=… or KEY=a|b", HINT);
        let (left, right) = text.split_once('=').ok_or_else(invalid)?;
        let (names, is_factor) =
            left.strip_suffix('*').map_or((left, false), |names| (names, true));
        let keys = names.split('+').map(str::to_owned).collect();
        // Two numbers separated by `..` form a range. Anything else is a list of words.
        let turn = if let Some((low, high)) = right.split_once("..") {
            let range @ [low, high] = [low, high].map(|end| end.parse().unwrap_or(f64::NAN));
            if !(0.0 < low && low < high && high.is_finite()) {
                return Err(invalid());
            }
            if is_factor { Turn::Times(range) } else { Turn::To(range) }
        } else {
            let words: Vec<String> = right.split('|').map(str::to_owned).collect();
            if is_factor || words.len() < 2 || words.iter().any(String::is_empty) {
                return Err(invalid());
            }
            Turn::Choice(words)
        };
        Ok(Self { keys, turn })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_pipeline::scene::Preset;

    #[test]
    fn knobs_turn_what_they_name_and_nothing_else() {
        let knobs = [
            "controller.lqr.q[0]+controller.lqr.q[1]*=0.1..10",
            "plan.stroke_speed_m_s=0.1..0.4",
            "controller.kind=lqr|lqr-integral",
        ];
        let knobs = knobs.map(|text| text.parse::<Knob>().unwrap());
        let scene = Scene::preset(Preset::Ae4832022);
        let turned = turned(&scene, &knobs, &[0.75, 0.5, 0.6]).unwrap();
        let mut want = scene.clone();
        let root = libm::exp(0.5 * libm::log(10.0));
        want.controller.lqr.q[0] = turned.controller.lqr.q[0];
        want.controller.lqr.q[1] = turned.controller.lqr.q[1];
        assert!((turned.controller.lqr.q[0] / (120.0 * root) - 1.0).abs() < 1e-12);
        assert!((turned.controller.lqr.q[1] / (80.0 * root) - 1.0).abs() < 1e-12);
        want.plan.stroke_speed_m_s = turned.plan.stroke_speed_m_s;
        assert!((turned.plan.stroke_speed_m_s - 0.2).abs() < 1e-12);
        want.controller.kind = ControllerKind::LqrIntegral;
        assert_eq!(turned, want);
        let values = settings(&turned, &knobs).unwrap();
        let speed_m_s = values["plan.stroke_speed_m_s"].as_float().unwrap();
        assert_eq!((values.len(), speed_m_s), (4, turned.plan.stroke_speed_m_s), "in m/s");
        assert_eq!(values["controller.kind"].as_str(), Some("lqr-integral"));
    }

    #[test]
    fn the_usual_knobs_fit_every_controller() {
        for &kind in ControllerKind::ALL {
            let mut scene = Scene::preset(Preset::Ae4832022);
            scene.controller.kind = kind;
            let knobs = Knob::usual(&scene);
            for fraction in [0.0, 0.5, 0.999] {
                turned(&scene, &knobs, &vec![fraction; knobs.len()]).unwrap();
            }
        }
    }

    #[test]
    fn a_usual_knob_has_an_effect_in_its_scene() {
        // The default drone's filter is an EKF, and that of the team's drone has constant gain.
        let [default, team] = [Preset::default(), Preset::Ae4832022].map(|preset| {
            let knobs = Knob::usual(&Scene::preset(preset));
            knobs.into_iter().flat_map(|knob| knob.keys).collect::<Vec<String>>()
        });
        assert!(!default.iter().any(|key| key.starts_with("observer.luenberger")));
        assert!(team.iter().any(|key| key.starts_with("observer.luenberger")));
        // A choice makes settings effective that only one of its values uses, such as the integral
        // weights of lqr-integral.
        assert!(team.iter().any(|key| key == "controller.lqr.q_integral[0]"));
        for &preset in Preset::ALL {
            for &kind in ControllerKind::ALL {
                let mut scene = Scene::preset(preset);
                scene.controller.kind = kind;
                assert_eq!(without_effect(&scene, &Knob::usual(&scene)), [], "{preset:?} {kind:?}");
            }
        }
    }

    #[test]
    fn broken_knobs_are_named() {
        for text in ["q", "a=1", "a=2..1", "a=-1..1", "a=0..1", "a=nan..1", "a*=x|y", "a=1..inf"] {
            assert!(text.parse::<Knob>().unwrap_err().to_string().contains(text), "{text}");
        }
        for (text, named) in [
            ("controller.lqr.q[12]=1..2", "controller.lqr.q[12]"),
            ("plan.style_x=1..2", "plan.style_x"),
            ("controller.kind=1..2", "controller.kind"),
            ("controller.kind=lqr|pud", "pud"),
            ("vehicle.mass_kg=1000..2000", "vehicle.mass_kg"),
        ] {
            let knob = text.parse::<Knob>().unwrap();
            let error = turned(&Scene::preset(Preset::Ae4832022), &[knob], &[0.5]).unwrap_err();
            assert!(error.to_string().contains(named), "{error}");
        }
    }
}
