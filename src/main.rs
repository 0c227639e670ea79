//! The `noctograph` command.
#![expect(unsafe_code, reason = "setting an environment variable, see below")]

use std::process::ExitCode;

use noctograph::cli;

fn main() -> ExitCode {
    if std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // Without that folder Mesa's device-select layer prints an error for each look at the
        // graphics devices; this switches the layer off.
        //
        // SAFETY: no other thread runs yet that could read the environment meanwhile.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
    // The stack of the main thread may be too small to parse the arguments (`ulimit -s`).
    match std::thread::Builder::new().stack_size(cli::STACK).spawn(cli::main) {
        Ok(main) => main.join().unwrap_or(ExitCode::from(101)),
        Err(_) => cli::main(),
    }
}
