//! The commit that the program is built from, in `NOCTOGRAPH_COMMIT`: from the environment, else
//! from the clone, else empty.

use std::path::Path;
use std::process::Command;

/// Hexadecimal digits of the commit that the program shows.
const DIGITS: usize = 12;

fn main() {
    println!("cargo::rerun-if-env-changed=NOCTOGRAPH_COMMIT");
    // A source archive may have been unpacked in the clone of another project.
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
