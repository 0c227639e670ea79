//! `noctograph score`: a photograph is read.

use std::path::PathBuf;

use clap::Args;

use super::inputs::strokes;
use super::{Outcome, print, show};
use crate::error::Result;
use crate::photo::Photo;
use crate::scene::Scene;
use crate::score::score;

#[derive(Debug, Args)]
pub(super) struct ScoreArgs {
    /// Photo to read, as `noctograph preview` or `noctograph expose` writes it
    photo: PathBuf,
    /// Word that it should show; the scene's where it is left out
    word: Option<String>,
    /// Scene file (TOML) with letters and camera; the one inside the photo where it is left out
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Print the verdict as one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &ScoreArgs) -> Result<Outcome> {
    let photo = Photo::read_png(&args.photo)?;
    let mut scene = match (&args.scene, &photo.scene_toml) {
        (Some(path), _) => Scene::read(path)?,
        (None, Some(toml)) => Scene::parse(toml, &format!("{} (scene)", args.photo.display()))?,
        (None, None) => Scene::default(),
    };
    (scene.camera.width_px, scene.camera.height_px) = (photo.width_px, photo.height_px);
    // The camera framed the word that was flown, whatever word is looked for now.
    let flown = (!scene.word.is_empty()).then(|| strokes(&mut scene, None)).transpose()?;
    let strokes = strokes(&mut scene, args.word.as_deref())?;
    let framed = flown.as_ref().unwrap_or(&strokes);
    let camera = scene.camera.camera(framed.bounds_m(), 0.0)?;
    let verdict = score(&photo, &strokes, &camera, &scene.score)?;
    if args.json {
        print(&format!("{}\n", show::to_json(&verdict)))?;
    } else {
        print(&show::verdict_table(&verdict))?;
    }
    Ok(Outcome::of(&verdict))
}
