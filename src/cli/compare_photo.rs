//! `noctograph compare-photo`: a render is laid over a real photograph.

use std::path::PathBuf;

use clap::Args;

use super::outputs::OutputFolder;
use super::{Outcome, print};
use crate::error::Result;
use crate::photo::Photo;
use crate::photo::flip::{Difference, difference};
use crate::photo::register::{Registration, register};
use crate::report::photos::{overlay, placed, shrunk};

#[derive(Debug, Args)]
pub(super) struct ComparePhotoArgs {
    /// Picture that Noctograph made, PNG
    render: PathBuf,
    /// Photograph of the same word, PNG or JPEG
    photo: PathBuf,
    /// Folder for overlay.png, difference.png and placed.png
    #[arg(short, long, value_name = "DIR", default_value = "photo-comparison")]
    output: PathBuf,
    /// Print one JSON object instead of lines
    #[arg(long)]
    json: bool,
}

/// Longer side of the pictures that are compared, at most: a photograph is shrunk to it.
const LONGEST_PX: u32 = 2048;

pub(super) fn run(args: &ComparePhotoArgs) -> Result<Outcome> {
    let (render, photo) = (Photo::read(&args.render)?, Photo::read(&args.photo)?);
    let photo = shrunk(photo, LONGEST_PX);
    let folder = OutputFolder::create(&args.output)?;
    let found = register(&render, &photo)?;
    let (laid, covered) = placed(&render, &found.transform, [photo.width_px, photo.height_px]);
    let difference = difference(&photo, &laid);
    let mean = difference.mean(|index| covered[index]);
    let masked = Difference {
        values: difference
            .values
            .iter()
            .zip(&covered)
            .map(|(v, c)| if *c { *v } else { 0.0 })
            .collect(),
        ..difference
    };
    let pictures = [
        ("overlay.png", overlay(&laid, &photo)),
        ("difference.png", masked.picture()),
        ("placed.png", laid),
    ];
    for (name, picture) in &pictures {
        folder.write(name, |out| picture.write_png(out, None, &[]))?;
    }
    let files = folder.keep(&pictures.each_ref().map(|(name, _)| *name))?;
    let Registration { transform, correlation, residual_px: [median_px, p95_px] } = found;
    if args.json {
        let json = serde_json::json!({
            "photo_px": [photo.width_px, photo.height_px],
            "transform": {
                "scale": transform.scale,
                "rotation_rad": transform.rotation_rad,
                "shift_px": transform.shift_px,
            },
            "correlation": correlation,
            "residual_px": { "median": median_px, "p95": p95_px },
            "mean_flip": mean,
            "files": files,
        });
        print(&format!("{json}\n"))?;
    } else {
        let [x, y] = transform.shift_px;
        let files: String =
            files.iter().map(|file| format!("files     {}\n", file.display())).collect();
        print(&format!(
            "place     {:.4} px of the photo per px of the render, turned by {:+.2} deg, corner at \
             {x:.1},{y:.1}\nfit       correlation {correlation:.2}; trails {median_px:.1} px off \
             (median), {p95_px:.1} px (95 %)\ndiffers   by {mean:.3} (mean FLIP over the render)\n{}",
            transform.scale,
            transform.rotation_rad.to_degrees(),
            files.replacen("\nfiles     ", "\n          ", 2)
        ))?;
    }
    Ok(Outcome::Done)
}
