//! Access: admits requests with a secret address, from pages of this server.
//!
//! Visitors, kiosks, the operator and each entry have separate addresses, each with a secret. The
//! operator's address works only on this machine. An entry's address gives access only to that
//! entry. The `Host` field reveals a name that was rebound to this machine (DNS rebinding). A POST
//! from a page of another origin is recognized by `Origin`, `Sec-Fetch-Site`, or its content type,
//! which requires a CORS preflight, and is refused. No cookies are used.

use std::net::IpAddr;

use hyper::Method;
use hyper::body::Bytes;
use hyper::http::request::Parts;

use super::address::{Address, is_secret};
use super::http::{HttpError, HttpResult, MAX_BODY};
use noctograph_photo_service::request::Asker;

/// Message for an address without a valid secret. A browser receives a page instead.
pub(crate) const OLD_ADDRESS: &str = "open the address that the program printed";

/// Rules for admitting requests.
#[derive(Debug)]
pub(crate) struct Access {
    pub(crate) address: Address,
    /// True if requests from other machines are admitted.
    pub(crate) network: bool,
}

/// Kind of address to which a request is sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Base {
    Visitors,
    /// Address of a public screen in the hall, without settings or downloads.
    Kiosk,
    Operator,
    /// Address of the entry with this name, which may not exist.
    Entry(String),
}

/// An admitted request.
#[derive(Debug)]
pub(crate) struct Request {
    pub(crate) peer: IpAddr,
    pub(crate) base: Base,
    pub(crate) route: String,
    /// Text after the question mark.
    pub(crate) query: String,
    /// `ETag` of the file in the browser's cache, or an empty text if there is none.
    pub(crate) if_none_match: String,
    /// Body of a POST, read after the request is admitted, or `None` for a GET.
    pub(crate) body: Option<Bytes>,
}

impl Request {
    /// True if the request comes from this machine and is not sent to the kiosk's address.
    pub(crate) fn is_home(&self) -> bool {
        self.peer.is_loopback() && self.base != Base::Kiosk
    }

    /// Returns the kind of page that sent the request.
    pub(crate) fn asker(&self) -> Asker {
        if self.base == Base::Kiosk { Asker::Kiosk } else { Asker::Served }
    }
}

impl Access {
    /// Checks the header of a request. Returns the request, with an empty body for a POST, or the
    /// reason for refusing it.
    pub(crate) fn admit(&self, head: &Parts, peer: IpAddr) -> HttpResult<Request> {
        let n_hosts = head.headers.get_all("host").iter().count();
        if n_hosts > 1 || !self.is_this_server(field(head, "host")) {
            return Err(HttpError(421, "the address names another host"));
        }
        // No route contains a percent sign, so paths need no decoding.
        let (base, route) = self.base(head.uri.path(), peer).ok_or(HttpError(403, OLD_ADDRESS))?;
        let body = match head.method {
            Method::GET => None,
            Method::POST => {
                check_post(head)?;
                Some(Bytes::new())
            }
            _ => return Err(HttpError(405, "GET or POST")),
        };
        let query = head.uri.query().unwrap_or_default().to_owned();
        let if_none_match = field(head, "if-none-match").to_owned();
        Ok(Request { peer, base, route: route.to_owned(), query, if_none_match, body })
    }

    /// Returns the kind of address and the route of a path `/KIND/SECRET/ROUTE`, or `None` without
    /// a valid secret. The operator's address is valid only on this machine (`peer`).
    fn base<'a>(&self, path: &'a str, peer: IpAddr) -> Option<(Base, &'a str)> {
        let mut parts = path.strip_prefix('/')?.splitn(3, '/');
        let (kind, secret, route) = (parts.next()?, parts.next()?, parts.next()?);
        let base = match kind {
            "k" if secrets_match(secret, &self.address.visitors) => Base::Visitors,
            "k" if secrets_match(secret, &self.address.kiosk) => Base::Kiosk,
            "o" if peer.is_loopback() && secrets_match(secret, &self.address.operator) => {
                Base::Operator
            }
            // A name in capital letters is no secret of this server, but the page says that the
            // entry is gone.
            "e" if is_secret(&secret.to_ascii_lowercase()) => Base::Entry(secret.to_owned()),
            _ => return None,
        };
        Some((base, route))
    }

    /// Returns true if a `Host` is `localhost` or a literal IP address, and has the port of this
    /// server. Without `--network`, only loopback addresses are accepted. Any other name is
    /// refused, because a foreign page could make its host name resolve to this machine (DNS
    /// rebinding), which is impossible for a literal address.
    fn is_this_server(&self, host: &str) -> bool {
        let Some((name, port)) = host.rsplit_once(':') else { return false };
        let name = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
        let address = name.parse::<IpAddr>();
        port == self.address.port.to_string()
            && (name == "localhost" || address.is_ok_and(|ip| self.network || ip.is_loopback()))
    }
}

/// True if a browser requests an address as a page. A browser that accepts any type also counts.
pub(crate) fn wants_page(head: &Parts) -> bool {
    let accept = field(head, "accept");
    head.method == Method::GET && (accept.contains("text/html") || accept == "*/*")
}

/// Returns the first language in a browser's list that is one of `languages`, or `None` if there is
/// none. Languages are compared by the two letters with which a tag such as `de-CH` begins.
pub(crate) fn language<'a>(head: &Parts, languages: &[&'a str]) -> Option<&'a str> {
    let tags = field(head, "accept-language").split(',');
    let mut codes = tags.filter_map(|tag| tag.trim().get(..2));
    codes.find_map(|accepted| languages.iter().find(|code| **code == accepted).copied())
}

/// Returns a header field of a request, or an empty text if it is missing or not ASCII.
fn field<'a>(head: &'a Parts, name: &str) -> &'a str {
    head.headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default()
}

/// Checks that a POST comes from a page of this server, that it is JSON, and that its body is not
/// too long. Returns the status and the reason for a refusal.
fn check_post(head: &Parts) -> HttpResult<()> {
    let origin = format!("http://{}", field(head, "host"));
    for (name, expected) in [("origin", &*origin), ("sec-fetch-site", "same-origin")] {
        // A field may be sent more than once, and each of its values must be correct.
        if head.headers.get_all(name).iter().any(|value| value != expected) {
            return Err(HttpError(403, "a page from another origin sent the request"));
        }
    }
    if field(head, "content-type") != "application/json" {
        return Err(HttpError(415, "Content-Type: application/json"));
    }
    if !head.headers.contains_key("content-length") {
        return Err(HttpError(411, "a Content-Length"));
    }
    // hyper refuses a length that is not a number, so only a number that is too large fails here.
    match field(head, "content-length").parse() {
        Ok(0..=MAX_BODY) => Ok(()),
        _ => Err(HttpError(413, "at most 256 KiB; simplify the drawing")),
    }
}

/// Returns true if two secrets are equal. The time of the comparison does not depend on where they
/// differ.
fn secrets_match(a: &str, b: &str) -> bool {
    let different_bits = a.bytes().zip(b.bytes()).fold(0, |bits, (a, b)| bits | (a ^ b));
    a.len() == b.len() && different_bits == 0
}
