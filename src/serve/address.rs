//! The address of the page, which tablets and printed codes keep: with a gallery its secret parts
//! and its port are kept there, and survive a restart.

use std::io::Write;
use std::net::{IpAddr, Ipv4Addr, TcpListener, UdpSocket};
use std::path::Path;

use serde::{Deserialize, Serialize};

use noctograph_core::error::{Error, Result};
use noctograph_core::files::Limit;

const FILE: &str = "address.json";
const LIMIT: Limit = Limit { bytes: 4 << 10, what: "an address", hint: "remove it for a new one" };

/// Secret parts of the addresses, and their port.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Address {
    /// Of visitors.
    pub(crate) visitors: String,
    /// Of screens that stand in the hall.
    #[serde(default)]
    pub(crate) kiosk: String,
    /// Of the operator.
    pub(crate) operator: String,
    pub(crate) port: u16,
}

/// A name that nobody guesses: 128 bits of the system's random numbers.
pub(crate) fn secret() -> Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|error| {
        Error::infeasible(format!("the system gives no random numbers: {error}"), "try again")
    })?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Whether a name is one that [`secret`] makes.
pub(crate) fn is_secret(name: &str) -> bool {
    name.len() == 32 && name.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
}

impl Address {
    /// The address that a gallery keeps, or a new one, with the listener on its port. `port` is 0
    /// for the one kept, or any that is free.
    pub(crate) fn open(
        gallery: Option<&Path>,
        port: u16,
        ip: Ipv4Addr,
    ) -> Result<(Self, TcpListener)> {
        let path = gallery.map(|folder| folder.join(FILE)).filter(|path| path.is_file());
        let kept = path.as_deref().map(Self::read).transpose()?;
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
        let mut address = match kept.clone() {
            Some(kept) => Self { port, ..kept },
            None => Self { visitors: secret()?, kiosk: String::new(), operator: secret()?, port },
        };
        // Galleries of before have none.
        if address.kiosk.is_empty() {
            address.kiosk = secret()?;
        }
        if let Some(folder) = gallery.filter(|_| kept.as_ref() != Some(&address)) {
            address.keep(folder)?;
        }
        Ok((address, listener))
    }

    fn read(path: &Path) -> Result<Self> {
        let wanted = "an address of this program: 32 digits from 0 to f a secret";
        let refused = |actual: String| Error::input(path.display(), actual, wanted, LIMIT.hint);
        let address: Self = serde_json::from_str(&LIMIT.read_text(path)?)
            .map_err(|error| refused(error.to_string()))?;
        let Self { visitors, kiosk, operator, .. } = &address;
        let is_weak = |name: &&&String| !is_secret(name);
        match [visitors, operator].iter().find(is_weak) {
            Some(secret) => Err(refused(format!("{secret:?}"))),
            None if !kiosk.is_empty() && !is_secret(kiosk) => Err(refused(format!("{kiosk:?}"))),
            None => Ok(address),
        }
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
    pub(crate) fn of_visitors(&self, ip: IpAddr) -> String {
        format!("http://{ip}:{}/k/{}/", self.port, self.visitors)
    }

    /// The page of a kiosk, seen from a machine.
    pub(crate) fn of_kiosk(&self, ip: IpAddr) -> String {
        format!("http://{ip}:{}/k/{}/", self.port, self.kiosk)
    }

    /// The wall, seen from a machine.
    pub(crate) fn of_wall(&self, ip: IpAddr) -> String {
        self.of_visitors(ip) + "wall.html"
    }

    /// The operator's page, on this machine.
    pub(crate) fn of_operator(&self) -> String {
        format!("http://{}:{}/o/{}/", Ipv4Addr::LOCALHOST, self.port, self.operator)
    }

    /// The page of an entry.
    pub(crate) fn of_entry(&self, ip: IpAddr, id: &str) -> String {
        format!("http://{ip}:{}/e/{id}/", self.port)
    }
}

/// The address of this machine in its network. Nothing is sent: the socket only looks up the route
/// to an address that is kept free for examples (RFC 5737).
pub(crate) fn own_ip() -> Option<IpAddr> {
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
