//! Sets `NOCTOGRAPH_COMMIT` to the commit that the program is built from, which comes from the
//! environment or from the clone, and is empty if neither is known.

use std::path::Path;
use std::process::Command;

/// Number of hexadecimal digits to show of the commit.
const DIGITS: usize = 12;

/// Sets `NOCTOGRAPH_COMMIT` for the compiler to the first [`DIGITS`] digits of the commit, from the
/// environment or from git, or to an empty text.
fn main() {
    println!("cargo::rerun-if-env-changed=NOCTOGRAPH_COMMIT");
    // Without this check, git would report the commit of another project if a source archive was
    // unpacked inside that project's clone.
    if Path::new(".git").exists() {
        for name in ["HEAD", "logs/HEAD"] {
            if let Some(path) = git(&["rev-parse", "--git-path", name]) {
                println!("cargo::rerun-if-changed={path}");
            }
        }
    }
    let named = std::env::var("NOCTOGRAPH_COMMIT").ok();
    let commit =
        named.or_else(|| git(&["rev-parse", "HEAD"]).filter(|_| Path::new(".git").exists()));
    let digits: String = commit.iter().flat_map(|commit| commit.chars()).take(DIGITS).collect();
    println!("cargo::rustc-env=NOCTOGRAPH_COMMIT={digits}");
}

/// Returns the output of a git command, if git is installed and succeeds.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
