//! `viewshed replay --board`: the recordings through a controller as well, every frame compared.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, ensure};
use viewshed::settings::Settings as Block;

use crate::boards::report::{Row, table};
use crate::boards::scans;
use crate::boards::{Board, Profile, Run, stress};
use crate::commands::{complain, print, write_file};
use crate::options::Settings;
use crate::{estimators, recording};

#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Processor in the loop")]
pub struct BoardArgs {
    /// Run radar-3d on this emulated controller too and compare every frame; fails if one differs
    ///
    /// Builds boards/BOARD, runs it in QEMU over every frame and compares grades, occupancies and bits with
    /// the same library here. The first frame that differs is drawn into --out. Prints instructions a frame,
    /// in all and by stage, and the stack used. No rates are reported then.
    #[arg(long, value_name = "BOARD", value_enum)]
    pub board: Option<Board>,
    /// Grid to run; both if not given
    #[arg(long, value_name = "PROFILE", value_enum, requires = "board")]
    profile: Option<Profile>,
    /// Run scans nobody should send as well, to know the most a frame costs
    #[arg(long, requires = "board")]
    stress: bool,
}

/// Runs every recording on the board.
///
/// # Errors
/// Recordings that cannot be read, firmware that cannot be built or run.
pub fn run(
    board: Board,
    args: &BoardArgs,
    paths: &[PathBuf],
    out: Option<&Path>,
    json: Option<&Path>,
    settings: &Settings,
) -> Result<ExitCode> {
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
    print(&table(&rows))?;
    if let Some(path) = json {
        write_file(path, &serde_json::to_string_pretty(&rows)?)?;
    }
    Ok(if differ { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn one(run: &Run<'_>, out: Option<&Path>, differ: &mut bool) -> Result<Row> {
    let checked = run.check()?;
    if let Some(difference) = &checked.difference {
        *differ = true;
        let title = format!("{} on {}, {} grid", run.name, run.board.name(), run.profile.name());
        let folder = out.unwrap_or(Path::new("out")).join(run.board.name());
        let files = difference.draw(&folder, &title)?;
        let files: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
        complain(&anyhow::anyhow!("{title}: {}\n  {}", difference.text(), files.join("\n  ")));
    }
    Ok(Row::new(run, &checked))
}

/// The configuration block for a recording.
fn block(recording: &recording::Recording, settings: &Settings) -> Result<Block> {
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
