//! `noctograph generate` writes shell completions and man pages for packagers.

use std::path::PathBuf;

use clap::{Args, Command, Subcommand};
use clap_complete::Shell;

use super::outcome::Report;
use super::output::{Output, OutputFolder};
use crate::error::Result;
use serde_json::json;

#[derive(Debug, Args)]
pub(super) struct GenerateArgs {
    #[command(subcommand)]
    kind: Kind,
}

#[derive(Debug, Subcommand)]
enum Kind {
    /// Print a completion script
    Completions {
        /// Shell for which the script is made
        shell: Shell,
        /// File to write, instead of printing it
        #[arg(short, long, value_name = "FILE")]
        output: Option<PathBuf>,
    },
    /// Open the graphics device and run the shader once
    #[command(hide = true)]
    Device,
    /// Write man pages, one for each verb
    Man {
        /// Folder for the man pages
        #[arg(short, long, value_name = "DIR", default_value = "man")]
        output: PathBuf,
    },
}

/// Runs the verb `generate`, which prints or writes the completions of a shell, or writes manual
/// pages. Its hidden kind `device` tests the graphics device, for `device.rs`.
pub(super) fn run(args: &GenerateArgs) -> Result<Report> {
    let mut command = super::command();
    match &args.kind {
        Kind::Completions { shell, output } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut command, "noctograph", &mut script);
            let script = String::from_utf8(script).expect("scripts are text");
            let Some(path) = output else {
                return Ok(Report::new(script.clone(), json!({ "script": script })));
            };
            let file = Output::create(path)?.keep(script)?;
            Ok(Report::with_layout(json!({}), "").with_files(&[file]))
        }
        Kind::Device => {
            let adapter = crate::expose::try_device()?;
            Ok(Report::new(format!("{adapter}\n"), json!({ "adapter": adapter })))
        }
        Kind::Man { output } => {
            let mut folder = OutputFolder::create(output)?;
            // Pages of `help` would repeat the pages of the verbs.
            let mut command = command.disable_help_subcommand(true);
            command.build();
            let verbs = || command.get_subcommands();
            let pages = verbs().chain(verbs().flat_map(Command::get_subcommands));
            let shown = pages.filter(|verb| !verb.is_hide_set());
            for page in std::iter::once(&command).chain(shown) {
                let page = clap_mangen::Man::new(page.clone());
                folder.write_with(&page.get_filename(), |out| page.render(out))?;
            }
            Ok(Report::with_layout(json!({}), "").with_files(&folder.keep()?))
        }
    }
}
