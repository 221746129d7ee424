//! `radar_msgs/msg/RadarScan` in an MCAP file, as Autoware's drivers publish it.

use std::collections::BTreeMap;
use std::io::Cursor;

use serde_json::{Value, json};
use viewshed_harness::recording::ros::{Header, RadarReturn, RadarScan, Stamp, encode};
use viewshed_harness::recording::{ReadOptions, read};

use crate::scene::{folder, json, replay, stderr};

/// Two seconds of a car on the left that comes nearer, on a topic of the driver's own.
fn file() -> Vec<u8> {
    let mut writer = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
    let schema = writer.add_schema("radar_msgs/msg/RadarScan", "ros2msg", b"").unwrap();
    let channel_id = writer.add_channel(schema, "/sensing/radar/front/scan", "cdr", &BTreeMap::new()).unwrap();
    for i in 0..30_u32 {
        let time_ns = 5_000_000_000 + i64::from(i) * 66_000_000;
        let scan = RadarScan {
            header: Header { stamp: Stamp::from_nanoseconds(time_ns), frame_id: "radar_front".into() },
            returns: vec![
                RadarReturn {
                    range: 60.0 - i as f32 * 0.6,
                    azimuth: 0.1,
                    elevation: -0.05,
                    doppler_velocity: -9.0,
                    amplitude: 22.0,
                },
                RadarReturn { range: f32::NAN, azimuth: 0.0, elevation: 0.0, doppler_velocity: 0.0, amplitude: 0.0 },
            ],
        };
        let header =
            mcap::records::MessageHeader { channel_id, sequence: i, log_time: time_ns as u64, publish_time: 0 };
        writer.write_to_known_channel(&header, &encode(&scan).unwrap()).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn a_radar_scan_is_found_by_its_type_and_replayed_without_rates() {
    let folder = folder("radar_scan");
    std::fs::write(folder.join("a.mcap"), file()).unwrap();
    let place = ["--mount", "0,0,5,0,3,0", "--fov", "-60,60,-15,15,1,150"];
    let output = replay(&folder, &[&["a.mcap", "--json", "r.json", "--out", "out"], &place[..]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let report = json(&folder.join("r.json"));
    assert_eq!((&report["input"]["frames"], &report["input"]["detections"]), (&json!(30), &json!(30)));
    let dropped = report["input"]["problems"].as_array().unwrap();
    assert!(dropped.iter().any(|p| p["what"].as_str().unwrap().contains("not finite") && p["count"] == 30));
    assert!(report["estimators"].as_array().unwrap().iter().all(|e| e["fvr"] == Value::Null));
    assert!(folder.join("out/birdseye-radar-3d.png").exists());
}

#[test]
fn a_radar_scans_signs_and_units_are_ours() {
    let folder = folder("radar_scan_signs");
    std::fs::write(folder.join("a.mcap"), file()).unwrap();
    let options = ReadOptions {
        mount: Some([0.0, 0.0, 5.0, 0.0, 0.0, 0.0]),
        field_of_view: Some(viewshed_harness::recording::FieldOfView {
            azimuth_rad: [-1.0, 1.0],
            elevation_rad: [-0.3, 0.3],
            range_m: [1.0, 100.0],
        }),
        ..Default::default()
    };
    let recording = read(&folder.join("a.mcap"), &options).unwrap();
    let d = recording.frames[0].detections[0];
    assert_eq!((d.range_m, d.azimuth_rad, d.elevation_rad), (60.0, 0.1, Some(-0.05)), "left and up are positive");
    assert_eq!((d.radial_velocity_mps, d.snr_db, d.rcs_dbsm), (-9.0, Some(22.0), None));
}
