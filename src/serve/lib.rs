//! Serves a page that shows the photo of a word while a visitor types or draws it, and from which
//! the visitor sends it to be flown.
//!
//! `http` accepts a connection, `access` admits its request, and `routes` or `operator` answers it.
//! Visitors' browsers make photos with a `module`. On this machine, each `worker` makes photos for
//! other browsers, for the host or for `entries`, which a `gallery` stores. `flights` follows the
//! logs of scripts during flights. The page itself is in the folder `page`.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

use std::net::{IpAddr, Ipv4Addr, TcpListener};
use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;

use access::Access;
use address::{Address, own_ip};
use brand::Brand;
use entries::Entries;
use flights::Flights;
use module::Module;
use noctograph_core::error::{Error, Result};
use noctograph_core::files::folder_in;
pub use noctograph_photo_service::answer::Suggestion;
use noctograph_pipeline::scene::Scene;
use noctograph_pipeline::shoot::Shot;
use routes::Server;
use worker::Maker;

mod access;
mod address;
mod brand;
mod entries;
mod flights;
mod gallery;
mod http;
mod module;
mod operator;
mod page;
mod qr;
mod routes;
mod timestamp;
mod worker;

pub use qr::printed as printed_code;
pub use worker::work;

/// Maximum number of threads that wait for the disk.
const DISK_THREADS: usize = 8;

/// Functions that the program provides for the server.
#[derive(Clone, Copy, Debug)]
pub struct Program {
    /// Starts the program as a worker, in which [`work`] runs.
    pub worker: fn() -> std::io::Result<Command>,
    /// Finds changes that make an unreadable word easier to read.
    pub advice: fn(&Shot) -> Result<Vec<Suggestion>>,
    /// Finds a typeface file on this machine that contains all the given characters.
    pub typeface: fn(&[char]) -> Option<PathBuf>,
    /// Prints a warning for the host.
    pub warn: fn(&str),
}

/// Options of the server.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// Scene that the page's controls show at the start.
    pub scene: Scene,
    /// Text of the scene's file, to which visitors' browsers apply their settings.
    pub base: String,
    /// Path of the page's WebAssembly module. If it is `None`, this machine makes all photos.
    pub module: Option<PathBuf>,
    /// Folder that stores the address and the entries. If it is `None`, they are lost when the
    /// program ends.
    pub gallery: Option<PathBuf>,
    /// Folder for temporary files.
    pub temporary: PathBuf,
    /// Port, or 0 for the port of the gallery's address or else any free port.
    pub port: u16,
    /// True if requests from other machines are served.
    pub network: bool,
    /// True if the wall shows entries that nobody has approved yet.
    pub open_wall: bool,
    /// Folder of the host's words and logo.
    pub brand: Option<PathBuf>,
    /// Folder in which scripts write the logs of flights. If it is `None`, no flight is followed.
    pub flights: Option<PathBuf>,
}

/// Addresses of the pages, for browsers on this machine and in its network.
#[derive(Clone, Debug)]
pub struct Addresses {
    /// Address of the visitors' page on this machine.
    pub visitors: String,
    /// Address of the kiosk's page on this machine.
    pub kiosk: String,
    /// Address of the operator's page on this machine.
    pub operator: String,
    /// Addresses of the visitors' and the kiosk's page in the network, if other machines are
    /// served.
    pub network: Option<[String; 2]>,
}

impl Addresses {
    /// Returns the addresses of the pages. `network_ip` is this machine's IP address in its
    /// network, if other machines are served.
    fn new(address: &Address, network_ip: Option<IpAddr>) -> Self {
        Self {
            visitors: address.visitors_url(Ipv4Addr::LOCALHOST.into()),
            kiosk: address.kiosk_url(Ipv4Addr::LOCALHOST.into()),
            operator: address.operator_url(),
            network: network_ip.map(|ip| [address.visitors_url(ip), address.kiosk_url(ip)]),
        }
    }
}

/// Serves the page until the program ends. `announce` is called with the addresses before the first
/// request is answered. Creates the gallery if it does not exist, and a folder for the workers'
/// files.
///
/// # Errors
///
/// [`Error::Input`] for a gallery, an address, a brand or a port that cannot be used, [`Error::Io`]
/// if nothing can be written, and the errors of `announce`.
pub fn serve(
    config: ServerConfig,
    program: Program,
    announce: impl FnOnce(&Addresses) -> Result<()>,
) -> Result<()> {
    // Everything that can fail is done before the first connection.
    let module = config.module.as_deref().map(Module::read).transpose()?;
    let brand = config.brand.as_deref().map(Brand::read).transpose()?.unwrap_or_default();
    let flights = config.flights.as_deref().map(Flights::new).transpose()?;
    let temporary = &config.temporary;
    let (scratch, _lock) =
        folder_in(temporary).map_err(|source| Error::write(temporary, source))?;
    let temporary_gallery = scratch.path().join("gallery");
    let gallery = config.gallery.as_deref();
    let folder = gallery.unwrap_or(&temporary_gallery);
    let entries = Entries::open(folder, config.open_wall, program.warn)?;
    let ip = if config.network { Ipv4Addr::UNSPECIFIED } else { Ipv4Addr::LOCALHOST };
    let (address, listener) = Address::open(gallery, config.port, ip)?;
    let network_ip = config.network.then(own_ip).flatten();
    announce(&Addresses::new(&address, network_ip))?;
    let server = Server {
        access: Access { address, network: config.network },
        brand,
        scene: config.scene,
        base: config.base,
        module,
        network_ip,
        boot: address::secret()?,
        visitors: Maker::new(program, scratch.path()),
        host: Maker::new(program, scratch.path()),
        operator: Maker::new(program, scratch.path()),
        flights: Maker::frugal(program, scratch.path()),
        entries,
        etag: page::etag(),
    };
    run(listener, server, flights)
}

/// Answers all connections on one thread, follows flights on another, and uses up to
/// [`DISK_THREADS`] more for the disk. Returns only if no thread can be started.
fn run(listener: TcpListener, server: Server, flights: Option<Flights>) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .max_blocking_threads(DISK_THREADS)
        .build()
        .map_err(no_thread)?;
    runtime.block_on(async {
        listener.set_nonblocking(true).map_err(no_thread)?;
        let listener = tokio::net::TcpListener::from_std(listener).map_err(no_thread)?;
        let server = Arc::new(server);
        if let Some(flights) = flights {
            let server = server.clone();
            let followed = std::thread::Builder::new().spawn(move || flights.follow(&server));
            followed.map_err(no_thread)?;
        }
        match http::accept(listener, move |arrival| server.clone().answer(arrival)).await {}
    })
}

/// Returns the error for a thread that cannot be started.
fn no_thread(error: impl std::fmt::Display) -> Error {
    let hint = "allow more processes (ulimit -u)";
    Error::infeasible(format!("cannot start a thread: {error}"), hint)
}
