//! Tests of limits. Each verb reads each input at the largest accepted size, and then at sizes that
//! increase fourfold from run to run until the input is refused. The program runs in a separate
//! process, which may use 300 MB of memory to refuse an input and 1 GB to accept one.
//! `tests/fuzz/grow.rs` tests the readers separately.
//!
//! The test prints the table of `docs/reference/limits.md`. The test stops the first run of an
//! input after 0.5 s of processor time, and later runs after a minute, because a run that takes that
//! long has evidently accepted its input. With `NOCTOGRAPH_LIMITS=all`, the first runs are
//! completed.
#![cfg(target_os = "linux")]

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use crate::cli::noctograph;

/// Processor times, in s, after which the first run of an input and each later run, respectively,
/// count as having accepted the input. A larger input is refused sooner, even on a slow machine.
const AT_WORK_CPU_S: [f64; 2] = [0.5, 60.0];
const REFUSED_MB: f64 = 300.0;
const ACCEPTED_MB: f64 = 1000.0;
/// Factor by which an input grows from run to run.
const GROWTH: usize = 4;
/// Number of clock ticks per second in the kernel's process statistics, on all known architectures.
const TICKS_HZ: f64 = 100.0;

/// A case, which consists of a description of what grows, the command, the function that writes a
/// file of a given size, and the size of the first run, which is accepted or refused immediately.
/// In the command, `@` stands for the file, and `@*N` for N copies of its name.
type Case = (&'static str, &'static str, fn(&Path, usize), usize);

#[rustfmt::skip]
const CASES: [Case; 45] = [
    ("SVG, strokes here and there", "plan --drawing @.svg -o out.csv", svg, 9_600),
    ("the same, by four drones", "plan --drawing @.svg --drones 4 -o out", svg, 640),
    ("the same, checked", "check --drawing @.svg", svg, 9_600),
    ("the same, exported", "export --drawing @.svg --to cflib -o out", svg, 9_600),
    ("SVG, bytes", "plan --drawing @.svg -o out.csv", bare_svg, 100_000),
    ("letters of a typeface", "plan @@ --font FONT -o out.csv", nothing, 256),
    ("handwriting, points", "plan --drawing @.json -o out.csv", handwriting, 128_000),
    ("gray progressive JPEG, drawn, pixels", "plan --drawing @.jpg -o out.csv", jpeg, 27_000_000),
    ("progressive JPEG, read, pixels", "read @.jpg", jpeg, 15_000_000),
    ("PNG, read, pixels", "read @.png", png, 64 << 20),
    ("PNG, compared, pixels", "compare-photo @.png @.png -o out", png, 256 << 20),
    ("PNG, scored, pixels", "score @.png I", png, 64 << 20),
    ("photograph without EXIF, bytes", "preview I --camera-from @.jpg -o out", tiff, 40 << 20),
    ("JSON log, variables", "import @.json -o out.csv", log_json, 1_000),
    ("JSON log, numbers of a variable", "import @.json -o out.csv", log_json_long, 4_800_000),
    ("CSV log, rows at 1 kHz", "import @.csv -o out.csv", log_csv, 1_000_000),
    ("the same, without motors, identified", "identify @.csv", log_csv, 250_000),
    ("logs of 10 MB, an evening", "import @ -o out", evening, 48),
    ("links to one log, an evening", "import @ -o out", links, 48),
    ("flight, rows", "expose @.csv --word I --backend cpu --size 320x180 -o out.png", flight, 160_000),
    ("sixteen flights", "expose @.csv*16 --word I --backend cpu --size 320x180 -o out.png", flight, 128_000),
    ("flight, metered", "meter --flight @.csv --word L", flight, 40_000),
    ("flights, compared", "compare @.csv @.csv -o out", flight, 160_000),
    ("light trace, rows", "expose @.csv --word I --backend cpu --size 320x180 -o out.png", light, 1_200_000),
    ("plan, rows", "fly @.csv -o out.csv", plan, 32_000),
    ("plan, exported", "export @.csv --room 9x9x9m --to cflib -o out", plan, 32_000),
    ("sixteen plans", "check @.csv*16", plan, 25_600),
    ("sixty-four plans", "check @.csv*64", plan, 6_400),
    ("ranges of a drone, rows", "locate @.csv -o out", ranges, 160_000),
    ("ranges of three drones, rows each", "locate @.csv*3 -o out", ranges, 16_000),
    ("ranges of eight drones, rows each", "locate @.csv*8 -o out", ranges, 1_600),
    ("Lighthouse configuration, bytes", "coverage --lighthouse @.yaml -o out.svg", stations, 1_040_000),
    ("scene, bytes", "plan I --scene @.toml -o out.csv", scene, 1_040_000),
    ("scene, its gains", "gains --scene @.toml", scene, 1_040_000),
    ("scene, an altitude held", "hold --scene @.toml --runs 2 --scenario calm -o out", scene, 1_040_000),
    ("scene, printed", "scene --scene @.toml", scene, 1_040_000),
    ("scene, tuned", "tune @.toml --words I:1 --budget 40 --test-words O --test-seeds 1 -o out", scene, 1_040_000),
    ("words, ranked", "rank cf21 --words @.txt -o out", words, 5_000),
    ("words, tuned for", "tune cf21 --words @.txt --budget 600000 -o out", words, 1_200),
    ("conditions, ranked, bytes", "rank cf21 --words I --seeds 1 --conditions @.toml -o out", conditions, 1_040_000),
    ("conditions, bytes", "rank cf21 --words I:1 --conditions @.toml -o out", conditions, 1_040_000),
    ("conditions, a spread, bytes", "preview I --spread 2 --size 320x180 --conditions @.toml -o out", conditions, 1_040_000),
    ("stroke font, points of a letter", "plan I --font @.strokes -o out.csv", strokes, 4_000),
    ("stroke font, bytes", "plan I --font @.strokes -o out.csv", comments, 1_100_000),
    ("stored flights, bytes", "report @ -o out.html", store, 80 << 20),
];

#[test]
fn every_verb_is_bounded_where_it_refuses_and_where_it_accepts() {
    let to_the_end = std::env::var_os("NOCTOGRAPH_LIMITS").is_some();
    let mut table =
        "| input | order | accepted | refused | a refusal took |\n|---|---|---|---|---|\n"
            .to_owned();
    let mut faults = String::new();
    for (what, order, write, first) in CASES {
        let (mut size, mut accepted) = (first, String::new());
        let refused = loop {
            let at_work = AT_WORK_CPU_S[usize::from(size > first)];
            let most_cpu_s = if to_the_end { f64::INFINITY } else { at_work };
            let Took { cpu_s, mb, code, said } = run(order, write, size, most_cpu_s);
            let is_refused = code == Some(2);
            let is_fine = match is_refused {
                true => mb <= REFUSED_MB && said.contains("hint: "),
                false => mb <= ACCEPTED_MB,
            };
            let sign = if code.is_none() { "> " } else { "" };
            let took = format!("{sign}{cpu_s:.1} s, {mb:.0} MB");
            if !is_fine || said.contains("-0 s") {
                writeln!(faults, "{what}, {size}: {code:?}, {took}: {said}").unwrap();
            }
            if is_refused {
                break format!("{size} | {took}");
            }
            accepted = format!("{size}: {took}");
            size *= GROWTH;
        };
        let shown = order.split(" -o").next().unwrap_or_default();
        writeln!(table, "| {what} | `{shown}` | {accepted} | {refused} |").unwrap();
    }
    std::io::stderr().write_all(table.as_bytes()).unwrap();
    assert!(faults.is_empty(), "{faults}");
}

/// Time and memory of a run, its exit code (`None` if it was stopped), and its messages.
struct Took {
    cpu_s: f64,
    mb: f64,
    code: Option<i32>,
    said: String,
}

fn run(order: &str, write: fn(&Path, usize), size: usize, most_cpu_s: f64) -> Took {
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    // The file is written with the extension that the command contains.
    let file = order.split([' ', '*']).find(|word| word.starts_with("@.")).unwrap_or("@");
    write(&folder.path().join(file.replacen('@', "a", 1)), size);
    let mut words = Vec::new();
    for word in order.split(' ') {
        let (word, times) = word.split_once('*').unwrap_or((word, "1"));
        let word = match word {
            "@@" => "@".repeat(size),
            "FONT" => concat!(env!("CARGO_MANIFEST_DIR"), "/fonts/Roboto-Thin.ttf").to_owned(),
            word => word.replace('@', "a"),
        };
        words.extend((0..times.parse().unwrap()).map(|_| word.clone()));
    }
    let said = folder.path().join("said");
    let mut child = Command::new(noctograph(folder.path()).get_program())
        .args(words)
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(&said).unwrap())
        .spawn()
        .unwrap();
    let (cpu_s, mb) = measured(&mut child, most_cpu_s);
    let code = child.wait().unwrap().code();
    let said = std::fs::read_to_string(said).unwrap();
    let is_ended = code.is_none() && cpu_s >= most_cpu_s;
    assert!(is_ended || matches!(code, Some(0..=2)), "{order} of {size}: {code:?}: {said}");
    Took { cpu_s, mb, code, said }
}

/// Returns the processor time, in s, and the peak memory of a process, which is monitored until it
/// ends or has used `most_cpu_s`.
fn measured(child: &mut Child, most_cpu_s: f64) -> (f64, f64) {
    let pid = child.id();
    let read = |name: &str| std::fs::read_to_string(format!("/proc/{pid}/{name}"));
    let mut mb = 0.0_f64;
    loop {
        if let Ok(status) = read("status") {
            let most = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
            let kib = most.and_then(|most| most.trim().strip_suffix(" kB")?.trim().parse().ok());
            mb = mb.max(kib.unwrap_or(0.0) * 1024.0 / 1e6);
        }
        let stat = read("stat").unwrap();
        let fields: Vec<&str> = stat[stat.rfind(')').unwrap() + 2..].split(' ').collect();
        // The processor time includes that of child processes for which the process has waited.
        let ticks = fields[11..15].iter().map(|ticks| ticks.parse::<f64>().unwrap());
        let cpu_s = ticks.sum::<f64>() / TICKS_HZ;
        if fields[0] == "Z" {
            return (cpu_s, mb);
        }
        if cpu_s >= most_cpu_s {
            child.kill().unwrap();
            return (cpu_s, mb);
        }
        // Each look costs, so that the first ones are the closest: most refusals are quick.
        std::thread::sleep(std::time::Duration::from_secs_f64((cpu_s / 100.0).max(1e-3)));
    }
}

/// Writes a file that consists of a beginning, copies of a piece up to the given number of bytes,
/// and an end.
fn filled(path: &Path, begin: &str, piece: &str, bytes: usize, end: &str) {
    let copies = piece.repeat(bytes / piece.len());
    std::fs::write(path, [begin, &copies, end].concat()).unwrap();
}

fn nothing(_: &Path, _: usize) {}

fn scene(path: &Path, bytes: usize) {
    filled(path, "preset = \"bzzz\"\nword = \"I\"\n", "# comment\n", bytes, "");
}

fn conditions(path: &Path, bytes: usize) {
    filled(path, "", "# comment\n", bytes, "");
}

fn stations(path: &Path, bytes: usize) {
    let head = "type: lighthouse_system_configuration\nversion: '1'\nsystemType: 2\ngeos:\n  0: \
                {origin: [0.0, 0.0, 2.0], rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, \
                1.0]]}\n";
    filled(path, head, "# comment\n", bytes, "");
}

fn words(path: &Path, n: usize) {
    std::fs::write(path, (0..n).map(|k| format!("W{k}\n")).collect::<String>()).unwrap();
}

fn strokes(path: &Path, n: usize) {
    filled(path, "I +", " 0,0 0,0.001", 12 * n, "\n");
}

fn comments(path: &Path, bytes: usize) {
    filled(path, "I + 0,0 0,1\n", "# comment\n", bytes, "");
}

fn bare_svg(path: &Path, bytes: usize) {
    filled(
        path,
        "<svg xmlns='http://www.w3.org/2000/svg'><path stroke='red' d='M0 0H9'/>",
        "<g/>",
        bytes,
        "</svg>",
    );
}

/// Writes a table from its header and its rows.
fn table(path: &Path, header: &str, rows: impl Iterator<Item = String>) {
    let mut file = std::io::BufWriter::new(std::fs::File::create(path).unwrap());
    writeln!(file, "{header}").unwrap();
    rows.for_each(|row| writeln!(file, "{row}").unwrap());
}

/// Writes a drawing of short strokes that are far apart.
fn svg(path: &Path, n: usize) {
    let at = |k: usize, step: usize, side: usize| k * step % side;
    let d: String =
        (0..n).map(|k| format!("M{} {}h9", at(k, 7_919, 997), at(k, 104_729, 397))).collect();
    let head = "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 1000 400'>";
    std::fs::write(path, format!("{head}<path stroke='red' d='{d}'/></svg>")).unwrap();
}

fn handwriting(path: &Path, n: usize) {
    let point = |k: usize| format!("[{},{}]", k, (k * 7919) % 97);
    let points: Vec<String> = (0..n).map(point).collect();
    std::fs::write(path, format!("{{\"strokes\":[[{}]]}}", points.join(","))).unwrap();
}

/// Writes a progressive JPEG of three gray components in one scan, with one bit per block.
fn jpeg(path: &Path, pixels: usize) {
    let side = pixels.isqrt();
    let side_bytes = u16::try_from(side).unwrap().to_be_bytes();
    let mut bytes = b"\xff\xd8\xff\xdb\0\x43\0".to_vec();
    bytes.extend([1; 64]);
    bytes.extend(b"\xff\xc2\0\x11\x08".iter().chain(&side_bytes).chain(&side_bytes));
    bytes.extend(b"\x03\x01\x11\0\x02\x11\0\x03\x11\0\xff\xc4\0\x14\0\x01");
    bytes.extend([0; 16]);
    bytes.extend(b"\xff\xda\0\x0c\x03\x01\0\x02\0\x03\0\0\0\0");
    bytes.resize(bytes.len() + 3 * side.div_ceil(8) * side.div_ceil(8) / 8 + 1, 0);
    bytes.extend(b"\xff\xd9");
    std::fs::write(path, bytes).unwrap();
}

/// Writes a black PNG.
fn png(path: &Path, pixels: usize) {
    let side = u32::try_from(pixels.isqrt()).unwrap();
    let file = std::io::BufWriter::new(std::fs::File::create(path).unwrap());
    let mut encoder = png::Encoder::new(file, side, side);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fastest);
    let mut writer = encoder.write_header().unwrap();
    let mut stream = writer.stream_writer().unwrap();
    let row = vec![0; 3 * side as usize];
    (0..side).for_each(|_| stream.write_all(&row).unwrap());
    stream.finish().unwrap();
}

/// Writes a sparse TIFF file of zeros, which occupies no space on the disk.
fn tiff(path: &Path, bytes: usize) {
    std::fs::write(path, b"II*\0\x08\0\0\0").unwrap();
    std::fs::OpenOptions::new().write(true).open(path).unwrap().set_len(bytes as u64).unwrap();
}

fn log_json(path: &Path, n: usize) {
    let place = |axis: &str| {
        format!("\"stateEstimate.{axis}\":{{\"time\":[0,10,20,30],\"data\":[0,0.1,0.2,0.3]}}")
    };
    let own = ["x", "y", "z"].map(place).into_iter();
    let more = (0..n).map(|k| format!("\"v{k}\":{{\"time\":[0],\"data\":[1]}}"));
    std::fs::write(path, format!("{{{}}}", own.chain(more).collect::<Vec<_>>().join(","))).unwrap();
}

/// Writes a log of three variables with numbers at 1 kHz.
fn log_json_long(path: &Path, n: usize) {
    let times: Vec<String> = (0..n / 6).map(|k| k.to_string()).collect();
    let (times, values) = (times.join(","), vec!["0.1"; n / 6].join(","));
    let place =
        |axis: &str| format!("\"stateEstimate.{axis}\":{{\"time\":[{times}],\"data\":[{values}]}}");
    std::fs::write(path, format!("{{{}}}", ["x", "y", "z"].map(place).join(","))).unwrap();
}

fn log_csv(path: &Path, n: usize) {
    let row = |k: usize| format!("{}.{:03},0.1,0.2,1.00{}", k / 1000, k % 1000, k % 2);
    table(path, "t,x,y,z", (0..n).map(row));
}

/// Writes a folder of logs of 10 MB each.
fn evening(folder: &Path, n: usize) {
    std::fs::create_dir(folder).unwrap();
    let first = folder.join("cf-0.csv");
    log_csv(&first, 500_000);
    (1..n).for_each(|k| drop(std::fs::copy(&first, folder.join(format!("cf-{k}.csv")))));
}

/// Writes a folder of links to one log of 10 MB.
fn links(folder: &Path, n: usize) {
    std::fs::create_dir(folder).unwrap();
    let log = folder.with_extension("log");
    log_csv(&log, 500_000);
    for k in 0..n {
        std::os::unix::fs::symlink(&log, folder.join(format!("cf-{k}.csv"))).unwrap();
    }
}

/// Writes a flight of one letter, sampled at 200 Hz.
fn flight(path: &Path, n: usize) {
    let header = "time_s,x_m,y_m,z_m,yaw_rad,pitch_rad,roll_rad,vx_body_m_s,vy_body_m_s,\
                  vz_body_m_s,wx_body_rad_s,wy_body_rad_s,wz_body_rad_s,x_estimate_m,y_estimate_m,\
                  z_estimate_m,x_design_m,y_design_m,z_design_m,m1,m2,m3,m4,letter,light.headlights";
    let row = |k: usize| {
        let (at, x) = (k as f64 / 200.0, 0.001 * (k % 400) as f64);
        format!(
            "{at:.3},{x:.3},0.004321,0.834567,0.001234,0.002345,0.003456,0.123456,0.123456,\
             0.123456,0.012345,0.012345,0.012345,{x:.3},0.004321,0.834567,{x:.3},0.004321,\
             0.834567,34567,34567,34567,34567,1,1"
        )
    };
    table(path, header, (0..n).map(row));
}

fn light(path: &Path, n: usize) {
    let row =
        |k: usize| format!("{:.3},{:.3},0,1,1,0,0", k as f64 / 1000.0, 0.001 * (k % 400) as f64);
    table(path, "t,x,y,z,r,g,b", (0..n).map(row));
}

/// Writes a plan to hover, with a setpoint every 50 ms.
fn plan(path: &Path, n: usize) {
    let header = "time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,ax_m_s2,ay_m_s2,az_m_s2,letter,\
                  light.headlights";
    let row = |k: usize| {
        let height_m = if k < 10 || k + 10 > n { 0.0 } else { 0.5 };
        format!("{:.2},0,0,{height_m},0,0,0,0,0,0,0,0", k as f64 / 20.0)
    };
    table(path, header, (0..n).map(row));
}

/// Writes contradictory ranges to eight anchors at 100 Hz.
fn ranges(path: &Path, n: usize) {
    let header: Vec<String> = (0..8).map(|anchor| format!(",ranging.distance{anchor}")).collect();
    let row = |k: usize| {
        let range = |anchor: usize| format!(",{:.3}", 3.0 + 0.001 * (k * anchor % 97) as f64);
        format!("{:.2}", k as f64 / 100.0) + &(1..=8).map(range).collect::<String>()
    };
    table(path, &format!("t{}", header.concat()), (0..n).map(row));
}

/// Writes a study's folder whose sparse file of flights has the given number of bytes.
fn store(folder: &Path, bytes: usize) {
    std::fs::create_dir(folder).unwrap();
    std::fs::write(folder.join("study.json"), "{}").unwrap();
    let flights = std::fs::File::create(folder.join("flights.jsonl")).unwrap();
    flights.set_len(bytes as u64).unwrap();
}
