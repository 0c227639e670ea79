//! `noctograph serve`: a page on which a word becomes a photo while one types or draws it, and from
//! which it is sent to be flown.
//!
//! A connection comes in through the [`door`], its request by [`http`], and is admitted by the
//! [`guard`]; [`routes`] answer it. What has to be made is a [`wish`], waits in a [`queue`], and is
//! made by a [`worker`] in its [`studio`]; large photos are [`kept`] for a while, and
//! [`entries`] for good. The page itself is the folder `page`.

use std::ffi::OsString;
use std::io::IsTerminal;
use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use super::{
    Args, CommandLine, Error, Output, Report, Result, Value, Verb, export, json, line, message,
    no_thread, print, refused, shell_word, show, typefaces, warn,
};
use address::{Address, own_ip};
use block::BlockList;
use brand::Brand;
use entries::Entries;
use guard::Guard;
use noctograph_core::files::folder_in;
use queue::Queue;
use routes::{Hall, Server};
use studio::{JPEG, PNG, REPLAY, SCENE};
use wish::preview_args;
use worker::Lane;

mod address;
mod block;
mod brand;
mod door;
mod entries;
mod guard;
mod http;
mod kept;
mod page;
mod qr;
mod queue;
mod replay;
mod routes;
mod said;
mod studio;
mod time;
mod wish;
mod worker;

/// Files of a large photo that an entry keeps.
const KEPT: [&str; 4] = [PNG, JPEG, REPLAY, SCENE];

/// Longest time of a photo while one types, and of a large one: a word that does not read is flown
/// some thirty times for advice.
const LIVE_PATIENCE: Duration = Duration::from_secs(10);
const LARGE_PATIENCE: Duration = Duration::from_secs(60);

/// Time between two looks for entries whose days are over.
const SWEEP: Duration = Duration::from_secs(600);

#[expect(clippy::struct_excessive_bools, reason = "flags of the command line")]
#[derive(Debug, Args)]
pub(super) struct ServeArgs {
    /// Scene that the page begins with
    #[arg(long, value_name = "SCENE")]
    scene: Option<OsString>,
    /// Port; 0 takes that of the gallery's address, or one that is free
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
    /// Folder that keeps the address and what visitors send [default: until the program ends]
    #[arg(long, value_name = "DIR")]
    gallery: Option<PathBuf>,
    /// Serve the local network too: whoever has the address may write, draw and send
    #[arg(long)]
    network: bool,
    /// For a screen in a hall: no settings, no downloads, back to the start after a minute
    #[arg(long)]
    kiosk: bool,
    /// With --network, show on the wall what nobody has approved yet
    #[arg(long)]
    open_wall: bool,
    /// Folder with the host's title, colors and sentences: brand.toml, logo.svg
    #[arg(long, value_name = "DIR")]
    brand: Option<PathBuf>,
    /// List of words that are not flown, one a line
    #[arg(long, value_name = "FILE")]
    block: Option<PathBuf>,
    /// Remove entries after some days [default: never]
    #[arg(long, value_name = "DAYS")]
    keep: Option<f64>,
    /// Open the page in the browser
    #[arg(long)]
    open: bool,
    /// Serve the page's files from a folder, for work on them
    #[arg(long, value_name = "DIR", hide = true)]
    page_from: Option<PathBuf>,
    /// Make what a server asks for, on standard input
    #[arg(long, hide = true)]
    worker: bool,
    /// A worker that lets others go first
    #[arg(long, hide = true)]
    patient: bool,
}

pub(super) fn run(args: &ServeArgs) -> Result<Report> {
    let scene = args.scene.iter().flat_map(|scene| ["--scene".into(), scene.clone()]);
    let base: Vec<OsString> = scene.collect();
    match args.worker {
        true => worker::run(base, args.patient)?,
        false => serve(args, &base)?,
    }
    Ok(Report::empty())
}

fn serve(args: &ServeArgs, base: &[OsString]) -> Result<()> {
    if let Some(days) = args.keep {
        crate::error::within("--keep", days, 0.0, 36_500.0)?;
    }
    // A scene that cannot be flown is refused now, not by every visitor's photo. Its typeface may
    // lack our letter: visitors write others with it.
    let warming = preview_args([base, &["--word=A".into()]].concat())?;
    let scene = match warming.shoot() {
        Err(Error::Letter { .. }) => warming.scene()?,
        shoot => shoot?.scene,
    };
    let brand = args.brand.as_deref().map(Brand::read).transpose()?.unwrap_or_default();
    let block = args.block.as_deref().map(BlockList::read).transpose()?.unwrap_or_default();
    let temporary = std::env::temp_dir();
    let failed = |source| Error::write(&temporary, source);
    let (scratch, _lock) = folder_in(&temporary).map_err(failed)?;
    let nowhere = scratch.path().join("gallery");
    let gallery = args.gallery.as_deref();
    let entries = Entries::open(gallery.unwrap_or(&nowhere), !args.network || args.open_wall)?;
    let ip = if args.network { Ipv4Addr::UNSPECIFIED } else { Ipv4Addr::LOCALHOST };
    let (address, listener) = Address::open(gallery, args.port, ip)?;
    let outside = args.network.then(own_ip).flatten();
    announce(args, &address, outside)?;
    let [live, large] = [(); 2].map(|()| Arc::new(Queue::default()));
    // Two photos at a time: while one is planned, the other is exposed.
    let lanes = [&live, &live, &large].map(|queue| Lane {
        queue: queue.clone(),
        base: base.to_owned(),
        scratch: scratch.path().to_owned(),
        patience: if Arc::ptr_eq(queue, &large) { LARGE_PATIENCE } else { LIVE_PATIENCE },
        is_patient: Arc::ptr_eq(queue, &large),
    });
    for lane in lanes {
        std::thread::Builder::new().spawn(move || lane.work()).map_err(no_thread)?;
    }
    let hall = Hall {
        kiosk: args.kiosk,
        brand,
        block,
        scene,
        page_from: args.page_from.clone(),
        ip: outside.unwrap_or(IpAddr::V4(Ipv4Addr::LOCALHOST)),
        boot: address::secret()?,
    };
    let guard = Guard { address, network: args.network };
    let server = Arc::new(Server::new(guard, hall, live, large, entries));
    if let Some(days) = args.keep {
        let server = server.clone();
        let sweeping = std::thread::Builder::new().spawn(move || {
            loop {
                server.entries.sweep(days);
                std::thread::sleep(SWEEP);
            }
        });
        sweeping.map_err(no_thread)?;
    }
    // A connection that failed before it was taken is of no concern.
    for stream in listener.incoming().flatten() {
        server.clone().take(stream);
    }
    Ok(())
}

/// Prints the addresses, and opens the page if asked to.
fn announce(args: &ServeArgs, address: &Address, outside: Option<IpAddr>) -> Result<()> {
    let own = address.of_visitors(Ipv4Addr::LOCALHOST.into());
    let mut text = line("page", &own);
    if let Some(ip) = outside {
        text += &line("network", &address.of_visitors(ip));
        text += &line("", "whoever has this address may write, draw and send");
    }
    text += &line("operator", &address.of_operator());
    text += &line("", "Ctrl-C ends it");
    if let Some(ip) = outside.filter(|_| std::io::stdout().is_terminal()) {
        text += &qr::printed(&address.of_visitors(ip));
    }
    print(&text)?;
    if args.open {
        open(&own);
    }
    Ok(())
}

fn open(address: &str) {
    let opener = match std::env::consts::OS {
        "macos" => "open",
        "windows" => "explorer",
        _ => "xdg-open",
    };
    let mut command = Command::new(opener);
    let quiet = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if quiet.arg(address).spawn().is_err() {
        message("note: ", &format!("no {opener} here: open the address in a browser"));
    }
}
