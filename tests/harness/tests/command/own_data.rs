//! Recordings that people have: logs of other tools, bags of other drivers, and what is wrong with them.

use std::collections::BTreeMap;
use std::io::{Cursor, Write};
use std::path::Path;
use std::process::{Command, Output, Stdio};

use flate2::Compression;
use flate2::write::GzEncoder;
use viewshed_harness::recording::can_log::candump;
use viewshed_harness::recording::{ReadOptions, Recording, read};

use crate::bag::Bag;
use crate::scene::{FRAMES, PERIOD_NS, Scene, folder, json, replay, stderr, stdout};

const LOG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/ars408-made-up.log");
const MOTORWAY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/motorway.mcap");

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(bytes).unwrap();
    packed.finish().unwrap()
}

/// The shipped log as other tools write it.
fn logs() -> Vec<(&'static str, String)> {
    let text = std::fs::read_to_string(LOG).unwrap();
    let lines: Vec<_> = text.lines().map(|line| candump::line(line).unwrap()).collect();
    let start = lines[0].time_ns;
    let mut screen = String::new();
    let mut differences = String::new();
    let mut asc =
        "date Fri Jun 5 03:46:52.436 pm 2020\nbase hex  timestamps absolute\ninternal events logged\n".to_owned();
    let mut savvycan = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n".to_owned();
    let mut before = start;
    for line in &lines {
        let Some(frame) = line.frame() else { continue };
        let (id, data) = (frame.id.raw(), frame.data());
        let bytes = |between: &str| data.iter().map(|b| format!("{b:02X}{between}")).collect::<String>();
        let micros = |ns: i64| (ns / 1_000_000_000, ns / 1000 % 1_000_000);
        let (s, us) = micros(line.time_ns);
        screen += &format!(" ({s:010}.{us:06})  {}  {id:03X}   [{}]  {}\n", line.interface, data.len(), bytes(" "));
        let (s, us) = micros(line.time_ns - before);
        differences += &format!(" ({s:03}.{us:06})  {}  {id:03X}   [{}]  {}\n", line.interface, data.len(), bytes(" "));
        before = line.time_ns;
        let (s, us) = micros(line.time_ns - start);
        let channel = &line.interface[3..];
        asc += &format!(
            "   {s}.{us:06} {channel}  {id:X}             Rx   d {} {} Length = 1 ID = {id}\n",
            data.len(),
            bytes(" ")
        );
        savvycan += &format!("{},{id:08X},false,Rx,{channel},{},{}\n", line.time_ns / 1000, data.len(), bytes(","));
    }
    vec![("screen.txt", screen), ("differences.txt", differences), ("vector.asc", asc), ("savvy.csv", savvycan)]
}

/// What a recording holds, its times counted from the first.
fn content(recording: &Recording) -> Vec<(i64, Vec<viewshed_harness::recording::RadarDetection>)> {
    let start = recording.frames[0].time_ns;
    recording.frames.iter().map(|f| ((f.time_ns - start) / 1000, f.detections.clone())).collect()
}

#[test]
fn a_log_says_the_same_whoever_wrote_it() {
    let folder = folder("own_logs");
    let options = ReadOptions { sensor_id: Some(0), ..ReadOptions::default() };
    let expected = content(&read(Path::new(LOG), &options).unwrap());
    assert_eq!(expected.len(), 28);
    for (name, text) in logs() {
        for (name, bytes) in
            [(name.to_owned(), text.clone().into_bytes()), (format!("{name}.gz"), gzip(text.as_bytes()))]
        {
            let path = folder.join(&name);
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(content(&read(&path, &options).unwrap()), expected, "{name}");
        }
    }
}

/// Runs a command with a log on its standard input.
fn piped(arguments: &[&str], input: &[u8]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
    let command = command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    child.stdin.take().unwrap().write_all(input).unwrap();
    child.wait_with_output().unwrap()
}

#[test]
fn logs_come_from_standard_input_too() {
    let log = std::fs::read(LOG).unwrap();
    for input in [log.clone(), gzip(&log)] {
        let doctor = piped(&["doctor", "-"], &input);
        assert!(stdout(&doctor).starts_with("standard input: "), "{}{}", stdout(&doctor), stderr(&doctor));
        let out = folder("own_stdin");
        let report = out.join("r.json");
        let arguments =
            ["replay", "-", "--sensor-id", "0", "--mount", "0,0,5,0,2,0", "--json", report.to_str().unwrap()];
        let replayed = piped(&arguments, &input);
        assert!(replayed.status.success(), "{}", stderr(&replayed));
        let report = json(&report);
        assert_eq!((&report["recording"], &report["input"]["frames"]), (&"stdin".into(), &28.into()));
    }
}

#[test]
fn an_interface_is_chosen_by_name() {
    let folder = folder("own_interface");
    let one = std::fs::read_to_string(LOG).unwrap();
    let other: String = one.lines().take(400).map(|line| format!("{}\n", line.replace("can0", "can1"))).collect();
    std::fs::write(folder.join("two.log"), format!("{one}{other}")).unwrap();
    let path = folder.join("two.log");
    let options = |interface: Option<&str>| ReadOptions {
        interface: interface.map(str::to_owned),
        sensor_id: Some(0),
        ..ReadOptions::default()
    };
    let frames = |interface| read(&path, &options(interface)).map(|r| r.frames.len());
    assert_eq!((frames(None).unwrap(), frames(Some("can0")).unwrap()), (28, 28), "the one with more frames");
    assert!((1..28).contains(&frames(Some("can1")).unwrap()));
    let error = frames(Some("can7")).unwrap_err().to_string();
    assert!(error.contains("no frame on interface can7; interfaces found: can0, can1"), "{error}");
}

/// With a field of view, which no foreign bag has.
fn options() -> ReadOptions {
    let field_of_view = Some(Scene::default().sensor.field_of_view);
    ReadOptions { field_of_view, ..ReadOptions::default() }
}

fn read_bag(folder: &Path, bag: &Bag, options: &ReadOptions) -> Result<Recording, String> {
    let path = folder.join("bag.mcap");
    std::fs::write(&path, bag.bytes()).unwrap();
    read(&path, options).map_err(|error| format!("{error:#}"))
}

#[test]
fn the_only_cloud_is_taken_whatever_its_topic_and_fields_are_called() {
    let folder = folder("own_bag");
    for velocity in ["velocity", "doppler", "radial_speed", "v_r", "range_rate"] {
        let bag = Bag { fields: vec!["x", "y", "z", velocity], ..Bag::default() };
        let recording = read_bag(&folder, &bag, &options()).unwrap();
        assert_eq!(recording.frames.len(), FRAMES);
        for (frame, (expected, _)) in recording.frames.iter().zip(&Scene::default().steps) {
            for (d, e) in frame.detections.iter().zip(&expected.detections) {
                assert!((d.range_m - e.range_m).abs() < 1e-3 && (d.azimuth_rad - e.azimuth_rad).abs() < 1e-5);
                assert!((d.elevation_rad.unwrap() - e.elevation_rad.unwrap()).abs() < 1e-5);
                assert_eq!(d.radial_velocity_mps, e.radial_velocity_mps);
            }
        }
    }
}

#[test]
fn each_of_several_radars_is_judged_alone() {
    let folder = folder("own_several");
    let bag = Bag { topics: vec!["/front/cloud", "/rear/cloud"], ..Bag::default() };
    std::fs::write(folder.join("two.mcap"), bag.bytes()).unwrap();
    let view = "--fov=-57,57,-17,17,3,150";
    let output = replay(&folder, &["two.mcap", view, "--out", "maps", "--json", "r.json"]);
    let text = stdout(&output);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(
        text.contains("two-front-cloud (sensor two): ") && text.contains("two-rear-cloud (sensor two): "),
        "{text}"
    );
    let report = json(&folder.join("r.json"));
    let names: Vec<&str> = report.as_array().unwrap().iter().map(|r| r["recording"].as_str().unwrap()).collect();
    assert_eq!(names, ["two-front-cloud", "two-rear-cloud"]);
    for name in names {
        assert!(folder.join("maps").join(name).join("birdseye-radar-3d.png").exists(), "{name}");
    }
    let one = replay(&folder, &["two.mcap", view, "--radar-topic", "/rear/cloud", "--mcap", "m.mcap"]);
    assert!(stdout(&one).starts_with("two: "), "{}{}", stdout(&one), stderr(&one));
    let both = replay(&folder, &["two.mcap", view, "--mcap", "m2.mcap"]);
    assert!(stderr(&both).contains("--mcap writes one radar's map"), "{}", stderr(&both));
    // the bag says how far each sees
    let told = |topics: &[&str]| {
        let mut bytes = Cursor::new(Vec::new());
        let mut writer = mcap::Writer::new(&mut bytes).unwrap();
        for topic in topics {
            let metadata = mcap::records::Metadata {
                name: "viewshed.sensor".into(),
                metadata: sensor_keys(if *topic == "/front/cloud" { 150.0 } else { 60.0 }, topic),
            };
            writer.write_metadata(&metadata).unwrap();
        }
        bag.write(&mut writer);
        writer.finish().unwrap();
        drop(writer);
        std::fs::write(folder.join("told.mcap"), bytes.into_inner()).unwrap();
        replay(&folder, &["told.mcap", "--json", "t.json", "--force"])
    };
    let output = told(&["/front/cloud", "/rear/cloud"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let report = json(&folder.join("t.json"));
    let range = |k: usize| report[k]["sensor"]["field_of_view"]["range_m"][1].as_f64();
    assert_eq!((range(0), range(1)), (Some(150.0), Some(60.0)), "{:#}", report[0]["sensor"]);
    assert!(stderr(&told(&["/front/cloud"])).contains("/rear/cloud: told: no metadata"));
}

/// What a metadata record says of a radar.
fn sensor_keys(range_max_m: f64, topic: &str) -> BTreeMap<String, String> {
    let numbers = [
        ("azimuth_min_rad", -1.0),
        ("azimuth_max_rad", 1.0),
        ("elevation_min_rad", -0.3),
        ("elevation_max_rad", 0.3),
        ("range_min_m", 3.0),
        ("range_max_m", range_max_m),
    ];
    let numbers = numbers.map(|(key, value)| (key.to_owned(), value.to_string()));
    numbers.into_iter().chain([("topic".to_owned(), topic.to_owned())]).collect()
}

#[test]
fn a_lidar_beside_the_radar_is_not_taken_for_one() {
    let folder = folder("own_lidar");
    let mut scan = Bag { topics: vec!["/a/lidar"], fields: vec!["x", "y", "z", "intensity"], ..Bag::default() };
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut bytes).unwrap();
    scan.write(&mut writer);
    scan.topics = vec!["/b/radar"];
    scan.fields[3] = "doppler";
    scan.write(&mut writer);
    writer.finish().unwrap();
    drop(writer);
    std::fs::write(folder.join("both.mcap"), bytes.into_inner()).unwrap();
    let output = replay(&folder, &["both.mcap", "--fov=-57,57,-17,17,3,150"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stdout(&output).starts_with("both: "), "{}", stdout(&output));
}

#[test]
fn an_interface_that_cannot_be_listened_to_says_what_to_do() {
    for command in ["doctor", "listen"] {
        let output = piped(&[command, "--can", "absent0"], b"");
        let text = stderr(&output);
        assert_eq!((output.status.code(), text.lines().count()), (Some(2), 1), "{text}");
        let known = [
            "there is no interface absent0; CAN interfaces here: ",
            "modprobe can-raw",
            "run as root",
            "which Linux has",
        ];
        assert!(text.contains("absent0") && known.iter().any(|said| text.contains(said)), "{text}");
        let both = piped(&[command, "--can", "can0", "a.log"], b"");
        assert!(stderr(&both).contains("cannot be used with"), "{}", stderr(&both));
    }
}

#[test]
fn the_frames_of_a_foreign_tree_are_named() {
    let folder = folder("own_frames");
    let bag = Bag { road: "map", ..Bag::default() };
    let error = read_bag(&folder, &bag, &options()).unwrap_err();
    assert!(error.contains("map -> front") && error.contains("--road-frame"), "{error}");
    let named = ReadOptions { road_frame: Some("map".into()), ..options() };
    assert_eq!(read_bag(&folder, &bag, &named).unwrap().pose.position[2], 6.0);
    let wrong = ReadOptions { radar_frame: Some("rear".into()), ..named };
    assert!(read_bag(&folder, &bag, &wrong).unwrap_err().contains("`rear`"));
}

#[test]
fn a_velocity_of_the_wrong_sign_is_found_and_turned() {
    let folder = folder("own_sign");
    let mut recording = read(Path::new(MOTORWAY), &ReadOptions::default()).unwrap();
    assert_eq!(recording.problems.iter().filter(|p| p.topic == "mount").count(), 0, "the shipped recording is right");
    for frame in &mut recording.frames {
        frame.detections.iter_mut().for_each(|d| d.radial_velocity_mps = -d.radial_velocity_mps);
    }
    let path = folder.join("turned.mcap");
    let start_ns = recording.frames[0].time_ns;
    let sink = Cursor::new(Vec::new());
    let mut writer =
        viewshed_harness::recording::write::RecordingWriter::new(sink, &recording.sensor, &recording.pose, start_ns)
            .unwrap();
    recording.frames.iter().try_for_each(|frame| writer.frame(frame)).unwrap();
    std::fs::write(&path, writer.finish().unwrap().into_inner()).unwrap();
    let told = read(&path, &ReadOptions::default()).unwrap();
    assert_eq!(told.problems.count("wrong sign"), 1);
    let turned = read(&path, &ReadOptions { approaching_is_positive: true, ..ReadOptions::default() }).unwrap();
    assert_eq!(turned.problems.count("wrong sign"), 0);
    let original = read(Path::new(MOTORWAY), &ReadOptions::default()).unwrap();
    assert_eq!(turned.frames[100].detections, original.frames[100].detections);
}

#[test]
fn a_mount_that_the_traffic_denies_is_named_with_its_sign() {
    let recording = read(Path::new(MOTORWAY), &ReadOptions::default()).unwrap();
    let p = &recording.pose;
    let given = [p.position[0], p.position[1], p.position[2], p.yaw_rad(), p.pitch_rad(), p.roll_rad()];
    let told = |k: usize, by: f64| {
        let mut mount = given;
        mount[k] += by;
        let options = ReadOptions { mount: Some(mount), ..ReadOptions::default() };
        let recording = read(Path::new(MOTORWAY), &options).unwrap();
        let of_mount: Vec<_> = recording.problems.iter().filter(|p| p.topic == "mount").map(|p| p.what).collect();
        of_mount.join("\n")
    };
    assert_eq!(told(3, 0.0), "");
    for (k, what, by) in [(3, "yaw", 3_f64.to_radians()), (4, "pitch", 1.5_f64.to_radians()), (2, "height", 1.0)] {
        for (by, word) in [(by, "too large"), (-by, "too small")] {
            let text = told(k, by);
            assert!(text.contains(what) && text.contains(word), "{what} {by}: {text}");
        }
    }
}

/// What is wrong, the file's name and content, further arguments, and what is said.
type Bad = (&'static str, &'static str, Vec<u8>, &'static str, &'static str);

/// Everything that is refused, with the message it gets.
fn bad() -> Vec<Bad> {
    let log = std::fs::read(LOG).unwrap();
    // the begin of a scan
    let lines = || log.split_inclusive(|b| *b == b'\n').skip_while(|line| !line.windows(4).any(|w| w == b"600#"));
    let begin: Vec<u8> = lines().take(3).flatten().copied().collect();
    let scene = || Scene::default().bytes();
    let short = {
        let mut scene = Scene::default();
        scene.steps.truncate(8);
        scene.bytes()
    };
    let bag = |change: fn(&mut Bag)| {
        let mut bag = Bag::default();
        change(&mut bag);
        bag.bytes()
    };
    let view = "--fov=-57,57,-17,17,3,150";
    vec![
        // no recording at all
        ("no file", "absent.mcap", vec![], "", "cannot read absent.mcap"),
        ("an empty file", "a.mcap", vec![], "", "a.mcap is empty"),
        ("a folder", ".", vec![], "", "cannot read .: it is a folder; name a recording in it"),
        ("a text", "a.txt", b"hello\n".to_vec(), "", "not an MCAP file, nor another that is read: a log of `candump`"),
        ("JSON", "a.json", b"{\"a\": 1}".to_vec(), "", "it is JSON; export it as MCAP"),
        (
            "a bag of ROS 1",
            "a.bag",
            b"#ROSBAG V2.0\n".to_vec(),
            "",
            "it is a ROS 1 bag; convert it: `pip install rosbags`",
        ),
        ("a bag in SQLite", "a.db3", b"SQLite format 3\0".to_vec(), "", "stored in SQLite (.db3); convert it"),
        (
            "a bag's metadata",
            "metadata.yaml",
            b"rosbag2_bagfile_information:\n".to_vec(),
            "",
            "name the .mcap beside it",
        ),
        ("a BLF log", "a.blf", b"LOGG\0\0".to_vec(), "", "`can_logconvert FILE.blf FILE.asc`"),
        ("a trace of PCAN-View", "a.trc", b";$FILEVERSION=2.1\n".to_vec(), "", "`can_logconvert FILE.trc FILE.asc`"),
        ("an MDF measurement", "a.mf4", b"MDF     4.10".to_vec(), "", "export its bus as ASC"),
        ("a capture of a network", "a.pcap", b"\xD4\xC3\xB2\xA1\x02\0".to_vec(), "", "record with `candump -L can0`"),
        ("a picture", "a.png", b"\x89PNG\r\n".to_vec(), "", "it is a picture; name the recording"),
        ("a zip archive", "a.zip", b"PK\x03\x04".to_vec(), "", "unpack it, and name a file of it"),
        ("packed with zstd", "a.log.zst", b"\x28\xB5\x2F\xFD\0".to_vec(), "", "unpack it with `unzstd`"),
        ("packed twice", "a.gz", gzip(&gzip(b"x")), "", "unpack it with `gunzip`"),
        ("no gzip after all", "a.gz", b"\x1F\x8Bnothing".to_vec(), "", "cannot read a.gz"),
        // logs of a bus
        (
            "candump without times",
            "a.log",
            b"  can0  60A   [1]  01\n".to_vec(),
            "",
            "without time stamps; record with `candump -L`",
        ),
        (
            "candump with dates",
            "a.log",
            b" (2020-06-05 15:46:52.4)  can0  60A   [1]  01\n".to_vec(),
            "",
            "`candump -t A` prints",
        ),
        (
            "a bus without a radar",
            "a.log",
            b"(1.0) can0 123#00\n".to_vec(),
            "",
            "no scan of an ARS408 or its kin in this log",
        ),
        ("two radars", "a.log", log.clone(), "", "several sensors: 0 on can0"),
        (
            "a radar that is not there",
            "a.log",
            log.clone(),
            "--sensor-id 5",
            "no scan of sensor 5; sensors found: 0 on can0",
        ),
        (
            "a bus that is not there",
            "a.log",
            log.clone(),
            "--interface can9",
            "no frame on interface can9; interfaces found: can0",
        ),
        ("less than a scan", "a.log", begin, "--sensor-id 0", "no whole scan of sensor 0"),
        ("a kind of radar nobody knows", "a.log", log, "--radar ARS999", "no radar `ARS999`; there are ARS408"),
        // bags
        (
            "a topic that is not there",
            "a.mcap",
            scene(),
            "--radar-topic /lidar",
            "no radar frame on topic /lidar; topics found: /ground_truth/objects",
        ),
        (
            "neither mount nor field of view",
            "a.mcap",
            bag(|b| b.road = "map"),
            "",
            "(metres, degrees). And a: field of view unknown",
        ),
        (
            "two radars without a mount",
            "a.mcap",
            bag(|b| {
                b.topics.push("/rear/cloud");
                b.road = "map";
            }),
            view,
            "2 radars, and not each has mount and field of view; choose one with --radar-topic:\n  /rear/cloud: a: no mount",
        ),
        (
            "two radars without a field of view",
            "a.mcap",
            bag(|b| b.topics.push("/rear/cloud")),
            "",
            "no metadata `viewshed.sensor` with `topic` = /sensing/front/cloud; give the field of view with --fov",
        ),
        (
            "one mount for two radars",
            "a.mcap",
            bag(|b| b.topics.push("/rear/cloud")),
            "--mount 0,0,5,0,2,0",
            "2 radars: /rear/cloud, /sensing/front/cloud; --mount is of one",
        ),
        (
            "a cloud without velocity",
            "a.mcap",
            bag(|b| b.fields[3] = "intensity"),
            view,
            "no field `radial_velocity` or `radial_speed`",
        ),
        (
            "a cloud without places",
            "a.mcap",
            bag(|b| b.fields = vec!["x", "doppler"]),
            view,
            "neither range and azimuth nor x, y and z; fields found: x, doppler",
        ),
        (
            "messages as JSON",
            "a.mcap",
            bag(|b| b.encoding = "json"),
            view,
            "its encoding is json, and only cdr (ROS 2) is read",
        ),
        (
            "messages of ROS 1",
            "a.mcap",
            bag(|b| (b.encoding, b.schema) = ("ros1", "sensor_msgs/PointCloud2")),
            view,
            "Messages of ROS 1 are not read: convert the bag",
        ),
        (
            "another tree of frames",
            "a.mcap",
            bag(|b| b.road = "map"),
            view,
            "joins no frame `road` to the radar's `front` (transforms found: map -> front)",
        ),
        ("no field of view", "a.mcap", bag(|_| ()), "", "field of view unknown"),
        // options
        ("a mount under the road", "a.mcap", scene(), "--mount 0,0,-6,0,0,0", "is not above the road"),
        (
            "a field of view the wrong way round",
            "a.mcap",
            scene(),
            "--fov=57,-57,-17,17,3,150",
            "the lower limit comes first",
        ),
        ("a piece after the end", "a.mcap", scene(), "--from 1000", "no frame between --from and --to"),
        ("a sign nobody knows", "a.mcap", scene(), "--velocity-sign up", "possible values: receding, approaching"),
        // what could be read, and not judged
        ("shorter than the warm-up", "a.mcap", short, "", "end within the warm-up of 1 s; shorten that with --warm-up"),
        ("a warm-up longer than the recording", "a.mcap", scene(), "--warm-up 60", "end within the warm-up of 60 s"),
        (
            "a field of view before all vehicles",
            "a.mcap",
            scene(),
            "--fov=-57,57,-17,17,3,20",
            "points rejected (most: range): ranges in another unit than metres, or a wrong field of view?",
        ),
    ]
}

/// Labels beside a recording: what is wrong, their rows after the heading, and what is said.
fn bad_labels() -> Vec<(&'static str, &'static str, &'static str)> {
    vec![
        (
            "another day",
            "900.0,a,car,50,0,0\n960.0,a,car,60,0,0\n",
            "labels span 900.0 to 960.0 s, the recording 0 to 2.9 s",
        ),
        ("milliseconds", "0,a,car,50,0,0\n2500,a,car,60,0,0\n", "time_s is in seconds; are these milliseconds?"),
        ("milliseconds of the clock", "1700000000100,a,car,50,0,0\n", "after the year 2286: it is in seconds"),
        ("degrees", "0.1,a,car,50,0,0\n1.0,a,car,60,0,180\n", "line 3: heading_rad 180 is more than a turn"),
        (
            "another road",
            "0.1,a,car,5000,0,0\n1.0,a,car,5010,0,0\n",
            "no label lies within 180 m of the sensor: labels span x 5000.0 to 5010.0 m",
        ),
        ("a class nobody knows", "0.1,a,tram,50,0,0\n", "line 2: class `tram` has no default size"),
        ("a word for a number", "0.1,a,car,far,0,0\n", "line 2"),
        ("a missing column", "0.1,a,car\n", "line: 2"),
        ("a value that is not finite", "0.1,a,car,inf,0,0\n", "a value is not finite"),
    ]
}

#[test]
fn what_cannot_be_replayed_says_what_is_wrong_and_what_to_do() {
    let folder = folder("own_bad");
    let mut wrong = Vec::new();
    let mut told = 0;
    let mut check = |what: &str, output: &Output, says: &str| {
        let text = stderr(output);
        told += 1;
        if output.status.code() != Some(2) || !text.starts_with("error: ") || !text.contains(says) {
            wrong.push(format!("{what}: expected `{says}`, is {:?}: {text}", output.status.code()));
        }
    };
    for (what, name, bytes, arguments, says) in bad() {
        let path = folder.join(name);
        if !path.is_dir() && !name.starts_with("absent") {
            std::fs::write(&path, bytes).unwrap();
        }
        let arguments: Vec<&str> = [name].into_iter().chain(arguments.split_whitespace()).collect();
        check(what, &replay(&folder, &arguments), says);
    }
    Scene { labelled: false, ..Scene::default() }.save(&folder, "l");
    for (what, rows, says) in bad_labels() {
        let text = format!("time_s,object_id,class,x_m,y_m,heading_rad\n{rows}");
        std::fs::write(folder.join("l.labels.csv"), text).unwrap();
        check(what, &replay(&folder, &["l.mcap"]), says);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(told >= 48, "{told}");
}

#[test]
fn labels_of_the_whole_day_go_with_a_piece_of_it() {
    let folder = folder("own_day");
    let scene = Scene { labelled: false, ..Scene::default() };
    scene.save(&folder, "l");
    let start = scene.steps[0].0.time_ns as f64 * 1e-9;
    let end = (FRAMES as i64 * PERIOD_NS) as f64 * 1e-9;
    let rows = format!("{},a,car,50,7,0\n{},a,car,86,7,0\n{},b,car,50,7,0\n", start, start + end, start + 5000.0);
    let text = format!("time_s,object_id,class,x_m,y_m,heading_rad\n{rows}");
    std::fs::write(folder.join("l.labels.csv"), text).unwrap();
    let output = replay(&folder, &["l.mcap", "--json", "r.json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(json(&folder.join("r.json"))["objects"], 1);
}
