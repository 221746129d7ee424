//! `viewshed replay --board`: the recordings through a controller as well, every frame compared.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, bail, ensure};
use viewshed::unit::settings::Settings as Block;

use crate::boards::report::{Cost, Row, table};
use crate::boards::scans;
use crate::boards::{Board, Profile, Run, stress};
#[cfg(unix)]
use crate::boards::{
    can_twin,
    live_check::{self, Live},
};
use crate::command::{complain, print};
use crate::evaluation::Settings;
#[cfg(unix)]
use crate::recording::can_log;
use crate::results::files::{Folder, Target};
use crate::results::report::table::Extent;
use crate::{estimators, recording};

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Processor in the loop", group = clap::ArgGroup::new("processor").args(["board", "port"]))]
pub struct BoardArgs {
    /// Run radar-3d on this emulated controller too and compare every frame; fails if one differs
    ///
    /// Builds boards/BOARD, runs it in QEMU over every frame and compares grades, occupancies and bits with
    /// the same library here. The first frame that differs is drawn into --out. Prints instructions a frame,
    /// in all and by stage, and the stack used. No rates are reported then.
    #[arg(long, value_name = "BOARD", value_enum)]
    pub board: Option<Board>,
    /// Grid of the board; both if not given (of maps here: --grid-size)
    #[arg(long, value_name = "PROFILE", value_enum, requires = "processor")]
    profile: Option<Profile>,
    /// Run the board's live program: scans over its serial line or clusters over its CAN bus, maps back
    ///
    /// Every message it sends and every cell a receiver of them has are compared with the same program here.
    /// mps2-an386 has serial lines, zcu102-r5 a CAN bus; to that a CAN log goes as it is.
    #[arg(long, requires = "board", conflicts_with = "stress")]
    live: bool,
    /// Run the live program of a real board behind this serial port, as --board --live does an emulated one
    ///
    /// The board is configured first and started over; its grid is --profile's, by default the reference grid.
    #[arg(long, value_name = "PATH", conflicts_with = "board")]
    pub port: Option<PathBuf>,
    /// Bit rate of the port
    #[arg(long, value_name = "BAUD", default_value_t = viewshed::unit::settings::UnitConfig::SERVICE_BAUD, requires = "port")]
    baud: u32,
    /// Run scans nobody should send as well, to know the most a frame costs
    #[arg(long, requires = "board")]
    stress: bool,
}

/// Runs every recording on the board.
///
/// # Errors
/// Recordings that cannot be read, firmware that cannot be built or run.
pub fn run(
    args: &BoardArgs,
    paths: &[PathBuf],
    out: &Folder,
    json: Option<&Target>,
    (settings, extent): (&Settings, Extent),
) -> Result<ExitCode> {
    let board = match (args.board, &args.port) {
        (Some(board), _) if !args.live => board,
        _ => return live(args, paths, out, json, settings),
    };
    let (mut rows, mut differ) = (Vec::new(), false);
    for path in paths {
        let recording = recording::read(path, &settings.reading)?;
        let block = block(&recording, settings)?;
        let mut scenes = vec![(recording.name.as_str(), scans::of(&recording))];
        if args.stress {
            scenes.extend(stress::SCENES.map(|scene| (scene, stress::scans(scene))));
        }
        for (name, scans) in &scenes {
            for profile in args.profile.map_or(Profile::ALL.to_vec(), |p| vec![p]) {
                let run = Run { board, profile, name, settings: &block, scans };
                rows.push(one(&run, out, &mut differ)?);
            }
        }
    }
    print(&table(&rows, extent))?;
    if let Some(file) = json {
        file.write(serde_json::to_string_pretty(&rows)?)?;
    }
    Ok(if differ { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Runs every recording through a live program.
#[cfg(unix)]
fn live(
    args: &BoardArgs,
    paths: &[PathBuf],
    out: &Folder,
    json: Option<&Target>,
    settings: &Settings,
) -> Result<ExitCode> {
    let mut all = Vec::new();
    for path in paths {
        let recording = recording::read(path, &settings.reading)?;
        let (block, name) = (block(&recording, settings)?, recording.name.as_str());
        let profile = args.profile.unwrap_or(Profile::Reference);
        let scans = || scans::of(&recording);
        let live = match (args.board, &args.port) {
            (_, Some(port)) => live_check::port(port, args.baud, profile, name, &block, &scans())?,
            (Some(board @ Board::Zcu102R5), _) => {
                ensure!(profile == Profile::Reference, "the live program of {} has the reference grid", board.name());
                let steps = match can_log::of_file(path, settings.reading.interface.as_deref())? {
                    Some(lines) => can_twin::log(&lines),
                    None => {
                        let scans = scans();
                        can_twin::clusters(&scans, scans.len(), 240)
                    }
                };
                live_check::can(board, name, &block, &steps)?
            }
            (Some(board), _) => live_check::serial(board, profile, name, &block, &scans())?,
            (None, None) => bail!("neither a board nor a port"),
        };
        let Live { board, profile, scans, equal, messages, visible_cells, .. } = &live;
        print(&format!(
            "{name}, live on {board} ({profile} grid): {equal} of {scans} scans equal, {messages} messages, {visible_cells} \
             cells visible in the end\n"
        ))?;
        if live.instructions.is_some() {
            print(&format!("1000 instructions a frame, median / worst: {}\n", Cost::text(live.instructions)))?;
        }
        if let Some(what) = &live.first_difference {
            let title = format!("{name}, live on {board}");
            let folder = out.folder("live");
            let files = live.difference.as_ref().map(|d| d.draw(&folder, &title)).transpose()?.unwrap_or_default();
            let files: Vec<String> = files.iter().map(|f| format!("\n  {}", f.display())).collect();
            complain(&anyhow::anyhow!("{title}: {what}{}", files.concat()));
        }
        all.push(live);
    }
    if let Some(file) = json {
        file.write(serde_json::to_string_pretty(&all)?)?;
    }
    let same = all.iter().all(|live| live.first_difference.is_none());
    Ok(if same { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

#[cfg(not(unix))]
fn live(_: &BoardArgs, _: &[PathBuf], _: Option<&Path>, _: Option<&Path>, _: &Settings) -> Result<ExitCode> {
    bail!("live programs can be run on Unix only")
}

fn one(run: &Run<'_>, out: &Folder, differ: &mut bool) -> Result<Row> {
    let checked = run.check()?;
    if let Some(difference) = &checked.difference {
        *differ = true;
        let title = format!("{} on {}, {} grid", run.name, run.board.name(), run.profile.name());
        let folder = out.folder(run.board.name());
        let files = difference.draw(&folder, &title)?;
        let files: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
        complain(&anyhow::anyhow!("{title}: {}\n  {}", difference.text(), files.join("\n  ")));
    }
    Ok(Row::new(run, &checked))
}

/// The configuration block for a recording.
fn block(recording: &recording::Recording, settings: &Settings) -> Result<Block> {
    estimators::usable::check(recording, &settings.estimators)?;
    let radar_3d = &settings.estimators.radar_3d;
    let mut block = Block::of(estimators::sensor(recording, &settings.estimators.noise));
    (block.gate, block.visibility, block.health) = (radar_3d.gate, radar_3d.visibility, radar_3d.health);
    block.gate.max_detections = u16::try_from(settings.estimators.max_detections).unwrap_or(u16::MAX);
    ensure!(
        block.radar_3d() == viewshed::radar_3d::Radar3dConfig { gate: block.gate, ..*radar_3d },
        "--board: [estimators.radar_3d.obstacles] and [estimators.radar_3d.evidence] are not part of a \
         controller's configuration block; leave them at their defaults"
    );
    Ok(block)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        processor: BoardArgs,
    }

    #[test]
    fn a_profile_is_of_a_board_or_a_port() {
        let parse = |line: &[&str]| Line::try_parse_from([&["viewshed"], line].concat()).map(|line| line.processor);
        let error = parse(&["--profile", "small"]).err().unwrap().to_string();
        assert!(error.contains("--board") && error.contains("--port"), "{error}");
        assert!(parse(&["--profile", "small", "--board", "mps2-an386"]).unwrap().profile.is_some());
        assert!(parse(&["--profile", "small", "--port", "/dev/ttyUSB0"]).unwrap().profile.is_some());
    }
}
