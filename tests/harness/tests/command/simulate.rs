//! `viewshed simulate` and `viewshed experiment` as commands: the same bytes, the contract, and bad input.

use std::path::Path;
use std::process::{Command, Output};

use viewshed_harness::evaluation::bounds::{self, BOX};
use viewshed_harness::evaluation::{self, samples};
use viewshed_harness::recording::{self, ReadOptions, mcap};
use viewshed_harness::studies::experiment::hidden;
use viewshed_harness::studies::experiment::plan::Plan;

use crate::scene::{folder, json, replay, stderr, stdout};

/// A radar and a camera over one lane; a truck and a car drive away from them.
const SCENE: &str = r#"
name = "small"
seed = 5
start_unix_s = 1700000000
duration_s = 3.0
[traffic]
fcd = "small.fcd.xml"
from_s = 10.0
[radar]
name = "gantry"
mount = { height_m = 6.0, pitch_deg = 4.0 }
field_of_view = { azimuth_deg = [-60.0, 60.0], elevation_deg = [-16.0, 16.0], range_m = [3.0, 200.0] }
rate_hz = 15.0
[[radar.outage]]
from_s = 2.0
to_s = 2.3
frames = "missing"
[camera]
name = "camera"
mount = { height_m = 6.0, pitch_deg = 6.0 }
image = { width_px = 1280, height_px = 720, view_deg = 60.0 }
rate_hz = 5.0
[[static]]
id = "rail"
class = "barrier"
center = [60.0, -6.0]
length_m = 80.0
width_m = 0.3
height_m = 0.75
posts = { spacing_m = 4.0, rcs_dbsm = -5.0, height_m = 0.6 }
"#;

fn traffic() -> String {
    let mut text = String::from("<fcd-export>\n");
    for k in 0..12 {
        let t = 9.0 + 0.5 * f64::from(k);
        let x = 20.0 + 20.0 * (t - 10.0);
        text += &format!("<timestep time=\"{t:.2}\">\n");
        text += &format!("<vehicle id=\"truck.0\" x=\"{:.2}\" y=\"0.00\" angle=\"90.00\" type=\"truck\"/>\n", x + 30.0);
        text += &format!("<vehicle id=\"car.0\" x=\"{x:.2}\" y=\"3.75\" angle=\"90.00\" type=\"car\"/>\n");
        text += "</timestep>\n";
    }
    text + "</fcd-export>\n"
}

/// Writes scene and traffic, with something replaced, into a fresh folder.
fn prepared(test: &str, scene: [&str; 2], fcd: [&str; 2]) -> std::path::PathBuf {
    let folder = folder(test);
    let changed = |text: &str, [from, to]: [&str; 2]| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    };
    std::fs::write(folder.join("small.toml"), changed(SCENE, scene)).unwrap();
    std::fs::write(folder.join("small.fcd.xml"), changed(&traffic(), fcd)).unwrap();
    folder
}

fn viewshed(folder: &Path, threads: &str, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
    command.current_dir(folder).env("RAYON_NUM_THREADS", threads).args(arguments).output().unwrap()
}

fn simulate(folder: &Path, threads: &str, out: &str, more: &[&str]) -> Output {
    viewshed(folder, threads, &[&["simulate", "small.toml", "--out", out], more].concat())
}

#[test]
fn one_seed_gives_the_same_bytes_on_any_number_of_threads_and_another_seed_others() {
    let folder = prepared("same-bytes", ["", ""], ["", ""]);
    for (threads, out, more) in
        [("1", "a.mcap", &[][..]), ("4", "b.mcap", &[][..]), ("4", "c.mcap", &["--seed", "6"][..])]
    {
        let output = simulate(&folder, threads, out, more);
        assert!(output.status.success(), "{}", stderr(&output));
    }
    let bytes = |name: &str| std::fs::read(folder.join(name)).unwrap();
    assert!(bytes("a.mcap") == bytes("b.mcap"), "one thread or four");
    assert!(bytes("a.mcap") != bytes("c.mcap"), "the seed matters");
    assert!(std::fs::read_dir(&folder).unwrap().flatten().all(|e| !e.path().ends_with("part")));
}

#[test]
fn a_recording_keeps_to_the_contract_and_can_be_replayed() {
    let folder = prepared("contract", ["", ""], ["", ""]);
    let output = simulate(&folder, "2", "r.mcap", &["--json", "made.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stdout(&output).contains("times real time"), "{}", stdout(&output));
    let made = json(&folder.join("made.json"));
    // 45 frames in 3 s; those from 2.0 s to before 2.3 s are missing
    assert_eq!((made["made"]["frames"].as_u64(), made["made"]["camera_frames"].as_u64()), (Some(40), Some(15)));
    assert_eq!(made["made"]["vehicles"], 2);
    let recording = recording::read(&folder.join("r.mcap"), &ReadOptions::default()).unwrap();
    assert!(recording.problems.is_empty());
    assert_eq!((recording.frames.len(), recording.frames[0].time_ns), (40, 1_700_000_000_000_000_000));
    let truth = recording.truth.as_ref().unwrap();
    let classes: Vec<&str> = truth.tracks.iter().map(|t| t.class.as_str()).collect();
    assert_eq!(classes, ["car", "barrier", "barrier", "truck"]);
    let text = replay(&folder, &["r.mcap", "--bootstrap", "0", "--json", "r.json"]);
    assert!(text.status.success(), "{}", stderr(&text));
    assert!(json(&folder.join("r.json"))["coverage_rate"].as_f64().unwrap() > 0.9);
}

#[test]
fn a_camera_beside_the_radar_has_rows_of_its_own() {
    let folder = prepared("camera-rows", ["", ""], ["", ""]);
    assert!(simulate(&folder, "2", "r.mcap", &[]).status.success());
    let output = replay(&folder, &["r.mcap", "--bootstrap", "0", "--json", "r.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let report = json(&folder.join("r.json"));
    let camera = &report["camera"];
    let rows = camera["estimators"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|e| e["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["camera-3d", "camera-true-boxes", "geometry-slice", "geometry-box"]);
    // 5 Hz after the first second
    assert_eq!((camera["frames"].as_u64(), camera["objects"].as_u64()), (Some(10), Some(2)));
    assert!(camera["coverage_rate"].as_f64().unwrap() > 0.7, "{}", camera["coverage_rate"]);
    assert!(rows[0]["tvr"].as_f64().unwrap() > 0.7 && rows[1]["tvr"].as_f64().unwrap() > 0.9, "{rows:#?}");
    assert!(rows[0]["curve"].as_array().unwrap().len() > 1, "over the threshold of the mean");
    assert_eq!(camera["sensor"]["mount"]["pitch_deg"].as_f64().map(f64::round), Some(6.0));
    assert!(stdout(&output).contains("r, camera (sensor camera): 10 of "), "{}", stdout(&output));
}

#[test]
fn several_radars_in_one_recording_are_judged_each_and_as_one_map() {
    let second = "[[further_radar]]\nname = \"Other end\"\n\
                  mount = { x_m = 160.0, height_m = 6.0, yaw_deg = 180.0, pitch_deg = 4.0 }\n[[static]]";
    let folder = prepared("several-radars", ["[[static]]", second], ["", ""]);
    let output = simulate(&folder, "2", "r.mcap", &["--json", "made.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    // 40 of the first, 45 of the second
    assert_eq!(json(&folder.join("made.json"))["made"]["frames"], 85);

    let radars = recording::read_each(&folder.join("r.mcap"), &ReadOptions::default()).unwrap();
    let known: Vec<(&str, usize, i64)> = radars
        .iter()
        .map(|(r, _)| (r.sensor.name.as_str(), r.frames.len(), r.pose.yaw_rad().to_degrees().round().abs() as i64))
        .collect();
    assert_eq!(known, [("gantry", 40, 0), ("Other end", 45, 180)]);

    let output = replay(&folder, &["r.mcap", "--bootstrap", "0", "--json", "r.json", "--out", "out"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let reports = json(&folder.join("r.json"));
    assert_eq!(reports.as_array().map(Vec::len), Some(2));
    let rows = reports[0]["fused"]["rows"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|row| row["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["radar-3d, gantry", "radar-3d, Other end", "camera-3d, camera", "fused"]);
    let detected = |row: usize| rows[row]["on_the_road_of_any"]["detected"].as_u64().unwrap();
    assert!(detected(3) > 0 && (0..3).all(|row| detected(3) >= detected(row)), "{rows:#?}");
    assert!(reports[1]["fused"].is_null());
    assert!(stdout(&output).contains("On the road that any of them looks at"), "{}", stdout(&output));
    for file in ["fused.txt", "who-sees.png", "r-radar-gantry-points/table.txt", "r-radar-other_end-points/table.txt"] {
        assert!(folder.join("out").join(file).exists(), "{file}");
    }
}

#[test]
fn a_radar_and_its_camera_are_one_map_where_that_is_asked_for() {
    let folder = prepared("fused-camera", ["", ""], ["", ""]);
    assert!(simulate(&folder, "2", "r.mcap", &[]).status.success());
    let output = replay(&folder, &["r.mcap", "--bootstrap", "0", "--json", "r.json", "--fused"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(json(&folder.join("r.json"))["fused"]["rows"].as_array().map(Vec::len), Some(3));
    let without = SCENE.find("[camera]").unwrap()..SCENE.find("[[static]]").unwrap();
    let folder = prepared("fused-alone", [&SCENE[without], ""], ["", ""]);
    assert!(simulate(&folder, "2", "r.mcap", &[]).status.success());
    let output = replay(&folder, &["r.mcap", "--bootstrap", "0", "--fused"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("--fused is for several radars in one recording"), "{}", stderr(&output));
}

#[test]
fn what_cannot_be_simulated_is_told_with_its_place_and_leaves_no_recording() {
    let none = ["", ""];
    let car = "id=\"car.0\" x=\"20.00\" y=\"3.75\"";
    // name, what is replaced in the scene and in the traffic, what the error says
    type Case = (&'static str, [&'static str; 2], [&'static str; 2], &'static [&'static str]);
    let cases: [Case; 12] = [
        ("type", none, ["type=\"car\"", "type=\"rocket\""], &["small.fcd.xml, line 4", "`car.0`", "`rocket`"]),
        ("nan", none, [car, "id=\"car.0\" x=\"nan\" y=\"3.75\""], &["small.fcd.xml, line 12", "`car.0`", "x `nan`"]),
        (
            "through",
            ["height_m = 6.0, pitch_deg = 4.0", "x_m = 40.0, y_m = 3.75, height_m = 1.0"],
            none,
            &["car `car.0` drives through radar `gantry`"],
        ),
        (
            "net",
            ["from_s = 10.0", "from_s = 10.0\nnet = \"gone.net.xml\""],
            none,
            &["SUMO net gone.net.xml", "cannot read"],
        ),
        (
            "types",
            ["from_s = 10.0", "from_s = 10.0\ntypes = [\"gone.rou.xml\"]"],
            none,
            &["vehicle types", "gone.rou.xml"],
        ),
        ("empty", ["from_s = 10.0", "from_s = 500.0"], none, &["an empty scene", "its times are 9 s to 14.5 s"]),
        ("away", ["from_s = 10.0", "from_s = 10.0\norigin = [5000.0, 0.0]"], none, &["an empty scene", "m away"]),
        (
            "below",
            ["height_m = 6.0, pitch_deg = 4.0", "height_m = -1.0"],
            none,
            &["radar `gantry`", "mount.height_m is -1"],
        ),
        (
            "inside",
            ["height_m = 6.0, pitch_deg = 4.0", "x_m = 60.0, y_m = -6.0, height_m = 0.5"],
            none,
            &["radar `gantry`: it is inside of static `rail`"],
        ),
        ("key", ["rate_hz = 15.0", "rate_hz = 15.0\nratte = 1.0"], none, &["small.toml", "line 14", "ratte"]),
        ("cut", none, ["</fcd-export>", ""], &["small.fcd.xml", "cut off"]),
        ("twice", none, ["id=\"truck.0\"", "id=\"car.0\""], &["`car.0`", "order of time"]),
    ];
    for (name, scene, fcd, expected) in cases {
        let folder = prepared(&format!("bad-{name}"), scene, fcd);
        let output = simulate(&folder, "2", "r.mcap", &[]);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{name}: {text}");
        assert!(text.starts_with("error: ") && !text.contains("panicked"), "{name}: {text}");
        for words in expected {
            assert!(text.contains(words), "{name}: no `{words}` in: {text}");
        }
        let left: Vec<_> = std::fs::read_dir(&folder).unwrap().flatten().map(|e| e.file_name()).collect();
        assert_eq!(left.len(), 2, "{name}: {left:?}");
    }
}

#[test]
fn a_file_that_cannot_be_written_is_named() {
    let folder = prepared("unwritable", ["", ""], ["", ""]);
    let output = simulate(&folder, "2", "no/such/folder/r.mcap", &[]);
    assert!(stderr(&output).contains("cannot write no/such/folder/r.mcap"), "{}", stderr(&output));
    let output = simulate(&folder, "2", "r.mcap", &["--duration", "0"]);
    assert!(stderr(&output).contains("duration_s is 0, it must be above 0 and at most 86400"), "{}", stderr(&output));
}

#[test]
fn sixty_vehicles_in_view_are_simulated() {
    let folder = prepared("dense", ["fcd = \"small.fcd.xml\"\nfrom_s = 10.0", "fcd = \"dense.csv\""], ["", ""]);
    let mut text = String::from("time_s,object_id,class,x_m,y_m,heading_rad\n");
    for (lane, y) in [-11.25, -7.5, -3.75, 3.75, 7.5, 11.25].into_iter().enumerate() {
        for k in 0..16 {
            for step in 0..10 {
                let (t, x) = (f64::from(step) * 0.5 - 0.5, 10.0 + 15.0 * f64::from(k) + 5.0 * f64::from(step));
                text += &format!("{t},{lane}.{k},{},{x},{y},0\n", if k % 4 == 0 { "truck" } else { "car" });
            }
        }
    }
    std::fs::write(folder.join("dense.csv"), text).unwrap();
    let output = simulate(&folder, "2", "r.mcap", &["--json", "made.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let made = json(&folder.join("made.json"));
    assert!(made["made"]["vehicles_in_view"].as_f64().unwrap() >= 60.0, "{made}");
}

#[test]
fn the_shipped_experiment_hides_enough_and_not_too_much() {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/experiment.toml");
    let plan = Plan::read(&shipped).unwrap();
    let mut all = evaluation::counts::Counts::default();
    for day in plan.reporting.iter().chain([&plan.training]) {
        let mut simulation = plan.simulation(day).unwrap();
        // lines of sight do not depend on the rate; one frame a second is enough and fifteen times as fast
        simulation.scene.radar.rate_hz = 1.0;
        let (sink, _) = simulation.record(std::io::Cursor::new(Vec::new()), &|| ()).unwrap();
        let recording = mcap::parse(&sink.into_inner(), day.name(), &ReadOptions::default()).unwrap();
        let samples = samples::collect(&recording, &evaluation::Options::default(), &|| ());
        let score = bounds::boxes(&samples);
        assert_eq!(score.name, BOX);
        let counts = score.objects(&samples);
        let share = hidden(&counts).unwrap();
        assert!((0.02..=0.10).contains(&share), "{}: {share} of object-steps hidden", day.name());
        if *day != plan.training {
            all += counts;
        }
    }
    let (share, coverage) = (hidden(&all).unwrap(), all.coverage().unwrap());
    assert!((0.03..=0.10).contains(&share), "{share} of object-steps hidden");
    assert!((0.88..=0.96).contains(&coverage), "coverage {coverage}");
}

#[test]
fn an_experiment_pools_its_reporting_days_and_tells_each() {
    let folder = prepared("experiment", ["", ""], ["", ""]);
    for day in ["b", "c"] {
        std::fs::copy(folder.join("small.fcd.xml"), folder.join(format!("{day}.fcd.xml"))).unwrap();
    }
    let plan = "scene = \"small.toml\"\nduration_s = 3.0\n[training]\nfcd = \"small.fcd.xml\"\nseed = 1\n\
                [[reporting]]\nfcd = \"b.fcd.xml\"\nseed = 2\n[[reporting]]\nfcd = \"c.fcd.xml\"\nseed = 3\n";
    std::fs::write(folder.join("plan.toml"), plan).unwrap();
    let experiment = |results: &str| {
        let arguments = format!("experiment plan.toml --bootstrap 0 {results}");
        viewshed(&folder, "2", &arguments.split(' ').collect::<Vec<_>>())
    };
    let output = experiment("--keep days");
    assert!(output.status.success(), "{}", stderr(&output));
    let output = experiment("--json e.json --beside days/b.mcap");
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("3D radar, perfect occupancy") && text.contains("small (training, not pooled)"), "{text}");
    assert!(text.contains("b (sensor gantry): "), "{text}");
    let found = json(&folder.join("e.json"));
    let names: Vec<&str> =
        found["estimators"].as_array().unwrap().iter().map(|e| e["name"].as_str().unwrap()).collect();
    let rows = ["radar-2d", "radar-2d-first", "radar-3d", "true-boxes", "geometry-slice", "geometry-box"];
    assert_eq!(names, rows);
    let seeds = found["seeds"].as_array().unwrap();
    assert_eq!(seeds.iter().map(|s| s["seed"].as_u64().unwrap()).collect::<Vec<_>>(), [2, 3]);
    assert_eq!(found["training"]["seed"], 1);
    for (k, name) in rows.iter().enumerate() {
        for count in ["tv", "fv", "ti", "fi"] {
            let of = |report: &serde_json::Value| report["estimators"][k][count].as_u64().unwrap();
            assert_eq!(of(&found), seeds.iter().map(of).sum::<u64>(), "{name} {count}");
        }
    }
    let rate = |report: &serde_json::Value| report["coverage_rate"].as_f64().unwrap();
    let [low, high] = [rate(&seeds[0]).min(rate(&seeds[1])), rate(&seeds[0]).max(rate(&seeds[1]))];
    assert!((low..=high).contains(&rate(&found)));
    assert!(folder.join("days/c.mcap").exists());
}

#[test]
fn an_experiment_that_cannot_be_run_says_why() {
    let folder = folder("bad-experiment");
    let plan = "scene = \"s.toml\"\nduration_s = 5.0\n[training]\nfcd = \"a.xml\"\nseed = 1\n";
    std::fs::write(folder.join("none.toml"), format!("{plan}reporting = []\n")).unwrap();
    std::fs::write(folder.join("scene.toml"), format!("{plan}[[reporting]]\nfcd = \"b.xml\"\nseed = 2\n")).unwrap();
    for (arguments, words) in [
        (&["experiment", "gone.toml"][..], "cannot read experiment gone.toml"),
        (&["experiment", "none.toml"][..], "none.toml"),
        (&["experiment", "scene.toml"][..], "cannot read scene s.toml"),
    ] {
        let output = viewshed(&folder, "2", arguments);
        let text = stderr(&output);
        assert!(output.status.code() == Some(2) && text.contains(words) && !text.contains("panicked"), "{text}");
    }
}

#[test]
fn a_higher_mount_sees_more_of_dense_traffic_and_of_the_road() {
    let folder = folder("site-heights");
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/motorway.toml");
    let arguments = "--height 4,8 --lateral 0 --yaw 0 --pitch 4 --every 6 --sensors 1 --json site.json";
    let arguments: Vec<&str> = ["site", scene.to_str().unwrap()].into_iter().chain(arguments.split(' ')).collect();
    let output = viewshed(&folder, "2", &arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let found = json(&folder.join("site.json"));
    let [high, low] = [0, 1].map(|k| &found["candidates"][k]);
    assert_eq!((high["mount"]["height_m"].as_f64(), low["mount"]["height_m"].as_f64()), (Some(8.0), Some(4.0)));
    for key in ["vehicles_share", "coverage_rate", "road_share"] {
        assert!(high[key].as_f64().unwrap() > low[key].as_f64().unwrap() + 0.05, "{key}: {high} {low}");
    }
}

#[test]
fn mounts_are_ranked_alone_and_in_sets_and_impossible_ones_left_out() {
    let folder = prepared("site", ["duration_s = 3.0", "duration_s = 2.0"], ["", ""]);
    // over the car's lane at 1 m a car drives through; the truck hides the car's lane from the right only
    let arguments = [
        "--height",
        "1,6",
        "--along",
        "40",
        "--lateral",
        "-9,3.75,12",
        "--yaw",
        "0",
        "--pitch",
        "2:4:2",
        "--every",
        "0.5",
        "--stretch",
        "80,200",
    ];
    let results = ["--out", "site.png", "--json", "site.json"];
    let output = viewshed(&folder, "2", &[&["site", "small.toml"][..], &arguments, &results].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("One sensor, best first") && text.contains("Sets of 2, best first"), "{text}");
    assert!(
        text.contains("left out: x 40 m, y 3.75 m, h 1 m, yaw 0°, pitch 2°: car `car.0` drives through it"),
        "{text}"
    );
    let found = json(&folder.join("site.json"));
    let all = found["candidates"].as_array().unwrap();
    assert_eq!((all.len(), found["left_out"].as_array().unwrap().len()), (10, 2));
    let of = |entry: &serde_json::Value, key: &str| entry[key].as_f64().unwrap();
    assert!(all.windows(2).all(|pair| of(&pair[0], "vehicles_share") >= of(&pair[1], "vehicles_share")));
    let pair = &found["sets"][0];
    assert!(of(pair, "vehicles_by_one") >= of(&all[0], "vehicles_share"));
    assert!(
        of(pair, "vehicles_by_two") <= of(pair, "vehicles_by_one")
            && of(pair, "road_by_two") <= of(pair, "road_by_one")
    );
    assert_eq!(std::fs::read(folder.join("site.png")).unwrap()[..4], [0x89, b'P', b'N', b'G']);
    for (arguments, words) in [
        (&["--height", "-3,0"][..], "none of 36 candidate mounts is possible"),
        (&["--height", "high"][..], "`high` is no number"),
        (&["--stretch", "900,1000"][..], "no candidate has a moving vehicle in its field of view on that stretch"),
        (&["--along", "5000"][..], "an empty scene"),
        (&["--every", "0"][..], "--every 0"),
    ] {
        let output = viewshed(&folder, "2", &[&["site", "small.toml"][..], arguments].concat());
        let text = stderr(&output);
        assert!(output.status.code() == Some(2) && text.contains(words) && !text.contains("panicked"), "{text}");
    }
}
