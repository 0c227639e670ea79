//! Serve: a page on which a word becomes a photo while one types or draws it, and from which it is
//! sent to be flown.
//!
//! A connection comes in by `http`, and its request is admitted by `access`; `routes` answer it,
//! and those of the `operator`. Visitors' browsers make photos by a `module`; for browsers that
//! cannot, for the host and for what is sent, a `worker` makes them here. What is sent is kept in
//! `entries` of a `gallery`. The page itself is the folder `page`.

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

/// Most threads for what waits for the disk.
const DISK_THREADS: usize = 8;

/// What the server needs of the program around it.
#[derive(Clone, Copy, Debug)]
pub struct Program {
    /// Starts the program as a worker, in which [`work`] runs.
    pub worker: fn() -> std::io::Result<Command>,
    /// Changes that help where a word does not read.
    pub advice: fn(&Shot) -> Result<Vec<Suggestion>>,
    /// File of a typeface of this machine that has all of some letters.
    pub typeface: fn(&[char]) -> Option<PathBuf>,
    /// Prints a warning for the host.
    pub warn: fn(&str),
}

/// How the page is served.
#[derive(Clone, Debug)]
pub struct ServerConfig {
    /// The scene that the controls begin with.
    pub scene: Scene,
    /// The text of its file, which visitors' browsers lay their settings over.
    pub base: String,
    /// The page's WebAssembly module; `None`: all photos are made here.
    pub module: Option<PathBuf>,
    /// Folder that keeps the address and what visitors send; `None`: as long as the program runs.
    pub gallery: Option<PathBuf>,
    /// Folder for what is made.
    pub temporary: PathBuf,
    /// Port; 0: that of the gallery's address, or one that is free.
    pub port: u16,
    /// Whether other machines are served.
    pub network: bool,
    /// Whether the wall shows what nobody has approved yet.
    pub open_wall: bool,
    /// Folder of the host's words and logo.
    pub brand: Option<PathBuf>,
}

/// Addresses of the pages on this machine, and of those that its network sees.
#[derive(Clone, Debug)]
pub struct Addresses {
    /// Of visitors, here.
    pub visitors: String,
    /// Of a screen that stands in the hall, here.
    pub kiosk: String,
    /// Of the operator, who sits here.
    pub operator: String,
    /// Of visitors and of kiosks in the network; `None`: it is not served, or there is none.
    pub network: Option<[String; 2]>,
}

/// Serves the page until the program is ended; `announce` is told the addresses.
///
/// # Errors
///
/// [`Error::Input`] for a gallery, an address, a brand or a port that cannot be used;
/// [`Error::Io`] where nothing can be written; what `announce` returns.
pub fn serve(
    config: ServerConfig,
    program: Program,
    announce: impl FnOnce(&Addresses) -> Result<()>,
) -> Result<()> {
    let module = config.module.as_deref().map(Module::read).transpose()?;
    let brand = config.brand.as_deref().map(Brand::read).transpose()?.unwrap_or_default();
    let temporary = &config.temporary;
    let (scratch, _lock) =
        folder_in(temporary).map_err(|source| Error::write(temporary, source))?;
    let nowhere = scratch.path().join("gallery");
    let gallery = config.gallery.as_deref();
    let entries = Entries::open(gallery.unwrap_or(&nowhere), config.open_wall, program.warn)?;
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

/// Answers all connections on one thread, and what waits for the disk on a few others.
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
