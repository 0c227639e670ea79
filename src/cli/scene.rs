//! `noctograph scene`: the default scene file.

use clap::Args;

use super::{Outcome, print};
use crate::error::Result;
use crate::scene::Scene;

#[derive(Debug, Args)]
pub(super) struct SceneArgs {
    /// Word to put into it
    word: Option<String>,
}

pub(super) fn run(args: &SceneArgs) -> Result<Outcome> {
    let word = args.word.clone().unwrap_or_default();
    print(&Scene { word, ..Scene::default() }.to_toml())?;
    Ok(Outcome::Done)
}
