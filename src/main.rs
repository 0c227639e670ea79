//! The `noctograph` command.
#![expect(unsafe_code, reason = "setting an environment variable, see below")]

use std::process::ExitCode;

use noctograph::cli;

fn main() -> ExitCode {
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // If `XDG_RUNTIME_DIR` is not set, Mesa's device-select layer prints an error for each
        // query of the graphics devices, so that the layer is disabled.
        //
        // SAFETY: no other thread is running that could read the environment.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
    cli::main().into()
}
