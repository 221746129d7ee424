//! A camera's unit on the boards: the boxes of the shipped recording, every map and message compared.

use std::path::Path;

use viewshed::bench::stage::Stage;
use viewshed::camera::boxes::ImageBox;
use viewshed::unit::settings::Settings;
use viewshed_harness::boards::scans::{self, Scan};
use viewshed_harness::boards::{Board, check_camera};
use viewshed_harness::recording::{self, ReadOptions};

/// Settings of the shipped recording's camera, and all its pictures.
fn shipped() -> (Settings, Vec<Scan<ImageBox>>) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/motorway.mcap");
    let recording = recording::read(&path, &ReadOptions::default()).unwrap();
    let camera = recording.camera.unwrap();
    (scans::camera_settings(&camera), scans::of_camera(&camera))
}

#[test]
#[ignore = "needs QEMU"]
fn mps2_gives_every_picture_of_the_shipped_recording_the_same_map_within_its_budget() {
    let (settings, scans) = shipped();
    assert!(scans.len() >= 300 && scans.iter().all(|s| !s.detections.is_empty()));
    let checked = check_camera(Board::Mps2An386, &settings, &scans).unwrap();
    assert_eq!((checked.frames, checked.equal), (scans.len(), scans.len()));
    let mut frames: Vec<u32> = checked.instructions.iter().map(|f| f[..Stage::ESTIMATOR].iter().sum()).collect();
    frames.sort_unstable();
    let (median, worst) = (frames[frames.len() / 2], frames[frames.len() - 1]);
    let image = checked.image.unwrap();
    let [used, there] = checked.closing.stack;
    println!(
        "camera: {median} instructions, at most {worst}; flash {} B, variables {} B, stack {used} of {there} B",
        image.flash_bytes(),
        image.ram_bytes()
    );
    assert!(worst <= 2 * median && worst <= 4_000_000);
    assert!(image.ram_bytes() + u64::from(used) <= 128_000 && 4 * used <= 3 * there);
    // nothing that has to be copied out of flash at the start
    assert!(!image.sections.iter().any(|s| s.stored && s.writable), "{:?}", image.sections);
    for symbol in &image.symbols {
        let name = symbol.name.as_str();
        assert!(!name.contains("panicking") && !name.starts_with("__aeabi_d"), "{name}");
    }
}

#[test]
#[ignore = "needs QEMU"]
fn zcu102_gives_every_picture_the_same_map() {
    let (settings, scans) = shipped();
    let checked = check_camera(Board::Zcu102R5, &settings, &scans).unwrap();
    assert_eq!((checked.frames, checked.equal), (scans.len(), scans.len()));
    assert!(!checked.image.unwrap().symbols.iter().any(|s| s.name.contains("panicking")));
}
