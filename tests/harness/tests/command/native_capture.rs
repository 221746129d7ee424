//! Captures of the native scan format: a serial line, and CAN FD frames in a log.

use std::process::Command;

use serde_json::{Value, json};
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::frame::detection::Detection;
use viewshed::inputs::native::{NativeMedium, NativeSender, id};
use viewshed_harness::recording::can_log::{Content, Line};
use viewshed_harness::recording::{ReadOptions, read};

use crate::scene::{folder, json, replay, stderr};

/// What a radar measured in scan `i`: twelve reflections, two CAN FD frames and a half.
fn scan(i: u64) -> Vec<Detection> {
    let one = |n: u16| Detection {
        range_cm: 4000 + 300 * n - 50 * i as u16,
        azimuth: Angle::from_degrees(5.0 + f32::from(n)),
        elevation: Some(Angle::from_degrees(-2.0)),
        radial_velocity_cm_s: -750,
        rcs_half_dbsm: Some(10 + n as i16),
        snr_half_db: Some(40 + n as i16),
        marked: false,
    };
    (0..12).map(one).collect()
}

fn time(i: u64) -> Time {
    Time::from_micros(1_000_000 + i * 66_667)
}

/// Thirty scans of sensor 200 on a serial line; a byte is damaged in one of them.
fn line() -> Vec<u8> {
    let mut sender = NativeSender::new(200);
    let mut line = Vec::new();
    for i in 0..30 {
        for message in sender.scan(time(i), false, &scan(i), NativeMedium::Serial) {
            let mut stuffed = [0; 300];
            let n = message.stuff(&mut stuffed).unwrap();
            stuffed[20] ^= u8::from(i == 17);
            line.extend(&stuffed[..n]);
        }
    }
    line
}

/// The same as CAN FD frames of sensor 3, one of them lost.
fn log() -> String {
    let mut sender = NativeSender::new(3);
    let mut text = String::new();
    for i in 0..30 {
        for (part, message) in sender.scan(time(i), false, &scan(i), NativeMedium::CanFd).enumerate() {
            let line = Line {
                time_ns: (time(i).micros() as i64 + 400 * part as i64) * 1000,
                interface: "can1".into(),
                content: Content::Data(message.frame(id(3)).unwrap()),
            };
            if (i, part) != (8, 1) {
                text += &format!("{line}\n");
            }
        }
    }
    text
}

fn doctor(folder: &std::path::Path, name: &str) -> (i32, Value) {
    let arguments = ["doctor", name, "--json", "d.json", "--force"];
    let output = Command::new(env!("CARGO_BIN_EXE_viewshed")).current_dir(folder).args(arguments).output().unwrap();
    (output.status.code().unwrap(), json(&folder.join("d.json")))
}

#[test]
fn a_serial_capture_is_replayed() {
    let folder = folder("native");
    std::fs::write(folder.join("a.bin"), line()).unwrap();
    let recording = read(&folder.join("a.bin"), &ReadOptions::default()).unwrap();
    assert_eq!((recording.frames.len(), recording.sensor.name.as_str()), (29, "native sensor 200"));
    let (frame, sent) = (&recording.frames[1], scan(1));
    assert_eq!(frame.time_ns, 1_066_667_000, "the sender's own time");
    for (d, s) in frame.detections.iter().zip(&sent) {
        assert_eq!((d.range_m, d.radial_velocity_mps), (f32::from(s.range_cm) / 100.0, -7.5));
        assert_eq!((d.azimuth_rad, d.elevation_rad), (s.azimuth.radians(), s.elevation.map(Angle::radians)));
        let halves = |v: Option<f32>| v.map(|v| 2.0 * v);
        assert_eq!(halves(d.rcs_dbsm), s.rcs_half_dbsm.map(f32::from));
        assert_eq!(halves(d.snr_db), s.snr_half_db.map(f32::from));
    }
    assert_eq!(recording.problems.count("never came"), 1, "the damaged one");
    let output = replay(&folder, &["a.bin", "--mount", "0,0,5,0,2,0", "--json", "r.json", "--out", "out"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(json(&folder.join("r.json"))["input"]["frames"], json!(29));
    assert!(folder.join("out/birdseye-radar-3d.png").exists());
    let (code, report) = doctor(&folder, "a.bin");
    assert_eq!((code, &report["sensors"][0]["scans"]), (1, &json!(29)));
    assert!(report["findings"][0]["what"].as_str().unwrap().contains("1 messages are damaged"), "{report:#}");
}

#[test]
fn can_fd_frames_in_a_log_are_replayed() {
    let folder = folder("native_fd");
    std::fs::write(folder.join("a.log"), log()).unwrap();
    let recording = read(&folder.join("a.log"), &ReadOptions::default()).unwrap();
    assert_eq!((recording.frames.len(), recording.problems.count("parts are missing")), (30, 1));
    assert_eq!((recording.frames[7].detections.len(), recording.frames[8].detections.len()), (12, 7));
    let (code, report) = doctor(&folder, "a.log");
    assert_eq!((code, &report["kind"], &report["sensors"][0]["sensor"]), (1, &json!("native"), &json!(3)));
    assert!(report["findings"].as_array().unwrap().iter().any(|f| f["what"].as_str().unwrap().contains("never came")));
}
