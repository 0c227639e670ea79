//! `noctograph serve` over raw sockets: who is let in, what a visitor gets, and what the server
//! survives. `tests/page` drives the page in a browser.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::cli::noctograph;

/// A server that ends with its test.
struct Server {
    child: Child,
    port: u16,
    /// Path of the page, with its token.
    path: String,
}

impl Server {
    fn start(more: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_noctograph"))
            .arg("serve")
            .args(more)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().rsplit(' ').next().unwrap().strip_prefix("http://127.0.0.1:");
        let (port, path) = address.unwrap_or_else(|| panic!("{line}")).split_once('/').unwrap();
        Self { child, port: port.parse().unwrap(), path: format!("/{path}") }
    }

    fn connect(&self) -> TcpStream {
        TcpStream::connect(("127.0.0.1", self.port)).unwrap()
    }

    /// Status, head and body of the answer to a request.
    fn ask(&self, request: &[u8]) -> (u16, String, Vec<u8>) {
        let mut stream = self.connect();
        // A request that is refused early may not be taken whole.
        let _ = stream.write_all(request);
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let end = answer.windows(4).position(|four| four == b"\r\n\r\n").expect("a head") + 4;
        let body = answer.split_off(end);
        let head = String::from_utf8(answer).unwrap();
        (head[9..12].parse().unwrap(), head, body)
    }

    fn get(&self, route: &str) -> (u16, Vec<u8>) {
        let host = format!("127.0.0.1:{}", self.port);
        let request = format!("GET {}{route} HTTP/1.1\r\nHost: {host}\r\n\r\n", self.path);
        let (status, _, body) = self.ask(request.as_bytes());
        (status, body)
    }

    fn post(&self, route: &str, body: &Value) -> (u16, Value) {
        let (status, head, body) = self.ask(&self.posting(route, body));
        assert!(status != 503 || head.contains("Retry-After"), "{head}");
        (status, serde_json::from_slice(&body).unwrap_or(Value::Null))
    }

    fn posting(&self, route: &str, body: &Value) -> Vec<u8> {
        let (body, host) = (body.to_string(), format!("127.0.0.1:{}", self.port));
        let head = format!(
            "POST {}{route} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nSec-Fetch-Site: \
             same-origin\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n",
            self.path,
            body.len()
        );
        (head + &body).into_bytes()
    }

    /// A figure of the server's process, such as `Threads` or `VmRSS` in kB.
    fn figure(&self, name: &str) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix(&format!("{name}:")));
        line.unwrap().split_whitespace().next().unwrap().parse().unwrap()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn word(word: &str) -> Value {
    json!({ "visitor": "me", "word": word })
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
        ("a wrong token", get("/k/0123456789abcdef0123456789abcdef/", &own), 403),
        ("a path upward", get(&format!("{path}../../etc/passwd"), &own), 404),
        ("the same, encoded", get(&format!("{path}photos%2f..%2f..%2fetc"), &own), 404),
        ("a photo that is not there", get(&format!("{path}photos/1/photo.png"), &own), 404),
        ("another method", format!("PUT {path} HTTP/1.1\r\n{own}\r\n").into_bytes(), 405),
        ("no HTTP", b"\x16\x03\x01 hello\r\n\r\n".to_vec(), 400),
        ("a long head", get(path, &format!("{own}X: {}\r\n", "x".repeat(20_000))), 431),
        ("a foreign origin", post(&format!("{json}Origin: http://evil.example\r\n")), 403),
        ("an opaque origin", post(&format!("{json}Origin: null\r\n")), 403),
        ("a foreign site", post(&format!("{json}Sec-Fetch-Site: cross-site\r\n")), 403),
        ("a form", post("Content-Type: text/plain\r\nContent-Length: 2\r\n"), 415),
        ("no length", post(json), 411),
        ("a length in words", post(&format!("{json}Content-Length: two\r\n")), 400),
        ("a large body", post(&format!("{json}Content-Length: 300000\r\n")), 413),
        ("a body that fits", post(&format!("{json}Content-Length: 2\r\n")), 200),
    ];
    for (name, request, want) in cases {
        let (status, head, _) = server.ask(&request);
        assert_eq!(status, want, "{name}: {head}");
        assert!(head.contains("X-Content-Type-Options: nosniff"), "{name}");
        assert!(!head.contains("Access-Control"), "{name}: no leave for other origins");
    }
    let (_, head, page) = server.ask(&get(path, &own));
    assert!(head.contains("frame-ancestors 'none'") && page.len() <= 100_000, "{} B", page.len());

    // A head that never ends is waited for, and no longer than five seconds.
    let begun = Instant::now();
    let mut slow = server.connect();
    slow.write_all(b"GET / HTTP/1.1\r\nHost:").unwrap();
    let mut answer = String::new();
    slow.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 408") && begun.elapsed() < Duration::from_secs(9));
}

#[test]
fn a_wish_reaches_no_file_and_no_flag() {
    let server = Server::start(&[]);
    let refused = |wish: Value, why: &str| {
        let (status, answer) = server.post("live", &wish);
        let error = answer["error"].as_str().unwrap_or_default();
        assert!(status == 200 && error.contains(why), "{wish}: {answer}");
    };
    refused(word("ABCDEFGHIJKLMNOPQRSTUVWXYZ"), "26 letters, wanted at most 24");
    refused(word("  "), "found nothing");
    refused(json!({ "visitor": "v".repeat(99), "word": "A" }), "visitor");
    refused(json!({ "visitor": "me", "word": "A", "output": "/tmp/x" }), "output");
    for key in ["letters.drawing", "letters", "photo.background", "camera.width_px", "word"] {
        refused(json!({ "visitor": "me", "word": "A", "settings": { key: "1" } }), key);
    }
    let font = json!({ "letters.font": "/etc/passwd" });
    refused(json!({ "visitor": "me", "word": "A", "settings": font }), "letters.font");
    refused(json!({ "visitor": "me", "word": "A", "settings": { "seed": "1\n[light]" } }), "seed");
    refused(json!({ "visitor": "me", "word": "A", "room": "--help" }), "--room");
    let svg = json!({ "kind": "svg", "text": "<svg/>" });
    refused(json!({ "visitor": "me", "drawing": svg }), "drawing");
    refused(json!({ "visitor": "me", "drawing": { "kind": "../x", "text": "" } }), "variant");
    let mut deep = word("A");
    deep["settings"] = serde_json::from_str(&("[".repeat(100) + &"]".repeat(100))).unwrap();
    refused(deep, "request");

    // Words that look like flags and files are words.
    for text in ["--help", "x.csv", "-o"] {
        let (_, answer) = server.post("live", &word(text));
        assert!(answer["photo"].is_string(), "{text}: {}", answer["error"]);
    }
}

#[test]
fn a_visitor_gets_a_photo_and_its_files() {
    let server = Server::start(&[]);
    let (_, live) = server.post("live", &word("OSLO"));
    assert_eq!(live["verdict"]["read"], "OSLO", "{live}");
    assert!(live["photo"].as_str().unwrap().starts_with("data:image/jpeg;base64,/9j/"), "a JPEG");

    let (_, large) = server.post("photos", &word("OSLO"));
    assert_eq!((&large["id"], &large["read"]), (&json!(1), &json!("OSLO")), "{large}");
    let (_, png) = server.get("photos/1/photo.png");
    let folder = tempfile::tempdir().unwrap();
    let typed = ["preview", "OSLO", "--size", "1920x1080", "--backend", "cpu", "-o"];
    noctograph(folder.path()).args(typed).arg(".").assert().success();
    assert!(png == std::fs::read(folder.path().join("photo.png")).unwrap(), "the same bytes");
    let begins = |route: &str, with: &[u8]| {
        let (status, body) = server.get(route);
        assert!(status == 200 && body.starts_with(with), "{route}: {status}");
    };
    begins("photos/1/plan.svg", b"<svg");
    begins("photos/1/report.html", b"<!doctype html>");
    begins("photos/1/flight.zip", b"PK\x03\x04");

    assert_eq!(server.post("wall", &json!({ "id": 2 })).0, 404, "no such photo");
    assert_eq!(server.post("wall", &json!({ "id": 1 })).1, json!({ "number": 1 }));
    let (_, wall) = server.get("wall");
    assert_eq!(wall, br#"[{"number":1,"word":"OSLO"}]"#);
    assert!(server.get("wall/1").1 == png, "the photo itself hangs there");
}

#[test]
fn a_scene_that_cannot_be_flown_is_refused_at_once() {
    let here = tempfile::tempdir().unwrap();
    noctograph(here.path()).args(["serve", "--scene", "nosuch"]).assert().code(2);
    let held = std::net::TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = held.local_addr().unwrap().port().to_string();
    noctograph(here.path()).args(["serve", "--port", &port]).assert().code(2);
}

/// A thousand wishes from 32 connections: each is answered or told to come again, and nothing is left.
#[cfg(target_os = "linux")]
#[test]
fn a_crowd_leaves_neither_threads_nor_memory() {
    let server = Server::start(&[]);
    // Refused by the scene, so that the line moves quickly.
    let wish = |n: usize| {
        let settings = json!({ "preset": "\"none\"" });
        json!({ "visitor": format!("v{n}"), "word": "A", "settings": settings })
    };
    (0..10).for_each(|n| drop(server.post("live", &wish(n))));
    // The thread of the last answer may still be ending: one too many is counted at most.
    let (threads, memory) = (server.figure("Threads"), server.figure("VmRSS"));
    let crowd = |first: usize| {
        let answers = (0..32).map(|n| server.post("live", &wish(32 * first + n)));
        answers.map(|(status, _)| status).collect::<Vec<_>>()
    };
    let statuses: Vec<u16> = std::thread::scope(|scope| {
        let crowds: Vec<_> = (0..32).map(|n| scope.spawn(move || crowd(n))).collect();
        crowds.into_iter().flat_map(|crowd| crowd.join().unwrap()).collect()
    });
    assert!(statuses.iter().all(|status| matches!(status, 200 | 503)), "{statuses:?}");
    let done = statuses.iter().filter(|status| **status == 200).count();
    assert!((1..statuses.len()).contains(&done), "{done} of {}: some wait", statuses.len());
    let begun = Instant::now();
    while server.figure("Threads") > threads && begun.elapsed() < Duration::from_secs(8) {
        std::thread::sleep(Duration::from_millis(50));
    }
    let left = server.figure("Threads");
    assert!(left <= threads, "{threads} threads before, {left} after");
    let after = server.figure("VmRSS");
    let growth = after as f64 / memory as f64;
    assert!(growth <= 1.1, "{memory} kB before, {after} kB after");
    assert_eq!(server.post("live", &word("OSLO")).1["verdict"]["read"], "OSLO", "it lives on");
}

#[test]
fn a_gallery_survives_a_kill() {
    let folder = tempfile::tempdir().unwrap();
    let gallery = folder.path().join("gallery");
    let flag = gallery.to_str().unwrap();
    let mut server = Server::start(&["--gallery", flag]);
    server.post("photos", &word("OSLO"));
    assert_eq!(server.post("wall", &json!({ "id": 1 })).1, json!({ "number": 1 }));
    // A visitor waits for a photo, and another hangs photos up, when the program is killed.
    let mut waiting = server.connect();
    waiting.write_all(&server.posting("photos", &word("KYOTO"))).unwrap();
    let mut hanging: Vec<TcpStream> = (0..8).map(|_| server.connect()).collect();
    for stream in &mut hanging {
        stream.write_all(&server.posting("wall", &json!({ "id": 1 }))).unwrap();
    }
    std::thread::sleep(Duration::from_millis(5));
    server.child.kill().unwrap();
    server.child.wait().unwrap();
    let photos = photos_in(&gallery);
    assert!(!photos.is_empty() && photos.iter().all(|photo| *photo == photos[0]), "all are whole");
    let again = Server::start(&["--gallery", flag]);
    let wall: Value = serde_json::from_slice(&again.get("wall").1).unwrap();
    assert_eq!(wall.as_array().unwrap().len(), photos.len());
}

/// The bytes of the photos in a folder.
fn photos_in(folder: &Path) -> Vec<Vec<u8>> {
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let photos = paths.filter(|path| path.extension().is_some_and(|end| end == "png"));
    photos.map(|path| std::fs::read(path).unwrap()).collect()
}
