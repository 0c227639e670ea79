//! Advice for the command line: flags that set a scene key, and flags that resolve an error. The
//! library reports keys and error codes, and only this file maps them to flags.

use clap::Command;

use super::outcome::typed_words;
use super::typefaces;
use crate::error::Error;
use crate::scene::Scene;
use noctograph_core::diagnostic::Change;
use noctograph_core::settings::{Described, paths};

/// Scene keys that have their own flag, each with the flag and the name of the flag's value.
const OF_KEYS: [(&str, &str, &str); 8] = [
    ("expose.room_m", "--room", "WxDxH"),
    ("letters.font", "--font", "NAME"),
    ("plan.drones", "--drones", "N"),
    ("plan.mean_error_m", "plan --after", "FLIGHT"),
    ("plan.style", "--style", "NAME"),
    ("preset", "--scene", "NAME"),
    ("sensors.lighthouse.stations", "--lighthouse", "FILE"),
    ("word", "--word", "WORD"),
];

/// Returns a change of the scene for use in a sentence, as a flag or as `key = value`.
pub(super) fn mentioned(change: &Change) -> String {
    match OF_KEYS.iter().find(|(key, ..)| *key == change.key) {
        Some((_, flag, takes)) => format!("{flag} {}", change.value.as_deref().unwrap_or(takes)),
        None => change.to_string(),
    }
}

/// Returns changes of the scene as the arguments that a user would type. A change of the width must
/// be followed by that of the height.
pub(super) fn typed(changes: &[Change]) -> String {
    // --size sets width and height together. Any other key is set by a separate flag or by --set.
    if let [Change { key, value: Some(width) }, height] = changes
        && key == "camera.width_px"
    {
        return format!("--size {width}x{}", height.value.as_deref().unwrap_or_default());
    }
    /// Returns one change as its flag, or as `--set KEY=VALUE`. A list is quoted for a shell.
    fn flag_or_setting(change: &Change) -> String {
        let (key, value) = (&*change.key, change.value.as_deref().unwrap_or_default());
        match (OF_KEYS.iter().find(|(known, ..)| *known == key), value) {
            (Some((_, flag, _)), value) => format!("{flag} {value}"),
            (None, "word") if key == "camera.framing" => "--camera auto".to_owned(),
            (None, value) if value.contains('[') => format!("--set {key}='{value}'"),
            (None, value) => format!("--set {key}={value}"),
        }
    }
    changes.iter().map(flag_or_setting).collect::<Vec<_>>().join(" ")
}

/// Flags that resolve an error, each with the error's code or key, and the flag's effect.
const FLAGS: [(&str, &str, &str); 19] = [
    (
        "letter-missing",
        "font",
        "selects another font: simplex, or a file *.ttf, *.otf or *.strokes",
    ),
    ("word-unseen", "corners", "gives the corners of the line instead of a camera"),
    ("axes-unknown", "axes", "sets the world axes of the log"),
    ("camera.framing.position_m", "camera auto", "places the camera in front of the word"),
    (
        "camera.framing.position_m",
        "set camera.framing.position_m=[X,Y,Z]",
        "places a fixed camera, with Y below 0",
    ),
    ("part-empty", "part", "selects the part to compare: letters, airborne or all"),
    ("clocks-apart", "offset", "sets B's clock"),
    ("letters.drawing", "trust", "opens the file"),
    ("letters.font", "font", "selects another font"),
    ("letters.font", "trust", "opens the file"),
    ("lights-missing", "word", "infers the lights and letters from a log's setpoints"),
    ("lights-missing", "lit", "shows a log's lamps lit from take-off to landing"),
    ("plan.drones", "drones", "sets the number of drones"),
    ("plan.drones", "style even", "lets several drones share a word"),
    ("plan.style", "style", "sets the flight style"),
    ("sensors.lighthouse.stations", "lighthouse", "reads the base stations from cfclient's file"),
    ("word-or-file", "drawing", "flies a picture, or strokes in JSON, in place of a word"),
    ("word-or-file", "scene", "uses the scene of a file or a folder"),
    (
        "times-missing",
        "period",
        "sets the time in seconds between the rows of a table without times",
    ),
];

/// Returns a sentence for each flag of the verb that may resolve the error. The flags depend on the
/// error's code and on the key that it concerns.
pub(super) fn advice(error: &Error, verb: &Command) -> Vec<String> {
    let (code, path) = match error {
        Error::Input { place, .. } => (error.code(), place.key()),
        _ => (error.code(), ""),
    };
    let has = |typed: &str| {
        let name = typed.split(' ').next();
        verb.get_arguments().any(|flag| flag.get_long() == name)
    };
    // Special flags come before the flag that sets the key. A flag that the user already typed is
    // left out, because it did not help.
    let special = FLAGS
        .iter()
        .filter(|(name, flag, _)| [code, path].contains(name) && has(flag) && !is_typed(flag));
    let mut advice: Vec<String> =
        special.map(|(_, flag, effect)| format!("`--{flag}` {effect}")).collect();
    if let Error::Letter { letter, .. } = error
        && has("fallback")
        && let Some(file) = typefaces::with(&[*letter])
    {
        advice.push(format!("`--fallback {}` has {letter}", file.display()));
    }
    // --set sets any scene key. An option of the verb has a flag with the option's name.
    if paths(Scene::SHAPE.settings()).contains(path) && has("set") {
        advice.push(format!(
            "`--set {path}=VALUE` sets the key for one run; `noctograph scene` prints all keys"
        ));
    } else if let Some(flag) = flag(path, verb) {
        advice.push(format!("`--{flag}` sets it"));
    }
    advice
}

/// Returns true if a flag was typed. `flag` may be followed by a value, which is ignored.
fn is_typed(flag: &str) -> bool {
    let flag = format!("--{}", flag.split(' ').next().unwrap_or_default());
    typed_words().any(|word| word == flag || word.starts_with(&format!("{flag}=")))
}

/// Returns the flag for an option such as `import.max_gap_s`, which is `max-gap-s` or, without the
/// unit, `max-gap`.
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
    use noctograph_core::diagnostic::Help;

    #[test]
    fn advice_names_keys_and_values_that_a_scene_takes() {
        let sources = [
            include_str!("../pipeline/preflight/flown.rs"),
            include_str!("../pipeline/preflight/mod.rs"),
            include_str!("../pipeline/shoot/problems.rs"),
        ];
        let texts = sources.iter().flat_map(|source| source.split('"'));
        let changes = texts.filter(|text| text.contains('.')).flat_map(|text| {
            let changes = Help::from(text).changes().cloned().collect::<Vec<_>>();
            changes.into_iter().filter(|change| change.key.starts_with(char::is_alphabetic))
        });
        let changes: Vec<Change> = changes
            .filter(|it| it.key.contains('.') && !it.key.contains([':', ' ', '(']))
            .collect();
        for change in &changes {
            assert!(paths(Scene::SHAPE.settings()).contains(&*change.key), "{change}");
            // These settings select a style and a deck with keys that the default ones lack.
            let settings = [("plan.style", "even"), ("light.deck", "led-ring")];
            let value = change.value.as_deref().map(|value| (&*change.key, value));
            let settings: Vec<_> = settings.into_iter().chain(value).collect();
            assert!(Scene::parse_with("", "scene", &settings).is_ok(), "{change}");
        }
        assert!(changes.len() >= 40, "{}", changes.len());
    }

    #[test]
    fn changes_are_typed_as_flags_or_settings() {
        let new = Change::new;
        let changes = [new("plan.style", "even"), new("camera.framing", "word"), new("seed", "3")];
        assert_eq!(typed(&changes), "--style even --camera auto --set seed=3");
        let lights = new("plan.lights", "[\"ring\"]");
        assert_eq!(typed(std::slice::from_ref(&lights)), "--set plan.lights='[\"ring\"]'");
        assert_eq!(mentioned(&lights), "plan.lights = [\"ring\"]");
        assert_eq!(mentioned(&Change { key: "word".into(), value: None }), "--word WORD");
    }

    fn advice_for(error: &Error, verb: &str) -> String {
        advice(error, crate::cli::command().find_subcommand(verb).unwrap()).join("; ")
    }

    fn advice_at(place: &str, verb: &str) -> String {
        advice_for(&Error::input(place, "x", "y", "z"), verb)
    }

    #[test]
    fn an_error_leads_to_the_flag_or_the_key_that_mends_it() {
        let in_file = Error::input("vehicle.mass_kg", "x", "y", "z").in_file("my.toml", 3);
        assert!(advice_for(&in_file, "fly").contains("--set vehicle.mass_kg=VALUE"));
        let item = Error::input("", "x", "y", "z").of_item("controller.lqr.q", 3);
        assert!(advice_for(&item, "fly").contains("--set controller.lqr.q="));
        assert!(advice_at("plan.style.jerk_m_s3", "fly").contains("--set plan.style.jerk_m_s3="));
        assert!(advice_at("camera.framing.position_m", "preview").contains("`--camera auto`"));
        let advice_of = |code: &'static str, verb: &str| {
            advice_for(&Error::input("", "x", "y", "z").coded(code), verb)
        };
        assert!(advice_of("clocks-apart", "compare").contains("--offset"));
        assert!(
            advice_of("part-empty", "compare").contains("--part")
                && advice_of("part-empty", "identify").is_empty()
        );
        assert!(advice_of("lights-missing", "expose").starts_with("`--word` infers the lights"));
        assert_eq!(advice_at("import.max_gap_s", "import"), "`--max-gap` sets it");
        assert_eq!(advice_at("budget", "tune"), "`--budget` sets it");
        let [wanted, hint] = ["", ""].map(str::to_owned);
        let lacks = Error::Letter { position: 3, letter: '\u{10ffff}', wanted, hint };
        assert!(advice_for(&lacks, "preview").starts_with("`--font` selects another font"));
        assert_eq!(advice_at("plan.csv:7: x_m", "fly") + &advice_for(&lacks, "fly"), "");
        assert_eq!(advice_at("my.toml:3: vehicle.mas_kg", "fly"), "");
    }
}
