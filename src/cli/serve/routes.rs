//! What is answered at which address.

use std::net::{IpAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use serde::de::DeserializeOwned;
use serde_json::Map;

use super::block::BlockList;
use super::brand::Brand;
use super::door::{Door, Taken};
use super::entries::{Entries, MOST_OF_VISITOR};
use super::guard::{Admitted, Base, Guard};
use super::http::{Answer, Answered, Connection, Head, MAX_BODY};
use super::kept::{Kept, Photos};
use super::page::FILES;
use super::queue::{Numbers, Outcome, Queue};
use super::said::{Key, Said, Told};
use super::studio::{JPEG, OUT, PNG, REPLAY};
use super::wish::{MAX_WORD, Task, Wish, is_name};
use super::{Value, address, json, qr};
use crate::export::zip::zip;
use crate::light::{LightOptions, color_led_wrgb, ring_rgb};
use crate::scene::Scene;
use noctograph_core::files::{Limit, files_in};

/// Files of an archive: their names and bytes.
type NamedFiles = Vec<(String, Vec<u8>)>;

/// How often it is looked whether a visitor who waits is still there.
const LOOK: Duration = Duration::from_millis(100);
/// A file of a script, or of the page while one works on it.
const FILE: Limit = Limit { bytes: 64 << 20, what: "a file of an entry", hint: "remove it" };

/// What the hall is like.
#[derive(Debug)]
pub(super) struct Hall {
    /// Whether the screen stands in the hall: no settings and no downloads.
    pub(super) kiosk: bool,
    pub(super) brand: Brand,
    pub(super) block: BlockList,
    /// Values that the controls begin with.
    pub(super) scene: Scene,
    /// Folder of the page's files in place of the program's own.
    pub(super) page_from: Option<PathBuf>,
    /// This machine, as visitors see it.
    pub(super) ip: IpAddr,
    /// Name of this run of the program.
    pub(super) boot: String,
}

/// What answers the requests.
#[derive(Debug)]
pub(super) struct Server {
    guard: Guard,
    hall: Hall,
    /// Photos while one types.
    live: Arc<Queue>,
    /// Large photos and files.
    large: Arc<Queue>,
    numbers: Mutex<Numbers>,
    photos: Photos,
    pub(super) entries: Entries,
    door: Arc<Door>,
    /// Changes with the program, so that browsers know when the page did.
    mark: String,
}

/// A request that was let in, and its connection as long as it is answered.
struct Asked<'a> {
    head: &'a Head,
    admitted: Admitted,
    connection: &'a Connection,
    taken: &'a Taken,
}

impl Server {
    pub(super) fn new(
        guard: Guard,
        hall: Hall,
        live: Arc<Queue>,
        large: Arc<Queue>,
        entries: Entries,
    ) -> Self {
        let all: Vec<u8> = FILES.iter().flat_map(|(_, text)| text.bytes()).collect();
        let mark = format!("\"{}\"", &noctograph_core::digest::sha256(&all)[..16]);
        let (numbers, photos, door) = Default::default();
        Self { guard, hall, live, large, numbers, photos, entries, door, mark }
    }

    /// Answers a connection in a thread of its own, or refuses it where there are too many.
    pub(super) fn take(self: Arc<Self>, stream: TcpStream) {
        let Some(taken) = self.door.enter(&stream) else { return };
        // Without a thread the connection is closed.
        let _ = std::thread::Builder::new().spawn(move || {
            let mut connection = Connection::new(stream);
            let answer = self.answer(&mut connection, &taken).unwrap_or_else(Answer::from);
            connection.answer(answer);
            drop(taken);
        });
    }

    fn answer(&self, connection: &mut Connection, taken: &Taken) -> Answered<Answer> {
        let head = connection.head()?;
        let admitted = self.guard.admit(&head)?;
        let body = admitted.length.map(|length| connection.body(length)).transpose()?;
        let route = admitted.route.clone();
        let parts: Vec<&str> = route.split('/').collect();
        let asked = Asked { head: &head, admitted, connection, taken };
        let told = match (&asked.admitted.base, body) {
            (Base::Visitors, Some(body)) => self.post(&parts, &body, &asked),
            (Base::Operator, Some(body)) => self.operate(&parts, &body),
            (Base::Entry(_), Some(_)) => Err(Key::NotHere),
            (Base::Visitors, None) => self.get(&parts, &asked),
            (Base::Operator, None) => self.look(&parts, &asked),
            (Base::Entry(id), None) => self.take_home(id, &parts, &asked),
        };
        Ok(told.unwrap_or_else(Answer::from))
    }

    /// What every address has: the page, who one is, and news.
    fn common(&self, parts: &[&str], asked: &Asked<'_>) -> Told<Answer> {
        let boot = &self.hall.boot;
        match *parts {
            ["alive"] => Ok(Answer::json(&json!({ "boot": boot }))),
            ["news"] => {
                let seen = asked.admitted.query.strip_prefix("seen=");
                let seen = seen.and_then(|seen| seen.parse().ok()).unwrap_or(0);
                let revision = self.entries.news(seen);
                Ok(Answer::json(&json!({ "revision": revision, "boot": boot })))
            }
            ["about.json"] => Ok(Answer::json(&self.about(asked))),
            ["brand", "logo.svg"] => {
                let logo = self.hall.brand.logo.clone().ok_or(Key::Gone)?;
                Ok(drawing(Answer::whole(SVG, logo)))
            }
            _ => self.page(&asked.admitted.route, asked),
        }
    }

    fn page(&self, route: &str, asked: &Asked<'_>) -> Told<Answer> {
        let first = match &asked.admitted.base {
            Base::Visitors => "index.html",
            Base::Operator => "operator.html",
            Base::Entry(_) => "entry.html",
        };
        let name = if route.is_empty() { first } else { route };
        let answer = match &self.hall.page_from {
            Some(folder) if !name.contains("..") => {
                let text = FILE.read_text(&folder.join(name)).map_err(|_cause| Key::Gone)?;
                Answer::whole(kind_of(name), text)
            }
            _ => {
                let file = FILES.iter().find(|(known, _)| *known == name).ok_or(Key::Gone)?;
                Answer::marked(kind_of(name), file.1, &self.mark, asked.head)
            }
        };
        Ok(answer.with_field("Content-Security-Policy", POLICY))
    }

    /// What the page has to know.
    fn about(&self, asked: &Asked<'_>) -> Value {
        let Hall { kiosk, brand, scene, boot, .. } = &self.hall;
        let is_home = asked.head.peer.is_loopback() && !kiosk;
        let role = match asked.admitted.base {
            Base::Visitors => "visitor",
            Base::Operator => "operator",
            Base::Entry(_) => "entry",
        };
        let mut about = json!({ "role": role, "boot": boot, "brand": brand.json() });
        if role == "entry" {
            return about;
        }
        about["home"] = is_home.into();
        about["kiosk"] = (*kiosk).into();
        about["network"] = self.guard.network.into();
        about["wall"] = if self.entries.is_open() { "open" } else { "approved" }.into();
        about["paused"] = self.entries.is_paused().into();
        about["limits"] =
            json!({ "letters": MAX_WORD, "entries": MOST_OF_VISITOR, "body_bytes": MAX_BODY });
        about["colors"] = colors();
        about["deck"] = json!(scene.light.deck);
        if is_home || role == "operator" {
            about["scene"] = json!(scene);
        }
        about
    }

    fn get(&self, parts: &[&str], asked: &Asked<'_>) -> Told<Answer> {
        match *parts {
            ["wall"] => Ok(Answer::json(&self.entries.wall())),
            ["wall", name] => {
                let (key, name) = match name.split_once('.') {
                    Some((key, "jpg")) => (key, JPEG),
                    Some((key, "json")) => (key, REPLAY),
                    _ => return Err(Key::Gone),
                };
                sent(self.entries.shown(key, name))
            }
            ["qr.svg"] => Ok(self.code()),
            ["entries", id] => Ok(Answer::json(&self.entries.own(id).ok_or(Key::Gone)?)),
            ["entries", id, "qr.svg"] => self.code_of(id),
            ["photos", id, name] => self.file(&self.photos.get(id).ok_or(Key::Gone)?, name, asked),
            _ => self.common(parts, asked),
        }
    }

    fn take_home(&self, id: &str, parts: &[&str], asked: &Asked<'_>) -> Told<Answer> {
        let own = self.entries.own(id).ok_or(Key::Gone)?;
        match *parts {
            ["entry.json"] => Ok(Answer::json(&own)),
            ["qr.svg"] => self.code_of(id),
            [name @ (PNG | JPEG | REPLAY)] => sent(self.entries.file(id, name)),
            _ => self.common(parts, asked),
        }
    }

    fn look(&self, parts: &[&str], asked: &Asked<'_>) -> Told<Answer> {
        match *parts {
            ["queue.json"] => Ok(Answer::json(&self.entries.queue())),
            ["entries", id, name @ (PNG | JPEG | REPLAY)] => sent(self.entries.file(id, name)),
            ["qr.svg"] => Ok(self.code()),
            ["address.json"] => {
                let visitors = self.guard.address.of_visitors(self.hall.ip);
                let wall = format!("{visitors}wall.html");
                Ok(Answer::json(&json!({ "visitors": visitors, "wall": wall })))
            }
            ["export.json"] => Ok(Answer::json(&self.export(asked)?.0)),
            ["export.zip"] => Ok(Answer::whole("application/zip", zip(&self.export(asked)?.1))),
            _ => self.common(parts, asked),
        }
    }

    fn operate(&self, parts: &[&str], body: &[u8]) -> Told<Answer> {
        let revision = match *parts {
            ["entries", id] => {
                let asked = Posted::of(body, &["do", "was"])?;
                let (act, was) = (asked.member("do")?, asked.member("was")?);
                return Ok(Answer::json(&self.entries.act(id, act, was)?));
            }
            ["order"] => {
                self.entries.reorder(&Posted::of(body, &["ids"])?.member::<Vec<String>>("ids")?)?
            }
            ["pause"] => self.entries.pause(Posted::of(body, &["paused"])?.member("paused")?)?,
            _ => return Err(Key::Gone),
        };
        Ok(Answer::json(&json!({ "revision": revision })))
    }

    fn post(&self, parts: &[&str], body: &[u8], asked: &Asked<'_>) -> Told<Answer> {
        match *parts {
            ["live" | "photos"] => match Wish::parse(body) {
                Ok(wish) => self.wished(asked, wish, parts == ["photos"]),
                Err(said) => Ok(Answer::json(&said.json())),
            },
            ["entries"] => self.send(body),
            ["entries", id] => {
                let asked = Posted::of(body, &["do", "visitor"])?;
                if asked.member::<String>("do")? != "withdraw" {
                    return Err(Key::PageOld);
                }
                self.entries.withdraw(id, &asked.member::<String>("visitor")?)?;
                Ok(Answer::json(&json!({})))
            }
            _ => Err(Key::Gone),
        }
    }

    /// A photo, in place of older ones of the same visitor.
    fn wished(&self, asked: &Asked<'_>, wish: Wish, is_large: bool) -> Told<Answer> {
        let number = wish.number;
        let numbered = |mut value: Value| {
            value["number"] = json!(number);
            Ok(Answer::json(&value))
        };
        let subject = wish.subject.clone();
        let (queue, other, task) = match is_large {
            true => (&self.large, &self.live, Task::Large(subject, wish.advice)),
            false => (&self.live, &self.large, Task::Live(subject)),
        };
        let ticket = {
            let mut numbers = self.numbers.lock().unwrap_or_else(PoisonError::into_inner);
            if !numbers.is_newest(&wish.visitor, number) {
                return numbered(json!({ "stopped": true }));
            }
            other.end(&wish.visitor);
            queue.ask(&wish.visitor, task).ok_or(Key::Busy)?
        };
        match asked.waited(queue, &ticket) {
            Outcome::Made(said, folder) if is_large => {
                let id = address::secret().map_err(|_cause| Key::Broken)?;
                let mut said = (*said).clone();
                said["id"] = json!(id);
                let kept = Kept::new(id, wish, folder, &said).map_err(|_cause| Key::DiskFull)?;
                self.photos.keep(kept);
                numbered(said)
            }
            Outcome::Made(said, _) => numbered((*said).clone()),
            Outcome::Failed(said) => numbered(said.json()),
            Outcome::Stopped => numbered(json!({ "stopped": true })),
        }
    }

    fn file(&self, kept: &Kept, name: &str, asked: &Asked<'_>) -> Told<Answer> {
        let is_home = asked.head.peer.is_loopback() && !self.hall.kiosk;
        let subject = || kept.subject.clone();
        let (task, kind) = match name {
            PNG | JPEG => return sent(Some(kept.file(name))),
            // Who flies sits at this machine, and not at the screen of the hall.
            "flight.zip" if !is_home => return Err(Key::NotHere),
            "plan.svg" | "report.html" if self.hall.kiosk => return Err(Key::NotHere),
            "plan.svg" => (Task::Plan(subject()), SVG),
            "report.html" => (Task::Report(subject()), "text/html; charset=utf-8"),
            "flight.zip" => (Task::Script(subject()), "application/zip"),
            _ => return Err(Key::Gone),
        };
        if name == "flight.zip" {
            let stops = kept.said()["stops"].take();
            if stops.as_array().is_some_and(|stops| !stops.is_empty()) {
                return Ok(Said::of_stops(&stops).answer());
            }
        }
        // A place of its own: a download ends no photo, and another download of it does.
        let ticket = self.large.ask(&format!("{}/{name}", kept.id), task).ok_or(Key::Busy)?;
        match asked.waited(&self.large, &ticket) {
            Outcome::Made(_, folder) if name == "flight.zip" => {
                let files = files_of(folder.path()).ok_or(Key::Broken)?;
                Ok(Answer::whole(kind, zip(&files)))
            }
            Outcome::Made(_, folder) => {
                let answer = Answer::file(kind, &folder.path().join(OUT).join(name));
                Ok(drawing(answer.map_err(|_cause| Key::Broken)?))
            }
            Outcome::Failed(said) => Ok(said.answer()),
            Outcome::Stopped => Err(Key::Busy),
        }
    }

    /// Keeps what a visitor sends to be flown.
    fn send(&self, body: &[u8]) -> Told<Answer> {
        let asked = Posted::of(body, &["visitor", "photo", "language"])?;
        let [visitor, photo]: [String; 2] = [asked.member("visitor")?, asked.member("photo")?];
        let language = asked.member::<Option<String>>("language")?.unwrap_or_default();
        if !is_name(&visitor) || language.len() > 8 {
            return Err(Key::PageOld);
        }
        let kept = self.photos.get(&photo).ok_or(Key::Gone)?;
        if kept.subject.title().is_some_and(|title| self.hall.block.holds(title)) {
            return Err(Key::Blocked);
        }
        let (id, number, is_new) = self.entries.add(&kept, &visitor, &language)?;
        let page = self.guard.address.of_entry(self.hall.ip, &id);
        let answer = Answer::json(&json!({ "id": id, "number": number, "page": page }));
        Ok(answer.with_status(if is_new { 201 } else { 200 }))
    }

    /// The scripts of the approved entries in the order of flight, and what became of each.
    fn export(&self, asked: &Asked<'_>) -> Told<(Value, NamedFiles)> {
        let (mut told, mut files) = (Vec::new(), Vec::new());
        for (index, (number, title, subject)) in self.entries.approved().into_iter().enumerate() {
            let title = title.unwrap_or_else(|| "drawing".to_owned());
            let plain: String = title.chars().filter(char::is_ascii_alphanumeric).collect();
            let name = format!("{:02}-{plain}", index + 1);
            let outcome = match subject {
                None => Outcome::Failed(Key::Broken.into()),
                Some(subject) => {
                    let ticket = self.large.ask("operator", Task::Script(subject));
                    asked.waited(&self.large, &ticket.ok_or(Key::Busy)?)
                }
            };
            let refused = match outcome {
                Outcome::Made(_, folder) => {
                    let own = files_of(folder.path()).ok_or(Key::Broken)?.into_iter();
                    files.extend(own.map(|(file, bytes)| (format!("{name}/{file}"), bytes)));
                    None
                }
                Outcome::Failed(said) => Some(said),
                Outcome::Stopped => return Err(Key::Conflict),
            };
            let folder = refused.is_none().then_some(&name);
            let refused: Vec<Said> = refused.into_iter().collect();
            told.push(json!({
                "number": number, "title": title, "folder": folder, "refused": refused,
            }));
        }
        let told = Value::from(told);
        files.push(("export.json".to_owned(), format!("{told:#}\n").into_bytes()));
        Ok((told, files))
    }

    fn code(&self) -> Answer {
        drawing(Answer::whole(SVG, qr::svg(&self.guard.address.of_visitors(self.hall.ip))))
    }

    fn code_of(&self, id: &str) -> Told<Answer> {
        self.entries.own(id).ok_or(Key::Gone)?;
        let page = self.guard.address.of_entry(self.hall.ip, id);
        Ok(drawing(Answer::whole(SVG, qr::svg(&page))))
    }
}

impl Asked<'_> {
    /// Waits for an answer, as long as the visitor is there.
    fn waited(&self, queue: &Queue, ticket: &super::queue::Ticket) -> Outcome {
        self.taken.working(|| {
            loop {
                if let Ok(outcome) = ticket.answer.recv_timeout(LOOK) {
                    return outcome;
                }
                if self.connection.is_gone() {
                    queue.leave(ticket);
                    return Outcome::Stopped;
                }
            }
        })
    }
}

/// What the page posts: an object of known members.
struct Posted(Map<String, Value>);

impl Posted {
    fn of(body: &[u8], names: &[&str]) -> Told<Self> {
        let members: Map<String, Value> =
            serde_json::from_slice(body).map_err(|_broken| Key::PageOld)?;
        let is_known = members.keys().all(|name| names.contains(&&**name));
        if is_known { Ok(Self(members)) } else { Err(Key::PageOld) }
    }

    /// A member; null where it is left out.
    fn member<T: DeserializeOwned>(&self, name: &str) -> Told<T> {
        let member = self.0.get(name).cloned().unwrap_or_default();
        serde_json::from_value(member).map_err(|_other| Key::PageOld)
    }
}

const SVG: &str = "image/svg+xml";

/// The page asks nobody else for anything, and runs no script but its files.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' \
                      data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// A drawing or a report that is opened by itself runs no script and asks for nothing.
fn drawing(answer: Answer) -> Answer {
    let policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox";
    answer.with_field("Content-Security-Policy", policy)
}

fn kind_of(name: &str) -> &'static str {
    match name.rsplit_once('.').map_or("", |(_, end)| end) {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "json" => "application/json",
        "svg" => SVG,
        "png" => "image/png",
        "jpg" => "image/jpeg",
        _ => "text/plain; charset=utf-8",
    }
}

/// A file that is there.
fn sent(path: Option<PathBuf>) -> Told<Answer> {
    let path = path.ok_or(Key::Gone)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Answer::file(kind_of(&name), &path).map_err(|_cause| Key::Gone)
}

/// Names and contents of the files that a job made.
fn files_of(folder: &Path) -> Option<NamedFiles> {
    let read = |path: PathBuf| {
        let name = path.file_name()?.to_string_lossy().into_owned();
        Some((name, FILE.read(&path).ok()?))
    };
    files_in(&folder.join(OUT)).ok()?.into_iter().map(read).collect()
}

/// Colors that the page offers: of the screen, and the bytes of each lamp that show them.
fn colors() -> Value {
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
        json!({ "name": name, "screen": screen, "color-led": deck, "ring": [0, r, g, b] })
    };
    colors.map(entry).into_iter().collect()
}
