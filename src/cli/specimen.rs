//! `noctograph specimen`: a sheet of a font's characters, stroke by stroke.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::outputs::Output;
use super::{Outcome, print};
use crate::error::{Error, Result};
use crate::letters::{Font, Trace};
use crate::report::specimen::Specimen;

/// Most characters of a sheet.
const MAX_CHARACTERS: usize = 1000;

#[derive(Debug, Args)]
pub(super) struct SpecimenArgs {
    /// Font: ae483, ae483-fixed, simplex, or a file *.strokes, *.ttf or *.otf
    font: String,
    /// Characters to show; the font's first 1000 where they are left out
    characters: Option<String>,
    /// Lines that are drawn of a typeface: center-line or outline
    #[arg(long, value_name = "NAME", default_value = "center-line")]
    trace: Trace,
    /// Sheet to write: *.png or *.svg
    #[arg(short, long, value_name = "FILE", default_value = "specimen.svg")]
    output: PathBuf,
}

pub(super) fn run(args: &SpecimenArgs) -> Result<Outcome> {
    let extension = args.output.extension().and_then(|ext| ext.to_str());
    let png = match extension.map(str::to_ascii_lowercase).as_deref() {
        Some("png") => true,
        Some("svg") => false,
        _ => {
            let found = args.output.display();
            let hint = "name the sheet specimen.png or specimen.svg";
            return Err(Error::input("--output", found, "a file *.png or *.svg", hint));
        }
    };
    let font = Font::open(&args.font, args.trace)?;
    let wanted = args.characters.clone().unwrap_or_else(|| font.characters());
    let blank = |c: &char| !c.is_whitespace();
    let some: String = wanted.chars().filter(blank).take(MAX_CHARACTERS).collect();
    let output = Output::create(&args.output)?;
    let sheet = Specimen::new(&font, &some);
    let path = output.keep(|out| {
        if png { write_png(&sheet, out) } else { out.write_all(sheet.svg().as_bytes()) }
    })?;
    let (n, all) = (some.chars().count(), wanted.chars().filter(blank).count());
    print(&format!("{}: {n} of {all} characters, written to {}\n", font.name(), path.display()))?;
    Ok(Outcome::Done)
}

fn write_png(sheet: &Specimen, out: &mut impl Write) -> std::io::Result<()> {
    let (width, height, rgb) = sheet.pixels();
    let mut encoder = png::Encoder::new(out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&rgb)?;
    Ok(())
}
