//! Messages to visitors as data. A message consists of a key with its values, for which the page
//! contains a sentence in the visitor's language, and an English sentence for a page that lacks the
//! key. Messages contain no paths of this machine.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use noctograph_core::diagnostic::{Change, Diagnostic};
use noctograph_core::error::{Error, Place, Segment};

/// A message to a visitor.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Message {
    /// Key of the sentence, such as `word-long`.
    pub key: String,
    /// Values in the sentence. Their names end in their units.
    pub values: Value,
    /// An English sentence, for a page that lacks the key.
    pub text: String,
    /// Advice in English, or empty.
    pub hint: String,
}

/// Declares the keys of refusals, each with its name, HTTP status, English sentence and hint.
macro_rules! keys {
    ($($key:ident $name:literal $status:literal $text:literal $hint:literal;)+) => {
        /// Reasons for a refusal.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Key { $(#[doc = $text] $key,)+ }

        impl Key {
            /// All keys in the order of declaration.
            pub const ALL: &[Self] = &[$(Self::$key,)+];

            /// Returns the key's name, such as `word-long`.
            pub fn name(self) -> &'static str {
                match self { $(Self::$key => $name,)+ }
            }

            /// Returns the HTTP status of the refusal.
            pub fn status(self) -> u16 {
                match self { $(Self::$key => $status,)+ }
            }

            /// Returns the English sentence and the hint.
            fn sentences(self) -> [&'static str; 2] {
                match self { $(Self::$key => [$text, $hint],)+ }
            }
        }
    };
}

keys! {
    PageOld "page-old" 400 "the page sent an outdated request" "reload the page";
    WordLong "word-long" 422 "the word is too long" "write a shorter word";
    WordEmpty "word-empty" 422 "there is no word" "type or draw something";
    LetterMissing "letter-missing" 422 "a letter cannot be written" "use another letter";
    LettersMany "letters-many" 422 "too many connected letters follow each other" "write fewer";
    DrawingEmpty "drawing-empty" 422 "the drawing has no lines to follow" "draw a line";
    DrawingBroken "drawing-broken" 422 "the drawing cannot be read" "use a plain SVG or JPEG";
    DrawingText "drawing-text" 422 "the drawing contains text" "convert the text to paths";
    DrawingLarge "drawing-large" 422 "the drawing has too many strokes" "draw a simpler one";
    PictureNone "picture-none" 422 "no lines were found in the picture" "choose a picture of lines on paper";
    FlightLong "flight-long" 422 "the flight would take too long" "write or draw less";
    FlightImpossible "flight-impossible" 422 "this cannot be flown" "change something and try again";
    TooSlow "too-slow" 422 "making the photo took too long" "write or draw less";
    TooLarge "too-large" 422 "making the photo took too much memory" "write or draw less";
    NotSafe "not-safe" 409 "the flight is not safe" "change what the report names";
    NotPossible "not-possible" 422 "this is not possible" "change something and try again";
    Broken "broken" 500 "the program failed" "change something and try again";
    Busy "busy" 503 "many visitors are waiting" "try again";
    Closed "gone" 404 "this is no longer stored" "take the photo again";
    DiskFull "disk-full" 507 "a file could not be saved" "ask the host: the disk may be full";
    NotRemoved "not-removed" 500 "the entry could not be removed" "ask the host to remove it";
    EntriesMany "entries-many" 429 "too many entries were sent from here at once" "try again in a moment";
    QueueFull "queue-full" 503 "the queue is full" "come again later";
    Paused "paused" 503 "no entries are accepted at the moment" "try again later";
    NotHere "not-here" 403 "this is available only on the host's machine" "ask the host";
    Conflict "conflict" 409 "another operator has already changed this entry" "look again";
}

/// A result, or the key of a refusal.
pub type KeyResult<T> = Result<T, Key>;

/// Keys of the checks that stop a flight.
const STOPS: &str = "stop-acceleration stop-altitude-hold stop-baseline stop-battery stop-camera \
    stop-corridor stop-coverage stop-doubled-stroke stop-estimator stop-evenness stop-flight \
    stop-flight-time stop-frame stop-headlights stop-jump stop-landing stop-led-memory \
    stop-light-never-off stop-lit-dwell stop-lit-transit stop-lost-stroke stop-memory \
    stop-motors stop-obstacles stop-pen-jump stop-people stop-picture stop-separation \
    stop-speed stop-sunlight stop-tail stop-thrust stop-tilt stop-volume stop-wake stop-weight \
    stop-wind stop-other";

/// Keys of advice. Each is named after the first setting that a remedy changes.
const ADVICE: &str = "set-camera.focus_m set-camera.framing set-camera.metering set-camera.shutter_open_s \
    set-camera.width_px set-controller.kind set-letters.cap_height_m set-letters.font \
    set-letters.spacing_m set-light.led_bitmask set-light.ring set-photo.ambient_cd_m2 \
    set-plan.light_clock set-plan.lights set-plan.reference set-plan.stroke_speed_m_s \
    set-plan.style set-other";

/// Returns the key if it is in the list `keys`, separated by spaces, or else the list's last key,
/// which stands for all unlisted keys.
fn key_or_last(keys: &str, key: &str) -> String {
    let listed = keys.split(' ').find(|listed| *listed == key);
    listed.or(keys.split(' ').next_back()).unwrap_or_default().to_owned()
}

/// Returns the page's code for a diagnostic's code. The page uses a single sentence for all missing
/// parts of drawings.
pub fn code_on_page(code: &str) -> &str {
    let is_about_drawing = code.starts_with("drawing-") || code.starts_with("picture-");
    if is_about_drawing && code != "picture-photo" { "drawing-part" } else { code }
}

impl Message {
    /// Creates a refusal with the given values, English text and hint.
    pub fn new(key: Key, values: Value, text: String, hint: &str) -> Self {
        Self { key: key.name().into(), values, text, hint: hint.into() }
    }

    /// Returns the message about a request that no page of this program sends.
    pub fn of_old_page(actual: &str) -> Self {
        let text = format!("{}: {actual}", Key::PageOld.sentences()[0]);
        Self { text, ..Key::PageOld.into() }
    }

    /// Returns the message that a flight is not safe, which lists the checks that stop it.
    pub fn of_stops(stops: &[Self]) -> Self {
        let key = Key::NotSafe;
        let texts: Vec<&str> = stops.iter().map(|stop| &*stop.text).collect();
        let text = format!("{}: {}", key.sentences()[0], texts.join("; "));
        Self { text, ..Self::from(key).with_values(json!({ "stops": stops })) }
    }

    /// Returns the message about an error of a stage. `is_picture` is true if the subject is a
    /// picture.
    pub fn of_error(error: &Error, is_picture: bool) -> Self {
        let key = key_of(error, is_picture);
        let values = match error {
            Error::Letter { position, letter, .. } => {
                json!({ "letter": letter, "position": position })
            }
            // The page names the setting, whose allowed values may differ between versions.
            Error::Input { place, .. } if key == Key::NotPossible => {
                json!({ "setting": dotted(place) })
            }
            _ => json!({}),
        };
        Self::new(key, values, without_paths(&error.to_string()), &without_paths(error.hint()))
    }

    /// Returns a message about an error of a log. The message is always in English, because it
    /// names parts of the log. The hint is part of the text.
    pub fn of_log_error(error: &Error) -> Self {
        let text = format!("{error}: {}", error.hint());
        let (text, hint) = (without_paths(&text), String::new());
        Self { key: "log".into(), values: json!({}), text, hint }
    }

    /// Returns the message about a problem of the picture or about a warning.
    pub fn of_diagnostic(diagnostic: &Diagnostic) -> Self {
        let values = json!(diagnostic.figures);
        let text = without_paths(&diagnostic.sentence(Change::to_string));
        Self { key: code_on_page(diagnostic.code).into(), values, text, hint: String::new() }
    }

    /// Returns the message about a check that stops a flight, or `None` if the check does not stop
    /// it.
    pub fn of_stop(check: &Diagnostic) -> Option<Self> {
        if !check.is_stop() {
            return None;
        }
        let key =
            key_or_last(STOPS, &format!("stop-{}", check.code.replace(' ', "-").to_lowercase()));
        let mut values = json!(check.figures);
        if let Some(Segment::Drone(drone)) = check.place.0.first() {
            values["drone"] = json!(drone);
        }
        let text = format!("{}: {check}", check.code);
        Some(Self { key, values, text, hint: check.change(Change::to_string) })
    }

    /// Returns the message that suggests changes, with the key of the first change, or `None` if
    /// there are no changes.
    pub fn of_changes(changes: &[Change]) -> Option<Self> {
        let first = changes.first()?;
        let key = key_or_last(ADVICE, &format!("set-{}", first.key));
        let text = changes.iter().map(Change::to_string).collect::<Vec<_>>().join(", ");
        Some(Self { key, values: json!({ "value": first.value }), text, hint: String::new() })
    }

    /// Returns the message with its values replaced.
    #[must_use]
    pub fn with_values(self, values: Value) -> Self {
        Self { values, ..self }
    }

    /// Returns the message as the JSON of a refusal.
    pub fn json(&self) -> Value {
        json!({ "error": self })
    }
}

impl From<Key> for Message {
    fn from(key: Key) -> Self {
        let [text, hint] = key.sentences();
        Self::new(key, json!({}), text.into(), hint)
    }
}

/// Returns the keys in an error's place in a file, joined by dots, such as `letters.font`. Indices
/// and names are left out.
fn dotted(place: &Place) -> String {
    let keys = place.0.iter().filter_map(|segment| match segment {
        Segment::Key(key) => Some(&**key),
        _ => None,
    });
    keys.collect::<Vec<_>>().join(".")
}

/// Returns the key for an error. It is named like the error's code, unless a more precise key
/// exists. `is_picture` is true if the subject is a picture.
fn key_of(error: &Error, is_picture: bool) -> Key {
    let Error::Input { place, .. } = error else {
        return match error.code() {
            "file" => Key::DiskFull,
            "infeasible" => Key::FlightImpossible,
            code => key_named(code).unwrap_or(Key::NotPossible),
        };
    };
    // The place of an error shows whether it concerns the drawing's file, the word or a setting.
    let is_file =
        |part: &Segment| matches!(part, Segment::File(name) if name.starts_with("drawing."));
    let is_drawing = place.key() == "drawing" || place.0.iter().any(is_file);
    match error.code() {
        "drawing-empty" if is_picture => Key::PictureNone,
        "input-large" if is_drawing => Key::DrawingLarge,
        "input" if is_drawing => Key::DrawingBroken,
        "input" if place.key() == "word" => Key::LettersMany,
        code => key_named(code).unwrap_or(Key::NotPossible),
    }
}

/// Returns the key with a name, or `None` if there is no such key.
fn key_named(name: &str) -> Option<Key> {
    Key::ALL.iter().copied().find(|key| key.name() == name)
}

/// Replaces the absolute paths in a message by their file names, because a visitor must not see the
/// server's folders. A path begins with a slash that does not follow a letter or a digit, as in
/// `1/2` or `m/s`.
fn without_paths(text: &str) -> String {
    let mut words = Vec::new();
    for word in text.split(' ') {
        let mut slashes = word.match_indices('/').map(|(begin, _)| begin);
        let begin = slashes.find(|begin| !word[..*begin].ends_with(char::is_alphanumeric));
        // Punctuation before and after the path stays.
        words.push(match begin {
            Some(begin) => word[..begin].to_owned() + word.rsplit('/').next().unwrap_or_default(),
            None => word.to_owned(),
        });
    }
    words.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::diagnostic::Severity;
    use noctograph_pipeline::shoot::problems::{FLAWS, OBSTACLES};

    #[test]
    fn names_of_files_stand_in_place_of_paths() {
        let text = "/tmp/.noctograph-x.tmp/job-1/drawing.svg:3: (`/tmp/a/b.png`) and 1/2 m/s";
        assert_eq!(without_paths(text), "drawing.svg:3: (`b.png`) and 1/2 m/s");
    }

    /// A new check must be added to `STOPS` or to the exceptions in this test.
    #[test]
    fn the_page_has_a_key_for_every_check_that_can_stop() {
        let never_stop = ["lamps", "room"];
        let page = include_str!("../../docs/reference/json.md");
        let rows = page.lines().skip_while(|line| *line != "| check | value | limit |").skip(2);
        let cells = rows.map_while(|line| line.strip_prefix("| ")?.split(" |").next());
        let checks: Vec<&str> = cells.flat_map(|cell| cell.split(", ")).collect();
        assert!(checks.len() > 25, "{checks:?}");
        for check in checks.into_iter().filter(|check| !never_stop.contains(check)) {
            let code = check.to_owned().leak();
            let key = Message::of_stop(&Diagnostic::new(code, Severity::Stop, "")).unwrap().key;
            assert_ne!(key, "stop-other", "{check} is not in STOPS");
        }
    }

    /// Each language of the page contains a sentence with the values of each key.
    #[test]
    fn the_page_words_every_key_in_every_language() {
        let errors: Vec<&str> = Key::ALL.iter().map(|key| key.name()).collect();
        let obstacles: Vec<&str> = OBSTACLES.into_iter().chain(FLAWS).collect();
        let reasons = "misread no-light not-in-photo other-length out-of-range too-small unsure";
        let reasons: Vec<_> = reasons.split(' ').collect();
        let keys = json!({
            "errors": errors, "obstacles": obstacles, "reasons": reasons,
            "advice": ADVICE.split(' ').collect::<Vec<_>>(),
            "stops": STOPS.split(' ').collect::<Vec<_>>(),
        });
        // keys.json lists the codes that tests/exhibit.py compares with the page's translations.
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../serve/page/keys.json");
        if crate::bless::is_blessed(file) {
            std::fs::write(file, format!("{keys:#}\n")).unwrap();
        }
        let known: Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
        assert_eq!(known, keys, "NOCTOGRAPH_BLESS=1 writes {file} anew");
        for name in ["de", "en", "es", "fr"] {
            let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../serve/page/words");
            let tables = ["", "-more"].map(|part| -> Value {
                let table = std::fs::read_to_string(format!("{folder}/{name}{part}.json"));
                serde_json::from_str(&table.unwrap()).unwrap()
            });
            for (group, keys) in keys.as_object().unwrap() {
                for key in keys.as_array().unwrap() {
                    let words = |table: &Value| {
                        table[group][key.as_str().unwrap()]
                            .as_str()
                            .is_some_and(|sentence| !sentence.is_empty())
                    };
                    assert!(tables.iter().any(words), "{name}: {group} {key}");
                }
            }
        }
    }
}
