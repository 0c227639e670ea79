//! Tests every reader of the program with damaged and hostile files. A mutator changes valid files
//! in a few places, and growth repeats, nests and lengthens their elements. No file may cause a
//! panic, an endless loop, or memory use above a budget. Times are printed but not judged, because
//! they are longer on a busy machine. `tests/it/limits.rs` grows the inputs of whole verbs.
//!
//! `cargo test --release --test fuzz` takes about 15 s of processor time. `NOCTOGRAPH_FUZZ_CASES`
//! sets the number of damaged files for each reader, and `NOCTOGRAPH_GROW_CASES` the number of
//! grown files, which are then as large as the reader accepts. `NOCTOGRAPH_FUZZ_ONLY` selects one
//! reader. Case `n` of a reader has the same bytes on every machine. When a case fails, its input
//! is written under `target/`. When the fault is fixed, add this input to
//! `tests/fuzz/seeds/READER/`.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::disallowed_methods, reason = "a test reads what it wrote")]

use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

mod grow;
mod heavy;
mod memory;
mod mutate;
mod readers;
mod words;

use noctograph::letters::{Font, Trace};
use readers::Reader;

/// Maximum memory, in bytes, for reading a damaged file. Damaged files are small.
const DAMAGED: usize = 256 << 20;
/// Maximum memory, in bytes, for reading a file as large as its reader accepts, or a photo of up to
/// 256 letters, which is read blind twice and scored once.
const GROWN: usize = 300_000_000;
/// Default number of grown files for each reader.
const GROWN_CASES: u64 = 16;
/// Maximum size of a grown file by default, in bytes.
const GROWN_BYTES: usize = 1 << 20;
/// Default number of damaged files for each fast reader.
const DAMAGED_CASES: u64 = 3000;
/// Default number of damaged files for each reader that takes milliseconds.
const SLOW_CASES: u64 = 200;
/// Names of the readers that take milliseconds per file.
const SLOW: [&str; 3] = ["typeface", "svg", "picture"];
/// Time after which a case counts as endless.
const ENDLESS: Duration = Duration::from_secs(120);

/// Name and content of the file that is being read, for the watchdog.
static NOW: Mutex<Option<(String, Vec<u8>)>> = Mutex::new(None);
/// Number of cases that have begun.
static BEGUN: AtomicU64 = AtomicU64::new(0);

/// Measurements of a reader.
#[derive(Default)]
struct Tally {
    cases: u64,
    accepted: u64,
    slowest: Duration,
    largest: usize,
    faults: Vec<String>,
}

#[test]
fn no_file_hurts_its_reader() {
    let cases = number("NOCTOGRAPH_FUZZ_CASES");
    each_reader("damaged", |reader, path| Some(fuzz(reader, cases, path)));
}

#[test]
fn no_growth_hurts_its_reader() {
    let cases = number("NOCTOGRAPH_GROW_CASES");
    each_reader("grown", |reader, path| {
        let (limit, grow) = grow::grower(reader.name)?;
        let seeds = reader.seeds();
        let mut tally = Tally::default();
        for n in 0..cases.unwrap_or(GROWN_CASES) {
            let mut random = mutate::Random::new(reader.name, n);
            let most = if cases.is_some() { limit } else { limit.min(GROWN_BYTES) };
            let mut bytes = grow(&seeds, most, &mut random);
            if reader.file.ends_with(".png") {
                mutate::mend_checksums(&mut bytes);
            }
            case(reader, &bytes, path, GROWN, &mut tally);
        }
        Some(tally)
    });
}

/// The budget is needed, because tracing one tangled glyph takes several milliseconds, and a sheet
/// shows a thousand characters.
#[test]
fn a_face_has_one_budget_for_all_its_characters() {
    let mut random = mutate::Random::new("face", 1);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("heavy.ttf");
    std::fs::write(&path, heavy::typeface_of(1000, 300, 0, &mut random)).unwrap();
    let font = Font::open(path.to_str().unwrap(), Trace::CenterLine).unwrap();
    font.check_work().unwrap();
    let drawn = ('!'..='\u{408}').filter(|character| font.aspect(*character).is_some()).count();
    assert!((10..1000).contains(&drawn), "{drawn} drawn");
    let error = font.check_work().unwrap_err().to_string();
    assert!(error.contains("heavy.ttf: found more work than an input may cause"), "{error}");
}

/// Words of equal and of alternating letters are written, scored in their own photo and in that of
/// the other word, read blind, and taken from the scene in a photo.
#[test]
fn no_word_takes_much_memory() {
    let reader = Reader { name: "words", file: "word.txt", read: words::read, good: || vec![] };
    each_reader("grown", |first, path| {
        (first.name == "scene").then(|| {
            let mut tally = Tally::default();
            for word in words::all() {
                case(&reader, word.as_bytes(), path, GROWN, &mut tally);
            }
            tally
        })
    });
}

/// Returns the number in an environment variable.
fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|n| n.parse().unwrap())
}

/// Measures readers one after another, and prints the results.
fn each_reader(kind: &str, measure: impl Fn(&Reader, &std::path::Path) -> Option<Tally>) {
    // The lock prevents simultaneous measurements, because memory is counted over all threads.
    static ALONE: Mutex<()> = Mutex::new(());
    let _alone = ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    std::panic::set_hook(Box::new(|_| {}));
    static WATCH: std::sync::Once = std::sync::Once::new();
    WATCH.call_once(watch);
    let only = std::env::var("NOCTOGRAPH_FUZZ_ONLY").ok();
    let folder = tempfile::tempdir_in(if cfg!(target_os = "linux") { "/dev/shm" } else { "." });
    let folder = folder.or_else(|_| tempfile::tempdir()).unwrap();
    let mut faults = Vec::new();
    let mut out = std::io::stderr();
    writeln!(out, "{kind:14}     cases   accepted   slowest ms   largest MB").unwrap();
    for reader in readers::all() {
        if only.as_ref().is_some_and(|only| *only != reader.name) {
            continue;
        }
        let path = folder.path().join(reader.file);
        let Some(tally) = measure(&reader, &path) else { continue };
        writeln!(
            out,
            "{:14}{:10}{:11}{:13.1}{:13.1}",
            reader.name,
            tally.cases,
            tally.accepted,
            1e3 * tally.slowest.as_secs_f64(),
            tally.largest as f64 / 1e6
        )
        .unwrap();
        faults.extend(tally.faults);
    }
    let _ = std::panic::take_hook();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Reads a reader's seeds, and then mutations of them.
fn fuzz(reader: &Reader, cases: Option<u64>, path: &std::path::Path) -> Tally {
    let seeds = reader.seeds();
    let good = seeds.iter().filter(|seed| seed.good).count();
    let mut tally = Tally::default();
    for seed in &seeds {
        let accepted = case(reader, &seed.bytes, path, DAMAGED, &mut tally);
        assert!(accepted || !seed.good, "{}: the seed {} is refused", reader.name, seed.name);
    }
    assert!(good > 0, "{}: no seed is a good file", reader.name);
    let usual = if SLOW.contains(&reader.name) { SLOW_CASES } else { DAMAGED_CASES };
    let mut number = 0;
    while number < cases.unwrap_or(usual) && tally.faults.len() < 10 {
        let mut random = mutate::Random::new(reader.name, number);
        let mut bytes = mutate::mutated(&seeds, &mut random);
        if reader.file.ends_with(".png") {
            mutate::mend_checksums(&mut bytes);
        }
        case(reader, &bytes, path, DAMAGED, &mut tally);
        number += 1;
    }
    tally
}

/// Runs one case, and returns true if the file was accepted.
fn case(
    reader: &Reader,
    bytes: &[u8],
    path: &std::path::Path,
    most_bytes: usize,
    tally: &mut Tally,
) -> bool {
    *NOW.lock().unwrap() = Some((reader.name.to_owned(), bytes.to_vec()));
    BEGUN.fetch_add(1, Ordering::Relaxed);
    std::fs::write(path, bytes).unwrap();
    let before = memory::begin();
    let begun = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(|| (reader.read)(path, bytes)));
    tally.slowest = tally.slowest.max(begun.elapsed());
    let took_bytes = memory::peak_since(before);
    tally.cases += 1;
    tally.largest = tally.largest.max(took_bytes);
    let fault = match &result {
        Err(_) => Some("a panic".to_owned()),
        Ok(_) if took_bytes > most_bytes => Some(format!("{} MB", took_bytes / 1_000_000)),
        Ok(_) => None,
    };
    if let Some(fault) = fault {
        let name = format!("target/fuzz-{}-{}.bin", reader.name, tally.cases);
        let _ = std::fs::write(&name, bytes);
        tally.faults.push(format!("{}: {fault} on {name}", reader.name));
    }
    let accepted = result.unwrap_or(false);
    tally.accepted += u64::from(accepted);
    accepted
}

/// Aborts the test if a case does not end.
fn watch() {
    std::thread::spawn(|| {
        let mut last = 0;
        loop {
            std::thread::sleep(ENDLESS);
            let begun = BEGUN.load(Ordering::Relaxed);
            if begun == last
                && let Some((reader, bytes)) = &*NOW.lock().unwrap()
            {
                let name = format!("target/fuzz-{reader}-endless.bin");
                let _ = std::fs::write(&name, bytes);
                let _ = writeln!(std::io::stderr(), "{reader}: endless on {name}");
                std::process::exit(101);
            }
            last = begun;
        }
    });
}
