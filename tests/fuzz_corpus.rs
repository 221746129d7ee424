//! The fuzz targets on their kept inputs, and on changes of these, by a plain compiler.
//!
//! `tests/fuzz.sh` runs them for longer and looks for new paths.

#[path = "shadows/mod.rs"]
mod shadows;
#[path = "fuzz/src/lib.rs"]
mod targets;

use std::path::Path;

use shadows::Random;

/// Changes of each kept input.
const CHANGES: usize = if cfg!(debug_assertions) { 100 } else { 1000 };

fn replay(target: &str, run: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus").join(target);
    let mut kept: Vec<Vec<u8>> =
        std::fs::read_dir(&folder).unwrap().map(|entry| std::fs::read(entry.unwrap().path()).unwrap()).collect();
    assert!(!kept.is_empty(), "no inputs in {}", folder.display());
    kept.sort();
    let mut random = Random::new(1);
    run(&[]);
    for input in &kept {
        run(input);
        for _ in 0..CHANGES {
            run(&changed(input, &kept, &mut random));
        }
    }
}

/// Some bytes other, some gone, some twice, or the rest of another input behind.
fn changed(input: &[u8], kept: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let mut bytes = input.to_vec();
    for _ in 0..=random.below(8) {
        if bytes.is_empty() {
            break;
        }
        let at = random.below(bytes.len() as u64) as usize;
        let end = (at + 1 + random.below(16) as usize).min(bytes.len());
        match random.below(6) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = [0, 1, 127, 128, 254, 255][random.below(6) as usize],
            2 => bytes[at] = random.next() as u8,
            3 => drop(bytes.drain(at..end)),
            4 => {
                let again = bytes[at..end].to_vec();
                bytes.splice(at..at, again);
            }
            _ => {
                let other = &kept[random.below(kept.len() as u64) as usize];
                bytes.truncate(at);
                bytes.extend(&other[random.below(other.len() as u64 + 1) as usize..]);
            }
        }
    }
    bytes
}

#[test]
fn ars408() {
    replay("ars408", targets::ars408::run);
}

#[test]
fn can_service() {
    replay("can_service", targets::can_service::run);
}

#[test]
fn native() {
    replay("native", targets::native::run);
}

#[test]
fn settings() {
    replay("settings", targets::settings::run);
}

#[test]
fn ti() {
    replay("ti", targets::ti::run);
}

#[test]
fn wire_block() {
    replay("wire_block", targets::wire_block::run);
}

#[test]
fn wire_maps() {
    replay("wire_maps", targets::wire_maps::run);
}

#[cfg(feature = "secoc")]
#[test]
fn wire_messages() {
    replay("wire_messages", targets::wire_messages::run);
}

#[test]
fn wire_receiver() {
    replay("wire_receiver", targets::wire_receiver::run);
}

#[cfg(feature = "secoc")]
#[test]
fn wire_secured() {
    replay("wire_secured", targets::wire_secured::run);
}

#[test]
fn every_target_has_inputs_and_a_binary() {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz");
    let names = |folder: &str, ending: &str| {
        let entries = std::fs::read_dir(fuzz.join(folder)).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.map(|name| name.trim_end_matches(ending).to_owned()).collect();
        names.retain(|name| name != "lib");
        names.sort();
        names
    };
    let source = include_str!("fuzz_corpus.rs");
    assert_eq!(names("corpus", ""), names("src", ".rs"));
    assert_eq!(names("fuzz_targets", ".rs"), names("src", ".rs"));
    for name in names("src", ".rs") {
        assert!(source.contains(&format!("replay(\"{name}\", targets::{name}::run);")), "{name} is not replayed");
    }
}
