//! `noctograph compare-photo` aligns a render with a real photo by their letters and shows the
//! difference.

use std::path::PathBuf;

use super::outcome::Report;
use super::output::OutputFolder;
use super::terminal::warn;
use crate::error::{Error, Result};
use crate::geometry::distance;
use crate::photo;
use crate::photo::flip::difference;
use crate::report::photos::{Similarity, overlay, placed, shrink};
use crate::score::{ReadLetter, read};
use clap::Args;
use serde_json::json;

#[derive(Debug, Args)]
pub(super) struct ComparePhotoArgs {
    /// Render made by Noctograph (PNG)
    render: PathBuf,
    /// Photograph of the same word (PNG or JPEG)
    photo: PathBuf,
    /// Folder for overlay.png, difference.png and placed.png
    #[arg(short, long, value_name = "DIR", default_value = "photo-comparison")]
    output: PathBuf,
}

/// Longer side, in pixels, to which larger photographs are scaled down for the comparison. Strokes
/// then remain a few pixels wide, and FLIP takes only seconds.
const LONGEST_PX: u32 = 2048;

/// Runs the verb `compare-photo`, which lays a render over a photograph by their letters, writes
/// three pictures, and reports how far the letters and the pixels differ (FLIP). Warns if the two
/// pictures read as different words.
pub(super) fn run(args: &ComparePhotoArgs) -> Result<Report> {
    let (render, photo) = (photo::read(&args.render)?, photo::read(&args.photo)?);
    let photo = shrink(photo, LONGEST_PX);
    let mut folder = OutputFolder::create(&args.output)?;
    // The similarity transform is fitted to the corners of the letters in both pictures.
    let [of_render, of_photo] = [read(&render), read(&photo)];
    let pairs = corners(&of_render.letters, &of_photo.letters)?;
    if of_render.text != of_photo.text {
        let [rendered, photographed] = [&of_render.text, &of_photo.text];
        warn([format!("the render reads as {rendered}, the photograph as {photographed}")]);
    }
    let transform = Similarity::between(&pairs);
    let squares_px2 = pairs.iter().map(|[a, b]| libm::pow(distance(transform.apply(*a), *b), 2.0));
    let residual_px = (squares_px2.sum::<f64>() / pairs.len() as f64).sqrt();
    // FLIP is averaged over the pixels that the render covers, and drawn only there.
    let (laid, covered) = placed(&render, &transform, [photo.width_px, photo.height_px]);
    let mut difference = difference(&photo, &laid);
    let mean_flip = difference.mean(|index| covered[index]);
    for (value, is_covered) in difference.values.iter_mut().zip(&covered) {
        *value = if *is_covered { *value } else { 0.0 };
    }
    let pictures = [
        ("overlay.png", overlay(&laid, &photo)),
        ("difference.png", difference.picture()),
        ("placed.png", laid),
    ];
    for (name, picture) in &pictures {
        folder.write(name, photo::encode_png(picture, None, &[]))?;
    }
    let files = folder.keep()?;
    let product = json!({
        "photo_px": [photo.width_px, photo.height_px], "transform": transform,
        "residual_px": residual_px, "mean_flip": mean_flip,
    });
    Ok(Report::with_layout(product, LAYOUT).with_files(&files))
}

const LAYOUT: &str = "\
placement\tscale {transform.scale:.4} (photo relative to render), rotated by {transform.rotation_rad*57.29577951308232:+.2}°, corner at {transform.shift_px.0:.1},{transform.shift_px.1:.1} px
fit       corners of the letters off by {residual_px:.1} px (RMS)
FLIP      {mean_flip:.3}, mean difference over the render
";

/// Returns pairs of corresponding letter corners, in pixels of the render and of the photo. Each
/// letter contributes two opposite corners of its box.
///
/// # Errors
///
/// [`Error::Infeasible`] if the two pictures show different numbers of letters.
fn corners(render: &[ReadLetter], photo: &[ReadLetter]) -> Result<Vec<[[f64; 2]; 2]>> {
    // Letters are paired in reading order, which requires the same number of letters in both
    // pictures.
    if render.is_empty() || render.len() != photo.len() {
        return Err(Error::infeasible(
            format!(
                "{} letters are read in the render and {} in the photograph, but the pictures are \
                 aligned letter by letter",
                render.len(),
                photo.len()
            ),
            "compare photographs of the same word, or crop the photograph to the word",
        ));
    }
    let pairs = render.iter().zip(photo).flat_map(|(one, other)| {
        let [from, to] = [one, other].map(|letter| {
            let [left, top, right, bottom] = letter.box_px;
            [[left, top], [right, bottom]]
        });
        [0, 1].map(|corner| [from[corner], to[corner]])
    });
    Ok(pairs.collect())
}
