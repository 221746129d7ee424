//! The library as its users have it: without the features of benches and tests.

use std::path::Path;
use std::process::Command;

#[test]
fn a_program_with_the_stable_names_and_no_others_does_all_there_is_to_do() {
    for features in ["", "board"] {
        let output = cargo(&["run", "--package", "viewshed-face", "--features", features]);
        assert_eq!(output.lines().last(), Some("the face is enough"));
    }
}

#[test]
fn the_examples_run() {
    let output = cargo(&["test", "--package", "viewshed-example"]);
    assert!(output.contains("2 passed") && output.contains("1 passed"), "{output}");
}

#[test]
fn examples_stay_short() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/examples/src");
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let lines = std::fs::read_to_string(&path).unwrap().lines().count();
        assert!(lines <= 80, "{}: {lines} lines", path.display());
    }
}

/// Runs cargo; what it wrote.
fn cargo(arguments: &[&str]) -> String {
    let (command, rest) = arguments.split_first().unwrap();
    let output = Command::new(env!("CARGO"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args([command, "--quiet", "--offline", "--locked"])
        .args(rest)
        // its own: what is built beside the harness is built with the feature `bench`
        .arg("--target-dir")
        .arg(Path::new(env!("CARGO_TARGET_TMPDIR")).join("face"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}
