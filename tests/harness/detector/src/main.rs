//! The `viewshed-detect` command.

use std::process::ExitCode;

use clap::Parser;
use viewshed_detector::command::{Args, run};
use viewshed_harness::command::{BAD_INPUT, complain};

fn main() -> ExitCode {
    run(&Args::parse()).unwrap_or_else(|error| {
        complain(&error);
        ExitCode::from(BAD_INPUT)
    })
}
