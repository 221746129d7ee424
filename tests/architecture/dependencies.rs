//! No crate asks for another that it does not use.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Used by no source, and why they are asked for.
const UNUSED: [(&str, &str); 10] = [
    ("boards/nucleo-g474re: cortex-m-rt", "named by macros of embassy and stm32"),
    ("boards/nucleo-g474re: embassy-time", "named by macros of embassy and stm32"),
    ("boards/nucleo-g474re: static_cell", "named by macros of embassy and stm32"),
    ("boards/nucleo-h743zi: cortex-m-rt", "named by macros of embassy and stm32"),
    ("boards/nucleo-h743zi: embassy-time", "named by macros of embassy and stm32"),
    ("boards/nucleo-h743zi: static_cell", "named by macros of embassy and stm32"),
    ("tests/harness: bytemuck", "features for one build of all commands"),
    ("tests/harness: either", "features for one build of all commands"),
    ("tests/harness: libm", "features for one build of all commands"),
    ("tests/harness: syn", "features for one build of all commands"),
];

#[test]
fn every_dependency_is_used() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut unused, mut looked) = (BTreeSet::new(), 0);
    for folder in crates(root) {
        let manifest = fs::read_to_string(root.join(&folder).join("Cargo.toml")).unwrap();
        let sources = sources(&root.join(&folder), folder.is_empty());
        for name in dependencies(&manifest) {
            looked += 1;
            let identifier = name.replace('-', "_");
            let word = |c: char| !c.is_alphanumeric() && c != '_';
            let used = sources.iter().any(|text| text.split(word).any(|found| found == identifier));
            if !used {
                unused.insert(format!("{folder}: {name}"));
            }
        }
    }
    assert!(looked > 60, "{looked} dependencies were found: are these the right files?");
    unused.retain(|found| UNUSED.iter().all(|(known, _)| known != found));
    assert!(unused.is_empty(), "used by no source: {unused:#?}");
}

/// Folders with a crate, from the root, whose own is "".
fn crates(root: &Path) -> Vec<String> {
    let (mut all, mut folders) = (Vec::new(), vec![root.to_owned()]);
    while let Some(folder) = folders.pop() {
        if folder.join("Cargo.toml").exists() {
            all.push(folder.strip_prefix(root).unwrap().display().to_string());
        }
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() && !name.starts_with('.') && !["target", "out", "src"].contains(&name.as_str()) {
                folders.push(path);
            }
        }
    }
    all
}

/// Names by which a crate's dependencies are used.
fn dependencies(manifest: &str) -> Vec<String> {
    let mut inside = false;
    let mut all = Vec::new();
    for line in manifest.lines() {
        if line.starts_with('[') {
            inside = line.trim_end_matches(']').ends_with("dependencies");
        } else if let Some((name, _)) = line.split_once(" = ").filter(|(name, _)| inside && !name.starts_with('#')) {
            all.push(name.trim_end_matches(".workspace").to_owned());
        }
    }
    all
}

/// All of a crate's sources; those of the root lie beside the crates in its folders.
fn sources(folder: &Path, is_root: bool) -> Vec<String> {
    let (mut all, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(at) = folders.pop() {
        if at != folder && !is_root && at.join("Cargo.toml").exists() {
            continue;
        }
        for entry in fs::read_dir(&at).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() && !name.starts_with('.') && name != "target" && name != "out" {
                folders.push(path);
            } else if path.extension().is_some_and(|kind| kind == "rs") {
                let text = fs::read_to_string(path).unwrap();
                all.push(
                    text.lines().map(|line| line.split("//").next().unwrap_or_default().to_owned() + "\n").collect(),
                );
            }
        }
    }
    all
}
