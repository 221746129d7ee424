//! The page for the next developer names files that exist.

use std::path::Path;

#[test]
fn every_file_that_is_named_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("src/EXTENDING.md")).unwrap();
    let quoted = page.split('`').skip(1).step_by(2);
    let is_place = |text: &&str| ["src/", "tests/", "boards/"].iter().any(|top| text.starts_with(top));
    let named: Vec<&str> = quoted.filter(is_place).filter(|text| !text.contains("NAME")).collect();
    assert!(named.len() > 30, "{named:?}");
    for place in named {
        assert!(root.join(place).exists(), "{place} is no file: correct src/EXTENDING.md");
    }
}
