//! `noctograph serve`: a page on which a word becomes a photo while one types or draws it.
//!
//! A request comes in through [`http`], is admitted by [`guard`], becomes a [`wish`], waits in a
//! [`queue`] and is made by the [`studio`]; the [`wall`] shows what was hung up. The page itself is
//! one file, put together from `page.html`, `page.css`, `page.js` and the table of its words.

use std::ffi::OsString;
use std::hash::{BuildHasher, RandomState};
use std::io::{Read, Write};
use std::net::{IpAddr, Ipv4Addr, TcpListener, TcpStream, UdpSocket};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Args;
use serde_json::{Value, json};

use super::outcome::{Report, line};
use super::{STACK, message, print};
use crate::error::{Error, Result};
use crate::light::{LightOptions, color_led_wrgb, ring_rgb};
use crate::scene::Scene;
use guard::{Admitted, Guard};
use http::{Answer, Answered, Connection, Head, Refusal};
use queue::Queue;
use studio::{Kept, Studio};
use wall::Wall;
use wish::{Wish, preview_args};

mod guard;
mod http;
mod queue;
mod studio;
mod wall;
mod wish;

/// Most connections at a time. A browser keeps six.
const MAX_CONNECTIONS: usize = 64;

#[derive(Debug, Args)]
pub(super) struct ServeArgs {
    /// Scene that the page begins with
    #[arg(long, value_name = "SCENE")]
    scene: Option<OsString>,
    /// Port; 0 takes one that is free
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
    /// Folder that keeps the photos of the wall [default: until the program ends]
    #[arg(long, value_name = "DIR")]
    gallery: Option<PathBuf>,
    /// Serve the local network too: whoever has the address may write and draw
    #[arg(long)]
    network: bool,
    /// Open the page in the browser
    #[arg(long)]
    open: bool,
}

pub(super) fn run(args: &ServeArgs) -> Result<Report> {
    let base: Vec<OsString> = match &args.scene {
        Some(scene) => vec!["--scene".into(), scene.clone()],
        None => Vec::new(),
    };
    // A scene that cannot be flown is refused now, not by every visitor's photo.
    let scene = preview_args([base.clone(), vec!["--word=A".into()]].concat())?.shoot()?.scene;
    let wall = Wall::open(args.gallery.as_deref())?;
    let ip = if args.network { Ipv4Addr::UNSPECIFIED } else { Ipv4Addr::LOCALHOST };
    let refused = |source: std::io::Error| {
        let hint = "choose another port, or 0 for one that is free";
        Error::input("--port", format!("{} ({source})", args.port), "a port that is free", hint)
    };
    let listener = TcpListener::bind((ip, args.port)).map_err(refused)?;
    let port = listener.local_addr().map_err(refused)?.port();
    let guard = Guard { token: token(), port, network: args.network };
    let address = |ip: IpAddr| format!("http://{ip}:{port}/k/{}/", guard.token);
    let own = address(Ipv4Addr::LOCALHOST.into());
    let mut text = line("page", &own);
    if let Some(ip) = args.network.then(own_ip).flatten() {
        text += &line("network", &address(ip));
        text += &line("", "whoever has this address may write, draw and hang photos up");
    }
    print(&(text + &line("", "Ctrl-C ends it")))?;
    if args.open {
        open(&own);
    }
    let server = Arc::new(Server::start(guard, page_of(&scene), Studio::new(base, pool()?), wall)?);
    // A connection that failed before it was taken is of no concern.
    for stream in listener.incoming().flatten() {
        server.clone().take(stream);
    }
    Ok(Report::new(String::new(), json!({})))
}

/// The secret part of the address, from the random keys of the standard library's hash maps.
fn token() -> String {
    let random = RandomState::new();
    format!("{:016x}{:016x}", random.hash_one(0), random.hash_one(1))
}

/// The address of this machine in its network. Nothing is sent: the socket only looks up the route
/// to an address that is kept free for examples (RFC 5737).
fn own_ip() -> Option<IpAddr> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
    socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9)).ok()?;
    Some(socket.local_addr().ok()?.ip())
}

fn open(address: &str) {
    let opener = match std::env::consts::OS {
        "macos" => "open",
        "windows" => "explorer",
        _ => "xdg-open",
    };
    let quiet = || Stdio::null();
    let opened =
        Command::new(opener).arg(address).stdin(quiet()).stdout(quiet()).stderr(quiet()).spawn();
    if opened.is_err() {
        message("note: ", &format!("no {opener} here: open the address in a browser"));
    }
}

/// Threads of the photos while one types: the verb itself occupies one of the program's own.
fn pool() -> Result<rayon::ThreadPool> {
    let threads =
        rayon::ThreadPoolBuilder::new().num_threads(rayon::current_num_threads()).stack_size(STACK);
    threads.build().map_err(|error| no_thread(&error))
}

fn no_thread(error: &dyn std::fmt::Display) -> Error {
    let hint = "allow more processes (ulimit -u)".to_owned();
    Error::Infeasible { what: format!("no thread can be started: {error}"), hint }
}

/// What answers the requests.
struct Server {
    guard: Guard,
    page: String,
    studio: Arc<Studio>,
    /// Photos while one types.
    live: Arc<Queue>,
    /// Large photos and files.
    large: Arc<Queue>,
    wall: Wall,
    connections: AtomicUsize,
}

impl Server {
    fn start(guard: Guard, page: String, studio: Studio, wall: Wall) -> Result<Self> {
        let [live, large] = [(); 2].map(|()| Arc::new(Queue::default()));
        for queue in [&live, &large] {
            let queue = queue.clone();
            let worker = std::thread::Builder::new().stack_size(STACK);
            worker.spawn(move || queue.work()).map_err(|error| no_thread(&error))?;
        }
        let studio = Arc::new(studio);
        Ok(Self { guard, page, studio, live, large, wall, connections: AtomicUsize::new(0) })
    }

    /// Answers a connection in a thread of its own, or refuses it where there are too many.
    fn take(self: Arc<Self>, stream: TcpStream) {
        let full = self.connections.fetch_add(1, Ordering::Relaxed) >= MAX_CONNECTIONS;
        let counted = Counted(self);
        if full {
            return refuse(&stream);
        }
        // Without a thread the connection is closed.
        let _ = std::thread::Builder::new().spawn(move || {
            let mut connection = Connection::new(stream);
            let answer = counted.0.answer(&mut connection).unwrap_or_else(Answer::from);
            connection.answer(answer);
            drop(counted);
        });
    }

    fn answer(&self, connection: &mut Connection) -> Answered<Answer> {
        let head = connection.head()?;
        match self.guard.admit(&head)? {
            Admitted::Get(route) => self.get(&route, &head),
            Admitted::Post(route, length) => self.post(&route, &connection.body(length)?),
        }
    }

    fn get(&self, route: &str, head: &Head) -> Answered<Answer> {
        let parts: Vec<&str> = route.split('/').collect();
        match *parts.as_slice() {
            [""] => Ok(page(&self.page, head.peer.is_loopback())),
            ["wall"] => Ok(Answer::json(&self.wall.list())),
            ["wall", number] => {
                let photo = number.parse().ok().and_then(|number| self.wall.photo(number));
                Ok(Answer::whole("image/png", photo.ok_or(NOTHING)?.to_vec()))
            }
            ["photos", id, name] => {
                let kept = id.parse().ok().and_then(|id| self.studio.kept(id)).ok_or(GONE)?;
                self.file(&kept, name, head)
            }
            _ => Err(NOTHING),
        }
    }

    /// A file of a large photo.
    fn file(&self, kept: &Kept, name: &str, head: &Head) -> Answered<Answer> {
        let studio = &self.studio;
        let (kind, made) = match name {
            "photo.png" => ("image/png", Ok(kept.png.to_vec())),
            "plan.svg" => ("image/svg+xml", studio.plan(kept)),
            "report.html" => ("text/html; charset=utf-8", studio.report(kept)),
            // Who flies sits at this machine.
            "flight.zip" if !head.peer.is_loopback() => {
                return Err(Refusal(403, "the script is given to the machine of the program only"));
            }
            "flight.zip" => ("application/zip", studio.script(kept)),
            _ => return Err(NOTHING),
        };
        Ok(match made {
            Ok(bytes) => Answer::whole(kind, bytes),
            Err(error) => {
                Answer::whole("text/plain; charset=utf-8", format!("{error}\n{}\n", error.hint()))
            }
        })
    }

    fn post(&self, route: &str, body: &[u8]) -> Answered<Answer> {
        match route {
            "live" => self.shoot(body, &self.live, |studio, wish, stop| studio.live(wish, stop)),
            "photos" => {
                self.shoot(body, &self.large, |studio, wish, stop| studio.large(wish, stop))
            }
            "wall" => self.hang(body),
            _ => Err(NOTHING),
        }
    }

    /// Queues a photo, in place of older ones of the same visitor.
    fn shoot(
        &self,
        body: &[u8],
        queue: &Queue,
        make: fn(&Studio, &Wish, &crate::shoot::Stop) -> Result<Value>,
    ) -> Answered<Answer> {
        let wish = match Wish::parse(body) {
            Ok(wish) => wish,
            Err(error) => return Ok(Answer::json(&queue::failed(&error))),
        };
        let studio = self.studio.clone();
        [&self.live, &self.large].iter().for_each(|queue| queue.end(&wish.visitor));
        let visitor = wish.visitor.clone();
        let answer = queue.push(&visitor, Box::new(move |stop| make(&studio, &wish, stop)));
        let answer = answer.ok_or(Refusal(503, "many visitors wait: try again"))?;
        Ok(Answer::json(&answer.recv().unwrap_or(Value::Null)))
    }

    fn hang(&self, body: &[u8]) -> Answered<Answer> {
        let wanted: Value =
            serde_json::from_slice(body).map_err(|_broken| Refusal(400, "no JSON"))?;
        let kept = wanted["id"].as_u64().and_then(|id| self.studio.kept(id)).ok_or(GONE)?;
        match self.wall.hang(kept.wish.title(), kept.png) {
            Ok(number) => Ok(Answer::json(&json!({ "number": number }))),
            Err(error) => Ok(Answer::json(&queue::failed(&error))),
        }
    }
}

const NOTHING: Refusal = Refusal(404, "there is nothing here");
const GONE: Refusal = Refusal(404, "this photo is no longer kept: take it again");

/// A connection that counts until it is dropped.
struct Counted(Arc<Server>);

impl Drop for Counted {
    fn drop(&mut self) {
        self.0.connections.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Refuses a connection without a thread for it, and without waiting for its request.
fn refuse(mut stream: &TcpStream) {
    let _ = stream.set_nonblocking(true);
    // What has come is taken, or else the answer would be lost with it.
    let _ = stream.read(&mut [0; 8192]);
    let _ = stream.write_all(
        b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 2\r\nContent-Length: 0\r\nConnection: \
          close\r\n\r\n",
    );
}

/// The page with the values of a scene in its controls.
fn page_of(scene: &Scene) -> String {
    // In a script, `<` could end it.
    let scene = json!(scene).to_string().replace('<', "\\u003c");
    include_str!("page.html")
        .replace("/*css*/", include_str!("page.css"))
        .replace("/*words*/", include_str!("words.json"))
        .replace("/*scene*/", &scene)
        .replace("/*js*/", &include_str!("page.js").replace("/*colors*/", &colors()))
}

/// Colors that the page offers: of the screen, and the bytes of each lamp that show them.
fn colors() -> String {
    let colors = [
        ("white", [255, 255, 255]),
        ("red", [255, 0, 0]),
        ("orange", [255, 165, 0]),
        ("yellow", [255, 255, 0]),
        ("green", [0, 255, 0]),
        ("cyan", [0, 255, 255]),
        ("blue", [0, 0, 255]),
        ("magenta", [255, 0, 255]),
    ];
    let entry = |(name, screen): (&str, [u8; 3])| {
        let deck = color_led_wrgb(screen, LightOptions::default().color_led_levels);
        let [r, g, b] = ring_rgb(screen);
        format!("{name}: {}", json!({ "screen": screen, "color-led": deck, "ring": [0, r, g, b] }))
    };
    format!("{{ {} }}", colors.map(entry).join(", "))
}

/// The page, which asks nobody else for anything.
fn page(page: &str, at_home: bool) -> Answer {
    let page = page.replace("/*home*/", if at_home { "true" } else { "false" });
    Answer::whole("text/html; charset=utf-8", page).with_field(
        "Content-Security-Policy",
        "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src \
         'self'; img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    )
}
