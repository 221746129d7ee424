//! Radar frames in from CAN and serial ports, visibility maps out, as a system service.

mod can;
mod config;
mod frames;
mod hearing;
mod locate;
#[path = "../../../tests/harness/src/results/files/one_file.rs"]
mod one_file;
mod output;
mod place;
mod probability;
mod reference;
mod serial;
#[allow(clippy::duplicate_mod)] // the two grids' loops are the same two files
mod small;
mod state;
mod systemd;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Parser;
use log::{Level, LevelFilter, error};

use crate::config::{Config, Grid};

/// Computes where a roadside radar can see, and broadcasts it
///
/// Reads an ARS408 on a SocketCAN interface, or a TI mmWave radar or native scans on a serial port; sends
/// protected maps, header and status over CAN, CAN FD or a serial line.
#[derive(Debug, Parser)]
#[command(name = "viewshedd", version, after_long_help = EXAMPLES)]
struct Args {
    /// Configuration file; boards/linux/viewshed.toml explains every key
    #[arg(long, short, value_name = "FILE", default_value = "/etc/viewshed/viewshed.toml")]
    config: PathBuf,
    /// Check the configuration, say what it means, and end
    #[arg(long)]
    check: bool,
    /// Say more
    #[arg(long, short)]
    verbose: bool,
}

const EXAMPLES: &str = "\
Examples:
  viewshedd --check -c viewshed.toml     what is wrong with the file, by line and key; what it means
  viewshedd -c viewshed.toml             run here; Ctrl-C or SIGTERM stops it cleanly
  systemctl enable --now viewshed        run as a service, with boards/linux/viewshed.service

A first try without hardware is boards/linux/first-try.toml: input.candump = \"LOG\", input.clock = \"input\" and output.candump = \"OUT\" turn a
log written by `candump -L` into the log of its broadcast, as fast as it goes; `viewshed listen OUT` decodes that.

Interfaces that are down and ports that are unplugged are tried again until they work. A silent radar is reported
to the receivers: maps become unknown, the status says blind.

Exit codes: 0 stopped, or the log is over; 1 failed while running; 2 the configuration cannot be used.";

fn main() -> ExitCode {
    let args = Args::parse();
    log_to_stderr(args.verbose);
    let config = match Config::read(&args.config, state_dir()) {
        Ok(config) => config,
        Err(problems) => {
            problems.iter().for_each(|problem| error!("{problem}"));
            return ExitCode::from(2);
        }
    };
    if args.check {
        let mut missing = config.missing_files();
        missing.extend(
            config.table().and_then(Result::err).map(|e| format!("{e:#}; a daemon that runs goes on with grades")),
        );
        missing.iter().for_each(|problem| error!("{}: {problem}", args.config.display()));
        println!("{}", config.summary(&args.config, missing.is_empty()));
        return if missing.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(2) };
    }
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        if let Err(e) = signal_hook::flag::register(signal, stop.clone()) {
            error!("cannot watch for signal {signal}: {e}");
            return ExitCode::FAILURE;
        }
    }
    let run = match config.grid {
        Grid::Reference => reference::run::run,
        Grid::Small => small::run::run,
    };
    match run(&config, &stop) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            error!("{e:#}");
            ExitCode::FAILURE
        }
    }
}

/// The folder systemd made for the service.
fn state_dir() -> Option<PathBuf> {
    let folders = std::env::var_os("STATE_DIRECTORY")?;
    let first = folders.to_str()?.split(':').next()?.to_owned();
    Some(Path::new(&first).to_owned())
}

/// One line a message; with the journal's priorities where the journal reads them.
fn log_to_stderr(verbose: bool) {
    let journal = std::env::var_os("JOURNAL_STREAM").is_some();
    let level = if verbose { LevelFilter::Debug } else { LevelFilter::Info };
    let format = move |out: &mut env_logger::fmt::Formatter, record: &log::Record<'_>| {
        let (number, word) = match record.level() {
            Level::Error => (3, "error: "),
            Level::Warn => (4, "warning: "),
            Level::Info => (6, ""),
            Level::Debug | Level::Trace => (7, "debug: "),
        };
        if journal { writeln!(out, "<{number}>{}", record.args()) } else { writeln!(out, "{word}{}", record.args()) }
    };
    env_logger::Builder::new().filter_level(level).format(format).init();
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn options_do_not_contradict_each_other() {
        // panics where clap was built with debug assertions, as Cargo.toml says
        Args::command().debug_assert();
    }
}
