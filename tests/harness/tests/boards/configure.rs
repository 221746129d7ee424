//! `viewshed configure` against units: this computer's own, the emulated boards, two units on one bus.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Result;
use serialport::{SerialPort, TTYPort};
use viewshed::bench::can::TIME_ID;
use viewshed::bench::flash::Flash;
use viewshed::fixed::time::Time;
use viewshed::unit::Flow;
use viewshed::unit::can_service::{CanService, CanServiceConfig};
use viewshed::unit::identity::Identity;
use viewshed::unit::profile::small;
use viewshed::unit::settings::{BlockKind, StoredSettings};
use viewshed::wire::broadcast::Medium;
use viewshed::wire::frame::CanFrame;
use viewshed::wire::message::{Addresses, Epoch};
use viewshed_harness::boards::can::CanBoard;
use viewshed_harness::boards::machine::{Emulator, Folder, Lines};
use viewshed_harness::boards::serial::{Far, LINES, Waiting};
use viewshed_harness::boards::{Board, Profile, firmware};
use viewshed_harness::configure::can::{CanBus, CanLink};
use viewshed_harness::configure::{self, Stored, Wanted, find};
use viewshed_harness::evaluation::curve::Grades;
use viewshed_harness::evaluation::probability::file::Fitted;

use crate::live::device;
use crate::{kept, shipped};

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("configure-{name}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_viewshed")).current_dir(folder).arg("configure").args(arguments).output().unwrap()
}

/// Exit code, what was printed, and what was complained about.
fn said(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let output = run(folder, arguments);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

/// A file to configure with: the example, with other values.
fn file(folder: &Path, name: &str, changes: &[(&str, &str)]) {
    let (code, mut text, _) = said(folder, &["--example"]);
    assert_eq!(code, 0);
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    std::fs::write(folder.join(name), text).unwrap();
}

/// A port with this computer's own unit behind it; some bytes on their way to it do not arrive.
fn own_unit(through: impl FnMut(u8) -> Option<u8> + Send + 'static) -> String {
    device(Profile::Small, true, through)
}

#[test]
fn a_unit_is_configured_compared_read_and_emptied() {
    let folder = folder("all");
    let port = own_unit(Some);
    file(&folder, "unit.toml", &[]);
    let ask = |arguments: &[&str]| said(&folder, &[arguments, &["--port", &port]].concat());
    let (code, _, error) = ask(&["--read"]);
    assert_eq!(code, 2);
    assert!(error.contains("no configuration") && error.contains("--example"), "{error}");
    let (code, text, error) = ask(&["unit.toml"]);
    assert_eq!(code, 0, "{error}");
    assert!(
        text.contains("this-computer, sensor 0") && text.contains("written as block 1, and read back the same"),
        "{text}"
    );
    assert!(text.contains("from the unit's next start on"), "{text}");
    let (_, text, _) = ask(&["--restart"]);
    assert!(text.contains("restarted with block 1"), "{text}");
    let (code, text, _) = ask(&["unit.toml", "--check"]);
    assert_eq!((code, text.lines().nth(1)), (0, Some("block 1 is what the file says")), "{text}");
    // what is read is a file that says the same
    let (_, text, _) = ask(&["--read"]);
    std::fs::write(folder.join("read.toml"), &text).unwrap();
    let (code, text, _) = ask(&["read.toml", "--check"]);
    assert_eq!(code, 0, "{text}");
    // another one waits for the restart, and --read says so
    file(&folder, "unit.toml", &[("height_m = 6.0", "height_m = 5.5")]);
    let (code, text, _) = ask(&["unit.toml", "--check"]);
    assert_eq!(code, 1);
    assert!(text.contains("mount.height_m: 6.0 in the unit, 5.5 in the file"), "{text}");
    let told = |arguments: &[&str]| -> serde_json::Value {
        ask(&[arguments, &["--json", "told.json", "--force"]].concat());
        serde_json::from_slice(&std::fs::read(folder.join("told.json")).unwrap()).unwrap()
    };
    let differs = told(&["unit.toml", "--check"]);
    let height = serde_json::json!([{"key": "mount.height_m", "unit": "6.0", "file": "5.5"}]);
    assert_eq!((&differs["unit"]["board"], &differs["differences"]), (&"this-computer".into(), &height));
    assert_eq!(told(&["--read"])["configuration"]["mount"]["height_m"], 6.0);
    assert_eq!(ask(&["unit.toml"]).0, 0);
    let (_, text, _) = ask(&["--read"]);
    assert!(text.contains("height_m = 6.0") && text.contains("# block 2 counts from its next start on"), "{text}");
    let (code, _, error) = ask(&["--timing"]);
    assert!(code == 2 && error.contains("this-computer does not time its frames"), "{error}");
    let (code, text, _) = ask(&["--factory"]);
    assert!(code == 0 && text.contains("emptied and restarted"), "{text}");
    assert!(ask(&["--read"]).2.contains("no configuration"));
}

/// Lanes and heights for the end of a file.
const PLACE: &str = "\n[[lanes]]\npoints = [[0.0, -1.75], [60.55, -1.75], [150.0, -2.0]]\n\n[[lanes]]\npoints = [[150.0, 9.25], [0.0, 9.25]]\n\n[ground]\npoints = [[0.0, 101.2], [150.0, 105.7]]\n";

#[test]
fn lanes_heights_and_a_table_are_written_compared_read_and_taken_away_with_the_file() {
    let folder = folder("place");
    let port = device(Profile::Reference, true, Some);
    let ask = |arguments: &[&str]| said(&folder, &[arguments, &["--port", &port]].concat());
    file(&folder, "flat.toml", &[]);
    let flat = std::fs::read_to_string(folder.join("flat.toml")).unwrap();
    std::fs::write(folder.join("unit.toml"), flat.clone() + PLACE).unwrap();
    let settings = configure::file::read(&folder.join("unit.toml")).unwrap().settings;
    let table = Fitted { table: kept::table(settings.fingerprint()), counted: Grades::default() };
    std::fs::write(folder.join("t.toml"), table.text().unwrap()).unwrap();
    let whole = flat.clone() + PLACE + "\n[probability]\nfile = \"t.toml\"\n";
    std::fs::write(folder.join("unit.toml"), whole).unwrap();

    let (code, text, error) = ask(&["unit.toml", "--restart"]);
    assert_eq!(code, 0, "{text}{error}");
    for said in
        ["[ground] written as block 1, 36 bytes", "[[lanes]] written as block 1", "[probability] written as block 1"]
    {
        assert!(text.contains(said), "{said}: {text}");
    }
    let (code, text, _) = ask(&["unit.toml", "--check"]);
    assert_eq!((code, text.lines().nth(1)), (0, Some("block 1 is what the file says")), "{text}");
    // what is read is a file that says the same, but for the table, of which it names the check sum
    let (_, text, _) = ask(&["--read"]);
    assert!(text.contains("# a table of probabilities, in a block of check sum"), "{text}");
    std::fs::write(folder.join("read.toml"), &text).unwrap();
    let read = configure::file::read(&folder.join("read.toml")).unwrap().settings;
    assert_eq!((read.fingerprint(), read.lanes.len(), read.ground.len()), (settings.fingerprint(), 2, 2));
    let (code, text, _) = ask(&["read.toml", "--check"]);
    assert_eq!((code, text.lines().nth(1)), (1, Some("[probability]: is there in the unit, is not there in the file")));
    // nothing is written twice
    let (_, text, _) = ask(&["unit.toml"]);
    assert!(text.contains("written as block 2") && !text.contains("[[lanes]]"), "{text}");

    // another profile of the road: the table is not of that one
    let steeper = std::fs::read_to_string(folder.join("unit.toml")).unwrap().replace("105.7", "107.7");
    std::fs::write(folder.join("steeper.toml"), &steeper).unwrap();
    let (code, _, error) = ask(&["steeper.toml", "--check"]);
    assert!(
        code == 2 && error.contains("[probability]: the probability table was fitted with configuration"),
        "{error}"
    );
    let (code, text, error) = said(&folder, &["steeper.toml", "--check"]);
    assert!(code == 2 && text.contains("reference grid: [probability]: the probability table was fitted"), "{text}");
    assert!(error.contains("no unit can run with this"), "{error}");
    let steeper = steeper.replace("[probability]\nfile = \"t.toml\"\n", "");
    std::fs::write(folder.join("steeper.toml"), steeper).unwrap();
    let (code, text, _) = ask(&["steeper.toml", "--check"]);
    assert_eq!((code, text.lines().nth(1)), (1, Some("[ground]: another in the unit, one in the file")), "{text}");
    // a file is the whole truth
    let (code, text, error) = ask(&["flat.toml", "--restart"]);
    assert_eq!(code, 0, "{text}{error}");
    for key in ["[ground]", "[[lanes]]", "[probability]"] {
        assert!(text.contains(&format!("{key} taken from the unit: the file has none")), "{text}");
    }
    let (_, text, _) = ask(&["--read"]);
    assert!(!text.contains("points") && !text.contains("table of probabilities"), "{text}");
}

#[test]
fn what_a_unit_cannot_keep_is_said_before_anything_is_written() {
    let folder = folder("refused");
    let port = own_unit(Some);
    let (_, example, _) = said(&folder, &["--example"]);
    let refused = |place: &str| {
        std::fs::write(folder.join("unit.toml"), example.clone() + place).unwrap();
        let (code, _, error) = said(&folder, &["unit.toml", "--port", &port]);
        assert_eq!(code, 2, "{place}: {error}");
        assert!(said(&folder, &["--port", &port, "--read"]).2.contains("no configuration"), "{place}");
        error
    };
    for (place, why) in [
        ("[[lanes]]\npoints = [[0.0, 0.0], [60.555, 0.0]]", "lane 0 has a point that is not of whole centimetres"),
        ("[[lanes]]\npoints = [[0.0, 0.0], [340.0, 0.0]]", "lane 0 has two points more than 327 m apart"),
        ("[[lanes]]\npoints = [[0.0, 0.0]]", "lanes: lane 0 has fewer than two points"),
        ("[ground]\npoints = [[0.0, 0.0], [10.0, 2.0]]", "before point 1 the road is steeper than 12 %"),
        ("[probability]\nfile = \"none.toml\"", "probability.file: none.toml"),
        ("[probability]\nfile = \"none.toml\"\nrisk = 10.0", "probability.risk is not between 0 and 1"),
    ] {
        let error = refused(place);
        assert!(error.contains(why), "{place}: {error}");
    }
    // tables are fitted on the reference grid, and this unit has the small one
    std::fs::write(folder.join("plain.toml"), &example).unwrap();
    let settings = configure::file::read(&folder.join("plain.toml")).unwrap().settings;
    let table = Fitted { table: kept::table(settings.fingerprint()), counted: Grades::default() };
    std::fs::write(folder.join("t.toml"), table.text().unwrap()).unwrap();
    std::fs::write(folder.join("unit.toml"), example.clone() + "[probability]\nfile = \"t.toml\"\n").unwrap();
    let (code, _, error) = said(&folder, &["unit.toml", "--port", &port]);
    assert!(code == 2 && error.contains("table was fitted on a grid of 200 x 128"), "{error}");
}

#[test]
fn a_unit_with_another_number_is_found_and_comes_back_with_its_new_one() {
    let folder = folder("number");
    let port = own_unit(Some);
    for (number, block) in [(5, 1), (2, 2)] {
        let unit = format!("[unit]\nsensor = {number}");
        file(&folder, "unit.toml", &[("#[unit]", &unit)]);
        let (code, text, error) = said(&folder, &["unit.toml", "--port", &port, "--restart"]);
        assert_eq!(code, 0, "{error}");
        assert!(text.contains(&format!("restarted with block {block}")), "{text}");
    }
    let (_, text, _) = said(&folder, &["--port", &port, "--read"]);
    assert!(text.contains("sensor 2, chip") && text.contains("sensor = 2"), "{text}");
    let (code, _, error) = said(&folder, &["--port", &port, "--read", "--sensor", "5", "--wait", "0.2"]);
    assert!(
        code == 2 && error.contains("the unit that is meant does not answer; there is\n  this-computer, sensor 2"),
        "{error}"
    );
}

#[test]
fn what_cannot_be_used_is_named_before_anything_is_sent() {
    let folder = folder("wrong");
    let port = own_unit(Some);
    let ask = |arguments: &[&str]| said(&folder, &[arguments, &["--port", &port]].concat());
    file(&folder, "unit.toml", &[("height_m = 6.0", "height_m = 60.0")]);
    let (code, _, error) = ask(&["unit.toml"]);
    assert!(
        code == 2 && error.contains("mount.height_m is 60, outside") && error.contains("nothing was sent"),
        "{error}"
    );
    assert!(ask(&["--read"]).2.contains("no configuration"));
    file(&folder, "unit.toml", &[("height_m = 6.0", "hight_m = 6.0")]);
    let (code, _, error) = ask(&["unit.toml"]);
    assert!(code == 2 && error.contains("unit.toml:") && error.contains("unknown field `hight_m`"), "{error}");
    let (code, _, error) = ask(&["none.toml"]);
    assert!(code == 2 && error.contains("cannot read none.toml") && error.contains("--example"), "{error}");
    let (code, _, error) = said(&folder, &["unit.toml"]);
    assert!(code == 2 && error.contains("hight_m"), "the file is looked at first: {error}");
    // without a unit
    file(&folder, "unit.toml", &[]);
    let (code, text, _) = said(&folder, &["unit.toml", "--check"]);
    assert_eq!(code, 0);
    assert_eq!(text, "reference grid: can be used\nsmall grid: can be used\n");
    file(&folder, "learns.toml", &[("#[unit]", "[unit]\nlearn_lanes = true")]);
    let (code, text, _) = said(&folder, &["learns.toml", "--check"]);
    let small = "small grid: learn_lanes: no controller has room for it with this grid, the daemon alone\n";
    assert_eq!((code, text), (0, format!("reference grid: can be used\n{small}")));
    let lanes = std::fs::read_to_string(folder.join("unit.toml")).unwrap() + PLACE;
    std::fs::write(folder.join("lanes.toml"), lanes).unwrap();
    let (code, text, _) = said(&folder, &["lanes.toml", "--check", "--json", "lanes.json"]);
    let without = "small grid: can be used\n  not on nucleo-g474re: no room for [[lanes]]\n";
    assert!(code == 0 && text.starts_with(&format!("reference grid: can be used\n{without}")), "{text}");
    file(&folder, "low.toml", &[("range_max_m = 200.0", "range_max_m = 4.0")]);
    let (code, text, error) = said(&folder, &["low.toml", "--check"]);
    assert!(
        code == 2 && text.contains("field_of_view.") && error.contains("no unit can run with this"),
        "{text}{error}"
    );
    let (code, _, error) = said(&folder, &["unit.toml"]);
    assert!(code == 2 && error.contains("--port PATH or --can INTERFACE"), "{error}");
}

#[test]
fn a_wrong_port_a_foreign_device_and_silence_are_told_apart() {
    let folder = folder("ports");
    file(&folder, "unit.toml", &[]);
    let (code, _, error) = said(&folder, &["unit.toml", "--port", "/dev/ttyNONE7"]);
    assert!(code == 2 && error.contains("no such port") && error.contains("/dev/serial/by-id"), "{error}");
    let (_far, near) = TTYPort::pair().unwrap();
    let silent = near.name().unwrap();
    drop(near);
    let (code, _, error) = said(&folder, &["unit.toml", "--port", &silent, "--wait", "0.3"]);
    assert!(code == 2 && error.contains("nothing answers") && error.contains("reset button"), "{error}");
    // a GPS
    let (far, near) = TTYPort::pair().unwrap();
    let foreign = near.name().unwrap();
    let mut talks = far.try_clone_native().unwrap();
    std::thread::spawn(move || {
        let _near = near;
        while talks.write_all(b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n").is_ok() {
            std::thread::sleep(Duration::from_millis(100));
        }
    });
    let (code, _, error) = said(&folder, &["unit.toml", "--port", &foreign, "--baud", "115200", "--wait", "0.5"]);
    assert!(code == 2 && error.contains("no message of a viewshed unit among them"), "{error}");
    let (code, _, error) = said(&folder, &["unit.toml", "--can", "nowhere0"]);
    assert_eq!(code, 2);
    assert!(error.contains("there is no interface nowhere0") || error.contains("kernel has no CAN"), "{error}");
}

#[test]
fn a_unit_that_falls_silent_while_it_is_written_keeps_its_block() {
    let folder = folder("silent");
    // once a message as long as a block has begun, nothing arrives any more for a while
    let (cut, mut in_a_row) = (Arc::new(AtomicBool::new(false)), 0);
    let cutting = cut.clone();
    let port = own_unit(move |byte| {
        in_a_row = if byte == 0 { 0 } else { in_a_row + 1 };
        (!(cutting.load(Ordering::Relaxed) && in_a_row > 60)).then_some(byte)
    });
    file(&folder, "unit.toml", &[]);
    assert_eq!(said(&folder, &["unit.toml", "--port", &port, "--restart"]).0, 0);
    cut.store(true, Ordering::Relaxed);
    file(&folder, "other.toml", &[("height_m = 6.0", "height_m = 5.0")]);
    let (code, _, error) = said(&folder, &["other.toml", "--port", &port]);
    assert!(code == 2 && error.contains("does not answer since the block was sent"), "{error}");
    cut.store(false, Ordering::Relaxed);
    let (code, text, _) = said(&folder, &["unit.toml", "--port", &port, "--check"]);
    assert!(code == 0 && text.contains("block 1 is what the file says"), "{text}");
}

/// Units on one bus, with the time of this test.
#[derive(Clone)]
struct Bus(Rc<RefCell<Vec<Node>>>);

struct Node {
    identity: Identity,
    slots: Flash,
    service: CanService,
    sent: VecDeque<CanFrame>,
}

const MEDIUM: Medium = Medium::Can(Addresses::STANDARD);

impl Node {
    fn new(chip: u32) -> Self {
        let identity = Identity { board: "a-board", chip, is_bench: false, grid: [100, 64] };
        let slots = Flash::ERASED;
        let service = Self::start(identity, &slots);
        Self { identity, slots, service, sent: VecDeque::new() }
    }

    fn start(identity: Identity, slots: &Flash) -> CanService {
        let stored = StoredSettings::read(slots, small::CHECK);
        let config = CanServiceConfig { identity, gap_us: 0, ..CanServiceConfig::new(stored.unit().sensor, MEDIUM) };
        CanService::start(config, Epoch::new(1), Time::from_micros(0), stored)
    }
}

impl CanBus for Bus {
    fn send(&mut self, frame: &CanFrame) -> Result<()> {
        for node in self.0.borrow_mut().iter_mut() {
            if node.service.take(frame, &mut node.slots) == Some(Flow::Restart) {
                node.service = Node::start(node.identity, &node.slots);
            }
        }
        Ok(())
    }

    fn receive(&mut self, until: Instant) -> Result<Option<CanFrame>> {
        loop {
            let now = Time::from_micros(since().elapsed().as_micros() as u64);
            for node in self.0.borrow_mut().iter_mut() {
                while let Some(frame) = node.service.next_frame(now, &node.slots) {
                    node.sent.push_back(frame);
                }
                if let Some(frame) = node.sent.pop_front() {
                    return Ok(Some(frame));
                }
            }
            if Instant::now() >= until {
                return Ok(None);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

fn since() -> Instant {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    *START.get_or_init(Instant::now)
}

#[test]
fn two_new_units_on_one_bus_get_numbers_of_their_own() {
    since();
    let bus = Bus(Rc::new(RefCell::new([0x11, 0x2222].map(Node::new).into())));
    let mut link = CanLink::new(bus.clone(), "can0", false);
    let patience = Duration::from_secs(1);
    let error = find(&mut link, Wanted::default(), patience).err().unwrap().to_string();
    assert!(error.contains("2 units answer; say which one with --chip\n  sensor 0, chip 00000011"), "{error}");
    let (mut settings, _) = shipped(0.1);
    for (chip, sensor) in [(0x11, 4), (0x2222, 5)] {
        settings.unit.sensor = sensor;
        let mut unit = find(&mut link, Wanted { chip: Some(chip), ..Wanted::default() }, patience).unwrap();
        assert_eq!(unit.write(&settings).unwrap(), 1);
        assert_eq!(unit.restart().unwrap(), Some(1));
        assert_eq!(unit.in_use().unwrap().unwrap().settings, settings);
    }
    let numbers: Vec<u8> = bus.0.borrow().iter().map(|node| node.service.settings().unwrap().unit.sensor).collect();
    assert_eq!(numbers, [4, 5]);
    let error = find(&mut link, Wanted { sensor: Some(0), chip: None }, patience).err().unwrap().to_string();
    let others =
        "the unit that is meant does not answer; there is\n  sensor 4, chip 00000011\n  sensor 5, chip 00002222";
    assert!(error.contains(others), "{error}");
}

#[test]
fn lost_frames_are_sent_again() {
    struct Lossy(Bus, usize);
    impl CanBus for Lossy {
        fn send(&mut self, frame: &CanFrame) -> Result<()> {
            self.1 += 1;
            // every ninth is lost on its way
            if self.1.is_multiple_of(9) { Ok(()) } else { self.0.send(frame) }
        }
        fn receive(&mut self, until: Instant) -> Result<Option<CanFrame>> {
            self.0.receive(until)
        }
    }
    since();
    let bus = Bus(Rc::new(RefCell::new(vec![Node::new(0x77)])));
    let mut link = CanLink::new(Lossy(bus, 0), "can0", false);
    let (settings, _) = shipped(0.1);
    let mut unit = find(&mut link, Wanted::default(), Duration::from_secs(5)).unwrap();
    assert_eq!(unit.write(&settings).unwrap(), 1);
    assert_eq!(unit.newest().unwrap().unwrap(), Stored { sequence: 1, settings });
}

/// A port with an emulated board behind it: what is written goes to its radar's line, what it sends comes back.
fn emulated(profile: Profile) -> (String, Emulator, Folder) {
    let image = firmware::build(Board::Mps2An386, profile, "live").unwrap();
    let folder = Folder::new().unwrap();
    let waiting = Waiting::new(&folder.0).unwrap();
    let emulator = Emulator::start(Board::Mps2An386, &image, &folder.0, Lines::Sockets(&LINES)).unwrap();
    let mut board = waiting.accept().unwrap();
    let (mut far, near) = TTYPort::pair().unwrap();
    far.set_timeout(Duration::from_millis(2)).unwrap();
    let name = near.name().unwrap();
    std::thread::spawn(move || {
        let _near = near;
        let (mut buffer, mut passed) = ([0; 256], 0);
        loop {
            let came = far.read(&mut buffer).unwrap_or(0);
            if board.send(&buffer[..came]).is_err() || board.collect().is_err() {
                return;
            }
            if far.write_all(&board.answer()[passed..]).is_ok() {
                passed = board.answer().len();
            }
        }
    });
    (name, emulator, folder)
}

/// The transcript on the boards' page, with the port's name put in.
#[test]
#[ignore = "needs QEMU"]
fn mps2_is_configured_as_the_page_shows() {
    let page = include_str!("../../../../boards/README.md");
    let (_, transcript) = page.split_once("```transcript\n").unwrap();
    let (transcript, _) = transcript.split_once("```").unwrap();
    let (port, _emulator, _machine) = emulated(Profile::Reference);
    let folder = folder("transcript");
    let mut here = String::new();
    for line in transcript.lines().filter_map(|line| line.strip_prefix("$ viewshed ")) {
        let words: Vec<String> = line.split(' ').map(|word| word.replace("/dev/ttyACM0", &port)).collect();
        let (arguments, file) = match words.iter().position(|word| word == ">") {
            Some(at) => (&words[..at], words.get(at + 1)),
            None => (&words[..], None),
        };
        let output =
            Command::new(env!("CARGO_BIN_EXE_viewshed")).current_dir(&folder).args(arguments).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        here += &format!("$ viewshed {line}\n");
        match file {
            Some(file) => std::fs::write(folder.join(file), text).unwrap(),
            None => here += &text.replace(&port, "/dev/ttyACM0"),
        }
        // what a person would edit
        if line.contains("--example") {
            let text = std::fs::read_to_string(folder.join("unit.toml")).unwrap();
            std::fs::write(folder.join("unit.toml"), text.replace("height_m = 6.0", "height_m = 5.5")).unwrap();
        }
    }
    assert!(transcript == here, "the page's transcript is now:\n{here}");
}

/// The emulated board's bus, with the time that it needs of us.
struct Emulated(CanBoard, usize);

impl CanBus for Emulated {
    fn send(&mut self, frame: &CanFrame) -> Result<()> {
        self.0.send(std::slice::from_ref(frame))
    }

    fn receive(&mut self, until: Instant) -> Result<Option<CanFrame>> {
        loop {
            let micros = 1_000_000 + since().elapsed().as_micros() as u64;
            self.0.send(CanFrame::classic(TIME_ID, &micros.to_be_bytes()).as_slice())?;
            self.0.wait_for(self.1 + 1, Duration::from_millis(5))?;
            if let Some(frame) = self.0.answer.get(self.1) {
                self.1 += 1;
                return Ok(Some(*frame));
            }
            if Instant::now() >= until {
                return Ok(None);
            }
        }
    }
}

#[test]
#[ignore = "needs QEMU"]
fn zcu102_is_configured_over_its_can_controller() {
    since();
    let image = firmware::build(Board::Zcu102R5, Profile::Reference, "live").unwrap();
    let board = CanBoard::start(&image, &Flash::ERASED).unwrap();
    let mut link = CanLink::new(Emulated(board, 0), "can0", false);
    let (mut settings, _) = shipped(0.1);
    // frames of others would have to prove the bit rate
    settings.broadcast_bus.listen_first = false;
    settings.radar_bus.listen_first = false;
    settings.unit.sensor = 6;
    let mut unit = find(&mut link, Wanted::default(), Duration::from_secs(20)).unwrap();
    assert_eq!((unit.unit.sensor, unit.unit.chip, unit.unit.is_bench), (0, 0x5A43_5531, true));
    let mut high = settings;
    high.sensor.mount.height_m = 60.0;
    let error = unit.write(&high).unwrap_err().to_string();
    assert!(
        error.contains("the unit refuses the block: mount.height_m is 60") && error.contains("old block"),
        "{error}"
    );
    let sequence = unit.write(&settings).unwrap();
    assert_eq!(unit.restart().unwrap(), Some(sequence));
    assert_eq!(unit.unit.sensor, 6);
    assert_eq!(unit.in_use().unwrap().unwrap(), Stored { sequence, settings });
    unit.clear(BlockKind::Settings).unwrap();
    assert_eq!(unit.restart().unwrap(), None);
    assert!(unit.in_use().unwrap().is_err());
}
