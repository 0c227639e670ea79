//! HTTP/1.1 for a page of one's own machine: one request a connection, read within a deadline and a
//! size.
//!
//! The heads are parsed by httparse, hyper's parser. A whole server crate would own the sockets,
//! and with them the limits that the page needs on silent and on many connections.

use std::io::{ErrorKind, Read, Write};
use std::net::{IpAddr, TcpStream};
use std::time::{Duration, Instant};

use serde_json::Value;

/// Longest head, and most of its fields: browsers send 2 KiB in 20 fields.
const MAX_HEAD: usize = 16 << 10;
const MAX_FIELDS: usize = 64;
/// Longest body: a drawing.
pub(super) const MAX_BODY: usize = 256 << 10;
/// Time within which a request must be here, and each part of an answer be taken.
const PATIENCE: Duration = Duration::from_secs(5);
/// What is read, and how long, of a request that was refused before its end: a connection that is
/// closed on unread bytes may lose its answer.
const LEFT: usize = 1 << 20;
const LEFT_PATIENCE: Duration = Duration::from_millis(500);

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Refusal(pub(super) u16, pub(super) &'static str);

/// What a request leads to.
pub(super) type Answered<T> = Result<T, Refusal>;

/// First line and fields of a request.
#[derive(Debug)]
pub(super) struct Head {
    pub(super) method: String,
    /// As it was sent: nothing is decoded, since no route needs it.
    pub(super) path: String,
    pub(super) peer: IpAddr,
    fields: Vec<(String, String)>,
}

impl Head {
    /// The value of a field; `None` where it is missing.
    pub(super) fn field(&self, name: &str) -> Option<&str> {
        let field = self.fields.iter().find(|(known, _)| known.eq_ignore_ascii_case(name));
        field.map(|(_, value)| value.as_str())
    }
}

/// A connection whose request is being read.
#[derive(Debug)]
pub(super) struct Connection {
    stream: TcpStream,
    deadline: Instant,
    bytes: Vec<u8>,
}

impl Connection {
    pub(super) fn new(stream: TcpStream) -> Self {
        Self { stream, deadline: Instant::now() + PATIENCE, bytes: Vec::new() }
    }

    /// Reads the head.
    pub(super) fn head(&mut self) -> Answered<Head> {
        let peer = self.stream.peer_addr().map_err(|_gone| GONE)?.ip();
        loop {
            let mut fields = [httparse::EMPTY_HEADER; MAX_FIELDS];
            let mut head = httparse::Request::new(&mut fields);
            let parsed = head.parse(&self.bytes).map_err(|_broken| Refusal(400, "no HTTP"))?;
            if let httparse::Status::Complete(length) = parsed {
                let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
                let field = |it: &httparse::Header<'_>| (it.name.to_owned(), text(it.value));
                let head = Head {
                    method: head.method.unwrap_or_default().to_owned(),
                    path: head.path.unwrap_or_default().to_owned(),
                    peer,
                    fields: head.headers.iter().map(field).collect(),
                };
                self.bytes.drain(..length);
                return Ok(head);
            }
            if self.bytes.len() >= MAX_HEAD {
                return Err(Refusal(431, "the head of the request is too long"));
            }
            self.read_more()?;
        }
    }

    /// Reads the body of a length that is at most [`MAX_BODY`].
    pub(super) fn body(&mut self, length: usize) -> Answered<Vec<u8>> {
        while self.bytes.len() < length {
            self.read_more()?;
        }
        Ok(self.bytes.drain(..length).collect())
    }

    fn read_more(&mut self) -> Answered<()> {
        let late = Refusal(408, "the request did not arrive in time");
        let left = self.deadline.checked_duration_since(Instant::now()).ok_or(late)?;
        self.stream
            .set_read_timeout(Some(left.max(Duration::from_millis(1))))
            .map_err(|_closed| GONE)?;
        let mut part = [0; 8192];
        match self.stream.read(&mut part) {
            Ok(0) => Err(GONE),
            Ok(n) => {
                self.bytes.extend_from_slice(&part[..n]);
                Ok(())
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                Err(late)
            }
            Err(_) => Err(GONE),
        }
    }

    /// Sends an answer and closes the connection. Returns whether all of it was taken.
    pub(super) fn answer(mut self, answer: Answer) -> bool {
        let sent = self.send(answer).is_ok();
        let _ = self.stream.shutdown(std::net::Shutdown::Write);
        let _ = self.stream.set_read_timeout(Some(LEFT_PATIENCE));
        let _ = std::io::copy(&mut (&self.stream).take(LEFT as u64), &mut std::io::sink());
        sent
    }

    fn send(&mut self, answer: Answer) -> std::io::Result<()> {
        self.stream.set_write_timeout(Some(PATIENCE))?;
        self.stream.set_nodelay(true)?;
        let Answer { status, kind, fields, body } = answer;
        let mut head = format!(
            "HTTP/1.1 {status} \r\nContent-Type: {kind}\r\nConnection: close\r\n\
             Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n\
             Cross-Origin-Resource-Policy: same-origin\r\nReferrer-Policy: no-referrer\r\n{fields}"
        );
        head += &format!("Content-Length: {}\r\n\r\n", body.len());
        self.stream.write_all(&[head.as_bytes(), &body].concat())
    }
}

/// The other side closed the connection: nobody reads an answer.
const GONE: Refusal = Refusal(400, "the connection was closed");

/// An answer.
#[derive(Debug)]
pub(super) struct Answer {
    status: u16,
    kind: &'static str,
    /// Further fields, each with its end of line.
    fields: String,
    body: Vec<u8>,
}

impl Answer {
    pub(super) fn whole(kind: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self { status: 200, kind, fields: String::new(), body: body.into() }
    }

    pub(super) fn json(value: &Value) -> Self {
        Self::whole("application/json", value.to_string())
    }

    pub(super) fn with_field(mut self, name: &str, value: &str) -> Self {
        self.fields += &format!("{name}: {value}\r\n");
        self
    }
}

impl From<Refusal> for Answer {
    fn from(Refusal(status, why): Refusal) -> Self {
        let refused = Self { status, ..Self::whole("text/plain; charset=utf-8", why) };
        if status == 503 { refused.with_field("Retry-After", "2") } else { refused }
    }
}
