//! The page over the log of a broadcast: what a receiver shows, also where the log is cut, or speaks another version.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use viewshed::fixed::time::Time;
use viewshed::probability::{Edges, ProbabilityTable, fitted_with};
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::message::{Addresses, Epoch, Message, Packet};
use viewshed_harness::bus::traffic::{A, Maps, W};
use viewshed_harness::estimators::Options;
use viewshed_harness::evaluation::curve::Grades;
use viewshed_harness::evaluation::probability::file::Fitted;
use viewshed_harness::evaluation::probability::samples::fingerprint;
use viewshed_harness::recording::can_log::{Content, Line};
use viewshed_harness::recording::{ReadOptions, read};

use crate::browser::Browser;
use crate::server::{SHIPPED, Server, folder};

/// A log of what the shipped recording's unit would send on CAN FD.
fn log(folder: &Path) -> PathBuf {
    let path = folder.join("bus.log");
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
    command.args(["bus", SHIPPED, "--to", "5", "--bus", "fd-500k-2M", "--log"]).arg(&path);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    path
}

/// A file with a made-up table of probabilities of the shipped recording's unit, which rises with the grade.
pub fn table(folder: &Path) -> PathBuf {
    let edges = Edges {
        grades: [2, 26, 51, 76, 102, 128, 153, 179, 204, 230, 255],
        ranges_cm: [2000, 4000, 6000, 8000, 10_000, 13_000, 16_000],
        azimuths: [-6000, -3000, -1500, 0, 1500, 3000, 6000],
    };
    let values = [[std::array::from_fn(|step| 51 + 17 * step as u8); 8]; 8];
    let recording = read(SHIPPED.as_ref(), &ReadOptions::default()).unwrap();
    let unit = fingerprint(&recording, &Options::default()).unwrap();
    let table = ProbabilityTable::new(edges, values, fitted_with(unit)).unwrap();
    let mut counted = Grades::default();
    (51..=255).for_each(|p| counted.add(true, Some(p)));
    let file = folder.join("t.probability.toml");
    std::fs::write(&file, Fitted { table, counted }.text().unwrap()).unwrap();
    file
}

/// The same log with that table.
fn log_with_probabilities(folder: &Path) -> PathBuf {
    let (file, path) = (table(folder), folder.join("bus.log"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
    command.args(["bus", SHIPPED, "--to", "5", "--bus", "fd-500k-2M", "--probability"]).arg(&file);
    let output = command.arg("--log").arg(&path).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    path
}

fn overview(server: &Server) -> Value {
    let begin = Instant::now();
    loop {
        let (_, answer) = server.own("GET", "overview/0", &[], "");
        let overview: Value =
            serde_json::from_str(answer.split("\r\n\r\n").nth(1).unwrap_or_default()).unwrap_or_default();
        if overview["done"] == true {
            return overview;
        }
        assert!(begin.elapsed() < Duration::from_secs(120), "{answer}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

fn events(overview: &Value) -> Vec<String> {
    overview["events"].as_array().unwrap().iter().map(|event| event["text"].as_str().unwrap().to_owned()).collect()
}

/// The greatest share of visible cells.
fn most_visible(overview: &Value) -> f64 {
    overview["samples"].as_array().unwrap().iter().map(|s| s["visible"].as_f64().unwrap()).fold(0.0, f64::max)
}

#[test]
fn a_log_is_played_and_its_sender_described() {
    let folder = folder("log");
    let server = Server::run([Path::new("view"), &log(&folder)]);
    let overview = overview(&server);
    assert!((40..=60).contains(&overview["count"].as_u64().unwrap()), "{overview}");
    assert!(most_visible(&overview) > 0.3, "{overview}");
    let events = events(&overview);
    assert!(events.iter().any(|text| text.contains("its map is shown")), "{events:?}");
    let Some(browser) = Browser::start("log") else { return };
    let page = browser.open(&server.url);
    page.until("viewshed.source.done && viewshed.drawn.number >= 0");
    page.key("End");
    page.until("viewshed.number === viewshed.source.count - 1");
    page.rests();
    let sender = page.ask("document.querySelector('.sender')?.textContent");
    let sender = sender.as_str().unwrap();
    assert!(sender.contains("its map is shown") && sender.contains("fingerprint") && sender.contains("ms"), "{sender}");
    assert!(sender.contains(" used, 0 lost") && sender.contains("1 first of an epoch, or of another"), "{sender}");
    page.focus("plan");
    page.key("Enter");
    page.until("viewshed.told !== null");
    page.picture(&folder.join("log.png"));
    assert_eq!(page.console(), Vec::<String>::new());
}

#[test]
fn the_page_of_a_log_opens_on_its_first_map_and_before_it_nothing_is_alarming() {
    let Some(browser) = Browser::start("first map") else { return };
    let folder = folder("first-map");
    let server = Server::run([Path::new("view"), &log(&folder)]);
    let known = overview(&server);
    let unknown = |sample: &Value| sample["unknown"].as_f64().unwrap() >= 1.0;
    let begins = known["samples"].as_array().unwrap().iter().position(|sample| !unknown(sample)).unwrap();
    assert!(begins > 1, "a log begins before its first map");
    let page = browser.open(&server.url);
    page.until(&format!("viewshed.source.done && viewshed.drawn.number === {begins}"));
    page.rests();
    let view = page.ask("[viewshed.plots.plan.view.left, viewshed.plots.plan.view.right]");
    assert!(view[1].as_f64().unwrap() > 150.0 && view[0].as_f64().unwrap() < 0.0, "{view}");
    let sender = page.ask("document.querySelector('.sender').textContent");
    let sender = sender.as_str().unwrap();
    assert!(sender.contains("its map is shown") && !sender.contains("None"), "{sender}");
    let legend = page.ask("document.getElementById('legend').textContent");
    assert!(!legend.as_str().unwrap().contains("occupied"), "what this log does not carry: {legend}");
    page.picture(&folder.join("first.png"));
    let again = browser.open(&server.url);
    again.until(&format!("viewshed.source.done && viewshed.drawn.number === {begins}"));
    again.key("Home");
    again.until("viewshed.drawn.number === 0 && document.querySelector('.sender')");
    let alarm = "getComputedStyle(document.querySelector('.sender')).color === getComputedStyle(document.body).color";
    assert_eq!(again.ask(alarm), true, "{}", again.ask("document.querySelector('.sender').dataset.condition"));
    assert_eq!(again.ask("document.getElementById('plan-title').textContent"), "no map has come yet");
    again.picture(&folder.join("before.png"));
}

/// What is printed up to the address.
fn told(arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
    let mut child = command.arg("view").args(arguments).arg("--no-open").stdout(Stdio::piped()).spawn().unwrap();
    let lines = BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok);
    let told: Vec<String> = lines.take_while(|line| !line.starts_with("http://")).collect();
    child.kill().unwrap();
    child.wait().unwrap();
    told.join("\n")
}

#[test]
fn options_of_another_kind_of_file_are_named() {
    let folder = folder("ignored");
    let log = log(&folder);
    let said = told(&[log.to_str().unwrap(), "--from", "3", "--far-road", "--every", "1"]);
    for option in ["--from", "--far-road"] {
        assert!(said.contains(&format!("{option} is for recordings, and ignored")), "{said}");
    }
    assert!(!said.contains("--every"), "{said}");
    let key = folder.join("key");
    std::fs::write(&key, "000102030405060708090a0b0c0d0e0f").unwrap();
    let more = ["--to", "3", "--every", "3", "--extended", "--key-file", key.to_str().unwrap()];
    let said = told(&[&[SHIPPED], &more[..]].concat());
    for what in
        ["--every is for logs of a broadcast", "--extended is for broadcasts on CAN", "--key-file is for broadcasts"]
    {
        assert!(said.contains(&format!("{what}, and ignored")), "{said}");
    }
    assert!(!said.contains("--to"), "{said}");
}

#[test]
fn a_cell_says_how_often_a_vehicle_there_is_detected() {
    let folder = folder("probability");
    let server = Server::run([Path::new("view"), &log_with_probabilities(&folder)]);
    let last = overview(&server)["count"].as_u64().unwrap() - 1;
    // by state: unknown, invisible, visible
    let mut said: [Vec<Option<f64>>; 3] = Default::default();
    for (azimuth, range) in (0..128).step_by(12).flat_map(|a| (0..200).step_by(8).map(move |r| (a, r))) {
        let (_, answer) = server.own("GET", &format!("cell/{last}/0/{azimuth}/{range}"), &[], "");
        let cell: Value = serde_json::from_str(answer.split("\r\n\r\n").nth(1).unwrap_or_default()).unwrap();
        said[cell["state"].as_u64().unwrap() as usize & 3].push(cell["probability"].as_f64());
    }
    let [unknown, invisible, visible] = said;
    assert!(!unknown.is_empty() && unknown.iter().all(Option::is_none), "nothing is said of what is unknown");
    let known =
        |all: &[Option<f64>]| all.iter().map(|p| p.expect("what is known has a probability")).collect::<Vec<_>>();
    let (invisible, visible) = (known(&invisible), known(&visible));
    assert!(invisible.iter().all(|p| (p - 0.2).abs() < 1e-9), "the table's least: {invisible:?}");
    let least = 0.2 + 6.0 * 17.0 / 255.0; // grade 128, from which the map is visible, has the seventh step
    assert!(visible.iter().all(|p| *p >= least - 1e-9), "{visible:?}");
    assert!(visible.iter().any(|p| *p > least + 1e-9), "the plane of probability says more of some: {visible:?}");

    let Some(browser) = Browser::start("probability") else { return };
    let page = browser.open(&server.url);
    page.until("viewshed.source.done && viewshed.drawn.number >= 0");
    page.key("End");
    page.until("viewshed.number === viewshed.source.count - 1");
    page.focus("plan");
    page.key("Enter");
    page.until("viewshed.told !== null && viewshed.told.probability !== undefined");
    let told = page.ask("[viewshed.told.probability, document.getElementById('cell').textContent]");
    let (p, text) = (told[0].as_f64(), told[1].as_str().unwrap());
    let expected = p.map(|p| format!("at least {} %", (100.0 * p).floor()));
    assert!(expected.is_none_or(|expected| text.contains(&expected)), "{told}");
    page.picture(&folder.join("probability.png"));
    assert_eq!(page.console(), Vec::<String>::new());
}

#[test]
fn a_log_that_is_cut_in_the_middle_ends_there_and_what_is_cut_is_counted() {
    let folder = folder("cut");
    let path = log(&folder);
    let bytes = std::fs::read(&path).unwrap();
    // within a line
    let mut cut = bytes[..bytes.len() / 2].to_vec();
    while cut.ends_with(b"\n") || cut.ends_with(b"#") {
        cut.pop();
    }
    cut.extend(b"Z\n");
    std::fs::write(&path, &cut).unwrap();
    let server = Server::run([Path::new("view"), &path]);
    let half = overview(&server);
    let count = half["count"].as_u64().unwrap();
    assert!((20..=32).contains(&count) && most_visible(&half) > 0.3, "{half}");
    let (_, about) = server.own("GET", "about", &[], "");
    assert!(about.contains("1 lines are no frames"), "{about}");
}

/// A log of the maps of the shipped recording's first seconds, broadcast by several sensors, each later than the one
/// before by a millisecond, and with something done to every message.
fn written(folder: &Path, sensors: &[u8], change: impl Fn(Message, &mut Vec<u8>)) -> PathBuf {
    let reading = ReadOptions { to_s: Some(4.0), ..ReadOptions::default() };
    let recording = read(Path::new(SHIPPED), &reading).unwrap();
    let maps = Maps::new(&recording, &Default::default(), None, &|| ()).unwrap();
    let medium = Medium::CanFd(Addresses::STANDARD);
    let begin = maps.scans[0].measured;
    let start = |sensor: &u8| {
        let config = BroadcastConfig::new(*sensor, medium);
        Broadcaster::<A, W>::new(config, maps.header, Epoch::new(1), begin).unwrap()
    };
    let mut senders: Vec<_> = sensors.iter().map(start).collect();
    let mut text = String::new();
    for (k, scan) in maps.scans.iter().enumerate() {
        for sender in &mut senders {
            let _ = sender.scan(scan.measured, scan);
        }
        let end = maps.scans.get(k + 1).map_or(scan.measured.micros() + 66_000, |next| next.measured.micros());
        for now in (scan.measured.micros()..end).step_by(1000) {
            let now = Time::from_micros(now);
            for (sender, sensor) in senders.iter_mut().zip(sensors) {
                let Some(packet) = sender.next_packet(now) else { continue };
                let mut own = packet.bytes()[6..].to_vec();
                change(packet.message, &mut own);
                let changed = Packet::new(packet.packing, *sensor, packet.message, Epoch::new(1), &own);
                let frame = changed.protect(packet.bytes()[2], None).frame(&Addresses::STANDARD).unwrap();
                let time_ns = now.micros() as i64 * 1000;
                let line = Line { time_ns, interface: "can0".into(), content: Content::Data(frame) };
                text += &format!("{line}\n");
            }
        }
    }
    let path = folder.join("written.log");
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn of_another_version_nothing_is_shown_and_that_is_said() {
    let later = |message, own: &mut Vec<u8>| {
        if message == Message::Header {
            own[0] = own[0] & 0xF0 | 2;
        }
    };
    let server = Server::run([Path::new("view"), &written(&folder("version"), &[1], later)]);
    let overview = overview(&server);
    assert_eq!(most_visible(&overview), 0.0);
    let events = events(&overview);
    assert!(events.iter().any(|text| text.contains("another version")), "{events:?}");
}

#[test]
fn maps_of_several_sensors_are_shown_each_and_together() {
    let Some(browser) = Browser::start("several sensors") else { return };
    let server = Server::run([Path::new("view"), &written(&folder("several"), &[1, 4], |_, _| ())]);
    assert!(most_visible(&overview(&server)) > 0.3);
    let page = browser.open(&server.url);
    page.until("viewshed.source.done && viewshed.drawn.number >= 0");
    page.key("End");
    page.until("viewshed.number === viewshed.source.count - 1 && viewshed.instant.maps.length === 2");
    let names = page.ask("viewshed.names");
    assert_eq!(names, serde_json::json!(["all sensors together", "sensor 1", "sensor 4"]));
    assert_eq!(page.ask("document.querySelectorAll('.sender').length"), 2);
    page.until("document.getElementById('plan-title').textContent === 'all sensors together'");
    // the same map twice is the same together
    let painted = "(() => { const canvas = document.querySelector('#plan canvas.ground');
        const bytes = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
        return bytes.reduce((sum, byte, k) => (sum * 31 + byte * (k % 7)) % 1000003, 7); })()";
    let together = page.ask(painted);
    page.key("m");
    page.until("document.getElementById('plan-title').textContent === 'sensor 1'");
    assert_eq!(page.ask(painted), together);
}

#[test]
fn what_is_no_source_is_refused_with_what_to_do() {
    let folder = folder("nothing");
    std::fs::write(folder.join("text.log"), "hello\n").unwrap();
    for (arguments, said) in [
        (&["view", "text.log"][..], "text.log: not an MCAP file"),
        (&["view", "missing.mcap"], "missing.mcap"),
        (&["view", "--port", "/dev/no-such-port"], "no such port"),
        (&["view"], "say what to look at: FILE"),
        (&["doctor"], "say what to examine: LOG"),
        (&["configure"], "--port PATH or --can INTERFACE: --read"),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
        let output = command.current_dir(&folder).args(arguments).output().unwrap();
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && error.contains(said), "{arguments:?}: {error}");
    }
}
