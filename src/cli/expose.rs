//! `noctograph expose`: a flight becomes its photograph.

use std::path::PathBuf;

use clap::Args;

use super::inputs::{PictureFlags, SceneFlags, recorded, tell_all, type_word, watch};
use super::outputs::Output;
use super::{Outcome, print, show};
use crate::digest::sha256;
use crate::error::Result;
use crate::shoot::{Format, Judging, Shoot};

#[derive(Debug, Args)]
pub(super) struct ExposeArgs {
    /// Flights to expose, one for each drone, as `noctograph fly` writes them, or light traces:
    /// t,x,y,z,r,g,b
    #[arg(required = true, value_name = "FLIGHT")]
    flights: Vec<PathBuf>,
    /// Word that the camera frames; the scene's where it is left out
    #[arg(long, value_name = "WORD")]
    word: Option<String>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    picture: PictureFlags,
    /// Photo to write
    #[arg(short, long, value_name = "FILE", default_value = "photo.png")]
    output: PathBuf,
    /// Kind of file; where it is left out exr for a name that ends so, else png
    #[arg(long, value_name = "KIND")]
    format: Option<FormatName>,
    /// Print one JSON object instead of lines
    #[arg(long)]
    json: bool,
}

/// Format of a picture file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum FormatName {
    /// 8 bits a channel, after the tone curve
    Png,
    /// 16 bits a channel, after the tone curve
    Png16,
    /// What the sensor read in linear light, 32 bits a channel
    Exr,
    /// The same, 16 bits a channel
    ExrHalf,
}

impl From<FormatName> for Format {
    fn from(name: FormatName) -> Self {
        match name {
            FormatName::Png => Self::Png,
            FormatName::Png16 => Self::Png16,
            FormatName::Exr => Self::Exr,
            FormatName::ExrHalf => Self::ExrHalf,
        }
    }
}

pub(super) fn run(args: &ExposeArgs) -> Result<Outcome> {
    let mut scene = args.scene.load()?;
    args.picture.apply(&mut scene)?;
    type_word(&mut scene, args.word.as_deref());
    let output = Output::create(&args.output)?;
    let format = args.format.map_or(Format::from_path(&args.output), Format::from);
    let shoot = recorded(scene, &args.flights)?;
    let shoot = Shoot { format: Some(format), judging: Judging::Skipped, ..shoot };
    let shot = shoot.take(&watch())?;
    tell_all(&shot.warnings);
    let bytes = shot.file.as_deref().expect("a format was asked for");
    let sha256 = sha256(bytes);
    let path = output.keep(|out| std::io::Write::write_all(out, bytes))?;
    let (backend, adapter) = (shot.exposure.backend, &shot.exposure.adapter);
    if args.json {
        let json = serde_json::json!({
            "backend": backend.name(),
            "adapter": adapter,
            "flight_sha256": shot.flight_sha256(),
            "photo_sha256": sha256,
            "files": [path],
        });
        print(&format!("{json}\n"))?;
    } else {
        let file = path.display();
        print(&format!("{}files     {file}\n", show::exposure_line(backend, adapter)))?;
    }
    Ok(Outcome::Done)
}
