//! A mutator for every reader of the program: damaged and hostile files, each within a budget of
//! time and memory, none of them a panic.
//!
//! `cargo test --release --test fuzz` spends some 20 s. Two environment variables take it further:
//! `NOCTOGRAPH_FUZZ_CASES` cases of each reader instead, and `NOCTOGRAPH_FUZZ_ONLY` one reader.
//! Case `n` of a reader is the same bytes on every machine. A failure leaves its input under
//! `target/`; give it a name in `tests/fuzz/seeds/READER/` when the fault is mended.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

mod memory;
mod mutate;
mod readers;

use readers::Reader;

/// Most processor time of a case.
const MAX_CASE: Duration = Duration::from_secs(1);
/// Most memory that a case may take at a time.
const MAX_BYTES: usize = 256 << 20;
/// Time for each reader where no number of cases is asked for.
const SHARE: Duration = Duration::from_millis(1200);
/// Fewest cases even on a slow machine.
const FEWEST: u64 = 20;
/// Time of a case that passes for its processor time, which costs more to ask for.
const SHORT: Duration = Duration::from_millis(20);
/// Time after which a case counts as endless.
const ENDLESS: Duration = Duration::from_secs(120);

/// What is being read now, for the watchdog.
static NOW: Mutex<Option<(String, Vec<u8>)>> = Mutex::new(None);
/// Number of cases begun.
static BEGUN: AtomicU64 = AtomicU64::new(0);

/// What was measured of a reader.
#[derive(Default)]
struct Tally {
    cases: u64,
    accepted: u64,
    slowest: Duration,
    largest: usize,
    faults: Vec<String>,
    clock: Clock,
}

/// Processor time of cases, which a busy machine does not stretch.
#[derive(Default)]
struct Clock {
    /// Cases and processor time since then, which those cases share.
    since: Duration,
    cases: u32,
}

impl Clock {
    /// Processor time of a case, at most; `elapsed` is its time by the wall.
    fn took(&mut self, elapsed: Duration) -> Duration {
        self.cases += 1;
        if elapsed < SHORT && self.cases < 64 {
            return elapsed;
        }
        let now = processor_time();
        let took = elapsed.min(now.saturating_sub(self.since));
        *self = Self { since: now, cases: 0 };
        took
    }
}

#[test]
fn no_file_hurts_its_reader() {
    std::panic::set_hook(Box::new(|_| {}));
    watch();
    let cases = std::env::var("NOCTOGRAPH_FUZZ_CASES").ok().map(|n| n.parse::<u64>().unwrap());
    let only = std::env::var("NOCTOGRAPH_FUZZ_ONLY").ok();
    let folder = tempfile::tempdir_in(if cfg!(target_os = "linux") { "/dev/shm" } else { "." });
    let folder = folder.or_else(|_| tempfile::tempdir()).unwrap();
    let mut faults = Vec::new();
    let mut out = std::io::stderr();
    writeln!(out, "reader             cases   accepted   slowest ms   largest MB").unwrap();
    for reader in readers::all() {
        if only.as_ref().is_some_and(|only| *only != reader.name) {
            continue;
        }
        let path = folder.path().join(reader.file);
        let tally = fuzz(&reader, cases, &path);
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

/// Reads a reader's seeds and then what mutation makes of them.
fn fuzz(reader: &Reader, cases: Option<u64>, path: &std::path::Path) -> Tally {
    let seeds = reader.seeds();
    let good = seeds.iter().filter(|seed| seed.good).count();
    let mut tally = Tally::default();
    for seed in &seeds {
        let accepted = case(reader, &seed.bytes, path, &mut tally);
        assert!(accepted || !seed.good, "{}: the seed {} is refused", reader.name, seed.name);
    }
    assert!(good > 0, "{}: no seed is a good file", reader.name);
    let begun = Instant::now();
    let done = |n: u64| match cases {
        Some(cases) => n >= cases,
        None => n >= FEWEST && begun.elapsed() > SHARE,
    };
    let mut number = 0;
    while !done(number) && tally.faults.len() < 10 {
        let mut random = mutate::Random::new(reader.name, number);
        let mut bytes = mutate::mutated(&seeds, &mut random);
        if reader.file.ends_with(".png") {
            mutate::mend_checksums(&mut bytes);
        }
        case(reader, &bytes, path, &mut tally);
        number += 1;
    }
    tally
}

/// One case; whether the file was accepted.
fn case(reader: &Reader, bytes: &[u8], path: &std::path::Path, tally: &mut Tally) -> bool {
    *NOW.lock().unwrap() = Some((reader.name.to_owned(), bytes.to_vec()));
    BEGUN.fetch_add(1, Ordering::Relaxed);
    std::fs::write(path, bytes).unwrap();
    let before = memory::begin();
    let begun = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(|| (reader.read)(path, bytes)));
    let took = tally.clock.took(begun.elapsed());
    let took_bytes = memory::peak_since(before);
    tally.cases += 1;
    tally.slowest = tally.slowest.max(took);
    tally.largest = tally.largest.max(took_bytes);
    let fault = match &result {
        Err(_) => Some("a panic".to_owned()),
        Ok(_) if took > MAX_CASE => Some(format!("{:.1} s", took.as_secs_f64())),
        Ok(_) if took_bytes > MAX_BYTES => Some(format!("{} MB", took_bytes / 1_000_000)),
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

/// Processor time of this thread.
fn processor_time() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    match text.split(' ').next().and_then(|ns| ns.parse().ok()) {
        Some(ns) => Duration::from_nanos(ns),
        None => {
            static BEGUN: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
            BEGUN.elapsed()
        }
    }
}

/// Ends the test where a case has no end.
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
