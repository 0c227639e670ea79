//! Tests of README.md. Its commands must run, and its figures must be printed by the program or
//! measured in a page of `docs/`.
//!
//! A `text` block shows the output of a command, which is the last one in the preceding `sh` block,
//! or the text block's first line after `$`. Lines may be omitted, which `...` indicates.
//! `NOCTOGRAPH_BLESS=1 cargo test --release --test it readme` rewrites the lines that are shown.

use std::path::{Path, PathBuf};

use crate::cli::{names_in, noctograph};

fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn text_of(path: &str) -> String {
    std::fs::read_to_string(repository(path)).unwrap()
}

/// A fenced block with its language and the range of its lines, counted from 0.
struct Block {
    language: String,
    lines: std::ops::Range<usize>,
}

fn blocks(lines: &[String]) -> Vec<Block> {
    let fences = lines.iter().enumerate().filter(|(_, line)| line.starts_with("```"));
    let fences: Vec<(usize, &str)> = fences.map(|(at, line)| (at, &line[3..])).collect();
    let block = |pair: &[(usize, &str)]| Block {
        language: pair[0].1.to_owned(),
        lines: pair[0].0 + 1..pair[1].0,
    };
    fences.chunks_exact(2).map(block).collect()
}

/// Returns the words of each command of the program, without comments. Lines that end with a
/// backslash are joined.
fn commands(lines: &[String]) -> Vec<Vec<String>> {
    let text = lines.join("\n").replace("\\\n", " ");
    let ours = |line: &str| {
        let line = line.strip_prefix("$ ").unwrap_or(line);
        let line = line.split("  #").next()?.split(" # ").next()?;
        let words =
            line.strip_prefix("noctograph ").or(line.split_once("--release -- ").map(|p| p.1));
        Some(words_of(words?))
    };
    text.lines().filter_map(ours).collect()
}

/// Splits a line into shell words, in which quotation marks may enclose spaces.
fn words_of(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quoted) = (Vec::new(), String::new(), None);
    for c in line.chars().chain([' ']) {
        match (quoted, c) {
            (Some(mark), c) if c == mark => quoted = None,
            (Some(_), c) => word.push(c),
            (None, '"' | '\'') => quoted = Some(c),
            (None, ' ') if word.is_empty() => {}
            (None, ' ') => words.push(std::mem::take(&mut word)),
            (None, c) => word.push(c),
        }
    }
    words
}

/// Runs a command and returns its output, which is also written into the file after `>`, if there
/// is one.
fn run(folder: &Path, words: &[String]) -> String {
    let (arguments, file) = match words.iter().position(|word| word == ">") {
        Some(at) => (&words[..at], words.get(at + 1)),
        None => (words, None),
    };
    let run = noctograph(folder).args(arguments).assert().code(predicates::ord::le(1));
    let printed = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    if let Some(file) = file {
        std::fs::write(folder.join(file), &printed).unwrap();
    }
    printed
}

/// Splits a table into entries, each of which consists of a line and the indented lines below it.
fn entries(lines: &[String]) -> Vec<Vec<String>> {
    let mut entries: Vec<Vec<String>> = Vec::new();
    for line in lines {
        match entries.last_mut() {
            Some(entry) if line.starts_with(' ') => entry.push(line.clone()),
            _ => entries.push(vec![line.clone()]),
        }
    }
    entries
}

/// Returns the label of an entry, which is its first word.
fn label(entry: &[String]) -> String {
    let first = entry[0].split(' ').next().unwrap_or_default();
    if first.starts_with(['+', '-']) { "a gain".into() } else { first.into() }
}

/// Returns the entries that a block shows, in the form that the program prints.
fn shown(block: &[String], printed: &str) -> Vec<String> {
    let printed: Vec<String> = printed.lines().map(str::to_owned).collect();
    let printed = entries(&printed);
    let mut rest = printed.iter();
    let mut shown = Vec::new();
    for entry in entries(block) {
        if entry[0] == "..." || entry[0].starts_with("$ ") {
            shown.extend(entry);
            continue;
        }
        let found = rest.find(|printed| label(printed) == label(&entry));
        shown.extend(
            found.unwrap_or_else(|| panic!("not printed: {entry:?} of {printed:#?}")).clone(),
        );
    }
    shown
}

#[test]
fn what_the_readme_shows_is_what_the_program_prints() {
    let readme = text_of("README.md");
    let lines: Vec<String> = readme.lines().map(str::to_owned).collect();
    let (mut blessed, mut shift, mut n_shown) = (lines.clone(), 0_isize, 0);
    let mut last: Vec<Vec<String>> = Vec::new();
    for Block { language, lines: range } in blocks(&lines) {
        let block = &lines[range.clone()];
        let own = commands(block).into_iter().filter(|_| block[0].starts_with("$ "));
        let own: Vec<_> = own.collect();
        match language.as_str() {
            "sh" => last = commands(block),
            "text" if !own.is_empty() => last = own,
            // tests/python runs the Python blocks of the README.
            "text" | "python" => {}
            other => panic!("a block of {other:?}"),
        }
        // The diagram from word to verdict is not the output of a command.
        if language != "text" || block.iter().any(|line| line.contains('→')) {
            continue;
        }
        let folder = tempfile::tempdir().unwrap();
        let printed = last.iter().fold(None, |_, words| Some(run(folder.path(), words)));
        let found = shown(block, &printed.expect("a command before its output"));
        let moved = |at: usize| at.checked_add_signed(shift).unwrap();
        blessed.splice(moved(range.start)..moved(range.end), found.iter().cloned());
        shift += found.len().cast_signed() - range.len().cast_signed();
        n_shown += found.len();
    }
    assert!(n_shown > 15, "the README shows {n_shown} lines");
    if crate::bless::is_blessed("README.md") {
        std::fs::write(repository("README.md"), blessed.join("\n") + "\n").unwrap();
    } else {
        assert_eq!(blessed, lines, "bless with NOCTOGRAPH_BLESS=1");
    }
}

/// Runs all other commands of the README.
#[test]
fn the_commands_of_the_readme_run() {
    let folder = tempfile::tempdir().unwrap();
    let lines: Vec<String> = text_of("README.md").lines().map(str::to_owned).collect();
    let shells = blocks(&lines).into_iter().filter(|block| block.language == "sh");
    let commands: Vec<_> = shells.flat_map(|block| commands(&lines[block.lines])).collect();
    assert!(commands.len() >= 6, "{} commands", commands.len());
    // `serve` is tested in `serve.rs`, because it runs until it is terminated.
    for mut words in commands.into_iter().filter(|words| words[0] != "serve") {
        // The pictures are small, because the test only checks that the commands run.
        if words[0] == "preview" && !words.contains(&"--size".to_owned()) {
            words.extend(["--size", "320x180"].map(str::to_owned));
        }
        run(folder.path(), &words);
    }
    let first = names_in(&folder.path().join("noctograph-out"));
    let readme = text_of("README.md");
    for name in ["photo.png", "verdict.json", "flight.csv", "plan.csv", "scene.toml"] {
        assert!(first.iter().any(|found| found == name) && readme.contains(&format!("`{name}`")));
    }
}

/// Returns a file's text in one line, so that wrapped sentences can be found.
fn unwrapped(path: &str) -> String {
    text_of(path).split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Figures whose measurement takes hours are compared with the table in a page.
#[test]
fn the_figures_of_the_readme_are_those_of_the_documentation() {
    let readme = unwrapped("README.md");
    let model = unwrapped("docs/model.md");
    for range in ["1 to 3 cm", "1 to 5 cm"] {
        assert!(readme.contains(range) && model.contains(range), "replayed within {range}");
    }
    let least = text_of("Cargo.toml");
    let least = least.lines().find_map(|line| line.strip_prefix("rust-version = ")).unwrap();
    assert!(
        readme.contains(&format!("(https://rustup.rs) {}", least.trim_matches('"'))),
        "{least}"
    );
}
