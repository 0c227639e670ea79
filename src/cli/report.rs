//! `noctograph report` shows a verb's output folder as one page.

use std::path::{Path, PathBuf};

use super::outcome::Report;
use super::output::Output;
use super::show::sentence;
use crate::error::{Error, Result};
use crate::photo;
use crate::report::Page;
use crate::report::photos::shrink;
use crate::scene::Scene;
use clap::Args;
use noctograph_core::files::{Limit, Text, ending, entries_in, file_name as name, files_in};
use serde_json::{Value, json};

#[derive(Debug, Args)]
#[command(after_help = "The folder may be the output of rank, tune, hold, locate or preview. \
                        `noctograph preview --report` shows more about a single photograph.")]
pub(super) struct ReportArgs {
    /// Output folder of a verb
    folder: PathBuf,
    /// Page to write (HTML)
    #[arg(short, long, value_name = "FILE", default_value = "noctograph-report.html")]
    output: PathBuf,
}

/// Size limit for a drawing or a table.
const LIMIT: Limit =
    Limit { bytes: 8 << 20, what: "a drawing or table", hint: "remove the file from the folder" };
/// Maximum number of files in a page.
const MAX_FILES: usize = 40;
/// Maximum number of rows of a table in a page.
const MAX_ROWS: usize = 60;
/// Maximum number of columns of a table that is not transposed, and number of rows from which no
/// table is transposed.
const MAX_COLUMNS: usize = 8;
/// Maximum size, in bytes, of a table that a page shows. Tables of flights are larger.
const MAX_TABLE_BYTES: u64 = 200_000;
/// Maximum length of a photo's longer side in the page, in pixels.
const MAX_PX: u32 = 1920;
/// JPEG quality of a photo in the page, out of 100.
const QUALITY: u8 = 82;

/// Runs the verb `report`, which shows the photos, drawings, settings and tables of a folder in one
/// HTML page. The page has at most [`MAX_FILES`] files, and says how many it leaves out. The report
/// lists the files that are not shown.
pub(super) fn run(args: &ReportArgs) -> Result<Report> {
    let files = files_in(&args.folder)?;
    let output = Output::create(&args.output)?;
    let title = name(std::path::absolute(&args.folder).unwrap_or_else(|_| args.folder.clone()));
    let (mut shown, mut page) = (Vec::new(), Page::new(&title, &lead(&files)?));
    let entries = entries_in(&args.folder)?;
    let others = entries.iter().filter(|path| !files.contains(path) || !is_shown(path)).map(name);
    let others: Vec<String> = others.collect();
    let mut files: Vec<&PathBuf> = files.iter().filter(|path| is_shown(path)).collect();
    files.sort_by_key(|path| rank(path));
    // A page of hundreds of photos would be too large for a browser.
    let n_more = files.len().saturating_sub(MAX_FILES);
    for path in files.into_iter().take(MAX_FILES) {
        let name = name(path);
        page = add(page.section(&name), path, &name)?;
        shown.push(name);
    }
    if shown.is_empty() {
        let actual = args.folder.display().to_string();
        let wanted = "a folder with photos (PNG), drawings (SVG), tables (CSV) or a scene";
        let hint = "name a folder that rank, tune, hold, locate or preview wrote";
        return Err(Error::input("folder", actual, wanted, hint));
    }
    let more = Some(n_more).filter(|n| *n > 0);
    let words = json!({
        "names": shown.join(", "), "more": more, "most": MAX_FILES,
        "others": Some(others.join(", ")).filter(|others| !others.is_empty()),
    });
    let product = json!({ "shown": shown, "not_shown": others });
    let report = Report::with_words(product, &words, LAYOUT);
    if let Some(more) = more {
        page = page.text(&format!("{more} files are left out: a page shows at most {MAX_FILES}"));
    }
    let file = output.keep(page.html())?;
    Ok(report.with_files(&[file]))
}

const LAYOUT: &str = "\
shown     {names}
left out  {more} files, because a page shows at most {most}
not shown\t{others}
";

/// Returns the sort key of a file in the page: photos first, then drawings, settings and tables.
fn rank(path: &Path) -> Option<usize> {
    ["png", "svg", "toml", "csv"].iter().position(|end| *end == ending(path))
}

/// Returns true if a file is shown in the page: a photo, a drawing, the scene, or a small table
/// that is not a time series.
fn is_shown(path: &Path) -> bool {
    let is_small = || path.metadata().is_ok_and(|file| file.len() <= MAX_TABLE_BYTES);
    match &*ending(path) {
        "png" | "svg" => true,
        // `flights.csv` has a row for each flight of a study.
        "csv" => {
            let is_over_time = |table: Vec<u8>| table.starts_with(b"time_s");
            name(path) != "flights.csv" && is_small() && !LIMIT.read(path).is_ok_and(is_over_time)
        }
        "toml" => name(path).eq_ignore_ascii_case("scene.toml"),
        _ => false,
    }
}

/// Returns the verdict on the folder's photo as a sentence, or an empty text if there is none.
/// Returns an error for an unreadable file. Values that the file lacks are empty or zero.
fn lead(files: &[PathBuf]) -> Result<String> {
    let Some(path) = files.iter().find(|path| name(path).eq_ignore_ascii_case("verdict.json"))
    else {
        return Ok(String::new());
    };
    let verdict: Value = serde_json::from_str(&LIMIT.read_text(path)?).unwrap_or_default();
    let words = ["word", "read"].map(|key| verdict[key].as_str().unwrap_or_default());
    let readability = verdict["readability"].as_f64().unwrap_or_default();
    Ok(sentence(words, verdict["legible"] == true, readability))
}

/// Returns the page with a file added: a photo, a drawing, a table or a scene.
fn add(page: Page, path: &Path, name: &str) -> Result<Page> {
    Ok(match &*ending(path) {
        "png" => page.photo(&photo::jpeg(&shrink(photo::read(path)?, MAX_PX), QUALITY), name, None),
        "svg" => page.drawing(&LIMIT.read(path)?, name),
        "csv" => table(page, path)?,
        _ => {
            let scene = Scene::read(path)?.portable();
            let preset = scene.preset.name();
            page.text(&format!("Settings that differ from the preset {preset}:"))
                .table(["key", "value", "in the preset"], scene.changes())
        }
    })
}

/// Returns the page with a CSV file added as a table of its first [`MAX_ROWS`] rows, followed by
/// the number of rows that are left out. A table of few rows with many columns is transposed.
fn table(page: Page, path: &Path) -> Result<Page> {
    let input_error = |error: csv::Error| {
        let place = path.display().to_string();
        Error::input(place, error, "a table (CSV)", "remove the file from the folder")
    };
    let bytes = LIMIT.read(path)?;
    let text = Text::decode(&bytes);
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(&*text.bytes);
    fn cells(row: &csv::ByteRecord) -> Vec<String> {
        row.iter().map(|cell| shortened(&String::from_utf8_lossy(cell))).collect()
    }
    let head = cells(reader.byte_headers().map_err(input_error)?);
    let (mut rows, mut left_out) = (Vec::new(), 0);
    for row in reader.byte_records() {
        let row = row.map_err(input_error)?;
        if rows.len() < MAX_ROWS { rows.push(cells(&row)) } else { left_out += 1 }
    }
    if head.len() > MAX_COLUMNS && rows.len() < MAX_COLUMNS {
        // A short row is filled up with empty cells.
        let column = |i| {
            let lines = std::iter::once(&head).chain(&rows);
            lines.map(|row| row.get(i).cloned().unwrap_or_default()).collect()
        };
        let columns: Vec<Vec<String>> = (0..head.len()).map(column).collect();
        return Ok(page.rows(&columns[0], &columns[1..]));
    }
    let page = page.rows(&head, &rows);
    Ok(if left_out > 0 { page.text(&format!("and {left_out} more rows")) } else { page })
}

/// Returns a long number rounded to four decimals, or below 0.001 to four significant digits. Any
/// other cell is unchanged.
fn shortened(cell: &str) -> String {
    // Longest cell that is not rounded, in bytes.
    const SHORT: usize = 7;
    match cell.parse::<f64>() {
        Ok(number) if cell.len() > SHORT && number.abs() >= 1e-3 => format!("{number:.4}"),
        Ok(number) if cell.len() > SHORT && number != 0.0 => format!("{number:.3e}"),
        _ => cell.to_owned(),
    }
}
