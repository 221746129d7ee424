//! Captures of a TI mmWave radar: replayed, and judged by the doctor.

use std::process::Command;

use serde_json::{Value, json};
use viewshed_harness::recording::{ReadOptions, read};

use crate::scene::{folder, json, replay, stderr};

/// A frame of SDK 3: a 40-byte header, points [x, y, z, velocity], and their side info.
fn frame(number: u32, points: &[[f32; 4]]) -> Vec<u8> {
    let words = |w: &[u32]| w.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
    let n = points.len() as u32;
    let mut items = Vec::new();
    if n > 0 {
        items.extend(words(&[1, 16 * n]));
        items.extend(points.iter().flatten().flat_map(|v| v.to_le_bytes()));
        items.extend(words(&[7, 4 * n]));
        items.extend((0..n).flat_map(|_| [200, 0, 0, 0]));
    }
    let total = (40 + items.len()).next_multiple_of(32);
    let count = if n > 0 { 2 } else { 0 };
    let mut bytes = vec![2, 1, 4, 3, 6, 5, 8, 7];
    bytes.extend(words(&[0x0305_0004, total as u32, 0xA6843, number, 0, n, count, 0]));
    bytes.extend(items);
    bytes.resize(total, 0);
    bytes
}

/// Three seconds of a car that comes nearer on the left, and a second of nothing.
fn capture() -> Vec<u8> {
    let car = |i: u32| frame(i, &[[-2.0, 50.0 - i as f32, -1.0, -10.0], [-2.5, 50.3 - i as f32, -1.2, -10.0]]);
    [(1..=30).flat_map(car).collect::<Vec<u8>>(), (31..=40).flat_map(|i| frame(i, &[])).collect()].concat()
}

fn judge(folder: &std::path::Path, bytes: &[u8]) -> (i32, Value) {
    std::fs::write(folder.join("a.bin"), bytes).unwrap();
    let arguments = ["doctor", "a.bin", "--json", "d.json"];
    let output = Command::new(env!("CARGO_BIN_EXE_viewshed")).current_dir(folder).args(arguments).output().unwrap();
    assert!(!stderr(&output).contains("panicked"));
    (output.status.code().unwrap(), json(&folder.join("d.json")))
}

#[test]
fn a_capture_is_replayed_from_its_first_frame_on() {
    let folder = folder("ti");
    std::fs::write(folder.join("a.bin"), capture()).unwrap();
    let recording = read(&folder.join("a.bin"), &ReadOptions::default()).unwrap();
    assert_eq!((recording.frames.len(), recording.sensor.has_elevation), (40, true));
    let [first, ..] = recording.frames[0].detections[..] else { panic!() };
    // x = -2 m is 2 m to the left
    assert!((f64::from(first.azimuth_rad) - (2.0_f64 / 49.0).atan()).abs() < 2e-4);
    assert_eq!((first.radial_velocity_mps, first.snr_db), (-10.0, Some(20.0)));
    assert_eq!(recording.frames[1].time_ns - recording.frames[0].time_ns, 100_000_000);
    assert_eq!(recording.problems.count("holds no times"), 1);
    let output = replay(
        &folder,
        &["a.bin", "--frame-period", "0.05", "--mount", "0,0,5,0,3,0", "--json", "r.json", "--out", "out"],
    );
    assert!(output.status.success(), "{}", stderr(&output));
    let report = json(&folder.join("r.json"));
    assert_eq!(report["input"]["frames"], json!(40));
    assert!((report["input"]["duration_s"].as_f64().unwrap() - 1.95).abs() < 1e-9);
    assert_eq!(report["estimators"][2]["fvr"], Value::Null);
    assert!(folder.join("out/birdseye-radar-3d.png").exists());
}

#[test]
fn a_header_that_cannot_be_learnt_has_to_be_named() {
    let folder = folder("ti_header");
    let bytes: Vec<u8> = (1..4).flat_map(|i| frame(i, &[[0.0, 20.0, 0.0, 1.0]])).collect();
    std::fs::write(folder.join("a.bin"), bytes).unwrap();
    let output = replay(&folder, &["a.bin"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("--ti-header"), "{}", stderr(&output));
    let output = replay(&folder, &["a.bin", "--ti-header", "40", "--json", "r.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(json(&folder.join("r.json"))["input"]["frames"], json!(3));
    assert_eq!(replay(&folder, &["a.bin", "--ti-header", "41"]).status.code(), Some(2));
}

#[test]
fn the_doctor_says_what_a_capture_holds_and_lacks() {
    let folder = folder("ti_doctor");
    let (code, report) = judge(&folder, &capture());
    assert_eq!(
        (code, &report["header"], &report["scans"], &report["empty_scans"]),
        (0, &json!(40), &json!(40), &json!(10))
    );
    assert_eq!(report["items"], json!({"1": 30, "7": 30}));
    assert_eq!(report["findings"], json!([]));
    // a frame is lost, two are cut, and rubbish lies before the first
    let mut bytes = b"sensorStart\r\nDone\r\n".to_vec();
    for i in (1..30).filter(|i| *i != 9) {
        let mut one = frame(i, &[[0.0, 20.0, 0.0, 1.0]]);
        one.truncate(if i % 12 == 0 { 50 } else { one.len() });
        bytes.extend(one);
    }
    let (code, report) = judge(&folder, &bytes);
    assert_eq!((code, &report["scans"], &report["counters"]["byte outside of frames"]), (0, &json!(26), &json!(19)));
    let what: Vec<&str> = report["findings"].as_array().unwrap().iter().map(|f| f["what"].as_str().unwrap()).collect();
    assert!(what[0].starts_with("2 frames are damaged") && what[1].starts_with("3 frames never came"), "{what:?}");
    // frames without points
    let silent: Vec<u8> = (0..9).flat_map(|i| frame(i, &[])).collect();
    let (code, report) = judge(&folder, &silent);
    assert_eq!(code, 1);
    assert!(report["findings"][0]["do"].as_str().unwrap().contains("guiMonitor"));
}
