//! Limits: each verb with each input as large as it is accepted, and larger, until it is refused;
//! and with many of the largest. The program runs as a process of its own, of which processor time
//! and memory are measured: where it refuses, 2 s and 300 MB, where it accepts, 1 GB.
//!
//! The test prints the table of `docs/reference/limits.md`. `NOCTOGRAPH_LIMITS=all` takes the cases, too,
//! whose largest inputs take a minute of a core each.
#![cfg(target_os = "linux")]

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::cli::noctograph;

/// Where it refuses.
const REFUSED: Most = Most { cpu_s: 2.0, mb: 300.0 };
/// Where it accepts: no more memory; its time is that of the work.
const ACCEPTED: Most = Most { cpu_s: f64::INFINITY, mb: 1000.0 };
/// Clock ticks of the kernel's accounts a second, on all architectures that we know.
const TICKS_HZ: f64 = 100.0;

/// What a run may take, or took.
#[derive(Clone, Copy)]
struct Most {
    cpu_s: f64,
    mb: f64,
}

/// An order with files that grow.
struct Case {
    /// What grows, as the table names it.
    what: &'static str,
    /// Arguments, of which `@` is the file, and `@*N` the file N times.
    order: &'static str,
    /// Writes the file in a size.
    write: fn(&Path, usize),
    /// Sizes, in the order of the runs.
    sizes: &'static [usize],
    /// How many of them are accepted.
    accepted: usize,
    /// Whether it runs without being asked for.
    usual: bool,
}

const CASES: [Case; 36] = [
    Case {
        what: "SVG, strokes here and there",
        order: "plan --drawing @.svg -o out.csv",
        write: svg,
        sizes: &[300, 9_900, 10_500],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "the same, by four drones",
        order: "plan --drawing @.svg --drones 4 -o out",
        write: svg,
        sizes: &[60, 2_600],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "SVG, strokes, checked",
        order: "check --drawing @.svg",
        write: svg,
        sizes: &[9_900],
        accepted: 0,
        usual: true,
    },
    Case {
        what: "SVG, strokes, exported",
        order: "export --drawing @.svg --to cflib -o out",
        write: svg,
        sizes: &[9_900],
        accepted: 0,
        usual: true,
    },
    Case {
        what: "SVG, bytes",
        order: "plan --drawing @.svg -o out.csv",
        write: |path, n| {
            filled(path, "<svg xmlns='http://www.w3.org/2000/svg'>", "<g/>", n, "</svg>")
        },
        sizes: &[100_000, 8_000_000, 9_000_000],
        accepted: 0,
        usual: true,
    },
    Case {
        what: "letters of a typeface",
        order: "plan @@ --font FONT -o out.csv",
        write: |_, _| {},
        sizes: &[24, 257],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "handwriting, points",
        order: "plan --drawing @.json -o out.csv",
        write: handwriting,
        sizes: &[500, 250_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "progressive JPEG, drawn",
        order: "plan --drawing @.jpg -o out.csv",
        write: jpeg,
        sizes: &[5_200, 5_400, 6_300],
        accepted: 0,
        usual: true,
    },
    Case {
        what: "progressive JPEG, read",
        order: "read @.jpg",
        write: jpeg,
        sizes: &[7_600, 7_800, 20_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "PNG, read",
        order: "read @.png",
        write: png,
        sizes: &[8_192, 8_200],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "PNG, compared",
        order: "compare-photo @.png @.png -o out",
        write: png,
        sizes: &[8_200],
        accepted: 0,
        usual: true,
    },
    Case {
        what: "photo with its scene, scored",
        order: "score @.png I",
        write: png,
        sizes: &[500, 8_200],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "photograph for its EXIF, bytes",
        order: "preview I --camera-from @.jpg -o out",
        write: |path, n| tiff(path, n),
        sizes: &[160 << 20, 200 << 20],
        accepted: 0,
        usual: true,
    },
    Case {
        what: "JSON log, variables",
        order: "import @.json -o out.csv",
        write: log_json,
        sizes: &[900, 100_000, 1_500_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "JSON log, numbers of a variable",
        order: "import @.json -o out.csv",
        write: log_json_long,
        sizes: &[300_000, 12_000_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "CSV log, rows at 1 kHz",
        order: "import @.csv -o out.csv",
        write: log_csv,
        sizes: &[300_000, 4_000_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "the same, identified",
        order: "identify @.csv",
        write: log_csv,
        sizes: &[4_000_000],
        accepted: 0,
        usual: true,
    },
    Case {
        what: "links to a log, an evening",
        order: "import @ -o out",
        write: evening,
        sizes: &[3, 70],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "flight, rows",
        order: "expose @.csv --word I --backend cpu --size 320x180 -o out.png",
        write: flight,
        sizes: &[60_000, 700_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "five flights",
        order: "expose @.csv*5 --word I --backend cpu --size 320x180 -o out.png",
        write: flight,
        sizes: &[250_000, 450_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "flights, compared",
        order: "compare @.csv @.csv -o out",
        write: flight,
        sizes: &[60_000, 700_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "light trace, rows",
        order: "expose @.csv --word I --backend cpu --size 320x180 -o out.png",
        write: light,
        sizes: &[300_000, 5_000_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "plan, rows",
        order: "fly @.csv -o out.csv",
        write: plan,
        sizes: &[2_000, 2_000_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "sixteen plans",
        order: "check @.csv*16",
        write: plan,
        sizes: &[200, 28_000, 110_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "ranges of a drone, rows",
        order: "locate @.csv -o out",
        write: ranges,
        sizes: &[12_000, 360_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "ranges of three drones, rows each",
        order: "locate @.csv*3 -o out",
        write: ranges,
        sizes: &[4_000, 60_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "ranges of eight drones, rows each",
        order: "locate @.csv*8 -o out",
        write: ranges,
        sizes: &[500, 20_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "the largest ranges of one drone",
        order: "locate @.csv -o out",
        write: ranges,
        sizes: &[180_000],
        accepted: 1,
        usual: false,
    },
    Case {
        what: "the largest ranges of three drones",
        order: "locate @.csv*3 -o out",
        write: ranges,
        sizes: &[51_000],
        accepted: 1,
        usual: false,
    },
    Case {
        what: "anchors",
        order: "locate --region --anchors @.yaml",
        write: anchors,
        sizes: &[257, 100_000],
        accepted: 0,
        usual: true,
    },
    Case {
        what: "Lighthouse configuration, bytes",
        order: "coverage --lighthouse @.yaml -o out.svg",
        write: |path, n| filled(path, "geos:\n", "  0: {origin: [0, 0, 2]}\n", n, ""),
        sizes: &[900_000, 1_100_000],
        accepted: 0,
        usual: true,
    },
    Case {
        what: "scene, bytes",
        order: "plan I --scene @.toml -o out.csv",
        write: |path, n| filled(path, "word = \"I\"\n", "# comment\n", n, ""),
        sizes: &[1_000_000, 1_100_000],
        accepted: 1,
        usual: true,
    },
    Case {
        what: "list of words, bytes",
        order: "rank cf21 --words @.txt --seeds 1 -o out",
        write: |path, n| filled(path, "", "WORD\n", n, ""),
        sizes: &[1_100_000],
        accepted: 0,
        usual: true,
    },
    Case {
        what: "conditions, bytes",
        order: "robustness cf21 --conditions @.toml -o out",
        write: |path, n| filled(path, "", "# comment\n", n, ""),
        sizes: &[1_100_000],
        accepted: 0,
        usual: true,
    },
    Case {
        what: "stroke font, letters",
        order: "plan I --font @.strokes -o out.csv",
        write: |path, n| filled(path, "", "I + 0.5,0 0.5,1\n", n, ""),
        sizes: &[4_000_000, 5_000_000],
        accepted: 0,
        usual: true,
    },
    Case {
        what: "stored flights, bytes",
        order: "report @ -o out.html",
        write: store,
        sizes: &[330_000_000],
        accepted: 0,
        usual: true,
    },
];

#[test]
fn every_verb_is_bounded_where_it_refuses_and_where_it_accepts() {
    let all = std::env::var_os("NOCTOGRAPH_LIMITS").is_some();
    let (mut table, mut faults) = (String::new(), String::new());
    table += "| input | order | size | | processor | memory |\n|---|---|---|---|---|---|\n";
    for case in CASES.iter().filter(|case| all || case.usual) {
        for (index, size) in case.sizes.iter().enumerate() {
            let wanted = index < case.accepted;
            let (took, is_accepted, said) = run(case, *size);
            let most = if is_accepted { ACCEPTED } else { REFUSED };
            let word = if is_accepted { "accepted" } else { "refused" };
            let order = case.order.split(" -o").next().unwrap_or_default();
            writeln!(
                table,
                "| {} | `{order}` | {size} | {word} | {:.1} s | {:.0} MB |",
                case.what, took.cpu_s, took.mb
            )
            .unwrap();
            if is_accepted != wanted || took.cpu_s > most.cpu_s || took.mb > most.mb {
                let (cpu_s, mb) = (took.cpu_s, took.mb);
                writeln!(faults, "{}, {size}: {word}, {cpu_s:.1} s, {mb:.0} MB: {said}", case.what)
                    .unwrap();
            }
            assert!(!said.contains("-0 s"), "{said}");
            assert!(is_accepted || said.contains("hint: "), "{}: {said}", case.what);
        }
    }
    std::io::stderr().write_all(table.as_bytes()).unwrap();
    assert!(faults.is_empty(), "{faults}");
}

/// Runs a case in a size: what it took, whether it was accepted, and what it said.
fn run(case: &Case, size: usize) -> (Most, bool, String) {
    let folder = tempfile::tempdir_in("/dev/shm").unwrap();
    (case.write)(&folder.path().join("a"), size);
    let mut order = Vec::new();
    for word in case.order.split(' ') {
        let (word, times) = word.split_once('*').unwrap_or((word, "1"));
        let word = match word {
            "@@" => "@".repeat(size),
            "FONT" => concat!(env!("CARGO_MANIFEST_DIR"), "/fonts/Roboto-Thin.ttf").to_owned(),
            word => word.replace('@', "a"),
        };
        order.extend((0..times.parse().unwrap()).map(|_| word.clone()));
    }
    // The case writes `a`, whatever its ending.
    for ending in ["svg", "json", "jpg", "png", "csv", "yaml", "toml", "txt", "strokes"] {
        if case.order.contains(&format!("@.{ending}")) {
            std::fs::rename(folder.path().join("a"), folder.path().join(format!("a.{ending}")))
                .unwrap();
        }
    }
    let said = folder.path().join("said");
    let mut child = Command::new(noctograph(folder.path()).get_program())
        .args(order)
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(&said).unwrap())
        .spawn()
        .unwrap();
    let took = measured(child.id());
    let code = child.wait().unwrap().code();
    let said = std::fs::read_to_string(said).unwrap();
    assert!(matches!(code, Some(0..=2)), "{} of {size}: {code:?}: {said}", case.what);
    (took, code != Some(2), said)
}

/// Processor time and most memory of a process, from its start until it ends and is waited for.
fn measured(pid: u32) -> Most {
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
        // Of a process that has ended, its time and that of the children that it waited for.
        if fields[0] == "Z" {
            let ticks = fields[11..15].iter().map(|ticks| ticks.parse::<f64>().unwrap());
            return Most { cpu_s: ticks.sum::<f64>() / TICKS_HZ, mb };
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

/// A file of a beginning, as many copies of a piece as it has bytes, and an end.
fn filled(path: &Path, begin: &str, piece: &str, bytes: usize, end: &str) {
    let copies = piece.repeat(bytes / piece.len());
    std::fs::write(path, [begin, &copies, end].concat()).unwrap();
}

/// Rows of a table.
fn table(path: &Path, header: &str, rows: impl Iterator<Item = String>) {
    let mut file = std::io::BufWriter::new(std::fs::File::create(path).unwrap());
    writeln!(file, "{header}").unwrap();
    rows.for_each(|row| writeln!(file, "{row}").unwrap());
}

/// Short strokes at places that are far from each other.
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

/// A progressive JPEG of three components, all gray, in one scan: one bit a block.
fn jpeg(path: &Path, side: usize) {
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

/// A black PNG.
fn png(path: &Path, side: usize) {
    let side = u32::try_from(side).unwrap();
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

/// A TIFF file of zeros, which takes no room on the disk.
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

/// Three variables with all numbers at 1 kHz.
fn log_json_long(path: &Path, n: usize) {
    let times: Vec<String> = (0..n / 6).map(|k| k.to_string()).collect();
    let (times, values) = (times.join(","), vec!["0.1"; n / 6].join(","));
    let place =
        |axis: &str| format!("\"stateEstimate.{axis}\":{{\"time\":[{times}],\"data\":[{values}]}}");
    std::fs::write(path, format!("{{{}}}", ["x", "y", "z"].map(place).join(","))).unwrap();
}

fn log_csv(path: &Path, n: usize) {
    let row = |k: usize| format!("{}.{:03},0.1,0.2,{}", k / 1000, k % 1000, 1 + k % 2);
    table(path, "t,x,y,z", (0..n).map(row));
}

/// A folder of links to one log of 10 MB.
fn evening(folder: &Path, n: usize) {
    std::fs::create_dir(folder).unwrap();
    let log = folder.with_extension("log");
    log_csv(&log, 500_000);
    for k in 0..n {
        std::os::unix::fs::symlink(&log, folder.join(format!("cf-{k}.csv"))).unwrap();
    }
}

/// A flight at 200 Hz that writes one letter.
fn flight(path: &Path, n: usize) {
    let header = "time_s,x_m,y_m,z_m,yaw_rad,pitch_rad,roll_rad,vx_body_m_s,vy_body_m_s,\
                  vz_body_m_s,wx_body_rad_s,wy_body_rad_s,wz_body_rad_s,x_estimate_m,y_estimate_m,\
                  z_estimate_m,x_design_m,y_design_m,z_design_m,m1,m2,m3,m4,letter,light.headlights";
    let row = |k: usize| {
        let (at, x) = (k as f64 / 200.0, 0.001 * (k % 400) as f64);
        format!(
            "{at:.3},{x:.3},0.004321,1.234567,0.001234,0.002345,0.003456,0.123456,0.123456,\
             0.123456,0.012345,0.012345,0.012345,{x:.3},0.004321,1.234567,{x:.3},0.004321,\
             1.234567,34567,34567,34567,34567,1,1"
        )
    };
    table(path, header, (0..n).map(row));
}

fn light(path: &Path, n: usize) {
    let row =
        |k: usize| format!("{:.3},{:.3},0,1,1,0,0", k as f64 / 1000.0, 0.001 * (k % 400) as f64);
    table(path, "t,x,y,z,r,g,b", (0..n).map(row));
}

/// A plan that stands in the air with a setpoint each 50 ms.
fn plan(path: &Path, n: usize) {
    let header = "time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,ax_m_s2,ay_m_s2,az_m_s2,letter,\
                  light.headlights";
    let row = |k: usize| {
        let height_m = if k < 10 || k + 10 > n { 0.0 } else { 0.5 };
        format!("{:.2},0,0,{height_m},0,0,0,0,0,0,0,0", k as f64 / 20.0)
    };
    table(path, header, (0..n).map(row));
}

/// Ranges to eight anchors that contradict each other, at 100 Hz.
fn ranges(path: &Path, n: usize) {
    let header: Vec<String> = (0..8).map(|anchor| format!(",ranging.distance{anchor}")).collect();
    let row = |k: usize| {
        let range = |anchor: usize| format!(",{:.3}", 3.0 + 0.001 * (k * anchor % 97) as f64);
        format!("{:.2}", k as f64 / 100.0) + &(1..=8).map(range).collect::<String>()
    };
    table(path, &format!("t{}", header.concat()), (0..n).map(row));
}

fn anchors(path: &Path, n: usize) {
    let anchor = |k: usize| format!("{k}: {{x: {k}.0, y: 0.0, z: 1.0}}\n");
    std::fs::write(path, (0..n).map(anchor).collect::<String>()).unwrap();
}

/// A study's folder whose file of flights has so many bytes, of which most take no room.
fn store(folder: &Path, bytes: usize) {
    std::fs::create_dir(folder).unwrap();
    std::fs::write(folder.join("study.json"), "{}").unwrap();
    let flights = std::fs::File::create(folder.join("flights.jsonl")).unwrap();
    flights.set_len(bytes as u64).unwrap();
}
