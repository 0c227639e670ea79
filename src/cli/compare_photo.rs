//! `noctograph compare-photo`: a render is laid over a real photograph.

use std::path::PathBuf;

use super::{Args, OutputFolder, Report, Result, json, warn};
use crate::photo;
use crate::photo::flip::difference;
use crate::photo::register::{Registration, register};
use crate::report::photos::{overlay, placed, shrink};

#[derive(Debug, Args)]
pub(super) struct ComparePhotoArgs {
    /// Picture that Noctograph made, PNG
    render: PathBuf,
    /// Photograph of the same word, PNG or JPEG
    photo: PathBuf,
    /// Folder for overlay.png, difference.png and placed.png
    #[arg(short, long, value_name = "DIR", default_value = "photo-comparison")]
    output: PathBuf,
}

/// Longer side of the pictures that are compared, at most: a photograph is shrunk to it.
const LONGEST_PX: u32 = 2048;

/// Largest 95th percentile of the trails' distances that two pictures of one word have, by the
/// photograph's longer side.
const MOST_OFF: f64 = 0.1;

pub(super) fn run(args: &ComparePhotoArgs) -> Result<Report> {
    let (render, photo) = (photo::read(&args.render)?, photo::read(&args.photo)?);
    let photo = shrink(photo, LONGEST_PX);
    let folder = OutputFolder::create(&args.output)?;
    let registered = register(&render, &photo)?;
    let (laid, covered) = placed(&render, &registered.transform, [photo.width_px, photo.height_px]);
    let mut difference = difference(&photo, &laid);
    let mean = difference.mean(|index| covered[index]);
    for (value, covered) in difference.values.iter_mut().zip(&covered) {
        *value = if *covered { *value } else { 0.0 };
    }
    let pictures = [
        ("overlay.png", overlay(&laid, &photo)),
        ("difference.png", difference.picture()),
        ("placed.png", laid),
    ];
    for (name, picture) in &pictures {
        folder.write(name, |out| photo::write_png(picture, out, None, &[]))?;
    }
    let files = folder.keep(&pictures.each_ref().map(|(name, _)| *name))?;
    if registered.residual_px[1] > MOST_OFF * f64::from(photo.width_px.max(photo.height_px)) {
        warn(["trails of the render are far from any in the photograph: is it of the same word?"]);
    }
    let Registration { transform, correlation, residual_px: [median_px, p95_px] } = registered;
    let mut report = Report::empty();
    report.value("photo_px", [photo.width_px, photo.height_px]);
    report.value("residual_px", json!({ "median": median_px, "p95": p95_px }));
    let ([x, y], degrees) = (transform.shift_px, transform.rotation_rad.to_degrees());
    let placement = format!(
        "scale {:.4} (photo by render), turned by {degrees:+.2}°, corner at {x:.1},{y:.1} px",
        transform.scale
    );
    report.figure("transform", transform, "placement", &placement);
    let fit = format!(
        "correlation {correlation:.2}, trails off by {median_px:.1} px (median), {p95_px:.1} px \
         (95 %)"
    );
    report.figure("correlation", correlation, "fit", &fit);
    let mean_text = format!("{mean:.3}, mean difference over the render");
    report.figure("mean_flip", mean, "FLIP", &mean_text);
    Ok(report.with_files(&files))
}
