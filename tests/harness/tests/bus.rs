//! `viewshed bus` and `viewshed listen` on the shipped recording: the figures that have to be met.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn viewshed(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_viewshed")).args(arguments).output().expect("the program runs")
}

fn scratch(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).expect("written")).expect("JSON")
}

/// Sends the shipped recording; unoptimised only its first seconds.
fn sent(name: &str, more: &[&str]) -> (Value, PathBuf) {
    let recording = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/motorway.mcap");
    let (report, log) = (scratch(&format!("{name}.json")), scratch(&format!("{name}.log")));
    let to = if cfg!(debug_assertions) { "8" } else { "30" };
    let paths = [report.to_str().expect("UTF-8"), log.to_str().expect("UTF-8")];
    // as a unit sends that has been on for long: what a start costs has a test of its own
    let settled = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/settled.toml");
    let options = ["--to", to, "--json", paths[0], "--log", paths[1], "--config", settled, "--force"];
    let arguments = [&["bus", recording][..], &options, more].concat();
    let output = viewshed(&arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    (json(&report), log)
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("no {key} in {value}"))
}

#[test]
fn maps_fit_their_buses_and_arrive() {
    let (report, log) = sent("bus-classic", &[]);
    let most = [
        ("classic-500k", 0.15, 0.25),
        ("classic-1M", 0.075, 0.125),
        ("fd-500k-2M", 0.02, 0.03),
        ("serial-230400", 0.25, 0.3),
    ];
    let buses = report["buses"].as_array().expect("buses");
    assert_eq!(buses.len(), most.len());
    for (bus, (name, median, worst)) in buses.iter().zip(most) {
        assert_eq!(bus["name"], name);
        assert!(number(bus, "load_median") <= median && number(bus, "load_worst") <= worst, "{bus}");
        assert!(number(bus, "load_median") > 0.003 && number(bus, "frames_per_scan") > 1.0, "{bus}");
        assert!(number(bus, "bytes_per_scan") > number(&report["entropy_bytes_per_scan"], "previous_scan"), "{bus}");
    }
    for received in report["received"].as_array().expect("received") {
        let least = match number(received, "loss") {
            0.0 => 1.0,
            0.01 => 0.97,
            0.05 => 0.90,
            _ => 0.4,
        };
        assert!(number(received, "visible_median") >= least, "{received}");
        assert_eq!(number(received, "wrongly_visible"), 0.0, "{received}");
        if least == 1.0 {
            assert_eq!(number(received, "equal"), 1.0, "every cell of every scan: {received}");
        }
    }
    listens(&log, report["scans"].as_u64().expect("scans"));
}

#[test]
fn a_start_costs_more_of_a_bus_and_shows_nothing_that_the_sender_does_not() {
    let report = scratch("bus-start.json");
    let recording = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/motorway.mcap");
    let output = viewshed(&["bus", recording, "--to", "12", "--json", report.to_str().expect("UTF-8"), "--force"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report = json(&report);
    for (bus, most) in report["buses"].as_array().expect("buses").iter().zip([0.22, 0.11, 0.05, 0.3]) {
        assert!(number(bus, "load_median") <= most, "{bus}");
    }
    for received in report["received"].as_array().expect("received") {
        assert_eq!(number(received, "wrongly_visible"), 0.0, "{received}");
    }
}

#[test]
fn a_can_fd_log_with_visible_ranges_is_understood_as_well() {
    let (report, log) = sent("bus-fd", &["--bus", "fd-500k-2M", "--visible-range", "500"]);
    listens(&log, report["scans"].as_u64().expect("scans"));
}

fn listens(log: &Path, scans: u64) {
    let heard = log.with_extension("heard.json");
    let pictures = log.with_extension("pictures");
    // of an earlier run
    let _ = std::fs::remove_dir_all(&pictures);
    let arguments = [
        "listen",
        log.to_str().expect("UTF-8"),
        "--json",
        heard.to_str().expect("UTF-8"),
        "--force",
        "--out",
        pictures.to_str().expect("UTF-8"),
    ];
    let output = viewshed(&arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let heard = json(&heard);
    let sensor = &heard["sensors"][0];
    assert_eq!((&sensor["sensor"], &sensor["condition"], &heard["foreign"]), (&0.into(), &"ok".into(), &0.into()));
    assert_eq!((number(&sensor["header"], "height_m"), number(&sensor["header"], "cell_m")), (6.0, 1.0));
    for wrong in ["protection", "lost", "repeated", "out_of_sequence", "late", "malformed"] {
        assert_eq!(number(&sensor["counters"], wrong), 0.0, "{wrong}");
    }
    let maps = sensor["maps"].as_array().expect("maps");
    // once a second, but for the first two
    assert!(maps.len() as u64 >= scans / 15 - 2);
    assert!(maps.iter().all(|map| number(map, "visible") > 5000.0));
    let drawn = std::fs::read_dir(pictures).expect("a folder").count();
    // as the sensor sees it, and from above
    assert_eq!(drawn, 2 * maps.len());
}

/// What the counters of the protection say decides nothing: it is no reason why a frame was not used.
#[test]
fn a_frame_that_comes_twice_came_twice() {
    let (_, log) = sent("bus-doubled", &[]);
    let text = std::fs::read_to_string(&log).expect("written");
    let lines: Vec<&str> = text.lines().collect();
    // one of a map, in the middle
    let doubled =
        lines.len() / 2 + lines[lines.len() / 2..].iter().position(|line| line.contains(" 406#")).expect("a map");
    let (before, after) = lines.split_at(doubled + 1);
    let log = scratch("doubled.log");
    std::fs::write(&log, [before, &[lines[doubled]], after].concat().join("\n") + "\n").expect("written");
    let output = viewshed(&["listen", log.to_str().expect("UTF-8")]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let frames = said.lines().find_map(|line| line.strip_prefix("  frames: ")).expect("frames");
    let numbers: Vec<usize> = frames.split([' ', ';', ',']).filter_map(|word| word.parse().ok()).collect();
    assert_eq!(numbers[0], lines.len() + 1, "{frames}");
    // the first frame of an epoch is not used
    assert_eq!(numbers[1..3], [lines.len(), 1], "{frames}");
    assert!(
        frames.contains("1 first of an epoch, or of another; by their counters 0 never came, 1 came again"),
        "{frames}"
    );
}

#[test]
fn looks_are_taken_at_times_that_can_be() {
    let log = scratch("steps.log");
    std::fs::write(&log, "(1.0) can0 701#0011223344556677\n").expect("written");
    for every in ["1e-10", "0", "-1", "1e12", "inf", "nan"] {
        let output = viewshed(&["listen", log.to_str().expect("UTF-8"), "--every", every]);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{every}: {error}");
        assert!(error.contains("--every") && !error.contains("panicked"), "{every}: {error}");
    }
}

/// A load is of a second: of less there is none, and no receiver has settled.
#[test]
fn too_short_a_recording_has_no_figures() {
    let recording = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/motorway.mcap");
    let output = viewshed(&["bus", recording, "--to", "0.9"]);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{error}");
    assert!(error.contains("0.87 s of maps are too few") && error.contains("1.8 s are needed"), "{error}");
}

/// No option does nothing without a word.
#[test]
fn options_that_would_do_nothing_are_refused() {
    for arguments in [
        &["bus", "a.mcap", "--bus", "fd-500k-2M"][..],
        &["bus", "a.mcap", "--count-symbols", "--json", "x"],
        &["bus", "a.mcap", "--count-symbols", "--log", "y"],
        &["bus", "a.mcap", "--min-speed", "2"],
        &["bus", "a.mcap", "--warm-up", "2"],
        &["bus", "a.mcap", "--growth", "2"],
        &["bus", "a.mcap", "--grid", "polar"],
        &["bus", "a.mcap", "--bootstrap", "20"],
        &["bus", "a.mcap", "--seed", "20"],
        &["bus", "a.mcap", "--reference-share", "0.4"],
        &["listen", "a.log", "--for", "3"],
        &["doctor", "a.log", "--for", "3"],
        &["view", "a.mcap", "--baud", "9600"],
        &["view", "--can", "can0", "--baud", "9600"],
        &["replay", "a.mcap", "--mcap-estimator", "foo"],
    ] {
        let output = viewshed(arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        // by the command line, before any file is looked for
        assert!(error.contains("Usage: "), "{arguments:?}: {error}");
    }
}

#[test]
fn what_is_no_broadcast_is_told() {
    let log = scratch("other.log");
    std::fs::write(&log, "(1.0) can0 701#0011223344556677\n").expect("written");
    let output = viewshed(&["listen", log.to_str().expect("UTF-8")]);
    assert!(!output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("none of its 1 frames is of a broadcast"));
    let output = viewshed(&["bus", "--bus", "classic-250k"]);
    assert!(!output.status.success());
}

const KEY: &str = "000102030405060708090a0b0c0d0e0f";

/// Listens with these options; what it wrote as JSON, or what it complained of.
fn heard(log: &Path, more: &[&str]) -> Result<Value, String> {
    let heard = log.with_extension("heard.json");
    let paths = [log, &heard].map(|path| path.to_str().expect("UTF-8"));
    let output = viewshed(&[&["listen", paths[0], "--json", paths[1], "--force"], more].concat());
    if output.status.success() { Ok(json(&heard)) } else { Err(String::from_utf8_lossy(&output.stderr).into_owned()) }
}

#[test]
fn authenticated_logs_need_their_key_and_cost_little() {
    let file = scratch("key.txt");
    std::fs::write(&file, KEY).expect("written");
    let file = file.to_str().expect("UTF-8");
    for bus in ["fd-500k-2M", "serial-230400"] {
        let (report, log) = sent(&format!("secured-{bus}"), &["--key", KEY, "--bus", bus]);
        let buses = report["buses"].as_array().expect("buses");
        let names: Vec<&str> = buses.iter().map(|bus| bus["name"].as_str().expect("a name")).collect();
        assert_eq!(names[4..], ["fd-500k-2M-authenticated", "serial-230400-authenticated"]);
        for (bare, authenticated) in [(2, 4), (3, 5)] {
            let cost = number(&buses[authenticated], "load_median") / number(&buses[bare], "load_median");
            assert!((1.02..1.6).contains(&cost), "{bus}: {cost}");
        }
        for received in report["received"].as_array().expect("received") {
            assert_eq!(number(received, "wrongly_visible"), 0.0, "{received}");
            if number(received, "loss") == 0.0 {
                assert_eq!(number(received, "equal"), 1.0, "every cell of every scan: {received}");
            }
        }
        let right = heard(&log, &["--key-file", file]).expect("understood");
        let sensor = &right["sensors"][0];
        assert_eq!(sensor["condition"], "ok");
        assert_eq!(number(&sensor["counters"], "not_authentic"), 0.0, "{sensor}");
        let maps = sensor["maps"].as_array().expect("maps");
        assert!(maps.len() > 4 && maps.iter().all(|map| number(map, "visible") > 5000.0));
        let keyless = heard(&log, &[]).unwrap_err();
        assert!(keyless.contains("are authenticated; give the sender's key"), "{keyless}");
        let wrong = heard(&log, &["--key", &KEY.replace("0f", "1f")]).unwrap_err();
        assert!(wrong.contains("none is authentic with this key"), "{wrong}");
        // who has a key does not take what is not authenticated
        let (_, bare) = sent(&format!("bare-{bus}"), &["--bus", bus]);
        assert!(heard(&bare, &[]).is_ok());
        let refused = heard(&bare, &["--key-file", file]).unwrap_err();
        assert!(refused.contains("none is authentic"), "{refused}");
    }
    let recording = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/motorway.mcap");
    let output = viewshed(&["bus", recording, "--key", KEY, "--log", "classic.log"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("no room for an authenticator"));
}
