//! The graphics driver, tried once in a process of its own: one that hangs or crashes must not take
//! the program with it. The result is remembered for this driver.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::{Error, Result, message};
use crate::expose::BackendChoice;
use noctograph_core::digest::sha256;

/// Time after which a driver counts as hanging. A software driver on a busy machine compiles the
/// shader in a few seconds.
const PATIENCE: Duration = Duration::from_secs(30);

/// The fault where no process can be started; it is not cached.
const UNTRIED: &str = "cannot be tried in a process of its own";

/// Arguments of the process that tries the driver.
const TRIAL: [&str; 2] = ["generate", "device"];

const VARIABLES: [&str; 5] = [
    "VK_DRIVER_FILES",
    "VK_ICD_FILENAMES",
    "VK_ADD_DRIVER_FILES",
    "VK_LOADER_DRIVERS_SELECT",
    "LD_LIBRARY_PATH",
];

/// Folders of the lists of drivers.
const FOLDERS: [&str; 3] =
    ["/etc/vulkan/icd.d", "/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"];

/// The backend to expose on: with [`BackendChoice::Auto`], the processor in place of a driver that
/// hangs or crashes.
///
/// # Errors
///
/// [`Error::Gpu`] where such a driver was chosen by name.
#[expect(clippy::disallowed_methods, reason = "what this program remembers in its own folder")]
pub(super) fn tried(choice: BackendChoice) -> Result<BackendChoice> {
    if choice == BackendChoice::Cpu {
        return Ok(choice);
    }
    let memory = memory();
    let known = memory.as_deref().and_then(|path| std::fs::read_to_string(path).ok());
    let fault = known.map(|text| text.trim().to_owned()).unwrap_or_else(|| {
        let program = std::env::current_exe();
        let fault = program.ok().and_then(|path| fault(Command::new(path).args(TRIAL), PATIENCE));
        let fault = fault.unwrap_or_default();
        if let Some(path) = memory.as_ref().filter(|_| fault != UNTRIED) {
            // Without a memory the next run tries again.
            let _ = path.parent().map(std::fs::create_dir_all);
            let _ = std::fs::write(path, fault);
        }
        fault.to_owned()
    });
    let is_chosen = choice == BackendChoice::Wgpu;
    if fault.is_empty() || is_chosen && fault == UNTRIED {
        return Ok(choice);
    }
    let again = memory
        .filter(|_| fault != UNTRIED)
        .map_or_else(String::new, |path| format!("; remove {} to try again", path.display()));
    if is_chosen {
        let hint = format!("choose the processor, which makes the same bits{again}");
        return Err(Error::Gpu { what: format!("its driver {fault}"), hint });
    }
    let text = format!("the graphics driver {fault}: the processor exposes, with the same bits");
    message("note: ", &(text + &again));
    Ok(BackendChoice::Cpu)
}

/// The fault of a driver, seen from another process; a missing driver, or one with its own error
/// message, is none.
fn fault(trial: &mut Command, patience: Duration) -> Option<&'static str> {
    let quiet = trial.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let Ok(mut child) = quiet.spawn() else { return Some(UNTRIED) };
    let begun = Instant::now();
    while begun.elapsed() < patience {
        match child.try_wait() {
            Ok(Some(status)) => return status.code().is_none().then_some("crashes"),
            Ok(None) => std::thread::sleep(Duration::from_millis(2)),
            Err(_) => return None,
        }
    }
    let _ = child.kill();
    // A process that hangs within the kernel may not end; it is left behind.
    let _ = child.try_wait();
    Some("hangs")
}

/// The file that remembers the result for the present drivers.
#[expect(clippy::disallowed_methods, reason = "a file of the kernel")]
fn memory() -> Option<PathBuf> {
    let variable = |name| std::env::var_os(name).filter(|value| !value.is_empty());
    let folder = variable("XDG_CACHE_HOME").map(PathBuf::from);
    let folder = folder.or_else(|| Some(Path::new(&variable("HOME")?).join(".cache")))?;
    let mut drivers = env!("CARGO_PKG_VERSION").to_owned();
    for name in VARIABLES {
        drivers += &format!("\n{name}={:?}", variable(name));
    }
    drivers += &std::fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    for folder in FOLDERS {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let mut lists: Vec<String> = entries
            .filter_map(|entry| Some((entry.path(), entry.metadata().ok()?)))
            .map(|(path, list)| format!("\n{path:?} {} {:?}", list.len(), list.modified().ok()))
            .collect();
        lists.sort();
        drivers.extend(lists);
    }
    let key = &sha256(drivers.as_bytes())[..16];
    Some(folder.join("noctograph").join(format!("driver-{key}")))
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_that_hangs_or_crashes_is_seen_and_one_that_is_missing_is_no_fault() {
        let shell =
            |script, s| fault(Command::new("sh").args(["-c", script]), Duration::from_secs(s));
        assert_eq!(shell("exit 0", 300), None);
        assert_eq!(shell("exit 2", 300), None, "no driver");
        assert_eq!(shell("kill -SEGV $$", 300), Some("crashes"));
        assert_eq!(shell("exec sleep 600", 1), Some("hangs"));
    }

    #[test]
    fn the_processor_is_not_tried() {
        assert_eq!(tried(BackendChoice::Cpu).unwrap(), BackendChoice::Cpu);
    }
}
