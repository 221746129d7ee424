//! The regions of memory that a board's linker script names, which is the one place where their sizes stand.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use viewshed_harness::boards::image::Image;

/// How full flash and RAM may be, in percent: another compiler's code is a percent or two longer.
const MOST_PERCENT: u64 = 96;

pub struct Regions(BTreeMap<String, Range<u64>>);

impl Regions {
    /// Reads `boards/BOARD/SCRIPT`.
    pub fn of(board: &str, script: &str) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../boards").join(board).join(script);
        let text = std::fs::read_to_string(&path).unwrap_or_else(|why| panic!("{}: {why}", path.display()));
        let regions = text.lines().filter_map(|line| {
            let (name, rest) = line.split_once(" : ORIGIN = ").or_else(|| line.split_once(": ORIGIN = "))?;
            let (origin, length) = rest.split_once(", LENGTH = ")?;
            let origin = sum(origin);
            Some((name.trim().to_owned(), origin..origin + sum(length)))
        });
        Self(regions.collect())
    }

    pub fn get(&self, name: &str) -> Range<u64> {
        self.0.get(name).unwrap_or_else(|| panic!("no region {name}: {:?}", self.0)).clone()
    }

    /// Every section is in one of the regions, and of flash and RAM something is left.
    pub fn hold(&self, image: &Image) {
        for section in &image.sections {
            let place = self.0.values().find(|region| region.contains(&section.address));
            assert!(place.is_some_and(|region| section.address + section.bytes <= region.end), "{section:?}");
        }
        for (name, bytes) in [("FLASH", image.flash_bytes()), ("RAM", image.ram_bytes())] {
            let region = self.get(name);
            let all = region.end - region.start;
            println!("{name}: {bytes} of {all} bytes");
            assert!(100 * bytes <= MOST_PERCENT * all, "{bytes} of {all} bytes of {name}: nothing to spare");
        }
    }
}

/// A number of a linker script: `0x100`, `256K`, `1M - 64K`.
fn sum(text: &str) -> u64 {
    let number = |word: &str| {
        let (digits, unit) = match word.as_bytes().last() {
            Some(b'K') => (&word[..word.len() - 1], 1 << 10),
            Some(b'M') => (&word[..word.len() - 1], 1 << 20),
            _ => (word, 1),
        };
        let value = match digits.strip_prefix("0x") {
            Some(hexadecimal) => u64::from_str_radix(hexadecimal, 16),
            None => digits.parse(),
        };
        unit * value.unwrap_or_else(|why| panic!("{word}: {why}"))
    };
    text.split(" - ").map(|word| number(word.trim())).reduce(|all, less| all - less).unwrap()
}

#[test]
fn regions_are_read_as_the_linker_does() {
    assert_eq!(
        [sum("256K"), sum("0x24000000"), sum("1M - 64K"), sum("98000")],
        [262_144, 0x2400_0000, 983_040, 98_000]
    );
    let regions = Regions::of("nucleo-g474re", "regions.x");
    assert_eq!((regions.get("FLASH"), regions.get("RAM")), (0x0800_0000..0x0804_0000, 0x2000_0800..0x2002_0000));
}
