//! The addresses of the pages. A gallery stores their secrets and their port, so that tablets and
//! printed codes still work after a restart.

use std::io::Write;
use std::net::{IpAddr, Ipv4Addr, TcpListener, UdpSocket};
use std::path::Path;

use serde::{Deserialize, Serialize};

use noctograph_core::error::{Error, Result};
use noctograph_core::files::Limit;

/// Number of random bytes of a secret.
const SECRET_BYTES: usize = 16;
/// Name of the file in a gallery.
const FILE: &str = "address.json";
const LIMIT: Limit =
    Limit { bytes: 4 << 10, what: "an address", hint: "remove it to create a new one" };

/// Secrets in the addresses, and their port.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Address {
    pub(crate) visitors: String,
    #[serde(default)]
    pub(crate) kiosk: String,
    pub(crate) operator: String,
    pub(crate) port: u16,
}

/// Returns a name that cannot be guessed, 128 random bits from the system in hexadecimal.
pub(crate) fn secret() -> Result<String> {
    let mut bytes = [0; SECRET_BYTES];
    getrandom::fill(&mut bytes).map_err(|error| {
        Error::infeasible(format!("the system provides no random numbers: {error}"), "try again")
    })?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// True if a name has the form of [`secret`], which is 32 hexadecimal digits in lower case.
pub(crate) fn is_secret(name: &str) -> bool {
    name.len() == 2 * SECRET_BYTES
        && name.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
}

impl Address {
    /// Reads the address that the gallery stores, or creates one, and listens on its port. If
    /// `port` is 0, the port is the stored one or any free one. Creates secrets that are missing,
    /// and writes the address to the gallery if it changed. Without a gallery, nothing is stored.
    pub(crate) fn open(
        gallery: Option<&Path>,
        port: u16,
        ip: Ipv4Addr,
    ) -> Result<(Self, TcpListener)> {
        let path = gallery.map(|folder| folder.join(FILE)).filter(|path| path.is_file());
        let stored = path.as_deref().map(Self::read).transpose()?;
        let listener = listen(ip, port, stored.as_ref().map_or(0, |stored| stored.port));
        let with_port = listener.and_then(|listener| Ok((listener.local_addr()?.port(), listener)));
        let (open_port, listener) = with_port.map_err(|source| {
            let hint = "choose another port, or 0 for one that is free";
            Error::input("--port", format!("{port} ({source})"), "a port that is free", hint)
        })?;
        let address = Self::complete(stored.as_ref(), open_port)?;
        if let Some(folder) = gallery.filter(|_| stored.as_ref() != Some(&address)) {
            address.write(folder)?;
        }
        Ok((address, listener))
    }

    /// Returns an address with the stored secrets, and with new ones in place of those that are
    /// missing. Galleries of earlier versions contain no secret for kiosks.
    fn complete(stored: Option<&Self>, port: u16) -> Result<Self> {
        let stored_or_new = |part: fn(&Self) -> &String| {
            let known = stored.map(part).filter(|secret| !secret.is_empty());
            known.cloned().map_or_else(secret, Ok)
        };
        Ok(Self {
            visitors: stored_or_new(|stored| &stored.visitors)?,
            kiosk: stored_or_new(|stored| &stored.kiosk)?,
            operator: stored_or_new(|stored| &stored.operator)?,
            port,
        })
    }

    /// Reads the address of a gallery. Returns [`Error::Input`] for another file, and for a secret
    /// that anybody could guess.
    fn read(path: &Path) -> Result<Self> {
        let text = LIMIT.read_text(path)?;
        let wrong = match serde_json::from_str::<Self>(&text) {
            Err(error) => error.to_string(),
            Ok(address) => match address.weak_secret() {
                None => return Ok(address),
                Some(weak) => format!("{weak:?}"),
            },
        };
        let wanted = "an address of this program, whose secrets have 32 digits from 0 to f";
        Err(Error::input(path.display(), wrong, wanted, LIMIT.hint))
    }

    /// Returns a secret that can be guessed, or `None` if all are strong. An empty secret for
    /// kiosks, as in galleries of earlier versions, is not checked.
    fn weak_secret(&self) -> Option<&String> {
        let kiosk = Some(&self.kiosk).filter(|kiosk| !kiosk.is_empty());
        let mut secrets = [&self.visitors, &self.operator].into_iter().chain(kiosk);
        secrets.find(|secret| !is_secret(secret))
    }

    /// Writes the address to a file that only the host's user can read.
    fn write(&self, folder: &Path) -> Result<()> {
        let path = folder.join(FILE);
        let text = serde_json::to_string_pretty(self).expect("it is plain data") + "\n";
        // `tempfile` creates files that only their owner can read.
        let written = tempfile::NamedTempFile::new_in(folder).and_then(|mut file| {
            file.write_all(text.as_bytes())?;
            file.as_file().sync_all()?;
            Ok(file.persist(&path)?)
        });
        written.map(drop).map_err(|source| Error::write(&path, source))
    }

    /// Returns the address of the visitors' page at an IP address of this machine.
    pub(crate) fn visitors_url(&self, ip: IpAddr) -> String {
        format!("http://{ip}:{}/k/{}/", self.port, self.visitors)
    }

    /// Returns the address of the kiosk's page at an IP address of this machine.
    pub(crate) fn kiosk_url(&self, ip: IpAddr) -> String {
        format!("http://{ip}:{}/k/{}/", self.port, self.kiosk)
    }

    /// Returns the address of the wall at an IP address of this machine.
    pub(crate) fn wall_url(&self, ip: IpAddr) -> String {
        self.visitors_url(ip) + "wall.html"
    }

    /// Returns the address of the operator's page, which is served only to this machine.
    pub(crate) fn operator_url(&self) -> String {
        format!("http://{}:{}/o/{}/", Ipv4Addr::LOCALHOST, self.port, self.operator)
    }

    /// Returns the address of an entry's page at an IP address of this machine.
    pub(crate) fn entry_url(&self, ip: IpAddr, id: &str) -> String {
        format!("http://{ip}:{}/e/{id}/", self.port)
    }
}

/// Listens on a port. If `port` is 0, it is the stored port, or any free port if another program
/// uses the stored one.
fn listen(ip: Ipv4Addr, port: u16, stored: u16) -> std::io::Result<TcpListener> {
    match port {
        0 => TcpListener::bind((ip, stored)).or_else(|_in_use| TcpListener::bind((ip, 0))),
        port => TcpListener::bind((ip, port)),
    }
}

/// Returns this machine's IP address in its network, or `None` without a network. Connecting a UDP
/// socket sends nothing, but looks up the route, here to an address that is reserved for examples
/// (RFC 5737).
pub(crate) fn own_ip() -> Option<IpAddr> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
    const EXAMPLE: (Ipv4Addr, u16) = (Ipv4Addr::new(192, 0, 2, 1), 9);
    socket.connect(EXAMPLE).ok()?;
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
        assert_ne!(first.kiosk, first.visitors);
        for weak in ["", "../../etc", "0123456789ABCDEF0123456789ABCDEF", &format!("{:31}\n", 1)] {
            let text =
                format!(r#"{{"visitors": {weak:?}, "operator": "{}", "port": 1}}"#, first.operator);
            let folder = tempfile::tempdir().unwrap();
            std::fs::write(folder.path().join(FILE), text).unwrap();
            let refused = Address::open(Some(folder.path()), 0, Ipv4Addr::LOCALHOST).unwrap_err();
            assert!(refused.to_string().contains("32 digits"), "{weak:?}: {refused}");
        }
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = folder.path().join(FILE).metadata().unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o600);
        }
    }
}
