//! Tests the graphics driver in a separate process, so that a driver that hangs or crashes does not
//! affect the program itself. The result is cached until the drivers change.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::terminal::message;
use crate::error::{Error, Result};
use crate::expose::BackendChoice;
use noctograph_core::digest::sha256;

/// Time after which the driver counts as hung. The time is long, because a software driver on a
/// busy machine may take several seconds to compile the shader.
const PATIENCE: Duration = Duration::from_secs(30);

/// Fault that is reported if no process can be started. Unlike a driver's fault, it is not cached.
const UNTRIED: &str = "cannot be tried in a separate process";

/// Arguments of the process that tests the driver.
const TRIAL: [&str; 2] = ["generate", "device"];

/// Environment variables that select the driver.
const VARIABLES: [&str; 5] = [
    "VK_DRIVER_FILES",
    "VK_ICD_FILENAMES",
    "VK_ADD_DRIVER_FILES",
    "VK_LOADER_DRIVERS_SELECT",
    "LD_LIBRARY_PATH",
];

/// Paths that change when a driver is installed. These are the folders of Vulkan's driver
/// manifests, and the file with the version of macOS, which includes the drivers.
const LISTS: [&str; 4] = [
    "/etc/vulkan/icd.d",
    "/usr/share/vulkan/icd.d",
    "/usr/local/share/vulkan/icd.d",
    "/System/Library/CoreServices/SystemVersion.plist",
];

/// Folder of installed drivers on Windows, below `SystemRoot`.
const DRIVER_STORE: &str = r"System32\DriverStore\FileRepository";

/// Returns the backend for the exposure. [`BackendChoice::Auto`] becomes the CPU, with a note, if
/// the graphics driver hangs or crashes. Tests the driver in a separate process unless the cache
/// contains a result, and caches the result.
///
/// # Errors
///
/// [`Error::Gpu`] if the graphics backend was requested by name and its driver hangs or crashes.
#[expect(clippy::disallowed_methods, reason = "a small file in this program's own folder")]
pub(super) fn tried(choice: BackendChoice) -> Result<BackendChoice> {
    if choice == BackendChoice::Cpu {
        return Ok(choice);
    }
    let cache = cache_file();
    let cached = cache.as_deref().and_then(|path| std::fs::read_to_string(path).ok());
    let fault = cached.map(|text| text.trim().to_owned()).unwrap_or_else(|| {
        let program = super::started::program();
        let fault = program.ok().and_then(|mut program| fault(program.args(TRIAL), PATIENCE));
        let fault = fault.unwrap_or_default();
        if let Some(path) = cache.as_ref().filter(|_| fault != UNTRIED) {
            // If the result cannot be cached, the driver is tested again in the next run.
            let _ = path.parent().map(std::fs::create_dir_all);
            let _ = std::fs::write(path, fault);
        }
        fault.to_owned()
    });
    // If the driver is faulty, `auto` selects the CPU, and `--backend wgpu` fails. A driver that
    // could not be tested is used only if it was requested by name.
    let is_requested = choice == BackendChoice::Wgpu;
    if fault.is_empty() || is_requested && fault == UNTRIED {
        return Ok(choice);
    }
    let again = cache
        .filter(|_| fault != UNTRIED)
        .map_or_else(String::new, |path| format!("; remove {} to try again", path.display()));
    if is_requested {
        let hint = format!("choose the CPU, which computes the same bits{again}");
        return Err(Error::Gpu { what: format!("its driver {fault}"), hint });
    }
    let text =
        format!("the graphics driver {fault}: the CPU computes the exposure, with the same bits");
    message("note: ", &(text + &again));
    Ok(BackendChoice::Cpu)
}

/// Runs the test process, and returns `crashes` or `hangs` if the driver does so, [`UNTRIED`] if
/// the process cannot be started, and `None` otherwise. A process that runs longer than `patience`
/// is killed. A missing driver and an error that the driver reports are no faults.
fn fault(trial: &mut Command, patience: Duration) -> Option<&'static str> {
    // The loop polls, because std cannot wait for a process with a time limit.
    let quiet = trial.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let Ok(mut child) = quiet.spawn() else { return Some(UNTRIED) };
    let begun = Instant::now();
    while begun.elapsed() < patience {
        match child.try_wait() {
            Ok(Some(status)) => return (!ended_by_itself(status.code())).then_some("crashes"),
            Ok(None) => std::thread::sleep(Duration::from_millis(2)),
            // A failure of the wait itself is not a fault of the driver.
            Err(_) => return None,
        }
    }
    let _ = child.kill();
    // The end is not awaited, because a process that hangs in the kernel may never end.
    let _ = child.try_wait();
    Some("hangs")
}

/// True if the test process ended with a report or an error message. A crash yields no exit code on
/// Unix, and a code such as -1073741819 on Windows. A panic yields the code 101.
fn ended_by_itself(code: Option<i32>) -> bool {
    matches!(code, Some(0 | 2))
}

/// Returns the user's cache folder on an operating system, from the environment variables that
/// `variable` returns, or `None` if these are not set.
fn cache_folder(system: &str, variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    if let Some(folder) = variable("XDG_CACHE_HOME") {
        return Some(folder.into());
    }
    match system {
        "windows" => variable("LOCALAPPDATA").map(PathBuf::from),
        "macos" => Some(Path::new(&variable("HOME")?).join("Library/Caches")),
        _ => Some(Path::new(&variable("HOME")?).join(".cache")),
    }
}

/// Returns the path of the file that stores the result for the installed drivers, or `None` if
/// there is no cache folder. Its name contains a digest of everything that changes when drivers
/// change.
#[expect(clippy::disallowed_methods, reason = "a file of the kernel")]
fn cache_file() -> Option<PathBuf> {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    let folder = cache_folder(std::env::consts::OS, variable)?;
    // The text to digest begins with what selects a driver: this program's version, the variables
    // and the kernel.
    let mut drivers = env!("CARGO_PKG_VERSION").to_owned();
    for name in VARIABLES {
        drivers += &format!("\n{name}={:?}", variable(name));
    }
    drivers += &std::fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    // The sizes and times of all driver lists follow, sorted because folders have no order.
    let store = variable("SystemRoot").map(|windows| Path::new(&windows).join(DRIVER_STORE));
    for place in LISTS.into_iter().map(PathBuf::from).chain(store) {
        let entries = std::fs::read_dir(&place).into_iter().flatten().flatten();
        let mut lists: Vec<String> = entries
            .map(|entry| entry.path())
            .chain([place])
            .filter_map(|path| path.metadata().ok().map(|list| (path, list)))
            .map(|(path, list)| format!("\n{path:?} {} {:?}", list.len(), list.modified().ok()))
            .collect();
        lists.sort();
        drivers.extend(lists);
    }
    // 64 bits of the digest are enough to distinguish states of the drivers.
    let key = &sha256(drivers.as_bytes())[..16];
    Some(folder.join("noctograph").join(format!("driver-{key}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crash_is_known_by_its_exit_code_on_each_system() {
        let crashes = [None, Some(-1_073_741_819), Some(-1_073_740_791), Some(3), Some(101)];
        assert!(!crashes.into_iter().any(ended_by_itself), "signal, Windows' faults, panic");
        assert!([Some(0), Some(2)].into_iter().all(ended_by_itself), "a driver, or its own error");
    }

    #[test]
    fn each_system_has_a_folder_that_remembers() {
        let windows = |name: &str| (name == "LOCALAPPDATA").then(|| "C:/Local".into());
        let unix = |name: &str| (name == "HOME").then(|| "/home/me".into());
        let named = |name: &str| Some(format!("/{name}").into());
        assert_eq!(cache_folder("windows", windows), Some("C:/Local".into()));
        assert_eq!(cache_folder("macos", unix), Some("/home/me/Library/Caches".into()));
        assert_eq!(cache_folder("linux", unix), Some("/home/me/.cache".into()));
        for system in ["windows", "macos", "linux"] {
            assert_eq!(cache_folder(system, named), Some("/XDG_CACHE_HOME".into()), "{system}");
        }
        assert_eq!(cache_folder("linux", windows), None);
    }

    #[cfg(unix)]
    #[test]
    fn a_driver_that_hangs_or_crashes_is_seen_and_one_that_is_missing_is_no_fault() {
        let shell =
            |script, s| fault(Command::new("sh").args(["-c", script]), Duration::from_secs(s));
        assert_eq!(shell("exit 0", 300), None);
        assert_eq!(shell("exit 2", 300), None, "no driver");
        assert_eq!(shell("kill -SEGV $$", 300), Some("crashes"));
        assert_eq!(shell("exit 101", 300), Some("crashes"), "a panic");
        assert_eq!(shell("exec sleep 600", 1), Some("hangs"));
    }

    #[test]
    fn the_processor_is_not_tried() {
        assert_eq!(tried(BackendChoice::Cpu).unwrap(), BackendChoice::Cpu);
    }
}
