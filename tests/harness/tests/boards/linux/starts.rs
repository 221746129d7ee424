//! Starts, and starts over: which epoch, how long it is quiet, and blocks that do not go with the configuration file.

use std::thread::sleep;
use std::time::{Duration, Instant};

use viewshed::fixed::time::Time;
use viewshed::unit::service::Request;
use viewshed::unit::settings::Settings;
use viewshed::wire::message::{Epoch, Message, Received};
use viewshed::wire::serial::Unstuffer;
use viewshed::wire::status::{Reason, Status, UnitState};
use viewshed_harness::boards::live::Script;
use viewshed_harness::boards::machine::Folder;
use viewshed_harness::boards::scans::Scan;

use super::daemon::{Daemon, tables};
use super::terminal::{Ear, Terminal};
use crate::shipped;

const NATIVE: &str = "state_dir = \"FOLDER\"\n[input]\nradar = \"native\"\nport = \"FOLDER/radar\"\n\
                      [output]\nmedium = \"serial\"\nport = \"FOLDER/maps\"\n";
/// No map for one and a half seconds after a start.
const PATIENT: &str = "gap_us = 0\nstale_ms = 500\nmax_age_ms = 1000\nmax_delay_ms = 500\n";
const QUIET: Duration = Duration::from_millis(1500);

/// What the maps' line brought.
struct Heard {
    at: Duration,
    epoch: Epoch,
    /// A status, or a part of a map.
    status: Option<Status>,
    is_map: bool,
}

fn heard(ear: &Ear) -> Vec<Heard> {
    let (mut unstuffer, mut all) = (Unstuffer::new(), Vec::new());
    for (at, bytes) in ear.heard() {
        let mut rest = &bytes[..];
        while !rest.is_empty() {
            let (taken, message) = unstuffer.push(rest);
            rest = &rest[taken..];
            let Some(Ok(received)) = message.map(Received::from_bytes) else { continue };
            let mut status = Status::starting(0);
            let is_status = received.message == Message::Status && status.take(received.own).is_ok();
            let is_map = matches!(received.message, Message::Map(..));
            all.push(Heard { at, epoch: received.epoch, status: is_status.then_some(status), is_map });
        }
    }
    all
}

/// The epochs one after the other.
fn epochs(ear: &Ear) -> Vec<Epoch> {
    let mut epochs: Vec<Epoch> = heard(ear).iter().filter(|m| m.status.is_some()).map(|m| m.epoch).collect();
    epochs.dedup();
    epochs
}

/// The last status is one of these.
fn last_is(ear: &Ear, state: UnitState, reason: Reason) -> bool {
    heard(ear).iter().rev().find_map(|m| m.status).is_some_and(|s| (s.state, s.reason) == (state, reason))
}

fn wait_until(what: &str, daemon: &Daemon, so: impl Fn() -> bool) {
    let started = Instant::now();
    while !so() {
        assert!(started.elapsed() < Duration::from_secs(20), "not {what}: {}", daemon.log());
        sleep(Duration::from_millis(20));
    }
}

/// Streams scans at their pace, stamped as by a clock that shows so much now.
fn stream(radar: &mut Terminal, script: &mut Script, scans: &[Scan], clock: Duration) {
    let begin = Instant::now();
    for scan in scans {
        let stamp = Time::from_micros((clock + begin.elapsed()).as_micros() as u64);
        script.bytes.clear();
        script.scan(&Scan { time: stamp, ..scan.clone() }, Time::from_micros(0));
        radar.send(&script.bytes);
        sleep(Duration::from_micros(66_667));
    }
}

#[test]
#[ignore = "needs the daemon"]
fn linux_no_start_takes_an_epoch_that_the_sender_went_on_to_by_itself() {
    let (settings, scans) = shipped(2.0);
    let folder = Folder::new().unwrap();
    let ear = Ear::plug(&folder.0.join("maps"), Instant::now());
    let mut radar = Terminal::plug(&folder.0.join("radar"));
    let mut daemon = Daemon::start_in(folder, &format!("{NATIVE}{}", tables(&settings)), &[]);
    wait_until("heard", &daemon, || epochs(&ear).len() == 1);
    // its clock is known from the first scan on; then the radar starts anew, as one that boots after the daemon
    let mut script = Script::default();
    stream(&mut radar, &mut script, &scans[..10], Duration::from_secs(10));
    wait_until("on the radar's clock", &daemon, || epochs(&ear).len() == 2);
    stream(&mut radar, &mut script, &scans[10..20], Duration::from_secs(1));
    wait_until("on a clock that stepped back", &daemon, || epochs(&ear).len() == 3);
    script.bytes.clear();
    script.request(&Request::Restart);
    radar.send(&script.bytes);
    daemon.wait_for_times("started", 2);
    wait_until("started again with another epoch", &daemon, || epochs(&ear).len() == 4);
    let all = epochs(&ear);
    assert!(all.windows(2).all(|two| two[1] == two[0].next()), "{all:?}");
    // nor will the next start of the daemon
    stream(&mut radar, &mut script, &scans[20..25], Duration::from_millis(500));
    daemon.terminate();
    assert_eq!(daemon.wait().code(), Some(0), "{}", daemon.log());
    let kept = std::fs::read_to_string(daemon.folder.0.join("epoch")).unwrap();
    wait_until("heard to its end", &daemon, || {
        epochs(&ear).last().map(|e| e.number().to_string()) == Some(kept.clone())
    });
    assert!(epochs(&ear).len() >= 5, "{:?}", epochs(&ear));
}

#[test]
#[ignore = "needs the daemon"]
fn linux_on_the_radars_clock_a_start_is_quiet_and_counts_its_uptime() {
    let (settings, scans) = shipped(4.0);
    let folder = Folder::new().unwrap();
    let begin = Instant::now();
    let ear = Ear::plug(&folder.0.join("maps"), begin);
    let mut radar = Terminal::plug(&folder.0.join("radar"));
    let daemon = Daemon::start_in(folder, &format!("{NATIVE}{PATIENT}{}", tables(&settings)), &[]);
    wait_until("heard", &daemon, || epochs(&ear).len() == 1);
    let first = begin.elapsed();
    stream(&mut radar, &mut Script::default(), &scans[..45], Duration::from_secs(1000));
    let known = epochs(&ear)[1..].to_vec();
    let all: Vec<Heard> = heard(&ear).into_iter().filter(|m| known == [m.epoch]).collect();
    assert!(all.iter().any(|m| m.is_map), "{known:?}");
    for message in all {
        let since = message.at.saturating_sub(first);
        assert!(!message.is_map || since >= QUIET, "a map after {since:?}");
        let uptime_s = message.status.map_or(0, |s| s.uptime_s);
        assert!(Duration::from_secs(uptime_s.into()) <= since, "{uptime_s} s after {since:?}");
    }
}

#[test]
#[ignore = "needs the daemon"]
fn linux_a_block_that_does_not_go_with_the_files_heights_leaves_the_daemon_up_for_another() {
    let (settings, scans) = shipped(1.0);
    let folder = Folder::new().unwrap();
    let ear = Ear::plug(&folder.0.join("maps"), Instant::now());
    let mut radar = Terminal::plug(&folder.0.join("radar"));
    let x_m = settings.sensor.mount.x_m;
    let heights =
        format!("[noise]\nazimuth_deg = 0.4\n[ground]\npoints = [[{x_m:?}, 0.0], [{:?}, 4.0]]\n", x_m + 100.0);
    let mut daemon = Daemon::start_in(folder, &format!("{NATIVE}{heights}"), &[]);
    daemon.wait_for("warning: [noise]: not used without [mount]");
    daemon.wait_for("started");
    let mut script = Script::default();
    let mut far = settings;
    far.sensor.mount.x_m += 1500.0;
    let mut configure = |settings: &Settings| {
        script.bytes.clear();
        script.configure(settings);
        radar.send(&script.bytes);
    };
    configure(&far);
    daemon.wait_for_times("started", 2);
    daemon.wait_for("ground.x_m is ");
    let said = ear.bytes().len();
    let safe = || last_is(&ear, UnitState::Fault, Reason::Configuration) && ear.bytes().len() > said;
    wait_until("in the safe state", &daemon, safe);
    configure(&settings);
    daemon.wait_for_times("started", 3);
    stream(&mut radar, &mut Script::default(), &scans, Duration::from_secs(100));
    daemon.wait_for("radar Degraded: Settling");
    daemon.terminate();
    assert_eq!(daemon.wait().code(), Some(0), "{}", daemon.log());
}
