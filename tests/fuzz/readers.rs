//! The readers, with valid files as seeds.

use std::path::{Path, PathBuf};

use noctograph::camera::CameraOptions;
use noctograph::flight::{Flight, FlightSample};
use noctograph::letters::{Ink, LetterOptions, Pace, Strokes, Trace, draw, write};
use noctograph::light::csv::read as read_light;
use noctograph::light::{LightOptions, light};
use noctograph::logs::{Damaged, ImportOptions, import};
use noctograph::photo::{self, Metadata, Photo, PhotoData, taken_as};
use noctograph::plan::{Plan, PlanOptions, plan};
use noctograph::scene::{Preset, Scene};
use noctograph::sensors::{read_anchors, read_lighthouse_config};
use noctograph::sim::{Drone, SimOptions, fly};
use noctograph::studies::{Conditions, Store};

/// A reader of files.
pub(crate) struct Reader {
    pub(crate) name: &'static str,
    /// Name of the file, whose extension may determine how it is read.
    pub(crate) file: &'static str,
    /// Function that reads a file, which is also passed as bytes, and returns true if it is
    /// accepted.
    pub(crate) read: fn(&Path, &[u8]) -> bool,
    pub(crate) good: fn() -> Vec<Vec<u8>>,
}

/// A file from which mutations start.
pub(crate) struct Seed {
    pub(crate) name: String,
    pub(crate) bytes: Vec<u8>,
    /// True if the file must be accepted. A file of a past failure may also be refused.
    pub(crate) good: bool,
}

impl Reader {
    /// Returns the valid files, and files on which the reader failed in the past.
    pub(crate) fn seeds(&self) -> Vec<Seed> {
        let good = (self.good)().into_iter().enumerate();
        let good = good.map(|(n, bytes)| Seed { name: format!("good {n}"), bytes, good: true });
        let folder = repository().join("tests/fuzz/seeds").join(self.name);
        let entries = std::fs::read_dir(folder).into_iter().flatten();
        let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        paths.sort();
        let failed = paths.into_iter().map(|path| Seed {
            bytes: std::fs::read(&path).unwrap(),
            name: path.display().to_string(),
            good: false,
        });
        good.chain(failed).collect()
    }
}

fn text(bytes: &[u8]) -> Option<&str> {
    std::str::from_utf8(bytes).ok()
}

/// Imports a log. Half of the logs are recovered if they are damaged.
fn log(path: &Path, bytes: &[u8]) -> bool {
    let damaged = if bytes.len().is_multiple_of(2) { Damaged::Refuse } else { Damaged::Recover };
    import(path, &ImportOptions { damaged, ..ImportOptions::default() }).is_ok()
}

/// Reads a folder that contains the same file eight times.
fn folder(path: &Path, bytes: &[u8]) -> bool {
    let folder = path.with_extension("folder");
    std::fs::create_dir_all(&folder).unwrap();
    (0..8).for_each(|n| std::fs::write(folder.join(format!("{n}.csv")), bytes).unwrap());
    import(&folder, &ImportOptions::default()).is_ok()
}

fn drawing(path: &Path, _: &[u8]) -> bool {
    let options = LetterOptions { pace: Pace::Written, ..LetterOptions::default() };
    draw(path, &options, Ink::ByColor).is_ok_and(finite)
}

/// Writes a word in a typeface. Only an eighth of the typefaces are traced along their center
/// lines, because tracing takes most of the time.
fn word(path: &Path, bytes: &[u8]) -> bool {
    let font = path.display().to_string();
    let trace = if bytes.len().is_multiple_of(8) { Trace::CenterLine } else { Trace::Outline };
    let options = LetterOptions { font, trace, ..LetterOptions::default() };
    // One of the texts requires shaping, and the other is set letter by letter.
    let text = if bytes.len().is_multiple_of(3) { "fiA\u{200d}O" } else { "AO" };
    write(text, &options).is_ok_and(finite)
}

fn finite(strokes: Strokes) -> bool {
    let steps = strokes.glyphs.iter().flat_map(|glyph| &glyph.moves);
    let whole = steps.flat_map(|step| [step.from_m, step.to_m]).flatten().all(f64::is_finite);
    assert!(whole, "every stroke has a place");
    let mut paces = strokes.glyphs.iter().flat_map(|glyph| &glyph.moves).map(|step| step.pace);
    assert!(paces.all(|pace| pace > 0.0 && pace <= 1.0), "and a pace");
    true
}

/// Reads a flight and computes its light. An excessive duration would make this expensive.
fn flight(_: &Path, bytes: &[u8]) -> bool {
    let Ok(flight) = Flight::parse_csv(bytes, "flight.csv") else { return false };
    let _ = light(&flight, &LightOptions::default(), 0, 0);
    true
}

fn photo(path: &Path, _: &[u8]) -> bool {
    photo::read(path).is_ok()
}

fn embedded(path: &Path, _: &[u8]) -> bool {
    let Ok((photo, _)) = photo::read_with_notes(path) else { return false };
    photo.into_data().scene_toml.is_some_and(|toml| Scene::parse(&toml, "photo.png").is_ok())
}

/// Returns all readers.
pub(crate) fn all() -> Vec<Reader> {
    let reader = |name, file, read, good| Reader { name, file, read, good };
    vec![
        reader(
            "scene",
            "scene.toml",
            |_, b| text(b).is_some_and(|t| Scene::parse(t, "s").is_ok()),
            scenes,
        ),
        reader("strokes", "font.strokes", word, || {
            vec![letters("fonts/simplex.strokes"), letters("fonts/ae483.strokes")]
        }),
        reader("typeface", "font.ttf", word, || vec![file("fonts/Roboto-Thin.ttf")]),
        reader("svg", "a.svg", drawing, || SVG.map(|svg| svg.as_bytes().to_vec()).to_vec()),
        reader("picture", "a.jpg", drawing, || vec![sketch()]),
        reader("handwriting", "a.json", drawing, || vec![PAGE.into()]),
        reader("log-json", "log.json", log, || vec![log_json()]),
        reader("log-lines", "log.jsonl", log, || vec![log_lines()]),
        reader("log-cfclient", "log.csv", log, || vec![CFCLIENT.into()]),
        reader("log-usd", "log00", log, || vec![log_usd(1), log_usd(2)]),
        reader("log-csv", "log.csv", log, || vec![PLAIN.into(), RANGES.into()]),
        reader("log-folder", "log.csv", folder, || vec![CFCLIENT.into()]),
        reader("flight", "flight.csv", flight, || vec![flight_csv()]),
        reader("plan", "plan.csv", |_, b| Plan::parse_csv(b, "p").is_ok(), || vec![plan_csv()]),
        reader("light", "light.csv", |_, b| read_light(b, "l").is_ok(), || vec![LIGHT.into()]),
        reader("png", "photo.png", photo, pngs),
        reader("jpeg", "photo.jpg", photo, || vec![jpeg()]),
        reader(
            "exif",
            "photo.jpg",
            |p, _| taken_as(CameraOptions::default(), p).is_ok(),
            || vec![jpeg()],
        ),
        reader("embedded", "photo.png", embedded, || vec![shot()]),
        reader("store", "flights.jsonl", |p, _| Store::read(p).is_ok(), || vec![STORE.into()]),
        reader(
            "lighthouse",
            "lh.yaml",
            |p, _| read_lighthouse_config(p).is_ok(),
            || vec![LIGHTHOUSE.into()],
        ),
        reader("anchors", "anchors.yaml", |p, _| read_anchors(p).is_ok(), || vec![ANCHORS.into()]),
        reader(
            "conditions",
            "conditions.toml",
            |_, b| text(b).is_some_and(|t| Conditions::parse(t, "c").is_ok()),
            || vec![CONDITIONS.into()],
        ),
    ]
}

fn file(path: &str) -> Vec<u8> {
    std::fs::read(repository().join(path)).unwrap()
}

/// Returns the root folder of the repository, which also contains the package of `libfuzzer`.
fn repository() -> &'static Path {
    let mut folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    folders.find(|folder| folder.join("fonts").is_dir()).unwrap()
}

/// Returns the capitals of a stroke font.
fn letters(path: &str) -> Vec<u8> {
    let font = String::from_utf8(file(path)).unwrap();
    let kept =
        |line: &&str| line.starts_with("cap") || line.starts_with(|c: char| c.is_ascii_uppercase());
    font.lines().filter(kept).flat_map(|line| [line, "\n"]).collect::<String>().into_bytes()
}

fn scenes() -> Vec<Vec<u8>> {
    let small = "word = \"NO\"\n[plan]\nstyle = \"even\"\n\
                 [camera.framing]\nkind = \"fixed\"\nposition_m = [0.0, -3.0, 1.0]\n";
    vec![Scene::preset(Preset::default()).to_toml().into_bytes(), small.into()]
}

fn planned() -> Plan {
    let options = PlanOptions { setpoint_interval_s: 1.0, ..PlanOptions::default() };
    plan(&write("I", &LetterOptions::default()).unwrap(), &options).unwrap()
}

fn plan_csv() -> Vec<u8> {
    let mut csv = Vec::new();
    planned().write_csv(&mut csv).unwrap();
    csv
}

fn flown() -> Flight {
    let mut options = SimOptions::default();
    options.rates.log_hz = 2;
    fly(&planned(), &Drone::new(&options, 1), &mut |_| {}).unwrap()
}

fn flight_csv() -> Vec<u8> {
    let mut csv = Vec::new();
    flown().write_csv(&mut csv).unwrap();
    csv
}

type Variable = (&'static str, fn(&FlightSample) -> f64);

const VARIABLES: [Variable; 6] = [
    ("stateEstimate.x", |s| s.position_m.x),
    ("stateEstimate.y", |s| s.position_m.y),
    ("stateEstimate.z", |s| s.position_m.z),
    ("stateEstimate.yaw", |s| s.attitude.yaw_rad),
    ("ctrltarget.x", |s| s.design_m.x),
    ("motor.m1", |s| s.motors[0].round()),
];

fn log_json() -> Vec<u8> {
    let flight = flown();
    let stamps: Vec<f64> = flight.samples.iter().map(|s| (1e3 * s.time_s).round()).collect();
    let variables = VARIABLES.map(|(name, value)| {
        let data: Vec<f64> = flight.samples.iter().map(value).collect();
        format!("\"{name}\": {{\"time\": {stamps:?}, \"data\": {data:?}}}")
    });
    format!("{{{}}}", variables.join(",\n")).into_bytes()
}

/// Returns the log that an exported script writes during a flight.
fn log_lines() -> Vec<u8> {
    let mut text = "{\"noctograph\": {\"firmware\": \"2026.08\"}}\n".to_owned();
    for sample in &flown().samples {
        let values = VARIABLES.map(|(name, value)| format!("\"{name}\": {:?}", value(sample)));
        let stamp_ms = (1e3 * sample.time_s).round();
        text += &format!("{{\"time\": {stamp_ms}, {}}}\n", values.join(", "));
    }
    text.into_bytes()
}

fn log_usd(version: u16) -> Vec<u8> {
    let mut bytes = vec![0xBC];
    bytes.extend(version.to_le_bytes());
    bytes.extend(1_u16.to_le_bytes());
    bytes.extend(7_u16.to_le_bytes());
    bytes.extend(b"fixed\0");
    bytes.extend(u16::try_from(VARIABLES.len()).unwrap().to_le_bytes());
    VARIABLES.iter().for_each(|(name, _)| bytes.extend(format!("{name}(f)\0").as_bytes()));
    for sample in &flown().samples {
        bytes.extend(7_u16.to_le_bytes());
        #[expect(clippy::cast_possible_truncation, reason = "a short flight")]
        let ms = (1e3 * sample.time_s) as u32;
        match version {
            1 => bytes.extend(ms.to_le_bytes()),
            _ => bytes.extend((u64::from(ms) * 1000).to_le_bytes()),
        }
        #[expect(clippy::cast_possible_truncation, reason = "the log's width")]
        VARIABLES.iter().for_each(|(_, value)| bytes.extend((value(sample) as f32).to_le_bytes()));
    }
    let crc = crc32fast::hash(&bytes);
    bytes.extend(crc.to_le_bytes());
    bytes
}

/// Returns small pictures of every color type.
fn pngs() -> Vec<Vec<u8>> {
    use png::{BitDepth, ColorType};
    let kinds = [
        (ColorType::Rgb, BitDepth::Eight),
        (ColorType::Rgba, BitDepth::Sixteen),
        (ColorType::Grayscale, BitDepth::Two),
        (ColorType::Indexed, BitDepth::Eight),
    ];
    let encode = |(color, depth)| {
        let mut file = Vec::new();
        let mut info = png::Info::with_size(9, 7);
        (info.color_type, info.bit_depth) = (color, depth);
        info.palette = (color == ColorType::Indexed).then(|| vec![7; 768].into());
        let n = info.raw_bytes() - 7;
        let encoder = png::Encoder::with_info(&mut file, info).unwrap();
        encoder.write_header().unwrap().write_image_data(&vec![85; n]).unwrap();
        file
    };
    kinds.into_iter().map(encode).chain([shot()]).collect()
}

/// Returns a photo with its scene, as `preview` writes it.
fn shot() -> Vec<u8> {
    let (width_px, height_px) = (16, 9);
    let scene_toml = Some("word = \"NO\"\nseed = 7\n[camera]\niso = 200\n".to_owned());
    let photo =
        Photo::made(PhotoData { width_px, height_px, rgb8: vec![9; 16 * 9 * 3], scene_toml });
    let camera = CameraOptions::default().camera([0.0, 0.5, 1.0, 1.0], 46.0).unwrap();
    let notes = [("noctograph.flight_sha256", "0123".repeat(16))];
    photo::encode_png(&photo, Some(&Metadata::new(&camera, &photo.rgb8)), &notes)
}

/// Returns a picture of a cross on paper.
fn sketch() -> Vec<u8> {
    let is_ink = |x: u32, y: u32| x.abs_diff(y) < 3 || x.abs_diff(63 - y) < 3;
    let gray = (0..64 * 64).map(|at| if is_ink(at % 64, at / 64) { 30 } else { 230 });
    let mut bytes = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new(&mut bytes);
    let gray: Vec<u8> = gray.collect();
    image::ImageEncoder::write_image(encoder, &gray, 64, 64, image::ExtendedColorType::L8).unwrap();
    bytes
}

fn jpeg() -> Vec<u8> {
    let mut bytes = Vec::new();
    let gray: Vec<u8> = (0..=255).collect();
    let encoder = image::codecs::jpeg::JpegEncoder::new(&mut bytes);
    image::ImageEncoder::write_image(encoder, &gray, 16, 16, image::ExtendedColorType::L8).unwrap();
    let png = shot();
    let at = png.windows(4).position(|kind| kind == b"eXIf").unwrap();
    let length = u32::from_be_bytes(png[at - 4..at].try_into().unwrap()) as usize;
    let exif = [b"Exif\0\0", &png[at + 4..at + 4 + length]].concat();
    let length = u16::try_from(exif.len() + 2).unwrap().to_be_bytes();
    bytes.splice(2..2, [&[0xff, 0xe1][..], &length, &exif].concat());
    bytes
}

const SVG: [&str; 5] = [
    "<!DOCTYPE svg [<!ENTITY a 'red'><!ENTITY b '&a;'>]><svg xmlns='http://www.w3.org/2000/svg'
    xmlns:x='y' width='9' height='9'><style>.a, g > path { stroke: &b;; stroke-width: 2px }
    /* c */ #b:hover { fill: none } @media x { a { b: c } }</style><desc>&b; &a;</desc>
    <g class='a b' style='stroke-width:3;fill:none'><path d='M0 0h9v9' x:c='d'/></g></svg>",
    "<svg xmlns='http://www.w3.org/2000/svg' xmlns:xlink='http://www.w3.org/1999/xlink' viewBox='0 0 60 60'>
    <style>path { stroke: red } .a, #b { fill: none }</style><defs><path id='a' class='a'
    d='M0,0 C10,20 30-40 50,5 Q1,2 3,4 A5 6 30 0 1 9,9 Z'/></defs>
    <g transform='rotate(30 5 5) skewX(10) matrix(1,0,0,1,5,5)' style='stroke:#f00;stroke-width:2'>
    <use xlink:href='#a' x='5'/><ellipse cx='5' cy='7' rx='3' ry='4'/><polygon points='0,0 5,5 9,0'/></g>
    <marker id='m'><path d='M0 0h3'/></marker><polyline points='1 1 9 3' marker-end='url(#m)'
    stroke='red' stroke-dasharray='2 1'/><clipPath id='c'><rect width='9' height='9'/></clipPath></svg>",
    "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 60 60'><linearGradient id='g' x2='50'
    gradientUnits='userSpaceOnUse' gradientTransform='rotate(9)'><stop stop-color='red'/><stop
    offset='.5' stop-color='#0f0'/></linearGradient><radialGradient id='r' href='#g' cx='9' r='20'
    spreadMethod='reflect'/><path d='M0 0h50v9' stroke='url(#g)'/><g style='font-size:9pt;fill:red'>
    <text x='5' y='9' display='none'>N O<tspan x='7' fill='url(#r)'>OR</tspan></text></g></svg>",
    "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 60 60'><style>:root{--i:#000;--w:3px}
    .a{stroke:var(--i, red);transform:translate(5px,2px) rotate(.1turn)}</style>
    <clipPath id='c'><circle cx='20' cy='9' r='9'/></clipPath><mask id='m' maskUnits='userSpaceOnUse'
    width='60' height='60'><rect width='30' height='60' fill='#fff'/></mask><g mask='url(#m)'>
    <path class='a' clip-path='url(#c)' d='M0 5H60M9 9h0' stroke-linecap='round' fill='none'/></g>
    <svg x='5' y='5' width='9' height='9'><path d='M0 0L20 20' stroke='red' pathLength='4'
    stroke-dasharray='1'/></svg><rect x='5' width='20' height='30' fill='#fff'/><circle r='9'/></svg>",
    "<!DOCTYPE svg [<!ENTITY ns 'http://www.w3.org/2000/svg'>]><svg xmlns='&ns;' width='9' height='9'>
    <path d='M0 0h9v9' stroke='red'/></svg>",
];

const PAGE: &str = "{\"strokes\": [[[0, 0, 1], [10, 10, 1.5]], [[5, 0, 3], [5, 10, 4]], \
                    [[7, 7, 5]]], \"y\": \"down\", \"other\": null}";

const CFCLIENT: &str = "Timestamp,stateEstimate.x,stateEstimate.y,stateEstimate.z,stateEstimate.yaw\n\
                        1000,0.0,0.1,0.2,0.5\n1100,0.1,0.1,0.3,0.5\n1200,0.2,0.1,0.4,0.6\n\
                        1300,0.3,0.1,0.5,0.6\n1400,0.4,0.1,0.6,0.7\n";

const PLAIN: &str = "# t;x;y;z;yaw;pitch;roll;battery\n0.0;0;0;0.1;0;0;0;4.2\n0.1;0.1;0;0.2;0;0;0;4.1\n\
                     0.2;0.2;0;0.3;0;0;0;4.1\n0.3;0.3;0;0.4;0;0;0;4.0\n";

const RANGES: &str =
    "t,x,y,z,range0,range1\n0.0,0,0,1,1.0,2.0\n0.1,0.1,0,1,1.1,2.1\n0.2,0.2,0,1,1.2,2.2\n";

const LIGHT: &str = "t,x,y,z,r,g,b,u\n0,0,0,1,0,0,0,9\n0.5,0.1,0,1,1,0.5,0,9\n1,0.2,0,1,0.5,0.25,0,9\n\
                     1.5,0.3,0,1,0,0,0,9\n2,0.4,0,1,0,0,0,9\n2.5,0.5,0,1,0,0,2,9\n3,0.6,0,1,0,1,0,9\n";

const STORE: &str = "{\"scene\":\"0123\",\"contender\":\"team\",\"word\":\"NOOR\",\"seed\":1,\"read\":\"NOOR\",\
    \"all_read\":true,\"legible\":true,\"probability\":0.9,\"log_odds\":2.2,\"similarity\":0.8,\"contour_m\":0.04,\
    \"lag_s\":0.5,\"rmse_x_m\":0.1,\"rmse_y_m\":0.03,\"rmse_z_m\":0.07,\"drift_y_m\":0.1,\"tilt_rad\":0.2,\
    \"saturated_frac\":0.0,\"duration_s\":58.2,\"energy_j\":700.0,\"lost\":null}\n\
    {\"scene\":\"0123\",\"contender\":\"team\",\"word\":\"NOOR\",\"seed\":2,\"read\":\"????\",\"all_read\":false,\
    \"legible\":false,\"probability\":0.0,\"log_odds\":-10.0,\"similarity\":0.0,\"lost\":\"it turns over\"}\n";

const CONDITIONS: &str = "# a room\nmass_frac = 0.015\ncenter_of_mass_m = 1e-4\n\
    inertia_frac = 0.1\nmotor_lag_s = 0.05\nlighthouse_distortion_m = 0.007\n\
    lighthouse_frame_frac = 0.01\nairspeed_moment_n_s = 4.7e-4\ngust_m_s = 0.08\n\
    led_delay_s = 0.05\ncharge_used_frac = 0.33\n";

const ANCHORS: &str = "0:\n  x: 0.99\n  y: 1.49\n  z: 1.8\n1:\n  x: 0.99\n  y: 3.29\n  z: 1.8\n";

const LIGHTHOUSE: &str = "type: lighthouse_system_configuration\nversion: '1'\nsystemType: 2\ngeos:\n  0:\n\
    \x20   origin: [-2.0, -2.0, 2.2]\n    rotation: [[0.65, -0.7071, 0.2785], [0.65, 0.7071, 0.2785], \
    [-0.3939, 0.0, 0.9191]]\ncalibs:\n  0:\n    sweeps:\n    - {phase: 0.0, tilt: 0.05, curve: 0.1, gibmag: 0.0, \
    gibphase: 1.0, ogeemag: 0.1, ogeephase: 2.0}\n    - {phase: 0.0, tilt: -0.05, curve: 0.1, gibmag: 0.0, gibphase: 1.0}\n";
