//! HTTP/1.1 for a page of one's own machine: one request a connection, read within a deadline and a
//! size.
//!
//! The heads are parsed by httparse, hyper's parser. A whole server crate would own the sockets,
//! and with them the limits that the page needs on silent and on many connections.

use std::fs::File;
use std::io::{Cursor, ErrorKind, Read, Write};
use std::net::{IpAddr, Shutdown, TcpStream};
use std::path::Path;
use std::time::{Duration, Instant};

use super::Value;

/// Longest head, and most of its fields: browsers send 2 KiB in 20 fields.
const MAX_HEAD: usize = 16 << 10;
const MAX_FIELDS: usize = 64;
/// Longest body: a drawing.
pub(super) const MAX_BODY: usize = 256 << 10;
/// Time within which a request must be here, and least time for an answer to be taken.
const PATIENCE: Duration = Duration::from_secs(5);
/// Least rate at which an answer must be taken: a photo of 2.5 MB within 30 s.
const LEAST_BYTES_S: u64 = 100_000;
/// What is read, and how long in all, of a request that was refused before its end: a connection
/// that is closed on unread bytes may lose its answer.
const LEFT: usize = 1 << 20;
const LEFT_PATIENCE: Duration = Duration::from_millis(500);
/// What is read or written at a time.
const PART: usize = 16 << 10;

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
        let mut part = [0; PART];
        match self.read(&mut part, self.deadline) {
            Ok(n @ 1..) => {
                self.bytes.extend_from_slice(&part[..n]);
                Ok(())
            }
            Err(error) if is_late(&error) => {
                Err(Refusal(408, "the request did not arrive in time"))
            }
            Ok(0) | Err(_) => Err(GONE),
        }
    }

    fn read(&self, part: &mut [u8], deadline: Instant) -> std::io::Result<usize> {
        self.stream.set_read_timeout(Some(left(deadline)?))?;
        (&self.stream).read(part)
    }

    /// Whether the other side has hung up. A browser keeps both directions open until it has its
    /// answer.
    pub(super) fn is_gone(&self) -> bool {
        let looked = self.stream.set_nonblocking(true).and_then(|()| self.stream.peek(&mut [0]));
        let _ = self.stream.set_nonblocking(false);
        match looked {
            Ok(n) => n == 0,
            Err(error) => !is_late(&error),
        }
    }

    /// Sends an answer within a time for the whole of it, and closes the connection.
    pub(super) fn answer(self, answer: Answer) {
        let seconds = PATIENCE + Duration::from_secs(answer.length / LEAST_BYTES_S);
        let _ = self.send(answer, Instant::now() + seconds);
        let _ = self.stream.shutdown(Shutdown::Write);
        let (deadline, mut n_left) = (Instant::now() + LEFT_PATIENCE, LEFT);
        let mut part = [0; PART];
        while n_left > 0
            && let Ok(n @ 1..) = self.read(&mut part, deadline)
        {
            n_left = n_left.saturating_sub(n);
        }
    }

    fn send(&self, answer: Answer, deadline: Instant) -> std::io::Result<()> {
        self.stream.set_nodelay(true)?;
        let Answer { status, kind, fields, length, body } = answer;
        let head = format!(
            "HTTP/1.1 {status} \r\nContent-Type: {kind}\r\nConnection: close\r\n\
             X-Content-Type-Options: nosniff\r\nCross-Origin-Resource-Policy: same-origin\r\n\
             Referrer-Policy: no-referrer\r\n{fields}Content-Length: {length}\r\n\r\n"
        );
        let (mut sent, mut part) = (head.as_bytes().chain(body.take(length)), vec![0; PART]);
        loop {
            match sent.read(&mut part)? {
                0 => return Ok(()),
                n => self.write(&part[..n], deadline)?,
            }
        }
    }

    fn write(&self, mut bytes: &[u8], deadline: Instant) -> std::io::Result<()> {
        while !bytes.is_empty() {
            self.stream.set_write_timeout(Some(left(deadline)?))?;
            match (&self.stream).write(bytes)? {
                0 => return Err(ErrorKind::WriteZero.into()),
                n => bytes = &bytes[n..],
            }
        }
        Ok(())
    }
}

/// What is left until a deadline.
fn left(deadline: Instant) -> std::io::Result<Duration> {
    let left = deadline.checked_duration_since(Instant::now()).ok_or(ErrorKind::TimedOut)?;
    Ok(left.max(Duration::from_millis(1)))
}

fn is_late(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}

/// The other side closed the connection: nobody reads an answer.
const GONE: Refusal = Refusal(400, "the connection was closed");

pub(super) struct Answer {
    status: u16,
    kind: &'static str,
    /// Further fields, each with its end of line.
    fields: String,
    length: u64,
    /// Text, or a file: what a slow reader takes does not wait in memory.
    body: Box<dyn Read>,
}

impl Answer {
    pub(super) fn whole(kind: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self::new(kind, body.into()).with_field("Cache-Control", "no-store")
    }

    /// A file that does not change, and the browser may keep.
    #[expect(clippy::disallowed_methods, reason = "a file of the gallery, and no link")]
    pub(super) fn file(kind: &'static str, path: &Path) -> std::io::Result<Self> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        let answer = Self { length, body: Box::new(file), ..Self::new(kind, Vec::new()) };
        Ok(answer.with_field("Cache-Control", "private, max-age=86400, immutable"))
    }

    /// A file of the page, which the browser may keep as long as its mark is the same.
    pub(super) fn marked(kind: &'static str, body: &str, mark: &str, head: &Head) -> Self {
        let is_known = head.field("if-none-match") == Some(mark);
        let (status, body) = if is_known { (304, "") } else { (200, body) };
        let answer = Self::new(kind, body.into()).with_status(status);
        answer.with_field("Cache-Control", "no-cache").with_field("ETag", mark)
    }

    pub(super) fn json(value: &Value) -> Self {
        Self::whole("application/json", value.to_string())
    }

    fn new(kind: &'static str, body: Vec<u8>) -> Self {
        let (length, body) = (body.len() as u64, Box::new(Cursor::new(body)));
        Self { status: 200, kind, fields: String::new(), length, body }
    }

    pub(super) fn with_status(self, status: u16) -> Self {
        let answer = Self { status, ..self };
        if status == 503 { answer.with_field("Retry-After", "2") } else { answer }
    }

    pub(super) fn with_field(mut self, name: &str, value: &str) -> Self {
        self.fields += &format!("{name}: {value}\r\n");
        self
    }
}

impl From<Refusal> for Answer {
    fn from(Refusal(status, why): Refusal) -> Self {
        Self::whole("text/plain; charset=utf-8", why).with_status(status)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    /// A server's end of a connection, and the other one.
    fn connected() -> (Connection, TcpStream) {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        (Connection::new(listener.accept().unwrap().0), client)
    }

    #[test]
    fn a_slow_reader_is_given_up_though_it_takes_a_little_all_the_time() {
        let (server, mut client) = connected();
        let reading = std::thread::spawn(move || {
            let mut part = [0; 512];
            while client.read(&mut part).is_ok_and(|n| n > 0) {
                std::thread::sleep(Duration::from_millis(5));
            }
        });
        let begun = Instant::now();
        let large = Answer::whole("text/plain", vec![0; 16 << 20]);
        let sent = server.send(large, begun + Duration::from_millis(400));
        assert!(sent.is_err_and(|error| is_late(&error)));
        assert!(begun.elapsed() < Duration::from_secs(3), "{:?}", begun.elapsed());
        let _ = server.stream.shutdown(Shutdown::Both);
        reading.join().unwrap();
    }

    #[test]
    fn a_request_that_trickles_is_given_up() {
        let (mut server, mut client) = connected();
        server.deadline = Instant::now() + Duration::from_millis(300);
        std::thread::spawn(move || {
            while client.write_all(b"x").is_ok() {
                std::thread::sleep(Duration::from_millis(5));
            }
        });
        assert_eq!(server.head().unwrap_err().0, 408);
    }

    #[test]
    fn who_hangs_up_is_gone() {
        let (server, client) = connected();
        assert!(!server.is_gone());
        drop(client);
        std::thread::sleep(Duration::from_millis(20));
        assert!(server.is_gone());
    }
}
