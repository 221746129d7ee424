//! The library's receiver as a program, the table of figures, and the logs.

use std::io::{BufRead, BufWriter, Write};
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Result, bail};
use clap::Parser;
use rayon::prelude::*;
use viewshed_conformance::class::Class;
use viewshed_conformance::input::{Bus, Input};
use viewshed_conformance::library::Library;
use viewshed_conformance::logs::{self, Log};
use viewshed_conformance::measure::{self, Figures};
use viewshed_conformance::program::Program;
use viewshed_conformance::world::{Looks, World};

/// Receivers of visibility maps against the faults of buses.
#[derive(Debug, Parser)]
#[command(version)]
enum Cli {
    /// The library's receiver: lines of tests/conformance/README.md in and out
    Receive,
    /// Print, for each fault and bus, how often a receiver was wrong and how much arrived
    Table(TableArgs),
    /// Print what a receiver is fed in a run of the table
    Lines(LinesArgs),
    /// Write the logs of tests/conformance/logs anew, answered by the library's receiver
    Logs,
}

#[derive(Debug, clap::Args)]
struct LinesArgs {
    /// The fault, as the table names it
    fault: String,
    /// can, canfd or serial
    bus: String,
    /// The run's seed
    seed: u64,
}

#[derive(Debug, clap::Args)]
struct TableArgs {
    /// Runs of 30 s for each fault and bus
    #[arg(long, default_value_t = 3)]
    runs: u64,
    /// The first run's seed
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only faults whose name begins so
    #[arg(long, default_value = "")]
    only: String,
    /// Another receiver than the library's: a program and its arguments
    #[arg(long)]
    receiver: Option<String>,
    /// Name every run in which something was wrongly visible, or shown otherwise than by the library
    #[arg(long)]
    wrong: bool,
}

fn main() -> ExitCode {
    let outcome = match Cli::parse() {
        Cli::Receive => receive(),
        Cli::Table(args) => table(&args),
        Cli::Logs => logs(),
        Cli::Lines(args) => lines(&args),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn receive() -> Result<()> {
    let mut library = Library::default();
    let mut out = BufWriter::new(std::io::stdout().lock());
    for line in std::io::stdin().lock().lines() {
        let input: Input = line?.parse().map_err(anyhow::Error::msg)?;
        if let Some(answer) = library.take(&input) {
            writeln!(out, "{answer}")?;
        }
    }
    Ok(out.flush()?)
}

fn lines(args: &LinesArgs) -> Result<()> {
    let found = logs::names().find(|(bus, class)| (bus.name(), class.name()) == (&*args.bus, &*args.fault));
    let Some((bus, class)) = found else {
        let names: Vec<&str> = Class::ALL.iter().map(|class| class.name()).collect();
        bail!("no fault {} on {}; faults are {}; buses can, canfd, serial", args.fault, args.bus, names.join(", "));
    };
    let world = World::new(&viewshed_conformance::maps()?, bus, class, args.seed, LENGTH_US, Looks::Often)?;
    // a reader that has seen enough is no error
    let _ = std::io::stdout().lock().write_all(world.text(LENGTH_US).as_bytes());
    Ok(())
}

fn logs() -> Result<()> {
    let maps = viewshed_conformance::maps()?;
    let all: Vec<_> = logs::names().collect();
    all.into_par_iter().try_for_each(|(bus, class)| Log::new(&maps, bus, class)?.write(Path::new(logs::FOLDER)))
}

const LENGTH_US: u64 = 30_000_000;

fn table(args: &TableArgs) -> Result<()> {
    let maps = viewshed_conformance::maps()?;
    let program = args.receiver.as_deref().map(Program::new);
    println!(
        "| fault | bus | looks | wrong looks | wrong cells | otherwise than the library | arrived % | least of a run % | shown again s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for class in Class::ALL.into_iter().filter(|class| class.name().starts_with(&args.only)) {
        for bus in Bus::ALL {
            let run = |seed: u64| -> Result<Figures> {
                let world = World::new(&maps, bus, class, seed, LENGTH_US, Looks::Often)?;
                let world = if program.is_some() { world.asking_for_cells() } else { world };
                let (figures, first, ours) = measure::library(&maps, &world);
                let Some(program) = &program else {
                    if let Some((us, cells)) = first.filter(|_| args.wrong) {
                        let at = us as f64 / 1e6;
                        eprintln!("{} {} seed {seed}: first at {at:.3} s, {cells} cells", class.name(), bus.name());
                    }
                    return Ok(figures);
                };
                let answers = program.answers(world.text(LENGTH_US))?;
                let differing =
                    ours.iter().zip(answers.lines()).enumerate().filter(|(_, (ours, theirs))| ours != theirs);
                let differ = differing.clone().count() as u64;
                if let Some((look, _)) = differing.clone().next().filter(|_| args.wrong) {
                    eprintln!("{} {} seed {seed}: {differ} looks differ, first {look}", class.name(), bus.name());
                }
                let figures = measure::answered(&maps, &world, answers.lines()).map_err(anyhow::Error::msg)?;
                Ok(Figures { differ, ..figures })
            };
            let runs: Vec<Figures> =
                (args.seed..args.seed + args.runs).into_par_iter().map(run).collect::<Result<_>>()?;
            let all = runs.iter().fold(Figures::default(), |all, one| all.and(*one));
            let least = runs.iter().map(Figures::arrived).fold(1.0, f64::min);
            println!(
                "| {} | {} | {} | {} | {} | {} | {:.1} | {:.1} | {} |",
                class.name(),
                bus.name(),
                all.looks,
                all.wrong_looks,
                all.wrong_cells,
                all.differ,
                100.0 * all.arrived(),
                100.0 * least,
                if all.again_us > 0 { format!("{:.2}", all.again_us as f64 / 1e6) } else { "–".into() },
            );
        }
    }
    Ok(())
}
