//! `noctograph scene` writes a complete scene file with comments.

use std::path::{Path, PathBuf};

use super::flags::{DesignFlags, SeedFlag, typed_word};
use super::outcome::Report;
use super::output::{Output, keep_copies};
use crate::error::Result;
use clap::Args;
use serde_json::json;

#[derive(Debug, Args)]
pub(super) struct SceneArgs {
    /// Word of the scene
    word: Option<String>,
    /// Word of the scene, even if a file has this name
    #[arg(long = "word", value_name = "WORD", conflicts_with_all = ["word"])]
    as_word: Option<String>,
    /// Preset to start from, like --scene
    #[arg(long, value_name = "NAME", conflicts_with = "scene")]
    preset: Option<String>,
    #[command(flatten)]
    design: DesignFlags,
    #[command(flatten)]
    seed: SeedFlag,
    /// Scene file to write, instead of printing it
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(super) fn run(args: &SceneArgs) -> Result<Report> {
    let preset = args.preset.iter().map(|name| ("preset".to_owned(), name.clone()));
    let settings: Vec<_> = preset.chain(args.seed.settings()).collect();
    let mut scene = args.design.load(&[], &settings)?;
    if let Some(word) = typed_word(args.word.as_ref(), args.as_word.as_ref())? {
        word.clone_into(&mut scene.word);
    }
    let Some(path) = &args.output else {
        // Paths are relative to the current folder, where the output is probably redirected.
        let files = scene.in_folder(Path::new(""), "")?;
        let toml = if files.copies.is_empty() { files.toml } else { scene.to_toml() };
        return Ok(Report::new(toml, &scene));
    };
    let (output, scene) = (Output::create(path)?, scene.beside(path)?);
    let mut files = keep_copies(path, &scene)?;
    files.insert(0, output.keep(scene.toml)?);
    Ok(Report::with_layout(json!({}), "").with_files(&files))
}
