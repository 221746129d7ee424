//! The Cortex-R5F of the Zynq UltraScale+.

#[cfg(unix)]
mod can;

use viewshed_harness::boards::image::Image;
use viewshed_harness::boards::{Board, Profile, Run, check, firmware, stress};

use crate::regions::Regions;
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
    let images = [
        (Profile::Reference, "batch", "reference.x"),
        (Profile::Reference, "live", "reference.x"),
        (Profile::Small, "batch", "small.x"),
    ];
    for (profile, program, script) in images {
        let regions = Regions::of("zcu102-r5", script);
        let image = Image::read(&firmware::build(Board::Zcu102R5, profile, program).unwrap()).unwrap();
        println!("{program}, {}", profile.name());
        regions.hold(&image);
        let address = |part: &str| image.symbol(&[program, part]).unwrap().address;
        assert!(regions.get("RAM").contains(&address("STATE")));
        if program == "batch" {
            assert!(regions.get("RAM").contains(&address("MAP")) && regions.get("BENCH").contains(&address("SCAN")));
        }
        assert!(!image.symbols.iter().any(|s| s.name.contains("panicking") || s.name.starts_with("__aeabi_d")));
    }
}
