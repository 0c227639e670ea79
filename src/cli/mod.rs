//! The command line: what was typed, progress, tables and exit codes. One file a verb.
//!
//! Exit codes: 0 success, and legible where a word was read; 1 not legible, or not to fly; 2 error. Results go to
//! stdout, progress, warnings and errors to stderr.

use std::io::Write;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::error::Result;

mod check;
mod compare;
mod compare_photo;
mod coverage;
mod coverage_map;
mod expose;
mod fly;
mod gains;
mod identify;
mod import;
mod inputs;
mod learn;
mod meter;
mod outputs;
mod plan;
mod preview;
mod progress;
mod rank;
mod read;
mod robustness;
mod scene;
mod score;
mod show;
mod specimen;
mod studies;
mod sweep;
mod tune;

/// Shows the photograph of a drone's light painting before the flight, and says whether it reads.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 80, arg_required_else_help = true)]
#[command(
    after_help = "Begin with: noctograph preview NOOR\n\nExit codes: 0 success (and legible), \
                        1 not legible or not to fly, 2 error."
)]
struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Plan, fly, expose and read a word: from a word to its photograph
    Preview(preview::PreviewArgs),
    /// Plan the flight that writes a word: setpoints and light commands as CSV
    Plan(plan::PlanArgs),
    /// Check whether a word's flight, or a plan, should fly: limits, lights, letters, battery
    Check(check::CheckArgs),
    /// Fly a plan in the simulator: the flight's log as CSV
    Fly(fly::FlyArgs),
    /// Import the log of a real flight: a flight's log as CSV
    Import(import::ImportArgs),
    /// Compare two flights, and each with its design: figures and plots
    Compare(compare::CompareArgs),
    /// Compare a render with a real photograph: where it lies, overlay and difference
    ComparePhoto(compare_photo::ComparePhotoArgs),
    /// Expose a flight: its long-exposure photograph as PNG
    Expose(expose::ExposeArgs),
    /// Measure a flight's light: stops over saturation, hot spots, and what to set
    Meter(meter::MeterArgs),
    /// Say what word a photograph shows, without being told
    Read(read::ReadArgs),
    /// Judge whether a photograph's word is legible, and say why not
    Score(score::ScoreArgs),
    /// Print the gains of regulator and observer, their poles, and what they stand
    Gains(gains::GainsArgs),
    /// Identify thrust, centre of mass and observer weights from a flight
    Identify(identify::IdentifyArgs),
    /// Show where Lighthouse base stations see the drone, and how well they place it
    Coverage(coverage::CoverageArgs),
    /// Draw a sheet of a font's characters: order and direction of their strokes
    Specimen(specimen::SpecimenArgs),
    /// Rank scenes by how surely their words read, over many seeds, with intervals
    Rank(rank::RankArgs),
    /// Tune a scene's gains, observer and speed until its words read as surely as they can
    Tune(tune::TuneArgs),
    /// Learn reference and lights of a word from flights of it, simulated or real
    Learn(learn::LearnArgs),
    /// Find out what breaks a word first: mass, motors, positioning, gusts, lamps
    Robustness(robustness::RobustnessArgs),
    /// Spread a ranking's flights over many processes or machines
    #[command(subcommand)]
    Sweep(sweep::SweepVerb),
    /// Print the default scene file, every key with its meaning and unit
    Scene(scene::SceneArgs),
}

/// What a verb found out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Done,
    NotLegible,
    ShouldNotFly,
}

impl Outcome {
    fn of(verdict: &crate::score::Verdict) -> Self {
        if verdict.legible { Self::Done } else { Self::NotLegible }
    }
}

/// Runs the command that was typed.
#[must_use]
pub fn main() -> ExitCode {
    let outcome = match Args::parse().verb {
        Verb::Preview(args) => preview::run(&args),
        Verb::Plan(args) => plan::run(&args),
        Verb::Check(args) => check::run(&args),
        Verb::Fly(args) => fly::run(&args),
        Verb::Import(args) => import::run(&args),
        Verb::Compare(args) => compare::run(&args),
        Verb::ComparePhoto(args) => compare_photo::run(&args),
        Verb::Expose(args) => expose::run(&args),
        Verb::Meter(args) => meter::run(&args),
        Verb::Read(args) => read::run(&args),
        Verb::Score(args) => score::run(&args),
        Verb::Gains(args) => gains::run(&args),
        Verb::Identify(args) => identify::run(&args),
        Verb::Coverage(args) => coverage::run(&args),
        Verb::Specimen(args) => specimen::run(&args),
        Verb::Rank(args) => rank::run(&args),
        Verb::Tune(args) => tune::run(&args),
        Verb::Learn(args) => learn::run(&args),
        Verb::Robustness(args) => robustness::run(&args),
        Verb::Sweep(verb) => sweep::run(&verb),
        Verb::Scene(args) => scene::run(&args),
    };
    match outcome {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::NotLegible | Outcome::ShouldNotFly) => ExitCode::from(1),
        Err(error) => {
            tell(&format!("error: {error}"));
            tell(&format!("hint: {}", error.hint()));
            ExitCode::from(2)
        }
    }
}

/// Prints a result on stdout. A reader that went away, such as `head`, is no error.
fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    match written {
        Err(source) if source.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(crate::error::Error::write("standard output".as_ref(), source))
        }
        _ => Ok(()),
    }
}

/// Prints a line for people on stderr; nobody can be told when that fails.
fn tell(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent_and_every_flag_has_its_help() {
        Args::command().debug_assert();
        for verb in Args::command().get_subcommands() {
            for flag in verb.get_arguments() {
                assert!(flag.get_help().is_some(), "{} {}", verb.get_name(), flag.get_id());
            }
        }
    }
}
