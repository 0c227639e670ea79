//! The `noctograph` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    noctograph::cli::main()
}
