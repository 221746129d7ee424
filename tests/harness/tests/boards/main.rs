//! Firmware on emulated controllers, and the daemon. The former needs QEMU and a compiler for the target, the
//! latter a build of its own, so they are ignored unless asked for: `tests/firmware.sh` and `tests/linux.sh`
//! see to that.

mod camera;
#[cfg(unix)]
mod configure;
mod kept;
#[cfg(target_os = "linux")]
mod linux;
#[cfg(unix)]
mod live;
mod mps2;
mod nucleo;
mod regions;
mod zcu102;

use std::path::Path;

use viewshed::unit::settings::Settings;
use viewshed_harness::boards::scans::{self, Scan};
use viewshed_harness::estimators;
use viewshed_harness::recording::{self, ReadOptions, Recording};

/// The shipped recording's settings and its first seconds.
fn shipped(seconds: f64) -> (Settings, Vec<Scan>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/motorway.mcap");
    let reading = ReadOptions { to_s: Some(seconds), ..ReadOptions::default() };
    let recording = recording::read(&path, &reading).unwrap();
    (settings_of(&recording), scans::of(&recording))
}

fn settings_of(recording: &Recording) -> Settings {
    Settings::of(estimators::sensor(recording, &Default::default()))
}
