//! What the images take of a controller and what is in them.

use viewshed_harness::boards::image::Image;
use viewshed_harness::boards::{Board, Profile, Run, firmware};

use crate::shipped;

/// Bytes for everything, of each size: variables and stack, which a controller has; image, of which controllers with as
/// much memory have several times that, so that growth is seen.
const LIMITS: [(Profile, u64, u64); 2] = [(Profile::Reference, 516_096, 89_000), (Profile::Small, 114_000, 96_000)];

fn image(profile: Profile) -> Image {
    Image::read(&firmware::build(Board::Mps2An386, profile, "batch").unwrap()).unwrap()
}

#[test]
#[ignore = "needs a compiler for the target"]
fn nothing_in_the_image_can_panic_allocate_or_compute_in_doubles() {
    for profile in Profile::ALL {
        for symbol in image(profile).symbols {
            let name = symbol.name.as_str();
            let double = name.starts_with("__aeabi_d") || name.contains("__adddf3") || name.contains("__muldf3");
            assert!(!double, "{name}");
            for part in ["panicking", "unwrap_failed", "alloc::", "5alloc", "__rust_alloc", "malloc"] {
                assert!(!name.contains(part), "{name}");
            }
        }
    }
}

#[test]
#[ignore = "needs QEMU"]
fn everything_fits_with_the_stack_that_was_used() {
    let (settings, scans) = shipped(5.0);
    for (profile, ram, flash) in LIMITS {
        let run = Run { board: Board::Mps2An386, profile, name: "motorway", settings: &settings, scans: &scans };
        let checked = run.check().unwrap();
        let image = checked.image.unwrap();
        let [used, there] = checked.closing.stack;
        println!(
            "{}: flash {} B, variables {} B, stack {used} of {there} B, test buffers {} B",
            profile.name(),
            image.flash_bytes(),
            image.ram_bytes(),
            image.bench_bytes()
        );
        assert!(image.flash_bytes() <= flash);
        assert!(image.ram_bytes() + u64::from(used) <= ram);
        // the linker knows the limit, and a quarter of the stack stays free for what was not met here
        assert!(image.ram_bytes() + u64::from(there) <= ram);
        assert!(used > 500 && 4 * used <= 3 * there, "{used} of {there}");
    }
}

#[test]
#[ignore = "needs a compiler for the target"]
fn each_region_holds_what_belongs_there() {
    let bench = 0x2010_0000_u64..0x2020_0000;
    for (profile, bytes, flash) in LIMITS {
        let ram = 0x2000_0000..0x2000_0000 + bytes;
        let image = image(profile);
        let address = |parts: &[&str]| image.symbol(parts).unwrap_or_else(|| panic!("no {parts:?}")).address;
        assert!(ram.contains(&address(&["batch", "STATE"])) && ram.contains(&address(&["batch", "MAP"])));
        assert!(bench.contains(&address(&["batch", "SCAN"])));
        assert_eq!(address(&["__RESET_VECTOR"]), 4);
        for section in &image.sections {
            let end = section.address + section.bytes;
            let place = [0..flash, ram.clone(), bench.clone()].into_iter().find(|r| r.contains(&section.address));
            assert!(place.is_some_and(|r| end <= r.end), "{section:?}");
            // nothing that has to be copied out of flash at the start
            assert!(!(section.stored && section.writable), "{section:?}");
        }
    }
}
