//! The address of the page, which tablets and printed codes keep: with a gallery its secret parts
//! and its port are kept there, and survive a restart.

use std::io::Write;
use std::net::{IpAddr, Ipv4Addr, TcpListener, UdpSocket};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{Error, Result};
use noctograph_core::files::Limit;

const FILE: &str = "address.json";
const LIMIT: Limit = Limit { bytes: 4 << 10, what: "an address", hint: "remove it for a new one" };

/// Secret parts of the addresses, and their port.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Address {
    /// Of visitors.
    pub(super) visitors: String,
    /// Of the operator.
    pub(super) operator: String,
    pub(super) port: u16,
}

/// A name that nobody guesses: 128 bits of the system's random numbers.
pub(super) fn secret() -> Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|error| Error::Infeasible {
        what: format!("the system gives no random numbers: {error}"),
        hint: "try again".into(),
    })?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

impl Address {
    /// The address that a gallery keeps, or a new one, with the listener on its port. `port` is 0
    /// for the one kept, or any that is free.
    pub(super) fn open(
        gallery: Option<&Path>,
        port: u16,
        ip: Ipv4Addr,
    ) -> Result<(Self, TcpListener)> {
        let path = gallery.map(|folder| folder.join(FILE)).filter(|path| path.is_file());
        let read = |path: PathBuf| -> Result<Self> {
            serde_json::from_str(&LIMIT.read_text(&path)?).map_err(|error| {
                Error::input(path.display(), error, "an address of this program", LIMIT.hint)
            })
        };
        let kept = path.map(read).transpose()?;
        let wanted = match (port, &kept) {
            (0, Some(kept)) => kept.port,
            (port, _) => port,
        };
        let listener = TcpListener::bind((ip, wanted))
            .or_else(|error| if port == 0 { TcpListener::bind((ip, 0)) } else { Err(error) });
        let refused = |source: std::io::Error| {
            let hint = "choose another port, or 0 for one that is free";
            Error::input("--port", format!("{port} ({source})"), "a port that is free", hint)
        };
        let listener = listener.map_err(refused)?;
        let port = listener.local_addr().map_err(refused)?.port();
        let address = match kept.clone() {
            Some(kept) => Self { port, ..kept },
            None => Self { visitors: secret()?, operator: secret()?, port },
        };
        if let Some(folder) = gallery.filter(|_| kept.as_ref() != Some(&address)) {
            address.keep(folder)?;
        }
        Ok((address, listener))
    }

    /// Writes it where only the host's user can read it.
    fn keep(&self, folder: &Path) -> Result<()> {
        let path = folder.join(FILE);
        let failed = |source| Error::write(&path, source);
        // A temporary file of this crate can be read by its owner alone.
        let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
        let text = serde_json::to_string_pretty(self).expect("it is plain data") + "\n";
        file.write_all(text.as_bytes()).and_then(|()| file.as_file().sync_all()).map_err(failed)?;
        file.persist(&path).map(drop).map_err(|error| failed(error.error))
    }

    /// The page of visitors, seen from a machine.
    pub(super) fn of_visitors(&self, ip: IpAddr) -> String {
        format!("http://{ip}:{}/k/{}/", self.port, self.visitors)
    }

    /// The operator's page, on this machine.
    pub(super) fn of_operator(&self) -> String {
        format!("http://{}:{}/o/{}/", Ipv4Addr::LOCALHOST, self.port, self.operator)
    }

    /// The page of an entry.
    pub(super) fn of_entry(&self, ip: IpAddr, id: &str) -> String {
        format!("http://{ip}:{}/e/{id}/", self.port)
    }
}

/// The address of this machine in its network. Nothing is sent: the socket only looks up the route
/// to an address that is kept free for examples (RFC 5737).
pub(super) fn own_ip() -> Option<IpAddr> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
    socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9)).ok()?;
    Some(socket.local_addr().ok()?.ip())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gallery_keeps_its_address_for_its_owner_alone() {
        let folder = tempfile::tempdir().unwrap();
        let open = |gallery| Address::open(gallery, 0, Ipv4Addr::LOCALHOST).unwrap();
        let (first, listener) = open(Some(folder.path()));
        drop(listener);
        let (again, listener) = open(Some(folder.path()));
        assert_eq!(again, first);
        let (other, _) = open(Some(folder.path()));
        assert_ne!(other.port, first.port, "it is taken: {listener:?}");
        assert_eq!(other.visitors, first.visitors);
        assert_ne!(open(None).0.visitors, first.visitors);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = folder.path().join(FILE).metadata().unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o600);
        }
    }
}
