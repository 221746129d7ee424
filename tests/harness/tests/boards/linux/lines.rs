//! Native scans in on one serial port, protected maps out on another, and what happens to cables.

use std::thread::sleep;
use std::time::{Duration, Instant};

use viewshed::fixed::time::Time;
use viewshed::inputs::ti::TiFamily;
use viewshed::map::Visibility;
use viewshed::unit::profile::reference::State;
use viewshed::unit::service::Request;
use viewshed::unit::settings::{BlockKind, Settings, Which};
use viewshed::wire::message::{Addresses, Message, Received};
use viewshed::wire::receive::{Receiver, ReceiverLimits};
use viewshed::wire::serial::Unstuffer;
use viewshed::wire::status::{Reason, Status, UnitState};
use viewshed_harness::boards::Profile;
use viewshed_harness::boards::live::{Answered, SENSOR, Script, answer};
use viewshed_harness::boards::machine::Folder;
use viewshed_harness::boards::scans::Scan;

use super::daemon::{Daemon, tables};
use super::terminal::{Ear, Terminal};
use super::ti::Frame;
use crate::shipped;

const PORTS: &str = "[output]\nmedium = \"serial\"\nport = \"FOLDER/maps\"\n";

fn messages(bytes: &[u8]) -> Vec<Vec<u8>> {
    let (mut unstuffer, mut rest, mut all) = (Unstuffer::new(), bytes, Vec::new());
    while !rest.is_empty() {
        let (taken, message) = unstuffer.push(rest);
        rest = &rest[taken..];
        all.extend(message.map(<[u8]>::to_vec));
    }
    all
}

/// The status in a message, if it is one.
fn status(message: &[u8]) -> Option<Status> {
    let received = Received::from_bytes(message).ok()?;
    let mut status = Status::starting(0);
    (received.message == Message::Status).then(|| status.take(received.own).unwrap())?;
    Some(status)
}

/// A message without its counter and check sum, status messages without the version.
fn content(message: &[u8]) -> (Vec<u8>, Option<Status>) {
    match status(message) {
        Some(status) => (Vec::new(), Some(Status { firmware: [0; 3], ..status })),
        None => (message[3..].to_vec(), None),
    }
}

/// Contents of maps, epoch left out.
fn maps(messages: &[Vec<u8>]) -> Vec<(u8, Vec<u8>)> {
    let is_map = |m: &&Vec<u8>| Received::from_bytes(m).is_ok_and(|r| matches!(r.message, Message::Map(..)));
    messages.iter().filter(is_map).map(|m| (m[3], m[6..].to_vec())).collect()
}

#[test]
#[ignore = "needs the daemon"]
fn linux_in_a_test_bench_every_message_of_five_seconds_is_the_same() {
    let (settings, scans) = shipped(5.0);
    let mut script = Script::default();
    script.request(&Request::Read(Which::in_use(BlockKind::Settings)));
    script.configure(&settings);
    scans.iter().for_each(|s| script.scan(s, scans[0].time));
    let mut broken = settings;
    broken.sensor.mount.height_m = 50.0;
    script.request(&Request::Write(&broken.to_block(7)));
    script.request(&Request::Read(Which::in_use(BlockKind::Settings)));
    let expected = answer(Profile::Reference, &script.bytes).bytes;

    // two starts before the twin's last epoch
    let last = messages(&expected).iter().rev().find_map(|m| Received::from_bytes(m).ok().map(|r| r.epoch)).unwrap();
    let folder = Folder::new().unwrap();
    std::fs::write(folder.0.join("epoch"), last.number().wrapping_sub(2).to_string()).unwrap();
    let ear = Ear::plug(&folder.0.join("maps"), Instant::now());
    let mut radar = Terminal::plug(&folder.0.join("radar"));
    let input = "state_dir = \"FOLDER\"\n[input]\nradar = \"native\"\nport = \"FOLDER/radar\"\nclock = \"input\"\n";
    let daemon = Daemon::start_in(folder, &format!("{input}{PORTS}gap_us = 0\n"), &[]);
    daemon.wait_for("started");
    radar.send(&script.bytes);
    ear.wait_for(expected.len());
    let (got, expected) = (messages(&ear.bytes()), messages(&expected));
    assert!(expected.len() > 5 * scans.len() / 2, "{} messages", expected.len());
    let first = got.iter().zip(&expected).find(|(a, b)| content(a) != content(b));
    assert_eq!((first, got.len()), (None, expected.len()), "first message that differs, and how many came");
    println!("{} messages, {} of maps", got.len(), maps(&got).len());

    // the block outlasts the daemon
    daemon.terminate();
    let folder = std::fs::read(daemon.folder.0.join("slots")).unwrap();
    assert_eq!(
        Settings::newest([&folder[..folder.len() / 2], &folder[folder.len() / 2..]], |_| Ok(())).unwrap().settings,
        settings
    );
}

/// Generous ones: the machine that runs the tests may be busy.
const LIMITS: ReceiverLimits = ReceiverLimits { max_age_us: 1_000_000, max_delay_us: 500_000 };
const PATIENT: &str = "gap_us = 0\nstale_ms = 500\nmax_age_ms = 1000\nmax_delay_ms = 500\n";

type Far = Receiver<1, { State::AZIMUTHS }, { State::WORDS }>;

/// What a receiver has of these messages.
struct Heard {
    receiver: Far,
    unstuffer: Unstuffer,
    taken: usize,
    status: Option<Status>,
    now: Time,
}

impl Heard {
    fn new() -> Self {
        let receiver = Far::new([SENSOR], Addresses::STANDARD, LIMITS);
        Self { receiver, unstuffer: Unstuffer::new(), taken: 0, status: None, now: Time::from_micros(0) }
    }

    /// What it has of everything the library sent.
    fn all(answered: &Answered) -> Self {
        let (mut heard, mut from) = (Self::new(), 0);
        for (to, now) in &answered.times {
            heard.bytes(&answered.bytes[from..*to], *now);
            from = *to;
        }
        heard
    }

    fn bytes(&mut self, mut bytes: &[u8], now: Time) {
        self.now = now;
        while !bytes.is_empty() {
            let (taken, message) = self.unstuffer.push(bytes);
            bytes = &bytes[taken..];
            if let Some(message) = message.filter(|m| Received::from_bytes(m).is_ok()) {
                self.status = status(message).or(self.status);
                let _ = self.receiver.message(now, message);
            }
        }
    }

    fn cells(&self) -> Vec<Visibility> {
        let map = self.receiver.map(SENSOR, self.now);
        (0..State::AZIMUTHS * State::RANGES)
            .map(|k| map.cell(k / State::RANGES, k % State::RANGES).visibility)
            .collect()
    }

    /// Listens until something is so; `false` if it is not within ten seconds.
    fn until(&mut self, ear: &Ear, so: impl Fn(&Self) -> bool) -> bool {
        let started = Instant::now();
        loop {
            // each chunk at its own time, however late it is looked at
            for (at, bytes) in ear.heard().iter().skip(self.taken) {
                self.taken += 1;
                self.bytes(bytes, Time::from_micros(at.as_micros() as u64));
                if so(self) {
                    return true;
                }
            }
            if started.elapsed() > Duration::from_secs(10) {
                return false;
            }
            sleep(Duration::from_millis(5));
        }
    }

    fn is(&self, state: UnitState, reason: Reason) -> bool {
        self.status.is_some_and(|s| (s.state, s.reason) == (state, reason))
    }

    fn visible(&self) -> usize {
        self.cells().iter().filter(|v| **v == Visibility::Visible).count()
    }
}

/// Streams scans at their pace, stamped when they are sent; the bytes.
fn stream(radar: &mut Terminal, script: &mut Script, scans: &[Scan], begin: Instant, garbage: bool) -> Vec<u8> {
    let mut clean = Vec::new();
    for (k, scan) in scans.iter().enumerate() {
        let stamp = Time::from_micros(100_000_000 + begin.elapsed().as_micros() as u64);
        script.bytes.clear();
        script.scan(&Scan { time: stamp, ..scan.clone() }, Time::from_micros(1));
        clean.extend_from_slice(&script.bytes);
        if garbage && k % 4 == 2 {
            // noise, and half a message
            let noise: Vec<u8> = (0..200_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> (k % 16)) as u8).collect();
            radar.send(&noise);
            radar.send(&script.bytes[..script.bytes.len().min(90) / 2]);
            radar.send(&[0]);
        }
        radar.send(&script.bytes);
        sleep(Duration::from_micros(66_667));
    }
    clean
}

/// What the library sends for these scans.
fn expected(settings: &Settings, scans: &[u8]) -> Answered {
    let mut script = Script::default();
    script.configure(settings);
    let mut all = script.bytes;
    all.extend_from_slice(scans);
    answer(Profile::Reference, &all)
}

#[test]
#[ignore = "needs the daemon"]
fn linux_cables_are_pulled_and_the_daemon_goes_on() {
    let (mut settings, scans) = shipped(7.0);
    settings.health.hold_s = 2.0;
    let folder = Folder::new().unwrap();
    let begin = Instant::now();
    let (radar_name, maps_name) = (folder.0.join("radar"), folder.0.join("maps"));
    // neither port is there at the start
    let input = "[input]\nradar = \"native\"\nport = \"FOLDER/radar\"\n";
    let config = format!("{input}{PORTS}{PATIENT}{}", tables(&settings));
    let mut daemon = Daemon::start_in(folder, &config, &[]);
    daemon.wait_for("radar: No such file or directory");
    daemon.wait_for("maps: No such file or directory");
    let mut radar = Terminal::plug(&radar_name);
    let ear = Ear::plug(&maps_name, begin);
    daemon.wait_for("radar: open");
    daemon.wait_for("maps: open");

    // maps are those of the library, whatever noise comes between the scans
    let (mut script, mut far) = (Script::default(), Heard::new());
    let mut sent = stream(&mut radar, &mut script, &scans[..45], begin, true);
    assert!(
        far.until(&ear, |far| far.visible() > 5000 && far.is(UnitState::Degraded, Reason::Settling)),
        "{:?}",
        far.status
    );
    // it was quiet from the first scan on, the library's was not: the same cells come in other messages
    let twin = Heard::all(&expected(&settings, &sent)).cells();
    assert!(far.until(&ear, |far| far.cells() == twin), "{} visible", far.visible());
    assert!(far.until(&ear, |far| far.status.is_some_and(|s| s.e2e_errors >= 7)), "{:?}", far.status);

    // silence
    let blind = |far: &Heard| far.is(UnitState::Blind, Reason::RadarSilent) && far.visible() == 0;
    assert!(far.until(&ear, blind), "{:?}, {} visible", far.status, far.visible());

    // the radar's cable is pulled and plugged in again
    drop(radar);
    daemon.wait_for("radar: lost");
    let mut radar = Terminal::plug(&radar_name);
    daemon.wait_for_times("radar: open", 2);
    // what the radar has shown of its noise outlasts the gap, all else begins anew
    sent.extend(stream(&mut radar, &mut script, &scans[45..75], begin, false));
    let twin = Heard::all(&expected(&settings, &sent));
    assert!(twin.visible() > 5000, "{}", twin.visible());
    assert!(far.until(&ear, |far| far.cells() == twin.cells()), "{} and {}", far.visible(), twin.visible());
    assert!(far.until(&ear, |far| far.is(UnitState::Degraded, Reason::Settling)), "{:?}", far.status);

    // and the other one
    drop(ear);
    stream(&mut radar, &mut script, &scans[75..80], begin, false);
    daemon.wait_for("maps: lost");
    let ear = Ear::plug(&maps_name, begin);
    daemon.wait_for_times("maps: open", 2);
    (far.taken, far.unstuffer) = (0, Unstuffer::new());
    stream(&mut radar, &mut script, &scans[80..95], begin, false);
    assert!(far.until(&ear, |far| far.visible() > 5000), "{}", far.visible());

    // stopped: the last map says unknown, the last status that there is none
    daemon.terminate();
    assert_eq!(daemon.wait().code(), Some(0), "{}", daemon.log());
    let gone = |far: &Heard| far.is(UnitState::Starting, Reason::None) && far.visible() == 0;
    assert!(far.until(&ear, gone), "{:?}, {} visible", far.status, far.visible());
    assert!(daemon.log().contains("stopping"), "{}", daemon.log());
}

/// Frames of a TI radar at 20 Hz, each of these points.
fn stream_ti(radar: &mut Terminal, numbers: std::ops::Range<u32>, points: &[[f32; 4]]) {
    for number in numbers {
        radar.send(&Frame::new(TiFamily::Bytes40, number).cartesian(points).bytes());
        sleep(Duration::from_millis(50));
    }
}

#[test]
#[ignore = "needs the daemon"]
fn linux_a_radar_that_sends_nan_is_blind_until_its_first_good_point() {
    let (settings, _) = shipped(0.1);
    let folder = Folder::new().unwrap();
    let begin = Instant::now();
    let mut radar = Terminal::plug(&folder.0.join("radar"));
    let ear = Ear::plug(&folder.0.join("maps"), begin);
    let input = "[input]\nradar = \"ti\"\nport = \"FOLDER/radar\"\n[input.ti]\nheader_bytes = 40\n";
    let mut daemon = Daemon::start_in(folder, &format!("{input}{PORTS}{PATIENT}{}", tables(&settings)), &[]);
    daemon.wait_for("started");
    daemon.wait_for("radar: open");
    let mut far = Heard::new();
    stream_ti(&mut radar, 0..40, &[[f32::NAN; 4]; 20]);
    let blind = |far: &Heard| far.is(UnitState::Blind, Reason::UnusablePoints) && far.visible() == 0;
    assert!(far.until(&ear, blind), "{:?}", far.status);
    // and stays so
    stream_ti(&mut radar, 40..60, &[[f32::NAN; 4]; 20]);
    let seen = |far: &Heard| far.visible() > 0 || far.is(UnitState::Degraded, Reason::Settling);
    let heard = ear.heard().len();
    far.until(&ear, |far| seen(far) || far.taken == heard);
    assert!(!seen(&far), "{:?}, {} visible", far.status, far.visible());
    // one point on the road among them is a radar that sees
    let good = [1.0, 30.0, -5.0, -12.0];
    stream_ti(&mut radar, 60..110, &[[f32::NAN; 4], good]);
    assert!(
        far.until(&ear, |far| far.is(UnitState::Degraded, Reason::Settling) && far.visible() > 5000),
        "{:?}",
        far.status
    );
    daemon.terminate();
    assert_eq!(daemon.wait().code(), Some(0), "{}", daemon.log());
}
