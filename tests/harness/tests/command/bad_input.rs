//! Input that is bad: a clear error with exit code 2, or counted; nothing invented, no panic.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use serde_json::{Value, json};
use viewshed_harness::recording::ros::{Header, PointCloud2, PointField, Stamp, encode};

use crate::scene::{FRAMES, PERIOD_NS, Scene, folder, json, replay, stderr, stdout, viewshed};

/// Replays one file; exit code, standard error and report.
fn outcome(folder: &Path, arguments: &[&str]) -> (i32, String, Value) {
    let report = folder.join("r.json");
    let _ = std::fs::remove_file(&report);
    let output = replay(folder, &[arguments, &["--json", "r.json", "--bootstrap", "20"]].concat());
    let text = stderr(&output);
    assert!(!text.contains("panicked"), "{text}");
    (output.status.code().unwrap(), text, if report.exists() { json(&report) } else { Value::Null })
}

fn problem(report: &Value, what: &str) -> u64 {
    let problems = report["input"]["problems"].as_array().unwrap();
    problems.iter().filter(|p| p["what"].as_str().unwrap().contains(what)).map(|p| p["count"].as_u64().unwrap()).sum()
}

/// A file with one topic of foreign content.
fn foreign(topic: &str, schema: &str, data: &[u8]) -> Vec<u8> {
    let mut writer = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
    let schema = writer.add_schema(schema, "ros2msg", b"").unwrap();
    let channel_id = writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap();
    let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, data).unwrap();
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn a_file_cut_anywhere_is_read_up_to_the_break_or_refused() {
    let folder = folder("cut");
    let whole = Scene::default().bytes();
    for tenth in 0..10 {
        std::fs::write(folder.join("cut.mcap"), &whole[..whole.len() * tenth / 10]).unwrap();
        let (code, text, report) = outcome(&folder, &["cut.mcap"]);
        if code == 0 {
            // behind the data stands an index, which nothing is missed of
            let all = report["input"]["frames"].as_u64().unwrap() == FRAMES as u64;
            assert!(all || problem(&report, "break") > 0, "cut at {tenth}/10 says so");
            assert!(all || tenth < 9);
        } else {
            assert_eq!(code, 2);
            assert!(text.starts_with("error: "), "{text}");
        }
    }
}

#[test]
fn what_is_no_recording_is_refused() {
    let folder = folder("foreign");
    std::fs::write(folder.join("text.mcap"), "time,x,y\n1,2,3\n").unwrap();
    let (code, text, _) = outcome(&folder, &["text.mcap"]);
    assert_eq!(code, 2);
    assert!(text.contains("text.mcap: not an MCAP file"), "{text}");
    let (code, text, _) = outcome(&folder, &["absent.mcap"]);
    assert_eq!(code, 2);
    assert!(text.contains("cannot read absent.mcap"), "{text}");
}

#[test]
fn a_foreign_schema_is_named_with_the_topics_found_and_the_option() {
    let folder = folder("schema");
    std::fs::write(folder.join("a.mcap"), foreign("/radar/points", "sensor_msgs/msg/Image", &[0, 1, 0, 0])).unwrap();
    let (code, text, _) = outcome(&folder, &["a.mcap"]);
    assert_eq!(code, 2);
    assert!(text.contains("sensor_msgs/msg/Image") && text.contains("--radar-topic"), "{text}");
    std::fs::write(folder.join("b.mcap"), foreign("/front/points", "sensor_msgs/msg/PointCloud2", &[])).unwrap();
    let (code, text, _) = outcome(&folder, &["b.mcap"]);
    assert_eq!(code, 2);
    assert!(text.contains("/front/points"), "{text}");
}

#[test]
fn a_missing_field_is_named_with_those_found() {
    let folder = folder("field");
    let field = |(k, name): (u32, &str)| PointField { name: name.into(), offset: 4 * k, datatype: 7, count: 1 };
    let cloud = PointCloud2 {
        header: Header { stamp: Stamp { sec: 1, nanosec: 0 }, frame_id: "radar".into() },
        height: 1,
        width: 1,
        fields: (0..).zip(["x", "y", "range"]).map(field).collect(),
        is_bigendian: false,
        point_step: 12,
        row_step: 12,
        data: vec![0; 12],
        is_dense: true,
    };
    let data = encode(&cloud).unwrap();
    std::fs::write(folder.join("a.mcap"), foreign("/radar/points", "sensor_msgs/msg/PointCloud2", &data)).unwrap();
    let (code, text, _) = outcome(&folder, &["a.mcap"]);
    assert_eq!(code, 2);
    assert!(text.contains("neither range and azimuth nor x, y and z; fields found: x, y, range"), "{text}");
}

#[test]
fn values_that_are_not_finite_or_no_range_are_counted() {
    let folder = folder("values");
    let mut scene = Scene::default();
    let detections = &mut scene.steps[20].0.detections;
    let mut wrong = detections[0];
    wrong.azimuth_rad = f32::NAN;
    detections.push(wrong);
    detections.push({
        let mut d = detections[0];
        d.range_m = -5.0;
        d
    });
    detections.push({
        let mut d = detections[0];
        d.range_m = 1e30;
        d
    });
    detections.push({
        let mut d = detections[0];
        d.radial_velocity_mps = f32::MAX;
        d
    });
    scene.save(&folder, "a");
    let (code, text, report) = outcome(&folder, &["a.mcap"]);
    assert_eq!(code, 0, "{text}");
    assert_eq!((problem(&report, "not finite"), problem(&report, "zero or below")), (1, 1));
    assert_eq!(report["objects"], json!(3));
}

#[test]
fn time_running_backwards_or_leaping_is_survived() {
    let folder = folder("time");
    let mut scene = Scene::default();
    for (frame, labels) in &mut scene.steps[30..] {
        frame.time_ns -= 10 * PERIOD_NS;
        labels.iter_mut().for_each(|l| l.time_ns = frame.time_ns);
    }
    for (frame, _) in &mut scene.steps[40..] {
        frame.time_ns += 3_000_000_000_000;
    }
    scene.save(&folder, "a");
    let (code, text, report) = outcome(&folder, &["a.mcap"]);
    assert_eq!(code, 0, "{text}");
    // a second copy of the same times, as by two recorders, and then a leap
    assert_eq!((problem(&report, "not in the order of time"), problem(&report, "no frames for 50 min")), (1, 1));
    assert_eq!(problem(&report, "joined by their times"), 10);
}

#[test]
fn empty_frames_and_crowded_frames_are_replayed() {
    let folder = folder("crowd");
    let mut scene = Scene::default();
    scene.steps[3].0.detections.clear();
    let one = scene.steps[20].0.detections[0];
    scene.steps[20].0.detections = (0..10_000)
        .map(|k| {
            let mut d = one;
            d.azimuth_rad = (k % 200) as f32 * 0.01 - 1.0;
            d.range_m = 3.0 + (k / 200) as f32 * 2.0;
            d
        })
        .collect();
    scene.save(&folder, "a");
    let (code, text, report) = outcome(&folder, &["a.mcap", "--mcap", "maps.mcap"]);
    assert_eq!(code, 0, "{text}");
    assert_eq!(report["input"]["frames"], json!(FRAMES));
}

#[test]
fn a_mount_below_ground_and_a_reversed_field_of_view_are_refused() {
    let folder = folder("mount");
    let mut buried = Scene::default();
    buried.pose.position[2] = -1.0;
    buried.save(&folder, "buried");
    let (code, text, _) = outcome(&folder, &["buried.mcap"]);
    assert_eq!(code, 2);
    assert!(text.contains("not above the road") && text.contains("--mount"), "{text}");
    let (code, text, _) = outcome(&folder, &["buried.mcap", "--mount", "0,0,-6,0,0,0"]);
    assert_eq!(code, 2);
    assert!(text.contains("not above the road"), "{text}");
    let (code, text, _) = outcome(&folder, &["buried.mcap", "--mount", "0,0,6,0,2.9,0"]);
    assert_eq!(code, 0, "{text}");

    let mut reversed = Scene::default();
    reversed.sensor.field_of_view.azimuth_rad = [1.0, -1.0];
    reversed.save(&folder, "reversed");
    let (code, text, _) = outcome(&folder, &["reversed.mcap"]);
    assert_eq!(code, 2);
    assert!(text.contains("azimuth") && text.contains("--fov"), "{text}");
    let (code, text, _) = outcome(&folder, &["reversed.mcap", "--fov", "60,-60,-16,16,3,150"]);
    assert_eq!(code, 2);
    assert!(text.contains("no interval"), "{text}");
    let (code, text, _) = outcome(&folder, &["reversed.mcap", "--fov", "-57,57,-16,16,3,150"]);
    assert_eq!(code, 0, "{text}");
}

#[test]
fn a_configuration_with_an_unknown_key_names_key_and_line() {
    let folder = folder("config");
    Scene::default().save(&folder, "a");
    std::fs::write(folder.join("c.toml"), "[evaluation]\nmin_speed_mps = 2.0\ngrowht_m = 1.0\n").unwrap();
    let (code, text, _) = outcome(&folder, &["a.mcap", "--config", "c.toml"]);
    assert_eq!(code, 2);
    assert!(text.contains("growht_m") && text.contains("line 3") && text.contains("c.toml"), "{text}");
    std::fs::write(folder.join("c.toml"), "[evaluation]\nmin_speed_mps = 2.0\nseed = 9\n").unwrap();
    let (code, text, report) = outcome(&folder, &["a.mcap", "--config", "c.toml", "--seed", "4"]);
    assert_eq!(code, 0, "{text}");
    let evaluation = &report["options"]["evaluation"];
    assert_eq!((&evaluation["min_speed_mps"], &evaluation["seed"]), (&json!(2.0), &json!(4)));
}

#[test]
fn one_bad_recording_does_not_keep_the_others() {
    let folder = folder("mixed");
    Scene::default().save(&folder, "good");
    let (code, text, report) = outcome(&folder, &["absent.mcap", "good.mcap"]);
    assert_eq!(code, 2);
    assert!(text.contains("absent.mcap"), "{text}");
    assert_eq!(report.as_array().unwrap().len(), 1);
    assert_eq!(report[0]["recording"], "good");
}

/// Files that are missing are named before any other is replayed, which takes minutes.
#[test]
fn a_missing_file_is_named_first() {
    let folder = folder("missing");
    Scene::default().save(&folder, "good");
    std::fs::write(folder.join("bad.mcap"), "time,x,y\n1,2,3\n").unwrap();
    let (code, text, _) = outcome(&folder, &["good.mcap", "bad.mcap", "absent.mcap"]);
    assert_eq!(code, 2);
    let said: Vec<&str> = text.lines().filter(|line| line.starts_with("error: ")).collect();
    assert!(said.len() == 2 && said[0].contains("cannot read absent.mcap") && said[1].contains("bad.mcap"), "{text}");
    let output = viewshed(&folder, "bus good.mcap absent.mcap");
    assert!(output.status.code() == Some(2) && stdout(&output).is_empty(), "{}", stdout(&output));
    assert!(stderr(&output).contains("cannot read absent.mcap"), "{}", stderr(&output));
}

/// What is read from a pipe comes once, and is looked at more than once.
#[cfg(unix)]
#[test]
fn a_recording_comes_from_a_pipe() {
    let folder = folder("pipe");
    let pipe = folder.join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    let bytes = Scene::default().bytes();
    let feeding = std::thread::spawn({
        let pipe = pipe.clone();
        move || std::fs::write(pipe, bytes).unwrap()
    });
    let replaying = std::thread::spawn({
        let folder = folder.clone();
        move || outcome(&folder, &["pipe"])
    });
    let begin = std::time::Instant::now();
    while !replaying.is_finished() && begin.elapsed() < std::time::Duration::from_secs(60) {
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    if !replaying.is_finished() {
        // it waits for somebody who writes again
        std::fs::write(&pipe, "").unwrap();
        panic!("read twice");
    }
    feeding.join().unwrap();
    let (code, text, report) = replaying.join().unwrap();
    assert_eq!((code, &report["input"]["frames"]), (0, &FRAMES.into()), "{text}");
}

#[test]
fn a_piece_outside_the_recording_is_an_error() {
    let folder = folder("outside");
    Scene::default().save(&folder, "a");
    let (code, text, _) = outcome(&folder, &["a.mcap", "--from", "100"]);
    assert_eq!(code, 2);
    assert!(text.contains("--from"), "{text}");
}

#[test]
fn random_damage_to_the_points_never_panics() {
    let folder = folder("damage");
    let mut seed = 1_u64;
    let mut next = move |below: usize| {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 33) as usize % below
    };
    let whole = Scene::default().bytes();
    for _ in 0..12 {
        // messages are damaged inside a sound file, so that the damage is read
        let mut writer = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
        for message in mcap::MessageStream::new(&whole).unwrap() {
            let mut message = message.unwrap();
            if message.channel.topic == "/radar/points" && next(2) == 0 {
                let data = message.data.to_mut();
                for _ in 0..=next(20) {
                    let place = next(data.len());
                    data[place] = next(256) as u8;
                }
            }
            writer.write(&message).unwrap();
        }
        writer.finish().unwrap();
        std::fs::write(folder.join("a.mcap"), writer.into_inner().into_inner()).unwrap();
        let (code, text, report) = outcome(&folder, &["a.mcap", "--fov", "-57,57,-16,16,3,150"]);
        assert!(code == 0 || text.starts_with("error: "), "{text}");
        if code == 0 {
            assert_eq!(report["estimators"].as_array().unwrap().len(), 6);
        }
    }
}

#[test]
fn a_units_file_whose_mount_sees_little_of_the_road_is_doubtful() {
    let folder = folder("doubtful_unit");
    let example = stdout(&viewshed(&folder, "configure --example"));
    let pitch = example.lines().find(|line| line.starts_with("pitch_deg")).unwrap();
    for (angle, code) in [("4.0", 0), ("40.0", 1)] {
        std::fs::write(folder.join("unit.toml"), example.replace(pitch, &format!("pitch_deg = {angle}"))).unwrap();
        let output = viewshed(&folder, "configure unit.toml --check");
        let text = stdout(&output);
        assert_eq!(output.status.code(), Some(code), "{text}{}", stderr(&output));
        assert_eq!(text.contains("doubtful: mount.pitch_deg 40 with an elevation of"), code == 1, "{text}");
        assert!(text.contains("reference grid: can be used"), "{text}");
    }
}
