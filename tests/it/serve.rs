//! Tests of `noctograph serve` over raw sockets. They check which requests are admitted, what
//! visitors receive, what the operator can do, and what the server survives. `tests/page` tests the
//! page in a browser.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use base64::prelude::{BASE64_STANDARD, Engine};
use serde_json::{Value, json};

use crate::cli::noctograph;

/// A server that is stopped when its test ends.
struct Server {
    child: Child,
    port: u16,
    /// Path of the visitors' page, which contains its secret.
    path: String,
    /// Path of the operator's page.
    operator: String,
    /// Temporary folder of the server, unless the test provides one.
    _temporary: tempfile::TempDir,
}

impl Server {
    fn start(more: &[&str]) -> Self {
        let temporary = tempfile::tempdir().unwrap();
        let mut server = Self::start_in(temporary.path(), more);
        server._temporary = temporary;
        server
    }

    /// Starts a server whose temporary files are in the given folder.
    fn start_in(temporary: &Path, more: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_noctograph"))
            .arg("serve")
            .args(more)
            .env("TMPDIR", temporary)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut address = |name: &str| {
            let line = lines.by_ref().map(Result::unwrap).find(|line| line.starts_with(name));
            let line = line.unwrap_or_else(|| panic!("no line of {name}"));
            let address = line.rsplit(' ').next().unwrap().to_owned();
            let (port, path) =
                address.rsplit_once("127.0.0.1:").unwrap().1.split_once('/').unwrap();
            (port.parse().unwrap(), format!("/{path}"))
        };
        let ((port, path), (_, operator)) = (address("page"), address("operator"));
        Self { child, port, path, operator, _temporary: tempfile::tempdir().unwrap() }
    }

    fn connect(&self) -> TcpStream {
        TcpStream::connect(("127.0.0.1", self.port)).unwrap()
    }

    /// Returns the status, head and body of the answer to a request.
    fn ask(&self, request: &[u8]) -> (u16, String, Vec<u8>) {
        let mut stream = self.connect();
        // If a request is refused early, the server may not read all of it.
        let _ = stream.write_all(request);
        let mut answer = Vec::new();
        // If the server left bytes unread, the connection is reset after the answer, which may
        // still have arrived completely.
        let ended = stream.read_to_end(&mut answer);
        let end = answer.windows(4).position(|four| four == b"\r\n\r\n");
        let end = end.unwrap_or_else(|| panic!("no answer: {ended:?}")) + 4;
        let body = answer.split_off(end);
        let head = String::from_utf8(answer).unwrap();
        let length = head.split_once("\r\nContent-Length: ").unwrap_or_else(|| panic!("{head}")).1;
        let length = length.split("\r\n").next().unwrap();
        assert_eq!(length, body.len().to_string(), "{ended:?} within the answer {head}");
        (head[9..12].parse().unwrap(), head, body)
    }

    /// Returns the status and body of the answer for an absolute path.
    fn at(&self, path: &str) -> (u16, Vec<u8>) {
        let (status, _, body) = self.ask(&self.getting(path));
        (status, body)
    }

    fn getting(&self, path: &str) -> Vec<u8> {
        format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n", self.port).into_bytes()
    }

    fn get(&self, route: &str) -> (u16, Vec<u8>) {
        self.at(&format!("{}{route}", self.path))
    }

    fn json(&self, path: &str) -> Value {
        let (status, body) = self.at(path);
        assert_eq!(status, 200, "{path}: {}", String::from_utf8_lossy(&body));
        serde_json::from_slice(&body).unwrap()
    }

    fn post(&self, route: &str, body: &Value) -> (u16, Value) {
        self.post_at(&format!("{}{route}", self.path), body)
    }

    /// Sends an action of the operator, and returns the status and the answer.
    fn operate(&self, route: &str, body: &Value) -> (u16, Value) {
        self.post_at(&format!("{}{route}", self.operator), body)
    }

    fn post_at(&self, path: &str, body: &Value) -> (u16, Value) {
        let (status, head, body) = self.ask(&self.posting(path, body));
        assert!(status != 503 || head.contains("Retry-After"), "{head}");
        (status, serde_json::from_slice(&body).unwrap_or(Value::Null))
    }

    fn posting(&self, path: &str, body: &Value) -> Vec<u8> {
        let (body, host) = (body.to_string(), format!("127.0.0.1:{}", self.port));
        let head = format!(
            "POST {path} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nSec-Fetch-Site: \
             same-origin\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n",
            body.len()
        );
        (head + &body).into_bytes()
    }

    /// Sends a word to be flown, and returns the status and the answer.
    fn send(&self, visitor: &str, text: &str) -> (u16, Value) {
        self.post("entries", &sending(visitor, text))
    }

    /// Sends a word, and returns the id of its entry.
    fn sent(&self, visitor: &str, text: &str) -> String {
        let (_, sent) = self.send(visitor, text);
        sent["id"].as_str().unwrap_or_else(|| panic!("{sent}")).to_owned()
    }

    /// Returns a figure of the server's process, such as `Threads` or `VmRSS` in kB.
    fn figure(&self, name: &str) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix(&format!("{name}:")));
        line.unwrap().split_whitespace().next().unwrap().parse().unwrap()
    }

    fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.kill();
    }
}

fn word(word: &str) -> Value {
    json!({ "visitor": "me", "word": word })
}

fn with(wish: &Value, more: Value) -> Value {
    let [Value::Object(wish), Value::Object(more)] = [wish.clone(), more] else {
        panic!("objects")
    };
    wish.into_iter().chain(more).collect::<serde_json::Map<_, _>>().into()
}

fn sending(visitor: &str, text: &str) -> Value {
    entry_of(&json!({ "visitor": visitor, "word": text }))
}

fn entry_of(photo: &Value) -> Value {
    json!({ "visitor": photo["visitor"], "photo": photo.to_string(), "language": "en" })
}

/// Returns the content of a file in an answer.
fn file(answer: &Value, name: &str) -> Vec<u8> {
    let text = answer["files"][name].as_str().unwrap_or_else(|| panic!("{name}: {answer}"));
    BASE64_STANDARD.decode(text).unwrap()
}

/// Returns the key of a refusal.
fn key(answer: &Value) -> &str {
    answer["error"]["key"].as_str().unwrap_or_default()
}

/// Returns the ids of a process's children.
#[cfg(target_os = "linux")]
fn children(parent: u32) -> Vec<u32> {
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    let numbers = processes.filter_map(|it| it.file_name().to_str()?.parse::<u32>().ok());
    let is_child = |number: &u32| {
        let stat = std::fs::read_to_string(format!("/proc/{number}/stat")).unwrap_or_default();
        // The process name in brackets may contain any characters.
        let mut after = stat.rsplit(") ").next().unwrap_or_default().split(' ');
        after.next() != Some("Z") && after.next() == Some(&parent.to_string())
    };
    numbers.filter(is_child).collect()
}

/// Time after which waiting counts as endless, even on a busy machine.
const PATIENCE: Duration = Duration::from_secs(300);

/// Waits until a condition holds.
fn soon(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(Duration::from_millis(30));
    }
}

#[test]
fn for_programs_the_addresses_are_one_object() {
    let temporary = tempfile::tempdir().unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_noctograph"))
        .args(["serve", "--json"])
        .env("TMPDIR", temporary.path())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let _ = child.kill();
    let _ = child.wait();
    let addresses: Value = serde_json::from_str(&line).unwrap_or_else(|_| panic!("{line}"));
    let begins =
        |key: &str| addresses[key].as_str().is_some_and(|it| it.starts_with("http://127.0.0.1:"));
    assert!(begins("page") && begins("operator"), "{addresses}");
    assert!(addresses["network"].is_null() && addresses["kiosk"].is_null(), "{addresses}");
}

#[test]
fn only_a_page_of_this_server_is_let_in() {
    let server = Server::start(&[]);
    let (port, path) = (server.port, server.path.as_str());
    let get =
        |path: &str, fields: &str| format!("GET {path} HTTP/1.1\r\n{fields}\r\n").into_bytes();
    let own = format!("Host: 127.0.0.1:{port}\r\n");
    let post = |fields: &str| {
        let head = format!("POST {path}live HTTP/1.1\r\n{own}{fields}\r\n{{}}");
        head.into_bytes()
    };
    let json = "Content-Type: application/json\r\n";
    let cases: Vec<(&str, Vec<u8>, u16)> = vec![
        ("the page", get(path, &own), 200),
        ("the page by its name", get(path, &format!("Host: localhost:{port}\r\n")), 200),
        ("a name that is rebound", get(path, &format!("Host: evil.example:{port}\r\n")), 421),
        ("another port", get(path, "Host: 127.0.0.1:1\r\n"), 421),
        ("another machine's address", get(path, &format!("Host: 10.0.0.7:{port}\r\n")), 421),
        ("no host", get(path, ""), 421),
        ("no token", get("/", &own), 403),
        ("the operator's page", get(&server.operator, &own), 200),
        ("a wrong operator", get(&server.path.replace("/k/", "/o/"), &own), 403),
        ("an entry by a guess", get(&server.path.replace("/k/", "/e/"), &own), 404),
        ("an entry by a number", get("/e/1/", &own), 403),
        ("a wrong token", get("/k/0123456789abcdef0123456789abcdef/", &own), 403),
        ("a path upward", get(&format!("{path}../../etc/passwd"), &own), 404),
        ("the same, encoded", get(&format!("{path}wall%2f..%2f..%2fetc"), &own), 404),
        ("a photo that is not there", get(&format!("{path}wall/1.jpg"), &own), 404),
        ("a module that is not there", get(&format!("{path}noctograph.wasm.gz"), &own), 404),
        ("another method", format!("PUT {path} HTTP/1.1\r\n{own}\r\n").into_bytes(), 405),
        ("the queue by a visitor", get(&format!("{path}queue.json"), &own), 404),
        ("an export by a visitor", get(&format!("{path}export.zip"), &own), 404),
        ("no HTTP", b"\x16\x03\x01 hello\r\n\r\n".to_vec(), 400),
        ("a long head", get(path, &format!("{own}X: {}\r\n", "x".repeat(20_000))), 431),
        ("a foreign origin", post(&format!("{json}Origin: http://evil.example\r\n")), 403),
        ("an opaque origin", post(&format!("{json}Origin: null\r\n")), 403),
        (
            "two origins",
            post(&format!(
                "{json}Origin: http://127.0.0.1:{port}\r\nOrigin: http://evil.example\r\n"
            )),
            403,
        ),
        (
            "two sites",
            post(&format!("{json}Sec-Fetch-Site: same-origin\r\nSec-Fetch-Site: cross-site\r\n")),
            403,
        ),
        ("a foreign site", post(&format!("{json}Sec-Fetch-Site: cross-site\r\n")), 403),
        ("a form", post("Content-Type: text/plain\r\nContent-Length: 2\r\n"), 415),
        ("no length", post(json), 411),
        ("a length in words", post(&format!("{json}Content-Length: two\r\n")), 400),
        ("a large body", post(&format!("{json}Content-Length: 300000\r\n")), 413),
        ("a signed length", post(&format!("{json}Content-Length: +2\r\n")), 400),
        ("a signed port", get(path, &format!("Host: 127.0.0.1:+{port}\r\n")), 421),
        ("two hosts", get(path, &format!("{own}Host: evil.example:{port}\r\n")), 421),
        ("a body that fits", post(&format!("{json}Content-Length: 2\r\n")), 200),
    ];
    for (name, request, want) in cases {
        let (status, head, _) = server.ask(&request);
        assert_eq!(status, want, "{name}: {head}");
        // Data that is not a valid request is answered by the HTTP library itself.
        let is_ours = ![400, 431].contains(&want);
        assert!(!is_ours || head.contains("X-Content-Type-Options: nosniff"), "{name}: {head}");
        assert!(!head.contains("Access-Control"), "{name}: no leave for other origins");
    }
    // A browser with an outdated address receives a page with a sentence, and any other client
    // receives the reason.
    let accept = "Accept: text/html\r\nAccept-Language: xx, fr-CH;q=0.9, de;q=0.8\r\n";
    let (status, head, page) = server.ask(&get("/", &format!("{own}{accept}")));
    assert_eq!(status, 403, "{head}");
    assert!(head.contains("default-src 'none'") && head.contains("text/html"), "{head}");
    let page = String::from_utf8_lossy(&page);
    assert!(page.contains("lang=\"fr\"") && page.contains("dans la salle"), "{page}");
    let (_, _, reason) = server.ask(&get("/", &own));
    assert_eq!(&*reason, b"open the address that the program printed");

    let (_, head, page) = server.ask(&get(path, &own));
    assert!(head.contains("frame-ancestors 'none'") && page.len() <= 100_000, "{} B", page.len());

    // The server waits at most five seconds for a header that never ends.
    let mut slow = server.connect();
    slow.write_all(b"GET / HTTP/1.1\r\nHost:").unwrap();
    let mut answer = String::new();
    slow.read_to_string(&mut answer).unwrap();
    assert!(answer.is_empty(), "{answer}");
    // The same limit applies to a body that never ends.
    let mut slow = server.connect();
    slow.write_all(&post(&format!("{json}Content-Length: 9\r\n"))).unwrap();
    slow.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 408"), "{answer}");
}

#[test]
fn a_wish_reaches_no_file_and_no_flag() {
    let server = Server::start(&[]);
    let refused = |wish: Value, why: &str| {
        let (status, answer) = server.post("live", &wish);
        let (key, text) = (key(&answer), answer["error"]["text"].as_str().unwrap_or_default());
        assert!(status == 200 && (key == why || text.contains(why)), "{wish}: {answer}");
        assert!(!text.contains("/noctograph") && !text.contains("/tmp"), "{text}");
    };
    refused(word("ABCDEFGHIJKLMNOPQRSTUVWXYZ"), "word-long");
    refused(word("  "), "word-empty");
    refused(json!({ "visitor": "v".repeat(99), "word": "A" }), "visitor");
    refused(json!({ "visitor": "me", "word": "A", "output": "/tmp/x" }), "output");
    let unknown = "letters.drawing letters photo.background camera.width_px word controllers.kind";
    for key in unknown.split(' ') {
        refused(json!({ "visitor": "me", "word": "A", "settings": { key: "1" } }), key);
    }
    let font = json!({ "letters.font": "/etc/passwd" });
    refused(json!({ "visitor": "me", "word": "A", "settings": font }), "letters.font");
    refused(json!({ "visitor": "me", "word": "A", "settings": { "seed": "1\n[light]" } }), "seed");
    refused(
        json!({ "visitor": "me", "word": "A", "room": "--help" }),
        "found --help, wanted WIDTH",
    );
    let svg = json!({ "kind": "svg", "text": "<svg/>" });
    refused(json!({ "visitor": "me", "drawing": svg }), "drawing-empty");
    refused(json!({ "visitor": "me", "drawing": { "kind": "../x", "text": "" } }), "variant");
    let mut deep = word("A");
    deep["settings"] = serde_json::from_str(&("[".repeat(100) + &"]".repeat(100))).unwrap();
    refused(deep, "page-old");
    refused(json!({ "visitor": "../x", "word": "A" }), "page-old");
    refused(json!({ "visitor": "me", "word": "A", "aspect": 1e9 }), "page-old");
    // No typeface contains an unassigned character.
    refused(word("A\u{378}"), "letter-missing");

    // Texts that look like flags or file names are still words.
    for text in ["--help", "x.csv", "-o"] {
        let (_, answer) = server.post("live", &word(text));
        assert!(answer["photo"].is_string(), "{text}: {}", answer["error"]);
    }
}

#[test]
fn a_visitor_gets_a_photo_and_its_files() {
    let server = Server::start(&[]);
    let mut wish = word("OSLO");
    wish["number"] = 7.into();
    let (_, live) = server.post("live", &wish);
    assert_eq!((&live["verdict"]["read"], &live["number"]), (&json!("OSLO"), &json!(7)), "{live}");
    assert!(live["photo"].as_str().unwrap().starts_with("data:image/jpeg;base64,/9j/"), "a JPEG");
    assert_eq!([&live["width"], &live["height"]], [960, 540]);
    // The lamp passes through the letters' boxes one after another.
    let (strokes, boxes) = (&live["replay"]["strokes"], &live["boxes"]);
    assert_eq!(boxes.as_array().unwrap().len(), 4);
    for stroke in strokes.as_array().unwrap() {
        let at: Vec<i64> = serde_json::from_value(stroke["at"].clone()).unwrap();
        let letter = usize::try_from(stroke["letter"].as_u64().unwrap()).unwrap();
        let edges: Vec<i64> = serde_json::from_value(boxes[letter].clone()).unwrap();
        let inside = |p: &[i64]| {
            (edges[0] - 300..=edges[2] + 300).contains(&p[1])
                && (edges[1] - 500..=edges[3] + 500).contains(&p[2])
        };
        assert!(at.chunks(3).all(inside), "letter {letter}: {edges:?} {at:?}");
        assert!(at.chunks(3).is_sorted_by_key(|p| p[0]), "in order of time");
    }

    let (_, large) = server.post("photos", &word("OSLO"));
    assert_eq!(large["read"], "OSLO", "{large}");
    assert!(large["files"].is_null(), "files are sent to whom saves them");
    let (_, large) = server.post("photos", &with(&word("OSLO"), json!({ "files": true })));
    let png = file(&large, "photo.png");
    let folder = tempfile::tempdir().unwrap();
    let typed = ["preview", "OSLO", "--size", "1920x1080", "--backend", "cpu", "-o", "."];
    // Words for an audience are written in reading order, and photographed on a uniform floor
    // without hot pixels.
    let keys = [
        "--set=plan.style.order=reading",
        "--set=photo.noise.hot_pixel_frac=0",
        "--set=expose.unevenness=0",
    ];
    noctograph(folder.path()).args(typed).args(keys).assert().success();
    assert!(png == std::fs::read(folder.path().join("photo.png")).unwrap(), "the same bytes");
    assert!(large["photo"].as_str().unwrap().starts_with("data:image/jpeg;base64,/9j/"), "a JPEG");
    assert!(file(&large, "scene.toml").starts_with(b"# "));
    let (_, script) = server.post("script", &word("OSLO"));
    assert!(file(&script, "flight.zip").starts_with(b"PK\x03\x04"));
    let mut entry = json!({ "visitor": "you", "photo": large["id"], "language": "en" });
    let (status, said) = server.post("entries", &entry);
    assert_eq!((status, key(&said)), (400, "page-old"), "another visitor's: {said}");
    entry["visitor"] = "me".into();
    assert_eq!(server.post("entries", &entry).0, 201, "a photo is sent by its name");

    let tall = json!({ "visitor": "me", "word": "I", "aspect": 0.5 });
    let (_, tall) = server.post("live", &tall);
    assert_eq!([&tall["width"], &tall["height"]], [510, 1018], "the stage's own shape");
}

#[test]
fn a_script_that_is_not_safe_is_refused_with_its_reason() {
    let server = Server::start(&[]);
    let large = json!({ "letters.cap_height_m": "1.2" });
    let wish = json!({
        "visitor": "me", "word": "MMM", "settings": large, "room": "4x3x2.5", "advice": false,
    });
    let (_, large) = server.post("photos", &wish);
    let stops = large["stops"].as_array().unwrap_or_else(|| panic!("{large}"));
    assert!(stops[0]["key"].as_str().unwrap().starts_with("stop-"), "{stops:?}");
    let (status, said) = server.post("script", &wish);
    assert_eq!((status, key(&said)), (200, "not-safe"));
    let reasons = said["error"]["values"]["stops"].as_array().unwrap();
    assert!(stops.iter().all(|stop| reasons.contains(stop)), "the reasons, as data: {reasons:?}");
    let (status, said) = server.post("entries", &entry_of(&wish));
    assert_eq!((status, key(&said)), (409, "not-safe"), "nor is it sent");
    let log = with(&word("OSLO"), json!({ "log": BASE64_STANDARD.encode("t,x,y,z") }));
    let (_, said) = server.post("live", &log);
    assert_eq!(key(&said), "page-old", "what was flown already is no wish: {said}");
}

/// Each lamp that the page offers can write without the others, in color and in white.
#[test]
fn every_lamp_that_can_be_chosen_writes() {
    let server = Server::start(&[]);
    let about = server.json(&format!("{}about.json", server.path));
    let red = about["colors"].as_array().unwrap().iter().find(|it| it["name"] == "red").unwrap();
    for (deck, lamp) in
        [("led-ring", "ring"), ("color-led", "color-led"), ("led-ring", "headlights")]
    {
        let mut settings = json!({ "light.deck": deck, "plan.lights": format!("[\"{lamp}\"]") });
        if lamp != "headlights" {
            settings["light.letters_wrgb"] = json!(json!([red[lamp]]).to_string());
        }
        let wish = json!({ "visitor": "me", "word": "NOOR", "settings": settings });
        let (_, live) = server.post("live", &wish);
        let found = (&live["obstacles"], &live["verdict"]["read"]);
        assert_eq!(found, (&json!([]), &json!("NOOR")), "{lamp}");
        let rgb: [u32; 3] =
            serde_json::from_value(live["replay"]["strokes"][0]["rgb"].clone()).unwrap();
        let is_red = rgb[0] > 2 * rgb[1].max(rgb[2]);
        assert_eq!(is_red, lamp != "headlights", "{lamp}: {rgb:?}");
    }
}

/// The camera is fixed while a visitor draws on the pad, and a tap is a dot.
#[test]
fn the_pad_is_the_photograph() {
    let server = Server::start(&[]);
    let drawn = |strokes: Value| {
        let text = json!({ "strokes": strokes, "canvas": [0, 0, 1600, 900] }).to_string();
        let settings =
            json!({ "letters.canvas_m": "[3.2, 1.8]", "camera.framing.fill_frac": "0.8" });
        let drawing = json!({ "kind": "json", "text": text });
        let wish = json!({ "visitor": "me", "drawing": drawing, "settings": settings });
        let (_, live) = server.post("live", &wish);
        let strokes = live["replay"]["strokes"].as_array().unwrap_or_else(|| panic!("{live}"));
        strokes
            .iter()
            .map(|it| serde_json::from_value::<Vec<f64>>(it["at"].clone()).unwrap())
            .collect::<Vec<_>>()
    };
    // A point on the pad is converted to ten-thousandths of the photo.
    let place = |x: f64, side: f64| 1e4 * (0.5 + 0.8 * (x / side - 0.5));
    let near = |at: &[f64], [x, y]: [f64; 2], most: f64| {
        (at[1] - place(x, 1600.0)).abs() < most && (at[2] - place(y, 900.0)).abs() < most
    };
    let line = json!([[400, 300], [1200, 300]]);
    let alone = drawn(json!([line]));
    assert!(near(&alone[0][..3], [400.0, 300.0], 150.0), "{:?}", &alone[0][..3]);
    let both = drawn(json!([line, [[800, 800]]]));
    assert!(near(&both[0][..3], [400.0, 300.0], 150.0), "it stays where it was");
    let tap = both.last().unwrap();
    assert!(tap.chunks(3).all(|at| near(at, [800.0, 800.0], 150.0)), "a dot: {tap:?}");
}

#[test]
fn a_scene_that_cannot_be_flown_is_refused_at_once() {
    let here = tempfile::tempdir().unwrap();
    noctograph(here.path()).args(["serve", "--scene", "nosuch"]).assert().code(2);
    let held = std::net::TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = held.local_addr().unwrap().port().to_string();
    noctograph(here.path()).args(["serve", "--port", &port]).assert().code(2);
}

/// Each of a thousand requests from 32 connections is answered or asked to retry, and none leaves
/// threads or memory behind.
#[cfg(target_os = "linux")]
#[test]
fn a_crowd_leaves_neither_threads_nor_memory() {
    let server = Server::start(&[]);
    // These requests are answered quickly, because the scene refuses them.
    let wish = |n: usize| {
        let settings = json!({ "preset": "\"none\"" });
        json!({ "visitor": format!("v{n}"), "word": "A", "settings": settings })
    };
    (0..10).for_each(|n| drop(server.post("live", &wish(n))));
    // One more thread is allowed, because the thread of the last answer may still be ending.
    let (threads, memory) = (server.figure("Threads"), server.figure("VmRSS"));
    let crowd = |first: usize| {
        let answers = (0..32).map(|n| server.post("live", &wish(32 * first + n)));
        answers.map(|(status, _)| status).collect::<Vec<_>>()
    };
    let statuses: Vec<u16> = std::thread::scope(|scope| {
        let crowds: Vec<_> = (0..32).map(|n| scope.spawn(move || crowd(n))).collect();
        crowds.into_iter().flat_map(|crowd| crowd.join().unwrap()).collect()
    });
    assert!(statuses.iter().all(|status| *status == 200), "{statuses:?}");
    let begun = Instant::now();
    while server.figure("Threads") > threads && begun.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(50));
    }
    let left = server.figure("Threads");
    assert!(left <= threads, "{threads} threads before, {left} after");
    let after = server.figure("VmRSS");
    let growth = after as f64 / memory as f64;
    assert!(growth <= 1.1, "{memory} kB before, {after} kB after");
    assert_eq!(server.post("live", &word("OSLO")).1["verdict"]["read"], "OSLO", "it lives on");
}

/// If the server is killed at any moment, all confirmed entries exist completely, and no entry
/// exists partially.
#[test]
fn entries_survive_kills() {
    let folder = tempfile::tempdir().unwrap();
    let gallery = folder.path().join("gallery");
    let flags = ["--gallery", gallery.to_str().unwrap()];
    let mut confirmed: Vec<String> = Vec::new();
    let mut first = None;
    for round in 0..4_u64 {
        let mut server = Server::start(&flags);
        let address = first.get_or_insert((server.path.clone(), server.operator.clone()));
        assert_eq!(*address, (server.path.clone(), server.operator.clone()), "it stays the same");
        server.post("live", &word("I"));
        let path = format!("{}entries", server.path);
        let mut streams = ["I", "LI", "IL"].map(|text| (server.connect(), text));
        for (stream, text) in &mut streams {
            let body = sending(&format!("v{round}"), text);
            stream.write_all(&server.posting(&path, &body)).unwrap();
        }
        // The first entry is made before the server is killed, and the others only in some rounds.
        streams[0].0.read_exact(&mut [0]).unwrap();
        std::thread::sleep(Duration::from_millis(100 * round));
        server.kill();
        for (mut stream, _) in streams {
            let mut answer = String::new();
            let _ = stream.read_to_string(&mut answer);
            let body = answer.rsplit("\r\n\r\n").next().unwrap_or_default();
            let told = serde_json::from_str::<Value>(body).unwrap_or_default();
            confirmed.extend(told["id"].as_str().map(str::to_owned));
        }
    }
    let server = Server::start(&flags);
    let queue = server.json(&format!("{}queue.json", server.operator));
    let kept: Vec<&Value> = queue["entries"].as_array().unwrap().iter().collect();
    assert!(!confirmed.is_empty() && confirmed.len() <= kept.len());
    for id in &confirmed {
        assert!(kept.iter().any(|entry| entry["id"] == **id), "{id} is lost");
        let (status, png) = server.at(&format!("/e/{id}/photo.png"));
        assert!(status == 200 && png.ends_with(b"IEND\xaeB\x60\x82"), "{id} is whole");
    }
    let mut numbers: Vec<u64> =
        kept.iter().map(|entry| entry["number"].as_u64().unwrap()).collect();
    let is_sorted = numbers.is_sorted();
    numbers.dedup();
    assert!(is_sorted && numbers.len() == kept.len(), "each has its own number");
    // What a killed server left behind is removed when the next entry is stored.
    server.sent("late", "I");
    let names = std::fs::read_dir(&gallery).unwrap().flatten().map(|entry| entry.file_name());
    assert!(names.into_iter().all(|name| !name.to_string_lossy().starts_with(".noctograph")));
}

#[test]
fn the_operator_decides_what_hangs_and_what_flies() {
    let server = Server::start(&["--network"]);
    let (status, sent) = server.send("me", "I");
    let id = sent["id"].as_str().unwrap().to_owned();
    assert_eq!((status, &sent["number"]), (201, &json!(1)));
    assert_eq!(server.send("me", "I"), (200, sent.clone()), "sent twice, kept once");
    let other = server.sent("me", "LI");
    let wall = || server.json(&format!("{}wall", server.path))["photos"].clone();
    assert_eq!(wall(), json!([]), "nothing hangs that nobody approved");

    // Only the entry's owner can see it.
    let own = server.json(&format!("/e/{id}/entry.json"));
    assert_eq!((&own["state"], &own["title"]), (&json!("waiting"), &json!("I")));
    assert_eq!(server.at(&format!("/e/{id}/queue.json")).0, 404);
    assert_eq!(server.post_at(&format!("/e/{id}/entries"), &json!({})).0, 403);
    let (status, code) = server.at(&format!("/e/{id}/qr.svg"));
    let reached = server.json(&format!("/e/{id}/about.json"))["network"] == true;
    let is_code = status == 200 && code.starts_with(b"<svg");
    assert!(if reached { is_code } else { status == 404 }, "a code of its page, for phones");

    let queue = || server.json(&format!("{}queue.json", server.operator));
    let act = |id: &str, act: Value| server.operate(&format!("entries/{id}"), &act);
    let first = |queue: Value| queue["entries"][0]["id"].as_str().unwrap().to_owned();
    assert_eq!(first(queue()), id);
    assert_eq!(server.operate("order", &json!({ "ids": [other, id] })).0, 200);
    assert_eq!(first(queue()), other);
    assert_eq!(server.json(&format!("/e/{id}/entry.json"))["ahead"], 1);
    let seen = queue()["revision"].as_u64().unwrap();
    let news = std::thread::scope(|scope| {
        let path = format!("{}news?seen={seen}", server.path);
        let news = scope.spawn(|| server.json(&{ path }));
        std::thread::sleep(Duration::from_millis(100));
        assert_eq!(act(&id, json!({ "do": "approve", "was": "waiting" })).0, 200);
        news.join().unwrap()
    });
    assert!(news["revision"].as_u64().unwrap() > seen, "{news}");
    assert_eq!(act(&id, json!({ "do": "approve", "was": "waiting" })).0, 409, "too late");
    let key_of = wall()[0]["key"].as_str().unwrap().to_owned();
    assert_ne!(key_of, id, "the wall leads to no entry");
    assert_eq!(server.at(&format!("/e/{key_of}/")).0, 404);
    assert_eq!(server.get(&format!("wall/{key_of}.jpg")).0, 200);
    act(&id, json!({ "do": "hide" }));
    assert_eq!((wall(), server.get(&format!("wall/{key_of}.jpg")).0), (json!([]), 404));
    act(&id, json!({ "do": "show" }));

    // Both entries are approved, and exported as scripts in their order.
    act(&other, json!({ "do": "approve" }));
    let told = server.json(&format!("{}export.json", server.operator));
    assert_eq!([&told[0]["folder"], &told[1]["folder"]], ["01-LI", "02-I"], "{told}");
    let (_, zip) = server.at(&format!("{}export.zip", server.operator));
    assert!(zip.windows(6).any(|name| name == b"02-I/I" || name == b"02-I/c"), "scripts in it");
    let (status, script) = server.at(&format!("{}entries/{id}/flight.zip", server.operator));
    assert!(status == 200 && script.starts_with(b"PK"), "one entry's script alone");
    act(&other, json!({ "do": "fly" }));
    act(&id, json!({ "do": "fly" }));
    let states = |queue: Value| [0, 1].map(|k| queue["entries"][k]["state"].clone());
    assert_eq!(states(queue()), ["flown", "flying"], "one flies at a time");
    let back = json!({ "do": "withdraw", "visitor": "me" });
    assert_eq!(server.post(&format!("entries/{id}"), &back).0, 409, "it flies");

    let unknown = server.operate("pause", &json!({ "paused": true, "until": "8 pm" }));
    assert_eq!((unknown.0, key(&unknown.1)), (400, "page-old"), "nothing is left aside in silence");
    assert_eq!(server.operate("pause", &json!({ "paused": true })).0, 200);
    let (status, refused) = server.send("me", "IL");
    assert_eq!((status, key(&refused)), (503, "paused"));
    server.operate("pause", &json!({ "paused": false }));
    let withdrawn = server.sent("late", "I");
    let foreign = server.post(&format!("entries/{withdrawn}"), &back);
    assert_eq!(foreign.0, 404, "not theirs");
    let own = json!({ "do": "withdraw", "visitor": "late" });
    assert_eq!(server.post(&format!("entries/{withdrawn}"), &own).0, 200);
    assert_eq!(server.at(&format!("/e/{withdrawn}/entry.json")).0, 404);
    // An entry's id cannot be guessed. The variable NOCTOGRAPH_GUESSES sets the number of guesses.
    let n = std::env::var("NOCTOGRAPH_GUESSES").map_or(300, |n| n.parse().unwrap());
    let mut guess = 0x9e37_79b9_7f4a_7c15_f39c_c060_5ced_c835_u128;
    for _ in 0..n {
        guess = guess.wrapping_mul(0x2360_ed05_1fc6_5da4_4385_df64_9fcc_f645).wrapping_add(1);
        assert_eq!(server.at(&format!("/e/{guess:032x}/entry.json")).0, 404);
    }
}

/// A log belongs to an approved entry of its word. The photo of the log is shown on the wall, and
/// kept even if the server is killed. Nothing else in the folder is shown.
#[test]
fn a_flight_hangs_with_its_entry_and_nothing_else_does() {
    let (folder, log) = crate::follow::flown();
    let path = |name: &str| folder.path().join(name);
    let [gallery, flights] = ["gallery", "flights"].map(|name| path(name).display().to_string());
    let flags = ["--network", "--open-wall", "--gallery", &*gallery, "--flights", &*flights];
    // The server creates the folder. Older logs belong to another evening.
    std::fs::create_dir(path("flights")).unwrap();
    std::fs::write(path("flights/NO_flight.jsonl"), &log).unwrap();
    let mut server = Server::start(&flags);
    let (id, other) = (server.sent("me", "NO"), server.sent("you", "LI"));
    let queue = |server: &Server| server.json(&format!("{}queue.json", server.operator));
    let told = |server: &Server, name: &str, key: &str| {
        soon(name, || {
            let notes = queue(server)["notes"].clone();
            let is_told = |note: &Value| note["name"] == name && note["key"] == key;
            notes.as_array().unwrap().iter().any(is_told)
        });
    };
    let wall = |server: &Server, title: &str| {
        let photos = server.json(&format!("{}wall", server.path))["photos"].clone();
        photos.as_array().unwrap().iter().find(|photo| photo["title"] == title).unwrap().clone()
    };
    // Even an open wall shows no flight of an entry that nobody has approved.
    std::fs::write(path("flights/NO_flight-2.jsonl"), &log).unwrap();
    told(&server, "NO_flight-2.jsonl", "log-unknown");
    assert_eq!(
        (&wall(&server, "NO")["live"], &wall(&server, "NO")["flown"]),
        (&json!(false), &Value::Null)
    );
    let head = log.lines().next().unwrap();
    std::fs::write(path("flights/broken.jsonl"), format!("{head}\n[1]\n")).unwrap();
    std::fs::write(path("flights/picture.jsonl"), "\u{89}PNG").unwrap();
    std::fs::write(path("flights/empty.jsonl"), "").unwrap();
    told(&server, "picture.jsonl", "log-broken");
    server.operate(&format!("entries/{id}"), &json!({ "do": "approve" }));
    soon("the photo of the flight", || wall(&server, "NO")["flown"]["name"] == "flown-1");
    told(&server, "broken.jsonl", "log-broken");

    // Only the entry's page and the wall give access to the flight.
    let key_of = |title: &str| wall(&server, title)["key"].as_str().unwrap().to_owned();
    let (key, other_key) = (key_of("NO"), key_of("LI"));
    for (route, status) in [
        (format!("/e/{id}/flown-1.png"), 200),
        (format!("/e/{id}/flown-1.json"), 200),
        (format!("/e/{id}/flown-2.png"), 404),
        (format!("/e/{id}/flown-1"), 404),
        (format!("/e/{other}/flown-1.png"), 404),
        (format!("/e/{key}/flown-1.png"), 404),
        (format!("{}wall/{key}/flown-1.jpg", server.path), 200),
        (format!("{}wall/{key}/entry.json", server.path), 404),
        (format!("{}wall/{id}/flown-1.jpg", server.path), 404),
        (format!("{}wall/{other_key}/flown-1.jpg", server.path), 404),
        (format!("{}wall/{other_key}/live.jpg", server.path), 404),
    ] {
        assert_eq!(server.at(&route).0, status, "{route}");
    }
    server.operate(&format!("entries/{id}"), &json!({ "do": "hide" }));
    assert_eq!(server.get(&format!("wall/{key}/flown-1.jpg")).0, 404, "it was taken down");
    server.operate(&format!("entries/{id}"), &json!({ "do": "show" }));
    server.kill();
    let server = Server::start(&flags);
    assert_eq!(wall(&server, "NO")["flown"]["name"], "flown-1");
    let entry = server.json(&format!("/e/{id}/entry.json"));
    assert!(entry["flown"]["readability"].as_f64().unwrap() > 0.5, "{entry}");
}

#[test]
fn a_hall_whose_room_is_not_known_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, "[expose]\nroom_m = [4.0, 6.0, 2.5]\n").unwrap();
    for (more, is_told) in [(&[][..], true), (&["--scene", scene.to_str().unwrap()][..], false)] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_noctograph"))
            .args(["serve", "--network"])
            .args(more)
            .env("TMPDIR", folder.path())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
        let said: Vec<String> = lines.take_while(|line| !line.contains("Ctrl-C")).collect();
        child.kill().unwrap();
        child.wait().unwrap();
        assert_eq!(said.iter().any(|line| line.contains("fence is a guess")), is_told, "{said:?}");
    }
}

/// On every server, the wall shows only approved entries unless it is open, and only the wall's
/// page contains QR codes.
#[test]
fn only_an_open_wall_shows_what_nobody_approved() {
    for (flags, hung, rule) in
        [(&[][..], 0, "approved"), (&["--kiosk"], 0, "approved"), (&["--open-wall"], 1, "open")]
    {
        let server = Server::start(flags);
        server.send("me", "I");
        let wall = server.json(&format!("{}wall", server.path));
        assert_eq!(wall["photos"].as_array().unwrap().len(), hung, "{flags:?}");
        let about = server.json(&format!("{}about.json", server.operator));
        assert_eq!((&about["wall"], &about["network"]), (&json!(rule), &json!(false)));
        // No QR code contains the loopback address.
        for path in [&server.path, &server.operator] {
            for name in ["qr.svg", "visitors.svg", "kiosk.svg", "wall.svg"] {
                assert_eq!(server.at(&format!("{path}{name}")).0, 404, "{path}{name}");
            }
        }
        let text = |hex: &str| server.at(&format!("{}text.svg?{hex}", server.operator)).0;
        let long = "41".repeat(257);
        let statuses = ["5749", "574", "5g", "ff", "%41", &long].map(text);
        assert_eq!(statuses, [200, 400, 400, 400, 400, 400]);
        assert_eq!(server.at(&format!("{}text.svg?5749", server.path)).0, 404);
    }
}

/// A scene's drawing is stored beside the scene, both in the answer and in the gallery.
#[test]
fn a_drawing_travels_with_its_scene() {
    let folder = tempfile::tempdir().unwrap();
    let gallery = folder.path().join("gallery");
    let server = Server::start(&["--gallery", gallery.to_str().unwrap()]);
    let svg = r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><path d="M1 1 L8 8" stroke="black"/></svg>"#;
    let drawn = json!({ "visitor": "me", "drawing": { "kind": "svg", "text": svg } });
    let mut whole = drawn.clone();
    whole["files"] = json!(true);
    let (_, large) = server.post("photos", &whole);
    let file = |name: &str| BASE64_STANDARD.decode(large["files"][name].as_str().unwrap()).unwrap();
    assert_eq!(file("drawing.svg"), svg.as_bytes());
    let sent = json!({ "visitor": "me", "photo": drawn.to_string() });
    assert_eq!(server.post("entries", &sent).0, 201);
    let entry = std::fs::read_dir(&gallery).unwrap().map(|it| it.unwrap().path());
    let entry = entry.filter(|path| path.is_dir()).find(|path| path.join("scene.toml").exists());
    let entry = entry.unwrap();
    assert_eq!(std::fs::read(entry.join("drawing.svg")).unwrap(), svg.as_bytes());
    let out = folder.path().join("out");
    noctograph(&entry).args(["preview", "--scene", "scene.toml", "-o"]).arg(&out).assert().code(0);
    let [kept, again] = [&entry, &out].map(|folder| std::fs::read(folder.join("photo.png")));
    assert!(kept.unwrap() == again.unwrap(), "the scene gives its photograph");
}

/// The refusal of an unknown setting names it, so that a page of another version can leave it out.
#[test]
fn a_setting_that_cannot_be_is_named() {
    let server = Server::start(&[]);
    for (key, value) in
        [("wings.flap", "7"), ("controller.kind", "psychic"), ("letters.cap_height_m", "tall")]
    {
        let (_, answer) =
            server.post("live", &with(&word("I"), json!({ "settings": { key: value } })));
        assert_eq!(answer["error"]["values"]["setting"], key, "{answer}");
    }
}

/// The addresses of visitors, operator, wall and entry give access only to their own resources.
#[test]
fn no_address_leads_to_what_is_of_another() {
    let server = Server::start(&["--network"]);
    let (mine, theirs) = (server.sent("me", "I"), server.sent("you", "LI"));
    server.operate(&format!("entries/{theirs}"), &json!({ "do": "approve" }));
    let wall = server.json(&format!("{}wall", server.path));
    let hung = wall["photos"][0]["key"].as_str().unwrap();
    let secret = |path: &str| path[3..35].to_owned();
    let (visitors, operator) = (secret(&server.path), secret(&server.operator));
    let approve = json!({ "do": "approve" });
    let posts = [
        (format!("/k/{visitors}/entries/{mine}"), approve.clone(), 400),
        (
            format!("/k/{visitors}/entries/{mine}"),
            json!({ "do": "withdraw", "visitor": "you" }),
            404,
        ),
        (format!("/k/{visitors}/order"), json!({ "ids": [mine] }), 404),
        (format!("/k/{visitors}/pause"), json!({ "paused": true }), 404),
        (format!("/k/{operator}/entries/{mine}"), approve.clone(), 403),
        (format!("/o/{visitors}/entries/{mine}"), approve.clone(), 403),
        (format!("/o/{operator}/entries/{hung}"), approve.clone(), 404),
        (format!("/o/{operator}/entries/{mine}"), json!({ "do": "delete" }), 400),
        (format!("/o/{operator}/entries/..%2f{mine}"), approve.clone(), 404),
        (format!("/o/{operator}/order"), json!({ "ids": "all" }), 400),
        (format!("/e/{mine}/entries/{mine}"), approve.clone(), 403),
        (format!("/e/{mine}/live"), json!({ "visitor": "me", "word": "I" }), 403),
    ];
    for (path, body, want) in posts {
        assert_eq!(server.post_at(&path, &body).0, want, "{path}: {body}");
    }
    let gets = [
        (format!("/k/{visitors}/entries/{hung}"), 404),
        (format!("/k/{visitors}/wall/{mine}.jpg"), 404),
        (format!("/k/{visitors}/wall/{hung}.png"), 404),
        (format!("/k/{visitors}/entries/{mine}/photo.png"), 404),
        (format!("/k/{visitors}/address.json"), 404),
        (format!("/k/{visitors}/export.json"), 404),
        (format!("/o/{visitors}/queue.json"), 403),
        (format!("/o/{operator}/entries/{mine}/wish.json"), 404),
        (format!("/o/{operator}/entries/{mine}/../{theirs}/photo.png"), 404),
        (format!("/e/{hung}/entry.json"), 404),
        (format!("/e/{operator}/entry.json"), 404),
        (format!("/e/{visitors}/entry.json"), 404),
        (format!("/e/{mine}/{theirs}/photo.png"), 404),
        (format!("/e/{mine}/../{theirs}/photo.png"), 404),
        (format!("/e/{mine}/scene.toml"), 404),
        (format!("/e/{mine}/wall"), 404),
        (format!("/e/{}/entry.json", &mine[..31]), 403),
        (format!("/e/{}/entry.json", mine.to_uppercase()), 404),
    ];
    for (path, want) in gets {
        assert_eq!(server.at(&path).0, want, "{path}");
    }
    // Requests by a foreign page, a form, another method or another machine change nothing.
    let path = format!("/o/{operator}/entries/{mine}");
    let posting = String::from_utf8(server.posting(&path, &approve)).unwrap();
    let host = format!("127.0.0.1:{}", server.port);
    for (from, to, want) in [
        (format!("Origin: http://{host}"), "Origin: http://evil.example".to_owned(), 403),
        ("same-origin".to_owned(), "cross-site".to_owned(), 403),
        ("application/json".to_owned(), "text/plain".to_owned(), 415),
        (format!("Host: {host}"), format!("Host: evil.example:{}", server.port), 421),
        ("POST".to_owned(), "DELETE".to_owned(), 405),
    ] {
        assert_eq!(server.ask(posting.replacen(&from, &to, 1).as_bytes()).0, want, "{to}");
    }
    let machine = std::net::UdpSocket::bind("0.0.0.0:0").and_then(|socket| {
        socket.connect("192.0.2.1:9")?;
        socket.local_addr()
    });
    if let Some(ip) = machine.ok().map(|it| it.ip()).filter(|ip| !ip.is_loopback()) {
        let mut stream = TcpStream::connect((ip, server.port)).unwrap();
        stream.write_all(posting.replace("127.0.0.1", &ip.to_string()).as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        assert!(answer.starts_with("HTTP/1.1 403"), "the operator from elsewhere: {answer}");
    }
    let own = server.json(&format!("/e/{mine}/entry.json"));
    assert_eq!(own["state"], "waiting", "after all of it");
}

/// No answer contains a path of this machine, such as those of a job or of the typefaces and files
/// of the scene.
#[test]
fn no_path_of_the_host_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let face = Path::new(env!("CARGO_MANIFEST_DIR")).join("fonts/simplex.strokes");
    let room = folder.path().join("room.png");
    image::RgbImage::from_pixel(64, 36, image::Rgb([9; 3])).save(&room).unwrap();
    let font = folder.path().join("own.strokes");
    std::fs::copy(face, &font).unwrap();
    let scene = folder.path().join("hall.toml");
    let own = format!("[letters]\nfont = {font:?}\n[photo]\nbackground = {room:?}\n");
    std::fs::write(&scene, own).unwrap();
    let server = Server::start(&["--scene", scene.to_str().unwrap()]);
    let json = json!({ "strokes": [[[0, 0], [100, 40]], [[0, 40], [100, 0]]] }).to_string();
    let svg = "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 9 9'><image href='x.png' \
               width='9' height='9'/><path d='M0 0L9 9' stroke='red'/></svg>";
    let drawings = [("json", json), ("svg", svg.to_owned()), ("jpg", sheet_on_a_desk())];
    let wishes = drawings.map(|(kind, text)| json!({ "drawing": { "kind": kind, "text": text } }));
    for mut wish in wishes.into_iter().chain([word("IL")]) {
        wish["visitor"] = "me".into();
        let (_, live) = server.post("live", &wish);
        let (_, large) = server.post("photos", &with(&wish, json!({ "files": true })));
        let (_, script) = server.post("script", &wish);
        let mut told = vec![live.to_string().into_bytes(), large.to_string().into_bytes()];
        told.extend(["photo.png", "scene.toml", "plan.csv"].map(|name| file(&large, name)));
        told.push(file(&script, "flight.zip"));
        let (_, sent) = server.post("entries", &entry_of(&wish));
        let entry = sent["id"].as_str().unwrap_or_else(|| panic!("{sent}"));
        told.push(server.at(&format!("/e/{entry}/photo.png")).1);
        let temporary = std::env::temp_dir();
        for path in [temporary.to_str().unwrap(), "/usr/share", "worker-", "letters/fonts"] {
            let is_told = |it: &Vec<u8>| it.windows(path.len()).any(|at| at == path.as_bytes());
            assert_eq!(
                told.iter().position(is_told),
                None,
                "{path} of {}",
                wish["drawing"]["kind"]
            );
        }
        assert!(told[2].windows(8).any(|at| at == b"room.png"), "the room is behind it");
    }
}

/// Returns a picture of a sheet on a dark desk with a black and a red stroke, taken at an angle, as
/// a JPEG in base64.
fn sheet_on_a_desk() -> String {
    const LINES: [([f64; 2], [f64; 2], [u8; 3]); 2] = [
        ([240.0, 200.0], [460.0, 260.0], [20; 3]),
        ([250.0, 380.0], [520.0, 330.0], [220, 20, 30]),
    ];
    let sides = |[x, y]: [f64; 2]| {
        let left = 120.0 - 0.1 * (y - 80.0);
        let right = 640.0 + 0.1 * (y - 80.0);
        x > left && x < right && y > 80.0 + 0.05 * (x - 120.0) && y < 500.0
    };
    let off = |[x, y]: [f64; 2], a: [f64; 2], b: [f64; 2]| {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let along = ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy);
        let along = along.clamp(0.0, 1.0);
        (a[0] + along * dx - x).hypot(a[1] + along * dy - y)
    };
    let picture = image::RgbImage::from_fn(800, 600, |x, y| {
        let at = [f64::from(x) + 0.5, f64::from(y) + 0.5];
        let ink = LINES.iter().find(|(a, b, _)| off(at, *a, *b) < 3.5);
        image::Rgb(match ink {
            Some((.., color)) => *color,
            None if sides(at) => [250, 249, 244],
            None if y / 8 % 3 == 0 => [117, 83, 63],
            None => [80, 55, 42],
        })
    });
    let mut jpeg = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
    BASE64_STANDARD.encode(jpeg.into_inner())
}

/// Strokes and corners are reported at their positions in the picture, and exactly the selected
/// strokes are flown.
#[test]
fn what_is_chosen_of_a_picture_is_what_the_photo_and_its_files_have() {
    let server = Server::start(&[]);
    let drawing = json!({ "kind": "jpg", "text": sheet_on_a_desk() });
    let wish =
        |settings: Value| json!({ "visitor": "me", "drawing": drawing, "settings": settings });
    let live = |settings: Value| server.post("live", &wish(settings)).1;
    let sheet = "[122, 82, 642, 108, 680, 498, 80, 498]";
    let whole = live(json!({ "letters.corners_px": sheet }));
    let places = |at: &Value| serde_json::from_value::<Vec<f64>>(at.clone()).unwrap();
    let near = |at: &[f64], [x, y]: [f64; 2]| (at[0] - x).hypot(at[1] - y) < 6.0;
    let corners = json!([[122, 82], [642, 108], [680, 498], [80, 498]]).to_string();
    assert_eq!(whole["source"]["corners"].to_string().replace(".0", ""), corners);
    let strokes = whole["source"]["strokes"].as_array().unwrap();
    assert_eq!(strokes.len(), 2, "{}", whole["source"]);
    let red = strokes.iter().position(|it| it["color"] == "red").expect("a red stroke") + 1;
    let at = places(&strokes[red - 1]["at"]);
    let ends = [[250.0, 380.0], [520.0, 330.0]];
    let last = &at[at.len() - 2..];
    assert!(
        ends.iter().all(|end| near(&at, *end) || near(last, *end)),
        "the red stroke from {ends:?}: {at:?}"
    );

    for settings in [
        json!({ "letters.without": red.to_string(), "letters.corners_px": sheet }),
        json!({ "letters.ink": (3 - red).to_string(), "letters.corners_px": sheet }),
    ] {
        let black = live(settings.clone());
        assert_eq!(black["source"], whole["source"], "what is left out can be brought back");
        assert_eq!(black["replay"]["strokes"].as_array().unwrap().len(), 1, "{settings}");
        let (_, large) =
            server.post("photos", &with(&wish(settings.clone()), json!({ "files": true })));
        assert_eq!(large["replay"]["strokes"].as_array().unwrap().len(), 1, "{settings}");
        let scene = String::from_utf8(file(&large, "scene.toml")).unwrap();
        let set = if settings["letters.ink"].is_null() { "without" } else { "ink" };
        assert!(scene.contains(&format!("{set} = \"")), "{scene}");
    }

    // With other corners, the picture is cropped to another sheet. Impossible corners and endless
    // lists are refused.
    let own = json!([[200, 150], [600, 150], [600, 300], [200, 300]]);
    let flat = "[200, 150, 600, 150, 600, 300, 200, 300]";
    let upper = live(json!({ "letters.corners_px": flat }));
    assert_eq!(json!(upper["source"]["corners"].to_string().replace(".0", "")), own.to_string());
    assert_eq!(upper["source"]["strokes"].as_array().unwrap().len(), 1, "the black one alone");
    for (set, value, why) in [
        ("corners_px", "[0, 0, 9, 9, 9, 0, 0, 9]".to_owned(), "upper left"),
        ("corners_px", "[0, 0, 9, 9]".to_owned(), "corners_px"),
        ("corners_px", "[0, 0, 1e9, 0, 9, 9, 0, 9]".to_owned(), "corners_px"),
        ("without", "1,".repeat(9000), "at most 4096"),
        ("without", "7".to_owned(), "from 1 to 2"),
        ("without", "1-2".to_owned(), "no stroke"),
        ("ink", "/etc/passwd".to_owned(), "from 1 to 2"),
    ] {
        let told = live(with(
            &json!({ "letters.corners_px": sheet }),
            json!({ format!("letters.{set}"): value }),
        ));
        let text = told["error"]["text"].as_str().unwrap_or_default();
        assert!(
            text.contains(why) && !text.contains("/tmp"),
            "{set}={value:.9}: {}",
            told["error"]
        );
    }

    // Strokes can also be omitted from a drawing that is too large for a flight.
    let far: Vec<_> = (0..3000).map(|n| [[0, n], [1000, n]]).collect();
    let text = json!({ "strokes": far }).to_string();
    let long = json!({ "visitor": "me", "drawing": { "kind": "json", "text": text } });
    let told = server.post("live", &long).1;
    assert_eq!(told["error"]["values"]["source"]["strokes"].as_array().unwrap().len(), 3000);
}

/// A kiosk's page accepts no settings and offers no downloads, unlike that of a phone.
#[test]
fn a_kiosk_is_an_address() {
    let folder = tempfile::tempdir().unwrap();
    let brand = "title = \"Hall\"\n[consent]\nen = \"It may hang.\"\n";
    std::fs::write(folder.path().join("brand.toml"), brand).unwrap();
    let server = Server::start(&["--kiosk", "--brand", folder.path().to_str().unwrap()]);
    let about = server.json(&format!("{}about.json", server.path));
    assert_eq!([&about["kiosk"], &about["home"]], [true, false], "{about}");
    assert_eq!(about["brand"]["consent"]["en"], "It may hang.");
    assert!(about["scene"].is_null(), "no settings");
    for more in [
        json!({ "settings": { "camera.iso": "200" } }),
        json!({ "settings": { "controller.pid.roll": "[6.0, 3.0, 0.0]" } }),
        json!({ "room": "4x3x2.5" }),
        json!({ "advice": true }),
    ] {
        let (status, refused) = server.post("photos", &with(&word("I"), more.clone()));
        assert_eq!((status, key(&refused)), (403, "not-here"), "{more}");
    }
    let mut colored = word("I");
    colored["settings"] = json!({ "light.deck": "led-ring", "plan.lights": "[\"ring\"]" });
    assert!(server.post("live", &colored).1["photo"].is_string(), "what its page sets");
    assert_eq!(server.post("script", &word("I")).0, 403, "who flies is no visitor");
    let addresses = server.json(&format!("{}address.json", server.operator));
    let phones = addresses["visitors"].as_str().unwrap().split_once("/k/").unwrap().1;
    let phones = format!("/k/{phones}");
    assert_ne!(phones, server.path);
    assert_eq!(server.json(&format!("{phones}about.json"))["kiosk"], false);
    let here = tempfile::tempdir().unwrap();
    noctograph(here.path()).args(["serve", "--brand", "nowhere"]).assert().code(2);
}

/// The number of entries is limited per sender's address, not per visitor's name.
#[test]
fn entries_are_limited_by_address_and_time() {
    let server = Server::start(&[]);
    let begun = Instant::now();
    let path = format!("{}entries", server.path);
    let mut sent: Vec<TcpStream> = (0..12).map(|_| server.connect()).collect();
    for (n, stream) in sent.iter_mut().enumerate() {
        stream.write_all(&server.posting(&path, &sending(&format!("v{n}"), "I"))).unwrap();
    }
    let most = 7 + begun.elapsed().as_secs() / 5;
    let statuses = sent.iter_mut().map(|stream| {
        let mut status = [0; 12];
        stream.read_exact(&mut status).unwrap();
        String::from_utf8_lossy(&status[9..]).into_owned()
    });
    let statuses: Vec<String> = statuses.collect();
    let n_kept = statuses.iter().filter(|status| *status == "201").count();
    assert!((6..=most).contains(&u64::try_from(n_kept).unwrap()), "{statuses:?}");
    assert_eq!(statuses.iter().filter(|status| *status == "429").count(), 12 - n_kept);
    assert_eq!(server.send("v0", "I").0, 200, "what is there already is no more");
    soon("a moment later there is room", || server.send("late", "I").0 == 201);
}

/// An action that is refused because nothing can be written has no effect.
#[cfg(unix)]
#[test]
fn what_cannot_be_written_is_not_done() {
    let folder = tempfile::tempdir().unwrap();
    let gallery = folder.path().join("gallery");
    let server = Server::start(&["--gallery", gallery.to_str().unwrap()]);
    let ids = ["I", "LI"].map(|text| server.sent("me", text));
    // A folder is created in place of the file, because root ignores file permissions.
    std::fs::create_dir_all(gallery.join("queue.json/x")).unwrap();
    let queue = || server.json(&format!("{}queue.json", server.operator));
    let before = queue();
    assert_eq!(server.operate("pause", &json!({ "paused": true })).0, 507);
    assert_eq!(server.operate("order", &json!({ "ids": [ids[1], ids[0]] })).0, 507);
    assert_eq!(queue(), before);
    std::fs::remove_dir_all(gallery.join("queue.json")).unwrap();
    assert_eq!(server.operate("pause", &json!({ "paused": true })).0, 200);
    assert_eq!(queue()["paused"], true);
}

/// An export does not wait for photos of visitors or of the host.
#[test]
fn the_operator_does_not_wait_for_visitors() {
    let server = Server::start(&[]);
    let id = server.sent("me", "I");
    assert_eq!(server.operate(&format!("entries/{id}"), &json!({ "do": "approve" })).0, 200);
    let mut waiting = Vec::new();
    for n in 0..5 {
        let photo = json!({ "visitor": "me", "word": format!("QUOKKA JELLYFISH {n}") });
        for (route, asked) in [("entries", entry_of(&photo)), ("photos", photo)] {
            let mut stream = server.connect();
            let request = server.posting(&format!("{}{route}", server.path), &asked);
            stream.write_all(&request).unwrap();
            waiting.push((route, stream));
        }
    }
    let (status, zip) = server.at(&format!("{}export.zip", server.operator));
    assert!(status == 200 && zip.starts_with(b"PK"));
    let mut answered = Vec::new();
    for (route, stream) in &mut waiting {
        stream.set_nonblocking(true).unwrap();
        answered.extend(stream.read(&mut [0]).is_ok().then_some(*route));
    }
    for route in ["entries", "photos"] {
        let n_answered = answered.iter().filter(|it| **it == route).count();
        assert!(n_answered < 5, "they wait still: {n_answered} of 5 {route} are answered");
    }
}

/// When a connection closes, its pending requests are abandoned.
#[cfg(target_os = "linux")]
#[test]
fn those_who_hang_up_leave_nothing() {
    let server = Server::start(&[]);
    server.post("live", &word("I"));
    let seen = server.json(&format!("{}wall", server.path))["revision"].as_u64().unwrap();
    let news = server.getting(&format!("{}news?seen={seen}", server.path));
    let threads = server.figure("Threads");
    for _ in 0..1500 {
        server.connect().write_all(&news).unwrap();
    }
    let path = format!("{}photos", server.path);
    for n in 0..40 {
        let wish = json!({ "visitor": format!("y{n}"), "word": "QUOKKA JELLYFISH" });
        server.connect().write_all(&server.posting(&path, &wish)).unwrap();
    }
    assert_eq!(server.get("wall").0, 200);
    assert!(server.figure("Threads") <= threads + 16, "{}", server.figure("Threads"));
    server.post("photos", &word("I"));
}

/// A folder that a killed server was writing is not an entry, and neither is a folder with an
/// impossible number.
#[test]
fn what_was_not_finished_is_no_entry() {
    let folder = tempfile::tempdir().unwrap();
    let gallery = folder.path().join("gallery");
    for (name, number) in
        [(".noctograph-abcdef.tmp", 1_u64), ("4294967295-I", 4_294_967_295), ("0007-I", 7)]
    {
        let entry = json!({
            "id": format!("{number:032}"), "key": format!("{number:032}"), "number": number,
            "title": "I", "made": "2026-01-01T00:00:00Z", "state": "approved", "visitor": "v",
            "photo": "p", "language": "en", "found": {},
        });
        std::fs::create_dir_all(gallery.join(name)).unwrap();
        std::fs::write(gallery.join(name).join("entry.json"), entry.to_string()).unwrap();
    }
    let server = Server::start(&["--gallery", gallery.to_str().unwrap()]);
    let wall = server.json(&format!("{}wall", server.path));
    assert_eq!(wall["photos"].as_array().unwrap().len(), 1, "{wall}");
    assert_eq!(server.send("you", "I").1["number"], 8);
}

/// Only one server may use a gallery, in which links and foreign files are ignored.
#[cfg(unix)]
#[test]
fn a_gallery_is_not_what_somebody_puts_there() {
    let folder = tempfile::tempdir().unwrap();
    let gallery = folder.path().join("gallery");
    let flags = ["--gallery", gallery.to_str().unwrap()];
    let mut server = Server::start(&flags);
    let second = noctograph(folder.path()).arg("serve").args(flags).assert().code(2);
    assert!(String::from_utf8_lossy(&second.get_output().stderr).contains("another server"));
    let ids = ["I", "LI"].map(|text| server.sent("me", text));
    server.kill();

    let (secret, own) = (folder.path().join("secret"), gallery.join("0001-I"));
    std::fs::write(&secret, "secret").unwrap();
    for name in ["photo.jpg", "photo.png"] {
        std::fs::remove_file(own.join(name)).unwrap();
        std::os::unix::fs::symlink(&secret, own.join(name)).unwrap();
    }
    let moved = folder.path().join("moved");
    std::fs::rename(gallery.join("0002-LI"), &moved).unwrap();
    std::os::unix::fs::symlink(&moved, gallery.join("0002-LI")).unwrap();
    std::fs::File::create(gallery.join("0003-BIG.png")).unwrap().set_len(200 << 20).unwrap();
    std::fs::create_dir(gallery.join("0003-X")).unwrap();
    std::fs::File::create(gallery.join("0003-X/entry.json")).unwrap().set_len(200 << 20).unwrap();

    let server = Server::start(&flags);
    for name in ["photo.jpg", "photo.png"] {
        let (status, body) = server.at(&format!("/e/{}/{name}", ids[0]));
        assert!(status == 404 && !body.starts_with(b"secret"), "{name}");
    }
    assert_eq!(server.at(&format!("/e/{}/entry.json", ids[1])).0, 404, "a link is no entry");
    // Nothing is written into a folder that was created by hand under the next name.
    std::fs::create_dir(gallery.join("0002-I")).unwrap();
    std::fs::write(gallery.join("0002-I/mine"), "by hand").unwrap();
    assert_eq!(server.send("you", "I").1["number"], 3);
    assert!(!gallery.join("0002-I/entry.json").exists());
}

/// Clients that send nothing, or that continue to send after a refusal, do not block others.
#[test]
fn strangers_keep_nobody_out() {
    let server = Server::start(&[]);
    let mut strangers: Vec<TcpStream> = (0..300).map(|_| server.connect()).collect();
    for stranger in &mut strangers {
        let _ = stranger.write_all(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n");
    }
    let last = strangers.last_mut().unwrap();
    let begun = Instant::now();
    let mut is_closed = false;
    while begun.elapsed() < PATIENCE && !is_closed {
        assert_eq!(server.get("alive").0, 200);
        std::thread::sleep(Duration::from_millis(100));
        is_closed = last.write_all(b"x").is_err();
    }
    assert!(is_closed, "a refused connection is closed, whatever it says");
}

/// Photos and scripts are made one at a time, and never for clients that have disconnected.
#[cfg(target_os = "linux")]
#[test]
fn jobs_wait_in_line_and_end_with_their_connection() {
    let server = Server::start(&[]);
    let path = format!("{}script", server.path);
    for _ in 0..20 {
        server.connect().write_all(&server.posting(&path, &word("NOOR"))).unwrap();
    }
    let most = (0..10).map(|_| {
        std::thread::sleep(Duration::from_millis(30));
        children(server.child.id()).len()
    });
    assert!(most.max().unwrap() <= 2, "two workers, however much is asked for");
    assert_eq!(server.post("live", &word("I")).0, 200);
}

/// A drawing that takes too long is stopped in time, and does not use the server's memory.
#[cfg(target_os = "linux")]
#[test]
fn a_large_drawing_ends() {
    let server = Server::start(&[]);
    assert_eq!(server.post("live", &word("I")).0, 200);
    let strokes: String =
        (0..9000).map(|n| format!("M{} {}h2", n * 37 % 997, n * 71 % 401)).collect();
    let svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 1000 400'><path stroke='red' d='{strokes}'/></svg>"
    );
    let drawing = json!({ "visitor": "large", "drawing": { "kind": "svg", "text": svg } });
    let mut large = server.connect();
    large.write_all(&server.posting(&format!("{}live", server.path), &drawing)).unwrap();
    for text in ["LI", "IL", "LL"] {
        assert_eq!(server.post("live", &word(text)).1["verdict"]["read"], text);
    }
    assert!(server.figure("VmHWM") < 150_000, "{} kB", server.figure("VmHWM"));
    let mut answer = String::new();
    large.read_to_string(&mut answer).unwrap();
    assert!(answer.contains("200"), "it is answered, too");
}

/// A killed server leaves no process behind, and the next server removes what remains on the disk.
#[cfg(target_os = "linux")]
#[test]
fn a_killed_server_leaves_nothing() {
    let temporary = tempfile::tempdir().unwrap();
    let names = || {
        let names = std::fs::read_dir(temporary.path()).unwrap().flatten();
        names.map(|entry| entry.file_name()).collect::<Vec<_>>()
    };
    let mut server = Server::start_in(temporary.path(), &[]);
    server.sent("me", "I");
    server.post("live", &word("I"));
    // A worker that is busy ends as well.
    let mut asking = server.connect();
    let path = format!("{}script", server.path);
    asking.write_all(&server.posting(&path, &word("NOOR"))).unwrap();
    std::thread::sleep(Duration::from_millis(50));
    let workers = children(server.child.id());
    assert_eq!(workers.len(), 2, "{workers:?}");
    server.kill();
    let lives = |number: &u32| {
        let line = std::fs::read_to_string(format!("/proc/{number}/cmdline")).unwrap_or_default();
        line.contains("--worker")
    };
    soon("workers end with their server", || !workers.iter().any(lives));
    let before = names();
    assert_eq!(before.len(), 1, "{before:?}");
    let _again = Server::start_in(temporary.path(), &[]);
    let after = names();
    assert!(after.len() == 1 && after != before, "{before:?}, then {after:?}");
}
