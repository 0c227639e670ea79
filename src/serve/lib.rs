//! Serve: a page on which a word becomes a photo while a visitor types or draws it, and from which
//! it is sent to be flown.
//!
//! A connection arrives in `http`, and its request is admitted by `access` and answered by `routes`
//! or by the `operator`. Visitors' browsers make photos with a `module`. A `worker` makes them here
//! for other browsers, for the host and for entries, which are kept in `entries` of a `gallery`.
//! The page itself is the folder `page`.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]

use std::net::{Ipv4Addr, TcpListener};
use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;

use access::Access;
use address::{Address, own_ip};
use brand::Brand;
use entries::Entries;
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

/// Most threads that wait for the disk.
const DISK_THREADS: usize = 8;

/// Functions of the program that the server calls.
#[derive(Clone, Copy, Debug)]
pub struct Program {
    /// Starts the program as a worker, in which [`work`] runs.
    pub worker: fn() -> std::io::Result<Command>,
    /// Changes that help a word that does not read.
    pub advice: fn(&Shot) -> Result<Vec<Suggestion>>,
    /// File of a typeface of this machine with all of some letters.
    pub typeface: fn(&[char]) -> Option<PathBuf>,
    /// Prints a warning for the host.
    pub warn: fn(&str),
}

/// Options of the server.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// The scene that the controls begin with.
    pub scene: Scene,
    /// The text of its file, for visitors' browsers, which lay their settings over it.
    pub base: String,
    /// The page's WebAssembly module. Without it all photos are made here.
    pub module: Option<PathBuf>,
    /// Folder that keeps the address and the entries. Without it they end with the program.
    pub gallery: Option<PathBuf>,
    /// Folder for temporary files.
    pub temporary: PathBuf,
    /// Port. 0 is that of the gallery's address, or any free one.
    pub port: u16,
    /// True if other machines are served.
    pub network: bool,
    /// True if the wall shows entries that nobody has approved yet.
    pub open_wall: bool,
    /// Folder of the host's words and logo.
    pub brand: Option<PathBuf>,
}

/// Addresses of the pages on this machine, and of those that its network sees.
#[derive(Clone, Debug)]
pub struct Addresses {
    /// Of visitors, here.
    pub visitors: String,
    /// Of a kiosk, here.
    pub kiosk: String,
    /// Of the operator, who sits here.
    pub operator: String,
    /// Of visitors and of kiosks in the network. `None` without a network.
    pub network: Option<[String; 2]>,
}

/// Serves the page until the program ends. `announce` gets the addresses.
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
    // Everything that can be refused comes before the first connection.
    let module = config.module.as_deref().map(Module::read).transpose()?;
    let brand = config.brand.as_deref().map(Brand::read).transpose()?.unwrap_or_default();
    let temporary = &config.temporary;
    let (scratch, _lock) =
        folder_in(temporary).map_err(|source| Error::write(temporary, source))?;
    let unkept = scratch.path().join("gallery");
    let gallery = config.gallery.as_deref();
    let entries = Entries::open(gallery.unwrap_or(&unkept), config.open_wall, program.warn)?;
    let ip = if config.network { Ipv4Addr::UNSPECIFIED } else { Ipv4Addr::LOCALHOST };
    let (address, listener) = Address::open(gallery, config.port, ip)?;
    let outside = config.network.then(own_ip).flatten();
    announce(&Addresses {
        visitors: address.of_visitors(Ipv4Addr::LOCALHOST.into()),
        kiosk: address.of_kiosk(Ipv4Addr::LOCALHOST.into()),
        operator: address.of_operator(),
        network: outside.map(|ip| [address.of_visitors(ip), address.of_kiosk(ip)]),
    })?;
    let server = Server {
        access: Access { address, network: config.network },
        brand,
        scene: config.scene,
        base: config.base,
        module,
        outside,
        boot: address::secret()?,
        visitors: Maker::new(program, scratch.path()),
        host: Maker::new(program, scratch.path()),
        operator: Maker::new(program, scratch.path()),
        entries,
        mark: page::mark(),
    };
    run(listener, server)
}

/// Answers all connections on one thread, with a few others that wait for the disk.
fn run(listener: TcpListener, server: Server) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .max_blocking_threads(DISK_THREADS)
        .build()
        .map_err(no_thread)?;
    runtime.block_on(async {
        listener.set_nonblocking(true).map_err(no_thread)?;
        let listener = tokio::net::TcpListener::from_std(listener).map_err(no_thread)?;
        let server = Arc::new(server);
        match http::accept(listener, move |arrival| server.clone().answer(arrival)).await {}
    })
}

fn no_thread(error: impl std::fmt::Display) -> Error {
    let hint = "allow more processes (ulimit -u)";
    Error::infeasible(format!("no thread can be started: {error}"), hint)
}
