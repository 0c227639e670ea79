//! Who may ask: a browser that was given the address, from a page of this server.
//!
//! The address holds a secret, so that another user or page of the machine does not know it: one of
//! the visitors, one of the kiosks, one of the operator, who sits at this machine, and one of each
//! entry, which leads to that entry alone. A name that is rebound to this machine (DNS rebinding)
//! is known by its `Host`, and a foreign page that posts by its `Origin`, its `Sec-Fetch-Site`, and
//! by the content type, for which its browser would ask first (a CORS preflight), which is refused.
//! There are no cookies.

use std::net::IpAddr;

use hyper::Method;
use hyper::body::Bytes;
use hyper::http::request::Parts;

use super::address::{Address, is_secret};
use super::http::{HttpError, HttpResult, MAX_BODY};
use noctograph_photo_service::request::Asker;

/// Why an address without a valid secret is refused: of a browser it opens a page that says so.
pub(crate) const OLD_ADDRESS: &str = "open the address that the program printed";

/// What is let in.
#[derive(Debug)]
pub(crate) struct Access {
    pub(crate) address: Address,
    /// Whether other machines are served.
    pub(crate) network: bool,
}

/// Whose address was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Base {
    Visitors,
    /// A screen that stands in the hall: no settings and no downloads.
    Kiosk,
    Operator,
    /// That of an entry by its name, which is not known yet to be one.
    Entry(String),
}

/// A request that was let in.
#[derive(Debug)]
pub(crate) struct Request {
    pub(crate) peer: IpAddr,
    pub(crate) base: Base,
    pub(crate) route: String,
    /// What follows the question mark.
    pub(crate) query: String,
    /// The mark of the page's file that the browser has.
    pub(crate) known_mark: Option<String>,
    /// What is sent, read after the request was let in; `None`: something is asked for.
    pub(crate) body: Option<Bytes>,
}

impl Request {
    /// Whether it comes from this machine, and not from a screen that stands in the hall.
    pub(crate) fn is_home(&self) -> bool {
        self.peer.is_loopback() && self.base != Base::Kiosk
    }

    /// The page that asks.
    pub(crate) fn asker(&self) -> Asker {
        if self.base == Base::Kiosk { Asker::Kiosk } else { Asker::Served }
    }
}

impl Access {
    pub(crate) fn admit(&self, head: &Parts, peer: IpAddr) -> HttpResult<Request> {
        if head.headers.get_all("host").iter().count() > 1 || !self.is_own_host(field(head, "host"))
        {
            return Err(HttpError(421, "the address names another host"));
        }
        let unknown = HttpError(403, OLD_ADDRESS);
        // Nothing is decoded, since no route needs it.
        let (base, route) = self.base(head.uri.path(), peer).ok_or(unknown)?;
        let body = match head.method {
            Method::GET => None,
            Method::POST => {
                check_post(head)?;
                Some(Bytes::new())
            }
            _ => return Err(HttpError(405, "GET or POST")),
        };
        let query = head.uri.query().unwrap_or_default().to_owned();
        let known_mark = Some(field(head, "if-none-match").to_owned());
        Ok(Request { peer, base, route: route.to_owned(), query, known_mark, body })
    }

    fn base<'a>(&self, path: &'a str, peer: IpAddr) -> Option<(Base, &'a str)> {
        let mut parts = path.strip_prefix('/')?.splitn(3, '/');
        let (kind, secret, route) = (parts.next()?, parts.next()?, parts.next()?);
        let base = match kind {
            "k" if is_same(secret, &self.address.visitors) => Base::Visitors,
            "k" if is_same(secret, &self.address.kiosk) => Base::Kiosk,
            "o" if peer.is_loopback() && is_same(secret, &self.address.operator) => Base::Operator,
            "e" if is_secret(&secret.to_ascii_lowercase()) => Base::Entry(secret.to_owned()),
            _ => return None,
        };
        Some((base, route))
    }

    /// Whether a host is this server by number, or `localhost`: no name that others define.
    fn is_own_host(&self, host: &str) -> bool {
        let Some((name, port)) = host.rsplit_once(':') else { return false };
        let name = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
        let is_own = |ip: IpAddr| self.network || ip.is_loopback();
        port == self.address.port.to_string()
            && (name == "localhost" || name.parse::<IpAddr>().is_ok_and(is_own))
    }
}

/// Whether a browser opens an address, and reads a page.
pub(crate) fn wants_page(head: &Parts) -> bool {
    let accept = field(head, "accept");
    head.method == Method::GET && (accept.contains("text/html") || accept == "*/*")
}

/// The first language of a page that a browser wants, of those that there are.
pub(crate) fn language<'a>(head: &Parts, known: &[&'a str]) -> Option<&'a str> {
    let wanted = field(head, "accept-language").split(',');
    let wanted = wanted.filter_map(|tag| tag.trim().get(..2));
    wanted.filter_map(|tag| known.iter().find(|code| **code == tag).copied()).next()
}

/// A field of a request; empty where it is missing or no ASCII.
fn field<'a>(head: &'a Parts, name: &str) -> &'a str {
    head.headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default()
}

/// Checks that a page of this server sends it, and that its body is not too long.
fn check_post(head: &Parts) -> HttpResult<()> {
    let has = |name: &str| head.headers.contains_key(name);
    // A field that is sent twice has two values, and each of them counts.
    let says_other =
        |name: &str, own: &str| head.headers.get_all(name).iter().any(|value| value != own);
    let origin = format!("http://{}", field(head, "host"));
    if says_other("origin", &origin) || says_other("sec-fetch-site", "same-origin") {
        return Err(HttpError(403, "a page of another origin asks"));
    }
    if field(head, "content-type") != "application/json" {
        return Err(HttpError(415, "Content-Type: application/json"));
    }
    if !has("content-length") {
        return Err(HttpError(411, "a Content-Length"));
    }
    // hyper has read it as a number.
    match field(head, "content-length").parse() {
        Ok(0..=MAX_BODY) => Ok(()),
        _ => Err(HttpError(413, "at most 256 KiB; simplify the drawing")),
    }
}

/// Whether two secrets are the same, in a time that does not tell where they differ.
fn is_same(a: &str, b: &str) -> bool {
    let differ = a.bytes().zip(b.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b));
    a.len() == b.len() && differ == 0
}
