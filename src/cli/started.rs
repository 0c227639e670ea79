//! Records whether this process was started as the program or by the Python package.

use std::ffi::OsString;
use std::process::Command;
use std::sync::OnceLock;

static PROGRAM: OnceLock<Vec<OsString>> = OnceLock::new();
static WORDS: OnceLock<Vec<OsString>> = OnceLock::new();

/// Sets the command that starts this program again, if this process runs an interpreter with
/// arguments instead of the program's executable.
pub fn starts_as(program: Vec<OsString>) {
    let _ = PROGRAM.set(program);
}

/// Sets the arguments that were typed, if they differ from those of this process.
pub fn typed_as(words: Vec<OsString>) {
    let _ = WORDS.set(words);
}

/// Returns the command that starts this program again, without arguments.
pub(super) fn program() -> std::io::Result<Command> {
    let Some([program, arguments @ ..]) = PROGRAM.get().map(Vec::as_slice) else {
        return std::env::current_exe().map(Command::new);
    };
    let mut command = Command::new(program);
    command.args(arguments);
    Ok(command)
}

/// Returns the arguments that were typed.
pub(super) fn words() -> Vec<OsString> {
    WORDS.get().cloned().unwrap_or_else(|| std::env::args_os().skip(1).collect())
}
