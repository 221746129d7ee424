//! The description of authenticated messages holds every one of them, and finds in them what was sent.

use std::collections::BTreeSet;
use std::io::Write as _;
use std::process::{Command, Stdio};

use crate::dbc::decode;
use crate::shadows::{A, Shadows, W, header};
use crate::skipped::skipped;
use can_dbc::Dbc;
use viewshed::fixed::time::Time;
use viewshed::wire::broadcast::{BroadcastConfig, Broadcaster, Medium};
use viewshed::wire::frame::CanFrame;
use viewshed::wire::map_message;
use viewshed::wire::message::{Addresses, Epoch, Message, Part, Received};
use viewshed::wire::secoc::{Opener, Sealer};
use viewshed::wire::visible_range::Ranges;

const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/dbc/viewshed-fd-authenticated.dbc");
const KEY: [u8; 16] = [0x42; 16];
const FIRST: u64 = 0x0001_2345_FFFF_FFF0;

fn described() -> Dbc {
    Dbc::try_from(std::fs::read_to_string(PATH).unwrap().as_str()).unwrap()
}

/// Some seconds of all planes, with visible ranges.
fn frames() -> Vec<CanFrame> {
    let medium = Medium::CanFd(Addresses::STANDARD);
    let config =
        BroadcastConfig { visible_range_ms: Some(200), gap_us: 100, secured: true, ..BroadcastConfig::new(0, medium) };
    let time = |us: u64| Time::from_micros(9_000_000 + us);
    let mut sender = Broadcaster::<A, W, 3>::new(config, header(7), Epoch::new(11), time(0)).unwrap();
    let (mut sealer, mut shadows, mut frames) = (Sealer::new(KEY, FIRST), Shadows::new(3), Vec::new());
    for us in (0..3_000_000).step_by(100) {
        if us % 67_000 == 0 {
            let _ = sender.scan(time(us), &shadows.next());
        }
        let packet = sender.next_sealed(time(us), &mut sealer);
        frames.extend(packet.map(|packet| packet.frame(&Addresses::STANDARD).unwrap()));
    }
    frames
}

/// As the description wants it: without the authenticator where the length varies.
fn readable(frame: &CanFrame, message: Message) -> CanFrame {
    let varies = matches!(message, Message::VisibleRange | Message::Map(..));
    let length = frame.data().len() - if varies { 8 } else { 0 };
    CanFrame::fd(frame.id, &frame.data()[..length]).unwrap()
}

#[test]
fn every_authenticated_message_reads_as_it_was_sent() {
    let (dbc, frames) = (described(), frames());
    let (mut opener, mut seen) = (Opener::resume(KEY, FIRST), BTreeSet::new());
    for frame in &frames {
        let sealed = Received::from_frame(frame, &Addresses::STANDARD).unwrap();
        let opened = opener.open(&sealed).unwrap();
        let (name, got) = decode(&dbc, &readable(frame, opened.message));
        seen.insert(name.clone());
        assert_eq!((got["Authenticated"], got["Epoch"], got["Sensor"]), (1.0, 11.0, 0.0));
        assert_eq!(got["E2E_Counter"], f64::from(sealed.counter));
        let fresh = opener.freshness().unwrap();
        let [.., a, b, c, d, e, f] = frame.data() else { panic!("no code") };
        let code = [a, b, c, d, e, f].iter().fold(0_u64, |code, byte| code << 8 | u64::from(**byte));
        match opened.message {
            Message::Map(_, Part::Refresh | Part::Delta) => {
                let map = map_message::parse(opened.own, true).unwrap();
                assert_eq!((got["Scan"], got["Start_Azimuth"]), (f64::from(map.scan.byte()), map.start as f64));
                for (k, word) in map.words().iter().enumerate() {
                    assert_eq!(got.get(&format!("Word_{:02}", k + 1)).copied(), Some(*word as f64), "{name}");
                }
            }
            Message::Map(..) => assert_eq!(got["Azimuth"], f64::from(opened.own[1])),
            Message::VisibleRange => {
                let ranges = Ranges::parse(opened.own).unwrap();
                let shown = (0..128).filter_map(|a| Some((a, got.get(&format!("Visible_Range_{a:03}"))?)));
                assert!(shown.clone().count() >= 1);
                shown.for_each(|(a, metres)| assert_eq!(ranges.metres(a).map(f64::from).unwrap_or(0.0), *metres));
            }
            _ => {
                assert_eq!((got["Freshness_Lowest"], got["Code"]), ((fresh & 0xFFFF) as f64, code as f64), "{name}");
                if opened.message == Message::Freshness {
                    let full = (got["Freshness_High"] as u64) << 32 | got["Freshness_Low"] as u64;
                    assert_eq!(full, fresh);
                }
            }
        }
    }
    let all: BTreeSet<String> = dbc.messages.iter().map(|m| m.name.clone()).collect();
    let plain = all.iter().filter(|name| name.ends_with("Plain")).cloned().collect();
    assert!(all.difference(&seen).all(|name| BTreeSet::contains(&plain, name)), "{seen:?} of {all:?}");
    // a line a message, and none that is not sent
    assert_eq!(all.len(), 4 + 3 * 3);
}

#[test]
fn cantools_loads_it_strictly_and_reads_the_same() {
    // where tests/cantools.sh puts it
    let installed = concat!(env!("CARGO_TARGET_TMPDIR"), "/../cantools/bin/python");
    let installed = if std::path::Path::new(installed).exists() { installed } else { "python3" };
    let python = std::env::var("PYTHON").unwrap_or_else(|_| installed.into());
    let mut check = Command::new(&python);
    if !check.args(["-c", "import cantools"]).stderr(Stdio::null()).status().is_ok_and(|s| s.success()) {
        return skipped("cantools", "the bus description of secured messages (tests/cantools.sh installs it)");
    }
    let dbc = described();
    let message = |frame: &CanFrame| Received::from_frame(frame, &Addresses::STANDARD).unwrap().message;
    let frames: Vec<CanFrame> = frames().iter().map(|frame| readable(frame, message(frame))).collect();
    let lines: String = frames.iter().fold(String::new(), |lines, frame| {
        let data: String = frame.data().iter().map(|b| format!("{b:02X}")).collect();
        format!("{lines}{:03X}#{data}\n", frame.id.raw())
    });
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/dbc/decode.py");
    let mut child =
        Command::new(python).args([script, PATH]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(lines.as_bytes()));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.lines().count(), frames.len());
    for (line, frame) in text.lines().zip(&frames) {
        let (name, ours) = decode(&dbc, frame);
        let mut words = line.split(' ').skip(1);
        assert_eq!(words.next(), Some(name.as_str()));
        for (signal, value) in words.map(|word| word.split_once('=').unwrap()) {
            assert!((ours[signal] - value.parse::<f64>().unwrap()).abs() < 1e-6, "{name} {signal}: {value}");
        }
    }
}
