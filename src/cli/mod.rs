//! The command line, with arguments, progress bars, tables and exit codes. Each verb has a file.
//!
//! The program writes results to stdout, and progress, warnings and errors to stderr. The exit code
//! is 0 for success (and a legible word), 1 for a word that is not legible, an unsafe flight or a
//! refusal, and 2 for an error. Only this module mentions flags.

use std::ffi::OsString;
use std::io::Write;
use std::num::NonZero;
use std::sync::LazyLock;

use clap::error::{ContextKind, ContextValue};
use clap::{Command, CommandFactory, FromArgMatches, Parser, Subcommand};

use serde_json::{Value, json};

use crate::error::{Error, Result};
use noctograph_core::digest::sha256;
use terminal::{escaped, message, print_out, printable, quietly, take_warnings, warn};

mod advice;
mod check;
mod compare;
mod compare_photo;
mod coverage;
mod device;
mod evening;
mod export;
mod expose;
mod findings;
mod flags;
mod flight_flags;
mod flown;
mod fly;
mod follow;
mod gains;
mod generate;
mod hold;
mod identify;
mod import;
mod letters;
mod locate;
mod locate_region;
mod meter;
mod names;
mod notices;
mod outcome;
mod output;
mod picture;
mod plan;
mod preview;
mod printer;
mod progress;
mod rank;
mod read;
mod report;
mod scene;
mod score;
mod serve;
mod show;
mod spread;
mod started;
mod studies;
mod terminal;
mod tune;
mod typefaces;

pub use self::show::verdict_table;
pub use self::studies::ranking_report;
pub use self::tune::tuning_report;
pub use outcome::Report;
pub use started::{starts_as, typed_as};

/// Version with the commit and a digest of the source, so that builds can be distinguished.
static VERSION: LazyLock<String> = LazyLock::new(|| {
    let commit = env!("NOCTOGRAPH_COMMIT");
    let commit = if commit.is_empty() { String::new() } else { format!("commit {commit}, ") };
    format!("{} ({commit}source {})", env!("CARGO_PKG_VERSION"), crate::studies::SOURCE)
});

/// Shows the photograph of a drone's light painting before the flight, and judges whether the word
/// is legible.
#[derive(Debug, Parser)]
#[command(
    version = VERSION.as_str(),
    max_term_width = 80,
    arg_required_else_help = true,
    after_help = "Exit codes: 0 success, 1 not legible, not safe to fly or refused, 2 error."
)]
struct CommandLine {
    #[command(subcommand)]
    verb: Verb,
    /// Print a JSON object instead of a table
    #[arg(long, global = true)]
    json: bool,
    /// Number of worker threads, or 0 for one per processor core
    #[arg(long, global = true, value_name = "N", default_value_t = 0)]
    threads: usize,
}

/// Declares the verbs in the order of the help, each with examples. A test runs the examples in
/// this order in a single folder (`tests/it/examples.rs`). Each verb is a module with its arguments
/// and a function `run`.
macro_rules! verbs {
    ($($group:literal {
        $($(#[$meta:meta])* $verb:ident($module:ident::$args:ident) $examples:literal,)+
    })+) => {
        #[derive(Debug, Subcommand)]
        enum Verb {
            $($($(#[$meta])* $verb($module::$args),)+)+
        }

        /// Names of the verbs with their examples, grouped by purpose.
        const GROUPS: &[(&str, &[(&str, &str)])] =
            &[$(($group, &[$((stringify!($module), $examples)),+])),+];

        /// Runs a verb with its arguments, and returns its report.
        fn run(verb: &Verb) -> Result<Report> {
            match verb {
                $($(Verb::$verb(args) => $module::run(args),)+)+
            }
        }
    };
}

verbs! {
    "Begin with" {
        /// Preview the photograph of a word, and say whether it is legible
        Preview(preview::PreviewArgs)
            "noctograph preview HELLO\n\
             noctograph preview NOOR --set camera.iso=200 --seed 7 -o noor",
        /// Serve the page, which shows photos while you type or draw
        Serve(serve::ServeArgs) "noctograph serve --open",
        /// Check that a word or a plan is safe to fly and shows in the photo
        Check(check::CheckArgs) "noctograph check HELLO --room 4x6x2.5",
        /// Export a plan for drones: scripts, trajectories, shows, gains
        Export(export::ExportArgs)
            "noctograph export HELLO --room 4x6x2.5 --to cflib -o HELLO.py",
        /// Render the long-exposure photograph of flights (PNG, EXR)
        Expose(expose::ExposeArgs)
            "noctograph expose noctograph-out/flight.csv --word HELLO -o photo.png",
        /// Judge whether a photograph's word is legible, and why not
        Score(score::ScoreArgs) "noctograph score photo.png HELLO -o overlay.png",
    }
    "Stage by stage" {
        /// Plan the flight of a word: setpoints and light commands (CSV)
        Plan(plan::PlanArgs) "noctograph plan NOOR -o plan.csv",
        /// Simulate the flight of a plan (CSV)
        Fly(fly::FlyArgs) "noctograph fly plan.csv --seed 1 -o flight.csv",
        /// Read the word in a photograph (blind recognition)
        Read(read::ReadArgs) "noctograph read photo.png",
    }
    "Before a flight" {
        /// Meter the exposure of the lamps, and recommend camera settings
        Meter(meter::MeterArgs) "noctograph meter HELLO --set camera.body=galaxy-s24",
        /// Map how accurately stations or anchors can locate the drone
        Coverage(coverage::CoverageArgs) "noctograph coverage HELLO --room 4x6x2.5",
    }
    "After a flight" {
        /// Convert the log of a real flight (CSV)
        Import(import::ImportArgs) "noctograph import log.csv --word NOOR -o flown.csv",
        /// Compare two flights: errors, lag, drift and plots
        Compare(compare::CompareArgs) "noctograph compare flight.csv flown.csv --align flown",
        /// Overlay a render on a real photograph, and show the difference
        ComparePhoto(compare_photo::ComparePhotoArgs) "noctograph compare-photo photo.png real.jpg",
        /// Identify thrust, center of mass and noise from a flight log
        Identify(identify::IdentifyArgs) "noctograph identify log.csv",
        /// Locate drones from logs of ultra-wideband ranges
        Locate(locate::LocateArgs) "noctograph locate ranges.csv --anchors anchors.yaml",
    }
    "Controllers" {
        /// Print controller gains, poles and stability margins
        Gains(gains::GainsArgs) "noctograph gains --scene team",
        /// Rank scenes by the probability that their words are read
        Rank(rank::RankArgs) "noctograph rank team tuned --words NO:4",
        /// Tune gains, observer and speed for legible words
        Tune(tune::TuneArgs)
            "noctograph tune cf21 --words I:1 --budget 40 --test-words O --test-seeds 1",
        /// Simulate an altitude hold with three imperfect sensors
        Hold(hold::HoldArgs) "noctograph hold --scenario calm --runs 4",
    }
    "Files" {
        /// Print a scene file: every key with its meaning and unit
        Scene(scene::SceneArgs) "noctograph scene -o my.toml",
        /// Report a verb's output folder as one page (HTML)
        Report(report::ReportArgs) "noctograph report noctograph-rank",
        /// Generate shell completions and man pages
        Generate(generate::GenerateArgs)
            "noctograph generate man\nnoctograph generate completions bash -o noctograph.bash",
        /// Print the licenses of the built-in packages (also --notices)
        #[command(long_flag = "notices")]
        Notices(notices::NoticesArgs) "noctograph notices",
    }
}

/// Returns the clap command with a help text that groups the verbs, which clap does not support.
/// Only the verbs of the first group are explained, so that the help fits on one screen. The help
/// of each verb ends with its examples.
fn command() -> Command {
    let mut command = CommandLine::command();
    let mut verbs = String::new();
    for (index, (title, members)) in GROUPS.iter().enumerate() {
        let names: Vec<String> =
            members.iter().map(|(module, _)| module.replace('_', "-")).collect();
        let is_first = index == 0;
        verbs += &if is_first {
            format!("\n{title}:\n")
        } else {
            format!("  {title:17}{}\n", names.join(", "))
        };
        for (name, (_, examples)) in names.iter().zip(*members) {
            let verb = command.find_subcommand(name).expect("verbs are named as their modules");
            if is_first {
                verbs += &format!("  {name:9}{}\n", verb.get_about().unwrap_or_default());
            }
            // The examples precede what a verb's own attribute adds to its help.
            let more = verb.get_after_help().map_or(String::new(), |more| format!("\n\n{more}"));
            let examples = examples.replace('\n', "\n  ");
            let help = format!("Example:\n  {examples}{more}");
            command = command.mut_subcommand(name, |verb| verb.after_help(help));
        }
        if is_first {
            verbs += "\nFurther verbs, which `noctograph VERB --help` explains:\n";
        }
    }
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n{verbs}\nOptions:\n{{options}}\
         {{after-help}}"
    ))
}

/// Runs the command that was typed, and returns its exit code. It is 101 after a panic, as for any
/// Rust program.
pub fn main() -> u8 {
    // The stack of the main thread may be too small to parse the arguments (`ulimit -s`). If no
    // thread can be started, the main thread does the work.
    match std::thread::Builder::new().stack_size(STACK).spawn(run_typed) {
        Ok(main) => main.join().unwrap_or(101),
        Err(_) => run_typed(),
    }
}

/// Parses and runs the command that was typed, prints its report or error, and returns its exit
/// code: 0 for success, 1 for a report that does not pass, 2 for an error.
fn run_typed() -> u8 {
    // On a small stack, the parser would crash without a message.
    if std::thread::current().name() == Some("main")
        && let Some(bytes) = main_stack().filter(|bytes| *bytes < STACK)
    {
        let kib = bytes >> 10;
        message("error: ", &format!("cannot start a thread, and the stack has only {kib} KiB"));
        message("hint: ", "allow more processes (ulimit -u) or a larger stack (ulimit -s 8192)");
        return 2;
    }
    // clap's matches are also kept, because the advice on an error depends on the verb's flags.
    let command = command();
    let typed = command
        .clone()
        .try_get_matches_from([OsString::from("noctograph")].into_iter().chain(started::words()))
        .and_then(|matches| Ok((CommandLine::from_arg_matches(&matches)?, matches)));
    let (args, matches) = match typed {
        Ok(typed) => typed,
        Err(error) => return usage(&error),
    };
    let reader = if args.json { Reader::Program } else { Reader::Person };
    let printed = on_threads(args.threads, || run_warned(&args.verb, reader))
        .and_then(|report| print_report(&report, args.json).map(|()| report.passed));
    match printed {
        Ok(passed) => u8::from(!passed),
        Err(error) => {
            let (mut verb, mut matches) = (&command, &matches);
            while let Some((name, below)) = matches.subcommand() {
                (verb, matches) = (verb.find_subcommand(name).expect("it was matched"), below);
            }
            failed(&error, &advice::advice(&error, verb))
        }
    }
}

/// Prints a report as text, or as JSON if `is_json` is true. Control characters are escaped.
fn print_report(report: &Report, is_json: bool) -> Result<()> {
    let text = if is_json {
        escaped(&format!("{}\n", report.json), |c| format!("\\u{c:04x}"))
    } else {
        printable(&report.text)
    };
    if report.aside {
        // As for every message, a failure to print on stderr is ignored.
        let _ = std::io::stderr().write_all(text.as_bytes());
        return Ok(());
    }
    print_out(&text)
}

/// Runs a command for a calling program, and returns its report instead of printing it.
///
/// # Errors
///
/// [`Error::Input`] for arguments that are refused, and the errors of the verb.
pub fn report_of(words: &[String]) -> Result<Report> {
    // For a calling program, help and version are results, and refused arguments are an error.
    let words = std::iter::once("noctograph").chain(words.iter().map(String::as_str));
    let args = command().try_get_matches_from(words);
    match args.and_then(|matches| CommandLine::from_arg_matches(&matches)) {
        Ok(args) => on_threads(args.threads, || run_quietly(&args.verb)),
        Err(error) if !error.use_stderr() => {
            Ok(Report::new(error.render().to_string(), Value::Null))
        }
        Err(error) => Err(input_error(&error)),
    }
}

/// Returns the error for refused arguments, with the valid values and the most similar argument or
/// value, if clap names them.
fn input_error(error: &clap::Error) -> Error {
    let context = |kind| match error.get(kind)? {
        ContextValue::String(name) => Some(name.clone()),
        ContextValue::Strings(names) => Some(names.join(", ")),
        _ => None,
    };
    let values = context(ContextKind::ValidValue).map(|values| format!("one of {values}"));
    let near = context(ContextKind::SuggestedArg).or(context(ContextKind::SuggestedValue));
    let wanted = values.unwrap_or_else(|| "those of the command".to_owned());
    let hint = near.map_or("the verb with --help lists them".into(), |near| near + "?");
    Error::input("options", refused(error), wanted, hint)
}

/// Returns the first line of clap's reason for refusing arguments, without the word `found` at its
/// end, because an input error begins with that word.
fn refused(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let first = text.lines().next().unwrap_or_default().trim_start_matches("error: ");
    first.trim_end_matches(" found").to_owned()
}

/// Prints an error, its hint and further advice. Returns the exit code of an error, 2.
fn failed(error: &Error, advice: &[String]) -> u8 {
    message("error: ", &error.to_string());
    message("hint: ", error.hint());
    advice.iter().for_each(|advice| message("hint: ", advice));
    2
}

/// Prints the requested help, or the error in the arguments. Returns the exit code.
fn usage(error: &clap::Error) -> u8 {
    let text = error.render().to_string();
    if !error.use_stderr() {
        return print_out(&text).map_or_else(|error| failed(&error, &[]), |()| 0);
    }
    // clap prefixes a similar argument with `tip`, and ends its message with a line about --help.
    let text = text.replace("\n  tip: ", "\nhint: ");
    let (text, has_more) = match text.split_once("\nFor more information") {
        Some((text, _)) => (text, true),
        None => (&*text, false),
    };
    let text = printable(text.trim_end());
    let _ = std::io::stderr().write_all(format!("{text}\n").as_bytes());
    if has_more && !text.contains("\nhint: ") {
        message("hint: ", "--help lists the arguments and their values");
    }
    2
}

/// Maximum number of worker threads. No machine has as many cores, and each thread takes memory for
/// its stack.
const MAX_THREADS: usize = 1024;

/// Stack size of a thread in bytes, which is the usual size of a main thread's stack on Linux. The
/// main thread itself may have only a few pages (`ulimit -s`).
pub const STACK: usize = 8 << 20;

/// Returns the size limit of the main thread's stack in bytes. Returns `None` if the size is
/// unlimited, and on other systems than Linux.
#[expect(clippy::disallowed_methods, reason = "a file of the kernel")]
fn main_stack() -> Option<usize> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|line| line.strip_prefix("Max stack size"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Runs `work` on the given number of threads. 0 stands for one thread per processor core, or fewer
/// if the system refuses to start that many, which a note says. If the system starts none, the
/// current thread runs `work`. Returns [`Error::Input`] for too many threads, and
/// [`Error::Infeasible`] if the system does not start a number of threads that was typed.
fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    if threads > MAX_THREADS {
        let wanted = format!("at most {MAX_THREADS}");
        return Err(Error::input("threads", threads, wanted, "0 starts one thread per core"));
    }
    let pool = |n: usize| rayon::ThreadPoolBuilder::new().num_threads(n).stack_size(STACK).build();
    if threads > 0 {
        // A number that the user typed is never reduced.
        let pool = pool(threads).map_err(|error| {
            Error::infeasible(
                format!("cannot start {threads} threads: {error}"),
                "ask for fewer threads",
            )
        })?;
        return pool.install(work);
    }
    // The default number is halved until the system starts all threads.
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get).min(MAX_THREADS);
    let mut fewer = std::iter::successors(Some(cores), |n| Some(n / 2)).take_while(|n| *n > 0);
    if let Some(pool) = fewer.find_map(|n| pool(n).ok()) {
        let n = pool.current_num_threads();
        if n < cores {
            message("note: ", &format!("the system allows only {n} of {cores} threads"));
        }
        return pool.install(work);
    }
    message("note: ", "the system allows no more threads, so a single thread does all the work");
    let present = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread();
    present.build_global().map_err(|error| {
        let hint = "allow more processes (ulimit -u)";
        Error::infeasible(format!("cannot start a thread: {error}"), hint)
    })?;
    work()
}

/// Reader of a report.
#[derive(Clone, Copy, PartialEq)]
enum Reader {
    /// A person, who reads the text.
    Person,
    /// A program, which reads the JSON object.
    Program,
}

/// Runs a verb whose messages are kept for the warnings in its JSON object, which the caller
/// displays. If the verb fails, the messages so far are printed as warnings.
fn run_quietly(verb: &Verb) -> Result<Report> {
    let report = quietly(|| run_warned(verb, Reader::Program));
    warn(take_warnings());
    report
}

/// Runs a verb, and adds the warnings that the verb printed to its JSON object. The digest of the
/// photo is added only for a program, because it takes time.
fn run_warned(verb: &Verb, reader: Reader) -> Result<Report> {
    // Warnings of an earlier command in this process do not belong to this one.
    take_warnings();
    let mut report = run(verb)?;
    if let Some(photo) = report.photo.take().filter(|_| reader == Reader::Program) {
        report.value("photo_sha256", sha256(&photo));
    }
    let mut warned = take_warnings();
    if let Some(object) = report.json.as_object_mut().filter(|_| !warned.is_empty())
        && let Some(known) = object.entry("warnings").or_insert_with(|| json!([])).as_array_mut()
    {
        // Warnings that the object already contains, without their file names, are not added again.
        warned.retain(|text| !known.iter().filter_map(Value::as_str).any(|s| text.ends_with(s)));
        known.extend(warned.into_iter().map(Value::from));
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_verb_is_in_the_help_and_every_flag_has_help() {
        command().debug_assert();
        let help = command().render_help().to_string();
        let words: Vec<&str> = help.split([' ', ',', '\n']).collect();
        for verb in command().get_subcommands().filter(|verb| verb.get_name() != "help") {
            let name = verb.get_name();
            assert!(words.contains(&name), "{name}");
            let example = verb.clone().get_after_help().map(ToString::to_string);
            let first = format!("Example:\n  noctograph {name}");
            assert!(example.is_some_and(|text| text.starts_with(&first)), "{name}");
            for flag in verb.get_arguments() {
                assert!(flag.get_help().is_some(), "{name} {}", flag.get_id());
            }
        }
    }

    #[test]
    fn the_help_fits_a_screen() {
        let lines = command().render_help().to_string().lines().count();
        assert!(lines <= 30, "{lines} lines");
    }

    #[test]
    fn only_verbs_that_draw_noise_take_a_seed() {
        let takes_seed = |verb: &&Command| verb.get_arguments().any(|a| a.get_id() == "seed");
        let verbs = command();
        let verbs = verbs.get_subcommands().flat_map(|verb| {
            std::iter::once(verb).chain(verb.get_subcommands()).collect::<Vec<_>>()
        });
        let names: Vec<&str> = verbs.filter(takes_seed).map(Command::get_name).collect();
        // `scene` accepts a seed because it writes one, and `export` because it simulates the
        // flights that `check` judges.
        let noisy = "preview check export expose fly meter rank tune hold scene";
        assert_eq!(names.join(" "), noisy, "a plan has no noise");
    }

    /// Returns the verb and the flags of every command of the program in a document.
    fn commands(text: &str) -> Vec<(String, Vec<String>)> {
        let text = text.replace("\\\n", " ");
        let mut examples = Vec::new();
        for (begin, _) in text.match_indices("noctograph ") {
            // A command within a sentence is enclosed in backquotes, and may be wrapped.
            let ends: &[char] =
                if text[..begin].ends_with('`') { &['`'] } else { &['`', '\n', '#'] };
            let rest = &text[begin + "noctograph ".len()..];
            let mut words = rest.split(ends).next().unwrap_or(rest).split_whitespace();
            let verb = words.next().unwrap_or_default().to_owned();
            let flags = words.filter(|word| word.starts_with("--") && word.len() > 2);
            let name = |flag: &str| flag[2..].split('=').next().unwrap_or_default().to_owned();
            examples.push((verb, flags.map(name).collect()));
        }
        examples
    }

    #[test]
    fn every_flag_of_the_documentation_is_in_the_help() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let folders = ["docs", "docs/tutorials", "docs/how-to", "docs/reference"];
        let pages = folders.iter().flat_map(|folder| std::fs::read_dir(root.join(folder)).unwrap());
        let pages = pages.map(|entry| entry.unwrap().path());
        let pages = pages.filter(|page| page.extension().is_some_and(|end| end == "md"));
        let (mut n, mut wrong) = (0, Vec::new());
        for page in pages.chain([root.join("README.md")]) {
            for (verb, flags) in commands(&std::fs::read_to_string(&page).unwrap()) {
                let (page, command) = (page.display(), command());
                let Some(command) = command.find_subcommand(&verb) else { continue };
                let below = command.get_subcommands().flat_map(Command::get_arguments);
                let known: Vec<&str> = command
                    .get_arguments()
                    .chain(below)
                    .filter_map(clap::Arg::get_long)
                    .chain(["json", "threads", "help", "version"])
                    .collect();
                n += flags.len();
                let unknown = flags.iter().filter(|flag| !known.contains(&flag.as_str()));
                wrong.extend(unknown.map(|flag| format!("{page}: {verb} --{flag}")));
            }
        }
        assert!(n > 40 && wrong.is_empty(), "{n} flags: {}", wrong.join("\n"));
    }
}
