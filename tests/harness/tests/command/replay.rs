//! Results of a replay, as table, JSON and CSV.

use serde_json::{Value, json};
use viewshed_harness::recording::{self, RadarDetection, ReadOptions};

use crate::scene::{FRAMES, PERIOD_NS, Scene, folder, json, replay, stderr, stdout, viewshed};

/// Frames after the first second.
const COUNTED: usize = FRAMES - (1_000_000_000 / PERIOD_NS) as usize - 1;

fn row<'a>(report: &'a Value, name: &str) -> &'a Value {
    report["estimators"].as_array().unwrap().iter().find(|e| e["name"] == name).unwrap()
}

#[test]
fn without_labels_nothing_is_broken_down() {
    let folder = folder("no_breakdown");
    Scene { labelled: false, ..Scene::default() }.save(&folder, "a");
    let output = replay(&folder, &["a.mcap", "--bootstrap", "0", "--breakdown"]);
    let text = stdout(&output);
    assert!(output.status.success() && text.contains("--breakdown needs labels, and there are none."), "{text}");
    assert!(!text.contains("FVR / FIR in % by "), "{text}");
}

#[test]
fn what_is_written_is_what_is_read() {
    let folder = folder("round_trip");
    let scene = Scene::default();
    let read = recording::read(&scene.save(&folder, "scene"), &ReadOptions::default()).unwrap();
    assert_eq!(read.sensor, scene.sensor);
    assert_eq!(read.frames, scene.steps.iter().map(|(f, _)| f.clone()).collect::<Vec<_>>());
    assert!((read.pose.pitch_rad() - scene.pose.pitch_rad()).abs() < 1e-12);
    assert!(read.problems.is_empty());
    let (frame, labels) = &scene.steps[7];
    let objects = read.truth.as_ref().unwrap().at(frame.time_ns);
    assert_eq!(objects.len(), labels.len());
    assert!(labels.iter().all(|l| objects.iter().any(|o| o.solid == l.solid)));
}

#[test]
fn the_bounds_see_the_truck_and_the_free_car_and_not_the_hidden_one() {
    let folder = folder("bounds");
    Scene::default().save(&folder, "scene");
    let output = replay(&folder, &["scene.mcap", "--json", "r.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let report = json(&folder.join("r.json"));
    assert_eq!(report["recording"], "scene");
    assert_eq!((&report["frames"], &report["objects"]), (&json!(COUNTED), &json!(3)));
    assert_eq!(report["coverage_rate"], json!(2.0 / 3.0));
    let slice = row(&report, "geometry-slice");
    let counts = ["tv", "fv", "ti", "fi"].map(|k| slice[k].as_u64().unwrap());
    assert_eq!(counts, [2 * COUNTED as u64, 0, COUNTED as u64, 0]);
    assert_eq!((&slice["tvr"], &slice["fvr"]), (&json!(1.0), &json!(0.0)));
    assert_eq!((&slice["cell_fvr"], &slice["cell_fir"]), (&json!(0.0), &json!(0.0)));
    assert_eq!(row(&report, "geometry-box")["cell_fvr"], Value::Null);
    assert_eq!(slice["distance_to_geometry_slice"]["fvr_points"], json!(0.0));
}

#[test]
fn the_report_has_its_stable_keys_and_every_option() {
    let folder = folder("keys");
    Scene::default().save(&folder, "scene");
    let output = replay(&folder, &["scene.mcap", "--json", "r.json", "--min-speed", "2", "--mount-error"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let report = json(&folder.join("r.json"));
    for key in ["recording", "frames", "objects", "coverage_rate", "estimators", "options", "input", "mount_error"] {
        assert!(!report[key].is_null(), "{key}");
    }
    let rates = ["tv", "fv", "ti", "fi", "tvr", "fvr", "tir", "fir", "cell_fvr", "cell_fir"];
    for estimator in report["estimators"].as_array().unwrap() {
        for key in rates {
            assert!(estimator.get(key).is_some(), "{key} of {}", estimator["name"]);
        }
    }
    let names: Vec<&str> =
        report["estimators"].as_array().unwrap().iter().map(|e| e["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["radar-2d", "radar-2d-first", "radar-3d", "true-boxes", "geometry-slice", "geometry-box"]);
    let evaluation = report["options"]["evaluation"].as_object().unwrap();
    assert_eq!(evaluation.len(), 10);
    assert_eq!(evaluation["min_speed_mps"], json!(2.0));
    for key in ["radar_topic", "truth_topic", "mount", "field_of_view", "from_s", "to_s"] {
        assert!(report["options"]["reading"].get(key).is_some(), "{key}");
    }
    assert!(report["options"]["estimators"]["max_detections"].is_u64());
    let errors = report["mount_error"].as_array().unwrap();
    assert_eq!(errors.len(), 4);
    assert_eq!(errors[0]["error"], json!({"pitch_deg": 0.5, "height_m": 0.0}));
    assert!(errors[0]["estimators"][0]["fvr_points"].is_f64());
    assert!(stdout(&output).contains("No labelled gantry-radar recording is publicly obtainable"));
}

#[test]
fn without_truth_there_are_no_rates_and_no_error() {
    let folder = folder("unlabelled");
    Scene { labelled: false, ..Scene::default() }.save(&folder, "scene");
    let output = replay(&folder, &["scene.mcap", "--json", "r.json", "--csv", "r.csv"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let report = json(&folder.join("r.json"));
    assert_eq!(report["frames"], json!(COUNTED));
    assert_eq!((&report["objects"], &report["coverage_rate"]), (&json!(0), &Value::Null));
    for estimator in report["estimators"].as_array().unwrap() {
        for key in ["tvr", "fvr", "tir", "fir", "cell_fvr", "cell_fir"] {
            assert_eq!(estimator[key], Value::Null, "{key} of {}", estimator["name"]);
        }
    }
    assert!(stdout(&output).contains("No labels, so maps and pictures"));
    assert_eq!(std::fs::read_to_string(folder.join("r.csv")).unwrap().lines().count(), 1);
}

#[test]
fn labels_beside_the_recording_are_taken() {
    let folder = folder("labels");
    let scene = Scene { labelled: false, ..Scene::default() };
    scene.save(&folder, "scene");
    let mut csv = String::from("time_s,object_id,class,x_m,y_m\n");
    for (k, (_, labels)) in scene.steps.iter().enumerate() {
        for l in labels {
            let [x, y, _] = l.solid.center;
            csv += &format!("{},{},{},{x},{y}\n", (k as i64 * PERIOD_NS) as f64 * 1e-9, l.id, l.class);
        }
    }
    std::fs::write(folder.join("scene.labels.csv"), csv).unwrap();
    let output = replay(&folder, &["scene.mcap", "--json", "r.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(json(&folder.join("r.json"))["objects"], json!(3));
    let said = "Labels of scene.labels.csv: only what was labelled counts";
    assert!(stdout(&output).contains(said) && stdout(&output).contains("objects have the size of their class"));
}

#[test]
fn several_recordings_make_an_array_and_one_csv() {
    let folder = folder("several");
    let scene = Scene::default();
    scene.save(&folder, "one");
    let mut independent = scene.clone();
    independent.sensor.frames_independent = true;
    independent.save(&folder, "two");
    let output = replay(&folder, &["one.mcap", "two.mcap", "--json", "r.json", "--csv", "r.csv", "--out", "o"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let reports = json(&folder.join("r.json"));
    assert_eq!((&reports[0]["recording"], &reports[1]["recording"]), (&json!("one"), &json!("two")));
    // independent frames need no warm-up, and have no cells
    assert_eq!(reports[1]["frames"], json!(FRAMES));
    assert_eq!(row(&reports[1], "radar-3d")["cell_fvr"], Value::Null);
    assert_eq!(reports[1]["resampling"]["objects_over"], "frames");

    let csv = std::fs::read_to_string(folder.join("r.csv")).unwrap();
    let mut lines = csv.lines();
    let heading: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert_eq!(heading[..6], ["recording", "time_s", "time_ns", "object_id", "class", "distance_m"]);
    assert_eq!(heading[6..11], ["detections", "detected", "occlusion", "geometry_slice", "geometry_box"]);
    assert_eq!(heading[11..13], ["radar-2d_visible", "radar-2d_grade"]);
    let rows: Vec<Vec<&str>> = lines.map(|l| l.split(',').collect()).collect();
    assert_eq!(rows.len(), 3 * (COUNTED + FRAMES));
    assert!(rows.iter().all(|r| r.len() == heading.len()));
    let hidden: Vec<_> = rows.iter().filter(|r| r[3] == "hidden").collect();
    assert!(hidden.iter().all(|r| r[7] == "0" && r[9] == "0"));
    assert_eq!(rows.iter().filter(|r| r[0] == "two").count(), 3 * FRAMES);
    assert!(folder.join("o/one/table.txt").exists() && folder.join("o/two/table.txt").exists());
}

#[test]
fn labelled_and_unlabelled_recordings_share_one_csv_in_any_order() {
    let folder = folder("shared_csv");
    Scene::default().save(&folder, "with");
    Scene { labelled: false, ..Scene::default() }.save(&folder, "without");
    for order in [["with.mcap", "without.mcap"], ["without.mcap", "with.mcap"]] {
        let output = replay(&folder, &[&order[..], &["--csv", "r.csv", "--force"]].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        let csv = std::fs::read_to_string(folder.join("r.csv")).unwrap();
        assert_eq!(csv.lines().count(), 1 + 3 * COUNTED);
        assert!(csv.lines().next().unwrap().contains("true-boxes_grade"));
    }
}

#[test]
fn occlusion_grades_beside_the_recording_are_broken_down() {
    let folder = folder("occlusion");
    Scene::default().save(&folder, "scene");
    std::fs::write(
        folder.join("scene.occlusion.csv"),
        "object_id,occlusion_0_to_2,points_in_box\nhidden,2,0\nfree,0,9\n",
    )
    .unwrap();
    let output = replay(&folder, &["scene.mcap", "--json", "r.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let report = json(&folder.join("r.json"));
    let groups = &row(&report, "geometry-slice")["breakdown"]["occlusion"];
    assert_eq!((&groups[0]["group"], &groups[1]["group"]), (&json!("0"), &json!("2")));
    assert_eq!((&groups[1]["fvr"], &groups[1]["tvr"]), (&json!(0.0), &Value::Null));
    assert!(stdout(&output).contains("by occlusion"));
}

#[test]
fn the_same_input_gives_the_same_report() {
    let folder = folder("repeat");
    Scene::default().save(&folder, "scene");
    for name in ["a.json", "b.json"] {
        assert!(replay(&folder, &["scene.mcap", "--json", name]).status.success());
    }
    assert_eq!(std::fs::read(folder.join("a.json")).unwrap(), std::fs::read(folder.join("b.json")).unwrap());
}

#[test]
fn a_piece_of_the_recording_is_replayed_alone() {
    let folder = folder("piece");
    Scene::default().save(&folder, "scene");
    let output = replay(&folder, &["scene.mcap", "--from", "1", "--to", "2", "--warm-up", "0", "--json", "r.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    // frames 16 to 30 of 66 ms
    assert_eq!(json(&folder.join("r.json"))["frames"], json!(15));
}

/// What is said of a scene every detection of which was changed, by a command that makes maps of it.
fn spoilt(name: &str, change: impl Fn(&mut RadarDetection)) -> String {
    let folder = folder(name);
    let mut scene = Scene::default();
    scene.steps.iter_mut().flat_map(|(frame, _)| &mut frame.detections).for_each(change);
    scene.save(&folder, "scene");
    Scene::default().save(&folder, "whole");
    let output = replay(&folder, &["scene.mcap", "whole.mcap", "--json", "r.json"]);
    assert_eq!(output.status.code(), Some(2), "{}", stdout(&output));
    assert_eq!(json(&folder.join("r.json"))[0]["recording"], "whole", "the others are replayed");
    let said = stderr(&output);
    let map_makers =
        ["bus scene.mcap", "view scene.mcap --no-open", "label scene.mcap --no-open", "replay scene.mcap --out o"];
    for command in map_makers.into_iter().chain(["lanes scene.mcap"]) {
        let output = viewshed(&folder, command);
        assert_eq!((output.status.code(), stderr(&output)), (Some(2), said.clone()), "{command}");
    }
    said
}

#[test]
fn a_map_that_rests_on_nothing_is_an_error_of_every_command_with_the_cause_first() {
    let rejected = |why: &str| format!("error: scene: {0} of {0} points rejected (most: {why}", 4 * FRAMES);
    let text = spoilt("spoilt_nan", |d| d.azimuth_rad = f32::NAN);
    assert!(text.starts_with(&rejected("dropped when read): does the sensor send NaN?")), "{text}");
    let text = spoilt("spoilt_degrees", |d| {
        d.azimuth_rad = d.azimuth_rad.to_degrees() + 4.0;
        d.elevation_rad = d.elevation_rad.map(f32::to_degrees);
    });
    assert!(text.starts_with(&rejected("absurd): angles in degrees?")), "{text}");
    let text = spoilt("spoilt_outside", |d| d.azimuth_rad = 1.5);
    assert!(text.starts_with(&rejected("azimuth): angles in degrees, or a wrong field of view?")), "{text}");
}

#[test]
fn causes_of_wrong_cells_add_up_to_their_rates_alone_and_together() {
    let folder = folder("causes");
    let scene = Scene::default();
    scene.save(&folder, "one");
    scene.save(&folder, "two");
    let output = replay(&folder, &["one.mcap", "two.mcap", "--causes", "--json", "r.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    assert_eq!(text.matches("Why cells of radar-3d are wrong").count(), 3, "{text}");
    assert!(text.contains("All recordings together"), "{text}");
    let mut wrong = 0.0;
    for report in json(&folder.join("r.json")).as_array().unwrap() {
        let causes = &report["causes"][0];
        assert_eq!(causes["estimator"], "radar-3d");
        for (rate, parts) in [("cell_fvr", "wrongly_visible"), ("cell_fir", "wrongly_invisible")] {
            let points = |c: &Value| c["points"].as_f64().unwrap();
            let sum: f64 = causes[parts].as_array().unwrap().iter().map(points).sum();
            assert!((sum - 100.0 * causes[rate].as_f64().unwrap()).abs() < 1e-9, "{causes}");
            wrong += sum;
        }
    }
    assert!(wrong > 0.0, "a scene of which every cell is right shows nothing");

    let unlabelled = Scene { labelled: false, ..scene };
    unlabelled.save(&folder, "unlabelled");
    let output = replay(&folder, &["unlabelled.mcap", "--causes"]);
    assert!(stdout(&output).contains("Why cells are wrong cannot be said"), "{}", stdout(&output));
}
