//! Routes: the answer to each address.

use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use super::access::{Access, Base, OLD_ADDRESS, Request, wants_page};
use super::address::Address;
use super::brand::Brand;
use super::entries::Entries;
use super::gallery::{JPEG, PNG, Photo, REPLAY};
use super::http::{self, Arrival, HttpError, MAX_BODY, Reply, with_field, with_status};
use super::module::Module;
use super::page::{self, FILES};
use super::qr;
use super::worker::{Job, Maker, Parcel};
use noctograph_core::digest::sha256;
use noctograph_photo_service::about::{About, Host, Limits, Role, WallRule, colors};
use noctograph_photo_service::answer::{Asked, PageAnswer};
use noctograph_photo_service::messages::{Key, KeyResult, Message};
use noctograph_photo_service::request::{MAX_WORD, PhotoRequest, Product};
use noctograph_pipeline::scene::Scene;

#[derive(Debug)]
pub(crate) struct Server {
    pub(crate) access: Access,
    pub(crate) brand: Brand,
    /// The scene that the controls begin with.
    pub(crate) scene: Scene,
    /// The text of its file.
    pub(crate) base: String,
    /// The module with which visitors' browsers make photos.
    pub(crate) module: Option<Module>,
    /// The address of this machine in its network.
    pub(crate) outside: Option<IpAddr>,
    /// Name of this run of the program.
    pub(crate) boot: String,
    /// Makes entries, and photos for browsers that cannot make them.
    pub(crate) visitors: Maker,
    /// Makes photos for the host, who waits for no visitor.
    pub(crate) host: Maker,
    /// Makes scripts for the operator, who waits for neither.
    pub(crate) operator: Maker,
    pub(crate) entries: Entries,
    pub(crate) mark: String,
}

impl Server {
    /// Answers a request. While it is worked on, its connection is not closed for another one.
    pub(crate) async fn answer(self: Arc<Self>, (peer, request, working): Arrival) -> Reply {
        let (head, body) = request.into_parts();
        let reply = match self.access.admit(&head, peer) {
            Ok(mut request) => {
                // A body is read only after the request was admitted.
                let read = match &request.body {
                    Some(_) => http::read(body).await.map(Some),
                    None => Ok(None),
                };
                // Visitors who wait for news may have to wait again.
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
                let is_page = error == HttpError(403, OLD_ADDRESS) && wants_page(&head);
                if is_page { page::of_old_address(&head) } else { error.into() }
            }
        };
        working.store(false, Ordering::Relaxed);
        http::finished(reply)
    }

    async fn route(self: &Arc<Self>, request: Request) -> KeyResult<Reply> {
        let request = Arc::new(request);
        let parts: Vec<&str> = request.route.split('/').collect();
        // Here are the routes that wait for a change or a worker. All others may wait for the disk,
        // on another thread.
        match (&request.base, &request.body, &*parts) {
            (_, None, ["news"]) => {
                let seen = request.query.strip_prefix("seen=");
                let seen = seen.and_then(|seen| seen.parse().ok()).unwrap_or(0);
                let revision = self.entries.news(seen).await;
                Ok(http::json(&json!({ "revision": revision, "boot": self.boot })))
            }
            (Base::Visitors | Base::Kiosk, Some(body), ["entries"]) => {
                Ok(self.send(body, &request).await.unwrap_or_else(http::refused))
            }
            (Base::Visitors | Base::Kiosk, Some(body), [name @ ("live" | "photos" | "script")]) => {
                match PhotoRequest::parse(body, request.asker()) {
                    Ok(photo) => self.photo(photo, name, &request).await,
                    Err(message) if message == Key::NotHere.into() => Ok(http::refused(message)),
                    Err(message) => Ok(http::json(&message.json())),
                }
            }
            (Base::Visitors | Base::Kiosk, None, ["noctograph.wasm.gz"]) => {
                let Module { gzip, mark } = self.module.as_ref().ok_or(Key::Closed)?;
                let known = request.known_mark.as_deref();
                Ok(http::marked("application/gzip", gzip.clone(), mark, known))
            }
            (Base::Operator, None, ["export.json"]) => Ok(http::json(&self.export(None).await?.0)),
            (Base::Operator, None, ["export.zip"]) => {
                Ok(http::whole(ZIP, self.export(None).await?.1))
            }
            (Base::Operator, None, ["entries", id, "flight.zip"]) => self.script(id).await,
            _ => {
                let (server, request) = (self.clone(), request.clone());
                let answer = tokio::task::spawn_blocking(move || server.with_disk(&request));
                answer.await.unwrap_or(Err(Key::Broken))
            }
        }
    }

    fn with_disk(&self, request: &Request) -> KeyResult<Reply> {
        let parts: Vec<&str> = request.route.split('/').collect();
        match (&request.base, &request.body) {
            (Base::Visitors | Base::Kiosk, Some(body)) => self.post(&parts, body),
            (Base::Visitors | Base::Kiosk, None) => self.get(&parts, request),
            (Base::Operator, Some(body)) => self.operate(&parts, body),
            (Base::Operator, None) => self.look(&parts, request),
            (Base::Entry(_), Some(_)) => Err(Key::NotHere),
            (Base::Entry(id), None) => self.take_home(id, &parts, request),
        }
    }

    /// Routes of all addresses: the page, and the facts that it needs.
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
        let reply = http::marked(kind_of(name), text.as_bytes(), &self.mark, known);
        Ok(with_field(reply, "Content-Security-Policy", POLICY))
    }

    /// Facts that the page needs.
    fn about(&self, request: &Request) -> Value {
        let Self { brand, scene, boot, entries, .. } = self;
        let role = match request.base {
            Base::Visitors | Base::Kiosk => Role::Visitor,
            Base::Operator => Role::Operator,
            Base::Entry(_) => Role::Entry,
        };
        let network = self.outside.is_some();
        let host = Host { role, boot, brand: &brand.words, network };
        if role == Role::Entry {
            return json!(host);
        }
        // The program is faster than the module on the host's machine.
        let makes_there = self.module.is_some() && !request.peer.is_loopback();
        json!(About {
            host,
            alone: false,
            home: request.is_home(),
            kiosk: request.base == Base::Kiosk,
            paused: entries.is_paused(),
            wall: if entries.is_open() { WallRule::Open } else { WallRule::Approved },
            limits: Limits { letters: MAX_WORD, body_bytes: MAX_BODY },
            colors: colors(),
            deck: scene.light.deck,
            base: makes_there.then_some(&*self.base),
            scene: request.is_home().then_some(scene),
        })
    }

    fn get(&self, parts: &[&str], request: &Request) -> KeyResult<Reply> {
        match *parts {
            ["wall"] => Ok(http::json(&self.entries.wall())),
            ["wall", name] => match name.split_once('.') {
                Some((key, "jpg")) => sent(self.entries.shown(key, JPEG)),
                Some((key, "json")) => sent(self.entries.shown(key, REPLAY)),
                _ => Err(Key::Closed),
            },
            ["qr.svg"] => self.code(Address::of_visitors),
            ["entries", id] => Ok(http::json(&self.entries.for_visitor(id)?)),
            ["entries", id, "qr.svg"] => self.code_of(id),
            _ => self.common(parts, request),
        }
    }

    fn take_home(&self, id: &str, parts: &[&str], request: &Request) -> KeyResult<Reply> {
        match *parts {
            ["entry.json"] => Ok(http::json(&self.entries.for_visitor(id)?)),
            ["qr.svg"] => self.code_of(id),
            [name @ (PNG | JPEG | REPLAY)] => sent(self.entries.file(id, name)),
            // The page says that a photo is gone.
            [""] if self.entries.for_visitor(id).is_err() => {
                Ok(with_status(self.page(request)?, 404))
            }
            _ => self.common(parts, request),
        }
    }

    fn post(&self, parts: &[&str], body: &[u8]) -> KeyResult<Reply> {
        match *parts {
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

    /// Makes a photo or scripts here, for the host or a browser without the module.
    async fn photo(&self, photo: PhotoRequest, name: &str, request: &Request) -> KeyResult<Reply> {
        let product = match name {
            "live" => Product::Live,
            "photos" => Product::Large { advice: photo.advice, files: photo.files },
            // Scripts are for a pilot at this machine, and not at a kiosk.
            _ if request.is_home() => Product::Script,
            _ => return Err(Key::NotHere),
        };
        let maker = if request.peer.is_loopback() { &self.host } else { &self.visitors };
        // The server keeps no photo: the page sends the request again to have it flown.
        let body = request.body.as_deref().unwrap_or_default();
        let id = (name == "photos").then(|| String::from_utf8_lossy(body).into_owned());
        let (number, subject) = (photo.number, photo.subject);
        let page = Some(Asked { id, number });
        let answer = match maker.make(Job { product, subject, page }).await {
            Ok(parcel) => parcel.files.into_iter().next().ok_or(Key::Broken)?.bytes,
            Err(message) if message.key == Key::Busy.name() => return Err(Key::Busy),
            Err(message) => PageAnswer::new(Asked { id: None, number }, Err(message)).json().into(),
        };
        Ok(http::whole("application/json", answer))
    }

    /// Makes the photo that a visitor sends to be flown, by its request, and keeps it as an entry.
    async fn send(self: &Arc<Self>, body: &[u8], request: &Request) -> Result<Reply, Message> {
        let posted = Posted::parse(body, &["visitor", "photo", "language"])?;
        let language = posted.member::<Option<String>>("language")?.unwrap_or_default();
        let asked = posted.member::<String>("photo")?;
        let photo = PhotoRequest::parse(asked.as_bytes(), request.asker())?;
        if language.len() > 8 || photo.visitor != posted.member::<String>("visitor")? {
            return Err(Key::PageOld.into());
        }
        // The same request of the same visitor is kept once, however often it arrives.
        let id = sha256(asked.as_bytes())[..32].to_owned();
        let known = self.entries.admit(&id, request.peer)?;
        let (id, number, is_new) = match known {
            Some((id, number)) => (id, number, false),
            None => self.keep(id, photo, language, request.peer).await?,
        };
        let page = self.access.address.of_entry(self.ip(), &id);
        let reply = http::json(&json!({ "id": id, "number": number, "page": page }));
        Ok(with_status(reply, if is_new { 201 } else { 200 }))
    }

    async fn keep(
        self: &Arc<Self>,
        id: String,
        photo: PhotoRequest,
        language: String,
        sender: IpAddr,
    ) -> Result<(String, u32, bool), Message> {
        let PhotoRequest { visitor, subject, .. } = photo;
        let product = Product::Large { advice: false, files: true };
        let job = Job { product, subject: subject.clone(), page: None };
        let Parcel { figures, files } = self.visitors.make(job).await?;
        let (server, photo) = (self.clone(), Photo { id, visitor, subject, figures, files });
        let added =
            tokio::task::spawn_blocking(move || server.entries.add(&photo, &language, sender));
        Ok(added.await.unwrap_or(Err(Key::Broken))?)
    }

    /// The IP address in the pages' addresses.
    pub(crate) fn ip(&self) -> IpAddr {
        self.outside.unwrap_or(Ipv4Addr::LOCALHOST.into())
    }

    /// The code of a page, for telephones, if they can reach this machine.
    pub(crate) fn code(&self, page: impl Fn(&Address, IpAddr) -> String) -> KeyResult<Reply> {
        Ok(code_of(&page(&self.access.address, self.outside.ok_or(Key::Closed)?)))
    }

    fn code_of(&self, id: &str) -> KeyResult<Reply> {
        self.entries.for_visitor(id)?;
        self.code(|address, ip| address.of_entry(ip, id))
    }
}

pub(crate) struct Posted(Map<String, Value>);

impl Posted {
    pub(crate) fn parse(body: &[u8], names: &[&str]) -> KeyResult<Self> {
        let members: Map<String, Value> =
            serde_json::from_slice(body).map_err(|_broken| Key::PageOld)?;
        let is_known = members.keys().all(|name| names.contains(&&**name));
        if is_known { Ok(Self(members)) } else { Err(Key::PageOld) }
    }

    /// A member, null if it is left out.
    pub(crate) fn member<T: DeserializeOwned>(&self, name: &str) -> KeyResult<T> {
        let member = self.0.get(name).cloned().unwrap_or_default();
        serde_json::from_value(member).map_err(|_other| Key::PageOld)
    }
}

const SVG: &str = "image/svg+xml";
pub(crate) const ZIP: &str = "application/zip";

/// The page loads nothing from elsewhere, and runs only its scripts and its module.
const POLICY: &str = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; img-src 'self' \
                      data: blob:; connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// A text as a code.
pub(crate) fn code_of(text: &str) -> Reply {
    drawing(http::whole(SVG, qr::svg(text)))
}

/// The answer with a drawing, which runs no script and loads nothing when it is opened.
fn drawing(reply: Reply) -> Reply {
    let policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox";
    with_field(reply, "Content-Security-Policy", policy)
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

/// The answer with a file, if it exists.
pub(crate) fn sent(path: Option<PathBuf>) -> KeyResult<Reply> {
    let path = path.ok_or(Key::Closed)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    http::file(kind_of(&name), &path).map_err(|_cause| Key::Closed)
}
