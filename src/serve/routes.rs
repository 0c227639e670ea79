//! Answers the requests to each address.

use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use hyper::body::Incoming;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use super::access::{Access, Base, OLD_ADDRESS, Request, wants_page};
use super::address::Address;
use super::brand::Brand;
use super::entries::{Entries, Receipt};
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

/// State of the server, for all requests.
#[derive(Debug)]
pub(crate) struct Server {
    pub(crate) access: Access,
    pub(crate) brand: Brand,
    /// The scene that the page's controls show at the start.
    pub(crate) scene: Scene,
    /// Text of the scene's file.
    pub(crate) base: String,
    /// Module with which visitors' browsers make photos.
    pub(crate) module: Option<Module>,
    /// IP address of this machine in its network.
    pub(crate) network_ip: Option<IpAddr>,
    /// Random name of this run of the program.
    pub(crate) boot: String,
    /// Worker queue for entries, and for photos of browsers that cannot make them.
    pub(crate) visitors: Maker,
    /// Worker queue for the host's photos, which do not wait for those of visitors.
    pub(crate) host: Maker,
    /// Worker queue for the operator's scripts, which wait neither for visitors nor for the host.
    pub(crate) operator: Maker,
    /// Worker queue for the photos of the flight that is being followed.
    pub(crate) flights: Maker,
    pub(crate) entries: Entries,
    /// `ETag` of the page's files.
    pub(crate) etag: String,
}

impl Server {
    /// Checks and answers a request, and returns the reply. Sets the connection's flag while the
    /// request is being worked on, so that the connection is not closed. The body of a refused
    /// request is discarded.
    pub(crate) async fn answer(self: Arc<Self>, (peer, request, is_working): Arrival) -> Reply {
        let (head, body) = request.into_parts();
        let reply = match self.access.admit(&head, peer) {
            Ok(request) => self.answer_admitted(request, body, &is_working).await,
            Err(error) => {
                http::discard_body(body).await;
                let is_page = error == HttpError(403, OLD_ADDRESS) && wants_page(&head);
                if is_page { page::old_address_reply(&head) } else { error.into() }
            }
        };
        is_working.store(false, Ordering::Relaxed);
        http::with_common_fields(reply)
    }

    /// Reads the body of an admitted POST, and answers the request. Sets the flag `is_working`,
    /// except for a visitor who waits for changes, whose connection may be closed.
    async fn answer_admitted(
        self: &Arc<Self>,
        mut request: Request,
        body: Incoming,
        is_working: &AtomicBool,
    ) -> Reply {
        if request.body.is_some() {
            match http::read_body(body).await {
                Ok(bytes) => request.body = Some(bytes),
                Err(error) => return error.into(),
            }
        }
        let waits = request.route == "news" && request.base != Base::Operator;
        is_working.store(!waits, Ordering::Relaxed);
        self.route(request).await.unwrap_or_else(http::refused)
    }

    /// Answers an admitted request by its address and route. Returns the key of a refusal.
    async fn route(self: &Arc<Self>, request: Request) -> KeyResult<Reply> {
        let request = Arc::new(request);
        let parts: Vec<&str> = request.route.split('/').collect();
        // These routes wait for a change or a worker. All other routes may wait for the disk, and
        // therefore run on another thread.
        match (&request.base, &request.body, &*parts) {
            (_, None, ["news"]) => {
                let seen = request.query.strip_prefix("seen=");
                // No list has the revision 0, so it is answered at once.
                let seen = seen.and_then(|seen| seen.parse().ok()).unwrap_or(0);
                let revision = self.entries.news(seen).await;
                Ok(http::json(&json!({ "revision": revision, "boot": self.boot })))
            }
            (Base::Visitors | Base::Kiosk, Some(body), ["entries"]) => {
                Ok(self.send_entry(body, &request).await.unwrap_or_else(http::refused))
            }
            (Base::Visitors | Base::Kiosk, Some(body), [name @ ("live" | "photos" | "script")]) => {
                match PhotoRequest::parse(body, request.asker()) {
                    Ok(photo) => self.photo(photo, name, &request).await,
                    Err(message) if message == Key::NotHere.into() => Ok(http::refused(message)),
                    Err(message) => Ok(http::json(&message.json())),
                }
            }
            (Base::Visitors | Base::Kiosk, None, ["noctograph.wasm.gz"]) => {
                let Module { gzip, etag } = self.module.as_ref().ok_or(Key::Closed)?;
                let if_none_match = &request.if_none_match;
                Ok(http::with_etag("application/gzip", gzip.clone(), etag, if_none_match))
            }
            (Base::Operator, None, ["export.json"]) => {
                Ok(http::json(&self.export(None).await?.results))
            }
            (Base::Operator, None, ["export.zip"]) => {
                Ok(http::uncached(ZIP, self.export(None).await?.archive))
            }
            (Base::Operator, None, ["entries", id, "flight.zip"]) => self.script(id).await,
            _ => {
                let (server, request) = (self.clone(), request.clone());
                let answer = tokio::task::spawn_blocking(move || server.answer_with_disk(&request));
                answer.await.unwrap_or(Err(Key::Broken))
            }
        }
    }

    /// Answers a request that may wait for the disk, by its kind of address. An entry's address
    /// accepts no POST.
    fn answer_with_disk(&self, request: &Request) -> KeyResult<Reply> {
        let parts: Vec<&str> = request.route.split('/').collect();
        match (&request.base, &request.body) {
            (Base::Visitors | Base::Kiosk, Some(body)) => self.visitor_post(&parts, body),
            (Base::Visitors | Base::Kiosk, None) => self.visitor_get(&parts, request),
            (Base::Operator, Some(body)) => self.operator_post(&parts, body),
            (Base::Operator, None) => self.operator_get(&parts, request),
            (Base::Entry(_), Some(_)) => Err(Key::NotHere),
            (Base::Entry(id), None) => self.entry_get(id, &parts, request),
        }
    }

    /// Answers the routes common to all addresses, which are the page and the facts that it needs.
    pub(crate) fn common(&self, parts: &[&str], request: &Request) -> KeyResult<Reply> {
        match *parts {
            ["alive"] => Ok(http::json(&json!({ "boot": self.boot }))),
            ["about.json"] => Ok(http::json(&self.about(request))),
            ["brand", "logo.svg"] => {
                Ok(sandboxed(http::uncached(SVG, self.brand.svg.clone().ok_or(Key::Closed)?)))
            }
            _ => self.page(request),
        }
    }

    /// Returns the answer with a file of the page. The empty route stands for the page itself.
    fn page(&self, request: &Request) -> KeyResult<Reply> {
        let first = match request.base {
            Base::Visitors | Base::Kiosk => "index.html",
            Base::Operator => "operator.html",
            Base::Entry(_) => "entry.html",
        };
        let name = if request.route.is_empty() { first } else { &request.route };
        let (_, text) = FILES.iter().find(|(file, _)| *file == name).ok_or(Key::Closed)?;
        let kind = content_type(name);
        let reply = http::with_etag(kind, text.as_bytes(), &self.etag, &request.if_none_match);
        Ok(with_field(reply, "Content-Security-Policy", POLICY))
    }

    /// Returns the facts that the page needs, as JSON.
    fn about(&self, request: &Request) -> Value {
        let Self { brand, scene, boot, entries, .. } = self;
        let role = match request.base {
            Base::Visitors | Base::Kiosk => Role::Visitor,
            Base::Operator => Role::Operator,
            Base::Entry(_) => Role::Entry,
        };
        let network = self.network_ip.is_some();
        let host = Host { role, boot, brand: &brand.words, network };
        if role == Role::Entry {
            return json!(host);
        }
        // On the host's machine, the program itself is faster than the module.
        let uses_module = self.module.is_some() && !request.peer.is_loopback();
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
            base: uses_module.then_some(&*self.base),
            scene: request.is_home().then_some(scene),
        })
    }

    /// Answers a GET of the visitors' or the kiosk's address by its route: the wall, an entry, or a
    /// file of the page.
    fn visitor_get(&self, parts: &[&str], request: &Request) -> KeyResult<Reply> {
        match *parts {
            ["wall"] => Ok(http::json(&self.entries.wall())),
            ["wall", name] => match name.split_once('.') {
                Some((key, "jpg")) => file_reply(self.entries.wall_file(key, JPEG)),
                Some((key, "json")) => file_reply(self.entries.wall_file(key, REPLAY)),
                _ => Err(Key::Closed),
            },
            // These are the photos of the flight that is being followed, and of an earlier flight.
            ["wall", key, "live.jpg"] => {
                let jpeg = self.entries.wall_light(key).ok_or(Key::Closed)?;
                Ok(http::uncached("image/jpeg", jpeg))
            }
            ["wall", key, name] => file_reply(self.entries.wall_flown(key, name)),
            ["qr.svg"] => self.code(Address::visitors_url),
            ["entries", id] => Ok(http::json(&self.entries.for_visitor(id)?)),
            ["entries", id, "qr.svg"] => self.entry_code(id),
            _ => self.common(parts, request),
        }
    }

    /// Answers a GET of the address of the entry `id` by its route: its facts, its photos, or a
    /// file of the page.
    fn entry_get(&self, id: &str, parts: &[&str], request: &Request) -> KeyResult<Reply> {
        match *parts {
            ["entry.json"] => Ok(http::json(&self.entries.for_visitor(id)?)),
            ["qr.svg"] => self.entry_code(id),
            [name @ (PNG | JPEG | REPLAY)] => file_reply(self.entries.file(id, name)),
            [name] if name.starts_with("flown-") => file_reply(self.entries.flown_file(id, name)),
            // The page then shows that the photo is gone.
            [""] if self.entries.for_visitor(id).is_err() => {
                Ok(with_status(self.page(request)?, 404))
            }
            _ => self.common(parts, request),
        }
    }

    /// Answers a POST to the visitors' or the kiosk's address, which withdraws an entry.
    fn visitor_post(&self, parts: &[&str], body: &[u8]) -> KeyResult<Reply> {
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

    /// Makes a photo or scripts on this machine, for the host or for browsers without the module.
    /// `name` is the route. Returns the answer, in which a refusal is a message for the page.
    async fn photo(&self, photo: PhotoRequest, name: &str, request: &Request) -> KeyResult<Reply> {
        let product = match name {
            "live" => Product::Live,
            "photos" => Product::Large { advice: photo.advice, files: photo.files },
            // Scripts are made only for a pilot at this machine, and not at a kiosk.
            _ if request.is_home() => Product::Script,
            _ => return Err(Key::NotHere),
        };
        let maker = if request.peer.is_loopback() { &self.host } else { &self.visitors };
        // The server does not store the photo, so the page repeats the request to have it flown.
        let body = request.body.as_deref().unwrap_or_default();
        let id = (name == "photos").then(|| String::from_utf8_lossy(body).into_owned());
        let (number, subject) = (photo.number, photo.subject);
        let page = Some(Asked { id, number });
        let answer = match maker.make(Job { product, subject, page, flight: None }).await {
            Ok(parcel) => parcel.files.into_iter().next().ok_or(Key::Broken)?.bytes,
            Err(message) if message.key == Key::Busy.name() => return Err(Key::Busy),
            Err(message) => PageAnswer::new(Asked { id: None, number }, Err(message)).json().into(),
        };
        Ok(http::uncached("application/json", answer))
    }

    /// Adds an entry for the photo that a visitor sends to be flown, and makes the photo again from
    /// its request, unless the request already has an entry. Returns the answer with the entry's
    /// name, number and page.
    async fn send_entry(
        self: &Arc<Self>,
        body: &[u8],
        request: &Request,
    ) -> Result<Reply, Message> {
        let posted = Posted::parse(body, &["visitor", "photo", "language"])?;
        let language = posted.member::<Option<String>>("language")?.unwrap_or_default();
        let photo_request = posted.member::<String>("photo")?;
        let photo = PhotoRequest::parse(photo_request.as_bytes(), request.asker())?;
        if language.len() > MAX_LANGUAGE || photo.visitor != posted.member::<String>("visitor")? {
            return Err(Key::PageOld.into());
        }
        // A repeated request has the same digest, and receives the receipt for the existing entry.
        let id = sha256(photo_request.as_bytes())[..32].to_owned();
        let existing = self.entries.admit(&id, request.peer)?;
        let Receipt { id, number, is_new } = match existing {
            Some(receipt) => receipt,
            None => self.make_entry(id, photo, language, request.peer).await?,
        };
        let page = self.access.address.entry_url(self.ip(), &id);
        let reply = http::json(&json!({ "id": id, "number": number, "page": page }));
        Ok(with_status(reply, if is_new { 201 } else { 200 }))
    }

    /// Makes the photo of an admitted request, and adds its entry. Returns the receipt, or the
    /// message of a refusal.
    async fn make_entry(
        self: &Arc<Self>,
        id: String,
        photo: PhotoRequest,
        language: String,
        sender: IpAddr,
    ) -> Result<Receipt, Message> {
        let PhotoRequest { visitor, subject, .. } = photo;
        let product = Product::Large { advice: false, files: true };
        let job = Job { product, subject: subject.clone(), page: None, flight: None };
        let Parcel { figures, files } = self.visitors.make(job).await?;
        let (server, photo) = (self.clone(), Photo { id, visitor, subject, figures, files });
        let added =
            tokio::task::spawn_blocking(move || server.entries.add(&photo, &language, sender));
        Ok(added.await.unwrap_or(Err(Key::Broken))?)
    }

    /// Returns the IP address for the addresses of pages, which is this machine's address in the
    /// network, or else the loopback address.
    pub(crate) fn ip(&self) -> IpAddr {
        self.network_ip.unwrap_or(Ipv4Addr::LOCALHOST.into())
    }

    /// Returns the answer with the QR code of a page, if phones can reach this machine.
    pub(crate) fn code(&self, page: impl Fn(&Address, IpAddr) -> String) -> KeyResult<Reply> {
        Ok(qr_code(&page(&self.access.address, self.network_ip.ok_or(Key::Closed)?)))
    }

    /// Returns the answer with the QR code of an entry's page.
    fn entry_code(&self, id: &str) -> KeyResult<Reply> {
        self.entries.for_visitor(id)?;
        self.code(|address, ip| address.entry_url(ip, id))
    }
}

/// Maximum length of a language code, in bytes.
const MAX_LANGUAGE: usize = 8;

/// JSON object in the body of a POST.
pub(crate) struct Posted(Map<String, Value>);

impl Posted {
    /// Parses a JSON object. Returns [`Key::PageOld`] for other texts, and for a member whose name
    /// is not in `names`.
    pub(crate) fn parse(body: &[u8], names: &[&str]) -> KeyResult<Self> {
        let members: Map<String, Value> =
            serde_json::from_slice(body).map_err(|_broken| Key::PageOld)?;
        let is_valid = members.keys().all(|name| names.contains(&&**name));
        if is_valid { Ok(Self(members)) } else { Err(Key::PageOld) }
    }

    /// Returns a member. An omitted member is null. Returns [`Key::PageOld`] for a member of
    /// another type.
    pub(crate) fn member<T: DeserializeOwned>(&self, name: &str) -> KeyResult<T> {
        let member = self.0.get(name).cloned().unwrap_or_default();
        serde_json::from_value(member).map_err(|_other| Key::PageOld)
    }
}

const SVG: &str = "image/svg+xml";
pub(crate) const ZIP: &str = "application/zip";

/// Content security policy, with which the page loads nothing from other servers, and runs only its
/// own scripts and module.
const POLICY: &str = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; img-src 'self' \
                      data: blob:; connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// Returns the answer with the QR code of a text.
pub(crate) fn qr_code(text: &str) -> Reply {
    sandboxed(http::uncached(SVG, qr::svg(text)))
}

/// Adds a policy to the answer with an SVG file, so that the file runs no script and loads nothing
/// if it is opened in a browser.
fn sandboxed(reply: Reply) -> Reply {
    let policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox";
    with_field(reply, "Content-Security-Policy", policy)
}

/// Returns the content type of a file by its extension, which is plain text for unknown ones.
fn content_type(name: &str) -> &'static str {
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

/// Returns the answer with a file, or the refusal [`Key::Closed`] if it does not exist.
pub(crate) fn file_reply(path: Option<PathBuf>) -> KeyResult<Reply> {
    let path = path.ok_or(Key::Closed)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    http::file(content_type(&name), &path).map_err(|_cause| Key::Closed)
}
