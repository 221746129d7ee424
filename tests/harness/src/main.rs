//! The `viewshed` command.

use std::process::ExitCode;

use clap::Parser;
use viewshed_harness::commands::Cli;

fn main() -> ExitCode {
    Cli::parse().run()
}
