//! The `noctograph` command.
#![expect(unsafe_code, reason = "setting an environment variable, see below")]

use std::process::ExitCode;

use noctograph::cli;

/// Runs the command line. The exit status is that of [`cli::main`].
fn main() -> ExitCode {
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // Mesa's device-select layer is disabled, because it prints an error for each query of the
        // graphics devices if `XDG_RUNTIME_DIR` is not set.
        //
        // SAFETY: no other thread is running that could read the environment.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
    cli::main().into()
}
