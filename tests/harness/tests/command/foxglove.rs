//! `--mcap`: the input's messages and one grid a frame.

use std::collections::{BTreeMap, BTreeSet};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use viewshed_harness::recording::{ReadOptions, read};

use crate::scene::{FRAMES, Scene, folder, json, replay, stderr, stdout};

#[test]
fn the_copy_holds_the_input_and_a_grid_after_each_frame() {
    let folder = folder("mcap");
    let scene = Scene::default();
    let source = std::fs::read(scene.save(&folder, "scene")).unwrap();
    let output = replay(&folder, &["scene.mcap", "--mcap", "maps.mcap"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let copy = std::fs::read(folder.join("maps.mcap")).unwrap();
    let mut by_topic: BTreeMap<String, Vec<mcap::Message>> = BTreeMap::new();
    for message in mcap::MessageStream::new(&copy).unwrap() {
        let message = message.unwrap();
        by_topic.entry(message.channel.topic.clone()).or_default().push(message);
    }
    let topics: Vec<&str> = by_topic.keys().map(String::as_str).collect();
    let map = "/visibility/radar-3d";
    let own = [map, "/visibility/radar-3d/boxes", "/visibility/radar-3d/counts"];
    assert_eq!(topics, [&["/ground_truth/objects", "/radar/points", "/tf_static"][..], &own].concat());
    for message in mcap::MessageStream::new(&source).unwrap() {
        let message = message.unwrap();
        let copies = &by_topic[&message.channel.topic];
        let same = |m: &&mcap::Message| m.data == message.data && m.log_time == message.log_time;
        let copied = copies.iter().find(same).expect("every message is copied as it is");
        assert_eq!(copied.channel.schema.as_ref().unwrap().data, message.channel.schema.as_ref().unwrap().data);
    }
    let grids = &by_topic["/visibility/radar-3d"];
    assert_eq!(grids.len(), FRAMES);
    let schema = grids[0].channel.schema.as_ref().unwrap();
    assert_eq!((schema.name.as_str(), schema.encoding.as_str()), ("foxglove.Grid", "jsonschema"));
    assert_eq!(grids[0].channel.message_encoding, "json");
    for (grid, frame) in grids.iter().zip(&by_topic["/radar/points"]) {
        assert_eq!(grid.log_time, frame.log_time);
    }
    let grid: serde_json::Value = serde_json::from_slice(&grids[20].data).unwrap();
    assert_eq!(grid["frame_id"], "road");
    let [row_stride, cell_stride, columns] =
        ["row_stride", "cell_stride", "column_count"].map(|k| grid[k].as_u64().unwrap());
    assert_eq!(row_stride, cell_stride * columns);
    let data = BASE64.decode(grid["data"].as_str().unwrap()).unwrap();
    assert!(!data.is_empty() && (data.len() as u64).is_multiple_of(row_stride));
    assert!(data.chunks(4).any(|cell| cell[3] > 0), "something is known");
}

/// Every string in a layout that is a topic, or begins with one and goes on with a field.
fn topics_in(layout: &serde_json::Value, into: &mut BTreeSet<String>) {
    match layout {
        serde_json::Value::String(text) if text.starts_with('/') => {
            into.insert(text.split('.').next().unwrap().to_owned());
        }
        serde_json::Value::Array(items) => items.iter().for_each(|item| topics_in(item, into)),
        serde_json::Value::Object(members) => {
            for (name, value) in members {
                topics_in(&name.as_str().into(), into);
                topics_in(value, into);
            }
        }
        _ => {}
    }
}

#[test]
fn the_layout_beside_it_shows_topics_of_the_file_and_fields_of_their_schemas() {
    for (labelled, panels) in [(true, 4), (false, 3)] {
        let folder = folder(&format!("layout_{labelled}"));
        let scene = Scene { labelled, ..Scene::default() };
        scene.save(&folder, "scene");
        let output = replay(&folder, &["scene.mcap", "--bootstrap", "0", "--mcap", "maps.mcap"]);
        assert!(output.status.success() && stdout(&output).contains("wrote maps.layout.json"), "{}", stderr(&output));
        let layout = json(&folder.join("maps.layout.json"));
        assert_eq!(layout["configById"].as_object().unwrap().len(), panels);
        let copy = std::fs::read(folder.join("maps.mcap")).unwrap();
        let summary = mcap::Summary::read(&copy).unwrap().unwrap();
        let written: BTreeMap<&str, &mcap::Channel> =
            summary.channels.values().map(|channel| (channel.topic.as_str(), &**channel)).collect();
        let mut shown = BTreeSet::new();
        topics_in(&layout, &mut shown);
        assert_eq!(shown.contains("/visibility/radar-3d/boxes"), labelled);
        assert!(shown.iter().all(|topic| written.contains_key(topic.as_str())), "{shown:?} of {:?}", written.keys());
        assert!(shown.contains("/radar/points") && shown.contains("/visibility/radar-3d"), "{shown:?}");
        for panel in layout["configById"].as_object().unwrap().values() {
            for path in panel["paths"].as_array().into_iter().flatten() {
                let (topic, field) = path["value"].as_str().unwrap().split_once('.').unwrap();
                let schema: serde_json::Value =
                    serde_json::from_slice(&written[topic].schema.as_ref().unwrap().data).unwrap();
                assert!(schema["properties"][field].is_object(), "{topic} has no {field}");
            }
        }
    }
}

#[test]
fn the_copy_of_a_piece_with_a_mount_given_by_hand_replays_the_same() {
    let folder = folder("mcap_piece");
    Scene::default().save(&folder, "scene");
    let mount = ["--mount", "0,0,5,0,3,0"];
    let output = replay(
        &folder,
        &[
            &["scene.mcap", "--mcap", "maps.mcap", "--from", "0.5", "--to", "1.5", "--mcap-estimator", "true-boxes"],
            // all of it lies within the usual warm-up
            &["--warm-up", "0"][..],
            &mount[..],
        ]
        .concat(),
    );
    assert!(output.status.success(), "{}", stderr(&output));
    let copy = read(&folder.join("maps.mcap"), &ReadOptions::default()).unwrap();
    assert!((copy.pose.position[2] - 5.0).abs() < 1e-9 && (copy.pose.pitch_rad() - 3_f64.to_radians()).abs() < 1e-9);
    assert_eq!(copy.frames.len(), 15);
    assert_eq!(copy.sensor, Scene::default().sensor);
}

#[test]
fn an_estimator_that_is_not_there_is_named_beside_those_that_are() {
    let folder = folder("mcap_unknown");
    Scene::default().save(&folder, "scene");
    let output = replay(&folder, &["scene.mcap", "--mcap", "maps.mcap", "--mcap-estimator", "lidar"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("no estimator `lidar`") && stderr(&output).contains("radar-3d"));
}
