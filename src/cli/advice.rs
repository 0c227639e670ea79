//! Advice on errors: the flags and keys that mend them. The library's errors name keys and facts;
//! only here are these joined with flags.

use clap::Command;

use crate::error::Error;
use crate::scene::Scene;
use crate::settings::{Described, Setting, Shape};

/// Flags and verbs that mend errors at some keys of the scene; a key ends with `.` for its group.
const FLAGS: [(&str, &str); 6] = [
    ("camera.position_m", "`--camera auto` puts the camera in front of the word"),
    ("letters.font", "`--font` names another font; `noctograph specimen FONT` shows one"),
    (
        "plan.drones",
        "`--drones N` sets the number of drones, `--style even` lets several share a word",
    ),
    ("plan.style", "`--style even` or `--style team` chooses it"),
    (
        "sensors.lighthouse.stations",
        "`--lighthouse FILE` reads the base stations from a file of cfclient",
    ),
    ("word", "name the word on the command line, as in `noctograph preview NOOR`"),
];

/// Flags and keys that mend an error of a verb.
pub(super) fn advice(error: &Error, verb: &Command) -> Vec<String> {
    let Error::Input { place, .. } = error else { return Vec::new() };
    let key = place.rsplit(": ").next().unwrap_or(place);
    let path = key.split(['[', ' ', ',']).next().unwrap_or(key);
    let mut advice: Vec<String> =
        FLAGS.iter().filter(|(key, _)| *key == path).map(|(_, text)| (*text).to_owned()).collect();
    if exists(path, Scene::SHAPE.settings()) {
        advice.push(format!(
            "`--set {path}=VALUE` sets the key for one run; `noctograph scene` prints all keys"
        ));
    } else if let Some(flag) = flag(path, verb) {
        advice.push(format!("`--{flag}` sets it"));
    }
    advice
}

/// Whether a scene has a key.
fn exists(path: &str, settings: &[Setting]) -> bool {
    let (key, rest) = path.split_once('.').unwrap_or((path, ""));
    let Some(setting) = settings.iter().find(|setting| setting.key == key) else { return false };
    match setting.shape {
        Shape::Group(settings) => exists(rest, settings),
        Shape::Tagged(variants) => {
            rest.is_empty() || variants.iter().any(|variant| exists(rest, variant.settings))
        }
        Shape::Plain | Shape::Names(_) => rest.is_empty(),
    }
}

/// The flag of an option such as `import.max_gap_s`: its name without the unit.
fn flag(path: &str, verb: &Command) -> Option<String> {
    let name = path.rsplit('.').next()?.replace('_', "-");
    let flags = || verb.get_arguments().filter_map(clap::Arg::get_long);
    let is_flag = |name: &str| flags().any(|flag| flag == name);
    let without_unit = name.rsplit_once('-').map(|(name, _unit)| name.to_owned());
    [Some(name), without_unit].into_iter().flatten().find(|name| is_flag(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(place: &str, verb: &str) -> String {
        let command = crate::cli::command();
        let error = Error::input(place, "x", "y", "z");
        advice(&error, command.find_subcommand(verb).unwrap()).join("; ")
    }

    #[test]
    fn an_error_leads_to_the_flag_or_the_key_that_mends_it() {
        assert!(at("my.toml:3: vehicle.mass_kg", "fly").contains("--set vehicle.mass_kg=VALUE"));
        assert!(at("controller.lqr.q[3]", "fly").contains("--set controller.lqr.q="));
        assert!(at("plan.style.jerk_m_s3", "fly").contains("--set plan.style.jerk_m_s3="));
        assert!(at("camera.position_m", "preview").contains("--camera auto"));
        assert_eq!(at("import.max_gap_s", "import"), "`--max-gap` sets it");
        assert_eq!(at("budget", "tune"), "`--budget` sets it");
        assert_eq!(at("plan.csv:7: x_m", "fly"), "");
        assert_eq!(at("my.toml:3: vehicle.mas_kg", "fly"), "");
    }
}
