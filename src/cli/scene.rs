//! `noctograph scene`: a whole scene file, commented.

use std::path::PathBuf;

use super::{Args, DesignFlags, Output, Report, Result, SeedFlag, json};

#[derive(Debug, Args)]
pub(super) struct SceneArgs {
    /// Word to put into it
    word: Option<String>,
    /// Preset to start from, as --scene
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
    scene.word = args.word.clone().unwrap_or(scene.word);
    let toml = scene.to_toml();
    let Some(path) = &args.output else {
        return Ok(Report::new(toml, &scene));
    };
    let file = Output::create(path)?.keep(toml)?;
    Ok(Report::with_layout(json!({}), "").with_files(&[file]))
}
