//! Places for connections: as many as a hall needs, and none that a silent one can keep.
//!
//! A connection whose request is being made keeps its place. Of the others, which are read from,
//! written to, or wait for news, the oldest gives way to a new one where all places are taken: a
//! stranger who opens many connections and says nothing locks nobody out.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Most connections at a time: forty browsers with six each.
const MAX_CONNECTIONS: usize = 256;

/// The places.
#[derive(Debug, Default)]
pub(super) struct Door {
    /// Those that are taken, the oldest first.
    places: Mutex<Vec<Place>>,
    next: AtomicU64,
}

#[derive(Debug)]
struct Place {
    number: u64,
    stream: TcpStream,
    is_working: bool,
}

/// A place that is taken until this is dropped.
#[derive(Debug)]
pub(super) struct Taken {
    door: Arc<Door>,
    number: u64,
}

impl Door {
    /// Takes a place for a connection; refuses it where all places are working.
    pub(super) fn enter(self: &Arc<Self>, stream: &TcpStream) -> Option<Taken> {
        let entering = stream.try_clone();
        let mut places = self.places();
        let is_full = places.len() >= MAX_CONNECTIONS;
        let (Ok(entering), true) = (entering, !is_full || give_way(&mut places)) else {
            drop(places);
            refuse(stream);
            return None;
        };
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        places.push(Place { number, stream: entering, is_working: false });
        Some(Taken { door: self.clone(), number })
    }

    fn places(&self) -> MutexGuard<'_, Vec<Place>> {
        self.places.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Closes the oldest connection that is not working; `false` where there is none.
fn give_way(places: &mut Vec<Place>) -> bool {
    let oldest = places.iter().position(|place| !place.is_working);
    oldest.map(|at| places.remove(at).stream.shutdown(Shutdown::Both)).is_some()
}

impl Taken {
    /// Keeps the place while a request is made.
    pub(super) fn working<T>(&self, work: impl FnOnce() -> T) -> T {
        self.set(true);
        let made = work();
        self.set(false);
        made
    }

    fn set(&self, is_working: bool) {
        let mut places = self.door.places();
        if let Some(place) = places.iter_mut().find(|place| place.number == self.number) {
            place.is_working = is_working;
        }
    }
}

impl Drop for Taken {
    fn drop(&mut self) {
        self.door.places().retain(|place| place.number != self.number);
    }
}

/// Refuses a connection without a thread for it, and without waiting for its request.
fn refuse(mut stream: &TcpStream) {
    let _ = stream.set_nonblocking(true);
    // What has come is taken, or else the answer would be lost with it.
    let _ = stream.read(&mut [0; 8192]);
    let _ = stream.write_all(
        b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 2\r\nContent-Length: 0\r\nConnection: \
          close\r\n\r\n",
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    #[test]
    fn the_oldest_that_is_not_working_gives_way() {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let address = listener.local_addr().unwrap();
        let door = Arc::new(Door::default());
        let mut clients = Vec::new();
        let mut enter = || {
            clients.push(TcpStream::connect(address).unwrap());
            door.enter(&listener.accept().unwrap().0)
        };
        let taken: Vec<Taken> = (0..MAX_CONNECTIONS).map(|_| enter().unwrap()).collect();
        taken[0].set(true);
        let late = enter().expect("the second gives way");
        taken[2..].iter().chain([&late]).for_each(|taken| taken.set(true));
        assert!(enter().is_none(), "all are working");
        drop((taken, late));
        assert!(enter().is_some(), "places are given back");
        // Who gave way is told so, and who works is not.
        clients[1].set_read_timeout(Some(std::time::Duration::from_secs(5))).unwrap();
        assert_eq!(clients[1].read(&mut [0]).unwrap(), 0);
    }
}
