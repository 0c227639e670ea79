//! Finds the logs of an evening among files and folders, and the drone of each log.

use std::path::{Path, PathBuf};

use super::{LIMIT, bullet_folder, cfclient_csv};
use noctograph_core::error::{Error, Result};
use noctograph_core::files::{Head, Text, ending, entries_in, file_name};

/// Maximum number of logs of an evening.
const MAX_LOGS: usize = 2000;
/// Maximum depth of searched folders: a drone's, an evening's and cfclient's.
const DEPTH: usize = 4;
/// Extensions of files that are not logs.
const OTHERS: [&str; 13] =
    ["html", "toml", "md", "yaml", "yml", "png", "jpg", "jpeg", "svg", "pdf", "mp4", "mov", "zip"];
/// Number of bytes at the start of a file that include its first line.
const HEAD_BYTES: usize = 1 << 16;

/// A log in an evening's folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GatheredLog {
    /// Path of a file, or of a folder that is a single log.
    pub path: PathBuf,
    /// Name of the drone: the serial number or, without one, the address that an exported script
    /// writes to its log. For other logs it is the name of the folder, or the file name up to the
    /// first `-`, `_`, `.` or space.
    pub drone: String,
    /// Path relative to the evening's folder.
    pub name: String,
}

/// True if a folder is a single log, because it contains the files of one cfclient connection or of
/// gym-pybullet-drones.
///
/// # Errors
///
/// Returns [`Error::Io`] if the folder cannot be read.
pub fn is_one_log(folder: &Path) -> Result<bool> {
    Ok(bullet_folder::variables(folder)?.is_some()
        || entries_in(folder)?.iter().any(|path| {
            // An unreadable file is ignored here, and is reported when it is imported.
            cfclient_csv::may_be_cfclient(path)
                && path.is_file()
                && LIMIT.beginning(path, HEAD_BYTES).is_ok_and(|head| {
                    cfclient_csv::is_cfclient(&Head::find(&Text::decode(&head).bytes))
                })
        }))
}

/// Returns the logs in a folder and its subfolders, sorted by name, which is assumed to be the
/// order of the flights. Also returns the names of other files, such as hidden files and pictures.
///
/// # Errors
///
/// Returns [`Error::Io`] for an unreadable folder, and [`Error::Input`] for no log or too many.
pub fn logs_in(folder: &Path) -> Result<(Vec<GatheredLog>, Vec<String>)> {
    let (mut logs, mut others) = (Vec::new(), Vec::new());
    let (mut folders, mut too_deep) = (vec![(folder.to_owned(), 0)], Vec::new());
    while let Some((inside, depth)) = folders.pop() {
        for path in entries_in(&inside)? {
            // A folder that is a single log is not searched.
            let is_hidden = file_name(&path).starts_with('.');
            let is_other = path.is_file() && OTHERS.contains(&&*ending(&path));
            if is_hidden || is_other || is_kept_whole(&path) {
                others.push(path);
            } else if path.is_dir() && !is_one_log(&path)? {
                let list = if depth < DEPTH { &mut folders } else { &mut too_deep };
                list.push((path, depth + 1));
            } else if path.is_dir() || path.is_file() {
                logs.push(path);
            } else {
                others.push(path);
            }
        }
    }
    others.extend(too_deep.into_iter().map(|(path, _)| path));
    if logs.is_empty() || logs.len() > MAX_LOGS {
        let (count, wanted) = (format!("{} logs", logs.len()), format!("1 to {MAX_LOGS}"));
        let hint = "name a folder with a log (or a cfclient folder) for each flight";
        return Err(Error::input(folder.display(), count, wanted, hint));
    }
    logs.sort();
    others.sort();
    let within = |path: &PathBuf| path.strip_prefix(folder).unwrap_or(path).display().to_string();
    let others = others.iter().map(within).collect();
    Ok((logs.into_iter().map(|path| GatheredLog::new(path, folder)).collect(), others))
}

/// Returns true for a line-by-line log (`NAME.jsonl`) of a flight for which the script also wrote a
/// complete log (`NAME.json`).
fn is_kept_whole(path: &Path) -> bool {
    let whole = path.with_extension("json");
    ending(path) == "jsonl" && whole.is_file() && is_of_script(path) && is_of_script(&whole)
}

/// Returns true for a log of an exported script.
fn is_of_script(path: &Path) -> bool {
    LIMIT.beginning(path, HEAD_BYTES).is_ok_and(|head| script_entry(&head).is_some())
}

impl GatheredLog {
    /// Determines a log's drone and its path within the folder. The drone is the one that the log
    /// names, otherwise the subfolder, otherwise the first word of the file's name.
    fn new(path: PathBuf, folder: &Path) -> Self {
        let within = path.strip_prefix(folder).unwrap_or(&path).to_owned();
        let mut parts = within.iter().map(|part| part.to_string_lossy().into_owned());
        let first = parts.next().unwrap_or_default();
        let drone = match (named_drone(&path), parts.next()) {
            (Some(drone), _) => drone,
            (None, Some(_)) => first,
            (None, None) => first.split(['-', '_', '.', ' ']).next().unwrap_or_default().to_owned(),
        };
        Self { path, drone, name: within.display().to_string() }
    }
}

/// Returns the serial number or the address of the drone that a script wrote to its log, or `None`
/// for other logs.
fn named_drone(path: &Path) -> Option<String> {
    let about = script_entry(&LIMIT.beginning(path, HEAD_BYTES).ok()?)?;
    let [serial, uri] =
        ["serial", "uri"].map(|key| about.get(key).and_then(serde_json::Value::as_str));
    serial.map(str::to_owned).or_else(|| uri.map(address))
}

/// Returns the scene (TOML) that an exported script wrote to its log, or `None` for other logs.
pub fn scene_in(log: &Path) -> Option<String> {
    let head = LIMIT.beginning(log, HEAD_BYTES).ok()?;
    let is_json = Text::of_unicode(&head).trim_ascii_start().starts_with(b"{");
    let about = is_json.then(|| script_entry(&LIMIT.read(log).ok()?)).flatten()?;
    Some(about.get("scene")?.as_str()?.to_owned())
}

/// Returns the word that an exported script wrote at the start of its log.
pub fn word_in(log: &Path) -> Option<String> {
    let about = script_entry(&LIMIT.beginning(log, HEAD_BYTES).ok()?)?;
    Some(about.get("word")?.as_str()?.to_owned())
}

/// Returns the entry `noctograph` that an exported script wrote to its log. The entry is usually at
/// the start, but another program may have rewritten the log. Returns `None` for other logs.
fn script_entry(log: &[u8]) -> Option<serde_json::Value> {
    const KEY: &[u8] = b"\"noctograph\"";
    let text = Text::of_unicode(log);
    let members = text.trim_ascii_start().strip_prefix(b"{")?;
    let mut after_key = (0..members.len()).filter_map(|place| members[place..].strip_prefix(KEY));
    let about = after_key.find_map(|value| value.trim_ascii_start().strip_prefix(b":"))?;
    let mut values = serde_json::Deserializer::from_slice(about).into_iter::<serde_json::Value>();
    values.next()?.ok()
}

/// Default address of a drone.
const DEFAULT_ADDRESS: &str = "E7E7E7E7E7";

/// Returns the address in a link's URI, which is `radio://dongle/channel/rate/address` for a radio.
/// A missing address is the default address, as in cflib. The default address is preceded by the
/// radio channel, so that drones remain distinguishable.
fn address(uri: &str) -> String {
    let link = uri.split('?').next().unwrap_or_default();
    let parts: Vec<&str> =
        link.split_once("://").map_or(link, |(_, rest)| rest).split('/').collect();
    match parts[..] {
        [_, channel, _] | [_, channel, _, DEFAULT_ADDRESS] => {
            format!("{channel}/{DEFAULT_ADDRESS}")
        }
        [.., last] => last.to_owned(),
        [] => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_are_told_apart_by_folder_or_name_and_what_is_none_is_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let cfclient = "Timestamp,stateEstimate.x,stateEstimate.y,stateEstimate.z\n0,1,2,3\n";
        for (name, text) in [
            ("NOOR_flight.json", r#"{"noctograph": {"word": "NO", "serial": "1a2b"}, "stateEst"#),
            ("NOOR_flight.jsonl", "{\"noctograph\": {\"word\": \"NO\", \"serial\": \"1a2b\"}}\n"),
            ("NOOR_flight-2.jsonl", "{\"noctograph\": {\"word\": \"NO\", \"serial\": \"1a2b\"}}\n"),
            ("cf2-1.csv", "t,x,y,z\n"),
            ("cf10/log01", "\u{bc}"),
            ("cf10/20260101T19-00-00/Stabilizer.csv", cfclient),
            ("cf10/20260101T19-00-00/Motors.csv", cfclient),
            ("evening.html", "<"),
            (".hidden.csv", "t"),
            ("photo.PNG", ""),
        ] {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let (logs, others) = logs_in(folder.path()).unwrap();
        let named: Vec<[&str; 2]> = logs.iter().map(|log| [&*log.drone, &*log.name]).collect();
        let wanted = [
            ["1a2b", "NOOR_flight-2.jsonl"],
            ["1a2b", "NOOR_flight.json"],
            ["cf10", "cf10/20260101T19-00-00"],
            ["cf10", "cf10/log01"],
            ["cf2", "cf2-1.csv"],
        ];
        assert_eq!(named, wanted);
        assert_eq!(others, [".hidden.csv", "NOOR_flight.jsonl", "evening.html", "photo.PNG"]);
        assert!(!is_one_log(folder.path()).unwrap());
        assert!(is_one_log(&folder.path().join("cf10/20260101T19-00-00")).unwrap());
        fn about(uri: &str) -> String {
            format!(
                "{{\"noctograph\": {{\"word\": \"NO\", \"uri\": \"{uri}\"}}, \"stateEstimate.x\": {{}}}}"
            )
        }
        let evening = tempfile::tempdir().unwrap();
        for (name, uri) in [
            ("NO-1.json", "radio://0/80/2M/E7E7E7E701"),
            ("NO-2.json", "radio://0/80/2M/E7E7E7E702"),
            ("NO-3.json", "radio://0/80/2M/E7E7E7E7E7"),
            ("NO-4.json", "radio://0/90/2M/E7E7E7E7E7"),
            ("other/NO-5.json", "radio://0/80/2M/E7E7E7E701?rate_limit=100"),
            ("other/NO-6.json", "radio://0/70/2M"),
        ] {
            let path = evening.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, about(uri)).unwrap();
        }
        let drones: Vec<String> =
            logs_in(evening.path()).unwrap().0.into_iter().map(|log| log.drone).collect();
        assert_eq!(
            drones,
            [
                "E7E7E7E701",
                "E7E7E7E702",
                "80/E7E7E7E7E7",
                "90/E7E7E7E7E7",
                "E7E7E7E701",
                "70/E7E7E7E7E7"
            ]
        );
        let empty = tempfile::tempdir().unwrap();
        assert!(logs_in(empty.path()).unwrap_err().to_string().contains("found 0 logs"));
    }
}
