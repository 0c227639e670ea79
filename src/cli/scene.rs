//! `noctograph scene`: a preset as a scene file.

use clap::Args;

use super::{Outcome, print};
use crate::error::Result;
use crate::scene::{Preset, Scene};

#[derive(Debug, Args)]
pub(super) struct SceneArgs {
    /// Word to put into it
    word: Option<String>,
    /// Drone to start from: ae483-2022, cf21, cf21-thrust-kit, cf-brushless or bzzz
    #[arg(long, value_name = "NAME", default_value = Preset::default().name())]
    preset: String,
}

pub(super) fn run(args: &SceneArgs) -> Result<Outcome> {
    let word = args.word.clone().unwrap_or_default();
    print(&Scene { word, ..Scene::preset(args.preset.parse()?) }.to_toml())?;
    Ok(Outcome::Done)
}
