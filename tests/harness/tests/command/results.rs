//! Figures have one home, and pages show what is there.

use std::path::Path;
use std::process::Command;

fn results(arguments: &[&str]) -> (Option<i32>, String) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let output = Command::new(env!("CARGO_BIN_EXE_viewshed"))
        .arg("results")
        .args(arguments)
        .arg("--root")
        .arg(root)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    (output.status.code(), text)
}

#[test]
fn figures_and_pages_are_as_they_were_measured() {
    let (code, said) = results(&["--check"]);
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn a_part_that_is_not_there_is_named_with_those_that_are() {
    let (code, said) = results(&["--only", "nothing"]);
    assert!(code == Some(2) && said.contains("--only nothing: tests/results.toml has shipped"), "{said}");
}
