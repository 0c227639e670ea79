//! `noctograph preview`: the whole road from a word to its photograph and verdict.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::inputs::{LetterFlags, PictureFlags, SceneFlags, StyleFlag, tell_all, type_word, watch};
use super::outputs::OutputFolder;
use super::{Outcome, print, show};
use crate::digest::sha256;
use crate::error::Result;
use crate::shoot::{Format, Shoot};

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

pub(super) fn run(args: &PreviewArgs) -> Result<Outcome> {
    let mut scene = args.scene.load()?;
    args.letters.apply(&mut scene)?;
    args.style.apply(&mut scene);
    args.picture.apply(&mut scene)?;
    type_word(&mut scene, args.word.as_deref());
    let shoot = Shoot { format: Some(Format::Png), ..Shoot::new(scene)? };
    let folder = OutputFolder::create(&args.output)?;
    let shot = shoot.take(&watch())?;
    tell_all(&shot.warnings);
    let (flights, scene) = (&shot.flights, &shot.scene);
    let png = shot.file.as_deref().expect("a format was asked for");

    folder.write("photo.png", |out| out.write_all(png))?;
    let mut names = vec!["photo.png".to_owned()];
    for (index, (flight, planned)) in flights.iter().zip(&shot.plans).enumerate() {
        let number = if flights.len() > 1 { format!("-{}", index + 1) } else { String::new() };
        let [flown, sent] = ["flight", "plan"].map(|name| format!("{name}{number}.csv"));
        folder.write(&flown, |out| flight.write_csv(out))?;
        folder.write(&sent, |out| planned.plan.write_csv(out))?;
        names.extend([flown, sent]);
    }
    names.push("scene.toml".to_owned());
    folder.write("scene.toml", |out| out.write_all(scene.to_toml().as_bytes()))?;
    let verdict = &shot.verdict;
    if let Some(verdict) = verdict {
        let mut json = show::to_json(verdict);
        json["flight_sha256"] = shot.flight_sha256().into();
        folder.write("verdict.json", |out| writeln!(out, "{json:#}"))?;
        names.push("verdict.json".to_owned());
    }
    let files = folder.keep(&names.iter().map(String::as_str).collect::<Vec<_>>())?;

    let (backend, adapter) = (shot.exposure.backend, &shot.exposure.adapter);
    if args.json {
        let json = serde_json::json!({
            "word": verdict.as_ref().map(|verdict| &verdict.word),
            "read": verdict.as_ref().map(|verdict| &verdict.read),
            "legible": verdict.as_ref().map(|verdict| verdict.legible),
            "probability": verdict.as_ref().map(|verdict| verdict.probability),
            "letters": verdict.as_ref().map(|verdict| &verdict.letters),
            "causes": verdict.as_ref().map(|verdict| &verdict.causes),
            "advice": verdict.as_ref().map(|verdict| &verdict.advice),
            "flight": show::flight_json(&flights[0]),
            "backend": backend.name(),
            "adapter": adapter,
            "photo_sha256": sha256(png),
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
            flights.iter().map(show::flight_lines).collect::<String>(),
            show::exposure_line(backend, adapter),
            files.replacen("\nfiles     ", "\n          ", names.len())
        ))?;
    }
    Ok(verdict.as_ref().map_or(Outcome::Done, Outcome::of))
}
