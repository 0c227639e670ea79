//! The command line: arguments, progress, tables and exit codes. One file per verb.
//!
//! Results go to stdout; progress, warnings and errors go to stderr. Exit codes: 0 success (and
//! legible), 1 not legible or not safe to fly, 2 error. Only this room knows the names of flags.

use std::io::Write;
use std::process::ExitCode;

use clap::{Command, CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::error::{Error, Result};
use report::{Outcome, Report, wrapped};

mod advice;
mod check;
mod compare;
mod compare_photo;
mod coverage;
mod coverage_map;
mod expose;
mod findings;
mod flags;
mod fly;
mod gains;
mod generate;
mod hold;
mod identify;
mod import;
mod learn;
mod meter;
mod names;
mod output;
mod plan;
mod preview;
mod progress;
mod rank;
mod read;
mod report;
mod robustness;
mod scene;
mod score;
mod show;
mod specimen;
mod square_on;
mod studies;
mod sweep;
mod tune;

/// Shows the photograph of a drone's light painting before the flight, and says whether it reads.
#[derive(Debug, Parser)]
#[command(
    version,
    max_term_width = 80,
    arg_required_else_help = true,
    after_help = "Begin with: noctograph preview NOOR\n\nExit codes: 0 success (and legible), 1 \
                  not legible or not safe to fly, 2 error."
)]
struct Args {
    #[command(subcommand)]
    verb: Verb,
    /// Print one JSON object instead of a table
    #[arg(long, global = true)]
    json: bool,
    /// Worker threads; 0: one for each processor core
    #[arg(long, global = true, value_name = "N", default_value_t = 0)]
    threads: usize,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Preview the photograph of a word, and say whether it reads
    Preview(preview::PreviewArgs),
    /// Plan the flight of a word: setpoints and light commands (CSV)
    Plan(plan::PlanArgs),
    /// Simulate the flight of a plan (CSV)
    Fly(fly::FlyArgs),
    /// Expose flights: their long-exposure photograph (PNG, EXR)
    Expose(expose::ExposeArgs),
    /// Judge whether a photograph's word is legible, and why not
    Score(score::ScoreArgs),
    /// Read the word in a photograph (blind recognition)
    Read(read::ReadArgs),
    /// Check that a word or a plan is safe to fly and will show
    Check(check::CheckArgs),
    /// Meter the lamps: stops over saturation, and the right settings
    Meter(meter::MeterArgs),
    /// Map where Lighthouse stations see the drone, and how well
    Coverage(coverage::CoverageArgs),
    /// Convert the log of a real flight (CSV)
    Import(import::ImportArgs),
    /// Compare two flights: errors, lag, drift and plots
    Compare(compare::CompareArgs),
    /// Lay a render over a real photograph, and show the difference
    ComparePhoto(compare_photo::ComparePhotoArgs),
    /// Identify thrust, center of mass and noise from a flight log
    Identify(identify::IdentifyArgs),
    /// Print controller gains, poles and stability margins
    Gains(gains::GainsArgs),
    /// Rank scenes by the probability that their words are read
    Rank(rank::RankArgs),
    /// Tune gains, observer and speed for legible words
    Tune(tune::TuneArgs),
    /// Learn a word's setpoints and light schedule from its flights
    Learn(learn::LearnArgs),
    /// Find which disturbance makes a word illegible first
    Robustness(robustness::RobustnessArgs),
    /// Split a ranking's flights over many processes or machines
    #[command(subcommand)]
    Sweep(sweep::SweepVerb),
    /// Hold an altitude on three imperfect sensors: figures and plots
    Hold(hold::HoldArgs),
    /// Print a scene file: every key with its meaning and unit
    Scene(scene::SceneArgs),
    /// Draw a font's characters: order and direction of strokes
    Specimen(specimen::SpecimenArgs),
    /// Generate shell completions or man pages
    #[command(hide = true)]
    Generate(generate::GenerateArgs),
}

/// The verbs by what people do with them, in the order of the help.
const GROUPS: [(&str, &[&str]); 7] = [
    ("See it", &["preview"]),
    ("Stage by stage", &["plan", "fly", "expose", "score"]),
    ("Read a photo", &["read"]),
    ("Before a flight", &["check", "meter", "coverage"]),
    ("After a flight", &["import", "compare", "compare-photo", "identify"]),
    ("Choose a controller", &["gains", "rank", "tune", "learn", "robustness", "sweep", "hold"]),
    ("Show", &["scene", "specimen"]),
];

/// The command with its verbs in groups, which clap does not have.
fn command() -> Command {
    let command = Args::command();
    let mut verbs = String::new();
    for (title, names) in GROUPS {
        verbs += &format!("\n{title}:\n");
        for name in names {
            let about = command.find_subcommand(name).and_then(Command::get_about);
            verbs += &format!("  {name:15}{}\n", about.unwrap_or_default());
        }
    }
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n{verbs}\nOptions:\n{{options}}\
         {{after-help}}"
    ))
}

/// Runs the command that was typed.
#[must_use]
pub fn main() -> ExitCode {
    let command = command();
    let matches = command.clone().get_matches();
    let args = Args::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let done = on_threads(args.threads, || run(&args.verb)).and_then(|report| {
        let json = args.json.then(|| format!("{}\n", report.json));
        print(json.as_ref().unwrap_or(&report.text))?;
        Ok(report.outcome)
    });
    match done {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::NotLegible | Outcome::NotSafe) => ExitCode::from(1),
        Err(error) => {
            tell("error: ", &error.to_string());
            tell("hint: ", error.hint());
            let (mut verb, mut matches) = (&command, &matches);
            while let Some((name, below)) = matches.subcommand() {
                (verb, matches) = (verb.find_subcommand(name).expect("it was matched"), below);
            }
            for advice in advice::advice(&error, verb) {
                tell("hint: ", &advice);
            }
            ExitCode::from(2)
        }
    }
}

fn run(verb: &Verb) -> Result<Report> {
    match verb {
        Verb::Preview(args) => preview::run(args),
        Verb::Plan(args) => plan::run(args),
        Verb::Fly(args) => fly::run(args),
        Verb::Expose(args) => expose::run(args),
        Verb::Score(args) => score::run(args),
        Verb::Read(args) => read::run(args),
        Verb::Check(args) => check::run(args),
        Verb::Meter(args) => meter::run(args),
        Verb::Coverage(args) => coverage::run(args),
        Verb::Import(args) => import::run(args),
        Verb::Compare(args) => compare::run(args),
        Verb::ComparePhoto(args) => compare_photo::run(args),
        Verb::Identify(args) => identify::run(args),
        Verb::Gains(args) => gains::run(args),
        Verb::Rank(args) => rank::run(args),
        Verb::Tune(args) => tune::run(args),
        Verb::Learn(args) => learn::run(args),
        Verb::Robustness(args) => robustness::run(args),
        Verb::Sweep(verb) => sweep::run(verb),
        Verb::Hold(args) => hold::run(args),
        Verb::Scene(args) => scene::run(args),
        Verb::Specimen(args) => specimen::run(args),
        Verb::Generate(args) => generate::run(args),
    }
}

/// Runs work on a number of threads; 0: one for each processor core.
fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    if threads == 0 {
        return work();
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|error| Error::Infeasible {
        what: format!("{threads} threads cannot be started: {error}"),
        hint: "ask for fewer threads".into(),
    })?;
    pool.install(work)
}

/// Prints a result on stdout. A reader that went away, such as `head`, is no error.
fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    match written {
        Err(source) if source.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::write("standard output".as_ref(), source))
        }
        _ => Ok(()),
    }
}

/// Prints a message on stderr within 80 columns. A failure to do so cannot be reported anywhere.
fn tell(head: &str, text: &str) {
    let _ = std::io::stderr().write_all(wrapped(head, text).as_bytes());
}

/// Prints warnings.
fn warn(warnings: &[String]) {
    warnings.iter().for_each(|warning| tell("warning: ", warning));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_has_help_and_every_verb_a_group() {
        command().debug_assert();
        let args = Args::command();
        let grouped: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| *names).copied().collect();
        for verb in args.get_subcommands() {
            let name = verb.get_name();
            let groups = grouped.iter().filter(|other| **other == name).count();
            assert_eq!(groups, usize::from(!verb.is_hide_set()), "groups of {name}");
            for flag in verb.get_arguments() {
                assert!(flag.get_help().is_some(), "{name} {}", flag.get_id());
            }
        }
        assert_eq!(grouped.len(), args.get_subcommands().filter(|v| !v.is_hide_set()).count());
    }
}
