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
    let arguments = ["doctor", "a.bin", "--json", "d.json", "--force"];
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
    let output = replay(&folder, &["a.bin", "--ti-header", "40", "--warm-up", "0", "--json", "r.json"]);
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
    assert_eq!((code, &report["scans"], &report["counters"]["byte outside of frames"]), (1, &json!(26), &json!(19)));
    let what: Vec<&str> = report["findings"].as_array().unwrap().iter().map(|f| f["what"].as_str().unwrap()).collect();
    assert!(what[0].starts_with("2 frames are damaged") && what[1].starts_with("1 frames never came"), "{what:?}");
    let recording = read(&folder.join("a.bin"), &ReadOptions::default()).unwrap();
    assert_eq!((recording.problems.count("damaged, dropped"), recording.problems.count("never came")), (2, 1));
    // frames without points
    let silent: Vec<u8> = (0..9).flat_map(|i| frame(i, &[])).collect();
    let (code, report) = judge(&folder, &silent);
    assert_eq!(code, 1);
    assert!(report["findings"][0]["do"].as_str().unwrap().contains("guiMonitor"));
}

/// A frame after a header of 48 bytes: two compressed points and a target that comes nearer on the left.
fn people_counting(number: u32, points: bool) -> Vec<u8> {
    let floats = |v: &[f32]| v.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let words = |w: &[u32]| w.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
    let ahead = 3000 - 100 * number as u16;
    let mut items = Vec::new();
    if points {
        items.extend(words(&[6, 8 + 20 + 16]));
        items.extend(floats(&[0.01, 0.01, 0.1, 0.01, 1.0]));
        for azimuth in [246, 250] {
            items.extend([0, azimuth, 0xF6, 0xFF]);
            items.extend([ahead, 100].iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    items.extend(words(&[7, 8 + 112, 3]));
    items.extend(floats(&[-2.0, f32::from(ahead) / 100.0, 0.5, 0.0, -10.0, 0.0]));
    items.extend([0; 84]);
    let total = (48 + items.len()).next_multiple_of(32);
    let mut bytes = vec![2, 1, 4, 3, 6, 5, 8, 7];
    bytes.extend(words(&[0x0305_0004, total as u32, 0xA6843, number, 0, 0, 0, 0, 0, 1 + u32::from(points)]));
    bytes.extend(items);
    bytes.resize(total, 0);
    bytes
}

#[test]
fn a_header_of_48_bytes_is_learnt_and_targets_are_taken_on_demand() {
    let folder = folder("ti_48");
    let capture = |points| (0..25).flat_map(|i| people_counting(i, points)).collect::<Vec<u8>>();
    std::fs::write(folder.join("a.bin"), capture(true)).unwrap();
    let output = replay(&folder, &["a.bin", "--json", "r.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    // the first three taught it
    assert_eq!(json(&folder.join("r.json"))["input"]["frames"], json!(25));
    let (code, report) = judge(&folder, &capture(true));
    assert_eq!((code, &report["header"], &report["points"]), (0, &json!(48), &json!(50)));
    assert_eq!(report["items"], json!({"6": 25, "7": 25}));
    // a firmware that sends targets only
    let (code, report) = judge(&folder, &capture(false));
    assert_eq!((code, &report["points"]), (1, &json!(0)));
    assert!(report["findings"][0]["do"].as_str().unwrap().contains("--ti-dialect targets"));
    let arguments = ["doctor", "a.bin", "--ti-header", "48", "--ti-dialect", "targets", "--detections", "d.csv"];
    let output = Command::new(env!("CARGO_BIN_EXE_viewshed")).current_dir(&folder).args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let csv = std::fs::read_to_string(folder.join("d.csv")).unwrap();
    let first: Vec<&str> = csv.lines().nth(1).unwrap().split(',').collect();
    // 2 m to the left, 30 m ahead, 0.5 m up, 10 m/s nearer
    assert_eq!((first[2], first[3], first[5]), ("30.07", "3.8123", "-9.98"), "{first:?}");
    let output = replay(&folder, &["a.bin", "--ti-dialect", "targets", "--json", "r.json", "--force"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let output = replay(&folder, &["a.bin", "--ti-header", "40"]);
    assert_eq!(output.status.code(), Some(2), "another header gives no frame");
    assert_eq!(replay(&folder, &["a.bin", "--ti-dialect", "radian"]).status.code(), Some(2));
}
