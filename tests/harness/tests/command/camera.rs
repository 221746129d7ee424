//! A camera in every result: boxes as CSV, and what a replay and an experiment write of it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::scene::{folder, json, stderr, stdout};

fn viewshed(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
    command.current_dir(folder).args(arguments.split_whitespace()).output().unwrap()
}

const CAMERA: &str = "mount = { x_m = 0.0, y_m = 0.0, height_m = 6.0, yaw_deg = 0.0, pitch_deg = 0.0, roll_deg = 0.0 }\n\
                      intrinsics = { size_px = [1920, 1080], focal_px = [1600.0, 1600.0], center_px = [960.0, 540.0] }\n";

/// 3 s at 10 Hz of a truck from 40 m on and a car 20 m before it, both at 12 m/s; boxes and labels.
fn prepared(test: &str) -> PathBuf {
    let folder = folder(test);
    let (mut boxes, mut labels) = (
        String::from("time_s,class,left_px,top_px,right_px,bottom_px,score\n"),
        String::from("time_s,object_id,class,x_m,y_m,heading_rad,length_m,width_m,height_m\n"),
    );
    for k in 0..30 {
        let time_s = 100.0 + 0.1 * f64::from(k);
        for (id, class, x, y, [length, width, height]) in
            [("truck", "truck", 46.0, 3.5, [12.0, 2.55, 4.0_f64]), ("car", "car", 22.3, -3.0, [4.6, 1.8, 1.5])]
        {
            let x = x + 1.2 * f64::from(k);
            let (near, far) = (x - length / 2.0, x + length / 2.0);
            let side = |y: f64| [960.0 - 1600.0 * y / near, 960.0 - 1600.0 * y / far];
            let (left, right) = (side(y + width / 2.0), side(y - width / 2.0));
            let edges = [
                left[0].min(left[1]),
                540.0 - 1600.0 * (height - 6.0) / far,
                right[0].max(right[1]),
                540.0 + 1600.0 * 6.0 / near,
            ];
            let [l, t, r, b] = edges;
            boxes += &format!("{time_s:.1},{class},{l:.2},{t:.2},{r:.2},{b:.2},0.9\n");
            labels += &format!("{time_s:.1},{id},{class},{x:.2},{y},0,{length},{width},{height}\n");
        }
    }
    std::fs::write(folder.join("a.boxes.csv"), boxes).unwrap();
    std::fs::write(folder.join("a.labels.csv"), labels).unwrap();
    std::fs::write(folder.join("a.camera.toml"), CAMERA).unwrap();
    folder
}

#[test]
fn boxes_as_csv_are_replayed_into_every_kind_of_result() {
    let folder = prepared("boxes");
    let arguments = "replay a.boxes.csv --json r.json --csv s.csv --out o --mcap m.mcap --mcap-estimator camera-3d \
                     --mount-error=0.5,0.2 --bootstrap 50";
    let output = viewshed(&folder, arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("a (sensor camera): 20 of 30 frames, 2 trajectories, coverage 100.0 %"), "{text}");
    assert!(text.contains("a box of the camera's own") && text.contains("Problems of the input: none."), "{text}");
    let report = json(&folder.join("r.json"));
    let rows = report["estimators"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|r| r["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["camera-3d", "camera-true-boxes", "geometry-slice", "geometry-box"]);
    assert_eq!((&rows[0]["tv"], &rows[0]["fi"]), (&40.into(), &0.into()), "{}", rows[0]);
    // a nose taken to be lower sees everything farther away
    let moved = &report["mount_error"].as_array().unwrap()[0]["estimators"][0];
    assert_eq!(moved["name"], "camera-3d");
    assert!(moved["cell_fvr_points"].is_number(), "{moved}");
    let samples = std::fs::read_to_string(folder.join("s.csv")).unwrap();
    assert!(
        samples
            .lines()
            .next()
            .unwrap()
            .ends_with("camera-3d_visible,camera-3d_grade,camera-true-boxes_visible,camera-true-boxes_grade")
    );
    assert_eq!(samples.lines().count(), 41);
    for picture in ["birdseye-camera-3d.png", "camera-view.png", "birdseye-camera-true-boxes.png", "table.txt"] {
        assert!(folder.join("o").join(picture).exists(), "{picture}");
    }
    let copy = std::fs::read(folder.join("m.mcap")).unwrap();
    let grids = mcap::MessageStream::new(&copy)
        .unwrap()
        .filter(|m| m.as_ref().unwrap().channel.topic == "/visibility/camera-3d");
    assert_eq!(grids.count(), 30);
}

#[test]
fn boxes_that_cannot_be_read_say_why() {
    let folder = prepared("boxes-bad");
    let heading = "time_s,class,left_px,top_px,right_px,bottom_px\n";
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("alone.boxes.csv", &format!("{heading}1,car,1,2,3,4\n"));
    for name in ["word", "empty", "nowhere"] {
        write(&format!("{name}.camera.toml"), CAMERA);
    }
    write("word.boxes.csv", &format!("{heading}1,car,1,2,3,4\n1,car,x,2,3,4\n"));
    write("empty.boxes.csv", heading);
    write("nowhere.boxes.csv", &format!("{heading}1,car,1,2,3,4\n"));
    write("nowhere.camera.toml", &CAMERA.replace("focal_px = [1600.0", "focal_px = [0.0"));
    write("key.boxes.csv", &format!("{heading}1,car,1,2,3,4\n"));
    write("key.camera.toml", &format!("{CAMERA}lens = 3\n"));
    for (arguments, words) in [
        ("alone.boxes.csv", "cannot read the calibration alone.camera.toml"),
        ("word.boxes.csv", "line: 3"),
        ("empty.boxes.csv", "no picture in it"),
        ("nowhere.boxes.csv", "intrinsics.focal_px[0] is 0, outside 50 to 20000"),
        ("key.boxes.csv", "unknown field `lens`"),
        ("a.boxes.csv --fov -60,60,-16,16,3,200", "a camera's view follows from a.camera.toml"),
        ("a.boxes.csv --mcap m.mcap --mcap-estimator radar-3d", "no estimator `radar-3d`; there are camera-3d"),
    ] {
        let output = viewshed(&folder, &format!("replay {arguments}"));
        let text = stderr(&output);
        assert!(output.status.code() == Some(2) && text.contains(words) && !text.contains("panicked"), "{text}");
    }
}

#[test]
fn the_experiment_of_a_camera_tells_why_what_was_not_found_is_called_visible() {
    let folder = folder("gantry-camera");
    let recordings = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings");
    let plan = std::fs::read_to_string(format!("{recordings}/gantry-camera.toml")).unwrap();
    // the first day of the first set, some seconds of it
    let mut plan: toml::Table = plan.parse().unwrap();
    plan["scene"] = format!("{recordings}/motorway.toml").into();
    plan["duration_s"] = 4.0.into();
    let sets = plan["set"].as_array_mut().unwrap();
    sets.truncate(1);
    let days = sets[0].as_table_mut().unwrap()["day"].as_array_mut().unwrap();
    days.truncate(1);
    days[0]["fcd"] = format!("{recordings}/motorway/day-1.fcd.xml.gz").into();
    std::fs::write(folder.join("p.toml"), plan.to_string()).unwrap();
    let output = viewshed(&folder, "experiment p.toml --scene gantry-camera --every 3 --bootstrap 0 --json e.json");
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    let widest = text.lines().filter(|line| line.starts_with('│')).map(|line| line.chars().count()).max();
    assert!(widest > Some(60) && widest <= Some(80), "tables fit a terminal: {text}");
    assert!(
        text.contains("The paper's 3D camera grid: TVR 93, FVR 2, FIR 7.") && text.contains("15 % missed"),
        "{text}"
    );
    let found = json(&folder.join("e.json"));
    let detectors = found["sets"][0]["detectors"].as_array().unwrap();
    assert_eq!(detectors.len(), 4);
    let mut undetected = Vec::new();
    for d in detectors {
        let row = &d["pooled"]["estimators"][0];
        assert_eq!(row["name"], "camera-3d");
        let causes = d["fvr_causes"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum::<u64>();
        assert_eq!(Some(causes), row["fv"].as_u64(), "every one has its cause");
        undetected.push(d["undetected_steps"].as_u64().unwrap());
    }
    assert_eq!(detectors[0]["fvr_causes"]["missed"], 0, "the ideal detector misses nothing that shows");
    assert!(undetected[0] < undetected[1] && undetected[2] < undetected[3], "{undetected:?}");
    let output = viewshed(&folder, "experiment --scene gantry-camera --train");
    assert!(output.status.code() == Some(2) && stderr(&output).contains("does not go with --scene gantry-camera"));
}
