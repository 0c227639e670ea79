//! Who may ask: a browser that was given the address, from a page of this server.
//!
//! The address holds a token, so that another user or page of the machine does not know it. A name
//! that is rebound to this machine (DNS rebinding) is known by its `Host`, and a foreign page that
//! posts by its `Origin`, its `Sec-Fetch-Site`, and by the content type, which it may not set
//! without a leave that is never given. There are no cookies.

use std::net::IpAddr;

use super::http::{Answered, Head, MAX_BODY, Refusal};

/// What is let in.
#[derive(Debug)]
pub(super) struct Guard {
    /// Secret part of the address.
    pub(super) token: String,
    pub(super) port: u16,
    /// Whether other machines are served.
    pub(super) network: bool,
}

/// A request that was let in.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Admitted {
    /// Asks for what is at a route.
    Get(String),
    /// Sends a body of so many bytes to a route.
    Post(String, usize),
}

impl Guard {
    /// Admits a request.
    pub(super) fn admit(&self, head: &Head) -> Answered<Admitted> {
        if !self.is_own_host(head.field("host").unwrap_or_default()) {
            return Err(Refusal(421, "the address names another host"));
        }
        let route = head.path.strip_prefix("/k/").and_then(|path| path.strip_prefix(&*self.token));
        let Some(route) = route.and_then(|path| path.strip_prefix('/')) else {
            return Err(Refusal(403, "open the address that the program printed"));
        };
        match &*head.method {
            "GET" => Ok(Admitted::Get(route.to_owned())),
            "POST" => Ok(Admitted::Post(route.to_owned(), self.length(head)?)),
            _ => Err(Refusal(405, "GET or POST")),
        }
    }

    /// Whether a host is this server by number, or `localhost`: no name that others define.
    fn is_own_host(&self, host: &str) -> bool {
        let Some((name, port)) = host.rsplit_once(':') else { return false };
        let name = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
        let is_own = |ip: IpAddr| self.network || ip.is_loopback();
        port.parse() == Ok(self.port)
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
