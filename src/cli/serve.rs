//! `noctograph serve` serves a page that photographs a word while somebody types or draws it.

use std::ffi::OsString;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::{Args, Parser};
use noctograph_serve::{Addresses, Program, ServerConfig, Suggestion, printed_code, work};

use super::outcome::Report;
use super::printer::line;
use super::started::{program, words};
use super::terminal::{message, print_out, warn};
use super::{CommandLine, Verb, typefaces};
use crate::error::{Error, Result};
use crate::scene::{Preset, Scene};
use crate::shoot::{Shoot, Shot};
use crate::studies::remedies_for;
use serde_json::{Value, json};

#[expect(clippy::struct_excessive_bools, reason = "flags of the command line")]
#[derive(Debug, Args)]
pub(super) struct ServeArgs {
    /// Scene that the page's controls show at the start
    #[arg(long, value_name = "SCENE")]
    scene: Option<String>,
    /// Port, or 0 for the port stored in the gallery, or else a free port
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
    /// Folder that stores the address and the visitors' entries [default: none, so that both are
    /// lost when the program ends]
    #[arg(long, value_name = "DIR")]
    gallery: Option<PathBuf>,
    /// Also serve the local network. Anyone who has the address may write, draw and send entries
    #[arg(long)]
    network: bool,
    /// Print the address of a page for a screen in a hall, which has no settings or downloads, and
    /// resets after a minute without input
    #[arg(long)]
    kiosk: bool,
    /// Show entries on the wall before they are approved
    #[arg(long)]
    open_wall: bool,
    /// Folder with the host's title and sentences (brand.toml) and logo (logo.svg)
    #[arg(long, value_name = "DIR")]
    brand: Option<PathBuf>,
    /// Folder in which scripts write their logs. The wall shows the light of these logs during the
    /// flight
    #[arg(long, value_name = "DIR")]
    flights: Option<PathBuf>,
    /// WebAssembly module, built by `src/photo_service/build`, with which visitors' browsers make
    /// their own photos
    #[arg(long, value_name = "FILE")]
    module: Option<PathBuf>,
    /// Open the page in the browser
    #[arg(long)]
    open: bool,
    /// Run the jobs that a server sends on standard input
    #[arg(long, hide = true)]
    worker: bool,
}

/// Runs the verb `serve`, which serves the page until the program ends, or works for a server.
pub(super) fn run(args: &ServeArgs) -> Result<Report> {
    let program = Program { worker, advice, typeface: typefaces::with, warn: |text| warn([text]) };
    if args.worker {
        work(program, args.scene.as_deref())?;
    } else {
        serve(args, program)?;
    }
    Ok(Report::new(String::new(), json!({})))
}

/// Checks that the scene can be flown, and serves the page. Warns if `--module` cannot be used.
fn serve(args: &ServeArgs, program: Program) -> Result<()> {
    // The page starts from this scene, and each visitor changes a copy of it.
    let named = args.scene.as_deref().unwrap_or(Preset::default().name());
    let mut scene = Scene::find(named, &[])?.scene;
    // A test word detects a scene that cannot be flown before the first visitor's photo. A typeface
    // of another script may lack its letter.
    scene.set_word("A");
    match Shoot::new(scene.clone()) {
        Ok(_) | Err(Error::Letter { .. }) => {}
        Err(error) => return Err(error),
    }
    // Photos of a scene with files are made here, because browsers cannot read its files.
    let is_self_contained =
        scene.files_mut().all(|file| file.is_empty() || !Path::new(file).is_absolute());
    let has_room = scene.expose.room_m.is_some();
    let config = ServerConfig {
        base: Scene::text_of(named)?,
        module: args.module.clone().filter(|_| is_self_contained),
        scene,
        gallery: args.gallery.clone(),
        temporary: std::env::temp_dir(),
        port: args.port,
        network: args.network,
        open_wall: args.open_wall,
        brand: args.brand.clone(),
        flights: args.flights.clone(),
    };
    if args.module.is_some() && !is_self_contained {
        warn(["the scene uses files on this machine, so the server makes all photos and ignores \
               --module"]);
    }
    noctograph_serve::serve(config, program, |addresses| announce(args, addresses, has_room))
}

/// Parses the arguments that were typed.
fn parsed_command_line() -> Option<CommandLine> {
    CommandLine::try_parse_from([OsString::from("noctograph")].into_iter().chain(words())).ok()
}

/// Returns the command that starts this program as a worker, with the same scene.
fn worker() -> std::io::Result<Command> {
    let mut command = program()?;
    command.args(["serve", "--worker"]);
    // The Python package starts its workers with a different command line.
    let Some(CommandLine { verb: Verb::Serve(args), .. }) = parsed_command_line() else {
        return Ok(command);
    };
    // The path of the scene is made absolute, because the worker may run in another folder. A name
    // that is not an existing path is that of a preset.
    if let Some(scene) = args.scene {
        let path = std::path::absolute(&scene)?;
        command.arg("--scene").arg(if path.exists() { path.into() } else { OsString::from(scene) });
    }
    Ok(command)
}

/// Returns the changes of settings that make a word more legible, as suggestions for the page.
fn advice(shot: &Shot) -> Result<Vec<Suggestion>> {
    let remedies = remedies_for(shot)?.into_iter();
    Ok(remedies.filter_map(|remedy| Suggestion::new(remedy.changes, remedy.gain)).collect())
}

/// Prints the addresses, and opens the page in a browser if `--open` is given. `has_room` is true
/// if the scene names a room. Without a room, the fence of an exported script is a guess.
fn announce(args: &ServeArgs, addresses: &Addresses, has_room: bool) -> Result<()> {
    let page = if args.kiosk { &addresses.kiosk } else { &addresses.visitors };
    if parsed_command_line().is_some_and(|typed| typed.json) {
        print_out(&format!("{}\n", object(page, addresses)))?;
    } else {
        print_out(&table(args, page, addresses, has_room))?;
    }
    if args.open {
        open(page);
    }
    Ok(())
}

/// Returns the addresses as JSON. `page` is the one to open first.
fn object(page: &str, addresses: &Addresses) -> Value {
    let [visitors, kiosk] =
        addresses.network.as_ref().map_or([None; 2], |both| both.each_ref().map(Some));
    json!({ "page": page, "network": visitors, "kiosk": kiosk, "operator": addresses.operator })
}

/// Returns the addresses as text with what each one allows. `page` is the one to open first, and
/// `has_room` is true if the scene names a room. If stdout is a terminal, a QR code of the network
/// address follows.
fn table(args: &ServeArgs, page: &str, addresses: &Addresses, has_room: bool) -> String {
    // The network address is followed by a line that says what it allows.
    let mut text = line("page", page);
    if args.network && addresses.network.is_none() {
        text += &line("network", "none: connect this machine to a network, and start again");
    }
    if let Some([visitors, kiosk]) = &addresses.network {
        if args.kiosk {
            text += &line("kiosk", kiosk);
        }
        text += &line("network", visitors);
        text += &line("", "anyone who has this address may write, draw and send entries");
        if !has_room {
            let hint = "not known, so the scripts' fence is a guess: pass a scene with a room as \
                        --scene, such as the one that `preview WORD --room WxDxH` writes";
            text += &line("room", hint);
        }
    }
    text += &line("operator", &addresses.operator);
    let wall = if args.open_wall { "what is sent" } else { "entries that the operator approved" };
    text += &line("wall", &format!("shows {wall}"));
    text += &line("", "Ctrl-C ends it");
    if let Some([visitors, kiosk]) =
        addresses.network.as_ref().filter(|_| std::io::stdout().is_terminal())
    {
        // The printed QR code is meant for tablets. Phones scan the code on the wall.
        text += &printed_code(if args.kiosk { kiosk } else { visitors });
    }
    text
}

/// Opens an address in the default browser of the desktop, or prints a note if there is none.
fn open(address: &str) {
    let opener = match std::env::consts::OS {
        "macos" => "open",
        "windows" => "explorer",
        _ => "xdg-open",
    };
    let mut command = Command::new(opener);
    let quiet = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if quiet.arg(address).spawn().is_err() {
        message("note: ", &format!("{opener} is not installed: open the address in a browser"));
    }
}
