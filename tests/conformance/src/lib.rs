//! Faults of buses for receivers of visibility maps, and logs to compare receivers by: see `README.md`.

pub mod class;
pub mod input;
pub mod library;
pub mod logs;
mod made_up;
pub mod measure;
pub mod program;
mod random;
pub mod receivers;
pub mod sender;
pub mod world;

use std::path::Path;

use anyhow::Result;
use viewshed::grid::settling::SettlingConfig;
use viewshed_harness::bus::traffic::Maps;
use viewshed_harness::{estimators, recording};

/// The maps of the shipped recording, without those of its first second, in which there is hardly one.
///
/// # Errors
/// It cannot be read.
pub fn maps() -> Result<Maps> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/motorway.mcap");
    let recording = recording::read(&path, &recording::ReadOptions::default())?;
    // as of a unit that has been on for long
    let mut options = estimators::Options::default();
    options.radar_3d.settling = SettlingConfig::AT_ONCE;
    let mut maps = Maps::new(&recording, &options, None, &|| ())?;
    maps.scans.drain(..15);
    Ok(maps)
}
