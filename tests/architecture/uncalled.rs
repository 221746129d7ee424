//! No public function of the library is there for tests alone.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::files::{below, name};

/// Who has a use for the library.
const USERS: [&str; 6] =
    ["src", "boards", "tests/examples/src", "tests/harness/src", "tests/conformance/src", "tests/face/src"];

#[test]
fn every_public_function_is_called_by_more_than_tests() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut words: BTreeMap<String, usize> = BTreeMap::new();
    let mut defined: BTreeMap<String, (usize, String)> = BTreeMap::new();
    for folder in USERS {
        let folder_path = root.join(folder);
        let read = |path: PathBuf| (name(&path, &folder_path), fs::read_to_string(&path).unwrap());
        let sources: Vec<_> = below(&folder_path, &[".rs", ".md"], &|_| false).into_iter().map(read).collect();
        // whole files of tests, by the declaration in the file above
        let of_tests: BTreeSet<String> = sources.iter().flat_map(|(_, text)| declared_for_tests(text)).collect();
        for (path, text) in sources {
            let is_page = path.ends_with(".md");
            if of_tests.contains(path.rsplit('/').next().unwrap_or_default()) {
                continue;
            }
            // what a page of the library shows its users is wanted by them
            let code = if is_page { text } else { code(&text) };
            for word in code.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty()) {
                *words.entry(word.to_owned()).or_default() += 1;
            }
            if is_page {
                continue;
            }
            // of any function of this name: a trait's method is defined once more where it is implemented
            for part in code.split("fn ").skip(1) {
                let name: String = part.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                defined.entry(name).or_default().0 += 1;
            }
            if folder == "src" {
                for line in code.lines().map(str::trim_start).filter(|line| line.starts_with("pub ")) {
                    let Some((_, rest)) = line.split_once("fn ") else { continue };
                    let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                    defined.entry(name).or_default().1 = path.clone();
                }
            }
        }
    }
    let public: Vec<_> = defined.iter().filter(|(_, (_, path))| !path.is_empty()).collect();
    assert!(public.len() > 300, "{} public functions were found: is this the right folder?", public.len());
    let uncalled: BTreeSet<(&str, &str)> = public
        .into_iter()
        .filter(|(name, (definitions, _))| words.get(*name).copied().unwrap_or(0) <= *definitions)
        .map(|(name, (_, path))| (name.as_str(), path.as_str()))
        .collect();
    assert!(uncalled.is_empty(), "{} are called by tests only, or not at all: {uncalled:#?}", uncalled.len());
}

/// Files of `#[cfg(test)] mod NAME;`.
fn declared_for_tests(text: &str) -> Vec<String> {
    let names = text.split("#[cfg(test)]\nmod ").skip(1).filter_map(|rest| rest.lines().next()?.strip_suffix(';'));
    names.map(|name| format!("{name}.rs")).collect()
}

/// Without comments, and without what is for tests.
fn code(text: &str) -> String {
    let end = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
    let line = |line: &str| line.split("//").next().unwrap_or_default().to_owned() + "\n";
    text[..end].lines().map(line).collect()
}
