//! The STM32 boards: built and looked at, never run.

use std::ops::Range;
use std::path::Path;

use viewshed_harness::boards::firmware::build_in;
use viewshed_harness::boards::image::{Image, Section};

/// A board's memories and what may be taken of them.
struct Board {
    folder: &'static str,
    flash: Range<u64>,
    ram: Range<u64>,
    /// Where DMA controllers read and write.
    dma: Range<u64>,
    /// Memories the core reaches without waiting, if there are any: for code, and for the map and the stack behind it.
    coupled: Option<[Range<u64>; 2]>,
    /// Bytes the image takes at most: 4 % more than it does, as compilers differ by 1 %.
    most_flash: u64,
    /// Bytes of variables at most.
    most_ram: u64,
    /// Bytes of stack at least: the frames of the deepest path, at the start, add up to 52 and 19 kB.
    least_stack: u64,
}

const H743: Board = Board {
    folder: "nucleo-h743zi",
    flash: 0x0800_0000..0x0810_0000,
    ram: 0x2400_0000..0x2407_F000,
    dma: 0x2407_F000..0x2408_0000,
    coupled: Some([0x20..0x1_0000, 0x2000_0000..0x2002_0000]),
    most_flash: 190_000,
    most_ram: 498_500,
    least_stack: 64_000,
};

const G474: Board = Board {
    folder: "nucleo-g474re",
    flash: 0x0800_0000..0x0804_0000,
    ram: 0x2000_0800..0x2002_0000,
    dma: 0x2000_0000..0x2000_0800,
    coupled: None,
    most_flash: 220_000,
    most_ram: 108_000,
    least_stack: 22_000,
};

/// Whose panics an image may hold: embassy's and the drivers', not the library's nor what it is made of.
const MAY_PANIC: [&str; 8] = [
    "/embassy-",
    "/stm32-metapac-",
    "/static_cell-",
    "/futures-util-",
    "/defmt-rtt-",
    "/out/_generated.rs",
    "/boards/stm32/src/",
    "src/main.rs",
];

fn within(section: &Section, region: &Range<u64>) -> bool {
    region.contains(&section.address) && section.address + section.bytes <= region.end
}

fn check(board: &Board) {
    let image = Image::read(&build_in(board.folder, "live", &[]).unwrap()).unwrap();
    for section in &image.sections {
        let coupled = board.coupled.iter().flatten();
        let place = [&board.flash, &board.ram, &board.dma].into_iter().chain(coupled).position(|r| within(section, r));
        // what the start-up code fills must be known to it
        let own = [".itcm", ".dtcm", ".crash"].contains(&section.name.as_str());
        assert!(
            if own && board.coupled.is_some() { place > Some(2) } else { place < Some(3) && place.is_some() },
            "{section:?}"
        );
    }
    let address = |parts: &[&str]| image.symbol(parts).unwrap_or_else(|| panic!("no {parts:?}")).address;
    for name in ["STATE", "RADAR_QUEUE"] {
        assert!(board.ram.contains(&address(&["live", name])), "{name}");
    }
    if let Some([code, data]) = &board.coupled {
        assert!(data.contains(&address(&["live", "memory", "MAP"])));
        let hot = [["raycast", "cast"], ["follow_obstacles", ""], ["put_obstacles", ""], ["InverseSensor", "add"]];
        for name in hot {
            assert!(code.contains(&address(&name)), "{name:?}");
        }
        // kept behind everything else that is flashed
        let [start, end, stored] = ["_itcm_start", "_itcm_end", "_itcm_stored"].map(|name| address(&[name]));
        let others = image.sections.iter().filter(|s| s.stored && within(s, &board.flash)).map(|s| s.address + s.bytes);
        assert!(end - start > 30_000, "{} B of code", end - start);
        assert!(others.max() <= Some(stored) && stored + (end - start) <= board.flash.end);
    }
    assert!(board.ram.contains(&address(&["stm32", "unit", "REQUESTS"])));
    assert!(board.dma.contains(&address(&["stm32", "dma", "SERIAL"])));

    let variables = image.ram_bytes();
    let highest = image.sections.iter().filter(|s| within(s, &board.ram)).map(|s| s.address + s.bytes).max().unwrap();
    let stack = board.coupled.as_ref().map_or(board.ram.end - highest, |[_, data]| data.end - address(&["_stack_end"]));
    println!("{}: flash {} B, variables {variables} B, room for {stack} B of stack", board.folder, image.flash_bytes());
    assert!(image.flash_bytes() <= board.most_flash);
    assert!(variables <= board.most_ram && stack >= board.least_stack);

    for symbol in &image.symbols {
        let name = symbol.name.as_str();
        let double = name.starts_with("__aeabi_d") || name.contains("__adddf3") || name.contains("__muldf3");
        let heap = ["alloc::", "5alloc", "__rust_alloc", "malloc"].iter().any(|part| name.contains(part));
        assert!(!heap && !double, "{name}");
    }
    // a panic names its source file; that of the library is nowhere
    assert!(image.sources.iter().any(|name| name.contains("/embassy-")), "{:?}", image.sources);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    for name in &image.sources {
        assert!(MAY_PANIC.iter().any(|part| name.contains(part)), "{name}");
        assert!(!Path::new(name).starts_with(root.join("src")), "{name}");
    }
}

#[test]
#[ignore = "needs a compiler for the target"]
fn nucleo_h743zi_fits_and_each_region_holds_what_belongs_there() {
    check(&H743);
}

#[test]
#[ignore = "needs a compiler for the target"]
fn nucleo_g474re_fits_and_each_region_holds_what_belongs_there() {
    check(&G474);
}
