//! `viewshed lanes`: learnt from recordings, and what it refuses.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::scene::{folder, json, stderr, stdout};

fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings").canonicalize().unwrap()
}

fn viewshed(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_viewshed")).current_dir(folder).args(arguments).output().unwrap()
}

#[test]
fn a_name_that_is_no_table_is_refused() {
    let folder = folder("lanes-table");
    for name in ["a b", "", "a..b", "lanes]", "\u{e4}"] {
        let output = viewshed(&folder, &["lanes", "absent.mcap", "--table", name]);
        let error = stderr(&output);
        assert!(output.status.code() == Some(2) && error.contains("a table's name is of letters"), "{name}: {error}");
    }
    let error = stderr(&viewshed(&folder, &["lanes", "absent.mcap", "--table", "estimators.my-lanes_2"]));
    assert!(error.contains("absent.mcap"), "{error}");
}

#[test]
fn lanes_of_a_recording_are_a_configuration_that_replay_takes() {
    let folder = folder("lanes-learnt");
    let motorway = shipped().join("motorway.mcap");
    let motorway = motorway.to_str().unwrap();
    let output = viewshed(&folder, &["lanes", motorway, "--to", "20", "--table", "estimators.lanes"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.lines().next().unwrap().ends_with("learnt from motorway.mcap"), "{text}");
    std::fs::write(folder.join("lanes.toml"), text).unwrap();
    let replayed = viewshed(
        &folder,
        &[
            "replay",
            motorway,
            "--from",
            "20",
            "--to",
            "22",
            "--config",
            "lanes.toml",
            "--json",
            "r.json",
            "--out",
            "map",
        ],
    );
    assert!(replayed.status.success(), "{}", stderr(&replayed));
    assert!(folder.join("map/birdseye-radar-3d-lanes.png").exists());
    let report = json(&folder.join("r.json"));
    assert!(report["estimators"].as_array().unwrap().iter().any(|e| e["name"] == "radar-3d-lanes"));
    assert!(report["options"]["estimators"]["lanes"].as_array().unwrap().len() >= 6);
}

#[test]
fn what_no_lanes_can_be_learnt_from_is_named() {
    let folder = folder("lanes-refused");
    let motorway = shipped().join("motorway.mcap");
    let net = shipped().join("crossing/wide.net.xml.gz");
    let [motorway, net] = [&motorway, &net].map(|path| path.to_str().unwrap());
    let said = |arguments: &[&str]| {
        let output = viewshed(&folder, &[&["lanes"], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{}", stdout(&output));
        stderr(&output)
    };
    assert!(said(&[net, motorway]).contains("a net goes alone"));
    let short = said(&[motorway, "--to", "0.5"]);
    assert!(short.contains("motorway.mcap: no two vehicles drive") && short.contains("longer recording"), "{short}");
    assert!(said(&[motorway, "--range", "50"]).contains("--range are of a net"));
    assert!(said(&["nowhere.mcap"]).contains("nowhere.mcap"));
    // the same radar, said to hang elsewhere in the second recording
    let queue = shipped().join("queue/train-1.toml");
    let made = viewshed(&folder, &["simulate", queue.to_str().unwrap(), "--duration", "1", "--out", "q.mcap"]);
    assert!(made.status.success(), "{}", stderr(&made));
    let elsewhere = said(&[motorway, "q.mcap"]);
    assert!(elsewhere.contains("q.mcap: its radar does not hang where that of"), "{elsewhere}");
}

#[test]
fn a_unit_that_ran_over_other_recordings_of_its_radar_has_a_row() {
    let folder = folder("lanes-run-in");
    let crossing = shipped().join("crossing/train-2.toml");
    let day = shipped().join("crossing/wide-day-1.fcd.xml.gz");
    let make = |name: &str, more: &[&str]| {
        let made = ["simulate", crossing.to_str().unwrap(), "--out", name];
        let made = viewshed(&folder, &[&made, more].concat());
        assert!(made.status.success(), "{}", stderr(&made));
    };
    make("monday.mcap", &["--duration", "30", "--seed", "7", "--fcd", day.to_str().unwrap()]);
    make("tuesday.mcap", &["--duration", "12"]);
    let motorway = shipped().join("motorway.mcap");
    let replayed =
        |arguments: &[&str]| viewshed(&folder, &[&["replay", "tuesday.mcap", "--run-in"], arguments].concat());
    let output = replayed(&["monday.mcap", "--from", "3", "--json", "r.json", "--out", "map"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(folder.join("map/birdseye-radar-3d-learning.png").exists());
    let report = json(&folder.join("r.json"));
    let row = |name| report["estimators"].as_array().unwrap().iter().find(|e| e["name"] == name).unwrap();
    let [usual, learning] = ["radar-3d", "radar-3d-learning"].map(row);
    assert_eq!(usual["counters"], learning["counters"], "what it ran over before is not counted");
    assert_ne!(usual["cells"], learning["cells"]);
    // azimuth's noise alone, which is learnt before too, would change cells
    assert!(learning["learnt_lanes"].as_u64().is_some_and(|places| places > 100), "{}", learning["learnt_lanes"]);
    assert!(usual["learnt_lanes"].is_null() && stdout(&output).contains("in radar-3d-learning."));
    let said = |arguments: &[&str]| {
        let output = replayed(arguments);
        assert_eq!(output.status.code(), Some(2), "{}", stdout(&output));
        stderr(&output)
    };
    let itself = said(&["tuesday.mcap", "--to", "5"]);
    assert!(itself.contains("--run-in tuesday: it has frames of tuesday itself"), "{itself}");
    let elsewhere = said(&[motorway.to_str().unwrap()]);
    assert!(elsewhere.contains("--run-in motorway: its radar does not hang where that of tuesday does"), "{elsewhere}");
    assert!(said(&["nowhere.mcap"]).contains("--run-in nowhere.mcap"));
}
