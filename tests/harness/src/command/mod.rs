//! The `viewshed` command, one file or folder per subcommand.

pub mod bus;
pub mod compare;
pub mod completions;
pub mod configure;
pub mod detect;
pub mod detections;
pub mod doctor;
pub mod experiment;
pub mod key;
#[cfg(feature = "pages")]
pub mod label;
pub mod lanes;
pub mod listen;
pub mod options;
pub mod progress;
pub mod replay;
pub mod results;
pub mod simulate;
pub mod site;
pub mod starts;
pub mod tune;
#[cfg(feature = "pages")]
pub mod view;

use std::io::Write;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};

use crate::recording::Recording;
use crate::results::report::notes;

/// Exit code for input or options that cannot be used.
pub const BAD_INPUT: u8 = 2;

/// Where a roadside radar can see, where it is blind, and how far that can be trusted.
#[derive(Debug, Parser)]
#[command(name = "viewshed", version)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Replay(Box<replay::Args>),
    Doctor(doctor::Args),
    Bus(Box<bus::Args>),
    Listen(listen::Args),
    Simulate(simulate::Args),
    Experiment(Box<experiment::Args>),
    Site(Box<site::Args>),
    Starts(Box<starts::Args>),
    Compare(compare::Args),
    Tune(Box<tune::Args>),
    Detect(detect::Args),
    Detections(Box<detections::Args>),
    Configure(Box<configure::Args>),
    Lanes(Box<lanes::Args>),
    Results(results::Args),
    Completions(completions::Args),
    #[cfg(feature = "pages")]
    Label(Box<label::Args>),
    #[cfg(feature = "pages")]
    View(Box<view::Args>),
}

impl Cli {
    /// Runs the subcommand; an error has been printed to stderr.
    pub fn run(&self) -> ExitCode {
        let outcome = match &self.command {
            Command::Replay(args) => replay::run(args),
            Command::Doctor(args) => doctor::run(args),
            Command::Bus(args) => bus::run(args),
            Command::Listen(args) => listen::run(args),
            Command::Simulate(args) => simulate::run(args),
            Command::Experiment(args) => experiment::run(args),
            Command::Site(args) => site::run(args),
            Command::Starts(args) => starts::run(args),
            Command::Tune(args) => tune::run(args),
            Command::Compare(args) => compare::run(args),
            Command::Detect(args) => detect::run(args),
            Command::Detections(args) => detections::run(args),
            Command::Configure(args) => configure::run(args),
            Command::Lanes(args) => lanes::run(args),
            Command::Results(args) => results::run(args),
            Command::Completions(args) => completions::run(args),
            #[cfg(feature = "pages")]
            Command::Label(args) => label::run(args),
            #[cfg(feature = "pages")]
            Command::View(args) => view::run(args),
        };
        outcome.unwrap_or_else(|error| {
            complain(&error);
            ExitCode::from(BAD_INPUT)
        })
    }
}

/// One error with its causes on stderr.
pub fn complain(error: &anyhow::Error) {
    told(&format!("error: {error:#}"));
}

/// A line on stderr. Where that is closed or full there is nobody to be told.
pub fn told(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Prints to stderr what is wrong with a recording, where there is something: stdout may be another program's input.
pub fn told_problems(recording: &Recording) {
    if !recording.problems.is_empty() {
        told(&format!("{}: {}", recording.name, notes::problems(recording).join("\n")));
    }
}

/// Prints to stdout; a reader that has seen enough (`| head`) is no error.
pub fn print(text: &str) -> Result<()> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(e).context("cannot write to standard output"),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;
    use clap::error::ErrorKind;

    use super::*;

    #[test]
    fn no_command_has_options_that_contradict_each_other() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_command_explains_itself() {
        let commands: Vec<String> = Cli::command().get_subcommands().map(|c| c.get_name().to_owned()).collect();
        assert!(commands.len() >= 8, "{commands:?}");
        for command in &commands {
            for help in ["-h", "--help"] {
                let error = Cli::try_parse_from(["viewshed", command, help]).unwrap_err();
                assert_eq!(error.kind(), ErrorKind::DisplayHelp, "{command}: {error}");
                assert!(error.to_string().contains(&format!("Usage: viewshed {command}")), "{error}");
            }
        }
    }

    /// Without debug assertions in clap the two tests above could not fail: the workspace's profiles turn them on.
    #[test]
    #[should_panic = "Long option names must be unique"]
    fn two_options_of_one_name_would_be_found() {
        let option = |id: &'static str| clap::Arg::new(id).long("profile");
        clap::Command::new("twice").args([option("grid"), option("radar")]).debug_assert();
    }
}
