//! A log of a bus in, the log of the broadcast out: frame by frame what the library's session gives.

use std::path::{Path, PathBuf};
use std::process::Command;

use viewshed::fixed::time::Time;
use viewshed::fusion::FixturesConfig;
use viewshed::inputs::ars408::Ars408Config;
use viewshed::map::polar::PolarMap;
use viewshed::probability::Quantiser;
use viewshed::unit::Unit;
use viewshed::unit::profile::reference::supervised::{Ars408, Parameters, State};
use viewshed::unit::profile::reference::{QuantisedSender, State as Radar3d};
use viewshed::unit::settings::Settings;
use viewshed::wire::broadcast::{BroadcastConfig, Medium};
use viewshed::wire::frame::CanFrame;
use viewshed::wire::message::{Addresses, Epoch, Plane};
use viewshed_harness::boards::can_twin::clusters;
use viewshed_harness::boards::machine::Folder;
use viewshed_harness::boards::scans::Scan;
use viewshed_harness::bus::listening::Listening;
use viewshed_harness::recording::can_log::{Content, Line, candump};

use super::daemon::{Daemon, tables};
use crate::shipped;

/// The daemon's epoch after one that was kept as 4.
const EPOCH: Epoch = Epoch::new(5);

/// Everything that is sent, and when.
pub type Sent = Vec<(u64, CanFrame)>;

/// What a unit sends that hears a log, looks once a millisecond, and is stopped a second after the log's end.
pub fn twin(
    settings: &Settings,
    quantiser: Option<Quantiser>,
    log: &[(u64, CanFrame)],
    radar: u8,
    medium: Medium,
) -> Sent {
    let mut parameters: Option<Parameters> = None;
    let header = settings.build::<State>(&mut parameters).unwrap();
    let parameters = parameters.unwrap();
    let mut state = Box::new(State::new(Radar3d::new()));
    let mut map = Box::new(PolarMap::NOWHERE);
    let (first, last) = (log.first().unwrap().0, log.last().unwrap().0);
    let at = Time::from_micros;
    let config = BroadcastConfig::new(0, medium);
    let mut sender = Box::new(QuantisedSender::new(config, header, quantiser, EPOCH, at(first)).unwrap());
    let mut unit = Unit::new(&parameters, &mut *state, &mut *map, &mut *sender);
    unit.broadcast().status_mut().firmware = [0, 1, 0];
    let mut decoder = Ars408::new(Ars408Config::sensor(radar));
    let (mut sent, mut rest, mut now) = (Sent::new(), log, first);
    let flush = |unit: &mut Unit<'_, State, QuantisedSender>, now: u64, sent: &mut Sent| {
        sent.extend(std::iter::from_fn(|| unit.next_frame(at(now))).map(|frame| (now, frame)));
    };
    loop {
        now += 1000;
        while let Some(((time, frame), after)) = rest.split_first().filter(|((time, _), _)| *time <= now) {
            rest = after;
            unit.take(&mut decoder, frame, at(*time));
            flush(&mut unit, *time, &mut sent);
        }
        unit.wait(&mut decoder, at(now));
        if now >= last + 1_000_000 {
            break;
        }
        flush(&mut unit, now, &mut sent);
    }
    unit.reset();
    for past in 1..=300 {
        // the first step begins it
        let now = now + 1000 + 1000 * past;
        unit.idle(at(now));
        flush(&mut unit, now, &mut sent);
    }
    sent
}

pub fn read(path: &Path) -> Sent {
    let text = std::fs::read_to_string(path).unwrap();
    let lines = text.lines().map(|line| candump::line(line).unwrap());
    lines.map(|line| (line.time_ns as u64 / 1000, *line.frame().unwrap())).collect()
}

pub fn config(settings: &Settings, log: &Path, radar: u8, medium: &str) -> String {
    format!(
        "state_dir = \"FOLDER\"\n[input]\nradar = \"ars408\"\ncandump = \"{}\"\nclock = \"input\"\nsensor_id = {radar}\n\
         [output]\nmedium = \"{medium}\"\ncandump = \"FOLDER/maps.log\"\n{}",
        log.display(),
        tables(settings)
    ) + &settings
        .fixtures
        .map_or_else(String::new, |f| format!("[fixtures]\nlearned_windows = {}\n", f.learned_windows))
}

/// The scans as the log of an ARS408, in a folder of its own.
pub fn logged(scans: &[Scan]) -> (Folder, PathBuf) {
    let folder = Folder::new().unwrap();
    let log = folder.0.join("radar.log");
    let mut text = String::new();
    for scan in clusters(scans, scans.len(), 240) {
        // as they come on a bus of 500 kbit/s, four in a millisecond
        for (n, frame) in scan.frames.into_iter().enumerate() {
            let micros = 1_700_000_000_000_000 + scan.time.micros() as i64 + 250 * n as i64;
            let line = Line { time_ns: 1000 * micros, interface: "can0".into(), content: Content::Data(frame) };
            text += &format!("{line}\n");
        }
    }
    std::fs::write(&log, text).unwrap();
    (folder, log)
}

/// Runs the daemon over a log and compares every frame and its time.
fn same(settings: &Settings, log: &Path, radar: u8, name: &str, medium: Medium) -> (Daemon, Sent) {
    let folder = Folder::new().unwrap();
    std::fs::write(folder.0.join("epoch"), "4").unwrap();
    let mut daemon = Daemon::start_in(folder, &config(settings, log, radar, name), &[]);
    assert_eq!(daemon.wait().code(), Some(0), "{}", daemon.log());
    let sent = read(&daemon.folder.0.join("maps.log"));
    let expected = twin(settings, None, &read(log), radar, medium);
    println!("{}, sensor {radar}, {name}: {} frames", log.file_name().unwrap().display(), sent.len());
    let first = sent.iter().zip(&expected).position(|(a, b)| a != b);
    assert_eq!((first, sent.len()), (None, expected.len()), "first frame that differs, and how many came");
    (daemon, sent)
}

fn made_up() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/ars408-made-up.log")
}

#[test]
#[ignore = "needs the daemon"]
fn linux_every_frame_of_the_shipped_log_is_the_same() {
    let (settings, _) = shipped(0.1);
    for radar in [0, 3] {
        for (name, medium) in
            [("can", Medium::Can(Addresses::STANDARD)), ("can-fd", Medium::CanFd(Addresses::STANDARD))]
        {
            let (_, sent) = same(&settings, &made_up(), radar, name, medium);
            assert!(sent.len() > 50, "{}", sent.len());
        }
    }
}

#[test]
#[ignore = "needs the daemon"]
fn linux_every_frame_of_the_motorway_is_the_same_and_listen_decodes_all() {
    let (settings, scans) = shipped(20.0);
    let (_folder, log) = logged(&scans);
    let (daemon, sent) = same(&settings, &log, 0, "can", Medium::Can(Addresses::STANDARD));
    assert!(sent.len() > 15 * scans.len(), "{} frames of {} scans", sent.len(), scans.len());

    let (maps, json) = (daemon.folder.0.join("maps.log"), daemon.folder.0.join("listen.json"));
    let listen = Command::new(env!("CARGO_BIN_EXE_viewshed"))
        .arg("listen")
        .args([&maps, Path::new("--json"), &json])
        .output()
        .unwrap();
    assert!(listen.status.success(), "{}", String::from_utf8_lossy(&listen.stderr));
    let heard: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    let sensor = &heard["sensors"][0];
    assert_eq!(sensor["status"]["firmware"], serde_json::json!([0, 1, 0]));
    assert_eq!(sensor["status"]["state"], "Starting", "it said good-bye");
    let counters = &sensor["counters"];
    for wrong in ["protection", "lost", "repeated", "out_of_sequence", "malformed"] {
        assert_eq!(counters[wrong], 0, "{wrong}: {counters}");
    }
    assert_eq!(counters["epoch"], 1, "a session begins with the second frame: {counters}");
    let (accepted, early) = (counters["accepted"].as_u64().unwrap(), counters["early"].as_u64().unwrap());
    assert_eq!(accepted + early + counters["late"].as_u64().unwrap() + 1, sent.len() as u64);
    assert!(early < 100, "{counters}");
    let maps = sensor["maps"].as_array().unwrap();
    let visible = |k: usize| maps[k]["visible"].as_u64().unwrap();
    assert!(visible(10) > 5000, "{:?}", maps[10]);
    assert_eq!(visible(maps.len() - 1), 0, "and its last map says unknown");
}

#[test]
#[ignore = "needs the daemon"]
fn linux_a_sector_that_goes_dark_is_unknown_to_receivers_and_its_status_says_so() {
    let fixtures = &*Box::leak(Box::new(FixturesConfig { learned_windows: 12, ..FixturesConfig::default() }));
    let (settings, mut scans) = shipped(32.0);
    let settings = Settings { fixtures: Some(fixtures), ..settings };
    let begin = scans[0].time.micros();
    for scan in scans.iter_mut().filter(|scan| scan.time.micros() > begin + 15_000_000) {
        // the left third
        scan.detections.retain(|d| d.azimuth.radians().to_degrees() < 20.0);
    }
    let (_folder, log) = logged(&scans);
    let (daemon, sent) = same(&settings, &log, 0, "can-fd", Medium::CanFd(Addresses::STANDARD));
    assert!(daemon.log().contains("radar Degraded: SectorBlind"), "{}", daemon.log());

    let mut heard = Listening::new(Addresses::STANDARD, None);
    let mut known = Vec::new();
    for (micros, frame) in &sent {
        let line = Line { time_ns: 1000 * *micros as i64, interface: "can0".into(), content: Content::Data(*frame) };
        heard.take(&line);
        let map = heard.map(0);
        let Some(header) = map.header() else { continue };
        let of = |azimuth: u8| map.ray(Plane::Visibility, usize::from(azimuth)).known.end();
        let status = heard.heard(0, Vec::new()).and_then(|heard| heard.status).map(|s| (s.state, s.reason));
        let ends = [header.azimuths / 12, header.azimuths - header.azimuths / 12].map(of);
        known.push((micros - sent[0].0, ends, status.unwrap_or_default()));
    }
    let at = |s: u64| known.iter().find(|(micros, ..)| *micros > s * 1_000_000).unwrap();
    let told = |reason: &str| ("Degraded".to_owned(), reason.to_owned());
    let (_, [right, left], before) = at(14);
    assert!(*right > 0 && *left > 0 && *before == told("Settling"), "both sides are known: {:?}", at(14));
    let (_, [right, left_dark], status) = at(28);
    assert!(*right > 0 && *left_dark == 0, "the left one is unknown: {:?}", at(28));
    assert_eq!(*status, told("SectorBlind"));
}
