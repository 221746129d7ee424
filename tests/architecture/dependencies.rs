//! No crate asks for another that it does not use.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::files::{below, name};

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
    for path in below(root, &["Cargo.toml"], &|_| false) {
        let folder = path.parent().unwrap();
        let sources = sources(folder, folder == root);
        let (manifest, folder) = (fs::read_to_string(&path).unwrap(), name(folder, root));
        for dependency in dependencies(&manifest) {
            looked += 1;
            let identifier = dependency.replace('-', "_");
            let word = |c: char| !c.is_alphanumeric() && c != '_';
            let used = sources.iter().any(|text| text.split(word).any(|found| found == identifier));
            if !used {
                unused.insert(format!("{folder}: {dependency}"));
            }
        }
    }
    assert!(looked > 60, "{looked} dependencies were found: are these the right files?");
    unused.retain(|found| UNUSED.iter().all(|(known, _)| known != found));
    assert!(unused.is_empty(), "used by no source: {unused:#?}");
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
    let is_another = |path: &Path| !is_root && path.join("Cargo.toml").exists();
    let code = |path: &Path| -> String {
        let text = fs::read_to_string(path).unwrap();
        text.lines().map(|line| line.split("//").next().unwrap_or_default().to_owned() + "\n").collect()
    };
    below(folder, &[".rs"], &is_another).iter().map(|path| code(path)).collect()
}
