//! The Cortex-R5F of the Zynq UltraScale+.

#[cfg(unix)]
mod can;

use viewshed_harness::boards::image::Image;
use viewshed_harness::boards::{Board, Profile, Run, check, firmware, stress};

use crate::shipped;

#[test]
#[ignore = "needs QEMU"]
fn every_frame_of_the_shipped_recording_is_the_same() {
    let (settings, scans) = shipped(f64::INFINITY);
    let mut scenes = vec![("motorway", scans)];
    scenes.extend(stress::SCENES.map(|scene| (scene, stress::scans(scene))));
    for (name, scans) in &scenes {
        for profile in Profile::ALL {
            let checked = Run { board: Board::Zcu102R5, profile, name, settings: &settings, scans }.check().unwrap();
            let what = checked.difference.as_ref().map(check::Difference::text);
            assert_eq!(checked.equal, scans.len(), "{name}, {}: {what:?}", profile.name());
            let [used, there] = checked.closing.stack;
            assert!(used > 500 && 4 * used <= 3 * there, "{used} of {there}");
        }
    }
}

#[test]
#[ignore = "needs a compiler for the target"]
fn each_region_holds_what_belongs_there() {
    for (profile, ram_bytes) in [(Profile::Reference, 512_000), (Profile::Small, 98_000)] {
        let image = Image::read(&firmware::build(Board::Zcu102R5, profile, "batch").unwrap()).unwrap();
        let regions = [0x10_0000..0x10_0000 + 128 * 1024, 0x20_0000..0x20_0000 + ram_bytes, 0x30_0000..0x40_0000];
        for section in &image.sections {
            let place = regions.iter().find(|r| r.contains(&section.address));
            assert!(place.is_some_and(|r| section.address + section.bytes <= r.end), "{section:?}");
        }
        let address = |part: &str| image.symbol(&["batch", part]).unwrap().address;
        assert!(regions[1].contains(&address("STATE")) && regions[1].contains(&address("MAP")));
        assert!(regions[2].contains(&address("SCAN")));
        assert!(!image.symbols.iter().any(|s| s.name.contains("panicking") || s.name.starts_with("__aeabi_d")));
    }
}
