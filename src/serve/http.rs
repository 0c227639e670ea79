//! Connections and answers, on hyper. Each connection is a task that handles one request.
//!
//! A timeout closes the connection of a silent client, and a slow reader occupies only a task. If
//! there are too many connections, the oldest one from the IP address with the most connections is
//! closed, unless its request is being worked on. Therefore, no client can lock out others.

use std::convert::Infallible;
use std::fs::File;
use std::io::Read;
use std::net::IpAddr;
use std::path::Path;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll};
use std::time::Duration;

use http_body_util::{BodyExt, Limited};
use hyper::body::{Body, Bytes, Frame, Incoming, SizeHint};
use hyper::header::HeaderValue;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use noctograph_core::digest::sha256;
use noctograph_photo_service::messages::{Key, Message};
use serde::Serialize;
use serde_json::json;
use tokio::net::TcpListener;
use tokio::task::AbortHandle;
use tokio::time::{sleep, timeout};

/// Maximum number of simultaneous connections, enough for forty browsers with six connections each.
const MAX_CONNECTIONS: usize = 256;
/// Maximum size of a request's header, in bytes. Browsers send about 2 KiB.
const MAX_HEAD: usize = 16 << 10;
/// Maximum number of fields in a header. Browsers send about 20.
const MAX_FIELDS: usize = 64;
/// Maximum size of a body in bytes, enough for a drawing.
pub(crate) const MAX_BODY: usize = 256 << 10;
/// Time limit for receiving the header of a request, and again for its body.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(5);
/// Longest duration of a connection, enough for an evening's scripts or a slow reader.
const CONNECTION_TIMEOUT: Duration = Duration::from_secs(600);
/// Maximum number of bytes that are read of a refused body.
const MAX_REFUSED_BODY: usize = 1 << 20;
/// Longest time for which a refused body is read.
const REFUSED_TIMEOUT: Duration = Duration::from_millis(500);
/// Number of bytes of a file that are read at a time.
const CHUNK: usize = 64 << 10;
/// Pause after a failure to accept a connection, for example because no file handles are left.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

pub(crate) type Reply = hyper::Response<ReplyBody>;

/// Status and reason with which a request is refused before it is routed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct HttpError(pub(crate) u16, pub(crate) &'static str);

pub(crate) type HttpResult<T> = Result<T, HttpError>;

/// An open connection and the task that serves it.
struct Connection {
    peer: IpAddr,
    /// True while the request is being worked on, during which the connection is not closed.
    is_working: Arc<AtomicBool>,
    task: AbortHandle,
}

/// A request with the IP address of its sender and [`Connection::is_working`].
pub(crate) type Arrival = (IpAddr, hyper::Request<Incoming>, Arc<AtomicBool>);

/// Accepts connections forever, and answers their requests with `answer`. If there are
/// [`MAX_CONNECTIONS`], the oldest idle one from the IP address with the most is closed.
pub(crate) async fn accept<F, R>(listener: TcpListener, answer: F) -> Infallible
where
    F: Fn(Arrival) -> R + Clone + Send + 'static,
    R: Future<Output = Reply> + Send + 'static,
{
    let mut connections: Vec<Connection> = Vec::new();
    loop {
        let Ok((stream, address)) = listener.accept().await else {
            sleep(ACCEPT_PAUSE).await;
            continue;
        };
        connections.retain(|connection| !connection.task.is_finished());
        if connections.len() >= MAX_CONNECTIONS {
            // If no connection is idle, the new one is closed. That is rare, because fewer requests
            // can be in progress.
            let Some(index) = oldest_idle(&connections) else { continue };
            connections.remove(index).task.abort();
        }
        let (peer, is_working) = (address.ip(), Arc::new(AtomicBool::new(false)));
        let (answer, working) = (answer.clone(), is_working.clone());
        let service = service_fn(move |request| {
            let reply = answer((peer, request, working.clone()));
            async { Ok::<_, Infallible>(reply.await) }
        });
        // With Nagle's algorithm, the end of an answer would be sent only after its beginning was
        // acknowledged.
        let _ = stream.set_nodelay(true);
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(REQUEST_TIMEOUT)
            .max_buf_size(MAX_HEAD)
            .max_headers(MAX_FIELDS)
            .keep_alive(false)
            .title_case_headers(true)
            .serve_connection(TokioIo::new(stream), service);
        let task = tokio::spawn(timeout(CONNECTION_TIMEOUT, connection)).abort_handle();
        connections.push(Connection { peer, is_working, task });
    }
}

/// Returns the index of the oldest connection whose request is not being worked on, from the IP
/// address with the most connections, or `None` if all requests are being worked on.
fn oldest_idle(connections: &[Connection]) -> Option<usize> {
    // `max_by_key` returns the last of equal items, which is the oldest in reverse order.
    let idle = connections.iter().enumerate().rev();
    let idle = idle.filter(|(_, connection)| !connection.is_working.load(Ordering::Relaxed));
    let most = idle.max_by_key(|(_, Connection { peer, .. })| {
        connections.iter().filter(|other| other.peer == *peer).count()
    });
    most.map(|(index, _)| index)
}

/// Returns a request's body of at most [`MAX_BODY`] bytes, or the status and the reason for a
/// refusal.
pub(crate) async fn read_body(body: Incoming) -> HttpResult<Bytes> {
    let read = timeout(REQUEST_TIMEOUT, Limited::new(body, MAX_BODY).collect()).await;
    let read = read.map_err(|_late| HttpError(408, "the request did not arrive in time"))?;
    Ok(read.map_err(|_gone| HttpError(400, "the request was cut off"))?.to_bytes())
}

/// Reads a refused body, because closing a connection with unread bytes may lose the answer.
pub(crate) async fn discard_body(body: Incoming) {
    let _ = timeout(REFUSED_TIMEOUT, Limited::new(body, MAX_REFUSED_BODY).collect()).await;
}

/// Returns an answer with the fields that all answers contain. Browsers then do not guess the type
/// of the answer, show it in other pages, or send its address to others. If the server is busy, the
/// answer also asks the client to try again after 2 s.
pub(crate) fn with_common_fields(reply: Reply) -> Reply {
    let reply = match reply.status().as_u16() {
        429 | 503 => with_field(reply, "Retry-After", "2"),
        _ => reply,
    };
    let reply = with_field(reply, "X-Content-Type-Options", "nosniff");
    let reply = with_field(reply, "Cross-Origin-Resource-Policy", "same-origin");
    with_field(reply, "Referrer-Policy", "no-referrer")
}

/// Body of an answer: bytes, or a file that is read while it is sent, so that a slow reader does
/// not keep the file in memory.
#[derive(Debug)]
pub(crate) struct ReplyBody {
    bytes: Bytes,
    file: Option<File>,
    /// Number of bytes that have not been sent yet.
    n_left: u64,
}

impl Body for ReplyBody {
    type Data = Bytes;
    type Error = std::io::Error;

    /// Returns all bytes, or the next [`CHUNK`] of the file, which is read when it is asked for.
    /// Returns `None` at the end.
    fn poll_frame(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, std::io::Error>>> {
        let mut bytes = std::mem::take(&mut self.bytes);
        let chunk = self.n_left.min(CHUNK as u64);
        if let Some(file) = self.file.as_mut().filter(|_| chunk > 0) {
            let mut part = Vec::new();
            if let Err(error) = file.take(chunk).read_to_end(&mut part) {
                return Poll::Ready(Some(Err(error)));
            }
            bytes = part.into();
        }
        self.n_left = self.n_left.saturating_sub(bytes.len() as u64);
        Poll::Ready((!bytes.is_empty()).then_some(Ok(Frame::data(bytes))))
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.n_left)
    }
}

/// Returns an answer that browsers do not cache.
pub(crate) fn uncached(content_type: &'static str, body: impl Into<Bytes>) -> Reply {
    let bytes = body.into();
    let n_left = bytes.len() as u64;
    let reply = Reply::new(ReplyBody { bytes, file: None, n_left });
    with_field(with_field(reply, "Content-Type", content_type), "Cache-Control", "no-store")
}

/// Returns an answer with a value as JSON.
pub(crate) fn json(value: &impl Serialize) -> Reply {
    uncached("application/json", json!(value).to_string())
}

/// Returns an answer with a file that does not change, so that browsers may cache it for a day.
/// Returns an error if it cannot be opened.
#[expect(clippy::disallowed_methods, reason = "a file of the gallery, and no link")]
pub(crate) fn file(content_type: &'static str, path: &Path) -> std::io::Result<Reply> {
    let file = File::open(path)?;
    let n_left = file.metadata()?.len();
    let reply = Reply::new(ReplyBody { bytes: Bytes::new(), file: Some(file), n_left });
    let reply = with_field(reply, "Content-Type", content_type);
    Ok(with_field(reply, "Cache-Control", "private, max-age=86400, immutable"))
}

/// Returns an answer that browsers cache and revalidate by its `ETag`, with the status 304 and no
/// body if the browser's copy is current.
pub(crate) fn with_etag(
    content_type: &'static str,
    body: impl Into<Bytes>,
    etag: &str,
    if_none_match: &str,
) -> Reply {
    let is_current = if_none_match == etag;
    let reply = uncached(content_type, if is_current { Bytes::new() } else { body.into() });
    let reply = with_status(reply, if is_current { 304 } else { 200 });
    with_field(with_field(reply, "Cache-Control", "no-cache"), "ETag", etag)
}

/// Returns the `ETag` of a content. 64 bits of the digest are enough to distinguish versions.
pub(crate) fn etag_of(content: &[u8]) -> String {
    format!("\"{}\"", &sha256(content)[..16])
}

/// Returns an answer with a status set.
pub(crate) fn with_status(mut reply: Reply, status: u16) -> Reply {
    *reply.status_mut() = status.try_into().expect("a status of three digits");
    reply
}

/// Returns an answer with a header field set.
pub(crate) fn with_field(mut reply: Reply, name: &'static str, value: &str) -> Reply {
    let value = HeaderValue::from_str(value).expect("a line of ASCII");
    reply.headers_mut().insert(name, value);
    reply
}

/// Returns the answer to a refused request: the message as JSON, with the status of its key, or 422
/// for a key without one.
pub(crate) fn refused(message: impl Into<Message>) -> Reply {
    let message = message.into();
    let status = Key::ALL.iter().find(|key| key.name() == message.key).map(|key| key.status());
    with_status(json(&message.json()), status.unwrap_or(422))
}

impl From<HttpError> for Reply {
    fn from(HttpError(status, why): HttpError) -> Self {
        with_status(uncached("text/plain; charset=utf-8", why), status)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_idle_connection_of_the_greediest_address_gives_way() {
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        let task = runtime.spawn(std::future::pending::<()>()).abort_handle();
        let connection = |last: u8, is_working: bool| Connection {
            peer: [10, 0, 0, last].into(),
            is_working: Arc::new(is_working.into()),
            task: task.clone(),
        };
        let hall = [(1, false), (7, true), (7, false), (2, false), (7, false)];
        let connections: Vec<_> = hall.map(|(last, is)| connection(last, is)).into();
        assert_eq!(oldest_idle(&connections), Some(2));
        assert_eq!(oldest_idle(&connections[..2]), Some(0), "the other is worked on");
        assert_eq!(oldest_idle(&connections[1..2]), None);
    }
}
