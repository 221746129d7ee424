//! The product's public names, as `cargo doc` lists them, and a user who needs no others.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Public names there may be without features, and with the feature `board`: what a user, or who builds a unit, has
/// to look through.
const MOST: usize = 103;
const MOST_OF_BOARD: usize = 141;

#[test]
fn the_face_stays_small() {
    for (features, most) in [("", MOST), ("board", MOST_OF_BOARD)] {
        let pages = pages(features);
        let counted = counted(&fs::read_to_string(pages.join("all.html")).unwrap());
        println!("{features} {counted:#?}");
        println!("methods: {}", methods_in(&pages));
        let names: usize = counted.values().sum();
        assert!(names > 20, "{names} names were found on the page of all items: has rustdoc changed it?");
        assert!(names <= most, "{features}: {names} public names, and {most} may be: leave new ones to their rooms");
        assert!(names == most, "{features}: {names} public names: lower the limit of {most}");
    }
}

#[test]
fn and_is_enough_for_a_user() {
    for features in ["", "board"] {
        let output = cargo(&["run", "--package", "viewshed-face", "--features", features]);
        assert_eq!(output.lines().last(), Some("the face is enough"));
    }
}

#[test]
fn and_for_the_example() {
    let output = cargo(&["test", "--package", "viewshed-example"]);
    assert!(output.contains("2 passed"), "{output}");
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

/// Methods of the names themselves, those of implemented traits left out.
fn methods_in(folder: &Path) -> usize {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries
        .map(|path| if path.is_dir() { methods_in(&path) } else { methods(&fs::read_to_string(path).unwrap()) })
        .sum()
}

fn methods(page: &str) -> usize {
    let own = page.split("id=\"trait-implementations\"").next().unwrap_or_default();
    own.matches("<section id=\"method.").count() + own.matches("<section id=\"tymethod.").count()
}

/// rustdoc's pages, made with these optional features alone.
fn pages(features: &str) -> PathBuf {
    let made = target().join("doc/viewshed");
    // pages of names that are gone would stay
    let _ = fs::remove_dir_all(&made);
    cargo(&["doc", "--no-deps", "--lib", "--package", "viewshed", "--features", features]);
    made
}

/// Its own: what is built beside the harness is built with the feature `bench`.
fn target() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("public_names")
}

/// Runs cargo; what it wrote.
fn cargo(arguments: &[&str]) -> String {
    let (command, rest) = arguments.split_first().unwrap();
    let output = Command::new(env!("CARGO"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        // a link in the documentation that leads nowhere
        .env("RUSTDOCFLAGS", "-D rustdoc::broken_intra_doc_links -D rustdoc::private_intra_doc_links")
        .args([command, "--quiet", "--offline", "--locked"])
        .args(rest)
        .arg("--target-dir")
        .arg(target())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn names_are_counted_by_kind_and_methods_without_those_of_traits() {
    let page = "<h1>List of all items</h1><h3 id=\"structs\">Structs</h3><ul class=\"all-items\">\
                <li><a href=\"a.html\">A</a></li><li><a href=\"b.html\">B</a></li></ul>\
                <h3 id=\"functions\">Functions</h3><ul class=\"all-items\"><li><a href=\"f.html\">f</a></li></ul>";
    assert_eq!(counted(page), [("functions".to_owned(), 1), ("structs".to_owned(), 2)].into());
    let page = "<section id=\"method.new\" class=\"method\"></section><h2 id=\"trait-implementations\">\
                <section id=\"method.clone\" class=\"method trait-impl\"></section>";
    assert_eq!(methods(page), 1);
}
