//! `noctograph specimen`: a sheet of a font's characters, stroke by stroke.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::names::named;
use super::outcome::{Report, line};
use super::output::{Output, is_svg};
use crate::error::{Error, Result};
use crate::letters::{Font, Trace};
use crate::report::specimen::Specimen;

/// Most characters of a sheet.
const MAX_CHARACTERS: usize = 1000;

#[derive(Debug, Args)]
pub(super) struct SpecimenArgs {
    /// Font: ae483, ae483-fixed, simplex, or a file *.strokes, *.ttf or *.otf
    font: String,
    /// Characters to show [default: the font's first 1000, or as many as its work allows]
    characters: Option<String>,
    /// Lines that are followed in the outlines of a typeface
    #[arg(long, value_name = "NAME", default_value = "center-line", value_parser = named::<Trace>())]
    trace: Trace,
    /// Sheet to write: *.png or *.svg
    #[arg(short, long, value_name = "FILE", default_value = "specimen.svg")]
    output: PathBuf,
}

pub(super) fn run(args: &SpecimenArgs) -> Result<Report> {
    let svg = is_svg(&args.output);
    if !svg && args.output.extension().is_none_or(|end| !end.eq_ignore_ascii_case("png")) {
        let hint = "name the sheet specimen.png or specimen.svg";
        let found = args.output.display();
        return Err(Error::input("output", found, "a file *.png or *.svg", hint));
    }
    let font = Font::open(&args.font, args.trace)?;
    let wanted = args.characters.clone().unwrap_or_else(|| font.characters());
    let visible: Vec<char> = wanted.chars().filter(|c| !c.is_whitespace()).collect();
    let first: String = visible.iter().take(MAX_CHARACTERS).collect();
    let output = Output::create(&args.output)?;
    let sheet = Specimen::new(&font, &first);
    let shown = &sheet.characters;
    // A large face is shown as far as its work goes.
    args.characters.as_ref().map_or(Ok(()), |_| font.check_work())?;
    let path = output.keep(|out| match svg {
        true => out.write_all(sheet.svg().as_bytes()),
        false => crate::photo::write_png(&sheet.pixels(), out, None, &[]),
    })?;
    let (n, all) = (shown.chars().count(), visible.len());
    let mut text = line("font", &format!("{}: {n} of {all} characters", font.name()));
    let lost: String = shown.chars().filter(|character| font.lost(*character) > 0.0).collect();
    if !lost.is_empty() {
        text += &line("faulty", &format!("the center lines lack a stroke of {lost}"));
    }
    let json =
        json!({ "font": font.name(), "characters": shown, "asked": all, "lost_stroke": lost });
    Ok(Report::new(text, json).with_files(&[path]))
}
