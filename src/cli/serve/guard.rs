//! Who may ask: a browser that was given the address, from a page of this server.
//!
//! The address holds a secret, so that another user or page of the machine does not know it: one of
//! the visitors, one of the operator, who sits at this machine, and one of each entry, which leads
//! to that entry alone. A name that is rebound to this machine (DNS rebinding) is known by its
//! `Host`, and a foreign page that posts by its `Origin`, its `Sec-Fetch-Site`, and by the content
//! type, for which its browser would ask first (a CORS preflight), which is refused. There are no
//! cookies.

use std::net::IpAddr;

use super::address::Address;
use super::http::{Answered, Head, MAX_BODY, Refusal};

/// What is let in.
#[derive(Debug)]
pub(super) struct Guard {
    pub(super) address: Address,
    /// Whether other machines are served.
    pub(super) network: bool,
}

/// Whose address was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Base {
    Visitors,
    Operator,
    /// That of an entry by its name, which is not known yet to be one.
    Entry(String),
}

/// A request that was let in.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Admitted {
    pub(super) base: Base,
    pub(super) route: String,
    /// What follows the question mark.
    pub(super) query: String,
    /// Length of the body that is sent; `None`: something is asked for.
    pub(super) length: Option<usize>,
}

impl Guard {
    pub(super) fn admit(&self, head: &Head) -> Answered<Admitted> {
        if !self.is_own_host(head.field("host").unwrap_or_default()) {
            return Err(Refusal(421, "the address names another host"));
        }
        let (path, query) = head.path.split_once('?').unwrap_or((&head.path, ""));
        let foreign = Refusal(403, "open the address that the program printed");
        let (base, route) = self.base(path, head.peer).ok_or(foreign)?;
        let length = match &*head.method {
            "GET" => None,
            "POST" => Some(self.length(head)?),
            _ => return Err(Refusal(405, "GET or POST")),
        };
        Ok(Admitted { base, route: route.to_owned(), query: query.to_owned(), length })
    }

    fn base<'a>(&self, path: &'a str, peer: IpAddr) -> Option<(Base, &'a str)> {
        let mut parts = path.strip_prefix('/')?.splitn(3, '/');
        let (kind, secret, route) = (parts.next()?, parts.next()?, parts.next()?);
        let is_name = secret.len() == 32 && secret.bytes().all(|byte| byte.is_ascii_hexdigit());
        let base = match kind {
            "k" if is_same(secret, &self.address.visitors) => Base::Visitors,
            "o" if peer.is_loopback() && is_same(secret, &self.address.operator) => Base::Operator,
            "e" if is_name => Base::Entry(secret.to_owned()),
            _ => return None,
        };
        Some((base, route))
    }

    /// Whether a host is this server by number, or `localhost`: no name that others define.
    fn is_own_host(&self, host: &str) -> bool {
        let Some((name, port)) = host.rsplit_once(':') else { return false };
        let name = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
        let is_own = |ip: IpAddr| self.network || ip.is_loopback();
        port.parse() == Ok(self.address.port)
            && (name == "localhost" || name.parse::<IpAddr>().is_ok_and(is_own))
    }

    /// The length of a body that is sent by a page of this server.
    fn length(&self, head: &Head) -> Answered<usize> {
        let host = head.field("host").unwrap_or_default();
        let foreign = Refusal(403, "a page of another origin asks");
        let origin = head.field("origin").and_then(|origin| origin.strip_prefix("http://"));
        if head.field("origin").is_some() && origin != Some(host) {
            return Err(foreign);
        }
        if head.field("sec-fetch-site").is_some_and(|site| site != "same-origin") {
            return Err(foreign);
        }
        if head.field("content-type") != Some("application/json") {
            return Err(Refusal(415, "Content-Type: application/json"));
        }
        let length = head.field("content-length").ok_or(Refusal(411, "a Content-Length"))?;
        let length =
            length.parse().map_err(|_no_number| Refusal(400, "a Content-Length in bytes"))?;
        if length > MAX_BODY {
            return Err(Refusal(413, "at most 256 KiB; simplify the drawing"));
        }
        Ok(length)
    }
}

/// Whether two secrets are the same, in a time that does not tell where they differ.
fn is_same(a: &str, b: &str) -> bool {
    let differ = a.bytes().zip(b.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b));
    a.len() == b.len() && differ == 0
}
