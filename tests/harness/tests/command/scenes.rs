//! `viewshed experiment --scene crossing` on a cut of the training crossings: pooling, variants, bad input.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

use crate::scene::{folder, json, stderr, stdout};

/// Seconds of each scene here, and how many of them warm up.
const CUT_S: f64 = 6.0;
const WARM_UP_S: f64 = 3.0;

fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/crossing").canonicalize().unwrap()
}

/// A folder with both training crossings, cut, and a plan that trains on one and reports the other.
fn prepared(test: &str, plan: impl Fn(&str) -> String) -> PathBuf {
    let folder = folder(test);
    let shipped = shipped();
    for name in ["train-1", "train-2"] {
        let scene = std::fs::read_to_string(shipped.join(name).with_extension("toml")).unwrap();
        let cut = scene
            .replace("duration_s = 90.0", &format!("duration_s = {CUT_S:?}"))
            .replace(&format!("\"{name}.fcd"), &format!("\"{}/{name}.fcd", shipped.display()))
            .replace("net = \"", &format!("net = \"{}/", shipped.display()))
            .replace("\"../motorway", &format!("\"{}/../motorway", shipped.display()))
            .replace("\"town", &format!("\"{}/town", shipped.display()));
        std::fs::write(folder.join(name).with_extension("toml"), cut).unwrap();
    }
    let set = |name: &str, scene: &str| format!("[{name}]\nwarm_up_s = {WARM_UP_S:?}\nscenes = [\"{scene}.toml\"]\n");
    let text = set("training", "train-1") + &set("reporting", "train-2");
    std::fs::write(folder.join("plan.toml"), plan(&text)).unwrap();
    folder
}

fn experiment(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
    command.current_dir(folder).arg("experiment").args(arguments.split(' ')).output().unwrap()
}

fn row<'a>(report: &'a Value, name: &str) -> &'a Value {
    report["estimators"].as_array().unwrap().iter().find(|e| e["name"] == name).unwrap()
}

#[test]
fn lanes_are_learnt_only_where_another_day_is_named() {
    let folder = prepared("scenes-learnt", str::to_owned);
    let none = experiment(&folder, "plan.toml --scene crossing --learn-lanes");
    assert!(stderr(&none).contains("name no other_days"), "{}", stderr(&none));
    let motorway = experiment(&folder, "--scene motorway --learn-lanes");
    assert!(
        stderr(&motorway).contains("--learn-lanes does not go with --scene motorway; it goes with crossing\n"),
        "{}",
        stderr(&motorway)
    );
    let plan = std::fs::read_to_string(folder.join("plan.toml")).unwrap();
    let day = shipped().join("wide-day-1.fcd.xml.gz");
    std::fs::write(folder.join("plan.toml"), format!("{plan}other_days = [\"{}\"]\n", day.display())).unwrap();
    let learnt =
        experiment(&folder, "plan.toml --scene crossing --learn-lanes --only-elevation --every 9 --json e.json");
    assert!(learnt.status.success(), "{}", stderr(&learnt));
    assert!(stdout(&learnt).contains("lanes learnt from another day"));
    let report = json(&folder.join("e.json"));
    assert_eq!(report["lanes_learnt"], true);
    let pooled = &report["variants"][0]["pooled"];
    let [usual, lanes, learning] = ["radar-3d", "radar-3d-lanes", "radar-3d-learning"].map(|name| row(pooled, name));
    assert!(
        usual["cells"] != lanes["cells"] && usual["cells"] != learning["cells"] && lanes["cells"] != learning["cells"]
    );
    assert_eq!(usual["counters"], learning["counters"], "what it ran over before is not counted");
}

#[test]
fn scenes_are_pooled_and_told_apart_with_and_without_elevation_and_warm_up() {
    let both = |text: &str| {
        text.replace("[\"train-2.toml\"]", "[\"train-2.toml\", \"train-1.toml\"]").replace("[\"train-1.toml\"]", "[]")
    };
    // a plan that trains on nothing is refused below; here the training set is a third scene
    let folder = prepared("scenes-pooled", both);
    let third = std::fs::read_to_string(folder.join("train-1.toml")).unwrap();
    let third = third.replace("seed = 1101", "seed = 7").replace("train-1.fcd", "wide-1.fcd");
    std::fs::write(folder.join("third.toml"), third).unwrap();
    let plan = std::fs::read_to_string(folder.join("plan.toml")).unwrap();
    std::fs::write(folder.join("plan.toml"), plan.replace("= []", "= [\"third.toml\"]")).unwrap();

    let output = experiment(&folder, "plan.toml --scene crossing --bootstrap 50 --every 3 --json e.json --keep kept");
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("crossing, reporting: 2 scenes") && text.contains("one frame in 3 judged"), "{text}");
    let widest = text.lines().filter(|line| line.starts_with('│')).map(|line| line.chars().count()).max();
    assert!(widest > Some(60) && widest <= Some(80), "tables fit a terminal: {text}");
    assert!(text.contains("At equal FIR of cells") && text.contains("without warm-up"), "{text}");
    assert!(folder.join("kept/train-2.mcap").exists() && folder.join("kept/train-1.mcap").exists());

    let found = json(&folder.join("e.json"));
    let variants = found["variants"].as_array().unwrap();
    let names: Vec<&str> = variants.iter().map(|v| v["counted"].as_str().unwrap()).collect();
    assert_eq!(names, ["main", "without-elevation", "without-warm-up"]);
    // 15 frames a second of which every third is judged; the very first second never counts
    let frames = |v: &Value| v["pooled"]["frames"].as_u64().unwrap();
    assert_eq!(variants.iter().map(frames).collect::<Vec<_>>(), [2 * 15, 2 * 15, 2 * 25]);
    for variant in variants {
        for estimator in ["radar-2d", "radar-3d", "true-boxes", "geometry-slice"] {
            for count in ["tv", "fv", "ti", "fi"] {
                let of = |report: &Value| row(report, estimator)[count].as_u64().unwrap();
                let alone: u64 = variant["scenes"].as_array().unwrap().iter().map(of).sum();
                assert_eq!(of(&variant["pooled"]), alone, "{estimator} {count}");
            }
        }
        for count in ["blocked", "blocked_visible", "clear", "clear_not_visible"] {
            let of = |report: &Value| row(report, "radar-3d")["cells"][count].as_u64().unwrap();
            let alone: u64 = variant["scenes"].as_array().unwrap().iter().map(of).sum();
            assert!(alone > 0 && of(&variant["pooled"]) == alone, "{count}");
        }
    }
    // sight does not depend on elevation, what is detected and what radar-3d makes of it does
    let of = |k: usize, name: &str| row(&variants[k]["pooled"], name).clone();
    let visible = |r: &Value| r["tv"].as_u64().unwrap() + r["fv"].as_u64().unwrap();
    assert_eq!(visible(&of(0, "geometry-slice")), visible(&of(1, "geometry-slice")));
    assert_eq!(of(0, "true-boxes")["cells"], of(1, "true-boxes")["cells"]);
    assert_ne!(of(0, "radar-3d")["cells"], of(1, "radar-3d")["cells"]);
}

#[test]
fn a_scene_alone_counts_what_replaying_its_recording_counts() {
    let folder = prepared("scenes-replay", str::to_owned);
    let arguments = "plan.toml --scene crossing --only-elevation --bootstrap 0 --json e.json --keep kept";
    let output = experiment(&folder, arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let arguments = ["kept/train-2.mcap", "--warm-up", "3", "--bootstrap", "0", "--json", "r.json"];
    let replayed = crate::scene::replay(&folder, &arguments);
    assert!(replayed.status.success(), "{}", stderr(&replayed));
    let (found, replayed) = (json(&folder.join("e.json")), json(&folder.join("r.json")));
    let pooled = &found["variants"][0]["pooled"];
    assert_eq!(found["variants"].as_array().unwrap().len(), 2, "no run without elevation");
    assert_eq!((&pooled["frames"], &pooled["objects"]), (&replayed["frames"], &replayed["objects"]));
    for name in ["radar-2d", "radar-2d-first", "radar-3d", "true-boxes", "geometry-slice", "geometry-box"] {
        let [a, b] = [pooled, &replayed].map(|r| row(r, name));
        for key in ["tv", "fv", "ti", "fi", "distance_to_geometry_slice"] {
            assert_eq!(a[key], b[key], "{name} {key}");
        }
        // exact lines of sight are the truth of a cell: no rate of their own
        assert!(name.starts_with("geometry") || a["cells"] == b["cells"], "{name}");
    }
}

#[test]
fn a_plan_of_scenes_that_cannot_be_run_says_why() {
    let folder = prepared("scenes-bad", str::to_owned);
    let plan = std::fs::read_to_string(folder.join("plan.toml")).unwrap();
    for (file, text) in [
        ("same.toml", plan.replace("train-2", "train-1")),
        ("late.toml", plan.replace("3.0", "6.0")),
        ("none.toml", plan.replace("[\"train-1.toml\"]", "[]")),
        ("gone.toml", plan.replace("train-2", "gone-2")),
        ("typing.toml", plan.replace("scenes", "scnes")),
    ] {
        std::fs::write(folder.join(file), text).unwrap();
    }
    for (arguments, words) in [
        ("same.toml --scene crossing", "`train-1` has the seed 1101 of another scene"),
        ("late.toml --scene crossing", "warm_up_s 6 leaves nothing of `train-1`, which has 6 s"),
        ("none.toml --scene queue", "[training] has no scenes"),
        ("gone.toml --scene crossing", "gone-2.toml"),
        ("typing.toml --scene crossing", "unknown field `scnes`"),
        ("--train", "--train does not go with --scene motorway; it goes with crossing, queue, grade"),
        ("--scene queue --learn-lanes", "--learn-lanes does not go with --scene queue; it goes with crossing"),
        ("--scene two-radars --beside a.mcap", "--beside does not go with --scene two-radars; it goes with motorway, "),
        (
            "--every 2",
            "--every does not go with --scene motorway; it goes with crossing, queue, grade, gantry-camera, ",
        ),
        ("--scene roundabout", "possible values: motorway, crossing, queue, grade, gantry-camera"),
        ("plan.toml --scene crossing --every 0", "0 is not in 1..=1000"),
    ] {
        let output = experiment(&folder, arguments);
        let text = stderr(&output);
        assert!(output.status.code() == Some(2) && text.contains(words) && !text.contains("panicked"), "{text}");
    }
}
