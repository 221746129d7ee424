//! What the images take of a controller and what is in them.

use viewshed_harness::boards::image::Image;
use viewshed_harness::boards::{Board, Profile, Run, firmware};

use crate::regions::Regions;
use crate::shipped;

/// The linker's regions of each size, and the bytes an image may take of flash, of which controllers have several times
/// that: so that growth is seen, and not another compiler's code: 4 % more than they take.
const LIMITS: [(Profile, &str, u64); 2] =
    [(Profile::Reference, "reference.x", 95_000), (Profile::Small, "small.x", 103_500)];

fn regions(script: &str) -> Regions {
    Regions::of("mps2-an386", script)
}

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
    for (profile, script, flash) in LIMITS {
        let ram = regions(script).get("RAM");
        let ram = ram.end - ram.start;
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
    for (profile, script, _) in LIMITS {
        let regions = regions(script);
        let [ram, bench] = ["RAM", "BENCH"].map(|name| regions.get(name));
        let image = image(profile);
        regions.hold(&image);
        let address = |parts: &[&str]| image.symbol(parts).unwrap_or_else(|| panic!("no {parts:?}")).address;
        assert!(ram.contains(&address(&["batch", "STATE"])) && ram.contains(&address(&["batch", "MAP"])));
        assert!(bench.contains(&address(&["batch", "SCAN"])));
        assert_eq!(address(&["__RESET_VECTOR"]), 4);
        // nothing that has to be copied out of flash at the start
        for section in &image.sections {
            assert!(!(section.stored && section.writable), "{section:?}");
        }
    }
}
