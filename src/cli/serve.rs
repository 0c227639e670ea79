//! `noctograph serve`: a page on which a word becomes a photo while one types or draws it.

use std::ffi::OsString;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::Parser;
use noctograph_serve::{
    Addresses, PreparedScene, Program, ServerConfig, Suggestion, bring_files, printed_code, work,
};

use super::preview::PreviewArgs;
use super::{
    Args, CommandLine, Error, Report, Result, Verb, export, json, line, message, print_out,
    refused, typefaces, warn,
};
use crate::shoot::Shot;
use crate::studies::remedies_for;

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
    /// Print the page for a screen in a hall: no settings, no downloads, back to the start after a
    /// minute
    #[arg(long)]
    kiosk: bool,
    /// With --network, show on the wall what nobody has approved yet
    #[arg(long)]
    open_wall: bool,
    /// Folder with the host's title, sentences and logo: brand.toml, logo.svg
    #[arg(long, value_name = "DIR")]
    brand: Option<PathBuf>,
    /// Open the page in the browser
    #[arg(long)]
    open: bool,
    /// Make what a server asks for, on standard input
    #[arg(long, hide = true)]
    worker: bool,
}

pub(super) fn run(args: &ServeArgs) -> Result<Report> {
    let program = Program {
        worker,
        prepare,
        advice,
        script,
        typeface: typefaces::with,
        warn: |text| warn([text]),
    };
    match args.worker {
        true => work(program)?,
        false => serve(args, program)?,
    }
    Ok(Report::new(String::new(), json!({})))
}

fn serve(args: &ServeArgs, program: Program) -> Result<()> {
    // A scene that cannot be flown is refused now, not by every visitor's photo. Its typeface may
    // lack our letter: visitors write others with it.
    let warming = preview_args(&["--word=A".into()])?;
    let scene = match warming.shoot() {
        Err(Error::Letter { .. }) => warming.scene()?,
        shoot => shoot?.scene,
    };
    let config = ServerConfig {
        scene,
        gallery: args.gallery.clone(),
        temporary: std::env::temp_dir(),
        port: args.port,
        network: args.network,
        open_wall: args.open_wall,
        brand: args.brand.clone(),
    };
    noctograph_serve::serve(config, program, |addresses| announce(args, addresses))
}

/// This program as a worker, with the scene that the page begins with.
fn worker() -> std::io::Result<Command> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args(["serve", "--worker"]).args(scene_flag());
    Ok(command)
}

/// The scene that was typed, as a flag that means the same from every folder.
fn scene_flag() -> Vec<OsString> {
    let Ok(CommandLine { verb: Verb::Serve(args), .. }) = CommandLine::try_parse() else {
        return Vec::new();
    };
    let absolute = |scene: OsString| match std::path::absolute(&scene) {
        Ok(path) if path.exists() => path.into(),
        _ => scene,
    };
    args.scene.into_iter().flat_map(|scene| ["--scene".into(), absolute(scene)]).collect()
}

/// The arguments of a verb, parsed as the command line's.
fn parsed(verb: &[&str], arguments: &[OsString]) -> Result<Verb> {
    let verb = std::iter::once(&"noctograph").chain(verb).map(OsString::from);
    let typed = verb.chain(scene_flag()).chain(arguments.iter().cloned());
    CommandLine::try_parse_from(typed).map(|parsed| parsed.verb).map_err(|error| {
        let wanted = "values that the controls offer";
        Error::input("settings", refused(&error), wanted, "reload the page")
    })
}

fn preview_args(arguments: &[OsString]) -> Result<PreviewArgs> {
    match parsed(&["preview"], arguments)? {
        Verb::Preview(args) => Ok(args),
        _ => unreachable!("the verb is preview"),
    }
}

fn prepare(arguments: &[OsString]) -> Result<PreparedScene> {
    let args = preview_args(arguments)?;
    let scene = args.ready(bring_files)?;
    Ok(PreparedScene { profile: args.profile(&scene), scene })
}

fn advice(shot: &Shot) -> Result<Vec<Suggestion>> {
    Ok(remedies_for(shot)?.into_iter().map(|remedy| (remedy.changes, remedy.gain)).collect())
}

/// Writes the scripts of a flight into a folder, or returns why it is not safe.
fn script(arguments: &[OsString], folder: &Path) -> Result<Option<String>> {
    let out = [OsString::from("-o"), folder.into()];
    let verb = parsed(&["export", "--to", "cflib"], &[arguments, &out].concat())?;
    let Verb::Export(args) = verb else { unreachable!("the verb is export") };
    Ok(export::run(&args)?.json["stops"].as_str().map(str::to_owned))
}

/// Prints the addresses, and opens the page if asked to.
fn announce(args: &ServeArgs, addresses: &Addresses) -> Result<()> {
    let page = if args.kiosk { &addresses.kiosk } else { &addresses.visitors };
    let mut text = line("page", page);
    if let Some([visitors, kiosk]) = &addresses.network {
        if args.kiosk {
            text += &line("kiosk", kiosk);
        }
        text += &line("network", visitors);
        text += &line("", "whoever has this address may write, draw and send");
    }
    text += &line("operator", &addresses.operator);
    text += &line("", "Ctrl-C ends it");
    if let Some([visitors, _]) =
        addresses.network.as_ref().filter(|_| std::io::stdout().is_terminal())
    {
        text += &printed_code(visitors);
    }
    print_out(&text)?;
    if args.open {
        open(page);
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
