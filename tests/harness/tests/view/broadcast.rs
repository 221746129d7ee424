//! The page over the log of a broadcast: what a receiver shows, also where the log is cut, or speaks another version.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::Value;

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
    page.focus("plan");
    page.key("Enter");
    page.until("viewshed.told !== null");
    page.picture(&folder.join("log.png"));
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

#[test]
fn of_another_version_nothing_is_shown_and_that_is_said() {
    use viewshed::fixed::time::Time;
    use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
    use viewshed::wire::message::{Addresses, Epoch, Message, Packet};
    use viewshed_harness::bus::traffic::{A, Maps, W};
    use viewshed_harness::recording::{ReadOptions, read};

    let folder = folder("version");
    let reading = ReadOptions { to_s: Some(4.0), ..ReadOptions::default() };
    let recording = read(Path::new(SHIPPED), &reading).unwrap();
    let maps = Maps::new(&recording, &Default::default(), &|| ()).unwrap();
    let medium = Medium::CanFd(Addresses::STANDARD);
    let begin = maps.scans[0].measured;
    let mut sender =
        Broadcaster::<A, W>::new(BroadcastConfig::new(1, medium), maps.header, Epoch::new(1), begin).unwrap();
    let mut text = String::new();
    for (k, scan) in maps.scans.iter().enumerate() {
        let _ = sender.scan(scan.measured, scan);
        let end = maps.scans.get(k + 1).map_or(scan.measured.micros() + 66_000, |next| next.measured.micros());
        for now in (scan.measured.micros()..end).step_by(1000) {
            let now = Time::from_micros(now);
            let Some(packet) = sender.next_packet(now) else { continue };
            // the same, as a later version would send it
            let mut own = packet.bytes()[6..].to_vec();
            if packet.message == Message::Header {
                own[0] = own[0] & 0xF0 | 2;
            }
            let later =
                Packet::new(packet.packing, 1, packet.message, Epoch::new(1), &own).protect(packet.bytes()[2], None);
            let frame = later.frame(&Addresses::STANDARD).unwrap();
            let line = viewshed_harness::recording::can_log::Line {
                time_ns: now.micros() as i64 * 1000,
                interface: "can0".into(),
                content: viewshed_harness::recording::can_log::Content::Data(frame),
            };
            text += &format!("{line}\n");
        }
    }
    let path = folder.join("later.log");
    std::fs::write(&path, text).unwrap();
    let server = Server::run([Path::new("view"), &path]);
    let overview = overview(&server);
    assert_eq!(most_visible(&overview), 0.0);
    let events = events(&overview);
    assert!(events.iter().any(|text| text.contains("another version")), "{events:?}");
}

#[test]
fn what_is_no_source_is_refused_with_what_to_do() {
    let folder = folder("nothing");
    std::fs::write(folder.join("text.log"), "hello\n").unwrap();
    for (arguments, said) in [
        (&["view", "text.log"][..], "text.log: not an MCAP file"),
        (&["view", "missing.mcap"], "missing.mcap"),
        (&["view", "--port", "/dev/no-such-port"], "no such port"),
        (&["view"], "required"),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_viewshed"));
        let output = command.current_dir(&folder).args(arguments).output().unwrap();
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && error.contains(said), "{arguments:?}: {error}");
    }
}
