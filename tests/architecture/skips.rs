//! The end of a test run: what was skipped is said, and fails `.ci/run` unless `.ci/skips` permits it.

use std::fs::{copy, create_dir_all, read_dir, read_to_string, write};
use std::path::{Path, PathBuf};
use std::process::Command;

fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A project of the scripts alone, whose steps are these: `.ci/run` and `tests/all.sh` end with what they printed last.
fn ended(test: &str, steps: &str) -> [(bool, Vec<String>); 2] {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("skips-{test}"));
    for part in [".ci", "tests"] {
        create_dir_all(folder.join(part)).unwrap();
    }
    for file in [".ci/run", ".ci/skips", "tests/all.sh", "tests/summary.sh", "tests/tools.sh"] {
        copy(project().join(file), folder.join(file)).unwrap();
    }
    write(folder.join("tests/steps.sh"), steps).unwrap();
    [".ci/run", "tests/all.sh"].map(|script| {
        let output = Command::new(folder.join(script)).env_remove("VIEWSHED_PERMITTED_SKIPS").output().unwrap();
        let lines = String::from_utf8(output.stdout).unwrap();
        (output.status.success(), lines.lines().map(str::to_owned).collect())
    })
}

const PASSED: &str =
    "run echo 'test result: ok. 7 passed; 0 failed; 2 ignored; 0 measured; 0 filtered out; finished in 0.1s'\n";

#[test]
fn a_board_that_is_skipped_fails_the_run_and_is_named() {
    let steps = format!("{PASSED}run echo 'skipped: zcu102-r5: no compiler'\n{PASSED}");
    let [ci, made_up] = ended("board", &steps);
    assert!(!ci.0 && made_up.0, "{ci:?} {made_up:?}");
    for (_, lines) in [&ci, &made_up] {
        assert_eq!(lines.last().unwrap(), "14 passed, 0 failed, 1 skipped");
        let summary = lines.iter().position(|line| line == "== summary").unwrap();
        assert!(lines[summary..].iter().any(|line| line == "skipped: zcu102-r5: no compiler"), "{lines:?}");
        assert!(lines[summary..].iter().filter(|line| line.starts_with("test result:")).count() == 2, "{lines:?}");
    }
    assert!(ci.1.iter().any(|line| line == "not permitted by .ci/skips: zcu102-r5"), "{ci:?}");
}

#[test]
fn a_permitted_skip_passes_and_counts_once() {
    // a runner with one thread writes the test's name before it
    let said = "test buses::come ... skipped: vcan: frames come and go: Operation not supported";
    let steps =
        format!("run echo 'skipped: vcan: a bus-off: Unknown device type'\nrun echo '{said}'\nrun echo '{said}'\n");
    for (passes, lines) in ended("permitted", &steps) {
        assert!(passes && lines.last().unwrap() == "0 passed, 0 failed, 2 skipped", "{lines:?}");
    }
}

#[test]
fn failures_are_counted_whether_or_not_a_test_could_run() {
    let failing = "test result: FAILED. 3 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.1s";
    let steps = format!("{PASSED}run sh -c 'echo \"{failing}\"; exit 1'\nrun false --step\n");
    for (passes, lines) in ended("failures", &steps) {
        assert!(!passes && lines.last().unwrap() == "10 passed, 3 failed, 0 skipped", "{lines:?}");
        assert!(
            lines.iter().filter(|line| *line == "failed: false --step").count() == 2,
            "said at once, and in the end"
        );
    }
}

#[test]
fn what_may_be_lacking_has_its_reason_and_is_no_board() {
    let permitted = read_to_string(project().join(".ci/skips")).unwrap();
    let permitted: Vec<&str> = permitted.lines().filter(|line| !line.starts_with('#')).collect();
    assert!(permitted.len() < 5, "a short list: {permitted:?}");
    let boards = read_dir(project().join("boards")).unwrap().map(|entry| entry.unwrap().file_name());
    let boards: Vec<String> = boards.map(|name| name.into_string().unwrap()).collect();
    assert!(boards.len() > 5, "{boards:?}");
    for line in permitted {
        let (lack, why) = line.split_once(": ").unwrap();
        assert!(why.len() > 30 && !lack.contains(' '), "{line}");
        assert!(!boards.iter().any(|board| board.starts_with(lack)), "{line}");
    }
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// The runner keeps to itself what a test that passes has printed, so a skip goes past it, and in one place.
#[test]
fn every_skip_of_a_test_is_seen() {
    let mut found = Vec::new();
    for folder in ["tests", "boards"] {
        sources(&project().join(folder), &mut found);
    }
    assert!(found.len() > 100);
    let prints = |path: &PathBuf| read_to_string(path).unwrap().contains("(\"skipped: ");
    let others = found.iter().filter(|path| !path.ends_with("common/skipped.rs") && !path.ends_with(file!()));
    let others: Vec<&PathBuf> = others.filter(|path| prints(path)).collect();
    assert!(others.is_empty(), "use tests/common/skipped.rs: {others:?}");
}

/// Scripts have one function for it, which knows what they were asked for.
#[test]
fn a_skip_is_a_failure_only_where_things_are_to_be_made_ready() {
    let ended = |arguments: &[&str]| {
        let script = ["-c", ". tests/tools.sh; skip vcan 'no bus'; echo and went on", "sh"];
        let output = Command::new("sh").args(script).args(arguments).current_dir(project()).output().unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap())
    };
    let said = "skipped: vcan: no bus\n";
    for (arguments, code) in [(&[][..], 0), (&["--build"], 0), (&["5"], 0), (&["--install"], 1)] {
        assert_eq!(ended(arguments), (Some(code), said.to_owned()), "{arguments:?}");
    }
    let scripts = read_dir(project().join("tests")).unwrap().map(|entry| entry.unwrap().path());
    let say = |path: &PathBuf| read_to_string(path).unwrap().contains("echo \"skipped: ");
    let mut found: Vec<_> =
        scripts.filter(|path| path.extension().is_some_and(|extension| extension == "sh")).filter(say).collect();
    found.sort();
    // that of the boards goes on with the next one
    assert!(found.len() == 2 && found[0].ends_with("firmware.sh") && found[1].ends_with("tools.sh"), "{found:?}");
}

/// The boards' tests are ignored unless a script asks for them by a part of their names.
#[test]
fn every_board_test_is_asked_for_by_a_script() {
    let [firmware, linux] =
        ["firmware", "linux"].map(|n| read_to_string(project().join(format!("tests/{n}.sh"))).unwrap());
    let filters = ["mps2", "zcu102", "nucleo"];
    assert!(
        filters.iter().all(|filter| firmware.contains(&format!(" {filter} \""))) && linux.contains("--ignored linux")
    );
    let folder = project().join("tests/harness/tests");
    let mut found = Vec::new();
    sources(&folder, &mut found);
    let mut tests = Vec::new();
    for path in found {
        let text = read_to_string(&path).unwrap();
        for rest in text.split("#[ignore = \"needs ").skip(1) {
            let name = rest.split_once("fn ").unwrap().1.split('(').next().unwrap();
            tests.push(format!("{} {name}", path.strip_prefix(&folder).unwrap().display()));
        }
    }
    assert!(tests.len() > 40, "{tests:?}");
    tests.retain(|test| !filters.iter().chain(&["linux"]).any(|filter| test.contains(filter)));
    assert!(tests.is_empty(), "{tests:?}");
}
