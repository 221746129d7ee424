//! CAN logs of an ARS408: replayed, decoded as cantools decodes them, and judged by the doctor.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};
use viewshed_harness::recording::{ReadOptions, Recording, read};

use crate::scene::{folder, json, replay, stderr, stdout, viewshed};

const LOG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/ars408-made-up.log");

fn doctor(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_viewshed")).current_dir(folder).arg("doctor").args(arguments).output().unwrap()
}

/// Judges lines of a log; exit code and report.
fn judge(folder: &Path, lines: &[&str]) -> (i32, Value) {
    std::fs::write(folder.join("a.log"), lines.join("\n")).unwrap();
    let output = doctor(folder, &["a.log", "--json", "d.json", "--force"]);
    assert!(!stderr(&output).contains("panicked"), "{}", stderr(&output));
    (output.status.code().unwrap(), json(&folder.join("d.json")))
}

/// Severity and remedy of the finding that says this.
fn finding<'a>(report: &'a Value, what: &str) -> Option<(&'a str, &'a str)> {
    let all = report["findings"].as_array().unwrap();
    let found = all.iter().find(|f| f["what"].as_str().unwrap().contains(what))?;
    Some((found["severity"].as_str().unwrap(), found["do"].as_str().unwrap()))
}

#[test]
fn every_scan_of_the_shipped_log_is_what_cantools_decodes() {
    for (sensor, scans, detections) in [(0, 28, 487), (3, 28, 111)] {
        let options = ReadOptions { sensor_id: Some(sensor), ..Default::default() };
        let recording = read(Path::new(LOG), &options).unwrap();
        let mut csv = csv::Reader::from_path(LOG.replace(".log", &format!(".{sensor}.detections.csv"))).unwrap();
        let rows: Vec<csv::StringRecord> = csv.records().map(Result::unwrap).collect();
        let number = |row: &csv::StringRecord, column: usize| row[column].parse::<f64>().unwrap();
        let mut rows = rows.iter();
        for (k, frame) in recording.frames.iter().enumerate() {
            for d in &frame.detections {
                let row = rows.next().unwrap();
                assert_eq!(number(row, 0), k as f64);
                assert!((number(row, 1) - frame.time_ns as f64 * 1e-9).abs() < 1e-6);
                // half a centimetre, three steps of 2^16 to the turn, half a cm/s, half a dB
                assert!((number(row, 2) - f64::from(d.range_m)).abs() < 0.0051, "{row:?} {d:?}");
                assert!((number(row, 3) - f64::from(d.azimuth_rad).to_degrees()).abs() < 0.0165, "{row:?} {d:?}");
                assert!((number(row, 5) - f64::from(d.radial_velocity_mps)).abs() < 0.0053, "{row:?} {d:?}");
                assert_eq!(number(row, 6) as f32, d.rcs_dbsm.unwrap());
                assert_eq!((d.elevation_rad, d.snr_db), (None, None));
            }
        }
        assert!(rows.next().is_none());
        let found: usize = recording.frames.iter().map(|f| f.detections.len()).sum();
        assert_eq!((recording.frames.len(), found), (scans, detections));
        assert_eq!(recording.problems.count("left out") as usize, if sensor == 0 { 564 } else { 140 } - detections);
        assert_eq!(recording.problems.iter().count(), 3, "what was left out, and that mount and view are assumed");
    }
}

#[test]
fn a_can_log_is_replayed_without_rates_and_with_pictures() {
    let folder = folder("can_log");
    let arguments =
        [LOG, "--sensor-id", "0", "--mount", "0,0,5,0,2,0", "--json", "r.json", "--out", "out", "--mcap", "m.mcap"];
    let output = replay(&folder, &arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let report = json(&folder.join("r.json"));
    assert_eq!((&report["input"]["frames"], &report["input"]["labelled"]), (&json!(28), &json!(false)));
    let rows = report["estimators"].as_array().unwrap();
    let radar_3d = rows.iter().find(|r| r["name"] == "radar-3d").unwrap();
    for rate in ["tvr", "fvr", "tir", "fir", "cell_fvr", "cell_fir"] {
        assert_eq!(radar_3d[rate], Value::Null, "{rate}");
    }
    for picture in ["birdseye-radar-3d.png", "birdseye-radar-2d.png", "polar-radar-3d.png"] {
        assert!(folder.join("out").join(picture).exists(), "{picture}");
    }
    let copy = read(&folder.join("m.mcap"), &ReadOptions::default()).unwrap();
    let original = read(Path::new(LOG), &ReadOptions { sensor_id: Some(0), ..Default::default() }).unwrap();
    let kept = |recording: &Recording| -> Vec<_> {
        recording.frames.iter().map(|frame| (frame.time_ns, frame.detections.clone())).collect()
    };
    assert_eq!(kept(&copy), kept(&original), "the MCAP file has the detections too");
    assert_eq!(copy.pose.position[2], 5.0);
}

#[test]
fn labels_beside_a_can_log_make_rates() {
    let folder = folder("can_labels");
    std::fs::copy(LOG, folder.join("a.log")).unwrap();
    let row = |i: u32| format!("{},7,car,{},-1.75\n", f64::from(i) / 10.0, 20.0 + 2.7 * f64::from(i));
    let rows: String = (0..=20).map(row).collect();
    std::fs::write(folder.join("a.labels.csv"), format!("time_s,object_id,class,x_m,y_m\n{rows}")).unwrap();
    let output = replay(&folder, &["a.log", "--sensor-id", "0", "--json", "r.json", "--bootstrap", "0"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(json(&folder.join("r.json"))["objects"], json!(1));
}

#[test]
fn of_several_sensors_one_has_to_be_named() {
    let folder = folder("can_several");
    let output = replay(&folder, &[LOG]);
    assert_eq!(output.status.code(), Some(2));
    let text = stderr(&output);
    assert!(text.contains("0 on can0") && text.contains("3 on can0") && text.contains("--sensor-id"), "{text}");
    let output = replay(&folder, &[LOG, "--sensor-id", "5"]);
    assert!(stderr(&output).contains("no scan of sensor 5; sensors found: 0 on can0"));
    std::fs::write(folder.join("b.log"), "(1.0) can0 123#00\n").unwrap();
    let output = replay(&folder, &["b.log"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("viewshed doctor"), "{}", stderr(&output));
}

#[test]
fn the_doctor_lists_what_was_seen_and_what_was_expected() {
    let folder = folder("doctor");
    let output = doctor(&folder, &[LOG, "--json", "d.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stdout(&output).contains("Cluster_1_General"));
    let report = json(&folder.join("d.json"));
    let clusters = report["identifiers"].as_array().unwrap().iter().find(|i| i["id"] == "701").unwrap();
    assert_eq!((&clusters["frames"], &clusters["lengths"]), (&json!(564), &json!([8])));
    assert_eq!((&clusters["expected_length"], &clusters["expected"]), (&json!(8), &json!(true)));
    let sensors = report["sensors"].as_array().unwrap();
    assert_eq!((&sensors[0]["output"], &sensors[1]["output"]), (&json!("clusters"), &json!("objects")));
    for sensor in sensors {
        assert_eq!(
            (&sensor["announced"], &sensor["scans"], &sensor["counter_step"]),
            (&json!(28), &json!(28), &json!(2))
        );
        assert_eq!(sensor["counters"]["lost"], json!(0));
        assert_eq!(sensor["version"], "4.30.1");
    }
    assert!(finding(&report, "several sensors").is_some_and(|(_, remedy)| remedy.contains("--sensor-id")));
    let (_, remedy) = finding(&report, "sensor 3 on can0 sends objects").unwrap();
    assert!(remedy.contains("230#7800000010240000"));
}

#[test]
fn the_doctor_says_what_to_do_about_a_silent_bus() {
    let folder = folder("doctor_silent");
    let (code, report) = judge(&folder, &["(1.0) can0 123#00", "(1.5) can0 456#0102"]);
    assert_eq!(code, 1);
    let (severity, remedy) = finding(&report, "nothing of an ARS408").unwrap();
    assert!(severity == "error" && remedy.contains("500 kbit/s") && remedy.contains("termination"));
    assert!(report["findings"][0]["what"].as_str().unwrap().contains("123, 456"));
    assert!(finding(&report, "lasts 0.5 s, which is too short").is_some());
    // there, but its output is switched off
    let (code, report) = judge(&folder, &["(1.0) can0 221#401F400012000000", "(1.1) can0 720#041E0100"]);
    assert_eq!(code, 1);
    let (_, remedy) = finding(&report, "sends no scans; it says its output is nothing").unwrap();
    assert!(remedy.contains("220#7800000010240000"), "{remedy}");
    // an error frame
    let (code, report) = judge(&folder, &["(1.0) can0 20000040#0000000000000000"]);
    assert_eq!(code, 1);
    assert!(finding(&report, "went off the bus").is_some());
}

#[test]
fn the_doctor_finds_losses_faults_lengths_and_foreign_clocks() {
    let folder = folder("doctor_ill");
    let mut lines = vec![
        // interference, no speed, no yaw rate, no quality; says its id is 1
        "(1.000) can0 201#401F500011C40000".to_owned(),
        "(1.001) can0 301#8001000000000000".to_owned(),
        "(1.002) can0 300#43E8".to_owned(),
        "what is this".to_owned(),
        "(1.003) can0 0000060A#00000010".to_owned(),
    ];
    for (i, counter) in [0, 2, 4, 6, 8, 10, 16, 18, 20, 22].iter().enumerate() {
        let t = 1.1 + 0.07 * i as f64;
        lines.push(format!("({t:.3}) can0 60A#01{counter:04X}10"));
        // a third of the entries is lost
        if i % 3 != 1 {
            lines.push(format!("({:.3}) can0 60B#015143FF80200080", t + 0.001));
        }
    }
    lines.push("(1.900) can0 60B#015143FF802000".to_owned());
    lines.push("(1.800) can0 700#041E0100".to_owned());
    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    let (code, report) = judge(&folder, &lines);
    assert_eq!(code, 1, "a frame too short is an error");
    for (what, remedy) in [
        ("reports interference", "another radar"),
        ("reports speed missing", "`cansend can0 300#0000` and `cansend can0 301#8000`"),
        ("reports yaw rate missing", "`cansend can0 300#0000` and"),
        ("sends no quality", "`cansend can0 200#78"),
        ("says that its id is 1", "power it off and on"),
        ("is told that it moves, at up to 20.00 m/s", "stands"),
        ("1 lines of the log are no frames", "candump -L"),
        ("radar's identifier in 29 bits", "11 bits"),
        ("scans miss most of their entries", "queue"),
        ("scans never came", "queue"),
        ("60B (Obj_1_General) comes with 7 or 8 bytes, and 8 are needed", "another device"),
        ("301 (YawRateInformation) comes with 8 bytes, of which the first 2 are read", "nothing has to be done"),
        ("lines that are not in the order of time, by up to 100.0 ms", "nothing for this report"),
    ] {
        let found = finding(&report, what).unwrap_or_else(|| panic!("{what}: {:#}", report["findings"]));
        assert!(found.1.contains(remedy), "{what}: {}", found.1);
    }
}

#[test]
fn the_doctor_knows_a_clone_by_its_distances_and_judges_it_by_its_profile() {
    let folder = folder("doctor_clone");
    let mut lines = Vec::new();
    for i in 0..20 {
        let t = 1.0 + 0.07 * f64::from(i);
        lines.push(format!("({t:.3}) can0 600#0002{:04X}10", 2 * i));
        // raw 4200 and 3400: 110 and 70 m by its own scales, 340 and 180 m by the original's
        lines.push(format!("({:.3}) can0 701#01834064A0640094", t + 0.001));
        lines.push(format!("({:.3}) can0 701#026A4064A0640094", t + 0.002));
    }
    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    let (_, report) = judge(&folder, &lines);
    let (severity, remedy) = finding(&report, "50 % of its entries lie beyond 255 m").expect("a finding");
    assert!(severity == "error" && remedy.contains("--radar SR75"), "{remedy}");
    let output = doctor(&folder, &["a.log", "--radar", "SR75", "--force", "--json", "d.json", "--detections", "d.csv"]);
    let report = json(&folder.join("d.json"));
    assert_eq!(finding(&report, "of its entries lie beyond"), None, "{}", stderr(&output));
    assert_eq!(report["sensors"][0]["entries"], json!(40));
    let csv = std::fs::read_to_string(folder.join("d.csv")).unwrap();
    let ranges: Vec<f64> = csv.lines().skip(1).map(|row| row.split(',').nth(2).unwrap().parse().unwrap()).collect();
    assert!(ranges.iter().all(|range| (60.0..125.0).contains(range)), "{ranges:?}");
}

#[test]
fn the_doctor_tells_two_devices_with_one_id_restarts_and_heat() {
    let folder = folder("doctor_twice");
    let mut lines = vec!["(0.900) can0 201#401F480010140000".to_owned()];
    for (i, counter) in [500, 502, 504, 506, 508, 0, 2, 4].iter().enumerate() {
        // a scan every 200 ms, every frame twice
        let t = 1.0 + 0.2 * i as f64;
        for _ in 0..2 {
            lines.push(format!("({t:.3}) can0 60A#01{counter:04X}10"));
        }
        for _ in 0..2 {
            lines.push(format!("({:.3}) can0 60B#015143FF80200080", t + 0.001));
        }
        lines.push(format!("({:.3}) can0 60C#010000000000C8", t + 0.002));
    }
    let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
    let (code, report) = judge(&folder, &lines);
    assert_eq!(code, 1, "a fault is an error");
    for (what, severity, remedy) in [
        ("entries or status messages came twice", "warning", "two devices with one sensor id"),
        ("started over 1 times", "warning", "supply"),
        ("reports temperature", "error", "cool"),
        ("a scan every 200 ms", "warning", "time stamps"),
        ("700 (VersionID) was expected and not seen", "warning", "gateway"),
    ] {
        let found = finding(&report, what).unwrap_or_else(|| panic!("{what}: {:#}", report["findings"]));
        assert!(found.0 == severity && found.1.contains(remedy), "{what}: {found:?}");
    }
}

#[test]
fn a_log_read_as_of_another_kind_of_radar_is_told_and_the_queue_is_not_blamed() {
    let folder = folder("doctor_kind");
    let output = doctor(&folder, &[LOG, "--radar", "SR75"]);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(
        text.contains("sensor 0 on can0 is rather an ARS408 than an SR75: by the scales of an SR75 0 scans are whole"),
        "{text}"
    );
    assert!(text.contains("read it with --radar ARS408") && !text.contains("queue"), "{text}");
    let read = |sensor: &str| {
        let output = replay(&folder, &[LOG, "--radar", "SR75", "--sensor-id", sensor, "--mount", "0,0,5,0,2,0"]);
        stdout(&output) + &stderr(&output)
    };
    // clusters are counted otherwise, objects are whole
    assert!(read("0").contains("sensor 0 on can0 is rather an ARS408 than an SR75"), "{}", read("0"));
    assert!(read("3").contains("points: sensor 3 is rather an ARS408 than an SR75"), "{}", read("3"));
}

#[test]
fn the_doctor_judges_the_sensor_that_is_asked_for() {
    let folder = folder("doctor_sensor");
    let one = doctor(&folder, &[LOG, "--sensor-id", "3"]);
    assert!(one.status.success() && !stdout(&one).contains("sensor 0 on can0"), "{}", stdout(&one));
    let none = doctor(&folder, &[LOG, "--sensor-id", "5"]);
    assert_eq!(none.status.code(), Some(1));
    assert!(stdout(&none).contains("WRONG: sensor 5 is not there; sensors heard: 0, 3"), "{}", stdout(&none));
}

#[test]
fn a_report_without_labels_says_what_was_assumed_and_how_many_frames_count() {
    let folder = folder("log_report");
    let output = replay(&folder, &[LOG, "--sensor-id", "0", "--report", "r.html"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stdout(&output).contains("Not counted: the first 1 s, 15 frames"), "{}", stdout(&output));
    let html = std::fs::read_to_string(folder.join("r.html")).unwrap();
    for needed in [
        "href=\"#notes\"",
        "id=\"notes\"",
        "a raw capture has no mount: 6 m high and level assumed",
        "a raw capture has no field of view",
        "assumed: x 0.00 m",
        "assumed: azimuth -60.0",
        "13 of 28 frames",
    ] {
        assert!(html.contains(needed), "{needed}");
    }
    let output = replay(&folder, &[LOG, "--sensor-id", "0", "--to", "0.5"]);
    assert_eq!(output.status.code(), Some(2), "{}", stdout(&output));
    assert!(stderr(&output).contains("nothing can be judged") && stderr(&output).contains("warm-up of 1 s"));
}

#[test]
fn what_is_doubtful_ends_with_1_and_an_empty_file_is_called_empty() {
    let folder = folder("doctor_doubtful");
    let (code, report) = judge(&folder, &["(1.000) can0 60A#00010010", "(1.100) can0 60A#00020010"]);
    assert!(report["findings"].as_array().unwrap().iter().all(|f| f["severity"] != "error"), "{report:#}");
    assert_eq!(code, 1, "{report:#}");
    std::fs::write(folder.join("empty.log"), "").unwrap();
    for command in ["doctor empty.log", "replay empty.log", "listen empty.log", "view empty.log --no-open"] {
        let output = viewshed(&folder, command);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains("empty.log is empty"), "{command}: {}", stderr(&output));
    }
}

#[test]
fn the_doctor_refuses_what_is_no_log() {
    let folder = folder("doctor_foreign");
    std::fs::write(folder.join("a.log"), "time,x,y\n").unwrap();
    let output = doctor(&folder, &["a.log"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("candump -L"), "{}", stderr(&output));
    assert_eq!(doctor(&folder, &["absent.log"]).status.code(), Some(2));
}

#[test]
fn the_doctor_knows_a_broadcast_of_visibility() {
    let folder = folder("doctor_broadcast");
    let bus = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_viewshed")).current_dir(&folder).arg("bus").args(arguments).output().unwrap()
    };
    crate::scene::Scene::default().save(&folder, "a");
    let output = bus(&["a.mcap", "--log", "maps.log", "--sensor", "3"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let output = doctor(&folder, &["maps.log", "--json", "d.json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
    let report = json(&folder.join("d.json"));
    for what in ["no radar is on this bus, but the visibility broadcast", "visibility is broadcast there by sensor 3"] {
        assert!(finding(&report, what).is_some_and(|(_, remedy)| remedy.contains("viewshed listen")), "{what}");
    }
    let output = viewshed(&folder, "listen maps.log --out maps");
    assert!(stdout(&output).contains("  state ok, up for "), "{}{}", stdout(&output), stderr(&output));
    let drawn =
        ["sensor-3-0000.png", "sensor-3-0000-from-above.png"].map(|name| folder.join("maps").join(name).exists());
    assert_eq!(drawn, [true, true]);
    // and a log of a CAN bus goes through `bus` as any recording does
    let output = bus(&[LOG, "--sensor-id", "0", "--mount", "0,0,5,0,2,0"]);
    assert!(output.status.success() && stdout(&output).contains("classic-500k"), "{}", stderr(&output));
}

#[test]
fn the_doctor_says_which_message_a_filter_left_out_and_not_that_the_radar_is_silent() {
    let folder = folder("doctor_filtered");
    let log = std::fs::read_to_string(LOG).unwrap();
    for (sensor, status, name) in [(0, "600", "Cluster_0_Status"), (3, "63A", "Obj_0_Status")] {
        let left: Vec<&str> = log.lines().filter(|line| !line.contains(&format!(" {status}#"))).collect();
        let (code, report) = judge(&folder, &left);
        assert_eq!(code, 1);
        let what = format!("sensor {sensor} on can0: {status} ({name}) is missing");
        assert!(finding(&report, &what).unwrap().1.contains("filter"), "{what}");
        assert!(finding(&report, &format!("sensor {sensor} on can0 is there but sends no scans")).is_none());
    }
}

#[test]
fn a_log_that_was_not_understood_says_nothing_of_the_bus() {
    let folder = folder("doctor_not_understood");
    let rest = vec!["(1.1) can0 what is this"; 30];
    let (code, report) = judge(&folder, &[vec!["(1.0) can0 123#00"], rest].concat());
    assert_eq!(code, 1);
    let (severity, remedy) = finding(&report, "could not be understood").unwrap();
    assert!(severity == "error" && remedy.contains("candump -L"));
    assert!(!report["findings"].to_string().contains("termination"), "{report:#}");
}

#[test]
fn frames_marked_as_can_fd_and_lines_out_of_order_are_read_and_told() {
    let folder = folder("doctor_marked");
    let log = std::fs::read_to_string(LOG).unwrap();
    let marked = log.replace('#', "##0");
    let (code, report) = judge(&folder, &marked.lines().collect::<Vec<_>>());
    assert_eq!((code, &report["sensors"][0]["scans"]), (1, &json!(28)));
    assert!(finding(&report, "marked as CAN FD").unwrap().1.contains("classic CAN"));
    let newest_first: Vec<&str> = log.lines().rev().collect();
    let (code, report) = judge(&folder, &newest_first);
    assert_eq!((code, &report["sensors"][0]["scans"]), (0, &json!(28)));
    assert_eq!(finding(&report, "newest line comes first").unwrap().0, "note");
    assert!(finding(&report, "runs backwards").is_none());
    // the same clock once more
    let twice = format!("{log}{log}");
    let (code, report) = judge(&folder, &twice.lines().collect::<Vec<_>>());
    assert_eq!(code, 1);
    assert!(finding(&report, "time runs backwards").unwrap().1.contains("one bus"));
    assert!(finding(&report, "started over").is_none(), "the log did, not the radar");
}

/// Words on a line that nobody can be told, and a file with a name of another country's letters.
#[cfg(target_os = "linux")]
#[test]
fn neither_a_full_device_nor_a_name_that_is_no_utf_8_ends_in_a_panic() {
    use std::os::unix::ffi::OsStrExt;
    let folder = folder("can_names");
    let viewshed = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
        command.current_dir(&folder);
        command
    };
    let name = std::ffi::OsStr::from_bytes(b"gro\xDF.log");
    std::fs::copy(LOG, folder.join(name)).unwrap();
    let arguments = ["--sensor-id", "0", "--report", "r.html", "--force"];
    let output = viewshed().arg("replay").arg(name).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(std::fs::read_to_string(folder.join("r.html")).unwrap().contains("gro\u{FFFD}.log"));
    let full = || std::fs::File::options().write(true).open("/dev/full").unwrap();
    for arguments in [["doctor", "nothing.log"], ["replay", "nothing.log"], ["doctor", LOG], ["bus", LOG]] {
        // a panic is exit code 101
        let code = viewshed().args(arguments).stderr(full()).output().unwrap().status.code().unwrap();
        assert!(code <= 2, "{arguments:?}: {code}");
        let code = viewshed().args(arguments).stdout(full()).stderr(full()).output().unwrap().status.code().unwrap();
        assert_eq!(code, 2, "{arguments:?}");
    }
}
