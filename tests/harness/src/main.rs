//! The `viewshed` command.

use std::process::ExitCode;

use clap::Parser;
use viewshed_harness::command::Cli;

fn main() -> ExitCode {
    Cli::parse().run()
}
