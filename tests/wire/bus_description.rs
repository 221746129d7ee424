//! The descriptions hold every message, classic and CAN FD: two readers of them find in our frames what
//! we put there.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::process::{Command, Stdio};

use crate::dbc::{Signals, decode};
use crate::shadows::{A, Map, Shadows, USUAL, W, header};
use crate::skipped::skipped;
use can_dbc::Dbc;
use viewshed::fixed::angle::Angle;
use viewshed::fixed::time::Time;
use viewshed::map::azimuths::Narrow;
use viewshed::probability::Levels;
use viewshed::sensor::road::RoadPoint;
use viewshed::unit::can_service::{ANSWER, CanService, CanServiceConfig, REQUEST, Tool};
use viewshed::unit::profile::small;
use viewshed::unit::settings::{BlockKind, SettingsSlots, StoredSettings, Which};
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::frame::CanFrame;
use viewshed::wire::header::{Header, WireMount};
use viewshed::wire::map_message::{self, LIMITS, Plain};
use viewshed::wire::message::{Addresses, Epoch, Message, Part, Plane, Received, Word};
use viewshed::wire::scan_number::ScanNumber;
use viewshed::wire::status::{FrameTime, Reason, ResetCause, UnitState};
use viewshed::wire::visible_range;

const CLASSIC: Medium = Medium::Can(Addresses::STANDARD);
const FD: Medium = Medium::CanFd(Addresses::STANDARD);

fn path(medium: Medium) -> &'static str {
    if medium == CLASSIC {
        concat!(env!("CARGO_MANIFEST_DIR"), "/tests/dbc/viewshed.dbc")
    } else {
        concat!(env!("CARGO_MANIFEST_DIR"), "/tests/dbc/viewshed-fd.dbc")
    }
}

fn described(medium: Medium) -> Dbc {
    Dbc::try_from(std::fs::read_to_string(path(medium)).unwrap().as_str()).unwrap()
}

fn sent_header() -> Header {
    Header {
        mount: WireMount {
            origin: RoadPoint::new(-123_456, 7890),
            height_cm: 612,
            yaw: Angle::from_raw(-16384),
            pitch: Angle::from_raw(728),
            roll: Angle::from_raw(-3),
        },
        probability: Levels::from_bytes([51, 178, 242, 0xAB, 0xCD]),
        ..header(0xDEAD_BEEF)
    }
}

const TIME_MS: u64 = 7_000_000_000;

/// A few seconds of a sensor's traffic, all planes, with visible ranges; and the maps by their numbers.
fn frames(medium: Medium) -> (Vec<CanFrame>, Vec<(f64, Map)>) {
    frames_of(medium, sent_header())
}

fn frames_of(medium: Medium, header: Header) -> (Vec<CanFrame>, Vec<(f64, Map)>) {
    let config = BroadcastConfig { visible_range_ms: Some(200), gap_us: 100, ..BroadcastConfig::new(0, medium) };
    let time = |us: u64| Time::from_micros(TIME_MS * 1000 + us);
    let mut sender = Broadcaster::<A, W, 3>::new(config, header, Epoch::new(11), time(0)).unwrap();
    sender.set_synchronised(true);
    let status = sender.status_mut();
    (status.state, status.reason, status.reset_cause) =
        (UnitState::Degraded, Reason::IncompleteScans, ResetCause::Watchdog);
    (status.firmware, status.radar_lost, status.e2e_errors, status.bus_off) = ([1, 22, 3], 40_000, 515, 2);
    status.frame_times = [3_100, 12_400].map(|us| FrameTime::of(us, 1_000_000));
    let mut shadows = Shadows::new(3);
    let (mut frames, mut maps) = (Vec::new(), Vec::new());
    for us in (0..3_000_000).step_by(100) {
        if us % 67_000 == 0 {
            let map = shadows.next();
            let _ = sender.scan(time(us), &map);
            maps.push((f64::from(ScanNumber::at(time(us)).byte()), map));
        }
        frames.extend(sender.next_frame(time(us)));
    }
    frames.extend(configuration(medium));
    (frames, maps)
}

/// Every signal's last value, over all frames.
fn all_signals(dbc: &Dbc, frames: &[CanFrame]) -> Signals {
    frames.iter().flat_map(|frame| decode(dbc, frame).1).collect()
}

#[test]
fn every_message_is_described_and_no_other() {
    for medium in [CLASSIC, FD] {
        let parts = |plane| {
            let words = [Word::Second, Word::Third, Word::Fourth].map(Part::More);
            let words = words.into_iter().filter(|_| medium == CLASSIC);
            let parts = [Part::Refresh, Part::Delta, Part::Plain].into_iter().chain(words);
            parts.map(move |part| Message::Map(plane, part))
        };
        let others = [Message::Status, Message::Header, Message::VisibleRange, REQUEST, ANSWER];
        let sent = others.into_iter().chain(Plane::ALL.into_iter().flat_map(parts));
        let mut ids: Vec<u32> = sent.map(|m| Addresses::STANDARD.id(0, m).unwrap().raw()).collect();
        let dbc = described(medium);
        let mut found: Vec<u32> = dbc.messages.iter().map(|m| m.id.raw()).collect();
        ids.sort_unstable();
        found.sort_unstable();
        assert_eq!(found, ids);
        assert!(medium == FD || dbc.messages.iter().all(|m| m.size == 8));
    }
}

#[test]
fn header_and_status_read_as_they_were_sent() {
    for medium in [CLASSIC, FD] {
        header_and_status(medium);
    }
}

fn header_and_status(medium: Medium) {
    let (frames, _) = frames(medium);
    let got = all_signals(&described(medium), &frames);
    let turn = 360.0 / 65536.0;
    let expected = [
        ("Epoch", 11.0),
        ("State", 3.0),
        ("Reason", 4.0),
        ("Reset_Cause", 4.0),
        ("Frame_Time", 3.1),
        ("Frame_Time_Longest", 12.4),
        ("Firmware_Major", 1.0),
        ("Firmware_Minor", 22.0),
        ("Firmware_Patch", 3.0),
        ("Wire_Version", 1.0),
        ("Status_Fingerprint", f64::from(0xDEAD_BEEF_u32)),
        ("Radar_Lost", 40_000.0),
        ("Azimuths_Dropped", 0.0),
        ("E2E_Errors", 515.0),
        ("Bus_Off", 2.0),
        ("Clock_Synchronised", 1.0),
        ("Header_Wire_Version", 1.0),
        ("Mount_X", -1234.56),
        ("Mount_Y", 78.90),
        ("Mount_Height", 6.12),
        ("Mount_Yaw", -90.0),
        ("Mount_Pitch", 728.0 * turn),
        ("Mount_Roll", -3.0 * turn),
        ("Planes", 7.0),
        ("Azimuth_Origin", -10_000.0 * turn),
        ("Azimuth_Span", 20_000.0 * turn),
        ("Some_Narrow", 0.0),
        ("Azimuths", A as f64),
        ("Range_Cell", 2.0),
        ("Ranges", 64.0),
        ("Usual_First", USUAL.near() as f64),
        ("Usual_Last", (USUAL.end() - 1) as f64),
        ("Fingerprint", f64::from(0xDEAD_BEEF_u32)),
        ("Probability_Known", 51.0 / 255.0),
        ("Probability_Visible", 178.0 / 255.0),
        ("Probability_Clear", 242.0 / 255.0),
        ("Table_Check_Sum", f64::from(0xABCD_u16)),
    ];
    for (name, value) in expected {
        assert!((got[name] - value).abs() < 1e-9, "{name}: {} instead of {value}", got[name]);
    }
    assert!((TIME_MS as f64..TIME_MS as f64 + 3000.0).contains(&got["Time"]) && (1.0..4.0).contains(&got["Uptime"]));
}

#[test]
fn azimuths_of_a_header_in_which_some_are_narrow_read_as_they_were_sent() {
    let narrow = Narrow::from_bytes([3, 9, 4], A as u8).unwrap();
    for medium in [CLASSIC, FD] {
        let (frames, _) = frames_of(medium, Header { narrow, probability: None, ..sent_header() });
        let got = all_signals(&described(medium), &frames);
        assert_eq!((got["Some_Narrow"], got["Azimuths"], got["Probability_Clear"]), (1.0, A as f64, 0.0));
        // where probabilities would be, the first azimuth and the first behind them
        assert_eq!([got["Probability_Known"], got["Probability_Visible"]].map(|v| (v * 255.0).round()), [3.0, 9.0]);
    }
}

#[test]
fn ranges_words_and_cells_read_as_they_were_sent() {
    for medium in [CLASSIC, FD] {
        ranges_words_and_cells(medium);
    }
}

/// Nothing is kept.
struct Nowhere;

impl SettingsSlots for Nowhere {
    fn slot(&self, _: usize) -> &[u8] {
        &[]
    }

    fn write(&mut self, _: usize, _: &[u8]) {}
}

/// An integrator's requests and what a unit without a block answers.
fn configuration(medium: Medium) -> Vec<CanFrame> {
    let config = CanServiceConfig { gap_us: 0, ..CanServiceConfig::new(0, medium) };
    let check = small::CHECK;
    let mut unit =
        CanService::start(config, Epoch::new(11), Time::from_micros(0), StoredSettings::read(&Nowhere, check));
    let mut tool = Tool::new(0, medium);
    let mut frames: Vec<CanFrame> = tool.write(&[0x56; 12]).collect();
    frames.extend([tool.read(Which::in_use(BlockKind::Settings)).unwrap(), tool.restart().unwrap()]);
    for frame in frames.clone() {
        let _ = unit.take(&frame, &mut Nowhere);
        frames.extend(std::iter::from_fn(|| unit.next_frame(Time::from_micros(0), &Nowhere)));
    }
    frames
}

#[test]
fn requests_and_answers_read_as_they_were_sent() {
    for medium in [CLASSIC, FD] {
        let dbc = described(medium);
        let read: Vec<_> = configuration(medium).iter().map(|frame| decode(&dbc, frame)).collect();
        let number = |k: usize, name: &str| read[k].1[name];
        assert_eq!((number(0, "Request_Kind"), number(0, "Block_Length")), (1.0, 12.0));
        let word = f64::from(0x5656_5656_u32);
        assert_eq!((number(3, "Request_Number"), number(3, "Block_Part"), number(4, "Block_Last")), (2.0, word, word));
        assert_eq!(number(6, "Restart_Word"), f64::from(u32::from_be_bytes(*b"VSCB")));
        let answers = &read[7..];
        assert!(answers.iter().all(|(name, _)| name == "Viewshed_Configuration"));
        assert_eq!((answers[0].1["Answer_Number"], answers[0].1["Started_Sequence"]), (255.0, 0.0));
        assert!(answers.iter().any(|(_, a)| a["Answer_Kind"] == 132.0 && a["Refused_Detail"] == 0.0));
    }
}

fn ranges_words_and_cells(medium: Medium) {
    let (frames, maps) = frames(medium);
    let dbc = described(medium);
    let (mut seen, mut ranges) = (BTreeMap::new(), 0);
    for frame in &frames {
        let (name, got) = decode(&dbc, frame);
        *seen.entry(name).or_insert(0) += 1;
        let received = Received::from_frame(frame, &Addresses::STANDARD).unwrap();
        assert_eq!(got["E2E_Counter"], f64::from(received.counter));
        if received.message == Message::VisibleRange {
            let (_, map) = maps.iter().find(|(number, _)| *number == got["Range_Scan"]).unwrap();
            for (azimuth, ray) in map.0.iter().enumerate() {
                let Some(range) = got.get(&format!("Visible_Range_{azimuth:03}")) else { continue };
                assert_eq!(*range, 2.0 * f64::from(visible_range::steps(ray, 200)));
                ranges += 1;
            }
        }
        if let Message::Map(_, part) = received.message {
            let message = map_message::parse(received.own, frame.fd).unwrap();
            assert_eq!(got["Scan"], f64::from(message.scan.byte()));
            let start = if part == Part::Plain { "Azimuth" } else { "Start_Azimuth" };
            assert_eq!(got[start], message.start as f64);
            match (part, frame.fd) {
                (Part::Plain, false) => {
                    let whole = ((got["Segment"] as u64) << 29) + got["Cells"] as u64;
                    assert!(whole == message.words()[0] && got["Segment"] <= f64::from(LIMITS));
                }
                (Part::Plain, true) => {
                    let Some(Plain::Whole(ray)) = message.plain::<W>(received.own, true) else { panic!("no ray") };
                    let [near, last] = ray.known.limits().map(f64::from);
                    assert_eq!((got["First_Known"], got["Last_Known"]), (near, last));
                    let cells = got.get("Cells_000").copied().unwrap_or(0.0);
                    assert_eq!(cells, f64::from(ray.bits().words()[0].reverse_bits()));
                }
                (_, false) => assert_eq!(got["Word"], message.words()[0] as f64),
                (_, true) => {
                    for (k, word) in message.words().iter().enumerate() {
                        assert_eq!(got[&format!("Word_{:02}", k + 1)], *word as f64);
                    }
                }
            }
        }
    }
    assert!(seen.len() >= if medium == CLASSIC { 15 } else { 9 }, "{seen:?}");
    assert!(ranges > A, "{ranges} ranges");
}

#[test]
fn cantools_reads_the_same() {
    // where tests/cantools.sh puts it
    let installed = concat!(env!("CARGO_TARGET_TMPDIR"), "/../cantools/bin/python");
    let installed = if std::path::Path::new(installed).exists() { installed } else { "python3" };
    let python = std::env::var("PYTHON").unwrap_or_else(|_| installed.into());
    if !Command::new(&python).args(["-c", "import cantools"]).stderr(Stdio::null()).status().is_ok_and(|s| s.success())
    {
        return skipped("cantools", "the bus description (tests/cantools.sh installs it)");
    }
    for medium in [CLASSIC, FD] {
        with_cantools(&python, medium);
    }
}

fn with_cantools(python: &str, medium: Medium) {
    let (frames, _) = frames(medium);
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/dbc/decode.py");
    let mut child =
        Command::new(python).args([script, path(medium)]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = String::new();
    for frame in &frames {
        let data: String = frame.data().iter().map(|b| format!("{b:02X}")).collect();
        lines += &format!("{:03X}#{data}\n", frame.id.raw());
    }
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(lines.as_bytes()));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    assert!(output.status.success());
    let dbc = described(medium);
    let text = String::from_utf8(output.stdout).unwrap();
    let mut compared = 0;
    for (line, frame) in text.lines().zip(&frames) {
        let mut words = line.split(' ').skip(1);
        let (name, ours) = decode(&dbc, frame);
        assert_eq!(words.next(), Some(name.as_str()));
        let theirs: Vec<(String, f64)> = words
            .map(|word| word.split_once('=').unwrap())
            .map(|(name, value)| (name.to_owned(), value.parse().unwrap()))
            .collect();
        assert_eq!(theirs.len(), ours.len(), "{line}");
        for (signal, value) in theirs {
            assert!((ours[&signal] - value).abs() < 1e-6, "{name} {signal}: {value} instead of {}", ours[&signal]);
            compared += 1;
        }
    }
    assert!(compared > 5 * frames.len());
}
