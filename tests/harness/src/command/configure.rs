//! `viewshed configure`: a unit's configuration written, read, compared, emptied.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::{Result, bail, ensure};
use viewshed::bench::stage::Stage;
use viewshed::unit::settings::{BlockError, BlockKind, Settings, Which};
use viewshed::unit::timing::Count;

use serde_json::{Map, Value, json};

use super::print;
use crate::configure::file::{self, EXAMPLE, UnitFile};
use crate::configure::grids::GRIDS;
use crate::configure::kept::{self, Blocks, KINDS, Kept};
use crate::configure::link::Link;
use crate::configure::{Found, Stored, Wanted, find, name};
use crate::geometry::looks;
use crate::results::files::OutputArgs;

/// Write the configuration of a unit on a controller, over its serial port or its CAN bus
///
/// A flashed unit sends nothing but its status until it has a configuration: where it stands, what its radar could see, its
/// buses. This writes one, reads it back, and says what the unit refuses and why. Lanes, heights of the road and a table of
/// probabilities are part of it, as in a daemon's file, where the unit's firmware has room for them. The unit keeps its old configuration until
/// its next start, and for good if anything goes wrong on the way.
#[derive(Debug, clap::Args)]
#[command(after_long_help = EXAMPLES)]
pub struct Args {
    /// TOML file of the configuration; one of the daemon's does as well
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    /// CAN interface of the bus the unit broadcasts on
    #[arg(long, value_name = "INTERFACE", conflicts_with = "port")]
    can: Option<String>,
    /// Its frames are CAN FD's, as a daemon's with medium = "can-fd"
    #[arg(long, requires = "can")]
    fd: bool,
    /// Serial port of the unit
    #[arg(long, value_name = "PATH")]
    port: Option<String>,
    /// Bit rate of the port [default: 115200, as after every start; then those that units are set to]
    #[arg(long, value_name = "BAUD", requires = "port")]
    baud: Option<u32>,
    /// The unit of this sensor's number, 0 to 7 [default: the only one that answers]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u8).range(0..8))]
    sensor: Option<u8>,
    /// The unit with this chip, eight hexadecimal digits as they are printed: for units of one number, as new ones are
    #[arg(long, value_name = "CHIP", value_parser = chip)]
    chip: Option<u32>,
    /// Print the unit's configuration as a file instead
    #[arg(long, conflicts_with_all = ["file", "check", "restart", "factory"])]
    read: bool,
    /// Write nothing: say whether the file can be used and, with a unit, what the unit has differently
    #[arg(long, conflicts_with_all = ["restart", "factory"])]
    check: bool,
    /// Restart the unit, after the file was written if there is one, so that it counts
    #[arg(long, conflicts_with = "factory")]
    restart: bool,
    /// Take every configuration from the unit and restart it: as it was when it was flashed first
    #[arg(long, conflicts_with = "file")]
    factory: bool,
    /// Print how long frames take on the unit: the last one and the longest since its start, in all and by stage
    #[arg(long, conflicts_with_all = ["file", "read", "check", "restart", "factory", "can"])]
    timing: bool,
    /// Print a file to begin with, with every key explained
    #[arg(long, exclusive = true)]
    example: bool,
    /// How long to look for the unit, in seconds; in it its reset button may be pressed
    #[arg(long, value_name = "SECONDS", default_value_t = 3.0)]
    wait: f64,
    /// Write what was found and done as JSON
    #[arg(long, value_name = "FILE", conflicts_with = "example")]
    json: Option<PathBuf>,
    #[command(flatten)]
    outputs: OutputArgs,
}

/// What was found and done, for machines.
type Told = Map<String, Value>;

const EXAMPLES: &str = "\
Examples:
  viewshed configure --example > unit.toml                      a file to begin with; edit it
  viewshed configure unit.toml --check                          whether it can be used, on which grid
  viewshed configure unit.toml --port /dev/ttyACM0 --restart    write it and let it count
  viewshed configure --port /dev/ttyACM0 --read > unit.toml     what the unit runs with
  viewshed configure unit.toml --can can0 --chip 1A2B3C4D       one of two new units on a bus
  viewshed configure --port /dev/ttyACM0 --timing               how long frames take on it, in cycles and microseconds

Exit codes: 0 done; 1 --check found differences or something doubtful; 2 nothing was changed, and why.";

fn chip(text: &str) -> Result<u32, String> {
    u32::from_str_radix(text.trim_start_matches("0x"), 16).map_err(|_| "not eight hexadecimal digits".into())
}

/// Does what the options say.
///
/// # Errors
/// A file that cannot be used, a unit that does not answer or refuses.
pub fn run(args: &Args) -> Result<ExitCode> {
    if args.example {
        print(EXAMPLE)?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut outputs = args.outputs.beside(args.file.clone());
    let json = outputs.file("--json", args.json.as_deref())?;
    let mut told = Told::new();
    let code = carry_out(args, &mut told)?;
    if let Some(file) = json {
        file.write(serde_json::to_string_pretty(&told)? + "\n")?;
        print(&outputs.told())?;
    }
    Ok(code)
}

fn carry_out(args: &Args, told: &mut Told) -> Result<ExitCode> {
    ensure!(args.wait.is_finite() && args.wait > 0.0, "--wait {} is not above 0", args.wait);
    ensure!(
        args.file.is_some() || args.read || args.restart || args.factory || args.timing,
        "say what to write: FILE, which `viewshed configure --example > unit.toml` begins; or without one what to do with the unit at --port PATH or --can INTERFACE: --read, --restart, --factory, --timing"
    );
    let file = args.file.as_deref().map(file::read).transpose()?;
    if let Some(file) = &file {
        left_out(file)?;
        let doubts = looks::doubts(&file.settings.sensor);
        doubts.iter().try_for_each(|doubt| print(&format!("doubtful: {doubt}\n")))?;
        told.insert("doubts".into(), doubts.into());
        if args.check && args.can.is_none() && args.port.is_none() {
            return on_grids(file, told);
        }
    }
    let mut link = open(args)?;
    let wanted = Wanted { sensor: args.sensor, chip: args.chip };
    let mut unit = find(&mut *link, wanted, Duration::from_secs_f64(args.wait))?;
    let found = &unit.unit;
    told.insert(
        "unit".into(),
        json!({"at": unit.place(), "board": found.board(), "sensor": found.sensor, "chip": format!("{:08X}", found.chip),
            "firmware": found.firmware, "grid": found.grid, "test_bench": found.is_bench}),
    );
    if !args.read {
        print(&format!("{}: {}\n", unit.place(), name(&unit.unit)))?;
    }
    if args.read {
        return read(&mut unit, told);
    }
    if args.timing {
        return timing(&mut unit, told);
    }
    if args.factory {
        for kind in KINDS {
            if unit.kept(Which::newest(kind))? != Kept::NoRoom {
                unit.clear(kind)?;
            }
        }
        unit.clear(BlockKind::Settings)?;
        unit.restart()?;
        told.insert("emptied".into(), true.into());
        print("emptied and restarted: it sends its status only, until it is configured\n")?;
        return Ok(ExitCode::SUCCESS);
    }
    if let (Some(file), true) = (&file, args.check) {
        return compare(&mut unit, file, told);
    }
    let mut written = None;
    if let Some(file @ UnitFile { settings, blocks, .. }) = &file {
        unit.check(file)?;
        written = Some(write(&mut unit, settings, blocks, told)?);
    }
    if !args.restart {
        print(
            "it counts from the unit's next start on: the same with --restart and without the file, or its reset button\n",
        )?;
        return Ok(ExitCode::SUCCESS);
    }
    let runs_with = unit.restart()?;
    told.insert("restarted_with".into(), runs_with.into());
    match (runs_with, written) {
        (Some(sequence), None) => print(&format!("restarted with block {sequence}\n"))?,
        (Some(sequence), Some(wanted)) if sequence == wanted => print(&format!("restarted with block {sequence}\n"))?,
        (Some(sequence), Some(wanted)) => {
            bail!("it runs with block {sequence}, not with {wanted}: restart it once more")
        }
        (None, None) => print("restarted, without a configuration: it sends its status only\n")?,
        (None, Some(wanted)) => bail!("it runs without a configuration: block {wanted} is gone; write it again"),
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes what a file says; the sequence of the settings.
fn write(unit: &mut Found<'_>, settings: &Settings, blocks: &Blocks, told: &mut Told) -> Result<u32> {
    let plan = unit.plan(blocks)?;
    for (kind, _) in plan.iter().filter(|(_, has_old)| *has_old) {
        unit.clear(*kind)?;
    }
    let written = unit.write(settings)?;
    told.insert("written".into(), written.into());
    print(&format!("written as block {written}, and read back the same\n"))?;
    let mut others = Map::new();
    for (kind, block) in KINDS.into_iter().zip(blocks) {
        let Some((_, has_old)) = plan.iter().find(|(planned, _)| *planned == kind) else { continue };
        let key = kept::key(kind);
        if let Some(block) = block {
            let sequence = unit.write_kept(kind, block)?;
            others.insert(key.into(), sequence.into());
            print(&format!("{key} written as block {sequence}, {} bytes, and read back the same\n", block.len()))?;
        } else if *has_old {
            others.insert(key.into(), Value::Null);
            print(&format!("{key} taken from the unit: the file has none\n"))?;
        }
    }
    told.insert("written_beside".into(), others.into());
    Ok(written)
}

fn open(args: &Args) -> Result<Box<dyn Link>> {
    match (&args.port, &args.can) {
        #[cfg(unix)]
        (Some(port), _) => Ok(Box::new(crate::configure::serial::open(port, args.baud)?)),
        #[cfg(target_os = "linux")]
        (_, Some(name)) => {
            use crate::configure::{can::CanLink, socketcan::Interface};
            Ok(Box::new(CanLink::new(Interface::open(name)?, name, args.fd)))
        }
        (None, None) => {
            bail!("say where the unit is: --port PATH or --can INTERFACE (or only look at the file: --check)")
        }
        #[allow(unreachable_patterns)]
        _ => bail!("this system has no such lines; serial ports need Unix, CAN interfaces Linux"),
    }
}

/// Keys of a daemon's file that no block has.
fn left_out(file: &UnitFile) -> Result<()> {
    if file.left_out.is_empty() {
        return Ok(());
    }
    print(&format!("not part of a unit's configuration, the daemon's alone: {}\n", file.left_out.join(", ")))
}

/// What a check of a file without differences ends with.
fn checked(told: &Told) -> ExitCode {
    let doubtful = told.get("doubts").and_then(Value::as_array).is_some_and(|doubts| !doubts.is_empty());
    if doubtful { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

/// Whether a file can be used, without a unit.
fn on_grids(file: &UnitFile, told: &mut Told) -> Result<ExitCode> {
    let (mut any, mut refusals, mut without) = (false, Map::new(), Map::new());
    for grid in &GRIDS {
        let refused = grid.refused(file);
        any |= refused.is_none();
        print(&format!("{} grid: {}\n", grid.name, refused.as_deref().unwrap_or("can be used")))?;
        let boards = if refused.is_none() { grid.not_on(file) } else { Vec::new() };
        for (board, what) in &boards {
            print(&format!("  not on {board}: no room for {what}\n"))?;
        }
        refusals.insert(grid.name.into(), refused.into());
        without.insert(grid.name.into(), boards.into_iter().map(|(board, what)| (board.to_owned(), what)).collect());
    }
    told.insert("refused_by_grid".into(), refusals.into());
    told.insert("no_room_by_board".into(), without.into());
    ensure!(any, "no unit can run with this");
    Ok(checked(told))
}

fn read(unit: &mut Found<'_>, told: &mut Told) -> Result<ExitCode> {
    let (in_use, newest) = (unit.in_use()?, unit.newest()?);
    let place = unit.place().to_owned();
    let mut beside = Vec::new();
    for kind in KINDS {
        // what counts from the next start on, if there is nothing in use
        let which = if in_use.is_ok() { Which::in_use(kind) } else { Which::newest(kind) };
        match unit.kept(which)? {
            Kept::Block(Some(block)) => beside.push(kept::text(kind, &block)?),
            Kept::Damaged => beside.push(format!("\n# {}: what is stored does not hold any more\n", kept::key(kind))),
            Kept::Block(None) | Kept::NoRoom => {}
        }
    }
    let head = |Stored { sequence, .. }: &Stored| format!("# {place}: {}, block {sequence}\n", name(&unit.unit));
    match (&in_use, &newest) {
        (Err(BlockError::Empty), Err(BlockError::Empty)) => {
            bail!(
                "{place}: the unit has no configuration; `viewshed configure --example > unit.toml` writes a file to begin with"
            )
        }
        (Err(error), Err(_)) => bail!("{place}: {error}"),
        (Ok(stored), _) | (Err(_), Ok(stored)) => {
            let mut text = file::text(&stored.settings)?;
            for block in &beside {
                text += block;
            }
            told.insert("block".into(), stored.sequence.into());
            told.insert("configuration".into(), toml::from_str(&text)?);
            print(&(head(stored) + &text))?;
        }
    }
    told.insert("next_block".into(), newest.as_ref().ok().map(|stored| stored.sequence).into());
    match (in_use, newest) {
        (Ok(a), Ok(b)) if a == b => {}
        (_, Ok(newest)) => print(&format!("# block {} counts from its next start on\n", newest.sequence))?,
        (_, Err(_)) => print("# its slots are empty: from its next start on it has none\n")?,
    }
    Ok(ExitCode::SUCCESS)
}

fn timing(unit: &mut Found<'_>, told: &mut Told) -> Result<ExitCode> {
    let took = unit.timing()?;
    ensure!(
        took.frames > 0 && took.hz > 0,
        "no frame was worked up since its start: is it configured, and is its radar there?"
    );
    let row = |name: &str, count: Count| {
        let micros = |counts: u32| f64::from(counts) * 1e6 / f64::from(took.hz);
        format!(
            "{name:<10}{:>12}{:>12}{:>12.0}{:>12.0}\n",
            count.last,
            count.worst,
            micros(count.last),
            micros(count.worst)
        )
    };
    let cycles = |count: Count| json!({"last": count.last, "worst": count.worst});
    let stages: Map<String, Value> =
        Stage::ALL.iter().zip(took.stages).map(|(stage, count)| (stage.name().into(), cycles(count))).collect();
    told.insert(
        "timing".into(),
        json!({"hz": took.hz, "frames": took.frames, "frame_cycles": cycles(took.frame), "stage_cycles": stages}),
    );
    let mut text = format!("{} frames, a core of {} MHz\n", took.frames, took.hz / 1_000_000);
    text += &format!("{:<10}{:>12}{:>12}{:>12}{:>12}\n", "", "cycles last", "worst", "us last", "worst");
    text += &row("frame", took.frame);
    for (stage, count) in Stage::ALL.iter().zip(took.stages) {
        text += &row(stage.name(), count);
    }
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

fn compare(unit: &mut Found<'_>, file: &UnitFile, told: &mut Told) -> Result<ExitCode> {
    let UnitFile { settings, blocks, .. } = file;
    unit.check(file)?;
    let Ok(stored) = unit.newest()? else {
        print("the unit has no configuration; the file can be used\n")?;
        return Ok(ExitCode::FAILURE);
    };
    let mut found = file::differences(&stored.settings, settings)?;
    for (kind, has_old) in unit.plan(blocks)? {
        let is_in_file = KINDS.into_iter().zip(blocks).any(|(k, block)| k == kind && block.is_some());
        let said = |is_there| if is_there { "is there" } else { "is not there" }.to_owned();
        found.push(match (has_old, is_in_file) {
            (true, true) => (kept::key(kind).into(), "another".into(), "one".into()),
            (has, wanted) => (kept::key(kind).into(), said(has), said(wanted)),
        });
    }
    told.insert("block".into(), stored.sequence.into());
    let each = found.iter().map(|(key, has, wanted)| json!({"key": key, "unit": has, "file": wanted}));
    told.insert("differences".into(), each.collect());
    if found.is_empty() {
        print(&format!("block {} is what the file says\n", stored.sequence))?;
        return Ok(checked(told));
    }
    for (name, has, wanted) in &found {
        print(&format!("{name}: {has} in the unit, {wanted} in the file\n"))?;
    }
    Ok(ExitCode::FAILURE)
}
