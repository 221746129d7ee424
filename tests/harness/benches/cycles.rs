//! An estimate of the cycles a frame takes on a Cortex-M4 and a Cortex-M7: `cargo bench -p viewshed-harness --bench cycles`.
//!
//! Runs the firmware of `mps2-an386` over the first 60 frames of the shipped recording in QEMU, counts its blocks of instructions,
//! and adds up what they cost by Arm's table and by LLVM's model (`viewshed_harness::boards::cycles`). Needs QEMU and llvm-mca. No
//! controller was measured. A frame is the estimator and its map into messages.

use std::path::Path;
use std::process::ExitCode;

use anyhow::Result;
use viewshed::unit::settings::Settings;
use viewshed_harness::boards::cycles::trace::Block;
use viewshed_harness::boards::cycles::{Range, cortex_m4, cortex_m7, trace};
use viewshed_harness::boards::machine::Folder;
use viewshed_harness::boards::scans::{job, of};
use viewshed_harness::boards::{Board, Profile, firmware};
use viewshed_harness::estimators;
use viewshed_harness::recording::{ReadOptions, read};

const FRAMES: usize = 60;
/// STM32G474 at 170 MHz, and its flash's waits there (RM0440, table 9).
const G474_HZ: f64 = 170e6;
const WAIT_STATES: u32 = 4;
/// STM32H743 at 480 MHz, with code in the instruction memory.
const H743_HZ: f64 = 480e6;
/// At most the whole state is fetched into the data cache and written back in each frame, 32 bytes in 20 cycles: assumed, not from a manual.
const LINE_BYTES: f64 = 32.0;
const LINE_CYCLES: f64 = 20.0;

fn main() -> ExitCode {
    match print() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn print() -> Result<()> {
    println!("estimated, not measured: the first {FRAMES} frames of tests/recordings/motorway.mcap");
    println!("{:<10} {:<10} {:>13} {:>24} {:>20}", "grid", "core", "instructions", "cycles a frame", "ms a frame");
    for profile in Profile::ALL {
        let (blocks, state_bytes) = blocks(profile)?;
        let a_frame = 1.0 / FRAMES as f64;
        let instructions: f64 =
            blocks.iter().map(|b| b.times as f64 * b.instructions.len() as f64).sum::<f64>() * a_frame;
        let mut m4 = Range::default();
        blocks.iter().for_each(|block| m4 += cortex_m4::cycles(block, WAIT_STATES).times(a_frame));
        let mut m7 = Range::default();
        cortex_m7::cycles(&blocks)?.into_iter().for_each(|range| m7 += range.times(a_frame));
        m7.most += 2.0 * state_bytes as f64 / LINE_BYTES * LINE_CYCLES;
        for (core, cycles, hz) in [("M4, 170 MHz", m4, G474_HZ), ("M7, 480 MHz", m7, H743_HZ)] {
            let millions = format!("{:.2} to {:.2} M", cycles.least / 1e6, cycles.most / 1e6);
            let times = format!("{:.1} to {:.1}", cycles.least / hz * 1e3, cycles.most / hz * 1e3);
            println!("{:<10} {core:<11} {:>10.2} M {millions:>24} {times:>20}", profile.name(), instructions / 1e6);
        }
    }
    Ok(())
}

/// What ran, and the bytes of the estimator's state.
fn blocks(profile: Profile) -> Result<(Vec<Block>, usize)> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/motorway.mcap"));
    let recording = read(path, &ReadOptions::default())?;
    let settings = Settings::of(estimators::sensor(&recording, &Default::default()));
    let folder = Folder::new()?;
    std::fs::write(folder.0.join("job.bin"), job(&settings, &of(&recording)[..FRAMES], None))?;
    let blocks = trace::run(&firmware::build(Board::Mps2An386, profile, "batch")?, &folder.0)?;
    let state = match profile {
        Profile::Reference => size_of::<viewshed::reference::State>(),
        Profile::Small => size_of::<viewshed::small::State>(),
    };
    Ok((blocks, state))
}
