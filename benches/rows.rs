//! Measures the time that a user waits, relative to a fixed computation that is measured at the
//! same time, so that figures from different machines or days can be compared.
//!
//! Run it with `cargo bench -p noctograph-benches --bench rows`. The benchmark uses one thread and
//! no graphics card. Each figure is the minimum of [`ROUNDS`] rounds, because other work on the
//! machine can only increase a time. In each round, the fixed work runs before every row.
//! `tests/speed` limits the number of instructions of each row.
#![expect(clippy::disallowed_methods, reason = "our own files")]
#![expect(clippy::print_stdout, reason = "a table for people")]

use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use noctograph::cli::report_of;

const ROUNDS: usize = 7;

/// Number of flights in the row for a study.
const FLIGHTS: usize = 8;

/// Name of a row, its command, and the number of times that the command performs the named work.
type Row = (&'static str, String, usize);

fn rows(folder: &Path) -> Vec<Row> {
    let path = |name: &str| folder.join(name).display().to_string();
    let [trace, photo, noor] = ["trace.csv", "photo.png", "noor"].map(path);
    let [seen, study] = ["noor/photo.png", "study"].map(path);
    vec![
        ("light trace to PNG", format!("expose {trace} --word NOOR --backend cpu -o {photo}"), 1),
        ("preview", format!("preview NOOR --backend cpu -o {noor}"), 1),
        ("check HELLO", "check HELLO".to_owned(), 1),
        ("a scored flight", format!("rank cf21 --words NOOR:{FLIGHTS} -o {study}"), FLIGHTS),
        ("score", format!("score {seen}"), 1),
        ("read", format!("read {seen}"), 1),
    ]
}

/// Returns a light trace of 40 s at 1 kHz in three colors.
fn trace() -> String {
    let mut csv = "t,x,y,z,r,g,b\n".to_owned();
    for i in 0..40_000 {
        let t = f64::from(i) / 1000.0;
        let (x, z) = (1.2 * libm::sin(0.23 * t), 1.0 + 0.4 * libm::cos(0.71 * t));
        let color = ["1,0.55,0.12", "0.15,0.45,1", "0,0,0"][i as usize / 4000 % 3];
        csv += &format!("{t:.3},{x:.6},{:.6},{z:.6},{color}\n", 0.01 * libm::sin(5.0 * t));
    }
    csv
}

/// Runs a fixed computation of sums, products and memory accesses, which takes several tens of
/// milliseconds and does not depend on the program, and returns its time in s.
fn fixed_work() -> f64 {
    let mut values = vec![1.0_f64; 1 << 19];
    let mut state = 1_u64;
    for _ in 0..40 {
        for value in &mut values {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            *value = *value * 0.999 + (state >> 40) as f64;
        }
    }
    values.iter().sum()
}

fn seconds(work: impl FnOnce()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64()
}

fn run(words: &str) {
    let words: Vec<String> =
        words.split(' ').chain(["--threads", "1"]).map(str::to_owned).collect();
    black_box(report_of(&words).expect("the verb runs"));
}

/// Returns the peak memory, in MB, of a separate process that runs `preview`, or `None` if the
/// system does not report it.
fn memory_mb(folder: &Path) -> Option<f64> {
    let program = std::env::current_exe().ok()?;
    let output = Command::new(program).arg("--memory-of-preview").arg(folder).output().ok()?;
    let kb: f64 = String::from_utf8(output.stdout).ok()?.lines().last()?.trim().parse().ok()?;
    Some(kb / 1e3)
}

fn main() {
    let folder = std::env::temp_dir().join(format!("noctograph-rows-{}", std::process::id()));
    if let Some(index) = std::env::args().position(|word| word == "--memory-of-preview") {
        let folder = std::env::args().nth(index + 1).expect("the folder");
        run(&format!("preview NOOR --backend cpu -o {folder}/noor"));
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let most = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        println!("{}", most.map_or("", |kb| kb.trim_end_matches("kB").trim()));
        return;
    }
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join("trace.csv"), trace()).expect("a file");
    println!("{:22}{:>10}{:>14}", "", "ms", "fixed works");
    for (name, words, times) in rows(&folder) {
        let round = |_| {
            let _ = std::fs::remove_dir_all(folder.join("study"));
            let fixed_s = seconds(|| _ = black_box(fixed_work()));
            [fixed_s, seconds(|| run(&words)) / times as f64]
        };
        let rounds: Vec<[f64; 2]> = (0..ROUNDS).map(round).collect();
        let least =
            |row: usize| rounds.iter().map(|round| round[row]).fold(f64::INFINITY, f64::min);
        let [fixed_s, row_s] = [0, 1].map(least);
        println!("{name:22}{:10.1}{:14.2}", 1e3 * row_s, row_s / fixed_s);
    }
    if let Some(mb) = memory_mb(&folder) {
        println!("{:22}{mb:10.1} MB", "memory of preview");
    }
    std::fs::remove_dir_all(&folder).expect("it is ours");
}
