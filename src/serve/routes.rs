//! What is answered at which address.

use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, PoisonError};

use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use super::access::{Access, Base, Request};
use super::brand::Brand;
use super::entries::Entries;
use super::http::{self, Arrival, MAX_BODY, Reply, with_field, with_status};
use super::page::FILES;
use super::photo_cache::{CachedPhoto, PhotoCache};
use super::queue::{Outcome, Queue, RequestNumbers};
use super::render::{JPEG, OUT, PNG, REPLAY, SCENE};
use super::{address, qr};
use noctograph_core::files::{Limit, files_in};
use noctograph_export::zip::zip;
use noctograph_pipeline::scene::Scene;
use noctograph_web::colors;
use noctograph_web::messages::{Key, KeyResult, Message};
use noctograph_web::request::{MAX_WORD, PhotoRequest, Task, is_name};

/// Files of an archive: their names and bytes.
pub(crate) type NamedFiles = Vec<(String, Vec<u8>)>;

/// A file of a script.
const FILE: Limit = Limit { bytes: 64 << 20, what: "a file of an entry", hint: "remove it" };

/// What answers the requests.
#[derive(Debug)]
pub(crate) struct Server {
    pub(crate) access: Access,
    pub(crate) brand: Brand,
    /// Values that the controls begin with.
    pub(crate) scene: Scene,
    /// This machine, as visitors see it.
    pub(crate) ip: IpAddr,
    /// Name of this run of the program.
    pub(crate) boot: String,
    /// Photos while one types.
    pub(crate) live: Arc<Queue>,
    /// Large photos and files.
    pub(crate) large: Arc<Queue>,
    /// What the operator exports, which waits for no visitor.
    pub(crate) operator: Arc<Queue>,
    pub(crate) numbers: Mutex<RequestNumbers>,
    pub(crate) photos: PhotoCache,
    pub(crate) entries: Entries,
    /// Changes with the program, so that browsers know when the page did.
    pub(crate) mark: String,
}

impl Server {
    /// Answers a request; a connection whose request is being worked on gives way to no other.
    pub(crate) async fn answer(self: Arc<Self>, (peer, request, working): Arrival) -> Reply {
        let (head, body) = request.into_parts();
        let reply = match self.access.admit(&head, peer) {
            Ok(mut request) => {
                let read = match &request.body {
                    Some(_) => http::read(body).await.map(Some),
                    None => Ok(None),
                };
                let waits = request.route == "news" && request.base != Base::Operator;
                working.store(!waits, Ordering::Relaxed);
                match read {
                    Ok(body) => {
                        request.body = body;
                        self.route(request).await.unwrap_or_else(http::refused)
                    }
                    Err(error) => error.into(),
                }
            }
            Err(error) => {
                http::skip(body).await;
                error.into()
            }
        };
        working.store(false, Ordering::Relaxed);
        http::finished(reply)
    }

    async fn route(self: &Arc<Self>, request: Request) -> KeyResult<Reply> {
        let request = Arc::new(request);
        let parts: Vec<&str> = request.route.split('/').collect();
        match (&request.base, &request.body, &*parts) {
            (_, None, ["news"]) => {
                let seen = request.query.strip_prefix("seen=");
                let seen = seen.and_then(|seen| seen.parse().ok()).unwrap_or(0);
                let revision = self.entries.news(seen).await;
                Ok(http::json(&json!({ "revision": revision, "boot": self.boot })))
            }
            (Base::Visitors | Base::Kiosk, Some(body), [size @ ("live" | "photos")]) => {
                match PhotoRequest::parse(body, request.base == Base::Kiosk) {
                    Ok(photo) => self.photo(photo, *size == "photos").await,
                    Err(message) if message == Key::NotHere.into() => Ok(http::refused(message)),
                    Err(message) => Ok(http::json(&message.json())),
                }
            }
            (Base::Visitors | Base::Kiosk, None, ["photos", id, name]) => {
                let photo = self.photos.get(id).ok_or(Key::Closed)?;
                self.download(&photo, name, &request).await
            }
            (Base::Operator, None, ["export.json"]) => Ok(http::json(&self.export(None).await?.0)),
            (Base::Operator, None, ["export.zip"]) => Ok(archive(&self.export(None).await?.1)),
            (Base::Operator, None, ["entries", id, "flight.zip"]) => self.script(id).await,
            _ => {
                let (server, request) = (self.clone(), request.clone());
                let answer = move || server.with_disk(&request);
                tokio::task::spawn_blocking(answer).await.unwrap_or(Err(Key::Broken))
            }
        }
    }

    /// Answers what may wait for the disk.
    fn with_disk(&self, request: &Request) -> KeyResult<Reply> {
        let parts: Vec<&str> = request.route.split('/').collect();
        match (&request.base, &request.body) {
            (Base::Visitors | Base::Kiosk, Some(body)) => self.post(&parts, body, request),
            (Base::Visitors | Base::Kiosk, None) => self.get(&parts, request),
            (Base::Operator, Some(body)) => self.operate(&parts, body),
            (Base::Operator, None) => self.look(&parts, request),
            (Base::Entry(_), Some(_)) => Err(Key::NotHere),
            (Base::Entry(id), None) => self.take_home(id, &parts, request),
        }
    }

    /// What every address has: the page, and who one is.
    pub(crate) fn common(&self, parts: &[&str], request: &Request) -> KeyResult<Reply> {
        match *parts {
            ["alive"] => Ok(http::json(&json!({ "boot": self.boot }))),
            ["about.json"] => Ok(http::json(&self.about(request))),
            ["brand", "logo.svg"] => {
                Ok(drawing(http::whole(SVG, self.brand.svg.clone().ok_or(Key::Closed)?)))
            }
            _ => self.page(request),
        }
    }

    fn page(&self, request: &Request) -> KeyResult<Reply> {
        let first = match request.base {
            Base::Visitors | Base::Kiosk => "index.html",
            Base::Operator => "operator.html",
            Base::Entry(_) => "entry.html",
        };
        let name = if request.route.is_empty() { first } else { &request.route };
        let (_, text) = FILES.iter().find(|(known, _)| *known == name).ok_or(Key::Closed)?;
        let known = request.known_mark.as_deref();
        let reply = http::marked(kind_of(name), text, &self.mark, known);
        Ok(with_field(reply, "Content-Security-Policy", POLICY))
    }

    /// What the page has to know.
    fn about(&self, request: &Request) -> Value {
        let Self { brand, scene, boot, entries, .. } = self;
        let role = match request.base {
            Base::Visitors | Base::Kiosk => "visitor",
            Base::Operator => "operator",
            Base::Entry(_) => return json!({ "role": "entry", "boot": boot, "brand": brand }),
        };
        let mut about = json!({
            "role": role, "boot": boot, "brand": brand, "home": request.is_home(),
            "kiosk": request.base == Base::Kiosk, "network": self.access.network,
            "wall": if entries.is_open() { "open" } else { "approved" },
            "paused": entries.is_paused(),
            "limits": { "letters": MAX_WORD, "body_bytes": MAX_BODY },
            "colors": colors(), "deck": scene.light.deck,
        });
        if request.is_home() {
            about["scene"] = json!(scene);
        }
        about
    }

    fn get(&self, parts: &[&str], request: &Request) -> KeyResult<Reply> {
        match *parts {
            ["wall"] => Ok(http::json(&self.entries.wall())),
            ["wall", name] => {
                let (key, name) = match name.split_once('.') {
                    Some((key, "jpg")) => (key, JPEG),
                    Some((key, "json")) => (key, REPLAY),
                    _ => return Err(Key::Closed),
                };
                sent(self.entries.shown(key, name))
            }
            ["qr.svg"] => Ok(self.code()),
            ["entries", id] => Ok(http::json(&self.entries.own(id)?)),
            ["entries", id, "qr.svg"] => self.code_of(id),
            _ => self.common(parts, request),
        }
    }

    fn take_home(&self, id: &str, parts: &[&str], request: &Request) -> KeyResult<Reply> {
        match *parts {
            ["entry.json"] => Ok(http::json(&self.entries.own(id)?)),
            ["qr.svg"] => self.code_of(id),
            [name @ (PNG | JPEG | REPLAY)] => sent(self.entries.file(id, name)),
            // The page itself says that a photo is gone.
            [""] if self.entries.own(id).is_err() => Ok(with_status(self.page(request)?, 404)),
            _ => self.common(parts, request),
        }
    }

    fn post(&self, parts: &[&str], body: &[u8], request: &Request) -> KeyResult<Reply> {
        match *parts {
            ["entries"] => self.send(body, request.peer),
            ["entries", id] => {
                let posted = Posted::parse(body, &["do", "visitor"])?;
                if posted.member::<String>("do")? != "withdraw" {
                    return Err(Key::PageOld);
                }
                self.entries.withdraw(id, &posted.member::<String>("visitor")?)?;
                Ok(http::json(&json!({})))
            }
            _ => Err(Key::Closed),
        }
    }

    /// A photo, in place of older ones of the same visitor.
    async fn photo(&self, photo: PhotoRequest, is_large: bool) -> KeyResult<Reply> {
        let PhotoRequest { visitor, number, advice, subject } = photo;
        let numbered = |key: &str| http::json(&json!({ "number": number, key: true }));
        let (queue, other, task) = match is_large {
            true => (&self.large, &self.live, Task::Large(subject.clone(), advice)),
            false => (&self.live, &self.large, Task::Live(subject.clone())),
        };
        let mut ticket = {
            let mut numbers = self.numbers.lock().unwrap_or_else(PoisonError::into_inner);
            if !numbers.is_newest(&visitor, number) {
                return Ok(numbered("stopped"));
            }
            other.end(&visitor);
            queue.ask(&visitor, task).ok_or(Key::Busy)?
        };
        match ticket.outcome().await {
            Outcome::Made(object, folder) => {
                let mut more = format!("{{\"number\":{},", json!(number));
                if is_large {
                    let id = address::secret().map_err(|_cause| Key::Broken)?;
                    more += &format!("\"id\":\"{id}\",");
                    self.photos.keep(CachedPhoto { id, visitor, subject, folder });
                }
                // It is an object with members, as text.
                Ok(http::whole("application/json", more + &object.get()[1..]))
            }
            Outcome::Failed(message) => {
                Ok(http::json(&json!({ "number": number, "error": message })))
            }
            Outcome::Stopped => Ok(numbered("stopped")),
        }
    }

    /// A file of a large photo. Who flies sits at this machine, and not at a screen of the hall.
    async fn download(
        &self,
        photo: &CachedPhoto,
        name: &str,
        request: &Request,
    ) -> KeyResult<Reply> {
        match name {
            JPEG => return sent(Some(photo.file(name))),
            _ if request.base == Base::Kiosk => return Err(Key::NotHere),
            PNG => return sent(Some(photo.file(name))),
            SCENE | "flight.zip" if !request.is_home() => return Err(Key::NotHere),
            SCENE => return sent(Some(photo.file(name))),
            "flight.zip" => {}
            _ => return Err(Key::Closed),
        }
        let stops = photo.figures()["stops"].take();
        if stops.as_array().is_some_and(|stops| !stops.is_empty()) {
            return Ok(http::refused(Message::of_stops(&stops)));
        }
        // A place of its own: a script ends no photo, and another script of the photo does.
        let task = Task::Script(photo.subject.clone());
        match self.large.ask(&photo.id, task).ok_or(Key::Busy)?.outcome().await {
            Outcome::Made(_, folder) => Ok(archive(&files_of(folder.path())?)),
            Outcome::Failed(message) => Ok(http::refused(message)),
            Outcome::Stopped => Err(Key::Busy),
        }
    }

    /// Keeps what a visitor sends to be flown.
    fn send(&self, body: &[u8], sender: IpAddr) -> KeyResult<Reply> {
        let posted = Posted::parse(body, &["visitor", "photo", "language"])?;
        let [visitor, photo]: [String; 2] = [posted.member("visitor")?, posted.member("photo")?];
        let language = posted.member::<Option<String>>("language")?.unwrap_or_default();
        if !is_name(&visitor) || language.len() > 8 {
            return Err(Key::PageOld);
        }
        // A photo is sent by whoever took it.
        let photo = self.photos.get(&photo).filter(|photo| photo.visitor == visitor);
        let (id, number, is_new) =
            self.entries.add(&photo.ok_or(Key::Closed)?, &language, sender)?;
        let page = self.access.address.of_entry(self.ip, &id);
        let reply = http::json(&json!({ "id": id, "number": number, "page": page }));
        Ok(with_status(reply, if is_new { 201 } else { 200 }))
    }

    /// The code of the visitors' page, which is no kiosk on their own telephones.
    pub(crate) fn code(&self) -> Reply {
        drawing(http::whole(SVG, qr::svg(&self.access.address.of_visitors(self.ip))))
    }

    fn code_of(&self, id: &str) -> KeyResult<Reply> {
        self.entries.own(id)?;
        let page = self.access.address.of_entry(self.ip, id);
        Ok(drawing(http::whole(SVG, qr::svg(&page))))
    }
}

/// What the page posts: an object of known members.
pub(crate) struct Posted(Map<String, Value>);

impl Posted {
    pub(crate) fn parse(body: &[u8], names: &[&str]) -> KeyResult<Self> {
        let members: Map<String, Value> =
            serde_json::from_slice(body).map_err(|_broken| Key::PageOld)?;
        let is_known = members.keys().all(|name| names.contains(&&**name));
        if is_known { Ok(Self(members)) } else { Err(Key::PageOld) }
    }

    /// A member; null where it is left out.
    pub(crate) fn member<T: DeserializeOwned>(&self, name: &str) -> KeyResult<T> {
        let member = self.0.get(name).cloned().unwrap_or_default();
        serde_json::from_value(member).map_err(|_other| Key::PageOld)
    }
}

const SVG: &str = "image/svg+xml";

/// The page asks nobody else for anything, and runs no script but its files.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' \
                      data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// A drawing that is opened by itself runs no script and asks for nothing.
fn drawing(reply: Reply) -> Reply {
    let policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox";
    with_field(reply, "Content-Security-Policy", policy)
}

pub(crate) fn archive(files: &NamedFiles) -> Reply {
    http::whole("application/zip", zip(files))
}

fn kind_of(name: &str) -> &'static str {
    match name.rsplit_once('.').map_or("", |(_, end)| end) {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "json" => "application/json",
        "png" => "image/png",
        "jpg" => "image/jpeg",
        _ => "text/plain; charset=utf-8",
    }
}

/// A file that is there.
pub(crate) fn sent(path: Option<PathBuf>) -> KeyResult<Reply> {
    let path = path.ok_or(Key::Closed)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    http::file(kind_of(&name), &path).map_err(|_cause| Key::Closed)
}

/// Names and contents of the files that a job made.
pub(crate) fn files_of(folder: &Path) -> KeyResult<NamedFiles> {
    let read = |path: PathBuf| {
        let name = path.file_name()?.to_string_lossy().into_owned();
        Some((name, FILE.read(&path).ok()?))
    };
    let files = files_in(&folder.join(OUT)).map_err(|_cause| Key::Broken)?;
    files.into_iter().map(read).collect::<Option<_>>().ok_or(Key::Broken)
}
