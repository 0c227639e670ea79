//! `noctograph preview`: the whole road from a word to its photograph and verdict.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::expose::shoot;
use super::fly::fly;
use super::inputs::{Lamps, LetterFlags, PictureFlags, SceneFlags, StyleFlag, one_drone, strokes};
use super::outputs::OutputFolder;
use super::score::known;
use super::{Outcome, print, show};
use crate::digest::sha256;
use crate::error::Result;
use crate::expose::Developer;
use crate::score::Reader;

#[derive(Debug, Args)]
pub(super) struct PreviewArgs {
    /// Word to write; the scene's where it is left out
    #[arg(conflicts_with = "drawing")]
    word: Option<String>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    letters: LetterFlags,
    #[command(flatten)]
    style: StyleFlag,
    #[command(flatten)]
    picture: PictureFlags,
    /// Folder for photo.png, flight.csv, plan.csv, scene.toml and, of a word, verdict.json
    #[arg(short, long, value_name = "DIR", default_value = "noctograph-out")]
    output: PathBuf,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
}

/// What a preview leaves, the photo first.
const FILES: [&str; 5] = ["photo.png", "flight.csv", "plan.csv", "scene.toml", "verdict.json"];

pub(super) fn run(args: &PreviewArgs) -> Result<Outcome> {
    let mut scene = args.scene.load()?;
    args.letters.apply(&mut scene)?;
    args.style.apply(&mut scene);
    args.picture.apply(&mut scene)?;
    let strokes = strokes(&mut scene, args.word.as_deref())?;
    one_drone(&scene)?;
    let plan = scene.first_plan(&strokes)?;
    let folder = OutputFolder::create(&args.output)?;

    let developer = Developer::start(args.picture.backend.into());
    // A drawing has no word to read, so nothing is said of its legibility.
    let reader = || strokes.font.is_some().then(|| Reader::new(&strokes, &scene.score)).transpose();
    let (flight, reader) = rayon::join(|| fly(&plan, &scene), reader);
    let (flight, reader) = (flight?, reader?);
    let lamps = Lamps::of(&flight, &scene, 0)?;
    let shot = shoot(&lamps, strokes.bounds_m(), &scene, developer)?;
    let known = known(&flight, &scene.plan);
    let explain = |reader: &Reader| reader.explain(&shot.photo, &(&shot.camera).into(), &known);
    let (verdict, png) = rayon::join(|| reader.as_ref().map(explain).transpose(), || shot.png());
    let verdict = verdict?.map(|(verdict, _)| verdict);

    folder.write("photo.png", |out| out.write_all(&png))?;
    folder.write("flight.csv", |out| flight.write_csv(out))?;
    folder.write("plan.csv", |out| plan.write_csv(out))?;
    folder.write("scene.toml", |out| out.write_all(scene.to_toml().as_bytes()))?;
    if let Some(verdict) = &verdict {
        let mut json = show::to_json(verdict);
        json["flight_sha256"] = lamps.flight_sha256.into();
        folder.write("verdict.json", |out| writeln!(out, "{json:#}"))?;
    }
    let files = folder.keep(if verdict.is_some() { &FILES } else { &FILES[..FILES.len() - 1] })?;

    let (backend, adapter) = (shot.exposure.backend, &shot.exposure.adapter);
    if args.json {
        let json = serde_json::json!({
            "word": verdict.as_ref().map(|verdict| &verdict.word),
            "read": verdict.as_ref().map(|verdict| &verdict.read),
            "legible": verdict.as_ref().map(|verdict| verdict.legible),
            "readability": verdict.as_ref().map(|verdict| verdict.readability),
            "letters": verdict.as_ref().map(|verdict| &verdict.letters),
            "causes": verdict.as_ref().map(|verdict| &verdict.causes),
            "advice": verdict.as_ref().map(|verdict| &verdict.advice),
            "flight": show::flight_json(&flight),
            "backend": backend.name(),
            "adapter": adapter,
            "photo_sha256": sha256(&png),
            "files": files,
        });
        print(&format!("{json}\n"))?;
    } else {
        let files: String =
            files.iter().map(|file| format!("files     {}\n", file.display())).collect();
        print(&format!(
            "{}\n{}{}{}",
            verdict.as_ref().map_or_else(
                || format!("{}: a drawing is not read\n", scene.letters.drawing),
                show::verdict_table
            ),
            show::flight_lines(&flight),
            show::exposure_line(backend, adapter),
            files.replacen("\nfiles     ", "\n          ", FILES.len())
        ))?;
    }
    Ok(verdict.as_ref().map_or(Outcome::Done, Outcome::of))
}
