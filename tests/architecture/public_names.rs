//! The library's public names, as `cargo doc` lists them on the page of all items.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// Public names there may be: what a user has to look through. To be made fewer.
const MOST: usize = 481;

#[test]
fn the_face_stays_small() {
    let counted = counted(&all_items());
    println!("{counted:#?}");
    let names: usize = counted.values().sum();
    assert!(names > 20, "{names} names were found on the page of all items: has rustdoc changed it?");
    assert!(names <= MOST, "{names} public names, and {MOST} may be: make new ones pub(crate)");
    assert!(names + 20 > MOST, "{names} public names: lower the limit of {MOST}");
}

/// Names by kind.
fn counted(page: &str) -> BTreeMap<String, usize> {
    let lists = page.split("<h3 id=\"").skip(1);
    let kind = |list: &str| {
        let kind = list.split('"').next().unwrap_or_default().to_owned();
        (kind, list.matches("<li><a href=").count())
    };
    lists.map(kind).collect()
}

/// rustdoc's page of all items, made without optional features.
fn all_items() -> String {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("public_names");
    let output = Command::new(env!("CARGO"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["doc", "--quiet", "--offline", "--locked", "--no-deps", "--lib", "--package", "viewshed"])
        .arg("--target-dir")
        .arg(&target)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    std::fs::read_to_string(target.join("doc/viewshed/all.html")).unwrap()
}

#[test]
fn names_are_counted_by_kind() {
    let page = "<h1>List of all items</h1><h3 id=\"structs\">Structs</h3><ul class=\"all-items\">\
                <li><a href=\"a.html\">A</a></li><li><a href=\"b.html\">B</a></li></ul>\
                <h3 id=\"functions\">Functions</h3><ul class=\"all-items\"><li><a href=\"f.html\">f</a></li></ul>";
    assert_eq!(counted(page), [("functions".to_owned(), 1), ("structs".to_owned(), 2)].into());
}
