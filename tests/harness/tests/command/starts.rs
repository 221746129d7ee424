//! `viewshed starts`: starts and gaps judged beside a unit that has run since before.

use std::process::Command;

use serde_json::Value;

const MOTORWAY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/motorway.mcap");

#[test]
fn a_start_and_a_gap_call_no_more_of_what_is_hidden_visible_than_a_unit_that_has_run() {
    let json = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("starts.json");
    let output = Command::new(env!("CARGO_BIN_EXE_viewshed"))
        .args([
            "starts", MOTORWAY, "--times", "5", "--run-in", "10", "--watch", "15", "--gaps", "2", "--force", "--json",
        ])
        .arg(&json)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("5 starts") && text.contains("5 gaps of 2 s") && text.contains("FVR known"), "{text}");
    let result: Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    for outcome in result["outcomes"].as_array().unwrap() {
        let seconds = outcome["seconds"].as_array().unwrap();
        assert_eq!(seconds.len(), 15);
        let sum = |unit: &str, of: &str, from: usize| -> f64 {
            seconds[from..].iter().map(|second| second[unit][of].as_u64().unwrap() as f64).sum()
        };
        let fvr = |unit: &str, of: &str| sum(unit, "blocked_visible", 0) / sum(unit, of, 0);
        assert!(sum("running", "blocked", 0) > 1000.0);
        assert!(fvr("after", "blocked") <= 1.25 * fvr("running", "blocked"), "{outcome}");
        assert!(fvr("after", "blocked_known") <= 1.25 * fvr("running", "blocked_known"), "{outcome}");
        // and is not timid: 2 s after a start
        assert!(sum("after", "clear_visible", 2) >= 0.6 * sum("after", "clear", 2), "{outcome}");
        assert!(sum("after", "blocked_known", 2) >= 0.5 * sum("after", "blocked", 2), "{outcome}");
        let first = &seconds[0]["after"];
        assert!(first["blocked_visible"].as_u64().unwrap() * 20 <= first["blocked"].as_u64().unwrap(), "{first}");
    }
}

#[test]
fn a_recording_that_is_too_short_or_has_no_labels_is_refused_by_name() {
    let output =
        Command::new(env!("CARGO_BIN_EXE_viewshed")).args(["starts", MOTORWAY, "--run-in", "60"]).output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && text.contains("motorway") && text.contains("60 s before"), "{text}");
}
